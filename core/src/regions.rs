//! Regions (the voxels that share one non-zero index), and the selection of those shown.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    grid::Grid,
    tumor_index::{IndexData, TumorIndex},
};

/// The voxels where exactly the masks in `bits` are active.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// The index value: bit k set for mask k. Never 0.
    pub bits: u32,
    /// Number of its voxels. Never 0.
    pub voxels: u64,
    /// Volume of its voxels.
    pub volume_ml: f64,
    /// Centroid of its voxels, world millimetres.
    pub centroid_mm: DVec3,
}

impl Region {
    /// Number of masks active in it: 1 or more.
    pub fn mask_count(&self) -> u32 {
        self.bits.count_ones()
    }
}

/// All regions of one tumour index, fewest masks first, then by bits.
#[derive(Clone, Debug, PartialEq)]
pub struct Regions {
    list: Vec<Region>,
    bounds: Option<([usize; 3], [usize; 3])>,
    mask_ids: Vec<String>,
    voxel_volume_mm3: f64,
}

#[derive(Clone, Copy, Default)]
struct Tally {
    voxels: u64,
    sum: [u64; 3],
}

struct SliceTally {
    by_bits: HashMap<u32, Tally>,
    lo: [usize; 3],
    hi: [usize; 3],
}

/// Counts one z-slice: runs of equal value cost one look-up, empty stretches almost nothing.
fn tally_slice<T: Copy + PartialEq + Default + Into<u32>>(values: &[T], nx: usize, z: usize) -> SliceTally {
    let mut out = SliceTally { by_bits: HashMap::new(), lo: [usize::MAX; 3], hi: [0; 3] };
    let zero = T::default();
    for (y, line) in values.chunks_exact(nx).enumerate() {
        let mut x = 0;
        while x < nx {
            let value = line[x];
            let start = x;
            while x < nx && line[x] == value {
                x += 1;
            }
            if value == zero {
                continue;
            }
            let run = (x - start) as u64;
            let tally = out.by_bits.entry(value.into()).or_default();
            tally.voxels += run;
            tally.sum[0] += (start as u64 + x as u64 - 1) * run; // twice the sum: halved at the end
            tally.sum[1] += y as u64 * run;
            tally.sum[2] += z as u64 * run;
            for (axis, (first, last)) in [(start, x - 1), (y, y), (z, z)].into_iter().enumerate() {
                out.lo[axis] = out.lo[axis].min(first);
                out.hi[axis] = out.hi[axis].max(last);
            }
        }
    }
    out
}

fn tally<T: Copy + PartialEq + Default + Into<u32> + Sync>(values: &[T], grid: &Grid) -> SliceTally {
    let dims = grid.dims();
    let empty = || SliceTally { by_bits: HashMap::new(), lo: [usize::MAX; 3], hi: [0; 3] };
    values
        .par_chunks_exact(dims[0] * dims[1])
        .enumerate()
        .map(|(z, slice)| tally_slice(slice, dims[0], z))
        .reduce(empty, |mut a, b| {
            for (bits, t) in b.by_bits {
                let into = a.by_bits.entry(bits).or_default();
                into.voxels += t.voxels;
                for axis in 0..3 {
                    into.sum[axis] += t.sum[axis];
                }
            }
            for axis in 0..3 {
                a.lo[axis] = a.lo[axis].min(b.lo[axis]);
                a.hi[axis] = a.hi[axis].max(b.hi[axis]);
            }
            a
        })
}

impl Regions {
    /// Counts the regions of `index` in one pass.
    pub fn of(index: &TumorIndex) -> Self {
        let grid = index.grid();
        let found = match index.data() {
            IndexData::U8(v) => tally(v, grid),
            IndexData::U16(v) => tally(v, grid),
            IndexData::U32(v) => tally(v, grid),
        };
        let mut list: Vec<Region> = found
            .by_bits
            .into_iter()
            .map(|(bits, t)| {
                let n = t.voxels as f64;
                let center = DVec3::new(t.sum[0] as f64 / 2.0, t.sum[1] as f64, t.sum[2] as f64) / n;
                Region {
                    bits,
                    voxels: t.voxels,
                    volume_ml: grid.volume_ml(t.voxels),
                    centroid_mm: grid.world_from_voxel().transform_point3(center),
                }
            })
            .collect();
        list.sort_by_key(|r| (r.mask_count(), r.bits));
        let bounds = (found.lo[0] != usize::MAX)
            .then(|| (found.lo, std::array::from_fn(|a| found.hi[a] - found.lo[a] + 1)));
        Self { list, bounds, mask_ids: index.mask_ids().to_vec(), voxel_volume_mm3: grid.voxel_volume_mm3() }
    }

    /// All regions, fewest masks first, then by bits.
    pub fn list(&self) -> &[Region] {
        &self.list
    }

    /// The region with exactly these bits; `None` when it has no voxel.
    pub fn get(&self, bits: u32) -> Option<&Region> {
        self.list.iter().find(|r| r.bits == bits)
    }

    /// First voxel and size of the bounding box of all active voxels; `None` when there are none.
    pub fn bounds(&self) -> Option<([usize; 3], [usize; 3])> {
        self.bounds
    }

    /// The same with other ids of its masks, in their order.
    pub(crate) fn with_mask_ids(&self, mask_ids: Vec<String>) -> Self {
        Self { mask_ids, ..self.clone() }
    }

    /// Ids of the masks; bit k is `mask_ids()[k]`.
    pub fn mask_ids(&self) -> &[String] {
        &self.mask_ids
    }

    /// Voxels of the union of all masks.
    pub fn union_voxels(&self) -> u64 {
        self.list.iter().map(|r| r.voxels).sum()
    }

    /// Millilitres of the union of all masks.
    pub fn union_ml(&self) -> f64 {
        self.union_voxels() as f64 * self.voxel_volume_mm3 / 1000.0
    }

    /// Voxels where mask k is active.
    pub fn mask_voxels(&self, mask: usize) -> u64 {
        self.list.iter().filter(|r| r.bits >> mask & 1 == 1).map(|r| r.voxels).sum()
    }

    /// Millilitres where mask k is active.
    pub fn mask_ml(&self, mask: usize) -> f64 {
        self.mask_voxels(mask) as f64 * self.voxel_volume_mm3 / 1000.0
    }

    /// Centroid of the union, world millimetres: where the lens starts. `None` when all masks are empty.
    pub fn centroid_mm(&self) -> Option<DVec3> {
        let n = self.union_voxels();
        (n > 0).then(|| self.list.iter().map(|r| r.centroid_mm * (r.voxels as f64 / n as f64)).sum())
    }

    /// Name of a region from its masks' ids: `T1+PET`.
    pub fn name(&self, bits: u32) -> String {
        let names: Vec<&str> = self
            .mask_ids
            .iter()
            .enumerate()
            .filter(|(k, _)| bits >> k & 1 == 1)
            .map(|(_, id)| id.as_str())
            .collect();
        names.join("+")
    }
}

/// The regions currently shown. Stored is which regions are hidden, because hiding is a deliberate act:
/// regions that were never hidden (such as another time point's) are shown.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Selection {
    hidden: BTreeSet<u32>,
}

impl Selection {
    /// Everything shown.
    pub fn all() -> Self {
        Self::default()
    }

    /// Only these regions of `regions` shown.
    pub fn only(regions: &Regions, shown: &[u32]) -> Self {
        let hidden = regions.list().iter().map(|r| r.bits).filter(|b| !shown.contains(b)).collect();
        Self { hidden }
    }

    /// Whether the region with these bits is shown.
    pub fn shows(&self, bits: u32) -> bool {
        bits != 0 && !self.hidden.contains(&bits)
    }

    /// Bits of the hidden regions, ascending; also of those without a voxel.
    pub fn hidden(&self) -> impl Iterator<Item = u32> {
        self.hidden.iter().copied()
    }

    /// Shows or hides one region.
    pub fn set(&mut self, bits: u32, shown: bool) {
        if shown {
            self.hidden.remove(&bits);
        } else {
            self.hidden.insert(bits);
        }
    }

    /// Toggles one region.
    pub fn toggle(&mut self, bits: u32) {
        let shown = self.shows(bits);
        self.set(bits, !shown);
    }

    /// Whether no region of `regions` is shown.
    pub fn is_empty(&self, regions: &Regions) -> bool {
        regions.list().iter().all(|r| !self.shows(r.bits))
    }
}

/// The tumour index cropped to its bounding box, with consecutive region numbers instead of bit sets:
/// what is uploaded to the GPU. 0 is empty; n is `regions.list()[n - 1]`.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionVolume {
    grid: Grid,
    ids: IndexData,
    bits_of_id: Vec<u32>,
}

impl RegionVolume {
    /// `None` when no voxel is active: there is nothing to draw.
    pub fn of(index: &TumorIndex, regions: &Regions) -> Option<Self> {
        let (start, dims) = regions.bounds()?;
        let grid = index.grid().crop(start, dims).ok()?;
        let id_of_bits: BTreeMap<u32, u32> =
            regions.list().iter().zip(1..).map(|(r, id)| (r.bits, id)).collect();
        let highest = regions.list().len() as u32;
        let mut last_id = (0, 0);
        let mut id_at = |linear: usize| {
            let bits = index.get(linear);
            if bits != last_id.0 {
                last_id = (bits, id_of_bits.get(&bits).copied().unwrap_or(0));
            }
            last_id.1
        };
        let mut numbers = Vec::with_capacity(grid.voxel_count());
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                let first = index.grid().linear([start[0], start[1] + y, start[2] + z]);
                numbers.extend((first..first + dims[0]).map(&mut id_at));
            }
        }
        let ids = if highest <= 0xff {
            IndexData::U8(numbers.iter().map(|&v| v as u8).collect())
        } else if highest <= 0xffff {
            IndexData::U16(numbers.iter().map(|&v| v as u16).collect())
        } else {
            IndexData::U32(numbers)
        };
        let bits_of_id = std::iter::once(0).chain(regions.list().iter().map(|r| r.bits)).collect();
        Some(Self { grid, ids, bits_of_id })
    }

    /// The cropped grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Region numbers, `x` fastest.
    pub fn ids(&self) -> &IndexData {
        &self.ids
    }

    /// Region number of the voxel at `linear` of the cropped grid.
    #[inline]
    pub fn id(&self, linear: usize) -> u32 {
        match &self.ids {
            IndexData::U8(v) => u32::from(v[linear]),
            IndexData::U16(v) => u32::from(v[linear]),
            IndexData::U32(v) => v[linear],
        }
    }

    /// Index bits of each region number; `[0]` is 0.
    pub fn bits_of_id(&self) -> &[u32] {
        &self.bits_of_id
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::{Mask, MaskBits};

    fn index(dims: [usize; 3], masks: usize, seed: u64) -> TumorIndex {
        let grid = Grid::axis_aligned(dims, DVec3::new(1.0, 2.0, 3.0), DVec3::splat(-7.0)).unwrap();
        let mut state = seed;
        let mask_list: Vec<Mask> = (0..masks)
            .map(|k| {
                let bits = MaskBits::from_fn(dims, |_| {
                    state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                    state >> 61 == 0
                });
                Mask::new(format!("m{k}"), grid.clone(), bits).unwrap()
            })
            .collect();
        TumorIndex::new(grid, &mask_list.iter().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn regions_equal_brute_force_for_each_width() {
        for masks in [1, 3, 8, 9, 16, 17, 32] {
            let index = index([67, 5, 6], masks, masks as u64);
            let regions = Regions::of(&index);
            let mut brute: BTreeMap<u32, (u64, DVec3)> = BTreeMap::new();
            for z in 0..6 {
                for y in 0..5 {
                    for x in 0..67 {
                        let bits = index.get(index.grid().linear([x, y, z]));
                        if bits != 0 {
                            let e = brute.entry(bits).or_default();
                            e.0 += 1;
                            e.1 += index.grid().center_of_voxel_mm([x, y, z]);
                        }
                    }
                }
            }
            assert_eq!(regions.list().len(), brute.len());
            for r in regions.list() {
                let (n, sum) = brute[&r.bits];
                assert_eq!(r.voxels, n);
                assert!((r.centroid_mm - sum / n as f64).length() < 1e-9);
                assert!((r.volume_ml - n as f64 * 6.0 / 1000.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn region_volume_equals_the_index() {
        let index = index([40, 7, 9], 3, 5);
        let regions = Regions::of(&index);
        let volume = RegionVolume::of(&index, &regions).unwrap();
        let (start, dims) = regions.bounds().unwrap();
        assert_eq!(volume.grid().dims(), dims);
        for linear in 0..volume.grid().voxel_count() {
            let ijk = volume.grid().ijk(linear);
            let full = index.grid().linear(std::array::from_fn(|a| ijk[a] + start[a]));
            assert_eq!(volume.bits_of_id()[volume.id(linear) as usize], index.get(full));
        }
    }

    #[test]
    fn empty_index_has_no_regions() {
        let grid = Grid::axis_aligned([3, 3, 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let index = TumorIndex::new(grid, &[]).unwrap();
        let regions = Regions::of(&index);
        assert!(regions.list().is_empty());
        assert_eq!(regions.centroid_mm(), None);
        assert_eq!(RegionVolume::of(&index, &regions), None);
    }

    #[test]
    fn unknown_regions_are_shown_until_hidden() {
        let regions = Regions::of(&index([20, 5, 5], 2, 1));
        let mut s = Selection::all();
        assert!(s.shows(1) && s.shows(99) && !s.shows(0));
        s.toggle(1);
        assert!(!s.shows(1));
        assert_eq!(Selection::only(&regions, &[2, 3]), s);
        assert!(Selection::only(&regions, &[]).is_empty(&regions));
    }

    /// Every combination of `masks` masks, one voxel each: voxel n has the bits n.
    fn all_combinations(dims: [usize; 3], masks: usize) -> TumorIndex {
        let grid = Grid::axis_aligned(dims, DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO).unwrap();
        let of = |k: usize| {
            let bits = MaskBits::from_fn(dims, |linear| linear >> k & 1 == 1);
            Mask::new(format!("m{k}"), grid.clone(), bits).unwrap()
        };
        let masks: Vec<Mask> = (0..masks).map(of).collect();
        TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap()
    }

    /// Voxels of 6 mm³; of 8 combinations of 3 masks, 4 have each mask, 7 have one.
    #[test]
    fn totals_names_and_bounds_are_those_of_the_voxels() {
        let regions = Regions::of(&all_combinations([4, 2, 1], 3));
        let order: Vec<u32> = regions.list().iter().map(|r| r.bits).collect();
        assert_eq!(order, [1, 2, 4, 3, 5, 6, 7], "fewest masks first");
        assert_eq!((regions.union_voxels(), regions.mask_voxels(0), regions.mask_voxels(2)), (7, 4, 4));
        assert!((regions.union_ml() - 0.042).abs() < 1e-15);
        assert!((regions.mask_ml(1) - 0.024).abs() < 1e-15);
        assert_eq!([1, 5, 6, 7].map(|bits| regions.name(bits)), ["m0", "m0+m2", "m1+m2", "m0+m1+m2"]);
        assert_eq!(regions.bounds(), Some(([0, 0, 0], [4, 2, 1])));
        assert_eq!(regions.get(6).map(|r| (r.voxels, r.mask_count())), Some((1, 2)));
        assert_eq!(regions.get(8), None);
        // Of x 0 to 3 and y 0 to 1 all but the first: sums 12 and 4, of 7.
        let centroid = regions.centroid_mm().unwrap();
        assert!((centroid - DVec3::new(12.0 / 7.0, 2.0 * 4.0 / 7.0, 0.0)).length() < 1e-14, "{centroid}");
    }

    #[test]
    fn bounds_are_tight_on_every_side() {
        let grid = Grid::axis_aligned([9, 8, 7], DVec3::ONE, DVec3::ZERO).unwrap();
        let mut bits = MaskBits::empty([9, 8, 7]);
        for voxel in [[2, 5, 3], [6, 3, 4], [4, 4, 2]] {
            bits.set(voxel);
        }
        let mask = Mask::new("a", grid.clone(), bits).unwrap();
        let index = TumorIndex::new(grid, &[&mask]).unwrap();
        assert_eq!(Regions::of(&index).bounds(), Some(([2, 3, 2], [5, 3, 3])));
    }

    #[test]
    fn region_numbers_take_the_smallest_type_that_holds_them() {
        for (dims, masks, bytes) in [
            ([16, 16, 1], 8, 1),
            ([16, 16, 2], 9, 2),
            ([2, 129, 1], 9, 2),
            ([256, 256, 1], 16, 2),
            ([257, 256, 1], 17, 4),
        ] {
            let index = all_combinations(dims, masks);
            let regions = Regions::of(&index);
            assert_eq!(regions.list().len(), dims.iter().product::<usize>() - 1);
            let volume = RegionVolume::of(&index, &regions).unwrap();
            let found = match volume.ids() {
                IndexData::U8(_) => 1,
                IndexData::U16(_) => 2,
                IndexData::U32(_) => 4,
            };
            assert_eq!(found, bytes, "{dims:?}");
            for linear in [1, 2, index.grid().voxel_count() - 1] {
                assert_eq!(volume.bits_of_id()[volume.id(linear) as usize], linear as u32);
            }
            assert_eq!(volume.id(0), 0);
        }
    }

    #[test]
    fn a_selection_is_what_was_hidden() {
        let regions = Regions::of(&all_combinations([4, 1, 1], 2));
        let mut s = Selection::only(&regions, &[2]);
        assert_eq!(s.hidden().collect::<Vec<_>>(), [1, 3]);
        assert!(!s.is_empty(&regions));
        s.set(2, false);
        assert!(s.is_empty(&regions));
        s.set(3, true);
        s.toggle(1);
        assert_eq!(s.hidden().collect::<Vec<_>>(), [2]);
        assert!(s.shows(1) && s.shows(3) && !s.is_empty(&regions));
    }
}
