//! The context view, the ellipsoid diagram and the transfer-function editor in the window.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "in a test a failed unwrap is a failed test"
)]

use egui::{Theme, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use glioscope::{
    commands::Command,
    document::{CaseRef, Document, Pane},
    views::ellipsoids::{EllipsoidKind, EllipsoidLook},
    window::GlioscopeApp,
};
use glioscope_render::{ClipPlane, TransferPreset};
use glioscope_tests::{crop, maximized, window_on};

const SIZE: [f32; 2] = [1280.0, 860.0];

fn sample() -> Harness<'static, GlioscopeApp> {
    let mut harness = window_on(CaseRef::Sample, SIZE, Theme::Light);
    harness.run_ok();
    harness
}

fn doc<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> &'a Document {
    harness.state().work.doc.as_ref().unwrap()
}

fn perform(harness: &mut Harness<'_, GlioscopeApp>, command: &Command) {
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(&ctx, command, std::time::Instant::now());
    harness.run_ok();
}

fn frames(harness: &Harness<'_, GlioscopeApp>) -> [u64; 3] {
    let viewport = harness.state().viewport.as_ref().unwrap();
    [viewport.closeup.frames_drawn, viewport.context.frames_drawn, viewport.ellipsoids.frames_drawn]
}

fn pane_picture(harness: &mut Harness<'_, GlioscopeApp>, pane: Pane) -> image::RgbaImage {
    let rect = harness.state().pane_rect(pane).unwrap();
    crop(&harness.render().unwrap(), rect)
}

fn drag(harness: &mut Harness<'_, GlioscopeApp>, pane: Pane, by: egui::Vec2) {
    let rect = harness.state().pane_rect(pane).unwrap();
    // Away from the ring, which would be taken hold of.
    let from = rect.left_bottom() + vec2(rect.width() * 0.5, -rect.height() * 0.06);
    harness.hover_at(from);
    harness.drag_at(from);
    harness.hover_at(from + by);
    harness.run_ok();
    harness.drop_at(from + by);
    harness.run_ok();
}

#[test]
fn turning_one_3d_view_turns_the_others() {
    for pane in [Pane::Closeup, Pane::Context, Pane::Ellipsoids] {
        let mut harness = sample();
        let before = frames(&harness);
        let camera = doc(&harness).nav.camera;
        let pictures =
            [Pane::Closeup, Pane::Context, Pane::Ellipsoids].map(|p| pane_picture(&mut harness, p));
        drag(&mut harness, pane, vec2(70.0, 0.0));
        let turned = doc(&harness).nav.camera;
        assert_ne!(turned.world_from_camera, camera.world_from_camera, "{pane:?}");
        assert_eq!(turned.focus_mm, camera.focus_mm, "{pane:?}: orientation, not position");
        assert_eq!(turned.height_mm, camera.height_mm, "{pane:?}");
        let after = frames(&harness);
        for i in 0..3 {
            assert!(after[i] > before[i], "{pane:?}: view {i} was drawn again");
        }
        for (i, p) in [Pane::Closeup, Pane::Context, Pane::Ellipsoids].into_iter().enumerate() {
            assert_ne!(pane_picture(&mut harness, p), pictures[i], "{pane:?} turned {p:?}");
        }
    }
}

#[test]
fn scrolling_zooms_one_view_alone_and_a_double_click_fits_it() {
    let mut harness = sample();
    let before = doc(&harness).nav.clone();
    let rect = harness.state().pane_rect(Pane::Context).unwrap();
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
    assert!(after.context_zoom > before.context_zoom);
    assert_eq!(after.ellipsoid_zoom, before.ellipsoid_zoom);
    assert_eq!(after.camera.height_mm, before.camera.height_mm);
}

#[test]
fn what_no_pane_shows_is_neither_computed_nor_compiled() {
    let case = glioscope_tests::workstation(CaseRef::Sample);
    let mut doc_alone = case.doc.clone().unwrap();
    doc_alone.edit.maximized = Some(Pane::Closeup);
    let mut harness = glioscope_tests::window_with(
        glioscope::workstation::Workstation { doc: Some(doc_alone), ..case },
        SIZE,
        Theme::Light,
    );
    harness.run_ok();
    let viewport = harness.state().viewport.as_ref().unwrap();
    assert!(viewport.closeup.frame().is_some());
    assert!(viewport.context.frame().is_none() && viewport.ellipsoids.frame().is_none());
    assert!(harness.state().states.ellipsoids.found().is_none(), "no ellipsoid was enclosed");
    assert!(harness.state().states.volume.last().is_none(), "no histogram was counted");
    let closeup = pane_picture(&mut harness, Pane::Closeup);

    // With everything open, then closed again: the closeup is the same to the last bit.
    perform(&mut harness, &Command::MaximizePane(Pane::Closeup));
    assert!(harness.state().states.ellipsoids.found().is_some_and(|found| !found.is_empty()));
    perform(&mut harness, &Command::MaximizePane(Pane::Closeup));
    assert_eq!(pane_picture(&mut harness, Pane::Closeup), closeup);
}

#[test]
fn the_selection_reaches_every_view() {
    let mut harness = sample();
    let ids = |harness: &Harness<'_, GlioscopeApp>| {
        let state = harness.state();
        let plan = state.viewport.as_ref().unwrap().ellipsoids.plan().unwrap().0.clone();
        plan.omitted.iter().map(|(pass, why)| format!("{pass}: {why}")).collect::<Vec<_>>()
    };
    assert_eq!(ids(&harness), ["ellipsoid_rest: every fragment has room"]);
    let before = pane_picture(&mut harness, Pane::Context);
    let regions = {
        let state = harness.state();
        state.work.world.time_point(doc(&harness)).unwrap().regions.clone()
    };
    for region in regions.list() {
        perform(&mut harness, &Command::SetRegion(region.bits, false));
    }
    let omitted = ids(&harness);
    assert!(
        omitted.iter().any(|why| why.starts_with("ellipsoid_lists")),
        "nothing is selected, so work is left out: {omitted:?}"
    );
    assert_ne!(pane_picture(&mut harness, Pane::Context), before, "the context view shows no tumour");
    let viewport = harness.state().viewport.as_ref().unwrap();
    let context = viewport.context.plan().unwrap().0;
    assert!(context.omitted.iter().any(|(_, why)| *why == "selection is empty"), "{:?}", context.omitted);
    for _ in regions.list() {
        perform(&mut harness, &Command::Undo);
    }
    assert_eq!(pane_picture(&mut harness, Pane::Context), before);
}

#[test]
fn a_transfer_function_and_cuts_are_live_saved_and_undone() {
    let mut harness = sample();
    let first = pane_picture(&mut harness, Pane::Context);
    let (id, statistics) = {
        let state = harness.state();
        let (id, image) = state.work.world.context(doc(&harness)).unwrap();
        (id.to_owned(), image.histogram().clone())
    };
    let borders = TransferPreset::MrBorders.transfer(&statistics);
    assert!(borders.gradient().is_some());
    perform(&mut harness, &Command::SetTransfer(id.clone(), Some(borders.clone())));
    let with_borders = pane_picture(&mut harness, Pane::Context);
    assert_ne!(with_borders, first);
    let plan = |harness: &Harness<'_, GlioscopeApp>| {
        harness.state().viewport.as_ref().unwrap().context.plan().unwrap().0.clone()
    };
    let no_gradients = |harness: &Harness<'_, GlioscopeApp>| {
        plan(harness).omitted.iter().any(|(pass, _)| pass.name() == "gradient_opacity")
    };
    assert!(!no_gradients(&harness), "a 2-D function needs its gradients");
    let cut = ClipPlane { normal: glam::DVec3::Z, offset_mm: doc(&harness).nav.cursor_mm.z };
    perform(&mut harness, &Command::SetClips(vec![cut]));
    let with_cut = pane_picture(&mut harness, Pane::Context);
    assert_ne!(with_cut, with_borders);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.glioscope.json");
    perform(&mut harness, &Command::SaveSessionTo(path.clone()));
    let saved = glioscope::session::load(&path).unwrap();
    assert_eq!(saved.edit.transfers.get(&id), Some(&borders));
    assert_eq!(saved.edit.clips, [cut]);

    perform(&mut harness, &Command::Undo);
    assert_eq!(pane_picture(&mut harness, Pane::Context), with_borders);
    perform(&mut harness, &Command::Undo);
    assert_eq!(pane_picture(&mut harness, Pane::Context), first);
    assert!(no_gradients(&harness), "a 1-D function needs no gradients");
}

#[test]
fn a_point_is_dragged_in_the_editor() {
    let mut harness = sample();
    let rect = maximized(&mut harness, Pane::Transfer);
    let plot = harness.get_by_label("Opacity of each value").rect();
    assert!(rect.contains_rect(plot));
    let before = doc(&harness).edit.transfers.clone();
    assert!(before.is_empty(), "the function to begin with isn't stored");
    let at = plot.center();
    harness.hover_at(at);
    harness.drag_at(at);
    harness.drop_at(at);
    harness.run_ok();
    let (_, added) = doc(&harness).edit.transfers.iter().next().unwrap();
    let first = TransferPreset::first_for;
    let (id, start) = {
        let state = harness.state();
        let (id, image) = state.work.world.context(doc(&harness)).unwrap();
        (id.to_owned(), first(image.histogram(), id).transfer(image.histogram()))
    };
    assert_eq!(added.points().len(), start.points().len() + 1);
    let new = added.points().iter().find(|p| !start.points().contains(p)).unwrap();
    // Heights are square roots of opacities.
    assert!((new.opacity - 0.25).abs() < 0.01, "half way up: {}", new.opacity);
    assert!(harness.query_by_label("Colour of the point").is_some(), "the new point is chosen");
    harness.get_by_label("Remove").click();
    harness.run_ok();
    assert_eq!(doc(&harness).edit.transfers.get(&id).unwrap().points().len(), start.points().len());
}

#[test]
fn ellipsoids_change_kind_and_the_small_are_hidden_and_counted() {
    let mut harness = sample();
    let before = pane_picture(&mut harness, Pane::Ellipsoids);
    let look = doc(&harness).edit.ellipsoids;
    perform(&mut harness, &Command::SetEllipsoidLook(EllipsoidLook { kind: EllipsoidKind::Moment, ..look }));
    assert_ne!(pane_picture(&mut harness, Pane::Ellipsoids), before);
    let count = |harness: &Harness<'_, GlioscopeApp>| {
        let state = harness.state();
        let view_doc = doc(harness);
        let found = state.states.ellipsoids.found().unwrap().clone();
        let limit = view_doc.edit.ellipsoids.smallest_ml;
        found
            .iter()
            .filter(|c| matches!(c.of, glioscope_core::ellipsoid::Of::Region(_)) && c.volume_ml >= limit)
            .count()
    };
    let said = |harness: &Harness<'_, GlioscopeApp>, n: usize| {
        harness.query_by_label_contains(&format!("Ellipsoid diagram, {n} ellipsoids")).is_some()
    };
    assert!(said(&harness, count(&harness)));
    perform(&mut harness, &Command::SetEllipsoidLook(EllipsoidLook { smallest_ml: 5.0, ..look }));
    let large = count(&harness);
    assert!(large > 0 && said(&harness, large), "{large} of 5 ml and more");
    perform(&mut harness, &Command::Undo);
    perform(&mut harness, &Command::Undo);
    assert_eq!(pane_picture(&mut harness, Pane::Ellipsoids), before);
}

#[test]
fn the_axial_slice_stands_in_the_3d_views() {
    let mut harness = sample();
    let panes = [Pane::Closeup, Pane::Ellipsoids];
    let before = panes.map(|p| pane_picture(&mut harness, p));
    perform(&mut harness, &Command::TogglePlane);
    for (i, pane) in panes.into_iter().enumerate() {
        let with = pane_picture(&mut harness, pane);
        let changed = with.pixels().zip(before[i].pixels()).filter(|(a, b)| a != b).count();
        assert!(changed > 3000, "{pane:?}: {changed} pixels");
    }
    perform(&mut harness, &Command::TogglePlane);
    for (i, pane) in panes.into_iter().enumerate() {
        assert_eq!(pane_picture(&mut harness, pane), before[i]);
    }
}

#[test]
fn hovering_a_3d_view_moves_the_crosshair() {
    for pane in [Pane::Context, Pane::Ellipsoids] {
        let mut harness = sample();
        let before = doc(&harness).nav.cursor_mm;
        let lens_mm = doc(&harness).edit.lens.center_mm;
        let rect = harness.state().pane_rect(pane).unwrap();
        harness.hover_at(rect.center() + vec2(4.0, 6.0));
        harness.run_ok();
        let after = doc(&harness).nav.cursor_mm;
        assert_ne!(after, before, "{pane:?}");
        assert!(after.distance(lens_mm) < 150.0, "{pane:?}: on the head or the tumour");
    }
}

#[test]
fn ellipsoids_are_kept_beside_the_session() {
    use glioscope_core::ellipsoid::cache;
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("visit.glioscope.json");
    let mut harness = sample();
    perform(&mut harness, &Command::SaveSessionTo(session.clone()));
    let kept = cache::load(&cache::path_beside(&session));
    let computed = harness.state().states.ellipsoids.found().unwrap().to_vec();
    assert_eq!(kept.values().collect::<Vec<_>>(), [&computed], "to the last bit");

    // What the file says is what is shown: a made-up list under the right key is taken as it is.
    let (key, mut list) = kept.into_iter().next().unwrap();
    list.truncate(1);
    cache::save(&cache::path_beside(&session), &cache::Entries::from([(key, list.clone())])).unwrap();
    let work = glioscope_tests::workstation(CaseRef::Sample);
    let work = glioscope::workstation::Workstation { session_path: Some(session), ..work };
    let mut again = glioscope_tests::window_with(work, SIZE, Theme::Light);
    again.run_ok();
    assert_eq!(again.state().states.ellipsoids.found().unwrap().to_vec(), list);
}

#[test]
fn one_ellipsoid_alone_is_made_transparent_and_undone() {
    let mut harness = sample();
    let before = pane_picture(&mut harness, Pane::Ellipsoids);
    let rect = harness.state().pane_rect(Pane::Ellipsoids).unwrap();
    let at = rect.center() + vec2(4.0, 6.0);
    harness.hover_at(at);
    harness.run_ok();
    let picked = harness.state().states.ellipsoids.hover().expect("an ellipsoid is in the middle");
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
    let own = glioscope::views::ellipsoids::OwnOpacity {
        time: 0,
        neighbors: doc(&harness).edit.ellipsoids.neighbors,
        id: picked.id,
        opacity: 0.0,
    };
    harness.key_press(egui::Key::Escape);
    harness.run_ok();
    perform(&mut harness, &Command::SetEllipsoidOpacities(vec![own]));
    harness.hover_at(rect.left_top() + vec2(3.0, rect.height() - 3.0));
    harness.run_ok();
    let without = pane_picture(&mut harness, Pane::Ellipsoids);
    assert_ne!(without, before);
    harness.hover_at(at);
    harness.run_ok();
    let now = harness.state().states.ellipsoids.hover();
    assert_ne!(now.map(|p| p.id), Some(picked.id), "what can't be seen can't be picked");
    perform(&mut harness, &Command::Undo);
    assert!(doc(&harness).edit.ellipsoid_opacities.is_empty());
}
