//! Seeds of streamlines besides the saddles: low divergence (level 1), tips of the boundary (level 2).

use glam::DVec3;

use super::{
    field::Lattice,
    filled_mask::{FilledMask, neighbours},
};
use crate::{grid::ijk, surface};

/// Radius, in units, of the ball in which a boundary voxel's curvature is measured.
const CURVATURE_RADIUS: f64 = 3.0;

/// Minimum fraction of that ball outside the mask for a boundary voxel to be a tip: at a flat wall it is half.
const TIP_FRACTION: f64 = 0.68;

/// Lattice points where the direction of the force converges most: local minima (26-neighbourhood) of its divergence,
/// in the lowest fraction `part` of its *range*, as in Cornea's thesis; not the lowest fraction of the points.
pub(super) fn low_divergence(lattice: &Lattice, forces: &[DVec3], part: f64) -> Vec<DVec3> {
    let nodes = &lattice.nodes;
    let dims = nodes.dims();
    let inverse = lattice.unit_from_node.inverse();
    let direction = |n: [usize; 3]| forces[lattice.rank(n)].normalize_or_zero();
    let mut divergence = vec![f64::NAN; forces.len()];
    let mut candidates = Vec::new();
    nodes.for_each(|l| {
        let n = ijk(dims, l);
        let beside = |a: usize, up: bool| {
            let mut m = n;
            m[a] = if up { n[a] + 1 } else { n[a].wrapping_sub(1) };
            (m[a] < dims[a] && nodes.get(m)).then_some(m)
        };
        let mut sum = 0.0;
        for a in 0..3 {
            let (Some(before), Some(after)) = (beside(a, false), beside(a, true)) else { return };
            let d = (direction(after) - direction(before)) * 0.5;
            // Row a of the inverse times column a of the differences: the trace of J·A⁻¹.
            sum += inverse.row(a).dot(d);
        }
        divergence[lattice.rank(n)] = sum;
        candidates.push(n);
    });
    let known = || divergence.iter().copied().filter(|d| !d.is_nan());
    let (lo, hi) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), d| (lo.min(d), hi.max(d)));
    let threshold = lo + part.clamp(0.0, 1.0) * (hi - lo);
    let is_seed = |&n: &[usize; 3]| {
        let mine = divergence[lattice.rank(n)];
        mine <= threshold
            && neighbours(n).all(|m| {
                let inside = (0..3).all(|a| m[a] < dims[a]) && nodes.get(m);
                // Points without a divergence don't count as lower.
                !inside || divergence[lattice.rank(m)].is_nan() || divergence[lattice.rank(m)] >= mine
            })
    };
    candidates
        .into_iter()
        .filter(is_seed)
        .map(|n| lattice.unit(DVec3::new(n[0] as f64, n[1] as f64, n[2] as f64)))
        .collect()
}

/// Boundary voxels at tips: the fraction of a small ball around them outside the mask is large, and largest among their
/// neighbours.
pub(super) fn curved_boundary(filled: &FilledMask) -> Vec<DVec3> {
    let reach = filled.ratio.to_array().map(|r| (CURVATURE_RADIUS / r).ceil() as i64);
    let mut ball = Vec::new();
    for k in -reach[2]..=reach[2] {
        for j in -reach[1]..=reach[1] {
            for i in -reach[0]..=reach[0] {
                if filled.unit(DVec3::new(i as f64, j as f64, k as f64)).length() <= CURVATURE_RADIUS {
                    ball.push([i, j, k]);
                }
            }
        }
    }
    let surface = surface::surface_voxels(&filled.bits);
    let outside: Vec<f64> = surface
        .iter()
        .map(|v| {
            let out =
                ball.iter().filter(|o| !filled.get(std::array::from_fn(|a| v[a] as i64 + o[a]))).count();
            out as f64 / ball.len() as f64
        })
        .collect();
    let by_voxel: std::collections::HashMap<[usize; 3], f64> =
        surface.iter().copied().zip(outside.iter().copied()).collect();
    surface
        .iter()
        .zip(&outside)
        .filter(|&(&v, &part)| {
            part >= TIP_FRACTION && neighbours(v).all(|n| by_voxel.get(&n).is_none_or(|&other| other <= part))
        })
        .map(|(&v, _)| filled.center(v))
        .collect()
}
