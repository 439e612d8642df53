//! How intensities are spread over the bins of a joint histogram.
//!
//! Bins of equal width waste most of them on images with long tails: soft tissue has a tenth of CT's range, and all of a
//! PET but its hottest spots a fifth. The curve gives each range of intensities bins by the voxels in it, within limits:
//! a background of one value must not take them all, and a rare value still needs its own.

/// Ranges of intensities.
const KNOTS: usize = 128;
/// Most and least slope, of an even spread's. The scaled intensities' own.
const MOST: f64 = 4.0;
const LEAST: f64 = 0.35;

/// A monotone map of scaled intensities onto 0 to 1, linear between knots.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curve {
    knots: Vec<f64>,
}

impl Curve {
    /// The curve of these values, of which 0 to 1 is spread; NaN doesn't count.
    pub fn of(values: &[f32]) -> Self {
        let mut counts = vec![0.0_f64; KNOTS];
        for v in values.iter().filter(|v| v.is_finite() && **v > 0.0 && **v < 1.0) {
            counts[((f64::from(*v) * KNOTS as f64) as usize).min(KNOTS - 1)] += 1.0;
        }
        // Limits are of the final slope, so what is cut off is handed out again until it fits.
        let mut slopes = vec![1.0; KNOTS];
        let mut scale = KNOTS as f64 / counts.iter().sum::<f64>().max(1.0);
        for _ in 0..30 {
            slopes = counts.iter().map(|n| (n * scale).clamp(LEAST, MOST)).collect();
            let mean: f64 = slopes.iter().sum::<f64>() / KNOTS as f64;
            scale /= mean;
        }
        let total: f64 = slopes.iter().sum();
        let mut sum = 0.0;
        let mut knots = vec![0.0];
        for slope in slopes {
            sum += slope;
            knots.push(sum / total);
        }
        Self { knots }
    }

    /// Where a value lies on the curve, 0 to 1, and the slope there: 0 beyond the ends.
    #[inline]
    pub fn at(&self, value: f64) -> (f64, f64) {
        let u = value * KNOTS as f64;
        if u.is_nan() || u <= 0.0 {
            return (0.0, 0.0);
        }
        let low = u as usize;
        match (self.knots.get(low), self.knots.get(low + 1)) {
            (Some(a), Some(b)) => {
                let t = u - low as f64;
                (a + t * (b - a), (b - a) * KNOTS as f64)
            }
            _ => (1.0, 0.0),
        }
    }
}
