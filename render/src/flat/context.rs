//! An image prepared for slicing, and the stored values at a point.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{TumorIndex, Volume};

use crate::flat::{
    sampler::Sampler,
    window::{Histogram, Preset},
};

/// An image with what slicing it needs, made once per volume. Voxels are not copied: slices are
/// interpolated from the stored numbers in `f64` and scaled afterwards.
#[derive(Clone, Debug)]
pub struct PreparedContext {
    volume: Arc<Volume>,
    histogram: Histogram,
    pub(super) sampler: Sampler,
}

impl PreparedContext {
    /// Computes the histogram: two passes over the voxels, on all cores.
    pub fn new(volume: Arc<Volume>) -> Self {
        let histogram = Histogram::of(&volume);
        let sampler = Sampler::new(volume.grid());
        Self { volume, histogram, sampler }
    }

    /// The image.
    pub fn volume(&self) -> &Arc<Volume> {
        &self.volume
    }

    /// Window presets of the image; `is_pet`: its name says that it is PET.
    pub fn presets(&self, is_pet: bool) -> Vec<Preset> {
        self.histogram.presets_of(self.volume.unit(), is_pet)
    }

    /// Value range, percentiles and window presets.
    pub fn histogram(&self) -> &Histogram {
        &self.histogram
    }
}

/// The stored values at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readout {
    /// Scaled value of the nearest voxel, not interpolated; NaN or infinite where the file has such a
    /// value. `None` outside the image or without one.
    pub intensity: Option<f64>,
    /// Bit k set where mask k is active, shown or not. 0 outside the case grid.
    pub bits: u32,
}

/// The stored values at a point in world space.
pub fn readout(world_mm: DVec3, image: Option<&Volume>, index: Option<&TumorIndex>) -> Readout {
    let intensity = image.and_then(|volume| {
        let grid = volume.grid();
        grid.voxel_at(world_mm).map(|ijk| volume.value(grid.linear(ijk)))
    });
    Readout { intensity, bits: index.map_or(0, |index| index.at_mm(world_mm)) }
}
