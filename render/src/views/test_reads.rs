//! Readback of whole targets of a frame, for tests.

use super::view3d::{Frame, View3d};
use crate::{device::Gpu, image::uniforms::Marched, solid::view::OutsideHit};

impl<V: View3d> Frame<V> {
    fn read<T: bytemuck::Pod>(&self, gpu: &Gpu, buffer: &wgpu::Buffer) -> Vec<T> {
        let pixels = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let bytes = pixels * size_of::<T>() as u64;
        bytemuck::pod_collect_to_vec(&gpu.read_buffers(&[(buffer, 0, bytes)]).unwrap()[0])
    }

    /// Depths of first hits, relative to the reference plane; `FAR` on the background.
    pub(crate) fn read_depths(&self, gpu: &Gpu) -> Vec<f32> {
        self.read(gpu, &self.targets.depths)
    }

    /// First hits: region number and face, or number of the fibre or arrow.
    pub(crate) fn read_surfaces(&self, gpu: &Gpu) -> Vec<[u32; 2]> {
        self.read(gpu, &self.targets.surfaces)
    }

    /// Depths and surfaces of first hits.
    pub(crate) fn read_surface(&self, gpu: &Gpu) -> (Vec<f32>, Vec<[u32; 2]>) {
        (self.read_depths(gpu), self.read_surfaces(gpu))
    }

    /// First hits of the closeup's outer level.
    pub(crate) fn read_outside(&self, gpu: &Gpu) -> Vec<OutsideHit> {
        self.read(gpu, &self.targets.outsides)
    }

    /// Output of the ray march.
    pub(crate) fn read_marched(&self, gpu: &Gpu) -> Vec<Marched> {
        self.read(gpu, &self.targets.outsides)
    }

    /// Normals of first hits, see lib/normal.
    pub(crate) fn read_normals(&self, gpu: &Gpu) -> Vec<u32> {
        self.read(gpu, &self.targets.normals)
    }

    /// As [`Frame::read_blurred`], before the filter.
    pub(crate) fn read_occlusion(&self, gpu: &Gpu) -> Vec<u32> {
        self.read(gpu, &self.targets.occlusion)
    }

    /// Darkness and bleeding colour, packed.
    pub(crate) fn read_blurred(&self, gpu: &Gpu) -> Vec<u32> {
        self.read(gpu, &self.targets.blurred)
    }
}
