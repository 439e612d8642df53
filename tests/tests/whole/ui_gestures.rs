//! Gestures whose events arrive within one frame, as they do while a frame takes long: nothing is lost, and each acts
//! where and with which keys it was made.

use egui::{Event, Key, Modifiers, MouseWheelUnit, PointerButton, Pos2, Rect, vec2};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{EditCommand, LookCommand},
    model::PaneId,
};
use glioscope_render::TransferPreset;
use glioscope_tests::{Window, doc, maximized, perform, sample};

fn rect(harness: &Window, pane: PaneId) -> Rect {
    harness.state().pane_rect(pane).unwrap()
}

/// All events in one frame, then frames until the window is idle.
fn in_one_frame(harness: &mut Window, events: impl IntoIterator<Item = Event>) {
    harness.input_mut().events.extend(events);
    harness.run_ok();
}

fn button(pos: Pos2, pressed: bool, modifiers: Modifiers) -> Event {
    Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers }
}

/// Moves to `from`, presses, moves to `to` and releases, with `modifiers` held until just after the press.
fn drag(from: Pos2, to: Pos2, modifiers: Modifiers) -> [Event; 6] {
    [
        Event::ModifiersChanged(modifiers),
        Event::PointerMoved(from),
        button(from, true, modifiers),
        Event::ModifiersChanged(Modifiers::NONE),
        Event::PointerMoved(to),
        button(to, false, Modifiers::NONE),
    ]
}

fn key(key: Key, pressed: bool, modifiers: Modifiers) -> Event {
    Event::Key { key, physical_key: None, pressed, repeat: false, modifiers }
}

#[test]
fn a_whole_drag_within_one_frame_is_a_drag() {
    let mut harness = sample();
    let camera = doc(&harness).nav.camera;
    let closeup = rect(&harness, PaneId::Closeup).center();
    in_one_frame(&mut harness, drag(closeup, closeup + vec2(60.0, 0.0), Modifiers::NONE));
    let turned = doc(&harness).nav.camera;
    // As Camera::turn has it for the same motion.
    let mut expected = camera;
    let height = rect(&harness, PaneId::Closeup).height();
    expected.turn(glam::DVec2::new(f64::from(60.0 / height), 0.0));
    for (found, expected) in turned.axes().into_iter().zip(expected.axes()) {
        assert!(found.distance(expected) < 1e-6, "{found} {expected}");
    }

    perform(&mut harness, LookCommand::SetSliceZoom(Some(0.5)));
    perform(&mut harness, LookCommand::ToggleRuler);
    let from = rect(&harness, PaneId::Axial).center() - vec2(30.0, 20.0);
    in_one_frame(&mut harness, drag(from, from + vec2(60.0, 80.0), Modifiers::NONE));
    let rulers = &doc(&harness).edit.rulers;
    assert_eq!(rulers.len(), 1);
    // 30 mm and 40 mm at right angles.
    assert!((rulers[0].length_mm() - 50.0).abs() < 1e-3, "{}", rulers[0].length_mm());
}

#[test]
fn the_keys_held_at_the_press_decide_what_a_drag_does() {
    let mut harness = sample();
    let (lens, camera) = (doc(&harness).edit.lens, doc(&harness).nav.camera);
    let closeup = rect(&harness, PaneId::Closeup);
    let corner = closeup.right_top() + vec2(-15.0, 15.0);
    in_one_frame(&mut harness, drag(corner + vec2(0.0, 12.0), corner, Modifiers::COMMAND));
    assert_ne!(doc(&harness).edit.lens.center_mm, lens.center_mm, "Ctrl moves the lens");
    assert_eq!(doc(&harness).nav.camera.world_from_camera, camera.world_from_camera);
    // A ruler switched on just before the press.
    let from = rect(&harness, PaneId::Axial).center();
    let events = [key(Key::M, true, Modifiers::NONE), key(Key::M, false, Modifiers::NONE)];
    in_one_frame(&mut harness, events.into_iter().chain(drag(from, from + vec2(30.0, 0.0), Modifiers::NONE)));
    assert_eq!(doc(&harness).edit.rulers.len(), 1);
}

#[test]
fn alt_and_wheel_change_the_radius_alone_when_alt_is_released_at_once() {
    let mut harness = sample();
    let (lens, camera) = (doc(&harness).edit.lens, doc(&harness).nav.camera);
    harness.hover_at(rect(&harness, PaneId::Closeup).center());
    harness.run_ok();
    let wheel = |lines: f32, modifiers: Modifiers| Event::MouseWheel {
        unit: MouseWheelUnit::Line,
        delta: vec2(0.0, lines),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Wheel,
        modifiers,
    };
    let events = [
        Event::ModifiersChanged(Modifiers::ALT),
        wheel(1.0, Modifiers::ALT),
        wheel(1.0, Modifiers::ALT),
        Event::ModifiersChanged(Modifiers::NONE),
    ];
    in_one_frame(&mut harness, events);
    harness.run_steps(60);
    // 0.3 % per point, 40 points per line.
    let expected_mm = lens.radius_mm * (0.003_f64 * 80.0).exp();
    let found_mm = doc(&harness).edit.lens.radius_mm;
    assert!((found_mm - expected_mm).abs() < 1e-4, "{found_mm} {expected_mm}");
    assert_eq!(doc(&harness).nav.camera, camera, "nothing of it zooms");
    in_one_frame(&mut harness, [wheel(1.0, Modifiers::NONE)]);
    harness.run_steps(60);
    assert!(doc(&harness).nav.camera.height_mm < camera.height_mm);
    assert_eq!(doc(&harness).edit.lens.radius_mm, found_mm);
}

#[test]
fn a_control_point_is_dragged_from_where_it_was_pressed() {
    let mut harness = sample();
    let (id, start, range) = {
        let state = harness.state();
        let (id, image) = state.work.world.context(doc(&harness)).unwrap();
        let preset = TransferPreset::first_for(image.histogram(), id);
        (id.to_owned(), preset.transfer(image.histogram()), image.histogram().range().unwrap())
    };
    // Two points far apart; the pointer is near the second when the drag of the first is recognised.
    maximized(&mut harness, PaneId::Transfer);
    let plot = harness.get_by_label("Opacity of each value").rect();
    let pos = |value: f64, opacity: f64| {
        let share = ((value - range.0) / (range.1 - range.0)) as f32;
        egui::pos2(plot.left() + share * plot.width(), plot.bottom() - opacity.sqrt() as f32 * plot.height())
    };
    let places: Vec<Pos2> = start.points().iter().map(|p| pos(p.value, p.opacity)).collect();
    let alone = |n: &usize| {
        let others = places.iter().enumerate().filter(|(m, _)| m != n);
        others.map(|(_, other)| other.distance(places[*n])).fold(f32::INFINITY, f32::min) > 25.0
    };
    let first = (0..places.len()).find(alone).expect("a point that stands alone");
    let other = (0..places.len())
        .filter(|n| *n != first)
        .max_by(|a, b| places[*a].distance(places[first]).total_cmp(&places[*b].distance(places[first])));
    let to = places[other.unwrap()] + vec2(0.0, 3.0);
    in_one_frame(&mut harness, drag(places[first], to, Modifiers::NONE));
    let found = doc(&harness).edit.transfers.get(&id).unwrap().points();
    assert_eq!(found.len(), start.points().len());
    let unchanged = start.points().iter().filter(|p| found.contains(p)).count();
    assert_eq!(unchanged, start.points().len() - 1, "one point moved");
    assert!(!found.contains(&start.points()[first]), "the one pressed: {found:?}");
}

#[test]
fn every_press_of_a_key_counts() {
    let mut harness = sample();
    let press = |k: Key, modifiers| [key(k, true, modifiers), key(k, false, modifiers)];
    let lens_on = doc(&harness).edit.lens_on;
    let twice = press(Key::L, Modifiers::NONE).into_iter().chain(press(Key::L, Modifiers::NONE));
    in_one_frame(&mut harness, twice);
    assert_eq!(doc(&harness).edit.lens_on, lens_on, "on and off");
    let radius_mm = doc(&harness).edit.lens.radius_mm;
    for bits in [1, 2] {
        perform(&mut harness, EditCommand::ToggleRegion(bits));
    }
    let undo = || press(Key::Z, Modifiers::COMMAND);
    in_one_frame(&mut harness, undo().into_iter().chain(undo()));
    let work = &harness.state().work;
    assert!(work.world.selection(doc(&harness)).shows(1) && work.world.selection(doc(&harness)).shows(2));
    assert_eq!(doc(&harness).edit.lens.radius_mm, radius_mm);
}

#[test]
fn rows_of_the_lens_table_hide_their_region() {
    let mut harness = sample();
    maximized(&mut harness, PaneId::Lens);
    harness.get_by_label("T2 only").click();
    harness.run_ok();
    assert!(harness.query_by_label("T2 only (hidden)").is_some());
    let all = {
        let state = harness.state();
        state.work.world.time_point(doc(&harness)).unwrap().regions.list().to_vec()
    };
    let hidden: Vec<u32> = all
        .iter()
        .map(|r| r.bits)
        .filter(|b| !harness.state().work.world.selection(doc(&harness)).shows(*b))
        .collect();
    assert_eq!(hidden.len(), 1);
    assert_eq!(hidden[0].count_ones(), 1);
}
