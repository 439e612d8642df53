//! Prefiltered extinction.

use glam::DVec3;
use rayon::prelude::*;

use crate::occlusion::OpticalVolume;

/// Optical thickness of a cell past which nothing comes through.
const DARK: f64 = 40.0;

/// One level: each cell's extinction is that of a homogeneous cell that lets as much light through,
/// the mean of its columns along the three axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// Cells along each axis.
    pub dims: [usize; 3],
    /// Voxels of the volume along a cell's sides.
    pub voxels: [u32; 3],
    /// Millimetres along a cell's shortest side.
    pub cell_mm: f64,
    /// Extinction per millimetre, x fastest; finite.
    pub extinction: Vec<f32>,
}

/// Levels from fine to coarse; the first has the volume's own voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid {
    /// At least one.
    pub levels: Vec<Level>,
}

impl Pyramid {
    /// Of a volume, clipped voxels empty. At each level the axes whose cells are shortest are halved, so
    /// that thick slices become cubes first.
    pub fn of(volume: &OpticalVolume) -> Self {
        let dims = volume.grid().dims();
        let spacing_mm = volume.grid().spacing_mm();
        let finest = spacing_mm.min_element();
        let (normal, offset) = volume.index_plane();
        let extinction = (0..volume.grid().voxel_count())
            .into_par_iter()
            .map(|l| {
                let cell = [l % dims[0], l / dims[0] % dims[1], l / dims[0] / dims[1]];
                let center = DVec3::from_array(cell.map(|c| c as f64 + 0.5));
                if normal.dot(center) > offset {
                    return 0.0;
                }
                volume.optics_of_voxel(cell).extinction_per_mm.min(DARK / finest) as f32
            })
            .collect();
        let finest = Level { dims, voxels: [1; 3], cell_mm: finest, extinction };
        let coarser = coarser(finest.halved(spacing_mm), spacing_mm);
        Self { levels: std::iter::once(finest).chain(coarser).collect() }
    }

    /// The levels above the voxels themselves, whose extinction per millimetre (finite) `extinction`
    /// tells: no copy of them is made.
    pub(crate) fn coarser(
        dims: [usize; 3],
        spacing_mm: DVec3,
        extinction: impl Fn([usize; 3]) -> f64 + Sync,
    ) -> Vec<Level> {
        let shape = Shape { dims, voxels: [1; 3], cell_mm: spacing_mm.min_element() };
        coarser(shape.halved(spacing_mm, extinction), spacing_mm)
    }
}

fn coarser(first: Option<Level>, spacing_mm: DVec3) -> Vec<Level> {
    std::iter::successors(first, |level| level.halved(spacing_mm)).collect()
}

impl Level {
    fn halved(&self, spacing_mm: DVec3) -> Option<Self> {
        let shape = Shape { dims: self.dims, voxels: self.voxels, cell_mm: self.cell_mm };
        let [x, y, _] = self.dims;
        shape.halved(spacing_mm, |cell| {
            self.extinction.get((cell[2] * y + cell[1]) * x + cell[0]).copied().map_or(0.0, f64::from)
        })
    }
}

/// A level without its cells.
struct Shape {
    dims: [usize; 3],
    voxels: [u32; 3],
    cell_mm: f64,
}

impl Shape {
    /// The next level, `None` above a single cell.
    fn halved(&self, spacing_mm: DVec3, inside: impl Fn([usize; 3]) -> f64 + Sync) -> Option<Level> {
        self.dims.iter().any(|d| *d > 1).then(|| halved(self, spacing_mm, inside))
    }
}

fn halved(level: &Shape, spacing_mm: DVec3, inside: impl Fn([usize; 3]) -> f64 + Sync) -> Level {
    let cell: [f64; 3] = std::array::from_fn(|a| spacing_mm[a] * f64::from(level.voxels[a]));
    let joins = cell.map(|c| c < 1.5 * level.cell_mm);
    let dims: [usize; 3] =
        std::array::from_fn(|a| if joins[a] { level.dims[a].div_ceil(2) } else { level.dims[a] });
    let voxels: [u32; 3] =
        std::array::from_fn(|a| if joins[a] { 2 * level.voxels[a] } else { level.voxels[a] });
    let at = |cell: [usize; 3]| if (0..3).all(|a| cell[a] < level.dims[a]) { inside(cell) } else { 0.0 };
    let extinction = (0..dims.iter().product::<usize>())
        .into_par_iter()
        .map(|l| {
            let to = [l % dims[0], l / dims[0] % dims[1], l / dims[0] / dims[1]];
            let child = |i: usize| {
                let shift = [i & 1, i >> 1 & 1, i >> 2];
                at(std::array::from_fn(|a| if joins[a] { 2 * to[a] + shift[a] } else { to[a] }))
            };
            let children: [f64; 8] = std::array::from_fn(child);
            // Most cells are in the air.
            if children == [0.0; 8] {
                return 0.0;
            }
            let along = |axis: usize| {
                let length = if joins[axis] { 2.0 * cell[axis] } else { cell[axis] };
                let through: f64 = (0..8)
                    .filter(|i| i >> axis & 1 == 0)
                    .map(|i| (-0.5 * (children[i] + children[i | 1 << axis]) * length).exp())
                    .sum::<f64>()
                    / 4.0;
                (-through.ln()).min(DARK) / length
            };
            ((along(0) + along(1) + along(2)) / 3.0) as f32
        })
        .collect();
    Level { dims, voxels, cell_mm: 2.0 * level.cell_mm, extinction }
}
