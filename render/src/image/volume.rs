//! A context image prepared for ray casting.

use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{Grid, Volume};
use rayon::prelude::*;

use crate::{
    flat::{self, PreparedContext},
    image::transfer::{GradientHistogram, ValueHistogram},
};

/// Cells of interpolation (between voxel centres) along a brick's side.
pub(crate) const BRICK: usize = 8;
/// How far below most values, in widths between the 1st and 99th percentile, a value may lie that is no filling.
const FILLING: f64 = 1e4;
/// Represents a value that is not finite, see lib/image.
pub(crate) const NOT_FINITE: f32 = -1e30;

/// An image for the context view: made once per image, on all cores. Holds the image, no copy of its
/// values.
#[derive(Debug)]
pub struct ContextVolume {
    image: Arc<Volume>,
    statistics: flat::Histogram,
    histogram: ValueHistogram,
    gradients: OnceLock<GradientHistogram>,
}

impl ContextVolume {
    /// Computes the image's histograms.
    pub fn new(image: Arc<Volume>) -> Self {
        let statistics = flat::Histogram::of(&image);
        Self::of(image, statistics)
    }

    /// The same from an image already prepared for slices: one pass over the voxels instead of three.
    pub fn of_prepared(prepared: &PreparedContext) -> Self {
        Self::of(Arc::clone(prepared.volume()), prepared.histogram().clone())
    }

    fn of(image: Arc<Volume>, statistics: flat::Histogram) -> Self {
        let histogram = ValueHistogram::of(&image, &statistics);
        Self { image, statistics, histogram, gradients: OnceLock::new() }
    }

    /// The image.
    pub fn image(&self) -> &Arc<Volume> {
        &self.image
    }

    /// The image's grid.
    pub fn grid(&self) -> &Grid {
        self.image.grid()
    }

    /// Range, percentiles, and whether it looks like CT: the basis of presets.
    pub fn statistics(&self) -> &flat::Histogram {
        &self.statistics
    }

    /// Voxel counts by value.
    pub fn histogram(&self) -> &ValueHistogram {
        &self.histogram
    }

    /// Voxel counts by value and gradient magnitude; computed on first use.
    pub fn gradient_histogram(&self) -> &GradientHistogram {
        self.gradients.get_or_init(|| GradientHistogram::of(&self.image, &self.statistics))
    }

    /// Smallest value and width of the range, which stored values 0 to 1 cover. A filling such as -3.4e38, beside which single
    /// precision knows no other value, is out of it, and isn't drawn.
    pub(crate) fn scale(&self) -> (f64, f64) {
        let range = self.statistics.range().map(|(low, high)| match self.statistics.p01_p99() {
            Some((p01, p99)) if p99 > p01 && p01 - low > FILLING * (p99 - p01) => {
                (p01 - FILLING * (p99 - p01), high)
            }
            _ => (low, high),
        });
        match range {
            Some((low, high)) if high > low && (high - low).is_finite() => (low, high - low),
            // A constant image, or a range that overflows.
            Some((low, _)) => (low, 1.0),
            None => (0.0, 1.0),
        }
    }

    /// Stored values between which most of the image lies: the 1st to 99th percentile without background and as much again on
    /// either side, within the range. All of the range but for outliers, such as metal in CT or a bladder in PET.
    pub(crate) fn usual(&self) -> [f64; 2] {
        let (low, width) = self.scale();
        let Some((p01, p99)) = self.statistics.p01_p99() else { return [0.0, 1.0] };
        let spread = p99 - p01;
        let usual = [(p01 - spread - low) / width, (p99 + spread - low) / width].map(|v| v.clamp(0.0, 1.0));
        if spread > 0.0 && usual[1] > usual[0] { usual } else { [0.0, 1.0] }
    }

    /// Depth below a cut at which shading reaches full strength.
    pub(crate) fn cut_fade_mm(&self) -> f64 {
        3.0 * self.grid().spacing_mm().min_element()
    }

    /// Gradient magnitude (image units per mm) of half-strength shading: 8 % of the range between the percentiles
    /// per voxel.
    pub(crate) fn half_shaded(&self) -> f64 {
        let width = self.statistics.p01_p99().map_or(0.0, |(low, high)| high - low);
        if width > 0.0 { 0.08 * width / self.grid().spacing_mm().min_element() } else { 1.0 }
    }
}

/// The image as uploaded to the device: values scaled from their range to 0 to 1, on its own grid or a coarser one.
pub(crate) struct Field {
    pub grid: Grid,
    pub values: Vec<f32>,
    /// How often the image was halved along each axis, 0 to 3.
    pub halvings: u32,
    /// See [`ContextVolume::usual`].
    pub usual: [f64; 2],
}

impl Field {
    /// All values of an image, halved along every axis until they fit into `bytes`. `None` when not even
    /// an eighth of the resolution fits.
    pub fn fitting(volume: &ContextVolume, bytes: u64) -> Option<Self> {
        let ((low, width), usual) = (volume.scale(), volume.usual());
        let image = volume.image();
        let stored = |linear: usize| {
            let value = ((image.value(linear) - low) / width) as f32;
            if value.is_finite() && value.abs() <= 1e6 { value } else { NOT_FINITE }
        };
        let fits = |grid: &Grid| grid.voxel_count() as u64 * 4 <= bytes;
        let whole = image.grid();
        if fits(whole) {
            let values = (0..whole.voxel_count()).into_par_iter().with_min_len(1 << 16).map(stored).collect();
            return Some(Self { grid: whole.clone(), values, halvings: 0, usual });
        }
        // Halved directly from the image: one this large isn't copied in full.
        let mut field = halved(whole, stored)?;
        for halvings in 1..=3 {
            if fits(&field.0) {
                return Some(Self { grid: field.0, values: field.1, halvings, usual });
            }
            let (grid, values) = field;
            field = halved(&grid, |linear| values[linear])?;
        }
        None
    }

    /// Gradient magnitude at a voxel's centre, stored values per millimetre, as in lib/image; huge beside a value that isn't
    /// finite.
    pub fn steepness(&self, cell: [usize; 3]) -> f64 {
        let dims = self.grid.dims();
        let axis = |a: usize| {
            let at = |c: usize| {
                let mut there = cell;
                there[a] = c;
                f64::from(self.values.get(self.grid.linear(there)).copied().unwrap_or(NOT_FINITE))
            };
            let (low, high) = (cell[a].saturating_sub(1), (cell[a] + 1).min(dims[a] - 1));
            // Edge voxels extend: the distance is two voxels there too.
            0.5 * (at(high) - at(low))
        };
        let difference = DVec3::new(axis(0), axis(1), axis(2));
        (self.grid.voxel_from_world().matrix3.transpose() * difference).length()
    }

    /// Bricks along each axis.
    pub fn brick_dims(&self) -> [usize; 3] {
        self.grid.dims().map(|d| d.saturating_sub(1).max(1).div_ceil(BRICK))
    }

    /// Smallest and largest stored value of each brick, including the voxels shared with the next bricks: bounds of
    /// all interpolated values in it. Empty (min above max) where nothing is finite.
    pub fn ranges(&self) -> Vec<[f32; 2]> {
        let dims = self.grid.dims();
        let bricks = self.brick_dims();
        (0..bricks.iter().product::<usize>())
            .into_par_iter()
            .map(|b| {
                let brick = [b % bricks[0], b / bricks[0] % bricks[1], b / bricks[0] / bricks[1]];
                let span = |a: usize| brick[a] * BRICK..(brick[a] * BRICK + BRICK + 1).min(dims[a]);
                let mut range = [f32::INFINITY, f32::NEG_INFINITY];
                for z in span(2) {
                    for y in span(1) {
                        let line = self.grid.linear([0, y, z]);
                        for &v in &self.values[line + span(0).start..line + span(0).end] {
                            if v > NOT_FINITE {
                                range = [range[0].min(v), range[1].max(v)];
                            }
                        }
                    }
                }
                range
            })
            .collect()
    }
}

/// Means of the finite values of 2x2x2 voxels, on a grid at the same position.
fn halved(grid: &Grid, value: impl Fn(usize) -> f32 + Sync) -> Option<(Grid, Vec<f32>)> {
    let dims = grid.dims();
    let half = dims.map(|d| d.div_ceil(2));
    let step = DVec3::from_array(std::array::from_fn(|a| if dims[a] > 1 { 2.0 } else { 1.0 }));
    let world = grid.world_from_voxel();
    // The new first centre lies between the first two old ones.
    let origin = world.transform_point3((step - 1.0) * 0.5);
    let matrix3 = world.matrix3 * DMat3::from_diagonal(step);
    let coarse = Grid::new(half, DAffine3 { matrix3, translation: origin }, grid.sides()).ok()?;
    let values = (0..coarse.voxel_count())
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|l| {
            let at = [l % half[0], l / half[0] % half[1], l / half[0] / half[1]];
            let (mut sum, mut n) = (0.0, 0.0);
            for corner in 0..8 {
                let ijk: [usize; 3] = std::array::from_fn(|a| at[a] * 2 + (corner >> a & 1));
                if (0..3).all(|a| ijk[a] < dims[a]) {
                    let v = value(grid.linear(ijk));
                    if v > NOT_FINITE {
                        sum += v;
                        n += 1.0;
                    }
                }
            }
            if n > 0.0 { sum / n } else { NOT_FINITE }
        })
        .collect();
    Some((coarse, values))
}
