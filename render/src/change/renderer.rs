//! Runs a change view's plan.
//!
//! Lifetimes: pipelines are made once a [`ChangeRenderer`]; the union's bricks and the table of
//! lengths once a surface; arrows once a surface and threshold; the image as in the context view;
//! targets once a size (about 88 bytes a pixel, with arrows 48 more, with arrows that take light 16 more);
//! the uniforms once a frame.

use std::sync::Arc;

use wgpu::util::DeviceExt;

use super::{
    ChangeScene, ChangeSurface,
    arrows::{self, ArrowBuffers},
    change_plan,
    frame::ChangeFrame,
    targets::{ChangeTargets, SolidTargets},
    uniforms as change_uniforms,
};
use crate::{
    compute::{Drawing, PassRunner, TimeSource, workgroups_of},
    context::{ContextScene, LIT_MARCH, image::ImageBuffers, shows_image, uniforms::Context},
    gpu::Gpu,
    lighting::{LIGHT_BINDINGS, Lights, LitImage, LitScene},
    plan::{PassName, Plan},
    quality::Quality,
    raster::{self, RasterTargets},
    region_buffers::RegionBuffers,
    renderer::RenderError,
    targets::Targets,
    uniforms::{self, View},
};

/// What a binding is bound to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    View,
    HullView,
    Bricks,
    Voxels,
    Regions,
    Depths,
    Surfaces,
    Marched,
    Blurred,
    Occlusion,
    Kernel,
    Picture,
    Context,
    Values,
    Visible,
    Table,
    Factors,
    Change,
    Cells,
    Lengths,
    Heights,
    Across,
    Filtered,
    /// Filtered heights, or the heights where no filter runs.
    Shown,
    HullDepths,
    HullSurfaces,
    Tops,
    Arrows,
    ArrowPicture,
    SolidDepths,
    SolidFaces,
}

type Step = (PassName, &'static str, &'static [(u32, Slot)]);

/// Shader file and bindings of each pass that computes. They run in this order, the arrows behind the first
/// two.
const SHADERS: [Step; 10] = {
    use Slot::*;
    [
        (
            PassName::Surface,
            "change_surface",
            &[(0, View), (1, Bricks), (2, Voxels), (3, Regions), (4, Depths), (5, Surfaces), (17, Cells)],
        ),
        (
            PassName::Outside,
            "closeup_surface",
            &[(0, HullView), (1, Bricks), (2, Voxels), (3, Regions), (4, HullDepths), (5, HullSurfaces)],
        ),
        (
            PassName::ArrowsMerge,
            "change_arrows_merge",
            &[
                (0, View),
                (4, Depths),
                (5, Surfaces),
                (16, Change),
                (25, ArrowPicture),
                (39, SolidDepths),
                (40, SolidFaces),
            ],
        ),
        (
            PassName::Occlusion,
            "closeup_occlusion",
            &[(0, View), (3, Regions), (4, Depths), (5, Surfaces), (7, Occlusion), (9, Kernel)],
        ),
        (
            PassName::OcclusionBlur,
            "closeup_occlusion_blur",
            &[(0, View), (4, Depths), (7, Occlusion), (8, Blurred)],
        ),
        (
            PassName::Context,
            "context_march",
            &[
                (0, View),
                (4, Depths),
                (6, Marched),
                (11, Context),
                (12, Values),
                (13, Visible),
                (14, Table),
                (15, Factors),
            ],
        ),
        (
            PassName::Heights,
            "change_heights",
            &[(0, View), (5, Surfaces), (16, Change), (17, Cells), (18, Lengths), (19, Heights)],
        ),
        (
            PassName::HeightFilterAcross,
            "change_filter_across",
            &[(0, View), (4, Depths), (16, Change), (19, Heights), (20, Across)],
        ),
        (
            PassName::HeightFilterDown,
            "change_filter_down",
            &[(0, View), (4, Depths), (16, Change), (19, Across), (20, Filtered)],
        ),
        (
            PassName::Compose,
            "change_compose",
            &[
                (0, View),
                (4, Depths),
                (5, Surfaces),
                (6, Marched),
                (8, Blurred),
                (10, Picture),
                (16, Change),
                (19, Shown),
                (21, HullDepths),
                (22, HullSurfaces),
                (23, Tops),
                (25, ArrowPicture),
            ],
        ),
    ]
};

/// Lengths on the card.
struct LengthBuffers {
    surface: Arc<ChangeSurface>,
    table: wgpu::Buffer,
    log2_slots: u32,
}

impl LengthBuffers {
    fn new(gpu: &Gpu, surface: &Arc<ChangeSurface>) -> Result<Self, RenderError> {
        let Some((table, log2_slots)) = surface.lengths() else {
            let found = surface.volume().grid().voxel_count() as u64;
            return Err(RenderError::Volume { found, limit: u64::from(u32::MAX) - 1 });
        };
        let bytes: &[u8] = bytemuck::cast_slice(&table);
        gpu.check_size("the lengths of change", bytes.len() as u64)?;
        Ok(Self {
            surface: Arc::clone(surface),
            table: gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("LengthBuffers::table"),
                contents: bytes,
                usage: wgpu::BufferUsages::STORAGE,
            }),
            log2_slots,
        })
    }
}

/// Draws change views. Not bound to a window.
pub struct ChangeRenderer {
    passes: PassRunner,
    view: wgpu::Buffer,
    hull_view: wgpu::Buffer,
    context: wgpu::Buffer,
    change: wgpu::Buffer,
    kernel: wgpu::Buffer,
    kernel_samples: u32,
    triangles: wgpu::Buffer,
    triangle_corners: u32,
    regions: Option<RegionBuffers>,
    image: Option<ImageBuffers>,
    lengths: Option<LengthBuffers>,
    pub(super) arrows: Option<ArrowBuffers>,
    arrow_targets: Option<RasterTargets>,
    pub(super) solid_targets: Option<SolidTargets>,
    pub(super) lights: Lights,
    frame: Option<ChangeFrame>,
    /// Drawn in parts, and not whole yet.
    coming: Option<ChangeFrame>,
}

impl ChangeRenderer {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let mut passes = PassRunner::new(gpu, &SHADERS.map(|(pass, shader, _)| (pass, shader)))?;
        passes.add_raster(PassName::Arrows, raster::pipeline(gpu, "change_arrows", true)?);
        let uniform = |label, size: usize| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let triangles = arrows::triangles();
        let made = Self {
            passes,
            view: uniform("ChangeRenderer::view", size_of::<View>()),
            hull_view: uniform("ChangeRenderer::hull_view", size_of::<View>()),
            context: uniform("ChangeRenderer::context", size_of::<Context>()),
            change: uniform("ChangeRenderer::change", size_of::<change_uniforms::Change>()),
            kernel: uniform("ChangeRenderer::kernel", size_of::<[[f32; 4]; 32]>()),
            kernel_samples: 0,
            triangles: gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some("ChangeRenderer::triangles"),
                contents: bytemuck::cast_slice(&triangles),
                usage: wgpu::BufferUsages::INDEX,
            }),
            triangle_corners: triangles.len() as u32,
            regions: None,
            image: None,
            lengths: None,
            arrows: None,
            arrow_targets: None,
            solid_targets: None,
            lights: Lights::default(),
            frame: None,
            coming: None,
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(made)
    }

    /// Draws `scene` at `quality` for a place of `size_px` pixels. Returns when the work is
    /// submitted; reading the frame waits for it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then, and the frame before is gone.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        scene: &ChangeScene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&ChangeFrame, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, change_plan(scene, quality))
    }

    /// The last frame, if drawing it went well.
    pub fn frame(&self) -> Option<&ChangeFrame> {
        self.frame.as_ref()
    }

    /// As [`ChangeRenderer::render`] with a given plan.
    pub(super) fn render_planned(
        &mut self,
        gpu: &Gpu,
        scene: &ChangeScene,
        quality: &Quality,
        asked_px: [u32; 2],
        plan: Plan,
    ) -> Result<&ChangeFrame, RenderError> {
        let spare = self.frame.take().map(|frame| (frame.targets, frame.own));
        let frame = self.prepare(gpu, scene, quality, asked_px, plan, spare)?;
        self.passes.run(gpu);
        gpu.check().map_err(RenderError::Device)?;
        Ok(self.frame.insert(frame))
    }

    /// Begins a picture that [`ChangeRenderer::go_on`] draws; the last one stays until then. Another one that
    /// was begun is dropped, by [`ChangeRenderer::render`] too.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is begun then.
    pub fn begin(
        &mut self,
        gpu: &Gpu,
        scene: &ChangeScene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<(), RenderError> {
        let frame = self.prepare(gpu, scene, quality, size_px, change_plan(scene, quality), None)?;
        self.coming = Some(frame);
        Ok(())
    }

    /// Goes on with what was begun, for about so many milliseconds. Whether it is whole: then it is
    /// [`ChangeRenderer::frame`]. Nothing to do is done.
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
        scene: &ChangeScene,
        quality: &Quality,
        asked_px: [u32; 2],
        plan: Plan,
        spare: Option<(Targets, ChangeTargets)>,
    ) -> Result<ChangeFrame, RenderError> {
        self.coming = None;
        self.passes.clear();
        gpu.check().map_err(RenderError::Device)?;
        scene.check()?;
        let size = quality.drawn_px(asked_px);
        let (targets, own) = match spare {
            Some((targets, own)) if targets.size == size => (targets, own),
            _ => (Targets::new(gpu, size)?, ChangeTargets::new(gpu, size)),
        };
        let context_scene = scene.context_scene();
        let reference_mm = context_scene.reference_mm();
        let regions =
            RegionBuffers::keep(&mut self.regions, gpu, scene.surface.as_ref().map(|s| s.volume()))?;
        let tumor = context_scene.tumor_scene();
        let mut view = uniforms::view_from(&tumor, reference_mm, quality, &plan, size);
        regions.show(gpu, &tumor, &mut view);
        self.write_view(gpu, scene, &view);
        let mut warning = None;
        if let Some(volume) = scene.context.volume.as_ref().filter(|_| shows_image(&plan)) {
            let image = ImageBuffers::keep(&mut self.image, gpu, volume, &scene.context.transfer)?;
            warning = image.warning();
            let context = image.uniform(&context_scene, quality, &plan);
            gpu.queue.write_buffer(&self.context, 0, bytemuck::bytes_of(&context));
        }
        let mut log2_slots = 1;
        if let Some(surface) = scene.surface.as_ref().filter(|_| plan.has(PassName::Heights)) {
            let made = match self.lengths.take().filter(|l| Arc::ptr_eq(&l.surface, surface)) {
                Some(lengths) => lengths,
                None => LengthBuffers::new(gpu, surface)?,
            };
            log2_slots = self.lengths.insert(made).log2_slots;
        }
        let mut vectors = Arc::default();
        let mut drawn = None;
        match scene.surface.as_ref().filter(|_| plan.has(PassName::Arrows)) {
            Some(surface) => {
                let held = &mut self.arrows;
                let buffers = ArrowBuffers::keep(held, gpu, surface, scene.look.threshold_mm)?;
                vectors = Arc::clone(&buffers.vectors);
                drawn = Some(size);
            }
            None => self.arrows = None,
        }
        let arrow_targets = RasterTargets::keep(&mut self.arrow_targets, gpu, drawn, 2)?;
        let merged = plan.has(PassName::ArrowsMerge).then_some(size);
        let solid_targets = SolidTargets::keep(&mut self.solid_targets, gpu, merged)?;
        let mut change = change_uniforms::Change::default();
        if let Some(surface) = scene.surface.as_deref() {
            let samples = arrow_targets.samples;
            change = change_uniforms::change(scene, surface, &plan, &view, reference_mm, log2_slots, samples);
        }
        gpu.queue.write_buffer(&self.change, 0, bytemuck::bytes_of(&change));
        let arrow_count = vectors.len();
        let count = arrow_count as u32;
        let arrow_targets = (&arrow_targets, solid_targets.as_ref());
        self.bind(gpu, &plan, &targets, &own, arrow_targets, count, &context_scene, quality)?;
        Ok(ChangeFrame {
            color: targets.color.clone(),
            size_px: size,
            asked_px,
            plan,
            warning,
            arrows: arrow_count,
            targets,
            own,
            surface: scene.surface.clone(),
            vectors,
            camera: scene.camera,
            reference_mm,
        })
    }

    /// The uniform of what is solid, that of the whole union, and the kernel of occlusion.
    fn write_view(&mut self, gpu: &Gpu, scene: &ChangeScene, view: &View) {
        gpu.queue.write_buffer(&self.view, 0, bytemuck::bytes_of(view));
        let numbers = scene.surface.as_ref().map_or(0, |s| s.volume().bits_of_id().len());
        let hull = View { selected: (1..numbers).fold(0, |set, n| set | 1 << n), ..*view };
        gpu.queue.write_buffer(&self.hull_view, 0, bytemuck::bytes_of(&hull));
        if self.kernel_samples != view.occlusion_samples {
            self.kernel_samples = view.occlusion_samples;
            let kernel = uniforms::occlusion_kernel(view.occlusion_samples);
            gpu.queue.write_buffer(&self.kernel, 0, bytemuck::cast_slice(&kernel));
        }
    }

    #[allow(clippy::too_many_arguments, reason = "one caller; splits its body")]
    fn bind(
        &mut self,
        gpu: &Gpu,
        plan: &Plan,
        targets: &Targets,
        own: &ChangeTargets,
        (arrow_targets, solid_targets): (&RasterTargets, Option<&SolidTargets>),
        arrow_count: u32,
        around: &ContextScene,
        quality: &Quality,
    ) -> Result<(), RenderError> {
        let Some(regions) = &self.regions else { return Ok(()) };
        let mut lights = std::mem::take(&mut self.lights);
        let mut lit = false;
        let mut has_arrows = !plan.has(PassName::Arrows);
        let picture = targets.color.create_view(&wgpu::TextureViewDescriptor::default());
        let resource = |slot: Slot| {
            let buffer = match slot {
                Slot::Picture => return Some(wgpu::BindingResource::TextureView(&picture)),
                Slot::ArrowPicture => {
                    return Some(wgpu::BindingResource::TextureView(&arrow_targets.picture));
                }
                Slot::View => &self.view,
                Slot::HullView => &self.hull_view,
                Slot::Bricks => &regions.table,
                Slot::Voxels => &regions.words,
                Slot::Regions => &regions.regions,
                Slot::Depths => &targets.depths,
                Slot::Surfaces => &targets.surfaces,
                // As large as what the closeup keeps of its outer level, in its place.
                Slot::Marched => &targets.outsides,
                Slot::Blurred => &targets.blurred,
                Slot::Occlusion => &targets.occlusion,
                Slot::Kernel => &self.kernel,
                Slot::Context => &self.context,
                Slot::Values => self.image.as_ref()?.values(),
                Slot::Visible => self.image.as_ref()?.visible(),
                Slot::Table => self.image.as_ref()?.table(),
                Slot::Factors => self.image.as_ref()?.factors(),
                Slot::Change => &self.change,
                Slot::Cells => &own.cells,
                Slot::Lengths => &self.lengths.as_ref()?.table,
                Slot::Heights => &own.heights,
                Slot::Across => &own.across,
                Slot::Filtered => &own.filtered,
                Slot::Shown if plan.has(PassName::HeightFilterDown) => &own.filtered,
                Slot::Shown => &own.heights,
                Slot::HullDepths => &own.hull_depths,
                Slot::HullSurfaces => &own.hull_surfaces,
                Slot::Tops => &own.tops,
                Slot::Arrows => &self.arrows.as_ref()?.instances,
                Slot::SolidDepths => &solid_targets?.depths,
                Slot::SolidFaces => &solid_targets?.faces,
            };
            Some(buffer.as_entire_binding())
        };
        for (pass, _, slots) in SHADERS.iter().filter(|(pass, ..)| plan.has(*pass)) {
            if !has_arrows && !matches!(pass, PassName::Surface | PassName::Outside) {
                has_arrows = true;
                let entries: Vec<_> = [(0, Slot::View), (16, Slot::Change), (24, Slot::Arrows)]
                    .into_iter()
                    .filter_map(|(binding, slot)| Some((binding, resource(slot)?)))
                    .collect();
                let drawing = Drawing {
                    picture: arrow_targets.picture.clone(),
                    depths: arrow_targets.depths.clone(),
                    indices: self.triangles.clone(),
                    index_count: self.triangle_corners,
                    instances: arrow_count,
                };
                self.passes.bind_raster(gpu, PassName::Arrows, &entries, drawing);
            }
            if !lit && matches!(pass, PassName::Context | PassName::Compose) {
                lit = true;
                let image = self.image.as_ref().zip(around.volume.as_ref()).filter(|_| shows_image(plan));
                let scene = LitScene {
                    image: image.map(|(buffers, volume)| LitImage {
                        buffers,
                        volume,
                        transfer: &around.transfer,
                        context: &self.context,
                    }),
                    tumor: around.tumor.as_ref(),
                    selection: &around.selection,
                    camera: &around.camera,
                    reference_mm: around.reference_mm(),
                    size: targets.size,
                    strength: quality.strength(),
                    view: &self.view,
                    depths: solid_targets.map_or(&targets.depths, |solid| &solid.depths),
                    surfaces: solid_targets.map_or(&targets.surfaces, |solid| &solid.faces),
                    marched: &targets.outsides,
                    blurred: &targets.blurred,
                    regions: [&regions.table, &regions.words, &regions.regions],
                };
                lights.bind(gpu, &mut self.passes, plan, &scene, &quality.lighting)?;
            }
            let mut entries: Vec<_> =
                slots.iter().filter_map(|&(binding, slot)| Some((binding, resource(slot)?))).collect();
            let workgroups = workgroups_of(targets.size);
            if let (PassName::Context, Some(grid), Some(image)) = (pass, lights.grid(), &self.image) {
                entries.extend(grid.into_iter().zip(LIGHT_BINDINGS).map(|(b, n)| (n, b.as_entire_binding())));
                let shader = (LIT_MARCH, &[image.tables().gradient_counts()][..]);
                self.passes.bind_shader(gpu, *pass, shader, &entries, workgroups)?;
            } else {
                self.passes.bind(gpu, *pass, &entries, workgroups);
            }
        }
        self.lights = lights;
        Ok(())
    }

    /// Where [`ChangeRenderer::pass_times`] come from on this device.
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
