//! Fluent while something moves, as good as it gets when still: the same for every 3D view.

use std::time::Duration;

use egui::Ui;
use glioscope_render::{LightingMode, Preset, Quality, light};
use strum::VariantArray;

use crate::model::LightChoice;

/// How long a scene must be still before its picture is refined.
const STILL: Duration = Duration::from_millis(180);
/// How long before it is drawn as the reference: a picture that may take long.
const AT_REST: Duration = Duration::from_millis(450);

/// How long a picture may take while something moves.
pub const BUDGET_MS: f64 = 100.0;

/// How long the window may wait for a part of a finer picture.
pub const PART_MS: f64 = 40.0;

/// Finds the quality that takes the budget's time, from the times of the pictures drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Auto {
    /// Of `light::at_cost`.
    cost: f64,
}

impl Auto {
    /// Before the first picture.
    pub fn of(mode: LightingMode) -> Self {
        Self { cost: light::row(mode).first_cost }
    }

    /// Between these shares of the budget nothing is changed: a picture that changes its sharpness with
    /// every frame flickers.
    const FINE: std::ops::RangeInclusive<f64> = 0.7..=0.9;
    /// What is aimed at otherwise: single pictures take half as long again when something else runs.
    const AIM: f64 = 0.78;

    /// The cost to draw at while something moves.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// Adapts to the time that a picture took. Part of it doesn't depend on the quality, so a step that would be
    /// right for all of it is too small when it goes down and safe when it goes up: going down is
    /// done with more force.
    pub fn adapt(&mut self, milliseconds: f64) {
        let share = milliseconds / BUDGET_MS;
        if !share.is_finite() || share <= 0.0 || Self::FINE.contains(&share) {
            return;
        }
        let ratio = Self::AIM / share;
        let step = if ratio < 1.0 { ratio.powf(1.15).max(0.1) } else { ratio.powf(0.8).min(2.0) };
        // More than balanced gains nothing that one sees in a moving picture.
        self.cost = (self.cost * step).clamp(1e-3, 1.0);
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    /// Machines of very different speed, with and without a part that quality doesn't change: within a
    /// few pictures all are near the budget, or as good as it gets.
    #[test]
    fn the_budget_is_found_and_held() {
        for (fixed_ms, balanced_ms, growth) in
            [(2.0, 900.0, 1.0), (15.0, 400.0, 0.8), (30.0, 3000.0, 1.2), (1.0, 20.0, 1.0), (60.0, 300.0, 1.0)]
        {
            let takes_ms = |auto: &Auto| fixed_ms + (balanced_ms - fixed_ms) * auto.cost().powf(growth);
            let mut auto = Auto::of(LightingMode::Cones);
            let times: Vec<f64> = (0..40)
                .map(|_| {
                    let ms = takes_ms(&auto);
                    auto.adapt(ms);
                    ms
                })
                .collect();
            for (n, ms) in times.iter().enumerate().skip(8) {
                let enough = auto.cost() == 1.0 && *ms <= 1.2 * BUDGET_MS;
                assert!(
                    enough || (0.7..=1.2).contains(&(ms / BUDGET_MS)),
                    "{balanced_ms}: picture {n}: {ms} ms"
                );
            }
            assert!(times[39] == times[38], "it comes to rest");
        }
    }

    #[test]
    fn times_that_are_none_change_nothing() {
        let mut auto = Auto::of(LightingMode::Cones);
        for ms in [f64::NAN, f64::INFINITY, 0.0, -3.0] {
            auto.adapt(ms);
            assert_eq!(auto, Auto::of(LightingMode::Cones));
        }
        // A picture that never ends leaves a cost to draw with.
        for _ in 0..50 {
            auto.adapt(1e9);
        }
        assert!(auto.cost() >= 1e-3);
    }
}
