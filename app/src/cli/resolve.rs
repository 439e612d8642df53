//! Resolves names on the command line to time points, masks, regions and images of a case.

use glioscope_core::{
    Regions, Selection,
    case::{Case, TimePoint},
    change::Choice,
};

use super::terminal;
use crate::error::AppError;

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
    let mask_index = |id: &str| {
        let k = ids.iter().position(|known| known == id.trim());
        k.ok_or_else(|| AppError::option("select", id, format!("masks of the case: {}", ids.join(", "))))
    };
    let region =
        |name: &str| name.split('+').try_fold(0_u32, |bits, id| mask_index(id).map(|k| bits | 1 << k));
    let shown = text.split(',').map(region).collect::<Result<Vec<u32>, AppError>>()?;
    Ok(Selection::only(regions, &shown))
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
