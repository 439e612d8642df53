//! An image at every working resolution, its intensities scaled to a robust 0 to 1.

use std::sync::Arc;

use crate::{Progress, Volume};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::{
    curve::Curve,
    exclude::{exclude, grown},
    level::{Level, finest},
    types::{Image, Options, RegisterError, Which},
};

/// Resolution of the search, mm.
const COARSEST_MM: f64 = 8.0;
/// Voxels of the finest level at most: 67 MB.
const MAX_VOXELS: f64 = 17e6;
/// Fewest voxels, and extent in mm, along every direction.
const MIN_VOXELS: usize = 4;
const MIN_EXTENT_MM: f64 = 12.0;
/// Fewest finite voxels of the level by which intensities are scaled.
const MIN_FINITE: usize = 100;
/// Quantiles that become 0 and 1.
const QUANTILES: (f64, f64) = (0.005, 0.998);
/// Bins of the foreground's threshold.
const BINS: usize = 128;

/// One image, coarse to fine.
#[derive(Clone, Debug)]
pub(crate) struct Pyramid {
    /// Coarse to fine, at the resolutions of [`schedule`].
    pub levels: Vec<Level>,
    /// How intensities are spread over bins.
    pub curve: Curve,
    /// Value above which a voxel is foreground (Otsu 1979), 0 to 1.
    pub foreground: f64,
    /// Centre of mass of the foreground, centred mm.
    pub mass_centre_mm: DVec3,
    /// Bounding box of the foreground, centred mm, and its largest distance from the origin.
    pub low_mm: DVec3,
    pub high_mm: DVec3,
    pub radius_mm: f64,
}

impl Pyramid {
    /// Its centred space turned or mirrored by an orthogonal matrix that maps axes onto axes. Shares the values.
    pub fn turned(&self, turn: DMat3) -> Self {
        let (a, b) = (turn * self.low_mm, turn * self.high_mm);
        Self {
            levels: self.levels.iter().map(|level| level.turned(turn)).collect(),
            mass_centre_mm: turn * self.mass_centre_mm,
            low_mm: a.min(b),
            high_mm: a.max(b),
            ..self.clone()
        }
    }
}

/// The finest resolution that shows anything, mm: that asked for, or that of the coarser image. Twice as fine as its voxels
/// shows nothing more.
pub(crate) fn finest_useful_mm(fixed: &Volume, moving: &Volume, options: &Options) -> f64 {
    let middle = |volume: &Volume| {
        let mut spacing = volume.grid().spacing_mm().to_array();
        spacing.sort_by(f64::total_cmp);
        spacing[1]
    };
    options.finest_mm.max(0.6 * middle(fixed).max(middle(moving)))
}

/// Resolutions worked at, mm, coarse to fine.
pub(crate) fn schedule(fixed: &Volume, moving: &Volume, options: &Options) -> Vec<f64> {
    let mut finest = finest_useful_mm(fixed, moving, options);
    for volume in [fixed, moving] {
        let spacing = volume.grid().spacing_mm();
        let voxels = |finest: f64| -> f64 {
            let dims = volume.grid().dims();
            (0..3).map(|a| dims[a] as f64 / (finest / spacing[a] + 0.05).floor().max(1.0)).product()
        };
        while voxels(finest) > MAX_VOXELS && finest < COARSEST_MM {
            finest *= 1.25;
        }
    }
    let mut resolutions = vec![finest.min(COARSEST_MM)];
    while let Some(last) = resolutions.last().copied()
        && last * 1.6 < COARSEST_MM
    {
        resolutions.push((last * 2.0).min(COARSEST_MM));
    }
    resolutions.reverse();
    resolutions
}

/// Checks an image and makes its levels.
pub(crate) fn pyramid(
    image: &Image<'_>,
    which: Which,
    resolutions: &[f64],
    margin_mm: f64,
    progress: &Progress,
) -> Result<Pyramid, RegisterError> {
    let grid = image.volume.grid();
    let spacing = grid.spacing_mm();
    for axis in 0..3 {
        let voxels = grid.dims()[axis];
        let extent_mm = voxels as f64 * spacing[axis];
        if voxels < MIN_VOXELS || extent_mm < MIN_EXTENT_MM {
            return Err(RegisterError::TooThin { which, voxels, extent_mm });
        }
    }
    let masks: Vec<_> = image.excluded.iter().filter_map(|mask| grown(mask, margin_mm)).collect();
    let centre_mm = grid.center_mm();
    let mut levels = Vec::new();
    let mut fine = resolutions.iter().rev();
    let first = fine.next().copied().unwrap_or(COARSEST_MM);
    let mut level = finest(image.volume, centre_mm, first, progress)?.ok_or(RegisterError::Empty(which))?;
    exclude(&mut level, centre_mm, &masks);
    levels.push(level);
    for resolution_mm in fine {
        if let Some(last) = levels.last() {
            let mut level = last.coarser(*resolution_mm, progress)?;
            exclude(&mut level, centre_mm, &masks);
            levels.push(level);
        }
    }
    levels.reverse();
    scaled(levels, which)
}

fn scaled(mut levels: Vec<Level>, which: Which) -> Result<Pyramid, RegisterError> {
    // The second level is fine enough for quantiles and much faster than the finest.
    let reference = levels.get(1).or(levels.first()).ok_or(RegisterError::Empty(which))?;
    let mut values: Vec<f32> = reference.values.iter().copied().filter(|v| v.is_finite()).collect();
    if values.len() < MIN_FINITE {
        return Err(RegisterError::Empty(which));
    }
    let quantile = |values: &mut [f32], q: f64| {
        let at = ((values.len() - 1) as f64 * q).round() as usize;
        f64::from(*values.select_nth_unstable_by(at, f32::total_cmp).1)
    };
    let low = quantile(&mut values, QUANTILES.0);
    let high = quantile(&mut values, QUANTILES.1);
    let range = high - low;
    let usable = range > 1e-6 * high.abs().max(low.abs()) && range.is_finite();
    if !usable {
        return Err(RegisterError::Constant(which));
    }
    for level in &mut levels {
        let scale = |v: &f32| ((f64::from(*v) - low) / range) as f32;
        level.values = Arc::new(level.values.par_iter().map(scale).collect());
    }
    let level = levels.get(1).or(levels.first()).ok_or(RegisterError::Empty(which))?;
    let foreground = otsu(&level.values);
    let centred_from_voxel = level.centred_from_voxel();
    let (mut sum, mut count, mut low_mm, mut high_mm) =
        (DVec3::ZERO, 0.0, DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (at, value) in level.values.iter().enumerate() {
        if f64::from(*value) > foreground {
            let [i, j, k] = crate::grid::ijk(level.dims, at);
            let p = centred_from_voxel.transform_point3(DVec3::new(i as f64, j as f64, k as f64));
            sum += p;
            count += 1.0;
            low_mm = low_mm.min(p);
            high_mm = high_mm.max(p);
        }
    }
    if count < 10.0 {
        return Err(RegisterError::Constant(which));
    }
    let radius_mm = low_mm.abs().max(high_mm.abs()).length();
    Ok(Pyramid {
        curve: Curve::of(&level.values),
        foreground,
        mass_centre_mm: sum / count,
        low_mm,
        high_mm,
        radius_mm,
        levels,
    })
}

/// The threshold that separates values, 0 to 1, into the two classes of largest variance between them.
fn otsu(values: &[f32]) -> f64 {
    let mut histogram = [0.0_f64; BINS];
    for v in values.iter().filter(|v| v.is_finite()) {
        let bin = (f64::from(*v).clamp(0.0, 1.0) * (BINS - 1) as f64) as usize;
        histogram[bin.min(BINS - 1)] += 1.0;
    }
    let total: f64 = histogram.iter().sum();
    let mean: f64 = histogram.iter().enumerate().map(|(i, n)| i as f64 * n).sum::<f64>() / total;
    let (mut weight, mut below, mut best, mut threshold) = (0.0, 0.0, -1.0, 0.0);
    for (i, n) in histogram.iter().enumerate().take(BINS - 1) {
        weight += n / total;
        below += i as f64 * n / total;
        let between = (mean * weight - below).powi(2) / (weight * (1.0 - weight)).max(1e-12);
        if between > best {
            best = between;
            threshold = (i as f64 + 1.0) / BINS as f64;
        }
    }
    threshold
}

/// The pose that lays the images as their headers do: `T` of centred mm for identity in RAS mm.
pub(crate) fn centred(
    moving_from_fixed: DAffine3,
    fixed_centre_mm: DVec3,
    moving_centre_mm: DVec3,
) -> DAffine3 {
    let DAffine3 { matrix3, translation } = moving_from_fixed;
    // As moving_from_fixed · fixed_centre − moving_centre, with common offsets cancelled first.
    DAffine3 { matrix3, translation: matrix3 * fixed_centre_mm - moving_centre_mm + translation }
}

/// The inverse of [`centred`].
pub(crate) fn uncentred(pose: DAffine3, fixed_centre_mm: DVec3, moving_centre_mm: DVec3) -> DAffine3 {
    let DAffine3 { matrix3, translation } = pose;
    DAffine3 { matrix3, translation: translation + moving_centre_mm - matrix3 * fixed_centre_mm }
}
