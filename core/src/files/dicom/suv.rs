//! Standardised uptake values by body weight (SUVbw), where the tags allow it (QIBA's pseudo-code for vendor-neutral SUV;
//! arXiv 2410.13348 on where tools differ). What can't be told is said, and values stay in their unit.

use jiff::civil::{Date, DateTime, Time};
use jiff::tz::Offset;

use super::data_set::DataSet;
use super::tags::{self, Tag};

/// Doses that are injected, in Bq: a dose in MBq would be a million times smaller.
const DOSES_BQ: std::ops::RangeInclusive<f64> = 1e5..=1e11;

/// Weights of patients, in kg: from a newborn's on. A weight in grams would be larger.
const WEIGHTS_KG: std::ops::RangeInclusive<f64> = 0.5..=400.0;

/// Half-lives of radionuclides used in PET, in seconds: from oxygen-15's (122 s) to zirconium-89's (78 h).
const HALF_LIVES_S: std::ops::RangeInclusive<f64> = 60.0..=1e6;

/// Longest time from injection to scan, in half-lives.
const MAX_HALF_LIVES: f64 = 10.0;

/// What a PET file says of its values.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Activity {
    /// `BQML`, `GML`, `CNTS`, ...; empty where absent.
    pub units: String,
    suv_type: String,
    decay_correction: String,
    corrections: Vec<String>,
    weight_kg: Option<f64>,
    radiopharmaceuticals: usize,
    dose_bq: Option<f64>,
    half_life_s: Option<f64>,
    injected: Option<DateTime>,
    /// Time of day of the injection, where its date isn't stated.
    injected_time: Option<Time>,
    series: Option<DateTime>,
    acquired: Option<DateTime>,
    ge_scan: Option<DateTime>,
    philips_suv: Option<f64>,
    philips_activity: Option<f64>,
}

impl Activity {
    pub fn of(data: &DataSet) -> Self {
        let pharmaceutical = data.item(tags::RADIOPHARMACEUTICAL_INFORMATION_SEQUENCE);
        let number =
            |data: Option<&DataSet>, tag: Tag| data.and_then(|data| data.decimal(tag).ok().flatten());
        // A private factor may be DS, or FL or FD where the file states no representation.
        let date_time = |date: Tag, time: Tag| {
            let date = date_of(&data.text(date)?)?;
            Some(date.to_datetime(time_of(&data.text(time)?)?))
        };
        let start = pharmaceutical.and_then(|p| p.text(tags::RADIOPHARMACEUTICAL_START_DATE_TIME));
        let start_time = pharmaceutical.and_then(|p| p.text(tags::RADIOPHARMACEUTICAL_START_TIME));
        Self {
            units: data.text(tags::UNITS).unwrap_or_default(),
            suv_type: data.text(tags::SUV_TYPE).unwrap_or_default(),
            decay_correction: data.text(tags::DECAY_CORRECTION).unwrap_or_default(),
            corrections: data.texts(tags::CORRECTED_IMAGE),
            weight_kg: number(Some(data), tags::PATIENT_WEIGHT),
            radiopharmaceuticals: data.items(tags::RADIOPHARMACEUTICAL_INFORMATION_SEQUENCE).len(),
            dose_bq: number(pharmaceutical, tags::RADIONUCLIDE_TOTAL_DOSE),
            half_life_s: number(pharmaceutical, tags::RADIONUCLIDE_HALF_LIFE),
            injected: start.and_then(|text| date_time_of(&text)),
            injected_time: start_time.and_then(|text| time_of(&text)),
            series: date_time(tags::SERIES_DATE, tags::SERIES_TIME),
            acquired: date_time(tags::ACQUISITION_DATE, tags::ACQUISITION_TIME),
            ge_scan: data.text(tags::GE_SCAN_DATE_TIME).and_then(|text| date_time_of(&text)),
            philips_suv: number(Some(data), tags::PHILIPS_SUV_SCALE_FACTOR),
            philips_activity: number(Some(data), tags::PHILIPS_ACTIVITY_FACTOR),
        }
    }
}

/// What the values of a PET series are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Uptake {
    /// SUVbw of a value in the file's unit; `None` where it can't be told.
    pub factor: Option<f64>,
    /// How the factor was found, or why there is none.
    pub how: String,
}

/// SUVbw of the values of a series.
///
/// # Errors
/// What the files disagree on: values of several units are no image.
pub(super) fn uptake(files: &[&Activity]) -> Result<Uptake, String> {
    let Some(&first) = files.first() else {
        return Ok(Uptake { factor: None, how: "no file".into() });
    };
    if let Some(other) = files.iter().find(|file| file.units != first.units) {
        return Err(format!("slices in {} and in {}", named(&first.units), named(&other.units)));
    }
    let cannot = |why: String| Ok(Uptake { factor: None, how: why });
    let (to_becquerel, how) = match first.units.as_str() {
        "GML" if matches!(first.suv_type.as_str(), "" | "BW") => {
            return Ok(Uptake { factor: Some(1.0), how: "stored as SUVbw (g/ml)".into() });
        }
        "GML" => return cannot(format!("values are SUV by {}, not by body weight", first.suv_type)),
        "BQML" => (1.0, String::new()),
        "CNTS" => match (first.philips_suv, first.philips_activity) {
            (Some(factor), _) if factor > 0.0 => {
                return Ok(Uptake {
                    factor: Some(factor),
                    how: "counts by Philips' SUV scale factor".into(),
                });
            }
            (_, Some(factor)) if factor > 0.0 => (factor, ", counts by Philips' activity factor".to_owned()),
            _ => return cannot("values are counts, and no factor is stated".into()),
        },
        other => return cannot(format!("values are in {}", named(other))),
    };
    for needed in ["ATTN", "DECY"] {
        if !first.corrections.iter().any(|c| c == needed) {
            return cannot(format!("values are not corrected for {needed} (0028,0051)"));
        }
    }
    if first.radiopharmaceuticals != 1 {
        return cannot(format!("{} radiopharmaceuticals are stated", first.radiopharmaceuticals));
    }
    let Some(weight_kg) = first.weight_kg.filter(|w| *w > 0.0) else {
        return cannot("the patient's weight is not stated".into());
    };
    if !WEIGHTS_KG.contains(&weight_kg) {
        return cannot(format!("a weight of {weight_kg} kg is stated"));
    }
    let Some(dose_bq) = first.dose_bq.filter(|d| *d > 0.0) else {
        return cannot("the injected dose is not stated".into());
    };
    if !DOSES_BQ.contains(&dose_bq) {
        return cannot(format!("a dose of {dose_bq} Bq is stated (MBq?)"));
    }
    let weight_g = weight_kg * 1000.0;
    let at_scan = match first.decay_correction.as_str() {
        "ADMIN" => {
            let how = format!("activity at injection{how}");
            return Ok(Uptake { factor: Some(to_becquerel * weight_g / dose_bq), how });
        }
        "START" => scan_time(files),
        other => return cannot(format!("decay correction is {}", named(other))),
    };
    let Some(half_life_s) = first.half_life_s.filter(|t| HALF_LIVES_S.contains(t)) else {
        return cannot("the half-life is not stated, or none of PET".into());
    };
    let Some(at_scan) = at_scan else {
        return cannot("the time of the scan is not stated".into());
    };
    let (injected, assumed) = match (first.injected, first.injected_time, first.series) {
        (Some(at), ..) => (at, ""),
        (None, Some(time), Some(series)) => (series.date().to_datetime(time), " (the series' date assumed)"),
        _ => return cannot("the time of the injection is not stated".into()),
    };
    let Ok(elapsed) = at_scan
        .since(injected)
        .and_then(|span| span.total((jiff::Unit::Second, jiff::SpanRelativeTo::days_are_24_hours())))
    else {
        return cannot("times that can't be compared are stated".into());
    };
    if elapsed < 0.0 {
        return cannot("the injection is stated to be after the scan".into());
    }
    if elapsed > MAX_HALF_LIVES * half_life_s {
        return cannot(format!("the injection is stated to be {elapsed:.0} s before the scan"));
    }
    let decayed_bq = dose_bq * (-elapsed / half_life_s).exp2();
    let how = format!("activity at the scan, {elapsed:.0} s after the injection{assumed}{how}");
    Ok(Uptake { factor: Some(to_becquerel * weight_g / decayed_bq), how })
}

/// The time to which activity is corrected: that of the series, unless it was stated when the series was processed again,
/// later than the earliest acquisition.
fn scan_time(files: &[&Activity]) -> Option<DateTime> {
    let earliest = files.iter().filter_map(|file| file.acquired).min();
    let series = files.iter().filter_map(|file| file.series).min();
    match (series, earliest) {
        (Some(series), Some(acquired)) if series > acquired => {
            Some(files.iter().filter_map(|file| file.ge_scan).min().unwrap_or(acquired))
        }
        (Some(series), _) => Some(series),
        (None, acquired) => acquired,
    }
}

fn named(code: &str) -> &str {
    if code.is_empty() { "no stated unit" } else { code }
}

/// A date (DA): `YYYYMMDD`, or with dots as of old.
pub(super) fn date_of(text: &str) -> Option<Date> {
    let digits: String = text.chars().filter(|c| *c != '.').collect();
    if digits.len() != 8 || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    Date::new(digits[..4].parse().ok()?, digits[4..6].parse().ok()?, digits[6..].parse().ok()?).ok()
}

/// A time (TM): `HH`, `HHMM`, `HHMMSS` or with a fraction.
fn time_of(text: &str) -> Option<Time> {
    let text: String = text.chars().filter(|c| *c != ':').collect();
    let (whole, fraction) = text.split_once('.').unwrap_or((&text, ""));
    let is_digits = |t: &str| t.bytes().all(|b| b.is_ascii_digit());
    if !matches!(whole.len(), 2 | 4 | 6) || !is_digits(whole) || fraction.len() > 6 || !is_digits(fraction) {
        return None;
    }
    let part = |at: usize| whole.get(at..at + 2).map_or(Some(0), |t| t.parse::<i8>().ok());
    let nanoseconds = format!("{fraction:0<9}").parse().ok()?;
    Time::new(part(0)?, part(2)?, part(4)?, nanoseconds).ok()
}

/// A date and time (DT), in the scanner's own time: an offset from UTC says which that is, and is left out, as the dates
/// of series have none.
fn date_time_of(text: &str) -> Option<DateTime> {
    let text = text.trim();
    let local = match text.char_indices().skip(8).find(|(_, c)| matches!(c, '+' | '-')) {
        Some((at, _)) => {
            // An offset that is none makes the whole time doubtful.
            let hours: i8 = text.get(at..at + 3)?.parse().ok()?;
            Offset::from_hours(hours).ok()?;
            &text[..at]
        }
        None => text,
    };
    let date = date_of(local.get(..8)?)?;
    Some(date.to_datetime(time_of(local.get(8..)?)?))
}
