//! Masks written as DICOM for a real image, and read again beside it.

use std::path::Path;

use crate::common::{files_below, real_data};
use glioscope_core::{
    MaskBits, Progress,
    files::dicom::{SegmentToWrite, WriteTo, Written, segmentation, source_image, structure_set},
    files::{self, FileError, Loaded, Part, ReadOptions, Source, Which, write_whole},
};

fn read(source: &Source) -> Loaded {
    files::read(source, &ReadOptions::default(), &Progress::new()).unwrap()
}

type Write = fn(&[SegmentToWrite<'_>], &WriteTo<'_>) -> Result<Written, FileError>;

/// Masks of a label map written for an image, by both writers, have the label map's voxels beside the image.
fn round_trip(image: &Path, labels: &Path) {
    let labels = read(&Source::File(labels.to_owned()));
    let (grid, volume) = (labels.volume.grid(), &labels.volume);
    let source = source_image(image, None, &Progress::new()).unwrap();
    let mut values: Vec<i64> = (0..grid.voxel_count()).map(|at| volume.value(at) as i64).collect();
    values.sort_unstable();
    values.dedup();
    values.retain(|&value| value != 0);
    assert!(values.len() > 1, "{values:?}");
    let masks: Vec<MaskBits> = values
        .iter()
        .map(|&value| MaskBits::from_fn(grid.dims(), |at| volume.value(at) as i64 == value))
        .collect();
    let names: Vec<String> = values.iter().map(|value| format!("Label {value}")).collect();
    let segments: Vec<SegmentToWrite<'_>> = masks
        .iter()
        .zip(&names)
        .map(|(mask, name)| SegmentToWrite { name, color: Some([220, 60, 30]), mask })
        .collect();
    for (name, write) in [("seg.dcm", segmentation as Write), ("rtstruct.dcm", structure_set as Write)] {
        for identified in [true, false] {
            let to = WriteTo {
                grid,
                source: Some(&source),
                identified,
                keeps_names: true,
                salt: "test",
                date: "20261129",
                time: "120000",
                version: "test",
            };
            let written = write(&segments, &to).unwrap();
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join(name);
            write_whole(&file, &written.bytes).unwrap();
            // Without the patient's UIDs it doesn't belong to the image; contours need one.
            if !identified && name != "seg.dcm" {
                continue;
            }
            for path in files_below(image) {
                std::os::unix::fs::symlink(&path, folder.path().join(path.file_name().unwrap())).unwrap();
            }
            for (n, mask) in masks.iter().enumerate() {
                let part = Part { path: file.clone(), series: None, which: Which::Segment(n as i64 + 1) };
                let loaded = read(&Source::Part(part));
                let own = loaded.volume.grid();
                let mut back = MaskBits::empty(grid.dims());
                for at in (0..own.voxel_count()).filter(|&at| loaded.volume.value(at) > 0.0) {
                    back.set(grid.voxel_at(own.center_of_voxel_mm(own.ijk(at))).unwrap());
                }
                assert!(back == *mask, "{name}, {}, identified: {identified}", names[n]);
            }
        }
    }
}

#[test]
fn label_maps_come_back_beside_the_image() {
    let (Some(series), Some(nrrd)) = (real_data("dicom-series"), real_data("nrrd-mha")) else { return };
    round_trip(&series.join("plain-axial"), &nrrd.join("labels.nii.gz"));
}
