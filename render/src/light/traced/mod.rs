//! Ambient occlusion of masks by rays through their voxels, over the hemisphere about the smoothed normal: few while
//! something moves, at rest until the standard error is below 0.01. Views that show more than masks have horizons of
//! their depths instead.

#[cfg(test)]
mod twin_tests;

use bytemuck::{Pod, Zeroable};

use super::{
    horizon::{self, ALONG_SURFACE, HORIZON, bind_filter, bind_horizon},
    lit::{Light, LightRow, LitKind, LitScene, Measured, no_occlusion},
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        pipelines::{BindingKind, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, workgroups_of},
    },
    scene::{LightingMode, Plan, Quality},
};

/// Rays of ambient occlusion.
pub(crate) const RAYS: PassName = PassName::new("occlusion_rays");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::Traced,
    title: "Headlight and traced occlusion",
    summary: "Relief from the image's gradients; hollows darker, by rays through the masks in the closeup",
    takes_long: true,
    passes: |kind| match kind {
        LitKind::Masks => &[RAYS, ALONG_SURFACE],
        LitKind::Image | LitKind::Depths => &[HORIZON, ALONG_SURFACE],
    },
    omission_reason: |pass, quality, no_opaque, _| match pass {
        RAYS | HORIZON | ALONG_SURFACE => no_opaque.or_else(|| no_occlusion(quality)),
        _ => None,
    },
    at_cost,
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: LAYOUTS,
        max_twin_error: twin_tests::max_twin_error,
        ..horizon::ROW.suite
    },
    start: |gpu| Box::new(TracedLight::new(gpu)),
    ..horizon::ROW
};

/// Numbers of rays, each with the root mean square error of the share of light lost on the head phantom's tumour and on a
/// mask of deep folds (docs/accuracy.md).
pub(super) const MEASURED: Measured = &[
    (1.0, [0.0210, 0.0579]),
    (2.0, [0.0172, 0.0406]),
    (4.0, [0.0151, 0.0292]),
    (8.0, [0.0122, 0.0218]),
    (16.0, [0.0111, 0.0184]),
    (32.0, [0.0098, 0.0152]),
    (64.0, [0.0093, 0.0142]),
    (128.0, [0.0095, 0.0136]),
    (256.0, [0.0089, 0.0128]),
];

fn at_cost(cost: f64) -> Quality {
    Quality { occlusion_rays: ((16.0 * cost) as u32).clamp(4, Quality::MOST_RAYS), ..horizon::at_cost(cost) }
}

/// Rays of a dispatch: so few that a part of a frame is short, and that pixels with enough rays stop soon.
const RAYS_PER_STEP: u32 = 16;
/// Distance between the steps' uniforms, the largest alignment of any device.
const STEP_BYTES: u64 = 256;

/// `Rays` of traced/rays.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Rays {
    first: u32,
    count: u32,
    unused: [u32; 2],
}

/// `Found` of traced/rays.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Found {
    hidden: u32,
    rays: u32,
    colors: [u32; 2],
}

#[cfg(test)]
const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(Rays, "Rays": first, count, unused),
    crate::layouts::layout!(Found, "Found": hidden, rays, colors),
];

struct TracedLight {
    layout: wgpu::BindGroupLayout,
    pipeline: Option<wgpu::ComputePipeline>,
    /// Sums of the rays of each pixel, and the pixels that there is room for.
    found: Option<(wgpu::Buffer, u64)>,
}

impl TracedLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let kinds = [
            (0, Uniform),
            (1, Read),
            (2, Read),
            (3, Read),
            (4, Read),
            (7, Write),
            (40, Read),
            (41, Read),
            (42, UniformAtOffset(2 * size_of::<Rays>() as u64)),
            (43, Write),
        ];
        let layout = bind_group_layout(gpu, "TracedLight::layout", &kinds);
        Self { layout, pipeline: None, found: None }
    }

    fn bind_rays(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
    ) -> Result<(), RenderError> {
        let (Some([table, words]), Some(shown)) = (scene.bricks, scene.shown) else { return Ok(()) };
        let pixels = u64::from(scene.size[0]) * u64::from(scene.size[1]);
        let bytes = size_of::<Found>() as u64 * pixels;
        gpu.check_size("rays of ambient occlusion", bytes)?;
        let held = self.found.take().filter(|(_, room)| *room == pixels);
        let (found, _) = self
            .found
            .insert(held.unwrap_or_else(|| (gpu.buffer("TracedLight::found", bytes, WRITTEN), pixels)));
        let pipeline = match &self.pipeline {
            Some(pipeline) => pipeline.clone(),
            None => {
                let pipeline = compute_pipeline(gpu, "traced/rays", Some(&self.layout), &[])?;
                gpu.check()?;
                self.pipeline.insert(pipeline).clone()
            }
        };
        let rays = steps_of(scene.quality.occlusion_rays);
        let mut uniforms = vec![0u8; rays.len() * STEP_BYTES as usize];
        for (place, step) in uniforms.chunks_mut(STEP_BYTES as usize).zip(&rays) {
            let bytes = bytemuck::bytes_of(step);
            place.split_at_mut(bytes.len()).0.copy_from_slice(bytes);
        }
        let steps = gpu.buffer_with("TracedLight::steps", &uniforms, wgpu::BufferUsages::UNIFORM);
        let dispatches = (0..rays.len() as u32).map(|n| Dispatch {
            pipeline: 0,
            offset: n * STEP_BYTES as u32,
            workgroups: workgroups_of(scene.size),
        });
        let step = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &steps,
            offset: 0,
            size: wgpu::BufferSize::new(2 * size_of::<Rays>() as u64),
        });
        let entries = [
            (0, scene.view.as_entire_binding()),
            (1, table.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (7, scene.occlusion.as_entire_binding()),
            (40, scene.normals.as_entire_binding()),
            (41, shown.as_entire_binding()),
            (42, step),
            (43, found.as_entire_binding()),
        ];
        passes.bind_steps(gpu, RAYS, &self.layout, &entries, (vec![pipeline], dispatches.collect()));
        Ok(())
    }
}

impl Light for TracedLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        if plan.has(RAYS) {
            self.bind_rays(gpu, passes, scene)?;
        } else {
            self.found = None;
        }
        bind_horizon(gpu, passes, plan, scene)?;
        bind_filter(gpu, passes, plan, scene)?;
        Ok(Vec::new())
    }
}

/// The rays of each dispatch.
fn steps_of(rays: u32) -> Vec<Rays> {
    let rays = rays.clamp(1, Quality::MOST_RAYS);
    (0..rays)
        .step_by(RAYS_PER_STEP as usize)
        .map(|first| Rays { first, count: RAYS_PER_STEP.min(rays - first), ..Rays::default() })
        .collect()
}
