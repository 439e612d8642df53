//! MGH: files that nibabel wrote (`mgh_nibabel.py`), and damaged ones.

use crate::common::{codes, gzip, numbers};
use glioscope_core::files::{self, FileError, Loaded, ReadOptions, Source};
use glioscope_core::{Progress, Samples, Sides};
use serde_json::Value;

fn read(bytes: &[u8], frame: usize) -> Result<Loaded, FileError> {
    let options = ReadOptions { frame, ..ReadOptions::default() };
    files::read_mgh_bytes("made.mgz", bytes, &options, &Progress::new())
}

/// 2 x 3 x 4 voxels of int16, value = linear index; axes along R, A and S with spacings 1.5, 2 and 3.
fn made() -> Vec<u8> {
    let mut bytes = Vec::new();
    for n in [1, 2, 3, 4, 1, 4, 0_i32] {
        bytes.extend(n.to_be_bytes());
    }
    bytes.extend(1_i16.to_be_bytes());
    for n in [1.5, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 10.0, 20.0, 30.0_f32] {
        bytes.extend(n.to_be_bytes());
    }
    assert_eq!(bytes.len(), 90);
    bytes.resize(284, 0);
    bytes.extend((0..24_i16).flat_map(i16::to_be_bytes));
    bytes
}

fn with(at: usize, part: &[u8]) -> Vec<u8> {
    let mut bytes = made();
    bytes[at..at + part.len()].copy_from_slice(part);
    bytes
}

#[test]
fn nibabels_files_have_nibabels_values_and_affines() {
    let truth: Value = serde_json::from_str(include_str!("mgh_nibabel.json")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for (name, truth) in truth.as_object().unwrap() {
        let digits = truth["bytes"].as_str().unwrap();
        let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
        let bytes: Vec<u8> = (0..digits.len()).step_by(2).map(byte).collect();
        let path = folder.path().join(name);
        files::write_whole(&path, &bytes).unwrap();
        let source = Source::File(path);
        let list = |key: &str| {
            truth[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect::<Vec<_>>()
        };
        let (dims, values) = (list("dims"), list("values"));
        let frames = dims.get(3).copied().unwrap_or(1.0) as usize;
        let frame_len = values.len() / frames;
        for frame in 0..frames {
            let options = ReadOptions { frame, ..ReadOptions::default() };
            let loaded = files::read(&source, &options, &Progress::new()).unwrap();
            assert!(loaded.checks.is_empty(), "{name}: {:?}", loaded.checks);
            assert_eq!(loaded.frames, frames, "{name}");
            let grid = loaded.volume.grid();
            assert_eq!(grid.dims().map(|n| n as f64), [dims[0], dims[1], dims[2]], "{name}");
            assert_eq!(numbers(loaded.volume.samples()), values[frame * frame_len..][..frame_len], "{name}");
            let world = grid.world_from_voxel();
            for row in 0..3 {
                for column in 0..4 {
                    let found =
                        if column < 3 { world.matrix3.col(column)[row] } else { world.translation[row] };
                    let expected = truth["affine"][row][column].as_f64().unwrap();
                    assert!((found - expected).abs() < 2e-5, "{name}: {found} {expected}");
                }
            }
        }
        let info = files::info(&source, &Progress::new()).unwrap();
        let json: Value = serde_json::from_str(&info.json().unwrap()).unwrap();
        assert_eq!(
            (json["format"].as_str(), json["frames"].as_u64()),
            (Some("MGH version 1"), Some(frames as u64))
        );
        assert!(info.text().contains("big-endian") || name == "uchar.mgz", "{}", info.text());
    }
}

/// The centre, voxel (1, 1.5, 2), is at (10, 20, 30).
#[test]
fn the_centre_has_half_the_dimensions() {
    let loaded = read(&made(), 0).unwrap();
    let grid = loaded.volume.grid();
    assert_eq!(grid.center_of_voxel_mm([0, 0, 0]).to_array(), [8.5, 17.0, 24.0]);
    assert_eq!((grid.sides(), grid.spacing_mm().to_array()), (Sides::Known, [1.5, 2.0, 3.0]));
    assert_eq!(loaded.volume.samples(), &Samples::I16((0..24).collect()));
    let unplaced = read(&with(28, &[0, 0]), 0).unwrap();
    assert_eq!(unplaced.volume.grid().sides(), Sides::Unknown);
    assert_eq!(codes(&unplaced), ["side-unknown"]);
}

/// Acquisition parameters and tags follow the voxels: of compressed files more than the usual 64 KiB.
#[test]
fn what_follows_the_voxels_is_not_read() {
    let mut long = made();
    long.resize(1 << 20, 7);
    for bytes in [gzip(&long), long, gzip(&made())] {
        assert!(read(&bytes, 0).unwrap().checks.is_empty());
    }
    let endless = gzip(&[&made()[..], &vec![0; 65 << 20]].concat());
    assert!(read(&endless, 0).unwrap_err().to_string().contains("inflates to more than"));
}

#[test]
fn damaged_files_are_refused_in_one_line() {
    let huge = i32::MAX.to_be_bytes();
    for (bytes, what) in [
        (with(0, &[0, 0, 0, 2]), "version 2"),
        (with(4, &[0; 4]), "width, height, depth and frames [0, 3, 4, 1]"),
        (with(4, &[255; 4]), "[-1, 3, 4, 1]"),
        (with(16, &huge), "332 bytes"),
        (with(4, &huge), "no patient's size"),
        (with(20, &[0, 0, 0, 9]), "voxels of type RGB"),
        (with(20, &[0, 0, 0, 99]), "code 99"),
        (with(30, &f32::NAN.to_be_bytes()), "not finite"),
        (with(42, &[0; 4]), "condition inf"),
        (made()[..80].to_vec(), "the end of the file after 80 bytes"),
        (made()[..331].to_vec(), "331 bytes"),
        (gzip(&made()[..331]), "the end of the gzip after 331 inflated bytes"),
        (Vec::new(), "an empty file"),
    ] {
        let error = read(&bytes, 0).unwrap_err().to_string();
        assert!(error.contains(what) && error.lines().count() == 1, "{what}: {error}");
    }
    assert!(read(&made(), 1).unwrap_err().to_string().contains("frame 1"));
    for bit in 0..8 * 90 {
        let mut bytes = made();
        bytes[bit / 8] ^= 1 << (bit % 8);
        if let Ok(loaded) = read(&bytes, 0) {
            assert_eq!(loaded.volume.samples().len(), loaded.volume.grid().voxel_count());
        }
    }
}
