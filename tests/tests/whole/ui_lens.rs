//! The lens, the ruler, the volumes in the lens and the agreement of masks, by simulated mouse and keyboard.

use std::collections::BTreeMap;

use egui::{Event, Modifiers, Pos2, Rect, Vec2, pos2, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use glam::DVec3;
use glioscope::{
    command::{AppCommand, Command, EditCommand, LookCommand},
    format,
    model::{HiddenRegions, PaneId, Shape, Tool, session},
    views::view3d::linked_camera,
};
use glioscope_core::{
    Selection,
    optics::{AnatomicalView, Camera, Projection},
};
use glioscope_render::{Coloring, agreement_color, flat::Overlay};
use glioscope_tests::{
    Window, count_color, count_shades, crop, doc, error_text, maximized, pane_picture, perform, sample,
    wait_for_workers,
};
use strum::VariantArray;

fn undo(harness: &mut Window) {
    harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::Z);
    harness.run_ok();
}

fn rect(harness: &Window, pane: PaneId) -> Rect {
    harness.state().pane_rect(pane).unwrap()
}

/// Presses, moves in ten steps and releases, with `modifiers` held.
fn drag(harness: &mut Window, from: Pos2, to: Pos2, modifiers: Modifiers) {
    harness.hover_at(from);
    harness.run_ok();
    harness.event(Event::ModifiersChanged(modifiers));
    harness.drag_at(from);
    harness.run_steps(1);
    for step in 1..=10_u8 {
        harness.hover_at(from + (to - from) * (f32::from(step) / 10.0));
        harness.run_steps(1);
    }
    harness.drop_at(to);
    harness.event(Event::ModifiersChanged(Modifiers::NONE));
    harness.run_ok();
}

/// Radius in millimetres of the sphere around the camera's focus whose outline is `points` from the centre of the view;
/// closed form.
fn radius_mm(harness: &Window, points: f32) -> f64 {
    let camera = doc(harness).nav.camera;
    let off_mm = f64::from(points) * camera.height_mm / f64::from(rect(harness, PaneId::Closeup).height());
    match camera.projection {
        Projection::Orthographic => off_mm,
        Projection::Perspective => {
            // The view plane passes through the focus; its height subtends 30°.
            let distance_mm = camera.height_mm / 2.0 / 15_f64.to_radians().tan();
            distance_mm * (off_mm / distance_mm).atan().sin()
        }
    }
}

/// Radius of the lens's ring in points, by bisection.
fn ring_points(harness: &Window) -> f32 {
    let (mut inside, mut outside) = (0.0_f32, 2000.0_f32);
    for _ in 0..50 {
        let middle = (inside + outside) / 2.0;
        if radius_mm(harness, middle) < doc(harness).edit.lens.radius_mm {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    inside
}

#[test]
fn dragging_the_ring_sets_the_expected_radius_and_one_undo_restores_it() {
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let mut harness = sample();
        if projection == Projection::Orthographic {
            perform(&mut harness, LookCommand::ToggleProjection);
        }
        assert_eq!(doc(&harness).nav.camera.projection, projection);
        let (before, camera) = (doc(&harness).edit.lens, doc(&harness).nav.camera);
        let middle = rect(&harness, PaneId::Closeup).center();
        let ring = ring_points(&harness);
        let towards = Vec2::angled(0.6);
        harness.hover_at(middle + towards * (ring + 4.0));
        harness.run_ok();
        let icon = harness.output().platform_output.cursor_icon;
        assert_eq!(icon, egui::CursorIcon::ResizeNwSe, "{projection:?}");
        let to = ring * 0.6;
        drag(&mut harness, middle + towards * (ring + 4.0), middle + towards * to, Modifiers::NONE);
        let after = doc(&harness).edit.lens;
        let expected = radius_mm(&harness, to);
        assert!((after.radius_mm - expected).abs() < 0.01, "{} {expected}", after.radius_mm);
        assert!(after.radius_mm < 0.7 * before.radius_mm);
        assert_eq!(after.center_mm, before.center_mm);
        assert_eq!(doc(&harness).nav.camera, camera, "dragging the ring keeps the camera");
        undo(&mut harness);
        assert_eq!(doc(&harness).edit.lens, before, "one drag is one undo");
    }
}

#[test]
fn dragging_beside_the_ring_rotates_the_camera() {
    let mut harness = sample();
    let before = (doc(&harness).edit.lens, doc(&harness).nav.camera);
    let middle = rect(&harness, PaneId::Closeup).center();
    let from = middle + vec2(0.0, ring_points(&harness) - 12.0);
    drag(&mut harness, from, from + vec2(40.0, 0.0), Modifiers::NONE);
    assert_eq!(doc(&harness).edit.lens, before.0);
    assert_ne!(doc(&harness).nav.camera.world_from_camera, before.1.world_from_camera);
}

#[test]
fn ctrl_drag_moves_the_lens_onto_the_surface_and_the_camera_follows() {
    let mut harness = sample();
    let (before, camera) = (doc(&harness).edit.lens, doc(&harness).nav.camera);
    let closeup = rect(&harness, PaneId::Closeup);
    let to = closeup.center() + vec2(40.0, -30.0);
    drag(&mut harness, closeup.center() + vec2(-20.0, 10.0), to, Modifiers::COMMAND);
    let lens = doc(&harness).edit.lens;
    assert_eq!(lens.radius_mm, before.radius_mm);
    assert_ne!(lens.center_mm, before.center_mm);
    // Under the pointer, in the frame at the time of the drag.
    let size = glam::DVec2::new(f64::from(closeup.width()), f64::from(closeup.height()));
    let projected = camera.project(lens.center_mm, size).unwrap();
    let pointer = glam::DVec2::new(f64::from(to.x - closeup.left()), f64::from(to.y - closeup.top()));
    assert!(projected.distance(pointer) < 1.0, "{projected} {pointer}");
    // On the surface: along the line of sight, background in front of it and tissue behind it.
    let inwards = (lens.center_mm - camera.eye_mm()).try_normalize().unwrap() * 0.1;
    let app = harness.state();
    let index = &app.work.world.time_point(doc(&harness)).unwrap().index;
    assert_eq!(index.at_mm(lens.center_mm - inwards), 0);
    assert_ne!(index.at_mm(lens.center_mm + inwards), 0);
    assert_eq!(doc(&harness).nav.camera.focus_mm, lens.center_mm, "the camera rotates about the lens");
    assert_eq!(doc(&harness).nav.camera.world_from_camera, camera.world_from_camera);
    undo(&mut harness);
    assert_eq!(doc(&harness).edit.lens, before);
    assert_eq!(doc(&harness).nav.camera, camera);
}

#[test]
fn ctrl_drag_over_the_background_moves_the_lens_in_the_view_plane() {
    let mut harness = sample();
    let (before, camera) = (doc(&harness).edit.lens, doc(&harness).nav.camera);
    let closeup = rect(&harness, PaneId::Closeup);
    let corner = closeup.right_top() + vec2(-15.0, 15.0);
    // The corner shows background only.
    drag(&mut harness, corner + vec2(0.0, 12.0), corner, Modifiers::COMMAND);
    let moved_mm = doc(&harness).edit.lens.center_mm - before.center_mm;
    let [right, up, back] = camera.axes();
    assert!(moved_mm.dot(back).abs() < 1e-6, "in the plane: {moved_mm}");
    let mm_per_point = camera.height_mm / f64::from(closeup.height());
    let from_middle = corner - closeup.center();
    assert!((moved_mm.dot(right) / mm_per_point - f64::from(from_middle.x)).abs() < 0.1);
    assert!((moved_mm.dot(up) / mm_per_point + f64::from(from_middle.y)).abs() < 0.1);
}

#[test]
fn fitting_the_lens_and_the_six_anatomical_views_set_the_camera() {
    let mut harness = sample();
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Fit the lens").click();
    harness.run_ok();
    let (lens, camera) = (doc(&harness).edit.lens, doc(&harness).nav.camera);
    assert_eq!(camera.focus_mm, lens.center_mm);
    assert!((camera.height_mm / lens.radius_mm - 2.3).abs() < 1e-9);
    for &view in AnatomicalView::VARIANTS {
        perform(&mut harness, LookCommand::LookFrom(view));
        let back = doc(&harness).nav.camera.axes()[2];
        let side = match view {
            AnatomicalView::Anterior => DVec3::Y,
            AnatomicalView::Posterior => DVec3::NEG_Y,
            AnatomicalView::Left => DVec3::NEG_X,
            AnatomicalView::Right => DVec3::X,
            AnatomicalView::Superior => DVec3::Z,
            AnatomicalView::Inferior => DVec3::NEG_Z,
        };
        assert!(back.distance(side) < 1e-12, "{view:?}");
        // A linked camera shares the orientation but has its own focus and height.
        let linked = linked_camera(&doc(&harness).nav.camera, DVec3::new(1.0, 2.0, 3.0), 50.0, 1.0);
        assert_eq!(linked.world_from_camera, doc(&harness).nav.camera.world_from_camera);
        assert_eq!(linked.focus_mm, DVec3::new(1.0, 2.0, 3.0));
        assert!((linked.height_mm - 115.0).abs() < 1e-9);
    }
    perform(&mut harness, EditCommand::FitTumor);
    assert!(doc(&harness).nav.camera.height_mm > camera.height_mm);
}

/// Centres and semi-axes, mm, of the ellipsoids whose union is the T1 mask, from truth.json.
fn t1_truth() -> Vec<(DVec3, DVec3)> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../data-samples/truth.json");
    let truth: serde_json::Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let masks = truth["time_points"][0]["masks"].as_array().unwrap();
    let t1 = masks.iter().find(|m| m["id"] == "T1").unwrap();
    let numbers = |part: &serde_json::Value, key: &str| -> DVec3 {
        let n: Vec<f64> = part[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        DVec3::from_slice(&n)
    };
    let parts = t1["parts"].as_array().unwrap();
    parts.iter().map(|part| (numbers(part, "center_mm"), numbers(part, "semi_axes_mm"))).collect()
}

/// The window showing only T1, orthographic from the front, without the lens, with the ruler on.
fn t1_from_the_front() -> Window {
    let mut harness = sample();
    let app = harness.state_mut();
    let doc = app.work.doc.as_mut().unwrap();
    let time_point = app.work.world.time_point(doc).unwrap();
    let regions = &time_point.regions;
    let t1 = regions.mask_ids().iter().position(|id| id == "T1").unwrap();
    assert_eq!(time_point.masks[t1].native_voxels, regions.mask_voxels(t1), "T1 is on the case grid");
    let shown: Vec<u32> = regions.list().iter().map(|r| r.bits).filter(|b| b >> t1 & 1 == 1).collect();
    doc.edit.selection = HiddenRegions::of(regions, &Selection::only(regions, &shown));
    doc.edit.lens_on = false;
    doc.nav.camera.projection = Projection::Orthographic;
    perform(&mut harness, LookCommand::LookFrom(AnatomicalView::Anterior));
    harness.key_press(egui::Key::M);
    harness.run_ok();
    assert!(self::doc(&harness).nav.ruler_on);
    harness
}

fn pos_of(harness: &Window, world_mm: DVec3) -> Pos2 {
    let closeup = rect(harness, PaneId::Closeup);
    let size = glam::DVec2::new(f64::from(closeup.width()), f64::from(closeup.height()));
    let point = doc(harness).nav.camera.project(world_mm, size).unwrap();
    closeup.min + vec2(point.x as f32, point.y as f32)
}

#[test]
fn known_surface_distances_are_measured_within_half_a_voxel() {
    let mut harness = t1_from_the_front();
    let parts = t1_truth();
    let grid = doc_grid(&harness).clone();
    let half_voxel_mm = grid.spacing_mm().min_element() / 2.0;
    // Frontmost point of the union at an offset (x, z) in mm from the first ellipsoid's centre; closed form.
    let front = |x: f64, z: f64| {
        let point = DVec3::new(parts[0].0.x + x, 0.0, parts[0].0.z + z);
        let y = parts.iter().filter_map(|(center, half)| {
            let off = (point - center) / half;
            let squared = 1.0 - off.x * off.x - off.z * off.z;
            (squared >= 0.0).then(|| center.y + half.y * squared.sqrt())
        });
        point.with_y(y.fold(f64::NEG_INFINITY, f64::max))
    };
    let lines = [
        [front(0.2, 0.3), front(9.2, 3.1)],
        [front(-8.2, -2.1), front(8.2, -2.1)],
        [front(-1.2, -9.3), front(-0.7, 0.2)],
        [front(-6.1, -6.1), front(5.3, 4.2)],
    ];
    for (n, [from, to]) in lines.into_iter().enumerate() {
        let (a, b) = (pos_of(&harness, from), pos_of(&harness, to));
        drag(&mut harness, a, b, Modifiers::NONE);
        let rulers = &doc(&harness).edit.rulers;
        assert_eq!(rulers.len(), n + 1);
        let (found, true_mm) = (rulers[n].length_mm(), from.distance(to));
        assert!((found - true_mm).abs() <= half_voxel_mm, "{n}: {found} {true_mm} ± {half_voxel_mm}");
        assert_eq!(rulers[n].view, PaneId::Closeup);
    }
    // A drag between tumour and background adds no ruler; none of the drags rotates the camera.
    let corner = rect(&harness, PaneId::Closeup).right_top() + vec2(-12.0, 12.0);
    let from = pos_of(&harness, front(0.0, 0.0));
    drag(&mut harness, from, corner, Modifiers::NONE);
    drag(&mut harness, corner, from, Modifiers::NONE);
    assert_eq!(doc(&harness).edit.rulers.len(), lines.len());
    let (azimuth, elevation) = AnatomicalView::Anterior.azimuth_elevation_deg();
    let anterior = Camera::orientation(azimuth, elevation);
    assert_eq!(doc(&harness).nav.camera.world_from_camera, anterior);
    for remaining in (0..lines.len()).rev() {
        undo(&mut harness);
        assert_eq!(doc(&harness).edit.rulers.len(), remaining);
    }
}

#[test]
fn diameters_angles_and_circles_are_drawn_and_their_ends_dragged() {
    let mut harness = sample();
    perform(&mut harness, LookCommand::SetSliceZoom(Some(0.5)));
    perform(&mut harness, LookCommand::SetTool(Tool::Diameters));
    let axial = rect(&harness, PaneId::Axial);
    let from = axial.center() - vec2(30.0, 40.0);
    drag(&mut harness, from, from + vec2(60.0, 80.0), Modifiers::NONE);
    let ruler = |harness: &Window, n: usize| doc(harness).edit.rulers[n].clone();
    let first = ruler(&harness, 0);
    assert!((first.length_mm() - 50.0).abs() < 1e-3 && (first.across_mm().unwrap() - 25.0).abs() < 1e-3);
    // Where a place is on the screen, from the two ends drawn.
    let pos_of = |mm: DVec3| {
        let share = (mm - first.from_mm) / (first.to_mm - first.from_mm);
        from + vec2(60.0 * share.x as f32, 80.0 * share.y as f32)
    };
    // The end of the diameter across, twice as far out: along it, so that nothing else moves.
    let Shape::Diameters { across_mm: [near, far] } = first.shape else { panic!("{first:?}") };
    let out = far + (far - near) * 0.5;
    drag(&mut harness, pos_of(far), pos_of(out), Modifiers::NONE);
    let wider = ruler(&harness, 0);
    assert_eq!(doc(&harness).edit.rulers.len(), 1, "no new line");
    assert!((wider.across_mm().unwrap() - 37.5).abs() < 0.3, "{:?}", wider.across_mm());
    assert_eq!((wider.from_mm, wider.to_mm), (first.from_mm, first.to_mm));
    undo(&mut harness);
    assert_eq!(ruler(&harness, 0), first, "one step");
    // A line that ends at a handle is a line of its own.
    perform(&mut harness, LookCommand::SetTool(Tool::Circle));
    drag(&mut harness, axial.center() - vec2(70.0, 0.0), pos_of(first.from_mm), Modifiers::NONE);
    assert_eq!(ruler(&harness, 1).shape.tool(), Tool::Circle);
    perform(&mut harness, LookCommand::SetTool(Tool::Angle));
    drag(&mut harness, axial.center() + vec2(0.0, 70.0), axial.center() + vec2(40.0, 70.0), Modifiers::NONE);
    assert!((ruler(&harness, 2).angle_degrees().unwrap() - 90.0).abs() < 1e-6);
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        pane_picture(&mut harness, PaneId::Axial)
            .save(std::path::Path::new(&folder).join("shapes.png"))
            .unwrap();
    }
    // Saved, and again at another date.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("read.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.rulers, doc(&harness).edit.rulers);
    perform(&mut harness, LookCommand::SetTime(1));
    perform(&mut harness, EditCommand::MeasureAgain);
    let again = ruler(&harness, 3);
    assert_eq!(
        (again.time, again.to_mm, again.shape),
        (1, ruler(&harness, 2).to_mm, ruler(&harness, 2).shape)
    );
    // The circle's values, of the date it is on.
    perform(&mut harness, LookCommand::SetTime(0));
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Measurements));
    wait_for_workers(&mut harness);
    assert_eq!(harness.query_all_by_label_contains("voxels of T1c: mean").count(), 2, "and the lens'");
    assert!(harness.query_all_by_label("90.0°").count() == 2, "at both dates");
    let name = ruler(&harness, 1).name;
    assert!(harness.query_by_label(&format!("Histogram of {name}")).is_some());
    // Exported: a row of the table for each image of its date, and the same in JSON.
    let (csv, json) = (folder.path().join("lines.csv"), folder.path().join("lines.json"));
    perform(&mut harness, AppCommand::ExportRulersTo(csv.clone()));
    perform(&mut harness, AppCommand::ExportRulersTo(json.clone()));
    let lines: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    let values = lines["lines"][1]["values"].as_array().unwrap();
    let images: Vec<&str> = values.iter().map(|of| of["image"].as_str().unwrap()).collect();
    assert_eq!(images, ["T1c", "FLAIR", "PET"]);
    assert_eq!(lines["lines"][2]["values"], serde_json::json!([]));
    let text = std::fs::read_to_string(csv).unwrap();
    let rows: Vec<&str> = text.lines().filter(|row| row.starts_with(&format!("{name},"))).collect();
    assert_eq!(rows.len(), 3);
    for (of, row) in values.iter().zip(rows) {
        let counts = of["histogram"]["counts"].as_array().unwrap();
        assert_eq!(counts.iter().map(|n| n.as_u64().unwrap()).sum::<u64>(), of["voxels"].as_u64().unwrap());
        let counts: Vec<String> = counts.iter().map(ToString::to_string).collect();
        assert!(
            row.contains(&format!(",{},", of["mean"])) && row.ends_with(&format!(",{}", counts.join(" ")))
        );
    }
    assert!(harness.query_by_label("Histogram of Lens").is_some());
}

#[test]
fn a_slice_ruler_is_listed_renamed_exported_deleted_and_restored() {
    let mut harness = sample();
    perform(&mut harness, LookCommand::SetSliceZoom(Some(0.5)));
    perform(&mut harness, LookCommand::ToggleRuler);
    let axial = rect(&harness, PaneId::Axial);
    let z = doc(&harness).nav.cursor_mm.z;
    let from = axial.center() - vec2(30.0, 20.0);
    drag(&mut harness, from, from + vec2(60.0, 80.0), Modifiers::NONE);
    let ruler = doc(&harness).edit.rulers[0].clone();
    // 30 mm and 40 mm at right angles.
    assert!((ruler.length_mm() - 50.0).abs() < 1e-3, "{}", ruler.length_mm());
    assert_eq!((ruler.from_mm.z, ruler.to_mm.z, ruler.view), (z, z, PaneId::Axial));

    perform(&mut harness, EditCommand::MaximizePane(PaneId::Measurements));
    assert!(harness.query_by_label_contains("50.0 mm").is_some());
    let field = harness.get_by_label("Name of line 1");
    assert_eq!(field.value().as_deref(), Some("Line 1"));
    field.focus();
    harness.run_ok();
    harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::A);
    harness.get_by_label("Name of line 1").type_text("cuff, \"left\"");
    harness.run_ok();
    assert_eq!(doc(&harness).edit.rulers[0].name, "cuff, \"left\"");

    let folder = tempfile::tempdir().unwrap();
    let (csv, json) = (folder.path().join("lines.csv"), folder.path().join("lines.json"));
    perform(&mut harness, AppCommand::ExportRulersTo(csv.clone()));
    perform(&mut harness, AppCommand::ExportRulersTo(json.clone()));
    assert_eq!(error_text(&harness), "");
    let text = std::fs::read_to_string(csv).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 2);
    assert!(lines[0].starts_with("name,time,view,length_mm,from_r_mm,from_a_mm,from_s_mm,to_r_mm"));
    let numbers = lines[1].strip_prefix("\"cuff, \"\"left\"\"\",2024-01-15,axial,").unwrap();
    let numbers = numbers.strip_suffix(",line,,,,,,,,,,,,,,,").unwrap();
    let numbers: Vec<f64> = numbers.split(',').map(|n| n.parse().unwrap()).collect();
    assert_eq!(numbers.len(), 7);
    assert_eq!(numbers[0], ruler.length_mm());
    assert_eq!(DVec3::from_slice(&numbers[1..]), ruler.from_mm);
    let exported: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(exported["lines"][0]["length_mm"].as_f64(), Some(ruler.length_mm()));
    assert_eq!(exported["lines"][0]["name"], "cuff, \"left\"");
    assert_eq!(exported["sides"], "known");
    perform(&mut harness, AppCommand::ExportRulersTo(folder.path().join("lines.txt")));
    assert!(error_text(&harness).contains("expected .csv or .json"));

    harness.get_by_label("Delete cuff, \"left\"").click();
    harness.run_ok();
    assert_eq!(doc(&harness).edit.rulers, []);
    undo(&mut harness);
    assert_eq!(doc(&harness).edit.rulers[0].name, "cuff, \"left\"");
    perform(&mut harness, LookCommand::SetCursor(DVec3::ZERO));
    harness.get_by_label("Show cuff, \"left\"").click();
    harness.run_ok();
    assert_eq!(doc(&harness).nav.cursor_mm, ruler.middle_mm());
    assert_eq!(doc(&harness).nav.camera.focus_mm, ruler.middle_mm());
    assert!(doc(&harness).nav.pan_mm[0] != glam::DVec2::ZERO, "the zoomed slice pans to it");
}

#[test]
fn hovering_a_slice_moves_the_shared_crosshair_within_its_plane() {
    let mut harness = sample();
    let before = doc(&harness).nav.cursor_mm;
    let coronal = rect(&harness, PaneId::Coronal);
    harness.hover_at(coronal.center() + vec2(17.0, 11.0));
    harness.run_ok();
    let after = doc(&harness).nav.crosshair_mm();
    assert_eq!(after.y, before.y);
    assert!(after.x != before.x && after.z != before.z, "{before} {after}");
    assert_eq!(doc(&harness).nav.cursor_mm, before);
    perform(&mut harness, LookCommand::ToggleFollowPointer);
    harness.hover_at(coronal.center() + vec2(-17.0, 30.0));
    harness.run_ok();
    assert_eq!(doc(&harness).nav.crosshair_mm(), before, "the crosshair doesn't follow the pointer");
}

#[test]
fn volumes_in_the_lens_match_a_voxel_count() {
    let mut harness = sample();
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Lens));
    for radius_mm in [9.0, 17.0] {
        let center_mm = DVec3::new(-26.0, 24.0, 26.0);
        perform(&mut harness, EditCommand::SetLensCenter(center_mm));
        perform(&mut harness, EditCommand::SetLensRadius(radius_mm));
        let app = harness.state();
        let time_point = app.work.world.time_point(doc(&harness)).unwrap();
        let (index, grid) = (&time_point.index, time_point.index.grid());
        let [nx, ny, nz] = grid.dims();
        let mut inside: BTreeMap<u32, u64> = BTreeMap::new();
        for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
            let bits = index.get(grid.linear([x, y, z]));
            if bits != 0 && grid.center_of_voxel_mm([x, y, z]).distance(center_mm) <= radius_mm {
                *inside.entry(bits).or_default() += 1;
            }
        }
        assert!(inside.len() >= 3, "the lens contains several regions: {inside:?}");
        let all: u64 = inside.values().sum();
        let ml = |n: u64| format::ml(grid.volume_ml(n));
        harness.get_by_label_contains(&format!("in it {} of", ml(all)));
        for (&bits, &n) in &inside {
            let region = time_point.regions.get(bits).unwrap();
            for words in [
                ml(n),
                format::percent(n as f64 / all as f64),
                format::percent(n as f64 / region.voxels as f64),
            ] {
                let found = harness.query_all_by_label(&words).count();
                assert!(found > 0, "{}: {words}", time_point.regions.name(bits));
            }
        }
    }
    perform(&mut harness, EditCommand::ToggleLens);
    harness.get_by_label("Switch the lens on").click();
    harness.run_ok();
    assert!(doc(&harness).edit.lens_on);
}

#[test]
fn agreement_colours_have_the_expected_area_in_a_slice_and_appear_in_the_closeup() {
    let mut harness = sample();
    let closeup = |harness: &mut Window| -> Vec<usize> {
        // Exclude the legend, whose swatches have the same colours.
        let area = rect(harness, PaneId::Closeup);
        let picture = harness.render().unwrap();
        let picture = crop(&picture, Rect::from_min_max(area.min + vec2(0.0, 80.0), area.max));
        (1..=3).map(|k| count_shades(&picture, agreement_color(k, 3), 8.0)).collect()
    };
    let before = closeup(&mut harness);
    perform(&mut harness, EditCommand::SetColoring(Coloring::Agreement));
    // One level at a time, because outer levels hide inner ones.
    for level in 1..=3_usize {
        let app = harness.state_mut();
        let doc = app.work.doc.as_mut().unwrap();
        let regions = &app.work.world.time_point(doc).unwrap().regions;
        let bits = regions.list().iter().map(|r| r.bits);
        let shown: Vec<u32> = bits.filter(|b| b.count_ones() as usize == level).collect();
        doc.edit.selection = HiddenRegions::of(regions, &Selection::only(regions, &shown));
        harness.run_ok();
        let found = closeup(&mut harness);
        assert!(found[level - 1] > 500 && before[level - 1] * 5 < found[level - 1], "{before:?} {found:?}");
        let others = found.iter().sum::<usize>() - found[level - 1];
        assert!(others * 10 < found[level - 1], "{level}: {found:?}");
    }
    perform(&mut harness, EditCommand::ShowAllRegions);
    let legend = harness.get_by_label_contains("1 of 3 masks: ");
    let label = legend.accesskit_node().label().unwrap_or_default();
    let regions = &harness.state().work.world.time_point(doc(&harness)).unwrap().regions;
    for level in 1..=3 {
        let voxels: u64 =
            regions.list().iter().filter(|r| r.bits.count_ones() == level).map(|r| r.voxels).sum();
        let ml = format::ml(doc_grid(&harness).volume_ml(voxels));
        assert!(label.contains(&format!("{level} of 3 masks: {ml}")), "{level}: {label}");
    }

    // The opaque overlay alone and magnified, at 0.4 mm per pixel, so that pixels convert to square millimetres.
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Axial));
    for command in [
        Command::from(LookCommand::SetContext(None)),
        EditCommand::SetOverlay(Overlay::Fill).into(),
        EditCommand::SetOverlayOpacity(1.0).into(),
        EditCommand::ToggleLens.into(),
        LookCommand::SetCursor(DVec3::new(60.0, -60.0, 24.3)).into(),
    ] {
        perform(&mut harness, command);
    }
    perform(&mut harness, LookCommand::SetSliceZoom(Some(0.4)));
    let area = rect(&harness, PaneId::Axial);
    let picture = harness.render().unwrap();
    let picture = crop(&picture, Rect::from_min_max(area.min, pos2(area.right(), area.bottom() - 90.0)));
    let index = &harness.state().work.world.time_point(doc(&harness)).unwrap().index;
    let grid = index.grid();
    let mut expected_mm2 = [0.0; 3];
    let step_mm = 0.5;
    let (lo, hi) = grid.bounds_mm();
    let steps = |axis: usize| ((hi[axis] - lo[axis]) / step_mm) as usize;
    for (i, j) in (0..steps(0)).flat_map(|i| (0..steps(1)).map(move |j| (i, j))) {
        let at = DVec3::new(lo.x + (i as f64 + 0.5) * step_mm, lo.y + (j as f64 + 0.5) * step_mm, 24.3);
        let bits = index.at_mm(at);
        if bits != 0 {
            expected_mm2[bits.count_ones() as usize - 1] += step_mm * step_mm;
        }
    }
    for level in 1..=3_u32 {
        let pixels = count_color(&picture, agreement_color(level, 3), 2);
        let (found, expected) = (pixels as f64 * 0.16, expected_mm2[level as usize - 1]);
        assert!(expected > 100.0 && (found / expected - 1.0).abs() < 0.03, "{level}: {found} {expected} mm²");
    }
}

fn doc_grid(harness: &Window) -> &glioscope_core::Grid {
    &harness.state().work.world.case().unwrap().grid
}

#[test]
fn rulers_are_saved_with_the_session() {
    let mut harness = sample();
    perform(&mut harness, LookCommand::SetSliceZoom(Some(0.5)));
    perform(&mut harness, LookCommand::ToggleRuler);
    let axial = rect(&harness, PaneId::Axial).center();
    drag(&mut harness, axial, axial + vec2(30.0, 10.0), Modifiers::NONE);
    let folder = tempfile::tempdir().unwrap();
    let saved = folder.path().join("lines.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(saved.clone()));
    let loaded = session::load(&saved).unwrap().document;
    assert_eq!(loaded.edit.rulers, doc(&harness).edit.rulers);
    assert_eq!(loaded.edit.rulers.len(), 1);
}

#[test]
fn values_of_the_image_shown_are_listed_for_each_mask() {
    let mut harness = sample();
    maximized(&mut harness, PaneId::Measurements);
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label("Values of T1c in the masks").is_some());
    let of = |harness: &Window| {
        let work = &harness.state().work;
        let time = work.world.time_point(doc(harness)).unwrap();
        let image = time.contexts.iter().find(|c| Some(&c.id) == doc(harness).nav.context.as_ref()).unwrap();
        let found = glioscope_core::measure::statistics_of(&time.masks[0].mask, (&image.id, &image.volume));
        format::four_digits(found.max.unwrap())
    };
    let most = of(&harness);
    assert!(harness.query_all_by_label(&most).count() > 0, "{most}");
    perform(&mut harness, LookCommand::SetContext(Some("PET".into())));
    wait_for_workers(&mut harness);
    assert!(harness.query_by_label("Values of PET in the masks").is_some());
    let most = of(&harness);
    assert!(harness.query_all_by_label(&most).count() > 0, "{most}");
}
