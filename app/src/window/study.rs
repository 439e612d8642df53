//! The window of the study of perception.

use std::time::{Duration, Instant};

use egui::{CentralPanel, Frame, Ui, ViewportCommand};
use glioscope_render::Gpu;

use super::run::native_options;
use crate::{
    cpu_paint,
    error::AppError,
    study::{
        Page, Study,
        pictures::Pictures,
        view::{StudyView, pressed},
    },
    theme::{self, Tokens},
    world::jobs::Waker,
};

/// A study on the screen.
pub struct StudyApp {
    /// Its course.
    pub study: Study,
    view: StudyView,
    pictures: Pictures,
    started: Instant,
    /// Why nothing more can be drawn.
    failed: Option<String>,
}

impl StudyApp {
    /// Begins to draw the pictures of what isn't answered yet.
    pub fn new(study: Study, gpu: &Gpu, ctx: &egui::Context) -> Self {
        theme::install(ctx);
        ctx.set_theme(if study.settings().dark { egui::Theme::Dark } else { egui::Theme::Light });
        let trials = study.trials()[study.index()..].to_vec();
        let pictures = Pictures::start(gpu, study.settings(), trials, Waker::of(ctx));
        Self { view: StudyView::new(&study), pictures, study, started: Instant::now(), failed: None }
    }

    fn now_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    /// A frame: keys first, by the page that the participant saw.
    pub fn draw(&mut self, ui: &mut Ui) {
        let now_s = self.now_s();
        for (key, repeats) in pressed(ui) {
            self.study.press(key, repeats, now_s);
            if key == egui::Key::Escape || self.failed.is_some() {
                ui.ctx().send_viewport_cmd(ViewportCommand::Close);
            }
        }
        if self.study.prepared().is_none() && self.study.trial().is_some() && self.failed.is_none() {
            match self.pictures.next() {
                Some(Ok(prepared)) => self.study.prepare(prepared),
                Some(Err(error)) => self.failed = Some(error.to_string()),
                None => {}
            }
        }
        if let Some(left) = self.study.tick(now_s) {
            ui.ctx().request_repaint_after(Duration::from_secs_f64(left));
        }
        self.pictures.set_shown(matches!(self.study.page(), Page::Shown { .. }));
        let ground = Tokens::in_ui(ui).panel;
        CentralPanel::default().frame(Frame::new().fill(ground)).show(ui, |ui| match &self.failed {
            Some(why) => crate::views::draw::message(ui, ui.available_rect_before_wrap(), why),
            None => {
                if self.view.show(ui, &self.study) {
                    let now_s = self.started.elapsed().as_secs_f64();
                    self.study.drawn(now_s);
                }
            }
        });
    }
}

impl eframe::App for StudyApp {
    fn ui(&mut self, ui: &mut Ui, _: &mut eframe::Frame) {
        self.draw(ui);
    }
}

/// Opens the study on the whole screen and returns when it is closed.
///
/// # Errors
/// [`AppError`] without a display or a graphics adapter, with what to install.
pub fn run(study: Study, software: bool) -> Result<(), AppError> {
    let mut options = native_options(software);
    options.viewport = egui::ViewportBuilder::default()
        .with_title("Glioscope: study")
        .with_app_id("glioscope")
        .with_fullscreen(true);
    let create = move |cc: &eframe::CreationContext<'_>| -> Result<Box<dyn eframe::App>, _> {
        let state = cc.wgpu_render_state.as_ref().ok_or("no graphics adapter")?;
        let gpu = Gpu::from_parts(state.adapter.clone(), state.device.clone(), state.queue.clone());
        if gpu.is_software() {
            cpu_paint::install(&cc.egui_ctx, &gpu, state.target_format);
        }
        Ok(Box::new(StudyApp::new(study, &gpu, &cc.egui_ctx)))
    };
    eframe::run_native("Glioscope: study", options, Box::new(create))
        .map_err(|e| AppError::Window(e.to_string()))
}
