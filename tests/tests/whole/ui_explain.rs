//! What is kept for the report with a key, and the mode for explaining.

use std::path::Path;

use egui::Key;
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand, LookCommand},
    model::{CaseRef, PaneId, session},
};
use glioscope_tests::{Window, doc, issue, perform, run, wait_for_workers, window_on};

use crate::PROGRAM;

fn opened() -> Window {
    let mut harness = window_on(CaseRef::Sample, [1280.0, 800.0], egui::Theme::Light);
    wait_for_workers(&mut harness);
    harness
}

fn press_over(harness: &mut Window, pane: PaneId, key: Key) {
    let Some(rect) = harness.state().pane_rect(pane) else {
        let all: Vec<PaneId> = PaneId::all().filter(|p| harness.state().pane_rect(*p).is_some()).collect();
        panic!("{} is not drawn: {all:?}", pane.title())
    };
    harness.hover_at(rect.center());
    harness.run_ok();
    harness.key_press(key);
    harness.run_ok();
}

#[test]
fn views_kept_with_a_key_are_the_pictures_of_the_report() {
    let mut harness = opened();
    press_over(&mut harness, PaneId::Closeup, Key::K);
    perform(&mut harness, LookCommand::SetTime(1));
    press_over(&mut harness, PaneId::Overlap, Key::K);
    let kept = doc(&harness).edit.pictures.clone();
    assert_eq!(
        kept.iter().map(|p| (p.pane, p.nav.time)).collect::<Vec<_>>(),
        [(PaneId::Closeup, 0), (PaneId::Overlap, 1)]
    );
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(doc(&harness).edit.pictures.len(), 1);
    perform(&mut harness, EditCommand::Redo);

    // Captions and order, in the dialog.
    perform(&mut harness, AppCommand::ShowReport);
    harness.get_by_label("Caption of picture 1").focus();
    harness.run_ok();
    harness.get_by_label("Caption of picture 1").type_text("The rim that grew");
    harness.run_ok();
    harness.get_by_label("Move picture 2 up").click();
    harness.run_ok();
    let kept = &doc(&harness).edit.pictures;
    assert_eq!((kept[0].pane, kept[1].caption.as_str()), (PaneId::Overlap, "The rim that grew"));
    harness.key_press(Key::Escape);
    harness.run_ok();

    // A report of the session has these two, in their order, each of its own date; replay makes it again.
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    perform(&mut harness, AppCommand::SaveSessionTo(path("read.glioscope.json").into()));
    let saved = session::load(Path::new(&path("read.glioscope.json"))).unwrap();
    assert_eq!(saved.document.edit.pictures.len(), 2);
    let out = path("report.html");
    assert!(run(PROGRAM, &["report", &path("read.glioscope.json"), "--out", &out]).status.success());
    let html = std::fs::read_to_string(&out).unwrap();
    assert_eq!(html.matches("data:image/png").count(), 2);
    let dates = ["2024", "Overlap diagram", "The rim that grew"].map(|text| html.find(text));
    assert!(dates.iter().all(Option::is_some) && dates[1] < dates[2], "{dates:?}");
    let replayed = run(PROGRAM, &["replay", &out]);
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stdout));
}

#[test]
fn explaining_says_the_size_without_names_and_plays_the_dates() {
    let mut harness = opened();
    let name = harness.state().work.world.case().unwrap().name.clone();
    perform(&mut harness, AppCommand::Explain);
    wait_for_workers(&mut harness);
    assert!(harness.query_all_by_label_contains("about as large as").count() > 0);
    // No menu, no status line, no names of the case, its masks and its dates.
    for hidden in ["File", "T1", "PET", name.as_str()] {
        assert!(harness.query_by_label(hidden).is_none(), "{hidden}");
    }
    assert_eq!(harness.query_all_by_label_contains("2024").count(), 0);
    harness.get_by_label("Scan 2").click();
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).nav.time, 1);
    assert!(harness.query_all_by_label_contains("now,").count() > 0, "what became of it");
    harness.get_by_label("Deutsch").click();
    harness.run_ok();
    assert!(harness.query_by_label("In wahrer Größe").is_some());
    // Keys of the workstation do nothing here.
    let before = doc(&harness).edit.clone();
    harness.key_press(Key::L);
    harness.run_ok();
    assert_eq!(doc(&harness).edit, before);
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        harness.render().unwrap().save(Path::new(&folder).join("explain.png")).unwrap();
    }
    harness.key_press(Key::Escape);
    harness.run_ok();
    assert!(harness.query_by_label("File").is_some());
}

#[test]
fn a_card_on_the_screen_gives_true_size() {
    let mut harness = opened();
    perform(&mut harness, AppCommand::Explain);
    wait_for_workers(&mut harness);
    harness.get_by_label("Fit to this screen").click();
    harness.run_ok();
    assert!(harness.query_by_label("Length of the line").is_some());
    issue(&mut harness, AppCommand::OpenSample);
    wait_for_workers(&mut harness);
    assert!(
        harness.query_all_by_label_contains("about as large as").count() > 0,
        "another case is explained, too"
    );
}
