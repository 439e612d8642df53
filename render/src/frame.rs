//! A drawn picture, and what is under each pixel.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use glioscope_core::RegionVolume;

use crate::{
    camera::Camera,
    gpu::Gpu,
    plan::{PassName, Plan},
    renderer::RenderError,
    scene::Lens,
    targets::Targets,
    uniforms::{FAR, OutsideHit},
};

/// What is under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// The region's index bits: bit k set for mask k.
    pub bits: u32,
    /// The point on the voxel's face that the pixel shows, RAS+ millimetres.
    pub world_mm: DVec3,
    /// Whether the selection holds there: in the lens, or anywhere when it is off. Else it is
    /// faint outer tissue.
    pub inside_lens: bool,
}

/// A finished picture. Its textures are reused by the next picture of the same size.
#[derive(Clone, Debug)]
pub struct Frame {
    /// rgba8unorm, gamma-encoded sRGB, opaque. Usable as an egui texture.
    pub color: wgpu::Texture,
    /// Pixels drawn: the size of `color`. At most `asked_px`, see `Quality::resolution_scale`.
    pub size_px: [u32; 2],
    /// Pixels asked for: what [`Frame::pick`] counts in.
    pub asked_px: [u32; 2],
    /// What ran, and what was left out.
    pub plan: Plan,
    pub(crate) targets: Targets,
    pub(crate) tumor: Option<Arc<RegionVolume>>,
    pub(crate) camera: Camera,
    pub(crate) lens: Option<Lens>,
    pub(crate) reference_mm: f64,
}

/// What [`Frame::occlusion`] reads.
#[derive(Debug, Default)]
pub(crate) struct Occluded {
    pub depths: Vec<f32>,
    pub blurred: Vec<f64>,
}

impl Frame {
    #[cfg(test)]
    pub(crate) fn read_blurred(&self, gpu: &Gpu) -> Vec<u32> {
        let buffer = &self.targets.blurred;
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(buffer, 0, buffer.size())]).unwrap()[0])
    }

    /// All pixels, row after row from the top, 4 bytes each: `size_px[0] * size_px[1] * 4` bytes.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn read_rgba(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        read_rgba(gpu, &self.color)
    }

    /// What is under pixel (`x`, `y`) of the asked size, counted from the top left. `None` over the
    /// background and past the edge. Reads a few bytes back: call it as often as the mouse moves.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub fn pick(&self, gpu: &Gpu, x: u32, y: u32) -> Result<Option<Pick>, RenderError> {
        let width = self.size_px[0];
        if x >= self.asked_px[0] || y >= self.asked_px[1] {
            return Ok(None);
        }
        let [x, y] = drawn_pixel([x, y], self.asked_px, self.size_px);
        let at = u64::from(y) * u64::from(width) + u64::from(x);
        let mut parts = Vec::new();
        if self.plan.has(PassName::Surface) {
            parts.push((&self.targets.depths, at * 4, 4));
            parts.push((&self.targets.surfaces, at * 8, 8));
        }
        if self.plan.has(PassName::Outside) {
            parts.push((&self.targets.outsides, at * 16, 16));
        }
        if parts.is_empty() {
            return Ok(None);
        }
        let read = gpu.read_buffers(&parts).map_err(RenderError::Device)?;
        let mut read = read.iter();
        if self.plan.has(PassName::Surface)
            && let (Some(depth), Some(surface)) = (read.next(), read.next())
        {
            let depth: f32 = bytemuck::pod_read_unaligned(depth);
            let [number, _]: [u32; 2] = bytemuck::pod_read_unaligned(surface);
            if depth < FAR {
                return Ok(self.found([x, y], number, depth, true));
            }
        }
        if let Some(outside) = read.next() {
            let hit: OutsideHit = bytemuck::pod_read_unaligned(outside);
            if hit.depth < FAR {
                return Ok(self.found([x, y], hit.number, hit.depth, self.lens.is_none()));
            }
        }
        Ok(None)
    }

    fn found(&self, pixel: [u32; 2], number: u32, depth: f32, inside_lens: bool) -> Option<Pick> {
        let bits = *self.tumor.as_ref()?.bits_of_id().get(number as usize)?;
        Some(Pick {
            bits,
            world_mm: world_at(&self.camera, self.reference_mm, self.size_px, pixel, depth),
            inside_lens,
        })
    }

    /// Depths (from the reference plane, [`FAR`] where nothing is), and share of light that ambient
    /// occlusion takes from each pixel, blurred.
    ///
    /// # Errors
    /// [`RenderError::Device`] with what the driver says.
    pub(crate) fn occlusion(&self, gpu: &Gpu) -> Result<Occluded, RenderError> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let t = &self.targets;
        let read = gpu
            .read_buffers(&[(&t.depths, 0, n * 4), (&t.blurred, 0, n * 4)])
            .map_err(RenderError::Device)?;
        let [depths, blurred] = &read[..] else { return Ok(Occluded::default()) };
        // The last of four 8-bit channels; the others are the colour that bleeds.
        let dark = |bytes: &[u8]| bytes.chunks_exact(4).map(|p| f64::from(p[3]) / 255.0).collect();
        Ok(Occluded { depths: bytemuck::pod_collect_to_vec(depths), blurred: dark(blurred) })
    }

    /// Depths (from the reference plane, [`FAR`] where nothing is) and region numbers of all pixels.
    #[cfg(test)]
    pub(crate) fn read_surface(&self, gpu: &Gpu) -> (Vec<f32>, Vec<[u32; 2]>) {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let read = gpu
            .read_buffers(&[(&self.targets.depths, 0, n * 4), (&self.targets.surfaces, 0, n * 8)])
            .unwrap();
        (bytemuck::pod_collect_to_vec(&read[0]), bytemuck::pod_collect_to_vec(&read[1]))
    }

    /// First hits of the outer level.
    #[cfg(test)]
    pub(crate) fn read_outside(&self, gpu: &Gpu) -> Vec<OutsideHit> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let read = gpu.read_buffers(&[(&self.targets.outsides, 0, n * 16)]).unwrap();
        bytemuck::pod_collect_to_vec(&read[0])
    }
}

/// All pixels of an rgba8 texture, row after row from the top, 4 bytes each.
///
/// # Errors
/// [`RenderError::Device`] with what the driver says.
pub(crate) fn read_rgba(gpu: &Gpu, color: &wgpu::Texture) -> Result<Vec<u8>, RenderError> {
    let (width, height) = (color.width(), color.height());
    let line = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("Frame::staging"),
        size: u64::from(line) * u64::from(height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = gpu
        .device
        .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("Frame::read_rgba") });
    encoder.copy_texture_to_buffer(
        color.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(line),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    gpu.queue.submit([encoder.finish()]);
    let padded = gpu.map(&staging).map_err(RenderError::Device)?;
    Ok(padded.chunks_exact(line as usize).flat_map(|l| &l[..width as usize * 4]).copied().collect())
}

/// The drawn pixel at the middle of an asked one, which is inside `asked_px`.
pub(crate) fn drawn_pixel(pixel: [u32; 2], asked_px: [u32; 2], drawn_px: [u32; 2]) -> [u32; 2] {
    std::array::from_fn(|a| {
        let at = (f64::from(pixel[a]) + 0.5) * f64::from(drawn_px[a]) / f64::from(asked_px[a]);
        (at as u32).min(drawn_px[a] - 1)
    })
}

/// The point at `depth` (from the reference plane) under a drawn pixel, in f64 throughout.
pub(crate) fn world_at(
    camera: &Camera,
    reference_mm: f64,
    size_px: [u32; 2],
    pixel: [u32; 2],
    depth: f32,
) -> DVec3 {
    let size = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1]));
    let center = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let ray = camera.ray(center, size);
    let along = ray.direction.dot(-camera.axes()[2]);
    ray.origin_mm + ray.direction * ((reference_mm + f64::from(depth)) / along)
}
