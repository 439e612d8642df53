//! The embedded sample: equal to the generator's output, small, consistent with its ground truth, and readable.

use std::collections::BTreeSet;

use glioscope_core::case::{self, CaseSpec, LoadOptions};
use glioscope_core::files::{self, ReadOptions, Source};
use glioscope_core::{Progress, Severity, measure, phantom, sample};

fn stored(name: &str) -> &'static [u8] {
    sample::sample_files().find(|(n, _)| *n == name).unwrap_or_else(|| panic!("{name} is not embedded")).1
}

#[test]
fn embedded_files_match_the_generator() {
    let made = phantom::phantom();
    for file in &made {
        let source = Source::Embedded { name: file.name, bytes: stored(file.name) };
        let loaded = files::read(&source, &ReadOptions::default(), &Progress::new()).unwrap();
        assert_eq!(loaded.volume.samples(), file.volume.samples(), "{}", file.name);
        assert_eq!(loaded.volume.scaling(), file.volume.scaling(), "{}", file.name);
        assert!(file.volume.grid().same_place(loaded.volume.grid(), 1e-4), "{}", file.name);
        assert_eq!(loaded.checks, [], "{}", file.name);
    }
    let embedded: BTreeSet<&str> = sample::sample_files().map(|(n, _)| n).collect();
    let expected = made.iter().map(|f| f.name).chain(["case.toml", "truth.json"]).collect();
    assert_eq!(embedded, expected);
}

#[test]
fn embedded_truth_matches_the_shapes() {
    let written: serde_json::Value = serde_json::from_slice(stored("truth.json")).unwrap();
    let now: serde_json::Value =
        serde_json::from_str(&serde_json::to_string(&phantom::truth()).unwrap()).unwrap();
    assert_eq!(written, now);
}

#[test]
fn the_sample_is_small() {
    let total: usize = sample::sample_files().map(|(_, bytes)| bytes.len()).sum();
    assert!(total <= 2_000_000, "{total} bytes");
}

#[test]
fn the_sample_loads_with_its_true_volumes() {
    let case = case::load(&sample::sample_spec(), &LoadOptions::default(), &Progress::new()).unwrap();
    let report = measure::report(&case);
    let truth = phantom::truth();
    assert_eq!(report.time_points.len(), 2);
    for (time, truth) in report.time_points.iter().zip(&truth.time_points) {
        assert_eq!(time.time, truth.time);
        assert_eq!((time.masks.len(), time.regions.len(), time.pairs.len()), (3, 7, 3));
        for (mask, truth) in time.masks.iter().zip(&truth.masks) {
            assert_eq!(mask.id, truth.id);
            // 1 mm voxels, volumes of 12 to 53 ml: within 1.5 % on their native grid and on the case grid.
            for found_ml in [mask.native_volume_ml, mask.volume_ml] {
                assert!(
                    (found_ml / truth.volume_ml - 1.0).abs() < 0.015,
                    "{} {found_ml} {}",
                    mask.id,
                    truth.volume_ml
                );
            }
        }
        for truth in &truth.regions {
            let found = time.regions.iter().find(|r| r.masks == truth.masks).unwrap();
            // PET's 3 mm voxels limit the accuracy of small regions: a shell of half a voxel, 0.15 ml.
            assert!(
                (found.volume_ml - truth.volume_ml).abs() < 0.15 + 0.01 * truth.volume_ml,
                "{found:?} {truth:?}"
            );
        }
        let shares: f64 = time.regions.iter().map(|r| r.share).sum();
        assert!((shares - 1.0).abs() < 1e-12);
    }
    // Left is negative x: the tumour is left anterior.
    for time in &case.time_points {
        let center = time.regions.centroid_mm().unwrap();
        assert!(center.x < -20.0 && center.y > 5.0, "{center}");
        assert_eq!(time.contexts.iter().map(|c| c.id.as_str()).collect::<Vec<_>>(), ["T1c", "FLAIR", "PET"]);
    }
    assert!(case.checks.iter().all(|c| c.severity == Severity::Note), "{:?}", case.checks);
}

#[test]
fn the_written_sample_reads_back_as_the_same_case() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("sample");
    sample::write_sample(&folder).unwrap();
    let again = sample::write_sample(&folder).unwrap_err().to_string();
    assert!(again.contains("found a folder with something in it, expected a new or empty folder"), "{again}");
    assert_eq!(std::fs::read_dir(parent.path()).unwrap().count(), 1, "a temporary folder was left");

    let spec = CaseSpec::from_path(&folder).unwrap();
    let load = |spec| case::load(spec, &LoadOptions::default(), &Progress::new()).unwrap();
    let (read, embedded) = (load(&spec), load(&sample::sample_spec()));
    assert_eq!(read.time_points, embedded.time_points);
    assert_eq!(read.name, embedded.name);
}

/// Without its manifest, the same images and masks are found from the file names, and every guess is noted.
#[test]
fn the_sample_is_recognised_without_its_manifest() {
    let parent = tempfile::tempdir().unwrap();
    let folder = parent.path().join("sample");
    sample::write_sample(&folder).unwrap();
    std::fs::remove_file(folder.join("case.toml")).unwrap();
    let spec = CaseSpec::from_path(&folder).unwrap();
    let mut masks: Vec<_> = spec.masks.iter().map(|m| (m.id.as_str(), m.time.as_deref().unwrap())).collect();
    masks.sort_unstable();
    let days = phantom::TIMES;
    assert_eq!(
        masks,
        [
            ("pet", days[0]),
            ("pet", days[1]),
            ("t1", days[0]),
            ("t1", days[1]),
            ("t2", days[0]),
            ("t2", days[1])
        ]
    );
    assert_eq!(spec.contexts.len(), 6);
    let codes: BTreeSet<&str> = spec.notes.iter().map(|n| n.code).collect();
    assert_eq!(codes, BTreeSet::from(["guessed-kinds", "guessed-times", "guessed-labels", "left-out-kinds"]));
    case::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
}
