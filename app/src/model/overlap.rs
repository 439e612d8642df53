//! Selection by region or by whole mask, as in the overlap diagram.

use glioscope_core::{Regions, Selection};
use serde::{Deserialize, Serialize};
use strum::VariantArray;

/// Largest number of masks that the ring can show with their overlaps; those of more are drawn as columns.
pub const MAX_RING_MASKS: usize = 3;

/// Whether a click toggles a region or a whole mask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, VariantArray)]
#[serde(rename_all = "snake_case")]
pub enum OverlapMode {
    /// Regions: every overlap separately.
    #[default]
    Regions,
    /// Whole masks; overlaps are not considered (thesis 7.7).
    WholeMasks,
}

/// How much of a region or mask is visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// All of it.
    All,
    /// Some of the mask's regions, but not all.
    Some,
    /// None of it, or it has no voxels.
    None,
}

/// Bits of the regions that mask `k` is part of.
pub fn regions_of_mask(regions: &Regions, k: usize) -> Vec<u32> {
    regions.list().iter().map(|r| r.bits).filter(|bits| bits >> k & 1 == 1).collect()
}

/// How much of mask `k` is visible with this selection.
pub fn mask_shown(regions: &Regions, selection: &Selection, k: usize) -> Shown {
    let of_mask = regions_of_mask(regions, k);
    let shown = of_mask.iter().filter(|bits| selection.shows(**bits)).count();
    match shown {
        0 => Shown::None,
        all if all == of_mask.len() => Shown::All,
        _ => Shown::Some,
    }
}

/// The selection of exactly the voxels of the given masks: every region that contains at least one of them. Bit k of
/// `masks` is mask k.
pub fn whole_masks(regions: &Regions, masks: u32) -> Selection {
    let shown: Vec<u32> = regions.list().iter().map(|r| r.bits).filter(|b| b & masks != 0).collect();
    Selection::only(regions, &shown)
}

/// `selection` after mask `k` is toggled as a whole: exactly the voxels of the fully visible masks, with k added or
/// removed. A mask that lies entirely inside another visible one stays visible as part of it.
pub fn with_mask_toggled(regions: &Regions, selection: &Selection, k: usize) -> Selection {
    let whole = (0..regions.mask_ids().len().min(32))
        .filter(|&k| mask_shown(regions, selection, k) == Shown::All)
        .fold(0_u32, |bits, k| bits | 1 << k);
    whole_masks(regions, whole ^ 1_u32.checked_shl(k as u32).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glioscope_core::{Grid, Mask, MaskBits, TumorIndex};

    #[test]
    fn whole_masks_are_unions() {
        let voxels = [1_u32, 2, 3, 4, 6];
        let grid = Grid::axis_aligned([voxels.len(), 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = |k: usize| {
            let bits = MaskBits::from_fn(grid.dims(), |i| voxels[i] >> k & 1 == 1);
            Mask::new(["a", "b", "c"][k], grid.clone(), bits).unwrap()
        };
        let masks = [mask(0), mask(1), mask(2)];
        let index = TumorIndex::new(grid.clone(), &[&masks[0], &masks[1], &masks[2]]).unwrap();
        let r = Regions::of(&index);
        let s = whole_masks(&r, 0b001);
        assert_eq!(voxels.map(|b| s.shows(b)), [true, false, true, false, false]);
        assert_eq!([0, 1, 2].map(|k| mask_shown(&r, &s, k)), [Shown::All, Shown::Some, Shown::None]);
        let s = with_mask_toggled(&r, &s, 2);
        assert_eq!(voxels.map(|b| s.shows(b)), [true, false, true, true, true]);
        assert_eq!(with_mask_toggled(&r, &s, 2), whole_masks(&r, 1));
        assert!(with_mask_toggled(&r, &whole_masks(&r, 1), 0).is_empty(&r));
        assert_eq!(mask_shown(&r, &Selection::all(), 7), Shown::None);
    }
}
