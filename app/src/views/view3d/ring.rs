//! The lens's ring in a 3D view, for the mouse: the shaders draw it (lib/ring.wgsl), here it is found
//! again. The outline of a ball is where lines of sight pass its centre at its radius: a circle in the
//! orthographic view, an ellipse in perspective.

use egui::{Color32, CursorIcon, Painter, Pos2, Rect, Shape, Stroke, vec2};
use glam::{DVec2, DVec3};
use glioscope_core::optics::{Camera, Projection};
use glioscope_render::Lens;

/// How near the ring the pointer grabs it, points.
pub const GRAB_POINTS: f64 = 6.0;
/// Straight pieces that the highlighted ring is drawn with.
const PIECES: usize = 128;
const HIGHLIGHT: Color32 = Color32::from_rgb(255, 96, 80);

/// Size of a view in points, as [`Camera::ray`] wants it.
pub fn size_of(rect: Rect) -> DVec2 {
    DVec2::new(f64::from(rect.width()), f64::from(rect.height()))
}

/// A place in a view, points from its top left corner.
pub fn place_in(rect: Rect, pos: Pos2) -> DVec2 {
    DVec2::new(f64::from(pos.x - rect.left()), f64::from(pos.y - rect.top()))
}

/// Where a world point is drawn; `None` behind the eye.
pub fn pos_of(camera: &Camera, rect: Rect, world_mm: DVec3) -> Option<Pos2> {
    let place = camera.project(world_mm, size_of(rect))?.clamp(DVec2::splat(-1e6), DVec2::splat(1e6));
    Some(rect.min + vec2(place.x as f32, place.y as f32))
}

/// How far the line of sight through `pos` passes from `center_mm`: the radius of the ball whose ring
/// goes through `pos`. Beside it the millimetres that a point covers there. `None` where it passes
/// behind the eye.
fn passing_mm(camera: &Camera, rect: Rect, center_mm: DVec3, pos: Pos2) -> Option<(f64, f64)> {
    let size = size_of(rect);
    let ray = camera.ray(place_in(rect, pos), size);
    let nearest_mm = (center_mm - ray.origin_mm).dot(ray.direction);
    let off_mm = (ray.origin_mm + ray.direction * nearest_mm).distance(center_mm);
    let mut mm_per_point = camera.height_mm / size.y;
    if camera.projection == Projection::Perspective {
        mm_per_point *= nearest_mm * ray.direction.dot(-camera.axes()[2]) / camera.distance_mm();
    }
    (nearest_mm > 0.0 && mm_per_point > 0.0 && off_mm.is_finite()).then_some((off_mm, mm_per_point))
}

/// Radius of the ball about `center_mm` whose ring goes through `pos`; `None` behind the eye.
pub fn radius_through_mm(camera: &Camera, rect: Rect, center_mm: DVec3, pos: Pos2) -> Option<f64> {
    passing_mm(camera, rect, center_mm, pos).map(|(off_mm, _)| off_mm)
}

/// Whether the pointer is near enough to grab the ring.
pub fn is_near(camera: &Camera, rect: Rect, lens: &Lens, pos: Pos2) -> bool {
    passing_mm(camera, rect, lens.center_mm, pos)
        .is_some_and(|(off_mm, mm_per_point)| (off_mm - lens.radius_mm).abs() <= GRAB_POINTS * mm_per_point)
}

/// The place that the lens goes to when it is dragged over the background: under the pointer, in the
/// plane of the view through where it is.
pub fn in_plane_of_view_mm(camera: &Camera, rect: Rect, center_mm: DVec3, pos: Pos2) -> DVec3 {
    let ray = camera.ray(place_in(rect, pos), size_of(rect));
    let back = camera.axes()[2];
    ray.origin_mm + ray.direction * ((center_mm - ray.origin_mm).dot(back) / ray.direction.dot(back))
}

/// The arrow across the ring at the pointer.
pub fn cursor_icon(camera: &Camera, rect: Rect, lens: &Lens, pos: Pos2) -> CursorIcon {
    let center = pos_of(camera, rect, lens.center_mm).unwrap_or(rect.center());
    let across = pos - center;
    // Eighths of a turn, a direction and its opposite being the same arrow.
    match (across.angle().to_degrees() / 45.0).round().rem_euclid(4.0) as u32 {
        0 => CursorIcon::ResizeHorizontal,
        1 => CursorIcon::ResizeNwSe,
        2 => CursorIcon::ResizeVertical,
        _ => CursorIcon::ResizeNeSw,
    }
}

/// Draws the ring again, bright, over the picture. Nothing when the eye is inside the lens.
pub fn highlight(painter: &Painter, camera: &Camera, rect: Rect, lens: &Lens) {
    let [right, up, back] = camera.axes();
    // The circle in which lines of sight touch the ball.
    let (center_mm, axes, radius_mm) = match camera.projection {
        Projection::Orthographic => (lens.center_mm, (right, up), lens.radius_mm),
        Projection::Perspective => {
            let to_eye = camera.eye_mm() - lens.center_mm;
            let part = lens.radius_mm * lens.radius_mm / to_eye.length_squared();
            if part.is_nan() || part >= 1.0 {
                return;
            }
            let normal = to_eye.try_normalize().unwrap_or(back);
            let axes = normal.any_orthonormal_pair();
            (lens.center_mm + to_eye * part, axes, lens.radius_mm * (1.0 - part).sqrt())
        }
    };
    let points: Option<Vec<Pos2>> = (0..PIECES)
        .map(|i| {
            let (sin, cos) = (i as f64 / PIECES as f64 * std::f64::consts::TAU).sin_cos();
            pos_of(camera, rect, center_mm + (axes.0 * cos + axes.1 * sin) * radius_mm)
        })
        .collect();
    if let Some(points) = points {
        painter.add(Shape::closed_line(points.clone(), Stroke::new(7.0, HIGHLIGHT.gamma_multiply(0.35))));
        painter.add(Shape::closed_line(points, Stroke::new(2.5, HIGHLIGHT)));
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
                // Panned: the lens is far off the middle, so that its outline is an ellipse.
                let [right, up, _] = camera.axes();
                camera.focus_mm += right * 22.0 - up * 9.0;
                [centered, (camera, rect, lens)]
            })
            .collect()
    }

    /// Whether a line of sight meets the ball, by the quadratic in the ray's parameter.
    fn meets(camera: &Camera, rect: Rect, lens: &Lens, pos: Pos2) -> bool {
        let ray = camera.ray(place_in(rect, pos), size_of(rect));
        let from = ray.origin_mm - lens.center_mm;
        let half_b = from.dot(ray.direction);
        half_b * half_b - (from.length_squared() - lens.radius_mm * lens.radius_mm) >= 0.0
    }

    #[test]
    fn the_ring_is_where_lines_of_sight_begin_to_meet_the_ball() {
        for (camera, rect, lens) in views() {
            let center = pos_of(&camera, rect, lens.center_mm).unwrap();
            for step in 0..16 {
                let towards = egui::Vec2::angled(step as f32 * 0.39);
                // Outwards from the middle until the ball is left.
                let (mut inside, mut outside) = (0.0_f32, 2000.0_f32);
                for _ in 0..60 {
                    let middle = (inside + outside) / 2.0;
                    if meets(&camera, rect, &lens, center + towards * middle) {
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
    fn the_plane_of_the_view_is_under_the_pointer_and_through_the_centre() {
        for (camera, rect, lens) in views() {
            let pos = pos2(200.0, 90.0);
            let place_mm = in_plane_of_view_mm(&camera, rect, lens.center_mm, pos);
            assert!((place_mm - lens.center_mm).dot(camera.axes()[2]).abs() < 1e-6);
            assert!(pos_of(&camera, rect, place_mm).unwrap().distance(pos) < 1e-2);
        }
    }

    #[test]
    fn arrows_point_across_the_ring() {
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
