//! Parses file names: kind, id, time and subject. Conventions: BraTS (`…-00005-100-t1c`,
//! `…_seg`), BIDS 1.10 (`sub-`, `ses-`, `_T1w`, `_dseg`, `desc-…_mask`), and `X_image`/`X_mask`.

use std::{ops::Range, path::Path};

use crate::{
    dates::{ISO_LENGTH, compact_date, find_iso_date},
    files::format::volume_stem,
};

/// Words that mark a file as a mask or label map.
const MASK_WORDS: &[&str] = &[
    "seg",
    "segs",
    "mask",
    "masks",
    "dseg",
    "probseg",
    "segmentation",
    "segmentations",
    "roi",
    "rois",
    "label",
    "labels",
    "labelmap",
    "labelmaps",
    "lesion",
    "lesions",
];

/// Words that only mark a file as an image.
const IMAGE_WORDS: &[&str] = &["image", "img", "volume"];

/// Names of modalities.
const MODALITY_WORDS: &[&str] = &[
    "t1", "t1c", "t1ce", "t1gd", "t1n", "t1w", "t1wce", "t2", "t2w", "t2f", "fla", "flair", "pd", "pdw",
    "pet", "fet", "fdg", "suv", "ct", "mr", "mri", "dwi", "adc", "swi", "cbv", "rcbv", "perf",
];

/// BIDS entities that are left out of an id entirely.
const DROPPED_ENTITIES: &[&str] = &["sub", "ses", "space", "res", "den"];

/// BIDS entities whose key is left out of an id, but not their value.
const KEYLESS_ENTITIES: &[&str] = &["desc", "label", "acq", "run", "rec", "ce", "trc", "task"];

/// Kind of a file by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Mask,
    Image,
    Unknown,
}

/// One part of a name, after the separator that precedes it.
type Token = (char, String);

/// A parsed file name.
#[derive(Clone, Debug)]
pub(super) struct ParsedName {
    pub kind: Kind,
    pub time: Option<String>,
    pub subject: Option<String>,
    /// The parts from which the id is made.
    tokens: Vec<Token>,
    /// The name without its extension.
    pub stem: String,
}

fn words(text: &str) -> impl Iterator<Item = String> + '_ {
    text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_lowercase)
}

/// Whether a word names a modality: `T1w`.
pub(super) fn is_modality(word: &str) -> bool {
    MODALITY_WORDS.iter().any(|known| known.eq_ignore_ascii_case(word))
}

/// Value of a BIDS entity in `text`: `01` of `ses-01`.
pub(super) fn entity<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.split('_').find_map(|piece| piece.strip_prefix(key)?.strip_prefix('-')).filter(|v| !v.is_empty())
}

fn tokens(stem: &str) -> Vec<Token> {
    let mut out = Vec::new();
    for piece in stem.split('_') {
        let mut parts = piece.split(['-', '.', ' ']).filter(|p| !p.is_empty()).peekable();
        if let Some((key, _)) = piece.split_once('-') {
            if DROPPED_ENTITIES.contains(&key) {
                continue;
            }
            if KEYLESS_ENTITIES.contains(&key) {
                parts.next();
            }
        }
        for (n, part) in parts.enumerate() {
            out.push((if n == 0 { '_' } else { '-' }, part.to_owned()));
        }
    }
    out
}

/// Words that name a time point when a number follows: `time1`, `Timepoint_2`, `week012`.
const TIME_WORDS: &[&str] =
    &["time", "timepoint", "tp", "visit", "session", "ses", "day", "week", "month", "year", "fu", "followup"];

/// The first parts of a name that name a time point: `time1`, or `Timepoint` and `1`.
fn find_numbered_time(tokens: &[Token]) -> Option<Range<usize>> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    (0..tokens.len()).find_map(|at| {
        let text = &tokens[at].1;
        let digits = text.find(|c: char| c.is_ascii_digit()).unwrap_or(text.len());
        let (word, number) = text.split_at(digits);
        if !TIME_WORDS.contains(&word.to_lowercase().as_str()) {
            return None;
        }
        let next_is_number = tokens.get(at + 1).is_some_and(|(_, next)| is_number(next));
        match (is_number(number), number.is_empty() && next_is_number) {
            (true, _) => Some(at..at + 1),
            (_, true) => Some(at..at + 2),
            _ => None,
        }
    })
}

/// The parts of a name before the first that states a kind or a time; values of BIDS entities are left out.
pub(super) fn leading_parts(text: &str) -> Vec<String> {
    let is_entity = |piece: &str| {
        let key = piece.split_once('-').map(|(key, _)| key);
        key.is_some_and(|key| DROPPED_ENTITIES.contains(&key) || KEYLESS_ENTITIES.contains(&key))
    };
    let without_entities: Vec<&str> = text.split('_').filter(|piece| !is_entity(piece)).collect();
    let tokens = tokens(&without_entities.join("_"));
    let kinds = [MASK_WORDS, IMAGE_WORDS, MODALITY_WORDS];
    let is_kind =
        |(_, token): &Token| kinds.iter().any(|words| words.contains(&token.to_lowercase().as_str()));
    let kind = tokens.iter().position(is_kind).unwrap_or(tokens.len());
    let end = find_numbered_time(&tokens).map_or(kind, |time| time.start.min(kind));
    tokens.into_iter().take(end).map(|(_, token)| token).collect()
}

/// Text of consecutive parts of a name.
fn joined(parts: impl Iterator<Item = Token>) -> String {
    parts.map(|(_, text)| text).collect::<Vec<_>>().join("_")
}

fn is_digits(text: &str, count: usize) -> bool {
    text.len() == count && text.bytes().all(|b| b.is_ascii_digit())
}

/// Parses a path relative to the opened folder; `None` if it is no image file.
pub(super) fn parse_name(relative: &Path) -> Option<ParsedName> {
    let name = relative.file_name()?.to_str()?;
    let stem = volume_stem(name)?.to_owned();
    let folders: Vec<&str> =
        relative.parent().into_iter().flat_map(Path::iter).filter_map(|f| f.to_str()).collect();
    let name_then_folders = || std::iter::once(stem.as_str()).chain(folders.iter().rev().copied());

    let in_mask_folder = folders.iter().any(|f| words(f).any(|w| MASK_WORDS.contains(&w.as_str())));
    let has = |list: &[&str]| words(&stem).any(|w| list.contains(&w.as_str()));
    let kind = if has(MASK_WORDS) || in_mask_folder {
        Kind::Mask
    } else if has(MODALITY_WORDS) || has(IMAGE_WORDS) {
        Kind::Image
    } else {
        Kind::Unknown
    };

    let mut rest = stem.clone();
    let mut time = name_then_folders().find_map(|p| entity(p, "ses")).map(str::to_owned);
    let mut subject = name_then_folders().find_map(|p| entity(p, "sub")).map(str::to_owned);
    if time.is_none() {
        time = name_then_folders().find_map(|p| find_iso_date(p).map(|at| p[at..at + ISO_LENGTH].to_owned()));
    }
    if let Some(at) = find_iso_date(&rest) {
        rest.replace_range(at..at + ISO_LENGTH, "");
    }
    let mut tokens = tokens(&rest);
    // BraTS since 2023: …-PATIENT(5 digits)-TIME(3 digits)-SUFFIX.
    let brats = tokens.windows(2).position(|w| is_digits(&w[0].1, 5) && is_digits(&w[1].1, 3));
    if let (Some(at), true) = (brats, stem.starts_with("BraTS")) {
        subject.get_or_insert_with(|| tokens[at].1.clone());
        time.get_or_insert_with(|| tokens[at + 1].1.clone());
        tokens.drain(..at + 2);
    }
    let compact = |tokens: &[Token]| {
        let mut dates = tokens.iter().enumerate();
        dates.find_map(|(at, (_, text))| Some((at, compact_date(text)?.to_string())))
    };
    if let Some((at, date)) = compact(&tokens).filter(|_| tokens.len() > 1) {
        tokens.remove(at);
        time.get_or_insert(date);
    }
    if time.is_none() {
        time = folders.iter().rev().find_map(|folder| Some(compact(&self::tokens(folder))?.1));
    }
    // A name of nothing but its time keeps it as its id.
    if let Some(found) =
        find_numbered_time(&tokens).filter(|found| time.is_none() && found.len() < tokens.len())
    {
        time = Some(joined(tokens.drain(found)));
    }
    let folder_time = |folder: &&str| {
        let parts = self::tokens(folder);
        find_numbered_time(&parts).map(|found| joined(parts[found].iter().cloned()))
    };
    let time = time.or_else(|| folders.iter().rev().find_map(folder_time));
    Some(ParsedName { kind, time, subject, tokens, stem })
}

/// Drops the leading parts that all names share: in a patient's folder they name the patient. Each name keeps at
/// least one part.
pub(super) fn drop_common_start(names: &mut [ParsedName]) {
    if names.len() < 2 {
        return;
    }
    while names.iter().all(|n| n.tokens.len() > 1)
        && names.iter().all(|n| n.tokens[0].1.eq_ignore_ascii_case(&names[0].tokens[0].1))
    {
        for n in names.iter_mut() {
            n.tokens.remove(0);
        }
    }
}

/// The id of a file: its remaining parts, without words that only state its kind unless nothing else is left.
pub(super) fn id(named: &ParsedName, is_mask: bool) -> String {
    let kind_words = if is_mask { MASK_WORDS } else { IMAGE_WORDS };
    let distinctive: Vec<&Token> =
        named.tokens.iter().filter(|(_, t)| !kind_words.contains(&t.to_lowercase().as_str())).collect();
    let parts: Vec<&Token> = if distinctive.is_empty() { named.tokens.iter().collect() } else { distinctive };
    let mut id = String::new();
    for (separator, token) in parts {
        if !id.is_empty() {
            id.push(*separator);
        }
        id.push_str(token);
    }
    if id.is_empty() { named.stem.clone() } else { id }
}

/// `stem`, or with the first number from 2 that makes it one that isn't taken.
pub(super) fn unique(stem: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..).map(|number: u32| format!("{stem} {number}"));
    let mut all = std::iter::once(stem.to_owned()).chain(numbered);
    all.find(|id| !is_taken(id)).unwrap_or_else(|| stem.to_owned())
}

/// An id and its time as written in messages: `T1 (2024-01-15)`.
pub(super) fn at_time(id: &str, time: &str) -> String {
    if time.is_empty() { id.to_owned() } else { format!("{id} ({time})") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kind, time and id of each file, all in one folder.
    fn all(paths: &[&str]) -> Vec<(Kind, Option<String>, String)> {
        let mut names: Vec<ParsedName> = paths.iter().map(|p| parse_name(Path::new(p)).unwrap()).collect();
        drop_common_start(&mut names);
        names.iter().map(|n| (n.kind, n.time.clone(), id(n, n.kind == Kind::Mask))).collect()
    }

    fn expected(kind: Kind, time: Option<&str>, id: &str) -> (Kind, Option<String>, String) {
        (kind, time.map(str::to_owned), id.to_owned())
    }

    #[test]
    fn words_with_numbers_are_times() {
        let found = all(&["900001_time1_t1ce.nii.gz", "900001_time2_t1ce.nii.gz", "900001_time2_seg.nii.gz"]);
        let image = |time| expected(Kind::Image, Some(time), "t1ce");
        assert_eq!(found, [image("time1"), image("time2"), expected(Kind::Mask, Some("time2"), "seg")]);
        let time = |path: &str| parse_name(Path::new(path)).unwrap().time;
        for (path, label) in [
            ("Patient-003/week-012/t1c.nii.gz", Some("week_012")),
            ("Patient-003/week012/t1c.nii.gz", Some("week012")),
            ("Timepoint_1/seg.nii.gz", Some("Timepoint_1")),
            ("case7_Timepoint_1_seg.nii.gz", Some("Timepoint_1")),
            ("fu2/seg.nii.gz", Some("fu2")),
            ("seg_20240205.nii.gz", Some("2024-02-05")),
            ("20240205/seg.nii.gz", Some("2024-02-05")),
            ("seg_19840312.nii.gz", None),
            ("t1_post.nii.gz", None),
            ("scan-20.nii.gz", None),
            ("week3.nii.gz", None),
            ("sometime_seg.nii.gz", None),
        ] {
            assert_eq!(time(path).as_deref(), label, "{path}");
        }
    }

    #[test]
    fn brats_names_of_both_conventions() {
        let found = all(&["BraTS-GLI-00005-100-t1c.nii.gz", "BraTS-GLI-00005-101-seg.nii.gz"]);
        assert_eq!(
            found,
            [expected(Kind::Image, Some("100"), "t1c"), expected(Kind::Mask, Some("101"), "seg")]
        );
        let found = all(&["BraTS20_Training_001_flair.nii", "BraTS20_Training_001_seg.nii"]);
        assert_eq!(found, [expected(Kind::Image, None, "flair"), expected(Kind::Mask, None, "seg")]);
        assert_eq!(
            parse_name(Path::new("BraTS-GLI-00005-100-t2f.nii")).unwrap().subject.as_deref(),
            Some("00005")
        );
    }

    #[test]
    fn bids_names() {
        let found = all(&[
            "sub-01/ses-pre/anat/sub-01_ses-pre_ce-gadolinium_T1w.nii.gz",
            "sub-01/ses-post/anat/sub-01_ses-post_desc-tumor_mask.nii.gz",
            "sub-01/ses-post/anat/sub-01_ses-post_dseg.nii.gz",
        ]);
        assert_eq!(
            found,
            [
                expected(Kind::Image, Some("pre"), "gadolinium_T1w"),
                expected(Kind::Mask, Some("post"), "tumor"),
                expected(Kind::Mask, Some("post"), "dseg"),
            ]
        );
    }

    #[test]
    fn image_mask_pairs_mask_folders_dates_and_unknown_kinds() {
        let found = all(&["CT_image.nii.gz", "CT_mask.nii.gz", "MR_T1_mask.nii.gz"]);
        assert_eq!(
            found,
            [
                expected(Kind::Image, None, "CT"),
                expected(Kind::Mask, None, "CT"),
                expected(Kind::Mask, None, "MR_T1")
            ]
        );
        let found = all(&["t1.nii.gz", "hnfnetv1-20.nii.gz", "masks/PET.hdr", "t1c-2024-01-15.nii"]);
        assert_eq!(
            found,
            [
                expected(Kind::Image, None, "t1"),
                expected(Kind::Unknown, None, "hnfnetv1-20"),
                expected(Kind::Mask, None, "PET"),
                expected(Kind::Image, Some("2024-01-15"), "t1c"),
            ]
        );
    }

    #[test]
    fn other_files_have_no_parsed_name_and_impossible_dates_no_time() {
        for other in ["a.img", "a.img.gz", "a.txt", ".nii", "LICENSE", "a.nii.bz2"] {
            assert!(parse_name(Path::new(other)).is_none(), "{other}");
        }
        let named = parse_name(Path::new("t1-2024-02-31.nii")).unwrap();
        assert_eq!(named.time, None, "not a calendar day");
    }
}
