//! The window painted on the CPU, compared with the same window painted by egui's renderer.

use egui::{Modifiers, PointerButton, Pos2, pos2, vec2};
use glioscope::{
    command::LookCommand,
    cpu_paint,
    model::{CaseRef, PaneId},
};
use glioscope_tests::{Window, perform, sample, screens, software_gpu, window_on, window_painted_on_cpu};
use image::RgbaImage;

const SIZE: [f32; 2] = [1280.0, 800.0];

/// Share of pixels that differ by more than rounding: the device blends and interpolates in `f32`, the painter in
/// integers.
fn share_differing(a: &RgbaImage, b: &RgbaImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let differs = |(a, b): (&image::Rgba<u8>, &image::Rgba<u8>)| (0..3).any(|i| a[i].abs_diff(b[i]) > 4);
    let count = a.pixels().zip(b.pixels()).filter(|pair| differs(*pair)).count();
    count as f64 / f64::from(a.width() * a.height())
}

fn move_to(harness: &mut Window, at: Pos2) {
    harness.event(egui::Event::PointerMoved(at));
    harness.run_ok();
}

fn click(harness: &mut Window, at: Pos2) {
    move_to(harness, at);
    for pressed in [true, false] {
        let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
        harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        harness.run_ok();
    }
}

fn center(harness: &Window, pane: PaneId) -> Pos2 {
    harness.state().pane_rect(pane).unwrap().center()
}

/// A step of the comparison: its name and what is done to a window.
type Step = (&'static str, fn(&mut Window));

const STEPS: [Step; 7] = [
    ("at first", |_| {}),
    ("hovering in the closeup", |window| move_to(window, center(window, PaneId::Closeup))),
    ("hovering in a slice", |window| move_to(window, center(window, PaneId::Axial) + vec2(9.0, 5.0))),
    ("a menu", |window| click(window, pos2(20.0, 10.0))),
    ("a submenu's entry", |window| move_to(window, pos2(40.0, 60.0))),
    ("the menu closed, panes as before", |window| {
        click(window, pos2(20.0, 10.0));
        move_to(window, center(window, PaneId::Overlap));
    }),
    ("turned", |window| {
        let mut camera = window.state().work.doc.as_ref().unwrap().nav.camera;
        camera.height_mm *= 0.7;
        perform(window, LookCommand::SetCamera(camera));
    }),
];

#[test]
fn the_painter_shows_what_eguis_renderer_shows() {
    for theme in [egui::Theme::Dark, egui::Theme::Light] {
        let mut painted = window_painted_on_cpu(CaseRef::Sample, SIZE, theme);
        let mut expected = window_on(CaseRef::Sample, SIZE, theme);
        // The painter switches animations off; so the two are compared at the same time of theirs.
        expected.ctx.all_styles_mut(|style| style.animation_time = 0.0);
        let mut last: Option<RgbaImage> = None;
        for (name, step) in STEPS {
            for window in [&mut painted, &mut expected] {
                window.run_ok();
                step(window);
            }
            let (found, expected) = (painted.render().unwrap(), expected.render().unwrap());
            let share = share_differing(&found, &expected);
            assert!(share < 2e-4, "{theme:?}, {name}: {share} of the pixels differ");
            assert!(
                last.is_none_or(|last| share_differing(&last, &found) > 2e-4),
                "{name} changes something"
            );
            last = Some(found);
        }
    }
}

/// On other adapters nothing is installed (`window/run.rs`), so that egui's own times remain.
#[test]
fn painting_on_the_cpu_switches_animations_off() {
    let (painted, other) = (egui::Context::default(), egui::Context::default());
    cpu_paint::install(&painted, &software_gpu(), egui_wgpu::wgpu::TextureFormat::Bgra8Unorm);
    for theme in [egui::Theme::Dark, egui::Theme::Light] {
        let [still, animated] = [&painted, &other].map(|ctx| ctx.style_of(theme));
        assert_eq!(still.scroll_animation, egui::style::ScrollAnimation::none());
        assert!(still.animation_time == 0.0 && animated.animation_time > 0.0);
    }
}

/// Over areas that don't answer the pointer, no 3D view is drawn anew and no frames follow those of the movement.
#[test]
fn hovering_over_still_areas_repaints_nothing() {
    let mut window = sample();
    let frames = |window: &mut Window| {
        [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids]
            .map(|pane| screens(window, pane).frames_drawn())
    };
    let before = frames(&mut window);
    assert!(before.iter().all(|&drawn| drawn > 0), "every 3D view was drawn");
    let overlap = window.state().pane_rect(PaneId::Overlap).unwrap();
    for step in 0..8_u8 {
        window.event(egui::Event::PointerMoved(overlap.left_top() + vec2(4.0 + f32::from(step), 60.0)));
        window.step();
        window.step();
        window.step();
        assert!(!window.ctx.has_requested_repaint(), "a movement causes two frames at most");
    }
    assert_eq!(frames(&mut window), before);
}
