//! Creation of buffers on the graphics device, and its size limits.

use wgpu::util::DeviceExt;

use super::{error::RenderError, gpu::Gpu};

/// Storage that a pass writes and a test or pick may read back.
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

    /// A buffer with contents, which must not be empty.
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

    /// Storage that passes only read; `contents` must not be empty.
    pub(crate) fn storage(&self, label: &str, contents: &[u8]) -> wgpu::Buffer {
        self.buffer_with(label, contents, wgpu::BufferUsages::STORAGE)
    }

    /// Size limit of a storage buffer in bytes.
    pub(crate) fn storage_limit(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// The size limit of a storage buffer in bytes, if `found` bytes of `what` are within it.
    ///
    /// # Errors
    /// [`RenderError::Buffer`].
    pub(crate) fn check_size(&self, what: &'static str, found: u64) -> Result<u64, RenderError> {
        let limit = self.storage_limit();
        if found > limit { Err(RenderError::Buffer { what, found, limit }) } else { Ok(limit) }
    }
}

/// The first bytes of a buffer, from which dynamic offsets count.
pub(crate) fn at_offset(buffer: &wgpu::Buffer, bytes: u64) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::Buffer(wgpu::BufferBinding {
        buffer,
        offset: 0,
        size: wgpu::BufferSize::new(bytes),
    })
}

/// A storage buffer that is reallocated when it is too small.
pub(crate) struct GrowingBuffer {
    what: &'static str,
    buffer: wgpu::Buffer,
}

impl GrowingBuffer {
    /// `what` it holds is named in the error when it doesn't fit.
    pub fn new(gpu: &Gpu, what: &'static str, bytes: u64) -> Self {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        Self { what, buffer: gpu.buffer(what, bytes, usage) }
    }

    /// The current buffer.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// Makes room for `bytes`, and a quarter more where the device allows it. Reallocation loses the contents.
    ///
    /// # Errors
    /// [`RenderError::Buffer`] past the device's limit; the buffer is then unchanged.
    pub fn grow(&mut self, gpu: &Gpu, bytes: u64) -> Result<(), RenderError> {
        if bytes > self.buffer.size() {
            let limit = gpu.check_size(self.what, bytes)?;
            let capacity = (bytes + bytes / 4).next_multiple_of(16).min(limit & !15).max(bytes);
            *self = Self::new(gpu, self.what, capacity);
        }
        Ok(())
    }

    /// Writes `bytes` at its start, in a larger buffer if necessary.
    ///
    /// # Errors
    /// As [`GrowingBuffer::grow`].
    pub fn write(&mut self, gpu: &Gpu, bytes: &[u8]) -> Result<(), RenderError> {
        self.grow(gpu, bytes.len() as u64)?;
        gpu.queue.write_buffer(&self.buffer, 0, bytes);
        Ok(())
    }
}
