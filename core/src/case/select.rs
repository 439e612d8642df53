//! From a volume's numbers to a mask's bits.

use rayon::prelude::*;

use crate::{Cancelled, MaskBits, Progress, Samples, Volume};

/// Values this close to a whole number are that number: a slope kept as `f32` makes 3 into
/// 3.0000001.
const WHOLE: f64 = 1e-2;

/// A volume read as a mask.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Selected {
    /// Which voxels are active.
    pub bits: MaskBits,
    /// Labels asked for that no voxel has, in the order asked.
    pub missing: Vec<i64>,
    /// Voxels whose value is not a whole number, where labels were asked for: none is active.
    pub not_whole: u64,
}

/// What one slice says beside its bits.
#[derive(Default)]
struct Seen {
    /// Bit k: the k-th label asked for is there.
    labels: Vec<bool>,
    not_whole: u64,
}

/// What a stored number means: `Some(label index)` active, `None` inactive. Index 0 stands for
/// "above 0.5" where no labels were asked for.
#[derive(Clone, Copy)]
enum Meaning {
    Inactive,
    Label(u16),
    NotWhole,
}

fn meaning(value: f64, labels: Option<&[i64]>) -> Meaning {
    let Some(labels) = labels else {
        return if value > 0.5 { Meaning::Label(0) } else { Meaning::Inactive };
    };
    if value == 0.0 && !labels.contains(&0) {
        return Meaning::Inactive;
    }
    let whole = value.round();
    if !value.is_finite() || (value - whole).abs() > WHOLE {
        return Meaning::NotWhole;
    }
    let found = labels.iter().position(|&l| l as f64 == whole);
    found.map_or(Meaning::Inactive, |k| Meaning::Label(k as u16))
}

/// Packs every line; `of` says what a stored number means. Runs of 64 stored numbers equal to
/// `blank` (which means inactive) cost one comparison each.
fn pack<T: Copy + PartialEq + Sync>(
    stored: &[T],
    dims: [usize; 3],
    label_count: usize,
    blank: Option<T>,
    of: impl Fn(T) -> Meaning + Sync,
    progress: &Progress,
) -> Result<(MaskBits, Seen), Cancelled> {
    let mut bits = MaskBits::empty(dims);
    let per_line = bits.words_per_line();
    let slice = |(out, stored): (&mut [u64], &[T])| -> Result<Seen, Cancelled> {
        progress.check()?;
        let mut seen = Seen { labels: vec![false; label_count], not_whole: 0 };
        for (words, line) in out.chunks_exact_mut(per_line).zip(stored.chunks_exact(dims[0])) {
            for (word, chunk) in words.iter_mut().zip(line.chunks(64)) {
                // No early exit inside: the comparison of a whole chunk is vectorised.
                if blank.is_some_and(|b| chunk.iter().fold(true, |same, &s| same & (s == b))) {
                    continue;
                }
                for (x, &s) in chunk.iter().enumerate() {
                    match of(s) {
                        Meaning::Inactive => {}
                        Meaning::NotWhole => seen.not_whole += 1,
                        Meaning::Label(k) => {
                            *word |= 1 << x;
                            seen.labels[usize::from(k)] = true;
                        }
                    }
                }
            }
        }
        Ok(seen)
    };
    let none = || Seen { labels: vec![false; label_count], not_whole: 0 };
    let merge = |a: Seen, b: Seen| Seen {
        labels: a.labels.iter().zip(&b.labels).map(|(a, b)| a | b).collect(),
        not_whole: a.not_whole + b.not_whole,
    };
    let outs = bits.words_mut().par_chunks_mut(per_line * dims[1]);
    let seen =
        outs.zip(stored.par_chunks(dims[0] * dims[1])).map(slice).try_reduce(none, |a, b| Ok(merge(a, b)))?;
    Ok((bits, seen))
}

/// The voxels of `volume` with one of `labels`; without labels, those above 0.5. NaN is inactive.
/// 8- and 16-bit files are looked up in a table, others computed in `f64`.
pub(super) fn select(
    volume: &Volume,
    labels: Option<&[i64]>,
    progress: &Progress,
) -> Result<Selected, Cancelled> {
    let (dims, scaling) = (volume.grid().dims(), volume.scaling());
    let count = labels.map_or(1, <[i64]>::len);
    let of = |stored: f64| meaning(scaling.apply(stored), labels);
    let blank = matches!(of(0.0), Meaning::Inactive);
    macro_rules! table {
        ($v:expr, $int:ty, $unsigned:ty) => {{
            let table: Vec<Meaning> = (0..=<$unsigned>::MAX).map(|s| of(f64::from(s as $int))).collect();
            pack($v, dims, count, blank.then_some(0), |s| table[s as $unsigned as usize], progress)
        }};
    }
    macro_rules! computed {
        ($v:expr) => {
            pack($v, dims, count, blank.then_some(Default::default()), |s| of(s as f64), progress)
        };
    }
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all types")]
    let (bits, seen) = match volume.samples() {
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
    let missing = labels.map_or(Vec::new(), |labels| {
        labels.iter().zip(&seen.labels).filter(|(_, there)| !**there).map(|(&l, _)| l).collect()
    });
    Ok(Selected { bits, missing, not_whole: seen.not_whole })
}

/// The whole-number values of a volume, ascending, when it has at most `most` different ones, all
/// whole: what a label map looks like. `None` for anything else.
pub(super) fn few_whole_values(volume: &Volume, most: usize) -> Option<Vec<i64>> {
    let scaling = volume.scaling();
    let mut found: Vec<f64> = Vec::new();
    let mut add = |stored: f64| {
        let value = scaling.apply(stored);
        let new = !found.contains(&value);
        if new {
            found.push(value);
        }
        (value - value.round()).abs() <= WHOLE && found.len() <= most
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
    let few = crate::with_samples!(volume.samples(), v => each_change!(v));
    let mut values: Vec<i64> = found.iter().map(|v| v.round() as i64).collect();
    values.sort_unstable();
    values.dedup();
    few.then_some(values)
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
        select(volume, labels, &Progress::new()).unwrap().bits.for_each(|l| on.push(l));
        on
    }

    /// The same small numbers in each of the ten types.
    fn in_every_type(numbers: &[u8]) -> Vec<Samples> {
        macro_rules! all {
            ($($variant:ident: $t:ty),*) => {
                vec![$(Samples::$variant(numbers.iter().map(|&n| n as $t).collect())),*]
            };
        }
        all!(U8: u8, I8: i8, U16: u16, I16: i16, U32: u32, I32: i32, U64: u64, I64: i64, F32: f32, F64: f64)
    }

    #[test]
    fn every_type_gives_the_same_voxels() {
        let numbers: Vec<u8> = (0..200_u32).map(|i| (i * i % 7) as u8).collect();
        let expected = |hit: &dyn Fn(u8) -> bool| -> Vec<usize> {
            numbers.iter().enumerate().filter(|(_, n)| hit(**n)).map(|(i, _)| i).collect()
        };
        for samples in in_every_type(&numbers) {
            let v = volume(samples.clone(), Scaling::NONE);
            assert_eq!(active(&v, None), expected(&|n| n > 0));
            assert_eq!(active(&v, Some(&[1, 4])), expected(&|n| n == 1 || n == 4));
            assert_eq!(active(&v, Some(&[0])), expected(&|n| n == 0));
            // value = 0.25 n - 0.5: above 0.5 from 5 on; whole numbers only at 2 (0) and 6 (1).
            let v = volume(samples, Scaling { slope: 0.25, intercept: -0.5 });
            assert_eq!(active(&v, None), expected(&|n| n >= 5));
            let s = select(&v, Some(&[1, 0, 9]), &Progress::new()).unwrap();
            assert_eq!(active(&v, Some(&[1, 0, 9])), expected(&|n| n == 6 || n == 2));
            assert_eq!(
                s.missing,
                [1, 9].iter().copied().filter(|&l| l == 9 || !numbers.contains(&6)).collect::<Vec<_>>()
            );
            assert_eq!(s.not_whole, expected(&|n| n != 2 && n != 6).len() as u64);
        }
    }

    #[test]
    fn negative_and_extreme_labels() {
        let v = volume(Samples::I16(vec![-1, i16::MIN, i16::MAX, 0]), Scaling::NONE);
        assert_eq!(active(&v, Some(&[-1, i64::from(i16::MIN)])), [0, 1]);
        assert_eq!(active(&v, None), [2]);
        let v = volume(Samples::F32(vec![f32::NAN, f32::INFINITY, 0.5, 0.51, -3.0]), Scaling::NONE);
        assert_eq!(active(&v, None), [1, 3]);
        let s = select(&v, Some(&[-3]), &Progress::new()).unwrap();
        assert_eq!((s.bits.count(), s.not_whole), (1, 4));
    }

    #[test]
    fn what_a_label_map_looks_like() {
        let v = volume(Samples::U8(vec![0, 0, 4, 1, 4, 2]), Scaling::NONE);
        assert_eq!(few_whole_values(&v, 16), Some(vec![0, 1, 2, 4]));
        assert_eq!(few_whole_values(&v, 3), None);
        let v = volume(Samples::F32(vec![0.0, 0.3]), Scaling::NONE);
        assert_eq!(few_whole_values(&v, 16), None);
        let v = volume(Samples::F32(vec![0.0, f32::NAN]), Scaling::NONE);
        assert_eq!(few_whole_values(&v, 16), None);
    }
}
