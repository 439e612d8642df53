//! A textured rectangle in a 3D view: a slice at its position in the patient.

use std::sync::Arc;

use glam::DVec3;

use crate::device::RenderError;

/// A texture on a rectangle, blended at its depth. Two are equal when they draw the same; textures are
/// compared by identity.
#[derive(Clone, Debug)]
pub struct SlicePlane {
    /// Row after row, 4 bytes per texel (gamma-encoded sRGB, alpha not premultiplied).
    pub rgba: Arc<Vec<u8>>,
    /// Texels across and down.
    pub size_px: [u32; 2],
    /// The outer corner of the first texel.
    pub corner_mm: DVec3,
    /// From that corner along the whole first row.
    pub right_mm: DVec3,
    /// From that corner along the whole first column.
    pub down_mm: DVec3,
    /// 0 (invisible) to 1; multiplies the texture's alpha.
    pub opacity: f64,
}

impl PartialEq for SlicePlane {
    fn eq(&self, other: &Self) -> bool {
        let Self { rgba, size_px, corner_mm, right_mm, down_mm, opacity } = self;
        Arc::ptr_eq(rgba, &other.rgba)
            && *size_px == other.size_px
            && *corner_mm == other.corner_mm
            && *right_mm == other.right_mm
            && *down_mm == other.down_mm
            && *opacity == other.opacity
    }
}

impl SlicePlane {
    /// Whether anything of it could be visible.
    pub(crate) fn shows(&self) -> bool {
        self.opacity > 0.0
    }

    /// Rejects an incomplete texture, a rectangle without area, and non-finite numbers.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let [width, height] = self.size_px.map(u64::from);
        let whole = width * height > 0 && self.rgba.len() as u64 == width * height * 4;
        let area = self.right_mm.cross(self.down_mm).length();
        let finite = self.corner_mm.is_finite() && area.is_finite() && self.opacity.is_finite();
        if whole && finite && area > 1e-9 * self.right_mm.length() * self.down_mm.length() {
            return Ok(());
        }
        Err(RenderError::Scene(format!(
            "a slice of {width}x{height} texels in {} bytes, at {}, {} across, {} down, opacity {}",
            self.rgba.len(),
            self.corner_mm,
            self.right_mm,
            self.down_mm,
            self.opacity
        )))
    }
}
