//! What the values of a file given as a mask mean: labels, probabilities (a soft mask), or the grey values of an image.

use std::collections::HashSet;

use rayon::prelude::*;

use crate::{Cancelled, Progress, Volume, with_samples};

/// More distinct values than this are no rater's labels; a brain's parcellation may have more, an image has.
const MAX_RATED_VALUES: usize = 64;

/// Distinct values from which values of 0 to 100 may be per cent.
const MIN_PERCENT_VALUES: usize = 10;

/// Highest share of equal values among neighbours in per cent, on the slopes of a soft mask and in the noise of an
/// image. Inside the regions of a label map nearly all neighbours are equal.
const MAX_EQUAL_SHARE: f64 = 0.25;

/// By how much values may leave 0 to 1 and still be probabilities: interpolation overshoots.
const OVERSHOOT: f64 = 0.25;

/// What values mean, if they aren't 0, 1 and labels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    /// Probabilities or partial volumes: `full` (1, or 100 in per cent) is all of a voxel.
    Soft {
        /// The value of a voxel that is full.
        full: f64,
        /// Sum of all probabilities: the number of voxels that is to be expected.
        expected_voxels: f64,
    },
    /// Many values, as of an image.
    Image,
}

/// What is known of the values of a slice or of a volume. NaN and infinite values are left out.
struct Summary {
    min: f64,
    max: f64,
    has_fractions: bool,
    /// Distinct values, up to one more than [`MAX_RATED_VALUES`], as bits.
    distinct: HashSet<u64>,
}

impl Summary {
    const fn bits(value: f64) -> u64 {
        // 0 and -0 are one value.
        (value + 0.0).to_bits()
    }

    fn empty() -> Self {
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, has_fractions: false, distinct: HashSet::new() }
    }

    fn add(&mut self, value: f64, is_label: bool) {
        if !value.is_finite() {
            return;
        }
        self.min = self.min.min(value);
        self.max = self.max.max(value);
        self.has_fractions |= !is_label;
        if self.distinct.len() <= MAX_RATED_VALUES {
            self.distinct.insert(Self::bits(value));
        }
    }

    fn merge(mut self, other: Self) -> Self {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.has_fractions |= other.has_fractions;
        self.distinct.extend(other.distinct);
        self
    }

    fn has_many_values(&self) -> bool {
        self.distinct.len() > MAX_RATED_VALUES
    }
}

#[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all types")]
fn summary(volume: &Volume, progress: &Progress) -> Result<Summary, Cancelled> {
    let (scaling, is_integer) = (volume.scaling(), volume.samples().is_integer());
    let [nx, ny, _] = volume.grid().dims();
    macro_rules! summarise {
        ($v:expr) => {
            $v.par_chunks(nx * ny)
                .map(|slice| {
                    progress.check()?;
                    let (mut summary, mut last) = (Summary::empty(), None);
                    for &stored in slice {
                        // Most voxels are as their neighbour: inactive.
                        if last != Some(stored) {
                            last = Some(stored);
                            let stored = stored as f64;
                            let is_label = scaling.label(stored, is_integer).is_some();
                            summary.add(scaling.apply(stored), is_label);
                        }
                    }
                    Ok(summary)
                })
                .try_reduce(Summary::empty, |a, b| Ok(a.merge(b)))
        };
    }
    with_samples!(volume.samples(), v => summarise!(v))
}

/// Share of pairs of neighbours along x and y with the same value, among those of which neither is `low`, 0 or `high`;
/// 1 without such a pair.
fn equal_share(volume: &Volume, low: f64, high: f64) -> f64 {
    let [nx, ny, nz] = volume.grid().dims();
    let is_plain = |value: f64| value == low || value == 0.0 || value == high || !value.is_finite();
    let of_slice = |z: usize| {
        let (mut equal, mut all) = (0_u64, 0_u64);
        for at in z * nx * ny..(z + 1) * nx * ny {
            let value = volume.value(at);
            if is_plain(value) {
                continue;
            }
            let (x, y) = (at % nx, at / nx % ny);
            let neighbors = [(x + 1 < nx, at + 1), (y + 1 < ny, at + nx)];
            for (_, other) in neighbors.into_iter().filter(|(is_inside, _)| *is_inside) {
                let other = volume.value(other);
                if !is_plain(other) {
                    all += 1;
                    equal += u64::from(value == other);
                }
            }
        }
        (equal, all)
    };
    let (equal, all) = (0..nz).into_par_iter().map(of_slice).reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    if all == 0 { 1.0 } else { equal as f64 / all as f64 }
}

/// What the values mean, if they are more than the labels of a rater: with fractions from 0 to 1 they are
/// probabilities; from 0 to 100 (at least 95 somewhere) they are per cent where neighbours rarely are equal; other ones
/// are an image's where they are many and either have fractions or differ between neighbours.
pub(super) fn meaning(volume: &Volume, progress: &Progress) -> Result<Option<Meaning>, Cancelled> {
    let found = summary(volume, progress)?;
    if !(found.has_fractions || found.distinct.len() >= MIN_PERCENT_VALUES) {
        return Ok(None);
    }
    if found.has_fractions && found.min >= -OVERSHOOT && found.max <= 1.0 + OVERSHOOT {
        return Ok(Some(soft(volume, 1.0)));
    }
    let equal = || equal_share(volume, found.min, found.max);
    let may_be_percent =
        found.min >= 0.0 && (95.0..=100.0).contains(&found.max) && found.distinct.len() >= MIN_PERCENT_VALUES;
    if may_be_percent && equal() <= MAX_EQUAL_SHARE {
        return Ok(Some(soft(volume, 100.0)));
    }
    let is_image = found.has_many_values() && (found.has_fractions || equal() <= MAX_EQUAL_SHARE);
    Ok(is_image.then_some(Meaning::Image))
}

fn soft(volume: &Volume, full: f64) -> Meaning {
    let [nx, ny, nz] = volume.grid().dims();
    let probability = |at: usize| {
        let value = volume.value(at);
        if value.is_finite() { (value / full).clamp(0.0, 1.0) } else { 0.0 }
    };
    // Summed slice by slice, so that the sum doesn't depend on the number of threads.
    let slices: Vec<f64> =
        (0..nz).into_par_iter().map(|z| (z * nx * ny..(z + 1) * nx * ny).map(probability).sum()).collect();
    Meaning::Soft { full, expected_voxels: slices.iter().sum() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Samples, Scaling};
    use glam::DVec3;

    const N: usize = 24;

    fn volume(samples: Samples, scaling: Scaling) -> Volume {
        let grid = Grid::axis_aligned([N; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        Volume::new(grid, samples, scaling).unwrap()
    }

    fn of(samples: Samples, scaling: Scaling) -> Option<Meaning> {
        meaning(&volume(samples, scaling), &Progress::new()).unwrap()
    }

    /// 1 within 5.3 mm of a point, falling to 0 over 4 mm.
    fn ball(at: usize) -> f64 {
        let p = DVec3::new((at % N) as f64, (at / N % N) as f64, (at / N / N) as f64);
        ((5.3 + 4.0 - p.distance(DVec3::new(11.2, 12.1, 10.7))) / 4.0).clamp(0.0, 1.0)
    }

    fn all<T>(value: impl Fn(usize) -> T) -> Vec<T> {
        (0..N * N * N).map(value).collect()
    }

    #[test]
    fn probabilities_are_recognised_in_every_unit_and_their_sum_is_the_expected_volume() {
        let exact: f64 = all(ball).iter().sum();
        let byte = Scaling { slope: 1.0 / 255.0, intercept: 0.0 };
        for (samples, scaling, expected_full) in [
            (Samples::F32(all(|at| ball(at) as f32)), Scaling::NONE, 1.0),
            (Samples::F64(all(|at| 1.1 * ball(at) - 0.05)), Scaling::NONE, 1.0),
            (Samples::U8(all(|at| (255.0 * ball(at)).round() as u8)), byte, 1.0),
            (Samples::U8(all(|at| (100.0 * ball(at)).round() as u8)), Scaling::NONE, 100.0),
            (Samples::F32(all(|at| 100.0 * ball(at) as f32)), Scaling::NONE, 100.0),
        ] {
            let Some(Meaning::Soft { full, expected_voxels }) = of(samples, scaling) else {
                panic!("not recognised: full is {expected_full}")
            };
            assert_eq!(full, expected_full);
            // Overshoot is cut, which changes some voxels at the rim.
            assert!((expected_voxels / exact - 1.0).abs() < 0.03, "{expected_voxels}, exactly {exact}");
        }
    }

    #[test]
    fn labels_are_neither_probabilities_nor_images() {
        let whole = Scaling::NONE;
        assert_eq!(of(Samples::U8(all(|at| u8::from(ball(at) > 0.5))), whole), None);
        assert_eq!(of(Samples::U8(all(|at| (4.0 * ball(at)) as u8)), whole), None);
        // 100 parcels of 6 x 5 x 5 voxels or so, numbered 1 to 100.
        let parcel = |at: usize| (at % N / 5 + at / N % N / 5 * 5 + at / N / N / 6 * 25 + 1) as u8;
        assert_eq!(all(parcel).iter().max(), Some(&100));
        assert_eq!(of(Samples::U8(all(parcel)), whole), None);
        // Seven labels, scaled to the whole range of a byte: none is a whole number.
        let scaling = Scaling { slope: 7.0 / 255.0, intercept: 0.0 };
        let stored = |at: usize| (f64::from(parcel(at) % 8) * 255.0 / 7.0).round() as u8;
        assert_eq!(of(Samples::U8(all(stored)), scaling), None);
        assert_eq!(of(Samples::F32(all(|at| if ball(at) > 0.5 { f32::NAN } else { 1.0 })), whole), None);
    }

    #[test]
    fn images_are_recognised() {
        let noise = |at: usize| (at.wrapping_mul(2_654_435_761) >> 16) % 1000;
        let whole = Scaling::NONE;
        assert_eq!(of(Samples::I16(all(|at| noise(at) as i16)), whole), Some(Meaning::Image));
        assert_eq!(of(Samples::F32(all(|at| noise(at) as f32 * 0.37)), whole), Some(Meaning::Image));
        let outside = |at: usize| if ball(at) > 0.0 { noise(at) as i16 } else { -1024 };
        assert_eq!(of(Samples::I16(all(outside)), whole), Some(Meaning::Image));
    }
    /// Each limit of [`meaning`], on both of its sides.
    #[test]
    fn limits_are_where_they_are_said_to_be() {
        let whole = Scaling::NONE;
        // `count` values from 0 to `max`, the neighbours of which are rarely equal.
        let scattered = |count: usize, max: f64| {
            let step = max / (count - 1) as f64;
            of(Samples::F64(all(|at| ((at.wrapping_mul(2_654_435_761) >> 16) % count) as f64 * step)), whole)
        };
        let rounded = |count: usize, max: usize| {
            let value = |at: usize| (at.wrapping_mul(2_654_435_761) >> 16) % count * max / (count - 1);
            of(Samples::U16(all(|at| value(at) as u16)), whole)
        };
        let is_soft = |found: Option<Meaning>, unit: f64| matches!(found, Some(Meaning::Soft { full, .. }) if full == unit);
        assert!(is_soft(rounded(10, 95), 100.0) && is_soft(rounded(10, 100), 100.0));
        assert_eq!([rounded(9, 95), rounded(10, 94), rounded(10, 101)], [None; 3]);
        assert_eq!([rounded(64, 630), rounded(65, 640)], [None, Some(Meaning::Image)]);
        assert_eq!([scattered(64, 315.0 / 2.0), scattered(65, 160.5)], [None, Some(Meaning::Image)]);
        // 0 and -0 are one value, of nine.
        let signed = |at: usize| match (at.wrapping_mul(2_654_435_761) >> 16) % 9 * 12 {
            0 if at.is_multiple_of(2) => -0.0,
            value => value as f64,
        };
        assert_eq!(of(Samples::F64(all(signed)), whole), None);
        let third = (N * N * N) as f64 / 3.0;
        for (values, expected) in [
            ([0.0, 0.5, 1.25], Some(1.5 * third)),
            ([-0.25, 0.5, 1.0], Some(1.5 * third)),
            ([f64::NAN, 0.5, f64::INFINITY], Some(0.5 * third)),
            ([0.0, 0.5, 1.26], None),
            ([-0.26, 0.5, 1.0], None),
        ] {
            let expected = expected.map(|expected_voxels| Meaning::Soft { full: 1.0, expected_voxels });
            assert_eq!(of(Samples::F64(all(|at| values[at % 3])), whole), expected, "{values:?}");
        }
    }

    /// Of the pairs 5 5, 5 7, 5 5 below and 7 7 below in the first slice three are equal, of 7 in the second none; lowest,
    /// highest and 0 don't count, nor do the ends of lines and slices as neighbours.
    #[test]
    fn neighbours_are_compared_within_lines_and_columns() {
        let stored = vec![5.0, 5.0, 7.0, 5.0, 9.0, 7.0, 7.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let grid = Grid::axis_aligned([3, 2, 2], DVec3::ONE, DVec3::ZERO).unwrap();
        let volume =
            |stored: Vec<f64>| Volume::new(grid.clone(), Samples::F64(stored), Scaling::NONE).unwrap();
        assert_eq!(equal_share(&volume(stored), -1.0, 9.0), 3.0 / 11.0);
        let plain = vec![-1.0, -1.0, 0.0, 0.0, 9.0, 9.0, f64::NAN, f64::NAN, 5.0, 9.0, 9.0, -1.0];
        assert_eq!(equal_share(&volume(plain), -1.0, 9.0), 1.0);
    }
}
