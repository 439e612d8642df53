//! Resolves the mask and the two time points to compare: one resolver for the window and the command line.

use super::ChangeError;
use crate::case::{Case, OrderBasis};

/// One mask at two time points of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The mask's id.
    pub id: String,
    /// Indices of the earlier and the later time point in [`Case::time_points`].
    pub dates: [usize; 2],
}

/// Ids of the masks that both time points have, in the order of the earlier one.
pub fn ids_at(case: &Case, dates: [usize; 2]) -> Vec<&str> {
    let [Some(from), Some(to)] = dates.map(|d| case.time_points.get(d)) else { return Vec::new() };
    let has = |id: &&str| to.masks.iter().any(|m| m.mask.id() == *id);
    from.masks.iter().map(|m| m.mask.id()).filter(has).collect()
}

impl Choice {
    /// The choice named by mask id `of` and time labels `from` and `to`. Defaults: the first and the last time point,
    /// and the first mask that both have; [`Choice::assumed`] lists the defaults used. Where the order of the time
    /// points is unknown, both must be named, and the one named `from` counts as the earlier.
    ///
    /// # Errors
    /// [`ChangeError::OneDate`] for fewer than two time points, [`ChangeError::UnknownOrder`] where one isn't named
    /// and the order is unknown, [`ChangeError::NoCommonMask`] where they share no mask, [`ChangeError::Choice`] for a
    /// mask or time point that the case doesn't have, or a later date before an earlier one.
    pub fn resolve(
        case: &Case,
        of: Option<&str>,
        from: Option<&str>,
        to: Option<&str>,
    ) -> Result<Self, ChangeError> {
        let [first, last] = match (from, to) {
            (Some(_), Some(_)) => [0, Self::last(case)?],
            _ => Self::default_dates(case)?,
        };
        let at = |label: Option<&str>, default: usize| match label {
            None => Ok(default),
            Some(label) => case.time_at(label).ok_or_else(|| {
                let expected = format!("one of {}", case.time_labels().join(", "));
                choice_error(case, format!("no date {label}"), expected)
            }),
        };
        Self::at(case, of, [at(from, first)?, at(to, last)?])
    }

    /// As [`Choice::resolve`], for the indices of two time points.
    ///
    /// # Errors
    /// As [`Choice::resolve`].
    pub fn at(case: &Case, of: Option<&str>, dates: [usize; 2]) -> Result<Self, ChangeError> {
        let last = Self::last(case)?;
        let is_reversed = dates[0] > dates[1] && case.order != OrderBasis::Unknown;
        if dates[0] == dates[1] || is_reversed || dates.iter().any(|at| *at > last) {
            let label = |at: usize| case.time_points.get(at).map_or("no date", |t| t.label.as_str());
            let found = format!("{} to {}", label(dates[0]), label(dates[1]));
            return Err(choice_error(case, found, "an earlier and a later date".into()));
        }
        let ids = ids_at(case, dates);
        let id = match of {
            Some(id) => ids.iter().find(|candidate| **candidate == id).ok_or_else(|| {
                let expected = format!("a mask of both dates: {}", ids.join(", "));
                choice_error(case, format!("no mask {id} at both dates"), expected)
            })?,
            None => ids.first().ok_or_else(|| ChangeError::no_common_mask(case, dates))?,
        };
        Ok(Self { id: (*id).to_owned(), dates })
    }

    /// The defaults by which [`Choice::resolve`] chose among several candidates, one sentence each.
    pub fn assumed(
        &self,
        case: &Case,
        of: Option<&str>,
        from: Option<&str>,
        to: Option<&str>,
    ) -> Vec<String> {
        let mut out = Vec::new();
        let ids = ids_at(case, self.dates);
        if of.is_none() && ids.len() > 1 {
            out.push(format!("the mask is {}, the first of {}", self.id, ids.join(", ")));
        }
        let labels = case.time_labels();
        if (from.is_none() || to.is_none()) && labels.len() > 2 {
            let [from, to] = self.dates.map(|at| labels[at]);
            out.push(format!("the dates are {from} and {to} of {}", labels.join(", ")));
        }
        out
    }

    /// The first and the last time point.
    ///
    /// # Errors
    /// [`ChangeError::OneDate`], [`ChangeError::UnknownOrder`].
    pub fn default_dates(case: &Case) -> Result<[usize; 2], ChangeError> {
        let last = Self::last(case)?;
        if case.order == OrderBasis::Unknown {
            let dates = case.time_labels().join(", ");
            return Err(ChangeError::UnknownOrder { case: case.name.clone(), dates });
        }
        Ok([0, last])
    }

    fn last(case: &Case) -> Result<usize, ChangeError> {
        match case.time_points.len() {
            0 | 1 => Err(ChangeError::OneDate { case: case.name.clone(), dates: case.time_points.len() }),
            dates => Ok(dates - 1),
        }
    }
}

impl ChangeError {
    /// The masks of two time points have no id in common.
    pub fn no_common_mask(case: &Case, dates: [usize; 2]) -> Self {
        let [from, to] = dates.map(|at| {
            let masks = case.time_points.get(at).map(|time| time.masks.as_slice()).unwrap_or_default();
            let ids: Vec<&str> = masks.iter().map(|m| m.mask.id()).collect();
            if ids.is_empty() { "none".to_owned() } else { ids.join(", ") }
        });
        Self::NoCommonMask { case: case.name.clone(), from, to }
    }
}

fn choice_error(case: &Case, found: String, expected: String) -> ChangeError {
    ChangeError::Choice { case: case.name.clone(), found, expected }
}
