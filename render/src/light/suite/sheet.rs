//! A sheet of fibres before a tumour: how wide a band of the tumour it darkens, with every light that claims solids,
//! against Monte Carlo of the whole scene (brute force over capsules and voxels, without any code of the passes).

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Grid, Progress, Selection, Sides, Tracts,
    optics::{
        Camera, Projection, Ray, Sight,
        hemisphere::{Weight, openness},
        random::Random,
        solids::{Capsule, cone_openness},
        srgb,
        voxels::OpaqueVoxels,
    },
};

use rayon::prelude::*;

use super::lit;
use crate::{
    ContextRenderer, ContextScene, DrawnTubes, TransferFunction, TubeLook, TubeSet, TubeShape,
    light::layers::LAYERS,
    light::preset,
    scene::{LightingMode, MaskColors, Palette, Preset, Quality},
    solid::view::FAR,
    testing::{GPU, volume},
    views::{context::context_plan, view3d::Switches},
};

const SIZE: [u32; 2] = [160, 120];
/// Height of the frame at the tumour.
const HEIGHT_MM: f64 = 36.0;
const RADIUS_MM: f64 = 0.5;
/// A share of the light that is seen to be lost.
const SEEN: f64 = 0.05;

/// Fibres side by side along y, from x = -20 to their edge at x = 0, `above` mm over a slab whose face is z = 0.
struct Sheet {
    scene: ContextScene,
    capsules: Vec<Capsule>,
    slab: OpaqueVoxels,
}

impl Sheet {
    /// `every_mm`: from axis to axis; 1 mm: they touch.
    fn new(above_mm: f64, every_mm: f64, projection: Projection) -> Self {
        let z = above_mm + RADIUS_MM;
        let count = (20.0 / every_mm) as usize;
        let ends: Vec<[DVec3; 2]> = (0..count)
            .map(|n| -RADIUS_MM - n as f64 * every_mm)
            .map(|x| [DVec3::new(x, -30.0, z), DVec3::new(x, 30.0, z)])
            .collect();
        let points = ends.iter().flatten().map(|p| p.as_vec3().to_array()).collect();
        let offsets = (0..=count).map(|n| 2 * n as u32).collect();
        let tracts = Tracts::new(points, offsets, Sides::Known).unwrap();
        let set = TubeSet::new(&tracts, &TubeShape::default(), &Progress::new()).unwrap();
        let look = TubeLook { radius_mm: RADIUS_MM, ..TubeLook::of([200, 180, 120]) };
        let grid = Grid::axis_aligned([60, 60, 4], DVec3::ONE, DVec3::new(-29.5, -29.5, -3.5)).unwrap();
        let scene = ContextScene {
            volume: None,
            transfer: Arc::new(TransferFunction::transparent()),
            projection: None,
            clip: Vec::new(),
            tumor: volume(&grid, 1, |_, _| true),
            selection: Selection::all(),
            colors: MaskColors::new(Palette::Thesis, &[None; 1]),
            lens: None,
            tubes: vec![DrawnTubes { set: Arc::new(set), look, shown: true }],
            camera: Camera {
                height_mm: HEIGHT_MM,
                ..Camera::fit(DVec3::ZERO, 20.0, Camera::orientation(0.0, 90.0), projection)
            },
            background: [255; 3],
            silhouette: [0; 3],
        };
        let capsule = |[a_mm, b_mm]: [DVec3; 2]| Capsule { a_mm, b_mm, radius_mm: RADIUS_MM };
        let capsules = ends.into_iter().map(capsule).collect();
        Self { scene, capsules, slab: OpaqueVoxels::new(grid, |_| true) }
    }

    fn hidden(&self, ray: &Ray, far_mm: f64) -> bool {
        self.capsules.iter().any(|c| c.hidden(ray, far_mm)) || self.slab.hidden(ray, far_mm)
    }

    /// True light at `x` on the slab: of the cone to the eye, or of the hemisphere within a radius.
    fn truth(&self, x: f64, hemisphere_mm: Option<f64>) -> f64 {
        let mut random = Random::new(9, (x * 1000.0) as u64);
        let at_mm = DVec3::new(x, 0.3, 1e-6);
        let to_eye = match self.scene.camera.projection {
            Projection::Orthographic => DVec3::Z,
            Projection::Perspective => (self.scene.camera.eye_mm() - at_mm).normalize_or(DVec3::Z),
        };
        let samples = 4000;
        match hemisphere_mm {
            None => {
                let hidden = |ray: &Ray| self.hidden(ray, 60.0);
                cone_openness(&hidden, at_mm, to_eye, 60.0, samples, &mut random).0
            }
            Some(radius_mm) => {
                let hidden = |ray: &Ray, far: f64| self.hidden(ray, far);
                openness(&hidden, at_mm, DVec3::Z, radius_mm, Weight::Cosine, samples, &mut random).0
            }
        }
    }

    /// Mean light of each column of the frame that shows the slab, with x on it.
    fn found(&self, quality: &Quality) -> Vec<(f64, f64)> {
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let quality = Quality { occlusion_strength: 1.0, ..*quality };
        let frame = renderer.render(&GPU, &self.scene, &quality, SIZE).unwrap();
        let (depths, surfaces) = frame.read_surface(&GPU);
        let blurred = frame.read_blurred(&GPU);
        let sight = Sight::new(&self.scene.camera, SIZE);
        let reference_mm = self.scene.reference_mm();
        let mut columns = Vec::new();
        for x in 0..SIZE[0] {
            let (mut light, mut place, mut count) = (0.0, 0.0, 0.0);
            for y in SIZE[1] / 2 - 16..SIZE[1] / 2 + 16 {
                let at = (y * SIZE[0] + x) as usize;
                let is_slab = depths[at] < FAR && surfaces[at][1] & 0x8000_0000 == 0;
                if is_slab {
                    light += srgb::decode(1.0 - f64::from(blurred[at] >> 24) / 255.0);
                    place += sight.at_mm([x, y], reference_mm + f64::from(depths[at])).x;
                    count += 1.0;
                }
            }
            if count == 32.0 {
                columns.push((place / count, light / count));
            }
        }
        columns.sort_by(|a, b| a.0.total_cmp(&b.0));
        columns
    }
}

/// How far from the first column the light is less than by [`SEEN`], and the root mean square difference.
struct Band {
    width_mm: f64,
    true_width_mm: f64,
    rms: f64,
}

fn band(sheet: &Sheet, quality: &Quality, hemisphere_mm: Option<f64>) -> Band {
    let columns: Vec<(f64, f64)> =
        sheet.found(quality).into_iter().filter(|(x, _)| (0.0..16.0).contains(x)).collect();
    assert!(columns.len() > 30, "{}", columns.len());
    let truth: Vec<f64> = columns.par_iter().map(|(x, _)| sheet.truth(*x, hemisphere_mm)).collect();
    let first = columns[0].0;
    let width = |light: &dyn Fn(usize) -> f64| {
        let last = (0..columns.len()).rev().find(|i| light(*i) < 1.0 - SEEN);
        last.map_or(0.0, |i| columns[i].0 - first)
    };
    let squares: f64 = columns.iter().zip(&truth).map(|((_, found), truth)| (found - truth).powi(2)).sum();
    for ((x, found), truth) in columns.iter().zip(&truth).step_by(9) {
        println!("  x {x:.1}: {found:.3}, true {truth:.3}");
    }
    Band {
        width_mm: width(&|i| columns[i].1),
        true_width_mm: width(&|i| truth[i]),
        rms: (squares / columns.len() as f64).sqrt(),
    }
}

/// Every light that claims solids: directional ones against the cone, horizons against the hemisphere within their radius.
/// In docs/accuracy.md.
#[test]
fn a_sheet_of_fibres_darkens_as_wide_a_band_as_the_cone_reaches() {
    use Projection::{Orthographic, Perspective};
    for (projection, above_mm, every_mm) in [
        (Orthographic, 5.0, 1.0),
        (Orthographic, 5.0, 2.0),
        (Orthographic, 10.0, 1.0),
        (Perspective, 5.0, 1.0),
    ] {
        let sheet = Sheet::new(above_mm, every_mm, projection);
        for mode in [LightingMode::Slices, LightingMode::Cones, LightingMode::Traced] {
            let has_cone = crate::light::row(mode).has_aperture;
            let quality = preset(mode, Preset::Balanced);
            let within_mm = (!has_cone).then_some(quality.occlusion_radius_mm);
            let Band { width_mm, true_width_mm, rms } = band(&sheet, &quality, within_mm);
            println!(
                "{projection:?}, {above_mm} mm, every {every_mm} mm, {mode:?}: {width_mm:.1} mm, true \
                 {true_width_mm:.1} mm, RMS {rms:.3}"
            );
            // A pixel is 0.3 mm. Horizons take everything behind a fibre for solid.
            let (off_mm, most_rms) = if has_cone { (1.8, 0.035) } else { (1.3, 0.06) };
            assert!(
                (width_mm - true_width_mm).abs() < off_mm && rms < most_rms,
                "{mode:?}: {width_mm} {rms}"
            );
        }
    }
}

/// Cells of balanced and of moving frames against the finest. The table is in docs/studies.md.
#[test]
fn coarser_cells_widen_the_band_by_as_much_as_the_study_says() {
    let sheet = Sheet::new(5.0, 1.0, Projection::Orthographic);
    for (layer_cell, most_wider_mm, most_rms) in [(1.0, 0.9, 0.02), (1.5, 0.9, 0.02), (3.0, 2.4, 0.04)] {
        let mut quality = preset(LightingMode::Slices, Preset::Balanced);
        quality.lighting.layer_cell = layer_cell;
        let Band { width_mm, true_width_mm, rms } = band(&sheet, &quality, None);
        println!("cells {layer_cell}: {width_mm:.1} mm, true {true_width_mm:.1} mm, RMS {rms:.3}");
        let wider_mm = width_mm - true_width_mm;
        assert!((0.0..most_wider_mm).contains(&wider_mm) && rms < most_rms, "{layer_cell}: {wider_mm} {rms}");
    }
}

/// What the layers are for: vicinity occlusion alone darkens no more than its own radius.
#[test]
fn layers_darken_more_than_vicinity_occlusion_alone() {
    let sheet = Sheet::new(5.0, 1.0, Projection::Orthographic);
    let quality = lit(LightingMode::Slices);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let with = renderer.render(&GPU, &sheet.scene, &quality, SIZE).unwrap().read_rgba(&GPU).unwrap();
    let mut plan = context_plan(&sheet.scene, &quality);
    plan.passes.retain(|pass| *pass != LAYERS);
    let without = renderer.render_planned(&GPU, &sheet.scene, &quality, SIZE, plan, Switches::ON).unwrap();
    let without = without.read_rgba(&GPU).unwrap();
    let darker = with.iter().zip(&without).filter(|(a, b)| a.saturating_add(5) < **b).count();
    println!("{darker} values darker");
    assert!(darker > 1000, "{darker}");
}
