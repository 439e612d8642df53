//! Writing NIfTI: a minimal header without extra metadata, written atomically.

use std::io::Write;
use std::path::Path;

use flate2::{Compression, GzBuilder};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::nifti_header::{Header, SampleType, Version};
use super::nifti_space::MIN_SPACING_MM;
use super::{FileError, write_whole};
use crate::{Grid, Samples, Sides, Volume, with_samples};

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

/// Writes `volume` as a single file, atomically, gzipped where the name ends in `.gz` (any case). Scaling is stored as
/// `scl_slope` and `scl_inter`, not applied.
///
/// The file is NIfTI-1, or NIfTI-2 where NIfTI-1 can't represent it: a dimension above 32767, or a matrix or scaling
/// that 32-bit floats would change (by a thousandth of a voxel, a millionth of the value). The sform has code 1
/// (scanner), and so has the qform unless the voxels are sheared or its 32-bit quaternion would disagree with the
/// sform. A grid whose sides are unknown gets neither: its origin is lost, as the format has no field for it.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason.
pub fn write_nifti(path: &Path, volume: &Volume, options: &WriteOptions) -> Result<(), FileError> {
    let gzip = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let bytes = encode(volume, options);
    write_whole(path, &if gzip { gzipped(bytes) } else { bytes })
}

/// The bytes that [`write_nifti`] would write with default options. Deterministic: the gzip has no time stamp.
pub fn nifti_bytes(volume: &Volume, gzip: bool) -> Vec<u8> {
    let bytes = encode(volume, &WriteOptions::default());
    if gzip { gzipped(bytes) } else { bytes }
}

/// gzip without file name and time stamp. Compressing in memory can't fail; if it did, the plain bytes would still be
/// a valid file, as our readers recognise gzip by content.
fn gzipped(bytes: Vec<u8>) -> Vec<u8> {
    let mut encoder = GzBuilder::new().mtime(0).write(Vec::new(), Compression::new(6));
    match encoder.write_all(&bytes).and_then(|()| encoder.finish()) {
        Ok(packed) => packed,
        Err(_) => bytes,
    }
}

fn encode(volume: &Volume, options: &WriteOptions) -> Vec<u8> {
    let mut bytes = header_bytes(volume, options);
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

fn header_bytes(volume: &Volume, options: &WriteOptions) -> Vec<u8> {
    let version = if fits_nifti_1(volume) { Version::One } else { Version::Two };
    let qform = quaternion(volume.grid());
    let bytes = header_with(version, volume, options, qform);
    // A quaternion of three 32-bit floats is imprecise near half turns: omit it rather than write two forms that
    // disagree.
    let disagrees = Header::parse(&bytes).is_ok_and(|header| {
        header.checks("").iter().any(|c| matches!(c.code, "sform-qform-disagree" | "qform-unusable"))
    });
    if disagrees { header_with(version, volume, options, None) } else { bytes }
}

fn fits_nifti_1(volume: &Volume) -> bool {
    let grid = volume.grid();
    let as_f32 = |x: f64| f64::from(x as f32);
    let as_f32_vec = |v: DVec3| DVec3::new(as_f32(v.x), as_f32(v.y), as_f32(v.z));
    let m = grid.world_from_voxel();
    let rounded = DAffine3 {
        matrix3: DMat3::from_cols(
            as_f32_vec(m.matrix3.x_axis),
            as_f32_vec(m.matrix3.y_axis),
            as_f32_vec(m.matrix3.z_axis),
        ),
        translation: as_f32_vec(m.translation),
    };
    let scaling = volume.scaling();
    let close = |x: f64| (as_f32(x) - x).abs() <= 1e-6 * x.abs();
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
