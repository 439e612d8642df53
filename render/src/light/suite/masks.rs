//! Extreme scenes for light on masks, in the closeup, with every row of [`LIGHTS`]. Darkness is
//! stored in 8 bits and so is always a valid share: the tests check that each scene gives the expected frame.

use glam::{DMat3, DQuat, DVec3};
use glioscope_core::{
    Grid,
    optics::{Camera, Projection},
};

use crate::{
    CloseupRenderer,
    light::{self, LIGHTS, LightRow},
    scene::{LightSettings, Quality, RegionScene},
    solid::{
        SURFACE,
        view::{FAR, HAS_OCCLUSION},
    },
    testing::{GPU, grid, noise, scene_of, volume},
    views::{Frame, closeup::Closeup},
};

const SIZE: [u32; 2] = [33, 17];

#[derive(PartialEq)]
struct Rendered {
    depths: Vec<f32>,
    /// Darkness, 0 to 255.
    dark: Vec<u32>,
    rgba: Vec<u8>,
}

impl Rendered {
    fn hits(&self) -> usize {
        self.depths.iter().filter(|d| **d < FAR).count()
    }

    /// Mean darkness of the pixels that were hit, 0 to 255.
    fn darkness(&self) -> f64 {
        self.dark.iter().map(|d| f64::from(*d)).sum::<f64>() / self.hits().max(1) as f64
    }
}

fn render(
    renderer: &mut CloseupRenderer,
    scene: &RegionScene,
    lighting: LightSettings,
    size: [u32; 2],
) -> Rendered {
    let quality = Quality { lighting, occlusion_strength: 1.0, ..Quality::FULL };
    let mut once = || {
        let frame = renderer.render(&GPU, scene, &quality, size).unwrap();
        let pixels = (size[0] * size[1]) as usize;
        let row = light::row(lighting.mode);
        let dark = row.flags.iter().any(|(pass, flag)| flag & HAS_OCCLUSION != 0 && frame.plan.has(*pass));
        let has_opaque = frame.plan.has(SURFACE);
        Rendered {
            depths: if has_opaque { frame.read_surface(&GPU).0 } else { vec![FAR; pixels] },
            dark: if dark { blurred(frame, row) } else { vec![0; pixels] },
            rgba: frame.read_rgba(&GPU).unwrap(),
        }
    };
    let found = once();
    assert!(found == once(), "two frames are equal");
    for (i, (depth, dark)) in found.depths.iter().zip(&found.dark).enumerate() {
        assert!(depth.is_finite() && (*dark == 0 || *depth < FAR), "{i}: {depth} {dark}");
    }
    assert!(found.rgba.chunks(4).all(|p| p[3] == 255));
    found
}

/// Darkness of each pixel; directional light has no colour bleeding.
fn blurred(frame: &Frame<Closeup>, row: &LightRow) -> Vec<u32> {
    let packed = frame.read_blurred(&GPU);
    assert!(!from_eye(row) || packed.iter().all(|d| d & 0xff_ffff == 0), "{:?}: no colour", row.mode);
    packed.iter().map(|d| d >> 24).collect()
}

/// Whether light comes through a cone about the eye.
fn from_eye(row: &LightRow) -> bool {
    row.has_aperture && !row.has_lamp
}

fn of_grid(grid: &Grid) -> RegionScene {
    scene_of(volume(grid, 2, |k, p| noise(p, 4 + k as u32) > 0.4).unwrap(), 2, None)
}

fn eye_at(scene: &RegionScene, at: DVec3, towards: DVec3, projection: Projection) -> RegionScene {
    let back = -towards / towards.length();
    let c =
        Camera { world_from_camera: DQuat::from_rotation_arc(DVec3::Z, back), projection, ..scene.camera };
    RegionScene { camera: Camera { focus_mm: at - back * c.distance_mm(), ..c }, ..scene.clone() }
}

#[test]
fn every_mask_scene_in_every_lighting_mode() {
    let box_of = |dims: [usize; 3], spacing: DVec3| {
        let middle = DVec3::from_array(dims.map(|d| (d as f64 - 1.0) / 2.0));
        Grid::axis_aligned(dims, spacing, -spacing * middle).unwrap()
    };
    let cube = of_grid(&box_of([12; 3], DVec3::ONE));
    let lens = scene_of(cube.tumor.clone().unwrap(), 2, Some(0.5));
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.2, 0.0), DVec3::new(0.5, -0.9, 0.1), DVec3::new(0.0, 0.3, 1.2));
    let mut hidden = cube.clone();
    (1..4).for_each(|bits| hidden.selection.set(bits, false));
    let block = |masks| {
        scene_of(
            volume(&box_of([10, 9, 8], DVec3::ONE), masks, |_, p| p[2] < 4 || p[0] < 4).unwrap(),
            masks,
            None,
        )
    };
    let sheet = of_grid(&box_of([14, 12, 1], DVec3::ONE));
    let rows: Vec<(&str, RegionScene, [u32; 2], bool)> = vec![
        ("plain", cube.clone(), SIZE, true),
        ("with a lens", lens, SIZE, true),
        (
            "camera inside",
            eye_at(&cube, DVec3::splat(0.3), DVec3::new(0.3, -0.2, -1.0), Projection::Perspective),
            SIZE,
            true,
        ),
        ("camera at its face", eye_at(&cube, DVec3::Z * 6.0, -DVec3::Z, Projection::Perspective), SIZE, true),
        (
            "along its diagonal",
            eye_at(&cube, DVec3::splat(6.0), -DVec3::ONE, Projection::Perspective),
            SIZE,
            true,
        ),
        ("near plane cuts it", eye_at(&cube, DVec3::ZERO, -DVec3::Z, Projection::Orthographic), SIZE, true),
        (
            "all behind the camera",
            eye_at(&cube, DVec3::Z * 40.0, DVec3::Z, Projection::Perspective),
            SIZE,
            false,
        ),
        ("voxels 1:12", of_grid(&box_of([20, 18, 4], DVec3::new(0.5, 0.5, 6.0))), SIZE, true),
        ("voxels 12:1", of_grid(&box_of([4, 18, 20], DVec3::new(6.0, 0.5, 0.5))), SIZE, true),
        ("a sheet", sheet.clone(), SIZE, true),
        ("a sheet edge on", eye_at(&sheet, DVec3::X * -30.0, DVec3::X, Projection::Orthographic), SIZE, true),
        (
            "one voxel",
            scene_of(volume(&box_of([1; 3], DVec3::ONE), 1, |_, _| true).unwrap(), 1, None),
            SIZE,
            true,
        ),
        (
            "sheared, negative, at 1e6 mm",
            of_grid(&grid([12; 3], shear, DVec3::new(1e6, -1e6, 1e6))),
            SIZE,
            true,
        ),
        ("empty selection", hidden, SIZE, false),
        ("one pixel", cube.clone(), [1, 1], true),
        ("one mask", block(1), SIZE, true),
        ("five masks on the same voxels", block(5), SIZE, true),
    ];
    for row in &LIGHTS {
        let mode = row.mode;
        let mut renderer = CloseupRenderer::new(&GPU).unwrap();
        let mut before: Option<Vec<u32>> = None;
        for (name, scene, size, shows) in &rows {
            for (coarsest_level, sub_cones) in [(3, 4), (0, 16)] {
                let lighting = LightSettings { mode, coarsest_level, sub_cones, ..LightSettings::DEFAULT };
                let found = render(&mut renderer, scene, lighting, *size);
                println!("{mode:?} {name}: {} hit, darkness {:.1}", found.hits(), found.darkness());
                assert_eq!(found.hits() > 0, *shows, "{mode:?} {name}");
                if from_eye(row) {
                    // Light from the eye alone reaches every visible point of any shape.
                    let alone = LightSettings { aperture_deg: 0.0, ..lighting };
                    let straight = render(&mut renderer, scene, alone, *size);
                    assert!(
                        straight.dark.iter().all(|d| *d == 0),
                        "{mode:?} {name}: {}",
                        straight.darkness()
                    );
                }
                match *name {
                    "plain" | "voxels 1:12" => {
                        // At this size screen-space light may find no pit.
                        assert!(!from_eye(row) || found.darkness() > 2.0, "{mode:?} {name}: pits are dark");
                    }
                    "one mask" if coarsest_level == 0 => before = Some(found.dark),
                    "five masks on the same voxels" if coarsest_level == 0 => {
                        // Light that bounces takes on the colour, which is another.
                        let carries_color = mode == crate::scene::LightingMode::PathTraced;
                        assert!(
                            carries_color || before.as_ref() == Some(&found.dark),
                            "{mode:?}: as one mask"
                        );
                    }
                    _ => {}
                }
            }
        }
    }
}

#[test]
fn every_light_setting_on_masks() {
    let grid = Grid::axis_aligned([12; 3], DVec3::ONE, DVec3::splat(-5.5)).unwrap();
    let scene = of_grid(&grid);
    let base = LightSettings { sub_cones: 4, ..LightSettings::DEFAULT };
    let aperture = |aperture_deg| LightSettings { aperture_deg, ..base };
    let cones = |sub_cones| LightSettings { sub_cones, ..base };
    let step = |cone_step| LightSettings { cone_step, ..base };
    let level = |coarsest_level| LightSettings { coarsest_level, ..base };
    let samples = |vicinity_samples| LightSettings { vicinity_samples, ..base };
    let reach = |vicinity_mm| LightSettings { vicinity_mm, ..base };
    // A value out of range, and the limit that it is clamped to.
    let pairs = [
        (aperture(89.9), aperture(85.0)),
        (aperture(f64::NAN), aperture(0.0)),
        (aperture(-1.0), aperture(0.0)),
        (cones(0), cones(1)),
        (cones(1_000_000_000), cones(128)),
        (step(f64::NAN), step(1.0)),
        (step(0.0), step(0.0625)),
        (step(1e9), step(4.0)),
        (level(u32::MAX), level(15)),
        (samples(0), samples(1)),
        (samples(1_000_000_000), samples(118)),
        (reach(f64::NAN), reach(0.0)),
        (reach(f64::INFINITY), reach(0.0)),
        (reach(-1.0), reach(0.0)),
        (reach(1e300), reach(1e6)),
    ];
    for row in &LIGHTS {
        let mode = row.mode;
        let mut renderer = CloseupRenderer::new(&GPU).unwrap();
        let plain = render(&mut renderer, &scene, LightSettings { mode, ..base }, SIZE);
        assert!(!from_eye(row) || plain.darkness() > 2.0, "{mode:?}");
        let mut differing = 0;
        for (past, end) in pairs {
            let [past, end] =
                [past, end].map(|l| (l, render(&mut renderer, &scene, LightSettings { mode, ..l }, SIZE)));
            assert!(past.1 == end.1, "{mode:?}: {:?} is not {:?}", past.0, end.0);
            differing += usize::from(end.1.dark != plain.dark);
        }
        assert!(!from_eye(row) || differing > 5, "{mode:?}: settings have an effect");
    }
}
