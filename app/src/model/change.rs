//! Which dates are compared and how that is drawn, as the user chose it.

use glioscope_core::{
    case::Case,
    change::{self, ChangeError, Choice, ids_at},
};
use glioscope_render::ChangeStyle;
use serde::{Deserialize, Serialize};

/// What is compared, and how it is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeSetting {
    /// The mask, by id; `None`: the first that both dates have.
    pub of: Option<String>,
    /// The two dates, as positions in the case; `None`: the first and the last.
    pub dates: Option<[usize; 2]>,
    /// Height map or arrows.
    pub style: ChangeStyle,
    /// Change that is drawn opaque; `None`: the 95th percentile of what changed.
    pub full_mm: Option<f64>,
    /// Width of the Gauss filter over the height map.
    pub smooth_mm: f64,
    /// Shorter arrows are left out.
    pub threshold_mm: f64,
    /// How far off the dates may lie from one another.
    pub registration_mm: f64,
    /// Whether slices show both outlines and what changed instead of the masks.
    pub on_slices: bool,
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
            on_slices: false,
        }
    }
}

impl ChangeSetting {
    /// What is compared in `case`. A mask or dates that it doesn't have give way to the default, as for a session
    /// that was saved with other files.
    ///
    /// # Errors
    /// [`ChangeError`]: nothing can be compared.
    pub fn chosen(&self, case: &Case) -> Result<Choice, ChangeError> {
        let dates = self.dates.filter(|dates| Choice::at(case, None, *dates).is_ok());
        let dates = dates.unwrap_or([0, case.time_points.len().saturating_sub(1)]);
        let of = self.of.as_deref().filter(|id| ids_at(case, dates).contains(id));
        Choice::at(case, of, dates)
    }

    /// The dates after one was chosen as the earlier or the later end; the other end moves on where it
    /// has to. `None` where the case has no such pair.
    pub fn with_date(&self, case: &Case, date: usize, as_earlier: bool) -> Option<[usize; 2]> {
        let [from, to] = self.chosen(case).ok()?.dates;
        let last = case.time_points.len().checked_sub(1)?;
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
    fn the_first_mask_at_first_and_last_date_is_compared_until_something_else_is_chosen() {
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
        assert_eq!(setting.chosen(&case).unwrap().dates, [0, 1], "dates that aren't there");
        assert_eq!(setting.with_date(&case, 1, false), Some([0, 1]));
        assert_eq!(setting.with_date(&case, 0, false), None, "nothing is earlier than the first");
        assert_eq!(setting.with_date(&case, 1, true), None, "nothing is later than the last");
    }
}
