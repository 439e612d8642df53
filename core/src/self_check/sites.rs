//! Where new lesions may lie.

use glam::DVec3;

use super::{picture::Picture, plan::Ball, random::Random, shape::Shape};
use crate::distance::KdTree;

/// Distance between candidates for a new lesion.
const LATTICE_MM: f64 = 4.0;
/// Room between a new lesion and any other.
const ROOM_MM: f64 = 5.0;
/// Tries to place a lesion.
const TRIES: usize = 200;

/// Where new lesions may lie: in tissue around the lesion, with room.
#[derive(Clone, Debug)]
pub(super) struct Sites(Vec<(DVec3, f64)>);

impl Sites {
    /// Places within `reach_mm` of the box of `shape`, with their distances to its surface points.
    pub fn around(shape: &Shape, surface_mm: &[DVec3], picture: Option<&Picture>, reach_mm: f64) -> Self {
        let Ok(Some(tree)) = KdTree::new(surface_mm) else { return Self(Vec::new()) };
        let (low, high) = shape.grid().bounds_mm();
        let (low, high) = (low - DVec3::splat(reach_mm), high + DVec3::splat(reach_mm));
        let count = ((high - low) / LATTICE_MM).floor().max(DVec3::ZERO);
        let [nx, ny, nz] = count.to_array().map(|n| n.min(200.0) as usize + 1);
        let places = (0..nx * ny * nz).map(|at| {
            low + DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64) * LATTICE_MM
        });
        let seen = |place: &DVec3| {
            picture.is_none_or(|picture| picture.covers(*place) && picture.shows_tissue(*place))
        };
        let outside = places.filter(|place| shape.at(*place) > 0.0 && seen(place));
        Self(outside.filter_map(|place| Some((place, tree.nearest(place)?.1))).collect())
    }

    /// Balls of these volumes, in places of their own; fewer where there is no room. `fits`: whether a place is inside what is seen.
    pub fn balls(
        &self,
        volumes_ml: &[f64],
        fits: &dyn Fn(DVec3) -> bool,
        random: &mut Random,
    ) -> Vec<Option<Ball>> {
        let mut placed: Vec<Option<Ball>> = Vec::new();
        for volume_ml in volumes_ml {
            let radius_mm = Ball::new(DVec3::ZERO, *volume_ml).radius_mm();
            let mut ball = None;
            for _ in 0..TRIES {
                if self.0.is_empty() {
                    break;
                }
                let (place, clear_mm) = self.0[random.below(self.0.len())];
                // Anywhere between the lattice's places, so that no lattice of voxels is preferred.
                let jitter =
                    DVec3::new(random.within(0.5), random.within(0.5), random.within(0.5)) * LATTICE_MM;
                let centre_mm = place + jitter;
                let candidate = Ball::new(centre_mm, *volume_ml);
                let has_room = clear_mm - jitter.length() > radius_mm + ROOM_MM
                    && placed
                        .iter()
                        .flatten()
                        .all(|other| other.distance_mm(centre_mm) > radius_mm + ROOM_MM);
                let axes = [DVec3::X, DVec3::Y, DVec3::Z];
                let reaches =
                    |axis: &DVec3| fits(centre_mm + *axis * radius_mm) && fits(centre_mm - *axis * radius_mm);
                if has_room && axes.iter().all(reaches) {
                    ball = Some(candidate);
                    break;
                }
            }
            placed.push(ball);
        }
        placed
    }
}
