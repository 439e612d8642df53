//! Light of the views on Mesa's software adapter, held against twins in `f64` and against Monte Carlo.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{Grid, Samples, Scaling, Selection, Volume};

use super::{vicinity::slope, *};
use crate::{
    ClipPlane, ContextRenderer, ContextScene, ControlPoint, GradientPoint, MaskColors, Palette, Projection,
    TransferFunction,
    context::context_plan,
    dos::{DosPlan, DosSettings},
    dos::tests::GPU,
    occlusion::{Sight, poisson::poisson_disc},
    reference::{combined, vicinity},
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
    let image = Volume::new(grid.clone(), Samples::F64(values), Scaling::NONE).unwrap();
    Arc::new(ContextVolume::new(Arc::new(image)))
}

fn transfer(two_d: bool, opacity: f64) -> Arc<TransferFunction> {
    let rows = [(15.0, [90, 60, 40], 0.0), (50.0, [220, 160, 120], 0.5 * opacity), (90.0, [255, 250, 230], opacity)];
    let points = rows.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect();
    let gradient = two_d.then(|| {
        [(1.0, 0.2), (6.0, 0.6), (12.0, 1.0)].map(|(gradient, factor)| GradientPoint { gradient, factor }).to_vec()
    });
    Arc::new(TransferFunction::new(points, gradient).unwrap())
}

fn cubic(n: usize, spacing_mm: DVec3) -> Grid {
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
    let gpu_image = ImageBuffers::keep(
        &mut None,
        &GPU,
        scene.volume.as_ref().unwrap(),
        &scene.transfer,
    )
    .unwrap()
    .depths_mm(&sight);
    let settings = DosSettings {
        variant: lighting.variant,
        aperture_deg: lighting.aperture_deg,
        grid: lighting.slice_grid,
        slice_mm: lighting.slice_mm,
        reference_mm: lighting.reference_mm,
    };
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
                let lighting =
                    Lighting { shading: Shading::Slices, variant, aperture_deg, slice_grid, slice_mm, ..Lighting::DEFAULT };
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
        let lighting = Lighting { shading: Shading::Slices, variant, vicinity_samples: 64, ..Lighting::DEFAULT };
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
                let encoded = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
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
