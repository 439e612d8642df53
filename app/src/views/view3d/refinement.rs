//! Progressive refinement, the same for every 3D view: fast frames during interaction, finer ones at rest.

use std::time::Duration;

use egui::Ui;
use glioscope_render::{
    LightingMode, Preset, Quality,
    light::{self, Auto},
};
use strum::VariantArray;

use crate::model::LightChoice;

/// Time without change before a frame is refined.
const STILL_AFTER: Duration = Duration::from_millis(180);
/// Time without change before the reference is rendered, which may take long.
const AT_REST_AFTER: Duration = Duration::from_millis(450);

/// Longest time that the window is blocked by a part of a finer frame, milliseconds.
pub const PART_MS: f64 = 40.0;

/// Stage of the refinement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Moving,
    Still,
    AtRest,
}

/// Refinement state of a 3D view.
pub struct Refinement<S> {
    /// The scene and lighting last shown, and when they last changed, seconds of egui's clock.
    last: Option<(S, LightChoice, f64)>,
    phase: Phase,
    auto: [Auto; LightingMode::VARIANTS.len()],
}

impl<S> Default for Refinement<S> {
    fn default() -> Self {
        let auto = std::array::from_fn(|mode| Auto::of(LightingMode::VARIANTS[mode]));
        Self { last: None, phase: Phase::Moving, auto }
    }
}

/// How to render the current frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefinementStep {
    /// The quality.
    pub quality: Quality,
    /// Whether the quality has just been raised.
    pub just_refined: bool,
    /// If the frame may take long, so that it is rendered in parts without blocking the window: the quality of the
    /// draft that is shown first.
    pub in_parts: Option<Quality>,
    /// Whether the frame is to be timed for [`Refinement::adapt`].
    pub timed: bool,
}

impl<S: Clone + PartialEq> Refinement<S> {
    /// Whether the last frame was of the final quality.
    pub fn refined(&self) -> bool {
        self.phase == Phase::AtRest
    }

    /// Adapts the quality during interaction to the time of a timed frame.
    pub fn adapt(&mut self, choice: &LightChoice, milliseconds: f64) {
        self.auto[choice.mode as usize].adapt(milliseconds);
    }

    /// The next step for `scene`. `at_once`: final quality without a draft, for picture files.
    pub fn step(&mut self, ui: &Ui, scene: &S, choice: &LightChoice, at_once: bool) -> RefinementStep {
        let now = ui.input(|i| i.time);
        let changed_at = match &self.last {
            Some((last, lighting, changed_at)) if last == scene && lighting == choice => *changed_at,
            Some(_) => now,
            None => f64::NEG_INFINITY,
        };
        self.last = Some((scene.clone(), *choice, changed_at));
        let unchanged_s = now - changed_at;
        let previous_phase = self.phase;
        self.phase = if at_once || unchanged_s >= AT_REST_AFTER.as_secs_f64() {
            Phase::AtRest
        } else if unchanged_s >= STILL_AFTER.as_secs_f64() {
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
            Phase::Moving => ui.request_repaint_after(STILL_AFTER),
            Phase::Still => ui.request_repaint_after(AT_REST_AFTER - STILL_AFTER),
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
        RefinementStep {
            quality: choice.at(quality),
            in_parts: (takes_long && !at_once).then(|| choice.at(moving)),
            just_refined: self.phase > previous_phase,
            timed: choice.preset.is_none() && self.phase == Phase::Moving,
        }
    }
}
