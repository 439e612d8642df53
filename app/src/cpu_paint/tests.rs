//! Tests of the painter without a device: closed forms, and repainting against painting anew. The whole window is
//! compared with egui's own renderer in tests/tests/whole/ui_cpu_paint.rs.

#![allow(clippy::disallowed_methods, reason = "colours of drawn test shapes")]

use egui::{
    ClippedPrimitive, Color32, ColorImage, Context, Mesh, RawInput, Rect, TextureId,
    epaint::{ImageDelta, Primitive, Vertex, textures::TextureOptions},
    pos2, vec2,
};

use super::{
    canvas::{Canvas, Painted, Textures},
    texture::Texture,
};

const SIZE: [usize; 2] = [300, 200];

/// A white texture under egui's first id, and a linear gradient from black to white, two texels wide, under 1.
fn textures() -> Textures {
    let white = ImageDelta::full(ColorImage::filled([1, 1], Color32::WHITE), TextureOptions::LINEAR);
    let two = ColorImage::new([2, 1], vec![Color32::BLACK, Color32::WHITE]);
    let two = ImageDelta::full(two, TextureOptions::LINEAR);
    [(0, white), (1, two)]
        .map(|(id, delta)| (TextureId::Managed(id), Texture::changed(None, &delta).unwrap()))
        .into_iter()
        .collect()
}

fn mesh(texture: u64, corners: &[([f32; 2], [f32; 2], Color32)], indices: &[u32]) -> ClippedPrimitive {
    let vertices =
        corners.iter().map(|&([x, y], [u, v], color)| Vertex { pos: pos2(x, y), uv: pos2(u, v), color });
    let mesh = Mesh {
        indices: indices.to_vec(),
        vertices: vertices.collect(),
        texture_id: TextureId::Managed(texture),
    };
    ClippedPrimitive { clip_rect: Rect::EVERYTHING, primitive: Primitive::Mesh(mesh) }
}

fn rectangle(min: [f32; 2], max: [f32; 2], color: Color32) -> ClippedPrimitive {
    let at = [[min[0], min[1]], [max[0], min[1]], [max[0], max[1]], [min[0], max[1]]];
    mesh(0, &at.map(|at| (at, [0.0; 2], color)), &[0, 1, 2, 0, 2, 3])
}

fn pixel(canvas: &Canvas, x: usize, y: usize) -> [u8; 4] {
    canvas.pixels()[y * canvas.size()[0] + x]
}

#[test]
fn pixels_belong_to_a_rectangle_by_their_centres() {
    let mut canvas = Canvas::default();
    let red = Color32::from_rgb(255, 0, 0);
    canvas.paint(SIZE, &[rectangle([10.4, 20.0], [50.6, 90.5], red)], 1.0, &textures());
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            // Centres on the left and upper edge are inside, on the right and lower edge outside.
            let inside = (10..=50).contains(&x) && (20..90).contains(&y);
            let expected = if inside { [255, 0, 0, 255] } else { [0, 0, 0, 255] };
            assert_eq!(pixel(&canvas, x, y), expected, "{x} {y}");
        }
    }
}

/// A fan of triangles about a point that is no pixel's centre, in both windings: shared edges are painted once, without
/// gaps.
#[test]
fn each_pixel_of_a_fan_is_painted_once() {
    let half = Color32::from_rgba_premultiplied(0, 0, 100, 128);
    let mut corners = vec![([131.3, 87.7], [0.0; 2], half)];
    let border =
        [[5.0, 5.0], [131.3, 5.0], [290.0, 5.0], [290.0, 60.5], [290.0, 190.0], [77.0, 190.0], [5.0, 190.0]];
    corners.extend(border.map(|at| (at, [0.0; 2], half)));
    let indices: Vec<u32> = (1..=7)
        .flat_map(|i| {
            let next = i % 7 + 1;
            if i % 2 == 0 { [0, i, next] } else { [next, i, 0] }
        })
        .collect();
    let mut canvas = Canvas::default();
    canvas.paint(SIZE, &[mesh(0, &corners, &indices)], 1.0, &textures());
    for y in 5..190 {
        for x in 5..290 {
            assert_eq!(pixel(&canvas, x, y), [0, 0, 100, 255], "{x} {y}");
        }
    }
}

/// 128 over 255 by the rule of premultiplied colours, and a colour that only adds.
#[test]
fn colours_are_blended_premultiplied() {
    let mut canvas = Canvas::default();
    let layers = [
        rectangle([0.0, 0.0], [100.0, 100.0], Color32::from_rgb(200, 100, 0)),
        rectangle([0.0, 0.0], [100.0, 50.0], Color32::from_rgba_premultiplied(10, 20, 30, 128)),
        rectangle([0.0, 0.0], [50.0, 100.0], Color32::from_rgba_premultiplied(100, 0, 7, 0)),
    ];
    canvas.paint(SIZE, &layers, 1.0, &textures());
    // 200 * 127 / 255 = 99.6; 100 * 127 / 255 = 49.8.
    assert_eq!(pixel(&canvas, 70, 20), [110, 70, 30, 255]);
    assert_eq!(pixel(&canvas, 20, 20), [210, 70, 37, 255]);
    assert_eq!(pixel(&canvas, 20, 70), [255, 100, 7, 255]);
    assert_eq!(pixel(&canvas, 70, 70), [200, 100, 0, 255]);
}

#[test]
fn textures_and_colours_are_interpolated_linearly() {
    let mut canvas = Canvas::default();
    let corners = [
        ([0.0, 0.0], [0.0, 0.0]),
        ([200.0, 0.0], [1.0, 0.0]),
        ([200.0, 50.0], [1.0, 1.0]),
        ([0.0, 50.0], [0.0, 1.0]),
    ];
    let white = corners.map(|(at, uv)| (at, uv, Color32::WHITE));
    let shaded = corners.map(|(at, _)| {
        let grey = if at[0] > 0.0 { 255 } else { 0 };
        ([at[0], at[1] + 100.0], [0.0; 2], Color32::from_gray(grey))
    });
    let quads =
        [(1, white), (0, shaded)].map(|(texture, corners)| mesh(texture, &corners, &[0, 1, 2, 0, 2, 3]));
    canvas.paint(SIZE, &quads, 1.0, &textures());
    for x in 0..200 {
        let center = x as f32 + 0.5;
        // Texel centres lie at 50 and 150; beyond them the texture stays.
        let texture = 255.0 * ((center - 50.0) / 100.0).clamp(0.0, 1.0);
        let color = 255.0 * center / 200.0;
        let close = |found: u8, expected: f32| (f32::from(found) - expected).abs() <= 1.0;
        assert!(close(pixel(&canvas, x, 25)[0], texture), "{x}: {:?}, {texture}", pixel(&canvas, x, 25));
        assert!(close(pixel(&canvas, x, 125)[1], color), "{x}: {:?}, {color}", pixel(&canvas, x, 125));
    }
}

/// A picture at its own size is that picture, whether it is interpolated or not; translucent texels are blended, and where the
/// triangles reach beyond it, its edge goes on.
#[test]
fn a_picture_at_its_own_size_is_copied() {
    let size = [60, 40];
    let texel = |x: usize, y: usize| {
        let [red, green, alpha] = [x * 4, y * 6, if x < 30 { 255 } else { 120 }].map(|v| v as u8);
        Color32::from_rgba_premultiplied(red.min(alpha), green.min(alpha), 0, alpha)
    };
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| texel(x, y))).collect();
    let image = ColorImage::new(size, pixels);
    for options in [TextureOptions::LINEAR, TextureOptions::NEAREST] {
        let mut textures = textures();
        let picture = Texture::changed(None, &ImageDelta::full(image.clone(), options)).unwrap();
        textures.insert(TextureId::Managed(1), picture);
        // From 10 texels before its left edge to 10 behind its right one.
        let (low, high) = (-10.0 / 60.0, 70.0 / 60.0);
        let corners = [
            ([100.0, 50.0], [low, 0.0], Color32::WHITE),
            ([180.0, 50.0], [high, 0.0], Color32::WHITE),
            ([180.0, 90.0], [high, 1.0], Color32::WHITE),
            ([100.0, 90.0], [low, 1.0], Color32::WHITE),
        ];
        let mut canvas = Canvas::default();
        canvas.paint(SIZE, &[mesh(1, &corners, &[0, 1, 2, 0, 2, 3])], 1.0, &textures);
        for y in 0..40 {
            for x in 0..80_usize {
                let [red, green, blue, _] = texel(x.saturating_sub(10).min(59), y).to_array();
                // Over black.
                assert_eq!(pixel(&canvas, 100 + x, 50 + y), [red, green, blue, 255], "{options:?} {x} {y}");
            }
        }
    }
}

#[test]
fn only_what_changed_is_painted() {
    let mut canvas = Canvas::default();
    let mut textures = textures();
    let ground = rectangle([0.0, 0.0], [300.0, 200.0], Color32::from_gray(30));
    let button = |grey| rectangle([130.0, 70.0], [180.0, 90.0], Color32::from_gray(grey));
    let picture = mesh(
        1,
        &[
            ([200.0, 100.0], [0.0; 2], Color32::WHITE),
            ([290.0, 100.0], [1.0, 0.0], Color32::WHITE),
            ([290.0, 190.0], [1.0; 2], Color32::WHITE),
        ],
        &[0, 1, 2],
    );
    let area = |painted: &[Painted]| painted.iter().map(|part| part.size[0] * part.size[1]).sum::<usize>();
    let frame = [ground.clone(), button(80), picture.clone()];
    assert_eq!(
        area(&canvas.paint(SIZE, &frame, 1.0, &textures)),
        300 * 200,
        "the first frame is painted whole"
    );
    assert_eq!(canvas.paint(SIZE, &frame, 1.0, &textures), [], "nothing changed");
    let hovered = [ground, button(90), picture];
    let painted = canvas.paint(SIZE, &hovered, 1.0, &textures);
    // The button lies on one tile of 64 x 32 pixels.
    assert_eq!(painted, [Painted { at: [128, 64], size: [64, 32] }]);
    assert_eq!(pixel(&canvas, 150, 80), [90, 90, 90, 255]);
    let two = ColorImage::new([2, 1], vec![Color32::RED, Color32::RED]);
    let change = ImageDelta::full(two, TextureOptions::LINEAR);
    let id = TextureId::Managed(1);
    let changed = Texture::changed(textures.remove(&id), &change).unwrap();
    textures.insert(id, changed);
    let painted = canvas.paint(SIZE, &hovered, 1.0, &textures);
    assert!(
        painted.iter().all(|part| part.at[0] >= 192 && part.at[1] >= 96) && !painted.is_empty(),
        "{painted:?}"
    );
    assert_eq!(pixel(&canvas, 280, 110), [255, 0, 0, 255]);
}

#[test]
fn a_change_that_does_not_fit_its_texture_is_refused() {
    let image = || ColorImage::filled([4, 4], Color32::WHITE);
    let whole = Texture::changed(None, &ImageDelta::full(image(), TextureOptions::LINEAR));
    assert!(whole.is_some());
    let part = ImageDelta::partial([1, 0], image(), TextureOptions::LINEAR);
    assert!(Texture::changed(whole, &part).is_none(), "it would reach beyond the right edge");
    assert!(Texture::changed(None, &part).is_none(), "there is nothing to change");
    assert!(Texture::from_rgba([2, 2], &[0; 12], 0).is_none());
}

/// Every frame of a small interface while the pointer moves over it and a menu opens, at three scales: repainting the
/// changed tiles gives the same pixels as painting all of them.
#[test]
fn repainting_equals_painting_anew() {
    for pixels_per_point in [1.0, 1.25, 2.0] {
        let ctx = Context::default();
        let mut textures = Textures::new();
        let mut kept = Canvas::default();
        let (mut whole, mut part, mut number) = (0, 0, 40.0);
        for step in 0..40_u16 {
            let mut input = RawInput {
                screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), vec2(400.0, 300.0))),
                time: Some(f64::from(step) / 60.0),
                ..RawInput::default()
            };
            input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point =
                Some(pixels_per_point);
            let pointer = pos2(20.0 + 7.0 * f32::from(step % 20), 15.0 + 5.0 * f32::from(step / 2));
            input.events.push(egui::Event::PointerMoved(pointer));
            if step == 10 || step == 12 {
                let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
                input.events.push(egui::Event::PointerButton {
                    pos: pointer,
                    button,
                    pressed: step == 10,
                    modifiers,
                });
            }
            let mut output = ctx.run_ui(input, |ui| {
                ui.menu_button("A menu of some width here", |ui| ui.label("first entry"));
                ui.add(egui::Slider::new(&mut number, 0.0..=100.0).text("slider"));
                egui::ScrollArea::vertical().show(ui, |ui| {
                    (0..40).for_each(|row| {
                        let _ = ui.selectable_label(row == 3, format!("row {row}")).on_hover_text("hint");
                    });
                });
            });
            for (id, changes) in output.textures_delta.set.drain() {
                for change in changes {
                    let changed = Texture::changed(textures.remove(&id), &change).unwrap();
                    textures.insert(id, changed);
                }
            }
            output.textures_delta.clear();
            let primitives = ctx.tessellate(output.shapes, pixels_per_point);
            let size = [400.0, 300.0].map(|points| (points * pixels_per_point) as usize);
            let painted = kept.paint(size, &primitives, pixels_per_point, &textures);
            part += painted.iter().map(|part| part.size[0] * part.size[1]).sum::<usize>();
            whole += size[0] * size[1];
            let mut new = Canvas::default();
            new.paint(size, &primitives, pixels_per_point, &textures);
            assert!(kept.pixels() == new.pixels(), "scale {pixels_per_point}, frame {step}");
        }
        assert!(part > 0 && part < whole / 2, "{part} of {whole} pixels were painted");
    }
}

#[test]
fn a_frame_does_not_wait_for_other_work() {
    use std::sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc,
    };
    let released = Arc::new(AtomicBool::new(false));
    let waiting = released.clone();
    // Every thread of the pool that all other work runs on.
    rayon::spawn_broadcast(move |_| {
        while !waiting.load(Ordering::Relaxed) {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    });
    let (send, painted) = mpsc::channel();
    std::thread::spawn(move || {
        let mut canvas = Canvas::default();
        let parts = canvas.paint([300, 200], &[], 1.0, &Textures::new());
        send.send(parts.len())
    });
    let parts = painted.recv_timeout(std::time::Duration::from_secs(20));
    released.store(true, Ordering::Relaxed);
    assert!(parts.is_ok_and(|parts| parts > 0), "the frame waited for other work");
}
