//! Vicinity occlusion instead of screen-space light.

use glioscope_core::optics::{Sight, poisson::poisson_disc, srgb};

use super::*;
use crate::{
    light::{
        NO_IMAGE,
        cones::LIGHT_GRID,
        layers::{self, LAYERS},
        slices::SLICES,
        vicinity::{self, VICINITY},
    },
    scene::LightSettings,
};

const SIZE: [u32; 2] = [90, 70];

fn lit(mode: LightingMode) -> Quality {
    Quality { lighting: LightSettings { mode, ..LightSettings::DEFAULT }, ..Quality::FULL }
}

fn drawn(bench: &mut Bench, scene: &EllipsoidScene, quality: &Quality) -> Vec<u8> {
    bits(bench, scene, quality, ellipsoid_plan(scene, quality), true)
}

#[test]
fn slices_and_cones_use_vicinity_occlusion() {
    let mut bench = bench();
    let scene = random(40, 10, DVec3::ZERO, 0.4);
    let [slices, cones] = [LightingMode::Slices, LightingMode::Cones].map(lit);
    let names = [LISTS, LAYERS, VICINITY, COMPOSE];
    assert_eq!(ellipsoid_plan(&scene, &slices).passes, names);
    assert_eq!(ellipsoid_plan(&scene, &slices).omitted, [(SLICES, NO_IMAGE)]);
    assert_eq!(ellipsoid_plan(&scene, &cones).passes, names);
    assert_eq!(ellipsoid_plan(&scene, &cones).omitted, [(LIGHT_GRID, NO_IMAGE)]);
    let by_slices = drawn(&mut bench, &scene, &slices);
    assert!(by_slices == drawn(&mut bench, &scene, &cones));
    assert!(by_slices != drawn(&mut bench, &scene, &Quality::FULL));
    // Without strength, reach, or anything to light.
    let flat = drawn(&mut bench, &scene, &FLAT);
    assert!(flat != by_slices);
    let empty = EllipsoidScene { ellipsoids: Arc::new(Vec::new()), ..scene.clone() };
    let of = |lighting| Quality { lighting, ..slices };
    for (scene, quality, reason) in [
        (&scene, Quality { occlusion_strength: 0.0, ..slices }, "occlusion strength is 0"),
        (
            &scene,
            of(LightSettings { vicinity_mm: 0.0, ..slices.lighting }),
            "nothing darkens opaque surfaces",
        ),
        (&empty, slices, "no ellipsoids"),
    ] {
        let plan = ellipsoid_plan(scene, &quality);
        assert!(plan.omitted.contains(&(VICINITY, reason)), "{plan:?}");
        let lean = bits(&mut bench, scene, &quality, plan.clone(), true);
        bits(&mut bench, &random(40, 11, DVec3::ZERO, 0.4), &slices, ellipsoid_plan(scene, &slices), true);
        let all = Plan { passes: names.to_vec(), omitted: Vec::new() };
        let all = bits(&mut bench, scene, &quality, all, true);
        assert!(lean[..] == all[..lean.len()], "{reason}");
    }
}

/// A small ball in front of a wall, which is a large ball: the wall is darker close to the small one in the frame, as far as
/// its shadow reaches.
#[test]
fn an_ellipsoid_darkens_what_is_behind_its_edge() {
    let mut bench = bench();
    let one = |id, center_mm, semi, color| DrawnEllipsoid {
        id,
        center_mm,
        semi_axes_mm: DVec3::splat(semi),
        rotation: DMat3::IDENTITY,
        color,
        opacity: 1.0,
    };
    let wall = one(1, DVec3::ZERO, 30.0, [200, 200, 200]);
    let mut alone = scene_of(vec![wall], DVec3::ZERO, 20.0);
    let towards_eye = alone.camera.axes()[2];
    alone.camera.height_mm = 46.0;
    let both = vec![wall, one(2, towards_eye * 33.0, 2.2, [200, 60, 60])];
    let with = EllipsoidScene { ellipsoids: Arc::new(both), ..alone.clone() };
    // Without ambient light.
    let quality = Quality { occlusion_strength: 1.0, ..lit(LightingMode::Slices) };
    let n = (SIZE[0] * SIZE[1]) as usize;
    let render = |bench: &mut Bench, scene: &EllipsoidScene| {
        let Bench { gpu, renderer } = bench;
        let frame = renderer.render(gpu, scene, &quality, SIZE).unwrap();
        let read = gpu
            .read_buffers(&[
                (&frame.targets.depths, 0, 4 * n as u64),
                (&frame.targets.surfaces, 0, 8 * n as u64),
                (&frame.targets.blurred, 0, 4 * n as u64),
            ])
            .unwrap();
        let depths: Vec<f32> = bytemuck::pod_collect_to_vec(&read[0]);
        let surfaces: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read[1]);
        let ids: Vec<u32> = surfaces.iter().map(|s| frame.data.drawn[s[0] as usize].id).collect();
        let blurred: Vec<u32> = bytemuck::pod_collect_to_vec(&read[2]);
        (frame.read_rgba(gpu).unwrap(), depths, ids, blurred, frame.reference_mm)
    };
    let (plain, _, _, open, _) = render(&mut bench, &alone);
    let (found, depths, ids, blurred, reference_mm) = render(&mut bench, &with);
    let lighting = quality.lighting;
    let sight = Sight::new(&with.camera, SIZE);
    let from_eye: Vec<f32> =
        depths.iter().map(|d| if *d < FAR { d + reference_mm as f32 } else { *d }).collect();
    let slope = 1.0 / lighting.aperture_deg.to_radians().tan();
    let radius_mm = vicinity::twin::radius_mm(lighting.vicinity_mm, lighting.aperture_deg);
    let points = poisson_disc(lighting.vicinity_samples);
    let pixel_mm = |depth| sight.pixel_mm(depth);
    let corners = crate::solid::corners_mm(with.bounds_mm().unwrap());
    let plan = layers::LayerPlan::new(&lighting, &with.camera, SIZE, &corners).unwrap();
    let twin = vicinity::twin::vicinity(&from_eye, SIZE, pixel_mm, radius_mm, (slope, plan.lag_mm), &points);
    let depths_mm: Vec<f64> =
        from_eye.iter().map(|d| if *d < FAR { f64::from(*d) } else { f64::INFINITY }).collect();
    let afar = layers::twin::layers(&plan, &sight, &depths_mm, |_| true);
    let (mut near, mut darker, mut far, mut differing) = (0, 0, 0, 0);
    for i in 0..n {
        let light = twin[i] * afar[i];
        let off = (f64::from(blurred[i] >> 24) / 255.0 - (1.0 - srgb::encode(light))).abs();
        // One sample more or less, where it falls on a pixel's edge.
        assert!(off < 0.02, "{i}: {off}");
        differing += usize::from(off > 0.003);
        if ids[i] != 1 {
            continue;
        }
        let (a, b) = (found[4 * i], plain[4 * i]);
        // Depths are relative to another plane, so that the last digit may differ.
        assert!(a <= b.saturating_add(1), "{i}: {a} {b}");
        if blurred[i] == open[i] {
            far += 1;
            assert_eq!(a, b);
        } else if (blurred[i] >> 24) > (open[i] >> 24) + 10 {
            near += 1;
            darker += usize::from(a + 3 < b);
        }
    }
    println!("{darker} of {near} darker, {far} far off, {differing} different from the twin");
    assert!(
        near > 100 && darker == near && far > 700 && differing * 50 < n,
        "{darker} {near} {far} {differing}"
    );
}
