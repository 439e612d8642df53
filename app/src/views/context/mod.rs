//! The context view (thesis 7.3.2): the tumour within the volume-rendered image, visible through it from every side.

mod second;
mod tract_list;
pub mod tract_look;

use egui::{Rect, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec3;
use glioscope_core::optics::Camera;
use glioscope_render::{ContextPick, ContextScene, flat, views::context::Context};

use super::{
    draw,
    pane::{Input, Pane, Stage},
    ruler,
    view3d::{Canvas, Picked, ScreenReport, View, linked_camera, marks},
};
use crate::{
    command::Commands,
    model::{PaneId, document::tumor_radius_mm},
    theme::{self, LABEL_POINTS, Tokens},
    world::jobs::Lookup,
};

/// The pane of the context view.
#[derive(Default)]
pub struct ContextPane {
    /// Its 3D view.
    pub canvas: Canvas<Context>,
}

impl Picked for ContextPick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

/// A camera that fits the image, or without one the tumour.
fn camera(input: &Input<'_>) -> Camera {
    let nav = &input.doc.nav;
    let (focus_mm, radius_mm) = match input.context {
        Some((_, image)) => {
            let (low, high) = image.volume().grid().bounds_mm();
            // Heads are round: the corners of the bounding box may be outside the view.
            ((low + high) / 2.0, (high - low).length() * 0.36)
        }
        None => (input.doc.edit.lens.center_mm, tumor_radius_mm(input.time_point)),
    };
    linked_camera(&nav.camera, focus_mm, radius_mm, nav.zoom(PaneId::Context))
}

impl Pane for ContextPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        self.canvas.begin();
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let (input, ask) = (stage.input, stage.ask);
        let Some(graphics) = stage.graphics else {
            draw::message(ui, rect, "No graphics adapter: the context view can't be drawn.");
            return;
        };
        let mut note = None;
        let volume = match stage.results.image.volume(input.context, ask) {
            Some(Lookup::Ready(volume)) => Some(volume.clone()),
            Some(Lookup::Working(_)) => {
                note = Some("Preparing the image…".to_owned());
                ui.request_repaint_after(std::time::Duration::from_millis(100));
                None
            }
            Some(Lookup::Failed(error)) => {
                note = Some(error.to_string());
                None
            }
            None => None,
        };
        let transfer = stage.results.image.transfer(input.doc, input.context);
        let (projection, second_note) = second::projection(ui, stage);
        let (tubes, gaps, tracts_note) = tract_list::drawn_tubes(ui, stage);
        let mut scene = ContextScene {
            projection,
            volume,
            transfer,
            clip: input.doc.edit.clips.clone(),
            tumor: input.tumor.cloned(),
            selection: input.selection.clone(),
            colors: input.colors.clone(),
            lens: input.doc.active_lens(),
            tubes,
            camera: camera(&input),
            background: Tokens::in_ui(ui).viewport_rgb(),
            silhouette: [0, 0, 0],
        };
        let mut view = View { doc: input.doc, pane: PaneId::Context, camera: scene.camera, rect };
        let outcome = self.canvas.handle_mouse(ui, graphics, &mut view, &response, out);
        scene.camera = view.camera;
        if !self.canvas.draw(ui, (graphics, &view, &response), &scene, ask.wait, out) {
            return;
        }
        let hover = self.canvas.hover().copied().filter(|_| !input.is_plain);
        let hover_text = hover.map(|pick| {
            let fiber = pick.fiber.map(|fiber| tract_list::fiber_text(stage, fiber));
            pick_text(&input, &pick, fiber)
        });
        let name = match input.context {
            Some(_) if input.is_plain => "",
            Some((id, _)) => id,
            None => "no image",
        };
        let dark = ui.visuals().dark_mode;
        let ink = Tokens::of(dark).text;
        let painter = ui.painter().with_clip_rect(rect);
        if !input.is_plain {
            ruler::draw_3d(&painter, input.doc, &view.camera, rect, None);
        }
        let text = note.unwrap_or_else(|| name.to_owned());
        let text = painter.layout_no_wrap(text, theme::font(LABEL_POINTS), ink);
        let text_rect = Rect::from_min_size(rect.left_top() + vec2(10.0, 8.0), text.size());
        if !text.is_empty() {
            draw::plate(&painter, text_rect, dark);
            painter.galley(text_rect.min, text, ink);
        }
        if !input.is_plain {
            tract_list::list(ui, &input, rect, text_rect.bottom() + 8.0, (&scene.tubes, &gaps), out);
        }
        if let Some(projection) = &scene.projection {
            second::legend(ui, &input, rect, projection);
        }
        if let Some(note) = tracts_note.or(second_note) {
            draw::note(ui, rect, &note);
        }
        let scale_position = if input.is_plain { "" } else { "at the middle" };
        marks::corners(ui, rect, input.sides_known(), (&scene.camera, scale_position), true);
        self.canvas.draw_overlays(ui, &view, &response, &outcome, hover_text.as_deref());
        response.widget_info(|| {
            let text = self.canvas.accessible_text(&format!("Context view of {name}"), hover_text.as_deref());
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

fn pick_text(input: &Input<'_>, pick: &ContextPick, fiber: Option<String>) -> String {
    let place = flat::place_label(pick.world_mm, input.sides_known());
    let masks = &input.doc.edit.masks;
    let what =
        fiber.or_else(|| pick.bits.map(|bits| masks.region(input.time_point.regions.mask_ids(), bits)));
    what.map_or_else(|| place.clone(), |what| format!("{what}\n{place}"))
}
