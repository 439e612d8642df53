//! The boundary's repulsive force for core's curve skeleton, summed on the graphics device: exactly, every
//! charge on every place.
//!
//! Work is split into dispatches of at most `MOST_PLACES` × `MOST_CHARGES` pairs, so that no driver's
//! watchdog ends one and frames can be drawn in between.

#[cfg(test)]
mod tests;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use glioscope_core::{
    Progress,
    skeleton::{ForceSource, ForceTask, Refused},
};

use crate::device::{Gpu, RenderError, buffers::WRITTEN, pipelines::compute_pipeline};

/// The shader.
const SHADER: &str = "skeleton/force";
/// Threads of a workgroup, as in the shader.
const TILE: u32 = 128;
/// Most places of one dispatch.
const MOST_PLACES: usize = 1 << 16;
/// Most charges of one dispatch.
const MOST_CHARGES: usize = 1 << 12;
/// Most pairs of place and charge; more are left to the tree, whose work grows as places times a logarithm.
const MOST_PAIRS: u64 = 1 << 34;
/// Bits of a coordinate: differences of two fit in 32 signed bits.
const BITS: i32 = 29;
/// Fewest fractional bits of a coordinate.
const FRACTION_BITS: i32 = 13;

#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct ForceWork {
    pub first_charge: u32,
    pub end_charge: u32,
    pub places: u32,
    pub is_first: u32,
    pub length_of_unit: f32,
    pub unused_a: u32,
    pub unused_b: u32,
    pub unused_c: u32,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Point {
    pub at: [i32; 3],
    pub weight: f32,
}

/// Sums a boundary's force on a graphics device. Each sum compiles its pipeline and creates its buffers:
/// 16 bytes per charge and 2 MiB for places.
#[derive(Clone, Debug)]
pub struct ForceField {
    gpu: Gpu,
}

/// Fixed-point coordinates in units of a small power of two, from the centre of all places and charges.
struct Scale {
    middle: DVec3,
    units: f64,
}

impl Scale {
    fn of(task: &ForceTask<'_>) -> Result<Self, String> {
        let all = || task.charges.iter().map(|c| c.at).chain(task.places.iter().copied());
        let (lo, hi) =
            all().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let size = hi - lo;
        if !all().all(|p| p.is_finite()) {
            return Err("found places that are no numbers".into());
        }
        let whole_bits = size.max_element().max(1.0).log2().ceil() as i32;
        if BITS - whole_bits < FRACTION_BITS {
            return Err(format!(
                "found a mask {:.0} finest spacings long, expected at most {} on the graphics device",
                size.max_element(),
                1 << (BITS - FRACTION_BITS)
            ));
        }
        // The weakest force of interest is at the deepest place: its power must not underflow f32.
        let deepest = size.min_element() * 0.5;
        let limit = 10f64.powf(32.0 / f64::from(task.exponent + 1));
        if deepest > limit {
            return Err(format!(
                "found a mask {deepest:.0} finest spacings deep, expected at most {limit:.0} for exponent {} on \
                 the graphics device",
                task.exponent
            ));
        }
        Ok(Self { middle: (lo + hi) * 0.5, units: 2f64.powi(BITS - whole_bits) })
    }

    fn point(&self, at: DVec3, weight: f64) -> Point {
        let at = ((at - self.middle) * self.units).round().to_array().map(|x| x as i32);
        Point { at, weight: weight as f32 }
    }
}

impl ForceField {
    /// Compiles the shader.
    ///
    /// # Errors
    /// [`RenderError::Shader`] for a file that doesn't compose.
    pub fn new(gpu: &Gpu) -> Result<Self, RenderError> {
        // Composed here so that an error is known before the first sum.
        glioscope_shaders::compose(SHADER)?;
        Ok(Self { gpu: gpu.clone() })
    }

    fn sum(&self, task: &ForceTask<'_>, scale: &Scale, progress: &Progress) -> Result<Vec<DVec3>, Refused> {
        let failed = |e: RenderError| Refused::Because(e.to_string());
        let gpu = &self.gpu;
        let exponent = [("exponent", f64::from(task.exponent))];
        let pipeline = compute_pipeline(gpu, SHADER, None, &exponent).map_err(failed)?;
        let most = task.places.len().min(MOST_PLACES);
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = |label, count: usize, of: usize, usage| gpu.buffer(label, (count * of) as u64, usage);
        let work = gpu.uniform::<ForceWork>("ForceField::work");
        let charges = buffer("ForceField::charges", task.charges.len(), size_of::<Point>(), storage);
        let places = buffer("ForceField::places", most, size_of::<Point>(), storage);
        let forces_sum = buffer("ForceField::forces", most, size_of::<[f32; 4]>(), WRITTEN);
        let points: Vec<Point> = task.charges.iter().map(|c| scale.point(c.at, c.weight)).collect();
        gpu.queue.write_buffer(&charges, 0, bytemuck::cast_slice(&points));
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(SHADER),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[&work, &charges, &places, &forces_sum]
                .map(|b| b.as_entire_binding())
                .into_iter()
                .enumerate()
                .map(|(n, resource)| wgpu::BindGroupEntry { binding: n as u32, resource })
                .collect::<Vec<_>>(),
        });
        let mut forces = Vec::with_capacity(task.places.len());
        for chunk in task.places.chunks(MOST_PLACES) {
            let points: Vec<Point> = chunk.iter().map(|&p| scale.point(p, 0.0)).collect();
            gpu.queue.write_buffer(&places, 0, bytemuck::cast_slice(&points));
            for first in (0..task.charges.len()).step_by(MOST_CHARGES) {
                let part = ForceWork {
                    first_charge: first as u32,
                    end_charge: (first + MOST_CHARGES).min(task.charges.len()) as u32,
                    places: chunk.len() as u32,
                    is_first: u32::from(first == 0),
                    length_of_unit: (1.0 / scale.units) as f32,
                    ..ForceWork::default()
                };
                gpu.queue.write_buffer(&work, 0, bytemuck::bytes_of(&part));
                let mut encoder = gpu
                    .device
                    .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("ForceField") });
                {
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: Some(SHADER),
                        timestamp_writes: None,
                    });
                    pass.set_pipeline(&pipeline);
                    pass.set_bind_group(0, &group, &[]);
                    pass.dispatch_workgroups(part.places.div_ceil(TILE), 1, 1);
                }
                let submission = gpu.queue.submit([encoder.finish()]);
                let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
                gpu.device.poll(wait).map_err(|e| failed(RenderError::Device(e.to_string())))?;
                progress.check().map_err(Refused::Cancelled)?;
            }
            let bytes = (chunk.len() * size_of::<[f32; 4]>()) as u64;
            let read = gpu.read_buffers(&[(&forces_sum, 0, bytes)]).map_err(failed)?;
            let sums: Vec<[f32; 4]> =
                read.first().map(|b| bytemuck::pod_collect_to_vec(b)).unwrap_or_default();
            forces.extend(sums.into_iter().map(|[x, y, z, r2]| {
                let scaled = f64::from(r2).sqrt().powi(task.exponent as i32);
                DVec3::new(f64::from(x), f64::from(y), f64::from(z)) * scaled
            }));
            progress.advance(chunk.len() as u64).map_err(Refused::Cancelled)?;
        }
        Ok(forces)
    }
}

impl ForceSource for ForceField {
    fn describe(&self) -> String {
        format!("graphics device, exact sum ({})", self.gpu.adapter.get_info().name)
    }

    fn forces(&self, task: &ForceTask<'_>, progress: &Progress) -> Result<Vec<DVec3>, Refused> {
        let pairs = task.charges.len() as u64 * task.places.len() as u64;
        if pairs > MOST_PAIRS {
            return Err(Refused::Because(format!(
                "found {pairs} pairs of place and charge, expected at most {MOST_PAIRS} for the graphics device"
            )));
        }
        if pairs == 0 {
            return Err(Refused::Because("found no charge or no place".into()));
        }
        let bytes =
            size_of::<Point>() as u64 * task.charges.len().max(task.places.len().min(MOST_PLACES)) as u64;
        self.gpu.check_size("the skeleton's charges", bytes).map_err(|e| Refused::Because(e.to_string()))?;
        let scale = Scale::of(task).map_err(Refused::Because)?;
        progress.expect(task.places.len() as u64);
        // Error scopes keep this sum's errors from being reported for a frame.
        let memory = self.gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let forces = self.sum(task, &scale, progress);
        let errors = [pollster::block_on(validation.pop()), pollster::block_on(memory.pop())];
        if let Some(error) = errors.into_iter().flatten().next() {
            return Err(Refused::Because(format!("the graphics device failed: {error}")));
        }
        forces
    }
}

/// For the layout test.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(
        ForceWork, "ForceWork": first_charge, end_charge, places, is_first, length_of_unit, unused_a, unused_b,
        unused_c
    ),
    crate::layouts::layout!(Point, "Point": at, weight),
];
