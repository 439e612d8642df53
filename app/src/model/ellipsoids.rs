//! Display settings of the ellipsoid diagram.

use glioscope_core::ellipsoid::{ComponentEllipsoid, Ellipsoid};
use serde::{Deserialize, Serialize};

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

/// The opacity that the user set for one ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EllipsoidOpacity {
    /// Index of its time point in the case.
    pub time: usize,
    /// The connectivity that its component was found with.
    pub neighbors: u32,
    /// Its number among the components of that time point.
    pub id: u32,
    /// 0 to 1, multiplied by the opacity of all.
    pub opacity: f64,
}
