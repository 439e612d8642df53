//! The case and its document as a report may show them: without names of masks and images that identify the patient.

use std::{collections::BTreeMap, sync::Arc};

use glioscope_core::{case::Case, lesions};
use serde_json::Value;

use super::{
    Options,
    identity::{Identity, Redactor},
    sentences::words,
};
use crate::{
    error::AppError,
    model::{Document, Session, TakeHome, masks::MaskLook},
};

/// What a report may show.
pub struct Anonymous {
    /// The case.
    pub case: Arc<Case>,
    /// Its document.
    pub doc: Document,
    /// The new name of each id that is shown otherwise.
    pub names: BTreeMap<String, String>,
}

/// `case` and `doc` with ids and names from which what identifies the patient is removed; unchanged in a report with the full
/// identity.
///
/// # Errors
/// [`AppError`] where the document can't be renamed.
pub fn anonymous(case: &Arc<Case>, doc: Document, options: Options) -> Result<Anonymous, AppError> {
    let redactor = redactor(case, options);
    let names = renames(case, options, &redactor);
    let (shown, mut doc) = if names.is_empty() {
        (Arc::clone(case), doc)
    } else {
        let shown = with_names(case, &names, &redactor);
        let (renamed, _) = Session::of(&doc, case)?.renamed(&names).restore(&shown)?;
        (Arc::new(shown), renamed)
    };
    // Names that the user or the file gave beside the ids.
    let ids = shown.time_points.iter().flat_map(|time| time.masks.iter().map(|m| m.mask.id().to_owned()));
    for id in ids.collect::<Vec<_>>() {
        let look = doc.edit.masks.get(&id);
        let name = look.name.as_ref().map(|name| redactor.text(name));
        doc.edit.masks.set(&id, &MaskLook { name, ..look });
    }
    for picture in &mut doc.edit.pictures {
        picture.caption = redactor.text(&picture.caption);
        for ruler in &mut picture.edit.rulers {
            ruler.name = redactor.text(&ruler.name);
        }
    }
    for edit in &mut doc.edit.lesions.edits {
        if let lesions::Edit::Name { name, .. } = edit {
            *name = redactor.text(name);
        }
    }
    if options.identity != Identity::Full {
        doc.edit.response.anonymous(|text| redactor.text(text));
    }
    if options.identity != Identity::Full {
        // No part of a report.
        doc.edit.take_home = TakeHome::default();
        let reading = &mut doc.edit.reading;
        if !options.names_reader {
            reading.reader.clear();
        }
        reading.conclusion = redactor.text(&reading.conclusion);
        reading.taken = redactor.text(&reading.taken);
        for made in &mut doc.edit.made {
            (made.author, made.how) = (None, redactor.text(&made.how));
        }
        for ruler in &mut doc.edit.rulers {
            ruler.name = redactor.text(&ruler.name);
        }
        // Whatever else a session holds of the user's words: names of lines, sources, made masks.
        let session = Session::of(&doc, &shown)?.with_texts(&|text| {
            if is_program_word(text) { text.to_owned() } else { redactor.text(text) }
        });
        (doc, _) = session.restore(&shown)?;
    }
    Ok(Anonymous { case: shown, doc, names })
}

/// Whether a text may be one of the program's own in a session: a word such as `axial`, which a case may be called, or the
/// numbers of a made mask's voxels. These aren't touched; fields that a user writes are, one by one.
fn is_program_word(text: &str) -> bool {
    if text.bytes().all(|b| b.is_ascii_digit() || b == b' ') {
        return true;
    }
    text.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || matches!(b, b'_' | b'-' | b'.'))
        && text.bytes().any(|b| b.is_ascii_lowercase())
}

/// `numbers` of `case` without what identifies the patient in their texts; unchanged with the full identity.
pub fn without_identity(case: &Case, options: Options, mut numbers: Value) -> Value {
    if options.identity == Identity::Full {
        return numbers;
    }
    let redactor = redactor(case, options);
    // A keyword has no digit; a name of a file may look like one but for that.
    let is_keyword = |text: &str| text.bytes().all(|b| b.is_ascii_lowercase() || matches!(b, b'_' | b'-'));
    each_text(&mut numbers, &|text| {
        if !is_keyword(text) {
            *text = redactor.text(text);
        }
    });
    // The case is named after its folder, which is often named after the patient.
    let removed = words(options.language).get("removed");
    for place in ["/case", "/response/case", "/lesions/case", "/change/case"] {
        if let Some(name) = numbers.pointer_mut(place) {
            *name = removed.clone().into();
        }
    }
    numbers
}

fn each_text(value: &mut Value, change: &dyn Fn(&mut String)) {
    match value {
        Value::String(text) => change(text),
        Value::Array(all) => all.iter_mut().for_each(|one| each_text(one, change)),
        Value::Object(all) => all.values_mut().for_each(|one| each_text(one, change)),
        _ => {}
    }
}

/// `case` alone, as [`anonymous`] names it.
pub fn anonymous_case(case: &Case, options: Options) -> Case {
    let redactor = redactor(case, options);
    let names = renames(case, options, &redactor);
    if names.is_empty() { case.clone() } else { with_names(case, &names, &redactor) }
}

fn redactor(case: &Case, options: Options) -> Redactor {
    Redactor::new(case, options.identity, words(options.language).get("removed"))
}

/// Findings and transforms' names, too: once ids are others, nothing tells any more that the old ones name somebody.
fn with_names(case: &Case, names: &BTreeMap<String, String>, redactor: &Redactor) -> Case {
    let mut shown = case.renamed(&|id| names.get(id).cloned().unwrap_or_else(|| id.to_owned()));
    for check in &mut shown.checks {
        check.message = redactor.text(&check.message);
    }
    for by in shown.aligned.iter_mut().flat_map(|aligned| &mut aligned.by) {
        *by = redactor.text(by);
    }
    shown
}

/// The ids that are shown otherwise, each with its new one; the new ones are distinct.
fn renames(case: &Case, options: Options, redactor: &Redactor) -> BTreeMap<String, String> {
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    if options.identity == Identity::Full {
        return names;
    }
    let ids = || {
        let times = case.time_points.iter();
        times
            .flat_map(|t| t.masks.iter().map(|m| m.mask.id()).chain(t.contexts.iter().map(|c| c.id.as_str())))
    };
    for id in ids() {
        let new = redactor.text(id);
        if new == id || names.contains_key(id) {
            continue;
        }
        let is_taken = |name: &str| ids().any(|other| other == name) || names.values().any(|n| n == name);
        let numbered = (2..).map(|n| format!("{new} {n}"));
        let free = std::iter::once(new.clone()).chain(numbered).find(|name| !is_taken(name));
        names.insert(id.to_owned(), free.unwrap_or(new));
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_the_program_and_voxels_are_told_from_words_of_a_user() {
        for own in ["axial", "rano-2.0", "keep_parts", "12 4711234 5", ""] {
            assert!(is_program_word(own), "{own}");
        }
        for of_user in ["MUELLER", "mueller anna", "Line 1", "id 4711234"] {
            assert!(!is_program_word(of_user), "{of_user}");
        }
    }
}
