//! Numbers of the cone phase function.

/// The widest aperture: past it the tangent, and with it every footprint, grows without bound.
pub const WIDEST_DEG: f64 = 85.0;

/// The aperture that is used for one asked for, and whether it is another. Not a number counts as 0.
pub fn clamped_aperture(asked_deg: f64) -> (f64, bool) {
    let used = if asked_deg.is_nan() { 0.0 } else { asked_deg.clamp(0.0, WIDEST_DEG) };
    (used, used != asked_deg)
}

/// Variance along one axis of the tangent of directions uniform in the cone's solid angle:
/// (1/cos θ − 1)/2. For a disc uniform in area it would be tan²θ/4.
pub fn tangent_variance(aperture_deg: f64) -> f64 {
    0.5 * (1.0 / aperture_deg.to_radians().cos() - 1.0)
}

/// Share of light from the cone, uniform in solid angle, that crosses a slab of this optical
/// thickness: the mean of e^{−τ/cos φ}.
pub fn slab_visibility(aperture_deg: f64, thickness: f64) -> f64 {
    means(aperture_deg, thickness).0
}

/// Means of e^{−τ/c} and of e^{−τ/c}/c over the cone.
fn means(aperture_deg: f64, thickness: f64) -> (f64, f64) {
    let least = aperture_deg.to_radians().cos();
    let n = 128;
    let mut sums = (0.0, 0.0);
    for i in 0..n {
        let c = least + (1.0 - least) * (f64::from(i) + 0.5) / f64::from(n);
        let through = (-thickness / c).exp();
        sums.0 += through;
        sums.1 += through / c;
    }
    (sums.0 / f64::from(n), sums.1 / f64::from(n))
}

/// Intervals of [`decay_rates`].
pub const RATE_INTERVALS: usize = 256;

/// How fast visibility falls with optical thickness along the axis, −d ln V/dτ, for visibilities
/// 0 to 1 in even steps: that of a slab, in which slanted light is lost first. So a stack of layers
/// has its exact visibility whatever the slice distance.
pub fn decay_rates(aperture_deg: f64) -> Vec<f64> {
    let mut out = vec![1.0; RATE_INTERVALS + 1];
    // ln V is convex in τ, so Newton's steps from a smaller thickness never pass the root.
    let mut thickness = 0.0;
    for (i, rate) in out.iter_mut().enumerate().skip(1).rev() {
        let visibility = i as f64 / RATE_INTERVALS as f64;
        for _ in 0..8 {
            let (through, slanted) = means(aperture_deg, thickness);
            *rate = slanted / through;
            let off = (through / visibility).ln() / *rate;
            if off.abs() < 1e-9 {
                break;
            }
            thickness += off;
        }
    }
    out
}

/// A rate between the table's.
pub fn rate_at(rates: &[f64], visibility: f64) -> f64 {
    let x = visibility.clamp(0.0, 1.0) * (rates.len() - 1) as f64;
    let low = (x as usize).min(rates.len().saturating_sub(2));
    match rates.get(low..low + 2) {
        Some(&[a, b]) => a + (b - a) * (x - low as f64),
        _ => 1.0,
    }
}

/// Past this optical thickness of one slice nothing is left that a pixel could show.
const DARK: f64 = 12.0;

/// Through a homogeneous slice of an optical thickness (along the cone's axis, finite), entered with
/// a visibility: the light that it scatters to the eye, ∫ e^{−t} V(t) dt, and the visibility behind it.
/// Steps of at most a sixth, so that a thick slice is as right as a stack of thin ones.
pub fn through_slice(rates: &[f64], visibility: f64, thickness: f64) -> (f64, f64) {
    let thickness = thickness.min(DARK);
    let steps = (6.0 * thickness).ceil().max(1.0);
    let step = thickness / steps;
    let (mut light, mut through, mut gathered) = (visibility, 1.0, 0.0);
    for _ in 0..steps as u32 {
        let half_way = light * (-0.5 * step * rate_at(rates, light)).exp();
        let rate = rate_at(rates, half_way);
        gathered += through * light * -(-(1.0 + rate) * step).exp_m1() / (1.0 + rate);
        through *= (-step).exp();
        light *= (-rate * step).exp();
    }
    (gathered, light)
}
