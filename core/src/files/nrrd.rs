//! Reading NRRD (`.nrrd`, and `.nhdr` with data files) and the segmentations that 3D Slicer writes in it (`.seg.nrrd`).

use std::path::{Path, PathBuf};

use super::{
    FileError, Loaded, ReadOptions, Segment, Source, detached,
    image::{Image, ImageInfo},
    nrrd_header::Fields,
    nrrd_segments,
    opened::base_name,
    stored_file::Place,
    stored_voxels::Parts,
    voxels::Layout,
};
use crate::{Check, Progress, check::listed};

/// Whether a file that begins with these bytes is NRRD.
pub(super) fn sniff(begin: &[u8]) -> bool {
    begin.starts_with(b"NRRD000")
}

/// As [`super::read()`].
pub(super) fn read(source: &Source, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    image(&source.into(), progress)?.read(options, progress)
}

/// As [`super::read()`], from memory; messages call the file `name`. Voxels in other files are refused.
///
/// # Errors
/// As [`super::read()`].
pub fn read_nrrd_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    progress: &Progress,
) -> Result<Loaded, FileError> {
    image(&Place::Bytes(name, bytes), progress)?.read(options, progress)
}

/// As [`super::info()`].
pub(super) fn info(source: &Source, progress: &Progress) -> Result<ImageInfo, FileError> {
    image(&source.into(), progress)?.info(progress)
}

/// As [`super::segments()`].
pub(super) fn segments(source: &Source, progress: &Progress) -> Result<Vec<Segment>, FileError> {
    Ok(image(&source.into(), progress)?.segments)
}

/// The data files of a header, as far as it names any that exist.
pub(super) fn other_files(path: &Path) -> Vec<PathBuf> {
    let image = image(&Place::File(path.to_owned()), &Progress::new());
    image.map_or_else(|_| Vec::new(), |image| detached::others(image.parts.files, path))
}

fn image<'a>(place: &Place<'a>, progress: &Progress) -> Result<Image<'a>, FileError> {
    progress.check()?;
    let fields = Fields::read(place, &Progress::new())?;
    let (file, name) = (place.name(), base_name(&place.name()));
    let fault = |fault: super::nifti_header::Fault| fault.in_file(&file);
    let mut checks = Vec::new();
    if !fields.unknown.is_empty() {
        let text =
            format!("{name}: fields that the format doesn't have: {}; ignored", listed(&fields.unknown, 8));
        checks.push(Check::note("header-field-unknown", text));
    }
    let sizes = fields.sizes().map_err(fault)?;
    let sample_type = fields.sample_type().map_err(fault)?;
    let (encoding, coding) = fields.coding().map_err(fault)?;
    let order = fields.order(sample_type, coding).map_err(fault)?;
    let (lines, skip) = fields.skips(coding).map_err(fault)?;
    let placed = fields.place(&sizes, &name, &mut checks).map_err(fault)?;
    let voxels = placed.grid.voxel_count();
    let layout = Layout { sample_type, order, voxels, lead: placed.lead, trail: placed.trail };
    let segments = nrrd_segments::segments(&fields.pairs, layout.frames()).map_err(fault)?;
    let all_bytes = layout
        .all_bytes()
        .ok_or_else(|| FileError::wrong(&file, format!("sizes {sizes:?}"), "fewer than 2^63 bytes"))?;
    let files = fields.data_files.places(place, &sizes, fields.data_file_axes)?;
    let start = if fields.data_files == detached::DataFiles::Attached { fields.header_bytes } else { 0 };
    let bytes_each = all_bytes / files.len().max(1) as u64;
    let parts = Parts { files, start, lines, skip, bytes_each, coding, sample_type, footer_bytes: None };
    Ok(Image {
        file,
        format: fields.magic,
        encoding,
        dims: sizes,
        grid: placed.grid,
        place_from: placed.place_from,
        unit: placed.unit,
        layout,
        parts,
        segments,
        checks,
    })
}
