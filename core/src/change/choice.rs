//! Which mask is compared between which dates of a case: one resolver for window and command line.

use super::ChangeError;
use crate::case::Case;

/// One mask at two dates of a case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The mask's id.
    pub id: String,
    /// Positions of the earlier and the later date in [`Case::time_points`].
    pub dates: [usize; 2],
}

/// Ids of the masks that both dates have, in the order of the earlier one.
pub fn ids_at(case: &Case, dates: [usize; 2]) -> Vec<&str> {
    let [Some(from), Some(to)] = dates.map(|d| case.time_points.get(d)) else { return Vec::new() };
    let has = |id: &&str| to.masks.iter().any(|m| m.mask.id() == *id);
    from.masks.iter().map(|m| m.mask.id()).filter(has).collect()
}

impl Choice {
    /// What `of`, `from` and `to` name. By default the first and the last date, and the first mask that both
    /// have; [`Choice::assumed`] tells.
    ///
    /// # Errors
    /// [`ChangeError::OneDate`] where there is nothing to compare, [`ChangeError::Choice`] for what the case
    /// doesn't have.
    pub fn resolve(
        case: &Case,
        of: Option<&str>,
        from: Option<&str>,
        to: Option<&str>,
    ) -> Result<Self, ChangeError> {
        let last = Self::last(case)?;
        let at = |label: Option<&str>, default: usize| match label {
            None => Ok(default),
            Some(label) => case.time_at(label).ok_or_else(|| {
                let expected = format!("one of {}", case.time_labels().join(", "));
                wrong(case, format!("no date {label}"), expected)
            }),
        };
        Self::at(case, of, [at(from, 0)?, at(to, last)?])
    }

    /// As [`Choice::resolve`] for two positions of dates.
    ///
    /// # Errors
    /// As there.
    pub fn at(case: &Case, of: Option<&str>, dates: [usize; 2]) -> Result<Self, ChangeError> {
        let last = Self::last(case)?;
        if dates[0] >= dates[1] || dates[1] > last {
            let label = |at: usize| case.time_points.get(at).map_or("no date", |t| t.label.as_str());
            let found = format!("{} to {}", label(dates[0]), label(dates[1]));
            return Err(wrong(case, found, "an earlier and a later date".into()));
        }
        let ids = ids_at(case, dates);
        let id = match of {
            Some(id) => ids.iter().find(|have| **have == id).ok_or_else(|| {
                let expected = format!("a mask of both dates: {}", ids.join(", "));
                wrong(case, format!("no mask {id} at both dates"), expected)
            })?,
            None => ids.first().ok_or_else(|| ChangeError::NoCommonMask(case.name.clone()))?,
        };
        Ok(Self { id: (*id).to_owned(), dates })
    }

    /// What [`Choice::resolve`] chose among several where nothing was asked for, a sentence each.
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

    fn last(case: &Case) -> Result<usize, ChangeError> {
        match case.time_points.len() {
            0 | 1 => Err(ChangeError::OneDate { case: case.name.clone(), dates: case.time_points.len() }),
            dates => Ok(dates - 1),
        }
    }
}

fn wrong(case: &Case, found: String, expected: String) -> ChangeError {
    ChangeError::Choice { case: case.name.clone(), found, expected }
}
