//! The bridge between egui and the renderer: a frame becomes a texture that egui can show.

use std::sync::Arc;

use egui::{TextureId, mutex::RwLock};
use glam::UVec2;
use glioscope_render::{Frame, Gpu, PassName, Pick, Quality, Renderer, Scene};

/// Draws scenes on egui's device and hands egui the pictures. One for each program.
pub struct Viewport {
    /// The device it draws on.
    pub gpu: Gpu,
    renderer: Renderer,
    egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>,
    shown: Option<Shown>,
    times: Option<(u64, PassTimes)>,
    /// Frames drawn so far: a test that an idle window draws nothing reads it.
    pub frames_drawn: u64,
}

/// How long each pass of a frame took.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTimes {
    /// Milliseconds, in the order of the plan.
    pub passes: Vec<(PassName, f64)>,
    /// What measured them.
    pub source: &'static str,
}

struct Shown {
    scene: Scene,
    quality: Quality,
    size: UVec2,
    texture: wgpu::Texture,
    id: TextureId,
}

impl Viewport {
    /// A bridge on an existing device, shared with egui's renderer.
    ///
    /// # Errors
    /// One line, when the device can't run the passes.
    pub fn new(gpu: Gpu, egui_renderer: Arc<RwLock<egui_wgpu::Renderer>>) -> Result<Self, String> {
        let renderer = Renderer::new(&gpu).map_err(|e| e.to_string())?;
        Ok(Self { gpu, renderer, egui_renderer, shown: None, times: None, frames_drawn: 0 })
    }

    /// The scene as a texture. Draws only when scene, quality or size changed.
    ///
    /// # Errors
    /// One line.
    pub fn show(&mut self, scene: &Scene, quality: &Quality, size: UVec2) -> Result<TextureId, String> {
        if let Some(shown) = &self.shown
            && shown.scene == *scene
            && shown.quality == *quality
            && shown.size == size
        {
            return Ok(shown.id);
        }
        let frame =
            self.renderer.render(&self.gpu, scene, quality, size.to_array()).map_err(|e| e.to_string())?;
        self.frames_drawn += 1;
        let texture = frame.color.clone();
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut egui_renderer = self.egui_renderer.write();
        let id = match &self.shown {
            Some(shown) if shown.texture == texture => shown.id,
            Some(shown) => {
                egui_renderer.update_egui_texture_from_wgpu_texture(
                    &self.gpu.device,
                    &view,
                    wgpu::FilterMode::Linear,
                    shown.id,
                );
                shown.id
            }
            None => egui_renderer.register_native_texture(&self.gpu.device, &view, wgpu::FilterMode::Linear),
        };
        self.shown = Some(Shown { scene: scene.clone(), quality: *quality, size, texture, id });
        Ok(id)
    }

    /// What is under a place of the frame last shown, `u` and `v` from 0 to 1 from the top left.
    ///
    /// # Errors
    /// One line, when the device fails.
    pub fn pick(&self, u: f32, v: f32) -> Result<Option<Pick>, String> {
        let Some(frame) = self.frame() else { return Ok(None) };
        let at = |fraction: f32, extent: u32| {
            ((fraction.clamp(0.0, 1.0) * extent as f32) as u32).min(extent.saturating_sub(1))
        };
        frame.pick(&self.gpu, at(u, frame.asked_px[0]), at(v, frame.asked_px[1])).map_err(|e| e.to_string())
    }

    /// The frame last drawn.
    pub fn frame(&self) -> Option<&Frame> {
        self.renderer.frame()
    }

    /// Milliseconds of each pass of the frame last drawn, read back once a frame.
    ///
    /// # Errors
    /// One line, when the device fails.
    pub fn pass_times(&mut self) -> Result<&PassTimes, String> {
        if self.times.as_ref().is_none_or(|(frame, _)| *frame != self.frames_drawn) {
            let passes = self.renderer.pass_times(&self.gpu).map_err(|e| e.to_string())?;
            let source = self.renderer.time_source().describe();
            self.times = Some((self.frames_drawn, PassTimes { passes, source }));
        }
        self.times.as_ref().map(|(_, times)| times).ok_or_else(|| "no frame was drawn".into())
    }
}
