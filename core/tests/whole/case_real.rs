//! Real cases against NumPy, SciPy and nibabel. The expected numbers are committed with the script that made them:
//! tests/expected/glioma_regions.py.

use std::path::Path;

use crate::common::real_data;
use glioscope_core::case::{self, Case, CaseSpec, LoadOptions};
use glioscope_core::measure::{self, TimeReport};
use glioscope_core::{Progress, Severity, grid::ijk};
use serde_json::Value;

fn expected(name: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/expected").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn load(spec: &CaseSpec) -> Case {
    case::load(spec, &LoadOptions::default(), &Progress::new()).unwrap()
}

fn codes(case: &Case) -> Vec<&'static str> {
    case.checks.iter().map(|c| c.code).collect()
}

fn assert_close(found: f64, expected: &Value, relative: f64) {
    let expected = expected.as_f64().unwrap();
    assert!((found - expected).abs() <= relative * expected.abs(), "found {found}, expected {expected}");
}

/// Asserts that regions and pairs equal the expected ones: counts exactly, ratios within rounding.
fn assert_same_regions(found: &TimeReport, expected: &Value) {
    let regions = expected["regions"].as_array().unwrap();
    assert_eq!(found.regions.len(), regions.len());
    for region in regions {
        let ids: Vec<&str> =
            region["masks"].as_array().unwrap().iter().map(|m| m.as_str().unwrap()).collect();
        let found_region =
            found.regions.iter().find(|r| r.masks == ids).unwrap_or_else(|| panic!("no region {ids:?}"));
        assert_eq!(found_region.voxels, region["voxels"].as_u64().unwrap(), "{ids:?}");
    }
    let pairs = expected["pairs"].as_array().unwrap();
    assert_eq!(found.pairs.len(), pairs.len());
    for (found, pair) in found.pairs.iter().zip(pairs) {
        assert_eq!(
            (found.a.as_str(), found.b.as_str()),
            (pair["a"].as_str().unwrap(), pair["b"].as_str().unwrap())
        );
        assert_close(found.value("dice").unwrap(), &pair["dice"], 1e-12);
        assert_close(found.value("jaccard").unwrap(), &pair["jaccard"], 1e-12);
    }
}

/// Issue 2, "Show" 2: whole tumour of three algorithms, as three masks on the command line.
#[test]
fn glioma_regions_match_numpy() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let masks: Vec<String> = ["hnfnetv1-20", "isen-20", "scan-20"]
        .iter()
        .map(|id| format!("{id}={}:1,2,4", folder.join(format!("{id}.nii.gz")).display()))
        .collect();
    let case = load(&CaseSpec::from_arguments(&masks, &[]).unwrap());
    let report = measure::report(&case);
    let expected = expected("glioma_regions.json");
    assert_eq!(report.grid.dims, [240, 240, 155]);
    assert_same_regions(&report.time_points[0], &expected);
    for (found, mask) in report.time_points[0].masks.iter().zip(expected["masks"].as_array().unwrap()) {
        assert_eq!(found.id, mask["id"].as_str().unwrap());
        assert_eq!(found.voxels, mask["voxels"].as_u64().unwrap());
        assert_close(found.native_volume_ml, &mask["volume_ml"], 1e-6);
    }
}

/// The folder has no manifest: images are recognised by name, label maps by content, and every guess is noted.
#[test]
fn a_folder_without_manifest_is_interpreted() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let spec = CaseSpec::from_path(&folder).unwrap();
    let contexts: Vec<&str> = spec.contexts.iter().map(|c| c.id.as_str()).collect();
    assert_eq!(contexts, ["fla", "t1", "t1c", "t2"]);
    let masks: Vec<&str> = spec.masks.iter().map(|m| m.id.as_str()).collect();
    assert_eq!(masks, ["consensus", "hnfnetv1-20", "isen-20", "sanet0-20", "scan-20", "yixinmpl-20"]);
    let notes: Vec<&str> = spec.notes.iter().map(|n| n.message.as_str()).collect();
    assert!(notes.iter().any(|n| n.contains("images: guessed from names: fla, t1, t1c, t2")), "{notes:?}");
    assert!(
        notes.iter().any(|n| n.contains("masks: guessed from contents") && n.contains("scan-20")),
        "{notes:?}"
    );
    assert!(notes.iter().any(|n| n.contains("every voxel above 0.5")), "{notes:?}");
    let case = load(&spec);
    assert_eq!(case.time_points[0].contexts.len(), 4);
    assert_eq!(case.time_points[0].index.mask_ids().len(), 6);
}

/// A single label map: each of its labels becomes a mask, and a note states so.
#[test]
fn one_label_map_becomes_a_mask_per_label() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let spec = CaseSpec::from_path(&folder.join("consensus.nii.gz")).unwrap();
    let masks: Vec<(&str, Option<&[i64]>)> =
        spec.masks.iter().map(|m| (m.id.as_str(), m.labels.as_deref())).collect();
    assert_eq!(
        masks,
        [("consensus-1", Some(&[1][..])), ("consensus-2", Some(&[2][..])), ("consensus-4", Some(&[4][..]))]
    );
    assert!(spec.notes.iter().any(|n| n.code == "guessed-labels" && n.message.contains("1, 2, 4")));
    assert_eq!(load(&spec).time_points[0].regions.list().len(), 3);
    let image = CaseSpec::from_path(&folder.join("t1c.nii.gz")).unwrap();
    assert_eq!((image.contexts.len(), image.masks.len()), (1, 0));
    let case = load(&image);
    assert!(case.time_points[0].regions.list().is_empty());
    assert_eq!(case.grid.dims(), [240, 240, 155]);
}

/// Issue 2, "Show" 4: three masks on three grids: volumes before and after resampling, and the position of PET.
#[test]
fn sarcoma_masks_on_three_grids() {
    let Some(folder) = real_data("sarcoma-ct-mr-pet") else { return };
    let spec = CaseSpec::from_path(&folder).unwrap();
    let case = load(&spec);
    let report = measure::report(&case);
    let expected = expected("sarcoma_masks.json");
    let time = &report.time_points[0];
    assert_eq!(case.time_points[0].contexts.len(), 3);
    assert_same_regions(time, &expected);
    // As stated in ../shared/data/README.md.
    for (mask, ml) in time.masks.iter().zip([80.12, 80.12, 79.90]) {
        assert!((mask.native_volume_ml - ml).abs() < 0.005, "{mask:?}");
    }
    for (found, mask) in time.masks.iter().zip(expected["masks"].as_array().unwrap()) {
        assert_eq!(found.id, mask["id"].as_str().unwrap());
        assert_eq!(found.native_voxels, mask["native_voxels"].as_u64().unwrap());
        assert_eq!(found.voxels, mask["voxels"].as_u64().unwrap());
        assert_close(found.native_volume_ml, &mask["native_volume_ml"], 1e-6);
        assert_close(found.volume_ml, &mask["volume_ml"], 1e-6);
    }
    let pet = &time.masks[2];
    let pet_bits = case.time_points[0].masks[2].mask.bits();
    let (mut sum, mut n) = (glam::DVec3::ZERO, 0.0);
    let dims = case.grid.dims();
    pet_bits.for_each(|l| {
        sum += case.grid.center_of_voxel_mm(ijk(dims, l));
        n += 1.0;
    });
    let native = &expected["masks"][2]["native_centroid_mm"];
    for axis in 0..3 {
        // A systematic shift would be half of PET's 5.5 mm voxels; nearest neighbour keeps the centroid far better.
        assert!((sum[axis] / n - native[axis].as_f64().unwrap()).abs() < 0.5, "{}", pet.id);
    }
    let resampled: Vec<&str> =
        case.checks.iter().filter(|c| c.code == "mask-resampled").map(|c| c.message.as_str()).collect();
    assert!(
        resampled
            .iter()
            .any(|m| m.starts_with("PET: ") && m.contains("79.900 ml before, 79.524 ml after (-0.47 %)")),
        "{resampled:?}"
    );
    assert!(codes(&case).contains(&"grids-differ"));
    assert!(!codes(&case).contains(&"masks-do-not-touch"));
    assert!(case.checks.iter().all(|c| c.severity < Severity::Error));
}

#[test]
fn degenerate_masks_load_and_are_reported() {
    let Some(folder) = real_data("masks-degenerate") else { return };
    let expected = expected("degenerate_masks.json");
    let files = expected["masks"].as_array().unwrap();
    let masks: Vec<String> = files
        .iter()
        .map(|m| {
            let file = m["file"].as_str().unwrap();
            format!("{}={}", file.trim_end_matches("_mask.nii.gz"), folder.join(file).display())
        })
        .collect();
    let case = load(&CaseSpec::from_arguments(&masks, &[]).unwrap());
    let report = measure::report(&case);
    let time = &report.time_points[0];
    for (found, mask) in time.masks.iter().zip(files) {
        assert_eq!(found.voxels, mask["voxels"].as_u64().unwrap(), "{}", found.id);
    }
    let empty: Vec<&str> =
        case.checks.iter().filter(|c| c.code == "mask-empty").map(|c| c.message.as_str()).collect();
    assert_eq!(empty, ["empty: found an empty mask (no voxel is above 0.5), expected active voxels"]);
    let with_empty = time.pairs.iter().find(|p| p.a == "disconnected" && p.b == "empty").unwrap();
    assert_eq!(with_empty.values, [Some(0.0), Some(0.0)]);
    // The folder itself: masks by name; the constant image is no mask.
    let spec = CaseSpec::from_path(&folder).unwrap();
    assert_eq!(spec.contexts.iter().map(|c| c.id.as_str()).collect::<Vec<_>>(), ["uninformative"]);
    assert_eq!(spec.masks.len(), 4);
}

/// A case that consists of an empty mask only.
#[test]
fn a_case_of_one_empty_mask_loads() {
    let Some(folder) = real_data("masks-degenerate") else { return };
    let case = load(&CaseSpec::from_path(&folder.join("empty_mask.nii.gz")).unwrap());
    let report = measure::report(&case);
    assert!(report.time_points[0].regions.is_empty());
    assert_eq!((report.time_points[0].masks[0].voxels, report.time_points[0].masks[0].share), (0, 0.0));
    assert_eq!(case.time_points[0].regions.centroid_mm(), None);
}

#[test]
fn every_malformed_file_gives_a_one_line_error() {
    let Some(folder) = real_data("nifti-malformed") else { return };
    for path in crate::common::files_below(&folder) {
        let masks = [format!("bad={}", path.display())];
        let spec = CaseSpec::from_arguments(&masks, &[]).unwrap();
        let error = case::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap_err().to_string();
        assert!(!error.contains('\n') && error.contains("found ") && error.contains("expected "), "{error}");
    }
}

/// Dice and union as of full-size copies of the masks, which any program can compare voxel by voxel
/// (../shared/data/reported/README.md, 51-dcmqi-513).
#[test]
fn small_grids_that_do_not_cover_each_other_lose_nothing_in_either_order() {
    let Some(folder) = real_data("reported/51-dcmqi-513") else { return };
    let argument = |date: &str| format!("{date}={}", folder.join(format!("{date}.nii.gz")).display());
    for order in [["date1", "date2"], ["date2", "date1"]] {
        let spec = CaseSpec::from_arguments(&order.map(argument), &[]).unwrap();
        let report = measure::report(&load(&spec));
        let time = &report.time_points[0];
        assert!((time.pairs[0].value("dice").unwrap() - 0.3176).abs() < 5e-5, "{:?}", time.pairs);
        let largest = time.masks.iter().map(|m| m.volume_ml).fold(0.0, f64::max);
        assert!((largest - 11.583).abs() < 5e-4, "{largest}");
    }
}

/// Masks of two dates that share no place keep their volumes (48-unregistered).
#[test]
fn masks_without_a_common_place_keep_their_volumes() {
    let Some(folder) = real_data("reported/48-unregistered") else { return };
    let argument = |(file, date): (&str, &str)| format!("A={}@{date}", folder.join(file).display());
    let masks = [("a.nii.gz", "2024-01-01"), ("b.nii.gz", "2024-02-01")].map(argument);
    let case = load(&CaseSpec::from_arguments(&masks, &[]).unwrap());
    for time_point in &case.time_points {
        let mask = &time_point.masks[0];
        assert!((mask.mask.volume_ml() - 2.103).abs() < 5e-4, "{}", mask.mask.volume_ml());
    }
}
