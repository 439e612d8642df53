//! A transfer function as tables over stored values, as the device and its twins look it up.

use rayon::prelude::*;

use super::{
    transfer::TransferFunction,
    volume::{Field, NOT_FINITE},
};

/// What a function's colour and opacity depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dimensions {
    /// Values alone: gradients aren't computed.
    Value,
    /// Values, and a factor of the opacity by gradient magnitude.
    ValueAndFactor,
    /// Values and gradient magnitudes together.
    Joint,
}

impl Dimensions {
    /// The pipeline constants of lib/image.
    pub fn constants(self) -> [(&'static str, f64); 2] {
        let flag = |on: bool| f64::from(u8::from(on));
        [("gradient_counts", flag(self == Self::ValueAndFactor)), ("joint", flag(self == Self::Joint))]
    }
}

/// A transfer function as tables over stored values, and the bricks in which it makes anything visible.
#[derive(Clone)]
pub(crate) struct Tables {
    pub dimensions: Dimensions,
    /// Red, green, blue, opacity of 1 mm, at equidistant values. Jointly: rows of `columns`, one row after the other at
    /// equidistant gradient magnitudes, and colours are multiplied by the opacity, so that transparent neighbours don't
    /// darken an edge.
    pub colors: Vec<[f32; 4]>,
    /// Entries along values.
    pub columns: usize,
    /// Scale and offset from stored values to positions in `colors`.
    pub color_place: (f64, f64),
    /// Factors of the opacity, at equidistant gradient magnitudes; unused jointly.
    pub factors: Vec<f32>,
    /// Entries along gradient magnitudes: of `factors`, or rows of `colors`.
    pub rows: usize,
    /// Scale and offset from gradients of stored values per mm to positions in `factors`, or to rows of `colors`.
    pub factor_place: (f64, f64),
    /// A bit per brick.
    pub visible: Vec<u32>,
}

/// Numbers of entries of the tables.
const COLORS: usize = 2048;
const FACTORS: usize = 512;
/// Numbers of entries of a joint table (2 MiB), of values and of gradient magnitudes.
const JOINT_COLUMNS: usize = 512;
const JOINT_ROWS: usize = 256;

/// First of `n` equidistant positions and their distance, covering `low..=high` with one to spare on either side.
fn positions(low: f64, high: f64, n: usize) -> (f64, f64) {
    let smallest = 1e-9 * low.abs().max(high.abs()).max(1e-30);
    let distance = ((high - low).max(smallest)) / (n - 3) as f64;
    (low - distance, distance)
}

fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |r, x| (r.0.min(x), r.1.max(x)))
}

/// The two neighbours of a position in a table of `len` entries, and the weight of the upper one.
fn between(len: usize, place: f64) -> (usize, f64) {
    let x = place.clamp(0.0, (len - 1) as f64);
    let low = (x as usize).min(len.saturating_sub(2));
    (low, x - low as f64)
}

/// A bit for each brick whose range of stored values satisfies `shows`.
fn visible_bits(ranges: &[[f32; 2]], shows: impl Fn(f64, f64) -> bool) -> Vec<u32> {
    let mut visible = vec![0u32; ranges.len().div_ceil(32).max(1)];
    for (b, &[low, high]) in ranges.iter().enumerate() {
        if low <= high && shows(f64::from(low), f64::from(high)) {
            visible[b / 32] |= 1 << (b % 32);
        }
    }
    visible
}

impl Tables {
    pub fn of(transfer: &TransferFunction, scale: (f64, f64), ranges: &[[f32; 2]]) -> Self {
        if transfer.shapes().is_some() {
            return Self::of_shapes(transfer, scale, ranges);
        }
        let (first, last) = ends(transfer.points().iter().map(|p| p.value));
        let (start, distance) = positions(first, last, COLORS);
        let colors = (0..COLORS)
            .map(|i| {
                let ([r, g, b], a) = transfer.opacity_at(start + distance * i as f64);
                [r, g, b, a].map(|x| x as f32)
            })
            .collect();
        let color_place = (scale.1 / distance, (scale.0 - start) / distance);
        let (low, high) =
            transfer.gradient().map_or((0.0, 1.0), |points| ends(points.iter().map(|p| p.gradient)));
        let (factor_start, factor_distance) = positions(low, high, FACTORS);
        let factors = (0..FACTORS)
            .map(|i| transfer.gradient_factor(factor_start + factor_distance * i as f64) as f32)
            .collect();
        let factor_place = (scale.1 / factor_distance, -factor_start / factor_distance);
        // A table lookup is a mean of the function within one table distance of the value. Stored values are rounded,
        // too.
        let margin = distance + 1e-6 * scale.1;
        let visible = visible_bits(ranges, |low, high| {
            let value = |stored: f64| scale.0 + scale.1 * stored;
            transfer.max_opacity(value(low) - margin, value(high) + margin) > 0.0
        });
        let dimensions =
            if transfer.gradient().is_some() { Dimensions::ValueAndFactor } else { Dimensions::Value };
        Self {
            dimensions,
            colors,
            columns: COLORS,
            color_place,
            factors,
            rows: FACTORS,
            factor_place,
            visible,
        }
    }

    fn of_shapes(transfer: &TransferFunction, scale: (f64, f64), ranges: &[[f32; 2]]) -> Self {
        let bounds: Vec<_> = transfer.shapes().unwrap_or_default().iter().map(|s| s.form.bounds()).collect();
        let or_one = |(low, high): (f64, f64)| if low <= high { (low, high) } else { (0.0, 1.0) };
        let (first, last) = or_one(ends(bounds.iter().flat_map(|(values, _)| *values)));
        let (lowest, steepest) = or_one(ends(bounds.iter().flat_map(|(_, gradients)| *gradients)));
        let (start, distance) = positions(first, last, JOINT_COLUMNS);
        let (factor_start, factor_distance) = positions(lowest, steepest, JOINT_ROWS);
        let colors: Vec<[f32; 4]> = (0..JOINT_COLUMNS * JOINT_ROWS)
            .into_par_iter()
            .map(|i| {
                let value = start + distance * (i % JOINT_COLUMNS) as f64;
                let gradient = factor_start + factor_distance * (i / JOINT_COLUMNS) as f64;
                let ([r, g, b], a) = transfer.sample(value, gradient);
                [r * a, g * a, b * a, a].map(|x| x as f32)
            })
            .collect();
        let color_place = (scale.1 / distance, (scale.0 - start) / distance);
        // Number of columns before each that show anything at any gradient.
        let mut shown = vec![0u32];
        for column in 0..JOINT_COLUMNS {
            let any = colors.iter().skip(column).step_by(JOINT_COLUMNS).any(|entry| entry[3] > 0.0);
            shown.push(shown.last().copied().unwrap_or(0) + u32::from(any));
        }
        let visible = visible_bits(ranges, |low, high| {
            // Stored values are rounded.
            let place = |stored: f64| (stored * color_place.0 + color_place.1).clamp(0.0, 1e9);
            let last = JOINT_COLUMNS - 1;
            let from = (place(low - 1e-6).floor() as usize).min(last);
            let to = (place(high + 1e-6).ceil() as usize).min(last);
            shown[to + 1] > shown[from]
        });
        Self {
            dimensions: Dimensions::Joint,
            colors,
            columns: JOINT_COLUMNS,
            color_place,
            factors: vec![0.0],
            rows: JOINT_ROWS,
            factor_place: (scale.1 / factor_distance, -factor_start / factor_distance),
            visible,
        }
    }

    /// Opacity of 1 mm at a stored value and a gradient of stored values per mm, as looked up.
    fn opacity(&self, stored: f64, steepness: impl FnOnce() -> f64) -> f64 {
        let (scale, offset) = self.color_place;
        let (column, share) = between(self.columns, stored * scale + offset);
        let along = |first: usize| {
            let (a, b) = (f64::from(self.colors[first][3]), f64::from(self.colors[first + 1][3]));
            a + (b - a) * share
        };
        let opacity = along(column);
        let row_of = |steepness: f64| {
            let (scale, offset) = self.factor_place;
            (steepness < 1e9).then(|| between(self.rows, steepness * scale + offset))
        };
        match self.dimensions {
            Dimensions::Value => opacity,
            Dimensions::ValueAndFactor if opacity == 0.0 => 0.0,
            Dimensions::ValueAndFactor => row_of(steepness()).map_or(0.0, |(row, share)| {
                let (a, b) = (f64::from(self.factors[row]), f64::from(self.factors[row + 1]));
                opacity * (a + (b - a) * share)
            }),
            Dimensions::Joint => row_of(steepness()).map_or(0.0, |(row, share)| {
                let (a, b) = (along(row * self.columns + column), along((row + 1) * self.columns + column));
                a + (b - a) * share
            }),
        }
    }

    /// Encoded colour at a stored value and a gradient of stored values per mm, as looked up; black where nothing is visible.
    pub fn color(&self, stored: f64, steepness: impl FnOnce() -> f64) -> [f64; 3] {
        let (scale, offset) = self.color_place;
        let (column, share) = between(self.columns, stored * scale + offset);
        let mix = |a: [f64; 4], b: [f64; 4], share: f64| -> [f64; 4] {
            std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share)
        };
        let along = |first: usize| {
            mix(self.colors[first].map(f64::from), self.colors[first + 1].map(f64::from), share)
        };
        if self.dimensions != Dimensions::Joint {
            let [r, g, b, _] = along(column);
            return [r, g, b];
        }
        let (scale, offset) = self.factor_place;
        let (row, share) = between(self.rows, steepness() * scale + offset);
        let [r, g, b, a] =
            mix(along(row * self.columns + column), along((row + 1) * self.columns + column), share);
        [r, g, b].map(|c| if a > 0.0 { c / a } else { 0.0 })
    }

    /// Extinction per millimetre at a stored value and a gradient of stored values per mm.
    pub fn extinction(&self, stored: f64, steepness: f64) -> f64 {
        -(1.0 - self.opacity(stored, || steepness)).max(1e-30).ln()
    }

    /// Encoded colour at a voxel's centre, as in lib/image; black where the image is not finite.
    pub fn color_at(&self, field: &Field, cell: [usize; 3]) -> [f64; 3] {
        let own = field.values.get(field.grid.linear(cell)).copied().unwrap_or(NOT_FINITE);
        if own <= NOT_FINITE { [0.0; 3] } else { self.color(f64::from(own), || field.steepness(cell)) }
    }

    /// Extinction per millimetre at a voxel's centre, as in lib/image; 0 where the image is not finite.
    pub fn extinction_at(&self, field: &Field, cell: [usize; 3]) -> f64 {
        let own = field.values.get(field.grid.linear(cell)).copied().unwrap_or(NOT_FINITE);
        if own <= NOT_FINITE {
            return 0.0;
        }
        let steepness = || field.steepness(cell);
        -(1.0 - self.opacity(f64::from(own), steepness)).max(1e-30).ln()
    }
}
