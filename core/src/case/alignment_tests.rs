//! Registration transforms of cases built in memory.

use glam::{DAffine3, DMat3, DVec3};

use super::*;
use crate::{
    Samples, Scaling,
    change::{self, ChangeOptions, Choice, Flag},
    files::{Loaded, Origin},
    transform::{self, Transform},
};

const DIMS: [usize; 3] = [12, 11, 10];

/// A volume with an L of label 1, on a grid of 1 mm that `place` puts somewhere.
fn volume(place: DAffine3) -> Volume {
    let world_from_voxel = place * DAffine3::from_translation(DVec3::new(-6.0, -5.0, -4.0));
    let grid = Grid::new(DIMS, world_from_voxel, crate::Sides::Known).unwrap();
    let inside = |[x, y, z]: [usize; 3]| {
        (2..9).contains(&x) && (3..7).contains(&y) && (2..5).contains(&z) && (x < 5 || y < 5)
    };
    let stored = (0..grid.voxel_count()).map(|linear| u8::from(inside(grid.ijk(linear))));
    Volume::new(grid.clone(), Samples::U8(stored.collect()), Scaling::NONE).unwrap()
}

/// A turn by 90° and a shift by whole voxels: a mask that is moved back has its very voxels.
fn turned() -> DAffine3 {
    let turn = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
    DAffine3::from_mat3_translation(turn, DVec3::new(40.0, -7.0, 3.0))
}

fn spec() -> CaseSpec {
    let at = |time: &str| Some(time.to_owned());
    let source = |name: &str| Source::File(name.into());
    let mask = |file: &str, time: &str| MaskSpec {
        id: "m".into(),
        source: source(file),
        labels: None,
        above: None,
        time: at(time),
        color: None,
        name: None,
    };
    let image =
        |file: &str, time: &str| ContextSpec { id: "T1".into(), source: source(file), time: at(time) };
    CaseSpec {
        name: "made".into(),
        contexts: vec![image("a", "one"), image("b", "two")],
        masks: vec![mask("a", "one"), mask("b", "two")],
        order: vec!["one".into(), "two".into()],
        ..CaseSpec::default()
    }
}

fn moving(id: Option<&str>, time: Option<&str>, moving_from_fixed: DAffine3) -> Alignment {
    let by = AlignedBy::matrix(moving_from_fixed, "hand");
    Alignment::of(id.map(str::to_owned), time.map(str::to_owned), by)
}

fn loaded(spec: &CaseSpec, of_second: DAffine3, frames: [&str; 2]) -> Result<Case, CaseError> {
    let read = |source: &Source| {
        let (place, frame) = match source.name().as_str() {
            "a" => (DAffine3::IDENTITY, frames[0]),
            _ => (of_second, frames[1]),
        };
        let origin = Origin { frame_of_reference: frame.into(), ..Origin::default() };
        Ok(Loaded { volume: volume(place), frames: 1, checks: Vec::new(), origin: Some(origin) })
    };
    load_with(spec, &LoadOptions::default(), &Progress::new(), &read)
}

fn with(alignments: Vec<Alignment>) -> Result<Case, CaseError> {
    loaded(&CaseSpec { alignments, ..spec() }, turned(), ["", ""])
}

fn codes(case: &Case) -> Vec<&str> {
    case.checks.iter().map(|check| check.code).collect()
}

#[test]
fn a_date_is_moved_with_its_images_and_masks() {
    let case = with(vec![moving(None, Some("two"), turned())]).unwrap();
    let [one, two] = case.time_points.as_slice() else { panic!() };
    assert_eq!(one.masks[0].mask.bits(), two.masks[0].mask.bits());
    assert_eq!(case.grid, *one.contexts[0].volume.grid(), "the grid of the date that isn't moved");
    assert!(two.contexts[0].volume.grid().same_place(one.contexts[0].volume.grid(), 1e-9));
    assert_eq!(two.contexts[0].volume.samples(), one.contexts[0].volume.samples());
    let moved: Vec<_> = case.aligned.iter().map(|a| (a.id.as_str(), a.time.as_str(), a.is_mask)).collect();
    assert_eq!(moved, [("T1", "two", false), ("m", "two", true)]);
    let back = case.aligned[1].case_from_own.transform_point3(DVec3::new(40.0, -7.0, 3.0));
    assert!(back.length() < 1e-12, "{back}");
    let note = case.checks.iter().find(|check| check.code == "aligned").unwrap();
    assert!(note.message.contains("T1 (two): moved by hand: its centre by "), "{}", note.message);
    assert!(note.message.ends_with("turned by 90.00°"), "{}", note.message);
}

#[test]
fn the_transform_of_an_image_comes_before_that_of_its_date() {
    let shift = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0));
    // The file lies where both together put it: first the item into its date's space, then the date into the case's.
    let alignments = vec![moving(None, Some("two"), turned()), moving(Some("m"), Some("two"), shift)];
    let case = loaded(&CaseSpec { alignments, ..spec() }, shift * turned(), ["", ""]).unwrap();
    let [one, two] = case.time_points.as_slice() else { panic!() };
    assert_eq!(one.masks[0].mask.bits(), two.masks[0].mask.bits());
    let of_mask = case.aligned.iter().find(|a| a.is_mask).unwrap();
    assert_eq!(of_mask.by, ["hand", "hand"]);
}

#[test]
fn volumes_are_those_of_the_file_though_a_transform_stretches() {
    let twice = DAffine3::from_scale(DVec3::splat(0.5));
    let alignments = vec![moving(Some("m"), Some("two"), twice), moving(Some("T1"), Some("two"), twice)];
    let case = loaded(&CaseSpec { alignments, ..spec() }, DAffine3::IDENTITY, ["", ""]).unwrap();
    let [one, two] = [0, 1].map(|at| &case.time_points[at].masks[0]);
    assert_eq!(one.native_volume_ml, two.native_volume_ml);
    let ratio = two.mask.voxels() as f64 / one.mask.voxels() as f64;
    assert!((ratio - 8.0).abs() < 1e-9, "{ratio}");
}

#[test]
fn what_is_left_behind_is_said() {
    let case = with(vec![moving(Some("T1"), Some("two"), turned())]).unwrap();
    let warning = case.checks.iter().find(|check| check.code == "aligned-in-part").unwrap();
    assert!(
        warning.message.starts_with("m (two): lies on the grid of T1 (two), which"),
        "{}",
        warning.message
    );
    assert!(!codes(&with(vec![moving(None, Some("two"), turned())]).unwrap()).contains(&"aligned-in-part"));
}

#[test]
fn a_transform_that_moves_nothing_or_too_much_is_refused() {
    let error = |alignments| with(alignments).unwrap_err().to_string();
    let text = error(vec![moving(Some("PET"), None, turned())]);
    assert!(
        text.contains("found a transform of PET, which the case lacks, expected one of T1 (one)"),
        "{text}"
    );
    let text = error(vec![moving(None, None, turned())]);
    assert!(text.contains("found a transform without an id and a time"), "{text}");
    let twice = || moving(Some("m"), None, turned());
    let text = error(vec![twice(), moving(Some("m"), Some("two"), turned())]);
    assert!(text.contains("found two transforms of m (two): hand and hand"), "{text}");
    let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let text = error(vec![moving(Some("m"), None, mirror)]);
    assert!(text.starts_with("hand: found "), "{text}");
}

#[test]
fn arguments_name_an_id_a_date_or_both() {
    let parts = |text| {
        let Alignment { id, time, by, accepted: _ } = Alignment::from_argument(text).unwrap();
        let AlignedBy::File { path, convention, .. } = by else { panic!() };
        (id, time, path.display().to_string(), convention)
    };
    let owned = |text: &str| Some(text.to_owned());
    assert_eq!(parts("PET=a.tfm"), (owned("PET"), None, "a.tfm".into(), None));
    assert_eq!(
        parts("PET@2024=a.txt:greedy"),
        (owned("PET"), owned("2024"), "a.txt".into(), owned("greedy"))
    );
    assert_eq!(parts("@2024=a:b.tfm"), (None, owned("2024"), "a:b.tfm".into(), None));
    for bad in ["PET", "=a.tfm", "PET="] {
        assert!(Alignment::from_argument(bad).unwrap_err().to_string().contains("expected ID[@TIME]=FILE"));
    }
    // An id with an @.
    let mut spec = spec();
    spec.masks.iter_mut().for_each(|mask| mask.id = "m@x".into());
    spec.alignments = vec![moving(Some("m"), Some("x"), DAffine3::IDENTITY)];
    let case = loaded(&spec, DAffine3::IDENTITY, ["", ""]).unwrap();
    assert_eq!(case.aligned.iter().map(|a| a.id.as_str()).collect::<Vec<_>>(), ["m@x", "m@x"]);
}

#[test]
fn a_file_of_another_program_moves_a_date_and_is_an_input() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("two.tfm");
    transform::write(&file, &Transform::new(turned()).unwrap(), &transform::Given::default()).unwrap();
    let by_file = Alignment::from_argument(&format!("@two={}", file.display())).unwrap();
    let case = with(vec![by_file]).unwrap();
    assert_eq!(case.time_points[0].masks[0].mask.bits(), case.time_points[1].masks[0].mask.bits());
    assert!(case.inputs.refuse_as_output(&file).is_err());
    // Its convention is stated by the format.
    let text = format!("@two={}:niftyreg", file.display());
    let error = with(vec![Alignment::from_argument(&text).unwrap()]).unwrap_err().to_string();
    assert!(error.contains("found a convention of"), "{error}");
    let matrix = folder.path().join("two.txt");
    let given = transform::Given {
        format: Some(transform::Format::Matrix),
        convention: Some(transform::Convention::RasFixedFromMoving),
        images: None,
    };
    transform::write(&matrix, &Transform::new(turned()).unwrap(), &given).unwrap();
    let of = |word: &str| {
        with(vec![Alignment::from_argument(&format!("@two={}{word}", matrix.display())).unwrap()])
    };
    assert!(of("").unwrap_err().to_string().contains("found a bare 4x4 matrix"));
    assert_eq!(of(":ras-fixed-from-moving").unwrap().time_points[1].masks, case.time_points[1].masks);
}

#[test]
fn dates_of_two_frames_of_reference_are_compared_by_volume_until_they_are_aligned() {
    let choice = Choice { id: "m".into(), dates: [0, 1] };
    let flags = |spec: &CaseSpec, of_second, frames| {
        let case = loaded(spec, of_second, frames).unwrap();
        let between = change::between(&case, &choice, &ChangeOptions::default(), None, &Progress::new());
        let (report, _) = between.unwrap();
        let codes: Vec<String> = report.warnings.iter().map(|check| check.code.to_string()).collect();
        (report.flags.clone(), report.kept_ml, codes)
    };
    let here = DAffine3::IDENTITY;
    let (found, kept_ml, codes) = flags(&spec(), here, ["1.2", "1.3"]);
    assert_eq!((found, kept_ml), (vec![Flag::NotAligned], None));
    assert_eq!(codes[0], "not-aligned");
    assert!(codes.contains(&"frames-of-reference".into()));
    for (spec, of_second, frames) in [
        (spec(), here, ["1.2", "1.2"]),
        (spec(), here, ["1.2", ""]),
        (CaseSpec { one_space: true, ..spec() }, here, ["1.2", "1.3"]),
        (
            CaseSpec { alignments: vec![moving(None, Some("two"), turned())], ..spec() },
            turned(),
            ["1.2", "1.3"],
        ),
    ] {
        let (found, kept_ml, codes) = flags(&spec, of_second, frames);
        assert_eq!(found, [Flag::NoChange]);
        assert!(kept_ml.is_some_and(|ml| ml > 0.0));
        assert!(!codes.contains(&"not-aligned".into()));
    }
}
