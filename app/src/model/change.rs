//! Settings of the comparison of two time points, and of how the change is drawn.

use std::ops::RangeInclusive;

use glioscope_core::{
    case::{Case, OrderBasis},
    change::{self, ChangeError, ChangeOptions, Choice, DEFAULT_SMALLEST_ML, ids_at},
};
use glioscope_render::ChangeStyle;
use serde::{Deserialize, Serialize};

/// Ends of the scale of change that can be fixed, millimetres.
pub const CHANGE_SCALE_MM: RangeInclusive<f64> = 0.1..=1000.0;
/// Registration error that can be stated: standard deviation along any direction.
pub const REGISTRATION_MM: RangeInclusive<f64> = 0.0..=20.0;

/// The mask and time points compared, and how their change is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeSetting {
    /// The mask, by id; `None`: the first that both time points have.
    pub of: Option<String>,
    /// Indices of the two time points in the case; `None`: the first and the last.
    pub dates: Option<[usize; 2]>,
    /// Height map or arrows.
    pub style: ChangeStyle,
    /// The end of the colour scale, where two comparisons are to share it; `None`: the larger 95th percentile of growth
    /// and recession, at least 1 mm.
    pub full_mm: Option<f64>,
    /// Standard deviation of the height map's Gaussian filter.
    pub smooth_mm: f64,
    /// Minimum length of arrows; shorter ones are omitted.
    pub threshold_mm: f64,
    /// Registration error between the two time points: standard deviation along any direction.
    pub registration_mm: f64,
    /// Smaller components make neither appeared, vanished, split nor merged, millilitres.
    #[serde(default = "default_smallest_ml")]
    pub smallest_ml: f64,
    /// Whether the change view draws the outline of the earlier date.
    #[serde(default)]
    pub outlines_earlier: bool,
    /// Whether slices show the outlines of both time points and the change instead of the masks.
    pub on_slices: bool,
    /// Whether the change is checked on this case, by known changes put into it.
    #[serde(default)]
    pub self_check: bool,
}

impl Default for ChangeSetting {
    fn default() -> Self {
        Self {
            of: None,
            dates: None,
            style: ChangeStyle::Height,
            full_mm: None,
            smooth_mm: 1.0,
            threshold_mm: 1.0,
            registration_mm: change::DEFAULT_REGISTRATION_MM,
            smallest_ml: DEFAULT_SMALLEST_ML,
            outlines_earlier: false,
            on_slices: false,
            self_check: false,
        }
    }
}

/// Of sessions that don't state it.
fn default_smallest_ml() -> f64 {
    DEFAULT_SMALLEST_ML
}

impl ChangeSetting {
    /// What the change is computed with.
    pub fn options(&self) -> ChangeOptions {
        ChangeOptions {
            registration_mm: self.registration_mm,
            smallest_ml: self.smallest_ml,
            ..ChangeOptions::default()
        }
    }

    /// Without the check on this case where `older` has it of another comparison.
    #[must_use]
    pub fn checked_as(self, older: &Self) -> Self {
        let compares =
            |s: &Self| (s.of.clone(), s.dates, s.registration_mm.to_bits(), s.smallest_ml.to_bits());
        let self_check = self.self_check && (compares(&self) == compares(older) || !older.self_check);
        Self { self_check, ..self }
    }

    /// The mask and time points compared in `case`. Where the case lacks the chosen ones (as with a session saved with
    /// other files), the defaults apply.
    ///
    /// # Errors
    /// [`ChangeError`] where nothing can be compared.
    pub fn chosen(&self, case: &Case) -> Result<Choice, ChangeError> {
        let dates = self.dates.filter(|dates| Choice::at(case, None, *dates).is_ok());
        let dates = dates.map_or_else(|| Choice::default_dates(case), Ok)?;
        let of = self.of.as_deref().filter(|id| ids_at(case, dates).contains(id));
        Choice::at(case, of, dates)
    }

    /// The pair of time points after `date` (an index) is chosen as the earlier or the later one. The other one moves
    /// where the order requires it; `None` where the case has no such pair. Where the order is unknown, any two are a
    /// pair.
    pub fn with_date(&self, case: &Case, date: usize, as_earlier: bool) -> Option<[usize; 2]> {
        let last = case.time_points.len().checked_sub(1)?;
        if case.order == OrderBasis::Unknown {
            let [from, to] = self.chosen(case).map_or([0, last], |choice| choice.dates);
            let other = if as_earlier { to } else { from };
            let other = if other == date { (date + 1) % (last + 1) } else { other };
            return Some(if as_earlier { [date, other] } else { [other, date] }).filter(|_| last > 0);
        }
        let [from, to] = self.chosen(case).ok()?.dates;
        let new = if as_earlier {
            [date, if to > date { to } else { date + 1 }]
        } else {
            [if from < date { from } else { date.checked_sub(1)? }, date]
        };
        (new[1] <= last).then_some(new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::{Progress, case::LoadOptions, sample};

    #[test]
    fn defaults_are_the_first_mask_at_the_first_and_last_time_point() {
        let spec = sample::sample_spec();
        let case = glioscope_core::case::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
        let mut setting = ChangeSetting::default();
        let chosen = setting.chosen(&case).unwrap();
        assert_eq!((chosen.id.as_str(), chosen.dates), ("T1", [0, 1]));
        setting.of = Some("PET".into());
        assert_eq!(setting.chosen(&case).unwrap().id, "PET");
        setting.of = Some("nothing of the kind".into());
        assert_eq!(setting.chosen(&case).unwrap().id, "T1");
        setting.dates = Some([1, 7]);
        assert_eq!(setting.chosen(&case).unwrap().dates, [0, 1], "time points that the case doesn't have");
        assert_eq!(setting.with_date(&case, 1, false), Some([0, 1]));
        assert_eq!(setting.with_date(&case, 0, false), None, "nothing is earlier than the first");
        assert_eq!(setting.with_date(&case, 1, true), None, "nothing is later than the last");
    }
}
