//! Effects of mouse and keyboard input, in millimetres.

use std::{sync::Arc, time::Instant};

use egui::{Event, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, Rect, TouchPhase, Vec2, vec2};
use egui_kittest::{Harness, kittest::Queryable};
use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{
    Grid, Mask, MaskBits, Regions, Samples, Scaling, Sides, TumorIndex, Volume,
    case::{Case, CaseMask, Context, OrderBasis, TimePoint},
    files::Inputs,
};
use glioscope_render::flat::{Convention, Plane, Window};

use super::{Input, SlicePane};
use crate::{
    command::{Command, Commands, EditCommand, LookCommand, Workstation},
    model::CaseRef,
    world::Loaded,
};

/// 40 mm × 60 mm × 80 mm in voxels of 1, 1.5 and 2 mm, centred at (100, 200, 300) mm; values 0, 1, 2 … along x; mask
/// "left" is the half of low x, "front" the half of high y.
fn case(sides: Sides) -> Case {
    let spacing = DVec3::new(1.0, 1.5, 2.0);
    let dims = [40, 40, 40];
    let translation = DVec3::new(100.0, 200.0, 300.0) - spacing * 19.5;
    let grid =
        Grid::new(dims, DAffine3 { matrix3: DMat3::from_diagonal(spacing), translation }, sides).unwrap();
    let values: Vec<i16> = (0..grid.voxel_count()).map(|l| (l % 40) as i16).collect();
    let volume = Arc::new(Volume::new(grid.clone(), Samples::I16(values), Scaling::NONE).unwrap());
    let mask = |id: &str, active: &dyn Fn(usize) -> bool| {
        let bits = MaskBits::from_fn(dims, active);
        Mask::new(id, grid.clone(), bits).unwrap()
    };
    let masks = [mask("left", &|l| l % 40 < 20), mask("front", &|l| l / 40 % 40 >= 20)];
    let index = TumorIndex::new(grid.clone(), &[&masks[0], &masks[1]]).unwrap();
    let regions = Arc::new(Regions::of(&index));
    let masks = masks
        .map(|mask| CaseMask {
            frame_of_reference: String::new(),
            native_grid: mask.grid().clone(),
            native_voxels: mask.voxels(),
            native_volume_ml: mask.volume_ml(),
            expected_volume_ml: None,
            mask,
            color: None,
            name: None,
        })
        .to_vec();
    let contexts = vec![Context { id: "T1c".into(), volume }];
    let time_point = TimePoint { label: String::new(), contexts, masks, index: Arc::new(index), regions };
    Case {
        name: "test".into(),
        patient: glioscope_core::case::Patient::default(),
        grid,
        time_points: vec![time_point],
        order: OrderBasis::Single,
        tracts: Vec::new(),
        one_space: false,
        aligned: Vec::new(),
        checks: Vec::new(),
        inputs: Inputs::default(),
    }
}

struct TestView {
    work: Workstation,
    pane: SlicePane,
    rect: Rect,
}

impl TestView {
    fn cursor(&self) -> DVec3 {
        self.work.doc.as_ref().unwrap().nav.cursor_mm
    }

    fn crosshair(&self) -> DVec3 {
        self.work.doc.as_ref().unwrap().nav.crosshair_mm()
    }

    fn window(&self) -> Option<Window> {
        self.work.doc.as_ref().unwrap().edit.windows.get("T1c").copied()
    }
}

/// One slice view at 0.5 mm per point, with the crosshair in the middle of the case.
fn slice_harness(plane: Plane, sides: Sides, convention: Convention) -> Harness<'static, TestView> {
    let mut work = Workstation::with_case(CaseRef::Sample, Loaded::new(case(sides)));
    let nav = &mut work.doc.as_mut().unwrap().nav;
    nav.mm_per_point = Some(0.5);
    nav.convention = convention;
    // The crosshair moves only by what a test does.
    nav.follow_pointer = false;
    nav.cursor_mm = DVec3::new(100.0, 200.0, 300.0);
    let mut harness =
        Harness::builder().with_size(vec2(300.0, 240.0)).with_step_dt(1.0 / 60.0).build_ui_state(
            move |ui, view: &mut TestView| {
                view.rect = ui.available_rect_before_wrap();
                let mut out = Commands::default();
                let doc = view.work.doc.as_ref().unwrap();
                let case = view.work.world.case().unwrap().clone();
                let input = Input {
                    doc,
                    case: &case,
                    dates: &[],
                    time: 0,
                    matched_to: None,
                    fit_grid: None,
                    time_point: &case.time_points[0],
                    selection: &view.work.world.selection(doc),
                    tumor: None,
                    is_plain: false,
                    is_picture: false,
                    colors: &view.work.world.colors(doc),
                    second: None,
                    only_mask: None,
                    context: view.work.world.context(doc),
                    compared: None,
                };
                view.pane.draw(ui, &input, &mut out);
                for command in out.into_vec() {
                    view.work.apply(&command, Instant::now());
                }
            },
            TestView { work, pane: SlicePane::new(plane), rect: Rect::NOTHING },
        );
    harness.run();
    harness
}

fn radiological(plane: Plane) -> Harness<'static, TestView> {
    slice_harness(plane, Sides::Known, Convention::Radiological)
}

fn offset_from_center(harness: &Harness<'_, TestView>, x: f32, y: f32) -> Pos2 {
    harness.state().rect.center() + vec2(x, y)
}

fn press(harness: &mut Harness<'_, TestView>, pos: Pos2, button: PointerButton, pressed: bool) {
    harness.event(Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE });
    harness.step();
}

fn drag(harness: &mut Harness<'_, TestView>, from: Pos2, by: Vec2, button: PointerButton) {
    harness.hover_at(from);
    harness.step();
    press(harness, from, button, true);
    for part in 1..=10 {
        harness.hover_at(from + by * (part as f32 / 10.0));
        harness.step();
    }
    press(harness, from + by, button, false);
    harness.run();
}

fn wheel(harness: &mut Harness<'_, TestView>, lines: f32, modifiers: Modifiers) {
    harness.event_modifiers(
        Event::MouseWheel {
            unit: MouseWheelUnit::Line,
            delta: vec2(0.0, lines),
            phase: TouchPhase::Move,
            source: egui::MouseWheelSource::Wheel,
            modifiers,
        },
        modifiers,
    );
    // egui smooths scrolling and zooming over some frames.
    harness.run_steps(60);
}

fn assert_near(found: DVec3, expected: [f64; 3]) {
    let expected = DVec3::from_array(expected);
    assert!(found.distance(expected) < 1e-3, "found {found}, expected {expected}");
}

fn draws(harness: &Harness<'_, TestView>) -> u64 {
    harness.state().pane.draws()
}

fn apply(harness: &mut Harness<'_, TestView>, command: impl Into<Command>) {
    harness.state_mut().work.apply(&command.into(), Instant::now());
}

#[test]
fn a_click_moves_the_crosshair_to_the_millimetres_under_it() {
    use Convention::{Neurological, Radiological};
    for (plane, convention, expected) in [
        (Plane::Axial, Radiological, [90.0, 205.0, 300.0]),
        (Plane::Axial, Neurological, [110.0, 205.0, 300.0]),
        (Plane::Coronal, Radiological, [90.0, 200.0, 305.0]),
        (Plane::Sagittal, Radiological, [100.0, 190.0, 305.0]),
    ] {
        let mut harness = slice_harness(plane, Sides::Known, convention);
        let pos = offset_from_center(&harness, 20.0, -10.0);
        harness.hover_at(pos);
        press(&mut harness, pos, PointerButton::Primary, true);
        press(&mut harness, pos, PointerButton::Primary, false);
        harness.run();
        assert_near(harness.state().cursor(), expected);
    }
}

#[test]
fn dragging_moves_the_crosshair() {
    let mut harness = radiological(Plane::Coronal);
    let from = offset_from_center(&harness, 0.0, 0.0);
    drag(&mut harness, from, vec2(-30.0, 40.0), PointerButton::Primary);
    assert_near(harness.state().cursor(), [115.0, 200.0, 280.0]);
}

#[test]
fn hovering_shows_the_crosshair_under_the_pointer_until_it_leaves() {
    let mut harness = radiological(Plane::Coronal);
    harness.state_mut().work.doc.as_mut().unwrap().nav.follow_pointer = true;
    harness.hover_at(offset_from_center(&harness, -30.0, 40.0));
    harness.run();
    assert_near(harness.state().crosshair(), [115.0, 200.0, 280.0]);
    assert_near(harness.state().cursor(), [100.0, 200.0, 300.0]);
    // Dragging the window doesn't move it.
    let from = offset_from_center(&harness, -30.0, 40.0);
    press(&mut harness, from, PointerButton::Secondary, true);
    harness.hover_at(from + vec2(40.0, 0.0));
    harness.run();
    assert_near(harness.state().crosshair(), [115.0, 200.0, 280.0]);
    press(&mut harness, from + vec2(40.0, 0.0), PointerButton::Secondary, false);
    // The wheel moves it along the normal only.
    harness.hover_at(from);
    harness.run();
    wheel(&mut harness, 2.0, Modifiers::NONE);
    assert_near(harness.state().crosshair(), [115.0, 203.0, 280.0]);
    // Leaving the pane: within the plane it returns, and the slice stays the one scrolled to.
    harness.hover_at(Pos2::new(-50.0, -50.0));
    harness.run();
    assert_near(harness.state().crosshair(), [100.0, 203.0, 300.0]);
    // A click pins it.
    harness.hover_at(from);
    press(&mut harness, from, PointerButton::Primary, true);
    press(&mut harness, from, PointerButton::Primary, false);
    harness.hover_at(Pos2::new(-50.0, -50.0));
    harness.run();
    assert_near(harness.state().crosshair(), [115.0, 203.0, 280.0]);
}

#[test]
fn the_ruler_measures_in_the_plane_without_moving_the_crosshair() {
    let mut harness = radiological(Plane::Sagittal);
    apply(&mut harness, LookCommand::ToggleRuler);
    let from = offset_from_center(&harness, -20.0, 12.0);
    drag(&mut harness, from, vec2(60.0, -80.0), PointerButton::Primary);
    let rulers = &harness.state().work.doc.as_ref().unwrap().edit.rulers;
    assert_eq!(rulers.len(), 1);
    // 30 mm and 40 mm at right angles, at 0.5 mm per point.
    assert!((rulers[0].length_mm() - 50.0).abs() < 1e-3, "{}", rulers[0].length_mm());
    assert_near(rulers[0].from_mm, [100.0, 210.0, 294.0]);
    assert_near(rulers[0].to_mm, [100.0, 180.0, 334.0]);
    assert_near(harness.state().cursor(), [100.0, 200.0, 300.0]);
    // Cancelled with Escape, or released outside the slice: no ruler is added. Not at an end of the first, which would be dragged.
    let from = from + vec2(0.0, 30.0);
    harness.hover_at(from);
    press(&mut harness, from, PointerButton::Primary, true);
    harness.hover_at(from + vec2(30.0, 0.0));
    harness.step();
    harness.key_press(Key::Escape);
    harness.step();
    press(&mut harness, from + vec2(30.0, 0.0), PointerButton::Primary, false);
    drag(&mut harness, from, vec2(1000.0, 0.0), PointerButton::Primary);
    assert_eq!(harness.state().work.doc.as_ref().unwrap().edit.rulers.len(), 1);
    apply(&mut harness, EditCommand::Undo);
    assert_eq!(harness.state().work.doc.as_ref().unwrap().edit.rulers, []);
}

#[test]
fn dragging_right_widens_the_window_and_undo_restores_it() {
    let mut harness = radiological(Plane::Axial);
    let before = harness.state().work.world.context(harness.state().work.doc.as_ref().unwrap());
    let before = before.unwrap().1.histogram().initial_window();
    let from = offset_from_center(&harness, 0.0, 0.0);
    drag(&mut harness, from, vec2(90.0, 0.0), PointerButton::Secondary);
    let after = harness.state().window().unwrap();
    let drag_points = (after.width() / before.width()).ln() * 300.0;
    assert!((drag_points - 90.0).abs() < 1e-3, "widened as by a drag of {drag_points} points");
    assert!((after.level() - before.level()).abs() < 1e-9);
    assert_near(harness.state().cursor(), [100.0, 200.0, 300.0]);
    drag(&mut harness, from, vec2(0.0, -30.0), PointerButton::Secondary);
    let brighter = harness.state().window().unwrap();
    assert!(brighter.level() < after.level(), "dragging up brightens");
    apply(&mut harness, EditCommand::Undo);
    assert_eq!(harness.state().window(), None, "gestures in quick succession are one undo step");
}

#[test]
fn the_wheel_steps_by_slices_and_stops_at_the_last() {
    for (plane, axis, step, last) in
        [(Plane::Axial, 2, 2.0, 339.0), (Plane::Coronal, 1, 1.5, 229.25), (Plane::Sagittal, 0, 1.0, 119.5)]
    {
        let mut harness = radiological(plane);
        let pos = offset_from_center(&harness, 30.0, 10.0);
        harness.hover_at(pos);
        harness.run();
        wheel(&mut harness, 1.0, Modifiers::NONE);
        let mut expected = [100.0, 200.0, 300.0];
        expected[axis] += step;
        assert_near(harness.state().cursor(), expected);
        wheel(&mut harness, -2.0, Modifiers::NONE);
        expected[axis] -= 2.0 * step;
        assert_near(harness.state().cursor(), expected);
        wheel(&mut harness, 1000.0, Modifiers::NONE);
        expected[axis] = last;
        assert_near(harness.state().cursor(), expected);
    }
}

#[test]
fn zooming_keeps_the_point_under_the_pointer() {
    let mut harness = radiological(Plane::Axial);
    let pos = offset_from_center(&harness, 60.0, -40.0);
    harness.hover_at(pos);
    harness.run();
    wheel(&mut harness, 3.0, Modifiers::CTRL);
    let nav = &harness.state().work.doc.as_ref().unwrap().nav;
    assert!(nav.mm_per_point.unwrap() < 0.45, "{:?}", nav.mm_per_point);
    press(&mut harness, pos, PointerButton::Primary, true);
    press(&mut harness, pos, PointerButton::Primary, false);
    assert_near(harness.state().cursor(), [70.0, 220.0, 300.0]);
}

#[test]
fn panning_moves_the_slice_with_the_pointer_and_a_double_click_resets_it() {
    let mut harness = radiological(Plane::Sagittal);
    let from = offset_from_center(&harness, 0.0, 0.0);
    drag(&mut harness, from, vec2(24.0, -16.0), PointerButton::Middle);
    assert_near(harness.state().cursor(), [100.0, 200.0, 300.0]);
    let pos = from + vec2(24.0, -16.0);
    press(&mut harness, pos, PointerButton::Primary, true);
    press(&mut harness, pos, PointerButton::Primary, false);
    assert_near(harness.state().cursor(), [100.0, 200.0, 300.0]);
    press(&mut harness, pos, PointerButton::Primary, true);
    press(&mut harness, pos, PointerButton::Primary, false);
    harness.run();
    let nav = &harness.state().work.doc.as_ref().unwrap().nav;
    assert_eq!((nav.mm_per_point, nav.pan_mm), (None, [glam::DVec2::ZERO; 3]));
}

#[test]
fn keys_move_by_slices_and_voxels() {
    let mut harness = radiological(Plane::Axial);
    harness.hover_at(offset_from_center(&harness, 5.0, 5.0));
    harness.run();
    harness.key_press(Key::PageUp);
    harness.run();
    assert_near(harness.state().cursor(), [100.0, 200.0, 302.0]);
    // Right on the screen is the patient's left; up is anterior.
    harness.key_press(Key::ArrowRight);
    harness.run();
    harness.key_press(Key::ArrowUp);
    harness.run();
    assert_near(harness.state().cursor(), [99.0, 201.5, 302.0]);
}

#[test]
fn the_accessible_readout_gives_position_value_and_masks() {
    let mut harness = radiological(Plane::Axial);
    harness.state_mut().work.doc.as_mut().unwrap().nav.cursor_mm = DVec3::new(90.0, 210.0, 300.0);
    harness.run();
    let expected = "Axial slice S 300.0 mm: R 90.0  A 210.0  S 300.0 mm  ·  T1c 10  ·  left + front";
    harness.get_by_label(expected);
    apply(&mut harness, EditCommand::SetRegion(0b11, false));
    harness.run();
    harness.get_by_label(&format!("{expected} (hidden)"));
    harness.state_mut().work.doc.as_mut().unwrap().nav.cursor_mm.x = 500.0;
    harness.run();
    harness.get_by_label_contains("outside T1c");
}

#[test]
fn unknown_sides_are_not_named() {
    let mut harness = slice_harness(Plane::Coronal, Sides::Unknown, Convention::Radiological);
    harness.state_mut().work.doc.as_mut().unwrap().nav.cursor_mm = DVec3::new(100.2, 200.2, 300.2);
    harness.run();
    harness.get_by_label("Coronal slice +200.2 mm: x 100.2  y 200.2  z 300.2 mm  ·  T1c 20  ·  front");
}

#[test]
fn a_slice_is_rendered_again_only_when_it_changed() {
    let mut harness = radiological(Plane::Axial);
    let first = draws(&harness);
    harness.run_steps(5);
    harness.hover_at(offset_from_center(&harness, 3.0, 3.0));
    harness.run();
    // Moving the crosshair within the plane doesn't change the slice.
    harness.state_mut().work.doc.as_mut().unwrap().nav.cursor_mm.x += 7.0;
    harness.run();
    assert_eq!(draws(&harness), first);
    for command in [
        Command::from(EditCommand::SetRegion(1, false)),
        EditCommand::SetOverlayOpacity(0.9).into(),
        EditCommand::SetWindow("T1c".into(), Window { low: 3.0, high: 9.0 }).into(),
        LookCommand::SetCursor(DVec3::new(100.0, 200.0, 310.0)).into(),
        LookCommand::SetContext(None).into(),
    ] {
        let before = draws(&harness);
        apply(&mut harness, command.clone());
        harness.run();
        assert_eq!(draws(&harness), before + 1, "{command:?}");
    }
}

/// The texts drawn in the last frame, without their halos, and where each is.
fn texts(harness: &Harness<'_, TestView>) -> Vec<(String, Rect)> {
    fn collect(shape: &egui::Shape, found: &mut Vec<(String, Rect)>) {
        match shape {
            egui::Shape::Text(text) if text.override_text_color != Some(crate::theme::EDGE) => {
                let rect = text.galley.rect.translate(text.pos.to_vec2());
                found.push((text.galley.text().to_owned(), rect));
            }
            egui::Shape::Vec(all) => all.iter().for_each(|shape| collect(shape, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    harness.output().shapes.iter().for_each(|clipped| collect(&clipped.shape, &mut found));
    found
}

/// From the narrowest cell side by side to a large pane: no text lies on another or beyond the pane, and plane, place and sides
/// are named.
#[test]
fn texts_of_a_slice_of_any_size_lie_apart() {
    for plane in Plane::ALL {
        let mut harness = slice_harness(plane, Sides::Known, Convention::Radiological);
        for size in
            [[120.0, 150.0], [150.0, 150.0], [160.0, 280.0], [200.0, 130.0], [250.0, 400.0], [900.0, 700.0]]
        {
            harness.set_size(size.into());
            harness.run();
            let (all, pane) = (texts(&harness), harness.state().rect);
            assert!(all.iter().any(|(text, _)| text.starts_with(plane.name())), "{size:?} {all:?}");
            assert!(
                all.iter().filter(|(text, _)| text.chars().count() == 1).count() == 4,
                "{size:?} {all:?}"
            );
            for (n, (text, rect)) in all.iter().enumerate() {
                assert!(pane.expand(0.5).contains_rect(*rect), "{size:?}: {text:?} at {rect:?} in {pane:?}");
                for (other, beside) in &all[..n] {
                    assert!(
                        !rect.shrink(1.0).intersects(*beside),
                        "{plane:?} {size:?}: {text:?} on {other:?}"
                    );
                }
            }
        }
    }
}
