//! The sentences of the study.

use crate::words::{Language, Words};

/// Those of `language`.
pub(super) fn words(language: Language) -> Words {
    Words::new(language, source(language))
}

pub(super) fn source(language: Language) -> &'static str {
    match language {
        Language::En => include_str!("words/en.ftl"),
        Language::De => include_str!("words/de.ftl"),
    }
}
