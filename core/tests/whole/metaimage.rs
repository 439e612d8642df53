//! MetaImage headers made here: keys, sides, and damage.

use crate::common::{codes, numbers};
use glam::DVec3;
use glioscope_core::files::{self, FileError, Loaded, ReadOptions};
use glioscope_core::{Progress, Sides};

fn read(bytes: &[u8]) -> Result<Loaded, FileError> {
    files::read_metaimage_bytes("made.mha", bytes, &ReadOptions::default(), &Progress::new())
}

/// 2 x 3 x 4 voxels of int16, value = linear index; `change` replaces keys' lines or adds some.
fn with(changes: &[(&str, &str)]) -> Vec<u8> {
    let mut keys = vec![
        ("ObjectType", "Image"),
        ("NDims", "3"),
        ("DimSize", "2 3 4"),
        ("ElementType", "MET_SHORT"),
        ("ElementSpacing", "1.5 2 3"),
        ("TransformMatrix", "1 0 0 0 1 0 0 0 1"),
        ("Offset", "10 20 30"),
        ("BinaryDataByteOrderMSB", "False"),
    ];
    for change in changes {
        match keys.iter_mut().find(|(key, _)| *key == change.0) {
            Some(key) => *key = *change,
            None => keys.push(*change),
        }
    }
    keys.retain(|(_, value)| !value.is_empty());
    let mut text: String = keys.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
    text.push_str("ElementDataFile = LOCAL\n");
    [text.as_bytes(), &(0..24_i16).flat_map(i16::to_le_bytes).collect::<Vec<_>>()].concat()
}

#[test]
fn row_i_of_the_matrix_is_axis_i_in_lps() {
    let plain = read(&with(&[])).unwrap();
    let grid = plain.volume.grid();
    assert_eq!(grid.center_of_voxel_mm([1, 1, 1]).to_array(), [-11.5, -22.0, 33.0]);
    assert_eq!(numbers(plain.volume.samples())[23], 23.0);
    assert!(plain.checks.is_empty());
    // Axis 0 runs to P, axis 1 to S, axis 2 to L.
    let turned = read(&with(&[("TransformMatrix", "0 1 0 0 0 1 1 0 0")])).unwrap();
    assert_eq!(turned.volume.grid().axis_codes(), ['P', 'S', 'L']);
    assert_eq!(turned.volume.grid().spacing_mm(), DVec3::new(1.5, 2.0, 3.0));
}

#[test]
fn what_is_missing_is_assumed_with_a_check() {
    for (changes, expected) in [
        (&[("TransformMatrix", "")][..], &["side-unknown"][..]),
        (&[("Offset", "")], &["side-unknown"]),
        (&[("ElementSpacing", "")], &["spacing-missing"]),
        (&[("BinaryDataByteOrderMSB", "")], &["byte-order-missing"]),
        (&[("DistanceUnits", "cm")], &["units-converted"]),
        (&[("DistanceUnits", "ells")], &["units-unknown"]),
        (&[("DistanceUnits", "mm"), ("AnatomicalOrientation", "RAS")], &[]),
        (&[("ElementToIntensityFunctionSlope", "2")], &["scaling-ignored"]),
        (&[("ElementToIntensityFunctionSlope", "1"), ("ElementToIntensityFunctionOffset", "0.0")], &[]),
        (
            &[
                ("NDims", "2"),
                ("DimSize", "4 6"),
                ("ElementSpacing", "1 2"),
                ("Offset", "0 0"),
                ("TransformMatrix", "1 0 0 1"),
            ],
            &["thickness-unknown"],
        ),
    ] {
        let loaded = read(&with(changes)).unwrap();
        assert_eq!(codes(&loaded), expected, "{changes:?}");
        let is_unknown = expected.contains(&"side-unknown");
        assert_eq!(loaded.volume.grid().sides() == Sides::Unknown, is_unknown, "{changes:?}");
    }
}

#[test]
fn impossible_headers_are_refused_in_one_line() {
    for (changes, what) in [
        (&[("ElementType", "MET_SHORT_ARRAY")][..], "MET_SHORT_ARRAY"),
        (&[("ElementNumberOfChannels", "3")], "\"3\" channels"),
        (&[("DimSize", "2 3 5")], "48 bytes"),
        (&[("HeaderSize", "10")], "HeaderSize"),
        (&[("HeaderSize", "-2")], "HeaderSize"),
        (&[("CompressedData", "True")], "zlib stream"),
        (&[("CompressedData", "True"), ("CompressedDataSize", "x")], "CompressedDataSize"),
        (&[("Offset", "1 2 inf")], "3 finite numbers"),
        (&[("offset", "1 2 3")], "twice"),
        (
            &[
                ("NDims", "4"),
                ("DimSize", "2 3 2 2"),
                ("ElementSpacing", "1 1 1 1"),
                ("Offset", "0 0 0 0"),
                ("TransformMatrix", "1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1"),
            ],
            "mixes",
        ),
    ] {
        let error = read(&with(changes)).unwrap_err().to_string();
        assert!(error.contains(what) && error.lines().count() == 1, "{changes:?}: {error}");
    }
}

/// Cut at every length, and with every bit of the header flipped.
#[test]
fn damage_never_panics() {
    let fine = with(&[("HeaderSize", "-1"), ("CompressedData", "False")]);
    assert!(read(&fine).is_ok());
    for cut in 0..fine.len() {
        assert!(read(&fine[..cut]).is_err(), "cut at {cut}");
    }
    for bit in 0..8 * (fine.len() - 48) {
        let mut bytes = fine.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        match read(&bytes) {
            Ok(loaded) => assert_eq!(loaded.volume.samples().len(), loaded.volume.grid().voxel_count()),
            Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
        }
    }
}
