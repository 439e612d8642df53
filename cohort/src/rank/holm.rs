//! Holm's step-down correction of several tests (Holm 1979).

/// Corrected probabilities, in the order of the given ones: the k-th smallest times the number of those not smaller, not below the ones
/// before it and at most 1.
pub fn corrected(probabilities: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|&a, &b| probabilities[a].total_cmp(&probabilities[b]));
    let (mut out, mut least) = (vec![0.0; probabilities.len()], 0.0_f64);
    for (k, &n) in order.iter().enumerate() {
        least = least.max(probabilities[n] * (probabilities.len() - k) as f64).min(1.0);
        out[n] = least;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_of_r() {
        // R: p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")
        let found = corrected(&[0.01, 0.04, 0.03, 0.005]);
        for (found, expected) in found.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-15, "{found}");
        }
        assert_eq!(corrected(&[0.5, 0.9]), [1.0, 1.0]);
        assert!(corrected(&[]).is_empty());
    }
}
