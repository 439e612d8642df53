//! The spherical region of interest.

use glam::DVec3;
use glioscope_core::optics::Camera;
use serde::{Deserialize, Serialize};

use crate::device::RenderError;

/// The spherical region of interest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    /// Its centre, world millimetres.
    pub center_mm: DVec3,
    /// Its radius; positive.
    pub radius_mm: f64,
}

/// Refuses a camera or a lens that is not a number or has no size.
pub(crate) fn check_view(c: &Camera, lens: Option<&Lens>) -> Result<(), RenderError> {
    let turn_is_unit = (c.world_from_camera.length() - 1.0).abs() < 1e-3;
    if !(c.focus_mm.is_finite() && turn_is_unit && c.height_mm.is_finite() && c.height_mm > 0.0) {
        return Err(RenderError::Scene(format!("camera {c:?}")));
    }
    match lens {
        Some(l) if !(l.center_mm.is_finite() && l.radius_mm.is_finite() && l.radius_mm > 0.0) => {
            Err(RenderError::Scene(format!("lens {l:?}")))
        }
        _ => Ok(()),
    }
}
