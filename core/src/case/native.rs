//! Masks as read, on their native grids.

use super::{Aligned, values::Meaning};
use crate::{Grid, Mask};

/// One mask on its native grid.
pub(super) struct NativeMask {
    pub spec: usize,
    pub time: usize,
    /// At its place in the case.
    pub mask: Mask,
    /// The grid of its file.
    pub own_grid: Grid,
    /// Frame of reference of its place, as in [`super::CaseMask`].
    pub frame_of_reference: String,
    /// Where a transform moved it.
    pub aligned: Option<Aligned>,
    pub missing_labels: Vec<i64>,
    pub invalid: u64,
    /// What its file's values mean, where no labels are asked for and they aren't labels.
    pub meaning: Option<Meaning>,
    /// The farthest that a value may lie from its label.
    pub label_tolerance: f64,
}

impl NativeMask {
    /// Of a soft mask: the sum of its probabilities as a volume.
    pub(super) fn expected_volume_ml(&self) -> Option<f64> {
        match self.meaning {
            Some(Meaning::Soft { expected_voxels, .. }) => {
                Some(expected_voxels * self.own_grid.voxel_volume_mm3() / 1000.0)
            }
            _ => None,
        }
    }
}
