//! Display settings of the ellipsoid diagram.

use std::collections::BTreeSet;

use glioscope_core::{
    Regions,
    ellipsoid::{ComponentEllipsoid, Ellipsoid, Of},
};
use serde::{Deserialize, Serialize};

use super::hidden::{bits_of, ids_of};

/// Which ellipsoid represents a connected component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EllipsoidKind {
    /// The minimum-volume ellipsoid enclosing every voxel: exaggerates overlap.
    #[default]
    Enclosing,
    /// Centroid, principal axes and volume of the component: doesn't enclose every voxel.
    Moment,
}

impl EllipsoidKind {
    /// The ellipsoid of this kind of `component`.
    pub fn of(self, component: &ComponentEllipsoid) -> &Ellipsoid {
        match self {
            Self::Enclosing => &component.enclosing,
            Self::Moment => &component.moment,
        }
    }
}

/// Display settings of the diagram.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EllipsoidLook {
    /// Which ellipsoids are drawn.
    pub kind: EllipsoidKind,
    /// Opacity of all ellipsoids, 0 to 1.
    pub opacity: f64,
    /// Components below this volume are hidden.
    pub smallest_ml: f64,
    /// Connectivity of components: 6, 18 or 26 neighbours per voxel.
    pub neighbors: u32,
}

impl Default for EllipsoidLook {
    fn default() -> Self {
        Self { kind: EllipsoidKind::Enclosing, opacity: 0.45, smallest_ml: 0.1, neighbors: 26 }
    }
}

/// What a component is part of, by name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ComponentOf {
    /// The mask with this id.
    Mask(String),
    /// The region of exactly these masks.
    Region(BTreeSet<String>),
}

/// The opacity that the user set for one ellipsoid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EllipsoidOpacity {
    /// Index of its time point in the case.
    pub time: usize,
    /// The connectivity that its component was found with.
    pub neighbors: u32,
    /// What its component is part of; `None` in sessions before version 3.
    #[serde(default)]
    pub of: Option<ComponentOf>,
    /// Number of its component among those of `of`; without it, among all of the time point.
    pub number: u32,
    /// 0 to 1, multiplied by the opacity of all.
    pub opacity: f64,
}

impl EllipsoidOpacity {
    /// The opacity of the component with this index among all of the time point `time`; `None` where there is none.
    pub fn new(
        time: usize,
        neighbors: u32,
        (regions, components): (&Regions, &[ComponentEllipsoid]),
        id: u32,
        opacity: f64,
    ) -> Option<Self> {
        let before = components.get(..id as usize)?;
        let of = components.get(id as usize)?.of;
        let number = before.iter().filter(|component| component.of == of).count() as u32;
        let of = match of {
            Of::Mask(k) => ComponentOf::Mask(regions.mask_ids().get(k)?.clone()),
            Of::Region(bits) => ComponentOf::Region(ids_of(regions.mask_ids(), bits)?),
        };
        Some(Self { time, neighbors, of: Some(of), number, opacity })
    }

    /// Index of its component among all of its time point; `None` where that has no such component.
    pub fn component(&self, regions: &Regions, components: &[ComponentEllipsoid]) -> Option<u32> {
        let of = match &self.of {
            None => return Some(self.number),
            Some(ComponentOf::Mask(id)) => Of::Mask(regions.mask_ids().iter().position(|known| known == id)?),
            Some(ComponentOf::Region(ids)) => Of::Region(bits_of(regions, ids)?),
        };
        let mut numbered = components.iter().zip(0_u32..).filter(|(component, _)| component.of == of);
        numbered.nth(self.number as usize).map(|(_, id)| id)
    }
}
