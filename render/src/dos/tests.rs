use std::sync::{Arc, LazyLock};

use glam::{DQuat, DVec3};
use glioscope_core::Grid;

use super::{DosPlan, DosRenderer, DosSettings, Form, Kernel, Variant, twin};
use crate::{
    camera::{Camera, Projection},
    gpu::{Gpu, test_gpu},
    occlusion::{Filter, OpticalVolume, Plane, Sight, Table, cone},
    reference::medium::{Medium, Shape, Shapes},
    testing::noise,
};

pub(crate) static GPU: LazyLock<Gpu> = LazyLock::new(test_gpu);

/// Soft blobs on `n`³ voxels of 1 mm about the origin, as intensities with a transfer function.
pub(crate) fn soft(n: usize, origin_mm: DVec3, plane: Option<Plane>) -> OpticalVolume {
    let grid =
        Grid::axis_aligned([n; 3], DVec3::ONE, origin_mm - DVec3::splat((n as f64 - 1.0) / 2.0)).unwrap();
    let values = (0..n * n * n)
        .map(|l| {
            let p = [l % n, l / n % n, l / n / n];
            let at = DVec3::from_array(p.map(|v| v as f64)) / (n as f64 - 1.0) - 0.5;
            let ball = |c: DVec3, r: f64| (1.0 - (at - c).length() / r).max(0.0);
            let sum = ball(DVec3::new(-0.15, 0.05, 0.1), 0.32)
                + ball(DVec3::new(0.2, -0.1, 0.25), 0.2)
                + ball(DVec3::new(0.05, 0.1, -0.25), 0.4);
            (sum + 0.08 * (noise(p, 3) - 0.5) * f64::from(sum > 0.0)) as f32
        })
        .collect();
    let table = Table::new(
        0.0,
        0.8,
        &[
            [0.9, 0.5, 0.3, 0.0],
            [0.9, 0.5, 0.3, 0.0],
            [0.9, 0.6, 0.3, 0.12],
            [0.3, 0.7, 0.9, 0.35],
            [0.3, 0.7, 0.9, 0.6],
        ],
    );
    OpticalVolume::new(grid, values, table.unwrap(), Filter::Linear, plane).unwrap()
}

/// Two balls of labels, one half inside the other; the first extinction as given.
pub(crate) fn labels(n: usize, spacing_mm: DVec3, origin_mm: DVec3, extinction: f32) -> OpticalVolume {
    let corner = origin_mm - spacing_mm * ((n as f64 - 1.0) / 2.0);
    let grid = Grid::axis_aligned([n; 3], spacing_mm, corner).unwrap();
    let values = (0..n * n * n)
        .map(|l| {
            let at =
                DVec3::from_array([l % n, l / n % n, l / n / n].map(|v| v as f64)) / (n as f64 - 1.0) - 0.5;
            if at.distance(DVec3::new(0.1, 0.05, 0.2)) < 0.18 {
                2.0
            } else if at.distance(DVec3::new(-0.05, 0.0, -0.15)) < 0.3 {
                1.0
            } else {
                0.0
            }
        })
        .collect();
    let table = Table::of_labels(&[[0.0; 4], [0.8, 0.3, 0.2, extinction], [0.2, 0.7, 0.4, 0.5 * extinction]])
        .unwrap();
    OpticalVolume::new(grid, values, table, Filter::Nearest, None).unwrap()
}

pub(crate) fn camera(focus_mm: DVec3, radius_mm: f64, projection: Projection) -> Camera {
    Camera::fit(focus_mm, radius_mm, Camera::orientation(31.3, 19.7), projection)
}

pub(crate) fn settings(variant: Variant) -> DosSettings {
    DosSettings { variant, aperture_deg: 60.0, grid: 5, slice_mm: 1.0, reference_mm: 10.0 }
}

/// Largest difference between the device and the twin, and the picture.
fn against_twin(
    volume: OpticalVolume,
    camera: &Camera,
    size: [u32; 2],
    settings: &DosSettings,
    form: Form,
) -> f64 {
    let volume = Arc::new(volume);
    let mut renderer = DosRenderer::new(&GPU).unwrap();
    let plan = renderer.render(&GPU, &volume, camera, size, settings, form, false).unwrap();
    let found = renderer.read(&GPU).unwrap();
    let expected = twin::render(&*volume, &Sight::new(camera, size), &plan);
    assert_eq!(found.len(), expected.len());
    assert!(expected.iter().any(|e| e.transmittance < 0.9), "something is in the picture");
    found
        .iter()
        .zip(&expected)
        .map(|(f, e)| {
            assert!(f.iter().all(|v| v.is_finite()), "{f:?}");
            let e = e.radiance.extend(e.transmittance);
            (0..4).map(|i| (f64::from(f[i]) - e[i]).abs()).fold(0.0, f64::max)
        })
        .fold(0.0, f64::max)
}

const SIZE: [u32; 2] = [26, 24];

#[test]
fn device_and_twin_agree() {
    let plane = Plane { normal: DVec3::new(0.6, 0.64, 0.48), offset_mm: 6.3 };
    let mut worst = 0.0f64;
    let mut texels = std::collections::BTreeSet::new();
    for projection in [Projection::Perspective, Projection::Orthographic] {
        for variant in [Variant::PaperExact, Variant::PaperApproximate, Variant::Mended] {
            for (aperture_deg, grid, slice_mm) in [
                (50.0, 2, 0.9),
                (85.0, 2, 2.3),
                (85.0, 13, 2.3),
                (70.0, 5, 0.31),
                (70.0, 5, 1.2),
                (75.0, 13, 1.5),
            ] {
                let s = DosSettings { aperture_deg, grid, slice_mm, ..settings(variant) };
                let c = camera(DVec3::ZERO, 26.0, projection);
                let plane = (grid == 5).then_some(plane);
                let e = against_twin(soft(48, DVec3::ZERO, plane), &c, SIZE, &s, Form::OnePass);
                worst = worst.max(e);
                assert!(e <= 1e-3, "{variant:?} {projection:?} {aperture_deg} {grid} {slice_mm}: {e}");
                if variant != Variant::Mended && slice_mm < 2.0 {
                    let plan = DosRenderer::plan(&soft(48, DVec3::ZERO, plane), &c, SIZE, &s);
                    texels.extend(plan.steps.iter().map(|step| plan.texels(step)));
                    for folded in [false, true] {
                        let form = Form::TwoPasses { folded };
                        let two = against_twin(soft(48, DVec3::ZERO, plane), &c, SIZE, &s, form);
                        assert!(two <= 1e-3, "two passes: {two}");
                    }
                }
                let tiles = against_twin(soft(48, DVec3::ZERO, plane), &c, SIZE, &s, Form::Tiles(4));
                assert!(tiles <= 1e-3, "{variant:?} {grid} in tiles: {tiles}");
            }
        }
    }
    assert!([9, 25, 49].iter().all(|n| texels.contains(n)), "every folded footprint was met: {texels:?}");
    println!("largest difference from the twin: {worst:.2e}");
}

/// Several steps in workgroup memory, over tiles with a halo, are the steps one by one: also at the
/// picture's edges, at tiles' borders, and where only some steps may go together.
#[test]
fn steps_together_are_steps_one_by_one() {
    let size = [75, 61];
    let mut renderer = DosRenderer::new(&GPU).unwrap();
    let c = camera(DVec3::new(6.0, -4.0, 3.0), 20.0, Projection::Perspective);
    let volume = Arc::new(soft(48, DVec3::ZERO, None));
    for (variant, aperture_deg, grid, slice_mm) in [
        (Variant::PaperApproximate, 50.0, 5, 0.4),
        (Variant::PaperExact, 50.0, 3, 0.5),
        (Variant::PaperApproximate, 75.0, 13, 0.3),
        (Variant::Mended, 60.0, 3, 0.5),
        (Variant::Mended, 60.0, 2, 0.7),
    ] {
        let s = DosSettings { variant, aperture_deg, grid, slice_mm, ..settings(variant) };
        let mut draw = |form, skipping| {
            renderer.render(&GPU, &volume, &c, size, &s, form, skipping).unwrap();
            renderer.read(&GPU).unwrap()
        };
        let one = draw(Form::OnePass, false);
        assert!(one.iter().any(|p| p[3] < 0.5));
        for together in [2, 3, 8] {
            for skipping in [false, true] {
                let tiles = draw(Form::Tiles(together), skipping);
                let worst = one.iter().flatten().zip(tiles.iter().flatten());
                let worst = worst.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(worst <= 2e-6, "{variant:?} {grid}, {together} together: {worst}");
            }
        }
    }
}

#[test]
fn steps_go_together_where_their_footprints_allow() {
    use super::uniforms::{DosStep, Footing, Group};
    let near = Footing { reach: 1, rings: 1 };
    let wide = Footing { reach: 3, rings: 1 };
    let step = |footing: Footing| (<DosStep as bytemuck::Zeroable>::zeroed(), footing, footing.reach);
    let steps = |list: &[Footing]| list.iter().map(|f| step(*f)).collect::<Vec<_>>();
    let groups = Group::all(steps(&[near, near, near, wide, wide, wide, near]), 4);
    let sizes: Vec<(usize, u32)> = groups.iter().map(|g| (g.steps.len(), g.halo())).collect();
    // Three wide ones would read 9 pixels far: they don't fit.
    assert_eq!(sizes, [(3, 3), (2, 6), (1, 3), (1, 1)]);
    let margins: Vec<i32> = groups[0].steps.iter().map(|s| s.margin).collect();
    assert_eq!(margins, [2, 1, 0]);
    let far = Footing { reach: u32::MAX, rings: 1 };
    assert_eq!(Group::all(steps(&[far; 5]), 4).len(), 5);
    assert!(Group::all(steps(&[near; 5]), 1).iter().all(|g| g.steps.len() == 1));
    assert_eq!(Group::all(steps(&[near; 9]), 99).iter().map(|g| g.steps.len()).max(), Some(8));
}

#[test]
fn device_and_twin_agree_on_labels() {
    for extinction in [0.15, 3.0, f32::INFINITY] {
        for variant in [Variant::PaperApproximate, Variant::Mended] {
            let c = camera(DVec3::ZERO, 26.0, Projection::Perspective);
            let volume = labels(40, DVec3::ONE, DVec3::ZERO, extinction);
            let e = against_twin(volume, &c, SIZE, &settings(variant), Form::OnePass);
            assert!(e <= 1e-3, "{variant:?} {extinction}: {e}");
        }
    }
}

/// Lattices have the variance asked for, whatever it is, until their reach ends.
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

fn plan_for(medium: &dyn Medium, sight: &Sight, s: &DosSettings) -> DosPlan {
    let depths = sight.depths_mm(&medium.corners_mm());
    DosPlan::new(s, sight, depths, depths.as_slice())
}

/// A slab of any thickness, cut into slices of any distance, has its closed form in the mended
/// variant; the paper's depends on the slices and loses no light to the slant.
#[test]
fn a_slab_is_exact_when_mended() {
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
                let s = DosSettings { aperture_deg, slice_mm, ..settings(Variant::Mended) };
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
    // The paper's: light is not slanted, and a slice doesn't shade itself.
    let medium = Shapes::one(box_of(DVec3::new(1e4, 1e4, 10.0)), 0.05, DVec3::ONE);
    let s = DosSettings { aperture_deg: 80.0, slice_mm: 0.05, ..settings(Variant::PaperApproximate) };
    let eye = twin::render(&medium, &sight, &plan_for(&medium, &sight, &s))[5];
    assert!((eye.radiance.x - 0.5 * (1.0 - (-2.0f64).exp())).abs() < 2e-3, "as if every path went straight");
    assert!(cone::slab_visibility(80.0, 1.0) < 0.181 && (-1f64).exp() > 0.36);
}

/// Width (standard deviation, mm) of the penumbra that an opaque half plane leaves `gap` mm behind it.
fn penumbra_mm(variant: Variant, slice_mm: f64, gap: f64, reference_mm: f64) -> f64 {
    // Pixels of a quarter millimetre: what bilinear sampling adds is small then.
    let size = [1200, 1];
    let sight = Sight::new(&down_z(0.25, Projection::Orthographic), size);
    let edge = Shape::Box { min_mm: DVec3::new(-1e4, -1e4, gap), max_mm: DVec3::new(0.0, 1e4, gap + 5.0) };
    let floor = Shape::Box { min_mm: DVec3::new(-1e4, -1e4, -60.0), max_mm: DVec3::new(1e4, 1e4, 0.0) };
    let medium = Shapes::one(edge, f64::INFINITY, DVec3::ZERO);
    let optics = crate::reference::medium::Optics { extinction_per_mm: f64::INFINITY, color: DVec3::ONE };
    let medium = Shapes(vec![medium.0[0], (floor, optics)]);
    let depths = Some((sight.depth_mm(DVec3::Z * (gap + 5.0)), sight.depth_mm(DVec3::Z * -1.0)));
    let s = DosSettings { aperture_deg: 45.0, grid: 13, slice_mm, reference_mm, variant };
    let plan = DosPlan::new(&s, &sight, depths, depths.as_slice());
    // The light that arrives at the floor: occlusion itself, not what the eye sees of it.
    let eyes = twin::light_behind(&medium, &sight, &plan, gap + 5.0);
    let slope: Vec<f64> = eyes.windows(2).map(|w| w[1] - w[0]).collect();
    let sum: f64 = slope.iter().sum();
    let mean = slope.iter().enumerate().map(|(i, s)| i as f64 * s).sum::<f64>() / sum;
    (slope.iter().enumerate().map(|(i, s)| (i as f64 - mean).powi(2) * s).sum::<f64>() / sum).sqrt() * 0.25
}

/// algorithms.md 6: at 45° and L = 50 mm the paper's penumbra is 7.9 mm with 10 slices, 3.5 with 50.
#[test]
fn the_paper_s_penumbra_drifts_and_the_mended_one_rests() {
    let paper: Vec<f64> =
        [5.0, 2.5, 1.25].iter().map(|d| penumbra_mm(Variant::PaperApproximate, *d, 50.0, 0.0)).collect();
    println!("paper: {paper:?}");
    assert!((paper[0] - 7.9).abs() < 0.6, "{paper:?}");
    for pair in paper.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((1.3..1.5).contains(&ratio), "falls by the root of two a halving: {paper:?}");
    }
    let mended: Vec<f64> =
        [5.0, 2.5, 1.25, 0.625].iter().map(|d| penumbra_mm(Variant::Mended, *d, 50.0, 50.0)).collect();
    println!("mended: {mended:?}");
    // The true cone's, uniform in solid angle: L·√((1/cos θ − 1)/2).
    let truth = 50.0 * cone::tangent_variance(45.0).sqrt();
    for m in &mended {
        assert!((m / truth - 1.0).abs() < 0.06, "{mended:?} {truth}");
    }
}

/// Offsets and sizes of every struct of the uniforms, from naga's reflection.
#[test]
fn uniforms_are_laid_out_as_the_shaders_read_them() {
    use crate::{cones, occlusion::upload::Optical};
    use std::mem::offset_of;
    macro_rules! offsets {
        ($t:ty: $($field:ident),*) => {
            (size_of::<$t>(), vec![$((stringify!($field), offset_of!($t, $field))),*])
        };
    }
    let known = [
        (
            "Optical",
            offsets!(Optical: corner, pixel_mm, right, pixel_mm_per_mm, up, table_scale, forward, table_offset,
                plane, dims, table_last, bricks, nearest, size, skipping, pad),
        ),
        ("Dos", offsets!(super::uniforms::Dos: slice_mm, pad, tiles, decay)),
        (
            "Step",
            offsets!(super::uniforms::DosStep: depth, slices, side, stride, center, radius, radius_mm, share,
                is_empty, states, stops, together, halo, margin, pad0, pad1, folded),
        ),
        ("Level", offsets!(cones::renderer::LevelInfo: dims, start, scale, pad)),
        (
            "Cones",
            offsets!(cones::renderer::Cones: tangent, ray_step, cone_step, coarsest, voxel_mm, count, dark, pad,
                levels, decay),
        ),
        ("Share", offsets!(cones::renderer::Share: begin, end, first_axis, end_axis, advances)),
    ];
    let mut seen = 0;
    for name in ["dos_step", "dos_tiles", "dos_rows", "dos_eye", "dos_occlusion", "cones_trace"] {
        let module = naga::front::wgsl::parse_str(&glioscope_shaders::compose(name).unwrap()).unwrap();
        for (_, ty) in module.types.iter() {
            let naga::TypeInner::Struct { members, span } = &ty.inner else { continue };
            let Some((_, (size, fields))) = known.iter().find(|k| Some(k.0) == ty.name.as_deref()) else {
                continue;
            };
            seen += 1;
            assert_eq!(*span as usize, *size, "{name}: {:?}", ty.name);
            for (field, offset) in fields {
                let member = members.iter().find(|m| m.name.as_deref() == Some(*field));
                assert_eq!(member.map(|m| m.offset as usize), Some(*offset), "{name}: {:?}.{field}", ty.name);
            }
        }
    }
    assert_eq!(seen, 5 * 3 + 4);
}
