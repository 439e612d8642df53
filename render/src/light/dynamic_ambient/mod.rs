//! Dynamic ambient occlusion (Ropinski et al. 2008, thesis 3.3.4): tissue darkens what is within a radius. What surrounds each cell of
//! the image is found once, as a histogram of values that knows no transfer function, and condensed into clusters; a transfer
//! function is then one sum for each cluster. Opaque geometry has the ambient occlusion of *traced*.
//!
//! Lifetimes: histograms and clusters (4 bytes a cell) once per image, cell size, radius and number of clusters; the clusters' light
//! once per transfer function. Neither masks nor clipping planes darken the image, and what they cut away still does.

mod neighborhoods;
#[cfg(test)]
mod twin_tests;

use std::sync::Arc;

use self::neighborhoods::{DIRECTIONS, Neighborhoods};
use super::{
    horizon::{ALONG_SURFACE, HORIZON},
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitMarch, LitScene, no_occlusion},
    traced::{self, RAYS},
    volume::CellLight,
};
use crate::{
    device::{Gpu, PassName, RenderError, runner::PassRunner},
    image::{ContextVolume, TransferFunction, volume::Field},
    scene::{LightSettings, LightingMode, Plan, Quality},
    solid::view::LINEAR_LIGHT,
};

/// The light of the image's cells.
pub(crate) const AMBIENT: PassName = PassName::new("ambient_light");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::DynamicAmbient,
    title: "Ambient occlusion of tissue (dynamic)",
    summary: "Tissue darker where much is around it; follows the transfer function at once",
    advice: "The study found its subdued shadows good for which of two things is nearer",
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

/// What an image's neighbourhoods are of.
struct Found {
    volume: Arc<ContextVolume>,
    cell_mm: f64,
    radius_mm: f64,
    clusters: u32,
    neighborhoods: Neighborhoods,
    cluster_of: wgpu::Buffer,
    of_cluster: wgpu::Buffer,
    transfer: Option<Arc<TransferFunction>>,
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
        super::lit::Probe { grid: self.cells.buffers(), ..Default::default() }
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
        if !image.clip.is_empty() {
            notes.push(
                "what clipping planes cut away still darkens: surroundings are known before".to_owned(),
            );
        }
        if clusters != settings.clusters {
            notes.push(format!("{} clusters: {clusters} are used", settings.clusters));
        }
        let cells = self.cells.reserve(gpu, scene, image)?.clone();
        let count = cells.count() as u32;
        self.cells.write(gpu, scene, image, count);
        let known = self.found.take().filter(|found| {
            Arc::ptr_eq(&found.volume, image.volume)
                && (found.cell_mm, found.radius_mm, found.clusters) == (settings.cell_mm, radius_mm, clusters)
        });
        let mut work = LightWork { bytes: 12 * u64::from(count), ..LightWork::default() };
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
                let of_cluster = vec![0f32; neighborhoods.clusters.len()];
                Found {
                    volume: Arc::clone(image.volume),
                    cell_mm: settings.cell_mm,
                    radius_mm,
                    clusters,
                    cluster_of: gpu
                        .storage("AmbientLight::cluster_of", bytemuck::cast_slice(&neighborhoods.cluster_of)),
                    of_cluster: gpu.buffer_with(
                        "AmbientLight::of_cluster",
                        bytemuck::cast_slice(&of_cluster),
                        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                    ),
                    neighborhoods,
                    transfer: None,
                }
            }
        };
        let is_known = found
            .transfer
            .as_ref()
            .is_some_and(|known| Arc::ptr_eq(known, image.transfer) || known == image.transfer);
        if !is_known {
            let tables = image.buffers.tables();
            let light =
                found.neighborhoods.light(found.radius_mm, |bin| tables.extinction(bin.value, bin.steepness));
            gpu.queue.write_buffer(&found.of_cluster, 0, bytemuck::cast_slice(&light));
            found.transfer = Some(Arc::clone(image.transfer));
        }
        let groups = count.max(1).div_ceil(64);
        let across = groups.min(4096);
        let entries =
            [(30, found.cluster_of.as_entire_binding()), (33, found.of_cluster.as_entire_binding())];
        let Some(of_grid) = self.cells.entries() else { return Ok(notes) };
        let workgroups = [across, groups.div_ceil(across), 1];
        let entries = [&entries[..], &of_grid].concat();
        passes.bind(gpu, AMBIENT, "dynamic_ambient/light", &entries, workgroups)?;
        self.work = Some(work);
        self.found = Some(found);
        gpu.check()?;
        Ok(notes)
    }
}
