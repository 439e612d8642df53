//! A frame drawn in parts equals one drawn at once, and drawing another drops it.

use glam::DQuat;
use glioscope_core::optics::Projection;

use crate::{
    ContextRenderer, ContextScene,
    light::suite::{lit, scene},
    scene::{LightingMode, Quality},
    testing::GPU,
    views::{Frame, context::Context},
};

const SIZE: [u32; 2] = [70, 50];

fn fine() -> Quality {
    let mut quality = lit(LightingMode::Slices);
    quality.lighting.slice_mm = 1.0;
    quality
}

fn at_once(scene: &ContextScene, quality: &Quality) -> Vec<u8> {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    renderer.render(&GPU, scene, quality, SIZE).unwrap().read_rgba(&GPU).unwrap()
}

fn read(frame: Option<&Frame<Context>>) -> Vec<u8> {
    frame.unwrap().read_rgba(&GPU).unwrap()
}

/// Calls until the frame is complete; with 0 milliseconds one part per call.
fn calls(renderer: &mut ContextRenderer, milliseconds: f64) -> usize {
    let mut calls = 1;
    while !renderer.resume(&GPU, milliseconds).unwrap() {
        calls += 1;
        assert!(calls < 1000, "it terminates");
    }
    calls
}

#[test]
fn a_frame_drawn_in_parts_equals_one_drawn_at_once() {
    let scene = scene(false, true, Projection::Perspective);
    let draft = Quality { resolution_scale: 0.5, ..fine() };
    for quality in
        [fine(), Quality { resolution_scale: 0.5, ..fine() }, lit(LightingMode::Cones), Quality::FULL]
    {
        let expected = at_once(&scene, &quality);
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let before = renderer.render(&GPU, &scene, &draft, SIZE).unwrap().read_rgba(&GPU).unwrap();
        assert_eq!(renderer.share_done(), None);
        renderer.begin(&GPU, &scene, &quality, SIZE).unwrap();
        let mut share = renderer.share_done().unwrap();
        assert!(share < 0.01);
        let mut parts = 0;
        while !renderer.resume(&GPU, 0.0).unwrap() {
            parts += 1;
            let now = renderer.share_done().unwrap();
            assert!(now > share && now < 1.0, "{share} {now}");
            share = now;
            if parts % 9 == 1 {
                assert!(read(renderer.frame()) == before, "the last frame stays, part {parts}");
            }
        }
        let slices = quality.lighting.mode == LightingMode::Slices;
        assert!(parts > if slices { 20 } else { 2 }, "{parts} parts");
        assert_eq!(renderer.share_done(), None);
        assert!(read(renderer.frame()) == expected, "{:?}", quality.lighting.mode);
        let frame = renderer.frame().unwrap();
        assert_eq!(frame.size_px, quality.drawn_px(SIZE));
        // The times of its parts are known, without drawing it again.
        let times = renderer.pass_times(&GPU).unwrap();
        assert_eq!(times.iter().map(|t| t.0).collect::<Vec<_>>(), frame.plan.passes);
        assert!(times.iter().all(|t| t.1 > 0.0) && renderer.resume(&GPU, 0.0).unwrap());
        // With enough time one call is enough.
        renderer.begin(&GPU, &scene, &quality, SIZE).unwrap();
        assert_eq!(calls(&mut renderer, 1e9), 1);
        assert!(read(renderer.frame()) == expected);
    }
}

#[test]
fn a_moved_camera_drops_the_pending_frame() {
    let scene = scene(false, true, Projection::Perspective);
    let mut turned = scene.clone();
    turned.camera.world_from_camera *= DQuat::from_rotation_y(0.4);
    let (first, second) = (at_once(&scene, &fine()), at_once(&turned, &fine()));
    assert!(first != second);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    renderer.begin(&GPU, &scene, &fine(), SIZE).unwrap();
    for _ in 0..12 {
        assert!(!renderer.resume(&GPU, 0.0).unwrap());
    }
    assert!(renderer.frame().is_none(), "nothing was drawn yet");
    // At once.
    assert!(renderer.render(&GPU, &turned, &fine(), SIZE).unwrap().read_rgba(&GPU).unwrap() == second);
    assert_eq!(renderer.share_done(), None);
    assert!(renderer.resume(&GPU, 0.0).unwrap(), "nothing is left to do");
    assert!(read(renderer.frame()) == second, "and the frame stays");
    // In parts: from the beginning again.
    renderer.begin(&GPU, &scene, &fine(), SIZE).unwrap();
    for _ in 0..15 {
        assert!(!renderer.resume(&GPU, 0.0).unwrap());
    }
    renderer.begin(&GPU, &turned, &fine(), SIZE).unwrap();
    assert!(calls(&mut renderer, 0.0) > 20);
    assert!(read(renderer.frame()) == second);
    // A frame that fails to begin leaves the last one.
    let mut broken = scene.clone();
    broken.camera.height_mm = f64::NAN;
    assert!(renderer.begin(&GPU, &broken, &fine(), SIZE).is_err());
    assert!(renderer.resume(&GPU, 0.0).unwrap() && read(renderer.frame()) == second);
}
