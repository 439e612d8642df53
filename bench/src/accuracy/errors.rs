//! Errors one by one, and differences of displayed colours.

use glam::{DMat3, DVec3};
use glioscope_core::optics::srgb;

/// Errors collected one by one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    squares: f64,
    count: f64,
    max: f64,
}

impl Errors {
    /// Takes in one, of either sign.
    pub fn add(&mut self, error: f64) {
        self.squares += error * error;
        self.count += 1.0;
        // A NaN must be seen.
        if error.is_nan() || error.abs() > self.max {
            self.max = error.abs();
        }
    }

    /// Of all of these.
    pub fn of(errors: impl IntoIterator<Item = f64>) -> Self {
        let mut all = Self::default();
        errors.into_iter().for_each(|e| all.add(e));
        all
    }

    /// Root mean square; 0 of none.
    pub fn rms(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }

    /// Largest absolute one; 0 of none.
    pub fn max(&self) -> f64 {
        self.max
    }
}

/// Colour difference CIE76: the distance in CIELAB, D65 white, of two gamma-encoded sRGB colours, 0 to
/// 1 each channel. About 2.3 is just noticed (Mahy et al. 1994).
pub(super) fn delta_e(a: [f64; 3], b: [f64; 3]) -> f64 {
    lab(a).distance(lab(b))
}

fn lab(encoded: [f64; 3]) -> DVec3 {
    // IEC 61966-2-1: linear sRGB to XYZ, columns red, green, blue.
    let xyz_from_rgb = DMat3::from_cols(
        DVec3::new(0.4124, 0.2126, 0.0193),
        DVec3::new(0.3576, 0.7152, 0.1192),
        DVec3::new(0.1805, 0.0722, 0.9505),
    );
    let rgb = DVec3::from_array(encoded.map(|c| srgb::decode(c.clamp(0.0, 1.0))));
    let white = xyz_from_rgb * DVec3::ONE;
    let bent = |t: f64| {
        let d = 6.0 / 29.0;
        if t > d * d * d { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let v = xyz_from_rgb * rgb / white;
    let [x, y, z] = [v.x, v.y, v.z].map(bent);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Linear radiance as displayed: gamma-encoded sRGB, cut off at 0 and 1.
pub(super) fn displayed(linear: DVec3) -> [f64; 3] {
    linear.to_array().map(srgb::encode)
}

/// Colours against true ones, all 0 to 1 and gamma-encoded: RMS and maximum of ΔE.
pub(super) fn delta_e_of(pairs: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> [f64; 2] {
    let errors = Errors::of(pairs.map(|(a, b)| delta_e(a, b)));
    [errors.rms(), errors.max()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_root_mean_square_and_largest() {
        let mut errors = Errors::of([3.0, -4.0, 0.0, 0.0]);
        assert_eq!((errors.rms(), errors.max()), (2.5, 4.0));
        errors.add(f64::NAN);
        assert!(errors.rms().is_nan() && errors.max().is_nan());
    }

    /// sRGB red, green and blue in CIELAB, as tables of colour have them (D65, two-degree observer).
    #[test]
    fn colour_differences_are_those_of_cielab() {
        let off = |a, b, expected: f64| assert!((delta_e(a, b) - expected).abs() < 0.2, "{}", delta_e(a, b));
        off([1.0; 3], [0.0; 3], 100.0);
        // Red is (53.24, 80.09, 67.20), green (87.74, −86.18, 83.18).
        let red = f64::hypot(f64::hypot(53.24, 80.09), 67.20);
        off([1.0, 0.0, 0.0], [0.0; 3], red);
        let apart = f64::hypot(f64::hypot(87.74 - 53.24, 86.18 + 80.09), 83.18 - 67.20);
        off([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], apart);
        assert_eq!(delta_e([0.3, 0.5, 0.7], [0.3, 0.5, 0.7]), 0.0);
    }
}
