//! Light among solids by slices: opaque surfaces darken each other from afar, in layers (the occlusion buffer of Schott et
//! al. 2012, kept for every layer). Near surfaces are vicinity occlusion's. With perspective, layers are shells about the
//! eye instead of planes: the cone about the direction to the eye then spreads alike to all sides.
//!
//! All surfaces that are nearer to the eye by more than the *lag* count. A surface's shadow begins a lag behind it and
//! spreads by as much per layer as makes it the cone's two lags behind: variance 4·lag·(L − lag) instead of L², which
//! touches it there and is below by (L − 2·lag)² elsewhere. Without a lag, a footprint is wider than the cone nearby, and a
//! slanted surface darkens itself.
//!
//! Lifetimes: pipelines once; buffers (8 bytes per cell and layer) once per number of them; uniforms once per frame.

#[cfg(test)]
pub(crate) mod twin;
#[cfg(test)]
mod twin_tests;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::optics::{
    Camera, Sight,
    cone::{clamped_aperture, tangent_variance},
};

use super::{
    kernel::Kernel,
    lit::{LitScene, is_off, no_strength},
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        pipelines::{BindingKind, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, workgroups_of},
    },
    scene::{LightSettings, Quality, SliceVariant},
};

/// Light among solids, layer by layer.
pub(crate) const LAYERS: PassName = PassName::new("solid_layers");

/// The most layers; with more, each is thicker.
pub(crate) const MOST_LAYERS: u32 = 256;
/// The most cells of all layers together: 64 MB on the device for their light.
const MOST_CELLS: u64 = 1 << 24;
/// Points along a side of a footprint, at most.
const GRID: u32 = 7;
/// Bytes from one step's uniform to the next.
const STRIDE: usize = 256;
const TUBES_ONLY: u32 = 1;

/// [`LightSettings::layer_cell`] at a share of balanced's cost, above 0 to 1: docs/studies.md has what it costs and errs.
pub(crate) fn cell_at(cost: f64) -> f64 {
    (LightSettings::DEFAULT.layer_cell * cost.powf(-0.3)).min(3.0)
}

/// Why geometry known by depths alone casts no shadows on other such geometry from afar.
pub(crate) fn no_lamp_shadow(light: &LightSettings) -> Option<&'static str> {
    light.towards_lamp.then_some("depths say nothing about what a lamp's light meets")
}

/// Why the pass is omitted: there is nothing that it would darken.
pub(crate) fn omission_reason(quality: &Quality, no_opaque: Option<&'static str>) -> Option<&'static str> {
    let light = &quality.lighting;
    no_opaque
        .or(no_strength(quality))
        .or((!light.mutual.opaque_on_opaque).then_some("opaque surfaces don't darken each other"))
        .or((clamped_aperture(light.aperture_deg).0 <= 0.0)
            .then_some("light from the eye alone reaches all that is seen"))
        .or(no_lamp_shadow(light))
        .or((light.variant != SliceVariant::Mended)
            .then_some("the paper's slices carry surfaces through the image"))
        .or((!(light.vicinity_mm.is_finite()) || is_off(light.vicinity_mm))
            .then_some("no distance from which on surfaces count"))
}

/// `Layers` of lib/layers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LayersUniform {
    pub near: f32,
    pub slice_mm: f32,
    pub lag_mm: f32,
    pub count: u32,
    pub cells: [u32; 2],
    pub side: u32,
    pub flags: u32,
}

/// `LayerStep` of layers/step.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct LayerStep {
    layer: u32,
    side: u32,
    stride: i32,
    center: f32,
    share: f32,
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: [crate::layouts::Layout; 2] = [
    crate::layouts::layout!(LayersUniform, "Layers": near, slice_mm, lag_mm, count, cells, side, flags),
    crate::layouts::layout!(
        LayerStep, "LayerStep": layer, side, stride, center, share, unused_a, unused_b, unused_c
    ),
];

/// The layers of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LayerPlan {
    /// Distance of the front of the first layer from the eye, along sight lines.
    pub near_mm: f64,
    /// Thickness of a layer.
    pub slice_mm: f64,
    /// How far behind a surface its shadow begins.
    pub lag_mm: f64,
    /// Pixels along the side of a cell.
    pub side: u32,
    /// Cells across and down.
    pub cells: [u32; 2],
    /// The footprint of each layer.
    pub kernels: Vec<Kernel>,
}

impl LayerPlan {
    /// Layers through all solids, which lie within the boxes of `corners_mm`; none without any before the eye, and where
    /// the cone is narrower than a cell.
    pub fn new(
        settings: &LightSettings,
        camera: &Camera,
        size: [u32; 2],
        corners_mm: &[DVec3],
    ) -> Option<Self> {
        let sight = Sight::new(camera, size);
        let (near_mm, far_mm) = sight.depths_mm(corners_mm)?;
        let farthest_mm = corners_mm.iter().map(|c| c.distance(sight.eye_mm)).fold(far_mm, f64::max);
        let far_mm = if sight.growth() > 0.0 { farthest_mm } else { far_mm };
        let is_mended = settings.variant == SliceVariant::Mended;
        let lag_mm = Some(settings.vicinity_mm).filter(|mm| is_mended && mm.is_finite() && *mm > 0.0)?;
        let (aperture_deg, _) = clamped_aperture(settings.aperture_deg);
        let span = (far_mm - near_mm).max(1e-3);
        let wanted = Some(settings.slice_mm).filter(|mm| mm.is_finite() && *mm > 0.0).unwrap_or(1.0);
        // Several before a shadow reaches its right width: with thick image slices, too.
        let wanted = wanted.min(lag_mm / 3.0);
        let slice_mm = wanted.max(span / f64::from(MOST_LAYERS - 2)).min(span);
        // So that what else is in the scene doesn't shift the layers.
        let near_mm = (near_mm / slice_mm).floor() * slice_mm;
        let count = (((far_mm - near_mm) / slice_mm).ceil() as u32).clamp(1, MOST_LAYERS);
        let variance_mm2 = 4.0 * lag_mm * slice_mm * tangent_variance(aperture_deg);
        // As wide as a footprint's samples are apart, so that fibres aren't missed between them; at most half of the
        // cone where shadows begin.
        let radius_mm = lag_mm * aperture_deg.to_radians().tan();
        let cell_mm = (0.5 * variance_mm2).sqrt().min(0.5 * radius_mm);
        let pixel_mm = camera.height_mm / f64::from(size[1].max(1));
        let coarser = if settings.layer_cell.is_finite() { settings.layer_cell.clamp(1.0, 4.0) } else { 1.0 };
        let cell_mm = (coarser * cell_mm).min(radius_mm);
        let mut side = (cell_mm / pixel_mm).clamp(1.0, 64.0) as u32;
        let cells_of = |side| sight.size.map(|s| s.div_ceil(side).max(1));
        let all = |[across, down]: [u32; 2]| u64::from(across) * u64::from(down) * u64::from(count);
        while all(cells_of(side)) > MOST_CELLS {
            side *= 2;
        }
        // Where the cone is narrower than a cell, shadows would be wider than it.
        if f64::from(side) * pixel_mm > radius_mm {
            return None;
        }
        let cells = cells_of(side);
        let kernel = |layer: u32| {
            let at_mm = near_mm + (f64::from(layer) + 0.5) * slice_mm;
            let cell_mm = f64::from(side) * sight.pixel_mm(at_mm);
            Kernel::lattice(GRID, variance_mm2 / cell_mm.powi(2))
        };
        let kernels = (0..count).map(kernel).collect();
        Some(Self { near_mm, slice_mm, lag_mm, side, cells, kernels })
    }

    fn step(&self, layer: usize) -> LayerStep {
        let mut out =
            LayerStep { layer: layer as u32, side: 1, stride: 1, share: 1.0, ..LayerStep::default() };
        if let Some(Kernel::Lattice { side, stride_px, center }) = self.kernels.get(layer) {
            let share = 1.0 / (side * side) as f32;
            out = LayerStep { side: *side, stride: *stride_px as i32, center: *center as f32, share, ..out };
        }
        out
    }
}

struct Buffers {
    cells: u64,
    cover: wgpu::Buffer,
    light: wgpu::Buffer,
}

/// The pass on the device, and what passes that read its light bind.
pub(crate) struct LayerLight {
    layout: wgpu::BindGroupLayout,
    pipelines: Option<Vec<wgpu::ComputePipeline>>,
    uniform: wgpu::Buffer,
    placeholder: wgpu::Buffer,
    buffers: Option<Buffers>,
}

impl LayerLight {
    pub fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let kinds = [
            (0, Uniform),
            (4, Read),
            (5, Read),
            (32, UniformAtOffset(2 * size_of::<LayerStep>() as u64)),
            (44, Uniform),
            (45, Write),
            (46, Write),
        ];
        Self {
            layout: bind_group_layout(gpu, "LayerLight::layout", &kinds),
            pipelines: None,
            uniform: gpu.uniform::<LayersUniform>("LayerLight::uniform"),
            placeholder: gpu.buffer("LayerLight::placeholder", 16, WRITTEN),
            buffers: None,
        }
    }

    /// What passes that read the light bind: see lib/layers and lib/layer_light.
    pub fn entries(&self) -> [(u32, wgpu::BindingResource<'_>); 2] {
        let light = self.buffers.as_ref().map_or(&self.placeholder, |b| &b.light);
        [(44, self.uniform.as_entire_binding()), (46, light.as_entire_binding())]
    }

    /// Without the pass: readers find full light.
    pub fn leave_out(&mut self, gpu: &Gpu) {
        self.buffers = None;
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&LayersUniform::default()));
    }

    /// Binds the pass; `tubes_only`: masks hide nothing. Returns how far behind a surface its shadow begins.
    ///
    /// # Errors
    /// [`RenderError`]: something doesn't fit on the device, or the driver rejects a shader.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        tubes_only: bool,
    ) -> Result<Option<f64>, RenderError> {
        let lighting = &scene.quality.lighting;
        let Some(plan) = LayerPlan::new(lighting, scene.camera, scene.size, &scene.solid_corners_mm) else {
            self.leave_out(gpu);
            return Ok(None);
        };
        let count = plan.kernels.len();
        let cells = u64::from(plan.cells[0]) * u64::from(plan.cells[1]) * count as u64;
        gpu.check_size("layers of light", 4 * cells)?;
        let held = self.buffers.take().filter(|b| b.cells == cells);
        let buffers = self.buffers.insert(held.unwrap_or_else(|| Buffers {
            cells,
            cover: gpu.buffer("LayerLight::cover", 4 * cells, WRITTEN),
            light: gpu.buffer("LayerLight::light", 4 * cells, WRITTEN),
        }));
        let uniform = LayersUniform {
            near: (plan.near_mm - scene.reference_mm) as f32,
            slice_mm: plan.slice_mm as f32,
            lag_mm: plan.lag_mm as f32,
            count: count as u32,
            cells: plan.cells,
            side: plan.side,
            flags: if tubes_only { TUBES_ONLY } else { 0 },
        };
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        let pipelines = match &self.pipelines {
            Some(pipelines) => pipelines.clone(),
            None => {
                let compile = |file| compute_pipeline(gpu, file, Some(&self.layout), &[]);
                let made = ["layers/begin", "layers/cover", "layers/step"].map(compile);
                let made = made.into_iter().collect::<Result<Vec<_>, _>>()?;
                gpu.check()?;
                self.pipelines.insert(made).clone()
            }
        };
        // A binding spans two steps, so the last one extends past its own.
        let mut bytes = vec![0u8; (count + 1) * STRIDE];
        for (layer, place) in bytes.chunks_exact_mut(STRIDE).take(count).enumerate() {
            let step = plan.step(layer);
            let step = bytemuck::bytes_of(&step);
            place.split_at_mut(step.len()).0.copy_from_slice(step);
        }
        let steps = gpu.buffer_with("LayerLight::steps", &bytes, wgpu::BufferUsages::UNIFORM);
        let step = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &steps,
            offset: 0,
            size: wgpu::BufferSize::new(2 * size_of::<LayerStep>() as u64),
        });
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (5, scene.surfaces.as_entire_binding()),
            (32, step),
            (44, self.uniform.as_entire_binding()),
            (45, buffers.cover.as_entire_binding()),
            (46, buffers.light.as_entire_binding()),
        ];
        let workgroups = workgroups_of(plan.cells);
        let over_pixels = workgroups_of(scene.size);
        let first = [
            Dispatch { pipeline: 0, offset: 0, workgroups },
            Dispatch { pipeline: 1, offset: 0, workgroups: over_pixels },
        ];
        let layers = (0..count).map(|n| Dispatch { pipeline: 2, offset: (n * STRIDE) as u32, workgroups });
        let dispatches = first.into_iter().chain(layers).collect();
        passes.bind_steps(gpu, LAYERS, &self.layout, &entries, (pipelines, dispatches));
        Ok(Some(plan.lag_mm))
    }
}
