//! Runs a context view's plan.
//!
//! Lifetimes: pipelines are made once a [`ContextRenderer`]; an image's values once per `Arc` (4 bytes
//! a voxel on the card); tables (40 KB, and a bit a brick) once a transfer function; the tumour's
//! bricks once per `Arc`; fibre tracts once a list of those shown (16 bytes a point); targets once a size
//! (with tracts 16 bytes a pixel more); the uniforms once a frame.

use super::{
    frame::ContextFrame,
    image::ImageBuffers,
    scene::{ContextScene, context_plan},
    uniforms as context_uniforms,
};
use crate::{
    compute::{PassRunner, TimeSource, workgroups_of},
    gpu::Gpu,
    lighting::{LIGHT_BINDINGS, LightWork, Lights, LitImage, LitScene},
    plan::{PassName, Plan},
    quality::Quality,
    raster,
    region_buffers::RegionBuffers,
    renderer::RenderError,
    targets::Targets,
    tubes::buffers::TubeBuffers,
    uniforms::{self, LENS_ONLY_DRAWN, NO_SKIPPING},
};

/// Numbers of the bindings, as the shaders write them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    View = 0,
    Bricks = 1,
    Voxels = 2,
    Regions = 3,
    Depths = 4,
    Surfaces = 5,
    Marched = 6,
    Occlusion = 7,
    Blurred = 8,
    Kernel = 9,
    Picture = 10,
    Context = 11,
    Values = 12,
    Visible = 13,
    Table = 14,
    Factors = 15,
    Fibers = 28,
    TubePicture = 29,
    TubeShades = 30,
}

/// Shader file and bindings of each pass.
const SHADERS: [(PassName, &str, &[Slot]); 6] = {
    use Slot::*;
    [
        (PassName::Surface, "closeup_surface", &[View, Bricks, Voxels, Regions, Depths, Surfaces]),
        (PassName::TubesMerge, "tubes_merge", &[View, Depths, Surfaces, Fibers, TubePicture, TubeShades]),
        (PassName::Occlusion, "closeup_occlusion", &[View, Regions, Depths, Surfaces, Occlusion, Kernel]),
        (PassName::OcclusionBlur, "closeup_occlusion_blur", &[View, Depths, Occlusion, Blurred]),
        (
            PassName::Context,
            "context_march",
            &[View, Depths, Marched, Context, Values, Visible, Table, Factors],
        ),
        (
            PassName::Compose,
            "context_compose",
            &[View, Regions, Depths, Surfaces, Marched, Blurred, Picture, Fibers, TubeShades],
        ),
    ]
};

/// The march lit by cones, in the place of the other one: it reads the grid of light besides.
pub(crate) const LIT_MARCH: &str = "context_lit";

/// Whether the plan shows the image, whichever way.
pub(crate) fn shows_image(plan: &Plan) -> bool {
    plan.has(PassName::Context) || plan.has(PassName::Slices)
}

/// Draws context views. Not bound to a window.
pub struct ContextRenderer {
    passes: PassRunner,
    view: wgpu::Buffer,
    context: wgpu::Buffer,
    kernel: wgpu::Buffer,
    kernel_samples: u32,
    regions: Option<RegionBuffers>,
    image: Option<ImageBuffers>,
    lights: Lights,
    tubes: TubeBuffers,
    frame: Option<ContextFrame>,
    /// Drawn in parts, and not whole yet.
    coming: Option<ContextFrame>,
}

/// What tests turn off to see that it changes nothing, or only what it should.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ways {
    pub skipping: bool,
    pub jitter: bool,
}

impl Ways {
    pub(super) const USUAL: Self = Self { skipping: true, jitter: true };
}

impl ContextRenderer {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let mut passes = PassRunner::new(gpu, &SHADERS.map(|(pass, shader, _)| (pass, shader)))?;
        passes.add_raster(PassName::Tubes, raster::pipeline(gpu, "tubes", false)?);
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
            view: uniform("ContextRenderer::view", size_of::<uniforms::View>()),
            context: uniform("ContextRenderer::context", size_of::<context_uniforms::Context>()),
            kernel: uniform("ContextRenderer::kernel", size_of::<[[f32; 4]; 32]>()),
            kernel_samples: 0,
            regions: None,
            image: None,
            lights: Lights::default(),
            tubes: TubeBuffers::new(gpu),
            frame: None,
            coming: None,
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
        scene: &ContextScene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&ContextFrame, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, context_plan(scene, quality), Ways::USUAL)
    }

    #[cfg(test)]
    pub(crate) fn lights(&self) -> &Lights {
        &self.lights
    }

    #[cfg(test)]
    pub(crate) fn lights_mut(&mut self) -> &mut Lights {
        &mut self.lights
    }

    /// The last frame, if drawing it went well.
    pub fn frame(&self) -> Option<&ContextFrame> {
        self.frame.as_ref()
    }

    /// As [`ContextRenderer::render`] with a given plan.
    pub(super) fn render_planned(
        &mut self,
        gpu: &Gpu,
        scene: &ContextScene,
        quality: &Quality,
        asked_px: [u32; 2],
        plan: Plan,
        ways: Ways,
    ) -> Result<&ContextFrame, RenderError> {
        let spare = self.frame.take().map(|frame| frame.targets);
        let frame = self.prepare(gpu, scene, quality, asked_px, (plan, ways), spare)?;
        self.passes.run(gpu);
        gpu.check().map_err(RenderError::Device)?;
        Ok(self.frame.insert(frame))
    }

    /// Begins a picture that [`ContextRenderer::go_on`] draws; the last one stays until then. Another one that
    /// was begun is dropped, by [`ContextRenderer::render`] too.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is begun then.
    pub fn begin(
        &mut self,
        gpu: &Gpu,
        scene: &ContextScene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<(), RenderError> {
        let planned = (context_plan(scene, quality), Ways::USUAL);
        let frame = self.prepare(gpu, scene, quality, size_px, planned, None)?;
        self.coming = Some(frame);
        Ok(())
    }

    /// Goes on with what was begun, for about so many milliseconds. Whether it is whole: then it is
    /// [`ContextRenderer::frame`]. Nothing to do is done.
    ///
    /// # Errors
    /// [`RenderError::Device`]; what was begun is dropped then.
    pub fn go_on(&mut self, gpu: &Gpu, milliseconds: f64) -> Result<bool, RenderError> {
        self.passes.go_on(gpu, milliseconds, &mut self.coming, &mut self.frame)
    }

    /// How much of what was begun is done, 0 to 1; `None` where nothing is under way.
    pub fn share_done(&self) -> Option<f64> {
        self.coming.as_ref().map(|_| self.passes.share_done())
    }

    /// Binds the passes of a picture.
    fn prepare(
        &mut self,
        gpu: &Gpu,
        scene: &ContextScene,
        quality: &Quality,
        asked_px: [u32; 2],
        (plan, ways): (Plan, Ways),
        spare: Option<Targets>,
    ) -> Result<ContextFrame, RenderError> {
        self.coming = None;
        self.passes.clear();
        gpu.check().map_err(RenderError::Device)?;
        scene.check()?;
        let size = quality.drawn_px(asked_px);
        let targets = match spare {
            Some(targets) if targets.size == size => targets,
            _ => Targets::new(gpu, size)?,
        };
        let regions = RegionBuffers::keep(&mut self.regions, gpu, scene.tumor.as_ref())?;
        let tumor = scene.tumor_scene();
        let mut view = uniforms::view_from(&tumor, scene.reference_mm(), quality, &plan, size);
        view.flags |= LENS_ONLY_DRAWN;
        if !ways.skipping {
            view.flags |= NO_SKIPPING;
        }
        regions.show(gpu, &tumor, &mut view);
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        if self.kernel_samples != view.occlusion_samples {
            self.kernel_samples = view.occlusion_samples;
            let kernel = uniforms::occlusion_kernel(view.occlusion_samples);
            gpu.queue.write_buffer(&self.kernel, 0, bytemuck::cast_slice(&kernel));
        }
        let tubes = plan.has(PassName::TubesMerge).then_some(scene.tubes.as_slice());
        self.tubes.prepare(gpu, tubes, &scene.camera, scene.reference_mm(), &view)?;
        let mut warning = None;
        if let Some(volume) = scene.volume.as_ref().filter(|_| shows_image(&plan)) {
            let image = ImageBuffers::keep(&mut self.image, gpu, volume, &scene.transfer)?;
            warning = image.warning();
            let mut context = image.uniform(scene, quality, &plan);
            if !ways.jitter {
                context.flags &= !context_uniforms::JITTER;
            }
            gpu.queue.write_buffer(&self.context, 0, bytemuck::bytes_of(&context));
        }
        let notes = self.bind(gpu, &plan, &targets, scene, quality)?;
        Ok(ContextFrame {
            color: targets.color.clone(),
            size_px: size,
            asked_px,
            plan,
            warning,
            notes,
            targets,
            tumor: scene.tumor.clone(),
            tubes: scene.tubes.clone(),
            camera: scene.camera,
            reference_mm: scene.reference_mm(),
        })
    }

    /// Binds the passes of `plan`; returns what is other than asked for, in words.
    fn bind(
        &mut self,
        gpu: &Gpu,
        plan: &Plan,
        targets: &Targets,
        scene: &ContextScene,
        quality: &Quality,
    ) -> Result<Vec<String>, RenderError> {
        let Some(regions) = &self.regions else { return Ok(Vec::new()) };
        let image = self.image.as_ref();
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let mut lights = std::mem::take(&mut self.lights);
        let mut notes = Vec::new();
        let mut lit = false;
        for (pass, _, slots) in SHADERS.into_iter().filter(|(pass, ..)| plan.has(*pass)) {
            if pass == PassName::TubesMerge
                && let Some((drawing, entries)) = self.tubes.drawing()
            {
                let mut entries = entries.to_vec();
                entries.push((Slot::View as u32, self.view.as_entire_binding()));
                self.passes.bind_raster(gpu, PassName::Tubes, &entries, drawing);
            }
            if !lit && matches!(pass, PassName::Context | PassName::Compose) {
                lit = true;
                let buffers = image.zip(scene.volume.as_ref()).filter(|_| shows_image(plan));
                let lit_scene = LitScene {
                    image: buffers.map(|(buffers, volume)| LitImage {
                        buffers,
                        volume,
                        transfer: &scene.transfer,
                        context: &self.context,
                    }),
                    tumor: scene.tumor.as_ref(),
                    selection: &scene.selection,
                    camera: &scene.camera,
                    reference_mm: scene.reference_mm(),
                    size: targets.size,
                    strength: quality.strength(),
                    view: &self.view,
                    depths: &targets.depths,
                    surfaces: &targets.surfaces,
                    marched: &targets.outsides,
                    blurred: &targets.blurred,
                    regions: [&regions.table, &regions.words, &regions.regions],
                };
                notes = lights.bind(gpu, &mut self.passes, plan, &lit_scene, &quality.lighting)?;
            }
            let mut entries: Vec<(u32, wgpu::BindingResource<'_>)> = slots
                .iter()
                .filter_map(|&slot| {
                    let resource = match slot {
                        Slot::View => self.view.as_entire_binding(),
                        Slot::Bricks => regions.table.as_entire_binding(),
                        Slot::Voxels => regions.words.as_entire_binding(),
                        Slot::Regions => regions.regions.as_entire_binding(),
                        Slot::Depths => targets.depths.as_entire_binding(),
                        Slot::Surfaces => targets.surfaces.as_entire_binding(),
                        // As large as what the closeup keeps of its outer level, in its place.
                        Slot::Marched => targets.outsides.as_entire_binding(),
                        Slot::Occlusion => targets.occlusion.as_entire_binding(),
                        Slot::Blurred => targets.blurred.as_entire_binding(),
                        Slot::Kernel => self.kernel.as_entire_binding(),
                        Slot::Picture => wgpu::BindingResource::TextureView(&picture),
                        Slot::Context => self.context.as_entire_binding(),
                        Slot::Values => image?.values().as_entire_binding(),
                        Slot::Visible => image?.visible().as_entire_binding(),
                        Slot::Table => image?.table().as_entire_binding(),
                        Slot::Factors => image?.factors().as_entire_binding(),
                        Slot::Fibers => self.tubes.fibers().as_entire_binding(),
                        Slot::TubePicture => wgpu::BindingResource::TextureView(self.tubes.picture()?),
                        Slot::TubeShades => self.tubes.shades().as_entire_binding(),
                    };
                    Some((slot as u32, resource))
                })
                .collect();
            let workgroups = workgroups_of(targets.size);
            if let (PassName::Context, Some(grid), Some(image)) = (pass, lights.grid(), image) {
                entries.extend(grid.into_iter().zip(LIGHT_BINDINGS).map(|(b, n)| (n, b.as_entire_binding())));
                let shader = (LIT_MARCH, &[image.tables().gradient_counts()][..]);
                self.passes.bind_shader(gpu, pass, shader, &entries, workgroups)?;
            } else {
                self.passes.bind(gpu, pass, &entries, workgroups);
            }
        }
        self.lights = lights;
        Ok(notes)
    }

    /// As [`ContextRenderer::render`] with a given plan.
    #[cfg(test)]
    pub(crate) fn render_with(
        &mut self,
        gpu: &Gpu,
        scene: &ContextScene,
        quality: &Quality,
        size_px: [u32; 2],
        plan: Plan,
    ) -> Result<&ContextFrame, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, plan, Ways::USUAL)
    }

    /// Shaded colour and facing of the tube at each pixel of the last frame; empty without tubes.
    #[cfg(test)]
    pub(crate) fn read_tube_shades(&self, gpu: &Gpu) -> Vec<[u8; 4]> {
        if self.tubes.picture().is_none() {
            return Vec::new();
        }
        let shades = self.tubes.shades();
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(shades, 0, shades.size())]).unwrap()[0])
    }

    /// Where [`ContextRenderer::pass_times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        self.passes.time_source()
    }

    /// What the last frame's image asked of the passes of light; `None` in screen space and without image.
    pub fn light_work(&self) -> Option<LightWork> {
        self.lights.work()
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
