//! The bridge between egui and the renderers: a frame becomes a texture that egui can show.

use std::{sync::Arc, time::Instant};

use egui::{TextureId, mutex::RwLock};
use glam::UVec2;
use glioscope_render::{
    ChangeRenderer, ContextRenderer, EllipsoidRenderer, Frame, Gpu, PassName, Pick, Picture, Plan, Quality,
    RenderError, Renderer, Scene, SceneRenderer,
};

/// Draws scenes on egui's device and hands egui the pictures. One for each program.
pub struct Viewport {
    /// The device it draws on.
    pub gpu: Gpu,
    /// The closeup.
    pub closeup: Screen<Renderer>,
    /// The context view.
    pub context: Screen<ContextRenderer>,
    /// The ellipsoid diagram.
    pub ellipsoids: Screen<EllipsoidRenderer>,
    /// The change view.
    pub change: Screen<ChangeRenderer>,
}

/// How long each pass of a frame took.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTimes {
    /// Milliseconds, in the order of the plan.
    pub passes: Vec<(PassName, f64)>,
    /// What measured them.
    pub source: &'static str,
}

/// One 3D view: its renderer, compiled when the view is first shown, and the picture last drawn.
pub struct Screen<R: SceneRenderer> {
    egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>,
    renderer: Option<R>,
    shown: Option<Shown<R::Scene>>,
    times: Option<(u64, PassTimes)>,
    took_ms: Option<f64>,
    coming: Option<Wanted<R::Scene>>,
    /// Frames drawn so far: a test that an idle window draws nothing reads it.
    pub frames_drawn: u64,
}

/// What a picture is of.
#[derive(Clone, PartialEq)]
struct Wanted<S> {
    scene: S,
    quality: Quality,
    size: UVec2,
}

struct Shown<S> {
    of: Wanted<S>,
    texture: wgpu::Texture,
    id: TextureId,
}

impl<R: SceneRenderer> Screen<R> {
    fn new(egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>) -> Self {
        Self {
            egui_renderer,
            renderer: None,
            shown: None,
            times: None,
            took_ms: None,
            coming: None,
            frames_drawn: 0,
        }
    }

    /// The scene as a texture. Draws only when scene, quality or size changed; waits for it where it is
    /// `timed`.
    ///
    /// # Errors
    /// One line.
    pub fn show(
        &mut self,
        gpu: &Gpu,
        scene: &R::Scene,
        quality: &Quality,
        size: UVec2,
        timed: bool,
    ) -> Result<TextureId, String> {
        self.took_ms = None;
        if let Some(id) = self.has(scene, quality, size) {
            return Ok(id);
        }
        self.coming = None;
        let renderer = match &mut self.renderer {
            Some(renderer) => renderer,
            none => none.insert(R::start(gpu).map_err(|e| e.to_string())?),
        };
        let start = Instant::now();
        renderer.draw(gpu, scene, quality, size.to_array()).map_err(|e| e.to_string())?;
        if timed {
            gpu.wait()?;
            self.took_ms = Some(start.elapsed().as_secs_f64() * 1e3);
        }
        self.present(gpu, Wanted { scene: scene.clone(), quality: *quality, size })
    }

    /// As [`Screen::show`] for a picture that may take long: it is drawn a part a call, each of about so many
    /// milliseconds, and the one before is shown until it is whole. Where that is of another scene, `draft` is
    /// drawn first. A finer picture of the same scene waits until the one under way is whole.
    ///
    /// # Errors
    /// One line.
    pub fn show_in_parts(
        &mut self,
        gpu: &Gpu,
        scene: &R::Scene,
        (draft, quality): (&Quality, &Quality),
        size: UVec2,
        milliseconds: f64,
    ) -> Result<TextureId, String> {
        self.took_ms = None;
        if let Some(id) = self.has(scene, quality, size) {
            return Ok(id);
        }
        let Some(id) = self.shown.as_ref().filter(|shown| shown.of.scene == *scene).map(|shown| shown.id)
        else {
            return self.show(gpu, scene, draft, size, false);
        };
        let Some(renderer) = &mut self.renderer else { return Ok(id) };
        if self.coming.as_ref().is_none_or(|c| c.scene != *scene || c.size != size) {
            self.coming = None;
            renderer.begin(gpu, scene, quality, size.to_array()).map_err(|e| e.to_string())?;
            self.coming = Some(Wanted { scene: scene.clone(), quality: *quality, size });
        }
        match renderer.go_on(gpu, milliseconds) {
            Ok(false) => Ok(id),
            Ok(true) => match self.coming.take() {
                Some(whole) => self.present(gpu, whole),
                None => Ok(id),
            },
            Err(error) => {
                self.coming = None;
                Err(error.to_string())
            }
        }
    }

    /// How much of a finer picture is drawn that isn't shown yet, 0 to 1.
    pub fn share_done(&self) -> Option<f64> {
        self.coming.as_ref().and(self.renderer.as_ref()).and_then(SceneRenderer::share_done)
    }

    /// The texture, where it shows this.
    fn has(&self, scene: &R::Scene, quality: &Quality, size: UVec2) -> Option<TextureId> {
        let is = |of: &Wanted<R::Scene>| of.scene == *scene && of.quality == *quality && of.size == size;
        self.shown.as_ref().filter(|shown| is(&shown.of)).map(|shown| shown.id)
    }

    /// Hands egui the renderer's last frame.
    fn present(&mut self, gpu: &Gpu, of: Wanted<R::Scene>) -> Result<TextureId, String> {
        let frame = self.renderer.as_ref().and_then(SceneRenderer::last);
        let texture = frame.map(|frame| frame.color().clone()).ok_or("no frame was drawn")?;
        self.frames_drawn += 1;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut egui_renderer = self.egui_renderer.write();
        let filter = wgpu::FilterMode::Linear;
        let id = match &self.shown {
            Some(shown) if shown.texture == texture => shown.id,
            Some(shown) => {
                egui_renderer.update_egui_texture_from_wgpu_texture(&gpu.device, &view, filter, shown.id);
                shown.id
            }
            None => egui_renderer.register_native_texture(&gpu.device, &view, filter),
        };
        drop(egui_renderer);
        self.shown = Some(Shown { of, texture, id });
        Ok(id)
    }

    /// How long the picture took that [`Screen::show`] has just drawn and timed.
    pub fn took_ms(&self) -> Option<f64> {
        self.took_ms
    }

    /// The quality of the frame last drawn.
    pub fn quality(&self) -> Option<&Quality> {
        self.shown.as_ref().map(|shown| &shown.of.quality)
    }

    /// The frame last drawn.
    pub fn frame(&self) -> Option<&R::Frame> {
        self.renderer.as_ref()?.last()
    }

    /// The frame last drawn, and the pixel of it at a place: `u` and `v` from 0 to 1 from the top left.
    pub fn pixel(&self, u: f32, v: f32) -> Option<(&R::Frame, [u32; 2])> {
        let frame = self.frame()?;
        let [_, asked] = frame.sizes_px();
        let at = |fraction: f32, extent: u32| {
            ((fraction.clamp(0.0, 1.0) * extent as f32) as u32).min(extent.saturating_sub(1))
        };
        Some((frame, [at(u, asked[0]), at(v, asked[1])]))
    }

    /// Milliseconds of each pass of the frame last drawn, read back once a frame.
    ///
    /// # Errors
    /// One line, when the device fails.
    pub fn pass_times(&mut self, gpu: &Gpu) -> Result<&PassTimes, String> {
        if self.times.as_ref().is_none_or(|(frame, _)| *frame != self.frames_drawn)
            && let Some(renderer) = &self.renderer
        {
            if self.coming.is_some() {
                // The passes are those of another picture now.
                return Err("Times follow when the finer picture is drawn.".into());
            }
            let (passes, source) = renderer.times(gpu).map_err(|e| e.to_string())?;
            self.times = Some((self.frames_drawn, PassTimes { passes, source: source.describe() }));
        }
        self.times.as_ref().map(|(_, times)| times).ok_or_else(|| "no frame was drawn".into())
    }

    /// The plan of the frame last drawn, and the pixels drawn.
    pub fn plan(&self) -> Option<(&Plan, [u32; 2])> {
        let frame = self.frame()?;
        Some((frame.plan(), frame.sizes_px()[0]))
    }
}

/// One line of a pick that failed, or what was picked.
fn said<T>(result: Result<Option<T>, RenderError>) -> Result<Option<T>, String> {
    result.map_err(|e| e.to_string())
}

impl Viewport {
    /// A bridge on an existing device, shared with egui's renderer. The closeup's pipelines are
    /// compiled at once, so that a device that can't is known at the start.
    ///
    /// # Errors
    /// One line, when the device can't run the passes.
    pub fn new(gpu: Gpu, egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>) -> Result<Self, String> {
        let renderer = Renderer::new(&gpu).map_err(|e| e.to_string())?;
        let closeup = Screen { renderer: Some(renderer), ..Screen::new(egui_renderer.clone()) };
        let context = Screen::new(egui_renderer.clone());
        let ellipsoids = Screen::new(egui_renderer.clone());
        Ok(Self { gpu, closeup, context, ellipsoids, change: Screen::new(egui_renderer) })
    }

    /// The closeup as a texture, see [`Screen::show`].
    ///
    /// # Errors
    /// One line.
    pub fn show(
        &mut self,
        scene: &Scene,
        quality: &Quality,
        size: UVec2,
        timed: bool,
    ) -> Result<TextureId, String> {
        self.closeup.show(&self.gpu, scene, quality, size, timed)
    }

    /// What is under a place of the closeup last shown, `u` and `v` from 0 to 1 from the top left.
    ///
    /// # Errors
    /// One line, when the device fails.
    pub fn pick(&self, u: f32, v: f32) -> Result<Option<Pick>, String> {
        let Some((frame, [x, y])) = self.closeup.pixel(u, v) else { return Ok(None) };
        said(frame.pick(&self.gpu, x, y))
    }

    /// The closeup last drawn.
    pub fn frame(&self) -> Option<&Frame> {
        self.closeup.frame()
    }
}
