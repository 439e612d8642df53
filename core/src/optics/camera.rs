//! The camera of a 3D view.

use glam::{DMat3, DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

/// Vertical field of view of the perspective camera (full angle).
pub const FIELD_OF_VIEW_DEG: f64 = 30.0;

/// Projection of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Projection {
    /// Nearer objects appear larger.
    #[default]
    Perspective,
    /// The scale doesn't depend on depth.
    Orthographic,
}

/// An orbiting camera. Its axes in world space: x right, y up, and it looks along −z at `focus_mm`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Point that it orbits and looks at, world millimetres.
    pub focus_mm: DVec3,
    /// Rotates camera axes to world axes; a unit quaternion.
    pub world_from_camera: DQuat,
    /// Height of the view at the focus, in millimetres. Positive.
    pub height_mm: f64,
    /// Perspective or orthographic.
    pub projection: Projection,
}

/// A ray, such as a pixel's line of sight, in world millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Its origin: for a line of sight the eye, or a point of the eye plane.
    pub origin_mm: DVec3,
    /// Unit length.
    pub direction: DVec3,
}

/// The six anatomical views.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr, VariantArray)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "kebab-case")]
#[allow(missing_docs, reason = "each is the side the viewer stands on")]
pub enum AnatomicalView {
    Anterior,
    Posterior,
    Left,
    Right,
    Superior,
    Inferior,
}

impl AnatomicalView {
    /// Azimuth and elevation, see [`Camera::orientation`].
    pub fn azimuth_elevation_deg(self) -> (f64, f64) {
        match self {
            Self::Anterior => (0.0, 0.0),
            Self::Posterior => (180.0, 0.0),
            Self::Left => (90.0, 0.0),
            Self::Right => (-90.0, 0.0),
            Self::Superior => (0.0, 90.0),
            Self::Inferior => (0.0, -90.0),
        }
    }
}

impl Camera {
    /// World-from-camera rotation of a viewer in front of the patient's face at azimuth 0, at the
    /// patient's left at 90°, behind at 180°, and above at elevation 90°; the patient's head is up.
    pub fn orientation(azimuth_deg: f64, elevation_deg: f64) -> DQuat {
        let (sin_a, cos_a) = azimuth_deg.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation_deg.to_radians().sin_cos();
        // RAS: anterior is +y, the patient's left is −x.
        let back = DVec3::new(-sin_a * cos_e, cos_a * cos_e, sin_e);
        let right = DVec3::new(-cos_a, -sin_a, 0.0);
        let up = back.cross(right);
        DQuat::from_mat3(&DMat3::from_cols(right, up, back))
    }

    /// A camera that shows a ball of `radius_mm` about `focus_mm` with a small margin.
    pub fn fit(focus_mm: DVec3, radius_mm: f64, world_from_camera: DQuat, projection: Projection) -> Self {
        Self { focus_mm, world_from_camera, height_mm: (radius_mm * 2.3).max(1e-3), projection }
    }

    /// Right, up and back (towards the viewer), unit vectors in world space.
    pub fn axes(&self) -> [DVec3; 3] {
        let m = DMat3::from_quat(self.world_from_camera);
        [m.x_axis, m.y_axis, m.z_axis]
    }

    /// Distance from the eye to the focus.
    pub fn distance_mm(&self) -> f64 {
        self.height_mm / 2.0 / (FIELD_OF_VIEW_DEG / 2.0).to_radians().tan()
    }

    /// Position of the eye (for the orthographic camera: centre of the plane in which rays start).
    pub fn eye_mm(&self) -> DVec3 {
        self.focus_mm + self.axes()[2] * self.distance_mm()
    }

    /// Line of sight through a point of the frame. `pixel` is counted from the top left corner,
    /// pixel centres at halves; `size` is the frame's width and height in pixels.
    pub fn ray(&self, pixel: DVec2, size: DVec2) -> Ray {
        let [right, up, back] = self.axes();
        let mm_per_pixel = self.height_mm / size.y;
        let offset = right * ((pixel.x - size.x / 2.0) * mm_per_pixel)
            + up * ((size.y / 2.0 - pixel.y) * mm_per_pixel);
        let eye = self.eye_mm();
        match self.projection {
            Projection::Orthographic => Ray { origin_mm: eye + offset, direction: -back },
            Projection::Perspective => {
                let direction = offset - back * self.distance_mm();
                Ray { origin_mm: eye, direction: direction / direction.length() }
            }
        }
    }

    /// Position of a world point in the frame, in pixels from the top left; `None` behind the eye.
    pub fn project(&self, world_mm: DVec3, size: DVec2) -> Option<DVec2> {
        let [right, up, back] = self.axes();
        let from_focus = world_mm - self.focus_mm;
        let mut pixels_per_mm = size.y / self.height_mm;
        if self.projection == Projection::Perspective {
            let distance = self.distance_mm();
            let depth = distance - from_focus.dot(back);
            if depth.is_nan() || depth <= distance * 1e-6 {
                return None;
            }
            pixels_per_mm *= distance / depth;
        }
        Some(DVec2::new(
            size.x / 2.0 + from_focus.dot(right) * pixels_per_mm,
            size.y / 2.0 - from_focus.dot(up) * pixels_per_mm,
        ))
    }

    /// Rotates the camera about its focus like a trackball: `drag` in fractions of the frame's
    /// height, x to the right, y down. Half a height is a rotation by 90°.
    pub fn turn(&mut self, drag: DVec2) {
        let [right, up, _] = self.axes();
        let axis = up * -drag.x + right * -drag.y;
        let angle = drag.length() * std::f64::consts::PI;
        if let Some(axis) = axis.try_normalize() {
            self.world_from_camera =
                (DQuat::from_axis_angle(axis, angle) * self.world_from_camera).normalize();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(az: f64, el: f64, projection: Projection) -> Camera {
        Camera::fit(DVec3::new(1e6, -20.0, 30.0), 40.0, Camera::orientation(az, el), projection)
    }

    #[test]
    fn anterior_view_shows_the_patients_left_on_the_right() {
        let c = camera(0.0, 0.0, Projection::Perspective);
        let size = DVec2::new(400.0, 300.0);
        let left = c.project(c.focus_mm - DVec3::X * 10.0, size).unwrap();
        assert!(left.x > 200.0 && (left.y - 150.0).abs() < 1e-6);
        let top = c.project(c.focus_mm + DVec3::Z * 10.0, size).unwrap();
        assert!(top.y < 150.0);
    }

    #[test]
    fn anatomical_views_look_from_the_named_side() {
        let towards = [DVec3::Y, -DVec3::Y, -DVec3::X, DVec3::X, DVec3::Z, -DVec3::Z];
        for (view, expected) in AnatomicalView::VARIANTS.iter().zip(towards) {
            let (az, el) = view.azimuth_elevation_deg();
            let c = camera(az, el, Projection::Orthographic);
            assert!((c.axes()[2] - expected).length() < 1e-12, "{view:?}");
            let [r, u, b] = c.axes();
            assert!((r.cross(u) - b).length() < 1e-12, "right-handed");
        }
    }

    #[test]
    fn project_inverts_ray() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let c = camera(33.0, -48.0, projection);
            let size = DVec2::new(640.0, 480.0);
            for pixel in [DVec2::new(0.5, 0.5), DVec2::new(333.0, 17.0), DVec2::new(639.5, 479.5)] {
                let ray = c.ray(pixel, size);
                let back = c.project(ray.origin_mm + ray.direction * 77.0, size).unwrap();
                assert!(back.distance(pixel) < 1e-5, "{projection:?} {pixel} {back}");
            }
        }
    }

    #[test]
    fn dragging_right_turns_the_near_side_right() {
        let mut c = camera(0.0, 0.0, Projection::Orthographic);
        let size = DVec2::splat(100.0);
        let near = c.focus_mm + c.axes()[2] * 10.0;
        c.turn(DVec2::new(0.05, 0.0));
        assert!(c.project(near, size).unwrap().x > 50.0);
        c.turn(DVec2::new(0.0, 0.05));
        assert!(c.project(near, size).unwrap().y > 50.0);
    }
}
