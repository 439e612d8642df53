//! Error of the light on masks in a drawn frame, measured at some of its pixels against rays through their voxels in `f64`:
//! what curves measured elsewhere (docs/accuracy.md) can't say of the frame that is shown.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Cancelled, Progress, RegionVolume, Selection,
    optics::{Camera, Ray, Sight, random::Random, solids::cone_openness, srgb, voxels::OpaqueVoxels},
};
use rayon::prelude::*;

use crate::scene::{Lens, LightingMode, Quality, RegionScene};

/// Pixels that are measured, where the frame shows as many, and rays at each of them.
const PIXELS: usize = 6000;
const RAYS: u32 = 128;
/// How far before a hit on the line of sight rays start where there is no room above it, in the finest spacing: as in
/// traced/rays.wgsl.
const NEARER: f64 = 0.02;

/// Error of the light in a frame, as a share of the light of a free surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameError {
    /// Root mean square over the pixels, the noise of the reference taken out.
    pub rms: f64,
    /// Standard error of it.
    pub rms_uncertainty: f64,
    /// Pixels that were measured.
    pub pixels: usize,
}

impl FrameError {
    /// From each pixel's error, and the variance of its reference; `None` without a pixel.
    fn of(errors: &[(f64, f64)]) -> Option<Self> {
        let n = errors.len() as f64;
        let squares = || errors.iter().map(|(error, variance)| error * error - variance);
        let mean = squares().sum::<f64>() / n;
        let spread = squares().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let rms = mean.max(0.0).sqrt();
        let of_mean = (spread / n).sqrt();
        // Where nothing is left, the uncertainty of the square is all that is known.
        let rms_uncertainty = if rms * rms > of_mean { of_mean / (2.0 * rms) } else { of_mean.sqrt() };
        (!errors.is_empty()).then_some(Self { rms, rms_uncertainty, pixels: errors.len() })
    }
}

/// The light that a place on a surface receives, in truth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Truth {
    /// Of the hemisphere about the smoothed normal, by the cosine, within a radius.
    Hemisphere { radius_mm: f64 },
    /// Of a cone about the direction to the eye.
    Cone { aperture_deg: f64 },
}

/// Truth of a frame's light; `None` where none is defined: for light on the smooth surface, in encoded colours or of a lamp.
fn truth_of(quality: &Quality, lens: Option<&Lens>) -> Option<Truth> {
    if quality.smooth {
        return None;
    }
    match quality.lighting.mode {
        LightingMode::Traced | LightingMode::Horizon => {
            Some(Truth::Hemisphere { radius_mm: quality.occlusion_radius_mm })
        }
        LightingMode::Slices | LightingMode::Cones if lens.is_none() => {
            Some(Truth::Cone { aperture_deg: quality.lighting.aperture_deg })
        }
        _ => None,
    }
}

/// A drawn frame's light, read back, and what is needed to measure its error on any thread.
#[derive(Clone, Debug)]
pub struct LightSample {
    truth: Truth,
    tumor: Arc<RegionVolume>,
    selection: Selection,
    lens: Option<Lens>,
    camera: Camera,
    size_px: [u32; 2],
    strength: f64,
    depths_mm: Vec<f64>,
    dark: Vec<f64>,
}

impl LightSample {
    /// Whether a frame of this scene has a reference.
    pub(crate) fn has_reference(scene: &RegionScene, quality: &Quality) -> bool {
        scene.tumor.is_some() && truth_of(quality, scene.lens.as_ref()).is_some()
    }

    /// `depths_mm`: of each drawn pixel from the eye, infinite without a surface; `dark`: share by which its encoded colour is
    /// darkened. `None` where the light has no reference.
    pub(crate) fn of(
        scene: &RegionScene,
        quality: &Quality,
        size_px: [u32; 2],
        (depths_mm, dark): (Vec<f64>, Vec<f64>),
    ) -> Option<Self> {
        Some(Self {
            truth: truth_of(quality, scene.lens.as_ref())?,
            tumor: scene.tumor.clone()?,
            selection: scene.selection.clone(),
            lens: scene.lens,
            camera: scene.camera,
            size_px,
            strength: f64::from(quality.strength()),
            depths_mm,
            dark,
        })
    }

    /// Measures the error. A frame without a surface, or with cuts of the lens alone, has none.
    ///
    /// # Errors
    /// [`Cancelled`] after [`Progress::cancel`].
    pub fn measure(&self, progress: &Progress) -> Result<Option<FrameError>, Cancelled> {
        self.measure_by(progress, (PIXELS, RAYS, 17))
    }

    pub(super) fn measure_by(
        &self,
        progress: &Progress,
        (most, rays, seed): (usize, u32, u64),
    ) -> Result<Option<FrameError>, Cancelled> {
        let voxels = OpaqueVoxels::new(self.tumor.grid().clone(), |l| {
            self.selection.shows(self.tumor.bits_of_id().get(self.tumor.id(l) as usize).copied().unwrap_or(0))
        });
        let mut shown: Vec<usize> = (0..self.depths_mm.len())
            .filter(|i| self.depths_mm.get(*i).is_some_and(|d| d.is_finite()))
            .collect();
        // The first of a random order.
        let mut random = Random::new(seed, 0);
        let count = most.min(shown.len());
        for i in 0..count {
            let other = i + ((random.unit() * (shown.len() - i) as f64) as usize).min(shown.len() - i - 1);
            shown.swap(i, other);
        }
        shown.truncate(count);
        progress.expect(count as u64);
        let sight = Sight::new(&self.camera, self.size_px);
        let at_pixel = |pixel: &usize| {
            progress.advance(1)?;
            Ok(self.at_pixel(&voxels, &sight, *pixel, rays, seed))
        };
        let errors: Vec<Option<(f64, f64)>> =
            shown.par_iter().map(at_pixel).collect::<Result<_, Cancelled>>()?;
        Ok(FrameError::of(&errors.into_iter().flatten().collect::<Vec<_>>()))
    }

    /// Error of the light at a pixel, and the variance of its reference; `None` on a cut of the lens.
    fn at_pixel(
        &self,
        voxels: &OpaqueVoxels,
        sight: &Sight,
        number: usize,
        rays: u32,
        seed: u64,
    ) -> Option<(f64, f64)> {
        let width = self.size_px[0] as usize;
        let pixel = [(number % width) as u32, (number / width) as u32];
        let depth_mm = *self.depths_mm.get(number)?;
        let finest_mm = self.tumor.grid().spacing_mm().min_element();
        let hit_mm = sight.at_mm(pixel, depth_mm);
        if let Some(lens) = &self.lens
            && (hit_mm.distance(lens.center_mm) - lens.radius_mm).abs() < NEARER * finest_mm
        {
            return None;
        }
        let nearer_mm = sight.at_mm(pixel, depth_mm - NEARER * finest_mm);
        let mut random = Random::new(seed, 1 + number as u64);
        let (open, error) = match self.truth {
            Truth::Hemisphere { radius_mm } => {
                let far_mm =
                    |ray: &Ray| self.lens.map_or(radius_mm, |lens| radius_mm.min(lens.leaves_mm(ray)));
                voxels.ambient_light((hit_mm, nearer_mm), far_mm, rays, &mut random)?
            }
            Truth::Cone { aperture_deg } => {
                let far_mm = 2.0
                    * self
                        .tumor
                        .grid()
                        .corners_mm()
                        .map(|c| c.distance(hit_mm))
                        .into_iter()
                        .fold(0.0, f64::max);
                let to_eye = (nearer_mm - hit_mm).normalize_or(DVec3::Z);
                let hidden = |ray: &Ray| voxels.hidden(ray, far_mm);
                cone_openness(&hidden, nearer_mm, to_eye, aperture_deg, rays, &mut random)
            }
        };
        let found = srgb::decode(1.0 - self.dark.get(number)?);
        let ambient = 1.0 - self.strength;
        Some((found - (ambient + self.strength * open), (self.strength * error).powi(2)))
    }
}
