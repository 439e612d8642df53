//! The ellipsoid diagram (thesis 7.6).
//!
//! Every ellipsoid is ray cast as a quadric; nothing is meshed. A pixel's fragments go through an
//! A-buffer, see `ellipsoids/lists`.
//!
//! Lifetimes: the ellipsoids (64 bytes each) and the tiles' lists once per frame. The nodes of the A-buffer grow and
//! are reused: if the ellipsoids' bounding boxes show in advance that all fragments fit, nothing is read back.
//! Otherwise the fragments are counted first, the buffer grows, and the frame is drawn again. Beyond the largest buffer
//! the remaining pixels recompute their fragments in batches: slower, but the same frame. No fragment is dropped.

mod bins;
mod passes;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;

use std::sync::Arc;

use glam::{DMat3, DVec3};
use glioscope_core::optics::Camera;

#[cfg(test)]
pub(crate) use bins::LAYOUTS;
pub use passes::{EllipsoidPick, Ellipsoids};

use crate::{
    device::PassName,
    light::{self, NO_IMAGE, lit::LitKind},
    scene::{Lens, Plan, Quality, Rgb, SlicePlane},
};

/// Fragments of ellipsoids, listed and sorted at each pixel.
pub(crate) const LISTS: PassName = PassName::new("ellipsoid_lists");
/// The diagram's colours, outlines, slice, ring.
pub(crate) const COMPOSE: PassName = PassName::new("ellipsoid_compose");
/// Its pixels whose fragments don't fit on the device. Whether there are any is known only when drawing: the pass is in
/// the frame's plan, not in the scene's.
pub(crate) const REST: PassName = PassName::new("ellipsoid_rest");

/// One ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnEllipsoid {
    /// Returned by picks; also orders fragments of equal depth. Ids should differ; where they don't, the
    /// ellipsoids' other fields order them.
    pub id: u32,
    /// Its centre, world millimetres.
    pub center_mm: DVec3,
    /// Half its extents along its axes; positive.
    pub semi_axes_mm: DVec3,
    /// Its columns are the axes: unit vectors, orthogonal to each other.
    pub rotation: DMat3,
    /// Its colour.
    pub color: Rgb,
    /// 0 (not drawn) to 1 (opaque).
    pub opacity: f64,
}

/// A diagram to draw. Two are equal if they draw the same frame; lists are compared by identity, which
/// is cheap.
#[derive(Clone, Debug)]
pub struct EllipsoidScene {
    /// The ellipsoids. Their order changes no pixel.
    pub ellipsoids: Arc<Vec<DrawnEllipsoid>>,
    /// Multiplies the opacity of each, 0 to 1.
    pub opacity: f64,
    /// The lens; ellipsoids are grey outside its ring. `None` when it is off.
    pub lens: Option<Lens>,
    /// The camera.
    pub camera: Camera,
    /// Background colour.
    pub background: Rgb,
    /// Colour of outlines.
    pub silhouette: Rgb,
    /// A slice among the ellipsoids.
    pub plane: Option<SlicePlane>,
}

impl PartialEq for EllipsoidScene {
    fn eq(&self, other: &Self) -> bool {
        let Self { ellipsoids, opacity, lens, camera, background, silhouette, plane } = self;
        Arc::ptr_eq(ellipsoids, &other.ellipsoids)
            && *opacity == other.opacity
            && *lens == other.lens
            && *camera == other.camera
            && *background == other.background
            && *silhouette == other.silhouette
            && *plane == other.plane
    }
}

impl EllipsoidScene {
    /// Opacity that an ellipsoid is drawn with: its own times that of the scene.
    pub(crate) fn opacity_of(&self, ellipsoid: &DrawnEllipsoid) -> f64 {
        (ellipsoid.opacity * self.opacity).clamp(0.0, 1.0)
    }

    /// The bounding box of all ellipsoids drawn.
    pub(crate) fn bounds_mm(&self) -> Option<(DVec3, DVec3)> {
        let mut bounds: Option<(DVec3, DVec3)> = None;
        for e in self.ellipsoids.iter().filter(|e| self.opacity_of(e) > 0.0) {
            let axes = e.rotation * DMat3::from_diagonal(e.semi_axes_mm);
            let rows = axes.transpose();
            let reach = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
            let (low, high) = (e.center_mm - reach, e.center_mm + reach);
            bounds = Some(bounds.map_or((low, high), |(a, b)| (a.min(low), b.max(high))));
        }
        bounds
    }

    /// The centre of that box; the camera's focus if there are none.
    pub(crate) fn middle_mm(&self) -> DVec3 {
        self.bounds_mm().map_or(self.camera.focus_mm, |(low, high)| (low + high) / 2.0)
    }
}

/// The passes that `scene` needs at `quality`. Omitting the others changes no pixel.
///
/// There is no image, hence nothing for slices and no medium for cones: both modes use vicinity occlusion and layers
/// of each pixel's nearest fragment, with the same result.
pub fn ellipsoid_plan(scene: &EllipsoidScene, quality: &Quality) -> Plan {
    let nothing = if scene.ellipsoids.is_empty() {
        Some("no ellipsoids")
    } else if scene.ellipsoids.iter().all(|e| scene.opacity_of(e) <= 0.0) {
        Some("every ellipsoid is transparent")
    } else {
        None
    };
    let light = light::passes(quality.lighting.mode, LitKind::Depths).iter().copied();
    Plan::of([LISTS].into_iter().chain(light).chain([COMPOSE]), |pass| match pass {
        LISTS => nothing,
        _ => light::omission_reason(pass, quality, nothing, Some(NO_IMAGE)),
    })
}
