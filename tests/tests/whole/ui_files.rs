//! What the window writes: numbers, pictures, and what it remembers from run to run.

use std::{collections::BTreeMap, sync::Arc};

use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, ExportFormat, PaneId, PictureSize, Reading, Ruler, Shape},
    report::Options,
    window::{dialogs::Choice, recent::Recent},
};
use glioscope_core::{
    Progress,
    change::{self, ChangeOptions},
    files::write_whole,
    glam::DVec3,
};
use glioscope_tests::{
    MASK_COLORS, Window, answer, doc, error_text, issue, perform, sample, wait_for_workers, window_of_user,
    write_cube,
};
use serde_json::Value;

use crate::PROGRAM;

const SIZE: [f32; 2] = [1280.0, 800.0];

#[test]
fn exported_numbers_have_what_the_window_shows_and_csv_has_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (json, csv) = (folder.path().join("numbers.json"), folder.path().join("numbers.csv"));
    let mut harness = sample();
    let ruler = Ruler {
        name: "Line 1".into(),
        from_mm: DVec3::ZERO,
        to_mm: DVec3::new(3.0, 4.0, 0.0),
        shape: Shape::Line,
        view: PaneId::Axial,
        time: 0,
    };
    perform(&mut harness, EditCommand::AddRuler(Box::new(ruler)));
    perform(&mut harness, EditCommand::SetRegion(1, false));
    for path in [&json, &csv] {
        issue(&mut harness, AppCommand::ExportMeasurementsTo(path.clone()));
        wait_for_workers(&mut harness);
        assert_eq!(error_text(&harness), "");
    }
    let numbers: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    let case = harness.state().work.world.case().unwrap().clone();
    let time_point = &case.time_points[0];

    // The keys of `measure --json` are where they are there.
    let mask = &numbers["time_points"][0]["masks"][0];
    assert_eq!(mask["voxels"].as_u64(), Some(time_point.regions.mask_voxels(0)));
    assert_eq!(numbers["hidden_regions"], serde_json::json!([[mask["id"]]]));
    assert_eq!(numbers["lines"][0]["length_mm"].as_f64(), Some(5.0));

    // The metrics of agreement by their convention, as `measure --metrics --json` has them.
    let metrics = &numbers["time_points"][0]["pairs"][0];
    assert_eq!(metrics["convention"], "deepmind");
    let (answered, _) = answer(PROGRAM, &["measure", "--sample", "--metrics", "--json"]);
    assert_eq!(*metrics, answered["time_points"][0]["pairs"][0]);
    assert_eq!(numbers["bt_rads"], serde_json::json!([]));

    // The lens: a count of all voxels.
    let lens = doc(&harness).edit.lens;
    let grid = time_point.index.grid();
    let mut inside: BTreeMap<u32, u64> = BTreeMap::new();
    for linear in 0..grid.voxel_count() {
        let bits = time_point.index.get(linear);
        if bits != 0 && grid.center_of_voxel_mm(grid.ijk(linear)).distance(lens.center_mm) <= lens.radius_mm {
            *inside.entry(bits).or_default() += 1;
        }
    }
    assert_eq!(numbers["lens"]["voxels"].as_u64(), Some(inside.values().sum()));
    let mut found: Vec<u64> = numbers["lens"]["regions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|r| r["voxels"].as_u64().unwrap())
        .collect();
    let mut expected: Vec<u64> = inside.values().copied().collect();
    found.sort_unstable();
    expected.sort_unstable();
    assert_eq!(found.into_iter().filter(|n| *n > 0).collect::<Vec<_>>(), expected);

    // The change between the dates, as the command line computes it.
    let choice = doc(&harness).edit.change.chosen(&case).unwrap();
    let (report, _) =
        change::between(&case, &choice, &ChangeOptions::default(), None, &Progress::new()).unwrap();
    assert_eq!(numbers["change"]["growth"]["max_mm"].as_f64(), report.growth.max_mm);
    assert_eq!(numbers["change"]["from_ml"].as_f64(), Some(report.from_ml));

    // One ellipsoid per component of every mask and region of both dates.
    let components = numbers["ellipsoids"]["components"].as_array().unwrap();
    let masks: usize = case.time_points.iter().map(|t| t.masks.len()).sum();
    let regions: usize = case.time_points.iter().map(|t| t.regions.list().len()).sum();
    assert!(components.len() >= masks + regions, "{} components", components.len());

    let table = std::fs::read_to_string(&csv).unwrap();
    let has = |row: &str| table.lines().any(|line| line == row);
    let id = mask["id"].as_str().unwrap();
    assert!(has(&format!("{},{id},time_points.masks.volume_ml,{}", time_point.label, mask["volume_ml"])));
    assert!(has(&format!(",{},change.growth.max_mm,{}", report.mask, numbers["change"]["growth"]["max_mm"])));
    assert!(has(&format!("{},Line 1,lines.length_mm,5.0", time_point.label)));
}

#[test]
fn pictures_are_as_large_as_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let mut harness = sample();
    let screen = harness.state().pane_rect(PaneId::Overlap).unwrap().size();
    let picture = |harness: &mut Window, size: PictureSize, pane| {
        let path = folder.path().join("picture.png");
        perform(harness, AppCommand::SetPictureSize(size));
        issue(harness, AppCommand::ScreenshotTo(pane, path.clone()));
        harness.run_steps(3);
        wait_for_workers(harness);
        assert_eq!(error_text(harness), "");
        image::open(&path).unwrap().to_rgba8()
    };
    let overlap = Some(PaneId::Overlap);
    let once = picture(&mut harness, PictureSize::Times(1), overlap);
    let twice = picture(&mut harness, PictureSize::Times(2), overlap);
    for (found, points) in [(twice.width(), screen.x), (twice.height(), screen.y)] {
        assert!((found as f32 - 2.0 * points).abs() <= 1.0, "{found} {points}");
    }
    // Twice the pixels, not each pixel twice: the areas of pure green agree within the blurred edges of the smaller one.
    let green = |picture: &image::RgbaImage| glioscope_tests::count_color(picture, MASK_COLORS[1], 0) as f64;
    let ratio = green(&twice) / green(&once);
    assert!((4.0..4.4).contains(&ratio), "{ratio}");
    let halves = twice.pixels().zip(twice.pixels().skip(1)).step_by(2).filter(|(a, b)| a != b).count();
    assert!(halves > 100, "edges lie between the pixels of the screen: {halves}");

    let wide = picture(&mut harness, PictureSize::WidthPx(1000), overlap);
    assert!(wide.width().abs_diff(1000) <= 1, "{}", wide.width());
    let window = picture(&mut harness, PictureSize::WidthPx(640), None);
    assert_eq!(window.dimensions(), (640, 400));
}

#[test]
fn a_width_is_typed_in_the_menu() {
    let mut harness = sample();
    harness.get_by_label("File").click();
    harness.run_ok();
    harness.get_by_label_contains("Size of pictures").click();
    harness.run_ok();
    harness.get_by_label("Width of pictures in pixels").click();
    harness.run_ok();
    harness.event(egui::Event::Text("640".into()));
    harness.key_press(egui::Key::Enter);
    harness.run_ok();
    assert_eq!(harness.state().work.picture_size, PictureSize::WidthPx(640));
}

#[test]
fn theme_size_and_folder_are_remembered() {
    let folder = tempfile::tempdir().unwrap();
    let written = tempfile::tempdir().unwrap();
    let recent = || Recent::in_folder(folder.path());
    let mut harness = window_of_user(recent(), SIZE);
    harness.run_ok();
    perform(&mut harness, AppCommand::ToggleDark);
    perform(&mut harness, AppCommand::SetPictureSize(PictureSize::Times(4)));
    let session = written.path().join("patient.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(session));
    let root = harness.input_mut().viewports.entry(egui::ViewportId::ROOT).or_default();
    root.events.push(egui::ViewportEvent::Close);
    harness.run_steps(1);

    let text = std::fs::read_to_string(folder.path().join("window.json")).unwrap();
    let remembered: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(remembered["folder"].as_str(), written.path().to_str());
    assert_eq!(remembered["size_points"], serde_json::json!([1280.0, 800.0]));
    assert!(!text.contains("patient"), "{text}");
    let mut again = window_of_user(recent(), SIZE);
    again.run_ok();
    assert!(again.ctx.global_style().visuals.dark_mode);
    assert_eq!(again.state().work.picture_size, PictureSize::Times(4));
}

#[test]
fn the_report_dialog_writes_what_was_chosen_of_what_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("bericht.html");
    let mut harness = sample();
    let answer = out.clone();
    harness.state_mut().chooser = Arc::new(move |_, _| Choice::Path(answer.clone()));
    let conclusion = "Stabil.".to_owned();
    let (reader, day) = ("Dr. Kanarienvogel".to_owned(), "2024-05-02".to_owned());
    let reading = Reading { conclusion, reader, day, ..Reading::default() };
    perform(&mut harness, EditCommand::SetReading(Box::new(reading)));
    perform(&mut harness, AppCommand::ShowReport);
    harness.get_by_label("Initials").click_accesskit();
    harness.run_ok();
    harness.get_by_label("Deutsch").click_accesskit();
    harness.run_ok();
    // Signed, unless the reader says otherwise.
    harness.get_by_label("Name printed, with the day").click_accesskit();
    harness.run_ok();
    harness.get_by_label("Choose the file…").click_accesskit();
    for _ in 0..100 {
        harness.run_ok();
        if harness.state().is_exporting() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    let page = std::fs::read_to_string(&out).unwrap();
    for expected in
        ["lang=\"de\"", "<h2 id=\"s0\">Warnungen</h2>", "Läsionen von T1", "\"identity\":\"initials\""]
    {
        assert!(page.contains(expected), "{expected}");
    }
    // That the reader isn't named is said; the day is.
    assert!(page.contains("Stabil.") && page.contains("in diesem Bericht nicht genannt, 2024-05-02"));
    assert!(!page.contains("Kanarienvogel"));
    let signed = folder.path().join("signed.html");
    let options = Options { names_reader: true, ..Options::default() };
    issue(&mut harness, AppCommand::WriteReportTo(options, signed.clone()));
    wait_for_workers(&mut harness);
    let page = std::fs::read_to_string(&signed).unwrap();
    assert!(page.contains("Dr. Kanarienvogel, 2024-05-02") && page.contains("left out of this report"));
    // The next thing wanted is to see it.
    let notice = harness.state().work.notice.clone().unwrap();
    assert_eq!(notice.file.as_deref(), Some(signed.as_path()));
    harness.get_by_label("Open");
}

/// What is written of a patient is proposed beside that patient's files, not where another's were written last.
#[test]
fn a_file_of_the_next_case_is_proposed_in_its_own_folder() {
    let folder = tempfile::tempdir().unwrap();
    let case = |name: &str| {
        let own = folder.path().join(name);
        write_cube(&own.join("T1.nii"), 12, 1.0, |ijk| u8::from(ijk.iter().all(|i| (3..8).contains(i))));
        let manifest = "glioscope = 1\nname = \"A\"\n[[mask]]\nid = \"T1\"\nfile = \"T1.nii\"\n";
        write_whole(&own.join("case.toml"), manifest.as_bytes()).unwrap();
        own
    };
    let [first, second] = ["first", "second"].map(case);
    let elsewhere = folder.path().join("reports");
    std::fs::create_dir(&elsewhere).unwrap();
    let mut harness = sample();
    let asked = Arc::new(std::sync::Mutex::new(Vec::new()));
    let (seen, answer) = (asked.clone(), elsewhere.join("numbers.json"));
    harness.state_mut().chooser = Arc::new(move |_, folder: Option<&std::path::Path>| {
        seen.lock().unwrap().push(folder.map(std::path::Path::to_owned));
        Choice::Path(answer.clone())
    });
    let proposed = |harness: &mut Window| {
        issue(harness, AppCommand::ExportMeasurements(ExportFormat::Json));
        for _ in 0..50 {
            harness.run_ok();
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        wait_for_workers(harness);
        asked.lock().unwrap().last().cloned().flatten()
    };
    for own in [first, second] {
        perform(&mut harness, AppCommand::Open(CaseRef::Path(own.join("case.toml"))));
        wait_for_workers(&mut harness);
        harness.state_mut().work.error = None;
        assert_eq!(proposed(&mut harness), Some(own), "{}", error_text(&harness));
        assert_eq!(proposed(&mut harness), Some(elsewhere.clone()), "where its last file went");
    }
}
