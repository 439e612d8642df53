//! Slices ordered into volumes: positions decide, never names, numbers or thicknesses.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3};

use super::data_set::Unusable;
use super::instance::{Frame, Place};
use crate::{Check, Grid, Sides};

/// How far positions may lie off the line of slices, as rounded decimals do.
const SILENT_MM: f64 = 1e-3;

/// How far positions may lie off the line, as a share of the step, with a warning.
const WARNED_SHARE: f64 = 0.0101;

/// Positions nearer than this share of a millimetre are one.
const SAME_MM: f64 = 1e-3;

/// Direction cosines that differ by less are the same orientation.
const SAME_DIRECTION: f64 = 1e-4;

/// Angle between the step and the slices' normal from which a stack counts as tilted.
const TILT_DEG: f64 = 0.1;

/// A slice: frame `frame` of file `file`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slice {
    pub file: usize,
    pub frame: usize,
}

/// A frame with what decides which others it belongs to.
#[derive(Clone, Debug)]
pub(super) struct Candidate<'a> {
    pub slice: Slice,
    pub frame: &'a Frame,
    pub frame_of_reference: &'a str,
    pub rows: usize,
    pub columns: usize,
    /// What the file is called in messages.
    pub name: &'a str,
}

/// Slices of one volume, in order along their normal.
#[derive(Clone, Debug)]
pub(super) struct Stack {
    pub slices: Vec<Slice>,
    /// What tells it from others at the same place: `EchoTime 90`.
    pub key: Vec<(&'static str, String)>,
    /// Place of the first slice.
    pub first: Place,
    pub dims: [usize; 3],
    /// LPS millimetres from one slice to the next, or why slices aren't equally spaced.
    pub step: Result<Step, Unusable>,
    pub is_localizer: bool,
}

/// The way from one slice to the next.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Step {
    pub step_mm: DVec3,
    pub checks: Vec<Check>,
}

impl Stack {
    /// What tells it from the series' others, as text: `EchoTime 90`; may be empty.
    pub fn key_text(&self) -> String {
        let key: Vec<String> = self.key.iter().map(|(name, value)| format!("{name} {value}")).collect();
        key.join(", ")
    }

    /// The grid, RAS+.
    ///
    /// # Errors
    /// [`Unusable`] where slices aren't equally spaced, or for a grid that [`Grid::new`] refuses.
    pub fn grid(&self) -> Result<Grid, Unusable> {
        let step = self.step.as_ref().map_err(Clone::clone)?;
        grid(self.dims, &self.first, step.step_mm)
    }
}

/// Millimetres RAS+ of LPS ones.
pub(super) fn ras(lps_mm: DVec3) -> DVec3 {
    DVec3::new(-lps_mm.x, -lps_mm.y, lps_mm.z)
}

/// The grid of slices that follow each other by `step_mm`.
pub(super) fn grid(dims: [usize; 3], first: &Place, step_mm: DVec3) -> Result<Grid, Unusable> {
    let matrix3 = DMat3::from_cols(
        ras(first.along_row * first.pixel_spacing_mm[1]),
        ras(first.along_column * first.pixel_spacing_mm[0]),
        ras(step_mm),
    );
    let world_from_voxel = DAffine3 { matrix3, translation: ras(first.position_mm) };
    Grid::new(dims, world_from_voxel, Sides::Known).map_err(|e| {
        let text = e.to_string();
        let text = text.strip_prefix("found ").unwrap_or(&text);
        let (found, expected) = text.split_once(", expected ").unwrap_or((text, "a grid"));
        Unusable::new(found, expected)
    })
}

fn same_direction(a: &Place, b: &Place) -> bool {
    a.along_row.abs_diff_eq(b.along_row, SAME_DIRECTION)
        && a.along_column.abs_diff_eq(b.along_column, SAME_DIRECTION)
}

fn same_measures(a: &Candidate<'_>, b: &Candidate<'_>) -> bool {
    let spacing = |c: &Candidate<'_>| c.frame.place.pixel_spacing_mm;
    let same = |x: f64, y: f64| (x - y).abs() <= 1e-5 * x;
    (a.rows, a.columns) == (b.rows, b.columns)
        && same(spacing(a)[0], spacing(b)[0])
        && same(spacing(a)[1], spacing(b)[1])
}

/// Orders the frames of a series into volumes: largest first, and those that differ by a key in its order.
///
/// # Errors
/// [`Unusable`] where slices of one place differ by nothing that is known, or where slices of other sizes lie among them.
pub(super) fn stacks(candidates: &[Candidate<'_>], series: &str) -> Result<Vec<Stack>, Unusable> {
    let mut groups: Vec<Vec<&Candidate<'_>>> = Vec::new();
    for candidate in candidates {
        let belongs = |group: &&mut Vec<&Candidate<'_>>| {
            let first = group[0];
            first.frame_of_reference == candidate.frame_of_reference
                && first.frame.stack == candidate.frame.stack
                && same_measures(first, candidate)
                && same_direction(&first.frame.place, &candidate.frame.place)
        };
        match groups.iter_mut().find(belongs) {
            Some(group) => group.push(candidate),
            None => groups.push(vec![candidate]),
        }
    }
    refuse_mixed(&groups)?;
    let mut stacks = Vec::new();
    for mut group in groups {
        let normal = group[0].frame.place.normal();
        let along = |c: &Candidate<'_>| c.frame.place.position_mm.dot(normal);
        group.sort_by(|a, b| along(a).total_cmp(&along(b)));
        for (key, members) in split(group)? {
            stacks.push(stack(&members, key, series));
        }
    }
    stacks.sort_by_key(|stack| (stack.is_localizer, std::cmp::Reverse(stack.slices.len())));
    Ok(stacks)
}

/// Refuses a series in whose stack slices of another size or spacing lie: they are missing in it.
fn refuse_mixed(groups: &[Vec<&Candidate<'_>>]) -> Result<(), Unusable> {
    for large in groups.iter().filter(|group| group.len() > 1) {
        let first = large[0];
        let normal = first.frame.place.normal();
        let along: Vec<f64> = large.iter().map(|c| c.frame.place.position_mm.dot(normal)).collect();
        let low = along.iter().copied().fold(f64::INFINITY, f64::min);
        let high = along.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let margin = 1.5 * (high - low) / (large.len() - 1) as f64;
        for small in groups.iter().filter(|group| group.len() < large.len()) {
            let other = small[0];
            let is_alike = other.frame_of_reference == first.frame_of_reference
                && other.frame.stack == first.frame.stack
                && !same_measures(other, first)
                && same_direction(&other.frame.place, &first.frame.place);
            let at = other.frame.place.position_mm.dot(normal);
            if is_alike && (low - margin..=high + margin).contains(&at) {
                let shape = |c: &Candidate<'_>| {
                    let [rows_mm, columns_mm] = c.frame.place.pixel_spacing_mm;
                    format!("{} × {} pixels of {columns_mm} × {rows_mm} mm", c.columns, c.rows)
                };
                let found = format!("{} with {} among slices of {}", other.name, shape(other), shape(first));
                return Err(Unusable::new(found, "slices of one size and spacing"));
            }
        }
    }
    Ok(())
}

type Members<'a, 'b> = Vec<&'b Candidate<'a>>;
type Key = Vec<(&'static str, String)>;

/// Slices of one group, sorted along the normal, parted where positions repeat, by as few attributes as needed.
fn split<'a, 'b>(group: Members<'a, 'b>) -> Result<Vec<(Key, Members<'a, 'b>)>, Unusable> {
    let Some((one, other)) = repeated(&group) else {
        return Ok(vec![(Vec::new(), group)]);
    };
    let value = |c: &Candidate<'_>, name: &str| {
        c.frame.keys.iter().find(|(n, _)| *n == name).map(|(_, value)| value.clone()).unwrap_or_default()
    };
    let mut names: Vec<&'static str> = Vec::new();
    for (name, _) in group.iter().flat_map(|c| &c.frame.keys) {
        let varies = || group.iter().any(|c| value(c, name) != value(group[0], name));
        if !names.contains(name) && varies() {
            names.push(name);
        }
    }
    let by = |names: &[&'static str]| -> Vec<(Key, Members<'a, 'b>)> {
        let mut parts: BTreeMap<Vec<(Ordered, String)>, Members<'a, 'b>> = BTreeMap::new();
        for &c in &group {
            let key = names.iter().map(|name| Ordered::of(value(c, name))).collect();
            parts.entry(key).or_default().push(c);
        }
        let named = |key: Vec<(Ordered, String)>| {
            names.iter().copied().zip(key.into_iter().map(|(_, v)| v)).collect()
        };
        parts.into_iter().map(|(key, members)| (named(key), members)).collect()
    };
    let is_whole =
        |parts: &[(Key, Members<'a, 'b>)]| parts.iter().all(|(_, members)| repeated(members).is_none());
    let singles = names.iter().map(|&name| vec![name]);
    let growing = (2..=names.len()).map(|count| names[..count].to_vec());
    for names in singles.chain(growing) {
        let parts = by(&names);
        // As many volumes as positions repeat: a key that differs from slice to slice would make a volume of each.
        let largest = parts.iter().map(|(_, members)| members.len()).max().unwrap_or_default();
        if is_whole(&parts) && largest * 2 > group.len() / repeats(&group) {
            return Ok(parts);
        }
    }
    let found = format!("{} and {} at one position, alike but for their numbers", one.name, other.name);
    Err(Unusable::new(found, "one slice a position"))
}

/// A value that sorts as a number where it is one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Ordered(i128);

impl Ordered {
    fn of(value: String) -> (Self, String) {
        let number = value.parse::<f64>().ok().filter(|n| n.is_finite());
        (Self(number.map_or(i128::MAX, |n| (n * 1e6) as i128)), value)
    }
}

/// The first two neighbours at one position.
fn repeated<'a, 'b>(sorted: &[&'b Candidate<'a>]) -> Option<(&'b Candidate<'a>, &'b Candidate<'a>)> {
    let same = |pair: &&[&'b Candidate<'a>]| {
        pair[0].frame.place.position_mm.abs_diff_eq(pair[1].frame.place.position_mm, SAME_MM)
    };
    sorted.windows(2).find(same).map(|pair| (pair[0], pair[1]))
}

/// How many slices the fullest position has.
fn repeats(sorted: &[&Candidate<'_>]) -> usize {
    let chunks =
        sorted.chunk_by(|a, b| a.frame.place.position_mm.abs_diff_eq(b.frame.place.position_mm, SAME_MM));
    chunks.map(<[_]>::len).max().unwrap_or(1)
}

fn stack(members: &[&Candidate<'_>], key: Key, series: &str) -> Stack {
    let first = members[0].frame.place;
    let places: Vec<&Place> = members.iter().map(|c| &c.frame.place).collect();
    let mut step = step(&places, series);
    if let Ok(step) = &mut step
        && members.iter().any(|c| c.frame.place.was_scaled)
    {
        step.checks.push(Check::warning(
            "dicom-direction",
            format!("{series}: direction cosines that are not of length 1 were scaled to it"),
        ));
    }
    if let Ok(step) = &mut step
        && let Some(c) = members.iter().find(|c| c.frame.had_slope_0)
    {
        step.checks.push(Check::warning(
            "dicom-slope",
            format!("{series}: a rescale slope of 0 in {}; stored values are shown as they are", c.name),
        ));
    }
    Stack {
        slices: members.iter().map(|c| c.slice).collect(),
        key,
        first,
        dims: [members[0].columns, members[0].rows, members.len()],
        step,
        is_localizer: members[0].frame.stack == "localizer",
    }
}

/// The step of sorted slices.
fn step(places: &[&Place], series: &str) -> Result<Step, Unusable> {
    let first = places[0];
    let normal = first.normal();
    let mut checks = Vec::new();
    let count = places.len();
    if count == 1 {
        let step = first.stated_step_mm;
        let text = match step {
            Some(mm) => format!("{series}: one slice; its thickness of {mm} mm is what the file states"),
            None => format!("{series}: one slice without a thickness; 1 mm assumed"),
        };
        checks.push(Check::warning("dicom-one-slice", text));
        return Ok(Step { step_mm: normal * step.unwrap_or(1.0), checks });
    }
    let step_mm = (places[count - 1].position_mm - first.position_mm) / (count - 1) as f64;
    let step_length_mm = step_mm.length();
    let off = |n: usize| (places[n].position_mm - (first.position_mm + step_mm * n as f64)).length();
    let most_mm = (0..count).map(off).fold(0.0, f64::max);
    if most_mm > SILENT_MM {
        if most_mm > WARNED_SHARE * step_length_mm {
            return Err(not_uniform(places, normal, most_mm));
        }
        checks.push(Check::warning(
            "dicom-uneven",
            format!(
                "{series}: slices lie up to {} mm off equal steps of {} mm, which are shown",
                crate::decimal::text(most_mm, 3),
                crate::decimal::text(step_length_mm, 4)
            ),
        ));
    }
    let tilt_deg = (step_mm.dot(normal) / step_length_mm).clamp(-1.0, 1.0).acos().to_degrees();
    if tilt_deg > TILT_DEG {
        let tilt = crate::decimal::text(tilt_deg, 1);
        checks.push(Check::warning(
            "dicom-tilt",
            format!("{series}: slices are shifted against each other by {tilt}° (gantry tilt); the grid is sheared as they are"),
        ));
    }
    Ok(Step { step_mm, checks })
}

fn not_uniform(places: &[&Place], normal: DVec3, most_mm: f64) -> Unusable {
    let along: Vec<f64> = places.iter().map(|p| p.position_mm.dot(normal)).collect();
    let gaps: Vec<f64> = along.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = gaps.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    let odd: Vec<String> = gaps
        .iter()
        .enumerate()
        .filter(|(_, gap)| (**gap - usual).abs() > WARNED_SHARE * usual)
        .map(|(n, gap)| format!("{} mm behind slice {}", crate::decimal::text(*gap, 3), n + 1))
        .collect();
    if odd.is_empty() {
        let found = format!("slices up to {} mm off a line", crate::decimal::text(most_mm, 3));
        return Unusable::new(found, "slices in a line, equally spaced");
    }
    let found = format!(
        "{} slices {} mm apart, but {}",
        places.len(),
        crate::decimal::text(usual, 3),
        crate::check::listed(&odd, 3)
    );
    Unusable::new(found, "equally spaced slices (one may be missing)")
}
