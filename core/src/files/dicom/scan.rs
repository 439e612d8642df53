//! Headers of files: one file, and all files of a folder in parallel.

use std::fs::File as Opened;
use std::io::Read;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::super::{FileError, Origin, open_regular, printable, stand_in};
use super::data_set::Unusable;
use super::instance::{Frame, Identity, PixelFormat, frames};
use super::parse::{Fault, Parsed, parse, sniff};
use super::suv::Activity;
use super::tags;
use crate::Progress;

/// Bytes read at first: headers are mostly shorter.
const HEAD_BYTES: u64 = 32 << 10;

/// Largest file that is read whole.
const MAX_FILE_BYTES: u64 = 8 << 30;

/// Most files and folders that a folder of studies may have.
const MAX_ENTRIES: usize = 200_000;

/// Deepest folder below the one that is searched.
const MAX_FOLDER_DEPTH: usize = 32;

/// What an object is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// Slices, with or without a known place.
    Image,
    /// A segmentation (SEG), binary, fractional or a label map.
    Segmentation,
    /// A structure set of contours (RTSTRUCT).
    StructureSet,
    /// A directory of other files (DICOMDIR).
    Directory,
    /// A report, a plan, a presentation state or another object without pixels to show.
    Other,
}

/// A file's header.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub path: PathBuf,
    pub kind: Kind,
    pub identity: Identity,
    /// Pixels and their frames, of an image; why there are none that can be shown.
    pub image: Result<(PixelFormat, Vec<Frame>), Unusable>,
    /// UID of the transfer syntax.
    pub transfer_syntax: String,
    /// What values of PET mean.
    pub activity: Option<Box<Activity>>,
    /// Range of stored values that are no measurement.
    pub padding: Option<(f64, f64)>,
    pub file_bytes: u64,
}

impl Header {
    /// Whose it is and which space it claims.
    pub fn origin(&self) -> Origin {
        let identity = &self.identity;
        Origin {
            patient: identity.patient.label(),
            patient_name: identity.patient.words(),
            patient_id: identity.patient.id.clone(),
            birth_date: identity.patient.birth_date.clone(),
            sex: identity.patient.sex.clone(),
            study_description: identity.study_description.clone(),
            accession_number: identity.accession_number.clone(),
            frame_of_reference: identity.frame_of_reference.clone(),
        }
    }

    /// What the file is called in messages.
    pub fn name(&self) -> String {
        printable(&self.path.display().to_string())
    }
}

/// An error about `path`.
pub(super) fn in_file(path: &Path, wrong: &Unusable) -> FileError {
    FileError::wrong(
        printable(&path.display().to_string()),
        printable(&wrong.found),
        printable(&wrong.expected),
    )
}

/// The bytes of a file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let (file, file_bytes) = open_regular(path)?;
    if file_bytes > MAX_FILE_BYTES {
        return Err(in_file(
            path,
            &Unusable::new(format!("{file_bytes} bytes"), format!("at most {MAX_FILE_BYTES}")),
        ));
    }
    let mut bytes = Vec::with_capacity(usize::try_from(file_bytes).unwrap_or_default());
    read_up_to(path, file, file_bytes, &mut bytes)?;
    Ok(bytes)
}

fn read_up_to(path: &Path, file: Opened, most: u64, bytes: &mut Vec<u8>) -> Result<(), FileError> {
    let read = file.take(most).read_to_end(bytes);
    read.map(drop).map_err(|e| in_file(path, &Unusable::new(e.to_string(), "a file that can be read")))
}

/// The data set of a file's bytes.
pub(super) fn parsed<'a>(path: &Path, bytes: &'a [u8]) -> Result<Parsed<'a>, FileError> {
    if let Some((found, expected)) = stand_in(bytes) {
        return Err(in_file(path, &Unusable::new(found, expected)));
    }
    if bytes.is_empty() {
        return Err(in_file(path, &Unusable::new("an empty file", "DICOM")));
    }
    parse(bytes, bytes.len() as u64, false).map_err(|fault| match fault {
        Fault::Wrong(wrong) => in_file(path, &wrong),
        Fault::NeedsMore => in_file(path, &Unusable::new("the end of the file", "a whole file")),
    })
}

/// The header of a file. Its pixels are not read.
///
/// # Errors
/// [`FileError::Wrong`] for another kind of file and for any defect up to the pixels.
pub(super) fn header(path: &Path) -> Result<Header, FileError> {
    let (file, file_bytes) = open_regular(path)?;
    let mut bytes = Vec::new();
    read_up_to(path, file, HEAD_BYTES.min(file_bytes), &mut bytes)?;
    if let Some((found, expected)) = stand_in(&bytes) {
        return Err(in_file(path, &Unusable::new(found, expected)));
    }
    match parse(&bytes, file_bytes, true) {
        Ok(parsed) => Ok(of_parsed(path, &parsed, file_bytes)),
        Err(Fault::Wrong(wrong)) => Err(in_file(path, &wrong)),
        Err(Fault::NeedsMore) => {
            let bytes = read_bytes(path)?;
            Ok(of_parsed(path, &parsed(path, &bytes)?, file_bytes))
        }
    }
}

/// The header of a file that was read.
pub(super) fn of_parsed(path: &Path, parsed: &Parsed<'_>, file_bytes: u64) -> Header {
    let data = &parsed.data;
    let identity = Identity::of(data);
    let kind = match identity.sop_class.as_str() {
        "1.2.840.10008.5.1.4.1.1.66.4" | "1.2.840.10008.5.1.4.1.1.66.7" => Kind::Segmentation,
        "1.2.840.10008.5.1.4.1.1.481.3" => Kind::StructureSet,
        "1.2.840.10008.1.3.10" => Kind::Directory,
        _ if data.has(tags::DIRECTORY_RECORD_SEQUENCE) => Kind::Directory,
        _ if data.pixels().is_some() || data.has(tags::ROWS) => Kind::Image,
        _ => Kind::Other,
    };
    let image = if kind == Kind::Image {
        PixelFormat::of(data).and_then(|format| {
            if format.bits_allocated == 1 {
                return Err(Unusable::new("an image of 1 bit a pixel", "8, 16 or 32 bits"));
            }
            Ok((format, frames(data, &format)?))
        })
    } else {
        Err(Unusable::new("no image", "an image"))
    };
    let signed = image.as_ref().is_ok_and(|(format, _)| format.is_signed);
    let padding_value = |tag| {
        let raw = data.u16(tag)?;
        Some(if signed { f64::from(raw.cast_signed()) } else { f64::from(raw) })
    };
    let padding = padding_value(tags::PIXEL_PADDING_VALUE).map(|value| {
        let limit = padding_value(tags::PIXEL_PADDING_RANGE_LIMIT).unwrap_or(value);
        (value.min(limit), value.max(limit))
    });
    let activity = (identity.modality == "PT").then(|| Box::new(Activity::of(data)));
    Header {
        path: path.to_owned(),
        kind,
        identity,
        image,
        transfer_syntax: parsed.transfer_syntax.clone(),
        activity,
        padding,
        file_bytes,
    }
}

/// What a folder holds.
#[derive(Debug, Default)]
pub(super) struct Scanned {
    /// Headers, in the order of their paths.
    pub headers: Vec<Header>,
    /// DICOM files that can't be read, and why.
    pub unreadable: Vec<FileError>,
    /// Folders that weren't searched, and why.
    pub left_out: Vec<FileError>,
    /// Files of other kinds.
    pub others: usize,
}

/// The headers of all files below `folder`, in parallel.
///
/// # Errors
/// [`FileError`] where a folder can't be listed, or holds more than 200,000 files; cancelled.
pub(super) fn scan(folder: &Path, progress: &Progress) -> Result<Scanned, FileError> {
    let mut listed = Listed::default();
    list(folder, 0, &mut listed)?;
    let mut scanned = scan_files(listed.paths, progress)?;
    scanned.left_out = listed.left_out;
    Ok(scanned)
}

/// The headers of the files in the folder of `path`, without those in folders below.
///
/// # Errors
/// As [`scan`].
pub(super) fn scan_beside(path: &Path, progress: &Progress) -> Result<Vec<Header>, FileError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut listed = Listed::default();
    list(folder, MAX_FOLDER_DEPTH, &mut listed)?;
    Ok(scan_files(listed.paths, progress)?.headers)
}

fn scan_files(mut paths: Vec<PathBuf>, progress: &Progress) -> Result<Scanned, FileError> {
    paths.sort();
    progress.expect(paths.len() as u64);
    let results: Result<Vec<_>, FileError> = paths
        .par_iter()
        .map(|path| {
            progress.advance(1)?;
            // What can't be opened may be a slice.
            Ok(match super::super::read_head(path, 256) {
                None => Some(header(path)),
                Some(head) => sniff(&head).then(|| header(path)),
            })
        })
        .collect();
    let mut scanned = Scanned::default();
    for result in results? {
        match result {
            Some(Ok(header)) => scanned.headers.push(header),
            Some(Err(error)) => scanned.unreadable.push(error),
            None => scanned.others += 1,
        }
    }
    Ok(scanned)
}

/// The files below a folder.
#[derive(Default)]
struct Listed {
    paths: Vec<PathBuf>,
    /// Folders that weren't searched, and why.
    left_out: Vec<FileError>,
}

/// An error stops the search only for `folder` itself: one folder below that can't be read hides no others.
fn list(folder: &Path, depth: usize, listed: &mut Listed) -> Result<(), FileError> {
    let cant =
        |e: std::io::Error| in_file(folder, &Unusable::new(e.to_string(), "a folder that can be read"));
    for entry in std::fs::read_dir(folder).map_err(cant)? {
        let entry = entry.map_err(cant)?;
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let path = entry.path();
        let left_out = |found: &str, expected: &str| in_file(&path, &Unusable::new(found, expected));
        let kind = entry.file_type();
        if kind.as_ref().is_ok_and(std::fs::FileType::is_dir) {
            if depth < MAX_FOLDER_DEPTH {
                if let Err(error) = list(&path, depth + 1, listed) {
                    listed.left_out.push(error);
                }
            } else {
                let expected = format!("at most {MAX_FOLDER_DEPTH} folders inside each other");
                listed.left_out.push(left_out("a folder too deep", &expected));
            }
        } else if path.is_file() {
            listed.paths.push(path);
        } else if kind.is_ok_and(|kind| kind.is_symlink()) && path.is_dir() {
            // Links to folders aren't followed: they may lead in circles. Links to files are.
            listed.left_out.push(left_out("a link to a folder", "the folder itself"));
        }
        if listed.paths.len() > MAX_ENTRIES {
            return Err(in_file(folder, &Unusable::new(format!("more than {MAX_ENTRIES} files"), "fewer")));
        }
    }
    Ok(())
}
