//! The pictures of a study: each trial's scene in its light, drawn on a thread ahead of the participant.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, SyncSender, TryRecvError, sync_channel},
    },
    thread,
    time::Duration,
};

use egui::ColorImage;
use glioscope_core::study::{Scene, Trial};
use glioscope_render::{
    CloseupRenderer, Gpu, LightingMode, MaskColors, Palette, Preset, RegionScene, RenderError, Rgb,
    light::{self, LIGHTS},
};

use super::{course::Settings, page::Prepared};
use crate::{
    error::AppError,
    model::{LightChoice, Shading},
    theme::Tokens,
    world::jobs::Waker,
};

/// Pictures that are ready at a time at most.
const AHEAD: usize = 12;
/// How often the thread looks whether a picture is still shown.
const LOOK: Duration = Duration::from_millis(10);
/// Colours of a scene, and of the two structures that are compared: alike in lightness, so that light shows form equally, and different
/// with every colour vision deficiency.
const COLORS: [Rgb; 3] = [[176, 168, 156], [109, 130, 182], [188, 109, 80]];

/// A light as the study shows it: smooth, so that the voxels' terraces draw no contour lines.
fn choice(mode: LightingMode, quality: Preset) -> LightChoice {
    let shading = Shading { smooth: true, ..Shading::default() };
    LightChoice { mode, preset: Some(quality), shading, ..LightChoice::default() }
}

/// The lights that are compared where none are named: those for reading that shade the smooth surface.
pub fn default_lights(quality: Preset) -> Vec<LightingMode> {
    let is_smooth = |mode: &LightingMode| light::shows_smooth(&choice(*mode, quality).at_rest());
    let is_for_reading = |mode: &LightingMode| *mode != LightingMode::PathTraced;
    LIGHTS.iter().map(|row| row.mode).filter(is_smooth).filter(is_for_reading).collect()
}

/// Draws the pictures of trials.
pub struct Painter {
    gpu: Gpu,
    renderer: CloseupRenderer,
    settings: Settings,
}

impl Painter {
    /// A painter with compiled pipelines.
    ///
    /// # Errors
    /// [`RenderError`] if the device can't run the passes.
    pub fn new(gpu: &Gpu, settings: &Settings) -> Result<Self, RenderError> {
        Ok(Self { gpu: gpu.clone(), renderer: CloseupRenderer::new(gpu)?, settings: settings.clone() })
    }

    /// The scene of a trial, and what is drawn of it.
    ///
    /// # Errors
    /// [`AppError`] without a scene.
    pub fn scene(&self, trial: &Trial) -> Result<(Scene, RegionScene), AppError> {
        let scene = self.settings.scene(trial)?;
        let regions = RegionScene {
            tumor: scene.regions(),
            selection: glioscope_core::Selection::all(),
            colors: MaskColors::new(Palette::default(), &COLORS.map(Some)),
            lens: None,
            camera: scene.camera(),
            background: Tokens::of(self.settings.dark).viewport_rgb(),
            silhouette: [0, 0, 0],
            plane: None,
        };
        Ok((scene, regions))
    }

    /// The renderer, whose last frame is that of the last picture.
    pub fn renderer(&self) -> &CloseupRenderer {
        &self.renderer
    }

    /// One picture.
    ///
    /// # Errors
    /// [`RenderError`] with the driver's message.
    pub fn picture(&mut self, scene: &RegionScene, mode: LightingMode) -> Result<ColorImage, RenderError> {
        let choice = choice(mode, self.settings.quality);
        let frame =
            self.renderer.render(&self.gpu, scene, &choice.at_rest(), [self.settings.picture_px; 2])?;
        let size = frame.size_px.map(|side| side as usize);
        Ok(ColorImage::from_rgba_unmultiplied(size, &frame.read_rgba(&self.gpu)?))
    }

    fn prepared(&mut self, trial: &Trial) -> Result<Prepared, AppError> {
        let (scene, regions) = self.scene(trial)?;
        let lights: Vec<LightingMode> = [Some(trial.light), trial.other]
            .into_iter()
            .flatten()
            .filter_map(|light| self.settings.lights.get(light).copied())
            .collect();
        let pictures = lights
            .into_iter()
            .map(|light| self.picture(&regions, light))
            .collect::<Result<_, RenderError>>()?;
        Ok(Prepared { scene, pictures })
    }
}

/// Pictures as they become ready, in the order of the trials.
pub struct Pictures {
    ready: Receiver<Result<Prepared, AppError>>,
    is_shown: Arc<AtomicBool>,
}

impl Pictures {
    /// Starts to draw the trials. On a software adapter nothing is begun while a picture is shown: drawing would delay the answer.
    pub fn start(gpu: &Gpu, settings: &Settings, trials: Vec<Trial>, waker: Waker) -> Self {
        let (send, ready) = sync_channel(AHEAD);
        let is_shown = Arc::new(AtomicBool::new(false));
        let (gpu, settings, shown) = (gpu.clone(), settings.clone(), is_shown.clone());
        let waits = gpu.is_software();
        // Without a thread the receiver finds the channel closed, and says so.
        let _ = thread::Builder::new().name("study pictures".into()).spawn(move || {
            draw_all(&gpu, &settings, &trials, &send, &|| waits && shown.load(Ordering::Relaxed), &waker);
        });
        Self { ready, is_shown }
    }

    /// Whether a picture is being looked at.
    pub fn set_shown(&self, is: bool) {
        self.is_shown.store(is, Ordering::Relaxed);
    }

    /// The next trial's, once it is ready.
    ///
    /// # Errors
    /// [`AppError`] if it can't be drawn.
    pub fn next(&self) -> Option<Result<Prepared, AppError>> {
        match self.ready.try_recv() {
            Ok(prepared) => Some(prepared),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                Some(Err(RenderError::Device("no thread draws pictures".into()).into()))
            }
        }
    }
}

fn draw_all(
    gpu: &Gpu,
    settings: &Settings,
    trials: &[Trial],
    send: &SyncSender<Result<Prepared, AppError>>,
    waits: &dyn Fn() -> bool,
    waker: &Waker,
) {
    let mut painter = match Painter::new(gpu, settings) {
        Ok(painter) => painter,
        Err(error) => {
            let _ = send.send(Err(error.into()));
            return waker.wake();
        }
    };
    for trial in trials {
        while waits() {
            thread::sleep(LOOK);
        }
        let prepared = painter.prepared(trial);
        let failed = prepared.is_err();
        // The window has closed.
        if send.send(prepared).is_err() || failed {
            break;
        }
        waker.wake();
    }
    waker.wake();
}
