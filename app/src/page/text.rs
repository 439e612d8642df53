//! The page's words: the default ones, and those that a doctor edited.

use std::fmt::Write as _;

use super::{
    Date, Page,
    compare::{self, Change, SAME_SHARE},
};
use crate::words::Words;

/// A part of the text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Paragraph {
    /// A heading.
    Heading(String),
    /// Plain text.
    Text(String),
}

/// Paragraphs of a plain text: separated by empty lines; a line that begins with `#` is a heading. Everything else is shown as
/// it stands.
pub fn parse(text: &str) -> Vec<Paragraph> {
    let mut out = Vec::new();
    let mut open: Vec<&str> = Vec::new();
    let close = |open: &mut Vec<&str>, out: &mut Vec<Paragraph>| {
        if !open.is_empty() {
            out.push(Paragraph::Text(std::mem::take(open).join(" ")));
        }
    };
    for line in text.trim_start_matches('\u{feff}').lines().map(str::trim) {
        let heading = line.strip_prefix('#').map(|rest| rest.trim_start_matches('#').trim());
        if line.is_empty() || heading.is_some() {
            close(&mut open, &mut out);
            out.extend(heading.filter(|h| !h.is_empty()).map(|h| Paragraph::Heading(h.to_owned())));
        } else {
            open.push(line);
        }
    }
    close(&mut open, &mut out);
    out
}

/// The text of a page as [`parse`] reads it: what a doctor edits.
pub fn default_text(page: &Page, words: &Words) -> String {
    let mut out = String::new();
    for paragraph in paragraphs(page, words) {
        // Writing into a string can't fail.
        let _ = match paragraph {
            Paragraph::Heading(text) => write!(out, "# {text}\n\n"),
            Paragraph::Text(text) => write!(out, "{text}\n\n"),
        };
    }
    out
}

/// The default text.
pub(super) fn paragraphs(page: &Page, words: &Words) -> Vec<Paragraph> {
    let mut out = Vec::new();
    let mut section = |heading: &str, texts: Vec<String>| {
        if !texts.is_empty() {
            out.push(Paragraph::Heading(words.get(heading)));
            out.extend(texts.into_iter().map(Paragraph::Text));
        }
    };
    let count = page.masks.len();
    let mut shown = vec![words.get("text-shown")];
    if page.head.is_some() {
        shown.push(words.get("text-around"));
    }
    let mut shown = vec![shown.join(" ")];
    if count > 1 {
        shown.push(words.with("text-agreement", &[("count", count.to_string())]));
    }
    section("heading-shown", shown);
    section("heading-size", page.dates.last().map(|date| sizes(date, words)).unwrap_or_default());
    section("heading-change", changes(page, words));
    section("heading-not-said", vec![words.get("text-not-said")]);
    out
}

fn sizes(date: &Date, words: &Words) -> Vec<String> {
    let mut volumes: Vec<f64> = date.masks.iter().flatten().map(|m| m.volume_ml).collect();
    volumes.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (volumes.first(), volumes.last()) else { return Vec::new() };
    let mut text =
        if volumes.len() == 1 { size_of_one(*most, words) } else { size_range(*least, *most, words) };
    if let Some(level) = date.levels.last() {
        let _ = write!(text, " {}", shared(level.volume_ml, words));
    }
    let _ = write!(text, " {}", words.get("text-millilitre"));
    vec![text]
}

/// How large the only outline is.
pub(super) fn size_of_one(volume_ml: f64, words: &Words) -> String {
    words.with("text-size-one", &[("size", size(volume_ml, words))])
}

/// How large outlines are, from the smallest to the largest.
pub(super) fn size_range(least_ml: f64, most_ml: f64, words: &Words) -> String {
    words.with("text-size-range", &[("least", size(least_ml, words)), ("most", size(most_ml, words))])
}

/// What all outlines have in common.
pub(super) fn shared(volume_ml: f64, words: &Words) -> String {
    words.with("text-size-shared", &[("size", ml(volume_ml, words))])
}

/// What changed from the date before the last.
fn changes(page: &Page, words: &Words) -> Vec<String> {
    let [.., before, after] = page.dates.as_slice() else { return Vec::new() };
    if !page.is_ordered {
        return vec![words.get("text-no-order")];
    }
    let number = page.dates.len();
    let names = [date_name(before, number - 2, words), date_name(after, number - 1, words)];
    let mut texts = Vec::new();
    for (n, (a, b)) in before.masks.iter().zip(&after.masks).enumerate() {
        let Some((a, b)) = a.as_ref().zip(b.as_ref()) else { continue };
        texts.push(change(&mask_name(page, n, words), a.volume_ml, b.volume_ml, words));
    }
    if texts.is_empty() {
        return texts;
    }
    let [from, to] = names;
    texts.insert(0, words.with("text-change-dates", &[("from", from), ("to", to)]));
    let rule = words.with("text-change-rule", &[("percent", format!("{:.0}", SAME_SHARE * 100.0))]);
    vec![texts.join(" "), rule]
}

/// What became of an outline.
pub(super) fn change(name: &str, before_ml: f64, after_ml: f64, words: &Words) -> String {
    let difference = after_ml - before_ml;
    let known = Change::between(before_ml, after_ml);
    let key = known.map_or("change-unknown", Change::key);
    let more = if difference < 0.0 { "less" } else { "more" };
    let difference = words.with(more, &[("size", ml(difference.abs(), words))]);
    let variables = [
        ("name", name.to_owned()),
        ("before", ml(before_ml, words)),
        ("after", ml(after_ml, words)),
        ("word", words.get(key)),
        ("difference", difference),
    ];
    words.with("text-change", &variables)
}

/// A volume with what it is like: `5.2 ml, about as large as a cherry (about 2.2 cm across)`.
pub(super) fn size(volume_ml: f64, words: &Words) -> String {
    let volume = ml(volume_ml, words);
    match compare::nearest(volume_ml) {
        Some(object) => {
            let across = words.number(&format!("{:.1}", object.diameter_mm / 10.0));
            words.with("size", &[("volume", volume), ("object", words.get(object.key)), ("across", across)])
        }
        None if volume_ml > 0.0 => words.with("size-beyond", &[("volume", volume)]),
        None => words.get("size-none"),
    }
}

/// A volume in millilitres with as many digits as matter at home.
pub(super) fn ml(volume_ml: f64, words: &Words) -> String {
    let digits = match volume_ml.abs() {
        v if v >= 99.95 => 0,
        v if v >= 0.995 => 1,
        _ => 2,
    };
    if volume_ml > 0.0 && volume_ml < 0.005 {
        return words.with("millilitres-below", &[("number", words.number("0.01"))]);
    }
    words.with("millilitres", &[("number", words.number(&format!("{volume_ml:.digits$}")))])
}

/// The name of a mask.
pub(super) fn mask_name(page: &Page, n: usize, words: &Words) -> String {
    let name = page.masks.get(n).map(|mask| mask.name.trim()).unwrap_or_default();
    if !name.is_empty() {
        return name.to_owned();
    }
    if page.masks.len() == 1 {
        return words.get("outline-only");
    }
    words.with("outline", &[("number", (n + 1).to_string())])
}

/// The name of a date.
pub(super) fn date_name(date: &Date, n: usize, words: &Words) -> String {
    date.label.clone().unwrap_or_else(|| words.with("scan", &[("number", (n + 1).to_string())]))
}

/// The name of what at least `count` of `of` masks hold.
pub(super) fn level_name(count: usize, of: usize, words: &Words) -> String {
    match count {
        1 => words.get("level-any"),
        c if c == of => words.with("level-all", &[("of", of.to_string())]),
        c => words.with("level-some", &[("count", c.to_string()), ("of", of.to_string())]),
    }
}
