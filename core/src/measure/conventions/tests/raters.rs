//! Agreement of raters: a package's values, closed forms, a textbook's example.

use crate::{Mask, Regions, TumorIndex};

use super::{
    super::{Domain, Ratings},
    *,
};

fn ratings(masks: &[MaskBits], domain: Domain) -> Option<Ratings> {
    let grid = grid(masks[0].dims(), [1.0, 2.0, 3.0]);
    let masks: Vec<Mask> =
        masks.iter().map(|bits| Mask::new("m", grid.clone(), bits.clone()).unwrap()).collect();
    let index = TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap();
    Ratings::of(&Regions::of(&index), &grid, domain)
}

fn four() -> Vec<MaskBits> {
    let dims = [9, 7, 5];
    let mut first = noise(11, dims, 30);
    let also = boxes(dims, &[([2, 2, 1], [4, 3, 2])]);
    also.for_each(|linear| first.set(crate::grid::ijk(dims, linear)));
    let one = |lo, size| boxes(dims, &[(lo, size)]);
    vec![first, one([2, 1, 1], [4, 4, 2]), one([3, 2, 1], [4, 3, 3]), one([2, 2, 1], [5, 3, 2])]
}

/// SimpleITK 2.5.7's STAPLE and statsmodels 0.15.0's kappa, both over the whole grid.
#[test]
fn staple_and_kappa_are_those_of_the_packages() {
    let ratings = ratings(&four(), Domain::WholeGrid).unwrap();
    let staple = ratings.staple().unwrap();
    let sensitivity =
        [0.866_666_662_494_069_8, 0.799_999_989_010_317, 0.799_999_974_097_589_9, 0.999_999_951_342_974_7];
    let specificity = [0.712_280_704_280_411_2, 0.971_929_827_358_258_8, 0.957_894_737_997_315, 1.0];
    for (found, expected) in [(&staple.sensitivity, sensitivity), (&staple.specificity, specificity)] {
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-7, "{found} {expected}");
        }
    }
    assert_eq!((staple.voxels, staple.iterations, ratings.majority_voxels()), (30, 23, 26));
    assert_near(ratings.fleiss_kappa(), Some(0.342_311_305_981_835), "kappa");
}

#[test]
fn raters_who_agree_are_perfect() {
    let mask = boxes([8, 6, 5], &[([1, 1, 1], [3, 3, 2])]);
    let same = ratings(&[mask.clone(), mask.clone(), mask], Domain::WholeGrid).unwrap();
    let staple = same.staple().unwrap();
    assert_eq!((staple.sensitivity, staple.specificity), (vec![1.0; 3], vec![1.0; 3]));
    assert_eq!((staple.voxels, same.majority_voxels(), same.majority()), (18, 18, vec![0b111]));
    assert_eq!(same.fleiss_kappa(), Some(1.0));
}

/// Half of an even number is no majority.
#[test]
fn a_majority_is_more_than_half() {
    let dims = [8, 1, 1];
    let of = |first, n| boxes(dims, &[([first, 0, 0], [n, 1, 1])]);
    let four = ratings(&[of(0, 4), of(1, 4), of(2, 4), of(2, 2)], Domain::WholeGrid).unwrap();
    // Raters at the voxels: 1 2 4 4 2 1.
    assert_eq!((four.majority_voxels(), four.majority()), (2, vec![0b1111]));
    let three = ratings(&[of(0, 4), of(1, 4), of(2, 4)], Domain::WholeGrid).unwrap();
    // 1 2 3 3 2 1.
    assert_eq!(three.majority_voxels(), 4);
}

/// By hand: three raters, counts of active raters 1 2 3 3 2 1 on six voxels, then two of none.
#[test]
fn fleiss_kappa_depends_on_the_background() {
    let dims = [8, 1, 1];
    let of = |first| boxes(dims, &[([first, 0, 0], [4, 1, 1])]);
    let masks = [of(0), of(1), of(2)];
    // In the box pairs agree in 1/3 of four voxels and in two voxels: 20/36; 12 of 18 ratings are active.
    let agreed = 20.0 / 36.0;
    let by_chance = 5.0 / 9.0;
    let boxed = ratings(&masks, Domain::UnionBox).unwrap().fleiss_kappa().unwrap();
    assert!((boxed - (agreed - by_chance) / (1.0 - by_chance)).abs() < 1e-12);
    // On the grid 4/3 + 4 of 8, half of the ratings are active.
    let whole = ratings(&masks, Domain::WholeGrid).unwrap().fleiss_kappa();
    assert_near(whole, Some((2.0 / 3.0 - 0.5) / 0.5), "whole grid");
}

#[test]
fn nothing_to_rate_is_unknown() {
    let dims = [4, 3, 2];
    assert_eq!(ratings(&[MaskBits::empty(dims), MaskBits::empty(dims)], Domain::WholeGrid), None);
    let full = ratings(&[MaskBits::full(dims), MaskBits::full(dims)], Domain::WholeGrid).unwrap();
    assert_eq!((full.staple(), full.fleiss_kappa(), full.majority_voxels()), (None, None, 24));
    let one = ratings(&[boxes(dims, &[([0; 3], [2, 2, 1])])], Domain::UnionBox).unwrap();
    assert_eq!(one.fleiss_kappa(), None);
}

/// Raters who have nothing in common but chance. SimpleITK 2.5.7 takes as many iterations.
#[test]
fn an_estimate_that_drifts_ends_where_the_package_ends() {
    let dims = [20, 20, 20];
    let strangers = [noise(21, dims, 5), noise(22, dims, 5), noise(23, dims, 5)];
    let staple = ratings(&strangers, Domain::WholeGrid).unwrap().staple().unwrap();
    assert!(staple.converged && staple.iterations.abs_diff(27_046) <= 1, "{}", staple.iterations);
    let sensitivity = [0.058_212_617_947_740_48, 0.029_092_931_099_232_628, 0.974_734_464_494_715_2];
    for (found, expected) in staple.sensitivity.iter().zip(sensitivity) {
        assert!((found - expected).abs() < 1e-7, "{found} {expected}");
    }
}

/// Three raters of a box, each with voxels flipped at random: probabilities of all sizes. SimpleITK 2.5.7: 84 voxels of at least 0.5,
/// 52 of at least 0.9.
#[test]
fn the_estimated_truth_is_what_is_likelier_than_not() {
    let dims = [9, 7, 5];
    let whole = boxes(dims, &[([1, 1, 1], [5, 4, 3])]);
    let flipped = |rater: u64| {
        let noise = noise(400 + rater, dims, 12 + 5 * rater);
        MaskBits::from_fn(dims, |linear| {
            let voxel = crate::grid::ijk(dims, linear);
            whole.get(voxel) != noise.get(voxel)
        })
    };
    let staple = ratings(&[flipped(0), flipped(1), flipped(2)], Domain::WholeGrid).unwrap().staple().unwrap();
    assert_eq!((staple.voxels, staple.iterations), (84, 147));
    for (found, expected) in staple.sensitivity.iter().zip([
        0.848_842_953_537_503_6,
        0.549_317_363_478_486_8,
        0.704_900_261_689_398_3,
    ]) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
}
