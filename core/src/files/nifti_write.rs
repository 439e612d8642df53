//! Writing NIfTI: a minimal header without extra metadata, read back and compared before it is put in place.
//!
//! The header is made here, and the crate `nifti` (0.18) writes the file from it where it can. Measured, it
//! can't:
//! - store a scaling: slope 1 and intercept 0 are written whatever the header says;
//! - write NIfTI-2, nor to memory;
//! - report a full disk: an uncompressed file on `/dev/full` is a success, as an error of its buffer is
//!   dropped;
//! - write to any path: a name with dots loses its middle (`a.b.nii` becomes `a.nii`).
//!
//! So scaled volumes, NIfTI-2 and [`nifti_bytes`] are encoded here (a test compares both), the crate gets the
//! name of the temporary file, which has no such dots, and every file is read back by our own reader.

use std::io::Write;
use std::path::Path;

use flate2::{Compression, GzBuilder};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use ndarray::{ArrayView3, ShapeBuilder};
use nifti::{NiftiHeader, writer::WriterOptions};

use super::nifti_header::{Header, SampleType, Version};
use super::placed::MIN_SPACING_MM;
use super::{
    FileError, Loaded, ReadOptions, Source, nifti as reader, printable, write_failed, write_whole_with,
};
use crate::{Grid, Progress, Sample, Samples, Scaling, Sides, Volume, with_samples};

/// Compression level of gzip.
const GZIP_LEVEL: u32 = 6;

/// Metadata of a written file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WriteOptions {
    /// The `descrip` field: at most 79 bytes, anything but printable ASCII becomes `?`. No patient data.
    pub description: String,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { description: "Glioscope".into() }
    }
}

/// Writes `volume` as a single file, atomically, gzipped where the name ends in `.gz` (any case). Scaling is
/// stored as `scl_slope` and `scl_inter`, not applied.
///
/// The file is NIfTI-1, or NIfTI-2 where NIfTI-1 can't represent it: a dimension above 32767, or a matrix or
/// scaling that 32-bit floats would change (by a thousandth of a voxel, a millionth of the value). The sform
/// has code 1 (scanner), and so has the qform unless the voxels are sheared or its 32-bit quaternion would
/// disagree with the sform. A grid whose sides are unknown gets neither: its origin is lost, as the format
/// has no field for it.
///
/// The temporary file is read back before it is renamed: its grid and scaling must equal `volume`'s, rounded
/// to the header's floats, and every stored number must have the same bits. This takes the memory of a second
/// copy.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason, or with what differs when read back; also where the reader
/// refuses the grid (10 km away, say). Nothing is left behind, and an existing file stays as it is.
///
/// ```
/// use glioscope_core::{Grid, Progress, Volume, files, glam::DVec3, ndarray::Array3};
///
/// let grid = Grid::axis_aligned([4, 3, 2], DVec3::new(1.0, 1.0, 5.0), DVec3::new(-90.0, 20.0, 0.0))?;
/// let image = Array3::from_shape_fn([4, 3, 2], |(i, j, k)| (100 * i + 10 * j + k) as f32);
/// let volume = Volume::from_array(grid, &image)?;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("image.nii.gz");
/// files::write_nifti(&path, &volume, &files::WriteOptions::default())?;
///
/// let loaded = files::read(&files::Source::File(path), &files::ReadOptions::default(), &Progress::new())?;
/// assert_eq!(loaded.volume, volume);
/// assert_eq!(loaded.volume.to_array()[[3, 2, 1]], 321.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_nifti(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), FileError> {
    let gzip = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let header = header_bytes(volume, options);
    let in_crate = volume.scaling() == Scaling::NONE && header.version == Version::One;
    write_checked(path, volume, header.version, gzip, |temporary| {
        if in_crate {
            write_with_crate(temporary, volume, &header.bytes, gzip)
        } else {
            let bytes = encode(volume, header.bytes);
            let bytes = if gzip { gzipped(bytes) } else { bytes };
            std::fs::OpenOptions::new()
                .write(true)
                .open(temporary)
                .and_then(|mut file| file.write_all(&bytes))
                .map_err(|e| e.to_string())
        }
    })
}

/// Lets `write` fill a temporary file beside `path`, compares what is read back with `volume`, then renames
/// it.
fn write_checked(
    path: &Path,
    volume: &Volume,
    version: Version,
    gzip: bool,
    write: impl FnOnce(&Path) -> Result<(), String>,
) -> Result<(), FileError> {
    write_whole_with(path, if gzip { ".nii.gz" } else { ".nii" }, |file| {
        write(file.path()).map_err(|why| write_failed(path, &why))?;
        let source = Source::File(file.path().to_owned());
        let differs = |(found, expected): (String, String)| {
            FileError::wrong(
                printable(&path.display().to_string()),
                format!("{found} when read back"),
                expected,
            )
        };
        match reader::read(&source, &ReadOptions { max_bytes: u64::MAX, frame: 0 }, &Progress::new()) {
            Ok(loaded) => difference(volume, version, &loaded).map_or(Ok(()), |found| Err(differs(found))),
            Err(FileError::Wrong { found, expected, .. }) => Err(differs((found, expected))),
            Err(cancelled) => Err(cancelled),
        }
    })
}

/// Writes an unscaled volume as NIfTI-1 over the file at `path`, whose name ends in `.nii` or `.nii.gz` and
/// has no other dots but a first one.
fn write_with_crate(path: &Path, volume: &Volume, header: &[u8], gzip: bool) -> Result<(), String> {
    let reference = NiftiHeader::from_reader(header).map_err(|e| e.to_string())?;
    let mut writer = WriterOptions::new(path).reference_header(&reference);
    if gzip {
        writer = writer.compression_level(Compression::new(GZIP_LEVEL));
    }
    with_samples!(volume.samples(), v => {
        let array = ArrayView3::from_shape(volume.grid().dims().f(), v).map_err(|e| e.to_string())?;
        writer.write_nifti(&array).map_err(|e| e.to_string())
    })
}

/// What was found in a file that should hold `volume`, and what was expected; `None` where they agree
/// exactly.
fn difference(volume: &Volume, version: Version, loaded: &Loaded) -> Option<(String, String)> {
    let read = &loaded.volume;
    let Some(expected) = stored_grid(volume.grid(), version) else {
        return Some(("a grid that 32-bit floats can't hold".into(), "one that they can".into()));
    };
    if (loaded.frames, read.grid()) != (1, &expected) {
        let found = format!("{} frame(s) of {:?}", loaded.frames, read.grid());
        return Some((found, format!("1 of {expected:?}")));
    }
    let scaling = volume.scaling();
    let scaling =
        Scaling { slope: stored(scaling.slope, version), intercept: stored(scaling.intercept, version) };
    if read.scaling() != scaling {
        return Some((format!("{:?}", read.scaling()), format!("{scaling:?}")));
    }
    let linear = first_difference(volume.samples(), read.samples())?;
    let value = |of: &Volume| format!("{} ({})", of.value(linear), sample_type(of.samples()).name());
    Some((format!("{} at voxel {:?}", value(read), expected.ijk(linear)), value(volume)))
}

/// Position of the first number that differs in any bit; 0 where the data types differ.
fn first_difference(written: &Samples, read: &Samples) -> Option<usize> {
    fn same_type<'a, T: Sample>(_: &[T], other: &'a Samples) -> Option<&'a [T]> {
        T::slice(other)
    }
    with_samples!(written, written => match same_type(written, read) {
        Some(read) => written.iter().zip(read).position(|(w, r)| w.to_le_bytes() != r.to_le_bytes()),
        None => Some(0),
    })
}

/// A file as [`write_nifti`] writes it with default options; as a gzip it may be divided into other blocks.
/// Deterministic: the gzip has no time stamp.
pub fn nifti_bytes(volume: &Volume, gzip: bool) -> Vec<u8> {
    let bytes = encode(volume, header_bytes(volume, &WriteOptions::default()).bytes);
    if gzip { gzipped(bytes) } else { bytes }
}

/// gzip without file name and time stamp. Compressing in memory can't fail; if it did, the plain bytes would
/// still be a valid file, as our readers recognise gzip by content.
fn gzipped(bytes: Vec<u8>) -> Vec<u8> {
    let mut encoder = GzBuilder::new().mtime(0).write(Vec::new(), Compression::new(GZIP_LEVEL));
    match encoder.write_all(&bytes).and_then(|()| encoder.finish()) {
        Ok(packed) => packed,
        Err(_) => bytes,
    }
}

/// The header's bytes with the stored numbers after them.
fn encode(volume: &Volume, mut bytes: Vec<u8>) -> Vec<u8> {
    with_samples!(volume.samples(), v => {
        bytes.reserve(size_of_val(v.as_slice()));
        for number in v {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
    });
    bytes
}

/// NIfTI data type of the samples.
pub(crate) fn sample_type(samples: &Samples) -> SampleType {
    match samples {
        Samples::U8(_) => SampleType::UInt8,
        Samples::I8(_) => SampleType::Int8,
        Samples::U16(_) => SampleType::UInt16,
        Samples::I16(_) => SampleType::Int16,
        Samples::U32(_) => SampleType::UInt32,
        Samples::I32(_) => SampleType::Int32,
        Samples::U64(_) => SampleType::UInt64,
        Samples::I64(_) => SampleType::Int64,
        Samples::F32(_) => SampleType::Float32,
        Samples::F64(_) => SampleType::Float64,
    }
}

/// A header, with the four bytes that state that no extensions follow.
struct HeaderBytes {
    version: Version,
    bytes: Vec<u8>,
}

fn header_bytes(volume: &Volume, options: &WriteOptions) -> HeaderBytes {
    let version = if fits_nifti_1(volume) { Version::One } else { Version::Two };
    let qform = quaternion(volume.grid());
    let bytes = header_with(version, volume, options, qform);
    // A quaternion of three 32-bit floats is imprecise near half turns: omit it rather than write two forms that
    // disagree.
    let disagrees = Header::parse(&bytes).is_ok_and(|header| {
        header.checks("").iter().any(|c| matches!(c.code, "sform-qform-disagree" | "qform-unusable"))
    });
    let bytes = if disagrees { header_with(version, volume, options, None) } else { bytes };
    HeaderBytes { version, bytes }
}

/// A number as a header stores it: NIfTI-1 has 32-bit floats.
fn stored(x: f64, version: Version) -> f64 {
    match version {
        Version::One => f64::from(x as f32),
        Version::Two => x,
    }
}

/// The affine with its numbers as a header stores them.
fn stored_affine(grid: &Grid, version: Version) -> DAffine3 {
    let m = grid.world_from_voxel();
    let vector = |v: DVec3| DVec3::from_array(v.to_array().map(|x| stored(x, version)));
    DAffine3 {
        matrix3: DMat3::from_cols(
            vector(m.matrix3.x_axis),
            vector(m.matrix3.y_axis),
            vector(m.matrix3.z_axis),
        ),
        translation: vector(m.translation),
    }
}

/// The grid that a file states: with unknown sides, spacings alone. `None` where rounding makes it singular.
fn stored_grid(grid: &Grid, version: Version) -> Option<Grid> {
    let affine = match grid.sides() {
        Sides::Known => stored_affine(grid, version),
        Sides::Unknown => {
            let spacing = grid.spacing_mm().to_array().map(|x| stored(x, version));
            DAffine3 { matrix3: DMat3::from_diagonal(spacing.into()), translation: DVec3::ZERO }
        }
    };
    Grid::new(grid.dims(), affine, grid.sides()).ok()
}

fn fits_nifti_1(volume: &Volume) -> bool {
    let grid = volume.grid();
    let rounded = stored_affine(grid, Version::One);
    let scaling = volume.scaling();
    let close = |x: f64| (stored(x, Version::One) - x).abs() <= 1e-6 * x.abs();
    grid.dims().iter().all(|&d| i16::try_from(d).is_ok())
        && grid.spacing_mm().min_element() > 2.0 * MIN_SPACING_MM
        && Grid::new(grid.dims(), rounded, grid.sides())
            .is_ok_and(|rounded_grid| grid.same_place(&rounded_grid, 1e-3))
        && close(scaling.slope)
        && close(scaling.intercept)
}

/// `qfac` and quaternion `b`, `c`, `d` of a grid; `None` if its axes are not orthogonal.
fn quaternion(grid: &Grid) -> Option<(f64, [f64; 3])> {
    let m = grid.world_from_voxel().matrix3;
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(|c| c / c.length());
    if [x.dot(y), x.dot(z), y.dot(z)].iter().any(|cosine| cosine.abs() > 1e-5) {
        return None;
    }
    let qfac = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let q = DQuat::from_mat3(&DMat3::from_cols(x, y, z * qfac));
    let q = if q.w < 0.0 { -q } else { q };
    Some((qfac, [q.x, q.y, q.z]))
}

/// Header buffer that writes numbers in the width of the header version.
struct HeaderWriter {
    bytes: Vec<u8>,
    wide: bool,
}

impl HeaderWriter {
    fn put<const N: usize>(&mut self, at: usize, value: [u8; N]) {
        if let Some(target) = self.bytes.get_mut(at..at + N) {
            target.copy_from_slice(&value);
        }
    }

    fn floats(&mut self, at: usize, values: &[f64]) {
        for (i, &value) in values.iter().enumerate() {
            if self.wide {
                self.put(at + 8 * i, value.to_le_bytes());
            } else {
                self.put(at + 4 * i, (value as f32).to_le_bytes());
            }
        }
    }

    fn code(&mut self, at: usize, value: i16) {
        if self.wide {
            self.put(at, i32::from(value).to_le_bytes());
        } else {
            self.put(at, value.to_le_bytes());
        }
    }
}

fn header_with(
    version: Version,
    volume: &Volume,
    options: &WriteOptions,
    qform: Option<(f64, [f64; 3])>,
) -> Vec<u8> {
    let wide = version == Version::Two;
    let size = version.header_bytes();
    let mut out = HeaderWriter { bytes: vec![0; size + 4], wide };
    let grid = volume.grid();
    let known = grid.sides() == Sides::Known;
    let m = grid.world_from_voxel();
    let dims = [3, grid.dims()[0], grid.dims()[1], grid.dims()[2], 1, 1, 1, 1];
    let kind = sample_type(volume.samples());
    let bits = i16::try_from(kind.bytes() * 8).unwrap_or_default();

    out.put(0, i32::try_from(size).unwrap_or_default().to_le_bytes());
    for (i, d) in dims.into_iter().enumerate() {
        if wide {
            out.put(16 + 8 * i, (d as u64).to_le_bytes());
        } else {
            out.put(40 + 2 * i, i16::try_from(d).unwrap_or(i16::MAX).to_le_bytes());
        }
    }
    let at = |one: usize, two: usize| if wide { two } else { one };
    out.put(at(70, 12), kind.code().to_le_bytes());
    out.put(at(72, 14), bits.to_le_bytes());
    let spacing = grid.spacing_mm();
    let qfac = qform.map_or(1.0, |(qfac, _)| qfac);
    out.floats(at(76, 104), &[qfac, spacing.x, spacing.y, spacing.z]);
    if wide {
        out.put(168, (size as u64 + 4).to_le_bytes());
    } else {
        out.put(108, (size as f32 + 4.0).to_le_bytes());
    }
    out.floats(at(112, 176), &[volume.scaling().slope, volume.scaling().intercept]);
    if wide {
        out.put(500, 2i32.to_le_bytes());
    } else {
        out.put(123, [2]);
    }
    if known {
        if let Some((_, bcd)) = qform {
            out.code(at(252, 344), 1);
            out.floats(at(256, 352), &bcd);
            out.floats(at(268, 376), &m.translation.to_array());
        }
        out.code(at(254, 348), 1);
        for row in 0..3 {
            let values =
                [m.matrix3.x_axis[row], m.matrix3.y_axis[row], m.matrix3.z_axis[row], m.translation[row]];
            out.floats(at(280 + 16 * row, 400 + 32 * row), &values);
        }
    }
    let printable = |b: u8| if b.is_ascii_graphic() || b == b' ' { b } else { b'?' };
    for (i, b) in options.description.bytes().take(79).enumerate() {
        out.put(at(148, 240) + i, [printable(b)]);
    }
    if wide {
        out.put(4, *b"n+2\0\r\n\x1a\n");
    } else {
        out.put(344, *b"n+1\0");
    }
    out.bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume() -> Volume {
        let grid = Grid::axis_aligned([3, 2, 2], DVec3::new(1.0, 2.0, 3.0), DVec3::splat(-7.5)).unwrap();
        Volume::new(grid, Samples::F32((0..12u8).map(f32::from).collect()), Scaling::NONE).unwrap()
    }

    /// The error of writing over a file with a writer that goes wrong; that file stays as it is, and alone.
    fn error_of(gzip: bool, write: impl FnOnce(&Path) -> Result<(), String>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.nii");
        super::super::write_whole(&path, b"before").unwrap();
        let error = write_checked(&path, &volume(), Version::One, gzip, write).unwrap_err().to_string();
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
        error.split_once("out.nii: ").unwrap().1.to_owned()
    }

    fn overwrite(path: &Path, bytes: &[u8]) -> Result<(), String> {
        let mut file = std::fs::OpenOptions::new().write(true).open(path).map_err(|e| e.to_string())?;
        file.write_all(bytes).map_err(|e| e.to_string())
    }

    #[test]
    fn a_file_that_reads_back_differently_is_not_put_in_place() {
        let good = nifti_bytes(&volume(), false);
        let with = |at: usize, bytes: &[u8]| {
            let mut changed = good.clone();
            changed[at..at + bytes.len()].copy_from_slice(bytes);
            error_of(false, |path| overwrite(path, &changed))
        };
        // Voxel 8 = (2, 0, 1), one bit of its mantissa.
        assert_eq!(
            with(352 + 32, &[1]),
            "found 8.000000953674316 (float32) at voxel [2, 0, 1] when read back, expected 8 (float32)"
        );
        // The last column of srow_x; the qform, then unused, still has the right place.
        let error = with(292, &(-7.25f32).to_le_bytes());
        assert!(error.contains("-7.25") && error.contains("expected 1 of Grid"), "{error}");
        let error = with(112, &2f32.to_le_bytes());
        assert!(error.starts_with("found Scaling { slope: 2.0"), "{error}");
        // datatype 8, int32.
        let error = with(70, &8i16.to_le_bytes());
        assert!(error.ends_with("expected 0 (float32)"), "{error}");
        let error = with(42, &2i16.to_le_bytes());
        assert!(error.contains("dims: [2, 2, 2]") && error.contains("dims: [3, 2, 2]"), "{error}");

        for gzip in [false, true] {
            let written = nifti_bytes(&volume(), gzip);
            let error = error_of(gzip, |path| overwrite(path, &written[..written.len() - 3]));
            assert!(error.contains(" when read back, expected "), "{error}");
            assert!(error_of(gzip, |_| Ok(())).contains("when read back"));
            let error = error_of(gzip, |_| Err("no space".into()));
            assert_eq!(error, "found writing failed: no space, expected a place that can be written");
        }
    }

    #[test]
    fn nan_and_signed_zero_are_compared_by_their_bits() {
        let [a, b] = [f32::NAN, f32::from_bits(f32::NAN.to_bits() ^ 1)].map(|v| Samples::F32(vec![1.0, v]));
        assert_eq!((first_difference(&a, &a), first_difference(&a, &b)), (None, Some(1)));
        assert_eq!(first_difference(&Samples::F64(vec![0.0]), &Samples::F64(vec![-0.0])), Some(0));
        assert_eq!(first_difference(&Samples::U8(vec![0]), &Samples::I8(vec![0])), Some(0));
    }

    /// The crate's writer reports success on a full disk; the comparison is what notices.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_noticed_though_the_crate_reports_success() {
        let folder = tempfile::tempdir().unwrap();
        let full = folder.path().join("full.nii");
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        let header = header_bytes(&volume(), &WriteOptions::default()).bytes;
        assert_eq!(write_with_crate(&full, &volume(), &header, false), Ok(()));
        let error = error_of(false, |_| write_with_crate(&full, &volume(), &header, false));
        assert!(error.contains("when read back"), "{error}");
    }

    /// What the crate can't write, and what the program therefore encodes itself.
    #[test]
    fn the_crate_drops_scaling_and_loses_a_name_with_dots() {
        let scaling = Scaling { slope: 0.5, intercept: -3.0 };
        let scaled = Volume::new(volume().grid().clone(), volume().samples().clone(), scaling).unwrap();
        let header = header_bytes(&scaled, &WriteOptions::default()).bytes;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.b.nii");
        write_with_crate(&path, &scaled, &header, false).unwrap();
        assert!(!path.exists());
        let source = Source::File(folder.path().join("a.nii"));
        let read = reader::read(&source, &ReadOptions::default(), &Progress::new()).unwrap();
        assert_eq!(read.volume, volume());
    }
}
