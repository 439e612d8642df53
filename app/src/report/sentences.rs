//! The sentences of reports.

use crate::words::{Language, Words};

/// Those of `language`.
pub fn words(language: Language) -> Words {
    Words::new(language, source(language))
}

fn source(language: Language) -> &'static str {
    match language {
        Language::En => include_str!("words/en.ftl"),
        Language::De => include_str!("words/de.ftl"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::words::keys;

    #[test]
    fn every_language_has_every_sentence() {
        let [en, de] = [Language::En, Language::De].map(|language| keys(source(language)));
        assert_eq!(en, de);
        assert!(en.len() > 40, "{}", en.len());
    }
}
