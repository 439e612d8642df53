//! Random numbers by hashing: the same on every machine, and a run's own whatever ran before it.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::optics::random;

/// The numbers of a run.
#[derive(Clone, Debug)]
pub(super) struct Random(random::Random);

impl Random {
    /// The numbers of one run of one kind.
    pub fn of(seed: u64, kind: u64, run: u64) -> Self {
        let after = |state: u64, part: u64| random::Random::of_state(state).bits() ^ part;
        Self(random::Random::of_state(after(after(seed, kind), run)))
    }

    pub fn next(&mut self) -> u64 {
        self.0.bits()
    }

    /// Uniform, 0 to 1 (excluded).
    pub fn unit(&mut self) -> f64 {
        self.0.unit()
    }

    /// Uniform, `-most` to `most`.
    pub fn within(&mut self, most: f64) -> f64 {
        (2.0 * self.unit() - 1.0) * most
    }

    /// Below `count`, which is above 0.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Nearly normal, of mean 0 and standard deviation 1: three uniform numbers, added.
    pub fn noise(&mut self) -> f64 {
        let bits = self.next();
        let part = |shift: u32| (bits >> shift & 0x1f_ffff) as f64;
        2.0 * ((part(0) + part(21) + part(42)) / f64::from(0x1f_ffff_u32) - 1.5)
    }

    /// A unit vector, evenly distributed.
    pub fn direction(&mut self) -> DVec3 {
        let z = self.within(1.0);
        let angle = std::f64::consts::TAU * self.unit();
        let radius = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
    }

    /// A rigid move: turned by up to `most_degrees` about any axis through `centre_mm`, then shifted by up to `most_mm`.
    pub fn rigid(&mut self, centre_mm: DVec3, most_degrees: f64, most_mm: f64) -> DAffine3 {
        let axis = self.direction() * (most_degrees * self.unit()).to_radians();
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(axis));
        let shift_mm = self.direction() * (most_mm * self.unit());
        DAffine3 { matrix3: turn, translation: centre_mm - turn * centre_mm + shift_mm }
    }
}
