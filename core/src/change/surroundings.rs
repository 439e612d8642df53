//! Whether the tissue around a lesion moved with its surface: *displaced, not grown?*
//!
//! Masks alone can't tell growth on one side and shrinkage on the other from a lesion that was pushed aside. The images can,
//! as far as they show the tissue: its displacement between the dates, by [`deform`], laid on the change vectors. Where it explains
//! a vector, that place is marked, with a question: a lesion that grows and pushes the tissue before it looks the same.

use serde::Serialize;
use strum::IntoStaticStr;

use super::{COVERAGE, Change, ChangeError, Choice, SurfaceChange};
use crate::{
    Cancelled, Mask, Progress, Volume,
    case::{Case, TimePoint},
    register::{DeformError, DeformOptions, Deformation, Image, deform},
};

/// Share of a vector that the tissue's displacement must be for it to explain the vector: the uncertainty alone, which may be as long
/// as the vector, explains nothing.
const LEAST_SHARE: f64 = 0.5;
/// Standard deviation of the tissue's displacement beyond which nothing is said of a place, mm.
const MOST_UNSURE_MM: f64 = 0.5;

/// What the tissue says of a change vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tissue {
    /// The vector is within its uncertainty: there is nothing to explain.
    Within,
    /// The tissue moved as the surface did: displaced, not grown or shrunk?
    Moved,
    /// It didn't, or by less.
    Stayed,
    /// The images don't show.
    Unknown,
}

/// Why nothing is said of the tissue around a lesion. Names in JSON are stable, lower case, hyphenated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, IntoStaticStr)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum NotSaid {
    /// No surface moved beyond its uncertainty: there is nothing to explain.
    NothingMoved,
    /// A date has no image.
    NoImage,
    /// Both dates have images, none of the same name: of different sequences.
    OtherSequence,
    /// Too little tissue is in both images.
    TooLittleTissue,
    /// The images show too little in common around the lesion.
    TooLittleInCommon,
    /// The fit isn't believed.
    FitFailed,
}

/// What the tissue around a lesion says.
#[derive(Clone, Debug, PartialEq)]
pub struct Surroundings {
    /// One for each of the change's vectors, in their order; empty where nothing is said.
    pub tissue: Vec<Tissue>,
    /// Its numbers.
    pub report: SurroundingsReport,
    /// Of each of the change's groups; empty where nothing is said.
    pub components: Vec<Option<TissueReport>>,
}

/// How the tissue around a lesion was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SurroundingsReport {
    /// Id of the image that both dates have; `None` where nothing is said.
    pub image: Option<String>,
    /// Why nothing is said; then a component's displacement is by its masks alone.
    pub not_said: Option<NotSaid>,
    /// The same in words.
    pub why: Option<String>,
    /// Spacing of the lattice of splines.
    pub spacing_mm: f64,
    /// How far from the lesion tissue counts.
    pub shell_mm: f64,
    /// Tissue that was compared.
    pub tissue_ml: Option<f64>,
    /// Correlation of the two images there, before the fit and after it.
    pub correlations: Option<[f64; 2]>,
}

/// What the tissue around a component says of its vectors beyond their uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TissueReport {
    /// Where it grew.
    pub growth: TissueCounts,
    /// Where it shrank.
    pub recession: TissueCounts,
    /// Mean displacement of the tissue along the vectors that it explains; `None` without one.
    pub moved_mm: Option<f64>,
}

/// Vectors beyond their uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TissueCounts {
    /// All.
    pub vectors: usize,
    /// Those that the tissue's displacement explains: displaced, not grown or shrunk?
    pub displaced: usize,
    /// Those around which the images don't show how the tissue moved.
    pub unknown: usize,
}

impl TissueCounts {
    /// Share of all that are explained; 0 without any.
    pub fn displaced_share(&self) -> f64 {
        self.displaced as f64 / self.vectors.max(1) as f64
    }

    pub(super) fn add(&mut self, tissue: Tissue) {
        self.vectors += usize::from(tissue != Tissue::Within);
        self.displaced += usize::from(tissue == Tissue::Moved);
        self.unknown += usize::from(tissue == Tissue::Unknown);
    }
}

impl TissueReport {
    /// Whether the tissue moved with most of the surface that moved; `None` where it is unknown around most of it.
    pub fn moved(&self) -> Option<bool> {
        let [vectors, displaced, unknown] = [
            self.growth.vectors + self.recession.vectors,
            self.growth.displaced + self.recession.displaced,
            self.growth.unknown + self.recession.unknown,
        ];
        (2 * unknown < vectors).then(|| 2 * displaced >= vectors - unknown)
    }
}

/// Looks at the tissue around what moved in `change`, which is that of `choice`.
///
/// # Errors
/// [`ChangeError::Cancelled`]; [`ChangeError::Choice`] for what the case doesn't have.
pub fn surroundings(
    case: &Case,
    choice: &Choice,
    change: &Change,
    options: &DeformOptions,
    progress: &Progress,
) -> Result<Surroundings, ChangeError> {
    let Choice { id, dates } = Choice::at(case, Some(&choice.id), choice.dates)?;
    let times = dates.map(|at| &case.time_points[at]);
    let masks = times.map(|time| time.masks.iter().find(|m| m.mask.id() == id).map(|m| &m.mask));
    let [Some(before), Some(after)] = masks else {
        return Err(ChangeError::no_common_mask(case, dates));
    };
    if change.vectors.iter().all(|v| v.flags.within_uncertainty) {
        let why = "no surface moved beyond its uncertainty";
        return Ok(not_said(options, NotSaid::NothingMoved, why.to_owned()));
    }
    let pairs = match images_of(times) {
        Ok(pairs) => pairs,
        Err((not_said_as, why)) => return Ok(not_said(options, not_said_as, why)),
    };
    progress.say("tissue around the lesion");
    let mut first: Option<Surroundings> = None;
    for (image, volumes) in pairs {
        // A later pair may show what the first doesn't.
        let found = of_images(volumes, [before, after], change, options, progress)?;
        let found = Surroundings {
            report: SurroundingsReport { image: Some(image.to_owned()), ..found.report },
            ..found
        };
        if found.report.not_said.is_none() {
            return Ok(found);
        }
        first.get_or_insert(found);
    }
    Ok(first.unwrap_or_else(|| not_said(options, NotSaid::NoImage, "no image at both dates".to_owned())))
}

type Pairs<'a> = Vec<(&'a str, [&'a Volume; 2])>;

/// Images that both dates have, by their names.
fn images_of<'a>([earlier, later]: [&'a TimePoint; 2]) -> Result<Pairs<'a>, (NotSaid, String)> {
    for time in [earlier, later] {
        if time.contexts.is_empty() {
            return Err((NotSaid::NoImage, format!("{} has no image", time.label)));
        }
    }
    let both = |own: &'a crate::case::Context| {
        let other = later.contexts.iter().find(|other| other.id == own.id)?;
        Some((own.id.as_str(), [own.volume.as_ref(), other.volume.as_ref()]))
    };
    let pairs: Pairs<'a> = earlier.contexts.iter().filter_map(both).collect();
    if pairs.is_empty() {
        let ids =
            |time: &TimePoint| time.contexts.iter().map(|c| c.id.as_str()).collect::<Vec<_>>().join(", ");
        let why = format!("the dates have images of different sequences: {}; {}", ids(earlier), ids(later));
        return Err((NotSaid::OtherSequence, why));
    }
    Ok(pairs)
}

fn not_said(options: &DeformOptions, not_said: NotSaid, why: String) -> Surroundings {
    Surroundings {
        tissue: Vec::new(),
        components: Vec::new(),
        report: SurroundingsReport {
            image: None,
            not_said: Some(not_said),
            why: Some(why),
            spacing_mm: options.spacing_mm,
            shell_mm: options.shell_mm,
            tissue_ml: None,
            correlations: None,
        },
    }
}

/// As [`surroundings`], of an earlier and a later image and mask. The image's name isn't filled in.
pub(super) fn of_images(
    [fixed, moving]: [&Volume; 2],
    [before, after]: [&Mask; 2],
    change: &Change,
    options: &DeformOptions,
    progress: &Progress,
) -> Result<Surroundings, Cancelled> {
    let (of_fixed, of_moving) = ([before], [after]);
    let fixed = Image { volume: fixed, excluded: &of_fixed };
    let moving = Image { volume: moving, excluded: &of_moving };
    let field = match deform(&fixed, &moving, options, progress) {
        Ok(field) => field,
        Err(DeformError::Cancelled(cancelled)) => return Err(cancelled),
        Err(error) => {
            let kind = match error {
                DeformError::NoLesion | DeformError::TooLittle { .. } => NotSaid::TooLittleTissue,
                DeformError::Constant(_) | DeformError::Disagree { .. } => NotSaid::TooLittleInCommon,
                DeformError::Folds { .. } | DeformError::Options(_) | DeformError::Cancelled(_) => {
                    NotSaid::FitFailed
                }
            };
            return Ok(not_said(options, kind, error.to_string()));
        }
    };
    let mut found = not_said(options, NotSaid::NothingMoved, String::new());
    let report = &mut found.report;
    (report.not_said, report.why) = (None, None);
    (report.tissue_ml, report.correlations) = (Some(field.tissue_ml), Some(field.correlations));
    let mut groups = vec![(TissueReport::default(), 0.0); change.groups.len()];
    for vector in &change.vectors {
        let (tissue, along_mm) = at(&field, vector);
        found.tissue.push(tissue);
        let Some((group, sum_mm)) = groups.get_mut(vector.group as usize) else { continue };
        if vector.signed_mm > 0.0 {
            group.growth.add(tissue);
        } else {
            group.recession.add(tissue);
        }
        if tissue == Tissue::Moved {
            *sum_mm += along_mm;
        }
    }
    let components = groups.into_iter().map(|(mut group, sum_mm)| {
        let displaced = group.growth.displaced + group.recession.displaced;
        group.moved_mm = (displaced > 0).then(|| sum_mm / displaced as f64);
        (group.growth.vectors + group.recession.vectors > 0).then_some(group)
    });
    found.components = components.collect();
    Ok(found)
}

/// What the tissue says of a vector, and how far it moved along it.
fn at(field: &Deformation, vector: &SurfaceChange) -> (Tissue, f64) {
    if vector.flags.within_uncertainty {
        return (Tissue::Within, 0.0);
    }
    let Some(along) = (vector.to_mm - vector.from_mm).try_normalize() else { return (Tissue::Within, 0.0) };
    let deviation_mm = field.uncertainty_mm(vector.from_mm, along).filter(|mm| *mm <= MOST_UNSURE_MM);
    let Some(deviation_mm) = deviation_mm else { return (Tissue::Unknown, 0.0) };
    let (length_mm, along_mm) = (vector.signed_mm.abs(), field.by_mm(vector.from_mm).dot(along));
    let is_sure = along_mm > COVERAGE * deviation_mm && along_mm >= LEAST_SHARE * length_mm;
    let is_explained = is_sure && (length_mm - along_mm).abs() <= vector.uncertainty_mm;
    (if is_explained { Tissue::Moved } else { Tissue::Stayed }, along_mm)
}
