//! The automatic quality: the cost that keeps a time budget, adapted to the times of the frames drawn.

use crate::scene::LightingMode;

/// Time budget of a frame while something moves, milliseconds.
pub const BUDGET_MS: f64 = 100.0;

/// Adapts the cost to the time budget, from the times of the frames drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Auto {
    /// As for [`super::at_cost`].
    cost: f64,
}

impl Auto {
    /// The state before the first frame.
    pub fn of(mode: LightingMode) -> Self {
        Self { cost: super::row(mode).first_cost }
    }

    /// Shares of the budget at which the cost isn't changed: changing the sharpness with every frame
    /// would flicker.
    const TOLERATED: std::ops::RangeInclusive<f64> = 0.7..=0.9;
    /// Share of the budget aimed at otherwise: single frames take half as long again when something else
    /// runs.
    const TARGET: f64 = 0.78;

    /// The cost at which to draw while something moves.
    pub fn cost(&self) -> f64 {
        self.cost
    }

    /// Adapts to the time of a frame; ignores times that are not finite and above 0. Part of the time doesn't
    /// depend on the quality, so a proportional step is too small downwards and safe upwards: downward steps are
    /// larger.
    pub fn adapt(&mut self, milliseconds: f64) {
        let share = milliseconds / BUDGET_MS;
        if !share.is_finite() || share <= 0.0 || Self::TOLERATED.contains(&share) {
            return;
        }
        let ratio = Self::TARGET / share;
        let step = if ratio < 1.0 { ratio.powf(1.15).max(0.1) } else { ratio.powf(0.8).min(2.0) };
        // A cost above balanced gives no visible gain in moving frames.
        self.cost = (self.cost * step).clamp(1e-3, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Machines of very different speed, with and without a time that doesn't depend on the quality: within a
    /// few frames all are near the budget, or at the maximum cost.
    #[test]
    fn frame_times_converge_to_the_budget() {
        for (fixed_ms, balanced_ms, growth) in
            [(2.0, 900.0, 1.0), (15.0, 400.0, 0.8), (30.0, 3000.0, 1.2), (1.0, 20.0, 1.0), (60.0, 300.0, 1.0)]
        {
            let frame_ms = |auto: &Auto| fixed_ms + (balanced_ms - fixed_ms) * auto.cost().powf(growth);
            let mut auto = Auto::of(LightingMode::Cones);
            let times: Vec<f64> = (0..40)
                .map(|_| {
                    let ms = frame_ms(&auto);
                    auto.adapt(ms);
                    ms
                })
                .collect();
            for (n, ms) in times.iter().enumerate().skip(8) {
                let enough = auto.cost() == 1.0 && *ms <= 1.2 * BUDGET_MS;
                assert!(
                    enough || (0.7..=1.2).contains(&(ms / BUDGET_MS)),
                    "{balanced_ms}: frame {n}: {ms} ms"
                );
            }
            assert!(times[39] == times[38], "the cost settles");
        }
    }

    #[test]
    fn invalid_times_change_nothing() {
        let mut auto = Auto::of(LightingMode::Cones);
        for ms in [f64::NAN, f64::INFINITY, 0.0, -3.0] {
            auto.adapt(ms);
            assert_eq!(auto, Auto::of(LightingMode::Cones));
        }
        // Frames that never end still leave a usable cost.
        for _ in 0..50 {
            auto.adapt(1e9);
        }
        assert!(auto.cost() >= 1e-3);
    }
}
