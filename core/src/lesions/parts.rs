//! The components of one date.

use crate::{
    Cancelled, Components, Connectivity, Grid, Mask, Progress,
    components::Run,
    glam::DVec3,
    grid::ijk,
    resample::{SAME_PLACE_VOXELS, mask_onto, source_from_target, source_voxel},
};
use rayon::prelude::*;

use super::{
    diameters::{DiameterMode, Diameters, diameters},
    error::LesionsError,
};

/// One component at one date.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Number of its voxels, on the grid that it is measured on.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Mean of their centres, RAS+ millimetres.
    pub centroid_mm: DVec3,
    /// Centre of its voxel nearest to the centroid: inside it, however bent it is.
    pub anchor_mm: DVec3,
    /// Size of its box along the patient's axes (R, A, S), from face to face.
    pub extent_mm: DVec3,
    /// Its diameters.
    pub diameters: Diameters,
    /// Whether it is smaller than the smallest lesion.
    pub small: bool,
    pub(super) runs: Vec<Run>,
}

/// How parts are measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measures {
    pub smallest_ml: f64,
    pub axis: Option<usize>,
    pub mode: DiameterMode,
}

impl Part {
    /// `None` without a voxel.
    pub(super) fn new(runs: Vec<Run>, grid: &Grid, measures: &Measures) -> Option<Self> {
        let voxels: u64 = runs.iter().map(|run| u64::from(run.last - run.first) + 1).sum();
        let twice = |sum: [u128; 3], run: &Run| {
            let n = u128::from(run.last - run.first) + 1;
            let [x, y, z] =
                [u128::from(run.first) + u128::from(run.last), 2 * u128::from(run.y), 2 * u128::from(run.z)];
            [sum[0] + n * x, sum[1] + n * y, sum[2] + n * z]
        };
        let sums = runs.iter().fold([0_u128; 3], twice).map(|sum| sum as f64 / (2.0 * voxels as f64));
        let centroid = DVec3::from_array(sums);
        let world = grid.world_from_voxel();
        let m = world.matrix3;
        let half_mm = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()) / 2.0;
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut nearest = (f64::INFINITY, DVec3::ZERO);
        for run in &runs {
            for x in [run.first, run.last] {
                let at = world.transform_point3(DVec3::new(f64::from(x), f64::from(run.y), f64::from(run.z)));
                (lo, hi) = (lo.min(at - half_mm), hi.max(at + half_mm));
            }
            let x = centroid.x.round().clamp(f64::from(run.first), f64::from(run.last));
            let at = DVec3::new(x, f64::from(run.y), f64::from(run.z));
            let mm2 = (m * (at - centroid)).length_squared();
            if mm2 < nearest.0 {
                nearest = (mm2, at);
            }
        }
        let axis = measures.axis.unwrap_or_else(|| super::diameters::axial_axis(grid));
        let volume_ml = grid.volume_ml(voxels);
        Some(Self {
            voxels,
            volume_ml,
            centroid_mm: world.transform_point3(centroid),
            anchor_mm: world.transform_point3(nearest.1),
            extent_mm: hi - lo,
            diameters: diameters(grid, &runs, axis, measures.mode)?,
            small: volume_ml < measures.smallest_ml,
            runs,
        })
    }

    /// Whether this is one of its voxels.
    fn has(&self, [x, y, z]: [usize; 3]) -> bool {
        let is_in = |run: &Run| {
            (run.first as usize..=run.last as usize).contains(&x)
                && run.y as usize == y
                && run.z as usize == z
        };
        self.runs.iter().any(is_in)
    }

    /// Centres of its voxels.
    pub(super) fn centers_mm<'a>(&'a self, grid: &'a Grid) -> impl Iterator<Item = DVec3> + 'a {
        let voxels = self.runs.iter().flat_map(|run| (run.first..=run.last).map(move |x| [x, run.y, run.z]));
        voxels.map(|voxel| grid.center_of_voxel_mm(voxel.map(|n| n as usize)))
    }
}

/// Neighbouring voxels of one line of the case grid that belong to one part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct CaseRun {
    pub line: usize,
    pub first: u32,
    pub last: u32,
    pub part: u32,
}

/// The part that has the voxel `x` of a line; `runs` are sorted.
pub(super) fn part_at(runs: &[CaseRun], (line, x): (usize, u32)) -> Option<u32> {
    let next = runs.partition_point(|run| (run.line, run.first) <= (line, x));
    let run = runs.get(next.checked_sub(1)?)?;
    (run.line == line && x <= run.last).then_some(run.part)
}

/// The parts of a mask at one date.
#[derive(Clone, Debug)]
pub(super) struct DateParts {
    /// The grid that they are measured on.
    pub grid: Grid,
    /// Whether that is the grid that the mask was drawn on.
    pub is_native: bool,
    pub parts: Vec<Part>,
    /// On the case grid, sorted.
    pub case_runs: Vec<CaseRun>,
    /// Voxels of the case grid whose part isn't known.
    pub unplaced: u64,
}

impl DateParts {
    /// The parts of `mask`, which lies on the case grid; `native` is the grid that it was drawn on, and how many of its
    /// voxels were active there.
    pub fn new(
        mask: &Mask,
        native: Option<(&Grid, u64)>,
        measures: &Measures,
        progress: &Progress,
    ) -> Result<Self, LesionsError> {
        let on_native = native.map(|native| restored(mask, native, progress)).transpose()?.flatten();
        let (measured, is_native) = (on_native.as_ref().unwrap_or(mask), on_native.is_some());
        let grid = measured.grid().clone();
        let components = Components::of_mask(measured.bits(), Connectivity::TwentySix)?;
        let runs: Vec<Vec<Run>> = components.list().iter().map(|c| components.runs(c).to_vec()).collect();
        let part = |runs| {
            progress.check()?;
            Ok(Part::new(runs, &grid, measures))
        };
        let parts = runs.into_par_iter().map(part).collect::<Result<Vec<_>, Cancelled>>()?;
        let parts = parts.into_iter().flatten().collect();
        let mut date = Self { grid, is_native, parts, case_runs: Vec::new(), unplaced: 0 };
        date.place(mask);
        Ok(date)
    }

    /// Which part each voxel of the case grid belongs to.
    pub fn place(&mut self, mask: &Mask) {
        self.unplaced = 0;
        let own = self.sorted_runs();
        if mask.grid().same_place(&self.grid, SAME_PLACE_VOXELS) {
            self.case_runs = own;
            return;
        }
        let dims = self.grid.dims();
        let part_of = |place: DVec3| {
            let [x, y, z] = source_voxel(place, dims)?;
            let (line, x) = (z * dims[1] + y, x as u32);
            part_at(&own, (line, x))
        };
        let case_dims = mask.grid().dims();
        let map = source_from_target(&self.grid, mask.grid());
        let mut runs: Vec<CaseRun> = Vec::new();
        mask.bits().for_each(|linear| {
            let [x, y, z] = ijk(case_dims, linear);
            let place = map.transform_point3(DVec3::new(x as f64, y as f64, z as f64));
            let Some(part) = part_of(place) else {
                self.unplaced += 1;
                return;
            };
            let (line, x) = (z * case_dims[1] + y, x as u32);
            match runs.last_mut() {
                Some(run) if run.line == line && run.part == part && run.last + 1 == x => run.last = x,
                _ => runs.push(CaseRun { line, first: x, last: x, part }),
            }
        });
        self.case_runs = runs;
    }

    /// All runs on the grid that is measured on.
    fn sorted_runs(&self) -> Vec<CaseRun> {
        let ny = self.grid.dims()[1];
        let of = |(part, runs): (u32, &Vec<Run>)| {
            let run = |run: &Run| CaseRun {
                line: run.z as usize * ny + run.y as usize,
                first: run.first,
                last: run.last,
                part,
            };
            runs.iter().map(run).collect::<Vec<_>>()
        };
        let mut all: Vec<CaseRun> =
            (0..).zip(&self.parts).flat_map(|(n, part)| of((n, &part.runs))).collect();
        all.sort_unstable();
        all
    }

    /// The part that has the voxel at this place; else the nearest within `within_mm` of it, of equally near ones the first.
    pub fn at(&self, at_mm: DVec3, within_mm: f64) -> Option<usize> {
        if let Some(voxel) = self.grid.voxel_at(at_mm)
            && let Some(part) = self.parts.iter().position(|part| part.has(voxel))
        {
            return Some(part);
        }
        let near = |part: &Part| {
            let reach_mm = part.extent_mm.length() + within_mm;
            part.centroid_mm.distance(at_mm) <= reach_mm
        };
        let distances = self.parts.iter().enumerate().filter(|(_, part)| near(part)).map(|(number, part)| {
            let mm = part.centers_mm(&self.grid).map(|p| p.distance(at_mm)).fold(f64::INFINITY, f64::min);
            (mm, number)
        });
        distances.filter(|(mm, _)| *mm <= within_mm).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, n)| n)
    }
}

/// The mask on its native grid, brought back from the case grid, where nothing was lost on the way: as many voxels as the
/// file has, which make the same mask again on the case grid.
fn restored(
    mask: &Mask,
    (grid, voxels): (&Grid, u64),
    progress: &Progress,
) -> Result<Option<Mask>, LesionsError> {
    let bits = mask_onto(mask, grid, progress)?;
    if bits.count() != voxels {
        return Ok(None);
    }
    let Some(native) = Mask::new(mask.id(), grid.clone(), bits) else { return Ok(None) };
    let again = mask_onto(&native, mask.grid(), progress)?;
    Ok((&again == mask.bits()).then_some(native))
}
