//! Paths of light against the CPU's Monte Carlo, which inverts thicknesses instead of tracking.

use glam::DVec3;
use glioscope_core::optics::{
    Projection, Ray,
    hemisphere::{Weight, openness},
    monte_carlo::{self, Estimate, Phase},
    random::Random,
    scattering::Scattering,
    srgb,
    voxels::OpaqueVoxels,
};
use rayon::prelude::*;

use super::tests::{SKY, lit};
use crate::{
    CloseupRenderer, ContextRenderer,
    light::{horizon::twin::Surface, suite::scene},
    scene::{Lamp, PathSettings},
    testing::{GPU, blobs, scene_of},
};

const SIZE: [u32; 2] = [14, 12];

/// Mean and root mean square of the error, and what standard errors say of both.
fn errors(found: &[[f64; 4]], truth: &[Estimate], measured: f64) -> [f64; 4] {
    let (mut sum, mut squares, mut se, mut n) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (f, e) in found.iter().zip(truth).filter(|(f, _)| f[3] > 0.0) {
        for (c, value) in f.iter().enumerate().take(3) {
            sum += value - e.mean[c];
            squares += (value - e.mean[c]).powi(2);
            se += e.standard_error[c].powi(2) + measured.powi(2);
            n += 1.0;
        }
    }
    assert!(n > 80.0, "{n}");
    // A path's three channels are alike.
    [(sum / n).abs(), f64::sqrt(squares / n), f64::sqrt(se / n / (n / 3.0)), f64::sqrt(se / n)]
}

/// Single scattering of a sky, which the CPU's Monte Carlo of the cones' paper has as well; and many scatterings.
#[test]
fn paths_in_the_image_equal_monte_carlo_within_two_standard_errors() {
    let scene = scene(false, false, Projection::Perspective);
    let medium = scene.medium().unwrap();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let mut drawn = |paths: PathSettings| {
        let frame = renderer.render(&GPU, &scene, &lit(paths), SIZE).unwrap();
        let found: Vec<[f64; 4]> = frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect();
        (found, renderer.standard_error(&GPU).unwrap().unwrap().tissue.unwrap())
    };
    let (found, said) = drawn(PathSettings { most: 1024, bounces: 1, ..SKY });
    let truth = monte_carlo::picture(&medium, &scene.camera, SIZE, Phase::Isotropic, DVec3::ZERO, 800, 7);
    let single = errors(&found, &truth, said);
    println!("single scattering: {single:.5?}, said {said:.5}");
    let many =
        PathSettings { most: 1024, bounces: 6, anisotropy: 0.5, lamp_share: 0.5, lamp_radius_deg: 25.0 };
    let (found, said) = drawn(many);
    let light = Scattering {
        sky: 0.5,
        lamp_light: 0.5,
        lamp: Lamp::DEFAULT.direction(&scene.camera),
        lamp_radius_deg: 25.0,
        anisotropy: 0.5,
        bounces: 6,
    };
    let truth = light.picture(&medium, &scene.camera, SIZE, 800, 5);
    let multiple = errors(&found, &truth, said);
    println!("many scatterings: {multiple:.5?}, said {said:.5}");
    for [mean, rms, mean_se, rms_se] in [single, multiple] {
        assert!(mean <= 2.0 * mean_se + 2e-4 && rms <= 1.3 * rms_se, "{mean} {rms} {mean_se} {rms_se}");
    }
    // The error that a frame states is the one that it has.
    let mut before = f64::INFINITY;
    for most in [4, 12, 48] {
        let (found, said) = drawn(PathSettings { most, ..many });
        let [_, rms, _, truths] = errors(&found, &truth, 0.0);
        let own = (rms * rms - truths * truths).sqrt();
        println!("{most} paths: {own:.5}, said {said:.5}");
        assert!((0.75..1.35).contains(&(said / own)) && own < before, "{most}: {said} {own}");
        before = own;
    }
}

/// Light on masks from a sky, once reflected: the open share of the hemisphere.
#[test]
fn paths_on_masks_equal_monte_carlo_within_two_standard_errors() {
    let region = scene_of(blobs(20, DVec3::ONE), 3, None);
    let size = [36, 30];
    let mut renderer = CloseupRenderer::new(&GPU).unwrap();
    let quality = lit(PathSettings { most: 256, bounces: 1, ..SKY });
    let frame = renderer.render(&GPU, &region, &quality, size).unwrap();
    let (surface, blurred) = (Surface::of(frame), frame.read_blurred(&GPU));
    let said = renderer.standard_error(&GPU).unwrap().unwrap().surfaces.unwrap();
    let tumor = region.tumor.as_ref().unwrap();
    let voxels = OpaqueVoxels::new(tumor.grid().clone(), |l| tumor.id(l) != 0);
    let truth: Vec<Option<(f64, f64)>> = (0..blurred.len())
        .into_par_iter()
        .map(|i| {
            let depth_mm = surface.depths_mm[i].is_finite().then_some(surface.depths_mm[i])?;
            let n = surface.in_world(surface.normals[i]);
            let at_mm = surface.sight.at_mm(surface.pixel(i).map(|p| p as u32), depth_mm);
            let at_mm = at_mm + n * voxels.step_height_mm(n);
            let hidden = |ray: &Ray, far_mm: f64| voxels.hidden(ray, far_mm);
            Some(openness(&hidden, at_mm, n, 60.0, Weight::Cosine, 400, &mut Random::new(3, i as u64)))
        })
        .collect();
    let (mut sum, mut squares, mut se, mut n) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for (stored, truth) in blurred.iter().zip(&truth) {
        let Some((light, error)) = truth else { continue };
        let off = srgb::decode(f64::from(stored & 0xff) / 255.0) - light;
        (sum, squares) = (sum + off, squares + off * off);
        (se, n) = (se + error.powi(2) + said.powi(2), n + 1.0);
    }
    let (mean, rms) = ((sum / n).abs(), f64::sqrt(squares / n));
    let (mean_se, rms_se) = (f64::sqrt(se) / n, f64::sqrt(se / n));
    println!("masks: {mean:.5} ± {mean_se:.5}, RMS {rms:.5} of {rms_se:.5}, said {said:.5}, {n} pixels");
    // Plus the rounding to 8 bits.
    assert!(n > 200.0 && mean <= 2.0 * mean_se + 1e-3 && rms <= 1.3 * rms_se + 0.003, "{mean} {rms}");
}
