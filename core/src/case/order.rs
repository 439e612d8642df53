//! The order of time points: what their labels state about time.

use jiff::civil::Date;

use super::{CaseError, CaseSpec, LoadOptions};
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

/// Digits from which on a bare number may be a date in an unknown notation: `05012024`.
const DATE_DIGITS: usize = 6;

/// What a label says: a word and numbers, the one before or after the others.
#[derive(Debug)]
struct Words {
    /// Lower-case letters; may be empty.
    word: String,
    /// `[4]` of `week4`, `[13, 1]` of `week-013-1`, `[1.5]` of `1.5 months`, none of `post`.
    numbers: Vec<f64>,
    /// Whether a minus sign or hyphen stands between word and number.
    has_hyphen: bool,
    has_decimals: bool,
}

/// Reads a label. `None` for those that may mean something else: letters on both sides of the numbers, a sign, several
/// numbers without a word (a date in some notation), more than one decimal point.
fn words(label: &str) -> Option<Words> {
    let is_digit = |c: char| c.is_ascii_digit();
    let Some(first) = label.find(is_digit) else {
        let word: String = label.chars().filter(|c| !['-', '_', ' ', '.'].contains(c)).collect();
        let word = word.to_lowercase();
        return Some(Words { word, numbers: Vec::new(), has_hyphen: false, has_decimals: false });
    };
    let end = label.rfind(is_digit)? + 1;
    let (before, numbers, after) = (label.get(..first)?, label.get(first..end)?, label.get(end..)?);
    let letters = |text: &str| -> String {
        text.chars().filter(|c| !['-', '_', ' '].contains(c)).collect::<String>().to_lowercase()
    };
    let word = match (letters(before), letters(after)) {
        (word, rest) if rest.is_empty() => word,
        (rest, word) if rest.is_empty() => word,
        _ => return None,
    };
    let is_sign =
        before.ends_with('-') && before.trim_end_matches('-').chars().next_back().is_none_or(|c| c == ' ');
    let has_decimals = numbers.contains('.');
    let is_plain = |text: &str| !text.is_empty() && text.chars().all(is_digit);
    let values: Option<Vec<f64>> = if has_decimals {
        let is_decimal = numbers.split('.').count() == 2 && numbers.split('.').all(is_plain);
        is_decimal.then(|| numbers.parse().ok().map(|value| vec![value])).flatten()
    } else {
        numbers.split(['-', '_', ' ']).map(|n| is_plain(n).then(|| n.parse().ok()).flatten()).collect()
    };
    let values = values?;
    let may_be_date = word.is_empty() && (values.len() > 1 || numbers.len() >= DATE_DIGITS || has_decimals);
    let known = !is_sign && !may_be_date && !word.contains('.');
    known.then_some(Words { word, numbers: values, has_hyphen: before.ends_with('-'), has_decimals })
}

/// Order of labels among words: `baseline` before `week4` before `month12`; `followup2` after `followup1`. `None` where
/// one isn't known, and where lengths of time stand beside a stage after the first: when `post` was isn't stated.
fn stages(labels: &[Words]) -> Option<Vec<(usize, Vec<f64>)>> {
    let stage_of = |label: &Words| STAGES.iter().position(|words| words.contains(&label.word.as_str()));
    let days_of = |label: &Words| {
        let days = UNITS.iter().find(|(words, _)| words.contains(&label.word.as_str()))?.1;
        let (first, rest) = label.numbers.split_first()?;
        Some(std::iter::once(first * days).chain(rest.iter().copied()).collect::<Vec<f64>>())
    };
    let later_stage = labels.iter().any(|label| stage_of(label).is_some_and(|stage| stage > 0));
    let any_length = labels.iter().any(|label| stage_of(label).is_none());
    if later_stage && any_length {
        return None;
    }
    let key = |label: &Words| match stage_of(label) {
        Some(stage) if !label.has_decimals => Some((2 * stage, label.numbers.clone())),
        Some(_) => None,
        None => Some((1, days_of(label)?)),
    };
    labels.iter().map(key).collect()
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
    if !names_each_once(stated, labels) {
        let found = format!("the order {}", stated.join(", "));
        return Err(CaseError::wrong(&spec.name, found, format!("each date once: {}", labels.join(", "))));
    }
    Ok((stated.to_vec(), OrderBasis::Stated))
}

/// Whether `order` has each of `labels` once.
pub(super) fn names_each_once(order: &[String], labels: &[String]) -> bool {
    let mut sorted = [order.to_vec(), labels.to_vec()];
    sorted.iter_mut().for_each(|list| list.sort());
    sorted[0] == sorted[1]
}

/// Whether labels state their order in time.
pub(super) fn is_stated_by(labels: &[&str]) -> bool {
    chronological(labels).1 != OrderBasis::Unknown
}

/// The times of a case in the order first listed, where neither the case nor `options` nor the labels themselves state
/// their order.
pub fn unordered_times(spec: &CaseSpec, options: &LoadOptions) -> Option<Vec<String>> {
    let labels = spec.times();
    let names: Vec<&str> = labels.iter().map(String::as_str).collect();
    let is_stated = !spec.order.is_empty() || !options.order.is_empty() || is_stated_by(&names);
    (!is_stated).then_some(labels)
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
    let Some(words) = labels.iter().map(|label| words(label)).collect::<Option<Vec<Words>>>() else {
        return (unchanged(), OrderBasis::Unknown);
    };
    // Where some labels of one word have a hyphen before the number and others don't, it may be a minus sign.
    let is_mixed = |label: &Words| {
        let same = words.iter().filter(|other| other.word == label.word && !other.numbers.is_empty());
        !label.numbers.is_empty() && same.into_iter().any(|other| other.has_hyphen != label.has_hyphen)
    };
    if words.iter().any(is_mixed) {
        return (unchanged(), OrderBasis::Unknown);
    }
    if let Some(order) = stages(&words).and_then(|stages| ascending(&stages)) {
        return (order, OrderBasis::Words);
    }
    let is_numbered =
        |label: &Words| label.word == words[0].word && !label.numbers.is_empty() && !label.has_decimals;
    let numbers: Vec<&Vec<f64>> =
        words.iter().filter(|label| is_numbered(label)).map(|w| &w.numbers).collect();
    if let Some(order) = ascending(&numbers).filter(|order| order.len() == labels.len()) {
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
        let cases: [(&[&str], &[&str], OrderBasis); 18] = [
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
            (
                &["week-044", "week-013-2", "week-013-1"],
                &["week-013-1", "week-013-2", "week-044"],
                OrderBasis::Words,
            ),
            (&["3 months", "1.5 months"], &["1.5 months", "3 months"], OrderBasis::Words),
            (&["1y", "0.5y"], &["0.5y", "1y"], OrderBasis::Words),
            (
                &["13months", "1y", "5weeks", "11months", "1month", "4weeks"],
                &["4weeks", "1month", "5weeks", "11months", "1y", "13months"],
                OrderBasis::Words,
            ),
            (
                &["visit 2-1", "visit 1-10", "visit 1-2"],
                &["visit 1-2", "visit 1-10", "visit 2-1"],
                OrderBasis::Numbers,
            ),
            (&["B", "A"], &["B", "A"], OrderBasis::Unknown),
            (&["only"], &["only"], OrderBasis::Single),
        ];
        for (given, expected, basis) in cases {
            assert_eq!(ordered(given), (expected.to_vec(), basis), "{given:?}");
        }
    }

    /// What may be read in more than one way is asked about. (The first is the earlier one in each pair of dates.)
    #[test]
    fn contradicting_equal_or_ambiguous_labels_have_no_order() {
        for labels in [
            ["2024-01-01", "post"],
            ["2024-01-01 a", "2024-01-01 b"],
            ["ses-1", "tp-2"],
            ["pre", "baseline"],
            ["week4", "post"],
            ["week4", "day28"],
            ["ses-1", "ses-01"],
            ["05-01-2024", "04-02-2024"],
            ["05.01.2024", "04.02.2024"],
            ["05012024", "04022024"],
            ["2024-2-10", "2024-12-1"],
            ["2024-01-05", "2024-1-20"],
            ["2024-01-05", "5.2.2024"],
            ["12-2023", "03-2024"],
            ["10.2023", "2.2024"],
            ["2023.12", "2024.1"],
            ["v2.10", "v3.1"],
            ["5-24", "6-23"],
            ["week2", "week1e5"],
            ["2 months", "1.5e1 months"],
            ["rano-1.5", "rano-2"],
            ["day-7", "day0"],
            ["D-7", "D0"],
            ["week -2", "week 0"],
            ["-1", "0"],
            ["postop", "month3"],
            ["fu4b", "fu5b"],
        ] {
            assert_eq!(chronological(&labels), (vec![0, 1], OrderBasis::Unknown), "{labels:?}");
            let [a, b] = labels;
            assert_eq!(chronological(&[b, a]), (vec![0, 1], OrderBasis::Unknown), "{labels:?} reversed");
        }
        assert_eq!(chronological(&["preop", "postop", "month3"]).1, OrderBasis::Unknown);
    }
}
