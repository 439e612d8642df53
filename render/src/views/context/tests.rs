//! The context view on Mesa's software adapter, compared with its twin and with geometry. Fails without
//! an adapter.

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Samples, Scaling, Volume,
    grid::ijk,
    optics::{Camera, Projection},
};

use super::{
    reference::{Sampling, march, march_shaded},
    *,
};
use crate::{
    ClipPlane,
    device::PassName,
    image::{
        CONTEXT, ContextVolume, ControlPoint, Form, GRADIENT_OPACITY, GradientPoint, Shape, TransferFunction,
    },
    light::{
        self,
        screen::{OCCLUSION, OCCLUSION_BLUR},
    },
    scene::{Lamp, Lens, LightSettings, MaskColors, Palette},
    testing::{self, BenchGuard, SharedBench, grid, lock, noise, small_device, volume},
    views::{ContextRenderer, view3d::Switches},
};

type Bench = testing::Bench<Context>;

fn bench() -> BenchGuard<Context> {
    static BENCH: SharedBench<Context> = SharedBench::new();
    lock(&BENCH)
}

const FLAT: Quality = Quality { occlusion_strength: 0.0, ..Quality::FULL };

fn image(grid: &Grid, value: impl Fn([usize; 3]) -> f64) -> Arc<ContextVolume> {
    let d = grid.dims();
    let values = (0..grid.voxel_count()).map(|l| value(ijk(d, l))).collect();
    let volume = Volume::new(grid.clone(), Samples::F64(values), Scaling::NONE).unwrap();
    Arc::new(ContextVolume::new(Arc::new(volume)))
}

fn transfer(rows: &[(f64, [u8; 3], f64)], gradient: Option<&[(f64, f64)]>) -> Arc<TransferFunction> {
    let points = rows.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect();
    let gradient =
        gradient.map(|g| g.iter().map(|&(gradient, factor)| GradientPoint { gradient, factor }).collect());
    Arc::new(TransferFunction::new(points, gradient).unwrap())
}

fn cubic(n: usize) -> Grid {
    Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::ZERO).unwrap()
}

/// A scene of an image alone.
fn scene(image: Arc<ContextVolume>, transfer: Arc<TransferFunction>) -> ContextScene {
    let corners = image.grid().corners_mm();
    let center_mm = image.grid().center_mm();
    let radius_mm = corners.iter().map(|c| c.distance(center_mm)).fold(0.0, f64::max) * 0.8;
    ContextScene {
        projection: None,
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(35.0, 20.0), Projection::Perspective),
        volume: Some(image),
        transfer,
        clip: Vec::new(),
        tumor: None,
        selection: glioscope_core::Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 2]),
        lens: None,
        tubes: Vec::new(),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

/// Smooth lumps with values from 0 to about 100, and 0 outside a ball.
fn lumps(grid: &Grid) -> Arc<ContextVolume> {
    let dims = grid.dims();
    image(grid, |p| {
        let x = DVec3::from_array(std::array::from_fn(|a| (p[a] as f64 + 0.5) / dims[a] as f64 - 0.5));
        let wave = (x.x * 17.0).sin() + (x.y * 13.0 + 1.0).sin() + (x.z * 11.0 + 2.0).sin();
        (55.0 + 12.0 * wave + 4.0 * noise(p, 5)) * ((0.5 - x.length()) * 6.0).clamp(0.0, 1.0)
    })
}

fn soft() -> Arc<TransferFunction> {
    transfer(&[(15.0, [90, 60, 40], 0.0), (50.0, [220, 160, 120], 0.15), (90.0, [255, 250, 230], 0.9)], None)
}

fn soft_2d() -> Arc<TransferFunction> {
    transfer(
        &[(10.0, [40, 60, 140], 0.0), (40.0, [220, 160, 120], 0.5), (90.0, [255, 250, 230], 1.0)],
        Some(&[(1.0, 0.0), (6.0, 0.4), (12.0, 1.0)]),
    )
}

/// A box, a trapezoid and a blob that overlap, all edges soft: hard ones lie within a cell of the device's table.
fn shaped() -> Arc<TransferFunction> {
    let forms = [
        Form::Box { values: [20.0, 70.0], gradients_per_mm: [0.0, 4.0], soft: 0.6 },
        Form::Trapezoid {
            gradients_per_mm: [2.0, 20.0],
            lower_values: [30.0, 40.0],
            upper_values: [10.0, 90.0],
            soft: 0.8,
        },
        Form::Blob {
            value: 60.0,
            gradient_per_mm: 3.0,
            value_deviation: 9.0,
            gradient_deviation_per_mm: 2.0,
        },
    ];
    let rest = [([230, 60, 40], 0.05), ([40, 160, 230], 0.3), ([250, 220, 90], 0.4)];
    let shapes = forms.into_iter().zip(rest).map(|(form, (color, opacity))| Shape { form, color, opacity });
    let mut transfer = TransferFunction::transparent();
    transfer.set_shapes(Some(shapes.collect())).unwrap();
    Arc::new(transfer)
}

/// The scene with a tumour of two overlapping balls in the middle of `grid`, the tumour's own.
fn with_tumor(mut scene: ContextScene, grid: &Grid) -> ContextScene {
    let dims = grid.dims();
    scene.tumor = volume(grid, 2, |k, p| {
        let r: f64 = (0..3)
            .map(|a| ((p[a] as f64 + 0.5) / dims[a] as f64 - 0.5 - 0.1 * (k as f64 - 0.5)).powi(2))
            .sum();
        r < 0.1 && noise(p, 3) > 0.05
    });
    scene
}

fn draw(
    bench: &mut Bench,
    scene: &ContextScene,
    quality: &Quality,
    size: [u32; 2],
    switches: Switches,
) -> Vec<Marched> {
    let plan = context_plan(scene, quality);
    bench
        .renderer
        .render_planned(&bench.gpu, scene, quality, size, plan, switches)
        .unwrap()
        .read_marched(&bench.gpu)
}

/// Mean and maximum difference of any channel, in 255ths, where no tumour hides the image.
fn difference(bench: &mut Bench, scene: &ContextScene, size: [u32; 2], jitter: bool) -> (f64, f64) {
    shaded_difference(bench, scene, size, jitter, FLAT.lighting)
}

fn shaded_difference(
    bench: &mut Bench,
    scene: &ContextScene,
    size: [u32; 2],
    jitter: bool,
    lighting: LightSettings,
) -> (f64, f64) {
    let step_mm = 0.6;
    let quality = Quality { context_step_mm: step_mm, lighting, ..FLAT };
    let found = draw(bench, scene, &quality, size, Switches { jitter, ..Switches::ON });
    let frame = bench.renderer.frame().unwrap();
    let depths = if scene.tumor.is_some() { frame.read_depths(&bench.gpu) } else { vec![FAR; found.len()] };
    let shade = light::shade(&quality, &scene.camera);
    let twin = march_shaded(scene, size, Sampling { step_mm, jitter }, &shade);
    let mut differences = Vec::new();
    let mut visible = 0;
    for ((found, twin), depth) in found.iter().zip(&twin).zip(depths) {
        if depth < FAR {
            assert_eq!(found.rgba()[3], 0.0, "the image in front of the tumour");
            continue;
        }
        visible += usize::from(twin[3] > 0.1);
        differences.extend(found.rgba().iter().zip(twin).map(|(a, b)| (a - b).abs() * 255.0));
    }
    assert!(visible * 30 > found.len(), "only {visible} pixels show the image");
    let worst = differences.iter().copied().fold(0.0, f64::max);
    (differences.iter().sum::<f64>() / differences.len() as f64, worst)
}

#[test]
fn gpu_matches_its_twin() {
    let far = DVec3::new(1e6, -1e6, 1e6);
    let shear =
        DMat3::from_cols(DVec3::new(-0.9, 0.1, 0.2), DVec3::new(0.3, 1.1, -0.1), DVec3::new(0.4, -0.2, 2.0));
    assert!(shear.determinant() < 0.0);
    let cases = [
        ("cube", grid([40; 3], DMat3::IDENTITY, DVec3::ZERO)),
        ("1:12", grid([48, 40, 9], DMat3::from_diagonal(DVec3::new(0.5, 0.5, 6.0)), DVec3::ZERO)),
        ("sheared, negative, at 1e6 mm", grid([34, 30, 22], shear, far)),
        ("a sheet", grid([40, 40, 1], DMat3::from_diagonal(DVec3::new(1.0, 1.0, 8.0)), DVec3::ZERO)),
    ];
    let mut bench = bench();
    for (name, grid) in cases {
        let center = grid.center_mm();
        // The tumour has its own grid, rotated against the image's.
        let turned = DMat3::from_rotation_z(0.4) * DMat3::from_diagonal(DVec3::new(-0.8, 0.7, 1.1));
        let tumor = self::grid([12, 14, 9], turned, center - turned * DVec3::new(6.0, 7.0, 4.5));
        for (kind, function) in [("1-D", soft()), ("2-D", soft_2d()), ("shapes", shaped())] {
            let mut s = with_tumor(scene(lumps(&grid), function), &tumor);
            for (projection, jitter) in [(Projection::Perspective, true), (Projection::Orthographic, false)] {
                s.camera.projection = projection;
                s.clip.clear();
                let (mean, worst) = difference(&mut bench, &s, [72, 60], jitter);
                s.clip = vec![
                    ClipPlane {
                        normal: DVec3::new(3.0, -1.0, 0.5),
                        offset_mm: DVec3::new(3.0, -1.0, 0.5).dot(center),
                    },
                    ClipPlane { normal: -DVec3::Z, offset_mm: -center.z + 4.0 },
                ];
                let (clipped_mean, clipped_worst) = difference(&mut bench, &s, [72, 60], jitter);
                println!(
                    "{name} {kind} {projection:?}: {mean:.3} {worst:.2}, clipped {clipped_mean:.3} {clipped_worst:.2}"
                );
                assert!(mean < 0.1 && worst <= 2.0, "{name} {kind}: {mean} {worst}");
                assert!(
                    clipped_mean < 0.1 && clipped_worst <= 2.0,
                    "{name} {kind}: {clipped_mean} {clipped_worst}"
                );
            }
        }
    }
}

#[test]
fn cameras_inside_and_past_the_image() {
    let mut bench = bench();
    let mut s = scene(lumps(&cubic(40)), soft());
    for projection in [Projection::Perspective, Projection::Orthographic] {
        s.camera.projection = projection;
        s.camera.height_mm = 6.0;
        let (mean, worst) = difference(&mut bench, &s, [48, 48], true);
        assert!(mean < 0.1 && worst <= 2.0, "{mean} {worst}");
    }
    s.camera.focus_mm -= s.camera.axes()[2] * 300.0;
    let found = draw(&mut bench, &s, &FLAT, [16, 16], Switches::ON);
    assert!(found.iter().all(|m| m.rgba() == [0.0; 4] && m.depth == FAR));
}

/// 1 − (1 − α)^L, whatever the step and the jitter.
#[test]
fn a_homogeneous_slab_has_its_closed_form() {
    let mut bench = bench();
    let grid = Grid::axis_aligned([30, 20, 30], DVec3::new(1.0, 0.85, 1.0), DVec3::splat(-7.0)).unwrap();
    let length = 17.0;
    for alpha in [1e-3, 0.1, 0.5, 1.0] {
        let mut s = scene(
            image(&grid, |_| 5.0),
            transfer(&[(0.0, [200, 100, 50], alpha), (9.0, [200, 100, 50], alpha)], None),
        );
        s.camera.projection = Projection::Orthographic;
        s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
        s.camera.height_mm = 20.0;
        let expected = TransferFunction::opacity_over(alpha, length);
        for step in [0.25, 0.7, 3.0, 40.0] {
            let found =
                draw(&mut bench, &s, &Quality { context_step_mm: step, ..FLAT }, [16, 16], Switches::ON);
            for m in found {
                let rgba = m.rgba();
                // Nearly opaque rays end early, and count as opaque.
                let close =
                    |a: f64, b: f64| (a - b).abs() < 2e-4 || (expected > 0.995 && (a - b).abs() < 5.1e-3);
                assert!(close(rgba[3], expected), "{alpha} {step}: {} {expected}", rgba[3]);
                assert!(close(rgba[0], expected * 200.0 / 255.0), "{alpha} {step}: {rgba:?}");
            }
        }
    }
}

/// Halving the step of the midpoint rule divides the error by four.
#[test]
fn smaller_steps_reduce_the_error() {
    let ball = image(&cubic(32), |p| {
        let r: f64 = p.iter().map(|&x| (x as f64 - 15.5).powi(2)).sum();
        100.0 * (-r / 60.0).exp()
    });
    let s = scene(ball, transfer(&[(0.0, [0, 0, 255], 0.0), (100.0, [255, 160, 0], 0.2)], None));
    let size = [24, 24];
    let at = |step_mm| march(&s, size, Sampling { step_mm, jitter: false });
    let truth = at(0.125);
    let error = |step_mm| {
        let sum: f64 =
            at(step_mm).iter().flatten().zip(truth.iter().flatten()).map(|(a, b)| (a - b).powi(2)).sum();
        (sum / (4 * truth.len()) as f64).sqrt()
    };
    let errors = [4.0, 2.0, 1.0].map(error);
    println!("errors {errors:?}");
    assert!(errors[0] / errors[1] > 2.5 && errors[1] / errors[2] > 2.5, "{errors:?}");
    let mut bench = bench();
    let drawn = |bench: &mut Bench, step| {
        let found = draw(bench, &s, &Quality { context_step_mm: step, ..FLAT }, size, Switches::ON);
        let sum: f64 = found.iter().zip(&truth).map(|(m, t)| (m.rgba()[3] - t[3]).powi(2)).sum();
        (sum / truth.len() as f64).sqrt()
    };
    let (coarse, fine) = (drawn(&mut bench, 4.0), drawn(&mut bench, 0.5));
    assert!(fine < 0.2 * coarse && fine < 2e-3, "{coarse} {fine}");
}

#[test]
fn skipping_empty_bricks_changes_no_bit() {
    let mut bench = bench();
    let shear =
        DMat3::from_cols(DVec3::new(-0.9, 0.1, 0.2), DVec3::new(0.3, 1.1, -0.1), DVec3::new(0.4, -0.2, 2.0));
    let spots = |grid: &Grid| {
        image(grid, |p| if noise(p.map(|x| x / 5), 8) > 0.9 { 50.0 + 50.0 * noise(p, 2) } else { 0.0 })
    };
    let grids = [cubic(65), grid([61, 50, 33], shear, DVec3::splat(1e5)), cubic(9), cubic(8), cubic(1)];
    for grid in grids {
        for function in [soft(), soft_2d()] {
            let mut s = scene(spots(&grid), function);
            for (az, projection) in [(35.0, Projection::Perspective), (0.0, Projection::Orthographic)] {
                s.camera.projection = projection;
                s.camera.world_from_camera = Camera::orientation(az, az / 2.0);
                let with = draw(&mut bench, &s, &FLAT, [96, 96], Switches::ON);
                let without =
                    draw(&mut bench, &s, &FLAT, [96, 96], Switches { skipping: false, ..Switches::ON });
                let bits = |m: &Marched| [m.red_green, m.blue_opacity, m.depth.to_bits()];
                assert!(with.iter().map(bits).eq(without.iter().map(bits)), "{:?}", grid.dims());
                assert!(grid.dims()[0] < 60 || with.iter().filter(|m| m.blue_opacity != 0).count() > 500);
            }
        }
    }
}

#[test]
fn clipping_planes_cut_the_image_where_they_are() {
    let mut bench = bench();
    let opaque = transfer(&[(0.0, [255; 3], 1.0), (1.0, [255; 3], 1.0)], None);
    let mut s = scene(image(&cubic(40), |_| 1.0), opaque);
    let normal = DVec3::new(-0.3, 0.8, 0.52);
    let plane = ClipPlane { normal: normal * 2.0, offset_mm: 2.0 * normal.dot(DVec3::splat(19.0)) };
    s.clip = vec![plane];
    s.camera.world_from_camera = Camera::orientation(20.0, 30.0);
    let size = [64, 64];
    let Bench { gpu, renderer } = &mut *bench;
    let frame = renderer.render(gpu, &s, &FLAT, size).unwrap().clone();
    let (mut on_plane, mut elsewhere) = (0, 0);
    for y in 0..64 {
        for x in 0..64 {
            let Some(pick) = frame.pick(gpu, x, y).unwrap() else { continue };
            assert_eq!(pick.bits, None);
            let off = normal.dot(pick.world_mm) - normal.dot(DVec3::splat(19.0));
            assert!(off < 1e-3, "{off} beyond the plane");
            let projected = s.camera.project(pick.world_mm, DVec2::splat(64.0)).unwrap();
            assert!(projected.distance(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) < 1e-6);
            // Within the first step behind the plane, or on a side of the cube.
            if off > -0.6 { on_plane += 1 } else { elsewhere += 1 }
        }
    }
    assert!(on_plane > 500 && elsewhere > 100, "{on_plane} {elsewhere}");
    // Edge-on, a plane through the middle hides half of the pixels.
    s.camera.projection = Projection::Orthographic;
    s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    s.clip = vec![ClipPlane { normal: DVec3::X, offset_mm: 19.5 }];
    let half = draw(&mut bench, &s, &FLAT, size, Switches::ON);
    s.clip.clear();
    let whole = draw(&mut bench, &s, &FLAT, size, Switches::ON);
    let count = |m: &[Marched]| m.iter().filter(|m| m.blue_opacity >> 16 > 60000).count();
    assert!(count(&half) * 2 == count(&whole), "{} {}", count(&half), count(&whole));
    // A plane beyond everything clips all of it.
    s.clip = vec![ClipPlane { normal: DVec3::Z, offset_mm: -1e5 }];
    assert_eq!(count(&draw(&mut bench, &s, &FLAT, size, Switches::ON)), 0);
}

/// The whole tumour from 26 directions, as without the opaque image around it.
#[test]
fn the_whole_tumour_is_visible_from_every_side() {
    let mut bench = bench();
    let opaque = transfer(&[(0.0, [128; 3], 1.0), (1.0, [128; 3], 1.0)], None);
    let tumor = grid([14, 12, 10], DMat3::from_rotation_x(0.5), DVec3::splat(14.0));
    let mut with = with_tumor(scene(image(&cubic(40), |p| noise(p, 1)), opaque), &tumor);
    with.lens = Some(Lens { center_mm: tumor.center_mm(), radius_mm: 2.0 });
    let size = [80, 80];
    for direction in (0..27).filter(|n| *n != 13) {
        let [x, y, z] = [direction % 3 - 1, direction / 3 % 3 - 1, direction / 9 - 1].map(f64::from);
        let azimuth = if x == 0.0 && y == 0.0 { 0.0 } else { (-x).atan2(y).to_degrees() };
        with.camera.world_from_camera = Camera::orientation(azimuth, z.atan2(x.hypot(y)).to_degrees());
        let mut alone = with.clone();
        alone.volume = None;
        let Bench { gpu, renderer } = &mut *bench;
        let expected = renderer.render(gpu, &alone, &Quality::FULL, size).unwrap();
        let depths = expected.read_depths(gpu);
        let expected = expected.read_rgba(gpu).unwrap();
        let found = renderer.render(gpu, &with, &Quality::FULL, size).unwrap().read_rgba(gpu).unwrap();
        let tumor: Vec<usize> = (0..depths.len()).filter(|&i| depths[i] < FAR).collect();
        assert!(tumor.len() > 60, "{x} {y} {z}: {} pixels of tumour", tumor.len());
        assert!(tumor.iter().all(|&i| found[i * 4..i * 4 + 4] == expected[i * 4..i * 4 + 4]), "{x} {y} {z}");
        // The rest of the image is visible.
        let grey =
            found.chunks(4).filter(|p| p[0] == p[1] && p[1] == p[2] && (30..160).contains(&p[0])).count();
        assert!(grey > 1500, "{x} {y} {z}: {grey}");
    }
    // Picks distinguish tumour and image.
    let Bench { gpu, renderer } = &mut *bench;
    let frame = renderer.render(gpu, &with, &FLAT, size).unwrap().clone();
    let depths = frame.read_depths(gpu);
    let mut found = [0, 0];
    for (i, depth) in depths.iter().enumerate().step_by(7) {
        let pick = frame.pick(gpu, i as u32 % 80, i as u32 / 80).unwrap();
        let bits = pick.and_then(|p| p.bits);
        assert_eq!(bits.is_some(), *depth < FAR);
        if let (Some(pick), Some(bits)) = (pick, bits) {
            // Just behind the face is a voxel of that region, except for rays that graze its edge.
            let regions = with.tumor.as_ref().unwrap();
            let center = DVec2::new((i % 80) as f64 + 0.5, (i / 80) as f64 + 0.5);
            let behind = pick.world_mm + with.camera.ray(center, DVec2::splat(80.0)).direction * 2e-3;
            let cell = regions.grid().voxel_at(behind).unwrap();
            let there = regions.bits_of_id()[regions.id(regions.grid().linear(cell)) as usize];
            found[usize::from(there == bits)] += 1;
        }
    }
    assert!(found[1] > 10 && found[0] * 10 <= found[1], "{found:?}");
}

#[test]
fn values_that_are_not_finite_are_invisible() {
    let mut bench = bench();
    let grid = cubic(24);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let all = scene(image(&grid, |_| if bad == 1e300 { f64::NAN } else { bad }), soft());
        assert!(draw(&mut bench, &all, &FLAT, [24, 24], Switches::ON).iter().all(|m| m.rgba() == [0.0; 4]));
        if bad == 1e300 {
            continue;
        }
        for function in [soft(), soft_2d()] {
            let some =
                image(
                    &grid,
                    |p| if noise(p, 4) > 0.98 { bad } else { 40.0 + 30.0 * noise(p.map(|x| x / 4), 1) },
                );
            let (mean, worst) = difference(&mut bench, &scene(some, function), [48, 48], true);
            println!("{bad}: {mean} {worst}");
            assert!(mean < 0.2 && worst <= 3.0, "{bad}: {mean} {worst}");
        }
    }
}

fn omitted(scene: &ContextScene, quality: &Quality) -> Vec<(PassName, &'static str)> {
    let mut omitted = context_plan(scene, quality).omitted;
    // See solid/tubes/tests.rs and projection_tests.rs for those.
    omitted.retain(|(_, reason)| !["no fibre tracts", "no second image"].contains(reason));
    omitted
}

fn every_pass() -> Plan {
    let passes = around_light(&Quality::FULL, [SURFACE, TUBES, TUBES_MERGE], [COMPOSE]);
    Plan { passes, omitted: Vec::new() }
}

#[test]
fn each_reason_omits_its_passes_and_changes_no_pixel() {
    let tumor = grid([12, 12, 10], DMat3::IDENTITY, DVec3::splat(14.0));
    let whole = with_tumor(scene(lumps(&cubic(40)), soft_2d()), &tumor);
    assert_eq!(omitted(&whole, &Quality::FULL), []);
    let one_d = ContextScene { transfer: soft(), ..whole.clone() };
    assert_eq!(omitted(&one_d, &Quality::FULL), [(GRADIENT_OPACITY, "transfer function is 1-D")]);
    let zero = transfer(&[(0.0, [9; 3], 0.0), (9.0, [9; 3], 0.0)], None);
    let transparent = ContextScene { transfer: zero, ..whole.clone() };
    let reason = "transfer function is transparent";
    let march = [(CONTEXT, reason), (GRADIENT_OPACITY, reason)];
    assert_eq!(omitted(&transparent, &Quality::FULL), march);
    let mut unselected = whole.clone();
    (1..4).for_each(|bits| unselected.selection.set(bits, false));
    let tumor_passes = [SURFACE, OCCLUSION, OCCLUSION_BLUR];
    assert_eq!(omitted(&unselected, &Quality::FULL), tumor_passes.map(|p| (p, "selection is empty")));
    let no_mask = ContextScene { tumor: None, ..whole.clone() };
    assert_eq!(omitted(&no_mask, &Quality::FULL), tumor_passes.map(|p| (p, "no mask is active")));
    let no_image = ContextScene { volume: None, ..whole.clone() };
    assert!(omitted(&no_image, &Quality::FULL).iter().all(|o| o.1 == "no context image"));

    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut rgba_of = |scene: &ContextScene, plan: Plan| {
        renderer
            .render_planned(gpu, scene, &Quality::FULL, [96, 96], plan, Switches::ON)
            .unwrap()
            .read_rgba(gpu)
            .unwrap()
    };
    for (name, scene) in
        [("1-D", &one_d), ("transparent", &transparent), ("unselected", &unselected), ("no mask", &no_mask)]
    {
        let lean = rgba_of(scene, context_plan(scene, &Quality::FULL));
        // Fill every buffer with something else first.
        rgba_of(&whole, every_pass());
        assert!(rgba_of(scene, every_pass()) == lean, "{name}");
    }
    // Without an image the march can't run: compared with a transparent one.
    let lean = rgba_of(&no_image, context_plan(&no_image, &Quality::FULL));
    assert!(rgba_of(&transparent, every_pass()) == lean, "no image");
}

#[test]
fn empty_scenes_show_the_background_and_invalid_scenes_are_errors() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut s = scene(lumps(&cubic(16)), soft());
    let same = s.clone();
    assert!(s == same);
    s.volume = None;
    s.background = [10, 20, 30];
    assert!(s != same);
    let frame = renderer.render(gpu, &s, &Quality::FULL, [33, 17]).unwrap();
    assert!(frame.read_rgba(gpu).unwrap().chunks(4).all(|p| p == [10, 20, 30, 255]));
    assert_eq!(frame.pick(gpu, 3, 3).unwrap(), None);
    assert_eq!(frame.pick(gpu, 33, 3).unwrap(), None);
    let plane = |x: f64, offset_mm: f64| ClipPlane { normal: DVec3::X * x, offset_mm };
    for clip in [
        vec![plane(0.0, 1.0)],
        vec![plane(1.0, f64::NAN)],
        vec![plane(f64::INFINITY, 1.0)],
        vec![plane(1.0, 0.0); 7],
    ] {
        let bad = ContextScene { clip, ..same.clone() };
        let e = renderer.render(gpu, &bad, &Quality::FULL, [8, 8]).unwrap_err();
        assert!(matches!(&e, RenderError::Scene(text) if text.contains("clipping plane")), "{e}");
    }
    let mut bad = same.clone();
    bad.camera.height_mm = f64::NAN;
    assert!(matches!(renderer.render(gpu, &bad, &Quality::FULL, [8, 8]), Err(RenderError::Scene(_))));
    assert!(matches!(renderer.render(gpu, &same, &Quality::FULL, [0, 8]), Err(RenderError::Size { .. })));
    // Invalid steps count as the finest.
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let quality = Quality { context_step_mm: step, ..Quality::FULL };
        assert!(renderer.render(gpu, &same, &quality, [8, 8]).is_ok());
    }
    let times = renderer.pass_times(gpu).unwrap();
    assert_eq!(times.iter().map(|t| t.0).collect::<Vec<_>>(), [CONTEXT, COMPOSE]);
}

/// Phong's shading by a lamp before and behind, weaker, and none: each as its twin, and no two alike.
#[test]
fn shading_of_tissue_matches_the_twin() {
    let mut bench = bench();
    let s = scene(lumps(&cubic(24)), soft());
    let size = [40, 36];
    let mut seen: Vec<Vec<Marched>> = Vec::new();
    for (tissue_shading, lamp) in [
        (1.0, None),
        (0.5, None),
        (0.0, None),
        (1.0, Some([-45.0, 45.0])),
        (1.0, Some([100.0, -10.0])),
        (1.0, Some([180.0, 0.0])),
        (f64::NAN, Some([0.0, 0.0])),
    ] {
        let [azimuth_deg, elevation_deg] = lamp.unwrap_or([30.0, 30.0]);
        let lamp_settings = Lamp { azimuth_deg, elevation_deg, ..Lamp::DEFAULT };
        let lighting = LightSettings {
            tissue_shading,
            towards_lamp: lamp.is_some(),
            lamp: lamp_settings,
            ..FLAT.lighting
        };
        if tissue_shading.is_finite() {
            let (mean, worst) = shaded_difference(&mut bench, &s, size, true, lighting);
            println!("{tissue_shading} {lamp:?}: {mean:.4} {worst:.3}");
            assert!(mean < 0.15 && worst < 4.0, "{tissue_shading} {lamp:?}: {mean} {worst}");
        }
        seen.push(draw(&mut bench, &s, &Quality { lighting, ..FLAT }, size, Switches::ON));
    }
    // A share that isn't a number is none.
    assert!(seen.pop().as_ref() == seen.get(2));
    for (n, one) in seen.iter().enumerate() {
        assert!(seen[..n].iter().all(|other| other != one), "{n}");
    }
}

#[test]
fn an_image_over_the_device_limit_is_drawn_coarser_with_a_warning() {
    let s = scene(lumps(&cubic(60)), soft());
    let gpu = small_device(200_000);
    let mut renderer = ContextRenderer::new(&gpu).unwrap();
    let frame = renderer.render(&gpu, &s, &FLAT, [64, 64]).unwrap();
    let warning = frame.warnings[0].clone();
    assert!(warning.contains("60x60x60") && warning.contains("1/2"), "{warning}");
    let coarse = frame.read_marched(&gpu);
    // In the same place, and similar.
    let twin = march(&s, [64, 64], Sampling { step_mm: 0.5, jitter: true });
    let mean = coarse.iter().zip(&twin).map(|(a, b)| (a.rgba()[3] - b[3]).abs()).sum::<f64>() / 4096.0;
    assert!(mean < 0.02, "{mean}");
    let large = scene(image(&cubic(60), |p| noise(p, 1)), soft());
    let gpu = small_device(70_000);
    let mut renderer = ContextRenderer::new(&gpu).unwrap();
    let frame = renderer.render(&gpu, &large, &FLAT, [16, 16]).unwrap();
    assert!(frame.warnings[0].contains("1/4"));
}
