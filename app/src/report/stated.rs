//! What the reader stated for the response, as a table: what, of which scan, and by whom.

use glioscope_core::response::{
    History, Measurement, PROGRAM, Part, Repeatability, ScanFacts, Stated, TrialNumber, TrialValue,
};
use serde::Serialize;
use serde_json::Value;
use strum::VariantArray;

use super::{
    document::{Block, Table},
    identity::Redactor,
};
use crate::words::Words;

/// Facts of a scan, by their keys in a history, and their units.
const SCAN: [(&str, &str); 10] = [
    ("new_lesion", ""),
    ("new_lesions_looked_for", ""),
    ("non_target", ""),
    ("flair", ""),
    ("clinical", ""),
    ("steroids_mg", " mg"),
    ("steroids_reason", ""),
    ("technique_changed", ""),
    ("field", ""),
    ("histology", ""),
];

/// The table, where anything is stated. Authors only where the patient is named, too.
pub fn blocks(history: &History, words: &Words, redactor: &Redactor, is_named: bool) -> Vec<Block> {
    let mut rows = Rows { words, rows: Vec::new() };
    let facts = value(history);
    for key in ["baseline", "disease", "radiotherapy_end"] {
        rows.fact(key, "", facts.get(key), "");
    }
    for key in ["targets", "non_targets"] {
        let of = if key == "targets" { &history.targets } else { &history.non_targets };
        let Some(of) = of else { continue };
        let names = if of.value.is_empty() { words.get("stated-none") } else { of.value.join(", ") };
        rows.row(key, "", Some(names), &by(&of.author, &of.entered));
    }
    match history.treatment.as_deref() {
        None => {}
        Some([]) => {
            let Stated { author, entered } = history.no_treatment_by.clone().unwrap_or_default();
            rows.row("treatment", "", Some(words.get("stated-none")), &by(&author, &entered));
        }
        Some(all) => {
            for treatment in all {
                let kind = rows.text(&value(&treatment.kind));
                let name = treatment.name.as_deref().map(|name| format!(", {name}")).unwrap_or_default();
                let by = by(&treatment.author, &treatment.entered);
                rows.row("treatment", "", Some(format!("{}: {kind}{name}", treatment.start)), &by);
            }
        }
    }
    for surgery in &history.surgery {
        let by = by(&surgery.author, &surgery.entered);
        let baseline = surgery.baseline.as_ref().map(|label| ("baseline", label.0.clone()));
        let targets = surgery.targets.as_ref().map(|all| ("targets", all.join(", ")));
        let then = [baseline, targets].into_iter().flatten();
        let then = then.map(|(key, text)| format!(", {}: {text}", words.get(&format!("stated-{key}"))));
        rows.row("surgery", "", Some(format!("{}{}", surgery.date, then.collect::<String>())), &by);
    }
    for number in TrialNumber::VARIANTS {
        let Some((value, source)) = number.of(&history.trial) else { continue };
        let value = words.number(&value.to_string());
        let key = format!("trial-{}", number.key());
        rows.row(&key, "", Some(format!("{value} ({source})")), "");
    }
    if let Some(TrialValue { value: parts, source }) = &history.trial.follow_2010 {
        let part =
            |part: &Part| words.get(&format!("stated-part-{}", value(part).as_str().unwrap_or_default()));
        let parts = parts.iter().map(part).collect::<Vec<_>>().join(", ");
        rows.row("trial-follow-2010", "", Some(format!("{parts} ({source})")), "");
    }
    let stated = &history.repeatability;
    for (key, stated) in
        [("product", &stated.product), ("longest", &stated.longest), ("volume", &stated.volume)]
    {
        let Some(Repeatability { relative_sd, source }) = stated else { continue };
        let percent = words.percent(*relative_sd);
        rows.row(&format!("repeatability-{key}"), "", Some(format!("{percent} ({source})")), "");
    }
    for one in &history.measurement {
        rows.row("measurement", &one.date.0, Some(measured(one, words)), "");
    }
    // In the order of the dates, not of the answers.
    let mut of_scans: Vec<&ScanFacts> = history.date.iter().collect();
    of_scans.sort_by(|a, b| (a.days, &a.date).cmp(&(b.days, &b.date)));
    for facts in of_scans {
        let of = value(facts);
        for (key, unit) in SCAN {
            rows.fact(key, &facts.date.0, of.get(key), unit);
        }
    }
    if rows.rows.is_empty() {
        return Vec::new();
    }
    let columns = if is_named { 3 } else { 2 };
    let mut rows = grouped(&rows.rows, is_named, words);
    for row in &mut rows {
        row.truncate(columns);
        for cell in row.iter_mut() {
            *cell = redactor.text(cell);
        }
    }
    let head = ["stated-scan", "stated-that", "stated-by"].map(|key| words.get(key));
    vec![
        Block::Heading(words.get("section-stated")),
        Block::Table(Table { head: head[..columns].to_vec(), text_columns: columns, rows, note: None }),
    ]
}

/// A lesion that was measured by hand: `A, 20 × 10 mm, 1.5 ml`.
fn measured(one: &Measurement, words: &Words) -> String {
    let diameters = match (one.longest_mm, one.perpendicular_mm) {
        (Some(longest), Some(perpendicular)) => Some(format!("{longest} × {perpendicular} mm")),
        (longest, perpendicular) => longest.or(perpendicular).map(|mm| format!("{mm} mm")),
    };
    let sizes = [
        one.gone.then(|| words.get("stated-gone")),
        diameters.map(|text| words.number(&text)),
        one.product_mm2.map(|mm2| words.number(&format!("{mm2} mm²"))),
        one.volume_ml.map(|ml| words.number(&format!("{ml} ml"))),
    ];
    let all = std::iter::once(one.lesion.clone()).chain(sizes.into_iter().flatten());
    all.collect::<Vec<_>>().join(", ")
}

/// Who stated it, and when.
pub(super) fn by(author: &Option<String>, entered: &Option<String>) -> String {
    [author, entered].into_iter().flatten().map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// A fact: what, of which scan, what of it, and by whom.
type Line = [String; 4];

/// A row for what was stated of a scan, or of the patient; where authors are shown, by one of them on a day.
fn grouped(all: &[Line], is_named: bool, words: &Words) -> Vec<Vec<String>> {
    let mut rows: Vec<[String; 3]> = Vec::new();
    for [what, scan, stated, by] in all {
        let scan = if scan.is_empty() { words.get("patient") } else { scan.clone() };
        let said = format!("{what}: {stated}");
        let same = rows.iter_mut().find(|row| row[0] == scan && (!is_named || row[2] == *by));
        match same {
            Some(row) => row[1] = format!("{}; {said}", row[1]),
            None => rows.push([scan, said, by.clone()]),
        }
    }
    rows.into_iter().map(Vec::from).collect()
}

struct Rows<'a> {
    words: &'a Words,
    rows: Vec<Line>,
}

impl Rows<'_> {
    /// A row for a fact, which is a value or one with author and day.
    fn fact(&mut self, key: &str, scan: &str, fact: Option<&Value>, unit: &str) {
        let Some(fact) = fact.filter(|fact| !fact.is_null()) else { return };
        let part = |name: &str| fact.get(name).and_then(Value::as_str);
        let stated = self.text(fact.get("value").unwrap_or(fact)) + unit;
        // What the program proposed nobody has stated; the calls' table says so.
        if part("author") == Some(PROGRAM) {
            return;
        }
        let by: Vec<&str> = ["author", "entered"].into_iter().filter_map(part).collect();
        self.row(key, scan, Some(stated), &by.join(", "));
    }

    fn row(&mut self, key: &str, scan: &str, stated: Option<String>, by: &str) {
        let Some(stated) = stated else { return };
        let what = self.words.get(&format!("stated-{}", key.replace('_', "-")));
        self.rows.push([what, scan.to_owned(), stated, by.to_owned()]);
    }

    /// A value in words: one of a choice by its name, several with commas, dates and labels as they are.
    fn text(&self, value: &Value) -> String {
        match value {
            Value::String(text) => {
                let key = format!("stated-{text}");
                let known = self.words.get(&key);
                if known == key { text.clone() } else { known }
            }
            Value::Array(all) if all.is_empty() => self.words.get("stated-nothing"),
            Value::Array(all) => all.iter().map(|one| self.text(one)).collect::<Vec<_>>().join(", "),
            Value::Bool(yes) => self.words.get(if *yes { "stated-yes" } else { "stated-no" }),
            Value::Number(number) => {
                let whole = number.as_f64().filter(|n| n.fract() == 0.0 && n.abs() < 1e15);
                self.words.number(&whole.map_or_else(|| number.to_string(), |n| format!("{n:.0}")))
            }
            _ => String::new(),
        }
    }
}

/// A value of plain fields, which always has JSON.
fn value(of: &impl Serialize) -> Value {
    serde_json::to_value(of).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use glioscope_core::response::{Fact, Label};

    use super::*;
    use crate::{report::sentences::words, words::Language};

    /// Every choice that a history knows, as TOML.
    const CHOICES: [(&str, &[&str]); 8] = [
        ("new_lesion", &["none", "equivocal", "measurable", "non-measurable"]),
        ("non_target", &["none", "gone", "not-worse", "worse"]),
        ("flair", &["not-worse", "worse"]),
        ("clinical", &["stable", "better", "worse", "much-worse"]),
        ("steroids_reason", &["tumour", "other"]),
        ("field", &["inside", "outside"]),
        ("histology", &["not-done", "tumour", "treatment-effect"]),
        ("technique_changed", &["sequence", "contrast", "slice-thickness"]),
    ];

    fn history(head: &str, date: &str) -> History {
        let text =
            format!("response = 1\ncriterion = \"rano-2010\"\n{head}\n[[date]]\ndate = 2024-01-01\n{date}\n");
        History::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    fn cells(history: &History, language: Language, is_named: bool) -> Vec<Vec<String>> {
        let words = words(language);
        let found = blocks(history, &words, &Redactor::nothing(), is_named);
        found
            .into_iter()
            .find_map(|block| match block {
                Block::Table(table) => Some(table.rows),
                _ => None,
            })
            .unwrap_or_default()
    }

    #[test]
    fn every_choice_has_its_words_in_every_language() {
        for language in [Language::En, Language::De] {
            for (key, all) in CHOICES {
                for choice in all {
                    let is_list = key == "technique_changed";
                    let stated = if is_list { format!("[\"{choice}\"]") } else { format!("\"{choice}\"") };
                    let rows = cells(&history("", &format!("{key} = {stated}")), language, false);
                    assert_eq!(rows.len(), 1, "{key} {choice}");
                    assert!(!rows[0].iter().any(|cell| cell.contains("stated-")), "{language:?}: {rows:?}");
                    let known = words(language).get(&format!("stated-{choice}"));
                    assert!(rows[0][1].ends_with(&format!(": {known}")), "{rows:?}");
                }
            }
        }
    }

    #[test]
    fn facts_stand_with_scan_and_where_the_patient_is_named_with_author() {
        let of = history(
            "baseline = { value = \"2024-01-01\", author = \"A. B.\", entered = 2024-05-01 }\nradiotherapy_end = \"none\"\ntreatment = []",
            "steroids_mg = 4\nnew_lesions_looked_for = true",
        );
        let rows = cells(&of, Language::De, true);
        assert_eq!(rows[0], ["Patient", "Ausgangsbefund: 2024-01-01", "A. B., 2024-05-01"]);
        // What has another author, or none, stands in another row.
        assert_eq!(rows[1][1].matches(": keine").count(), 2, "{rows:?}");
        assert_eq!(rows[1][2], "");
        assert!(rows[2][1].contains(": 4 mg") && rows[2][1].contains(": ja"), "{rows:?}");
        assert_eq!(rows.len(), 3, "{rows:?}");
        let unnamed = cells(&of, Language::En, false).concat();
        assert_eq!(unnamed.len(), 4, "a row for the patient, and one for the scan: {unnamed:?}");
        assert!(!unnamed.iter().any(|cell| cell.contains("A. B.")), "{unnamed:?}");
        assert_eq!(cells(&history("", ""), Language::En, true), Vec::<Vec<String>>::new());
    }

    #[test]
    fn treatments_have_an_author_and_a_proposed_baseline_is_not_stated() {
        let treatment =
            "treatment = [{ start = 2024-02-05, kind = \"drug\", author = \"C. D.\", entered = 2024-05-01 }]";
        let mut of = history(treatment, "");
        of.baseline = Some(Fact::proposed(Label("2024-01-01".into())));
        let rows = cells(&of, Language::En, true);
        assert_eq!(rows, [["Patient", "Treatment: 2024-02-05: drug", "C. D., 2024-05-01"]]);
        let unnamed = cells(&of.without_authors(), Language::En, false).concat();
        assert_eq!(unnamed, ["Patient", "Treatment: 2024-02-05: drug"]);
    }

    #[test]
    fn a_trials_numbers_what_follows_surgery_and_what_was_measured_by_hand_are_said() {
        let of = history(
            "surgery = [{ date = 2024-01-05, baseline = \"2024-02-01\", targets = [\"A\", \"B\"] }]\n\
             trial = { max_targets = { value = 5, source = \"protocol 6\" }, \
             follow_2010 = { value = [\"non-target\", \"clinical\"], source = \"protocol 7\" } }\n\
             repeatability = { volume = { relative_sd = 0.1, source = \"own phantom\" } }\n\
             measurement = [{ date = 2024-01-01, lesion = \"C\", compartment = \"enhancing\", longest_mm = 20.5, \
             perpendicular_mm = 10 }, { date = 2024-02-01, lesion = \"C\", compartment = \"enhancing\", gone = true }]",
            "",
        );
        let rows = cells(&of, Language::De, false);
        let patient = &rows[0][1];
        for said in [
            "2024-01-05, Ausgangsbefund: 2024-02-01, Zielläsionen: A, B",
            "5 (protocol 6)",
            "10,0 % (own phantom)",
            "Nichtzielläsionen, klinischer Zustand (protocol 7)",
        ] {
            assert!(patient.contains(said), "{said}: {patient}");
        }
        assert!(!patient.contains("stated-"), "{patient}");
        assert!(rows[1][1].ends_with("C, 20,5 × 10 mm"), "{rows:?}");
        assert!(rows[2][1].ends_with("C, verschwunden"), "{rows:?}");
        let english = cells(&of, Language::En, false);
        assert!(
            english[0][1].contains("lesions that aren't targets, clinical state (protocol 7)"),
            "{english:?}"
        );
    }

    #[test]
    fn targets_surgery_and_no_treatment_have_authors() {
        let of = history(
            "targets = { value = [\"A\"], author = \"A. B.\", entered = 2024-05-01 }\ntreatment = []\n\
             no_treatment_by = { author = \"C. D.\" }\nsurgery = [{ date = 2024-01-05, author = \"E. F.\" }]",
            "",
        );
        let rows = cells(&of, Language::En, true);
        assert_eq!(rows[0], ["Patient", "Targets: A", "A. B., 2024-05-01"]);
        assert_eq!(rows[1], ["Patient", "Treatment: none", "C. D."]);
        assert_eq!(rows[2], ["Patient", "Surgery: 2024-01-05", "E. F."]);
    }
}
