//! The tumour intersection closeup (thesis 7.3.3): rendered frame, orientation cube, legend and mouse input.

use egui::{Align2, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec3;
use glioscope_core::measure::Agreement;
use glioscope_render::{
    Coloring, Gpu, Pick, RegionScene, RenderError, agreement_color, flat, light, views::closeup::Closeup,
};

use super::{
    draw,
    legend::{self, Mark, Row},
    pane::{Input, Pane, Stage},
    ruler,
    view3d::{Canvas, Picked, ScreenReport, View, marks},
};
use crate::{
    command::{Commands, Workstation},
    format,
    model::{Document, PaneId},
    theme::{self, TEXT_POINTS, Tokens},
    world::{World, jobs::Lookup, numbers::AgreementNumbers},
};

/// The pane of the closeup.
#[derive(Default)]
pub struct CloseupPane {
    /// Its 3D view.
    pub canvas: Canvas<Closeup>,
}

impl CloseupPane {
    /// A pane with compiled pipelines, so that an unsuitable device is detected at the start.
    ///
    /// # Errors
    /// [`RenderError`] if the device can't run the passes.
    pub fn compiled(gpu: &Gpu) -> Result<Self, RenderError> {
        let mut pane = Self::default();
        pane.canvas.screen.compile(gpu)?;
        Ok(pane)
    }
}

impl Picked for Pick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

/// The closeup's scene of `doc`, without a slice plane.
pub fn scene(doc: &Document, world: &World, dark: bool) -> RegionScene {
    RegionScene {
        tumor: world.tumor(doc).cloned(),
        selection: world.selection(doc),
        colors: world.colors(doc),
        lens: doc.active_lens(),
        camera: doc.nav.camera,
        background: Tokens::of(dark).viewport_rgb(),
        silhouette: [0, 0, 0],
        plane: None,
    }
}

/// As [`scene`], for a workstation; `None` without a case.
pub fn scene_of(work: &Workstation, dark: bool) -> Option<RegionScene> {
    work.doc.as_ref().map(|doc| scene(doc, &work.world, dark))
}

impl Pane for CloseupPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        self.canvas.begin();
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let input = stage.input;
        let Some(graphics) = stage.graphics else {
            let text = "No graphics adapter: the 3D closeup can't be drawn. Install mesa-vulkan-drivers.";
            draw::message(ui, rect, text);
            return;
        };
        let doc = input.doc;
        let plane = doc.nav.show_plane.then(|| stage.results.plane.get(doc, input.context)).flatten();
        let mut scene = RegionScene {
            tumor: input.tumor.cloned(),
            selection: input.selection.clone(),
            colors: input.colors.clone(),
            lens: doc.active_lens(),
            camera: doc.nav.camera,
            background: Tokens::in_ui(ui).viewport_rgb(),
            silhouette: [0, 0, 0],
            plane,
        };
        let mut view = View { doc, pane: PaneId::Closeup, camera: scene.camera, rect };
        let outcome = self.canvas.handle_mouse(ui, graphics, &mut view, &response, out);
        scene.camera = view.camera;
        let draft = if outcome.measures() {
            let pick_at = |pos| self.canvas.pick(graphics, rect, pos).map(|p| p.world_mm);
            ruler::drag(ui, &response, doc, PaneId::Closeup, (&pick_at, None), out)
        } else {
            None
        };
        if !self.canvas.draw(ui, (graphics, &view, &response), &scene, stage.ask.wait, out) {
            return;
        }
        let agreement = agreement(stage);
        draw_marks(ui, &input, &view, &agreement);
        ruler::draw_3d(&ui.painter().with_clip_rect(rect), doc, &view.camera, rect, draft);
        let hover_text = self.canvas.hover().map(|pick| pick_text(&input, pick));
        let pointer_text = draft.as_ref().map(ruler::draft_text).or_else(|| hover_text.clone());
        self.canvas.draw_overlays(ui, &view, &response, &outcome, pointer_text.as_deref());
        response.widget_info(|| {
            let mut text = self.canvas.accessible_text("Closeup", hover_text.as_deref());
            if !agreement.is_empty() {
                let rows: Vec<&str> = agreement.iter().map(|(_, text)| text.as_str()).collect();
                text = format!("{text}\n{}", rows.join("; "));
            }
            WidgetInfo::labeled(Role::Canvas, true, text)
        });
    }

    fn ready(&self) -> bool {
        self.canvas.refined()
    }

    fn screen(&mut self) -> Option<&mut dyn ScreenReport> {
        Some(&mut self.canvas.screen)
    }
}

/// A pick as text: region, volume, position.
pub fn pick_text(input: &Input<'_>, pick: &Pick) -> String {
    let regions = &input.time_point.regions;
    let ml = regions.get(pick.bits).map_or_else(|| "unknown".into(), |r| format::ml(r.volume_ml));
    let place = flat::place_label(pick.world_mm, input.sides_known());
    let outside = if pick.inside_lens { "" } else { ", outside the lens" };
    format!("{} {ml}{outside}\n{place}", input.doc.edit.masks.region(regions.mask_ids(), pick.bits))
}

/// Draws the orientation cube, scale bar, legend and notes.
fn draw_marks(ui: &Ui, input: &Input<'_>, view: &View<'_>, agreement: &[Row]) {
    let rect = view.rect;
    let painter = ui.painter().with_clip_rect(rect);
    let ink = Tokens::in_ui(ui).text;
    let scale_position = if input.doc.edit.lens_on { "at the lens" } else { "at the middle" };
    marks::corners(ui, rect, input.sides_known(), (&view.camera, scale_position), false);
    legend::show(ui, rect, &legend_rows(input, agreement));
    if input.doc.nav.ruler_on {
        let text = "Ruler: drag from surface to surface";
        let at = rect.center_bottom() - vec2(0.0, 10.0);
        painter.text(at, Align2::CENTER_BOTTOM, text, theme::font(TEXT_POINTS), ink);
    }
    let regions = &input.time_point.regions;
    let (at, anchor, text) = if regions.union_voxels() == 0 {
        (rect.center(), Align2::CENTER_CENTER, "No mask is active at this time point")
    } else if input.selection.is_empty(regions) {
        (rect.center_top() + vec2(0.0, 28.0), Align2::CENTER_TOP, "Every region is hidden")
    } else {
        return;
    };
    painter.text(at, anchor, text, theme::font(TEXT_POINTS), ink);
}

/// The legend: masks and their overlaps, or the number of masks active at a voxel; and the cut of the lens.
fn legend_rows(input: &Input<'_>, agreement: &[Row]) -> Vec<Row> {
    let mut rows = match input.colors.coloring() {
        Coloring::Masks => legend::mask_rows(input),
        Coloring::Agreement => agreement.iter().rev().cloned().collect(),
    };
    if input.selection.is_empty(&input.time_point.regions) {
        return rows;
    }
    if input.doc.edit.lens_on {
        rows.push((Mark::Hatched, "cut by the lens".into()));
    }
    if light::shows_smooth(&input.doc.edit.light.at_rest()) {
        rows.push((Mark::None, "smoothed for display".into()));
    }
    rows
}

/// Legend rows of the levels of agreement, fewest masks first; empty in other colourings and until they are computed.
fn agreement(stage: &mut Stage<'_>) -> Vec<Row> {
    if stage.input.colors.coloring() != Coloring::Agreement {
        return Vec::new();
    }
    let mask_count = stage.input.colors.mask_count();
    match stage.results.numbers.agreement(stage.input.time_point, stage.ask) {
        Lookup::Ready(numbers) => agreement_rows(numbers, mask_count),
        Lookup::Working(_) | Lookup::Failed(_) => Vec::new(),
    }
}

fn agreement_rows(numbers: &AgreementNumbers, mask_count: usize) -> Vec<Row> {
    let text = |level: &Agreement| {
        let masks = if mask_count == 1 { "mask" } else { "masks" };
        let ml = format::ml(level.volume_ml);
        format!("{} of {mask_count} {masks}: {ml}, {} voxels", level.masks, format::count(level.voxels))
    };
    numbers
        .levels
        .iter()
        .map(|level| (Mark::Color(agreement_color(level.masks, mask_count)), text(level)))
        .collect()
}
