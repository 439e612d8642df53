//! How the ellipsoid diagram is drawn, as the user chose it.

use glioscope_core::ellipsoid::{ComponentEllipsoid, Ellipsoid};
use serde::{Deserialize, Serialize};

/// Which ellipsoid stands for a component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EllipsoidKind {
    /// The smallest that holds every voxel: exaggerates overlap.
    #[default]
    Enclosing,
    /// Same centroid, axes and volume as the component: doesn't hold every voxel.
    Moment,
}

impl EllipsoidKind {
    /// This kind of `component`.
    pub fn of(self, component: &ComponentEllipsoid) -> &Ellipsoid {
        match self {
            Self::Enclosing => &component.enclosing,
            Self::Moment => &component.moment,
        }
    }
}

/// How the diagram is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EllipsoidLook {
    /// Which ellipsoids.
    pub kind: EllipsoidKind,
    /// Opacity of all, 0 to 1.
    pub opacity: f64,
    /// Components below this volume are hidden.
    pub smallest_ml: f64,
    /// Which voxels are neighbours: 6, 18 or 26.
    pub neighbors: u32,
}

impl Default for EllipsoidLook {
    fn default() -> Self {
        Self { kind: EllipsoidKind::Enclosing, opacity: 0.45, smallest_ml: 0.1, neighbors: 26 }
    }
}

/// The opacity of one ellipsoid, where the user set one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OwnOpacity {
    /// Position of its date in the case.
    pub time: usize,
    /// The neighbourhood that made its component.
    pub neighbors: u32,
    /// Its number among the components of that date.
    pub id: u32,
    /// 0 to 1, multiplied by the opacity of all.
    pub opacity: f64,
}
