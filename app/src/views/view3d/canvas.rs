//! A 3D view in its pane: rendered frame and mouse input. All views except the closeup follow the orientation of the
//! closeup's camera, not its position (thesis 7.3.3).

use egui::{Color32, Context, Id, Pos2, Rect, Response, Ui, pos2};
use glam::{DVec3, UVec2};
use glioscope_render::View3d;

use super::{
    camera_drag::{self, Outcome},
    refinement::{PART_MS, Refinement},
    screen::{Graphics, Screen, ScreenReport},
    view::View,
};
use crate::{
    command::{Commands, LookCommand},
    views::draw,
};

/// A pick: what is at a pixel of a 3D view.
pub trait Picked {
    /// Position, world millimetres.
    fn world_mm(&self) -> DVec3;
}

/// State of a 3D view between frames; never saved.
pub struct Canvas<V: View3d> {
    /// Renders the view and shows its frame.
    pub screen: Screen<V>,
    refinement: Refinement<V::Scene>,
    /// Pointer position that `hover` is of.
    pointer: Option<Pos2>,
    hover: Option<V::Pick>,
    /// Whether a finer frame is in progress.
    pending: bool,
    /// Whether there is a scene. Without one the pane shows a message, which is final.
    has_scene: bool,
}

impl<V: View3d> Default for Canvas<V> {
    fn default() -> Self {
        Self {
            screen: Screen::default(),
            refinement: Refinement::default(),
            pointer: None,
            hover: None,
            pending: false,
            has_scene: false,
        }
    }
}

/// Share of a frame's time budget that 3D views have where the CPU draws everything; the interface needs the rest.
const VIEWS_SHARE_ON_CPU: f64 = 0.6;

/// Counts the 3D views drawn per frame.
#[derive(Clone, Copy, Default)]
struct ViewsDrawn {
    frame: u64,
    so_far: u32,
    before: u32,
}

/// Number of 3D views that draw while something moves, counting the one that asks: in this frame or in the one before it
/// that drew any, whichever are more.
fn views_drawn(ctx: &Context) -> u32 {
    let frame = ctx.cumulative_frame_nr();
    ctx.data_mut(|data| {
        let drawn: &mut ViewsDrawn = data.get_temp_mut_or_default(Id::unique("3D views drawn"));
        if drawn.frame != frame {
            *drawn = ViewsDrawn { frame, so_far: 0, before: drawn.so_far };
        }
        drawn.so_far += 1;
        drawn.so_far.max(drawn.before)
    })
}

impl<V: View3d<Pick: Picked>> Canvas<V> {
    /// Whether the frame last drawn is of the final quality, or the pane has nothing to draw.
    pub fn refined(&self) -> bool {
        !self.has_scene || self.refinement.refined() && !self.pending
    }

    /// Begins a frame of the window, in which [`Canvas::draw`] may not be reached.
    pub fn begin(&mut self) {
        self.has_scene = false;
    }

    /// The pick under the pointer.
    pub fn hover(&self) -> Option<&V::Pick> {
        self.hover.as_ref()
    }

    /// The pick at a position of the frame last drawn; `None` on the background and outside `rect`.
    pub fn pick(&self, graphics: &Graphics, rect: Rect, pos: Pos2) -> Option<V::Pick> {
        let (u, v) = ((pos.x - rect.left()) / rect.width(), (pos.y - rect.top()) / rect.height());
        let inside = (0.0..1.0).contains(&u) && (0.0..1.0).contains(&v);
        let (frame, [x, y]) = self.screen.pixel(u, v).filter(|_| inside)?;
        // A device error is reported when the next frame is drawn.
        frame.pick(&graphics.gpu, x, y).ok().flatten()
    }

    /// Handles mouse input: rotates, pans, zooms, moves and resizes the lens. A turn shows in this frame already: `view` then has the
    /// camera of the next one.
    pub fn handle_mouse(
        &self,
        ui: &Ui,
        graphics: &Graphics,
        view: &mut View<'_>,
        response: &Response,
        out: &mut Commands,
    ) -> Outcome {
        let pick_at = |pos| self.pick(graphics, view.rect, pos).map(|pick| pick.world_mm());
        let outcome = camera_drag::interact(ui, response, view, &pick_at, out);
        view.push_camera(response, &outcome.camera, out);
        view.camera = view.moved(&outcome.camera);
        outcome
    }

    /// Draws `scene`, picks under the pointer and shows the crosshair there; a click pins it. `false` if nothing could be drawn; the
    /// pane then shows the error. `at_once`: final quality without a draft, for picture files.
    pub fn draw(
        &mut self,
        ui: &Ui,
        (graphics, view, response): (&Graphics, &View<'_>, &Response),
        scene: &V::Scene,
        at_once: bool,
        out: &mut Commands,
    ) -> bool {
        self.has_scene = true;
        let rect = view.rect;
        let size = rect.size() * ui.pixels_per_point();
        if size.x < 1.0 || size.y < 1.0 {
            return false;
        }
        let size = UVec2::new(size.x.round() as u32, size.y.round() as u32);
        let choice = &view.doc.edit.light;
        let step = self.refinement.step(ui, scene, choice, at_once);
        let frames = self.screen.frames_drawn();
        let texture = match &step.in_parts {
            Some(draft) => self.screen.show_in_parts(graphics, scene, (draft, &step.quality), size, PART_MS),
            None => self.screen.show(graphics, scene, &step.quality, size, step.timed),
        };
        self.pending = step.in_parts.is_some()
            && texture.is_ok()
            && (self.screen.share_done().is_some() || self.screen.quality() != Some(&step.quality));
        if self.pending {
            ui.ctx().request_repaint();
        }
        if let Some(milliseconds) = self.screen.draw_ms() {
            // Linked views turn together: on the CPU they share the time of a frame, with the interface.
            let of_frame = if graphics.gpu.is_software() {
                milliseconds * f64::from(views_drawn(ui.ctx())) / VIEWS_SHARE_ON_CPU
            } else {
                milliseconds
            };
            self.refinement.adapt(choice, of_frame);
        }
        if step.just_refined || (step.in_parts.is_some() && self.screen.frames_drawn() != frames) {
            // The pick under a pointer that didn't move may have changed.
            self.pointer = None;
        }
        match texture {
            Ok(texture) => {
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                ui.painter().image(texture, rect, whole, Color32::WHITE);
            }
            Err(error) => {
                draw::message(ui, rect, &error.to_string());
                return false;
            }
        }
        self.pick_hovered(graphics, view, response, out);
        true
    }

    fn pick_hovered(
        &mut self,
        graphics: &Graphics,
        view: &View<'_>,
        response: &Response,
        out: &mut Commands,
    ) {
        let pointer = response.hover_pos();
        if pointer == self.pointer && !response.clicked() {
            return;
        }
        self.pointer = pointer;
        self.hover =
            pointer.filter(|_| !response.dragged()).and_then(|pos| self.pick(graphics, view.rect, pos));
        if response.dragged() {
            return;
        }
        let nav = &view.doc.nav;
        let place_mm = self.hover.as_ref().map(Picked::world_mm);
        match place_mm {
            Some(place_mm) if response.clicked() => out.push(LookCommand::SetCursor(place_mm)),
            Some(_) if nav.follow_pointer => out.push(LookCommand::PreviewCursor(view.pane, place_mm)),
            None if nav.preview.is_some_and(|(of, _)| of == view.pane) => {
                out.push(LookCommand::PreviewCursor(view.pane, None));
            }
            _ => {}
        }
    }

    /// Draws the overlays: the highlighted ring while it is grabbed or under the pointer, else `text` beside the
    /// pointer; and the warnings.
    pub fn draw_overlays(
        &self,
        ui: &Ui,
        view: &View<'_>,
        response: &Response,
        outcome: &Outcome,
        text: Option<&str>,
    ) {
        camera_drag::ring_marks(ui, response, view, outcome);
        let painter = ui.painter().with_clip_rect(view.rect);
        if let (Some(pointer), Some(text), false) = (response.hover_pos(), text, outcome.ring) {
            draw::beside_pointer(&painter, view.rect, pointer, text.to_owned());
        }
        draw::warnings(ui, view.rect, self.warnings());
    }

    /// Parts of the scene that the frame doesn't show, as text.
    pub fn warnings(&self) -> &[String] {
        self.screen.warnings()
    }

    /// Text for screen readers: `what`, the pick under the pointer, and the warnings.
    pub fn accessible_text(&self, what: &str, hover_text: Option<&str>) -> String {
        let mut text = format!("{what}: {}", hover_text.unwrap_or("nothing under the pointer"));
        for warning in self.warnings() {
            text = format!("{text}\nWarning: {warning}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_that_turn_together_are_counted() {
        let ctx = Context::default();
        let counts: Vec<Vec<u32>> = [3, 3, 1, 1]
            .map(|views| {
                let mut counts = Vec::new();
                let output = ctx.run_ui(egui::RawInput::default(), |ui| {
                    counts = (0..views).map(|_| views_drawn(ui.ctx())).collect();
                });
                output.drop_without_applying_deltas();
                counts
            })
            .into();
        assert_eq!(counts, [vec![1, 2, 3], vec![3, 3, 3], vec![3], vec![1]]);
    }
}
