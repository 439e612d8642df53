//! Runs a plan.
//!
//! Lifetimes: pipelines are made once a [`Renderer`]; a region volume's bricks once per `Arc` (cut
//! on all cores, then one upload); targets once a size (about 40 bytes a pixel); the uniform, about 200
//! bytes, and a small table of colours once a frame.

use crate::{
    camera::Camera,
    compute::{PassRunner, TimeSource, workgroups_of},
    frame::Frame,
    gpu::Gpu,
    lighting::{Lights, LitScene},
    plan::{PassName, Plan, plan},
    quality::Quality,
    region_buffers::RegionBuffers,
    scene::{Lens, Scene},
    slice_plane::PlaneBuffers,
    targets::Targets,
    uniforms::{self, NO_SKIPPING},
};

/// A picture that can't be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// Nothing to draw on, or too much.
    #[error(
        "found a picture of {}x{} pixels, expected sides of 1 to {side} pixels and at most {pixels} pixels",
        found[0], found[1]
    )]
    Size {
        /// The size asked for.
        found: [u32; 2],
        /// Longest side that the device takes.
        side: u32,
        /// Most pixels that the device takes.
        pixels: u64,
    },
    /// The regions, or the context image, don't fit on the card.
    #[error(
        "found a volume that needs {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Volume {
        /// Bytes needed.
        found: u64,
        /// Bytes that the device takes.
        limit: u64,
    },
    /// Something else doesn't fit on the card.
    #[error(
        "found {what} to need {found} bytes in one buffer, expected at most {limit} on this graphics device"
    )]
    Buffer {
        /// What is too large.
        what: &'static str,
        /// Bytes needed.
        found: u64,
        /// Bytes that the device takes.
        limit: u64,
    },
    /// Lens, camera or another part of the scene is not a number, or has no size.
    #[error("found {0}, expected finite numbers and sizes above 0")]
    Scene(String),
    /// The device failed.
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// A shader of ours does not compose.
    #[error(transparent)]
    Shader(#[from] glioscope_shaders::ComposeError),
}

/// Numbers of the bindings, as the shaders write them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    View = 0,
    Bricks = 1,
    Voxels = 2,
    Regions = 3,
    Depths = 4,
    Surfaces = 5,
    Outsides = 6,
    Occlusion = 7,
    Blurred = 8,
    Kernel = 9,
    Picture = 10,
}

/// Shader file and bindings of each pass.
const SHADERS: [(PassName, &str, &[Slot]); 5] = {
    use Slot::*;
    [
        (PassName::Surface, "closeup_surface", &[View, Bricks, Voxels, Regions, Depths, Surfaces]),
        (PassName::Outside, "closeup_outside", &[View, Bricks, Voxels, Regions, Depths, Outsides]),
        (PassName::Occlusion, "closeup_occlusion", &[View, Regions, Depths, Surfaces, Occlusion, Kernel]),
        (PassName::OcclusionBlur, "closeup_occlusion_blur", &[View, Depths, Occlusion, Blurred]),
        (
            PassName::Compose,
            "closeup_compose",
            &[View, Regions, Depths, Surfaces, Outsides, Blurred, Picture],
        ),
    ]
};

/// Draws closeups. Not bound to a window.
pub struct Renderer {
    passes: PassRunner,
    view: wgpu::Buffer,
    kernel: wgpu::Buffer,
    kernel_samples: u32,
    regions: Option<RegionBuffers>,
    plane: PlaneBuffers,
    lights: Lights,
    frame: Option<Frame>,
}

/// Refuses a camera or a lens that is not a number or has no size.
pub(crate) fn check_view(c: &Camera, lens: Option<&Lens>) -> Result<(), RenderError> {
    let turn_is_unit = (c.world_from_camera.length() - 1.0).abs() < 1e-3;
    if !(c.focus_mm.is_finite() && turn_is_unit && c.height_mm.is_finite() && c.height_mm > 0.0) {
        return Err(RenderError::Scene(format!("camera {c:?}")));
    }
    match lens {
        Some(l) if !(l.center_mm.is_finite() && l.radius_mm.is_finite() && l.radius_mm > 0.0) => {
            Err(RenderError::Scene(format!("lens {l:?}")))
        }
        _ => Ok(()),
    }
}

impl Renderer {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let passes = PassRunner::new(gpu, &SHADERS.map(|(pass, shader, _)| (pass, shader)))?;
        let uniform = |label, size: usize| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(Self {
            passes,
            view: uniform("Renderer::view", size_of::<uniforms::View>()),
            kernel: uniform("Renderer::kernel", size_of::<[[f32; 4]; 32]>()),
            kernel_samples: 0,
            regions: None,
            plane: PlaneBuffers::new(gpu),
            lights: Lights::default(),
            frame: None,
        })
    }

    /// Draws `scene` at `quality` for a place of `size_px` pixels. Returns when the work is
    /// submitted; reading the frame waits for it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then, and the frame before is gone.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&Frame, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, plan(scene, quality), true)
    }

    /// The last frame, if drawing it went well.
    pub fn frame(&self) -> Option<&Frame> {
        self.frame.as_ref()
    }

    /// As [`Renderer::render`] with a given plan; bricks are jumped over when `skipping`.
    pub(crate) fn render_planned(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        quality: &Quality,
        asked_px: [u32; 2],
        plan: Plan,
        skipping: bool,
    ) -> Result<&Frame, RenderError> {
        let before = self.frame.take();
        self.passes.clear();
        gpu.check().map_err(RenderError::Device)?;
        check_view(&scene.camera, scene.lens.as_ref())?;
        let size = quality.drawn_px(asked_px);
        let targets = match before {
            Some(frame) if frame.targets.size == size => frame.targets,
            _ => Targets::new(gpu, size)?,
        };
        let regions = RegionBuffers::keep(&mut self.regions, gpu, scene.tumor.as_ref())?;
        let mut view = uniforms::view(scene, quality, &plan, size);
        if !skipping {
            view.flags |= NO_SKIPPING;
        }
        let reference_mm = uniforms::reference_mm(scene);
        self.plane.update(gpu, scene.plane.as_ref(), &scene.camera, reference_mm, &mut view)?;
        regions.show(gpu, scene, &mut view);
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        if self.kernel_samples != view.occlusion_samples {
            self.kernel_samples = view.occlusion_samples;
            let kernel = uniforms::occlusion_kernel(view.occlusion_samples);
            gpu.queue.write_buffer(&self.kernel, 0, bytemuck::cast_slice(&kernel));
        }
        self.bind(gpu, &plan, &targets, scene, quality)?;
        self.passes.run(gpu);
        gpu.check().map_err(RenderError::Device)?;
        Ok(self.frame.insert(Frame {
            color: targets.color.clone(),
            size_px: size,
            asked_px,
            plan,
            targets,
            tumor: scene.tumor.clone(),
            camera: scene.camera,
            lens: scene.lens,
            reference_mm,
        }))
    }

    fn bind(
        &mut self,
        gpu: &Gpu,
        plan: &Plan,
        targets: &Targets,
        scene: &Scene,
        quality: &Quality,
    ) -> Result<(), RenderError> {
        let Some(up) = &self.regions else { return Ok(()) };
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        for (pass, _, slots) in SHADERS.into_iter().filter(|(pass, ..)| plan.has(*pass)) {
            if pass == PassName::Compose {
                let lit = LitScene {
                    image: None,
                    tumor: scene.tumor.as_ref(),
                    selection: &scene.selection,
                    camera: &scene.camera,
                    reference_mm: uniforms::reference_mm(scene),
                    size: targets.size,
                    strength: quality.strength(),
                    view: &self.view,
                    depths: &targets.depths,
                    surfaces: &targets.surfaces,
                    marched: &targets.outsides,
                    blurred: &targets.blurred,
                    regions: [&up.table, &up.words, &up.regions],
                };
                self.lights.bind(gpu, &mut self.passes, plan, &lit, &quality.lighting)?;
            }
            let mut entries: Vec<(u32, wgpu::BindingResource<'_>)> = slots
                .iter()
                .map(|&slot| {
                    let resource = match slot {
                        Slot::View => self.view.as_entire_binding(),
                        Slot::Bricks => up.table.as_entire_binding(),
                        Slot::Voxels => up.words.as_entire_binding(),
                        Slot::Regions => up.regions.as_entire_binding(),
                        Slot::Depths => targets.depths.as_entire_binding(),
                        Slot::Surfaces => targets.surfaces.as_entire_binding(),
                        Slot::Outsides => targets.outsides.as_entire_binding(),
                        Slot::Occlusion => targets.occlusion.as_entire_binding(),
                        Slot::Blurred => targets.blurred.as_entire_binding(),
                        Slot::Kernel => self.kernel.as_entire_binding(),
                        Slot::Picture => wgpu::BindingResource::TextureView(&picture),
                    };
                    (slot as u32, resource)
                })
                .collect();
            if pass == PassName::Compose {
                entries.extend(self.plane.entries());
            }
            self.passes.bind(gpu, pass, &entries, workgroups_of(targets.size));
        }
        Ok(())
    }

    /// Where [`Renderer::pass_times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        self.passes.time_source()
    }

    /// Milliseconds of each pass of the last frame, in order; empty before the first. Waits for it.
    /// Without timestamps on the device the passes are run again, one by one.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pass_times(&self, gpu: &Gpu) -> Result<Vec<(PassName, f64)>, RenderError> {
        if self.frame.is_some() { self.passes.times(gpu) } else { Ok(Vec::new()) }
    }
}
