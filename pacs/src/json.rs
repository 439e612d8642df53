//! DICOM JSON (PS3.18 F): of a data set, the elements that searches show; everything else is skipped while it is read.

use std::fmt;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::tags;
use crate::text::clean;
use crate::uid::Uid;

/// Most values of an element that are kept.
const MAX_VALUES: usize = 64;

/// Most characters of a value that are kept; names have up to 64 in each of 5 components.
const MAX_CHARACTERS: usize = 1024;

/// A data set's elements with simple values.
#[derive(Debug, Default)]
pub(crate) struct DataSet(Vec<(u32, Vec<Scalar>)>);

/// One value.
#[derive(Debug)]
enum Scalar {
    Text(String),
    Number(f64),
    /// Null, or something that isn't simple.
    Other,
}

impl DataSet {
    fn values(&self, tag: u32) -> &[Scalar] {
        let found = self.0.iter().find(|(key, _)| *key == tag);
        found.map_or(&[], |(_, values)| values.as_slice())
    }

    /// The values that are text, without control characters; numbers as text.
    pub fn texts(&self, tag: u32) -> Vec<String> {
        let of = |value: &Scalar| match value {
            Scalar::Text(text) => Some(clean(text, MAX_CHARACTERS)).filter(|text| !text.is_empty()),
            Scalar::Number(number) => Some(number.to_string()),
            Scalar::Other => None,
        };
        self.values(tag).iter().filter_map(of).collect()
    }

    /// The first value as text.
    pub fn text(&self, tag: u32) -> Option<String> {
        self.texts(tag).into_iter().next()
    }

    /// The first value as a whole number: IS is a number or a string.
    pub fn integer(&self, tag: u32) -> Option<i64> {
        let number = match self.values(tag).first()? {
            Scalar::Text(text) => return text.trim().parse().ok(),
            Scalar::Number(number) => *number,
            Scalar::Other => return None,
        };
        // 2^53: larger ones aren't exact.
        (number.fract() == 0.0 && number.abs() <= 9_007_199_254_740_992.0).then_some(number as i64)
    }

    /// The first value as a count.
    pub fn count(&self, tag: u32) -> Option<u64> {
        self.integer(tag).and_then(|number| u64::try_from(number).ok())
    }

    /// The first value as a UID, if it is a valid one.
    pub fn uid(&self, tag: u32) -> Option<Uid> {
        match self.values(tag).first()? {
            Scalar::Text(text) => Uid::read(text),
            _ => None,
        }
    }
}

impl<'de> Deserialize<'de> for DataSet {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_map(DataSetVisitor)
    }
}

struct DataSetVisitor;

impl<'de> Visitor<'de> for DataSetVisitor {
    type Value = DataSet;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a data set of DICOM JSON")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<DataSet, A::Error> {
        let mut data = DataSet::default();
        while let Some(key) = map.next_key::<String>()? {
            let tag =
                Some(key).filter(|key| key.len() == 8).and_then(|key| u32::from_str_radix(&key, 16).ok());
            match tag.filter(|tag| tags::SHOWN.contains(tag)) {
                // The first of an element stands: there are no more of them than of tags.
                Some(tag) if data.values(tag).is_empty() => {
                    let Element(values) = map.next_value()?;
                    if !values.is_empty() {
                        data.0.push((tag, values));
                    }
                }
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(data)
    }
}

/// Values of one element: of `{"vr": "UI", "Value": ["1.2"]}`, the list.
#[derive(Default)]
struct Element(Vec<Scalar>);

/// Implements `Deserialize` by a visitor of any JSON value: what isn't matched reads as the default.
macro_rules! any_json {
    ($type:ty, $visitor:ident, $default:expr, { $($methods:item)* }) => {
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                from.deserialize_any($visitor)
            }
        }
        struct $visitor;
        impl<'de> Visitor<'de> for $visitor {
            type Value = $type;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("JSON")
            }
            fn visit_unit<E>(self) -> Result<$type, E> {
                Ok($default)
            }
            fn visit_bool<E>(self, _: bool) -> Result<$type, E> {
                Ok($default)
            }
            $($methods)*
        }
    };
}

any_json!(Element, ElementVisitor, Element::default(), {
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Element, A::Error> {
        let mut element = Element::default();
        while let Some(key) = map.next_key::<String>()? {
            if key == "Value" {
                element.0 = map.next_value::<Values>()?.0;
            } else {
                map.next_value::<IgnoredAny>()?;
            }
        }
        Ok(element)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Element, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Element::default())
    }
    fn visit_str<E>(self, _: &str) -> Result<Element, E> {
        Ok(Element::default())
    }
    fn visit_f64<E>(self, _: f64) -> Result<Element, E> {
        Ok(Element::default())
    }
    fn visit_i64<E>(self, _: i64) -> Result<Element, E> {
        Ok(Element::default())
    }
    fn visit_u64<E>(self, _: u64) -> Result<Element, E> {
        Ok(Element::default())
    }
});

/// The list of an element's values; a value alone counts as a list of one.
struct Values(Vec<Scalar>);

any_json!(Values, ValuesVisitor, Values(Vec::new()), {
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Values, A::Error> {
        let mut values = Vec::new();
        while values.len() < MAX_VALUES {
            match list.next_element::<Scalar>()? {
                Some(value) => values.push(value),
                None => return Ok(Values(values)),
            }
        }
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Values(values))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Values, A::Error> {
        Ok(Values(vec![ScalarVisitor.visit_map(map)?]))
    }
    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Values, E> {
        Ok(Values(vec![ScalarVisitor.visit_str(text)?]))
    }
    fn visit_f64<E>(self, number: f64) -> Result<Values, E> {
        Ok(Values(vec![Scalar::Number(number)]))
    }
    fn visit_i64<E>(self, number: i64) -> Result<Values, E> {
        Ok(Values(vec![Scalar::Number(number as f64)]))
    }
    fn visit_u64<E>(self, number: u64) -> Result<Values, E> {
        Ok(Values(vec![Scalar::Number(number as f64)]))
    }
});

any_json!(Scalar, ScalarVisitor, Scalar::Other, {
    fn visit_str<E>(self, text: &str) -> Result<Scalar, E> {
        Ok(Scalar::Text(text.chars().take(MAX_CHARACTERS).collect()))
    }
    fn visit_f64<E>(self, number: f64) -> Result<Scalar, E> {
        Ok(Scalar::Number(number))
    }
    fn visit_i64<E>(self, number: i64) -> Result<Scalar, E> {
        Ok(Scalar::Number(number as f64))
    }
    fn visit_u64<E>(self, number: u64) -> Result<Scalar, E> {
        Ok(Scalar::Number(number as f64))
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Scalar, A::Error> {
        while list.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Scalar::Other)
    }
    /// A person's name: its alphabetic form, else the ideographic or phonetic one.
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Scalar, A::Error> {
        let (mut alphabetic, mut other) = (None, None);
        while let Some(key) = map.next_key::<String>()? {
            let slot = match key.as_str() {
                "Alphabetic" => &mut alphabetic,
                "Ideographic" | "Phonetic" => &mut other,
                _ => {
                    map.next_value::<IgnoredAny>()?;
                    continue;
                }
            };
            if let Scalar::Text(text) = map.next_value::<Scalar>()?
                && !text.trim().is_empty()
            {
                *slot = Some(text);
            }
        }
        Ok(alphabetic.or(other).map_or(Scalar::Other, Scalar::Text))
    }
});

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> DataSet {
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn names_numbers_and_lists_are_read() {
        let data = read(
            r#"{"00100010":{"vr":"PN","Value":[{"Ideographic":"王^小","Alphabetic":"Wang^Xiao"}]},
                "00200011":{"vr":"IS","Value":["  12 "]},"00201209":{"vr":"IS","Value":[48]},
                "00080061":{"vr":"CS","Value":["MR",null,"SEG"]},"0020000D":{"vr":"UI","Value":["1.2.3"]},
                "00081030":{"vr":"LO"},"00091001":{"vr":"SQ","Value":[{"00100010":{"vr":"PN"}}]}}"#,
        );
        assert_eq!(data.text(0x0010_0010).as_deref(), Some("Wang^Xiao"));
        assert_eq!((data.integer(0x0020_0011), data.count(0x0020_1209)), (Some(12), Some(48)));
        assert_eq!(data.texts(0x0008_0061), ["MR", "SEG"]);
        assert_eq!(data.uid(0x0020_000d).unwrap().as_str(), "1.2.3");
        assert_eq!(data.text(0x0008_1030), None);
    }

    #[test]
    fn odd_json_is_unknown() {
        for value in ["null", "1", "-1", "1.5", "true", "\"x\"", "[]", "[[1]]", "{}", "{\"Value\":{\"a\":1}}"]
        {
            let data = read(&format!("{{\"00100010\":{value}}}"));
            assert_eq!(data.text(0x0010_0010), None, "{value}");
        }
        let data = read(
            r#"{"0020000D":{"Value":["../.."]},"00200011":{"Value":[1e300]},"00201209":{"Value":[-1]}}"#,
        );
        assert_eq!(
            (data.uid(0x0020_000d), data.integer(0x0020_0011), data.count(0x0020_1209)),
            (None, None, None)
        );
        // Nothing nested is kept, so depth costs nothing.
        let nested = format!("{{\"00100010\":{}{}}}", "[".repeat(300_000), "]".repeat(300_000));
        assert_eq!(read(&nested).text(0x0010_0010), None);
    }
}
