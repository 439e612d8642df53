//! What file names say: kind, id, time and subject. Conventions: BraTS (`…-00005-100-t1c`,
//! `…_seg`), BIDS 1.10 (`sub-`, `ses-`, `_T1w`, `_dseg`, `desc-…_mask`), and `X_image`/`X_mask`.

use std::path::Path;

use crate::{
    dates::{ISO_LENGTH, find_iso_date},
    files::format::volume_stem,
};

/// Words that make a file a mask or label map.
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

/// Words that say "image" and nothing more.
const IMAGE_WORDS: &[&str] = &["image", "img", "volume"];

/// Words that name a modality.
const MODALITY_WORDS: &[&str] = &[
    "t1", "t1c", "t1ce", "t1gd", "t1n", "t1w", "t1wce", "t2", "t2w", "t2f", "fla", "flair", "pd", "pdw",
    "pet", "fet", "fdg", "suv", "ct", "mr", "mri", "dwi", "adc", "swi", "cbv", "rcbv", "perf",
];

/// BIDS entities whose value is no part of an id.
const DROPPED_ENTITIES: &[&str] = &["sub", "ses", "space", "res", "den"];

/// BIDS entities whose key is no part of an id.
const OPENED_ENTITIES: &[&str] = &["desc", "label", "acq", "run", "rec", "ce", "trc", "task"];

/// What a name says about a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Mask,
    Image,
    Unsaid,
}

/// One part of a name with the separator before it.
type Token = (char, String);

/// What one file's name says.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub kind: Kind,
    pub time: Option<String>,
    pub subject: Option<String>,
    /// What is left for the id.
    tokens: Vec<Token>,
    /// The name without its ending.
    pub stem: String,
}

fn words(text: &str) -> impl Iterator<Item = String> + '_ {
    text.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_lowercase)
}

/// `ses-01` in a text: `01`.
fn entity<'a>(text: &'a str, key: &str) -> Option<&'a str> {
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
            if OPENED_ENTITIES.contains(&key) {
                parts.next();
            }
        }
        for (n, part) in parts.enumerate() {
            out.push((if n == 0 { '_' } else { '-' }, part.to_owned()));
        }
    }
    out
}

fn digits(text: &str, count: usize) -> bool {
    text.len() == count && text.bytes().all(|b| b.is_ascii_digit())
}

/// What the path of a file, relative to the folder opened, says.
pub(super) fn read_name(relative: &Path) -> Option<Named> {
    let name = relative.file_name()?.to_str()?;
    let stem = volume_stem(name)?.to_owned();
    let folders: Vec<&str> =
        relative.parent().into_iter().flat_map(Path::iter).filter_map(|f| f.to_str()).collect();
    let places = || std::iter::once(stem.as_str()).chain(folders.iter().rev().copied());

    let in_folder = folders.iter().any(|f| words(f).any(|w| MASK_WORDS.contains(&w.as_str())));
    let has = |list: &[&str]| words(&stem).any(|w| list.contains(&w.as_str()));
    let kind = if has(MASK_WORDS) || in_folder {
        Kind::Mask
    } else if has(MODALITY_WORDS) || has(IMAGE_WORDS) {
        Kind::Image
    } else {
        Kind::Unsaid
    };

    let mut rest = stem.clone();
    let mut time = places().find_map(|p| entity(p, "ses")).map(str::to_owned);
    let mut subject = places().find_map(|p| entity(p, "sub")).map(str::to_owned);
    if time.is_none() {
        time = places().find_map(|p| find_iso_date(p).map(|at| p[at..at + ISO_LENGTH].to_owned()));
    }
    if let Some(at) = find_iso_date(&rest) {
        rest.replace_range(at..at + ISO_LENGTH, "");
    }
    let mut tokens = tokens(&rest);
    // BraTS since 2023: …-PATIENT(5 digits)-TIME(3 digits)-SUFFIX.
    let brats = tokens.windows(2).position(|w| digits(&w[0].1, 5) && digits(&w[1].1, 3));
    if let (Some(at), true) = (brats, stem.starts_with("BraTS")) {
        subject.get_or_insert_with(|| tokens[at].1.clone());
        time.get_or_insert_with(|| tokens[at + 1].1.clone());
        tokens.drain(..at + 2);
    }
    Some(Named { kind, time, subject, tokens, stem })
}

/// Drops the leading parts that all names share: in a patient's folder those are the patient.
/// One part always stays.
pub(super) fn drop_common_start(names: &mut [Named]) {
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

/// An id from what is left of a name: without the words that only say what kind it is, where
/// something else stays.
pub(super) fn id(named: &Named, is_mask: bool) -> String {
    let plain = if is_mask { MASK_WORDS } else { IMAGE_WORDS };
    let telling: Vec<&Token> =
        named.tokens.iter().filter(|(_, t)| !plain.contains(&t.to_lowercase().as_str())).collect();
    let kept: Vec<&Token> = if telling.is_empty() { named.tokens.iter().collect() } else { telling };
    let mut id = String::new();
    for (separator, token) in kept {
        if !id.is_empty() {
            id.push(*separator);
        }
        id.push_str(token);
    }
    if id.is_empty() { named.stem.clone() } else { id }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kind, time and id of each file, as one folder.
    fn all(paths: &[&str]) -> Vec<(Kind, Option<String>, String)> {
        let mut names: Vec<Named> = paths.iter().map(|p| read_name(Path::new(p)).unwrap()).collect();
        drop_common_start(&mut names);
        names.iter().map(|n| (n.kind, n.time.clone(), id(n, n.kind == Kind::Mask))).collect()
    }

    fn said(kind: Kind, time: Option<&str>, id: &str) -> (Kind, Option<String>, String) {
        (kind, time.map(str::to_owned), id.to_owned())
    }

    #[test]
    fn brats_of_both_styles() {
        let found = all(&["BraTS-GLI-00005-100-t1c.nii.gz", "BraTS-GLI-00005-101-seg.nii.gz"]);
        assert_eq!(found, [said(Kind::Image, Some("100"), "t1c"), said(Kind::Mask, Some("101"), "seg")]);
        let found = all(&["BraTS20_Training_001_flair.nii", "BraTS20_Training_001_seg.nii"]);
        assert_eq!(found, [said(Kind::Image, None, "flair"), said(Kind::Mask, None, "seg")]);
        assert_eq!(
            read_name(Path::new("BraTS-GLI-00005-100-t2f.nii")).unwrap().subject.as_deref(),
            Some("00005")
        );
    }

    #[test]
    fn bids() {
        let found = all(&[
            "sub-01/ses-pre/anat/sub-01_ses-pre_ce-gadolinium_T1w.nii.gz",
            "sub-01/ses-post/anat/sub-01_ses-post_desc-tumor_mask.nii.gz",
            "sub-01/ses-post/anat/sub-01_ses-post_dseg.nii.gz",
        ]);
        assert_eq!(
            found,
            [
                said(Kind::Image, Some("pre"), "gadolinium_T1w"),
                said(Kind::Mask, Some("post"), "tumor"),
                said(Kind::Mask, Some("post"), "dseg"),
            ]
        );
    }

    #[test]
    fn pairs_folders_dates_and_the_unnamed() {
        let found = all(&["CT_image.nii.gz", "CT_mask.nii.gz", "MR_T1_mask.nii.gz"]);
        assert_eq!(
            found,
            [said(Kind::Image, None, "CT"), said(Kind::Mask, None, "CT"), said(Kind::Mask, None, "MR_T1")]
        );
        let found = all(&["t1.nii.gz", "hnfnetv1-20.nii.gz", "masks/PET.hdr", "t1c-2024-01-15.nii"]);
        assert_eq!(
            found,
            [
                said(Kind::Image, None, "t1"),
                said(Kind::Unsaid, None, "hnfnetv1-20"),
                said(Kind::Mask, None, "PET"),
                said(Kind::Image, Some("2024-01-15"), "t1c"),
            ]
        );
    }

    #[test]
    fn other_files_are_not_named() {
        for other in ["a.img", "a.img.gz", "a.txt", ".nii", "LICENSE", "a.nii.bz2"] {
            assert!(read_name(Path::new(other)).is_none(), "{other}");
        }
        let named = read_name(Path::new("t1-2024-02-31.nii")).unwrap();
        assert_eq!(named.time, None, "no day of the calendar");
    }
}
