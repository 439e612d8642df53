//! The window: menu, warnings, panes, status line. Views write commands; they are carried out after
//! everything is drawn.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{Arc, mpsc},
    time::Instant,
};

use egui::{CentralPanel, ColorImage, Context, Panel as EguiPanel, Rect, Ui};
use glioscope_core::{Severity, measure};

use crate::{
    about,
    commands::Command,
    comparing,
    dialogs::{Answer, Dialog, Purpose},
    document::{CaseRef, Pane},
    files, menu,
    palette::CommandPalette,
    panes::{self, PaneArea, PaneStates},
    recent::Recent,
    rulers::{self, RulerFormat},
    session,
    viewport::Viewport,
    views::{ViewContext, closeup::CloseupState},
    workstation::Workstation,
};

/// What an open file dialog is for.
#[derive(Clone, Debug, PartialEq)]
pub enum DialogThen {
    /// Open the case or session chosen.
    Open,
    /// Save the session there.
    SaveSession,
    /// Write a picture there.
    Picture(Option<Pane>),
    /// Write the measurements there.
    Measurements,
    /// Write the lines measured there.
    Rulers(RulerFormat),
}

/// Parts of the window that are open or not; never saved.
#[derive(Default)]
pub struct Open {
    /// The About box.
    pub about: bool,
    /// The list of warnings.
    pub warnings: bool,
    /// The box where a path is typed.
    pub path: Option<String>,
}

/// The program with a window.
pub struct GlioscopeApp {
    /// Document, world, history.
    pub work: Workstation,
    /// The 3D renderer; `None` without a graphics adapter.
    pub viewport: Option<Viewport>,
    /// What the closeup remembers.
    pub closeup: CloseupState,
    /// What the other panes remember.
    pub states: PaneStates,
    /// What is open.
    pub open: Open,
    palette: CommandPalette,
    recent: Recent,
    dialog: Option<Dialog<DialogThen>>,
    pane_rects: HashMap<Pane, Rect>,
    pictures: (mpsc::Sender<Picture>, mpsc::Receiver<Picture>),
    refine_at_once: bool,
    picture_when_ready: Option<PathBuf>,
    quit_after_picture: bool,
}

/// A picture of the window that arrived, and what to do with it.
struct Picture {
    image: Arc<ColorImage>,
    crop: Option<Rect>,
    pixels_per_point: f32,
    path: PathBuf,
}

impl GlioscopeApp {
    /// A window on a workstation.
    pub fn new(work: Workstation, viewport: Option<Viewport>, recent: Recent) -> Self {
        let mut states = PaneStates::default();
        states.comparisons.gpu = viewport.as_ref().map(|viewport| viewport.gpu.clone());
        Self {
            work,
            viewport,
            closeup: CloseupState::default(),
            states,
            open: Open::default(),
            palette: CommandPalette::default(),
            recent,
            dialog: None,
            pane_rects: HashMap::new(),
            pictures: mpsc::channel(),
            refine_at_once: false,
            picture_when_ready: None,
            quit_after_picture: false,
        }
    }

    /// Takes a picture of the window once the case is loaded and drawn in full, then quits.
    #[must_use]
    pub fn picture_and_quit(mut self, path: PathBuf) -> Self {
        self.picture_when_ready = Some(path);
        self.quit_after_picture = true;
        self
    }

    /// For pictures and tests: 3D views are drawn in full at once, never as a draft first.
    #[must_use]
    pub fn refined(mut self) -> Self {
        self.refine_at_once = true;
        self
    }

    /// Where a pane was drawn last.
    pub fn pane_rect(&self, pane: Pane) -> Option<Rect> {
        self.pane_rects.get(&pane).copied()
    }

    /// Draws everything and does what the user asked for.
    pub fn draw(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        self.receive(&ctx);
        let mut out = Vec::new();
        self.shortcuts(&ctx, &mut out);
        let dropped_files = dropped(&ctx, self.work.doc.is_some(), &mut out);
        EguiPanel::top("menu").show(ui, |ui| menu::bar(ui, &self.work, &self.recent, &mut out));
        self.warnings(ui);
        EguiPanel::bottom("status").show(ui, |ui| self.status(ui, &mut out));
        let fill = egui::Frame::NONE.fill(ui.visuals().panel_fill);
        CentralPanel::default().frame(fill).show(ui, |ui| self.panes(ui, &mut out));
        self.palette.show(ui, &mut out);
        self.guess(ui, &mut out);
        self.open_by_path(ui, &mut out);
        about::show(ui, &mut self.open.about, self.viewport.as_ref());
        let now = Instant::now();
        // What a pointer does from press to release is undone together.
        let held = ctx.input(|i| i.pointer.any_down());
        if held {
            self.work.history.hold(true);
        }
        for command in out {
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

    fn picture_once_ready(&mut self, ctx: &Context) {
        if self.picture_when_ready.is_none() {
            return;
        }
        if let Some(error) = &self.work.error {
            crate::cli::say_error(error);
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
        let drawn = |pane| self.pane_rects.contains_key(&pane);
        let ready = self.work.job.is_none()
            && self.work.doc.is_some()
            && self.closeup.refined()
            && (!drawn(Pane::Context)
                || (self.states.context.refined()
                    && !self.states.volume.working()
                    && !self.states.context.tracts.working()))
            && (!drawn(Pane::Ellipsoids) || self.states.ellipsoids.refined())
            && (!drawn(Pane::Change) || (self.states.change.refined() && !self.states.comparisons.working()));
        if ready && let Some(path) = self.picture_when_ready.take() {
            self.take_picture(ctx, None, &path);
        } else {
            ctx.request_repaint_after(std::time::Duration::from_millis(50));
        }
    }

    fn panes(&mut self, ui: &mut Ui, out: &mut Vec<Command>) {
        let Workstation { doc, world, .. } = &self.work;
        if doc.is_none() || world.case().is_none() {
            menu::welcome(ui, self.work.job.is_some(), &self.recent, out);
            return;
        }
        self.with_panes(ui, out, panes::show);
    }

    /// Draws one pane alone into all of `ui`: for pictures. Nothing where no case is open.
    pub fn one_pane(&mut self, ui: &mut Ui, pane: Pane) {
        self.with_panes(ui, &mut Vec::new(), |ui, area| area.pane(ui, pane));
    }

    fn with_panes(
        &mut self,
        ui: &mut Ui,
        out: &mut Vec<Command>,
        show: impl FnOnce(&mut Ui, &mut PaneArea<'_>),
    ) {
        let Workstation { doc: Some(doc), world, session_path, .. } = &self.work else { return };
        let (Some(case), Some(time_point)) = (world.case(), world.time_point(doc)) else { return };
        let colors = world.colors(doc);
        let setting = &doc.edit.change;
        if setting.on_slices {
            // The change view asks for it too, but it need not be open.
            let comparisons = &mut self.states.comparisons;
            comparing::get(comparisons, case, setting, self.refine_at_once, waker(ui.ctx()));
        }
        let compared = comparing::here(&self.states.comparisons, case, setting).cloned();
        let context = world.context(doc);
        let compared = compared.as_ref();
        let view = ViewContext { doc, case, time_point, colors: &colors, context, compared };
        let mut scene = world.closeup(doc, ui.visuals().dark_mode);
        if doc.nav.show_plane {
            scene.plane = self.states.plane.get(&view);
        }
        let mut area = PaneArea {
            view,
            scene: &scene,
            session: session_path.as_deref(),
            viewport: self.viewport.as_mut(),
            closeup: &mut self.closeup,
            states: &mut self.states,
            refine_at_once: self.refine_at_once,
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
        if let Some(dialog) = &self.dialog {
            match dialog.poll() {
                Answer::Waiting => {}
                Answer::Cancelled => self.dialog = None,
                Answer::Unavailable => {
                    let then = dialog.then.clone();
                    self.dialog = None;
                    self.without_dialog(&then);
                }
                Answer::Chosen(path) => {
                    let then = dialog.then.clone();
                    self.dialog = None;
                    let command = match then {
                        DialogThen::Open => open_command(path),
                        DialogThen::SaveSession => Command::SaveSessionTo(path),
                        DialogThen::Picture(pane) => Command::ScreenshotTo(pane, path),
                        DialogThen::Measurements => Command::ExportMeasurementsTo(path),
                        DialogThen::Rulers(format) => Command::ExportRulersTo(format.on(path)),
                    };
                    self.perform(ctx, &command, Instant::now());
                }
            }
        }
        while let Ok(picture) = self.pictures.1.try_recv() {
            let written = files::write_window_png(
                &picture.path,
                &picture.image,
                picture.crop,
                picture.pixels_per_point,
            );
            match written {
                Ok(()) => self.work.notice = Some(format!("Picture written to {}", picture.path.display())),
                Err(error) => self.work.error = Some(error),
            }
            if self.quit_after_picture {
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
        }
    }

    /// No file chooser on this desktop: say so, and offer what works without one.
    fn without_dialog(&mut self, then: &DialogThen) {
        let name = match then {
            DialogThen::Open => {
                self.open.path = Some(String::new());
                return;
            }
            DialogThen::SaveSession => format!("case.{}", session::ENDING),
            DialogThen::Picture(_) => "glioscope.png".to_owned(),
            DialogThen::Measurements => "measurements.json".to_owned(),
            DialogThen::Rulers(format) => format.file_name().to_owned(),
        };
        self.work.error = Some(format!(
            "{name}: found no file chooser on this desktop, expected one; start with a session file or use the \
             command line to write it"
        ));
    }

    fn shortcuts(&mut self, ctx: &Context, out: &mut Vec<Command>) {
        if ctx.egui_wants_keyboard_input() {
            return;
        }
        ctx.input_mut(|input| {
            // The longest first: Ctrl+Shift+Z must not be taken for Ctrl+Z.
            let mut commands: Vec<_> =
                Command::listed().into_iter().filter_map(|c| c.shortcut().map(|s| (s, c))).collect();
            commands.sort_by_key(|(s, _)| {
                std::cmp::Reverse(u8::from(s.modifiers.shift) + u8::from(s.modifiers.command))
            });
            for (shortcut, command) in commands {
                if input.consume_shortcut(&shortcut) {
                    out.push(command);
                }
            }
        });
    }

    /// Warnings of the case: a strip that stays as long as they hold.
    fn warnings(&mut self, ui: &mut Ui) {
        let serious: Vec<_> =
            self.work.world.checks().iter().filter(|c| c.severity >= Severity::Warning).cloned().collect();
        let notes: Vec<_> =
            self.work.world.checks().iter().filter(|c| c.severity < Severity::Warning).cloned().collect();
        let Some(first) = serious.first() else { return };
        let dark = ui.visuals().dark_mode;
        let (fill, ink) = if dark {
            (egui::Color32::from_rgb(92, 62, 6), egui::Color32::from_rgb(255, 226, 165))
        } else {
            (egui::Color32::from_rgb(255, 232, 176), egui::Color32::from_rgb(82, 50, 0))
        };
        let frame = egui::Frame::new().fill(fill).inner_margin(egui::Margin::symmetric(8, 4));
        EguiPanel::top("warnings").frame(frame).show(ui, |ui| {
            ui.visuals_mut().override_text_color = Some(ink);
            ui.horizontal(|ui| {
                let text = if self.open.warnings { "Hide warnings" } else { "Show warnings" };
                let count = format!("{} warning{}", serious.len(), if serious.len() == 1 { "" } else { "s" });
                ui.strong(count);
                if ui.button(text).clicked() {
                    self.open.warnings = !self.open.warnings;
                }
                ui.add(egui::Label::new(&first.message).truncate());
            });
            if self.open.warnings {
                egui::ScrollArea::vertical().max_height(180.0).show(ui, |ui| {
                    for check in serious.iter().chain(&notes) {
                        ui.horizontal_wrapped(|ui| {
                            ui.monospace(check.code);
                            ui.label(&check.message);
                        });
                    }
                });
            }
        });
    }

    fn status(&mut self, ui: &mut Ui, out: &mut Vec<Command>) {
        ui.horizontal(|ui| {
            if let Some(job) = &self.work.job {
                ui.spinner();
                ui.label(crate::world::progress_text(&job.progress));
                if let Some(fraction) = job.progress.fraction() {
                    ui.add(egui::ProgressBar::new(fraction as f32).desired_width(160.0));
                }
                if ui.button("Cancel").clicked() {
                    out.push(Command::CancelLoading);
                }
                ui.ctx().request_repaint_after(std::time::Duration::from_millis(100));
            }
            let mut dismissed = false;
            if let Some(error) = &self.work.error {
                dismissed = ui.button("Dismiss").clicked();
                ui.colored_label(ui.visuals().error_fg_color, error);
            } else if let Some(notice) = &self.work.notice {
                ui.label(notice);
            }
            if dismissed {
                self.work.error = None;
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.weak("Research use only. Not a medical device.");
            });
        });
    }

    /// Shows how a folder's names were read, before that is used.
    fn guess(&mut self, ui: &mut Ui, out: &mut Vec<Command>) {
        let Some(guess) = &self.work.guess else { return };
        if self.work.accept_guesses {
            out.push(Command::AcceptGuess(true));
            return;
        }
        let window = egui::Window::new("How this folder is read").collapsible(false).resizable(false);
        window.default_width(560.0).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(ui.ctx(), |ui| {
            ui.label(
                "There is no manifest, so files were told apart by their names and contents. Is this right?",
            );
            ui.add_space(6.0);
            egui::ScrollArea::vertical().max_height(360.0).show(ui, |ui| {
                egui::Grid::new("guess").num_columns(4).striped(true).show(ui, |ui| {
                    for title in ["", "id", "file", "labels and date"] {
                        ui.strong(title);
                    }
                    ui.end_row();
                    for context in &guess.spec.contexts {
                        guess_row(
                            ui,
                            "image",
                            &context.id,
                            &context.source.name(),
                            "",
                            context.time.as_deref(),
                        );
                    }
                    for mask in &guess.spec.masks {
                        let labels = mask.labels.as_ref().map(|l| format!("{l:?} ")).unwrap_or_default();
                        guess_row(ui, "mask", &mask.id, &mask.source.name(), &labels, mask.time.as_deref());
                    }
                });
                ui.add_space(6.0);
                for note in &guess.spec.notes {
                    ui.label(&note.message);
                }
            });
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                if ui.button("Open it like this").clicked() {
                    out.push(Command::AcceptGuess(true));
                }
                if ui.button("Cancel").clicked() {
                    out.push(Command::AcceptGuess(false));
                }
            });
        });
    }

    fn open_by_path(&mut self, ui: &mut Ui, out: &mut Vec<Command>) {
        let Some(path) = &mut self.open.path else { return };
        let mut close = false;
        let window = egui::Window::new("Open a case").collapsible(false).resizable(false);
        window.anchor(egui::Align2::CENTER_CENTER, [0.0, -60.0]).show(ui.ctx(), |ui| {
            ui.label("A manifest (case.toml), a folder, a NIfTI file or a session file:");
            let label = ui.label("Path");
            let field = ui.add(egui::TextEdit::singleline(path).desired_width(420.0)).labelled_by(label.id);
            let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            ui.horizontal(|ui| {
                if (ui.button("Open").clicked() || entered) && !path.trim().is_empty() {
                    out.push(open_command(PathBuf::from(path.trim())));
                    close = true;
                }
                if ui.button("Browse files…").clicked() {
                    out.push(Command::BrowseFiles);
                    close = true;
                }
                if ui.button("Browse folders…").clicked() {
                    out.push(Command::BrowseFolders);
                    close = true;
                }
                close |= ui.button("Cancel").clicked();
            });
        });
        if close {
            self.open.path = None;
        }
    }

    fn ask(&mut self, ctx: &Context, purpose: Purpose, then: DialogThen) {
        let wake = waker(ctx);
        self.dialog = Some(Dialog::open(purpose, then, wake));
    }

    /// Carries out one command.
    pub fn perform(&mut self, ctx: &Context, command: &Command, now: Instant) {
        if !matches!(command, Command::SetCursor(_) | Command::SetCamera(_)) {
            self.work.notice = None;
        }
        match command {
            Command::OpenDialog => self.open.path = Some(String::new()),
            Command::BrowseFiles => self.ask(ctx, Purpose::OpenFile, DialogThen::Open),
            Command::BrowseFolders => self.ask(ctx, Purpose::OpenFolder, DialogThen::Open),
            Command::Open(case) => self.work.open(case.clone(), None, waker(ctx)),
            Command::OpenSample => self.work.open(CaseRef::Sample, None, waker(ctx)),
            Command::OpenSession(path) => {
                self.recent.add(path);
                self.work.open_session(path, &[], waker(ctx));
            }
            Command::AddTracts(files) => self.work.add_tracts(files, waker(ctx)),
            Command::ClearRecent => self.recent.clear(),
            Command::SaveSession => match self.work.session_path.clone() {
                Some(path) => {
                    self.work.save(path.clone());
                    self.keep_results(&path);
                }
                None => self.perform(ctx, &Command::SaveSessionAs, now),
            },
            Command::SaveSessionAs => {
                let name = format!("case.{}", session::ENDING);
                self.ask(ctx, Purpose::Save { name }, DialogThen::SaveSession);
            }
            Command::SaveSessionTo(path) => {
                self.work.save(path.clone());
                self.recent.add(path);
                self.keep_results(path);
            }
            Command::AcceptGuess(true) => self.work.accept_guess(waker(ctx)),
            Command::AcceptGuess(false) => self.work.guess = None,
            Command::CancelLoading => {
                if let Some(job) = &self.work.job {
                    job.progress.cancel();
                }
            }
            Command::ScreenshotWindow => self.ask_picture(ctx, None),
            Command::ScreenshotPane(pane) => self.ask_picture(ctx, Some(*pane)),
            Command::ScreenshotTo(pane, path) => self.take_picture(ctx, *pane, path),
            Command::ExportMeasurements => {
                let name = "measurements.json".to_owned();
                self.ask(ctx, Purpose::Save { name }, DialogThen::Measurements);
            }
            Command::ExportMeasurementsTo(path) => self.export(path),
            Command::ExportRulers(format) => {
                let name = format.file_name().to_owned();
                self.ask(ctx, Purpose::Save { name }, DialogThen::Rulers(*format));
            }
            Command::ExportRulersTo(path) => self.export_rulers(path),
            Command::ShowPalette => self.palette.open(),
            Command::ShowAbout => self.open.about = true,
            Command::ToggleDark => {
                let theme =
                    if ctx.global_style().visuals.dark_mode { egui::Theme::Light } else { egui::Theme::Dark };
                ctx.set_theme(theme);
            }
            Command::Quit => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            _ => self.work.apply(command, now),
        }
    }

    /// Results that took time are kept beside a saved session.
    fn keep_results(&self, session: &Path) {
        if let (Some(doc), Some(case)) = (&self.work.doc, self.work.world.case()) {
            self.states.ellipsoids.keep(session, case, doc.nav.time, doc.edit.ellipsoids.neighbors);
        }
    }

    fn ask_picture(&mut self, ctx: &Context, pane: Option<Pane>) {
        let name = pane.map_or("window", Pane::tab).to_lowercase();
        self.ask(ctx, Purpose::Save { name: format!("{name}.png") }, DialogThen::Picture(pane));
    }

    fn take_picture(&mut self, ctx: &Context, pane: Option<Pane>, path: &Path) {
        let crop = match pane {
            None => None,
            Some(pane) => match self.pane_rect(pane) {
                Some(rect) => Some(rect),
                None => {
                    self.work.error = Some(format!("{}: is not open, so it has no picture", pane.title()));
                    return;
                }
            },
        };
        let (send, path, wake) = (self.pictures.0.clone(), path.to_owned(), waker(ctx));
        let pixels_per_point = ctx.pixels_per_point();
        ctx.request_screenshot(move |image| {
            // The window may be closing: then nobody writes the picture.
            let _ = send.send(Picture { image, crop, pixels_per_point, path });
            wake();
        });
    }

    fn export(&mut self, path: &Path) {
        let Some(case) = self.work.world.case() else { return };
        match files::write_json(path, &measure::report(case)) {
            Ok(()) => self.work.notice = Some("Measurements written.".into()),
            Err(error) => self.work.error = Some(error),
        }
    }
}

impl GlioscopeApp {
    fn export_rulers(&mut self, path: &Path) {
        let (Some(case), Some(doc)) = (self.work.world.case(), &self.work.doc) else { return };
        match rulers::write(path, case, &doc.edit.rulers) {
            Ok(()) => self.work.notice = Some("Lines written.".into()),
            Err(error) => self.work.error = Some(error),
        }
    }
}

impl eframe::App for GlioscopeApp {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.draw(ui);
    }
}

/// Wakes the window from another thread.
pub fn waker(ctx: &Context) -> impl FnOnce() + Send + 'static {
    let ctx = ctx.clone();
    move || ctx.request_repaint()
}

/// What to do with a path someone chose: a session or a case.
pub fn open_command(path: PathBuf) -> Command {
    if session::is_session(&path) { Command::OpenSession(path) } else { Command::Open(CaseRef::Path(path)) }
}

/// Adds dropped fibre tracts to the open case, and opens the first other file or folder; how many others
/// there were.
fn dropped(ctx: &Context, case_is_open: bool, out: &mut Vec<Command>) -> usize {
    let paths: Vec<PathBuf> =
        ctx.input(|i| i.raw.dropped_files.iter().map(|f| f.path().to_owned()).collect());
    let are_tracts = |path: &PathBuf| {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        case_is_open && (ending == "tck" || ending == "trk")
    };
    let (tracts, paths): (Vec<PathBuf>, Vec<PathBuf>) = paths.into_iter().partition(are_tracts);
    if !tracts.is_empty() {
        out.push(Command::AddTracts(tracts));
    }
    if let Some(path) = paths.first() {
        out.push(open_command(path.clone()));
    }
    if ctx.input(|i| !i.raw.hovered_files.is_empty()) {
        let layer = egui::LayerId::new(egui::Order::Foreground, egui::Id::unique("drop"));
        let painter = ctx.layer_painter(layer);
        let rect = ctx.content_rect();
        painter.rect_filled(rect, 0.0, egui::Color32::from_black_alpha(160));
        painter.text(
            rect.center(),
            egui::Align2::CENTER_CENTER,
            "Drop a folder, a manifest, a NIfTI file or a session to open it, or fibre tracts to add them",
            egui::FontId::proportional(22.0),
            egui::Color32::WHITE,
        );
    }
    paths.len()
}

fn guess_row(ui: &mut Ui, kind: &str, id: &str, file: &str, labels: &str, time: Option<&str>) {
    ui.label(kind);
    ui.label(id);
    let name =
        Path::new(file).file_name().map_or_else(|| file.to_owned(), |n| n.to_string_lossy().into_owned());
    ui.label(name).on_hover_text(file);
    ui.label(format!("{labels}{}", time.unwrap_or_default()));
    ui.end_row();
}
