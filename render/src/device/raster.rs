//! The picture and the depths that a raster pass draws onto. What is written is not a colour but what a later pass
//! makes one of: two numbers a sample.

use super::{
    error::RenderError,
    gpu::Gpu,
    pipelines::{DEPTH_FORMAT, PICTURE_FORMAT},
};

/// The picture, `samples` squared of them a pixel; one texel where nothing is drawn.
#[derive(Clone, Debug)]
pub(crate) struct RasterTargets {
    pub samples: u32,
    pub picture: wgpu::TextureView,
    pub depths: wgpu::TextureView,
    drawn: Option<[u32; 2]>,
}

impl RasterTargets {
    /// Those held, when they are of `size` (`None`: nothing is drawn), else new ones. At most
    /// `most_samples` along each side of a pixel, fewer where the device takes no such picture.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn reuse(
        held: &mut Option<Self>,
        gpu: &Gpu,
        size: Option<[u32; 2]>,
        most_samples: u32,
    ) -> Result<Self, RenderError> {
        let made = match held.take().filter(|h| h.drawn == size) {
            Some(targets) => targets,
            None => Self::new(gpu, size, most_samples)?,
        };
        Ok(held.insert(made).clone())
    }

    fn new(gpu: &Gpu, drawn: Option<[u32; 2]>, most_samples: u32) -> Result<Self, RenderError> {
        let [width, height] = drawn.unwrap_or([1; 2]);
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let fits = drawn.is_some() && width.max(height) <= largest / most_samples;
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
        let made = Self {
            samples,
            picture: view("RasterTargets::picture", PICTURE_FORMAT, read),
            depths: view("RasterTargets::depths", DEPTH_FORMAT, wgpu::TextureUsages::empty()),
            drawn,
        };
        gpu.check()?;
        Ok(made)
    }
}
