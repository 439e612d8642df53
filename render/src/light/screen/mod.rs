//! Screen-space light: ambient occlusion from depths alone, and the ray march's headlight on the image's gradients.

#[cfg(test)]
mod twin_tests;

use glam::DVec4;

use super::lit::{Light, LightRow, LitScene, no_occlusion};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        runner::{PassRunner, workgroups_of},
    },
    scene::{Knob, LightingMode, Plan, Quality},
    solid::view::HAS_OCCLUSION,
};

/// Ambient occlusion.
pub(crate) const OCCLUSION: PassName = PassName::new("occlusion");
/// Its blur.
pub(crate) const OCCLUSION_BLUR: PassName = PassName::new("occlusion_blur");

/// Also what the other modes lit by the headlight start from.
pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::ScreenSpace,
    title: "Headlight and point pairs (thesis)",
    summary: "Fastest: relief from the image's gradients, corners of the tumour darker",
    advice: "Liked best, for example to talk to patients; for depth and size other light is better",
    takes_long: false,
    has_aperture: false,
    has_lamp: false,
    knobs: &[Knob::TissueShading],
    traces_masks: false,
    lights_smooth: true,
    most_cost: 16.0,
    first_cost: 0.125,
    passes: |_| &[OCCLUSION, OCCLUSION_BLUR],
    omission_reason: |pass, quality, no_opaque, _| match pass {
        OCCLUSION | OCCLUSION_BLUR => no_opaque.or_else(|| no_samples(quality)),
        _ => None,
    },
    flags: &[(OCCLUSION_BLUR, HAS_OCCLUSION)],
    image_pass: None,
    reads_arrows: |_| &[],
    at_cost,
    measured: &[],
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: &[],
        variants: &[crate::scene::LightSettings::DEFAULT.variant],
        max_twin_error: twin_tests::max_twin_error,
        decided_by_rounding: 0.0,
    },
    start: |gpu| Box::new(ScreenLight::new(gpu)),
};

/// Why `quality` omits ambient occlusion by samples; `None` if it doesn't.
fn no_samples(quality: &Quality) -> Option<&'static str> {
    let no_samples = (quality.occlusion_samples == 0).then_some("occlusion has no samples");
    no_occlusion(quality).or(no_samples)
}

/// Above balanced nothing changes: the remaining error is bias.
pub(super) fn at_cost(cost: f64) -> Quality {
    let less = cost.min(1.0);
    Quality {
        resolution_scale: less.powf(0.3).max(0.2),
        occlusion_samples: if cost < 1.0 { 6 } else { 12 },
        context_step_mm: (0.5 * less.powf(-0.3)).min(2.0),
        ..Quality::FULL
    }
}

/// The table of point pairs, and its number of samples.
struct ScreenLight {
    kernel: wgpu::Buffer,
    kernel_samples: u32,
}

type Kernel = [[f32; 4]; Quality::MOST_SAMPLES as usize];

impl ScreenLight {
    fn new(gpu: &Gpu) -> Self {
        Self { kernel: gpu.uniform::<Kernel>("ScreenLight::kernel"), kernel_samples: 0 }
    }
}

impl Light for ScreenLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        if !plan.has(OCCLUSION) {
            return Ok(Vec::new());
        }
        let samples = scene.quality.occlusion_samples.clamp(1, Quality::MOST_SAMPLES);
        if self.kernel_samples != samples {
            self.kernel_samples = samples;
            gpu.queue.write_buffer(&self.kernel, 0, bytemuck::cast_slice(&occlusion_kernel(samples)));
        }
        let entries = [
            (0, scene.view.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (5, scene.surfaces.as_entire_binding()),
            (7, scene.occlusion.as_entire_binding()),
            (9, self.kernel.as_entire_binding()),
        ];
        let workgroups = workgroups_of(scene.size);
        passes.bind(gpu, OCCLUSION, "screen/occlusion", &entries, workgroups)?;
        if plan.has(OCCLUSION_BLUR) {
            let entries = [
                (0, scene.view.as_entire_binding()),
                (4, scene.depths.as_entire_binding()),
                (7, scene.occlusion.as_entire_binding()),
                (8, scene.blurred.as_entire_binding()),
            ];
            passes.bind(gpu, OCCLUSION_BLUR, "screen/blur", &entries, workgroups)?;
        }
        Ok(Vec::new())
    }
}

/// One point of each pair that ambient occlusion tests: a spiral over the unit hemisphere, denser near
/// the centre.
pub(crate) fn occlusion_kernel(samples: u32) -> Kernel {
    let n = samples.clamp(1, Quality::MOST_SAMPLES);
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    std::array::from_fn(|i| {
        // The points are ordered by height on the spiral; their radii must not correlate with it.
        let shuffled = (i * 7 + 3) as u32 % n;
        let z = 1.0 - (i as f64 + 0.5) / f64::from(n);
        let ring = (1.0 - z * z).max(0.0).sqrt();
        let radius = 0.2 + 0.8 * ((f64::from(shuffled) + 0.5) / f64::from(n)).powf(0.75);
        let (sin, cos) = (golden * i as f64).sin_cos();
        DVec4::new(radius * ring * cos, radius * ring * sin, radius * z, 0.0).as_vec4().to_array()
    })
}
