//! The closeup on Mesa's software adapter, compared with its twin. Fails without an adapter.

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Selection,
    optics::{Camera, Projection},
};

use super::*;
use crate::{
    device::{AdapterPreference, PassName},
    scene::SlicePlane,
    solid::twin,
    testing::{
        self, BenchGuard, SharedBench, balls_scene, blobs, grid, lock, noise, scene_of, small_device,
        tests_want_a_card, volume,
    },
    views::{CloseupRenderer, view3d::Switches},
};

type Bench = testing::Bench<Closeup>;

fn bench() -> BenchGuard<Closeup> {
    static BENCH: SharedBench<Closeup> = SharedBench::new();
    lock(&BENCH)
}

#[derive(Debug, Default)]
struct Tally {
    pixels: usize,
    delicate: usize,
    inner: usize,
    outer: usize,
    /// Maximum difference in depth, voxels.
    worst: f64,
}

/// Draws and compares every pixel with the twin: same region, depth within 1e-3 voxel, except for the
/// rays that the twin marks as delicate, at most 5 in 100.
fn compare(name: &str, scene: &RegionScene, size: [u32; 2]) -> Tally {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let frame = renderer.render(gpu, scene, &Quality::FULL, size).unwrap();
    let n = (size[0] * size[1]) as usize;
    let none = (vec![FAR; n], vec![[0; 2]; n]);
    let (depths, surfaces) = if frame.plan.has(SURFACE) { frame.read_surface(gpu) } else { none };
    let outsides = if frame.plan.has(OUTSIDE) {
        frame.read_outside(gpu)
    } else {
        vec![OutsideHit { depth: FAR, number: 0, face: 0, color: 0 }; n]
    };
    let reference = reference_mm(scene);
    let mut tally = Tally { pixels: n, ..Tally::default() };
    for (i, twin) in twin::cast(scene, size).iter().enumerate() {
        if twin.delicate {
            tally.delicate += 1;
            continue;
        }
        let mut check = |what: &str, twin_hit: Option<twin::Hit>, number: u32, depth: f32| {
            let at = [i as u32 % size[0], i as u32 / size[0]];
            match twin_hit {
                None => {
                    assert!(depth >= FAR, "{name} {what} {at:?}: GPU hits {number} at {depth}, twin nothing");
                }
                Some(hit) => {
                    assert!(depth < FAR, "{name} {what} {at:?}: GPU hits nothing, twin {hit:?}");
                    assert_eq!(number, hit.number, "{name} {what} {at:?}: twin {hit:?}, GPU at {depth}");
                    let off = (reference + f64::from(depth) - hit.depth_mm).abs() * twin.voxels_per_mm;
                    tally.worst = tally.worst.max(off);
                    assert!(off < 1e-3, "{name} {what} {at:?}: {off} voxels off");
                }
            }
            usize::from(twin_hit.is_some())
        };
        let inner = check("inner", twin.inner, surfaces[i][0], depths[i]);
        let wants_outer = scene.lens.is_some();
        let outer =
            if wants_outer { check("outer", twin.outer, outsides[i].number, outsides[i].depth) } else { 0 };
        tally.inner += inner;
        tally.outer += outer;
    }
    println!("{name}: {tally:?}");
    assert!(tally.delicate * 20 <= tally.pixels, "{name}: {tally:?}");
    tally
}

fn ball(dims: [usize; 3]) -> impl Fn(usize, [usize; 3]) -> bool {
    move |k, p| {
        let r: f64 = (0..3)
            .map(|a| {
                let x = (p[a] as f64 + 0.5) / dims[a] as f64 - 0.5 - 0.06 * (k as f64 - 1.0);
                x * x
            })
            .sum();
        r < 0.17 && noise(p, k as u32) > 0.03
    }
}

fn balls_on(grid: &Grid) -> RegionScene {
    scene_of(volume(grid, 3, ball(grid.dims())).unwrap(), 3, Some(0.5))
}

#[test]
fn gpu_matches_its_twin() {
    let mut scene = balls_scene();
    for projection in [Projection::Perspective, Projection::Orthographic] {
        scene.camera.projection = projection;
        for (az, el) in [(0.0, 0.0), (35.0, 20.0), (90.0, 0.0), (-130.0, -60.0), (0.0, 90.0)] {
            scene.camera.world_from_camera = Camera::orientation(az, el);
            let tally = compare(&format!("{projection:?} {az} {el}"), &scene, [96, 80]);
            assert!(tally.inner > 800 && tally.outer > 800, "{tally:?}");
        }
    }
}

#[test]
fn selections_and_lenses() {
    let mut scene = balls_scene();
    scene.selection.set(0b010, false);
    let part = compare("a region hidden", &scene, [96, 96]);
    assert!(part.inner > 500);
    scene.lens = None;
    let off = compare("lens off", &scene, [96, 96]);
    assert!(off.inner > part.inner);
    let mut scene = balls_scene();
    for bits in 1..8 {
        scene.selection.set(bits, false);
    }
    let nothing = compare("nothing shown", &scene, [96, 96]);
    assert!(nothing.inner == 0 && nothing.outer > 1000);
    let mut scene = balls_scene();
    scene.lens =
        scene.lens.map(|l| Lens { center_mm: l.center_mm + DVec3::new(13.0, 7.0, 5.0), radius_mm: 9.0 });
    compare("a small lens aside", &scene, [96, 96]);
}

#[test]
fn grids_of_every_kind() {
    let far = DVec3::new(1e6, -1e6, 1e6);
    let shear =
        DMat3::from_cols(DVec3::new(-0.9, 0.1, 0.2), DVec3::new(0.3, 1.1, -0.1), DVec3::new(0.4, -0.2, 2.0));
    assert!(shear.determinant() < 0.0);
    let cases = [
        ("1:12", grid([48, 40, 8], DMat3::from_diagonal(DVec3::new(0.5, 0.5, 6.0)), DVec3::ZERO)),
        ("at 1e6 mm", grid([32, 32, 32], DMat3::from_diagonal(DVec3::new(1.0, 1.5, 0.7)), far)),
        ("sheared, negative", grid([30, 26, 20], shear, DVec3::new(-50.0, 20.0, 0.0))),
        ("sheared, negative, at 1e6 mm", grid([30, 26, 20], shear, far)),
        ("a sheet", grid([40, 40, 1], DMat3::IDENTITY, DVec3::ZERO)),
        ("sizes past bricks", grid([17, 9, 25], DMat3::IDENTITY, DVec3::ZERO)),
    ];
    for (name, grid) in cases {
        let mut scene = balls_on(&grid);
        for projection in [Projection::Perspective, Projection::Orthographic] {
            scene.camera.projection = projection;
            let tally = compare(name, &scene, [80, 64]);
            assert!(tally.inner > 100 && tally.outer > 20, "{name} {tally:?}");
        }
    }
}

#[test]
fn one_voxel_and_a_full_box() {
    let one = Grid::axis_aligned([1, 1, 1], DVec3::ONE, DVec3::splat(3.0)).unwrap();
    let mut scene = scene_of(volume(&one, 1, |_, _| true).unwrap(), 1, None);
    assert!(compare("one voxel", &scene, [64, 64]).inner > 100);
    scene.lens = Some(Lens { center_mm: DVec3::splat(3.2), radius_mm: 0.5 });
    assert!(compare("one voxel and lens", &scene, [64, 64]).outer > 50);
    let full = Grid::axis_aligned([64, 64, 64], DVec3::ONE, DVec3::ZERO).unwrap();
    let mut scene = scene_of(volume(&full, 1, |_, _| true).unwrap(), 1, Some(0.4));
    assert!(compare("full 64", &scene, [64, 64]).inner > 100);
    scene.lens = None;
    assert!(compare("full 64, lens off", &scene, [64, 64]).inner > 1000);
}

#[test]
fn more_masks_and_more_than_32_regions() {
    let grid = Grid::axis_aligned([40, 40, 40], DVec3::ONE, DVec3::ZERO).unwrap();
    for (masks, least) in [(5, 31), (7, 60)] {
        let tumor = volume(&grid, masks, |k, p| noise(p.map(|v| v / 3), k as u32 + 40) > 0.5).unwrap();
        let regions = tumor.bits_of_id().len() - 1;
        assert!(regions >= least, "{masks} masks gave {regions} regions");
        let mut scene = scene_of(tumor.clone(), masks, Some(0.6));
        for &bits in tumor.bits_of_id() {
            scene.selection.set(bits, bits % 5 == 2);
        }
        assert!(compare(&format!("{regions} regions"), &scene, [96, 96]).inner > 500);
    }
    // 300 regions: numbers of 16 bits.
    let tumor = volume(&grid, 9, |k, p| noise(p.map(|v| v / 2), k as u32 + 70) > 0.5).unwrap();
    assert!(tumor.bits_of_id().len() > 257);
    let mut scene = scene_of(tumor.clone(), 9, Some(0.6));
    for &bits in tumor.bits_of_id() {
        scene.selection.set(bits, bits % 11 == 2);
    }
    assert!(compare("16 bit numbers", &scene, [96, 96]).inner > 500);
}

#[test]
fn cameras_inside_and_far_away() {
    let mut scene = balls_scene();
    scene.selection.set(0b010, false);
    let near = |scene: &RegionScene, mm: f64, projection| {
        let mut s = scene.clone();
        s.camera.projection = projection;
        s.camera.height_mm = mm;
        s
    };
    for projection in [Projection::Perspective, Projection::Orthographic] {
        compare("inside the data", &near(&scene, 6.0, projection), [80, 80]);
        compare("inside the lens", &near(&scene, 2.0, projection), [80, 80]);
        // 2e5 mm off; a pixel is 12 mm: only some rays hit.
        compare("far away", &near(&scene, 1e3, projection), [80, 80]);
    }
    let mut behind = scene.clone();
    behind.camera.focus_mm += behind.camera.axes()[2] * -500.0;
    behind.camera.focus_mm -= behind.camera.axes()[2] * 200.0;
    behind.camera.height_mm = 20.0;
    let tally = compare("all behind the eye", &behind, [64, 64]);
    assert_eq!((tally.inner, tally.outer), (0, 0));
}

fn buffers(bench: &mut Bench, scene: &RegionScene, plan: Plan, skipping: bool) -> (Vec<u8>, Vec<u32>) {
    let Bench { gpu, renderer } = bench;
    let frame = renderer
        .render_planned(gpu, scene, &Quality::FULL, [96, 96], plan, Switches::skipping(skipping))
        .unwrap();
    let mut bits: Vec<u32> = Vec::new();
    if frame.plan.has(SURFACE) {
        let (depths, surfaces) = frame.read_surface(gpu);
        bits.extend(depths.iter().map(|d| d.to_bits()));
        bits.extend(surfaces.iter().flatten());
    }
    if frame.plan.has(OUTSIDE) {
        bits.extend(
            frame.read_outside(gpu).iter().flat_map(|o| [o.depth.to_bits(), o.number, o.face, o.color]),
        );
    }
    (frame.read_rgba(gpu).unwrap(), bits)
}

#[test]
fn skipping_empty_bricks_changes_no_bit() {
    let mut bench = bench();
    let shear =
        DMat3::from_cols(DVec3::new(-0.9, 0.1, 0.2), DVec3::new(0.3, 1.1, -0.1), DVec3::new(0.4, -0.2, 2.0));
    let mut scenes = vec![balls_scene(), balls_on(&grid([61, 50, 33], shear, DVec3::splat(100.0)))];
    // Looking exactly along an axis and a diagonal: boundaries at equal depth.
    let full = Grid::axis_aligned([32, 32, 32], DVec3::ONE, DVec3::ZERO).unwrap();
    let mut diagonal = scene_of(volume(&full, 2, |k, p| p[0] + p[1] + p[2] > 70 - 8 * k).unwrap(), 2, None);
    diagonal.camera.projection = Projection::Orthographic;
    diagonal.camera.world_from_camera = Camera::orientation(45.0, 0.0);
    scenes.push(diagonal);
    for scene in &mut scenes {
        scene.selection.set(0b010, false);
        let with = buffers(&mut bench, scene, closeup_plan(scene, &Quality::FULL), true);
        let without = buffers(&mut bench, scene, closeup_plan(scene, &Quality::FULL), false);
        assert!(with.1.iter().filter(|b| f32::from_bits(**b) < 1e4).count() > 1000);
        assert!(with == without);
    }
}

#[test]
fn omitted_passes_change_no_pixel() {
    let mut bench = bench();
    let mut lens_off = balls_scene();
    lens_off.lens = None;
    let mut covered = balls_scene();
    covered.lens = covered.lens.map(|l| Lens { radius_mm: 200.0, ..l });
    let mut unselected = balls_scene();
    unselected.selection = Selection::all();
    for bits in 1..8 {
        unselected.selection.set(bits, false);
    }
    let mut empty = balls_scene();
    empty.tumor = None;
    for (name, scene) in
        [("lens off", lens_off), ("covered", covered), ("unselected", unselected), ("empty", empty)]
    {
        let planned = closeup_plan(&scene, &Quality::FULL);
        assert!(!planned.omitted.is_empty());
        let lean = buffers(&mut bench, &scene, planned, true).0;
        // Fill every buffer with something else first.
        buffers(&mut bench, &balls_scene(), every_pass(), true);
        let all = buffers(&mut bench, &scene, every_pass(), true).0;
        let different = lean.iter().zip(&all).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "{name}");
    }
    let flat = Quality { occlusion_strength: 0.0, relief: 0.0, ..Quality::FULL };
    let scene = balls_scene();
    let Bench { gpu, renderer } = &mut *bench;
    let lean = renderer.render(gpu, &scene, &flat, [96, 96]).unwrap().read_rgba(gpu).unwrap();
    let all = renderer
        .render_planned(gpu, &scene, &flat, [96, 96], every_pass(), Switches::ON)
        .unwrap()
        .read_rgba(gpu)
        .unwrap();
    assert!(lean == all, "strength 0");
}

#[test]
fn an_empty_tumour_shows_the_background() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut scene = balls_scene();
    scene.tumor = None;
    scene.lens = None;
    scene.background = [10, 20, 30];
    let frame = renderer.render(gpu, &scene, &Quality::FULL, [33, 17]).unwrap();
    let rgba = frame.read_rgba(gpu).unwrap();
    assert_eq!(rgba.len(), 33 * 17 * 4);
    assert!(rgba.chunks(4).all(|p| p == [10, 20, 30, 255]));
    assert_eq!(frame.pick(gpu, 16, 8).unwrap(), None);
}

#[test]
fn invalid_sizes_and_scenes_are_errors() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let scene = balls_scene();
    for size in [[0, 10], [10, 0], [1 << 20, 10]] {
        let e = renderer.render(gpu, &scene, &Quality::FULL, size).unwrap_err();
        assert!(matches!(e, RenderError::Size { .. }), "{e}");
        assert!(e.to_string().contains(&format!("{}x{}", size[0], size[1])), "{e}");
    }
    let mut bad = scene.clone();
    bad.camera.height_mm = f64::NAN;
    assert!(matches!(renderer.render(gpu, &bad, &Quality::FULL, [8, 8]), Err(RenderError::Scene(_))));
    let mut bad = scene.clone();
    bad.lens = bad.lens.map(|l| Lens { radius_mm: 0.0, ..l });
    assert!(matches!(renderer.render(gpu, &bad, &Quality::FULL, [8, 8]), Err(RenderError::Scene(_))));
    assert!(renderer.render(gpu, &scene, &Quality::FULL, [1, 1]).is_ok());
}

#[test]
fn a_pick_lies_on_the_voxel_face_under_the_pixel() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let far = DVec3::new(1e6, -1e6, 1e6);
    let mut scene = balls_on(&grid([30, 30, 30], DMat3::from_diagonal(DVec3::new(-1.0, 1.5, 0.8)), far));
    scene.selection.set(0b010, false);
    let tumor = scene.tumor.clone().unwrap();
    for scale in [1.0, 0.5] {
        let quality = Quality { resolution_scale: scale, ..Quality::FULL };
        let size = [90, 70];
        let frame = renderer.render(gpu, &scene, &quality, size).unwrap();
        assert_eq!(frame.asked_px, size);
        let twin = twin::cast(&scene, frame.size_px);
        let mut found = [0, 0];
        for y in (1..70).step_by(3) {
            for x in (0..90).step_by(5) {
                let pick = frame.pick(gpu, x, y).unwrap();
                let at = [x, y].map(|v| ((f64::from(v) + 0.5) * scale) as u32);
                let pixel = &twin[(at[1] * frame.size_px[0] + at[0]) as usize];
                if pixel.delicate {
                    continue;
                }
                let Some(hit) = pixel.inner.or(pixel.outer) else {
                    assert_eq!(pick, None);
                    continue;
                };
                let pick = pick.unwrap();
                assert_eq!(pick.bits, tumor.bits_of_id()[hit.number as usize]);
                assert_eq!(pick.inside_lens, pixel.inner.is_some());
                found[usize::from(pick.inside_lens)] += 1;
                // Under the pixel, at the twin's depth, and just behind it that region's voxel.
                let drawn = DVec2::new(f64::from(frame.size_px[0]), f64::from(frame.size_px[1]));
                let projected = scene.camera.project(pick.world_mm, drawn).unwrap();
                let middle = DVec2::new(f64::from(at[0]) + 0.5, f64::from(at[1]) + 0.5);
                assert!(projected.distance(middle) < 1e-6, "{projected} {middle}");
                let depth = (scene.camera.eye_mm() - pick.world_mm).dot(scene.camera.axes()[2]);
                assert!((depth - hit.depth_mm).abs() < 1e-3);
                let ray = scene.camera.ray(middle, drawn);
                if let Some(cell) = tumor.grid().voxel_at(pick.world_mm + ray.direction * 2e-3) {
                    // A ray may leave a cell right away through its corner, into the next one.
                    let number = tumor.id(tumor.grid().linear(cell));
                    if number != hit.number {
                        found[0] -= 1;
                    }
                }
            }
        }
        assert!(found.iter().all(|&n| n > 15), "{found:?}");
        assert_eq!(frame.pick(gpu, 90, 0).unwrap(), None);
    }
}

#[test]
fn the_frame_has_the_expected_colours_lines_and_ring() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut scene = balls_scene();
    scene.lens = None;
    let flat = Quality { occlusion_strength: 0.0, relief: 0.0, ..Quality::FULL };
    let count = |rgba: &[u8], what: [u8; 3]| rgba.chunks(4).filter(|p| p[..3] == what).count();
    let off = renderer.render(gpu, &scene, &flat, [200, 200]).unwrap().read_rgba(gpu).unwrap();
    assert!(count(&off, [0, 255, 0]) > 1000, "the T2 mask covers the others");
    let dark = off.chunks(4).filter(|p| p[..3].iter().all(|&c| c < 100)).count();
    assert!(dark > 200, "a black silhouette of {dark} pixels");
    let yellow = count(&off, [255, 255, 0]);
    scene.selection.set(0b010, false);
    let below = renderer.render(gpu, &scene, &flat, [200, 200]).unwrap().read_rgba(gpu).unwrap();
    assert!(count(&below, [0, 255, 0]) < 10 && count(&below, [255, 255, 0]) > yellow + 500);

    scene.tumor = None;
    scene.lens = Some(Lens { center_mm: scene.camera.focus_mm, radius_mm: scene.camera.height_mm / 4.0 });
    scene.camera.projection = Projection::Orthographic;
    let ring = renderer.render(gpu, &scene, &flat, [200, 200]).unwrap().read_rgba(gpu).unwrap();
    let sum: f64 = ring
        .chunks(4)
        .enumerate()
        .filter(|(_, p)| p[1] < 128)
        // Its dark edges, on both sides of the white line.
        .map(|(i, _)| DVec2::new((i % 200) as f64 - 99.5, (i / 200) as f64 - 99.5).length())
        .inspect(|r| assert!((r - 50.0).abs() < 2.0, "{r}"))
        .sum();
    let n = ring.chunks(4).filter(|p| p[1] < 128).count() as f64;
    assert!((sum / n - 50.0).abs() < 0.2, "mean radius {}", sum / n);
    assert!((n / (std::f64::consts::TAU * 50.0) - 1.2).abs() < 0.6, "{n} pixels of ring");
}

#[test]
fn hidden_corners_are_darker_and_planes_are_not() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    // A step: the floor is dark beside the wall, but not far from it.
    let grid = Grid::axis_aligned([60, 40, 30], DVec3::ONE, DVec3::ZERO).unwrap();
    let tumor = volume(&grid, 1, |_, p| p[2] < 6 || (p[0] < 20 && p[2] < 16)).unwrap();
    let mut scene = scene_of(tumor, 1, None);
    scene.camera.world_from_camera = Camera::orientation(0.0, 90.0);
    scene.camera.projection = Projection::Orthographic;
    let frame = renderer.render(gpu, &scene, &Quality::FULL, [160, 160]).unwrap();
    let rgba = frame.read_rgba(gpu).unwrap();
    let red = |mm: DVec3| {
        let at = scene.camera.project(mm, DVec2::splat(160.0)).unwrap();
        rgba[(at.y as usize * 160 + at.x as usize) * 4]
    };
    let (corner, floor, top) = (
        red(DVec3::new(20.5, 20.0, 5.5)),
        red(DVec3::new(45.0, 20.0, 5.5)),
        red(DVec3::new(10.0, 20.0, 15.5)),
    );
    assert_eq!((floor, top), (255, 255), "planes keep their colour");
    assert!(corner < 235, "the corner is {corner}");
}

#[test]
fn rendering_is_deterministic_and_uploads_are_reused() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let scene = balls_scene();
    let first = renderer.render(gpu, &scene, &Quality::FULL, [64, 64]).unwrap().read_rgba(gpu).unwrap();
    let other = scene_of(blobs(24, DVec3::ONE), 3, None);
    let between = renderer.render(gpu, &other, &Quality::DRAFT, [64, 64]).unwrap().read_rgba(gpu).unwrap();
    assert_ne!(first.len(), between.len());
    let frame = renderer.render(gpu, &scene, &Quality::FULL, [64, 64]).unwrap();
    assert!(frame.data.tumor.as_ref().is_some_and(|t| Arc::ptr_eq(t, scene.tumor.as_ref().unwrap())));
    assert!(frame.read_rgba(gpu).unwrap() == first);
    let times = renderer.pass_times(gpu).unwrap();
    assert_eq!(times.iter().map(|t| t.0).collect::<Vec<_>>(), every_pass().passes);
    assert!(times.iter().all(|t| t.1 > 0.0));
}

#[test]
fn regions_over_the_device_limit_are_an_error() {
    let gpu = small_device(100_000);
    let mut renderer = CloseupRenderer::new(&gpu).unwrap();
    let grid = Grid::axis_aligned([64, 64, 64], DVec3::ONE, DVec3::ZERO).unwrap();
    let large = scene_of(volume(&grid, 1, |_, p| noise(p, 1) > 0.5).unwrap(), 1, None);
    let e = renderer.render(&gpu, &large, &Quality::FULL, [16, 16]).unwrap_err();
    assert_eq!(e, RenderError::Volume { found: 64 * 64 * 64, limit: 100_000 });
    assert!(e.to_string().contains("262144") && e.to_string().contains("100000"), "{e}");
    // A filled volume stores only its surface.
    let filled = scene_of(volume(&grid, 1, |_, _| true).unwrap(), 1, None);
    assert!(renderer.render(&gpu, &filled, &Quality::FULL, [16, 16]).is_ok());
    let e = renderer.render(&gpu, &filled, &Quality::FULL, [100, 100]).unwrap_err();
    assert!(matches!(e, RenderError::Size { .. }), "{e}");
}

#[test]
fn a_lost_device_is_an_error_not_a_panic() {
    let gpu = small_device(1 << 20);
    let mut renderer = CloseupRenderer::new(&gpu).unwrap();
    let scene = balls_scene();
    let frame = renderer.render(&gpu, &scene, &Quality::FULL, [32, 32]).unwrap().clone();
    gpu.wait().unwrap();
    gpu.device.destroy();
    // The loss is reported once the device is polled.
    let _ = gpu.wait();
    assert!(matches!(renderer.render(&gpu, &scene, &Quality::FULL, [32, 32]), Err(RenderError::Device(_))));
    assert!(matches!(frame.pick(&gpu, 16, 16), Err(RenderError::Device(_))));
    assert!(matches!(frame.read_rgba(&gpu), Err(RenderError::Device(_))));
}

#[test]
fn the_adapter_is_described_and_a_missing_one_names_the_packages() {
    let bench = bench();
    let text = bench.gpu.describe();
    let real = tests_want_a_card();
    assert!(
        bench.gpu.is_software() != real && text.ends_with(if real { "hardware" } else { "software" }),
        "{text}"
    );
    assert!(crate::device::gpu::choose_adapter(&[], AdapterPreference::RealFirst).is_none());
    let e = crate::GpuError::NoAdapter("no driver at all".to_owned()).to_string();
    assert!(e.contains("mesa-vulkan-drivers") && e.contains("libvulkan1"), "{e}");
}

/// A slice of one colour across the whole frame, `towards_mm` nearer to the viewer than the focus.
fn curtain(camera: &Camera, towards_mm: f64) -> SlicePlane {
    let [right, up, back] = camera.axes();
    let reach = camera.height_mm * 2.0;
    SlicePlane {
        rgba: Arc::new(vec![10, 110, 210, 255]),
        size_px: [1, 1],
        corner_mm: camera.focus_mm + back * towards_mm + (up - right) * reach,
        right_mm: right * (2.0 * reach),
        down_mm: up * (-2.0 * reach),
        opacity: 0.4,
    }
}

#[test]
fn a_slice_hides_what_is_behind_it_and_is_hidden_by_the_surface() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let size = [96, 96];
    let mut draw = |scene: &RegionScene| {
        let frame = renderer.render(gpu, scene, &Quality::FULL, size).unwrap();
        let outsides = if scene.lens.is_some() { frame.read_outside(gpu) } else { Vec::new() };
        (frame.read_rgba(gpu).unwrap(), frame.read_surface(gpu).0, outsides, frame.reference_mm)
    };
    let over = |below: &[u8]| -> [f64; 3] {
        std::array::from_fn(|c| 0.4 * [10.0, 110.0, 210.0][c] + 0.6 * f64::from(below[c]))
    };
    let close = |a: &[u8], b: [f64; 3], by: f64| (0..3).all(|c| (f64::from(a[c]) - b[c]).abs() <= by);
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let mut scene = balls_scene();
        scene.selection.set(0b010, false);
        scene.camera.projection = projection;
        let (plain, depths, outsides, reference) = draw(&scene);
        let at_focus = scene.camera.distance_mm();

        // In front of everything: over every pixel except the ring.
        scene.plane = Some(curtain(&scene.camera, 0.7 * at_focus));
        let (before, ..) = draw(&scene);
        let is_ring = |p: &[u8]| p[..3].iter().all(|c| c.abs_diff(p[0]) < 12 && !(60..=235).contains(c));
        let ring = plain.chunks(4).zip(before.chunks(4)).filter(|(a, b)| a == b && is_ring(a)).count();
        let rest = plain.chunks(4).zip(before.chunks(4)).filter(|(a, b)| close(b, over(a), 1.01)).count();
        assert!(ring >= 8, "{ring} pixels entirely of the ring");
        assert!(ring + rest > 96 * 96 - 500, "{ring} + {rest}: the rest is the ring's soft edge");

        // Behind everything: nothing shows through the surface; the faint outer level lies over it.
        scene.plane = Some(curtain(&scene.camera, -60.0));
        let (behind, ..) = draw(&scene);
        let mut counts = [0; 3];
        for i in 0..96 * 96 {
            let (a, b) = (&plain[4 * i..4 * i + 4], &behind[4 * i..4 * i + 4]);
            if depths[i] < FAR {
                counts[0] += 1;
                assert_eq!(a, b, "hidden at {i}");
                continue;
            }
            let outer = outsides[i].color.to_le_bytes().map(|v| f64::from(v) / 255.0);
            let with =
                |below: [f64; 3]| std::array::from_fn(|c| 255.0 * outer[c] + (1.0 - outer[3]) * below[c]);
            if !close(a, with([255.0; 3]), 1.01) {
                continue; // a line
            }
            counts[if outsides[i].depth < FAR { 1 } else { 2 }] += 1;
            // The GPU blends floats, the test pixels and alphas of 8 bits.
            assert!(close(b, with(over(&[255; 3])), 2.0), "{i}: {a:?} {b:?}");
        }
        assert!(counts.iter().all(|&n| n > 300), "{counts:?}");

        // Through the middle, with the lens off.
        scene.lens = None;
        scene.plane = None;
        let (plain, depths, ..) = draw(&scene);
        scene.plane = Some(curtain(&scene.camera, 4.0));
        let (middle, ..) = draw(&scene);
        let wall = at_focus - 4.0 - reference;
        let mut counts = [0; 2];
        for (i, depth) in depths.iter().enumerate() {
            // Lines are drawn at the depth of what they outline, which may be a neighbour.
            let [x, y] = [i % 96, i / 96].map(|v| v.clamp(2, 93));
            let nearest = (0..25).map(|n| depths[(y + n / 5 - 2) * 96 + x + n % 5 - 2]).fold(FAR, f32::min);
            let (a, b) = (&plain[4 * i..4 * i + 4], &middle[4 * i..4 * i + 4]);
            if f64::from(*depth) < wall - 0.01 {
                counts[0] += 1;
                assert_eq!(a, b);
            } else if f64::from(nearest) > wall + 0.01 {
                counts[1] += 1;
                assert!(close(b, over(a), 1.01), "{i}: {a:?} {b:?}");
            }
        }
        assert!(counts.iter().all(|&n| n > 300), "{counts:?}");
    }
    // An invisible slice changes nothing.
    let mut scene = balls_scene();
    let none = draw(&scene).0;
    scene.plane = Some(SlicePlane { opacity: 0.0, ..curtain(&scene.camera, 0.0) });
    assert!(draw(&scene).0 == none);
    scene.plane = Some(curtain(&scene.camera, -1e3));
    assert!(draw(&scene).0 != none);
    scene.plane = Some(curtain(&scene.camera, 1e3));
    assert!(draw(&scene).0 == none, "behind the eye");
}

/// Why voxels aren't smoothed at the qualities that plans are compared at.
const BRICKS: (PassName, &str) = (SMOOTH, "voxels are shown as they are");

/// Every pass with screen-space light but that of smooth surfaces: what plans are compared with.
fn every_pass() -> Plan {
    let light = light::passes(Quality::FULL.lighting.mode, LitKind::Masks).iter().copied();
    Plan::of([SURFACE, NORMALS, OUTSIDE].into_iter().chain(light).chain([COMPOSE]), |_| None)
}

fn names(plan: &Plan) -> Vec<&'static str> {
    plan.passes.iter().map(|p| p.name()).collect()
}

#[test]
fn a_whole_scene_needs_every_pass() {
    let scene = balls_scene();
    let plan = closeup_plan(&scene, &Quality::FULL);
    assert_eq!((plan.passes, plan.omitted), (every_pass().passes, vec![BRICKS]));
    let smooth = closeup_plan(&scene, &Quality { smooth: true, ..Quality::FULL });
    assert!(smooth.has(SMOOTH) && smooth.omitted.is_empty());
    let cones = light::preset(crate::scene::LightingMode::Cones, crate::scene::Preset::Balanced);
    let plan = closeup_plan(&scene, &Quality { smooth: true, ..cones });
    assert!(plan.omitted.contains(&(SMOOTH, "cones of light read the voxels")), "{:?}", plan.omitted);
}

#[test]
fn each_reason_omits_its_passes() {
    let mut scene = balls_scene();
    scene.lens = None;
    let without_lens = closeup_plan(&scene, &Quality::FULL);
    assert_eq!(without_lens.omitted, [BRICKS, (OUTSIDE, "lens is off")]);

    let mut scene = balls_scene();
    if let Some(lens) = &mut scene.lens {
        lens.radius_mm = 1e4;
    }
    let covered = closeup_plan(&scene, &Quality::FULL);
    assert_eq!(covered.omitted, [BRICKS, (OUTSIDE, "lens covers everything: nothing lies outside")]);

    let mut scene = balls_scene();
    for bits in 0..8 {
        scene.selection.set(bits, false);
    }
    let unselected = closeup_plan(&scene, &Quality::FULL);
    assert_eq!(names(&unselected), ["outside", "compose"]);
    assert!(unselected.omitted.iter().all(|(_, reason)| *reason == "selection is empty"));

    let mut scene = balls_scene();
    scene.tumor = None;
    scene.selection = Selection::all();
    let empty = closeup_plan(&scene, &Quality::FULL);
    assert_eq!(names(&empty), ["compose"]);
    assert!(empty.omitted.iter().all(|(_, reason)| *reason == "no mask is active"));

    let scene = balls_scene();
    let flat = closeup_plan(&scene, &Quality { occlusion_strength: 0.0, ..Quality::FULL });
    assert_eq!(names(&flat), ["surface", "normals", "outside", "compose"]);
    let nan = closeup_plan(&scene, &Quality { occlusion_strength: f64::NAN, ..Quality::FULL });
    assert_eq!(names(&nan), ["surface", "normals", "outside", "compose"]);
}

#[test]
fn every_pass_is_either_planned_or_omitted() {
    for radius in [0.5, 20.0, 1e4] {
        let mut scene = balls_scene();
        if let Some(lens) = &mut scene.lens {
            lens.radius_mm = radius;
        }
        let plan = closeup_plan(&scene, &Quality::DRAFT);
        let mut all: Vec<PassName> =
            plan.passes.iter().copied().chain(plan.omitted.iter().map(|o| o.0)).collect();
        let mut expected = every_pass().passes;
        expected.push(SMOOTH);
        all.sort();
        expected.sort();
        assert_eq!(all, expected);
    }
}
