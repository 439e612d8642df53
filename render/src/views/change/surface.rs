//! Two masks and the surface change between them, in the shaders' layout.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::{
    Grid, Mask, MaskBits, RegionVolume, Regions, TumorIndex,
    change::{Change, SurfaceChange, Unpartnered},
    grid::ijk,
};

/// Index bit of the earlier mask, as in lib/change.wgsl.
pub(crate) const BEFORE: u32 = 1;
/// Index bit of the later mask.
pub(crate) const AFTER: u32 = 2;
/// Index bit of components without a counterpart, in addition to that of their time point.
#[cfg(test)]
pub(crate) const ALONE: u32 = 4;

/// Confidence of a length within its uncertainty: the opacity of its colour.
pub(crate) const FAINT: f32 = 0.35;

/// Added to the confidence of a length of which the tissue around moved too, as in lib/change.
pub(crate) const DISPLACED: f32 = 4.0;

/// The union of the masks of two time points, divided into the regions active before, after and in both,
/// with the change of its surface. Made once per pair of time points.
#[derive(Debug)]
pub struct ChangeSurface {
    volume: Arc<RegionVolume>,
    /// First voxel of the volume on the case grid.
    start: [usize; 3],
    change: Arc<Change>,
    /// Of each vector, whether the tissue around moved too; empty: of none.
    displaced: Vec<bool>,
}

/// `Length` of change/heights.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Length {
    pub key: u32,
    pub signed_mm: f32,
    pub sure: f32,
}

/// First slot to probe in a table of `2^log2_slots` slots, as in change/heights.
fn first_slot(key: u32, log2_slots: u32) -> usize {
    (key.wrapping_mul(0x9e37_79b1) >> (32 - log2_slots)) as usize
}

/// Marks the connected components of `mask` that contain the voxels of `seeds`.
fn flood(mask: &MaskBits, seeds: impl Iterator<Item = [usize; 3]>, marked: &mut MaskBits) {
    let dims = mask.dims();
    let mut open: Vec<[usize; 3]> = Vec::new();
    let visit = |v: [usize; 3], marked: &mut MaskBits, open: &mut Vec<[usize; 3]>| {
        if mask.get(v) && !marked.get(v) {
            marked.set(v);
            open.push(v);
        }
    };
    for seed in seeds {
        visit(seed, marked, &mut open);
        while let Some(v) = open.pop() {
            for n in 0..27 {
                let to = [n % 3, n / 3 % 3, n / 9];
                let to: [usize; 3] = std::array::from_fn(|a| (v[a] + to[a]).wrapping_sub(1));
                if (0..3).all(|a| to[a] < dims[a]) {
                    visit(to, marked, &mut open);
                }
            }
        }
    }
}

impl ChangeSurface {
    /// From two masks on `grid` and the result of `glioscope_core::change::change` for them. `None` if
    /// both masks are empty, or one is not of the grid's size.
    pub fn new(before: &MaskBits, after: &MaskBits, grid: &Grid, change: Arc<Change>) -> Option<Self> {
        if before.dims() != grid.dims() || after.dims() != grid.dims() {
            return None;
        }
        let mut bounds: Option<([usize; 3], [usize; 3])> = None;
        for (start, dims) in [before, after].into_iter().filter_map(MaskBits::bounds) {
            let end: [usize; 3] = std::array::from_fn(|a| start[a] + dims[a]);
            bounds = Some(bounds.map_or((start, end), |(s, e)| {
                (std::array::from_fn(|a| s[a].min(start[a])), std::array::from_fn(|a| e[a].max(end[a])))
            }));
        }
        let (start, end) = bounds?;
        let dims: [usize; 3] = std::array::from_fn(|a| end[a] - start[a]);
        let local_grid = grid.crop(start, dims).ok()?;
        let cropped = |mask: &MaskBits| {
            let mut out = MaskBits::empty(dims);
            let dims = grid.dims();
            mask.for_each(|l| {
                let v = ijk(dims, l);
                out.set(std::array::from_fn(|a| v[a] - start[a]));
            });
            out
        };
        let masks = [cropped(before), cropped(after)];
        let mut alone = MaskBits::empty(dims);
        for (date, mask) in masks.iter().enumerate() {
            let of_date = change.unpartnered.iter().filter(|u| u.appeared == (date == 1));
            flood(mask, of_date.filter_map(|u| local(u.voxel, start, dims)), &mut alone);
        }
        let [before, after] = masks;
        let named = |id: &str, bits| Mask::new(id, local_grid.clone(), bits);
        let masks = [named("before", before)?, named("after", after)?, named("alone", alone)?];
        let index = TumorIndex::new(local_grid, &masks.iter().collect::<Vec<_>>()).ok()?;
        let volume = Arc::new(RegionVolume::of(&index, &Regions::of(&index))?);
        Some(Self { volume, start, change, displaced: Vec::new() })
    }

    /// The same surface with marks on vectors along which the tissue around moved too: `displaced` has one for each, in their order; any
    /// beyond it aren't marked. Shares the volume.
    #[must_use]
    pub fn with_displaced(&self, displaced: Vec<bool>) -> Self {
        Self { volume: self.volume.clone(), start: self.start, change: self.change.clone(), displaced }
    }

    /// Whether a vector has that mark.
    pub fn is_displaced(&self, vector: usize) -> bool {
        self.displaced.get(vector).copied().unwrap_or_default()
    }

    /// Whether any has.
    pub fn has_displaced(&self) -> bool {
        self.displaced.contains(&true)
    }

    /// The union and its regions: index bit 0 for the earlier mask, bit 1 for the later, bit 2 for
    /// components without a counterpart.
    pub fn volume(&self) -> &Arc<RegionVolume> {
        &self.volume
    }

    /// The change between the time points.
    pub fn change(&self) -> &Arc<Change> {
        &self.change
    }

    /// The vector of a voxel of the case grid, if it has one.
    pub fn vector(&self, voxel: [usize; 3]) -> Option<&SurfaceChange> {
        let list = &self.change.vectors;
        let key = |v: [usize; 3]| [v[2], v[1], v[0]];
        list.get(list.binary_search_by_key(&key(voxel), |s| key(s.voxel)).ok()?)
    }

    /// An outer surface voxel without a partner.
    pub fn unpartnered(&self, voxel: [usize; 3]) -> Option<&Unpartnered> {
        let list = &self.change.unpartnered;
        let key = |v: [usize; 3]| [v[2], v[1], v[0]];
        list.get(list.binary_search_by_key(&key(voxel), |s| key(s.voxel)).ok()?)
    }

    /// Indices of those of the change's vectors that are at least `threshold_mm` long.
    pub fn arrows(&self, threshold_mm: f64) -> impl Iterator<Item = usize> + '_ {
        let long = move |v: &SurfaceChange| v.signed_mm.abs() >= threshold_mm;
        self.change.vectors.iter().enumerate().filter(move |(_, v)| long(v)).map(|(i, _)| i)
    }

    /// The point that arrows' coordinates are relative to.
    pub(crate) fn middle_mm(&self) -> DVec3 {
        self.volume.grid().center_mm()
    }

    /// The voxel of the case grid with number `linear` in the volume.
    pub(crate) fn voxel(&self, linear: usize) -> [usize; 3] {
        let dims = self.volume.grid().dims();
        let v = ijk(dims, linear);
        std::array::from_fn(|a| self.start[a] + v[a])
    }

    /// The table of lengths by voxel, at most half full, and the binary logarithm of its size. `None` if
    /// the voxels can't be numbered in 32 bits.
    pub(crate) fn lengths(&self) -> Option<(Vec<Length>, u32)> {
        let grid = self.volume.grid();
        if grid.voxel_count() >= u32::MAX as usize {
            return None;
        }
        let slots = (2 * self.change.vectors.len()).next_power_of_two().max(2);
        let log2_slots = slots.trailing_zeros();
        let mut table = vec![Length::default(); slots];
        for (n, vector) in self.change.vectors.iter().enumerate() {
            let Some(v) = local(vector.voxel, self.start, grid.dims()) else { continue };
            let key = grid.linear(v) as u32 + 1;
            let mut slot = first_slot(key, log2_slots);
            while table[slot].key != 0 {
                slot = (slot + 1) % slots;
            }
            let sure = if vector.flags.within_uncertainty { FAINT } else { 1.0 };
            let mark = if self.is_displaced(n) { DISPLACED } else { 0.0 };
            table[slot] = Length { key, signed_mm: vector.signed_mm as f32, sure: sure + mark };
        }
        Some((table, log2_slots))
    }
}

/// A voxel of the case grid relative to a box of it; `None` outside the box.
fn local(voxel: [usize; 3], start: [usize; 3], dims: [usize; 3]) -> Option<[usize; 3]> {
    let v: [usize; 3] = std::array::from_fn(|a| voxel[a].wrapping_sub(start[a]));
    (0..3).all(|a| v[a] < dims[a]).then_some(v)
}
