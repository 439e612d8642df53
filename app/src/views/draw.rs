//! Drawing shared by the views: colours of background and text, plates under text, messages, warnings.

use std::sync::Arc;

use egui::{
    Align2, Color32, FontId, Galley, Painter, Pos2, Rect, Response, Ui, pos2,
    text::{LayoutJob, TextWrapping},
    vec2,
};
use glioscope_render::ColorMap;

use crate::theme::{self, LABEL_POINTS, ON_IMAGE, PLATE, TEXT_POINTS, Tokens};

/// Gives a widget the name by which it is read out.
pub fn name_widget(ui: &Ui, response: &Response, name: &str) {
    ui.ctx().accesskit_node_builder(response.id, |node| node.set_label(name));
}

/// Draws a translucent patch of the ground's colour under text over an image.
pub fn plate(painter: &Painter, rect: Rect, dark: bool) {
    painter.rect_filled(rect.expand2(vec2(4.0, 2.0)), 4.0, Tokens::of(dark).plate());
}

/// The colours of a map from left to right, in `steps` of at least 2.
pub fn color_ramp(painter: &Painter, rect: Rect, map: ColorMap, steps: u8) {
    for step in 0..steps {
        let [from, to] =
            [step, step + 1].map(|n| rect.left() + rect.width() * f32::from(n) / f32::from(steps));
        let part = Rect::from_min_max(pos2(from, rect.top()), pos2(to, rect.bottom()));
        painter.rect_filled(part, 0.0, theme::color(map.color(f64::from(step) / f64::from(steps - 1))));
    }
}

/// Draws a message in the middle of a view that can't be drawn.
pub fn message(ui: &Ui, rect: Rect, text: &str) {
    let color = ui.visuals().text_color();
    let width = (rect.width() - 40.0).max(50.0);
    let galley = ui.painter().layout(text.to_owned(), theme::font(TEXT_POINTS), color, width);
    ui.painter().galley(rect.center() - galley.size() / 2.0, galley, color);
}

/// Draws a view's warnings at its upper edge.
pub fn warnings(ui: &Ui, rect: Rect, warnings: &[String]) {
    if warnings.is_empty() {
        return;
    }
    let dark = ui.visuals().dark_mode;
    let (painter, ink) = (ui.painter().with_clip_rect(rect), Tokens::of(dark).warning);
    let width = (rect.width() * 0.6).max(120.0);
    let galley = painter.layout(warnings.join("\n"), theme::font(LABEL_POINTS), ink, width);
    let place = Align2::CENTER_TOP.anchor_size(rect.center_top() + vec2(0.0, 8.0), galley.size());
    plate(&painter, place, dark);
    painter.galley(place.min, galley, ink);
}

/// Draws a note in the middle of the lower edge, for work in progress.
pub fn note(ui: &Ui, rect: Rect, text: &str) {
    let at = rect.center_bottom() - vec2(0.0, 14.0);
    let painter = ui.painter().with_clip_rect(rect);
    painter.text(at, Align2::CENTER_BOTTOM, text, theme::font(LABEL_POINTS), Tokens::in_ui(ui).text);
}

/// Draws text beside the pointer, kept inside the view.
pub fn beside_pointer(painter: &Painter, rect: Rect, pointer: Pos2, text: String) {
    let galley = painter.layout_no_wrap(text, theme::font(TEXT_POINTS), ON_IMAGE);
    let mut corner = pointer + vec2(14.0, 14.0);
    corner.x = corner.x.min(rect.right() - galley.size().x - 10.0).max(rect.left() + 8.0);
    corner.y = corner.y.min(rect.bottom() - galley.size().y - 8.0);
    let back = Rect::from_min_size(corner, galley.size()).expand2(vec2(6.0, 3.0));
    painter.rect_filled(back, 4.0, PLATE);
    painter.galley(corner, galley, ON_IMAGE);
}

/// One line of text, cut with an ellipsis at `width` points.
pub fn elided(ui: &Ui, text: &str, font: &FontId, color: Color32, width: f32) -> Arc<Galley> {
    let mut job = LayoutJob::simple_singleline(text.to_owned(), font.clone(), color);
    job.wrap = TextWrapping::truncate_at_width(width.max(1.0));
    ui.painter().layout_job(job)
}

/// Adds a margin around text and tables.
pub fn padded(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    egui::Frame::new().inner_margin(6).show(ui, show);
}

/// The title of an input, in the colour of warnings where its answer is missing.
pub fn asked(ui: &mut Ui, title: &str, is_missing: bool) -> Response {
    if !is_missing {
        return ui.label(title);
    }
    ui.colored_label(ui.visuals().warn_fg_color, title).on_hover_text("Its answer can change a call")
}
