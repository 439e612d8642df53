//! An image or a mask from a file, a folder or one series of it.

use std::path::{Path, PathBuf};

use super::super::{FileError, Loaded, ReadOptions, Segment, Source};
use super::data_set::Unusable;
use super::pixels::{Layout, compression, stored};
use super::scan::{Header, Kind, header, in_file, of_parsed, parsed, read_bytes, scan, scan_beside};
use super::segmentation::{self, Segmentation};
use super::series::Series;
use super::structure_set::StructureSet;
use crate::Progress;

/// What a source names: the files of an image, or one file that holds masks, and what lies around it.
pub(super) struct Found {
    pub kind: Kind,
    /// The files themselves: all of an image's, or the one with masks.
    pub own: Vec<Header>,
    /// The other files of the folder.
    pub around: Vec<Header>,
    /// What messages call it.
    pub name: String,
}

impl Found {
    /// # Errors
    /// [`FileError::Wrong`] for a missing or unreadable file, another kind of object, an unknown series, and a folder of
    /// several series where none is named.
    pub fn of(source: &Source, progress: &Progress) -> Result<Self, FileError> {
        let (path, series) = match source {
            Source::File(path) => (path.as_path(), None),
            Source::Part(part) => (part.path.as_path(), part.series.as_deref()),
            Source::Embedded { name, .. } => {
                return Err(FileError::wrong(*name, "DICOM in the program", "a file or folder"));
            }
        };
        let name = source.name();
        if path.is_dir() {
            return Self::in_folder(path, series, name, progress);
        }
        let own = header(path)?;
        if series.is_some_and(|uid| uid != own.identity.series) {
            return Err(FileError::wrong(name, "another series", "the series that is named"));
        }
        let around = match own.kind {
            Kind::Segmentation | Kind::StructureSet => {
                let mut around = scan_beside(path, progress)?;
                around.retain(|other| other.path != own.path);
                around
            }
            _ => Vec::new(),
        };
        Self { kind: own.kind, own: vec![own], around, name }.checked()
    }

    fn in_folder(
        path: &Path,
        series: Option<&str>,
        name: String,
        progress: &Progress,
    ) -> Result<Self, FileError> {
        let scanned = scan(path, progress)?;
        let uid = match series {
            Some(uid) => uid.to_owned(),
            None => {
                let is_shown = |h: &&Header| !matches!(h.kind, Kind::Directory | Kind::Other);
                let mut uids: Vec<&str> =
                    scanned.headers.iter().filter(is_shown).map(|h| h.identity.series.as_str()).collect();
                uids.sort_unstable();
                uids.dedup();
                match uids[..] {
                    [] => {
                        let first = scanned.unreadable.into_iter().next();
                        let none = || {
                            FileError::wrong(
                                &name,
                                "no DICOM image, segmentation or structure set",
                                "a series",
                            )
                        };
                        return Err(first.unwrap_or_else(none));
                    }
                    [one] => one.to_owned(),
                    _ => {
                        let found = format!("{} series", uids.len());
                        return Err(FileError::wrong(
                            name,
                            found,
                            "one, or its UID (series = \"…\" in a manifest)",
                        ));
                    }
                }
            }
        };
        let (mut own, around): (Vec<Header>, Vec<Header>) =
            scanned.headers.into_iter().partition(|header| header.identity.series == uid);
        let Some(first) = own.first() else {
            return Err(FileError::wrong(name, format!("no series {uid}"), "one of the folder's"));
        };
        let kind = first.kind;
        // An unreadable file beside those of a series may be one of its slices.
        if let Some(error) = scanned.unreadable.into_iter().find(|error| is_beside(error, &own)) {
            return Err(error);
        }
        if matches!(kind, Kind::Segmentation | Kind::StructureSet) && own.len() > 1 {
            own.sort_by(|a, b| a.path.cmp(&b.path));
            let first = read_bytes(&own[0].path)?;
            let is_copy = |other: &Header| read_bytes(&other.path).is_ok_and(|bytes| bytes == first);
            if own[1..].iter().all(is_copy) {
                own.truncate(1);
            }
        }
        if matches!(kind, Kind::Segmentation | Kind::StructureSet) && own.len() > 1 {
            let found = format!("{} files in series {uid}", own.len());
            return Err(FileError::wrong(name, found, "one segmentation or structure set (name its file)"));
        }
        Self { kind, own, around, name }.checked()
    }

    fn checked(self) -> Result<Self, FileError> {
        match self.kind {
            Kind::Directory => Err(FileError::wrong(self.name, "a directory (DICOMDIR)", "its folder")),
            Kind::Other => {
                let modality = self.own.first().map(|h| h.identity.modality.clone()).unwrap_or_default();
                let found = format!("a DICOM object without pixels ({modality})");
                Err(FileError::wrong(self.name, found, "an image, a segmentation or a structure set"))
            }
            _ => Ok(self),
        }
    }

    /// The image, of which no pixels are read yet.
    pub fn image(&self) -> Result<Series<'_>, FileError> {
        Series::of(self.own.iter().collect(), &self.name)
    }
}

/// Whether an error is about a file in the folder of one of `headers`.
fn is_beside(error: &FileError, headers: &[Header]) -> bool {
    let FileError::Wrong { file, .. } = error else { return true };
    let folder = Path::new(file).parent();
    headers.iter().any(|header| header.path.parent() == folder)
}

/// As [`super::super::read()`].
pub(in super::super) fn read(
    source: &Source,
    options: &ReadOptions,
    progress: &Progress,
) -> Result<Loaded, FileError> {
    let found = Found::of(source, progress)?;
    if found.kind == Kind::Image {
        return found.image()?.read(options, progress);
    }
    let own = &found.own[0];
    let bytes = read_bytes(&own.path)?;
    let parsed = parsed(&own.path, &bytes)?;
    progress.check()?;
    if found.kind == Kind::Segmentation {
        return Segmentation::of(own, &parsed, &found.around)?.read(own, &parsed, options);
    }
    let set = StructureSet::of(&parsed.data, &super::series::base_name(&own.path));
    set.map_err(|unusable| in_file(&own.path, &unusable))?.read(own, &found.around, options)
}

/// As [`super::super::segments()`].
pub(in super::super) fn segments(source: &Source, progress: &Progress) -> Result<Vec<Segment>, FileError> {
    let found = Found::of(source, progress)?;
    match found.kind {
        Kind::Segmentation | Kind::StructureSet => segments_of(&found.own[0]),
        _ => Ok(Vec::new()),
    }
}

/// Reads a file from memory as far as it goes alone: data set, place, masks and pixels without a codec. Returns the number
/// of frames. For tests with damaged bytes.
///
/// # Errors
/// As [`super::super::read()`].
pub fn inspect(bytes: &[u8], max_bytes: u64) -> Result<usize, FileError> {
    let path = Path::new("bytes.dcm");
    let parsed = parsed(path, bytes)?;
    let own = of_parsed(path, &parsed, bytes.len() as u64);
    let wrong = |unusable: Unusable| in_file(path, &unusable);
    match own.kind {
        Kind::Segmentation => {
            let options = ReadOptions { max_bytes, frame: 0 };
            Ok(Segmentation::of(&own, &parsed, &[])?.read(&own, &parsed, &options)?.frames)
        }
        Kind::StructureSet => {
            let options = ReadOptions { max_bytes, frame: 0 };
            let set = StructureSet::of(&parsed.data, "bytes.dcm").map_err(wrong)?;
            Ok(set.read(&own, &[], &options)?.frames)
        }
        Kind::Directory | Kind::Other => Ok(0),
        Kind::Image => {
            let series = Series::of(vec![&own], "bytes.dcm")?;
            let (format, frames) = own.image.as_ref().map_err(|u| in_file(path, u))?;
            if format.bytes() <= max_bytes
                && compression(&parsed.transfer_syntax).is_ok_and(|c| !c.is_codec())
            {
                let layout = Layout::of(&parsed, format).map_err(wrong)?;
                for frame in frames {
                    stored(&parsed, &layout, format, frame.number).map_err(wrong)?;
                }
            }
            Ok(series.stacks.len())
        }
    }
}

/// As [`super::super::files_of`], of a folder.
pub(in super::super) fn files_of(source: &Source) -> Vec<PathBuf> {
    let found = Found::of(source, &Progress::new());
    found.map(|found| found.own.into_iter().map(|header| header.path).collect()).unwrap_or_default()
}

/// The masks of a file.
pub(super) fn segments_of(own: &Header) -> Result<Vec<Segment>, FileError> {
    let wrong = |unusable: Unusable| in_file(&own.path, &unusable);
    let bytes = read_bytes(&own.path)?;
    let parsed = parsed(&own.path, &bytes)?;
    if own.kind == Kind::Segmentation {
        return segmentation::segments(&parsed.data).map_err(wrong);
    }
    Ok(StructureSet::of(&parsed.data, &own.name()).map_err(wrong)?.segments())
}
