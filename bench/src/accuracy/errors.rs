//! Root mean square and maximum of errors, and differences of displayed colours.

use glam::{DMat3, DVec3};
use glioscope_core::optics::srgb;

/// Root mean square and maximum of errors that are added one by one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Errors {
    squares: f64,
    count: f64,
    max: f64,
}

impl Errors {
    /// Adds an error of either sign.
    pub fn add(&mut self, error: f64) {
        self.squares += error * error;
        self.count += 1.0;
        // A NaN must propagate.
        if error.is_nan() || error.abs() > self.max {
            self.max = error.abs();
        }
    }

    /// Accumulates all of `errors`.
    pub fn of(errors: impl IntoIterator<Item = f64>) -> Self {
        let mut all = Self::default();
        errors.into_iter().for_each(|e| all.add(e));
        all
    }

    /// Root mean square; 0 without errors.
    pub fn rms(&self) -> f64 {
        (self.squares / self.count.max(1.0)).sqrt()
    }

    /// Largest absolute error; 0 without errors.
    pub fn max(&self) -> f64 {
        self.max
    }
}

/// Colour difference CIE76: the distance in CIELAB, D65 white, between two gamma-encoded sRGB colours, channels 0 to 1.
/// About 2.3 is just noticeable (Mahy et al. 1994).
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
    let cube_root = |t: f64| {
        let d = 6.0 / 29.0;
        if t > d * d * d { t.cbrt() } else { t / (3.0 * d * d) + 4.0 / 29.0 }
    };
    let v = xyz_from_rgb * rgb / white;
    let [x, y, z] = [v.x, v.y, v.z].map(cube_root);
    DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// Linear radiance as displayed: gamma-encoded sRGB, clamped to 0 to 1.
pub(super) fn displayed(linear: DVec3) -> [f64; 3] {
    linear.to_array().map(srgb::encode)
}

/// RMS and maximum of ΔE between measured and true colours, all gamma-encoded, channels 0 to 1.
pub(super) fn delta_e_of(pairs: impl Iterator<Item = ([f64; 3], [f64; 3])>) -> [f64; 2] {
    let errors = Errors::of(pairs.map(|(a, b)| delta_e(a, b)));
    [errors.rms(), errors.max()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_rms_and_maximum() {
        let mut errors = Errors::of([3.0, -4.0, 0.0, 0.0]);
        assert_eq!((errors.rms(), errors.max()), (2.5, 4.0));
        errors.add(f64::NAN);
        assert!(errors.rms().is_nan() && errors.max().is_nan());
    }

    /// Tabulated CIELAB coordinates of sRGB red and green (D65, two-degree observer).
    #[test]
    fn colour_differences_match_tabulated_cielab_values() {
        let assert_delta_e =
            |a, b, expected: f64| assert!((delta_e(a, b) - expected).abs() < 0.2, "{}", delta_e(a, b));
        assert_delta_e([1.0; 3], [0.0; 3], 100.0);
        // Red is (53.24, 80.09, 67.20), green (87.74, −86.18, 83.18).
        let red = f64::hypot(f64::hypot(53.24, 80.09), 67.20);
        assert_delta_e([1.0, 0.0, 0.0], [0.0; 3], red);
        let red_to_green = f64::hypot(f64::hypot(87.74 - 53.24, 86.18 + 80.09), 83.18 - 67.20);
        assert_delta_e([0.0, 1.0, 0.0], [1.0, 0.0, 0.0], red_to_green);
        assert_eq!(delta_e([0.3, 0.5, 0.7], [0.3, 0.5, 0.7]), 0.0);
    }
}
