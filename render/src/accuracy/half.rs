//! What half floats would do to a picture put together from slices. The program has none: buffers of
//! transmittance and colour are 32-bit, and this is why.

use super::{AccuracyError, Axis, Bench, Curve, Family, Point, measure::Errors};

/// The nearest half float (IEEE 754 binary16, ties to even), as `f64`.
pub(super) fn to_half(x: f64) -> f64 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    // Below 2^-14 halves are 2^-24 apart.
    let exponent = x.abs().log2().floor().max(-14.0);
    let apart = (exponent - 10.0).exp2();
    let rounded = (x / apart).round_ties_even() * apart;
    if rounded.abs() > 65504.0 { f64::INFINITY.copysign(x) } else { rounded }
}

fn to_single(x: f64) -> f64 {
    f64::from(x as f32)
}

/// Radiance of a homogeneous slab of colour 0.8 front to back, everything that is stored rounded.
fn slab(thickness: f64, slices: u32, round: impl Fn(f64) -> f64) -> f64 {
    let alpha = round(-(-thickness / f64::from(slices)).exp_m1());
    let (mut radiance, mut transmittance) = (0.0, 1.0);
    for _ in 0..slices {
        radiance = round(radiance + 0.8 * transmittance * alpha);
        transmittance = round(transmittance * (1.0 - alpha));
    }
    radiance
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let most = bench.effort.of(10, 13, 13);
    let thicknesses = [0.1, 0.5, 1.0, 2.0, 4.0];
    let mut out = Vec::new();
    for (kernel, bytes_a_pixel, round) in [
        ("half floats (emulated)", 10.0, to_half as fn(f64) -> f64),
        ("single floats, as the program has them", 20.0, to_single as fn(f64) -> f64),
    ] {
        bench.begin("half floats", kernel)?;
        let mut points = Vec::new();
        for power in 4..=most {
            let slices = 1u32 << power;
            let mut errors = Errors::default();
            for thickness in thicknesses {
                errors.add(slab(thickness, slices, round) + 0.8 * (-thickness).exp_m1());
            }
            points.push(Point {
                setting: format!("{slices} slices, {bytes_a_pixel} bytes a pixel"),
                value: f64::from(slices),
                time: None,
                cpu: None,
                peak_bytes: None,
                error_rms: errors.rms(),
                error_max: errors.max(),
                delta_e: None,
                is_default: false,
                is_pareto: false,
            });
        }
        out.push(Curve {
            family: Family::Half,
            kernel: kernel.to_owned(),
            scene: "homogeneous slabs of optical thickness 0.1 to 4".to_owned(),
            knob: "slices",
            truth: "0.8 (1 − e^−τ)".to_owned(),
            truth_error: None,
            unit: "linear radiance, 0 to 1",
            axis: Axis::Knob,
            points,
        });
    }
    Ok(out)
}
