//! The lesion as a signed distance: what is grown, moved and rasterised anew. Its truth is its own.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::{
    Cancelled, Grid, Mask, MaskBits, Progress,
    export::{MeshError, SurfaceKind, mesh},
    grid::ijk,
    resample::source_from_target,
};

/// Length of a sample's edge at most where volumes are counted, and fewest and most samples along a voxel's edge.
const SAMPLE_MM: f64 = 0.34;
const SAMPLES: (f64, f64) = (2.0, 10.0);

/// The signed distance to the smoothed surface of a mask, in millimetres, negative inside: at the centres of the mask's own voxels,
/// trilinear in between. Its zero level encloses the mask's volume.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// A box of the mask's own grid, with room around the mask; may reach beyond it.
    grid: Grid,
    /// x fastest; no farther than the band.
    distance_mm: Vec<f32>,
    /// The farthest distance that is told, mm.
    band_mm: f64,
}

/// A grid of `dims` voxels with those of `grid`, its first one `start` of them away.
pub(super) fn part_of(grid: &Grid, start: [i64; 3], dims: [usize; 3]) -> Option<Grid> {
    let first = DVec3::from_array(start.map(|v| v as f64));
    let world_from_voxel = grid.world_from_voxel();
    let translation = world_from_voxel.transform_point3(first);
    Grid::new(dims, DAffine3 { translation, ..world_from_voxel }, grid.sides()).ok()
}

/// The box of `grid` that holds the active voxels of `bits` and `margin_mm` around them, beyond the grid where need be: first voxel
/// and size. `None` for an empty mask.
pub(super) fn box_around(bits: &MaskBits, grid: &Grid, margin_mm: f64) -> Option<([i64; 3], [usize; 3])> {
    let (start, size) = bits.bounds()?;
    let margins = voxels_along(grid, margin_mm);
    let first = std::array::from_fn(|a| start[a] as i64 - margins[a] as i64);
    Some((first, std::array::from_fn(|a| size[a] + 2 * margins[a])))
}

/// Voxels along each axis that a ball of radius `mm` reaches, on any axes.
fn voxels_along(grid: &Grid, mm: f64) -> [usize; 3] {
    let inverse = grid.voxel_from_world().matrix3.transpose();
    [inverse.x_axis, inverse.y_axis, inverse.z_axis].map(|row| (row.length() * mm).ceil() as usize + 1)
}

/// `bits` of `grid` in a box of it.
pub(super) fn bits_in(bits: &MaskBits, start: [i64; 3], dims: [usize; 3]) -> MaskBits {
    let mut part = MaskBits::empty(dims);
    let whole = bits.dims();
    bits.for_each(|linear| {
        let v = ijk(whole, linear);
        let local: [i64; 3] = std::array::from_fn(|a| v[a] as i64 - start[a]);
        if (0..3).all(|a| local[a] >= 0 && local[a] < dims[a] as i64) {
            part.set(local.map(|v| v as usize));
        }
    });
    part
}

impl Shape {
    /// Of a mask that isn't empty, told up to `reach_mm` from its surface and a voxel more.
    pub fn new(mask: &Mask, reach_mm: f64, progress: &Progress) -> Result<Option<Self>, MeshError> {
        let own = mask.grid();
        let diagonal_mm = diagonal_mm(own);
        let band_mm = reach_mm + diagonal_mm;
        let Some((start, dims)) = box_around(mask.bits(), own, band_mm + diagonal_mm) else {
            return Ok(None);
        };
        let bits = bits_in(mask.bits(), start, dims);
        let Some(grid) = part_of(own, start, dims) else { return Ok(None) };
        let Some(boxed) = Mask::new(mask.id(), grid.clone(), bits) else { return Ok(None) };
        let surface = mesh(&boxed, SurfaceKind::Smoothed, progress)?;
        let corners: Vec<[DVec3; 3]> =
            surface.triangles().iter().map(|t| t.map(|at| surface.positions_mm()[at as usize])).collect();
        let distances = unsigned_mm(&grid, &corners, band_mm, progress)?;
        let bits = boxed.bits();
        let signed = distances
            .into_par_iter()
            .enumerate()
            .map(|(linear, mm)| if bits.get(ijk(dims, linear)) { -mm } else { mm });
        let mut shape = Self { distance_mm: signed.collect(), grid, band_mm };
        let offset_mm = shape.level_of(boxed.volume_ml() * 1000.0);
        shape.band_mm -= offset_mm.abs();
        let band = shape.band_mm as f32;
        shape.distance_mm.iter_mut().for_each(|mm| *mm = (*mm - offset_mm as f32).clamp(-band, band));
        Ok(Some(shape))
    }

    /// Its box of the mask's own grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Signed distance at a place; beyond the band, the band.
    pub fn at(&self, place_mm: DVec3) -> f64 {
        self.at_voxel(self.grid.voxel_from_world().transform_point3(place_mm))
    }

    /// Signed distance at a place in voxels of its box.
    fn at_voxel(&self, p: DVec3) -> f64 {
        let dims = self.grid.dims();
        if !(0..3).all(|a| p[a] >= 0.0 && p[a] <= dims[a] as f64 - 1.0) {
            return self.band_mm;
        }
        let low: [usize; 3] = std::array::from_fn(|a| (p[a] as usize).min(dims[a].saturating_sub(2)));
        let f: [f64; 3] = std::array::from_fn(|a| p[a] - low[a] as f64);
        let steps = [1, dims[0], dims[0] * dims[1]];
        let first = self.grid.linear(low);
        let value = |corner: usize| {
            let offset: usize =
                (0..3).map(|a| if corner >> a & 1 == 1 && dims[a] > 1 { steps[a] } else { 0 }).sum();
            f64::from(self.distance_mm[first + offset])
        };
        let along_x = |y: usize| value(y) + (value(y | 1) - value(y)) * f[0];
        let along_y = |z: usize| along_x(z) + (along_x(z | 2) - along_x(z)) * f[1];
        along_y(0) + (along_y(4) - along_y(0)) * f[2]
    }

    /// Direction in which the distance grows most, of length 1; zero where it is the same all around.
    pub fn outwards(&self, place_mm: DVec3) -> DVec3 {
        let step_mm = 0.5 * self.grid.spacing_mm().min_element();
        let along = |axis: DVec3| self.at(place_mm + axis * step_mm) - self.at(place_mm - axis * step_mm);
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).try_normalize().unwrap_or(DVec3::ZERO)
    }

    /// The voxels of `grid` whose centres, moved by `earlier_from_later`, `inside` takes: it gets the signed distance and the place in
    /// the shape's space.
    pub fn raster(
        &self,
        grid: &Grid,
        earlier_from_later: DAffine3,
        inside: &(impl Fn(f64, DVec3) -> bool + Sync),
    ) -> MaskBits {
        let [nx, ny, nz] = grid.dims();
        let earlier_from_voxel = earlier_from_later * grid.world_from_voxel();
        let own_from_world = self.grid.voxel_from_world();
        let active = |z: usize| -> Vec<bool> {
            let at = |at: usize| {
                let p = DVec3::new((at % nx) as f64, (at / nx) as f64, z as f64);
                let place_mm = earlier_from_voxel.transform_point3(p);
                inside(self.at_voxel(own_from_world.transform_point3(place_mm)), place_mm)
            };
            (0..nx * ny).map(at).collect()
        };
        let slices: Vec<Vec<bool>> = (0..nz).into_par_iter().map(active).collect();
        let active = slices.concat();
        MaskBits::from_fn(grid.dims(), |linear| active[linear])
    }

    /// Volume in ml of what `inside` takes, counted on samples finer than the voxels where the distance lies between two levels, in mm:
    /// what lies deeper counts, what lies farther outside doesn't.
    pub fn volume_ml(
        &self,
        [deep_mm, far_mm]: [f64; 2],
        inside: &(impl Fn(f64, DVec3) -> bool + Sync),
    ) -> f64 {
        let samples = self.samples();
        let [nx, ny, nz] = self.grid.dims();
        let world_from_voxel = self.grid.world_from_voxel();
        // A voxel's corners lie within this of its centre, but for how much steeper than 1 the distance may be between centres.
        let reach_mm = diagonal_mm(&self.grid);
        let per_slice = |z: usize| -> u64 {
            let mut counted = 0;
            for v in (0..nx * ny).map(|at| [at % nx, at / nx, z]) {
                let middle_mm = f64::from(self.distance_mm[self.grid.linear(v)]);
                if middle_mm < deep_mm - reach_mm || middle_mm > far_mm + reach_mm {
                    counted += if middle_mm < deep_mm { samples.iter().product::<usize>() as u64 } else { 0 };
                    continue;
                }
                each_sample(v, samples, |p| {
                    counted += u64::from(inside(self.at_voxel(p), world_from_voxel.transform_point3(p)));
                });
            }
            counted
        };
        let counted: u64 = (0..nz).into_par_iter().map(per_slice).sum();
        counted as f64 / samples.iter().product::<usize>() as f64 * self.grid.voxel_volume_mm3() / 1000.0
    }

    /// Points of the surface that `level_mm` moves the zero level to, a fraction of a millimetre apart.
    pub fn moved_surface_mm(&self, level_mm: &(impl Fn(DVec3) -> f64 + Sync)) -> Vec<DVec3> {
        let samples = self.samples();
        let spacing_mm = self.grid.spacing_mm();
        let between_mm = (0..3).map(|a| spacing_mm[a] / samples[a] as f64).fold(0.0, f64::max);
        let (reach_mm, world_from_voxel) = (diagonal_mm(&self.grid), self.grid.world_from_voxel());
        let [nx, ny, nz] = self.grid.dims();
        let of_slice = |z: usize| -> Vec<DVec3> {
            let mut points = Vec::new();
            for v in (0..nx * ny).map(|at| [at % nx, at / nx, z]) {
                let middle_mm = f64::from(self.distance_mm[self.grid.linear(v)]);
                if (middle_mm - level_mm(self.grid.center_of_voxel_mm(v))).abs() > reach_mm {
                    continue;
                }
                each_sample(v, samples, |p| {
                    let place_mm = world_from_voxel.transform_point3(p);
                    let off_mm = self.at_voxel(p) - level_mm(place_mm);
                    if off_mm.abs() <= 0.5 * between_mm {
                        points.push(place_mm - self.outwards(place_mm) * off_mm);
                    }
                });
            }
            points
        };
        let slices: Vec<Vec<DVec3>> = (0..nz).into_par_iter().map(of_slice).collect();
        slices.concat()
    }

    /// The level that encloses `volume_mm3`.
    fn level_of(&self, volume_mm3: f64) -> f64 {
        let samples = self.samples();
        let [nx, ny, nz] = self.grid.dims();
        let near_mm = diagonal_mm(&self.grid);
        let values = |z: usize| -> (Vec<f64>, u64) {
            let (mut near, mut below) = (Vec::new(), 0);
            for v in (0..nx * ny).map(|at| [at % nx, at / nx, z]) {
                let middle_mm = f64::from(self.distance_mm[self.grid.linear(v)]);
                if middle_mm > 2.0 * near_mm {
                    continue;
                }
                if middle_mm < -2.0 * near_mm {
                    below += samples.iter().product::<usize>() as u64;
                    continue;
                }
                each_sample(v, samples, |p| near.push(self.at_voxel(p)));
            }
            (near, below)
        };
        let slices: Vec<(Vec<f64>, u64)> = (0..nz).into_par_iter().map(values).collect();
        let below: u64 = slices.iter().map(|(_, below)| below).sum();
        let mut near: Vec<f64> = slices.into_iter().flat_map(|(near, _)| near).collect();
        let wanted = volume_mm3 / self.grid.voxel_volume_mm3() * samples.iter().product::<usize>() as f64;
        let at = (wanted - below as f64).round().max(0.0) as usize;
        if at >= near.len() {
            return 0.0;
        }
        *near.select_nth_unstable_by(at, f64::total_cmp).1
    }

    /// Samples along each axis of a voxel.
    fn samples(&self) -> [usize; 3] {
        let along = |mm: f64| (mm / SAMPLE_MM).ceil().clamp(SAMPLES.0, SAMPLES.1) as usize;
        self.grid.spacing_mm().to_array().map(along)
    }
}

/// Calls `visit` with places in voxel `v`, in voxels.
fn each_sample(v: [usize; 3], samples: [usize; 3], mut visit: impl FnMut(DVec3)) {
    let place = |a: usize, n: usize| v[a] as f64 - 0.5 + (n as f64 + 0.5) / samples[a] as f64;
    for k in 0..samples[2] {
        for j in 0..samples[1] {
            for i in 0..samples[0] {
                visit(DVec3::new(place(0, i), place(1, j), place(2, k)));
            }
        }
    }
}

/// The longest diagonal of a voxel.
fn diagonal_mm(grid: &Grid) -> f64 {
    let m = grid.world_from_voxel().matrix3;
    let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    signs.into_iter().map(|[y, z]| (m.x_axis + m.y_axis * y + m.z_axis * z).length()).fold(0.0, f64::max)
}

/// Distance of every voxel's centre to the nearest of `triangles`, at most `most_mm`.
fn unsigned_mm(
    grid: &Grid,
    triangles: &[[DVec3; 3]],
    most_mm: f64,
    progress: &Progress,
) -> Result<Vec<f32>, Cancelled> {
    let dims = grid.dims();
    let voxel_from_world = grid.voxel_from_world();
    let reach = voxels_along(grid, most_mm);
    // The box of voxels that each triangle can be near, and the triangles by slice.
    let boxes: Vec<([usize; 3], [usize; 3])> = triangles
        .par_iter()
        .map(|triangle| {
            let at = triangle.map(|corner| voxel_from_world.transform_point3(corner));
            let (low, high) = (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]));
            let first = |a: usize| (low[a].floor() - reach[a] as f64).max(0.0) as usize;
            let last = |a: usize| {
                ((high[a].ceil() + reach[a] as f64).max(0.0) as usize).min(dims[a].saturating_sub(1))
            };
            (std::array::from_fn(first), std::array::from_fn(last))
        })
        .collect();
    let mut by_slice: Vec<Vec<u32>> = vec![Vec::new(); dims[2]];
    for (at, (first, last)) in (0..).zip(&boxes) {
        by_slice.iter_mut().take(last[2] + 1).skip(first[2]).for_each(|slice| slice.push(at));
    }
    // A ball around each triangle: most voxels of its box lie nearer to another one, which the ball tells at once.
    let balls: Vec<(DVec3, f64)> = triangles
        .iter()
        .map(|[a, b, c]| {
            let middle = (*a + *b + *c) / 3.0;
            (middle, [a, b, c].into_iter().map(|corner| corner.distance(middle)).fold(0.0, f64::max))
        })
        .collect();
    let mut all_mm = vec![most_mm as f32; grid.voxel_count()];
    let slices = all_mm.par_chunks_mut((dims[0] * dims[1]).max(1)).zip(&by_slice).enumerate();
    slices.try_for_each(|(z, (distances_mm, near))| {
        progress.check()?;
        for at in near.iter().map(|at| *at as usize) {
            let ((first, last), (middle, radius_mm)) = (boxes[at], balls[at]);
            for y in first[1]..=last[1] {
                for x in first[0]..=last[0] {
                    let place_mm = grid.center_of_voxel_mm([x, y, z]);
                    let least_mm = &mut distances_mm[y * dims[0] + x];
                    let reach_mm = f64::from(*least_mm) + radius_mm;
                    if place_mm.distance_squared(middle) < reach_mm * reach_mm {
                        *least_mm = least_mm.min(square_to(&triangles[at], place_mm).sqrt() as f32);
                    }
                }
            }
        }
        Ok::<(), Cancelled>(())
    })?;
    Ok(all_mm)
}

/// Square of the distance of `p` to a triangle (Ericson 2005, 5.1.5).
pub(super) fn square_to([a, b, c]: &[DVec3; 3], p: DVec3) -> f64 {
    let (ab, ac, ap) = (*b - *a, *c - *a, p - *a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return ap.length_squared();
    }
    let bp = p - *b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return bp.length_squared();
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (ap - ab * share(d1, d1 - d3)).length_squared();
    }
    let cp = p - *c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return cp.length_squared();
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (ap - ac * share(d2, d2 - d6)).length_squared();
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return (bp - (*c - *b) * share(d4 - d3, (d4 - d3) + (d5 - d6))).length_squared();
    }
    let sum = va + vb + vc;
    (ap - ab * share(vb, sum) - ac * share(vc, sum)).length_squared()
}

/// `part / whole`; of a triangle without area, 0.
fn share(part: f64, whole: f64) -> f64 {
    if whole == 0.0 { 0.0 } else { part / whole }
}

/// `bits` of `grid` on `onto`, each voxel's centre looked up: the inverse of resampling by nearest neighbour where `onto` is coarser.
pub(super) fn looked_up(bits: &MaskBits, grid: &Grid, onto: &Grid) -> MaskBits {
    let map = source_from_target(grid, onto);
    let dims = onto.dims();
    let from = bits.dims();
    MaskBits::from_fn(dims, |linear| {
        let [x, y, z] = ijk(dims, linear).map(|v| v as f64);
        crate::resample::source_voxel(map.transform_point3(DVec3::new(x, y, z)), from)
            .is_some_and(|voxel| bits.get(voxel))
    })
}
