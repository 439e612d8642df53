//! Lesions over time in the window: the timeline, and what a reader does with it.

use std::path::Path;

use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, PaneId, session},
};
use glioscope_core::lesions::Edit;
use glioscope_tests::{
    Window, answer, choose, doc, issue, pane_picture, perform, run, wait_for_workers, window_on,
};

use crate::{PROGRAM, lesions::balls};

/// A date and its balls.
type Date<'a> = (&'a str, &'a [([f64; 3], f64)]);

/// Three dates: one lesion grows and becomes two, one vanishes, one is new.
fn case(folder: &Path) -> CaseRef {
    let dates: [Date<'_>; 3] = [
        ("2024-01-01", &[([15.0, 15.0, 20.0], 6.0), ([45.0, 15.0, 20.0], 4.0)]),
        ("2024-04-01", &[([15.0, 15.0, 20.0], 8.0)]),
        ("2024-07-01", &[([10.0, 15.0, 20.0], 4.0), ([20.0, 15.0, 20.0], 4.5), ([45.0, 45.0, 20.0], 5.0)]),
    ];
    let mask = |(date, of): &Date<'_>| format!("T={}@{date}", balls(&folder.join(format!("{date}.nii")), of));
    CaseRef::Arguments { masks: dates.iter().map(mask).collect(), contexts: Vec::new() }
}

fn opened(folder: &Path) -> Window {
    let mut harness = window_on(case(folder), [1280.0, 720.0], egui::Theme::Dark);
    maximized_lesions(&mut harness);
    harness
}

fn maximized_lesions(harness: &mut Window) {
    issue(harness, EditCommand::MaximizePane(PaneId::Lesions));
    wait_for_workers(harness);
}

fn labels(harness: &Window, part: &str) -> usize {
    harness.query_all_by_label_contains(part).count()
}

#[test]
fn a_reader_verifies_unlinks_names_and_ignores_and_undoes() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    assert_eq!(labels(&harness, "Link from"), 3, "one that continues, two of a split");
    assert!(harness.query_by_label("3 links are proposed by the program and not verified").is_some());
    assert_eq!(labels(&harness, "Lesion A at 2024-07-01"), 2);
    assert!(harness.query_all_by_label_contains("one of 2 pieces").count() >= 2);

    // A click goes there.
    harness.get_by_label_contains("Lesion C at 2024-07-01").click();
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).nav.time, 2);
    assert!(doc(&harness).nav.cursor_mm.distance(glam::DVec3::new(45.0, 45.0, 20.0)) < 1.0);

    // The first proposed link by its key, verified and taken away.
    let over = harness.get_by_label_contains("Lesion C at 2024-07-01").rect().center();
    harness.hover_at(over);
    for (key, left, edits) in [(Key::N, 3, 0), (Key::V, 2, 1), (Key::N, 2, 1), (Key::U, 1, 2)] {
        harness.key_press(key);
        wait_for_workers(&mut harness);
        let text = match left {
            1 => "1 link is proposed by the program and not verified".to_owned(),
            left => format!("{left} links are proposed by the program and not verified"),
        };
        assert!(harness.query_by_label(&text).is_some(), "{key:?}: {text}");
        assert_eq!(doc(&harness).edit.lesions.edits.len(), edits, "{key:?}");
    }
    assert!(matches!(doc(&harness).edit.lesions.edits[..], [Edit::Verify { .. }, Edit::Unlink { .. }]));
    // What was unlinked is a lesion of its own, new at the last date.
    assert!(labels(&harness, "Lesion D at 2024-07-01") > 0, "also where the pointer rests on it");

    // A name is on the timeline and in the command line's table of the session.
    harness.get_by_label_contains("Lesion A at 2024-01-01").click();
    wait_for_workers(&mut harness);
    harness.get_by_label("Name…").click();
    harness.run_ok();
    harness.get_by_label("Name of the lesion").type_text("frontal");
    harness.run_ok();
    harness.key_press(Key::Enter);
    wait_for_workers(&mut harness);
    assert!(labels(&harness, "Lesion A: frontal at 2024-01-01") > 0);
    let path = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    let saved = session::load(&path).unwrap().document.edit.lesions;
    assert_eq!(saved, doc(&harness).edit.lesions);
    let (json, _) = answer(PROGRAM, &["lesions", path.to_str().unwrap(), "--json"]);
    assert_eq!(json["lesions"][0]["name"], "frontal");
    assert_eq!(json["links"][0]["state"], "verified");
    assert_eq!(json["unlinked"].as_array().unwrap().len(), 1);
    // Without the session nothing of it is known.
    assert_eq!(json["lesions"].as_array().unwrap().len(), 4);

    // Undone one after the other; between them the lens went along.
    let mut left = vec![3];
    for _ in 0..12 {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
        wait_for_workers(&mut harness);
        left.push(doc(&harness).edit.lesions.edits.len());
    }
    left.dedup();
    assert_eq!(left, [3, 2, 1, 0]);
    assert_eq!(labels(&harness, "Lesion A at 2024-07-01"), 2);
}

/// Selects two components: a click, then one with Shift.
fn select_two(harness: &mut Window, one: &str, two: &str) {
    harness.get_by_label_contains(one).click();
    wait_for_workers(harness);
    harness.get_by_label_contains(two).click_modifiers(Modifiers::SHIFT);
    wait_for_workers(harness);
}

#[test]
fn two_components_of_a_date_are_merged_and_of_two_dates_linked() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    // What vanished, and what is new where it wasn't: the reader says that they are one.
    select_two(&mut harness, "Lesion B at 2024-01-01", "Lesion C at 2024-07-01");
    harness.get_by_label("Link").click();
    wait_for_workers(&mut harness);
    assert!(matches!(doc(&harness).edit.lesions.edits[..], [Edit::Link { .. }]));
    assert!(labels(&harness, "Lesion B at 2024-07-01") > 0 && labels(&harness, "Lesion C at") == 0);

    // Both of the first date are pieces of one lesion.
    perform(&mut harness, EditCommand::Undo);
    wait_for_workers(&mut harness);
    select_two(&mut harness, "Lesion A at 2024-01-01", "Lesion B at 2024-01-01");
    harness.get_by_label("Merge").click();
    wait_for_workers(&mut harness);
    assert!(matches!(doc(&harness).edit.lesions.edits[..], [Edit::Merge { .. }]));
    assert_eq!(labels(&harness, "Lesion A at 2024-01-01"), 2, "two pieces of one lesion");
}

#[test]
fn all_links_are_verified_at_once_and_an_ignored_component_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    harness.get_by_label("Verify all 3").click();
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).edit.lesions.edits.len(), 3);
    assert_eq!(labels(&harness, "proposed by the program"), 0);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    wait_for_workers(&mut harness);
    assert!(doc(&harness).edit.lesions.edits.is_empty(), "one step");

    harness.get_by_label_contains("Lesion C at 2024-07-01").click();
    wait_for_workers(&mut harness);
    harness.get_by_label("Ignore").click();
    wait_for_workers(&mut harness);
    assert_eq!(labels(&harness, "Lesion C at"), 0);
    harness.get_by_label("Your edit").click();
    harness.run_ok();
    harness.get_by_label_contains("Take back: ").click();
    wait_for_workers(&mut harness);
    assert_eq!(labels(&harness, "Lesion C at"), 1);

    // Discs have the colours of growth and shrinkage.
    let picture = pane_picture(&mut harness, PaneId::Lesions);
    let shown = glioscope::theme::DARK;
    for (color, name) in [(shown.growth, "growth"), (shown.shrinkage, "shrinkage")] {
        let [r, g, b, _] = color.to_array();
        assert!(glioscope_tests::count_color(&picture, [r, g, b], 12) > 15, "{name}");
    }
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        picture.save(Path::new(&folder).join("lesions.png")).unwrap();
    }
}

#[test]
fn a_lesion_is_split_at_its_neck_and_a_ball_has_none() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str, of: &[([f64; 3], f64)]| balls(&folder.path().join(name), of);
    let bridge = |x: usize| ([20.0 + x as f64, 30.0, 20.0], 2.0);
    let mut dumbbell = vec![([20.0, 30.0, 20.0], 7.0), ([40.0, 30.0, 20.0], 6.0)];
    dumbbell.extend((0..=20).map(bridge));
    let masks = vec![
        format!("T={}@2024-01-01", of("a.nii", &dumbbell)),
        format!("T={}@2024-02-01", of("b.nii", &[([20.0, 30.0, 20.0], 7.0)])),
    ];
    let case = CaseRef::Arguments { masks, contexts: Vec::new() };
    let mut harness = window_on(case, [1280.0, 720.0], egui::Theme::Light);
    maximized_lesions(&mut harness);
    harness.get_by_label_contains("Lesion A at 2024-02-01").click();
    wait_for_workers(&mut harness);
    harness.get_by_label("Split at its neck").click();
    wait_for_workers(&mut harness);
    assert_eq!(labels(&harness, "not split: "), 1, "a ball");
    harness.get_by_label_contains("Lesion A at 2024-01-01").click();
    wait_for_workers(&mut harness);
    harness.get_by_label("Split at its neck").click();
    wait_for_workers(&mut harness);
    assert!(labels(&harness, "Lesion B at 2024-01-01") > 0, "the other ball is a lesion of its own");
    perform(&mut harness, EditCommand::Undo);
    wait_for_workers(&mut harness);
    assert_eq!(labels(&harness, "Lesion B at 2024-01-01"), 0);
}

#[test]
fn values_of_an_image_and_surface_change_stand_by_lesion_and_date() {
    let case = CaseRef::Sample;
    let mut harness = window_on(case, [1280.0, 720.0], egui::Theme::Light);
    maximized_lesions(&mut harness);
    assert!(harness.query_by_label("PET mean").is_none(), "not computed unless asked for");
    choose(&mut harness, "values of", "PET");
    harness.get_by_label("surface change").click();
    wait_for_workers(&mut harness);
    assert!(
        harness.query_by_label("PET mean").is_some() && harness.query_by_label("Grew, receded").is_some()
    );
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    // The command line, from the session alone.
    let (json, _) = answer(PROGRAM, &["lesions", path.to_str().unwrap(), "--json"]);
    let of = &json["lesions"][0]["dates"][1];
    let text = |value: &serde_json::Value| value.as_f64().unwrap();
    let mean = glioscope::format::four_digits(text(&of["values"]["mean"]));
    assert!(harness.query_by_label(&mean).is_some(), "{mean}");
    let moved = |kind: &str| text(&of["surface"][kind]["p95_mm"]);
    let moved = format!("{:.1}, {:.1} mm", moved("growth"), moved("recession"));
    assert!(harness.query_by_label(&moved).is_some(), "{moved}");
    let report = folder.path().join("read.md");
    assert!(
        run(PROGRAM, &["report", path.to_str().unwrap(), "--out", report.to_str().unwrap()]).status.success()
    );
    let written = std::fs::read_to_string(&report).unwrap();
    assert!(written.contains("Values of PET in each lesion") && written.contains(&mean), "{written}");
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        pane_picture(&mut harness, PaneId::Lesions)
            .save(Path::new(&folder).join("lesions-values.png"))
            .unwrap();
    }
}
