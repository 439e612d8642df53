//! Normalised mutual information with B-spline Parzen windows, and its exact derivative.
//!
//! Studholme, Hill, Hawkes 1999 for `(H(F) + H(M)) / H(F, M)`, which overlaps of different sizes sway less than mutual
//! information; Mattes et al. 2003 and Thévenaz, Unser 2000 for the windows. Both images have a cubic window, so that
//! neither is treated differently.

use glam::DVec3;
use rayon::prelude::*;

use super::{
    curve::Curve,
    pair::{Pair, Sample, enough},
    pose::MAX_PARAMETERS,
    types::Model,
};

/// Parts into which points are divided, whatever the number of threads: sums are the same on every machine.
const PARTS: usize = 24;
/// Share of the points at which both images must count.
const MIN_SHARE: f64 = 0.05;

/// Measure and derivative with respect to a step in the half-way space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Similarity {
    /// 1 to 2.
    pub value: f64,
    pub gradient: [f64; MAX_PARAMETERS],
}

/// First bin and weights (or their derivatives per bin) of the four bins that a value counts in.
#[inline]
fn window(spread: f64, bins: usize) -> (usize, [f64; 4], f64) {
    let clamped = spread.clamp(0.0, 1.0 - 1e-9);
    let u = 1.0 + clamped * (bins - 3) as f64;
    let low = u.floor();
    let t = u - low;
    let s = 1.0 - t;
    let weights = [
        s * s * s / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        t * t * t / 6.0,
    ];
    (low as usize - 1, weights, t)
}

/// Derivatives of the window's weights by the value, of which the curve has the slope `scale`.
#[inline]
fn slopes(slope: f64, t: f64, bins: usize) -> [f64; 4] {
    let s = 1.0 - t;
    let scale = slope * (bins - 3) as f64;
    [
        -0.5 * s * s * scale,
        (1.5 * t * t - 2.0 * t) * scale,
        (2.0 * s - 1.5 * s * s) * scale,
        0.5 * t * t * scale,
    ]
}

/// A part of the points: its joint histogram, and what counts in both images.
type Part = (Vec<f64>, Vec<(DVec3, Sample)>);

/// The joint histogram's entropies.
struct Table {
    /// `NMI`.
    value: f64,
    /// Derivative of the measure by the probability of each pair of bins, over the number of samples.
    by_cell: Vec<f64>,
}

fn table(histogram: &[f64], bins: usize, count: f64) -> Option<Table> {
    let p: Vec<f64> = histogram.iter().map(|n| n / count).collect();
    let mut fixed = vec![0.0; bins];
    let mut moving = vec![0.0; bins];
    for (k, row) in p.chunks_exact(bins).enumerate() {
        for (l, v) in row.iter().enumerate() {
            fixed[k] += v;
            moving[l] += v;
        }
    }
    let log = |v: f64| if v > 1e-300 { v.ln() } else { 0.0 };
    let entropy = |p: &[f64]| -> f64 { -p.iter().map(|v| v * log(*v)).sum::<f64>() };
    let joint = entropy(&p);
    let marginals = entropy(&fixed) + entropy(&moving);
    let usable = joint > 1e-9;
    if !usable {
        return None;
    }
    let value = marginals / joint;
    let by_cell = p
        .iter()
        .enumerate()
        .map(|(at, v)| (value * log(*v) - log(fixed[at / bins]) - log(moving[at % bins])) / joint / count)
        .collect();
    Some(Table { value, by_cell })
}

fn part_size(points: usize) -> usize {
    points.div_ceil(PARTS).max(64)
}

/// The measure alone; `None` where too few points count in both images.
pub(crate) fn value(pair: &Pair<'_>, points: &[DVec3], bins: usize, curves: (&Curve, &Curve)) -> Option<f64> {
    let mut histogram = vec![0.0; bins * bins];
    let mut count = 0;
    for x in points {
        if let Some(sample) = pair.at(*x) {
            add(&mut histogram, &sample, bins, curves);
            count += 1;
        }
    }
    if !enough(count) || (count as f64) < MIN_SHARE * points.len() as f64 {
        return None;
    }
    table(&histogram, bins, count as f64).map(|t| t.value)
}

fn add(histogram: &mut [f64], sample: &Sample, bins: usize, curves: (&Curve, &Curve)) {
    let (k, fixed, _) = window(curves.0.at(sample.fixed.value).0, bins);
    let (l, moving, _) = window(curves.1.at(sample.moving.value).0, bins);
    for (row, f) in fixed.iter().enumerate() {
        let start = (k + row) * bins + l;
        for (cell, m) in histogram[start..start + 4].iter_mut().zip(moving) {
            *cell += f * m;
        }
    }
}

/// The measure and its derivative; `None` where too few points count in both images.
pub(crate) fn similarity(
    pair: &Pair<'_>,
    points: &[DVec3],
    bins: usize,
    curves: (&Curve, &Curve),
    model: Model,
) -> Option<Similarity> {
    let size = part_size(points.len());
    let parts: Vec<Part> = points
        .par_chunks(size)
        .map(|points| {
            let mut histogram = vec![0.0; bins * bins];
            let samples: Vec<(DVec3, Sample)> =
                points.iter().filter_map(|x| pair.at(*x).map(|sample| (*x, sample))).collect();
            samples.iter().for_each(|(_, sample)| add(&mut histogram, sample, bins, curves));
            (histogram, samples)
        })
        .collect();
    let count: usize = parts.iter().map(|(_, samples)| samples.len()).sum();
    if !enough(count) || (count as f64) < MIN_SHARE * points.len() as f64 {
        return None;
    }
    let mut histogram = vec![0.0; bins * bins];
    for (part, _) in &parts {
        histogram.iter_mut().zip(part).for_each(|(sum, n)| *sum += n);
    }
    let table = table(&histogram, bins, count as f64)?;
    let gradients: Vec<[f64; MAX_PARAMETERS]> =
        parts.par_iter().map(|(_, samples)| gradient(samples, &table.by_cell, bins, curves, model)).collect();
    let mut gradient = [0.0; MAX_PARAMETERS];
    for part in gradients {
        gradient.iter_mut().zip(part).for_each(|(sum, g)| *sum += g);
    }
    Some(Similarity { value: table.value, gradient })
}

fn gradient(
    samples: &[(DVec3, Sample)],
    by_cell: &[f64],
    bins: usize,
    curves: (&Curve, &Curve),
    model: Model,
) -> [f64; MAX_PARAMETERS] {
    let mut sum = [0.0; MAX_PARAMETERS];
    for (x, sample) in samples {
        let (fixed, fixed_slope) = curves.0.at(sample.fixed.value);
        let (moving, moving_slope) = curves.1.at(sample.moving.value);
        let (k, fixed, tf) = window(fixed, bins);
        let (l, moving, tm) = window(moving, bins);
        let fixed_slopes = slopes(fixed_slope, tf, bins);
        let moving_slopes = slopes(moving_slope, tm, bins);
        let (mut by_fixed, mut by_moving) = (0.0, 0.0);
        for row in 0..4 {
            let start = (k + row) * bins + l;
            let cells = &by_cell[start..start + 4];
            let dot = |w: &[f64; 4]| cells[0] * w[0] + cells[1] * w[1] + cells[2] * w[2] + cells[3] * w[3];
            by_fixed += fixed_slopes[row] * dot(&moving);
            by_moving += fixed[row] * dot(&moving_slopes);
        }
        // A step moves the two points by half of it, in opposite directions.
        let v = (sample.moving.gradient * by_moving - sample.fixed.gradient * by_fixed) * 0.5;
        let row = jacobian(v, *x, model);
        sum.iter_mut().zip(row).for_each(|(sum, g)| *sum += g);
    }
    sum
}

/// Derivative by the pose's parameters of what changes by `v` per mm at `x`.
#[inline]
pub(crate) fn jacobian(v: DVec3, x: DVec3, model: Model) -> [f64; MAX_PARAMETERS] {
    match model {
        Model::Rigid => {
            let r = x.cross(v);
            [v.x, v.y, v.z, r.x, r.y, r.z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        }
        Model::Affine => {
            let (a, b, c) = (x * v.x, x * v.y, x * v.z);
            [v.x, v.y, v.z, a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]
        }
    }
}
