//! Real files, none of them written by this project: they load, or are refused by name.

mod common;

use common::{files_below, read, real_data};

#[test]
fn every_type_loads_or_is_refused_by_name() {
    let Some(folder) = real_data("nifti-types") else { return };
    let refused = |name: &str| match name {
        "rgb/3D.nii" | "rgb/4D.nii" => Some("voxels of type RGB24"),
        "rgba/4D.nii" => Some("voxels of type RGBA32"),
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
    assert_eq!(loaded, 30);
}

#[test]
fn every_malformed_file_is_refused_in_one_line() {
    let Some(folder) = real_data("nifti-malformed") else { return };
    let files = files_below(&folder);
    assert!(files.len() >= 19);
    for path in files {
        let e = read(&path).expect_err(&path.display().to_string()).to_string();
        assert!(e.lines().count() == 1 && e.contains(path.to_str().unwrap()), "{e}");
        assert_eq!(
            glioscope_core::files::info(&glioscope_core::files::Source::File(path)).unwrap_err().to_string(),
            e
        );
        println!("{e}");
    }
}
