//! The interface painted on the CPU, where the graphics adapter is software: its driver takes ten to a hundred times as
//! long for the same pixels, and paints the whole window for every frame. A plugin takes egui's shapes, paints the
//! tiles that changed, and leaves egui's renderer one picture to show.

mod canvas;
mod texture;
mod triangle;

#[cfg(test)]
mod tests;

use std::sync::Arc;

use egui::{
    Context, FullOutput, Plugin, Rect, Shape, TextureId, epaint::ClippedShape, mutex::Mutex, pos2, vec2,
};
use egui_wgpu::CallbackTrait;
use glioscope_render::Gpu;

use canvas::{Canvas, Textures};
use texture::Texture;

const SHADER: &str = "
@group(0) @binding(0) var canvas: texture_2d<f32>;

@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    let corner = vec2f(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4f(2.0 * corner - 1.0, 0.0, 1.0);
}

@fragment
fn pixel(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return textureLoad(canvas, vec2i(at.xy), 0);
}
";

/// Pixels of a texture: RGBA, row by row, and its width and height.
type Picture = (TextureId, [u32; 2], Vec<u8>);

/// Hands the pictures of 3D views, which are on the graphics device, to the painter.
#[derive(Clone, Default)]
pub struct ViewPictures(Arc<Mutex<Vec<Picture>>>);

impl ViewPictures {
    /// Sets the pixels of a texture: RGBA, row by row.
    pub fn set(&self, id: TextureId, size: [u32; 2], rgba: Vec<u8>) {
        self.0.lock().push((id, size, rgba));
    }
}

/// Paints `ctx` on the CPU from now on, for a window of this format on `gpu`; and without animations, whose frames
/// would delay the answer to the next event.
pub fn install(ctx: &Context, gpu: &Gpu, format: wgpu::TextureFormat) -> ViewPictures {
    let pictures = ViewPictures::default();
    ctx.all_styles_mut(|style| {
        style.animation_time = 0.0;
        style.scroll_animation = egui::style::ScrollAnimation::none();
    });
    ctx.add_plugin(Painter {
        gpu: gpu.clone(),
        pipeline: pipeline(&gpu.device, format),
        srgb: format.is_srgb(),
        pictures: pictures.clone(),
        textures: Textures::new(),
        unused: Vec::new(),
        canvas: Canvas::default(),
        shown: None,
    });
    pictures
}

/// Paints each frame's shapes and replaces them by the picture.
struct Painter {
    gpu: Gpu,
    pipeline: wgpu::RenderPipeline,
    /// Whether the window's format encodes what is written to it.
    srgb: bool,
    pictures: ViewPictures,
    textures: Textures,
    /// Textures that egui freed, also in passes that it discarded: removed after the next picture, which may show them.
    unused: Vec<TextureId>,
    canvas: Canvas,
    /// The canvas on the device.
    shown: Option<(wgpu::Texture, Shown)>,
}

impl Plugin for Painter {
    fn debug_name(&self) -> &'static str {
        "painter on the CPU"
    }

    fn output_hook(&mut self, ctx: &Context, output: &mut FullOutput) {
        self.update_textures(&mut output.textures_delta);
        let passes = &output.platform_output;
        let will_be_replaced = passes.requested_discard()
            && passes.num_completed_passes < ctx.options(|options| options.max_passes.get());
        self.unused.extend(output.textures_delta.free.iter().copied());
        if will_be_replaced {
            return;
        }
        let pixels_per_point = output.pixels_per_point;
        let screen = ctx.viewport_rect();
        let primitives = ctx.tessellate(std::mem::take(&mut output.shapes), pixels_per_point);
        let size = (screen.size() * pixels_per_point).round();
        // At most what a texture may be wide and high.
        let size = [size.x, size.y].map(|v| (v as usize).clamp(1, 16_384));
        let painted = self.canvas.paint(size, &primitives, pixels_per_point, &self.textures);
        for id in self.unused.drain(..) {
            self.textures.remove(&id);
        }
        let shown = self.upload(&painted);
        let points = vec2(size[0] as f32, size[1] as f32) / pixels_per_point;
        let rect = Rect::from_min_size(pos2(0.0, 0.0), points);
        let shape = Shape::Callback(egui_wgpu::Callback::new_paint_callback(rect, shown));
        output.shapes = vec![ClippedShape {
            clip_rect: rect,
            shape,
            transform_after_tessellation: egui::emath::TSTransform::IDENTITY,
        }];
    }
}

impl Painter {
    /// Takes egui's changes of textures, which its own renderer then need not carry out, and those of 3D views.
    fn update_textures(&mut self, delta: &mut egui::TexturesDelta) {
        for (id, changes) in delta.set.drain() {
            for change in changes {
                match Texture::changed(self.textures.remove(&id), &change) {
                    Some(texture) => drop(self.textures.insert(id, texture)),
                    None => log::error!("egui's change of texture {id:?} doesn't fit it"),
                }
            }
        }
        for (id, size, rgba) in self.pictures.0.lock().drain(..) {
            let version = self.textures.get(&id).map_or(0, |texture| texture.version + 1);
            if let Some(texture) = Texture::from_rgba(size.map(|v| v as usize), &rgba, version) {
                self.textures.insert(id, texture);
            }
        }
    }

    /// Writes what was painted to the device.
    fn upload(&mut self, painted: &[canvas::Painted]) -> Shown {
        let size = self.canvas.size().map(|v| v as u32);
        let (texture, shown) = match self.shown.take() {
            Some(shown) if [shown.0.width(), shown.0.height()] == size => shown,
            _ => self.texture(size),
        };
        for part in painted {
            let start = part.at[1] * size[0] as usize + part.at[0];
            self.gpu.queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture: &texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: part.at[0] as u32, y: part.at[1] as u32, z: 0 },
                    aspect: wgpu::TextureAspect::All,
                },
                self.canvas.pixels()[start..].as_flattened(),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(4 * size[0]),
                    rows_per_image: None,
                },
                wgpu::Extent3d {
                    width: part.size[0] as u32,
                    height: part.size[1] as u32,
                    depth_or_array_layers: 1,
                },
            );
        }
        self.shown = Some((texture, shown.clone()));
        shown
    }

    fn texture(&self, [width, height]: [u32; 2]) -> (wgpu::Texture, Shown) {
        let format =
            if self.srgb { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
        let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("Painter::texture"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let bind_group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("Painter::bind_group"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&view),
            }],
        });
        (texture, Shown { pipeline: self.pipeline.clone(), bind_group })
    }
}

/// Shows the canvas in egui's render pass.
#[derive(Clone)]
struct Shown {
    pipeline: wgpu::RenderPipeline,
    bind_group: wgpu::BindGroup,
}

impl CallbackTrait for Shown {
    fn paint(
        &self,
        _: egui::PaintCallbackInfo,
        pass: &mut wgpu::RenderPass<'static>,
        _: &egui_wgpu::CallbackResources,
    ) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.draw(0..3, 0..1);
    }
}

fn pipeline(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("Painter::shader"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("Painter::pipeline"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
