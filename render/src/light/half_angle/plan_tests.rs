//! Half-angle slicing against closed forms and the exact integral; turning lights; work that is left out.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use glioscope_core::optics::{Camera, Projection, Sight};

use super::{
    plan::{mixed, turned},
    twin::{error, exact},
    twin_tests::{lamp, lit, plan_of},
};
use crate::{
    ContextRenderer, ContextScene,
    image::{ControlPoint, TransferFunction},
    light::suite::{cubic, image_of, lumps, scene, transfer},
    scene::{Lamp, Quality},
    testing::GPU,
};

/// The image of a frame in linear light, unlit tissue black.
fn drawn(
    renderer: &mut ContextRenderer,
    scene: &ContextScene,
    quality: &Quality,
    size: [u32; 2],
) -> Vec<[f64; 4]> {
    let quality = Quality { occlusion_strength: 1.0, ..*quality };
    let frame = renderer.render(&GPU, scene, &quality, size).unwrap();
    frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect()
}

/// A homogeneous cube has its closed form with any slabs: light from the eye, and from behind.
#[test]
fn a_homogeneous_image_has_its_closed_form() {
    let grid = cubic(20, DVec3::ONE);
    let points = [0.0, 1e6].map(|value| ControlPoint { value, color: [255; 3], opacity: 0.1 }).to_vec();
    let cube = ContextScene {
        volume: Some(image_of(&grid, vec![50.0; grid.voxel_count()])),
        transfer: Arc::new(TransferFunction::new(points, None).unwrap()),
        camera: Camera::fit(DVec3::ZERO, 12.0, Camera::orientation(0.0, 0.0), Projection::Orthographic),
        ..scene(false, false, Projection::Orthographic)
    };
    let thickness = -20.0 * 0.9f64.ln();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for (azimuth_deg, expected) in
        [(0.0, (1.0 - (-2.0 * thickness).exp()) / 2.0), (180.0, thickness * (-thickness).exp())]
    {
        for slice_mm in [0.5, 3.0, 100.0] {
            let size = [9, 9];
            let found = drawn(&mut renderer, &cube, &lit(lamp(azimuth_deg, 0.0), slice_mm, 1.0), size)[40];
            assert!((found[0] - expected).abs() < 1e-4, "{azimuth_deg} {slice_mm}: {found:?} {expected}");
            assert!((found[3] - (1.0 - (-thickness).exp())).abs() < 1e-4, "{found:?}");
        }
    }
}

#[test]
fn thinner_slabs_converge_to_the_exact_integral() {
    let size = [24, 22];
    let scene = scene(false, false, Projection::Perspective);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for lamp in [lamp(-45.0, 45.0), lamp(89.0, 0.0), lamp(130.0, -20.0)] {
        let truth = exact(&scene, lamp, size);
        let found = [4.0, 2.0, 1.0, 0.5, 0.25]
            .map(|mm| error(&drawn(&mut renderer, &scene, &lit(lamp, mm, mm), size), &truth));
        println!("{lamp:?}: {found:.5?}");
        assert!(found.windows(2).all(|pair| pair[1] < 1.05 * pair[0]), "{lamp:?}: {found:?}");
        assert!(found[4] < found[0] / 4.0, "{lamp:?}: {found:?}");
        assert!(found[4] < 2e-3, "{lamp:?}: {found:?}");
    }
}

/// A lamp that turns about the scene, past 90 degrees from the line of sight, where the half vector jumps: no frame differs
/// there from the one before it by more than frames do elsewhere (with thick slabs, by much more).
#[test]
fn a_turning_lamp_does_not_pop_at_right_angles() {
    let size = [48, 44];
    let scene = scene(false, false, Projection::Perspective);
    let step_deg = 0.5;
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    // Balanced has slabs of 1 mm, the reference thinner ones; 3 mm is for moving views on slow machines, where both cases differ
    // by 35 times what frames do.
    for (mm, times) in [(1.0, 1.0), (3.0, 1.25)] {
        let frames: Vec<(f64, Vec<[f64; 4]>)> = (0..=360)
            .map(|n| step_deg * f64::from(n))
            .map(|deg| (deg, drawn(&mut renderer, &scene, &lit(lamp(deg, 0.0), mm, mm), size)))
            .collect();
        let change = |pair: &[(f64, Vec<[f64; 4]>)]| {
            let squares =
                pair[0].1.iter().zip(&pair[1].1).flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2)));
            (squares.sum::<f64>() / f64::from(size[0] * size[1] * 3)).sqrt()
        };
        let half_deg = mixed(mm, 0.4).asin().to_degrees();
        let is_mixed =
            |pair: &[(f64, Vec<[f64; 4]>)]| (pair[0].0 + step_deg / 2.0 - 90.0).abs() < half_deg + step_deg;
        let most = |mixed: bool| {
            frames.windows(2).filter(|pair| is_mixed(pair) == mixed).map(change).fold(0.0, f64::max)
        };
        // What a switch at once would show, with or without hysteresis: both cases at a right angle.
        drawn(&mut renderer, &scene, &lit(lamp(90.0, 0.0), mm, mm), size);
        let eye = renderer.lights().probe().eye.unwrap();
        let cases: Vec<[f32; 4]> =
            bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(eye, 0, eye.size())]).unwrap()[0]);
        let (first, second) = cases.split_at(cases.len() / 2);
        let widened = |case: &[[f32; 4]]| (0.0, case.iter().map(|p| p.map(f64::from)).collect());
        let jump = change(&[widened(first), widened(second)]);
        println!(
            "slabs of {mm} mm: change at most {:.6} in the mixed range, {:.6} elsewhere; {jump:.6} between the cases",
            most(true),
            most(false)
        );
        assert!(most(true) <= times * most(false) && jump > 2.0 * most(false), "{mm}");
    }
}

/// Restricting slabs to what may matter changes no pixel.
#[test]
fn what_is_left_out_changes_no_pixel() {
    let size = [67, 43];
    let mut renderers = [false, true].map(|everywhere| {
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        renderer.lights_mut().everywhere = everywhere;
        renderer
    });
    for (with_tumor, projection, lamp) in [
        (true, Projection::Perspective, lamp(-45.0, 45.0)),
        (false, Projection::Orthographic, lamp(120.0, 10.0)),
        (true, Projection::Perspective, lamp(90.5, 3.0)),
    ] {
        let scene = scene(false, with_tumor, projection);
        let quality = lit(lamp, 1.3, 1.1);
        let [some, all] = renderers.each_mut().map(|renderer| {
            let rgba = renderer.render(&GPU, &scene, &quality, size).unwrap().read_rgba(&GPU).unwrap();
            (rgba, renderer.light_work().unwrap())
        });
        assert!(some.0 == all.0, "{lamp:?}");
        println!("{lamp:?}: {:?} of {:?}", some.1, all.1);
        assert!(some.1.samples * 10 < all.1.samples * 9 && some.1.slices == all.1.slices);
    }
}

/// However thin, wide or meaningless: bounded, said, and the frame is one.
#[test]
fn slabs_and_texels_are_bounded() {
    let scene = scene(false, false, Projection::Perspective);
    for (mm, notes) in [(1e-9, 2), (f64::NAN, 2), (-1.0, 2), (1e9, 2), (1.0, 0)] {
        for angle in [Lamp::DEFAULT, lamp(90.0, 0.0), lamp(f64::NAN, f64::INFINITY), lamp(180.0, 0.0)] {
            let sight = Sight::new(&scene.camera, [3000, 100]);
            let plan = plan_of(&scene, &lit(angle, mm, mm), [3000, 100]);
            assert_eq!(plan.notes.len(), notes, "{mm}: {:?}", plan.notes);
            let weights: f64 = plan.cases.iter().map(|case| case.weight).sum();
            assert!((weights - 1.0).abs() < 1e-12 && plan.texels.iter().all(|t| *t <= 2048), "{plan:?}");
            for case in &plan.cases {
                // Light crosses the slabs in their order, and so does every line of sight, or against it.
                let light = -turned(&scene.camera, angle.direction(&scene.camera));
                assert!(case.normal.dot(light) > 0.1, "{case:?}");
                for corner in [-1.0, 1.0].into_iter().flat_map(|x| [DVec2::new(x, -1.0), DVec2::new(x, 1.0)])
                {
                    let ray = (corner * DVec2::new(1500.0, 50.0) * sight.growth()).extend(1.0);
                    assert!(case.normal.dot(ray) * (if case.ahead { 1.0 } else { -1.0 }) > 0.0, "{case:?}");
                }
                assert!(case.slabs.len() <= 8192 && !case.slabs.is_empty(), "{}", case.slabs.len());
                assert!(case.slabs.windows(2).all(|pair| pair[0].front < pair[1].front));
            }
        }
    }
}

/// An image two metres wide, whose voxels are large: slabs and texels of a millimetre would be thousands. Those that are used are told,
/// and near the exact integral.
#[test]
fn large_voxels_have_few_slabs() {
    let grid = cubic(40, DVec3::splat(50.0));
    let scene = ContextScene {
        volume: Some(lumps(&grid)),
        transfer: transfer(false, 0.01),
        camera: Camera::fit(DVec3::ZERO, 1100.0, Camera::orientation(31.3, 19.7), Projection::Perspective),
        ..scene(false, false, Projection::Perspective)
    };
    let (size, angle) = ([24, 22], lamp(-45.0, 45.0));
    let plan = plan_of(&scene, &lit(angle, 1.0, 1.0), size);
    let slabs: usize = plan.cases.iter().map(|case| case.slabs.len()).sum();
    println!("{slabs} slabs, {:?} texels, {:?}", plan.texels, plan.notes);
    // Eight for each voxel of a diagonal at most.
    assert!(slabs <= 560 && plan.texels.iter().all(|t| *t <= 560) && plan.notes.len() == 2, "{slabs}");
    let picture = drawn(&mut ContextRenderer::new(&GPU).unwrap(), &scene, &lit(angle, 1.0, 1.0), size);
    let off = error(&picture, &exact(&scene, angle, size));
    println!("{off:.5}");
    assert!(off < 0.003, "{off}");
}
