//! Prefiltered extinction.

use glam::DVec3;
use glioscope_core::grid::ijk;
use rayon::prelude::*;

/// Optical thickness at which a cell is opaque.
const OPAQUE_THICKNESS: f64 = 40.0;

/// One level: each cell's extinction is that of a homogeneous cell of the same transmittance, averaged
/// over the three axes, the transmittance along an axis being the mean over its columns.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Level {
    /// Cells along each axis.
    pub dims: [usize; 3],
    /// Voxels of the volume along a cell's sides.
    pub voxels: [u32; 3],
    /// Millimetres along a cell's shortest side.
    pub cell_mm: f64,
    /// Extinction per millimetre, x fastest; finite.
    pub extinction: Vec<f32>,
}

/// The levels above the voxels of a medium, from fine to coarse. `extinction` gives that of a voxel per millimetre
/// (finite), so that the voxels aren't copied. At each level the axes with the shortest cells are halved, so that thick
/// slices become cubes first.
pub(crate) fn levels(
    dims: [usize; 3],
    spacing_mm: DVec3,
    extinction: impl Fn([usize; 3]) -> f64 + Sync,
) -> Vec<Level> {
    let shape = Shape { dims, voxels: [1; 3], cell_mm: spacing_mm.min_element() };
    let first = shape.halved(spacing_mm, extinction);
    std::iter::successors(first, |level| level.halved(spacing_mm)).collect()
}

/// The colours of all levels' cells, in linear light: the mean of what each holds, by its extinction; black where that is 0.
/// `extinction` and `color` give those of a voxel, the first as [`levels`] had it.
pub(crate) fn colors(
    dims: [usize; 3],
    levels: &[Level],
    extinction: impl Fn([usize; 3]) -> f64 + Sync,
    color: impl Fn([usize; 3]) -> DVec3 + Sync,
) -> Vec<Vec<DVec3>> {
    let mut out: Vec<Vec<DVec3>> = Vec::new();
    let (mut from, mut voxels) = (dims, [1; 3]);
    for level in levels {
        let below = out.last().zip(levels.get(out.len().wrapping_sub(1)));
        let [x, y, _] = from;
        let look = |cell: [usize; 3]| match below {
            None => {
                let per_mm = extinction(cell);
                (per_mm, if per_mm > 0.0 { color(cell) } else { DVec3::ZERO })
            }
            Some((colors, level)) => {
                let at = (cell[2] * y + cell[1]) * x + cell[0];
                let per_mm = level.extinction.get(at).copied().map_or(0.0, f64::from);
                (per_mm, colors.get(at).copied().unwrap_or_default())
            }
        };
        let joins: [bool; 3] = std::array::from_fn(|a| level.voxels[a] != voxels[a]);
        let mean = |l: usize| {
            let to = ijk(level.dims, l);
            let (mut sum, mut all) = (DVec3::ZERO, 0.0);
            for i in 0..8usize {
                let shift = [i & 1, i >> 1 & 1, i >> 2];
                let cell: [usize; 3] =
                    std::array::from_fn(|a| if joins[a] { 2 * to[a] + shift[a] } else { to[a] });
                if (0..3).all(|a| cell[a] < from[a] && (joins[a] || shift[a] == 0)) {
                    let (per_mm, color) = look(cell);
                    sum += color * per_mm;
                    all += per_mm;
                }
            }
            if all > 0.0 { sum / all } else { DVec3::ZERO }
        };
        let found = (0..level.extinction.len()).into_par_iter().map(mean).collect();
        out.push(found);
        (from, voxels) = (level.dims, level.voxels);
    }
    out
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
            let to = ijk(dims, l);
            let child = |i: usize| {
                let shift = [i & 1, i >> 1 & 1, i >> 2];
                at(std::array::from_fn(|a| if joins[a] { 2 * to[a] + shift[a] } else { to[a] }))
            };
            let children: [f64; 8] = std::array::from_fn(child);
            // Most cells are in air.
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
                (-through.ln()).min(OPAQUE_THICKNESS) / length
            };
            ((along(0) + along(1) + along(2)) / 3.0) as f32
        })
        .collect();
    Level { dims, voxels, cell_mm: 2.0 * level.cell_mm, extinction }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A level's cell transmits as much as its voxels do, and thick slices become cubes first.
    #[test]
    fn levels_preserve_transmittance() {
        let ball = |[x, y, z]: [usize; 3], extinction: f64| {
            let at = DVec3::new(x as f64, y as f64, z as f64) / 31.0 - 0.5;
            if at.length() < 0.3 { extinction } else { 0.0 }
        };
        let of = |cell| ball(cell, 0.05);
        let levels_of = levels([32; 3], DVec3::new(1.0, 1.0, 4.0), of);
        assert_eq!(levels_of[1].voxels, [4, 4, 1]);
        assert_eq!(levels_of[2].voxels, [8, 8, 2]);
        assert_eq!(levels_of.last().unwrap().dims, [1; 3]);
        let whole: f64 = (0..32 * 32 * 32).map(|l| of([l % 32, l / 32 % 32, l / 1024])).sum();
        for level in &levels_of {
            assert!(level.extinction.iter().all(|e| e.is_finite() && (0.0..=0.0501).contains(e)));
            let cell: u32 = level.voxels.iter().product();
            let mass: f64 = level.extinction.iter().map(|e| f64::from(*e)).sum::<f64>() * f64::from(cell);
            // In a thin medium filtering changes the mass by little, and never raises it.
            assert!(mass < whole * 1.001 && mass > 0.6 * whole, "{} {mass} {whole}", level.cell_mm);
        }
        let opaque = levels([32; 3], DVec3::ONE, |cell| ball(cell, 40.0));
        assert!(opaque.iter().all(|l| l.extinction.iter().all(|e| e.is_finite() && *e >= 0.0)));
    }
}
