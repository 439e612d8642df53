//! An image and its transfer function on the device: values once per image, tables once per transfer function.

use std::sync::Arc;

use super::{
    ImageLook,
    tables::Tables,
    transfer::TransferFunction,
    uniforms::{self, Context, FieldShape},
    volume::{BRICK, ContextVolume, Field},
};
use crate::device::{Gpu, RenderError};

/// First and last coordinate of the brick at `place` along an axis, in voxel-centre coordinates: its cells between voxel
/// centres, and half a voxel more on both sides for the image's edge.
pub(crate) fn brick_span_voxels(place: usize) -> [f64; 2] {
    let first = (place * BRICK) as f64;
    [first - 0.5, first + BRICK as f64 + 0.5]
}

/// An image's values as lib/image reads them.
pub(crate) struct Uploaded {
    volume: Arc<ContextVolume>,
    pub(crate) shape: FieldShape,
    /// Smallest and largest stored value of each brick.
    pub(crate) ranges: Vec<[f32; 2]>,
    pub(crate) values: wgpu::Buffer,
}

/// Buffers of an image and its transfer function.
pub(crate) struct ImageBuffers {
    uploaded: Uploaded,
    transfer: Arc<TransferFunction>,
    tables: Tables,
    visible: wgpu::Buffer,
    table: wgpu::Buffer,
    factors: wgpu::Buffer,
}

impl ImageBuffers {
    /// The buffers of `volume` and `transfer`: the held ones where they belong to these, else new ones.
    ///
    /// # Errors
    /// [`RenderError::Volume`] for an image that doesn't fit at an eighth of its resolution;
    /// [`RenderError::Device`] with the driver's message. Nothing is held then.
    pub fn reuse<'a>(
        held: &'a mut Option<Self>,
        gpu: &Gpu,
        volume: &Arc<ContextVolume>,
        transfer: &Arc<TransferFunction>,
    ) -> Result<&'a Self, RenderError> {
        // The previous image may be large: freed before the next is uploaded.
        let reusable = held.take().filter(|image| Arc::ptr_eq(&image.uploaded.volume, volume));
        let image = match reusable {
            Some(image) if Arc::ptr_eq(&image.transfer, transfer) || image.transfer == *transfer => image,
            Some(image) => Self::with_transfer(gpu, image.uploaded, transfer),
            None => Self::with_transfer(gpu, upload(gpu, volume)?, transfer),
        };
        Ok(held.insert(image))
    }

    fn with_transfer(gpu: &Gpu, uploaded: Uploaded, transfer: &Arc<TransferFunction>) -> Self {
        let tables = Tables::of(transfer, uploaded.volume.scale(), &uploaded.ranges);
        Self {
            transfer: Arc::clone(transfer),
            visible: gpu.storage("ImageBuffers::visible", bytemuck::cast_slice(&tables.visible)),
            table: gpu.storage("ImageBuffers::table", bytemuck::cast_slice(&tables.colors)),
            factors: gpu.storage("ImageBuffers::factors", bytemuck::cast_slice(&tables.factors)),
            tables,
            uploaded,
        }
    }

    /// Grid and bricks of the values.
    pub fn shape(&self) -> &FieldShape {
        &self.uploaded.shape
    }

    /// Smallest and largest stored value of each brick.
    pub fn ranges(&self) -> &[[f32; 2]] {
        &self.uploaded.ranges
    }

    /// The transfer function as tables.
    pub fn tables(&self) -> &Tables {
        &self.tables
    }

    /// A bit per brick: whether anything in it is visible.
    pub fn visible_bits(&self) -> &[u32] {
        &self.tables.visible
    }

    /// Visible bricks, in the order of their bits.
    pub fn visible_bricks(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [x, y, z] = self.uploaded.shape.brick_dims;
        let is_visible =
            |b: &usize| self.tables.visible.get(b / 32).is_some_and(|word| word >> (b % 32) & 1 == 1);
        (0..x * y * z).filter(is_visible).map(move |b| [b % x, b / x % y, b / x / y])
    }

    /// Warning where the image is drawn at reduced resolution.
    pub fn warning(&self) -> Option<String> {
        self.uploaded.shape.warning(&self.uploaded.volume)
    }

    /// The ray march's uniform.
    pub fn uniform(&self, look: &ImageLook<'_>) -> Context {
        uniforms::context(look, &self.uploaded.volume, &self.uploaded.shape, &self.tables)
    }

    /// Values of all voxels.
    pub fn values(&self) -> &wgpu::Buffer {
        &self.uploaded.values
    }

    /// A bit per brick: whether anything in it is visible.
    pub fn visible(&self) -> &wgpu::Buffer {
        &self.visible
    }

    /// Colours and opacities by value, or by value and gradient magnitude.
    pub fn table(&self) -> &wgpu::Buffer {
        &self.table
    }

    /// Factors of the opacity by gradient magnitude.
    pub fn factors(&self) -> &wgpu::Buffer {
        &self.factors
    }
}

/// Uploads an image.
///
/// # Errors
/// [`RenderError::Volume`] for an image that doesn't fit at an eighth of its resolution;
/// [`RenderError::Device`] with the driver's message.
pub(crate) fn upload(gpu: &Gpu, volume: &Arc<ContextVolume>) -> Result<Uploaded, RenderError> {
    let limit = gpu.storage_limit();
    let Some(field) = Field::fitting(volume, limit) else {
        return Err(RenderError::Volume { found: volume.grid().voxel_count() as u64 * 4, limit });
    };
    let values = gpu.storage("Uploaded::values", bytemuck::cast_slice(&field.values));
    gpu.check()?;
    Ok(Uploaded { volume: Arc::clone(volume), shape: FieldShape::of(&field), ranges: field.ranges(), values })
}
