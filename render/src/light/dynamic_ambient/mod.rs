//! Dynamic ambient occlusion (Ropinski et al. 2008, thesis 3.3.4): tissue darkens what is within a radius. What surrounds each cell of
//! the image is found once, as a histogram of values that knows no transfer function, and condensed into clusters; a transfer
//! function is then one sum for each cluster. Opaque geometry has the ambient occlusion of *traced*.
//!
//! Lifetimes: histograms and clusters (4 bytes a cell, 2 a voxel) once per image, cell size, radius and number of clusters; histograms
//! of the cells near clipping planes once per these; the light of both once per transfer function. Masks don't darken the image, and
//! what is left out in front of them still does.

mod neighborhoods;
#[cfg(test)]
mod twin_tests;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{Grid, optics::srgb};

use self::neighborhoods::{Bin, DIRECTIONS, Histogram, Look, Neighborhoods};
use super::{
    cones::grid::Cells,
    horizon::{ALONG_SURFACE, HORIZON},
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitMarch, LitScene, no_occlusion},
    traced::{self, RAYS},
    volume::CellLight,
};
use crate::{
    device::{Gpu, PassName, RenderError, runner::PassRunner},
    image::{ClipPlane, ContextVolume, TransferFunction, volume::Field},
    scene::{Knob, LightSettings, LightingMode, Plan, Quality},
    solid::view::LINEAR_LIGHT,
};

/// The light of the image's cells.
pub(crate) const AMBIENT: PassName = PassName::new("ambient_light");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::DynamicAmbient,
    title: "Ambient occlusion of tissue (dynamic)",
    summary: "Tissue darker where much is around it; follows the transfer function at once",
    advice: "The study found its subdued shadows good for which of two things is nearer",
    knobs: &[Knob::Clusters, Knob::TissueBleeding, Knob::CellMm],
    takes_long: true,
    lights_smooth: true,
    most_cost: 8.0,
    first_cost: 0.125,
    passes: |kind| match kind {
        LitKind::Masks => &[RAYS, ALONG_SURFACE],
        LitKind::Image => &[AMBIENT, HORIZON, ALONG_SURFACE],
        LitKind::Depths => &[AMBIENT, HORIZON, ALONG_SURFACE],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        AMBIENT => no_image,
        RAYS | HORIZON | ALONG_SURFACE => no_opaque.or_else(|| no_occlusion(quality)),
        _ => None,
    },
    flags: &[(ALONG_SURFACE, crate::solid::view::HAS_OCCLUSION), (AMBIENT, LINEAR_LIGHT)],
    at_cost,
    #[cfg(test)]
    suite: super::lit::Suite { max_twin_error: twin_tests::max_twin_error, ..super::screen::ROW.suite },
    start: |gpu| Box::new(AmbientLight::new(gpu)),
    ..traced::ROW
};

fn at_cost(cost: f64) -> Quality {
    // Below and above balanced.
    let (less, more) = (cost.min(1.0), cost.max(1.0));
    Quality {
        resolution_scale: less.powf(0.3).max(0.2),
        context_step_mm: (0.75 * less.powf(-0.3) * more.powf(-0.15)).clamp(0.5, 2.0),
        // The same at every quality, so that nothing is found again while a view moves.
        lighting: LightSettings { cell_mm: 4.0, ..LightSettings::DEFAULT },
        ..(traced::ROW.at_cost)(cost)
    }
}

/// Radii within which settings are used, millimetres.
const RADII_MM: [f64; 2] = [0.1, 200.0];

/// Most cells, whose surroundings are found in one go: some 10 s of a processor for so many, and 0.3 to 1 GiB while they are
/// condensed. Without a limit, cells of 1 mm in a head would hold up the window for minutes.
const MOST_CELLS: usize = 1 << 21;

/// The cells of a size that is asked for, and what to say where they are larger.
fn cells_of(grid: &Grid, asked_mm: f64) -> (Cells, Option<String>) {
    let cells = Cells::of_whole_voxels(grid, asked_mm, MOST_CELLS);
    let spacing = grid.spacing_mm();
    let longest_mm = (0..3).map(|a| spacing[a] * cells.voxels[a]).fold(0.0, f64::max);
    let used_mm = (100.0 * longest_mm).round() / 100.0;
    let note = (Cells::of_whole_voxels(grid, asked_mm, usize::MAX) != cells)
        .then(|| format!("cells of {asked_mm} mm: {used_mm} mm is used, for at most {MOST_CELLS} cells"));
    (cells, note)
}

/// What an image's neighbourhoods are of.
struct Found {
    volume: Arc<ContextVolume>,
    cells: Cells,
    radius_mm: f64,
    clusters: u32,
    neighborhoods: Neighborhoods,
    cut: Option<Cut>,
    /// What the clusters' light on the device is by, and how much colour bleeds.
    look: Option<(Arc<TransferFunction>, f64)>,
}

/// The cells that clipping planes change, each a cluster of its own, and all clusters on the device.
struct Cut {
    clip: Vec<ClipPlane>,
    cells: Vec<(usize, Histogram)>,
    cluster_of: wgpu::Buffer,
    of_cluster: wgpu::Buffer,
}

impl Found {
    /// # Errors
    /// [`RenderError`]: it doesn't fit.
    fn cut(&self, gpu: &Gpu, cells: &Cells, clip: &[ClipPlane]) -> Result<Cut, RenderError> {
        let of = &self.neighborhoods;
        let cut = if clip.is_empty() { Vec::new() } else { of.cut(cells, self.radius_mm, clip) };
        let mut cluster_of = of.cluster_of.clone();
        for (number, (cell, _)) in (of.clusters.len() as u32..).zip(&cut) {
            if let Some(place) = cluster_of.get_mut(*cell) {
                *place = number;
            }
        }
        let bytes = 16 * (of.clusters.len() + cut.len()) as u64;
        gpu.check_size("clusters of surroundings", bytes)?;
        Ok(Cut {
            clip: clip.to_vec(),
            cells: cut,
            cluster_of: gpu.storage("AmbientLight::cluster_of", bytemuck::cast_slice(&cluster_of)),
            of_cluster: gpu.buffer(
                "AmbientLight::of_cluster",
                bytes,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            ),
        })
    }
}

/// The passes on the device.
struct AmbientLight {
    cells: CellLight,
    found: Option<Found>,
    opaque: Box<dyn Light>,
    work: Option<LightWork>,
}

impl Light for AmbientLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        self.work = None;
        let mut notes = Vec::new();
        match scene.image.filter(|_| plan.has(AMBIENT)) {
            Some(image) => notes = self.bind_image(gpu, passes, scene, &image)?,
            None => {
                self.found = None;
                self.cells.release();
            }
        }
        notes.extend(self.opaque.bind(gpu, passes, plan, scene)?);
        Ok(notes)
    }

    fn lit_march(&self) -> Option<LitMarch<'_>> {
        self.cells.lit_march()
    }

    fn work(&self) -> Option<LightWork> {
        self.work
    }

    #[cfg(test)]
    fn probe(&self) -> super::lit::Probe<'_> {
        super::lit::Probe { grid: self.cells.buffers(), tints: self.cells.tints(), ..Default::default() }
    }
}

impl AmbientLight {
    fn new(gpu: &Gpu) -> Self {
        Self { cells: CellLight::new(gpu), found: None, opaque: (traced::ROW.start)(gpu), work: None }
    }

    /// # Errors
    /// [`RenderError`].
    fn bind_image(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let settings = &scene.quality.lighting;
        let mut notes = Vec::new();
        let asked_mm = scene.quality.occlusion_radius_mm;
        let [least_mm, most_mm] = RADII_MM;
        let radius_mm = if asked_mm.is_nan() { least_mm } else { asked_mm.clamp(least_mm, most_mm) };
        if asked_mm > most_mm {
            notes.push(format!("occlusion radius {asked_mm} mm: {radius_mm} mm is used in the image"));
        }
        let clusters = settings.clusters.clamp(1, LightSettings::MOST_CLUSTERS);
        if clusters != settings.clusters {
            notes.push(format!("{} clusters: {clusters} are used", settings.clusters));
        }
        let asked = settings.tissue_bleeding;
        let bleeding = if asked.is_nan() { 0.0 } else { asked.clamp(0.0, 1.0) };
        if bleeding != asked {
            notes.push(format!("tissue bleeding {asked}: {bleeding} is used"));
        }
        let (cells, larger) = cells_of(&image.buffers.shape().grid, settings.cell_mm);
        notes.extend(larger);
        let cells = self.cells.reserve(gpu, image, cells, bleeding > 0.0)?.clone();
        let count = cells.count() as u32;
        self.cells.write(gpu, scene, image, count);
        let known = self.found.take().filter(|found| {
            Arc::ptr_eq(&found.volume, image.volume)
                && found.cells == cells
                && (found.radius_mm, found.clusters) == (radius_mm, clusters)
        });
        let cell_bytes = if bleeding > 0.0 { 20 } else { 12 };
        let mut work = LightWork { bytes: cell_bytes * u64::from(count), ..LightWork::default() };
        let mut found = match known {
            Some(found) => found,
            None => {
                work.samples = u64::from(count) * u64::from(DIRECTIONS);
                let limit = gpu.storage_limit();
                let Some(field) = Field::fitting(image.volume, limit) else {
                    let found = image.volume.grid().voxel_count() as u64 * 4;
                    return Err(RenderError::Volume { found, limit });
                };
                let neighborhoods = Neighborhoods::of(&field, &cells, radius_mm, clusters as usize);
                Found {
                    volume: Arc::clone(image.volume),
                    cells: cells.clone(),
                    radius_mm,
                    clusters,
                    neighborhoods,
                    cut: None,
                    look: None,
                }
            }
        };
        let cut = match found.cut.take().filter(|cut| cut.clip == image.clip) {
            Some(cut) => cut,
            None => {
                let cut = found.cut(gpu, &cells, image.clip)?;
                work.samples += cut.cells.len() as u64 * u64::from(DIRECTIONS);
                found.look = None;
                cut
            }
        };
        let is_known = found.look.as_ref().is_some_and(|(known, known_bleeding)| {
            (Arc::ptr_eq(known, image.transfer) || known == image.transfer) && *known_bleeding == bleeding
        });
        if !is_known {
            let tables = image.buffers.tables();
            let look = |bin: &Bin| Look {
                extinction: tables.extinction(bin.value, bin.steepness),
                color: DVec3::from_array(tables.color(bin.value, || bin.steepness).map(srgb::decode)),
            };
            let light = found.neighborhoods.light(found.radius_mm, &cut.cells, look, bleeding);
            gpu.queue.write_buffer(&cut.of_cluster, 0, bytemuck::cast_slice(&light));
            found.look = Some((Arc::clone(image.transfer), bleeding));
        }
        let groups = count.max(1).div_ceil(64);
        let across = groups.min(4096);
        let entries = [(30, cut.cluster_of.as_entire_binding()), (33, cut.of_cluster.as_entire_binding())];
        let Some(of_grid) = self.cells.entries() else { return Ok(notes) };
        let workgroups = [across, groups.div_ceil(across), 1];
        let entries = [&entries[..], &of_grid, self.cells.tint_entry().as_slice()].concat();
        let shader = if bleeding > 0.0 { "dynamic_ambient/light_and_color" } else { "dynamic_ambient/light" };
        passes.bind(gpu, AMBIENT, shader, &entries, workgroups)?;
        self.work = Some(work);
        self.found = Some(Found { cut: Some(cut), ..found });
        gpu.check()?;
        Ok(notes)
    }
}
