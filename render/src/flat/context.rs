//! An image made ready for slicing, and what is exactly under a point.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{TumorIndex, Volume};

use crate::flat::{sampler::Sampler, window::Histogram};

/// An image with what slicing it needs, made once a volume. Voxels are not copied: slices are
/// interpolated from the stored numbers in `f64` and scaled after.
#[derive(Clone, Debug)]
pub struct PreparedContext {
    volume: Arc<Volume>,
    histogram: Histogram,
    pub(super) sampler: Sampler,
}

impl PreparedContext {
    /// Counts the histogram: two passes over the voxels, on all cores.
    pub fn new(volume: Arc<Volume>) -> Self {
        let histogram = Histogram::of(&volume);
        let sampler = Sampler::new(volume.grid());
        Self { volume, histogram, sampler }
    }

    /// The image.
    pub fn volume(&self) -> &Arc<Volume> {
        &self.volume
    }

    /// Its range, percentiles and window presets.
    pub fn histogram(&self) -> &Histogram {
        &self.histogram
    }
}

/// What is stored at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readout {
    /// Scaled value of the nearest voxel, not interpolated; may be NaN or infinite when the file
    /// says so. `None` outside the image or without one.
    pub intensity: Option<f64>,
    /// Bit k set where mask k is active, shown or not. 0 outside the case grid.
    pub bits: u32,
}

/// The stored values at a place of the world.
pub fn readout(world_mm: DVec3, image: Option<&Volume>, index: Option<&TumorIndex>) -> Readout {
    let intensity = image.and_then(|volume| {
        let grid = volume.grid();
        grid.voxel_at(world_mm).map(|ijk| volume.value(grid.linear(ijk)))
    });
    Readout { intensity, bits: index.map_or(0, |index| index.at_mm(world_mm)) }
}
