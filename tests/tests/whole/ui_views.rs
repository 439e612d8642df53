//! The context view, the ellipsoid diagram and the transfer-function editor in the window.

use egui::{Theme, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use glioscope::{
    command::{AppCommand, EditCommand, LookCommand, Workstation},
    model::{
        CaseRef, EllipsoidKind, EllipsoidLook, EllipsoidOpacity, Fusion, Navigation, PaneId, SecondImage,
        layout::Task, session, slice_axes::AxesOf,
    },
    views::ellipsoids::EllipsoidPane,
    window::GlioscopeApp,
};
use glioscope_core::{axes, glam::DVec3};
use glioscope_render::{ClipPlane, ColorMap, TransferPreset, flat::Plane};
use glioscope_tests::{
    Window, doc, issue, maximized, pane_picture, perform, screens, wait_for_workers, window_on, window_with,
    workstation, write_cube,
};

const SIZE: [f32; 2] = [1280.0, 860.0];

fn sample() -> Window {
    let mut harness = window_on(CaseRef::Sample, SIZE, Theme::Light);
    harness.run_ok();
    harness
}

const VIEWS: [PaneId; 3] = [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids];

fn frames(harness: &mut Window) -> [u64; 3] {
    VIEWS.map(|pane| screens(harness, pane).frames_drawn())
}

/// Omitted passes of a view's last frame, with the reasons.
fn omitted(harness: &mut Window, pane: PaneId) -> Vec<(&'static str, &'static str)> {
    let plan = screens(harness, pane).plan().unwrap().0;
    plan.omitted.iter().map(|(pass, why)| (pass.name(), *why)).collect()
}

fn hover<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> Option<&'a glioscope_render::EllipsoidPick> {
    harness.state().panes.get::<EllipsoidPane>(PaneId::Ellipsoids).unwrap().canvas.hover()
}

fn drag(harness: &mut Window, pane: PaneId, by: egui::Vec2) {
    let rect = harness.state().pane_rect(pane).unwrap();
    // Away from the lens's ring, which would be dragged instead.
    let from = rect.left_bottom() + vec2(rect.width() * 0.5, -rect.height() * 0.06);
    harness.hover_at(from);
    harness.drag_at(from);
    harness.hover_at(from + by);
    harness.run_ok();
    harness.drop_at(from + by);
    harness.run_ok();
}

#[test]
fn rotating_one_3d_view_rotates_the_others() {
    for pane in [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids] {
        let mut harness = sample();
        let before = frames(&mut harness);
        let camera = doc(&harness).nav.camera;
        let pictures =
            [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids].map(|p| pane_picture(&mut harness, p));
        drag(&mut harness, pane, vec2(70.0, 0.0));
        let rotated = doc(&harness).nav.camera;
        assert_ne!(rotated.world_from_camera, camera.world_from_camera, "{pane:?}");
        assert_eq!(rotated.focus_mm, camera.focus_mm, "{pane:?}: the focus stays");
        assert_eq!(rotated.height_mm, camera.height_mm, "{pane:?}");
        let after = frames(&mut harness);
        for i in 0..3 {
            assert!(after[i] > before[i], "{pane:?}: view {i} was drawn again");
        }
        for (i, p) in [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids].into_iter().enumerate() {
            assert_ne!(pane_picture(&mut harness, p), pictures[i], "rotating {pane:?} rotates {p:?}");
        }
    }
}

#[test]
fn scrolling_zooms_one_view_alone() {
    let mut harness = sample();
    let before = doc(&harness).nav.clone();
    let rect = harness.state().pane_rect(PaneId::Context).unwrap();
    harness.hover_at(rect.center());
    harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: vec2(0.0, 120.0),
        modifiers: egui::Modifiers::NONE,
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
    });
    harness.run_ok();
    let after = doc(&harness).nav.clone();
    assert!(after.zoom(PaneId::Context) > before.zoom(PaneId::Context));
    assert_eq!(after.zoom(PaneId::Ellipsoids), before.zoom(PaneId::Ellipsoids));
    assert_eq!(after.camera.height_mm, before.camera.height_mm);
}

#[test]
fn hidden_panes_compute_and_draw_nothing() {
    let case = workstation(CaseRef::Sample);
    let mut closeup_only = case.doc.clone().unwrap();
    closeup_only.edit.maximized = Some(PaneId::Closeup);
    let mut harness = window_with(Workstation { doc: Some(closeup_only), ..case }, SIZE, Theme::Light);
    harness.run_ok();
    assert_eq!(VIEWS.map(|pane| screens(&mut harness, pane).plan().is_some()), [true, false, false]);
    assert!(harness.state().results.ellipsoids.last().is_none(), "no ellipsoid was enclosed");
    assert!(harness.state().results.image.last().is_none(), "no histogram was counted");
    let closeup = pane_picture(&mut harness, PaneId::Closeup);

    // Opening every pane and maximising the closeup again leaves its pixels unchanged.
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Closeup));
    assert!(harness.state().results.ellipsoids.last().is_some_and(|found| !found.is_empty()));
    perform(&mut harness, EditCommand::MaximizePane(PaneId::Closeup));
    assert_eq!(pane_picture(&mut harness, PaneId::Closeup), closeup);
}

#[test]
fn the_selection_applies_to_every_3d_view() {
    let mut harness = sample();
    assert_eq!(omitted(&mut harness, PaneId::Ellipsoids), [("ellipsoid_rest", "every fragment has room")]);
    let before = pane_picture(&mut harness, PaneId::Context);
    let regions = {
        let state = harness.state();
        state.work.world.time_point(doc(&harness)).unwrap().regions.clone()
    };
    for region in regions.list() {
        perform(&mut harness, EditCommand::SetRegion(region.bits, false));
    }
    let passes = omitted(&mut harness, PaneId::Ellipsoids);
    assert!(
        passes.iter().any(|(pass, _)| *pass == "ellipsoid_lists"),
        "an empty selection omits passes: {passes:?}"
    );
    assert_ne!(pane_picture(&mut harness, PaneId::Context), before, "the context view shows no tumour");
    let passes = omitted(&mut harness, PaneId::Context);
    assert!(passes.iter().any(|(_, why)| *why == "selection is empty"), "{passes:?}");
    for _ in regions.list() {
        perform(&mut harness, EditCommand::Undo);
    }
    assert_eq!(pane_picture(&mut harness, PaneId::Context), before);
}

#[test]
fn transfer_functions_and_clipping_planes_are_drawn_saved_and_undone() {
    let mut harness = sample();
    let first = pane_picture(&mut harness, PaneId::Context);
    let (id, statistics) = {
        let state = harness.state();
        let (id, image) = state.work.world.context(doc(&harness)).unwrap();
        (id.to_owned(), image.histogram().clone())
    };
    let borders = TransferPreset::MrBorders.transfer(&statistics);
    assert!(borders.gradient().is_some());
    perform(&mut harness, EditCommand::SetTransfer(id.clone(), Some(borders.clone())));
    let with_borders = pane_picture(&mut harness, PaneId::Context);
    assert_ne!(with_borders, first);
    let omits_gradients = |harness: &mut Window| {
        omitted(harness, PaneId::Context).iter().any(|(pass, _)| *pass == "gradient_opacity")
    };
    assert!(!omits_gradients(&mut harness), "a 2-D function needs gradients");
    let plane = ClipPlane { normal: DVec3::Z, offset_mm: doc(&harness).nav.cursor_mm.z };
    perform(&mut harness, EditCommand::SetClips(vec![plane]));
    let clipped = pane_picture(&mut harness, PaneId::Context);
    assert_ne!(clipped, with_borders);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    let saved = session::load(&path).unwrap().document;
    assert_eq!(saved.edit.transfers.get(&id), Some(&borders));
    assert_eq!(saved.edit.clips, [plane]);

    perform(&mut harness, EditCommand::Undo);
    assert_eq!(pane_picture(&mut harness, PaneId::Context), with_borders);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(pane_picture(&mut harness, PaneId::Context), first);
    assert!(omits_gradients(&mut harness), "a 1-D function needs no gradients");
}

#[test]
fn a_control_point_is_added_and_removed_in_the_editor() {
    let mut harness = sample();
    let rect = maximized(&mut harness, PaneId::Transfer);
    let plot = harness.get_by_label("Opacity of each value").rect();
    assert!(rect.contains_rect(plot));
    let before = doc(&harness).edit.transfers.clone();
    assert!(before.is_empty(), "the initial function isn't stored");
    let at = plot.center();
    harness.hover_at(at);
    harness.drag_at(at);
    harness.drop_at(at);
    harness.run_ok();
    let (_, added) = doc(&harness).edit.transfers.iter().next().unwrap();
    let (id, start) = {
        let state = harness.state();
        let (id, image) = state.work.world.context(doc(&harness)).unwrap();
        let preset = TransferPreset::first_for(image.histogram(), id);
        (id.to_owned(), preset.transfer(image.histogram()))
    };
    assert_eq!(added.points().len(), start.points().len() + 1);
    let new = added.points().iter().find(|p| !start.points().contains(p)).unwrap();
    // Heights are square roots of opacities.
    assert!(
        (new.opacity - 0.25).abs() < 0.01,
        "the middle of the plot has an opacity of 0.25: {}",
        new.opacity
    );
    assert!(harness.query_by_label("Colour of the point").is_some(), "the new point is selected");
    harness.get_by_label("Remove").click();
    harness.run_ok();
    assert_eq!(doc(&harness).edit.transfers.get(&id).unwrap().points().len(), start.points().len());
}

#[test]
fn ellipsoid_kind_and_size_limit_change_the_diagram() {
    let mut harness = sample();
    let before = pane_picture(&mut harness, PaneId::Ellipsoids);
    let look = doc(&harness).edit.ellipsoids;
    perform(
        &mut harness,
        EditCommand::SetEllipsoidLook(EllipsoidLook { kind: EllipsoidKind::Moment, ..look }),
    );
    assert_ne!(pane_picture(&mut harness, PaneId::Ellipsoids), before);
    let count = |harness: &Harness<'_, GlioscopeApp>| {
        let state = harness.state();
        let view_doc = doc(harness);
        let found = state.results.ellipsoids.last().unwrap().clone();
        let limit = view_doc.edit.ellipsoids.smallest_ml;
        found
            .iter()
            .filter(|c| matches!(c.of, glioscope_core::ellipsoid::Of::Region(_)) && c.volume_ml >= limit)
            .count()
    };
    let label_counts = |harness: &Harness<'_, GlioscopeApp>, n: usize| {
        harness.query_by_label_contains(&format!("Ellipsoid diagram, {n} ellipsoids")).is_some()
    };
    assert!(label_counts(&harness, count(&harness)));
    perform(&mut harness, EditCommand::SetEllipsoidLook(EllipsoidLook { smallest_ml: 5.0, ..look }));
    let large = count(&harness);
    assert!(large > 0 && label_counts(&harness, large), "{large} of 5 ml and more");
    perform(&mut harness, EditCommand::Undo);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(pane_picture(&mut harness, PaneId::Ellipsoids), before);
}

#[test]
fn the_axial_slice_is_shown_in_the_3d_views() {
    let mut harness = sample();
    let panes = [PaneId::Closeup, PaneId::Ellipsoids];
    let before = panes.map(|p| pane_picture(&mut harness, p));
    perform(&mut harness, LookCommand::TogglePlane);
    for (i, pane) in panes.into_iter().enumerate() {
        let with = pane_picture(&mut harness, pane);
        let changed = with.pixels().zip(before[i].pixels()).filter(|(a, b)| a != b).count();
        assert!(changed > 3000, "{pane:?}: {changed} pixels");
    }
    perform(&mut harness, LookCommand::TogglePlane);
    for (i, pane) in panes.into_iter().enumerate() {
        assert_eq!(pane_picture(&mut harness, pane), before[i]);
    }
}

#[test]
fn hovering_a_3d_view_moves_the_crosshair() {
    for pane in [PaneId::Context, PaneId::Ellipsoids] {
        let mut harness = sample();
        let before = doc(&harness).nav.cursor_mm;
        let lens_mm = doc(&harness).edit.lens.center_mm;
        let rect = harness.state().pane_rect(pane).unwrap();
        harness.hover_at(rect.center() + vec2(4.0, 6.0));
        harness.run_ok();
        let after = doc(&harness).nav.crosshair_mm();
        assert_ne!(after, before, "{pane:?}");
        assert_eq!(doc(&harness).nav.cursor_mm, before, "{pane:?}: pinned where it was");
        assert!(after.distance(lens_mm) < 150.0, "{pane:?}: on the head or the tumour");
    }
}

#[test]
fn ellipsoids_are_cached_beside_the_session() {
    use glioscope_core::ellipsoid::cache;
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("visit.glioscope.json");
    let mut harness = sample();
    perform(&mut harness, AppCommand::SaveSessionTo(session.clone()));
    let cached = cache::load(&cache::path_beside(&session));
    let computed = harness.state().results.ellipsoids.last().unwrap().to_vec();
    assert_eq!(cached.values().collect::<Vec<_>>(), [&computed], "bit-identical");

    // The cache is used without recomputation: an altered list under the same key is what the view shows.
    let (key, mut list) = cached.into_iter().next().unwrap();
    list.truncate(1);
    cache::save(&cache::path_beside(&session), &cache::Entries::from([(key, list.clone())])).unwrap();
    let work = workstation(CaseRef::Sample);
    let work = Workstation { session_path: Some(session), ..work };
    let mut again = window_with(work, SIZE, Theme::Light);
    again.run_ok();
    assert_eq!(again.state().results.ellipsoids.last().unwrap().to_vec(), list);
}

#[test]
fn one_ellipsoid_is_made_transparent_and_undone() {
    let mut harness = sample();
    let before = pane_picture(&mut harness, PaneId::Ellipsoids);
    let rect = harness.state().pane_rect(PaneId::Ellipsoids).unwrap();
    let at = rect.center() + vec2(4.0, 6.0);
    harness.hover_at(at);
    harness.run_ok();
    let picked = *hover(&harness).expect("an ellipsoid is in the middle");
    for pressed in [true, false] {
        harness.event(egui::Event::PointerButton {
            pos: at,
            button: egui::PointerButton::Secondary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        });
        harness.run_ok();
    }
    assert!(harness.query_by_label("Opacity of this ellipsoid").is_some(), "its menu is open");
    let neighbors = doc(&harness).edit.ellipsoids.neighbors;
    let own = EllipsoidOpacity { time: 0, neighbors, of: None, number: picked.id, opacity: 0.0 };
    harness.key_press(egui::Key::Escape);
    harness.run_ok();
    perform(&mut harness, EditCommand::SetEllipsoidOpacities(vec![own]));
    harness.hover_at(rect.left_top() + vec2(3.0, rect.height() - 3.0));
    harness.run_ok();
    let without = pane_picture(&mut harness, PaneId::Ellipsoids);
    assert_ne!(without, before);
    harness.hover_at(at);
    harness.run_ok();
    let hovered = hover(&harness);
    assert_ne!(hovered.map(|p| p.id), Some(picked.id), "invisible ellipsoids can't be picked");
    perform(&mut harness, EditCommand::Undo);
    assert!(doc(&harness).edit.ellipsoid_opacities.is_empty());
}

/// Three crossing rods fill an eightieth of the ball around them.
#[test]
fn an_ellipsoid_much_larger_than_its_component_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rods_mask.nii");
    write_cube(&file, 21, 3.0, |ijk| u8::from(ijk.iter().filter(|i| **i == 10).count() >= 2));
    let masks = vec![format!("rods={}", file.display())];
    let case = CaseRef::Arguments { masks, contexts: Vec::new() };
    let mut harness = window_on(case, [1280.0, 800.0], Theme::Dark);
    wait_for_workers(&mut harness);
    let warnings =
        |harness: &Window| harness.query_all_by_label_contains("ellipsoid 80 × its component").count();
    assert_eq!(warnings(&harness), 1);
    let look = doc(&harness).edit.ellipsoids;
    let moment = EllipsoidLook { kind: EllipsoidKind::Moment, ..look };
    perform(&mut harness, EditCommand::SetEllipsoidLook(moment));
    assert_eq!(warnings(&harness), 0, "of the same volume");
}

#[test]
fn a_reader_keeps_a_layout_by_name_and_takes_it_again() {
    let mut harness = sample();
    issue(&mut harness, EditCommand::SetTask(Task::Read));
    // Laid out, panes are in tabs.
    harness.run_ok();
    let own = doc(&harness).edit.layout.clone();
    let open_menu = |harness: &mut Window| {
        harness.get_by_label("View").click();
        harness.run_ok();
        harness.get_by_label_contains("Layouts").click();
        harness.run_ok();
    };
    open_menu(&mut harness);
    harness.get_by_label("Name of this layout").focus();
    harness.run_ok();
    harness.get_by_label("Name of this layout").type_text("Tumour board");
    harness.run_ok();
    harness.get_by_label("Keep this layout").click();
    harness.run_ok();
    issue(&mut harness, EditCommand::ResetLayout);
    assert_ne!(doc(&harness).edit.layout, own);
    open_menu(&mut harness);
    harness.get_by_label("Tumour board").click();
    harness.run_ok();
    assert_eq!(doc(&harness).edit.layout, own);
    open_menu(&mut harness);
    harness.get_by_label("Forget the layout Tumour board").click();
    harness.run_ok();
    assert!(harness.query_by_label("Tumour board").is_none());
}

/// Slices along the tumour's own axes: planes turn about the crosshair, scrolling goes along their normal, and the patient's planes
/// come back.
#[test]
fn slices_turn_to_the_tumours_axes_and_back() {
    let mut harness = sample();
    let rect = maximized(&mut harness, PaneId::Axial);
    let plain = pane_picture(&mut harness, PaneId::Axial);
    perform(&mut harness, LookCommand::SetSliceAxes(AxesOf::Tumor));
    let turn = doc(&harness).nav.slice_axes.turn;
    let deg = axes::turn_deg(turn);
    assert!(deg > 2.0 && deg < 63.0, "{deg}");
    assert!(harness.query_by_label_contains(&format!("slice turned {deg:.0}°")).is_some());
    let turned = pane_picture(&mut harness, PaneId::Axial);
    assert!(plain != turned);
    // The thing under the crosshair stays: the image's value there is that of either picture's middle.
    let place_mm = doc(&harness).nav.crosshair_mm();
    harness.event(egui::Event::PointerMoved(rect.center() + vec2(rect.width() * 0.3, 0.0)));
    harness.run_ok();
    let hovered_mm = doc(&harness).nav.crosshair_mm();
    let normal = turn * DVec3::Z;
    assert!((hovered_mm - place_mm).dot(normal).abs() < 1e-6, "in the turned plane");
    assert!((hovered_mm - place_mm).z.abs() > 0.5, "which isn't the axial one");
    harness.key_press(egui::Key::PageUp);
    harness.run_ok();
    let moved_mm = doc(&harness).nav.crosshair_mm() - hovered_mm;
    assert!(
        moved_mm.dot(normal) > 0.5 && moved_mm.reject_from_normalized(normal).length() < 1e-6,
        "{moved_mm}"
    );
    perform(&mut harness, LookCommand::SetSliceAxes(AxesOf::Patient));
    perform(&mut harness, LookCommand::SetCursor(place_mm));
    harness.event(egui::Event::PointerGone);
    harness.run_ok();
    assert!(pane_picture(&mut harness, PaneId::Axial) == plain);
}

/// One slice alone along the tumour's axes: the others don't change, a session keeps it, and the switch and other axes for all take it
/// back.
#[test]
fn one_slice_alone_stands_along_the_tumours_axes() {
    let mut harness = sample();
    let planes = [PaneId::Axial, PaneId::Coronal, PaneId::Sagittal];
    let pictures = |harness: &mut Window| planes.map(|pane| pane_picture(harness, pane));
    let plain = pictures(&mut harness);
    perform(&mut harness, LookCommand::ToggleTumorAxes(Plane::Coronal));
    let deg = axes::turn_deg(doc(&harness).nav.turn_of(Plane::Coronal));
    assert!(deg > 2.0 && deg < 63.0, "{deg}");
    let notes = harness.query_all_by_label_contains(&format!("slice turned {deg:.0}°")).count();
    assert_eq!(notes, 1, "of the coronal slice");
    let turned = pictures(&mut harness);
    assert!(turned[0] == plain[0] && turned[2] == plain[2] && turned[1] != plain[1]);
    let kept: Navigation = serde_json::from_value(serde_json::to_value(&doc(&harness).nav).unwrap()).unwrap();
    assert_eq!(kept.own_axes, doc(&harness).nav.own_axes);
    perform(&mut harness, LookCommand::ToggleTumorAxes(Plane::Coronal));
    assert!(pictures(&mut harness) == plain);
    perform(&mut harness, LookCommand::ToggleTumorAxes(Plane::Axial));
    perform(&mut harness, LookCommand::SetSliceAxes(AxesOf::Patient));
    assert!(pictures(&mut harness) == plain);
}

/// The largest PET value along each ray lies over the context view, turns with it, and leaves nothing when it is off.
#[test]
fn a_second_image_is_projected_over_the_context_view() {
    let mut harness = sample();
    let rect = maximized(&mut harness, PaneId::Context);
    wait_for_workers(&mut harness);
    let plain = pane_picture(&mut harness, PaneId::Context);
    let fusion = Fusion {
        second: Some(SecondImage { id: "PET".into(), time: None }),
        map: ColorMap::Hot,
        opacity: 1.0,
        in_context: true,
        ..Fusion::default()
    };
    let yellow = |picture: &image::RgbaImage| {
        picture.pixels().filter(|p| p[0] > 235 && p[1] > 140 && p[2] < 130).count()
    };
    perform(&mut harness, EditCommand::SetFusion(Box::new(fusion.clone())));
    wait_for_workers(&mut harness);
    let over = pane_picture(&mut harness, PaneId::Context);
    assert!(yellow(&over) > yellow(&plain) + 150, "{} {}", yellow(&over), yellow(&plain));
    let plan = screens(&mut harness, PaneId::Context).plan().unwrap().0.clone();
    assert!(plan.passes.iter().any(|pass| pass.name() == "projection"));
    // Only on slices, nothing is projected, and the picture is as before.
    perform(&mut harness, EditCommand::SetFusion(Box::new(Fusion { in_context: false, ..fusion })));
    wait_for_workers(&mut harness);
    assert!(omitted(&mut harness, PaneId::Context).contains(&("projection", "no second image")));
    perform(&mut harness, EditCommand::SetFusion(Box::default()));
    wait_for_workers(&mut harness);
    assert!(pane_picture(&mut harness, PaneId::Context) == plain);
    assert!(rect.width() > 300.0);
}
