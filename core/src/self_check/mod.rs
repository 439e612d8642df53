//! A case grades itself: known changes are put into its own earlier date, and the registration, matching and change of the program run on
//! them.
//!
//! The later date of a run is made from the earlier one: the mask as the signed distance to its smoothed surface, moved outwards or
//! inwards by a known length, turned and shifted a little, and rasterised once on its own voxels; the image with the same change painted
//! in, moved likewise, brighter or darker, with noise. Then [`register()`](crate::register::register()) finds the move, the later mask is
//! resampled onto the case grid as a case's transforms do, and [`change_with`](crate::change::change_with) compares. What is true comes
//! from how it was made, not from what is checked: docs/self-check.md.

mod picture;
mod plan;
mod random;
mod report;
mod run;
mod shape;
mod sites;
#[cfg(test)]
mod tests;

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    Cancelled, Grid, Mask, Progress,
    case::{Case, CaseMask, Context},
    change::{self, ChangeError, ChangeOptions, Sampling},
    export::MeshError,
    register,
    resample::SAME_PLACE_VOXELS,
    surface,
};
use picture::{Picture, WORKING_MM};
use plan::{Known, Side};
use random::Random;
pub use report::{
    Comes, GOOD, LesionCheck, Recovered, RegistrationCheck, SelfCheckReport, SurfaceCheck, Unchanged, Where,
};
use run::{Bench, MOST_DEGREES, MOST_GAIN, MOST_MM, Measured, NOISE};
use shape::{Shape, looked_up};
use sites::Sites;

/// Known movements of the surface, mm.
const MOVES_MM: [f64; 5] = [-2.0, -1.0, 0.0, 1.0, 2.0];
/// Volumes of new lesions, ml; the one that vanishes.
const NEW_ML: [f64; 4] = [0.1, 0.2, 0.5, 1.0];
const GONE_ML: f64 = 0.5;
/// How far from the mask's box new lesions may lie.
const SITES_MM: f64 = 35.0;
/// Points of the surface at which registration's error counts.
const MOST_POINTS: usize = 500;
/// Points that the runs' registrations compare.
const RUN_POINTS: usize = 20_000;
/// Runs without change of which one may have a false call.
const ONE_IN: usize = 100;
/// Voxels of a lesion's box up to which all runs fit into a minute.
const MOST_VOXELS: usize = 1_500_000;
/// Share of lesions that must be found.
const FOUND: f64 = 0.9;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Seed of the random numbers: the same seed gives the same report.
    pub seed: u64,
    /// Runs without change, 1 to 10,000.
    pub unchanged_runs: usize,
    /// Runs of each known change, 1 to 1000.
    pub runs: usize,
    /// Registrations repeated on the image as it is, 0 to 100.
    pub full_runs: usize,
    /// Whether large lesions have fewer runs than these, so that it takes about a minute.
    pub fits_minute: bool,
    /// What changes are computed and called with.
    pub change: ChangeOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            unchanged_runs: 100,
            runs: 6,
            full_runs: 2,
            fits_minute: true,
            change: ChangeOptions::default(),
        }
    }
}

impl Options {
    /// With as many runs as fit into a minute on two cores, for a lesion whose box has this many voxels.
    fn fitting(self, voxels: usize, notes: &mut Vec<String>) -> Self {
        if !self.fits_minute || voxels <= MOST_VOXELS {
            return self;
        }
        let share = |runs: usize, least: usize| {
            let fitting = (runs as f64 * MOST_VOXELS as f64 / voxels as f64).floor() as usize;
            fitting.max(least.min(runs))
        };
        let fitting = Self {
            unchanged_runs: share(self.unchanged_runs, 10),
            runs: share(self.runs, 1),
            full_runs: self.full_runs.min(1),
            ..self
        };
        notes.push(format!(
            "The lesion is large: {} runs without change in place of {}, {} of each known change in place of {}, so that it takes about \
             a minute.",
            fitting.unchanged_runs, self.unchanged_runs, fitting.runs, self.runs
        ));
        fitting
    }
}

impl Options {
    /// The default runs, with changes computed and called as `change` says.
    pub fn of(change: ChangeOptions) -> Self {
        Self { change, ..Self::default() }
    }
}

/// The mask and the date into which changes are put.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// The mask's id.
    pub id: String,
    /// Index of the date in [`Case::time_points`].
    pub date: usize,
    /// Index of the date with which it is compared, where it is: the registration between them says how uncertain a change is.
    pub against: Option<usize>,
}

/// Why a case can't grade itself.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SelfCheckError {
    /// The case has no such mask or date.
    #[error("{case}: found {found}, expected {expected}")]
    Target {
        /// The case.
        case: String,
        /// What was asked for.
        found: String,
        /// What it has.
        expected: String,
    },
    /// An option is out of its range.
    #[error("found {0} out of its range")]
    Options(&'static str),
    /// The mask is empty.
    #[error("found an empty mask, expected one with a lesion into which changes can be put")]
    Empty,
    /// The mask's surface can't be made.
    #[error(transparent)]
    Surface(MeshError),
    /// A change can't be computed.
    #[error(transparent)]
    Change(ChangeError),
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<MeshError> for SelfCheckError {
    fn from(error: MeshError) -> Self {
        match error {
            MeshError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            MeshError::Empty => Self::Empty,
            error => Self::Surface(error),
        }
    }
}

impl Target {
    /// The earlier date of a comparison.
    pub fn of(choice: &change::Choice) -> Self {
        let [date, later] = choice.dates;
        Self { id: choice.id.clone(), date, against: Some(later) }
    }

    /// Mask `of` at date `time`, by its label; without them the first date, and its first mask.
    ///
    /// # Errors
    /// [`SelfCheckError::Target`].
    pub fn resolve(case: &Case, of: Option<&str>, time: Option<&str>) -> Result<Self, SelfCheckError> {
        let wrong = |found: String, expected: String| SelfCheckError::Target {
            case: case.name.clone(),
            found,
            expected,
        };
        let date = match time {
            None => 0,
            Some(label) => case.time_at(label).ok_or_else(|| {
                wrong(format!("no date {label}"), format!("one of {}", case.time_labels().join(", ")))
            })?,
        };
        let masks = case.time_points.get(date).map(|time| time.masks.as_slice()).unwrap_or_default();
        let ids: Vec<&str> = masks.iter().map(|m| m.mask.id()).collect();
        let id = match of {
            None => ids.first().copied().ok_or_else(|| wrong("no mask".into(), "a mask".into()))?,
            Some(id) if ids.contains(&id) => id,
            Some(id) => return Err(wrong(format!("no mask {id}"), format!("one of {}", ids.join(", ")))),
        };
        Ok(Self { id: id.to_owned(), date, against: None })
    }
}

/// Runs the check.
///
/// # Errors
/// [`SelfCheckError`].
pub fn self_check(
    case: &Case,
    target: &Target,
    options: &Options,
    progress: &Progress,
) -> Result<SelfCheckReport, SelfCheckError> {
    let within = |ok: bool, what| if ok { Ok(()) } else { Err(SelfCheckError::Options(what)) };
    within((1..=10_000).contains(&options.unchanged_runs), "unchanged runs")?;
    within((1..=1000).contains(&options.runs), "runs")?;
    within(options.full_runs <= 100, "full runs")?;
    let missing = || SelfCheckError::Target {
        case: case.name.clone(),
        found: format!("no mask {} at date {}", target.id, target.date),
        expected: "a mask of the case".into(),
    };
    let time = case.time_points.get(target.date).ok_or_else(missing)?;
    let mask = time.masks.iter().find(|m| m.mask.id() == target.id).ok_or_else(missing)?;
    let later = target.against.and_then(|at| case.time_points.get(at));
    let measured_mm = later.and_then(|later| {
        change::registration_mm(case, &target.id, [&time.label, &later.label])
            .filter(|_| options.change.uses_consistency)
    });
    let change = ChangeOptions {
        registration_mm: measured_mm.unwrap_or(options.change.registration_mm),
        is_aligned: true,
        ..options.change
    };
    let image = image_of(time.contexts.as_slice(), later.map(|later| later.contexts.as_slice()));
    let options = Options { change, ..*options };
    let check = Check { mask, case_grid: &case.grid, image };
    Ok(SelfCheckReport { date: time.label.clone(), ..check.run(&options, progress)? })
}

/// The image that registration of the two dates uses: the first that both have, else the first.
fn image_of<'a>(earlier: &'a [Context], later: Option<&[Context]>) -> Option<&'a Context> {
    let has = |own: &&Context| later.is_some_and(|later| later.iter().any(|other| other.id == own.id));
    earlier.iter().find(has).or(earlier.first())
}

/// What is checked.
struct Check<'a> {
    mask: &'a CaseMask,
    case_grid: &'a Grid,
    image: Option<&'a Context>,
}

/// Kinds of runs, for their random numbers.
const UNCHANGED: u64 = 1;
const LESIONS: u64 = 2;
const FULL: u64 = 3;
const SURFACES: u64 = 16;

impl Check<'_> {
    fn run(&self, options: &Options, progress: &Progress) -> Result<SelfCheckReport, SelfCheckError> {
        progress.say("self-check: surface");
        let mut notes = Vec::new();
        let native = self.native(&mut notes);
        let most_mm = MOVES_MM.into_iter().fold(0.0, f64::max);
        let shape = Shape::new(&native, most_mm, &progress.part())?.ok_or(SelfCheckError::Empty)?;
        let options = &options.fitting(shape.grid().voxel_count(), &mut notes);
        let surface_mm = surface::points_mm(&[&native], MOST_POINTS);
        let whole_mm = surface::points_mm(&[&native], usize::MAX);
        let picture = self.image.and_then(|image| Picture::coarse(&image.volume, &shape));
        let spread = shape.grid().bounds_mm();
        let centre_mm = surface_mm.iter().sum::<DVec3>() / surface_mm.len().max(1) as f64;
        let voxel_mm = picture.as_ref().map_or(WORKING_MM, |p| p.volume.grid().spacing_mm().max_element());
        let fast = register::Options {
            start: Some(glam::DAffine3::IDENTITY),
            finest_mm: WORKING_MM,
            max_points: RUN_POINTS,
            ..register::Options::default()
        };
        let mut bench = Bench {
            sampling: Sampling::new(native.grid(), self.case_grid),
            native,
            case_grid: self.case_grid,
            picture,
            volume_ml: shape.volume_ml([0.0; 2], &|mm, _| mm < 0.0),
            centre_mm,
            surface_mm,
            change: options.change,
            register: fast,
            seed: options.seed,
            shape,
        };
        self.tell_image(&mut bench, &mut notes, progress)?;
        let surface_runs = 2 * MOVES_MM.len() - 1;
        let total = options.unchanged_runs + options.runs * (surface_runs + 1) + options.full_runs;
        progress.expect(total as u64);
        progress.say("self-check: no change");
        let quiet = Bench { change: ChangeOptions { by_skeleton: false, ..bench.change }, ..bench };
        let unchanged =
            runs(options.unchanged_runs, progress, |run| quiet.run(&still(UNCHANGED, run), progress))?;
        let bench = Bench { change: options.change, ..quiet };
        let mut refused = unchanged.iter().filter(|run| run.is_none()).count();
        let mut errors_mm: Vec<f64> = unchanged.iter().flatten().filter_map(|run| run.error_mm).collect();
        let mut surfaces = Vec::new();
        for (kind, by_mm) in (0..).zip(MOVES_MM) {
            for (of, at) in (0..).zip([Where::Evenly, Where::OneSide]) {
                if by_mm == 0.0 && at == Where::OneSide {
                    continue;
                }
                progress.say(format!("self-check: {by_mm:+} mm"));
                let kind = SURFACES + 2 * kind + of;
                let found = runs(options.runs, progress, |run| {
                    let side = (at == Where::OneSide).then(|| side(&bench, spread, kind, run));
                    let known = Known { by_mm, side };
                    bench.run(&run::Case { known, ..still(kind, run) }, progress)
                })?;
                refused += found.iter().filter(|run| run.is_none()).count();
                errors_mm.extend(found.iter().flatten().filter_map(|run| run.error_mm));
                surfaces.push(surface_check(by_mm, at, &found));
            }
        }
        progress.say("self-check: new lesions");
        let sites = Sites::around(&bench.shape, &whole_mm, bench.picture.as_ref(), SITES_MM);
        let found = runs(options.runs, progress, |run| {
            let mut random = Random::of(options.seed, LESIONS << 8, run);
            let fits = |place: DVec3| bench.picture.as_ref().is_none_or(|picture| picture.covers(place));
            let balls = sites.balls(&[NEW_ML.as_slice(), &[GONE_ML]].concat(), &fits, &mut random);
            let (new, gone) = balls.split_at(NEW_ML.len());
            let case = run::Case {
                new: new.iter().flatten().copied().collect(),
                gone: gone.iter().flatten().copied().collect(),
                ..still(LESIONS, run)
            };
            Ok(bench.run(&case, progress)?.map(|measured| (case, measured)))
        })?;
        refused += found.iter().filter(|run| run.is_none()).count();
        errors_mm.extend(found.iter().flatten().filter_map(|(_, run)| run.error_mm));
        let lesions = lesion_checks(&found);
        if lesions.iter().map(|check| check.runs).sum::<usize>() == 0 {
            notes.push("No room for new lesions was found around this one: none was put in.".into());
        }
        progress.say("self-check: registration");
        let full = self.full(&bench, options, progress)?;
        let has_picture = bench.picture.is_some();
        let registration = has_picture.then(|| registration_check(errors_mm, refused, voxel_mm, &full));
        notes.push(format!(
            "Each run: moved by up to {MOST_MM} mm and {MOST_DEGREES}°, {}rasterised once on the mask's own voxels, then resampled \
             onto the case grid as registered dates are.",
            if has_picture {
                format!(
                    "the image with the change painted in, up to {:.0} % brighter or darker, with noise of {:.0} % of its range, ",
                    MOST_GAIN * 100.0,
                    NOISE * 100.0
                )
            } else {
                String::new()
            }
        ));
        Ok(SelfCheckReport {
            mask: self.mask.mask.id().to_owned(),
            date: String::new(),
            image: self.image.filter(|_| has_picture).map(|image| image.id.clone()),
            seed: options.seed,
            volume_ml: bench.native.volume_ml(),
            registration_mm: options.change.registration_mm,
            unchanged: unchanged_check(&unchanged),
            surfaces,
            lesions,
            registration,
            notes,
        })
    }

    /// The mask on the grid it was drawn on, where its voxels can be had from the case grid.
    fn native(&self, notes: &mut Vec<String>) -> Mask {
        let CaseMask { mask, native_grid, native_voxels, .. } = self.mask;
        if self.case_grid.same_place(native_grid, SAME_PLACE_VOXELS) {
            return mask.clone();
        }
        let bits = looked_up(mask.bits(), mask.grid(), native_grid);
        let differs = bits.count().abs_diff(*native_voxels) as f64 > 0.02 * *native_voxels as f64;
        let own = Mask::new(mask.id(), native_grid.clone(), bits);
        match own.filter(|_| !differs) {
            Some(own) => own,
            None => {
                notes.push(
                    "The mask's own voxels are finer than the case grid: changes are put in on the case grid.".into(),
                );
                mask.clone()
            }
        }
    }

    /// Says why no image takes part, where none does: by a trial.
    fn tell_image(
        &self,
        bench: &mut Bench<'_>,
        notes: &mut Vec<String>,
        progress: &Progress,
    ) -> Result<(), SelfCheckError> {
        let no_image = "the true move is undone exactly, so that the shares hold for masks alone";
        let Some(image) = self.image else {
            notes.push(format!("Without an image there is no registration: {no_image}."));
            return Ok(());
        };
        if bench.picture.is_some() && bench.run(&still(UNCHANGED, 0), progress)?.is_none() {
            bench.picture = None;
        }
        notes.push(if bench.picture.is_some() {
            format!(
                "Registration in each run: the program's own, on {} averaged to voxels of about {WORKING_MM} mm, down to {WORKING_MM} mm, \
                 from where the headers put the dates, {RUN_POINTS} points; without the search for a start.",
                image.id
            )
        } else {
            format!("The image {} can't be registered with itself: {no_image}.", image.id)
        });
        Ok(())
    }

    /// Largest errors of registrations as the program runs them on the image itself.
    fn full(
        &self,
        bench: &Bench<'_>,
        options: &Options,
        progress: &Progress,
    ) -> Result<Vec<f64>, SelfCheckError> {
        let Some(image) = self.image.filter(|_| bench.picture.is_some() && options.full_runs > 0) else {
            progress.advance(options.full_runs as u64)?;
            return Ok(Vec::new());
        };
        let Some(picture) = Picture::of(&image.volume, &bench.shape) else { return Ok(Vec::new()) };
        let full = bench.with(picture, register::Options::default());
        let mut errors_mm = Vec::new();
        for run in 0..options.full_runs {
            let measured = full.run(&still(FULL, run as u64), progress)?;
            errors_mm.extend(measured.and_then(|run| run.error_mm));
            progress.advance(1)?;
        }
        Ok(errors_mm)
    }
}

impl<'a> Bench<'a> {
    /// The same with another image and other options of its registration.
    fn with(&self, picture: Picture, register: register::Options) -> Bench<'a> {
        Bench {
            shape: self.shape.clone(),
            native: self.native.clone(),
            case_grid: self.case_grid,
            sampling: self.sampling,
            picture: Some(picture),
            volume_ml: self.volume_ml,
            centre_mm: self.centre_mm,
            surface_mm: self.surface_mm.clone(),
            change: ChangeOptions { by_skeleton: false, ..self.change },
            register,
            seed: self.seed,
        }
    }
}

/// A run without change.
fn still(kind: u64, run: u64) -> run::Case {
    run::Case { known: Known::NOTHING, new: Vec::new(), gone: Vec::new(), kind, run }
}

/// Runs 0 to `count`, two or more at once, in their order.
fn runs<T: Send>(
    count: usize,
    progress: &Progress,
    run: impl Fn(u64) -> Result<T, SelfCheckError> + Sync,
) -> Result<Vec<T>, SelfCheckError> {
    let one = |at: usize| {
        let found = run(at as u64)?;
        progress.advance(1)?;
        Ok(found)
    };
    (0..count).into_par_iter().map(one).collect()
}

/// The side of a run: any direction, increasing over half of the lesion's extent.
fn side(bench: &Bench<'_>, (low, high): (DVec3, DVec3), kind: u64, run: u64) -> Side {
    let mut random = Random::of(bench.seed, kind << 8, run);
    let towards = random.direction();
    let extent_mm = (high - low).dot(towards.abs());
    Side { towards, middle_mm: bench.centre_mm, half_mm: (0.25 * extent_mm).max(1.0) }
}

fn unchanged_check(found: &[Option<Measured>]) -> Unchanged {
    let runs = found.iter().flatten().count();
    let count = |of: &dyn Fn(&Measured) -> bool| found.iter().flatten().filter(|run| of(run)).count();
    let shares =
        found.iter().flatten().flat_map(|run| [run.call.grew_share, run.call.shrank_share]).flatten();
    let false_calls = count(&|run| run.call.is_change());
    Unchanged {
        runs,
        false_calls,
        grew: count(&|run| run.call.grew),
        shrank: count(&|run| run.call.shrank),
        appeared: count(&|run| run.call.appeared),
        vanished: count(&|run| run.call.vanished),
        pieces: count(&|run| run.call.pieces),
        most_share: shares.reduce(f64::max),
        volume_ml: found.iter().flatten().map(|run| run.volume_ml).sum::<f64>() / runs.max(1) as f64,
        marked: false_calls * ONE_IN > runs,
    }
}

fn surface_check(known_mm: f64, at: Where, found: &[Option<Measured>]) -> SurfaceCheck {
    let all: Vec<&Measured> = found.iter().flatten().collect();
    let moves = |of: &dyn Fn(&Measured) -> Option<f64>| -> Vec<(f64, f64)> {
        all.iter().filter_map(|run| Some((of(run)?, run.known_mm))).collect()
    };
    let (moved, nearest) = (moves(&|run| run.mean_mm), moves(&|run| run.nearest_mm));
    let volumes: Vec<(f64, f64)> = all.iter().map(|run| (run.volume_ml, run.known_ml)).collect();
    let mean = |of: &[(f64, f64)]| of.iter().map(|pair| pair.0).sum::<f64>() / of.len().max(1) as f64;
    SurfaceCheck {
        known_mm,
        at,
        runs: all.len(),
        known_mean_mm: all.iter().map(|run| run.known_mm).sum::<f64>() / all.len().max(1) as f64,
        mean_mm: mean(&moved),
        nearest_mean_mm: mean(&nearest),
        surface: Recovered::of(&moved),
        nearest: Recovered::of(&nearest),
        volume: Recovered::of(&volumes),
        called: all.iter().filter(|run| run.call.is_change()).count(),
    }
}

fn lesion_checks(found: &[Option<(run::Case, Measured)>]) -> Vec<LesionCheck> {
    let check = |comes: Comes, known_ml: f64| {
        let lists = found.iter().flatten().map(|(case, measured)| match comes {
            Comes::New => (&case.new, &measured.new),
            Comes::Vanished => (&case.gone, &measured.gone),
        });
        let all = lists.flat_map(|(balls, found)| balls.iter().zip(found));
        let all: Vec<Option<f64>> =
            all.filter(|(ball, _)| ball.volume_ml == known_ml).map(|(_, found)| *found).collect();
        let volumes: Vec<(f64, f64)> = all.iter().flatten().map(|ml| (*ml, known_ml)).collect();
        LesionCheck {
            comes,
            known_ml,
            runs: all.len(),
            found: volumes.len(),
            volume: Recovered::of(&volumes),
            marked: (volumes.len() as f64) < FOUND * all.len() as f64,
        }
    };
    let new = NEW_ML.into_iter().map(|ml| check(Comes::New, ml));
    new.chain(std::iter::once(check(Comes::Vanished, GONE_ML))).collect()
}

fn registration_check(
    mut errors_mm: Vec<f64>,
    refused: usize,
    voxel_mm: f64,
    full: &[f64],
) -> RegistrationCheck {
    errors_mm.sort_unstable_by(f64::total_cmp);
    RegistrationCheck {
        runs: errors_mm.len(),
        refused,
        voxel_mm,
        median_mm: errors_mm.get(errors_mm.len() / 2).copied(),
        max_mm: errors_mm.last().copied(),
        full_max_mm: full.iter().copied().reduce(f64::max),
        full_runs: full.len(),
    }
}
