//! What a case has: the components of a mask at each date, and which of them overlap.

use std::sync::Arc;

use crate::{
    Mask, MaskBits, Progress,
    case::{Case, OrderBasis, TimePoint, in_two_spaces},
    change::Choice,
    dates,
};

use super::{
    DEFAULT_SMALLEST_ML, DEFAULT_WITHIN_MM,
    diameters::DiameterMode,
    edits::{ANCHOR_MM, Anchor},
    error::LesionsError,
    links::{self, Link, Node},
    parts::{DateParts, Measures},
    values::Beside,
};

/// What lesions are components of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Of {
    /// One mask.
    Mask(String),
    /// What any of these masks covers.
    Union(Vec<String>),
}

impl Of {
    /// Its name in anchors and reports: the masks' ids in alphabetical order, joined by `+`.
    pub fn name(&self) -> String {
        self.ids().join("+")
    }

    fn ids(&self) -> Vec<&str> {
        match self {
            Self::Mask(id) => vec![id],
            Self::Union(ids) => {
                let mut ids: Vec<&str> = ids.iter().map(String::as_str).collect();
                ids.sort_unstable();
                ids.dedup();
                ids
            }
        }
    }
}

/// Options of [`find`].
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// What lesions are components of.
    pub of: Of,
    /// Smaller components are small: at least 0.
    pub smallest_ml: f64,
    /// How diameters are measured.
    pub mode: DiameterMode,
    /// Axis of the grid along which slices follow each other, 0 to 2; `None` for the one nearest to inferior–superior.
    pub axis: Option<usize>,
    /// The farthest that components without a common voxel are linked, at least 0.
    pub within_mm: f64,
    /// Whether the dates' images are asked whether the dates lie in one space.
    pub asks_images: bool,
    /// The image whose values in lesions are reported, by id.
    pub image: Option<String>,
    /// Whether the movement of their surface since the date before is reported: of one mask, not of a union.
    pub surface: bool,
}

impl Options {
    /// The defaults, for lesions of `of`.
    pub fn new(of: Of) -> Self {
        let mode = DiameterMode::default();
        let (smallest_ml, within_mm) = (DEFAULT_SMALLEST_ML, DEFAULT_WITHIN_MM);
        let (image, surface) = (None, false);
        Self { of, smallest_ml, mode, axis: None, within_mm, asks_images: true, image, surface }
    }
}

/// The components of all dates and the links proposed between them, before any edit.
#[derive(Clone, Debug)]
pub struct Found {
    /// Name of the case.
    pub case: String,
    /// Name of what lesions are components of.
    pub of: String,
    /// The options.
    pub options: Options,
    /// Labels of all dates, in time order.
    pub times: Vec<String>,
    /// Days since the first date; `None` where the labels aren't calendar dates in order.
    pub days: Option<Vec<f64>>,
    /// What is uncertain, in one line each.
    pub warnings: Vec<String>,
    pub(super) case_voxel_ml: f64,
    /// Parts and mask on the case grid of each date; `None` where a date lacks the mask. Shared: edits change few.
    pub(super) dates: Vec<Option<Arc<(DateParts, Mask)>>>,
    /// Consecutive dates that have the mask, and why they can't be linked.
    pub(super) pairs: Vec<([usize; 2], Option<String>)>,
    pub(super) links: Vec<Link>,
    pub(super) beside: Beside,
}

impl Found {
    pub(super) fn measures(&self) -> Measures {
        let Options { smallest_ml, mode, axis, .. } = self.options;
        Measures { smallest_ml, mode, axis }
    }

    pub(super) fn parts(&self, date: usize) -> Option<&DateParts> {
        self.dates.get(date)?.as_ref().map(|date| &date.0)
    }

    /// The component that an edit means; why, where it means none.
    pub(super) fn node(&self, anchor: &Anchor) -> Result<Node, String> {
        let Anchor { time, of, at_mm } = anchor;
        if *of != self.of {
            return Err(format!("found a component of {of}, expected one of {}", self.of));
        }
        let date = self.times.iter().position(|label| label == time);
        let date = date.ok_or_else(|| format!("found the date {time}, expected one of the case"))?;
        let parts = self.parts(date).ok_or_else(|| format!("found no mask {of} at {time}, expected one"))?;
        let part = parts.at(*at_mm, ANCHOR_MM).ok_or_else(|| {
            format!("found no component of {of} at {time} within {ANCHOR_MM} mm of {at_mm:.1}, expected one")
        })?;
        Ok((date, part))
    }

    /// Proposes the links anew.
    pub(super) fn link(&mut self) -> Result<(), LesionsError> {
        let mut all = Vec::new();
        for ([a, b], reason) in &self.pairs {
            if let (None, Some(earlier), Some(later)) = (reason, self.parts(*a), self.parts(*b)) {
                all.extend(links::propose([*a, *b], [earlier, later], self.options.within_mm)?);
            }
        }
        self.links = all;
        Ok(())
    }
}

/// Finds the components of `options.of` at all dates, measures them, and proposes links between consecutive dates: by
/// overlap on the case grid, then by distance. Dates that don't lie in one space, or whose order is unknown, aren't linked.
///
/// Components are those of the mask on its native grid, where the case grid preserves it; else, and for unions, on the case
/// grid.
///
/// # Errors
/// [`LesionsError`].
pub fn find(case: &Case, options: &Options, progress: &Progress) -> Result<Found, LesionsError> {
    check(options)?;
    let ids = options.of.ids();
    let mut found = Found {
        case: case.name.clone(),
        of: options.of.name(),
        options: options.clone(),
        times: case.time_points.iter().map(|time| time.label.clone()).collect(),
        days: dates::days_since_first(&case.time_labels()),
        warnings: Vec::new(),
        case_voxel_ml: case.grid.volume_ml(1),
        dates: Vec::new(),
        pairs: Vec::new(),
        links: Vec::new(),
        beside: Beside::default(),
    };
    let measures = found.measures();
    for time in &case.time_points {
        progress.check()?;
        progress.say(format!("Lesions of {}", time.label));
        let masks: Vec<_> = time.masks.iter().filter(|m| ids.contains(&m.mask.id())).collect();
        if !masks.is_empty() && masks.len() < ids.len() {
            let text =
                format!("{}: found {} of the masks {}, expected all", time.label, masks.len(), found.of);
            found.warnings.push(text);
        }
        let date = match masks[..] {
            [] => None,
            [one] => {
                let native = Some((&one.native_grid, one.native_voxels));
                Some((DateParts::new(&one.mask, native, &measures, progress)?, one.mask.clone()))
            }
            [first, ..] => {
                let mut bits = MaskBits::empty(case.grid.dims());
                masks.iter().for_each(|m| {
                    bits.words_mut().iter_mut().zip(m.mask.bits().words()).for_each(|(a, b)| *a |= b);
                });
                let union = Mask::new(found.of.clone(), case.grid.clone(), bits)
                    .unwrap_or_else(|| first.mask.clone());
                Some((DateParts::new(&union, None, &measures, progress)?, union))
            }
        };
        if let Some((parts, mask)) = &date {
            let lost = masks.iter().filter(|m| masks.len() == 1 && !parts.is_native && m.native_voxels > 0);
            found.warnings.extend(lost.map(|m| {
                format!(
                    "{}: found {} voxels of {} on the case grid, which aren't its own {} voxels; expected a case grid as \
                     fine as the mask's. Lesions are measured on the case grid",
                    time.label,
                    mask.voxels(),
                    m.mask.id(),
                    m.native_voxels
                )
            }));
            if parts.unplaced > 0 {
                let text =
                    format!("{}: found {} voxels of no component, expected none", time.label, parts.unplaced);
                found.warnings.push(text);
            }
        }
        found.dates.push(date.map(Arc::new));
    }
    let present: Vec<usize> = (0..found.dates.len()).filter(|at| found.parts(*at).is_some()).collect();
    if present.is_empty() {
        return Err(no_mask(case, &found.of));
    }
    for pair in present.windows(2) {
        if let [a, b] = *pair {
            let reason = not_linked(case, [a, b], &ids, options, progress)?;
            found.pairs.push(([a, b], reason));
        }
    }
    found.link()?;
    if let Some(id) = &options.image {
        if !case.has_image(id) {
            let found = format!("the image {id}");
            return Err(LesionsError::Option { found, expected: "one of the case" });
        }
        found.beside.image(case, id);
    }
    if let (Of::Mask(id), true) = (&options.of, options.surface) {
        let linked = found.pairs.iter().filter(|(_, reason)| reason.is_none());
        for dates in linked.map(|(dates, _)| *dates).collect::<Vec<_>>() {
            found.beside.surface(case, dates, id, progress)?;
        }
    }
    Ok(found)
}

/// The mask whose lesions are found where none is named: the one that a comparison of the dates takes, else the first.
pub fn default_mask(case: &Case) -> Option<String> {
    let compared = Choice::default_dates(case).and_then(|dates| Choice::at(case, None, dates)).ok();
    let first = || case.time_points.iter().find_map(|time| Some(time.masks.first()?.mask.id().to_owned()));
    compared.map(|choice| choice.id).or_else(first)
}

fn check(options: &Options) -> Result<(), LesionsError> {
    let wrong = |found: String, expected| Err(LesionsError::Option { found, expected });
    let is_size = |value: f64| value.is_finite() && value >= 0.0;
    if !is_size(options.smallest_ml) {
        return wrong(
            format!("a smallest lesion of {} ml", options.smallest_ml),
            "a finite volume of at least 0",
        );
    }
    if !is_size(options.within_mm) {
        return wrong(format!("a distance of {} mm", options.within_mm), "a finite distance of at least 0");
    }
    if options.axis.is_some_and(|axis| axis > 2) {
        return wrong(format!("slices along axis {:?}", options.axis), "0, 1 or 2");
    }
    Ok(())
}

fn no_mask(case: &Case, of: &str) -> LesionsError {
    let masks = case.time_points.iter().flat_map(|time: &TimePoint| &time.masks);
    let mut known: Vec<&str> = masks.map(|m| m.mask.id()).collect();
    known.sort_unstable();
    known.dedup();
    LesionsError::NoMask { case: case.name.clone(), of: of.to_owned(), known: known.join(", ") }
}

/// Why lesions of two dates can't be linked.
fn not_linked(
    case: &Case,
    dates: [usize; 2],
    ids: &[&str],
    options: &Options,
    progress: &Progress,
) -> Result<Option<String>, LesionsError> {
    if case.order == OrderBasis::Unknown {
        return Ok(Some("found dates whose order isn't stated, expected their order".into()));
    }
    Ok(in_two_spaces(case, dates, [ids, ids], options.asks_images, progress)?)
}
