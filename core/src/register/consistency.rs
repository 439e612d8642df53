//! How far repeated registrations of the same images disagree at given points.

use crate::Progress;
use glam::{DAffine3, DVec3};

use super::{
    pose::{inverse, nearest_turn, rotated},
    prepared::Prepared,
    types::{Image, Measure, Options, Outcome, RegisterError},
};

/// Length and angle of the perturbations from which fits are repeated.
const SHIFT_MM: f64 = 2.0;
const TURN_DEGREES: f64 = 2.0;
/// Directions of the perturbations: corners of a tetrahedron.
const DIRECTIONS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];

/// Distances between where two transforms put the same points, over points and repetitions, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Half of the distances are at most this.
    pub median_mm: f64,
    /// 95 % of the distances are at most this.
    pub p95_mm: f64,
    /// The largest distance.
    pub max_mm: f64,
}

impl Spread {
    /// `None` for no distances.
    fn of(mut distances_mm: Vec<f64>) -> Option<Self> {
        distances_mm.sort_by(f64::total_cmp);
        let last = distances_mm.len().checked_sub(1)?;
        let quantile = |q: f64| distances_mm[((last as f64 * q).ceil() as usize).min(last)];
        Some(Self { median_mm: quantile(0.5), p95_mm: quantile(0.95), max_mm: distances_mm[last] })
    }
}

/// How far repeated registrations disagree. **Not accuracy**: what pulls all of them alike (distortion, a contrast that
/// moves an edge) doesn't show here (Rohlfing 2012).
#[derive(Clone, Debug, PartialEq)]
pub struct Consistency {
    /// Fits from perturbed starts (2 mm and 2° in four directions), each with other points compared.
    pub starts: Option<Spread>,
    /// The fit with the images exchanged, inverted. Fits are symmetric, so this shows the choice of points only.
    pub direction: Option<Spread>,
    /// The fit without leaving masks out; `None` where none were left out.
    pub lesions: Option<Spread>,
    /// All of these together.
    pub all: Option<Spread>,
    /// Half of the coarser image's voxel (edge of a cube of its volume), mm: what smaller figures mean no more than.
    pub floor_mm: f64,
    /// Repetitions that came to an end.
    pub runs: usize,
    /// Repetitions that came to none: where there is any, the figures are too good.
    pub failed: usize,
}

impl Consistency {
    /// The 95th percentile over all repetitions, at least the floor; `None` where no repetition came to an end.
    pub fn p95_with_floor_mm(&self) -> Option<f64> {
        self.all.map(|all| all.p95_mm.max(self.floor_mm))
    }
}

/// How far points end from where they began on their way around a loop of registrations, A to B, B to C and back to A: each
/// of `legs` maps the space of one image to that of the next one, RAS mm. `None` for no points.
pub fn around(legs: &[DAffine3], points_mm: &[DVec3]) -> Option<Spread> {
    let end = |start: DVec3| legs.iter().fold(start, |at, leg| leg.transform_point3(at));
    Spread::of(points_mm.iter().map(|start| end(*start).distance(*start)).collect())
}

/// Repeats the fine levels of a registration and compares the transforms at `points_mm` (RAS mm of the fixed image: the
/// tumour's surface). Takes about six times as long as the fine levels.
///
/// `options` are those of the registration, but for its measure, which is the outcome's, and its start.
///
/// # Errors
/// As [`register`](super::register) for images and options; a fit that fails is counted instead.
pub fn consistency(
    fixed: &Image<'_>,
    moving: &Image<'_>,
    options: &Options,
    outcome: &Outcome,
    points_mm: &[DVec3],
    progress: &Progress,
) -> Result<Consistency, RegisterError> {
    options.check()?;
    let reference = outcome.moving_from_fixed;
    if inverse(reference).is_none() {
        return Err(RegisterError::NotFinite("a transform"));
    }
    let has_masks = !fixed.excluded.is_empty() || !moving.excluded.is_empty();
    progress.say("levels");
    let prepared = Prepared::new(fixed, moving, options, progress)?.for_measure(outcome.measure, progress)?;
    let levels = (prepared.resolutions.len() - prepared.fine_from()) as u64;
    progress.expect(levels * (DIRECTIONS.len() as u64 + 1 + u64::from(has_masks)));
    let centre_mm = points_mm.iter().sum::<DVec3>() / points_mm.len().max(1) as f64;
    let mut repeat =
        Repeat { measure: outcome.measure, reference, points_mm, runs: 0, failed: 0, all: Vec::new() };

    let turn = nearest_turn(reference.matrix3);
    let turned = prepared.turned(turn);
    let mut starts = Vec::new();
    for (index, direction) in DIRECTIONS.iter().enumerate() {
        let direction = DVec3::from_array(*direction) / 3_f64.sqrt();
        let turn = rotated(direction * TURN_DEGREES.to_radians());
        let perturbation =
            DAffine3 { matrix3: turn, translation: centre_mm - turn * centre_mm + direction * SHIFT_MM };
        let options = Options { seed: options.seed.wrapping_add(index as u64 + 1), ..*options };
        starts.extend(repeat.run(&turned, reference * perturbation, &options, false, progress)?);
    }
    let other_seed = Options { seed: options.seed.wrapping_add(101), ..*options };
    let backward = inverse(reference).unwrap_or(reference);
    let swapped = prepared.swapped().turned(nearest_turn(backward.matrix3));
    let direction = repeat.run(&swapped, backward, &other_seed, true, progress)?;
    let lesions = if has_masks {
        let whole =
            Prepared::new(&Image::whole(fixed.volume), &Image::whole(moving.volume), options, progress)?
                .for_measure(outcome.measure, progress)?;
        repeat.run(&whole.turned(turn), reference, options, false, progress)?
    } else {
        Vec::new()
    };
    let edge_mm = |image: &Image<'_>| image.volume.grid().voxel_volume_mm3().cbrt();
    Ok(Consistency {
        starts: Spread::of(starts),
        direction: Spread::of(direction),
        lesions: Spread::of(lesions),
        all: Spread::of(repeat.all),
        floor_mm: 0.5 * edge_mm(fixed).max(edge_mm(moving)),
        runs: repeat.runs,
        failed: repeat.failed,
    })
}

/// What repetitions share and add up.
struct Repeat<'a> {
    measure: Measure,
    reference: DAffine3,
    points_mm: &'a [DVec3],
    runs: usize,
    failed: usize,
    all: Vec<f64>,
}

impl Repeat<'_> {
    /// Distances of one repetition from the reference; none where it fails.
    fn run(
        &mut self,
        prepared: &Prepared,
        start: DAffine3,
        options: &Options,
        is_backward: bool,
        progress: &Progress,
    ) -> Result<Vec<f64>, RegisterError> {
        let pose = prepared.pose(start);
        let refined = prepared.refine(pose, prepared.fine_from(), self.measure, options, progress)?;
        let transform = refined.filter(|r| r.converged).and_then(|r| {
            let transform = prepared.transform(r.pose);
            if is_backward { inverse(transform) } else { Some(transform) }
        });
        let Some(transform) = transform else {
            self.failed += 1;
            return Ok(Vec::new());
        };
        self.runs += 1;
        let distance =
            |p: &DVec3| transform.transform_point3(*p).distance(self.reference.transform_point3(*p));
        let distances: Vec<f64> = self.points_mm.iter().map(distance).collect();
        self.all.extend(&distances);
        Ok(distances)
    }
}
