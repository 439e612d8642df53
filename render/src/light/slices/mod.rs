//! Lighting by slices (directional occlusion, Schott et al. 2009, and its combination with opaque geometry, 2012):
//! draws the image, and computes the light it transmits to opaque surfaces, which darken each other by vicinity occlusion
//! and in layers.
//!
//! A lamp beside the scene takes two runs over the slices, for light from before the scene and from behind it, which are mixed.
//!
//! Lifetimes: pipelines are created when a variant is first drawn; buffers (40 bytes per pixel, with opaque geometry
//! 48, for a mixture 20 more) once per size; the uniforms of the steps, 256 bytes for each of their rectangles, once per frame.

pub(crate) mod lamp;
#[cfg(test)]
mod lamp_tests;
#[cfg(test)]
pub(crate) mod medium_twin;
pub(crate) mod plan;
#[cfg(test)]
mod plan_tests;
pub(crate) mod reach;
#[cfg(test)]
mod reach_tests;
#[cfg(test)]
pub(crate) mod twin;
#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use glam::DVec3;
use glioscope_core::optics::{Camera, Sight, cone::Decay};

use self::{
    lamp::ellipse_points,
    plan::{Kernel, SlicePlan, SliceSettings, Step, disc_points},
    reach::{OpaqueBounds, Rect, ScreenBounds, StepRects, step_rects},
};
use super::{
    layers::{self, LAYERS, LayerLight},
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitScene, Measured, Opaque},
    vicinity::{self, VICINITY, VicinityLight},
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        pipelines::{BindingKind, Pipelines, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, workgroups_of},
    },
    image::{buffers::ImageBuffers, tables::Dimensions},
    scene::{Knob, LightSettings, LightingMode, Plan, Quality, SliceVariant},
    solid::view::{HAS_CONTEXT, HAS_OCCLUSION, LINEAR_LIGHT},
};

/// The context image by slices, with directional occlusion.
pub(crate) const SLICES: PassName = PassName::new("slices");
/// Converts the slices' result to the ray march's format.
pub(crate) const SLICES_FINISH: PassName = PassName::new("slices_finish");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::Slices,
    title: "Directional occlusion (slices)",
    summary: "Soft shadows of tissue on tissue and on the tumour; light comes from the eye",
    advice: super::lit::DEPTH_ORDER_AND_SIZE,
    takes_long: true,
    has_aperture: true,
    has_lamp: false,
    knobs: &[Knob::SliceMm],
    traces_masks: false,
    lights_smooth: true,
    most_cost: MOST_COST,
    first_cost: 0.02,
    passes: |kind| match kind {
        LitKind::Image => &[SLICES, SLICES_FINISH, LAYERS, VICINITY],
        LitKind::Masks | LitKind::Depths => &[SLICES, LAYERS, VICINITY],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        SLICES | SLICES_FINISH => no_image,
        LAYERS => layers::omission_reason(quality, no_opaque),
        VICINITY => vicinity::omission_reason(quality, no_opaque, no_image),
        _ => None,
    },
    flags: &[(VICINITY, HAS_OCCLUSION), (SLICES, HAS_CONTEXT | LINEAR_LIGHT)],
    image_pass: Some(SLICES),
    reads_arrows: |quality| {
        if quality.lighting.mutual.opaque_on_image {
            &[VICINITY, LAYERS, SLICES]
        } else {
            &[VICINITY, LAYERS]
        }
    },
    at_cost,
    measured: MEASURED,
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        variants: &[SliceVariant::PaperExact, SliceVariant::PaperApproximate, SliceVariant::Mended],
        max_twin_error: twin_tests::max_twin_error,
        decided_by_rounding: 0.0,
    },
    start: |gpu| Box::new(SliceLight::new(gpu)),
};

/// Cost of the reference: slices thinner than its 0.7 mm don't reduce the error.
const MOST_COST: f64 = 1.0 / 0.7;

/// `glioscope-bench accuracy --only light`: cost, RMS error on opaque surfaces and in tissue. A test compares them with
/// docs/accuracy.md.
const MEASURED: Measured = &[
    (0.004, [0.0926, 0.0436]),
    (0.015, [0.0220, 0.0337]),
    (0.03, [0.0156, 0.0342]),
    (0.06, [0.0140, 0.0330]),
    (0.125, [0.0128, 0.0336]),
    (0.25, [0.0123, 0.0329]),
    (0.5, [0.0113, 0.0305]),
    (1.0, [0.0113, 0.0310]),
    (MOST_COST, [0.0107, 0.0307]),
];

/// Thicker slices miss opaque surfaces, so the resolution is lowered first, down to its minimum. More points in a
/// footprint don't reduce the error.
fn at_cost(cost: f64) -> Quality {
    // Below and above balanced.
    let (less, more) = (cost.min(1.0), cost.max(1.0));
    let below_min_resolution = (less / 0.018).min(1.0);
    Quality {
        resolution_scale: less.powf(0.4).max(0.2),
        lighting: LightSettings {
            slice_mm: (less.powf(-0.13) * below_min_resolution.powf(-0.53)).min(6.0) / more,
            vicinity_samples: (64.0 * less.powf(0.4) * more.powf(1.72)).round().clamp(12.0, 118.0) as u32,
            layer_cell: layers::cell_at(less),
            ..LightSettings::DEFAULT
        },
        ..Quality::FULL
    }
}

/// The part of the light settings that the slices use, for a lamp's light.
pub(crate) fn slice_settings(settings: &LightSettings, camera: &Camera) -> SliceSettings {
    let lamp = settings.towards_lamp.then(|| {
        let ([right, up, back], towards) = (camera.axes(), settings.lamp.direction(camera));
        DVec3::new(towards.dot(right), towards.dot(up), -towards.dot(back))
    });
    SliceSettings {
        variant: settings.variant,
        aperture_deg: settings.aperture_deg,
        grid: settings.slice_grid,
        slice_mm: settings.slice_mm,
        reference_mm: settings.reference_mm,
        lamp,
    }
}

/// Bounds of the image's visible bricks that aren't behind the eye.
pub(super) fn visible_bounds(sight: &Sight, image: &ImageBuffers) -> Vec<ScreenBounds> {
    let bricks: Vec<_> = image.visible_bricks().collect();
    ScreenBounds::of_bricks(sight, &image.shape().grid.world_from_voxel(), &bricks)
}

/// The ranges of view depth that these take up, in order; those that touch or overlap are one.
pub(super) fn occupied_depths_mm(bounds: &[ScreenBounds]) -> Vec<(f64, f64)> {
    let mut all: Vec<_> = bounds.iter().map(|bounds| bounds.depths_mm).collect();
    all.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<(f64, f64)> = Vec::new();
    for (near, far) in all {
        match out.last_mut() {
            Some(last) if near <= last.1 => last.1 = last.1.max(far),
            _ => out.push((near, far)),
        }
    }
    out
}

/// Bytes from one step's uniform to the next.
const STRIDE: u64 = 256;
/// Bytes per pixel that are kept of an earlier run: radiance, transmittance and light on opaque geometry.
pub(super) const KEPT_BYTES: u64 = 20;

/// What a dispatch does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Entry {
    /// Initialises the buffers before the steps.
    Begin,
    /// The same, and keeps what an earlier run left.
    BeginAgain,
    Step,
    /// Mixes what was kept with what the last run left.
    Mix,
}

/// What a pipeline is specialised for.
#[derive(Clone, Copy, PartialEq, Eq)]
struct PipelineKey {
    entry: Entry,
    variant: SliceVariant,
    with_opaque: bool,
    /// Whether two lights are stored per pixel, whether or not the rectangle has opaque geometry.
    two_lights: bool,
    one_slice: bool,
    /// Whether opaque geometry doesn't occlude the image.
    opaque_transmits: bool,
    /// Whether opaque geometry blocks the light that it receives.
    opaque_on_opaque: bool,
    /// Whether light comes from a lamp.
    towards_lamp: bool,
    /// Whether that is behind the scene.
    from_behind: bool,
    /// Whether the eye's rays end at depths other than those of opaque geometry.
    ends_apart: bool,
    dimensions: Dimensions,
    is_empty: bool,
}

impl PipelineKey {
    /// Of what isn't a step.
    fn of_frame(scene: &LitScene<'_>, plan: &SlicePlan) -> Self {
        Self {
            entry: Entry::Begin,
            variant: scene.quality.lighting.variant,
            with_opaque: false,
            two_lights: scene.opaque != Opaque::Nowhere,
            one_slice: false,
            opaque_transmits: false,
            opaque_on_opaque: false,
            towards_lamp: scene.quality.lighting.towards_lamp,
            from_behind: plan.is_lit_from_behind(),
            ends_apart: false,
            dimensions: Dimensions::Value,
            is_empty: false,
        }
    }
}

struct Buffers {
    size: [u32; 2],
    lights_per_pixel: u64,
    /// Whether there is room for what an earlier run left.
    keeps: bool,
    lights: wgpu::Buffer,
    eye: wgpu::Buffer,
    notes: wgpu::Buffer,
}

impl Buffers {
    fn new(gpu: &Gpu, size: [u32; 2], lights_per_pixel: u64, keeps: bool) -> Self {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |label, bytes: u64| gpu.buffer(label, bytes, WRITTEN);
        let kept = if keeps { KEPT_BYTES } else { 0 };
        Self {
            size,
            lights_per_pixel,
            keeps,
            lights: buffer("SliceLight::lights", pixels * (8 * (lights_per_pixel + 1) + kept)),
            eye: buffer("SliceLight::eye", 16 * pixels),
            notes: buffer("SliceLight::notes", 8 * pixels),
        }
    }
}

/// The passes on the device.
struct SliceLight {
    layout: wgpu::BindGroupLayout,
    pipelines: Pipelines<PipelineKey>,
    slices: wgpu::Buffer,
    buffers: Option<Buffers>,
    layers: LayerLight,
    vicinity: VicinityLight,
    work: Option<LightWork>,
    /// For tests: every step processes the whole frame, as if opaque geometry were anywhere.
    everywhere: bool,
}

impl Light for SliceLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let mut notes = Vec::new();
        (self.work, self.buffers) = (None, self.buffers.take().filter(|_| plan.has(SLICES)));
        if let Some(image) = scene.image.filter(|_| plan.has(SLICES)) {
            notes = self.bind_slices(gpu, passes, scene, &image)?;
        }
        let mut lag_mm = None;
        if plan.has(LAYERS) {
            lag_mm = self.layers.bind(gpu, passes, scene, false)?;
        } else {
            self.layers.leave_out(gpu);
        }
        if plan.has(VICINITY) {
            let notes = self.buffers.as_ref().map(|b| &b.notes);
            self.vicinity.bind(gpu, passes, scene, notes, (&self.layers, lag_mm))?;
        }
        Ok(notes)
    }

    fn work(&self) -> Option<LightWork> {
        self.work
    }

    #[cfg(test)]
    fn probe(&self) -> super::lit::Probe<'_> {
        let buffers = self.buffers.as_ref();
        super::lit::Probe {
            notes: buffers.map(|b| &b.notes),
            carried_light: buffers.map(|b| &b.lights),
            eye: buffers.map(|b| &b.eye),
            ..Default::default()
        }
    }

    #[cfg(test)]
    fn run_everywhere(&mut self) {
        self.everywhere = true;
    }
}

impl SliceLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let part = UniformAtOffset(2 * size_of::<uniforms::Part>() as u64);
        let kinds = [
            (0, Uniform),
            (4, Read),
            (11, Uniform),
            (12, Read),
            (13, Read),
            (14, Read),
            (15, Read),
            (31, Uniform),
            (32, part),
            (33, Write),
            (34, Write),
            (35, Write),
        ];
        Self {
            layout: bind_group_layout(gpu, "SliceLight::layout", &kinds),
            pipelines: Pipelines::default(),
            slices: gpu.uniform::<uniforms::Slices>("SliceLight::slices"),
            buffers: None,
            layers: LayerLight::new(gpu),
            vicinity: VicinityLight::new(gpu),
            work: None,
            everywhere: false,
        }
    }

    /// Binds the steps of a frame and the finishing pass. Returns notes on changed settings and omitted slices.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is bound then.
    fn bind_slices(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let settings = &scene.quality.lighting;
        let has_opaque = scene.opaque != Opaque::Nowhere;
        let lights_per_pixel = if has_opaque { 2 } else { 1 };
        let requested = slice_settings(settings, scene.camera);
        let cases = requested.cases();
        let keeps = cases.len() > 1;
        if self
            .buffers
            .as_ref()
            .is_none_or(|b| (b.size, b.lights_per_pixel, b.keeps) != (scene.size, lights_per_pixel, keeps))
        {
            self.buffers = None;
            self.buffers = Some(Buffers::new(gpu, scene.size, lights_per_pixel, keeps));
            gpu.check()?;
        }
        let sight = Sight::new(scene.camera, scene.size);
        let bricks = visible_bounds(&sight, image.buffers);
        let occupied = occupied_depths_mm(&bricks);
        let whole = occupied.first().zip(occupied.last()).map(|(first, last)| (first.0, last.1));
        let mut notes: Vec<String> = requested.mixture_note().into_iter().collect();
        let mut dispatches = StepDispatches::default();
        let (mut work, mut pixels) = (LightWork::default(), [0, 0]);
        let mut uniform = None;
        for (number, (case, share)) in cases.iter().enumerate() {
            let mut plan = SlicePlan::new(case, &sight, whole, &occupied);
            if plan.steps.is_empty() {
                // An empty step, so that the buffers that later passes read are written.
                let kernel = Kernel::Lattice { side: 1, stride_px: 1, center: 0.0 };
                plan.steps.push(Step { depth_mm: scene.reference_mm, slices: 1, kernel, empty: true });
            }
            let rects = self.rects_of(gpu, scene, &plan, &sight, &bricks);
            let entry = if number == 0 { Entry::Begin } else { Entry::BeginAgain };
            self.add_run(gpu, &mut dispatches, (scene, image), (&plan, &rects, entry), &mut work)?;
            if keeps && number + 1 == cases.len() {
                let key = PipelineKey { entry: Entry::Mix, ..PipelineKey::of_frame(scene, &plan) };
                let part = uniforms::Part { share: *share as f32, ..uniforms::Part::default() };
                let whole = Rect::whole(scene.size).in_workgroups(scene.size);
                dispatches.add(self.pipeline(gpu, key)?, key, part, &[whole]);
            }
            let all = rects.iter().flat_map(|r| r.with_opaque.iter().chain(&r.without_opaque));
            let of_frame = Rect::whole(scene.size).in_workgroups(scene.size).pixels();
            pixels = [
                pixels[0] + all.map(Rect::pixels).sum::<u64>(),
                pixels[1] + of_frame * plan.steps.len() as u64,
            ];
            // The cases of a mixture differ in their order alone.
            uniform.get_or_insert_with(|| slices_uniform(&plan, scene));
            let fresh: Vec<String> = plan.notes.into_iter().filter(|note| !notes.contains(note)).collect();
            notes.extend(fresh);
        }
        let [processed, total] = pixels;
        if processed < total {
            let share = 100.0 * (1.0 - processed as f64 / total as f64);
            notes.push(format!(
                "{share:.0} % of the slices' pixels are left out: no light is lost there yet, or none asked for any more"
            ));
        }
        self.work = Some(work);
        let (Some(buffers), Some(uniform)) = (&self.buffers, uniform) else { return Ok(Vec::new()) };
        gpu.queue.write_buffer(&self.slices, 0, bytemuck::bytes_of(&uniform));
        // A binding spans two parts, so the last one extends past its own.
        let mut bytes = vec![0u8; (dispatches.parts.len() + 1) * STRIDE as usize];
        for (part, slot) in dispatches.parts.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            let part = bytemuck::bytes_of(part);
            slot[..part.len()].copy_from_slice(part);
        }
        let parts = gpu.buffer_with("SliceLight::parts", &bytes, wgpu::BufferUsages::UNIFORM);
        let part = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &parts,
            offset: 0,
            size: wgpu::BufferSize::new(2 * size_of::<uniforms::Part>() as u64),
        });
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (31, self.slices.as_entire_binding()),
            (32, part),
            (33, buffers.lights.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.notes.as_entire_binding()),
        ];
        let entries = [&entries[..], &image.entries()].concat();
        let workgroups = workgroups_of(scene.size);
        let steps =
            (dispatches.pipelines.into_iter().map(|(_, pipeline)| pipeline).collect(), dispatches.steps);
        passes.bind_steps(gpu, SLICES, &self.layout, &entries, steps);
        let finish = [
            (0, scene.view.as_entire_binding()),
            (6, scene.marched.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.notes.as_entire_binding()),
        ];
        passes.bind(gpu, SLICES_FINISH, "slices/finish", &finish, workgroups)?;
        Ok(notes)
    }

    /// What each step of a run must process.
    fn rects_of(
        &self,
        gpu: &Gpu,
        scene: &LitScene<'_>,
        plan: &SlicePlan,
        sight: &Sight,
        bricks: &[ScreenBounds],
    ) -> Vec<StepRects> {
        let opaque_bounds = match (scene.opaque, scene.tumor) {
            (Opaque::Nowhere, _) => OpaqueBounds::None,
            (Opaque::InMasks, Some(tumor)) => ScreenBounds::of(sight, &tumor.grid().corners_mm())
                .map_or(OpaqueBounds::None, OpaqueBounds::Within),
            _ => OpaqueBounds::Anywhere,
        };
        let mutual = &scene.quality.lighting.mutual;
        let occluders = (mutual.opaque_on_image || opaque_on_opaque(scene, plan), mutual.image_on_image);
        let mut out = if self.everywhere {
            vec![StepRects::everywhere(scene.size); plan.steps.len()]
        } else {
            step_rects(plan, sight, bricks, opaque_bounds, occluders)
        };
        if !gpu.is_software() {
            out.iter_mut().for_each(StepRects::merge_small);
        }
        out
    }

    /// Adds the dispatches of one run over the slices.
    ///
    /// # Errors
    /// [`RenderError`].
    fn add_run(
        &mut self,
        gpu: &Gpu,
        dispatches: &mut StepDispatches,
        (scene, image): (&LitScene<'_>, &LitImage<'_>),
        (plan, all_rects, entry): (&SlicePlan, &[StepRects], Entry),
        work: &mut LightWork,
    ) -> Result<(), RenderError> {
        let settings = &scene.quality.lighting;
        let has_opaque = scene.opaque != Opaque::Nowhere;
        let from_behind = plan.is_lit_from_behind();
        let whole = Rect::whole(scene.size).in_workgroups(scene.size);
        let dimensions = image.buffers.tables().dimensions;
        let begins = uniforms::Part {
            depth: (plan.front_mm() - scene.reference_mm) as f32,
            slices: plan.slices(),
            ..uniforms::Part::default()
        };
        let of_frame = PipelineKey { entry, ..PipelineKey::of_frame(scene, plan) };
        // From back to front it isn't known before the end where half is hidden: a march finds it.
        let key = if from_behind {
            PipelineKey { with_opaque: has_opaque, ends_apart: scene.ends_apart, dimensions, ..of_frame }
        } else {
            of_frame
        };
        dispatches.add(self.pipeline(gpu, key)?, key, begins, &[whole]);
        work.slices += plan.slices();
        for (number, (step, rects)) in plan.steps.iter().zip(all_rects).enumerate() {
            let mut part = step_uniform(step, number, scene.reference_mm, settings.variant);
            part.is_last = u32::from(number + 1 == plan.steps.len());
            for (rects, with_opaque) in [(&rects.with_opaque, has_opaque), (&rects.without_opaque, false)] {
                if rects.is_empty() {
                    continue;
                }
                let key = PipelineKey {
                    entry: Entry::Step,
                    with_opaque,
                    one_slice: settings.variant == SliceVariant::Mended && step.slices == 1,
                    opaque_transmits: with_opaque && !settings.mutual.opaque_on_image,
                    opaque_on_opaque: with_opaque && opaque_on_opaque(scene, plan),
                    ends_apart: with_opaque && scene.ends_apart,
                    dimensions,
                    is_empty: step.empty,
                    ..of_frame
                };
                dispatches.add(self.pipeline(gpu, key)?, key, part, rects);
                let range = if step.empty { 0 } else { 8 };
                let depths = 4 * u64::from(with_opaque) + 4 * u64::from(key.ends_apart);
                let pixels: u64 = rects.iter().map(Rect::pixels).sum();
                work.samples += pixels * u64::from(step.slices);
                work.bytes += pixels * (2 * 4 * (1 + u64::from(has_opaque)) + range + depths);
            }
        }
        Ok(())
    }

    /// The pipeline of a key, compiled when first needed.
    fn pipeline(&mut self, gpu: &Gpu, key: PipelineKey) -> Result<wgpu::ComputePipeline, RenderError> {
        self.pipelines.get(gpu, key, |key| {
            let variant = match key.variant {
                SliceVariant::PaperExact => 0.0,
                SliceVariant::PaperApproximate => 1.0,
                SliceVariant::Mended => 2.0,
            };
            let flag = |on: bool| f64::from(u8::from(on));
            let [gradient_counts, joint] = key.dimensions.constants();
            let constants = [
                ("variant", variant),
                ("with_solid", flag(key.with_opaque)),
                ("two_lights", flag(key.two_lights)),
                ("one_slice", flag(key.one_slice)),
                ("solid_lets_through", flag(key.opaque_transmits)),
                ("solid_on_solid", flag(key.opaque_on_opaque)),
                ("towards_lamp", flag(key.towards_lamp)),
                ("from_behind", flag(key.from_behind)),
                ("ends_apart", flag(key.ends_apart)),
                gradient_counts,
                joint,
                ("is_empty", flag(key.is_empty)),
            ];
            match key.entry {
                Entry::Step => compute_pipeline(gpu, "slices/step", Some(&self.layout), &constants),
                of_frame => {
                    let more = [
                        ("keeps", flag(of_frame == Entry::BeginAgain)),
                        ("mixes", flag(of_frame == Entry::Mix)),
                    ];
                    let constants = [&constants[..], &more].concat();
                    compute_pipeline(gpu, "slices/begin", Some(&self.layout), &constants)
                }
            }
        })
    }
}

/// Whether opaque surfaces block each other's light from slice to slice: in the paper's variants; in the mended one layers do,
/// which know no light from behind.
fn opaque_on_opaque(scene: &LitScene<'_>, plan: &SlicePlan) -> bool {
    let LightSettings { variant, mutual, .. } = &scene.quality.lighting;
    (*variant != SliceVariant::Mended || plan.is_lit_from_behind()) && mutual.opaque_on_opaque
}

fn slices_uniform(plan: &SlicePlan, scene: &LitScene<'_>) -> uniforms::Slices {
    let shades = scene.quality.lighting.mutual.image_on_image;
    uniforms::Slices {
        slice_mm: plan.slice_mm as f32,
        flags: if shades { uniforms::IMAGE_ON_IMAGE } else { 0 },
        strength: scene.quality.strength(),
        lag_px: plan.lamp.map_or(0.0, |cone| cone.lag_px()) as f32,
        decay: plan.decay.as_deref().map_or([[0.0; 4]; 257], Decay::packed),
    }
}

/// Dispatches of a frame.
#[derive(Default)]
struct StepDispatches {
    pipelines: Vec<(PipelineKey, wgpu::ComputePipeline)>,
    parts: Vec<uniforms::Part>,
    steps: Vec<Dispatch>,
}

impl StepDispatches {
    /// Adds a dispatch of the workgroups of these disjoint rectangles.
    fn add(
        &mut self,
        pipeline: wgpu::ComputePipeline,
        key: PipelineKey,
        part: uniforms::Part,
        rects: &[Rect],
    ) {
        let index = self.pipelines.iter().position(|(known, _)| *known == key);
        let pipeline = index.unwrap_or_else(|| {
            self.pipelines.push((key, pipeline));
            self.pipelines.len() - 1
        });
        let offset = (self.parts.len() as u64 * STRIDE) as u32;
        let (areas, workgroups) = reach::areas(rects);
        self.parts.push(uniforms::Part { areas, columns: workgroups[0], ..part });
        self.steps.push(Dispatch { pipeline, offset, workgroups });
    }
}

/// The uniform of step `number`, for the whole frame.
fn step_uniform(step: &Step, number: usize, reference_mm: f64, variant: SliceVariant) -> uniforms::Part {
    let mut out = uniforms::Part {
        depth: (step.depth_mm - reference_mm) as f32,
        slices: step.slices,
        side: 1,
        stride: 1,
        share: 1.0,
        turn: (number % 2) as u32,
        ..uniforms::Part::default()
    };
    match step.kernel {
        Kernel::Disc { grid, radius_px, radius_mm } => {
            out.side = grid;
            out.radius = radius_px as f32;
            out.radius_mm = radius_mm as f32;
            out.share = 1.0 / disc_points(grid).len() as f32;
        }
        Kernel::Lattice { side, stride_px, center } => {
            out.side = side;
            out.stride = stride_px as i32;
            out.center = center as f32;
            out.share = 1.0 / (side * side) as f32;
        }
        Kernel::Ellipse { grid, scale, shift_px, axes_px, pixel_mm } => {
            let in_disc = variant != SliceVariant::Mended;
            out.side = grid;
            out.share = 1.0 / ellipse_points(grid, in_disc).len() as f32;
            out.scale = scale as f32;
            out.shift = shift_px.map(|px| px as f32);
            [out.along, out.across] = axes_px.map(|axis| axis.map(|px| px as f32));
            out.pixel_mm = pixel_mm as f32;
        }
    }
    out
}
