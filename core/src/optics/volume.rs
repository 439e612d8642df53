//! A sampled volume as a participating medium: values on a grid, a transfer function from values to
//! optical properties, a clipping plane. The GPU receives the same numbers.

use crate::Grid;
use glam::{DMat3, DVec3};

use super::{
    camera::Ray,
    medium::{Medium, Optics, box_interval, thickness_of},
};

/// Extinction per millimetre that represents infinity in single precision.
pub const OPAQUE: f32 = 1e30;
/// A table's extinction counts as infinite from here on.
const COUNTS_AS_OPAQUE: f32 = 1e9;
/// An interpolated extinction counts as infinite from here on: any fraction of an opaque one is opaque.
const OPAQUE_FROM: f64 = 1e20;

/// Interpolation between voxel centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// The value of the voxel that contains the point: for label maps.
    Nearest,
    /// Trilinear, before the table (post-classification): for intensities.
    Linear,
}

/// A transfer function: colour and extinction at evenly spaced values, linear between them, constant beyond.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    least: f32,
    greatest: f32,
    entries: Vec<[f32; 4]>,
}

impl Table {
    /// `entries` are linear red, green, blue and extinction per millimetre (infinity is opaque) at
    /// values from `least` to `greatest`. `None` unless there are at least two, `least < greatest`, colours
    /// are finite and non-negative, and extinctions are non-negative.
    pub fn new(least: f32, greatest: f32, entries: &[[f32; 4]]) -> Option<Self> {
        let valid = |e: &[f32; 4]| e[..3].iter().all(|c| c.is_finite() && *c >= 0.0) && e[3] >= 0.0;
        if entries.len() < 2
            || !(least < greatest && (greatest - least).is_finite())
            || !entries.iter().all(valid)
        {
            return None;
        }
        let opaque = |e: &[f32; 4]| if e[3] >= COUNTS_AS_OPAQUE { [e[0], e[1], e[2], OPAQUE] } else { *e };
        Some(Self { least, greatest, entries: entries.iter().map(opaque).collect() })
    }

    /// One entry per label, from label 0.
    pub fn of_labels(entries: &[[f32; 4]]) -> Option<Self> {
        Self::new(0.0, entries.len().saturating_sub(1) as f32, entries)
    }

    /// Maps a value to its position among the entries: `value * scale + offset`.
    fn scale_offset(&self) -> [f32; 2] {
        let scale = (self.entries.len() - 1) as f32 / (self.greatest - self.least);
        [scale, -self.least * scale]
    }

    fn at(&self, value: f64) -> Optics {
        let [scale, offset] = self.scale_offset().map(f64::from);
        let last = (self.entries.len() - 1) as f64;
        let x = (value * scale + offset).clamp(0.0, last);
        let low = x.floor().min(last - 1.0);
        let (a, b) = (self.entries[low as usize], self.entries[low as usize + 1]);
        let mix = |i: usize| f64::from(a[i]) + (f64::from(b[i]) - f64::from(a[i])) * (x - low);
        let extinction = mix(3);
        Optics {
            extinction_per_mm: if extinction >= OPAQUE_FROM { f64::INFINITY } else { extinction },
            color: DVec3::new(mix(0), mix(1), mix(2)),
        }
    }
}

/// A clipping plane: points with `normal · point ≤ offset_mm` are kept, world millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, towards the clipped side.
    pub normal: DVec3,
    /// Distance from the origin along the normal.
    pub offset_mm: f64,
}

/// A sampled medium; empty outside the box of its voxels.
#[derive(Clone, Debug)]
pub struct OpticalVolume {
    grid: Grid,
    values: Vec<f32>,
    table: Table,
    filter: Filter,
    plane: Option<Plane>,
    non_finite: usize,
    voxel_from_mm: DMat3,
    /// The plane in index space: normal and offset.
    index_plane: Option<(DVec3, f64)>,
}

impl OpticalVolume {
    /// `values` has one value per voxel, x fastest; non-finite ones become the least of the table and are
    /// counted. `None` if their number isn't that of the voxels, or if the plane isn't finite.
    pub fn new(
        grid: Grid,
        mut values: Vec<f32>,
        table: Table,
        filter: Filter,
        plane: Option<Plane>,
    ) -> Option<Self> {
        if values.len() != grid.voxel_count() {
            return None;
        }
        if plane.is_some_and(|p| !(p.normal.is_finite() && p.offset_mm.is_finite())) {
            return None;
        }
        let mut non_finite = 0;
        for value in &mut values {
            if !value.is_finite() {
                *value = table.least;
                non_finite += 1;
            }
        }
        let world_from_voxel = grid.world_from_voxel();
        let index_plane = plane.map(|p| {
            let normal = world_from_voxel.matrix3.transpose() * p.normal;
            let offset = p.offset_mm - p.normal.dot(world_from_voxel.translation);
            (normal, offset + 0.5 * (normal.x + normal.y + normal.z))
        });
        let voxel_from_mm = world_from_voxel.matrix3.inverse();
        Some(Self { grid, values, table, filter, plane, non_finite, voxel_from_mm, index_plane })
    }

    /// Its grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Number of voxels whose value wasn't finite.
    pub fn unknown_voxels(&self) -> usize {
        self.non_finite
    }

    /// The clipping plane.
    pub fn plane(&self) -> Option<Plane> {
        self.plane
    }

    /// The interpolation between voxel centres.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// Index-space position (voxel (i, j, k) fills `[i, i+1)` and so on) of a world point.
    fn index_of(&self, at_mm: DVec3) -> DVec3 {
        self.voxel_from_mm * (at_mm - self.grid.world_from_voxel().translation) + 0.5
    }

    fn size(&self) -> DVec3 {
        let [x, y, z] = self.grid.dims().map(|d| d as f64);
        DVec3::new(x, y, z)
    }

    fn value_of(&self, cell: [usize; 3]) -> f64 {
        self.values.get(self.grid.linear(cell)).copied().map_or(0.0, f64::from)
    }

    /// Optics of a voxel's own value.
    fn optics_of_voxel(&self, cell: [usize; 3]) -> Optics {
        self.table.at(self.value_of(cell))
    }

    /// Optics at an index-space position.
    fn optics_at_index(&self, p: DVec3) -> Optics {
        let size = self.size();
        let inside = p.cmpge(DVec3::ZERO).all() && p.cmple(size).all();
        let kept = self.index_plane.is_none_or(|(normal, offset)| normal.dot(p) <= offset);
        if !(inside && kept) {
            return Optics::default();
        }
        let dims = self.grid.dims();
        if self.filter == Filter::Nearest {
            return self.optics_of_voxel(std::array::from_fn(|a| (p[a] as usize).min(dims[a] - 1)));
        }
        let at = (p - 0.5).clamp(DVec3::ZERO, size - 1.0);
        let low: [usize; 3] = std::array::from_fn(|a| (at[a] as usize).min(dims[a].saturating_sub(2)));
        let f: [f64; 3] = std::array::from_fn(|a| at[a] - low[a] as f64);
        let line = |y: usize, z: usize| {
            let cell = |x: usize| {
                self.value_of([
                    (low[0] + x).min(dims[0] - 1),
                    (low[1] + y).min(dims[1] - 1),
                    (low[2] + z).min(dims[2] - 1),
                ])
            };
            cell(0) + (cell(1) - cell(0)) * f[0]
        };
        let sheet = |z: usize| line(0, z) + (line(1, z) - line(0, z)) * f[1];
        self.table.at(sheet(0) + (sheet(1) - sheet(0)) * f[2])
    }

    /// The ray in index space, and its interval (millimetres) inside the box and on the kept side of the plane.
    fn index_ray(&self, ray: &Ray) -> Option<(DVec3, DVec3, f64, f64)> {
        let o = self.index_of(ray.origin_mm);
        let d = self.voxel_from_mm * ray.direction;
        let (mut near, mut far) = box_interval(o, d, self.size())?;
        near = near.max(0.0);
        if let Some((normal, offset)) = self.index_plane {
            let (at, along) = (normal.dot(o) - offset, normal.dot(d));
            if along.abs() < 1e-12 {
                if at > 0.0 {
                    return None;
                }
            } else if along > 0.0 {
                far = far.min(-at / along);
            } else {
                near = near.max(-at / along);
            }
        }
        (far > near).then_some((o, d, near, far))
    }

    /// Visits the segments of constant (nearest) or nearly constant (linear, a quarter voxel) optics along
    /// a ray, in order: from (mm), to (mm), extinction. Stops when `visit` returns `false`.
    fn visit_segments(&self, ray: &Ray, visit: impl FnMut(f64, f64, f64) -> bool) {
        self.walk(ray, 0.25 * self.grid.spacing_mm().min_element(), visit);
    }

    fn walk(&self, ray: &Ray, max_step_mm: f64, mut visit: impl FnMut(f64, f64, f64) -> bool) {
        let Some((o, d, near, far)) = self.index_ray(ray) else { return };
        if self.filter == Filter::Linear {
            let steps = ((far - near) / max_step_mm).ceil().clamp(1.0, 1e6);
            let step = (far - near) / steps;
            for i in 0..steps as u64 {
                let from = near + i as f64 * step;
                let optics = self.optics_at_index(o + d * (from + 0.5 * step));
                if !visit(from, from + step, optics.extinction_per_mm) {
                    return;
                }
            }
            return;
        }
        let dims = self.grid.dims();
        let start = o + d * near;
        let mut cell: [i64; 3] =
            std::array::from_fn(|a| (start[a].floor() as i64).clamp(0, dims[a] as i64 - 1));
        let mut from = near;
        loop {
            // Boundaries in closed form, so that rounding errors don't accumulate.
            let ends: [f64; 3] = std::array::from_fn(|a| {
                if d[a].abs() < 1e-12 {
                    f64::INFINITY
                } else {
                    ((cell[a] + i64::from(d[a] > 0.0)) as f64 - o[a]) / d[a]
                }
            });
            let axis = (0..3).fold(0, |best, a| if ends[a] < ends[best] { a } else { best });
            let to = ends[axis].min(far);
            if to > from {
                let optics = self.optics_of_voxel(cell.map(|c| c as usize));
                if !visit(from, to, optics.extinction_per_mm) {
                    return;
                }
                from = to;
            }
            cell[axis] += if d[axis] > 0.0 { 1 } else { -1 };
            if ends[axis] >= far || cell[axis] < 0 || cell[axis] >= dims[axis] as i64 {
                return;
            }
        }
    }
}

impl Medium for OpticalVolume {
    fn corners_mm(&self) -> [DVec3; 8] {
        self.grid.corners_mm()
    }

    fn optics(&self, at_mm: DVec3) -> Optics {
        self.optics_at_index(self.index_of(at_mm))
    }

    fn thickness(&self, ray: &Ray, length_mm: f64) -> f64 {
        let mut sum = 0.0;
        self.visit_segments(ray, |from, to, extinction| {
            sum += thickness_of(extinction, to.min(length_mm) - from);
            // Past 100 the transmittance is negligible, even in double precision.
            to < length_mm && sum < 100.0
        });
        sum
    }

    fn reach_mm(&self, ray: &Ray, thickness: f64) -> Option<f64> {
        let mut left = thickness;
        let mut out = None;
        self.visit_segments(ray, |from, to, extinction| {
            let here = thickness_of(extinction, to - from);
            if here > 0.0 && here >= left {
                out = Some(from + left / extinction);
                return false;
            }
            left -= here;
            true
        });
        out
    }
}
