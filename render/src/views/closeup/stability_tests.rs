//! Extreme scenes for the closeup's ambient occlusion. Its values are stored in 8
//! bits and so always lie in 0 to 1: the tests check that each row gives the expected frame.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use glioscope_core::{
    Grid,
    optics::{Camera, Projection},
};

use crate::{
    CloseupRenderer,
    device::Gpu,
    scene::{Quality, RegionScene, SlicePlane},
    testing::{GPU, scene_of, volume},
};

const SIZE: [u32; 2] = [96, 96];

struct Bench {
    gpu: Gpu,
    renderer: CloseupRenderer,
}

/// Per pixel: darkness, colour, and whether anything is hit.
struct Drawn {
    dark: Vec<f64>,
    rgba: Vec<u8>,
    hit: Vec<bool>,
}

impl Drawn {
    fn hits(&self) -> usize {
        self.hit.iter().filter(|h| **h).count()
    }

    fn mean(&self) -> f64 {
        let dark = self.dark.iter().zip(&self.hit).filter(|(_, h)| **h).map(|(d, _)| d);
        dark.sum::<f64>() / self.hits().max(1) as f64
    }
}

impl Bench {
    fn new() -> Self {
        let gpu = GPU.clone();
        let renderer = CloseupRenderer::new(&gpu).unwrap();
        Self { gpu, renderer }
    }

    fn draw(&mut self, scene: &RegionScene, quality: &Quality) -> Drawn {
        let frame = self.renderer.render(&self.gpu, scene, quality, SIZE).unwrap();
        let found = frame.occlusion(&self.gpu).unwrap();
        assert!(found.depths_mm.iter().all(|d| !d.is_nan()), "finite, or infinite on the background");
        let hit: Vec<bool> = found.depths_mm.iter().map(|d| d.is_finite()).collect();
        Drawn { dark: found.dark, rgba: frame.read_rgba(&self.gpu).unwrap(), hit }
    }
}

/// A floor with a block on it: corners between them are dark, the rest is not.
fn step(masks: usize, spacing: DVec3, origin: DVec3) -> RegionScene {
    let grid = Grid::axis_aligned([40, 30, 20], spacing, origin).unwrap();
    let inside = |_: usize, p: [usize; 3]| p[2] < 6 || (p[0] < 16 && p[2] < 14);
    let mut scene = scene_of(volume(&grid, masks, inside).unwrap(), masks, None);
    scene.camera.world_from_camera = Camera::orientation(15.0, 60.0);
    scene
}

fn eye_plane_at(scene: &RegionScene, at: DVec3, projection: Projection) -> RegionScene {
    let mut out = scene.clone();
    out.camera.projection = projection;
    out.camera.focus_mm = at - out.camera.axes()[2] * out.camera.distance_mm();
    out
}

#[test]
fn coincident_masks_occlude_like_one() {
    let mut bench = Bench::new();
    let one = bench.draw(&step(1, DVec3::ONE, DVec3::ZERO), &Quality::FULL);
    assert!(one.hits() > 1000 && one.mean() > 0.005, "{}", one.mean());
    for masks in [2, 5] {
        let more = bench.draw(&step(masks, DVec3::ONE, DVec3::ZERO), &Quality::FULL);
        assert_eq!(more.dark, one.dark, "{masks} masks on the same voxels");
    }
}

/// A slice exactly in the floor's face: each pixel shows it or doesn't, the same every time.
#[test]
fn a_slice_in_a_face_is_drawn_deterministically() {
    let mut bench = Bench::new();
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let mut scene = step(1, DVec3::ONE, DVec3::ZERO);
        scene.camera.projection = projection;
        let plain = bench.draw(&scene, &Quality::FULL);
        // Without occlusion the surface has one colour, except for lines.
        let flat = Quality { occlusion_strength: 0.0, relief: 0.0, ..Quality::FULL };
        let bare = bench.draw(&scene, &flat);
        let at = scene.camera.project(DVec3::new(8.0, 15.0, 13.5), DVec2::splat(96.0)).unwrap();
        let color = &bare.rgba[(at.y as usize * 96 + at.x as usize) * 4..][..4];
        // The floor's face is half a voxel above the centres of layer 5.
        scene.plane = Some(SlicePlane {
            rgba: Arc::new(vec![10, 110, 210, 255]),
            size_px: [1, 1],
            corner_mm: DVec3::new(-100.0, 100.0, 5.5),
            right_mm: DVec3::X * 240.0,
            down_mm: DVec3::Y * -240.0,
            opacity: 0.4,
        });
        assert_eq!(bench.draw(&scene, &Quality::FULL).dark, plain.dark, "a slice occludes no light");
        let with = bench.draw(&scene, &flat);
        assert!(with.rgba == bench.draw(&scene, &flat).rgba, "it doesn't flicker");
        let mut counts = [0, 0];
        for (a, b) in bare.rgba.chunks(4).zip(with.rgba.chunks(4)).filter(|(a, _)| *a == color) {
            let over = |c: usize| 0.4 * [10.0, 110.0, 210.0][c] + 0.6 * f64::from(a[c]);
            let blended = (0..3).all(|c| (f64::from(b[c]) - over(c)).abs() <= 1.01);
            assert!(a == b || blended, "{a:?} {b:?}");
            counts[usize::from(blended)] += 1;
        }
        println!("{projection:?}: without and with the slice {counts:?}");
        assert!(counts[0] > 100, "the block is in front of it");
    }
}

#[test]
fn distant_and_anisotropic_grids_are_dark_in_corners() {
    let mut bench = Bench::new();
    let here = bench.draw(&step(1, DVec3::ONE, DVec3::ZERO), &Quality::FULL);
    let there = bench.draw(&step(1, DVec3::ONE, DVec3::splat(1e6)), &Quality::FULL);
    let pairs = here.dark.iter().zip(&there.dark);
    let off = pairs.filter(|(a, b)| (*a - *b).abs() > 3.0 / 255.0).count();
    // Some rays along edges fall to the other side.
    assert!(off * 100 < here.dark.len() && here.hits().abs_diff(there.hits()) < 50, "{off}");
    // Slices twelve times as thick as pixels are wide, and the reverse.
    for spacing in [DVec3::new(0.5, 0.5, 6.0), DVec3::new(6.0, 0.5, 0.5), DVec3::new(0.5, 6.0, 0.5)] {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let mut scene = step(1, spacing, DVec3::ZERO);
            scene.camera.projection = projection;
            scene.camera.world_from_camera = Camera::orientation(0.0, 90.0);
            // A millimetre from the wall.
            let foot = DVec3::new(15.5 + 1.0 / spacing.x, 15.0, 5.5);
            scene.camera.focus_mm = foot * spacing;
            scene.camera.height_mm = 40.0;
            let d = bench.draw(&scene, &Quality::FULL);
            let at = |voxel: DVec3| {
                let pixel = scene.camera.project(voxel * spacing, DVec2::splat(96.0)).unwrap();
                d.dark[pixel.y as usize * 96 + pixel.x as usize]
            };
            // Seen from above.
            let (top, corner) = (at(DVec3::new(14.0, 15.0, 13.5)), at(foot));
            println!("{spacing} {projection:?}: top {top:.3}, corner {corner:.3}");
            assert!(top < 0.02 && corner > 0.03, "{spacing} {projection:?}: {top} {corner}");
        }
    }
}

/// Inside the object, the cut by the eye's plane is flat: nothing occludes it.
#[test]
fn near_plane_cuts_and_eyes_inside_are_unoccluded() {
    let mut bench = Bench::new();
    let scene = step(1, DVec3::ONE, DVec3::ZERO);
    let mut down = scene.clone();
    down.camera.world_from_camera = Camera::orientation(0.0, 90.0);
    // Through the block and above the floor, down onto it.
    let cut = bench
        .draw(&eye_plane_at(&down, DVec3::new(19.5, 14.5, 10.2), Projection::Orthographic), &Quality::FULL);
    let size = DVec2::splat(96.0);
    let camera = eye_plane_at(&down, DVec3::new(19.5, 14.5, 10.2), Projection::Orthographic).camera;
    let at = |mm: DVec3| {
        let pixel = camera.project(mm, size).unwrap();
        pixel.y as usize * 96 + pixel.x as usize
    };
    let (inside, corner, floor) =
        (at(DVec3::new(6.0, 15.0, 9.0)), at(DVec3::new(16.2, 15.0, 5.5)), at(DVec3::new(34.0, 15.0, 5.5)));
    assert!(cut.hit[inside] && cut.hit[floor]);
    assert!(cut.dark[inside] < 0.02 && cut.dark[floor] < 0.02, "{} {}", cut.dark[inside], cut.dark[floor]);
    assert!(cut.dark[corner] > 0.03, "{}", cut.dark[corner]);
    // An eye inside the object sees its own voxel in every pixel, at one depth.
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let within = bench.draw(&eye_plane_at(&down, DVec3::new(6.2, 15.1, 3.3), projection), &Quality::FULL);
        assert!(within.hit[48 * 96 + 48] && within.dark[48 * 96 + 48] < 0.02, "{projection:?}");
    }
    // At a face and along the diagonal of the box something is drawn.
    for at in [DVec3::new(19.5, 14.5, 19.5), DVec3::new(39.5, 29.5, 19.5)] {
        let mut s = scene.clone();
        s.camera.world_from_camera = glam::DQuat::from_rotation_arc(DVec3::Z, DVec3::ONE / 3f64.sqrt());
        let d = bench.draw(&eye_plane_at(&s, at, Projection::Perspective), &Quality::FULL);
        assert!(d.hits() > 500, "{}", d.hits());
    }
}

/// Settings out of range.
#[test]
fn radii_strengths_and_samples_out_of_range() {
    let mut bench = Bench::new();
    let scene = step(1, DVec3::ONE, DVec3::ZERO);
    let plain = bench.draw(&scene, &Quality { occlusion_strength: 0.0, ..Quality::FULL });
    let of = |radius: f64| Quality { occlusion_radius_mm: radius, ..Quality::FULL };
    for radius in [0.0, -1.0, f64::NAN] {
        assert!(bench.draw(&scene, &of(radius)).rgba == plain.rgba, "{radius}: as without");
    }
    let tiny = bench.draw(&scene, &of(1e-6));
    assert_eq!(tiny.mean(), 0.0, "nothing occludes within a nanometre");
    for radius in [1e6, 1e300, f64::INFINITY] {
        let d = bench.draw(&scene, &of(radius));
        assert!(d.mean() < 1.0 && d.hits() == plain.hits(), "{radius}: {}", d.mean());
        let black = d.rgba.chunks(4).zip(&d.hit).filter(|(p, h)| **h && p[..3] == [0; 3]).count();
        let lines = plain.rgba.chunks(4).zip(&plain.hit).filter(|(p, h)| **h && p[..3] == [0; 3]).count();
        assert!(black <= lines, "{radius}: a quarter of the light is left everywhere");
    }
    for strength in [f64::NAN, -3.0] {
        let q = Quality { occlusion_strength: strength, ..Quality::FULL };
        assert!(bench.draw(&scene, &q).rgba == plain.rgba, "{strength}");
    }
    let q = |strength| Quality { occlusion_strength: strength, ..Quality::FULL };
    assert!(bench.draw(&scene, &q(1e9)).rgba == bench.draw(&scene, &q(1.0)).rgba);
    let most = Quality { occlusion_samples: u32::MAX, ..Quality::FULL };
    let all = Quality { occlusion_samples: Quality::MOST_SAMPLES, ..Quality::FULL };
    assert!(bench.draw(&scene, &most).rgba == bench.draw(&scene, &all).rgba);
}
