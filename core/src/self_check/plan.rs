//! What is known of a run: how the surface moves, and lesions that come or go.

use glam::DVec3;

/// A known movement of the surface: outwards by `by_mm` (negative: inwards), everywhere or on one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub by_mm: f64,
    pub side: Option<Side>,
}

/// The side that moves: it increases smoothly along `towards` from 0 to all within `half_mm` on either side of the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Side {
    pub towards: DVec3,
    pub middle_mm: DVec3,
    pub half_mm: f64,
}

impl Known {
    pub const NOTHING: Self = Self { by_mm: 0.0, side: None };

    pub fn is_none(&self) -> bool {
        self.by_mm == 0.0
    }

    /// Movement of the surface at a place of the earlier date's space, mm.
    pub fn at(&self, place_mm: DVec3) -> f64 {
        let share = self.side.map_or(1.0, |side| {
            let along = (place_mm - side.middle_mm).dot(side.towards) / side.half_mm;
            let t = (0.5 + 0.5 * along).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        });
        self.by_mm * share
    }
}

/// A lesion that is a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub centre_mm: DVec3,
    pub volume_ml: f64,
    radius_mm: f64,
}

impl Ball {
    pub fn new(centre_mm: DVec3, volume_ml: f64) -> Self {
        Self { centre_mm, volume_ml, radius_mm: (volume_ml * 1000.0 * 0.75 / std::f64::consts::PI).cbrt() }
    }

    pub fn radius_mm(&self) -> f64 {
        self.radius_mm
    }

    /// Signed distance to its surface, negative inside.
    pub fn distance_mm(&self, place_mm: DVec3) -> f64 {
        place_mm.distance(self.centre_mm) - self.radius_mm
    }
}
