//! Shapes over value and gradient magnitude in the context view, compared with geometry: made images whose values and
//! gradients are known in closed form.

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Selection,
    grid::ijk,
    optics::{Camera, Projection},
};

use crate::{
    ContextRenderer, ContextScene,
    image::{Form, Shape, TransferFunction},
    light::LIGHTS,
    scene::{LightSettings, LightingMode, MaskColors, Palette, Quality},
    testing::{GPU, grid},
    views::context::reference::box_interval,
};

const SIZE: [u32; 2] = [120, 80];
const BLUE: [u8; 3] = [0, 0, 255];
const RED: [u8; 3] = [255, 0, 0];

fn shapes(shapes: &[(Form, [u8; 3])]) -> Arc<TransferFunction> {
    let mut transfer = TransferFunction::transparent();
    let shapes = shapes.iter().map(|&(form, color)| Shape { form, color, opacity: 1.0 }).collect();
    transfer.set_shapes(Some(shapes)).unwrap();
    Arc::new(transfer)
}

fn scene(grid: &Grid, value: impl Fn(DVec3) -> f64, transfer: Arc<TransferFunction>) -> ContextScene {
    let dims = grid.dims();
    let at = |l: usize| {
        grid.world_from_voxel().transform_point3(DVec3::from_array(ijk(dims, l).map(|c| c as f64)))
    };
    let values = (0..grid.voxel_count()).map(|l| value(at(l))).collect();
    let orientation = Camera::orientation(0.0, 0.0);
    ContextScene {
        camera: Camera {
            height_mm: 80.0,
            ..Camera::fit(grid.center_mm(), 1.0, orientation, Projection::Orthographic)
        },
        volume: Some(crate::light::suite::image_of(grid, values)),
        transfer,
        projection: None,
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 1]),
        lens: None,
        tubes: Vec::new(),
        background: [0, 0, 0],
        silhouette: [0, 0, 0],
    }
}

/// Steps and slices well below the ball's visible shell of 1 mm.
fn quality(mode: LightingMode) -> Quality {
    let lighting = LightSettings { mode, slice_mm: 0.4, ..LightSettings::DEFAULT };
    Quality { context_step_mm: 0.3, lighting, ..Quality::FULL }
}

/// Per pixel, whether blue and whether red lead.
fn hues(scene: &ContextScene, mode: LightingMode) -> Vec<[bool; 2]> {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let rgba = renderer.render(&GPU, scene, &quality(mode), SIZE).unwrap().read_rgba(&GPU).unwrap();
    let leads = |a: u8, b: u8| a > 30 && u32::from(a) > 2 * u32::from(b);
    rgba.chunks(4).map(|p| [leads(p[2], p[0]), leads(p[0], p[2])]).collect()
}

/// Two materials of one intensity: a wide region of 50 that falls by 2 per millimetre, and the border of a ball of 100,
/// which passes 50 by 20 per millimetre. By values alone both look the same; two boxes tell them apart, in every
/// lighting mode: counted against the ball's and the region's geometry.
#[test]
fn materials_of_one_intensity_are_told_apart_by_their_gradient() {
    // Anisotropic, so that gradients per voxel would be off by up to three.
    let grid = Grid::axis_aligned([110, 20, 72], DVec3::new(1.0, 3.0, 1.0), DVec3::ZERO).unwrap();
    let (middle, radius_mm, region_mm) = (DVec3::new(80.0, 28.5, 36.0), 20.0, 20.0);
    let value = |p: DVec3| {
        let ball = 100.0 * ((radius_mm + 2.5 - p.distance(middle)) / 5.0).clamp(0.0, 1.0);
        let region = 50.0 * (1.0 - (p.x - region_mm) / 25.0).clamp(0.0, 1.0);
        ball.max(region)
    };
    let values = [40.0, 60.0];
    let flat = Form::Box { values, gradients_per_mm: [0.0, 5.0], soft: 0.0 };
    let steep = Form::Box { values, gradients_per_mm: [8.0, 40.0], soft: 0.0 };
    let both = scene(&grid, value, shapes(&[(flat, BLUE), (steep, RED)]));
    // Seen from the front: x to the left, z up. Values of 40 to 60 reach 0.5 mm past the ball's radius, and past the
    // region's edge 5 mm. Two millimetres about borders are left out: voxels of 3 mm round the ball off.
    let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
    let expected: Vec<Option<[bool; 2]>> = (0..SIZE[0] * SIZE[1])
        .map(|at| {
            let pixel = DVec2::new(f64::from(at % SIZE[0]) + 0.5, f64::from(at / SIZE[0]) + 0.5);
            let ray = both.camera.ray(pixel, size);
            let (near, far) = box_interval(&grid, &ray);
            let off = ray.origin_mm - middle;
            let from_ball = (off - ray.direction * off.dot(ray.direction)).length() - (radius_mm + 0.5);
            let from_region = ray.origin_mm.x - (region_mm + 5.0);
            let inside = near < far;
            let near_edge = from_ball.abs() < 2.0 || from_region.abs() < 2.0 || (inside && far - near < 50.0);
            (!near_edge).then_some([inside && from_region < 0.0, inside && from_ball < 0.0])
        })
        .collect();
    let count = |which: usize| expected.iter().flatten().filter(|e| e[which]).count();
    assert!(count(0) > 1500 && count(1) > 900, "{} {}", count(0), count(1));
    for row in &LIGHTS {
        let found = hues(&both, row.mode);
        let wrong = found.iter().zip(&expected).filter(|(found, e)| e.is_some_and(|e| e != **found)).count();
        println!("{:?}: {wrong} of {} pixels", row.mode, expected.iter().flatten().count());
        assert_eq!(wrong, 0, "{:?}", row.mode);
    }
    // One of the boxes shows one of the materials, and values alone show both alike.
    let mode = LightSettings::DEFAULT.mode;
    for (form, which) in [(flat, 0), (steep, 1)] {
        let found = hues(&ContextScene { transfer: shapes(&[(form, BLUE)]), ..both.clone() }, mode);
        for (found, e) in found.iter().zip(&expected) {
            assert!(e.is_none_or(|e| found[0] == e[which]), "{form:?}");
        }
    }
    let any = Form::Box { values, gradients_per_mm: [0.0, 100.0], soft: 0.0 };
    let found = hues(&ContextScene { transfer: shapes(&[(any, BLUE)]), ..both }, mode);
    assert!(found.iter().zip(&expected).all(|(f, e)| e.is_none_or(|e| f[0] == (e[0] || e[1]))));
}

/// A linear image has one gradient magnitude everywhere, in millimetres of the patient however its voxels lie: a box about
/// it shows everything, one beside it nothing.
#[test]
fn gradient_magnitudes_are_per_millimetre_of_the_patient_whatever_the_voxels() {
    let turned = DMat3::from_rotation_z(0.5) * DMat3::from_rotation_x(-0.7);
    let slope = DVec3::new(3.0, -1.0, 2.0);
    for (dims, spacing_mm) in [([60; 3], DVec3::ONE), ([120, 60, 15], DVec3::new(0.5, 1.0, 4.0))] {
        let grid = grid(dims, turned * DMat3::from_diagonal(spacing_mm), DVec3::new(500.0, -300.0, 100.0));
        let center_mm = grid.center_mm();
        let at = |gradients_per_mm| Form::Box { values: [-1e4, 1e4], gradients_per_mm, soft: 0.0 };
        let shown = |gradients_per_mm| {
            let transfer = shapes(&[(at(gradients_per_mm), BLUE)]);
            let mut scene = scene(&grid, |p| slope.dot(p - center_mm), transfer);
            // Only the middle: outside, edge voxels extend and halve the differences.
            scene.camera.height_mm = 12.0;
            hues(&scene, LightSettings::DEFAULT.mode).iter().filter(|hue| hue[0]).count()
        };
        let steepness = 14f64.sqrt();
        assert_eq!(shown([0.98 * steepness, 1.02 * steepness]), (SIZE[0] * SIZE[1]) as usize, "{spacing_mm}");
        // Edges are as sharp as the table, a 253rd of the height.
        assert_eq!(shown([1.1 * steepness, 40.0]), 0, "{spacing_mm}");
    }
}

/// A box over all gradients is a 1-D function with two steps: every lighting mode draws both alike, through different
/// pipelines and tables.
#[test]
fn a_box_over_every_gradient_is_a_1_d_function() {
    use crate::image::ControlPoint;
    let mut s = crate::light::suite::scene(false, true, Projection::Perspective);
    let color = [220, 160, 120];
    let point = |value, opacity| ControlPoint { value, color, opacity };
    let points = vec![point(30.0, 0.0), point(50.0, 0.3), point(70.0, 0.0)];
    let one_d = Arc::new(TransferFunction::new(points, None).unwrap());
    let form = Form::Box { values: [30.0, 70.0], gradients_per_mm: [0.0, 1e4], soft: 1.0 };
    let mut function = TransferFunction::transparent();
    // Its upper edge is soft: at gradients of this image, up to 40, less than 1 % of the height.
    function.set_shapes(Some(vec![Shape { form, color, opacity: 0.3 }])).unwrap();
    let joint = Arc::new(function);
    for row in &LIGHTS {
        let mut draw = |transfer: &Arc<TransferFunction>| {
            s.transfer = Arc::clone(transfer);
            let mut renderer = ContextRenderer::new(&GPU).unwrap();
            renderer.render(&GPU, &s, &quality(row.mode), SIZE).unwrap().read_rgba(&GPU).unwrap()
        };
        let (a, b) = (draw(&one_d), draw(&joint));
        let worst = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        println!("{:?}: largest difference {worst} of 255", row.mode);
        // A random path takes another way where the opacities, which differ by up to 1 %, decide.
        let off =
            a.chunks(4).zip(b.chunks(4)).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 2));
        let share = off.count() as f64 / f64::from(SIZE[0] * SIZE[1]);
        assert!(share <= row.suite.decided_by_rounding, "{:?}: {worst}, {share} of the pixels", row.mode);
        assert!(
            a.chunks(4).filter(|p| p[3] > 0 && p[0] > p[2]).count() > 300,
            "{:?}: nothing is shown",
            row.mode
        );
    }
}
