//! The image that masks were drawn on: what files with masks repeat of it and refer to.

use std::path::Path;

use glam::DVec3;

use super::super::{FileError, Part, Source, Which};
use super::data_set::{DataSet, Unusable};
use super::open::Found;
use super::planes::Planes;
use super::scan::{Kind, header, in_file, parsed, read_bytes};
use super::tags::{self, Tag};
use crate::Progress;

/// Longest text about a patient or study that is repeated.
const MAX_TEXT: usize = 1024;

/// An image series: whose it is, and its slices. See [`source_image()`].
#[derive(Clone, Debug)]
pub struct SourceImage {
    /// Attributes of the patient and study as stored, in the order of [`IDENTITY`].
    pub(super) identity: Vec<(Tag, String)>,
    pub(super) study: String,
    pub(super) series: String,
    pub(super) frame_of_reference: String,
    /// Its volumes, the largest first.
    pub(super) volumes: Vec<SourceVolume>,
}

impl SourceImage {
    /// Its Series Instance UID.
    pub fn series(&self) -> &str {
        &self.series
    }
}

/// A volume of a series.
#[derive(Clone, Debug)]
pub(super) struct SourceVolume {
    pub planes: Planes,
    /// In the order of their slices.
    pub slices: Vec<SourceSlice>,
}

/// A slice, by the file that holds it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SourceSlice {
    pub sop_class: String,
    pub sop_instance: String,
    /// Number of its frame, from 1, in a file of several.
    pub frame: Option<usize>,
    /// Centre of its first pixel, LPS millimetres.
    pub position_mm: DVec3,
}

/// What objects of a study state alike of patient and study (PS3.3 C.7.1.1, C.7.2.1), and what identifies both.
pub(super) const IDENTITY: [Tag; 10] = [
    tags::PATIENT_NAME,
    tags::PATIENT_ID,
    tags::ISSUER_OF_PATIENT_ID,
    tags::PATIENT_BIRTH_DATE,
    tags::PATIENT_SEX,
    tags::STUDY_DATE,
    tags::STUDY_TIME,
    tags::ACCESSION_NUMBER,
    tags::REFERRING_PHYSICIAN_NAME,
    tags::STUDY_ID,
];

/// The image of `path`: one of its series' files, or a folder, of which `series` (a Series Instance UID) names a series where
/// it has several. Headers are read, and no pixels.
///
/// # Errors
/// [`FileError::Wrong`] for what isn't an image with equally spaced slices, and for missing or malformed UIDs; cancelled.
pub fn source_image(
    path: &Path,
    series: Option<&str>,
    progress: &Progress,
) -> Result<SourceImage, FileError> {
    let (folder, series) = if path.is_dir() {
        (path, series.map(str::to_owned))
    } else {
        let own = header(path)?.identity.series;
        if let Some(series) = series.filter(|series| *series != own) {
            let found = format!("series {own}");
            return Err(in_file(path, &Unusable::new(found, format!("series {series}"))));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        (folder.unwrap_or(Path::new(".")), Some(own))
    };
    let source = Source::Part(Part { path: folder.to_owned(), series, which: Which::Frame(0) });
    let found = Found::of(&source, progress)?;
    if found.kind != Kind::Image {
        return Err(FileError::wrong(found.name, "masks", "the image that masks were drawn on"));
    }
    let image = found.image()?;
    let first = image.files[0];
    let wrong = |unusable: Unusable| in_file(&first.path, &unusable);
    let mut volumes = Vec::new();
    for stack in image.stacks.iter().filter(|stack| !stack.is_localizer) {
        let Ok(step) = &stack.step else { continue };
        let planes = Planes {
            first: stack.first,
            step_mm: step.step_mm,
            dims: stack.dims,
            series: first.identity.series.clone(),
        };
        let mut slices = Vec::new();
        for slice in &stack.slices {
            let file = image.files[slice.file];
            let Ok((format, frames)) = &file.image else { continue };
            let Some(frame) = frames.get(slice.frame) else { continue };
            slices.push(SourceSlice {
                sop_class: checked_uid(&file.identity.sop_class, tags::SOP_CLASS_UID).map_err(wrong)?,
                sop_instance: checked_uid(&file.identity.sop_instance, tags::SOP_INSTANCE_UID)
                    .map_err(wrong)?,
                frame: (format.frames > 1).then_some(slice.frame + 1),
                position_mm: frame.place.position_mm,
            });
        }
        volumes.push(SourceVolume { planes, slices });
    }
    if volumes.is_empty() {
        return Err(FileError::wrong(found.name, "no equally spaced slices", "an image with some"));
    }
    let bytes = read_bytes(&first.path)?;
    let identity = identity(&parsed(&first.path, &bytes)?.data).map_err(wrong)?;
    let own = &first.identity;
    Ok(SourceImage {
        identity,
        study: checked_uid(&own.study, tags::STUDY_INSTANCE_UID).map_err(wrong)?,
        series: checked_uid(&own.series, tags::SERIES_INSTANCE_UID).map_err(wrong)?,
        frame_of_reference: checked_uid(&own.frame_of_reference, tags::FRAME_OF_REFERENCE_UID)
            .map_err(wrong)?,
        volumes,
    })
}

fn identity(data: &DataSet) -> Result<Vec<(Tag, String)>, Unusable> {
    IDENTITY
        .into_iter()
        .map(|tag| {
            let text = data.text(tag).unwrap_or_default();
            if text.len() > MAX_TEXT {
                let found = format!("{} bytes at {tag}", text.len());
                return Err(Unusable::new(found, format!("at most {MAX_TEXT}")));
            }
            Ok((tag, text))
        })
        .collect()
}

/// A UID that can be repeated (PS3.5 9.1): what a hostile file states in its place is not.
fn checked_uid(uid: &str, tag: Tag) -> Result<String, Unusable> {
    let is_uid =
        (1..=64).contains(&uid.len()) && uid.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    if is_uid {
        return Ok(uid.to_owned());
    }
    let shown: String = uid.chars().take(64).collect();
    Err(Unusable::new(format!("{shown:?} at {tag}"), "a UID of digits and dots"))
}
