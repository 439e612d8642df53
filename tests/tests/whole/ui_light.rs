//! Lighting in the window: chosen, undone and saved; drafts within the time budget while something moves, the reference
//! when still; its expected error in the diagnostics.

use std::time::Instant;

use egui::{Key, Role, Theme};
use egui_kittest::{Harness, kittest::Queryable};
use glioscope::{
    command::{AppCommand, Command, EditCommand, LookCommand},
    model::{CaseRef, LightChoice, PaneId, Shading, session},
    views::{context::ContextPane, view3d::ScreenReport},
    window::GlioscopeApp,
};
use glioscope_core::optics::Camera;
use glioscope_render::{Knob, Lamp, LampFrame, LightingMode, Preset, Quality, light as lights};
use glioscope_tests::{
    MASK_COLORS, Window, count_color, drafting_window_on, issue, maximized, pane_picture, perform,
    wait_for_workers, window_on,
};
use strum::VariantArray;

fn light(harness: &Harness<'_, GlioscopeApp>) -> LightChoice {
    harness.state().work.doc.as_ref().unwrap().edit.light
}

#[test]
fn the_lighting_mode_is_chosen_in_the_menu_undone_and_saved() {
    let mut harness = window_on(CaseRef::Sample, [900.0, 700.0], Theme::Light);
    assert_eq!(light(&harness), LightChoice::default());
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    let cones = Command::from(EditCommand::SetLightingMode(LightingMode::Cones)).text();
    harness.get_by_label(&cones).click();
    harness.run_ok();
    assert_eq!(light(&harness).mode, LightingMode::Cones);
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    perform(&mut harness, EditCommand::SetAperture(40.0));
    let shading = Shading { ambient_share: Some(0.1), occlusion_radius_mm: Some(4.0), ..Shading::default() };
    perform(&mut harness, EditCommand::SetShading(Box::new(shading)));
    let expected = LightChoice {
        shading,
        mode: LightingMode::Cones,
        preset: Some(Preset::Draft),
        aperture_deg: 40.0,
        ..LightChoice::default()
    };
    assert_eq!(light(&harness), expected);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.light, expected);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(light(&harness).shading, Shading::default());
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(light(&harness).aperture_deg, LightChoice::default().aperture_deg);
    perform(&mut harness, EditCommand::Undo);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(light(&harness), LightChoice::default());
}

#[test]
fn the_lamp_is_placed_in_the_menu_undone_and_saved() {
    let mut harness = window_on(CaseRef::Sample, [1000.0, 800.0], Theme::Light);
    // Frames are drawn at each step.
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    // The advice is that of the lighting mode chosen.
    assert!(harness.query_by_label_contains("Liked best").is_some());
    let lamp = Command::from(EditCommand::SetLightingMode(LightingMode::HalfAngle)).text();
    harness.get_by_label(&lamp).click();
    harness.run_ok();
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    assert!(harness.query_by_label_contains("absolute depth").is_some());
    for label in ["Lamp to the right", "Lamp upwards"] {
        harness.get_by_role_and_label(Role::Slider, label).focus();
        harness.run_ok();
        harness.key_press(Key::ArrowRight);
        harness.run_ok();
    }
    harness.get_by_label("Lamp stays with the patient").click();
    harness.run_ok();
    let placed = light(&harness).lamp;
    assert_eq!(placed.frame, LampFrame::Patient);
    assert!(placed.azimuth_deg > Lamp::DEFAULT.azimuth_deg, "{placed:?}");
    assert!(placed.elevation_deg > Lamp::DEFAULT.elevation_deg, "{placed:?}");
    let quality = light(&harness).at_rest();
    assert_eq!((quality.lighting.mode, quality.lighting.lamp), (LightingMode::HalfAngle, placed));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.light.lamp, placed);
    // Sessions from before there was a lamp have it where it stands first.
    let mut json: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let light_json = json.pointer_mut("/document/edit/light").unwrap().as_object_mut().unwrap();
    assert!(light_json.remove("lamp").is_some());
    let old = folder.path().join("old.glioscope.json");
    std::fs::write(&old, serde_json::to_vec(&json).unwrap()).unwrap();
    assert_eq!(session::load(&old).unwrap().document.edit.light.lamp, Lamp::DEFAULT);
    // A cone of light points to it on request.
    perform(&mut harness, EditCommand::SetLightingMode(LightingMode::Cones));
    assert!(!light(&harness).has_lamp());
    // The menu is still open.
    harness.get_by_label("Light from the lamp").click();
    harness.run_ok();
    assert!(light(&harness).has_lamp() && light(&harness).at_rest().lighting.towards_lamp);
    // One step or several, by how quickly they followed each other.
    while harness.state().work.history.can_undo() {
        perform(&mut harness, EditCommand::Undo);
    }
    assert_eq!((light(&harness).lamp, light(&harness).towards_lamp), (Lamp::DEFAULT, false));
}

#[test]
fn shading_is_set_in_the_menu_and_put_back() {
    let mut harness = window_on(CaseRef::Sample, [1000.0, 800.0], Theme::Light);
    harness.run_ok();
    let before = pane_picture(&mut harness, PaneId::Closeup);
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    for (label, key) in [("Ambient light", Key::ArrowRight), ("Relief", Key::ArrowLeft)] {
        harness.get_by_role_and_label(Role::Slider, label).focus();
        harness.run_ok();
        harness.key_press(key);
        harness.run_ok();
    }
    harness.get_by_label("Smooth surface").click();
    harness.run_ok();
    let shading = light(&harness).shading;
    assert!(shading.ambient_share.is_some_and(|share| share > 0.0), "{shading:?}");
    assert!(shading.relief.is_some_and(|relief| relief < 1.0) && shading.smooth, "{shading:?}");
    harness.get_by_label("Shading as the lighting mode has it").click();
    harness.run_ok();
    harness.key_press(Key::Escape);
    harness.run_ok();
    assert_eq!(light(&harness).shading, Shading::default());
    assert_eq!(pane_picture(&mut harness, PaneId::Closeup), before);
    // All of the light ambient leaves no occlusion, no relief leaves flat colours: the cut of T1 has its colour.
    let flat = Shading { ambient_share: Some(1.0), relief: Some(0.0), ..Shading::default() };
    perform(&mut harness, EditCommand::SetShading(Box::new(flat)));
    let flat = pane_picture(&mut harness, PaneId::Closeup);
    let pure = |picture: &_| count_color(picture, MASK_COLORS[0], 2);
    assert!(pure(&flat) > 1000 + pure(&before), "{} of {}", pure(&before), pure(&flat));
}

/// Sliders of settings that only some modes have: those of the chosen one, from the table of lights; put back with the rest.
/// `GLIOSCOPE_TEST_PICTURES=FOLDER` writes pictures of the menus, `GLIOSCOPE_TEST_DARK=1` dark ones.
#[test]
fn the_menu_has_the_settings_of_the_chosen_mode() {
    let theme = if std::env::var_os("GLIOSCOPE_TEST_DARK").is_some() { Theme::Dark } else { Theme::Light };
    let mut harness = window_on(CaseRef::Sample, [1000.0, 800.0], theme);
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    maximized(&mut harness, PaneId::Axial);
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    for row in &lights::LIGHTS {
        perform(&mut harness, EditCommand::SetLightingMode(row.mode));
        for &knob in Knob::VARIANTS {
            let found = harness.query_by_role_and_label(Role::Slider, knob.row().label);
            assert_eq!(found.is_some(), row.knobs.contains(&knob), "{:?} {knob:?}", row.mode);
        }
        harness.run_ok();
        if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
            let file = format!("light-menu-{}-{theme:?}.png", row.mode.name());
            harness.render().unwrap().save(std::path::Path::new(&folder).join(file)).unwrap();
        }
        let Some(&knob) = row.knobs.first() else { continue };
        let before = knob.of(&light(&harness).at_rest().lighting);
        harness.get_by_role_and_label(Role::Slider, knob.row().label).focus();
        harness.run_ok();
        let is_most = before == *knob.row().range.end();
        harness.key_press(if is_most { Key::ArrowLeft } else { Key::ArrowRight });
        harness.run_ok();
        let after = knob.of(&light(&harness).at_rest().lighting);
        assert!(if is_most { after < before } else { after > before }, "{:?} {knob:?}: {after}", row.mode);
    }
    assert!(light(&harness).shading.knobs.given().count() > 3);
    harness.get_by_label("Shading as the lighting mode has it").click();
    harness.run_ok();
    assert_eq!(light(&harness).shading, Shading::default());
}

fn context<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> &'a ContextPane {
    harness.state().panes.get(PaneId::Context).unwrap()
}

/// Quality and size in pixels of the context view's last frame.
fn drawn(harness: &Harness<'_, GlioscopeApp>) -> (Quality, [u32; 2]) {
    let screen = &context(harness).canvas.screen;
    (*screen.quality().unwrap(), screen.plan().unwrap().1)
}

#[test]
fn moving_views_draw_drafts_and_still_views_the_reference() {
    let mut harness = drafting_window_on(CaseRef::Sample, [420.0, 360.0]);
    maximized(&mut harness, PaneId::Context);
    let rotate = |harness: &mut Window, degrees: f64| {
        let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
        camera.world_from_camera = Camera::orientation(degrees, 15.0);
        issue(harness, LookCommand::SetCamera(camera));
        harness.step();
    };
    issue(&mut harness, EditCommand::SetLightingMode(LightingMode::Cones));
    for n in 0..6 {
        rotate(&mut harness, 10.0 * f64::from(n));
        let (quality, _) = drawn(&harness);
        assert!(quality.cost.unwrap() <= 1.0, "{quality:?}");
        assert_eq!(quality.lighting.mode, LightingMode::Cones);
    }
    // The harness advances time by at most 0.25 s per step, and the reference takes several steps.
    let reference = LightChoice { mode: LightingMode::Cones, ..LightChoice::default() }
        .at(lights::preset(LightingMode::Cones, Preset::Reference));
    let mut steps = 0;
    while drawn(&harness).0 != reference {
        harness.step();
        steps += 1;
        assert!(steps < 3000, "{:?}", drawn(&harness));
    }
    let (_, size) = drawn(&harness);
    assert!(size[0] > 300, "full resolution: {size:?}");
    // A chosen preset applies whether something moves or not.
    issue(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    rotate(&mut harness, 77.0);
    let draft = lights::preset(LightingMode::Cones, Preset::Draft);
    assert_eq!(drawn(&harness).0, draft);
    for _ in 0..20 {
        harness.step();
    }
    assert_eq!(drawn(&harness).0, draft);
}

#[test]
fn diagnostics_report_the_expected_lighting_error() {
    let mut harness = window_on(CaseRef::Sample, [1100.0, 900.0], Theme::Light);
    perform(&mut harness, EditCommand::TogglePane(PaneId::Diagnostics));
    // Rays through the masks, as many as at rest.
    let traced = lights::preset(LightingMode::Traced, Preset::Reference);
    let [tumor, folds] = lights::occlusion_error(&traced).unwrap();
    let text = format!("the occlusion in the closeup: {tumor:.3} of the light, {folds:.3} in deep folds");
    harness.get_all_by_label_contains(&text).next().unwrap();
    perform(&mut harness, EditCommand::SetLightingMode(LightingMode::ScreenSpace));
    harness.get_all_by_label_contains("Expected error: unknown").next().unwrap();
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    perform(&mut harness, EditCommand::SetLightingMode(LightingMode::Cones));
    let draft = lights::preset(LightingMode::Cones, Preset::Draft);
    let [surfaces, tissue] = lights::expected_error(&draft).unwrap();
    let text = format!(
        "Expected error of the picture: {surfaces:.3} of white on opaque surfaces, {tissue:.3} in tissue"
    );
    harness.get_all_by_label_contains(&text).next().unwrap();
}

/// In a window that is too low for the longest menu it scrolls within the window: its first entry is seen at first, its last
/// button after scrolling, and can be clicked.
#[test]
fn the_menu_of_light_scrolls_in_a_low_window() {
    let height = 600.0;
    let mut harness = window_on(CaseRef::Sample, [1000.0, height], Theme::Light);
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    maximized(&mut harness, PaneId::Axial);
    perform(&mut harness, EditCommand::SetLightingMode(LightingMode::PathTraced));
    let shading = Shading { ambient_share: Some(0.3), ..Shading::default() };
    perform(&mut harness, EditCommand::SetShading(Box::new(shading)));
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    let within = 0.0..=height;
    let [first, last] = [
        Command::from(EditCommand::SetLightingMode(LightingMode::VARIANTS[0])).text(),
        "Shading as the lighting mode has it".to_owned(),
    ];
    let bounds = |harness: &Harness<'_, GlioscopeApp>, label: &str| harness.get_by_label(label).rect();
    let seen = bounds(&harness, &first);
    assert!(within.contains(&seen.top()) && within.contains(&seen.bottom()), "{seen}");
    assert!(bounds(&harness, &last).bottom() > height, "the menu is longer than the window");
    harness.hover_at(seen.center());
    harness.run_ok();
    harness.event(egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, -1000.0),
        phase: egui::TouchPhase::Move,
        modifiers: egui::Modifiers::NONE,
        source: egui::MouseWheelSource::Wheel,
    });
    harness.run_ok();
    let seen = bounds(&harness, &last);
    assert!(within.contains(&seen.top()) && within.contains(&seen.bottom()), "{seen}");
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        harness.render().unwrap().save(std::path::Path::new(&folder).join("light-menu-low.png")).unwrap();
    }
    harness.get_by_label(&last).click();
    harness.run_ok();
    assert_eq!(light(&harness).shading, Shading::default());
}

/// The right button turns the lamp where there is one, and never the camera; one drag is one undo.
#[test]
fn the_lamp_is_dragged_in_the_picture() {
    let mut harness = window_on(CaseRef::Sample, [900.0, 700.0], Theme::Light);
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    maximized(&mut harness, PaneId::Context);
    let pane = harness.state().pane_rect(PaneId::Context).unwrap();
    let camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
    let drag = |harness: &mut Window| {
        let button = |pressed, pos| egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Secondary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
        let (from, to) = (pane.center(), pane.center() + pane.height() * egui::vec2(0.25, -0.1));
        harness.hover_at(from);
        harness.run_steps(1);
        harness.event(button(true, from));
        harness.run_steps(1);
        for step in 1..=5_u8 {
            harness.hover_at(from + (to - from) * (f32::from(step) / 5.0));
            harness.run_steps(1);
        }
        harness.event(button(false, to));
        harness.run_ok();
    };
    drag(&mut harness);
    assert_eq!(light(&harness), LightChoice { preset: Some(Preset::Draft), ..LightChoice::default() });
    perform(&mut harness, EditCommand::SetLightingMode(LightingMode::SphericalHarmonics));
    drag(&mut harness);
    let lamp = light(&harness).lamp;
    // A quarter of the view's height is an eighth of a turn.
    assert!((lamp.azimuth_deg - Lamp::DEFAULT.azimuth_deg - 45.0).abs() < 3.0, "{lamp:?}");
    assert!((lamp.elevation_deg - Lamp::DEFAULT.elevation_deg - 18.0).abs() < 2.0, "{lamp:?}");
    assert_eq!(harness.state().work.doc.as_ref().unwrap().nav.camera, camera);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(light(&harness).lamp, Lamp::DEFAULT);
}

/// The error of the frame that is shown: measured when asked for, and asked for again after the camera turned.
#[test]
fn diagnostics_measure_the_error_of_the_frame_shown() {
    const BUTTON: &str = "Measure the error of this frame: Closeup";
    let mut harness = window_on(CaseRef::Sample, [1100.0, 900.0], Theme::Dark);
    perform(&mut harness, EditCommand::TogglePane(PaneId::Diagnostics));
    harness.get_by_label("Measure the error of this frame: Context");
    harness.get_by_label(BUTTON).click();
    harness.run_ok();
    wait_for_workers(&mut harness);
    harness.get_by_label_contains("Measured in this frame: 0.0");
    assert!(harness.query_by_label(BUTTON).is_none());
    let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
    camera.world_from_camera = Camera::orientation(77.0, 15.0);
    perform(&mut harness, LookCommand::SetCamera(camera));
    assert!(harness.query_by_label_contains("Measured in this frame").is_none());
    harness.get_by_label(BUTTON);
}

/// The refined frame is drawn in parts: the window shows the draft meanwhile, rotating the camera drops the unfinished
/// frame, and the finished one equals a frame drawn in one call. Returns a line on the steps it took.
fn check_refinement_in_parts(mode: LightingMode) -> String {
    let mut harness = drafting_window_on(CaseRef::Sample, [420.0, 360.0]);
    maximized(&mut harness, PaneId::Context);
    let share = |harness: &Harness<'_, GlioscopeApp>| context(harness).canvas.screen.share_done();
    let rotate = |harness: &mut Window, degrees: f64| {
        let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
        camera.world_from_camera = Camera::orientation(degrees, 15.0);
        issue(harness, LookCommand::SetCamera(camera));
        harness.step();
    };
    issue(&mut harness, EditCommand::SetLightingMode(mode));
    let (mut window_steps, mut longest_step_ms) = (0, 0.0f64);
    let wait_until_begun = |harness: &mut Window| {
        let mut steps = 0;
        while share(harness).is_none() {
            assert!(steps < 20, "a refined frame is begun");
            harness.step();
            steps += 1;
        }
    };
    rotate(&mut harness, 10.0);
    wait_until_begun(&mut harness);
    let (draft, _) = drawn(&harness);
    assert!(draft.cost.unwrap() <= 1.0);
    // Rotated meanwhile: the unfinished frame is dropped and a draft from the new camera is shown.
    rotate(&mut harness, 50.0);
    assert_eq!(share(&harness), None, "no frame is in progress");
    assert!(drawn(&harness).0.cost.unwrap() <= 1.0);
    let frames_drawn = |harness: &Harness<'_, GlioscopeApp>| context(harness).canvas.screen.frames_drawn();
    let before = frames_drawn(&harness);
    wait_until_begun(&mut harness);
    assert_eq!(frames_drawn(&harness), before, "no frame of the first camera is shown in between");
    let reference =
        LightChoice { mode, ..LightChoice::default() }.at(lights::preset(mode, Preset::Reference));
    while drawn(&harness).0 != reference {
        let begin = Instant::now();
        let before = drawn(&harness).0;
        harness.step();
        if drawn(&harness).0 == before {
            longest_step_ms = longest_step_ms.max(begin.elapsed().as_secs_f64() * 1e3);
        }
        window_steps += 1;
        assert!(window_steps < 3000, "the refined frame is finished");
    }
    assert!(window_steps > 4, "drawn in several parts: {window_steps}");
    for _ in 0..5 {
        harness.step();
    }
    assert_eq!(share(&harness), None);
    let pixels = |harness: &Harness<'_, GlioscopeApp>| {
        let frame = context(harness).canvas.screen.frame().unwrap();
        frame.read_rgba(harness.state().gpu().unwrap()).unwrap()
    };
    let found = pixels(&harness);
    let mut whole = window_on(CaseRef::Sample, [420.0, 360.0], Theme::Light);
    maximized(&mut whole, PaneId::Context);
    let camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
    perform(&mut whole, EditCommand::SetLightingMode(mode));
    perform(&mut whole, LookCommand::SetCamera(camera));
    assert_eq!(share(&whole), None, "drawn in one call");
    assert_eq!(drawn(&whole).0, reference);
    assert!(pixels(&whole) == found, "the same pixels");
    format!("{window_steps} steps of the window, the longest {longest_step_ms:.0} ms")
}

#[test]
fn slices_are_refined_in_parts_while_the_window_keeps_running() {
    println!("{}", check_refinement_in_parts(LightingMode::Slices));
}

#[test]
fn cones_are_refined_in_parts_while_the_window_keeps_running() {
    println!("{}", check_refinement_in_parts(LightingMode::Cones));
}
