//! The order of time points: what their labels state about time.

use jiff::civil::Date;

use super::{CaseError, CaseSpec};
use crate::dates::leading_date;

/// How the order of a case's time points is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrderBasis {
    /// One time point, or none.
    Single,
    /// The user, the manifest or the `sessions.tsv` of BIDS states the order.
    Stated,
    /// Every label begins with a date.
    Dates,
    /// Labels are stages of a treatment (pre, post; baseline, follow-up) or lengths of time such as `week04`.
    Words,
    /// Labels are one word with different numbers, in natural order: `ses-2` before `ses-10`.
    Numbers,
    /// The labels don't state an order; time points are as first listed.
    Unknown,
}

/// Words for the stage of a treatment, in order. Words of one line mean the same stage.
const STAGES: [&[&str]; 3] = [
    &["baseline", "bl", "pre", "preop", "pretreatment", "before", "initial", "screening"],
    &["intraop", "intra", "during", "midtreatment"],
    &["post", "postop", "posttreatment", "after", "followup", "fu", "late", "final"],
];

/// Units of a length of time since the baseline, in days.
const UNITS: [(&[&str], f64); 4] = [
    (&["d", "day", "days"], 1.0),
    (&["w", "wk", "week", "weeks"], 7.0),
    (&["m", "mo", "month", "months"], 365.25 / 12.0),
    (&["y", "yr", "year", "years"], 365.25),
];

/// A label's lower-case word and number, in either order: `week` and 4 of `Week-04` and `4 weeks`, `post` and none of
/// `post`.
fn word_and_number(label: &str) -> Option<(String, Option<u64>)> {
    let plain: String = label.chars().filter(|c| !['-', '_', ' ', '.'].contains(c)).collect();
    let plain = plain.to_lowercase();
    let is_digit = |c: char| c.is_ascii_digit();
    let digits = plain.trim_matches(|c| !is_digit(c));
    let word = plain.strip_suffix(digits).or_else(|| plain.strip_prefix(digits))?;
    let number = if digits.is_empty() { None } else { Some(digits.parse().ok()?) };
    (!word.contains(is_digit)).then(|| (word.to_owned(), number))
}

/// Stage and position within it of a label among words: `baseline` before `week4` before `month12`; `followup2` after
/// `followup1`.
fn stage(label: &str) -> Option<(usize, f64)> {
    let (word, number) = word_and_number(label)?;
    let staged = STAGES.iter().position(|words| words.contains(&word.as_str()));
    if let Some(stage) = staged {
        return Some((2 * stage, number.map_or(0.0, |n| n as f64)));
    }
    let days = UNITS.iter().find(|(words, _)| words.contains(&word.as_str()))?.1;
    Some((1, number? as f64 * days))
}

/// Positions of `keys` in ascending order; `None` if two are equal or can't be compared.
fn ascending<T: PartialOrd>(keys: &[T]) -> Option<Vec<usize>> {
    let mut order: Vec<usize> = (0..keys.len()).collect();
    order.sort_by(|a, b| keys[*a].partial_cmp(&keys[*b]).unwrap_or(std::cmp::Ordering::Equal));
    order.windows(2).all(|pair| keys[pair[0]] < keys[pair[1]]).then_some(order)
}

/// Puts the labels of a case into time order: as `stated`, else as they themselves state.
///
/// # Errors
/// [`CaseError::Wrong`] where `stated` isn't empty and doesn't name each label once.
pub(super) fn arrange(
    spec: &CaseSpec,
    labels: &[String],
    stated: &[String],
) -> Result<(Vec<String>, OrderBasis), CaseError> {
    if stated.is_empty() {
        let (order, basis) = chronological(&labels.iter().map(String::as_str).collect::<Vec<_>>());
        return Ok((order.into_iter().map(|at| labels[at].clone()).collect(), basis));
    }
    let mut sorted = [labels.to_vec(), stated.to_vec()];
    sorted.iter_mut().for_each(|list| list.sort());
    if sorted[0] != sorted[1] {
        let found = format!("the order {}", stated.join(", "));
        return Err(CaseError::wrong(&spec.name, found, format!("each date once: {}", labels.join(", "))));
    }
    Ok((stated.to_vec(), OrderBasis::Stated))
}

/// Whether labels state their order in time.
pub(super) fn is_stated_by(labels: &[&str]) -> bool {
    chronological(labels).1 != OrderBasis::Unknown
}

/// The order that labels state, as positions, and what it is based on. Labels that don't state an order keep theirs.
fn chronological(labels: &[&str]) -> (Vec<usize>, OrderBasis) {
    let unchanged = || (0..labels.len()).collect();
    if labels.len() < 2 {
        return (unchanged(), OrderBasis::Single);
    }
    let dates: Option<Vec<Date>> = labels.iter().map(|label| leading_date(label)).collect();
    if let Some(order) = dates.and_then(|dates| ascending(&dates)) {
        return (order, OrderBasis::Dates);
    }
    let stages: Option<Vec<(usize, f64)>> = labels.iter().map(|label| stage(label)).collect();
    if let Some(order) = stages.and_then(|stages| ascending(&stages)) {
        return (order, OrderBasis::Words);
    }
    let numbered: Option<Vec<(String, u64)>> = labels
        .iter()
        .map(|label| word_and_number(label).and_then(|(word, number)| Some((word, number?))))
        .collect();
    let numbered = numbered.filter(|all| all.iter().all(|(word, _)| *word == all[0].0));
    if let Some(order) = numbered.and_then(|all| ascending(&all)) {
        return (order, OrderBasis::Numbers);
    }
    (unchanged(), OrderBasis::Unknown)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(labels: &[&'static str]) -> (Vec<&'static str>, OrderBasis) {
        let (order, basis) = chronological(labels);
        (order.into_iter().map(|i| labels[i]).collect(), basis)
    }

    #[test]
    fn labels_are_put_in_time_order() {
        let cases: [(&[&str], &[&str], OrderBasis); 13] = [
            (&["2024-05-01", "2024-01-01"], &["2024-01-01", "2024-05-01"], OrderBasis::Dates),
            (&["2024-05-01 late", "2024-01-01"], &["2024-01-01", "2024-05-01 late"], OrderBasis::Dates),
            (&["post", "pre"], &["pre", "post"], OrderBasis::Words),
            (&["follow-up", "Baseline"], &["Baseline", "follow-up"], OrderBasis::Words),
            (&["month12", "week4", "baseline"], &["baseline", "week4", "month12"], OrderBasis::Words),
            (&["week012", "week002"], &["week002", "week012"], OrderBasis::Words),
            (&["6months", "2weeks"], &["2weeks", "6months"], OrderBasis::Words),
            (&["FU10", "FU2", "preop"], &["preop", "FU2", "FU10"], OrderBasis::Words),
            (&["10", "2"], &["2", "10"], OrderBasis::Numbers),
            (&["ses-10", "ses-2"], &["ses-2", "ses-10"], OrderBasis::Numbers),
            (&["Timepoint_2", "Timepoint_1"], &["Timepoint_1", "Timepoint_2"], OrderBasis::Numbers),
            (&["B", "A"], &["B", "A"], OrderBasis::Unknown),
            (&["only"], &["only"], OrderBasis::Single),
        ];
        for (given, expected, basis) in cases {
            assert_eq!(ordered(given), (expected.to_vec(), basis), "{given:?}");
        }
    }

    #[test]
    fn contradicting_or_equal_labels_have_no_order() {
        for labels in [
            ["2024-01-01", "post"],
            ["2024-01-01 a", "2024-01-01 b"],
            ["ses-1", "tp-2"],
            ["pre", "baseline"],
            ["week4", "post"],
            ["week4", "day28"],
            ["ses-1", "ses-01"],
        ] {
            let (order, basis) = chronological(&labels);
            let is_known = labels == ["week4", "post"];
            assert_eq!((order, basis == OrderBasis::Unknown), (vec![0, 1], !is_known), "{labels:?}");
        }
    }
}
