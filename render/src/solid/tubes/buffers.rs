//! Tubes on the device: points written once per list of shown sets, targets created once per size, the uniform written
//! once per frame.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::optics::Camera;

use crate::{
    device::{Gpu, RenderError, buffers::WRITTEN, raster::RasterTargets, runner::Drawing},
    scene::Rgb,
    solid::{
        tubes::{DrawnTubes, TubeLook, TubeSet, values::ValueKind},
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
/// Flags of what a fibre is coloured by in [`Fiber::color`], as in tubes/merge; 0: by its own colour in the low bytes.
const BY_DIRECTION: u32 = 0x100_0000;
/// The low bytes are then the number of its scale.
const BY_SCALAR: u32 = 0x200_0000;
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
    looks: Vec<(TubeLook, f64)>,
    /// Common origin of all points, world millimetres.
    origin_mm: DVec3,
    points: wgpu::Buffer,
    count: u32,
    /// A word for each point; `None` where no set is coloured by values.
    values: Option<wgpu::Buffer>,
    looked: Looked,
}

/// What the looks of the shown sets are on the device.
struct Looked {
    fibers: wgpu::Buffer,
    /// Scales of scalars; `None` where there are none.
    scales: Option<wgpu::Buffer>,
}

/// Targets of the tube passes.
struct Targets {
    size: [u32; 2],
    /// Whether the picture says where on its fibre each pixel is.
    is_located: bool,
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
        let drawn: Vec<&DrawnTubes> = tubes.iter().filter(|t| t.draws()).collect();
        let is_same = |s: &ShownSets| {
            s.sets.len() == drawn.len() && s.sets.iter().zip(&drawn).all(|(a, b)| Arc::ptr_eq(a, &b.set))
        };
        let looks: Vec<_> = drawn.iter().map(|t| (t.look, t.radius_mm())).collect();
        let shown = match shown.filter(is_same) {
            Some(shown) if shown.looks == looks => shown,
            Some(shown) => {
                let looked = Looked::new(gpu, &drawn)?;
                ShownSets { looks, looked, ..shown }
            }
            None => ShownSets::new(gpu, &drawn, looks)?,
        };
        let is_located = shown.values.is_some();
        let targets = match targets.filter(|t| (t.size, t.is_located) == (view.size, is_located)) {
            Some(targets) => targets,
            None => Targets::new(gpu, view.size, is_located)?,
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
            (28, shown.looked.fibers.as_entire_binding()),
        ];
        Some((drawing, entries))
    }

    /// The colour target of the raster pass; `None` without tubes.
    pub fn picture(&self) -> Option<&wgpu::TextureView> {
        self.targets.as_ref().map(|t| &t.raster.picture)
    }

    /// Colour and radius of each fibre.
    pub fn fibers(&self) -> &wgpu::Buffer {
        self.shown.as_ref().map_or(&self.placeholder, |s| &s.looked.fibers)
    }

    /// Whether some fibres are coloured by values, so that their passes are those that locate pixels on them.
    pub fn has_values(&self) -> bool {
        self.shown.as_ref().is_some_and(|s| s.values.is_some())
    }

    /// A word for each point, and the scales of scalars: placeholders where there are none.
    pub fn values(&self) -> [&wgpu::Buffer; 2] {
        let shown = self.shown.as_ref();
        let values = shown.and_then(|s| s.values.as_ref());
        let scales = shown.and_then(|s| s.looked.scales.as_ref());
        [values, scales].map(|buffer| buffer.unwrap_or(&self.placeholder))
    }

    /// Shaded colour and facing of the tube at each pixel, packed; 0 where there is none.
    pub fn shades(&self) -> &wgpu::Buffer {
        self.targets.as_ref().map_or(&self.placeholder, |t| &t.shades)
    }
}

impl ShownSets {
    fn new(gpu: &Gpu, drawn: &[&DrawnTubes], looks: Vec<(TubeLook, f64)>) -> Result<Self, RenderError> {
        let sets: Vec<&Arc<TubeSet>> = drawn.iter().map(|t| &t.set).collect();
        let fibers: usize = sets.iter().map(|s| s.fiber_count()).sum();
        if fibers > MOST_FIBERS {
            return Err(RenderError::Scene(format!("{fibers} fibres (at most {MOST_FIBERS})")));
        }
        let points: usize = sets.iter().map(|s| s.point_count()).sum();
        gpu.check_size("the fibre tracts", (points.max(fibers) * size_of::<TubePoint>()) as u64)?;
        let origin_mm = sets.iter().max_by_key(|s| s.point_count()).map_or(DVec3::ZERO, |s| s.origin_mm());
        let has_values = sets.iter().any(|s| s.kind != ValueKind::Nothing);
        let mut packed_points = Vec::with_capacity(points.max(1));
        let mut values: Vec<u32> = Vec::with_capacity(if has_values { points + 1 } else { 0 });
        let mut number = 0_u32;
        for set in &sets {
            // In f64: an offset of 1e6 mm then costs no precision.
            let shift = set.origin_mm() - origin_mm;
            for n in 0..set.fiber_count() {
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
                number += 1;
            }
            if has_values {
                values.extend_from_slice(&set.values);
                values.resize(packed_points.len(), 0);
            }
        }
        let count = packed_points.len() as u32;
        if packed_points.is_empty() {
            packed_points.push(TubePoint { what: LAST, ..TubePoint::default() });
        }
        // The word behind a point's own is read, too.
        let values = has_values.then(|| {
            values.push(0);
            gpu.storage("ShownSets::values", bytemuck::cast_slice(&values))
        });
        let shown = Self {
            looks,
            origin_mm,
            points: gpu.storage("ShownSets::points", bytemuck::cast_slice(&packed_points)),
            count,
            values,
            looked: Looked::new(gpu, drawn)?,
            sets: sets.into_iter().map(Arc::clone).collect(),
        };
        gpu.check()?;
        Ok(shown)
    }
}

impl Looked {
    fn new(gpu: &Gpu, drawn: &[&DrawnTubes]) -> Result<Self, RenderError> {
        let fibers = drawn.iter().map(|t| t.set.fiber_count()).sum::<usize>();
        let mut table: Vec<Fiber> = Vec::with_capacity(fibers.max(1));
        let mut scales: Vec<u32> = Vec::new();
        for tubes in drawn {
            let DrawnTubes { set, look, .. } = tubes;
            let color = match set.kind {
                ValueKind::Nothing => packed_rgb(look.color),
                ValueKind::Direction => BY_DIRECTION,
                ValueKind::Scalar => {
                    let number = (scales.len() / SCALE_WORDS) as u32;
                    scales.extend(scale(look));
                    BY_SCALAR | number
                }
            };
            let radius_mm = tubes.radius_mm() as f32;
            table.extend(std::iter::repeat_n(Fiber { color, radius_mm }, set.fiber_count()));
        }
        if table.is_empty() {
            table.push(Fiber::default());
        }
        let scales_buffer = || gpu.storage("Looked::scales", bytemuck::cast_slice(&scales));
        let looked = Self {
            fibers: gpu.storage("Looked::fibers", bytemuck::cast_slice(&table)),
            scales: (!scales.is_empty()).then(scales_buffer),
        };
        gpu.check()?;
        Ok(looked)
    }
}

/// Words of a scale: its low end, colours per unit, and 256 colours.
const SCALE_WORDS: usize = 258;

fn packed_rgb([r, g, b]: Rgb) -> u32 {
    u32::from(r) | u32::from(g) << 8 | u32::from(b) << 16
}

/// The scale of a scalar; with a range of no width, every value has the first colour.
fn scale(look: &TubeLook) -> impl Iterator<Item = u32> {
    let [low, high] = look.range;
    let per_unit = 1.0 / (high - low);
    let per_unit = if per_unit.is_finite() { per_unit } else { 0.0 };
    let colors = look.map.table().into_iter().map(packed_rgb);
    [low.to_bits(), per_unit.to_bits()].into_iter().chain(colors)
}

impl Targets {
    fn new(gpu: &Gpu, size: [u32; 2], is_located: bool) -> Result<Self, RenderError> {
        Ok(Self {
            size,
            is_located,
            raster: RasterTargets::reuse(&mut None, gpu, Some(size), (1, is_located))?,
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
