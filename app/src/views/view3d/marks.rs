//! The orientation cube: which way the patient's right, front and head are.

use egui::{Align2, Color32, FontId, Painter, Pos2, Shape, Stroke, Vec2, vec2};
use glam::DVec3;
use glioscope_render::Camera;

const FACES: [(DVec3, &str); 6] = [
    (DVec3::X, "R"),
    (DVec3::NEG_X, "L"),
    (DVec3::Y, "A"),
    (DVec3::NEG_Y, "P"),
    (DVec3::Z, "S"),
    (DVec3::NEG_Z, "I"),
];

/// Draws the cube about `center` with edges of `size` points, as `camera` sees the patient's axes.
pub fn cube(painter: &Painter, center: Pos2, size: f32, camera: &Camera, dark: bool) {
    let [right, up, back] = camera.axes();
    let flat = |p: DVec3| -> Vec2 { vec2(p.dot(right) as f32, -p.dot(up) as f32) * (size / 2.0) };
    let ink = if dark { Color32::from_gray(225) } else { Color32::from_gray(40) };
    for (normal, letter) in FACES {
        let facing = normal.dot(back) as f32;
        if facing <= 0.02 {
            continue;
        }
        let u = normal.any_orthonormal_pair().0;
        let v = normal.cross(u);
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(a, b)| center + flat(normal + u * a + v * b));
        let grey = if dark { 55.0 + 60.0 * facing } else { 165.0 + 70.0 * facing };
        let fill = Color32::from_gray(grey as u8);
        painter.add(Shape::convex_polygon(corners.to_vec(), fill, Stroke::new(1.0, ink)));
        let alpha = ((facing - 0.15) / 0.35).clamp(0.0, 1.0);
        painter.text(
            center + flat(normal),
            Align2::CENTER_CENTER,
            letter,
            FontId::proportional(size * (0.3 + 0.22 * facing)),
            ink.gamma_multiply(alpha),
        );
    }
}
