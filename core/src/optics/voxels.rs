//! Opaque voxels: rays through them and normals of their smoothed surface, in `f64`. The references of ambient occlusion
//! by rays through masks.

use glam::{DMat3, DVec3};

use super::{
    camera::Ray,
    hemisphere::{Weight, openness},
    random::Random,
};
use crate::grid::Grid;

/// Which voxels of a grid are opaque; around the grid nothing is.
#[derive(Clone, Debug)]
pub struct OpaqueVoxels {
    grid: Grid,
    opaque: Vec<bool>,
    voxel_from_mm: DMat3,
}

impl OpaqueVoxels {
    /// Half the width of the smoothing kernel of [`OpaqueVoxels::normal`], voxels.
    const WIDTH: f64 = 2.5;

    /// `is_opaque` is asked for every linear index.
    pub fn new(grid: Grid, is_opaque: impl Fn(usize) -> bool) -> Self {
        let opaque = (0..grid.voxel_count()).map(is_opaque).collect();
        let voxel_from_mm = grid.world_from_voxel().matrix3.inverse();
        Self { grid, opaque, voxel_from_mm }
    }

    /// Position in voxels; voxel (i, j, k) fills [i, i+1) x [j, j+1) x [k, k+1).
    fn place(&self, at_mm: DVec3) -> DVec3 {
        self.voxel_from_mm * (at_mm - self.grid.world_from_voxel().translation) + DVec3::splat(0.5)
    }

    fn is_opaque(&self, cell: [i64; 3]) -> bool {
        let dims = self.grid.dims();
        let inside: Option<Vec<usize>> =
            (0..3).map(|a| usize::try_from(cell[a]).ok().filter(|c| *c < dims[a])).collect();
        inside.is_some_and(|c| self.opaque.get(self.grid.linear([c[0], c[1], c[2]])) == Some(&true))
    }

    /// Whether a ray meets an opaque voxel before `far_mm`; the voxel that it starts in counts. All boundaries that it
    /// crosses are listed and sorted, and each stretch between two is looked up at its middle.
    pub fn hidden(&self, ray: &Ray, far_mm: f64) -> bool {
        let (o, d) = (self.place(ray.origin_mm), self.voxel_from_mm * ray.direction);
        let mut stops = vec![0.0, far_mm];
        for axis in 0..3 {
            let (from, to) = (o[axis], o[axis] + far_mm * d[axis]);
            let bounds = from.min(to).ceil() as i64..=from.max(to).floor() as i64;
            stops.extend(bounds.map(|b| (b as f64 - o[axis]) / d[axis]).filter(|t| *t > 0.0 && *t < far_mm));
        }
        stops.sort_by(f64::total_cmp);
        stops.windows(2).any(|pair| {
            let middle = o + d * (0.5 * (pair[0] + pair[1]));
            pair[1] > pair[0] && self.is_opaque(middle.floor().as_i64vec3().to_array())
        })
    }

    /// Outward normal at a place near a surface, unit length: down the gradient of [`OpaqueVoxels::share`]. `None` where that
    /// is flat.
    pub fn normal(&self, at_mm: DVec3) -> Option<DVec3> {
        let (_, inwards) = self.smoothed(at_mm);
        (self.voxel_from_mm.transpose() * -inwards).try_normalize().filter(|_| inwards.length() > 1e-9)
    }

    /// The mean of the opaque voxels around a place, weighted by (1 - t²/2.5²)² along each axis, t in voxels, whose standard
    /// deviation is 0.94: 0 to 1.
    pub fn share(&self, at_mm: DVec3) -> f64 {
        self.smoothed(at_mm).0
    }

    /// The weighted mean, and its gradient in voxels but for a factor.
    fn smoothed(&self, at_mm: DVec3) -> (f64, DVec3) {
        let place = self.place(at_mm);
        let middle = place.floor().as_i64vec3().to_array();
        // Weights, and their derivatives but for a factor.
        let weights = |cell: [i64; 3]| {
            let t = (place - DVec3::from_array(cell.map(|c| c as f64 + 0.5))) / Self::WIDTH;
            let inside = (1.0 - t * t).max(DVec3::ZERO);
            (inside * inside, -t * inside)
        };
        let (mut value, mut slope) = (0.0, DVec3::ZERO);
        let (mut whole, mut whole_slope) = (0.0, DVec3::ZERO);
        for (x, y, z) in (-3..=3).flat_map(|z| (-3..=3).flat_map(move |y| (-3..=3).map(move |x| (x, y, z)))) {
            let cell = [middle[0] + x, middle[1] + y, middle[2] + z];
            let (w, d) = weights(cell);
            let gradient = d * DVec3::new(w.y * w.z, w.x * w.z, w.x * w.y);
            (whole, whole_slope) = (whole + w.x * w.y * w.z, whole_slope + gradient);
            if self.is_opaque(cell) {
                (value, slope) = (value + w.x * w.y * w.z, slope + gradient);
            }
        }
        // Of the weighted mean: where all voxels are alike it is flat.
        (value / whole, slope - whole_slope * (value / whole))
    }

    /// Distance of the farthest corner of the grid.
    pub fn farthest_mm(&self, at_mm: DVec3) -> f64 {
        self.grid.corners_mm().iter().map(|c| c.distance(at_mm)).fold(0.0, f64::max)
    }

    /// Whether a place lies in an opaque voxel.
    pub fn is_opaque_at(&self, at_mm: DVec3) -> bool {
        self.is_opaque(self.place(at_mm).floor().as_i64vec3().to_array())
    }

    /// Where rays from a first hit start: above the steps between voxels ([`OpaqueVoxels::step_height_mm`]), which would hide a
    /// part of every slanted plane from itself; half as high where that lies in a voxel, as in a narrow hollow; else at
    /// `nearer_mm`, a little before the hit on the line of sight.
    pub fn ray_start_mm(&self, hit_mm: DVec3, normal: DVec3, nearer_mm: DVec3) -> DVec3 {
        let lift_mm = normal * self.step_height_mm(normal);
        [1.0, 0.5]
            .map(|share| hit_mm + share * lift_mm)
            .into_iter()
            .find(|p| !self.is_opaque_at(*p))
            .unwrap_or(nearer_mm)
    }

    /// Ambient light of a first hit: the share of the hemisphere about its smoothed normal, weighted by the cosine, in which
    /// rays aren't `hidden`; and its standard error. Rays start as [`OpaqueVoxels::ray_start_mm`] says. `None` where no normal
    /// is known.
    pub fn ambient_light(
        &self,
        (hit_mm, nearer_mm): (DVec3, DVec3),
        hidden: &dyn Fn(&Ray) -> bool,
        rays: u32,
        random: &mut Random,
    ) -> Option<(f64, f64)> {
        let normal = self.normal(hit_mm)?;
        let from_mm = self.ray_start_mm(hit_mm, normal, nearer_mm);
        let hidden = |ray: &Ray, _: f64| hidden(ray);
        Some(openness(&hidden, from_mm, normal, f64::INFINITY, Weight::Cosine, rays, random))
    }

    /// How far a point moves along `normal` until it has crossed one voxel along the axis that the normal is closest
    /// to, millimetres: as high as the steps between voxels of a slanted plane.
    pub fn step_height_mm(&self, normal: DVec3) -> f64 {
        1.0 / (self.voxel_from_mm * normal).abs().max_element()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(radius: f64) -> OpaqueVoxels {
        let grid = Grid::axis_aligned([30; 3], DVec3::ONE, DVec3::splat(-14.5)).unwrap();
        let centers = grid.clone();
        OpaqueVoxels::new(grid, |l| centers.center_of_voxel_mm(centers.ijk(l)).length() < radius)
    }

    #[test]
    fn rays_end_at_voxels() {
        let one =
            OpaqueVoxels::new(Grid::axis_aligned([1; 3], DVec3::splat(2.0), DVec3::ZERO).unwrap(), |_| true);
        let along_x = Ray { origin_mm: DVec3::new(-3.0, 0.3, -0.4), direction: DVec3::X };
        assert!(!one.hidden(&along_x, 1.99) && one.hidden(&along_x, 2.01));
        let past = Ray { origin_mm: DVec3::new(-3.0, 1.01, 0.0), ..along_x };
        assert!(!one.hidden(&past, 100.0));
        let diagonal = Ray { origin_mm: DVec3::splat(-2.0), direction: DVec3::ONE / 3f64.sqrt() };
        let far = 3f64.sqrt();
        assert!(!one.hidden(&diagonal, far - 0.01) && one.hidden(&diagonal, far + 0.01));
        assert!(one.hidden(&Ray { origin_mm: DVec3::ZERO, ..diagonal }, 0.1), "it starts inside");
    }

    /// Points on the true ball's surface: normals of its voxels are close to the radius.
    #[test]
    fn normals_of_a_ball_of_voxels_are_near_its_radii() {
        let voxels = ball(11.0);
        let (mut sum, mut worst) = (0.0, 0.0f64);
        for i in 0..500 {
            let z = 1.0 - (f64::from(i) + 0.5) / 250.0;
            let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
            let radial = DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
            let normal = voxels.normal(11.0 * radial).unwrap();
            let off = normal.dot(radial).clamp(-1.0, 1.0).acos().to_degrees();
            (sum, worst) = (sum + off, worst.max(off));
        }
        println!("{:.2} degrees off in the mean, at most {worst:.2}", sum / 500.0);
        assert!(sum / 500.0 < 5.0 && worst < 12.0, "{} {worst}", sum / 500.0);
        assert_eq!(voxels.normal(DVec3::ZERO), None, "deep inside");
    }

    #[test]
    fn the_normal_of_a_plane_is_exact_on_any_grid() {
        let matrix = DMat3::from_cols(
            DVec3::new(0.8, 0.2, 0.0),
            DVec3::new(-0.3, 1.1, 0.1),
            DVec3::new(0.2, 0.1, 5.0),
        );
        let affine = glam::DAffine3 { matrix3: matrix, translation: DVec3::new(30.0, -7.0, 2.0) };
        let grid = Grid::new([12; 3], affine, crate::grid::Sides::Known).unwrap();
        let voxels = OpaqueVoxels::new(grid, |l| l / 144 < 6);
        // The plane between layers 5 and 6 is spanned by the first two axes.
        let at = affine.transform_point3(DVec3::new(5.3, 6.1, 5.5));
        let expected = matrix.col(0).cross(matrix.col(1)).normalize_or_zero();
        assert!((voxels.normal(at).unwrap() - expected).length() < 1e-12);
        let height = voxels.step_height_mm(expected);
        assert!(height > 4.0 && height < 5.3, "{height}");
    }
}
