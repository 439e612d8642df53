use glam::{DQuat, DVec3};
use glioscope_core::optics::{
    Camera, Projection, Sight, cone,
    medium::{Medium, Optics, Shape, Shapes},
};

use super::{
    medium_twin as twin,
    plan::{Kernel, SlicePlan, SliceSettings},
};
use crate::scene::SliceVariant;

fn settings(variant: SliceVariant) -> SliceSettings {
    SliceSettings { variant, aperture_deg: 60.0, grid: 5, slice_mm: 1.0, reference_mm: 10.0, lamp: None }
}

/// Lattices have any requested variance, up to the maximum reach.
#[test]
fn lattices_have_their_variance() {
    for grid in 2..=13 {
        for v in [1e-6, 0.01, 0.25, 0.7, 3.0, 20.0, 150.0] {
            let k = Kernel::lattice(grid, v);
            assert!((k.variance_px2() - v).abs() < 1e-9 * v, "{grid} {v} {k:?}");
            let Kernel::Lattice { side, stride_px, center } = k else { panic!("{k:?}") };
            assert!(side <= grid && (0.0..1.0).contains(&center) && k.reach_px() <= 64);
            assert!(side % 2 == 1 || stride_px % 2 == 0, "whole pixels");
        }
        assert!(Kernel::lattice(grid, 1e12).reach_px() <= 64);
    }
    assert_eq!(Kernel::lattice(1, 4.0).variance_px2(), 0.0);
}

fn down_z(height_mm: f64, projection: Projection) -> Camera {
    Camera { focus_mm: DVec3::ZERO, world_from_camera: DQuat::IDENTITY, height_mm, projection }
}

fn box_of(half: DVec3) -> Shape {
    Shape::Box { min_mm: -half, max_mm: half }
}

fn plan_for(medium: &dyn Medium, sight: &Sight, s: &SliceSettings) -> SlicePlan {
    let depths = sight.depths_mm(&medium.corners_mm());
    SlicePlan::new(s, sight, depths, depths.as_slice())
}

/// In the mended variant a slab of any thickness and slice distance has its closed form; the paper's
/// variant depends on the slices and attenuates slanted paths like straight ones.
#[test]
fn mended_slab_matches_its_closed_form() {
    let sight = Sight::new(&down_z(20.0, Projection::Orthographic), [4, 4]);
    for aperture_deg in [0.0f64, 45.0, 80.0] {
        for extinction in [0.05, 0.5, 1e6] {
            let medium = Shapes::one(box_of(DVec3::new(1e4, 1e4, 10.0)), extinction, DVec3::ONE);
            let tau = 20.0 * extinction;
            let least = aperture_deg.to_radians().cos();
            let truth = (0..4096)
                .map(|i| least + (1.0 - least) * (f64::from(i) + 0.5) / 4096.0)
                .map(|c| -(-tau * (1.0 + 1.0 / c)).exp_m1() / (1.0 + 1.0 / c))
                .sum::<f64>()
                / 4096.0;
            for slice_mm in [20.0, 1.0, 0.05] {
                let s = SliceSettings { aperture_deg, slice_mm, ..settings(SliceVariant::Mended) };
                let eye = twin::render(&medium, &sight, &plan_for(&medium, &sight, &s))[5];
                assert!(
                    (eye.radiance.x - truth).abs() < 2e-3,
                    "{aperture_deg} {extinction} {slice_mm}: {} {truth}",
                    eye.radiance.x
                );
                assert!((eye.transmittance - (-tau).exp()).abs() < 1e-9);
            }
        }
    }
    // The paper's: slanted paths aren't longer, and a slice doesn't shade itself.
    let medium = Shapes::one(box_of(DVec3::new(1e4, 1e4, 10.0)), 0.05, DVec3::ONE);
    let s = SliceSettings { aperture_deg: 80.0, slice_mm: 0.05, ..settings(SliceVariant::PaperApproximate) };
    let eye = twin::render(&medium, &sight, &plan_for(&medium, &sight, &s))[5];
    assert!((eye.radiance.x - 0.5 * (1.0 - (-2.0f64).exp())).abs() < 2e-3, "as if every path were straight");
    assert!(cone::slab_visibility(80.0, 1.0) < 0.181 && (-1f64).exp() > 0.36);
}

/// Width (standard deviation, mm) of the penumbra `gap` mm behind an opaque half plane.
fn penumbra_mm(variant: SliceVariant, slice_mm: f64, gap: f64, reference_mm: f64) -> f64 {
    // Pixels of a quarter millimetre, so that the blur of bilinear sampling is small.
    let size = [1200, 1];
    let sight = Sight::new(&down_z(0.25, Projection::Orthographic), size);
    let edge = Shape::Box { min_mm: DVec3::new(-1e4, -1e4, gap), max_mm: DVec3::new(0.0, 1e4, gap + 5.0) };
    let floor = Shape::Box { min_mm: DVec3::new(-1e4, -1e4, -60.0), max_mm: DVec3::new(1e4, 1e4, 0.0) };
    let medium = Shapes::one(edge, f64::INFINITY, DVec3::ZERO);
    let optics = Optics { extinction_per_mm: f64::INFINITY, color: DVec3::ONE };
    let medium = Shapes(vec![medium.0[0], (floor, optics)]);
    let depths = Some((sight.depth_mm(DVec3::Z * (gap + 5.0)), sight.depth_mm(DVec3::Z * -1.0)));
    let s = SliceSettings { aperture_deg: 45.0, grid: 13, slice_mm, reference_mm, variant, lamp: None };
    let plan = SlicePlan::new(&s, &sight, depths, depths.as_slice());
    // The light that arrives at the floor, not the radiance seen by the eye.
    let light = twin::light_behind(&medium, &sight, &plan, gap + 5.0);
    let slope: Vec<f64> = light.windows(2).map(|w| w[1] - w[0]).collect();
    let sum: f64 = slope.iter().sum();
    let mean = slope.iter().enumerate().map(|(i, s)| i as f64 * s).sum::<f64>() / sum;
    (slope.iter().enumerate().map(|(i, s)| (i as f64 - mean).powi(2) * s).sum::<f64>() / sum).sqrt() * 0.25
}

/// By hand, from the variance of the footprint: at 45° and L = 50 mm the paper's penumbra is 7.9 mm with 10 slices, 3.5 with 50.
#[test]
fn paper_penumbra_depends_on_slice_distance_the_mended_one_does_not() {
    let paper: Vec<f64> =
        [5.0, 2.5, 1.25].iter().map(|d| penumbra_mm(SliceVariant::PaperApproximate, *d, 50.0, 0.0)).collect();
    println!("paper: {paper:?}");
    assert!((paper[0] - 7.9).abs() < 0.6, "{paper:?}");
    for pair in paper.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((1.3..1.5).contains(&ratio), "falls by the square root of two per halving: {paper:?}");
    }
    let mended: Vec<f64> =
        [5.0, 2.5, 1.25, 0.625].iter().map(|d| penumbra_mm(SliceVariant::Mended, *d, 50.0, 50.0)).collect();
    println!("mended: {mended:?}");
    // The true cone's, uniform in solid angle: L·√((1/cos θ − 1)/2).
    let truth = 50.0 * cone::tangent_variance(45.0).sqrt();
    for m in &mended {
        assert!((m / truth - 1.0).abs() < 0.06, "{mended:?} {truth}");
    }
}
