//! Real files, none of them written by this project: they load or are refused with the expected error.

use crate::common::{
    files_below, read, real_data,
    truth::{self, InRas},
};
use glam::DVec3;
use glioscope_core::{
    Progress,
    files::{self, Source},
};

#[test]
fn every_data_type_loads_or_is_refused_with_its_name() {
    let Some(folder) = real_data("nifti-types") else { return };
    let refused = |name: &str| match name {
        "complex/complex32.nii" => Some("voxels of type complex64"),
        "complex/complex64.nii" => Some("voxels of type complex128"),
        "avg152T1_LR_nifti.hdr.gz" => Some("no .img.gz or .img beside it"),
        _ => None,
    };
    let mut loaded = 0;
    for path in files_below(&folder) {
        let name = path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        if name.ends_with(".md") || name.starts_with("LICENSE") {
            continue;
        }
        match (read(&path), refused(&name)) {
            (Ok(_), None) => loaded += 1,
            (Err(e), Some(why)) => assert!(e.to_string().contains(why), "{e}"),
            (Ok(_), Some(why)) => panic!("{name} loaded, expected {why}"),
            (Err(e), None) => panic!("{e}"),
        }
    }
    assert_eq!(loaded, 33);
}

/// Colours of the voxels, as counted with Python's struct: three of one voxel each, the others black.
#[test]
fn colours_are_labels() {
    let Some(folder) = real_data("nifti-types") else { return };
    for name in ["rgb/3D.nii", "rgb/4D.nii", "rgba/4D.nii"] {
        let path = folder.join(name);
        let source = Source::File(path.clone());
        let segments = files::segments(&source, &Progress::new()).unwrap();
        let colors: Vec<_> = segments.iter().map(|segment| segment.color.unwrap()).collect();
        assert_eq!(colors, [[0, 55, 55], [55, 0, 55], [55, 55, 0]], "{name}");
        assert_eq!((segments[0].name.as_str(), segments[2].label), ("#003737", Some(3)));
        let loaded = read(&path).unwrap();
        let counts = [0, 1, 2, 3]
            .map(|label| (0..27).filter(|at| loaded.volume.value(*at) == f64::from(label)).count());
        assert_eq!(counts, [24, 1, 1, 1], "{name}");
        assert!(loaded.checks.iter().any(|check| check.code == "color-labels"));
    }
}

#[test]
fn every_malformed_file_is_refused_in_one_line() {
    let Some(folder) = real_data("nifti-malformed") else { return };
    let files = files_below(&folder);
    assert!(files.len() >= 19);
    for path in files {
        let e = read(&path).expect_err(&path.display().to_string()).to_string();
        assert!(e.lines().count() == 1 && e.contains(path.to_str().unwrap()), "{e}");
        assert_eq!(files::nifti_info(&Source::File(path)).unwrap_err().to_string(), e);
        println!("{e}");
    }
}

/// Dimensions, values and four voxel centres with the voxel axes reordered to R, A and S: axes are only permuted and
/// flipped, no value is interpolated.
fn reoriented_to_ras(path: &std::path::Path) -> ([usize; 3], Vec<f64>, [DVec3; 4]) {
    let volume = read(path).unwrap().volume;
    let InRas { dims, affine, order } = truth::in_ras(&volume);
    let values = order.into_iter().map(|at| volume.value(at)).collect();
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    (dims, values, corners.map(|c| affine.transform_point3(c)))
}

#[test]
fn all_48_orientations_give_the_same_volume() {
    let Some(folder) = real_data("nifti-orientations") else { return };
    let files: Vec<_> =
        files_below(&folder).into_iter().filter(|p| p.extension().is_some_and(|e| e == "gz")).collect();
    assert_eq!(files.len(), 48);
    let (dims, values, places) = reoriented_to_ras(&folder.join("RAS.nii.gz"));
    for path in files {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let codes: String = read(&path).unwrap().volume.grid().axis_codes().iter().collect();
        assert_eq!(format!("{codes}.nii.gz"), name);
        let (other_dims, other_values, other_places) = reoriented_to_ras(&path);
        assert_eq!(other_dims, dims, "{name}");
        assert!(other_values == values, "{name}: values differ");
        for (a, b) in places.into_iter().zip(other_places) {
            assert!(a.distance(b) < 1e-3, "{name}: {a} and {b}");
        }
    }
}

#[test]
fn a_header_and_its_image_may_be_compressed_differently() {
    let Some(folder) = real_data("nifti-types") else { return };
    let one = read(&folder.join("minimal.nii")).unwrap().volume;
    for other in
        ["minimal2.hdr", "minimal2.img.gz", "minimal.hdr", "minimal.img.gz", "multi-member-gzip.nii.gz"]
    {
        assert_eq!(read(&folder.join(other)).unwrap().volume, one, "{other}");
    }
}
