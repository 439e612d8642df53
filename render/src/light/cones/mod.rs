//! Lighting by cones traced through prefiltered extinction: a light grid of the image, and light on the masks.
//!
//! Lifetimes: prefiltered extinction of the image once per image and transfer function, that of the masks
//! once per selection; the grid once per these and cell size; uniforms once per frame.

pub(crate) mod grid;
#[cfg(test)]
mod grid_tests;
pub(crate) mod medium;
#[cfg(test)]
mod monte_carlo_tests;
#[cfg(test)]
mod parts_tests;
pub(crate) mod pyramid;
pub(crate) mod settings;
#[cfg(test)]
pub(crate) mod twin;
pub(crate) mod uniforms;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{Grid, RegionVolume, Selection};

use self::{
    grid::Cells,
    medium::{Medium, NO_COLOR, OPAQUE_THICKNESS, image_medium},
    uniforms::{Cones, LightGrid, LightPart},
};
use super::{
    layers::{self, LAYERS, LayerLight},
    lit::{Light, LightRow, LightWork, LitImage, LitKind, LitMarch, LitScene, Measured, Opaque, no_strength},
    vicinity::{self, TUBE_SHADOWS, VICINITY, VicinityLight},
};
use crate::{
    device::{
        Gpu, PassName, RenderError,
        buffers::WRITTEN,
        pipelines::{BindingKind, Pipelines, bind_group_layout, compute_pipeline},
        runner::{Dispatch, PassRunner, Shader, workgroups_of},
    },
    image::{ContextVolume, TransferFunction, tables::Dimensions, volume::BRICK},
    scene::{Knob, LightSettings, LightingMode, Plan, Quality, same},
    solid::view::{HAS_OCCLUSION, LINEAR_LIGHT},
};

/// Light that reaches the cells of the context image's light grid.
pub(crate) const LIGHT_GRID: PassName = PassName::new("light_grid");
/// Light that reaches opaque geometry.
pub(crate) const SOLID_CONES: PassName = PassName::new("solid_cones");

pub(super) const ROW: LightRow = LightRow {
    mode: LightingMode::Cones,
    title: "Directional occlusion (cones)",
    summary: "Soft shadows, also of the tumour on itself; light on opaque surfaces per pixel",
    advice: super::lit::DEPTH_ORDER_AND_SIZE,
    takes_long: true,
    has_aperture: true,
    has_lamp: false,
    knobs: &[Knob::SubCones, Knob::CellMm],
    traces_masks: true,
    lights_smooth: false,
    most_cost: 16.0,
    first_cost: 0.125,
    passes: |kind| match kind {
        LitKind::Masks => &[SOLID_CONES],
        LitKind::Image => &[LIGHT_GRID, LAYERS, TUBE_SHADOWS, SOLID_CONES],
        // No medium for cones: as with slices.
        LitKind::Depths => &[LIGHT_GRID, LAYERS, VICINITY],
    },
    omission_reason: |pass, quality, no_opaque, no_image| match pass {
        LIGHT_GRID => no_image,
        SOLID_CONES => no_opaque.or(no_strength(quality)),
        LAYERS => layers::omission_reason(quality, no_opaque),
        TUBE_SHADOWS => vicinity::no_tube_shadows(quality, no_opaque),
        VICINITY => vicinity::omission_reason(quality, no_opaque, no_image),
        _ => None,
    },
    flags: &[(SOLID_CONES, HAS_OCCLUSION), (VICINITY, HAS_OCCLUSION), (LIGHT_GRID, LINEAR_LIGHT)],
    image_pass: None,
    reads_arrows: |_| &[SOLID_CONES, LAYERS, TUBE_SHADOWS, LIGHT_GRID],
    at_cost,
    measured: MEASURED,
    #[cfg(test)]
    suite: super::lit::Suite {
        layouts: uniforms::LAYOUTS,
        variants: &[LightSettings::DEFAULT.variant],
        max_twin_error: grid_tests::max_twin_error,
        decided_by_rounding: 0.0,
    },
    start: |gpu| Box::new(ConeLight::new(gpu)),
};

/// `glioscope-bench accuracy --only light`: cost, RMS error on opaque surfaces and in tissue. A test compares them with
/// docs/accuracy.md.
const MEASURED: Measured = &[
    (0.004, [0.0442, 0.0811]),
    (0.015, [0.0466, 0.0762]),
    (0.03, [0.0398, 0.0673]),
    (0.06, [0.0358, 0.0599]),
    (0.125, [0.0270, 0.0574]),
    (0.25, [0.0265, 0.0569]),
    (0.5, [0.0248, 0.0582]),
    (1.0, [0.0229, 0.0561]),
    (2.0, [0.0194, 0.0411]),
    (4.0, [0.0201, 0.0398]),
    (8.0, [0.0178, 0.0215]),
    (16.0, [0.0160, 0.0202]),
];

fn at_cost(cost: f64) -> Quality {
    // Below and above balanced.
    let (less, more) = (cost.min(1.0), cost.max(1.0));
    let finer = |balanced: f64, down: f64, up: f64| balanced * less.powf(-down) * more.powf(-up);
    Quality {
        resolution_scale: less.powf(0.3).max(0.2),
        context_step_mm: finer(0.75, 0.3, 0.15).clamp(0.5, 2.0),
        lighting: LightSettings {
            cell_mm: finer(4.0, 0.25, 0.25).clamp(1.0, 12.0),
            // Down to the draft, longer steps are as accurate.
            cone_step: less.powf(-1.0 / 3.0).min(2.0),
            sub_cones: (6.0 * less.powf(0.3) * more.powf(0.25)).round().max(3.0) as u32,
            coarsest_level: match cost {
                c if c > 6.0 => 1,
                c if c > 1.5 => 2,
                _ => 3,
            },
            layer_cell: layers::cell_at(less),
            ..LightSettings::DEFAULT
        },
        ..Quality::FULL
    }
}

/// Binding numbers of a light grid and its uniform.
pub(crate) const GRID_BINDINGS: [u32; 2] = [37, 38];

struct ImageLight {
    volume: Arc<ContextVolume>,
    transfer: Arc<TransferFunction>,
    tumor: Option<Arc<RegionVolume>>,
    medium: Medium,
    cell_mm: f64,
    /// Whether every cell is computed: tubes may be anywhere, and arrows outside the masks' bounding box.
    everywhere: bool,
    cells: Cells,
    needed: wgpu::Buffer,
    needed_count: u32,
    light: wgpu::Buffer,
    work: LightWork,
}

struct MaskLight {
    tumor: Option<Arc<RegionVolume>>,
    selection: Selection,
    medium: Medium,
}

/// Bytes from one dispatch's uniform to the next, and bytes of one.
const STRIDE: usize = 256;
pub(crate) const PART_BYTES: u64 = size_of::<LightPart>() as u64;

/// Cells per dispatch on a software adapter: few enough that a window needn't wait for them (docs/performance.md). A
/// GPU takes all in one dispatch.
const CELLS_PER_DISPATCH: u32 = 1024;
/// Maximum number of dispatches; with more cells, each takes more.
const MOST_DISPATCHES: u32 = 4096;

/// The uniforms and the dispatches that process this many cells; one dispatch for no cells.
pub(crate) fn cell_dispatches(cells: u32, is_software: bool) -> (Vec<u8>, Vec<Dispatch>) {
    let per_dispatch =
        if is_software { CELLS_PER_DISPATCH.max(cells.div_ceil(MOST_DISPATCHES)) } else { cells.max(1) };
    let per_dispatch = per_dispatch.next_multiple_of(64);
    let (mut bytes, mut steps) = (Vec::new(), Vec::new());
    for first in (0..cells.max(1)).step_by(per_dispatch as usize) {
        let groups = (cells.max(1) - first).min(per_dispatch).div_ceil(64);
        let across = groups.min(4096);
        let workgroups = [across, groups.div_ceil(across), 1];
        steps.push(Dispatch { pipeline: 0, offset: bytes.len() as u32, workgroups });
        bytes.extend_from_slice(bytemuck::bytes_of(&LightPart { first, ..LightPart::default() }));
        bytes.resize(steps.len() * STRIDE, 0);
    }
    (bytes, steps)
}

/// The passes on the device.
struct ConeLight {
    image_layout: wgpu::BindGroupLayout,
    /// With and without gradients, with the cone to the lamp or to the eye.
    image_pipelines: Pipelines<(Dimensions, bool)>,
    image_uniform: wgpu::Buffer,
    mask_uniform: wgpu::Buffer,
    grid_uniform: wgpu::Buffer,
    placeholder: wgpu::Buffer,
    image: Option<ImageLight>,
    masks: Option<MaskLight>,
    layers: LayerLight,
    vicinity: VicinityLight,
}

impl Light for ConeLight {
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let mut lag_mm = None;
        if plan.has(LAYERS) {
            // Cones trace the masks.
            lag_mm = self.layers.bind(gpu, passes, scene, plan.has(SOLID_CONES))?;
        } else {
            self.layers.leave_out(gpu);
        }
        if plan.has(TUBE_SHADOWS) {
            self.vicinity.bind_tubes(gpu, passes, scene, (&self.layers, lag_mm))?;
        }
        let mut notes = Vec::new();
        if plan.has(LIGHT_GRID) {
            notes = self.bind_image(gpu, passes, scene)?;
        } else {
            self.image = None;
        }
        if plan.has(SOLID_CONES) {
            let mask_notes = self.bind_masks(gpu, passes, plan, scene)?;
            notes.extend(mask_notes.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        } else {
            self.masks = None;
        }
        if plan.has(VICINITY) {
            self.vicinity.bind(gpu, passes, scene, None, (&self.layers, lag_mm))?;
        }
        Ok(notes)
    }

    fn lit_march(&self) -> Option<LitMarch<'_>> {
        let grid = self.grid()?;
        let entries = grid.into_iter().zip(GRID_BINDINGS).map(|(b, n)| (n, b.as_entire_binding())).collect();
        Some(LitMarch { shader: "cones/march", entries })
    }

    fn work(&self) -> Option<LightWork> {
        self.image.as_ref().map(|image| image.work)
    }

    #[cfg(test)]
    fn probe(&self) -> super::lit::Probe<'_> {
        super::lit::Probe { grid: self.grid(), ..Default::default() }
    }
}

impl ConeLight {
    fn new(gpu: &Gpu) -> Self {
        use BindingKind::{Read, Uniform, UniformAtOffset, Write};
        let kinds = [
            (0, Uniform),
            (4, Read),
            (11, Uniform),
            (12, Read),
            (13, Read),
            (14, Read),
            (15, Read),
            (26, Uniform),
            (27, Read),
            (30, Read),
            (37, Write),
            (38, Uniform),
            (39, UniformAtOffset(PART_BYTES)),
        ];
        Self {
            image_layout: bind_group_layout(gpu, "ConeLight::image_layout", &kinds),
            image_pipelines: Pipelines::default(),
            image_uniform: gpu.uniform::<Cones>("ConeLight::image_uniform"),
            mask_uniform: gpu.uniform::<Cones>("ConeLight::mask_uniform"),
            grid_uniform: gpu.uniform::<LightGrid>("ConeLight::grid_uniform"),
            placeholder: gpu.buffer("ConeLight::placeholder", 16, WRITTEN),
            image: None,
            masks: None,
            layers: LayerLight::new(gpu),
            vicinity: VicinityLight::new(gpu),
        }
    }

    /// The light grid of the image, and its uniform.
    fn grid(&self) -> Option<[&wgpu::Buffer; 2]> {
        self.image.as_ref().map(|image| [&image.light, &self.grid_uniform])
    }

    fn bind_image(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let settings = &scene.quality.lighting;
        let everywhere = scene.opaque == Opaque::Anywhere;
        let Some(image) = scene.image else { return Ok(Vec::new()) };
        let LitImage { buffers, volume, transfer, .. } = image;
        let cached = self.image.take().filter(|light| {
            Arc::ptr_eq(&light.volume, volume)
                && (Arc::ptr_eq(&light.transfer, transfer) || light.transfer == *transfer)
        });
        let mut held = match cached {
            Some(light)
                if light.cell_mm == settings.cell_mm
                    && light.everywhere == everywhere
                    && same(light.tumor.as_ref(), scene.tumor) =>
            {
                light
            }
            cached => {
                let medium = match cached {
                    Some(light) => light.medium,
                    None => image_medium(gpu, buffers, volume, false)?,
                };
                let cells = Cells::new(&medium.grid, settings.cell_mm);
                let shape = buffers.shape();
                let needed: Vec<u32> = if everywhere {
                    (0..cells.count() as u32).collect()
                } else {
                    let (dims, bits) = (shape.brick_dims, buffers.visible_bits());
                    cells.needed(&medium.grid, BRICK, dims, bits, scene.tumor.map(|t| &**t))
                };
                let needed_count = needed.len() as u32;
                let listed = if needed.is_empty() { vec![0] } else { needed };
                gpu.check_size("cells of light", 8 * cells.count() as u64)?;
                let light = gpu.buffer("ImageLight::light", 8 * cells.count() as u64, WRITTEN);
                ImageLight {
                    volume: Arc::clone(volume),
                    transfer: Arc::clone(transfer),
                    tumor: scene.tumor.cloned(),
                    medium,
                    cell_mm: settings.cell_mm,
                    everywhere,
                    cells,
                    needed: gpu.storage("ImageLight::needed", bytemuck::cast_slice(&listed)),
                    needed_count,
                    light,
                    work: LightWork::default(),
                }
            }
        };
        let (uniform, notes) = held.medium.uniform(scene.camera, scene.reference_mm, settings);
        // Per cell its number and two lights.
        let cells_bytes = (4 + 8) * u64::from(held.needed_count);
        held.work = LightWork {
            slices: 0,
            samples: u64::from(held.needed_count) * u64::from(uniform.count),
            bytes: cells_bytes + held.medium.cells.size() + buffers.values().size(),
        };
        gpu.queue.write_buffer(&self.image_uniform, 0, bytemuck::bytes_of(&uniform));
        let strength = scene.quality.strength();
        let grid = LightGrid {
            needed: held.needed_count,
            strength,
            ..LightGrid::of(&held.medium.grid, &held.cells, scene.camera, scene.reference_mm)
        };
        gpu.queue.write_buffer(&self.grid_uniform, 0, bytemuck::bytes_of(&grid));
        let pipeline = self.image_pipeline(gpu, (buffers.tables().dimensions, settings.towards_lamp))?;
        let entries = [
            (0, scene.view.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (26, self.image_uniform.as_entire_binding()),
            (27, held.medium.cells.as_entire_binding()),
            (37, held.light.as_entire_binding()),
            (38, self.grid_uniform.as_entire_binding()),
            (30, held.needed.as_entire_binding()),
        ];
        let (uniforms, steps) = cell_dispatches(held.needed_count, gpu.is_software());
        let parts = gpu.buffer_with("ConeLight::parts", &uniforms, wgpu::BufferUsages::UNIFORM);
        let part = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &parts,
            offset: 0,
            size: wgpu::BufferSize::new(PART_BYTES),
        });
        let entries = [&entries[..], &image.entries(), &[(39, part)]].concat();
        passes.bind_steps(gpu, LIGHT_GRID, &self.image_layout, &entries, (vec![pipeline], steps));
        self.image = Some(held);
        Ok(notes)
    }

    /// Compiled when first needed.
    fn image_pipeline(
        &mut self,
        gpu: &Gpu,
        key: (Dimensions, bool),
    ) -> Result<wgpu::ComputePipeline, RenderError> {
        self.image_pipelines.get(gpu, key, |(dimensions, towards_lamp)| {
            let [gradient_counts, joint] = dimensions.constants();
            let constants = [gradient_counts, joint, ("towards_lamp", f64::from(u8::from(*towards_lamp)))];
            compute_pipeline(gpu, "cones/image", Some(&self.image_layout), &constants)
        })
    }

    fn bind_masks(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError> {
        let settings = &scene.quality.lighting;
        let cached = self
            .masks
            .take()
            .filter(|light| same(light.tumor.as_ref(), scene.tumor) && light.selection == *scene.selection);
        let held = match cached {
            Some(light) => light,
            None => MaskLight {
                tumor: scene.tumor.cloned(),
                selection: scene.selection.clone(),
                medium: mask_medium(gpu, scene)?,
            },
        };
        let (uniform, notes) = held.medium.uniform(scene.camera, scene.reference_mm, settings);
        gpu.queue.write_buffer(&self.mask_uniform, 0, bytemuck::bytes_of(&uniform));
        let image_light = self.image.as_ref().filter(|_| plan.has(LIGHT_GRID));
        // At level 0 a sub-cone is a ray through the voxels.
        let exact = f64::from(u8::from(settings.coarsest_level == 0));
        let [bricks, words] = scene.bricks.unwrap_or([&self.placeholder; 2]);
        let entries = [
            (0, scene.view.as_entire_binding()),
            (1, bricks.as_entire_binding()),
            (2, words.as_entire_binding()),
            (3, scene.colors.as_entire_binding()),
            (4, scene.depths.as_entire_binding()),
            (7, scene.occlusion.as_entire_binding()),
            (8, scene.blurred.as_entire_binding()),
            (26, self.mask_uniform.as_entire_binding()),
            (27, held.medium.cells.as_entire_binding()),
            (37, image_light.map_or(&self.placeholder, |image| &image.light).as_entire_binding()),
            (38, self.grid_uniform.as_entire_binding()),
        ];
        let past_tubes = f64::from(u8::from(plan.has(TUBE_SHADOWS)));
        let towards_lamp = f64::from(u8::from(settings.towards_lamp));
        let constants = [("exact", exact), ("past_tubes", past_tubes), ("towards_lamp", towards_lamp)];
        let shader = Shader { file: "cones/opaque", constants: &constants };
        passes.bind(gpu, SOLID_CONES, shader, &entries, workgroups_of(scene.size))?;
        self.masks = Some(held);
        Ok(notes)
    }
}

/// The regions shown, as opaque voxels. One empty voxel if there are no masks.
fn mask_medium(gpu: &Gpu, scene: &LitScene<'_>) -> Result<Medium, RenderError> {
    let Some(tumor) = scene.tumor else {
        let grid = Grid::axis_aligned([1; 3], DVec3::ONE, scene.camera.focus_mm)
            .map_err(|e| RenderError::Scene(e.to_string()))?;
        return Medium::new(gpu, &grid, |_| 0.0, NO_COLOR);
    };
    let grid = tumor.grid();
    let shown: Vec<bool> = tumor.bits_of_id().iter().map(|&bits| scene.selection.shows(bits)).collect();
    let opaque_per_mm = OPAQUE_THICKNESS / grid.spacing_mm().min_element();
    let extinction = |cell| {
        let id = tumor.id(grid.linear(cell)) as usize;
        if shown.get(id).copied().unwrap_or(false) { opaque_per_mm } else { 0.0 }
    };
    Medium::new(gpu, grid, extinction, NO_COLOR)
}
