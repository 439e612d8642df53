//! Sentences and numbers in a language, from Fluent files: of the report, of the page to take home.

use clap::ValueEnum;
use fluent_bundle::{FluentArgs, FluentBundle, FluentResource};
use serde::{Deserialize, Serialize};
use unic_langid::langid;

use crate::format;

/// A language of what is handed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Language {
    /// English.
    #[default]
    En,
    /// German.
    De,
}

/// Sentences and numbers in one language.
pub struct Words {
    language: Language,
    bundle: FluentBundle<FluentResource>,
}

impl Words {
    /// Those of `language`, from a Fluent file's text.
    pub fn new(language: Language, source: &str) -> Self {
        let id = match language {
            Language::En => langid!("en"),
            Language::De => langid!("de"),
        };
        let mut bundle = FluentBundle::new(vec![id]);
        // The marks would show as boxes in plain text and PDF; every language here runs left to right.
        bundle.set_use_isolating(false);
        // What can be parsed of a faulty file is used: `keys` is tested for all files.
        let resource = FluentResource::try_new(source.to_owned()).unwrap_or_else(|(part, _)| part);
        bundle.add_resource_overriding(resource);
        Self { language, bundle }
    }

    /// The language.
    pub fn language(&self) -> Language {
        self.language
    }

    /// Whether there is a sentence of `key`.
    pub fn has(&self, key: &str) -> bool {
        self.bundle.get_message(key).is_some_and(|message| message.value().is_some())
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

/// The keys of a Fluent file's text; what is wrong with it, if it can't be parsed.
#[cfg(test)]
pub fn keys(source: &str) -> std::collections::BTreeSet<String> {
    let resource = FluentResource::try_new(source.to_owned());
    assert!(resource.is_ok(), "{:?}", resource.err().map(|(_, errors)| errors));
    let lines = source.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_lowercase()));
    lines.filter_map(|line| Some(line.split_once(" =")?.0.to_owned())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "no-length = none\nunknown = unknown\nvolume-of = { $mask } has a volume of { $volume }.\n";

    #[test]
    fn numbers_follow_the_language() {
        let [en, de] = [Language::En, Language::De].map(|language| Words::new(language, TEXT));
        assert_eq!([en.ml(12.345), de.ml(12.345)], ["12.35 ml", "12,35 ml"]);
        assert_eq!([en.signed_percent(4.0, 5.0), de.signed_percent(4.0, 3.0)], ["+25.0 %", "\u{2212}25,0 %"]);
        assert_eq!(en.signed_percent(0.0, 3.0), "unknown");
        assert_eq!([en.mm(Some(2.25)), de.mm(None)], ["2.2 mm", "none"]);
    }

    #[test]
    fn sentences_take_their_variables() {
        let words = Words::new(Language::En, TEXT);
        assert_eq!(
            words.with("volume-of", &[("mask", "T1".into()), ("volume", "3 ml".into())]),
            "T1 has a volume of 3 ml."
        );
        assert_eq!(words.get("nothing of the kind"), "nothing of the kind");
    }
}
