//! Everyday objects for comparing volumes.

use std::f64::consts::PI;

/// An object that is nearly a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    /// The key of its words.
    pub key: &'static str,
    /// Its diameter in millimetres.
    pub diameter_mm: f64,
}

/// From small to large. Balls by their rules: table tennis 40 mm (ITTF 2.3.2), golf 42.67 mm (R&A, appendix), tennis
/// 65.4 to 68.6 mm (ITF). Fruit and seeds are of a common size that we chose, each named with its diameter.
pub const OBJECTS: &[Object] = &[
    Object { key: "object-pinhead", diameter_mm: 2.0 },
    Object { key: "object-peppercorn", diameter_mm: 5.0 },
    Object { key: "object-pea", diameter_mm: 8.0 },
    Object { key: "object-blueberry", diameter_mm: 12.0 },
    Object { key: "object-hazelnut", diameter_mm: 16.0 },
    Object { key: "object-cherry", diameter_mm: 22.0 },
    Object { key: "object-cherry-tomato", diameter_mm: 28.0 },
    Object { key: "object-walnut", diameter_mm: 34.0 },
    Object { key: "object-table-tennis-ball", diameter_mm: 40.0 },
    Object { key: "object-golf-ball", diameter_mm: 42.67 },
    Object { key: "object-apricot", diameter_mm: 47.0 },
    Object { key: "object-mandarin", diameter_mm: 57.0 },
    Object { key: "object-tennis-ball", diameter_mm: 67.0 },
    Object { key: "object-apple", diameter_mm: 78.0 },
    Object { key: "object-grapefruit", diameter_mm: 100.0 },
];

/// Beyond this ratio to the largest object a volume isn't compared: "as large as" would be wrong.
const MOST_RATIO: f64 = 1.5;

/// The diameter of a ball of this volume, millimetres.
pub fn ball_mm(volume_ml: f64) -> f64 {
    (6000.0 * volume_ml / PI).cbrt()
}

impl Object {
    /// The volume of a ball of its diameter in millilitres.
    pub fn volume_ml(&self) -> f64 {
        PI / 6.0 * self.diameter_mm.powi(3) / 1000.0
    }
}

/// The object whose volume is nearest in ratio; `None` for volumes that aren't positive, or larger than all objects.
pub fn nearest(volume_ml: f64) -> Option<&'static Object> {
    if !(volume_ml.is_finite() && volume_ml > 0.0) {
        return None;
    }
    let is_too_large = OBJECTS.last().is_some_and(|last| volume_ml > last.volume_ml() * MOST_RATIO);
    let ratio = |object: &&Object| (object.volume_ml() / volume_ml).ln().abs();
    let best = || OBJECTS.iter().min_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    if is_too_large { None } else { best() }
}

/// How a volume changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// By more than [`SAME_SHARE`] of what it was before.
    Smaller,
    /// By at most that.
    Same,
    /// By more than that.
    Larger,
}

/// Changes of at most this share of the earlier volume are called about the same.
pub const SAME_SHARE: f64 = 0.1;

impl Change {
    /// From one volume to a later one, in any unit. `None` where either isn't known or not positive at first.
    pub fn between(before: f64, after: f64) -> Option<Self> {
        let share = (after - before) / before;
        if !share.is_finite() || before <= 0.0 {
            return None;
        }
        Some(match share {
            s if s > SAME_SHARE => Self::Larger,
            s if s < -SAME_SHARE => Self::Smaller,
            _ => Self::Same,
        })
    }

    /// The key of its words.
    pub fn key(self) -> &'static str {
        match self {
            Self::Smaller => "change-smaller",
            Self::Same => "change-same",
            Self::Larger => "change-larger",
        }
    }
}
