//! The image of the earlier date, and what a later date's would show: known changes painted in, moved once, brighter, with noise.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::{
    plan::{Ball, Known},
    random::Random,
    shape::Shape,
};
use crate::{Grid, Samples, Scaling, Volume, grid::ijk, resample::value_at};

/// Voxels of the working image are averaged from the image's own up to about this size.
pub(super) const WORKING_MM: f64 = 2.0;
/// Quantiles between which the image's range lies.
const RANGE: [f64; 2] = [0.005, 0.998];
/// Where between the range's lower end and the lesion's median tissue begins.
const TISSUE: f64 = 0.3;

/// How a later date's image differs from the earlier one's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    /// Values are multiplied by it.
    pub gain: f64,
    /// Standard deviation of the noise, of the image's range.
    pub noise: f64,
}

/// An image that registration can work on.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// Its voxels, as `f32`.
    pub volume: Volume,
    /// Between its quantiles.
    range: f64,
    low: f64,
    /// Median value in the lesion.
    lesion: f64,
}

impl Picture {
    /// `image` itself, of `f32`. `None` where it has no range.
    pub fn of(image: &Volume, shape: &Shape) -> Option<Self> {
        let values = image.to_f32();
        let volume = Volume::new(image.grid().clone(), Samples::F32(values), Scaling::NONE)?;
        Self::ready(volume, shape)
    }

    /// `image` with whole numbers of voxels averaged, so that edges are about [`WORKING_MM`]. `None` where it has no range.
    pub fn coarse(image: &Volume, shape: &Shape) -> Option<Self> {
        let (grid, dims) = (image.grid(), image.grid().dims());
        let spacing_mm = grid.spacing_mm().to_array();
        let by: [usize; 3] = std::array::from_fn(|a| {
            ((WORKING_MM / spacing_mm[a]).round() as usize).clamp(1, dims[a].div_ceil(8))
        });
        let coarse: [usize; 3] = std::array::from_fn(|a| dims[a] / by[a]);
        let m = grid.world_from_voxel();
        let first = DVec3::from_array(by.map(|n| (n as f64 - 1.0) / 2.0));
        let scale = DVec3::from_array(by.map(|n| n as f64));
        let mut matrix3 = m.matrix3;
        (matrix3.x_axis, matrix3.y_axis, matrix3.z_axis) =
            (m.x_axis * scale.x, m.y_axis * scale.y, m.z_axis * scale.z);
        let affine = DAffine3 { matrix3, translation: m.transform_point3(first) };
        let coarse_grid = Grid::new(coarse, affine, grid.sides()).ok()?;
        let count = by.iter().product::<usize>() as f64;
        let mean = |linear: usize| {
            let v = ijk(coarse, linear);
            let mut sum = 0.0;
            for k in 0..by[2] {
                for j in 0..by[1] {
                    let line = grid.linear([v[0] * by[0], v[1] * by[1] + j, v[2] * by[2] + k]);
                    sum += (line..line + by[0]).map(|at| image.value(at)).sum::<f64>();
                }
            }
            (sum / count) as f32
        };
        let values: Vec<f32> = (0..coarse_grid.voxel_count()).into_par_iter().map(mean).collect();
        let volume = Volume::new(coarse_grid, Samples::F32(values), Scaling::NONE)?;
        Self::ready(volume, shape)
    }

    fn ready(volume: Volume, shape: &Shape) -> Option<Self> {
        let Samples::F32(values) = volume.samples() else { return None };
        let step = (values.len() / 500_000).max(1);
        let mut sorted: Vec<f32> = values.iter().copied().step_by(step).filter(|v| v.is_finite()).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let [low, high] = RANGE.map(|q| f64::from(sorted[(last as f64 * q).round() as usize]));
        let grid = shape.grid();
        let inside = (0..grid.voxel_count()).map(|at| grid.center_of_voxel_mm(ijk(grid.dims(), at)));
        let inside = inside.filter(|place| shape.at(*place) < 0.0);
        let voxel_from_world = volume.grid().voxel_from_world();
        let at = |place: DVec3| value_at(&volume, voxel_from_world.transform_point3(place));
        let mut of_lesion: Vec<f64> = inside.filter_map(at).filter(|v| v.is_finite()).collect();
        of_lesion.sort_unstable_by(f64::total_cmp);
        let lesion = of_lesion.get(of_lesion.len() / 2).copied().unwrap_or(high);
        (high > low).then_some(Self { range: high - low, low, lesion, volume })
    }

    /// Whether a place shows tissue rather than what surrounds the patient.
    pub fn shows_tissue(&self, place_mm: DVec3) -> bool {
        let value = value_at(&self.volume, self.volume.grid().voxel_from_world().transform_point3(place_mm));
        let least = self.low + TISSUE * (self.lesion - self.low).abs().min(0.5 * self.range);
        value.is_some_and(|value| value > least)
    }

    /// With `known` painted in: what a lesion grew over has the values found as deep inside it, what it left those found as far
    /// outside, new lesions its median.
    pub fn painted(&self, shape: &Shape, known: &Known, balls: &[Ball]) -> Self {
        if known.is_none() && balls.is_empty() {
            return self.clone();
        }
        let grid = self.volume.grid();
        let (dims, edge_mm) = (grid.dims(), grid.voxel_volume_mm3().cbrt());
        let voxel_from_world = grid.voxel_from_world();
        let at = |place: DVec3| value_at(&self.volume, voxel_from_world.transform_point3(place));
        let values = (0..grid.voxel_count()).into_par_iter().map(|linear| {
            let old = self.volume.value(linear);
            let place = grid.center_of_voxel_mm(ijk(dims, linear));
            let mut value = old;
            let mm = shape.at(place);
            let by_mm = known.at(place);
            if by_mm != 0.0 && mm.abs() <= by_mm.abs() + edge_mm {
                let grows = by_mm > 0.0;
                // Share of the voxel that changes hands.
                let part = |mm: f64| (0.5 - mm / edge_mm).clamp(0.0, 1.0);
                let share = if grows { part(mm - by_mm) - part(mm) } else { part(mm) - part(mm - by_mm) };
                let mirrored = place - shape.outwards(place) * (2.0 * mm + edge_mm.copysign(mm));
                if let Some(other) = at(mirrored).filter(|v| v.is_finite() && share > 0.0) {
                    value += (other - old) * share;
                }
            }
            for ball in balls {
                let share = (0.5 - ball.distance_mm(place) / edge_mm).clamp(0.0, 1.0);
                value += (self.lesion - value) * share;
            }
            value as f32
        });
        let values = Samples::F32(values.collect());
        let painted = Volume::new(grid.clone(), values, self.volume.scaling());
        Self { volume: painted.unwrap_or_else(|| self.volume.clone()), ..self.clone() }
    }

    /// As the later date's scanner sees it: moved by `later_from_earlier`, on the same voxels.
    pub fn later(&self, later_from_earlier: DAffine3, look: Look, seed: u64) -> Volume {
        let grid = self.volume.grid();
        let [nx, ny, nz] = grid.dims();
        let later_from_voxel = grid.world_from_voxel();
        let voxel_from_later = grid.voxel_from_world() * later_from_earlier.inverse() * later_from_voxel;
        let deviation = look.noise * self.range;
        let slice = |z: usize| -> Vec<f32> {
            let mut random = Random::of(seed, 0x6e6f_6973, z as u64);
            (0..nx * ny)
                .map(|at| {
                    let p = DVec3::new((at % nx) as f64, (at / nx) as f64, z as f64);
                    let noise = random.noise() * deviation;
                    // What comes from beyond the image is unknown, as at a real field's edge.
                    let value = value_at(&self.volume, voxel_from_later.transform_point3(p));
                    value.map_or(f32::NAN, |value| (value * look.gain + noise) as f32)
                })
                .collect()
        };
        let values: Vec<Vec<f32>> = (0..nz).into_par_iter().map(slice).collect();
        let later = Volume::new(grid.clone(), Samples::F32(values.concat()), self.volume.scaling());
        later.unwrap_or_else(|| self.volume.clone())
    }

    /// Where its voxels lie among those of `grid`: whether a place is inside.
    pub fn covers(&self, place_mm: DVec3) -> bool {
        let p = self.volume.grid().voxel_from_world().transform_point3(place_mm);
        let dims = self.volume.grid().dims();
        (0..3).all(|a| p[a] >= 0.0 && p[a] <= dims[a] as f64 - 1.0)
    }
}
