//! NRRD, MetaImage and Slicer segmentations made by other programs, against the truth that came with them
//! (`truth.json`): every case loads as it says, or is refused in one line.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::{
    real_data,
    truth::{self, InRas},
};
use glam::DVec3;
use glioscope_core::files::{self, FileError, Inputs, Loaded, ReadOptions, Segment, Source};
use glioscope_core::{Progress, Sides, Volume};
use serde_json::Value;

fn read_frame(path: &Path, frame: usize) -> Result<Loaded, FileError> {
    files::read(
        &Source::File(path.to_owned()),
        &ReadOptions { frame, ..ReadOptions::default() },
        &Progress::new(),
    )
}

/// Values with axes along R, A and S, R fastest, their dimensions and the affine that belongs to them.
fn in_ras(volume: &Volume) -> (Vec<f64>, [usize; 3], [[f64; 4]; 3]) {
    let InRas { dims, affine, order } = truth::in_ras(volume);
    let rows = [0, 1, 2].map(|row| affine.row(row).to_array());
    (order.into_iter().map(|at| volume.value(at)).collect(), dims, rows)
}

/// What differs between a volume and its facts.
fn differences(name: &str, volume: &Volume, facts: &Value) -> Vec<String> {
    let mut out = Vec::new();
    let mut expect = |what: &str, found: String, expected: String| {
        if found != expected {
            out.push(format!("{name}: {what} {found}, expected {expected}"));
        }
    };
    let grid = volume.grid();
    let dims =
        |key: &str| facts[key].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect::<Vec<_>>();
    expect("dims", format!("{:?}", grid.dims()), format!("{:?}", dims("source_dims")));
    expect("axes", grid.axis_codes().iter().collect(), facts["source_axes"].as_str().unwrap().into());
    expect("sides", format!("{:?}", grid.sides()), format!("{:?}", Sides::Known));
    let (values, ras_dims, affine) = in_ras(volume);
    expect("RAS dims", format!("{ras_dims:?}"), format!("{:?}", dims("ras_dims")));
    let tolerance = if name.ends_with(".nii.gz") { 2e-5 } else { 1e-6 };
    for (row, numbers) in affine.iter().enumerate() {
        for (column, number) in numbers.iter().enumerate() {
            let expected = facts["ras_affine"][row][column].as_f64().unwrap();
            if (number - expected).abs() > tolerance {
                expect("affine", format!("[{row}][{column}] {number}"), expected.to_string());
            }
        }
    }
    if let Some(hash) = facts["ras_u8_sha256"].as_str() {
        let bytes: Vec<u8> = values.iter().map(|&v| v as u8).collect();
        assert!(values.iter().all(|&v| v.fract() == 0.0 && (0.0..256.0).contains(&v)), "{name}");
        expect("labels", truth::sha256(bytes), hash.into());
    }
    if let Some(hash) = facts["ras_f32le_sha256"].as_str() {
        let bytes: Vec<u8> = values.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
        expect("values", truth::sha256(bytes), hash.into());
    }
    if let Some(volume_ml) = facts["volume_ml"].as_f64() {
        let voxels = values.iter().filter(|v| **v != 0.0).count() as u64;
        let found = grid.volume_ml(voxels);
        if (found - volume_ml).abs() > 1e-4 * volume_ml {
            expect("volume", found.to_string(), volume_ml.to_string());
        }
    }
    out
}

/// The mask of a segment as a volume of 0 and 1.
fn mask(path: &Path, segment: &Segment) -> Volume {
    let loaded = read_frame(path, segment.frame).unwrap();
    let volume = &loaded.volume;
    let is_active = |value: f64| segment.label.map_or(value > 0.5, |label| value == label as f64);
    let bits = (0..volume.samples().len()).map(|at| u8::from(is_active(volume.value(at)))).collect();
    Volume::new(volume.grid().clone(), glioscope_core::Samples::U8(bits), glioscope_core::Scaling::NONE)
        .unwrap()
}

fn segment_differences(name: &str, path: &Path, facts: &Value) -> Vec<String> {
    let segments = files::segments(&Source::File(path.to_owned()), &Progress::new()).unwrap();
    let facts = facts.as_object().unwrap();
    let mut names: Vec<&str> = segments.iter().map(|s| s.name.as_str()).collect();
    names.sort_unstable();
    let mut expected: Vec<&str> = facts.keys().map(String::as_str).collect();
    expected.sort_unstable();
    assert_eq!(names, expected, "{name}");
    assert!(segments.iter().all(|s| s.color.is_some()), "{name}");
    segments
        .iter()
        .flat_map(|s| differences(&format!("{name} {}", s.name), &mask(path, s), &facts[&s.name]))
        .collect()
}

#[test]
fn every_case_is_as_its_truth_says() {
    let Some(folder) = real_data("nrrd-mha") else { return };
    let (mut wrong, mut met) = (Vec::new(), 0);
    for (name, case) in truth::cases(&folder) {
        let path = folder.join(&name);
        let before = wrong.len();
        let loaded = read_frame(&path, 0);
        let source = Source::File(path.clone());
        let info = files::info(&source, &Progress::new());
        assert_eq!(loaded.is_ok(), info.is_ok(), "{name}");
        match (case["expect"].as_str().unwrap(), loaded) {
            ("volume", Ok(loaded)) => {
                wrong.extend(differences(&name, &loaded.volume, &case["volume"]));
                assert_eq!(loaded.frames, 1, "{name}");
                let odd =
                    loaded.checks.iter().find(|c| c.code != "units-converted" && c.code != "units-unknown");
                wrong.extend(odd.map(|check| format!("{name}: {check:?}")));
            }
            ("frames", Ok(_)) => {
                for (frame, facts) in case["frames"].as_array().unwrap().iter().enumerate() {
                    let loaded = read_frame(&path, frame).unwrap();
                    assert_eq!(loaded.frames, case["frames"].as_array().unwrap().len());
                    wrong.extend(differences(&format!("{name} {frame}"), &loaded.volume, facts));
                }
                assert!(read_frame(&path, 99).unwrap_err().to_string().contains("frame 99"));
            }
            ("segments", Ok(loaded)) => {
                wrong.extend(segment_differences(&name, &path, &case["segments"]));
                assert!(loaded.checks.is_empty(), "{name}: {:?}", loaded.checks);
            }
            ("warn", Ok(loaded)) => {
                wrong.extend(segment_differences(&name, &path, &case["segments"]));
                let check = loaded.checks.iter().find(|c| c.code == "segment-undeclared").unwrap();
                assert!(check.message.contains("4 (1123 voxels)"), "{}", check.message);
            }
            ("unknown-sides", Ok(loaded)) => {
                let grid = loaded.volume.grid();
                assert_eq!(grid.sides(), Sides::Unknown, "{name}");
                assert_eq!(
                    (grid.dims(), grid.spacing_mm()),
                    ([31, 61, 18], DVec3::new(2.0, 1.0, 3.0)),
                    "{name}"
                );
                assert!(loaded.checks.iter().any(|c| c.code == "side-unknown"), "{name}");
            }
            ("refuse", Err(error)) => println!("{error}"),
            (expected, Ok(_)) => wrong.push(format!("{name}: loaded, expected {expected}")),
            (expected, Err(error)) => wrong.push(format!("{name}: {error}, expected {expected}")),
        }
        met += usize::from(wrong.len() == before);
    }
    println!("{met} cases met");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(met >= 70, "{met}");
}

#[test]
fn every_malformed_file_is_refused_in_one_line_and_at_once() {
    let Some(folder) = real_data("nrrd-mha-malformed") else { return };
    let (mut wrong, mut met) = (Vec::new(), 0);
    for (name, case) in truth::cases(&folder) {
        let path = folder.join(&name);
        let source = Source::File(path.clone());
        let start = Instant::now();
        let loaded = read_frame(&path, 0);
        let took = start.elapsed();
        let info = files::info(&source, &Progress::new()).map(|_| ());
        let segments = files::segments(&source, &Progress::new());
        assert!(took < Duration::from_secs(5), "{name}: {took:?}");
        if let Err(error) = &loaded {
            let error = error.to_string();
            println!("{error}");
            assert!(
                error.lines().count() == 1 && error.len() < 400 && error.contains(": found "),
                "{name}: {error}"
            );
            assert_eq!(info.unwrap_err().to_string(), error);
        }
        match (case["expect"].as_str().unwrap(), &loaded) {
            ("load", Ok(loaded)) if loaded.checks.is_empty() => met += 1,
            ("warn", Ok(loaded)) if !loaded.checks.is_empty() => {
                assert!(loaded.checks.iter().any(|c| ["trailing-bytes", "sheared"].contains(&c.code)));
                met += 1;
            }
            ("refuse", Err(_)) | ("no-crash", _) => met += 1,
            (expected, _) => {
                wrong.push(format!("{name}: {:?}, expected {expected}", loaded.map(|l| l.checks)));
            }
        }
        if name == "seg-million.seg.nrrd" {
            assert_eq!(segments.unwrap()[0].number, 999_999_999);
        }
    }
    println!("{met} cases met");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(met >= 80, "{met}");
}

#[test]
fn data_files_are_inputs_of_a_case() {
    let Some(folder) = real_data("nrrd-mha") else { return };
    for (header, part, count) in [
        ("detached.nhdr", "detached.raw", 2),
        ("detached-list2d.nhdr", "parts/p07.raw", 19),
        ("pattern.mhd", "parts/p17.raw", 19),
        ("sitk-oblique.mhd", "sitk-oblique.zraw", 2),
    ] {
        let inputs = Inputs::new([folder.join(header)]);
        assert_eq!(inputs.paths().len(), count, "{header}");
        assert!(inputs.refuse_as_output(&folder.join(part)).is_err(), "{header}");
    }
}
