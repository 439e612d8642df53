//! What becomes of lesions.

use std::{collections::BTreeMap, time::Instant};

use crate::{
    Components, Connectivity, MaskBits, Sides,
    case::{CaseGridChoice, load},
    glam::{DAffine3, DMat3},
    optics::random::Random,
    sample,
};
use proptest::prelude::*;

use super::{
    super::{
        links::{LinkedBy, overlaps},
        parts::CaseRun,
    },
    EventKind::{Born, Continued, Gone, ManyToMany, Merged, Split},
    *,
};

#[test]
fn one_lesion_grows() {
    let case = case(&[&[([5, 5, 5], [6, 6, 6])], &[([5, 5, 5], [6, 6, 12])], &[([5, 5, 4], [12, 6, 12])]]);
    let report = reported(&case, &[]);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Continued, DATES[2], "A")]);
    assert_eq!(voxels(&report, 0), [Some(216.0), Some(432.0), Some(864.0)]);
    // Doubles every ten days, exactly.
    let growth = report.lesions[0].series.growth.unwrap();
    assert!((growth.doubling_days.unwrap() - 10.0).abs() < 1e-9 && growth.halving_days.is_none());
    assert!(growth.standard_error.unwrap() < 1e-9 && growth.dates == 3);
    assert_eq!(report.total, report.lesions[0].series);
    let first = &report.lesions[0].dates[0];
    let part = &first.parts[0];
    assert_eq!((part.voxels, part.centroid_mm, part.extent_mm), (216, DVec3::splat(7.5), DVec3::splat(6.0)));
    let diagonal = 6.0 * 2.0_f64.sqrt();
    assert!((first.d1_mm.unwrap() - diagonal).abs() < 1e-9 && (first.d2_mm.unwrap() - diagonal).abs() < 1e-9);
    assert!((first.product_mm2.unwrap() - 72.0).abs() < 1e-9 && first.measurable == Some(false));
    assert_eq!((first.events.as_slice(), first.state), (&[][..], None));
    // 12 by 6 mm in the axial plane: D1 13.4, D2 6.7.
    let last = &report.lesions[0].dates[2];
    assert!((last.d1_mm.unwrap() - 180.0_f64.sqrt()).abs() < 1e-9);
    assert_eq!((last.state, report.links[0].overlap_ml), (Some(LinkState::Proposed), Some(0.216)));
    assert_eq!(report.dates[1].on_native_grid, Some(true));
    assert!(report.warnings.is_empty() && report.edits_not_applied.is_empty());
}

#[test]
fn lesions_are_born_and_go() {
    let (a, b) = (cube(2, 2, 2), cube(20, 20, 2));
    let report = reported(&case(&[&[a], &[a, b], &[b], &[]]), &[]);
    let expected = [
        (Continued, DATES[1], "A"),
        (Born, DATES[1], "B"),
        (Gone, DATES[2], "A"),
        (Continued, DATES[2], "B"),
        (Gone, DATES[3], "B"),
    ];
    assert_eq!(events(&report), expected);
    assert_eq!(voxels(&report, 0), [Some(216.0), Some(216.0), Some(0.0), Some(0.0)]);
    assert_eq!(voxels(&report, 1), [Some(0.0), Some(216.0), Some(216.0), Some(0.0)]);
    assert_eq!(report.total.points[3].volume_ml, Some(0.0));
    assert_eq!(report.dates[3].components, Some(0));
    let gone = &report.lesions[0].dates[2];
    assert_eq!((gone.d1_mm, gone.measurable, gone.events.as_slice()), (None, None, &[Gone][..]));
}

#[test]
fn lesions_split_and_merge() {
    let (whole, left, right) = (([5, 5, 5], [20, 6, 6]), ([5, 5, 5], [8, 6, 6]), ([15, 5, 5], [10, 6, 6]));
    let report = reported(&case(&[&[whole], &[left, right], &[whole]]), &[]);
    assert_eq!(events(&report), [(Split, DATES[1], "A"), (Merged, DATES[2], "A")]);
    assert_eq!((report.lesions.len(), report.lesions[0].dates[1].parts.len()), (1, 2));
    assert_eq!(voxels(&report, 0), [Some(720.0), Some(648.0), Some(720.0)]);
    // The pieces' products add up; the diameters are those of the larger.
    let split = &report.lesions[0].dates[1];
    let sum: f64 = split.parts.iter().map(|part| part.diameters.product_mm2).sum();
    assert!((split.product_mm2.unwrap() - sum).abs() < 1e-9);
    assert!((split.d1_mm.unwrap() - 10.0_f64.hypot(6.0)).abs() < 1e-9);
}

#[test]
fn many_become_many() {
    // Two bars along x become two along y that cross both.
    let along_x = [([2, 4, 5], [20, 4, 4]), ([2, 14, 5], [20, 4, 4])];
    let along_y = [([4, 2, 5], [4, 20, 4]), ([14, 2, 5], [4, 20, 4])];
    let report = reported(&case(&[&along_x, &along_y]), &[]);
    assert_eq!(events(&report), [(ManyToMany, DATES[1], "A")]);
    assert_eq!((report.links.len(), report.lesions.len()), (4, 1));
    assert!(report.links.iter().all(|link| link.overlap_ml == Some(0.064)));
}

#[test]
fn flecks_are_kept_but_make_no_events() {
    let whole = ([5, 5, 5], [10, 6, 6]);
    let fleck = |x| ([x, 5, 5], [1, 1, 1]);
    // At the second date a fleck has come off, and another is new; at the third both are gone.
    let second = [([5, 5, 5], [8, 6, 6]), fleck(14), ([30, 30, 10], [2, 2, 2])];
    let report = reported(&case(&[&[whole], &second, &[whole]]), &[]);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Continued, DATES[2], "A")]);
    assert_eq!(report.lesions.iter().map(|lesion| lesion.small).collect::<Vec<_>>(), [false, true]);
    assert_eq!((report.dates[1].components, report.dates[1].small), (Some(3), Some(2)));
    assert_eq!(report.total.points[1].volume_ml, Some(0.297));
    // A fleck that overlaps two lesions joins none.
    let two = [([0, 0, 0], [6, 6, 6]), ([7, 0, 0], [6, 6, 6])];
    let bridge = [([5, 0, 0], [4, 3, 3])];
    let report = reported(&case(&[&two, &bridge]), &[]);
    assert_eq!((report.lesions.len(), report.links.len()), (2, 1));
    assert_eq!(events(&report), [(Gone, DATES[1], "A"), (Continued, DATES[1], "B")], "the larger overlap");
    // What shrinks to a fleck and then goes is gone.
    let report = reported(&case(&[&[whole], &[fleck(7)], &[]]), &[]);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Gone, DATES[2], "A")]);
    // Where every size counts, flecks do.
    let all = Options { smallest_ml: 0.0, ..options() };
    let report = with_options(&case(&[&[whole], &second]), &all).unwrap();
    assert_eq!(events(&report), [(Split, DATES[1], "A"), (Born, DATES[1], "B")]);
}

#[test]
fn what_moved_a_little_is_linked_by_distance() {
    // Faces 3 mm apart: centres of voxels 3 + 1.
    let report = reported(&case(&[&[cube(2, 2, 2)], &[cube(11, 2, 2)]]), &[]);
    assert_eq!(report.links.len(), 1);
    assert_eq!((report.links[0].by, report.links[0].distance_mm), (LinkedBy::Distance, Some(4.0)));
    assert_eq!(events(&report), [(Continued, DATES[1], "A")]);
    let report = reported(&case(&[&[cube(2, 2, 2)], &[cube(12, 2, 2)]]), &[]);
    assert_eq!(events(&report), [(Gone, DATES[1], "A"), (Born, DATES[1], "B")]);
    // Not where something overlaps.
    let report = reported(&case(&[&[cube(2, 2, 2)], &[cube(2, 2, 2), cube(11, 2, 2)]]), &[]);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Born, DATES[1], "B")]);
}

#[test]
fn dates_in_two_frames_of_reference_are_not_linked() {
    let mut made = case(&[&[cube(2, 2, 2)], &[cube(2, 2, 2)], &[cube(2, 2, 2)]]);
    for (date, frame) in [(0, "1.2"), (1, "1.3"), (2, "1.3")] {
        made.time_points[date].masks[0].frame_of_reference = frame.into();
    }
    let report = reported(&made, &[]);
    let reason = report.pairs[0].not_linked.as_deref().unwrap();
    assert!(reason.contains("frames of reference") && report.pairs[1].not_linked.is_none());
    assert_eq!(events(&report), [(Continued, DATES[2], "B")]);
    // What isn't known isn't 0.
    assert_eq!(voxels(&report, 0), [Some(216.0), None, None]);
    assert_eq!(voxels(&report, 1), [None, Some(216.0), Some(216.0)]);
    // The user can say which is which.
    let link = Edit::Link { from: anchor(0, [4.0; 3]), to: anchor(1, [4.0; 3]) };
    let report = reported(&made, &[link]);
    assert_eq!(voxels(&report, 0), [Some(216.0); 3]);
    assert_eq!((report.lesions.len(), report.links[0].by), (1, LinkedBy::Edit));
    assert_eq!((report.links[0].overlap_ml, report.links[0].state), (None, LinkState::Edited));
}

#[test]
fn dates_whose_order_is_unknown_are_not_linked() {
    let masks = ["alpha", "beta"].map(|time| ("M", time, volume(&grid(), &[cube(2, 2, 2)])));
    let made = case_of(&masks, &LoadOptions::default());
    let report = reported(&made, &[]);
    assert!(report.pairs[0].not_linked.as_deref().unwrap().contains("order"));
    assert!(report.links.is_empty() && report.events.is_empty());
    assert_eq!((report.dates[0].days, report.lesions[0].series.growth), (None, None));
}

#[test]
fn a_date_without_the_mask_is_unknown_and_one_with_an_empty_mask_is_not() {
    let a = [cube(2, 2, 2)];
    let masks = [
        ("M", DATES[0], volume(&grid(), &a)),
        ("N", DATES[1], volume(&grid(), &a)),
        ("M", DATES[2], volume(&grid(), &a)),
        ("M", DATES[3], volume(&grid(), &[])),
    ];
    let made = case_of(&masks, &LoadOptions::default());
    let report = reported(&made, &[]);
    assert_eq!(voxels(&report, 0), [Some(216.0), None, Some(216.0), Some(0.0)]);
    assert_eq!((report.dates[1].components, report.dates[3].components), (None, Some(0)));
    assert_eq!(events(&report), [(Continued, DATES[2], "A"), (Gone, DATES[3], "A")]);
    assert_eq!((report.pairs[0].from.as_str(), report.pairs[0].to.as_str()), (DATES[0], DATES[2]));
    let error = with_options(&made, &Options::new(Of::Mask("X".into()))).unwrap_err();
    assert_eq!(error.to_string(), "made: found no mask X at any date, expected one of M, N");
    let union = Options::new(Of::Union(vec!["N".into(), "M".into()]));
    let report = with_options(&made, &union).unwrap();
    assert_eq!((report.of.as_str(), report.dates[1].components), ("M+N", Some(1)));
    assert_eq!(report.warnings.len(), 4, "each date lacks one of both");
}

/// A mask on thick slices beside one on a fine grid: measured on its own, linked on the case grid.
#[test]
fn lesions_are_measured_on_their_native_grid() {
    let thick =
        Grid::axis_aligned([20, 20, 4], DVec3::new(2.0, 2.0, 5.0), DVec3::new(0.5, 0.5, 2.0)).unwrap();
    let of = |boxes: &[Box3]| volume(&thick, boxes);
    let masks = [
        ("M", DATES[0], of(&[([2, 2, 1], [6, 6, 2])])),
        ("M", DATES[1], of(&[([2, 2, 1], [6, 6, 2]), ([12, 12, 0], [3, 3, 1])])),
        ("N", DATES[0], volume(&grid(), &[cube(0, 0, 0)])),
    ];
    let made = case_of(&masks, &LoadOptions::default());
    assert_eq!(made.grid.spacing_mm(), DVec3::ONE);
    let report = reported(&made, &[]);
    assert_eq!(report.dates[1].on_native_grid, Some(true));
    let part = &report.lesions[0].dates[0].parts[0];
    assert_eq!((part.voxels, part.diameters.slices, part.diameters.slice_thickness_mm), (72, 2, 5.0));
    assert!((part.volume_ml - 1.44).abs() < 1e-12 && part.measurable);
    assert!((report.links[0].overlap_ml.unwrap() - 1.44).abs() < 1e-12);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Born, DATES[1], "B")]);
    // On a coarser case grid the mask can't be restored, and that is said.
    let coarse = LoadOptions { case_grid: CaseGridChoice::Of("M".into()), ..LoadOptions::default() };
    let made = case_of(&masks, &coarse);
    let found = with_options(&made, &Options::new(Of::Mask("N".into()))).unwrap();
    assert_eq!((found.dates[0].on_native_grid, found.warnings.len()), (Some(false), 1));
}

/// A grid turned against the case grid, whose voxels are larger: the same components.
#[test]
fn turned_grids_are_measured_on_their_own() {
    let m = DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(3.0, 3.0, 4.0));
    let affine = DAffine3 { matrix3: m, translation: DVec3::new(12.0, 3.0, 2.0) };
    let turned = Grid::new([8, 8, 4], affine, Sides::Known).unwrap();
    let boxes = [([0, 0, 0], [2, 2, 2]), ([4, 4, 1], [3, 3, 2])];
    let masks = [
        ("M", DATES[0], volume(&turned, &boxes)),
        ("M", DATES[1], volume(&turned, &boxes)),
        ("N", DATES[0], volume(&grid(), &[cube(0, 0, 0)])),
    ];
    let made = case_of(&masks, &LoadOptions::default());
    let report = reported(&made, &[]);
    assert_eq!(report.dates[0].on_native_grid, Some(true), "{:?}", report.warnings);
    let counts: Vec<u64> = report.lesions.iter().map(|lesion| lesion.dates[0].parts[0].voxels).collect();
    assert_eq!(counts, [18, 8]);
    assert_eq!(events(&report), [(Continued, DATES[1], "A"), (Continued, DATES[1], "B")]);
}

/// Labels of voxels, and runs of the same, of random masks.
fn random_runs(seed: u64, dims: [usize; 3], share: f64) -> (Vec<u32>, Vec<CaseRun>) {
    let bits = MaskBits::from_fn(dims, |l| Random::new(seed, l as u64).unit() < share);
    let components = Components::of_mask(&bits, Connectivity::TwentySix).unwrap();
    let mut runs = Vec::new();
    for (part, component) in (0..).zip(components.list()) {
        runs.extend(components.runs(component).iter().map(|run| CaseRun {
            line: run.z as usize * dims[1] + run.y as usize,
            first: run.first,
            last: run.last,
            part,
        }));
    }
    runs.sort_unstable();
    (components.labels(dims), runs)
}

proptest! {
    #[test]
    fn overlaps_agree_with_counting_voxels(
        seed in any::<u64>(), dims in [1_usize..40, 1_usize..6, 1_usize..5], share in 0.05_f64..0.6,
    ) {
        let (labels_a, a) = random_runs(seed, dims, share);
        let (labels_b, b) = random_runs(seed ^ 1, dims, share);
        let mut counted: BTreeMap<(u32, u32), u64> = BTreeMap::new();
        for (x, y) in labels_a.iter().zip(&labels_b).filter(|(x, y)| **x > 0 && **y > 0) {
            *counted.entry((x - 1, y - 1)).or_default() += 1;
        }
        prop_assert_eq!(overlaps(&a, &b), counted);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Files and masks in any order, any number of threads.
    #[test]
    fn order_and_threads_change_nothing(seed in any::<u64>()) {
        let random = |stream: u64, n: u64| (Random::new(seed, stream).unit() * n as f64) as usize;
        let masks: Vec<(&str, &str, Volume)> = (0..6)
            .map(|n| {
                let boxes: Vec<Box3> = (0..5)
                    .map(|k| {
                        let at = |axis: u64| random(100 * n + 10 * k + axis, if axis == 2 { 13 } else { 33 });
                        ([at(0), at(1), at(2)], [2 + random(1000 + 10 * n + k, 6), 5, 6])
                    })
                    .collect();
                (["M", "N"][n as usize % 2], DATES[n as usize / 2], volume(&grid(), &boxes))
            })
            .collect();
        let of = |masks: &[(&str, &str, Volume)], threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let made = case_of(masks, &LoadOptions::default());
            let both = [Of::Mask("M".into()), Of::Union(vec!["M".into(), "N".into()])];
            both.map(|of| {
                let found = pool.install(|| report(&made, &Options::new(of), &[], &Progress::new()));
                serde_json::to_string(&found.unwrap()).unwrap()
            })
        };
        let mut shuffled = masks.clone();
        for n in (1..shuffled.len()).rev() {
            shuffled.swap(n, random(5000 + n as u64, n as u64 + 1));
        }
        let first = of(&masks, 1);
        prop_assert_eq!(&first, &of(&shuffled, 1));
        prop_assert_eq!(&first, &of(&masks, 3));
    }
}

/// 2 % of 128³ voxels at random: 31,000 components at each of two dates.
#[test]
fn thirty_thousand_components_are_quick() {
    let grid = Grid::axis_aligned([128; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let speckle = |seed: u64| {
        let stored = (0..128_u64.pow(3)).map(|l| u8::from(Random::new(seed, l).unit() < 0.02)).collect();
        Volume::new(grid.clone(), Samples::U8(stored), Scaling::NONE).unwrap()
    };
    let made = case_of(&[("M", DATES[0], speckle(1)), ("M", DATES[1], speckle(2))], &LoadOptions::default());
    for smallest_ml in [0.1, 0.0] {
        let options = Options { smallest_ml, ..options() };
        let started = Instant::now();
        let found = find(&made, &options, &Progress::new()).unwrap();
        let at_find = started.elapsed().as_secs_f64();
        let tracked = track(&found, &[], &Progress::new()).unwrap();
        let at_track = started.elapsed().as_secs_f64();
        let report = LesionsReport::of(&tracked);
        let seconds = started.elapsed().as_secs_f64();
        println!(
            "smallest {smallest_ml} ml: {:?} components, {} lesions: find {at_find:.3}, track {:.3}, report {:.3} s",
            report.dates.iter().map(|date| date.components).collect::<Vec<_>>(),
            report.lesions.len(),
            at_track - at_find,
            seconds - at_track
        );
        assert!(report.dates.iter().all(|date| date.components.unwrap() > 30_000));
        assert!(seconds < 20.0);
    }
}

/// The rows and the fields of both forms.
#[test]
fn tables_and_json_have_stable_fields() {
    let made = case(&[&[cube(2, 2, 2)], &[]]);
    let report = reported(&made, &[Edit::Name { at: anchor(0, [4.0; 3]), name: "=left".into() }]);
    let text = String::from_utf8(csv(&report)).unwrap();
    let rows: Vec<&str> = text.lines().collect();
    assert_eq!(
        rows[0],
        "lesion,name,date,days,volume_ml,components,d1_mm,d2_mm,product_mm2,measurable,small,event,state,image,mean,max,peak,\
         mean_times_ml,growth_p95_mm,recession_p95_mm"
    );
    assert!(rows[1].starts_with("A,'=left,2024-01-01,0,0.216,1,8.485281374238"), "{}", rows[1]);
    assert_eq!(rows[2], "A,'=left,2024-01-11,10,0,0,,,,,0,gone,,,,,,,,");
    assert_eq!(rows[3..], [",,2024-01-01,0,0.216,1,,,,,,,,,,,,,,", ",,2024-01-11,10,0,0,,,,,,,,,,,,,,"]);
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(
        (&json["lesions"][0]["name"], &json["mode"]),
        (&"=left".into(), &"longest_then_perpendicular".into())
    );
    let part = &json["lesions"][0]["dates"][0]["parts"][0];
    for key in
        ["anchor", "voxels", "volume_ml", "centroid_mm", "extent_mm", "d1", "d2", "product_mm2", "slice"]
    {
        assert!(!part[key].is_null(), "{key}: {part}");
    }
    assert_eq!(part["d1"]["from_mm"].as_array().unwrap().len(), 3);
    assert_eq!(json["events"][0]["kind"], "gone");
}

/// The embedded sample, as it is and with the later dates' images 15 mm off.
#[test]
fn images_that_lie_apart_are_not_linked() {
    let spec = sample::sample_spec();
    let mut made = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
    let options = Options::new(Of::Mask("T1".into()));
    let aligned = with_options(&made, &options).unwrap();
    assert!(aligned.pairs.iter().all(|pair| pair.not_linked.is_none()), "{:?}", aligned.pairs);
    assert!(!aligned.links.is_empty());
    for context in made.time_points[1..].iter_mut().flat_map(|time| &mut time.contexts) {
        let volume = &context.volume;
        let moved = DAffine3::from_translation(DVec3::new(15.0, 0.0, 0.0)) * volume.grid().world_from_voxel();
        let grid = Grid::new(volume.grid().dims(), moved, volume.grid().sides()).unwrap();
        let volume = Volume::new(grid, volume.samples().clone(), volume.scaling()).unwrap();
        context.volume = std::sync::Arc::new(volume);
    }
    let apart = with_options(&made, &options).unwrap();
    let reason = apart.pairs[0].not_linked.as_deref().unwrap();
    assert!(reason.contains("mm apart at the tumour"), "{reason}");
    assert!(apart.links.iter().all(|link| link.from.as_ref().unwrap().time != made.time_points[0].label));
    // Volumes stay.
    assert_eq!(apart.total.points, aligned.total.points);
    let trusting = Options { asks_images: false, ..options };
    let trusted = with_options(&made, &trusting).unwrap();
    assert_eq!(trusted.links, aligned.links);
}

#[test]
fn cancelled_and_impossible_options_are_errors() {
    let made = case(&[&[cube(2, 2, 2)]]);
    let progress = Progress::new();
    progress.cancel();
    assert!(matches!(find(&made, &options(), &progress), Err(LesionsError::Cancelled(_))));
    let wrong = [
        Options { smallest_ml: -1.0, ..options() },
        Options { within_mm: f64::NAN, ..options() },
        Options { axis: Some(3), ..options() },
    ];
    for options in wrong {
        let error = with_options(&made, &options).unwrap_err().to_string();
        assert!(error.starts_with("found ") && error.contains(", expected "), "{error}");
    }
    // One date: no pairs, no events.
    let report = reported(&made, &[]);
    assert!(report.pairs.is_empty() && report.events.is_empty() && report.links.is_empty());
}
