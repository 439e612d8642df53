//! The spherical region of interest.

use glam::DVec3;
use glioscope_core::optics::{Camera, Ray};
use serde::{Deserialize, Serialize};

use crate::device::RenderError;

/// The spherical region of interest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// Centre, world millimetres.
    pub center_mm: DVec3,
    /// Radius; positive.
    pub radius_mm: f64,
}

impl Lens {
    /// Where a ray leaves it, millimetres along the ray; 0 for a ray that starts outside.
    pub(crate) fn leaves_mm(&self, ray: &Ray) -> f64 {
        let from = ray.origin_mm - self.center_mm;
        let (b, inside) = (from.dot(ray.direction), self.radius_mm.powi(2) - from.length_squared());
        if inside > 0.0 { (b * b + inside).sqrt() - b } else { 0.0 }
    }
}

/// Rejects a camera or lens with non-finite numbers or without size.
pub(crate) fn check_view(c: &Camera, lens: Option<&Lens>) -> Result<(), RenderError> {
    let rotation_is_unit = (c.world_from_camera.length() - 1.0).abs() < 1e-3;
    if !(c.focus_mm.is_finite() && rotation_is_unit && c.height_mm.is_finite() && c.height_mm > 0.0) {
        return Err(RenderError::Scene(format!("camera {c:?}")));
    }
    match lens {
        Some(l) if !(l.center_mm.is_finite() && l.radius_mm.is_finite() && l.radius_mm > 0.0) => {
            Err(RenderError::Scene(format!("lens {l:?}")))
        }
        _ => Ok(()),
    }
}
