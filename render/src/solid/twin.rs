//! The closeup's ray casting on the CPU in `f64`, by a method independent of the shaders': all boundaries
//! that a ray crosses are listed and sorted, and each segment between two of them is looked up at its
//! middle. No stepping, no bricks, no reference plane.

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use crate::scene::RegionScene;

/// Rays that pass this close to a cell edge (voxels) may be on either side of it in `f32`.
pub const DELICATE_VOXELS: f64 = 1e-4;

/// A first hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Number of the region.
    pub number: u32,
    /// View depth: millimetres from the eye plane along the view axis.
    pub depth_mm: f64,
}

/// The hits of one pixel's ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// First voxel of a shown region, in the lens or anywhere when it is off.
    pub inner: Option<Hit>,
    /// First voxel of any region outside the lens; only in front of it where `inner` is hit.
    pub outer: Option<Hit>,
    /// Whether the ray passes within [`DELICATE_VOXELS`] of a cell's edge before its hit, meets the lens that
    /// close to a cell's face, or grazes the lens.
    pub delicate: bool,
    /// Voxels that the ray advances per millimetre of view depth.
    pub voxels_per_mm: f64,
}

/// All pixels of a frame of `size`, row after row from the top.
pub fn cast(scene: &RegionScene, size: [u32; 2]) -> Vec<Pixel> {
    let pixels: Vec<[u32; 2]> = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y])).collect();
    pixels.into_par_iter().map(|pixel| cast_one(scene, size, pixel)).collect()
}

fn cast_one(scene: &RegionScene, size: [u32; 2], pixel: [u32; 2]) -> Pixel {
    let Some(tumor) = &scene.tumor else { return Pixel::default() };
    let grid = tumor.grid();
    let dims = grid.dims();
    let center = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let ray = scene.camera.ray(center, DVec2::new(f64::from(size[0]), f64::from(size[1])));
    let depth_per_mm = ray.direction.dot(-scene.camera.axes()[2]);
    let voxel_from_mm: DMat3 = grid.world_from_voxel().matrix3.inverse();
    let o = voxel_from_mm * (ray.origin_mm - grid.world_from_voxel().translation) + DVec3::splat(0.5);
    // A direction component this small counts as 0, as in the shaders.
    let d = voxel_from_mm * ray.direction;
    let d = DVec3::select(d.abs().cmplt(DVec3::splat(1e-12)), DVec3::ZERO, d);
    let mut out = Pixel { voxels_per_mm: d.length() / depth_per_mm, ..Pixel::default() };

    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let size = dims[axis] as f64;
        if d[axis] == 0.0 {
            if !(o[axis] >= 0.0 && o[axis] < size) {
                return out;
            }
        } else {
            let (a, b) = ((0.0 - o[axis]) / d[axis], (size - o[axis]) / d[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    if near >= far {
        // Past an edge of the box, perhaps by less than f32 resolves.
        out.delicate = near_edge(o, d, near) || near_edge(o, d, far);
        return out;
    }
    let mut events = vec![near, far];
    for axis in 0..3 {
        if d[axis] == 0.0 {
            continue;
        }
        let (from, to) = (o[axis] + near * d[axis], o[axis] + far * d[axis]);
        let (lo, hi) = (from.min(to), from.max(to));
        let first = (lo.floor() as i64 - 1).max(0);
        for k in first..=(hi.ceil() as i64 + 1).min(dims[axis] as i64) {
            let t = (k as f64 - o[axis]) / d[axis];
            if t > near && t < far {
                events.push(t);
            }
        }
    }
    if let Some(lens) = &scene.lens {
        let to = lens.center_mm - ray.origin_mm;
        let along = to.dot(ray.direction);
        let off = (to - ray.direction * along).length();
        let half2 = (lens.radius_mm - off) * (lens.radius_mm + off);
        // Near the rim an error across the ray changes the depth on the lens without bound.
        out.delicate |= half2.abs() < (0.02 * lens.radius_mm).powi(2);
        if half2 > 0.0 {
            events.extend(
                [along - half2.sqrt(), along + half2.sqrt()].iter().filter(|t| **t > near && **t < far),
            );
        }
    }
    events.sort_by(f64::total_cmp);
    let shown: Vec<bool> = tumor.bits_of_id().iter().map(|&bits| scene.selection.shows(bits)).collect();
    for pair in events.windows(2) {
        let (start, end) = (pair[0], pair[1]);
        if end == start {
            continue;
        }
        out.delicate |= near_edge(o, d, start);
        let middle = 0.5 * (start + end);
        let at = o + d * middle;
        let cell: [usize; 3] = std::array::from_fn(|a| (at[a].floor().max(0.0) as usize).min(dims[a] - 1));
        let number = tumor.id(grid.linear(cell));
        let hit = Hit { number, depth_mm: start * depth_per_mm };
        let in_lens = scene
            .lens
            .is_none_or(|l| (ray.origin_mm + ray.direction * middle).distance(l.center_mm) < l.radius_mm);
        if in_lens && out.inner.is_none() && shown[number as usize] {
            out.inner = Some(hit);
            // Everything behind it is hidden.
            return out;
        }
        if !in_lens && number != 0 && out.outer.is_none() {
            out.outer = Some(hit);
        }
    }
    out
}

/// Whether the point at `t`, on a cell's face or on the lens, is so close to another face that the
/// ray passes within [`DELICATE_VOXELS`] of their common edge.
fn near_edge(o: DVec3, d: DVec3, t: f64) -> bool {
    let at = o + d * t;
    let off: [f64; 3] = std::array::from_fn(|a| (at[a] - at[a].round()).abs());
    let faces: Vec<usize> = (0..3).filter(|&a| off[a] < 1e-9).collect();
    if faces.is_empty() {
        return off.iter().any(|&x| x < DELICATE_VOXELS);
    }
    faces.iter().any(|&a| {
        (0..3).filter(|&b| b != a).any(|b| {
            let across = d[a].hypot(d[b]);
            across > 0.0 && off[b] * d[a].abs() / across < DELICATE_VOXELS
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use glioscope_core::Grid;
    use glioscope_core::optics::{Camera, Projection};

    /// Closed form: a cube of 3 mm around the origin, in orthographic front view.
    #[test]
    fn a_cube_s_front_face_has_its_exact_position() {
        let grid = Grid::axis_aligned([3, 3, 3], DVec3::ONE, DVec3::splat(-1.0)).unwrap();
        let mut scene = testing::scene_of(testing::volume(&grid, 1, |_, _| true).unwrap(), 1, None);
        scene.camera = Camera::fit(DVec3::ZERO, 4.0, Camera::orientation(0.0, 0.0), Projection::Orthographic);
        let pixels = cast(&scene, [32, 32]);
        let mm_per_pixel = scene.camera.height_mm / 32.0;
        for (i, p) in pixels.iter().enumerate() {
            let x = ((i % 32) as f64 + 0.5 - 16.0) * mm_per_pixel;
            let y = ((i / 32) as f64 + 0.5 - 16.0) * mm_per_pixel;
            let inside = x.abs() < 1.5 && y.abs() < 1.5;
            assert_eq!(p.inner.is_some(), inside);
            if let Some(hit) = p.inner {
                assert!((hit.depth_mm - (scene.camera.distance_mm() - 1.5)).abs() < 1e-12);
            }
        }
    }
}
