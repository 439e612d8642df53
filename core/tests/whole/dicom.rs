//! DICOM against truths that pydicom, highdicom, SimpleITK and dcm2niix made, case by case.

use std::path::{Path, PathBuf};

use crate::common::{files_below, real_data, truth};
use glioscope_core::{
    Progress,
    files::{self, FileError, Loaded, Part, ReadOptions, Segment, Source, Which},
};
use serde_json::Value;

const AFFINE_MM: f64 = 1e-6;

fn read_frame(source: &Source, frame: usize) -> Result<Loaded, FileError> {
    files::read(source, &ReadOptions { frame, ..ReadOptions::default() }, &Progress::new())
}

fn whole(path: &Path) -> Source {
    Source::File(path.to_owned())
}

/// Reads every volume of a source.
fn all_frames(source: &Source) -> Result<Vec<Loaded>, FileError> {
    let first = read_frame(source, 0)?;
    let mut all = vec![first];
    for frame in 1..all[0].frames {
        match read_frame(source, frame) {
            Ok(loaded) => all.push(loaded),
            // A localizer, or another volume that is none.
            Err(FileError::Wrong { .. }) => {}
            Err(cancelled) => return Err(cancelled),
        }
    }
    Ok(all)
}

fn one_line(error: &FileError) -> bool {
    let text = error.to_string();
    !text.contains('\n') && text.contains("found ") && text.contains("expected ")
}

/// A folder with links to files.
fn linked(files: &[PathBuf]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (n, file) in files.iter().enumerate() {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        std::os::unix::fs::symlink(file, folder.path().join(format!("{n:04}-{name}"))).unwrap();
    }
    folder
}

fn files_of(folder: &Path) -> Vec<PathBuf> {
    if !folder.is_dir() {
        return Vec::new();
    }
    let mut all: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    all.retain(|path| path.is_file());
    all.sort();
    all
}

/// Checks volumes against a list of truths, in any order.
fn match_volumes(loaded: &[Loaded], truths: &[Value], tolerance: f64) -> Option<String> {
    for (n, truth) in truths.iter().enumerate() {
        let differences: Vec<Option<String>> =
            loaded.iter().map(|l| truth::difference(&l.volume, truth, tolerance)).collect();
        if differences.iter().all(Option::is_some) {
            return Some(format!("volume {n}: {differences:?}"));
        }
    }
    None
}

fn series_case(path: &Path, case: &Value) -> Option<String> {
    // Truths of real scans come from NIfTI headers, which have floats.
    let is_real = path.file_name().unwrap().to_string_lossy().starts_with("real-");
    let tolerance = if is_real { 2e-5 } else { AFFINE_MM };
    let source = whole(path);
    let expect = case["expect"].as_str().unwrap();
    match expect {
        "volume" | "warn" | "sheared" => match all_frames(&source) {
            Ok(loaded) => {
                let difference = truth::difference(&loaded[0].volume, &case["volume"], tolerance);
                let warned = loaded[0].checks.iter().any(|c| c.severity == glioscope_core::Severity::Warning);
                difference.or((expect != "volume" && !warned).then(|| "no warning".into()))
            }
            Err(error) => Some(error.to_string()),
        },
        "volumes" if case["volumes"][0].get("SeriesInstanceUID").is_some() => {
            let studies = files::dicom::studies(path, &Progress::new()).unwrap();
            let series: Vec<String> =
                studies.patients[0].studies[0].series.iter().map(|s| s.uid.clone()).collect();
            let loaded: Result<Vec<Loaded>, FileError> = series
                .into_iter()
                .map(|uid| {
                    let part = Part { path: path.to_owned(), series: Some(uid), which: Which::Frame(0) };
                    read_frame(&Source::Part(part), 0)
                })
                .collect();
            match_volumes(&loaded.unwrap(), case["volumes"].as_array().unwrap(), AFFINE_MM)
        }
        "volumes" => match all_frames(&source) {
            Ok(loaded) => match_volumes(&loaded, case["volumes"].as_array().unwrap(), AFFINE_MM),
            Err(error) => Some(error.to_string()),
        },
        "not-uniform" | "refuse" => match all_frames(&source) {
            Ok(loaded) => Some(format!("{} volumes of a series that should be refused", loaded.len())),
            Err(error) => {
                println!("{}: {error}", path.file_name().unwrap().display());
                (!one_line(&error)).then(|| error.to_string())
            }
        },
        other => Some(format!("an unknown expectation: {other}")),
    }
}

fn check_all(folder: &str, check: impl Fn(&Path, &str, &Value) -> Vec<Option<String>>) {
    let Some(data) = real_data(folder) else { return };
    let (mut right, mut wrong) = (0, Vec::new());
    for (name, case) in truth::cases(&data) {
        for outcome in check(&data, &name, &case) {
            match outcome {
                None => right += 1,
                Some(difference) => wrong.push(format!("{name}: {difference}")),
            }
        }
    }
    println!("{folder}: {right} right, {} wrong", wrong.len());
    assert!(wrong.is_empty(), "{folder}:\n{}", wrong.join("\n"));
    assert!(right > 0);
}

#[test]
fn series_are_ordered_spaced_and_scaled_by_their_positions() {
    check_all("dicom-series", |data, name, case| {
        let path = data.join(name);
        // The truth allows a refusal, which says what it is.
        if name == "modality-lut" {
            let error = read_frame(&whole(&path), 0).unwrap_err().to_string();
            return vec![(!error.contains("Modality LUT")).then_some(error)];
        }
        vec![series_case(&path, case)]
    });
}

#[test]
fn enhanced_images_are_placed_frame_by_frame() {
    check_all("dicom-enhanced", |data, name, case| vec![series_case(&data.join(name), case)]);
}

#[test]
fn suv_is_given_where_the_tags_allow_it_and_refused_with_a_reason_elsewhere() {
    check_all("dicom-pet", |data, name, case| {
        let loaded = read_frame(&whole(&data.join(name)), 0);
        let outcome = match (case["expect"].as_str().unwrap(), loaded) {
            ("refuse", Err(error)) => (!one_line(&error)).then(|| error.to_string()),
            ("refuse", Ok(_)) => Some("read".into()),
            (_, Err(error)) => Some(error.to_string()),
            ("suv", Ok(loaded)) => {
                let worst = truth::worst_sample(&loaded.volume, &case["suvbw"]);
                let said = loaded.checks.iter().any(|c| c.code == "pet-suv");
                (worst > 1e-4 || !said).then(|| format!("SUV off by {worst}, {:?}", loaded.checks))
            }
            (_, Ok(loaded)) => {
                let said = loaded.checks.iter().find(|c| c.code == "pet-no-suv");
                if let Some(check) = said {
                    println!("{name}: {}", check.message);
                }
                truth::difference(&loaded.volume, &case["stored_to_units"], AFFINE_MM)
                    .or(said.is_none().then(|| "no reason".into()))
            }
        };
        vec![outcome]
    });
}

/// The masks of a file beside its image.
fn masks_case(
    mask: &Path,
    image: &Path,
    truths: &serde_json::Map<String, Value>,
    by_name: bool,
) -> Vec<Option<String>> {
    let mut all = vec![mask.to_owned()];
    all.extend(files_of(image));
    let folder = linked(&all);
    let file = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().path())
        .find(|p| p.file_name().unwrap().to_string_lossy().starts_with("0000-"))
        .unwrap();
    let segments = match files::segments(&whole(&file), &Progress::new()) {
        Ok(segments) => segments,
        Err(error) => return vec![Some(error.to_string())],
    };
    // Trailing spaces are padding in DICOM: of two names that differ by one, the second is meant.
    let find = |key: &str| -> Option<&Segment> {
        let mut named = segments
            .iter()
            .filter(|s| if by_name { s.name == key.trim() } else { s.number.to_string() == key });
        if key.ends_with(' ') { named.next_back() } else { named.next() }
    };
    truths
        .iter()
        .map(|(key, truth)| {
            let expects_none = truth["expect"].as_str() == Some("no-mask");
            let Some(segment) = find(key) else {
                return (!expects_none).then(|| format!("{key}: not found"));
            };
            if expects_none {
                return Some(format!("{key}: a mask"));
            }
            let part = Part { path: file.clone(), series: None, which: Which::Segment(segment.number) };
            let loaded = match read_frame(&Source::Part(part), 0) {
                Ok(loaded) => loaded,
                Err(error) => return Some(format!("{key}: {error}")),
            };
            let warned = loaded.checks.iter().any(|c| c.severity == glioscope_core::Severity::Warning);
            if truth["expect"].as_str() == Some("warn") && !warned {
                return Some(format!("{key}: no warning"));
            }
            if truth.get("ras_dims").is_none() {
                let count = (0..loaded.volume.grid().voxel_count())
                    .filter(|&at| loaded.volume.value(at) > 0.0)
                    .count();
                let expected = truth["voxels"].as_u64();
                return expected
                    .filter(|&n| n != count as u64)
                    .map(|n| format!("{key}: {count} voxels, truth {n}"));
            }
            truth::difference(&loaded.volume, truth, AFFINE_MM).map(|d| format!("{key}: {d}"))
        })
        .collect()
}

/// Whether every segment of a file beside its image is refused in one line.
fn refused(mask: &Path, image: &Path) -> Option<String> {
    let mut all = vec![mask.to_owned()];
    all.extend(files_of(image));
    let folder = linked(&all);
    let file = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().path())
        .find(|p| p.file_name().unwrap().to_string_lossy().starts_with("0000-"))
        .unwrap();
    match read_frame(&whole(&file), 0) {
        Ok(_) => Some("read".into()),
        Err(error) => {
            println!("{}: {error}", mask.file_name().unwrap().display());
            (!one_line(&error)).then(|| error.to_string())
        }
    }
}

fn image_of(data: &Path, case: &Value) -> PathBuf {
    data.join("..").join(case["image"].as_str().unwrap_or("dicom-series/plain-axial"))
}

#[test]
fn segmentations_are_placed_by_their_own_functional_groups() {
    check_all("dicom-seg-highdicom", |data, name, case| {
        let (file, image) = (data.join(name), image_of(data, case));
        match case["expect"].as_str().unwrap() {
            // Files behind binary-other-patient.dcm bear its patient, too; alone they must be refused for their own fault.
            "refuse" if name.contains("other") || name == "binary-no-place.dcm" => {
                vec![refused(&file, &image)]
            }
            "refuse" => vec![refused(&file, Path::new("/nonexistent"))],
            _ => masks_case(&file, &image, case["segments"].as_object().unwrap(), false),
        }
    });
}

#[test]
fn contours_are_filled_by_pixel_centres() {
    check_all("dicom-rtstruct", |data, name, case| {
        let (file, image) = (data.join(name), image_of(data, case));
        match (case["expect"].as_str(), case.get("rois")) {
            (Some("refuse"), _) => vec![refused(&file, &image)],
            (_, Some(rois)) => masks_case(&file, &image, rois.as_object().unwrap(), true),
            _ => vec![Some("no truth".into())],
        }
    });
}

#[test]
fn a_patients_ct_mr_and_pet_have_the_masks_of_their_nifti() {
    check_all("dicom-multimodal", |data, name, case| {
        let folder = data.to_owned();
        let studies = files::dicom::studies(&folder, &Progress::new()).unwrap();
        let series = &studies.patients[0].studies[0].series;
        let image = series.iter().find(|s| s.folder.ends_with(name)).unwrap();
        let part =
            |which| Source::Part(Part { path: folder.clone(), series: Some(image.uid.clone()), which });
        let loaded = read_frame(&part(Which::Frame(0)), 0).unwrap();
        let mut outcomes = vec![truth::difference(&loaded.volume, &case["image"], 2e-5)];
        let contours =
            series.iter().find(|s| s.first_file.ends_with(format!("{name}-rtstruct.dcm"))).unwrap();
        for (roi, truth) in case["rois"].as_object().unwrap() {
            let number = contours.segments.iter().find(|s| s.name == *roi).unwrap().number;
            let source = Source::Part(Part {
                path: folder.clone(),
                series: Some(contours.uid.clone()),
                which: Which::Segment(number),
            });
            let loaded = read_frame(&source, 0).unwrap();
            outcomes.push(truth::difference(&loaded.volume, truth, 2e-5));
        }
        outcomes
    });
}

#[test]
fn a_ct_of_sixty_slices_and_its_contours_equal_the_nifti() {
    let Some(data) = real_data("dicom-ct-rtstruct") else { return };
    let text = std::fs::read_to_string(data.join("truth.json")).unwrap();
    let truth: Value = serde_json::from_str(&text).unwrap();
    let studies = files::dicom::studies(&data, &Progress::new()).unwrap();
    for series in studies.patients.iter().flat_map(|p| &p.studies).flat_map(|s| &s.series) {
        let which = match series.kind {
            files::dicom::Kind::Image => Which::Frame(0),
            _ => Which::Segment(series.segments[0].number),
        };
        let source = Source::Part(Part { path: data.clone(), series: Some(series.uid.clone()), which });
        let loaded = read_frame(&source, 0).unwrap();
        let truth = if which == Which::Frame(0) { &truth["image"] } else { &truth["rois"]["GTV-1"] };
        assert_eq!(truth::difference(&loaded.volume, truth, 2e-5), None, "{}", series.modality);
    }
}

#[test]
fn hostile_files_are_refused_in_one_line() {
    check_all("dicom-malformed", |data, name, case| {
        let path = data.join(name);
        let started = std::time::Instant::now();
        // Contours need their image.
        let image = data.join("../dicom-series/plain-axial");
        let beside = name.starts_with("rtstruct").then(|| {
            let mut all = vec![path.clone()];
            all.extend(files_of(&image));
            linked(&all)
        });
        let path = beside.as_ref().map_or(path, |folder| folder.path().join(format!("0000-{name}")));
        let outcome = if path.is_dir() {
            files::dicom::studies(&path, &Progress::new()).map(|_| ())
        } else {
            let source = whole(&path);
            read_frame(&source, 0).map(|_| ())
        };
        let seconds = started.elapsed().as_secs_f64();
        let result = match (case["expect"].as_str().unwrap(), outcome) {
            _ if seconds > 5.0 => Some(format!("{seconds} s")),
            ("load" | "warn" | "no-crash", Ok(())) | ("no-crash", Err(_)) => None,
            ("load" | "warn", Err(error)) => Some(error.to_string()),
            ("refuse", Err(error)) => (!one_line(&error)).then(|| error.to_string()),
            ("refuse", Ok(())) => Some("read".into()),
            (other, _) => Some(other.to_owned()),
        };
        vec![result]
    });
}

/// The stored numbers of a file, row by row.
fn stored(path: &Path) -> Result<Vec<i32>, FileError> {
    let loaded = read_frame(&whole(path), 0)?;
    let scaling = loaded.volume.scaling();
    let stored = |at: usize| ((loaded.volume.value(at) - scaling.intercept) / scaling.slope).round() as i32;
    Ok((0..loaded.volume.grid().voxel_count()).map(stored).collect())
}

#[test]
fn every_transfer_syntax_gives_the_same_pixels() {
    let Some(data) = real_data("dicom-encodings") else { return };
    let (mut right, mut wrong) = (Vec::new(), Vec::new());
    for (name, case) in truth::cases(&data) {
        let Some(list) = case.get("files").and_then(Value::as_object) else { continue };
        let original = stored(&data.join(format!("{name}-explicit-le.dcm"))).unwrap();
        for (file, what) in list {
            let what = what.as_str().unwrap();
            let outcome = match stored(&data.join(file)) {
                // Twelve bits of baseline JPEG: the crate knows eight.
                Err(error) if file == "u12-jpeg-extended-12bit.dcm" => {
                    (!one_line(&error)).then(|| error.to_string())
                }
                Err(error) => Some(error.to_string()),
                Ok(pixels) => match what.split_once("largest error ") {
                    None => {
                        let hash = truth::sha256(pixels.iter().flat_map(|v| v.to_le_bytes()).collect());
                        (hash != case["stored_i32le_sha256"].as_str().unwrap())
                            .then(|| "other pixels".to_owned())
                    }
                    Some((_, most)) => {
                        let most: i32 = most.trim_end_matches(')').parse().unwrap();
                        let worst = pixels.iter().zip(&original).map(|(a, b)| (a - b).abs()).max().unwrap();
                        // Decoders may differ by rounding.
                        (worst > most + 1).then(|| format!("off by {worst}, truth {most}"))
                    }
                },
            };
            match outcome {
                None => right.push(file.clone()),
                Some(difference) => wrong.push(format!("{file}: {difference}")),
            }
        }
    }
    println!("{} right", right.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(right.len() > 35, "{right:?}");
}

#[test]
fn names_are_read_in_their_character_sets() {
    let Some(data) = real_data("dicom-encodings") else { return };
    let (_, cases) = truth::cases(&data).into_iter().find(|(name, _)| name == "charset").unwrap();
    let mut wrong = Vec::new();
    for (file, case) in cases.as_object().unwrap() {
        let path = files_below(&data).into_iter().find(|p| p.ends_with(file)).unwrap();
        let folder = linked(&[path]);
        let studies = files::dicom::studies(folder.path(), &Progress::new()).unwrap();
        let name = studies.patients.first().map(|p| p.patient.name.clone()).unwrap_or_default();
        let expected = case["PatientName"].as_str().unwrap();
        if name != expected && expected != "None" {
            wrong.push(format!("{file}: {name}, truth {expected} {:?}", studies.unreadable));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn segmentations_of_dcmqi_have_its_counts() {
    check_all("dicom-seg", |data, name, case| {
        let path = data.join(name);
        let segments = files::segments(&whole(&path), &Progress::new()).unwrap();
        let truths = case["segments"].as_object().unwrap();
        truths
            .iter()
            .map(|(number, truth)| {
                let segment = segments.iter().find(|s| s.number.to_string() == *number);
                let Some(segment) = segment else { return Some(format!("{number}: not found")) };
                let which = Which::Segment(segment.number);
                let loaded = read_frame(&Source::Part(Part { path: path.clone(), series: None, which }), 0);
                let volume = match loaded {
                    Ok(loaded) => loaded.volume,
                    Err(error) => return Some(error.to_string()),
                };
                let count = (0..volume.grid().voxel_count()).filter(|&at| volume.value(at) > 0.5).count();
                let is_right = truth["voxels"] == count && truth["label"] == segment.name.as_str();
                (!is_right).then(|| format!("{number}: {count} voxels, {}, truth {truth}", segment.name))
            })
            .collect()
    });
}

#[test]
fn files_of_other_makers_give_their_pixels() {
    let Some(data) = real_data("dicom-encodings") else { return };
    let (_, cases) = truth::cases(&data).into_iter().find(|(name, _)| name == "pydicom").unwrap();
    let (mut right, mut refused) = (0, Vec::new());
    for (file, case) in cases.as_object().unwrap() {
        let Some(hash) = case["stored_i32le_sha256"].as_str() else { continue };
        match stored(&data.join("pydicom").join(file)) {
            Ok(pixels) => {
                // Lossy JPEG may be rounded otherwise.
                let lossy = case["transfer_syntax"] == "1.2.840.10008.1.2.4.91";
                let found = truth::sha256(pixels.iter().flat_map(|v| v.to_le_bytes()).collect());
                let (sum, low) = (pixels.iter().map(|&v| i64::from(v)).sum::<i64>(), pixels.iter().min());
                assert!(found == hash || lossy, "{file}: sum {sum}, lowest {low:?}, truth {case}");
                right += 1;
            }
            Err(error) => {
                assert!(one_line(&error), "{error}");
                refused.push(format!("{file}: {error}"));
            }
        }
    }
    // Images without a place in the patient, twelve-bit JPEG, a dose grid.
    println!("{right} right, refused:\n{}", refused.join("\n"));
    assert!(right >= 8 && refused.len() <= 6, "{right} {refused:?}");
}

/// Damaged bytes of small real files are refused or read, and never end the program.
#[test]
fn damaged_files_never_panic() {
    let mut seeds: Vec<PathBuf> = Vec::new();
    for (folder, name) in [
        ("dicom-malformed", "good.dcm"),
        ("dicom-encodings", "s16-rle.dcm"),
        ("dicom-encodings", "u8-deflated.dcm"),
        ("dicom-seg-highdicom", "binary-overlapping.dcm"),
        ("dicom-seg-highdicom", "labelmap-8bit-deflated-frames.dcm"),
        ("dicom-enhanced", "mr-two-times-shuffled.dcm"),
        ("dicom-rtstruct", "no-image-references.dcm"),
    ] {
        let Some(data) = real_data(folder) else { return };
        seeds.push(data.join(name));
    }
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for seed in seeds {
        let bytes = std::fs::read(&seed).unwrap();
        files::dicom::inspect(&bytes, 1 << 24).unwrap();
        let mut read = 0;
        for _ in 0..1500 {
            let mut damaged = bytes.clone();
            // Headers lie at the start.
            let region = if random(4) == 0 { damaged.len() } else { damaged.len().min(3000) };
            for _ in 0..=random(4) {
                let at = random(region);
                damaged[at] = if random(2) == 0 { random(256) as u8 } else { damaged[at] ^ 1 << random(8) };
            }
            if random(5) == 0 {
                damaged.truncate(random(damaged.len()));
            }
            match files::dicom::inspect(&damaged, 1 << 24) {
                Ok(_) => read += 1,
                Err(error) => assert!(one_line(&error), "{error}"),
            }
        }
        println!("{}: {read} of 1500 read", seed.display());
    }
}
