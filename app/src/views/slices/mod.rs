//! The three slice views (thesis 7.4): image and masks on true planes of the patient, with
//! crosshair, orientation letters, scale bar, lens and a readout.

mod gestures;
mod marks;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use egui::{
    Color32, ColorImage, Id, IdSalt, Pos2, Rect, Role, Sense, TextureHandle, TextureOptions, Ui, WidgetInfo,
    emath::GuiRounding, pos2,
};
use glam::{DVec2, DVec3};
use glioscope_core::{Selection, Sides, TumorIndex};
use glioscope_render::{
    MaskColors,
    slices::{
        ContextLayer, MaskLayer, Overlay, Plane, PreparedContext, SliceLayers, SliceStyle, SliceView, Window,
        place_label, readout, render_slice,
    },
};

use super::{Handle, ViewContext, change, ruler};
use crate::{commands::Command, document::RulerView};

/// Width of outlines in points; at least one pixel.
const OUTLINE_POINTS: f32 = 1.5;

/// A slice as it is laid out in its pane.
struct Layout {
    /// Where it is, on whole pixels.
    rect: Rect,
    pixels_per_point: f32,
    /// What it shows, in pixels of the screen.
    slice: SliceView,
    /// Smallest and largest world coordinates of what "fit" fits: the image, else the masks' grid.
    bounds_mm: (DVec3, DVec3),
}

impl Layout {
    /// `None` where there is no room for a pixel.
    fn new(view: &ViewContext<'_>, plane: Plane, rect: Rect, pixels_per_point: f32) -> Option<Self> {
        let rect = rect.round_to_pixels(pixels_per_point);
        let size = rect.size() * pixels_per_point;
        if !(size.x >= 1.0 && size.y >= 1.0 && size.x < 16384.0 && size.y < 16384.0) {
            return None;
        }
        let size_px = [size.x.round() as u32, size.y.round() as u32];
        let grid = view.context.map_or(&view.case.grid, |(_, image)| image.volume().grid());
        let bounds_mm = grid.bounds_mm();
        let nav = &view.doc.nav;
        let mut slice = SliceView::fit(plane, nav.convention, bounds_mm, nav.cursor_mm, size_px);
        if let Some(mm_per_point) = nav.mm_per_point {
            slice.mm_per_pixel = mm_per_point / f64::from(pixels_per_point);
        }
        let pan = nav.pan_mm[plane as usize];
        slice.center_mm += slice.right() * pan.x + slice.down() * pan.y;
        Some(Self { rect, pixels_per_point, slice, bounds_mm })
    }

    fn mm_per_point(&self) -> f64 {
        self.slice.mm_per_pixel * f64::from(self.pixels_per_point)
    }

    fn world_at(&self, pos: Pos2) -> DVec3 {
        let pixels = (pos - self.rect.min) * self.pixels_per_point;
        self.slice.world_at(DVec2::new(f64::from(pixels.x), f64::from(pixels.y)))
    }

    fn pos_of(&self, world_mm: DVec3) -> Pos2 {
        self.pos_of_pixel(self.slice.pixel_of(world_mm))
    }

    fn pos_of_pixel(&self, pixel: DVec2) -> Pos2 {
        // Far outside, f32 would lose the other coordinate's precision in shapes.
        let pixel = pixel.clamp(DVec2::splat(-1e6), DVec2::splat(1e6));
        self.rect.min + egui::vec2(pixel.x as f32, pixel.y as f32) / self.pixels_per_point
    }
}

/// Draws one slice view into all of `ui` and writes what the user did to `out`.
pub fn show(ui: &mut Ui, view: &ViewContext<'_>, plane: Plane, out: &mut Vec<Command>) {
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let Some(layout) = Layout::new(view, plane, rect, ui.pixels_per_point()) else { return };
    let memory = ui.scope_id().with(IdSalt::new(("slice", plane)));
    gestures::interact(ui, view, &layout, &response, memory, out);
    let inside = |pos: Pos2| layout.rect.contains(pos).then(|| layout.world_at(pos));
    let draft = ruler::drag(ui, &response, view.doc, RulerView::Slice(plane), &inside, out);

    let (texture, not_finite_pixels) = picture(ui, view, &layout, memory);
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    ui.painter().image(texture.id(), layout.rect, whole, Color32::WHITE);

    let pointed = response.hover_pos().filter(|_| !response.dragged());
    let place = pointed.map_or(view.doc.nav.cursor_mm, |pos| layout.world_at(pos));
    let text = readout_text(view, place);
    marks::draw(ui, view, &layout, &text, not_finite_pixels);
    marks::rulers(ui, view, &layout, draft);
    if let (Some(draft), Some(pointer)) = (&draft, response.interact_pointer_pos()) {
        ruler::beside_pointer(ui.painter(), layout.rect, pointer, ruler::draft_text(draft));
    }
    if view.doc.nav.ruler_on && response.hovered() {
        ui.ctx().set_cursor_icon(egui::CursorIcon::Crosshair);
    }
    response.widget_info(|| {
        let at = layout.slice.position_label(sides_known(view));
        WidgetInfo::labeled(Role::Canvas, true, format!("{} slice {at}: {text}", plane.name()))
    });
    window_menu(&response, view, out);
}

/// The grid that slices step through: the image's, else the masks'.
fn grid_shown<'a>(view: &ViewContext<'a>) -> &'a glioscope_core::Grid {
    view.context.map_or(&view.case.grid, |(_, image)| image.volume().grid())
}

/// Whether letters may be shown: both what is drawn and what lies over it say where they are.
fn sides_known(view: &ViewContext<'_>) -> bool {
    let image = view.context.map_or(Sides::Known, |(_, image)| image.volume().grid().sides());
    image == Sides::Known && view.case.grid.sides() == Sides::Known
}

/// The window of the image shown: the user's, or the image's own.
pub(super) fn window_of(view: &ViewContext<'_>, id: &str, image: &PreparedContext) -> Window {
    view.doc.edit.windows.get(id).copied().unwrap_or_else(|| image.histogram().initial_window())
}

/// Place, intensity and masks at a point, in one line.
fn readout_text(view: &ViewContext<'_>, world_mm: DVec3) -> String {
    let index = &view.time_point.index;
    let found = readout(world_mm, view.context.map(|(_, image)| &**image.volume()), Some(index));
    let mut parts = vec![place_label(world_mm, sides_known(view))];
    if let Some((id, _)) = view.context {
        parts.push(match found.intensity {
            Some(value) => format!("{id} {}", intensity(value)),
            None => format!("outside {id}"),
        });
    }
    if found.bits != 0 {
        let names: Vec<&str> = index
            .mask_ids()
            .iter()
            .enumerate()
            .filter(|(k, _)| found.bits >> k & 1 == 1)
            .map(|(_, id)| id.as_str())
            .collect();
        let hidden = if view.doc.edit.selection.shows(found.bits) { "" } else { " (hidden)" };
        parts.push(format!("{}{hidden}", names.join(" + ")));
    }
    parts.join("  ·  ")
}

/// A stored value in at most six digits; whole numbers in full.
fn intensity(value: f64) -> String {
    if value.is_nan() {
        return "not a number".into();
    }
    if value.is_infinite() || (value.fract() == 0.0 && value.abs() < 1e15) {
        return format!("{value}");
    }
    let digits = (5.0 - value.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    if value.abs() < 1e-6 { format!("{value:.5e}") } else { format!("{value:.digits$}") }
}

/// Everything that a slice's pixels depend on.
#[derive(Clone, PartialEq)]
struct Inputs {
    slice: SliceView,
    image: Option<(Handle<PreparedContext>, Window)>,
    index: Handle<TumorIndex>,
    colors: MaskColors,
    selection: Selection,
    overlay: Overlay,
    opacity: f32,
    outline_px: u32,
    style: SliceStyle,
}

/// The picture last drawn, in egui's memory.
#[derive(Clone)]
struct Drawn {
    inputs: Arc<Inputs>,
    texture: TextureHandle,
    not_finite_pixels: u64,
    /// How often it was drawn: a test that an idle view draws nothing reads it.
    draws: u64,
}

/// The masks that slices show: those of the date shown, or one mask at the two dates compared, with
/// what changed filled.
struct Masks {
    index: Arc<TumorIndex>,
    colors: MaskColors,
    selection: Selection,
    unfilled: Option<u32>,
}

fn masks_of(view: &ViewContext<'_>) -> Masks {
    let edit = &view.doc.edit;
    match view.compared.filter(|_| edit.change.on_slices) {
        Some(compared) => Masks {
            index: compared.index.clone(),
            colors: change::pair_colors(edit.palette),
            selection: Selection::all(),
            // Both dates have it: nothing changed.
            unfilled: Some(0b11),
        },
        None => Masks {
            index: view.time_point.index.clone(),
            colors: view.colors.clone(),
            selection: edit.selection.clone(),
            unfilled: None,
        },
    }
}

/// The slice as a texture, drawn only when something it depends on changed, and how many of its
/// pixels are NaN or infinite.
fn picture(ui: &Ui, view: &ViewContext<'_>, layout: &Layout, memory: Id) -> (TextureHandle, u64) {
    let edit = &view.doc.edit;
    let masks = masks_of(view);
    let (index, colors, selection) = (&masks.index, &masks.colors, &masks.selection);
    // Dark in both themes: greys are judged against black, and the marks are white.
    let style = SliceStyle::DARK;
    let outline_px = (OUTLINE_POINTS * layout.pixels_per_point).round().max(1.0) as u32;
    let image = view.context.map(|(id, image)| (image, window_of(view, id, image)));
    let inputs = Inputs {
        slice: layout.slice,
        image: image.map(|(image, window)| (Handle::of(image), window)),
        index: Handle::of(index),
        colors: colors.clone(),
        selection: selection.clone(),
        overlay: edit.overlay,
        opacity: edit.overlay_opacity,
        outline_px,
        style,
    };
    let before = ui.data(|data| data.get_temp::<Drawn>(memory));
    if let Some(drawn) = &before
        && *drawn.inputs == inputs
    {
        return (drawn.texture.clone(), drawn.not_finite_pixels);
    }
    let layers = SliceLayers {
        context: image.map(|(image, window)| ContextLayer { image, window }),
        masks: Some(MaskLayer {
            index,
            colors,
            selection,
            overlay: edit.overlay,
            opacity: edit.overlay_opacity,
            outline_px,
            unfilled: masks.unfilled,
        }),
        style,
    };
    let slice = render_slice(&layout.slice, &layers);
    let pixels = ColorImage::from_rgba_premultiplied(slice.size.map(|s| s as usize), &slice.rgba);
    let (texture, draws) = match before {
        Some(Drawn { mut texture, draws, .. }) => {
            texture.set(pixels, TextureOptions::NEAREST);
            (texture, draws + 1)
        }
        None => {
            let name = format!("{} slice", layout.slice.plane.name());
            (ui.ctx().load_texture(name, pixels, TextureOptions::NEAREST), 1)
        }
    };
    let not_finite_pixels = slice.not_finite_pixels;
    let drawn = Drawn { inputs: Arc::new(inputs), texture: texture.clone(), not_finite_pixels, draws };
    ui.data_mut(|data| data.insert_temp(memory, drawn));
    (texture, not_finite_pixels)
}

/// Presets of the image, on a right click.
fn window_menu(response: &egui::Response, view: &ViewContext<'_>, out: &mut Vec<Command>) {
    let Some((id, image)) = view.context else { return };
    response.context_menu(|ui| {
        ui.label(format!("Window of {id}"));
        let current = window_of(view, id, image);
        for preset in image.histogram().presets() {
            if ui.selectable_label(preset.window == current, preset.name).clicked() {
                out.push(Command::SetWindow(id.to_owned(), preset.window));
                ui.close();
            }
        }
    });
}
