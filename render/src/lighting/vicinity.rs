//! Light on what is solid: vicinity occlusion, times what slices let through.

use super::{Lighting, uniforms};
use crate::{
    compute::{PassRunner, workgroups_of},
    dos::Variant,
    gpu::Gpu,
    occlusion::{cone::clamped_aperture, poisson::poisson_disc},
    plan::PassName,
    renderer::RenderError,
};

/// What the pass reads and writes.
#[derive(Clone, Copy)]
pub(crate) struct Solid<'a> {
    pub view: &'a wgpu::Buffer,
    pub depths: &'a wgpu::Buffer,
    pub blurred: &'a wgpu::Buffer,
    pub size: [u32; 2],
}

/// Its uniform, and what is bound where no slices ran.
pub(crate) struct VicinityLight {
    uniform: wgpu::Buffer,
    no_notes: wgpu::Buffer,
    /// Points in the unit disc for a count.
    points: Option<(u32, Vec<[f64; 2]>)>,
}

impl VicinityLight {
    pub fn new(gpu: &Gpu) -> Self {
        let buffer = |label, size: usize, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        let copied = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Self {
            uniform: buffer("VicinityLight::uniform", size_of::<uniforms::Vicinity>(), copied),
            no_notes: buffer("VicinityLight::no_notes", 16, wgpu::BufferUsages::STORAGE),
            points: None,
        }
    }

    /// Binds the pass; `through` are the slices' notes where they ran.
    ///
    /// # Errors
    /// [`RenderError`] when the driver refuses the shader.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        solid: Solid<'_>,
        lighting: &Lighting,
        through: Option<&wgpu::Buffer>,
    ) -> Result<(), RenderError> {
        self.write(gpu, lighting, through.is_some());
        let entries = [
            (0, solid.view.as_entire_binding()),
            (4, solid.depths.as_entire_binding()),
            (8, solid.blurred.as_entire_binding()),
            (35, through.unwrap_or(&self.no_notes).as_entire_binding()),
            (36, self.uniform.as_entire_binding()),
        ];
        passes.bind_shader(
            gpu,
            PassName::Vicinity,
            ("solid_vicinity", &[]),
            &entries,
            workgroups_of(solid.size),
        )
    }

    /// Its uniform, for passes that find vicinity occlusion besides.
    pub fn uniform(&self) -> &wgpu::Buffer {
        &self.uniform
    }

    /// Writes the uniform; `sliced` where slices ran.
    pub fn write(&mut self, gpu: &Gpu, lighting: &Lighting, sliced: bool) {
        let data = self.data(lighting, sliced);
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&data));
    }

    fn data(&mut self, lighting: &Lighting, sliced: bool) -> uniforms::Vicinity {
        let count = lighting.vicinity_samples.clamp(1, Lighting::MOST_VICINITY);
        if self.points.as_ref().is_none_or(|(n, _)| *n != count) {
            self.points = Some((count, poisson_disc(count)));
        }
        let mut points = [[0.0; 4]; Lighting::MOST_VICINITY as usize];
        for (to, from) in points.iter_mut().zip(self.points.iter().flat_map(|(_, p)| p)) {
            *to = [from[0] as f32, from[1] as f32, 0.0, 0.0];
        }
        let mut flags = 0;
        if lighting.mutual.solid_on_solid && lighting.vicinity_radius_mm() > 0.0 {
            flags |= uniforms::VICINITY;
        }
        if lighting.mutual.image_on_solid && sliced {
            flags |= uniforms::PARTIAL;
        }
        uniforms::Vicinity {
            radius_mm: lighting.vicinity_radius_mm() as f32,
            slope: slope(lighting),
            count,
            flags,
            points,
        }
    }
}

/// Millimetres nearer to the eye a millimetre aside from which on a neighbour is in the cone. The
/// paper's own form has none: there a plane seen at a slant hides half of itself.
pub(crate) fn slope(lighting: &Lighting) -> f32 {
    let (aperture, _) = clamped_aperture(lighting.aperture_deg);
    match lighting.variant {
        Variant::Mended => (1.0 / aperture.to_radians().tan()).min(1e6) as f32,
        _ => 0.0,
    }
}
