//! Names and colours that the user gave to masks. Files, exports and the command line keep the masks' ids.

use std::collections::{BTreeMap, BTreeSet};

use glioscope_core::case::{Case, CaseMask};
use serde::{Deserialize, Serialize};

/// How a mask is named and coloured, where that differs from the case.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct MaskLook {
    /// Its name; `None`: its id.
    pub name: Option<String>,
    /// Its colour, sRGB; `None`: that of the case or the palette.
    pub color: Option<[u8; 3]>,
}

/// The masks named or coloured by the user, by id.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct MaskLooks(BTreeMap<String, MaskLook>);

impl MaskLooks {
    /// The names that a case itself gives to its masks beside their ids.
    pub fn of_case(case: &Case) -> Self {
        let mut looks = Self::default();
        for mask in case.time_points.iter().flat_map(|time_point| &time_point.masks) {
            // Named at one of its dates is named.
            if mask.name.is_some() {
                looks.set(mask.mask.id(), &MaskLook { name: mask.name.clone(), color: None });
            }
        }
        looks
    }

    /// Takes over the names and colours that a case gives otherwise than it did before.
    pub fn follow(&mut self, before: &Case, now: &Case) {
        fn masks(case: &Case) -> impl Iterator<Item = &CaseMask> {
            case.time_points.iter().flat_map(|time_point| &time_point.masks)
        }
        // The first name and the first colour at any date.
        let look_in = |case: &Case, id: &str| {
            let same = || masks(case).filter(|mask| mask.mask.id() == id);
            (same().find_map(|mask| mask.name.clone()), same().find_map(|mask| mask.color))
        };
        let ids: BTreeSet<&str> = masks(now).map(|mask| mask.mask.id()).collect();
        for id in ids {
            let (name, color) = look_in(before, id);
            let (new_name, new_color) = look_in(now, id);
            let mut look = self.get(id);
            if new_name != name {
                look.name = new_name;
            }
            if new_color != color {
                // That of the case.
                look.color = None;
            }
            self.set(id, &look);
        }
    }

    /// How a mask is named and coloured.
    pub fn get(&self, id: &str) -> MaskLook {
        self.0.get(id).cloned().unwrap_or_default()
    }

    /// Names and colours a mask. A name without letters is none.
    pub fn set(&mut self, id: &str, look: &MaskLook) {
        let name = look.name.clone().filter(|name| !name.trim().is_empty() && name != id);
        let look = MaskLook { name, ..look.clone() };
        if look == MaskLook::default() {
            self.0.remove(id);
        } else {
            self.0.insert(id.to_owned(), look);
        }
    }

    /// The name of a mask.
    pub fn name(&self, id: &str) -> String {
        self.get(id).name.unwrap_or_else(|| id.to_owned())
    }

    /// The names of masks.
    pub fn names(&self, ids: &[String]) -> Vec<String> {
        ids.iter().map(|id| self.name(id)).collect()
    }

    /// The name of a region of these masks: `T1+PET`.
    pub fn region(&self, ids: &[String], bits: u32) -> String {
        region_name(&self.names(ids), bits)
    }
}

/// The name of a region of masks with these names.
pub fn region_name(names: &[String], bits: u32) -> String {
    let active = names.iter().enumerate().filter(|(k, _)| bits >> k & 1 == 1);
    active.map(|(_, name)| name.as_str()).collect::<Vec<_>>().join("+")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_without_a_name_of_their_own_keep_their_id() {
        let ids = ["T1", "T2", "PET"].map(str::to_owned);
        let mut looks = MaskLooks::default();
        looks.set("T2", &MaskLook { name: Some("rater B".into()), color: None });
        assert_eq!(looks.region(&ids, 0b110), "rater B+PET");
        for none in [Some("  ".to_owned()), Some("T2".to_owned()), None] {
            looks.set("T2", &MaskLook { name: none, color: None });
            assert_eq!(looks, MaskLooks::default());
        }
        let red = MaskLook { name: None, color: Some([9, 8, 7]) };
        looks.set("PET", &red);
        let text = serde_json::to_string(&looks).unwrap();
        assert_eq!(serde_json::from_str::<MaskLooks>(&text).unwrap(), looks);
    }
}
