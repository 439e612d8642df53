//! Real spherical harmonics, directions spread over the sphere, and the light of a round sky about a lamp. Pure: no device is touched.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Functions up to an order.
pub(crate) fn count(order: u32) -> usize {
    (order as usize + 1).pow(2)
}

/// Values at a direction (unit length) of all functions up to an order: degree l, then m from -l to l. Orthonormal; without the
/// Condon-Shortley phase.
pub(crate) fn values(order: u32, direction: DVec3) -> Vec<f64> {
    let DVec3 { x, y, z } = direction;
    let mut out = vec![0.0; count(order)];
    // Real and imaginary part of (x + iy)^m, and the associated Legendre function of degree m without its power of the sine.
    let (mut re, mut im, mut first) = (1.0, 0.0, 1.0);
    for m in 0..=order {
        let (mut before, mut here) = (0.0, first);
        for l in m..=order {
            if l > m {
                let [l, m] = [l, m].map(f64::from);
                (before, here) = (here, ((2.0 * l - 1.0) * z * here - (l + m - 1.0) * before) / (l - m));
            }
            let norm = normalization(l, m) * here;
            let middle = (l * l + l) as usize;
            for (place, value) in [(middle - m as usize, im), (middle + m as usize, re)] {
                if let Some(out) = out.get_mut(place) {
                    *out = norm * value;
                }
            }
        }
        first *= 2.0 * f64::from(m) + 1.0;
        (re, im) = (x * re - y * im, x * im + y * re);
    }
    out
}

/// √((2l+1)/4π · (l-m)!/(l+m)!), and √2 of it where m is above 0.
fn normalization(l: u32, m: u32) -> f64 {
    let ratio: f64 = (l - m + 1..=l + m).map(|n| 1.0 / f64::from(n)).product();
    let twice = if m > 0 { 2.0 } else { 1.0 };
    (twice * ratio * (2.0 * f64::from(l) + 1.0) / (4.0 * PI)).sqrt()
}

/// Directions that share a cap of this half angle about z evenly, unit length: a Fibonacci spiral.
pub(crate) fn spread(count: u32, half_angle_deg: f64) -> Vec<DVec3> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let drop = 1.0 - half_angle_deg.to_radians().cos();
    (0..count)
        .map(|i| {
            let z = 1.0 - drop * (f64::from(i) + 0.5) / f64::from(count);
            let (s, c) = (golden * f64::from(i)).rem_euclid(TAU).sin_cos();
            let across = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
            DVec3::new(across * c, across * s, z)
        })
        .collect()
}

/// What a projection of visibility is multiplied with, function by function, to get the light that arrives: from a round sky of this
/// half angle about a direction (unit length), and for the rest (`everywhere`, 0 to 1) from all around. All of it is 1.
pub(crate) fn sky(order: u32, towards: DVec3, half_angle_deg: f64, everywhere: f64) -> Vec<f64> {
    let mut out = values(order, towards);
    let (cos, mut place) = (half_angle_deg.to_radians().cos(), 0);
    for l in 0..=order {
        // Zonal (Funk-Hecke): the mean of a Legendre polynomial over the cap.
        let share = if 1.0 - cos < 1e-7 { 1.0 } else { mean_legendre(l, cos) };
        let even = if l == 0 { 1.0 } else { 1.0 - everywhere };
        for value in out.iter_mut().skip(place).take(2 * l as usize + 1) {
            *value *= share * even;
        }
        place += 2 * l as usize + 1;
    }
    out
}

/// Mean of the Legendre polynomial of degree l over [cos, 1].
fn mean_legendre(l: u32, cos: f64) -> f64 {
    if l == 0 {
        return 1.0;
    }
    let (mut before, mut here) = (1.0, cos);
    for n in 1..l {
        let n = f64::from(n);
        (before, here) = (here, ((2.0 * n + 1.0) * cos * here - n * before) / (n + 1.0));
    }
    // Bonnet: the integral is (P(l-1) - P(l+1)) / (2l + 1).
    let l = f64::from(l);
    let after = ((2.0 * l + 1.0) * cos * here - l * before) / (l + 1.0);
    (before - after) / (2.0 * l + 1.0) / (1.0 - cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORDER: u32 = 5;

    /// Integral over the sphere: exact around the axis, midpoints of 4,000 bands along it.
    fn integral(of: impl Fn(DVec3) -> Vec<f64>) -> Vec<f64> {
        let (bands, around) = (4000, 16);
        let mut sum: Vec<f64> = Vec::new();
        for band in 0..bands {
            let z = -1.0 + 2.0 * (f64::from(band) + 0.5) / f64::from(bands);
            for n in 0..around {
                let (s, c) = (TAU * f64::from(n) / f64::from(around)).sin_cos();
                let across = (1.0 - z * z).sqrt();
                let here = of(DVec3::new(across * c, across * s, z));
                sum.resize(here.len(), 0.0);
                let share = 2.0 / f64::from(bands) * TAU / f64::from(around);
                sum.iter_mut().zip(here).for_each(|(sum, here)| *sum += here * share);
            }
        }
        sum
    }

    #[test]
    fn functions_are_orthonormal() {
        let n = count(ORDER);
        let products = |d: DVec3| {
            let y = values(ORDER, d);
            (0..n * n).map(|i| y[i / n] * y[i % n]).collect()
        };
        for (i, product) in integral(products).into_iter().enumerate() {
            let expected = if i / n == i % n { 1.0 } else { 0.0 };
            assert!((product - expected).abs() < 1e-5, "{} {}: {product}", i / n, i % n);
        }
        // Known ones.
        let d = DVec3::new(0.48, 0.6, 0.64);
        let y = values(2, d);
        let third = (3.0 / (4.0 * PI)).sqrt();
        for (k, expected) in [(0, 0.5 / PI.sqrt()), (1, third * d.y), (2, third * d.z), (3, third * d.x)] {
            assert!((y[k] - expected).abs() < 1e-12, "{k}");
        }
        assert!((y[4] - 0.5 * (15.0 / PI).sqrt() * d.x * d.y).abs() < 1e-12, "{}", y[4]);
        assert!((y[6] - 0.25 * (5.0 / PI).sqrt() * (3.0 * d.z * d.z - 1.0)).abs() < 1e-12, "{}", y[6]);
    }

    #[test]
    fn the_sky_is_its_projection() {
        let towards = DVec3::new(0.36, -0.48, 0.8);
        // Caps that end between two bands.
        for (cos, everywhere) in [(0.5f64, 0.0), (0.9, 0.3), (-1.0, 0.0), (0.2, 1.0)] {
            let half_angle_deg = cos.acos().to_degrees();
            let area = TAU * (1.0 - cos);
            // About the axis that the integral is exact around.
            let radiance = |d: DVec3| {
                let lit = f64::from(u8::from(d.z > cos));
                (1.0 - everywhere) * lit / area + everywhere / (4.0 * PI)
            };
            let projected = integral(|d| values(ORDER, d).iter().map(|y| y * radiance(d)).collect());
            let closed = sky(ORDER, DVec3::Z, half_angle_deg, everywhere);
            for (k, (a, b)) in projected.iter().zip(&closed).enumerate() {
                assert!((a - b).abs() < 2e-4, "{half_angle_deg} {everywhere} {k}: {a} {b}");
            }
            // Turned: as much in each degree, and all of it where nothing is hidden.
            let turned = sky(ORDER, towards, half_angle_deg, everywhere);
            for l in 0..=ORDER as usize {
                let power = |of: &[f64]| of[l * l..(l + 1) * (l + 1)].iter().map(|c| c * c).sum::<f64>();
                assert!((power(&turned) - power(&closed)).abs() < 1e-9, "{l}");
            }
            assert!((turned[0] * (4.0 * PI).sqrt() - 1.0).abs() < 1e-12);
        }
        // A narrow sky is a lamp.
        let (narrow, lamp) = (sky(ORDER, towards, 0.0, 0.0), values(ORDER, towards));
        assert_eq!(narrow, lamp);
    }

    #[test]
    fn directions_are_spread_evenly() {
        let all = spread(64, 180.0);
        assert!(all.iter().sum::<DVec3>().length() / 64.0 < 0.01);
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        let y =
            all.iter().map(|d| values(3, *d)).reduce(|a, b| a.iter().zip(b).map(|(a, b)| a + b).collect());
        // What is visible everywhere has no other coefficient than the first.
        let others = y.unwrap().iter().skip(1).map(|y| (y * 4.0 * PI / 64.0).abs()).fold(0.0, f64::max);
        assert!(others < 0.08, "{others}");
        assert!(spread(9, 30.0).iter().all(|d| d.z > f64::to_radians(30.0).cos()));
    }
}
