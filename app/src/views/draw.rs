//! Drawing shared by the views: colours of background and text, plates under text, messages, warnings.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Ui, vec2};

/// Colour of warnings over 3D views.
pub fn warning_ink(dark: bool) -> Color32 {
    if dark { Color32::from_rgb(255, 170, 60) } else { Color32::from_rgb(176, 78, 0) }
}

/// Background colour of 3D views, sRGB.
pub fn background(dark: bool) -> [u8; 3] {
    if dark { [34, 36, 40] } else { [244, 244, 242] }
}

/// Colour of text and marks over [`background`].
pub fn ink(dark: bool) -> Color32 {
    if dark { Color32::from_gray(230) } else { Color32::from_gray(30) }
}

/// Draws a translucent patch of the background colour under text over an image.
pub fn plate(painter: &Painter, rect: Rect, dark: bool) {
    let [r, g, b] = background(dark);
    painter.rect_filled(rect.expand2(vec2(4.0, 2.0)), 3.0, Color32::from_rgba_unmultiplied(r, g, b, 190));
}

/// Draws a message in the middle of a view that can't be drawn.
pub fn message(ui: &Ui, rect: Rect, text: &str) {
    let color = ui.visuals().text_color();
    let width = (rect.width() - 40.0).max(50.0);
    let galley = ui.painter().layout(text.to_owned(), FontId::proportional(14.0), color, width);
    ui.painter().galley(rect.center() - galley.size() / 2.0, galley, color);
}

/// Draws a view's warnings at its upper edge.
pub fn warnings(ui: &Ui, rect: Rect, warnings: &[String]) {
    if warnings.is_empty() {
        return;
    }
    let dark = ui.visuals().dark_mode;
    let (painter, ink) = (ui.painter().with_clip_rect(rect), warning_ink(dark));
    let width = (rect.width() * 0.6).max(120.0);
    let galley = painter.layout(warnings.join("\n"), FontId::proportional(12.0), ink, width);
    let place = Align2::CENTER_TOP.anchor_size(rect.center_top() + vec2(0.0, 8.0), galley.size());
    plate(&painter, place, dark);
    painter.galley(place.min, galley, ink);
}

/// Draws a note in the middle of the lower edge, for work in progress.
pub fn note(ui: &Ui, rect: Rect, text: &str) {
    let at = rect.center_bottom() - vec2(0.0, 14.0);
    let painter = ui.painter().with_clip_rect(rect);
    painter.text(at, Align2::CENTER_BOTTOM, text, FontId::proportional(12.0), ink(ui.visuals().dark_mode));
}

/// Draws text beside the pointer, kept inside the view.
pub fn beside_pointer(painter: &Painter, rect: Rect, pointer: Pos2, text: String) {
    let galley = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
    let mut corner = pointer + vec2(14.0, 14.0);
    corner.x = corner.x.min(rect.right() - galley.size().x - 10.0).max(rect.left() + 8.0);
    corner.y = corner.y.min(rect.bottom() - galley.size().y - 8.0);
    let back = Rect::from_min_size(corner, galley.size()).expand2(vec2(6.0, 3.0));
    painter.rect_filled(back, 4.0, Color32::from_black_alpha(190));
    painter.galley(corner, galley, Color32::WHITE);
}

/// Adds a margin around text and tables.
pub fn padded(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    egui::Frame::new().inner_margin(6).show(ui, show);
}

/// An sRGB colour as egui's type.
pub fn color([r, g, b]: [u8; 3]) -> Color32 {
    Color32::from_rgb(r, g, b)
}
