//! Lookup and filter on the CPU in `f64`, by another method than the shaders': voxels from the twin's
//! rays and a map of the vectors, filters from every pair of pixels of a line.

use std::collections::BTreeMap;

use glam::DVec2;
use glioscope_core::optics::Projection;

use crate::{
    solid::{
        twin,
        view::{FAR, reference_to},
    },
    views::change::{ChangeScene, surface, uniforms::gap_mm},
};

/// Length and confidence at each pixel; `None` where the ray is delicate, `Some(None)` where there is no
/// height.
pub(super) fn heights(scene: &ChangeScene, size: [u32; 2]) -> Vec<Option<Option<(f64, f64)>>> {
    let surface = scene.surface.as_ref().unwrap();
    let grid = surface.volume().grid();
    let known: BTreeMap<[usize; 3], (f64, bool, bool)> = surface
        .change()
        .vectors
        .iter()
        .enumerate()
        .map(|(n, v)| (v.voxel, (v.signed_mm, v.flags.within_uncertainty, surface.is_displaced(n))))
        .collect();
    let pixels = twin::cast(&scene.context_scene().tumor_scene(), size);
    let camera = &scene.camera;
    (0u32..)
        .zip(&pixels)
        .map(|(i, pixel)| {
            if pixel.delicate {
                return None;
            }
            let Some(hit) = pixel.inner else { return Some(None) };
            let at = DVec2::new(f64::from(i % size[0]) + 0.5, f64::from(i / size[0]) + 0.5);
            let ray = camera.ray(at, DVec2::new(f64::from(size[0]), f64::from(size[1])));
            let depth_per_mm = ray.direction.dot(-camera.axes()[2]);
            // Slightly behind the face.
            let inside = hit.depth_mm + 2.0 * twin::DELICATE_VOXELS / pixel.voxels_per_mm / 10.0;
            let place = ray.origin_mm + ray.direction * (inside / depth_per_mm);
            let local = grid.voxel_at(place)?;
            if surface.volume().id(grid.linear(local)) != hit.number {
                return None;
            }
            let bits = surface.volume().bits_of_id()[hit.number as usize];
            if bits & surface::ALONE != 0 {
                return Some(None);
            }
            let known = known.get(&surface.voxel(grid.linear(local)));
            Some(Some(known.map_or((0.0, 1.0), |&(mm, faint, displaced)| {
                let mark = if displaced { f64::from(surface::DISPLACED) } else { 0.0 };
                (mm, mark + if faint { f64::from(surface::FAINT) } else { 1.0 })
            })))
        })
        .collect()
}

/// Both directions of the filter over `heights`, whose second number is below 0 where there is none.
pub(super) fn filtered(
    scene: &ChangeScene,
    size: [u32; 2],
    depths: &[f32],
    heights: &[[f32; 2]],
) -> Vec<[f64; 2]> {
    let surface = scene.surface.as_ref().unwrap();
    let reference_mm = reference_to(&scene.camera, surface.volume().grid().center_mm());
    let gap = gap_mm(surface);
    let footprint = |depth: f64| {
        let at_focus = scene.camera.height_mm / f64::from(size[1]);
        match scene.camera.projection {
            Projection::Orthographic => at_focus,
            Projection::Perspective => at_focus * (reference_mm + depth) / scene.camera.distance_mm(),
        }
    };
    let depth = |i: usize| f64::from(depths[i]);
    let mark = |sure: f64| if sure > 2.0 { f64::from(surface::DISPLACED) } else { 0.0 };
    let line = |from: Vec<[f64; 2]>, places: Vec<usize>| -> Vec<(usize, [f64; 2])> {
        places
            .iter()
            .enumerate()
            .map(|(n, &i)| {
                let sigma = scene.look.smooth_mm / footprint(depth(i));
                let reach = (3.0 * sigma).ceil().min(96.0);
                let (mut sum, mut weight) = ([0.0; 2], 0.0);
                for (m, &j) in places.iter().enumerate() {
                    let off = m.abs_diff(n) as f64;
                    let between = &places[n.min(m)..=n.max(m)];
                    let whole = between.iter().all(|&k| from[k][1] >= 0.0 && depths[k] < FAR);
                    let flat = between.windows(2).all(|w| (depth(w[0]) - depth(w[1])).abs() <= gap);
                    if off <= reach && whole && flat {
                        let w = (-0.5 * (off / sigma).powi(2)).exp();
                        sum = [sum[0] + w * from[j][0], sum[1] + w * (from[j][1] - mark(from[j][1]))];
                        weight += w;
                    }
                }
                let filtered = [sum[0] / weight, sum[1] / weight + mark(from[i][1])];
                (i, if from[i][1] < 0.0 { from[i] } else { filtered })
            })
            .collect()
    };
    let [width, height] = size.map(|s| s as usize);
    let mut out: Vec<[f64; 2]> = heights.iter().map(|h| h.map(f64::from)).collect();
    for rows in [true, false] {
        let before = out.clone();
        for l in 0..if rows { height } else { width } {
            let places = if rows {
                (0..width).map(|x| l * width + x).collect()
            } else {
                (0..height).map(|y| y * width + l).collect()
            };
            for (i, value) in line(before.clone(), places) {
                out[i] = value;
            }
        }
    }
    out
}
