//! Histograms shown behind the curve of the transfer-function editor.

use glam::DVec3;
use glioscope_core::{Grid, Volume};
use rayon::prelude::*;

use crate::flat;

/// Values counted in equal bins between a robust minimum and maximum.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueHistogram {
    range: (f64, f64),
    counts: Vec<u64>,
    outside: u64,
}

/// The range of values for an axis: all of them, or where a few outliers would compress the rest, the
/// 1st to 99th percentile extended by half that range on either side.
fn robust_range(statistics: &flat::Histogram) -> (f64, f64) {
    let Some((min, max)) = statistics.range() else { return (0.0, 1.0) };
    let (mut low, mut high) = (min, max);
    if let Some((p01, p99)) = statistics.p01_p99().filter(|p| p.1 > p.0) {
        let margin = 0.5 * (p99 - p01);
        low = low.max(p01 - margin);
        high = high.min(p99 + margin);
    }
    if high - low > 0.0 && (high - low).is_finite() { (low, high) } else { (low - 0.5, low + 0.5) }
}

impl ValueHistogram {
    /// Number of bins.
    pub const BINS: usize = 256;

    /// Counts the finite voxels of a volume with known `statistics`. One pass on all cores.
    pub fn of(volume: &Volume, statistics: &flat::Histogram) -> Self {
        let range = robust_range(statistics);
        let bins_per_unit = Self::BINS as f64 / (range.1 - range.0);
        let grid = volume.grid();
        let line = grid.dims()[0];
        let empty = || (vec![0; Self::BINS], 0);
        let (counts, outside) = (0..grid.voxel_count() / line.max(1))
            .into_par_iter()
            .fold(empty, |(mut counts, mut outside): (Vec<u64>, u64), number| {
                for value in (number * line..(number + 1) * line).map(|l| volume.value(l)) {
                    if value >= range.0 && value <= range.1 {
                        let bin = ((value - range.0) * bins_per_unit) as usize;
                        counts[bin.min(Self::BINS - 1)] += 1;
                    } else if value.is_finite() {
                        outside += 1;
                    }
                }
                (counts, outside)
            })
            .reduce(empty, |(mut a, outside), (b, more)| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                (a, outside + more)
            });
        Self { range, counts, outside }
    }

    /// Lower end of the first bin and upper end of the last, image units; the second is greater.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// Voxel count of each bin.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Number of finite voxels beyond the range.
    pub fn outside(&self) -> u64 {
        self.outside
    }

    /// Heights to draw: log(1 + count) relative to the largest, 0 to 1.
    pub fn log_heights(&self) -> Vec<f64> {
        log_heights(&self.counts)
    }
}

fn log_heights(counts: &[u64]) -> Vec<f64> {
    let most = counts.iter().max().map_or(0.0, |&c| (c as f64).ln_1p()).max(f64::MIN_POSITIVE);
    counts.iter().map(|&c| (c as f64).ln_1p() / most).collect()
}

/// Voxels counted by value and by gradient magnitude.
#[derive(Clone, Debug, PartialEq)]
pub struct GradientHistogram {
    range: (f64, f64),
    highest_gradient: f64,
    counts: Vec<u64>,
}

impl GradientHistogram {
    /// Number of bins along each axis.
    pub const BINS: usize = 128;

    /// Counts every voxel whose value and neighbours are finite: about a second for 512³, so only
    /// when a 2-D editor is open. Values as in [`ValueHistogram`]; gradients are central differences
    /// in image units per mm, counted up to half the value range divided by the finest spacing (steeper ones
    /// in the last bin).
    pub fn of(volume: &Volume, statistics: &flat::Histogram) -> Self {
        let range = robust_range(statistics);
        let grid = volume.grid();
        let dims = grid.dims();
        let highest_gradient = 0.5 * (range.1 - range.0) / grid.spacing_mm().min_element();
        let scale = Self::BINS as f64 / (range.1 - range.0);
        let gradient_scale = (Self::BINS * Self::BINS) as f64 / highest_gradient;
        let mm_gradient = mm_from_index_gradient(grid);
        let last = Self::BINS - 1;
        let empty = || vec![0u64; Self::BINS * Self::BINS];
        let counts = (0..dims[1] * dims[2])
            .into_par_iter()
            .fold(empty, |mut counts, line| {
                for x in 0..dims[0] {
                    let ijk = [x, line % dims[1], line / dims[1]];
                    let value = volume.value(grid.linear(ijk));
                    if !(value >= range.0 && value <= range.1) {
                        continue;
                    }
                    let difference = |axis: usize| {
                        let (mut up, mut down) = (ijk, ijk);
                        up[axis] = (ijk[axis] + 1).min(dims[axis] - 1);
                        down[axis] = ijk[axis].saturating_sub(1);
                        0.5 * (volume.value(grid.linear(up)) - volume.value(grid.linear(down)))
                    };
                    let gradient =
                        mm_gradient(DVec3::new(difference(0), difference(1), difference(2))).length();
                    if gradient.is_finite() {
                        let column = (((value - range.0) * scale) as usize).min(last);
                        let row = ((gradient * gradient_scale).sqrt() as usize).min(last);
                        counts[row * Self::BINS + column] += 1;
                    }
                }
                counts
            })
            .reduce(empty, |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                a
            });
        Self { range, highest_gradient, counts }
    }

    /// Values at the lower and upper end, image units.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// Gradient magnitude at the upper end, image units per millimetre; the lowest is 0.
    pub fn highest_gradient(&self) -> f64 {
        self.highest_gradient
    }

    /// Voxel counts: [`GradientHistogram::BINS`] rows of as many bins, gradient increasing from row to row by equal
    /// steps of its square root (most voxels have small ones), value along each row.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Brightness to draw: log(1 + count) relative to the largest, 0 to 1.
    pub fn log_heights(&self) -> Vec<f64> {
        log_heights(&self.counts)
    }
}

/// From differences per voxel to the gradient per millimetre.
pub(crate) fn mm_from_index_gradient(grid: &Grid) -> impl Fn(DVec3) -> DVec3 + use<> {
    let per_mm_from_per_voxel = grid.world_from_voxel().matrix3.inverse().transpose();
    move |per_voxel| per_mm_from_per_voxel * per_voxel
}
