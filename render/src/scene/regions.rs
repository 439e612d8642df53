//! The regions of overlapping masks as a scene: everything that drawing them depends on, and nothing else.

use std::sync::Arc;

use glioscope_core::{RegionVolume, Selection, optics::Camera};

use super::{
    lens::Lens,
    palette::{MaskColors, Rgb},
    plane::SlicePlane,
    same,
};

/// Regions to draw: the closeup's scene, from which other views also draw the tumour. Two are equal when they draw
/// the same frame; volumes are compared by identity, which costs nothing per frame.
#[derive(Clone, Debug)]
pub struct RegionScene {
    /// The regions; `None` where no voxel is active.
    pub tumor: Option<Arc<RegionVolume>>,
    /// Which regions the lens shows.
    pub selection: Selection,
    /// Their colours.
    pub colors: MaskColors,
    /// The lens; `None` when it is off: then the selection applies everywhere.
    pub lens: Option<Lens>,
    /// The camera.
    pub camera: Camera,
    /// Background colour.
    pub background: Rgb,
    /// Colour of silhouettes: black on light backgrounds; a light one where black would vanish.
    pub silhouette: Rgb,
    /// A slice in the scene: hidden behind surfaces, blended over what is behind it.
    pub plane: Option<SlicePlane>,
}

impl PartialEq for RegionScene {
    fn eq(&self, other: &Self) -> bool {
        let Self { tumor, selection, colors, lens, camera, background, silhouette, plane } = self;
        same(tumor.as_ref(), other.tumor.as_ref())
            && *selection == other.selection
            && *colors == other.colors
            && *lens == other.lens
            && *camera == other.camera
            && *background == other.background
            && *silhouette == other.silhouette
            && *plane == other.plane
    }
}

impl RegionScene {
    /// Why no surface of a region is drawn; `None` where one is.
    pub(crate) fn nothing_shown(&self) -> Option<&'static str> {
        nothing_shown(self.tumor.as_deref(), &self.selection)
    }
}

/// Why a selection shows nothing of a tumour; `None` where it shows something.
pub(crate) fn nothing_shown(tumor: Option<&RegionVolume>, selection: &Selection) -> Option<&'static str> {
    match tumor {
        None => Some("no mask is active"),
        Some(t) if !t.bits_of_id().iter().any(|&bits| selection.shows(bits)) => Some("selection is empty"),
        Some(_) => None,
    }
}
