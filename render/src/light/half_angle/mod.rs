//! Hard shadows of one placed lamp by half-angle slicing (Kniss et al. 2003, thesis 3.2.1): the image in slabs perpendicular
//! to a vector between light and sight, so that one order of slabs serves both; opaque geometry by a ray for each pixel.
//!
//! Where light and sight are at right angles, the half vector jumps. Hysteresis would only move the jump and make a frame
//! depend on earlier ones; here both cases are drawn near it and mixed, so that a frame depends on its
//! scene alone and changes gradually.
//!
//! Lifetimes: pipelines are created when first needed; the eye's buffer (24 bytes per pixel, near right angles 40) once per
//! size, the light's (16 bytes per texel, near right angles 32) whenever it grows; the uniforms of the slabs once per frame.

pub(crate) mod lamp;
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
    lamp::{LAMP, LAMP_THROUGH_IMAGE, LampLight},
    plan::{Case, HalfAnglePlan, Requested, turned},
    uniforms::{Finish, Slab, Texel},
};
use super::{
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitScene, Opaque, no_strength},
    slices::reach::Rect,
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        pipelines::{BindingKind, Pipelines, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, Shader, workgroups_of},
    },
    image::tables::Dimensions,
    scene::{Knob, LightSettings, LightingMode, Plan, Quality},
    solid::view::{HAS_CONTEXT, HAS_OCCLUSION, LINEAR_LIGHT, in_camera_space},
};

/// Initial state of the eye's and the light's buffers.
pub(crate) const BEGIN: PassName = PassName::new("half_angle_begin");
/// The context image by slabs, with the lamp's shadows.
pub(crate) const HALF_ANGLE: PassName = PassName::new("half_angle");
/// Converts the slabs' result to the ray march's format.
pub(crate) const FINISH: PassName = PassName::new("half_angle_finish");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::HalfAngle,
    title: "Placed lamp (half-angle slices)",
    summary: "Hard shadows of one lamp across the whole scene",
    advice: "Recommended for absolute depth in CT and other clearly structured images",
    takes_long: true,
    has_aperture: false,
    has_lamp: true,
    knobs: &[Knob::SliceMm],
    traces_masks: true,
    lights_smooth: true,
    most_cost: 4.0,
    first_cost: 0.015,
    passes: |kind| match kind {
        LitKind::Image => &[BEGIN, HALF_ANGLE, FINISH, LAMP, LAMP_THROUGH_IMAGE],
        LitKind::Masks | LitKind::Depths => &[HALF_ANGLE, LAMP],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        BEGIN | HALF_ANGLE | FINISH => no_image,
        LAMP => no_opaque.or(no_strength(quality)),
        LAMP_THROUGH_IMAGE => no_opaque.or(no_image).or(no_strength(quality)),
        _ => None,
    },
    flags: &[(LAMP, HAS_OCCLUSION), (HALF_ANGLE, HAS_CONTEXT | LINEAR_LIGHT)],
    image_pass: Some(HALF_ANGLE),
    reads_arrows: |_| &[LAMP, LAMP_THROUGH_IMAGE, BEGIN],
    at_cost,
    measured: &[],
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        max_twin_error: twin_tests::max_twin_error,
        ..super::screen::ROW.suite
    },
    start: |gpu| Box::new(HalfAngleLight::new(gpu)),
};

fn at_cost(cost: f64) -> Quality {
    // Below and above balanced.
    let (less, more) = (cost.min(1.0), cost.max(1.0));
    let finer = |least: f64| (less.powf(-0.3) * more.powf(-0.5)).min(4.0).max(least);
    Quality {
        resolution_scale: less.powf(0.3).max(0.2),
        lighting: LightSettings { slice_mm: finer(0.4), lamp_texel_mm: finer(0.4), ..LightSettings::DEFAULT },
        ..Quality::FULL
    }
}

/// Bytes from one dispatch's uniform to the next, the largest alignment of any device.
const STRIDE: usize = 256;

/// What a pipeline is specialised for.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    BeginEye { ends_apart: bool },
    BeginLight { with_masks: bool },
    Light(Dimensions),
    Eye { ahead: bool, dimensions: Dimensions },
}

struct Buffers {
    size: [u32; 2],
    layers: u64,
    eye: wgpu::Buffer,
    ranges: wgpu::Buffer,
}

/// The passes on the device.
struct HalfAngleLight {
    begin_layout: wgpu::BindGroupLayout,
    layout: wgpu::BindGroupLayout,
    pipelines: Pipelines<Kind>,
    buffers: Option<Buffers>,
    /// The light's buffer, and the texels that there is room for.
    lights: Option<(wgpu::Buffer, u64)>,
    finish: wgpu::Buffer,
    lamp: LampLight,
    /// For views without bricks.
    placeholder: wgpu::Buffer,
    work: Option<LightWork>,
    /// Every slab processes the whole frame and all light.
    #[cfg(test)]
    everywhere: bool,
}

impl Light for HalfAngleLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let light = -turned(scene.camera, scene.quality.lighting.lamp.direction(scene.camera));
        let mut notes = Vec::new();
        self.work = None;
        if let Some(image) = scene.image.filter(|_| plan.has(HALF_ANGLE)) {
            let slabs = self.plan(scene, &image, light);
            self.bind_slabs(gpu, passes, scene, &image, (&slabs, light))?;
            self.lamp.bind(gpu, passes, plan, scene, (light, slabs.slab_mm))?;
            notes = slabs.notes;
        } else {
            (self.buffers, self.lights) = (None, None);
            self.lamp.bind(gpu, passes, plan, scene, (light, 1.0))?;
        }
        Ok(notes)
    }

    fn work(&self) -> Option<LightWork> {
        self.work
    }

    #[cfg(test)]
    fn probe(&self) -> super::lit::Probe<'_> {
        super::lit::Probe { eye: self.buffers.as_ref().map(|b| &b.eye), ..Default::default() }
    }

    #[cfg(test)]
    fn run_everywhere(&mut self) {
        self.everywhere = true;
    }
}

/// Dispatches of a pass of slabs.
#[derive(Default)]
struct Steps {
    pipelines: Vec<(Kind, wgpu::ComputePipeline)>,
    uniforms: Vec<u8>,
    dispatches: Vec<Dispatch>,
}

impl Steps {
    /// Adds a dispatch over a rectangle of whole workgroups.
    fn add(&mut self, (kind, pipeline): (Kind, wgpu::ComputePipeline), slab: Slab, rect: Rect) {
        let index = self.pipelines.iter().position(|(known, _)| *known == kind);
        let index = index.unwrap_or_else(|| {
            self.pipelines.push((kind, pipeline));
            self.pipelines.len() - 1
        });
        let [x, y] = rect.workgroups();
        let offset = self.uniforms.len() as u32;
        let first = rect.low.map(|c| c.max(0) as u32);
        self.uniforms.extend_from_slice(bytemuck::bytes_of(&Slab { first, ..slab }));
        self.uniforms.resize(offset as usize + STRIDE, 0);
        self.dispatches.push(Dispatch { pipeline: index, offset, workgroups: [x, y, 1] });
    }

    fn bind(
        self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        pass: PassName,
        layout: &wgpu::BindGroupLayout,
        entries: &[(u32, wgpu::BindingResource<'_>)],
    ) {
        let uniforms = gpu.buffer_with("HalfAngleLight::slabs", &self.uniforms, wgpu::BufferUsages::UNIFORM);
        let slab = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &uniforms,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Slab>() as u64),
        });
        let entries = [entries, &[(32, slab)]].concat();
        let pipelines = self.pipelines.into_iter().map(|(_, pipeline)| pipeline).collect();
        passes.bind_steps(gpu, pass, layout, &entries, (pipelines, self.dispatches));
    }
}

impl HalfAngleLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let slab = UniformAtOffset(size_of::<Slab>() as u64);
        let both = [(0, Uniform), (11, Uniform), (32, slab), (33, Write), (34, Write), (35, Write)];
        let begin = [(1, Read), (2, Read), (3, Read), (4, Read)];
        let image = [(12, Read), (13, Read), (14, Read), (15, Read)];
        Self {
            begin_layout: bind_group_layout(
                gpu,
                "HalfAngleLight::begin_layout",
                &[&both[..], &begin].concat(),
            ),
            layout: bind_group_layout(gpu, "HalfAngleLight::layout", &[&both[..], &image].concat()),
            pipelines: Pipelines::default(),
            buffers: None,
            lights: None,
            finish: gpu.uniform::<Finish>("HalfAngleLight::finish"),
            lamp: LampLight::new(gpu),
            placeholder: gpu.buffer("HalfAngleLight::placeholder", 16, WRITTEN),
            work: None,
            #[cfg(test)]
            everywhere: false,
        }
    }

    fn plan(&self, scene: &LitScene<'_>, image: &LitImage<'_>, light: DVec3) -> HalfAnglePlan {
        let settings = &scene.quality.lighting;
        let (camera, reference_mm) = (scene.camera, scene.reference_mm);
        let requested = Requested {
            light,
            center: in_camera_space(camera, reference_mm, image.volume.grid().center_mm()),
            slab_mm: settings.slice_mm,
            texel_mm: settings.lamp_texel_mm,
            voxel_mm: image.volume.grid().spacing_mm().min_element(),
        };
        let bricks: Vec<_> = image.buffers.visible_bricks().collect();
        let world_from_voxel = image.buffers.shape().grid.world_from_voxel();
        #[cfg_attr(not(test), allow(unused_mut, reason = "tests widen it"))]
        let mut plan =
            HalfAnglePlan::new(&requested, (camera, reference_mm, scene.size), &world_from_voxel, &bricks);
        #[cfg(test)]
        if self.everywhere {
            plan.widen(scene.size);
        }
        plan
    }

    /// Binds the passes of the image.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is bound then.
    fn bind_slabs(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
        (plan, light): (&HalfAnglePlan, DVec3),
    ) -> Result<(), RenderError> {
        let layers = plan.cases.len().max(1) as u64;
        self.reserve(gpu, scene.size, plan, layers)?;
        let single = |v: DVec3| v.as_vec3().to_array();
        let of_case = |layer: usize, case: Option<&Case>| Slab {
            normal: single(case.map_or(DVec3::Z, |case| case.normal)),
            light: single(light),
            slab_mm: plan.slab_mm as f32,
            across: single(plan.across),
            per_mm: plan.per_mm as f32,
            down: single(plan.down),
            strength: scene.quality.strength(),
            origin: plan.origin.as_vec2().to_array(),
            texels: plan.texels,
            layer: layer as u32,
            ..Slab::default()
        };
        let dimensions = image.buffers.tables().dimensions;
        let whole = Rect::whole(scene.size).in_workgroups(scene.size);
        let all_light = Rect::whole(plan.texels).in_workgroups(plan.texels);
        let begin_eye = Kind::BeginEye { ends_apart: scene.ends_apart };
        let begin_light =
            Kind::BeginLight { with_masks: scene.opaque != Opaque::Nowhere && scene.bricks.is_some() };
        let (mut begin, mut steps) = (Steps::default(), Steps::default());
        if plan.cases.is_empty() {
            begin.add(self.pipeline(gpu, begin_eye)?, of_case(0, None), whole);
        }
        let mut work = LightWork::default();
        for (layer, case) in plan.cases.iter().enumerate() {
            let common = of_case(layer, Some(case));
            begin.add(self.pipeline(gpu, begin_eye)?, common, whole);
            begin.add(self.pipeline(gpu, begin_light)?, common, all_light);
            for slab in &case.slabs {
                let uniform = Slab { front: slab.front as f32, ..common };
                if !slab.eye.is_empty() {
                    let kind = Kind::Eye { ahead: case.ahead, dimensions };
                    steps.add(self.pipeline(gpu, kind)?, uniform, slab.eye);
                }
                steps.add(self.pipeline(gpu, Kind::Light(dimensions))?, uniform, slab.light);
                let [eye, light] = [slab.eye.pixels(), slab.light.pixels()];
                work.slices += 1;
                work.samples += eye + light;
                // Intervals of the eye, and texels.
                work.bytes += 8 * eye + 16 * light;
            }
        }
        self.work = Some(work);
        let weight = plan.cases.get(1).map_or(0.0, |case| case.weight) as f32;
        let finish = Finish { weight, step_mm: plan.slab_mm as f32, ..Finish::default() };
        gpu.queue.write_buffer(&self.finish, 0, bytemuck::bytes_of(&finish));
        let (Some(buffers), Some((lights, _))) = (&self.buffers, &self.lights) else { return Ok(()) };
        let [bricks, words] = scene.bricks.unwrap_or([&self.placeholder; 2]);
        let both = [
            (0, scene.view.as_entire_binding()),
            (11, image.context.as_entire_binding()),
            (33, lights.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.ranges.as_entire_binding()),
        ];
        let of_begin = [
            (1, bricks.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
        ];
        begin.bind(gpu, passes, BEGIN, &self.begin_layout, &[&both[..], &of_begin].concat());
        let of_image = image.entries().into_iter().filter(|(number, _)| *number != 11).collect::<Vec<_>>();
        if !steps.dispatches.is_empty() {
            steps.bind(gpu, passes, HALF_ANGLE, &self.layout, &[&both[..], &of_image].concat());
        }
        let of_finish = [
            (0, scene.view.as_entire_binding()),
            (6, scene.marched.as_entire_binding()),
            (34, buffers.eye.as_entire_binding()),
            (35, buffers.ranges.as_entire_binding()),
            (36, self.finish.as_entire_binding()),
        ];
        let entries = [&of_finish[..], &image.entries()].concat();
        let [gradient_counts, joint] = dimensions.constants();
        let constants = [("two_cases", f64::from(u8::from(layers > 1))), gradient_counts, joint];
        let shader = Shader { file: "half_angle/finish", constants: &constants };
        passes.bind(gpu, FINISH, shader, &entries, workgroups_of(scene.size))
    }

    /// Buffers of a frame's size, and room for the light.
    ///
    /// # Errors
    /// [`RenderError`]: they don't fit.
    fn reserve(
        &mut self,
        gpu: &Gpu,
        size: [u32; 2],
        plan: &HalfAnglePlan,
        layers: u64,
    ) -> Result<(), RenderError> {
        if self.buffers.as_ref().is_none_or(|b| (b.size, b.layers) != (size, layers)) {
            self.buffers = None;
            let pixels = u64::from(size[0]) * u64::from(size[1]);
            gpu.check_size("half-angle slices", 16 * pixels * layers)?;
            self.buffers = Some(Buffers {
                size,
                layers,
                eye: gpu.buffer("HalfAngleLight::eye", 16 * pixels * layers, WRITTEN),
                ranges: gpu.buffer("HalfAngleLight::ranges", 8 * pixels, WRITTEN),
            });
        }
        let texels = u64::from(plan.texels[0]) * u64::from(plan.texels[1]) * layers;
        if self.lights.as_ref().is_none_or(|(_, room)| *room < texels) {
            self.lights = None;
            let bytes = size_of::<Texel>() as u64 * texels;
            gpu.check_size("light of the lamp", bytes)?;
            self.lights = Some((gpu.buffer("HalfAngleLight::lights", bytes, WRITTEN), texels));
        }
        gpu.check()
    }

    /// The pipeline of a kind, compiled when first needed.
    fn pipeline(&mut self, gpu: &Gpu, kind: Kind) -> Result<(Kind, wgpu::ComputePipeline), RenderError> {
        let flag = |on: bool| f64::from(u8::from(on));
        let pipeline = self.pipelines.get(gpu, kind, |kind| match *kind {
            Kind::BeginEye { ends_apart } => {
                let constants = [("ends_apart", flag(ends_apart))];
                compute_pipeline(gpu, "half_angle/begin_eye", Some(&self.begin_layout), &constants)
            }
            Kind::BeginLight { with_masks } => {
                let constants = [("with_masks", flag(with_masks))];
                compute_pipeline(gpu, "half_angle/begin_light", Some(&self.begin_layout), &constants)
            }
            Kind::Light(dimensions) => {
                compute_pipeline(gpu, "half_angle/light", Some(&self.layout), &dimensions.constants())
            }
            Kind::Eye { ahead, dimensions } => {
                let [gradient_counts, joint] = dimensions.constants();
                let constants = [("ahead", flag(ahead)), gradient_counts, joint];
                compute_pipeline(gpu, "half_angle/eye", Some(&self.layout), &constants)
            }
        })?;
        Ok((kind, pipeline))
    }
}
