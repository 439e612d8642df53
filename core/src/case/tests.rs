//! Loading cases built in memory.

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DAffine3, DVec3};

use super::*;
use crate::{Samples, Scaling, Severity, Sides, files::Loaded, measure};

const DIMS: [usize; 3] = [10, 10, 10];

fn grid(spacing: f64, origin: f64) -> Grid {
    Grid::axis_aligned(DIMS, DVec3::splat(spacing), DVec3::splat(origin)).unwrap()
}

/// Label 1 in a box of voxels, else 0.
fn boxed(grid: &Grid, lo: usize, hi: usize) -> Volume {
    let inside = |v: usize| (lo..hi).contains(&v);
    let stored = (0..1000).map(|l| u8::from(inside(l % 10) && inside(l / 10 % 10) && inside(l / 100)));
    Volume::new(grid.clone(), Samples::U8(stored.collect()), Scaling::NONE).unwrap()
}

fn source(name: &str) -> Source {
    Source::File(name.into())
}

fn mask(id: &str, file: &str, time: Option<&str>) -> MaskSpec {
    MaskSpec {
        id: id.into(),
        source: source(file),
        labels: None,
        above: None,
        time: time.map(str::to_owned),
        color: None,
        name: None,
    }
}

fn image(id: &str, file: &str, time: Option<&str>) -> ContextSpec {
    ContextSpec { id: id.into(), source: source(file), time: time.map(str::to_owned) }
}

fn case_of(contexts: Vec<ContextSpec>, masks: Vec<MaskSpec>) -> CaseSpec {
    CaseSpec { name: "made".into(), contexts, masks, ..CaseSpec::default() }
}

fn load_from(spec: &CaseSpec, options: &LoadOptions, files: &[(&str, Volume)]) -> Result<Case, CaseError> {
    let read = |source: &Source| {
        let found = files.iter().find(|(name, _)| *name == source.name());
        let volume = found.map(|(_, v)| v.clone()).unwrap_or_else(|| boxed(&grid(1.0, 0.0), 0, 2));
        Ok(Loaded { volume, frames: 1, checks: Vec::new(), origin: None })
    };
    load_with(spec, options, &Progress::new(), &read)
}

fn load_plain(spec: &CaseSpec, files: &[(&str, Volume)]) -> Case {
    load_from(spec, &LoadOptions::default(), files).unwrap()
}

fn error(spec: &CaseSpec) -> String {
    let text = load_from(spec, &LoadOptions::default(), &[]).unwrap_err().to_string();
    assert!(
        text.starts_with("made: found ") && text.contains(", expected ") && !text.contains('\n'),
        "{text}"
    );
    text
}

fn message<'a>(case: &'a Case, code: &str) -> &'a str {
    let found: Vec<&Check> = case.checks.iter().filter(|c| c.code == code).collect();
    assert_eq!(found.len(), 1, "{code}: {:?}", case.checks);
    &found[0].message
}

fn has(case: &Case, code: &str) -> bool {
    case.checks.iter().any(|c| c.code == code)
}

#[test]
fn a_description_knows_its_files_times_and_ids() {
    let masks = vec![mask("M", "b.nii", Some("two")), mask("N", "b.nii", Some("one"))];
    let mut spec = case_of(vec![image("I", "a.nii", Some("one"))], masks);
    spec.add_tracts(&["left/cst.tck.gz".into(), "right/cst.trk".into(), "notes".into()]);
    spec.described_by.push("case.toml".into());
    assert_eq!(spec.times(), ["one", "two"]);
    let order = |labels: &[&str]| labels.iter().map(|label| (*label).to_owned()).collect::<Vec<_>>();
    assert!(spec.is_ordered_by(&order(&["two", "one"])));
    assert!(
        [&["one"][..], &["one", "one"], &["one", "two", "two"]]
            .iter()
            .all(|o| !spec.is_ordered_by(&order(o)))
    );
    assert_eq!(["I", "M", "N", "cst", "J"].map(|id| spec.has_grid_of(id)), [true, true, true, false, false]);
    let ids: Vec<&str> = spec.tracts.iter().map(|tracts| tracts.id.as_str()).collect();
    assert_eq!(ids, ["cst", "cst 2", "notes"]);
    let names = ["a.nii", "b.nii", "b.nii", "left/cst.tck.gz", "right/cst.trk", "notes"];
    let all = names.iter().chain(["case.toml"].iter()).map(PathBuf::from);
    assert_eq!(spec.inputs(), Inputs::new(all));
    spec.make_absolute();
    let paths = |spec: &CaseSpec| -> Vec<PathBuf> {
        let masks = spec.masks.iter().map(|m| &m.source);
        let sources = spec.contexts.iter().map(|c| &c.source).chain(masks);
        sources.chain(spec.tracts.iter().map(|t| &t.source)).map(|s| s.path().unwrap().to_owned()).collect()
    };
    let here = std::env::current_dir().unwrap();
    assert_eq!(paths(&spec), names.map(|name| here.join(name)));
}

#[test]
fn the_case_grid_is_that_of_the_finest_mask() {
    let files = [
        ("coarse", boxed(&grid(2.0, 0.5), 1, 4)),
        ("fine", boxed(&grid(1.0, 0.0), 2, 8)),
        ("same", boxed(&grid(1.0, 3.0), 0, 6)),
    ];
    let masks = vec![mask("C", "coarse", None), mask("F", "fine", None), mask("S", "same", None)];
    let spec = case_of(vec![image("I", "coarse", None)], masks);
    let case = load_plain(&spec, &files);
    // Of the two finest, the one with the smaller origin.
    assert!(case.grid.same_place(&grid(1.0, 0.0), 1e-9));
    // 3³ voxels of 8 mm³, resampled to a grid that subdivides them: 27 · 8 voxels of 1 mm³.
    let coarse = &case.time_points[0].masks[0];
    assert_eq!((coarse.native_voxels, coarse.mask.voxels()), (27, 216));
    assert!((coarse.native_volume_ml - 0.216).abs() < 1e-12);
    let text = case.checks.iter().find(|c| c.message.starts_with("C: found a mask on its own grid")).unwrap();
    assert!(text.message.contains("0.216 ml before, 0.216 ml after (+0.00 %)"), "{text:?}");
    assert_eq!(message(&case, "grids-differ").split(',').next(), Some("masks: found 3 different grids"));

    let by_id = |id: &str| LoadOptions { case_grid: CaseGridChoice::Of(id.into()), ..LoadOptions::default() };
    let chosen = load_from(&spec, &by_id("C"), &files).unwrap();
    assert!(chosen.grid.same_place(&grid(2.0, 0.5), 1e-9));
    let unknown = load_from(&spec, &by_id("X"), &files).unwrap_err().to_string();
    assert_eq!(unknown, "made: found case grid of X, expected one of C, F, S, I");
}

/// Thick slices with small pixels have smaller voxels than a millimetre grid, and lose what lies between them.
#[test]
fn thick_slices_are_not_the_finest_grid() {
    let thick_spacing = DVec3::new(0.4, 0.4, 5.0);
    let thick = Grid::axis_aligned(DIMS, thick_spacing, DVec3::ZERO).unwrap();
    let files = [("thin", boxed(&grid(1.0, 0.0), 1, 2)), ("thick", boxed(&thick, 0, 3))];
    for order in [["thin", "thick"], ["thick", "thin"]] {
        let masks = order.map(|file| mask(file, file, None)).to_vec();
        let case = load_plain(&case_of(vec![], masks.clone()), &files);
        assert_eq!(case.grid.spacing_mm(), DVec3::ONE);
        let thin = case.time_points[0].masks.iter().find(|m| m.mask.id() == "thin").unwrap();
        assert_eq!(thin.mask.voxels(), 1);
        assert!(!has(&case, "mask-part-lost"));
        // On the thick slices the voxel is lost, and said to be.
        let options = LoadOptions { case_grid: CaseGridChoice::Of("thick".into()), ..LoadOptions::default() };
        let case = load_from(&case_of(vec![], masks), &options, &files).unwrap();
        assert!(message(&case, "mask-part-lost").starts_with("thin: found 1 part is lost"));
    }
}

/// One id on different grids at two times: the finer one, whichever is listed first.
#[test]
fn a_chosen_case_grid_does_not_depend_on_the_order_of_files() {
    let files = [("fine", boxed(&grid(1.0, 0.0), 2, 8)), ("coarse", boxed(&grid(2.0, 0.5), 1, 4))];
    for order in [[("fine", "1"), ("coarse", "2")], [("coarse", "2"), ("fine", "1")]] {
        let masks = order.map(|(file, time)| mask("M", file, Some(time))).to_vec();
        let options = LoadOptions { case_grid: CaseGridChoice::Of("M".into()), ..LoadOptions::default() };
        let case = load_from(&case_of(vec![], masks), &options, &files).unwrap();
        assert!(case.grid.same_place(&grid(1.0, 0.0), 1e-9));
    }
}

#[test]
fn cases_of_masks_only_and_of_images_only_load() {
    let files = [("a", boxed(&grid(1.0, 0.0), 1, 3)), ("b", boxed(&grid(3.0, 0.0), 1, 3))];
    let masks = load_plain(&case_of(vec![], vec![mask("A", "a", None)]), &files);
    assert_eq!(masks.time_points[0].regions.union_voxels(), 8);
    assert!(masks.time_points[0].contexts.is_empty());
    let images = load_plain(&case_of(vec![image("B", "b", None), image("A", "a", None)], vec![]), &files);
    assert!(images.grid.same_place(&grid(3.0, 0.0), 1e-9), "the first image's");
    assert!(images.time_points[0].regions.list().is_empty());
    assert!(measure::report(&images).time_points[0].pairs.is_empty());
}

#[test]
fn tracts_load_with_the_case_and_their_checks_name_the_id() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cst.tck");
    let head = "mrtrix tracks\ncount: 2\ndatatype: Float32LE\nfile: . 64\nEND\n";
    let mut bytes = head.as_bytes().to_vec();
    bytes.resize(64, b' ');
    for v in [1.0, 2.0, 3.0, f32::NAN, f32::NAN, f32::NAN].into_iter().chain([f32::INFINITY; 3]) {
        bytes.extend(v.to_le_bytes());
    }
    files::write_whole(&path, &bytes).unwrap();
    let mut spec = case_of(vec![], vec![mask("A", "a", None)]);
    spec.add_tracts(&[path.clone(), path]);
    let case = load_plain(&spec, &[]);
    let ids: Vec<&str> = case.tracts.iter().map(|t| t.id.as_str()).collect();
    assert_eq!(ids, ["cst", "cst 2"]);
    assert_eq!(case.tracts[1].tracts.fiber(0), [[1.0, 2.0, 3.0]]);
    let found: Vec<&Check> = case.checks.iter().filter(|c| c.code == "tracts-count").collect();
    assert!(found[0].message.starts_with("cst, cst 2 (2 files): found 1 fibres"), "{found:?}");

    let small = LoadOptions { max_bytes: 50, ..LoadOptions::default() };
    assert!(load_from(&spec, &small, &[]).unwrap_err().to_string().contains("at most 50"));
    spec.tracts[1].id = "cst".into();
    assert!(error(&spec).contains("found tracts cst twice"));
    spec.tracts.truncate(1);
    spec.tracts[0].source = source("nowhere.tck");
    let line = load_from(&spec, &LoadOptions::default(), &[]).unwrap_err().to_string();
    assert!(line.starts_with("nowhere.tck: found no such file"), "{line}");
}

/// Bytes of an MRtrix file: its first line, and numbers.
fn mrtrix(first: &str, numbers: &[f32]) -> Vec<u8> {
    let mut bytes = format!("{first}\ndatatype: Float32LE\nfile: . 64\nEND\n").into_bytes();
    bytes.resize(64, b' ');
    numbers.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes
}

#[test]
fn scalars_beside_tracts_are_read_with_them_and_those_named_must_fit() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        files::write_whole(&path, bytes).unwrap();
        path
    };
    let (nan, end) = (f32::NAN, f32::INFINITY);
    let tck = mrtrix("mrtrix tracks", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, nan, nan, nan, end, end, end]);
    let scalars = |numbers: &[f32]| mrtrix("mrtrix track scalars", numbers);
    let cst = put("cst.tck", &tck);
    let other = put("cst_left.tck", &tck);
    put("cst.FA.tsf", &scalars(&[0.25, 0.5, nan, end]));
    put("cst.md.tsf", &scalars(&[0.25, nan, end]));
    put("cst_left.tsf", &scalars(&[3.0, 4.0, nan, end]));
    put("other.tsf", &scalars(&[0.0, 0.0, nan, end]));
    let named = put("cst_T1.tsf", &scalars(&[8.0, 9.0, nan, end]));
    let mut spec = case_of(vec![], vec![mask("A", "a", None)]);
    spec.add_tracts(&[cst.clone(), named.clone(), other]);
    let case = load_plain(&spec, &[]);
    let names =
        |n: usize| -> Vec<&str> { case.tracts[n].tracts.scalars().iter().map(|s| s.name()).collect() };
    assert_eq!((names(0), names(1)), (vec!["FA", "T1"], vec!["cst_left"]));
    let cst_tracts = &case.tracts[0].tracts;
    assert_eq!(cst_tracts.values_along(cst_tracts.scalar("T1").unwrap(), 0), [8.0, 9.0]);
    // One beside them that doesn't fit is left out and named.
    let unread: Vec<&Check> = case.checks.iter().filter(|c| c.code == "tracts-scalars-unread").collect();
    let text = &unread[0].message;
    assert!(
        unread.len() == 1 && text.contains("cst.md.tsf: found 1 scalars in fibre 0, expected 2"),
        "{unread:?}"
    );
    // They are inputs: no output may replace them.
    assert!(spec.inputs().refuse_as_output(&named).is_err());
    assert!(spec.inputs().refuse_as_output(&folder.path().join("cst.FA.tsf")).is_err());

    // One that was named, though beside them, must fit; without tracts it is refused.
    let mut spec = case_of(vec![], vec![mask("A", "a", None)]);
    spec.add_tracts(&[cst, folder.path().join("cst.md.tsf")]);
    let refused = |spec: &CaseSpec| load_from(spec, &LoadOptions::default(), &[]).unwrap_err().to_string();
    assert!(refused(&spec).contains("cst.md.tsf: found 1 scalars in fibre 0, expected 2"));
    let mut spec = case_of(vec![], vec![mask("A", "a", None)]);
    spec.add_tracts(&[named]);
    assert!(refused(&spec).contains("scalars of fibres (.tsf)"));
}

#[test]
fn a_file_named_twice_is_read_once() {
    let reads = AtomicUsize::new(0);
    let read = |_: &Source| {
        reads.fetch_add(1, Ordering::Relaxed);
        let stored = (0..1000).map(|l| (l % 5) as u8).collect();
        let volume = Volume::new(grid(1.0, 0.0), Samples::U8(stored), Scaling::NONE).unwrap();
        Ok(Loaded {
            volume,
            frames: 3,
            checks: vec![Check::note("noticed", "seg.nii: something")],
            origin: None,
        })
    };
    let with_labels =
        |id: &str, labels: &[i64]| MaskSpec { labels: Some(labels.to_vec()), ..mask(id, "seg", None) };
    let masks = vec![
        with_labels("core", &[1, 4]),
        with_labels("whole", &[1, 2, 4]),
        with_labels("none", &[9]),
        with_labels("some", &[3, 9]),
    ];
    let spec = case_of(vec![image("map", "seg", None)], masks);
    let case = load_with(&spec, &LoadOptions::default(), &Progress::new(), &read).unwrap();
    assert_eq!(reads.load(Ordering::Relaxed), 1);
    let voxels: Vec<u64> = case.time_points[0].masks.iter().map(|m| m.mask.voxels()).collect();
    assert_eq!(voxels, [400, 600, 0, 200]);
    assert_eq!(message(&case, "noticed"), "map: seg.nii: something");
    assert!(message(&case, "first-frame-only").starts_with("map: found 3 frames"));
    assert!(message(&case, "mask-empty").starts_with("none: found an empty mask (no voxel has label 9)"));
    assert_eq!(message(&case, "label-missing"), "some: found no voxel with label 9, expected labels 3, 9");
}

#[test]
fn times_are_in_time_order_whatever_the_order_listed_and_ids_keep_their_bit() {
    let masks = vec![
        mask("A", "a", Some("2024-05-01")),
        mask("B", "b", Some("2024-05-01")),
        mask("B", "b", Some("2024-01-01")),
        mask("A", "a", Some("2024-01-01")),
        mask("B", "b", Some("2024-09-01")),
    ];
    let ordered = ["2024-01-01", "2024-05-01", "2024-09-01"];
    for shift in 0..masks.len() {
        let mut listed = masks.clone();
        listed.rotate_left(shift);
        let case = load_plain(&case_of(vec![], listed.clone()), &[("a", boxed(&grid(1.0, 0.0), 0, 3))]);
        assert_eq!((case.time_labels(), case.order), (ordered.to_vec(), OrderBasis::Dates));
        let first = listed[0].id.as_str();
        for time_point in &case.time_points[..2] {
            assert_eq!(time_point.index.mask_ids()[0], first);
            let voxels =
                |id: &str| time_point.masks.iter().find(|m| m.mask.id() == id).unwrap().mask.voxels();
            assert_eq!((voxels("A"), voxels("B")), (27, 8));
        }
        assert!(message(&case, "mask-not-at-every-time").starts_with("A: found no mask at 2024-09-01"));
        assert_eq!(has(&case, "time-order"), !listed.iter().map(|m| m.time.as_deref()).is_sorted());
    }
}

#[test]
fn an_order_that_labels_do_not_state_is_unknown_until_stated() {
    let masks = vec![mask("A", "a", Some("red")), mask("A", "b", Some("blue"))];
    let files = [("a", boxed(&grid(1.0, 0.0), 0, 3)), ("b", boxed(&grid(1.0, 0.0), 0, 4))];
    let mut spec = case_of(vec![], masks);
    let unknown = load_plain(&spec, &files);
    assert_eq!((unknown.time_labels(), unknown.order), (vec!["red", "blue"], OrderBasis::Unknown));
    assert!(message(&unknown, "time-order-unknown").contains("--order"));
    let choice =
        |case: &Case, from, to| crate::change::Choice::resolve(case, None, from, to).map(|c| c.dates);
    for (from, to) in [(None, None), (Some("red"), None), (None, Some("red"))] {
        let error = choice(&unknown, from, to).unwrap_err().to_string();
        assert!(error.contains("red, blue") && error.contains("--from"), "{error}");
    }
    // Two dates by name are an order.
    assert_eq!(choice(&unknown, Some("blue"), Some("red")).unwrap(), [1, 0]);
    assert_eq!(choice(&unknown, Some("red"), Some("blue")).unwrap(), [0, 1]);
    assert!(choice(&unknown, Some("red"), Some("red")).is_err());
    // Stated by the case, or, before that, by the options.
    spec.order = vec!["red".into(), "blue".into()];
    let stated = load_plain(&spec, &files);
    assert_eq!((stated.time_labels(), stated.order), (vec!["red", "blue"], OrderBasis::Stated));
    assert_eq!(choice(&stated, None, None).unwrap(), [0, 1]);
    assert!(choice(&stated, Some("blue"), Some("red")).is_err(), "never swapped");
    let with = |order: &[&str]| {
        let order = order.iter().map(|label| (*label).to_owned()).collect();
        load_from(&spec, &LoadOptions { order, ..LoadOptions::default() }, &files)
    };
    let case = with(&["blue", "red"]).unwrap();
    assert_eq!(case.time_labels(), ["blue", "red"]);
    assert_eq!(case.time_points[0].masks[0].mask.voxels(), 64);
    for wrong in [&["blue"][..], &["blue", "green"], &["blue", "red", "red"]] {
        let error = with(wrong).unwrap_err().to_string();
        assert!(error.contains("expected each date once: red, blue"), "{error}");
    }
}

#[test]
fn an_impossible_date_is_a_plain_label_with_a_warning() {
    let masks = vec![mask("A", "a", Some("2024-02-31")), mask("A", "b", Some("2024-01-01"))];
    let case = load_plain(&case_of(vec![], masks), &[]);
    assert!(message(&case, "date-impossible").starts_with("times: found 2024-02-31, expected a day"));
    assert_eq!(case.order, OrderBasis::Unknown, "a plain label isn't ordered by date");
}

#[test]
fn invalid_cases_are_refused_in_one_line_naming_the_cause() {
    assert!(error(&case_of(vec![], vec![])).contains("no image and no mask"));
    let mixed = case_of(vec![image("I", "i", None)], vec![mask("A", "a", Some("now"))]);
    assert!(error(&mixed).contains("image I without a time beside mask A at now"));
    let twice = case_of(vec![], vec![mask("A", "a", Some("now")), mask("A", "b", Some("now"))]);
    assert!(error(&twice).contains("mask A (now) twice"));
    let nameless = case_of(vec![image(" ", "i", None)], vec![]);
    assert!(error(&nameless).contains("image number 1 with an empty id"));
    // A case of as many files as may be is checked further.
    let name = |n: usize| if n == 4094 { String::new() } else { n.to_string() };
    let images = (0..4095).map(|n| image(&name(n), "i", None)).collect();
    let mut most = case_of(images, vec![mask("A", "a", None)]);
    assert!(error(&most).contains("image number 4095 with an empty id"));
    most.add_tracts(&["cst.tck".into()]);
    assert!(error(&most).contains("4097 images, masks and tracts, expected at most 4096"));
    let many: Vec<MaskSpec> = (0..33).map(|k| mask(&format!("m{k}"), "a", None)).collect();
    assert!(load_from(&case_of(vec![], many[..32].to_vec()), &LoadOptions::default(), &[]).is_ok());
    let text = error(&case_of(vec![], many));
    assert!(
        text.contains("33 masks, number 33 is m32, expected at most 32 masks at one time point"),
        "{text}"
    );
    let unlabelled = MaskSpec { labels: Some(vec![]), ..mask("A", "a", None) };
    assert!(error(&case_of(vec![], vec![unlabelled])).contains("mask A with an empty list of labels"));
    let background = MaskSpec { labels: Some(vec![1, 0]), ..mask("A", "a", None) };
    let case = load_from(&case_of(vec![], vec![background]), &LoadOptions::default(), &[]).unwrap();
    assert!(case.checks.iter().any(|check| check.code == "mask-of-background"));
}

/// Every order of `masks`.
fn permutations(masks: &[MaskSpec]) -> Vec<Vec<MaskSpec>> {
    if masks.len() < 2 {
        return vec![masks.to_vec()];
    }
    let with_first = |first: usize| {
        let mut rest = masks.to_vec();
        let first = rest.remove(first);
        permutations(&rest).into_iter().map(move |rest| [vec![first.clone()], rest].concat())
    };
    (0..masks.len()).flat_map(with_first).collect()
}

#[test]
fn no_mask_loses_a_voxel_and_no_number_depends_on_the_order_of_masks() {
    // Equally fine grids: apart, overlapping, half a voxel off, and one that is larger; and a coarse one.
    for (b, c) in [(5.0, -3.0), (0.5, 20.0), (40.0, 0.0), (-7.25, 0.25), (0.0, 0.0)] {
        let files = [
            ("a", boxed(&grid(1.0, 0.0), 0, 7)),
            ("b", boxed(&grid(1.0, b), 3, 10)),
            ("c", boxed(&grid(1.0, c), 2, 9)),
            ("d", boxed(&grid(2.0, -12.0), 0, 10)),
        ];
        let masks = ["a", "b", "c", "d"]
            .map(|id| mask(id, id, Some(if id < "c" { "2024-01-01" } else { "2024-02-01" })));
        let numbers = |masks: Vec<MaskSpec>| {
            let case = load_plain(&case_of(vec![], masks), &files);
            let times = case.time_points.iter().map(|time| {
                let mut volumes: Vec<(String, u64, u64)> = time
                    .masks
                    .iter()
                    .map(|m| (m.mask.id().to_owned(), m.mask.voxels(), m.native_voxels))
                    .collect();
                volumes.sort();
                let pairs = measure::pairs(&time.index, &time.regions);
                (volumes, pairs[0].value("dice"), time.regions.union_voxels())
            });
            (case.grid.clone(), times.collect::<Vec<_>>())
        };
        let first = numbers(masks.to_vec());
        let [(before, ..), (after, ..)] = &first.1[..] else { panic!("{first:?}") };
        for (id, voxels, native) in before.iter().chain(after) {
            let share = if id == "d" { 8 } else { 1 };
            assert_eq!(*voxels, share * native, "{id}, {b}, {c}");
        }
        for order in permutations(&masks) {
            assert_eq!(numbers(order), first, "{b}, {c}");
        }
    }
}

#[test]
fn a_grid_over_masks_too_far_apart_is_refused() {
    let files = [("a", boxed(&grid(1.0, 0.0), 0, 7)), ("b", boxed(&grid(1.0, 5000.0), 0, 7))];
    let spec = case_of(vec![], vec![mask("A", "a", None), mask("B", "b", None)]);
    let error = load_from(&spec, &LoadOptions::default(), &files).unwrap_err().to_string();
    assert!(error.contains("5007x5007x5007 voxels") || error.contains("5010x5010x5010"), "{error}");
}

#[test]
fn masks_outside_the_image_or_apart_are_reported() {
    let image_grid = grid(1.0, 0.0);
    let away = grid(1.0, 8.0);
    let files = [
        ("image", boxed(&image_grid, 0, 1)),
        ("in", boxed(&image_grid, 1, 4)),
        // Voxels 1 to 3 of a grid that starts at 8 mm: 9 to 11 mm, one of three layers inside.
        ("half", boxed(&away, 1, 4)),
        ("beside", boxed(&image_grid, 4, 6)),
    ];
    let spec = |masks| case_of(vec![image("T1c", "image", None)], masks);
    let case = load_plain(&spec(vec![mask("A", "in", None), mask("B", "half", None)]), &files);
    let text = message(&case, "mask-outside-image");
    assert!(text.starts_with("B: found 96.3 % of the mask (0.026 ml) outside every image"), "{text}");
    assert!(message(&case, "case-grid-extended").contains("(10x10x10 voxels); extended to 12x12x12"));
    assert_eq!(case.time_points[0].masks.iter().map(|m| m.mask.voxels()).collect::<Vec<_>>(), [27, 27]);
    let apart: Vec<&str> =
        case.checks.iter().filter(|c| c.code == "masks-do-not-touch").map(|c| c.message.as_str()).collect();
    // Boxes end at 3 and start at 9: five empty voxels between them along each axis.
    assert_eq!(apart.len(), 2);
    assert!(apart[0].starts_with("A: ") && apart[0].contains("8.7 mm away"), "{apart:?}");
    assert!(case.checks.iter().all(|c| c.severity != Severity::Error));
    // Boxes that meet at a corner touch.
    let case = load_plain(&spec(vec![mask("A", "in", None), mask("B", "beside", None)]), &files);
    assert!(case.checks.is_empty(), "{:?}", case.checks);
    // A single mask has no other to touch.
    assert!(!has(&load_plain(&spec(vec![mask("A", "in", None)]), &files), "masks-do-not-touch"));
}

#[test]
fn unknown_sides_stay_unknown() {
    let nowhere = Grid::new(DIMS, DAffine3::IDENTITY, Sides::Unknown).unwrap();
    let files = [("known", boxed(&grid(1.0, 0.0), 1, 4)), ("unknown", boxed(&nowhere, 1, 4))];
    let masks = vec![mask("A", "known", None), mask("B", "unknown", None)];
    let case = load_plain(&case_of(vec![], masks), &files);
    assert_eq!(case.grid.sides(), Sides::Unknown);
    assert!(message(&case, "sides-mixed").starts_with("B: found no place in the patient, while A have one"));
    assert!(message(&case, "sides-unknown").contains("1 of 2"));
    let case = load_plain(&case_of(vec![], vec![mask("A", "known", None)]), &files);
    assert_eq!(case.grid.sides(), Sides::Known);
    assert!(case.checks.is_empty());
}

#[test]
fn non_integer_values_are_counted() {
    let mut values = vec![0.0_f32; 1000];
    values[..4].copy_from_slice(&[1.0, 1.0, 0.3, f32::NAN]);
    let volume = Volume::new(grid(1.0, 0.0), Samples::F32(values), Scaling::NONE).unwrap();
    let labelled = MaskSpec { labels: Some(vec![1]), ..mask("A", "float", None) };
    let case = load_plain(&case_of(vec![], vec![labelled]), &[("float", volume)]);
    assert_eq!(case.time_points[0].regions.union_voxels(), 2);
    assert!(
        message(&case, "non-integer-label-map").starts_with("A: found 2 voxels that are no whole number")
    );
}

#[test]
fn voxels_that_are_not_finite_are_counted_and_inactive() {
    let mut values = vec![0.0_f32; 1000];
    values[..5].copy_from_slice(&[1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.7]);
    let volume = Volume::new(grid(1.0, 0.0), Samples::F32(values), Scaling::NONE).unwrap();
    let case = load_plain(&case_of(vec![], vec![mask("A", "float", None)]), &[("float", volume)]);
    assert_eq!(case.time_points[0].regions.union_voxels(), 2);
    assert!(message(&case, "mask-not-finite").starts_with("A: found 3 voxels that are NaN or infinite"));
}

#[test]
fn voxels_of_an_image_that_are_not_finite_are_told() {
    let found = |values: Vec<f32>| {
        let shown = Volume::new(grid(1.0, 0.0), Samples::F32(values), Scaling::NONE).unwrap();
        let spec = case_of(vec![image("T1", "image", None)], vec![mask("A", "float", None)]);
        let ones = Volume::new(grid(1.0, 0.0), Samples::U8(vec![1; 1000]), Scaling::NONE).unwrap();
        let case = load_plain(&spec, &[("image", shown), ("float", ones)]);
        let found = case.checks.into_iter().find(|check| check.code == "image-not-finite");
        found.map(|check| (check.severity, check.message))
    };
    let mut values = vec![2.0; 1000];
    assert_eq!(found(values.clone()), None);
    values[7] = f32::NAN;
    values[8] = f32::INFINITY;
    let (severity, text) = found(values).unwrap();
    assert_eq!(severity, Severity::Note);
    assert!(text.contains("found 2 of 1000 voxels"), "{text}");
    assert_eq!(found(vec![f32::NAN; 1000]).unwrap().0, Severity::Warning);
}

#[test]
fn cancelling_and_failed_reads_abort_loading() {
    let spec = case_of(vec![], vec![mask("A", "a", None)]);
    let progress = Progress::new();
    progress.cancel();
    let read = |_: &Source| -> Result<Loaded, FileError> { panic!("read after cancel") };
    assert_eq!(
        load_with(&spec, &LoadOptions::default(), &progress, &read),
        Err(CaseError::Cancelled(Cancelled))
    );
    let missing = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap_err().to_string();
    assert!(missing.starts_with("a: found ") || missing.contains("a: found"), "{missing}");
}

#[test]
fn the_report_has_the_documented_keys() {
    let files = [("a", boxed(&grid(2.0, -5.0), 1, 4)), ("b", boxed(&grid(2.0, -5.0), 2, 5))];
    let case = load_plain(&case_of(vec![], vec![mask("A", "a", None), mask("B", "b", None)]), &files);
    let json = serde_json::to_value(measure::report(&case)).unwrap();
    assert_eq!(json["case"], "made");
    assert_eq!(json["grid"]["dims"], serde_json::json!([10, 10, 10]));
    assert_eq!(json["grid"]["spacing_mm"], serde_json::json!([2.0, 2.0, 2.0]));
    let rows = serde_json::json!([
        [2.0, 0.0, 0.0, -5.0],
        [0.0, 2.0, 0.0, -5.0],
        [0.0, 0.0, 2.0, -5.0],
        [0.0, 0.0, 0.0, 1.0]
    ]);
    assert_eq!(json["grid"]["world_from_voxel"], rows);
    let time = &json["time_points"][0];
    assert_eq!(time["time"], "");
    assert_eq!(time["masks"][0]["id"], "A");
    assert_eq!(time["masks"][0]["native_voxels"], 27);
    // 27 + 27 - 8 voxels of 8 mm³.
    let last = &time["regions"][2];
    assert_eq!((&last["masks"], &last["voxels"]), (&serde_json::json!(["A", "B"]), &serde_json::json!(8)));
    assert!((last["volume_ml"].as_f64().unwrap() - 0.064).abs() < 1e-12);
    assert!((last["share"].as_f64().unwrap() - 8.0 / 46.0).abs() < 1e-12);
    assert!((time["pairs"][0]["dice"].as_f64().unwrap() - 16.0 / 54.0).abs() < 1e-12);
    assert!(json["warnings"].as_array().unwrap().is_empty());
}
