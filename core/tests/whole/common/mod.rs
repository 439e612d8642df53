//! Shared by the tests of files and cases: access to real data, and synthetic NIfTI files.

pub mod tracts;
pub mod truth;

use std::io::Write;
use std::path::{Path, PathBuf};

use glioscope_core::files::{self, FileError, Loaded, ReadOptions, Source};
use glioscope_core::{Progress, Samples};

/// The folder of real files, or `None` after a message on stderr (bypassing the test harness's capture, so that a
/// skipped test can't be mistaken for one that ran).
pub fn real_data(folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("GLIOSCOPE_REAL_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = root.join(folder);
    if path.is_dir() {
        return Some(path);
    }
    let _ = writeln!(std::io::stderr(), "SKIPPED: no real data at {}", path.display());
    None
}

/// All files below `folder`, sorted by path.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files.sort();
    files
}

pub fn read(path: &Path) -> Result<Loaded, FileError> {
    files::read(&Source::File(path.to_owned()), &ReadOptions::default(), &Progress::new())
}

pub fn read_bytes(bytes: &[u8]) -> Result<Loaded, FileError> {
    files::read_bytes("made.nii", bytes, &ReadOptions::default(), &Progress::new())
}

pub fn codes(loaded: &Loaded) -> Vec<&'static str> {
    loaded.checks.iter().map(|c| c.code).collect()
}

/// A synthetic little-endian NIfTI-1 file: 2 x 3 x 4 voxels of int16, value = linear index.
#[derive(Clone)]
pub struct NiftiBuilder {
    pub bytes: Vec<u8>,
}

impl NiftiBuilder {
    pub fn new() -> Self {
        let mut nifti = Self { bytes: vec![0; 352] };
        nifti.put(0, &348i32.to_le_bytes());
        nifti.i16s(40, &[3, 2, 3, 4, 1, 1, 1, 1]);
        nifti.i16s(70, &[4, 16]);
        nifti.f32s(76, &[1.0, 1.5, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
        nifti.f32s(108, &[352.0, 1.0, 0.0]);
        nifti.put(123, &[2]);
        nifti.put(344, b"n+1\0");
        nifti.bytes.extend((0..24i16).flat_map(i16::to_le_bytes));
        nifti
    }

    pub fn put(&mut self, at: usize, bytes: &[u8]) -> &mut Self {
        self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
        self
    }

    pub fn i16s(&mut self, at: usize, values: &[i16]) -> &mut Self {
        self.put(at, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>())
    }

    pub fn f32s(&mut self, at: usize, values: &[f32]) -> &mut Self {
        self.put(at, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>())
    }

    /// Sets the qform: code, quaternion b c d, offset.
    pub fn qform(&mut self, code: i16, quatern: [f32; 3], offset: [f32; 3]) -> &mut Self {
        self.i16s(252, &[code]).f32s(256, &quatern).f32s(268, &offset)
    }

    /// Sets the sform: code and rows.
    pub fn sform(&mut self, code: i16, rows: [[f32; 4]; 3]) -> &mut Self {
        self.i16s(254, &[code]).f32s(280, &rows.concat())
    }

    pub fn read(&self) -> Result<Loaded, FileError> {
        read_bytes(&self.bytes)
    }
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::new(6));
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// All stored numbers as `f64`.
pub fn numbers(samples: &Samples) -> Vec<f64> {
    (0..samples.len())
        .map(|i| match samples {
            Samples::U8(v) => v[i].into(),
            Samples::I8(v) => v[i].into(),
            Samples::U16(v) => v[i].into(),
            Samples::I16(v) => v[i].into(),
            Samples::U32(v) => v[i].into(),
            Samples::I32(v) => v[i].into(),
            Samples::U64(v) => v[i] as f64,
            Samples::I64(v) => v[i] as f64,
            Samples::F32(v) => v[i].into(),
            Samples::F64(v) => v[i],
        })
        .collect()
}
