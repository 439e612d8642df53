//! One run: a known change is put in, moved, registered back, and measured as any two dates are.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{
    SelfCheckError,
    picture::{Look, Picture},
    plan::{Ball, Known},
    random::Random,
    shape::{Shape, bits_in, box_around, part_of},
};
use crate::{
    Cancelled, Grid, Mask, MaskBits, Progress,
    change::{Call, Change, ChangeOptions, Fate, Sampling, change_with, mean_move_mm},
    distance::KdTree,
    grid::ijk,
    register::{self, Image, RegisterError},
    resample::mask_onto,
    surface::{surface_of, without_cavities},
};

/// What the later date's patient is moved by at most, about the lesion.
pub(super) const MOST_DEGREES: f64 = 3.0;
pub(super) const MOST_MM: f64 = 3.0;
/// Most gain of the later image, and its noise, as shares.
pub(super) const MOST_GAIN: f64 = 0.1;
pub(super) const NOISE: f64 = 0.02;
/// Shorter recessions are taken as they were put in: the points of the surface left are as far from each other.
const SURE_MM: f64 = 0.3;
/// Room beyond what is known to move.
const ROOM_MM: f64 = 3.0;

/// What all runs share.
pub(super) struct Bench<'a> {
    pub shape: Shape,
    /// The mask on its own grid.
    pub native: Mask,
    /// Frame of the case, on which dates are compared.
    pub case_grid: &'a Grid,
    /// How the mask's own grid lies to it.
    pub sampling: Sampling,
    /// What is registered; without an image nothing is.
    pub picture: Option<Picture>,
    /// Volume of the shape.
    pub volume_ml: f64,
    pub centre_mm: DVec3,
    /// Points of the lesion's surface, at which registration's error counts.
    pub surface_mm: Vec<DVec3>,
    pub change: ChangeOptions,
    pub register: register::Options,
    pub seed: u64,
}

/// One run's input.
pub(super) struct Case {
    pub known: Known,
    /// Lesions that are there at the later date only.
    pub new: Vec<Ball>,
    /// Lesions that are there at the earlier date only.
    pub gone: Vec<Ball>,
    pub kind: u64,
    pub run: u64,
}

/// What one run measured.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    /// Mean movement of the surface: by vectors, by the nearest distances, and known over the same voxels.
    pub mean_mm: Option<f64>,
    pub nearest_mm: Option<f64>,
    pub known_mm: f64,
    /// Difference of the volumes: measured, and known.
    pub volume_ml: f64,
    pub known_ml: f64,
    pub call: Call,
    /// Of each lesion that is new and of each that is gone: its volume as measured, where it was found.
    pub new: Vec<Option<f64>>,
    pub gone: Vec<Option<f64>>,
    /// Largest error of the registration over the lesion's surface, where one was run.
    pub error_mm: Option<f64>,
}

impl Bench<'_> {
    /// How far from the mask's box anything of a run can lie.
    fn reach_mm(&self, case: &Case) -> f64 {
        let (low, high) = self.shape.grid().bounds_mm();
        let of_balls = case.new.iter().chain(&case.gone).map(|ball| {
            let beyond = (low - ball.centre_mm).max(ball.centre_mm - high).max(DVec3::ZERO);
            beyond.max_element() + ball.radius_mm()
        });
        let radius_mm = 0.5 * (high - low).length();
        let moved_mm =
            MOST_MM + MOST_DEGREES.to_radians() * (radius_mm + of_balls.clone().fold(0.0, f64::max));
        of_balls.fold(case.known.by_mm.max(0.0), f64::max) + moved_mm + ROOM_MM
    }

    /// Runs `case`; `None` where registration refuses.
    pub fn run(&self, case: &Case, progress: &Progress) -> Result<Option<Measured>, SelfCheckError> {
        progress.check()?;
        let mut random = Random::of(self.seed, case.kind, case.run);
        let later_from_earlier = random.rigid(self.centre_mm, MOST_DEGREES, MOST_MM);
        let look = Look { gain: 1.0 + random.within(MOST_GAIN), noise: NOISE };
        let noise_seed = random.next();
        let reach_mm = self.reach_mm(case);
        let own = self.native.grid();
        let Some((start, dims)) = box_around(self.native.bits(), own, reach_mm) else { return Ok(None) };
        let Some(own) = part_of(own, start, dims) else { return Ok(None) };
        let mut earlier = bits_in(self.native.bits(), start, dims);
        if !case.gone.is_empty() {
            let in_ball = |_: f64, place: DVec3| case.gone.iter().any(|ball| ball.distance_mm(place) < 0.0);
            let balls = self.shape.raster(&own, DAffine3::IDENTITY, &in_ball);
            balls.for_each(|linear| earlier.set(ijk(dims, linear)));
        }
        let known = case.known;
        let inside = |mm: f64, place: DVec3| {
            mm < known.at(place) || case.new.iter().any(|ball| ball.distance_mm(place) < 0.0)
        };
        let later = self.shape.raster(&own, later_from_earlier.inverse(), &inside);
        let mask = |bits: MaskBits, grid: Grid| Mask::new(self.native.id(), grid, bits);
        let (Some(earlier), Some(later)) = (mask(earlier, own.clone()), mask(later, own.clone())) else {
            return Ok(None);
        };
        let Some((found, error_mm)) =
            self.aligned(case, [&earlier, &later], (later_from_earlier, look, noise_seed), progress)?
        else {
            return Ok(None);
        };
        // As a case's transform does: the later date's grid is moved, its mask resampled once.
        let placed = Grid::new(dims, found.inverse() * own.world_from_voxel(), own.sides())
            .map_err(|error| SelfCheckError::Change(error.into()))?;
        let Some(later) = mask(later.bits().clone(), placed) else { return Ok(None) };
        let on_case = self.looking_at(reach_mm + ROOM_MM)?;
        let bits = [mask_onto(&earlier, &on_case, progress)?, mask_onto(&later, &on_case, progress)?];
        let samplings = [self.sampling, Sampling::new(later.grid(), self.case_grid)];
        let change =
            change_with(&bits[0], &bits[1], &on_case, samplings, &self.change, None, &progress.part())
                .map_err(SelfCheckError::Change)?;
        Ok(Some(self.measured(case, &change, &bits, &on_case, error_mm)?))
    }

    /// A box of the case grid, beyond it where need be.
    fn looking_at(&self, reach_mm: f64) -> Result<Grid, SelfCheckError> {
        let (low, high) = self.shape.grid().bounds_mm();
        let (low, high) = (low - DVec3::splat(reach_mm), high + DVec3::splat(reach_mm));
        let voxel_from_world = self.case_grid.voxel_from_world();
        let corners = (0..8).map(|corner| {
            let side = |a: usize| if corner >> a & 1 == 1 { high[a] } else { low[a] };
            voxel_from_world.transform_point3(DVec3::new(side(0), side(1), side(2)))
        });
        let (first, last) =
            corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let start: [i64; 3] = std::array::from_fn(|a| first[a].floor() as i64);
        let dims: [usize; 3] =
            std::array::from_fn(|a| (last[a].ceil() as i64 - start[a]).max(0) as usize + 1);
        part_of(self.case_grid, start, dims).ok_or(SelfCheckError::Empty)
    }

    /// The transform from the earlier to the later date that registration finds, and its error; without an image the true one.
    fn aligned(
        &self,
        case: &Case,
        masks: [&Mask; 2],
        (truth, look, noise_seed): (DAffine3, Look, u64),
        progress: &Progress,
    ) -> Result<Option<(DAffine3, Option<f64>)>, SelfCheckError> {
        let Some(picture) = &self.picture else { return Ok(Some((truth, None))) };
        let earlier = picture.painted(&self.shape, &Known::NOTHING, &case.gone);
        let later = picture.painted(&self.shape, &case.known, &case.new).later(truth, look, noise_seed);
        let [of_earlier, of_later] = masks.map(|mask| [mask]);
        let images = [
            Image { volume: &earlier.volume, excluded: &of_earlier },
            Image { volume: &later, excluded: &of_later },
        ];
        match register::register(&images[0], &images[1], &self.register, &progress.part()) {
            Ok(outcome) => {
                let found = outcome.moving_from_fixed;
                let off = |p: &DVec3| found.transform_point3(*p).distance(truth.transform_point3(*p));
                let error_mm = self.surface_mm.iter().map(off).fold(0.0, f64::max);
                Ok(Some((found, Some(error_mm))))
            }
            Err(RegisterError::Cancelled(Cancelled)) => Err(Cancelled.into()),
            Err(_) => Ok(None),
        }
    }

    fn measured(
        &self,
        case: &Case,
        change: &Change,
        bits: &[MaskBits; 2],
        grid: &Grid,
        error_mm: Option<f64>,
    ) -> Result<Measured, SelfCheckError> {
        let known = case.known;
        // Known at the voxels over which the measured mean is taken. What grows lies as far from the earlier surface as it grew; what the
        // surface receded from lies farther from what is left where that was thin or had an edge.
        let surface =
            surface_of(&without_cavities(&bits[usize::from(known.by_mm > 0.0)]).map_err(too_large)?);
        let mut places = Vec::new();
        surface.for_each(|linear| {
            let place = grid.center_of_voxel_mm(ijk(grid.dims(), linear));
            let mm = self.shape.at(place);
            if mm < known.by_mm.max(0.0) + grid.spacing_mm().max_element() {
                places.push((place, mm));
            }
        });
        let known_mm: Vec<f64> = if known.by_mm < 0.0 {
            let moved = KdTree::new(&self.shape.moved_surface_mm(&|place| known.at(place)))
                .map_err(|error| SelfCheckError::Change(error.into()))?;
            let receded = |(place, mm): &(DVec3, f64)| {
                let on_surface = *place - self.shape.outwards(*place) * *mm;
                let least_mm = known.at(on_surface).abs();
                let nearest =
                    moved.as_ref().filter(|_| least_mm > SURE_MM).and_then(|tree| tree.nearest(on_surface));
                -nearest.map_or(least_mm, |(_, mm)| mm.max(least_mm))
            };
            places.par_iter().map(receded).collect()
        } else {
            places.iter().map(|(place, _)| known.at(*place)).collect()
        };
        let found = |fate: Fate, ball: &Ball| {
            let counted = change.groups.iter().filter(|group| group.fate == fate && !group.is_small);
            let parts =
                counted.flat_map(|group| if fate == Fate::Appeared { &group.after } else { &group.before });
            let mut near = parts.filter(|part| ball.distance_mm(part.centroid_mm) < 0.0);
            near.next().map(|part| part.volume_ml)
        };
        let volume_of = |balls: &[Ball]| balls.iter().map(|ball| ball.volume_ml).sum::<f64>();
        let grown_ml = if known.is_none() {
            0.0
        } else {
            let between = [known.by_mm.min(0.0), known.by_mm.max(0.0)];
            self.shape.volume_ml(between, &|mm, place| mm < known.at(place)) - self.volume_ml
        };
        Ok(Measured {
            mean_mm: mean_move_mm(change, |v| v.signed_mm.abs()),
            nearest_mm: mean_move_mm(change, |v| v.nearest_mm),
            known_mm: known_mm.iter().sum::<f64>() / known_mm.len().max(1) as f64,
            volume_ml: grid.volume_ml(bits[1].count()) - grid.volume_ml(bits[0].count()),
            known_ml: grown_ml + volume_of(&case.new) - volume_of(&case.gone),
            call: Call::of(change),
            new: case.new.iter().map(|ball| found(Fate::Appeared, ball)).collect(),
            gone: case.gone.iter().map(|ball| found(Fate::Vanished, ball)).collect(),
            error_mm,
        })
    }
}

fn too_large(error: crate::components::TooLarge) -> SelfCheckError {
    SelfCheckError::Change(error.into())
}
