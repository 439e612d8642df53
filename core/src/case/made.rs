//! Masks made from others of an open case: a consensus, the part inside a lens, one piece.

use std::sync::Arc;

use super::{Case, CaseMask, TimePoint, names::at_time};
use crate::{Check, Grid, Mask, Progress, Regions, TumorIndex, resample, tumor_index::MAX_MASKS};

/// A mask made from others.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeMask {
    /// Its id and its voxels, on the grid that it was made on.
    pub mask: Mask,
    /// The label of the date that it belongs to.
    pub time: String,
    /// What it was made of and by whom, in words.
    pub provenance: String,
}

impl Case {
    /// This case with masks made from its own, each the last of its date. What can't be added is left out with a warning;
    /// the others have a note with their provenance.
    ///
    /// An id that its date has already, a date that the case lacks, and masks beyond 32 of a date can't be added. A mask of
    /// another grid than the case's is resampled as [`resample::mask_onto`] does; voxels outside are a warning.
    #[must_use]
    pub fn with_made_masks(&self, made: &[MadeMask]) -> Self {
        let mut case = self.clone();
        let mut checks = Vec::new();
        for made in made {
            match self.time_at(&made.time).map(|time| add(&mut case.time_points[time], &self.grid, made)) {
                Some(Ok(found)) => checks.extend(found),
                Some(Err(why)) => checks.push(left_out(made, &why)),
                None => checks.push(left_out(made, "the case has no such date")),
            }
        }
        for (time_point, before) in case.time_points.iter_mut().zip(&self.time_points) {
            if time_point.masks.len() == before.masks.len() {
                continue;
            }
            let masks: Vec<&Mask> = time_point.masks.iter().map(|mask| &mask.mask).collect();
            // Masks on the case grid, of different ids, at most 32.
            let Ok(index) = TumorIndex::new(self.grid.clone(), &masks) else {
                time_point.clone_from(before);
                continue;
            };
            time_point.regions = Arc::new(Regions::of(&index));
            time_point.index = Arc::new(index);
        }
        case.checks.extend(checks);
        case.checks.sort_by_key(|check| std::cmp::Reverse(check.severity));
        case
    }
}

fn left_out(made: &MadeMask, why: &str) -> Check {
    let name = at_time(made.mask.id(), &made.time);
    Check::warning("made-mask-left-out", format!("{name}: a mask made in this program is left out, as {why}"))
}

/// Adds a mask to its date.
fn add(time_point: &mut TimePoint, grid: &Grid, made: &MadeMask) -> Result<Vec<Check>, String> {
    let id = made.mask.id();
    if time_point.masks.iter().any(|mask| mask.mask.id() == id) {
        return Err(format!("the date has another mask {id}"));
    }
    if time_point.masks.len() >= MAX_MASKS {
        return Err(format!("the date has {MAX_MASKS} masks"));
    }
    let name = at_time(id, &made.time);
    let mut checks = vec![Check::note("made-mask", format!("{name}: made {}", made.provenance))];
    let native = made.mask.grid();
    let bits = if native == grid {
        made.mask.bits().clone()
    } else {
        let outside = resample::voxels_outside(&made.mask, &[grid]);
        if outside > 0 {
            let text = format!(
                "{name}: found {outside} voxels outside the case grid, expected none; they are left out"
            );
            checks.push(Check::warning("made-mask-cut", text));
        }
        resample::mask_onto(&made.mask, grid, &Progress::new()).map_err(|cancelled| cancelled.to_string())?
    };
    let mask = Mask::new(id, grid.clone(), bits).ok_or("its grid is another one")?;
    time_point.masks.push(CaseMask {
        mask,
        frame_of_reference: String::new(),
        native_grid: native.clone(),
        native_voxels: made.mask.voxels(),
        native_volume_ml: made.mask.volume_ml(),
        expected_volume_ml: None,
        color: None,
        name: None,
    });
    Ok(checks)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        MaskBits, Severity,
        case::{CaseSpec, LoadOptions},
        sample,
    };

    fn sample() -> Case {
        let spec: CaseSpec = sample::sample_spec();
        super::super::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap()
    }

    fn made(case: &Case, id: &str, time: usize, active: impl FnMut(usize) -> bool) -> MadeMask {
        let bits = MaskBits::from_fn(case.grid.dims(), active);
        let mask = Mask::new(id, case.grid.clone(), bits).unwrap();
        MadeMask { mask, time: case.time_points[time].label.clone(), provenance: "by hand".into() }
    }

    #[test]
    fn a_majority_is_a_mask_like_any_other() {
        let case = sample();
        let first = &case.time_points[0];
        let masks = first.masks.len();
        let majority = made(&case, "majority", 0, |at| first.index.get(at).count_ones() >= 2);
        let expected: u64 =
            first.regions.list().iter().filter(|r| r.mask_count() >= 2).map(|r| r.voxels).sum();
        assert!(expected > 0);
        let with = case.with_made_masks(&[majority]);
        let regions = &with.time_points[0].regions;
        assert_eq!(regions.mask_ids().last().unwrap(), "majority");
        assert_eq!(regions.mask_voxels(masks), expected);
        for k in 0..masks {
            assert_eq!(regions.mask_voxels(k), first.regions.mask_voxels(k), "the others are unchanged");
        }
        // Every voxel of two masks or more has the new bit, no other has it.
        for region in regions.list() {
            let own = region.bits & !(1 << masks);
            assert_eq!(region.bits >> masks & 1 == 1, own.count_ones() >= 2, "{:b}", region.bits);
        }
        assert!(with.checks.iter().any(|c| c.code == "made-mask" && c.severity == Severity::Note));
        assert_eq!(with.time_points[1..], case.time_points[1..]);
        assert_eq!(case.with_made_masks(&[]), case);
    }

    #[test]
    fn what_can_not_be_added_is_said_and_the_rest_is() {
        let case = sample();
        let taken = case.time_points[0].masks[0].mask.id().to_owned();
        let elsewhere = MadeMask { time: "1970-01-01".into(), ..made(&case, "x", 0, |_| true) };
        let good = made(&case, "good", 0, |at| at == 0);
        let with = case.with_made_masks(&[made(&case, &taken, 0, |_| true), elsewhere, good.clone(), good]);
        let left_out = with.checks.iter().filter(|c| c.code == "made-mask-left-out").count();
        assert_eq!((left_out, with.time_points[0].masks.len()), (3, case.time_points[0].masks.len() + 1));
        let many: Vec<_> = (0..40).map(|n| made(&case, &format!("m{n}"), 0, |at| at == n)).collect();
        let with = case.with_made_masks(&many);
        assert_eq!(with.time_points[0].masks.len(), MAX_MASKS);
    }

    #[test]
    fn a_mask_of_another_grid_is_brought_onto_the_case_grid() {
        let case = sample();
        let dims = case.grid.dims();
        // The same box, moved by two voxels along x: two layers of it lie outside.
        let shift = glam::DAffine3::from_translation(DVec3::X * 2.0);
        let grid = Grid::new(dims, case.grid.world_from_voxel() * shift, case.grid.sides()).unwrap();
        let mask = Mask::new("m", grid.clone(), MaskBits::full(dims)).unwrap();
        let time = case.time_points[0].label.clone();
        let with = case.with_made_masks(&[MadeMask { mask, time, provenance: String::new() }]);
        let added = with.time_points[0].masks.last().unwrap();
        let [x, y, z] = dims.map(|n| n as u64);
        assert_eq!((added.native_voxels, added.mask.voxels()), (x * y * z, (x - 2) * y * z));
        assert!(
            with.checks
                .iter()
                .any(|c| c.code == "made-mask-cut" && c.message.contains(&(2 * y * z).to_string()))
        );

        // What lies in both boxes is all there, and nothing is said about voxels outside.
        let middle = dims.map(|n| n / 2);
        let mut bits = MaskBits::empty(dims);
        bits.set(middle);
        let mask = Mask::new("middle", grid, bits).unwrap();
        let time = case.time_points[0].label.clone();
        let with = case.with_made_masks(&[MadeMask { mask, time, provenance: String::new() }]);
        let added = with.time_points[0].masks.last().unwrap();
        assert!(added.mask.bits().get([middle[0] + 2, middle[1], middle[2]]));
        assert_eq!((added.mask.voxels(), with.checks.iter().any(|c| c.code == "made-mask-cut")), (1, false));
    }
}
