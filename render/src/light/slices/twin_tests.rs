//! Slices of the context view against their twin in `f64`.

use glam::DVec3;
use glioscope_core::optics::{Projection, Sight};

use super::{
    plan::{SlicePlan, SliceSettings},
    slice_settings, twin,
};
use crate::{
    ClipPlane, ContextRenderer, ContextScene,
    light::suite::{SIZE, image_of, scene, shaped, visible_depths_mm},
    scene::{Lamp, LampFrame, LightSettings, LightingMode, MutualOcclusion, Quality, SliceVariant},
    solid::{SURFACE, view::FAR},
    testing::GPU,
};

struct Drawn {
    eye: Vec<[f32; 4]>,
    depths: Vec<f32>,
    notes: Vec<[f32; 2]>,
}

fn drawn(scene: &ContextScene, quality: &Quality, size: [u32; 2]) -> Drawn {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, scene, quality, size).unwrap();
    let depths = if frame.plan.has(SURFACE) {
        frame.read_depths(&GPU)
    } else {
        vec![FAR; (size[0] * size[1]) as usize]
    };
    let read = |buffer: &wgpu::Buffer| GPU.read_buffers(&[(buffer, 0, buffer.size())]).unwrap().remove(0);
    let lights = renderer.lights();
    let (eye, notes) = (read(lights.probe().eye.unwrap()), read(lights.probe().notes.unwrap()));
    let out = Drawn {
        eye: bytemuck::pod_collect_to_vec(&eye),
        depths,
        notes: bytemuck::pod_collect_to_vec(&notes),
    };
    assert!(out.eye.iter().flatten().all(|v| v.is_finite()), "finite in every pixel");
    out
}

/// Largest difference of radiance, transmittance and light on opaque geometry from the twin.
fn twin_error(scene: &ContextScene, lighting: LightSettings) -> f64 {
    let quality = Quality { lighting, ..Quality::FULL };
    let found = drawn(scene, &quality, SIZE);
    let sight = Sight::new(&scene.camera, SIZE);
    let gpu_image = visible_depths_mm(scene, &sight);
    let settings = slice_settings(&lighting, &scene.camera);
    let whole = Some((gpu_image[0].0, gpu_image.last().unwrap().1));
    let reference_mm = scene.reference_mm();
    let opaque_mm: Vec<f64> = found
        .depths
        .iter()
        .map(|d| if *d < FAR { f64::from(*d) + reference_mm } else { f64::INFINITY })
        .collect();
    let run = |settings: &SliceSettings| {
        let plan = SlicePlan::new(settings, &sight, whole, &gpu_image);
        twin::slices(scene, &sight, &plan, &opaque_mm, &lighting.mutual, quality.occlusion_strength)
    };
    let cases = settings.cases();
    let mut twin = run(&cases[0].0);
    if let [_, (behind, share)] = &cases[..] {
        for (mixed, behind) in twin.iter_mut().zip(run(behind)) {
            mixed.eye.radiance = mixed.eye.radiance.lerp(behind.eye.radiance, *share);
            mixed.eye.transmittance += share * (behind.eye.transmittance - mixed.eye.transmittance);
            mixed.on_opaque += share * (behind.on_opaque - mixed.on_opaque);
        }
    }
    let mut worst = 0.0f64;
    let mut dark = 0;
    for (i, expected) in twin.iter().enumerate() {
        let e = expected.eye.radiance.extend(expected.eye.transmittance);
        for c in 0..4 {
            worst = worst.max((f64::from(found.eye[i][c]) - e[c]).abs());
        }
        if opaque_mm[i].is_finite() {
            worst = worst.max((f64::from(found.notes[i][0]) - expected.on_opaque).abs());
            dark += usize::from(expected.on_opaque < 0.8);
        }
    }
    assert!(twin.iter().filter(|t| t.eye.transmittance < 0.8).count() > 100, "the image is visible");
    assert!(scene.tumor.is_none() || dark > 5, "the image darkens {dark} pixels of the tumour");
    worst
}

/// For the suite: every variant, with and without tumour, gradients, clipping planes.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = 0.0f64;
    for (two_d, by_shapes, with_tumor, projection) in [
        (false, false, false, Projection::Perspective),
        (false, false, true, Projection::Perspective),
        (true, false, true, Projection::Orthographic),
        (true, true, true, Projection::Perspective),
    ] {
        let mut scene = scene(two_d, with_tumor, projection);
        if by_shapes {
            scene.transfer = shaped();
        }
        for variant in [SliceVariant::PaperExact, SliceVariant::PaperApproximate, SliceVariant::Mended] {
            for (aperture_deg, slice_grid, slice_mm, to_lamp) in [
                (50.0, 2, 0.9, None),
                (80.0, 5, 2.1, None),
                (20.0, 2, 0.9, Some((LampFrame::Viewer, -45.0, 45.0))),
                (40.0, 3, 2.1, Some((LampFrame::Patient, 20.0, 0.0))),
                (20.0, 2, 0.9, Some((LampFrame::Viewer, 150.0, 30.0))),
                (40.0, 3, 2.1, Some((LampFrame::Viewer, 180.0, 0.0))),
                (20.0, 2, 2.1, Some((LampFrame::Viewer, 84.0, 10.0))),
            ] {
                scene.clip = if slice_mm > 2.0 {
                    vec![ClipPlane { normal: DVec3::new(0.3, -0.8, 0.5), offset_mm: 5.0 }]
                } else {
                    Vec::new()
                };
                let lighting = LightSettings {
                    mode: LightingMode::Slices,
                    variant,
                    aperture_deg,
                    slice_grid,
                    slice_mm,
                    towards_lamp: to_lamp.is_some(),
                    lamp: to_lamp.map_or(Lamp::DEFAULT, |(frame, azimuth_deg, elevation_deg)| Lamp {
                        frame,
                        azimuth_deg,
                        elevation_deg,
                    }),
                    ..LightSettings::DEFAULT
                };
                let off = twin_error(&scene, lighting);
                println!(
                    "{two_d} {by_shapes} {with_tumor} {projection:?} {variant:?} {slice_grid} {to_lamp:?}: {off:.2e}"
                );
                worst = worst.max(off);
            }
        }
    }
    worst
}

#[test]
fn each_mutual_occlusion_matches_the_twin() {
    let scene = scene(false, true, Projection::Perspective);
    for (image_on_image, opaque_on_image) in [(false, false), (true, false), (false, true)] {
        for variant in [SliceVariant::PaperApproximate, SliceVariant::Mended] {
            let mutual = MutualOcclusion { image_on_image, opaque_on_image, ..MutualOcclusion::ALL };
            let lighting =
                LightSettings { mode: LightingMode::Slices, variant, mutual, ..LightSettings::DEFAULT };
            let off = twin_error(&scene, lighting);
            assert!(off <= 1e-3, "{mutual:?} {variant:?}: {off}");
        }
    }
}

/// An image that is dense up to its faces: already the first slice takes light away, each sample over its own distance.
#[test]
fn the_first_slice_of_a_dense_image_matches_the_twin() {
    let mut scene = scene(false, true, Projection::Perspective);
    let grid = scene.volume.as_ref().unwrap().grid().clone();
    scene.volume = Some(image_of(&grid, vec![60.0; grid.voxel_count()]));
    for variant in [SliceVariant::PaperExact, SliceVariant::PaperApproximate, SliceVariant::Mended] {
        let lighting =
            LightSettings { mode: LightingMode::Slices, variant, slice_mm: 2.0, ..LightSettings::DEFAULT };
        let off = twin_error(&scene, lighting);
        println!("{variant:?}: {off:.2e}");
        assert!(off <= 1e-3, "{variant:?}: {off}");
    }
}
