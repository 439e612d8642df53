//! Numbers with a fixed number of decimals, which never hide that a number isn't zero.

/// `value` with `decimals` decimals. A number below the last of them is written with two digits of its own instead:
/// `0.00030` for 0.3 micrometres, `3.0e-7` below a nanometre.
pub fn text(value: f64, decimals: usize) -> String {
    let size = value.abs();
    if value == 0.0 || !value.is_finite() || size >= 0.1_f64.powi(decimals as i32) {
        return format!("{value:.decimals$}");
    }
    if size < 1e-6 {
        return format!("{value:.1e}");
    }
    let digits = (1.0 - size.log10().floor()) as usize;
    format!("{value:.digits$}")
}

/// Three sizes as [`text`], for grids: `1.0000 × 0.00030 × 5.0000`.
pub fn sizes(values: [f64; 3], decimals: usize) -> String {
    values.map(|value| text(value, decimals)).join(" × ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_are_not_written_as_zero() {
        assert_eq!(
            [0.0, 1.0, -2.345, 123.456, 0.1].map(|v| text(v, 2)),
            ["0.00", "1.00", "-2.35", "123.46", "0.10"]
        );
        assert_eq!(
            [3e-4, -0.004, 0.049, 1e-6, 3e-7, 1.5e-9].map(|v| text(v, 2)),
            ["0.00030", "-0.0040", "0.05", "0.0000010", "3.0e-7", "1.5e-9"]
        );
        assert_eq!([f64::NAN, 0.26, f64::INFINITY, 0.04].map(|v| text(v, 1)), ["NaN", "0.3", "inf", "0.040"]);
        assert_eq!(sizes([1.0, 3e-5, 1e6], 4), "1.0000 × 0.000030 × 1000000.0000");
    }
}
