//! What is to be drawn: everything a frame depends on, and nothing else.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{RegionVolume, Selection};
use serde::{Deserialize, Serialize};

use crate::{
    camera::Camera,
    palette::{MaskColors, Rgb},
    slice_plane::SlicePlane,
};

/// The spherical region of interest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// Its centre, world millimetres.
    pub center_mm: DVec3,
    /// Its radius; positive.
    pub radius_mm: f64,
}

/// A closeup to draw. Two are equal when they draw the same picture: volumes by identity, which costs
/// nothing a frame.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The regions; `None` where no voxel is active.
    pub tumor: Option<Arc<RegionVolume>>,
    /// Which regions the lens shows.
    pub selection: Selection,
    /// Their colours.
    pub colors: MaskColors,
    /// The lens; `None` when it is off: then the selection holds everywhere.
    pub lens: Option<Lens>,
    /// Where it is seen from.
    pub camera: Camera,
    /// What is behind everything.
    pub background: Rgb,
    /// Colour of silhouettes: black on light backgrounds; a light one where black would vanish.
    pub silhouette: Rgb,
    /// A slice among what is seen: hidden behind the surface, blended over what is behind it.
    pub plane: Option<SlicePlane>,
}

impl PartialEq for Scene {
    fn eq(&self, other: &Self) -> bool {
        let Self { tumor, selection, colors, lens, camera, background, silhouette, plane } = self;
        let same_tumor = match (tumor, &other.tumor) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        same_tumor
            && *selection == other.selection
            && *colors == other.colors
            && *lens == other.lens
            && *camera == other.camera
            && *background == other.background
            && *silhouette == other.silhouette
            && *plane == other.plane
    }
}
