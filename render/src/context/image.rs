//! An image on the card, and how it is shown: values once an image, tables once a transfer function.

use std::sync::Arc;

use glam::DVec3;
use wgpu::util::DeviceExt;

use super::{
    scene::ContextScene,
    uniforms::{self, Context, FieldShape},
    volume::{BRICK, ContextVolume, Field, Tables},
};
use crate::{
    gpu::Gpu,
    occlusion::{Sight, joined},
    plan::Plan,
    quality::Quality,
    renderer::RenderError,
    transfer::TransferFunction,
};

/// The values of an image, as context_march.wgsl reads them.
struct Uploaded {
    volume: Arc<ContextVolume>,
    shape: FieldShape,
    ranges: Vec<[f32; 2]>,
    values: wgpu::Buffer,
}

/// Buffers of an image and its transfer function.
pub(crate) struct ImageBuffers {
    up: Uploaded,
    transfer: Arc<TransferFunction>,
    tables: Tables,
    visible: wgpu::Buffer,
    table: wgpu::Buffer,
    factors: wgpu::Buffer,
}

fn storage(gpu: &Gpu, label: &str, contents: &[u8]) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents,
        usage: wgpu::BufferUsages::STORAGE,
    })
}

impl ImageBuffers {
    /// The buffers of `volume` and `transfer`: those held as far as they are theirs, else new ones.
    ///
    /// # Errors
    /// [`RenderError::Volume`] for an image that doesn't fit at an eighth of its resolution;
    /// [`RenderError::Device`] with what the driver says. Nothing is held then.
    pub fn keep<'a>(
        held: &'a mut Option<Self>,
        gpu: &Gpu,
        volume: &Arc<ContextVolume>,
        transfer: &Arc<TransferFunction>,
    ) -> Result<&'a Self, RenderError> {
        // The one before may be large: let it go first.
        let kept = held.take().filter(|image| Arc::ptr_eq(&image.up.volume, volume));
        let image = match kept {
            Some(image) if Arc::ptr_eq(&image.transfer, transfer) || image.transfer == *transfer => image,
            Some(image) => Self::shown(gpu, image.up, transfer),
            None => Self::shown(gpu, upload(gpu, volume)?, transfer),
        };
        Ok(held.insert(image))
    }

    fn shown(gpu: &Gpu, up: Uploaded, transfer: &Arc<TransferFunction>) -> Self {
        let tables = Tables::of(transfer, up.volume.scale(), &up.ranges);
        Self {
            transfer: Arc::clone(transfer),
            visible: storage(gpu, "ImageBuffers::visible", bytemuck::cast_slice(&tables.visible)),
            table: storage(gpu, "ImageBuffers::table", bytemuck::cast_slice(&tables.colors)),
            factors: storage(gpu, "ImageBuffers::factors", bytemuck::cast_slice(&tables.factors)),
            tables,
            up,
        }
    }

    /// Grid and bricks of the values.
    pub fn shape(&self) -> &FieldShape {
        &self.up.shape
    }

    /// The transfer function as tables.
    pub fn tables(&self) -> &Tables {
        &self.tables
    }

    /// A bit a brick: whether anything shows in it.
    pub fn visible_bits(&self) -> &[u32] {
        &self.tables.visible
    }

    /// Ranges of view depth (from the eye) that visible bricks reach, in order, none touching the next.
    pub fn depths_mm(&self, sight: &Sight) -> Vec<(f64, f64)> {
        let FieldShape { grid, brick_dims, .. } = &self.up.shape;
        let world = grid.world_from_voxel();
        let depths = |brick: [usize; 3]| {
            // From voxel centre to voxel centre, and half a voxel more at the image's edge.
            let first = DVec3::from_array(brick.map(|b| (b * BRICK) as f64 - 0.5));
            let middle = sight.depth_mm(world.transform_point3(first + (0.5 * BRICK as f64 + 0.5)));
            let reach: f64 = (0..3).map(|a| world.matrix3.col(a).dot(sight.forward).abs()).sum();
            let reach = reach * (0.5 * BRICK as f64 + 0.5);
            (middle + reach > 0.0).then_some(((middle - reach).max(0.0), middle + reach))
        };
        let [x, y, z] = *brick_dims;
        let is_visible =
            |b: usize| self.tables.visible.get(b / 32).is_some_and(|word| word >> (b % 32) & 1 == 1);
        let seen = (0..x * y * z).filter(|b| is_visible(*b));
        joined(seen.filter_map(|b| depths([b % x, b / x % y, b / x / y])).collect())
    }

    /// What the picture lacks of the image, if anything.
    pub fn warning(&self) -> Option<String> {
        self.up.shape.warning(&self.up.volume)
    }

    /// The march's uniform for `scene`, whose image this is.
    pub fn uniform(&self, scene: &ContextScene, quality: &Quality, plan: &Plan) -> Context {
        uniforms::context(scene, &self.up.volume, &self.up.shape, &self.tables, quality, plan)
    }

    /// Values of all voxels.
    pub fn values(&self) -> &wgpu::Buffer {
        &self.up.values
    }

    /// A bit a brick: whether anything shows in it.
    pub fn visible(&self) -> &wgpu::Buffer {
        &self.visible
    }

    /// Colours and opacities by value.
    pub fn table(&self) -> &wgpu::Buffer {
        &self.table
    }

    /// Factors of the opacity by gradient.
    pub fn factors(&self) -> &wgpu::Buffer {
        &self.factors
    }
}

fn upload(gpu: &Gpu, volume: &Arc<ContextVolume>) -> Result<Uploaded, RenderError> {
    let limits = gpu.device.limits();
    let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let Some(field) = Field::fitting(volume, limit) else {
        return Err(RenderError::Volume { found: volume.grid().voxel_count() as u64 * 4, limit });
    };
    let values = storage(gpu, "Uploaded::values", bytemuck::cast_slice(&field.values));
    gpu.check().map_err(RenderError::Device)?;
    Ok(Uploaded { volume: Arc::clone(volume), shape: FieldShape::of(&field), ranges: field.ranges(), values })
}
