//! A smooth deformation of the tissue around a lesion between two images that are aligned: cubic B-splines on a lattice.
//!
//! Rueckert et al. 1999 (IEEE TMI 18(8)): a free-form deformation with its bending energy. Here differences of intensities are
//! made small, robustly and up to a smooth gain, by Gauss-Newton steps that conjugate gradients solve, coarse to fine. What lies
//! in the lesion of either date has no part in it; the displacement there is what bends least from outside.
//!
//! # Limits
//! - It says how what the images show moved. Tissue that slides along a border, that is gone or that came is none of it.
//! - What bends within less than the lattice's spacing is smoothed.
//! - A displacement along an edge, or where nothing is shown, isn't seen: [`Deformation::uncertainty_mm`] tells.

mod fit;
mod lattice;
mod points;
mod region;
#[cfg(test)]
mod tests;
mod work;

use glam::DVec3;

use super::{
    exclude::grown,
    pyramid::schedule,
    types::{Image, Options, Which},
};
use crate::{Cancelled, Progress};
use fit::{Fit, Resolved};
use lattice::Lattice;
use points::{Shells, levels, points};
use region::{Region, around};
use work::Evidence;

/// Tissue that must be seen around a lesion at least.
const LEAST_ML: f64 = 5.0;
/// Correlation of the two images around the lesion at least, once they are fitted.
const LEAST_CORRELATION: f64 = 0.5;
/// Coarsest resolution, mm: dates are aligned, and what is left is short.
const COARSEST_MM: f64 = 4.5;
/// Distance from the lesion within which every voxel counts at a fine resolution, mm.
const NEAR_MM: f64 = 10.0;
/// Distance in lattice spacings within which what is shown tells of a displacement.
const REACH: f64 = 0.7;
/// Share of its volume that tissue keeps at least where a fit is believed.
const LEAST_RATIO: f64 = 0.1;

/// What a fit is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeformOptions {
    /// Spacing of the lattice, 4 to 64 mm.
    pub spacing_mm: f64,
    /// How far from the lesion tissue counts, 5 to 100 mm.
    pub shell_mm: f64,
    /// How far the lesion is grown before it is left out, 0 to 20 mm.
    pub margin_mm: f64,
    /// Finest resolution worked at, 0.5 to 4 mm; coarser where the images are.
    pub finest_mm: f64,
    /// Steps at each resolution at most, 1 to 100.
    pub most_steps: usize,
}

impl Default for DeformOptions {
    fn default() -> Self {
        Self { spacing_mm: 12.0, shell_mm: 25.0, margin_mm: 2.0, finest_mm: 1.0, most_steps: 10 }
    }
}

impl DeformOptions {
    fn check(&self) -> Result<(), DeformError> {
        let within = |ok: bool, what| if ok { Ok(()) } else { Err(DeformError::Options(what)) };
        within((4.0..=64.0).contains(&self.spacing_mm), "spacing_mm")?;
        within((5.0..=100.0).contains(&self.shell_mm), "shell_mm")?;
        within((0.0..=20.0).contains(&self.margin_mm), "margin_mm")?;
        within((0.5..=4.0).contains(&self.finest_mm), "finest_mm")?;
        within((1..=100).contains(&self.most_steps), "most_steps")
    }
}

/// Why nothing can be said of the tissue around a lesion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeformError {
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// An option is out of its range.
    #[error("found {0} out of its range")]
    Options(&'static str),
    /// Neither image has a mask that is left out.
    #[error("found no lesion, expected one around which tissue can be looked at")]
    NoLesion,
    /// Hardly any tissue around the lesion is in both images.
    #[error(
        "found {found_ml:.1} ml around the lesion that both images show, expected at least {LEAST_ML} ml"
    )]
    TooLittle {
        /// What is there.
        found_ml: f64,
    },
    /// An image is constant around the lesion.
    #[error("the {0} image is constant around the lesion")]
    Constant(Which),
    /// The images show nothing in common: no texture, or another contrast.
    #[error(
        "the images show too little in common around the lesion: correlation {correlation:.2}, expected at least {LEAST_CORRELATION}"
    )]
    Disagree {
        /// Correlation after the fit.
        correlation: f64,
    },
    /// The fit pressed tissue together as no tissue can be.
    #[error(
        "the fit isn't believed: it leaves {ratio:.2} of the tissue's volume at a place, expected at least {LEAST_RATIO}"
    )]
    Folds {
        /// Smallest ratio of a volume after the displacement to that before.
        ratio: f64,
    },
}

/// How the tissue around a lesion moved.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// In millimetres about `centre_mm`.
    lattice: Lattice,
    evidence: Vec<Evidence>,
    centre_mm: DVec3,
    /// Tissue that was compared.
    pub tissue_ml: f64,
    /// Correlation of the images there, before the fit and after it.
    pub correlations: [f64; 2],
    /// Gauss-Newton steps, all resolutions together.
    pub steps: usize,
    /// Resolution of the last fit.
    pub finest_mm: f64,
}

impl Deformation {
    /// How what lies at a place of the fixed image moved to where the moving image shows it, RAS+ millimetres.
    pub fn by_mm(&self, at_mm: DVec3) -> DVec3 {
        self.lattice.at(at_mm - self.centre_mm)
    }

    /// Standard deviation of the displacement at a place along a unit vector, by what the images show near it and
    /// how far they disagree there; `None` where they show nothing in common.
    pub fn uncertainty_mm(&self, at_mm: DVec3, along: DVec3) -> Option<f64> {
        let reach_mm = REACH * self.lattice.spacing_mm();
        let near = self.lattice.cells_near(at_mm - self.centre_mm, reach_mm);
        let mut all = Evidence::NONE;
        near.for_each(|cell| all.add(&self.evidence[cell]));
        all.deviation_mm(along)
    }
}

/// Finds how the tissue around the excluded masks moved from `fixed` to `moving`. Both lie in one space, aligned.
///
/// # Errors
/// [`DeformError`].
pub fn deform(
    fixed: &Image<'_>,
    moving: &Image<'_>,
    options: &DeformOptions,
    progress: &Progress,
) -> Result<Deformation, DeformError> {
    options.check()?;
    let masks = || fixed.excluded.iter().chain(moving.excluded);
    let within = |mm: f64| masks().filter_map(|mask| grown(mask, mm)).collect::<Vec<_>>();
    let shells = Shells { whole: within(options.shell_mm), near: within(options.shell_mm.min(NEAR_MM)) };
    let Region { low_mm, high_mm } =
        Region::of(&shells.whole, fixed.volume.grid()).ok_or(DeformError::NoLesion)?;
    let centre_mm = 0.5 * (low_mm + high_mm);
    let region = Region { low_mm, high_mm };
    let images = [fixed, moving].map(|image| around(image, &region, options.margin_mm));
    let [Some(fixed), Some(moving)] = images else { return Err(DeformError::TooLittle { found_ml: 0.0 }) };
    let wanted = Options { finest_mm: options.finest_mm, ..Options::default() };
    let mut resolutions = schedule(&fixed, &moving, &wanted);
    let last = resolutions.len() - 1;
    resolutions = resolutions
        .into_iter()
        .enumerate()
        .filter(|(n, mm)| *n == last || *mm <= COARSEST_MM)
        .map(|(_, mm)| mm)
        .collect();
    progress.expect((resolutions.len() * options.most_steps) as u64);
    let at_each = |volume| levels(volume, centre_mm, &resolutions, progress);
    let (fixed, moving) = (at_each(&fixed)?, at_each(&moving)?);
    let lattice = Lattice::over(low_mm - centre_mm, high_mm - centre_mm, options.spacing_mm);
    let still = Fit::new(lattice.clone(), 0);
    let mut fit = Fit::new(lattice, options.most_steps);
    let mut before = 0.0;
    let mut done: Option<Resolved> = None;
    let mut steps = 0;
    for ((fixed, moving), resolution_mm) in fixed.iter().zip(&moving).zip(&resolutions) {
        let points = points(fixed, &fit.lattice, &shells, *resolution_mm, centre_mm);
        let found_ml = points.volume_ml();
        if found_ml < LEAST_ML {
            return Err(DeformError::TooLittle { found_ml });
        }
        let resolved = fit.run(&points, moving, *resolution_mm, progress)?;
        steps += resolved.steps;
        before = still.correlation(&points, moving)?;
        done = Some(resolved);
    }
    let done = done.ok_or(DeformError::NoLesion)?;
    let correlation = done.correlation;
    if correlation.is_nan() || correlation < LEAST_CORRELATION {
        return Err(DeformError::Disagree { correlation });
    }
    if done.least_ratio < LEAST_RATIO {
        return Err(DeformError::Folds { ratio: done.least_ratio });
    }
    Ok(Deformation {
        lattice: fit.lattice,
        evidence: done.evidence,
        centre_mm,
        tissue_ml: done.tissue_ml,
        correlations: [before, correlation],
        steps,
        finest_mm: *resolutions.last().unwrap_or(&options.finest_mm),
    })
}
