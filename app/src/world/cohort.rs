//! The tables of the open cohort, read on a worker, and what is derived from them: a value of each case, which cases are shown and in
//! what order.

use std::{
    collections::{BTreeMap, HashMap},
    path::PathBuf,
    sync::Arc,
};

use glioscope_cohort::{Collected, Offered, Quantity};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::{
    format,
    model::cohort::{Axis, CohortSetting, OpenCohort, Order},
};

/// How many median absolute deviations of a normal distribution its standard deviation has.
const MAD_TO_SD: f64 = 1.482_602_218_505_602;
/// The same of the mean absolute deviation.
const MEAN_TO_SD: f64 = 1.253_314_137_315_500_1;

/// The tables that were last read.
#[derive(Default)]
pub struct Cohorts {
    result: Derived<(PathBuf, u64), Collected>,
}

impl Cohorts {
    /// The tables of the open cohort.
    pub fn get(&mut self, open: &OpenCohort, ask: &Ask) -> Lookup<'_, Collected> {
        let folder = open.folder.clone();
        self.result.get((open.folder.clone(), open.opened), ask, move |progress| {
            Ok(Collected::read(&folder, progress)?)
        })
    }

    /// The tables that were last read.
    pub fn last(&self) -> Option<&Arc<Collected>> {
        self.result.last()
    }

    /// Whether a worker reads them.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }
}

/// A value of each case.
#[derive(Clone, Debug, PartialEq)]
pub enum CaseValues {
    /// Numbers; NaN where a case has none.
    Numbers(Vec<f64>),
    /// Words.
    Words {
        /// The position in `words` of each case's; `None` where it has none.
        of_case: Vec<Option<usize>>,
        /// The words, each once, sorted.
        words: Vec<String>,
    },
}

impl CaseValues {
    fn of(collected: &Collected, quantity: &Quantity, is_text: bool) -> Self {
        if !is_text {
            return Self::Numbers(collected.numbers(quantity));
        }
        let of_case = collected.words(quantity);
        let mut words: Vec<&str> = of_case.iter().flatten().copied().collect();
        words.sort_unstable();
        words.dedup();
        let place = |word: &str| words.binary_search(&word).ok();
        let of_case = of_case.iter().map(|word| word.and_then(place)).collect();
        Self::Words { of_case, words: words.into_iter().map(str::to_owned).collect() }
    }

    /// A case's value in words.
    pub fn text(&self, case: usize, unit: &str) -> String {
        match self {
            Self::Numbers(numbers) => number_text(numbers.get(case).copied().unwrap_or(f64::NAN), unit),
            Self::Words { of_case, words } => {
                let word = of_case.get(case).copied().flatten().and_then(|place| words.get(place));
                word.map_or_else(|| "–".to_owned(), |word| word.replace('_', " "))
            }
        }
    }

    /// Whether a case passes a filter. With one, a case without a value doesn't.
    fn passes(&self, case: usize, axis: &Axis) -> bool {
        match self {
            Self::Numbers(numbers) => {
                let number = numbers.get(case).copied().unwrap_or(f64::NAN);
                axis.range.is_none_or(|[low, high]| low <= number && number <= high)
            }
            Self::Words { of_case, words } => {
                let word = of_case.get(case).copied().flatten().and_then(|place| words.get(place));
                axis.words.is_empty() || word.is_some_and(|word| axis.words.contains(word))
            }
        }
    }
}

/// A number with its unit: four digits, `∞`, or `–` for none.
pub fn number_text(number: f64, unit: &str) -> String {
    let sign = if number < 0.0 { "\u{2212}" } else { "" };
    match number {
        n if n.is_nan() => "–".to_owned(),
        n if n.is_infinite() => format!("{sign}∞"),
        // Of a table that says so: all digits would take the whole window.
        n if n.abs() >= 1e9 => {
            format!("{sign}{:.3e}{}{unit}", n.abs(), if unit.is_empty() { "" } else { " " })
        }
        n => {
            let digits = format::four_digits(n.abs());
            let digits = if digits.contains('.') {
                digits.trim_end_matches('0').trim_end_matches('.')
            } else {
                &digits
            };
            let space = if unit.is_empty() { "" } else { " " };
            format!("{sign}{digits}{space}{unit}")
        }
    }
}

/// From this many numbers on a range leaves out the farthest fiftieth on either side, which might take all of it.
const CLIPPED_FROM: usize = 50;
const CLIPPED_SHARE: f64 = 0.02;

/// A range of numbers, and whether some are below and above it.
pub type DrawnRange = ([f64; 2], [bool; 2]);

/// The range in which numbers are drawn, and whether some are below and above it. Infinite numbers are outside of it; 0 to 1 where none is
/// finite.
pub fn drawn_range(numbers: &[f64]) -> DrawnRange {
    let mut finite: Vec<f64> = numbers.iter().copied().filter(|number| number.is_finite()).collect();
    finite.sort_by(f64::total_cmp);
    let (Some(&least), Some(&greatest)) = (finite.first(), finite.last()) else {
        return ([0.0, 1.0], [false; 2]);
    };
    let left_out =
        if finite.len() < CLIPPED_FROM { 0 } else { (finite.len() as f64 * CLIPPED_SHARE) as usize };
    let mut range = [finite[left_out], finite[finite.len() - 1 - left_out]];
    if range[0] >= range[1] {
        range = [least, greatest];
    }
    let infinite = |sign: f64| numbers.iter().any(|number| number.is_infinite() && number * sign > 0.0);
    (range, [least < range[0] || infinite(-1.0), greatest > range[1] || infinite(1.0)])
}

/// Values by quantity of one cohort, each computed when it is first asked for.
#[derive(Default)]
pub struct Columns {
    of: Option<Handle<Collected>>,
    offered: Vec<Offered>,
    failures: BTreeMap<usize, String>,
    known: HashMap<Quantity, (Arc<CaseValues>, DrawnRange)>,
}

impl Columns {
    /// Forgets what is known of another cohort.
    pub fn turn_to(&mut self, collected: &Arc<Collected>) {
        let handle = Handle::of(collected);
        if self.of.as_ref() != Some(&handle) {
            *self = Self {
                of: Some(handle),
                offered: collected.offered(),
                failures: collected.failures(),
                known: HashMap::new(),
            };
        }
    }

    /// What the cases can be asked for.
    pub fn offered(&self) -> &[Offered] {
        &self.offered
    }

    /// The column that a quantity names; `None` where the tables lack it.
    pub fn offer(&self, quantity: &Quantity) -> Option<&Offered> {
        self.offered.iter().find(|offer| offer.table == quantity.table && offer.column == quantity.column)
    }

    /// Why cases failed, by position.
    pub fn failures(&self) -> &BTreeMap<usize, String> {
        &self.failures
    }

    /// The values of a quantity.
    pub fn get(&mut self, collected: &Collected, quantity: &Quantity) -> Arc<CaseValues> {
        if let Some((values, _)) = self.known.get(quantity) {
            return values.clone();
        }
        let is_text = self.offer(quantity).is_some_and(|offer| offer.is_text);
        let values = Arc::new(CaseValues::of(collected, quantity, is_text));
        let numbers = if let CaseValues::Numbers(numbers) = &*values { &numbers[..] } else { &[] };
        self.known.insert(quantity.clone(), (values.clone(), drawn_range(numbers)));
        values
    }

    /// The range in which the values of a quantity are drawn that [`Columns::get`] was asked for: of words, and of others, that of no number.
    pub fn drawn(&self, quantity: &Quantity) -> DrawnRange {
        self.known.get(quantity).map_or_else(|| drawn_range(&[]), |(_, range)| *range)
    }
}

/// The cases that pass all filters, in their order: positions in [`Collected::cases`].
pub fn shown(collected: &Collected, setting: &CohortSetting, columns: &mut Columns) -> Vec<usize> {
    let search = setting.search.trim().to_lowercase();
    let axes: Vec<(&Axis, Arc<CaseValues>)> = setting
        .axes
        .iter()
        .filter(|axis| axis.filters())
        .map(|axis| (axis, columns.get(collected, &axis.quantity)))
        .collect();
    let passes = |(case, name): &(usize, &String)| {
        (search.is_empty() || name.to_lowercase().contains(&search))
            && axes.iter().all(|(axis, values)| values.passes(*case, axis))
    };
    let mut cases: Vec<usize> =
        collected.cases().iter().enumerate().filter(passes).map(|(case, _)| case).collect();
    if let Some(sort) = &setting.sort {
        let keys = sort_keys(&columns.get(collected, sort), setting.order);
        // Stable: equals stay in the order of their names.
        cases.sort_by(|a, b| keys[*a].total_cmp(&keys[*b]));
    } else if setting.order == Order::Descending {
        cases.reverse();
    }
    cases
}

/// Numbers by whose order cases are sorted; those without a value come last.
fn sort_keys(values: &CaseValues, order: Order) -> Vec<f64> {
    let last = |key: f64| if key.is_nan() { f64::NAN } else { key };
    match (values, order) {
        (CaseValues::Numbers(numbers), Order::Outliers) => {
            outlyingness(numbers).into_iter().map(|far| last(-far)).collect()
        }
        (CaseValues::Numbers(numbers), Order::Ascending) => numbers.iter().copied().map(last).collect(),
        (CaseValues::Numbers(numbers), Order::Descending) => numbers.iter().map(|n| last(-n)).collect(),
        (CaseValues::Words { of_case, words }, order) => {
            let mut counts = vec![0_usize; words.len()];
            of_case.iter().flatten().for_each(|word| counts[*word] += 1);
            let key = |word: &Option<usize>| match (word, order) {
                (None, _) => f64::NAN,
                // Of equally rare words, cases of the same one are neighbours.
                (Some(word), Order::Outliers) => counts[*word] as f64 + *word as f64 / words.len() as f64,
                (Some(word), Order::Ascending) => *word as f64,
                (Some(word), Order::Descending) => -(*word as f64),
            };
            of_case.iter().map(key).collect()
        }
    }
}

/// How far each number is from the median, in standard deviations of a normal distribution with the same median absolute deviation; where
/// that is 0, with the same mean absolute deviation (Iglewicz and Hoaglin 1993). Infinite numbers are infinitely far; NaN stays NaN.
pub fn outlyingness(numbers: &[f64]) -> Vec<f64> {
    let mut finite: Vec<f64> = numbers.iter().copied().filter(|number| number.is_finite()).collect();
    let Some(median) = middle(&mut finite) else {
        return numbers.iter().map(|number| if number.is_nan() { f64::NAN } else { f64::INFINITY }).collect();
    };
    let mut far: Vec<f64> = finite.iter().map(|number| (number - median).abs()).collect();
    let mean = far.iter().sum::<f64>() / far.len() as f64;
    let mad = middle(&mut far).unwrap_or_default();
    let sd = if mad > 0.0 { mad * MAD_TO_SD } else { mean * MEAN_TO_SD };
    let of = |number: &f64| {
        let far = (number - median).abs();
        if far == 0.0 { 0.0 } else { far / sd }
    };
    numbers.iter().map(of).collect()
}

/// The median; sorts the numbers. `None` of none.
fn middle(numbers: &mut [f64]) -> Option<f64> {
    numbers.sort_by(f64::total_cmp);
    let half = numbers.len() / 2;
    let high = *numbers.get(half)?;
    Some(if numbers.len().is_multiple_of(2) { f64::midpoint(numbers[half - 1], high) } else { high })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_are_far_from_the_median() {
        // Median 3, deviations 2 1 0 1 97: MAD 1.
        let far = outlyingness(&[1.0, 2.0, 3.0, 4.0, 100.0, f64::INFINITY, f64::NAN]);
        let sd = 1.0 / 0.674_489_750_196_081_7;
        for (found, expected) in far.iter().zip([2.0, 1.0, 0.0, 1.0, 97.0]) {
            assert!((found - expected / sd).abs() < 1e-9, "{far:?}");
        }
        assert!(far[5].is_infinite() && far[6].is_nan());
        // More than half are equal: MAD 0, mean absolute deviation 2.
        let far = outlyingness(&[5.0, 5.0, 5.0, 15.0, 5.0]);
        assert_eq!(far[0], 0.0);
        assert!((far[3] - 10.0 / (2.0 * (std::f64::consts::PI / 2.0).sqrt())).abs() < 1e-9, "{far:?}");
        assert_eq!(outlyingness(&[2.0, 2.0]), [0.0, 0.0]);
    }

    #[test]
    fn cases_without_a_value_come_last_in_every_order() {
        let numbers = CaseValues::Numbers(vec![f64::NAN, 2.0, 1.0, 9.0, 2.0]);
        let words = CaseValues::Words {
            of_case: vec![None, Some(0), Some(0), Some(1), Some(0)],
            words: vec!["a".into(), "b".into()],
        };
        let sorted = |values: &CaseValues, order| {
            let keys = sort_keys(values, order);
            let mut cases: Vec<usize> = (0..5).collect();
            cases.sort_by(|a, b| keys[*a].total_cmp(&keys[*b]));
            cases
        };
        assert_eq!(sorted(&numbers, Order::Ascending), [2, 1, 4, 3, 0]);
        assert_eq!(sorted(&numbers, Order::Descending), [3, 1, 4, 2, 0]);
        assert_eq!(sorted(&numbers, Order::Outliers), [3, 2, 1, 4, 0]);
        assert_eq!(sorted(&words, Order::Outliers), [3, 1, 2, 4, 0]);
        assert_eq!(sorted(&words, Order::Descending), [3, 1, 2, 4, 0]);
    }

    #[test]
    fn numbers_have_four_digits_and_a_unit() {
        let text = |number| number_text(number, "mm");
        assert_eq!(
            [0.403_12, -12.5, 1234.5, 0.0, f64::INFINITY, f64::NAN].map(text),
            ["0.4031 mm", "\u{2212}12.5 mm", "1234 mm", "0 mm", "∞", "–"]
        );
    }
}
