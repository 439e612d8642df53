//! Response by criteria in the window: what is asked, and what the calls then say.

use std::path::Path;

use egui::Key;
use egui_kittest::kittest::{NodeT, Queryable};
use glioscope::{
    command::{AppCommand, EditCommand, Workstation},
    model::{
        CaseRef, PaneId, Reading,
        layout::{self, Task},
        session,
    },
    report::Options,
    window::recent::Recent,
};
use glioscope_core::response::{Call, Criterion, Fact, Label, NewLesion, NonTarget, Part, TreatmentKind};
use glioscope_tests::{
    Window, answer, choose, doc, error_text, issue, pane_picture, perform, run, user_window,
    wait_for_workers, window_of_user, window_on,
};

use crate::{PROGRAM, lesions::balls};

/// One lesion that grows from 12 to 18 mm within 5 months.
fn opened(folder: &Path) -> Window {
    let dates = [("2024-01-01", 6.0), ("2024-03-01", 6.0), ("2024-06-01", 9.0)];
    let mask = |(date, radius): &(&str, f64)| {
        format!("T={}@{date}", balls(&folder.join(format!("{date}.nii")), &[([30.0, 30.0, 20.0], *radius)]))
    };
    let case = CaseRef::Arguments { masks: dates.iter().map(mask).collect(), contexts: Vec::new() };
    let mut harness = window_on(case, [1280.0, 900.0], egui::Theme::Light);
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Response));
    wait_for_workers(&mut harness);
    harness
}

/// One lesion that stays as it is, and a new one of 0.2 ml.
fn two_scans(folder: &tempfile::TempDir) -> Window {
    let at = |date: &str, of: &[([f64; 3], f64)]| {
        format!("T={}@{date}", balls(&folder.path().join(format!("{date}.nii")), of))
    };
    let (old, new) = (([15.0, 15.0, 20.0], 8.0), ([45.0, 45.0, 20.0], 4.0));
    let masks = vec![at("2024-01-01", &[old]), at("2024-03-01", &[old, new])];
    let case = CaseRef::Arguments { masks, contexts: Vec::new() };
    let mut harness = window_on(case, [1280.0, 900.0], egui::Theme::Light);
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Response));
    wait_for_workers(&mut harness);
    harness
}

fn type_into(harness: &mut Window, field: &str, text: &str) {
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, field).focus();
    harness.run_ok();
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, field).type_text(text);
    harness.run_ok();
    harness.key_press(Key::Enter);
    wait_for_workers(harness);
}

#[test]
fn a_reader_states_what_is_asked_and_gets_a_call_with_its_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    assert!(harness.query_by_label("Baseline").is_none(), "nothing is asked without criteria");
    choose(&mut harness, "Criteria", "RANO 2010");
    // Without a baseline nothing but what it needs is asked.
    assert!(harness.query_all_by_label("cannot say").count() >= 3);
    assert!(harness.query_by_label("Clinical state").is_none());
    assert!(
        harness.query_by_label("1 answer is missing, below").is_some()
            || harness.query_by_label_contains("answers are missing, below").is_some()
    );
    type_into(&mut harness, "stated by", "A. B.");
    harness.get_by_label("Baseline: 2024-01-01").click();
    wait_for_workers(&mut harness);
    harness.get_by_label("Radiotherapy: there was none").click();
    wait_for_workers(&mut harness);
    // 9 against 6 mm: the product rises by more than 25 %.
    assert!(harness.query_all_by_label_contains("PD").count() >= 1, "progression");
    // The sources are a tip of each reason, and stand with the rules.
    let rules = "Rules of RANO 2010, with their sources";
    click(&mut harness, rules);
    assert!(harness.query_all_by_label_contains("secondary: reviews").count() >= 1, "with its source");
    click(&mut harness, rules);
    let fact = doc(&harness).edit.response.history.clone().unwrap().baseline.unwrap();
    assert_eq!((fact.value.0.as_str(), fact.author.as_deref()), ("2024-01-01", Some("A. B.")));
    assert!(fact.entered.is_some(), "and when");

    // A stated fact of a scan, taken back by undo.
    click(&mut harness, "New lesions at 2024-06-01: none");
    let stated = |harness: &Window| {
        let history = doc(harness).edit.response.history.clone().unwrap();
        history.date.iter().any(|facts| facts.new_lesion.is_some())
    };
    assert!(stated(&harness));
    perform(&mut harness, EditCommand::Undo);
    assert!(!stated(&harness));

    // A margin, once a repeatability is stated.
    click(&mut harness, "How well measurements repeat");
    type_into(&mut harness, "Products of diameters", "10");
    assert!(harness.query_all_by_label_contains("relative SD 0.1").count() >= 1);

    // The same calls from the command line, from the session alone.
    let path = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.response, doc(&harness).edit.response);
    let (json, notes) = answer(PROGRAM, &["response", path.to_str().unwrap(), "--json"]);
    assert_eq!(json["criterion"], "rano-2010");
    assert_eq!(json["dates"][2]["by_diameters"]["call"], "progression");
    assert!(notes.contains("no reader has verified"), "{notes}");
    // And in the report: with the author only where the patient is named, too.
    for (identity, has_author) in [("none", false), ("full", true)] {
        let report = folder.path().join(format!("{identity}.html"));
        let arguments =
            ["report", path.to_str().unwrap(), "--out", report.to_str().unwrap(), "--identity", identity];
        assert!(run(PROGRAM, &arguments).status.success());
        let text = std::fs::read_to_string(&report).unwrap();
        assert!(text.contains("RANO 2010") && text.contains("PD"), "{text}");
        assert_eq!(text.contains("A. B."), has_author, "{identity}");
        assert!(text.contains("Stated by the reader") && text.contains("Radiotherapy ended"), "{text}");
    }
    let picture = pane_picture(&mut harness, PaneId::Response);
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        picture.save(Path::new(&folder).join("response.png")).unwrap();
    }
}

#[test]
fn what_a_trial_states_a_surgery_and_a_lesion_measured_by_hand_are_stated_and_saved() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    choose(&mut harness, "Criteria", "iRANO");
    type_into(&mut harness, "stated by", "A. B.");
    type_into(&mut harness, "Surgery", "2024-01-15");
    click(&mut harness, "Baseline after surgery of 2024-01-15: 2024-03-01");
    type_into(&mut harness, "targets", "A, A, B");
    // The baseline of a scan before it isn't offered.
    assert!(harness.query_by_label("Baseline after surgery of 2024-01-15: 2024-01-01").is_none());
    click(&mut harness, "What the trial states");
    type_into(&mut harness, "Progression is confirmed after", "90");
    click(&mut harness, "steroids");
    click(&mut harness, "Measured by hand");
    type_into(&mut harness, "Lesion", "B");
    type_into(&mut harness, "longest, mm", "12,5");
    type_into(&mut harness, "perpendicular, mm", "20");
    click(&mut harness, "Add a measurement");
    assert!(
        harness.query_all_by_label_contains("expected at most longest_mm = 12.5").count() == 1,
        "what is refused is said, and stays"
    );
    let history = |harness: &Window| doc(harness).edit.response.history.clone().unwrap();
    assert!(history(&harness).measurement.is_empty());
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "perpendicular, mm").focus();
    harness.run_ok();
    harness.key_press_modifiers(egui::Modifiers::COMMAND, Key::A);
    type_into(&mut harness, "perpendicular, mm", "10");
    click(&mut harness, "Add a measurement");
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        let picture = pane_picture(&mut harness, PaneId::Response);
        picture.save(Path::new(&folder).join("response-forms.png")).unwrap();
    }
    let stated = history(&harness);
    let one = &stated.measurement[0];
    assert_eq!((one.lesion.as_str(), one.date.0.as_str(), one.longest_mm), ("B", "2024-06-01", Some(12.5)));
    assert_eq!(stated.trial.confirm_progression_days.as_ref().unwrap().value, 90);
    assert_eq!(stated.trial.follow_2010.as_ref().unwrap().value, [Part::Steroids]);
    let surgery = &stated.surgery[0];
    assert_eq!(surgery.targets.as_deref().unwrap(), ["A", "B"]);
    assert_eq!(surgery.baseline.as_ref().unwrap().0, "2024-03-01");
    assert_eq!(surgery.author.as_deref(), Some("A. B."));
    stated.check().unwrap();
    let path = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.response, doc(&harness).edit.response);
    click(&mut harness, "Take away B at 2024-06-01");
    assert!(history(&harness).measurement.is_empty());
}

fn click(harness: &mut Window, label: &str) {
    harness.get_by_label(label).scroll_to_me();
    harness.run_ok();
    harness.get_by_label(label).click();
    wait_for_workers(harness);
}

#[test]
fn questions_stay_where_they_are_while_they_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    choose(&mut harness, "Criteria", "RANO 2010");
    click(&mut harness, "Baseline: 2024-01-01");
    click(&mut harness, "Radiotherapy: there was none");
    let last = "2024-06-01";
    let asked = [format!("Clinical state at {last}: stable"), format!("New lesions at {last}: none")];
    let top = |harness: &Window, label: &str| harness.get_by_label(label).rect().top();
    let before = asked.clone().map(|label| top(&harness, &label));
    for label in &asked {
        harness.get_by_label(label).click();
        wait_for_workers(&mut harness);
    }
    assert_eq!(asked.map(|label| top(&harness, &label)), before);
    // Everything still open at a scan in one step, which is one step back.
    let facts = |harness: &Window, date: &str| {
        let history = doc(harness).edit.response.history.clone().unwrap();
        history.date.into_iter().find(|facts| facts.date.0 == date)
    };
    let stated = facts(&harness, last).unwrap();
    click(&mut harness, &format!("Nothing worse at {last}"));
    let filled = facts(&harness, last).unwrap();
    assert_eq!((&filled.clinical, &filled.new_lesion), (&stated.clinical, &stated.new_lesion), "stays");
    assert!(filled.flair.is_some() && stated.flair.is_none(), "{filled:?}");
    assert_eq!(filled.steroids_mg, None, "no dose was stated before");
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(facts(&harness, last).unwrap(), stated);
    // The calls in words, for the conclusion.
    click(&mut harness, "Write a report…");
    harness.get_by_label("Take over the calls").click();
    harness.run_ok();
    let conclusion = doc(&harness).edit.reading.conclusion.clone();
    assert!(conclusion.starts_with("2024-06-01, RANO 2010: PD"), "{conclusion}");
    harness.get_by_label("Replace the calls").click();
    harness.run_ok();
    assert_eq!(doc(&harness).edit.reading.conclusion, conclusion, "once");
}

/// A new lesion in the masks may be what decides, and it is the reader who says what it is.
#[test]
fn new_lesions_of_the_masks_are_asked_about_and_stand_in_the_conclusion() {
    let mut harness = two_scans(&tempfile::tempdir().unwrap());
    choose(&mut harness, "Criteria", "RANO 2010");
    // The author is still being typed when the first answer is clicked.
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "stated by").focus();
    harness.run_ok();
    harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "stated by").type_text("A. B.");
    harness.run_ok();
    click(&mut harness, "Baseline: 2024-01-01");
    click(&mut harness, "Radiotherapy: there was none");
    let history = doc(&harness).edit.response.history.clone().unwrap();
    assert_eq!(history.baseline.unwrap().author.as_deref(), Some("A. B."));
    assert_eq!(doc(&harness).edit.response.author, "A. B.");
    assert!(harness.query_by_label_contains("the masks show B, 0.2").is_some());
    let undecided = "New lesions at 2024-03-01 are not stated: the masks decide what they are";
    assert!(harness.query_by_label(undecided).is_some());
    // "Nothing worse" says nothing of it.
    click(&mut harness, "also what changes no call");
    click(&mut harness, "Nothing worse at 2024-03-01");
    let stated = |harness: &Window| {
        let history = doc(harness).edit.response.history.clone().unwrap();
        let facts = history.date.into_iter().find(|facts| facts.date.0 == "2024-03-01").unwrap();
        (facts.new_lesion.map(|fact| fact.value), facts.non_target.map(|fact| fact.value))
    };
    assert_eq!(stated(&harness), (None, Some(NonTarget::None)), "all of the first date are targets");
    click(&mut harness, "New lesions at 2024-03-01: measurable");
    assert_eq!(stated(&harness).0, Some(NewLesion::Measurable));
    assert!(harness.query_by_label(undecided).is_none());
    assert_eq!(harness.query_all_by_label_contains("by diameters: PD").count(), 1);
    click(&mut harness, "Write a report…");
    click(&mut harness, "Take over the calls");
    let reading = doc(&harness).edit.reading.clone();
    assert!(reading.conclusion.contains("New: B (0.2"), "{}", reading.conclusion);
    // Nothing but the new lesion changed: once, as the baseline is the lowest.
    let unchanged = "by diameters (+0.0 % from baseline), cannot say by volume.";
    assert!(reading.conclusion.contains(unchanged), "{}", reading.conclusion);
    assert_eq!(reading.reader, "", "nobody signs but the reader");
    click(&mut harness, "I am A. B.");
    let reading = doc(&harness).edit.reading.clone();
    assert_eq!((reading.reader.as_str(), reading.day.len()), ("A. B.", 10));
    // Whether the reader will be named is said, not in a tip alone.
    let printed =
        |harness: &Window| harness.get_by_label("Name printed, with the day").accesskit_node().toggled();
    assert_eq!(printed(&harness), Some(egui::accesskit::Toggled::True));
    harness.get_by_label("Name printed, with the day").click();
    harness.run_ok();
    assert_eq!(printed(&harness), Some(egui::accesskit::Toggled::False));
    // Whoever names the patient in full names the reader.
    harness.get_by_label_contains("In full, with file names").click();
    harness.run_ok();
    assert_eq!(printed(&harness), Some(egui::accesskit::Toggled::True));
    click(&mut harness, "Cancel");
    // Who states that there are none isn't contradicted by the conclusion.
    perform(&mut harness, EditCommand::SetReading(Box::default()));
    click(&mut harness, "New lesions at 2024-03-01: none");
    click(&mut harness, "Write a report…");
    click(&mut harness, "Take over the calls");
    let conclusion = doc(&harness).edit.reading.conclusion.clone();
    assert!(conclusion.contains("RANO 2010") && !conclusion.contains("New:"), "{conclusion}");
}

/// Runs frames until a label has `text`.
fn wait_for(harness: &mut Window, text: &str) {
    for _ in 0..500 {
        harness.run_ok();
        if harness.query_all_by_label_contains(text).next().is_some() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    panic!("nothing says {text:?}");
}

#[test]
fn a_report_is_read_before_it_is_signed_and_written_beside_the_case() {
    let folder = tempfile::tempdir().unwrap();
    for (date, of) in [
        ("2024-01-01", vec![([15.0, 15.0, 20.0], 8.0)]),
        ("2024-03-01", vec![([15.0, 15.0, 20.0], 8.0), ([45.0, 45.0, 20.0], 4.0)]),
    ] {
        balls(&folder.path().join(format!("{date}.nii")), &of);
    }
    let mask = |date: &str| format!("[[mask]]\nid = \"T\"\nfile = \"{date}.nii\"\ntime = \"{date}\"\n");
    let manifest = format!("glioscope = 1\nname = \"A\"\n{}{}", mask("2024-01-01"), mask("2024-03-01"));
    std::fs::write(folder.path().join("case.toml"), manifest).unwrap();
    std::fs::write(folder.path().join("report.pdf"), "of before").unwrap();
    let case = CaseRef::Path(folder.path().join("case.toml"));
    let mut harness = window_on(case, [1280.0, 900.0], egui::Theme::Light);
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Response));
    wait_for_workers(&mut harness);
    choose(&mut harness, "Criteria", "RANO 2010");
    wait_for_workers(&mut harness);
    click(&mut harness, "Write a report…");
    wait_for(&mut harness, "Sum of targets");
    // It follows what is written, by whom, and in which language.
    let reading = Reading { conclusion: "Seen by the board.".into(), ..Reading::default() };
    perform(&mut harness, EditCommand::SetReading(Box::new(reading)));
    wait_for(&mut harness, "not named in this report");
    // Its text stands in its field, and not once more.
    assert_eq!(
        harness.query_all_by_label("As typed beside this page.").count(),
        1,
        "{}",
        error_text(&harness)
    );
    assert_eq!(harness.query_all_by_label("Seen by the board.").count(), 0);
    click(&mut harness, "Deutsch");
    wait_for(&mut harness, "Summe der Zielläsionen");
    click(&mut harness, "English");
    click(&mut harness, "PDF");
    // Nothing is written over.
    click(&mut harness, "Write report-2.pdf");
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    assert!(std::fs::read(folder.path().join("report-2.pdf")).unwrap().starts_with(b"%PDF"));
    assert_eq!(std::fs::read(folder.path().join("report.pdf")).unwrap(), b"of before");
    // The form is remembered.
    click(&mut harness, "Write a report…");
    harness.get_by_label("Write report-3.pdf");
}

/// A case may be opened while the dialog is, by a file dropped on the window: page and folder are those of the patient before.
#[test]
fn the_report_dialog_closes_with_its_case() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = two_scans(&folder);
    choose(&mut harness, "Criteria", "RANO 2010");
    wait_for_workers(&mut harness);
    issue(&mut harness, AppCommand::ShowReport);
    wait_for(&mut harness, "Sum of targets");
    perform(&mut harness, AppCommand::Open(CaseRef::Sample));
    click(&mut harness, "Discard");
    wait_for_workers(&mut harness);
    harness.run_ok();
    assert_eq!(doc(&harness).case, CaseRef::Sample);
    assert!(harness.query_by_label("What its first page says").is_none());
    issue(&mut harness, AppCommand::ShowReport);
    wait_for(&mut harness, "T1c, FLAIR, PET");
    assert!(harness.query_by_label("Sum of targets").is_none());
}

/// Who judges case after case by the same criteria isn't asked again, in the next run neither.
#[test]
fn the_next_case_is_judged_by_the_criteria_of_the_last_report() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("config");
    let case = |name: &str, dates: &[&str]| {
        let at = folder.path().join(name);
        std::fs::create_dir_all(&at).unwrap();
        let mask = |date: &&str| {
            format!("T={}@{date}", balls(&at.join(format!("{date}.nii")), &[([30.0, 30.0, 20.0], 8.0)]))
        };
        CaseRef::Arguments { masks: dates.iter().map(mask).collect(), contexts: Vec::new() }
    };
    let dates = ["2024-01-01", "2024-03-01"];
    let opened = |case: CaseRef| {
        let recent = Recent::in_folder(&config);
        let mut harness = user_window(Workstation::default(), [1280.0, 800.0], recent, None);
        perform(&mut harness, AppCommand::Open(case));
        wait_for_workers(&mut harness);
        assert!(!harness.state().work.has_unsaved_work());
        harness
    };
    let criterion =
        |harness: &Window| doc(harness).edit.response.history.as_ref().map(|history| history.criterion);
    let write = |harness: &mut Window, name: &str| {
        let options = Options::default();
        issue(harness, AppCommand::WriteReportTo(options, folder.path().join(name)));
        wait_for_workers(harness);
        assert_eq!(error_text(harness), "");
    };
    let mut first = opened(case("a", &dates));
    assert_eq!(criterion(&first), None);
    issue(&mut first, EditCommand::MaximizePane(PaneId::Response));
    wait_for_workers(&mut first);
    choose(&mut first, "Criteria", "RANO 2010");
    wait_for_workers(&mut first);
    type_into(&mut first, "stated by", "Dr. Fuchs");
    write(&mut first, "a.md");
    let mut second = opened(case("b", &dates));
    assert_eq!(criterion(&second), Some(Criterion::Rano2010));
    assert_eq!(doc(&second).nav.time, 1);
    let layout = &doc(&second).edit.layout;
    for pane in [PaneId::Response, PaneId::Lesions, PaneId::SideBySide] {
        assert!(layout.tiles.find_pane(&pane).is_some(), "{pane:?}");
    }
    let baseline = doc(&second).edit.response.history.as_ref().and_then(|history| history.baseline.clone());
    assert_eq!(baseline, Some(Fact::proposed(Label("2024-01-01".into()))));
    // Who stated the facts last states these, and signs by a click.
    assert_eq!(doc(&second).edit.response.author, "Dr. Fuchs");
    issue(&mut second, AppCommand::ShowReport);
    wait_for(&mut second, "I am Dr. Fuchs");
    click(&mut second, "I am Dr. Fuchs");
    assert_eq!(doc(&second).edit.reading.reader, "Dr. Fuchs");
    second.key_press(Key::Escape);
    second.run_ok();
    // One date is judged by none, and its report says nothing about them.
    let mut one = opened(case("c", &["2024-01-01"]));
    assert_eq!(criterion(&one), None);
    write(&mut one, "c.md");
    assert_eq!(criterion(&opened(case("d", &dates))), Some(Criterion::Rano2010));
    // A report without criteria ends it.
    issue(&mut second, EditCommand::MaximizePane(PaneId::Response));
    wait_for_workers(&mut second);
    choose(&mut second, "Criteria", "none");
    write(&mut second, "b.md");
    let plain = opened(case("e", &dates));
    assert_eq!(criterion(&plain), None);
    // Panes that the program chose for a response aren't those that the reader arranged.
    let mut judged = opened(case("f", &dates));
    for (name, expected) in [("g", Some(Criterion::Rano2010)), ("h", None)] {
        judged.state_mut().work.usual.criterion = expected;
        perform(&mut judged, AppCommand::Open(case(name, &dates)));
        wait_for_workers(&mut judged);
        assert_eq!(criterion(&judged), expected);
    }
    assert!(layout::is_same(&doc(&judged).edit.layout, &doc(&plain).edit.layout));
}

/// A reader arranges the panes once for a stack of cases; with one date other panes matter.
#[test]
fn the_next_case_of_several_dates_keeps_the_layout() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    perform(&mut harness, EditCommand::SetTask(Task::Response));
    let arranged = doc(&harness).edit.layout.clone();
    wait_for_workers(&mut harness);
    // What is chosen is a lesion of this case, not one at the same place of the next.
    let nothing = "Select a component or a link";
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Lesions));
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label(nothing).is_some());
    harness.get_by_label_contains("Lesion A at 2024-06-01").click();
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label(nothing).is_none());
    let other = tempfile::tempdir().unwrap();
    let mask = |date: &str| {
        format!("T={}@{date}", balls(&other.path().join(format!("{date}.nii")), &[([30.0, 30.0, 20.0], 9.0)]))
    };
    let masks = ["2024-01-01", "2024-03-01", "2024-06-01"].map(mask).to_vec();
    let open = |harness: &mut Window, case: CaseRef| {
        perform(harness, AppCommand::Open(case.clone()));
        if harness.query_by_label("Discard").is_some() {
            click(harness, "Discard");
        }
        wait_for_workers(harness);
        assert_eq!(doc(harness).case, case);
    };
    open(&mut harness, CaseRef::Arguments { masks, contexts: Vec::new() });
    assert_eq!(doc(&harness).edit.layout, arranged);
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Lesions));
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label(nothing).is_some());
    let one = format!("T={}", balls(&folder.path().join("one.nii"), &[([30.0, 30.0, 20.0], 6.0)]));
    open(&mut harness, CaseRef::Arguments { masks: vec![one], contexts: Vec::new() });
    assert_ne!(doc(&harness).edit.layout, arranged);
}

#[test]
fn the_layout_for_the_response_shows_all_of_it_on_a_small_screen() {
    // Several masks and criteria with a choice of what is assessed: the most that stands in a line.
    let mut harness = window_on(CaseRef::Sample, [1280.0, 720.0], egui::Theme::Dark);
    issue(&mut harness, EditCommand::SetTask(Task::Response));
    wait_for_workers(&mut harness);
    choose(&mut harness, "Criteria", "RANO 2.0");
    wait_for_workers(&mut harness);
    let pane = harness.state().pane_rect(PaneId::Response).unwrap();
    let author = harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "stated by").rect();
    for rect in [
        harness.get_by_label("By volume").rect(),
        harness.get_by_label("From the lowest").rect(),
        harness.get_by_label_contains("the masks show B").rect(),
        harness.get_by_label("by volume").rect(),
        harness.get_by_label("Verify it").rect(),
        author,
    ] {
        assert!(pane.x_range().contains(rect.left()) && pane.x_range().contains(rect.right()), "{rect:?}");
    }
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        harness.render().unwrap().save(Path::new(&folder).join("response-layout.png")).unwrap();
    }
}

/// Of two scans only the first has a later one: nobody is asked, and nobody has stated it until a click does.
#[test]
fn of_two_scans_the_first_is_the_baseline_until_the_criteria_choose_another() {
    let mut harness = two_scans(&tempfile::tempdir().unwrap());
    choose(&mut harness, "Criteria", "RANO 2010");
    let baseline = |harness: &Window| doc(harness).edit.response.history.clone().unwrap().baseline.unwrap();
    assert_eq!(baseline(&harness), Fact::proposed(Label("2024-01-01".into())));
    assert!(harness.query_by_label_contains("proposed: the only one").is_some());
    // 8 against 8 mm, and a new lesion of the masks: the calls stand in a line on top.
    click(&mut harness, "Radiotherapy: there was none");
    let last = harness.state().results.response.last().unwrap().response.dates.last().unwrap().clone();
    assert_eq!(last.by_diameters.call, Call::Progression);
    assert_eq!(harness.query_all_by_label("+0.0 % (margin unknown)").count(), 1, "by diameters");
    click(&mut harness, "Baseline: 2024-01-01");
    assert!(!baseline(&harness).is_proposed() && baseline(&harness).entered.is_some());
    assert!(harness.query_by_label_contains("proposed: the only one").is_none());
    // A margin in the same line.
    click(&mut harness, "How well measurements repeat");
    type_into(&mut harness, "Products of diameters", "10");
    // 95 % of a ratio with a relative SD of √2·0.1: exp(±1.96·0.1414) = 0.758 and 1.319.
    assert_eq!(harness.query_all_by_label("+0.0 % (-24 to +32 %)").count(), 1);
}

/// What the calls rest on is one click away.
#[test]
fn links_and_new_lesions_are_gone_to_and_verified_from_the_form() {
    let mut harness = two_scans(&tempfile::tempdir().unwrap());
    choose(&mut harness, "Criteria", "RANO 2010");
    let pane = harness.state().pane_rect(PaneId::Response).unwrap();
    let lens = |harness: &Window| doc(harness).edit.lens.center_mm.to_array();
    let is_at =
        |harness: &Window, mm: [f64; 3]| lens(harness).iter().zip(mm).all(|(a, b)| (a - b).abs() < 1.5);
    let verified = |harness: &Window| doc(harness).edit.lesions.edits.len();
    // Nothing to verify before it was looked at.
    harness.hover_at(pane.center());
    harness.key_press(Key::V);
    wait_for_workers(&mut harness);
    assert_eq!(verified(&harness), 0);
    click(&mut harness, "Rests on 1 unverified link");
    assert!(is_at(&harness, [15.0, 15.0, 20.0]), "{:?}", lens(&harness));
    assert_eq!(doc(&harness).nav.time, 1);
    harness.get_by_label_contains("the masks show B").click();
    wait_for_workers(&mut harness);
    assert!(is_at(&harness, [45.0, 45.0, 20.0]), "{:?}", lens(&harness));
    // By keys.
    harness.hover_at(pane.center());
    harness.key_press(Key::N);
    wait_for_workers(&mut harness);
    assert!(is_at(&harness, [15.0, 15.0, 20.0]));
    // The pane of lesions has it, too, once it is in sight.
    perform(&mut harness, EditCommand::SetTask(Task::Response));
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label("Verify the link").is_some());
    let pane = harness.state().pane_rect(PaneId::Response).unwrap();
    harness.hover_at(pane.center());
    harness.key_press(Key::V);
    wait_for_workers(&mut harness);
    assert_eq!(verified(&harness), 1);
    assert!(harness.query_by_label("All links between lesions are verified").is_some());
}

/// Where only one link is proposed, the button can mean no other.
#[test]
fn the_only_link_is_verified_by_its_button_without_going_to_it() {
    let mut harness = two_scans(&tempfile::tempdir().unwrap());
    choose(&mut harness, "Criteria", "RANO 2010");
    click(&mut harness, "Verify it");
    assert_eq!(doc(&harness).edit.lesions.edits.len(), 1);
    assert!(harness.query_by_label("All links between lesions are verified").is_some());
}

/// Whoever chooses criteria is offered what shows the lesions and images that they judge; maximised, the form keeps the images beside it.
#[test]
fn the_layout_is_offered_once_criteria_are_chosen() {
    let offer = "Show lesions and images beside it";
    let mut harness = two_scans(&tempfile::tempdir().unwrap());
    assert!(harness.query_by_label(offer).is_none(), "nothing is judged yet");
    assert!(harness.state().pane_rect(PaneId::SideBySide).is_some(), "images stay in sight");
    choose(&mut harness, "Criteria", "RANO 2010");
    click(&mut harness, offer);
    assert!(harness.query_by_label(offer).is_none());
    for pane in [PaneId::Response, PaneId::Lesions, PaneId::SideBySide] {
        assert!(harness.state().pane_rect(pane).is_some(), "{pane:?}");
    }
}

/// A treatment is its kind, then its day; who stated it is kept.
#[test]
fn a_treatment_has_its_kind_before_its_day_and_an_author() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = two_scans(&folder);
    choose(&mut harness, "Criteria", "iRANO");
    type_into(&mut harness, "stated by", "A. B.");
    click(&mut harness, "also what changes no call");
    click(&mut harness, "Kind of another treatment: immunotherapy");
    // The day's field has the focus.
    let field = harness.get_by_role_and_label(egui::accesskit::Role::TextInput, "started on");
    assert!(field.is_focused());
    field.type_text("5.2.2024");
    harness.run_ok();
    harness.key_press(Key::Enter);
    wait_for_workers(&mut harness);
    let treatments =
        |harness: &Window| doc(harness).edit.response.history.clone().unwrap().treatment.unwrap();
    let [one] = treatments(&harness).try_into().unwrap();
    assert_eq!(one.kind, TreatmentKind::Immunotherapy);
    assert_eq!((one.start.to_string().as_str(), one.author.as_deref()), ("2024-02-05", Some("A. B.")));
    assert!(one.entered.is_some());
    // Whoever changes it states it; what is typed comes behind what stands there.
    type_into(&mut harness, "stated by", "C. D.");
    type_into(&mut harness, "name", "nivolumab");
    let [one] = treatments(&harness).try_into().unwrap();
    assert_eq!((one.name.as_deref(), one.author.as_deref()), (Some("nivolumab"), Some("A. B.C. D.")));
    // And the session keeps it.
    let path = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.response, doc(&harness).edit.response);
}

/// Why a dose was raised is asked once a dose is known.
#[test]
fn why_steroids_were_raised_is_asked_after_the_dose() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    choose(&mut harness, "Criteria", "RANO 2.0");
    click(&mut harness, "Baseline: 2024-01-01");
    click(&mut harness, "Radiotherapy: there was none");
    let why = "Why steroids were raised";
    let at = |what: &str, date: &str| format!("{what} at {date}: none");
    let dose = "Steroids, mg dexamethasone a day";
    assert!(harness.query_by_label(&at(dose, "2024-03-01")).is_some(), "the dose is");
    assert!(harness.query_by_label(why).is_none());
    assert!(harness.query_all_by_label_contains("answers are missing").count() >= 1);
    click(&mut harness, &at(dose, "2024-01-01"));
    // The second scan's: the last scan stands first.
    let fields = harness.query_all_by_role_and_label(egui::accesskit::Role::TextInput, dose);
    let fields: Vec<_> = fields.collect();
    let second = &fields[fields.len() - 2];
    second.focus();
    second.type_text("4");
    drop(fields);
    harness.run_ok();
    harness.key_press(Key::Enter);
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label(why).is_some(), "raised from 0 to 4 mg");
}

#[test]
fn bt_rads_is_asked_question_by_question() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    harness.get_by_label("BT-RADS, question by question").click();
    harness.run_ok();
    for (answer, next) in [
        ("yes", "How does the tumour look, compared with the earlier scan?"),
        ("worse", "How long ago did radiotherapy end?"),
        ("less than 90 days", "BT-RADS 3a: worse, favours effects of treatment"),
    ] {
        assert!(harness.query_by_label(next).is_none(), "{next} is not asked yet");
        harness.get_by_label(answer).click();
        harness.run_ok();
        assert!(harness.query_by_label(next).is_some(), "{next}");
    }
    assert_eq!(doc(&harness).edit.response.bt_rads["2024-01-01"].len(), 3);
    perform(&mut harness, EditCommand::Undo);
    harness.run_ok();
    assert!(harness.query_by_label_contains("BT-RADS 3a").is_none());
}

#[test]
fn what_is_no_date_is_said_and_not_taken() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = opened(folder.path());
    choose(&mut harness, "Criteria", "mRANO");
    type_into(&mut harness, "Radiotherapy ended", "31/1/2024");
    assert!(harness.query_by_label_contains("is no date").is_some());
    assert_eq!(doc(&harness).edit.response.history.clone().unwrap().radiotherapy_end, None);
    type_into(&mut harness, "Radiotherapy ended", "2023-12-01");
    assert!(harness.query_by_label_contains("is no date").is_none());
    assert!(doc(&harness).edit.response.history.clone().unwrap().radiotherapy_end.is_some());
}

#[test]
fn a_target_stays_the_lesion_that_was_meant_and_options_count_with_a_session() {
    let folder = tempfile::tempdir().unwrap();
    let balls_at = |date: &str, of: &[([f64; 3], f64)]| {
        format!("T={}@{date}", balls(&folder.path().join(format!("{date}.nii")), of))
    };
    let (first, second) = ([15.0, 15.0, 20.0], [40.0, 40.0, 20.0]);
    let masks = vec![
        balls_at("2024-01-01", &[(first, 8.0), (second, 7.0)]),
        balls_at("2024-03-01", &[(first, 8.0), (second, 9.0)]),
    ];
    let case = CaseRef::Arguments { masks, contexts: Vec::new() };
    let mut harness = window_on(case, [1280.0, 900.0], egui::Theme::Light);
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Response));
    wait_for_workers(&mut harness);
    choose(&mut harness, "Criteria", "RANO 2010");
    click(&mut harness, "Baseline: 2024-01-01");
    harness.get_by_label("also what changes no call").click();
    wait_for_workers(&mut harness);
    type_into(&mut harness, "Targets", "B");
    assert!(doc(&harness).edit.response.named_at.contains_key("B"));
    let path = folder.path().join("read.glioscope.json");
    let sum = |harness: &mut Window, more: &[&str]| {
        perform(harness, AppCommand::SaveSessionTo(path.clone()));
        let (json, _) =
            answer(PROGRAM, &[&["response", path.to_str().unwrap(), "--json"][..], more].concat());
        json["dates"][0]["by_diameters"]["sums"][0]["sum"].as_f64()
    };
    let of_second = sum(&mut harness, &[]);
    assert!(of_second.is_some());
    // The first is no lesion any more: what was B is A now, and still the target.
    let at = |mm: [f64; 3]| glioscope_core::lesions::Anchor {
        time: "2024-01-01".into(),
        of: "T".into(),
        at_mm: glam::DVec3::from_array(mm),
    };
    perform(
        &mut harness,
        EditCommand::EditLesions(vec![glioscope_core::lesions::Edit::Ignore { at: at(first) }]),
    );
    assert_eq!(sum(&mut harness, &[]), of_second);
    // A target that is ignored is told.
    perform(
        &mut harness,
        EditCommand::EditLesions(vec![glioscope_core::lesions::Edit::Ignore { at: at(second) }]),
    );
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    let refused = glioscope_tests::refusal(PROGRAM, &["response", path.to_str().unwrap()]);
    assert!(refused.contains("no lesion any more where B was"), "{refused}");
    // Options of the command line aren't dropped.
    let refused = glioscope_tests::refusal(PROGRAM, &["response", path.to_str().unwrap(), "--of", "nosuch"]);
    assert!(refused.contains("nosuch"), "{refused}");
}

/// The next case is begun by who stated the last one; taken back with the criteria by one undo.
#[test]
fn the_next_case_knows_who_reads() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("config");
    let stated_by = |harness: &Window| doc(harness).edit.response.author.clone();
    let open = || {
        let mut harness = window_of_user(Recent::in_folder(&config), [1280.0, 900.0]);
        perform(&mut harness, AppCommand::Open(CaseRef::Sample));
        wait_for_workers(&mut harness);
        issue(&mut harness, EditCommand::MaximizePane(PaneId::Response));
        wait_for_workers(&mut harness);
        harness
    };
    let mut harness = open();
    choose(&mut harness, "Criteria", "RANO 2010");
    assert_eq!(stated_by(&harness), "", "nobody was named yet");
    // What was answered before the name was typed is that reader's.
    click(&mut harness, "also what changes no call");
    harness.get_by_label("Disease: newly diagnosed").click_accesskit();
    wait_for_workers(&mut harness);
    type_into(&mut harness, "stated by", "A. B.");
    assert_eq!(stated_by(&harness), "A. B.");
    let disease = doc(&harness).edit.response.history.as_ref().unwrap().disease.clone().unwrap();
    assert_eq!(disease.author.as_deref(), Some("A. B."));
    // Nothing of this case is shown of the next one while that one's is computed.
    assert!(harness.state().results.response.last().is_some());
    let other = CaseRef::Arguments {
        masks: vec![format!("T={}", balls(&folder.path().join("other.nii"), &[([30.0, 30.0, 20.0], 6.0)]))],
        contexts: Vec::new(),
    };
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Response));
    perform(&mut harness, AppCommand::Open(other));
    if harness.state().is_asking() {
        harness.run_ok();
        harness.get_by_label("Discard").click();
    }
    wait_for_workers(&mut harness);
    let response = harness.state().results.response.last().map(|found| found.response.dates.len());
    assert_ne!(response, Some(2), "of the case before");
    let mut harness = open();
    assert_eq!(stated_by(&harness), "", "nothing is stated before criteria are chosen");
    choose(&mut harness, "Criteria", "RANO 2.0");
    assert_eq!(stated_by(&harness), "A. B.");
    perform(&mut harness, EditCommand::Undo);
    assert!(stated_by(&harness).is_empty() && doc(&harness).edit.response.history.is_none());
    // Who clears it isn't named again.
    choose(&mut harness, "Criteria", "RANO 2.0");
    let mut cleared = doc(&harness).edit.response.clone();
    cleared.author.clear();
    perform(&mut harness, EditCommand::SetResponse(Box::new(cleared)));
    choose(&mut harness, "Criteria", "mRANO");
    assert_eq!(stated_by(&harness), "");
}
