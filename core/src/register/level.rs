//! Images at one working resolution, smoothed by physical widths; NaN marks what doesn't count.

use std::sync::Arc;

use crate::{Cancelled, Progress, Volume, with_samples};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

/// Width (standard deviation) of a level's point spread, in its resolution.
const WIDTH: f64 = 0.6;
/// Width of what a scanner's voxel covers already, in its spacing: a box's.
const NATIVE_WIDTH: f64 = 0.29;
/// Widths at which kernels end.
const REACH: f64 = 3.0;
/// Share of a kernel that must lie on finite voxels.
const MIN_FINITE: f32 = 0.5;

/// An image at one resolution, in centred millimetres.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// Voxels along each axis, each at least 2.
    pub dims: [usize; 3],
    /// Voxel indices from centred mm.
    pub voxel_from_centred: DAffine3,
    /// Values, x fastest; NaN: doesn't count.
    pub values: Arc<Vec<f32>>,
    /// Point spread along each axis, standard deviation in mm.
    width_mm: [f64; 3],
    spacing_mm: [f64; 3],
}

/// Value and gradient (per voxel) at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Probe {
    pub value: f64,
    pub gradient: DVec3,
}

impl Level {
    /// Trilinear value and its gradient at fractional voxel indices; `None` outside and where a neighbour doesn't count.
    #[inline]
    pub fn probe(&self, v: DVec3) -> Option<Probe> {
        let [nx, ny, nz] = self.dims;
        let inside = v.x >= 0.0
            && v.y >= 0.0
            && v.z >= 0.0
            && v.x <= (nx - 1) as f64
            && v.y <= (ny - 1) as f64
            && v.z <= (nz - 1) as f64;
        if !inside {
            return None;
        }
        let (i, j, k) = ((v.x as usize).min(nx - 2), (v.y as usize).min(ny - 2), (v.z as usize).min(nz - 2));
        let (fx, fy, fz) = (v.x - i as f64, v.y - j as f64, v.z - k as f64);
        let base = (k * ny + j) * nx + i;
        let slice = nx * ny;
        let pair = |at: usize| {
            let two = self.values.get(at..at + 2).unwrap_or(&[f32::NAN, f32::NAN]);
            (f64::from(two[0]), f64::from(two[1]))
        };
        let (a000, a100) = pair(base);
        let (a010, a110) = pair(base + nx);
        let (a001, a101) = pair(base + slice);
        let (a011, a111) = pair(base + slice + nx);
        let (d00, d10, d01, d11) = (a100 - a000, a110 - a010, a101 - a001, a111 - a011);
        let (x00, x10, x01, x11) = (a000 + fx * d00, a010 + fx * d10, a001 + fx * d01, a011 + fx * d11);
        let (y0, y1) = (x00 + fy * (x10 - x00), x01 + fy * (x11 - x01));
        let value = y0 + fz * (y1 - y0);
        if !value.is_finite() {
            return None;
        }
        let dx0 = d00 + fy * (d10 - d00);
        let dx1 = d01 + fy * (d11 - d01);
        let (dy0, dy1) = (x10 - x00, x11 - x01);
        let gradient = DVec3::new(dx0 + fz * (dx1 - dx0), dy0 + fz * (dy1 - dy0), y1 - y0);
        Some(Probe { value, gradient })
    }

    /// The image in a space turned or mirrored by an orthogonal matrix. Shares the values.
    pub fn turned(&self, turn: DMat3) -> Self {
        let back = DAffine3::from_mat3(turn.transpose());
        Self { voxel_from_centred: self.voxel_from_centred * back, ..self.clone() }
    }

    /// Centred mm from voxel indices.
    pub fn centred_from_voxel(&self) -> DAffine3 {
        self.voxel_from_centred.inverse()
    }

    /// A level of about `resolution_mm` made from this one.
    pub fn coarser(&self, resolution_mm: f64, progress: &Progress) -> Result<Self, Cancelled> {
        let plans: [Plan; 3] = std::array::from_fn(|a| {
            Plan::new(self.dims[a], self.spacing_mm[a], self.width_mm[a], resolution_mm)
        });
        let mut values = Vec::new();
        let mut dims = self.dims;
        for (axis, plan) in plans.iter().enumerate() {
            progress.check()?;
            let source = if axis == 0 { &self.values[..] } else { &values[..] };
            let next = reduced(source, dims, axis, plan);
            values = next;
            dims[axis] = plan.count;
        }
        Ok(self.with(&plans, values))
    }

    /// This level smoothed to a point spread of `width_mm` along each axis that is sharper; what doesn't count still
    /// doesn't.
    pub fn smoothed(&self, width_mm: f64, progress: &Progress) -> Result<Self, Cancelled> {
        let plans: [Plan; 3] = std::array::from_fn(|a| Plan {
            step: 1,
            first: 0.0,
            count: self.dims[a],
            kernel: (width_mm.powi(2) - self.width_mm[a].powi(2)).max(0.0).sqrt() / self.spacing_mm[a],
            width_mm: width_mm.max(self.width_mm[a]),
        });
        let mut values = self.values.to_vec();
        for (axis, plan) in plans.iter().enumerate() {
            progress.check()?;
            if !plan.keeps() {
                values = reduced(&values, self.dims, axis, plan);
            }
        }
        values.par_iter_mut().zip(self.values.par_iter()).for_each(|(new, old)| {
            if !old.is_finite() {
                *new = f32::NAN;
            }
        });
        Ok(self.with(&plans, values))
    }

    fn with(&self, plans: &[Plan; 3], values: Vec<f32>) -> Self {
        let old_from_new = DAffine3 {
            matrix3: DMat3::from_diagonal(DVec3::from_array(std::array::from_fn(|a| plans[a].step as f64))),
            translation: DVec3::from_array(std::array::from_fn(|a| plans[a].first)),
        };
        Self {
            dims: std::array::from_fn(|a| plans[a].count),
            voxel_from_centred: old_from_new.inverse() * self.voxel_from_centred,
            values: Arc::new(values),
            width_mm: std::array::from_fn(|a| plans[a].width_mm),
            spacing_mm: std::array::from_fn(|a| self.spacing_mm[a] * plans[a].step as f64),
        }
    }
}

/// How one axis is smoothed and thinned out.
#[derive(Clone, Debug)]
struct Plan {
    /// Old voxels per new one.
    step: usize,
    /// Old index of the first new voxel.
    first: f64,
    /// New voxels.
    count: usize,
    /// Width of the kernel, old voxels; 0: none.
    kernel: f64,
    /// Width of the point spread afterwards, mm.
    width_mm: f64,
}

impl Plan {
    fn new(n: usize, spacing_mm: f64, width_mm: f64, resolution_mm: f64) -> Self {
        let wanted = WIDTH * resolution_mm;
        let width_after = wanted.max(width_mm);
        let kernel = (width_after * width_after - width_mm * width_mm).max(0.0).sqrt() / spacing_mm;
        // At least 2 voxels must remain for interpolation.
        let most = (n - 1).max(1);
        let step = ((resolution_mm / spacing_mm + 0.05).floor() as usize).clamp(1, most);
        let count = (n - 1) / step + 1;
        let first = ((n - 1) - step * (count - 1)) as f64 / 2.0;
        Self { step, first, count, kernel, width_mm: width_after }
    }

    /// Old indices and weights of new voxel `at`; weights sum to 1 over the old voxels.
    fn taps(&self, at: usize, n: usize) -> (usize, Vec<f32>) {
        let centre = self.first + (at * self.step) as f64;
        let reach = (REACH * self.kernel).max(0.5);
        let low = (centre - reach).ceil().max(0.0) as usize;
        let high = ((centre + reach).floor().max(0.0) as usize).min(n - 1);
        let weight = |i: usize| {
            let d = i as f64 - centre;
            if self.kernel < 0.05 {
                if d.abs() <= 0.5 { 1.0 } else { 0.0 }
            } else {
                (-0.5 * (d / self.kernel).powi(2)).exp()
            }
        };
        let weights: Vec<f64> = (low..=high.max(low)).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        (low, weights.iter().map(|w| (w / sum) as f32).collect())
    }

    fn keeps(&self) -> bool {
        self.step == 1 && self.kernel < 0.05
    }
}

/// Smooths and thins out along one axis; kernels are normalised over finite voxels.
fn reduced(values: &[f32], dims: [usize; 3], axis: usize, plan: &Plan) -> Vec<f32> {
    if plan.keeps() {
        return values.to_vec();
    }
    let inner: usize = dims[..axis].iter().product();
    let n = dims[axis];
    let taps: Vec<(usize, Vec<f32>)> = (0..plan.count).map(|at| plan.taps(at, n)).collect();
    let outer: usize = dims[axis + 1..].iter().product();
    let mut out = vec![0.0_f32; inner * plan.count * outer];
    if axis == 0 {
        out.par_chunks_mut(plan.count).zip(values.par_chunks(n)).for_each(|(out, line)| {
            reduce_line(line, &taps, out);
        });
    } else {
        out.par_chunks_mut(inner).enumerate().for_each(|(row, out)| {
            let (first, weights) = &taps[row % plan.count];
            let start = (row / plan.count * n + first) * inner;
            reduce_rows(&values[start..], inner, weights, out);
        });
    }
    out
}

fn reduce_line(line: &[f32], taps: &[(usize, Vec<f32>)], out: &mut [f32]) {
    for (out, (first, weights)) in out.iter_mut().zip(taps) {
        let part = &line[*first..*first + weights.len()];
        let sum: f32 = part.iter().zip(weights).map(|(v, w)| v * w).sum();
        *out = if sum.is_finite() { sum } else { finite_mean(part.iter().copied(), weights) };
    }
}

fn reduce_rows(values: &[f32], inner: usize, weights: &[f32], out: &mut [f32]) {
    for (t, weight) in weights.iter().enumerate() {
        let row = &values[t * inner..(t + 1) * inner];
        out.iter_mut().zip(row).for_each(|(out, v)| *out += weight * v);
    }
    for (i, out) in out.iter_mut().enumerate() {
        if !out.is_finite() {
            *out = finite_mean((0..weights.len()).map(|t| values[t * inner + i]), weights);
        }
    }
}

fn finite_mean(values: impl Iterator<Item = f32>, weights: &[f32]) -> f32 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (v, w) in values.zip(weights) {
        if v.is_finite() {
            sum += v * w;
            total += w;
        }
    }
    if total >= MIN_FINITE { sum / total } else { f32::NAN }
}

/// `volume` at `resolution_mm`, or at its own where that is coarser, about `centre_mm` (RAS mm). `None` for fewer than 2
/// voxels along an axis. Never more than one reduced copy in `f32` and one reduced within slices.
#[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
pub(crate) fn finest(
    volume: &Volume,
    centre_mm: DVec3,
    resolution_mm: f64,
    progress: &Progress,
) -> Result<Option<Level>, Cancelled> {
    let grid = volume.grid();
    let dims = grid.dims();
    if dims.iter().any(|n| *n < 2) {
        return Ok(None);
    }
    let spacing = grid.spacing_mm().to_array();
    let plans: [Plan; 3] =
        std::array::from_fn(|a| Plan::new(dims[a], spacing[a], NATIVE_WIDTH * spacing[a], resolution_mm));
    let [nx, ny, nz] = dims;
    let (cx, cy) = (plans[0].count, plans[1].count);
    let mut within = vec![0.0_f32; cx * cy * nz];
    let taps_x: Vec<(usize, Vec<f32>)> = (0..cx).map(|at| plans[0].taps(at, nx)).collect();
    let scaling = volume.scaling();
    with_samples!(volume.samples(), stored => {
        within.par_chunks_mut(cx * cy).enumerate().try_for_each(|(z, out)| {
            progress.check()?;
            let mut line = vec![0.0_f32; nx];
            let mut rows = vec![0.0_f32; cx * ny];
            for y in 0..ny {
                let start = (z * ny + y) * nx;
                for (value, s) in line.iter_mut().zip(&stored[start..start + nx]) {
                    *value = scaling.apply(*s as f64) as f32;
                }
                reduce_line(&line, &taps_x, &mut rows[y * cx..(y + 1) * cx]);
            }
            let reduced_y = reduced(&rows, [cx, ny, 1], 1, &plans[1]);
            out.copy_from_slice(&reduced_y);
            Ok(())
        })
    })?;
    let values = if plans[2].keeps() { within } else { reduced(&within, [cx, cy, nz], 2, &plans[2]) };
    let mut voxel_from_centred = grid.voxel_from_world();
    // Subtracted before it is multiplied, so that a common offset cancels.
    voxel_from_centred.translation =
        voxel_from_centred.matrix3 * (centre_mm - grid.world_from_voxel().translation);
    let original = Level {
        dims,
        voxel_from_centred,
        values: Arc::new(Vec::new()),
        width_mm: std::array::from_fn(|a| NATIVE_WIDTH * spacing[a]),
        spacing_mm: spacing,
    };
    Ok(Some(original.with(&plans, values)))
}
