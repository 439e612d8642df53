//! All 3D views of the default layout in a window of 1920x1080 pixels while they turn: frames a second, and how long the
//! host is busy until a frame is submitted. See docs/performance.md.

use std::{path::PathBuf, time::Instant};

use clap::Args;
use glam::DQuat;
use glioscope_core::optics::Camera;
use glioscope_render::{
    Gpu, LightingMode, Renderer, View3d,
    light::{self, Auto},
    views::{closeup::Closeup, context::Context, ellipsoids::Ellipsoids},
};
use strum::VariantArray;

use super::views;
use crate::{
    Outcome,
    clock::{load_average, median, ms_since},
    open_gpu, print_line,
};

/// Arguments of `together`.
#[derive(Debug, Args)]
pub struct TogetherArguments {
    /// Folder with glioma-5-algorithms
    #[arg(default_value = "../shared/data")]
    data: PathBuf,
    /// Frames of the rotation; the first nine compile, upload and find the quality
    #[arg(long, default_value_t = 60)]
    pictures: usize,
    /// Use only the software graphics adapter
    #[arg(long)]
    software: bool,
}

/// Panes of the closeup, the context view and the ellipsoids in the default layout, without menus and controls.
const PANES_PX: [[u32; 2]; 3] = [[774, 540], [774, 430], [619, 380]];

/// Share of a frame's time that the views have in the window without a graphics card.
const VIEWS_SHARE: f64 = 0.6;

struct Turning<V: View3d> {
    scene: V::Scene,
    renderer: Renderer<V>,
    auto: Auto,
    size_px: [u32; 2],
}

impl<V: View3d> Turning<V> {
    fn new(gpu: &Gpu, scene: V::Scene, mode: LightingMode, size_px: [u32; 2]) -> Outcome<Self> {
        Ok(Self { scene, renderer: Renderer::new(gpu)?, auto: Auto::of(mode), size_px })
    }

    /// Submits a frame. Adapts the quality as the window does.
    fn draw(&mut self, gpu: &Gpu, mode: LightingMode, turn: impl Fn(&mut V::Scene)) -> Outcome<()> {
        turn(&mut self.scene);
        let quality = light::at_cost(mode, self.auto.cost());
        let start = Instant::now();
        self.renderer.render(gpu, &self.scene, &quality, self.size_px)?;
        if gpu.is_software() {
            gpu.wait()?;
        }
        let ms = ms_since(start);
        let of_frame = if gpu.is_software() { ms * PANES_PX.len() as f64 / VIEWS_SHARE } else { ms };
        self.auto.adapt(of_frame);
        Ok(())
    }
}

fn turn(camera: &mut Camera) {
    camera.world_from_camera *= DQuat::from_rotation_y(0.05);
}

/// Prints the table.
///
/// # Errors
/// When the case can't be read, or a frame can't be drawn.
pub fn run(arguments: &TogetherArguments) -> Outcome<()> {
    let gpu = open_gpu(arguments.software)?;
    let load = load_average().map_or("unknown".to_owned(), |l| format!("{l:.1}"));
    print_line(format!("{}; panes of {PANES_PX:?} pixels; load {load}\n", gpu.describe()))?;
    print_line(
        "| lighting mode | frames a second | median ms | fastest to slowest | until submitted, median ms | \
         cost: closeup, context, ellipsoids |\n|---|---:|---:|---:|---:|---|",
    )?;
    let glioma = views::glioma(&arguments.data)?;
    let glioma = glioma.time_points.first().ok_or("no date")?;
    let [closeup, context, ellipsoids] = PANES_PX;
    for &mode in <LightingMode as VariantArray>::VARIANTS {
        let mut closeup = Turning::<Closeup>::new(&gpu, views::closeup_lens(glioma)?, mode, closeup)?;
        let mut context = Turning::<Context>::new(&gpu, views::context_surface(glioma)?, mode, context)?;
        let mut ellipsoids = Turning::<Ellipsoids>::new(&gpu, views::diagram(20), mode, ellipsoids)?;
        let (mut frames_ms, mut submits_ms) = (Vec::new(), Vec::new());
        for _ in 0..arguments.pictures + 9 {
            let start = Instant::now();
            closeup.draw(&gpu, mode, |scene| turn(&mut scene.camera))?;
            context.draw(&gpu, mode, |scene| turn(&mut scene.camera))?;
            ellipsoids.draw(&gpu, mode, |scene| turn(&mut scene.camera))?;
            submits_ms.push(ms_since(start));
            gpu.wait()?;
            frames_ms.push(ms_since(start));
        }
        let (frames_ms, submits_ms) = (&frames_ms[9..], &submits_ms[9..]);
        let fastest = frames_ms.iter().copied().fold(f64::INFINITY, f64::min);
        let slowest = frames_ms.iter().copied().fold(0.0, f64::max);
        let submitted =
            if gpu.is_software() { "–".to_owned() } else { format!("{:.2}", median(submits_ms)) };
        print_line(format!(
            "| {} | {:.0} | {:.2} | {fastest:.1} to {slowest:.1} | {submitted} | {:.3}, {:.3}, {:.3} |",
            mode.name(),
            1e3 / median(frames_ms),
            median(frames_ms),
            closeup.auto.cost(),
            context.auto.cost(),
            ellipsoids.auto.cost(),
        ))?;
    }
    Ok(())
}
