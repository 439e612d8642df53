//! Voxel counts of two masks and what follows from them.

use crate::MaskBits;

use super::convention::Empty;

/// Voxels of a reference and of a mask compared with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlap {
    /// Active in the reference.
    pub reference: u64,
    /// Active in the mask compared with it.
    pub compared: u64,
    /// Active in both.
    pub both: u64,
    /// Of the grid.
    pub voxels: u64,
}

impl Overlap {
    /// Counts the voxels of two masks of one size (which the caller ensures).
    pub(super) fn of(reference: &MaskBits, compared: &MaskBits) -> Self {
        let both = reference.words().iter().zip(compared.words());
        Self {
            reference: reference.count(),
            compared: compared.count(),
            both: both.map(|(a, b)| u64::from((a & b).count_ones())).sum(),
            voxels: reference.dims().iter().map(|&n| n as u64).product(),
        }
    }

    /// Which masks are empty; `None` where neither is.
    pub fn empty(&self) -> Option<Empty> {
        match (self.reference, self.compared) {
            (0, 0) => Some(Empty::Both),
            (0, _) => Some(Empty::Reference),
            (_, 0) => Some(Empty::Compared),
            _ => None,
        }
    }

    /// `2|A∩B| / (|A|+|B|)`; NaN for two empty masks, as all ratios here of nothing to nothing.
    pub(super) fn dice(&self) -> f64 {
        2.0 * self.both as f64 / (self.reference + self.compared) as f64
    }

    /// `|A∩B| / |A∪B|`.
    pub(super) fn jaccard(&self) -> f64 {
        self.both as f64 / (self.reference + self.compared - self.both) as f64
    }

    /// `1 − ||A|−|B|| / (|A|+|B|)`.
    pub(super) fn volume_similarity(&self) -> f64 {
        1.0 - self.reference.abs_diff(self.compared) as f64 / (self.reference + self.compared) as f64
    }

    /// `(|B|−|A|) / |A|`, A the reference.
    pub(super) fn relative_volume_difference(&self) -> f64 {
        (self.compared as f64 - self.reference as f64) / self.reference as f64
    }

    /// `|A∩B| / |A|`, A the reference.
    pub(super) fn sensitivity(&self) -> f64 {
        self.both as f64 / self.reference as f64
    }

    /// `|A∩B| / |B|`, A the reference.
    pub(super) fn precision(&self) -> f64 {
        self.both as f64 / self.compared as f64
    }

    /// Cohen's kappa over all voxels of the grid; NaN where all voxels are alike in both masks.
    pub(super) fn kappa(&self) -> f64 {
        let [hit, missed, extra] = [self.both, self.reference - self.both, self.compared - self.both];
        let neither = (self.voxels - hit - missed - extra) as f64;
        let [hit, missed, extra] = [hit, missed, extra].map(|voxels| voxels as f64);
        // Agreement less chance, over 1 less chance; multiplied out, so that a small kappa keeps its digits.
        let most = (hit + extra) * (extra + neither) + (hit + missed) * (missed + neither);
        2.0 * (hit * neither - missed * extra) / most
    }
}
