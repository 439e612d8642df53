//! Steps are taken where it matters alone, and that changes nothing.

use glam::{DQuat, DVec3};
use glioscope_core::optics::{Projection, Sight};

use super::{
    plan::{Kernel, SlicePlan},
    reach::{Rect, ScreenBounds, SolidParts, StepReach, reach_in_groups},
    slice_settings,
};
use crate::{
    ContextRenderer, ContextScene,
    light::{
        LightWork,
        suite::{lit, scene, transfer},
    },
    scene::{LightSettings, LightingMode, MutualOcclusion, Quality, SliceVariant},
    solid::{SURFACE, view::FAR},
    testing::GPU,
};

const SIZE: [u32; 2] = [131, 75];

struct Left {
    eye: Vec<[f32; 4]>,
    notes: Vec<[f32; 2]>,
    depths: Vec<f32>,
    rgba: Vec<u8>,
    said: Vec<String>,
    work: LightWork,
}

fn left(scene: &ContextScene, quality: &Quality, everywhere: bool) -> Left {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    if everywhere {
        renderer.lights_mut().everywhere = true;
    }
    let frame = renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let depths = if frame.plan.has(SURFACE) { frame.read_depths(&GPU) } else { Vec::new() };
    let (rgba, said) = (frame.read_rgba(&GPU).unwrap(), frame.notes.clone());
    let read = |buffer: &wgpu::Buffer| GPU.read_buffers(&[(buffer, 0, buffer.size())]).unwrap().remove(0);
    let (lights, work) = (renderer.lights(), renderer.light_work().unwrap());
    let (eye, notes) = (read(lights.probe().eye.unwrap()), read(lights.probe().notes.unwrap()));
    let of = |bytes: &[u8]| bytemuck::pod_collect_to_vec(bytes);
    Left { eye: of(&eye), notes: bytemuck::pod_collect_to_vec(&notes), depths, rgba, said, work }
}

/// What is left out of the steps, in per cent, as the frame tells.
fn share(left: &Left) -> f64 {
    let said =
        left.said.iter().find_map(|s| s.split_once(" % of the slices' pixels")).map(|(share, _)| share);
    said.map_or(0.0, |share| share.parse().unwrap())
}

fn off_everywhere(name: &str, scene: &ContextScene, lighting: LightSettings) -> f64 {
    let quality = Quality { lighting, ..Quality::FULL };
    let (some, all) = (left(scene, &quality, false), left(scene, &quality, true));
    assert_eq!(share(&all), 0.0);
    // Rounded up to workgroups of 8x8.
    let pixels: u64 = SIZE.iter().map(|s| u64::from(s.next_multiple_of(8))).product();
    let (slices, lights) = (u64::from(all.work.slices), if scene.tumor.is_some() { 2 } else { 1 });
    assert_eq!((some.work.slices, all.work.samples), (all.work.slices, pixels * slices));
    // Each step moves its lights at least, and a step has one slice at least.
    assert!(all.work.bytes <= pixels * slices * (8 * lights + 16) && all.work.bytes >= pixels * 8 * lights);
    assert!(some.work.samples <= all.work.samples && some.work.bytes <= all.work.bytes);
    assert!(share(&some) < 1.0 || some.work.samples < all.work.samples, "{name}: {:?}", some.work);
    for (i, (a, b)) in some.eye.iter().zip(&all.eye).enumerate() {
        let off = (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
        assert!(off <= 1e-6, "{name}: pixel {i}: {a:?} {b:?}");
    }
    let mut solid = 0;
    for (i, (a, b)) in some.notes.iter().zip(&all.notes).enumerate() {
        assert_eq!(a[1], b[1], "{name}: half hidden at {i}");
        if some.depths.get(i).is_some_and(|d| *d < FAR) {
            solid += 1;
            assert!((a[0] - b[0]).abs() <= 1e-6, "{name}: light on what is solid at {i}: {a:?} {b:?}");
        }
    }
    assert_eq!(solid > 20, scene.tumor.is_some(), "{name}: {solid} pixels of the tumour");
    assert!(some.eye.iter().filter(|e| e[3] < 0.7).count() > 100, "{name}: an image in the picture");
    let other = some.rgba.iter().zip(&all.rgba).filter(|(a, b)| a != b).count();
    assert_eq!(other, 0, "{name}: 8-bit pixels");
    share(&some)
}

/// Every variant, every mutual occlusion, both projections; from afar, close by and from within; behind soft and
/// opaque matter.
#[test]
fn steps_that_are_left_out_change_nothing() {
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
                        let left_out = off_everywhere(&name, &scene, lighting);
                        shares.push((place, left_out));
                    }
                }
            }
        }
    }
    println!("{shares:?}");
    assert!(shares.iter().all(|(place, share)| *place != "afar" || *share > 10.0), "something is left out");
}

fn plan_of(sight: &Sight, slice_mm: f64, depths: (f64, f64)) -> SlicePlan {
    let lighting = LightSettings { slice_mm, ..LightSettings::DEFAULT };
    SlicePlan::new(&slice_settings(&lighting), sight, Some(depths), &[depths])
}

fn covers(rects: &[Rect], pixel: [i32; 2]) -> bool {
    rects.iter().any(|r| (0..2).all(|a| (r.low[a]..r.high[a]).contains(&pixel[a])))
}

/// By brute force: how much light may be lost at a pixel, step by step, and how much of it is asked for.
#[test]
fn reach_is_all_that_brute_force_finds() {
    let size = [61u32, 43];
    let scene = scene(false, false, Projection::Orthographic);
    let sight = Sight::new(&scene.camera, size);
    let depths = (100.0, 140.0);
    let mut spared = Vec::new();
    for (slice_mm, groups) in [(2.0, 128), (0.25, 128), (0.25, 7)] {
        let plan = plan_of(&sight, slice_mm, depths);
        let seen =
            |low: [i32; 2], high: [i32; 2], depths_mm| ScreenBounds { rect: Rect { low, high }, depths_mm };
        let image = [seen([5, 6], [9, 11], (104.0, 111.0)), seen([30, 20], [33, 28], (123.0, 127.0))];
        let solid = seen([40, 8], [44, 10], (107.0, 115.0));
        for (parts, casts, shades) in [
            (SolidParts::None, true, true),
            (SolidParts::Within(solid), true, true),
            (SolidParts::Within(solid), false, true),
            (SolidParts::Within(solid), true, false),
            (SolidParts::Anywhere, false, true),
        ] {
            let found = reach_in_groups(&plan, &sight, &image, parts, (casts, shades), groups);
            assert_eq!(found.len(), plan.steps.len());
            let inside = |s: &ScreenBounds, p: [i32; 2]| covers(&[s.rect], p);
            let pixels: Vec<[i32; 2]> =
                (0..size[1] as i32).flat_map(|y| (0..size[0] as i32).map(move |x| [x, y])).collect();
            let count = plan.steps.len();
            let span = |k: usize| {
                let s = &plan.steps[k];
                (s.depth_mm, s.depth_mm + f64::from(s.slices) * plan.slice_mm)
            };
            let matter = |k: usize, p: [i32; 2]| {
                image.iter().any(|s| inside(s, p) && s.depths_mm.0 < span(k).1 && s.depths_mm.1 > span(k).0)
            };
            let awaited = |k: usize, p: [i32; 2]| match parts {
                SolidParts::None => false,
                SolidParts::Within(s) => inside(&s, p) && s.depths_mm.1 > span(k).0,
                SolidParts::Anywhere => true,
            };
            let set = |all: &mut [f64], is: &dyn Fn([i32; 2]) -> bool| {
                pixels.iter().zip(all).for_each(|(p, a)| *a = if is(*p) { 1.0 } else { *a });
            };
            let nothing = vec![0.0; pixels.len()];
            let mut asked = vec![nothing.clone(); count];
            for k in (0..count).rev() {
                if k + 1 < count {
                    asked[k] = carried(&asked[k + 1], size, &plan.steps[k + 1].kernel);
                }
                set(&mut asked[k], &|p| matter(k, p) || awaited(k, p));
            }
            let (mut lost, mut apart) = (nothing.clone(), nothing);
            let mut left_out = 0;
            for k in 0..count {
                let kernel = &plan.steps[k].kernel;
                let begun = |p: [i32; 2]| match parts {
                    SolidParts::Within(s) => inside(&s, p) && s.depths_mm.0 < span(k).1,
                    SolidParts::None => false,
                    SolidParts::Anywhere => true,
                };
                lost = carried(&lost, size, kernel);
                apart = carried(&apart, size, kernel);
                set(&mut lost, &|p| matter(k, p) || casts && begun(p));
                set(&mut apart, &|p| begun(p) && (casts || inside(&solid, p)));
                for (n, p) in pixels.iter().enumerate() {
                    let StepReach { among_solid, alike } = &found[k];
                    let times =
                        [among_solid, alike].iter().map(|r| usize::from(covers(r, *p))).sum::<usize>();
                    let all = among_solid.iter().chain(alike);
                    let twice = all.filter(|r| covers(std::slice::from_ref(r), *p)).count();
                    assert!(times <= 1 && twice <= 1, "once at most");
                    let counts = |light: f64| light * asked[k][n] > 1e-7;
                    if counts(lost[n]) {
                        assert_eq!(times, 1, "{parts:?} step {k}: {p:?} is missing");
                        let differs = counts(apart[n]) || !shades;
                        if differs && !matches!(parts, SolidParts::None) {
                            assert!(covers(among_solid, *p), "{parts:?} step {k}: {p:?} has two lights");
                        }
                    }
                    left_out += usize::from(times == 0);
                }
            }
            let share = left_out as f64 / (pixels.len() * count) as f64;
            spared.push(share);
            assert!(share > 0.1, "{parts:?}: {left_out} of {}", pixels.len() * count);
        }
    }
    println!("left out: {spared:.2?}");
}

/// Through a footprint: what each pixel has of its neighbours.
fn carried(from: &[f64], size: [u32; 2], kernel: &Kernel) -> Vec<f64> {
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

/// What is seen of a box lies in its rectangle, and what reaches behind the eye may be anywhere.
#[test]
fn rectangles_hold_what_they_are_of() {
    let scene = scene(false, false, Projection::Perspective);
    let size = [128, 96];
    let sight = Sight::new(&scene.camera, size);
    let corners = |middle: DVec3| {
        std::array::from_fn::<_, 8, _>(|i| {
            middle + DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { 3.0 } else { -3.0 }))
        })
    };
    let seen = ScreenBounds::of(&sight, &corners(DVec3::new(4.0, -3.0, 2.0))).unwrap();
    let mut inside = 0;
    for y in 0..size[1] {
        for x in 0..size[0] {
            let met = (0..400).any(|i| {
                let depth = seen.depths_mm.0 + (seen.depths_mm.1 - seen.depths_mm.0) * f64::from(i) / 399.0;
                let off = sight.at_mm([x, y], depth) - DVec3::new(4.0, -3.0, 2.0);
                off.abs().max_element() <= 3.0
            });
            inside += usize::from(met);
            assert!(!met || covers(&[seen.rect], [x as i32, y as i32]), "{x} {y} of {seen:?}");
        }
    }
    assert!(inside > 50 && seen.rect.pixels() < 6 * inside as u64, "{inside} of {seen:?}");
    assert_eq!(ScreenBounds::of(&sight, &corners(sight.eye_mm)).unwrap().rect, Rect::whole(size));
    assert!(ScreenBounds::of(&sight, &corners(sight.eye_mm - 50.0 * sight.forward)).is_none());
}
