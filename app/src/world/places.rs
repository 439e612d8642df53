//! Places worth a look: regions, their connected components, and where masks disagree.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Connectivity, Grid, MaskBits, TumorIndex,
    case::TimePoint,
    change::{Change, SurfaceChange},
    components::{Component, Components, TooLarge},
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::error::AppError;

/// What is at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum At {
    /// The largest connected piece in which some masks are active, but not all.
    Disagreement,
    /// A region, by its bits: its largest component.
    Region(u32),
    /// A component of a region: the region's bits, and the component's number from 1, largest first.
    Component(u32, usize),
}

/// A place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// What is there.
    pub at: At,
    /// The centre of a voxel of it, the one nearest to its centroid; world millimetres.
    pub center_mm: DVec3,
    /// Its volume.
    pub volume_ml: f64,
}

/// The places of the time point last requested.
#[derive(Default)]
pub struct Places {
    result: Derived<(Handle<TumorIndex>, u32), Vec<Place>>,
}

impl Places {
    /// The places of `time_point`, with components of `neighbors` (6, 18 or 26): the disagreement first, then regions
    /// and components, largest first.
    pub fn get(&mut self, time_point: &TimePoint, neighbors: u32, ask: &Ask) -> Lookup<'_, Vec<Place>> {
        let index = time_point.index.clone();
        let key = (Handle::of(&index), neighbors);
        self.result.get(key, ask, move |_| {
            places(&index, Connectivity::of_neighbors(neighbors).unwrap_or_default())
                .map_err(|error| AppError::wrong("the masks", error.to_string(), "smaller ones"))
        })
    }

    /// The places of `time_point`, if they are available: starts no job.
    pub fn cached(&self, time_point: &TimePoint, neighbors: u32) -> Option<&Arc<Vec<Place>>> {
        self.result.cached(&(Handle::of(&time_point.index), neighbors))
    }

    /// Whether a worker is looking for them.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }
}

fn places(index: &TumorIndex, connectivity: Connectivity) -> Result<Vec<Place>, TooLarge> {
    let grid = index.grid();
    let masks = index.mask_ids().len() as u32;
    let disagree = |i: usize| (1..masks).contains(&index.get(i).count_ones());
    let pieces = Components::of_mask(&MaskBits::from_fn(grid.dims(), disagree), connectivity)?;
    // The first of equally large ones, so that the place is the same in every run.
    let largest = pieces.list().iter().rev().max_by_key(|piece| piece.voxels);
    let disagreement = largest.map(|piece| place(At::Disagreement, grid, &pieces, piece));

    let all = Components::of_index(index, connectivity)?;
    let mut sorted: Vec<&Component> = all.list().iter().collect();
    sorted.sort_by_key(|component| std::cmp::Reverse(component.voxels));
    let mut counts = std::collections::BTreeMap::new();
    let (mut regions, mut components) = (Vec::new(), Vec::new());
    for component in sorted {
        let number: &mut usize = counts.entry(component.value).or_default();
        *number += 1;
        let at = At::Component(component.value, *number);
        let found = place(at, grid, &all, component);
        if *number == 1 {
            regions.push(Place { at: At::Region(component.value), ..found });
        }
        components.push(found);
    }
    Ok(disagreement.into_iter().chain(regions).chain(components).collect())
}

fn place(at: At, grid: &Grid, all: &Components, component: &Component) -> Place {
    let middle = component.centroid_voxel;
    let middle_mm = grid.world_from_voxel().transform_point3(middle);
    let nearest_of_run = |run: &glioscope_core::components::Run| {
        let x = (middle.x.round().max(0.0) as u32).clamp(run.first, run.last);
        grid.center_of_voxel_mm([x as usize, run.y as usize, run.z as usize])
    };
    let voxels_mm = all.runs(component).iter().map(nearest_of_run);
    let distance = |voxel_mm: &DVec3| voxel_mm.distance_squared(middle_mm);
    let center_mm = voxels_mm.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(middle_mm);
    Place { at, center_mm, volume_ml: grid.volume_ml(component.voxels) }
}

/// The vector of the largest growth: beyond its uncertainty if any is.
pub fn largest_growth(change: &Change) -> Option<&SurfaceChange> {
    let grew = change.vectors.iter().filter(|vector| vector.signed_mm > 0.0);
    grew.max_by(|a, b| {
        let rank = |v: &SurfaceChange| (!v.flags.within_uncertainty, v.signed_mm);
        let ((a_sure, a_mm), (b_sure, b_mm)) = (rank(a), rank(b));
        a_sure.cmp(&b_sure).then(a_mm.total_cmp(&b_mm))
    })
}
