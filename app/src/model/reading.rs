//! What the reader concludes, for the report.

use serde::{Deserialize, Serialize};

/// The longest name of a reader, characters.
pub const MOST_READER: usize = 100;
/// The longest conclusion, characters.
pub const MOST_CONCLUSION: usize = 4000;

/// The reader's words at the end of a reading.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reading {
    /// The conclusion; empty: none.
    pub conclusion: String,
    /// Who read it; empty: not said.
    pub reader: String,
    /// The day on which that was written, 2024-01-31; empty: not known.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub day: String,
    /// The calls in words as they were last taken over into the conclusion; empty: they weren't.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub taken: String,
}

impl Reading {
    /// Whether the conclusion repeats calls that were taken over and are none of `now`, the calls as they are, by language.
    pub fn repeats_old_calls(&self, now: &[Option<String>]) -> bool {
        self.repeats_calls() && !now.iter().flatten().any(|calls| *calls == self.taken)
    }

    /// Whether it repeats the calls as they are, but not in the words of a report's language, which are `own`.
    pub fn is_in_another_language(&self, now: &[Option<String>], own: Option<&str>) -> bool {
        self.repeats_calls() && !self.repeats_old_calls(now) && own != Some(&self.taken)
    }

    fn repeats_calls(&self) -> bool {
        !self.taken.is_empty() && self.conclusion.contains(&self.taken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_that_changed_after_they_were_taken_over_are_old_in_any_language() {
        let now = [Some("SD now".to_owned()), Some("jetzt SD".to_owned())];
        let of = |conclusion: &str, taken: &str| Reading {
            conclusion: conclusion.into(),
            taken: taken.into(),
            ..Reading::default()
        };
        assert!(of("Seen. PD then. Later.", "PD then.").repeats_old_calls(&now));
        for not in [
            of("Seen. SD now", "SD now"),
            of("Seen. jetzt SD", "jetzt SD"),
            of("In the reader's own words", "PD then."),
            of("PD then.", ""),
        ] {
            assert!(!not.repeats_old_calls(&now), "{not:?}");
        }
        assert!(of("PD then.", "PD then.").repeats_old_calls(&[]), "there are none any more");
        // In a German report calls in English are told, old ones by the other warning.
        let own = Some("jetzt SD");
        assert!(of("Seen. SD now", "SD now").is_in_another_language(&now, own));
        for not in [of("jetzt SD", "jetzt SD"), of("PD then.", "PD then."), of("Own words", "SD now")] {
            assert!(!not.is_in_another_language(&now, own), "{not:?}");
        }
    }
}
