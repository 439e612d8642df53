//! Dialogs: the keyboard in them, and what happens on a desktop without a file chooser.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
    time::Duration,
};

use egui::{Event, Key, Modifiers, Theme};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, ExportFormat, PaneId},
    window::dialogs::{Choice, Purpose},
};
use glioscope_tests::{Window, doc, error_text, issue, perform, run, wait_for_workers, window_on};

use crate::PROGRAM;

const SIZE: [f32; 2] = [1280.0, 800.0];

/// The window on a desktop whose file chooser takes 300 ms for `answer`.
fn with_chooser(answer: Choice) -> Window {
    let mut harness = window_on(CaseRef::Sample, SIZE, Theme::Light);
    harness.state_mut().chooser = Arc::new(move |_: &Purpose, _: Option<&Path>| {
        std::thread::sleep(Duration::from_millis(300));
        answer.clone()
    });
    harness.run_ok();
    harness
}

fn wait_for_answer(harness: &mut Window) {
    std::thread::sleep(Duration::from_millis(500));
    harness.run_steps(3);
    harness.run_ok();
}

fn is_asking(harness: &Window) -> bool {
    harness.query_by_label("Path").is_some()
}

fn shortcut(k: Key) -> [Event; 2] {
    [true, false].map(|pressed| Event::Key {
        key: k,
        physical_key: None,
        pressed,
        repeat: false,
        modifiers: Modifiers::COMMAND,
    })
}

#[test]
fn ctrl_o_takes_letters_as_text_from_the_first_on() {
    let mut harness = with_chooser(Choice::Cancelled);
    let before = doc(&harness).clone();
    let typed = "/lmao";
    let mut events = shortcut(Key::O).to_vec();
    for letter in typed.chars() {
        if let Some(key) = Key::from_name(&letter.to_uppercase().to_string()) {
            let modifiers = Modifiers::NONE;
            events.push(Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers });
        }
        events.push(Event::Text(letter.to_string()));
    }
    harness.input_mut().events.extend(events);
    harness.run_ok();
    assert_eq!(harness.get_by_role(egui::accesskit::Role::TextInput).value().as_deref(), Some(typed));
    assert_eq!(doc(&harness), &before, "no letter is a shortcut");
    harness.key_press(Key::Escape);
    harness.run_ok();
    assert!(!is_asking(&harness), "Escape cancels");
    assert_eq!(doc(&harness), &before);
}

#[test]
fn enter_opens_the_typed_path_and_a_wrong_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    glioscope_core::sample::write_sample(&case).unwrap();
    let mut harness = with_chooser(Choice::Cancelled);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_ok();
    let missing = folder.path().join("nothing").display().to_string();
    harness.event(Event::Text(missing.clone()));
    harness.key_press(Key::Enter);
    harness.run_ok();
    assert!(is_asking(&harness));
    assert!(harness.query_by_label_contains(&format!("Nothing is at {missing}")).is_some());
    // The field has the keyboard again.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.event(Event::Text(case.display().to_string()));
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    wait_for_workers(&mut harness);
    assert!(!is_asking(&harness));
    assert_eq!(error_text(&harness), "");
    assert_eq!(doc(&harness).case, CaseRef::Path(case));
}

#[test]
fn without_a_file_chooser_every_dialog_asks_for_the_path_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = with_chooser(Choice::Unavailable("no zenity".into()));
    for command in [
        AppCommand::BrowseFiles,
        AppCommand::BrowseFolders,
        AppCommand::SaveSessionAs,
        AppCommand::ExportMeasurements(ExportFormat::Json),
        AppCommand::ExportRulers(ExportFormat::Csv),
        AppCommand::ScreenshotWindow,
        AppCommand::ScreenshotPane(PaneId::Overlap),
    ] {
        issue(&mut harness, command.clone());
        wait_for_answer(&mut harness);
        assert!(is_asking(&harness), "{command:?}");
        assert!(harness.query_by_label_contains("no file chooser (no zenity)").is_some(), "{command:?}");
        harness.key_press(Key::Escape);
        harness.run_ok();
        assert!(!is_asking(&harness), "{command:?}");
    }
    assert_eq!(error_text(&harness), "");
    let path = folder.path().join("numbers.json");
    issue(&mut harness, AppCommand::ExportMeasurements(ExportFormat::Json));
    wait_for_answer(&mut harness);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.event(Event::Text(path.display().to_string()));
    harness.key_press(Key::Enter);
    harness.run_steps(2);
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    assert!(path.exists());
}

/// The chooser asked about the name as it was typed, not about the one with the ending added.
#[test]
fn a_file_whose_ending_was_added_is_not_replaced_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let content = |path: &Path| std::fs::read_to_string(path).unwrap();
    for (command, typed, written) in [
        (AppCommand::SaveSessionAs, "visit", "visit.glioscope.json"),
        (AppCommand::ExportMeasurements(ExportFormat::Json), "all", "all.json"),
        (AppCommand::ExportRulers(ExportFormat::Csv), "lines", "lines.csv"),
    ] {
        let [typed, written] = [typed, written].map(|name| folder.path().join(name));
        let mut harness = with_chooser(Choice::Path(typed));
        for accepts in [false, true] {
            std::fs::write(&written, "something").unwrap();
            issue(&mut harness, command.clone());
            wait_for_answer(&mut harness);
            assert!(is_asking(&harness), "{command:?}");
            assert!(harness.query_by_label_contains("exists. Press Save to replace it.").is_some());
            assert_eq!(content(&written), "something");
            harness.key_press(if accepts { Key::Enter } else { Key::Escape });
            harness.run_steps(2);
            wait_for_workers(&mut harness);
            assert!(!is_asking(&harness));
            assert_eq!(content(&written) != "something", accepts, "{command:?}");
        }
        std::fs::remove_file(&written).unwrap();
        issue(&mut harness, command.clone());
        wait_for_answer(&mut harness);
        wait_for_workers(&mut harness);
        assert!(written.exists() && !is_asking(&harness), "{command:?}");
    }
}

#[test]
fn a_cancelled_chooser_asks_for_nothing() {
    let mut harness = with_chooser(Choice::Cancelled);
    issue(&mut harness, AppCommand::ExportMeasurements(ExportFormat::Json));
    wait_for_answer(&mut harness);
    assert!(!is_asking(&harness));
    assert_eq!(error_text(&harness), "");
}

#[test]
fn dialogs_hold_the_keyboard_and_enter_and_escape_close_them() {
    let mut harness = with_chooser(Choice::Cancelled);
    let before = doc(&harness).clone();
    for closing in [Key::Enter, Key::Escape] {
        perform(&mut harness, AppCommand::ShowAbout);
        let title = |harness: &Window| harness.query_all_by_label("About Glioscope").count();
        assert!(title(&harness) > 0);
        harness.key_press(Key::L);
        harness.key_press(Key::A);
        harness.run_ok();
        assert_eq!(doc(&harness), &before, "letters do nothing below a dialog");
        harness.key_press(closing);
        harness.run_ok();
        assert_eq!(title(&harness), 0, "{closing:?}");
    }
    harness.key_press(Key::L);
    harness.run_ok();
    assert_ne!(doc(&harness).edit.lens_on, before.edit.lens_on, "shortcuts work again");
}

/// A session saved on the way to another case was offered the other case's folder: the next patient's.
#[test]
fn a_session_is_offered_the_folder_of_its_own_case() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| {
        let case = folder.path().join(name);
        assert!(run(PROGRAM, &["sample", "--out", case.to_str().unwrap()]).status.success());
        case
    });
    let manifest = |case: &Path| CaseRef::Path(case.join("case.toml"));
    let mut harness = window_on(manifest(&first), SIZE, Theme::Light);
    let asked: Arc<Mutex<Vec<Option<PathBuf>>>> = Arc::default();
    let heard = asked.clone();
    harness.state_mut().chooser = Arc::new(move |_: &Purpose, folder: Option<&Path>| {
        heard.lock().unwrap().push(folder.map(Path::to_owned));
        Choice::Cancelled
    });
    harness.run_ok();
    perform(&mut harness, EditCommand::ToggleLens);
    issue(&mut harness, AppCommand::Open(manifest(&second)));
    harness.run_ok();
    harness.get_by_label("Save").click();
    wait_for_answer(&mut harness);
    let asked = asked.lock().unwrap().clone();
    assert_eq!(asked, [Some(first)], "and not {}", second.display());
}
