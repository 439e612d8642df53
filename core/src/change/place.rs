//! Where a mask's surface passes its surface voxels, finer than a voxel.
//!
//! A plane at depth t outside a point, blurred by a Gauss filter of standard deviation σ across it, has the value Φ(t/σ)
//! there: from the value and the gradient of the blurred mask follow the normal and t, exactly for planes. A surface
//! voxel's neighbour outside bounds t: beyond those bounds the mask is finer than its voxels, and t is clamped.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{cavities::Enclosing, groups::Groups, uncertainty::Sampling};
use crate::grid::ijk;

/// Standard deviation of the filter along each axis, in voxels: of 0.6, 0.7, 0.85 and 1 the one with the least error of
/// known movements, docs/change.md.
const SIGMA_VOXELS: f64 = 0.7;

/// Most voxels of the case grid along an edge of the mask's own voxels that the filter follows.
const MOST_EDGE: f64 = 6.0;

/// Reach of the filter in standard deviations; half a voxel more is summed.
const REACH: f64 = 3.0;

/// Slope of the blurred mask times σ below which it has no direction: a plane within a voxel has at least 0.14.
const LEAST_SLOPE: f64 = 0.02;

/// A piece of a surface, as large as its voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    /// Its middle: offset from the crop's first voxel. Without a normal that of the voxel.
    pub middle_mm: DVec3,
    /// Outward normal of length 1; zero where the surface has no direction: of a single voxel, of a sheet one voxel thin.
    pub normal: DVec3,
    /// What the voxel's free faces are seen as along the normal; 0 without one.
    pub area_mm2: f64,
}

/// Voxel edges and their inverse.
#[derive(Clone, Copy)]
pub(super) struct Edges {
    mm: DMat3,
    inverse: DMat3,
}

impl Edges {
    pub fn new(mm: DMat3) -> Self {
        Self { mm, inverse: mm.inverse() }
    }

    /// The shortest edge of a voxel.
    pub fn shortest_mm(&self) -> f64 {
        self.mm.x_axis.length().min(self.mm.y_axis.length()).min(self.mm.z_axis.length())
    }

    /// The longest diagonal of a voxel.
    pub fn longest_diagonal_mm(&self) -> f64 {
        let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
        let diagonal = |[y, z]: [f64; 2]| self.mm.x_axis + self.mm.y_axis * y + self.mm.z_axis * z;
        signs.into_iter().map(|signs| diagonal(signs).length()).fold(0.0, f64::max)
    }
}

impl Patch {
    /// The point of the patch nearest to `p`, where nearness is measured by the inverse of `covariance`; without one in
    /// millimetres. Of a patch without a normal the point of the voxel nearest to `p` along its axes.
    pub fn foot(&self, p: DVec3, edges: &Edges, covariance: Option<&DMat3>) -> DVec3 {
        let apart = p - self.middle_mm;
        if self.normal == DVec3::ZERO {
            let inside = (edges.inverse * apart).clamp(DVec3::splat(-0.5), DVec3::splat(0.5));
            return self.middle_mm + edges.mm * inside;
        }
        let across = covariance.map_or(self.normal, |c| *c * self.normal);
        let along = apart - across * (self.normal.dot(apart) / self.normal.dot(across));
        let voxels = (edges.inverse * along).abs().max_element();
        self.middle_mm + along * if voxels > 0.5 { 0.5 / voxels } else { 1.0 }
    }
}

/// The filter, and what it is applied to.
pub(super) struct Places<'a> {
    masks: [&'a Enclosing<'a>; 2],
    groups: &'a Groups,
    edges: Edges,
    shifts_mm: [DVec3; 2],
    sigma_voxels: DVec3,
    /// Weights along each axis, from the farthest below to the farthest above.
    weights: [Vec<f64>; 3],
}

impl<'a> Places<'a> {
    /// Of two masks in the crop whose voxel edges are `mm`. Both are filtered alike, by the coarser of their own voxels, so that equal
    /// masks have equal surfaces.
    pub fn new(
        masks: [&'a Enclosing<'a>; 2],
        groups: &'a Groups,
        mm: DMat3,
        samplings: &[Sampling; 2],
    ) -> Self {
        let edges = Edges::new(mm);
        let squares = samplings.iter().map(|sampling| {
            let own = edges.inverse * sampling.native_mm();
            let rows = own.transpose();
            DVec3::new(
                rows.x_axis.length_squared(),
                rows.y_axis.length_squared(),
                rows.z_axis.length_squared(),
            )
        });
        let square = squares.fold(DVec3::ONE, DVec3::max);
        let sigma_voxels = SIGMA_VOXELS
            * DVec3::new(square.x.sqrt(), square.y.sqrt(), square.z.sqrt()).min(DVec3::splat(MOST_EDGE));
        let weights = sigma_voxels.to_array().map(|sigma| {
            let reach = (REACH * sigma + 0.5).floor() as i32;
            let raw: Vec<f64> =
                (-reach..=reach).map(|v| (-0.5 * (f64::from(v) / sigma).powi(2)).exp()).collect();
            let sum: f64 = raw.iter().sum();
            raw.into_iter().map(|weight| weight / sum).collect()
        });
        let shifts_mm = samplings.map(|sampling| sampling.shift_mm);
        Self { masks, groups, edges, shifts_mm, sigma_voxels, weights }
    }

    /// The patches of surface voxels of a mask, in their order.
    pub fn patches(&self, date: usize, surface: &[usize]) -> Vec<Patch> {
        surface.par_iter().map(|linear| self.patch(date, *linear)).collect()
    }

    /// Offset of a voxel's centre from that of the crop's first voxel.
    pub fn center_mm(&self, date: usize, v: [usize; 3]) -> DVec3 {
        self.edges.mm * DVec3::from_array(v.map(|v| v as f64)) + self.shifts_mm[date]
    }

    fn patch(&self, date: usize, linear: usize) -> Patch {
        let v = ijk(self.masks[date].mask.dims(), linear);
        let middle_mm = self.center_mm(date, v);
        let (value, slope) = self.blurred(date, v, linear);
        let normal_mm = -(self.edges.inverse.transpose() * slope);
        let flat = Patch { middle_mm, normal: DVec3::ZERO, area_mm2: 0.0 };
        let Some(normal) = normal_mm.try_normalize() else { return flat };
        let in_voxels = self.edges.mm.transpose() * normal;
        let sigma_mm = (in_voxels * self.sigma_voxels).length();
        if normal_mm.length() * sigma_mm < LEAST_SLOPE {
            return flat;
        }
        // A neighbour outside lies no farther across the surface than this.
        let most_mm = in_voxels.abs().max_element();
        let depth_mm = (sigma_mm * quantile(value)).clamp(0.0, most_mm);
        let area_mm2 = self.free_area_mm2(date, v, linear, normal);
        Patch { middle_mm: middle_mm + normal * depth_mm, normal, area_mm2 }
    }

    /// Area of a surface voxel's faces towards what isn't its component, seen along `normal`.
    fn free_area_mm2(&self, date: usize, v: [usize; 3], linear: usize, normal: DVec3) -> f64 {
        let (mask, dims) = (self.masks[date], self.masks[date].mask.dims());
        let labels = self.groups.labels(date);
        let steps = [1, dims[0], dims[0] * dims[1]];
        let is_own = |at: usize| labels[at] == labels[linear] || mask.encloses(labels[linear], at);
        (0..3)
            .map(|a| {
                let below = v[a] > 0 && is_own(linear - steps[a]);
                let above = v[a] + 1 < dims[a] && is_own(linear + steps[a]);
                let face_mm2 = self.edges.mm.col((a + 1) % 3).cross(self.edges.mm.col((a + 2) % 3));
                face_mm2.dot(normal).abs() * f64::from(2 - u8::from(below) - u8::from(above))
            })
            .sum()
    }

    /// The blurred component of voxel `v`, with its cavities filled: its value at the voxel's centre, and its slope per voxel.
    fn blurred(&self, date: usize, v: [usize; 3], linear: usize) -> (f64, DVec3) {
        let (mask, dims) = (self.masks[date], self.masks[date].mask.dims());
        let labels = self.groups.labels(date);
        let label = labels[linear];
        let reach = self.weights.each_ref().map(|weights| weights.len() / 2);
        let first: [usize; 3] = std::array::from_fn(|a| v[a].saturating_sub(reach[a]));
        let last: [usize; 3] = std::array::from_fn(|a| (v[a] + reach[a]).min(dims[a] - 1));
        let weight = |axis: usize, at: usize| self.weights[axis][at + reach[axis] - v[axis]];
        let (mut value, mut moment) = (0.0, DVec3::ZERO);
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                let (wyz, row) = (weight(1, y) * weight(2, z), (z * dims[1] + y) * dims[0]);
                let (mut sum, mut along) = (0.0, 0.0);
                for x in first[0]..=last[0] {
                    if labels[row + x] == label || mask.encloses(label, row + x) {
                        let wx = weight(0, x);
                        sum += wx;
                        along += wx * (x as f64 - v[0] as f64);
                    }
                }
                value += wyz * sum;
                moment +=
                    wyz * DVec3::new(along, sum * (y as f64 - v[1] as f64), sum * (z as f64 - v[2] as f64));
            }
        }
        (value, moment / (self.sigma_voxels * self.sigma_voxels))
    }
}

/// The inverse of the standard normal distribution Φ, to 5e-4 of its value: Abramowitz and Stegun 1964, 26.2.23. Infinite at 0 and 1.
fn quantile(p: f64) -> f64 {
    let tail = p.min(1.0 - p);
    if tail <= 0.0 {
        return if p < 0.5 { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    let t = (-2.0 * tail.ln()).sqrt();
    let above = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let below = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    let z = t - above / below;
    if p < 0.5 { -z } else { z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Grid, MaskBits, Sides,
        surface::{surface_of, surface_voxels},
    };
    use glam::DAffine3;

    #[test]
    fn the_quantile_is_that_of_tables() {
        // Φ⁻¹ by Abramowitz and Stegun 1964, table 26.5.
        for (p, z) in [(0.5, 0.0), (0.6, 0.253_347), (0.841_345, 1.0), (0.975, 1.959_964), (0.999, 3.090_232)]
        {
            assert!((quantile(p) - z).abs() < 5e-4 && (quantile(1.0 - p) + z).abs() < 5e-4, "{p}");
        }
        assert_eq!([quantile(0.0), quantile(1.0)], [f64::NEG_INFINITY, f64::INFINITY]);
    }

    /// The patches of a mask on `grid`, with their voxels.
    fn patches_of(bits: &MaskBits, grid: &Grid) -> Vec<([usize; 3], Patch)> {
        let groups = Groups::new(bits, bits, grid, 0.0).unwrap();
        let masks = [Enclosing::new(bits, &groups, 0).unwrap(), Enclosing::new(bits, &groups, 1).unwrap()];
        let mm = grid.world_from_voxel().matrix3;
        let places = Places::new(masks.each_ref(), &groups, mm, &[Sampling::native(grid); 2]);
        let mut surface = Vec::new();
        surface_of(bits).for_each(|linear| surface.push(linear));
        surface_voxels(bits).into_iter().zip(places.patches(0, &surface)).collect()
    }

    #[test]
    fn slanted_planes_are_found_within_a_voxel_and_have_their_area() {
        for matrix in [
            DMat3::IDENTITY,
            DMat3::from_diagonal(DVec3::new(0.5, 0.5, 3.0)),
            DMat3::from_cols(DVec3::X, DVec3::new(0.2, 1.0, 0.0), DVec3::new(0.0, -0.3, 2.0)),
            DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.5)),
        ] {
            let dims = [25, 25, 25];
            let affine = DAffine3 { matrix3: matrix, translation: DVec3::ZERO };
            let grid = Grid::new(dims, affine, Sides::Known).unwrap();
            let middle = grid.center_mm();
            for voxel_normal in [DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::ONE, DVec3::new(0.9, -0.4, 0.3)]
            {
                let normal = (matrix.inverse().transpose() * voxel_normal).normalize_or_zero();
                let step_mm = (matrix.transpose() * normal).abs().max_element();
                let (mut sum, mut squares, mut angles, mut count) = (0.0, 0.0, 0.0, 0.0);
                let mut facing_mm2 = DVec3::ZERO;
                for offset in [0.07, 0.28, 0.49, 0.7, 0.91] {
                    let at = middle.dot(normal) + offset * step_mm;
                    let inside = |l| grid.center_of_voxel_mm(ijk(dims, l)).dot(normal) < at;
                    for (v, patch) in patches_of(&MaskBits::from_fn(dims, inside), &grid) {
                        // Away from where the mask ends at the image's border.
                        if v.iter().any(|v| !(5..20).contains(v)) {
                            continue;
                        }
                        let off = (patch.middle_mm.dot(normal) - at) / step_mm;
                        let angle = patch.normal.angle_between(normal).to_degrees();
                        (sum, squares, count) = (sum + off, squares + off * off, count + 1.0);
                        angles += angle * angle;
                        facing_mm2 += patch.normal * patch.area_mm2;
                    }
                }
                let [mean, spread, angle] = [sum / count, (squares / count).sqrt(), (angles / count).sqrt()];
                let faces = facing_mm2.angle_between(normal).to_degrees();
                println!(
                    "{voxel_normal}: mean {mean:.3}, rms {spread:.3} steps, {angle:.1}°; together {faces:.2}°"
                );
                assert!(count > 300.0);
                assert!(mean.abs() < 0.1 && spread < 0.35, "{matrix} {voxel_normal}: {mean} {spread}");
                // A simulation in NumPy has at most 7.6° and 0.63°.
                assert!(angle < 10.0 && faces < 1.5, "{matrix} {voxel_normal}: {angle} {faces}");
            }
        }
    }

    #[test]
    fn a_balls_patches_have_its_area_and_a_single_voxel_has_none() {
        let grid = Grid::axis_aligned([31; 3], DVec3::new(1.0, 1.0, 1.0), DVec3::splat(-15.2)).unwrap();
        let ball = MaskBits::from_fn([31; 3], |l| grid.center_of_voxel_mm(ijk([31; 3], l)).length() <= 11.0);
        let area: f64 = patches_of(&ball, &grid).iter().map(|(_, patch)| patch.area_mm2).sum();
        let sphere = 4.0 * std::f64::consts::PI * 121.0;
        assert!((area / sphere - 1.0).abs() < 0.03, "{area} of {sphere}");
        let mut one = MaskBits::empty([31; 3]);
        one.set([4, 5, 6]);
        let [(_, patch)] = patches_of(&one, &grid).try_into().unwrap();
        assert_eq!((patch.normal, patch.area_mm2), (DVec3::ZERO, 0.0));
        // The nearest point of it lies on its face.
        let edges = Edges::new(DMat3::IDENTITY);
        let p = patch.middle_mm + DVec3::new(4.0, 0.2, 0.0);
        assert_eq!(patch.foot(p, &edges, None), patch.middle_mm + DVec3::new(0.5, 0.2, 0.0));
    }

    /// The nearest point by a covariance, against a search over the plane.
    #[test]
    fn the_foot_is_the_nearest_point_by_any_measure() {
        let normal = DVec3::new(0.6, 0.0, 0.8);
        let patch = Patch { middle_mm: DVec3::new(1.0, 2.0, 3.0), normal, area_mm2: 1.0 };
        let edges = Edges::new(DMat3::from_diagonal(DVec3::splat(40.0)));
        let covariance = DMat3::from_diagonal(DVec3::new(0.2, 0.3, 5.0));
        let p = patch.middle_mm + DVec3::new(1.5, -0.7, 2.0);
        for measure in [None, Some(&covariance)] {
            let foot = patch.foot(p, &edges, measure);
            assert!(normal.dot(foot - patch.middle_mm).abs() < 1e-12);
            let inverse = measure.map_or(DMat3::IDENTITY, DMat3::inverse);
            let far = |q: DVec3| (p - q).dot(inverse * (p - q));
            let (u, v) = normal.any_orthonormal_pair();
            for step in [0.01, -0.01] {
                assert!(far(foot) <= far(foot + u * step) && far(foot) <= far(foot + v * step));
            }
        }
    }
}
