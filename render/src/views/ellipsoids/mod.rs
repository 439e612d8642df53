//! The ellipsoid diagram (thesis 7.6).
//!
//! Every ellipsoid is a quadric that rays are cast at; nothing is meshed. A pixel's fragments go
//! through an A-buffer, see `ellipsoids/lists`.
//!
//! Lifetimes: the ellipsoids (64 bytes each) and the tiles' lists once per frame. The nodes of the A-buffer grow and
//! are kept: where the boxes around the ellipsoids tell beforehand that all fragments will have room, nothing is read
//! back. Else they are counted first, the buffer grows, and the frame is drawn again. Past the largest buffer
//! the pixels left over find their fragments again in batches: slower, the same picture. None is dropped.

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
/// Its pixels whose fragments have no room on the device. Only drawing tells whether there are any: the frame's plan
/// names it, the scene's doesn't.
pub(crate) const REST: PassName = PassName::new("ellipsoid_rest");

/// One ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnEllipsoid {
    /// What a pick names, and what orders fragments at one and the same depth. Ids should differ;
    /// where they don't, the ellipsoids' other numbers order them.
    pub id: u32,
    /// Its centre, world millimetres.
    pub center_mm: DVec3,
    /// Half its extents along its axes; positive.
    pub semi_axes_mm: DVec3,
    /// Its columns are the axes: unit vectors, square to each other.
    pub rotation: DMat3,
    /// Its colour.
    pub color: Rgb,
    /// 0 (not drawn) to 1 (opaque).
    pub opacity: f64,
}

/// A diagram to draw. Two are equal when they draw the same picture: lists by identity, which costs
/// nothing a frame.
#[derive(Clone, Debug)]
pub struct EllipsoidScene {
    /// The ellipsoids. Their order changes no pixel.
    pub ellipsoids: Arc<Vec<DrawnEllipsoid>>,
    /// Multiplies the opacity of each, 0 to 1.
    pub opacity: f64,
    /// The lens: what lies outside its ring is grey. `None` when it is off.
    pub lens: Option<Lens>,
    /// Where it is seen from.
    pub camera: Camera,
    /// What is behind everything.
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
    /// What an ellipsoid is drawn with: its own opacity times that of the scene.
    pub(crate) fn opacity_of(&self, ellipsoid: &DrawnEllipsoid) -> f64 {
        (ellipsoid.opacity * self.opacity).clamp(0.0, 1.0)
    }

    /// The middle of the box around all that is drawn; the camera's focus where that is nothing.
    pub(crate) fn middle_mm(&self) -> DVec3 {
        let mut bounds: Option<(DVec3, DVec3)> = None;
        for e in self.ellipsoids.iter().filter(|e| self.opacity_of(e) > 0.0) {
            let axes = e.rotation * DMat3::from_diagonal(e.semi_axes_mm);
            let rows = axes.transpose();
            let reach = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
            let (low, high) = (e.center_mm - reach, e.center_mm + reach);
            bounds = Some(bounds.map_or((low, high), |(a, b)| (a.min(low), b.max(high))));
        }
        bounds.map_or(self.camera.focus_mm, |(low, high)| (low + high) / 2.0)
    }
}

/// The passes that `scene` needs at `quality`. Leaving the others out changes no pixel.
///
/// There is no image, hence nothing for slices and no medium for cones: with either, light comes from the
/// vicinity of each pixel's nearest fragment, and is the same.
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
        _ => light::left_out(pass, quality, nothing, Some(NO_IMAGE)),
    })
}
