//! Tubes on Mesa's software adapter, compared with rays in `f64` and closed forms. A missing adapter fails.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use glioscope_core::{
    Grid, Progress, Samples, Scaling, Selection, Sides, Tracts, Volume,
    optics::{Camera, Projection, srgb},
};

use super::{buffers::fiber_number, twin::tubes_seen, *};
use crate::{
    ContextRenderer, ContextScene, PickedFiber, context_plan,
    device::{PassName, RenderError},
    image::{ContextVolume, ControlPoint, TransferFunction},
    light::screen::OCCLUSION,
    scene::{Coloring, MaskColors, Palette, Quality},
    solid::view::FAR,
    testing::{self, BenchGuard, SharedBench, grid, lock, small_device, volume},
    views::view3d::Switches,
};

type Bench = testing::Bench<crate::views::context::Context>;

fn bench() -> BenchGuard<crate::views::context::Context> {
    static BENCH: SharedBench<crate::views::context::Context> = SharedBench::new();
    lock(&BENCH)
}

const FLAT: Quality = Quality { occlusion_strength: 0.0, ..Quality::FULL };
const BOTH: [Projection; 2] = [Projection::Perspective, Projection::Orthographic];

fn tracts(fibers: &[&[[f32; 3]]]) -> Tracts {
    let mut offsets = vec![0];
    let mut points = Vec::new();
    for fiber in fibers {
        points.extend_from_slice(fiber);
        offsets.push(points.len() as u32);
    }
    Tracts::new(points, offsets, Sides::Known).unwrap()
}

fn set(fibers: &[&[[f32; 3]]], color: Rgb, radius_mm: f64) -> DrawnTubes {
    drawn(&tracts(fibers), &TubeShape::default(), TubeLook { radius_mm, ..TubeLook::of(color) })
}

fn drawn(tracts: &Tracts, shape: &TubeShape<'_>, look: TubeLook) -> DrawnTubes {
    let set = TubeSet::new(tracts, shape, &Progress::new()).unwrap();
    DrawnTubes { set: Arc::new(set), look, shown: true }
}

/// Tubes alone, viewed slightly from above.
fn scene(tubes: Vec<DrawnTubes>) -> ContextScene {
    ContextScene {
        projection: None,
        volume: None,
        transfer: Arc::new(TransferFunction::transparent()),
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 2]),
        lens: None,
        tubes,
        camera: Camera::fit(DVec3::ZERO, 14.0, Camera::orientation(35.0, 20.0), Projection::Perspective),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

/// Per pixel: depth from the eye and fibre number of a hit; shaded colour and facing.
type TubePixels = Vec<(Option<(f64, u32)>, [u8; 4])>;

fn tube_pixels(bench: &mut Bench, scene: &ContextScene, size: [u32; 2]) -> TubePixels {
    let Bench { gpu, renderer } = bench;
    let frame = renderer.render(gpu, scene, &FLAT, size).unwrap();
    let (depths, surfaces) = (frame.read_depths(gpu), frame.read_surfaces(gpu));
    let reference_mm = scene.reference_mm();
    let shades = renderer.view.read_tube_shades(gpu);
    let hit = |(&depth, &[region, face]): (&f32, &[u32; 2])| {
        let number = fiber_number(face);
        assert_eq!(number.is_some(), depth < FAR && region == 0, "{depth} {region} {face}");
        number.map(|n| (f64::from(depth) + reference_mm, n))
    };
    depths.iter().zip(&surfaces).map(hit).zip(shades).collect()
}

/// Compares hits and their depths with the twin, except where the ray is nearly tangent. Returns the hits.
fn compare(bench: &mut Bench, name: &str, scene: &ContextScene, size: [u32; 2]) -> usize {
    let found = tube_pixels(bench, scene, size);
    let expected = tubes_seen(&scene.tubes, &scene.camera, size);
    let (mut hits, mut strayed, mut worst, mut worst_facing) = (0, 0, 0.0_f64, 0.0_f64);
    for ((found, shade), expected) in found.iter().zip(&expected) {
        assert_eq!(found.is_none(), *shade == [0; 4]);
        match (found, expected) {
            (Some((depth, number)), Some(e)) => {
                hits += 1;
                if e.facing < 0.1 || *number != e.number {
                    // The neighbouring pixel may show another tube.
                    strayed += usize::from(e.facing >= 0.1);
                    continue;
                }
                worst = worst.max((depth - e.depth_mm).abs() * e.facing);
                worst_facing = worst_facing.max((f64::from(shade[3]) / 255.0 - e.facing).abs() * e.facing);
            }
            (None, None) => {}
            (_, e) => strayed += usize::from(e.is_none_or(|e| e.facing > 0.1)),
        }
    }
    println!(
        "{name}: {hits} pixels, {strayed} strayed, depth to {worst:.1e} mm, facing to {worst_facing:.1e}"
    );
    assert!(strayed * 400 <= hits, "{name}: {strayed} of {hits}");
    assert!(worst < 2e-3 && worst_facing < 6e-3, "{name}: {worst} {worst_facing}");
    hits
}

const STRAIGHT: &[[f32; 3]] = &[[-9.0, 1.0, -3.0], [8.0, -4.0, 5.0]];
const BENT: &[[f32; 3]] = &[[-8.0, 0.0, -8.0], [-8.0, 0.0, 6.0], [6.0, 0.0, 6.0]];
const POINT: &[[f32; 3]] = &[[3.0, 2.0, -5.0]];

#[test]
fn tube_hits_match_the_twin() {
    let mut bench = bench();
    for (name, fibers) in [
        ("straight", vec![STRAIGHT]),
        ("bent", vec![BENT]),
        ("one point", vec![POINT]),
        ("no length", vec![&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]]),
        ("all", vec![STRAIGHT, &[], BENT, POINT]),
    ] {
        for projection in BOTH {
            for (azimuth, elevation) in [(35.0, 20.0), (0.0, 0.0), (-130.0, -70.0)] {
                let mut s = scene(vec![set(&fibers, [200, 100, 50], 1.2)]);
                s.camera.projection = projection;
                s.camera.world_from_camera = Camera::orientation(azimuth, elevation);
                let hits = compare(&mut bench, &format!("{name} {projection:?}"), &s, [96, 80]);
                assert!(hits > 20, "{name}: {hits}");
            }
        }
    }
}

#[test]
fn tubes_match_the_twin_end_on_from_inside_and_far_from_the_origin() {
    let mut bench = bench();
    let along: &[[f32; 3]] = &[[0.0, -12.0, 0.0], [0.0, 12.0, 0.0]];
    for projection in BOTH {
        let mut s = scene(vec![set(&[along, STRAIGHT], [200, 100, 50], 1.0)]);
        s.camera.projection = projection;
        s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
        assert!(compare(&mut bench, "end on", &s, [96, 80]) > 100);
        // The eye among the tubes, beside one, inside one.
        for (focus, height) in [(DVec3::ZERO, 3.0), (DVec3::new(2.0, 3.0, 1.0), 5.0), (DVec3::ZERO, 14.0)] {
            s.camera.focus_mm = focus;
            s.camera.height_mm = height;
            compare(&mut bench, "among", &s, [72, 60]);
        }
        // All behind the viewer.
        s.camera.focus_mm = s.camera.axes()[2] * -500.0;
        assert!(tube_pixels(&mut bench, &s, [32, 32]).iter().all(|(hit, _)| hit.is_none()));
    }
    // The same frame at 1e6 mm, except for the f32 precision of the file's own coordinates.
    let far: Vec<[f32; 3]> = BENT.iter().map(|p| p.map(|x| x + 1e6)).collect();
    let mut s = scene(vec![set(&[&far], [200, 100, 50], 1.2), set(&[POINT], [9; 3], 1.0)]);
    s.camera.focus_mm = DVec3::splat(1e6);
    assert!(compare(&mut bench, "far off", &s, [96, 80]) > 300);
}

/// One distant outlier doesn't cost the others precision: which tube is in front stays correct.
#[test]
fn an_outlier_does_not_reduce_precision() {
    let mut bench = bench();
    let stray: &[[f32; 3]] = &[[3e6, -2e6, 1e6]];
    for projection in BOTH {
        let mut s =
            scene(vec![set(&[stray], [9; 3], 1.0), set(&[STRAIGHT, BENT, stray], [200, 100, 50], 1.2)]);
        s.camera.projection = projection;
        assert!(compare(&mut bench, "stray", &s, [96, 80]) > 500);
    }
}

/// Every ray that passes a bend within its radius meets it: there is no gap on the outside.
#[test]
fn a_right_angle_bend_has_no_gap() {
    let mut bench = bench();
    let (size, radius) = ([128, 128], 1.5);
    for projection in BOTH {
        for azimuth in [0.0, 50.0] {
            let mut s = scene(vec![set(&[BENT], [200, 100, 50], radius)]);
            s.camera.projection = projection;
            s.camera.world_from_camera = Camera::orientation(azimuth, 15.0);
            let found = tube_pixels(&mut bench, &s, size);
            let corner = DVec3::new(-8.0, 0.0, 6.0);
            let mut tested = 0;
            for (n, (hit, _)) in found.iter().enumerate() {
                let pixel = glam::DVec2::new((n % 128) as f64 + 0.5, (n / 128) as f64 + 0.5);
                let ray = s.camera.ray(pixel, glam::DVec2::splat(128.0));
                let off = corner - ray.origin_mm;
                let off = off - ray.direction * off.dot(ray.direction);
                if off.length() < 0.99 * radius {
                    tested += 1;
                    assert!(hit.is_some(), "{projection:?} {azimuth}: {pixel}");
                }
            }
            assert!(tested > 60, "{tested}");
        }
    }
}

/// A tube so distant that it is a hundredth of a pixel wide is a line without a gap, and no wider.
#[test]
fn thin_tubes_have_a_minimum_width() {
    let mut bench = bench();
    for projection in BOTH {
        let mut s = scene(vec![set(&[&[[-900.0, 0.0, -300.0], [900.0, 0.0, 300.0]]], [20; 3], 0.05)]);
        s.camera = Camera::fit(DVec3::ZERO, 1000.0, Camera::orientation(0.0, 0.0), projection);
        let found = tube_pixels(&mut bench, &s, [256, 256]);
        let column = |x: usize| (0..256).filter(|y| found[y * 256 + x].0.is_some()).count();
        let counts: Vec<usize> = (0..256).map(column).collect();
        let first = counts.iter().position(|&n| n > 0).unwrap();
        let last = counts.iter().rposition(|&n| n > 0).unwrap();
        assert!(last - first > 150, "{first} to {last}");
        assert!(counts[first + 1..last].iter().all(|n| (1..=2).contains(n)), "{counts:?}");
        let expected = 256.0 * 1800.0 / s.camera.height_mm;
        assert!(((last - first) as f64 - expected).abs() < 4.0, "{first} {last} {expected}");
    }
}

fn ball() -> Arc<glioscope_core::RegionVolume> {
    let grid = grid([20; 3], DMat3::IDENTITY, DVec3::splat(-9.5));
    volume(&grid, 2, |k, p| p.iter().map(|&x| (x as f64 - 9.5 - k as f64).powi(2)).sum::<f64>() < 36.0)
        .unwrap()
}

#[test]
fn the_tumor_hides_only_the_tubes_behind_it() {
    let mut bench = bench();
    let size = [120, 120];
    let across = |y: f32, z: f32| vec![[-13.0, y, z], [13.0, y, z]];
    let (before, behind) = (across(9.0, 0.0), across(-9.0, 3.0));
    for projection in BOTH {
        let mut s =
            scene(vec![set(&[&before], [210, 160, 60], 0.8), set(&[&behind, &[]], [60, 160, 210], 0.8)]);
        s.tumor = Some(ball());
        s.camera.projection = projection;
        s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
        let alone = ContextScene { tubes: Vec::new(), ..s.clone() };
        let Bench { gpu, renderer } = &mut *bench;
        let plain = renderer.render(gpu, &alone, &FLAT, size).unwrap().clone();
        let (plain_surfaces, plain_depths) = (plain.read_surfaces(gpu), plain.read_depths(gpu));
        let plain = plain.read_rgba(gpu).unwrap();
        let frame = renderer.render(gpu, &s, &FLAT, size).unwrap().clone();
        let (surfaces, depths) = (frame.read_surfaces(gpu), frame.read_depths(gpu));
        let pixels = frame.read_rgba(gpu).unwrap();
        let twin = tubes_seen(&s.tubes, &s.camera, size);
        let reference_mm = s.reference_mm();
        let mut counts = [[0; 2]; 2];
        for n in 0..surfaces.len() {
            let expected = twin[n].filter(|t| t.depth_mm - reference_mm < f64::from(plain_depths[n]));
            let found = fiber_number(surfaces[n][1]);
            if twin[n].is_none_or(|t| t.facing > 0.1) {
                assert_eq!(found, expected.map(|t| t.number), "{projection:?} {n}");
            }
            match found {
                Some(number) => {
                    counts[number as usize][usize::from(plain_depths[n] < FAR)] += 1;
                    assert!(depths[n] < plain_depths[n]);
                }
                None => assert_eq!((surfaces[n], depths[n]), (plain_surfaces[n], plain_depths[n])),
            }
        }
        // The nearer one in front of the ball and beside it, the farther one only beside it.
        assert!(counts[0][0] > 100 && counts[0][1] > 100 && counts[1][0] > 100, "{counts:?}");
        assert_eq!(counts[1][1], 0, "{projection:?}");
        // Pixels further from a tube than lines reach don't change.
        let near_tube = |n: usize| {
            let (x, y) = ((n % 120) as i64, (n / 120) as i64);
            (-3..=3).any(|dy: i64| {
                (-3..=3).any(|dx: i64| {
                    let (x, y) = ((x + dx).clamp(0, 119), (y + dy).clamp(0, 119));
                    fiber_number(surfaces[(y * 120 + x) as usize][1]).is_some()
                })
            })
        };
        for n in (0..surfaces.len()).filter(|&n| !near_tube(n)) {
            assert_eq!(pixels[n * 4..n * 4 + 4], plain[n * 4..n * 4 + 4], "{n}");
        }
        // The number of the fibre in its file, picked at a pixel.
        let at = surfaces.iter().position(|s| fiber_number(s[1]) == Some(1)).unwrap() as u32;
        let pick = frame.pick(gpu, at % 120, at / 120).unwrap().unwrap();
        assert_eq!((pick.bits, pick.fiber), (None, Some(PickedFiber { set: 1, fiber: 0 })));
        let off = pick.world_mm - DVec3::new(pick.world_mm.x.clamp(-13.0, 13.0), -9.0, 3.0);
        assert!((off.length() - 0.8).abs() < 1e-3, "{off}");
        // Hidden sets aren't counted, and set indices stay those of the scene's list.
        s.tubes[0].shown = false;
        let frame = renderer.render(gpu, &s, &FLAT, size).unwrap().clone();
        let pick = frame.pick(gpu, at % 120, at / 120).unwrap().unwrap();
        assert_eq!(pick.fiber, Some(PickedFiber { set: 1, fiber: 0 }));
    }
}

#[test]
fn the_tumor_s_lines_are_not_drawn_on_tubes() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let before: &[[f32; 3]] = &[[-13.0, 9.0, 0.0], [13.0, 9.0, 0.0]];
    let mut s = scene(vec![set(&[before], [210, 160, 60], 1.6)]);
    s.tumor = Some(ball());
    s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    s.silhouette = [0, 0, 255];
    let frame = renderer.render(gpu, &s, &FLAT, [160, 160]).unwrap();
    let (surfaces, pixels) = (frame.read_surfaces(gpu), frame.read_rgba(gpu).unwrap());
    let mut tube = 0;
    for (surface, p) in surfaces.iter().zip(pixels.chunks_exact(4)) {
        if fiber_number(surface[1]).is_some() {
            tube += 1;
            assert!(p[0] > p[1] && p[1] > p[2], "{p:?}");
        }
    }
    let blue = pixels.chunks_exact(4).filter(|p| p[2] > p[0].max(p[1]).saturating_add(60)).count();
    assert!(tube > 1000 && blue > 50, "{tube} {blue}");
}

/// A homogeneous image in front of a tube: opacity 1 − (1 − α)^L over the tube's colour.
#[test]
fn the_image_in_front_of_a_tube_is_composited_over_it() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let grid = Grid::axis_aligned([24; 3], DVec3::ONE, DVec3::splat(-11.5)).unwrap();
    let image = Volume::new(grid, Samples::F64(vec![5.0; 24 * 24 * 24]), Scaling::NONE).unwrap();
    let alpha = 0.08;
    let point = |value| ControlPoint { value, color: [200, 100, 50], opacity: alpha };
    let mut s = scene(vec![set(&[&[[-6.0, 2.0, 0.0], [6.0, -3.0, 0.0]]], [40, 200, 90], 2.0)]);
    s.volume = Some(Arc::new(ContextVolume::new(Arc::new(image))));
    s.transfer = Arc::new(TransferFunction::new(vec![point(0.0), point(9.0)], None).unwrap());
    s.camera = Camera::fit(DVec3::ZERO, 8.0, Camera::orientation(0.0, 0.0), Projection::Orthographic);
    let frame = renderer.render(gpu, &s, &FLAT, [64, 64]).unwrap().clone();
    let (marched, depths) = (frame.read_marched(gpu), frame.read_depths(gpu));
    let pixels = frame.read_rgba(gpu).unwrap();
    let shades = renderer.view.read_tube_shades(gpu);
    let face_mm = s.camera.distance_mm() - 12.0 - s.reference_mm();
    let mut over = 0;
    for n in 0..depths.len() {
        let length = if depths[n] < FAR { f64::from(depths[n]) - face_mm } else { 24.0 };
        let rgba = marched[n].rgba();
        let opacity = TransferFunction::opacity_over(alpha, length);
        assert!((rgba[3] - opacity).abs() < 5e-4, "{n}: {} {opacity}", rgba[3]);
        // Inside the tube's outline, where no edge darkens it.
        if shades[n][3] > 230 {
            over += 1;
            for c in 0..3 {
                let shine = 0.12 * (f64::from(shades[n][3]) / 255.0).powi(16);
                let tube = (f64::from(shades[n][c]) / 255.0 + shine).min(1.0);
                let expected = rgba[c] + (1.0 - rgba[3]) * tube;
                let found = f64::from(pixels[n * 4 + c]) / 255.0;
                assert!((found - expected).abs() < 2.0 / 255.0, "{n}: {found} {expected}");
            }
            let pick = frame.pick(gpu, n as u32 % 64, n as u32 / 64).unwrap().unwrap();
            assert_eq!(pick.fiber.is_some(), opacity < 0.5, "{opacity}");
        }
    }
    assert!(over > 100, "{over}");
}

#[test]
fn occlusion_darkens_tubes() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    // A grid of tubes in two layers.
    let lines: Vec<[[f32; 3]; 2]> = (-6..=6)
        .flat_map(|n| {
            let x = n as f32 * 1.5;
            [[[x, 3.0, -10.0], [x, 3.0, 10.0]], [[-10.0, 0.0, x], [10.0, 0.0, x]]]
        })
        .collect();
    let fibers: Vec<&[[f32; 3]]> = lines.iter().map(|l| &l[..]).collect();
    let mut s = scene(vec![set(&fibers, [220, 220, 220], 0.5)]);
    s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    let mut mean = |quality: &Quality| {
        let frame = renderer.render(gpu, &s, quality, [160, 160]).unwrap();
        let (surfaces, pixels) = (frame.read_surfaces(gpu), frame.read_rgba(gpu).unwrap());
        let lower: Vec<f64> = surfaces
            .iter()
            .zip(pixels.chunks_exact(4))
            .filter(|(s, _)| fiber_number(s[1]).is_some_and(|n| n % 2 == 1))
            .map(|(_, p)| f64::from(p[0]))
            .collect();
        assert!(pixels.chunks_exact(4).all(|p| p[0] == p[1] && p[1] == p[2]), "bleeding is black");
        lower.iter().sum::<f64>() / lower.len() as f64
    };
    let (flat, occluded) = (mean(&FLAT), mean(&Quality::FULL));
    assert!(occluded < 0.9 * flat, "{occluded} {flat}");
}

#[test]
fn without_tubes_no_tube_pass_runs_and_no_pixel_changes() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut s = scene(vec![set(&[BENT], [200, 100, 50], 1.0)]);
    s.tumor = Some(ball());
    let whole = s.clone();
    let passes = [TUBES, TUBES_MERGE];
    let reasons = |s: &ContextScene| -> Vec<&'static str> {
        let plan = context_plan(s, &Quality::FULL);
        passes.iter().filter_map(|p| plan.omitted.iter().find(|o| o.0 == *p)).map(|o| o.1).collect()
    };
    assert!(reasons(&s).is_empty());
    s.tubes[0].shown = false;
    assert!(s != whole);
    assert_eq!(reasons(&s), ["fibre tracts are hidden"; 2]);
    let none = ContextScene { tubes: Vec::new(), ..s.clone() };
    assert_eq!(reasons(&none), ["no fibre tracts"; 2]);
    let empty = ContextScene { tubes: vec![set(&[&[]], [1; 3], 1.0)], ..s.clone() };
    assert_eq!(reasons(&empty), ["no fibre tracts"; 2]);
    let unselected = |s: &ContextScene| {
        let mut s = s.clone();
        (1..4).for_each(|bits| s.selection.set(bits, false));
        s
    };
    // Tubes alone occlude each other, too.
    assert!(context_plan(&unselected(&whole), &Quality::FULL).has(OCCLUSION));
    for (name, scene) in [
        ("hidden", s.clone()),
        ("none", none.clone()),
        ("empty", empty),
        ("hidden, no selection", unselected(&s)),
        ("none, no tumour", ContextScene { tumor: None, ..none }),
    ] {
        let lean = context_plan(&scene, &Quality::FULL);
        let mut full = lean.clone();
        full.passes.extend(passes);
        let before = renderer.render(gpu, &whole, &Quality::FULL, [80, 72]).unwrap().read_rgba(gpu).unwrap();
        let lean = renderer.render(gpu, &scene, &Quality::FULL, [80, 72]).unwrap().read_rgba(gpu).unwrap();
        assert!(renderer.view.read_tube_shades(gpu).is_empty(), "nothing is held");
        // With the passes, after a frame that leaves tubes in every buffer.
        renderer.render(gpu, &whole, &Quality::FULL, [80, 72]).unwrap();
        let all = renderer.render_planned(gpu, &scene, &Quality::FULL, [80, 72], full, Switches::ON).unwrap();
        assert!(all.read_rgba(gpu).unwrap() == lean, "{name}");
        assert!(before != lean, "{name}");
    }
    // Held buffers are reused, and released with the tubes.
    let first = renderer.render(gpu, &whole, &Quality::FULL, [80, 72]).unwrap().read_rgba(gpu).unwrap();
    let again = renderer.render(gpu, &whole, &Quality::FULL, [80, 72]).unwrap().read_rgba(gpu).unwrap();
    assert!(first == again);
    let times: Vec<PassName> = renderer.pass_times(gpu).unwrap().iter().map(|t| t.0).collect();
    assert_eq!(times, context_plan(&whole, &Quality::FULL).passes);
}

#[test]
fn tube_sets_are_prepared_from_tracts() {
    let long: Vec<[f32; 3]> = (0..500).map(|n| [n as f32 * 0.1, (n as f32 * 0.02).sin(), 7.0]).collect();
    let fibers = tracts(&[&long, &[], &long[..40], POINT]);
    let shape = TubeShape::default();
    let whole = TubeSet::new(&fibers, &shape, &Progress::new()).unwrap();
    assert_eq!((whole.fiber_count(), whole.left_out()), (4, 0));
    let look = |radius_mm| DrawnTubes {
        set: Arc::new(whole.clone()),
        look: TubeLook { radius_mm, ..TubeLook::of([1, 2, 3]) },
        shown: true,
    };
    let radii = [f64::NAN, 0.0, 2.0, f64::INFINITY].map(|radius_mm| look(radius_mm).radius_mm());
    assert_eq!(radii, [TubeSet::RADIUS_MM, 0.01, 2.0, 100.0]);
    assert!(whole.point_count() < 60, "{}", whole.point_count());
    assert_eq!([0, 1, 2, 3, 4].map(|n| whole.fiber(n).len() > 1), [true, false, true, false, false]);
    assert_eq!(whole.fiber(3).len(), 1);
    assert!(
        whole.origin_mm().abs_diff_eq(DVec3::new(27.0, 5.4_f64.sin(), 7.0), 1e-5),
        "{}",
        whole.origin_mm()
    );
    let few = TubeSet::with_most(&fibers, &shape, 12, &Progress::new()).unwrap();
    assert!(few.point_count() <= 12 && few.left_out() > 0 && few.fiber_count() == 4);
    let stopped = Progress::new();
    stopped.cancel();
    assert!(TubeSet::new(&fibers, &shape, &stopped).is_err());
    assert_eq!(TubeSet::new(&tracts(&[]), &shape, &Progress::new()).unwrap().point_count(), 0);

    let listed = |shown| DrawnTubes { shown, ..look(1.0) };
    let list = [listed(true), listed(false), listed(true)];
    let of = |n| fiber_of(&list, n);
    assert_eq!([of(0), of(3), of(4), of(7)], [Some((0, 0)), Some((0, 3)), Some((2, 0)), Some((2, 3))]);
    assert_eq!(of(8), None);
    assert_ne!(list[0], list[2]);
}

#[test]
fn too_many_points_for_the_device_are_an_error_that_names_them() {
    let gpu = small_device(100_000);
    let mut renderer = ContextRenderer::new(&gpu).unwrap();
    let zigzag: Vec<[f32; 3]> = (0..7000).map(|n| [n as f32, (n % 2) as f32 * 5.0, 0.0]).collect();
    let s = scene(vec![set(&[&zigzag], [9; 3], 1.0)]);
    let e = renderer.render(&gpu, &s, &FLAT, [32, 32]).unwrap_err();
    assert_eq!(e, RenderError::Buffer { what: "the fibre tracts", found: 112_000, limit: 100_000 });
    assert!(renderer.render(&gpu, &scene(Vec::new()), &FLAT, [32, 32]).is_ok());
}

/// Distance of two colours in Oklab (Ottosson 2020), where white to black is 1.
fn distance(a: Rgb, b: Rgb) -> f64 {
    let lab = |c: Rgb| {
        let linear = DVec3::from_array(c.map(|c| srgb::decode(f64::from(c) / 255.0)));
        let lms = DMat3::from_cols_array(&[
            0.4122214708,
            0.2119034982,
            0.0883024619,
            0.5363325363,
            0.6806995451,
            0.2817188376,
            0.0514459929,
            0.1073969566,
            0.6299787005,
        ]) * linear;
        let lms = DVec3::new(lms.x.cbrt(), lms.y.cbrt(), lms.z.cbrt());
        DMat3::from_cols_array(&[
            0.2104542553,
            1.9779984951,
            0.0259040371,
            0.7936177850,
            -2.4285922050,
            0.7827717662,
            -0.0040720468,
            0.4505937099,
            -0.8086757660,
        ]) * lms
    };
    lab(a).distance(lab(b))
}

#[test]
fn tract_colors_are_distinct_from_each_other_and_from_masks() {
    let all: Vec<Rgb> = (0..6).map(tract_color).collect();
    assert_eq!(tract_color(6), all[0]);
    for (n, &a) in all.iter().enumerate() {
        for &b in &all[..n] {
            assert!(distance(a, b) > 0.06, "{a:?} {b:?}: {}", distance(a, b));
        }
        for palette in [Palette::Thesis, Palette::ColorBlindSafe] {
            let masks = MaskColors::new(palette, &[None; 3]).with_coloring(Coloring::Masks);
            for bits in 1..8 {
                let b = masks.region(bits);
                assert!(distance(a, b) > 0.06, "{a:?} {b:?}: {}", distance(a, b));
            }
        }
    }
}

#[test]
fn rotating_scene_and_camera_keeps_the_frame() {
    // Tubes and camera rotated together leave every pixel's fibre unchanged.
    let mut bench = bench();
    let rotation = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.4);
    let s = scene(vec![set(&[STRAIGHT, BENT], [90; 3], 1.1)]);
    let rotated = |f: &[[f32; 3]]| -> Vec<[f32; 3]> {
        f.iter().map(|p| (rotation * DVec3::from_array(p.map(f64::from))).as_vec3().to_array()).collect()
    };
    let mut t = scene(vec![set(&[&rotated(STRAIGHT), &rotated(BENT)], [90; 3], 1.1)]);
    t.camera.world_from_camera = rotation * s.camera.world_from_camera;
    let (a, b) = (tube_pixels(&mut bench, &s, [80, 80]), tube_pixels(&mut bench, &t, [80, 80]));
    let differ = a.iter().zip(&b).filter(|(a, b)| a.0.map(|h| h.1) != b.0.map(|h| h.1)).count();
    assert!(differ * 100 < a.iter().filter(|a| a.0.is_some()).count(), "{differ}");
}

/// Occlusion takes ambient and diffuse light away, not the highlight (Schott et al. 2012, Algorithm 6).
#[test]
fn a_highlight_is_as_bright_in_the_dark() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let tube = |x: f32, z: f32| vec![[x, -9.0, z], [x, 9.0, z]];
    // One tube deep between rows of others.
    let rows: Vec<Vec<[f32; 3]>> =
        (2..9).flat_map(|n| [-1.0, 1.0].map(|side| tube(1.2 * side * n as f32, 6.0))).collect();
    let fibers: Vec<&[[f32; 3]]> = rows.iter().map(Vec::as_slice).collect();
    let below = tube(0.0, 0.0);
    let mut s = scene(vec![set(&[&below], [40, 120, 90], 1.2), set(&fibers, [90, 90, 90], 1.0)]);
    s.camera = Camera::fit(DVec3::ZERO, 8.0, Camera::orientation(0.0, 90.0), Projection::Orthographic);
    let quality = Quality {
        occlusion_strength: 1.0,
        lighting: crate::LightSettings { mode: crate::LightingMode::Slices, ..crate::LightSettings::DEFAULT },
        ..Quality::FULL
    };
    let frame = renderer.render(gpu, &s, &quality, [64, 64]).unwrap().clone();
    let (pixels, dark) = (frame.read_rgba(gpu).unwrap(), frame.read_blurred(gpu));
    let shades = renderer.view.read_tube_shades(gpu);
    let middle = 32 * 64 + 32;
    let darkness = f64::from(dark[middle] >> 24) / 255.0;
    let [red, _, _, facing] = shades[middle].map(|c| f64::from(c) / 255.0);
    let expected = red * (1.0 - darkness) + 0.12 * facing.powi(16);
    let found = f64::from(pixels[4 * middle]) / 255.0;
    println!("darkness {darkness:.2}, facing {facing:.2}: {found:.3}, expected {expected:.3}");
    assert!(darkness > 0.1 && facing > 0.98, "{darkness} {facing}");
    assert!((found - expected).abs() < 2.0 / 255.0, "{found} {expected}");
}
