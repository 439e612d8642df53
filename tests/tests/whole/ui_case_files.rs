//! The dialog of a case's files and the question for the order of dates.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use egui::{Event, Key, Modifiers, Theme};
use egui_kittest::kittest::{NodeT, Queryable};
use glioscope::{
    command::{AppCommand, Command, EditCommand, Workstation},
    model::{CaseRef, PaneId, session},
    window::{dialogs::Choice, recent::Recent},
};
use glioscope_core::case::{Case, OrderBasis, read_manifest};
use glioscope_tests::{
    Dropped, Window, doc, error_text, issue, perform, run, user_window, wait_for_workers, window_of_user,
    window_on, write_cube, write_tck,
};

use crate::PROGRAM;

fn image(path: &Path) {
    write_cube(path, 16, 1.0, |[x, y, z]| (x * 7 + y * 3 + z) as u8);
}

/// A mask of the voxels with `x` below `width`.
fn mask(path: &Path, width: usize) {
    write_cube(path, 16, 1.0, |[x, ..]| u8::from(x < width));
}

/// A folder with an image and two masks.
fn three_files(folder: &Path) -> PathBuf {
    let case = folder.join("case");
    image(&case.join("t1c.nii.gz"));
    mask(&case.join("a_mask.nii.gz"), 4);
    mask(&case.join("b_mask.nii.gz"), 6);
    case
}

fn open(harness: &mut Window, case: CaseRef) {
    issue(harness, AppCommand::Open(case));
    wait_for_workers(harness);
}

fn press(harness: &mut Window, key: Key) {
    harness.key_press(key);
    harness.run_ok();
    wait_for_workers(harness);
}

fn click(harness: &mut Window, label: &str) {
    harness.get_by_label(label).click();
    harness.run_ok();
    wait_for_workers(harness);
}

fn type_in(harness: &mut Window, label: &str, text: &str) {
    harness.get_by_label(label).focus();
    harness.run_ok();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.event(Event::Text(text.to_owned()));
    harness.run_ok();
}

fn choose(harness: &mut Window, file: &str, role: &str) {
    click(harness, &format!("What {file} is"));
    click(harness, role);
}

fn case(harness: &Window) -> &Case {
    harness.state().work.world.case().unwrap()
}

fn mask_ids(harness: &Window) -> Vec<&str> {
    case(harness).time_points.iter().flat_map(|t| t.masks.iter().map(|m| m.mask.id())).collect()
}

fn is_asked(harness: &Window) -> bool {
    harness.query_by_label("Open it like this").is_some()
}

fn is_asked_for_order(harness: &Window) -> bool {
    harness.query_by_label("Use this order").is_some()
}

fn sample_window() -> Window {
    let mut harness = window_on(CaseRef::Sample, [1280.0, 720.0], Theme::Light);
    harness.run_ok();
    harness
}

/// An image and a mask of each of two dates.
fn two_dates(folder: &Path) -> PathBuf {
    let case = folder.join("case");
    for (date, width) in [("2024-01-01", 4), ("2024-03-01", 6)] {
        image(&case.join(date).join("t1c.nii.gz"));
        mask(&case.join(date).join("seg.nii.gz"), width);
    }
    case
}

#[test]
fn dates_are_asked_about_in_a_few_lines_and_the_current_one_is_in_front() {
    let folder = tempfile::tempdir().unwrap();
    let path = two_dates(folder.path());
    // After another case, whose panes nobody has arranged.
    let mut harness = user_window(Workstation::default(), [1280.0, 720.0], Recent::default(), None);
    open(&mut harness, CaseRef::Sample);
    let has_files = |harness: &Window| harness.query_by_label("What 2024-01-01/seg.nii.gz is").is_some();
    open(&mut harness, CaseRef::Path(path));
    assert!(is_asked(&harness) && !has_files(&harness));
    for (label, count) in [("2024-01-01", 1), ("2024-03-01", 1), ("t1c", 2), ("seg", 2)] {
        assert_eq!(harness.query_all_by_label(label).count(), count, "{label}");
    }
    click(&mut harness, "Change…");
    assert!(has_files(&harness));
    // What was opened stays open, whatever becomes of the files.
    choose(&mut harness, "2024-01-01/seg.nii.gz", "left out");
    choose(&mut harness, "2024-01-01/seg.nii.gz", "mask");
    assert!(has_files(&harness));
    press(&mut harness, Key::Enter);
    assert_eq!(error_text(&harness), "");
    assert_eq!(case(&harness).time_labels(), ["2024-01-01", "2024-03-01"]);
    assert_eq!(doc(&harness).nav.time, 1, "the current date");
    let layout = &doc(&harness).edit.layout;
    let front = layout.active_tiles();
    for pane in [PaneId::Change, PaneId::SideBySide, PaneId::Axial] {
        assert!(layout.tiles.find_pane(&pane).is_some_and(|tile| front.contains(&tile)), "{pane:?}");
    }
    assert!(!harness.state().work.has_unsaved_work());
}

/// Folders of several patients often lie side by side: their sessions, too.
#[test]
fn a_session_is_named_after_its_cases_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("patient 7");
    std::fs::rename(two_dates(folder.path()), &path).unwrap();
    let mut harness = sample_window();
    let asked = Arc::new(Mutex::new(Vec::new()));
    let of = Arc::clone(&asked);
    harness.state_mut().chooser = Arc::new(move |purpose, folder| {
        of.lock().unwrap().push((purpose.file_name().unwrap(), folder.map(Path::to_owned)));
        Choice::Cancelled
    });
    // The chooser has a thread of its own.
    let ask = |harness: &mut Window, count: usize| {
        issue(harness, AppCommand::SaveSessionAs);
        for _ in 0..500 {
            if asked.lock().unwrap().len() == count {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        wait_for_workers(harness);
    };
    ask(&mut harness, 1);
    open(&mut harness, CaseRef::Path(path.clone()));
    press(&mut harness, Key::Enter);
    ask(&mut harness, 2);
    let beside = "A session lies beside the case: patient 7.glioscope.json.";
    assert!(harness.query_by_label_contains(beside).is_none());
    let session = folder.path().join("patient 7.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(session));
    open(&mut harness, CaseRef::Sample);
    open(&mut harness, CaseRef::Path(path));
    if is_asked(&harness) {
        press(&mut harness, Key::Enter);
    }
    assert_eq!(case(&harness).time_labels().len(), 2);
    assert!(harness.query_by_label_contains(beside).is_some());
    let asked = asked.lock().unwrap();
    let names: Vec<&str> = asked.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["case.glioscope.json", "patient 7.glioscope.json"]);
    assert_eq!(asked[1].1.as_deref(), Some(folder.path()));
}

#[test]
fn dates_with_something_doubtful_are_asked_about_file_by_file() {
    let has_files = |write: &dyn Fn(&Path)| {
        let folder = tempfile::tempdir().unwrap();
        let path = two_dates(folder.path());
        write(&path);
        let mut harness = sample_window();
        open(&mut harness, CaseRef::Path(path));
        assert!(is_asked(&harness), "{}", error_text(&harness));
        harness.query_by_label("What 2024-01-01/seg.nii.gz is").is_some()
    };
    assert!(!has_files(&|_| {}));
    // Labels may be one mask or many.
    assert!(has_files(&|path| {
        write_cube(&path.join("2024-03-01/seg.nii.gz"), 16, 1.0, |[x, ..]| (x / 6) as u8);
    }));
    assert!(has_files(&|path| image(&path.join("undated.nii.gz"))));
}

#[test]
fn what_each_file_is_can_be_changed_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = three_files(folder.path());
    let mut harness = sample_window();
    open(&mut harness, CaseRef::Path(path.clone()));
    assert!(is_asked(&harness));
    choose(&mut harness, "b_mask.nii.gz", "image");
    type_in(&mut harness, "Id of b_mask.nii.gz", "T2");
    type_in(&mut harness, "Id of a_mask.nii.gz", "rater A");
    type_in(&mut harness, "Name of rater A", "oedema");
    choose(&mut harness, "t1c.nii.gz", "left out");
    assert_eq!(doc(&harness).case, CaseRef::Sample, "nothing is read yet");
    press(&mut harness, Key::Enter);
    assert!(!is_asked(&harness));
    assert_eq!(error_text(&harness), "");
    assert_eq!(mask_ids(&harness), ["rater A"]);
    let ids: Vec<&str> = case(&harness).time_points[0].contexts.iter().map(|c| c.id.as_str()).collect();
    assert_eq!(ids, ["T2"]);
    assert_eq!(doc(&harness).edit.masks.name("rater A"), "oedema");
    let chosen = case(&harness).checks.iter().find(|check| check.code == "left-out-chosen");
    assert!(chosen.is_some_and(|check| check.message.starts_with("t1c.nii.gz: ")), "{chosen:?}");
    // The session has it, wherever the folder is then.
    let saved = path.join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(saved));
    assert_eq!(error_text(&harness), "");
    let moved = folder.path().join("moved");
    std::fs::rename(&path, &moved).unwrap();
    let mut other = sample_window();
    issue(&mut other, AppCommand::OpenSession(moved.join("s.glioscope.json")));
    wait_for_workers(&mut other);
    assert_eq!(error_text(&other), "");
    assert!(!is_asked(&other));
    assert_eq!(mask_ids(&other), ["rater A"]);
    assert_eq!(doc(&other).edit.masks.name("rater A"), "oedema");
    let warnings: Vec<_> = case(&other).checks.iter().filter(|c| c.code.starts_with("session-")).collect();
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn what_can_not_be_read_is_said_and_escape_keeps_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let path = three_files(folder.path());
    let mut harness = sample_window();
    open(&mut harness, CaseRef::Path(path));
    type_in(&mut harness, "Id of b_mask.nii.gz", "a");
    let says = |harness: &Window, text: &str| harness.query_all_by_label_contains(text).count();
    assert_eq!(says(&harness, "another mask is called a"), 2, "beside the row and beside the button");
    assert!(harness.get_by_label("Open it like this").accesskit_node().is_disabled());
    press(&mut harness, Key::Enter);
    press(&mut harness, Key::Enter);
    assert!(is_asked(&harness) && doc(&harness).case == CaseRef::Sample);
    type_in(&mut harness, "Id of b_mask.nii.gz", "b");
    type_in(&mut harness, "Labels of b", "1; 2");
    assert!(says(&harness, "numbers separated by commas") > 0);
    type_in(&mut harness, "Labels of b", "1");
    type_in(&mut harness, "Date of b_mask.nii.gz", "2024-01-01");
    assert!(says(&harness, "no date, while others have one") > 0);
    for file in ["a_mask.nii.gz", "b_mask.nii.gz", "t1c.nii.gz"] {
        choose(&mut harness, file, "left out");
    }
    assert!(says(&harness, "no image and no mask is in") > 0);
    press(&mut harness, Key::Escape);
    assert!(!is_asked(&harness));
    assert_eq!(doc(&harness).case, CaseRef::Sample);
    assert_eq!(error_text(&harness), "");
}

#[test]
fn what_was_accepted_is_not_asked_again_until_a_file_is_added() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("config");
    let path = three_files(folder.path());
    let window = || {
        let mut harness = window_of_user(Recent::in_folder(&config), [1280.0, 720.0]);
        harness.run_ok();
        harness
    };
    let mut first = window();
    open(&mut first, CaseRef::Path(path.clone()));
    type_in(&mut first, "Id of a_mask.nii.gz", "rater A");
    press(&mut first, Key::Enter);
    assert_eq!(mask_ids(&first), ["rater A", "b"]);
    // A session beside the files, and another kind of file, are none of them.
    perform(&mut first, AppCommand::SaveSessionTo(path.join("s.glioscope.json")));
    std::fs::write(path.join("notes.txt"), "x").unwrap();
    let mut second = window();
    open(&mut second, CaseRef::Path(path.clone()));
    assert!(!is_asked(&second));
    assert_eq!(error_text(&second), "");
    assert_eq!(mask_ids(&second), ["rater A", "b"]);
    assert!(second.query_by_label_contains("Opened as accepted before; File, Case files…").is_some());
    mask(&path.join("c_mask.nii.gz"), 3);
    let mut third = window();
    open(&mut third, CaseRef::Path(path.clone()));
    assert!(is_asked(&third), "a file was added");
    press(&mut third, Key::Escape);
    std::fs::remove_file(path.join("c_mask.nii.gz")).unwrap();
    open(&mut third, CaseRef::Path(path.clone()));
    assert!(!is_asked(&third), "as before");
    // Unchanged guesses are remembered, too; what can't be read is asked about again.
    mask(&path.join("b_mask.nii.gz"), 9);
    open(&mut third, CaseRef::Path(path.clone()));
    press(&mut third, Key::Enter);
    assert_eq!(doc(&third).case, CaseRef::Path(path.clone()));
    assert_eq!(mask_ids(&third), ["a", "b"]);
    open(&mut third, CaseRef::Sample);
    open(&mut third, CaseRef::Path(path));
    assert!(!is_asked(&third) && mask_ids(&third) == ["a", "b"]);
}

#[test]
fn the_open_case_is_edited_saved_as_a_manifest_and_keeps_its_document() {
    let folder = tempfile::tempdir().unwrap();
    let path = three_files(folder.path());
    let mut harness = sample_window();
    let is_enabled =
        |harness: &Window| Command::from(AppCommand::ShowCaseFiles).enabled(&harness.state().work);
    assert!(!is_enabled(&harness), "the sample has no files");
    open(&mut harness, CaseRef::Path(path.clone()));
    press(&mut harness, Key::Enter);
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Axial));
    assert!(is_enabled(&harness));
    let show = |harness: &mut Window| {
        issue(harness, AppCommand::ShowCaseFiles);
        wait_for_workers(harness);
    };
    show(&mut harness);
    assert!(is_asked(&harness));
    type_in(&mut harness, "Name of a", "necrosis");
    choose(&mut harness, "b_mask.nii.gz", "left out");
    let manifest = path.join("case.toml");
    let answer = manifest.clone();
    harness.state_mut().chooser = Arc::new(move |_, _| Choice::Path(answer.clone()));
    click(&mut harness, "Save as case.toml…");
    for _ in 0..100 {
        std::thread::sleep(std::time::Duration::from_millis(20));
        harness.run_steps(1);
    }
    assert_eq!(error_text(&harness), "");
    let spec = read_manifest(&manifest).unwrap();
    assert_eq!((spec.masks.len(), spec.masks[0].name.as_deref()), (1, Some("necrosis")));
    assert_eq!(spec.masks[0].source.name(), path.join("a_mask.nii.gz").display().to_string());
    assert!(is_asked(&harness), "saving is no answer");
    press(&mut harness, Key::Enter);
    assert_eq!(error_text(&harness), "");
    assert_eq!(mask_ids(&harness), ["a"]);
    assert_eq!(doc(&harness).edit.masks.name("a"), "necrosis");
    assert_eq!(doc(&harness).edit.maximized, Some(PaneId::Axial), "the rest is as it was");
    assert!(harness.state().work.has_unsaved_work());
    // What is left out is still offered.
    show(&mut harness);
    choose(&mut harness, "b_mask.nii.gz", "mask");
    type_in(&mut harness, "Id of b_mask.nii.gz", "b");
    press(&mut harness, Key::Enter);
    assert_eq!(mask_ids(&harness), ["a", "b"]);
}

#[test]
fn dates_without_an_order_are_asked_for_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.toml");
    for (name, width) in [("late.nii", 8), ("early.nii", 4)] {
        mask(&folder.path().join(name), width);
    }
    let entry = |name: &str| format!("[[mask]]\nid = \"A\"\nfile = \"{name}.nii\"\ntime = \"{name} scan\"\n");
    std::fs::write(&path, format!("glioscope = 1\n{}{}", entry("late"), entry("early"))).unwrap();
    let mut harness = sample_window();
    open(&mut harness, CaseRef::Path(path.clone()));
    assert!(is_asked_for_order(&harness));
    press(&mut harness, Key::Escape);
    assert!(!is_asked_for_order(&harness));
    assert_eq!((error_text(&harness).as_str(), &doc(&harness).case), ("", &CaseRef::Sample));
    open(&mut harness, CaseRef::Path(path.clone()));
    click(&mut harness, "Earlier: early scan");
    press(&mut harness, Key::Enter);
    assert_eq!(error_text(&harness), "");
    assert_eq!(case(&harness).time_labels(), ["early scan", "late scan"]);
    assert_eq!(case(&harness).order, OrderBasis::Stated);
    let saved = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(saved.clone()));
    assert_eq!(session::load(&saved).unwrap().document.order, ["early scan", "late scan"]);
    let mut other = sample_window();
    issue(&mut other, AppCommand::OpenSession(saved));
    wait_for_workers(&mut other);
    assert!(!is_asked_for_order(&other));
    assert_eq!(case(&other).time_labels(), ["early scan", "late scan"]);
    // It can be changed, and stays out where it isn't known.
    issue(&mut other, AppCommand::ShowCaseFiles);
    wait_for_workers(&mut other);
    press(&mut other, Key::Enter);
    click(&mut other, "Later: early scan");
    press(&mut other, Key::Enter);
    assert_eq!(case(&other).time_labels(), ["late scan", "early scan"]);
    let mut third = sample_window();
    open(&mut third, CaseRef::Path(path));
    click(&mut third, "Open without an order");
    assert_eq!(case(&third).order, OrderBasis::Unknown);
}

#[test]
fn dates_of_a_manifest_that_were_ordered_are_not_asked_for_again() {
    let folder = tempfile::tempdir().unwrap();
    let (config, path) = (folder.path().join("config"), folder.path().join("case.toml"));
    mask(&folder.path().join("m.nii"), 4);
    let write_dates = |labels: &[&str]| {
        let dates =
            labels.iter().map(|t| format!("[[mask]]\nid = \"A\"\nfile = \"m.nii\"\ntime = \"{t}\"\n"));
        std::fs::write(&path, format!("glioscope = 1\n{}", dates.collect::<String>())).unwrap();
    };
    let opened = |accept: &dyn Fn(&mut Window)| {
        let mut harness = window_of_user(Recent::in_folder(&config), [1280.0, 720.0]);
        open(&mut harness, CaseRef::Path(path.clone()));
        accept(&mut harness);
        assert_eq!(error_text(&harness), "");
        let dates: Vec<String> = case(&harness).time_labels().iter().map(ToString::to_string).collect();
        (dates.join(" "), harness)
    };
    let unasked = |harness: &mut Window| {
        assert!(!is_asked_for_order(harness));
        assert!(harness.query_by_label_contains("dates as ordered before").is_some());
    };
    write_dates(&["B", "A"]);
    let (dates, _) = opened(&|harness| {
        click(harness, "Earlier: A");
        click(harness, "Use this order");
    });
    assert_eq!(dates, "A B");
    let (dates, mut second) = opened(&unasked);
    assert_eq!(dates, "A B");
    // Asked again on request, and then known anew.
    issue(&mut second, AppCommand::ShowCaseFiles);
    wait_for_workers(&mut second);
    press(&mut second, Key::Enter);
    click(&mut second, "Later: A");
    click(&mut second, "Use this order");
    assert_eq!(opened(&unasked).0, "B A");
    write_dates(&["B", "A", "C"]);
    assert!(
        opened(&|harness| click(harness, "Use this order")).0.contains('C'),
        "another date is asked about"
    );
}

#[test]
fn work_done_while_the_case_is_read_again_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = three_files(folder.path());
    let mut harness = sample_window();
    open(&mut harness, CaseRef::Path(path));
    press(&mut harness, Key::Enter);
    issue(&mut harness, AppCommand::ShowCaseFiles);
    wait_for_workers(&mut harness);
    type_in(&mut harness, "Name of a", "necrosis");
    issue(&mut harness, AppCommand::AcceptGuess(true));
    issue(&mut harness, EditCommand::SetLensRadius(7.5));
    assert!(harness.state().work.job.is_some(), "still reading");
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).edit.masks.name("a"), "necrosis");
    assert_eq!(doc(&harness).edit.lens.radius_mm, 7.5);
}

#[test]
fn folders_that_may_be_patients_or_dates_are_asked_about() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("config");
    let path = folder.path().join("case");
    for (name, width) in [("B", 8), ("A", 4)] {
        mask(&path.join(name).join("seg.nii.gz"), width);
    }
    let mut harness = window_of_user(Recent::in_folder(&config), [1280.0, 720.0]);
    open(&mut harness, CaseRef::Path(path.clone()));
    assert!(is_asked(&harness));
    assert!(harness.query_by_label_contains("which may be patients or dates").is_some());
    press(&mut harness, Key::Enter);
    assert!(is_asked_for_order(&harness));
    assert!(harness.query_by_label("Open without an order").is_none(), "they may be patients");
    click(&mut harness, "Earlier: B");
    press(&mut harness, Key::Enter);
    assert_eq!(error_text(&harness), "");
    assert_eq!(case(&harness).time_labels(), ["B", "A"]);
    open(&mut harness, CaseRef::Sample);
    open(&mut harness, CaseRef::Path(path));
    assert!(!is_asked(&harness) && !is_asked_for_order(&harness), "accepted before");
    assert_eq!(case(&harness).time_labels(), ["B", "A"]);
}

#[test]
fn files_dropped_together_are_one_case() {
    let folder = tempfile::tempdir().unwrap();
    let path = three_files(folder.path());
    let tracts = folder.path().join("cst.tck");
    write_tck(&tracts, &[vec![[1.0; 3], [9.0; 3]]]);
    let mut harness = sample_window();
    for file in [path.join("t1c.nii.gz"), path.join("b_mask.nii.gz"), tracts] {
        harness.input_mut().dropped_files.push(Arc::new(Dropped(file)));
    }
    harness.run_steps(1);
    wait_for_workers(&mut harness);
    assert!(is_asked(&harness));
    press(&mut harness, Key::Enter);
    assert_eq!(error_text(&harness), "");
    assert_eq!(mask_ids(&harness), ["b"], "the other mask of the folder wasn't dropped");
    assert_eq!(case(&harness).time_points[0].contexts[0].id, "t1c");
    assert_eq!(case(&harness).tracts[0].id, "cst");
    assert!(matches!(&doc(&harness).case, CaseRef::Files { folder: base, .. } if base == folder.path()));
    let saved = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(saved.clone()));
    let mut other = sample_window();
    issue(&mut other, AppCommand::OpenSession(saved));
    wait_for_workers(&mut other);
    assert_eq!((error_text(&other).as_str(), mask_ids(&other)), ("", vec!["b"]));
    assert_eq!(case(&other).tracts.len(), 1);
}

#[test]
fn labels_are_rows_with_the_names_of_their_year() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case");
    write_cube(&path.join("BraTS2021_00002_seg.nii.gz"), 16, 1.0, |[x, ..]| [0, 1, 2, 4][x / 4]);
    image(&path.join("BraTS2021_00002_t1ce.nii.gz"));
    let mut harness = sample_window();
    open(&mut harness, CaseRef::Path(path));
    for label in ["Name of seg-1", "Name of seg-2", "Name of seg-4"] {
        assert!(harness.query_by_label(label).is_some(), "{label}");
    }
    assert!(harness.query_by_label_contains("named as in BraTS 2021").is_some());
    click(&mut harness, "Use seg-2 of BraTS2021_00002_seg.nii.gz");
    press(&mut harness, Key::Enter);
    assert_eq!(error_text(&harness), "");
    assert_eq!(mask_ids(&harness), ["seg-1", "seg-4"]);
    assert_eq!(doc(&harness).edit.masks.name("seg-4"), "enhancing tumour");
    assert!(harness.query_by_label("necrotic core only").is_some(), "named so in the overlap");
}

#[test]
fn labels_are_named_on_the_command_line_beside_their_ids() {
    let folder = tempfile::tempdir().unwrap();
    write_cube(&folder.path().join("BraTS-GLI-00005-100-seg.nii.gz"), 16, 1.0, |[x, ..]| [0, 2, 3, 4][x / 4]);
    let answer = |command: &str, option: &[&str]| {
        let path = folder.path().display().to_string();
        let mut arguments = vec![command, path.as_str()];
        arguments.extend(option);
        let output = run(PROGRAM, &arguments);
        String::from_utf8(output.stdout).unwrap()
    };
    let report: serde_json::Value = serde_json::from_str(&answer("measure", &["--json"])).unwrap();
    let masks = report["time_points"][0]["masks"].as_array().unwrap();
    let names: Vec<&str> = masks.iter().map(|mask| mask["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["surrounding FLAIR hyperintensity", "enhancing tumour", "resection cavity"]);
    assert!(masks[1]["id"].as_str().unwrap().ends_with("-3"), "{masks:?}");
    for command in ["measure", "info"] {
        assert!(answer(command, &[]).contains("resection cavity"), "{command}");
    }
    // Another name shows nothing.
    std::fs::rename(
        folder.path().join("BraTS-GLI-00005-100-seg.nii.gz"),
        folder.path().join("glioma-seg.nii.gz"),
    )
    .unwrap();
    let report: serde_json::Value = serde_json::from_str(&answer("measure", &["--json"])).unwrap();
    assert!(report["time_points"][0]["masks"][0]["name"].is_null());
}
