//! World positions of pixels at view depths.

use glam::{DVec2, DVec3};

use super::camera::{Camera, FIELD_OF_VIEW_DEG, Projection, Ray};

/// A camera and a frame size, prepared for stepping through planes of equal view depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// The eye, or the centre of the plane in which orthographic rays start.
    pub eye_mm: DVec3,
    /// Right in the frame; this and the next two are unit vectors in world space.
    pub right: DVec3,
    /// Up in the frame.
    pub up: DVec3,
    /// Away from the viewer.
    pub forward: DVec3,
    /// Pixels across and down.
    pub size: [u32; 2],
    mm_per_pixel: f64,
    mm_per_pixel_per_mm: f64,
}

impl Sight {
    /// For a camera and a frame size in pixels.
    pub fn new(camera: &Camera, size: [u32; 2]) -> Self {
        let [right, up, back] = camera.axes();
        let height_px = f64::from(size[1].max(1));
        let (mm_per_pixel, mm_per_pixel_per_mm) = match camera.projection {
            Projection::Orthographic => (camera.height_mm / height_px, 0.0),
            Projection::Perspective => (0.0, 2.0 * (FIELD_OF_VIEW_DEG / 2.0).to_radians().tan() / height_px),
        };
        Self { eye_mm: camera.eye_mm(), right, up, forward: -back, size, mm_per_pixel, mm_per_pixel_per_mm }
    }

    /// Size of a pixel in millimetres at a view depth; the perspective correction of equation 12.
    pub fn pixel_mm(&self, depth_mm: f64) -> f64 {
        self.mm_per_pixel + self.mm_per_pixel_per_mm * depth_mm
    }

    /// Growth of [`Sight::pixel_mm`] with depth; 0 for the orthographic camera.
    pub fn growth(&self) -> f64 {
        self.mm_per_pixel_per_mm
    }

    /// Pixel centre in pixels from the centre of the frame, y up.
    pub fn from_middle(&self, pixel: [u32; 2]) -> DVec2 {
        DVec2::new(
            f64::from(pixel[0]) + 0.5 - 0.5 * f64::from(self.size[0]),
            0.5 * f64::from(self.size[1]) - f64::from(pixel[1]) - 0.5,
        )
    }

    /// World position on a pixel's line of sight at a view depth.
    pub fn at_mm(&self, pixel: [u32; 2], depth_mm: f64) -> DVec3 {
        let p = self.from_middle(pixel) * self.pixel_mm(depth_mm);
        self.eye_mm + self.right * p.x + self.up * p.y + self.forward * depth_mm
    }

    /// The line of sight through a point in front of the eye: from the eye, or from its plane.
    pub fn line_through(&self, at_mm: DVec3) -> Ray {
        if self.mm_per_pixel_per_mm > 0.0 {
            return Ray {
                origin_mm: self.eye_mm,
                direction: (at_mm - self.eye_mm).normalize_or(self.forward),
            };
        }
        Ray { origin_mm: at_mm - self.forward * self.depth_mm(at_mm), direction: self.forward }
    }

    /// Length of a pixel's line of sight per view depth, at least 1.
    pub fn slant(&self, pixel: [u32; 2]) -> f64 {
        (1.0 + (self.from_middle(pixel) * self.mm_per_pixel_per_mm).length_squared()).sqrt()
    }

    /// View depth of a point.
    pub fn depth_mm(&self, at_mm: DVec3) -> f64 {
        (at_mm - self.eye_mm).dot(self.forward)
    }

    /// Least and greatest view depth of these points, the least clamped to 0; `None` when all are behind
    /// the eye.
    pub fn depths_mm(&self, points_mm: &[DVec3]) -> Option<(f64, f64)> {
        let depths = points_mm.iter().map(|p| self.depth_mm(*p));
        let (near, far) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| (a.min(d), b.max(d)));
        (far > 0.0 && far.is_finite()).then_some((near.max(0.0), far))
    }
}
