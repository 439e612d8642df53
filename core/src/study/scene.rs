//! The scene of a trial.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::{answer::Truth, design::Trial, make::make, space::Space};
use crate::{RegionVolume, optics::Camera};

/// Side of a voxel of [`Scene::regions`].
const VOXEL_MM: f64 = 0.5;

/// Which of two marks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The only one.
    Only,
    /// The left one.
    Left,
    /// The right one.
    Right,
}

/// A marked point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// The point of the surface, world millimetres.
    pub world_mm: DVec3,
    /// Where it is in the picture: from 0, 0 at the top left to 1, 1.
    pub at: DVec2,
    /// Which it is.
    pub side: Side,
}

/// A scene: solids before a camera, of which the picture is a square.
#[derive(Clone, Debug)]
pub struct Scene {
    space: Space,
    /// What is marked, from left to right.
    pub marks: Vec<Mark>,
    /// What is true.
    pub truth: Truth,
    /// How easy it is: of nearer the difference of depths in shares of the depth seen, of larger the ratio of volumes (above 1), of shape
    /// the marked place's curvedness in 1/mm (root mean square of the principal curvatures); else 0.
    pub difference: f64,
}

impl Scene {
    /// The scene of a trial in a study of `lights` lights. `None` where no arrangement fits, which was found with no seed.
    pub fn of(trial: &Trial, seed: u64, lights: usize) -> Option<Self> {
        let level = (!trial.practice).then(|| trial.level(lights));
        let made = make(trial.task, seed, trial.scene, level)?;
        let sides = if made.marks.len() == 1 { [Side::Only; 2] } else { [Side::Left, Side::Right] };
        let mark = |(point, side): (&DVec3, Side)| Mark {
            world_mm: made.space.world(*point),
            at: made.space.place(*point),
            side,
        };
        let marks = made.marks.iter().zip(sides).map(mark).collect();
        Some(Self { marks, truth: made.truth, difference: made.difference, space: made.space })
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        self.space.camera
    }

    /// The solids as masks: 0 for all but the two structures that are compared, which are 1 (left) and 2. `None` where nothing is.
    pub fn regions(&self) -> Option<Arc<RegionVolume>> {
        self.space.regions(VOXEL_MM)
    }

    #[cfg(test)]
    pub(super) fn space(&self) -> &Space {
        &self.space
    }

    /// View depths of the nearest and the farthest point seen, millimetres from the eye's plane.
    #[cfg(test)]
    pub(super) fn depths_mm(&self) -> [f64; 2] {
        self.space.depths_mm()
    }
}
