//! Two images compared at a displacement: residuals after a smooth gain, their spread, what cells tell.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    DeformError,
    points::{Point, Points},
};
use crate::register::{level::Level, pose::solve, types::Which};

/// Points summed together: fixed, so that sums don't depend on the number of threads.
const PART: usize = 4096;
/// Scale of Cauchy's weights in standard deviations: 95 % efficient for normal residuals.
const CAUCHY: f64 = 2.385;
/// A median absolute deviation's standard deviation.
const MAD: f64 = 1.4826;
/// Scale of residuals at least, of the intensities' range.
const MIN_SCALE: f64 = 0.01;
/// Value above which an image shows something, of its tissue's range.
const BACKGROUND: f64 = 0.05;
/// Share of what differences tell by their noise that is believed: most of what differs in real images isn't noise.
pub(crate) const BELIEVED: f64 = 0.2;
/// Coefficients of the gain: a polynomial of degree 2, and an offset.
const GAIN: usize = 11;
pub(crate) type Gain = [f64; GAIN];
/// Quantiles of the tissue that become 0 and 1.
const QUANTILES: [f64; 2] = [0.02, 0.98];

/// What a cell tells of the displacement in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// Sum of products of the two images' gradients, per mm²: what only one of them has, as noise, cancels.
    common: DMat3,
    /// Weighted squared residuals, and weights.
    squares: f64,
    weights: f64,
    /// Voxels in a point spread.
    alike: f64,
}

impl Evidence {
    /// Of nothing. A matrix's default is the identity.
    pub const NONE: Self = Self { common: DMat3::ZERO, squares: 0.0, weights: 0.0, alike: 0.0 };

    pub fn add(&mut self, other: &Self) {
        self.common += other.common;
        self.squares += other.squares;
        self.weights += other.weights;
        self.alike = self.alike.max(other.alike);
    }

    /// Standard deviation of a displacement along a unit vector; `None` where nothing common is shown.
    pub fn deviation_mm(&self, along: DVec3) -> Option<f64> {
        let common = along.dot(self.common * along);
        let variance = (self.squares / self.weights).max(MIN_SCALE * MIN_SCALE);
        (self.weights > 0.0 && common > 0.0).then(|| (variance * self.alike / (BELIEVED * common)).sqrt())
    }
}

/// The moving image at a point.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    pub value: f64,
    /// Per mm.
    pub gradient: DVec3,
}
/// One resolution's images, scaled.
pub(crate) struct Work<'a> {
    pub points: &'a Points,
    pub moving: &'a Level,
    /// Lower end and range of each image.
    pub scales: [[f64; 2]; 2],
    /// Half the extent of the points.
    extent_mm: DVec3,
}

impl<'a> Work<'a> {
    pub fn new(points: &'a Points, moving: &'a Level) -> Result<Self, DeformError> {
        let extent_mm = points.list.iter().fold(DVec3::ONE, |most, p| most.max(p.at_mm.abs()));
        let fixed: Vec<f64> = points.list.iter().map(|p| p.value).collect();
        let seen = moving.values.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
        let scales = [
            scale_of(fixed).ok_or(DeformError::Constant(Which::Fixed))?,
            scale_of(seen).ok_or(DeformError::Constant(Which::Moving))?,
        ];
        Ok(Self { points, moving, scales, extent_mm })
    }

    /// The fixed image's value at point `n`, scaled.
    fn value(&self, n: usize) -> f64 {
        let [[low, range], _] = self.scales;
        (self.points.list[n].value - low) / range
    }

    fn basis(&self, n: usize, moving: f64) -> [f64; GAIN] {
        let p = self.points.list[n].at_mm / self.extent_mm;
        let second = |t: f64| 1.5 * t * t - 0.5;
        let factors =
            [1.0, p.x, p.y, p.z, second(p.x), second(p.y), second(p.z), p.x * p.y, p.x * p.z, p.y * p.z];
        let mut all = [1.0; GAIN];
        all.iter_mut().zip(factors).for_each(|(out, factor)| *out = factor * moving);
        all
    }

    /// The gain and offset that the moving image needs, robustly; none where they can't be told.
    pub fn gain(&self, seen: &[Option<Seen>]) -> Gain {
        let mut gain = [0.0; GAIN];
        gain[0] = 1.0;
        let mut scale = f64::INFINITY;
        for _ in 0..3 {
            let part = |(part, seen): (usize, &[Option<Seen>])| {
                let mut sum = vec![0.0; GAIN * GAIN + GAIN];
                for (n, seen) in (part * PART..).zip(seen) {
                    let Some(seen) = seen else { continue };
                    let (row, f) = (self.basis(n, seen.value), self.value(n));
                    let fitted: f64 = row.iter().zip(&gain).map(|(b, c)| b * c).sum();
                    let weight = cauchy(f - fitted, scale);
                    for i in 0..GAIN {
                        let left = weight * row[i];
                        sum[i * GAIN..=i * GAIN + i].iter_mut().zip(&row).for_each(|(s, v)| *s += left * v);
                        sum[GAIN * GAIN + i] += left * f;
                    }
                }
                sum
            };
            let parts: Vec<Vec<f64>> = seen.par_chunks(PART).enumerate().map(part).collect();
            let mut sum = vec![0.0; GAIN * GAIN + GAIN];
            for part in &parts {
                sum.iter_mut().zip(part).for_each(|(s, v)| *s += v);
            }
            let mean = (0..GAIN).map(|i| sum[i * GAIN + i]).sum::<f64>() / GAIN as f64;
            (0..GAIN).for_each(|i| sum[i * GAIN + i] += 1e-9 * mean);
            let (matrix, right) = sum.split_at(GAIN * GAIN);
            let Some(found) = solve(matrix, right) else { break };
            gain.copy_from_slice(&found);
            scale = self.spread(&self.residuals(seen, &gain));
        }
        gain
    }

    /// Fixed minus moving after the gain, and the gain.
    pub fn residuals(&self, seen: &[Option<Seen>], gain: &Gain) -> Vec<Option<(f64, f64)>> {
        let of = |(n, seen): (usize, &Option<Seen>)| {
            let seen = seen.as_ref()?;
            let basis = self.basis(n, 1.0);
            let factor: f64 = basis.iter().zip(gain).take(GAIN - 1).map(|(b, c)| b * c).sum();
            Some((self.value(n) - factor * seen.value - gain[GAIN - 1], factor))
        };
        seen.par_iter().enumerate().map(of).collect()
    }

    /// The two images' values of residuals where either shows more than background, whose differences are small whatever moves.
    fn shown(&self, residuals: &[Option<(f64, f64)>]) -> impl Iterator<Item = [f64; 2]> {
        let values = residuals.iter().enumerate().filter_map(|(at, residual)| {
            let f = self.value(at);
            residual.as_ref().map(|(r, _)| [f, f - r])
        });
        values.filter(|[f, m]| f.max(*m) > BACKGROUND)
    }

    /// Standard deviation of residuals, by their median.
    pub fn spread(&self, residuals: &[Option<(f64, f64)>]) -> f64 {
        let mut values: Vec<f64> = self.shown(residuals).map(|[f, m]| (f - m).abs()).collect();
        if values.is_empty() {
            return 1.0;
        }
        let middle = values.len() / 2;
        (MAD * *values.select_nth_unstable_by(middle, f64::total_cmp).1).max(MIN_SCALE)
    }

    /// Correlation of the fixed image and the moving one after the gain, where both show more than background.
    pub fn correlation(&self, seen: &[Option<Seen>], gain: &Gain) -> f64 {
        let (mut n, mut sf, mut sm, mut ff, mut mm, mut fm) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        let residuals = self.residuals(seen, gain);
        for [f, m] in self.shown(&residuals).filter(|[f, m]| f.min(*m) > BACKGROUND) {
            (n, sf, sm) = (n + 1.0, sf + f, sm + m);
            (ff, mm, fm) = (ff + f * f, mm + m * m, fm + f * m);
        }
        let (vf, vm) = (ff - sf * sf / n, mm - sm * sm / n);
        if vf > 0.0 && vm > 0.0 { (fm - sf * sm / n) / (vf * vm).sqrt() } else { 0.0 }
    }
}

/// What a point tells.
pub(crate) fn of_point(
    point: &Point,
    seen: Seen,
    (r, gain): (f64, f64),
    work: &Work<'_>,
    scale: f64,
    alike: f64,
) -> Evidence {
    let [[_, range], _] = work.scales;
    let (f, m) = (point.gradient / range, seen.gradient * gain);
    let weight = point.share * cauchy(r, scale);
    let product = DMat3::from_cols(f * m.x, f * m.y, f * m.z);
    Evidence {
        common: (product + product.transpose()) * (0.5 * weight),
        squares: weight * r * r,
        weights: weight,
        alike,
    }
}

/// By how much more residuals cost than before, by Cauchy's weights: over the points seen both times, as what comes into sight from
/// within a lesion isn't aligned yet and must not hold the step back that shows it.
pub(crate) fn costlier(
    points: &Points,
    before: &[Option<(f64, f64)>],
    after: &[Option<(f64, f64)>],
    scale: f64,
) -> f64 {
    let unit = CAUCHY * scale;
    let rho = |r: f64| 0.5 * CAUCHY * CAUCHY * (r / unit).powi(2).ln_1p();
    let all = before.iter().zip(after).zip(&points.list);
    let both = all.filter_map(|((before, after), point)| {
        let ((before, _), (after, _)) = (before.as_ref()?, after.as_ref()?);
        Some(point.share * (rho(*after) - rho(*before)))
    });
    both.sum()
}

/// Weight of a residual at a standard deviation.
#[inline]
pub(crate) fn cauchy(r: f64, scale: f64) -> f64 {
    1.0 / (1.0 + (r / (CAUCHY * scale)).powi(2))
}

pub(crate) fn root_mean_square(residuals: &[Option<(f64, f64)>]) -> f64 {
    let (sum, count) = residuals.iter().flatten().fold((0.0, 0.0), |(sum, n), (r, _)| (sum + r * r, n + 1.0));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Lower end and range of an image's tissue; `None` for a constant one.
fn scale_of(mut values: Vec<f64>) -> Option<[f64; 2]> {
    let last = values.len().checked_sub(1)?;
    let [low, high] = QUANTILES.map(|q| {
        let at = (last as f64 * q).round() as usize;
        *values.select_nth_unstable_by(at, f64::total_cmp).1
    });
    let range = high - low;
    (range > 1e-6 * high.abs().max(low.abs()) && range.is_finite()).then_some([low, range])
}
