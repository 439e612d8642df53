//! Marks in the corners of every 3D view: the orientation cube with the patient's directions, and the scale bar.

use egui::{Align2, Painter, Pos2, Rect, Shape, Stroke, Ui, Vec2, vec2};
use glam::DVec3;
use glioscope_core::optics::{Camera, Projection};

use crate::theme::{self, LABEL_POINTS, TEXT_POINTS, Tokens};
use crate::{format, views::draw};

const FACES: [(DVec3, &str); 6] = [
    (DVec3::X, "R"),
    (DVec3::NEG_X, "L"),
    (DVec3::Y, "A"),
    (DVec3::NEG_Y, "P"),
    (DVec3::Z, "S"),
    (DVec3::NEG_Z, "I"),
];

/// Draws the orientation cube at `center` with edges of `size` points, oriented as `camera` views the patient.
fn cube(painter: &Painter, center: Pos2, size: f32, camera: &Camera, dark: bool) {
    let [right, up, back] = camera.axes();
    let flat = |p: DVec3| -> Vec2 { vec2(p.dot(right) as f32, -p.dot(up) as f32) * (size / 2.0) };
    let tokens = Tokens::of(dark);
    let line = tokens.text;
    for (normal, letter) in FACES {
        let facing = normal.dot(back) as f32;
        if facing <= 0.02 {
            continue;
        }
        let u = normal.any_orthonormal_pair().0;
        let v = normal.cross(u);
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]
            .map(|(a, b)| center + flat(normal + u * a + v * b));
        let fill = if dark {
            tokens.panel.lerp_to_gamma(tokens.second, 0.15 + 0.3 * facing)
        } else {
            tokens.line.lerp_to_gamma(tokens.raised, facing)
        };
        painter.add(Shape::convex_polygon(corners.to_vec(), fill, Stroke::new(1.0, line)));
        let alpha = ((facing - 0.15) / 0.35).clamp(0.0, 1.0);
        painter.text(
            center + flat(normal),
            Align2::CENTER_CENTER,
            letter,
            theme::font(size * (0.3 + 0.22 * facing)),
            line.gamma_multiply(alpha),
        );
    }
}

/// Draws the orientation cube, or a note that sides are unknown, and the scale bar. `scale_position`: where the scale
/// applies in perspective, as text.
pub fn corners(
    ui: &Ui,
    rect: Rect,
    sides_known: bool,
    (camera, scale_position): (&Camera, &str),
    is_over_image: bool,
) {
    let painter = ui.painter().with_clip_rect(rect);
    let dark = ui.visuals().dark_mode;
    let ink = Tokens::of(dark).text;
    let cube_size = (rect.height().min(rect.width()) * 0.09).clamp(26.0, 44.0);
    let cube_center = rect.right_bottom() - vec2(cube_size * 1.15, cube_size * 1.2);
    if sides_known {
        cube(&painter, cube_center, cube_size, camera, dark);
    } else {
        painter.text(
            rect.right_bottom() - vec2(8.0, 8.0),
            Align2::RIGHT_BOTTOM,
            "side unknown",
            theme::font(TEXT_POINTS),
            Tokens::of(dark).warning,
        );
    }
    let mm_per_point = camera.height_mm / f64::from(rect.height().max(1.0));
    if let Some((mm, points)) = format::nice_length_mm(mm_per_point, f64::from(rect.width()) * 0.22) {
        let left = rect.left_bottom() + vec2(12.0, -12.0);
        let right = left + vec2(points as f32, 0.0);
        painter.line_segment([left, right], Stroke::new(2.0, ink));
        for end in [left, right] {
            painter.line_segment([end - vec2(0.0, 4.0), end + vec2(0.0, 4.0)], Stroke::new(2.0, ink));
        }
        let place = if camera.projection == Projection::Perspective {
            format!(" {scale_position}")
        } else {
            String::new()
        };
        let text = format!("{} mm{place}", format::plain(mm));
        let text = painter.layout_no_wrap(text, theme::font(LABEL_POINTS), ink);
        let text_rect = Align2::LEFT_BOTTOM.anchor_size(left - vec2(0.0, 6.0), text.size());
        if is_over_image {
            draw::plate(&painter, text_rect, dark);
        }
        painter.galley(text_rect.min, text, ink);
    }
}
