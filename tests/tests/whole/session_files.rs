//! Files of sessions: known by their content, with their own case wherever it lies, and refused where they are damaged.

use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use egui::Theme;
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand, Workstation},
    model::{CaseRef, PaneId, session},
    window::{
        autosave::{Autosave, INTERVAL},
        dialogs::open_command,
        recent::Recent,
    },
    world::jobs::Waker,
};
use glioscope_tests::{error_text, issue, perform, run, user_window, window_with, workstation, write_cube};
use serde_json::{Value, json};

use crate::{
    PROGRAM,
    sessions::{apply, findings, opened, wait},
};

/// A case in `folder` with the masks T1 and T2, cubes of `side` and `side` - 1 voxels of 1 mm, and its manifest.
fn patient(folder: &Path, name: &str, side: usize) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    let mut text = format!("glioscope = 1\nname = \"{name}\"\n");
    for (id, side) in [("T1", side), ("T2", side - 1)] {
        let inside = |ijk: [usize; 3]| ijk.iter().all(|x| (2..2 + side).contains(x));
        write_cube(&folder.join(format!("{id}.nii")), 16, 1.0, |ijk| u8::from(inside(ijk)));
        text.push_str(&format!("[[mask]]\nid = \"{id}\"\nfile = \"{id}.nii\"\n"));
    }
    let manifest = folder.join("case.toml");
    std::fs::write(&manifest, text).unwrap();
    manifest
}

/// A workstation that opened a case as the window does.
fn opened_case(case: CaseRef) -> Workstation {
    let mut work = Workstation::default();
    work.open(case, Vec::new(), Waker::default());
    wait(&mut work);
    assert_eq!(work.error.as_ref().map(ToString::to_string), None);
    work
}

/// A session of the case with this manifest, saved as `path`.
fn saved(manifest: &Path, path: &Path) {
    assert!(opened_case(CaseRef::Path(manifest.to_owned())).save(path.to_owned()));
}

/// Voxels of T1 in the case open.
fn t1_voxels(work: &Workstation) -> u64 {
    work.world.case().unwrap().time_points[0].regions.mask_voxels(0)
}

#[test]
fn a_session_is_known_by_its_content_whatever_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(folder.path(), "A", 5);
    let path = folder.path().join("foo.txt");
    saved(&manifest, &path);
    // Another program may sort the keys.
    let sorted = folder.path().join("sorted");
    let value: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let document = value["document"].clone();
    std::fs::write(&sorted, format!("\n {{\"document\": {document}, \"glioscope_session\": 3}}")).unwrap();
    let other = folder.path().join("other.json");
    std::fs::write(&other, "{\"case\": \"A\"}").unwrap();
    for path in [&path, &sorted] {
        assert!(session::is_session(path), "{path:?}");
        assert_eq!(open_command(path.clone()), AppCommand::OpenSession(path.clone()).into());
    }
    for path in [&manifest, &other, &folder.path().join("T1.nii"), &folder.path().to_owned()] {
        assert!(!session::is_session(path), "{path:?}");
    }
    // Every command that takes a case takes it as a session.
    let of = path.to_str().unwrap();
    for arguments in [
        &["info", of][..],
        &["measure", of],
        &["ellipsoids", of],
        &["render", of, "--explain", "--view", "closeup"],
    ] {
        let output = run(PROGRAM, arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let report: Value = serde_json::from_slice(&run(PROGRAM, &["measure", of, "--json"]).stdout).unwrap();
    assert_eq!(report["time_points"][0]["masks"][0]["voxels"], 125);
    for command in ["change", "tracts"] {
        let stderr = String::from_utf8_lossy(&run(PROGRAM, &[command, of]).stderr).into_owned();
        assert!(!stderr.contains("another kind"), "refused for what the case lacks: {stderr}");
    }
}

#[test]
fn saving_adds_the_ending_and_what_was_saved_opens() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(folder.path(), "A", 5);
    let mut harness = window_with(opened_case(CaseRef::Path(manifest)), [900.0, 700.0], Theme::Dark);
    perform(&mut harness, AppCommand::SaveSessionTo(folder.path().join("foo.txt")));
    let path = folder.path().join("foo.txt.glioscope.json");
    assert_eq!(harness.state().work.session_path, Some(path.clone()));
    assert_eq!(t1_voxels(&opened(&path)), 125);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    }
    // The file chooser asked about the name that was typed, not about this one.
    let taken = folder.path().join("bar.glioscope.json");
    std::fs::write(&taken, "something").unwrap();
    perform(&mut harness, AppCommand::SaveSessionTo(folder.path().join("bar")));
    assert!(error_text(&harness).contains("bar.glioscope.json: found a file that exists"));
    assert_eq!(std::fs::read_to_string(&taken).unwrap(), "something");
    assert_eq!(harness.state().work.session_path, Some(path));
}

/// Two patients' folders, laid out alike: a session opens its own case from wherever, or none.
#[test]
fn a_session_opens_its_own_case_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| folder.path().join(name));
    let manifest = patient(&a, "A", 5);
    patient(&b, "B", 7);
    let path = a.join("visit.glioscope.json");
    // Saved with a path relative to the folder in which the program ran.
    let mut work = opened_case(CaseRef::Path(manifest.clone()));
    assert!(work.save(path.clone()));
    let copy = b.join("visit.glioscope.json");
    std::fs::copy(&path, &copy).unwrap();
    let voxels = |path: &Path| t1_voxels(&opened(path));
    assert_eq!((voxels(&path), voxels(&copy)), (125, 125));
    // Which of the two is opened is said.
    let places = |path: &Path| findings(&opened(path), "session-place").len();
    assert_eq!((places(&path), places(&copy)), (0, 1));
    let text = std::fs::read_to_string(&path).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(value["relative"]["case"], json!({"path": "case.toml"}));
    assert_eq!(value["document"]["case"]["path"], manifest.to_str().unwrap());

    // Its folder moved: the session beside the case finds it, the one in the other patient's folder doesn't.
    std::fs::rename(&a, &c).unwrap();
    let work = opened(&c.join("visit.glioscope.json"));
    assert_eq!((t1_voxels(&work), findings(&work, "session-files-changed").len()), (125, 0));
    let mut work = Workstation::default();
    work.open_session(&copy, &[], Waker::default());
    wait(&mut work);
    let error = work.error.as_ref().unwrap().to_string();
    assert!(work.doc.is_none() && error.contains("a case of other files beside it (0 of 3"), "{error}");
    let output = run(PROGRAM, &["measure", copy.to_str().unwrap()]);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));

    // Before version 3 a relative path is seen from the session's folder, not from where the program runs.
    let mut old = value;
    old["glioscope_session"] = json!(2);
    old["document"]["case"]["path"] = json!("case.toml");
    old["document"]["nav"]["time"] = json!(0);
    old.as_object_mut().unwrap().retain(|key, _| key != "relative" && key != "files");
    let path = c.join("old.glioscope.json");
    std::fs::write(&path, old.to_string()).unwrap();
    let output = std::process::Command::new(PROGRAM)
        .args(["measure", "--json", path.to_str().unwrap()])
        .current_dir(&b)
        .output()
        .unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["time_points"][0]["masks"][0]["voxels"], 125);
    assert!(String::from_utf8_lossy(&output.stderr).contains("session-unchecked"));
}

#[test]
fn the_files_of_arguments_are_found_from_the_session() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    patient(&a, "A", 5);
    let masks = vec![format!("T1={}@2024-01-01", a.join("T1.nii").display())];
    let mut work = opened_case(CaseRef::Arguments { masks, contexts: Vec::new() });
    assert!(work.save(a.join("x.glioscope.json")));
    std::fs::rename(&a, &b).unwrap();
    let work = opened(&b.join("x.glioscope.json"));
    assert_eq!(t1_voxels(&work), 125);
    assert_eq!(work.world.case().unwrap().time_labels(), ["2024-01-01"]);
}

#[test]
fn files_that_changed_since_a_session_was_saved_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(folder.path(), "A", 5);
    let path = folder.path().join("visit.glioscope.json");
    saved(&manifest, &path);
    assert_eq!(findings(&opened(&path), "session-files-changed"), [""; 0]);
    let other = folder.path().join("other");
    patient(&other, "A", 6);
    std::fs::copy(other.join("T1.nii"), folder.path().join("T1.nii")).unwrap();
    let work = opened(&path);
    let said = findings(&work, "session-files-changed");
    assert!(said.len() == 1 && said[0].contains("T1.nii") && !said[0].contains("T2.nii"), "{said:?}");
    assert_eq!(t1_voxels(&work), 216);
    let output = run(PROGRAM, &["measure", path.to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("session-files-changed"));
}

/// What failed to open must not become what is saved to.
#[test]
fn a_session_that_fails_to_open_is_not_overwritten_by_the_one_open() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|name| folder.path().join(name));
    let [own, other] = [a.join("a.glioscope.json"), b.join("b.glioscope.json")];
    saved(&patient(&a, "A", 5), &own);
    saved(&patient(&b, "B", 7), &other);
    std::fs::remove_file(b.join("T2.nii")).unwrap();
    let before = std::fs::read(&other).unwrap();
    let mut harness = window_with(opened(&own), [900.0, 700.0], Theme::Dark);
    harness.run_ok();
    issue(&mut harness, AppCommand::OpenSession(other.clone()));
    // While it is being opened, and once that has failed.
    perform(&mut harness, AppCommand::SaveSession);
    glioscope_tests::wait_for_workers(&mut harness);
    let error = error_text(&harness);
    assert!(error.contains("T2.nii"), "{error}");
    perform(&mut harness, AppCommand::SaveSession);
    assert_eq!(std::fs::read(&other).unwrap(), before);
    assert_eq!(harness.state().work.session_path, Some(own));
}

#[test]
fn a_report_replaces_only_one_of_its_own_case_and_all_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(&folder.path().join("a"), "A", 5);
    let out = folder.path().join("out");
    std::fs::create_dir(&out).unwrap();
    let report = || {
        run(PROGRAM, &["report", manifest.to_str().unwrap(), "--software", "--out", out.to_str().unwrap()])
    };
    let refused = |word: &str| {
        let before: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
        let output = report();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(word), "{stderr}");
        let after: Vec<_> = std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(before, after);
    };
    // Pictures of nobody known, then of another case.
    std::fs::write(out.join("change.png"), "").unwrap();
    refused("change.png without measure.json");
    std::fs::write(out.join("measure.json"), "{\"case\": \"B\"}").unwrap();
    refused("the report of \"B\"");
    // Of its own, with a picture that a case with one date has not.
    std::fs::write(out.join("measure.json"), "{\"case\": \"A\"}").unwrap();
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    let output = report();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(!out.join("change.png").exists() && out.join("axial.png").exists());
    assert_eq!(std::fs::read_to_string(out.join("notes.txt")).unwrap(), "mine");
    let numbers: Value = serde_json::from_slice(&std::fs::read(out.join("measure.json")).unwrap()).unwrap();
    assert_eq!(numbers["time_points"][0]["masks"][0]["voxels"], 125);
    let all: Value = serde_json::from_slice(&std::fs::read(out.join("numbers.json")).unwrap()).unwrap();
    assert_eq!(all["time_points"][0]["masks"][0]["voxels"], 125);
    assert!(std::fs::read_to_string(out.join("numbers.csv")).unwrap().starts_with("time,of,quantity,value"));
}

/// Each number out of range, and each unknown key, is one line; none is a panic.
#[test]
fn numbers_out_of_range_and_unknown_keys_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.glioscope.json");
    let mut work = workstation(CaseRef::Sample);
    assert!(work.save(path.clone()));
    let good: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let with = |pointer: &str, value: Value| {
        let mut changed = good.clone();
        *changed.pointer_mut(pointer).unwrap() = value;
        std::fs::write(&path, changed.to_string()).unwrap();
        session::load(&path)
    };
    let tiles = good.pointer("/document/edit/layout/tiles/tiles").unwrap().as_object().unwrap();
    let is_linear = |tile: &Value| tile.pointer("/Container/Linear/shares").is_some();
    let (linear, tile) = tiles.iter().find(|(_, tile)| is_linear(tile)).unwrap();
    let child = tile.pointer("/Container/Linear/children/0").unwrap();
    let linear = format!("/document/edit/layout/tiles/tiles/{linear}/Container/Linear");
    let root = good.pointer("/document/edit/layout/root").unwrap();
    for (pointer, value, word) in [
        (format!("{linear}/shares/shares"), json!({child.to_string(): 1e39}), "layout share"),
        (format!("{linear}/shares/shares"), json!({child.to_string(): -1.0}), "layout share"),
        (format!("{linear}/children"), json!([child, child]), "in two places"),
        (format!("{linear}/children"), json!([child, root]), "in two places"),
        (format!("{linear}/children"), json!([4_000_000]), "without a description"),
        ("/document/edit/layout/tiles/next_tile_id".into(), json!(u64::MAX), "next_tile_id"),
        ("/document/edit/layout/width".into(), json!(-3.0), "layout width"),
        ("/document/edit/lens/radius_mm".into(), json!(-1.0), "lens radius_mm"),
        ("/document/edit/lens/center_mm".into(), json!([0.0, 1e300, 0.0]), "lens center_mm"),
        ("/document/edit/overlay_opacity".into(), json!(1.5), "overlay_opacity"),
        ("/document/edit/ellipsoids/neighbors".into(), json!(7), "neighbors"),
        ("/document/edit/light/aperture_deg".into(), json!(90.0), "aperture_deg"),
        ("/document/edit/light/shading/ambient_share".into(), json!(1.5), "ambient_share"),
        ("/document/edit/light/shading/vicinity_samples".into(), json!(0), "vicinity_samples"),
        ("/document/edit/change/full_mm".into(), json!(0.0), "full_mm"),
        ("/document/edit/change/smooth_mm".into(), json!(-0.5), "change"),
        ("/document/nav/camera/world_from_camera".into(), json!([0.0, 0.0, 0.0, 0.0]), "world_from_camera"),
        ("/document/nav/camera/height_mm".into(), json!(0.0), "height_mm"),
        ("/document/nav/mm_per_point".into(), json!(0.0), "mm_per_point"),
        ("/document/nav/zooms".into(), json!({"context": 1e9}), "zooms"),
        ("/document/nav/pan_mm".into(), json!([[0.0, 1e39], [0.0, 0.0], [0.0, 0.0]]), "pan_mm"),
    ] {
        let error = with(&pointer, value).unwrap_err().to_string();
        assert!(error.contains(word) && error.contains("x.glioscope.json: found "), "{pointer}: {error}");
    }
    // A misspelt key, and one in the file's own part.
    let mut misspelt = good.clone();
    let edit = misspelt["document"]["edit"].as_object_mut().unwrap();
    let lens_on = edit["lens_on"].clone();
    edit.insert("lens_onn".into(), lens_on);
    misspelt["fils"] = json!([]);
    std::fs::write(&path, misspelt.to_string()).unwrap();
    let said = findings(&opened(&path), "session-unknown-key");
    assert!(said[0].contains("edit.lens_onn") && said[0].contains("fils"), "{said:?}");
}

#[test]
fn endless_and_huge_sessions_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.glioscope.json");
    let start = Instant::now();
    let mut work = workstation(CaseRef::Sample);
    assert!(work.save(path.clone()));
    let mut many: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let line = json!({"name": "Line", "from_mm": [1.0, 2.0, 3.0], "to_mm": [4.0, 5.0, 6.0],
        "view": "axial", "time": "2024-01-15"});
    many["document"]["edit"]["rulers"] = vec![line; 100_000].into();
    std::fs::write(&path, many.to_string()).unwrap();
    let error = session::load(&path).unwrap_err().to_string();
    assert!(error.contains("100000 entries of rulers") || error.contains("bytes"), "{error}");
    #[cfg(unix)]
    {
        let pipe = folder.path().join("pipe.glioscope.json");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for endless in [&pipe, Path::new("/dev/zero")] {
            let error = session::load(endless).unwrap_err().to_string();
            assert!(error.contains("a pipe or device"), "{error}");
        }
        assert!(!session::is_session(Path::new("/dev/zero")));
    }
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

#[test]
fn a_session_that_changed_on_disk_is_not_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.glioscope.json");
    let mut work = workstation(CaseRef::Sample);
    assert!(work.save(path.clone()) && work.save(path.clone()));
    let by_another = std::fs::read_to_string(&path).unwrap() + "\n";
    std::fs::write(&path, &by_another).unwrap();
    assert!(!work.save(path.clone()));
    let error = work.error.take().unwrap().to_string();
    assert!(error.contains("changed on disk"), "{error}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), by_another);
    // Chosen again in the dialog, which asks; or gone.
    let mut harness = window_with(work, [900.0, 700.0], Theme::Light);
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_ne!(std::fs::read_to_string(&path).unwrap(), by_another);
    std::fs::remove_file(&path).unwrap();
    perform(&mut harness, AppCommand::SaveSession);
    assert!(path.exists());
}

fn has_close_command(harness: &glioscope_tests::Window, wanted: &egui::ViewportCommand) -> bool {
    harness.output().viewport_output.values().any(|output| output.commands.contains(wanted))
}

#[test]
fn leaving_with_unsaved_work_asks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.glioscope.json");
    let mut work = workstation(CaseRef::Sample);
    assert!(work.save(path.clone()));
    let mut harness = window_with(work, [900.0, 700.0], Theme::Light);
    harness.run_ok();
    assert!(!harness.state().work.has_unsaved_work(), "panes are arranged when first drawn");
    let ask_to_close = |harness: &mut glioscope_tests::Window| {
        let root = harness.input_mut().viewports.entry(egui::ViewportId::ROOT).or_default();
        root.events.push(egui::ViewportEvent::Close);
        harness.step();
    };
    ask_to_close(&mut harness);
    assert!(!has_close_command(&harness, &egui::ViewportCommand::CancelClose), "nothing to lose");
    let lens = harness.state().work.doc.as_ref().unwrap().edit.lens;
    perform(&mut harness, EditCommand::SetLensRadius(lens.radius_mm + 1.0));
    assert!(!harness.state().work.has_unsaved_work(), "looking around");

    perform(&mut harness, EditCommand::ToggleLens);
    ask_to_close(&mut harness);
    assert!(has_close_command(&harness, &egui::ViewportCommand::CancelClose));
    harness.run_ok();
    harness.get_by_label("Cancel").click();
    harness.run_ok();
    assert!(!harness.state().is_asking());
    // Escape is Cancel, as in every dialog.
    ask_to_close(&mut harness);
    harness.run_ok();
    assert!(harness.state().is_asking());
    harness.key_press(egui::Key::Escape);
    harness.run_ok();
    assert!(!harness.state().is_asking() && harness.state().work.has_unsaved_work());
    // The command asks, too, and saving answers.
    issue(&mut harness, AppCommand::Quit);
    harness.run_ok();
    harness.get_by_label("Save").click();
    harness.step();
    harness.step();
    assert!(!harness.state().work.has_unsaved_work() && !harness.state().is_asking());
    let saved = opened(&path).doc.unwrap().edit.lens_on;
    assert_eq!(saved, harness.state().work.doc.as_ref().unwrap().edit.lens_on);

    // Opening another case loses the work as well.
    perform(&mut harness, EditCommand::ToggleLens);
    issue(&mut harness, AppCommand::OpenSession(path));
    assert!(harness.state().work.job.is_none() && harness.state().is_asking());
    harness.run_ok();
    harness.get_by_label("Discard").click();
    harness.step();
    glioscope_tests::wait_for_workers(&mut harness);
    assert_eq!(harness.state().work.doc.as_ref().unwrap().edit.lens_on, saved);
}

/// A window that was killed closes its lock and nothing else.
#[test]
fn unsaved_work_is_kept_and_offered_after_a_crash() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(&folder.path().join("a"), "A", 5);
    let state = folder.path().join("state");
    let start = Instant::now();
    let mut autosave = Autosave::in_folder(&state).unwrap();
    let mut work = opened_case(CaseRef::Path(manifest));
    assert_eq!(autosave.keep(&work, start), None, "nothing changed");
    apply(&mut work, EditCommand::ToggleLens);
    let lens_on = work.doc.as_ref().unwrap().edit.lens_on;
    assert_eq!(autosave.keep(&work, start), Some(INTERVAL));
    let files = || {
        let names = std::fs::read_dir(&state).unwrap().map(|entry| entry.unwrap().path());
        names.filter(|path| path.extension().is_some_and(|e| e == "json")).collect::<Vec<_>>()
    };
    assert_eq!(files().len(), 0);
    assert_eq!(autosave.keep(&work, start + INTERVAL), None);
    assert_eq!(files().len(), 1);
    // Another window while the first is open has nothing to offer.
    let other = Autosave::in_folder(&state).unwrap();
    assert_eq!(other.left_behind(), None);
    drop(other);
    drop(autosave);

    let mut autosave = Autosave::in_folder(&state).unwrap();
    assert_eq!(autosave.left_behind(), Some(files()[0].as_path()));
    let mut again = Workstation::default();
    again.open_unsaved(&autosave.take_over().unwrap(), Waker::default());
    wait(&mut again);
    assert_eq!(again.error.as_ref().map(ToString::to_string), None);
    assert_eq!((again.doc.as_ref().unwrap().edit.lens_on, &again.session_path), (lens_on, &None));
    assert!(again.has_unsaved_work());
    let before = files();
    autosave.keep(&again, start);
    assert_eq!(files().len(), 1, "kept by this window now");
    assert_ne!(files(), before);
    assert!(again.save(folder.path().join("saved.glioscope.json")));
    autosave.keep(&again, start);
    assert_eq!(files().len(), 0, "saved");
}

/// Work that can't be kept safe is said once, and tried again.
#[test]
fn a_failed_copy_of_unsaved_work_is_said_and_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(&folder.path().join("a"), "A", 5);
    let state = folder.path().join("state");
    let start = Instant::now();
    let mut autosave = Autosave::in_folder(&state).unwrap();
    let mut work = opened_case(CaseRef::Path(manifest));
    apply(&mut work, EditCommand::ToggleLens);
    autosave.keep(&work, start);
    // Nothing can be written over a folder.
    let file = state.join("unsaved-0.glioscope.json");
    std::fs::create_dir(&file).unwrap();
    let mut now = start;
    for round in 0..3 {
        now += INTERVAL;
        assert_eq!(autosave.keep(&work, now), Some(INTERVAL), "again later");
        let said = autosave.take_failure().map(|failure| failure.to_string());
        assert_eq!(said.is_some(), round == 0, "said once: {said:?}");
        assert!(said.is_none_or(|said| said.contains("unsaved-0")));
    }
    std::fs::remove_dir(&file).unwrap();
    assert_eq!(autosave.keep(&work, now + INTERVAL / 2), Some(INTERVAL / 2));
    assert_eq!(autosave.keep(&work, now + INTERVAL), None);
    assert!(file.is_file());
    drop(autosave);

    // The window says it: work that was left behind is copied as soon as it is opened.
    let autosave = Autosave::in_folder(&state).unwrap();
    let mut harness = user_window(Workstation::default(), [900.0, 600.0], Recent::default(), Some(autosave));
    harness.run_steps(2);
    let own = state.join("unsaved-1.glioscope.json");
    std::fs::create_dir(&own).unwrap();
    harness.get_by_label("Open that work").click();
    harness.step();
    glioscope_tests::wait_for_workers(&mut harness);
    let said = error_text(&harness);
    assert!(said.contains("not kept safe") && said.contains("unsaved-1"), "{said}");
    assert!(file.is_file(), "the only copy is left");
}

/// A pane that has nothing to draw is as final as its message: pictures of the window don't wait for it for ever.
#[test]
fn a_maximised_pane_without_a_scene_is_ready() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = patient(folder.path(), "A", 5);
    let mut harness = window_with(opened_case(CaseRef::Path(manifest)), [600.0, 500.0], Theme::Light);
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Change));
    assert!(harness.query_by_label_contains("Restore the change view").is_some());
    assert!(harness.state().panes.ready(PaneId::Change), "one date: nothing to compare");
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Change));
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Closeup));
    assert!(harness.state().panes.ready(PaneId::Closeup));
}

/// The codes of findings about sessions are exactly those documented in docs/checks.md.
#[test]
fn documented_session_codes_are_exactly_those_used() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut used = std::collections::BTreeSet::new();
    for folder in ["app/src/model", "app/src/world"] {
        for entry in std::fs::read_dir(root.join(folder)).unwrap() {
            let text = std::fs::read_to_string(entry.unwrap().path()).unwrap();
            let after = text.split("Check::warning(").skip(1);
            used.extend(after.filter_map(|rest| Some(rest.strip_prefix('"')?.split('"').next()?.to_owned())));
        }
    }
    let text = std::fs::read_to_string(root.join("docs/checks.md")).unwrap();
    let section = text.split("\n## ").find(|section| section.starts_with("Sessions")).unwrap();
    let listed =
        section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next().map(str::to_owned));
    assert!(used.len() > 5, "{used:?}");
    assert_eq!(used, listed.collect());
}
