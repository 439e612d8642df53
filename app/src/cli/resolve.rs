//! Resolves names on the command line to time points, masks, regions and images of a case.

use glioscope_core::{
    Regions, Selection,
    case::{Case, TimePoint},
    change::Choice,
};

use super::terminal;
use crate::{
    error::AppError,
    model::{Document, SecondImage},
    world::World,
};

/// Index of the time point with this label.
///
/// # Errors
/// [`AppError::Wrong`] listing the labels of the case.
pub fn time_point_index(case: &Case, label: &str) -> Result<usize, AppError> {
    let labels = || format!("one of {}", case.time_labels().join(", "));
    case.time_at(label).ok_or_else(|| AppError::option("time", label, labels()))
}

/// The time point with this label; without a label, the only time point.
///
/// # Errors
/// As [`time_point_index`]; also without a label where the case has several time points.
pub fn time_point<'a>(case: &'a Case, label: Option<&str>) -> Result<&'a TimePoint, AppError> {
    match (label, case.time_points.as_slice()) {
        (None, [only]) => Ok(only),
        (None, several) => {
            let found = format!("no date beside {} dates", several.len());
            Err(AppError::wrong("--time", found, format!("one of {}", case.time_labels().join(", "))))
        }
        (Some(label), all) => Ok(&all[time_point_index(case, label)?]),
    }
}

/// The mask and the time points given by `--of`, `--from` and `--to`. Defaults chosen among several candidates are
/// printed to stderr.
///
/// # Errors
/// [`AppError::Change`] as [`Choice::resolve`].
pub fn change(
    case: &Case,
    of: Option<&str>,
    from: Option<&str>,
    to: Option<&str>,
) -> Result<Choice, AppError> {
    let choice = Choice::resolve(case, of, from, to)?;
    for assumed in choice.assumed(case, of, from, to) {
        terminal::assumed(&assumed);
    }
    Ok(choice)
}

/// The selection given by `--select`: `all`, `none`, or regions as `T1,T1+PET`.
///
/// # Errors
/// [`AppError::Wrong`] listing the masks of the case.
pub fn selection(text: &str, regions: &Regions) -> Result<Selection, AppError> {
    match text {
        "all" => return Ok(Selection::all()),
        "none" => return Ok(Selection::only(regions, &[])),
        _ => {}
    }
    let ids = regions.mask_ids();
    let region = |name: &str| {
        let expected = || format!("masks of the case: {}", ids.join(", "));
        region_bits(name, ids).map_err(|unknown| AppError::option("select", unknown, expected()))
    };
    let shown = text.split(',').map(region).collect::<Result<Vec<u32>, AppError>>()?;
    Ok(Selection::only(regions, &shown))
}

/// As [`selection`], of regions that have voxels: what is written must be what was named.
///
/// # Errors
/// As [`selection`]; also for a region without voxels.
pub fn selection_with_voxels(text: &str, regions: &Regions) -> Result<Selection, AppError> {
    if !matches!(text, "all" | "none") {
        let ids = regions.mask_ids();
        for name in text.split(',') {
            // Unknown masks are refused below.
            if region_bits(name, ids).is_ok_and(|bits| regions.get(bits).is_none()) {
                let found = format!("{:?}, where no voxel has exactly these masks", name.trim());
                let known: Vec<String> = regions.list().iter().map(|r| regions.name(r.bits)).collect();
                let expected = format!("regions of the case: {}", known.join(", "));
                return Err(AppError::wrong("--select", found, expected));
            }
        }
    }
    selection(text, regions)
}

/// The masks that a region's name lists, as bits. A mask's id may hold `+` itself (`T1+C`): of several readings, the one
/// whose first id is longest counts, then its second, and so on.
///
/// # Errors
/// The part of the name that is no mask's id.
fn region_bits<'a>(name: &'a str, ids: &[String]) -> Result<u32, &'a str> {
    let ends = std::iter::once(name.len()).chain(name.rmatch_indices('+').map(|(at, _)| at));
    let mut unknown = None;
    for end in ends {
        let Some(k) = ids.iter().position(|id| id == name[..end].trim()) else { continue };
        let Some(rest) = name[end..].strip_prefix('+') else { return Ok(1 << k) };
        match region_bits(rest, ids) {
            Ok(bits) => return Ok(bits | 1 << k),
            Err(part) => unknown = unknown.or(Some(part)),
        }
    }
    Err(unknown.unwrap_or_else(|| name.split('+').next().unwrap_or(name)))
}

/// Checks the image id given by `--image`; `None` for `none`.
///
/// # Errors
/// [`AppError::Wrong`] listing the images of the time point.
pub fn image(time_point: &TimePoint, id: &str) -> Result<Option<String>, AppError> {
    let ids: Vec<&str> = time_point.contexts.iter().map(|c| c.id.as_str()).collect();
    if id != "none" && !ids.contains(&id) {
        return Err(AppError::option("image", id, format!("none or one of {}", ids.join(", "))));
    }
    Ok((id != "none").then(|| id.to_owned()))
}

/// The second image given by `--second ID[@DATE]`, and whether it is another date's of the image shown.
///
/// # Errors
/// [`AppError::Wrong`] listing the images of the case.
pub fn second(text: &str, doc: &Document, world: &World) -> Result<(SecondImage, bool), AppError> {
    let of = |id: &str, time: Option<&str>| SecondImage { id: id.to_owned(), time: time.map(str::to_owned) };
    let parts = text.rsplit_once('@').map(|(id, time)| of(id, Some(time)));
    let time_points = world.case().map(|case| case.time_points.as_slice()).unwrap_or_default();
    let has = |second: &SecondImage| {
        let here =
            |n: usize, t: &TimePoint| second.time.as_ref().map_or(n == doc.nav.time, |time| t.label == *time);
        let mut found = time_points.iter().enumerate().filter(|(n, t)| here(*n, t));
        found.any(|(_, t)| t.contexts.iter().any(|c| c.id == second.id))
    };
    let found = std::iter::once(of(text, None)).chain(parts).find(has);
    let second = found.ok_or_else(|| {
        let names = time_points.iter().flat_map(|t| {
            t.contexts
                .iter()
                .map(|c| if t.label.is_empty() { c.id.clone() } else { format!("{}@{}", c.id, t.label) })
        });
        AppError::option("second", text, format!("one of {}", names.collect::<Vec<_>>().join(", ")))
    })?;
    let is_same_kind = doc.nav.context.as_ref() == Some(&second.id);
    Ok((second, is_same_kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_with_plus_signs_are_ids_like_any_other() {
        let ids = |list: &[&str]| -> Vec<String> { list.iter().map(|id| (*id).to_owned()).collect() };
        let plus = ids(&["T1", "T1+C", "FLAIR", "+", "T1+C+"]);
        for (name, bits) in [
            ("T1", 0b1),
            ("T1+C", 0b10),
            ("FLAIR+T1+C", 0b110),
            (" T1+C + FLAIR", 0b110),
            ("T1+C+T1", 0b11),
            ("T1+FLAIR", 0b101),
            ("T1+C++T1", 0b1_0001),
            ("T1++", 0b1001),
        ] {
            assert_eq!(region_bits(name, &plus), Ok(bits), "{name}");
        }
        assert_eq!(region_bits("T1+PET", &plus), Err("PET"));
        assert_eq!(region_bits("C", &plus), Err("C"));
        // What a mask of that name is called.
        assert_eq!(region_bits("T1+C", &ids(&["C", "T1"])), Ok(0b11));
    }
}
