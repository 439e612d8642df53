//! The repulsive force of the boundary: charges on its faces, summed with a Barnes–Hut tree.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::filled_mask::FilledMask;

/// Maximum number of charges in a leaf.
const LEAF: usize = 8;

/// Maximum number of charges along one edge of a face.
const MAX_SPLIT: f64 = 12.0;

/// A boundary charge, or a distant cluster of charges merged into one.
#[derive(Clone, Copy, Debug)]
pub struct Charge {
    /// Position, in units of the finest voxel spacing.
    pub at: DVec3,
    /// The boundary area that it represents, in square units.
    pub weight: f64,
}

#[derive(Clone, Debug)]
struct Node {
    /// Weighted mean of its charges, about which their first moment vanishes.
    center: DVec3,
    weight: f64,
    /// Largest distance of a charge from `center`.
    radius: f64,
    start: u32,
    end: u32,
    /// The right child; the left one follows its parent. 0 in a leaf.
    right: u32,
}

/// The boundary's charges in a k-d tree.
///
/// A node of radius ρ is summed as one charge where ρ ≤ θ·D, D its distance from the nearest requested point (Barnes
/// and Hut 1986). The error is of second order: at most `(m+1)(m+2)/2·θ²/(1−θ)^(m+3)` of the node's own force, far
/// less on average; see the measurements in `docs/change.md`. θ = 0 gives the exact sum.
pub(super) struct Charges {
    nodes: Vec<Node>,
    charges: Vec<Charge>,
}

/// Force and potential at one point.
#[derive(Clone, Copy, Debug)]
pub(super) struct ForceSample {
    /// Σ w·(x−b)/‖x−b‖^(m+1).
    pub force: DVec3,
    /// Σ w·‖x−b‖^(1−m)/(m−1); the force is its negative gradient.
    pub potential: f64,
    /// Distance to the nearest charge.
    pub nearest_distance: f64,
}

/// Charges and merged clusters that act on a small neighbourhood.
pub(super) type ChargeList = Vec<Charge>;

/// Charges at the centres of the boundary's voxel faces, weighted by area. Faces longer than the finest spacing are
/// subdivided, so that the charges' spacing is about equal in all directions.
pub(super) fn boundary_charges(filled: &FilledMask) -> Vec<Charge> {
    let columns =
        [filled.unit_from_voxel.x_axis, filled.unit_from_voxel.y_axis, filled.unit_from_voxel.z_axis];
    let subdivisions = filled.ratio.to_array().map(|r| r.round().clamp(1.0, MAX_SPLIT) as usize);
    let [_, ny, nz] = filled.bits.dims();
    let lines: Vec<Vec<Charge>> = (0..ny * nz)
        .into_par_iter()
        .map(|line| {
            let mut charges = Vec::new();
            for_each_set(filled, line, |x| {
                let voxel = [x, line % ny, line / ny];
                let center = filled.center(voxel);
                for axis in 0..3 {
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    for up in [false, true] {
                        let mut beside = voxel;
                        beside[axis] = if up { voxel[axis] + 1 } else { voxel[axis] - 1 };
                        if filled.bits.get(beside) {
                            continue;
                        }
                        let middle = center + columns[axis] * if up { 0.5 } else { -0.5 };
                        let parts = (subdivisions[u] * subdivisions[v]) as f64;
                        let weight = columns[u].cross(columns[v]).length() / parts;
                        for part in 0..subdivisions[u] * subdivisions[v] {
                            let along =
                                |n: usize, subdivisions: usize| (n as f64 + 0.5) / subdivisions as f64 - 0.5;
                            let at = middle
                                + columns[u] * along(part % subdivisions[u], subdivisions[u])
                                + columns[v] * along(part / subdivisions[u], subdivisions[v]);
                            charges.push(Charge { at, weight });
                        }
                    }
                }
            });
            charges
        })
        .collect();
    lines.concat()
}

fn for_each_set(filled: &FilledMask, line: usize, mut visit: impl FnMut(usize)) {
    let per_line = filled.bits.words_per_line();
    for (w, &word) in filled.bits.words()[line * per_line..][..per_line].iter().enumerate() {
        let mut rest = word;
        while rest != 0 {
            visit(w * 64 + rest.trailing_zeros() as usize);
            rest &= rest - 1;
        }
    }
}

impl Charges {
    /// A tree over at least one charge.
    pub fn new(mut charges: Vec<Charge>) -> Self {
        let mut nodes = Vec::with_capacity(charges.len() / 2);
        split(&mut charges, 0, &mut nodes);
        Self { nodes, charges }
    }

    /// Number of charges.
    pub fn len(&self) -> usize {
        self.charges.len()
    }

    /// All charges; neighbours in the list are close to each other.
    pub fn all(&self) -> &[Charge] {
        &self.charges
    }

    /// Collects the charges and merged clusters that act on points within `reach` of `center`, with opening angle
    /// `opening`.
    pub fn gather(&self, center: DVec3, reach: f64, opening: f64, list: &mut ChargeList) {
        list.clear();
        let mut pending = vec![0];
        while let Some(n) = pending.pop() {
            let node = &self.nodes[n as usize];
            let distance = node.center.distance(center) - reach;
            if node.radius <= opening * distance {
                list.push(Charge { at: node.center, weight: node.weight });
            } else if node.right == 0 {
                list.extend_from_slice(&self.charges[node.start as usize..node.end as usize]);
            } else {
                pending.extend([node.right, n + 1]);
            }
        }
    }
}

fn split(charges: &mut [Charge], start: usize, nodes: &mut Vec<Node>) {
    let weight: f64 = charges.iter().map(|c| c.weight).sum();
    let center = charges.iter().map(|c| c.at * c.weight).sum::<DVec3>() / weight;
    let radius = charges.iter().map(|c| c.at.distance_squared(center)).fold(0.0, f64::max).sqrt();
    let node_index = nodes.len();
    let end = start + charges.len();
    nodes.push(Node { center, weight, radius, start: start as u32, end: end as u32, right: 0 });
    if charges.len() <= LEAF {
        return;
    }
    let (lo, hi) = charges
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), c| (lo.min(c.at), hi.max(c.at)));
    let size = hi - lo;
    let axis = (1..3).fold(0, |widest, a| if size[a] > size[widest] { a } else { widest });
    let middle = charges.len() / 2;
    charges.select_nth_unstable_by(middle, |a, b| {
        let by = |axis: usize| a.at[axis].total_cmp(&b.at[axis]);
        by(axis).then(by((axis + 1) % 3)).then(by((axis + 2) % 3))
    });
    let (left, right) = charges.split_at_mut(middle);
    split(left, start, nodes);
    nodes[node_index].right = nodes.len() as u32;
    split(right, start + middle, nodes);
}

/// `r^-(m+1)` from `r²`.
#[inline(always)]
fn power<const M: u32>(inverse: f64) -> f64 {
    let half = inverse.powi(M.div_ceil(2) as i32);
    // m + 1 odd: one factor of r^-1 is left.
    if M % 2 == 1 { half } else { half * inverse.sqrt() }
}

fn sample_with<const M: u32>(list: &[Charge], at: DVec3) -> ForceSample {
    let (mut force, mut potential, mut nearest_squared) = (DVec3::ZERO, 0.0, f64::INFINITY);
    for charge in list {
        let d = at - charge.at;
        let r2 = d.length_squared();
        let g = charge.weight * power::<M>(1.0 / r2);
        force += d * g;
        potential += g * r2;
        nearest_squared = nearest_squared.min(r2);
    }
    ForceSample { force, potential: potential / f64::from(M - 1), nearest_distance: nearest_squared.sqrt() }
}

fn jacobian_with<const M: u32>(list: &[Charge], at: DVec3) -> DMat3 {
    let mut sum = [DVec3::ZERO; 3];
    for charge in list {
        let d = at - charge.at;
        let inverse = 1.0 / d.length_squared();
        let g = charge.weight * power::<M>(inverse);
        let pull = d * (g * inverse * f64::from(M + 1));
        for (a, column) in sum.iter_mut().enumerate() {
            *column -= pull * d[a];
            column[a] += g;
        }
    }
    DMat3::from_cols(sum[0], sum[1], sum[2])
}

/// Points to be evaluated together, in arrays that vectorise.
#[derive(Default)]
pub(super) struct Block {
    pub at: [Vec<f64>; 3],
    force: [Vec<f64>; 3],
    nearest_squared: Vec<f64>,
}

impl Block {
    pub fn clear(&mut self) {
        self.at.iter_mut().for_each(Vec::clear);
    }

    pub fn push(&mut self, at: DVec3) {
        self.at.iter_mut().zip(at.to_array()).for_each(|(v, x)| v.push(x));
    }

    fn sum<const M: u32>(&mut self, list: &[Charge]) {
        let n = self.at[0].len();
        self.force.iter_mut().for_each(|f| {
            f.clear();
            f.resize(n, 0.0);
        });
        self.nearest_squared.clear();
        self.nearest_squared.resize(n, f64::INFINITY);
        let [x, y, z] = &self.at;
        let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
        let [fx, fy, fz] = &mut self.force;
        let (fx, fy, fz, nearest_squared) =
            (&mut fx[..n], &mut fy[..n], &mut fz[..n], &mut self.nearest_squared[..n]);
        for charge in list {
            for i in 0..n {
                let (dx, dy, dz) = (x[i] - charge.at.x, y[i] - charge.at.y, z[i] - charge.at.z);
                let r2 = dx * dx + dy * dy + dz * dz;
                let g = charge.weight * power::<M>(1.0 / r2);
                fx[i] += dx * g;
                fy[i] += dy * g;
                fz[i] += dz * g;
                nearest_squared[i] = if r2 < nearest_squared[i] { r2 } else { nearest_squared[i] };
            }
        }
    }
}

/// The power law of the force: exponent m, 4 to 9, with code specialised for each.
#[derive(Clone, Copy, Debug)]
pub(super) struct PowerLaw {
    m: u32,
}

impl PowerLaw {
    pub fn new(m: u32) -> Self {
        Self { m: m.clamp(4, 9) }
    }

    /// m.
    pub fn exponent(self) -> u32 {
        self.m
    }

    pub fn sample(self, list: &[Charge], at: DVec3) -> ForceSample {
        match self.m {
            4 => sample_with::<4>(list, at),
            5 => sample_with::<5>(list, at),
            6 => sample_with::<6>(list, at),
            7 => sample_with::<7>(list, at),
            8 => sample_with::<8>(list, at),
            _ => sample_with::<9>(list, at),
        }
    }

    /// Jacobian of the force; symmetric.
    pub fn jacobian(self, list: &[Charge], at: DVec3) -> DMat3 {
        match self.m {
            4 => jacobian_with::<4>(list, at),
            5 => jacobian_with::<5>(list, at),
            6 => jacobian_with::<6>(list, at),
            7 => jacobian_with::<7>(list, at),
            8 => jacobian_with::<8>(list, at),
            _ => jacobian_with::<9>(list, at),
        }
    }

    /// Calls `visit_force(i, force)` for each point of the block with the force times the m-th power of the distance
    /// to the nearest charge: this keeps direction and zeros of the force and removes its enormous range.
    pub fn scaled_forces(
        self,
        list: &[Charge],
        block: &mut Block,
        mut visit_force: impl FnMut(usize, DVec3),
    ) {
        match self.m {
            4 => block.sum::<4>(list),
            5 => block.sum::<5>(list),
            6 => block.sum::<6>(list),
            7 => block.sum::<7>(list),
            8 => block.sum::<8>(list),
            _ => block.sum::<9>(list),
        }
        let [fx, fy, fz] = &block.force;
        for (i, r2) in block.nearest_squared.iter().enumerate() {
            visit_force(i, DVec3::new(fx[i], fy[i], fz[i]) * r2.sqrt().powi(self.m as i32));
        }
    }
}
