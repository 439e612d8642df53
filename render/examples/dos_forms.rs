//! One pass a slice against the paper's two, and both against a copy of the bytes that must move:
//! `dos_forms [quick] [large] [real]`. Prints the table of docs/performance.md. The forms and the copy
//! take turns in one process; ratios are medians of the ratios of neighbouring runs.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "an example: it ends at the first error, and prints"
)]

use std::{sync::Arc, time::Instant};

use glam::DVec3;
use glioscope_core::Grid;
use glioscope_render::{
    AdapterPreference, Camera, Gpu, Projection,
    dos::{DosRenderer, DosSettings, Form, Kernel, Variant},
    occlusion::{Filter, OpticalVolume, Table},
};

/// What is compared, the first with all others.
const FORMS: [Form; 5] = [
    Form::OnePass,
    Form::TwoPasses { folded: false },
    Form::TwoPasses { folded: true },
    Form::Tiles(2),
    Form::Tiles(4),
];
/// Reads and writes 20 bytes a pixel each way: what the eye and occlusion buffers move a slice.
const COPY: &str = "
@group(0) @binding(0) var<storage, read> a: array<f32>;
@group(0) @binding(1) var<storage, read_write> b: array<f32>;
@group(0) @binding(2) var<storage, read_write> eye: array<vec4<f32>>;
@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) n: vec3<u32>) {
    let at = id.y * n.x * 16u + id.x;
    b[at] = a[at];
    eye[at] = eye[at].yzwx;
}";
/// Bytes of a pixel's eye and occlusion, read and written.
const MOVED: f64 = 40.0;
/// Bytes that a sample of the volume asks for: eight voxels and two entries of the table.
const SAMPLE: f64 = 64.0;

/// Three soft balls in a cube of `n`³ voxels of 1 mm.
fn soft(n: usize) -> OpticalVolume {
    let grid = Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::splat(-(n as f64 - 1.0) / 2.0)).unwrap();
    let values = (0..n * n * n)
        .map(|l| {
            let at =
                DVec3::from_array([l % n, l / n % n, l / n / n].map(|v| v as f64)) / (n as f64 - 1.0) - 0.5;
            let ball = |c: DVec3, r: f64| (1.0 - (at - c).length() / r).max(0.0);
            (ball(DVec3::new(-0.15, 0.05, 0.1), 0.32)
                + ball(DVec3::new(0.2, -0.1, 0.25), 0.2)
                + ball(DVec3::new(0.05, 0.1, -0.25), 0.4)) as f32
        })
        .collect();
    let rows = [[0.9, 0.5, 0.3, 0.0], [0.9, 0.6, 0.3, 0.06], [0.3, 0.7, 0.9, 0.25], [0.3, 0.7, 0.9, 0.5]];
    OpticalVolume::new(grid, values, Table::new(0.0, 0.8, &rows).unwrap(), Filter::Linear, None).unwrap()
}

/// The copy, for pictures of one size.
struct Copy {
    pipeline: wgpu::ComputePipeline,
    groups: [wgpu::BindGroup; 2],
    tiles: u32,
}

impl Copy {
    fn new(gpu: &Gpu, side: u32) -> Self {
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("copy"),
            source: wgpu::ShaderSource::Wgsl(COPY.into()),
        });
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("copy"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let buffer = |bytes: u64| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("copy"),
                size: bytes * u64::from(side) * u64::from(side),
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let (a, b, eye) = (buffer(4), buffer(4), buffer(16));
        let groups = [(&a, &b), (&b, &a)].map(|(from, to)| {
            let entries = [(0, from), (1, to), (2, &eye)]
                .map(|(binding, b)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() });
            gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("copy"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            })
        });
        Self { pipeline, groups, tiles: side / 16 }
    }

    fn run(&self, gpu: &Gpu, times: u32) {
        let mut encoder =
            gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("copy") });
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("copy"),
                timestamp_writes: None,
            });
            pass.set_pipeline(&self.pipeline);
            for i in 0..times {
                pass.set_bind_group(0, &self.groups[i as usize % 2], &[]);
                pass.dispatch_workgroups(self.tiles, self.tiles, 1);
            }
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.wait().unwrap();
    }
}

/// CPU time of all threads of this process so far, milliseconds; `None` where the system doesn't tell.
fn cpu_ms() -> Option<f64> {
    let mut sum = 0.0;
    for thread in std::fs::read_dir("/proc/self/task").ok()?.flatten() {
        if let Ok(text) = std::fs::read_to_string(thread.path().join("schedstat")) {
            sum += text.split(' ').next()?.parse::<f64>().ok()? * 1e-6;
        }
    }
    Some(sum)
}

/// Wall and CPU milliseconds.
fn timed(run: impl FnOnce()) -> [f64; 2] {
    let (cpu, start) = (cpu_ms(), Instant::now());
    run();
    let wall = start.elapsed().as_secs_f64() * 1e3;
    [wall, cpu.zip(cpu_ms()).map_or(f64::NAN, |(a, b)| b - a)]
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn load() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().unwrap_or("unknown").to_owned()
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| args.iter().any(|a| a == word);
    let preference = if has("real") { AdapterPreference::RealFirst } else { AdapterPreference::SoftwareOnly };
    let gpu = Gpu::headless(preference).unwrap();
    let runs = if has("quick") { 3 } else { 7 };
    let n = 64;
    let volume = Arc::new(soft(n));
    let camera =
        Camera::fit(DVec3::ZERO, 0.55 * n as f64, Camera::orientation(31.0, 20.0), Projection::Perspective);
    println!("{}; {n}^3 voxels, load before the run {}, median of {runs}\n", gpu.describe(), load());
    println!(
        "| size | aperture | slices | footprint | grid | texels | one pass (ms) | as published / one | folded, too / one | 2 together / one | 4 together / one | ms a slice | ns a sample | kB a slice, one | two | one / copy | load |"
    );
    println!("|---:|---:|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|");
    let (exact, near) = (Variant::PaperExact, Variant::PaperApproximate);
    let mut rows: Vec<(u32, f64, f64, Variant, u32)> = Vec::new();
    for (side, aperture_deg, slice_mm, variants) in [
        (256, 50.0, 0.2, &[near][..]),
        (128, 50.0, 0.4, &[near, exact][..]),
        (128, 50.0, 1.0, &[near][..]),
        (128, 85.0, 0.5, &[near, exact][..]),
    ] {
        for variant in variants {
            rows.extend([2, 5, 13].map(|grid| (side, aperture_deg, slice_mm, *variant, grid)));
        }
    }
    if has("large") {
        rows.extend([(512, 0.1), (1024, 0.05)].map(|(side, slice_mm)| (side, 50.0, slice_mm, near, 2)));
    }
    let mut dos = DosRenderer::new(&gpu).unwrap();
    for (side, aperture_deg, slice_mm, variant, grid) in rows {
        let s = DosSettings { variant, aperture_deg, grid, slice_mm, ..DosSettings::default() };
        let mut draw = |form| {
            let plan = dos.render(&gpu, &volume, &camera, [side; 2], &s, form, false).unwrap();
            gpu.wait().unwrap();
            plan
        };
        let plan = draw(Form::OnePass);
        for form in FORMS {
            draw(form);
        }
        let copy = Copy::new(&gpu, side);
        copy.run(&gpu, 2);
        let slices = plan.slices();
        let times: Vec<[[f64; 2]; FORMS.len() + 1]> = (0..runs)
            .map(|i| {
                let mut out = [[0.0; 2]; FORMS.len() + 1];
                // Which one goes first changes.
                for n in 0..FORMS.len() {
                    let n = (n + i) % FORMS.len();
                    out[n] = timed(|| drop(draw(FORMS[n])));
                }
                out[FORMS.len()] = timed(|| copy.run(&gpu, slices));
                out
            })
            .collect();
        let ms = |what: usize| median(times.iter().map(|t| t[what][0]));
        let ratio =
            |a: usize, b: usize, clock: usize| median(times.iter().map(|t| t[a][clock] / t[b][clock]));
        let texels = plan.steps.iter().map(|step| plan.texels(step));
        let radii = plan.steps.iter().map(|step| match step.kernel {
            Kernel::Disc { radius_px, .. } => radius_px,
            Kernel::Lattice { .. } => f64::NAN,
        });
        let mean = texels.clone().map(f64::from).sum::<f64>() / plan.steps.len() as f64;
        let samples = f64::from(side * side);
        let name = if variant == exact { "exact" } else { "approximate" };
        let compared: Vec<String> =
            (1..FORMS.len()).map(|n| format!("{:.2} ({:.2})", ratio(n, 0, 0), ratio(n, 0, 1))).collect();
        println!(
            "| {side}x{side} | {aperture_deg}° | {slices} | {name}, {:.2} to {:.2} px | {grid}x{grid} | {mean:.0} | {:.1} | {} | {:.3} | {:.2} | {:.0} | {:.0} | {:.1} | {} |",
            radii.clone().fold(f64::INFINITY, f64::min),
            radii.fold(0.0, f64::max),
            ms(0),
            compared.join(" | "),
            ms(0) / f64::from(slices),
            ms(0) / f64::from(slices) / samples * 1e6,
            samples * (MOVED + SAMPLE + 4.0 * (mean - 1.0)) / 1e3,
            samples * (MOVED + 4.0 + 2.0 * SAMPLE + 4.0 * (mean - 1.0)) / 1e3,
            ratio(0, FORMS.len(), 0),
            load(),
        );
    }
}
