//! The tissue around a lesion of the head phantom, moved by known smooth fields.

use std::sync::Arc;

use glam::DVec3;

use super::{
    Change, ChangeOptions, Choice, NotSaid, Surroundings, TissueCounts, between_with_surroundings, change,
    surroundings as around, surroundings::of_images,
};
use crate::{
    Grid, Mask, MaskBits, Progress, Samples, Scaling, Volume,
    case::Case,
    grid::ijk,
    phantom::{Mark, mark, phantom, phantom_case},
    register::DeformOptions,
    resample::value_at,
};

/// About the middle of the phantom's tumour.
const MIDDLE: DVec3 = DVec3::new(-30.0, 30.0, 20.0);

/// What lies at y of the later date came from `y + back(y)`.
type Back = fn(DVec3) -> DVec3;

const STILL: Back = |_| DVec3::ZERO;
/// 4 mm to the back and upwards, fading over 25 mm.
const PUSHED: Back =
    |y| DVec3::new(0.0, 3.2, -2.4) * (-0.5 * (y - MIDDLE).length_squared() / (25.0 * 25.0)).exp();

/// The two dates of a made case: an image and a mask of each, on the grid of the phantom's T1c.
struct Dates {
    images: [Volume; 2],
    masks: [Mask; 2],
    change: Change,
}

fn drawn(grid: &Grid, inside: impl Fn(DVec3) -> bool) -> Mask {
    let bits = MaskBits::from_fn(grid.dims(), |l| inside(grid.center_of_voxel_mm(ijk(grid.dims(), l))));
    Mask::new("T1", grid.clone(), bits).unwrap()
}

fn painted(grid: &Grid, value: impl Fn(DVec3) -> f64) -> Volume {
    let values = (0..grid.voxel_count()).map(|l| value(grid.center_of_voxel_mm(ijk(grid.dims(), l))) as f32);
    Volume::new(grid.clone(), Samples::F32(values.collect()), Scaling::NONE).unwrap()
}

/// The earlier date, and a later one made from it: moved by `back`, with the lesion `is_lesion` of where it came from.
fn dates(back: Back, is_lesion: impl Fn(&Mark, DVec3) -> bool) -> Dates {
    let earlier = phantom().swap_remove(0).volume;
    let grid = earlier.grid().clone();
    let lesion = mark("T1", 0).unwrap();
    let to_voxel = grid.voxel_from_world();
    let later = painted(&grid, |y| value_at(&earlier, to_voxel.transform_point3(y + back(y))).unwrap_or(0.0));
    let masks = [drawn(&grid, |p| lesion.contains(p)), drawn(&grid, |y| is_lesion(&lesion, y + back(y)))];
    let options = ChangeOptions { by_skeleton: false, ..ChangeOptions::default() };
    let change = change(masks[0].bits(), masks[1].bits(), &grid, &options, &Progress::new()).unwrap();
    Dates { images: [earlier, later], masks, change }
}

impl Dates {
    fn look(&self) -> Surroundings {
        of_images(
            self.images.each_ref(),
            self.masks.each_ref(),
            &self.change,
            &DeformOptions::default(),
            &Progress::new(),
        )
        .unwrap()
    }
}

/// Over all components.
fn together(found: &Surroundings) -> [TissueCounts; 2] {
    let mut sums = [TissueCounts::default(); 2];
    for report in found.components.iter().flatten() {
        for (sum, of) in sums.iter_mut().zip([report.growth, report.recession]) {
            sum.vectors += of.vectors;
            sum.displaced += of.displaced;
            sum.unknown += of.unknown;
        }
    }
    sums
}

/// Share of what is known that was displaced.
fn of_known(counts: TissueCounts) -> f64 {
    counts.displaced as f64 / (counts.vectors - counts.unknown) as f64
}

#[test]
fn a_lesion_pushed_with_its_tissue_is_marked_displaced() {
    let dates = dates(PUSHED, |lesion, p| lesion.contains(p));
    let found = dates.look();
    assert_eq!(found.report.not_said, None, "{:?}", found.report);
    let [growth, recession] = together(&found);
    println!("pushed: {growth:?} {recession:?} {:?}", found.report);
    assert!(growth.vectors > 200 && recession.vectors > 200, "{growth:?} {recession:?}");
    for counts in [growth, recession] {
        // The phantom's oedema has no texture.
        assert!(of_known(counts) > 0.95 && 4 * counts.unknown < counts.vectors, "{counts:?}");
    }
    let moved_mm = found.components[0].unwrap().moved_mm.unwrap();
    assert!((1.5..4.0).contains(&moved_mm), "{moved_mm}");
    assert_eq!(found.components[0].unwrap().moved(), Some(true));
}

#[test]
fn a_lesion_that_grows_or_shrinks_in_still_tissue_is_not_marked() {
    for by_mm in [4.0, -4.0] {
        let found =
            dates(STILL, |lesion, p| lesion.parts.iter().any(|part| part.distance_mm(p) <= by_mm)).look();
        assert_eq!(found.report.not_said, None, "{:?}", found.report);
        let [growth, recession] = together(&found);
        println!("grown by {by_mm}: {growth:?} {recession:?}");
        let counts = if by_mm > 0.0 { growth } else { recession };
        assert!(counts.vectors > 1000, "{counts:?}");
        assert!(counts.displaced == 0 && 3 * counts.unknown < counts.vectors, "{counts:?}");
    }
}

/// The tissue is pushed to the back, the lesion grows by 6 mm on the other side, and by none elsewhere.
#[test]
fn growth_beyond_what_the_tissue_moved_is_not_marked() {
    let front = |p: DVec3| p.y > 44.0;
    let dates = dates(PUSHED, |lesion, p| {
        lesion.parts.iter().any(|part| part.distance_mm(p) <= if front(p) { 6.0 } else { 0.0 })
    });
    let found = dates.look();
    let [mut at_front, mut behind] = [TissueCounts::default(); 2];
    for (vector, tissue) in dates.change.vectors.iter().zip(&found.tissue) {
        // Between the two the lesion's growth ends in a step.
        let counts = match vector.from_mm.y {
            y if y > 46.0 => &mut at_front,
            y if y < 34.0 => &mut behind,
            _ => continue,
        };
        counts.add(*tissue);
    }
    println!("front {at_front:?}, behind {behind:?}");
    assert!(at_front.vectors - at_front.unknown > 300 && at_front.displaced == 0, "{at_front:?}");
    assert!(behind.vectors > 500 && of_known(behind) > 0.9, "{behind:?}");
}

#[test]
fn without_texture_it_is_said_that_nothing_can_be_said() {
    let mut dates = dates(PUSHED, |lesion, p| lesion.contains(p));
    let grid = dates.images[0].grid().clone();
    dates.images = [0, 1].map(|_| painted(&grid, |_| 90.0));
    let found = dates.look();
    assert_eq!(found.report.not_said, Some(NotSaid::TooLittleInCommon));
    assert!(found.report.why.unwrap().contains("constant") && found.tissue.is_empty());
}

/// The sample's tumour grows and shrinks by known millimetres, its oedema too; no tissue moves.
#[test]
fn in_the_sample_nothing_was_displaced_and_what_is_missing_is_said() {
    let case = phantom_case().unwrap();
    let choice = Choice::resolve(&case, Some("T1"), None, None).unwrap();
    let look = |case: &Case| {
        let options = ChangeOptions { by_skeleton: false, ..ChangeOptions::default() };
        between_with_surroundings(case, &choice, &options, None, &Progress::new()).unwrap()
    };
    let (report, change, found) = look(&case);
    assert_eq!(found.report.image.as_deref(), Some("T1c"), "{:?}", found.report);
    assert_eq!(report.surroundings.as_ref(), Some(&found.report));
    let [growth, recession] = together(&found);
    println!("sample: {growth:?} {recession:?} {:?}", found.report);
    assert!(growth.vectors + recession.vectors > 200);
    assert!(growth.displaced + recession.displaced <= (growth.vectors + recession.vectors) / 50);
    assert_eq!(report.components[0].tissue, found.components[0]);

    let why = |case: &Case| {
        around(case, &choice, &change, &DeformOptions::default(), &Progress::new()).unwrap().report
    };
    let mut missing = case.clone();
    missing.time_points[1].contexts.clear();
    assert_eq!(why(&missing).not_said, Some(NotSaid::NoImage));
    assert_eq!(why(&missing).why.unwrap(), "2024-04-15 has no image");
    let mut other = case.clone();
    other.time_points[1].contexts.retain(|c| c.id == "FLAIR");
    other.time_points[0].contexts.retain(|c| c.id == "T1c");
    assert_eq!(why(&other).not_said, Some(NotSaid::OtherSequence));
    // The first image shows nothing: the next that both have is asked.
    let mut flat = case.clone();
    for time in &mut flat.time_points {
        let grid = time.contexts[0].volume.grid().clone();
        time.contexts[0].volume = Arc::new(painted(&grid, |_| 1.0));
    }
    let asked = why(&flat);
    assert_eq!((asked.image.as_deref(), asked.not_said), (Some("FLAIR"), None));
    let mut same = case;
    same.time_points[1].masks = same.time_points[0].masks.clone();
    let (report, ..) = look(&same);
    assert_eq!(report.surroundings.unwrap().not_said, Some(NotSaid::NothingMoved));
}
