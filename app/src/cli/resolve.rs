//! What names on the command line stand for in a case: dates, masks, regions, images.

use glioscope_core::{
    Regions, Selection,
    case::{Case, TimePoint},
    change::Choice,
};

use super::terminal;
use crate::error::AppError;

/// The position of the date with this label.
///
/// # Errors
/// [`AppError::Wrong`] with the labels of the case.
pub fn date(case: &Case, label: &str) -> Result<usize, AppError> {
    let labels = || format!("one of {}", case.time_labels().join(", "));
    case.time_at(label).ok_or_else(|| AppError::option("time", label, labels()))
}

/// The date with this label; without one the only date.
///
/// # Errors
/// As [`date`], and without a label among several dates.
pub fn only_date<'a>(case: &'a Case, label: Option<&str>) -> Result<&'a TimePoint, AppError> {
    match (label, case.time_points.as_slice()) {
        (None, [only]) => Ok(only),
        (None, several) => {
            let found = format!("no date beside {} dates", several.len());
            Err(AppError::wrong("--time", found, format!("one of {}", case.time_labels().join(", "))))
        }
        (Some(label), all) => Ok(&all[date(case, label)?]),
    }
}

/// The mask and the dates that `--of`, `--from` and `--to` name. What was chosen among several without being asked for
/// is told on stderr.
///
/// # Errors
/// [`AppError::Change`].
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

/// The selection that `--select` names.
///
/// # Errors
/// [`AppError::Wrong`] with the masks of the case.
pub fn selection(text: &str, regions: &Regions) -> Result<Selection, AppError> {
    match text {
        "all" => return Ok(Selection::all()),
        "none" => return Ok(Selection::only(regions, &[])),
        _ => {}
    }
    let ids = regions.mask_ids();
    let mask = |id: &str| {
        let k = ids.iter().position(|known| known == id.trim());
        k.ok_or_else(|| AppError::option("select", id, format!("masks of the case: {}", ids.join(", "))))
    };
    let region = |name: &str| name.split('+').try_fold(0_u32, |bits, id| mask(id).map(|k| bits | 1 << k));
    let shown = text.split(',').map(region).collect::<Result<Vec<u32>, AppError>>()?;
    Ok(Selection::only(regions, &shown))
}

/// The image with this id; `None` for `none`.
///
/// # Errors
/// [`AppError::Wrong`] with the images of the date.
pub fn image(time_point: &TimePoint, id: &str) -> Result<Option<String>, AppError> {
    let ids: Vec<&str> = time_point.contexts.iter().map(|c| c.id.as_str()).collect();
    if id != "none" && !ids.contains(&id) {
        return Err(AppError::option("image", id, format!("none or one of {}", ids.join(", "))));
    }
    Ok((id != "none").then(|| id.to_owned()))
}
