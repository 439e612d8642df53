//! The tumour intersection closeup (thesis 7.3.3): the renderer's picture, the orientation cube, the
//! legend, and what the mouse does.

use egui::{Align2, Color32, FontId, PointerButton, Rect, Role, Sense, Ui, WidgetInfo, pos2, vec2};
use glam::{DVec2, UVec2};
use glioscope_core::Sides;
use glioscope_render::{Camera, Pick, Projection, Scene};

use super::{ViewContext, orientation, still::Refinement};
use crate::{commands::Command, format, viewport::Viewport};

/// What the view remembers between frames; never saved.
#[derive(Default)]
pub struct CloseupState {
    refinement: Refinement<Scene>,
    pointer: Option<egui::Pos2>,
    /// What is under the pointer.
    pub hover: Option<Pick>,
}

impl CloseupState {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.refinement.refined()
    }
}

/// Draws the closeup into all of `ui` and writes what the user did to `out`. `refine_at_once` is for
/// pictures: no draft is shown.
pub fn show(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    scene: &Scene,
    viewport: Option<&mut Viewport>,
    state: &mut CloseupState,
    refine_at_once: bool,
    out: &mut Vec<Command>,
) {
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let dark = ui.visuals().dark_mode;
    let Some(viewport) = viewport else {
        message(ui, rect, "No graphics adapter: the 3D closeup can't be drawn. Install mesa-vulkan-drivers.");
        return;
    };
    interact(ui, view, &response, rect, out);

    let (quality, just_refined) = state.refinement.quality(ui, scene, refine_at_once);
    if just_refined {
        // What is under a pointer that didn't move may be something else now.
        state.pointer = None;
    }
    let size = rect.size() * ui.pixels_per_point();
    if size.x < 1.0 || size.y < 1.0 {
        return;
    }
    let size = UVec2::new(size.x.round() as u32, size.y.round() as u32);
    match viewport.show(scene, &quality, size) {
        Ok(texture) => {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture, rect, whole, Color32::WHITE);
        }
        Err(error) => {
            message(ui, rect, &error);
            return;
        }
    }
    hover(ui, view, &response, rect, viewport, state, out);
    decorate(ui, view, rect, dark);
    response.widget_info(|| {
        let under = state.hover.map_or_else(|| "nothing under the pointer".into(), |p| pick_text(view, &p));
        WidgetInfo::labeled(Role::Canvas, true, format!("Closeup: {under}"))
    });
}

fn interact(ui: &Ui, view: &ViewContext<'_>, response: &egui::Response, rect: Rect, out: &mut Vec<Command>) {
    let modifiers = ui.input(|i| i.modifiers);
    let mut camera = view.doc.nav.camera;
    if response.dragged_by(PointerButton::Primary) && !modifiers.any() {
        let drag = response.drag_delta() / rect.height().max(1.0);
        camera.turn(DVec2::new(f64::from(drag.x), f64::from(drag.y)));
    }
    let pans = response.dragged_by(PointerButton::Middle)
        || (response.dragged_by(PointerButton::Primary) && modifiers.shift);
    if pans {
        let mm_per_point = camera.height_mm / f64::from(rect.height().max(1.0));
        let drag = response.drag_delta();
        let [right, up, _] = camera.axes();
        camera.focus_mm += (right * -f64::from(drag.x) + up * f64::from(drag.y)) * mm_per_point;
    }
    if response.hovered() {
        let (scroll, zoom) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
        if modifiers.alt && scroll != 0.0 {
            out.push(Command::SetLensRadius(view.doc.edit.lens.radius_mm * f64::from(scroll * 0.003).exp()));
        } else if scroll != 0.0 || zoom != 1.0 {
            let factor = f64::from(-scroll * 0.003).exp() / f64::from(zoom);
            camera.height_mm = (camera.height_mm * factor).clamp(0.5, 5000.0);
        }
    }
    if camera != view.doc.nav.camera {
        out.push(Command::SetCamera(camera));
    }
}

/// Looks up what is under the pointer, moves the crosshair there, and says it beside the pointer.
fn hover(
    ui: &Ui,
    view: &ViewContext<'_>,
    response: &egui::Response,
    rect: Rect,
    viewport: &Viewport,
    state: &mut CloseupState,
    out: &mut Vec<Command>,
) {
    let pointer = response.hover_pos();
    let dragging = response.dragged();
    if pointer != state.pointer || response.clicked() {
        state.pointer = pointer;
        state.hover = pointer.filter(|_| !dragging).and_then(|p| {
            let (u, v) = ((p.x - rect.left()) / rect.width(), (p.y - rect.top()) / rect.height());
            // A device that fails says so when the next frame is drawn.
            viewport.pick(u, v).ok().flatten()
        });
        if let Some(pick) = &state.hover
            && (view.doc.nav.follow_pointer || response.clicked())
        {
            out.push(Command::SetCursor(pick.world_mm));
        }
    }
    if let (Some(pointer), Some(pick)) = (pointer, &state.hover) {
        beside_pointer(ui, rect, pointer, &pick_text(view, pick));
    }
}

/// Text on a dark plate beside the pointer, inside `rect`.
pub fn beside_pointer(ui: &Ui, rect: Rect, pointer: egui::Pos2, text: &str) {
    let font = FontId::proportional(13.0);
    let galley = ui.painter().layout_no_wrap(text.to_owned(), font, Color32::WHITE);
    let mut corner = pointer + vec2(14.0, 14.0);
    corner.x = corner.x.min(rect.right() - galley.size().x - 10.0).max(rect.left() + 8.0);
    corner.y = corner.y.min(rect.bottom() - galley.size().y - 8.0);
    let back = Rect::from_min_size(corner, galley.size()).expand2(vec2(6.0, 3.0));
    ui.painter().rect_filled(back, 4.0, Color32::from_black_alpha(190));
    ui.painter().galley(corner, galley, Color32::WHITE);
}

/// Colour of what is behind everything in 3D views.
pub fn background(dark: bool) -> [u8; 3] {
    if dark { [34, 36, 40] } else { [244, 244, 242] }
}

/// Colour of text and marks over it.
pub fn ink(dark: bool) -> Color32 {
    if dark { Color32::from_gray(230) } else { Color32::from_gray(30) }
}

/// What a pick says: region, millilitres, place.
pub fn pick_text(view: &ViewContext<'_>, pick: &Pick) -> String {
    let regions = &view.time_point.regions;
    let ml = regions.get(pick.bits).map_or_else(|| "unknown".into(), |r| format::ml(r.volume_ml));
    let known = view.case.grid.sides() == Sides::Known;
    let place = glioscope_render::slices::place_label(pick.world_mm, known);
    let side = if pick.inside_lens { "" } else { ", outside the lens" };
    format!("{} {ml}{side}\n{place}", regions.name(pick.bits))
}

/// Cube, or that sides are unknown, and the scale bar: in every 3D view. `at` says where the scale
/// holds in perspective.
pub fn corner_marks(ui: &Ui, view: &ViewContext<'_>, rect: Rect, camera: &Camera, at: &str) {
    let painter = ui.painter().with_clip_rect(rect);
    let dark = ui.visuals().dark_mode;
    let ink = ink(dark);
    let small = FontId::proportional(12.0);
    let known = view.case.grid.sides() == Sides::Known;
    let cube_size = (rect.height().min(rect.width()) * 0.09).clamp(26.0, 44.0);
    let cube_center = rect.right_bottom() - vec2(cube_size * 1.15, cube_size * 1.2);
    if known {
        orientation::cube(&painter, cube_center, cube_size, camera, dark);
    } else {
        painter.text(
            rect.right_bottom() - vec2(8.0, 8.0),
            Align2::RIGHT_BOTTOM,
            "side unknown",
            FontId::proportional(14.0),
            Color32::from_rgb(230, 120, 0),
        );
    }
    let mm_per_point = camera.height_mm / f64::from(rect.height().max(1.0));
    if let Some((mm, points)) = format::nice_length_mm(mm_per_point, f64::from(rect.width()) * 0.22) {
        let left = rect.left_bottom() + vec2(12.0, -12.0);
        let right = left + vec2(points as f32, 0.0);
        painter.line_segment([left, right], egui::Stroke::new(2.0, ink));
        for end in [left, right] {
            painter.line_segment([end - vec2(0.0, 4.0), end + vec2(0.0, 4.0)], egui::Stroke::new(2.0, ink));
        }
        let place = if camera.projection == Projection::Perspective { format!(" {at}") } else { String::new() };
        painter.text(
            left - vec2(0.0, 6.0),
            Align2::LEFT_BOTTOM,
            format!("{} mm{place}", format::plain(mm)),
            small,
            ink,
        );
    }
}

/// Cube, legend, scale bar and notes.
fn decorate(ui: &Ui, view: &ViewContext<'_>, rect: Rect, dark: bool) {
    let painter = ui.painter().with_clip_rect(rect);
    let ink = ink(dark);
    corner_marks(ui, view, rect, &view.doc.nav.camera, "at the lens");
    legend(&painter, view, rect, ink, &FontId::proportional(12.0));
    if view.time_point.regions.union_voxels() == 0 {
        painter.text(
            rect.center(),
            Align2::CENTER_CENTER,
            "No mask is active at this time point",
            FontId::proportional(15.0),
            ink,
        );
    } else if view.doc.edit.selection.is_empty(&view.time_point.regions) {
        painter.text(
            rect.center_top() + vec2(0.0, 28.0),
            Align2::CENTER_TOP,
            "Every region is hidden",
            FontId::proportional(15.0),
            ink,
        );
    }
}

fn legend(painter: &egui::Painter, view: &ViewContext<'_>, rect: Rect, ink: Color32, font: &FontId) {
    let mut at = rect.left_top() + vec2(10.0, 8.0);
    let color = |[r, g, b]: [u8; 3]| Color32::from_rgb(r, g, b);
    for (k, id) in view.time_point.regions.mask_ids().iter().enumerate() {
        let swatch = Rect::from_min_size(at + vec2(0.0, 2.0), vec2(11.0, 11.0));
        painter.rect(
            swatch,
            2.0,
            color(view.colors.mask(k)),
            egui::Stroke::new(1.0, ink.gamma_multiply(0.6)),
            egui::StrokeKind::Outside,
        );
        painter.text(at + vec2(17.0, 0.0), Align2::LEFT_TOP, id, font.clone(), ink);
        at.y += 16.0;
        if at.y > rect.bottom() - 90.0 {
            break;
        }
    }
    if view.colors.mask_count() < 2 {
        return;
    }
    painter.text(
        at,
        Align2::LEFT_TOP,
        view.colors.scheme(),
        FontId::proportional(10.5),
        ink.gamma_multiply(0.75),
    );
}

/// A message in the middle of a view that can't be drawn.
pub fn message(ui: &Ui, rect: Rect, text: &str) {
    let galley = ui.painter().layout(
        text.to_owned(),
        FontId::proportional(14.0),
        ui.visuals().text_color(),
        (rect.width() - 40.0).max(50.0),
    );
    ui.painter().galley(rect.center() - galley.size() / 2.0, galley, ui.visuals().text_color());
}
