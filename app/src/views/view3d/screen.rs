//! The bridge between egui and the renderers: a frame becomes a texture that egui can show.

use std::{sync::Arc, time::Instant};

use egui::{TextureId, mutex::RwLock};
use glam::UVec2;
use glioscope_render::{Frame, Gpu, PassName, Plan, Quality, RenderError, Renderer, View3d};

use crate::error::AppError;

/// The device that 3D views are drawn on, and egui's renderer on it.
#[derive(Clone)]
pub struct Graphics {
    /// The device.
    pub gpu: Gpu,
    /// egui's renderer, which shows the pictures.
    pub egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>,
}

/// How long each pass of a frame took.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTimes {
    /// Milliseconds, in the order of the plan.
    pub passes: Vec<(PassName, f64)>,
    /// What measured them.
    pub source: &'static str,
}

/// What a 3D view has to report of the picture last drawn.
pub trait ScreenReport {
    /// The plan of the frame last drawn, and the pixels drawn.
    fn plan(&self) -> Option<(&Plan, [u32; 2])>;
    /// The quality of the frame last drawn.
    fn quality(&self) -> Option<&Quality>;
    /// Milliseconds of each pass of the frame last drawn, read back once per frame.
    ///
    /// # Errors
    /// [`AppError`], when the device fails.
    fn pass_times(&mut self, gpu: &Gpu) -> Result<&PassTimes, AppError>;
    /// How much of a finer picture is drawn that isn't shown yet, 0 to 1.
    fn share_done(&self) -> Option<f64>;
    /// What of the light is other than asked for, in words.
    fn notes(&self) -> &[String];
    /// What the picture shows less of than the scene has, in words.
    fn warnings(&self) -> &[String];
    /// Frames drawn so far: a test that an idle window draws nothing reads it.
    fn frames_drawn(&self) -> u64;
}

/// One 3D view: its renderer, compiled when the view is first shown, and the picture last drawn.
pub struct Screen<V: View3d> {
    renderer: Option<Renderer<V>>,
    shown: Option<Shown<V::Scene>>,
    times: Option<(u64, PassTimes)>,
    draw_ms: Option<f64>,
    pending: Option<Wanted<V::Scene>>,
    frames_drawn: u64,
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

impl<V: View3d> Default for Screen<V> {
    fn default() -> Self {
        Self { renderer: None, shown: None, times: None, draw_ms: None, pending: None, frames_drawn: 0 }
    }
}

impl<V: View3d> Screen<V> {
    /// Compiles the view's pipelines now, so that a device that can't is known at the start.
    ///
    /// # Errors
    /// [`RenderError`], when the device can't run the passes.
    pub fn compile(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        if self.renderer.is_none() {
            self.renderer = Some(Renderer::new(gpu)?);
        }
        Ok(())
    }

    /// The scene as a texture. Draws only when scene, quality or size changed; waits for it where it is
    /// `timed`.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn show(
        &mut self,
        graphics: &Graphics,
        scene: &V::Scene,
        quality: &Quality,
        size: UVec2,
        timed: bool,
    ) -> Result<TextureId, RenderError> {
        self.draw_ms = None;
        if let Some(id) = self.texture_of(scene, quality, size) {
            return Ok(id);
        }
        self.pending = None;
        let gpu = &graphics.gpu;
        let renderer = match &mut self.renderer {
            Some(renderer) => renderer,
            none => none.insert(Renderer::new(gpu)?),
        };
        let start = Instant::now();
        renderer.render(gpu, scene, quality, size.to_array())?;
        if timed {
            gpu.wait()?;
            self.draw_ms = Some(start.elapsed().as_secs_f64() * 1e3);
        }
        self.present(graphics, Wanted { scene: scene.clone(), quality: *quality, size })
    }

    /// As [`Screen::show`] for a picture that may take long: each call draws a part of it for about so many
    /// milliseconds, and the one before is shown until it is whole. Where that is of another scene, `draft` is
    /// drawn first. A finer picture of the same scene waits until the pending one is whole.
    ///
    /// # Errors
    /// [`RenderError`].
    pub fn show_in_parts(
        &mut self,
        graphics: &Graphics,
        scene: &V::Scene,
        (draft, quality): (&Quality, &Quality),
        size: UVec2,
        milliseconds: f64,
    ) -> Result<TextureId, RenderError> {
        self.draw_ms = None;
        if let Some(id) = self.texture_of(scene, quality, size) {
            return Ok(id);
        }
        let Some(id) = self.shown.as_ref().filter(|shown| shown.of.scene == *scene).map(|shown| shown.id)
        else {
            return self.show(graphics, scene, draft, size, false);
        };
        let Some(renderer) = &mut self.renderer else { return Ok(id) };
        let gpu = &graphics.gpu;
        if self.pending.as_ref().is_none_or(|p| p.scene != *scene || p.size != size) {
            self.pending = None;
            renderer.begin(gpu, scene, quality, size.to_array())?;
            self.pending = Some(Wanted { scene: scene.clone(), quality: *quality, size });
        }
        match renderer.resume(gpu, milliseconds) {
            Ok(false) => Ok(id),
            Ok(true) => match self.pending.take() {
                Some(whole) => self.present(graphics, whole),
                None => Ok(id),
            },
            Err(error) => {
                self.pending = None;
                Err(error)
            }
        }
    }

    /// The texture, where it shows this.
    fn texture_of(&self, scene: &V::Scene, quality: &Quality, size: UVec2) -> Option<TextureId> {
        let is = |of: &Wanted<V::Scene>| of.scene == *scene && of.quality == *quality && of.size == size;
        self.shown.as_ref().filter(|shown| is(&shown.of)).map(|shown| shown.id)
    }

    /// Hands egui the renderer's last frame.
    fn present(&mut self, graphics: &Graphics, of: Wanted<V::Scene>) -> Result<TextureId, RenderError> {
        let frame = self.renderer.as_ref().and_then(Renderer::frame);
        let no_frame = || RenderError::Device("no frame after drawing".into());
        let texture = frame.map(|frame| frame.color.clone()).ok_or_else(no_frame)?;
        self.frames_drawn += 1;
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let device = &graphics.gpu.device;
        let mut egui_renderer = graphics.egui_renderer.write();
        let filter = wgpu::FilterMode::Linear;
        let id = match &self.shown {
            Some(shown) if shown.texture == texture => shown.id,
            Some(shown) => {
                egui_renderer.update_egui_texture_from_wgpu_texture(device, &view, filter, shown.id);
                shown.id
            }
            None => egui_renderer.register_native_texture(device, &view, filter),
        };
        drop(egui_renderer);
        self.shown = Some(Shown { of, texture, id });
        Ok(id)
    }

    /// How long the picture took that [`Screen::show`] has just drawn and timed.
    pub fn draw_ms(&self) -> Option<f64> {
        self.draw_ms
    }

    /// The frame last drawn.
    pub fn frame(&self) -> Option<&Frame<V>> {
        self.renderer.as_ref()?.frame()
    }

    /// The frame last drawn, and the pixel of it at a place: `u` and `v` from 0 to 1 from the top left.
    pub fn pixel(&self, u: f32, v: f32) -> Option<(&Frame<V>, [u32; 2])> {
        let frame = self.frame()?;
        let at = |fraction: f32, extent: u32| {
            ((fraction.clamp(0.0, 1.0) * extent as f32) as u32).min(extent.saturating_sub(1))
        };
        Some((frame, [at(u, frame.asked_px[0]), at(v, frame.asked_px[1])]))
    }
}

impl<V: View3d> ScreenReport for Screen<V> {
    fn plan(&self) -> Option<(&Plan, [u32; 2])> {
        self.frame().map(|frame| (&frame.plan, frame.size_px))
    }

    fn quality(&self) -> Option<&Quality> {
        self.shown.as_ref().map(|shown| &shown.of.quality)
    }

    fn pass_times(&mut self, gpu: &Gpu) -> Result<&PassTimes, AppError> {
        if self.times.as_ref().is_none_or(|(frame, _)| *frame != self.frames_drawn)
            && let Some(renderer) = &self.renderer
        {
            if self.pending.is_some() {
                // The passes are those of another picture now.
                return Err(AppError::Nothing("Times follow when the finer picture is drawn."));
            }
            let passes = renderer.pass_times(gpu)?;
            let source = renderer.time_source().describe();
            self.times = Some((self.frames_drawn, PassTimes { passes, source }));
        }
        self.times.as_ref().map(|(_, times)| times).ok_or(AppError::Nothing("no frame was drawn"))
    }

    fn share_done(&self) -> Option<f64> {
        self.pending.as_ref().and(self.renderer.as_ref()).and_then(Renderer::share_done)
    }

    fn notes(&self) -> &[String] {
        self.frame().map_or(&[], |frame| &frame.notes)
    }

    fn warnings(&self) -> &[String] {
        self.frame().map_or(&[], |frame| &frame.warnings)
    }

    fn frames_drawn(&self) -> u64 {
        self.frames_drawn
    }
}
