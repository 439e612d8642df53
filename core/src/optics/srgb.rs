//! Conversion between sRGB encoded values (IEC 61966-2-1) and linear light; both 0 to 1.

/// Linear light of an encoded value.
pub fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Encoded value of linear light, which is clamped to 0 to 1.
pub fn encode(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decode_inverts_encode() {
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            assert!((decode(encode(x)) - x).abs() < 1e-6, "{x}");
        }
        // Values of the standard: half of the light is encoded as 188 of 255.
        assert!((encode(0.5) - 0.735_357).abs() < 1e-6 && (decode(0.5) - 0.214_041).abs() < 1e-6);
        assert_eq!((encode(-1.0), encode(2.0)), (0.0, encode(1.0)));
    }
}
