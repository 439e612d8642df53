//! Fluent while something moves, as good as it gets when still: the same for every 3D view.

use std::time::Duration;

use egui::Ui;
use glioscope_render::{
    LightingMode, Preset, Quality,
    light::{self, Auto},
};
use strum::VariantArray;

use crate::model::LightChoice;

/// How long a scene must be still before its picture is refined.
const STILL: Duration = Duration::from_millis(180);
/// How long before it is drawn as the reference: a picture that may take long.
const AT_REST: Duration = Duration::from_millis(450);

/// How long the window may wait for a part of a finer picture.
pub const PART_MS: f64 = 40.0;

/// How fine a picture is by now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Moving,
    Still,
    AtRest,
}

/// What a 3D view remembers of the scene last shown.
pub struct Refinement<S> {
    last: Option<(S, LightChoice, f64)>,
    phase: Phase,
    auto: [Auto; LightingMode::VARIANTS.len()],
}

impl<S> Default for Refinement<S> {
    fn default() -> Self {
        let auto = std::array::from_fn(|at| Auto::of(LightingMode::VARIANTS[at]));
        Self { last: None, phase: Phase::Moving, auto }
    }
}

/// What to draw now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Now {
    /// The quality.
    pub quality: Quality,
    /// Whether it has just become better than while moving.
    pub just_refined: bool,
    /// What to draw first where `quality` is drawn in parts, which may take long: then the window must not wait.
    pub in_parts: Option<Quality>,
    /// Whether [`Refinement::adapt`] needs to know how long it takes.
    pub timed: bool,
}

impl<S: Clone + PartialEq> Refinement<S> {
    /// Whether the picture last drawn was as good as it gets.
    pub fn refined(&self) -> bool {
        self.phase == Phase::AtRest
    }

    /// Adapts to the time of a picture that was to be timed.
    pub fn adapt(&mut self, choice: &LightChoice, milliseconds: f64) {
        self.auto[choice.mode as usize].adapt(milliseconds);
    }

    /// The quality for `scene` now. `at_once`: no draft is shown, for pictures.
    pub fn quality(&mut self, ui: &Ui, scene: &S, choice: &LightChoice, at_once: bool) -> Now {
        let now = ui.input(|i| i.time);
        let moved_at = match &self.last {
            Some((last, lit, at)) if last == scene && lit == choice => *at,
            Some(_) => now,
            None => f64::NEG_INFINITY,
        };
        self.last = Some((scene.clone(), *choice, moved_at));
        let still_for = now - moved_at;
        let before = self.phase;
        self.phase = if at_once || still_for >= AT_REST.as_secs_f64() {
            Phase::AtRest
        } else if still_for >= STILL.as_secs_f64() {
            Phase::Still
        } else {
            Phase::Moving
        };
        let mode = choice.mode;
        let moving = light::at_cost(mode, self.auto[mode as usize].cost());
        let balanced = light::preset(mode, Preset::Balanced);
        let reference = light::preset(mode, Preset::Reference);
        if balanced == reference && self.phase == Phase::Still {
            self.phase = Phase::AtRest;
        }
        match self.phase {
            Phase::Moving => ui.request_repaint_after(STILL),
            Phase::Still => ui.request_repaint_after(AT_REST - STILL),
            Phase::AtRest => {}
        }
        let quality = match (choice.preset, self.phase) {
            (Some(preset), _) => light::preset(mode, preset),
            (None, Phase::Moving) => moving,
            (None, Phase::Still) => balanced,
            (None, Phase::AtRest) => reference,
        };
        let takes_long =
            light::row(mode).takes_long && choice.preset.is_none() && self.phase != Phase::Moving;
        Now {
            quality: choice.at(quality),
            in_parts: (takes_long && !at_once).then(|| choice.at(moving)),
            just_refined: self.phase > before,
            timed: choice.preset.is_none() && self.phase == Phase::Moving,
        }
    }
}
