//! Reading FreeSurfer's MGH (`.mgh`) and its gzip (`.mgz`, `.mgh.gz`), version 1.
//!
//! From FreeSurfer's description of the format (surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat) and the types in
//! its `mri.h`. All numbers are big-endian.

use glam::{DAffine3, DMat3, DVec3};

use super::{
    FileError, Loaded, ReadOptions, Source,
    bounded_gzip::{Packing, Stream},
    image::{Image, ImageInfo},
    nifti_header::{ByteOrder, Fault, SampleType},
    opened::base_name,
    placed::{grid_in_mm, is_sheared, report_unusual_spacing, without_sides},
    stored_file::Place,
    stored_voxels::{Coding, Parts, Skip},
    voxels::Layout,
};
use crate::{Check, Progress};

/// Bytes in front of the voxels.
const HEADER_BYTES: u64 = 284;

/// Bytes of the header that have a meaning.
const FIELD_BYTES: usize = 90;

/// Most bytes behind the voxels of a compressed file: acquisition parameters, and tags such as colour tables.
const MAX_FOOTER_BYTES: u64 = 64 << 20;

/// Whether a file that begins with these bytes is MGH. It has no magic number, so sizes and type must be possible, too.
pub(super) fn sniff(begin: &[u8]) -> bool {
    begin.first_chunk::<FIELD_BYTES>().is_some_and(|bytes| {
        let header = Header { bytes };
        header.i32(0) == 1 && header.sizes().is_ok() && matches!(header.i32(20), 0..=10)
    })
}

/// As [`super::read()`].
pub(super) fn read(source: &Source, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    image(&source.into(), progress)?.read(options, progress)
}

/// As [`super::read()`], from memory; messages call the file `name`.
///
/// # Errors
/// As [`super::read()`].
pub fn read_mgh_bytes(
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

struct Header<'a> {
    bytes: &'a [u8; FIELD_BYTES],
}

impl Header<'_> {
    fn bytes_at<const N: usize>(&self, at: usize) -> [u8; N] {
        self.bytes.get(at..).and_then(|rest| rest.first_chunk().copied()).unwrap_or([0; N])
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_be_bytes(self.bytes_at(at))
    }

    fn vector(&self, at: usize) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|i| f32::from_be_bytes(self.bytes_at(at + 4 * i)).into()))
    }

    /// Width, height, depth and frames.
    fn sizes(&self) -> Result<[u64; 4], Fault> {
        let stored = [4, 8, 12, 16].map(|at| self.i32(at));
        if stored.iter().any(|&size| size < 1) {
            let found = format!("width, height, depth and frames {stored:?}");
            return Err(Fault::new("mgh-sizes", found, "at least 1 each"));
        }
        Ok(stored.map(|size| u64::try_from(size).unwrap_or(1)))
    }

    fn sample_type(&self) -> Result<SampleType, Fault> {
        let name = match self.i32(20) {
            0 => return Ok(SampleType::UInt8),
            1 => return Ok(SampleType::Int32),
            3 => return Ok(SampleType::Float32),
            4 => return Ok(SampleType::Int16),
            10 => return Ok(SampleType::UInt16),
            2 => "long".into(),
            5 => "bitmap".into(),
            6 => "tensor".into(),
            7 | 8 => "complex".into(),
            9 => "RGB".into(),
            other => format!("unknown (code {other})"),
        };
        let expected = "uchar, short, ushort, int or float";
        Err(Fault::new("mgh-type", format!("voxels of type {name}"), expected))
    }

    /// Voxel to RAS: the header has the directions of the axes and the place of the centre, voxel (dims / 2).
    fn place(&self, dims: [u64; 3]) -> (DAffine3, bool) {
        let is_good = i16::from_be_bytes(self.bytes_at(28)) > 0;
        // FreeSurfer's values for a file without: coronal slices about 0, of 1 mm.
        let (mut spacing, mut center) = (DVec3::ONE, DVec3::ZERO);
        let mut axes = DMat3::from_cols(DVec3::NEG_X, DVec3::NEG_Z, DVec3::Y);
        if is_good {
            spacing = self.vector(30);
            axes = DMat3::from_cols(self.vector(42), self.vector(54), self.vector(66));
            center = self.vector(78);
        }
        let matrix3 = axes * DMat3::from_diagonal(spacing);
        let half = DVec3::from_array(dims.map(|n| n as f64 / 2.0));
        (DAffine3 { matrix3, translation: center - matrix3 * half }, is_good)
    }
}

fn image<'a>(place: &Place<'a>, progress: &Progress) -> Result<Image<'a>, FileError> {
    progress.check()?;
    let of_header = Progress::new();
    let mut stream = match place {
        Place::File(path) => Stream::open(path, &of_header)?,
        Place::Bytes(name, bytes) => Stream::of_bytes(name, bytes, &of_header)?,
    };
    let mut bytes = [0; FIELD_BYTES];
    stream.fill_all(&mut bytes, &format!("{HEADER_BYTES} bytes of an MGH header"))?;
    let (file, name) = (place.name(), base_name(&place.name()));
    let fault = |fault: Fault| fault.in_file(&file);
    let header = Header { bytes: &bytes };
    if header.i32(0) != 1 {
        return Err(FileError::wrong(
            file,
            format!("version {}", header.i32(0)),
            "version 1 of the MGH format",
        ));
    }
    let [width, height, depth, frames] = header.sizes().map_err(fault)?;
    let sample_type = header.sample_type().map_err(fault)?;
    let (world, is_good) = header.place([width, height, depth]);
    let dims = [width, height, depth].map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    let unusable = |why: String| {
        Fault::new("mgh-place", format!("a place that can't be used ({why})"), "one that can").in_file(&file)
    };
    let mut checks = Vec::new();
    let mut grid = grid_in_mm(world, dims, 1.0).map_err(unusable)?;
    if !is_good {
        grid = without_sides(&grid).map_err(unusable)?;
        checks.push(Check::warning(
            "side-unknown",
            format!("{name}: goodRASFlag is not set: left and right are unknown, spacings of 1 mm assumed"),
        ));
    }
    report_unusual_spacing(&grid, &name, &mut checks);
    if is_sheared(&grid) {
        checks.push(Check::note(
            "sheared",
            format!("{name}: the voxels are sheared (axes not at right angles)"),
        ));
    }
    let voxels = grid.voxel_count();
    let layout = Layout { sample_type, order: ByteOrder::Big, voxels, lead: 1, trail: frames };
    let bytes_each = layout.all_bytes().ok_or_else(|| {
        FileError::wrong(&file, format!("{frames} frames of {voxels} voxels"), "fewer than 2^63 bytes")
    })?;
    let (encoding, packing) =
        if stream.is_gzip() { ("gzip", Packing::Gzip) } else { ("raw", Packing::Plain) };
    let parts = Parts {
        files: vec![place.clone()],
        start: 0,
        lines: 0,
        skip: Skip::Bytes(HEADER_BYTES),
        bytes_each,
        coding: Coding::Bytes(packing),
        sample_type,
        footer_bytes: Some(MAX_FOOTER_BYTES),
    };
    let mut dims = vec![width, height, depth];
    if frames > 1 {
        dims.push(frames);
    }
    Ok(Image {
        file,
        format: "MGH version 1".into(),
        encoding,
        dims,
        grid,
        place_from: if is_good { "RAS directions" } else { "nothing" },
        unit: Some("mm".into()),
        layout,
        parts,
        segments: Vec::new(),
        checks,
    })
}
