//! The report's sentences in its language, from Fluent files.

use clap::ValueEnum;
use fluent_bundle::{FluentArgs, FluentBundle, FluentResource};
use serde::{Deserialize, Serialize};
use unic_langid::langid;

use crate::format;

/// A language of reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Language {
    /// English.
    #[default]
    En,
    /// German.
    De,
}

impl Language {
    fn source(self) -> &'static str {
        match self {
            Self::En => include_str!("words/en.ftl"),
            Self::De => include_str!("words/de.ftl"),
        }
    }
}

/// Sentences and numbers in one language.
pub struct Words {
    language: Language,
    bundle: FluentBundle<FluentResource>,
}

impl Words {
    /// Those of `language`.
    pub fn new(language: Language) -> Self {
        let id = match language {
            Language::En => langid!("en"),
            Language::De => langid!("de"),
        };
        let mut bundle = FluentBundle::new(vec![id]);
        // The marks would show as boxes in plain text and PDF; every language here runs left to right.
        bundle.set_use_isolating(false);
        // What can be parsed of a faulty file is used: a test parses all files.
        let resource = FluentResource::try_new(language.source().to_owned()).unwrap_or_else(|(part, _)| part);
        bundle.add_resource_overriding(resource);
        Self { language, bundle }
    }

    /// The sentence of `key`.
    pub fn get(&self, key: &str) -> String {
        self.with(key, &[])
    }

    /// The sentence of `key` with its variables; the key itself where there is none.
    pub fn with(&self, key: &str, variables: &[(&str, String)]) -> String {
        let mut arguments = FluentArgs::new();
        for (name, value) in variables {
            arguments.set(*name, value.as_str());
        }
        let pattern = self.bundle.get_message(key).and_then(|message| message.value());
        let Some(pattern) = pattern else { return key.to_owned() };
        let mut errors = Vec::new();
        self.bundle.format_pattern(pattern, Some(&arguments), &mut errors).into_owned()
    }

    /// A number that was formatted in English.
    pub fn number(&self, english: &str) -> String {
        match self.language {
            Language::En => english.to_owned(),
            Language::De => english.replace('.', ","),
        }
    }

    /// A volume.
    pub fn ml(&self, ml: f64) -> String {
        if ml.is_finite() { self.number(&format::ml(ml)) } else { self.get("unknown") }
    }

    /// A share as a percentage.
    pub fn percent(&self, share: f64) -> String {
        if share.is_finite() { self.number(&format::percent(share)) } else { self.get("unknown") }
    }

    /// A change as a percentage with its sign; unknown where it began with nothing.
    pub fn signed_percent(&self, from: f64, to: f64) -> String {
        let change = (to - from) / from;
        if !change.is_finite() {
            return self.get("unknown");
        }
        let sign = if change > 0.0 { "+" } else { "" };
        format!("{sign}{}", self.number(&format!("{:.1} %", change * 100.0))).replace('-', "\u{2212}")
    }

    /// A length; `none` where there is none.
    pub fn mm(&self, mm: Option<f64>) -> String {
        mm.map_or_else(|| self.get("no-length"), |mm| self.number(&format!("{mm:.1} mm")))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn keys(language: Language) -> BTreeSet<String> {
        let resource = FluentResource::try_new(language.source().to_owned());
        assert!(resource.is_ok(), "{language:?}: {:?}", resource.err().map(|(_, errors)| errors));
        let lines =
            language.source().lines().filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
        lines.filter_map(|line| Some(line.split_once(" =")?.0.to_owned())).collect()
    }

    #[test]
    fn every_language_has_every_sentence() {
        assert_eq!(keys(Language::En), keys(Language::De));
        assert!(keys(Language::En).len() > 50);
    }

    #[test]
    fn numbers_follow_the_language() {
        let [en, de] = [Language::En, Language::De].map(Words::new);
        assert_eq!([en.ml(12.345), de.ml(12.345)], ["12.35 ml", "12,35 ml"]);
        assert_eq!([en.signed_percent(4.0, 5.0), de.signed_percent(4.0, 3.0)], ["+25.0 %", "\u{2212}25,0 %"]);
        assert_eq!(en.signed_percent(0.0, 3.0), "unknown");
        assert_eq!([en.mm(Some(2.25)), de.mm(None)], ["2.2 mm", "keiner"]);
    }

    #[test]
    fn sentences_take_their_variables() {
        let words = Words::new(Language::En);
        assert_eq!(
            words.with("summary-one-mask", &[("mask", "T1".into()), ("volume", "3 ml".into())]),
            "T1 has a volume of 3 ml."
        );
        assert_eq!(words.get("nothing of the kind"), "nothing of the kind");
    }
}
