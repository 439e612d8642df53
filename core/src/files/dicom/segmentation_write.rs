//! Writing masks as a segmentation (SEG, PS3.3 A.51): BINARY, a frame for each slice of a mask that isn't empty.

use super::super::FileError;
use super::modules::{Object, SegmentToWrite, WriteTo, Written, not_empty};
use super::segmentation::encoded_color;
use super::slices_to_write::{Slices, words_of};
use super::source_image::SourceSlice;
use super::tags;
use super::write::Elements;
use crate::{Check, MaskBits};

/// Segmentation Storage.
const SOP_CLASS: &str = "1.2.840.10008.5.1.4.1.1.66.4";

/// What messages call it.
const WHAT: &str = "segmentation";

/// What a mask is of, as nothing else is known (the default of 3D Slicer, too).
const TISSUE: [&str; 3] = ["85756007", "SCT", "Tissue"];

/// Most frames of a file, as those that are read.
const MAX_FRAMES: usize = 1 << 20;

/// Most bytes of pixels: a length of 32 bits.
const MAX_PIXEL_BYTES: u64 = 0xffff_fffe;

/// A DICOM segmentation (Segmentation Storage, BINARY, Explicit VR Little Endian) of masks on one grid; numbers from 1 in their
/// order. On the slices of `to.source` where voxels coincide, whatever the order of axes.
///
/// # Errors
/// [`FileError::Wrong`] where no mask has voxels, for a grid whose slices can't be slices of DICOM (rows and columns that
/// aren't orthogonal, sides that are unknown), and for a malformed date.
pub fn segmentation(segments: &[SegmentToWrite<'_>], to: &WriteTo<'_>) -> Result<Written, FileError> {
    let (segments, mut checks) = not_empty(segments, to, WHAT)?;
    let object = Object::of(SOP_CLASS, &segments, to, WHAT)?;
    let masks: Vec<&MaskBits> = segments.iter().map(|(_, segment)| segment.mask).collect();
    let wrong = |found: String, expected: &str| FileError::wrong(WHAT, found, expected);
    let slices = Slices::of(to.grid, &masks, to.source).map_err(|u| wrong(u.found, &u.expected))?;
    if to.source.is_some() && slices.images.is_none() {
        checks.push(Check::warning(
            "dicom-write-own-grid",
            format!(
                "{WHAT}: the masks don't lie on the image's voxels; written on slices of their own, which name no image"
            ),
        ));
    }
    let mut frames: Vec<(usize, usize)> = Vec::new();
    for (segment, mask) in slices.masks.iter().enumerate() {
        let is_used = |slice: &usize| words_of(mask, *slice).iter().any(|&word| word != 0);
        frames.extend((0..slices.dims[2]).filter(is_used).map(|slice| (segment, slice)));
    }
    let pixels = (slices.dims[0] * slices.dims[1]) as u64;
    if frames.len() > MAX_FRAMES || (pixels * frames.len() as u64).div_ceil(8) > MAX_PIXEL_BYTES {
        return Err(wrong(format!("{} frames of {pixels} pixels", frames.len()), "at most 4 GiB of bits"));
    }

    let mut data = object.elements("SEG");
    data.text(tags::SERIES_NUMBER, "900");
    data.text(tags::INSTANCE_NUMBER, "1");
    data.text(tags::CONTENT_DATE, to.date);
    data.text(tags::CONTENT_TIME, object.time());
    data.text(tags::IMAGE_TYPE, "DERIVED\\PRIMARY");
    data.text(tags::CONTENT_LABEL, "SEGMENTATION");
    data.empty(tags::CONTENT_DESCRIPTION);
    data.empty(tags::CONTENT_CREATOR_NAME);
    data.text(tags::LOSSY_IMAGE_COMPRESSION, "00");
    data.text(tags::SEGMENTATION_TYPE, "BINARY");
    data.text(tags::SEGMENTS_OVERLAP, if overlap(&slices) { "YES" } else { "NO" });
    data.items(
        tags::SEGMENT_SEQUENCE,
        segments.iter().enumerate().map(|(n, (name, segment))| described(n, name, segment)),
    );
    put_pixel_format(&mut data, &slices, frames.len());
    put_dimensions(&mut data, &object);
    data.item(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE, shared(&slices));
    let mut ranks: Vec<usize> = frames.iter().map(|(_, slice)| *slice).collect();
    ranks.sort_unstable();
    ranks.dedup();
    let rank = |slice: usize| ranks.partition_point(|&other| other < slice) + 1;
    data.items(
        tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE,
        frames.iter().map(|&(segment, slice)| {
            let image = slices.images.map(|images| &images[slice]);
            of_frame(&object, segment + 1, rank(slice), slices.positions_mm[slice].to_array(), image)
        }),
    );
    if let (Some(source), Some(_)) = (to.source, slices.images) {
        let mut series = Elements::default();
        series.text(tags::SERIES_INSTANCE_UID, &object.of_source(&source.series));
        series.items(tags::REFERENCED_INSTANCE_SEQUENCE, object.files_of(&slices));
        data.item(tags::REFERENCED_SERIES_SEQUENCE, series);
    }
    data.bytes(tags::PIXEL_DATA, bits(&slices, &frames));
    Ok(Written { bytes: data.file(SOP_CLASS, &object.sop_instance), checks })
}

/// Whether two masks share a voxel.
fn overlap(slices: &Slices<'_>) -> bool {
    let Some((first, others)) = slices.masks.split_first() else { return false };
    let mut seen = first.words().to_vec();
    others.iter().any(|mask| {
        seen.iter_mut().zip(mask.words()).any(|(seen, word)| {
            let both = *seen & word;
            *seen |= word;
            both != 0
        })
    })
}

fn described(n: usize, name: &str, segment: &SegmentToWrite<'_>) -> Elements {
    let mut item = Elements::default();
    item.code(tags::SEGMENTED_PROPERTY_CATEGORY_CODE_SEQUENCE, TISSUE);
    item.code(tags::SEGMENTED_PROPERTY_TYPE_CODE_SEQUENCE, TISSUE);
    item.u16s(tags::SEGMENT_NUMBER, &[n as u16 + 1]);
    item.text(tags::SEGMENT_LABEL, name);
    // How a mask came about isn't known; this says least.
    item.text(tags::SEGMENT_ALGORITHM_TYPE, "SEMIAUTOMATIC");
    item.text(tags::SEGMENT_ALGORITHM_NAME, "Unknown");
    if let Some(color) = segment.color {
        item.u16s(tags::RECOMMENDED_DISPLAY_CIELAB_VALUE, &encoded_color(color));
    }
    item
}

fn put_pixel_format(data: &mut Elements, slices: &Slices<'_>, frames: usize) {
    data.u16s(tags::SAMPLES_PER_PIXEL, &[1]);
    data.text(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2");
    data.text(tags::NUMBER_OF_FRAMES, &frames.to_string());
    // At most 65535, as checked with the slices.
    data.u16s(tags::ROWS, &[slices.dims[1] as u16]);
    data.u16s(tags::COLUMNS, &[slices.dims[0] as u16]);
    data.u16s(tags::BITS_ALLOCATED, &[1]);
    data.u16s(tags::BITS_STORED, &[1]);
    data.u16s(tags::HIGH_BIT, &[0]);
    data.u16s(tags::PIXEL_REPRESENTATION, &[0]);
}

/// Multi-frame Dimension (PS3.3 C.7.6.17): segment, then position.
fn put_dimensions(data: &mut Elements, object: &Object<'_>) {
    let organization = object.uid("dimensions");
    let mut item = Elements::default();
    item.text(tags::DIMENSION_ORGANIZATION_UID, &organization);
    data.item(tags::DIMENSION_ORGANIZATION_SEQUENCE, item);
    let dimensions = [
        (tags::REFERENCED_SEGMENT_NUMBER, tags::SEGMENT_IDENTIFICATION_SEQUENCE, "Segment"),
        (tags::IMAGE_POSITION_PATIENT, tags::PLANE_POSITION_SEQUENCE, "Position"),
    ];
    data.items(
        tags::DIMENSION_INDEX_SEQUENCE,
        dimensions.map(|(index, group, label)| {
            let mut item = Elements::default();
            item.text(tags::DIMENSION_ORGANIZATION_UID, &organization);
            item.pointer(tags::DIMENSION_INDEX_POINTER, index);
            item.pointer(tags::FUNCTIONAL_GROUP_POINTER, group);
            item.text(tags::DIMENSION_DESCRIPTION_LABEL, label);
            item
        }),
    );
}

fn shared(slices: &Slices<'_>) -> Elements {
    let (mut measures, mut orientation, mut groups) =
        (Elements::default(), Elements::default(), Elements::default());
    measures.decimals(tags::SLICE_THICKNESS, &[slices.step_mm]);
    measures.decimals(tags::SPACING_BETWEEN_SLICES, &[slices.step_mm]);
    measures.decimals(tags::PIXEL_SPACING, &slices.pixel_spacing_mm);
    groups.item(tags::PIXEL_MEASURES_SEQUENCE, measures);
    let cosines = [slices.along_row.to_array(), slices.along_column.to_array()].concat();
    orientation.decimals(tags::IMAGE_ORIENTATION_PATIENT, &cosines);
    groups.item(tags::PLANE_ORIENTATION_SEQUENCE, orientation);
    groups
}

fn of_frame(
    object: &Object<'_>,
    number: usize,
    rank: usize,
    position_mm: [f64; 3],
    image: Option<&SourceSlice>,
) -> Elements {
    let mut groups = Elements::default();
    let mut item = Elements::default();
    item.u32s(tags::DIMENSION_INDEX_VALUES, &[number as u32, rank as u32]);
    groups.item(tags::FRAME_CONTENT_SEQUENCE, item);
    let mut item = Elements::default();
    item.decimals(tags::IMAGE_POSITION_PATIENT, &position_mm);
    groups.item(tags::PLANE_POSITION_SEQUENCE, item);
    let mut item = Elements::default();
    item.u16s(tags::REFERENCED_SEGMENT_NUMBER, &[number as u16]);
    groups.item(tags::SEGMENT_IDENTIFICATION_SEQUENCE, item);
    if let Some(image) = image {
        let mut source = object.reference(image);
        source.text(tags::SPATIAL_LOCATIONS_PRESERVED, "YES");
        source.code(
            tags::PURPOSE_OF_REFERENCE_CODE_SEQUENCE,
            ["121322", "DCM", "Source image for image processing operation"],
        );
        let mut derivation = Elements::default();
        derivation.item(tags::SOURCE_IMAGE_SEQUENCE, source);
        derivation.code(tags::DERIVATION_CODE_SEQUENCE, ["113076", "DCM", "Segmentation"]);
        groups.item(tags::DERIVATION_IMAGE_SEQUENCE, derivation);
    }
    groups
}

/// All frames as one string of bits, the lowest bit of a byte first: frames begin within bytes.
fn bits(slices: &Slices<'_>, frames: &[(usize, usize)]) -> Vec<u8> {
    let [columns, rows, _] = slices.dims;
    let mut bytes = vec![0; (columns * rows * frames.len()).div_ceil(8)];
    for (frame, &(segment, slice)) in frames.iter().enumerate() {
        let mask = &slices.masks[segment];
        for (row, line) in words_of(mask, slice).chunks_exact(mask.words_per_line()).enumerate() {
            let first = (frame * rows + row) * columns;
            for (n, &word) in line.iter().enumerate() {
                let mut left = word;
                while left != 0 {
                    let at = first + n * 64 + left.trailing_zeros() as usize;
                    bytes[at / 8] |= 1 << (at % 8);
                    left &= left - 1;
                }
            }
        }
    }
    bytes
}
