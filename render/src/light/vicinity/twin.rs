//! Vicinity occlusion on the CPU in `f64` (Schott et al. 2012, Algorithm 5): the twin of the pass.

use crate::solid::view::FAR;

/// How much nearer than the surface a first hit must be to occlude it, in pixel footprints at the
/// surface: samples fall in whole pixels, so a surface steeper than this occludes itself.
pub const BIAS_PX: f64 = 1.0;

/// Radius of the samples: that of a cone of this half opening at the virtual slice distance (section
/// 3.1.5). The aperture is clamped as elsewhere.
pub fn radius_mm(virtual_slice_mm: f64, aperture_deg: f64) -> f64 {
    virtual_slice_mm * glioscope_core::optics::cone::clamped_aperture(aperture_deg).0.to_radians().tan()
}

/// Share of the samples that no nearer first hit occludes, 0 to 1, for each pixel of `depths` (view depths
/// in millimetres, rows from the top). Depths that are not above 0 and below 1e30 are background. `samples`
/// lie in the unit disc, x to the right and y down; they are spread over `radius_mm` at the depth of the
/// pixel's own first hit, where a pixel is `footprint_mm` wide, and each reads the pixel that it falls
/// in. Only a hit nearer by `slope` times its lateral distance counts: with 1/tan θ those in the cone, with 0
/// all, as in the paper; hits nearer by more than `deepest_mm` don't. Samples outside the frame or on the background occlude nothing. 1 for background pixels, and
/// for all pixels without samples or with a radius or a footprint that is not positive and finite; empty if the sizes
/// don't match.
pub fn vicinity(
    depths: &[f32],
    size: [u32; 2],
    footprint_mm: impl Fn(f64) -> f64,
    radius_mm: f64,
    (slope, deepest_mm): (f64, f64),
    samples: &[[f64; 2]],
) -> Vec<f64> {
    let [width, height] = size.map(|s| s as usize);
    if depths.len() != width * height {
        return Vec::new();
    }
    let hit = |depth: f32| Some(f64::from(depth)).filter(|d| *d > 0.0 && *d < f64::from(FAR));
    let one = |(number, depth): (usize, &f32)| {
        let Some(own) = hit(*depth) else { return 1.0 };
        let pixel_mm = footprint_mm(own);
        let radius_px = radius_mm / pixel_mm;
        if samples.is_empty() || !(pixel_mm > 0.0 && radius_px.is_finite() && radius_px > 0.0) {
            return 1.0;
        }
        let middle = [(number % width) as f64 + 0.5, (number / width) as f64 + 0.5];
        let hides = |sample: &&[f64; 2]| {
            let [x, y] = [0, 1].map(|a| (middle[a] + sample[a] * radius_px).floor());
            let inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
            let there = inside.then(|| depths.get(y as usize * width + x as usize)).flatten();
            there.and_then(|d| hit(*d)).is_some_and(|d| {
                let lateral_mm = sample[0].hypot(sample[1]) * radius_mm;
                d < own - BIAS_PX * pixel_mm - slope * lateral_mm && d >= own - deepest_mm
            })
        };
        1.0 - samples.iter().filter(hides).count() as f64 / samples.len() as f64
    };
    depths.iter().enumerate().map(one).collect()
}

mod tests {
    use super::*;
    use glioscope_core::optics::poisson::poisson_disc;

    const SIZE: [u32; 2] = [48, 40];

    fn image(depth: impl Fn(f64, f64) -> f32) -> Vec<f32> {
        let [w, h] = SIZE;
        (0..w * h).map(|i| depth(f64::from(i % w) + 0.5, f64::from(i / w) + 0.5)).collect()
    }

    /// Share of the unit disc beyond a line at distance `h` from its centre.
    fn segment(h: f64) -> f64 {
        let h = h.clamp(-1.0, 1.0);
        (h.acos() - h * (1.0 - h * h).sqrt()) / std::f64::consts::PI
    }

    /// A nearer surface on the left, a farther one on the right: the occluded share is the segment of the
    /// disc beyond the edge. Closed form.
    #[test]
    fn a_step_hides_the_segment_beyond_it() {
        let depths = image(|x, _| if x < 20.0 { 100.0 } else { 130.0 });
        // 0.01 of the depth is a pixel: 13 mm are 10 pixels of the farther surface.
        let footprint = |depth: f64| 0.01 * depth;
        let dense: Vec<[f64; 2]> = (0..40_000)
            .map(|i| [f64::from(i % 200) / 99.5 - 1.0, f64::from(i / 200) / 99.5 - 1.0])
            .filter(|p| p[0].hypot(p[1]) <= 1.0)
            .collect();
        for (samples, tolerance) in [(dense, 0.01), (poisson_disc(118), 0.05), (poisson_disc(32), 0.1)] {
            let found = vicinity(&depths, SIZE, footprint, 13.0, (0.0, f64::INFINITY), &samples);
            for x in 0..48usize {
                // Away from the upper and lower rim, where samples leave the frame.
                let f = found[20 * 48 + x];
                // Whole pixels: the edge is where a pixel's column begins.
                let truth =
                    if x < 20 { 1.0 } else { 1.0 - segment((f64::from(x as u32) + 0.5 - 20.0) / 10.0) };
                assert!((f - truth).abs() <= tolerance, "{} samples, column {x}: {f} {truth}", samples.len());
            }
        }
    }

    /// The same scene four times as far away under the same angle: footprints and radius grow alike.
    #[test]
    fn scaling_the_scene_changes_nothing() {
        let scene = |scale: f32| image(move |x, y| scale * (100.0 + (3.0 * x.sin() + 4.0 * y.cos()) as f32));
        let samples = poisson_disc(64);
        let near = vicinity(&scene(1.0), SIZE, |d| 0.01 * d, 6.0, (0.0, f64::INFINITY), &samples);
        let far = vicinity(&scene(4.0), SIZE, |d| 0.01 * d, 24.0, (0.0, f64::INFINITY), &samples);
        assert!(near.iter().any(|f| *f < 0.7) && near.iter().any(|f| *f > 0.9));
        assert_eq!(near, far);
    }

    #[test]
    fn flat_surfaces_and_degenerate_input_hide_nothing() {
        let samples = poisson_disc(32);
        let open = |depths: &[f32], footprint: f64, radius: f64, samples: &[[f64; 2]]| {
            let found = vicinity(depths, SIZE, |_| footprint, radius, (0.0, f64::INFINITY), samples);
            found.len() == depths.len() && found.iter().all(|f| *f == 1.0)
        };
        // Rises by less than a footprint within the radius: within the bias.
        let slope = image(|x, _| (100.0 + 0.2 * x) as f32);
        assert!(open(&slope, 1.0, 4.0, &samples));
        let coincident = image(|_, _| 77.0);
        assert!(open(&coincident, 1.0, 8.0, &samples));
        let stepped = image(|x, _| if x < 20.0 { 100.0 } else { 130.0 });
        assert!(!open(&stepped, 1.0, 8.0, &samples));
        for (footprint, radius) in [(0.0, 8.0), (f64::NAN, 8.0), (1.0, f64::NAN), (1.0, 0.0), (1.0, -1.0)] {
            assert!(open(&stepped, footprint, radius, &samples), "{footprint} {radius}");
        }
        assert!(open(&stepped, 1.0, 8.0, &[]));
        // Background of any encoding occludes nothing and isn't occluded.
        for background in [f32::INFINITY, f32::NAN, FAR, 0.0, -1.0] {
            let depths = image(|x, _| if x < 20.0 { background } else { 130.0 });
            assert!(open(&depths, 1.0, 8.0, &samples), "{background}");
        }
        assert!(vicinity(&stepped, [3, 3], |_| 1.0, 8.0, (0.0, f64::INFINITY), &samples).is_empty());
        assert!((radius_mm(2.0, 45.0) - 2.0).abs() < 1e-12 && radius_mm(2.0, 89.9).is_finite());
    }
}
