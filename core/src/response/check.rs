//! Reading of a history and of measurements: limits, ranges, and errors of one line.

use std::collections::HashSet;

use strum::VariantArray;

use super::{
    history::{Assessment, History, HistoryError, MAX_MEASUREMENTS, MAX_SCANS, Measurement, VERSION},
    rules::Criterion,
    trial::TrialNumber,
};
use crate::dates::iso_date;

/// Maximum size of a history in bytes.
const MAX_BYTES: usize = 1 << 20;
/// Maximum length of a text in bytes.
const MAX_TEXT: usize = 400;
/// How much a stated product may differ from that of the stated diameters, which tools print rounded.
const PRODUCT_TOLERANCE: f64 = 0.01;

pub(super) fn wrong(place: &str, found: impl AsRef<str>, expected: impl AsRef<str>) -> HistoryError {
    let one_line = |text: &str| {
        let text: String =
            text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_TEXT).collect();
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    HistoryError {
        place: one_line(place),
        found: one_line(found.as_ref()),
        expected: one_line(expected.as_ref()),
    }
}

/// What a place with a line begins with.
const LINE: &str = "history, line ";

impl History {
    /// Reads a history from TOML and checks it.
    ///
    /// # Errors
    /// [`HistoryError`] for what isn't TOML, unknown keys, and as [`Self::check`].
    pub fn parse(text: &str) -> Result<Self, HistoryError> {
        if text.len() > MAX_BYTES {
            let found = format!("{} bytes", text.len());
            return Err(wrong("history", found, format!("at most {MAX_BYTES}")));
        }
        let history: Self = toml::from_str(text).map_err(|error| {
            let line = error.span().and_then(|span| text.get(..span.start));
            let place = line.map_or_else(
                || "history".to_owned(),
                |before| format!("{LINE}{}", before.matches('\n').count() + 1),
            );
            let message = error.message().replace("unknown field", "unknown key");
            match message.split_once(", expected ") {
                Some((found, expected)) => wrong(&place, found, expected),
                None => wrong(&place, message, "a history in TOML"),
            }
        })?;
        history.check()?;
        Ok(history)
    }

    /// As [`Self::parse`], with other criteria or another assessment than the text states. With RANO 2.0 and neither, enhancing
    /// disease is assessed; other criteria have no assessment.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn parse_for(
        text: &str,
        criterion: Option<Criterion>,
        assessment: Option<Assessment>,
    ) -> Result<Self, HistoryError> {
        // What isn't TOML is said with its line by the other.
        let Ok(mut table) = text.parse::<toml::Table>() else { return Self::parse(text) };
        let before = table.clone();
        let mut set = |key: &str, value: &'static str| table.insert(key.to_owned(), value.into());
        if let Some(criterion) = criterion {
            set("criterion", criterion.into());
        }
        if let Some(assessment) = assessment {
            set("assessment", assessment.into());
        }
        let rano_20: &'static str = Criterion::Rano20.into();
        if table.get("criterion").and_then(toml::Value::as_str) == Some(rano_20) {
            let enhancing: &'static str = Assessment::Enhancing.into();
            table.entry("assessment").or_insert_with(|| enhancing.into());
        } else if criterion.is_some() {
            table.remove("assessment");
        }
        if table == before {
            return Self::parse(text);
        }
        // Lines are those of the text, not of what it was made into.
        Self::parse(&table.to_string()).map_err(|error| match Self::parse(text) {
            Err(own) if own.found == error.found => own,
            _ if error.place.starts_with(LINE) => HistoryError { place: "history".into(), ..error },
            _ => error,
        })
    }

    /// Checks what a value alone shows: ranges, sizes, choices that the criteria don't have.
    ///
    /// # Errors
    /// [`HistoryError`], one line for the first fault.
    pub fn check(&self) -> Result<(), HistoryError> {
        if self.response != VERSION {
            return Err(wrong(
                "history",
                format!("response = {}", self.response),
                format!("response = {VERSION}"),
            ));
        }
        self.check_criterion()?;
        self.check_trial()?;
        let counts = [
            ("[[date]]", self.date.len(), MAX_SCANS),
            ("[[measurement]]", self.measurement.len(), MAX_MEASUREMENTS),
            ("[[surgery]]", self.surgery.len(), MAX_SCANS),
            ("[[treatment]]", self.treatment.as_ref().map_or(0, Vec::len), MAX_SCANS),
            ("targets", self.target_names().map_or(0, <[String]>::len), MAX_SCANS),
            ("non_targets", self.non_target_names().len(), MAX_SCANS),
        ];
        for (what, found, most) in counts {
            if found > most {
                return Err(wrong("history", format!("{found} {what}"), format!("at most {most}")));
            }
        }
        let after_surgery = self.surgery.iter().filter_map(|surgery| surgery.targets.as_deref());
        for targets in self.target_names().into_iter().chain(after_surgery) {
            unique(targets, "targets")?;
            if let Some(both) = targets.iter().find(|name| self.non_target_names().contains(name)) {
                return Err(wrong("history", format!("{both} as target and as non-target"), "one of them"));
            }
        }
        unique(self.non_target_names(), "non_targets")?;
        let repeatability = &self.repeatability;
        let stated = [
            ("repeatability.product", &repeatability.product),
            ("repeatability.longest", &repeatability.longest),
            ("repeatability.volume", &repeatability.volume),
        ];
        for (place, stated) in stated {
            let Some(stated) = stated else { continue };
            in_range(place, "relative_sd", Some(stated.relative_sd), 1e-6, 2.0)?;
            named(place, "source", &stated.source)?;
        }
        for name in self.treatment.iter().flatten().filter_map(|treatment| treatment.name.as_ref()) {
            named("history, treatment", "name", name)?;
        }
        let mut authorship = Ok(());
        self.clone().each_statement(&mut |author, entered| {
            if authorship.is_ok() {
                authorship = stated_by(author.as_deref(), entered.as_deref());
            }
        });
        authorship?;
        for facts in &self.date {
            let place = format!("history, [[date]] {}", facts.date);
            named(&place, "date", &facts.date.0)?;
            in_range(&place, "steroids_mg", facts.steroids_mg.as_ref().map(|fact| fact.value), 0.0, 1000.0)?;
        }
        let mut operated = HashSet::new();
        if let Some(twice) = self.surgery.iter().find(|surgery| !operated.insert(surgery.date.to_string())) {
            let found = format!("{} twice", twice.date);
            return Err(wrong("history, [[surgery]]", found, "one surgery a day"));
        }
        self.measurement.iter().try_for_each(check_measurement)
    }

    fn check_criterion(&self) -> Result<(), HistoryError> {
        let is_rano_20 = self.criterion == Criterion::Rano20;
        let choices = "assessment = \"enhancing\", \"non-enhancing\" or \"mixed\" with RANO 2.0";
        match (self.assessment, is_rano_20) {
            (None, true) => Err(wrong("history", "no assessment", choices)),
            (Some(_), false) => {
                let found = format!("an assessment with {}", self.criterion.name());
                Err(wrong("history", found, choices))
            }
            _ => Ok(()),
        }
    }

    fn check_trial(&self) -> Result<(), HistoryError> {
        let trial = &self.trial;
        for number in TrialNumber::VARIANTS {
            let Some((value, source)) = number.of(trial) else { continue };
            let place = format!("history, trial.{}", number.key());
            in_range(&place, "value", Some(value), 0.0, number.most())?;
            named(&place, "source", source)?;
            if !number.is_open(self.criterion) {
                let found = format!("a value with {}", self.criterion.name());
                return Err(wrong(&place, found, "criteria that don't state it themselves"));
            }
        }
        if let Some(parts) = &trial.follow_2010 {
            named("history, trial.follow_2010", "source", &parts.source)?;
        }
        Ok(())
    }
}

fn unique(names: &[String], what: &str) -> Result<(), HistoryError> {
    let mut seen = HashSet::new();
    for name in names {
        named("history", what, name)?;
        if !seen.insert(name) {
            return Err(wrong("history", format!("{name} twice in {what}"), "each lesion once"));
        }
    }
    Ok(())
}

fn named(place: &str, key: &str, text: &str) -> Result<(), HistoryError> {
    if text.trim().is_empty() || text.len() > MAX_TEXT || text.chars().any(char::is_control) {
        let found = format!("{key} = {text:?}");
        return Err(wrong(place, found, format!("a text of 1 to {MAX_TEXT} bytes in one line")));
    }
    Ok(())
}

/// Checks who stated a fact, and when.
fn stated_by(author: Option<&str>, entered: Option<&str>) -> Result<(), HistoryError> {
    author.map_or(Ok(()), |author| named("history", "author", author))?;
    match entered {
        Some(day) if iso_date(day).is_none() => {
            Err(wrong("history", format!("entered = {day:?}"), "an ISO date, such as 2024-05-01"))
        }
        _ => Ok(()),
    }
}

fn in_range(place: &str, key: &str, value: Option<f64>, least: f64, most: f64) -> Result<(), HistoryError> {
    match value {
        Some(value) if !(least..=most).contains(&value) => {
            // Not hundreds of digits.
            let is_long = value.abs() >= 1e15 || (value != 0.0 && value.abs() < 1e-15);
            let value = if is_long { format!("{value:e}") } else { value.to_string() };
            let expected = match least {
                f64::MIN_POSITIVE => format!("a number above 0, at most {most}"),
                _ => format!("a number from {least} to {most}"),
            };
            Err(wrong(place, format!("{key} = {value}"), expected))
        }
        _ => Ok(()),
    }
}

/// Checks one measurement: ranges, and that its numbers agree.
pub(super) fn check_measurement(m: &Measurement) -> Result<(), HistoryError> {
    let place = format!("measurement of {} at {}", m.lesion, m.date);
    named(&place, "lesion", &m.lesion)?;
    named(&place, "date", &m.date.0)?;
    let numbers = [
        ("longest_mm", m.longest_mm, 1000.0),
        ("perpendicular_mm", m.perpendicular_mm, 1000.0),
        ("product_mm2", m.product_mm2, 1e6),
        ("slice_thickness_mm", m.slice_thickness_mm, 100.0),
        ("volume_ml", m.volume_ml, 1e4),
    ];
    for (key, value, most) in numbers {
        in_range(&place, key, value, f64::MIN_POSITIVE, most)?;
    }
    if m.slices == Some(0) {
        return Err(wrong(&place, "slices = 0", "at least 1, or gone = true"));
    }
    let sizes = [m.longest_mm, m.perpendicular_mm, m.product_mm2, m.volume_ml];
    if m.gone && (sizes.iter().any(Option::is_some) || m.slices.is_some()) {
        return Err(wrong(&place, "gone = true and a size", "one of them"));
    }
    if let (Some(longest), Some(perpendicular)) = (m.longest_mm, m.perpendicular_mm) {
        if perpendicular > longest {
            let found = format!("perpendicular_mm = {perpendicular}");
            return Err(wrong(&place, found, format!("at most longest_mm = {longest}")));
        }
        let product = longest * perpendicular;
        // More: a lesion in several pieces has the sum of their products.
        if m.product_mm2.is_some_and(|stated| stated / product - 1.0 < -PRODUCT_TOLERANCE) {
            let found = format!("product_mm2 = {}", m.product_mm2.unwrap_or(product));
            return Err(wrong(&place, found, format!("at least {product}, the product of its diameters")));
        }
    }
    Ok(())
}
