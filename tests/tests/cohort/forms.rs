//! Every form of input from its files to the tables: BIDS, raw and derived; folders of BraTS; DICOM studies; a table of manifests.
//! Numbers are those of how the files were made, and answers those of the plain command on each case.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glioscope_tests::{real_data, run, write_cube};

use crate::{PROGRAM, glioscope_cohort, made, status, tables, tree};

const SIDE: usize = 20;
/// Side of a mask's box in voxels of 1 mm.
const BOX: usize = 8;

/// Whether a voxel is in a box of `length` along x, moved by `moved`.
fn in_box([i, j, k]: [usize; 3], moved: usize, length: usize) -> bool {
    (2 + moved..2 + moved + length).contains(&i) && (5..5 + BOX).contains(&j) && (5..5 + BOX).contains(&k)
}

fn mask(folder: &Path, file: &str, moved: usize, length: usize) {
    let path = folder.join(file);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_cube(&path, SIDE, 1.0, |at| u8::from(in_box(at, moved, length)));
}

/// An image whose values are none of labels.
fn image(folder: &Path, file: &str) {
    let path = folder.join(file);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_cube(&path, SIDE, 1.0, |[i, j, k]| (i * 11 + j * 3 + k) as u8);
}

fn text(folder: &Path, file: &str, text: &str) {
    std::fs::write(folder.join(file), text).unwrap();
}

/// Computes and groups; the results of each of `cases` are the plain command's on its path.
fn computed(input: &Path, out: &Path, more: &[&str], cases: &[(&str, &Path, &[&str])]) {
    let (code, _, stderr) =
        glioscope_cohort(input, out, &[&["participant", "--compute", "metrics"], more].concat());
    assert_eq!(code, 0, "{stderr}");
    for (label, path, arguments) in cases {
        let plain =
            run(PROGRAM, &[&["measure", path.to_str().unwrap(), "--metrics", "--json"], *arguments].concat());
        let answer = std::fs::read(out.join("cases").join(label).join("measure.json")).unwrap();
        assert!(answer == plain.stdout, "{label}: {}", String::from_utf8_lossy(&plain.stderr));
    }
    let (code, _, stderr) = glioscope_cohort(input, out, &["group"]);
    assert_eq!((code, stderr.as_str()), (0, ""));
}

/// Voxels of every mask, by case, date and id.
fn voxels(out: &Path) -> BTreeMap<[String; 3], usize> {
    let of = |row: &BTreeMap<String, String>| {
        (["case", "time", "mask"].map(|key| row[key].clone()), row["voxels"].parse().unwrap())
    };
    tables::read(out, "masks").iter().map(of).collect()
}

/// A raw data set of two subjects with two sessions, and in `derivatives/` two raters' masks of them.
fn bids(folder: &Path) -> PathBuf {
    let root = folder.join("bids");
    for (n, subject) in ["01", "02"].into_iter().enumerate() {
        for (session, length) in [("1", BOX), ("2", BOX + 2)] {
            let place = format!("sub-{subject}/ses-{session}/anat");
            let file = format!("{place}/sub-{subject}_ses-{session}");
            image(&root, &format!("{file}_T1w.nii.gz"));
            let (first, second) = (root.join("derivatives/first"), root.join("derivatives/second"));
            mask(&first, &format!("{file}_desc-tumor_mask.nii.gz"), 0, length);
            mask(&second, &format!("{file}_desc-tumor_mask.nii.gz"), 1 + n, length - 1);
            // What isn't of the scan's space, or no mask, belongs to no case here.
            mask(&first, &format!("{file}_space-MNI152NLin2009cAsym_desc-brain_mask.nii.gz"), 0, 3);
            image(&first, &format!("{file}_desc-preproc_T1w.nii.gz"));
        }
        text(
            &root.join(format!("sub-{subject}")),
            &format!("sub-{subject}_sessions.tsv"),
            "session_id\tacq_time\nses-2\t2024-03-01T10:00:00\nses-1\t2024-01-01T10:00:00\n",
        );
    }
    let description = "{\"Name\": \"made\", \"BIDSVersion\": \"1.10.0\"}";
    for place in ["", "derivatives/first", "derivatives/second"] {
        text(&root.join(place), "dataset_description.json", description);
    }
    root
}

#[test]
fn masks_of_derived_data_sets_have_the_images_of_the_raw_one() {
    let folder = tempfile::tempdir().unwrap();
    let root = bids(folder.path());
    let before = tree(&root);
    let [raw, derived, both] = ["raw", "derived", "both"].map(|name| folder.path().join(name));
    let subject = root.join("sub-01");
    let first: &[&str] = &["--derivatives", "first"];
    computed(&root, &raw, first, &[("sub-01", &subject, first), ("sub-02", &root.join("sub-02"), first)]);
    let expected: Vec<_> =
        [("sub-01", "1", BOX), ("sub-01", "2", BOX + 2), ("sub-02", "1", BOX), ("sub-02", "2", BOX + 2)]
            .into_iter()
            .map(|(case, time, length)| ([case, time, "tumor"].map(str::to_owned), length * BOX * BOX))
            .collect();
    assert_eq!(voxels(&raw).into_iter().collect::<Vec<_>>(), expected);
    // The anatomy of the same subject and session.
    let described = |path: &Path, more: &[&str]| {
        let output = run(PROGRAM, &[&["info", path.to_str().unwrap(), "--json"], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let derived_subject = root.join("derivatives/first/sub-01");
    let raw_image = root.join("sub-01/ses-1/anat/sub-01_ses-1_T1w.nii.gz");
    assert!(
        !described(&derived_subject, &[]).contains(raw_image.to_str().unwrap()),
        "it has an image of its own"
    );
    // Left to itself the derived data set has images and masks of other spaces, which are its own.
    for (place, _) in tree(&root.join("derivatives/first")) {
        let name = place.file_name().unwrap().to_string_lossy().into_owned();
        if name.contains("preproc") || name.contains("MNI152") {
            std::fs::remove_file(place).unwrap();
        }
    }
    for (path, more) in [(&subject, first), (&derived_subject, &[])] {
        let text = described(path, more);
        for session in ["1", "2"] {
            let image = format!("sub-01/ses-{session}/anat/sub-01_ses-{session}_T1w.nii.gz");
            assert!(text.contains(root.join(&image).to_str().unwrap()), "{image}: {text}");
        }
        assert!(!text.contains("MNI152"), "{text}");
    }
    // Two raters: ids say whose a mask is.
    let two: &[&str] = &["--derivatives", "first", "--derivatives", "second"];
    computed(&root, &both, &[two, &["--reference", "second-tumor"]].concat(), &[]);
    let inputs = status(&both, "sub-02")["inputs"].to_string();
    for input in ["sub-02/ses-2/anat/sub-02_ses-2_T1w.nii.gz", "derivatives/second/sub-02/ses-1/anat"] {
        assert!(inputs.contains(input), "{input}: {inputs}");
    }
    for row in tables::read(&both, "pairs") {
        assert_eq!([row["a"].as_str(), &row["b"]], ["second-tumor", "first-tumor"], "the reference is first");
        let n: usize = if row["case"] == "sub-01" { 0 } else { 1 };
        let length = if row["time"] == "1" { BOX } else { BOX + 2 };
        // The reference begins 1 + n later and is one shorter: n of it lie past the other's end.
        let common = (length - 1 - n) as f64;
        let value: f64 = match row["metric"].as_str() {
            "dice" => 2.0 * common / (2 * length - 1) as f64,
            "sensitivity" => common / (length - 1) as f64,
            "precision" => common / length as f64,
            _ => continue,
        };
        assert!((row["value"].parse::<f64>().unwrap() - value).abs() < 1e-12, "{row:?}: {value}");
    }
    let ranked = ["group", "--reference", "second-tumor", "--rank-by", "sensitivity,dice"];
    assert_eq!(glioscope_cohort(&root, &both, &ranked).0, 0);
    let (code, _, stderr) =
        glioscope_cohort(&root, &both, &["group", "--reference", "first-tumor", "--rank-by", "precision"]);
    assert!(
        code == 2 && stderr.contains("participant --compute metrics --reference first-tumor"),
        "{stderr}"
    );
    // A derived mask that changes is another input, of its case alone.
    mask(&root, "derivatives/first/sub-02/ses-1/anat/sub-02_ses-1_desc-tumor_mask.nii.gz", 0, BOX - 1);
    let (_, stdout, _) =
        glioscope_cohort(&root, &raw, &["participant", "--compute", "metrics", "--derivatives", "first"]);
    assert_eq!(stdout, "1 computed, 1 were there, 0 failed\n");
    // Which of several is meant isn't guessed.
    let (code, _, stderr) = glioscope_cohort(&root, &folder.path().join("none"), &["participant"]);
    assert!(
        code == 1
            && stderr.contains("sub-01: failed: measure: found no mask")
            && stderr.contains("--derivatives NAME"),
        "{stderr}"
    );
    let (code, _, stderr) =
        glioscope_cohort(&root, &folder.path().join("none"), &["participant", "--derivatives", "third"]);
    assert!(code == 2 && stderr.contains("derivatives/third") && stderr.lines().count() == 1, "{stderr}");
    // One alone is taken, and the derived data set itself as the input gives the same tables.
    std::fs::rename(root.join("derivatives/second"), folder.path().join("second")).unwrap();
    let alone = folder.path().join("alone");
    computed(&root, &alone, &[], &[("sub-01", &subject, &[])]);
    computed(&root.join("derivatives/first"), &derived, &[], &[]);
    assert!(tree_of_tables(&alone) == tree_of_tables(&derived));
    let left: Vec<_> = tree(&root).into_keys().filter(|path| !before.contains_key(path)).collect();
    assert!(left.is_empty(), "the input was written: {left:?}");
}

fn tree_of_tables(out: &Path) -> Vec<Vec<u8>> {
    tree(&out.join("tables")).into_values().collect()
}

#[test]
fn folders_of_brats_are_cases_with_their_labels() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("brats");
    // Labels by the place along x: their voxels are layers of the box. The enhancing tumour was 4 and is 3.
    let cases = [
        ("BraTS-GLI-00005-100", "-", ["t1n", "t1c", "t2w", "t2f"], 3),
        ("BraTS2021_00002", "_", ["t1", "t1ce", "t2", "flair"], 4),
    ];
    for (label, joint, images, enhancing) in cases {
        let file = |what: &str| format!("{label}/{label}{joint}{what}.nii.gz");
        images.iter().for_each(|what| image(&input, &file(what)));
        let value = |at: [usize; 3]| match at[0] {
            _ if !in_box(at, 0, BOX) => 0,
            2 => enhancing,
            3 | 4 => 1,
            _ => 2,
        };
        write_cube(&input.join(file("seg")), SIDE, 1.0, value);
    }
    let out = folder.path().join("out");
    let paths = cases.map(|(label, ..)| input.join(label));
    computed(&input, &out, &[], &[(cases[0].0, &paths[0], &[]), (cases[1].0, &paths[1], &[])]);
    let found = voxels(&out);
    for (label, _, _, enhancing) in cases {
        for (tissue, layers) in [(1, 2), (2, BOX - 3), (enhancing, 1)] {
            let key = [label, "", &format!("seg-{tissue}")].map(str::to_owned);
            assert_eq!(found.get(&key), Some(&(layers * BOX * BOX)), "{key:?} of {found:?}");
        }
    }
    assert_eq!(found.len(), 6);
}

#[test]
fn a_table_names_manifests_wherever_they_lie() {
    let folder = tempfile::tempdir().unwrap();
    made::case(&folder.path().join("here/a"), 1);
    made::case(&folder.path().join("elsewhere/b"), 2);
    std::fs::create_dir(folder.path().join("lists")).unwrap();
    let table = folder.path().join("lists/cohort.tsv");
    text(
        folder.path(),
        "lists/cohort.tsv",
        "participant_id\tage\tpath\nsecond\t40\t../elsewhere/b/case.toml\nfirst\tn/a\t../here/a/case.toml\n",
    );
    let out = folder.path().join("out");
    let paths = ["here/a", "elsewhere/b"].map(|place| folder.path().join(place).join("case.toml"));
    computed(&table, &out, &[], &[("first", &paths[0], &[]), ("second", &paths[1], &[])]);
    let dice: Vec<(String, f64)> = tables::read(&out, "pairs")
        .iter()
        .filter(|row| row["metric"] == "dice" && row["b"] == "a" && row["time"] == made::DATES[0].0)
        .map(|row| (row["case"].clone(), row["value"].parse().unwrap()))
        .collect();
    // Mask a of case n is moved by n % 3.
    let expected =
        [("first", 1), ("second", 2)].map(|(case, n)| (case.to_owned(), made::dice_of(n, made::BOX)));
    assert_eq!(dice, expected);
}

/// Images of pydicom with segmentations of highdicom, whose voxels stand beside them.
#[test]
fn dicom_studies_are_cases_with_their_segmentations() {
    let (Some(series), Some(segmentations)) = (real_data("dicom-series"), real_data("dicom-seg-highdicom"))
    else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("studies");
    let cases = [("one", "binary-3-segments.dcm"), ("two", "labelmap-8bit.dcm")];
    for (label, file) in cases {
        let (images, masks) = (input.join(label).join("MR"), input.join(label).join("SEG"));
        std::fs::create_dir_all(&images).unwrap();
        std::fs::create_dir_all(&masks).unwrap();
        for slice in std::fs::read_dir(series.join("plain-axial")).unwrap() {
            let slice = slice.unwrap();
            std::fs::copy(slice.path(), images.join(slice.file_name())).unwrap();
        }
        std::fs::copy(segmentations.join(file), masks.join(file)).unwrap();
    }
    let out = folder.path().join("out");
    let paths = cases.map(|(label, _)| input.join(label));
    computed(&input, &out, &[], &[("one", &paths[0], &[]), ("two", &paths[1], &[])]);
    let truth = std::fs::read(segmentations.join("truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_slice(&truth).unwrap();
    let found = voxels(&out);
    for (label, file) in cases {
        let segments = truth["cases"][file]["segments"].as_object().unwrap();
        let mut expected: Vec<usize> =
            segments.values().map(|segment| segment["counts"]["1"].as_u64().unwrap() as usize).collect();
        let of_case = found.iter().filter(|([case, ..], _)| case == label);
        let mut counts: Vec<usize> = of_case.map(|(_, count)| *count).collect();
        expected.sort_unstable();
        counts.sort_unstable();
        assert!(counts == expected && counts.len() == 3, "{label}: {counts:?}, expected {expected:?}");
    }
}

/// Each part of the tumour is ranked by the reference's own part, lesion by lesion.
#[test]
fn parts_of_a_reference_are_ranked_among_the_masks_of_that_part() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in");
    // How far each mask is moved along x: `net` wins the core, `far` the whole tumour.
    let masks = [("far-TC", 3), ("far-WT", 1), ("net-TC", 1), ("net-WT", 2), ("ref-TC", 0), ("ref-WT", 0)];
    for case in ["a", "b"] {
        let place = input.join(case);
        let entry = |(id, moved): (&str, usize)| {
            mask(&place, &format!("{id}.nii"), moved, BOX);
            format!("[[mask]]\nid = \"{id}\"\nfile = \"{id}.nii\"\n")
        };
        let manifest: String =
            std::iter::once("glioscope = 1\n".to_owned()).chain(masks.map(entry)).collect();
        text(&place, "case.toml", &manifest);
    }
    let out = folder.path().join("out");
    let references = ["--reference", "ref-WT", "--reference", "ref-TC"];
    let brats = ["participant", "--compute", "metrics", "--convention", "brats"];
    let (code, _, stderr) = glioscope_cohort(&input, &out, &[&brats[..], &references].concat());
    assert_eq!(code, 0, "{stderr}");
    let by = ["group", "--rank-by", "lesions_dice,lesions_hd_percentile_mm"];
    let (code, _, stderr) = glioscope_cohort(&input, &out, &[&by[..], &references].concat());
    assert_eq!(code, 0, "{stderr}");
    let ranks: BTreeMap<[String; 3], String> = tables::read(&out, "ranks")
        .iter()
        .map(|row| (["reference", "metric", "mask"].map(|key| row[key].clone()), row["mean_rank"].clone()))
        .collect();
    let mut expected = BTreeMap::new();
    for metric in ["lesions_dice", "lesions_hd_percentile_mm"] {
        for (reference, mask, rank) in [
            ("ref-WT", "far-WT", "1"),
            ("ref-WT", "net-WT", "2"),
            ("ref-TC", "net-TC", "1"),
            ("ref-TC", "far-TC", "2"),
        ] {
            expected.insert([reference, metric, mask].map(str::to_owned), rank.to_owned());
        }
    }
    for mask in ["far", "net"] {
        expected.insert(["ref", "all", mask].map(str::to_owned), "1.5".to_owned());
    }
    assert_eq!(ranks, expected);
    assert_eq!(tables::read(&out, "tests").len(), 4);
    // A box of 8 moved by 2: 6 layers in common.
    let pairs = tables::read(&out, "pairs");
    let of = |a: &str, b: &str, metric: &str| {
        let row = pairs.iter().find(|row| row["a"] == a && row["b"] == b && row["metric"] == metric);
        row.map(|row| row["value"].parse::<f64>().unwrap())
    };
    assert_eq!(of("ref-WT", "net-WT", "lesions_dice"), Some(0.75));
    assert_eq!(of("net-WT", "ref-WT", "lesions_dice"), None);
}
