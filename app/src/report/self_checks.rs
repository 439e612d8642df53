//! The check of the change on the case itself, as a section.

use glioscope_core::self_check::{Comes, LesionCheck, Recovered, SelfCheckReport, SurfaceCheck, Where};

use super::document::{Block, Table};
use crate::words::Words;

/// Beside what lies outside of what is good; said in the note.
const MARK: &str = " *";

/// The section; `mask` as the report calls it.
pub fn blocks(report: &SelfCheckReport, mask: &str, words: &Words) -> Vec<Block> {
    let unchanged = &report.unchanged;
    let counted = |count: usize, runs: usize, marked: bool| {
        let of = words.with("self-check-of", &[("count", count.to_string()), ("runs", runs.to_string())]);
        format!("{of}{}", if marked { MARK } else { "" })
    };
    let share = |recovered: Option<Recovered>| {
        recovered.map_or_else(String::new, |recovered| {
            let error = recovered.standard_error.map(|error| format!(" ± {error:.2}")).unwrap_or_default();
            let mark = if recovered.marked { MARK } else { "" };
            format!("{}{mark}", words.number(&format!("{:.2}{error}", recovered.share)))
        })
    };
    let nothing = [
        words.get("self-check-none"),
        String::new(),
        String::new(),
        String::new(),
        counted(unchanged.false_calls, unchanged.runs, unchanged.marked),
    ];
    let surface = |check: &SurfaceCheck| {
        let key = match check.at {
            Where::Evenly => "self-check-evenly",
            Where::OneSide => "self-check-one-side",
        };
        let mm = words.number(&format!("{:+} mm", check.known_mm)).replace('-', "\u{2212}");
        let called = counted(check.called, check.runs, false);
        [
            words.with(key, &[("mm", mm)]),
            share(check.surface),
            share(check.nearest),
            share(check.volume),
            called,
        ]
    };
    let lesion = |check: &LesionCheck| {
        let key = match check.comes {
            Comes::New => "self-check-new",
            Comes::Vanished => "self-check-vanished",
        };
        let found = counted(check.found, check.runs, check.marked);
        let what = words.with(key, &[("ml", words.ml(check.known_ml))]);
        [what, String::new(), String::new(), share(check.volume), found]
    };
    let moved = report.surfaces.iter().filter(|check| check.surface.is_some()).map(surface);
    let lesions = report.lesions.iter().filter(|check| check.runs > 0).map(lesion);
    let rows = std::iter::once(nothing).chain(moved).chain(lesions).map(Vec::from).collect();
    let facts = [("mask", mask.to_owned()), ("date", report.date.clone())];
    let how = if report.image.is_some() { "self-check-registered" } else { "self-check-no-image" };
    let notes = [words.with("self-check-note", &facts), words.get(how), words.get("self-check-mark")];
    let heads = [
        "self-check-change",
        "self-check-surface",
        "self-check-nearest",
        "self-check-volume",
        "self-check-called",
    ];
    let table = Table {
        head: heads.map(|key| words.get(key)).into(),
        text_columns: 1,
        rows,
        note: Some(notes.join(" ")),
    };
    vec![Block::Heading(words.get("section-self-check")), Block::Table(table)]
}
