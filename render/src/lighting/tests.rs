//! Light of the views on Mesa's software adapter, held against twins in `f64` and against Monte Carlo.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{Grid, Samples, Scaling, Selection, Volume};

use super::{vicinity::slope, *};
use crate::{
    ClipPlane, ContextRenderer, ContextScene, ControlPoint, GradientPoint, MaskColors, Palette, Projection,
    Renderer, TransferFunction,
    context::{Field, context_plan},
    dos::DosPlan,
    dos::tests::GPU,
    occlusion::{Filter, OpticalVolume, Sight, Table, poisson::poisson_disc},
    reference::{
        combined,
        monte_carlo::{self, Estimate, Phase},
        vicinity,
    },
    testing::{noise, volume},
    uniforms::FAR,
};

const SIZE: [u32; 2] = [44, 36];

pub(super) fn lit(shading: Shading) -> Quality {
    Quality { lighting: Lighting { shading, ..Lighting::DEFAULT }, ..Quality::FULL }
}

/// Soft lumps inside a ball, nothing at the image's faces.
pub(super) fn lumps(grid: &Grid) -> Arc<ContextVolume> {
    let dims = grid.dims();
    let values = (0..grid.voxel_count())
        .map(|l| {
            let p = [l % dims[0], l / dims[0] % dims[1], l / dims[0] / dims[1]];
            let x = DVec3::from_array(std::array::from_fn(|a| (p[a] as f64 + 0.5) / dims[a] as f64 - 0.5));
            let wave = (x.x * 17.0).sin() + (x.y * 13.0 + 1.0).sin() + (x.z * 11.0 + 2.0).sin();
            (55.0 + 12.0 * wave + 4.0 * noise(p, 5)) * ((0.45 - x.length()) * 6.0).clamp(0.0, 1.0)
        })
        .collect();
    image_of(grid, values)
}

pub(super) fn image_of(grid: &Grid, values: Vec<f64>) -> Arc<ContextVolume> {
    let image = Volume::new(grid.clone(), Samples::F64(values), Scaling::NONE).unwrap();
    Arc::new(ContextVolume::new(Arc::new(image)))
}

pub(super) fn transfer(two_d: bool, opacity: f64) -> Arc<TransferFunction> {
    let rows =
        [(15.0, [90, 60, 40], 0.0), (50.0, [220, 160, 120], 0.5 * opacity), (90.0, [255, 250, 230], opacity)];
    let points = rows.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect();
    let gradient = two_d.then(|| {
        [(1.0, 0.2), (6.0, 0.6), (12.0, 1.0)]
            .map(|(gradient, factor)| GradientPoint { gradient, factor })
            .to_vec()
    });
    Arc::new(TransferFunction::new(points, gradient).unwrap())
}

pub(super) fn cubic(n: usize, spacing_mm: DVec3) -> Grid {
    Grid::axis_aligned([n; 3], spacing_mm, -spacing_mm * (n as f64 - 1.0) / 2.0).unwrap()
}

/// An image with a frayed ball of a tumour in its middle.
pub(super) fn scene(two_d: bool, with_tumor: bool, projection: Projection) -> ContextScene {
    let grid = cubic(36, DVec3::ONE);
    let tumor_grid = Grid::axis_aligned([11; 3], DVec3::splat(0.9), DVec3::new(-5.0, -3.0, -4.5)).unwrap();
    let tumor = with_tumor.then(|| {
        volume(&tumor_grid, 1, |_, p| {
            p.iter().map(|&c| (c as f64 - 5.0).powi(2)).sum::<f64>().sqrt() + 1.5 * noise(p, 4) < 5.0
        })
    });
    ContextScene {
        camera: Camera::fit(DVec3::ZERO, 22.0, Camera::orientation(31.3, 19.7), projection),
        volume: Some(lumps(&grid)),
        transfer: transfer(two_d, if two_d { 0.9 } else { 0.35 }),
        clip: Vec::new(),
        tumor: tumor.flatten(),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 1]),
        lens: None,
        tubes: Vec::new(),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

struct Drawn {
    eye: Vec<[f32; 4]>,
    depths: Vec<f32>,
    notes: Vec<[f32; 2]>,
}

fn drawn(scene: &ContextScene, quality: &Quality, size: [u32; 2]) -> Drawn {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, scene, quality, size).unwrap();
    let depths = if frame.plan.has(PassName::Surface) {
        frame.read_depths(&GPU)
    } else {
        vec![FAR; (size[0] * size[1]) as usize]
    };
    let read = |buffer: &wgpu::Buffer| GPU.read_buffers(&[(buffer, 0, buffer.size())]).unwrap().remove(0);
    let lights = renderer.lights();
    let (eye, notes) = (read(lights.eye().unwrap()), read(lights.notes().unwrap()));
    let out = Drawn {
        eye: bytemuck::pod_collect_to_vec(&eye),
        depths,
        notes: bytemuck::pod_collect_to_vec(&notes),
    };
    assert!(out.eye.iter().flatten().all(|v| v.is_finite()), "a number in every pixel");
    out
}

/// Largest difference of radiance, transmittance and light on what is solid from the twin.
fn off_twin(scene: &ContextScene, lighting: Lighting) -> f64 {
    let quality = Quality { lighting, ..Quality::FULL };
    let found = drawn(scene, &quality, SIZE);
    let sight = Sight::new(&scene.camera, SIZE);
    let gpu_image = ImageBuffers::keep(&mut None, &GPU, scene.volume.as_ref().unwrap(), &scene.transfer)
        .unwrap()
        .depths_mm(&sight);
    let settings = lighting.slice_settings();
    let whole = Some((gpu_image[0].0, gpu_image.last().unwrap().1));
    let plan = DosPlan::new(&settings, &sight, whole, &gpu_image);
    let reference_mm = scene.reference_mm();
    let solid: Vec<f64> = found
        .depths
        .iter()
        .map(|d| if *d < FAR { f64::from(*d) + reference_mm } else { f64::INFINITY })
        .collect();
    let twin = combined::slices(scene, &sight, &plan, &solid, &lighting.mutual, quality.occlusion_strength);
    let mut worst = 0.0f64;
    let mut dark = 0;
    for (i, expected) in twin.iter().enumerate() {
        let e = expected.eye.radiance.extend(expected.eye.transmittance);
        for c in 0..4 {
            worst = worst.max((f64::from(found.eye[i][c]) - e[c]).abs());
        }
        if solid[i].is_finite() {
            worst = worst.max((f64::from(found.notes[i][0]) - expected.on_solid).abs());
            dark += usize::from(expected.on_solid < 0.8);
        }
    }
    assert!(twin.iter().filter(|t| t.eye.transmittance < 0.8).count() > 100, "an image in the picture");
    assert!(scene.tumor.is_none() || dark > 5, "the image darkens {dark} pixels of the tumour");
    worst
}

#[test]
fn slices_of_a_view_are_their_twin() {
    let mut worst = 0.0f64;
    for (two_d, with_tumor, projection) in [
        (false, false, Projection::Perspective),
        (false, true, Projection::Perspective),
        (true, true, Projection::Orthographic),
    ] {
        let mut scene = scene(two_d, with_tumor, projection);
        for variant in [Variant::PaperExact, Variant::PaperApproximate, Variant::Mended] {
            for (aperture_deg, slice_grid, slice_mm) in [(50.0, 2, 0.9), (80.0, 5, 2.1)] {
                scene.clip = if slice_grid == 5 {
                    vec![ClipPlane { normal: DVec3::new(0.3, -0.8, 0.5), offset_mm: 5.0 }]
                } else {
                    Vec::new()
                };
                let lighting = Lighting {
                    shading: Shading::Slices,
                    variant,
                    aperture_deg,
                    slice_grid,
                    slice_mm,
                    ..Lighting::DEFAULT
                };
                let off = off_twin(&scene, lighting);
                println!("{two_d} {with_tumor} {projection:?} {variant:?} {slice_grid}: {off:.2e}");
                worst = worst.max(off);
            }
        }
    }
    assert!(worst <= 1e-3, "{worst}");
}

#[test]
fn mutual_occlusions_one_by_one_are_their_twin() {
    let scene = scene(false, true, Projection::Perspective);
    for (image_on_image, solid_on_image) in [(false, false), (true, false), (false, true)] {
        for variant in [Variant::PaperApproximate, Variant::Mended] {
            let mutual = Mutual { image_on_image, solid_on_image, ..Mutual::ALL };
            let lighting = Lighting { shading: Shading::Slices, variant, mutual, ..Lighting::DEFAULT };
            let off = off_twin(&scene, lighting);
            assert!(off <= 1e-3, "{mutual:?} {variant:?}: {off}");
        }
    }
}

/// The image as a medium of its own.
fn medium(scene: &ContextScene) -> OpticalVolume {
    let volume = scene.volume.as_ref().unwrap();
    let field = Field::fitting(volume, 1 << 30).unwrap();
    let buffers = ImageBuffers::keep(&mut None, &GPU, volume, &scene.transfer).unwrap().tables().clone();
    let (scale, offset) = buffers.color_place;
    let entries: Vec<[f32; 4]> = buffers
        .colors
        .iter()
        .map(|[r, g, b, a]| {
            let linear = |c: f32| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
            [linear(*r), linear(*g), linear(*b), -(1.0 - a).max(1e-30).ln()]
        })
        .collect();
    let last = (entries.len() - 1) as f64;
    let table = Table::new((-offset / scale) as f32, ((last - offset) / scale) as f32, &entries).unwrap();
    OpticalVolume::new(field.grid, field.values, table, Filter::Linear, None).unwrap()
}

/// Root mean square, over pixels that anything is in, of the error and of the standard error.
fn errors(found: &[[f64; 4]], truth: &[Estimate]) -> (f64, f64) {
    let (mut error, mut se, mut n) = (0.0, 0.0, 0.0);
    for (f, e) in found.iter().zip(truth).filter(|(f, _)| f[3] > 0.01) {
        for (c, value) in f.iter().enumerate().take(3) {
            error += (value - e.mean[c]).powi(2);
            se += e.standard_error[c].powi(2);
            n += 1.0;
        }
    }
    assert!(n > 80.0, "{n}");
    ((error / n).sqrt(), (se / n).sqrt())
}

/// With more sub-cones, finer levels and smaller cells the view's error falls, to within two standard
/// errors of Monte Carlo.
#[test]
fn cones_of_a_view_come_to_monte_carlo() {
    let size = [12, 11];
    let scene = scene(false, false, Projection::Perspective);
    let aperture_deg = 60.0;
    let phase = Phase::Cone { aperture_deg };
    let truth = monte_carlo::picture(&medium(&scene), &scene.camera, size, phase, DVec3::ZERO, 3000, 7);
    let base = Lighting { shading: Shading::Cones, aperture_deg, ..Lighting::DEFAULT };
    let coarse = Lighting { sub_cones: 1, cell_mm: 8.0, coarsest_level: 4, ..base };
    let middle = Lighting { sub_cones: 8, cell_mm: 3.0, ..base };
    let fine = Lighting { sub_cones: 128, cell_mm: 0.5, coarsest_level: 0, cone_step: 0.5, ..base };
    let results = [coarse, middle, fine].map(|lighting| {
        let quality = Quality { lighting, occlusion_strength: 1.0, context_step_mm: 0.2, ..Quality::FULL };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
        let found: Vec<[f64; 4]> = frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect();
        errors(&found, &truth)
    });
    println!("view by cones: {results:?}");
    assert!(results[0].0 > results[1].0 && results[1].0 > results[2].0, "{results:?}");
    assert!(results[2].0 <= 2.0 * results[2].1, "{results:?}");
}

/// Light on the masks alone, in the closeup: against Monte Carlo of opaque labels.
#[test]
fn cones_on_masks_come_to_monte_carlo() {
    let size = [26, 24];
    let grid = cubic(20, DVec3::new(1.0, 1.0, 1.5));
    let inside = |p: [usize; 3]| {
        let at = DVec3::from_array(p.map(|c| c as f64 - 9.5));
        (at - DVec3::new(-2.0, 0.0, 0.0)).length() < 6.2 || (at - DVec3::new(4.0, 3.0, 3.0)).length() < 4.0
    };
    let tumor = volume(&grid, 1, |_, p| inside(p)).unwrap();
    let mut scene = crate::testing::scene_of(tumor, 1, None);
    scene.camera.height_mm *= 0.6;
    let values = (0..grid.voxel_count())
        .map(|l| f32::from(u8::from(inside([l % 20, l / 20 % 20, l / 400]))))
        .collect();
    let table = Table::of_labels(&[[0.0; 4], [1.0, 1.0, 1.0, f32::INFINITY]]).unwrap();
    let labels = OpticalVolume::new(grid, values, table, Filter::Nearest, None).unwrap();
    let aperture_deg = 70.0;
    let phase = Phase::Cone { aperture_deg };
    let truth = monte_carlo::picture(&labels, &scene.camera, size, phase, DVec3::ZERO, 1500, 3);
    let errors = [(1, 3, 1.0), (16, 2, 1.0), (128, 0, 1.0)].map(|(sub_cones, coarsest_level, cone_step)| {
        let lighting = Lighting {
            shading: Shading::Cones,
            aperture_deg,
            sub_cones,
            coarsest_level,
            cone_step,
            ..Lighting::DEFAULT
        };
        let quality = Quality { lighting, ..Quality::FULL };
        let mut renderer = Renderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
        let blurred = frame.read_blurred(&GPU);
        let (mut sum, mut se, mut n) = (0.0, 0.0, 0);
        // Where the pixel's ray hits the surface, all of it.
        for (dark, e) in blurred.iter().zip(&truth).filter(|(_, e)| e.mean.x > 0.0) {
            let encoded = 1.0 - f64::from(dark >> 24) / 255.0;
            let light =
                if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
            sum += (light - e.mean.x).powi(2);
            se += e.standard_error.x.powi(2);
            n += 1;
        }
        assert!(n > 100, "{n}");
        ((sum / f64::from(n)).sqrt(), (se / f64::from(n)).sqrt())
    });
    println!("masks by cones: {errors:?}");
    assert!(errors[0].0 > errors[1].0 && errors[1].0 > errors[2].0, "{errors:?}");
    // And what 8 bits round to.
    assert!(errors[2].0 <= 2.0 * errors[2].1 + 0.004, "{errors:?}");
}

/// Plans of the slices and the cones: what is left out, why, and that it changes no pixel.
#[test]
fn what_light_does_not_need_changes_no_pixel() {
    let whole = scene(true, true, Projection::Perspective);
    let names = |scene: &ContextScene, quality: &Quality| {
        context_plan(scene, quality).omitted.iter().map(|(p, r)| (p.name(), *r)).collect::<Vec<_>>()
    };
    let slices = lit(Shading::Slices);
    let cones = lit(Shading::Cones);
    let bits = |scene: &ContextScene, quality: &Quality| {
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        // Something else in every buffer first.
        renderer.render(&GPU, &whole, quality, SIZE).unwrap();
        renderer.render(&GPU, scene, quality, SIZE).unwrap().read_rgba(&GPU).unwrap()
    };
    // An opaque foreground without context needs no slices and no grid: as with an image of which the
    // transfer function shows so little that no light is lost.
    let alone = ContextScene { volume: None, ..whole.clone() };
    for (quality, pass) in [(&slices, "slices"), (&cones, "light_grid")] {
        assert!(names(&alone, quality).contains(&(pass, "no context image")));
        let points = [(1e6, [0; 3], 0.0), (2e6, [255; 3], 1e-9)]
            .map(|(value, color, opacity)| ControlPoint { value, color, opacity });
        let far = Arc::new(TransferFunction::new(points.to_vec(), None).unwrap());
        let unseen = ContextScene { transfer: far, ..whole.clone() };
        let plan = context_plan(&unseen, quality);
        assert!(plan.passes.iter().any(|p| p.name() == pass), "{plan:?}");
        let (a, b) = (bits(&alone, quality), bits(&unseen, quality));
        let other: Vec<_> = (0..a.len()).filter(|&i| a[i] != b[i]).map(|i| (i / 4, a[i], b[i])).collect();
        assert!(other.is_empty(), "{pass}: {} {:?}", other.len(), other.first());
    }
    // Without anything solid no vicinity, no cones on solids: as with a selection of nothing.
    let no_masks = ContextScene { tumor: None, ..whole.clone() };
    assert!(names(&no_masks, &slices).contains(&("vicinity", "no mask is active")));
    assert!(names(&no_masks, &cones).contains(&("solid_cones", "no mask is active")));
    // A 1-D transfer function needs no gradients: as a 2-D one whose factor is 1 everywhere.
    let flat: Vec<GradientPoint> =
        [0.0, 1e6].map(|gradient| GradientPoint { gradient, factor: 1.0 }).to_vec();
    let points = whole.transfer.points().to_vec();
    let one_d = Arc::new(TransferFunction::new(points.clone(), None).unwrap());
    let two_d = Arc::new(TransferFunction::new(points, Some(flat)).unwrap());
    for quality in [&slices, &cones] {
        let plain = ContextScene { transfer: Arc::clone(&one_d), ..whole.clone() };
        let with = ContextScene { transfer: Arc::clone(&two_d), ..whole.clone() };
        assert!(names(&plain, quality).contains(&("gradient_opacity", "transfer function is 1-D")));
        assert!(context_plan(&with, quality).has(PassName::GradientOpacity));
        assert!(bits(&plain, quality) == bits(&with, quality), "{:?}", quality.lighting.shading);
    }
}

/// Without anything solid the picture has one light; with something solid that hides nothing it has two.
#[test]
fn something_solid_out_of_the_way_changes_no_pixel_of_the_image() {
    let alone = scene(false, false, Projection::Perspective);
    let quality = lit(Shading::Slices);
    let bits = |scene: &ContextScene, quality: &Quality| {
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        renderer.render(&GPU, scene, quality, SIZE).unwrap().read_rgba(&GPU).unwrap()
    };
    let image = bits(&alone, &quality);
    // A tumour behind the camera.
    let mut behind = alone.clone();
    let eye = alone.camera.eye_mm() + alone.camera.axes()[2] * 60.0;
    let grid = Grid::axis_aligned([3; 3], DVec3::ONE, eye).unwrap();
    behind.tumor = volume(&grid, 1, |_, _| true);
    assert!(context_plan(&behind, &quality).has(PassName::Surface));
    // Depths are counted from another plane then: to a last digit of the picture.
    let with = bits(&behind, &quality);
    let worst = image.iter().zip(&with).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= 1, "{worst}");
}

#[test]
fn vicinity_is_its_twin() {
    let mut scene = scene(false, true, Projection::Perspective);
    scene.volume = None;
    scene.camera.height_mm *= 0.3;
    for variant in [Variant::PaperApproximate, Variant::Mended] {
        let lighting =
            Lighting { shading: Shading::Slices, variant, vicinity_samples: 64, ..Lighting::DEFAULT };
        let quality = Quality { lighting, ..Quality::FULL };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
        assert!(!frame.plan.has(PassName::Slices));
        let depths = frame.read_depths(&GPU);
        let found = frame.read_blurred(&GPU);
        // The twin counts depths from the eye.
        let reference_mm = scene.reference_mm();
        let absolute: Vec<f32> =
            depths.iter().map(|d| if *d < FAR { d + reference_mm as f32 } else { *d }).collect();
        let sight = Sight::new(&scene.camera, SIZE);
        let twin = vicinity::vicinity(
            &absolute,
            SIZE,
            |depth| sight.pixel_mm(depth),
            lighting.vicinity_radius_mm(),
            f64::from(slope(&lighting)),
            &poisson_disc(64),
        );
        let (mut dark, mut seen, mut other) = (0, 0, 0);
        for i in 0..depths.len() {
            if depths[i] < FAR {
                let light = twin[i];
                let encoded =
                    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
                let off = (f64::from(found[i] >> 24) / 255.0 - (1.0 - encoded)).abs();
                // One point more or less, where its place is a pixel's very edge.
                other += usize::from(off > 0.003);
                assert!(off < 0.02, "{variant:?} {i}: {off}");
                dark += usize::from(light < 0.9);
                seen += 1;
            } else {
                assert_eq!(found[i], 0);
            }
        }
        assert!(seen > 300 && dark > 30 && other * 50 < seen, "{variant:?}: {seen} {dark} {other}");
    }
}
