//! The sentences of reports.

use glioscope_core::{
    Check,
    phrase::{Phrase, Say, Template},
};

use crate::words::{Language, Words};

/// What core says in English: reasons of response calls, BT-RADS; and findings by their codes.
const CORE_DE: [&str; 2] = [include_str!("words/response-de.ftl"), include_str!("words/findings-de.ftl")];

/// Those of `language`.
pub fn words(language: Language) -> Words {
    let more: &[&str] = if language == Language::De { &CORE_DE } else { &[] };
    Words::new(language, &[&[source(language)], more].concat().join("\n"))
}

fn source(language: Language) -> &'static str {
    match language {
        Language::En => include_str!("words/en.ftl"),
        Language::De => include_str!("words/de.ftl"),
    }
}

/// Says phrases by the sentences of a language.
struct Spoken<'a> {
    words: &'a Words,
    /// Without the sums, which stand beside it.
    beside_sums: bool,
}

impl Spoken<'_> {
    /// The sentence that is said beside the sums, where there is another.
    fn beside_sums(&self, template: &Template, values: &[(&str, String)]) -> Option<String> {
        let key = format!("beside-sums-{}", template.key());
        if !self.beside_sums || !self.words.has(&key) {
            return None;
        }
        let said = self.words.with(&key, values);
        let said = said.trim_start_matches(", ");
        (!said.is_empty()).then(|| said.to_owned())
    }
}

impl Say for Spoken<'_> {
    fn template(&self, template: &Template, values: &[(&str, String)]) -> String {
        if let Some(said) = self.beside_sums(template, values) {
            return said;
        }
        match self.words.language() {
            Language::En => template.in_english(values),
            Language::De => self.words.with(&key(template), values),
        }
    }

    fn number(&self, english: &str) -> String {
        match self.words.language() {
            Language::En => english.to_owned(),
            Language::De => self.words.number(english),
        }
    }
}

/// The key of a template's sentence.
fn key(template: &Template) -> String {
    format!("reason-{}", template.key())
}

/// A phrase of core in the language of `words`.
pub fn phrase(phrase: &Phrase, words: &Words) -> String {
    with_minus(&phrase.say(&Spoken { words, beside_sums: false }))
}

/// As [`phrase`], of a reason that stands below the sums it rests on.
pub fn beside_sums(phrase: &Phrase, words: &Words) -> String {
    with_minus(&phrase.say(&Spoken { words, beside_sums: true }))
}

/// With the minus of tables in front of numbers: not within a date or a range.
fn with_minus(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = None;
    for (at, letter) in text.char_indices() {
        let is_number = text[at + letter.len_utf8()..].starts_with(|next: char| next.is_ascii_digit());
        let is_sign =
            letter == '-' && is_number && before.is_none_or(|c: char| c.is_whitespace() || c == '(');
        out.push(if is_sign { '\u{2212}' } else { letter });
        before = Some(letter);
    }
    out
}

/// A finding in the language of `words`: what its code means, with its particulars in parentheses, which are English.
pub fn finding(check: &Check, words: &Words) -> String {
    let key = format!("finding-{}", check.code);
    if words.language() == Language::En || !words.has(&key) {
        return check.message.clone();
    }
    words.with("finding", &[("what", words.get(&key)), ("detail", check.message.clone())])
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glioscope_core::{
        Severity,
        phrase::Value,
        response::{History, PHRASES, evaluate},
    };

    use super::*;
    use crate::words::keys;

    #[test]
    fn numbers_below_zero_have_the_minus_of_tables() {
        let of = "2024-01-05: -5.2 % (-3 to +2), threshold -50 %, 1-2 scans, T1-T2 -x";
        let expected = "2024-01-05: −5.2 % (−3 to +2), threshold −50 %, 1-2 scans, T1-T2 -x";
        assert_eq!(with_minus(of), expected);
    }

    #[test]
    fn every_language_has_every_sentence() {
        let [en, de] = [Language::En, Language::De].map(|language| keys(source(language)));
        assert_eq!(en, de);
        assert!(en.len() > 40, "{}", en.len());
    }

    /// The variables of a message that stands on one line, without the messages that it quotes.
    fn variables(line: &str) -> BTreeSet<&str> {
        let places = line.split("{ $").skip(1);
        places.filter_map(|rest| Some(rest.split_once(" }")?.0)).collect()
    }

    #[test]
    fn every_reason_has_a_german_sentence_with_the_same_variables() {
        let words = words(Language::De);
        let known = keys(CORE_DE[0]);
        for template in PHRASES {
            let key = key(template);
            assert!(known.contains(&key), "{key}");
            let line = CORE_DE[0].lines().find(|line| line.starts_with(&format!("{key} ="))).unwrap();
            assert_eq!(variables(line), template.places().collect(), "{key}");
            // With numbers as values, nothing but words of the language is left, and no place.
            let values: Vec<_> = template.places().map(|name| (name, Value::number(7))).collect();
            let said = phrase(&Phrase { template, values }, &words);
            assert!(!said.contains(['{', '}']) && !said.contains("reason-"), "{key}: {said}");
            let is_same = said == template.english && said.len() > 3;
            assert!(!is_same || template.english.chars().all(|c| !c.is_lowercase()), "{key}: {said}");
        }
        let reasons = known.iter().filter(|key| key.starts_with("reason-")).count();
        assert_eq!(reasons, PHRASES.len(), "a sentence of no template");
    }

    #[test]
    fn reasons_of_a_history_are_german_with_german_numbers() {
        let text = r#"
response = 1
criterion = "rano-2010"
baseline = 2024-01-01
radiotherapy_end = "none"
treatment = []
[[date]]
date = 2024-01-01
steroids_mg = 0
[[date]]
date = 2024-03-01
steroids_mg = { value = 1.5, author = "A. B." }
new_lesion = "none"
non_target = "none"
flair = "not-worse"
clinical = "stable"
[[measurement]]
date = 2024-01-01
lesion = "A"
compartment = "enhancing"
longest_mm = 20.5
perpendicular_mm = 10
slices = 3
slice_thickness_mm = 1
[[measurement]]
date = 2024-03-01
lesion = "A"
compartment = "enhancing"
longest_mm = 10
perpendicular_mm = 10
slices = 3
slice_thickness_mm = 1
"#;
        let response = evaluate(&History::parse(text).unwrap(), &[]).unwrap();
        let words = words(Language::De);
        let said: Vec<String> = response
            .dates
            .iter()
            .flat_map(|date| {
                let judgement = &date.by_diameters;
                let reasons = judgement.reasons.iter().map(|reason| &reason.phrase);
                let more = judgement.missing.iter().flat_map(|m| [Some(&m.phrase), m.assumption.as_ref()]);
                reasons.chain(more.flatten()).map(|it| phrase(it, &words)).collect::<Vec<_>>()
            })
            .collect();
        let all = said.join("\n");
        for expected in [
            "Ausgangsbefund 2024-01-01, wie in der Vorgeschichte angegeben",
            "100,0 mm², \u{2212}51,2 % gegenüber dem Ausgangsbefund",
            "1,5 mg (A. B.), beim Ausgangsbefund 0 mg",
        ] {
            assert!(all.contains(expected), "{expected}: {all}");
        }
        for english in ["the ", "baseline", "sum ", "lesion ", "worse"] {
            assert!(!all.contains(english), "{english}: {all}");
        }
    }

    #[test]
    fn every_finding_has_a_german_sentence() {
        let known = keys(CORE_DE[1]);
        let page = include_str!("../../../docs/checks.md");
        let codes: BTreeSet<String> = page
            .lines()
            .filter_map(|line| {
                let (code, rest) = line.strip_prefix("| `")?.split_once("` | ")?;
                (rest.starts_with("note") || rest.starts_with("warning")).then(|| format!("finding-{code}"))
            })
            .collect();
        assert!(codes.len() > 100, "{}", codes.len());
        let of_codes = known.iter().filter(|key| key.starts_with("finding-")).cloned();
        assert_eq!(of_codes.collect::<BTreeSet<_>>(), codes);
    }

    #[test]
    fn a_finding_says_what_it_is_and_keeps_its_particulars() {
        let check = Check { code: "mask-empty", severity: Severity::Warning, message: "T1: no voxel".into() };
        let [en, de] = [Language::En, Language::De].map(|language| finding(&check, &words(language)));
        assert_eq!(en, "T1: no voxel");
        assert_eq!(de, "Eine Maske ist leer. (T1: no voxel)");
        let other = Check { code: "unheard-of", ..check };
        assert_eq!(finding(&other, &words(Language::De)), "T1: no voxel");
    }
}
