//! The projection of a second image against its definition in `f64`, and against closed forms.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Samples, Scaling, Selection, Sides, Volume,
    optics::{Camera, Projection, Ray},
};

use super::{
    Context,
    projection::{ImageProjection, PROJECTION},
    reference::{box_interval, in_index_space, value_at},
    scene::ContextScene,
};
use crate::{
    ColorMap, MaskColors, Palette, Quality,
    flat::Window,
    image::{ContextVolume, TransferFunction, uniforms::step_mm},
    testing::{self, BenchGuard, SharedBench, lock, noise},
    views::view3d::Switches,
};

type Bench = testing::Bench<Context>;

fn bench() -> BenchGuard<Context> {
    static BENCH: SharedBench<Context> = SharedBench::new();
    lock(&BENCH)
}

const SIZE: [u32; 2] = [72, 60];
const BACKGROUND: [u8; 3] = [10, 20, 30];

fn image(grid: &Grid, value: impl Fn([usize; 3]) -> f64) -> Arc<ContextVolume> {
    let values = (0..grid.voxel_count()).map(|l| value(grid.ijk(l))).collect();
    let volume = Volume::new(grid.clone(), Samples::F64(values), Scaling::NONE).unwrap();
    Arc::new(ContextVolume::new(Arc::new(volume)))
}

fn oblique(dims: [usize; 3], spacing_mm: DVec3, origin_mm: DVec3) -> Grid {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).try_normalize().unwrap(), 0.4);
    let matrix3 = turn * DMat3::from_diagonal(spacing_mm);
    Grid::new(dims, DAffine3 { matrix3, translation: origin_mm }, Sides::Known).unwrap()
}

/// Spots of different heights over noise.
fn spots(grid: &Grid) -> Arc<ContextVolume> {
    let dims = grid.dims();
    image(grid, |p| {
        let x = DVec3::from_array(std::array::from_fn(|a| (p[a] as f64 + 0.5) / dims[a] as f64));
        let spot = |at: DVec3, height: f64| height * (-(x - at).length_squared() * 60.0).exp();
        spot(DVec3::new(0.3, 0.4, 0.5), 9.0) + spot(DVec3::new(0.7, 0.6, 0.3), 5.0) + noise(p, 7)
    })
}

fn second(volume: Arc<ContextVolume>) -> ImageProjection {
    let window = Window { low: 0.0, high: 10.0 };
    ImageProjection { volume, window, map: ColorMap::Viridis, opacity: 1.0, threshold: -1.0 }
}

fn scene(projection: Option<ImageProjection>, grid: &Grid, kind: Projection) -> ContextScene {
    let center_mm = grid.center_mm();
    let radius_mm = grid.corners_mm().iter().map(|c| c.distance(center_mm)).fold(0.0, f64::max) * 0.8;
    ContextScene {
        volume: None,
        transfer: Arc::new(TransferFunction::transparent()),
        projection,
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 2]),
        lens: None,
        tubes: Vec::new(),
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(35.0, 20.0), kind),
        background: BACKGROUND,
        silhouette: [0, 0, 0],
    }
}

/// The largest value along a pixel's ray, at the middles of steps of `step_mm`; `None` where it misses the image.
fn most_along(of: &ImageProjection, ray: &Ray, step_mm: f64) -> Option<f64> {
    let image = of.volume.image();
    let grid = image.grid();
    let (near, far) = box_interval(grid, ray);
    let near = near.max(0.0);
    let (o, d) = in_index_space(grid, ray);
    let steps = ((far - near) / step_mm).max(0.0).round() as usize;
    (0..steps).map(|k| value_at(image, o + (near + (k as f64 + 0.5) * step_mm) * d)).reduce(f64::max)
}

fn step_of(of: &ImageProjection) -> f64 {
    step_mm(&of.volume, Quality::FULL.context_step_mm)
}

/// The picture by definition.
fn twin(scene: &ContextScene, step_mm: f64) -> Vec<[u8; 3]> {
    let of = scene.projection.as_ref().unwrap();
    let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
    let pixel = |x: u32, y: u32| {
        let ray = scene.camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), size);
        let most = most_along(of, &ray, step_mm).filter(|most| *most > of.threshold);
        let Some(most) = most else { return BACKGROUND };
        let share = ((most - of.window.low) / (of.window.high - of.window.low)).clamp(0.0, 1.0);
        let over = of.map.color((share * 255.0).round() / 255.0);
        std::array::from_fn(|c| {
            let (under, over) = (f64::from(BACKGROUND[c]), f64::from(over[c]));
            (under + (over - under) * f64::from(of.opacity)).round() as u8
        })
    };
    (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
}

fn drawn_with(bench: &mut Bench, scene: &ContextScene, switches: Switches) -> Vec<[u8; 3]> {
    let (gpu, quality) = (&bench.gpu, Quality::FULL);
    let plan = super::context_plan(scene, &quality);
    let frame = bench.renderer.render_planned(gpu, scene, &quality, SIZE, plan, switches).unwrap();
    frame.read_rgba(gpu).unwrap().chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect()
}

fn drawn(bench: &mut Bench, scene: &ContextScene) -> Vec<[u8; 3]> {
    drawn_with(bench, scene, Switches::ON)
}

/// Share of pixels that differ by more than `levels`.
fn share_off(a: &[[u8; 3]], b: &[[u8; 3]], levels: u8) -> f64 {
    let off = a.iter().zip(b).filter(|(a, b)| a.iter().zip(*b).any(|(x, y)| x.abs_diff(*y) > levels)).count();
    off as f64 / a.len() as f64
}

#[test]
fn the_projection_is_the_largest_value_along_each_ray() {
    let mut bench = bench();
    let grids = [
        oblique([30, 25, 21], DVec3::new(1.0, 1.5, 2.0), DVec3::ZERO),
        oblique([30, 25, 21], DVec3::ONE, DVec3::new(1e6, -1e6, 3e5)),
        oblique([40, 40, 4], DVec3::new(1.0, 1.0, 12.0), DVec3::ZERO),
        oblique([1, 1, 1], DVec3::splat(8.0), DVec3::ZERO),
    ];
    for grid in &grids {
        for kind in [Projection::Perspective, Projection::Orthographic] {
            let one = ImageProjection { opacity: 0.7, threshold: 2.0, ..second(spots(grid)) };
            for of in [second(spots(grid)), one] {
                let step = step_of(&of);
                let scene = scene(Some(of), grid, kind);
                let (found, expected) = (drawn(&mut bench, &scene), twin(&scene, step));
                // Values at the edge of a level, and rays that graze the box.
                let off = share_off(&found, &expected, 3);
                assert!(off < 0.01, "{:?} {kind:?}: {off}", grid.dims());
            }
        }
    }
}

#[test]
fn skipping_changes_no_pixel_and_half_a_voxel_is_near_the_limit() {
    let mut bench = bench();
    let grid = oblique([40, 33, 50], DVec3::ONE, DVec3::ZERO);
    let scene = scene(Some(second(spots(&grid))), &grid, Projection::Perspective);
    let found = drawn(&mut bench, &scene);
    assert_eq!(drawn_with(&mut bench, &scene, Switches::skipping(false)), found);
    // Of the window's 256 levels, as values.
    let of = scene.projection.as_ref().unwrap();
    let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
    let mut worst = 0.0_f64;
    for (x, y) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))).step_by(7) {
        let ray = scene.camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), size);
        let along = |share: f64| most_along(of, &ray, step_of(of) * share);
        if let (Some(coarse), Some(fine)) = (along(1.0), along(1.0 / 16.0)) {
            worst = worst.max((fine - coarse) / 10.0);
        }
    }
    assert!(worst < 0.06, "{worst}");
}

#[test]
fn a_bright_voxel_behind_everything_shows_and_one_that_is_not_finite_does_not() {
    let mut bench = bench();
    let grid = Grid::axis_aligned([9; 3], DVec3::splat(2.0), DVec3::ZERO).unwrap();
    for bright in [8.0, f64::NAN, f64::INFINITY] {
        let volume = image(&grid, |p| if p == [4, 4, 0] { bright } else { 1.0 });
        let projection = ImageProjection { map: ColorMap::Grey, ..second(volume) };
        let scene = scene(Some(projection), &grid, Projection::Orthographic);
        let middle = drawn(&mut bench, &scene);
        let brightest = middle.iter().map(|p| p[0]).max().unwrap();
        // 8 and 1 of a window to 10, as far as samples meet the voxel's centre.
        let expected = if bright == 8.0 { 140..=204 } else { 25..=26 };
        assert!(expected.contains(&brightest), "{bright}: {brightest}");
    }
}

#[test]
fn without_a_second_image_nothing_is_done_and_nothing_changes() {
    let mut bench = bench();
    let grid = oblique([20, 20, 20], DVec3::ONE, DVec3::ZERO);
    let none = scene(None, &grid, Projection::Perspective);
    let plain = drawn(&mut bench, &none);
    assert!(plain.iter().all(|p| *p == BACKGROUND));
    let hidden = ImageProjection { opacity: 0.0, ..second(spots(&grid)) };
    let far = ImageProjection { threshold: f64::INFINITY, ..second(spots(&grid)) };
    for (projection, is_run) in [(hidden, false), (far, true)] {
        let scene = ContextScene { projection: Some(projection), ..none.clone() };
        let plan = super::context_plan(&scene, &Quality::FULL);
        assert_eq!(plan.has(PROJECTION), is_run);
        assert_eq!(drawn(&mut bench, &scene), plain);
    }
}
