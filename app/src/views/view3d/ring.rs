//! Mouse interaction with the lens's ring in a 3D view; the shaders draw the ring (lib/ring.wgsl). It is the outline of
//! a ball: where viewing rays pass the centre at a distance of the radius. That is a circle in orthographic projection
//! and an ellipse in perspective.

use egui::{Color32, CursorIcon, Painter, Pos2, Rect, Shape, Stroke, vec2};
use glam::{DVec2, DVec3};
use glioscope_core::optics::{Camera, Projection};
use glioscope_render::Lens;

/// Largest distance from the ring at which the pointer grabs it, points.
pub const GRAB_POINTS: f64 = 6.0;
/// Number of line segments of the highlighted ring.
const SEGMENTS: usize = 128;

/// Size of a view in points, for [`Camera::ray`].
pub fn size_of(rect: Rect) -> DVec2 {
    DVec2::new(f64::from(rect.width()), f64::from(rect.height()))
}

/// A position in a view, points from its top left corner.
pub fn place_in(rect: Rect, pos: Pos2) -> DVec2 {
    DVec2::new(f64::from(pos.x - rect.left()), f64::from(pos.y - rect.top()))
}

/// Screen position of a world point; `None` behind the eye.
pub fn pos_of(camera: &Camera, rect: Rect, world_mm: DVec3) -> Option<Pos2> {
    let place = camera.project(world_mm, size_of(rect))?.clamp(DVec2::splat(-1e6), DVec2::splat(1e6));
    Some(rect.min + vec2(place.x as f32, place.y as f32))
}

/// Distance of the viewing ray through `pos` from `center_mm`, mm: the radius of the ball whose ring passes through
/// `pos`. Second, mm per point at the point of the ray nearest the centre. `None` if that point is behind the eye.
fn ray_distance_mm(camera: &Camera, rect: Rect, center_mm: DVec3, pos: Pos2) -> Option<(f64, f64)> {
    let size = size_of(rect);
    let ray = camera.ray(place_in(rect, pos), size);
    let along_ray_mm = (center_mm - ray.origin_mm).dot(ray.direction);
    let distance_mm = (ray.origin_mm + ray.direction * along_ray_mm).distance(center_mm);
    let mut mm_per_point = camera.height_mm / size.y;
    if camera.projection == Projection::Perspective {
        mm_per_point *= along_ray_mm * ray.direction.dot(-camera.axes()[2]) / camera.distance_mm();
    }
    (along_ray_mm > 0.0 && mm_per_point > 0.0 && distance_mm.is_finite())
        .then_some((distance_mm, mm_per_point))
}

/// Radius of the ball about `center_mm` whose ring passes through `pos`, mm; `None` behind the eye.
pub fn radius_through_mm(camera: &Camera, rect: Rect, center_mm: DVec3, pos: Pos2) -> Option<f64> {
    ray_distance_mm(camera, rect, center_mm, pos).map(|(distance_mm, _)| distance_mm)
}

/// Whether the pointer is near enough to the ring to grab it.
pub fn is_near(camera: &Camera, rect: Rect, lens: &Lens, pos: Pos2) -> bool {
    ray_distance_mm(camera, rect, lens.center_mm, pos).is_some_and(|(distance_mm, mm_per_point)| {
        (distance_mm - lens.radius_mm).abs() <= GRAB_POINTS * mm_per_point
    })
}

/// New centre of a lens dragged over the background: under the pointer, in the plane parallel to the view through
/// `center_mm`.
pub fn in_plane_of_view_mm(camera: &Camera, rect: Rect, center_mm: DVec3, pos: Pos2) -> DVec3 {
    let ray = camera.ray(place_in(rect, pos), size_of(rect));
    let back = camera.axes()[2];
    ray.origin_mm + ray.direction * ((center_mm - ray.origin_mm).dot(back) / ray.direction.dot(back))
}

/// The resize cursor perpendicular to the ring at the pointer.
pub fn cursor_icon(camera: &Camera, rect: Rect, lens: &Lens, pos: Pos2) -> CursorIcon {
    let center = pos_of(camera, rect, lens.center_mm).unwrap_or(rect.center());
    let across = pos - center;
    // In steps of 45°; opposite directions have the same cursor.
    match (across.angle().to_degrees() / 45.0).round().rem_euclid(4.0) as u32 {
        0 => CursorIcon::ResizeHorizontal,
        1 => CursorIcon::ResizeNwSe,
        2 => CursorIcon::ResizeVertical,
        _ => CursorIcon::ResizeNeSw,
    }
}

/// Draws the highlighted ring over the frame in `ink`; nothing if the eye is inside the lens.
pub fn highlight(painter: &Painter, ink: Color32, camera: &Camera, rect: Rect, lens: &Lens) {
    let [right, up, back] = camera.axes();
    // The circle in which viewing rays touch the ball.
    let (center_mm, axes, radius_mm) = match camera.projection {
        Projection::Orthographic => (lens.center_mm, (right, up), lens.radius_mm),
        Projection::Perspective => {
            let to_eye = camera.eye_mm() - lens.center_mm;
            let ratio = lens.radius_mm * lens.radius_mm / to_eye.length_squared();
            if ratio.is_nan() || ratio >= 1.0 {
                return;
            }
            let normal = to_eye.try_normalize().unwrap_or(back);
            let axes = normal.any_orthonormal_pair();
            (lens.center_mm + to_eye * ratio, axes, lens.radius_mm * (1.0 - ratio).sqrt())
        }
    };
    let points: Option<Vec<Pos2>> = (0..SEGMENTS)
        .map(|i| {
            let (sin, cos) = (i as f64 / SEGMENTS as f64 * std::f64::consts::TAU).sin_cos();
            pos_of(camera, rect, center_mm + (axes.0 * cos + axes.1 * sin) * radius_mm)
        })
        .collect();
    if let Some(points) = points {
        painter.add(Shape::closed_line(points.clone(), Stroke::new(7.0, ink.gamma_multiply(0.35))));
        painter.add(Shape::closed_line(points, Stroke::new(2.5, ink)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    fn views() -> Vec<(Camera, Rect, Lens)> {
        let rect = Rect::from_min_size(pos2(30.0, 50.0), vec2(640.0, 480.0));
        let lens = Lens { center_mm: DVec3::new(1e5 + 9.0, -30.0, 12.0), radius_mm: 21.0 };
        [Projection::Perspective, Projection::Orthographic]
            .into_iter()
            .flat_map(|projection| {
                let mut camera =
                    Camera::fit(lens.center_mm, 40.0, Camera::orientation(25.0, 40.0), projection);
                let centered = (camera, rect, lens);
                // Panned: the lens is off-centre, so that its outline in perspective is an ellipse.
                let [right, up, _] = camera.axes();
                camera.focus_mm += right * 22.0 - up * 9.0;
                [centered, (camera, rect, lens)]
            })
            .collect()
    }

    /// Whether a viewing ray hits the ball: the discriminant of the quadratic in the ray's parameter is not negative.
    fn hits_ball(camera: &Camera, rect: Rect, lens: &Lens, pos: Pos2) -> bool {
        let ray = camera.ray(place_in(rect, pos), size_of(rect));
        let from = ray.origin_mm - lens.center_mm;
        let half_b = from.dot(ray.direction);
        half_b * half_b - (from.length_squared() - lens.radius_mm * lens.radius_mm) >= 0.0
    }

    #[test]
    fn the_ring_is_the_outline_of_the_ball() {
        for (camera, rect, lens) in views() {
            let center = pos_of(&camera, rect, lens.center_mm).unwrap();
            for step in 0..16 {
                let towards = egui::Vec2::angled(step as f32 * 0.39);
                // Bisect for the edge of the ball in this direction.
                let (mut inside, mut outside) = (0.0_f32, 2000.0_f32);
                for _ in 0..60 {
                    let middle = (inside + outside) / 2.0;
                    if hits_ball(&camera, rect, &lens, center + towards * middle) {
                        inside = middle;
                    } else {
                        outside = middle;
                    }
                }
                let edge = center + towards * inside;
                let radius_mm = radius_through_mm(&camera, rect, lens.center_mm, edge).unwrap();
                assert!((radius_mm - lens.radius_mm).abs() < 0.01, "{radius_mm}");
                assert!(is_near(&camera, rect, &lens, edge + towards * 5.0));
                assert!(is_near(&camera, rect, &lens, edge - towards * 5.0));
                assert!(!is_near(&camera, rect, &lens, edge + towards * 8.0));
                assert!(!is_near(&camera, rect, &lens, edge - towards * 8.0));
            }
        }
    }

    #[test]
    fn the_dragged_centre_is_under_the_pointer_in_the_view_plane() {
        for (camera, rect, lens) in views() {
            let pos = pos2(200.0, 90.0);
            let place_mm = in_plane_of_view_mm(&camera, rect, lens.center_mm, pos);
            assert!((place_mm - lens.center_mm).dot(camera.axes()[2]).abs() < 1e-6);
            assert!(pos_of(&camera, rect, place_mm).unwrap().distance(pos) < 1e-2);
        }
    }

    #[test]
    fn resize_cursors_are_perpendicular_to_the_ring() {
        let (camera, rect, lens) = views().remove(0);
        let center = pos_of(&camera, rect, lens.center_mm).unwrap();
        for (x, y, icon) in [
            (80.0, 3.0, CursorIcon::ResizeHorizontal),
            (-80.0, 3.0, CursorIcon::ResizeHorizontal),
            (0.0, 80.0, CursorIcon::ResizeVertical),
            (50.0, 50.0, CursorIcon::ResizeNwSe),
            (50.0, -50.0, CursorIcon::ResizeNeSw),
        ] {
            assert_eq!(cursor_icon(&camera, rect, &lens, center + vec2(x, y)), icon);
        }
    }
}
