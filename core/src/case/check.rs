//! Checks of a case: each finding has a code listed in `docs/checks.md`.

use glam::DVec3;

use super::{CaseMask, CaseSpec, OrderBasis, names::at_time, native::NativeMask, values::Meaning};
use crate::{
    Check, Components, Connectivity, Grid, Mask, Regions, Sides, Volume,
    dates::{is_shaped_as_date, iso_date},
    decimal,
    grid::ijk,
    resample,
};

/// Volume change of a resampled mask, in per cent, above which the finding is a warning instead of a note.
pub const DRIFT_WARNING_PERCENT: f64 = 5.0;

fn spacing(grid: &Grid) -> String {
    format!("{} mm", grid.spacing_mm().to_array().map(|s| decimal::text(s, 2)).join("×"))
}

fn list(labels: &[i64]) -> String {
    let words: Vec<String> = labels.iter().map(i64::to_string).collect();
    format!("{} {}", if labels.len() == 1 { "label" } else { "labels" }, words.join(", "))
}

/// How far a value may lie from a label, where that is more than rounding.
fn within(m: &NativeMask) -> String {
    if m.label_tolerance > 0.01 {
        format!(" within {} of its value", decimal::text(m.label_tolerance, 3))
    } else {
        String::new()
    }
}

/// `part` of `whole` in per cent; never rounded to 0 or 100 unless exact. `part` is above 0.
fn percent(part: u64, whole: u64) -> String {
    if part == whole {
        return "all".into();
    }
    let exact = 100.0 * part as f64 / whole as f64;
    if exact < 0.1 {
        "less than 0.1 %".into()
    } else if exact > 99.9 {
        "more than 99.9 %".into()
    } else {
        format!("{exact:.1} %")
    }
}

/// A note where masks lie outside the chosen grid, so that the case grid is larger.
pub(super) fn extended(chosen: &Grid, whole: &Grid, id: &str) -> Option<Check> {
    let [a, b, c] = chosen.dims();
    let [x, y, z] = whole.dims();
    let text = format!(
        "case grid: found masks outside the grid of {id} ({a}x{b}x{c} voxels); extended to {x}x{y}x{z} so that it covers them"
    );
    (chosen != whole).then(|| Check::note("case-grid-extended", text))
}

/// The order of time points: a note where it isn't that in which the case lists them, a warning where it is unknown.
pub(super) fn time_order(listed: &[String], ordered: &[String], basis: OrderBasis) -> Option<Check> {
    let names = ordered.join(", ");
    if basis == OrderBasis::Unknown {
        let text = format!(
            "times: found {names}, whose order isn't stated, expected dates, numbers, stages such as pre and post, or a \
             stated order (--order, or order in the manifest)"
        );
        return Some(Check::warning("time-order-unknown", text));
    }
    let text = format!("times: in time order, {names}; listed as {}", listed.join(", "));
    (listed != ordered).then(|| Check::note("time-order", text))
}

/// Masks of one id that are called differently at different dates: labels of two schemes, most often.
pub(super) fn names(spec: &CaseSpec) -> Vec<Check> {
    let mut seen: Vec<(&str, Vec<&str>)> = Vec::new();
    for mask in &spec.masks {
        let Some(name) = mask.name.as_deref() else { continue };
        match seen.iter_mut().find(|(id, _)| *id == mask.id) {
            Some((_, names)) if names.contains(&name) => {}
            Some((_, names)) => names.push(name),
            None => seen.push((&mask.id, vec![name])),
        }
    }
    let differ = seen.into_iter().filter(|(_, names)| names.len() > 1);
    let text = |(id, names): (&str, Vec<&str>)| {
        let names: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        format!(
            "{id}: found the names {}, expected one mask: dates are compared by the id",
            names.join(" and ")
        )
    };
    differ.map(text).map(|text| Check::warning("mask-names-differ", text)).collect()
}

fn contents(spec: &CaseSpec, m: &NativeMask, name: &str, checks: &mut Vec<Check>) {
    let labels = spec.masks[m.spec].labels.as_deref();
    if labels.is_some_and(|labels| labels.contains(&0)) {
        let text =
            format!("{name}: found label 0, the background in most files, expected labels of a tumour");
        checks.push(Check::warning("mask-of-background", text));
    }
    if m.mask.bits().bounds().is_none() {
        let why = match labels {
            Some(labels) => format!("no voxel has {}{}", list(labels), within(m)),
            None => match (spec.masks[m.spec].above, m.meaning) {
                (Some(above), _) => format!("no voxel is above {above}"),
                (None, Some(Meaning::Soft { .. })) => "no voxel is above 50 %".into(),
                (None, _) => "no voxel is above 0.5".into(),
            },
        };
        checks.push(Check::warning(
            "mask-empty",
            format!("{name}: found an empty mask ({why}), expected active voxels"),
        ));
    } else if !m.missing_labels.is_empty() {
        let asked = list(labels.unwrap_or_default());
        checks.push(Check::note(
            "label-missing",
            format!("{name}: found no voxel with {}{}, expected {asked}", list(&m.missing_labels), within(m)),
        ));
    }
    match m.meaning {
        Some(Meaning::Soft { full, .. }) => {
            let unit = if full == 1.0 { "0 to 1" } else { "0 to 100, per cent" };
            let expected = decimal::text(m.expected_volume_ml().unwrap_or_default(), 3);
            let above = 100.0 * spec.masks[m.spec].above.map_or(0.5, |above| above / full);
            checks.push(Check::warning(
                "mask-soft",
                format!(
                    "{name}: found a soft mask (probabilities, {unit}), expected labels; active above {} %: {} ml; \
                     the sum of the probabilities is {expected} ml",
                    decimal::text(above, 1),
                    decimal::text(m.mask.volume_ml(), 3)
                ),
            ));
        }
        Some(Meaning::Image) => checks.push(Check::warning(
            "mask-looks-like-image",
            format!(
                "{name}: found many different values, as of an image, expected a mask or labels; every voxel above 0.5 \
                 is active (--context, or [[context]] in the manifest, if it is an image)"
            ),
        )),
        None => {}
    }
    if m.invalid > 0 {
        let text = |found: &str, expected: &str| {
            format!("{name}: found {} voxels {found}, expected {expected}; they are inactive", m.invalid)
        };
        checks.push(match labels {
            Some(_) => {
                Check::warning("non-integer-label-map", text("that are no whole number", "a label map"))
            }
            None => Check::warning("mask-not-finite", text("that are NaN or infinite", "numbers")),
        });
    }
}

fn sides(spec: &CaseSpec, masks: &[NativeMask], images: &[(usize, &str, &Grid)]) -> Vec<Check> {
    let of_masks = masks.iter().map(|m| (spec.masks[m.spec].id.as_str(), m.mask.grid().sides()));
    let mut all: Vec<(&str, Sides)> = images.iter().map(|(_, id, grid)| (*id, grid.sides())).collect();
    all.extend(of_masks);
    let ids = |which: Sides| {
        let mut ids: Vec<&str> = Vec::new();
        for (id, _) in all.iter().filter(|(_, sides)| *sides == which) {
            if !ids.contains(id) {
                ids.push(id);
            }
        }
        ids.join(", ")
    };
    let (known, unknown) = (ids(Sides::Known), ids(Sides::Unknown));
    let mut checks = Vec::new();
    let of_masks = masks.iter().filter(|m| m.mask.grid().sides() == Sides::Unknown).count();
    if of_masks > 0 {
        checks.push(Check::warning(
            "sides-unknown",
            format!("masks: found {of_masks} of {} without a place in the patient, expected all with one; left and right are unknown", masks.len()),
        ));
    }
    if !unknown.is_empty() && !known.is_empty() {
        checks.push(Check::warning(
            "sides-mixed",
            format!("{unknown}: found no place in the patient, while {known} have one; placed by voxel index times spacing, which is an assumption"),
        ));
    }
    checks
}

/// What of an image's voxels can't be shown.
pub(super) fn image_values(volume: &Volume) -> Option<Check> {
    let (lost, all) = (volume.samples().not_finite(), volume.samples().len());
    let text = format!(
        "found {lost} of {all} voxels that are NaN or infinite, expected numbers; they are not drawn"
    );
    match lost {
        0 => None,
        _ if lost == all => Some(Check::warning("image-not-finite", text)),
        _ => Some(Check::note("image-not-finite", text)),
    }
}

/// Findings on the masks' and images' native grids. `images`: time, id, grid.
pub(super) fn before_resampling(
    spec: &CaseSpec,
    labels: &[String],
    masks: &[NativeMask],
    images: &[(usize, &str, &Grid)],
    (case_grid, case_grid_id): (&Grid, &str),
) -> Vec<Check> {
    let mut checks = sides(spec, masks, images);
    for m in masks {
        let name = at_time(&spec.masks[m.spec].id, &labels[m.time]);
        contents(spec, m, &name, &mut checks);
        let here: Vec<&Grid> = images.iter().filter(|(t, ..)| *t == m.time).map(|(_, _, g)| *g).collect();
        let outside = if here.is_empty() { 0 } else { resample::voxels_outside(&m.mask, &here) };
        if outside > 0 {
            let ml = m.mask.grid().volume_ml(outside);
            let share = percent(outside, m.mask.voxels());
            let text = format!(
                "{name}: found {share} of the mask ({ml:.3} ml) outside every image, expected it inside"
            );
            checks.push(Check::warning("mask-outside-image", text));
        }
    }
    let mut grids: Vec<&Grid> = Vec::new();
    for m in masks {
        if !grids.iter().any(|g| g.same_place(m.mask.grid(), resample::SAME_PLACE_VOXELS)) {
            grids.push(m.mask.grid());
        }
    }
    if grids.len() > 1 {
        checks.push(Check::note(
            "grids-differ",
            format!("masks: found {} different grids, expected one; all are brought onto that of {case_grid_id} ({})", grids.len(), spacing(case_grid)),
        ));
    }
    let mut ids: Vec<&str> = Vec::new();
    for m in &spec.masks {
        if !ids.contains(&m.id.as_str()) {
            ids.push(&m.id);
        }
    }
    for (time, label) in labels.iter().enumerate() {
        let here = |id: &str| masks.iter().any(|m| m.time == time && spec.masks[m.spec].id == id);
        let missing: Vec<&str> = ids.iter().copied().filter(|id| !here(id)).collect();
        if !missing.is_empty() {
            let found = missing.join(", ");
            checks.push(Check::note(
                "mask-not-at-every-time",
                format!("{found}: found no mask at {label}, expected one as at other times; that is unknown, not empty"),
            ));
        }
    }
    for label in labels.iter().filter(|label| is_shaped_as_date(label) && iso_date(label).is_none()) {
        checks.push(Check::warning(
            "date-impossible",
            format!(
                "times: found {label}, expected a day of the calendar; it is taken for a name, not a date"
            ),
        ));
    }
    checks
}

/// Changes of volume by resampling.
pub(super) fn after_resampling(labels: &[String], native: &[NativeMask], on_grid: &[Mask]) -> Vec<Check> {
    let mut checks = Vec::new();
    for (m, after) in native.iter().zip(on_grid) {
        if after.grid().same_place(m.mask.grid(), resample::SAME_PLACE_VOXELS) || m.mask.voxels() == 0 {
            continue;
        }
        let name = at_time(m.mask.id(), &labels[m.time]);
        let (before_ml, after_ml) = (m.mask.volume_ml(), after.volume_ml());
        let drift = 100.0 * (after_ml - before_ml) / before_ml;
        let text = format!(
            "{name}: found a mask on its own grid ({}), expected the case grid ({}); resampled: {before_ml:.3} ml before, {after_ml:.3} ml after ({drift:+.2} %)",
            spacing(m.mask.grid()),
            spacing(after.grid()),
        );
        let lost = lost_parts(&m.mask, after);
        if lost > 0 {
            let parts = if lost == 1 { "1 part is".into() } else { format!("{lost} parts are") };
            checks.push(Check::warning(
                "mask-part-lost",
                format!("{name}: found {parts} lost by resampling onto the case grid ({}), expected a grid fine enough for each", spacing(after.grid())),
            ));
        }
        checks.push(if drift.abs() > DRIFT_WARNING_PERCENT {
            Check::warning("mask-resampled", text)
        } else {
            Check::note("mask-resampled", text)
        });
    }
    checks
}

/// Number of connected parts (26-neighbourhood) of a mask of which no voxel is left on the case grid, onto which it was
/// resampled: each voxel there lies in an active one.
fn lost_parts(native: &Mask, on_grid: &Mask) -> usize {
    let Ok(parts) = Components::of_mask(native.bits(), Connectivity::TwentySix) else { return 0 };
    // Runs of voxels in memory order, with their parts: labels of a whole grid would take gigabytes.
    let mut runs: Vec<([u32; 3], usize)> = Vec::new();
    for (number, part) in parts.list().iter().enumerate() {
        runs.extend(parts.runs(part).iter().map(|run| ([run.z, run.y, run.first], number)));
    }
    runs.sort_unstable();
    let mut is_left = vec![false; parts.list().len()];
    let map = resample::source_from_target(native.grid(), on_grid.grid());
    on_grid.bits().for_each(|linear| {
        let v = ijk(on_grid.grid().dims(), linear);
        let place = map.transform_point3(DVec3::from_array(v.map(|index| index as f64)));
        let Some([x, y, z]) = resample::source_voxel(place, native.grid().dims()) else { return };
        let [x, y, z] = [x, y, z].map(|index| index as u32);
        let after = runs.partition_point(|(start, _)| *start <= [z, y, x]);
        if let Some((_, number)) = after.checked_sub(1).and_then(|at| runs.get(at)) {
            is_left[*number] = true;
        }
    });
    is_left.iter().filter(|left| !**left).count()
}

/// Masks of one time point that neither overlap nor touch (26-neighbourhood) another one. Needs two non-empty masks.
pub(super) fn isolated_masks(label: &str, masks: &[CaseMask], regions: &Regions) -> Vec<Check> {
    let non_empty: Vec<usize> = (0..masks.len()).filter(|&k| regions.mask_voxels(k) > 0).collect();
    if non_empty.len() < 2 {
        return Vec::new();
    }
    let mut checks = Vec::new();
    for &k in &non_empty {
        let overlaps = regions.list().iter().any(|r| r.bits >> k & 1 == 1 && r.mask_count() > 1);
        let others = || non_empty.iter().filter(|&&o| o != k).map(|&o| &masks[o].mask);
        if overlaps || others().any(|o| adjacent(&masks[k].mask, o)) {
            continue;
        }
        let gap = others().map(|o| box_gap_mm(&masks[k].mask, o)).fold(f64::INFINITY, f64::min);
        let name = at_time(masks[k].mask.id(), label);
        let nearest = match gap {
            0.0 => "boxes overlap, no voxel shared".to_owned(),
            _ => format!("the nearest one's box is {} mm away", decimal::text(gap, 1)),
        };
        checks.push(Check::warning(
            "masks-do-not-touch",
            format!("{name}: found a mask that touches no other ({nearest}), expected masks of one tumour"),
        ));
    }
    checks
}

/// First and one-past-last voxel of a mask's bounding box, grown by `by` voxels and clamped to the grid.
fn grown_box(mask: &Mask, by: usize) -> Option<([usize; 3], [usize; 3])> {
    let (start, dims) = mask.bits().bounds()?;
    let n = mask.grid().dims();
    let lo = std::array::from_fn(|a| start[a].saturating_sub(by));
    Some((lo, std::array::from_fn(|a| (start[a] + dims[a] + by).min(n[a]))))
}

fn adjacent(a: &Mask, b: &Mask) -> bool {
    let (Some((lo_a, hi_a)), Some((lo_b, hi_b))) = (grown_box(a, 1), grown_box(b, 0)) else { return false };
    let lo: [usize; 3] = std::array::from_fn(|x| lo_a[x].max(lo_b[x]));
    let hi: [usize; 3] = std::array::from_fn(|x| hi_a[x].min(hi_b[x]));
    let n = a.grid().dims();
    let near = |ijk: [usize; 3]| {
        (0..27).any(|o| {
            let step = [o % 3, o / 3 % 3, o / 9];
            let at: [usize; 3] = std::array::from_fn(|x| (ijk[x] + step[x]).wrapping_sub(1));
            (0..3).all(|x| at[x] < n[x]) && a.bits().get(at)
        })
    };
    (lo[2]..hi[2])
        .any(|z| (lo[1]..hi[1]).any(|y| (lo[0]..hi[0]).any(|x| b.bits().get([x, y, z]) && near([x, y, z]))))
}

/// Distance between two masks' bounding boxes in millimetres, from the gaps along the voxel axes.
fn box_gap_mm(a: &Mask, b: &Mask) -> f64 {
    let (Some((lo_a, hi_a)), Some((lo_b, hi_b))) = (grown_box(a, 0), grown_box(b, 0)) else {
        return f64::INFINITY;
    };
    let gap = |x: usize| {
        let voxels = lo_b[x].saturating_sub(hi_a[x]).max(lo_a[x].saturating_sub(hi_b[x]));
        voxels as f64
    };
    (DVec3::new(gap(0), gap(1), gap(2)) * a.grid().spacing_mm()).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MaskBits;

    fn mask(grid: &Grid, voxels: &[[usize; 3]]) -> Mask {
        let mut bits = MaskBits::empty(grid.dims());
        voxels.iter().for_each(|voxel| bits.set(*voxel));
        Mask::new("m", grid.clone(), bits).unwrap()
    }

    #[test]
    fn shares_are_none_and_all_only_where_they_are() {
        let of = [(1, 1001), (1, 1000), (1, 3), (999, 1000), (9999, 10_000), (7, 7)];
        let expected = ["less than 0.1 %", "0.1 %", "33.3 %", "99.9 %", "more than 99.9 %", "all"];
        assert_eq!(of.map(|(part, whole)| percent(part, whole)), expected);
    }

    #[test]
    fn spacings_and_the_tolerance_of_labels_are_written_out() {
        let grid = Grid::axis_aligned([2, 2, 2], DVec3::new(0.4, 1.0, 5.25), DVec3::ZERO).unwrap();
        assert_eq!(spacing(&grid), "0.40×1.00×5.25 mm");
        let native = |label_tolerance: f64| NativeMask {
            spec: 0,
            time: 0,
            mask: mask(&grid, &[]),
            own_grid: grid.clone(),
            frame_of_reference: String::new(),
            aligned: None,
            missing_labels: Vec::new(),
            invalid: 0,
            meaning: None,
            label_tolerance,
        };
        let texts = [1e-9, 0.01, 0.25].map(|tolerance| within(&native(tolerance)));
        assert_eq!(texts, ["", "", " within 0.250 of its value"], "a hundredth is rounding");
        assert_eq!((list(&[4]), list(&[1, 4])), ("label 4".into(), "labels 1, 4".into()));
    }

    /// Every pair of voxels: they touch up to one step along each axis; between their boxes lie the steps but one.
    #[test]
    fn masks_touch_at_faces_edges_and_corners_and_else_are_apart_by_their_gap() {
        let grid = Grid::axis_aligned([4, 3, 3], DVec3::new(1.0, 2.0, 4.0), DVec3::ZERO).unwrap();
        for a in 0..36 {
            for b in 0..36 {
                let (at_a, at_b) = (grid.ijk(a), grid.ijk(b));
                let masks = [mask(&grid, &[at_a]), mask(&grid, &[at_b])];
                let steps: [usize; 3] = std::array::from_fn(|axis| at_a[axis].abs_diff(at_b[axis]));
                assert_eq!(adjacent(&masks[0], &masks[1]), steps.iter().all(|n| *n < 2), "{at_a:?} {at_b:?}");
                let gap = DVec3::from_array(steps.map(|n| n.saturating_sub(1) as f64));
                let expected_mm = (gap * DVec3::new(1.0, 2.0, 4.0)).length();
                assert!((box_gap_mm(&masks[0], &masks[1]) - expected_mm).abs() < 1e-12, "{at_a:?} {at_b:?}");
            }
        }
        // Boxes that overlap, voxels that don't touch.
        let corner = mask(&grid, &[[0, 0, 0], [3, 2, 2]]);
        let inside = mask(&grid, &[[3, 0, 1]]);
        assert_eq!((adjacent(&corner, &inside), box_gap_mm(&corner, &inside)), (false, 0.0));
        assert_eq!(
            (adjacent(&corner, &mask(&grid, &[])), box_gap_mm(&mask(&grid, &[]), &corner)),
            (false, f64::INFINITY)
        );
    }

    #[test]
    fn parts_of_which_no_voxel_is_left_are_counted() {
        let grid = Grid::axis_aligned([9, 7, 5], DVec3::new(1.0, 1.0, 2.0), DVec3::ZERO).unwrap();
        // Parts of one run, of runs in two slices, and two in one line.
        let parts: [&[[usize; 3]]; 4] = [
            &[[0, 0, 0], [1, 0, 0]],
            &[[4, 3, 1], [5, 4, 2], [6, 4, 2]],
            &[[1, 6, 4]],
            &[[4, 6, 4], [5, 6, 4]],
        ];
        let native = mask(&grid, &parts.concat());
        for kept in 0_usize..16 {
            // Of each part that is kept the last voxel.
            let last: Vec<[usize; 3]> =
                (0..4).filter(|n| kept >> n & 1 == 1).map(|n| parts[n][parts[n].len() - 1]).collect();
            let lost = 4 - last.len();
            assert_eq!(lost_parts(&native, &mask(&grid, &last)), lost, "{kept:04b}");
            // Of a grid that begins a voxel later.
            let later =
                Grid::axis_aligned([10, 8, 6], DVec3::new(1.0, 1.0, 2.0), DVec3::new(-1.0, -1.0, -2.0))
                    .unwrap();
            let moved: Vec<[usize; 3]> = last.iter().map(|voxel| voxel.map(|at| at + 1)).collect();
            assert_eq!(lost_parts(&native, &mask(&later, &moved)), lost, "{kept:04b}");
        }
    }
}
