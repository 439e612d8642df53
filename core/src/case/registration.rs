//! Registration of a case's dates, each to the first, and of a date's images, each to one of them; loops of these.

use std::time::Instant;

use glam::{DAffine3, DVec3};

use super::{Aligned, AlignedBy, Alignment, Case, CaseMask, TimePoint};
use crate::{
    Cancelled, Mask, Progress, decimal,
    register::{self, Consistency, Image, Measure, Model, Options, Outcome, RegisterError, Spread},
    surface,
};

/// How far corners of two grids may be apart, in voxels, for a mask to be drawn on an image's grid.
const SAME_GRID_VOXELS: f64 = 1e-3;

/// Points of the tumour's surface at which repeated registrations are compared.
const MOST_POINTS: usize = 2000;

/// How far images of two dates may lie apart at the tumour, by a coarse fit, before the dates count as not aligned: what
/// a rigid head moves when tissue around a tumour shifts stays below.
pub const NOT_ALIGNED_MM: f64 = 4.0;

/// The distance that three independent errors of standard deviation 1 along the axes exceed in 5 % of cases: the root of
/// the 95th percentile of χ² with 3 degrees of freedom.
pub const P95_OF_UNIT_ERRORS: f64 = 2.795_483_482_915_108;

/// The registration of a date, or of an image within its date.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseRegistration {
    /// Label of the date that is moved, or in which the image is.
    pub time: String,
    /// Id of the image that is moved; `None`: all of the date.
    pub id: Option<String>,
    /// The images that were registered: the fixed one, then the moving one.
    pub images: Option<[String; 2]>,
    /// The transform, or why there is none.
    pub result: Result<Registered, String>,
    /// Run time.
    pub seconds: f64,
}

/// A registration that can be applied.
#[derive(Clone, Debug, PartialEq)]
pub struct Registered {
    /// They move the date; or the image, and each mask that was drawn on its grid.
    pub alignments: Vec<Alignment>,
    /// How far repeated registrations disagree at the tumour: not accuracy.
    pub consistency: Consistency,
    /// How far points of the tumour's surface end from where they began on their way around the loops that the registration
    /// is part of; `None` where [`close_loops`](super::close_loops) closed none.
    pub around: Option<Around>,
    /// What a user should know.
    pub warnings: Vec<String>,
    /// Maps the space of the case, before it is applied, to where the moving image shows the same.
    pub(super) moving_from_fixed: DAffine3,
}

/// Loops of registrations: that with the largest 95th percentile, and through what each leads.
#[derive(Clone, Debug, PartialEq)]
pub struct Around {
    /// Distances between the loop's end and its start.
    pub worst: Spread,
    /// Through which dates and images each loop leads.
    pub through: Vec<String>,
}

impl Registered {
    /// Tells what a loop, which this is part of, was off by.
    pub(super) fn went_around(&mut self, spread: Spread, through: &str) {
        let mut around = self.around.take().unwrap_or(Around { worst: spread, through: Vec::new() });
        if around.worst.p95_mm < spread.p95_mm {
            around.worst = spread;
        }
        around.through.push(through.to_owned());
        for alignment in &mut self.alignments {
            if let AlignedBy::Matrix { loop_mm, .. } = &mut alignment.by {
                *loop_mm = Some(around.worst.p95_mm);
            }
        }
        self.around = Some(around);
    }
}

/// [`register_dates`] or [`register_images`].
pub type RegisterCase = fn(&Case, Option<&str>, Model, &Progress) -> Result<Vec<CaseRegistration>, Cancelled>;

/// Registers every date of `case` to the first, `image` of both where they have it, else the first image that both have,
/// else their first images by mutual information. The masks of both dates, grown, don't count. Dates that a transform moves
/// already are left out. Nothing is applied.
///
/// # Errors
/// [`Cancelled`]; a registration that fails is in its date's result.
pub fn register_dates(
    case: &Case,
    image: Option<&str>,
    model: Model,
    progress: &Progress,
) -> Result<Vec<CaseRegistration>, Cancelled> {
    let Some((first, others)) = case.time_points.split_first() else { return Ok(Vec::new()) };
    let is_moved =
        |time: &TimePoint| case.aligned.iter().any(|aligned| aligned.with_date && aligned.time == time.label);
    let mut all = Vec::new();
    for later in others.iter().filter(|later| !is_moved(later)) {
        let started = Instant::now();
        let (images, result) = match images_of(first, later, image) {
            None => (None, Err("found a date without an image, expected one to register".into())),
            Some(pair) => {
                progress.say(format!("Registering {} to {}", later.label, first.label));
                let ids = pair.map(|(time, n)| time.contexts[n].id.clone());
                let fitted = fit(pair, &first.label, model, progress)?;
                let of_date = |fit: Fit| {
                    let by = fit.by(fit.moving_from_fixed);
                    fit.registered(vec![Alignment::of(None, Some(later.label.clone()), by)])
                };
                (Some(ids), fitted.map(of_date))
            }
        };
        let seconds = started.elapsed().as_secs_f64();
        all.push(CaseRegistration { time: later.label.clone(), id: None, images, result, seconds });
    }
    Ok(all)
}

/// Registers the other images of each date of `case` to one of them: `image` where the date has it, else its first. With an image
/// move the masks that were drawn on its grid, unless that is the fixed image's, too, and the mask of its id. Images that a transform
/// of their own moves already are left out. The date's masks, grown, don't count. Nothing is applied.
///
/// # Errors
/// [`Cancelled`]; a registration that fails is in its image's result.
pub fn register_images(
    case: &Case,
    image: Option<&str>,
    model: Model,
    progress: &Progress,
) -> Result<Vec<CaseRegistration>, Cancelled> {
    let mut all = Vec::new();
    for time in &case.time_points {
        let own_move = |id: &str, is_mask: bool| {
            let mut own = case.aligned.iter().filter(|a| a.time == time.label && a.is_mask == is_mask);
            own.find(|a| a.id == id)
        };
        let is_moved = |id: &str, is_mask: bool| own_move(id, is_mask).is_some_and(Aligned::has_own);
        let fixed = time.contexts.iter().position(|c| Some(c.id.as_str()) == image).unwrap_or(0);
        let Some(kept) = time.contexts.get(fixed) else { continue };
        for (n, moving) in time.contexts.iter().enumerate() {
            if n == fixed || is_moved(&moving.id, false) {
                continue;
            }
            let started = Instant::now();
            progress.say(format!("Registering {} to {}", moving.id, kept.id));
            let case_from_date =
                own_move(&moving.id, false).map_or(DAffine3::IDENTITY, |moved| moved.case_from_own);
            let grid = moving.volume.grid();
            let drawn_on_it = |m: &&CaseMask| {
                let is_on = |grid| m.native_grid.same_place(grid, SAME_GRID_VOXELS);
                m.mask.id() != moving.id && is_on(grid) && !is_on(kept.volume.grid())
            };
            let masks = time.masks.iter().filter(drawn_on_it).map(|m| m.mask.id());
            let ids = std::iter::once(moving.id.as_str()).chain(masks.filter(|id| !is_moved(id, true)));
            let label = (!time.label.is_empty()).then(|| time.label.clone());
            let of_image = |fit: Fit| {
                // Within the date, which may be moved itself.
                let own = case_from_date.inverse() * fit.moving_from_fixed * case_from_date;
                let alignment = |id: &str| Alignment::of(Some(id.to_owned()), label.clone(), fit.by(own));
                let alignments = ids.map(alignment).collect();
                fit.registered(alignments)
            };
            let result = fit([(time, fixed), (time, n)], &kept.id, model, progress)?.map(of_image);
            all.push(CaseRegistration {
                time: time.label.clone(),
                id: Some(moving.id.clone()),
                images: Some([kept.id.clone(), moving.id.clone()]),
                result,
                seconds: started.elapsed().as_secs_f64(),
            });
        }
    }
    Ok(all)
}

/// Resolution and points of the coarse fit that tells whether dates lie in one space at all.
const COARSE_MM: f64 = 4.0;
const COARSE_POINTS: usize = 30_000;

/// Why two dates don't lie in one space, as far as masks `ids` and the dates' images say; `None` where nothing says so.
/// `asks_images`: whether images are compared, too.
///
/// # Errors
/// [`Cancelled`].
pub(crate) fn in_two_spaces(
    case: &Case,
    dates: [usize; 2],
    ids: [&[&str]; 2],
    asks_images: bool,
    progress: &Progress,
) -> Result<Option<String>, Cancelled> {
    let labels = case.time_labels();
    let [from, to] = dates.map(|at| labels.get(at).copied().unwrap_or_default());
    let frames = |at: usize, ids: &[&str]| -> Vec<&str> {
        let masks = case.time_points.get(at).map(|time| time.masks.as_slice()).unwrap_or_default();
        let masks = masks.iter().filter(|m| ids.contains(&m.mask.id()));
        masks.map(|m| m.frame_of_reference.as_str()).filter(|frame| !frame.is_empty()).collect()
    };
    let [earlier, later] = [0, 1].map(|n| frames(dates[n], ids[n]));
    if earlier.iter().any(|frame| later.iter().any(|other| other != frame)) {
        return Ok(Some(format!(
            "found {from} and {to} in two frames of reference, expected dates in one space"
        )));
    }
    let apart = if asks_images { apart_mm(case, dates, progress)? } else { None };
    Ok(apart.map(|(mm, image)| {
        format!(
            "found {from} and {to} {mm:.0} mm apart at the tumour, by their images {image}, expected dates in one space"
        )
    }))
}

/// How far two dates' images lie apart at the tumour, in millimetres (95th percentile over its surface), by a coarse fit from
/// where they lie: to tell dates that were never aligned, or were moved the wrong way, not to align them. `None` up to
/// [`NOT_ALIGNED_MM`], and where it can't be told: without an image of one id at both dates, where a fit fails, where a registration that was run here moved them, and
/// where the user says that all lie in one space. With it the id of the images.
///
/// # Errors
/// [`Cancelled`].
pub fn apart_mm(
    case: &Case,
    dates: [usize; 2],
    progress: &Progress,
) -> Result<Option<(f64, String)>, Cancelled> {
    let [Some(earlier), Some(later)] = dates.map(|at| case.time_points.get(at)) else { return Ok(None) };
    let mut moved =
        case.aligned.iter().filter(|a| a.time == earlier.label || a.time == later.label).peekable();
    let is_registered = moved.peek().is_some() && moved.all(|a| a.consistency_mm.is_some());
    let common = earlier.contexts.iter().find_map(|own| {
        let other = later.contexts.iter().find(|other| other.id == own.id)?;
        Some([own, other])
    });
    let Some([fixed, moving]) = common.filter(|_| !is_registered && !case.one_space) else { return Ok(None) };
    let masks = [earlier, later].map(masks_of);
    let images = [
        Image { volume: &fixed.volume, excluded: &masks[0] },
        Image { volume: &moving.volume, excluded: &masks[1] },
    ];
    let options = Options {
        start: Some(DAffine3::IDENTITY),
        finest_mm: COARSE_MM,
        max_points: COARSE_POINTS,
        ..Options::default()
    };
    let outcome = match register::register(&images[0], &images[1], &options, progress) {
        Ok(outcome) => outcome,
        Err(RegisterError::Cancelled(cancelled)) => return Err(cancelled),
        Err(_) => return Ok(None),
    };
    let mut distances: Vec<f64> =
        surface_points_mm(&masks).into_iter().map(|at| outcome.moving_mm(at).distance(at)).collect();
    distances.sort_by(f64::total_cmp);
    let at = (distances.len() * 95 / 100).min(distances.len().saturating_sub(1));
    Ok(distances.get(at).filter(|mm| **mm > NOT_ALIGNED_MM).map(|mm| (*mm, fixed.id.clone())))
}

pub(super) type OfDate<'a> = (&'a TimePoint, usize);

fn images_of<'a>(
    first: &'a TimePoint,
    later: &'a TimePoint,
    wanted: Option<&str>,
) -> Option<[OfDate<'a>; 2]> {
    let find = |time: &TimePoint, id: &str| time.contexts.iter().position(|c| c.id == id);
    let both = |id: &str| Some([(first, find(first, id)?), (later, find(later, id)?)]);
    let common = || first.contexts.iter().find_map(|c| both(&c.id));
    let any =
        || (!first.contexts.is_empty() && !later.contexts.is_empty()).then_some([(first, 0), (later, 0)]);
    wanted.and_then(both).or_else(common).or_else(any)
}

/// What was found of two images.
struct Fit {
    moving_from_fixed: DAffine3,
    how: String,
    consistency: Consistency,
    warnings: Vec<String>,
}

impl Fit {
    fn by(&self, moving_from_fixed: DAffine3) -> AlignedBy {
        let mut by = AlignedBy::matrix(moving_from_fixed, self.how.clone());
        if let AlignedBy::Matrix { consistency_mm, .. } = &mut by {
            *consistency_mm = self.consistency.p95_with_floor_mm();
        }
        by
    }

    fn registered(self, alignments: Vec<Alignment>) -> Registered {
        let Self { moving_from_fixed, consistency, warnings, .. } = self;
        Registered { alignments, consistency, around: None, warnings, moving_from_fixed }
    }
}

/// Registers two images; `to`: what the fixed one is called in the words of how.
fn fit(
    pair: [OfDate<'_>; 2],
    to: &str,
    model: Model,
    progress: &Progress,
) -> Result<Result<Fit, String>, Cancelled> {
    let moving = &pair[1].0.contexts[pair[1].1];
    let found = aligned(pair, model, progress, |Aligning { images, masks, options, outcome }| {
        let points_mm = surface_points_mm(masks);
        register::consistency(&images[0], &images[1], options, outcome, &points_mm, progress)
    })?;
    Ok(found.map(|(outcome, consistency)| {
        let how = format!("registration of {} to {to} ({})", moving.id, words(model, &consistency));
        let warnings = outcome.warnings.iter().map(ToString::to_string).collect();
        Fit { moving_from_fixed: outcome.moving_from_fixed, how, consistency, warnings }
    }))
}

/// The masks of two dates.
type MasksOfDates<'a> = [Vec<&'a Mask>; 2];

/// The masks of a date.
pub(super) fn masks_of(time: &TimePoint) -> Vec<&Mask> {
    time.masks.iter().map(|m| &m.mask).collect()
}

/// A registration that was found, and of what.
pub(super) struct Aligning<'a> {
    images: &'a [Image<'a>; 2],
    masks: &'a MasksOfDates<'a>,
    options: &'a Options,
    outcome: &'a Outcome,
}

/// Registers two images without what their dates' masks cover, and asks `more` about what was found; or why nothing was.
pub(super) fn aligned<M>(
    pair: [OfDate<'_>; 2],
    model: Model,
    progress: &Progress,
    more: impl FnOnce(Aligning<'_>) -> Result<M, RegisterError>,
) -> Result<Result<(Outcome, M), String>, Cancelled> {
    let [fixed, moving] = pair.map(|(time, n)| &time.contexts[n]);
    let masks: MasksOfDates<'_> = pair.map(|(time, _)| masks_of(time));
    let images = [
        Image { volume: &fixed.volume, excluded: &masks[0] },
        Image { volume: &moving.volume, excluded: &masks[1] },
    ];
    let measure = if fixed.id == moving.id { Measure::Auto } else { Measure::AcrossModalities };
    let options = Options { model, measure, ..Options::default() };
    let run = || -> Result<(Outcome, M), RegisterError> {
        let outcome = register::register(&images[0], &images[1], &options, progress)?;
        let more = more(Aligning { images: &images, masks: &masks, options: &options, outcome: &outcome })?;
        Ok((outcome, more))
    };
    match run() {
        Err(RegisterError::Cancelled(cancelled)) => Err(cancelled),
        Err(error) => Ok(Err(error.to_string())),
        Ok(found) => Ok(Ok(found)),
    }
}

fn words(model: Model, consistency: &Consistency) -> String {
    let model = match model {
        Model::Rigid => "rigid",
        Model::Affine => "affine",
    };
    let mm = consistency.p95_with_floor_mm();
    let mm = mm.map_or_else(
        || "consistency unknown".into(),
        |mm| format!("consistency {} mm", decimal::text(mm, 2)),
    );
    format!("{model}, {mm}")
}

/// Points of the surfaces of the first date's masks, else of the later date's; of both empty, none.
pub(super) fn surface_points_mm(masks: &MasksOfDates<'_>) -> Vec<DVec3> {
    let of_dates = masks.iter().map(|of_date| surface::points_mm(of_date, MOST_POINTS));
    of_dates.into_iter().find(|points| !points.is_empty()).unwrap_or_default()
}
