//! Buffers on the device: how they are made, and what fits.

use wgpu::util::DeviceExt;

use super::{error::RenderError, gpu::Gpu};

/// Storage that a pass writes and a test or a pick may read back.
pub(crate) const WRITTEN: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC);

impl Gpu {
    /// A buffer of `bytes`, zeroed.
    pub(crate) fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage,
            mapped_at_creation: false,
        })
    }

    /// A uniform buffer for a `T`, written by the queue.
    pub(crate) fn uniform<T>(&self, label: &str) -> wgpu::Buffer {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        self.buffer(label, size_of::<T>() as u64, usage)
    }

    /// A buffer with contents; not empty.
    pub(crate) fn buffer_with(
        &self,
        label: &str,
        contents: &[u8],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    }

    /// Storage that passes only read; not empty.
    pub(crate) fn storage(&self, label: &str, contents: &[u8]) -> wgpu::Buffer {
        self.buffer_with(label, contents, wgpu::BufferUsages::STORAGE)
    }

    /// Bytes of the largest storage buffer.
    pub(crate) fn storage_limit(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// The largest storage buffer's bytes, when `found` bytes of `what` fit in it.
    ///
    /// # Errors
    /// [`RenderError::Buffer`].
    pub(crate) fn check_size(&self, what: &'static str, found: u64) -> Result<u64, RenderError> {
        let limit = self.storage_limit();
        if found > limit { Err(RenderError::Buffer { what, found, limit }) } else { Ok(limit) }
    }
}

/// A storage buffer that is made anew when it is too small.
pub(crate) struct GrowingBuffer {
    what: &'static str,
    buffer: wgpu::Buffer,
}

impl GrowingBuffer {
    /// `what` it holds is named where it doesn't fit.
    pub fn new(gpu: &Gpu, what: &'static str, bytes: u64) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Self { what, buffer: gpu.buffer(what, bytes, usage) }
    }

    /// The buffer as it is now.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Makes room for `bytes`, and a quarter more where the device has it.
    ///
    /// # Errors
    /// [`RenderError::Buffer`] past the device's limit; the buffer stays as it is.
    pub fn grow(&mut self, gpu: &Gpu, bytes: u64) -> Result<(), RenderError> {
        if bytes > self.buffer.size() {
            let limit = gpu.check_size(self.what, bytes)?;
            let room = (bytes + bytes / 4).next_multiple_of(16).min(limit & !15).max(bytes);
            *self = Self::new(gpu, self.what, room);
        }
        Ok(())
    }

    /// Writes `bytes` at its begin, in a larger buffer where need be.
    ///
    /// # Errors
    /// As [`GrowingBuffer::grow`].
    pub fn write(&mut self, gpu: &Gpu, bytes: &[u8]) -> Result<(), RenderError> {
        self.grow(gpu, bytes.len() as u64)?;
        gpu.queue.write_buffer(&self.buffer, 0, bytes);
        Ok(())
    }
}
