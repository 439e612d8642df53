//! A textured rectangle in a 3D view: a slice where it lies in the patient.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use wgpu::util::DeviceExt;

use crate::{
    camera::Camera,
    gpu::Gpu,
    renderer::RenderError,
    uniforms::{View, in_camera_space},
};

/// `HAS_PLANE` of lib/view.wgsl.
pub(crate) const HAS_PLANE: u32 = 256;

/// A picture on a rectangle, blended at its depth. Two are equal when they draw the same: pictures by
/// identity.
#[derive(Clone, Debug)]
pub struct SlicePlane {
    /// Row after row, 4 bytes a texel (gamma-encoded sRGB, alpha not premultiplied).
    pub rgba: Arc<Vec<u8>>,
    /// Texels across and down.
    pub size_px: [u32; 2],
    /// The outer corner of the first texel.
    pub corner_mm: DVec3,
    /// From there along the whole first row.
    pub right_mm: DVec3,
    /// From there along the whole first column.
    pub down_mm: DVec3,
    /// 0 (not seen) to 1; multiplies the picture's own alpha.
    pub opacity: f64,
}

impl PartialEq for SlicePlane {
    fn eq(&self, other: &Self) -> bool {
        let Self { rgba, size_px, corner_mm, right_mm, down_mm, opacity } = self;
        Arc::ptr_eq(rgba, &other.rgba)
            && *size_px == other.size_px
            && *corner_mm == other.corner_mm
            && *right_mm == other.right_mm
            && *down_mm == other.down_mm
            && *opacity == other.opacity
    }
}

impl SlicePlane {
    /// Whether anything of it could be seen.
    pub(crate) fn shows(&self) -> bool {
        self.opacity > 0.0
    }

    fn check(&self) -> Result<(), RenderError> {
        let [width, height] = self.size_px.map(u64::from);
        let whole = width * height > 0 && self.rgba.len() as u64 == width * height * 4;
        let area = self.right_mm.cross(self.down_mm).length();
        let finite = self.corner_mm.is_finite() && area.is_finite() && self.opacity.is_finite();
        if whole && finite && area > 1e-9 * self.right_mm.length() * self.down_mm.length() {
            return Ok(());
        }
        Err(RenderError::Scene(format!(
            "a slice of {width}x{height} texels in {} bytes, at {}, {} across, {} down, opacity {}",
            self.rgba.len(),
            self.corner_mm,
            self.right_mm,
            self.down_mm,
            self.opacity
        )))
    }
}

/// `Plane` of lib/plane.wgsl.
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
    let turned = |v: DVec3| DVec3::new(v.dot(right), v.dot(up), -v.dot(back));
    let (u, v) = (turned(plane.right_mm), turned(plane.down_mm));
    let normal = u.cross(v);
    // The dual basis: also right where the sides are not square to each other.
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

/// The slice on the card: its place once a frame, its picture once an `Arc`.
pub(crate) struct PlaneBuffers {
    uniform: wgpu::Buffer,
    texels: wgpu::Buffer,
    uploaded: Option<Arc<Vec<u8>>>,
}

impl PlaneBuffers {
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            uniform: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("PlaneBuffers::uniform"),
                size: size_of::<PlaneUniform>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            texels: texels_of(gpu, &[0; 4]),
            uploaded: None,
        }
    }

    /// Writes what this frame needs, and the flag into `view`. A slice that is not there, or has no
    /// opacity, costs nothing and leaves the flag out.
    ///
    /// # Errors
    /// [`RenderError`] for a slice that is not one, or is too large for the device.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        plane: Option<&SlicePlane>,
        camera: &Camera,
        reference_mm: f64,
        view: &mut View,
    ) -> Result<(), RenderError> {
        let Some(plane) = plane else {
            self.let_go(gpu);
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

    fn let_go(&mut self, gpu: &Gpu) {
        if self.uploaded.take().is_some() {
            self.texels = texels_of(gpu, &[0; 4]);
        }
    }

    /// Bindings of lib/plane.wgsl.
    pub fn entries(&self) -> [(u32, wgpu::BindingResource<'_>); 2] {
        [(13, self.uniform.as_entire_binding()), (14, self.texels.as_entire_binding())]
    }
}

fn texels_of(gpu: &Gpu, rgba: &[u8]) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("PlaneBuffers::texels"),
        contents: rgba,
        usage: wgpu::BufferUsages::STORAGE,
    })
}
