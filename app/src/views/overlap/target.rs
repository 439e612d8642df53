//! Texts and numbers of a region or mask, for the diagram, the bar and the tables.

use super::{OverlapInput, OverlapMode, Shown};
use crate::{
    format,
    model::{masks::region_name, overlap::mask_shown},
};

/// The region or mask that a piece of the diagram or a table row represents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// The region with these bits.
    Region(u32),
    /// The whole mask k.
    Mask(usize),
}

impl Target {
    /// The bits of a region; `None` for a mask.
    pub(super) fn region(self) -> Option<u32> {
        match self {
            Self::Region(bits) => Some(bits),
            Self::Mask(_) => None,
        }
    }
}

impl OverlapInput<'_> {
    /// `T1+PET`, or the mask's own name.
    pub(super) fn name(&self, target: Target) -> String {
        match target {
            Target::Region(bits) => region_name(self.names, bits),
            Target::Mask(k) => self.names.get(k).cloned().unwrap_or_default(),
        }
    }

    /// The name as a label: `T1 only` for the region of T1 without other masks, to tell it from the whole mask T1.
    pub(super) fn title(&self, target: Target) -> String {
        let name = self.name(target);
        match target {
            Target::Region(bits) if bits.count_ones() == 1 && self.regions.mask_ids().len() > 1 => {
                format!("{name} only")
            }
            _ => name,
        }
    }

    /// Number of voxels; 0 if the target doesn't exist.
    pub(super) fn voxels(&self, target: Target) -> u64 {
        match target {
            Target::Region(bits) => self.regions.get(bits).map_or(0, |r| r.voxels),
            Target::Mask(k) => self.regions.mask_voxels(k),
        }
    }

    /// Volume, ml; 0 if the target doesn't exist.
    pub(super) fn ml(&self, target: Target) -> f64 {
        match target {
            Target::Region(bits) => self.regions.get(bits).map_or(0.0, |r| r.volume_ml),
            Target::Mask(k) => self.regions.mask_ml(k),
        }
    }

    /// Share of the union of all masks, 0 to 1; 0 if the union is empty.
    pub(super) fn share(&self, target: Target) -> f64 {
        let union = self.regions.union_voxels();
        if union == 0 { 0.0 } else { self.voxels(target) as f64 / union as f64 }
    }

    /// Whether all, some or none of it is shown.
    pub(super) fn shown(&self, target: Target) -> Shown {
        match target {
            Target::Region(bits) if self.selection.shows(bits) => Shown::All,
            Target::Region(_) => Shown::None,
            Target::Mask(k) => mask_shown(self.regions, self.selection, k),
        }
    }

    /// Visibility as drawn: in whole-mask mode, a partly shown mask counts as hidden.
    pub(super) fn drawn_visibility(&self, target: Target) -> Shown {
        match self.shown(target) {
            Shown::Some if self.mode == OverlapMode::WholeMasks => Shown::None,
            shown => shown,
        }
    }

    /// Text for screen readers: `T1+PET, 12.30 ml, 14.0 % of union, shown`.
    pub(super) fn accessible_text(&self, target: Target) -> String {
        let prefix = match target {
            Target::Region(_) => "",
            Target::Mask(_) => "Mask ",
        };
        format!(
            "{prefix}{}, {}, {} of union, {}",
            self.title(target),
            format::ml(self.ml(target)),
            format::percent(self.share(target)),
            shown_word(self.shown(target))
        )
    }
}

/// The word for a visibility.
pub fn shown_word(shown: Shown) -> &'static str {
    match shown {
        Shown::All => "shown",
        Shown::Some => "partly shown",
        Shown::None => "hidden",
    }
}
