//! Draft while something moves, in full when still: the same for every 3D view.

use std::time::Duration;

use egui::Ui;
use glioscope_render::Quality;

/// How long a scene must be still before its picture is refined.
const STILL: Duration = Duration::from_millis(180);

/// What a 3D view remembers of the scene last shown.
pub struct Refinement<S> {
    last: Option<(S, f64)>,
    refined: bool,
}

impl<S> Default for Refinement<S> {
    fn default() -> Self {
        Self { last: None, refined: false }
    }
}

impl<S: Clone + PartialEq> Refinement<S> {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.refined
    }

    /// The quality for `scene` now, and whether it has just become full. `at_once`: no draft is
    /// shown, for pictures.
    pub fn quality(&mut self, ui: &Ui, scene: &S, at_once: bool) -> (Quality, bool) {
        let now = ui.input(|i| i.time);
        let moved_at = match &self.last {
            Some((last, at)) if last == scene => *at,
            Some(_) => now,
            None => f64::NEG_INFINITY,
        };
        let still = at_once || now - moved_at >= STILL.as_secs_f64();
        self.last = Some((scene.clone(), moved_at));
        let just = still && !self.refined;
        self.refined = still;
        if !still {
            ui.request_repaint_after(STILL);
        }
        (if still { Quality::FULL } else { Quality::DRAFT }, just)
    }
}
