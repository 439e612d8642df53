//! What passes that rasterise share: their pipeline, and the picture and depths that they draw onto.
//! What is written is not a colour but what a later pass makes one of: two numbers a sample.

use crate::{gpu::Gpu, renderer::RenderError};

/// Format of the picture: what, depth.
const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
/// Format of its depths.
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The pipeline of shader file `name`, whose entry points are `main` (corners) and `shade`. With
/// `one_sided`, triangles are seen from where their corners run clockwise only.
///
/// # Errors
/// [`RenderError::Shader`].
pub(crate) fn pipeline(gpu: &Gpu, name: &str, one_sided: bool) -> Result<wgpu::RenderPipeline, RenderError> {
    let source = glioscope_shaders::compose(name)?;
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    Ok(gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(name),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            front_face: wgpu::FrontFace::Cw,
            cull_mode: one_sided.then_some(wgpu::Face::Back),
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("shade"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(PICTURE_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    }))
}

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
    pub fn keep(
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
        gpu.check().map_err(RenderError::Device)?;
        Ok(made)
    }
}
