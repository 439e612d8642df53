//! The ellipsoid diagram (thesis 7.6): the scene, and the plan of its passes.
//!
//! Every ellipsoid is a quadric that rays are cast at; nothing is meshed. A pixel's fragments go
//! through an A-buffer, see `ellipsoids_lists.wgsl`.

mod bins;
mod frame;
mod renderer;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;

use std::sync::Arc;

use glam::{DMat3, DVec3};

#[cfg(test)]
pub(crate) use bins::GpuEllipsoid;
pub use frame::{EllipsoidFrame, EllipsoidPick};
pub use renderer::EllipsoidRenderer;

use crate::{
    camera::Camera,
    lighting::{NO_IMAGE, Shading, left_out, passes},
    palette::Rgb,
    plan::{PassName, Plan},
    quality::Quality,
    scene::Lens,
    slice_plane::SlicePlane,
};

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
    let shading = quality.lighting.shading;
    let mut order = passes(&PassName::ELLIPSOIDS, shading);
    if shading == Shading::Cones {
        let last = order.len() - 1;
        order.insert(last, PassName::Vicinity);
    }
    Plan::of(&order, |pass| match pass {
        PassName::EllipsoidLists => nothing,
        _ => left_out(pass, quality, nothing, Some(NO_IMAGE)),
    })
}
