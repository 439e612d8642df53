//! Whose files a folder has: identifiers of patients in the names of files and folders. Two patients are never taken
//! for one case, nor for two dates of one patient.

use std::{
    collections::{BTreeSet, HashSet},
    path::{Path, PathBuf},
};

use super::names::{self, ParsedName};
use crate::dates::{ISO_LENGTH, compact_date, find_iso_date};

/// Words before a patient's number.
const PATIENT_WORDS: &[&str] = &["patient", "pat", "pt", "subject", "subj", "case", "p", "participant", "id"];

/// Letters up to which a prefix of an identifying number is part of it: `A001`, `MR0042`.
const PREFIX_LETTERS: usize = 2;

/// Digits from which on a number of its own identifies a patient; shorter ones number raters, runs and visits.
const IDENTIFYING_DIGITS: usize = 3;

/// Distinct patients that files state, sorted: `paths` are relative to the opened folder, `named` the same files.
/// Files that state none are left out. Recognised are BIDS (`sub-01`), BraTS of all years (`BraTS20_Training_001`,
/// `BraTS2021_00002`, `BraTS-GLI-00005-100`), nnU-Net (`BRATS_001_0000` for a channel, `BRATS_001` for its labels),
/// numbers of at least three digits (`001`, `UPENN-GBM-00012`), and words with a number (`Patient-7`, `case12`).
pub(super) fn subjects(paths: &[PathBuf], named: &[ParsedName]) -> Vec<String> {
    let stems: HashSet<&str> = named.iter().map(|n| n.stem.as_str()).collect();
    let of = |(path, named): (&PathBuf, &ParsedName)| {
        let in_folders = || {
            let folders = path.parent().into_iter().flat_map(Path::iter).filter_map(|f| f.to_str());
            folders.collect::<Vec<_>>().into_iter().rev().find_map(identifier)
        };
        let subject = named.subject.clone();
        subject.or_else(|| identifier(without_channel(&named.stem, &stems))).or_else(in_folders)
    };
    let all: BTreeSet<String> = paths.iter().zip(named).filter_map(of).collect();
    all.into_iter().collect()
}

/// `BRATS_001` of nnU-Net's `BRATS_001_0002`, if the first channel or the labels are among `stems`.
fn without_channel<'a>(stem: &'a str, stems: &HashSet<&str>) -> &'a str {
    let is_channel = |text: &str| text.len() == 4 && text.bytes().all(|b| b.is_ascii_digit());
    match stem.rsplit_once('_').filter(|(_, channel)| is_channel(channel)) {
        Some((case, _)) if stems.contains(case) || stems.contains(format!("{case}_0000").as_str()) => case,
        _ => stem,
    }
}

/// The identifier of a patient at the start of the name of a file or folder: its parts up to the last identifying
/// number before a word that states a kind or a time.
fn identifier(text: &str) -> Option<String> {
    let mut text = text.to_owned();
    if let Some(at) = find_iso_date(&text) {
        text.replace_range(at..at + ISO_LENGTH, "");
    }
    let parts: Vec<String> = names::leading_parts(&text);
    let is_number = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    let is_word = |part: &str| PATIENT_WORDS.contains(&part.to_lowercase().as_str());
    let identifies = |at: usize| {
        let part = parts[at].as_str();
        let (word, number) = part.split_at(part.find(|c: char| c.is_ascii_digit()).unwrap_or(part.len()));
        let is_year =
            number.len() == 4 && number.parse().is_ok_and(|year: u32| (1900..=2100).contains(&year));
        let is_long = number.len() >= IDENTIFYING_DIGITS && compact_date(number).is_none() && !is_year;
        let is_named = if word.is_empty() {
            is_long || at > 0 && is_word(&parts[at - 1])
        } else {
            is_long && word.len() <= PREFIX_LETTERS || is_word(word)
        };
        !number.is_empty() && is_number(number) && is_named
    };
    let is_brats = text.to_lowercase().starts_with("brats") && parts.len() > 1;
    let is_bare_number = parts.len() == 1 && is_number(&parts[0]) && compact_date(&parts[0]).is_none();
    let last = if is_brats || is_bare_number {
        parts.len().checked_sub(1)
    } else {
        (0..parts.len()).rev().find(|at| identifies(*at))
    };
    last.map(|last| parts[..=last].join("_"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(paths: &[&str]) -> Vec<String> {
        let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
        let named: Vec<ParsedName> = paths.iter().map(|p| names::parse_name(p).unwrap()).collect();
        subjects(&paths, &named)
    }

    #[test]
    fn two_patients_are_two_however_they_are_named() {
        let two: [&[&str]; 16] = [
            &["19840312_seg.nii", "19790505_seg.nii"],
            &["A001/seg.nii", "A002/seg.nii"],
            &["ID07_seg.nii", "ID08_seg.nii"],
            &["MR0042_seg.nii", "MR0043_seg.nii"],
            &["a/BraTS20_Training_001_flair.nii.gz", "b/BraTS20_Training_002_flair.nii.gz"],
            &["BraTS2021_00000_seg.nii.gz", "BraTS2021_00002_seg.nii.gz"],
            &["Brats18_2013_2_1_seg.nii.gz", "Brats18_2013_3_1_seg.nii.gz"],
            &["BraTS19_CBICA_AAB_1_t1.nii", "BraTS19_CBICA_AAG_1_t1.nii"],
            &["BraTS-GLI-00005-100-seg.nii.gz", "BraTS-GLI-00006-100-seg.nii.gz"],
            &["imagesTr/BRATS_001_0000.nii.gz", "labelsTr/BRATS_001.nii.gz", "labelsTr/BRATS_002.nii.gz"],
            &["001.nii.gz", "002.nii.gz"],
            &["12.nii", "13.nii"],
            &["Patient-003/week-012/t1c.nii.gz", "Patient-004/week-012/t1c.nii.gz"],
            &["UPENN-GBM-00001_11_T1.nii.gz", "UPENN-GBM-00002_11_T1.nii.gz"],
            &["case12_seg.nii", "case13_seg.nii"],
            &["sub-01/anat/sub-01_T1w.nii", "sub-02/anat/sub-02_T1w.nii"],
        ];
        for paths in two {
            assert_eq!(of(paths).len(), 2, "{paths:?}: {:?}", of(paths));
        }
        let named = of(&["a/BraTS20_Training_001_flair.nii.gz", "b/BraTS20_Training_002_seg.nii.gz"]);
        assert_eq!(named, ["BraTS20_Training_001", "BraTS20_Training_002"]);
    }

    /// Four digits are a channel where the first channel or the labels of the same name are there too.
    #[test]
    fn only_channels_are_left_out_of_names() {
        let stems = HashSet::from(["A_001", "B_001_0000"]);
        for (stem, case) in [
            ("A_001_0002", "A_001"),
            ("B_001_0002", "B_001"),
            ("C_001_0002", "C_001_0002"),
            ("A_001_002", "A_001_002"),
            ("A_001_post", "A_001_post"),
        ] {
            assert_eq!(without_channel(stem, &stems), case);
        }
    }

    #[test]
    fn one_patient_is_one_with_raters_runs_dates_and_channels() {
        let one: [&[&str]; 14] = [
            &["05-01-2024/seg.nii", "04-02-2024/seg.nii"],
            &["hnfnetv1-20.nii.gz", "isen-20.nii.gz", "t1.nii.gz"],
            &["rater1_seg.nii", "rater2_seg.nii", "reader-3_seg.nii"],
            &["seg_1.nii", "seg_2.nii"],
            &["a1_seg.nii", "a2_seg.nii"],
            &["rater001_seg.nii", "rater002_seg.nii"],
            &["run-001_seg.nii", "run-002_seg.nii"],
            &["20240115_seg.nii", "20240301_seg.nii"],
            &["scan_2024-01-15_seg.nii", "scan_2025-01-15_seg.nii"],
            &[
                "imagesTr/BRATS_001_0000.nii.gz",
                "imagesTr/BRATS_001_0001.nii.gz",
                "labelsTr/BRATS_001.nii.gz",
            ],
            &["900001_time1_t1ce.nii.gz", "900001_time2_t1ce.nii.gz", "900001_time2_seg.nii.gz"],
            &["Patient-003/week-012/t1c.nii.gz", "Patient-003/week-024/t1c.nii.gz"],
            &["BraTS-GLI-00005-100-seg.nii.gz", "BraTS-GLI-00005-101-t1c.nii.gz"],
            &["TCGA-02-0003_t1.nii", "TCGA-02-0003_seg.nii", "notes_seg.nii"],
        ];
        for paths in one {
            assert!(of(paths).len() < 2, "{paths:?}: {:?}", of(paths));
        }
    }
}
