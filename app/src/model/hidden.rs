//! The hidden regions, by the ids of their masks: bits are numbers of one time point, whose masks may be others than
//! another's.

use std::collections::BTreeSet;

use glioscope_core::{Regions, Selection};
use serde::{Deserialize, Serialize};

/// The regions that the user hid, at every time point that has them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HiddenRegions {
    /// Each by the ids of exactly the masks that are active in it.
    hidden: BTreeSet<BTreeSet<String>>,
}

impl HiddenRegions {
    /// Nothing hidden.
    pub fn none() -> Self {
        Self::default()
    }

    /// What is hidden in `selection`, by names of `regions`.
    pub fn of(regions: &Regions, selection: &Selection) -> Self {
        let mut hidden = Self::none();
        hidden.set(regions, selection);
        hidden
    }

    /// The regions shown at the time point of `regions`.
    pub fn at(&self, regions: &Regions) -> Selection {
        let mut selection = Selection::all();
        for bits in self.hidden.iter().filter_map(|ids| bits_of(regions, ids)) {
            selection.set(bits, false);
        }
        selection
    }

    /// Replaces what is hidden at the time point of `regions`; regions of masks that it lacks stay as they are.
    pub fn set(&mut self, regions: &Regions, selection: &Selection) {
        self.hidden.retain(|ids| bits_of(regions, ids).is_none());
        self.hidden.extend(selection.hidden().filter_map(|bits| ids_of(regions.mask_ids(), bits)));
    }
}

/// Bits of the region of exactly these masks; `None` where the time point lacks one.
pub fn bits_of(regions: &Regions, ids: &BTreeSet<String>) -> Option<u32> {
    let all = regions.mask_ids();
    ids.iter().try_fold(0_u32, |bits, id| Some(bits | 1 << all.iter().position(|known| known == id)?))
}

/// Ids of the masks of a region; `None` where a bit is of no mask.
pub fn ids_of(mask_ids: &[String], bits: u32) -> Option<BTreeSet<String>> {
    let known = if mask_ids.len() < 32 { (1 << mask_ids.len()) - 1 } else { u32::MAX };
    let of_bits = |(k, _): &(usize, &String)| bits >> k & 1 == 1;
    (bits != 0 && bits & !known == 0)
        .then(|| mask_ids.iter().enumerate().filter(of_bits).map(|(_, id)| id.clone()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glioscope_core::{Grid, Mask, MaskBits, TumorIndex};

    /// The regions of masks with these ids, with one voxel for every combination.
    fn regions(ids: &[&str]) -> Regions {
        let grid = Grid::axis_aligned([1 << ids.len(), 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = |(k, id): (usize, &&str)| {
            let bits = MaskBits::from_fn(grid.dims(), |i| i >> k & 1 == 1);
            Mask::new(*id, grid.clone(), bits).unwrap()
        };
        let masks: Vec<Mask> = ids.iter().enumerate().map(mask).collect();
        Regions::of(&TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap())
    }

    #[test]
    fn what_is_hidden_at_one_date_is_the_same_masks_at_another() {
        let [first, other] = [regions(&["T1", "T2", "PET"]), regions(&["PET", "T2"])];
        let mut selection = Selection::all();
        selection.set(0b110, false); // T2+PET
        selection.set(0b001, false); // T1
        let mut hidden = HiddenRegions::of(&first, &selection);
        assert_eq!(hidden.at(&first), selection);
        let shown = hidden.at(&other);
        assert_eq!([0b01, 0b10, 0b11].map(|bits| shown.shows(bits)), [true, true, false]);
        // What is done there leaves the mask that it lacks alone.
        hidden.set(&other, &Selection::all());
        assert_eq!(hidden.at(&first).hidden().collect::<Vec<_>>(), [0b001]);
    }
}
