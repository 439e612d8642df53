//! Render targets of a raster pass. It writes no colours but two or four integers per sample, which a later pass shades.

use super::{
    error::RenderError,
    gpu::Gpu,
    pipelines::{DEPTH_FORMAT, LOCATED_FORMAT, PICTURE_FORMAT},
};

/// Targets with `samples` squared samples per pixel; one texel where nothing is drawn.
#[derive(Clone, Debug)]
pub(crate) struct RasterTargets {
    pub samples: u32,
    pub picture: wgpu::TextureView,
    pub depths: wgpu::TextureView,
    /// Size in pixels; `None` where nothing is drawn.
    size: Option<[u32; 2]>,
}

impl RasterTargets {
    /// The held targets if they have `size` (`None`: nothing is drawn), else new ones. `most_samples` along each
    /// side of a pixel, or one where the device supports no texture of that size; with `located` (always the same of
    /// those held), the picture has four integers per sample.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn reuse(
        held: &mut Option<Self>,
        gpu: &Gpu,
        size: Option<[u32; 2]>,
        (most_samples, located): (u32, bool),
    ) -> Result<Self, RenderError> {
        let targets = match held.take().filter(|h| h.size == size) {
            Some(targets) => targets,
            None => Self::new(gpu, size, most_samples, located)?,
        };
        Ok(held.insert(targets).clone())
    }

    fn new(gpu: &Gpu, size: Option<[u32; 2]>, most_samples: u32, located: bool) -> Result<Self, RenderError> {
        let [width, height] = size.unwrap_or([1; 2]);
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let fits = size.is_some() && width.max(height) <= largest / most_samples;
        let samples = if fits { most_samples } else { 1 };
        let view = |label, format, usage| {
            gpu.device
                .create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: wgpu::Extent3d {
                        width: width * samples,
                        height: height * samples,
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                    view_formats: &[],
                })
                .create_view(&wgpu::TextureViewDescriptor::default())
        };
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let picture_format = if located { LOCATED_FORMAT } else { PICTURE_FORMAT };
        let targets = Self {
            samples,
            picture: view("RasterTargets::picture", picture_format, read),
            depths: view("RasterTargets::depths", DEPTH_FORMAT, wgpu::TextureUsages::empty()),
            size,
        };
        gpu.check()?;
        Ok(targets)
    }
}
