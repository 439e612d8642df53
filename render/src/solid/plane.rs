//! A [`SlicePlane`] on the device.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::optics::Camera;

use super::view::{View, in_camera_space};
use crate::{
    device::{Gpu, RenderError},
    scene::SlicePlane,
};

/// `HAS_PLANE` of lib/view.wgsl.
pub(crate) const HAS_PLANE: u32 = 256;

/// `Plane` of lib/plane.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct PlaneUniform {
    pub corner: [f32; 3],
    pub opacity: f32,
    pub to_u: [f32; 3],
    pub width: u32,
    pub to_v: [f32; 3],
    pub height: u32,
    pub normal: [f32; 3],
    pub unused: u32,
}

fn uniform_of(plane: &SlicePlane, camera: &Camera, reference_mm: f64) -> PlaneUniform {
    let [right, up, back] = camera.axes();
    let in_camera_axes = |v: DVec3| DVec3::new(v.dot(right), v.dot(up), -v.dot(back));
    let (u, v) = (in_camera_axes(plane.right_mm), in_camera_axes(plane.down_mm));
    let normal = u.cross(v);
    // The dual basis: also correct where the sides are not perpendicular.
    let area2 = normal.length_squared();
    let single = |v: DVec3| v.as_vec3().to_array();
    PlaneUniform {
        corner: single(in_camera_space(camera, reference_mm, plane.corner_mm)),
        opacity: plane.opacity.clamp(0.0, 1.0) as f32,
        to_u: single(v.cross(normal) / area2),
        width: plane.size_px[0],
        to_v: single(normal.cross(u) / area2),
        height: plane.size_px[1],
        normal: single(normal / area2.sqrt()),
        unused: 0,
    }
}

/// The slice on the device: its position written once per frame, its texels once per `Arc`.
pub(crate) struct PlaneBuffers {
    uniform: wgpu::Buffer,
    texels: wgpu::Buffer,
    uploaded: Option<Arc<Vec<u8>>>,
}

impl PlaneBuffers {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            uniform: gpu.uniform::<PlaneUniform>("PlaneBuffers::uniform"),
            texels: texels_of(gpu, &[0; 4]),
            uploaded: None,
        }
    }

    /// Writes what this frame needs, and sets the flag in `view`. Without a slice, or with opacity 0, nothing is
    /// written and the flag isn't set.
    ///
    /// # Errors
    /// [`RenderError`] for an invalid slice, or one too large for the device.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        plane: Option<&SlicePlane>,
        camera: &Camera,
        reference_mm: f64,
        view: &mut View,
    ) -> Result<(), RenderError> {
        let Some(plane) = plane else {
            self.release(gpu);
            return Ok(());
        };
        plane.check()?;
        if !plane.shows() {
            return Ok(());
        }
        if !self.uploaded.as_ref().is_some_and(|u| Arc::ptr_eq(u, &plane.rgba)) {
            gpu.check_size("a slice", plane.rgba.len() as u64)?;
            self.texels = texels_of(gpu, &plane.rgba);
            self.uploaded = Some(Arc::clone(&plane.rgba));
        }
        let uniform = uniform_of(plane, camera, reference_mm);
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        view.flags |= HAS_PLANE;
        Ok(())
    }

    fn release(&mut self, gpu: &Gpu) {
        if self.uploaded.take().is_some() {
            self.texels = texels_of(gpu, &[0; 4]);
        }
    }

    /// Bindings of lib/plane.
    pub fn entries(&self) -> [(u32, wgpu::BindingResource<'_>); 2] {
        [(13, self.uniform.as_entire_binding()), (14, self.texels.as_entire_binding())]
    }
}

fn texels_of(gpu: &Gpu, rgba: &[u8]) -> wgpu::Buffer {
    gpu.storage("PlaneBuffers::texels", rgba)
}
