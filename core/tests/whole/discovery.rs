//! What a folder, a file or some files are taken for: by names, contents and manifests.

use std::path::{Path, PathBuf};

use glam::DVec3;
use glioscope_core::{
    Grid, Progress, Samples, Scaling, Volume,
    case::{
        CaseSpec, Description, LoadOptions, Proposal, Role, describe, describe_files, has_manifest, is_study,
        open_spec,
    },
    files::{WriteOptions, write_nifti, write_whole},
};

/// An image of 4³ voxels whose stored numbers are `value` of their position.
fn put(folder: &Path, name: &str, value: impl Fn(usize) -> f32) {
    let grid = Grid::axis_aligned([4; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let volume = Volume::new(grid, Samples::F32((0..64).map(value).collect()), Scaling::NONE).unwrap();
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_nifti(&path, &volume, &WriteOptions::default()).unwrap();
}

/// As [`put`], a mask of one label.
fn put_mask(folder: &Path, name: &str) {
    put(folder, name, |at| if at < 9 { 1.0 } else { 0.0 });
}

fn text(folder: &Path, name: &str, text: &str) {
    std::fs::create_dir_all(folder.join(name).parent().unwrap()).unwrap();
    write_whole(&folder.join(name), text.as_bytes()).unwrap();
}

fn temp() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().canonicalize().unwrap();
    (folder, path)
}

/// A raw data set and one derived of it: each is read with the other, subject and session alike; what is of another scan or space
/// isn't.
#[test]
fn raw_images_and_derived_masks_of_bids_are_one_case() {
    let (_folder, root) = temp();
    let derived = root.join("derivatives/nnunet");
    for session in ["a", "b"] {
        let place = format!("sub-01/ses-{session}/anat/sub-01_ses-{session}");
        put(&root, &format!("{place}_T1w.nii"), |at| at as f32);
        put_mask(&derived, &format!("{place}_label-core_mask.nii"));
        put_mask(&derived, &format!("{place}_space-MNI152NLin6Asym_label-core_mask.nii"));
    }
    put_mask(&derived, "sub-01/ses-a/func/sub-01_ses-a_task-rest_desc-brain_mask.nii");
    put(&derived, "sub-01/ses-a/anat/sub-01_ses-a_desc-preproc_T1w.nii", |at| at as f32);
    put(&root, "sub-01/ses-b/func/sub-01_ses-b_task-rest_sbref.nii", |at| at as f32 + 0.5);
    put_mask(&derived, "sub-02/ses-a/anat/sub-02_ses-a_label-core_mask.nii");
    let seen = |path: &Path, derivatives: &[&str]| {
        let derivatives = derivatives.iter().map(PathBuf::from).collect();
        let options = LoadOptions { derivatives, ..LoadOptions::default() };
        let spec = open_spec(path, &options, &Progress::new())?;
        let label = |time: &Option<String>| time.clone().unwrap_or_default();
        let masks = spec.masks.iter().map(|mask| format!("{} {}", mask.id, label(&mask.time)));
        let images = spec.contexts.iter().map(|image| {
            let data_set = if image.source.path().unwrap().starts_with(&derived) { "derived" } else { "raw" };
            format!("{} {} {data_set}", image.id, label(&image.time))
        });
        Ok::<_, glioscope_core::case::CaseError>(images.chain(masks).collect::<Vec<_>>().join(", "))
    };
    let raw = root.join("sub-01");
    let both = "T1w a raw, T1w b raw, sbref b raw, core a, core b";
    assert_eq!(seen(&raw, &[]).unwrap().replace("rest_", ""), both);
    assert_eq!(seen(&raw, &["none"]).unwrap().replace("rest_", ""), "T1w a raw, T1w b raw, sbref b raw");
    // One session of it.
    assert_eq!(seen(&raw.join("ses-a"), &[]).unwrap(), "T1w  raw, core ");
    // The derived one has an image of session a.
    let own = seen(&derived.join("sub-01"), &[]).unwrap();
    assert!(own.starts_with("preproc_T1w a derived, T1w b raw, ") && !own.contains("sbref"), "{own}");
    // No raw data of this subject.
    assert_eq!(seen(&derived.join("sub-02"), &[]).unwrap(), "core ");
    // Two derived data sets: neither, unless they are named; their names tell the masks apart.
    put_mask(&root, "derivatives/rater/sub-01/ses-a/anat/sub-01_ses-a_label-core_mask.nii");
    assert_eq!(seen(&raw.join("ses-a"), &[]).unwrap(), "T1w  raw");
    let path = root.join("derivatives/rater");
    for two in [["rater", "nnunet"], [path.to_str().unwrap(), "nnunet"]] {
        assert_eq!(seen(&raw.join("ses-a"), &two).unwrap(), "T1w  raw, rater-core , nnunet-core ");
    }
    // Masks of its own are its masks.
    put_mask(&root, "sub-03/anat/sub-03_label-core_mask.nii");
    put_mask(&derived, "sub-03/anat/sub-03_desc-brain_mask.nii");
    assert_eq!(seen(&root.join("sub-03"), &[]).unwrap(), "core ");
    assert_eq!(seen(&root.join("sub-03"), &["nnunet"]).unwrap(), "core , brain ");
    for (path, name, expected) in
        [(&raw, "other", "no folder"), (&root, "rater", "the folder of a subject of BIDS")]
    {
        let error = seen(path, &[name]).unwrap_err().to_string();
        assert!(error.starts_with("--derivatives: found") && error.contains(expected), "{error}");
    }
}

fn proposed(path: &Path) -> Proposal {
    match describe(path, &LoadOptions::default(), &Progress::new()).unwrap() {
        Description::Proposed(proposal) => proposal,
        Description::Stated(spec) => panic!("{spec:?}"),
    }
}

fn error(path: &Path) -> String {
    CaseSpec::from_path(path).unwrap_err().to_string()
}

/// Role and id of each file; of a mask the ids of its masks.
fn found(proposal: &Proposal) -> Vec<(Role, String)> {
    let id = |file: &glioscope_core::case::ProposedFile| match file.role {
        Role::Mask => file.masks.iter().map(|mask| mask.id.as_str()).collect::<Vec<_>>().join(" "),
        _ => file.id.clone(),
    };
    proposal.files.iter().map(|file| (file.role, id(file))).collect()
}

/// Messages of the notes with this code.
fn notes(proposal: &Proposal, code: &str) -> Vec<String> {
    proposal.notes.iter().filter(|note| note.code == code).map(|note| note.message.clone()).collect()
}

#[test]
fn one_file_is_a_case_of_its_own() {
    let (_keep, folder) = temp();
    put(&folder, "t1.nii", |at| at as f32);
    put_mask(&folder, "other.nii");
    text(&folder, "notes.txt", "none");
    assert_eq!(found(&proposed(&folder.join("t1.nii"))), [(Role::Image, "t1".into())]);
    let other = error(&folder.join("notes.txt"));
    assert!(other.contains("found a file of another kind") && other.contains("NIfTI"), "{other}");
    assert!(error(&folder.join("absent.nii")).contains("absent.nii"));
}

#[test]
fn files_that_are_opened_together_lie_below_a_common_folder_and_tracts_are_read() {
    let (_keep, folder) = temp();
    put(&folder, "images/a/t1.nii", |at| at as f32);
    put_mask(&folder, "masks/b/seg.nii");
    text(&folder, "masks/b/cst.tck", "mrtrix tracks");
    let all = ["images/a/t1.nii", "masks/b/seg.nii", "masks/b/cst.tck"].map(|name| folder.join(name));
    let of = |paths: &[PathBuf]| describe_files(paths, &LoadOptions::default(), &Progress::new()).unwrap();
    let proposal = of(&all);
    assert_eq!(proposal.folder, folder);
    let expected = [(Role::Image, "t1".into()), (Role::Mask, "seg".into()), (Role::Tracts, "cst".into())];
    assert_eq!(found(&proposal), expected);
    assert_eq!(of(&all[1..]).folder, folder.join("masks/b"));
    // In a folder, tracts are read where the user says so.
    let whole = proposed(&folder);
    assert_eq!(found(&whole)[2], (Role::LeftOut, "cst".into()));
    assert_ne!(whole.key, proposal.key);
}

#[test]
fn kinds_that_names_do_not_state_are_found_by_content() {
    let (_keep, folder) = temp();
    put(&folder, "labels-of-two.nii", |at| (at % 3) as f32);
    put(&folder, "x.nii", |at| (at % 2) as f32);
    put(&folder, "y.nii", |at| at as f32 + 0.5);
    put(&folder, "zeros.nii", |_| 0.0);
    put(&folder, "ones.nii", |_| 1.0);
    put(&folder, "t1.nii", |at| (at % 2) as f32);
    let all = proposed(&folder);
    let role = |id: &str| found(&all).into_iter().find(|(_, found)| found == id).map(|(role, _)| role);
    let (mask, image) = (Some(Role::Mask), Some(Role::Image));
    assert_eq!(["of-two", "x", "zeros"].map(role), [mask; 3], "{:?}", found(&all));
    // One value that isn't 0 is no label map's; a name goes before content.
    assert_eq!(["y", "ones", "t1"].map(role), [image; 3]);
    let kinds = notes(&all, "guessed-kinds");
    assert_eq!(
        kinds,
        [
            "images: guessed from names: t1",
            "images: guessed from contents (values of an image, not of labels): ones, y",
            "masks: guessed from names: of-two",
            "masks: guessed from contents (few values, all whole numbers): x, zeros",
        ]
    );
    assert!(notes(&all, "guessed-labels")[0].contains("above 0.5"));
}

#[test]
fn each_label_of_the_only_map_of_a_date_is_a_mask() {
    let (_keep, folder) = temp();
    put(&folder, "2024-01-01/seg.nii", |at| (at % 3) as f32);
    put(&folder, "2024-02-02/seg.nii", |at| if at < 9 { 4.0 } else { 0.0 });
    let all = proposed(&folder);
    assert_eq!(
        found(&all),
        [(Role::Mask, "seg-1 seg-2 seg-4".into()), (Role::Mask, "seg-1 seg-2 seg-4".into())]
    );
    assert_eq!((&all.files[0].labels, &all.files[1].labels), (&vec![1, 2], &vec![4]));
    assert!(notes(&all, "guessed-labels")[0].contains("1, 2, 4; what they mean is unknown"));
    assert_eq!(notes(&all, "guessed-times"), ["times: guessed from names: 2024-01-01, 2024-02-02"]);
    // A second mask of a date: readers are compared, whole.
    put_mask(&folder, "2024-02-02/roi.nii");
    assert_eq!(found(&proposed(&folder))[0], (Role::Mask, "seg".into()));
    // A map of one label is a mask.
    let (_keep, folder) = temp();
    put_mask(&folder, "BraTS20_Training_001_seg.nii");
    assert_eq!(proposed(&folder).files[0].masks.len(), 1);
    put(&folder, "BraTS20_Training_001_seg.nii", |at| [0.0, 1.0, 4.0][at % 3]);
    let named = notes(&proposed(&folder), "guessed-labels");
    assert!(named[0].ends_with("1, 4; named as in BraTS 2017 to 2020"), "{named:?}");
}

#[test]
fn as_many_labels_as_an_index_has_bits_are_masks_and_no_more() {
    for (labels, masks) in [(32, 32), (33, 1)] {
        let (_keep, folder) = temp();
        put(&folder, "seg.nii", |at| if at <= labels { at as f32 } else { 0.0 });
        assert_eq!(proposed(&folder).files[0].masks.len(), masks);
    }
}

#[test]
fn folders_with_the_same_files_are_dates_where_their_names_say_so() {
    let files = |folders: [&str; 2]| {
        let (keep, folder) = temp();
        for name in folders {
            put_mask(&folder, &format!("{name}/seg.nii"));
        }
        (keep, folder)
    };
    let times = |spec: CaseSpec| -> Vec<String> { spec.masks.into_iter().map(|m| m.time.unwrap()).collect() };
    let (_keep, staged) = files(["pre", "post"]);
    assert_eq!(times(CaseSpec::from_path(&staged).unwrap()), ["post", "pre"]);
    let (_keep, unknown) = files(["north", "south"]);
    let why = error(&unknown);
    assert!(why.contains("the same files in north, south, which may be patients or dates"), "{why}");
    let options = LoadOptions { order: vec!["south".into(), "north".into()], ..LoadOptions::default() };
    assert_eq!(times(open_spec(&unknown, &options, &Progress::new()).unwrap()), ["north", "south"]);
    // Different files in the folders: one date.
    put(&staged, "post/t1.nii", |at| at as f32);
    std::fs::remove_file(staged.join("post/seg.nii")).unwrap();
    assert!(CaseSpec::from_path(&staged).unwrap().masks[0].time.is_none());
}

#[test]
fn files_without_a_date_beside_dated_ones_are_left_out_and_one_date_is_none() {
    let (_keep, folder) = temp();
    put(&folder, "t1-2024-01-01.nii", |at| at as f32);
    assert_eq!(proposed(&folder).files[0].time, "");
    put(&folder, "t1-2024-02-02.nii", |at| at as f32);
    put(&folder, "flair.nii", |at| at as f32);
    let all = proposed(&folder);
    let expected = [(Role::Image, "t1".into()), (Role::Image, "t1".into()), (Role::LeftOut, "flair".into())];
    assert_eq!(found(&all), expected);
    assert_eq!(all.files[2].reason, "no date in its name, while others have one");
}

#[test]
fn ids_that_clash_are_whole_names_then_paths() {
    let (_keep, folder) = temp();
    for name in ["a_desc-x_mask.nii", "a_x.nii", "b/p_mask.nii", "c/p_mask.nii", "c/q_mask.nii"] {
        put_mask(&folder, name);
    }
    let mut ids: Vec<String> = found(&proposed(&folder)).into_iter().map(|(_, id)| id).collect();
    ids.sort();
    assert_eq!(ids, ["a_desc-x_mask", "a_x", "b/p_mask.nii", "c/p_mask.nii", "q"]);
}

#[test]
fn a_manifest_goes_before_guesses_and_two_are_refused() {
    let (_keep, folder) = temp();
    put_mask(&folder, "seg.nii");
    text(&folder, "other.toml", "[package]\nname = \"glioscope\"\n");
    assert!(!has_manifest(&folder) && !has_manifest(&folder.join("seg.nii")));
    let manifest = |id: &str| format!("  glioscope = 1\n[[mask]]\nid = \"{id}\"\nfile = \"seg.nii\"\n");
    text(&folder, "one.TOML", &manifest("one"));
    let id = || CaseSpec::from_path(&folder).unwrap().masks[0].id.clone();
    assert!(has_manifest(&folder));
    assert_eq!(id(), "one");
    text(&folder, "two.toml", &manifest("two"));
    assert!(error(&folder).contains("found 2 manifests, expected one, or one named case.toml"));
    text(&folder, "case.toml", &manifest("case"));
    assert_eq!(id(), "case");
    assert_eq!(CaseSpec::from_path(&folder.join("two.toml")).unwrap().masks[0].id, "two");
}

#[test]
fn what_is_not_taken_is_named() {
    let (_keep, folder) = temp();
    text(&folder, "cst.tck", "mrtrix tracks");
    text(&folder, "empty.nii", "");
    let nothing = error(&folder);
    assert!(nothing.contains("no NIfTI") && nothing.contains("cst.tck: found fibre tracts"), "{nothing}");
    assert!(nothing.contains("empty.nii: found an empty file"), "{nothing}");
    put_mask(&folder, "seg.nii");
    text(&folder, "slice", &format!("{}DICM\u{2}\0\0\0", "\0".repeat(128)));
    let all = proposed(&folder);
    let left_out = notes(&all, "left-out");
    assert!(left_out.contains(&"slice: found DICOM beside other images; left out".into()), "{left_out:?}");
    text(&folder, "roi_sub-01.nii", "");
    put_mask(&folder, "sub-01_seg.nii");
    put_mask(&folder, "sub-02_seg.nii");
    assert!(error(&folder).contains("files of 2 patients (01, 02)"), "{}", error(&folder));
}

#[test]
fn a_study_is_a_folder_with_dicom_and_no_other_images() {
    let (_keep, folder) = temp();
    let found = || is_study(&folder, &Progress::new());
    text(&folder, "notes.txt", "none");
    assert!(!found());
    text(&folder, "deep/slice", &format!("{}DICM\u{2}\0\0\0", "\0".repeat(128)));
    assert!(found());
    put_mask(&folder, "seg.nii");
    assert!(!found());
    assert!(!is_study(&folder.join("absent"), &Progress::new()));
}

#[test]
fn the_key_of_a_proposal_changes_with_its_files_and_with_nothing_else() {
    let (_keep, folder) = temp();
    put(&folder, "t1.nii", |at| at as f32);
    let key = || proposed(&folder).key;
    let mut keys = vec![key()];
    assert_eq!(key(), keys[0]);
    put_mask(&folder, "seg.nii");
    keys.push(key());
    // A file that was changed at another time, then one of another size at that time, then one left out.
    let file = std::fs::File::options().write(true).open(folder.join("t1.nii")).unwrap();
    let at = std::time::SystemTime::UNIX_EPOCH + std::time::Duration::new(1_700_000_000, 5);
    file.set_modified(at).unwrap();
    keys.push(key());
    file.set_modified(at + std::time::Duration::from_nanos(7)).unwrap();
    keys.push(key());
    file.set_len(file.metadata().unwrap().len() + 1).unwrap();
    file.set_modified(at).unwrap();
    keys.push(key());
    text(&folder, "empty.nii", "");
    keys.push(key());
    assert_eq!(keys.iter().collect::<std::collections::BTreeSet<_>>().len(), keys.len(), "{keys:?}");
}
