//! Masks that are written and read again, on images made for it.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::super::{FileError, Loaded, Part, ReadOptions, Source, Which};
use super::source_image::{IDENTITY, SourceImage, source_image};
use super::write::Elements;
use super::{SegmentToWrite, WriteTo, segmentation, structure_set, tags};
use crate::{Grid, MaskBits, Progress, Sides};

const MR: &str = "1.2.840.10008.5.1.4.1.1.4";

fn grid(dims: [usize; 3], matrix3: DMat3) -> Grid {
    let affine = DAffine3 { matrix3, translation: DVec3::new(-31.25, 47.1, 12.3) };
    Grid::new(dims, affine, Sides::Known).unwrap()
}

/// A grid of oblique, sheared or straight slices; right-handed, so that slices keep their order.
pub(super) fn grid_of(kind: usize, dims: [usize; 3]) -> Grid {
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0));
    let size = DMat3::from_diagonal(DVec3::new(0.7, 1.3, 2.9));
    let mut sheared = size;
    sheared.z_axis += DVec3::new(0.4, -0.9, 0.0);
    let in_lps = DMat3::from_diagonal(DVec3::new(-2.0, -1.0, 3.0));
    grid(dims, [size, turn * size, turn * sheared, in_lps][kind])
}

/// Writes an image of these slices, with `text` in its attributes.
pub(super) fn image(folder: &Path, grid: &Grid, text: &str) {
    let lps = |v: DVec3| DVec3::new(-v.x, -v.y, v.z);
    let matrix = grid.world_from_voxel().matrix3;
    let normal = matrix.x_axis.cross(matrix.y_axis);
    let thickness_mm = normal.dot(matrix.z_axis) / normal.length();
    let [columns, rows, slices] = grid.dims();
    for slice in 0..slices {
        let uid = format!("1.9.77.4.{}", slice + 1);
        let mut data = Elements::default();
        for tag in IDENTITY.into_iter().chain([
            tags::STUDY_DESCRIPTION,
            tags::SERIES_DESCRIPTION,
            tags::ACQUISITION_DATE,
            tags::SERIES_TIME,
            tags::MANUFACTURER,
            tags::DEVICE_SERIAL_NUMBER,
            tags::POSITION_REFERENCE_INDICATOR,
            tags::OPERATORS_NAME,
        ]) {
            data.text(tag, &format!("{text}{:04X}{:04X}", tag.0, tag.1));
        }
        data.text(tags::SOP_CLASS_UID, MR);
        data.text(tags::SOP_INSTANCE_UID, &uid);
        data.text(tags::MODALITY, "MR");
        data.text(tags::STUDY_INSTANCE_UID, "1.9.77.1");
        data.text(tags::SERIES_INSTANCE_UID, "1.9.77.2");
        data.text(tags::FRAME_OF_REFERENCE_UID, "1.9.77.3");
        data.decimals(tags::IMAGE_POSITION_PATIENT, &lps(grid.center_of_voxel_mm([0, 0, slice])).to_array());
        let cosines = [matrix.x_axis, matrix.y_axis].map(|v| (lps(v) / v.length()).to_array());
        data.decimals(tags::IMAGE_ORIENTATION_PATIENT, cosines.as_flattened());
        data.decimals(tags::PIXEL_SPACING, &[matrix.y_axis.length(), matrix.x_axis.length()]);
        data.decimals(tags::SLICE_THICKNESS, &[thickness_mm]);
        data.u16s(tags::SAMPLES_PER_PIXEL, &[1]);
        data.text(tags::PHOTOMETRIC_INTERPRETATION, "MONOCHROME2");
        data.u16s(tags::ROWS, &[rows as u16]);
        data.u16s(tags::COLUMNS, &[columns as u16]);
        data.u16s(tags::BITS_ALLOCATED, &[8]);
        data.u16s(tags::BITS_STORED, &[8]);
        data.u16s(tags::HIGH_BIT, &[7]);
        data.u16s(tags::PIXEL_REPRESENTATION, &[0]);
        data.bytes(tags::PIXEL_DATA, vec![0; rows * columns]);
        put(folder, &format!("image{slice:03}.dcm"), &data.file(MR, &uid));
    }
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    super::super::write_whole(&path, bytes).unwrap();
    path
}

fn to<'a>(grid: &'a Grid, source: Option<&'a SourceImage>, identified: bool) -> WriteTo<'a> {
    WriteTo {
        grid,
        source,
        identified,
        keeps_names: true,
        salt: "pepper",
        date: "20261129",
        time: "101112",
        version: "1.2",
    }
}

fn segment<'a>(name: &'a str, mask: &'a MaskBits) -> SegmentToWrite<'a> {
    SegmentToWrite { name, color: Some([200, 100, 50]), mask }
}

fn read(path: &Path, number: i64) -> Result<Loaded, FileError> {
    let part = Part { path: path.to_owned(), series: None, which: Which::Segment(number) };
    super::super::read(&Source::Part(part), &ReadOptions::default(), &Progress::new())
}

/// The active voxels of a file's mask, by the voxels of `grid` at their places.
fn read_onto(path: &Path, number: i64, grid: &Grid) -> MaskBits {
    let loaded = read(path, number).unwrap();
    let own = loaded.volume.grid();
    assert!((own.voxel_volume_mm3() / grid.voxel_volume_mm3() - 1.0).abs() < 1e-9);
    let mut mask = MaskBits::empty(grid.dims());
    for at in (0..own.voxel_count()).filter(|&at| loaded.volume.value(at) > 0.0) {
        let place = own.center_of_voxel_mm(own.ijk(at));
        let voxel = grid.voxel_at(place).unwrap();
        assert!(grid.center_of_voxel_mm(voxel).abs_diff_eq(place, 1e-6));
        assert!(!mask.get(voxel));
        mask.set(voxel);
    }
    mask
}

fn same_voxels(path: &Path, number: i64, grid: &Grid, mask: &MaskBits) {
    let loaded = read(path, number).unwrap();
    assert!(loaded.volume.grid().same_place(grid, 1e-6), "{:?} {grid:?}", loaded.volume.grid());
    let differs = |at: &usize| (loaded.volume.value(*at) > 0.0) != mask.get(grid.ijk(*at));
    assert_eq!((0..grid.voxel_count()).find(differs), None, "{}", path.display());
    let codes: Vec<_> = loaded.checks.iter().map(|check| check.code).collect();
    assert!(codes.iter().all(|code| ["rtstruct-nested", "rtstruct-gaps"].contains(code)), "{codes:?}");
}

/// Writes both kinds of file beside an image, and reads them.
fn round_trip(grid: &Grid, masks: &[MaskBits]) {
    let folder = tempfile::tempdir().unwrap();
    image(folder.path(), grid, "");
    let source = source_image(folder.path(), None, &Progress::new()).unwrap();
    let segments: Vec<_> = masks.iter().map(|mask| segment("A", mask)).collect();
    let to = to(grid, Some(&source), true);
    let written = segmentation(&segments, &to).unwrap();
    assert_eq!(written.checks, []);
    let contours = structure_set(&segments, &to).unwrap();
    for (name, bytes) in [("seg.dcm", written.bytes), ("contours.dcm", contours.bytes)] {
        let path = put(folder.path(), name, &bytes);
        for (n, mask) in masks.iter().enumerate() {
            // The shear of a single slice is nowhere.
            if grid.dims()[2] == 1 {
                assert_eq!(read_onto(&path, n as i64 + 1, grid), *mask);
            } else {
                same_voxels(&path, n as i64 + 1, grid, mask);
            }
        }
    }
    // Without the image.
    let alone = put(tempfile::tempdir().unwrap().keep().as_path(), "seg.dcm", &{
        let to = WriteTo { source: None, ..to };
        segmentation(&segments, &to).unwrap().bytes
    });
    for (n, mask) in masks.iter().enumerate() {
        assert_eq!(read_onto(&alone, n as i64 + 1, grid), *mask);
    }
    std::fs::remove_dir_all(alone.parent().unwrap()).unwrap();
}

#[test]
fn single_voxels_full_masks_and_odd_sizes_come_back() {
    for kind in 0..4 {
        for dims in [[1, 1, 1], [31, 61, 3], [5, 3, 7], [64, 2, 2], [65, 9, 4]] {
            let grid = grid_of(kind, dims);
            let count = grid.voxel_count();
            let mut one = MaskBits::empty(dims);
            one.set(grid.ijk(count / 2));
            let checkered = MaskBits::from_fn(dims, |at| grid.ijk(at).iter().sum::<usize>() % 2 == 0);
            // First and last slice alone: the slices between have no frames.
            let ends = MaskBits::from_fn(dims, |at| [0, dims[2] - 1].contains(&grid.ijk(at)[2]));
            round_trip(&grid, &[one, MaskBits::full(dims), checkered, ends]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn random_masks_come_back(
        kind in 0_usize..4,
        dims in (1_usize..20, 1_usize..20, 1_usize..6),
        density in 1_u64..100,
        seed in any::<u64>(),
    ) {
        let dims = [dims.0, dims.1, dims.2];
        let grid = grid_of(kind, dims);
        let mut state = seed | 1;
        let mut random = || {
            MaskBits::from_fn(dims, |at| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                at == 0 || state >> 33 < (density << 31) / 100
            })
        };
        let masks = [random(), random()];
        round_trip(&grid, &masks);
    }
}

#[test]
fn masks_with_other_axes_than_the_image_are_written_on_its_slices() {
    let dims = [6, 7, 5];
    let on_image = grid_of(2, dims);
    let folder = tempfile::tempdir().unwrap();
    image(folder.path(), &on_image, "");
    let source =
        source_image(&folder.path().join("image002.dcm"), Some("1.9.77.2"), &Progress::new()).unwrap();
    // Slices along rows of the image, columns reversed, part of it.
    let m = on_image.world_from_voxel().matrix3;
    let affine = DAffine3 {
        matrix3: DMat3::from_cols(-m.x_axis, m.z_axis, m.y_axis),
        translation: on_image.center_of_voxel_mm([5, 1, 2]),
    };
    let other = Grid::new([4, 5, 3], affine, Sides::Known).unwrap();
    // Slices 3 and 4 of the grid lie beyond the image's.
    let mask = MaskBits::from_fn([4, 5, 3], |at| at % 3 == 0 && other.ijk(at)[1] < 3);
    let to = to(&other, Some(&source), true);
    let segments = [segment("A", &mask)];
    for (name, written) in [("a", segmentation(&segments, &to)), ("b", structure_set(&segments, &to))] {
        let path = put(folder.path(), name, &written.unwrap().bytes);
        let loaded = read(&path, 1).unwrap();
        assert!(loaded.volume.grid().same_place(&on_image, 1e-6));
        let back = read_onto(&path, 1, &on_image);
        assert_eq!(back.count(), mask.count());
        mask.for_each(|at| {
            let voxel = on_image.voxel_at(other.center_of_voxel_mm(other.ijk(at))).unwrap();
            assert!(back.get(voxel));
        });
    }
    // Beyond the image: slices of their own.
    let mask = MaskBits::from_fn([4, 5, 3], |at| at % 4 == 1);
    let segments = [segment("A", &mask)];
    // The sheared step lies within these slices, whose axes aren't orthogonal.
    for write in [segmentation, structure_set] {
        let error = write(&segments, &to).unwrap_err().to_string();
        assert!(error.contains("orthogonal"), "{error}");
    }
}

#[test]
fn masks_off_the_image_have_slices_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    image(folder.path(), &grid_of(1, [6, 7, 5]), "");
    let source = source_image(folder.path(), None, &Progress::new()).unwrap();
    let fine = Grid::axis_aligned([8, 6, 9], DVec3::new(-0.5, 0.6, 0.7), DVec3::new(-30.0, 40.0, 10.0));
    let fine = fine.unwrap();
    let mask = MaskBits::from_fn([8, 6, 9], |at| at % 5 == 0);
    let (segments, to) = ([segment("A", &mask)], to(&fine, Some(&source), true));
    let error = structure_set(&segments, &to).unwrap_err().to_string();
    assert!(error.contains("the image's voxels"), "{error}");
    // Left-handed: slices are written from the last to the first.
    let written = segmentation(&segments, &to).unwrap();
    assert_eq!(written.checks[0].code, "dicom-write-own-grid");
    let path = put(folder.path(), "seg.dcm", &written.bytes);
    assert_eq!(read_onto(&path, 1, &fine), mask);
}

#[test]
fn what_cant_be_written_is_refused_in_one_line() {
    let dims = [3, 4, 2];
    let good = grid_of(0, dims);
    let full = MaskBits::full(dims);
    let segments = [segment("A", &full)];
    let mut matrix = DMat3::IDENTITY;
    matrix.y_axis.x = 0.01;
    let skew = grid(dims, matrix);
    let nowhere = Grid::new(dims, DAffine3::IDENTITY, Sides::Unknown).unwrap();
    let tiny = Grid::axis_aligned(dims, DVec3::splat(1e-5), DVec3::ZERO).unwrap();
    let other = Grid::axis_aligned([3, 4, 1], DVec3::ONE, DVec3::ZERO).unwrap();
    for (grid, word) in
        [(&skew, "orthogonal"), (&nowhere, "left and right"), (&tiny, "0.0001"), (&other, "as its grid")]
    {
        for error in [
            segmentation(&segments, &to(grid, None, false)).unwrap_err(),
            structure_set(&segments, &to(grid, None, false)).unwrap_err(),
        ] {
            assert!(error.to_string().contains(word), "{error}");
        }
    }
    for (date, time) in [("2026-11-29", "101112"), ("20261129", "noon"), ("", "101112")] {
        assert!(segmentation(&segments, &WriteTo { date, time, ..to(&good, None, false) }).is_err());
    }
    let empty = MaskBits::empty(dims);
    assert!(segmentation(&[segment("A", &empty)], &to(&good, None, false)).is_err());
    assert!(segmentation(&[], &to(&good, None, false)).is_err());
    let some =
        segmentation(&[segment("none", &empty), segment("B", &full)], &to(&good, None, false)).unwrap();
    assert_eq!(some.checks[0].code, "dicom-write-empty");
    assert!(some.checks[0].message.contains("none"));
    let folder = tempfile::tempdir().unwrap();
    let path = put(folder.path(), "seg.dcm", &some.bytes);
    assert_eq!(read_onto(&path, 1, &good), full);
    assert!(read(&path, 2).is_err());
}

#[test]
fn the_same_inputs_give_the_same_bytes() {
    let grid = grid_of(1, [5, 6, 3]);
    let (a, b) = (MaskBits::from_fn([5, 6, 3], |at| at < 40), MaskBits::from_fn([5, 6, 3], |at| at >= 40));
    let (all, base) = ([segment("A", &a), segment("B", &b)], to(&grid, None, false));
    for write in [segmentation, structure_set] {
        let bytes = write(&all, &base).unwrap().bytes;
        assert_eq!(bytes, write(&all, &base).unwrap().bytes);
        assert_ne!(bytes, write(&all, &WriteTo { salt: "salt", ..base }).unwrap().bytes);
        assert_ne!(bytes, write(&[segment("A", &b), segment("B", &a)], &base).unwrap().bytes);
    }
    let overlap = |all: &[SegmentToWrite<'_>]| {
        let bytes = segmentation(all, &base).unwrap().bytes;
        let parsed = super::parse::parse(&bytes, bytes.len() as u64, false).unwrap();
        parsed.data.text(tags::SEGMENTS_OVERLAP).unwrap()
    };
    let full = MaskBits::full([5, 6, 3]);
    assert_eq!(overlap(&all), "NO");
    assert_eq!(overlap(&[all[0], all[1], segment("C", &full)]), "YES");
    assert_eq!(overlap(&[all[0], all[0]]), "YES");
}

pub(super) fn contains(bytes: &[u8], text: &str) -> bool {
    bytes.windows(text.len()).any(|part| part == text.as_bytes())
}

#[test]
fn nothing_of_the_patient_is_written_unless_it_is_asked_for() {
    let dims = [5, 6, 3];
    let grid = grid_of(2, dims);
    let folder = tempfile::tempdir().unwrap();
    image(folder.path(), &grid, "ZZCANARY_");
    let source = source_image(folder.path(), None, &Progress::new()).unwrap();
    let mask = MaskBits::from_fn(dims, |at| at % 2 == 0);
    let segments = [segment("Tumour\u{1b}[31m\u{202e}\\1", &mask)];
    let to = to(&grid, Some(&source), false);
    let mut references = Vec::new();
    for write in [segmentation, structure_set] {
        let hidden = write(&segments, &to).unwrap().bytes;
        for text in ["ZZCANARY", "1.9.77.1", "1.9.77.2", "1.9.77.3", "1.9.77.4.", "101112", "pepper"] {
            assert!(!contains(&hidden, text), "{text}");
        }
        let parsed = super::parse::parse(&hidden, hidden.len() as u64, false).unwrap();
        for (tag, text) in [
            (tags::PATIENT_NAME, "Anonymous^Patient"),
            (tags::PATIENT_ID, "ANONYMOUS"),
            (tags::PATIENT_IDENTITY_REMOVED, "YES"),
            (tags::LONGITUDINAL_TEMPORAL_INFORMATION_MODIFIED, "REMOVED"),
        ] {
            assert_eq!(parsed.data.text(tag).as_deref(), Some(text));
        }
        assert!(parsed.data.has(tags::STUDY_DATE) && parsed.data.text(tags::STUDY_DATE).is_none());
        assert!(contains(&hidden, "Tumour[31m/1"));
        references
            .push([tags::STUDY_INSTANCE_UID, tags::FRAME_OF_REFERENCE_UID].map(|tag| parsed.data.text(tag)));
        assert_ne!(references[0], [None, None]);
        let numbered = write(&segments, &WriteTo { keeps_names: false, ..to }).unwrap().bytes;
        assert!(!contains(&numbered, "Tumour") && contains(&numbered, "Segment 1"));

        let named = write(&segments, &WriteTo { identified: true, ..to }).unwrap().bytes;
        let parsed = super::parse::parse(&named, named.len() as u64, false).unwrap();
        for tag in IDENTITY {
            let text = format!("ZZCANARY_{:04X}{:04X}", tag.0, tag.1);
            assert_eq!(parsed.data.text(tag), Some(text));
        }
        // Nothing else of the image.
        assert_eq!(named.windows(8).filter(|part| part == b"ZZCANARY").count(), IDENTITY.len());
        assert_eq!(parsed.data.text(tags::STUDY_INSTANCE_UID).as_deref(), Some("1.9.77.1"));
        assert!(!parsed.data.has(tags::PATIENT_IDENTITY_REMOVED));
        assert!(contains(&named, "1.9.77.4.2"));
    }
    assert_eq!(references[0], references[1], "UIDs become others alike");
}
