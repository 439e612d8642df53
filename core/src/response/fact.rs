//! Values of the history file: facts with an author, and days by calendar or by count.

use std::fmt;

use super::phrases as say;
use crate::{
    dates::leading_date,
    phrase::{Phrase, Value},
};
use jiff::civil::Date;
use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{DeserializeOwned, Error},
    ser::SerializeMap,
};

/// The author of facts that the masks show.
pub(super) const MASKS: &str = "the masks";

/// The author of a fact that the program proposed and nobody confirmed.
pub const PROGRAM: &str = "the program";

/// A statement, and who entered it when. In TOML the value itself, or `{ value = …, author = "…", entered = 2024-05-01 }`.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact<T> {
    /// What is stated.
    pub value: T,
    /// Who stated it.
    pub author: Option<String>,
    /// Day on which it was entered.
    pub entered: Option<String>,
}

impl<T> Fact<T> {
    /// A fact without an author.
    pub fn of(value: T) -> Self {
        Self { value, author: None, entered: None }
    }

    /// A fact that nobody stated: shown as a proposal until somebody confirms it.
    pub fn proposed(value: T) -> Self {
        Self { value, author: Some(PROGRAM.to_owned()), entered: None }
    }

    /// Whether nobody has stated it.
    pub fn is_proposed(&self) -> bool {
        self.author.as_deref() == Some(PROGRAM)
    }

    /// Who stated it, for the end of a reason: `(A. B., 2024-05-01)`; a day alone isn't to be read as that of what was stated.
    pub(super) fn by(&self) -> Option<Phrase> {
        if self.author.as_deref() == Some(MASKS) && self.entered.is_none() {
            return Some(say::BY_THE_MASKS.into());
        }
        if let (None, Some(day)) = (&self.author, &self.entered) {
            return Some(say::BY_NOBODY_ON.with([("day", Value::Text(day.clone()))]));
        }
        let parts: Vec<&str> =
            [&self.author, &self.entered].into_iter().flatten().map(String::as_str).collect();
        (!parts.is_empty()).then(|| say::BY.with([("who", Value::Text(parts.join(", ")))]))
    }
}

/// Who stated something that isn't a [`Fact`], and when. In TOML `{ author = "…", entered = 2024-05-01 }`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stated {
    /// Who stated it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub author: Option<String>,
    /// Day on which it was entered.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "text_of_day")]
    pub entered: Option<String>,
}

/// A day as text: TOML may have it without quotes.
pub(super) fn text_of_day<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    Ok(Option::<Label>::deserialize(deserializer)?.map(|label| label.0))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    value: toml::Value,
    author: Option<String>,
    entered: Option<toml::Value>,
}

impl<T: Serialize> Serialize for Fact<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.author.is_none() && self.entered.is_none() {
            return self.value.serialize(serializer);
        }
        // TOML has no null, and neither has what reads it.
        let mut fact = serializer.serialize_map(None)?;
        fact.serialize_entry("value", &self.value)?;
        for (key, text) in [("author", &self.author), ("entered", &self.entered)] {
            if let Some(text) = text {
                fact.serialize_entry(key, text)?;
            }
        }
        fact.end()
    }
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for Fact<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let wrong = |error: toml::de::Error| D::Error::custom(error.message());
        let value = toml::Value::deserialize(deserializer)?;
        if !value.is_table() {
            return Ok(Self::of(value.try_into().map_err(wrong)?));
        }
        let entry: Entry = value.try_into().map_err(wrong)?;
        let text = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        Ok(Self {
            value: entry.value.try_into().map_err(wrong)?,
            author: entry.author,
            entered: entry.entered.as_ref().map(text),
        })
    }
}

/// A day: of the calendar, or counted from any first day that all of a history's days share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "Raw")]
pub enum When {
    /// A day of the calendar.
    Date(Date),
    /// A count of days.
    Day(i32),
}

impl When {
    /// The day that a scan's label begins with.
    pub(super) fn of_label(label: &str) -> Option<Self> {
        leading_date(label).map(Self::Date)
    }

    /// It as a reason says it.
    pub(super) fn value(self) -> Value {
        match self {
            Self::Date(date) => Value::Text(date.to_string()),
            Self::Day(day) => say::DAY.with([("day", Value::number(day))]).into(),
        }
    }

    /// The number of the day; of calendar days from 1970-01-01.
    pub(super) fn number(self) -> i32 {
        match self {
            Self::Date(date) => (date - Date::constant(1970, 1, 1)).get_days(),
            Self::Day(day) => day,
        }
    }
}

impl Serialize for When {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Date(date) => serializer.collect_str(date),
            Self::Day(day) => serializer.serialize_i32(*day),
        }
    }
}

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Date(date) => write!(f, "{date}"),
            Self::Day(day) => write!(f, "day {day}"),
        }
    }
}

/// A TOML value that states a day.
#[derive(Deserialize)]
#[serde(untagged, expecting = "an ISO date or a number of days")]
enum Raw {
    Day(i32),
    Date(toml::value::Datetime),
    Text(String),
}

impl TryFrom<Raw> for When {
    type Error = String;

    fn try_from(raw: Raw) -> Result<Self, String> {
        let text = match raw {
            Raw::Day(day) => return Ok(Self::Day(day)),
            Raw::Date(date) => date.to_string(),
            Raw::Text(text) => text,
        };
        let date = crate::dates::iso_date(&text).map(Self::Date);
        date.ok_or_else(|| format!("{text:?}, expected an ISO date or a number of days"))
    }
}

/// End of radiotherapy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "RawEnd")]
pub enum Radiotherapy {
    /// There was none.
    None,
    /// Its last day.
    Ended(When),
}

impl Serialize for Radiotherapy {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::None => serializer.serialize_str("none"),
            Self::Ended(when) => when.serialize(serializer),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "an ISO date, a number of days or \"none\"")]
enum RawEnd {
    When(Raw),
}

impl TryFrom<RawEnd> for Radiotherapy {
    type Error = String;

    fn try_from(RawEnd::When(raw): RawEnd) -> Result<Self, String> {
        match raw {
            Raw::Text(text) if text == "none" => Ok(Self::None),
            raw => When::try_from(raw).map(Self::Ended),
        }
    }
}

/// Label of a scan: a text, or a TOML date without quotes.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "RawLabel")]
pub struct Label(pub String);

#[derive(Deserialize)]
#[serde(untagged, expecting = "a text in quotes or a date")]
enum RawLabel {
    Text(String),
    Date(toml::value::Datetime),
}

impl From<RawLabel> for Label {
    fn from(raw: RawLabel) -> Self {
        match raw {
            RawLabel::Text(text) => Self(text.trim().to_owned()),
            RawLabel::Date(date) => Self(date.to_string()),
        }
    }
}

impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
