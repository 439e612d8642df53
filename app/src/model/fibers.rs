//! How fibre tracts look.

use std::ops::RangeInclusive;

use glioscope_core::{TractScalar, Tracts};
use glioscope_render::{ColorMap, Rgb, TubeLook, TubeSet};
use serde::{Deserialize, Serialize};

/// Half the width of tubes, millimetres.
pub const FIBER_RADIUS_MM: RangeInclusive<f64> = 0.1..=3.0;
/// Largest distance between a smooth curve and what is drawn of it, as a share of the radius.
pub const FIBER_DEVIATION: RangeInclusive<f64> = 0.005..=0.5;
/// The share to begin with: docs/studies.md has the points that each costs.
pub const DEFAULT_DEVIATION: f64 = 0.05;
/// The most characters of a scalar's name.
pub const MOST_SCALAR_NAME: usize = 1000;

/// What the fibres of a file are coloured by.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FiberColor {
    /// Nothing: a file has one colour.
    #[default]
    Plain,
    /// Their direction, as is usual in tractography.
    Direction,
    /// A scalar of the file, or of a file beside it, by name.
    Scalar(String),
}

/// How the fibres of a file look.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FiberLook {
    /// What they are coloured by.
    pub color: FiberColor,
    /// Colours of a scalar.
    pub map: ColorMap,
    /// The values at its ends, in the scalar's unit; `None`: its least and its greatest.
    pub range: Option<[f64; 2]>,
    /// Half the width of the tubes, [`FIBER_RADIUS_MM`].
    pub radius_mm: f64,
    /// Smooth curves, and how far what is drawn may be from them: [`FIBER_DEVIATION`]; `None`: straight segments.
    pub smooth: Option<f64>,
}

impl Default for FiberLook {
    fn default() -> Self {
        Self {
            color: FiberColor::Plain,
            map: ColorMap::Viridis,
            range: None,
            radius_mm: TubeSet::RADIUS_MM,
            smooth: None,
        }
    }
}

impl FiberLook {
    /// The scalar of `tracts` that colours them; `None` where they have none of that name, or it has no value.
    pub fn scalar<'a>(&self, tracts: &'a Tracts) -> Option<&'a TractScalar> {
        let FiberColor::Scalar(name) = &self.color else { return None };
        tracts.scalar(name).filter(|scalar| scalar.range().is_some())
    }

    /// The values at the ends of the colours of a scalar.
    pub fn range_of(&self, scalar: &TractScalar) -> [f64; 2] {
        self.range.unwrap_or_else(|| scalar.range().unwrap_or_default().map(f64::from))
    }

    /// How `tracts` look whose own colour is `color`.
    pub fn of_tubes(&self, tracts: &Tracts, color: Rgb) -> TubeLook {
        let range = self.scalar(tracts).map_or([0.0, 1.0], |scalar| self.range_of(scalar));
        let range = range.map(|value| value as f32);
        TubeLook { radius_mm: self.radius_mm, map: self.map, range, ..TubeLook::of(color) }
    }

    /// How far what is drawn may be from smooth curves; `None` for straight segments. The same within a factor of two of
    /// the radius, so that dragging it seldom prepares fibres again.
    pub fn smooth_mm(&self) -> Option<f64> {
        let step_mm = 2.0_f64.powf(self.radius_mm.log2().floor());
        self.smooth.map(|share| share * step_mm)
    }

    /// With another colouring; a range belongs to its scalar.
    #[must_use]
    pub fn colored_by(&self, color: FiberColor) -> Self {
        let range = self.range.filter(|_| color == self.color);
        Self { color, range, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::{ScalarPer, Sides};

    #[test]
    fn smooth_curves_deviate_by_at_most_the_share_of_the_radius() {
        for radius_mm in [0.1, 0.25, 0.3, 0.49, 0.5, 0.99, 1.0, 3.0] {
            let look = FiberLook { radius_mm, smooth: Some(0.05), ..FiberLook::default() };
            let share = look.smooth_mm().unwrap() / radius_mm;
            assert!(share <= 0.05 && share > 0.025, "{radius_mm}: {share}");
        }
        assert_eq!(FiberLook::default().smooth_mm(), None);
    }

    #[test]
    fn a_range_is_the_scalar_s_own_unless_it_is_set() {
        let values = vec![0.25, 0.75];
        let tracts = Tracts::new(vec![[0.0; 3], [1.0; 3]], vec![0, 2], Sides::Known).unwrap();
        let tracts = tracts
            .with_scalars(vec![
                TractScalar::new("FA".into(), ScalarPer::Point, values),
                TractScalar::new("none".into(), ScalarPer::Fiber, vec![f32::NAN]),
            ])
            .unwrap();
        let own = FiberLook::default().colored_by(FiberColor::Scalar("FA".into()));
        assert_eq!(own.of_tubes(&tracts, [1, 2, 3]).range, [0.25, 0.75]);
        let set = FiberLook { range: Some([0.0, 2.0]), ..own.clone() };
        assert_eq!(set.of_tubes(&tracts, [1, 2, 3]).range, [0.0, 2.0]);
        assert_eq!(set.colored_by(FiberColor::Direction).range, None);
        assert_eq!(set.colored_by(own.color).range, Some([0.0, 2.0]));
        for name in ["none", "MD"] {
            let look = FiberLook { color: FiberColor::Scalar(name.into()), ..FiberLook::default() };
            assert_eq!(look.scalar(&tracts), None, "{name}");
        }
    }
}
