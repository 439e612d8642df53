//! One binary segmentation.

use crate::grid::{Grid, ijk};

/// One bit per voxel. Each x-line starts a new 64-bit word; bits past the line's end are zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MaskBits {
    dims: [usize; 3],
    words_per_line: usize,
    words: Vec<u64>,
}

impl MaskBits {
    /// All voxels inactive.
    pub fn empty(dims: [usize; 3]) -> Self {
        let words_per_line = dims[0].div_ceil(64);
        Self { dims, words_per_line, words: vec![0; words_per_line * dims[1] * dims[2]] }
    }

    /// All voxels active.
    pub fn full(dims: [usize; 3]) -> Self {
        let mut bits = Self::empty(dims);
        for line in bits.words.chunks_exact_mut(bits.words_per_line.max(1)) {
            for (w, word) in line.iter_mut().enumerate() {
                let remaining = dims[0] - w * 64;
                *word = if remaining >= 64 { u64::MAX } else { (1 << remaining) - 1 };
            }
        }
        bits
    }

    /// Voxels for which `active(linear)` is true, `linear` as in [`Grid::linear`].
    pub fn from_fn(dims: [usize; 3], mut active: impl FnMut(usize) -> bool) -> Self {
        let mut bits = Self::empty(dims);
        let mut linear = 0;
        for line in 0..dims[1] * dims[2] {
            for x in 0..dims[0] {
                if active(linear) {
                    bits.words[line * bits.words_per_line + x / 64] |= 1 << (x % 64);
                }
                linear += 1;
            }
        }
        bits
    }

    /// Voxels along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// 64-bit words per x-line.
    pub fn words_per_line(&self) -> usize {
        self.words_per_line
    }

    /// All words, line after line (`y` before `z`).
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// All words, mutable; callers leave the bits past a line's end zero.
    pub(crate) fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Whether voxel `ijk` (inside the dims) is active.
    #[inline]
    pub fn get(&self, ijk: [usize; 3]) -> bool {
        let line = ijk[2] * self.dims[1] + ijk[1];
        self.words[line * self.words_per_line + ijk[0] / 64] >> (ijk[0] % 64) & 1 == 1
    }

    /// Active and inactive voxels exchanged.
    pub fn inverted(&self) -> Self {
        let mut out = Self::full(self.dims);
        out.words.iter_mut().zip(&self.words).for_each(|(out, word)| *out &= !word);
        out
    }

    /// Makes voxel `ijk` (inside the dims) active.
    #[inline]
    pub fn set(&mut self, ijk: [usize; 3]) {
        let line = ijk[2] * self.dims[1] + ijk[1];
        self.words[line * self.words_per_line + ijk[0] / 64] |= 1 << (ijk[0] % 64);
    }

    /// Number of active voxels.
    pub fn count(&self) -> u64 {
        self.words.iter().map(|w| u64::from(w.count_ones())).sum()
    }

    /// Bounding box of the active voxels: first voxel and size in voxels; `None` when empty.
    pub fn bounds(&self) -> Option<([usize; 3], [usize; 3])> {
        let mut lo = [usize::MAX; 3];
        let mut hi = [0; 3];
        for (line, words) in self.words.chunks_exact(self.words_per_line.max(1)).enumerate() {
            let (Some(first), Some(last)) =
                (words.iter().position(|&w| w != 0), words.iter().rposition(|&w| w != 0))
            else {
                continue;
            };
            let x = [
                first * 64 + words[first].trailing_zeros() as usize,
                last * 64 + 63 - words[last].leading_zeros() as usize,
            ];
            let yz = [line % self.dims[1], line / self.dims[1]];
            for (axis, (first, last)) in
                [(x[0], x[1]), (yz[0], yz[0]), (yz[1], yz[1])].into_iter().enumerate()
            {
                lo[axis] = lo[axis].min(first);
                hi[axis] = hi[axis].max(last);
            }
        }
        (lo[0] != usize::MAX).then(|| (lo, std::array::from_fn(|a| hi[a] - lo[a] + 1)))
    }

    /// Lengths of runs in memory order: of inactive voxels first (0 where the first voxel is active), then of active and
    /// inactive ones in turn, up to the last active voxel. Empty where none is active.
    pub fn runs(&self) -> Vec<u64> {
        let mut runs = Vec::new();
        // The voxel behind the last run.
        let mut end = 0;
        self.for_each(|linear| {
            let linear = linear as u64;
            match runs.last_mut() {
                Some(length) if linear == end => *length += 1,
                _ => runs.extend([linear - end, 1]),
            }
            end = linear + 1;
        });
        runs
    }

    /// The voxels of [`Self::runs`]; `None` for runs that don't fit the dimensions, that are in excess, or where a run but
    /// the first is empty.
    pub fn of_runs(dims: [usize; 3], runs: &[u64]) -> Option<Self> {
        let voxels = dims.iter().try_fold(1_u64, |product, n| product.checked_mul(*n as u64))?;
        let total = runs.iter().try_fold(0_u64, |sum, length| sum.checked_add(*length))?;
        if total > voxels || runs.len() % 2 == 1 || runs.iter().skip(1).any(|length| *length == 0) {
            return None;
        }
        let mut bits = Self::empty(dims);
        let mut linear = 0;
        for pair in runs.chunks_exact(2) {
            let start = linear + pair[0] as usize;
            linear = start + pair[1] as usize;
            (start..linear).for_each(|at| bits.set(ijk(dims, at)));
        }
        Some(bits)
    }

    /// Calls `visit(linear)` for every active voxel, in memory order.
    pub fn for_each(&self, mut visit: impl FnMut(usize)) {
        for (line, words) in self.words.chunks_exact(self.words_per_line.max(1)).enumerate() {
            for (w, &word) in words.iter().enumerate() {
                let mut remaining = word;
                while remaining != 0 {
                    visit(line * self.dims[0] + w * 64 + remaining.trailing_zeros() as usize);
                    remaining &= remaining - 1;
                }
            }
        }
    }
}

/// A named segmentation on a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    id: String,
    grid: Grid,
    bits: MaskBits,
}

impl Mask {
    /// `bits` on `grid`; `None` when their dimensions differ.
    pub fn new(id: impl Into<String>, grid: Grid, bits: MaskBits) -> Option<Self> {
        (bits.dims() == grid.dims()).then(|| Self { id: id.into(), grid, bits })
    }

    /// The same under another name.
    pub(crate) fn with_id(&self, id: String) -> Self {
        Self { id, ..self.clone() }
    }

    /// Its name in the case.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Its voxel grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Which voxels are active.
    pub fn bits(&self) -> &MaskBits {
        &self.bits
    }

    /// Number of active voxels.
    pub fn voxels(&self) -> u64 {
        self.bits.count()
    }

    /// Volume of the active voxels in millilitres.
    pub fn volume_ml(&self) -> f64 {
        self.grid.volume_ml(self.voxels())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn runs_hold_every_voxel(dims in [1_usize..80, 1_usize..5, 1_usize..4], seed in any::<u64>(), one_in in 1_u64..9) {
            let random = |at: usize| (at as u64 + 1).wrapping_mul(seed | 1).rotate_left(23).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33;
            let bits = MaskBits::from_fn(dims, |at| random(at) % one_in == 0);
            let runs = bits.runs();
            prop_assert_eq!(runs.iter().skip(1).step_by(2).sum::<u64>(), bits.count());
            prop_assert_eq!(MaskBits::of_runs(dims, &runs), Some(bits));
        }
    }

    #[test]
    fn runs_that_do_not_fit_are_refused() {
        let dims = [4, 2, 1];
        assert_eq!(MaskBits::of_runs(dims, &[1, 2]).unwrap().runs(), [1, 2]);
        assert_eq!(MaskBits::of_runs(dims, &[]), Some(MaskBits::empty(dims)));
        assert_eq!(MaskBits::of_runs(dims, &[0, 8]), Some(MaskBits::full(dims)));
        for runs in [&[0, 9][..], &[3], &[1, 0], &[1, 2, 0, 1], &[u64::MAX, 2]] {
            assert_eq!(MaskBits::of_runs(dims, runs), None, "{runs:?}");
        }
        assert_eq!(MaskBits::of_runs([usize::MAX, 3, 1], &[0, 1]), None);
    }

    #[test]
    fn bits_cross_word_and_line_boundaries() {
        for nx in [1, 63, 64, 65, 130] {
            let dims = [nx, 3, 2];
            let bits = MaskBits::from_fn(dims, |l| l % 3 == 0);
            let n = nx * 6;
            assert_eq!(bits.count(), n.div_ceil(3) as u64);
            let mut visited = Vec::new();
            bits.for_each(|l| visited.push(l));
            assert_eq!(visited, (0..n).step_by(3).collect::<Vec<_>>());
            for &l in &visited {
                assert!(bits.get([l % nx, l / nx % 3, l / nx / 3]));
            }
        }
    }

    #[test]
    fn bounds_of_empty_one_voxel_and_full_masks() {
        let dims = [70, 4, 5];
        let mut bits = MaskBits::empty(dims);
        assert_eq!(bits.bounds(), None);
        bits.set([66, 2, 3]);
        assert_eq!(bits.bounds(), Some(([66, 2, 3], [1, 1, 1])));
        assert_eq!(MaskBits::from_fn(dims, |_| true).bounds(), Some(([0, 0, 0], dims)));
        for nx in [1, 63, 64, 65, 128] {
            assert_eq!(MaskBits::full([nx, 2, 3]), MaskBits::from_fn([nx, 2, 3], |_| true));
        }
    }

    #[test]
    fn each_voxel_is_its_own() {
        for nx in [1, 63, 64, 65, 130] {
            let dims = [nx, 3, 2];
            for voxel in [[0, 0, 0], [nx - 1, 0, 0], [nx / 2, 1, 0], [nx - 1, 2, 1], [0, 1, 1]] {
                let mut bits = MaskBits::empty(dims);
                bits.set(voxel);
                let at = crate::grid::linear(dims, voxel);
                assert_eq!(bits, MaskBits::from_fn(dims, |linear| linear == at));
                assert_eq!((bits.count(), bits.bounds()), (1, Some((voxel, [1; 3]))));
                let outside = bits.inverted();
                assert_eq!(outside, MaskBits::from_fn(dims, |linear| linear != at));
                assert_eq!(outside.count(), nx as u64 * 6 - 1);
                for linear in 0..nx * 6 {
                    let voxel = ijk(dims, linear);
                    assert_eq!((bits.get(voxel), outside.get(voxel)), (linear == at, linear != at));
                }
                bits.set(voxel);
                assert_eq!(bits.count(), 1, "set twice is set");
            }
            let bits = MaskBits::empty(dims);
            assert_eq!(
                (bits.dims(), bits.words_per_line(), bits.words().len()),
                (dims, nx.div_ceil(64), 6 * nx.div_ceil(64))
            );
        }
    }

    /// Voxels of 1 by 2 by 3 mm.
    #[test]
    fn a_mask_has_the_volume_of_its_voxels() {
        let grid = Grid::axis_aligned([4, 3, 2], glam::DVec3::new(1.0, 2.0, 3.0), glam::DVec3::ZERO).unwrap();
        let bits = MaskBits::from_fn([4, 3, 2], |linear| linear < 5);
        let mask = Mask::new("T1", grid.clone(), bits.clone()).unwrap();
        assert_eq!((mask.id(), mask.voxels(), mask.bits()), ("T1", 5, &bits));
        assert!((mask.volume_ml() - 0.03).abs() < 1e-15);
        assert_eq!(mask.grid(), &grid);
        assert_eq!(Mask::new("T1", grid, MaskBits::empty([4, 3, 1])), None);
    }
}
