//! What the 3D views share: one renderer for all of them, its frames, and the trait that each view implements.
//!
//! Lifetimes: pipelines once per [`Renderer`]; a view's buffers once per input; targets once per size (about 40
//! bytes per pixel, and what the view adds); uniforms and bindings once per frame.

use std::fmt;

use glioscope_core::optics::Camera;

use crate::{
    device::{
        Gpu, PassName, RenderError, TimeSource,
        runner::{PassRunner, workgroups_of},
    },
    light::{LightPasses, LightSample, LightWork, StandardError},
    scene::{Plan, Quality},
    solid::{
        targets::Targets,
        view::{View, drawn_pixel},
    },
};

/// The last pass of most views: colours, lines, lens ring.
pub(crate) const COMPOSE: PassName = PassName::new("compose");

/// A 3D view: its scene, its passes, and its picks. Implemented in each view's folder.
pub trait View3d: Sized {
    /// What it draws. Comparing two scenes doesn't compare voxels.
    type Scene: Clone + PartialEq;
    /// What is under a pixel.
    type Pick;
    /// View-specific data of a frame.
    #[doc(hidden)]
    type FrameData;
    /// Whether a frame may be drawn in parts: see [`Renderer::begin`].
    const IN_PARTS: bool;

    /// Shader files that every scene needs, compiled at once.
    #[doc(hidden)]
    const SHADERS: &'static [&'static str];

    /// The passes that `scene` needs at `quality`. Omitting the others changes no pixel.
    fn plan(scene: &Self::Scene, quality: &Quality) -> Plan;

    /// Rejects a scene that can't be drawn.
    ///
    /// # Errors
    /// [`RenderError::Scene`].
    #[doc(hidden)]
    fn check(scene: &Self::Scene) -> Result<(), RenderError>;

    /// Creates the buffers that outlive a frame.
    #[doc(hidden)]
    fn start(gpu: &Gpu) -> Result<Self, RenderError>;

    /// Uploads what is new and binds the passes of `draw.plan`.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then.
    #[doc(hidden)]
    fn prepare(
        &mut self,
        draw: &mut Draw<'_>,
        scene: &Self::Scene,
        previous: Option<Self::FrameData>,
    ) -> Result<Prepared<Self::FrameData>, RenderError>;

    /// Whether the light of such a frame has a reference, so that its error can be measured.
    fn has_light_reference(_scene: &Self::Scene, _quality: &Quality) -> bool {
        false
    }

    /// The light of a drawn frame, read back so that its error can be measured; `None` where it has no reference.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    fn light_sample(
        _frame: &Frame<Self>,
        _gpu: &Gpu,
        _scene: &Self::Scene,
        _quality: &Quality,
    ) -> Result<Option<LightSample>, RenderError> {
        Ok(None)
    }

    /// What is under a drawn pixel.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    #[doc(hidden)]
    fn pick(frame: &Frame<Self>, gpu: &Gpu, pixel: [u32; 2]) -> Result<Option<Self::Pick>, RenderError>;
}

/// What tests turn off to check that the frame doesn't change, or only as expected.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches {
    /// Skip empty bricks, and what is behind opaque fragments.
    pub skipping: bool,
    /// Offset the samples of neighbouring rays differently.
    pub jitter: bool,
}

impl Switches {
    pub(crate) const ON: Self = Self { skipping: true, jitter: true };

    /// All on, except skipping where it is `false`.
    #[cfg(test)]
    pub(crate) fn skipping(skipping: bool) -> Self {
        Self { skipping, ..Self::ON }
    }
}

/// A frame being prepared.
#[doc(hidden)]
pub struct Draw<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) passes: &'a mut PassRunner,
    pub(crate) lights: &'a mut LightPasses,
    /// The uniform of `lib/view`; the view writes it.
    pub(crate) view: &'a wgpu::Buffer,
    pub(crate) targets: &'a Targets,
    pub(crate) quality: &'a Quality,
    pub(crate) plan: &'a mut Plan,
    pub(crate) switches: Switches,
}

impl Draw<'_> {
    /// Pixels drawn.
    pub(crate) fn size(&self) -> [u32; 2] {
        self.targets.size
    }

    /// Workgroups with one thread per pixel.
    pub(crate) fn workgroups(&self) -> [u32; 3] {
        workgroups_of(self.targets.size)
    }

    /// Writes the view's uniform.
    pub(crate) fn write_view(&self, view: &View) {
        self.gpu.queue.write_buffer(self.view, 0, bytemuck::bytes_of(view));
    }
}

/// The results of preparing a frame.
#[doc(hidden)]
pub struct Prepared<K> {
    pub(crate) data: K,
    pub(crate) camera: Camera,
    /// View depth of the plane that depths are relative to.
    pub(crate) reference_mm: f64,
    pub(crate) warnings: Vec<String>,
    pub(crate) notes: Vec<String>,
}

/// A finished frame. Its textures are reused by the next frame of the same size.
pub struct Frame<V: View3d> {
    /// rgba8unorm, gamma-encoded sRGB, opaque. Usable as an egui texture.
    pub color: wgpu::Texture,
    /// Pixels drawn: the size of `color`. At most `asked_px`, see `Quality::resolution_scale`.
    pub size_px: [u32; 2],
    /// Pixels requested: those of [`Frame::pick`].
    pub asked_px: [u32; 2],
    /// The passes that ran, and those omitted.
    pub plan: Plan,
    /// What the frame lacks of the scene, in words for the user.
    pub warnings: Vec<String>,
    /// Notes of the light passes in words: changed settings, omitted work.
    pub notes: Vec<String>,
    pub(crate) targets: Targets,
    pub(crate) camera: Camera,
    pub(crate) reference_mm: f64,
    pub(crate) data: V::FrameData,
}

impl<V: View3d> fmt::Debug for Frame<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Frame")
            .field("size_px", &self.size_px)
            .field("plan", &self.plan)
            .finish_non_exhaustive()
    }
}

impl<V: View3d<FrameData: Clone>> Clone for Frame<V> {
    fn clone(&self) -> Self {
        Self {
            color: self.color.clone(),
            plan: self.plan.clone(),
            warnings: self.warnings.clone(),
            notes: self.notes.clone(),
            targets: self.targets.clone(),
            data: self.data.clone(),
            ..*self
        }
    }
}

impl<V: View3d> Frame<V> {
    /// All pixels, row after row from the top, 4 bytes each: `size_px[0] * size_px[1] * 4` bytes.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn read_rgba(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        gpu.read_rgba(&self.color)
    }

    /// What is under pixel (`x`, `y`) of the requested size, counted from the top left; `None` outside the frame and on
    /// the background. Reads back only a few bytes, so it may be called at every mouse move.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn pick(&self, gpu: &Gpu, x: u32, y: u32) -> Result<Option<V::Pick>, RenderError> {
        if x >= self.asked_px[0] || y >= self.asked_px[1] {
            return Ok(None);
        }
        V::pick(self, gpu, drawn_pixel([x, y], self.asked_px, self.size_px))
    }

    /// Index of a drawn pixel in row-major buffers.
    pub(crate) fn linear(&self, pixel: [u32; 2]) -> u64 {
        u64::from(pixel[1]) * u64::from(self.size_px[0]) + u64::from(pixel[0])
    }
}

/// Draws one kind of view. Not bound to a window.
pub struct Renderer<V: View3d> {
    passes: PassRunner,
    lights: LightPasses,
    view_uniform: wgpu::Buffer,
    pub(crate) view: V,
    frame: Option<Frame<V>>,
    /// Drawn in parts, and not complete yet.
    pending: Option<Frame<V>>,
}

impl<V: View3d> Renderer<V> {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] if the driver rejects a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let renderer = Self {
            passes: PassRunner::new(gpu, V::SHADERS.iter().copied())?,
            lights: LightPasses::default(),
            view_uniform: gpu.uniform::<View>("Renderer::view"),
            view: V::start(gpu)?,
            frame: None,
            pending: None,
        };
        gpu.check()?;
        Ok(renderer)
    }

    /// Draws `scene` at `quality` for an area of `size_px` pixels. Returns when the work is submitted; reading the
    /// frame waits for it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then, and the previous frame is dropped.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        scene: &V::Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&Frame<V>, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, V::plan(scene, quality), Switches::ON)
    }

    /// The last frame, if drawing it succeeded.
    pub fn frame(&self) -> Option<&Frame<V>> {
        self.frame.as_ref()
    }

    /// As [`Renderer::render`] with a given plan.
    pub(crate) fn render_planned(
        &mut self,
        gpu: &Gpu,
        scene: &V::Scene,
        quality: &Quality,
        asked_px: [u32; 2],
        plan: Plan,
        switches: Switches,
    ) -> Result<&Frame<V>, RenderError> {
        let previous = self.frame.take();
        let frame = self.prepare(gpu, scene, quality, asked_px, (plan, switches), previous)?;
        self.passes.run(gpu);
        gpu.check()?;
        Ok(self.frame.insert(frame))
    }

    /// Begins a frame that [`Renderer::resume`] draws in parts; the last frame stays until it is complete. Views that
    /// can't be drawn in parts draw it at once. Drawing another frame drops it.
    ///
    /// # Errors
    /// [`RenderError`]; no frame is pending then.
    pub fn begin(
        &mut self,
        gpu: &Gpu,
        scene: &V::Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<(), RenderError> {
        if !V::IN_PARTS {
            return self.render(gpu, scene, quality, size_px).map(|_| ());
        }
        let planned = (V::plan(scene, quality), Switches::ON);
        let frame = self.prepare(gpu, scene, quality, size_px, planned, None)?;
        self.pending = Some(frame);
        Ok(())
    }

    /// Resumes the pending frame for about `milliseconds`. Returns whether it is complete, and so is
    /// [`Renderer::frame`]; true if none is pending.
    ///
    /// # Errors
    /// [`RenderError::Device`]; the pending frame is dropped then.
    pub fn resume(&mut self, gpu: &Gpu, milliseconds: f64) -> Result<bool, RenderError> {
        let Some(pending) = self.pending.take() else { return Ok(true) };
        let done = self.passes.run_part(gpu, milliseconds)?;
        gpu.check()?;
        *(if done { &mut self.frame } else { &mut self.pending }) = Some(pending);
        Ok(done)
    }

    /// Completed share of the pending frame, 0 to 1; `None` if none is pending.
    pub fn share_done(&self) -> Option<f64> {
        self.pending.as_ref().map(|_| self.passes.share_done())
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        scene: &V::Scene,
        quality: &Quality,
        asked_px: [u32; 2],
        (mut plan, switches): (Plan, Switches),
        previous: Option<Frame<V>>,
    ) -> Result<Frame<V>, RenderError> {
        self.pending = None;
        self.passes.clear();
        gpu.check()?;
        V::check(scene)?;
        let size = quality.drawn_px(asked_px);
        let (targets, data) = match previous {
            Some(frame) if frame.targets.size == size => (frame.targets, Some(frame.data)),
            _ => (Targets::new(gpu, size)?, None),
        };
        let mut draw = Draw {
            gpu,
            passes: &mut self.passes,
            lights: &mut self.lights,
            view: &self.view_uniform,
            targets: &targets,
            quality,
            plan: &mut plan,
            switches,
        };
        let Prepared { data, camera, reference_mm, warnings, notes } =
            self.view.prepare(&mut draw, scene, data)?;
        Ok(Frame {
            color: targets.color.clone(),
            size_px: size,
            asked_px,
            plan,
            warnings,
            notes,
            targets,
            camera,
            reference_mm,
            data,
        })
    }

    /// How [`Renderer::pass_times`] are measured on this device.
    pub fn time_source(&self) -> TimeSource {
        self.passes.time_source()
    }

    /// Work of the light passes for the last frame's image; `None` without an image lit by them.
    pub fn light_work(&self) -> Option<LightWork> {
        self.lights.work()
    }

    /// The error of the last frame's light, measured in the frame itself; `None` where its lighting mode measures none, and
    /// while another frame is drawn in parts. Waits for the frame.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn standard_error(&self, gpu: &Gpu) -> Result<Option<StandardError>, RenderError> {
        let is_complete = self.frame.is_some() && self.pending.is_none();
        if is_complete { self.lights.measured_error(gpu) } else { Ok(None) }
    }

    /// Milliseconds of each pass of the last frame, in order; empty before the first. Waits for it.
    /// Without timestamps on the device the passes are run again, one by one.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn pass_times(&self, gpu: &Gpu) -> Result<Vec<(PassName, f64)>, RenderError> {
        if self.frame.is_some() { self.passes.times(gpu) } else { Ok(Vec::new()) }
    }

    #[cfg(test)]
    pub(crate) fn lights(&self) -> &LightPasses {
        &self.lights
    }

    #[cfg(test)]
    pub(crate) fn lights_mut(&mut self) -> &mut LightPasses {
        &mut self.lights
    }
}
