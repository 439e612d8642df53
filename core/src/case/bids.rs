//! A subject's files in two data sets of BIDS: images in the raw one, masks in a derived one (`derivatives/NAME`).
//!
//! Whoever opens the subject's folder of one gets what the other has of the same subject and session: masks for the images of a
//! raw data set, images for the masks of a derived one. Told by names alone; nothing is opened.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use super::{
    CaseError,
    folder::{self, Listing, MAX_LISTED},
    names::{self, Kind, ParsedName},
};
use crate::{
    Check, Progress,
    check::listed,
    files::{absolute, printable},
};

/// Where a raw data set keeps what was derived from it.
const DERIVATIVES: &str = "derivatives";
/// The word that takes no derived data set.
const NONE: &str = "none";
/// Folders of a session whose images and masks are of another kind of scan: many volumes, other grids.
const OTHER_SCANS: [&str; 4] = ["func", "fmap", "dwi", "perf"];
/// Values of `space-` by which a file lies where its subject was scanned; beside these, names of images (`space-T1w`).
const OWN_SPACES: [&str; 4] = ["orig", "individual", "native", "scanner"];

/// What is taken of the other data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gives {
    Masks,
    Images,
}

/// What another data set has of the same subject.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Partner {
    /// Its folder of the subject, or of the session that is opened.
    folder: PathBuf,
    gives: Gives,
    /// Put before the ids of its masks, where masks are taken of several.
    set: Option<String>,
}

/// What other data sets have of a subject.
#[derive(Debug, Default)]
pub(super) struct Partners {
    all: Vec<Partner>,
    /// What could be taken and isn't.
    pub notes: Vec<Check>,
}

/// Files of one data set among those of a case.
#[derive(Debug)]
pub(super) struct Place {
    /// Folder of the subject, relative to that of the case: names are read from here on.
    pub folder: PathBuf,
    /// Put before the ids of its masks.
    pub set: Option<String>,
}

/// The data set of a subject's folder, and that folder's path in it: `sub-01`, or `sub-01/ses-1`. `None` for other folders.
fn place_of(folder: &Path) -> Option<(PathBuf, PathBuf)> {
    let folder = absolute(folder);
    let name = |path: &Path| path.file_name().and_then(|name| name.to_str()).map(str::to_owned);
    let is = |path: &Path, start: &str| name(path).is_some_and(|name| name.starts_with(start));
    let subject = if is(&folder, "ses-") { folder.parent()? } else { &folder };
    let root = subject.parent().filter(|_| is(subject, "sub-"))?;
    Some((root.to_owned(), folder.strip_prefix(root).ok()?.to_owned()))
}

fn named(folder: &Path) -> String {
    folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The derived data sets within `root` that have `beneath`, sorted.
fn derived(root: &Path, beneath: &Path) -> Vec<PathBuf> {
    let all = root.join(DERIVATIVES);
    let mut found = folder::entries(&all).unwrap_or_default();
    // Some keep the subjects' folders there without a name between.
    found.insert(0, all);
    found.retain(|set| !named(set).starts_with('.') && set.join(beneath).is_dir());
    found
}

/// That something isn't the folder of a subject, whose derived data sets could be chosen.
pub(super) fn no_subject(path: &Path) -> CaseError {
    let place = printable(&path.display().to_string());
    CaseError::wrong("--derivatives", place, "the folder of a subject of BIDS (sub-LABEL) without a manifest")
}

/// The folder of a derived data set: by its name one of those in `root`, else by its path. `None` for the word that takes none.
///
/// # Errors
/// [`CaseError`] where it is no folder.
pub fn derived_data_set(root: &Path, chosen: &Path) -> Result<Option<PathBuf>, CaseError> {
    if chosen == Path::new(NONE) {
        return Ok(None);
    }
    let is_name = chosen.components().count() == 1 && !chosen.is_absolute();
    let folder = absolute(&if is_name { root.join(DERIVATIVES).join(chosen) } else { chosen.to_owned() });
    if folder.is_dir() {
        return Ok(Some(folder));
    }
    let found = format!("no folder {}", printable(&folder.display().to_string()));
    let expected = format!("the name of one in {DERIVATIVES}/ of the data set, a path with a /, or {NONE}");
    Err(CaseError::wrong("--derivatives", found, expected))
}

/// What other data sets have of the subject in `folder`, whose own files are `own`; of derived ones those `chosen`, else the only one
/// where it has no masks itself.
///
/// # Errors
/// [`CaseError`] where something is chosen that isn't there, or for a folder of no subject.
pub(super) fn partners(folder: &Path, own: &Listing, chosen: &[PathBuf]) -> Result<Partners, CaseError> {
    let mut found = Partners::default();
    let Some((root, beneath)) = place_of(folder) else {
        if chosen.is_empty() {
            return Ok(found);
        }
        return Err(no_subject(folder));
    };
    let masks = |set: PathBuf, is_one: bool| Partner {
        folder: set.join(&beneath),
        gives: Gives::Masks,
        set: (!is_one).then(|| named(&set)),
    };
    for set in chosen {
        // One name stays before the ids where this subject lacks another: ids are the same in all cases.
        let Some(set) = derived_data_set(&root, set)? else { continue };
        if set.join(&beneath).is_dir() {
            found.all.push(masks(set, chosen.len() == 1));
        } else {
            let text = format!(
                "{}: found nothing of {}",
                printable(&named(&set)),
                printable(&beneath.display().to_string())
            );
            found.notes.push(Check::note("derivatives-unused", text));
        }
    }
    if !chosen.is_empty() {
        return Ok(found);
    }
    let is_mask = |path: &PathBuf| names::parse_name(path).is_some_and(|file| file.kind == Kind::Mask);
    let has_masks = own.volumes.iter().any(is_mask);
    let mut sets = if has_masks { Vec::new() } else { derived(&root, &beneath) };
    if sets.len() > 1 {
        let names: Vec<String> = sets.iter().map(|set| printable(&named(set))).collect();
        let text = format!(
            "{}: found {} derived data sets of this subject, expected one; --derivatives NAME takes their masks",
            listed(&names, MAX_LISTED),
            names.len()
        );
        found.notes.push(Check::note("derivatives-unused", text));
    } else if let Some(set) = sets.pop() {
        found.all.push(masks(set, true));
    }
    let raw = root.ancestors().take(3).find(|above| named(above) == DERIVATIVES).and_then(Path::parent);
    if let Some(raw) = raw.map(|raw| raw.join(&beneath)).filter(|raw| raw.is_dir()) {
        found.all.push(Partner { folder: raw, gives: Gives::Images, set: None });
    }
    Ok(found)
}

/// Whether a file lies where its subject was scanned.
fn is_in_own_space(named: &ParsedName) -> bool {
    let space = names::entity(&named.stem, "space");
    space.is_none_or(|space| {
        OWN_SPACES.iter().any(|own| own.eq_ignore_ascii_case(space)) || names::is_modality(space)
    })
}

impl Partners {
    /// Whether no other data set has anything.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The folders of raw data: they may tell the order of sessions.
    pub fn raw(&self) -> impl Iterator<Item = &Path> {
        self.all
            .iter()
            .filter(|partner| partner.gives == Gives::Images)
            .map(|partner| partner.folder.as_path())
    }

    /// The files of `own`, which lie below `folder`, with those of the other data sets: the folder of all, and where each data
    /// set lies in it.
    ///
    /// # Errors
    /// [`CaseError`] for a folder that can't be read.
    pub fn join(
        &self,
        folder: &Path,
        own: Listing,
        progress: &Progress,
    ) -> Result<(PathBuf, Listing, Vec<Place>), CaseError> {
        let folder = absolute(folder);
        let mut root = folder.clone();
        while !self.all.iter().all(|partner| partner.folder.starts_with(&root)) && root.pop() {}
        let within = |path: &Path| path.strip_prefix(&root).unwrap_or(path).to_owned();
        let parsed: Vec<ParsedName> = own.volumes.iter().filter_map(|path| names::parse_name(path)).collect();
        let has_own_space = parsed.iter().filter(|file| file.kind != Kind::Image).any(is_in_own_space);
        let shown: BTreeSet<&Option<String>> =
            parsed.iter().filter(|file| file.kind == Kind::Image).map(|file| &file.time).collect();
        let place = within(&folder);
        let mut all = Listing::default();
        all.add(&place, own);
        let mut places = vec![Place { folder: place, set: None }];
        for partner in &self.all {
            let theirs = folder::list(&partner.folder, progress)?;
            let mut elsewhere = Vec::new();
            let mut is_taken = |path: &PathBuf| {
                let Some(file) = names::parse_name(path) else { return false };
                if path.iter().any(|part| OTHER_SCANS.iter().any(|scan| part == *scan)) {
                    return false;
                }
                match partner.gives {
                    Gives::Images => file.kind != Kind::Mask && has_own_space && !shown.contains(&file.time),
                    Gives::Masks if file.kind != Kind::Mask => false,
                    Gives::Masks => {
                        let is_here = is_in_own_space(&file);
                        elsewhere.extend((!is_here).then(|| printable(&file.stem)));
                        is_here
                    }
                }
            };
            let mut volumes = theirs.volumes;
            volumes.retain(|path| is_taken(path));
            if !elsewhere.is_empty() {
                let text = format!(
                    "{}: found masks in another space than the images by their names; left out",
                    listed(&elsewhere, MAX_LISTED)
                );
                all.left_out.push(Check::warning("left-out", text));
            }
            let place = within(&partner.folder);
            all.add(&place, Listing { volumes, tables: theirs.tables, ..Listing::default() });
            places.push(Place { folder: place, set: partner.set.clone() });
        }
        Ok((root, all, places))
    }
}

/// The files that the case of a subject's folder has of other data sets; none for other paths.
///
/// # Errors
/// [`CaseError`] as for opening it.
pub fn files_of_other_data_sets(
    folder: &Path,
    chosen: &[PathBuf],
    progress: &Progress,
) -> Result<Vec<PathBuf>, CaseError> {
    if !folder.is_dir() || place_of(folder).is_none() {
        return Ok(Vec::new());
    }
    let own = folder::list(folder, progress)?;
    let found = partners(folder, &own, chosen)?;
    if found.is_empty() {
        return Ok(Vec::new());
    }
    let (root, all, _) = found.join(folder, own, progress)?;
    let is_other = |path: &PathBuf| !path.starts_with(absolute(folder));
    let files = all.volumes.into_iter().chain(all.tables).map(|path| root.join(path)).filter(is_other);
    let files: Vec<PathBuf> = files.collect();
    let halves: Vec<PathBuf> = files.iter().flat_map(|file| crate::files::other_files(file)).collect();
    Ok(files.into_iter().chain(halves).collect())
}
