//! A second image in a view of an image: its maximum-intensity projection over the picture.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glioscope_core::optics::Camera;

use crate::{
    device::{Gpu, PassName, RenderError},
    flat::Window,
    image::{
        buffers::{Uploaded, upload},
        uniforms::{Context, geometry, step_mm},
        volume::ContextVolume,
    },
    scene::ColorMap,
    views::view3d::Draw,
};

/// The projection of the second image.
pub(crate) const PROJECTION: PassName = PassName::new("projection");

/// A second image, of which each pixel shows the largest value along its ray, over everything else. Clipping planes don't cut it.
#[derive(Clone, Debug)]
pub struct ImageProjection {
    /// The image.
    pub volume: Arc<ContextVolume>,
    /// The values that its colours cover.
    pub window: Window,
    /// Its colours.
    pub map: ColorMap,
    /// Opacity, 0 to 1.
    pub opacity: f32,
    /// Largest values at or below it are transparent, in the image's unit.
    pub threshold: f64,
}

impl PartialEq for ImageProjection {
    fn eq(&self, other: &Self) -> bool {
        let Self { volume, window, map, opacity, threshold } = self;
        Arc::ptr_eq(volume, &other.volume)
            && (*window, *map, *opacity) == (other.window, other.map, other.opacity)
            && *threshold == other.threshold
    }
}

impl ImageProjection {
    /// Why it isn't drawn; `None` if it is.
    pub(crate) fn omitted(of: Option<&Self>) -> Option<&'static str> {
        match of {
            None => Some("no second image"),
            // NaN is transparent, too.
            Some(one) if one.opacity > 0.0 => None,
            Some(_) => Some("second image is transparent"),
        }
    }

    fn uniform(&self, step_mm: f64) -> Uniform {
        let (low, width) = self.volume.scale();
        let window = self.window.high - self.window.low;
        let window = if window > 0.0 { window } else { f64::MIN_POSITIVE };
        // Shares beyond the window are clamped: large numbers needn't be exact.
        let single = |value: f64| value.clamp(-1e30, 1e30) as f32;
        Uniform {
            step_mm: step_mm as f32,
            scale: single(width / window),
            offset: single((low - self.window.low) / window),
            threshold: single((self.threshold - low) / width),
            opacity: self.opacity.clamp(0.0, 1.0),
            ..Uniform::default()
        }
    }
}

/// See context/project.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Uniform {
    pub step_mm: f32,
    pub scale: f32,
    pub offset: f32,
    pub threshold: f32,
    pub opacity: f32,
    pub unused_a: f32,
    pub unused_b: f32,
    pub unused_c: f32,
}

/// The second image on the device.
struct Held {
    volume: Arc<ContextVolume>,
    uploaded: Uploaded,
    most: wgpu::Buffer,
}

/// Buffers of the projection; without one, a few bytes.
pub(crate) struct ProjectionPart {
    held: Option<Held>,
    context: wgpu::Buffer,
    uniform: wgpu::Buffer,
    projected: wgpu::Buffer,
    pixels: u64,
}

impl ProjectionPart {
    /// Without an image.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            held: None,
            context: gpu.uniform::<Context>("ProjectionPart::context"),
            uniform: gpu.uniform::<Uniform>("ProjectionPart::uniform"),
            projected: gpu.storage("ProjectionPart::projected", &[0; 4]),
            pixels: 1,
        }
    }

    /// Colours and opacities of all pixels, for composing.
    pub fn projected(&self) -> &wgpu::Buffer {
        &self.projected
    }

    /// Uploads the image and binds the pass, if the plan has it. Returns a warning if it is drawn at a lower resolution.
    ///
    /// # Errors
    /// [`RenderError::Volume`] for an image that doesn't fit at an eighth of its resolution; [`RenderError::Device`] with the
    /// driver's message.
    pub fn bind(
        &mut self,
        draw: &mut Draw<'_>,
        projection: Option<&ImageProjection>,
        camera: &Camera,
        reference_mm: f64,
    ) -> Result<Option<String>, RenderError> {
        let gpu = draw.gpu;
        let Some(projection) = projection.filter(|_| draw.plan.has(PROJECTION)) else {
            // The image may be large.
            self.held = None;
            return Ok(None);
        };
        // The previous image is freed before the next is uploaded.
        let held = self.held.take().filter(|held| Arc::ptr_eq(&held.volume, &projection.volume));
        let held = match held {
            Some(held) => held,
            None => {
                let uploaded = upload(gpu, &projection.volume)?;
                let most: Vec<f32> = uploaded.ranges.iter().map(|range| range[1].max(-1e30)).collect();
                let most = gpu.storage("Held::most", bytemuck::cast_slice(&most));
                Held { volume: Arc::clone(&projection.volume), uploaded, most }
            }
        };
        let held = self.held.insert(held);
        let [width, height] = draw.size().map(u64::from);
        if self.pixels != width * height {
            self.pixels = width * height;
            let zeros = vec![0_u8; (self.pixels * 4) as usize];
            self.projected = gpu.storage("ProjectionPart::projected", &zeros);
        }
        // The march's own, which has the same knob; docs/studies.md has the error by it.
        let step_mm = step_mm(&projection.volume, draw.quality.context_step_mm);
        let context = geometry(camera, reference_mm, &held.uploaded.shape);
        gpu.queue.write_buffer(&self.context, 0, bytemuck::bytes_of(&context));
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&projection.uniform(step_mm)));
        let color = |n: u32| {
            let [r, g, b] = projection.map.color(f64::from(n) / 255.0);
            [r, g, b, 255]
        };
        let ramp: Vec<[u8; 4]> = (0..256).map(color).collect();
        let ramp = gpu.storage("ProjectionPart::ramp", bytemuck::cast_slice(&ramp));
        let entries = [
            (0, draw.view.as_entire_binding()),
            (11, self.context.as_entire_binding()),
            (12, held.uploaded.values.as_entire_binding()),
            (34, self.uniform.as_entire_binding()),
            (35, held.most.as_entire_binding()),
            (36, ramp.as_entire_binding()),
            (37, self.projected.as_entire_binding()),
        ];
        let workgroups = draw.workgroups();
        draw.passes.bind(gpu, PROJECTION, "context/project", &entries, workgroups)?;
        Ok(held.uploaded.shape.warning(&projection.volume))
    }
}

/// For the layout test.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[crate::layouts::layout!(
    Uniform, "Projection": step_mm, scale, offset, threshold, opacity, unused_a, unused_b, unused_c
)];
