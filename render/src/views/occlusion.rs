//! What lighting took from opaque geometry in a frame, read back.

use super::view3d::{Frame, View3d};
use crate::{
    device::{Gpu, RenderError},
    solid::view::FAR,
};

/// Light that opaque geometry lost, per pixel, rows from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Occlusion {
    /// View depths from the eye; infinite on the background.
    pub depths_mm: Vec<f64>,
    /// Share by which each pixel's encoded colour is darkened, filtered.
    pub dark: Vec<f64>,
}

impl<V: View3d> Frame<V> {
    /// What lighting took from the opaque geometry at each pixel drawn. For measurements: reads everything back.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    pub fn occlusion(&self, gpu: &Gpu) -> Result<Occlusion, RenderError> {
        let n = u64::from(self.size_px[0]) * u64::from(self.size_px[1]);
        let read =
            gpu.read_buffers(&[(&self.targets.depths, 0, n * 4), (&self.targets.blurred, 0, n * 4)])?;
        let [depths, blurred] = &read[..] else { return Ok(Occlusion::default()) };
        let depths: Vec<f32> = bytemuck::pod_collect_to_vec(depths);
        let from_eye = |d: &f32| if *d < FAR { self.reference_mm + f64::from(*d) } else { f64::INFINITY };
        Ok(Occlusion {
            depths_mm: depths.iter().map(from_eye).collect(),
            // The last of four 8-bit channels; the others are the bleeding colour.
            dark: blurred.chunks_exact(4).map(|p| f64::from(p[3]) / 255.0).collect(),
        })
    }
}
