//! Ambient occlusion from depths and normals, by horizons (Bavoil et al. 2008, Jimenez et al. 2016): for views where
//! depths are all there is. Where a view has no normals, they are found from the depths.

#[cfg(test)]
pub(crate) mod twin;
#[cfg(test)]
mod twin_tests;

use super::{
    lit::{Light, LightRow, LitScene, no_occlusion},
    screen,
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        runner::{PassRunner, Shader, workgroups_of},
    },
    scene::{LightingMode, Plan, Quality},
    solid::view::HAS_OCCLUSION,
};

/// Ambient occlusion by horizons.
pub(crate) const HORIZON: PassName = PassName::new("horizon_occlusion");
/// Its average along surfaces.
pub(crate) const ALONG_SURFACE: PassName = PassName::new("occlusion_filter");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::Horizon,
    title: "Headlight and horizon occlusion",
    summary: "Relief from the image's gradients; hollows darker, from depths and normals",
    passes: |_| &[HORIZON, ALONG_SURFACE],
    omission_reason: |pass, quality, no_opaque, _| match pass {
        HORIZON | ALONG_SURFACE => no_opaque.or_else(|| no_occlusion(quality)),
        _ => None,
    },
    flags: &[(ALONG_SURFACE, HAS_OCCLUSION)],
    at_cost,
    #[cfg(test)]
    suite: super::lit::Suite { max_twin_error: twin_tests::max_twin_error, ..screen::ROW.suite },
    start: |_| Box::new(HorizonLight),
    ..screen::ROW
};

/// Distance within which surfaces darken each other.
const RADIUS_MM: f64 = 10.0;

/// Above balanced nothing changes: the remaining error is what depths don't show.
pub(super) fn at_cost(cost: f64) -> Quality {
    Quality {
        occlusion_strength: 1.0,
        color_bleeding: 0.15,
        occlusion_radius_mm: RADIUS_MM,
        ..screen::at_cost(cost)
    }
}

/// Planes through the sight line, and samples on each side of it, for a number of sample pairs.
fn planes_and_samples(pairs: u32) -> [u32; 2] {
    let planes = if pairs < 8 { 1 } else { 2 + pairs / 16 };
    [planes, pairs.div_ceil(planes).clamp(1, 16)]
}

struct HorizonLight;

impl Light for HorizonLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        bind_horizon(gpu, passes, plan, scene)?;
        bind_filter(gpu, passes, plan, scene)?;
        Ok(Vec::new())
    }
}

/// Binds [`HORIZON`] if it is in the plan.
///
/// # Errors
/// [`RenderError::Shader`].
pub(super) fn bind_horizon(
    gpu: &Gpu,
    passes: &mut PassRunner,
    plan: &Plan,
    scene: &LitScene<'_>,
) -> Result<(), RenderError> {
    if !plan.has(HORIZON) {
        return Ok(());
    }
    let pairs = scene.quality.occlusion_samples.clamp(1, Quality::MOST_SAMPLES);
    let [planes, samples] = planes_and_samples(pairs);
    let constants = [
        ("planes", f64::from(planes)),
        ("samples", f64::from(samples)),
        ("stored_normals", f64::from(u8::from(scene.has_normals))),
        ("stepped", f64::from(u8::from(scene.bricks.is_some()))),
    ];
    let shader = Shader { file: "horizon/occlusion", constants: &constants };
    let entries = [
        (0, scene.view.as_entire_binding()),
        (3, scene.colors.as_entire_binding()),
        (4, scene.depths.as_entire_binding()),
        (5, scene.surfaces.as_entire_binding()),
        (7, scene.occlusion.as_entire_binding()),
        (40, scene.normals.as_entire_binding()),
    ];
    passes.bind(gpu, HORIZON, shader, &entries, workgroups_of(scene.size))
}

/// Binds [`ALONG_SURFACE`] if it is in the plan; normals are stored by then.
///
/// # Errors
/// [`RenderError::Shader`].
pub(super) fn bind_filter(
    gpu: &Gpu,
    passes: &mut PassRunner,
    plan: &Plan,
    scene: &LitScene<'_>,
) -> Result<(), RenderError> {
    if !plan.has(ALONG_SURFACE) {
        return Ok(());
    }
    let entries = [
        (0, scene.view.as_entire_binding()),
        (4, scene.depths.as_entire_binding()),
        (7, scene.occlusion.as_entire_binding()),
        (8, scene.blurred.as_entire_binding()),
        (40, scene.normals.as_entire_binding()),
    ];
    passes.bind(gpu, ALONG_SURFACE, "horizon/along_surface", &entries, workgroups_of(scene.size))
}
