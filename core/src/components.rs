//! Connected components of a mask or of the tumour index, by union-find over x-runs
//! (Wu, Otoo, Suzuki 2009: two passes, smallest root wins; here on runs instead of voxels).

use std::ops::{BitAnd, BitOr, BitXor, Range};

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    mask::MaskBits,
    tumor_index::{IndexData, TumorIndex},
};

#[cfg(test)]
mod tests;

/// Slices per labelling task, before the seams are joined. The result doesn't depend on it.
const SLAB: usize = 8;

/// Which voxels are neighbours; 26 by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Connectivity {
    /// Sharing a face.
    Six,
    /// Sharing a face or an edge.
    Eighteen,
    /// Sharing a face, an edge or a corner.
    #[default]
    TwentySix,
}

impl Connectivity {
    /// Number of neighbours of a voxel: 6, 18 or 26.
    pub fn neighbors(self) -> u32 {
        match self {
            Self::Six => 6,
            Self::Eighteen => 18,
            Self::TwentySix => 26,
        }
    }

    /// The connectivity with this many neighbours; `None` for numbers other than 6, 18 and 26.
    pub fn of_neighbors(neighbors: u32) -> Option<Self> {
        [Self::Six, Self::Eighteen, Self::TwentySix].into_iter().find(|c| c.neighbors() == neighbors)
    }

    /// How far in x a run reaches into an adjacent line that differs in y or z (`axes` 1) or in both (2);
    /// `None` if such lines aren't neighbours.
    fn reach(self, axes: usize) -> Option<u32> {
        match (self, axes) {
            (Self::Six, 1) | (Self::Eighteen, 2) => Some(0),
            (Self::Six, _) => None,
            _ => Some(1),
        }
    }
}

/// More voxels along an axis, or more runs, than 32 bits can count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found a mask too large to label, expected fewer than 2^32 voxels along each axis and 2^32 runs")]
pub struct TooLarge;

/// Neighbouring voxels of one x-line that belong to one component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// x of the first voxel.
    pub first: u32,
    /// x of the last voxel (inclusive).
    pub last: u32,
    /// y of the line.
    pub y: u32,
    /// z of the line.
    pub z: u32,
}

/// One component, in voxel indices (centres at whole numbers).
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// Bit set of its voxels in the tumour index; 1 for a component of a mask.
    pub value: u32,
    /// Number of voxels.
    pub voxels: u64,
    /// First voxel of the bounding box.
    pub start: [usize; 3],
    /// Size of the bounding box, each at least 1.
    pub dims: [usize; 3],
    /// Mean voxel index, from exact integer sums.
    pub centroid_voxel: DVec3,
    runs: Range<usize>,
}

/// All components, in raster order of their first voxels whatever the number of threads.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Components {
    list: Vec<Component>,
    /// Grouped by component, raster order within each.
    runs: Vec<Run>,
}

impl Components {
    /// Components of the active voxels.
    ///
    /// # Errors
    /// [`TooLarge`] past 32-bit sizes.
    pub fn of_mask(bits: &MaskBits, connectivity: Connectivity) -> Result<Self, TooLarge> {
        let per_line = bits.words_per_line();
        label(bits.dims(), connectivity, |line, emit| {
            runs_of_words(&bits.words()[line * per_line..][..per_line], emit);
        })
    }

    /// Components of every region in one pass: neighbours with the same non-zero bit set are
    /// connected.
    ///
    /// # Errors
    /// [`TooLarge`] past 32-bit sizes.
    pub fn of_index(index: &TumorIndex, connectivity: Connectivity) -> Result<Self, TooLarge> {
        let dims = index.grid().dims();
        match index.data() {
            IndexData::U8(v) => label(dims, connectivity, |l, emit| {
                runs_of_values(&v[l * dims[0]..][..dims[0]], u8::MAX, emit);
            }),
            IndexData::U16(v) => label(dims, connectivity, |l, emit| {
                runs_of_values(&v[l * dims[0]..][..dims[0]], u16::MAX, emit);
            }),
            IndexData::U32(v) => label(dims, connectivity, |l, emit| {
                runs_of_values(&v[l * dims[0]..][..dims[0]], u32::MAX, emit);
            }),
        }
    }

    /// Components of one mask of the index: neighbours that both have bit `mask`, whatever their other
    /// bits, are connected.
    ///
    /// # Errors
    /// [`TooLarge`] past 32-bit sizes.
    pub fn of_index_mask(
        index: &TumorIndex,
        mask: usize,
        connectivity: Connectivity,
    ) -> Result<Self, TooLarge> {
        let dims = index.grid().dims();
        // No index type is wider than 32 bits.
        let bit = u32::try_from(mask).ok().and_then(|k| 1_u32.checked_shl(k)).unwrap_or(0);
        match index.data() {
            IndexData::U8(v) => label(dims, connectivity, |l, emit| {
                runs_of_values(&v[l * dims[0]..][..dims[0]], bit as u8, &mut |a, b, _| emit(a, b, 1));
            }),
            IndexData::U16(v) => label(dims, connectivity, |l, emit| {
                runs_of_values(&v[l * dims[0]..][..dims[0]], bit as u16, &mut |a, b, _| emit(a, b, 1));
            }),
            IndexData::U32(v) => label(dims, connectivity, |l, emit| {
                runs_of_values(&v[l * dims[0]..][..dims[0]], bit, &mut |a, b, _| emit(a, b, 1));
            }),
        }
    }

    /// The components; label `i + 1` is `list()[i]`.
    pub fn list(&self) -> &[Component] {
        &self.list
    }

    /// Runs of `component`, which is one of [`Components::list`], in raster order. A line has
    /// several where the component has gaps.
    pub fn runs(&self, component: &Component) -> &[Run] {
        self.runs.get(component.runs.clone()).unwrap_or(&[])
    }

    /// Label of every voxel of a grid of `dims` (those of the labelled volume): 0 for background,
    /// from 1 in raster order.
    pub fn labels(&self, dims: [usize; 3]) -> Vec<u32> {
        let mut labels = vec![0; dims.iter().product()];
        for (label, component) in (1..).zip(&self.list) {
            for run in self.runs(component) {
                let line = (run.z as usize * dims[1] + run.y as usize) * dims[0];
                labels[line + run.first as usize..=line + run.last as usize].fill(label);
            }
        }
        labels
    }
}

/// Calls `emit(first, last, 1)` for each run of set bits.
fn runs_of_words(words: &[u64], emit: &mut dyn FnMut(u32, u32, u32)) {
    let mut open: Option<u32> = None;
    for (w, &word) in words.iter().enumerate() {
        let base = w as u32 * 64;
        let mut at = 0;
        while at < 64 {
            let rest = if open.is_some() { !word >> at } else { word >> at };
            if rest == 0 {
                break;
            }
            at += rest.trailing_zeros();
            match open.take() {
                Some(first) => emit(first, base + at - 1, 1),
                None => open = Some(base + at),
            }
        }
    }
    if let Some(first) = open {
        emit(first, words.len() as u32 * 64 - 1, 1);
    }
}

/// Values of a tumour index.
trait Bits:
    Copy + PartialEq + Default + BitAnd<Output = Self> + BitXor<Output = Self> + BitOr<Output = Self>
{
}

impl<T> Bits for T where
    T: Copy + PartialEq + Default + BitAnd<Output = T> + BitXor<Output = T> + BitOr<Output = T>
{
}

/// Calls `emit(first, last, value)` for each run of one non-zero value, of which only the bits in
/// `bit_mask` count.
fn runs_of_values<T: Bits + Into<u32>>(line: &[T], bit_mask: T, emit: &mut dyn FnMut(u32, u32, u32)) {
    let mut at = equal_from(line, bit_mask, T::default());
    while let Some(&first) = line.get(at) {
        let value = first & bit_mask;
        let next = at + equal_from(&line[at..], bit_mask, value);
        if value != T::default() {
            emit(at as u32, next as u32 - 1, value.into());
        }
        at = next;
    }
}

/// Number of leading values that equal `value` in the bits of `bit_mask`. Whole blocks are compared
/// without a branch, so that the compiler vectorises the comparison: most of an index is empty.
fn equal_from<T: Bits>(line: &[T], bit_mask: T, value: T) -> usize {
    const BLOCK: usize = 32;
    let differs = |block: &[T]| block.iter().fold(T::default(), |any, &v| any | ((v & bit_mask) ^ value));
    let blocks = line.chunks_exact(BLOCK).take_while(|block| differs(block) == T::default()).count();
    let rest = &line[blocks * BLOCK..];
    blocks * BLOCK + rest.iter().take_while(|&&v| v & bit_mask == value).count()
}

/// Runs of some slices with their union-find forest: `parent[i] <= i`, a root is its own parent.
#[derive(Default)]
struct Forest {
    runs: Vec<(Run, u32)>,
    parent: Vec<u32>,
    /// Where each line's runs start, and the end of the last.
    lines: Vec<usize>,
}

impl Forest {
    fn root(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            // Path halving.
            let up = self.parent[self.parent[i as usize] as usize];
            self.parent[i as usize] = up;
            i = up;
        }
        i
    }

    /// Unites the runs of line `here` with runs of line `there` of equal value that overlap them in x when
    /// widened by `reach`.
    fn join(&mut self, here: usize, there: usize, reach: u32) {
        let mut from = self.lines[there];
        let end = self.lines[there + 1];
        for i in self.lines[here]..self.lines[here + 1] {
            let (run, value) = self.runs[i];
            while from < end && self.runs[from].0.last + reach < run.first {
                from += 1;
            }
            let mut j = from;
            while j < end && self.runs[j].0.first <= run.last + reach {
                if self.runs[j].1 == value {
                    let (a, b) = (self.root(i as u32), self.root(j as u32));
                    self.parent[a.max(b) as usize] = a.min(b);
                }
                j += 1;
            }
        }
    }

    /// Joins slice `z` (of this forest) with the slice before it.
    fn join_slice_before(&mut self, z: usize, ny: usize, connectivity: Connectivity) {
        for y in 0..ny {
            for other in y.saturating_sub(1)..(y + 2).min(ny) {
                if let Some(reach) = connectivity.reach(1 + usize::from(other != y)) {
                    self.join(z * ny + y, (z - 1) * ny + other, reach);
                }
            }
        }
    }
}

fn label(
    dims: [usize; 3],
    connectivity: Connectivity,
    runs_of_line: impl Fn(usize, &mut dyn FnMut(u32, u32, u32)) + Sync,
) -> Result<Components, TooLarge> {
    let [_, ny, nz] = dims;
    // A margin below 2^32 leaves room for the reach past a line's end.
    if dims.iter().any(|&d| d >= (u32::MAX - 64) as usize) {
        return Err(TooLarge);
    }
    let slabs: Vec<Forest> = (0..nz.div_ceil(SLAB))
        .into_par_iter()
        .map(|slab| {
            let mut forest = Forest { lines: vec![0], ..Forest::default() };
            for z in slab * SLAB..((slab + 1) * SLAB).min(nz) {
                let local_z = z - slab * SLAB;
                for y in 0..ny {
                    runs_of_line(z * ny + y, &mut |first, last, value| {
                        forest.parent.push(forest.runs.len() as u32);
                        forest.runs.push((Run { first, last, y: y as u32, z: z as u32 }, value));
                    });
                    forest.lines.push(forest.runs.len());
                    if let (true, Some(reach)) = (y > 0, connectivity.reach(1)) {
                        forest.join(local_z * ny + y, local_z * ny + y - 1, reach);
                    }
                }
                if local_z > 0 {
                    forest.join_slice_before(local_z, ny, connectivity);
                }
            }
            forest
        })
        .collect();

    let total: usize = slabs.iter().map(|s| s.runs.len()).sum();
    if u32::try_from(total).is_err() {
        return Err(TooLarge);
    }
    let mut all = Forest { lines: vec![0], ..Forest::default() };
    all.runs.reserve_exact(total);
    all.parent.reserve_exact(total);
    for slab in slabs {
        let offset = all.runs.len();
        all.parent.extend(slab.parent.iter().map(|p| p + offset as u32));
        all.lines.extend(slab.lines[1..].iter().map(|l| l + offset));
        all.runs.extend(slab.runs);
    }
    for z in (SLAB..nz).step_by(SLAB) {
        all.join_slice_before(z, ny, connectivity);
    }
    Ok(collect(&mut all))
}

/// Flattens the forest. A root precedes the runs below it, so labels are in raster order.
fn collect(forest: &mut Forest) -> Components {
    let mut list: Vec<Component> = Vec::new();
    let mut sums: Vec<[u128; 3]> = Vec::new();
    // From here on `parent` holds labels (from 0).
    for i in 0..forest.runs.len() {
        let (run, value) = forest.runs[i];
        let parent = forest.parent[i] as usize;
        let at = [run.first as usize, run.y as usize, run.z as usize];
        let label = if parent == i {
            let empty = Component {
                value,
                voxels: 0,
                start: at,
                // The last voxel until the end of the pass.
                dims: at,
                centroid_voxel: DVec3::ZERO,
                runs: 0..0,
            };
            list.push(empty);
            sums.push([0; 3]);
            list.len() - 1
        } else {
            forest.parent[parent] as usize
        };
        forest.parent[i] = label as u32;
        let (component, sum) = (&mut list[label], &mut sums[label]);
        let n = u64::from(run.last - run.first) + 1;
        component.voxels += n;
        component.runs.end += 1;
        let last = [run.last as usize, at[1], at[2]];
        for axis in 0..3 {
            component.start[axis] = component.start[axis].min(at[axis]);
            component.dims[axis] = component.dims[axis].max(last[axis]);
            // Twice the sum: first + last may be odd.
            sum[axis] += u128::from(n) * (at[axis] + last[axis]) as u128;
        }
    }
    let mut next = Vec::with_capacity(list.len());
    let mut start = 0;
    for (component, sum) in list.iter_mut().zip(&sums) {
        component.dims = std::array::from_fn(|a| component.dims[a] + 1 - component.start[a]);
        let twice = 2.0 * component.voxels as f64;
        component.centroid_voxel =
            DVec3::new(sum[0] as f64 / twice, sum[1] as f64 / twice, sum[2] as f64 / twice);
        component.runs = start..start + component.runs.end;
        next.push(start);
        start = component.runs.end;
    }
    let mut runs = vec![Run { first: 0, last: 0, y: 0, z: 0 }; forest.runs.len()];
    for (&(run, _), &label) in forest.runs.iter().zip(&forest.parent) {
        runs[next[label as usize]] = run;
        next[label as usize] += 1;
    }
    Components { list, runs }
}
