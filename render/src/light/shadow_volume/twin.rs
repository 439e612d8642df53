//! Shadow volume propagation on the CPU in `f64`: in world space, with the transfer function itself, without bricks, with voxels
//! found by sorting instead of stepping.

use glam::DVec3;
use glioscope_core::{Grid, optics::Ray};
use rayon::prelude::*;

use super::plan::Sweep;
use crate::light::{cones::grid::Cells, half_angle::twin::LampTwin};

/// Light of each cell by a sweep: past the image, and past image and masks.
pub(super) fn cells_of(twin: &LampTwin<'_>, grid: &Grid, cells: &Cells, sweep: &Sweep) -> Vec<[f64; 2]> {
    let light = twin.turned(twin.light);
    let middle = |n: usize| grid.world_from_voxel().transform_point3(cells.middle(n));
    let number = |p: [usize; 3]| (p[2] * cells.dims[1] + p[1]) * cells.dims[0] + p[0];
    let place = |n: usize| {
        [n % cells.dims[0], n / cells.dims[0] % cells.dims[1], n / (cells.dims[0] * cells.dims[1])]
    };
    let mut carried = vec![f64::NAN; cells.count()];
    for slice in sweep.slices(cells) {
        let in_slice: Vec<usize> = (0..cells.count()).filter(|n| place(*n)[sweep.axis] == slice).collect();
        let found: Vec<f64> = in_slice
            .par_iter()
            .map(|&n| {
                let own = place(n);
                let p: [usize; 3] = std::array::from_fn(|a| {
                    let low = if sweep.shift[a] < -1e-3 { 0 } else { cells.ring };
                    let high = cells.dims[a] - 1 - if sweep.shift[a] > 1e-3 { 0 } else { cells.ring };
                    own[a].clamp(low, high)
                });
                // Trilinear between cells; weight 0 along the axis, as the shift is whole there.
                let from = DVec3::from_array(p.map(|c| c as f64)) + sweep.shift;
                let (low, f) = (from.floor(), from - from.floor());
                let mut arrives = 0.0;
                for corner in 0..8usize {
                    let up = [corner & 1, corner >> 1 & 1, corner >> 2];
                    let weight: f64 = (0..3).map(|a| if up[a] == 1 { f[a] } else { 1.0 - f[a] }).product();
                    let at: [f64; 3] = std::array::from_fn(|a| low[a] + up[a] as f64);
                    let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] < cells.dims[a] as f64);
                    if weight > 0.0 {
                        arrives +=
                            weight * if inside { carried[number(at.map(|c| c as usize))] } else { 1.0 };
                    }
                }
                let c = middle(number(p));
                let (near, far) = twin.span(&Ray { origin_mm: c, direction: -light });
                let (near, far) = (near.max(0.0), far.min(sweep.segment_mm));
                let samples = sweep.samples(grid);
                let each = (far - near).max(0.0) / f64::from(samples);
                let thickness: f64 = (0..samples)
                    .map(|i| twin.extinction(c - (near + (f64::from(i) + 0.5) * each) * light) * each)
                    .sum();
                arrives * (-thickness).exp()
            })
            .collect();
        for (n, value) in in_slice.into_iter().zip(found) {
            carried[n] = value;
        }
    }
    (0..cells.count())
        .into_par_iter()
        .map(|n| {
            let c = middle(n);
            let hidden = twin.voxels.as_ref().is_some_and(|voxels| {
                let to_eye =
                    if twin.light.z > 0.0 { twin.sight.depth_mm(c) / twin.light.z } else { f64::INFINITY };
                voxels.hidden(&Ray { origin_mm: c, direction: -light }, to_eye.clamp(0.0, 120.0))
            });
            [carried[n], if hidden { 0.0 } else { carried[n] }]
        })
        .collect()
}
