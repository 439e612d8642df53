//! Writing masks as a structure set (RTSTRUCT, PS3.3 A.19): closed contours along the edges of pixels, slice by slice.

use super::super::FileError;
use super::modules::{Object, SegmentToWrite, WriteTo, Written, not_empty};
use super::outline::outlines;
use super::slices_to_write::{Slices, words_of};
use super::tags;
use super::write::Elements;
use crate::{Check, MaskBits};

/// RT Structure Set Storage.
const SOP_CLASS: &str = "1.2.840.10008.5.1.4.1.1.481.3";

/// The study of an image, in references.
const STUDY_SOP_CLASS: &str = "1.2.840.10008.3.1.2.3.1";

/// What messages call it.
const WHAT: &str = "structure set";

/// Contours are rounded to this part of a millimetre: edges lie half a pixel from every centre.
const PER_MM: f64 = 1e6;

/// A DICOM structure set (RT Structure Set Storage, Explicit VR Little Endian) of masks on one grid; numbers from 1 in their
/// order. Contours go along the edges of pixels: the even-odd rule at pixel centres gives the voxels back. Holes are contours
/// of their own, without a cut to the outer one.
///
/// # Errors
/// As [`super::segmentation()`]; with an image also where the masks don't lie on its voxels, as contours mean voxels only on
/// its slices.
pub fn structure_set(segments: &[SegmentToWrite<'_>], to: &WriteTo<'_>) -> Result<Written, FileError> {
    let (segments, mut checks) = not_empty(segments, to, WHAT)?;
    let object = Object::of(SOP_CLASS, &segments, to, WHAT)?;
    let masks: Vec<&MaskBits> = segments.iter().map(|(_, segment)| segment.mask).collect();
    let slices = Slices::of(to.grid, &masks, to.source)
        .map_err(|unusable| FileError::wrong(WHAT, unusable.found, unusable.expected))?;
    if to.source.is_some() && slices.images.is_none() {
        return Err(FileError::wrong(
            WHAT,
            "masks that don't lie on the image's voxels",
            "masks on its slices (resample them, or write a segmentation)",
        ));
    }
    let mut data = object.elements("RTSTRUCT");
    data.text(tags::SERIES_NUMBER, "901");
    data.text(tags::INSTANCE_NUMBER, "1");
    data.empty(tags::OPERATORS_NAME);
    data.text(tags::STRUCTURE_SET_LABEL, "Masks");
    data.text(tags::STRUCTURE_SET_DATE, to.date);
    data.text(tags::STRUCTURE_SET_TIME, object.time());
    data.item(tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE, frame_of_reference(&object, &slices));
    data.items(
        tags::STRUCTURE_SET_ROI_SEQUENCE,
        segments.iter().enumerate().map(|(n, (name, _))| {
            let mut item = Elements::default();
            item.text(tags::ROI_NUMBER, &(n + 1).to_string());
            item.text(tags::REFERENCED_FRAME_OF_REFERENCE_UID, &object.frame_of_reference);
            item.text(tags::ROI_NAME, name);
            item.empty(tags::ROI_GENERATION_ALGORITHM);
            item
        }),
    );
    data.items(
        tags::RT_ROI_OBSERVATIONS_SEQUENCE,
        (1..=segments.len()).map(|number| {
            let mut item = Elements::default();
            item.text(tags::OBSERVATION_NUMBER, &number.to_string());
            item.text(tags::REFERENCED_ROI_NUMBER, &number.to_string());
            item.empty(tags::RT_ROI_INTERPRETED_TYPE);
            item.empty(tags::ROI_INTERPRETER);
            item
        }),
    );
    let (mut contours, mut with_holes) = (Vec::new(), Vec::new());
    for (n, (name, segment)) in segments.iter().enumerate() {
        let mut item = Elements::default();
        item.text(tags::REFERENCED_ROI_NUMBER, &(n + 1).to_string());
        if let Some(color) = segment.color {
            item.text(tags::ROI_DISPLAY_COLOR, &color.map(|part| part.to_string()).join("\\"));
        }
        let (all, has_holes) = contours_of(&object, &slices, &slices.masks[n]);
        item.items(tags::CONTOUR_SEQUENCE, all);
        contours.push(item);
        with_holes.extend(has_holes.then(|| name.clone()));
    }
    data.items(tags::ROI_CONTOUR_SEQUENCE, contours);
    if !with_holes.is_empty() {
        let names = crate::check::listed(&with_holes, 5);
        checks.push(Check::note(
            "dicom-write-holes",
            format!(
                "{WHAT}: {names}: holes are contours within contours; a program that fills every contour loses them"
            ),
        ));
    }
    Ok(Written { bytes: data.file(SOP_CLASS, &object.sop_instance), checks })
}

/// The frame of reference with the image's study, series and files.
fn frame_of_reference(object: &Object<'_>, slices: &Slices<'_>) -> Elements {
    let mut item = Elements::default();
    item.text(tags::FRAME_OF_REFERENCE_UID, &object.frame_of_reference);
    if let Some(source) = object.to.source {
        let (mut study, mut series) = (Elements::default(), Elements::default());
        series.text(tags::SERIES_INSTANCE_UID, &object.of_source(&source.series));
        series.items(tags::CONTOUR_IMAGE_SEQUENCE, object.files_of(slices));
        study.text(tags::REFERENCED_SOP_CLASS_UID, STUDY_SOP_CLASS);
        study.text(tags::REFERENCED_SOP_INSTANCE_UID, &object.study);
        study.item(tags::RT_REFERENCED_SERIES_SEQUENCE, series);
        item.item(tags::RT_REFERENCED_STUDY_SEQUENCE, study);
    }
    item
}

/// Contours of a mask, and whether some are holes.
fn contours_of(object: &Object<'_>, slices: &Slices<'_>, mask: &MaskBits) -> (Vec<Elements>, bool) {
    let (mut contours, mut has_holes) = (Vec::new(), false);
    for slice in 0..slices.dims[2] {
        if words_of(mask, slice).iter().all(|&word| word == 0) {
            continue;
        }
        for outline in outlines(mask, slice) {
            // Its signed area: outlines of holes turn the other way.
            let turns = (0..outline.len()).map(|n| {
                let (a, b) = (outline[n], outline[(n + 1) % outline.len()]);
                a[0] as i64 * b[1] as i64 - b[0] as i64 * a[1] as i64
            });
            has_holes |= turns.sum::<i64>() < 0;
            let rounded = |mm: f64| (mm * PER_MM).round() / PER_MM;
            let points: Vec<f64> = outline
                .iter()
                .flat_map(|&corner| slices.corner_mm(corner, slice).to_array().map(rounded))
                .collect();
            let mut item = Elements::default();
            if let Some(images) = slices.images {
                item.item(tags::CONTOUR_IMAGE_SEQUENCE, object.reference(&images[slice]));
            }
            item.text(tags::CONTOUR_GEOMETRIC_TYPE, "CLOSED_PLANAR");
            item.text(tags::NUMBER_OF_CONTOUR_POINTS, &outline.len().to_string());
            item.text(tags::CONTOUR_NUMBER, &(contours.len() + 1).to_string());
            item.decimals(tags::CONTOUR_DATA, &points);
            contours.push(item);
        }
    }
    (contours, has_holes)
}
