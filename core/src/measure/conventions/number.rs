//! Values in JSON, which has no infinity.

use serde::{Serialize, Serializer};

/// Null where undefined, the text `"infinity"` where infinite, else a number.
pub(super) fn number<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    match value {
        Some(value) if value.is_infinite() => serializer.serialize_str("infinity"),
        value => value.serialize(serializer),
    }
}

/// As [`number`].
pub(super) struct Number<'a>(pub(super) &'a Option<f64>);

impl Serialize for Number<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        number(self.0, serializer)
    }
}
