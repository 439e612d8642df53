//! Where a case's files lie: as absolute paths, or seen from the folder of a session file.

use std::path::{Component, Path, PathBuf};

use glioscope_core::{
    case::{Alignment, argument_with_file},
    files::absolute,
};
use serde::{Deserialize, Serialize};

use super::document::{CaseRef, Document};

/// The case and the additional tracts of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// The case.
    pub case: CaseRef,
    /// Files of fibre tracts in addition to the case's.
    #[serde(default)]
    pub tracts: Vec<PathBuf>,
    /// Registration transforms in addition to the case's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alignments: Vec<Alignment>,
}

impl Place {
    /// Where the case of a document lies.
    pub fn of(document: &Document) -> Self {
        let Document { case, tracts, edit, .. } = document;
        Self { case: case.clone(), tracts: tracts.clone(), alignments: edit.alignments.clone() }
    }

    /// With absolute paths, where these are relative to the current folder.
    pub fn absolute(&self) -> Self {
        self.map(Path::new(""), &|path| without_dots(&absolute(path)))
    }

    /// With paths relative to `folder`, where these are absolute.
    pub fn relative_to(&self, folder: &Path) -> Self {
        self.map(Path::new(""), &|path| relative_to(path, folder))
    }

    /// With absolute paths, where relative ones are relative to `folder`.
    pub fn seen_from(&self, folder: &Path) -> Self {
        let folder = absolute(folder);
        self.map(&folder, &|path| without_dots(&folder.join(path)))
    }

    fn map(&self, base: &Path, change: &dyn Fn(&Path) -> PathBuf) -> Self {
        let argument = |text: &String, is_mask: bool| {
            argument_with_file(text, is_mask, base, change).unwrap_or_else(|| text.clone())
        };
        let case = match &self.case {
            CaseRef::Sample => CaseRef::Sample,
            CaseRef::Path(path) => CaseRef::Path(change(path)),
            CaseRef::Arguments { masks, contexts } => CaseRef::Arguments {
                masks: masks.iter().map(|text| argument(text, true)).collect(),
                contexts: contexts.iter().map(|text| argument(text, false)).collect(),
            },
            CaseRef::Files { folder, manifest, left_out } => CaseRef::Files {
                folder: change(folder),
                manifest: manifest.clone(),
                left_out: left_out.clone(),
            },
        };
        let tracts = self.tracts.iter().map(|path| change(path)).collect();
        let alignments = self.alignments.iter().map(|alignment| alignment.with_files(change)).collect();
        Self { case, tracts, alignments }
    }
}

/// `path` without `.` and, where a folder precedes it, `..`.
fn without_dots(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            part => out.push(part),
        }
    }
    out
}

/// `path` seen from `folder`. On another drive it stays absolute.
pub(super) fn relative_to(path: &Path, folder: &Path) -> PathBuf {
    let (path, folder) = (without_dots(&absolute(path)), without_dots(&absolute(folder)));
    let (path_parts, folder_parts): (Vec<_>, Vec<_>) =
        (path.components().collect(), folder.components().collect());
    let common = path_parts.iter().zip(&folder_parts).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return path;
    }
    let up = folder_parts[common..].iter().map(|_| Component::ParentDir);
    let out: PathBuf = up.chain(path_parts[common..].iter().copied()).collect();
    if out.as_os_str().is_empty() { ".".into() } else { out }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_seen_from_a_folder_is_where_it_was() {
        let place = Place {
            case: CaseRef::Arguments { masks: vec!["T1=/a/b/m.nii:1@pre".into()], contexts: Vec::new() },
            tracts: vec!["/a/c/x.tck".into()],
            alignments: vec![Alignment::from_argument("T1=/a/b/t.tfm").unwrap()],
        };
        let relative = place.relative_to(Path::new("/a/b/sessions"));
        assert_eq!(relative.tracts, [Path::new("../../c/x.tck")]);
        assert_eq!(relative.alignments, [Alignment::from_argument("T1=../t.tfm").unwrap()]);
        let CaseRef::Arguments { masks, .. } = &relative.case else { panic!() };
        assert_eq!(masks, &["T1=../m.nii:1@pre"]);
        assert_eq!(relative.seen_from(Path::new("/a/b/sessions")), place);
        assert_eq!(relative.seen_from(Path::new("/z/y/sessions")).tracts, [Path::new("/z/c/x.tck")]);
        let files = |folder: &str| {
            let (manifest, left_out) = ("glioscope = 1".to_owned(), vec!["x.nii".into()]);
            let case = CaseRef::Files { folder: folder.into(), manifest, left_out };
            Place { case, tracts: Vec::new(), alignments: Vec::new() }
        };
        assert_eq!(files("/a/b").relative_to(Path::new("/a/c")), files("../b"));
        assert_eq!(files("../b").seen_from(Path::new("/a/c")), files("/a/b"));
        let folder = Place { case: CaseRef::Path("/a/b".into()), tracts: Vec::new(), alignments: Vec::new() };
        assert_eq!(folder.relative_to(Path::new("/a/b")).case, CaseRef::Path(".".into()));
        assert_eq!(folder.relative_to(Path::new("/a/b")).seen_from(Path::new("/a/b")), folder);
    }
}
