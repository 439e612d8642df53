//! Shows rendered frames as egui textures.

use std::{sync::Arc, time::Instant};

use egui::{TextureId, mutex::RwLock};
use glam::UVec2;
use glioscope_render::{
    Frame, Gpu, PassName, Plan, Quality, RenderError, Renderer, View3d,
    light::{LightSample, StandardError},
};

use crate::{cpu_paint::ViewPictures, error::AppError};

/// The graphics device of the 3D views, with egui's renderer on it.
#[derive(Clone)]
pub struct Graphics {
    /// The device.
    pub gpu: Gpu,
    /// egui's renderer, which shows the frames as textures.
    pub egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>,
    /// The painter that shows them instead, where the window is painted on the CPU.
    pub pictures: Option<ViewPictures>,
}

/// Time of each render pass of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTimes {
    /// Milliseconds, in the order of the plan.
    pub passes: Vec<(PassName, f64)>,
    /// How the times were measured, as text.
    pub source: &'static str,
}

/// Report of the frame last drawn in a 3D view.
pub trait ScreenReport {
    /// The plan of the frame, and its width and height in pixels.
    fn plan(&self) -> Option<(&Plan, [u32; 2])>;
    /// The quality of the frame.
    fn quality(&self) -> Option<&Quality>;
    /// Time of each render pass of the frame; read back once per frame.
    ///
    /// # Errors
    /// [`AppError`] if no frame was drawn, a finer frame is in progress, or the device fails.
    fn pass_times(&mut self, gpu: &Gpu) -> Result<&PassTimes, AppError>;
    /// Finished share of a finer frame in progress, 0 to 1; `None` if there is none.
    fn share_done(&self) -> Option<f64>;
    /// The error of the frame's light that was measured in it; `None` where its lighting mode measures none; read back once
    /// per frame.
    ///
    /// # Errors
    /// [`AppError`] if the device fails.
    fn standard_error(&mut self, gpu: &Gpu) -> Result<Option<StandardError>, AppError>;
    /// Notes on the lighting, as text: changed settings, omitted work.
    fn notes(&self) -> &[String];
    /// Parts of the scene that the frame doesn't show, as text.
    fn warnings(&self) -> &[String];
    /// Whether the light of the frame can be measured.
    fn light_is_measurable(&self) -> bool;
    /// The light of the frame, read back so that its error can be measured; `None` where there is no reference, and while a
    /// finer frame is in progress.
    ///
    /// # Errors
    /// [`AppError`] if the device fails.
    fn light_sample(&self, gpu: &Gpu) -> Result<Option<LightSample>, AppError>;
    /// Number of frames drawn so far; tests check that an idle window draws none.
    fn frames_drawn(&self) -> u64;
}

/// One 3D view: its renderer, compiled when the view is first shown, and the frame last drawn.
pub struct Screen<V: View3d> {
    renderer: Option<Renderer<V>>,
    shown: Option<ShownFrame<V::Scene>>,
    /// Pass times, with the number of the frame they are of.
    times: Option<(u64, PassTimes)>,
    /// The measured error of the light, with the number of the frame it is of.
    standard_error: Option<(u64, Option<StandardError>)>,
    draw_ms: Option<f64>,
    /// A finer frame in progress.
    pending: Option<FrameRequest<V::Scene>>,
    frames_drawn: u64,
}

/// Everything that defines a frame.
#[derive(Clone, PartialEq)]
struct FrameRequest<S> {
    scene: S,
    quality: Quality,
    size: UVec2,
}

/// The frame shown, registered as an egui texture.
struct ShownFrame<S> {
    request: FrameRequest<S>,
    texture: wgpu::Texture,
    id: TextureId,
}

impl<V: View3d> Default for Screen<V> {
    fn default() -> Self {
        Self {
            renderer: None,
            shown: None,
            times: None,
            standard_error: None,
            draw_ms: None,
            pending: None,
            frames_drawn: 0,
        }
    }
}

impl<V: View3d> Screen<V> {
    /// Compiles the view's pipelines now, so that an unsuitable device is detected at the start.
    ///
    /// # Errors
    /// [`RenderError`] if the device can't run the passes.
    pub fn compile(&mut self, gpu: &Gpu) -> Result<(), RenderError> {
        if self.renderer.is_none() {
            self.renderer = Some(Renderer::new(gpu)?);
        }
        Ok(())
    }

    /// The scene as a texture. Renders only if scene, quality or size (pixels) changed; if `timed`, waits until it is
    /// rendered and measures the time.
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
        self.present(graphics, FrameRequest { scene: scene.clone(), quality: *quality, size })
    }

    /// As [`Screen::show`] for a frame that may take long: each call renders a part of it for about `milliseconds`, and
    /// the previous frame is shown until it is complete. If the previous frame is of another scene, it is replaced by
    /// one at `draft` quality first. A different quality of the same scene is begun only when the pending frame is
    /// complete.
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
        let Some(id) =
            self.shown.as_ref().filter(|shown| shown.request.scene == *scene).map(|shown| shown.id)
        else {
            return self.show(graphics, scene, draft, size, false);
        };
        let Some(renderer) = &mut self.renderer else { return Ok(id) };
        let gpu = &graphics.gpu;
        if self.pending.as_ref().is_none_or(|p| p.scene != *scene || p.size != size) {
            self.pending = None;
            renderer.begin(gpu, scene, quality, size.to_array())?;
            self.pending = Some(FrameRequest { scene: scene.clone(), quality: *quality, size });
        }
        match renderer.resume(gpu, milliseconds) {
            Ok(false) => Ok(id),
            Ok(true) => match self.pending.take() {
                Some(complete) => self.present(graphics, complete),
                None => Ok(id),
            },
            Err(error) => {
                self.pending = None;
                Err(error)
            }
        }
    }

    /// The shown texture if it is of this scene, quality and size.
    fn texture_of(&self, scene: &V::Scene, quality: &Quality, size: UVec2) -> Option<TextureId> {
        let matches = |request: &FrameRequest<V::Scene>| {
            request.scene == *scene && request.quality == *quality && request.size == size
        };
        self.shown.as_ref().filter(|shown| matches(&shown.request)).map(|shown| shown.id)
    }

    /// Registers the renderer's last frame as egui's texture.
    fn present(
        &mut self,
        graphics: &Graphics,
        request: FrameRequest<V::Scene>,
    ) -> Result<TextureId, RenderError> {
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
        if let Some(pictures) = &graphics.pictures {
            let rgba = graphics.gpu.read_rgba(&texture)?;
            pictures.set(id, [texture.width(), texture.height()], rgba);
        }
        self.shown = Some(ShownFrame { request, texture, id });
        Ok(id)
    }

    /// Rendering time in milliseconds, if the last [`Screen::show`] rendered a timed frame.
    pub fn draw_ms(&self) -> Option<f64> {
        self.draw_ms
    }

    /// The frame last drawn.
    pub fn frame(&self) -> Option<&Frame<V>> {
        self.renderer.as_ref()?.frame()
    }

    /// The frame last drawn, and its pixel at `u`, `v`: 0 to 1 from the top left, clamped.
    pub fn pixel(&self, u: f32, v: f32) -> Option<(&Frame<V>, [u32; 2])> {
        let frame = self.frame()?;
        let pixel_index = |fraction: f32, extent: u32| {
            ((fraction.clamp(0.0, 1.0) * extent as f32) as u32).min(extent.saturating_sub(1))
        };
        Some((frame, [pixel_index(u, frame.asked_px[0]), pixel_index(v, frame.asked_px[1])]))
    }
}

impl<V: View3d> ScreenReport for Screen<V> {
    fn plan(&self) -> Option<(&Plan, [u32; 2])> {
        self.frame().map(|frame| (&frame.plan, frame.size_px))
    }

    fn quality(&self) -> Option<&Quality> {
        self.shown.as_ref().map(|shown| &shown.request.quality)
    }

    fn pass_times(&mut self, gpu: &Gpu) -> Result<&PassTimes, AppError> {
        if self.times.as_ref().is_none_or(|(frame, _)| *frame != self.frames_drawn)
            && let Some(renderer) = &self.renderer
        {
            if self.pending.is_some() {
                // The renderer's passes are now those of the pending frame.
                return Err(AppError::Unavailable("Times follow when the finer picture is drawn."));
            }
            let passes = renderer.pass_times(gpu)?;
            let source = renderer.time_source().describe();
            self.times = Some((self.frames_drawn, PassTimes { passes, source }));
        }
        self.times.as_ref().map(|(_, times)| times).ok_or(AppError::Unavailable("no frame was drawn"))
    }

    fn share_done(&self) -> Option<f64> {
        self.pending.as_ref().and(self.renderer.as_ref()).and_then(Renderer::share_done)
    }

    fn standard_error(&mut self, gpu: &Gpu) -> Result<Option<StandardError>, AppError> {
        match (self.standard_error, &self.renderer) {
            (Some((frame, error)), _) if frame == self.frames_drawn => Ok(error),
            (_, Some(renderer)) if self.pending.is_none() => {
                let error = renderer.standard_error(gpu)?;
                self.standard_error = Some((self.frames_drawn, error));
                Ok(error)
            }
            _ => Ok(None),
        }
    }

    fn notes(&self) -> &[String] {
        self.frame().map_or(&[], |frame| &frame.notes)
    }

    fn warnings(&self) -> &[String] {
        self.frame().map_or(&[], |frame| &frame.warnings)
    }

    fn light_is_measurable(&self) -> bool {
        let request = self.shown.as_ref().filter(|_| self.pending.is_none()).map(|shown| &shown.request);
        request.is_some_and(|request| V::has_light_reference(&request.scene, &request.quality))
    }

    fn light_sample(&self, gpu: &Gpu) -> Result<Option<LightSample>, AppError> {
        let (Some(frame), Some(shown), None) = (self.frame(), &self.shown, &self.pending) else {
            return Ok(None);
        };
        let FrameRequest { scene, quality, .. } = &shown.request;
        Ok(V::light_sample(frame, gpu, scene, quality)?)
    }

    fn frames_drawn(&self) -> u64 {
        self.frames_drawn
    }
}
