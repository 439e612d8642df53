//! Pipelines of shader files, and bind group layouts.

use super::{error::RenderError, gpu::Gpu};

/// Format of a raster pass's colour target: two integers per sample, which a later pass shades.
pub(crate) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
/// Its format where the shader's constant `located` is true: four integers per sample.
pub(crate) const LOCATED_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
/// Format of its depth buffer.
pub(crate) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The composed shader file `name`.
///
/// # Errors
/// [`RenderError::Shader`] for a file that doesn't compose.
pub(crate) fn shader_module(gpu: &Gpu, name: &str) -> Result<wgpu::ShaderModule, RenderError> {
    let source = glioscope_shaders::compose(name)?;
    Ok(gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    }))
}

/// A compute pipeline of entry point `main` of a shader file, with one bind group: of `layout`, or derived from the
/// shader.
///
/// # Errors
/// [`RenderError::Shader`] for a file that doesn't compose. Errors of the driver are reported by [`Gpu::check`].
pub(crate) fn compute_pipeline(
    gpu: &Gpu,
    name: &str,
    layout: Option<&wgpu::BindGroupLayout>,
    constants: &[(&str, f64)],
) -> Result<wgpu::ComputePipeline, RenderError> {
    let module = shader_module(gpu, name)?;
    let layout = layout.map(|layout| {
        gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(layout)],
            immediate_size: 0,
        })
    });
    Ok(gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(name),
        layout: layout.as_ref(),
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants,
            // Workgroup memory is written before it is read.
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    }))
}

/// Compute pipelines of several kinds, each compiled when it is first needed.
pub(crate) struct Pipelines<K>(Vec<(K, wgpu::ComputePipeline)>);

impl<K> Default for Pipelines<K> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq> Pipelines<K> {
    /// The pipeline of a kind, made by `compile` if it isn't known yet.
    ///
    /// # Errors
    /// That of `compile`, and the driver's ([`Gpu::check`]); nothing is kept then.
    pub fn get(
        &mut self,
        gpu: &Gpu,
        kind: K,
        compile: impl FnOnce(&K) -> Result<wgpu::ComputePipeline, RenderError>,
    ) -> Result<wgpu::ComputePipeline, RenderError> {
        if let Some((_, known)) = self.0.iter().find(|(known, _)| *known == kind) {
            return Ok(known.clone());
        }
        let pipeline = compile(&kind)?;
        gpu.check()?;
        self.0.push((kind, pipeline.clone()));
        Ok(pipeline)
    }
}

/// A raster pass's shader file, and what its pipeline is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RasterShader {
    pub file: &'static str,
    /// Culls triangles whose corners appear anticlockwise.
    pub one_sided: bool,
    /// Sets the constant `located`; the picture then has [`LOCATED_FORMAT`].
    pub located: bool,
}

/// A raster pipeline, whose entry points are `main` (vertices) and `shade` (fragments).
///
/// # Errors
/// [`RenderError::Shader`] for a file that doesn't compose.
pub(crate) fn raster_pipeline(gpu: &Gpu, shader: RasterShader) -> Result<wgpu::RenderPipeline, RenderError> {
    let RasterShader { file: name, one_sided, located } = shader;
    let module = shader_module(gpu, name)?;
    let constants: &[(&str, f64)] = if located { &[("located", 1.0)] } else { &[] };
    let options =
        || wgpu::PipelineCompilationOptions { constants, ..wgpu::PipelineCompilationOptions::default() };
    let format = if located { LOCATED_FORMAT } else { PICTURE_FORMAT };
    Ok(gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(name),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("main"),
            compilation_options: options(),
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
            compilation_options: options(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    }))
}

/// Kind of a binding, for [`bind_group_layout`].
#[derive(Clone, Copy)]
pub(crate) enum BindingKind {
    Uniform,
    /// A uniform of this many bytes, at a dynamic offset per dispatch.
    UniformAtOffset(u64),
    Read,
    Write,
}

/// A layout of buffers with these binding numbers and kinds, for compute passes.
pub(crate) fn bind_group_layout(
    gpu: &Gpu,
    label: &'static str,
    kinds: &[(u32, BindingKind)],
) -> wgpu::BindGroupLayout {
    let entries: Vec<wgpu::BindGroupLayoutEntry> = kinds
        .iter()
        .map(|(binding, kind)| wgpu::BindGroupLayoutEntry {
            binding: *binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match kind {
                    BindingKind::Uniform | BindingKind::UniformAtOffset(_) => {
                        wgpu::BufferBindingType::Uniform
                    }
                    BindingKind::Read => wgpu::BufferBindingType::Storage { read_only: true },
                    BindingKind::Write => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: matches!(kind, BindingKind::UniformAtOffset(_)),
                min_binding_size: match kind {
                    BindingKind::UniformAtOffset(size) => wgpu::BufferSize::new(*size),
                    _ => None,
                },
            },
            count: None,
        })
        .collect();
    gpu.device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}
