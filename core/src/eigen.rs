//! Eigenvectors of small symmetric matrices.

use glam::DMat3;

/// Eigenvalues and unit eigenvectors (columns) of a symmetric matrix, by Jacobi rotations.
pub(crate) fn symmetric_eigen(mut a: DMat3) -> ([f64; 3], DMat3) {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..30 {
        let size = (a.x_axis.x.powi(2) + a.y_axis.y.powi(2) + a.z_axis.z.powi(2)).sqrt();
        let off_diagonal = a.y_axis.x.abs().max(a.z_axis.x.abs()).max(a.z_axis.y.abs());
        if off_diagonal <= 1e-15 * size || off_diagonal == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let apq = a.col(q)[p];
            if apq == 0.0 {
                continue;
            }
            let theta = (a.col(q)[q] - a.col(p)[p]) / (2.0 * apq);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let mut rotation = DMat3::IDENTITY;
            rotation.col_mut(p)[p] = c;
            rotation.col_mut(q)[q] = c;
            rotation.col_mut(q)[p] = s;
            rotation.col_mut(p)[q] = -s;
            a = rotation.transpose() * a * rotation;
            vectors *= rotation;
        }
    }
    ([a.x_axis.x, a.y_axis.y, a.z_axis.z], vectors)
}
