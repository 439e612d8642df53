//! Gauss-Newton steps of a lattice: differences of intensities by Cauchy's weights, a smooth gain, conjugate gradients.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    DeformError,
    lattice::{BENDING_DIAGONAL, Lattice},
    points::{Point, Points},
    work::{BELIEVED, Evidence, Seen, Work, cauchy, costlier, of_point, root_mean_square},
};
use crate::{Cancelled, Progress, register::level::Level};

/// Volume of a level's point spread in cubes of its resolution: values within it are one measurement. `(0.6·√(4π))³`.
const ALIKE: f64 = 9.62;
/// Bending that is usual, per mm: 3 mm that fade over 20 mm.
const CURVATURE_PER_MM: f64 = 0.03;
/// Displacement that is usual, mm: holds what no data does.
const USUAL_MM: f64 = 10.0;
/// By how much the residuals' scale becomes smaller with each step, until it is their own.
const TOLERANCE_STEP: f64 = 0.6;
/// Steps shorter than this share of the resolution end a level.
const SETTLED: f64 = 0.01;
const MOST_CONJUGATE: usize = 80;
const CONJUGATE_RESIDUAL: f64 = 1e-3;

/// What a resolution ended with.
pub(crate) struct Resolved {
    pub correlation: f64,
    pub evidence: Vec<Evidence>,
    pub tissue_ml: f64,
    pub least_ratio: f64,
    pub steps: usize,
}

/// The lattice that is fitted.
pub(crate) struct Fit {
    pub lattice: Lattice,
    most_steps: usize,
}

/// What is known at a displacement.
struct State {
    seen: Vec<Option<Seen>>,
    /// Fixed minus moving after the gain, and the gain.
    residuals: Vec<Option<(f64, f64)>>,
}

impl Fit {
    pub fn new(lattice: Lattice, most_steps: usize) -> Self {
        Self { lattice, most_steps }
    }

    /// Fits at one resolution, from where the lattice is.
    pub fn run(
        &mut self,
        points: &Points,
        moving: &Level,
        resolution_mm: f64,
        progress: &Progress,
    ) -> Result<Resolved, DeformError> {
        let work = Work::new(points, moving)?;
        let alike = (ALIKE * resolution_mm.powi(3) / points.voxel_mm3).max(1.0);
        let mut seen = self.seen(&work);
        let mut gain = work.gain(&seen);
        let mut steps = 0;
        // From where all residuals count to where only those as small as most do: tissue that isn't aligned yet is no outlier.
        let mut tolerant = 2.0 * root_mean_square(&work.residuals(&seen, &gain));
        for step in 0..self.most_steps {
            progress.check()?;
            let residuals = work.residuals(&seen, &gain);
            let own = work.spread(&residuals);
            let scale = tolerant.max(own);
            tolerant *= TOLERANCE_STEP;
            let state = State { seen, residuals };
            let held = self.held_energy();
            let change = self.step(&work, &state, scale, alike, progress)?;
            let old = self.lattice.coefficients.clone();
            let longest = points.ends.iter().map(|(cell, _)| change.1[*cell].length()).fold(0.0, f64::max);
            let mut factor = f64::min(1.0, resolution_mm / longest.max(1e-9));
            let mut is_lower = false;
            seen = state.seen;
            for _ in 0..4 {
                let moved = old.iter().zip(&change.0).map(|(c, d)| *c + *d * factor).collect();
                self.lattice.coefficients = moved;
                let next = self.seen(&work);
                let next_gain = work.gain(&next);
                let residuals = work.residuals(&next, &next_gain);
                let change = BELIEVED / alike * costlier(points, &state.residuals, &residuals, scale);
                if change + self.held_energy() <= held {
                    (seen, gain, is_lower) = (next, next_gain, true);
                    break;
                }
                factor *= 0.4;
            }
            steps += 1;
            progress.advance(1)?;
            if !is_lower {
                self.lattice.coefficients = old;
            }
            if scale <= own && (!is_lower || factor * longest < SETTLED * resolution_mm) {
                progress.advance((self.most_steps - 1 - step) as u64)?;
                break;
            }
        }
        let residuals = work.residuals(&seen, &gain);
        let mut evidence = vec![Evidence::NONE; self.lattice.cells().iter().product()];
        let scale = work.spread(&residuals);
        let mut start = 0;
        for (cell, end) in &points.ends {
            for n in start..*end {
                if let (Some(seen), Some((r, gain))) = (seen[n], residuals[n]) {
                    evidence[*cell].add(&of_point(&points.list[n], seen, (r, gain), &work, scale, alike));
                }
            }
            start = *end;
        }
        let least_ratio = (points.ends.iter())
            .map(|(_, end)| self.lattice.volume_ratio(points.list[end - 1].at_mm))
            .fold(f64::INFINITY, f64::min);
        let counted = points.list.iter().zip(&residuals).filter(|(_, r)| r.is_some());
        let counted: f64 = counted.map(|(point, _)| point.share).sum();
        Ok(Resolved {
            correlation: work.correlation(&seen, &gain),
            evidence,
            tissue_ml: counted * points.voxel_mm3 / 1000.0,
            least_ratio,
            steps,
        })
    }

    /// Correlation of the images as the lattice lays them.
    pub fn correlation(&self, points: &Points, moving: &Level) -> Result<f64, DeformError> {
        let work = Work::new(points, moving)?;
        let seen = self.seen(&work);
        Ok(work.correlation(&seen, &work.gain(&seen)))
    }

    /// The moving image where the points are displaced to.
    fn seen(&self, work: &Work<'_>) -> Vec<Option<Seen>> {
        let [_, [low, range]] = work.scales;
        let level = work.moving;
        let mm_from_voxel = level.voxel_from_centred.matrix3.transpose();
        let see = |point: &Point| {
            let at_mm = point.at_mm + self.lattice.at(point.at_mm);
            let probe = level.probe(level.voxel_from_centred.transform_point3(at_mm))?;
            Some(Seen {
                value: (probe.value - low) / range,
                gradient: mm_from_voxel * probe.gradient / range,
            })
        };
        work.points.list.par_iter().map(see).collect()
    }

    /// What bending and the displacement cost.
    fn held_energy(&self) -> f64 {
        let control = &self.lattice.coefficients;
        0.5 * self.held(control).iter().zip(control).map(|(held, c)| held.dot(*c)).sum::<f64>()
    }

    /// What holds the lattice back, times control points.
    fn held(&self, control: &[DVec3]) -> Vec<DVec3> {
        let mut out = self.lattice.bending(control);
        let stiff = self.stiffness();
        out.iter_mut().zip(control).for_each(|(out, c)| *out = *out * stiff + *c / (USUAL_MM * USUAL_MM));
        out
    }

    fn stiffness(&self) -> f64 {
        (CURVATURE_PER_MM * self.lattice.spacing_mm().powi(2)).powi(-2)
    }

    /// A step of the control points, and what it moves cells by.
    fn step(
        &self,
        work: &Work<'_>,
        state: &State,
        scale: f64,
        alike: f64,
        progress: &Progress,
    ) -> Result<(Vec<DVec3>, Vec<DVec3>), Cancelled> {
        let lattice = &self.lattice;
        let share = BELIEVED / (alike * scale * scale);
        let ends = &work.points.ends;
        let of_cell = |n: usize| {
            let start = if n == 0 { 0 } else { ends[n - 1].1 };
            let (mut squares, mut moment) = (DMat3::ZERO, DVec3::ZERO);
            for at in start..ends[n].1 {
                let (Some(seen), Some((r, gain))) = (state.seen[at], state.residuals[at]) else { continue };
                let g = seen.gradient * gain;
                let weight = work.points.list[at].share * share * cauchy(r, scale);
                squares += DMat3::from_cols(g * g.x, g * g.y, g * g.z) * weight;
                moment += g * (weight * r);
            }
            (squares, moment)
        };
        let sums: Vec<(DMat3, DVec3)> = (0..ends.len()).into_par_iter().map(of_cell).collect();
        let cells: usize = lattice.cells().iter().product();
        let (mut moments, mut diagonal) = (vec![DVec3::ZERO; cells], vec![DVec3::ZERO; cells]);
        for ((cell, _), (squares, moment)) in ends.iter().zip(&sums) {
            moments[*cell] = *moment;
            diagonal[*cell] = DVec3::new(squares.x_axis.x, squares.y_axis.y, squares.z_axis.z);
        }
        let times = |control: &[DVec3]| {
            let moved = lattice.to_cells(control);
            let mut forces = vec![DVec3::ZERO; cells];
            for ((cell, _), (squares, _)) in ends.iter().zip(&sums) {
                forces[*cell] = *squares * moved[*cell];
            }
            let mut out = lattice.onto_control(forces);
            out.iter_mut().zip(self.held(control)).for_each(|(out, held)| *out += held);
            out
        };
        let held = self.held(&lattice.coefficients);
        let right: Vec<DVec3> =
            lattice.onto_control(moments).iter().zip(held).map(|(pull, held)| *pull - held).collect();
        let own = self.stiffness() * BENDING_DIAGONAL + 1.0 / (USUAL_MM * USUAL_MM);
        let diagonal: Vec<DVec3> = lattice.diagonal(diagonal).into_iter().map(|d| d + own).collect();
        let step = conjugate(times, &right, &diagonal, progress)?;
        let moved = lattice.to_cells(&step);
        Ok((step, moved))
    }
}

/// Solves `times(x) = right` by conjugate gradients, from 0, with a diagonal preconditioner.
fn conjugate(
    times: impl Fn(&[DVec3]) -> Vec<DVec3>,
    right: &[DVec3],
    diagonal: &[DVec3],
    progress: &Progress,
) -> Result<Vec<DVec3>, Cancelled> {
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let eased = |r: &[DVec3]| -> Vec<DVec3> { r.iter().zip(diagonal).map(|(r, d)| *r / *d).collect() };
    let mut x = vec![DVec3::ZERO; right.len()];
    let mut rest = right.to_vec();
    let mut z = eased(&rest);
    let mut along = z.clone();
    let mut energy = dot(&rest, &z);
    let least = energy * CONJUGATE_RESIDUAL * CONJUGATE_RESIDUAL;
    for _ in 0..MOST_CONJUGATE {
        if energy <= least || energy <= 0.0 {
            break;
        }
        progress.check()?;
        let image = times(&along);
        let curvature = dot(&along, &image);
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let length = energy / curvature;
        x.iter_mut().zip(&along).for_each(|(x, a)| *x += *a * length);
        rest.iter_mut().zip(&image).for_each(|(r, i)| *r -= *i * length);
        z = eased(&rest);
        let next = dot(&rest, &z);
        let share = next / energy;
        along.iter_mut().zip(&z).for_each(|(a, z)| *a = *z + *a * share);
        energy = next;
    }
    Ok(x)
}
