//! Ascent on normalised mutual information by BFGS over poses (Nocedal, Wright 2006, chapter 6).

use crate::{Cancelled, Progress};
use glam::{DAffine3, DVec3};

use super::{
    curve::Curve,
    level::Level,
    mutual::{Similarity, similarity},
    pair::Pair,
    pose::{HalfWay, MAX_PARAMETERS, apart_mm, half_way, parameters},
    types::Model,
};

/// Lever that makes angles comparable with millimetres.
const LEVER_MM: f64 = 60.0;
/// Most evaluations along one direction.
const MAX_HALVINGS: usize = 8;

/// What is ascended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Climb<'a> {
    pub fixed: &'a Level,
    pub moving: &'a Level,
    pub points: &'a [DVec3],
    pub bins: usize,
    /// How intensities are spread over bins: fixed, moving.
    pub curves: (&'a Curve, &'a Curve),
    pub model: Model,
    /// Length of the first step, mm.
    pub first_step_mm: f64,
    /// Step below which it ends, mm.
    pub tolerance_mm: f64,
    /// Step that may remain at the end, mm.
    pub rest_mm: f64,
    pub most_steps: usize,
    /// Radius within which steps are measured, mm.
    pub radius_mm: f64,
}

/// Where an ascent ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Climbed {
    pub pose: DAffine3,
    pub value: f64,
    pub evaluations: usize,
    /// Length of the last step, mm.
    pub last_step_mm: f64,
    pub converged: bool,
}

impl Climb<'_> {
    fn evaluate(&self, half: &HalfWay) -> Option<Similarity> {
        let pair = Pair::new(self.fixed, self.moving, half);
        similarity(&pair, self.points, self.bins, self.curves, self.model)
    }

    /// Ascends from `pose`; `None` where nothing can be measured there.
    pub fn run(&self, pose: DAffine3, progress: &Progress) -> Result<Option<Climbed>, Cancelled> {
        progress.check()?;
        let n = parameters(self.model);
        let Some(mut half) = half_way(pose, self.model) else { return Ok(None) };
        let Some(mut now) = self.evaluate(&half) else { return Ok(None) };
        let mut at =
            Climbed { pose, value: now.value, evaluations: 1, last_step_mm: f64::INFINITY, converged: false };
        // Inverse Hessian of the negated measure, in mm.
        let mut inverse = identity(n);
        let mut fresh = true;
        for _ in 0..self.most_steps {
            progress.check()?;
            let slope = scaled(&now.gradient, n);
            let mut direction = times(&inverse, &slope, n);
            if dot(&direction, &slope) <= 0.0 {
                inverse = identity(n);
                fresh = true;
                direction = slope.clone();
            }
            let length = norm(&direction);
            if !(length > 0.0 && length.is_finite()) {
                at.converged = length == 0.0;
                at.last_step_mm = 0.0;
                break;
            }
            let longest = if fresh { self.first_step_mm } else { 4.0 * self.first_step_mm };
            let scale = if fresh { longest / length } else { (longest / length).min(1.0) };
            let mut accepted = None;
            let mut factor = scale;
            for _ in 0..MAX_HALVINGS {
                let step: Vec<f64> = direction.iter().map(|d| d * factor).collect();
                let next = half.stepped(&unscaled(&step), self.model);
                at.evaluations += 1;
                if let Some(next) = next
                    && let Some(found) = self.evaluate(&next)
                    && found.value >= at.value + 1e-4 * dot(&step, &slope)
                {
                    accepted = Some((next, found, step));
                    break;
                }
                if norm(&direction) * factor < 0.5 * self.tolerance_mm {
                    break;
                }
                factor *= if fresh { 0.25 } else { 0.4 };
            }
            let Some((next, found, step)) = accepted else {
                if fresh {
                    // Not even along the slope: at rest, as far as the measure is smooth.
                    at.converged = true;
                    at.last_step_mm = at.last_step_mm.min(norm(&direction) * factor);
                    break;
                }
                inverse = identity(n);
                fresh = true;
                continue;
            };
            let Some(pose) = next.pose() else { break };
            let moved = apart_mm(at.pose, pose, self.radius_mm);
            let change: Vec<f64> =
                slope.iter().zip(scaled(&found.gradient, n)).map(|(old, new)| old - new).collect();
            update(&mut inverse, &step, &change, n, fresh);
            fresh = false;
            at = Climbed { pose, value: found.value, last_step_mm: moved, ..at };
            half = next;
            now = found;
            if moved < self.tolerance_mm {
                at.converged = true;
                break;
            }
        }
        at.converged |= at.last_step_mm < 0.2 * self.rest_mm;
        Ok(Some(at))
    }
}

fn scaled(gradient: &[f64; MAX_PARAMETERS], n: usize) -> Vec<f64> {
    (0..n).map(|i| if i < 3 { gradient[i] } else { gradient[i] / LEVER_MM }).collect()
}

fn unscaled(step: &[f64]) -> Vec<f64> {
    step.iter().enumerate().map(|(i, s)| if i < 3 { *s } else { s / LEVER_MM }).collect()
}

fn identity(n: usize) -> Vec<f64> {
    (0..n * n).map(|at| if at / n == at % n { 1.0 } else { 0.0 }).collect()
}

fn times(matrix: &[f64], x: &[f64], n: usize) -> Vec<f64> {
    matrix.chunks_exact(n).map(|row| dot(row, x)).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// BFGS's update; skipped where the curvature along the step is not positive.
fn update(inverse: &mut Vec<f64>, step: &[f64], change: &[f64], n: usize, first: bool) {
    let curvature = dot(step, change);
    if curvature <= 1e-10 * norm(step) * norm(change) {
        return;
    }
    if first {
        let scale = curvature / dot(change, change);
        *inverse = identity(n).iter().map(|v| v * scale).collect();
    }
    let h = times(inverse, change, n);
    let factor = (1.0 + dot(change, &h) / curvature) / curvature;
    for i in 0..n {
        for j in 0..n {
            inverse[i * n + j] += factor * step[i] * step[j] - (h[i] * step[j] + step[i] * h[j]) / curvature;
        }
    }
}
