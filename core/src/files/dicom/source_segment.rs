//! The segment that a mask was read from: what a report refers to.

use super::super::{FileError, Part, Source, Which};
use super::open::Found;
use super::report_write::Reference;
use super::scan::{Kind, parsed, read_bytes};
use super::tags;
use crate::Progress;

/// A segment of a DICOM segmentation. See [`source_segment()`].
#[derive(Clone, Debug)]
pub struct SourceSegment {
    pub(super) study: String,
    pub(super) series: String,
    pub(super) file: Reference,
    /// Segment Number.
    pub(super) number: i64,
    /// The series of the image that was segmented.
    pub(super) image_series: String,
}

/// The segment that `source` names; `None` for what isn't one segment of a DICOM segmentation, or one that doesn't state the
/// series of its image.
///
/// # Errors
/// [`FileError`] for a file that can't be read; cancelled.
pub fn source_segment(source: &Source, progress: &Progress) -> Result<Option<SourceSegment>, FileError> {
    let Source::Part(Part { path, which: Which::Segment(number), .. }) = source else { return Ok(None) };
    if !path.is_dir() && !super::is_dicom(path) {
        return Ok(None);
    }
    let found = Found::of(source, progress)?;
    let ([own], Kind::Segmentation) = (found.own.as_slice(), found.kind) else { return Ok(None) };
    let bytes = read_bytes(&own.path)?;
    let parsed = parsed(&own.path, &bytes)?;
    let series = parsed.data.items(tags::REFERENCED_SERIES_SEQUENCE);
    let [image] = series else { return Ok(None) };
    let identity = &own.identity;
    let segment = SourceSegment {
        study: identity.study.clone(),
        series: identity.series.clone(),
        file: Reference {
            sop_class: identity.sop_class.clone(),
            sop_instance: identity.sop_instance.clone(),
        },
        number: *number,
        image_series: image.text(tags::SERIES_INSTANCE_UID).unwrap_or_default(),
    };
    let uids = [
        &segment.study,
        &segment.series,
        &segment.file.sop_class,
        &segment.file.sop_instance,
        &segment.image_series,
    ];
    let is_uid = |uid: &&String| {
        (1..=64).contains(&uid.len()) && uid.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.')
    };
    Ok(uids.iter().all(is_uid).then_some(segment))
}
