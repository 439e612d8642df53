//! The tilted cone of slices: its ellipse, its limits, and its light against Monte Carlo of the same light.

use glam::{DVec2, DVec3};
use glioscope_core::optics::{
    Projection, Sight,
    cone::{Decay, tangent_variance, through_slice, tilted_moments},
    medium::{Shape, Shapes},
    monte_carlo::{self, Phase, direction, visibility},
    random::Random,
};

use super::{
    lamp::{LampCone, cases, mixture_note},
    plan::Kernel,
};
use crate::{
    ContextRenderer,
    light::suite::{SIZE, lit, scene},
    scene::{Lamp, LightSettings, LightingMode, Quality},
    testing::GPU,
};

fn towards(tilt_deg: f64, azimuth_deg: f64) -> DVec3 {
    let (tilt, azimuth) = (tilt_deg.to_radians(), azimuth_deg.to_radians());
    DVec3::new(tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), -tilt.cos())
}

/// Each direction on the cone's surface crosses the plane before on the ellipse, from each pixel and with both projections.
#[test]
fn the_ellipse_is_where_a_plane_cuts_the_cone() {
    for (projection, tilt_deg, azimuth_deg, aperture_deg) in [
        (Projection::Orthographic, 0.0, 0.0, 50.0),
        (Projection::Orthographic, 40.0, 30.0, 30.0),
        (Projection::Perspective, 60.0, -120.0, 20.0),
        (Projection::Perspective, 10.0, 100.0, 70.0),
    ] {
        let sight = Sight::new(&scene(false, false, projection).camera, [80, 60]);
        // A lamp before the scene, and one behind it.
        for (axis, depths_mm) in [
            (towards(tilt_deg, azimuth_deg), [90.0, 91.5]),
            (towards(tilt_deg, azimuth_deg) * DVec3::new(1.0, 1.0, -1.0), [91.5, 90.0]),
        ] {
            let mut notes = Vec::new();
            let cone = LampCone::new(axis, aperture_deg, true, &mut notes);
            assert!(notes.is_empty() && cone.from_behind == (axis.z > 0.0), "{notes:?}");
            let Kernel::Ellipse { scale, shift_px, axes_px: [along, across], .. } =
                cone.ellipse(&sight, depths_mm, 5)
            else {
                panic!()
            };
            let (along, across) = (DVec2::from_array(along), DVec2::from_array(across));
            let (u, v) = monte_carlo::around(axis);
            for n in 0..24 {
                let (s, c) = (f64::from(n) * 0.2618).sin_cos();
                let (sin, cos) = f64::to_radians(aperture_deg).sin_cos();
                let ray = axis * cos + (u * c + v * s) * sin;
                // A pixel, and where its light crosses the plane before on its way, right and down.
                let pixel = DVec2::new(-31.0, 17.0);
                let at_mm =
                    pixel * sight.pixel_mm(depths_mm[1]) + DVec2::new(ray.x, -ray.y) * (1.5 / ray.z.abs());
                let off = at_mm / sight.pixel_mm(depths_mm[0])
                    - pixel * (1.0 + scale)
                    - DVec2::from_array(shift_px);
                let on = (off.dot(along) / along.length_squared()).powi(2)
                    + (off.dot(across) / across.length_squared()).powi(2);
                assert!((on - 1.0).abs() < 1e-9, "{projection:?} {tilt_deg} {aperture_deg}: {on}");
            }
        }
    }
}

#[test]
fn the_aperture_is_clamped_with_a_note() {
    for (tilt_deg, aperture_deg, used, count) in [
        (0.0, 85.0, (0.0, 85.0), 0),
        (60.0, 25.0, (60.0, 25.0), 0),
        (60.0, 60.0, (60.0, 25.0), 1),
        (75.0, 60.0, (75.0, 10.0), 1),
        (105.0, 60.0, (75.0, 10.0), 1),
        (120.0, 25.0, (60.0, 25.0), 0),
        (180.0, 0.0, (0.0, 0.0), 0),
    ] {
        let mut notes = Vec::new();
        let cone = LampCone::new(towards(tilt_deg, 200.0), aperture_deg, false, &mut notes);
        let off = (cone.tilt_deg - used.0).abs().max((cone.aperture_deg - used.1).abs());
        assert!(off < 1e-9 && notes.len() == count && cone.slope.is_finite(), "{cone:?} {notes:?}");
    }
}

/// Beside the scene, and nowhere else, two directions at the limit are mixed, whose shares change evenly and don't jump.
#[test]
fn a_lamp_beside_the_scene_is_a_mixture() {
    let note = |degrees: f64| mixture_note(towards(degrees, 33.0));
    let mut before = None;
    for half_degrees in 0..=360 {
        let degrees = f64::from(half_degrees) / 2.0;
        let found = cases(towards(degrees, 33.0));
        let behind: f64 = found.iter().filter(|(t, _)| t.z > 0.0).map(|(_, share)| share).sum();
        let all: f64 = found.iter().map(|(_, share)| share).sum();
        assert!((all - 1.0).abs() < 1e-12 && found.iter().all(|(_, share)| *share > 0.0), "{found:?}");
        let expected = ((degrees - 75.0) / 30.0).clamp(0.0, 1.0);
        assert!((behind - expected).abs() < 1e-9, "{degrees}: {found:?}");
        assert_eq!(found.len(), note(degrees).map_or(1, |_| 2), "{degrees}");
        for (direction, _) in &found {
            let used = direction.z.abs().acos().to_degrees();
            let asked = degrees.min(180.0 - degrees);
            assert!(direction.is_normalized() && (used - asked.min(75.0)).abs() < 1e-6, "{degrees}: {used}");
            assert!(direction.angle_between(towards(degrees, 33.0)).to_degrees() < 30.0 + 1e-6, "{degrees}");
        }
        assert!(before.replace(behind).is_none_or(|before| (behind - before).abs() < 0.5 / 30.0 + 1e-9));
    }
    assert!(note(90.0).unwrap().contains("75 degrees before the scene (50 %) and behind it (50 %)"));
    assert_eq!(cases(DVec3::Z).len() + cases(-DVec3::Z).len(), 2);
}

/// Tables and moments of a tilted cone against Monte Carlo of its directions through a slab; without a tilt they are
/// those of the upright cone.
#[test]
fn a_tilted_cone_matches_monte_carlo() {
    for (aperture_deg, tilt_deg) in [(20.0, 0.0), (20.0, 35.0), (25.0, 60.0), (60.0, 15.0), (0.0, 50.0)] {
        let towards = DVec3::new(f64::to_radians(tilt_deg).sin(), 0.0, f64::to_radians(tilt_deg).cos());
        let phase = Phase::Lamp { towards, aperture_deg };
        let decay = Decay::tilted(aperture_deg, tilt_deg);
        let mut random = Random::new(11, 3);
        for thickness in [0.1, 1.0, 3.0] {
            let far = DVec3::new(1e4, 1e4, 1.0);
            let slab = Shape::Box { min_mm: -far.with_z(0.0), max_mm: far };
            let medium = Shapes::one(slab, thickness, DVec3::ONE);
            let truth = visibility(&medium, DVec3::Z * -0.5, DVec3::Z, phase, 20_000, &mut random);
            let found = through_slice(&decay, 1.0, thickness).1;
            let (truth, error) = (truth.mean.x, truth.standard_error.x);
            assert!((found - truth).abs() < 4.0 * error + 5e-4, "{aperture_deg} {tilt_deg}: {found} {truth}");
        }
        let n = 40_000;
        let slopes: Vec<DVec3> =
            (0..n).map(|_| direction(phase, DVec3::Z, &mut random)).map(|d| d / d.z).collect();
        let mean = slopes.iter().sum::<DVec3>() / f64::from(n);
        let variance = slopes.iter().map(|s| (s - mean) * (s - mean)).sum::<DVec3>() / f64::from(n);
        let (slope, [along, across]) = tilted_moments(aperture_deg, tilt_deg);
        let near = |a: f64, b: f64| (a - b).abs() < 0.02 + 0.05 * b.abs();
        assert!(
            near(slope, mean.x) && near(along, variance.x) && near(across, variance.y),
            "{mean} {variance}"
        );
    }
    let upright = tangent_variance(50.0);
    let (slope, variances) = tilted_moments(50.0, 0.0);
    assert!(slope.abs() < 1e-12 && variances.iter().all(|v| (v - upright).abs() < 1e-3 * upright));
}

/// Where lines of sight are parallel a lamp at the eye is the eye's light, but for what interpolation blurs; where the lamp
/// stands has no effect on light from the eye.
#[test]
fn a_lamp_at_the_eye_is_the_eyes_light() {
    let scene = scene(false, true, Projection::Orthographic);
    let eye = lit(LightingMode::Slices);
    let elsewhere = Lamp { azimuth_deg: 60.0, elevation_deg: 10.0, ..Lamp::DEFAULT };
    let at_eye = Lamp { azimuth_deg: 0.0, elevation_deg: 0.0, ..Lamp::DEFAULT };
    let draw = |lamp: Lamp, towards_lamp: bool| {
        let lighting = LightSettings { lamp, towards_lamp, aperture_deg: 25.0, ..eye.lighting };
        // Shadows of depths on depths are the eye's alone.
        let quality = Quality { lighting: LightSettings { vicinity_mm: 0.0, ..lighting }, ..eye };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        renderer.render(&GPU, &scene, &quality, SIZE).unwrap().read_rgba(&GPU).unwrap()
    };
    let plain = draw(Lamp::DEFAULT, false);
    assert!(draw(elsewhere, false) == plain);
    let worst = |a: &[u8]| a.iter().zip(&plain).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    let (same, other) = (worst(&draw(at_eye, true)), worst(&draw(elsewhere, true)));
    println!("at the eye {same}, elsewhere {other}");
    assert!(same <= 4 && other > 20, "{same} {other}");
}

/// In soft tissue, from beside the eye to far aside: root mean square of linear radiance against Monte Carlo, and of the
/// light straight from the eye, which is what it would be without a lamp. Table in docs/studies.md.
#[test]
fn light_of_a_lamp_is_near_monte_carlo() {
    let size = [24, 22];
    let scene = scene(false, false, Projection::Perspective);
    for (azimuth_deg, elevation_deg, aperture_deg) in [
        (-20.0, 10.0, 40.0),
        (-45.0, 45.0, 20.0),
        (0.0, 70.0, 10.0),
        (150.0, 30.0, 20.0),
        (180.0, -10.0, 40.0),
        (90.0, 0.0, 10.0),
        (78.0, 0.0, 10.0),
    ] {
        let lamp = Lamp { azimuth_deg, elevation_deg, ..Lamp::DEFAULT };
        let phase = Phase::Lamp { towards: lamp.direction(&scene.camera), aperture_deg };
        let truth =
            monte_carlo::picture(&scene.medium().unwrap(), &scene.camera, size, phase, DVec3::ZERO, 1500, 5);
        let rms = |slice_mm: f64, towards_lamp: bool| {
            let lighting = LightSettings {
                aperture_deg,
                lamp,
                towards_lamp,
                slice_mm,
                ..lit(LightingMode::Slices).lighting
            };
            let quality = Quality { lighting, occlusion_strength: 1.0, ..Quality::FULL };
            let mut renderer = ContextRenderer::new(&GPU).unwrap();
            let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
            let found: Vec<[f64; 4]> = frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect();
            let (mut sum, mut noise, mut n) = (0.0, 0.0, 0.0);
            for (f, e) in found.iter().zip(&truth).filter(|(f, _)| f[3] > 0.01) {
                sum += (DVec3::new(f[0], f[1], f[2]) - e.mean).length_squared();
                noise += e.standard_error.length_squared();
                n += 3.0;
            }
            assert!(n > 300.0, "{n}");
            (f64::sqrt(sum / n), f64::sqrt(noise / n))
        };
        let errors = [4.0, 2.0, 1.0, 0.5].map(|slice_mm| rms(slice_mm, true));
        let without = rms(1.0, false);
        println!(
            "lamp {azimuth_deg},{elevation_deg}, aperture {aperture_deg}: {errors:.4?}; light from the eye {without:.4?}"
        );
        // From behind the eye sees the end of the light's way, and thick slices are as near.
        let is_finer_nearer = errors[2].0 < errors[0].0 || azimuth_deg.abs() > 90.0;
        assert!(errors[2].0 < 0.35 * without.0 && is_finer_nearer, "{errors:?} {without:?}");
    }
}

/// A lamp that turns about the scene, through the plane beside it: no frame differs there from the one before it by more than frames
/// do elsewhere. Without a mixture the lamp would be kept at 75 degrees and then change at once to 105.
#[test]
fn a_turning_lamp_does_not_pop_beside_the_scene() {
    let size = [36, 33];
    let step_deg = 1.5;
    for with_tumor in [false, true] {
        let scene = scene(false, with_tumor, Projection::Perspective);
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let mut drawn = |azimuth_deg: f64| -> Vec<f64> {
            let lighting = LightSettings {
                aperture_deg: 10.0,
                lamp: Lamp { azimuth_deg, elevation_deg: 0.0, ..Lamp::DEFAULT },
                towards_lamp: true,
                slice_mm: 1.0,
                ..lit(LightingMode::Slices).lighting
            };
            let quality = Quality { lighting, occlusion_strength: 1.0, ..Quality::FULL };
            let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
            frame.read_rgba(&GPU).unwrap().iter().map(|c| f64::from(*c) / 255.0).collect()
        };
        let change = |a: &[f64], b: &[f64]| {
            let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
            (squares.sum::<f64>() / a.len() as f64).sqrt()
        };
        let frames: Vec<(f64, Vec<f64>)> =
            (0..=60).map(|n| 45.0 + step_deg * f64::from(n)).map(|deg| (deg, drawn(deg))).collect();
        let most = |beside: bool| {
            let pairs =
                frames.windows(2).filter(|pair| ((pair[0].0 + step_deg / 2.0 - 90.0).abs() < 15.0) == beside);
            pairs.map(|pair| change(&pair[0].1, &pair[1].1)).fold(0.0, f64::max)
        };
        // What changing at once would show.
        let jump = change(&drawn(75.0), &drawn(105.0));
        println!(
            "tumour {with_tumor}: at most {:.5} beside the scene, {:.5} elsewhere; {jump:.5} at once",
            most(true),
            most(false)
        );
        assert!(most(true) <= most(false) && jump > 2.0 * most(false), "{} {}", most(true), most(false));
    }
}
