//! The change view on Mesa's software adapter. Fails without an adapter.

mod lit;
mod plans;

use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, MaskBits, Progress,
    change::{Change, ChangeOptions, change},
    grid::ijk,
    optics::{Camera, Projection},
};

use super::{
    ARROWS, ARROWS_MERGE, ChangeContext, ChangeLook, ChangeScene, ChangeStyle, ChangeSurface, EARLIER,
    HEIGHT_FILTER_ACROSS, HEIGHT_FILTER_DOWN, HEIGHTS,
    arrows::GpuArrow,
    change_plan,
    surface::{AFTER, ALONE, BEFORE, Length},
    twin,
};
use crate::{
    ClipPlane,
    device::{Gpu, PassName, RenderError},
    image::{CONTEXT, ContextVolume, ControlPoint, GRADIENT_OPACITY, TransferFunction},
    light::screen::{OCCLUSION, OCCLUSION_BLUR},
    scene::{LightSettings, LightingMode, Plan, Quality},
    solid::{OUTSIDE, SURFACE, view::FAR},
    testing::{self, BenchGuard, SharedBench, grid, lock, noise},
    views::{
        ChangeRenderer, Frame,
        context::around_light,
        view3d::{COMPOSE, Switches},
    },
};

const FLAT: Quality = Quality { occlusion_strength: 0.0, ..Quality::FULL };

type Bench = testing::Bench<super::Change>;

fn bench() -> BenchGuard<super::Change> {
    static BENCH: SharedBench<super::Change> = SharedBench::new();
    lock(&BENCH)
}

/// Every pass of the view, in order.
fn every_pass(mode: LightingMode) -> Plan {
    let quality = Quality { lighting: LightSettings { mode, ..LightSettings::DEFAULT }, ..Quality::FULL };
    let merge = [ARROWS_MERGE].into_iter().filter(|_| mode != LightingMode::ScreenSpace);
    let before = [SURFACE, OUTSIDE, ARROWS].into_iter().chain(merge);
    let after = [HEIGHTS, HEIGHT_FILTER_ACROSS, HEIGHT_FILTER_DOWN, COMPOSE];
    Plan { passes: around_light(&quality, before, after), omitted: Vec::new() }
}

fn cubic(n: usize) -> Grid {
    Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::ZERO).unwrap()
}

fn mask(grid: &Grid, active: impl Fn(DVec3) -> bool) -> MaskBits {
    let dims = grid.dims();
    MaskBits::from_fn(grid.dims(), |l| active(DVec3::from_array(ijk(dims, l).map(|v| v as f64))))
}

fn ball(center: DVec3, radius: f64) -> impl Fn(DVec3) -> bool {
    move |v| v.distance(center) <= radius
}

fn changed(grid: &Grid, masks: [&MaskBits; 2]) -> Change {
    change(masks[0], masks[1], grid, &ChangeOptions::default(), &Progress::new()).unwrap()
}

fn surface(grid: &Grid, before: impl Fn(DVec3) -> bool, after: impl Fn(DVec3) -> bool) -> Arc<ChangeSurface> {
    let masks = [mask(grid, before), mask(grid, after)];
    let found = changed(grid, [&masks[0], &masks[1]]);
    Arc::new(ChangeSurface::new(&masks[0], &masks[1], grid, Arc::new(found)).unwrap())
}

fn transfer(opacity: f64) -> Arc<TransferFunction> {
    let point = |value| ControlPoint { value, color: [90, 120, 90], opacity };
    Arc::new(TransferFunction::new(vec![point(0.0), point(1.0)], None).unwrap())
}

fn scene(surface: Arc<ChangeSurface>) -> ChangeScene {
    let grid = surface.volume().grid();
    let center_mm = grid.center_mm();
    let radius_mm = 1.1 * grid.corners_mm()[0].distance(center_mm);
    ChangeScene {
        surface: Some(surface),
        look: ChangeLook { smooth_mm: 0.0, ..ChangeLook::default() },
        base: ChangeLook::BASE,
        context: ChangeContext { volume: None, transfer: transfer(0.5), clip: Vec::new() },
        camera: Camera::fit(center_mm, radius_mm, Camera::orientation(35.0, 20.0), Projection::Perspective),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

/// Grown on one side, shrunk on the other, ragged, with a component that appears and one that
/// vanishes.
fn ragged(grid: &Grid) -> Arc<ChangeSurface> {
    let dims = grid.dims().map(|d| d as f64);
    let size = DVec3::from_array(dims);
    let lump = move |shift: f64, seed: u32| {
        move |v: DVec3| {
            let at = (v + 0.5) / size - 0.5;
            let r = (at - DVec3::new(shift, 0.0, 0.0)).length();
            let p = [v.x as usize, v.y as usize, v.z as usize];
            r < 0.27 + 0.05 * (at.y * 17.0).sin() && noise(p, seed) > 0.04
        }
    };
    let spot = move |x: f64| move |v: DVec3| ((v + 0.5) / size - DVec3::new(x, 0.9, 0.85)).length() < 0.1;
    let (before, after) = (lump(-0.05, 1), lump(0.06, 2));
    let (vanished, appeared) = (spot(0.1), spot(0.9));
    surface(grid, move |v| before(v) || vanished(v), move |v| after(v) || appeared(v))
}

struct Read {
    depths: Vec<f32>,
    surfaces: Vec<[u32; 2]>,
    cells: Vec<u32>,
    heights: Vec<[f32; 2]>,
    filtered: Vec<[f32; 2]>,
    rgba: Vec<u8>,
}

fn read(gpu: &Gpu, frame: &Frame<super::Change>) -> Read {
    let n = u64::from(frame.size_px[0]) * u64::from(frame.size_px[1]);
    let parts = gpu
        .read_buffers(&[
            (&frame.targets.depths, 0, n * 4),
            (&frame.targets.surfaces, 0, n * 8),
            (&frame.data.own.cells, 0, n * 4),
            (&frame.data.own.heights, 0, n * 8),
            (&frame.data.own.filtered, 0, n * 8),
        ])
        .unwrap();
    Read {
        depths: bytemuck::pod_collect_to_vec(&parts[0]),
        surfaces: bytemuck::pod_collect_to_vec(&parts[1]),
        cells: bytemuck::pod_collect_to_vec(&parts[2]),
        heights: bytemuck::pod_collect_to_vec(&parts[3]),
        filtered: bytemuck::pod_collect_to_vec(&parts[4]),
        rgba: frame.read_rgba(gpu).unwrap(),
    }
}

fn draw(bench: &mut Bench, scene: &ChangeScene, size: [u32; 2]) -> Read {
    let frame = bench.renderer.render(&bench.gpu, scene, &FLAT, size).unwrap().clone();
    read(&bench.gpu, &frame)
}

/// Red minus green of each pixel.
fn redness(read: &Read) -> Vec<i32> {
    read.rgba.chunks_exact(4).map(|p| i32::from(p[0]) - i32::from(p[1])).collect()
}

#[test]
fn regions_are_before_after_both_and_unpartnered() {
    let grid = cubic(32);
    let s = surface(
        &grid,
        |v| ball(DVec3::splat(10.0), 6.0)(v) || ball(DVec3::new(26.0, 26.0, 5.0), 3.0)(v),
        |v| ball(DVec3::splat(11.0), 6.0)(v) || ball(DVec3::new(26.0, 5.0, 26.0), 3.0)(v),
    );
    let volume = s.volume();
    let mut bits = volume.bits_of_id()[1..].to_vec();
    bits.sort_unstable();
    assert_eq!(bits, [BEFORE, AFTER, BEFORE | AFTER, BEFORE | ALONE, AFTER | ALONE]);
    let mut counts = [0; 8];
    for linear in 0..volume.grid().voxel_count() {
        let bits = volume.bits_of_id()[volume.id(linear) as usize];
        counts[bits as usize] += 1;
        let v = s.voxel(linear);
        let at = DVec3::new(v[0] as f64, v[1] as f64, v[2] as f64);
        let alone = ball(DVec3::new(26.0, 26.0, 5.0), 3.0)(at) || ball(DVec3::new(26.0, 5.0, 26.0), 3.0)(at);
        assert_eq!(bits & ALONE != 0, alone, "{v:?}");
    }
    // Whole components, not only their surfaces.
    assert_eq!(counts[5], 123);
    assert_eq!(counts[6], 123);
    for vector in &s.change().vectors {
        assert_eq!(s.vector(vector.voxel), Some(vector));
        assert!(s.unpartnered(vector.voxel).is_none());
    }
    assert!(s.change().unpartnered.iter().all(|u| s.unpartnered(u.voxel) == Some(u)));
    let nothing = mask(&grid, |_| false);
    let none = Arc::new(changed(&grid, [&nothing, &nothing]));
    assert!(ChangeSurface::new(&nothing, &nothing, &grid, Arc::clone(&none)).is_none());
    let other = MaskBits::full([3; 3]);
    assert!(ChangeSurface::new(&other, &nothing, &grid, none).is_none());
}

#[test]
fn every_length_is_in_the_table_once() {
    let s = ragged(&cubic(40));
    let (table, log2_slots) = s.lengths().unwrap();
    let used: Vec<&Length> = table.iter().filter(|l| l.key != 0).collect();
    assert_eq!(used.len(), s.change().vectors.len());
    assert!(2 * used.len() <= table.len() && table.len() == 1 << log2_slots);
    for length in used {
        let vector = s.vector(s.voxel(length.key as usize - 1)).unwrap();
        assert_eq!(vector.signed_mm as f32, length.signed_mm);
        assert_eq!(length.sure < 1.0, vector.flags.within_uncertainty);
    }
}

#[test]
fn lookup_and_filter_agree_with_their_twin() {
    let shear =
        DMat3::from_cols(DVec3::new(-0.9, 0.1, 0.2), DVec3::new(0.3, 1.1, -0.1), DVec3::new(0.4, -0.2, 2.0));
    let cases = [
        ("cube", cubic(36)),
        ("1:10", grid([60, 56, 9], DMat3::from_diagonal(DVec3::new(0.5, 0.5, 5.0)), DVec3::ZERO)),
        ("sheared, negative, at 1e6 mm", grid([34, 30, 22], shear, DVec3::new(1e6, -1e6, 1e6))),
    ];
    let size = [112, 96];
    let mut bench = bench();
    for (name, grid) in cases {
        let plain = ragged(&grid);
        // Every third vector is marked: marks of neighbours differ, those of the filter's pixels stay.
        let marks = (0..plain.change().vectors.len()).map(|n| n % 3 == 0).collect();
        let mut s = scene(Arc::new(plain.with_displaced(marks)));
        s.look.smooth_mm = 1.5;
        for (azimuth, projection) in [
            (35.0, Projection::Perspective),
            (0.0, Projection::Orthographic),
            (-120.0, Projection::Perspective),
        ] {
            s.camera.projection = projection;
            s.camera.world_from_camera = Camera::orientation(azimuth, azimuth / 3.0);
            let found = draw(&mut bench, &s, size);
            let (mut checked, mut delicate, mut moved, mut marked) = (0, 0, 0, 0);
            for (twin, found) in twin::heights(&s, size).iter().zip(&found.heights) {
                match twin {
                    None => delicate += 1,
                    Some(None) => assert_eq!(*found, [0.0, -1.0], "{name}"),
                    Some(Some((mm, sure))) => {
                        assert_eq!(*found, [*mm as f32, *sure as f32], "{name}");
                        checked += 1;
                        moved += usize::from(*mm != 0.0);
                        marked += usize::from(*sure > 2.0);
                    }
                }
            }
            assert!(checked > 500 && moved > 200, "{name}: {checked} {moved}");
            assert!(marked > 50 && moved > marked + 50, "{name}: {marked} of {moved} marked");
            assert!(delicate * 20 <= found.heights.len(), "{name}: {delicate}");
            let mut worst = 0.0_f64;
            let twin = twin::filtered(&s, size, &found.depths, &found.heights);
            for (twin, found) in twin.iter().zip(&found.filtered) {
                worst = worst.max((twin[0] - f64::from(found[0])).abs());
                worst = worst.max((twin[1] - f64::from(found[1])).abs());
            }
            println!(
                "{name} {azimuth}: {checked} heights, {moved} moved, {delicate} delicate, filter off by {worst:.1e}"
            );
            assert!(worst < 1e-4, "{name}: {worst}");
        }
    }
}

/// A ball that grew by 3 mm: where the tissue moved too, its colour is that of displacement, on the surface in stripes; without marks,
/// or with none that is true, not a pixel differs.
#[test]
fn what_the_tissue_explains_has_a_colour_of_its_own() {
    let grid = cubic(34);
    let plain = surface(&grid, ball(grid.center_mm(), 9.0), ball(grid.center_mm(), 12.0));
    let count = plain.change().vectors.len();
    let east = |n: usize| plain.change().vectors[n].from_mm.x > grid.center_mm().x;
    let marked = |marks: Vec<bool>| Arc::new(plain.with_displaced(marks));
    let mut bench = bench();
    for style in [ChangeStyle::Height, ChangeStyle::Arrows] {
        let mut s = scene(Arc::clone(&plain));
        s.look.style = style;
        s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
        let mut picture = |surface: Arc<ChangeSurface>| {
            s.surface = Some(surface);
            draw(&mut bench, &s, [160, 160]).rgba
        };
        // Growth has most red and least blue, displacement most blue.
        let tones = |rgba: &[u8]| {
            let mut seen = [0_usize; 2];
            for pixel in rgba.as_chunks::<4>().0 {
                let [r, _, b, _] = pixel.map(i32::from);
                seen[0] += usize::from(r > b + 40);
                seen[1] += usize::from(b > r + 20);
            }
            seen
        };
        let none = picture(Arc::clone(&plain));
        assert_eq!(picture(marked(vec![false; count])), none, "{style:?}");
        let half = tones(&picture(marked((0..count).map(east).collect())));
        let all = tones(&picture(marked(vec![true; count])));
        let none = tones(&none);
        println!("{style:?}: growth and displacement, without marks {none:?}, half {half:?}, all {all:?}");
        assert!(none[0] > 500 && none[1] == 0, "{style:?}: {none:?}");
        // On the surface in stripes with the colour of growth, on arrows alone.
        let is_striped = style == ChangeStyle::Height;
        assert!(all[1] > 500 && (all[0] > 0) == is_striped && 2 * all[0] < none[0], "{style:?}: {all:?}");
        assert!(half[0] > all[0] + none[0] / 5 && 3 * half[1] > all[1], "{style:?}: {half:?}");
    }
}

/// Concentric balls, 3 mm apart.
#[test]
fn growth_is_red_all_over_and_recession_green() {
    let grid = cubic(34);
    let center = DVec3::splat(16.0);
    let mut bench = bench();
    for (radii, sign) in [([8.0, 11.0], 1), ([11.0, 8.0], -1)] {
        let mut s = scene(surface(&grid, ball(center, radii[0]), ball(center, radii[1])));
        s.look.full_mm = 2.0;
        for smooth_mm in [0.0, 2.0] {
            s.look.smooth_mm = smooth_mm;
            let found = draw(&mut bench, &s, [96, 96]);
            let hits: Vec<usize> = (0..found.depths.len()).filter(|&i| found.depths[i] < FAR).collect();
            assert!(hits.len() > 1500);
            let red = redness(&found);
            // Black silhouettes have no colour; grey lines leave some.
            let tinted = hits.iter().filter(|&&i| red[i] * sign > 40).count();
            assert!(tinted * 20 > hits.len() * 17, "{tinted} of {}", hits.len());
            assert!(hits.iter().all(|&i| red[i] * sign >= 0));
            let shown = if smooth_mm > 0.0 { &found.filtered } else { &found.heights };
            assert!(hits.iter().all(|&i| (shown[i][0] * sign as f32 - 3.0).abs() < 1.8));
        }
    }
}

#[test]
fn growth_on_one_side_is_red_on_that_side_only() {
    let grid = cubic(40);
    let center = DVec3::splat(19.0);
    let before = ball(center, 9.0);
    let mut s = scene(surface(&grid, ball(center, 9.0), move |v| {
        before(v) || (v.x > center.x + 3.0 && v.distance(center) <= 13.0)
    }));
    s.look.full_mm = 3.0;
    let mut bench = bench();
    let found = draw(&mut bench, &s, [96, 96]);
    let red = redness(&found);
    let (mut left, mut right) = (0, 0);
    for i in (0..red.len()).filter(|&i| found.depths[i] < FAR) {
        let x = s.surface.as_ref().unwrap().voxel(found.cells[i] as usize)[0];
        if x <= 22 {
            assert!(red[i] < 16, "{x}: {}", red[i]);
            left += 1;
        } else if red[i] > 60 {
            right += 1;
        }
    }
    assert!(left > 500 && right > 250, "{left} {right}");
}

/// A small ball that grew, in front of a large one that shrank.
#[test]
fn the_filter_does_not_leak_across_silhouettes() {
    let grid = grid([44, 60, 44], DMat3::IDENTITY, DVec3::ZERO);
    let (near, far) = (DVec3::new(22.0, 50.0, 22.0), DVec3::new(22.0, 20.0, 22.0));
    let mut s = scene(surface(
        &grid,
        move |v| ball(near, 4.0)(v) || ball(far, 18.0)(v),
        move |v| ball(near, 7.0)(v) || ball(far, 14.0)(v),
    ));
    s.look = ChangeLook { smooth_mm: 4.0, full_mm: 2.0, ..s.look };
    // From the front.
    s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    let mut bench = bench();
    let (mut of_near, mut of_far) = (0, 0);
    let found = draw(&mut bench, &s, [128, 128]);
    let red = redness(&found);
    for i in (0..red.len()).filter(|&i| found.depths[i] < FAR) {
        let y = s.surface.as_ref().unwrap().voxel(found.cells[i] as usize)[1];
        if y > 41 {
            assert!(found.filtered[i][0] > 1.5 && red[i] >= 0, "{:?}", found.filtered[i]);
            of_near += 1;
        } else {
            assert!(found.filtered[i][0] < -1.5 && red[i] <= 0, "{:?}", found.filtered[i]);
            of_far += 1;
        }
    }
    assert!(of_near > 300 && of_far > 1000, "{of_near} {of_far}");
    // Both are side by side in the frame: without the depth test they would mix.
    let side_by_side = found.cells.windows(2).zip(found.depths.windows(2)).any(|(c, d)| {
        let y = |c: u32| s.surface.as_ref().unwrap().voxel(c as usize)[1];
        d[0] < FAR && d[1] < FAR && (y(c[0]) > 41) != (y(c[1]) > 41)
    });
    assert!(side_by_side);
}

#[test]
fn a_component_without_a_partner_is_hatched_and_picked_as_such() {
    let grid = cubic(34);
    let unchanged = ball(DVec3::new(8.0, 16.0, 16.0), 6.0);
    let mut bench = bench();
    for appears in [true, false] {
        let other = ball(DVec3::new(25.0, 16.0, 16.0), 7.0);
        let mut s = scene(surface(
            &grid,
            |v| unchanged(v) || (!appears && other(v)),
            |v| unchanged(v) || (appears && other(v)),
        ));
        s.camera.world_from_camera = Camera::orientation(0.0, 0.0);
        for style in [ChangeStyle::Height, ChangeStyle::Arrows] {
            s.look.style = style;
            let Bench { gpu, renderer } = &mut *bench;
            let frame = renderer.render(gpu, &s, &FLAT, [96, 96]).unwrap().clone();
            let at = s.camera.project(DVec3::new(25.0, 20.0, 16.0), DVec2::splat(96.0)).unwrap();
            let pick = frame.pick(gpu, at.x as u32, at.y as u32).unwrap().unwrap();
            assert_eq!((pick.unpartnered, pick.vector), (Some(appears), None));
            let found = read(gpu, &frame);
            let red = redness(&found);
            let sign = if appears { 1 } else { -1 };
            let alone = s.surface.as_ref().unwrap().volume().bits_of_id().iter().position(|b| b & ALONE != 0);
            let hatched: Vec<usize> =
                (0..red.len()).filter(|&i| found.surfaces[i][0] as usize == alone.unwrap()).collect();
            let strong = hatched.iter().filter(|&&i| red[i] * sign > 70).count();
            let weak = hatched.iter().filter(|&&i| red[i] * sign < 50).count();
            assert!(strong * 5 > hatched.len() && weak * 5 > hatched.len(), "{strong} {weak}");
            // The unchanged ball has no colour.
            for i in (0..red.len()).filter(|&i| found.depths[i] < FAR) {
                assert!(found.surfaces[i][0] as usize == alone.unwrap() || red[i].abs() < 16);
            }
        }
    }
}

#[test]
fn changes_within_the_uncertainty_are_faint() {
    let grid = cubic(24);
    let center = DVec3::splat(11.0);
    let masks = [mask(&grid, ball(center, 6.0)), mask(&grid, ball(center, 9.0))];
    let mut found = changed(&grid, [&masks[0], &masks[1]]);
    let mut colors = Vec::new();
    let mut bench = bench();
    for faint in [false, true] {
        for v in &mut found.vectors {
            v.flags.within_uncertainty = faint;
        }
        let made = ChangeSurface::new(&masks[0], &masks[1], &grid, Arc::new(found.clone()));
        let mut s = scene(Arc::new(made.unwrap()));
        s.look.full_mm = 2.0;
        let red = redness(&draw(&mut bench, &s, [64, 64]));
        colors.push(red[32 * 64 + 32]);
    }
    assert!(colors[0] > 100 && colors[1] > 20 && colors[1] < colors[0] / 2, "{colors:?}");
}

#[test]
fn one_arrow_per_vector_above_the_threshold() {
    let mut s = scene(ragged(&cubic(36)));
    s.look.style = ChangeStyle::Arrows;
    let lengths: Vec<f64> =
        s.surface.as_ref().unwrap().change().vectors.iter().map(|v| v.signed_mm.abs()).collect();
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut counts = Vec::new();
    for threshold_mm in [0.0, 1.5, 2.0, 3.5] {
        s.look.threshold_mm = threshold_mm;
        let frame = renderer.render(gpu, &s, &FLAT, [64, 64]).unwrap();
        assert_eq!(frame.arrow_count(), lengths.iter().filter(|&&mm| mm >= threshold_mm).count());
        let bytes = frame.arrow_count() * size_of::<GpuArrow>();
        assert_eq!(renderer.view.arrows.as_ref().unwrap().instances.size(), bytes as u64);
        counts.push(renderer.frame().unwrap().arrow_count());
    }
    assert!(counts.windows(2).all(|c| c[0] > c[1]) && counts[3] > 0, "{counts:?}");
    // The instances on the device are reused.
    let cached = renderer.view.arrows.as_ref().unwrap().instances.clone();
    s.camera.height_mm *= 0.9;
    renderer.render(gpu, &s, &FLAT, [64, 64]).unwrap();
    assert_eq!(renderer.view.arrows.as_ref().unwrap().instances, cached);
    s.look.style = ChangeStyle::Height;
    assert_eq!(renderer.render(gpu, &s, &FLAT, [64, 64]).unwrap().arrow_count(), 0);
    assert!(renderer.view.arrows.is_none());
    s.look = ChangeLook { style: ChangeStyle::Arrows, threshold_mm: 1e4, ..s.look };
    let frame = renderer.render(gpu, &s, &FLAT, [64, 64]).unwrap();
    assert!(frame.plan.omitted.contains(&(ARROWS, "every arrow is shorter than the threshold")));
    assert!(renderer.view.arrows.is_none());
}

/// The change between two masks with one vector left.
fn single(grid: &Grid, masks: [&MaskBits; 2], which: impl Fn(&Change) -> usize) -> Arc<ChangeSurface> {
    let mut found = changed(grid, masks);
    let vector = found.vectors[which(&found)];
    found.vectors = vec![vector];
    Arc::new(ChangeSurface::new(masks[0], masks[1], grid, Arc::new(found)).unwrap())
}

fn longest_up(change: &Change) -> usize {
    let up = |i: &usize| {
        let v = &change.vectors[*i];
        ((v.to_mm - v.from_mm).normalize_or_zero().z - 10.0 * f64::from(v.signed_mm.abs() < 2.5)) * 1e6
    };
    (0..change.vectors.len()).max_by(|a, b| up(a).total_cmp(&up(b))).unwrap()
}

#[test]
fn a_known_arrow_is_picked_with_its_unfiltered_length() {
    let grid = cubic(34);
    let center = DVec3::splat(16.0);
    let mut bench = bench();
    for radii in [[8.0, 12.0], [12.0, 8.0]] {
        let masks = [mask(&grid, ball(center, radii[0])), mask(&grid, ball(center, radii[1]))];
        let made = single(&grid, [&masks[0], &masks[1]], longest_up);
        let known = made.change().vectors[0];
        let mut s = scene(made);
        s.look = ChangeLook { style: ChangeStyle::Arrows, smooth_mm: 5.0, ..s.look };
        s.camera.height_mm *= 0.5;
        for (azimuth, projection) in [(0.0, Projection::Perspective), (70.0, Projection::Orthographic)] {
            s.camera.world_from_camera = Camera::orientation(azimuth, 0.0);
            s.camera.projection = projection;
            let Bench { gpu, renderer } = &mut *bench;
            let frame = renderer.render(gpu, &s, &FLAT, [160, 160]).unwrap().clone();
            for part in [0.25, 0.5, 0.75] {
                let on = known.from_mm + part * (known.to_mm - known.from_mm);
                let at = s.camera.project(on, DVec2::splat(160.0)).unwrap();
                let pick = frame.pick(gpu, at.x as u32, at.y as u32).unwrap().unwrap();
                assert_eq!(pick.vector, Some(known));
                assert_eq!((pick.voxel, pick.unpartnered), (known.voxel, None));
                let along = (known.to_mm - known.from_mm).normalize_or_zero();
                let off = pick.world_mm - known.from_mm;
                let aside = (off - off.dot(along) * along).length();
                assert!(aside < 0.75, "{aside} mm beside it");
                let projected = s.camera.project(pick.world_mm, DVec2::splat(160.0)).unwrap();
                assert!(projected.distance(at) < 1.0);
            }
            let rgba = frame.read_rgba(gpu).unwrap();
            let sign = if known.signed_mm > 0.0 { 1 } else { -1 };
            let tinted =
                rgba.chunks_exact(4).filter(|p| (i32::from(p[0]) - i32::from(p[1])) * sign > 70).count();
            assert!(tinted > 20, "{tinted} pixels of arrow");
            // The surface beside it is plain, and picked as unmoved.
            let at = s.camera.project(center, DVec2::splat(160.0)).unwrap();
            let pick = frame.pick(gpu, at.x as u32, at.y as u32).unwrap().unwrap();
            assert_eq!(pick.vector, None);
            assert_eq!(frame.pick(gpu, 0, 0).unwrap(), None);
            assert_eq!(frame.pick(gpu, 160, 3).unwrap(), None);
        }
    }
}

#[test]
fn the_height_map_picks_the_unfiltered_length() {
    let mut s = scene(ragged(&cubic(36)));
    s.look.smooth_mm = 6.0;
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let frame = renderer.render(gpu, &s, &FLAT, [80, 80]).unwrap().clone();
    let found = read(gpu, &frame);
    let (mut vectors, mut partnerless) = (0, 0);
    for y in (0..80).step_by(2) {
        for x in (0..80).step_by(2) {
            let at = (y * 80 + x) as usize;
            let Some(pick) = frame.pick(gpu, x, y).unwrap() else {
                assert!(found.depths[at] >= FAR);
                continue;
            };
            let moved = pick.vector.map_or(0.0, |v| v.signed_mm as f32);
            assert_eq!(found.heights[at][0], moved);
            assert_eq!(found.heights[at][1] < 0.0, pick.unpartnered.is_some());
            assert!(pick.vector.is_none_or(|v| v.voxel == pick.voxel));
            vectors += usize::from(pick.vector.is_some());
            partnerless += usize::from(pick.unpartnered.is_some());
        }
    }
    assert!(vectors > 50 && partnerless > 0, "{vectors} {partnerless}");
}

/// An arrow a twentieth of a pixel wide, 1e6 mm from the origin of the world.
#[test]
fn a_thin_arrow_far_from_the_origin_has_no_gaps() {
    let grid = grid([140, 7, 7], DMat3::IDENTITY, DVec3::new(1e6, -1e6, 1e6));
    let rod = |end: f64| {
        move |v: DVec3| v.x >= 2.0 && v.x <= end && (v.y - 3.0).abs() <= 1.0 && (v.z - 3.0).abs() <= 1.0
    };
    let masks = [mask(&grid, rod(40.0)), mask(&grid, rod(136.0))];
    let longest = |c: &Change| {
        let mm = |i: &usize| c.vectors[*i].signed_mm;
        (0..c.vectors.len()).max_by(|a, b| mm(a).total_cmp(&mm(b))).unwrap()
    };
    let made = single(&grid, [&masks[0], &masks[1]], longest);
    let known = made.change().vectors[0];
    assert!(known.signed_mm > 60.0, "{}", known.signed_mm);
    let mut s = scene(made);
    s.look.style = ChangeStyle::Arrows;
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    for projection in [Projection::Perspective, Projection::Orthographic] {
        for azimuth in [0.0, 23.0] {
            s.camera = Camera {
                projection,
                height_mm: 400.0,
                world_from_camera: Camera::orientation(azimuth, 11.0),
                ..s.camera
            };
            let frame = renderer.render(gpu, &s, &FLAT, [128, 128]).unwrap().clone();
            let [a, b] =
                [known.from_mm, known.to_mm].map(|p| s.camera.project(p, DVec2::splat(128.0)).unwrap());
            let steps = (a.distance(b) * 0.9) as usize;
            assert!(steps > 12, "{steps}");
            for n in 1..steps {
                let at = a.lerp(b, n as f64 / steps as f64);
                // Its shaft starts inside the opaque part.
                let pick = frame.pick(gpu, at.x as u32, at.y as u32).unwrap();
                if n > 1 {
                    assert_eq!(pick.and_then(|p| p.vector), Some(known), "{n} of {steps}");
                }
            }
        }
    }
}

#[test]
fn rendering_is_deterministic() {
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let mut other = ChangeRenderer::new(gpu).unwrap();
    let mut s = scene(ragged(&cubic(36)));
    s.look.threshold_mm = 0.0;
    let mut pictures = Vec::new();
    for style in [ChangeStyle::Height, ChangeStyle::Arrows] {
        s.look = ChangeLook { style, smooth_mm: 1.0, ..s.look };
        let first = renderer.render(gpu, &s, &Quality::FULL, [96, 80]).unwrap().read_rgba(gpu).unwrap();
        for _ in 0..2 {
            let again = renderer.render(gpu, &s, &Quality::FULL, [96, 80]).unwrap();
            assert!(again.read_rgba(gpu).unwrap() == first);
        }
        let elsewhere = other.render(gpu, &s, &Quality::FULL, [96, 80]).unwrap();
        assert!(elsewhere.read_rgba(gpu).unwrap() == first);
        pictures.push(first);
    }
    assert!(pictures[0] != pictures[1]);
}

/// With parallel rays the outline of a ball is a circle of its radius, whichever of the two dates is the larger; and it is
/// drawn over what hides the ball.
#[test]
fn the_outline_of_the_earlier_date_is_where_its_silhouette_is() {
    let grid = cubic(34);
    let center = DVec3::splat(16.0);
    let mut bench = bench();
    let size = [200, 160];
    for (radii, style) in [
        ([7.0, 12.0], ChangeStyle::Height),
        ([12.0, 7.0], ChangeStyle::Height),
        ([7.0, 12.0], ChangeStyle::Arrows),
    ] {
        let mut s = scene(surface(&grid, ball(center, radii[0]), ball(center, radii[1])));
        s.camera.projection = Projection::Orthographic;
        s.camera.focus_mm = center;
        s.look.style = style;
        let is_blue = |p: &[u8]| i32::from(p[2]) - i32::from(p[0]) > 90;
        let off = draw(&mut bench, &s, size);
        assert!(!off.rgba.chunks_exact(4).any(is_blue), "{style:?}");
        s.look.outlines_earlier = true;
        let on = draw(&mut bench, &s, size);
        let px_per_mm = f64::from(size[1]) / s.camera.height_mm;
        let mut sectors = [0; 24];
        for (i, _) in on.rgba.chunks_exact(4).enumerate().filter(|(_, p)| is_blue(p)) {
            let at = DVec2::new(
                (i % size[0] as usize) as f64 + 0.5 - 100.0,
                (i / size[0] as usize) as f64 + 0.5 - 80.0,
            );
            // Voxels reach up to half their diagonal beyond their centres, a line a pixel or two to both sides.
            let away_mm = at.length() / px_per_mm - radii[0];
            assert!(
                (-0.9 - 2.0 / px_per_mm..0.9 + 2.0 / px_per_mm).contains(&away_mm),
                "{style:?}: {away_mm}"
            );
            sectors[((at.y.atan2(at.x) / std::f64::consts::TAU + 0.5) * 24.0) as usize % 24] += 1;
        }
        assert!(sectors.iter().all(|n| *n > 3), "{style:?}: {sectors:?}");
        // Nothing else differs.
        let elsewhere = off.rgba.chunks_exact(4).zip(on.rgba.chunks_exact(4)).filter(|(a, b)| a != b);
        let bluer =
            |(a, b): &(&[u8], &[u8])| i32::from(b[2]) - i32::from(b[0]) > i32::from(a[2]) - i32::from(a[0]);
        assert!(elsewhere.clone().count() > 100 && elsewhere.clone().all(|pair| bluer(&pair)), "{style:?}");
    }
    let empty = scene(surface(&grid, |_| false, ball(center, 7.0)));
    let empty = ChangeScene { look: ChangeLook { outlines_earlier: true, ..empty.look }, ..empty };
    assert_eq!(change_plan(&empty, &FLAT).reason(EARLIER), Some("the earlier mask is empty"));
}
