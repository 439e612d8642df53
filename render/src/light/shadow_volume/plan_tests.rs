//! Shadow volume propagation against closed forms and the exact integral; turning lights.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{Projection, Sight},
};

use super::{
    plan::{Sweep, cells_per_mm, sweep},
    twin::cells_of,
    twin_tests::{lamp, lit},
};
use crate::{
    ContextRenderer, ContextScene,
    image::{ControlPoint, TransferFunction},
    light::{
        cones::grid::Cells,
        half_angle::{
            plan::turned,
            twin::{LampTwin, error, exact},
        },
        suite::{cubic, image_of, lumps, scene},
    },
    scene::{Lamp, LampFrame, Quality},
    testing::GPU,
};

/// The image of a frame in linear light, unlit tissue black.
fn drawn(
    renderer: &mut ContextRenderer,
    scene: &ContextScene,
    quality: &Quality,
    size: [u32; 2],
) -> Vec<[f64; 4]> {
    let quality = Quality { occlusion_strength: 1.0, context_step_mm: 0.25, ..*quality };
    let frame = renderer.render(&GPU, scene, &quality, size).unwrap();
    frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect()
}

/// A homogeneous cube lit along its axis has its closed form in every cell, for any cells.
#[test]
fn light_along_an_axis_has_its_closed_form() {
    let grid = cubic(20, DVec3::ONE);
    let points = [0.0, 1e6].map(|value| ControlPoint { value, color: [255; 3], opacity: 0.1 }).to_vec();
    let cube = ContextScene {
        volume: Some(image_of(&grid, vec![50.0; grid.voxel_count()])),
        transfer: Arc::new(TransferFunction::new(points, None).unwrap()),
        ..scene(false, false, Projection::Orthographic)
    };
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    // In front of the face: light travels backwards, along -y.
    let front = Lamp { frame: LampFrame::Patient, azimuth_deg: 0.0, elevation_deg: 0.0 };
    for cell_mm in [1.0, 2.0, 5.0] {
        drawn(&mut renderer, &cube, &lit(front, cell_mm), [9, 9]);
        let [light, _] = renderer.lights().probe().grid.unwrap();
        let found: Vec<[f32; 2]> =
            bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(light, 0, light.size())]).unwrap()[0]);
        let cells = Cells::new(&grid, cell_mm);
        for (n, light) in found.iter().enumerate() {
            // Outside the face that light leaves through, the light of the cell inside.
            let thickness_mm = (19.5 - cells.middle(n).y).clamp(0.0, 20.0 - cells.voxels.y / 2.0);
            let expected = 0.9f64.powf(thickness_mm);
            assert!((f64::from(light[0]) - expected).abs() < 1e-5, "{cell_mm} {n}: {light:?} {expected}");
        }
    }
}

/// In docs/studies.md.
#[test]
fn smaller_cells_converge_to_the_exact_integral() {
    let size = [24, 22];
    let scene = scene(false, false, Projection::Perspective);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for lamp in [lamp(-45.0, 45.0), lamp(89.0, 0.0), lamp(130.0, -20.0)] {
        let truth = exact(&scene, lamp, size);
        let found = [8.0, 4.0, 2.0, 1.0].map(|mm| {
            let begin = std::time::Instant::now();
            let picture = drawn(&mut renderer, &scene, &lit(lamp, mm), size);
            let work = renderer.light_work().unwrap();
            println!("{mm} mm: {work:?}, {:.1} ms", begin.elapsed().as_secs_f64() * 1e3);
            error(&picture, &truth)
        });
        println!("{lamp:?}: {found:.5?}");
        assert!(found.windows(2).all(|pair| pair[1] < pair[0]), "{lamp:?}: {found:?}");
        assert!(found[3] < found[0] / 3.0 && found[3] < 0.01, "{lamp:?}: {found:?}");
    }
}

/// A lamp that turns about the patient through the directions in which the sweep changes its axis: no frame differs there from the
/// one before it by more than frames do elsewhere. Where the published scheme changes it, at equal angles to two faces, it jumps.
#[test]
fn a_turning_lamp_does_not_pop_between_axes() {
    let size = [48, 44];
    let base = scene(false, false, Projection::Perspective);
    // Cells of 4 x 4 x 5 mm.
    let grid = Grid::axis_aligned([36, 36, 7], DVec3::new(1.0, 1.0, 5.0), DVec3::new(-17.5, -17.5, -15.0));
    let grid = grid.unwrap();
    let scene = ContextScene { volume: Some(lumps(&grid)), ..base };
    let cells = Cells::new(&grid, 4.0);
    assert_eq!(cells.voxels, DVec3::new(4.0, 4.0, 1.0));
    let step_deg = 0.5;
    // Above the patient's back to below the front, past 45 and 51.3 degrees.
    let at = |deg: f64| Lamp { frame: LampFrame::Patient, azimuth_deg: 0.0, elevation_deg: deg };
    let light = |deg: f64| -at(deg).direction(&scene.camera);
    let axis = |deg: f64| sweep(&grid, &cells, light(deg)).axis;
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let mut frame = |deg: f64| {
        let picture = drawn(&mut renderer, &scene, &lit(at(deg), 4.0), size);
        let [light, _] = renderer.lights().probe().grid.unwrap();
        let bytes = GPU.read_buffers(&[(light, 0, light.size())]).unwrap();
        let light: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&bytes[0]);
        let picture: Vec<f64> = picture.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
        (deg, picture, light.iter().map(|l| f64::from(l[0])).collect::<Vec<f64>>())
    };
    let frames: Vec<_> = (0..=160).map(|n| frame(step_deg * f64::from(n))).collect();
    let change = |a: &[f64], b: &[f64]| {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    };
    let most = |at_change: bool, of: &dyn Fn(usize) -> f64| {
        let changes = |n: usize| axis(frames[n].0) != axis(frames[n + 1].0);
        let of_all = (0..160).filter(|n| changes(*n) == at_change).map(of);
        of_all.fold(f64::NEG_INFINITY, f64::max)
    };
    let of_picture = |n: usize| change(&frames[n].1, &frames[n + 1].1);
    let of_cells = |n: usize| change(&frames[n].2, &frames[n + 1].2);
    // Both sweeps at equal angles to the faces, and where ours changes.
    let sight = Sight::new(&scene.camera, size);
    let jump = |deg: f64| {
        let twin = LampTwin {
            scene: &scene,
            sight: &sight,
            reference_mm: scene.reference_mm(),
            light: turned(&scene.camera, light(deg)),
            voxels: None,
            shift_mm: 0.0,
        };
        let rate = cells_per_mm(&grid, &cells, light(deg));
        let [a, b] = [1, 2].map(|axis| {
            let cells = cells_of(&twin, &grid, &cells, &Sweep::along(axis, rate));
            cells.iter().map(|l| l[0]).collect::<Vec<f64>>()
        });
        change(&a, &b)
    };
    let (published, ours) = (jump(45.0), jump(f64::atan2(5.0, 4.0).to_degrees()));
    println!(
        "picture: {:.6} where the axis changes, at most {:.6} elsewhere; cells: {:.6}, {:.6}; both sweeps differ by {published:.6} at 45 \
         degrees, by {ours:.1e} where they tie",
        most(true, &of_picture),
        most(false, &of_picture),
        most(true, &of_cells),
        most(false, &of_cells)
    );
    assert!(most(true, &of_picture) <= most(false, &of_picture) && most(true, &of_picture) > 0.0);
    assert!(most(true, &of_cells) <= most(false, &of_cells));
    assert!(published > 1.5 * most(false, &of_cells) && ours < 1e-9);
}
