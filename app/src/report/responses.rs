//! Response by criteria: the calls with their reasons.

use std::collections::BTreeMap;

use glioscope_core::{
    case::Case,
    lesions::{LesionsReport, new_lesions},
    phrase::Phrase,
    response::{
        BtRads, BtRadsCategory, Call, DateResponse, Evaluated, Fact, Judgement, Response, SumReport,
        bt_rads as form, bt_rads_answered, unstated_new,
    },
};

use super::{
    document::{Block, Finding, Table},
    identity::Redactor,
    sentences::{beside_sums, phrase},
    stated::by as said_by,
};
use crate::{
    model::ResponseSetting,
    words::{Language, Words},
};

/// The calls at all dates, and why at the last: for the front. `of_two_scans`: the table that has the calls and the sums, in place of one of
/// the calls alone.
pub fn blocks(
    evaluated: &Evaluated,
    lesions: Option<&LesionsReport>,
    of_two_scans: Option<Table>,
    words: &Words,
    redactor: &Redactor,
) -> Vec<Block> {
    let Evaluated { response, proposed_links, .. } = evaluated;
    let criteria = ("criteria", response.criterion.name().to_owned());
    let has_sums = of_two_scans.is_some();
    let mut table = of_two_scans.unwrap_or_else(|| calls(response, words));
    let mut notes = vec![words.get("response-caution")];
    if !has_sums {
        notes.push(words.get("sums-of-targets"));
    }
    if evaluated.stated.baseline.as_ref().is_none_or(Fact::is_proposed) {
        // What the reader states stands below.
        notes.extend(response.dates.iter().filter_map(|date| how_baseline_was_chosen(date, words)));
    }
    notes.extend(table.note.take());
    table.note = Some(notes.join(" "));
    let mut blocks = vec![
        Block::Heading(words.with("section-response", std::slice::from_ref(&criteria))),
        Block::Table(table),
    ];
    let warning = |text: String| Finding { is_warning: true, text };
    // What contradicts the masks stands in front of the report, just above.
    let mut doubts: Vec<Finding> = Vec::new();
    let unstated = lesions.map(|report| unstated_new(report, &evaluated.stated)).unwrap_or_default();
    for date in unstated {
        doubts.push(warning(words.with("new-unstated", &[("date", date.to_owned())])));
    }
    if *proposed_links > 0 {
        doubts.push(warning(words.with("lesions-links", &[("count", proposed_links.to_string())])));
    }
    if let Some(date) = response.dates.last() {
        let ([of_diameters, of_volume], mut missing) = why(date, has_sums, words, redactor);
        // The calls themselves stand in the table above.
        let named = [("by-diameters", of_diameters), ("by-volume", of_volume)];
        let facts = named.into_iter().filter(|(_, reasons)| !reasons.is_empty());
        let facts: Vec<_> = facts.map(|(key, reasons)| (words.get(key), reasons.join("; "))).collect();
        if !facts.is_empty() {
            blocks.push(Block::Text(words.with("reasons-at", &[("date", date.date.clone())])));
            blocks.push(Block::Facts(facts));
        }
        doubts.append(&mut missing);
    }
    if !doubts.is_empty() {
        blocks.push(Block::Findings(doubts));
    }
    blocks
}

/// The calls at all dates with the changes of the sums.
fn calls(response: &Response, words: &Words) -> Table {
    let row = |date: &DateResponse| {
        let ways = [&date.by_diameters, &date.by_volume];
        // Of mixed disease each compartment has a sum, in the order of the tables of targets.
        let changes = |judgement: &Judgement, percent: fn(&SumReport) -> Option<f64>| {
            let all = judgement.sums.iter().filter_map(percent).map(|p| signed(p, words));
            all.collect::<Vec<_>>().join("; ")
        };
        let of: [fn(&SumReport) -> Option<f64>; 2] =
            [|sum| sum.change_from_baseline_percent, |sum| sum.change_from_nadir_percent];
        let changes = ways.map(|way| of.map(|percent| changes(way, percent)));
        (std::iter::once(date.date.clone()).chain(ways.map(|way| call(way, words))), changes)
    };
    let rows: Vec<_> = response.dates.iter().map(row).collect();
    // Where the baseline has the lowest sums, both changes are one.
    let are_one = rows.iter().all(|(_, changes)| changes.iter().all(|[baseline, lowest]| baseline == lowest));
    let of_changes = [["from-baseline", "from-nadir"], ["volume-from-baseline", "volume-from-nadir"]];
    let shown = if are_one { 1 } else { 2 };
    let head = ["date", "by-diameters", "by-volume"].into_iter();
    let head = head.chain(of_changes.iter().flat_map(|keys| &keys[..shown]).copied());
    let rows = rows.into_iter().map(|(said, changes)| {
        said.chain(changes.into_iter().flat_map(|of| of.into_iter().take(shown))).collect()
    });
    Table {
        head: head.map(|key| words.get(key)).collect(),
        text_columns: 3,
        rows: rows.collect(),
        note: None,
    }
}

/// Why a date is the baseline, as a sentence; `None` where it isn't.
fn how_baseline_was_chosen(date: &DateResponse, words: &Words) -> Option<String> {
    let judgement = Some(&date.by_diameters).filter(|judgement| judgement.call == Call::Baseline)?;
    let text = phrase(&judgement.reasons.first()?.phrase, words);
    let mut letters = text.chars();
    let first = letters.next()?;
    Some(format!("{}{}.", first.to_uppercase(), letters.as_str().trim_end_matches('.')))
}

/// Why at the dates before the last, and how the criteria are known.
pub fn earlier(evaluated: &Evaluated, words: &Words, redactor: &Redactor) -> Vec<Block> {
    let before = evaluated.response.dates.split_last().map_or(&[][..], |(_, before)| before);
    let said = before.iter().flat_map(|date| findings(date, words, redactor)).collect();
    vec![
        Block::Heading(words.get("section-reasons-earlier")),
        Block::Findings(said),
        Block::Text(words.get("response-note")),
    ]
}

/// Why a date's calls are as they are, by diameters, and by volume what isn't said of diameters; and what is doubtful or missing.
/// `has_sums`: beside their sums.
fn why(
    date: &DateResponse,
    has_sums: bool,
    words: &Words,
    redactor: &Redactor,
) -> ([Vec<String>; 2], Vec<Finding>) {
    let say = if has_sums { beside_sums } else { phrase };
    let [diameters, volume] =
        [&date.by_diameters, &date.by_volume].map(|judgement| reasons(judgement, say, words));
    let is_doubt = |(is_warning, _): &&(bool, String)| *is_warning;
    let text = |(_, text): &(bool, String)| redactor.text(text.trim_end_matches('.'));
    let others: Vec<(bool, String)> =
        volume.iter().filter(|reason| !diameters.contains(reason)).cloned().collect();
    let mut of_volume: Vec<String> = others.iter().filter(|r| !is_doubt(r)).map(text).collect();
    if volume.iter().any(|reason| diameters.contains(reason) && !reason.0) {
        of_volume.push(words.get("else-as-by-diameters"));
    }
    let of_diameters = diameters.iter().filter(|r| !is_doubt(r)).map(text).collect();
    let doubts =
        diameters.iter().map(|reason| (volume.contains(reason), "reason-by-diameters-alone", reason));
    let doubts = doubts.chain(others.iter().map(|reason| (false, "reason-by-volume-alone", reason)));
    let doubts = doubts.filter(|(.., reason)| is_doubt(reason)).map(|(is_of_both, key, (_, text))| {
        let text = if is_of_both { text.clone() } else { words.with(key, &[("reason", text.clone())]) };
        Finding { is_warning: true, text: redactor.text(&text) }
    });
    let doubts = doubts.collect();
    ([of_diameters, of_volume], doubts)
}

/// Why a date's calls are as they are, each with its date; with the way of measuring where it is true of one alone.
fn findings(date: &DateResponse, words: &Words, redactor: &Redactor) -> Vec<Finding> {
    let [diameters, volume] =
        [&date.by_diameters, &date.by_volume].map(|judgement| reasons(judgement, phrase, words));
    let of_diameters = diameters.iter().map(|reason| {
        let key = if volume.contains(reason) { "reason-of-date" } else { "reason-by-diameters" };
        (key, reason)
    });
    let of_volume = volume.iter().filter(|reason| !diameters.contains(reason));
    let all = of_diameters.chain(of_volume.map(|reason| ("reason-by-volume", reason)));
    all.map(|(key, (is_warning, text))| {
        let variables = [("date", date.date.clone()), ("reason", text.clone())];
        Finding { is_warning: *is_warning, text: redactor.text(&words.with(key, &variables)) }
    })
    .collect()
}

/// The calls of the last date in a sentence; `None` without dates.
pub fn sentence(evaluated: &Evaluated, words: &Words) -> Option<String> {
    let date = evaluated.response.dates.last()?;
    let with_changes = |judgement: &Judgement| {
        let sum = judgement.sums.first();
        let changes = sum.and_then(|sum| sum.change_from_baseline_percent.zip(sum.change_from_nadir_percent));
        let Some((baseline, nadir)) = changes.map(|(a, b)| (signed(a, words), signed(b, words))) else {
            return String::new();
        };
        let key = if baseline == nadir { "conclusion-change" } else { "conclusion-changes" };
        format!(" ({})", words.with(key, &[("baseline", baseline), ("nadir", nadir)]))
    };
    let variables = [
        ("date", date.date.clone()),
        ("criteria", evaluated.response.criterion.name().to_owned()),
        ("diameters", call(&date.by_diameters, words)),
        ("diameters-change", with_changes(&date.by_diameters)),
        ("volume", call(&date.by_volume, words)),
        ("volume-change", with_changes(&date.by_volume)),
    ];
    Some(words.with("conclusion-calls", &variables))
}

/// The lesions that are new at the last date, in a sentence; `None` without any.
pub fn new_in_words(report: &LesionsReport, words: &Words) -> Option<String> {
    let last = report.dates.last()?;
    let all = new_lesions(report).filter(|(_, date)| date.time == last.time).map(|(name, date)| {
        let mut parts = vec![words.ml(date.volume_ml.unwrap_or(f64::NAN))];
        if let (Some(d1), Some(d2)) = (date.d1_mm, date.d2_mm) {
            parts.push(words.number(&format!("{d1:.1} × {d2:.1} mm")));
        }
        if date.measurable == Some(false) {
            parts.push(words.get("not-measurable"));
        }
        format!("{name} ({})", parts.join(", "))
    });
    let all: Vec<String> = all.collect();
    (!all.is_empty()).then(|| words.with("conclusion-new", &[("lesions", all.join(", "))]))
}

/// A change in percent with its sign.
pub(super) fn signed(percent: f64, words: &Words) -> String {
    words.number(&format!("{percent:+.1} %")).replace('-', "\u{2212}")
}

/// What the form of BT-RADS gives at the dates at which its questions are answered to the end. Who answered them only where the patient
/// is named, too.
pub fn bt_rads(case: &Case, setting: &ResponseSetting, words: &Words, is_named: bool) -> Vec<Block> {
    let category = |time: &str| {
        let answers = setting.bt_rads.get(time)?;
        match form(answers) {
            Ok(BtRads::Result { category, reason, .. }) => {
                let by = setting.bt_rads_by.get(time).filter(|_| is_named);
                let by = by.map(|by| said_by(&by.author, &by.entered)).filter(|by| !by.is_empty());
                let by = by.map(|by| format!(" ({by})")).unwrap_or_default();
                Some((time.to_owned(), category_words(&category, &reason, answers, words) + &by))
            }
            _ => None,
        }
    };
    let all: Vec<(String, String)> = case.time_labels().into_iter().filter_map(category).collect();
    if all.is_empty() {
        return Vec::new();
    }
    vec![
        Block::Heading(words.get("section-bt-rads")),
        Block::Facts(all),
        Block::Text(words.get("bt-rads-note")),
    ]
}

/// A category of BT-RADS with its meaning and the answers that led to it.
fn category_words(
    category: &BtRadsCategory,
    reason: &str,
    answers: &BTreeMap<String, String>,
    words: &Words,
) -> String {
    if words.language() == Language::En {
        return format!("{}: {}. {reason}", category.id, category.meaning);
    }
    let answered = bt_rads_answered(answers);
    let answered = answered.iter().map(|(question, answer)| {
        let asked = words.get(&format!("bt-rads-question-{}", question.id));
        format!("{asked} {}", words.get(&format!("bt-rads-answer-{}-{}", question.id, answer.id)))
    });
    let meaning = words.get(&format!("bt-rads-category-{}", category.id));
    format!("{}: {meaning}. {}", category.id, answered.collect::<Vec<_>>().join("; "))
}

pub(super) fn call(judgement: &Judgement, words: &Words) -> String {
    let call = words.get(&format!("call-{}", judgement.call.short().replace([' ', ','], "-")));
    if judgement.imaging_only { format!("{call} ({})", words.get("imaging-only")) } else { call }
}

/// Why the call is as it is, and what is missing for another: the latter as warnings.
fn reasons(judgement: &Judgement, say: fn(&Phrase, &Words) -> String, words: &Words) -> Vec<(bool, String)> {
    let mut out: Vec<(bool, String)> =
        judgement.reasons.iter().map(|reason| (false, say(&reason.phrase, words))).collect();
    let confirmation = judgement.confirmation.iter();
    out.extend(confirmation.map(|confirmation| (false, phrase(&confirmation.phrase, words))));
    for sum in &judgement.sums {
        for margin in [&sum.margin_from_baseline, &sum.margin_from_nadir].into_iter().flatten() {
            let (is_doubtful, key) = match margin.straddles_percent.is_empty() {
                true => (false, "margin"),
                false => (true, "within-margin"),
            };
            let percent = |p: f64| words.number(&format!("{p:+.0} %"));
            let variables = [
                ("low", percent(margin.low_percent)),
                ("high", percent(margin.high_percent)),
                ("source", margin.source.clone()),
            ];
            out.push((is_doubtful, words.with(key, &variables)));
        }
        out.extend(sum.noise_alone.map(|noise| {
            let noise = words.number(&format!("{:.1} %", noise * 100.0));
            (false, words.with("noise-alone", &[("noise", noise)]))
        }));
    }
    out.extend(judgement.to_state().map(|missing| {
        let date = missing.date.as_ref().map(|date| format!(", {date}")).unwrap_or_default();
        let assumed = missing.assumption.as_ref();
        let assumed =
            assumed.map(|assumed| format!(" ({}: {})", words.get("assumed"), phrase(assumed, words)));
        let what = format!("{}{date}{}", phrase(&missing.phrase, words), assumed.unwrap_or_default());
        (true, words.with("missing", &[("what", what)]))
    }));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sentences::words;

    #[test]
    fn every_call_has_its_words_in_every_language() {
        let all = [
            Call::Baseline,
            Call::BeforeBaseline,
            Call::CompleteResponse,
            Call::UnconfirmedCompleteResponse,
            Call::PartialResponse,
            Call::UnconfirmedPartialResponse,
            Call::MinorResponse,
            Call::UnconfirmedMinorResponse,
            Call::StableDisease,
            Call::Progression,
            Call::PreliminaryProgression,
            Call::Observe,
            Call::CannotSay,
        ];
        for language in [Language::En, Language::De] {
            let words = words(language);
            for call in all {
                let key = format!("call-{}", call.short().replace([' ', ','], "-"));
                assert_ne!(words.get(&key), key, "{language:?}");
            }
        }
    }

    /// All ways through the form, as answers by questions.
    fn ways(answers: &BTreeMap<String, String>) -> Vec<BTreeMap<String, String>> {
        match form(answers).unwrap() {
            BtRads::Result { .. } => vec![answers.clone()],
            BtRads::Next(question) => {
                let given = question.answers.iter();
                given
                    .flat_map(|answer| {
                        let mut answers = answers.clone();
                        answers.insert(question.id.to_owned(), answer.id.to_owned());
                        ways(&answers)
                    })
                    .collect()
            }
        }
    }

    #[test]
    fn bt_rads_is_german_on_every_way_through_the_form() {
        let [en, de] = [Language::En, Language::De].map(words);
        let all = ways(&BTreeMap::new());
        assert!(all.len() > 8);
        for answers in all {
            let BtRads::Result { category, reason, .. } = form(&answers).unwrap() else { panic!() };
            let english = category_words(&category, &reason, &answers, &en);
            assert_eq!(english, format!("{}: {}. {reason}", category.id, category.meaning));
            let said = category_words(&category, &reason, &answers, &de);
            assert!(!said.contains("bt-rads-"), "{said}");
            assert_eq!(said.matches("; ").count(), english.matches("; ").count(), "{said}");
            let asked = bt_rads_answered(&answers);
            assert!(!asked.iter().any(|(question, _)| said.contains(question.text)), "{said}");
        }
    }
}
