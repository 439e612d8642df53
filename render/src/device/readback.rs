//! Readback from the device to the host. Each call waits for all submitted work.

use super::{error::RenderError, gpu::Gpu};

/// How long the map callback may take once the device has finished its work.
const MAP_TIMEOUT: std::time::Duration = std::time::Duration::from_secs(30);

/// Usages of a staging buffer.
const STAGING: wgpu::BufferUsages = wgpu::BufferUsages::COPY_DST.union(wgpu::BufferUsages::MAP_READ);

impl Gpu {
    /// Contents of each part, given as buffer (with `COPY_SRC`), offset and size in bytes, both multiples of 4.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub(crate) fn read_buffers(
        &self,
        parts: &[(&wgpu::Buffer, u64, u64)],
    ) -> Result<Vec<Vec<u8>>, RenderError> {
        let total: u64 = parts.iter().map(|p| p.2).sum();
        let staging = self.buffer("Gpu::staging", total, STAGING);
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("Gpu::read_buffers") });
        let mut to = 0;
        for (buffer, offset, size) in parts {
            encoder.copy_buffer_to_buffer(buffer, *offset, &staging, to, *size);
            to += size;
        }
        self.queue.submit([encoder.finish()]);
        let all = self.map(&staging)?;
        let mut from = 0;
        Ok(parts
            .iter()
            .map(|part| {
                let until = from + part.2 as usize;
                let out = all.get(from..until).unwrap_or_default().to_vec();
                from = until;
                out
            })
            .collect())
    }

    /// Contents of a mappable buffer after all submitted work.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub(crate) fn map(&self, staging: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
        let (sender, receiver) = std::sync::mpsc::channel();
        staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // The receiver waits below; it is gone only after an error.
            let _ = sender.send(result);
        });
        self.wait()?;
        // Where several threads wait for the device, another one may still be about to run this callback.
        match receiver.recv_timeout(MAP_TIMEOUT) {
            Ok(Ok(())) => {
                let view = staging.slice(..).get_mapped_range();
                let bytes = view.map(|view| view.to_vec()).map_err(|e| RenderError::Device(e.to_string()));
                staging.unmap();
                bytes
            }
            Ok(Err(e)) => Err(self.failure(e.to_string())),
            Err(_) => Err(self.failure("it did not answer".to_owned())),
        }
    }

    /// The device's own error, else `text`.
    fn failure(&self, text: String) -> RenderError {
        self.check().err().unwrap_or(RenderError::Device(text))
    }

    /// All pixels of an rgba8 texture with `COPY_SRC`, row after row from the top, 4 bytes each.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn read_rgba(&self, color: &wgpu::Texture) -> Result<Vec<u8>, RenderError> {
        let (width, height) = (color.width(), color.height());
        let row_bytes = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let staging = self.buffer("Gpu::staging", u64::from(row_bytes) * u64::from(height), STAGING);
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("Gpu::read_rgba") });
        encoder.copy_texture_to_buffer(
            color.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &staging,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        self.queue.submit([encoder.finish()]);
        let padded = self.map(&staging)?;
        Ok(padded
            .chunks_exact(row_bytes as usize)
            .flat_map(|row| &row[..width as usize * 4])
            .copied()
            .collect())
    }
}
