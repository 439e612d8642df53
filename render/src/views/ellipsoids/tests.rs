//! The diagram on Mesa's software adapter, compared with its twin. Fails without an adapter.

mod lit;

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec2, DVec3};
use glioscope_core::optics::{Camera, Projection};

use super::*;
use crate::{
    device::{Gpu, RenderError},
    light::screen::{OCCLUSION, OCCLUSION_BLUR},
    scene::LightingMode,
    solid::view::FAR,
    testing::{self, BenchGuard, SharedBench, lock, noise, small_device},
    views::{EllipsoidRenderer, view3d::Switches},
};

const FLAT: Quality = Quality { occlusion_strength: 0.0, ..Quality::FULL };

type Bench = testing::Bench<Ellipsoids>;

fn bench() -> BenchGuard<Ellipsoids> {
    static BENCH: SharedBench<Ellipsoids> = SharedBench::new();
    lock(&BENCH)
}

fn every_pass() -> Plan {
    Plan { passes: vec![LISTS, OCCLUSION, OCCLUSION_BLUR, COMPOSE], omitted: Vec::new() }
}

fn scene_of(ellipsoids: Vec<DrawnEllipsoid>, center_mm: DVec3, radius_mm: f64) -> EllipsoidScene {
    EllipsoidScene {
        ellipsoids: Arc::new(ellipsoids),
        opacity: 1.0,
        lens: None,
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(35.0, 20.0), Projection::Perspective),
        background: [240, 240, 240],
        silhouette: [20, 20, 20],
        plane: None,
    }
}

/// Random ellipsoids within about 40 mm of a point, with axes of `thin` to 1 times a size of up to 25 mm.
fn random(count: u32, seed: u32, center_mm: DVec3, thin: f64) -> EllipsoidScene {
    let number = |i: u32, what: usize| noise([i as usize, what, 7], seed);
    let ellipsoids = (0..count)
        .map(|i| {
            let n = |what| number(i, what);
            let angles = [n(0), n(1), n(2)].map(|v| v * std::f64::consts::TAU);
            let turn = DQuat::from_rotation_z(angles[0]) * DQuat::from_rotation_y(angles[1]);
            let rotation = DMat3::from_quat(turn * DQuat::from_rotation_x(angles[2]));
            let offset = DVec3::new(n(3) - 0.5, n(4) - 0.5, n(5) - 0.5) * 60.0;
            let size = 4.0 + 21.0 * n(6);
            let shape = DVec3::new(1.0, thin + (1.0 - thin) * n(7), thin + (1.0 - thin) * n(8));
            DrawnEllipsoid {
                id: 90_000 - 3 * i,
                center_mm: center_mm + offset,
                semi_axes_mm: shape * size,
                rotation,
                color: [n(9), n(10), n(11)].map(|v| (255.0 * v) as u8),
                opacity: 0.15 + 0.5 * n(12),
            }
        })
        .collect();
    scene_of(ellipsoids, center_mm, 45.0)
}

/// Depth from the reference plane, id and whether it is a back face, of every pixel's fragments.
fn lists(gpu: &Gpu, renderer: &EllipsoidRenderer) -> Vec<Vec<(f32, u32, bool)>> {
    let (frame, nodes) = (renderer.frame().unwrap(), renderer.view.nodes.buffer());
    let n = u64::from(frame.size_px[0]) * u64::from(frame.size_px[1]);
    let read = gpu.read_buffers(&[(&frame.targets.outsides, 0, n * 16), (nodes, 0, nodes.size())]).unwrap();
    let heads: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&read[0]);
    let fragments: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read[1]);
    heads
        .iter()
        .map(|[first, count, ..]| {
            fragments[*first as usize..(*first + *count) as usize]
                .iter()
                .map(|[depth, code]| {
                    (f32::from_bits(*depth), frame.data.drawn[(code >> 1) as usize].id, code & 1 == 1)
                })
                .collect()
        })
        .collect()
}

#[derive(Debug, Default)]
struct Tally {
    pixels: usize,
    delicate: usize,
    fragments: usize,
    most: usize,
    worst_mm: f64,
    worst_color: f64,
}

/// Draws without occlusion and compares every pixel with the twin: the same fragments in the same order,
/// depths within `depth_mm`, colours within 2 of 255; except for pixels that the twin marks as delicate.
fn compare(name: &str, scene: &EllipsoidScene, size: [u32; 2], depth_mm: f64) -> Tally {
    compare_by(&mut bench(), name, scene, size, depth_mm)
}

fn compare_by(bench: &mut Bench, name: &str, scene: &EllipsoidScene, size: [u32; 2], depth_mm: f64) -> Tally {
    let Bench { gpu, renderer } = bench;
    let rgba = renderer.render(gpu, scene, &FLAT, size).unwrap().read_rgba(gpu).unwrap();
    let found = lists(gpu, renderer);
    let reference_mm = renderer.frame().unwrap().reference_mm;
    let mut tally = Tally { pixels: found.len(), ..Tally::default() };
    for (i, twin) in twin::cast(scene, size).iter().enumerate() {
        if twin.delicate {
            tally.delicate += 1;
            continue;
        }
        let at = [i as u32 % size[0], i as u32 / size[0]];
        let expected: Vec<(u32, bool)> = twin.fragments.iter().map(|f| (f.id, f.back)).collect();
        let order: Vec<(u32, bool)> = found[i].iter().map(|f| (f.1, f.2)).collect();
        assert_eq!(order, expected, "{name} {at:?}");
        for (f, t) in found[i].iter().zip(&twin.fragments) {
            tally.worst_mm = tally.worst_mm.max((f64::from(f.0) + reference_mm - t.depth_mm).abs());
        }
        let color = twin.color * 255.0;
        for channel in if twin.on_ring { 0..0 } else { 0..3 } {
            let off = (f64::from(rgba[4 * i + channel]) - color[channel]).abs();
            assert!(off < 2.0, "{name} {at:?}: {:?}, twin {color}", &rgba[4 * i..4 * i + 4]);
            tally.worst_color = tally.worst_color.max(off);
        }
        tally.fragments += expected.len();
        tally.most = tally.most.max(expected.len());
    }
    println!("{name}: {tally:?}");
    assert!(tally.delicate * 20 <= tally.pixels, "{name}: {tally:?}");
    assert!(tally.worst_mm < depth_mm, "{name}: {tally:?}");
    tally
}

#[test]
fn random_scenes_match_the_twin_in_order_and_colours() {
    for (seed, count) in [(1, 5), (2, 40), (3, 120)] {
        let mut scene = random(count, seed, DVec3::ZERO, 0.4);
        for projection in [Projection::Perspective, Projection::Orthographic] {
            scene.camera.projection = projection;
            scene.camera.world_from_camera = Camera::orientation(f64::from(count) * 7.0, 30.0);
            let tally = compare(&format!("{count} {projection:?}"), &scene, [80, 64], 1e-3);
            assert!(tally.fragments > 1000 && tally.most >= 4, "{tally:?}");
        }
        scene.lens = Some(Lens { center_mm: DVec3::new(5.0, -3.0, 8.0), radius_mm: 20.0 });
        scene.opacity = 0.6;
        compare(&format!("{count} with a lens"), &scene, [80, 64], 1e-3);
    }
}

#[test]
fn far_origins_needles_and_cameras_inside() {
    let far = DVec3::new(1e6, -1e6, 1e6);
    assert!(compare("at 1e6 mm", &random(40, 4, far, 0.3), [80, 64], 1e-3).fragments > 5000);
    // 1:100, seen from all around.
    for (azimuth, elevation) in [(0.0, 0.0), (60.0, -40.0), (0.0, 90.0)] {
        let mut scene = random(60, 5, DVec3::ZERO, 0.01);
        scene.ellipsoids = Arc::new(
            scene
                .ellipsoids
                .iter()
                .map(|e| DrawnEllipsoid { semi_axes_mm: DVec3::new(40.0, 0.4, 0.4 + e.opacity), ..*e })
                .collect(),
        );
        scene.camera.world_from_camera = Camera::orientation(azimuth, elevation);
        compare("needles", &scene, [80, 64], 1e-2);
    }
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let mut scene = random(80, 6, DVec3::ZERO, 0.5);
        scene.camera.projection = projection;
        scene.camera.height_mm = 4.0;
        let eye = scene.camera.eye_mm();
        let around =
            DrawnEllipsoid { center_mm: eye, semi_axes_mm: DVec3::new(9.0, 5.0, 7.0), ..scene.ellipsoids[0] };
        scene.ellipsoids = Arc::new(scene.ellipsoids.iter().copied().chain([around]).collect());
        let tally = compare("eye inside", &scene, [64, 64], 1e-3);
        assert!(tally.fragments > 64 * 64 && tally.delicate < 50, "{tally:?}");
        // Everything behind the eye.
        scene.ellipsoids = Arc::new(vec![DrawnEllipsoid {
            center_mm: eye + scene.camera.axes()[2] * 30.0,
            ..scene.ellipsoids[0]
        }]);
        assert_eq!(compare("behind the eye", &scene, [32, 32], 1e-3).fragments, 0);
    }
}

/// Colour, depths and surfaces, in bits.
fn bits(bench: &mut Bench, scene: &EllipsoidScene, quality: &Quality, plan: Plan, skipping: bool) -> Vec<u8> {
    let Bench { gpu, renderer } = bench;
    let frame =
        renderer.render_planned(gpu, scene, quality, [90, 70], plan, Switches::skipping(skipping)).unwrap();
    let mut out = frame.read_rgba(gpu).unwrap();
    if frame.plan.has(LISTS) {
        let n = 90 * 70;
        for part in gpu
            .read_buffers(&[(&frame.targets.depths, 0, n * 4), (&frame.targets.surfaces, 0, n * 8)])
            .unwrap()
        {
            out.extend(part);
        }
    }
    out
}

#[test]
fn the_order_of_the_list_changes_no_bit() {
    let mut bench = bench();
    let mut scene = random(60, 8, DVec3::ZERO, 0.4);
    // Some coincide, some even share an id.
    let mut all = scene.ellipsoids.to_vec();
    for i in 0..10 {
        all.push(DrawnEllipsoid { id: 5000 + i, color: [255, i as u8, 0], ..all[i as usize] });
        all.push(DrawnEllipsoid { color: [0, i as u8, 255], ..all[i as usize] });
    }
    scene.ellipsoids = Arc::new(all.clone());
    scene.lens = Some(Lens { center_mm: DVec3::ZERO, radius_mm: 22.0 });
    let plan = every_pass();
    let first = bits(&mut bench, &scene, &Quality::FULL, plan.clone(), true);
    for turn in 1..6_usize {
        let mut other = all.clone();
        other.sort_by_key(|e| (e.id.wrapping_mul(2_654_435_761) ^ u32::from(e.color[2])) >> turn);
        other.rotate_left(turn * 7);
        assert!(other != all);
        scene.ellipsoids = Arc::new(other);
        assert!(bits(&mut bench, &scene, &Quality::FULL, plan.clone(), true) == first, "{turn}");
    }
}

#[test]
fn coincident_ellipsoids_do_not_flicker() {
    let mut scene = random(6, 9, DVec3::ZERO, 0.5);
    let copies = scene.ellipsoids.iter().flat_map(|e| {
        [[255, 0, 0], [0, 255, 0], [0, 0, 255]]
            .into_iter()
            .zip([40, 7, 900])
            .map(|(color, id)| DrawnEllipsoid { id: e.id * 1000 + id, color, ..*e })
    });
    scene.ellipsoids = Arc::new(copies.collect());
    for azimuth in [0.0, 1.0, 77.0] {
        scene.camera.world_from_camera = Camera::orientation(azimuth, 20.0);
        let tally = compare("coincident", &scene, [90, 70], 1e-3);
        assert!(tally.most >= 6);
        let mut bench = bench();
        let once = bits(&mut bench, &scene, &Quality::FULL, every_pass(), true);
        assert!(bits(&mut bench, &scene, &Quality::FULL, every_pass(), true) == once);
    }
}

/// Nested shells, each of which covers the whole frame.
fn layers(count: u32) -> EllipsoidScene {
    let shells = (0..count).map(|i| DrawnEllipsoid {
        id: i * 7919 % 1009,
        center_mm: DVec3::ZERO,
        semi_axes_mm: DVec3::new(30.0, 31.0, 32.0) + 0.05 * f64::from(i * 37 % count),
        rotation: DMat3::IDENTITY,
        color: [200, 100, (i % 256) as u8],
        opacity: 0.004,
    });
    let mut scene = scene_of(shells.collect(), DVec3::ZERO, 10.0);
    scene.camera.focus_mm = DVec3::ZERO;
    scene.camera.projection = Projection::Orthographic;
    scene
}

#[test]
fn three_hundred_layers_lose_nothing() {
    let mut scene = layers(300);
    scene.camera.height_mm = 20.0;
    // Far enough back that the orthographic eye plane is in front of all.
    scene.camera.focus_mm = scene.camera.axes()[2] * 20.0;
    let size = [48, 40];
    let gpu = bench().gpu.clone();
    let mut counting = Bench { renderer: EllipsoidRenderer::new(&gpu).unwrap(), gpu: gpu.clone() };
    // No nodes are allocated in advance: counting has to find the number.
    counting.renderer.view.few_nodes = 64;
    let tally = compare_by(&mut counting, "300 layers", &scene, size, 1e-3);
    assert_eq!((tally.fragments, tally.most, tally.delicate), (600 * 48 * 40, 600, 0), "{tally:?}");
    assert_eq!(counting.renderer.view.grown, 1, "the buffer grew by counting");
    compare_by(&mut counting, "again, with room", &scene, size, 1e-3);
    assert_eq!(counting.renderer.view.grown, 1);
    let drawn = |bench: &mut Bench| {
        let Bench { gpu, renderer } = bench;
        let rgba = renderer.render(gpu, &scene, &FLAT, [100, 90]).unwrap().read_rgba(gpu).unwrap();
        (lists(gpu, renderer), rgba)
    };
    let by_counting = drawn(&mut counting);
    assert_eq!(counting.renderer.view.grown, 2, "more pixels, more nodes");
    // Allocating by the boxes' upper bound gives the same frame.
    let mut bounded = Bench { renderer: EllipsoidRenderer::new(&gpu).unwrap(), gpu };
    bounded.renderer.view.few_nodes = 1 << 40;
    assert!(drawn(&mut bounded) == by_counting);
    assert_eq!(bounded.renderer.view.grown, 0);
    let counted = by_counting.0.iter().map(Vec::len).sum::<usize>();
    assert_eq!(counted, 600 * 100 * 90);
}

#[test]
fn fragments_beyond_the_largest_buffer_are_drawn() {
    let gpu = small_device(400_000);
    let mut small = Bench { renderer: EllipsoidRenderer::new(&gpu).unwrap(), gpu };
    let mut mixed = random(200, 20, DVec3::ZERO, 0.4);
    mixed.ellipsoids = Arc::new(
        mixed
            .ellipsoids
            .iter()
            .zip(0..)
            .map(|(e, i)| DrawnEllipsoid { opacity: if i % 40 == 0 { 1.0 } else { 0.1 }, ..*e })
            .collect(),
    );
    mixed.lens = Some(Lens { center_mm: DVec3::ZERO, radius_mm: 22.0 });
    mixed.plane = Some(plane(DVec3::splat(-20.0), DVec3::X * 40.0, DVec3::Y * 40.0, 0.5));
    let mut shells = layers(120);
    shells.camera.height_mm = 20.0;
    shells.camera.focus_mm = shells.camera.axes()[2] * 20.0;
    for scene in [shells, mixed] {
        let draw = |bench: &mut Bench| bits(bench, &scene, &Quality::FULL, every_pass(), true);
        let expected = {
            let mut whole = bench();
            let expected = draw(&mut whole);
            assert!(!whole.renderer.frame().unwrap().plan.has(REST));
            expected
        };
        let found = draw(&mut small);
        let off: Vec<(usize, u8, u8)> = found
            .iter()
            .zip(&expected)
            .enumerate()
            .filter(|(_, (a, b))| a != b)
            .map(|(i, (a, b))| (i, *a, *b))
            .collect();
        assert!(off.is_empty(), "{} bytes of {}: {:?}", off.len(), found.len(), &off[..off.len().min(40)]);
        let frame = small.renderer.frame().unwrap();
        let read = small.gpu.read_buffers(&[(&frame.targets.outsides, 0, 90 * 70 * 16)]).unwrap();
        let heads: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&read[0]);
        let without_room = heads.iter().filter(|l| l[3] == 1).count();
        assert!(without_room > 500, "{without_room} pixels had no room");
        assert!(small.renderer.view.nodes.buffer().size() <= 400_000 && frame.plan.has(REST));
    }
}

#[test]
fn more_ellipsoids_than_a_buffer_holds_are_an_error() {
    let gpu = small_device(400_000);
    let mut renderer = EllipsoidRenderer::new(&gpu).unwrap();
    let e = renderer.render(&gpu, &random(7000, 1, DVec3::ZERO, 0.4), &FLAT, [8, 8]).unwrap_err();
    assert_eq!(e, RenderError::Buffer { what: "the ellipsoids", found: 7000 * 64, limit: 400_000 });
    assert!(e.to_string().contains("448000") && e.to_string().contains("400000"), "{e}");
    assert!(renderer.frame().is_none());
    let e = renderer.render(&gpu, &random(100, 1, DVec3::ZERO, 0.4), &FLAT, [0, 8]).unwrap_err();
    assert!(matches!(e, RenderError::Size { .. }));
    assert!(renderer.render(&gpu, &random(100, 1, DVec3::ZERO, 0.4), &FLAT, [8, 8]).is_ok());
}

#[test]
fn omitted_passes_change_no_pixel() {
    let mut bench = bench();
    let busy = random(40, 10, DVec3::ZERO, 0.4);
    let lens = Some(Lens { center_mm: DVec3::ZERO, radius_mm: 22.0 });
    let empty = EllipsoidScene { ellipsoids: Arc::new(Vec::new()), lens, ..busy.clone() };
    let transparent = EllipsoidScene { opacity: 0.0, lens, ..busy.clone() };
    for (scene, reason) in [(empty, "no ellipsoids"), (transparent, "every ellipsoid is transparent")] {
        let planned = ellipsoid_plan(&scene, &Quality::FULL);
        assert_eq!(planned.passes, [COMPOSE]);
        assert!(planned.omitted.len() == 3 && planned.omitted.iter().all(|o| o.1 == reason));
        let lean = bits(&mut bench, &scene, &Quality::FULL, planned, true);
        // Fill every buffer with something else first.
        bits(&mut bench, &busy, &Quality::FULL, every_pass(), true);
        let all = bits(&mut bench, &scene, &Quality::FULL, every_pass(), true);
        assert!(lean[..] == all[..lean.len()], "{reason}");
        let Bench { gpu, renderer } = &mut *bench;
        assert_eq!(renderer.frame().unwrap().pick(gpu, 45, 35).unwrap(), None);
    }
    let planned = ellipsoid_plan(&busy, &FLAT);
    assert_eq!(planned.passes, [LISTS, COMPOSE]);
    let lean = bits(&mut bench, &busy, &FLAT, planned, true);
    assert!(lean == bits(&mut bench, &busy, &FLAT, every_pass(), true), "strength 0");
    let whole = bits(&mut bench, &busy, &Quality::FULL, ellipsoid_plan(&busy, &Quality::FULL), true);
    assert!(whole != lean, "occlusion is visible");
    // An invisible slice changes nothing.
    for opacity in [0.0, 1.0] {
        let mut with = busy.clone();
        let behind = with.camera.eye_mm() + with.camera.axes()[2] * 50.0;
        let corner_mm = if opacity > 0.0 { behind } else { DVec3::splat(-20.0) };
        with.plane = Some(plane(corner_mm, DVec3::X * 40.0, DVec3::Y * 40.0, opacity));
        assert!(bits(&mut bench, &with, &FLAT, every_pass(), true) == lean);
    }
}

#[test]
fn fragments_behind_opaque_surfaces_are_skipped_without_effect() {
    let mut bench = bench();
    for seed in 11..14 {
        let mut scene = random(60, seed, DVec3::ZERO, 0.4);
        let some = scene.ellipsoids.iter().zip(0..);
        scene.ellipsoids = Arc::new(
            some.map(|(e, i)| DrawnEllipsoid { opacity: if i % 3 == 0 { 1.0 } else { e.opacity }, ..*e })
                .collect(),
        );
        let mut fragments = Vec::new();
        let mut pictures = Vec::new();
        for skipping in [true, false] {
            pictures.push(bits(&mut bench, &scene, &Quality::FULL, every_pass(), skipping));
            fragments.push(lists(&bench.gpu, &bench.renderer).iter().map(Vec::len).sum::<usize>());
        }
        assert!(pictures[0] == pictures[1]);
        assert!(fragments[0] * 2 < fragments[1], "{fragments:?}");
    }
}

#[test]
fn a_pick_is_the_nearest_fragment_of_the_twin() {
    let mut scene = random(40, 14, DVec3::new(1e5, 0.0, -1e5), 0.4);
    scene.lens = Some(Lens { center_mm: DVec3::new(1e5, 0.0, -1e5), radius_mm: 38.0 });
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    for scale in [1.0, 0.5] {
        let quality = Quality { resolution_scale: scale, ..Quality::FULL };
        let frame = renderer.render(gpu, &scene, &quality, [90, 70]).unwrap();
        let twin = twin::cast(&scene, frame.size_px);
        let mut found = [0; 3];
        for y in (1..70).step_by(3) {
            for x in (0..90).step_by(4) {
                let at = [x, y].map(|v| ((f64::from(v) + 0.5) * scale) as u32);
                let pixel = &twin[(at[1] * frame.size_px[0] + at[0]) as usize];
                let pick = frame.pick(gpu, x, y).unwrap();
                if pixel.delicate {
                    continue;
                }
                let Some(first) = pixel.fragments.first() else {
                    found[2] += 1;
                    assert_eq!(pick, None);
                    continue;
                };
                let pick = pick.unwrap();
                assert_eq!(pick.id, first.id);
                assert!(pick.world_mm.distance(first.world_mm) < 2e-3, "{pick:?} {first:?}");
                let inside = pick.world_mm.distance(DVec3::new(1e5, 0.0, -1e5)) <= 38.0;
                assert_eq!(pick.inside_lens, inside);
                found[usize::from(inside)] += 1;
            }
        }
        assert!(found.iter().all(|n| *n > 10), "{found:?}");
        assert_eq!(frame.pick(gpu, 90, 0).unwrap(), None);
    }
}

fn plane(corner_mm: DVec3, right_mm: DVec3, down_mm: DVec3, opacity: f64) -> SlicePlane {
    let rgba = [[200, 40, 0, 255], [0, 200, 40, 255], [40, 0, 200, 255], [90, 90, 90, 0]];
    SlicePlane {
        rgba: Arc::new(rgba.as_flattened().to_vec()),
        size_px: [2, 2],
        corner_mm,
        right_mm,
        down_mm,
        opacity,
    }
}

#[test]
fn a_slice_is_blended_at_its_depth() {
    for (seed, projection) in [(15, Projection::Perspective), (16, Projection::Orthographic)] {
        let mut scene = random(30, seed, DVec3::ZERO, 0.5);
        scene.camera.projection = projection;
        // Not square, and slanted.
        scene.plane = Some(plane(
            DVec3::new(-30.0, -28.0, -12.0),
            DVec3::new(50.0, 9.0, 14.0),
            DVec3::new(7.0, 52.0, -3.0),
            0.7,
        ));
        compare("a slice", &scene, [80, 64], 1e-3);
    }
    // Closed form: one texel of opacity 0.4 over the left half of the frame.
    let mut scene = random(0, 1, DVec3::ZERO, 0.5);
    let [right, up, back] = scene.camera.axes();
    let rgba = Arc::new(vec![10, 110, 210, 255]);
    scene.plane = Some(SlicePlane {
        rgba,
        size_px: [1, 1],
        corner_mm: right * -100.0 + up * 100.0 + back * 3.0,
        right_mm: right * 100.0,
        down_mm: up * -200.0,
        opacity: 0.4,
    });
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let rgba = renderer.render(gpu, &scene, &FLAT, [40, 30]).unwrap().read_rgba(gpu).unwrap();
    for (i, pixel) in rgba.chunks(4).enumerate() {
        // Its right edge is in the middle.
        let expected = if i % 40 < 20 { [148, 188, 228, 255] } else { [240, 240, 240, 255] };
        assert_eq!(pixel, expected, "{i}");
    }
    for spoil in [
        (|p: &mut SlicePlane| p.size_px = [2, 1]) as fn(&mut SlicePlane),
        |p| p.down_mm = p.right_mm,
        |p| p.corner_mm.x = f64::NAN,
    ] {
        let mut bad = scene.clone();
        bad.plane.as_mut().map(spoil);
        let e = renderer.render(gpu, &bad, &FLAT, [40, 30]).unwrap_err();
        assert!(matches!(&e, RenderError::Scene(_)) && e.to_string().contains("slice"), "{e}");
    }
}

#[test]
fn outlines_greys_and_creases_have_the_expected_colours() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let ball = |x: f64, id: u32, color: [u8; 3]| DrawnEllipsoid {
        id,
        center_mm: DVec3::new(x, 0.0, 0.0),
        semi_axes_mm: DVec3::splat(20.0),
        rotation: DMat3::IDENTITY,
        color,
        opacity: 1.0,
    };
    let mut scene =
        scene_of(vec![ball(-12.0, 1, [255, 0, 0]), ball(12.0, 2, [0, 255, 0])], DVec3::ZERO, 35.0);
    scene.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    scene.camera.projection = Projection::Orthographic;
    let size = DVec2::splat(512.0);
    let camera = scene.camera;
    let pixel = |rgba: &[u8], mm: DVec3| {
        let at = camera.project(mm, size).unwrap();
        let i = 4 * (at.y as usize * 512 + at.x as usize);
        [rgba[i], rgba[i + 1], rgba[i + 2]]
    };
    let flat = renderer.render(gpu, &scene, &FLAT, [512, 512]).unwrap().read_rgba(gpu).unwrap();
    let crease = DVec3::new(-1.0, 14.0, 0.0);
    let [r, g, b] = pixel(&flat, DVec3::new(-15.0, 0.0, 0.0));
    assert!(r > 200 && g == b && g < 120, "red and lit: {r} {g} {b}");
    assert!(pixel(&flat, DVec3::new(-31.8, 0.0, 0.0)).iter().all(|&c| c < 110), "an outline");
    assert_eq!(pixel(&flat, DVec3::new(-33.0, 0.0, 0.0)), [240; 3]);
    let frame = renderer.render(gpu, &scene, &Quality::FULL, [512, 512]).unwrap();
    let dark = frame.read_rgba(gpu).unwrap();
    let (before, after) = (pixel(&flat, crease)[0], pixel(&dark, crease)[0]);
    assert!(after + 8 < before, "the crease: {before}, {after}");
    scene.lens = Some(Lens { center_mm: DVec3::new(-12.0, 0.0, 0.0), radius_mm: 22.0 });
    let lens = renderer.render(gpu, &scene, &FLAT, [512, 512]).unwrap().read_rgba(gpu).unwrap();
    let [r, g, b] = pixel(&lens, DVec3::new(26.0, 0.0, 0.0));
    assert!(r == g && g == b, "grey outside the lens: {r} {g} {b}");
    assert_eq!(pixel(&lens, DVec3::new(-20.0, 3.0, 0.0)), pixel(&flat, DVec3::new(-20.0, 3.0, 0.0)));
    let ring = pixel(&lens, DVec3::new(-12.0, 0.0, 22.0));
    assert!(ring.iter().all(|&c| c > 200), "the ring: {ring:?}");
}

#[test]
fn invalid_ellipsoids_are_errors_and_timing_keeps_the_frame() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let good = random(20, 17, DVec3::ZERO, 0.4);
    for spoil in [
        (|e: &mut DrawnEllipsoid| e.semi_axes_mm.y = 0.0) as fn(&mut DrawnEllipsoid),
        |e| e.center_mm.x = f64::NAN,
        |e| e.rotation = DMat3::ZERO,
        |e| e.opacity = f64::NAN,
    ] {
        let mut all = good.ellipsoids.to_vec();
        spoil(&mut all[3]);
        let bad = EllipsoidScene { ellipsoids: Arc::new(all), ..good.clone() };
        let e = renderer.render(gpu, &bad, &FLAT, [16, 16]).map(|_| ()).unwrap_err();
        assert!(matches!(e, RenderError::Scene(_)), "{e}");
    }
    assert!(matches!(renderer.render(gpu, &good, &FLAT, [0, 9]), Err(RenderError::Size { .. })));
    let first = renderer.render(gpu, &good, &Quality::FULL, [64, 64]).unwrap().read_rgba(gpu).unwrap();
    for _ in 0..2 {
        let times = renderer.pass_times(gpu).unwrap();
        assert_eq!(times.iter().map(|t| t.0).collect::<Vec<_>>(), every_pass().passes);
        assert!(renderer.frame().unwrap().read_rgba(gpu).unwrap() == first);
    }
    let frame = renderer.frame().unwrap();
    let depths = gpu.read_buffers(&[(&frame.targets.depths, 0, 64 * 64 * 4)]).unwrap();
    let depths: Vec<f32> = bytemuck::pod_collect_to_vec(&depths[0]);
    assert!(depths.iter().any(|d| *d >= FAR) && depths.iter().any(|d| *d < 100.0));
}
