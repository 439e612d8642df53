//! What the diagram, the bar and the tables say about a region or a mask: one place for the words.

use glioscope_core::{Regions, Selection};

use super::{OverlapInput, OverlapMode, text};

/// What one piece of the view stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// The region with these bits.
    Region(u32),
    /// Mask k as a whole.
    Mask(usize),
}

/// How much of a region or mask is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// All of it.
    All,
    /// Some of a mask's regions.
    Some,
    /// Nothing, or it has no voxel.
    None,
}

/// How much of mask k the selection shows.
pub fn mask_shown(regions: &Regions, selection: &Selection, mask: usize) -> Shown {
    let mut own = regions.list().iter().filter(|r| r.bits >> mask & 1 == 1).map(|r| selection.shows(r.bits));
    match own.next() {
        None => Shown::None,
        Some(first) => match (first, own.all(|s| s == first)) {
            (true, true) => Shown::All,
            (false, true) => Shown::None,
            _ => Shown::Some,
        },
    }
}

/// The selection that shows exactly the voxels of the given masks: a region is shown when any of
/// its masks is among them. Bit k of `masks` is mask k.
pub fn whole_masks(regions: &Regions, masks: u32) -> Selection {
    let shown: Vec<u32> = regions.list().iter().map(|r| r.bits).filter(|b| b & masks != 0).collect();
    Selection::only(regions, &shown)
}

/// `selection` after mask k is turned on or off as a whole: the masks shown whole, with k added or
/// taken out, and their voxels shown. A mask that lies wholly inside another shown one stays visible
/// as part of that one.
pub fn with_mask_toggled(regions: &Regions, selection: &Selection, mask: usize) -> Selection {
    let whole = (0..regions.mask_ids().len().min(32))
        .filter(|&k| mask_shown(regions, selection, k) == Shown::All)
        .fold(0_u32, |bits, k| bits | 1 << k);
    whole_masks(regions, whole ^ 1_u32.checked_shl(mask as u32).unwrap_or(0))
}

impl OverlapInput<'_> {
    /// `T1+PET`, or the mask's own id.
    pub(super) fn name(&self, target: Target) -> String {
        match target {
            Target::Region(bits) => self.regions.name(bits),
            Target::Mask(k) => self.regions.mask_ids().get(k).cloned().unwrap_or_default(),
        }
    }

    /// The name as a label: `T1 only` for what no other mask shares, so that it isn't taken for the
    /// whole mask of that name.
    pub(super) fn title(&self, target: Target) -> String {
        let name = self.name(target);
        match target {
            Target::Region(bits) if bits.count_ones() == 1 && self.regions.mask_ids().len() > 1 => {
                format!("{name} only")
            }
            _ => name,
        }
    }

    /// Voxels of it.
    pub(super) fn voxels(&self, target: Target) -> u64 {
        match target {
            Target::Region(bits) => self.regions.get(bits).map_or(0, |r| r.voxels),
            Target::Mask(k) => self.regions.mask_voxels(k),
        }
    }

    /// Millilitres of it.
    pub(super) fn ml(&self, target: Target) -> f64 {
        match target {
            Target::Region(bits) => self.regions.get(bits).map_or(0.0, |r| r.volume_ml),
            Target::Mask(k) => self.regions.mask_ml(k),
        }
    }

    /// Its share of the union of all masks, 0 to 1; 0 when nothing is active.
    pub(super) fn share(&self, target: Target) -> f64 {
        let union = self.regions.union_voxels();
        if union == 0 { 0.0 } else { self.voxels(target) as f64 / union as f64 }
    }

    /// Whether it is shown.
    pub(super) fn shown(&self, target: Target) -> Shown {
        match target {
            Target::Region(bits) if self.selection.shows(bits) => Shown::All,
            Target::Region(_) => Shown::None,
            Target::Mask(k) => mask_shown(self.regions, self.selection, k),
        }
    }

    /// How it is drawn. Where whole masks are shown, a mask is on or off: one that is seen only where
    /// others overlap it is off.
    pub(super) fn look(&self, target: Target) -> Shown {
        match self.shown(target) {
            Shown::Some if self.mode == OverlapMode::WholeMasks => Shown::None,
            shown => shown,
        }
    }

    /// What a screen reader says: `T1+PET, 12.30 ml, 14 % of union, shown`.
    pub(super) fn spoken(&self, target: Target) -> String {
        let what = match target {
            Target::Region(_) => "",
            Target::Mask(_) => "Mask ",
        };
        format!(
            "{what}{}, {}, {} of union, {}",
            self.title(target),
            text::ml(self.ml(target)),
            text::share(self.share(target)),
            shown_word(self.shown(target))
        )
    }
}

/// The word for it.
pub fn shown_word(shown: Shown) -> &'static str {
    match shown {
        Shown::All => "shown",
        Shown::Some => "partly shown",
        Shown::None => "hidden",
    }
}

#[cfg(test)]
mod tests {
    use super::{super::testing::regions, *};

    #[test]
    fn whole_masks_are_unions() {
        let r = regions(&["a", "b", "c"], &[(1, 5), (2, 6), (3, 7), (4, 8), (6, 9)]);
        let s = whole_masks(&r, 0b001);
        assert_eq!([1, 2, 3, 4, 6].map(|b| s.shows(b)), [true, false, true, false, false]);
        assert_eq!([0, 1, 2].map(|k| mask_shown(&r, &s, k)), [Shown::All, Shown::Some, Shown::None]);
        let s = with_mask_toggled(&r, &s, 2);
        assert_eq!([1, 2, 3, 4, 6].map(|b| s.shows(b)), [true, false, true, true, true]);
        assert_eq!(with_mask_toggled(&r, &s, 2), whole_masks(&r, 1));
        assert!(with_mask_toggled(&r, &whole_masks(&r, 1), 0).is_empty(&r));
        assert_eq!(mask_shown(&r, &Selection::all(), 7), Shown::None);
    }
}
