//! Comparison of two dates in the window: choosing them, the change view, the changed rim in slices.

use egui::{Theme, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use glam::{DVec2, DVec3};
use glioscope::{
    command::{EditCommand, LookCommand},
    model::{CaseRef, ChangeSetting, PaneId, document::tumor_radius_mm, layout},
    views::{
        change::{ChangePane, pair_colors},
        view3d::linked_camera,
    },
    window::GlioscopeApp,
};
use glioscope_core::optics::{Camera, Projection};
use glioscope_render::{ChangeStyle, LightSettings, LightingMode};
use glioscope_tests::{
    Window, count_color, crop, doc, maximized, pane_picture, perform, screens, window_on,
    window_on_small_device, window_with, workstation,
};

const SIZE: [f32; 2] = [1000.0, 800.0];

fn sample() -> Window {
    let mut harness = window_on(CaseRef::Sample, SIZE, Theme::Light);
    harness.run_ok();
    harness
}

fn set(harness: &mut Window, change: impl FnOnce(&mut ChangeSetting)) {
    let mut setting = doc(harness).edit.change.clone();
    change(&mut setting);
    perform(harness, EditCommand::SetChange(Box::new(setting)));
}

/// Maximises the change view and sets an orthographic camera from the front; returns its canvas and its own camera.
fn from_the_front(harness: &mut Window) -> (egui::Rect, Camera) {
    let rect = maximized(harness, PaneId::Change);
    let mut camera = doc(harness).nav.camera;
    camera.world_from_camera = Camera::orientation(0.0, 0.0);
    camera.projection = Projection::Orthographic;
    perform(harness, LookCommand::SetCamera(camera));
    let canvas = harness.get_by_label_contains("Change of ").rect();
    assert!(rect.contains_rect(canvas));
    let doc = doc(harness);
    let app = harness.state();
    let time_point = app.work.world.time_point(doc).unwrap();
    let radius_mm = tumor_radius_mm(time_point);
    let camera = linked_camera(&camera, doc.edit.lens.center_mm, radius_mm, doc.nav.zoom(PaneId::Change));
    (canvas, camera)
}

fn pos_of(rect: egui::Rect, camera: &Camera, world_mm: DVec3) -> egui::Pos2 {
    let size = DVec2::new(f64::from(rect.width()), f64::from(rect.height()));
    let at = camera.project(world_mm, size).unwrap();
    rect.min + vec2(at.x as f32, at.y as f32)
}

/// The sample's T1 grew 5 mm anteriorly (truth.json): its most anterior point moved from A 52 to A 57.
#[test]
fn hovering_reports_a_known_growth() {
    let mut harness = sample();
    let (rect, camera) = from_the_front(&mut harness);
    let most_anterior_mm = DVec3::new(-31.5, 57.0, 20.0);
    harness.hover_at(pos_of(rect, &camera, most_anterior_mm));
    harness.run_ok();
    let pick = *harness.state().panes.get::<ChangePane>(PaneId::Change).unwrap().canvas.hover().unwrap();
    let vector = pick.vector.expect("a change vector at the most anterior point");
    let half_voxel_mm = 0.5;
    assert!((pick.world_mm.y - 57.0).abs() <= 2.0 * half_voxel_mm, "{}", pick.world_mm);
    assert!(
        (vector.signed_mm - 5.0).abs() <= 1.5,
        "5 mm anteriorly, measured through skeleton points: {} mm",
        vector.signed_mm
    );
    assert!(
        (vector.nearest_mm - 5.0).abs() <= 1.0,
        "the nearest surface is 5 mm away: {}",
        vector.nearest_mm
    );
    let label = format!("grew {:.1} mm", vector.signed_mm);
    assert!(harness.query_by_label_contains(&label).is_some(), "{label}");
    // The reported vector is the stored one, not the smoothed one.
    let comparison = harness.state().results.comparison.last().unwrap().clone();
    assert!(comparison.change.vectors.contains(&vector));
}

#[test]
fn the_arrow_threshold_removes_arrows_and_is_undone() {
    let mut harness = sample();
    from_the_front(&mut harness);
    let rect = harness.get_by_label_contains("Change of ").rect();
    set(&mut harness, |s| s.style = ChangeStyle::Arrows);
    let picture = |harness: &mut Window| crop(&harness.render().unwrap(), rect);
    let all = picture(&mut harness);
    // The pause makes the next edit an undo step of its own.
    std::thread::sleep(std::time::Duration::from_millis(900));
    set(&mut harness, |s| s.threshold_mm = 4.0);
    let above_threshold = picture(&mut harness);
    // Arrows are darker than the surface they stand on.
    let red = |p: &image::RgbaImage| {
        p.pixels().filter(|p| i32::from(p.0[0]) > i32::from(p.0[1]) + 80 && p.0[1] < 120).count()
    };
    assert!(red(&above_threshold) < red(&all), "{} of {} pixels", red(&above_threshold), red(&all));
    assert!(red(&above_threshold) > 0, "arrows of 4 mm and more are left");
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(picture(&mut harness), all);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(doc(&harness).edit.change.style, ChangeStyle::Height);
}

/// Two dates of a ball without an image: the check is asked for with a button, its result is in the view, and goes when asked or when
/// something else is compared.
#[test]
fn the_change_is_checked_on_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let ball = |name: &str, radius: f64| {
        let path = folder.path().join(name);
        glioscope_tests::write_cube(&path, 26, 1.0, |v| {
            u8::from(DVec3::from_array(v.map(|i| i as f64 - 12.6)).length() < radius)
        });
        path.display().to_string()
    };
    let masks = [("a.nii", 7.0, "2024-01-01"), ("b.nii", 8.0, "2024-02-01")];
    let masks = masks.map(|(name, radius, date)| format!("M={}@{date}", ball(name, radius)));
    let case = CaseRef::Arguments { masks: masks.into(), contexts: Vec::new() };
    for theme in [Theme::Light, Theme::Dark] {
        let mut harness = window_on(case.clone(), SIZE, theme);
        harness.run_ok();
        maximized(&mut harness, PaneId::Change);
        let before = pane_picture(&mut harness, PaneId::Change);
        assert!(harness.query_by_label_contains("false calls").is_none());
        harness.get_by_label("Check on this case").click();
        harness.run_ok();
        assert!(doc(&harness).edit.change.self_check);
        assert!(harness.query_by_label_contains("false calls 0 of 100").is_some());
        assert!(harness.query_by_label_contains("known +2 mm").is_some());
        let after = pane_picture(&mut harness, PaneId::Change);
        if let Some(folder) = std::env::var_os("GLIOSCOPE_TEST_PICTURES") {
            after.save(std::path::Path::new(&folder).join(format!("self-check-{theme:?}.png"))).unwrap();
        }
        let changed = before.pixels().zip(after.pixels()).filter(|(a, b)| a != b).count();
        assert!(changed > 3000, "lines of text: {changed} pixels");
        // What is compared otherwise isn't checked any more.
        set(&mut harness, |s| s.smooth_mm = 2.0);
        assert!(doc(&harness).edit.change.self_check);
        set(&mut harness, |s| s.registration_mm = 0.2);
        assert!(!doc(&harness).edit.change.self_check);
        assert!(harness.query_by_label_contains("false calls").is_none());
        harness.get_by_label("Check on this case").click();
        harness.run_ok();
        harness.get_by_label("Hide the check").click();
        harness.run_ok();
        assert!(!doc(&harness).edit.change.self_check);
        assert!(harness.query_by_label_contains("false calls").is_none());
    }
}

/// Three dates made of the sample's two: the pair is chosen on the chart and with the buttons.
#[test]
fn two_of_three_dates_are_chosen_on_the_chart() {
    let folder = tempfile::tempdir().unwrap();
    glioscope_core::sample::write_sample(folder.path()).unwrap();
    let manifest = folder.path().join("case.toml");
    let mut text = std::fs::read_to_string(&manifest).unwrap();
    text.push_str("\n[[mask]]\nid = \"T1\"\nfile = \"t1-mask-2024-01-15.nii.gz\"\ntime = \"2024-09-01\"\n");
    std::fs::write(&manifest, text).unwrap();
    let mut harness = window_on(CaseRef::Path(manifest), SIZE, Theme::Light);
    harness.run_ok();
    maximized(&mut harness, PaneId::Dates);
    let pair = |harness: &Harness<'_, GlioscopeApp>| {
        let case = harness.state().work.world.case().unwrap().clone();
        doc(harness).edit.change.chosen(&case).unwrap().dates
    };
    assert_eq!(pair(&harness), [0, 2], "the first and the last date by default");
    let chart = harness.get_by_label_contains("Volumes over time").rect();
    // The time axis begins right of the value axis's labels.
    let at = chart.left_top() + vec2(chart.width() * 0.44, chart.height() * 0.5);
    harness.hover_at(at);
    harness.drag_at(at);
    harness.drop_at(at);
    harness.run_ok();
    assert_eq!(pair(&harness), [0, 1], "a click in the middle compares with the second date");
    harness.get_by_label("Compare to 2024-09-01").click();
    harness.run_ok();
    harness.get_by_label("Compare from 2024-04-15").click();
    harness.run_ok();
    assert_eq!(pair(&harness), [1, 2]);
    let comparison = harness.state().results.comparison.last().unwrap().clone();
    assert_eq!(comparison.labels, ["2024-04-15", "2024-09-01"]);
    for before in [Some([0, 2]), Some([0, 1]), None] {
        perform(&mut harness, EditCommand::Undo);
        assert_eq!(doc(&harness).edit.change.dates, before, "each click is an undo step of its own");
    }
}

/// No comparison is computed while the change view is hidden, nor for a case with one date.
#[test]
fn hidden_change_views_compute_no_comparison() {
    let mut harness = sample();
    let nothing = |harness: &mut Window| {
        screens(harness, PaneId::Change).plan().is_none()
            && harness.state().results.comparison.last().is_none()
    };
    assert!(nothing(&mut harness), "the change view is a hidden tab behind the closeup");
    // As a user opens a case with dates: change is in front.
    let held = layout::Held { dates: 2, images: 1, has_pet: false, masks: 3 };
    perform(&mut harness, EditCommand::SetLayout(Box::new(layout::default_layout(held))));
    assert!(!nothing(&mut harness), "the change view is drawn");
    for pane in [PaneId::Change, PaneId::Closeup, PaneId::Context, PaneId::Overlap, PaneId::Axial] {
        let rect = harness.state().pane_rect(pane).unwrap();
        assert!(rect.width() > 200.0 && rect.height() > 150.0, "{pane:?} {rect:?}");
    }

    let folder = tempfile::tempdir().unwrap();
    glioscope_core::sample::write_sample(folder.path()).unwrap();
    let file = folder.path().join("t1-mask-2024-01-15.nii.gz");
    let case = CaseRef::Arguments { masks: vec![format!("T1={}", file.display())], contexts: vec![] };
    let mut harness = window_with(workstation(case), SIZE, Theme::Dark);
    harness.run_ok();
    maximized(&mut harness, PaneId::Change);
    assert!(nothing(&mut harness));
}

#[test]
fn slices_show_the_changed_rim() {
    let mut harness = sample();
    let rect = maximized(&mut harness, PaneId::Axial);
    let before = crop(&harness.render().unwrap(), rect);
    set(&mut harness, |s| s.on_slices = true);
    let rim = crop(&harness.render().unwrap(), rect);
    assert_ne!(rim, before);
    let colors = pair_colors(doc(&harness).edit.palette);
    for (k, what) in [(0, "the earlier date's outline"), (1, "the later date's outline")] {
        let [r, g, b] = colors.mask(k);
        let near =
            |p: &&image::Rgba<u8>| p.0[0].abs_diff(r) < 6 && p.0[1].abs_diff(g) < 6 && p.0[2].abs_diff(b) < 6;
        assert!(rim.pixels().filter(near).count() > 100, "{what}");
    }
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(crop(&harness.render().unwrap(), rect), before);
}

/// The diagnostics list deviations from the requested lighting, whichever 3D view drew them.
#[test]
fn lighting_notes_are_listed_in_the_diagnostics() {
    let mut harness = sample();
    // The change view is a hidden tab behind the closeup.
    for pane in [PaneId::Closeup, PaneId::Context, PaneId::Diagnostics] {
        perform(&mut harness, EditCommand::TogglePane(pane));
    }
    let own =
        LightSettings { mode: LightingMode::Slices, slice_grid: 1, slice_mm: 4.0, ..LightSettings::DEFAULT };
    let light = &mut harness.state_mut().work.doc.as_mut().unwrap().edit.light;
    (light.mode, light.own) = (LightingMode::Slices, Some(own));
    harness.run_ok();
    let notes = screens(&mut harness, PaneId::Change).notes().to_vec();
    assert!(notes.iter().any(|note| note.contains("without a penumbra")), "{notes:?}");
    for note in notes {
        assert!(harness.query_by_label_contains(&format!("Note: {note}")).is_some(), "{note}");
    }
}

/// An image too large for the GPU's buffers is drawn at a coarser resolution, with a warning in the picture.
#[test]
fn reduced_image_resolution_is_shown_as_a_warning() {
    for pane in [PaneId::Context, PaneId::Change] {
        let mut harness = window_on_small_device(CaseRef::Sample, [300.0, 300.0], 2_000_000);
        maximized(&mut harness, pane);
        let warning = screens(&mut harness, pane).warnings()[0].clone();
        assert!(warning.contains("1/4"), "{warning}");
        assert!(harness.query_by_label_contains(&format!("Warning: {warning}")).is_some(), "{pane:?}");
        let picture = pane_picture(&mut harness, pane);
        assert!(count_color(&picture, [176, 78, 0], 40) > 100, "{pane:?}: the warning is in the picture");
    }
}
