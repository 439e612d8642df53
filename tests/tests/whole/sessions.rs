//! Session files: the current version, version 1 with every field set, version 1 from before later fields were added.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use glioscope::model::{EllipsoidKind, OverlapMode, PaneId, layout, session};
use glioscope_core::optics::Projection;
use glioscope_render::{
    ChangeStyle, Coloring, Lens, LightingMode, Palette, Preset, SliceVariant,
    flat::{Convention, Overlay, Window as GreyWindow},
};
use glioscope_tests::{Dropped, doc, wait_for_workers, window_on};

fn expected(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("expected").join(name)
}

/// Saved by the program before version 2, with every field set to something other than its default.
#[test]
fn version_1_session_keeps_every_field() {
    let document = session::load(&expected("session_v1_all.glioscope.json")).unwrap();
    let edit = &document.edit;
    assert!(!edit.selection.shows(3) && edit.selection.shows(1));
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
    session::save(&path, &document).unwrap();
    assert_eq!(session::load(&path).unwrap(), document);
    let text = std::fs::read_to_string(&path).unwrap();
    for word in ["\"outline\"", "\"color_blind_safe\"", "\"whole_masks\"", "\"neurological\"", "\"axial\""] {
        assert!(text.contains(word), "{word}");
    }
    for word in ["Outline", "ColorBlindSafe", "WholeMasks", "Neurological", "Axial", "shading", "solid_on"] {
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
    let mut harness = window_on(glioscope::model::CaseRef::Sample, [900.0, 700.0], egui::Theme::Dark);
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
    let document = session::load(&path).unwrap();
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
