//! Paths of light for explaining: Monte Carlo on the device, through the image and among the masks, with single or many
//! scatterings (Kajiya 1986; the interreflection and scattering of thesis chapter 5), in the light of a white sky and a lamp with an extent.
//!
//! A pixel's paths are in two halves that are independent of each other. Their difference estimates the frame's error, and
//! tells which tiles of pixels have enough. Each path is decided by its pixel and its number, so that a frame depends on its
//! scene and its number of paths alone. Paths are long: a frame is one dispatch for each two of a pixel, so that it can be
//! drawn in parts.
//!
//! The image is left out in and in front of the masks' box, and what lies behind the eye's plane doesn't count, as
//! everywhere. Tubes, arrows and ellipsoids are lit but known by depths alone: no path meets them.
//!
//! Lifetimes: pipelines when first needed; 48 bytes per pixel once per size; a number per brick once per image and transfer
//! function; 48 bytes per two paths once per frame.

pub(crate) mod majorants;
#[cfg(test)]
mod monte_carlo_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;
#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use std::sync::Arc;

use self::uniforms::{Pixel, Step, paths_of_half};
use super::{
    half_angle::plan::turned,
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitScene, Opaque, StandardError, no_strength},
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        pipelines::{BindingKind, Pipelines, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, Shader, workgroups_of},
    },
    image::{ContextVolume, TransferFunction, tables::Dimensions, uniforms::Context},
    scene::{Knob, LightSettings, LightingMode, PathSettings, Plan, Quality},
    solid::view::{HAS_CONTEXT, HAS_OCCLUSION, LINEAR_LIGHT, TINTED},
};

/// Where paths begin on opaque geometry.
pub(crate) const BEGIN_SURFACES: PassName = PassName::new("paths_begin_surfaces");
/// Paths from opaque geometry.
pub(crate) const SURFACES: PassName = PassName::new("paths_from_surfaces");
/// Their light.
pub(crate) const LIGHT: PassName = PassName::new("light_of_paths");
/// Where the image is seen, and how much of it.
pub(crate) const BEGIN_IMAGE: PassName = PassName::new("paths_begin_image");
/// Paths from the image.
pub(crate) const IMAGE: PassName = PassName::new("paths_from_image");
/// Their light in the ray march's format.
pub(crate) const FINISH_IMAGE: PassName = PassName::new("paths_finish_image");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::PathTraced,
    title: "Path traced (explaining)",
    summary: "Sky and lamp with light scattered many times: for pictures that explain, grainy while something moves",
    advice: "For explaining to others, not for reading: light that bounces hides edges and adds colours",
    takes_long: true,
    has_aperture: false,
    has_lamp: true,
    knobs: &[Knob::Paths, Knob::Bounces, Knob::Anisotropy, Knob::LampShare, Knob::LampRadiusDeg],
    traces_masks: true,
    lights_smooth: true,
    most_cost: 16.0,
    first_cost: 0.06,
    passes: |kind| match kind {
        LitKind::Image => &[BEGIN_SURFACES, SURFACES, LIGHT, BEGIN_IMAGE, IMAGE, FINISH_IMAGE],
        LitKind::Masks | LitKind::Depths => &[BEGIN_SURFACES, SURFACES, LIGHT, IMAGE],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        BEGIN_SURFACES | SURFACES | LIGHT => no_opaque.or(no_strength(quality)),
        BEGIN_IMAGE | IMAGE | FINISH_IMAGE => no_image,
        _ => None,
    },
    flags: &[(LIGHT, HAS_OCCLUSION | TINTED), (IMAGE, HAS_CONTEXT | LINEAR_LIGHT)],
    image_pass: Some(IMAGE),
    reads_arrows: |_| &[BEGIN_SURFACES, SURFACES, LIGHT, BEGIN_IMAGE],
    at_cost,
    measured: &[],
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        max_twin_error: twin_tests::max_twin_error,
        decided_by_rounding: 0.02,
        ..super::screen::ROW.suite
    },
    start: |gpu| Box::new(PathLight::new(gpu)),
};

fn at_cost(cost: f64) -> Quality {
    let paths = PathSettings { most: ((32.0 * cost) as u32).max(4), ..PathSettings::DEFAULT };
    Quality {
        resolution_scale: cost.min(1.0).powf(0.3).max(0.2),
        occlusion_strength: 1.0,
        lighting: LightSettings { paths, ..LightSettings::DEFAULT },
        ..Quality::FULL
    }
}

/// Optical thickness of a voxel that counts as opaque.
const OPAQUE_THICKNESS: f64 = 40.0;
/// Bytes from one dispatch's uniform to the next, the largest alignment of any device.
const STRIDE: usize = 256;
/// Paths of a half after which tiles are first judged; then at each doubling.
const FIRST_JUDGED: u32 = 8;

/// What a pipeline is specialised for.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Surfaces { image: Option<Dimensions>, past_masks: bool },
    Image { image: Dimensions, past_masks: bool },
    Judge,
}

struct Buffers {
    size: [u32; 2],
    pixels: wgpu::Buffer,
    errors: wgpu::Buffer,
}

struct Bounds {
    volume: Arc<ContextVolume>,
    transfer: Arc<TransferFunction>,
    per_mm: wgpu::Buffer,
}

/// The passes on the device.
struct PathLight {
    layout: wgpu::BindGroupLayout,
    pipelines: Pipelines<Kind>,
    buffers: Option<Buffers>,
    bounds: Option<Bounds>,
    /// For scenes without an image or bricks.
    placeholder: wgpu::Buffer,
    no_image: wgpu::Buffer,
    work: Option<LightWork>,
    /// Whether light on surfaces and in the image is of the last frame.
    lit: [bool; 2],
}

impl Light for PathLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        self.lit = [plan.has(LIGHT), plan.has(FINISH_IMAGE)];
        self.work = None;
        if self.lit == [false; 2] {
            (self.buffers, self.bounds) = (None, None);
            return Ok(Vec::new());
        }
        let image = scene.image;
        match &image {
            Some(image) => self.bound(gpu, image)?,
            None => self.bounds = None,
        }
        self.reserve(gpu, scene.size)?;
        let settings = &scene.quality.lighting;
        let lamp = turned(scene.camera, settings.lamp.direction(scene.camera));
        let first = Step::of(&settings.paths, lamp);
        let half = paths_of_half(&settings.paths);
        if self.lit[0] {
            self.bind_surfaces(gpu, passes, scene, (first, half))?;
        }
        if let Some(image) = image.filter(|_| self.lit[1]) {
            self.bind_image(gpu, passes, scene, &image, (first, half))?;
            let paths = 2 * u64::from(half) * u64::from(scene.size[0]) * u64::from(scene.size[1]);
            self.work = Some(LightWork { slices: 0, samples: paths, bytes: 48 * paths });
        }
        Ok(Vec::new())
    }

    fn work(&self) -> Option<LightWork> {
        self.work
    }

    fn measured_error(&self, gpu: &Gpu) -> Result<Option<StandardError>, RenderError> {
        let Some(buffers) = &self.buffers else { return Ok(None) };
        let bytes = buffers.errors.size() / 2;
        let halves = [(&buffers.errors, 0, bytes), (&buffers.errors, bytes, bytes)];
        let read = gpu.read_buffers(&halves)?;
        let mut found = [None; 2];
        for ((to, bytes), lit) in found.iter_mut().zip(&read).zip(self.lit) {
            let tiles: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(bytes);
            let sum = |part: usize| tiles.iter().map(|tile| f64::from(tile[part])).sum::<f64>();
            let pixels = sum(1);
            *to = (lit && pixels > 0.0).then(|| (sum(0) / pixels).sqrt());
        }
        let [surfaces, tissue] = found;
        Ok(Some(StandardError { surfaces, tissue }))
    }

    #[cfg(test)]
    fn probe(&self) -> super::lit::Probe<'_> {
        super::lit::Probe { pixels: self.buffers.as_ref().map(|b| &b.pixels), ..Default::default() }
    }
}

impl PathLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let step = UniformAtOffset(2 * size_of::<Step>() as u64);
        let kinds = [
            (0, Uniform),
            (1, Read),
            (2, Read),
            (3, Read),
            (11, Uniform),
            (12, Read),
            (14, Read),
            (15, Read),
            (42, step),
            (43, Read),
            (44, Write),
        ];
        Self {
            layout: bind_group_layout(gpu, "PathLight::layout", &kinds),
            pipelines: Pipelines::default(),
            buffers: None,
            bounds: None,
            placeholder: gpu.buffer("PathLight::placeholder", 16, WRITTEN),
            no_image: gpu.uniform::<Context>("PathLight::no_image"),
            work: None,
            lit: [false; 2],
        }
    }

    /// The bounds of the image's extinction: the held ones where they belong to it.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    fn bound(&mut self, gpu: &Gpu, image: &LitImage<'_>) -> Result<(), RenderError> {
        let is_held = self.bounds.as_ref().is_some_and(|held| {
            Arc::ptr_eq(&held.volume, image.volume)
                && (Arc::ptr_eq(&held.transfer, image.transfer) || held.transfer == *image.transfer)
        });
        if is_held {
            return Ok(());
        }
        let voxel_mm = image.buffers.shape().grid.spacing_mm().min_element();
        let most = OPAQUE_THICKNESS / voxel_mm.max(1e-6);
        let mut per_mm = majorants::majorants(image.buffers.tables(), image.buffers.ranges(), most);
        if per_mm.is_empty() {
            per_mm.push(0.0);
        }
        self.bounds = Some(Bounds {
            volume: Arc::clone(image.volume),
            transfer: Arc::clone(image.transfer),
            per_mm: gpu.storage("PathLight::majorants", bytemuck::cast_slice(&per_mm)),
        });
        gpu.check()
    }

    /// Buffers of a frame's size.
    ///
    /// # Errors
    /// [`RenderError`]: they don't fit.
    fn reserve(&mut self, gpu: &Gpu, size: [u32; 2]) -> Result<(), RenderError> {
        if self.buffers.as_ref().is_some_and(|b| b.size == size) {
            return Ok(());
        }
        self.buffers = None;
        let bytes = size_of::<Pixel>() as u64 * u64::from(size[0]) * u64::from(size[1]);
        gpu.check_size("light of paths", bytes)?;
        let [across, down] = size.map(|s| u64::from(s.div_ceil(8)));
        self.buffers = Some(Buffers {
            size,
            pixels: gpu.buffer("PathLight::pixels", bytes, WRITTEN),
            errors: gpu.buffer("PathLight::errors", 2 * 8 * across * down, WRITTEN),
        });
        gpu.check()
    }

    /// Binds the paths' pass: a dispatch for each path of a half, and one now and then that judges what was found.
    ///
    /// # Errors
    /// [`RenderError::Shader`].
    fn bind_paths(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        (pass, kind): (PassName, Kind),
        (step, half): (Step, u32),
    ) -> Result<(), RenderError> {
        let pipelines = vec![self.pipeline(gpu, kind)?, self.pipeline(gpu, Kind::Judge)?];
        let mut uniforms = vec![0u8; STRIDE * half as usize];
        let mut dispatches = Vec::new();
        let tiles = workgroups_of(scene.size.map(|s| s.div_ceil(8)));
        for (first, place) in (0..half).zip(uniforms.chunks_mut(STRIDE)) {
            let step = Step { first, ..step };
            place.split_at_mut(size_of::<Step>()).0.copy_from_slice(bytemuck::bytes_of(&step));
            let offset = first * STRIDE as u32;
            if first >= FIRST_JUDGED && first.is_power_of_two() {
                dispatches.push(Dispatch { pipeline: 1, offset, workgroups: tiles });
            }
            dispatches.push(Dispatch { pipeline: 0, offset, workgroups: workgroups_of(scene.size) });
        }
        let uniforms = gpu.buffer_with("PathLight::steps", &uniforms, wgpu::BufferUsages::UNIFORM);
        let (Some(buffers), [bricks, words]) =
            (&self.buffers, scene.bricks.unwrap_or([&self.placeholder; 2]))
        else {
            return Ok(());
        };
        let bounds = self.bounds.as_ref().map_or(&self.placeholder, |bounds| &bounds.per_mm);
        let step = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &uniforms,
            offset: 0,
            size: wgpu::BufferSize::new(2 * size_of::<Step>() as u64),
        });
        let mut entries = vec![
            (0, scene.view.as_entire_binding()),
            (1, bricks.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (42, step),
            (43, bounds.as_entire_binding()),
            (44, buffers.pixels.as_entire_binding()),
        ];
        match &scene.image {
            Some(image) => entries.extend(image.entries().into_iter().filter(|(number, _)| *number != 13)),
            None => {
                entries.push((11, self.no_image.as_entire_binding()));
                entries.extend([12, 14, 15].map(|number| (number, self.placeholder.as_entire_binding())));
            }
        }
        passes.bind_steps(gpu, pass, &self.layout, &entries, (pipelines, dispatches));
        Ok(())
    }

    fn bind_surfaces(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        steps: (Step, u32),
    ) -> Result<(), RenderError> {
        let workgroups = workgroups_of(scene.size);
        let Some(Buffers { pixels, errors, .. }) = &self.buffers else { return Ok(()) };
        let (pixels, errors) = (pixels.clone(), errors.clone());
        let flag = |on: bool| f64::from(u8::from(on));
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (40, scene.normals.as_entire_binding()),
            (44, pixels.as_entire_binding()),
        ];
        let constants =
            [("stored_normals", flag(scene.has_normals)), ("stepped", flag(scene.bricks.is_some()))];
        let shader = Shader { file: "paths/begin_surfaces", constants: &constants };
        passes.bind(gpu, BEGIN_SURFACES, shader, &entries, workgroups)?;
        let image = scene.image.map(|image| image.buffers.tables().dimensions);
        let kind = Kind::Surfaces { image, past_masks: has_masks(scene) };
        self.bind_paths(gpu, passes, scene, (SURFACES, kind), steps)?;
        let entries = [
            (0, scene.view.as_entire_binding()),
            (8, scene.blurred.as_entire_binding()),
            (44, pixels.as_entire_binding()),
            (45, errors.as_entire_binding()),
        ];
        passes.bind(gpu, LIGHT, "paths/light", &entries, workgroups)
    }

    fn bind_image(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
        steps: (Step, u32),
    ) -> Result<(), RenderError> {
        let workgroups = workgroups_of(scene.size);
        let (Some(Buffers { pixels, errors, .. }), Some(bounds)) = (&self.buffers, &self.bounds) else {
            return Ok(());
        };
        let (pixels, errors) = (pixels.clone(), errors.clone());
        let dimensions = image.buffers.tables().dimensions;
        let of_march = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (43, bounds.per_mm.as_entire_binding()),
            (44, pixels.as_entire_binding()),
        ];
        // Bounds say which bricks are visible.
        let of_image = image.entries().into_iter().filter(|(number, _)| *number != 13);
        let entries: Vec<_> = of_march.into_iter().chain(of_image).collect();
        let [gradient_counts, joint] = dimensions.constants();
        let ends_apart = ("ends_apart", f64::from(u8::from(scene.ends_apart)));
        let constants = [ends_apart, gradient_counts, joint];
        let shader = Shader { file: "paths/begin_image", constants: &constants };
        passes.bind(gpu, BEGIN_IMAGE, shader, &entries, workgroups)?;
        let kind = Kind::Image { image: dimensions, past_masks: has_masks(scene) };
        self.bind_paths(gpu, passes, scene, (IMAGE, kind), steps)?;
        let entries = [
            (0, scene.view.as_entire_binding()),
            (6, scene.marched.as_entire_binding()),
            (44, pixels.as_entire_binding()),
            (45, errors.as_entire_binding()),
        ];
        passes.bind(gpu, FINISH_IMAGE, "paths/finish_image", &entries, workgroups)
    }

    /// The pipeline of a kind, compiled when first needed.
    ///
    /// # Errors
    /// [`RenderError::Shader`].
    fn pipeline(&mut self, gpu: &Gpu, kind: Kind) -> Result<wgpu::ComputePipeline, RenderError> {
        let flag = |on: bool| f64::from(u8::from(on));
        self.pipelines.get(gpu, kind, |kind| {
            let (file, constants) = match *kind {
                Kind::Judge => ("paths/judge", Vec::new()),
                Kind::Surfaces { image, past_masks } => {
                    let dimensions = image.unwrap_or(Dimensions::Value).constants();
                    let own = [("through_image", flag(image.is_some())), ("past_masks", flag(past_masks))];
                    ("paths/surfaces", [own, dimensions].concat())
                }
                Kind::Image { image, past_masks } => {
                    let own = [("through_image", 1.0), ("past_masks", flag(past_masks))];
                    ("paths/image", [own, image.constants()].concat())
                }
            };
            compute_pipeline(gpu, file, Some(&self.layout), &constants)
        })
    }
}

/// Whether paths may meet masks.
fn has_masks(scene: &LitScene<'_>) -> bool {
    scene.bricks.is_some() && scene.opaque != Opaque::Nowhere
}
