//! What the change view's own passes write: made once a size.

use crate::{gpu::Gpu, renderer::RenderError};

/// Format of the arrows' picture: what, depth.
pub(super) const ARROW_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
/// Format of its depths.
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Buffers of one picture size, row after row.
#[derive(Clone, Debug)]
pub(super) struct ChangeTargets {
    /// Number of the first hit's voxel.
    pub cells: wgpu::Buffer,
    /// Length and sureness.
    pub heights: wgpu::Buffer,
    pub across: wgpu::Buffer,
    pub filtered: wgpu::Buffer,
    pub hull_depths: wgpu::Buffer,
    pub hull_surfaces: wgpu::Buffer,
    /// Number of the arrow in front, from 1, and its depth.
    pub tops: wgpu::Buffer,
}

/// The arrows' picture, `samples` squared of them a pixel; one texel where no arrow is drawn.
#[derive(Clone, Debug)]
pub(super) struct ArrowTargets {
    pub samples: u32,
    pub picture: wgpu::TextureView,
    pub depths: wgpu::TextureView,
    drawn: Option<[u32; 2]>,
}

impl ChangeTargets {
    /// Of a size that `Targets` took.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let buffer = |label, bytes_per_pixel| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: pixels * bytes_per_pixel,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        Self {
            cells: buffer("ChangeTargets::cells", 4),
            heights: buffer("ChangeTargets::heights", 8),
            across: buffer("ChangeTargets::across", 8),
            filtered: buffer("ChangeTargets::filtered", 8),
            hull_depths: buffer("ChangeTargets::hull_depths", 4),
            hull_surfaces: buffer("ChangeTargets::hull_surfaces", 8),
            tops: buffer("ChangeTargets::tops", 8),
        }
    }
}

impl ArrowTargets {
    /// Those held, when they are of `size` (`None`: no arrow is drawn), else new ones.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn keep(held: &mut Option<Self>, gpu: &Gpu, size: Option<[u32; 2]>) -> Result<Self, RenderError> {
        let made = match held.take().filter(|h| h.drawn == size) {
            Some(targets) => targets,
            None => Self::new(gpu, size)?,
        };
        Ok(held.insert(made).clone())
    }

    fn new(gpu: &Gpu, drawn: Option<[u32; 2]>) -> Result<Self, RenderError> {
        let [width, height] = drawn.unwrap_or([1; 2]);
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let samples = if drawn.is_some() && width.max(height) <= largest / 2 { 2 } else { 1 };
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
            picture: view("ArrowTargets::picture", ARROW_FORMAT, read),
            depths: view("ArrowTargets::depths", DEPTH_FORMAT, wgpu::TextureUsages::empty()),
            drawn,
        };
        gpu.check().map_err(RenderError::Device)?;
        Ok(made)
    }
}
