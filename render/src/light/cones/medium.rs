//! A medium on the device: its extinction, prefiltered for sub-cones.

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{Camera, srgb},
};

use super::{
    super::half_angle::plan::turned,
    pyramid,
    settings::{ClampedSettings, ConeSettings, sub_cones, sub_cones_about},
    uniforms::{Cones, LEVELS, Level},
};
use crate::{
    device::{Gpu, RenderError},
    image::{ContextVolume, MOST_CLIP_PLANES, buffers::ImageBuffers, volume::Field},
    scene::LightSettings,
    solid::view::index_axes,
};

/// Optical thickness at which a voxel is opaque.
pub(super) const OPAQUE_THICKNESS: f64 = 40.0;

/// Maximum number of steps of a thread, over all its sub-cones: Mesa's software driver silently ends a thread's loops
/// after 65,535 rounds in total.
const MOST_ROUNDS: u32 = 60_000;

/// Direction towards the lamp in camera space, where light comes from there.
fn lamp(camera: &Camera, settings: &LightSettings) -> Option<DVec3> {
    settings.towards_lamp.then(|| turned(camera, settings.lamp.direction(camera)))
}

/// Prefiltered extinction on the device.
pub(crate) struct Medium {
    pub grid: Grid,
    /// Extinctions; behind them colours, if there are any.
    pub cells: wgpu::Buffer,
    /// Where colours begin; `None` where they weren't asked for.
    pub colors: Option<u32>,
    levels: [Level; LEVELS],
    count: usize,
}

impl Medium {
    /// `extinction` is that of a voxel, per millimetre; `color` its linear colour, if colours are asked for.
    ///
    /// # Errors
    /// [`RenderError`]: it doesn't fit.
    pub fn new<C: Fn([usize; 3]) -> DVec3 + Sync>(
        gpu: &Gpu,
        grid: &Grid,
        extinction: impl Fn([usize; 3]) -> f64 + Sync,
        color: Option<C>,
    ) -> Result<Self, RenderError> {
        let coarser = pyramid::levels(grid.dims(), grid.spacing_mm(), &extinction);
        let mut levels = [Level::default(); LEVELS];
        let mut cells: Vec<f32> = Vec::new();
        let count = (coarser.len() + 1).min(LEVELS);
        // Level 0 is the medium itself.
        for (info, level) in levels.iter_mut().skip(1).zip(&coarser) {
            *info = Level {
                dims: level.dims.map(|d| d as u32),
                start: cells.len() as u32,
                scale: level.voxels.map(|v| 1.0 / v as f32),
                pad: 0,
            };
            cells.extend_from_slice(&level.extinction);
        }
        if cells.is_empty() {
            cells.push(0.0);
        }
        gpu.check_size("prefiltered extinction", 4 * cells.len() as u64)?;
        let colors = color.is_some().then_some(cells.len() as u32);
        if let Some(color) = color {
            gpu.check_size("prefiltered colours", 16 * cells.len() as u64)?;
            let of_levels = coarser.get(..count - 1).unwrap_or_default();
            let all = pyramid::colors(grid.dims(), of_levels, &extinction, color);
            cells.extend(all.iter().flatten().flat_map(|color| color.as_vec3().to_array()));
            // A volume of one voxel has no levels.
            cells.resize(cells.len().max(4), 0.0);
        }
        let cells = gpu.storage("Medium::cells", bytemuck::cast_slice(&cells));
        gpu.check()?;
        Ok(Self { grid: grid.clone(), cells, colors, levels, count })
    }

    /// The uniform of light from a cone about the direction to the eye, or to the lamp, and notes on changed settings.
    pub fn uniform(
        &self,
        camera: &Camera,
        reference_mm: f64,
        requested: &LightSettings,
    ) -> (Cones, Vec<String>) {
        let clamped = ConeSettings {
            aperture_deg: requested.aperture_deg,
            sub_cones: requested.sub_cones,
            coarsest_level: requested.coarsest_level,
            cone_step: requested.cone_step,
        }
        .clamped(LightSettings::MOST_SUB_CONES);
        let ClampedSettings { settings, mut notes } = clamped;
        let axes: Vec<DVec3> = match lamp(camera, requested) {
            Some(towards) => sub_cones_about(towards, &settings),
            None => sub_cones(&settings).into_iter().map(DVec3::from_array).collect(),
        };
        let axes = axes.into_iter();
        let (uniform, note) = self.along(camera, reference_mm, &settings, (axes, settings.sub_cones));
        notes.extend(note);
        (uniform, notes)
    }

    /// The uniform of sub-cones along these axes (unit length), at most [`LightSettings::MOST_SUB_CONES`], of which a thread follows
    /// `per_thread`; and a note on changed settings, which are within their ranges.
    pub fn along(
        &self,
        camera: &Camera,
        reference_mm: f64,
        settings: &ConeSettings,
        (axes, per_thread): (impl IntoIterator<Item = DVec3>, u32),
    ) -> (Cones, Option<String>) {
        let coarsest_level = settings.coarsest_level.min(self.count as u32 - 1);
        let mut settings = ConeSettings { coarsest_level, ..*settings };
        let voxel_mm = self.grid.spacing_mm().min_element();
        let corners = self.grid.corners_mm();
        let longest_mm = (0..4).map(|i| corners[i].distance(corners[7 - i])).fold(0.0, f64::max);
        // Rounds of a sub-cone, less one of its own, one per clipping plane, and a margin for rounding.
        let rounds = MOST_ROUNDS / per_thread.max(1) - MOST_CLIP_PLANES as u32 - 3;
        let step = settings.cone_step;
        while settings.samples(longest_mm, voxel_mm, settings.coarsest_level) > rounds {
            settings.cone_step *= 1.1;
        }
        let note = (settings.cone_step > step)
            .then(|| format!("cone step {step}: {:.3} is used, {rounds} a sub-cone", settings.cone_step));
        let mut to = [[0.0; 4]; 128];
        for (to, axis) in to.iter_mut().zip(axes) {
            *to = axis.as_vec3().extend(0.0).to_array();
        }
        let [corner, right, up, forward] = index_axes(camera, reference_mm, &self.grid);
        let uniform = Cones {
            right,
            up,
            forward,
            corner,
            tangent: settings.sub_tangent() as f32,
            cone_step: settings.cone_step as f32,
            coarsest: settings.coarsest_level as f32,
            voxel_mm: voxel_mm as f32,
            dims: self.grid.dims().map(|d| d as u32),
            count: settings.sub_cones,
            dark: (OPAQUE_THICKNESS / voxel_mm) as f32,
            rounds: rounds + 2,
            colors: self.colors.unwrap_or(0),
            unused_b: 0,
            levels: self.levels,
            axes: to,
        };
        (uniform, note)
    }
}

/// Extinction alone.
pub(crate) const NO_COLOR: Option<fn([usize; 3]) -> DVec3> = None;

/// The extinction of an image by its transfer function, and its colours if `colored`.
///
/// # Errors
/// [`RenderError`]: it doesn't fit.
pub(crate) fn image_medium(
    gpu: &Gpu,
    buffers: &ImageBuffers,
    volume: &ContextVolume,
    colored: bool,
) -> Result<Medium, RenderError> {
    let limit = gpu.storage_limit();
    let Some(field) = Field::fitting(volume, limit) else {
        return Err(RenderError::Volume { found: volume.grid().voxel_count() as u64 * 4, limit });
    };
    let tables = buffers.tables();
    let color = |cell| DVec3::from_array(tables.color_at(&field, cell).map(srgb::decode));
    Medium::new(gpu, &field.grid, |cell| tables.extinction_at(&field, cell), colored.then_some(color))
}
