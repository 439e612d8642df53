//! Grey windows, and presets from an image's histogram.

use glioscope_core::{Scaling, Unit, Volume, with_samples};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Values at `low` and below are black, at `high` and above white, linear between. Image units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Black.
    pub low: f64,
    /// White. Where it isn't above `low`, the window is a step: white above `low`, else black.
    pub high: f64,
}

impl Window {
    /// The window around `level`, `width` wide.
    pub fn of_level(level: f64, width: f64) -> Self {
        Self { low: level - width / 2.0, high: level + width / 2.0 }
    }

    /// The value of middle grey.
    pub fn level(self) -> f64 {
        (self.low + self.high) / 2.0
    }

    /// Difference of the values of white and black.
    pub fn width(self) -> f64 {
        self.high - self.low
    }

    /// The window that shows another image of the same kind alike: the background, or the 1st percentile where one of them has none, and the
    /// 99th percentile keep their greys. Images in Hounsfield units keep the values, as do images without percentiles.
    #[must_use]
    pub fn matched(self, from: &Histogram, to: &Histogram) -> Self {
        let (Some(mut from_range), Some(mut to_range)) = (from.p01_p99(), to.p01_p99()) else { return self };
        if let (Some(from), Some(to)) = (from.background(), to.background())
            && from < from_range.1
            && to < to_range.1
        {
            (from_range.0, to_range.0) = (from, to);
        }
        let width = from_range.1 - from_range.0;
        if from.looks_like_ct() || to.looks_like_ct() || width.is_nan() || width <= 0.0 {
            return self;
        }
        let scale = (to_range.1 - to_range.0) / width;
        let [low, high] = [self.low, self.high].map(|value| to_range.0 + (value - from_range.0) * scale);
        Self { low, high }
    }

    /// Grey of a value, rounded to the nearest of 0 to 255. NaN gives black: callers must handle it.
    pub fn grey(self, value: f64) -> u8 {
        let (scale, offset) = self.scale_offset();
        (value * scale + offset) as u8
    }

    /// `value · scale + offset`, cast to `u8`, is [`Window::grey`].
    pub(super) fn scale_offset(self) -> (f64, f64) {
        let width = self.width();
        // A width this small relative to the level can't be resolved: use a step.
        if width > 1e-12 * self.low.abs().max(self.high.abs()) {
            let scale = 255.0 / width;
            (scale, 0.5 - self.low * scale)
        } else {
            let scale = 1e12 / self.low.abs().max(1e-200);
            (scale, -self.low * scale)
        }
    }

    /// The window after dragging by `dx`, `dy` screen points (y down): right widens, by a factor of e
    /// every 300 points; down raises the level and so darkens, by the width every 300 points.
    /// Dragging back restores it. `range` (smallest and largest value) bounds the result: the level stays
    /// within it, the width between a millionth and four times its width.
    #[must_use]
    pub fn drag(self, dx: f64, dy: f64, range: (f64, f64)) -> Self {
        let whole = (range.1 - range.0).max(f64::MIN_POSITIVE);
        let width = (self.width() * (dx / 300.0).exp()).clamp(whole * 1e-6, whole * 4.0);
        let level = (self.level() + dy / 300.0 * self.width()).clamp(range.0, range.1.max(range.0));
        Self::of_level(level, width)
    }
}

/// A named window.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// Menu text; states where the kind of image was guessed.
    pub name: &'static str,
    /// The window.
    pub window: Window,
}

/// High end of PET's window, in SUV.
const PET_HIGH_SUV: f64 = 10.0;

/// Share of finite voxels with the same value, the smallest or 0, above which that value counts as
/// background: padding of a CT, or the zeros that skull stripping leaves.
const BACKGROUND_SHARE: f64 = 0.05;

/// Half the width of the values that count as one background, as a share of the range from the 0.1st to the 99.9th percentile.
const NEAR_SHARE: f64 = 1e-3;
/// Percentiles that are kept, as shares. The window ends at the last: the 99th percentile of a head is less than many a lesion's values, and
/// on FLAIR of a real glioma 22 to 71 % of its parts would be white.
const SHARES: [f64; 3] = [0.01, 0.99, 0.999];
/// Distribution of an image's values. NaN and infinities are only counted.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    range: Option<(f64, f64)>,
    not_finite: u64,
    background: Option<f64>,
    percentiles: Option<[f64; SHARES.len()]>,
    looks_like_ct: bool,
}

/// A stored number.
trait Stored: Copy + Send + Sync {
    fn value(self) -> f64;
}

macro_rules! stored {
    ($($t:ty),*) => { $(impl Stored for $t {
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
        #[inline]
        fn value(self) -> f64 { self as f64 }
    })* };
}
stored!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

/// An integer key in the order of the values; equal for both zeros.
fn ordered(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

fn from_ordered(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 { key & !(1 << 31) } else { !key })
}

/// Voxel counts by the upper half of [`ordered`].
struct Tally {
    by_key: Vec<u64>,
    range: Option<(f64, f64)>,
    at_smallest: u64,
    zeros: u64,
    air: u64,
    not_finite: u64,
}

impl Tally {
    fn new() -> Self {
        let by_key = vec![0; 1 << 16];
        Self { by_key, range: None, at_smallest: 0, zeros: 0, air: 0, not_finite: 0 }
    }

    #[inline]
    fn add(&mut self, value: f64) {
        if !value.is_finite() {
            self.not_finite += 1;
            return;
        }
        let (lo, hi) = self.range.unwrap_or((value, value));
        if value < lo {
            self.at_smallest = 0;
        }
        let lo = lo.min(value);
        self.range = Some((lo, hi.max(value)));
        self.at_smallest += u64::from(value == lo);
        self.zeros += u64::from(value == 0.0);
        self.air += u64::from(value <= -700.0);
        self.by_key[(ordered(value as f32) >> 16) as usize] += 1;
    }

    /// The smallest value or 0, and the entries of `by_key` within [`NEAR_SHARE`] of the range about it, where these have enough of the `rest` of voxels
    /// to be background, and leave enough: what interpolation by splines makes of the zeros that skull stripping leaves.
    fn nearly_constant(&self, least: f64, rest: u64) -> Option<(f64, std::ops::Range<usize>)> {
        // Without outliers, of which one would make all others near each other.
        let [low, high] = [0.001, 0.999].map(|share| {
            let rank = (rest.saturating_sub(1) as f64 * share).round() as u64;
            let entry = entry_of_rank(self.by_key.iter().copied(), rank).unwrap_or_default();
            f64::from(from_ordered(entry.0 << 16))
        });
        let reach = NEAR_SHARE * (high - low);
        [least, 0.0].into_iter().find_map(|value| {
            let first = (ordered((value - reach) as f32) >> 16) as usize + 1;
            let last = (ordered((value + reach) as f32) >> 16) as usize;
            let keys = first..last.max(first);
            let voxels: u64 = self.by_key.get(keys.clone())?.iter().sum();
            let is_enough = |voxels: u64| voxels as f64 > BACKGROUND_SHARE * rest as f64;
            (is_enough(voxels) && is_enough(rest - voxels)).then_some((value, keys))
        })
    }

    fn merge(mut self, other: Self) -> Self {
        for (a, b) in self.by_key.iter_mut().zip(other.by_key) {
            *a += b;
        }
        (self.range, self.at_smallest) = match (self.range, other.range) {
            (Some(a), Some(b)) => {
                let count = |r: (f64, f64), n: u64| if r.0 <= a.0.min(b.0) { n } else { 0 };
                (Some((a.0.min(b.0), a.1.max(b.1))), count(a, self.at_smallest) + count(b, other.at_smallest))
            }
            (a, None) => (a, self.at_smallest),
            (None, b) => (b, other.at_smallest),
        };
        self.zeros += other.zeros;
        self.air += other.air;
        self.not_finite += other.not_finite;
        self
    }
}

const CHUNK: usize = 1 << 18;

fn tally<T: Stored>(stored: &[T], scaling: Scaling) -> Tally {
    stored
        .par_chunks(CHUNK)
        .fold(Tally::new, |mut tally, chunk| {
            chunk.iter().for_each(|s| tally.add(scaling.apply(s.value())));
            tally
        })
        .reduce(Tally::new, Tally::merge)
}

/// For each upper key in `uppers`, its voxel counts by the lower half of [`ordered`].
fn tally_lower<T: Stored, const N: usize>(stored: &[T], scaling: Scaling, uppers: [u32; N]) -> [Vec<u32>; N] {
    let new = || std::array::from_fn(|_| vec![0u32; 1 << 16]);
    stored
        .par_chunks(CHUNK)
        .fold(new, |mut lower, chunk| {
            for s in chunk {
                let value = scaling.apply(s.value());
                let key = ordered(value as f32);
                for (upper, counts) in uppers.iter().zip(&mut lower) {
                    if key >> 16 == *upper && value.is_finite() {
                        counts[(key & 0xffff) as usize] += 1;
                    }
                }
            }
            lower
        })
        .reduce(new, |mut a: [Vec<u32>; N], b| {
            for (a, b) in a.iter_mut().zip(b) {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
            }
            a
        })
}

/// Index of the entry that contains the `rank`-th (from 0) of `counts`, and the rank within it.
fn entry_of_rank(counts: impl Iterator<Item = u64>, rank: u64) -> Option<(u32, u64)> {
    let mut before = 0;
    for (entry, count) in (0..).zip(counts) {
        if rank < before + count {
            return Some((entry, rank - before));
        }
        before += count;
    }
    None
}

impl Histogram {
    /// Counts all voxels of a volume. Percentiles are those of stored values (no interpolation), to
    /// `f32` precision.
    pub fn of(volume: &Volume) -> Self {
        let scaling = volume.scaling();
        let mut t = with_samples!(volume.samples(), v => tally(v, scaling));
        let Some(range) = t.range else {
            return Self {
                range: None,
                not_finite: t.not_finite,
                background: None,
                percentiles: None,
                looks_like_ct: false,
            };
        };
        let finite: u64 = t.by_key.iter().sum();
        let (background, voxels) =
            if t.zeros > t.at_smallest { (0.0, t.zeros) } else { (range.0, t.at_smallest) };
        // A constant image has no background.
        let is_background = voxels as f64 > BACKGROUND_SHARE * finite as f64 && voxels < finite;
        let key = ordered(background as f32);
        let mut rest = finite;
        if is_background {
            t.by_key[(key >> 16) as usize] -= voxels;
            rest -= voxels;
        }
        let mut near = None;
        if let Some((value, keys)) = t.nearly_constant(range.0, rest) {
            let entries = &mut t.by_key[keys];
            rest -= entries.iter().sum::<u64>();
            entries.fill(0);
            near = Some(value);
        }
        let ranks = SHARES.map(|share| ((rest - 1) as f64 * share).round() as u64);
        let entries = ranks.map(|rank| entry_of_rank(t.by_key.iter().copied(), rank).unwrap_or((0, 0)));
        let uppers = entries.map(|e| e.0);
        let mut lower = with_samples!(volume.samples(), v => tally_lower(v, scaling, uppers));
        let found: [f64; SHARES.len()] = std::array::from_fn(|i| {
            if is_background && key >> 16 == uppers[i] {
                let count = &mut lower[i][(key & 0xffff) as usize];
                *count = (u64::from(*count).saturating_sub(voxels)) as u32;
            }
            entry_of_rank(lower[i].iter().map(|&c| u64::from(c)), entries[i].1).map_or(range.0, |(low, _)| {
                // Beyond f32's range the key is that of infinity.
                f64::from(from_ordered(uppers[i] << 16 | low)).clamp(range.0, range.1)
            })
        });
        // In Hounsfield units air is −1000, bone at least 300, and scanners don't go far beyond.
        let looks_like_ct = (-4100.0..=-900.0).contains(&range.0)
            && (300.0..=40000.0).contains(&range.1)
            && t.air as f64 > 0.02 * finite as f64;
        Self {
            range: Some(range),
            not_finite: t.not_finite,
            background: is_background.then_some(background).or(near),
            percentiles: Some(found),
            looks_like_ct,
        }
    }

    /// Smallest and largest finite value; `None` when no voxel is finite.
    pub fn range(&self) -> Option<(f64, f64)> {
        self.range
    }

    /// How many voxels are NaN or infinite.
    pub fn not_finite(&self) -> u64 {
        self.not_finite
    }

    /// The value that counts as background and is left out of the percentiles: the smallest or 0,
    /// where more than 5 % of the finite voxels have exactly this value, or nearly.
    pub fn background(&self) -> Option<f64> {
        self.background
    }

    /// 1st and 99th percentile without background; `None` when no voxel is finite.
    pub fn p01_p99(&self) -> Option<(f64, f64)> {
        self.percentiles.map(|[p01, p99, _]| (p01, p99))
    }

    /// Whether the values look like Hounsfield units: a guess (the smallest is at most −900, air takes part of
    /// the volume, and something is at least as dense as bone), labelled as a guess wherever it is displayed.
    pub fn looks_like_ct(&self) -> bool {
        self.looks_like_ct
    }

    /// Window presets, the initial one first. Never empty.
    pub fn presets(&self) -> Vec<Preset> {
        let of = |range: Option<(f64, f64)>| match range {
            Some((low, high)) if high > low => Window { low, high },
            Some((value, _)) => Window { low: value - 0.5, high: value + 0.5 },
            None => Window { low: 0.0, high: 1.0 },
        };
        // Where background is left out it is black, and what is dark in the head isn't.
        let auto = self.percentiles.map(|[low, _, high]| (self.background.unwrap_or(low).min(low), high));
        let mut presets = vec![
            Preset { name: "Auto (to 99.9 %)", window: of(auto) },
            Preset { name: "1 to 99 %", window: of(self.p01_p99()) },
            Preset { name: "Full range", window: of(self.range) },
        ];
        if self.looks_like_ct {
            let ct = [
                ("Soft tissue 40/400 (looks like CT)", 40.0, 400.0),
                ("Brain 40/80 (looks like CT)", 40.0, 80.0),
                ("Bone 500/2000 (looks like CT)", 500.0, 2000.0),
                ("Lung -600/1500 (looks like CT)", -600.0, 1500.0),
            ];
            let ct = ct.map(|(name, level, width)| Preset { name, window: Window::of_level(level, width) });
            presets.splice(0..0, ct);
        }
        presets
    }

    /// [`Histogram::presets`], and that of PET (`is_pet`, or values in SUV), which is in SUV.
    pub fn presets_of(&self, unit: Unit, is_pet: bool) -> Vec<Preset> {
        let mut presets = self.presets();
        let window = Window { low: 0.0, high: PET_HIGH_SUV };
        match (unit, is_pet) {
            (Unit::SuvBw, _) => presets.insert(0, Preset { name: "PET 0 to 10 SUV", window }),
            // Whether they are SUV, a file such as NIfTI doesn't say.
            (Unit::Unknown, true) => presets.push(Preset { name: "PET 0 to 10 (if values are SUV)", window }),
            (Unit::Unknown, false) => {}
        }
        presets
    }

    /// The initial window: the first of [`Histogram::presets`].
    pub fn initial_window(&self) -> Window {
        self.presets().first().map_or(Window { low: 0.0, high: 1.0 }, |p| p.window)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glioscope_core::{Grid, Samples};

    fn histogram(samples: Samples, scaling: Scaling) -> Histogram {
        let grid = Grid::axis_aligned([samples.len(), 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        Histogram::of(&Volume::new(grid, samples, scaling).unwrap())
    }

    #[test]
    fn percentiles_equal_those_of_a_sorted_list() {
        // 100 003 scattered values, a background of zeros, NaN and infinities.
        let mut values: Vec<f32> = (0..100_003u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) % 1_000_003) as f32 * 1e-3 + 10.0)
            .collect();
        let mut sorted = values.clone();
        sorted.sort_by(f32::total_cmp);
        values.extend([0.0; 30_000]);
        values.extend([f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
        let h = histogram(Samples::F32(values), Scaling { slope: -2.0, intercept: 5.0 });
        assert_eq!(h.not_finite(), 3);
        // Zero became 5, the largest value: no background with a negative slope; so test both.
        assert_eq!(h.background(), None);
        let all =
            histogram(Samples::F32(sorted.iter().copied().chain([0.0; 30_000]).collect()), Scaling::NONE);
        assert_eq!(all.background(), Some(0.0));
        let at = |share: f64| f64::from(sorted[((sorted.len() - 1) as f64 * share).round() as usize]);
        assert_eq!(all.p01_p99(), Some((at(0.01), at(0.99))));
        assert_eq!(all.initial_window(), Window { low: 0.0, high: at(0.999) });
        assert_eq!(all.range(), Some((0.0, f64::from(sorted[sorted.len() - 1]))));
    }

    /// A head about which all is 0, and the same after an interpolation by splines: values beside 0, and an overshoot below it.
    #[test]
    fn background_that_interpolation_spread_is_left_out_too() {
        let head: Vec<f32> = (0..60_000_u32).map(|i| 50.0 + (i.wrapping_mul(7919) % 1000) as f32).collect();
        let whole = |around: &dyn Fn(u32) -> f32| {
            let values = (0..140_000).map(around).chain(head.iter().copied()).collect();
            histogram(Samples::F32(values), Scaling::NONE)
        };
        let plain = whole(&|_| 0.0);
        let spread = whole(&|i| match i {
            0..20 => -20.0,
            // Some places are exactly 0 still.
            20..20_020 => 0.0,
            _ => (f64::from(i % 101) - 50.0) as f32 * 10.0_f32.powi(-(i as i32 % 9) - 3),
        });
        assert_eq!((plain.background(), spread.background()), (Some(0.0), Some(0.0)));
        let (a, b) = (plain.initial_window(), spread.initial_window());
        // The overshoot is 20 voxels of 60,020.
        assert!((a.low - b.low).abs() <= 1.0 && (a.high - b.high).abs() <= 1.0, "{a:?} {b:?}");
        assert!(a.low == 0.0 && (1040.0..1050.0).contains(&b.high), "{b:?}");
        // Black stays black from one date to the next, and the 99th percentile as bright as it was.
        let brighter = histogram(
            Samples::F32((0..140_000).map(|_| 0.0).chain(head.iter().map(|v| 2.0 * v + 300.0)).collect()),
            Scaling::NONE,
        );
        let window = a.matched(&plain, &brighter);
        let (_, p99) = brighter.p01_p99().unwrap();
        assert!(
            window.low == 0.0 && window.grey(p99).abs_diff(a.grey(plain.p01_p99().unwrap().1)) <= 1,
            "{window:?}"
        );
        // Also where interpolation undershoots, so that the first percentile lies below.
        let under = histogram(
            Samples::F32(
                (0..140_000).map(|i| if i < 1500 { -3.0 } else { 0.0 }).chain(head.iter().copied()).collect(),
            ),
            Scaling::NONE,
        );
        assert!(under.p01_p99().unwrap().0 < 0.0 && under.background() == Some(0.0));
        let window = a.matched(&plain, &under);
        assert!(window.low == 0.0 && (window.high / a.high - 1.0).abs() < 0.01, "{window:?}");
        // One voxel far beyond makes no background of all others.
        let outlier = (0..5000).map(|i| i as f32).chain([1e9]).collect();
        assert_eq!(histogram(Samples::F32(outlier), Scaling::NONE).background(), None);
        let few = histogram(Samples::F32((0..1000).map(|i| i as f32).collect()), Scaling::NONE);
        assert_eq!(few.background(), None);
    }

    #[test]
    fn keys_are_in_the_order_of_values() {
        let values = [-f32::MAX, -7.5, -1e-30, 0.0, 1e-30, 2.0, f32::MAX];
        assert_eq!(ordered(-0.0), ordered(0.0));
        assert!(values.windows(2).all(|w| ordered(w[0]) < ordered(w[1])));
        assert!(values.iter().all(|&v| from_ordered(ordered(v)) == v));
    }

    #[test]
    fn padding_is_background_and_a_constant_image_has_none() {
        let ct: Vec<i16> = (0..2000).map(|i| if i < 500 { -1024 } else { i - 1000 }).collect();
        let h = histogram(Samples::I16(ct), Scaling::NONE);
        assert_eq!(h.background(), Some(-1024.0));
        assert_eq!(h.p01_p99(), Some((-485.0, 984.0)));
        let flat = histogram(Samples::U8(vec![7; 100]), Scaling::NONE);
        assert_eq!((flat.background(), flat.p01_p99()), (None, Some((7.0, 7.0))));
        assert_eq!(flat.initial_window(), Window { low: 6.5, high: 7.5 });
        let nothing = histogram(Samples::F32(vec![f32::NAN; 4]), Scaling::NONE);
        assert_eq!((nothing.range(), nothing.not_finite()), (None, 4));
        assert!(!nothing.presets().is_empty());
    }

    #[test]
    fn only_images_with_air_and_bone_look_like_ct() {
        let ct: Vec<i16> = (0..4000).map(|i| if i < 2000 { -1000 } else { i - 2500 }).collect();
        let h = histogram(Samples::I16(ct), Scaling::NONE);
        assert!(h.looks_like_ct());
        assert_eq!(h.initial_window(), Window { low: -160.0, high: 240.0 });
        assert!(h.presets().iter().filter(|p| p.name.contains("CT")).count() >= 3);
        let mr = histogram(Samples::I16((0..4000).collect()), Scaling::NONE);
        assert!(!mr.looks_like_ct() && mr.presets().len() == 3);
        let pet = |unit, is_pet| {
            let window = Window { low: 0.0, high: 10.0 };
            mr.presets_of(unit, is_pet).iter().position(|preset| preset.window == window)
        };
        assert_eq!(pet(Unit::SuvBw, false), Some(0));
        assert_eq!(pet(Unit::Unknown, true), Some(mr.presets().len()), "behind those of its values");
        assert_eq!(pet(Unit::Unknown, false), None);
    }

    #[test]
    fn greys_are_linear_and_clamped() {
        let w = Window { low: -100.0, high: 155.0 };
        for (value, grey) in [(-1e9, 0), (-100.0, 0), (-99.4, 1), (0.0, 100), (154.6, 255), (1e300, 255)] {
            assert_eq!(w.grey(value), grey, "{value}");
        }
        assert_eq!(w.grey(f64::NAN), 0);
        let step = Window { low: 3.0, high: 3.0 };
        assert_eq!([2.9, 3.0, 3.1].map(|v| step.grey(v)), [0, 0, 255]);
        let zero = Window { low: 0.0, high: 0.0 };
        assert_eq!([-1.0, 0.0, 1.0].map(|v| zero.grey(v)), [0, 0, 255]);
    }

    #[test]
    fn dragging_is_reversible_and_never_inverts_the_window() {
        let w = Window { low: 0.0, high: 100.0 };
        let range = (-1000.0, 3000.0);
        let wide = w.drag(300.0, 0.0, range);
        assert!((wide.width() / w.width() - 1f64.exp()).abs() < 1e-12 && wide.level() == 50.0);
        let back = wide.drag(-300.0, 0.0, range);
        assert!((back.low - w.low).abs() < 1e-9 && (back.high - w.high).abs() < 1e-9);
        assert_eq!(w.drag(0.0, 150.0, range), Window { low: 50.0, high: 150.0 });
        let narrow = w.drag(-1e6, -1e9, range);
        assert!(narrow.width() > 0.0 && narrow.level() == -1000.0);
    }
}
