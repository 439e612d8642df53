//! Differences of intensities, robust and symmetric, with a smooth gain: iterated reweighted least squares.
//!
//! Reuter, Rosas, Fischl 2010: residuals in the half-way space, weighted by Tukey's biweight. Instead of their one
//! factor a smooth gain is estimated with the pose, the exponential of a polynomial over the field, so that a bias field
//! doesn't pull. The residual is `M e^{s/2} − F e^{−s/2}`: exchanging the images negates `s` and the residual.

use crate::{Cancelled, Progress};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{
    level::Level,
    mutual::jacobian,
    pair::{Pair, enough},
    pose::{HalfWay, apart_mm, half_way, parameters, solve},
    types::Model,
};

/// Points summed together: fixed, so that sums don't depend on the number of threads.
const PART: usize = 4096;
/// Residuals beyond this many standard deviations don't count: 95 % efficient for normal ones.
const TUKEY: f64 = 4.685;
/// A median absolute deviation's standard deviation.
const MAD: f64 = 1.4826;
/// Value of either image above which a point tells the scale of residuals.
const BACKGROUND: f64 = 0.05;
/// Relative change of the cost that points at the border of a field make, by entering and leaving.
const COST_NOISE: f64 = 1e-6;
/// Scale of residuals at least, of the intensities' range.
const MIN_SCALE: f64 = 1e-7;
/// Share of the normal matrix's mean that keeps the gain's coefficients small.
const RIDGE: f64 = 1e-4;

/// What is minimised.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit<'a> {
    pub fixed: &'a Level,
    pub moving: &'a Level,
    pub points: &'a [DVec3],
    pub model: Model,
    /// Degree of the gain's polynomial, 0 to 3.
    pub degree: usize,
    /// Radius within which steps are measured and that scales the polynomial, mm.
    pub radius_mm: f64,
    pub tolerance_mm: f64,
    /// Step that may remain where none lowers the cost any more, mm.
    pub rest_mm: f64,
    pub most_steps: usize,
    /// Mean value above which a point counts for the correlation.
    pub foreground: f64,
}

/// Where a fit ended.
#[derive(Clone, Debug)]
pub(crate) struct Fitted {
    pub pose: DAffine3,
    /// Coefficients of the gain.
    pub gain: Vec<f64>,
    /// Share of the points in the foreground that don't count.
    pub outlier_share: f64,
    /// Correlation of the images where they count, after the gain.
    pub correlation: f64,
    pub evaluations: usize,
    pub last_step_mm: f64,
    pub converged: bool,
}

/// What is known at a point; `None`: doesn't count in both images.
#[derive(Clone, Copy, Debug)]
struct Residual {
    x: DVec3,
    /// `M e^{s/2} − F e^{−s/2}`.
    value: f64,
    /// Its change per mm of a step.
    slope: DVec3,
    /// The two images' mean after the gain: the residual's change by `s`.
    mean: f64,
}

/// Number of coefficients of a polynomial of this total degree in three variables.
pub(crate) fn coefficients(degree: usize) -> usize {
    (degree + 1) * (degree + 2) * (degree + 3) / 6
}

/// Products of Legendre polynomials of a total degree of at most 3, lower degrees first.
#[inline]
fn basis(p: DVec3) -> [f64; 20] {
    let second = |t: f64| 1.5 * t * t - 0.5;
    let third = |t: f64| (2.5 * t * t - 1.5) * t;
    let (x, y, z) = (p.x, p.y, p.z);
    let (x2, y2, z2) = (second(x), second(y), second(z));
    let quadratic = [x2, y2, z2, x * y, x * z, y * z];
    let cubic = [third(x), third(y), third(z), x2 * y, x2 * z, y2 * x, y2 * z, z2 * x, z2 * y, x * y * z];
    let mut all = [0.0; 20];
    all[..4].copy_from_slice(&[1.0, x, y, z]);
    all[4..10].copy_from_slice(&quadratic);
    all[10..].copy_from_slice(&cubic);
    all
}

impl Fit<'_> {
    fn residuals(&self, half: &HalfWay, gain: &[f64]) -> Option<Vec<Residual>> {
        let pair = Pair::new(self.fixed, self.moving, half);
        let at = |x: &DVec3| {
            let sample = pair.at(*x)?;
            let basis = basis(*x / self.radius_mm);
            let s: f64 = gain.iter().zip(basis).map(|(c, b)| c * b).sum();
            let up = (0.5 * s).exp();
            let (f, m) = (sample.fixed.value / up, sample.moving.value * up);
            let slope = (sample.moving.gradient * up + sample.fixed.gradient / up) * 0.5;
            Some(Residual { x: *x, value: m - f, slope, mean: 0.5 * (f + m) })
        };
        let parts: Vec<Vec<Residual>> =
            self.points.par_chunks(PART).map(|points| points.iter().filter_map(at).collect()).collect();
        let all = parts.concat();
        enough(all.len()).then_some(all)
    }

    /// Fits from `pose` and `gain` (empty: none yet); `None` where nothing can be measured.
    pub fn run(
        &self,
        pose: DAffine3,
        gain: &[f64],
        progress: &Progress,
    ) -> Result<Option<Fitted>, Cancelled> {
        progress.check()?;
        let k = coefficients(self.degree);
        let mut gain = gain.to_vec();
        gain.resize(k, 0.0);
        let Some(mut half) = half_way(pose, self.model) else { return Ok(None) };
        let Some(mut now) = self.residuals(&half, &gain) else { return Ok(None) };
        let mut at = Fitted {
            pose,
            gain,
            outlier_share: 0.0,
            correlation: 0.0,
            evaluations: 1,
            last_step_mm: f64::INFINITY,
            converged: false,
        };
        for _ in 0..self.most_steps {
            progress.check()?;
            let scale = scale_of(&now);
            let Some(step) = self.step(&now, scale) else { break };
            let old_cost = cost(&now, scale);
            let n = parameters(self.model);
            let mut factor = 1.0;
            let mut accepted = None;
            for _ in 0..6 {
                let scaled: Vec<f64> = step.iter().map(|s| s * factor).collect();
                let gain: Vec<f64> = at.gain.iter().zip(&scaled[n..]).map(|(c, s)| c + s).collect();
                at.evaluations += 1;
                if let Some(next) = half.stepped(&scaled[..n], self.model)
                    && let Some(found) = self.residuals(&next, &gain)
                    && cost(&found, scale) <= old_cost * (1.0 + COST_NOISE)
                {
                    accepted = Some((next, gain, found));
                    break;
                }
                factor *= 0.4;
            }
            let Some((next, gain, found)) = accepted else {
                // No step along a descent direction lowers the cost: at rest, as far as it is smooth.
                let smallest = half.stepped(&step[..n], self.model).and_then(|half| half.pose());
                at.last_step_mm = smallest.map_or(f64::INFINITY, |p| apart_mm(at.pose, p, self.radius_mm));
                at.converged = at.last_step_mm < self.rest_mm;
                break;
            };
            let Some(pose) = next.pose() else { break };
            at.last_step_mm = apart_mm(at.pose, pose, self.radius_mm);
            (at.pose, at.gain, half) = (pose, gain, next);
            now = found;
            if at.last_step_mm < self.tolerance_mm {
                at.converged = true;
                break;
            }
        }
        at.converged |= at.last_step_mm < 0.2 * self.rest_mm;
        (at.outlier_share, at.correlation) = quality(&now, self.foreground);
        Ok(Some(at))
    }

    /// The Gauss-Newton step of pose and gain.
    fn step(&self, residuals: &[Residual], scale: f64) -> Option<Vec<f64>> {
        let n = parameters(self.model);
        let k = coefficients(self.degree);
        let size = n + k;
        let parts: Vec<Vec<f64>> =
            residuals.par_chunks(PART).map(|part| self.normal_part(part, scale, n, k)).collect();
        let mut sum = vec![0.0; size * size + size];
        for part in &parts {
            sum.iter_mut().zip(part).for_each(|(sum, v)| *sum += v);
        }
        let (matrix, right) = sum.split_at_mut(size * size);
        let mean_of = |matrix: &[f64], range: std::ops::Range<usize>| {
            let count = range.len().max(1) as f64;
            range.map(|i| matrix[i * size + i]).sum::<f64>() / count
        };
        let gain_ridge = RIDGE * mean_of(matrix, n..size);
        for i in 0..size {
            matrix[i * size + i] += if i < n { 1e-12 * matrix[i * size + i] } else { gain_ridge };
        }
        right.iter_mut().for_each(|r| *r = -*r);
        solve(matrix, right)
    }

    fn normal_part(&self, part: &[Residual], scale: f64, n: usize, k: usize) -> Vec<f64> {
        let size = n + k;
        let mut sum = vec![0.0; size * size + size];
        let mut row = [0.0; 32];
        for r in part {
            let weight = tukey(r.value / scale);
            if weight == 0.0 {
                continue;
            }
            row[..n].copy_from_slice(&jacobian(r.slope, r.x, self.model)[..n]);
            for (out, b) in row[n..size].iter_mut().zip(basis(r.x / self.radius_mm)) {
                *out = b * r.mean;
            }
            for i in 0..size {
                let left = weight * row[i];
                let start = i * size;
                sum[start..=start + i].iter_mut().zip(&row).for_each(|(sum, v)| *sum += left * v);
                sum[size * size + i] += left * r.value;
            }
        }
        sum
    }
}

#[inline]
fn tukey(t: f64) -> f64 {
    let u = t / TUKEY;
    if u.abs() >= 1.0 { 0.0 } else { (1.0 - u * u).powi(2) }
}

/// Standard deviation of the residuals that aren't outliers, from those where an image shows something.
fn scale_of(residuals: &[Residual]) -> f64 {
    let mut values: Vec<f64> =
        residuals.iter().filter(|r| r.mean.abs() > BACKGROUND).map(|r| r.value.abs()).collect();
    if values.is_empty() {
        return 1.0;
    }
    let middle = values.len() / 2;
    (MAD * *values.select_nth_unstable_by(middle, f64::total_cmp).1).max(MIN_SCALE)
}

/// Mean of Tukey's ρ, 0 to 1.
fn cost(residuals: &[Residual], scale: f64) -> f64 {
    let rho = |r: &Residual| {
        let u = r.value / scale / TUKEY;
        if u.abs() >= 1.0 { 1.0 } else { 1.0 - (1.0 - u * u).powi(3) }
    };
    residuals.chunks(PART).map(|part| part.iter().map(rho).sum::<f64>()).sum::<f64>() / residuals.len() as f64
}

/// Share of outliers within both foregrounds, and the correlation of the images there.
fn quality(residuals: &[Residual], foreground: f64) -> (f64, f64) {
    let scale = scale_of(residuals);
    let (mut all, mut out) = (0.0, 0.0);
    let (mut sf, mut sm, mut ff, mut mm, mut fm) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for r in residuals {
        let (f, m) = (r.mean - 0.5 * r.value, r.mean + 0.5 * r.value);
        // Within both foregrounds: that both have a background tells nothing of their contrast.
        if f.min(m) < foreground {
            continue;
        }
        all += 1.0;
        if tukey(r.value / scale) == 0.0 {
            out += 1.0;
        }
        sf += f;
        sm += m;
        ff += f * f;
        mm += m * m;
        fm += f * m;
    }
    if all == 0.0 {
        return (0.0, 0.0);
    }
    let (vf, vm) = (ff - sf * sf / all, mm - sm * sm / all);
    let correlation = if vf > 0.0 && vm > 0.0 { (fm - sf * sm / all) / (vf * vm).sqrt() } else { 0.0 };
    (out / all, correlation)
}
