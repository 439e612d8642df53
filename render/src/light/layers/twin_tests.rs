//! The layers of light against their twin in `f64`.

use glam::DVec3;
use glioscope_core::optics::{Projection, Sight, cone::tangent_variance};

use super::{LAYERS, LayerPlan, MOST_LAYERS};
use crate::{
    light::suite::{SIZE, scene},
    scene::LightSettings,
};

#[test]
fn layers_are_as_many_and_as_wide_as_settings_and_limits_say() {
    let scene = scene(false, true, Projection::Perspective);
    let sight = Sight::new(&scene.camera, SIZE);
    // Two points on the axis, this far from the eye.
    let at = |mm: f64| sight.eye_mm + sight.forward * mm;
    let between = [at(60.0), at(90.0)];
    let plan =
        |settings: LightSettings, corners: &[DVec3]| LayerPlan::new(&settings, &scene.camera, SIZE, corners);
    let base = LightSettings { slice_mm: 1.0, ..LightSettings::DEFAULT };
    let middle = plan(base, &between).unwrap();
    assert!((30..=31).contains(&middle.kernels.len()) && middle.lag_mm == base.vicinity_mm);
    // The variance two lags behind a surface is the cone's.
    let half = middle.kernels.len() / 2;
    let cell_mm = f64::from(middle.side) * sight.pixel_mm(60.0 + half as f64 + 0.5);
    let per_layer = middle.kernels[half].variance_px2() * cell_mm * cell_mm;
    let two_lags = 2.0 * base.vicinity_mm;
    let cone = tangent_variance(base.aperture_deg) * two_lags * two_lags;
    assert!((per_layer * base.vicinity_mm - cone).abs() < 1e-9 * cone, "{per_layer} {cone}");
    let most = plan(LightSettings { slice_mm: 1e-9, ..base }, &between).unwrap();
    assert!(most.kernels.len() <= MOST_LAYERS as usize && most.kernels.len() >= 250);
    for slice_mm in [f64::NAN, -1.0, 1e300] {
        let odd = plan(LightSettings { slice_mm, ..base }, &between).unwrap();
        assert!(odd.slice_mm > 0.0 && odd.slice_mm <= 30.0 && !odd.kernels.is_empty());
    }
    assert_eq!(plan(base, &[]), None);
    assert_eq!(plan(base, &[at(-3.0)]), None, "behind the eye");
    assert_eq!(plan(LightSettings { aperture_deg: 0.1, ..base }, &between), None, "narrower than a pixel");
    assert_eq!(plan(LightSettings { vicinity_mm: f64::INFINITY, ..base }, &between), None);
    assert!(!plan(base, &[at(7.0)]).unwrap().kernels.is_empty(), "a sheet seen from above");
    assert_eq!(LAYERS.name(), "solid_layers");
}
