//! ISO dates in labels and file names. Only days of the calendar count: 2024-02-31 is not a date.

use jiff::civil::Date;

/// Length of an ISO date in bytes: `2024-01-15`.
pub const ISO_LENGTH: usize = 10;

/// Whether `text` has the form of an ISO date, whether or not that day exists.
pub fn is_shaped_as_date(text: &str) -> bool {
    let has_date_form =
        |(at, byte): (usize, u8)| if at == 4 || at == 7 { byte == b'-' } else { byte.is_ascii_digit() };
    text.len() == ISO_LENGTH && text.bytes().enumerate().all(has_date_form)
}

/// The date that `text` states, if it is an ISO date and nothing else.
pub fn iso_date(text: &str) -> Option<Date> {
    text.parse().ok().filter(|_| is_shaped_as_date(text))
}

/// The date that a label begins with, if no further digit follows: `2024-01-15 late`.
pub fn leading_date(label: &str) -> Option<Date> {
    let followed = label.as_bytes().get(ISO_LENGTH).is_some_and(u8::is_ascii_digit);
    iso_date(label.get(..ISO_LENGTH)?).filter(|_| !followed)
}

/// Byte offset of the first ISO date in `text` that is not part of a longer number.
pub fn find_iso_date(text: &str) -> Option<usize> {
    let is_digit = |at: usize| text.as_bytes().get(at).is_some_and(u8::is_ascii_digit);
    let alone = |at: &usize| !(at.checked_sub(1).is_some_and(is_digit) || is_digit(at + ISO_LENGTH));
    let ends = text.len().saturating_sub(ISO_LENGTH - 1);
    (0..ends).filter(alone).find(|&at| text.get(at..at + ISO_LENGTH).and_then(iso_date).is_some())
}

/// The date that eight digits state: 2024-01-15 for `20240115`. Only from 2000 to 2100: earlier ones are more often birth
/// dates.
pub fn compact_date(digits: &str) -> Option<Date> {
    let part = |range: std::ops::Range<usize>| {
        digits.get(range).filter(|text| text.bytes().all(|b| b.is_ascii_digit()))
    };
    let (year, month, day) = (part(0..4)?, part(4..6)?, part(6..8)?);
    let date = Date::new(year.parse().ok()?, month.parse().ok()?, day.parse().ok()?).ok()?;
    (digits.len() == 8 && (2000..=2100).contains(&date.year())).then_some(date)
}

/// A date as DICOM writes it, eight digits, with hyphens: `2024-01-15`. `None` for anything else.
pub fn dicom_date(digits: &str) -> Option<String> {
    let is_date = digits.len() == 8 && digits.bytes().all(|b| b.is_ascii_digit());
    is_date.then(|| format!("{}-{}-{}", &digits[..4], &digits[4..6], &digits[6..]))
}

/// Days since the first of `labels`, if each begins with a date and the dates increase; `None` otherwise.
pub fn days_since_first(labels: &[&str]) -> Option<Vec<f64>> {
    let dates: Vec<Date> = labels.iter().map(|label| leading_date(label)).collect::<Option<_>>()?;
    let first = *dates.first()?;
    let increasing = dates.windows(2).all(|pair| pair[0] < pair[1]);
    increasing.then(|| dates.iter().map(|date| f64::from((*date - first).get_days())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_calendar_days_are_dates() {
        assert!(iso_date("2024-02-29").is_some() && iso_date("2000-02-29").is_some());
        for invalid in [
            "2023-02-29",
            "1900-02-29",
            "2024-02-31",
            "2024-13-01",
            "2024-00-10",
            "9999-99-99",
            "20240115",
            "2024-1-15",
            "+024-01-15",
            "2024-01-15T00:00",
            "week 3",
            "2024-01-1é",
        ] {
            assert!(iso_date(invalid).is_none(), "{invalid}");
        }
    }

    #[test]
    fn eight_digits_are_a_date_where_that_day_exists() {
        let text = |digits: &str| compact_date(digits).map(|date| date.to_string());
        assert_eq!(text("20240115").as_deref(), Some("2024-01-15"));
        for other in ["20240231", "15012024", "19840312", "2024011", "202401150", "2024-1-1", "+2240115", ""]
        {
            assert_eq!(text(other), None, "{other}");
        }
    }

    #[test]
    fn a_date_is_found_within_a_name() {
        assert_eq!(find_iso_date("x2024-01-15y"), Some(1));
        assert_eq!(find_iso_date("12024-01-15"), None);
        assert_eq!(find_iso_date("2024-02-31_2024-03-01"), Some(11));
        assert_eq!(find_iso_date("größe-2024-01-15"), Some("größe-".len()));
    }

    #[test]
    fn days_are_counted_over_leap_years() {
        assert_eq!(days_since_first(&["2024-01-15", "2024-04-15"]), Some(vec![0.0, 91.0]));
        assert_eq!(days_since_first(&["2023-02-28", "2023-03-01", "2024-03-01"]).unwrap(), [0.0, 1.0, 367.0]);
        assert_eq!(days_since_first(&["2000-02-28 pre", "2000-03-01 post"]).unwrap(), [0.0, 2.0]);
        assert_eq!(days_since_first(&["before", "after"]), None);
        assert_eq!(days_since_first(&["2024-04-15", "2024-01-15"]), None, "not in order");
        assert_eq!(days_since_first(&[]), None);
    }

    #[test]
    fn dates_end_where_further_digits_begin() {
        let text = |label: &str| leading_date(label).map(|date| date.to_string());
        for label in ["2024-01-15", "2024-01-15 late", "2024-01-15a", "2024-01-15-2"] {
            assert_eq!(text(label).as_deref(), Some("2024-01-15"), "{label}");
        }
        for label in ["2024-01-150", "a2024-01-15", "2024-01-1", "", "2024-01-32"] {
            assert_eq!(text(label), None, "{label}");
        }
        assert_eq!(find_iso_date("2024-01-15"), Some(0));
        assert_eq!(find_iso_date("a2024-01-15"), Some(1), "at the very end");
        for without in ["2024-01-155", "2024-01-1", "", "x", "02024-01-15x"] {
            assert_eq!(find_iso_date(without), None, "{without}");
        }
        assert!(
            is_shaped_as_date("9999-99-99")
                && !is_shaped_as_date("9999-99-9")
                && !is_shaped_as_date("9999-99_99")
        );
        assert!(
            !is_shaped_as_date("9999_99-99")
                && !is_shaped_as_date("999a-99-99")
                && !is_shaped_as_date("99-99-9999")
        );
        for (digits, is_date) in
            [("20000101", true), ("21001231", true), ("19991231", false), ("21010101", false)]
        {
            assert_eq!(compact_date(digits).is_some(), is_date, "{digits}");
        }
        assert_eq!(days_since_first(&["2024-01-15 a", "2024-01-15 b"]), None, "the same day twice");
        assert_eq!(days_since_first(&["2024-01-15"]), Some(vec![0.0]));
    }
}
