//! The tumour intersection closeup (thesis 7.3.3): the renderer's picture, the orientation cube, the
//! legend, and what the mouse does.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Role, Sense, Ui, WidgetInfo, pos2, vec2};
use glam::UVec2;
use glioscope_core::{Sides, measure};
use glioscope_render::{Camera, Coloring, Pick, Projection, Scene, agreement_color};

use super::{
    ViewContext,
    camera_drag::{self, Drag, View3d},
    orientation, ruler,
    still::Refinement,
};
use crate::{commands::Command, document::RulerView, format, viewport::Viewport};

/// What the view remembers between frames; never saved.
#[derive(Default)]
pub struct CloseupState {
    refinement: Refinement<Scene>,
    pointer: Option<Pos2>,
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
    let doc = view.doc;
    let view3d = View3d { doc, camera: doc.nav.camera, rect };
    let outcome = camera_drag::interact(
        ui,
        &response,
        &view3d,
        &|pos| pick(viewport, rect, pos).map(|p| p.world_mm),
        out,
    );
    if outcome.camera != doc.nav.camera {
        out.push(Command::SetCamera(outcome.camera));
    }
    let draft = if outcome.drag == Drag::Ruler {
        let pick_at = |pos| pick(viewport, rect, pos).map(|p| p.world_mm);
        ruler::drag(ui, &response, doc, RulerView::Closeup, &pick_at, out)
    } else {
        None
    };

    let light = &doc.edit.light;
    let now = state.refinement.quality(ui, scene, light, refine_at_once);
    if now.just_refined {
        // What is under a pointer that didn't move may be something else now.
        state.pointer = None;
    }
    let size = rect.size() * ui.pixels_per_point();
    if size.x < 1.0 || size.y < 1.0 {
        return;
    }
    let size = UVec2::new(size.x.round() as u32, size.y.round() as u32);
    let shown = viewport.show(scene, &now.quality, size, now.timed);
    if let Some(milliseconds) = viewport.closeup.took_ms() {
        state.refinement.took(light, milliseconds);
    }
    match shown {
        Ok(texture) => {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture, rect, whole, Color32::WHITE);
        }
        Err(error) => {
            message(ui, rect, &error);
            return;
        }
    }
    look_up(view, &response, rect, viewport, state, out);
    decorate(ui, view, rect, dark);
    let painter = ui.painter().with_clip_rect(rect);
    ruler::draw_3d(&painter, doc, &doc.nav.camera, rect, draft);
    camera_drag::ring_marks(ui, &response, &view3d, &outcome);
    if let Some(pointer) = response.hover_pos() {
        match (&draft, &state.hover) {
            (Some(draft), _) => ruler::beside_pointer(&painter, rect, pointer, ruler::draft_text(draft)),
            (None, Some(pick)) if !outcome.ring => {
                ruler::beside_pointer(&painter, rect, pointer, pick_text(view, pick));
            }
            _ => {}
        }
    }
    response.widget_info(|| {
        let under = state.hover.map_or_else(|| "nothing under the pointer".into(), |p| pick_text(view, &p));
        let mut said = format!("Closeup: {under}");
        if view.colors.coloring() == Coloring::Agreement {
            let rows: Vec<String> = agreement_rows(view).into_iter().map(|(_, words)| words).collect();
            said = format!("{said}\n{}", rows.join("; "));
        }
        WidgetInfo::labeled(Role::Canvas, true, said)
    });
}

/// What is under a place of the picture last drawn.
fn pick(viewport: &Viewport, rect: Rect, pos: Pos2) -> Option<Pick> {
    let (u, v) = ((pos.x - rect.left()) / rect.width(), (pos.y - rect.top()) / rect.height());
    let inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
    // A device that fails says so when the next frame is drawn.
    inside.then(|| viewport.pick(u, v).ok().flatten()).flatten()
}

/// Looks up what is under the pointer and moves the crosshair there.
fn look_up(
    view: &ViewContext<'_>,
    response: &egui::Response,
    rect: Rect,
    viewport: &Viewport,
    state: &mut CloseupState,
    out: &mut Vec<Command>,
) {
    let pointer = response.hover_pos();
    let dragging = response.dragged();
    if pointer == state.pointer && !response.clicked() {
        return;
    }
    state.pointer = pointer;
    state.hover = pointer.filter(|_| !dragging).and_then(|pos| pick(viewport, rect, pos));
    if let Some(pick) = &state.hover
        && (view.doc.nav.follow_pointer || response.clicked())
    {
        out.push(Command::SetCursor(pick.world_mm));
    }
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

/// A patch of the background under words that stand over an image.
pub fn plate(painter: &Painter, rect: Rect, dark: bool) {
    let [r, g, b] = background(dark);
    painter.rect_filled(rect.expand2(vec2(4.0, 2.0)), 3.0, Color32::from_rgba_unmultiplied(r, g, b, 190));
}

/// Cube, or that sides are unknown, and the scale bar: in every 3D view. `at` says where the scale
/// holds in perspective.
pub fn corner_marks(
    ui: &Ui,
    view: &ViewContext<'_>,
    rect: Rect,
    (camera, at): (&Camera, &str),
    is_over_image: bool,
) {
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
        let place =
            if camera.projection == Projection::Perspective { format!(" {at}") } else { String::new() };
        let text = painter.layout_no_wrap(format!("{} mm{place}", format::plain(mm)), small, ink);
        let words = Align2::LEFT_BOTTOM.anchor_size(left - vec2(0.0, 6.0), text.size());
        if is_over_image {
            plate(&painter, words, dark);
        }
        painter.galley(words.min, text, ink);
    }
}

/// Cube, legend, scale bar and notes.
fn decorate(ui: &Ui, view: &ViewContext<'_>, rect: Rect, dark: bool) {
    let painter = ui.painter().with_clip_rect(rect);
    let ink = ink(dark);
    corner_marks(ui, view, rect, (&view.doc.nav.camera, "at the lens"), false);
    legend(&painter, view, rect, ink, &FontId::proportional(12.0));
    if view.doc.nav.ruler_on {
        let words = "Ruler: drag from surface to surface";
        let at = rect.center_bottom() - vec2(0.0, 10.0);
        painter.text(at, Align2::CENTER_BOTTOM, words, FontId::proportional(13.0), ink);
    }
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

/// Colours and what they stand for: masks, or how many of them are active.
fn legend(painter: &Painter, view: &ViewContext<'_>, rect: Rect, ink: Color32, font: &FontId) {
    let regions = &view.time_point.regions;
    let rows: Vec<([u8; 3], String)> = match view.colors.coloring() {
        Coloring::Masks => {
            let ids = regions.mask_ids().iter().enumerate();
            ids.map(|(k, id)| (view.colors.mask(k), id.clone())).collect()
        }
        Coloring::Agreement => agreement_rows(view).into_iter().rev().collect(),
    };
    let mut at = rect.left_top() + vec2(10.0, 8.0);
    for ([r, g, b], words) in rows {
        let swatch = Rect::from_min_size(at + vec2(0.0, 2.0), vec2(11.0, 11.0));
        painter.rect(
            swatch,
            2.0,
            Color32::from_rgb(r, g, b),
            egui::Stroke::new(1.0, ink.gamma_multiply(0.6)),
            egui::StrokeKind::Outside,
        );
        painter.text(at + vec2(17.0, 0.0), Align2::LEFT_TOP, words, font.clone(), ink);
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

/// Colour and words of each level of agreement, fewest masks first.
pub fn agreement_rows(view: &ViewContext<'_>) -> Vec<([u8; 3], String)> {
    let of = view.colors.mask_count();
    let levels = measure::agreement(&view.time_point.regions);
    let words = |level: &measure::Agreement| {
        let masks = if of == 1 { "mask" } else { "masks" };
        let ml = format::ml(level.volume_ml);
        format!("{} of {of} {masks}: {ml}, {} voxels", level.masks, format::count(level.voxels))
    };
    levels.iter().map(|level| (agreement_color(level.masks, of), words(level))).collect()
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
