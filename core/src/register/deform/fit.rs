//! Gauss-Newton steps of a lattice: differences of intensities by Cauchy's weights, a smooth gain, conjugate gradients.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{
    DeformError,
    lattice::{BENDING_DIAGONAL, Lattice},
};
use crate::{
    Cancelled, Progress, Volume,
    register::{
        exclude::Grown,
        level::{Level, finest},
        pose::solve,
        types::Which,
    },
};

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
/// Volume of a level's point spread in cubes of its resolution: values within it are one measurement. `(0.6·√(4π))³`.
const ALIKE: f64 = 9.62;
/// Share of what differences tell by their noise that is believed: most of what differs in real images isn't noise.
const BELIEVED: f64 = 0.2;
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
/// Coefficients of the gain: a polynomial of degree 2, and an offset.
const GAIN: usize = 11;
/// Resolution below which far points are thinned out, mm, and to one of how many.
const FINE_MM: f64 = 1.5;
const FAR: usize = 4;
/// Quantiles of the tissue that become 0 and 1.
const QUANTILES: [f64; 2] = [0.02, 0.98];

/// One image at each resolution, coarse to fine, about a centre.
pub(crate) fn levels(
    volume: &Volume,
    centre_mm: DVec3,
    resolutions: &[f64],
    progress: &Progress,
) -> Result<Vec<Level>, DeformError> {
    let mut levels: Vec<Level> = Vec::new();
    for resolution_mm in resolutions.iter().rev() {
        let next = match levels.last() {
            Some(last) => last.coarser(*resolution_mm, progress)?,
            None => finest(volume, centre_mm, *resolution_mm, progress)?
                .ok_or(DeformError::TooLittle { found_ml: 0.0 })?,
        };
        levels.push(next);
    }
    levels.reverse();
    Ok(levels)
}

/// Where tissue is looked at: all of it, and what is near the lesion.
pub(crate) struct Shells {
    pub whole: Vec<Grown>,
    pub near: Vec<Grown>,
}

/// A voxel of the fixed image in the shell.
struct Point {
    /// Centred mm.
    at_mm: DVec3,
    value: f64,
    /// Per mm, by differences to both sides where both count.
    gradient: DVec3,
    /// Voxels that it stands for.
    share: f64,
}

/// The fixed image in the shell, by the lattice's cells.
pub(crate) struct Points {
    /// In the order of their cells.
    list: Vec<Point>,
    /// Cell, and the end of its points in the list.
    ends: Vec<(usize, usize)>,
    voxel_mm3: f64,
}

impl Points {
    pub fn volume_ml(&self) -> f64 {
        self.list.iter().map(|point| point.share).sum::<f64>() * self.voxel_mm3 / 1000.0
    }
}

/// Those voxels of a level that count and lie in one of the shells. Far from the lesion, at a fine resolution, one of [`FAR`].
pub(crate) fn points(
    level: &Level,
    lattice: &Lattice,
    shells: &Shells,
    resolution_mm: f64,
    centre_mm: DVec3,
) -> Points {
    let centred_from_voxel = level.centred_from_voxel();
    let mm_from_voxel = level.voxel_from_centred.matrix3.transpose();
    let [nx, ny, nz] = level.dims;
    let value = |v: [usize; 3]| f64::from(level.values[crate::grid::linear(level.dims, v)]);
    let gradient = |v: [usize; 3]| {
        let along = |a: usize| {
            let (mut below, mut above) = (v, v);
            below[a] = v[a].saturating_sub(1);
            above[a] = (v[a] + 1).min(level.dims[a] - 1);
            let here = value(v);
            let or_here = |at: [usize; 3]| Some(value(at)).filter(|v| v.is_finite());
            let (low, high) = (or_here(below), or_here(above));
            let steps = f64::from(u8::from(low.is_some() && below != v))
                + f64::from(u8::from(high.is_some() && above != v));
            (high.unwrap_or(here) - low.unwrap_or(here)) / steps.max(1.0)
        };
        mm_from_voxel * DVec3::new(along(0), along(1), along(2))
    };
    let slice = |z: usize| -> Vec<(usize, Point)> {
        let voxel = |n: usize| {
            let v = [n % nx, n / nx, z];
            let value = value(v);
            let at_mm = centred_from_voxel.transform_point3(DVec3::from_array(v.map(|v| v as f64)));
            let cell = lattice.cell_at(at_mm).filter(|_| value.is_finite())?;
            let is_taken = (v[0] + 2 * v[1] + 3 * v[2]).is_multiple_of(FAR);
            let is_within = |shells: &[Grown]| shells.iter().any(|shell| shell.contains(at_mm + centre_mm));
            let is_near = resolution_mm > FINE_MM || is_within(&shells.near);
            let share = if is_near { 1.0 } else { FAR as f64 };
            ((is_near || is_taken) && is_within(&shells.whole))
                .then(|| (cell, Point { at_mm, value, gradient: gradient(v), share }))
        };
        (0..nx * ny).filter_map(voxel).collect()
    };
    let mut all: Vec<(usize, Point)> = (0..nz).into_par_iter().flat_map_iter(slice).collect();
    // Stable: within a cell in memory order.
    all.sort_by_key(|(cell, _)| *cell);
    let mut ends: Vec<(usize, usize)> = Vec::new();
    for (n, (cell, _)) in all.iter().enumerate() {
        match ends.last_mut() {
            Some((last, end)) if last == cell => *end = n + 1,
            _ => ends.push((*cell, n + 1)),
        }
    }
    let voxel_mm3 = centred_from_voxel.matrix3.determinant().abs();
    Points { list: all.into_iter().map(|(_, point)| point).collect(), ends, voxel_mm3 }
}

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
struct Seen {
    value: f64,
    /// Per mm.
    gradient: DVec3,
}

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

/// One resolution's images, scaled.
struct Work<'a> {
    points: &'a Points,
    moving: &'a Level,
    /// Lower end and range of each image.
    scales: [[f64; 2]; 2],
    /// Half the extent of the points.
    extent_mm: DVec3,
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
            let mut out = lattice.from_cells(forces);
            out.iter_mut().zip(self.held(control)).for_each(|(out, held)| *out += held);
            out
        };
        let held = self.held(&lattice.coefficients);
        let right: Vec<DVec3> =
            lattice.from_cells(moments).iter().zip(held).map(|(pull, held)| *pull - held).collect();
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

impl<'a> Work<'a> {
    fn new(points: &'a Points, moving: &'a Level) -> Result<Self, DeformError> {
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
    fn gain(&self, seen: &[Option<Seen>]) -> [f64; GAIN] {
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
    fn residuals(&self, seen: &[Option<Seen>], gain: &[f64; GAIN]) -> Vec<Option<(f64, f64)>> {
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
    fn spread(&self, residuals: &[Option<(f64, f64)>]) -> f64 {
        let mut values: Vec<f64> = self.shown(residuals).map(|[f, m]| (f - m).abs()).collect();
        if values.is_empty() {
            return 1.0;
        }
        let middle = values.len() / 2;
        (MAD * *values.select_nth_unstable_by(middle, f64::total_cmp).1).max(MIN_SCALE)
    }

    /// Correlation of the fixed image and the moving one after the gain, where both show more than background.
    fn correlation(&self, seen: &[Option<Seen>], gain: &[f64; GAIN]) -> f64 {
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
fn of_point(
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
fn costlier(points: &Points, before: &[Option<(f64, f64)>], after: &[Option<(f64, f64)>], scale: f64) -> f64 {
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
fn cauchy(r: f64, scale: f64) -> f64 {
    1.0 / (1.0 + (r / (CAUCHY * scale)).powi(2))
}

fn root_mean_square(residuals: &[Option<(f64, f64)>]) -> f64 {
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
