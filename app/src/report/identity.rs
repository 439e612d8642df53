//! How much a report says about whose files they are.

use std::path::Path;

use clap::ValueEnum;
use glioscope_core::case::{Case, Patient};
use serde::{Deserialize, Serialize};

/// How much of the patient's identity a report has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Identity {
    /// Neither name, identifier, date of birth nor names of files and folders; dates of scans and names of masks and images stay.
    #[default]
    None,
    /// The name's initials; nothing else.
    Initials,
    /// Everything that the files state.
    Full,
}

/// Words shorter than this identify nobody, and stand in other words.
const LEAST_LETTERS: usize = 3;

/// Digits in a row from which on the name of a file or folder identifies a patient; others are words such as `PET`.
const IDENTIFYING_DIGITS: usize = 3;

/// Digits in a row from which on a number identifies a patient wherever it stands.
const LONG_NUMBER: usize = 5;

/// Names of cases that say nothing, and are words of messages.
const PLAIN_NAMES: &[&str] = &[
    "case", "cases", "data", "dates", "dicom", "files", "frames", "image", "images", "mask", "masks",
    "nifti", "one", "patient", "sample", "shared", "space", "study", "two",
];

/// Takes from texts what identifies the patient.
pub struct Redactor {
    /// What is removed, the longest first.
    secrets: Vec<String>,
    replacement: String,
}

impl Redactor {
    /// For reports of `case` with `identity`; `replacement` stands where something was removed.
    pub fn new(case: &Case, identity: Identity, replacement: String) -> Self {
        let secrets = if identity == Identity::Full { Vec::new() } else { secrets(case) };
        Self { secrets, replacement }
    }

    /// One that takes nothing.
    #[cfg(test)]
    pub fn nothing() -> Self {
        Self { secrets: Vec::new(), replacement: String::new() }
    }

    /// `text` without what identifies the patient: whole words, whatever their case.
    pub fn text(&self, text: &str) -> String {
        // Marks of direction could turn the text around them.
        let is_plain = |c: &char| !matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        self.secrets.iter().fold(text.chars().filter(is_plain).collect(), |text, secret| {
            without(&text, secret, &self.replacement)
        })
    }
}

/// What identifies the patient: name, identifier, date of birth, and every path, file name and folder name of the case.
fn secrets(case: &Case) -> Vec<String> {
    let Patient { name, id, birth_date, sex: _, studies } = &case.patient;
    let mut all: Vec<String> = name.split_whitespace().map(str::to_owned).collect();
    all.extend([name.clone(), id.clone(), birth_date.clone()]);
    all.extend(studies.iter().map(|study| study.accession_number.clone()));
    all.extend(glioscope_core::dates::dicom_date(birth_date));
    // An identifier with its issuer: `1234@hospital`.
    all.extend(id.split('@').map(str::to_owned));
    for path in case.inputs.paths() {
        all.push(path.display().to_string());
        // The folders above as paths, then what is named after a patient: folders, and the file with and without its endings.
        let folders = path.ancestors().skip(1).filter(|folder| folder.components().count() > 1);
        all.extend(folders.map(|folder| folder.display().to_string()));
        let names = path.iter().filter_map(|part| part.to_str().map(str::to_owned)).chain(stem(path));
        let names: Vec<String> = names.filter(|name| has_number(name)).collect();
        all.extend(names.iter().flat_map(|name| long_numbers(name)));
        all.extend(names);
    }
    all.extend(Some(case.name.clone()).filter(|name| !PLAIN_NAMES.contains(&name.to_lowercase().as_str())));
    let ids: Vec<&str> = case
        .time_points
        .iter()
        .flat_map(|t| t.masks.iter().map(|m| m.mask.id()).chain(t.contexts.iter().map(|c| c.id.as_str())))
        .collect();
    let dates = case.time_labels();
    // A mask is often named after its file, and that after the patient: `4711_seg.nii.gz`.
    let stems: Vec<String> = case.inputs.paths().iter().filter_map(|path| stem(path)).collect();
    all.extend(
        ids.iter()
            .filter(|id| has_number(id) && stems.iter().any(|stem| stem.contains(**id)))
            .map(|id| (*id).to_owned()),
    );
    // A file is often named after what it holds, which is no secret: `t1c.nii.gz`; but a number is, and the patient's identifier.
    let is_word = |s: &str| ids.contains(&s) && !has_number(s) && s != id;
    all.retain(|s| s.chars().count() >= LEAST_LETTERS && !is_word(s) && !dates.contains(&s.as_str()));
    all.sort_by(|a, b| b.len().cmp(&a.len()).then(a.cmp(b)));
    all.dedup();
    all
}

fn has_number(name: &str) -> bool {
    name.split(|c: char| !c.is_ascii_digit()).any(|digits| digits.len() >= IDENTIFYING_DIGITS)
}

/// The numbers in a name that identify a patient on their own; years, and numbers of raters, are shorter.
fn long_numbers(name: &str) -> Vec<String> {
    let numbers = name.split(|c: char| !c.is_ascii_digit());
    numbers.filter(|digits| digits.len() >= LONG_NUMBER).map(str::to_owned).collect()
}

/// The name of a file up to its first dot.
fn stem(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_str()?;
    Some(name.split('.').next().unwrap_or(name).to_owned())
}

/// `text` with whole words that equal `secret`, whatever their case, replaced.
fn without(text: &str, secret: &str, replacement: &str) -> String {
    let (lower, wanted) = (text.to_lowercase(), secret.to_lowercase());
    if lower.len() != text.len() || wanted.is_empty() {
        // Lower case is of another length (a dotted capital İ): compared as it stands.
        return text.replace(secret, replacement);
    }
    // A number ends where its digits end: `x4711234`.
    let is_number = wanted.bytes().all(|b| b.is_ascii_digit());
    let is_part =
        |c: Option<char>| c.is_some_and(|c| if is_number { c.is_ascii_digit() } else { c.is_alphanumeric() });
    let (mut out, mut from) = (String::new(), 0);
    for (at, found) in lower.match_indices(&wanted) {
        let end = at + found.len();
        let whole = !is_part(lower[..at].chars().next_back()) && !is_part(lower[end..].chars().next());
        if whole && text.is_char_boundary(at) && text.is_char_boundary(end) {
            out.push_str(&text[from..at]);
            out.push_str(replacement);
            from = end;
        }
    }
    out + &text[from..]
}

/// The first letters of a name's parts, in the order of the name: `D. J.`.
pub fn initials(name: &str) -> String {
    let letters = name.split([' ', '-']).filter_map(|part| part.chars().next());
    letters.map(|c| format!("{}.", c.to_uppercase())).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_words_are_removed_whatever_their_case() {
        let gone = |text: &str| without(text, "Doe", "#");
        assert_eq!(gone("DOE^Jane, doe_1, Doeblin"), "#^Jane, #_1, Doeblin");
        assert_eq!(gone("/home/doe/doe.nii"), "/home/#/#.nii");
        assert_eq!(without("Straße und STRASSE", "straße", "#"), "# und STRASSE");
        assert_eq!(without("İDoe Doe", "Doe", "#"), "İ# #");
        assert_eq!(without("x4711234, 47112345, seg_4711234", "4711234", "#"), "x#, 47112345, seg_#");
        assert_eq!(long_numbers("sub-01_4711234_2024"), ["4711234"]);
    }

    #[test]
    fn initials_are_first_letters() {
        assert_eq!(initials("Doe Jane Ann-Marie"), "D. J. A. M.");
        assert_eq!(initials(""), "");
        assert_eq!(initials("ß"), "SS.");
    }
}
