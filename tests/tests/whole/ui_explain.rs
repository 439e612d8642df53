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
    harness.get_by_label("Conclusion").focus();
    harness.run_ok();
    harness.get_by_label("Conclusion").type_text("Progression at the front.");
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
    assert!(html.contains(">Conclusion</h2><p>Progression at the front.</p>"), "what the reader concludes");
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
    // Played, the other date comes after two seconds; steps are of a quarter.
    harness.get_by_label("Play").click();
    harness.step();
    let times: Vec<usize> = (0..12)
        .map(|_| {
            harness.step();
            doc(&harness).nav.time
        })
        .collect();
    assert!(times[..4] == [1; 4] && times[11] == 0, "{times:?}");
    harness.get_by_label("Stop").click();
    wait_for_workers(&mut harness);
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
    perform(&mut harness, AppCommand::Explain);
    assert!(harness.query_by_label("In wahrer Größe").is_some(), "in the language of the last time");
}

#[test]
fn a_page_to_take_home_has_the_doctors_words_and_is_kept_in_the_session() {
    let mut harness = opened();
    perform(&mut harness, AppCommand::ShowPage);
    wait_for_workers(&mut harness);
    let words = |harness: &Window| harness.get_by_label("Words").value().unwrap_or_default();
    let proposed = words(&harness);
    assert!(proposed.starts_with("# ") && !proposed.contains("T1"), "{proposed}");
    harness.get_by_label("Deutsch").click();
    wait_for_workers(&mut harness);
    let german = words(&harness);
    assert!(german.starts_with("# ") && german != proposed, "{german}");
    harness.get_by_label("Words").focus();
    harness.run_ok();
    harness.get_by_label("Words").type_text("Bis zum Frühling. ");
    harness.run_ok();
    let kept = doc(&harness).edit.take_home.clone();
    assert!(kept.text.as_ref().is_some_and(|text| text.contains("Bis zum Frühling.")), "{kept:?}");
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        harness.render().unwrap().save(Path::new(&folder).join("page-dialog.png")).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let [page, session] = ["page.html", "case.glioscope.json"].map(|name| folder.path().join(name));
    perform(&mut harness, AppCommand::WritePageTo(page.clone()));
    wait_for_workers(&mut harness);
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(
        html.contains("Bis zum Frühling.") && html.contains("lang=\"de\""),
        "the words, and the language"
    );
    perform(&mut harness, AppCommand::SaveSessionTo(session.clone()));
    wait_for_workers(&mut harness);
    assert!(std::fs::read_to_string(&session).unwrap().contains("Bis zum Frühling."));
    harness.get_by_label("The program's words").click();
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).edit.take_home.text, None);
    assert_eq!(words(&harness), german);
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

#[test]
fn a_report_without_identity_has_none_of_the_users_words_that_name_the_patient_and_replays() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("MUELLERX_4711234");
    std::fs::create_dir(&case).unwrap();
    for (date, radius) in [("2024-01-01", 6.0), ("2024-03-01", 7.0)] {
        crate::lesions::balls(&case.join(format!("T_{date}.nii")), &[([30.0, 30.0, 20.0], radius)]);
    }
    let text = |name: &str| case.join(name).to_str().unwrap().to_owned();
    let manifest = format!(
        "glioscope = 1\nname = \"MUELLERX_4711234\"\n[[mask]]\nid = \"T\"\nfile = {:?}\ntime = \"2024-01-01\"\n[[mask]]\nid = \"T\"\nfile = {:?}\ntime = \"2024-03-01\"\n",
        text("T_2024-01-01.nii"),
        text("T_2024-03-01.nii")
    );
    std::fs::write(case.join("case.toml"), manifest).unwrap();
    let mut harness = window_on(CaseRef::Path(case.join("case.toml")), [1280.0, 800.0], egui::Theme::Light);
    wait_for_workers(&mut harness);
    let secret = "MUELLERX_4711234";
    let at = glioscope_core::lesions::Anchor {
        time: "2024-01-01".into(),
        of: "T".into(),
        at_mm: glam::DVec3::new(30.0, 30.0, 20.0),
    };
    let name = glioscope_core::lesions::Edit::Name { at, name: format!("lesion of {secret}") };
    perform(&mut harness, EditCommand::EditLesions(vec![name]));
    let line = glioscope::model::Ruler {
        name: format!("line of {secret}"),
        from_mm: glam::DVec3::ZERO,
        to_mm: glam::DVec3::X,
        shape: glioscope::model::Shape::Line,
        view: PaneId::Axial,
        time: 0,
    };
    perform(&mut harness, EditCommand::AddRuler(Box::new(line)));
    let mut response =
        glioscope::model::ResponseSetting { author: "Dr KNRYAUTHOR".into(), ..Default::default() };
    response.set_criterion(Some(glioscope_core::response::Criterion::Rano2010));
    let history = response.history.as_mut().unwrap();
    history.targets = Some(glioscope_core::response::Fact::of(vec![format!("lesion of {secret}")]));
    history.baseline = Some(glioscope_core::response::Fact {
        value: glioscope_core::response::Label("2024-01-01".into()),
        author: Some("Dr KNRYAUTHOR".into()),
        entered: Some("1999-09-09".into()),
    });
    perform(&mut harness, EditCommand::SetResponse(Box::new(response)));
    perform(&mut harness, EditCommand::KeepPicture(PaneId::Closeup, [500.0, 250.0]));
    let session = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(session.clone()));
    for identity in ["none", "full"] {
        let out = folder.path().join(format!("{identity}.html")).to_str().unwrap().to_owned();
        let made =
            run(PROGRAM, &["report", session.to_str().unwrap(), "--out", &out, "--identity", identity]);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let html = std::fs::read_to_string(&out).unwrap();
        for word in ["MUELLERX", "4711234", "KNRYAUTHOR", "1999-09-09"] {
            assert_eq!(html.contains(word), identity == "full", "{identity}: {word}");
        }
        // The session of this test has no record of its files, of which a replay knows nothing.
        if identity == "full" {
            let replayed = run(PROGRAM, &["replay", &out]);
            let said = String::from_utf8_lossy(&replayed.stderr).into_owned();
            assert!(replayed.status.success() || said.contains("differs: section \"Warnings\","), "{said}");
        }
    }
}
