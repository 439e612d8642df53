//! Soft light of a sky by spherical harmonics (Ritschel 2007, thesis 3.3.3): for each cell of the image, how visible its surroundings
//! are in directions all around, projected to harmonic functions; the light is then a product of two short lists of numbers. The
//! sky is round about a lamp, as wide as the aperture, and a share of it is everywhere. Opaque geometry has rays for each pixel.
//!
//! On request tissue gives of its colour to what it darkens: sub-cones composite the colours that they meet, as in thesis 5.4.1, and
//! these are projected beside the visibility.
//!
//! Lifetimes: prefiltered extinction once per image and transfer function; the projection (4 bytes for each function and cell, twice
//! with masks, three times more with colours) once per these, masks, settings and camera, not when the light turns; the light of the cells once per frame. It
//! depends on the camera, as the image is left out in front of the masks.

pub(crate) mod basis;
#[cfg(test)]
mod twin_tests;
pub(crate) mod uniforms;

use std::sync::Arc;

use glam::{DQuat, DVec3};
use glioscope_core::{
    RegionVolume, Selection,
    optics::{Camera, cone::clamped_aperture},
};

use self::{
    basis::{count, sky, spread, values},
    uniforms::{Basis, Directions, MOST_DIRECTIONS, ProjectPart, Sky, SkyRays},
};
use super::{
    cones::{
        cell_dispatches,
        grid::Cells,
        medium::{Medium, image_medium},
        settings::ConeSettings,
        uniforms::Cones,
    },
    half_angle::plan::turned,
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitMarch, LitScene, Opaque, no_strength},
    volume::CellLight,
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::{WRITTEN, at_offset},
        pipelines::{BindingKind, Pipelines, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, workgroups_of},
    },
    image::{ClipPlane, ContextVolume, TransferFunction, tables::Dimensions, volume::BRICK},
    scene::{Knob, LightSettings, LightingMode, Plan, Quality, same},
    solid::view::{HAS_OCCLUSION, LINEAR_LIGHT},
};

/// In which directions the masks let light through to the image's cells.
pub(crate) const PAST_MASKS: PassName = PassName::new("sky_past_masks");
/// How visible the surroundings of the image's cells are.
pub(crate) const PROJECT: PassName = PassName::new("visibility");
/// The light of the cells.
pub(crate) const SKY: PassName = PassName::new("sky_in_image");
/// The light on opaque geometry.
pub(crate) const SKY_ON_OPAQUE: PassName = PassName::new("sky_on_surfaces");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::SphericalHarmonics,
    title: "Sky about a lamp (spherical harmonics)",
    summary: "Very soft shadows of a wide light that stands anywhere; fast to turn once computed",
    advice: "The study found its natural light neither best nor worst for depth and liking",
    takes_long: true,
    has_aperture: true,
    has_lamp: true,
    knobs: &[Knob::SkyOrder, Knob::SkyDirections, Knob::SkyShare, Knob::TissueBleeding, Knob::CellMm],
    traces_masks: true,
    lights_smooth: true,
    most_cost: 8.0,
    first_cost: 0.02,
    passes: |kind| match kind {
        LitKind::Image => &[PAST_MASKS, PROJECT, SKY, SKY_ON_OPAQUE],
        LitKind::Masks | LitKind::Depths => &[SKY, SKY_ON_OPAQUE],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        PROJECT | SKY => no_image,
        PAST_MASKS => no_image.or(no_opaque),
        SKY_ON_OPAQUE => no_opaque.or(no_strength(quality)),
        _ => None,
    },
    flags: &[(SKY_ON_OPAQUE, HAS_OCCLUSION), (SKY, LINEAR_LIGHT)],
    image_pass: None,
    reads_arrows: |_| &[SKY_ON_OPAQUE],
    at_cost,
    measured: &[],
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        max_twin_error: twin_tests::max_twin_error,
        ..super::screen::ROW.suite
    },
    start: |gpu| Box::new(HarmonicLight::new(gpu)),
};

fn at_cost(cost: f64) -> Quality {
    // Below and above balanced.
    let (less, more) = (cost.min(1.0), cost.max(1.0));
    Quality {
        resolution_scale: less.powf(0.3).max(0.2),
        context_step_mm: (0.75 * less.powf(-0.3) * more.powf(-0.15)).clamp(0.5, 2.0),
        lighting: LightSettings {
            cell_mm: (6.0 * less.powf(-0.2) * more.powf(-0.2)).clamp(1.0, 16.0),
            sky_directions: (64.0 * less.powf(0.4) * more.powf(0.3)).round().max(12.0) as u32,
            ..LightSettings::DEFAULT
        },
        ..Quality::FULL
    }
}

/// Bytes from one dispatch's uniform to the next, the largest alignment of any device.
const STRIDE: usize = 256;
/// Directions of a dispatch: few enough for the rounds that a thread of Mesa's software driver may loop for.
const DIRECTIONS_PER_STEP: u32 = 16;
/// Rays of a dispatch from a surface, as many as its uniform holds.
const RAYS_PER_STEP: usize = 15;
/// Step along a sub-cone in cells of the level read, and the coarsest level.
pub(crate) const CONE_STEP: f64 = 1.0;
pub(crate) const COARSEST: u32 = 3;

/// Settings within their ranges, and a note on each that was changed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Clamped {
    pub half_angle_deg: f64,
    pub order: u32,
    pub directions: u32,
    pub everywhere: f64,
    pub bleeding: f64,
    pub notes: Vec<String>,
}

impl Clamped {
    pub fn of(settings: &LightSettings) -> Self {
        let (half_angle_deg, is_clamped) = clamped_aperture(settings.aperture_deg);
        let mut notes = Vec::new();
        if is_clamped {
            notes.push(format!("aperture {} degrees: {half_angle_deg} is used", settings.aperture_deg));
        }
        let order = settings.sky_order.min(LightSettings::MOST_SKY_ORDER);
        if order != settings.sky_order {
            notes.push(format!("order {}: {order} is used", settings.sky_order));
        }
        let directions = settings.sky_directions.clamp(1, LightSettings::MOST_SUB_CONES);
        if directions != settings.sky_directions {
            notes.push(format!("{} directions: {directions} are used", settings.sky_directions));
        }
        let share = settings.sky_share;
        let everywhere = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        if everywhere != share {
            notes.push(format!("sky share {share}: {everywhere} is used"));
        }
        let asked = settings.tissue_bleeding;
        let bleeding = if asked.is_nan() { 0.0 } else { asked.clamp(0.0, 1.0) };
        if bleeding != asked {
            notes.push(format!("tissue bleeding {asked}: {bleeding} is used"));
        }
        Self { half_angle_deg, order, directions, everywhere, bleeding, notes }
    }

    /// Of sub-cones that share the sphere.
    pub fn cones(&self) -> ConeSettings {
        // One or two would be as wide as half the sphere or more.
        let aperture_deg = match self.directions {
            1 => 60.0,
            2 => 90.0,
            _ => 180.0,
        };
        ConeSettings {
            aperture_deg,
            sub_cones: self.directions,
            coarsest_level: COARSEST,
            cone_step: CONE_STEP,
        }
    }

    /// Directions in which opaque surfaces look for the light of a sky about a lamp (unit length), each with its share, in the world.
    pub fn rays(&self, towards: DVec3) -> Vec<(DVec3, f64)> {
        let turn = DQuat::from_rotation_arc(DVec3::Z, towards);
        let mut out = Vec::new();
        if self.everywhere < 1.0 {
            let cap = spread(self.directions, self.half_angle_deg);
            let all: f64 = cap.iter().map(|d| d.z).sum();
            out.extend(cap.into_iter().map(|d| (turn * d, (1.0 - self.everywhere) / all)));
        }
        if self.everywhere > 0.0 {
            // The mean cosine over the sphere is a quarter.
            let share = 4.0 * self.everywhere / f64::from(self.directions);
            out.extend(spread(self.directions, 180.0).into_iter().map(|d| (d, share)));
        }
        out
    }
}

/// What a projection is of.
#[derive(Clone)]
struct Key {
    volume: Arc<ContextVolume>,
    transfer: Arc<TransferFunction>,
    tumor: Option<Arc<RegionVolume>>,
    selection: Selection,
    clip: Vec<ClipPlane>,
    cell_mm: f64,
    order: u32,
    directions: u32,
    camera: Camera,
    everywhere: bool,
    tinted: bool,
}

impl Key {
    fn has_image(&self, image: &LitImage<'_>) -> bool {
        Arc::ptr_eq(&self.volume, image.volume)
            && (Arc::ptr_eq(&self.transfer, image.transfer) || self.transfer == *image.transfer)
    }

    fn same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.volume, &other.volume)
            && (Arc::ptr_eq(&self.transfer, &other.transfer) || self.transfer == other.transfer)
            && same(self.tumor.as_ref(), other.tumor.as_ref())
            && self.selection == other.selection
            && self.clip == other.clip
            && (self.cell_mm, self.order, self.directions) == (other.cell_mm, other.order, other.directions)
            && (self.camera, self.everywhere, self.tinted) == (other.camera, other.everywhere, other.tinted)
    }
}

struct Projection {
    key: Key,
    medium: Medium,
    needed: wgpu::Buffer,
    needed_count: u32,
    projected: wgpu::Buffer,
    /// Of visibility, without those of colours.
    sets: u32,
    /// Whether the last frame's pass has to be complete before this may be used: frames in parts may be dropped.
    pending: bool,
}

/// The passes on the device.
struct HarmonicLight {
    layout: wgpu::BindGroupLayout,
    open_layout: wgpu::BindGroupLayout,
    opaque_layout: wgpu::BindGroupLayout,
    pipelines: Pipelines<(Dimensions, [bool; 2])>,
    open_pipeline: Option<wgpu::ComputePipeline>,
    opaque_pipelines: Pipelines<[bool; 2]>,
    cones: wgpu::Buffer,
    directions: wgpu::Buffer,
    basis: wgpu::Buffer,
    sky: wgpu::Buffer,
    placeholder: wgpu::Buffer,
    cells: CellLight,
    held: Option<Projection>,
    work: Option<LightWork>,
}

impl Light for HarmonicLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let settings = Clamped::of(&scene.quality.lighting);
        let towards = scene.quality.lighting.lamp.direction(scene.camera);
        self.work = None;
        match scene.image.filter(|_| plan.has(SKY)) {
            Some(image) => {
                self.bind_projection(gpu, passes, plan, scene, &image, &settings)?;
                self.bind_sky(gpu, passes, &settings, towards)?;
            }
            None => {
                self.held = None;
                self.cells.release();
            }
        }
        if plan.has(SKY_ON_OPAQUE) {
            self.bind_opaque(gpu, passes, scene, &settings.rays(towards))?;
        }
        Ok(settings.notes)
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

impl HarmonicLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let part = UniformAtOffset(size_of::<ProjectPart>() as u64);
        let kinds = [
            (0, Uniform),
            (11, Uniform),
            (12, Read),
            (13, Read),
            (14, Read),
            (15, Read),
            (26, Uniform),
            (27, Read),
            (30, Read),
            (33, Read),
            (34, Write),
            (36, Uniform),
            (38, Uniform),
            (39, part),
        ];
        let of_open = [
            (0, Uniform),
            (1, Read),
            (2, Read),
            (3, Read),
            (30, Read),
            (34, Write),
            (36, Uniform),
            (38, Uniform),
            (39, part),
        ];
        let of_opaque = [
            (0, Uniform),
            (1, Read),
            (2, Read),
            (3, Read),
            (4, Read),
            (7, Write),
            (8, Write),
            (37, Read),
            (38, Uniform),
            (39, UniformAtOffset(size_of::<SkyRays>() as u64)),
            (40, Write),
        ];
        Self {
            layout: bind_group_layout(gpu, "HarmonicLight::layout", &kinds),
            open_layout: bind_group_layout(gpu, "HarmonicLight::open_layout", &of_open),
            opaque_layout: bind_group_layout(gpu, "HarmonicLight::opaque_layout", &of_opaque),
            pipelines: Pipelines::default(),
            open_pipeline: None,
            opaque_pipelines: Pipelines::default(),
            cones: gpu.uniform::<Cones>("HarmonicLight::cones"),
            directions: gpu.uniform::<Directions>("HarmonicLight::directions"),
            basis: gpu.uniform::<Basis>("HarmonicLight::basis"),
            sky: gpu.uniform::<Sky>("HarmonicLight::sky"),
            placeholder: gpu.buffer("HarmonicLight::placeholder", 16, WRITTEN),
            cells: CellLight::new(gpu),
            held: None,
            work: None,
        }
    }

    /// Binds the projection if what it is of has changed.
    ///
    /// # Errors
    /// [`RenderError`].
    fn bind_projection(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
        image: &LitImage<'_>,
        settings: &Clamped,
    ) -> Result<(), RenderError> {
        let key = Key {
            volume: Arc::clone(image.volume),
            transfer: Arc::clone(image.transfer),
            tumor: scene.tumor.cloned(),
            selection: scene.selection.clone(),
            clip: image.clip.to_vec(),
            cell_mm: scene.quality.lighting.cell_mm,
            order: settings.order,
            directions: settings.directions,
            camera: *scene.camera,
            everywhere: scene.opaque == Opaque::Anywhere,
            tinted: settings.bleeding > 0.0,
        };
        let cells = Cells::new(&image.buffers.shape().grid, key.cell_mm);
        let held = self.held.take();
        let is_done = |held: &Projection| held.key.same(&key) && (!held.pending || passes.completed(PROJECT));
        if held.as_ref().is_some_and(is_done) {
            let held = held.map(|held| Projection { pending: false, ..held });
            let needed = held.as_ref().map_or(0, |held| held.needed_count);
            let read = held.as_ref().map_or(0, |held| held.projected.size());
            self.work = Some(LightWork { slices: 0, samples: 0, bytes: read });
            self.held = held;
            self.cells.reserve(gpu, image, cells, key.tinted)?;
            self.cells.write(gpu, scene, image, needed);
            return Ok(());
        }
        // Cells that aren't looked up now may have been before.
        self.cells.release();
        let cells = self.cells.reserve(gpu, image, cells, key.tinted)?.clone();
        let tinted = key.tinted;
        let is_usable =
            |held: &Projection| held.key.has_image(image) && (held.medium.colors.is_some() || !tinted);
        let medium = match held.filter(is_usable) {
            Some(held) => held.medium,
            None => image_medium(gpu, image.buffers, image.volume, tinted)?,
        };
        let shape = image.buffers.shape();
        let needed: Vec<u32> = if key.everywhere {
            (0..cells.count() as u32).collect()
        } else {
            let (dims, bits) = (shape.brick_dims, image.buffers.visible_bits());
            cells.needed(&medium.grid, BRICK, dims, bits, scene.tumor.map(|t| &**t))
        };
        let needed_count = needed.len() as u32;
        let listed = if needed.is_empty() { vec![0] } else { needed };
        let bricks = scene.bricks.filter(|_| plan.has(PAST_MASKS) && scene.opaque != Opaque::Nowhere);
        let with_masks = bricks.is_some();
        let sets = if with_masks { 2 } else { 1 };
        let functions = count(settings.order);
        let all_sets = sets + if tinted { 3 } else { 0 };
        let bytes = 4 * listed.len() as u64 * u64::from(all_sets) * functions as u64;
        gpu.check_size("visibility of cells", bytes)?;
        let held = Projection {
            key,
            medium,
            needed: gpu.storage("HarmonicLight::needed", bytemuck::cast_slice(&listed)),
            needed_count,
            projected: gpu.buffer("HarmonicLight::projected", bytes, WRITTEN),
            sets,
            pending: true,
        };
        self.cells.write(gpu, scene, image, needed_count);
        let directions = spread(settings.directions, 180.0);
        let in_view: Vec<DVec3> = directions.iter().map(|d| turned(scene.camera, *d)).collect();
        let mut axes = [[0.0; 4]; MOST_DIRECTIONS];
        for (to, direction) in axes.iter_mut().zip(&in_view) {
            *to = direction.as_vec3().extend(0.0).to_array();
        }
        gpu.queue.write_buffer(&self.directions, 0, bytemuck::bytes_of(&Directions { axes }));
        let (cones, _) = held.medium.along(
            scene.camera,
            scene.reference_mm,
            &settings.cones(),
            (in_view, DIRECTIONS_PER_STEP),
        );
        gpu.queue.write_buffer(&self.cones, 0, bytemuck::bytes_of(&cones));
        // Times the solid angle of each.
        let each = 4.0 * std::f64::consts::PI / f64::from(settings.directions);
        let mut basis: Basis = bytemuck::Zeroable::zeroed();
        let of_directions = directions.iter().flat_map(|d| values(settings.order, *d));
        for (to, value) in basis.values.iter_mut().flatten().zip(of_directions) {
            *to = (value * each) as f32;
        }
        gpu.queue.write_buffer(&self.basis, 0, bytemuck::bytes_of(&basis));
        let (uniforms, steps) = project_steps(needed_count, settings, functions as u32, gpu.is_software());
        let parts = gpu.buffer_with("HarmonicLight::parts", &uniforms, wgpu::BufferUsages::UNIFORM);
        let part = || at_offset(&parts, size_of::<ProjectPart>() as u64);
        let open = bricks.map(|_| {
            // Four words hold all directions.
            gpu.buffer("HarmonicLight::open", 16 * listed.len() as u64, WRITTEN)
        });
        if let (Some(open), Some([bricks, words]), Some([_, grid])) = (&open, bricks, self.cells.buffers()) {
            let pipeline = match self.open_pipeline.take() {
                Some(known) => known,
                None => compute_pipeline(gpu, "harmonics/open", Some(&self.open_layout), &[])?,
            };
            self.open_pipeline = Some(pipeline.clone());
            let entries = [
                (0, scene.view.as_entire_binding()),
                (1, bricks.as_entire_binding()),
                (2, words.as_entire_binding()),
                (3, scene.colors.as_entire_binding()),
                (30, held.needed.as_entire_binding()),
                (34, open.as_entire_binding()),
                (36, self.directions.as_entire_binding()),
                (38, grid.as_entire_binding()),
                (39, part()),
            ];
            let steps = (vec![pipeline], steps.clone());
            passes.bind_steps(gpu, PAST_MASKS, &self.open_layout, &entries, steps);
        }
        let pipeline = self.pipeline(gpu, (image.buffers.tables().dimensions, [with_masks, tinted]))?;
        let Some([_, grid]) = self.cells.buffers() else { return Ok(()) };
        let entries = [
            (0, scene.view.as_entire_binding()),
            (26, self.cones.as_entire_binding()),
            (27, held.medium.cells.as_entire_binding()),
            (30, held.needed.as_entire_binding()),
            (33, open.as_ref().unwrap_or(&self.placeholder).as_entire_binding()),
            (34, held.projected.as_entire_binding()),
            (36, self.basis.as_entire_binding()),
            (38, grid.as_entire_binding()),
            (39, part()),
        ];
        let entries = [&entries[..], &image.entries()].concat();
        passes.bind_steps(gpu, PROJECT, &self.layout, &entries, (vec![pipeline], steps));
        self.work = Some(LightWork {
            slices: 0,
            samples: u64::from(needed_count) * u64::from(settings.directions),
            bytes: bytes + held.medium.cells.size() + image.buffers.values().size(),
        });
        self.held = Some(held);
        gpu.check()
    }

    /// Binds the light of the cells: a sky about a direction of the world.
    ///
    /// # Errors
    /// [`RenderError::Shader`].
    fn bind_sky(
        &self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        settings: &Clamped,
        towards: DVec3,
    ) -> Result<(), RenderError> {
        let (Some(held), Some(of_grid)) = (&self.held, self.cells.entries()) else { return Ok(()) };
        let factors = sky(settings.order, towards, settings.half_angle_deg, settings.everywhere);
        let mut uniform = Sky {
            functions: factors.len() as u32,
            sets: held.sets,
            bleeding: settings.bleeding as f32,
            ..Sky::default()
        };
        for (to, factor) in uniform.factors.iter_mut().flatten().zip(&factors) {
            *to = *factor as f32;
        }
        gpu.queue.write_buffer(&self.sky, 0, bytemuck::bytes_of(&uniform));
        let entries = [
            (30, held.needed.as_entire_binding()),
            (34, held.projected.as_entire_binding()),
            (36, self.sky.as_entire_binding()),
        ];
        let groups = held.needed_count.max(1).div_ceil(64);
        let across = groups.min(4096);
        let workgroups = [across, groups.div_ceil(across), 1];
        let tint = self.cells.tint_entry();
        let shader = if tint.is_some() { "harmonics/light_and_color" } else { "harmonics/light" };
        passes.bind(gpu, SKY, shader, &[&entries[..], &of_grid, tint.as_slice()].concat(), workgroups)
    }

    /// Binds the rays from opaque geometry, in directions of the world with the share of each.
    ///
    /// # Errors
    /// [`RenderError::Shader`].
    fn bind_opaque(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
        rays: &[(DVec3, f64)],
    ) -> Result<(), RenderError> {
        let (mut uniforms, mut steps) = (Vec::new(), Vec::new());
        let [x, y, _] = workgroups_of(scene.size);
        let chunks = rays.chunks(RAYS_PER_STEP);
        let count = chunks.len();
        for (n, chunk) in chunks.enumerate() {
            let mut uniform = SkyRays {
                count: chunk.len() as u32,
                begins: u32::from(n == 0),
                ends: u32::from(n + 1 == count),
                ..SkyRays::default()
            };
            for (to, (direction, share)) in uniform.towards.iter_mut().zip(chunk) {
                *to = turned(scene.camera, *direction).as_vec3().extend(*share as f32).to_array();
            }
            steps.push(Dispatch { pipeline: 0, offset: uniforms.len() as u32, workgroups: [x, y, 1] });
            uniforms.extend_from_slice(bytemuck::bytes_of(&uniform));
            uniforms.resize(steps.len() * STRIDE, 0);
        }
        let pipeline = self.opaque_pipeline(gpu, [scene.has_normals, scene.bricks.is_some()])?;
        let parts = gpu.buffer_with("HarmonicLight::rays", &uniforms, wgpu::BufferUsages::UNIFORM);
        let [bricks, words] = scene.bricks.unwrap_or([&self.placeholder; 2]);
        let light = self.cells.buffers().map_or(&self.placeholder, |[light, _]| light);
        let entries = [
            (0, scene.view.as_entire_binding()),
            (1, bricks.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (7, scene.occlusion.as_entire_binding()),
            (8, scene.blurred.as_entire_binding()),
            (37, light.as_entire_binding()),
            (38, self.cells.uniform().as_entire_binding()),
            (39, at_offset(&parts, size_of::<SkyRays>() as u64)),
            (40, scene.normals.as_entire_binding()),
        ];
        passes.bind_steps(gpu, SKY_ON_OPAQUE, &self.opaque_layout, &entries, (vec![pipeline], steps));
        Ok(())
    }

    /// Compiled when first needed.
    fn pipeline(
        &mut self,
        gpu: &Gpu,
        kind: (Dimensions, [bool; 2]),
    ) -> Result<wgpu::ComputePipeline, RenderError> {
        self.pipelines.get(gpu, kind, |(dimensions, kind)| {
            let [gradient_counts, joint] = dimensions.constants();
            let [with_masks, tinted] = kind.map(|on| f64::from(u8::from(on)));
            let constants = [("with_masks", with_masks), ("gathers_color", tinted), gradient_counts, joint];
            compute_pipeline(gpu, "harmonics/project", Some(&self.layout), &constants)
        })
    }

    /// Compiled when first needed: whether normals are stored, and whether masks are stored as bricks.
    fn opaque_pipeline(&mut self, gpu: &Gpu, kind: [bool; 2]) -> Result<wgpu::ComputePipeline, RenderError> {
        self.opaque_pipelines.get(gpu, kind, |kind| {
            let [stored_normals, masks] = kind.map(|on| f64::from(u8::from(on)));
            let constants = [("stored_normals", stored_normals), ("stepped", masks), ("past_masks", masks)];
            compute_pipeline(gpu, "harmonics/opaque", Some(&self.opaque_layout), &constants)
        })
    }
}

/// The uniforms and the dispatches of a projection: parts of the cells, for one group of directions after the other.
fn project_steps(
    cells: u32,
    settings: &Clamped,
    functions: u32,
    is_software: bool,
) -> (Vec<u8>, Vec<Dispatch>) {
    let (parts, of_cells) = cell_dispatches(cells, is_software);
    let (mut uniforms, mut steps) = (Vec::new(), Vec::new());
    for direction in (0..settings.directions).step_by(DIRECTIONS_PER_STEP as usize) {
        let directions = DIRECTIONS_PER_STEP.min(settings.directions - direction);
        for step in &of_cells {
            let first = parts.get(step.offset as usize..).and_then(|part| part.first_chunk());
            let first = first.map_or(0, |bytes| u32::from_ne_bytes(*bytes));
            let part = ProjectPart { first, direction, directions, functions };
            steps.push(Dispatch { offset: uniforms.len() as u32, ..*step });
            uniforms.extend_from_slice(bytemuck::bytes_of(&part));
            uniforms.resize(steps.len() * STRIDE, 0);
        }
    }
    (uniforms, steps)
}
