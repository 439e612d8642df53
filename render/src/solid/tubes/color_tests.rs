//! Colours along tubes on Mesa's software adapter, compared with the known direction and scalar at the place that a ray in
//! `f64` meets.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Progress, ScalarPer, Selection, Sides, TractScalar, Tracts,
    optics::{Camera, Projection},
};

use super::{buffers::fiber_number, twin::tubes_seen, *};
use crate::{
    ContextRenderer, ContextScene,
    image::TransferFunction,
    scene::{MaskColors, Palette, Quality},
    testing::{self, BenchGuard, SharedBench, lock},
};

type Bench = testing::Bench<crate::views::context::Context>;

fn bench() -> BenchGuard<crate::views::context::Context> {
    static BENCH: SharedBench<crate::views::context::Context> = SharedBench::new();
    lock(&BENCH)
}

const FLAT: Quality = Quality { occlusion_strength: 0.0, ..Quality::FULL };
const SIZE: [u32; 2] = [160, 140];

fn scene(tubes: Vec<DrawnTubes>, projection: Projection) -> ContextScene {
    ContextScene {
        volume: None,
        transfer: Arc::new(TransferFunction::transparent()),
        projection: None,
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 2]),
        lens: None,
        tubes,
        camera: Camera::fit(DVec3::ZERO, 14.0, Camera::orientation(35.0, 20.0), projection),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

fn tracts(fibers: &[Vec<DVec3>]) -> Tracts {
    let points = fibers.iter().flatten().map(|p| p.as_vec3().to_array()).collect();
    let mut offsets = vec![0];
    offsets.extend(fibers.iter().scan(0, |end, fiber| {
        *end += fiber.len() as u32;
        Some(*end)
    }));
    Tracts::new(points, offsets, Sides::Known).unwrap()
}

fn drawn(tracts: &Tracts, shape: &TubeShape<'_>, look: TubeLook) -> DrawnTubes {
    DrawnTubes { set: Arc::new(TubeSet::new(tracts, shape, &Progress::new()).unwrap()), look, shown: true }
}

fn look() -> TubeLook {
    TubeLook { radius_mm: 0.8, ..TubeLook::of([10, 20, 30]) }
}

/// The colour of each pixel's tube, its shading undone, with its fibre and the place that the twin's ray meets it at;
/// only where the shade has enough steps and both show the same fibre.
fn colors(bench: &mut Bench, scene: &ContextScene) -> Vec<(usize, DVec3, [f64; 3])> {
    let Bench { gpu, renderer } = bench;
    let frame = renderer.render(gpu, scene, &FLAT, SIZE).unwrap();
    let surfaces = frame.read_surfaces(gpu);
    let shades = renderer.view.read_tube_shades(gpu);
    let expected = tubes_seen(&scene.tubes, &scene.camera, SIZE);
    let mut found = Vec::new();
    for ((surface, shade), hit) in surfaces.iter().zip(shades).zip(expected) {
        let Some((hit, number)) = hit.zip(fiber_number(surface[1])) else { continue };
        if hit.number == number && hit.facing > 0.5 {
            let light = 0.4 + 0.6 * f64::from(shade[3]) / 255.0;
            found.push((
                number as usize,
                hit.place_mm,
                [0, 1, 2].map(|c| f64::from(shade[c]) / 255.0 / light),
            ));
        }
    }
    found
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f64::max)
}

/// Straight fibres: along each axis, against one, and oblique.
fn straight() -> Vec<(DVec3, Vec<DVec3>)> {
    let oblique = DVec3::new(0.6, -0.48, 0.64);
    [
        (DVec3::X, DVec3::new(0.0, -9.0, -4.0)),
        (-DVec3::X, DVec3::new(0.0, -9.0, 0.0)),
        (DVec3::Y, DVec3::new(-8.0, 0.0, -7.0)),
        (DVec3::Z, DVec3::new(9.0, 2.0, 0.0)),
        (oblique, DVec3::new(1.0, 4.0, 3.0)),
    ]
    .map(|(along, middle)| {
        // Uneven steps.
        let places = [-6.0, -5.0, -1.0, 0.0, 4.0, 6.0].map(|at| middle + at * along);
        (along, places.to_vec())
    })
    .to_vec()
}

#[test]
fn straight_fibers_have_the_color_of_their_direction() {
    let mut bench = bench();
    let fibers = straight();
    let lines: Vec<Vec<DVec3>> = fibers.iter().map(|f| f.1.clone()).collect();
    let of_direction = TubeShape { values: TubeValues::Direction, smooth_mm: None };
    for (shape, projection) in [
        (of_direction, Projection::Perspective),
        (TubeShape { smooth_mm: Some(0.02), ..of_direction }, Projection::Orthographic),
    ] {
        let s = scene(vec![drawn(&tracts(&lines), &shape, look())], projection);
        let mut counts = [0; 5];
        let mut worst = 0.0_f64;
        for (number, _, color) in colors(&mut bench, &s) {
            counts[number] += 1;
            worst = worst.max(distance(color, fibers[number].0.abs().to_array()));
        }
        println!("{projection:?}: pixels {counts:?}, colours off by at most {worst:.4}");
        assert!(counts.iter().all(|&n| n > 100), "{counts:?}");
        // Two steps of 255, over the least light of a pixel counted.
        assert!(worst < 2.0 / 255.0 / 0.7, "{worst}");
    }
}

/// An arc: its colour is that of its tangent everywhere, though it is drawn as few segments.
#[test]
fn a_bent_fiber_has_the_color_of_its_tangent_along_its_way() {
    let mut bench = bench();
    let radius = 9.0;
    let on = |angle: f64| radius * DVec3::new(angle.cos(), 0.0, angle.sin());
    let line: Vec<DVec3> = (0..=90).map(|n| on(f64::from(n) * 0.035)).collect();
    let of_direction = TubeShape { values: TubeValues::Direction, smooth_mm: None };
    for smooth_mm in [None, Some(0.05)] {
        let shape = TubeShape { smooth_mm, ..of_direction };
        let s =
            scene(vec![drawn(&tracts(std::slice::from_ref(&line)), &shape, look())], Projection::Perspective);
        let (mut worst, mut count) = (0.0_f64, 0);
        for (_, place, color) in colors(&mut bench, &s) {
            // Ends are round.
            let Some(out) = DVec3::new(place.x, 0.0, place.z).try_normalize().filter(|o| o.z > 0.15) else {
                continue;
            };
            count += 1;
            worst = worst.max(distance(color, [out.z.abs(), 0.0, out.x.abs()]));
        }
        println!("smooth {smooth_mm:?}: {count} pixels off by at most {worst:.4}");
        assert!(count > 500, "{count}");
        // The tolerance of simplified colours, rounding, and the 0.05 mm between drawn and true place.
        assert!(worst < values::TOLERANCES[0] + 0.016, "{worst}");
    }
}

#[test]
fn a_scalar_of_points_and_one_of_fibers_have_the_colors_of_their_map() {
    let mut bench = bench();
    let fibers = straight();
    let lines: Vec<Vec<DVec3>> = fibers.iter().map(|f| f.1.clone()).collect();
    // The distance along a fibre: linear between its uneven points.
    let along = |number: usize, place: DVec3| {
        let (direction, line) = &fibers[number];
        (place - line[0]).dot(*direction).clamp(0.0, 12.0)
    };
    let per_point: Vec<f32> =
        lines.iter().enumerate().flat_map(|(n, l)| l.iter().map(move |&p| along(n, p) as f32)).collect();
    let per_fiber = vec![1.0, 2.0, f32::NAN, 5.0, -3.0];
    let scalars = vec![
        TractScalar::new("distance".into(), ScalarPer::Point, per_point),
        TractScalar::new("bundle".into(), ScalarPer::Fiber, per_fiber.clone()),
    ];
    let all = tracts(&lines).with_scalars(scalars).unwrap();
    let range = [2.0, 10.0];
    for map in [ColorMap::Viridis, ColorMap::Grey] {
        for (name, smooth_mm) in [("distance", None), ("distance", Some(0.02)), ("bundle", None)] {
            let shape = TubeShape { values: TubeValues::Scalar(all.scalar(name).unwrap()), smooth_mm };
            let own = TubeLook { map, range, ..look() };
            let s = scene(vec![drawn(&all, &shape, own)], Projection::Perspective);
            let (mut worst, mut counts) = (0.0_f64, [0; 5]);
            for (number, place, color) in colors(&mut bench, &s) {
                counts[number] += 1;
                let value = if name == "distance" { along(number, place) } else { per_fiber[number].into() };
                let share = (value - 2.0) / 8.0;
                let expected =
                    if share.is_nan() { [0.5; 3] } else { map.color(share).map(|c| f64::from(c) / 255.0) };
                worst = worst.max(distance(color, expected));
            }
            println!("{name} {map:?} {smooth_mm:?}: {counts:?} off by at most {worst:.4}");
            assert!(counts.iter().all(|&n| n > 100), "{counts:?}");
            // Half of 256 steps, steps of the shade, and the tolerance of simplified values in this range.
            assert!(worst < 0.5 / 255.0 + 2.0 / 255.0 / 0.7 + 0.01 * 12.0 / 8.0, "{worst}");
        }
    }
}

#[test]
fn missing_values_are_grey_up_to_the_next_point() {
    let mut bench = bench();
    let line: Vec<DVec3> = [-9.0, -3.0, 3.0, 9.0].map(|x| DVec3::X * x).to_vec();
    let scalar = TractScalar::new("s".into(), ScalarPer::Point, vec![0.0, 1.0, f32::INFINITY, 0.5]);
    let all = tracts(&[line]).with_scalars(vec![scalar]).unwrap();
    let shape = TubeShape { values: TubeValues::Scalar(&all.scalars()[0]), smooth_mm: None };
    let s =
        scene(vec![drawn(&all, &shape, TubeLook { map: ColorMap::Hot, ..look() })], Projection::Perspective);
    let (mut grey, mut colored) = (0, 0);
    for (_, place, color) in colors(&mut bench, &s) {
        let is_grey = distance(color, [0.5; 3]) < 0.02;
        if place.x > -2.9 && place.x < 8.9 {
            grey += usize::from(is_grey);
            assert!(is_grey, "{place} {color:?}");
        } else if place.x < -3.2 {
            colored += usize::from(!is_grey);
        }
    }
    assert!(grey > 200 && colored > 100, "{grey} {colored}");
}

/// Where no set is coloured by values, the passes are those without, and the frame is the same byte for byte, also of a set
/// beside one that is.
#[test]
fn sets_of_one_color_cost_nothing_more_and_look_the_same_beside_others() {
    let mut bench = bench();
    let lines: Vec<Vec<DVec3>> = straight().into_iter().map(|f| f.1).collect();
    let plain = drawn(&tracts(&lines[..2]), &TubeShape::default(), look());
    let shape = TubeShape { values: TubeValues::Direction, smooth_mm: None };
    let far: Vec<Vec<DVec3>> = vec![lines[4].iter().map(|p| p + DVec3::splat(500.0)).collect()];
    let colored = drawn(&tracts(&far), &shape, look());
    let alone = scene(vec![plain.clone()], Projection::Perspective);
    let beside = scene(vec![plain, colored], Projection::Perspective);
    let Bench { gpu, renderer } = &mut *bench;
    let first = renderer.render(gpu, &alone, &FLAT, SIZE).unwrap().read_rgba(gpu).unwrap();
    assert!(!renderer.view.tubes.has_values());
    let second = renderer.render(gpu, &beside, &FLAT, SIZE).unwrap().read_rgba(gpu).unwrap();
    assert!(renderer.view.tubes.has_values());
    assert!(first == second);
    let third = renderer.render(gpu, &alone, &FLAT, SIZE).unwrap().read_rgba(gpu).unwrap();
    assert!(first == third && !renderer.view.tubes.has_values());
}

/// Another look of the same set is drawn at once: a frame after a change equals one that began with it.
#[test]
fn a_look_is_changed_without_preparing_the_set() {
    let mut bench = bench();
    let lines: Vec<Vec<DVec3>> = straight().into_iter().map(|f| f.1).collect();
    let scalar = TractScalar::new("s".into(), ScalarPer::Fiber, vec![0.0, 0.25, 0.5, 0.75, 1.0]);
    let all = tracts(&lines).with_scalars(vec![scalar]).unwrap();
    let shape = TubeShape { values: TubeValues::Scalar(&all.scalars()[0]), smooth_mm: None };
    let set = drawn(&all, &shape, look());
    let other = DrawnTubes {
        look: TubeLook { radius_mm: 1.4, map: ColorMap::Inferno, range: [0.2, 0.6], ..set.look },
        ..set.clone()
    };
    assert_ne!(set, other);
    let Bench { gpu, renderer } = &mut *bench;
    let frame = |renderer: &mut ContextRenderer, tubes: &DrawnTubes| {
        let scene = scene(vec![tubes.clone()], Projection::Perspective);
        renderer.render(gpu, &scene, &FLAT, SIZE).unwrap().read_rgba(gpu).unwrap()
    };
    let before = frame(renderer, &set);
    let changed = frame(renderer, &other);
    let mut fresh = ContextRenderer::new(gpu).unwrap();
    assert!(changed == frame(&mut fresh, &other) && changed != before);
}

#[test]
fn simplified_sets_keep_the_points_that_their_values_need() {
    let line: Vec<DVec3> = (0..100).map(|n| DVec3::X * f64::from(n) * 0.1).collect();
    let step: Vec<f32> = (0..100).map(|n| if n < 50 { 0.0 } else { 1.0 }).collect();
    let ramp: Vec<f32> = (0..100).map(|n| n as f32).collect();
    let count = |values: Vec<f32>| {
        let scalar = TractScalar::new("s".into(), ScalarPer::Point, values);
        let all = tracts(std::slice::from_ref(&line)).with_scalars(vec![scalar]).unwrap();
        let shape = TubeShape { values: TubeValues::Scalar(&all.scalars()[0]), smooth_mm: None };
        let set = TubeSet::new(&all, &shape, &Progress::new()).unwrap();
        assert_eq!(set.values.len(), set.point_count());
        set.point_count()
    };
    let plain = TubeSet::new(&tracts(std::slice::from_ref(&line)), &TubeShape::default(), &Progress::new());
    assert_eq!((count(ramp), plain.unwrap().point_count()), (3, 3));
    assert!((4..8).contains(&count(step)));
}

/// The knob of smooth curves: how far the drawn chain is from the curve, and how many points it costs. Arcs and helices
/// with a point every 4 mm, bending radii from 8 to 40 mm. docs/studies.md has what it prints.
#[test]
fn smooth_curves_are_as_near_as_stated() {
    let lines: Vec<Vec<DVec3>> = (0..24)
        .map(|n| {
            let radius = 8.0 + 32.0 * f64::from(n) / 23.0;
            let rise = if n % 2 == 0 { 0.0 } else { 0.5 };
            (0..25)
                .map(|k| {
                    let angle = 4.0 * f64::from(k) / radius;
                    DVec3::new(radius * angle.cos(), radius * angle.sin(), rise * 4.0 * f64::from(k))
                })
                .collect()
        })
        .collect();
    let all = tracts(&lines);
    let radius_mm = TubeSet::RADIUS_MM;
    let straight = TubeSet::new(&all, &TubeShape::default(), &Progress::new()).unwrap();
    println!("straight: {} points of {}", straight.point_count(), all.points_mm().len());
    let mut before = 0;
    for share in [0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005] {
        let shape = TubeShape { smooth_mm: Some(share * radius_mm), ..TubeShape::default() };
        let set = TubeSet::new(&all, &shape, &Progress::new()).unwrap();
        let mut worst = 0.0_f64;
        for (n, line) in lines.iter().enumerate() {
            let places: Vec<DVec3> =
                set.fiber(n).iter().map(|p| set.origin_mm() + DVec3::from_array(p.map(f64::from))).collect();
            for point in smooth::smoothed(line, 1e-5) {
                let off = places.windows(2).map(|s| simplify::off_segment(point.place, s[0], s[1]));
                worst = worst.max(off.fold(f64::INFINITY, f64::min));
            }
        }
        println!("{share} of the radius: {} points, {worst:.5} mm off", set.point_count());
        // Points are stored to 1e-5 mm.
        assert!(worst <= share * radius_mm + 1e-4, "{worst} {share}");
        assert!(set.point_count() >= before);
        before = set.point_count();
    }
}
