//! One Newton step on all weights at once. Exchange finds the support (the points that carry weight) in few
//! sweeps, but where these lie close together its pairwise steps zigzag; a joint step doesn't.

use super::state::{N, State, diagonal_product, dot};

/// Largest support that the step is tried on: its cost is cubic in the number of points.
const MAX_SUPPORT: usize = 60;

/// Moves the weights to the maximum of the local quadratic model of the determinant's logarithm (gradient g,
/// curvature the squared dot products of the lifted points), as far as weights stay non-negative and only if
/// the determinant grows. `None` as for [`State::refresh`].
pub(super) fn step(state: &mut State) -> Option<()> {
    state.refresh()?;
    let support: Vec<usize> = (0..state.points.len()).filter(|&i| state.points[i].weight > 0.0).collect();
    let count = support.len();
    if count > MAX_SUPPORT {
        return Some(());
    }
    let lifted: Vec<[f64; 4]> = support.iter().map(|&i| state.points[i].lifted()).collect();
    // Solves H d = g - n and H e = 1, then removes from d what would change the sum of the weights. More
    // than ten points make H singular; a small diagonal term selects the shortest step.
    let mut h: Vec<Vec<f64>> =
        lifted.iter().map(|a| lifted.iter().map(|b| dot(a, b).powi(2)).collect()).collect();
    (0..count).for_each(|i| h[i][i] += 1e-10 * N * N);
    let gradient: Vec<f64> = support.iter().map(|&i| state.points[i].g - N).collect();
    let Some((d, e)) = solved(h, gradient) else { return Some(()) };
    let excess = d.iter().sum::<f64>() / e.iter().sum::<f64>();
    let change: Vec<f64> = d.iter().zip(&e).map(|(d, e)| d - excess * e).collect();

    let before: Vec<f64> = support.iter().map(|&i| state.points[i].weight).collect();
    let max_step =
        before.iter().zip(&change).filter(|(_, c)| **c < 0.0).map(|(u, c)| -u / c).fold(1.0, f64::min);
    let determinant = |state: &State| state.factor().map(|(_, shape)| diagonal_product(&shape));
    let start = determinant(state)?;
    for part in [1.0, 0.5, 0.25] {
        for ((&i, u), c) in support.iter().zip(&before).zip(&change) {
            let weight = u + part * max_step * c;
            // The point that limits the step leaves the support.
            state.points[i].weight = if weight > 1e-14 { weight } else { 0.0 };
        }
        if determinant(state).is_some_and(|now| now > start) {
            return Some(());
        }
    }
    for (&i, &u) in support.iter().zip(&before) {
        state.points[i].weight = u;
    }
    Some(())
}

/// `m⁻¹ b` and `m⁻¹ 1` by Gaussian elimination with row exchanges; `None` when `m` is singular.
fn solved(mut m: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<(Vec<f64>, Vec<f64>)> {
    let n = b.len();
    let mut one = vec![1.0; n];
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()))?;
        m.swap(k, pivot);
        b.swap(k, pivot);
        one.swap(k, pivot);
        if m[k][k].abs() < 1e-300 {
            return None;
        }
        let (done, rest) = m.split_at_mut(k + 1);
        let row = &done[k];
        for (i, below) in (k + 1..n).zip(rest) {
            let factor = below[k] / row[k];
            below[k..].iter_mut().zip(&row[k..]).for_each(|(v, r)| *v -= factor * r);
            b[i] -= factor * b[k];
            one[i] -= factor * one[k];
        }
    }
    for k in (0..n).rev() {
        for rhs in [&mut b, &mut one] {
            let known: f64 = (k + 1..n).map(|j| m[k][j] * rhs[j]).sum();
            rhs[k] = (rhs[k] - known) / m[k][k];
        }
    }
    Some((b, one))
}
