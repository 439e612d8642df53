use crate::Grid;
use glam::{DQuat, DVec2, DVec3};

use super::{
    camera::{Camera, Projection, Ray},
    hemisphere::{DepthScene, Weight, openness},
    march::{converged, march},
    medium::{Medium, Optics, Shape, Shapes},
    monte_carlo::{Phase, radiance, visibility},
    random::Random,
    volume::{Filter, OpticalVolume, Plane, Table},
};

/// A slab across z, from 0 down to −`depth`, and a ray onto it from above.
fn slab(extinction: f64, depth: f64) -> (Shapes, Ray) {
    let shape = Shape::Box { min_mm: DVec3::new(-1e7, -1e7, -depth), max_mm: DVec3::new(1e7, 1e7, 0.0) };
    let ray = Ray { origin_mm: DVec3::new(0.0, 0.0, 5.0), direction: -DVec3::Z };
    (Shapes::one(shape, extinction, DVec3::new(0.8, 0.5, 0.2)), ray)
}

/// Mean of `f(cos φ)` over the cone, uniform in solid angle, by a fine midpoint rule.
fn cone_mean(aperture_deg: f64, f: impl Fn(f64) -> f64) -> f64 {
    let least = aperture_deg.to_radians().cos();
    let n = 20_000;
    (0..n).map(|i| f(least + (1.0 - least) * (f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() / f64::from(n)
}

#[test]
fn slab_visibility_is_the_mean_transmittance_over_the_cone() {
    let (medium, _) = slab(0.1, 20.0);
    for (aperture_deg, known) in [(45.0, Some(0.308)), (80.0, Some(0.180)), (20.0, None)] {
        let truth = cone_mean(aperture_deg, |cos| (-1.0 / cos).exp());
        if let Some(known) = known {
            // By numeric quadrature outside this code.
            assert!((truth - known).abs() < 6e-4, "{aperture_deg}: {truth}");
        }
        let at = DVec3::new(0.0, 0.0, -10.0);
        let mut random = Random::new(1, 0);
        let e = visibility(&medium, at, DVec3::Z, Phase::Cone { aperture_deg }, 40_000, &mut random);
        assert!(e.standard_error.x > 0.0 && e.standard_error.x < 2e-3);
        assert!((e.mean.x - truth).abs() < 4.0 * e.standard_error.x, "{aperture_deg}: {e:?} {truth}");
    }
}

#[test]
fn uniform_on_the_disc_differs_from_uniform_in_solid_angle() {
    let (medium, _) = slab(0.1, 20.0);
    let at = DVec3::new(0.0, 0.0, -10.0);
    let tan2 = 80f64.to_radians().tan().powi(2);
    let n = 20_000;
    let truth =
        (0..n).map(|i| (-(1.0 + tan2 * (f64::from(i) + 0.5) / f64::from(n)).sqrt()).exp()).sum::<f64>()
            / f64::from(n);
    let disc = Phase::Disc { aperture_deg: 80.0 };
    let e = visibility(&medium, at, DVec3::Z, disc, 40_000, &mut Random::new(2, 0));
    assert!((e.mean.x - truth).abs() < 4.0 * e.standard_error.x, "{e:?} {truth}");
    assert!(truth < 0.1 && cone_mean(80.0, |cos| (-1.0 / cos).exp()) > 0.17);
}

#[test]
fn slab_radiance_has_its_closed_form() {
    for (extinction, depth) in [(0.1, 20.0), (1e6, 20.0)] {
        let (medium, ray) = slab(extinction, depth);
        let tau = extinction * depth;
        let truth = cone_mean(60.0, |cos| -(-tau * (1.0 + 1.0 / cos)).exp_m1() / (1.0 + 1.0 / cos));
        let background = DVec3::splat(0.3);
        let e = radiance(
            &medium,
            &ray,
            Phase::Cone { aperture_deg: 60.0 },
            background,
            40_000,
            &mut Random::new(3, 0),
        );
        let expected = DVec3::new(0.8, 0.5, 0.2) * truth + background * (-tau).exp();
        assert!(((e.mean - expected).abs().cmple(e.standard_error * 4.0 + 1e-12)).all(), "{e:?} {expected}");
    }
}

#[test]
fn an_opaque_slab_is_lit_as_a_surface() {
    let (medium, ray) = slab(f64::INFINITY, 20.0);
    let e =
        radiance(&medium, &ray, Phase::Cone { aperture_deg: 85.0 }, DVec3::ONE, 100, &mut Random::new(4, 0));
    assert_eq!(e.mean, DVec3::new(0.8, 0.5, 0.2));
    // An isotropic phase function loses the half of the light from below.
    let e = radiance(&medium, &ray, Phase::Isotropic, DVec3::ONE, 10_000, &mut Random::new(4, 1));
    assert!((e.mean.x - 0.4).abs() < 4.0 * e.standard_error.x, "{e:?}");
}

#[test]
fn isotropic_visibility_at_the_center_of_a_ball() {
    let ball = Shape::Ball { center_mm: DVec3::ONE, radius_mm: 4.0 };
    let medium = Shapes::one(ball, 0.2, DVec3::ONE);
    let e = visibility(&medium, DVec3::ONE, DVec3::Z, Phase::Isotropic, 64, &mut Random::new(5, 0));
    assert!((e.mean.x - (-0.8f64).exp()).abs() < 1e-12 && e.standard_error.x < 1e-12, "{e:?}");
}

/// An opaque ball in the cone occludes its own solid angle.
#[test]
fn an_opaque_ball_occludes_its_solid_angle() {
    let ball = Shape::Ball { center_mm: DVec3::new(0.0, 0.0, 10.0), radius_mm: 3.0 };
    let medium = Shapes::one(ball, f64::INFINITY, DVec3::ONE);
    let hidden = 1.0 - (1.0f64 - 0.09).sqrt();
    for aperture_deg in [30.0f64, 70.0] {
        let truth = 1.0 - hidden / (1.0 - aperture_deg.to_radians().cos());
        let phase = Phase::Cone { aperture_deg };
        let e = visibility(&medium, DVec3::ZERO, DVec3::Z, phase, 20_000, &mut Random::new(6, 0));
        assert!((e.mean.x - truth).abs() < 4.0 * e.standard_error.x, "{e:?} {truth}");
    }
}

#[test]
fn same_seed_gives_the_same_radiance() {
    let (medium, ray) = slab(0.1, 20.0);
    let run =
        |seed| radiance(&medium, &ray, Phase::Isotropic, DVec3::ZERO, 50, &mut Random::new(seed, 7)).mean;
    assert_eq!(run(9), run(9));
    assert_ne!(run(9), run(10));
}

#[test]
fn halving_the_step_converges_to_the_closed_form() {
    let (medium, ray) = slab(0.1, 20.0);
    let light = |at: DVec3| (0.05 * at.z).exp();
    let out = converged(&medium, &ray, 4.0, 1e-7, &light, DVec3::ONE);
    // ∫ 0.1 e^{-0.1 t} e^{-0.05 t} dt over 20 mm.
    let truth = 0.8 * (0.1 / 0.15) * (1.0 - (-3.0f64).exp()) + (-2.0f64).exp();
    assert!((out.radiance.x - truth).abs() < 1e-6, "{out:?} {truth}");
    assert!(out.change <= 1e-7 && (out.transmittance - (-2.0f64).exp()).abs() < 1e-12);
    let (coarse, _) = march(&medium, &ray, 4.0, &light, DVec3::ONE);
    assert!((coarse.x - truth).abs() > 1e-4, "a coarse step is measurably less accurate");
}

fn ramp_volume(filter: Filter, plane: Option<Plane>, offset_mm: f64) -> OpticalVolume {
    let origin = DVec3::new(-7.0, -6.0, offset_mm);
    let grid = Grid::axis_aligned([15, 13, 9], DVec3::new(1.0, 1.0, 2.0), origin).unwrap();
    let values = (0..grid.voxel_count()).map(|l| (l % 15) as f32).collect();
    let table = Table::new(0.0, 14.0, &[[0.5, 0.5, 0.5, 0.0], [0.5, 0.5, 0.5, 0.14]]).unwrap();
    OpticalVolume::new(grid, values, table, filter, plane).unwrap()
}

/// Extinction grows by 0.01 per voxel in x: along x its integral is that of a ramp.
#[test]
fn sampled_volumes_integrate_their_interpolant() {
    for offset_mm in [-8.0, 1e6] {
        let at = DVec3::new(-20.0, 0.1, offset_mm + 8.0);
        let along_x = Ray { origin_mm: at, direction: DVec3::X };
        let whole: f64 = (0..15).map(|i| 0.01 * f64::from(i)).sum();
        for filter in [Filter::Nearest, Filter::Linear] {
            let v = ramp_volume(filter, None, offset_mm);
            // The table is in single precision.
            assert!((v.thickness(&along_x, f64::INFINITY) - whole).abs() < 1e-7, "{filter:?}");
            let reach = v.reach_mm(&along_x, 0.5 * whole).unwrap();
            assert!((v.thickness(&along_x, reach) - 0.5 * whole).abs() < 1e-6, "{filter:?}");
            assert_eq!(v.reach_mm(&along_x, 2.0 * whole), None);
            // Cut at a voxel face: five voxels less.
            let plane = Plane { normal: DVec3::X, offset_mm: 2.5 };
            let cut = ramp_volume(filter, Some(plane), offset_mm).thickness(&along_x, f64::INFINITY);
            if filter == Filter::Nearest {
                let remaining: f64 = (0..10).map(|i| 0.01 * f64::from(i)).sum();
                assert!((cut - remaining).abs() < 1e-7, "{cut} {remaining}");
            } else {
                assert!(cut < 0.6 * whole);
            }
        }
    }
}

#[test]
fn oblique_rays_traverse_voxels_exactly() {
    let v = ramp_volume(Filter::Nearest, None, -8.0);
    let ray = Ray { origin_mm: DVec3::new(-9.3, -7.7, -10.2), direction: DVec3::new(2.0, 1.3, 1.7) };
    let ray = Ray { direction: ray.direction / ray.direction.length(), ..ray };
    let n = 400_000;
    let step = 40.0 / f64::from(n);
    let brute: f64 = (0..n)
        .map(|i| {
            v.optics(ray.origin_mm + ray.direction * ((f64::from(i) + 0.5) * step)).extinction_per_mm * step
        })
        .sum();
    assert!((v.thickness(&ray, f64::INFINITY) - brute).abs() < 1e-4, "{brute}");
}

#[test]
fn non_finite_values_are_counted_and_never_propagate() {
    let grid = Grid::axis_aligned([4, 4, 4], DVec3::ONE, DVec3::ZERO).unwrap();
    let mut values = vec![1.0f32; 64];
    values[21] = f32::NAN;
    values[22] = f32::INFINITY;
    let table = Table::new(0.0, 1.0, &[[0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, f32::INFINITY]]).unwrap();
    let v = OpticalVolume::new(grid, values, table, Filter::Linear, None).unwrap();
    assert_eq!(v.unknown_voxels(), 2);
    for i in 0..1000 {
        let at = DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 0.4 - 0.6;
        let Optics { extinction_per_mm, color } = v.optics(at);
        assert!(!extinction_per_mm.is_nan() && extinction_per_mm >= 0.0 && color.is_finite());
    }
    assert!(Table::new(0.0, 1.0, &[[0.0; 4], [0.0, 0.0, 0.0, f32::NAN]]).is_none());
    assert!(Table::new(0.0, 0.0, &[[0.0; 4]; 2]).is_none());
}

/// Closed forms: a plane occludes nothing, a wall through the point half, a ball its share of the hemisphere.
#[test]
fn hemisphere_closed_forms() {
    let mut random = Random::new(11, 0);
    let wall = |ray: &Ray, _: f64| ray.direction.x > 0.0;
    for weight in [Weight::Cosine, Weight::Uniform] {
        let (open, _) = openness(&|_, _| false, DVec3::ZERO, DVec3::Z, 10.0, weight, 100, &mut random);
        assert_eq!(open, 1.0);
        let (open, se) = openness(&wall, DVec3::ZERO, DVec3::Z, 10.0, weight, 20_000, &mut random);
        assert!((open - 0.5).abs() < 4.0 * se, "{open}");
    }
    // Form factor of a ball straight above: (r/h)² by the cosine, 1 − cos of its edge uniformly.
    let ball = Shape::Ball { center_mm: DVec3::Z * 10.0, radius_mm: 5.0 };
    let hidden = |ray: &Ray, reach: f64| ball.interval_mm(ray).is_some_and(|(near, _)| near < reach);
    for (weight, truth) in [(Weight::Cosine, 0.75), (Weight::Uniform, 0.75f64.sqrt())] {
        let (open, se) = openness(&hidden, DVec3::ZERO, DVec3::Z, 50.0, weight, 20_000, &mut random);
        assert!((open - truth).abs() < 4.0 * se, "{open} {truth}");
        let (open, _) = openness(&hidden, DVec3::ZERO, DVec3::Z, 4.9, weight, 1000, &mut random);
        assert_eq!(open, 1.0, "nothing occludes beyond the radius");
    }
}

#[test]
fn a_step_in_a_depth_buffer_occludes_its_lower_side() {
    let camera = Camera {
        focus_mm: DVec3::ZERO,
        world_from_camera: DQuat::IDENTITY,
        height_mm: 64.0,
        projection: Projection::Orthographic,
    };
    let far = camera.distance_mm();
    // The left half is 30 mm nearer: a wall 30 mm high at x = 0.
    let depths_mm = (0..64 * 64).map(|i| if i % 64 < 32 { far - 30.0 } else { far }).collect();
    let scene = DepthScene { camera, size: [64, 64], depths_mm, thickness_mm: 1e9 };
    let at = scene.point_mm([34, 32]).unwrap();
    let pixel = camera.project(at, DVec2::splat(64.0)).unwrap();
    assert!((pixel - DVec2::new(34.5, 32.5)).length() < 1e-9);
    let hidden = |ray: &Ray, reach: f64| scene.hidden(ray, reach, 0.25, 0.1);
    let mut random = Random::new(12, 0);
    let (open, se) = openness(&hidden, at, DVec3::Z, 20.0, Weight::Cosine, 4000, &mut random);
    // Brute force of the wall itself: it stands 2.5 mm off, within 20 mm.
    let wall = |ray: &Ray, reach: f64| {
        let t = -2.5 / ray.direction.x;
        t > 0.0 && t < reach
    };
    let (truth, _) = openness(&wall, at, DVec3::Z, 20.0, Weight::Cosine, 40_000, &mut random);
    assert!((open - truth).abs() < 4.0 * se + 0.01, "{open} {truth}");
    assert!(truth > 0.5 && truth < 0.7);
}
