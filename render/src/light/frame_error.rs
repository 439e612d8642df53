//! Error of a drawn frame's light, measured at some of its pixels against the light among what the frame shows, in `f64`: masks
//! by their voxels, fibres as capsules, the image's extinction. What curves measured elsewhere (docs/accuracy.md) can't say of
//! the frame that is shown.

use std::{fmt, sync::Arc};

use glam::DVec3;
use glioscope_core::{
    Cancelled, Progress, RegionVolume, Selection,
    optics::{
        Camera, Ray, Sight,
        hemisphere::{Weight, openness},
        march::stretch_mm,
        medium::{Medium, thickness_of},
        monte_carlo::{Phase, direction},
        random::Random,
        solids::{Capsule, CapsuleTree},
        srgb,
        volume::OpticalVolume,
        voxels::OpaqueVoxels,
    },
};
use rayon::prelude::*;

use crate::{
    scene::{Lens, LightingMode, Quality},
    solid::tubes::DrawnTubes,
};

/// Pixels of each kind that are measured, where the frame shows as many; fewer where rays go through an image, which takes
/// longer. And rays at each of them.
const PIXELS: [usize; 2] = [6000, 1500];
const RAYS: u32 = 128;
/// How far before a hit on the line of sight rays start where there is no room above it, in the finest spacing: as in
/// traced/rays.wgsl.
const NEARER: f64 = 0.02;
/// The same before a fibre, millimetres: single precision leaves hits a little inside.
const NEARER_MM: f64 = 0.01;
/// Steps through the image, in its finest spacing.
const STEP: f64 = 0.5;
/// Optical thickness through which nothing is seen.
const OPAQUE: f64 = 14.0;
/// Pixels whose image is less opaque show none.
const LEAST_OPACITY: f64 = 0.02;

/// Error of the light in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameError {
    /// Root mean square over the pixels, the noise of the reference taken out: of surfaces as a share of the light of a free one,
    /// of the image in linear radiance.
    pub rms: f64,
    /// Standard error of it.
    pub rms_uncertainty: f64,
    /// Pixels that were measured.
    pub pixels: usize,
}

impl FrameError {
    /// From each pixel's squared error, and the variance of its reference; `None` without a pixel.
    fn of(errors: &[(f64, f64)]) -> Option<Self> {
        let n = errors.len() as f64;
        let squares = || errors.iter().map(|(squared, variance)| squared - variance);
        let mean = squares().sum::<f64>() / n;
        let spread = squares().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let rms = mean.max(0.0).sqrt();
        let of_mean = (spread / n).sqrt();
        // Where nothing is left, the uncertainty of the square is all that is known.
        let rms_uncertainty = if rms * rms > of_mean { of_mean / (2.0 * rms) } else { of_mean.sqrt() };
        (!errors.is_empty()).then_some(Self { rms, rms_uncertainty, pixels: errors.len() })
    }
}

/// Errors of a frame's light; `None` where it shows no such thing, or light on it has no reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameErrors {
    /// Of the light on opaque surfaces.
    pub surfaces: Option<FrameError>,
    /// Of the image's radiance.
    pub tissue: Option<FrameError>,
}

/// The light that a place receives, in truth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Truth {
    /// Of the hemisphere about the surface's normal, by the cosine, within a radius.
    Hemisphere { radius_mm: f64 },
    /// Of a cone about the direction to the eye, or to a lamp.
    Cone(Phase),
}

/// Truth of a frame's light; `None` where none is defined: for light on the smooth surface, in encoded colours or of a lamp's
/// point.
fn truth_of(quality: &Quality, is_smooth: bool, camera: &Camera) -> Option<Truth> {
    let light = &quality.lighting;
    let aperture_deg = light.aperture_deg;
    match light.mode {
        _ if is_smooth => None,
        LightingMode::Traced | LightingMode::Horizon => {
            Some(Truth::Hemisphere { radius_mm: quality.occlusion_radius_mm })
        }
        LightingMode::Slices | LightingMode::Cones => Some(Truth::Cone(if light.towards_lamp {
            Phase::Lamp { towards: light.lamp.direction(camera), aperture_deg }
        } else {
            Phase::Cone { aperture_deg }
        })),
        _ => None,
    }
}

/// The image of a frame.
pub(crate) trait FrameImage: fmt::Debug + Send + Sync {
    /// All of it as a medium; `None` where it has none.
    fn medium(&self) -> Option<OpticalVolume>;

    /// Where a line of sight shows it, in millimetres along it.
    fn shown_mm(&self, sight: &Ray) -> Option<(f64, f64)>;
}

/// What a frame shows.
#[derive(Clone, Debug)]
pub(crate) struct FrameScene {
    pub camera: Camera,
    pub tumor: Option<Arc<RegionVolume>>,
    pub selection: Selection,
    /// The lens, where it cuts the masks.
    pub cut: Option<Lens>,
    /// Whether the masks' smooth surface is shown.
    pub is_smooth: bool,
    pub tubes: Vec<DrawnTubes>,
    pub image: Option<Arc<dyn FrameImage>>,
}

impl FrameScene {
    /// Whether the light of its frames has a reference.
    pub fn has_reference(&self, quality: &Quality) -> bool {
        let is_lit = self.tumor.is_some() || self.tubes.iter().any(DrawnTubes::draws) || self.image.is_some();
        is_lit && truth_of(quality, self.is_smooth, &self.camera).is_some()
    }
}

/// What is read back of a frame, rows from the top.
#[derive(Clone, Debug, Default)]
pub(crate) struct FramePixels {
    /// Of each drawn pixel from the eye, infinite without a surface.
    pub depths_mm: Vec<f64>,
    /// Share by which its encoded colour is darkened.
    pub dark: Vec<f64>,
    /// Whether the surface is a fibre's; empty without fibres.
    pub is_tube: Vec<bool>,
    /// Premultiplied linear radiance of the image and its opacity; empty without one.
    pub radiance: Vec<[f64; 4]>,
}

/// A drawn frame's light, read back, and what is needed to measure its error on any thread.
#[derive(Clone, Debug)]
pub struct LightSample {
    truth: Truth,
    scene: FrameScene,
    size_px: [u32; 2],
    strength: f64,
    pixels: FramePixels,
}

impl LightSample {
    /// `None` where the light has no reference.
    pub(crate) fn of(
        scene: FrameScene,
        quality: &Quality,
        size_px: [u32; 2],
        pixels: FramePixels,
    ) -> Option<Self> {
        let truth = truth_of(quality, scene.is_smooth, &scene.camera)?;
        Some(Self { truth, scene, size_px, strength: f64::from(quality.strength()), pixels })
    }

    /// Measures the errors. A frame without a surface, or with cuts of the lens alone, has none of surfaces.
    ///
    /// # Errors
    /// [`Cancelled`] after [`Progress::cancel`].
    pub fn measure(&self, progress: &Progress) -> Result<FrameErrors, Cancelled> {
        let most = PIXELS[usize::from(self.scene.image.is_some())];
        self.measure_by(progress, (most, RAYS, 17))
    }

    pub(super) fn measure_by(
        &self,
        progress: &Progress,
        (most, rays, seed): (usize, u32, u64),
    ) -> Result<FrameErrors, Cancelled> {
        let known = Known::of(&self.scene, self.size_px);
        let is_lit = |i: &usize| self.pixels.depths_mm.get(*i).is_some_and(|d| d.is_finite());
        let surfaces = chosen((0..self.pixels.depths_mm.len()).filter(is_lit).collect(), most, seed);
        let shows = |i: &usize| self.pixels.radiance.get(*i).is_some_and(|p| p[3] > LEAST_OPACITY);
        let has_truth = matches!(self.truth, Truth::Cone(_)) && known.image.is_some();
        let tissue = (0..self.pixels.radiance.len()).filter(|i| has_truth && shows(i)).collect();
        let tissue = chosen(tissue, most, seed);
        progress.expect((surfaces.len() + tissue.len()) as u64);
        let errors = |pixels: &[usize], of: &(dyn Fn(usize) -> Option<(f64, f64)> + Sync)| {
            let errors: Result<Vec<Option<(f64, f64)>>, Cancelled> = pixels
                .par_iter()
                .map(|pixel| {
                    progress.advance(1)?;
                    Ok(of(*pixel))
                })
                .collect();
            Ok(FrameError::of(&errors?.into_iter().flatten().collect::<Vec<_>>()))
        };
        Ok(FrameErrors {
            surfaces: errors(&surfaces, &|pixel| self.on_surface(&known, pixel, (rays, seed)))?,
            tissue: errors(&tissue, &|pixel| self.in_tissue(&known, pixel, (rays, seed)))?,
        })
    }

    fn pixel(&self, number: usize) -> [u32; 2] {
        let width = self.size_px[0] as usize;
        [(number % width) as u32, (number / width) as u32]
    }

    /// Squared error of the light on a surface, and the variance of its reference; `None` on a cut of the lens.
    fn on_surface(&self, known: &Known<'_>, number: usize, (rays, seed): (u32, u64)) -> Option<(f64, f64)> {
        let (pixel, depth_mm) = (self.pixel(number), *self.pixels.depths_mm.get(number)?);
        let hit_mm = known.sight.at_mm(pixel, depth_mm);
        let is_tube = self.pixels.is_tube.get(number).copied().unwrap_or(false);
        let before_mm = if is_tube { NEARER_MM } else { NEARER * known.finest_mm };
        if let Some(lens) = &self.scene.cut
            && (hit_mm.distance(lens.center_mm) - lens.radius_mm).abs() < before_mm
        {
            return None;
        }
        let nearer_mm = known.sight.at_mm(pixel, depth_mm - before_mm);
        let mut random = Random::new(seed, 1 + number as u64);
        let (open, error) = match self.truth {
            Truth::Hemisphere { radius_mm } => {
                let hidden = |ray: &Ray| known.hides(ray, radius_mm);
                if is_tube {
                    let normal = known.tubes.normal(hit_mm, 0.1)?;
                    let hidden = |ray: &Ray, _: f64| hidden(ray);
                    openness(&hidden, nearer_mm, normal, f64::INFINITY, Weight::Cosine, rays, &mut random)
                } else {
                    known.voxels.as_ref()?.ambient_light((hit_mm, nearer_mm), &hidden, rays, &mut random)?
                }
            }
            Truth::Cone(phase) => {
                let to_eye = -known.sight.line_through(hit_mm).direction;
                let found: Vec<f64> =
                    (0..rays).map(|_| known.light(nearer_mm, to_eye, phase, &mut random)).collect();
                mean_of(&found)
            }
        };
        let found = srgb::decode(1.0 - self.pixels.dark.get(number)?);
        let error_of_light = found - (1.0 - self.strength) - self.strength * open;
        Some((error_of_light.powi(2), (self.strength * error).powi(2)))
    }

    /// Squared error of the image's radiance, the mean of the three channels, and the variance of its reference.
    fn in_tissue(&self, known: &Known<'_>, number: usize, (rays, seed): (u32, u64)) -> Option<(f64, f64)> {
        let (Truth::Cone(phase), Some(image)) = (self.truth, &known.image) else { return None };
        let pixel = self.pixel(number);
        let [r, g, b, _] = *self.pixels.radiance.get(number)?;
        let mut random = Random::new(seed, u64::MAX - number as u64);
        let sight = known.sight.line_through(known.sight.at_mm(pixel, 1.0));
        let end_mm = self.pixels.depths_mm.get(number)? * known.sight.slant(pixel);
        let (near_mm, far_mm) = image.image.shown_mm(&sight)?;
        let far_mm = far_mm.min(end_mm);
        let near_mm = near_mm.max(0.0).min(far_mm);
        let count = (2.0 * (far_mm - near_mm) / image.step_mm).ceil().clamp(1.0, 1e6);
        let step_mm = (far_mm - near_mm) / count;
        // What is seen up to the end of each step.
        let mut through = 1.0;
        let mut seen = Vec::with_capacity(count as usize);
        for n in 0..count as u64 {
            let at_mm = sight.origin_mm + sight.direction * (near_mm + (n as f64 + 0.5) * step_mm);
            let optics = image.medium.optics(at_mm);
            through *= (-thickness_of(optics.extinction_per_mm, step_mm)).exp();
            seen.push((1.0 - through, at_mm, optics.color));
        }
        let opacity = 1.0 - through;
        // Independent places by how much of each is seen, and one ray of light at each: equal shares would have less noise than
        // their spread tells, and more than it would be taken out.
        let found: Vec<DVec3> = (0..rays)
            .filter_map(|_| {
                let share = random.unit() * opacity;
                let (_, at_mm, color) = seen.get(seen.partition_point(|s| s.0 < share))?;
                let light = known.light(*at_mm, -sight.direction, phase, &mut random);
                Some(*color * (opacity * (1.0 - self.strength + self.strength * light)))
            })
            .collect();
        let channels: [(f64, f64); 3] =
            std::array::from_fn(|c| mean_of(&found.iter().map(|f| f[c]).collect::<Vec<_>>()));
        let squared = [r, g, b].into_iter().zip(channels).map(|(shown, (mean, _))| (shown - mean).powi(2));
        let variance = channels.iter().map(|(_, error)| error * error);
        Some((squared.sum::<f64>() / 3.0, variance.sum::<f64>() / 3.0))
    }
}

/// The first `most` of these numbers in a random order.
fn chosen(mut numbers: Vec<usize>, most: usize, seed: u64) -> Vec<usize> {
    let mut random = Random::new(seed, 0);
    let count = most.min(numbers.len());
    for i in 0..count {
        let other = i + ((random.unit() * (numbers.len() - i) as f64) as usize).min(numbers.len() - i - 1);
        numbers.swap(i, other);
    }
    numbers.truncate(count);
    numbers
}

/// Mean and its standard error.
fn mean_of(found: &[f64]) -> (f64, f64) {
    let n = found.len().max(1) as f64;
    let mean = found.iter().sum::<f64>() / n;
    let spread = found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean, (spread / n).sqrt())
}

/// An image, ready to be asked.
struct KnownImage<'a> {
    image: &'a dyn FrameImage,
    medium: OpticalVolume,
    step_mm: f64,
}

/// What a frame shows, ready to be asked.
struct Known<'a> {
    sight: Sight,
    finest_mm: f64,
    voxels: Option<OpaqueVoxels>,
    cut: Option<Lens>,
    tubes: CapsuleTree,
    image: Option<KnownImage<'a>>,
}

impl<'a> Known<'a> {
    fn of(scene: &'a FrameScene, size_px: [u32; 2]) -> Self {
        let sight = Sight::new(&scene.camera, size_px);
        let finest_mm = scene.tumor.as_ref().map_or(1.0, |t| t.grid().spacing_mm().min_element());
        let voxels = scene.tumor.as_ref().map(|tumor| {
            OpaqueVoxels::new(tumor.grid().clone(), |l| {
                scene.selection.shows(tumor.bits_of_id().get(tumor.id(l) as usize).copied().unwrap_or(0))
            })
        });
        let drawn = scene.tubes.iter().filter(|t| t.draws());
        let capsules = drawn.flat_map(|tubes| tubes.capsules()).map(|capsule| {
            // As wide as they are drawn.
            let least_mm = DrawnTubes::least_radius_mm(&sight, 0.5 * (capsule.a_mm + capsule.b_mm));
            Capsule { radius_mm: capsule.radius_mm.max(least_mm), ..capsule }
        });
        let image = scene.image.as_deref().and_then(|image| {
            let medium = image.medium()?;
            let step_mm = STEP * medium.grid().spacing_mm().min_element();
            Some(KnownImage { image, medium, step_mm })
        });
        Self { sight, finest_mm, voxels, cut: scene.cut, tubes: CapsuleTree::new(capsules.collect()), image }
    }

    /// Whether a solid hides what is on a ray beyond `far_mm`.
    fn hides(&self, ray: &Ray, far_mm: f64) -> bool {
        let in_lens_mm = self.cut.map_or(far_mm, |lens| far_mm.min(lens.leaves_mm(ray)));
        self.tubes.hidden(ray, far_mm) || self.voxels.as_ref().is_some_and(|v| v.hidden(ray, in_lens_mm))
    }

    /// Light from a random direction at a place.
    fn light(&self, at_mm: DVec3, to_eye: DVec3, phase: Phase, random: &mut Random) -> f64 {
        let ray = Ray { origin_mm: at_mm, direction: direction(phase, to_eye, random) };
        // No farther than anything lies.
        let far_mm = self.voxels.as_ref().map_or(0.0, |v| v.farthest_mm(at_mm));
        let far_mm = far_mm.max(self.tubes.farthest_mm(at_mm));
        if self.hides(&ray, far_mm) { 0.0 } else { self.through_image(&ray, random) }
    }

    /// Transmittance of what is shown of the image on a ray, by steps from a random place on.
    fn through_image(&self, ray: &Ray, random: &mut Random) -> f64 {
        let Some(KnownImage { image, medium, step_mm }) = &self.image else { return 1.0 };
        let Some((near_mm, far_mm)) = stretch_mm(medium, ray) else { return 1.0 };
        let count = ((far_mm - near_mm) / step_mm).ceil().clamp(1.0, 1e6);
        let step_mm = (far_mm - near_mm) / count;
        let first_mm = near_mm + random.unit() * step_mm;
        let mut thickness = 0.0;
        for n in 0..count as u64 {
            let at_mm = ray.origin_mm + ray.direction * (first_mm + n as f64 * step_mm);
            let here = thickness_of(medium.optics(at_mm).extinction_per_mm, step_mm);
            if here > 0.0 {
                let sight = self.sight.line_through(at_mm);
                let along_mm = at_mm.distance(sight.origin_mm);
                let is_shown = |(near, far): (f64, f64)| (near..far).contains(&along_mm);
                thickness += if image.shown_mm(&sight).is_some_and(is_shown) { here } else { 0.0 };
            }
            if thickness > OPAQUE {
                return 0.0;
            }
        }
        (-thickness).exp()
    }
}
