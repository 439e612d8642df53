//! Session files: the current version, version 1 with every field set, version 1 from before later fields were added.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use glioscope::{
    command::{Command, EditCommand, LookCommand, Workstation},
    model::{CaseRef, EllipsoidKind, OverlapMode, PaneId, Ruler, Shape, layout, session},
    world::jobs::Waker,
};
use glioscope_core::optics::Projection;
use glioscope_render::{
    ChangeStyle, Coloring, Lens, LightingMode, Palette, Preset, SliceVariant,
    flat::{Convention, Overlay, Window as GreyWindow},
};
use glioscope_tests::{Dropped, doc, wait_for_workers, window_on, workstation};

fn expected(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("expected").join(name)
}

/// Saved by the program before version 2, with every field set to something other than its default.
#[test]
fn version_1_session_keeps_every_field() {
    let sample = workstation(CaseRef::Sample);
    let case = sample.world.case().unwrap();
    let read = session::load(&expected("session_v1_all.glioscope.json")).unwrap();
    assert_eq!(read.findings, [], "every key is known");
    let (document, checks) = read.restore(case).unwrap();
    // Number 3 of the masks T1, T2, PET: the first two. Images and masks are those of the sample.
    assert_eq!(checks, []);
    let edit = &document.edit;
    let shown = edit.selection.at(&case.time_points[1].regions);
    assert!(!shown.shows(3) && shown.shows(1));
    assert_eq!((edit.palette, edit.coloring), (Palette::ColorBlindSafe, Coloring::Agreement));
    assert_eq!((edit.overlay, edit.overlap_mode), (Overlay::Outline, OverlapMode::WholeMasks));
    assert_eq!(edit.windows["T1c"], GreyWindow { low: 10.0, high: 90.0 });
    assert!(edit.transfers["T1c"].gradient().is_some());
    assert_eq!((edit.clips.len(), edit.hidden_tracts.contains("CST")), (1, true));
    assert_eq!((edit.ellipsoids.kind, edit.ellipsoids.neighbors), (EllipsoidKind::Moment, 18));
    assert_eq!(edit.ellipsoid_opacities[0].opacity, 0.5);
    assert_eq!((edit.change.style, edit.change.of.as_deref()), (ChangeStyle::Arrows, Some("PET")));
    assert_eq!(edit.rulers.iter().map(|r| r.view).collect::<Vec<_>>(), [PaneId::Closeup, PaneId::Coronal]);
    assert_eq!((edit.light.mode, edit.light.preset), (LightingMode::Slices, Some(Preset::Balanced)));
    let own = edit.light.own.unwrap();
    assert_eq!((own.mode, own.variant), (LightingMode::Slices, SliceVariant::PaperExact));
    let mutual = own.mutual;
    assert!(mutual.image_on_image && mutual.image_on_opaque);
    assert!(!mutual.opaque_on_image && !mutual.opaque_on_opaque);
    assert_eq!(edit.maximized, Some(PaneId::Axial));
    assert!(
        layout::contains(&edit.layout, PaneId::Coronal)
            && layout::contains(&edit.layout, PaneId::Diagnostics)
    );
    assert!(!layout::contains(&edit.layout, PaneId::Sagittal));
    let nav = &document.nav;
    assert_eq!(
        [PaneId::Context, PaneId::Ellipsoids, PaneId::Change, PaneId::Closeup].map(|pane| nav.zoom(pane)),
        [1.5, 0.5, 3.0, 1.0]
    );
    assert_eq!((nav.convention, nav.camera.projection), (Convention::Neurological, Projection::Orthographic));
    assert_eq!((nav.time, nav.cursor_mm, nav.show_plane), (1, DVec3::new(7.0, 8.0, 9.0), true));
    assert_eq!(nav.pan_mm[1], DVec2::new(5.0, -6.0));
    assert_eq!(document.tracts, [PathBuf::from("/data/CST.tck")]);

    // Saving it again preserves everything and writes enum values in snake_case.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("again.glioscope.json");
    session::save(&path, &document, case, &[]).unwrap();
    assert_eq!(session::load(&path).unwrap().restore(case).unwrap(), (document, Vec::new()));
    let text = std::fs::read_to_string(&path).unwrap();
    for word in ["\"outline\"", "\"color_blind_safe\"", "\"whole_masks\"", "\"neurological\"", "\"axial\""] {
        assert!(text.contains(word), "{word}");
    }
    // In version 1 the lighting mode was called shading; now that has settings.
    let old = ["\"shading\": \"", "solid_on"];
    for word in ["Outline", "ColorBlindSafe", "WholeMasks", "Neurological", "Axial"].into_iter().chain(old) {
        assert!(!text.contains(word), "{word}");
    }
}

#[test]
fn version_1_session_opens_in_the_window() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.glioscope.json");
    // Its tract file exists only on another machine.
    let text = std::fs::read_to_string(expected("session_v1_all.glioscope.json")).unwrap();
    std::fs::write(&path, text.replace("\"/data/CST.tck\"", "")).unwrap();
    let mut harness = window_on(CaseRef::Sample, [900.0, 700.0], egui::Theme::Dark);
    harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(path)));
    harness.run_steps(1);
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).edit.maximized, Some(PaneId::Axial));
    assert!(harness.state().pane_rect(PaneId::Axial).is_some());
}

#[test]
fn session_without_later_fields_opens_with_defaults() {
    let path = expected("session_v1.glioscope.json");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(!text.contains("rulers") && !text.contains("coloring") && !text.contains("ruler_on"));
    let document = session::load(&path).unwrap().document;
    assert_eq!(document.edit.rulers, []);
    assert_eq!(document.edit.coloring, Coloring::Masks);
    assert_eq!(document.edit.lens, Lens { center_mm: DVec3::new(-30.0, 20.0, 25.0), radius_mm: 17.5 });
}

#[test]
fn errors_of_invalid_sessions_name_file_and_cause() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.glioscope.json");
    for (text, word) in [
        ("{\"glioscope_session\": 99}", "99"),
        ("{\"glioscope_session\": 1, \"document\": 3}", "doesn't fit"),
        ("{\"glioscope_session\": 2}", "document"),
        ("{}", "glioscope_session"),
        ("[", "broken JSON"),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = session::load(&path).unwrap_err().to_string();
        assert!(error.contains(word) && error.contains("x.glioscope.json"), "{error}");
    }
}

/// Loads what a workstation is opening.
pub(crate) fn wait(work: &mut Workstation) {
    while work.job.is_some() {
        work.poll(Waker::default());
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

/// A workstation with the session at `path` open.
pub(crate) fn opened(path: &Path) -> Workstation {
    let mut work = Workstation::default();
    work.open_session(path, &[], Waker::default());
    wait(&mut work);
    assert_eq!(work.error.as_ref().map(ToString::to_string), None);
    work
}

pub(crate) fn apply(work: &mut Workstation, command: impl Into<Command>) {
    work.apply(&command.into(), std::time::Instant::now());
}

/// Messages of the findings with this code.
pub(crate) fn findings(work: &Workstation, code: &str) -> Vec<String> {
    work.world.checks().iter().filter(|check| check.code == code).map(|check| check.message.clone()).collect()
}

/// The sample in a folder, and the text of its manifest.
fn sample_in(folder: &Path) -> (PathBuf, String) {
    glioscope_core::sample::write_sample(folder).unwrap();
    let manifest = folder.join("case.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    (manifest, text)
}

/// Bits of the region of exactly these masks at the date shown.
fn bits(work: &Workstation, ids: &[&str]) -> u32 {
    let time_point = work.world.time_point(work.doc.as_ref().unwrap()).unwrap();
    let all = time_point.regions.mask_ids();
    ids.iter().map(|id| 1 << all.iter().position(|known| known == id).unwrap()).sum()
}

/// Dates and masks are named in a session: a date added in front, and masks listed the other way round, change nothing.
#[test]
fn a_session_keeps_its_dates_and_masks_when_others_are_added_or_listed_in_another_order() {
    let folder = tempfile::tempdir().unwrap();
    let (manifest, text) = sample_in(folder.path());
    let path = folder.path().join("visit.glioscope.json");
    let mut work = workstation(CaseRef::Path(manifest.clone()));
    apply(&mut work, LookCommand::SetTime(1));
    let hidden = bits(&work, &["T1", "PET"]);
    apply(&mut work, EditCommand::ToggleRegion(hidden));
    let (from_mm, to_mm) = (DVec3::ZERO, DVec3::X);
    let ruler = |name: &str, time| Ruler {
        name: name.into(),
        from_mm,
        to_mm,
        shape: Shape::Line,
        view: PaneId::Axial,
        time,
    };
    for (name, time) in [("January", 0), ("April", 1)] {
        apply(&mut work, EditCommand::AddRuler(Box::new(ruler(name, time))));
    }
    let mut change = work.doc.as_ref().unwrap().edit.change.clone();
    change.dates = Some([0, 1]);
    apply(&mut work, EditCommand::SetChange(Box::new(change)));
    work.save(path.clone());

    // The masks the other way round, and the first date's files again as an earlier date.
    let blocks: Vec<&str> = text.split("[[mask]]").collect();
    let masks = || blocks[1..].iter().rev().map(|block| format!("[[mask]]{}\n", block.trim_end()));
    let earlier = masks()
        .filter(|block| block.contains("2024-01-15\""))
        .map(|block| block.replace("time = \"2024-01-15\"", "time = \"2023-12-01\""));
    let changed: String = std::iter::once(blocks[0].to_owned()).chain(masks()).chain(earlier).collect();
    std::fs::write(&manifest, changed).unwrap();
    let work = opened(&path);
    let (doc, case) = (work.doc.as_ref().unwrap(), work.world.case().unwrap());
    assert_eq!(case.time_labels(), ["2023-12-01", "2024-01-15", "2024-04-15"]);
    assert_eq!(case.time_points[2].regions.mask_ids(), ["PET", "T2", "T1"]);
    assert_eq!(doc.nav.time, 2);
    let times: Vec<_> = doc.edit.rulers.iter().map(|ruler| (ruler.name.as_str(), ruler.time)).collect();
    assert_eq!(times, [("January", 1), ("April", 2)]);
    assert_eq!(doc.edit.change.dates, Some([1, 2]));
    let hidden: Vec<u32> = work.world.selection(doc).hidden().collect();
    assert_eq!(hidden, [bits(&work, &["T1", "PET"])]);
    assert_eq!(findings(&work, "session-dropped"), [""; 0]);

    // Without April and without PET: what belongs to them is left out and said.
    let is_gone =
        |block: &str| block.contains("2024-04-15\"") || block.starts_with("mask") && block.contains("PET");
    let left: Vec<&str> = text.split("[[").filter(|block| !is_gone(block)).collect();
    std::fs::write(&manifest, left.join("[[")).unwrap();
    let work = opened(&path);
    let doc = work.doc.as_ref().unwrap();
    assert_eq!(doc.edit.rulers.iter().map(|ruler| ruler.name.as_str()).collect::<Vec<_>>(), ["January"]);
    assert_eq!((doc.nav.time, &doc.edit.change.dates), (0, &None));
    assert_eq!(work.world.selection(doc).hidden().count(), 0);
    let said = findings(&work, "session-dropped");
    for word in ["line April of \"2024-04-15\"", "hidden region PET+T1", "comparison"] {
        assert!(said[0].contains(word), "{said:?}");
    }
}

/// The opacity of one ellipsoid is that of the same component of the same mask when masks are listed in another order.
#[test]
fn the_opacity_of_an_ellipsoid_follows_its_mask() {
    use glioscope::model::EllipsoidOpacity;
    use glioscope_core::{Connectivity, Progress, ellipsoid};
    let folder = tempfile::tempdir().unwrap();
    let (manifest, text) = sample_in(folder.path());
    let path = folder.path().join("visit.glioscope.json");
    let all = |work: &Workstation| {
        let index = &work.world.case().unwrap().time_points[0].index;
        let options = ellipsoid::Options::default();
        ellipsoid::ellipsoids_of(index, Connectivity::default(), &options, &Progress::new()).unwrap()
    };
    let mut work = workstation(CaseRef::Path(manifest.clone()));
    let components = all(&work);
    // The largest of T2, which isn't the first component.
    let is_t2 = |of| of == ellipsoid::Of::Mask(1);
    let largest = components.iter().filter(|c| is_t2(c.of)).map(|c| c.voxels).max().unwrap();
    let id = components.iter().position(|c| is_t2(c.of) && c.voxels == largest).unwrap() as u32;
    let regions = work.world.case().unwrap().time_points[0].regions.clone();
    let own = EllipsoidOpacity::new(0, 26, (&regions, &components), id, 0.25).unwrap();
    apply(&mut work, EditCommand::SetEllipsoidOpacities(vec![own]));
    work.save(path.clone());
    let blocks: Vec<&str> = text.split("[[mask]]").collect();
    let masks = blocks[1..].iter().rev().map(|block| format!("[[mask]]{}\n", block.trim_end()));
    std::fs::write(&manifest, std::iter::once(blocks[0].to_owned()).chain(masks).collect::<String>())
        .unwrap();
    let work = opened(&path);
    let regions = work.world.case().unwrap().time_points[0].regions.clone();
    let components = all(&work);
    let found = work.doc.as_ref().unwrap().edit.ellipsoid_opacities[0].component(&regions, &components);
    let component = &components[found.unwrap() as usize];
    let t2 = regions.mask_ids().iter().position(|id| id == "T2").unwrap();
    assert_eq!((component.of, component.voxels), (ellipsoid::Of::Mask(t2), largest));
}

/// The order of dates and the case grid given with `--order` and `--case-grid` are part of the session.
#[test]
fn a_session_keeps_the_order_of_dates_it_was_opened_with() {
    use glioscope_core::case::{CaseGridChoice, LoadOptions};
    let folder = tempfile::tempdir().unwrap();
    let (manifest, text) = sample_in(folder.path());
    let named = text.replace("2024-01-15\"", "ses-b\"").replace("2024-04-15\"", "ses-a\"");
    std::fs::write(&manifest, &named).unwrap();
    let path = folder.path().join("visit.glioscope.json");
    let order = || vec!["ses-b".to_owned(), "ses-a".to_owned()];
    let case_grid = CaseGridChoice::Of("T2".into());
    let options = LoadOptions { order: order(), case_grid: case_grid.clone(), ..LoadOptions::default() };
    let mut work = Workstation { options, ..Workstation::default() };
    work.open(CaseRef::Path(manifest.clone()), Vec::new(), Waker::default());
    wait(&mut work);
    assert_eq!(work.world.case().unwrap().time_labels(), order());
    work.save(path.clone());
    let work = opened(&path);
    assert_eq!(work.world.case().unwrap().time_labels(), order());
    assert_eq!((&work.options.order, &work.options.case_grid), (&order(), &case_grid));

    // A date less: the order is dropped, and that is said.
    let blocks: Vec<&str> = named.split("[[").filter(|block| !block.contains("ses-a\"")).collect();
    std::fs::write(&manifest, blocks.join("[[")).unwrap();
    let work = opened(&path);
    assert_eq!(work.world.case().unwrap().time_labels(), ["ses-b"]);
    assert_eq!(findings(&work, "session-order").len(), 1);
}
