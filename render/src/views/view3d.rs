//! What every 3D view shares: one renderer for all of them, its frames, and what a view has to say for itself.
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
    light::{LightPasses, LightWork},
    scene::{Plan, Quality},
    solid::{
        targets::Targets,
        view::{View, drawn_pixel},
    },
};

/// What the last pass of most views is called: colours, lines, ring.
pub(crate) const COMPOSE: PassName = PassName::new("compose");

/// A 3D view: what it draws, which passes that takes, and what is under a pixel. Implemented by each view's folder.
pub trait View3d: Sized {
    /// What it draws. Comparing two costs nothing per voxel.
    type Scene: Clone + PartialEq;
    /// What is under a pixel.
    type Pick;
    /// What a frame holds besides what all have.
    #[doc(hidden)]
    type Kept;
    /// Whether a picture may be drawn in parts: see [`Renderer::begin`].
    const IN_PARTS: bool;

    /// Shader files that every scene needs, compiled at once.
    #[doc(hidden)]
    const SHADERS: &'static [&'static str];

    /// The passes that `scene` needs at `quality`. Leaving the others out changes no pixel.
    fn plan(scene: &Self::Scene, quality: &Quality) -> Plan;

    /// Refuses what can't be drawn.
    ///
    /// # Errors
    /// [`RenderError::Scene`].
    #[doc(hidden)]
    fn check(scene: &Self::Scene) -> Result<(), RenderError>;

    /// Buffers that last.
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
        spare: Option<Self::Kept>,
    ) -> Result<Prepared<Self::Kept>, RenderError>;

    /// What is under a drawn pixel.
    ///
    /// # Errors
    /// [`RenderError::Device`].
    #[doc(hidden)]
    fn pick(frame: &Frame<Self>, gpu: &Gpu, pixel: [u32; 2]) -> Result<Option<Self::Pick>, RenderError>;
}

/// What tests turn off to see that it changes nothing, or only what it should.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switches {
    /// Leave out empty bricks, and what is behind something opaque.
    pub skipping: bool,
    /// Shift the samples of neighbouring rays.
    pub jitter: bool,
}

impl Switches {
    pub(crate) const ON: Self = Self { skipping: true, jitter: true };

    /// All on but for skipping, where it is off.
    #[cfg(test)]
    pub(crate) fn skipping(skipping: bool) -> Self {
        Self { skipping, ..Self::ON }
    }
}

/// A picture that is being prepared.
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

    /// Workgroups that have a thread for each pixel.
    pub(crate) fn workgroups(&self) -> [u32; 3] {
        workgroups_of(self.targets.size)
    }

    /// Hands the view's uniform to the device.
    pub(crate) fn write_view(&self, view: &View) {
        self.gpu.queue.write_buffer(self.view, 0, bytemuck::bytes_of(view));
    }
}

/// What a view found out while it prepared a picture.
#[doc(hidden)]
pub struct Prepared<K> {
    pub(crate) kept: K,
    pub(crate) camera: Camera,
    /// View depth of the plane that depths are counted from.
    pub(crate) reference_mm: f64,
    pub(crate) warnings: Vec<String>,
    pub(crate) notes: Vec<String>,
}

/// A finished picture. Its textures are reused by the next picture of the same size.
pub struct Frame<V: View3d> {
    /// rgba8unorm, gamma-encoded sRGB, opaque. Usable as an egui texture.
    pub color: wgpu::Texture,
    /// Pixels drawn: the size of `color`. At most `asked_px`, see `Quality::resolution_scale`.
    pub size_px: [u32; 2],
    /// Pixels asked for: what [`Frame::pick`] counts in.
    pub asked_px: [u32; 2],
    /// What ran, and what was left out.
    pub plan: Plan,
    /// What the picture shows less of than the scene has, in words for the user.
    pub warnings: Vec<String>,
    /// What of the light is other than asked for, in words.
    pub notes: Vec<String>,
    pub(crate) targets: Targets,
    pub(crate) camera: Camera,
    pub(crate) reference_mm: f64,
    pub(crate) kept: V::Kept,
}

impl<V: View3d> fmt::Debug for Frame<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Frame")
            .field("size_px", &self.size_px)
            .field("plan", &self.plan)
            .finish_non_exhaustive()
    }
}

impl<V: View3d<Kept: Clone>> Clone for Frame<V> {
    fn clone(&self) -> Self {
        Self {
            color: self.color.clone(),
            plan: self.plan.clone(),
            warnings: self.warnings.clone(),
            notes: self.notes.clone(),
            targets: self.targets.clone(),
            kept: self.kept.clone(),
            ..*self
        }
    }
}

impl<V: View3d> Frame<V> {
    /// All pixels, row after row from the top, 4 bytes each: `size_px[0] * size_px[1] * 4` bytes.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read_rgba(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        gpu.read_rgba(&self.color)
    }

    /// What is under pixel (`x`, `y`) of the asked size, counted from the top left; `None` past the edge and where
    /// there is nothing. Reads a few bytes back: call it as often as the mouse moves.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pick(&self, gpu: &Gpu, x: u32, y: u32) -> Result<Option<V::Pick>, RenderError> {
        if x >= self.asked_px[0] || y >= self.asked_px[1] {
            return Ok(None);
        }
        V::pick(self, gpu, drawn_pixel([x, y], self.asked_px, self.size_px))
    }

    /// Place of a drawn pixel in buffers that are row after row.
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
    /// Drawn in parts, and not whole yet.
    pending: Option<Frame<V>>,
}

impl<V: View3d> Renderer<V> {
    /// Compiles the pipelines.
    ///
    /// # Errors
    /// [`RenderError::Device`] when the driver refuses a shader.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        let made = Self {
            passes: PassRunner::new(gpu, V::SHADERS.iter().copied())?,
            lights: LightPasses::default(),
            view_uniform: gpu.uniform::<View>("Renderer::view"),
            view: V::start(gpu)?,
            frame: None,
            pending: None,
        };
        gpu.check()?;
        Ok(made)
    }

    /// Draws `scene` at `quality` for a place of `size_px` pixels. Returns when the work is submitted; reading the
    /// frame waits for it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is drawn then, and the frame before is gone.
    pub fn render(
        &mut self,
        gpu: &Gpu,
        scene: &V::Scene,
        quality: &Quality,
        size_px: [u32; 2],
    ) -> Result<&Frame<V>, RenderError> {
        self.render_planned(gpu, scene, quality, size_px, V::plan(scene, quality), Switches::ON)
    }

    /// The last frame, if drawing it went well.
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
        let spare = self.frame.take();
        let frame = self.prepare(gpu, scene, quality, asked_px, (plan, switches), spare)?;
        self.passes.run(gpu);
        gpu.check()?;
        Ok(self.frame.insert(frame))
    }

    /// Begins a picture that [`Renderer::resume`] draws in parts, where this view can; the last frame stays until it
    /// is whole. Where it can't, it is drawn at once. Drawing another one drops it.
    ///
    /// # Errors
    /// [`RenderError`]; nothing is begun then.
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

    /// Resumes what was begun, for about so many milliseconds. Whether it is whole: then it is
    /// [`Renderer::frame`]. Nothing to do is done.
    ///
    /// # Errors
    /// [`RenderError::Device`]; what was begun is dropped then.
    pub fn resume(&mut self, gpu: &Gpu, milliseconds: f64) -> Result<bool, RenderError> {
        let Some(begun) = self.pending.take() else { return Ok(true) };
        let done = self.passes.run_part(gpu, milliseconds)?;
        gpu.check()?;
        *(if done { &mut self.frame } else { &mut self.pending }) = Some(begun);
        Ok(done)
    }

    /// How much of what was begun is done, 0 to 1; `None` where nothing is pending.
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
        spare: Option<Frame<V>>,
    ) -> Result<Frame<V>, RenderError> {
        self.pending = None;
        self.passes.clear();
        gpu.check()?;
        V::check(scene)?;
        let size = quality.drawn_px(asked_px);
        let (targets, kept) = match spare {
            Some(frame) if frame.targets.size == size => (frame.targets, Some(frame.kept)),
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
        let Prepared { kept, camera, reference_mm, warnings, notes } =
            self.view.prepare(&mut draw, scene, kept)?;
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
            kept,
        })
    }

    /// Where [`Renderer::pass_times`] come from on this device.
    pub fn time_source(&self) -> TimeSource {
        self.passes.time_source()
    }

    /// What the last frame's image asked of the light's passes; `None` without an image lit by them.
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

    #[cfg(test)]
    pub(crate) fn lights(&self) -> &LightPasses {
        &self.lights
    }

    #[cfg(test)]
    pub(crate) fn lights_mut(&mut self) -> &mut LightPasses {
        &mut self.lights
    }
}
