//! Selects a mask's voxels from a volume's values.

use rayon::prelude::*;

use crate::{Cancelled, MaskBits, Progress, Samples, Volume};

/// The mask selected from a volume.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Selected {
    /// Which voxels are active.
    pub bits: MaskBits,
    /// Requested labels that no voxel has, in the order requested.
    pub missing_labels: Vec<i64>,
    /// Voxels with NaN or infinite values, and where labels are requested, with non-integer ones; they are inactive.
    pub invalid: u64,
}

/// Statistics of one slice, besides its bits.
#[derive(Default)]
struct SliceStats {
    /// Whether the k-th requested label occurs.
    labels: Vec<bool>,
    invalid: u64,
}

/// Class of a stored number. `Label` holds the index of the requested label and is active; without requested labels
/// index 0 means "above the threshold".
#[derive(Clone, Copy)]
enum VoxelClass {
    Inactive,
    Label(u16),
    Invalid,
}

/// Which voxels are active.
#[derive(Clone, Copy)]
pub(super) enum Rule<'a> {
    /// Those with one of these labels.
    Labels(&'a [i64]),
    /// Those with a value above this.
    Above(f64),
}

fn above(threshold: f64, value: f64) -> VoxelClass {
    match value {
        v if !v.is_finite() => VoxelClass::Invalid,
        v if v > threshold => VoxelClass::Label(0),
        _ => VoxelClass::Inactive,
    }
}

/// Class of a label, `None` where a number means none. `ranked`: the requested labels, sorted, with their index.
fn of_label(label: Option<f64>, ranked: &[(i64, u16)]) -> VoxelClass {
    let Some(label) = label else { return VoxelClass::Invalid };
    let found = ranked.binary_search_by_key(&(label as i64), |(label, _)| *label);
    found.map_or(VoxelClass::Inactive, |at| VoxelClass::Label(ranked[at].1))
}

/// Packs every x-line into bits; `classify` classifies a stored number. A word of 64 numbers all equal to `blank`, an
/// inactive number, is skipped by one vectorised comparison.
fn pack_bits<T: Copy + PartialEq + Sync>(
    stored: &[T],
    dims: [usize; 3],
    label_count: usize,
    blank: Option<T>,
    classify: impl Fn(T) -> VoxelClass + Sync,
    progress: &Progress,
) -> Result<(MaskBits, SliceStats), Cancelled> {
    let mut bits = MaskBits::empty(dims);
    let per_line = bits.words_per_line();
    let slice = |(out, stored): (&mut [u64], &[T])| -> Result<SliceStats, Cancelled> {
        progress.check()?;
        let mut stats = SliceStats { labels: vec![false; label_count], invalid: 0 };
        for (words, line) in out.chunks_exact_mut(per_line).zip(stored.chunks_exact(dims[0])) {
            for (word, chunk) in words.iter_mut().zip(line.chunks(64)) {
                // No early exit within a chunk, so that its comparison is vectorised.
                if blank.is_some_and(|b| chunk.iter().fold(true, |same, &s| same & (s == b))) {
                    continue;
                }
                for (x, &s) in chunk.iter().enumerate() {
                    match classify(s) {
                        VoxelClass::Inactive => {}
                        VoxelClass::Invalid => stats.invalid += 1,
                        VoxelClass::Label(k) => {
                            *word |= 1 << x;
                            stats.labels[usize::from(k)] = true;
                        }
                    }
                }
            }
        }
        Ok(stats)
    };
    let none = || SliceStats { labels: vec![false; label_count], invalid: 0 };
    let merge = |a: SliceStats, b: SliceStats| SliceStats {
        labels: a.labels.iter().zip(&b.labels).map(|(a, b)| a | b).collect(),
        invalid: a.invalid + b.invalid,
    };
    let outs = bits.words_mut().par_chunks_mut(per_line * dims[1]);
    let stats =
        outs.zip(stored.par_chunks(dims[0] * dims[1])).map(slice).try_reduce(none, |a, b| Ok(merge(a, b)))?;
    Ok((bits, stats))
}

/// The voxels of `volume` that `rule` makes active. NaN and infinite values are inactive and counted.
/// 8- and 16-bit types use a lookup table, others are computed in `f64`.
pub(super) fn select(volume: &Volume, rule: Rule<'_>, progress: &Progress) -> Result<Selected, Cancelled> {
    let (dims, scaling) = (volume.grid().dims(), volume.scaling());
    let labels = match rule {
        Rule::Labels(labels) => Some(labels),
        Rule::Above(_) => None,
    };
    let count = labels.map_or(1, <[i64]>::len);
    let is_integer = volume.samples().is_integer();
    // Of a label asked for twice, the first counts, as the sort is stable.
    let mut ranked: Vec<(i64, u16)> = labels.unwrap_or_default().iter().copied().zip(0..=u16::MAX).collect();
    ranked.sort_by_key(|(label, _)| *label);
    ranked.dedup_by_key(|(label, _)| *label);
    let classify = |stored: f64| match rule {
        Rule::Above(threshold) => above(threshold, scaling.apply(stored)),
        Rule::Labels(_) => of_label(scaling.label(stored, is_integer), &ranked),
    };
    let blank = matches!(classify(0.0), VoxelClass::Inactive);
    macro_rules! table {
        ($v:expr, $int:ty, $unsigned:ty) => {{
            let table: Vec<VoxelClass> =
                (0..=<$unsigned>::MAX).map(|s| classify(f64::from(s as $int))).collect();
            pack_bits($v, dims, count, blank.then_some(0), |s| table[s as $unsigned as usize], progress)
        }};
    }
    macro_rules! computed {
        ($v:expr) => {
            pack_bits($v, dims, count, blank.then_some(Default::default()), |s| classify(s as f64), progress)
        };
    }
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all types")]
    let (bits, stats) = match volume.samples() {
        Samples::U8(v) => table!(v, u8, u8),
        Samples::I8(v) => table!(v, i8, u8),
        Samples::U16(v) => table!(v, u16, u16),
        Samples::I16(v) => table!(v, i16, u16),
        Samples::U32(v) => computed!(v),
        Samples::I32(v) => computed!(v),
        Samples::U64(v) => computed!(v),
        Samples::I64(v) => computed!(v),
        Samples::F32(v) => computed!(v),
        Samples::F64(v) => computed!(v),
    }?;
    let missing_labels = labels.map_or(Vec::new(), |labels| {
        labels.iter().zip(&stats.labels).filter(|(_, there)| !**there).map(|(&l, _)| l).collect()
    });
    Ok(Selected { bits, missing_labels, invalid: stats.invalid })
}

/// The distinct values of a volume, ascending, if it looks like a label map: at most `max_values` of them, all
/// integers. `None` otherwise.
pub(super) fn label_map_values(volume: &Volume, max_values: usize) -> Option<Vec<i64>> {
    let (scaling, is_integer) = (volume.scaling(), volume.samples().is_integer());
    let mut values: Vec<i64> = Vec::new();
    let mut add = |stored: f64| {
        let Some(label) = scaling.label(stored, is_integer).map(|label| label as i64) else { return false };
        if !values.contains(&label) {
            values.push(label);
        }
        values.len() <= max_values
    };
    macro_rules! each_change {
        ($v:expr) => {{
            let mut last = None;
            $v.iter().all(|&s| {
                let same = last == Some(s);
                last = Some(s);
                same || add(s as f64)
            })
        }};
    }
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all types")]
    let is_label_map = crate::with_samples!(volume.samples(), v => each_change!(v));
    values.sort_unstable();
    is_label_map.then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Scaling};
    use glam::DVec3;

    fn volume(samples: Samples, scaling: Scaling) -> Volume {
        let n = samples.len();
        let grid = Grid::axis_aligned([n, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        Volume::new(grid, samples, scaling).unwrap()
    }

    fn active(volume: &Volume, labels: Option<&[i64]>) -> Vec<usize> {
        let mut on = Vec::new();
        select(volume, rule(labels), &Progress::new()).unwrap().bits.for_each(|l| on.push(l));
        on
    }

    fn rule(labels: Option<&[i64]>) -> Rule<'_> {
        labels.map_or(Rule::Above(0.5), Rule::Labels)
    }

    /// The same small numbers in each of the ten data types.
    fn in_every_type(numbers: &[u8]) -> Vec<Samples> {
        macro_rules! all {
            ($($variant:ident: $t:ty),*) => {
                vec![$(Samples::$variant(numbers.iter().map(|&n| n as $t).collect())),*]
            };
        }
        all!(U8: u8, I8: i8, U16: u16, I16: i16, U32: u32, I32: i32, U64: u64, I64: i64, F32: f32, F64: f64)
    }

    #[test]
    fn every_data_type_selects_the_same_voxels() {
        let numbers: Vec<u8> = (0..200_u32).map(|i| (i * i % 7) as u8).collect();
        let expected = |hit: &dyn Fn(u8) -> bool| -> Vec<usize> {
            numbers.iter().enumerate().filter(|(_, n)| hit(**n)).map(|(i, _)| i).collect()
        };
        for samples in in_every_type(&numbers) {
            let v = volume(samples.clone(), Scaling::NONE);
            assert_eq!(active(&v, None), expected(&|n| n > 0));
            assert_eq!(active(&v, Some(&[1, 4])), expected(&|n| n == 1 || n == 4));
            assert_eq!(active(&v, Some(&[0])), expected(&|n| n == 0));
            // value = 0.25 n - 0.5: above 0.5 from 5 on; integers only at 2 (0) and 6 (1).
            let v = volume(samples, Scaling { slope: 0.25, intercept: -0.5 });
            assert_eq!(active(&v, None), expected(&|n| n >= 5));
            let s = select(&v, rule(Some(&[1, 0, 9])), &Progress::new()).unwrap();
            assert_eq!(active(&v, Some(&[1, 0, 9])), expected(&|n| n == 6 || n == 2));
            assert_eq!(
                s.missing_labels,
                [1, 9].iter().copied().filter(|&l| l == 9 || !numbers.contains(&6)).collect::<Vec<_>>()
            );
            assert_eq!(s.invalid, expected(&|n| n != 2 && n != 6).len() as u64);
        }
    }

    #[test]
    fn negative_and_extreme_labels_are_selected() {
        let v = volume(Samples::I16(vec![-1, i16::MIN, i16::MAX, 0]), Scaling::NONE);
        assert_eq!(active(&v, Some(&[-1, i64::from(i16::MIN)])), [0, 1]);
        assert_eq!(active(&v, None), [2]);
        let v = volume(Samples::F32(vec![f32::NAN, f32::INFINITY, 0.5, 0.51, -3.0]), Scaling::NONE);
        assert_eq!(active(&v, None), [3]);
        assert_eq!(select(&v, rule(None), &Progress::new()).unwrap().invalid, 2);
        let s = select(&v, rule(Some(&[-3])), &Progress::new()).unwrap();
        assert_eq!((s.bits.count(), s.invalid), (1, 4));
    }

    #[test]
    fn label_maps_are_recognised() {
        let v = volume(Samples::U8(vec![0, 0, 4, 1, 4, 2]), Scaling::NONE);
        assert_eq!(label_map_values(&v, 16), Some(vec![0, 1, 2, 4]));
        assert_eq!(label_map_values(&v, 3), None);
        let v = volume(Samples::F32(vec![0.0, 0.3]), Scaling::NONE);
        assert_eq!(label_map_values(&v, 16), None);
        let v = volume(Samples::F32(vec![0.0, f32::NAN]), Scaling::NONE);
        assert_eq!(label_map_values(&v, 16), None);
    }
}
