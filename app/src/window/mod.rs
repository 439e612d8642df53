//! The window: menu, warnings, panes, status line. Views write commands; they are carried out after
//! everything is drawn.

pub mod about;
pub mod dialogs;
mod drop;
mod menu;
pub mod offscreen;
mod palette;
mod panes;
mod perform;
mod pictures;
mod prompts;
pub mod recent;
pub mod run;
mod warnings;

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use egui::{CentralPanel, Context, Panel, Rect, Ui};
use glioscope_render::{Gpu, RenderError};

use crate::{
    command::{Command, Commands, LookCommand, Workstation, listed},
    error::AppError,
    model::{CaseRef, PaneId},
    views::{Panes, Shared, pane::Input, view3d::Graphics},
    world::{
        Results,
        jobs::{Ask, Job, Waker},
    },
};
use dialogs::{Answer, Dialog, Purpose};
use palette::CommandPalette;
use panes::PaneArea;
use pictures::Pictures;
use recent::Recent;

/// Parts of the window that are open or not; never saved.
#[derive(Default)]
struct Open {
    /// The About box.
    about: bool,
    /// The list of warnings.
    warnings: bool,
    /// The box where a path is typed.
    path: Option<String>,
}

/// A picture of the window that is taken once everything is drawn; then the program quits.
struct Scripted {
    path: PathBuf,
    asked: bool,
    failed: Option<AppError>,
}

/// The program with a window.
pub struct GlioscopeApp {
    /// Document, world, history.
    pub work: Workstation,
    /// The graphics device; `None` without an adapter.
    pub graphics: Option<Graphics>,
    /// What views show, by pane.
    pub panes: Panes,
    /// What is derived from the case.
    pub results: Results,
    ask: Ask,
    open: Open,
    palette: CommandPalette,
    recent: Recent,
    dialog: Option<Dialog>,
    pane_rects: HashMap<PaneId, Rect>,
    pictures: Pictures,
    /// A file that is written on a worker: what is told when it is.
    export: Option<Job<&'static str>>,
    scripted: Option<Scripted>,
}

impl GlioscopeApp {
    /// A window on a workstation.
    ///
    /// # Errors
    /// [`RenderError`], when the device can't draw the closeup.
    pub fn new(work: Workstation, graphics: Option<Graphics>, recent: Recent) -> Result<Self, RenderError> {
        let panes = graphics.as_ref().map_or_else(|| Ok(Panes::default()), Panes::on)?;
        Ok(Self {
            work,
            panes,
            results: Results::new(graphics.as_ref().map(|graphics| graphics.gpu.clone())),
            graphics,
            ask: Ask::default(),
            open: Open::default(),
            palette: CommandPalette::default(),
            recent,
            dialog: None,
            pane_rects: HashMap::new(),
            pictures: Pictures::default(),
            export: None,
            scripted: None,
        })
    }

    /// Takes a picture of the window once the case is loaded and drawn in full, then quits.
    #[must_use]
    pub fn picture_and_quit(mut self, path: PathBuf) -> Self {
        self.scripted = Some(Scripted { path, asked: false, failed: None });
        self
    }

    /// For pictures and tests: results are waited for, and 3D views are drawn in full at once, never as a draft
    /// first.
    #[must_use]
    pub fn refined(mut self) -> Self {
        self.ask.wait = true;
        self
    }

    /// Where a pane was drawn last.
    pub fn pane_rect(&self, pane: PaneId) -> Option<Rect> {
        self.pane_rects.get(&pane).copied()
    }

    /// The graphics device.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.graphics.as_ref().map(|graphics| &graphics.gpu)
    }

    /// Whether a file is being written on a worker.
    pub fn is_exporting(&self) -> bool {
        self.export.is_some()
    }

    /// Draws everything and does what the user asked for.
    pub fn draw(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        self.ask.wake = Waker::of(&ctx);
        self.receive(&ctx);
        let mut out = Commands::default();
        shortcuts(&ctx, &mut out);
        let dropped_files = drop::dropped(&ctx, self.work.doc.is_some(), &mut out);
        Panel::top("menu").show(ui, |ui| menu::bar(ui, &self.work, &self.recent, &mut out));
        warnings::strip(ui, self.work.world.checks(), &mut self.open.warnings);
        Panel::bottom("status").show(ui, |ui| warnings::status(ui, &mut self.work, &mut out));
        let fill = egui::Frame::NONE.fill(ui.visuals().panel_fill);
        CentralPanel::default().frame(fill).show(ui, |ui| self.panes(ui, &mut out));
        self.palette.show(ui, &mut out);
        prompts::guess(ui, &self.work, &mut out);
        prompts::open_path(ui, &mut self.open.path, &mut out);
        let gpu = self.graphics.as_ref().map(|graphics| &graphics.gpu);
        about::show(ui, &mut self.open.about, gpu);
        let now = Instant::now();
        // What a pointer does from press to release is undone together.
        let held = ctx.input(|i| i.pointer.any_down());
        if held {
            self.work.history.hold(true);
        }
        for command in out.into_vec() {
            self.perform(&ctx, &command, now);
        }
        if !held {
            self.work.history.hold(false);
        }
        if dropped_files > 1 {
            self.work.notice = Some(format!(
                "{dropped_files} files were dropped and the first is opened; drop their folder to open them as one case."
            ));
        }
        self.picture_once_ready(&ctx);
    }

    /// Why the scripted picture wasn't taken, where it wasn't.
    pub fn scripted_error(&mut self) -> Option<AppError> {
        self.scripted.as_mut()?.failed.take()
    }

    fn picture_once_ready(&mut self, ctx: &Context) {
        let Some(scripted) = &mut self.scripted else { return };
        if let Some(error) = self.work.error.take() {
            scripted.failed = Some(error);
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            return;
        }
        if scripted.asked {
            return;
        }
        let ready = self.work.job.is_none()
            && self.work.doc.is_some()
            && !self.results.working()
            && self.pane_rects.keys().all(|pane| self.panes.ready(*pane));
        if ready {
            scripted.asked = true;
            self.pictures.ask(ctx, None, &scripted.path);
        } else {
            ctx.request_repaint_after(Duration::from_millis(50));
        }
    }

    fn panes(&mut self, ui: &mut Ui, out: &mut Commands) {
        if self.work.doc.is_none() || self.work.world.case().is_none() {
            menu::welcome(ui, self.work.job.is_some(), &self.recent, out);
            return;
        }
        self.with_panes(ui, out, panes::show);
    }

    /// Draws one pane alone into all of `ui`: for pictures. Nothing where no case is open.
    pub fn one_pane(&mut self, ui: &mut Ui, pane: PaneId) {
        self.with_panes(ui, &mut Commands::default(), |ui, area| area.pane(ui, pane));
    }

    fn with_panes(&mut self, ui: &mut Ui, out: &mut Commands, show: impl FnOnce(&mut Ui, &mut PaneArea<'_>)) {
        let Workstation { doc: Some(doc), world, session_path, .. } = &self.work else { return };
        let (Some(case), Some(time_point)) = (world.case(), world.time_point(doc)) else { return };
        let colors = world.colors(doc);
        let setting = &doc.edit.change;
        if setting.on_slices {
            // The change view asks for it too, but it need not be open.
            self.results.comparison.get(case, setting, &self.ask);
        }
        let compared = self.results.comparison.kept(case, setting).cloned();
        let input = Input {
            doc,
            case,
            time_point,
            tumor: world.tumor(doc),
            colors: &colors,
            context: world.context(doc),
            compared: compared.as_ref(),
        };
        let mut area = PaneArea {
            panes: &mut self.panes,
            shared: Shared {
                input,
                graphics: self.graphics.as_ref(),
                results: &mut self.results,
                ask: &self.ask,
                session: session_path.as_deref(),
            },
            rects: HashMap::new(),
            out,
        };
        show(ui, &mut area);
        self.pane_rects = area.rects;
    }

    /// Takes what threads finished since the last frame.
    fn receive(&mut self, ctx: &Context) {
        if let Some(CaseRef::Path(path)) = self.work.poll() {
            self.recent.add(&path);
        }
        match self.dialog.as_ref().map(Dialog::poll) {
            None | Some(Answer::Waiting) => {}
            Some(Answer::Cancelled) => self.dialog = None,
            Some(Answer::Unavailable) => {
                if let Some(dialog) = self.dialog.take() {
                    self.without_dialog(&dialog.purpose);
                }
            }
            Some(Answer::Chosen(path)) => {
                if let Some(dialog) = self.dialog.take() {
                    self.perform(ctx, &dialog.purpose.command(path), Instant::now());
                }
            }
        }
        for written in self.pictures.write() {
            match written {
                Ok(path) => self.work.notice = Some(format!("Picture written to {}", path.display())),
                Err(error) => self.work.error = Some(error),
            }
            if self.scripted.is_some() && self.work.error.is_none() {
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
        }
        if let Some(written) = self.export.as_ref().and_then(Job::poll) {
            self.export = None;
            match written {
                Ok(notice) => self.work.notice = Some(notice.into()),
                Err(error) => self.work.error = Some(error),
            }
        }
    }

    /// No file chooser on this desktop: say so, and offer what works without one.
    fn without_dialog(&mut self, purpose: &Purpose) {
        match purpose.file_name() {
            None => self.open.path = Some(String::new()),
            Some(name) => {
                self.work.error = Some(AppError::wrong(
                    name,
                    "no file chooser on this desktop",
                    "one; start with a session file or use the command line to write it",
                ));
            }
        }
    }

    /// Results that took time are kept beside a saved session.
    fn keep_results(&self, session: &Path) {
        if let (Some(doc), Some(case)) = (&self.work.doc, self.work.world.case()) {
            self.results.ellipsoids.keep(session, case, doc.nav.time, doc.edit.ellipsoids.neighbors);
        }
    }

    /// Carries out one command.
    pub fn perform(&mut self, ctx: &Context, command: &Command, now: Instant) {
        let moves = matches!(command, Command::Look(LookCommand::SetCursor(_) | LookCommand::SetCamera(_)));
        if !moves {
            self.work.notice = None;
        }
        match command {
            Command::App(command) => self.perform_app(ctx, command),
            Command::Edit(_) | Command::Look(_) => self.work.apply(command, now),
        }
    }
}

/// Commands whose keys were pressed.
fn shortcuts(ctx: &Context, out: &mut Commands) {
    if ctx.egui_wants_keyboard_input() {
        return;
    }
    // The longest first: Ctrl+Shift+Z must not be taken for Ctrl+Z.
    let mut keyed: Vec<_> =
        listed().iter().filter_map(|listed| Some((listed.keys?, &listed.command))).collect();
    keyed.sort_by_key(|(keys, _)| {
        std::cmp::Reverse(u8::from(keys.modifiers.shift) + u8::from(keys.modifiers.command))
    });
    ctx.input_mut(|input| {
        for (keys, command) in keyed {
            if input.consume_shortcut(&keys) {
                out.push(command.clone());
            }
        }
    });
}

impl eframe::App for GlioscopeApp {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.draw(ui);
    }
}
