//! Reading MetaImage (`.mha`, and `.mhd` with data files).

use std::path::{Path, PathBuf};

use super::{
    FileError, Loaded, ReadOptions, Source,
    detached::{self, DataFiles},
    image::{Image, ImageInfo},
    metaimage_header::Keys,
    nifti_header::Fault,
    opened::base_name,
    stored_file::Place,
    stored_voxels::{Coding, Parts},
    voxels::Layout,
};
use crate::Progress;

pub(super) use super::metaimage_header::sniff;

/// As [`super::read()`].
pub(super) fn read(source: &Source, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    image(&source.into(), progress)?.read(options, progress)
}

/// As [`super::read()`], from memory; messages call the file `name`. Voxels in other files are refused.
///
/// # Errors
/// As [`super::read()`].
pub fn read_metaimage_bytes(
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

/// The data files of a header, as far as it names any that exist.
pub(super) fn other_files(path: &Path) -> Vec<PathBuf> {
    let image = image(&Place::File(path.to_owned()), &Progress::new());
    image.map_or_else(|_| Vec::new(), |image| detached::others(image.parts.files, path))
}

fn image<'a>(place: &Place<'a>, progress: &Progress) -> Result<Image<'a>, FileError> {
    progress.check()?;
    let keys = Keys::read(place, &Progress::new())?;
    let (file, name) = (place.name(), base_name(&place.name()));
    let fault = |fault: Fault| fault.in_file(&file);
    let mut checks = Vec::new();
    let sizes = keys.sizes().map_err(fault)?;
    let sample_type = keys.sample_type().map_err(fault)?;
    let (encoding, coding) = keys.coding();
    let order = keys.order(sample_type, coding, &name, &mut checks);
    let (start, skip) = keys.start(coding).map_err(fault)?;
    let (grid, place_from, unit) = keys.place(&sizes, &name, &mut checks).map_err(fault)?;
    keys.report_scaling(&name, &mut checks);
    let rest = sizes.get(3..).unwrap_or_default();
    let trail = rest.iter().try_fold(1_u64, |all, &n| all.checked_mul(n));
    let layout = trail.map(|trail| Layout { sample_type, order, voxels: grid.voxel_count(), lead: 1, trail });
    let too_many = || FileError::wrong(&file, format!("DimSize {sizes:?}"), "fewer than 2^63 bytes");
    let layout = layout.ok_or_else(too_many)?;
    let all_bytes = layout.all_bytes().ok_or_else(too_many)?;
    let files = keys.data_files.places(place, &sizes, keys.data_file_axes)?;
    // Of several files, the header states only one's.
    if coding == Coding::Deflated
        && files.len() == 1
        && let Some(compressed) = keys.compressed_bytes().map_err(fault)?
    {
        let stored = files[0].stored_bytes()?.saturating_sub(start);
        if compressed > stored {
            let expected = format!("the {compressed} bytes of CompressedDataSize");
            return Err(FileError::wrong(files[0].name(), format!("{stored} bytes of voxels"), expected));
        }
    }
    debug_assert!(keys.data_files != DataFiles::Attached || start >= keys.header_bytes);
    let bytes_each = all_bytes / files.len().max(1) as u64;
    let parts = Parts { files, start, lines: 0, skip, bytes_each, coding, sample_type, footer_bytes: None };
    Ok(Image {
        file,
        format: "MetaImage".into(),
        encoding,
        dims: sizes,
        grid,
        place_from,
        unit,
        layout,
        parts,
        segments: Vec::new(),
        checks,
    })
}
