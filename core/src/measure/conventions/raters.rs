//! Agreement of several raters: majority, STAPLE, Fleiss' kappa. All follow from the number of voxels of each region.

use crate::{Grid, Regions};
use serde::Serialize;

/// Sensitivities and specificities have converged once none changes by more: ITK's 1e-14 of squares.
const CONVERGED: f64 = 1e-7;

/// Iterations after which an estimate is taken as it is. ITK by default has no such limit: raters without anything in common
/// keep it busy for hours.
const MAX_ITERATIONS: usize = 100_000;

/// Which voxels raters are compared over. STAPLE and Fleiss' kappa depend on how much background that is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Domain {
    /// All voxels of the grid, as SimpleITK's STAPLE.
    WholeGrid,
    /// The bounding box of the union of all masks.
    UnionBox,
}

/// The ratings of all voxels of a domain: how many have which set of raters.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratings {
    raters: usize,
    /// Bit k of the first set where rater k has the voxel active.
    voxels: Vec<(u32, u64)>,
    total: u64,
}

/// What [`Ratings::staple`] estimates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Staple {
    /// Part of the estimated truth that each rater has, 0 to 1.
    pub sensitivity: Vec<f64>,
    /// Part of the estimated background that each rater left out, 0 to 1.
    pub specificity: Vec<f64>,
    /// Iterations until nothing changed by more than 1e-7.
    pub iterations: usize,
    /// Whether that was reached; otherwise the figures are those after 100,000 iterations.
    pub converged: bool,
    /// Probability that a voxel with exactly these raters (bit k: rater k; 0: none) is active in truth.
    pub probability: Vec<(u32, f64)>,
    /// Voxels of a probability of at least 0.5.
    pub voxels: u64,
}

impl Ratings {
    /// The ratings of the masks of `regions`, which are on `grid`. `None` where all masks are empty.
    pub fn of(regions: &Regions, grid: &Grid, domain: Domain) -> Option<Self> {
        let size = match domain {
            Domain::WholeGrid => grid.dims(),
            Domain::UnionBox => regions.bounds()?.1,
        };
        let total = size.iter().map(|&n| n as u64).product();
        let union = regions.union_voxels();
        let background = u64::checked_sub(total, union)?;
        let mut voxels: Vec<_> = regions.list().iter().map(|region| (region.bits, region.voxels)).collect();
        if background > 0 {
            voxels.push((0, background));
        }
        (union > 0).then_some(Self { raters: regions.mask_ids().len(), voxels, total })
    }

    /// The regions that more than half of the raters have; of an even number, half isn't enough.
    pub fn majority(&self) -> Vec<u32> {
        let has_it = |bits: &u32| 2 * bits.count_ones() as usize > self.raters;
        self.voxels.iter().map(|v| v.0).filter(has_it).collect()
    }

    /// Voxels of [`Self::majority`].
    pub fn majority_voxels(&self) -> u64 {
        let majority = self.majority();
        self.voxels.iter().filter(|v| majority.contains(&v.0)).map(|v| v.1).sum()
    }

    /// Simultaneous truth and performance level estimation (Warfield, Zou and Wells 2004), as ITK's `STAPLEImageFilter` with
    /// a confidence weight of 1: the prior is the mean part of active voxels, the first estimate the mean of all raters.
    /// `None` where nothing is left to estimate from (all voxels active in all masks).
    pub fn staple(&self) -> Option<Staple> {
        let has = |bits: u32, rater: usize| bits >> rater & 1 == 1;
        let mut truth: Vec<f64> =
            self.voxels.iter().map(|v| f64::from(v.0.count_ones()) / self.raters as f64).collect();
        let weighted = |truth: &[f64], of: &dyn Fn(u32, f64) -> f64| -> f64 {
            self.voxels.iter().zip(truth).map(|(v, &truth)| v.1 as f64 * of(v.0, truth)).sum()
        };
        let prior = weighted(&truth, &|_, truth| truth) / self.total as f64;
        let mut last: Vec<[f64; 2]> = Vec::new();
        let mut iterations = 0;
        loop {
            let active = weighted(&truth, &|_, truth| truth);
            let inactive = weighted(&truth, &|_, truth| 1.0 - truth);
            let of_rater = |rater| {
                let hit = weighted(&truth, &|bits, truth| if has(bits, rater) { truth } else { 0.0 });
                let left = weighted(&truth, &|bits, truth| if has(bits, rater) { 0.0 } else { 1.0 - truth });
                [hit / active, left / inactive]
            };
            let rates: Vec<[f64; 2]> = (0..self.raters).map(of_rater).collect();
            if rates.iter().flatten().any(|rate| !rate.is_finite()) {
                return None;
            }
            for (truth, &(bits, _)) in truth.iter_mut().zip(&self.voxels) {
                let (mut if_active, mut if_inactive) = (prior, 1.0 - prior);
                for (rater, [sensitivity, specificity]) in rates.iter().enumerate() {
                    let rated = has(bits, rater);
                    if_active *= if rated { *sensitivity } else { 1.0 - sensitivity };
                    if_inactive *= if rated { 1.0 - specificity } else { *specificity };
                }
                *truth = if_active / (if_active + if_inactive);
            }
            let change = rates.iter().flatten().zip(last.iter().flatten()).map(|(a, b)| (a - b).abs());
            let converged = iterations > 0 && change.fold(0.0, f64::max) <= CONVERGED;
            if converged || iterations == MAX_ITERATIONS {
                return Some(self.estimate(&rates, &truth, iterations, converged));
            }
            last = rates;
            iterations += 1;
        }
    }

    fn estimate(&self, rates: &[[f64; 2]], truth: &[f64], iterations: usize, converged: bool) -> Staple {
        let probability: Vec<_> = self.voxels.iter().zip(truth).map(|(v, &truth)| (v.0, truth)).collect();
        let active = self.voxels.iter().zip(truth).filter(|(_, truth)| **truth >= 0.5);
        Staple {
            sensitivity: rates.iter().map(|rate| rate[0]).collect(),
            specificity: rates.iter().map(|rate| rate[1]).collect(),
            iterations,
            converged,
            voxels: active.map(|(v, _)| v.1).sum(),
            probability,
        }
    }

    /// Fleiss' kappa (1971) of two categories, active and inactive, over the domain: agreement beyond chance, up to 1. `None`
    /// with fewer than two raters, or where all voxels are rated alike.
    pub fn fleiss_kappa(&self) -> Option<f64> {
        let (n, total) = (self.raters as f64, self.total as f64);
        let mean = |of: &dyn Fn(f64) -> f64| -> f64 {
            self.voxels.iter().map(|v| v.1 as f64 * of(f64::from(v.0.count_ones()))).sum::<f64>() / total
        };
        let agreed = mean(&|k| (k * k + (n - k) * (n - k) - n) / (n * (n - 1.0)));
        let active = mean(&|k| k / n);
        let by_chance = active * active + (1.0 - active) * (1.0 - active);
        Some((agreed - by_chance) / (1.0 - by_chance)).filter(|kappa| kappa.is_finite())
    }
}
