//! The cone phase function: its footprint, and its visibility behind layers of a medium.

use std::sync::{Arc, Mutex, PoisonError};

/// Largest aperture (half angle, degrees): towards 90° the tangent, and with it every footprint, grows
/// without bound.
pub const WIDEST_DEG: f64 = 85.0;

/// The requested aperture clamped to 0 to [`WIDEST_DEG`], and whether that changed it. NaN counts as 0.
pub fn clamped_aperture(requested_deg: f64) -> (f64, bool) {
    let used = if requested_deg.is_nan() { 0.0 } else { requested_deg.clamp(0.0, WIDEST_DEG) };
    (used, used != requested_deg)
}

/// Variance along one axis of the tangent of directions uniform in the cone's solid angle:
/// (1/cos θ − 1)/2. For a disc uniform in area it would be tan²θ/4.
pub fn tangent_variance(aperture_deg: f64) -> f64 {
    0.5 * (1.0 / aperture_deg.to_radians().cos() - 1.0)
}

/// Directions that a cone of this half opening angle, uniform in solid angle, takes in cosine and azimuth about its axis, as
/// cosines to a direction `tilt_deg` from the axis and slopes from that direction: along the tilt, across.
fn tilted(aperture_deg: f64, tilt_deg: f64) -> Vec<(f64, [f64; 2])> {
    let min_cos = aperture_deg.to_radians().cos();
    let (sin_tilt, cos_tilt) = tilt_deg.to_radians().sin_cos();
    let (n, turns) = (64, 128);
    let directions = (0..n).flat_map(|i| (0..turns).map(move |j| (i, j)));
    directions
        .map(|(i, j)| {
            let cos = min_cos + (1.0 - min_cos) * (f64::from(i) + 0.5) / f64::from(n);
            let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
            let (s, c) = (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(turns)).sin_cos();
            let along_axis = cos_tilt * cos - sin_tilt * sin * c;
            (along_axis, [(sin_tilt * cos + cos_tilt * sin * c) / along_axis, sin * s / along_axis])
        })
        .collect()
}

/// Means over a cone whose axis is `tilt_deg` from the normal of planes, directions uniform in solid angle, of what light
/// moves sideways from plane to plane, per distance of the planes: its mean along the tilt, and its variances along and
/// across. Aperture and tilt together are below 90 degrees.
pub fn tilted_moments(aperture_deg: f64, tilt_deg: f64) -> (f64, [f64; 2]) {
    let all = tilted(aperture_deg, tilt_deg);
    let n = all.len() as f64;
    let mean = all.iter().map(|(_, slope)| slope[0]).sum::<f64>() / n;
    let variance =
        |a: usize, mean: f64| all.iter().map(|(_, slope)| (slope[a] - mean).powi(2)).sum::<f64>() / n;
    (mean, [variance(0, mean), variance(1, 0.0)])
}

/// Cosines of equal shares of the cone's directions to a direction `tilt_deg` from its axis.
fn cosines(aperture_deg: f64, tilt_deg: f64) -> Vec<f64> {
    let n = 128;
    if tilt_deg <= 0.0 {
        let min_cos = aperture_deg.to_radians().cos();
        return (0..n).map(|i| min_cos + (1.0 - min_cos) * (f64::from(i) + 0.5) / f64::from(n)).collect();
    }
    let mut all: Vec<f64> =
        tilted(aperture_deg, tilt_deg).into_iter().map(|(cos, _)| cos.max(1e-3)).collect();
    all.sort_unstable_by(f64::total_cmp);
    let share = all.len() / n as usize;
    // Of the lengths of paths, which light decays with.
    all.chunks(share).map(|c| c.len() as f64 / c.iter().map(|cos| 1.0 / cos).sum::<f64>()).collect()
}

/// Fraction of light from the cone, uniform in solid angle, that crosses a slab of this optical
/// thickness: the mean of e^{−τ/cos φ}.
pub fn slab_visibility(aperture_deg: f64, thickness: f64) -> f64 {
    means(&cosines(aperture_deg, 0.0), thickness).0
}

/// Means of e^{−τ/c} and of e^{−τ/c}/c over directions of these cosines.
fn means(cosines: &[f64], thickness: f64) -> (f64, f64) {
    let mut sums = (0.0, 0.0);
    for c in cosines {
        let transmittance = (-thickness / c).exp();
        sums.0 += transmittance;
        sums.1 += transmittance / c;
    }
    let n = cosines.len() as f64;
    (sums.0 / n, sums.1 / n)
}

/// Intervals of [`Decay::rates`].
pub const RATE_INTERVALS: usize = 256;

/// Decay rate of visibility with optical thickness along the axis, −d ln V/dτ, for visibilities 0 to 1
/// in even steps: that of a slab, in which oblique light is lost first. So a stack of layers has its
/// exact visibility at any slice distance.
fn decay_rates(cosines: &[f64]) -> Vec<f64> {
    let mut out = vec![1.0; RATE_INTERVALS + 1];
    // ln V is convex in τ, so Newton's steps from a smaller thickness never pass the root.
    let mut thickness = 0.0;
    for (i, rate) in out.iter_mut().enumerate().skip(1).rev() {
        let visibility = i as f64 / RATE_INTERVALS as f64;
        for _ in 0..8 {
            let (transmittance, slope) = means(cosines, thickness);
            *rate = slope / transmittance;
            let step = (transmittance / visibility).ln() / *rate;
            if step.abs() < 1e-9 {
                break;
            }
            thickness += step;
        }
    }
    out
}

/// A rate interpolated linearly from a table of [`Decay::rates`].
pub fn rate_at(rates: &[f64], visibility: f64) -> f64 {
    let x = visibility.clamp(0.0, 1.0) * (rates.len() - 1) as f64;
    let low = (x as usize).min(rates.len().saturating_sub(2));
    match rates.get(low..low + 2) {
        Some(&[a, b]) => a + (b - a) * (x - low as f64),
        _ => 1.0,
    }
}

/// Optical thickness at which the tables of [`Decay`] end: no light is left there.
pub const DECAY_END: f64 = 16.0;
/// Slices below this optical thickness are integrated in one step.
pub const THIN: f64 = 0.03;

/// Decay of light from a cone through layers: the tables of [`through_slice`].
#[derive(Clone, Debug, PartialEq)]
pub struct Decay {
    /// Decay rate of visibility with optical thickness along the axis, −d ln V/dτ, for visibilities 0 to 1 in even steps.
    pub rates: Vec<f64>,
    /// At optical thicknesses τ of [`DECAY_END`] times the squares of 257 even steps from 0 to 1: minus the
    /// logarithm of a slab's visibility V(τ); minus the logarithm of the light scattered by an endless medium
    /// behind it, ∫ e^{−t} V(τ + t) dt; and the thickness at which the first of them is τ.
    pub of_slab: Vec<[f64; 3]>,
}

/// The tables requested last, with the bits of their aperture and tilt.
static CACHED: Mutex<Option<([u64; 2], Arc<Decay>)>> = Mutex::new(None);

impl Decay {
    /// Tables of a cone of this half opening angle. The tables requested last are cached: every frame requests
    /// them, and computing them would take part of its time.
    pub fn of(aperture_deg: f64) -> Arc<Self> {
        Self::tilted(aperture_deg, 0.0)
    }

    /// Tables of the same cone about an axis `tilt_deg` from the layers' normal, which the optical thickness is along, with
    /// the eye; aperture and tilt together are below 90 degrees.
    pub fn tilted(aperture_deg: f64, tilt_deg: f64) -> Arc<Self> {
        let mut cached = CACHED.lock().unwrap_or_else(PoisonError::into_inner);
        let key = [aperture_deg, tilt_deg].map(f64::to_bits);
        match &*cached {
            Some((known, decay)) if *known == key => Arc::clone(decay),
            _ => Arc::clone(&cached.insert((key, Arc::new(Self::new(aperture_deg, tilt_deg)))).1),
        }
    }

    fn new(aperture_deg: f64, tilt_deg: f64) -> Self {
        let cosines = cosines(aperture_deg, tilt_deg);
        let n = cosines.len() as f64;
        let logs = |thickness: f64| {
            let (mut visible, mut scattered) = (0.0, 0.0);
            for c in &cosines {
                // Relative to transmittance along the axis, so that nothing underflows to 0.
                let transmittance = (thickness - thickness / c).exp();
                visible += transmittance;
                scattered += transmittance / (1.0 + 1.0 / c);
            }
            [visible, scattered].map(|sum| thickness - (sum / n).ln())
        };
        let entries = RATE_INTERVALS + 1;
        let of_slab = (0..entries)
            .map(|i| {
                let at = DECAY_END * (i as f64 / RATE_INTERVALS as f64).powi(2);
                let [visible, scattered] = logs(at);
                // ln V is convex with a slope of at most −1, so the root is at most `at`, and Newton's
                // method converges from there.
                let mut thickness = at;
                for _ in 0..40 {
                    let error = logs(thickness)[0] - at;
                    let slope = (logs(thickness + 1e-4)[0] - logs(thickness - 1e-4)[0]) / 2e-4;
                    thickness -= error / slope;
                    if error.abs() < 1e-10 {
                        break;
                    }
                }
                [visible, scattered, thickness.max(0.0)]
            })
            .collect();
        Self { rates: decay_rates(&cosines), of_slab }
    }

    fn at(&self, thickness: f64, column: usize) -> f64 {
        let fraction = (thickness / DECAY_END).clamp(0.0, 1.0);
        let low = ((RATE_INTERVALS as f64 * fraction.sqrt()) as usize).min(RATE_INTERVALS - 1);
        let i = low as f64;
        let f = (((RATE_INTERVALS as f64).powi(2) * fraction - i * i) / (2.0 * i + 1.0)).clamp(0.0, 1.0);
        match self.of_slab.get(low..low + 2) {
            Some([a, b]) => a[column] + (b[column] - a[column]) * f,
            _ => 0.0,
        }
    }

    /// As shaders read it, in single precision: the rate, and the three values of `of_slab`.
    pub fn packed(&self) -> [[f32; 4]; RATE_INTERVALS + 1] {
        std::array::from_fn(|i| {
            let rate = self.rates.get(i).copied().unwrap_or(1.0);
            let [visible, scattered, thickness] = self.of_slab.get(i).copied().unwrap_or_default();
            [rate, visible, scattered, thickness].map(|x| x as f32)
        })
    }
}

/// Light through a homogeneous slice of a finite optical `thickness` (along the cone's axis), entered with
/// `visibility`: the light that it scatters to the eye, ∫ e^{−t} V(t) dt, and the visibility behind it.
/// As through a slab behind a slab: how the light was attenuated before doesn't matter.
pub fn through_slice(decay: &Decay, visibility: f64, thickness: f64) -> (f64, f64) {
    // As in single precision, where less counts as 0.
    if visibility <= 1e-7 {
        return (0.0, 0.0);
    }
    if thickness < THIN {
        let midpoint_visibility = visibility * (-0.5 * thickness * rate_at(&decay.rates, visibility)).exp();
        let rate = rate_at(&decay.rates, midpoint_visibility);
        let scattered = visibility * -(-(1.0 + rate) * thickness).exp_m1() / (1.0 + rate);
        return (scattered, visibility * (-rate * thickness).exp());
    }
    let before = decay.at(-visibility.max(1e-30).ln(), 2);
    let end = before + thickness;
    let here = (-decay.at(before, 1)).exp();
    if end >= DECAY_END {
        return (here, 0.0);
    }
    (here - (-thickness - decay.at(end, 1)).exp(), (-decay.at(end, 0)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A stack of slices has the visibility and the scattered light of the slab that they form.
    #[test]
    fn a_stack_of_slices_equals_a_slab() {
        for aperture_deg in [0.0, 30.0, 60.0, 85.0] {
            let decay = Decay::new(aperture_deg, 0.0);
            for whole in [0.01, 0.3, 1.0, 4.0, 11.0] {
                for slices in [1, 2, 7, 60, 1000] {
                    let (mut light, mut gathered, mut through) = (1.0, 0.0, 1.0);
                    let thickness = whole / f64::from(slices);
                    for _ in 0..slices {
                        let (here, behind) = through_slice(&decay, light, thickness);
                        gathered += through * here;
                        through *= (-thickness).exp();
                        light = behind;
                    }
                    let visible = slab_visibility(aperture_deg, whole);
                    // By the trapezoidal rule.
                    let n = 4000;
                    let step = whole / f64::from(n);
                    let at = |i: i32| {
                        (-step * f64::from(i)).exp() * slab_visibility(aperture_deg, step * f64::from(i))
                    };
                    let scattered = step * ((0..=n).map(at).sum::<f64>() - 0.5 * (at(0) + at(n)));
                    let off = (light - visible).abs().max((gathered - scattered).abs());
                    assert!(
                        off < 4e-4,
                        "{aperture_deg} {whole} {slices}: {light} {visible} {gathered} {scattered}"
                    );
                }
            }
        }
    }
}
