//! The axial, coronal and sagittal slice views (thesis 7.4): image and masks on planes of the patient's axes, with
//! crosshair, orientation letters, scale bar, lens and readout.

mod gestures;
mod marks;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use egui::{
    Color32, ColorImage, Pos2, Rect, Role, Sense, TextureHandle, TextureOptions, Ui, WidgetInfo,
    emath::GuiRounding, pos2,
};
use glam::{DVec2, DVec3};
use glioscope_core::{Selection, Sides, TumorIndex};
use glioscope_render::{
    MaskColors,
    flat::{
        ContextLayer, MaskLayer, Mixing, Overlay, Plane, PreparedContext, SecondLayer, SliceLayers,
        SliceStyle, SliceView, Window, place_label, readout, render_slice,
    },
};

use self::gestures::GestureState;
use super::{
    change, draw,
    pane::{Input, Pane, Stage},
    ruler::{self, Flat},
};
use crate::{
    command::{Commands, EditCommand},
    format,
    model::{Fusion, PaneId, fusion::is_pet},
    world::{Second, jobs::Handle},
};

/// Width of mask outlines, points; at least one pixel is drawn.
const OUTLINE_POINTS: f32 = 1.5;

/// Geometry of a slice in its pane.
struct Layout {
    /// Rectangle of the slice, rounded to whole pixels.
    rect: Rect,
    pixels_per_point: f32,
    /// Plane, centre and magnification, in screen pixels.
    slice: SliceView,
    /// Bounding box that "fit" fits: of the image, or of the masks' grid without one.
    bounds_mm: (DVec3, DVec3),
}

impl Layout {
    /// `None` if a side of `rect` is below 1 pixel or above 16383.
    fn new(input: &Input<'_>, plane: Plane, rect: Rect, pixels_per_point: f32) -> Option<Self> {
        let rect = rect.round_to_pixels(pixels_per_point);
        let size = rect.size() * pixels_per_point;
        if !(size.x >= 1.0 && size.y >= 1.0 && size.x < 16384.0 && size.y < 16384.0) {
            return None;
        }
        let size_px = [size.x.round() as u32, size.y.round() as u32];
        let bounds_mm = input.fit_grid.unwrap_or_else(|| shown_grid(input)).bounds_mm();
        let nav = &input.doc.nav;
        let orientation = (nav.convention, nav.turn_of(plane));
        let mut slice = SliceView::fit_turned(plane, orientation, bounds_mm, nav.crosshair_mm(), size_px);
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
        // Far outside the pane, f32 coordinates would be too imprecise in shapes.
        let pixel = pixel.clamp(DVec2::splat(-1e6), DVec2::splat(1e6));
        self.rect.min + egui::vec2(pixel.x as f32, pixel.y as f32) / self.pixels_per_point
    }
}

/// The pane of one slice view.
pub struct SlicePane {
    /// The pane that it is, or is a part of.
    pane: PaneId,
    plane: Plane,
    drawn: Option<DrawnSlice>,
    gestures: GestureState,
}

impl SlicePane {
    /// A pane for this plane.
    pub fn new(plane: Plane) -> Self {
        Self::in_pane(PaneId::of_plane(plane), plane)
    }

    /// A slice that is a part of another pane.
    pub fn in_pane(pane: PaneId, plane: Plane) -> Self {
        Self { pane, plane, drawn: None, gestures: GestureState::default() }
    }

    /// Its plane.
    pub fn plane(&self) -> Plane {
        self.plane
    }

    /// How often the slice was rendered; a test checks that an idle view renders nothing.
    pub fn draws(&self) -> u64 {
        self.drawn.as_ref().map_or(0, |drawn| drawn.draws)
    }

    /// Draws the slice into all of `ui`.
    pub fn draw(&mut self, ui: &mut Ui, input: &Input<'_>, out: &mut Commands) {
        let (plane, rect) = (self.plane, ui.available_rect_before_wrap());
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let Some(layout) = Layout::new(input, plane, rect, ui.pixels_per_point()) else { return };
        self.gestures.interact(ui, input, (self.pane, &layout), &response, out);
        let inside = |pos: Pos2| layout.rect.contains(pos).then(|| layout.world_at(pos));
        // A line belongs to the date shown.
        let is_shown_date = input.time == input.doc.nav.time;
        let here = marks::in_slice(input, &layout);
        let (pos_of, normal) = (|mm| layout.pos_of(mm), layout.slice.normal());
        let moving = self.gestures.drag_of_date(ui, input, &layout, &response, out);
        let holds = is_shown_date
            && moving.is_none()
            && ruler::drag_handles(
                ui,
                &response,
                (input.doc, &here),
                Flat { pos_of: &pos_of, place_at: &inside, normal },
                out,
            );
        let draft = (is_shown_date && !holds && moving.is_none())
            .then(|| ruler::drag(ui, &response, input.doc, self.pane, (&inside, Some(normal)), out))
            .flatten();

        let (texture, not_finite_pixels) = self.slice_texture(ui, input, &layout);
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture.id(), layout.rect, whole, Color32::WHITE);

        let hovered = response.hover_pos().filter(|_| !response.dragged());
        let place = hovered.map_or(input.doc.nav.crosshair_mm(), |pos| layout.world_at(pos));
        let text = readout_text(input, place);
        marks::draw(ui, input, &layout, &text, not_finite_pixels);
        marks::rulers(ui, input, &layout, &here, draft);
        if let (Some(draft), Some(pointer)) = (&draft, response.interact_pointer_pos()) {
            draw::beside_pointer(ui.painter(), layout.rect, pointer, ruler::draft_text(draft));
        }
        if let Some((date, [from, to])) = moving {
            ruler::line(&ui.painter().with_clip_rect(layout.rect), [from, to], ruler::Look::Solid, "");
            let mm = layout.world_at(from).distance(layout.world_at(to));
            draw::beside_pointer(ui.painter(), layout.rect, to, format!("moves {date} by {mm:.1} mm"));
        }
        if input.doc.nav.ruler_on && response.hovered() {
            ui.ctx().set_cursor_icon(egui::CursorIcon::Crosshair);
        }
        response.widget_info(|| {
            let at = layout.slice.position_label(sides_known(input));
            WidgetInfo::labeled(Role::Canvas, true, format!("{} slice {at}: {text}", plane.name()))
        });
        window_menu(&response, input, out);
    }
}

impl Pane for SlicePane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        self.draw(ui, &stage.input, out);
    }
}

/// The grid that slices step through: the image's, or the masks' without an image.
fn shown_grid<'a>(input: &Input<'a>) -> &'a glioscope_core::Grid {
    input.context.map_or(&input.case.grid, |(_, image)| image.volume().grid())
}

/// Whether orientation letters may be shown: image and masks both have known sides.
fn sides_known(input: &Input<'_>) -> bool {
    let image = input.context.map_or(Sides::Known, |(_, image)| image.volume().grid().sides());
    image == Sides::Known && input.case.grid.sides() == Sides::Known
}

/// Position, intensity and masks at a point, in one line.
fn readout_text(input: &Input<'_>, world_mm: DVec3) -> String {
    let index = &input.time_point.index;
    let found = readout(world_mm, input.context.map(|(_, image)| &**image.volume()), Some(index));
    let mut parts = vec![place_label(world_mm, sides_known(input))];
    if let Some((id, _)) = input.context {
        parts.push(match found.intensity {
            Some(value) => format!("{id} {}", format::six_digits(value)),
            None => format!("outside {id}"),
        });
    }
    if let Some(second) = &input.second
        && let Some(value) = readout(world_mm, Some(second.image.volume()), None).intensity
    {
        parts.push(format!("{} {}", second.id, format::six_digits(value)));
    }
    if found.bits != 0 {
        let names = input.doc.edit.masks.names(index.mask_ids());
        let active = names.iter().enumerate().filter(|(k, _)| found.bits >> k & 1 == 1);
        let names: Vec<&str> = active.map(|(_, name)| name.as_str()).collect();
        let hidden = if input.selection.shows(found.bits) { "" } else { " (hidden)" };
        parts.push(format!("{}{hidden}", names.join(" + ")));
    }
    parts.join("  ·  ")
}

/// Everything that a slice's pixels depend on.
#[derive(PartialEq)]
struct SliceKey {
    slice: SliceView,
    image: Option<(Handle<PreparedContext>, Window)>,
    second: Option<(Handle<PreparedContext>, Window, Fusion)>,
    index: Handle<TumorIndex>,
    colors: MaskColors,
    selection: Selection,
    overlay: Overlay,
    opacity: f32,
    outline_px: u32,
    outline_patterns: bool,
    counted: u32,
    style: SliceStyle,
}

/// The slice last rendered.
struct DrawnSlice {
    key: SliceKey,
    texture: TextureHandle,
    not_finite_pixels: u64,
    draws: u64,
}

/// Seconds that each of two images is shown while they blink.
const BLINK_SECONDS: f64 = 0.7;

/// Whether the second image is shown at this moment: while both blink, half of the time.
fn shows_second(ctx: &egui::Context, fusion: &Fusion) -> bool {
    if fusion.mixing != Mixing::Blink {
        return true;
    }
    let turns = ctx.input(|i| i.time) / BLINK_SECONDS;
    let left = (1.0 - turns.fract()) * BLINK_SECONDS;
    ctx.request_repaint_after(std::time::Duration::from_secs_f64(left.max(0.01)));
    turns as u64 % 2 == 1
}

/// The second image as a layer.
fn layer<'a>(second: Second<'a>, fusion: &Fusion) -> SecondLayer<'a> {
    SecondLayer {
        image: second.image,
        window: second.window,
        map: fusion.map,
        mixing: fusion.mixing,
        opacity: fusion.opacity,
        threshold: fusion.threshold_in(second.window),
        share: fusion.share,
    }
}

/// The masks that slices show: those of the time point shown, or one mask at the two compared time points with the
/// changed voxels filled.
struct ShownMasks {
    index: Arc<TumorIndex>,
    colors: MaskColors,
    selection: Selection,
    /// Bits of the region shown but not filled.
    unfilled: Option<u32>,
    /// Bits of the masks that count.
    counted: u32,
}

fn shown_masks(input: &Input<'_>) -> ShownMasks {
    let edit = &input.doc.edit;
    // What isn't aligned has no change to fill.
    match input.compared.filter(|compared| edit.change.on_slices && !compared.report.has_volumes_only()) {
        Some(compared) => ShownMasks {
            index: compared.index.clone(),
            colors: change::pair_colors(edit.palette),
            selection: Selection::all(),
            // Active at both time points: unchanged.
            unfilled: Some(0b11),
            counted: u32::MAX,
        },
        None => ShownMasks {
            index: input.time_point.index.clone(),
            colors: input.colors.clone(),
            selection: input.only_mask.map_or_else(|| input.selection.clone(), |_| Selection::all()),
            unfilled: None,
            counted: input.only_mask.map_or(u32::MAX, |mask| 1 << mask),
        },
    }
}

impl SlicePane {
    /// The slice as a texture, rendered only when something it depends on changed, and its number of pixels that are
    /// NaN or infinite.
    fn slice_texture(&mut self, ui: &Ui, input: &Input<'_>, layout: &Layout) -> (TextureHandle, u64) {
        let edit = &input.doc.edit;
        let masks = shown_masks(input);
        let (index, colors, selection) = (&masks.index, &masks.colors, &masks.selection);
        // Dark in both themes: greys are judged against black, and the overlaid marks are white.
        let style = SliceStyle::DARK;
        let outline_px = (OUTLINE_POINTS * layout.pixels_per_point).round().max(1.0) as u32;
        let image = input.context.map(|(_, image)| image).zip(input.window());
        let second = input.second.filter(|_| shows_second(ui.ctx(), &edit.fusion));
        let key = SliceKey {
            slice: layout.slice,
            image: image.map(|(image, window)| (Handle::of(image), window)),
            second: second.map(|s| (Handle::of(s.image), s.window, edit.fusion.clone())),
            index: Handle::of(index),
            colors: colors.clone(),
            selection: selection.clone(),
            overlay: edit.overlay,
            opacity: edit.overlay_opacity,
            outline_px,
            outline_patterns: edit.outline_patterns,
            counted: masks.counted,
            style,
        };
        if let Some(drawn) = &self.drawn
            && drawn.key == key
        {
            return (drawn.texture.clone(), drawn.not_finite_pixels);
        }
        let layers = SliceLayers {
            context: image.map(|(image, window)| ContextLayer { image, window }),
            second: second.map(|second| layer(second, &edit.fusion)),
            masks: Some(MaskLayer {
                index,
                colors,
                selection,
                overlay: edit.overlay,
                opacity: edit.overlay_opacity,
                outline_px,
                outline_patterns: edit.outline_patterns,
                unfilled: masks.unfilled,
                counted: masks.counted,
            }),
            style,
        };
        let slice = render_slice(&layout.slice, &layers);
        let pixels = ColorImage::from_rgba_premultiplied(slice.size.map(|s| s as usize), &slice.rgba);
        let (texture, draws) = match self.drawn.take() {
            Some(DrawnSlice { mut texture, draws, .. }) => {
                texture.set(pixels, TextureOptions::NEAREST);
                (texture, draws + 1)
            }
            None => {
                let name = format!("{} slice", layout.slice.plane.name());
                (ui.ctx().load_texture(name, pixels, TextureOptions::NEAREST), 1)
            }
        };
        let not_finite_pixels = slice.not_finite_pixels;
        self.drawn = Some(DrawnSlice { key, texture: texture.clone(), not_finite_pixels, draws });
        (texture, not_finite_pixels)
    }
}

/// Context menu of the image's window presets.
fn window_menu(response: &egui::Response, input: &Input<'_>, out: &mut Commands) {
    let Some((id, image)) = input.context else { return };
    response.context_menu(|ui| {
        ui.label(format!("Window of {id}"));
        let current = input.window();
        for preset in image.presets(is_pet(id)) {
            if ui.selectable_label(Some(preset.window) == current, preset.name).clicked() {
                out.push(EditCommand::SetWindow(id.to_owned(), preset.window));
                ui.close();
            }
        }
    });
}
