//! Colours of the view, and antialiased fills of ring parts.

use egui::{
    Color32, Pos2, Stroke, Ui, Visuals,
    epaint::{Mesh, Vertex},
    lerp, pos2,
};
use glioscope_render::Rgb;

use super::{Shown, ring};

use crate::theme::{self, ON_IMAGE, Tokens};

/// Width of the border of shown pieces, points.
pub const BORDER_PT: f32 = 1.7;

/// Colours and strokes other than the masks' colours.
pub struct Style {
    /// Dark casing below bordered pieces, so that white borders are visible on any background.
    pub casing: Color32,
    /// Border of shown pieces.
    pub shown: Stroke,
    /// Border of hidden pieces.
    pub hidden: Stroke,
    /// Colour that hidden fills are blended with.
    pub faded: Color32,
    /// Border of the piece under the cursor or with keyboard focus.
    pub marked: Stroke,
    /// Width of a device pixel, points: that of an antialiased edge.
    pub pixel: f32,
}

impl Style {
    /// The style for the theme and resolution of `ui`.
    pub fn of(ui: &Ui) -> Self {
        let Visuals { dark_mode, .. } = *ui.visuals();
        let tokens = Tokens::of(dark_mode);
        Self {
            casing: if dark_mode { tokens.viewport } else { tokens.text },
            shown: Stroke::new(BORDER_PT, ON_IMAGE),
            hidden: Stroke::new(1.0, tokens.second.gamma_multiply(0.8)),
            faded: tokens.line,
            marked: Stroke::new(3.0, tokens.interaction),
            pixel: 1.0 / ui.ctx().pixels_per_point(),
        }
    }

    /// A mask's fill: its pure colour when shown, faded when partly shown or hidden.
    pub fn fill(&self, rgb: Rgb, shown: Shown) -> Color32 {
        let pure = theme::color(rgb);
        match shown {
            Shown::All => pure,
            Shown::Some => self.faded.lerp_to_gamma(pure, 0.62),
            Shown::None => self.faded.lerp_to_gamma(pure, 0.28),
        }
    }

    /// The border for a visibility.
    pub fn border(&self, shown: Shown) -> Stroke {
        if shown == Shown::None { self.hidden } else { self.shown }
    }
}

/// Adds a part of a ring between two angles (`span`: clockwise from twelve o'clock, radians) and two radii (points).
/// Its edges are antialiased over one pixel so that its painted area is accurate. The straight sides are moved outwards
/// by `widening` points at every radius. Adds nothing if angles or radii aren't ascending.
pub fn ring_part(
    mesh: &mut Mesh,
    center: Pos2,
    span: [f64; 2],
    radii: [f64; 2],
    widening: f64,
    color: Color32,
    pixel: f32,
) {
    let steps = ring::arc_steps(span[0], span[1], radii[1]);
    in_steps(mesh, center, (span, radii), widening, (color, pixel), steps);
}

/// As [`ring_part`], in half as many steps: off by at most 0.08 points, for many small rings.
pub fn small_ring_part(
    mesh: &mut Mesh,
    center: Pos2,
    span: [f64; 2],
    radii: [f64; 2],
    color: Color32,
    pixel: f32,
) {
    let steps = ring::arc_steps(span[0], span[1], radii[1]).div_ceil(2);
    in_steps(mesh, center, (span, radii), 0.0, (color, pixel), steps);
}

/// Adds a part of a ring in so many steps.
fn in_steps(
    mesh: &mut Mesh,
    center: Pos2,
    (span, radii): ([f64; 2], [f64; 2]),
    widening: f64,
    (color, pixel): (Color32, f32),
    steps: usize,
) {
    let [from, to] = span;
    let [inner, outer] = radii;
    if to <= from || outer <= inner {
        return;
    }
    let half = f64::from(pixel) / 2.0;
    let closed = to - from >= std::f64::consts::TAU - 1e-9;
    // Parts thinner than a pixel are painted one pixel wide with proportionally lower alpha.
    let alpha_and_inset = |width: f64| ((width / (2.0 * half)).min(1.0), half.min(width / 2.0));
    let (radial_alpha, radial_inset) = alpha_and_inset(outer - inner);
    let rows = [
        ((inner - half).max(0.0), if inner > 0.0 { 0.0 } else { radial_alpha }),
        (inner + if inner > 0.0 { radial_inset } else { 0.0 }, radial_alpha),
        (outer - radial_inset, radial_alpha),
        (outer + half, 0.0),
    ];
    let first = mesh.vertices.len() as u32;
    let mut columns = 0;
    // `arc_offset` is a length along the arc in points, so it is a different angle in each row.
    let mut column = |angle: f64, arc_offset: f64, fade: bool| {
        for (radius, alpha) in rows {
            let angle = angle + if radius > 0.0 { arc_offset / radius.max(half) } else { 0.0 };
            let [x, y] = ring::point(angle, radius);
            let (arc_alpha, _) = if closed {
                (1.0, 0.0)
            } else {
                alpha_and_inset((to - from) * radius.max(outer / 2.0) + 2.0 * widening)
            };
            let alpha = if fade { 0.0 } else { alpha * arc_alpha };
            let color = color.gamma_multiply(alpha as f32);
            mesh.vertices.push(Vertex::untextured(center + egui::vec2(x as f32, y as f32), color));
        }
        columns += 1;
    };
    if closed {
        (0..=steps).for_each(|i| column(lerp(from..=to, i as f64 / steps as f64), 0.0, false));
    } else {
        let inset = half.min((to - from) * (inner + outer) / 4.0) - widening;
        column(from, -half - widening, true);
        column(from, inset, false);
        (1..steps).for_each(|i| column(lerp(from..=to, i as f64 / steps as f64), 0.0, false));
        column(to, -inset, false);
        column(to, half + widening, true);
    }
    for c in 0..columns - 1 {
        for r in 0..3 {
            let a = first + c * 4 + r;
            mesh.add_triangle(a, a + 1, a + 4);
            mesh.add_triangle(a + 1, a + 4, a + 5);
        }
    }
}

/// The points of an arc (clockwise from twelve o'clock), for a line.
pub fn arc(center: Pos2, from: f64, to: f64, radius: f64) -> Vec<Pos2> {
    let steps = ring::arc_steps(from, to, radius);
    (0..=steps)
        .map(|i| {
            let [x, y] = ring::point(lerp(from..=to, i as f64 / steps as f64), radius);
            pos2(center.x + x as f32, center.y + y as f32)
        })
        .collect()
}

/// Colour of text about hidden regions: dimmer than normal text, but legible.
pub fn dim_text(ui: &Ui) -> Color32 {
    ui.visuals().panel_fill.lerp_to_gamma(ui.visuals().text_color(), 0.66)
}
