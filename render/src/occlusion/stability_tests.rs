//! Rows of the stability table that every occlusion backend must stand: slices in all variants and both
//! forms, cones at all levels, and the closeup's ambient occlusion. The table's other rows: the slices'
//! own tests.

use std::sync::{Arc, Mutex};

use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{Grid, Sides};

use super::{Filter, OpticalVolume, Plane, Table};
use crate::{
    camera::{Camera, Projection},
    cones::{ConeRenderer, ConeSettings},
    dos::{
        DosRenderer, DosSettings, Form, Variant,
        tests::{GPU, camera, labels, soft},
    },
    reference::monte_carlo::{Phase, picture},
};

const SIZE: [u32; 2] = [12, 12];

/// A picture by each backend, by name. Every value is a number; nothing is brighter than what is opaque,
/// as all colours are at most 1 and the light is 1.
fn pictures(
    name: &str,
    volume: &Arc<OpticalVolume>,
    camera: &Camera,
    slice_mm: f64,
) -> Vec<(String, Vec<[f32; 4]>)> {
    static RENDERERS: Mutex<Option<(DosRenderer, ConeRenderer)>> = Mutex::new(None);
    let mut guard = RENDERERS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let (slices, cones) =
        guard.get_or_insert_with(|| (DosRenderer::new(&GPU).unwrap(), ConeRenderer::new(&GPU).unwrap()));
    let mut out = Vec::new();
    for variant in [Variant::PaperExact, Variant::PaperApproximate, Variant::Mended] {
        let s = DosSettings { variant, slice_mm, ..DosSettings::default() };
        // The mended variant has no second pass.
        let two = Form::TwoPasses { folded: true };
        let forms: &[Form] = if variant == Variant::Mended {
            &[Form::OnePass, Form::Tiles(4)]
        } else {
            &[Form::OnePass, Form::Tiles(4), two]
        };
        for form in forms {
            slices.render(&GPU, volume, camera, SIZE, &s, *form, true).unwrap();
            out.push((format!("{variant:?} {form:?}"), slices.read(&GPU).unwrap()));
        }
    }
    for coarsest_level in [0, 1, 8] {
        let s = ConeSettings { coarsest_level, ..ConeSettings::default() };
        cones.render(&GPU, volume, camera, SIZE, &s, true).unwrap();
        out.push((format!("cones to {coarsest_level}"), cones.read(&GPU).unwrap()));
    }
    for (backend, picture) in &out {
        assert_eq!(picture.len(), 144);
        for p in picture {
            let sane = p.iter().all(|v| v.is_finite() && (0.0..=1.000_01).contains(v));
            let lit = p[..3].iter().all(|c| *c <= 1.0 - p[3] + 1e-5);
            assert!(sane && lit, "{name}, {backend}: {p:?}");
        }
    }
    out
}

fn covered(picture: &[[f32; 4]]) -> f64 {
    picture.iter().map(|p| 1.0 - f64::from(p[3])).sum::<f64>() / picture.len() as f64
}

fn far_apart(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Whose eye is at a place.
fn eye_at(at: DVec3, towards: DVec3, height_mm: f64, projection: Projection) -> Camera {
    let back = -towards / towards.length();
    let world_from_camera = glam::DQuat::from_rotation_arc(DVec3::Z, back);
    let c = Camera { focus_mm: at, world_from_camera, height_mm, projection };
    Camera { focus_mm: at - back * c.distance_mm(), ..c }
}

fn on(grid: Grid, table: &Table, filter: Filter, value: impl Fn(usize) -> f32) -> OpticalVolume {
    let values = (0..grid.voxel_count()).map(value).collect();
    OpticalVolume::new(grid, values, table.clone(), filter, None).unwrap()
}

fn box_grid(dims: [usize; 3], spacing: DVec3) -> Grid {
    let [x, y, z] = dims.map(|d| (d as f64 - 1.0) / 2.0);
    Grid::axis_aligned(dims, spacing, -DVec3::new(x, y, z) * spacing).unwrap()
}

fn gray(extinction: f32) -> Table {
    Table::of_labels(&[[0.0; 4], [1.0, 1.0, 1.0, extinction]]).unwrap()
}

#[test]
fn every_backend_stands_the_table() {
    let n = 16;
    let base = camera(DVec3::ZERO, 10.0, Projection::Perspective);
    let one = DVec3::ONE;
    let soft = || soft(n, DVec3::ZERO, None);
    let of = |extinction| labels(n, one, DVec3::ZERO, extinction);
    let (persp, ortho) = (Projection::Perspective, Projection::Orthographic);
    let cube = |value: fn(usize) -> f32| on(box_grid([n; 3], one), soft().table(), Filter::Linear, value);
    let solid = |dims, e| on(box_grid(dims, one), &gray(e), Filter::Nearest, |_| 1.0);
    let mixed =
        Table::new(0.0, 2.0, &[[1.0, 0.5, 0.2, 0.0], [0.2, 0.5, 1.0, f32::INFINITY], [0.3, 1.0, 0.4, 1e6]]);
    let turned = DMat3::from_rotation_z(0.4) * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let mirrored = Grid::new(
        [n; 3],
        DAffine3 { matrix3: turned, translation: turned * DVec3::splat(-7.5) },
        Sides::Known,
    );
    // Whether something must be seen.
    let rows: Vec<(&str, OpticalVolume, Camera, f64, bool)> = vec![
        ("near plane through the middle", soft(), eye_at(DVec3::ZERO, -DVec3::Z, 20.0, ortho), 1.0, true),
        ("near plane aslant", soft(), eye_at(one * 1.3, -one, 20.0, ortho), 1.0, true),
        (
            "near plane in something opaque",
            solid([n; 3], f32::INFINITY),
            eye_at(DVec3::ZERO, one, 20.0, ortho),
            1.0,
            true,
        ),
        ("near plane on a voxel's face", of(0.3), eye_at(DVec3::ZERO, DVec3::Z, 20.0, ortho), 1.0, true),
        (
            "eye in something opaque",
            solid([n; 3], f32::INFINITY),
            eye_at(one * 0.1, one, 20.0, persp),
            1.0,
            true,
        ),
        ("eye on a voxel's corner", of(0.3), eye_at(DVec3::ZERO, -DVec3::Z, 20.0, persp), 1.0, true),
        (
            "eye on an edge of the box",
            of(0.3),
            eye_at(DVec3::new(8.0, 8.0, 0.0), DVec3::new(-1.0, -1.0, 0.0), 20.0, persp),
            1.0,
            true,
        ),
        ("eye along an axis", of(0.3), eye_at(DVec3::new(0.0, -40.0, 0.0), DVec3::Y, 20.0, persp), 1.0, true),
        ("every value NaN", cube(|_| f32::NAN), base, 1.0, false),
        ("every value infinite", cube(|_| f32::INFINITY), base, 1.0, false),
        (
            "largest and least numbers",
            cube(|i| if i % 2 == 0 { f32::MAX } else { f32::MIN }),
            base,
            1.0,
            true,
        ),
        (
            "infinite beside finite",
            cube(|i| [0.5, f32::INFINITY, f32::NEG_INFINITY, f32::NAN][i % 4]),
            base,
            1.0,
            true,
        ),
        (
            "extinctions 0, infinite and 1e6",
            on(box_grid([n; 3], one), &mixed.unwrap(), Filter::Linear, |i| (i % 3) as f32),
            base,
            1.0,
            true,
        ),
        ("one voxel", solid([1; 3], 1.0), camera(DVec3::ZERO, 1.0, persp), 0.1, true),
        ("one opaque voxel", solid([1; 3], f32::INFINITY), camera(DVec3::ZERO, 1.0, persp), 0.1, true),
        ("a line", solid([n, 1, 1], 1.0), base, 1.0, true),
        (
            "a plane, edge on",
            solid([n, n, 1], 1.0),
            eye_at(DVec3::new(0.0, -12.0, 0.0), DVec3::Y, 20.0, persp),
            0.2,
            true,
        ),
        (
            "intensities 1:12",
            on(box_grid([n; 3], DVec3::new(0.5, 0.5, 6.0)), soft().table(), Filter::Linear, |i| {
                (i % 5) as f32 * 0.2
            }),
            camera(DVec3::ZERO, 40.0, persp),
            2.0,
            true,
        ),
        (
            "labels 12:1",
            labels(n, DVec3::new(6.0, 0.5, 0.5), DVec3::ZERO, 0.3),
            camera(DVec3::ZERO, 40.0, ortho),
            2.0,
            true,
        ),
        (
            "a mirrored grid",
            on(mirrored.unwrap(), soft().table(), Filter::Linear, |i| (i % 5) as f32 * 0.2),
            base,
            1.0,
            true,
        ),
        ("slices thicker than the box", of(0.3), base, 1e9, true),
    ];
    for (name, volume, camera, slice_mm, seen) in rows {
        let all = pictures(name, &Arc::new(volume), &camera, slice_mm);
        let shown: Vec<f64> = all.iter().map(|(_, p)| covered(p)).collect();
        println!("{name}: covered {shown:.3?}");
        assert!(shown.iter().all(|c| (*c > 1e-3) == seen), "{name}: {shown:?}");
        let [least, most] = [f64::min, f64::max].map(|f| shown.iter().copied().reduce(f).unwrap());
        assert!(most - least < 0.1, "{name}: every backend sees about as much: {shown:?}");
    }
}

/// A grid 1e6 mm away, along and across the view: the picture of the one at hand.
#[test]
fn far_grids_are_seen_as_near_ones() {
    let far = DVec3::new(1e6, -1e6, 1e6);
    for (name, make) in [
        ("soft", &(|o| soft(16, o, None)) as &dyn Fn(DVec3) -> OpticalVolume),
        ("labels", &|o| labels(16, DVec3::new(0.5, 0.5, 6.0), o, 0.3)),
    ] {
        let at =
            |o: DVec3| pictures(name, &Arc::new(make(o)), &camera(o, 20.0, Projection::Perspective), 1.0);
        for ((backend, here), (_, there)) in at(DVec3::ZERO).iter().zip(&at(far)) {
            let worst = far_apart(here, there);
            assert!(covered(here) > 0.01 && worst < 1e-3, "{name} {backend}: {worst}");
        }
    }
}

/// Two masks with one surface: two labels of the same optics, changing from voxel to voxel, are one.
/// A mask that coincides with a clipping plane, and a plane on the box's face, which cuts nothing.
#[test]
fn coincident_surfaces() {
    let c = camera(DVec3::ZERO, 10.0, Projection::Perspective);
    for extinction in [0.3, f32::INFINITY] {
        let one_row = [0.8, 0.5, 0.2, extinction];
        let table = Table::of_labels(&[[0.0; 4], one_row, one_row]).unwrap();
        let inside = |l: usize| {
            let at = DVec3::from_array([l % 16, l / 16 % 16, l / 256].map(|v| v as f64 - 7.5));
            at.length() < 6.0
        };
        let make = |second: bool, plane: Option<Plane>| {
            let label = |l: usize| match (inside(l), second && l.is_multiple_of(2)) {
                (false, _) => 0.0,
                (true, false) => 1.0,
                (true, true) => 2.0,
            };
            let values = (0..16 * 16 * 16).map(label).collect();
            let grid = box_grid([16; 3], DVec3::ONE);
            Arc::new(OpticalVolume::new(grid, values, table.clone(), Filter::Nearest, plane).unwrap())
        };
        let same = |what: &str, a: Vec<(String, Vec<[f32; 4]>)>, b: Vec<(String, Vec<[f32; 4]>)>, by: f32| {
            for ((backend, a), (_, b)) in a.iter().zip(&b) {
                let worst = far_apart(a, b);
                assert!(covered(a) > 0.05 && worst <= by, "{what}, {extinction}, {backend}: {worst}");
            }
        };
        let plain = || pictures("one label", &make(false, None), &c, 1.0);
        same("two labels", plain(), pictures("two labels", &make(true, None), &c, 1.0), 1e-6);
        // The box's face towards +z; all of the ball lies before it.
        let face = Plane { normal: DVec3::Z, offset_mm: 8.0 };
        same("plane on the face", plain(), pictures("face", &make(false, Some(face)), &c, 1.0), 1e-6);
        // On faces of voxels: the picture of the half that is left.
        let middle = Plane { normal: DVec3::Z, offset_mm: 0.0 };
        let half = {
            let values = (0..4096).map(|l| f32::from(u8::from(inside(l) && l / 256 < 8))).collect();
            let grid = box_grid([16; 3], DVec3::ONE);
            Arc::new(OpticalVolume::new(grid, values, table.clone(), Filter::Nearest, None).unwrap())
        };
        let cut = pictures("cut on faces", &make(false, Some(middle)), &c, 1.0);
        for ((backend, a), (_, b)) in cut.iter().zip(&pictures("half", &half, &c, 1.0)) {
            // The plane may fall to either side of the faces that it lies in: never both, never torn.
            let worst = far_apart(a, b);
            println!("{extinction} {backend}: cut against half {worst:.4}");
            assert!((covered(a) - covered(b)).abs() < 0.01, "{backend}: {} {}", covered(a), covered(b));
        }
    }
    // Two bodies side by side whose faces lie at one depth, on a slice's front: each as dark as alone.
    let sight = eye_at(DVec3::Z * 20.0, -DVec3::Z, 12.0, Projection::Orthographic);
    let rows = [[0.0; 4], [1.0, 0.0, 0.0, 0.4], [0.0, 1.0, 0.0, 0.4]];
    let slab = |label: fn(usize) -> f32| {
        let grid = box_grid([32, 32, 6], DVec3::ONE);
        Arc::new(on(grid, &Table::of_labels(&rows).unwrap(), Filter::Nearest, label))
    };
    let two = pictures("two bodies", &slab(|l| if l % 32 < 16 { 1.0 } else { 2.0 }), &sight, 1.0);
    let alone = pictures("one body", &slab(|_| 1.0), &sight, 1.0);
    for ((backend, two), (_, alone)) in two.iter().zip(&alone) {
        for (a, b) in two.iter().zip(alone) {
            // The same extinction everywhere: all occlusion is that of one slab.
            let off = (a[0] + a[1] - b[0]).abs().max((a[3] - b[3]).abs());
            assert!(off < 1e-5, "{backend}: {a:?} {b:?}");
        }
    }
}

/// An eye plane within the medium, for slices: a clipping plane; what is before it neither shows nor
/// hides. For cones, as for equation 7 and its Monte Carlo: it doesn't show, but it hides, as the light
/// comes from behind the eye.
#[test]
fn what_is_before_the_near_plane() {
    let cut = Plane { normal: DVec3::Z, offset_mm: 1.5 };
    let near = eye_at(DVec3::Z * 1.5, -DVec3::Z, 18.0, Projection::Orthographic);
    let outside = eye_at(DVec3::Z * 31.5, -DVec3::Z, 18.0, Projection::Orthographic);
    let whole = Arc::new(soft(16, DVec3::ZERO, None));
    let found = pictures("near plane", &whole, &near, 0.25);
    let expected = pictures("clipped", &Arc::new(soft(16, DVec3::ZERO, Some(cut))), &outside, 0.25);
    let phase = Phase::Cone { aperture_deg: ConeSettings::default().aperture_deg };
    let truth = picture(&*whole, &near, SIZE, phase, DVec3::ZERO, 512, 7);
    for ((backend, a), (_, b)) in found.iter().zip(&expected) {
        assert!(covered(a) > 0.05, "{backend}");
        if backend.starts_with("cones") {
            let errors = a.iter().zip(&truth).flat_map(|(a, t)| (0..3).map(|c| f64::from(a[c]) - t.mean[c]));
            let rms = (errors.map(|e| e * e).sum::<f64>() / 432.0).sqrt();
            let apart = far_apart(a, b);
            println!("{backend}: {rms:.5} from Monte Carlo, {apart:.3} from the clipped picture");
            assert!(rms < 0.02 && apart > 0.05, "{backend}: {rms} {apart}");
        } else {
            let worst = far_apart(a, b);
            assert!(worst < 1e-3, "{backend}: {worst}");
        }
    }
}
