//! Light through the window: chosen, undone, saved, drawn as drafts within the budget while something moves
//! and as the reference when still; the diagnostics say how far off it is likely to be.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "in a test a failed unwrap is a failed test"
)]

use std::time::Instant;

use egui::Theme;
use egui_kittest::{Harness, kittest::Queryable};
use glioscope::{
    commands::Command,
    document::{CaseRef, Light, Pane},
    session,
    window::GlioscopeApp,
};
use glioscope_render::{Preset, Quality, Shading};
use glioscope_tests::{drafting_window_on, maximized, window_on};

fn perform(harness: &mut Harness<'_, GlioscopeApp>, command: &Command) {
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(&ctx, command, Instant::now());
    harness.run_ok();
}

fn light(harness: &Harness<'_, GlioscopeApp>) -> Light {
    harness.state().work.doc.as_ref().unwrap().edit.light
}

#[test]
fn light_is_chosen_in_the_menu_undone_and_saved() {
    let mut harness = window_on(CaseRef::Sample, [900.0, 700.0], Theme::Light);
    assert_eq!(light(&harness), Light::default());
    harness.get_by_label("View").click();
    harness.run_ok();
    harness.get_by_label_contains("Light and quality").click();
    harness.run_ok();
    let cones = Command::SetShading(Shading::Cones).text();
    harness.get_by_label(&cones).click();
    harness.run_ok();
    assert_eq!(light(&harness).shading, Shading::Cones);
    perform(&mut harness, &Command::SetPreset(Some(Preset::Draft)));
    perform(&mut harness, &Command::SetAperture(40.0));
    let expected =
        Light { shading: Shading::Cones, preset: Some(Preset::Draft), aperture_deg: 40.0, own: None };
    assert_eq!(light(&harness), expected);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.glioscope.json");
    perform(&mut harness, &Command::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().edit.light, expected);
    perform(&mut harness, &Command::Undo);
    assert_eq!(light(&harness).aperture_deg, Light::default().aperture_deg);
    perform(&mut harness, &Command::Undo);
    perform(&mut harness, &Command::Undo);
    assert_eq!(light(&harness), Light::default());
}

/// A picture of pane and what drew it.
fn drawn(harness: &Harness<'_, GlioscopeApp>) -> (Quality, [u32; 2]) {
    let viewport = harness.state().viewport.as_ref().unwrap();
    (*viewport.context.quality().unwrap(), viewport.context.plan().unwrap().1)
}

#[test]
fn a_moving_picture_is_a_draft_and_a_still_one_the_reference() {
    let mut harness = drafting_window_on(CaseRef::Sample, [420.0, 360.0]);
    maximized(&mut harness, Pane::Context);
    let ctx = harness.ctx.clone();
    let turn = |harness: &mut Harness<'_, GlioscopeApp>, degrees: f64| {
        let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
        camera.world_from_camera = glioscope_render::Camera::orientation(degrees, 15.0);
        harness.state_mut().perform(&ctx, &Command::SetCamera(camera), Instant::now());
        harness.step();
    };
    harness.state_mut().perform(&ctx, &Command::SetShading(Shading::Cones), Instant::now());
    for n in 0..6 {
        turn(&mut harness, 10.0 * f64::from(n));
        let (quality, _) = drawn(&harness);
        assert!(quality.cost.unwrap() <= 1.0, "{quality:?}");
        assert_eq!(quality.lighting.shading, Shading::Cones);
    }
    // Time passes in the harness by a quarter of a second a step at most, and pictures come in parts.
    let reference = Light { shading: Shading::Cones, ..Light::default() }
        .at(Quality::preset(Shading::Cones, Preset::Reference));
    let mut steps = 0;
    while drawn(&harness).0 != reference {
        harness.step();
        steps += 1;
        assert!(steps < 3000, "{:?}", drawn(&harness));
    }
    let (_, size) = drawn(&harness);
    assert!(size[0] > 300, "all pixels: {size:?}");
    // A preset of one's own holds whether something moves or not.
    harness.state_mut().perform(&ctx, &Command::SetPreset(Some(Preset::Draft)), Instant::now());
    turn(&mut harness, 77.0);
    let draft = Quality::preset(Shading::Cones, Preset::Draft);
    assert_eq!(drawn(&harness).0, draft);
    for _ in 0..20 {
        harness.step();
    }
    assert_eq!(drawn(&harness).0, draft);
}

#[test]
fn diagnostics_say_how_far_off_the_light_is() {
    let mut harness = window_on(CaseRef::Sample, [1100.0, 900.0], Theme::Light);
    perform(&mut harness, &Command::TogglePane(Pane::Diagnostics));
    harness.get_all_by_label_contains("Expected error: unknown").next().unwrap();
    perform(&mut harness, &Command::SetPreset(Some(Preset::Draft)));
    perform(&mut harness, &Command::SetShading(Shading::Cones));
    let [surfaces, tissue] = Quality::preset(Shading::Cones, Preset::Draft).expected_error().unwrap();
    let words = format!("Expected error: {surfaces:.3} of white on opaque surfaces, {tissue:.3} in tissue");
    harness.get_all_by_label_contains(&words).next().unwrap();
}

/// The finer picture comes in parts: the window shows the draft meanwhile, a turned camera drops the rest, and what
/// stands at the end is the picture that is drawn at once.
fn a_still_picture_comes_in_parts(shading: Shading) -> String {
    let mut harness = drafting_window_on(CaseRef::Sample, [420.0, 360.0]);
    maximized(&mut harness, Pane::Context);
    let ctx = harness.ctx.clone();
    let share =
        |harness: &Harness<'_, GlioscopeApp>| harness.state().viewport.as_ref().unwrap().context.share_done();
    let turn = |harness: &mut Harness<'_, GlioscopeApp>, degrees: f64| {
        let mut camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
        camera.world_from_camera = glioscope_render::Camera::orientation(degrees, 15.0);
        harness.state_mut().perform(&ctx, &Command::SetCamera(camera), Instant::now());
        harness.step();
    };
    harness.state_mut().perform(&ctx, &Command::SetShading(shading), Instant::now());
    let (mut waited, mut longest_ms) = (0, 0.0f64);
    let until_coming = |harness: &mut Harness<'_, GlioscopeApp>| {
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
    let drafts =
        |harness: &Harness<'_, GlioscopeApp>| harness.state().viewport.as_ref().unwrap().context.frames_drawn;
    let before = drafts(&harness);
    until_coming(&mut harness);
    assert_eq!(drafts(&harness), before, "no picture of the first camera comes in between");
    let reference = Light { shading, ..Light::default() }.at(Quality::preset(shading, Preset::Reference));
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
        let viewport = harness.state().viewport.as_ref().unwrap();
        viewport.context.frame().unwrap().read_rgba(&viewport.gpu).unwrap()
    };
    let found = pixels(&harness);
    let mut whole = window_on(CaseRef::Sample, [420.0, 360.0], Theme::Light);
    maximized(&mut whole, Pane::Context);
    let camera = harness.state().work.doc.as_ref().unwrap().nav.camera;
    perform(&mut whole, &Command::SetShading(shading));
    perform(&mut whole, &Command::SetCamera(camera));
    assert_eq!(share(&whole), None, "at once");
    assert_eq!(drawn(&whole).0, reference);
    assert!(pixels(&whole) == found, "the same pixels");
    format!("{waited} steps of the window, the longest {longest_ms:.0} ms")
}

#[test]
fn a_still_picture_by_slices_comes_in_parts_and_the_window_goes_on() {
    println!("{}", a_still_picture_comes_in_parts(Shading::Slices));
}

#[test]
fn a_still_picture_by_cones_comes_in_parts_and_the_window_goes_on() {
    println!("{}", a_still_picture_comes_in_parts(Shading::Cones));
}
