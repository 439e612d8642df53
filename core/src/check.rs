//! Findings about a file or a case: a code, a severity and a text.

use serde::Serialize;

/// How much a [`Check`] matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// For information; nothing was assumed.
    Note,
    /// Something was assumed or may mislead: shown prominently.
    Warning,
    /// The file or case can't be used.
    Error,
}

/// The first `most` of `names`, and how many more there are: `a, b and 3 more`.
pub fn listed(names: &[String], most: usize) -> String {
    let (first, rest) = names.split_at(names.len().min(most));
    let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
    format!("{}{more}", first.join(", "))
}

/// One finding. Codes are stable, lower-case, hyphenated and documented in `docs/checks.md`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// Stable name of the finding, for instance `sform-qform-disagree`.
    pub code: &'static str,
    /// How much it matters.
    pub severity: Severity,
    /// What was found and what was expected; starts with the file's name or the mask's id.
    pub message: String,
}

impl Check {
    /// A [`Severity::Note`].
    pub fn note(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, severity: Severity::Note, message: message.into() }
    }

    /// A [`Severity::Warning`].
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, severity: Severity::Warning, message: message.into() }
    }

    /// A [`Severity::Error`].
    pub fn error(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, severity: Severity::Error, message: message.into() }
    }
}
