//! Light through the window: chosen, undone, saved, drawn as drafts within the budget while something moves
//! and as the reference when still; the diagnostics say how far off it is likely to be.

use std::time::Instant;

use egui::Theme;
use egui_kittest::{Harness, kittest::Queryable};
use glioscope::{
    command::{AppCommand, Command, EditCommand, LookCommand},
    model::{CaseRef, LightChoice, PaneId, session},
    views::{context::ContextPane, view3d::ScreenReport},
    window::GlioscopeApp,
};
use glioscope_core::optics::Camera;
use glioscope_render::{LightingMode, Preset, Quality, light as lights};
use glioscope_tests::{Window, drafting_window_on, issue, maximized, perform, window_on};

fn light(harness: &Harness<'_, GlioscopeApp>) -> LightChoice {
    harness.state().work.doc.as_ref().unwrap().edit.light
}

#[test]
fn light_is_chosen_in_the_menu_undone_and_saved() {
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
    let expected =
        LightChoice { mode: LightingMode::Cones, preset: Some(Preset::Draft), aperture_deg: 40.0, own: None };
    assert_eq!(light(&harness), expected);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().edit.light, expected);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(light(&harness).aperture_deg, LightChoice::default().aperture_deg);
    perform(&mut harness, EditCommand::Undo);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(light(&harness), LightChoice::default());
}

fn context<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> &'a ContextPane {
    harness.state().panes.get(PaneId::Context).unwrap()
}

/// A picture of pane and what drew it.
fn drawn(harness: &Harness<'_, GlioscopeApp>) -> (Quality, [u32; 2]) {
    let screen = &context(harness).canvas.screen;
    (*screen.quality().unwrap(), screen.plan().unwrap().1)
}

#[test]
fn a_moving_picture_is_a_draft_and_a_still_one_the_reference() {
    let mut harness = drafting_window_on(CaseRef::Sample, [420.0, 360.0]);
    maximized(&mut harness, PaneId::Context);
    let turn = |harness: &mut Window, degrees: f64| {
        let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
        camera.world_from_camera = Camera::orientation(degrees, 15.0);
        issue(harness, LookCommand::SetCamera(camera));
        harness.step();
    };
    issue(&mut harness, EditCommand::SetLightingMode(LightingMode::Cones));
    for n in 0..6 {
        turn(&mut harness, 10.0 * f64::from(n));
        let (quality, _) = drawn(&harness);
        assert!(quality.cost.unwrap() <= 1.0, "{quality:?}");
        assert_eq!(quality.lighting.mode, LightingMode::Cones);
    }
    // Time passes in the harness by a quarter of a second a step at most, and pictures come in parts.
    let reference = LightChoice { mode: LightingMode::Cones, ..LightChoice::default() }
        .at(lights::preset(LightingMode::Cones, Preset::Reference));
    let mut steps = 0;
    while drawn(&harness).0 != reference {
        harness.step();
        steps += 1;
        assert!(steps < 3000, "{:?}", drawn(&harness));
    }
    let (_, size) = drawn(&harness);
    assert!(size[0] > 300, "all pixels: {size:?}");
    // A preset of one's own holds whether something moves or not.
    issue(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    turn(&mut harness, 77.0);
    let draft = lights::preset(LightingMode::Cones, Preset::Draft);
    assert_eq!(drawn(&harness).0, draft);
    for _ in 0..20 {
        harness.step();
    }
    assert_eq!(drawn(&harness).0, draft);
}

#[test]
fn diagnostics_say_how_far_off_the_light_is() {
    let mut harness = window_on(CaseRef::Sample, [1100.0, 900.0], Theme::Light);
    perform(&mut harness, EditCommand::TogglePane(PaneId::Diagnostics));
    harness.get_all_by_label_contains("Expected error: unknown").next().unwrap();
    perform(&mut harness, EditCommand::SetPreset(Some(Preset::Draft)));
    perform(&mut harness, EditCommand::SetLightingMode(LightingMode::Cones));
    let draft = lights::preset(LightingMode::Cones, Preset::Draft);
    let [surfaces, tissue] = lights::expected_error(&draft).unwrap();
    let words = format!("Expected error: {surfaces:.3} of white on opaque surfaces, {tissue:.3} in tissue");
    harness.get_all_by_label_contains(&words).next().unwrap();
}

/// The finer picture comes in parts: the window shows the draft meanwhile, a turned camera drops the rest, and what
/// stands at the end is the picture that is drawn at once.
fn a_still_picture_comes_in_parts(mode: LightingMode) -> String {
    let mut harness = drafting_window_on(CaseRef::Sample, [420.0, 360.0]);
    maximized(&mut harness, PaneId::Context);
    let share = |harness: &Harness<'_, GlioscopeApp>| context(harness).canvas.screen.share_done();
    let turn = |harness: &mut Window, degrees: f64| {
        let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
        camera.world_from_camera = Camera::orientation(degrees, 15.0);
        issue(harness, LookCommand::SetCamera(camera));
        harness.step();
    };
    issue(&mut harness, EditCommand::SetLightingMode(mode));
    let (mut waited, mut longest_ms) = (0, 0.0f64);
    let until_coming = |harness: &mut Window| {
        let mut steps = 0;
        while share(harness).is_none() {
            assert!(steps < 20, "a finer picture is begun");
            harness.step();
            steps += 1;
        }
    };
    turn(&mut harness, 10.0);
    until_coming(&mut harness);
    let (draft, _) = drawn(&harness);
    assert!(draft.cost.unwrap() <= 1.0);
    // Turned while it is drawn: the rest is dropped, the draft of what is seen now is shown.
    turn(&mut harness, 50.0);
    assert_eq!(share(&harness), None, "nothing is under way any more");
    assert!(drawn(&harness).0.cost.unwrap() <= 1.0);
    let drafts = |harness: &Harness<'_, GlioscopeApp>| context(harness).canvas.screen.frames_drawn();
    let before = drafts(&harness);
    until_coming(&mut harness);
    assert_eq!(drafts(&harness), before, "no picture of the first camera comes in between");
    let reference =
        LightChoice { mode, ..LightChoice::default() }.at(lights::preset(mode, Preset::Reference));
    while drawn(&harness).0 != reference {
        let begin = Instant::now();
        let before = drawn(&harness).0;
        harness.step();
        if drawn(&harness).0 == before {
            longest_ms = longest_ms.max(begin.elapsed().as_secs_f64() * 1e3);
        }
        waited += 1;
        assert!(waited < 3000, "it is finished");
    }
    assert!(waited > 4, "in parts: {waited}");
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
    assert_eq!(share(&whole), None, "at once");
    assert_eq!(drawn(&whole).0, reference);
    assert!(pixels(&whole) == found, "the same pixels");
    format!("{waited} steps of the window, the longest {longest_ms:.0} ms")
}

#[test]
fn a_still_picture_by_slices_comes_in_parts_and_the_window_goes_on() {
    println!("{}", a_still_picture_comes_in_parts(LightingMode::Slices));
}

#[test]
fn a_still_picture_by_cones_comes_in_parts_and_the_window_goes_on() {
    println!("{}", a_still_picture_comes_in_parts(LightingMode::Cones));
}
