//! The pass against its twin in `f64`.

use glioscope_core::optics::{Projection, Sight, poisson::poisson_disc, srgb};

use super::{radius_mm, slope, twin};
use crate::{
    ContextRenderer,
    light::{
        layers::{self, LayerPlan},
        slices::SLICES,
        suite::{SIZE, scene},
    },
    scene::{LightSettings, LightingMode, Quality, SliceVariant},
    solid::view::FAR,
    testing::GPU,
};

#[test]
fn vicinity_pass_matches_its_twin() {
    let mut scene = scene(false, true, Projection::Perspective);
    scene.volume = None;
    scene.camera.height_mm *= 0.3;
    // With a quarter of the light ambient, too: that is added in linear light.
    let mut far_dark = 0;
    for (variant, strength) in
        [(SliceVariant::PaperApproximate, 1.0), (SliceVariant::Mended, 1.0), (SliceVariant::Mended, 0.75)]
    {
        let lighting = LightSettings {
            mode: LightingMode::Slices,
            variant,
            vicinity_samples: 64,
            ..LightSettings::DEFAULT
        };
        let quality = Quality { lighting, occlusion_strength: strength, ..Quality::FULL };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        let frame = renderer.render(&GPU, &scene, &quality, SIZE).unwrap();
        assert!(!frame.plan.has(SLICES));
        let depths = frame.read_depths(&GPU);
        let found = frame.read_blurred(&GPU);
        // The twin's depths start at the eye.
        let reference_mm = scene.reference_mm();
        let absolute: Vec<f32> =
            depths.iter().map(|d| if *d < FAR { d + reference_mm as f32 } else { *d }).collect();
        let sight = Sight::new(&scene.camera, SIZE);
        let corners = scene.solid_corners_mm();
        let plan = LayerPlan::new(&lighting, &scene.camera, SIZE, &corners);
        let deepest_mm = plan.as_ref().map_or(f64::INFINITY, |plan| plan.lag_mm);
        let twin = twin::vicinity(
            &absolute,
            SIZE,
            |depth| sight.pixel_mm(depth),
            radius_mm(&lighting),
            (f64::from(slope(&lighting)), deepest_mm),
            &poisson_disc(64),
        );
        let from_eye: Vec<f64> =
            absolute.iter().map(|d| if *d < FAR { f64::from(*d) } else { f64::INFINITY }).collect();
        let far =
            plan.map_or(vec![1.0; twin.len()], |p| layers::twin::layers(&p, &sight, &from_eye, |_| true));
        far_dark += far.iter().filter(|light| **light < 0.9).count();
        let (mut dark, mut hits, mut differing) = (0, 0, 0);
        for i in 0..depths.len() {
            if depths[i] < FAR {
                let light = twin[i] * far[i];
                let shown = 1.0 - strength * (1.0 - light);
                let off = (f64::from(found[i] >> 24) / 255.0 - (1.0 - srgb::encode(shown))).abs();
                // One sample more or less, where it falls on a pixel's edge.
                differing += usize::from(off > 0.003);
                assert!(off < 0.02, "{variant:?} {i}: {off}");
                dark += usize::from(light < 0.9);
                hits += 1;
            } else {
                assert_eq!(found[i], 0);
            }
        }
        println!(
            "{variant:?}: {hits} hits, {dark} dark, {differing} differ, {far_dark} dark from afar so far"
        );
        assert!(hits > 300 && dark > 30 && differing * 50 < hits, "{variant:?}: {hits} {dark} {differing}");
    }
    assert!(far_dark > 15, "{far_dark}");
}
