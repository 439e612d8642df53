//! What a page shows, from a case.

use glioscope_core::{
    Progress, Sides, Volume,
    case::{Case, OrderBasis, TimePoint},
    glam::DVec3,
};

use super::{
    Date, MaskAt, MaskInfo, Options, Page, PageError, Surface, head, levels,
    slices::{self, Box3},
};

/// How far simplified surfaces may be off: less than a tenth of a usual voxel, and invisible on a phone.
const ERROR_MM: f64 = 0.08;
/// Room around the masks in slices without a head around them.
const MARGIN_MM: f64 = 20.0;
/// Room around the head in slices.
const HEAD_MARGIN_MM: f64 = 4.0;

/// What the page of `case` shows. `colors`: that of a mask (its place at that date) at a date. `names`: what a mask of this id is
/// called; empty: it is numbered.
///
/// The case grid's voxels give surfaces, outlines and agreement; volumes of masks are those of their own grids.
///
/// # Errors
/// [`PageError::Nothing`] where no mask has a voxel, [`PageError::NoImage`], and what stops surfaces and pictures.
pub fn content(
    case: &Case,
    colors: &dyn Fn(usize, usize) -> [u8; 3],
    names: &dyn Fn(&str) -> String,
    options: &Options<'_>,
    progress: &Progress,
) -> Result<Page, PageError> {
    if case.time_points.iter().all(|time| time.regions.union_voxels() == 0) {
        return Err(PageError::Nothing);
    }
    if let Some(id) = options.image.filter(|id| !case.has_image(id)) {
        return Err(PageError::NoImage(id.to_owned()));
    }
    let masks = masks_of(case);
    let ids: Vec<&str> = masks.iter().map(|(id, ..)| *id).collect();
    // That of the last date, so that it fits what is shown first.
    let newest = case.time_points.iter().rev().find_map(|time| image_of(time, options));
    let head = newest.map(|image| head::head(image, progress)).transpose()?.flatten();
    let date = |time: &TimePoint| date(time, &ids, head.as_ref(), options, progress);
    let dates = case.time_points.iter().map(date).collect::<Result<_, _>>()?;
    let info =
        |&(id, date, mask): &(&str, usize, usize)| MaskInfo { name: names(id), color: colors(date, mask) };
    Ok(Page {
        masks: masks.iter().map(info).collect(),
        dates,
        head,
        has_sides: case.grid.sides() == Sides::Known,
        is_ordered: case.order != OrderBasis::Unknown,
        text: options.text.map(<[_]>::to_vec),
    })
}

/// The distinct masks: id, and the first date and place where it is.
fn masks_of(case: &Case) -> Vec<(&str, usize, usize)> {
    let mut all: Vec<(&str, usize, usize)> = Vec::new();
    for (date, time) in case.time_points.iter().enumerate() {
        for (place, mask) in time.masks.iter().enumerate() {
            let id = mask.mask.id();
            if all.iter().all(|(known, ..)| *known != id) {
                all.push((id, date, place));
            }
        }
    }
    all
}

fn image_of<'a>(time: &'a TimePoint, options: &Options<'_>) -> Option<&'a Volume> {
    let mut images = time.contexts.iter();
    let image = match options.image {
        Some(id) => images.find(|image| image.id == id),
        None => images.next(),
    };
    image.map(|image| &*image.volume)
}

fn date(
    time: &TimePoint,
    ids: &[&str],
    head: Option<&Surface>,
    options: &Options<'_>,
    progress: &Progress,
) -> Result<Date, PageError> {
    let mask = |id: &&str| {
        let found = time.masks.iter().find(|m| m.mask.id() == *id);
        let at = found.map(|m| {
            let surface = Surface::of_mask(&m.mask, ERROR_MM, progress)?;
            Ok::<_, PageError>(MaskAt { volume_ml: m.native_volume_ml, surface })
        });
        at.transpose()
    };
    let masks = ids.iter().map(mask).collect::<Result<Vec<_>, _>>()?;
    let levels = levels::levels(time, options, ERROR_MM, progress)?;
    let label = Some(time.label.clone()).filter(|label| options.has_dates && !label.is_empty());
    let shown = (ids, levels.len());
    let (mut slices, mut largest) = (Vec::new(), None);
    if let Some((center_mm, (lo, hi))) = time.regions.centroid_mm().zip(box_of(time)) {
        let around = around((lo, hi), head);
        slices = slices::slices((time, image_of(time, options)), shown, center_mm, around)?;
        largest = slices::largest(time, shown, (lo, hi));
    }
    Ok(Date { label, masks, levels, slices, largest })
}

/// The box of all masks of a date.
fn box_of(time: &TimePoint) -> Option<Box3> {
    let (start, dims) = time.regions.bounds()?;
    Some(time.index.grid().crop(start, dims).ok()?.bounds_mm())
}

/// What slices show: the head where it holds the masks, else the masks.
fn around((lo, hi): Box3, head: Option<&Surface>) -> Box3 {
    let near = (lo - MARGIN_MM, hi + MARGIN_MM);
    let Some((head_lo, head_hi)) = head.map(Surface::bounds_mm) else { return near };
    let margin = DVec3::splat(HEAD_MARGIN_MM);
    let holds = head_lo.cmple(lo).all() && head_hi.cmpge(hi).all();
    if holds { (head_lo - margin, head_hi + margin) } else { near }
}
