//! Upper bounds of the image's extinction, one for each brick. Pure: no device is touched.

use crate::image::tables::{Dimensions, Tables};

/// Maxima over every interval whose length is a power of two.
struct Maxima(Vec<Vec<f64>>);

impl Maxima {
    fn of(values: Vec<f64>) -> Self {
        let mut levels = vec![values];
        let mut width = 1;
        while let Some(last) = levels.last().filter(|last| last.len() > width) {
            let next = last.iter().zip(last.iter().skip(width)).map(|(a, b)| a.max(*b)).collect();
            levels.push(next);
            width *= 2;
        }
        Self(levels)
    }

    /// Of places `from` to `to`, both included and in order.
    fn over(&self, from: usize, to: usize) -> f64 {
        let level = (to - from + 1).ilog2() as usize;
        let at = |place: usize| self.0.get(level).and_then(|l| l.get(place)).copied().unwrap_or(0.0);
        at(from).max(at(to + 1 - (1 << level)))
    }
}

/// For each brick, whose smallest and largest stored values are `ranges`, an extinction per millimetre that none in it
/// exceeds; 0 where nothing is visible. At most `most_per_mm`.
pub(crate) fn majorants(tables: &Tables, ranges: &[[f32; 2]], most_per_mm: f64) -> Vec<f32> {
    let column = |c: usize| {
        let opacities = tables.colors.iter().skip(c).step_by(tables.columns.max(1));
        opacities.fold(0.0f64, |most, entry| most.max(f64::from(entry[3])))
    };
    let factor = match tables.dimensions {
        Dimensions::ValueAndFactor => tables.factors.iter().fold(0.0f64, |m, f| m.max(f64::from(*f))),
        Dimensions::Value | Dimensions::Joint => 1.0,
    };
    let opacities = Maxima::of((0..tables.columns).map(column).collect());
    let last = tables.columns.saturating_sub(1);
    // Interpolated values are rounded.
    let place = |stored: f64| (stored * tables.color_place.0 + tables.color_place.1).clamp(0.0, last as f64);
    let of_brick = |[low, high]: &[f32; 2]| {
        if low > high || tables.columns == 0 {
            return 0.0;
        }
        let from = place(f64::from(*low) - 1e-6).floor() as usize;
        let to = (place(f64::from(*high) + 1e-6).ceil() as usize).min(last);
        let opacity = (opacities.over(from.min(to), to) * factor).min(1.0);
        // A little more than rounding in single precision.
        ((-(1.0 - opacity).max(1e-30).ln()).min(most_per_mm) * (1.0 + 1e-6)) as f32
    };
    ranges.iter().map(of_brick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        image::volume::Field,
        light::suite::{cubic, lumps, shaped, transfer},
        testing::noise,
    };
    use glam::DVec3;
    use glioscope_core::grid::ijk;

    /// No voxel of a brick has more, at any gradient; some bricks have nothing, and the bound is near.
    #[test]
    fn no_extinction_in_a_brick_exceeds_its_majorant() {
        let volume = lumps(&cubic(36, DVec3::ONE));
        let field = Field::fitting(&volume, 1 << 30).unwrap();
        let (dims, bricks) = (field.grid.dims(), field.brick_dims());
        for transfer in [transfer(false, 0.35), transfer(true, 0.9), shaped()] {
            let tables = Tables::of(&transfer, volume.scale(), &field.ranges());
            let bounds = majorants(&tables, &field.ranges(), 40.0);
            let mut most = vec![0.0f64; bounds.len()];
            for l in 0..field.grid.voxel_count() {
                let cell = ijk(dims, l);
                let here = tables.extinction_at(&field, cell);
                let brick = |a: usize| (cell[a] / 8).min(bricks[a] - 1);
                let at = (brick(2) * bricks[1] + brick(1)) * bricks[0] + brick(0);
                most[at] = most[at].max(here);
            }
            assert!(most.iter().zip(&bounds).all(|(m, b)| *m <= f64::from(*b)));
            let empty = bounds.iter().filter(|b| **b == 0.0).count();
            assert!(empty > 10 && empty < bounds.len() - 10, "{empty} of {}", bounds.len());
            let visible = |at: usize| tables.visible[at / 32] >> (at % 32) & 1 == 1;
            assert!((0..bounds.len()).all(|at| visible(at) || bounds[at] == 0.0));
            let near = most.iter().zip(&bounds).filter(|(m, b)| **m > 0.5 * f64::from(**b)).count();
            assert!(near > 10 || transfer.uses_gradient(), "{near}");
        }
    }

    #[test]
    fn maxima_are_those_of_every_interval() {
        let values: Vec<f64> = (0..37).map(|i| noise([i, 0, 0], 3)).collect();
        let maxima = Maxima::of(values.clone());
        for from in 0..37 {
            for to in from..37 {
                let expected = values[from..=to].iter().fold(0.0f64, |m, v| m.max(*v));
                assert_eq!(maxima.over(from, to), expected, "{from} {to}");
            }
        }
    }
}
