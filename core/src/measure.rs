//! Dice and Jaccard, and their answers for empty masks.

use serde::Serialize;

use crate::regions::Regions;

/// How far two masks agree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// Id of the one.
    pub a: String,
    /// Id of the other.
    pub b: String,
    /// `2|A∩B| / (|A|+|B|)`, 0 to 1.
    pub dice: f64,
    /// `|A∩B| / |A∪B|`, 0 to 1.
    pub jaccard: f64,
}

/// Every pair of masks, in the order of their ids in the index. Counted on regions, so it costs
/// nothing per voxel.
///
/// Empty masks: both empty agree, Dice and Jaccard are 1 (as in MetricsReloaded and BraTS); one
/// empty and one not, both are 0.
pub fn pairs(regions: &Regions) -> Vec<Pair> {
    let ids = regions.mask_ids();
    let mut out = Vec::new();
    for a in 0..ids.len() {
        for b in a + 1..ids.len() {
            let count = |hit: &dyn Fn(bool, bool) -> bool| -> u64 {
                regions
                    .list()
                    .iter()
                    .filter(|r| hit(r.bits >> a & 1 == 1, r.bits >> b & 1 == 1))
                    .map(|r| r.voxels)
                    .sum()
            };
            let both = count(&|in_a, in_b| in_a && in_b);
            let either = count(&|in_a, in_b| in_a || in_b);
            let ratio = |top: u64, bottom: u64| if bottom == 0 { 1.0 } else { top as f64 / bottom as f64 };
            out.push(Pair {
                a: ids[a].clone(),
                b: ids[b].clone(),
                dice: ratio(2 * both, both + either),
                jaccard: ratio(both, either),
            });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Mask, MaskBits, TumorIndex};
    use glam::DVec3;

    fn pair_of(a: &[usize], b: &[usize]) -> Pair {
        let grid = Grid::axis_aligned([4, 3, 2], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = |id: &str, on: &[usize]| {
            Mask::new(id, grid.clone(), MaskBits::from_fn([4, 3, 2], |l| on.contains(&l))).unwrap()
        };
        let (a, b) = (mask("a", a), mask("b", b));
        let index = TumorIndex::new(grid, &[&a, &b]).unwrap();
        pairs(&Regions::of(&index)).remove(0)
    }

    #[test]
    fn agreement_in_closed_form() {
        let p = pair_of(&[0, 1, 2, 3], &[2, 3, 4, 5, 6, 7]);
        assert!((p.dice - 4.0 / 10.0).abs() < 1e-15);
        assert!((p.jaccard - 2.0 / 8.0).abs() < 1e-15);
    }

    #[test]
    fn empty_masks_have_answers() {
        let both = pair_of(&[], &[]);
        assert_eq!((both.dice, both.jaccard), (1.0, 1.0));
        let one = pair_of(&[1], &[]);
        assert_eq!((one.dice, one.jaccard), (0.0, 0.0));
        let same = pair_of(&[1, 5], &[1, 5]);
        assert_eq!((same.dice, same.jaccard), (1.0, 1.0));
    }
}
