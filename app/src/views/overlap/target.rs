//! What the diagram, the bar and the tables say about a region or a mask: one place for the words.

use super::{OverlapInput, OverlapMode, Shown};
use crate::{format, model::overlap::mask_shown};

/// What one piece of the view stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// The region with these bits.
    Region(u32),
    /// Mask k as a whole.
    Mask(usize),
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
            format::ml(self.ml(target)),
            format::percent(self.share(target)),
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
