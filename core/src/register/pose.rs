//! Transforms between centred images: half-way square roots, steps, distances; a small linear solver.
//!
//! A pose `T` maps points of the centred fixed image to the centred moving one, mm. `A = T^½` leads to the space half
//! way: a point `x` there lies at `A⁻¹ x` in the fixed and at `A x` in the moving image, so that both images are
//! interpolated equally (Reuter, Rosas, Fischl 2010).

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use super::types::Model;

/// Most parameters of a pose.
pub(crate) const MAX_PARAMETERS: usize = 12;

/// Number of parameters of a model: translation first, then rotation or the matrix by rows.
pub(crate) fn parameters(model: Model) -> usize {
    match model {
        Model::Rigid => 6,
        Model::Affine => 12,
    }
}

/// The two ways out of the half-way space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HalfWay {
    /// Centred fixed mm from half-way mm.
    pub fixed_from_half: DAffine3,
    /// Centred moving mm from half-way mm.
    pub moving_from_half: DAffine3,
}

/// The half-way space of a pose; `None` where it has no principal square root (a half turn, a reflection).
pub(crate) fn half_way(pose: DAffine3, model: Model) -> Option<HalfWay> {
    let root = match model {
        Model::Rigid => rigid_root(pose),
        Model::Affine => affine_root(pose),
    }?;
    let inverse = inverse(root)?;
    Some(HalfWay { fixed_from_half: inverse, moving_from_half: root })
}

fn rigid_root(pose: DAffine3) -> Option<DAffine3> {
    let q = DQuat::from_mat3(&pose.matrix3);
    let q = if q.w < 0.0 { -q } else { q };
    // Half the angle: between q and no rotation.
    let sum = DQuat::from_xyzw(q.x, q.y, q.z, q.w + 1.0);
    if sum.length_squared().is_nan() || sum.length_squared() < 1e-6 || q.w < 1e-3 {
        return None;
    }
    let matrix3 = DMat3::from_quat(sum.normalize());
    let translation = (matrix3 + DMat3::IDENTITY).inverse() * pose.translation;
    finite(DAffine3 { matrix3, translation })
}

/// Denman and Beavers 1976.
fn affine_root(pose: DAffine3) -> Option<DAffine3> {
    if pose.matrix3.determinant() <= 0.0 {
        return None;
    }
    let (mut y, mut z) = (DMat4::from(pose), DMat4::IDENTITY);
    for _ in 0..40 {
        let next = (y + z.inverse()) * 0.5;
        z = (z + y.inverse()) * 0.5;
        let change = (next - y).to_cols_array().iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        y = next;
        if change < 1e-14 {
            break;
        }
    }
    let root = DAffine3::from_mat4(y);
    let error = (DMat4::from(root * root) - DMat4::from(pose)).to_cols_array();
    let close = error.iter().all(|e| e.abs() < 1e-7);
    if close { finite(root) } else { None }
}

impl HalfWay {
    /// The pose that leads from one image to the other by way of this space.
    pub fn pose(&self) -> Option<DAffine3> {
        finite(self.moving_from_half * inverse(self.fixed_from_half)?)
    }

    /// After a step of `parameters`, half of it in each direction: a point half way keeps its place up to the step, which
    /// the exact root would not, so that derivatives are those of the measure itself.
    pub fn stepped(&self, step: &[f64], model: Model) -> Option<Self> {
        let halved = |sign: f64| step.iter().map(|s| 0.5 * sign * s).collect::<Vec<f64>>();
        let forth = self.moving_from_half * exponential(&halved(1.0), model);
        let back = self.fixed_from_half * exponential(&halved(-1.0), model);
        // Rounding must not add up to a scale.
        let clean = |affine: DAffine3| match model {
            Model::Rigid => {
                let matrix3 = DMat3::from_quat(DQuat::from_mat3(&affine.matrix3).normalize());
                finite(DAffine3 { matrix3, ..affine })
            }
            Model::Affine => finite(affine),
        };
        Some(Self { fixed_from_half: clean(back)?, moving_from_half: clean(forth)? })
    }
}

/// Exponential of a twist (rigid) or of any velocity (affine), by squaring and Taylor's series.
fn exponential(step: &[f64], model: Model) -> DAffine3 {
    let translation = DVec3::new(step[0], step[1], step[2]);
    let linear = match model {
        Model::Rigid => {
            let (x, y, z) = (step[3], step[4], step[5]);
            DMat3::from_cols(DVec3::new(0.0, z, -y), DVec3::new(-z, 0.0, x), DVec3::new(y, -x, 0.0))
        }
        Model::Affine => {
            let column = |c: usize| DVec3::new(step[3 + c], step[6 + c], step[9 + c]);
            DMat3::from_cols(column(0), column(1), column(2))
        }
    };
    let velocity = DMat4::from_cols(
        linear.x_axis.extend(0.0),
        linear.y_axis.extend(0.0),
        linear.z_axis.extend(0.0),
        translation.extend(0.0),
    );
    let squarings = 8;
    let small = velocity * (0.5_f64).powi(squarings);
    let mut term = DMat4::IDENTITY;
    let mut sum = DMat4::IDENTITY;
    for n in 1..10 {
        term = term * small * (1.0 / f64::from(n));
        sum += term;
    }
    for _ in 0..squarings {
        sum = sum * sum;
    }
    DAffine3::from_mat4(sum)
}

/// `rotation_mm` turned about the axes by angles (radians), about the origin.
pub(crate) fn rotated(angles: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_scaled_axis(angles))
}

/// The quarter turn of the moving image after which `matrix3` turns by less than about 70°; mostly the identity. Without it
/// a half turn would have no half way.
pub(crate) fn nearest_turn(matrix3: DMat3) -> DMat3 {
    let trace = |turn: DMat3| {
        let m = turn * matrix3;
        m.x_axis.x + m.y_axis.y + m.z_axis.z
    };
    // The trace of a rotation by 70°.
    if trace(DMat3::IDENTITY) > 1.68 {
        return DMat3::IDENTITY;
    }
    let better = |best: DMat3, turn: DMat3| if trace(turn) > trace(best) { turn } else { best };
    quarter_turns().into_iter().fold(DMat3::IDENTITY, better)
}

/// The 23 rotations that map axes onto axes, but for the identity.
pub(crate) fn quarter_turns() -> Vec<DMat3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut turns = Vec::new();
    for at in 0..36 {
        let (a, b) = (at / 12, at / 4 % 3);
        if a == b {
            continue;
        }
        let sign = |bit: usize| if at >> bit & 1 == 1 { -1.0 } else { 1.0 };
        let (x, y) = (axes[a] * sign(0), axes[b] * sign(1));
        let turn = DMat3::from_cols(x, y, x.cross(y));
        if turn != DMat3::IDENTITY {
            turns.push(turn);
        }
    }
    turns
}

/// The inverse; `None` where it isn't finite.
pub(crate) fn inverse(affine: DAffine3) -> Option<DAffine3> {
    let matrix3 = affine.matrix3.inverse();
    finite(DAffine3 { matrix3, translation: -(matrix3 * affine.translation) })
}

fn finite(affine: DAffine3) -> Option<DAffine3> {
    affine.is_finite().then_some(affine)
}

/// Largest distance between where two poses put the points of a sphere of `radius_mm` about the origin, at most.
pub(crate) fn apart_mm(a: DAffine3, b: DAffine3, radius_mm: f64) -> f64 {
    let difference = a.matrix3 - b.matrix3;
    let columns = [difference.x_axis, difference.y_axis, difference.z_axis];
    // The Frobenius norm is at least the largest singular value, and √2 times it for a rotation.
    let norm = columns.iter().map(|c| c.length_squared()).sum::<f64>().sqrt();
    (a.translation - b.translation).length() + norm / std::f64::consts::SQRT_2 * radius_mm
}

/// Solves `matrix · x = right` for a symmetric positive definite matrix (lower triangle of row-major `n × n` read).
/// `None` where it isn't positive definite.
pub(crate) fn solve(matrix: &[f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
            let rest = matrix[i * n + j] - dot;
            if i == j {
                // Also false for NaN.
                let positive = rest > 0.0;
                if !positive {
                    return None;
                }
                l[i * n + i] = rest.sqrt();
            } else {
                l[i * n + j] = rest / l[j * n + j];
            }
        }
    }
    let mut x = right.to_vec();
    for i in 0..n {
        let dot: f64 = (0..i).map(|k| l[i * n + k] * x[k]).sum();
        x[i] = (x[i] - dot) / l[i * n + i];
    }
    for i in (0..n).rev() {
        let dot: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
        x[i] = (x[i] - dot) / l[i * n + i];
    }
    x.iter().all(|v| v.is_finite()).then_some(x)
}
