//! Tubes on the device: points written once per list of shown sets, targets created once per size, the uniform written
//! once per frame.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::optics::Camera;

use crate::{
    device::{Gpu, RenderError, buffers::WRITTEN, raster::RasterTargets, runner::Drawing},
    solid::{
        tubes::{DrawnTubes, TubeSet},
        view::{View, in_camera_space},
    },
};

/// Flags in [`TubePoint::what`], as in tubes/draw: the low bits are the fibre's number.
const LAST: u32 = 0x100_0000;
const ALONE: u32 = 0x200_0000;
/// The most fibres of one frame: their numbers from 1 have 24 bits.
const MOST_FIBERS: usize = 0xff_fffe;
/// Flag in the place of a face, `TUBE` of lib/tubes.
const TUBE: u32 = 0x8000_0000;
/// No face at all, `NO_FACE` of lib/view.
const NO_FACE: u32 = u32::MAX;
/// Half the least width of a tube on the screen, at line scale 1.
pub(crate) const LEAST_PX: f64 = 0.75;
/// Corners of the rectangle around a capsule, in two triangles.
const CORNERS: [u16; 6] = [0, 1, 2, 2, 1, 3];

/// The fibre number in a face, if it is a tube's.
pub(crate) fn fiber_number(face: u32) -> Option<u32> {
    (face & TUBE != 0 && face != NO_FACE).then_some(face & !TUBE)
}

/// `TubePoint` of tubes/draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct TubePoint {
    pub place: [f32; 3],
    pub what: u32,
}

/// `Fiber` of lib/tubes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct Fiber {
    pub color: u32,
    pub radius_mm: f32,
}

/// `Tubes` of tubes/draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct TubesUniform {
    pub right: [f32; 3],
    pub least_px: f32,
    pub up: [f32; 3],
    pub unused_a: f32,
    pub away: [f32; 3],
    pub unused_b: f32,
    pub origin: [f32; 3],
    pub unused_c: f32,
}

/// The points of all shown sets.
struct ShownSets {
    sets: Vec<Arc<TubeSet>>,
    /// Common origin of all points, world millimetres.
    origin_mm: DVec3,
    points: wgpu::Buffer,
    count: u32,
    fibers: wgpu::Buffer,
}

/// Targets of the tube passes.
struct Targets {
    size: [u32; 2],
    raster: RasterTargets,
    shades: wgpu::Buffer,
}

/// All buffers that a renderer holds for tubes. Without tubes: a few bytes.
pub(crate) struct TubeBuffers {
    uniform: wgpu::Buffer,
    corners: wgpu::Buffer,
    /// Bound in place of absent buffers.
    placeholder: wgpu::Buffer,
    shown: Option<ShownSets>,
    targets: Option<Targets>,
}

impl TubeBuffers {
    /// Without tubes.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            uniform: gpu.uniform::<TubesUniform>("TubeBuffers::uniform"),
            corners: gpu.buffer_with(
                "TubeBuffers::corners",
                bytemuck::cast_slice(&CORNERS),
                wgpu::BufferUsages::INDEX,
            ),
            placeholder: gpu.storage("TubeBuffers::placeholder", &[0; 16]),
            shown: None,
            targets: None,
        }
    }

    /// Prepares the passes of `tubes`: points if the shown sets changed, targets if the size changed, the
    /// uniform. With `tubes` `None` (no such pass runs) everything is released.
    ///
    /// # Errors
    /// [`RenderError::Buffer`] past the device's limits, [`RenderError::Scene`] past 16,777,214 fibres,
    /// [`RenderError::Device`] with the driver's message; nothing is held then.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        tubes: Option<&[DrawnTubes]>,
        camera: &Camera,
        reference_mm: f64,
        view: &View,
    ) -> Result<(), RenderError> {
        let (shown, targets) = (self.shown.take(), self.targets.take());
        let Some(tubes) = tubes else { return Ok(()) };
        let sets: Vec<&Arc<TubeSet>> = tubes.iter().filter(|t| t.draws()).map(|t| &t.set).collect();
        let is_same = |s: &ShownSets| {
            s.sets.len() == sets.len() && s.sets.iter().zip(&sets).all(|(a, b)| Arc::ptr_eq(a, b))
        };
        let shown = match shown.filter(is_same) {
            Some(shown) => shown,
            None => ShownSets::new(gpu, &sets)?,
        };
        let targets = match targets.filter(|t| t.size == view.size) {
            Some(targets) => targets,
            None => Targets::new(gpu, view.size)?,
        };
        let uniform = uniform(shown.origin_mm, camera, reference_mm, view);
        gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&uniform));
        (self.shown, self.targets) = (Some(shown), Some(targets));
        Ok(())
    }

    /// The drawing of the raster pass and its bindings besides the view; `None` before
    /// [`TubeBuffers::prepare`].
    pub fn drawing(&self) -> Option<(Drawing, [(u32, wgpu::BindingResource<'_>); 3])> {
        let (shown, targets) = (self.shown.as_ref()?, self.targets.as_ref()?);
        let drawing = Drawing {
            picture: targets.raster.picture.clone(),
            depths: targets.raster.depths.clone(),
            indices: self.corners.clone(),
            index_count: CORNERS.len() as u32,
            instances: shown.count,
        };
        let entries = [
            (26, self.uniform.as_entire_binding()),
            (27, shown.points.as_entire_binding()),
            (28, shown.fibers.as_entire_binding()),
        ];
        Some((drawing, entries))
    }

    /// The colour target of the raster pass; `None` without tubes.
    pub fn picture(&self) -> Option<&wgpu::TextureView> {
        self.targets.as_ref().map(|t| &t.raster.picture)
    }

    /// Colour and radius of each fibre.
    pub fn fibers(&self) -> &wgpu::Buffer {
        self.shown.as_ref().map_or(&self.placeholder, |s| &s.fibers)
    }

    /// Shaded colour and facing of the tube at each pixel, packed; 0 where there is none.
    pub fn shades(&self) -> &wgpu::Buffer {
        self.targets.as_ref().map_or(&self.placeholder, |t| &t.shades)
    }
}

impl ShownSets {
    fn new(gpu: &Gpu, sets: &[&Arc<TubeSet>]) -> Result<Self, RenderError> {
        let fibers: usize = sets.iter().map(|s| s.fiber_count()).sum();
        if fibers > MOST_FIBERS {
            return Err(RenderError::Scene(format!("{fibers} fibres (at most {MOST_FIBERS})")));
        }
        let points: usize = sets.iter().map(|s| s.point_count()).sum();
        gpu.check_size("the fibre tracts", (points.max(fibers) * size_of::<TubePoint>()) as u64)?;
        let origin_mm = sets.iter().max_by_key(|s| s.point_count()).map_or(DVec3::ZERO, |s| s.origin_mm());
        let mut packed_points = Vec::with_capacity(points.max(1));
        let mut fiber_table = Vec::with_capacity(fibers.max(1));
        for set in sets {
            // In f64: an offset of 1e6 mm then costs no precision.
            let shift = set.origin_mm() - origin_mm;
            let [r, g, b] = set.color().map(u32::from);
            for n in 0..set.fiber_count() {
                let number = fiber_table.len() as u32;
                fiber_table.push(Fiber { color: r | g << 8 | b << 16, radius_mm: set.radius_mm() as f32 });
                let fiber = set.fiber(n);
                packed_points.extend(fiber.iter().enumerate().map(|(at, &p)| {
                    let place = (DVec3::from_array(p.map(f64::from)) + shift).as_vec3().to_array();
                    let flag = match (fiber.len(), at + 1 == fiber.len()) {
                        (1, _) => ALONE,
                        (_, true) => LAST,
                        _ => 0,
                    };
                    TubePoint { place, what: number | flag }
                }));
            }
        }
        let count = packed_points.len() as u32;
        if packed_points.is_empty() {
            packed_points.push(TubePoint { what: LAST, ..TubePoint::default() });
        }
        if fiber_table.is_empty() {
            fiber_table.push(Fiber::default());
        }
        let shown = Self {
            sets: sets.iter().map(|&s| Arc::clone(s)).collect(),
            origin_mm,
            points: gpu.storage("ShownSets::points", bytemuck::cast_slice(&packed_points)),
            count,
            fibers: gpu.storage("ShownSets::fibers", bytemuck::cast_slice(&fiber_table)),
        };
        gpu.check()?;
        Ok(shown)
    }
}

impl Targets {
    fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, RenderError> {
        Ok(Self {
            size,
            raster: RasterTargets::reuse(&mut None, gpu, Some(size), 1)?,
            shades: gpu.buffer("Targets::shades", u64::from(size[0]) * u64::from(size[1]) * 4, WRITTEN),
        })
    }
}

/// The uniform for points relative to `origin_mm`.
fn uniform(origin_mm: DVec3, camera: &Camera, reference_mm: f64, view: &View) -> TubesUniform {
    let [right, up, back] = camera.axes();
    let single = |v: DVec3| v.as_vec3().to_array();
    TubesUniform {
        right: single(right),
        least_px: (LEAST_PX * f64::from(view.line_scale)) as f32,
        up: single(up),
        unused_a: 0.0,
        away: single(-back),
        unused_b: 0.0,
        origin: single(in_camera_space(camera, reference_mm, origin_mm)),
        unused_c: 0.0,
    }
}
