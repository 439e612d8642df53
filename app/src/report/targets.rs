//! The lesions that calls rest on, at the baseline and at the last date.

use glioscope_core::{
    lesions::{LesionDate, LesionReport, LesionsReport, new_lesions},
    response::{DateResponse, Judgement, Measurement, Quantity, SumReport, name_of},
};

use super::{
    document::{Block, Table},
    identity::Redactor,
    responses::{call, signed},
};
use crate::{words::Words, world::response::Answered};

/// A table of targets, other lesions of the baseline and new ones, for each compartment that has a sum; nothing without one.
pub fn blocks(answered: &Answered, words: &Words, redactor: &Redactor) -> Vec<Block> {
    let Some(last) = answered.evaluated.response.dates.last() else { return Vec::new() };
    let tables = last.by_diameters.sums.iter().filter_map(|sum| {
        let baseline = sum.baseline.as_ref()?;
        let of = Targets::of(answered, sum, [&baseline.date, &last.date], words, redactor);
        let by_volume = last.by_volume.sums.iter().find(|by_volume| by_volume.compartment == sum.compartment);
        Some(Block::Table(of.table(sum, by_volume)))
    });
    let tables: Vec<Block> = tables.collect();
    if tables.is_empty() {
        return tables;
    }
    std::iter::once(Block::Heading(words.get("section-targets"))).chain(tables).collect()
}

/// Calls, lesions and sums of two scans in one table, of which the first is the baseline: `None` where the last isn't compared with that alone,
/// or compartments have sums of their own.
pub fn of_two_scans(answered: &Answered, words: &Words, redactor: &Redactor) -> Option<Table> {
    let [first, last] = answered.evaluated.response.dates.as_slice() else { return None };
    let [sum] = last.by_diameters.sums.as_slice() else { return None };
    // Not all criteria judge volumes.
    let by_volume = match last.by_volume.sums.as_slice() {
        [] => None,
        [one] => Some(one),
        _ => return None,
    };
    let is_of_first = |sum: &SumReport| {
        sum.baseline.as_ref().is_some_and(|baseline| baseline.date == first.date)
            && sum.change_from_baseline_percent == sum.change_from_nadir_percent
    };
    if !is_of_first(sum) || !by_volume.is_none_or(is_of_first) {
        return None;
    }
    let of = Targets {
        // Of one target it is the sum.
        with_products: sum.lesions.iter().filter(|lesion| lesion.target).count() > 1,
        ..Targets::of(answered, sum, [&first.date, &last.date], words, redactor)
    };
    let Table { rows: sizes, note, .. } = of.table(sum, by_volume);
    let calls = |of: fn(&DateResponse) -> &Judgement| [first, last].map(|date| call(of(date), words));
    let ways = [calls(|date| &date.by_diameters), calls(|date| &date.by_volume)];
    let row = |key: &str, [before, now]: [String; 2]| vec![words.get(key), before, now, String::new()];
    let [by_diameters, by_volume] = ways;
    let mut rows = match by_diameters == by_volume {
        true => vec![row("by-both", by_diameters)],
        false => vec![row("by-diameters", by_diameters), row("by-volume", by_volume)],
    };
    rows.extend(sizes.into_iter().map(|row| {
        let mut cells = row.into_iter();
        let (name, role) = (cells.next().unwrap_or_default(), cells.next().unwrap_or_default());
        let name = match role.is_empty() {
            true => name,
            false => words.with("lesion-as", &[("lesion", name), ("role", role)]),
        };
        std::iter::once(name).chain(cells).collect()
    }));
    let head = [words.get("date"), first.date.clone(), last.date.clone(), words.get("lesion-change")];
    Some(Table { head: head.into(), text_columns: 1, rows, note })
}

struct Targets<'a> {
    /// Those of the compartment.
    lesions: Option<&'a LesionsReport>,
    by_hand: &'a [Measurement],
    words: &'a Words,
    redactor: &'a Redactor,
    /// The baseline and the last date.
    dates: [&'a str; 2],
    /// Whether the product of its diameters stands beside them.
    with_products: bool,
}

impl<'a> Targets<'a> {
    /// Those of the compartment that `sum` is of.
    fn of(
        answered: &'a Answered,
        sum: &SumReport,
        dates: [&'a str; 2],
        words: &'a Words,
        redactor: &'a Redactor,
    ) -> Self {
        let Answered { evaluated, lesions } = answered;
        let own = lesions.iter().find(|(compartment, _)| *compartment == sum.compartment);
        let lesions = own.map(|(_, report)| report.as_ref());
        let by_hand = &evaluated.stated.measurement;
        Self { lesions, by_hand, words, redactor, dates, with_products: true }
    }

    /// The lesions by diameters, and below them the sums by diameters and by volume.
    fn table(&self, sum: &SumReport, by_volume: Option<&SumReport>) -> Table {
        let words = self.words;
        let role = |is_target: bool| words.get(if is_target { "is-target" } else { "is-not-target" });
        // Flecks of a mask that nobody made targets count for no call; the table of lesions counts them.
        let counts = |name: &str| self.lesion(name).is_none_or(|lesion| !lesion.small);
        let shown = sum.lesions.iter().filter(|one| one.target || counts(&one.lesion));
        let mut rows: Vec<Vec<String>> =
            shown.map(|one| self.row(&one.lesion, role(one.target), sum.quantity)).collect();
        let report = self.lesions.into_iter();
        let new = report.flat_map(new_lesions).filter(|(_, date)| date.time == self.dates[1]);
        rows.extend(new.map(|(name, _)| self.row(name, words.get("is-new"), sum.quantity)));
        let change = |percent: Option<f64>| percent.map(|p| signed(p, words)).unwrap_or_default();
        let total = |key: &str, sum: &SumReport| {
            let total = |value: Option<f64>| {
                value.map_or_else(|| words.get("unknown"), |v| self.sum(v, sum.quantity))
            };
            let baseline = total(sum.baseline.as_ref().map(|of| of.sum));
            let percent = change(sum.change_from_baseline_percent);
            vec![words.get(key), String::new(), baseline, total(sum.sum), percent]
        };
        rows.push(total("sum-of-targets", sum));
        rows.extend(by_volume.map(|by_volume| total("volume-of-targets", by_volume)));
        // The lowest sum where it isn't the baseline's.
        let lowest = sum.nadir.as_ref().filter(|lowest| lowest.date != self.dates[0]);
        let lowest = lowest.map(|lowest| {
            let variables = [
                ("sum", self.sum(lowest.sum, sum.quantity)),
                ("date", lowest.date.clone()),
                ("change", change(sum.change_from_nadir_percent)),
            ];
            words.with("lowest-sum", &variables)
        });
        let head = [
            words.get("lesion"),
            words.get("counts-as"),
            self.dates[0].to_owned(),
            self.dates[1].to_owned(),
            words.get("lesion-change"),
        ];
        Table { head: head.into(), text_columns: 2, rows, note: lowest }
    }

    fn row(&self, name: &str, role: String, quantity: Quantity) -> Vec<String> {
        let lesion = self.lesion(name);
        let at = |date: &str| lesion.and_then(|l| l.dates.iter().find(|of| of.time == date));
        let [before, now] = self.dates.map(at);
        let by_hand =
            self.dates.map(|date| self.by_hand.iter().find(|m| m.lesion == name && m.date.0 == date));
        let size = |date: Option<&LesionDate>, by_hand: Option<&Measurement>| match (date, by_hand) {
            (Some(date), _) => self.size(date, quantity),
            (None, Some(measured)) => self.size_by_hand(measured, quantity),
            (None, None) => "–".to_owned(),
        };
        let value = |date: Option<&LesionDate>, by_hand: Option<&Measurement>| match (quantity, date) {
            (Quantity::LongestMm, Some(date)) => date.d1_mm,
            (Quantity::LongestMm, None) => by_hand?.longest_mm,
            (_, Some(date)) => date.product_mm2,
            (_, None) => by_hand?.product(),
        };
        let values = (value(before, by_hand[0]), value(now, by_hand[1]));
        let change = values.0.zip(values.1).filter(|(before, _)| *before > 0.0);
        let change = change.map(|(before, now)| signed(100.0 * (now / before - 1.0), self.words));
        let own = lesion.map_or_else(|| name.to_owned(), |l| l.name.clone().unwrap_or_else(|| l.id.clone()));
        let sizes = [size(before, by_hand[0]), size(now, by_hand[1])];
        let [before, now] = sizes;
        vec![self.redactor.text(&own), role, before, now, change.unwrap_or_default()]
    }

    fn lesion(&self, name: &str) -> Option<&LesionReport> {
        let all = &self.lesions?.lesions;
        all.iter().find(|lesion| name_of(lesion, all) == name)
    }

    /// Diameters of the largest piece, and of all pieces what is summed.
    fn size(&self, date: &LesionDate, quantity: Quantity) -> String {
        let words = self.words;
        if date.volume_ml.is_none() {
            return words.get("unknown");
        }
        let (Some(d1), Some(d2), Some(product)) = (date.d1_mm, date.d2_mm, date.product_mm2) else {
            return words.get("not-there");
        };
        match quantity {
            Quantity::LongestMm => words.number(&format!("{d1:.1} mm")),
            _ => self.diameters(d1, d2, product),
        }
    }

    /// As [`Self::size`], of a lesion that a reader measured.
    fn size_by_hand(&self, measured: &Measurement, quantity: Quantity) -> String {
        let words = self.words;
        if measured.gone {
            return words.get("not-there");
        }
        match (quantity, measured.longest_mm, measured.perpendicular_mm, measured.product()) {
            (Quantity::LongestMm, Some(longest), ..) => words.number(&format!("{longest:.1} mm")),
            (_, Some(longest), Some(perpendicular), Some(product)) => {
                self.diameters(longest, perpendicular, product)
            }
            (_, _, _, Some(product)) => words.number(&format!("{product:.1} mm²")),
            _ => words.get("unknown"),
        }
    }

    fn diameters(&self, longest_mm: f64, perpendicular_mm: f64, product_mm2: f64) -> String {
        let product = if self.with_products { format!(", {product_mm2:.1} mm²") } else { String::new() };
        self.words.number(&format!("{longest_mm:.2} × {perpendicular_mm:.2} mm{product}"))
    }

    fn sum(&self, value: f64, quantity: Quantity) -> String {
        match quantity {
            Quantity::VolumeMl => self.words.ml(value),
            Quantity::LongestMm => self.words.number(&format!("{value:.1} mm")),
            Quantity::ProductMm2 => self.words.number(&format!("{value:.1} mm²")),
        }
    }
}
