//! Restricting steps to the pixels that need them changes no result.

use glam::{DAffine3, DQuat, DVec3};
use glioscope_core::optics::{Projection, Sight};

use super::{
    plan::{Kernel, SlicePlan},
    reach::{OpaqueBounds, Rect, ScreenBounds, StepRects, areas, step_rects_in_groups},
    slice_settings,
};
use crate::{
    ContextRenderer, ContextScene,
    light::{
        LightWork,
        suite::{lit, scene, transfer},
    },
    scene::{Lamp, LightSettings, LightingMode, MutualOcclusion, Quality, SliceVariant},
    solid::{SURFACE, view::FAR},
    testing::GPU,
};

const SIZE: [u32; 2] = [131, 75];

struct Rendered {
    eye: Vec<[f32; 4]>,
    notes: Vec<[f32; 2]>,
    depths: Vec<f32>,
    rgba: Vec<u8>,
    frame_notes: Vec<String>,
    work: LightWork,
}

fn render(scene: &ContextScene, quality: &Quality, everywhere: bool) -> Rendered {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    if everywhere {
        renderer.lights_mut().everywhere = true;
    }
    let frame = renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let depths = if frame.plan.has(SURFACE) { frame.read_depths(&GPU) } else { Vec::new() };
    let (rgba, frame_notes) = (frame.read_rgba(&GPU).unwrap(), frame.notes.clone());
    let read = |buffer: &wgpu::Buffer| GPU.read_buffers(&[(buffer, 0, buffer.size())]).unwrap().remove(0);
    let (lights, work) = (renderer.lights(), renderer.light_work().unwrap());
    let (eye, notes) = (read(lights.probe().eye.unwrap()), read(lights.probe().notes.unwrap()));
    let of = |bytes: &[u8]| bytemuck::pod_collect_to_vec(bytes);
    Rendered { eye: of(&eye), notes: bytemuck::pod_collect_to_vec(&notes), depths, rgba, frame_notes, work }
}

/// Share of the steps' pixels that is omitted, in per cent, from the frame's notes.
fn omitted_percent(rendered: &Rendered) -> f64 {
    let mut notes = rendered.frame_notes.iter();
    let percent = notes.find_map(|s| s.split_once(" % of the slices' pixels")).map(|(percent, _)| percent);
    percent.map_or(0.0, |percent| percent.parse().unwrap())
}

/// Compares restricted steps with full ones; per cent of the pixels omitted.
fn compare_with_full_steps(name: &str, scene: &ContextScene, lighting: LightSettings) -> f64 {
    let quality = Quality { lighting, ..Quality::FULL };
    let (some, all) = (render(scene, &quality, false), render(scene, &quality, true));
    assert_eq!(omitted_percent(&all), 0.0);
    // Rounded up to workgroups of 8x8.
    let pixels: u64 = SIZE.iter().map(|s| u64::from(s.next_multiple_of(8))).product();
    let (slices, lights) = (u64::from(all.work.slices), if scene.tumor.is_some() { 2 } else { 1 });
    assert_eq!((some.work.slices, all.work.samples), (all.work.slices, pixels * slices));
    // A step moves at least its lights, and has at least one slice.
    assert!(all.work.bytes <= pixels * slices * (8 * lights + 16) && all.work.bytes >= pixels * 8 * lights);
    assert!(some.work.samples <= all.work.samples && some.work.bytes <= all.work.bytes);
    assert!(omitted_percent(&some) < 1.0 || some.work.samples < all.work.samples, "{name}: {:?}", some.work);
    for (i, (a, b)) in some.eye.iter().zip(&all.eye).enumerate() {
        let off = (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
        assert!(off <= 1e-6, "{name}: pixel {i}: {a:?} {b:?}");
    }
    let mut opaque = 0;
    for (i, (a, b)) in some.notes.iter().zip(&all.notes).enumerate() {
        assert_eq!(a[1], b[1], "{name}: depth where half is hidden at {i}");
        if some.depths.get(i).is_some_and(|d| *d < FAR) {
            opaque += 1;
            assert!((a[0] - b[0]).abs() <= 1e-6, "{name}: light on opaque geometry at {i}: {a:?} {b:?}");
        }
    }
    assert_eq!(opaque > 20, scene.tumor.is_some(), "{name}: {opaque} pixels of the tumour");
    assert!(some.eye.iter().filter(|e| e[3] < 0.7).count() > 100, "{name}: the image is visible");
    let differing = some.rgba.iter().zip(&all.rgba).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "{name}: 8-bit pixels");
    omitted_percent(&some)
}

/// Variants, mutual occlusions and both projections; from afar, from aside and from inside; through soft and opaque
/// images.
#[test]
fn omitted_step_pixels_change_nothing() {
    let mut shares = Vec::new();
    for (with_tumor, projection) in
        [(false, Projection::Perspective), (true, Projection::Perspective), (true, Projection::Orthographic)]
    {
        let mut scene = scene(false, with_tumor, projection);
        let far = scene.camera;
        let mut aside = far;
        aside.focus_mm = DVec3::new(9.0, -4.0, 6.0);
        aside.height_mm *= 0.5;
        let mut within = far;
        within.height_mm *= 0.2;
        within.world_from_camera = DQuat::from_rotation_y(2.0);
        for (place, camera) in [("afar", far), ("aside", aside), ("within", within)] {
            scene.camera = camera;
            for opacity in [0.35, 1.0] {
                scene.transfer = transfer(false, opacity);
                for variant in [SliceVariant::Mended, SliceVariant::PaperExact] {
                    for (image_on_image, opaque_on_image) in [(true, true), (false, true), (true, false)] {
                        if !with_tumor && !opaque_on_image
                            || variant != SliceVariant::Mended && place != "afar"
                        {
                            continue;
                        }
                        let mutual =
                            MutualOcclusion { image_on_image, opaque_on_image, ..MutualOcclusion::ALL };
                        let lighting = LightSettings {
                            variant,
                            mutual,
                            slice_mm: 1.1,
                            ..lit(LightingMode::Slices).lighting
                        };
                        let name =
                            format!("{with_tumor} {projection:?} {place} {opacity} {variant:?} {mutual:?}");
                        let omitted = compare_with_full_steps(&name, &scene, lighting);
                        shares.push((place, omitted));
                    }
                }
            }
        }
    }
    println!("{shares:?}");
    assert!(shares.iter().all(|(place, share)| *place != "afar" || *share > 10.0), "some pixels are omitted");
}

/// So it is with a lamp beside the scene, whose light moves across the frame and in from beyond its edges.
#[test]
fn omitted_step_pixels_change_nothing_in_a_lamps_light() {
    let mut shares = Vec::new();
    for (with_tumor, projection) in [(false, Projection::Orthographic), (true, Projection::Perspective)] {
        let mut scene = scene(false, with_tumor, projection);
        let mut aside = scene.camera;
        aside.focus_mm = DVec3::new(9.0, -4.0, 6.0);
        aside.height_mm *= 0.4;
        for (place, camera) in [("afar", scene.camera), ("aside", aside)] {
            scene.camera = camera;
            for (lamp, aperture_deg, variant) in [
                ([-45.0, 45.0], 20.0, SliceVariant::Mended),
                ([50.0, -5.0], 5.0, SliceVariant::Mended),
                ([30.0, 10.0], 20.0, SliceVariant::PaperExact),
                ([140.0, 30.0], 20.0, SliceVariant::Mended),
                ([180.0, -5.0], 30.0, SliceVariant::PaperExact),
            ] {
                let [azimuth_deg, elevation_deg] = lamp;
                let lighting = LightSettings {
                    lamp: Lamp { azimuth_deg, elevation_deg, ..Lamp::DEFAULT },
                    towards_lamp: true,
                    aperture_deg,
                    variant,
                    slice_mm: 1.1,
                    ..lit(LightingMode::Slices).lighting
                };
                let name = format!("{with_tumor} {projection:?} {place} {lamp:?} {variant:?}");
                shares.push((place, compare_with_full_steps(&name, &scene, lighting)));
            }
        }
    }
    println!("{shares:?}");
    assert!(shares.iter().all(|(place, share)| *place != "afar" || *share > 10.0), "some pixels are omitted");
}

fn plan_of(scene: &ContextScene, sight: &Sight, slice_mm: f64, depths: (f64, f64)) -> SlicePlan {
    let lighting = LightSettings { slice_mm, ..LightSettings::DEFAULT };
    SlicePlan::new(&slice_settings(&lighting, &scene.camera), sight, Some(depths), &[depths])
}

fn covers(rects: &[Rect], pixel: [i32; 2]) -> bool {
    rects.iter().any(|r| (0..2).all(|a| (r.low[a]..r.high[a]).contains(&pixel[a])))
}

/// By brute force: how much light may be lost at a pixel, step by step, and how much of it is needed.
#[test]
fn step_rects_cover_all_pixels_found_by_brute_force() {
    let size = [61u32, 43];
    let scene = scene(false, false, Projection::Orthographic);
    let sight = Sight::new(&scene.camera, size);
    let depths = (100.0, 140.0);
    let mut omitted_shares = Vec::new();
    for (slice_mm, groups) in [(2.0, 128), (0.25, 128), (0.25, 7)] {
        let plan = plan_of(&scene, &sight, slice_mm, depths);
        let bounds =
            |low: [i32; 2], high: [i32; 2], depths_mm| ScreenBounds { rect: Rect { low, high }, depths_mm };
        let image = [bounds([5, 6], [9, 11], (104.0, 111.0)), bounds([30, 20], [33, 28], (123.0, 127.0))];
        let in_box = bounds([40, 8], [44, 10], (107.0, 115.0));
        for (opaque, opaque_occludes, image_occludes) in [
            (OpaqueBounds::None, true, true),
            (OpaqueBounds::Within(in_box), true, true),
            (OpaqueBounds::Within(in_box), false, true),
            (OpaqueBounds::Within(in_box), true, false),
            (OpaqueBounds::Anywhere, false, true),
        ] {
            let occluders = (opaque_occludes, image_occludes);
            let found = step_rects_in_groups(&plan, &sight, &image, opaque, occluders, groups);
            assert_eq!(found.len(), plan.steps.len());
            let inside = |s: &ScreenBounds, p: [i32; 2]| covers(&[s.rect], p);
            let pixels: Vec<[i32; 2]> =
                (0..size[1] as i32).flat_map(|y| (0..size[0] as i32).map(move |x| [x, y])).collect();
            let count = plan.steps.len();
            let span = |k: usize| {
                let s = &plan.steps[k];
                (s.depth_mm, s.depth_mm + f64::from(s.slices) * plan.slice_mm)
            };
            let visible = |k: usize, p: [i32; 2]| {
                image.iter().any(|s| inside(s, p) && s.depths_mm.0 < span(k).1 && s.depths_mm.1 > span(k).0)
            };
            let opaque_ahead = |k: usize, p: [i32; 2]| match opaque {
                OpaqueBounds::None => false,
                OpaqueBounds::Within(s) => inside(&s, p) && s.depths_mm.1 > span(k).0,
                OpaqueBounds::Anywhere => true,
            };
            let set = |all: &mut [f64], is: &dyn Fn([i32; 2]) -> bool| {
                pixels.iter().zip(all).for_each(|(p, a)| *a = if is(*p) { 1.0 } else { *a });
            };
            let nothing = vec![0.0; pixels.len()];
            let mut needed = vec![nothing.clone(); count];
            for k in (0..count).rev() {
                if k + 1 < count {
                    needed[k] = filtered(&needed[k + 1], size, &plan.steps[k + 1].kernel);
                }
                set(&mut needed[k], &|p| visible(k, p) || opaque_ahead(k, p));
            }
            let (mut lost, mut differ) = (nothing.clone(), nothing);
            let mut omitted = 0;
            for k in 0..count {
                let kernel = &plan.steps[k].kernel;
                let opaque_begun = |p: [i32; 2]| match opaque {
                    OpaqueBounds::Within(s) => inside(&s, p) && s.depths_mm.0 < span(k).1,
                    OpaqueBounds::None => false,
                    OpaqueBounds::Anywhere => true,
                };
                lost = filtered(&lost, size, kernel);
                differ = filtered(&differ, size, kernel);
                set(&mut lost, &|p| visible(k, p) || opaque_occludes && opaque_begun(p));
                set(&mut differ, &|p| opaque_begun(p) && (opaque_occludes || inside(&in_box, p)));
                for (n, p) in pixels.iter().enumerate() {
                    let StepRects { with_opaque, without_opaque } = &found[k];
                    let times = [with_opaque, without_opaque]
                        .iter()
                        .map(|r| usize::from(covers(r, *p)))
                        .sum::<usize>();
                    let all = with_opaque.iter().chain(without_opaque);
                    let rects = all.filter(|r| covers(std::slice::from_ref(r), *p)).count();
                    assert!(times <= 1 && rects <= 1, "rectangles are disjoint");
                    let matters = |light: f64| light * needed[k][n] > 1e-7;
                    if matters(lost[n]) {
                        assert_eq!(times, 1, "{opaque:?} step {k}: {p:?} is missing");
                        let differs = matters(differ[n]) || !image_occludes;
                        if differs && !matches!(opaque, OpaqueBounds::None) {
                            assert!(covers(with_opaque, *p), "{opaque:?} step {k}: {p:?} has two lights");
                        }
                    }
                    omitted += usize::from(times == 0);
                }
            }
            let share = omitted as f64 / (pixels.len() * count) as f64;
            omitted_shares.push(share);
            assert!(share > 0.1, "{opaque:?}: {omitted} of {}", pixels.len() * count);
        }
    }
    println!("omitted: {omitted_shares:.2?}");
}

/// Each pixel's sum over a footprint, weighted by the kernel; 0 outside.
fn filtered(from: &[f64], size: [u32; 2], kernel: &Kernel) -> Vec<f64> {
    let Kernel::Lattice { side, stride_px, center } = *kernel else { panic!("{kernel:?}") };
    let (low, stride) = (-((side as i32 - 1) * stride_px as i32) / 2, stride_px as i32);
    let at = |x: i32, y: i32| {
        let inside = x >= 0 && y >= 0 && x < size[0] as i32 && y < size[1] as i32;
        if inside { from[(y * size[0] as i32 + x) as usize] } else { 0.0 }
    };
    let mut out = Vec::with_capacity(from.len());
    for y in 0..size[1] as i32 {
        for x in 0..size[0] as i32 {
            let mut sum = 0.0;
            for j in 0..side as i32 {
                sum += (0..side as i32).map(|i| at(x + low + i * stride, y + low + j * stride)).sum::<f64>();
            }
            out.push((1.0 - center) * sum / f64::from(side * side) + center * at(x, y));
        }
    }
    out
}

/// A box's visible pixels lie in its rectangle, and a box that reaches behind the eye may be anywhere.
#[test]
fn screen_bounds_contain_the_projected_box() {
    let scene = scene(false, false, Projection::Perspective);
    let size = [128, 96];
    let sight = Sight::new(&scene.camera, size);
    let corners = |middle: DVec3| {
        std::array::from_fn::<_, 8, _>(|i| {
            middle + DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { 3.0 } else { -3.0 }))
        })
    };
    let bounds = ScreenBounds::of(&sight, &corners(DVec3::new(4.0, -3.0, 2.0))).unwrap();
    let mut inside = 0;
    for y in 0..size[1] {
        for x in 0..size[0] {
            let met = (0..400).any(|i| {
                let (near, far) = bounds.depths_mm;
                let depth = near + (far - near) * f64::from(i) / 399.0;
                let off = sight.at_mm([x, y], depth) - DVec3::new(4.0, -3.0, 2.0);
                off.abs().max_element() <= 3.0
            });
            inside += usize::from(met);
            assert!(!met || covers(&[bounds.rect], [x as i32, y as i32]), "{x} {y} of {bounds:?}");
        }
    }
    assert!(inside > 50 && bounds.rect.pixels() < 6 * inside as u64, "{inside} of {bounds:?}");
    assert_eq!(ScreenBounds::of(&sight, &corners(sight.eye_mm)).unwrap().rect, Rect::whole(size));
    assert!(ScreenBounds::of(&sight, &corners(sight.eye_mm - 50.0 * sight.forward)).is_none());
}

/// Each pixel of the rectangles has one thread, by the arithmetic of `pixel_in_areas` in lib/slices; the threads left over
/// are beyond the frame.
#[test]
fn one_dispatch_has_all_workgroups_of_its_rects() {
    let rect = |low: [i32; 2], high: [i32; 2]| Rect { low, high };
    let cases = [
        vec![rect([8, 16], [24, 40])],
        vec![
            rect([0, 0], [800, 8]),
            rect([0, 8], [16, 600]),
            rect([720, 8], [800, 600]),
            rect([0, 600], [800, 608]),
        ],
        vec![rect([0, 0], [16384, 16384])],
        vec![rect([0, 0], [16376, 8]), rect([8, 8], [16384, 16384])],
        vec![],
    ];
    for rects in cases {
        let (areas, [columns, rows, layers]) = areas(&rects);
        assert!(columns <= 65535 && rows <= 65535 && layers == 1, "{rects:?}");
        let expected = rects.iter().flat_map(|r| {
            let groups = [0, 1].map(|a| (r.high[a] - r.low[a]) / 8);
            let low = r.low;
            (0..groups[1]).flat_map(move |y| (0..groups[0]).map(move |x| [low[0] + 8 * x, low[1] + 8 * y]))
        });
        let mut expected = expected.map(|pixel| pixel.map(|c| c as u32));
        for number in 0..columns * rows {
            let mut area = areas[0];
            for next in &areas[1..] {
                area = if number >= next.first { *next } else { area };
            }
            let at = number - area.first;
            let across = (1.0 / area.per_row).round() as u32;
            let about = ((at as f32 + 0.5) * area.per_row) as u32;
            let row = about + u32::from((about + 1) * across <= at) - u32::from(about * across > at);
            let pixel = [area.origin[0] + 8 * (at - row * across), area.origin[1] + 8 * row];
            match expected.next() {
                Some(expected) => assert_eq!(pixel, expected, "workgroup {number} of {rects:?}"),
                None => assert!(pixel[0] >= 1 << 24, "workgroup {number} of {rects:?}: {pixel:?}"),
            }
        }
        assert_eq!(expected.next(), None, "{rects:?}");
    }
}

/// Bounds of bricks are those of their corners, on an oblique grid of unequal spacing, from afar and from inside.
#[test]
fn bounds_of_bricks_are_those_of_their_corners() {
    let turn =
        DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.4), DVec3::new(900.0, -40.0, 3.0));
    let world_from_voxel = turn * DAffine3::from_scale(DVec3::new(0.5, 0.5, 6.0));
    let bricks: Vec<[usize; 3]> = (0..60).map(|n| [n % 4, n / 4 % 5, n / 20]).collect();
    let middle_mm = world_from_voxel.transform_point3(DVec3::new(16.0, 20.0, 12.0));
    let mut behind = 0;
    for (projection, height_mm) in
        [(Projection::Perspective, 200.0), (Projection::Perspective, 0.5), (Projection::Orthographic, 120.0)]
    {
        let mut camera = scene(false, false, projection).camera;
        (camera.focus_mm, camera.height_mm) = (middle_mm, height_mm);
        let sight = Sight::new(&camera, [640, 360]);
        let expected: Vec<ScreenBounds> = bricks
            .iter()
            .filter_map(|brick| {
                let corners = std::array::from_fn::<_, 8, _>(|n| {
                    let voxel = |a: usize| 8.0 * brick[a] as f64 + if n >> a & 1 == 1 { 8.5 } else { -0.5 };
                    world_from_voxel.transform_point3(DVec3::new(voxel(0), voxel(1), voxel(2)))
                });
                ScreenBounds::of(&sight, &corners)
            })
            .collect();
        behind += bricks.len() - expected.len();
        let found = ScreenBounds::of_bricks(&sight, &world_from_voxel, &bricks);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(&expected) {
            // A corner may round to the next pixel; one more is added for that.
            let off = |a: [i32; 2], b: [i32; 2]| (0..2).map(|c| (a[c] - b[c]).abs()).fold(0, i32::max);
            let rects = off(found.rect.low, expected.rect.low).max(off(found.rect.high, expected.rect.high));
            assert!(rects <= 1, "{found:?} {expected:?}");
            let depths = [found.depths_mm.0 - expected.depths_mm.0, found.depths_mm.1 - expected.depths_mm.1];
            assert!(depths.iter().all(|mm| mm.abs() < 1e-9), "{found:?} {expected:?}");
        }
    }
    assert!(behind > 0, "no brick is behind the eye");
}

/// What a card does in one dispatch is what it does in several.
#[test]
fn small_rects_without_opaque_geometry_are_merged() {
    let rect = |low: [i32; 2], high: [i32; 2]| Rect { low, high };
    let mut small = StepRects {
        with_opaque: vec![rect([16, 16], [32, 32])],
        without_opaque: vec![rect([8, 8], [48, 16]), rect([8, 16], [16, 32])],
    };
    let mut large = StepRects { without_opaque: vec![rect([0, 32], [800, 600])], ..small.clone() };
    let (unchanged, mut none) = (large.clone(), StepRects::default());
    [&mut small, &mut large, &mut none].into_iter().for_each(StepRects::merge_small);
    assert_eq!(small, StepRects { with_opaque: vec![rect([8, 8], [48, 32])], without_opaque: Vec::new() });
    assert_eq!((large, none), (unchanged, StepRects::default()));
}
