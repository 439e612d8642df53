//! Truth of ambient occlusion on masks: the hemisphere about the smoothed normal, by rays through the voxels in `f64`.

use glioscope_core::optics::{Ray, Sight, random::Random, voxels::OpaqueVoxels};
use glioscope_render::{LightingMode, Preset, RegionScene, light::preset};
use rayon::prelude::*;

use crate::Outcome;

/// Occluded fraction of the hemisphere at some pixels.
pub struct HemisphereTruth {
    /// Pixel index, fraction, standard error.
    pub pixels: Vec<(usize, f64, f64)>,
}

impl HemisphereTruth {
    /// Mean square of the standard errors.
    pub fn variance(&self) -> f64 {
        self.pixels.iter().map(|(_, _, error)| error * error).sum::<f64>() / self.pixels.len().max(1) as f64
    }

    /// Mean fraction; 0 without a pixel.
    pub fn mean(&self) -> f64 {
        self.pixels.iter().map(|(_, hidden, _)| hidden).sum::<f64>() / self.pixels.len().max(1) as f64
    }
}

/// At every `stride`-th pixel that shows a mask, by `samples` rays from as high above the first hit as the steps between voxels
/// are. `depths_mm`: of each pixel, from the eye.
///
/// # Errors
/// For a closeup without masks.
pub fn through_voxels(
    scene: &RegionScene,
    size: [u32; 2],
    depths_mm: &[f64],
    (stride, samples): (u32, u32),
) -> Outcome<HemisphereTruth> {
    let radius_mm = radius_mm();
    let tumor = scene.tumor.as_ref().ok_or("a closeup without masks")?;
    let voxels = OpaqueVoxels::new(tumor.grid().clone(), |linear| tumor.id(linear) != 0);
    let sight = Sight::new(&scene.camera, size);
    let pixels: Vec<[u32; 2]> = (0..size[1])
        .step_by(stride as usize)
        .flat_map(|y| (0..size[0]).step_by(stride as usize).map(move |x| [x, y]))
        .collect();
    let at_pixel = |pixel: [u32; 2]| {
        let number = (pixel[1] * size[0] + pixel[0]) as usize;
        let depth_mm = *depths_mm.get(number).filter(|d| d.is_finite())?;
        let at_mm = sight.at_mm(pixel, depth_mm);
        let nearer_mm = sight.at_mm(pixel, depth_mm - NEARER_MM);
        let mut random = Random::new(5, number as u64);
        let hidden = |ray: &Ray| voxels.hidden(ray, radius_mm);
        let (open, error) = voxels.ambient_light((at_mm, nearer_mm), &hidden, samples, &mut random)?;
        Some((number, 1.0 - open, error))
    };
    Ok(HemisphereTruth { pixels: pixels.into_par_iter().filter_map(at_pixel).collect() })
}

/// How far before a hit on the line of sight rays start where there is no room above it.
const NEARER_MM: f64 = 0.02;

/// The window's own radius, for all kernels.
pub fn radius_mm() -> f64 {
    preset(LightingMode::Traced, Preset::Balanced).occlusion_radius_mm
}
