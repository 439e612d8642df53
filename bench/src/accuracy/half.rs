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

/// Visibility behind a homogeneous slab and opacity of it, as the paper's occlusion buffer and the
/// alpha of its eye buffer end up: shaders count in full, what is stored between slices is rounded.
fn buffers(thickness: f64, slices: u32, round: impl Fn(f64) -> f64) -> [f64; 2] {
    let alpha = -(-thickness / f64::from(slices)).exp_m1();
    (0..slices).fold([1.0, 0.0], |[visible, opacity], _| {
        [round(visible * (1.0 - alpha)), round(opacity + (1.0 - opacity) * alpha)]
    })
}

type Round = fn(f64) -> f64;

/// How stored values are rounded, in words, and the bytes of a pixel's buffers then.
const FORMATS: [(&str, f64, Round); 2] =
    [("half floats (emulated)", 10.0, to_half), ("single floats, as the program has them", 20.0, to_single)];

fn point(setting: String, slices: u32, errors: Errors) -> Point {
    Point { setting, ..Point::new(f64::from(slices), &errors) }
}

fn curve(kernel: String, scene: &str, truth: &str, unit: &'static str, points: Vec<Point>) -> Curve {
    Curve {
        family: Family::Half,
        kernel,
        scene: scene.to_owned(),
        knob: "slices",
        truth: truth.to_owned(),
        truth_error: None,
        unit,
        axis: Axis::Knob,
        points,
    }
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let most = bench.effort.of(10, 13, 13);
    let thicknesses = [0.1, 0.5, 1.0, 2.0, 4.0];
    let mut out = Vec::new();
    for (kernel, bytes_a_pixel, round) in FORMATS {
        bench.begin("half floats", kernel)?;
        let points = (4..=most).map(|power| {
            let slices = 1u32 << power;
            let mut errors = Errors::default();
            for thickness in thicknesses {
                errors.add(slab(thickness, slices, round) + 0.8 * (-thickness).exp_m1());
            }
            point(format!("{slices} slices, {bytes_a_pixel} bytes a pixel"), slices, errors)
        });
        out.push(curve(
            kernel.to_owned(),
            "homogeneous slabs of optical thickness 0.1 to 4",
            "0.8 (1 − e^−τ)",
            "linear radiance, 0 to 1",
            points.collect(),
        ));
    }
    for (which, what) in ["occlusion buffer", "opacity in the eye buffer"].into_iter().enumerate() {
        for (kernel, _, round) in FORMATS {
            bench.begin(what, kernel)?;
            // The paper's own pictures have 220 to 1563 slices.
            let points = [220, 500, 1000, 1563, 2000, 4000, 8000].map(|slices| {
                let visible = (-1.0f64).exp();
                let truth = [visible, 1.0 - visible];
                let mut errors = Errors::default();
                errors.add(buffers(1.0, slices, round)[which] - truth[which]);
                point(format!("{slices} slices"), slices, errors)
            });
            out.push(curve(
                format!("{what}, {kernel}"),
                "what directional occlusion stores, behind a slab of optical thickness 1",
                "e^−1 and 1 − e^−1",
                "share of light, 0 to 1",
                points.into(),
            ));
        }
    }
    Ok(out)
}
