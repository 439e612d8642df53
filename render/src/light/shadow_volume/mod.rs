//! Hard shadows of one placed lamp by shadow volume propagation (Ropinski et al. 2010, thesis 3.3.2): light is carried through
//! cells of the image, slice by slice along the axis that it follows most; the ray march looks the cells up. Opaque geometry has
//! a ray for each pixel, as with half-angle slicing.
//!
//! The published scheme changes its axis where light is as near to two faces' normals, and the picture jumps. Here it is where light
//! crosses as many cells along both: there both sweeps are one and the same, so that nothing jumps or has to be mixed.
//!
//! Lifetimes: pipelines are created when first needed; 12 bytes per cell (16 with masks) once per image and cell size; the
//! uniforms of the slices once per frame. Everything is computed for each frame: what is in the image depends on the camera, as
//! it is left out in front of the masks.

pub(crate) mod plan;
#[cfg(test)]
mod plan_tests;
#[cfg(test)]
pub(crate) mod twin;
#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use glam::DVec3;

use self::{
    plan::{Sweep, sweep},
    uniforms::Slice,
};
use super::{
    cones::{PART_BYTES, cell_dispatches, grid::Cells},
    half_angle::{
        lamp::{LAMP, LAMP_THROUGH_IMAGE, LampLight},
        plan::turned,
    },
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitMarch, LitScene, Opaque, no_strength},
    volume::CellLight,
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::{WRITTEN, at_offset},
        pipelines::{BindingKind, Pipelines, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner},
    },
    image::tables::Dimensions,
    scene::{Knob, LightSettings, LightingMode, Plan, Quality},
    solid::view::{HAS_OCCLUSION, LINEAR_LIGHT},
};

/// Whether the masks let light through to the cells of the image.
pub(crate) const OPEN: PassName = PassName::new("light_past_masks");
/// The light carried through the cells.
pub(crate) const SWEEP: PassName = PassName::new("shadow_volume");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::ShadowVolume,
    title: "Placed lamp (shadow volume)",
    summary: "Shadows of one lamp, kept in cells of the image: softer than slices, fast to look up",
    advice: "The study found its shadows liked, but confusing where the lamp is far from the eye",
    takes_long: true,
    has_aperture: false,
    has_lamp: true,
    knobs: &[Knob::CellMm],
    traces_masks: true,
    lights_smooth: true,
    most_cost: 8.0,
    first_cost: 0.125,
    passes: |kind| match kind {
        LitKind::Image => &[OPEN, SWEEP, LAMP, LAMP_THROUGH_IMAGE],
        LitKind::Masks | LitKind::Depths => &[SWEEP, LAMP],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        SWEEP => no_image,
        OPEN => no_image.or(no_opaque),
        LAMP => no_opaque.or(no_strength(quality)),
        LAMP_THROUGH_IMAGE => no_opaque.or(no_image).or(no_strength(quality)),
        _ => None,
    },
    flags: &[(LAMP, HAS_OCCLUSION), (SWEEP, LINEAR_LIGHT)],
    image_pass: None,
    reads_arrows: |_| &[LAMP, LAMP_THROUGH_IMAGE],
    at_cost,
    measured: &[],
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        max_twin_error: twin_tests::max_twin_error,
        ..super::screen::ROW.suite
    },
    start: |gpu| Box::new(ShadowVolumeLight::new(gpu)),
};

fn at_cost(cost: f64) -> Quality {
    // Below and above balanced.
    let (less, more) = (cost.min(1.0), cost.max(1.0));
    Quality {
        resolution_scale: less.powf(0.3).max(0.2),
        context_step_mm: (0.75 * less.powf(-0.3) * more.powf(-0.15)).clamp(0.5, 2.0),
        lighting: LightSettings {
            cell_mm: (2.0 * less.powf(-0.3) * more.powf(-1.0 / 3.0)).clamp(1.0, 8.0),
            ..LightSettings::DEFAULT
        },
        ..Quality::FULL
    }
}

/// Bytes from one dispatch's uniform to the next, the largest alignment of any device.
const STRIDE: usize = 256;
/// A slice that has none before it.
const NONE: u32 = u32::MAX;

/// The passes on the device.
struct ShadowVolumeLight {
    layout: wgpu::BindGroupLayout,
    open_layout: wgpu::BindGroupLayout,
    pipelines: Pipelines<(Dimensions, bool)>,
    open_pipeline: Option<wgpu::ComputePipeline>,
    cells: CellLight,
    /// What a sweep carries, and the cells that there is room for.
    carried: Option<(wgpu::Buffer, u64)>,
    /// What the masks let through.
    open: Option<(wgpu::Buffer, u64)>,
    lamp: LampLight,
    placeholder: wgpu::Buffer,
    work: Option<LightWork>,
}

impl Light for ShadowVolumeLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let towards = scene.quality.lighting.lamp.direction(scene.camera);
        let light = -turned(scene.camera, towards);
        // As the march does on slow devices, but never coarser than the cells.
        let mut step_mm = 1.0;
        self.work = None;
        if let Some(image) = scene.image.filter(|_| plan.has(SWEEP)) {
            let grid = &image.buffers.shape().grid;
            step_mm = grid.spacing_mm().min_element();
            let cells = Cells::new(grid, scene.quality.lighting.cell_mm);
            let count = self.cells.reserve(gpu, &image, cells, false)?.count();
            self.cells.write(gpu, scene, &image, count as u32);
            self.lamp.write(gpu, light, step_mm);
            self.bind_open(gpu, passes, plan, scene)?;
            self.bind_sweeps(gpu, passes, plan, scene, &image, -towards)?;
        } else {
            self.cells.release();
            (self.carried, self.open) = (None, None);
        }
        self.lamp.bind(gpu, passes, plan, scene, (light, step_mm))?;
        Ok(Vec::new())
    }

    fn lit_march(&self) -> Option<LitMarch<'_>> {
        self.cells.lit_march()
    }

    fn work(&self) -> Option<LightWork> {
        self.work
    }

    #[cfg(test)]
    fn probe(&self) -> super::lit::Probe<'_> {
        super::lit::Probe { grid: self.cells.buffers(), ..Default::default() }
    }
}

/// Room for this many cells of 4 bytes.
fn room(
    gpu: &Gpu,
    held: &mut Option<(wgpu::Buffer, u64)>,
    label: &str,
    cells: u64,
) -> Result<(), RenderError> {
    if held.as_ref().is_none_or(|(_, room)| *room != cells) {
        *held = None;
        gpu.check_size("light of cells", 4 * cells)?;
        *held = Some((gpu.buffer(label, 4 * cells, WRITTEN), cells));
    }
    gpu.check()
}

impl ShadowVolumeLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let slice = UniformAtOffset(size_of::<Slice>() as u64);
        let kinds = [
            (0, Uniform),
            (11, Uniform),
            (12, Read),
            (13, Read),
            (14, Read),
            (15, Read),
            (32, slice),
            (33, Write),
            (34, Read),
            (37, Write),
            (38, Uniform),
        ];
        let of_open = [
            (0, Uniform),
            (1, Read),
            (2, Read),
            (3, Read),
            (34, Write),
            (36, Uniform),
            (38, Uniform),
            (39, UniformAtOffset(PART_BYTES)),
        ];
        Self {
            layout: bind_group_layout(gpu, "ShadowVolumeLight::layout", &kinds),
            open_layout: bind_group_layout(gpu, "ShadowVolumeLight::open_layout", &of_open),
            pipelines: Pipelines::default(),
            open_pipeline: None,
            cells: CellLight::new(gpu),
            carried: None,
            open: None,
            lamp: LampLight::new(gpu),
            placeholder: gpu.buffer("ShadowVolumeLight::placeholder", 16, WRITTEN),
            work: None,
        }
    }

    /// Binds the rays past the masks, if the plan has them and masks are stored as bricks.
    ///
    /// # Errors
    /// [`RenderError`].
    fn bind_open(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<(), RenderError> {
        let bricks = scene.bricks.filter(|_| plan.has(OPEN) && scene.opaque != Opaque::Nowhere);
        let (Some([bricks, words]), Some(cells)) = (bricks, self.cells.cells()) else {
            self.open = None;
            return Ok(());
        };
        let count = cells.count();
        room(gpu, &mut self.open, "ShadowVolumeLight::open", count as u64)?;
        let pipeline = match self.open_pipeline.take() {
            Some(known) => known,
            None => compute_pipeline(gpu, "shadow_volume/open", Some(&self.open_layout), &[])?,
        };
        self.open_pipeline = Some(pipeline.clone());
        let (uniforms, steps) = cell_dispatches(count as u32, gpu.is_software());
        let parts = gpu.buffer_with("ShadowVolumeLight::parts", &uniforms, wgpu::BufferUsages::UNIFORM);
        let (Some((open, _)), Some([_, grid])) = (&self.open, self.cells.buffers()) else { return Ok(()) };
        let entries = [
            (0, scene.view.as_entire_binding()),
            (1, bricks.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (34, open.as_entire_binding()),
            (36, self.lamp.uniform().as_entire_binding()),
            (38, grid.as_entire_binding()),
            (39, at_offset(&parts, PART_BYTES)),
        ];
        passes.bind_steps(gpu, OPEN, &self.open_layout, &entries, (vec![pipeline], steps));
        Ok(())
    }

    /// Binds a dispatch for each slice; `light` travels in this direction of the world.
    ///
    /// # Errors
    /// [`RenderError`].
    fn bind_sweeps(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
        light: DVec3,
    ) -> Result<(), RenderError> {
        let grid = &image.buffers.shape().grid;
        let Some(cells) = self.cells.cells().cloned() else { return Ok(()) };
        room(gpu, &mut self.carried, "ShadowVolumeLight::carried", cells.count() as u64)?;
        let with_masks = plan.has(OPEN) && self.open.is_some();
        let pipeline = self.pipeline(gpu, (image.buffers.tables().dimensions, with_masks))?;
        let (mut uniforms, mut steps) = (Vec::new(), Vec::new());
        let sweep = sweep(grid, &cells, light);
        let common = Slice {
            light: turned(scene.camera, light).as_vec3().to_array(),
            samples: sweep.samples(grid),
            ..of_sweep(&cells, &sweep)
        };
        let [x, y] = common.size.map(|s| s.div_ceil(8));
        let stride = number_strides(&cells)[sweep.axis];
        let mut before = NONE;
        let (mut met, mut own) = (NONE, NONE);
        let last = cells.dims[sweep.axis] - cells.ring;
        for (n, slice) in sweep.slices(&cells).enumerate() {
            let start = slice as u32 * stride;
            // Outside the face that light leaves through: the light of the slice inside once more.
            if n < last {
                (before, own) = (met, start);
            }
            steps.push(Dispatch { pipeline: 0, offset: uniforms.len() as u32, workgroups: [x, y, 1] });
            uniforms.extend_from_slice(bytemuck::bytes_of(&Slice { start, own, before, ..common }));
            uniforms.resize(steps.len() * STRIDE, 0);
            met = start;
        }
        let work = LightWork {
            slices: steps.len() as u32,
            samples: cells.count() as u64 * u64::from(common.samples),
            // Carried light read and written, the result written.
            bytes: 16 * cells.count() as u64,
        };
        self.work = Some(work);
        let slices = gpu.buffer_with("ShadowVolumeLight::slices", &uniforms, wgpu::BufferUsages::UNIFORM);
        let (Some((carried, _)), Some(of_grid)) = (&self.carried, self.cells.entries()) else {
            return Ok(());
        };
        let open = self.open.as_ref().map_or(&self.placeholder, |(open, _)| open);
        let entries = [
            (0, scene.view.as_entire_binding()),
            (32, at_offset(&slices, size_of::<Slice>() as u64)),
            (33, carried.as_entire_binding()),
            (34, open.as_entire_binding()),
        ];
        let entries = [&entries[..], &of_grid, &image.entries()].concat();
        passes.bind_steps(gpu, SWEEP, &self.layout, &entries, (vec![pipeline], steps));
        Ok(())
    }

    /// Compiled when first needed.
    fn pipeline(
        &mut self,
        gpu: &Gpu,
        kind: (Dimensions, bool),
    ) -> Result<wgpu::ComputePipeline, RenderError> {
        self.pipelines.get(gpu, kind, |(dimensions, with_masks)| {
            let [gradient_counts, joint] = dimensions.constants();
            let constants = [("with_masks", f64::from(u8::from(*with_masks))), gradient_counts, joint];
            compute_pipeline(gpu, "shadow_volume/sweep", Some(&self.layout), &constants)
        })
    }
}

/// Differences of cells' numbers from neighbour to neighbour along each axis.
fn number_strides(cells: &Cells) -> [u32; 3] {
    let [x, y, _] = cells.dims.map(|d| d as u32);
    [1, x, x * y]
}

/// What all slices of a sweep have in common.
fn of_sweep(cells: &Cells, sweep: &Sweep) -> Slice {
    let across = sweep.across();
    Slice {
        segment_mm: sweep.segment_mm as f32,
        shift: across.map(|a| sweep.shift[a] as f32),
        size: across.map(|a| cells.dims[a] as u32),
        strides: across.map(|a| number_strides(cells)[a]),
        ..Slice::default()
    }
}
