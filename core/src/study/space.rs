//! A camera and the solids before it: what a line of sight meets, how deep it is, and the solids as voxels.

use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3};

use super::solid::Solid;
use crate::{
    Grid, Mask, MaskBits, RegionVolume, Regions, Sides, TumorIndex,
    optics::{Camera, Ray},
};

/// Lines of sight along each side of the picture by which the nearest and the farthest point seen are found.
const RAYS: usize = 64;

/// Solids in the camera's axes about its focus, each with the number of its mask.
#[derive(Clone, Debug)]
pub(super) struct Space {
    /// Its focus is the origin of the world.
    pub camera: Camera,
    pub solids: Vec<(usize, Solid)>,
}

/// What a line of sight meets first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Which solid.
    pub solid: usize,
    /// Where, in the camera's axes.
    pub point: DVec3,
    /// Distance from the eye's plane along the camera's axis.
    pub depth_mm: f64,
}

impl Space {
    /// The line of sight through a place of the picture, in the camera's axes: from 0, 0 at the top left to 1, 1.
    pub fn sight(&self, at: DVec2) -> Ray {
        let Ray { origin_mm, direction } = self.camera.ray(at, DVec2::ONE);
        let to_camera = self.camera.world_from_camera.inverse();
        Ray { origin_mm: to_camera * origin_mm, direction: to_camera * direction }
    }

    pub fn first(&self, at: DVec2) -> Option<Hit> {
        let ray = self.sight(at);
        // Backwards: the sheet, which takes longest, stands first, and need not be searched behind what was met.
        let mut met = None;
        for (n, (_, solid)) in self.solids.iter().enumerate().rev() {
            let limit = met.map_or(f64::INFINITY, |(_, t)| t);
            met = solid.enter(&ray, limit).filter(|t| *t < limit).map(|t| (n, t)).or(met);
        }
        let (solid, t) = met?;
        let point = ray.origin_mm + ray.direction * t;
        Some(Hit { solid, point, depth_mm: self.camera.distance_mm() - point.z })
    }

    /// A point in the camera's axes in world millimetres.
    pub fn world(&self, point: DVec3) -> DVec3 {
        self.camera.world_from_camera * point
    }

    /// Where a point in the camera's axes is in the picture.
    pub fn place(&self, point: DVec3) -> DVec2 {
        self.camera.project(self.world(point), DVec2::ONE).unwrap_or(DVec2::splat(-1.0))
    }

    /// The depths of the nearest and the farthest point seen.
    pub fn depths_mm(&self) -> [f64; 2] {
        let center = |n: usize| (n as f64 + 0.5) / RAYS as f64;
        let all = (0..RAYS * RAYS).filter_map(|n| self.first(DVec2::new(center(n % RAYS), center(n / RAYS))));
        all.fold([f64::INFINITY, 0.0], |[near, far], hit| [near.min(hit.depth_mm), far.max(hit.depth_mm)])
    }

    /// The share of a solid's outline that nothing hides: 0 to 1.
    pub fn visible_share(&self, solid: usize) -> f64 {
        let alone = &self.solids[solid].1;
        let (center, radius) = alone.ball();
        let (middle, side) = (self.place(center), radius * 2.6 / self.camera.height_mm);
        let (mut seen, mut all) = (0_u32, 0_u32);
        for n in 0..24 * 24 {
            let at = middle + (DVec2::new(f64::from(n % 24), f64::from(n / 24)) / 23.0 - 0.5) * side;
            if alone.enter(&self.sight(at), f64::INFINITY).is_some() {
                all += 1;
                seen += u32::from(self.first(at).is_some_and(|hit| hit.solid == solid));
            }
        }
        if all == 0 { 0.0 } else { f64::from(seen) / f64::from(all) }
    }

    /// The solids as masks on a grid along the world's axes. `None` where nothing is, or the grid can't be made.
    pub fn regions(&self, voxel_mm: f64) -> Option<Arc<RegionVolume>> {
        let boxes: Vec<[DVec3; 2]> = self.solids.iter().map(|(_, solid)| self.world_box(solid)).collect();
        let low = boxes.iter().map(|b| b[0]).reduce(DVec3::min)? - 2.0 * voxel_mm;
        let high = boxes.iter().map(|b| b[1]).reduce(DVec3::max)? + 2.0 * voxel_mm;
        let dims = ((high - low) / voxel_mm).ceil().as_u64vec3().to_array().map(|n| n as usize + 1);
        let to_world =
            DAffine3::from_scale_rotation_translation(DVec3::splat(voxel_mm), glam::DQuat::IDENTITY, low);
        let grid = Grid::new(dims, to_world, Sides::Known).ok()?;
        let count = self.solids.iter().map(|(mask, _)| mask + 1).max()?;
        let mut bits = vec![MaskBits::empty(dims); count];
        let to_camera = self.camera.world_from_camera.inverse();
        for ((mask, solid), [from, to]) in self.solids.iter().zip(&boxes) {
            let first = ((*from - low) / voxel_mm).floor().as_u64vec3().to_array();
            let last = ((*to - low) / voxel_mm).ceil().as_u64vec3().to_array();
            for z in first[2]..=last[2] {
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        let world = low + DVec3::new(x as f64, y as f64, z as f64) * voxel_mm;
                        if solid.contains(to_camera * world) {
                            bits[*mask].set([x, y, z].map(|n| n as usize));
                        }
                    }
                }
            }
        }
        let masks =
            bits.into_iter().enumerate().map(|(n, bits)| Mask::new(n.to_string(), grid.clone(), bits));
        let masks: Vec<Mask> = masks.collect::<Option<_>>()?;
        let index = TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).ok()?;
        RegionVolume::of(&index, &Regions::of(&index)).map(Arc::new)
    }

    /// The solid's box along the world's axes.
    fn world_box(&self, solid: &Solid) -> [DVec3; 2] {
        let around = |points: &[DVec3], radius: f64| {
            let points = points.iter().map(|p| self.world(*p));
            let low = points.clone().reduce(DVec3::min).unwrap_or_default();
            [low - radius, points.reduce(DVec3::max).unwrap_or_default() + radius]
        };
        match solid {
            Solid::Capsule { from, to, radius_mm } => around(&[*from, *to], *radius_mm),
            Solid::Ellipsoid { center, radii_mm, .. } => around(&[*center], radii_mm.max_element()),
            Solid::Sheet(sheet) => {
                let r = sheet.radius_mm;
                let corner = |x: f64, y: f64, z: f64| sheet.center + sheet.axes * DVec3::new(x, y, z);
                let corners: Vec<DVec3> = sheet
                    .levels()
                    .into_iter()
                    .flat_map(|z| [(-r, -r), (-r, r), (r, -r), (r, r)].map(|(x, y)| corner(x, y, z)))
                    .collect();
                around(&corners, 0.0)
            }
        }
    }
}
