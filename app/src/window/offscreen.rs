//! Renders any egui view without a window, so that pictures from the command line equal those of the window.

use std::{sync::Arc, time::Duration};

use egui::{Context, RawInput, Rect, Ui, mutex::RwLock, pos2, vec2};
use egui_wgpu::{RendererOptions, ScreenDescriptor};
use glioscope_render::{Gpu, RenderError};

use crate::theme;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Longest wait for the device.
const TIMEOUT: Duration = Duration::from_secs(60);

fn failed(reason: impl Into<String>) -> RenderError {
    RenderError::Device(reason.into())
}

/// egui on a graphics device without a window.
pub struct Offscreen {
    gpu: Gpu,
    renderer: Arc<RwLock<egui_wgpu::Renderer>>,
    ctx: Context,
}

impl Offscreen {
    /// egui on `gpu`, in the light or dark theme.
    pub fn new(gpu: &Gpu, dark: bool) -> Self {
        let options = RendererOptions::PREDICTABLE;
        let renderer = Arc::new(RwLock::new(egui_wgpu::Renderer::new(&gpu.device, FORMAT, options)));
        let ctx = Context::default();
        theme::install(&ctx);
        ctx.set_theme(if dark { egui::Theme::Dark } else { egui::Theme::Light });
        Self { gpu: gpu.clone(), renderer, ctx }
    }

    /// egui's renderer, to register textures with.
    pub fn renderer(&self) -> Arc<RwLock<egui_wgpu::Renderer>> {
        self.renderer.clone()
    }

    /// Draws `ui` until its layout has settled and returns its pixels: RGBA, 8 bits, row by row, opaque. `size` in
    /// pixels.
    ///
    /// # Errors
    /// [`RenderError::Device`] if the device fails or takes longer than 60 s.
    pub fn picture(
        &self,
        size: [u32; 2],
        pixels_per_point: f32,
        mut draw: impl FnMut(&mut Ui),
    ) -> Result<Vec<u8>, RenderError> {
        let points = vec2(size[0] as f32, size[1] as f32) / pixels_per_point;
        let mut output = None;
        // Layout settles over a few passes, as in a window.
        for pass in 0..4 {
            let mut input = RawInput {
                screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), points)),
                time: Some(f64::from(pass) / 60.0),
                max_texture_side: Some(self.gpu.device.limits().max_texture_dimension_2d as usize),
                ..RawInput::default()
            };
            let viewport = input.viewports.entry(egui::ViewportId::ROOT).or_default();
            viewport.native_pixels_per_point = Some(pixels_per_point);
            let mut new = self.ctx.run_ui(input, &mut draw);
            self.update_textures(&mut new.textures_delta);
            output = Some(new);
        }
        let Some(output) = output else { return Err(failed("nothing was drawn")) };
        let triangles = self.ctx.tessellate(output.shapes, pixels_per_point);
        self.paint(size, pixels_per_point, &triangles)
    }

    fn update_textures(&self, delta: &mut egui::TexturesDelta) {
        let mut renderer = self.renderer.write();
        for (id, images) in delta.set.drain() {
            for image in images {
                renderer.update_texture(&self.gpu.device, &self.gpu.queue, id, &image);
            }
        }
        for id in delta.free.drain() {
            renderer.free_texture(&id);
        }
    }

    fn paint(
        &self,
        size: [u32; 2],
        pixels_per_point: f32,
        triangles: &[egui::ClippedPrimitive],
    ) -> Result<Vec<u8>, RenderError> {
        let Gpu { device, queue, .. } = &self.gpu;
        let extent = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
        let target = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("Offscreen::target"),
            size: extent,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let screen = ScreenDescriptor { size_in_pixels: size, pixels_per_point };
        let mut encoder = device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("Offscreen::encoder") });
        let mut renderer = self.renderer.write();
        let uploads = renderer.update_buffers(device, queue, &mut encoder, triangles, &screen);
        {
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("Offscreen::pass"),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &view,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            store: wgpu::StoreOp::Store,
                        },
                        depth_slice: None,
                    })],
                    ..wgpu::RenderPassDescriptor::default()
                })
                .forget_lifetime();
            renderer.render(&mut pass, triangles, &screen);
        }
        let row = (size[0] * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("Offscreen::readback"),
            size: u64::from(row) * u64::from(size[1]),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            target.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            extent,
        );
        queue.submit(uploads.into_iter().chain([encoder.finish()]));
        let slice = buffer.slice(..);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        device
            .poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(TIMEOUT) })
            .map_err(|e| failed(format!("it did not finish: {e}")))?;
        let mapped =
            slice.get_mapped_range().map_err(|e| failed(format!("the picture can't be read back: {e}")))?;
        Ok(mapped
            .chunks_exact(row as usize)
            .flat_map(|line| line[..size[0] as usize * 4].chunks_exact(4))
            .flat_map(|p| [p[0], p[1], p[2], 255])
            .collect())
    }
}
