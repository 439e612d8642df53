//! The window: menu, warnings, panes, status line. Commands of the views are carried out after everything is drawn.

pub mod about;
mod align;
pub mod autosave;
mod case_dates;
mod case_files;
mod cohort;
pub mod dialogs;
mod drop;
mod enlarged;
mod explain;
pub mod film;
mod fusion;
mod go_to;
mod label;
mod leave;
mod make_mask;
mod masks;
mod menu;
mod modal;
pub mod numbers;
pub mod offscreen;
pub mod offscreen_app;
mod order_dates;
mod pacs;
mod palette;
mod panes;
mod perform;
mod pictures;
pub mod preferences;
pub mod recent;
pub mod report;
pub mod report_file;
mod report_preview;
pub mod run;
pub mod study;
mod take_home;
mod thumbnails;
mod typed_path;
mod warnings;

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use egui::{CentralPanel, Context, Event, Panel, Rect, Ui};
use glioscope_core::files::is_writable_folder;
use glioscope_render::{Gpu, RenderError};

use crate::{
    command::{AppCommand, Command, Commands, EditCommand, LookCommand, Notice, Workstation, listed},
    error::AppError,
    model::{Answers, CaseRef, Document, Edit, PaneId, ResponseSetting, layout},
    theme,
    views::{
        Panes, Shared,
        cohort::{CohortView, reading},
        pane::{DateInput, Input},
        pointer,
        view3d::Graphics,
    },
    world::{
        Results, colors_of,
        jobs::{Ask, Job, Waker},
    },
};
use align::Align;
use autosave::Autosave;
use dialogs::{Choice, Chooser, Dialog, Purpose};
use explain::Explain;
use glioscope_pacs::InUse;
use leave::Leave;
use make_mask::MakeMask;
use pacs::PacsDialog;
use palette::CommandPalette;
use panes::PaneArea;
use pictures::Pictures;
use preferences::Preferences;
use recent::Recent;
use thumbnails::Thumbnails;
use typed_path::TypedPath;

/// Which dialogs and lists are open; never saved.
#[derive(Default)]
struct OpenParts {
    /// The About dialog.
    about: bool,
    /// The dialog of names and colours of masks.
    masks: bool,
    /// The dialog that opens a study of an archive.
    pacs: Option<PacsDialog>,
    /// The dialog that makes a mask.
    make_mask: Option<MakeMask>,
    /// The dialog that writes a report.
    report: Option<report::ReportDialog>,
    /// The dialog that writes the page to take home.
    page: bool,
    /// The window that aligns dates.
    align: Option<Align>,
    /// The list of warnings.
    warnings: bool,
    /// The dialog to type a path, with the text so far.
    path: Option<TypedPath>,
}

/// A screenshot that is taken once everything is drawn; then the program quits.
struct ScriptedPicture {
    path: PathBuf,
    requested: bool,
    /// Whether everything was final when the last frame was drawn. The next one draws what was finished meanwhile.
    was_ready: bool,
    /// How it ended, until it is taken.
    outcome: Option<Result<(), AppError>>,
}

/// The program with a window.
pub struct GlioscopeApp {
    /// Document, world, history.
    pub work: Workstation,
    /// The graphics device; `None` without an adapter.
    pub graphics: Option<Graphics>,
    /// Whether panes are drawn without controls: for a picture on paper.
    pub is_picture: bool,
    /// The panes with their state.
    pub panes: Panes,
    /// The cohort's view.
    pub cohort: CohortView,
    /// Results derived from the case.
    pub results: Results,
    /// [`Workstation::installed`] of the case that they are of.
    results_of: u64,
    /// The folder that a file of this case was last written to, with [`Workstation::installed`] of the case.
    written_to: Option<(u64, PathBuf)>,
    /// A file being opened by the desktop.
    opening: Option<(PathBuf, Job<()>)>,
    ask: Ask,
    open: OpenParts,
    palette: CommandPalette,
    thumbnails: Thumbnails,
    /// Studies that stay in the cache while the window is open.
    in_use: Vec<InUse>,
    recent: Recent,
    preferences: Preferences,
    /// How files are chosen.
    pub chooser: Chooser,
    dialog: Option<Dialog>,
    /// The window's title.
    title: String,
    pane_rects: HashMap<PaneId, Rect>,
    /// The mode for explaining, while it is on.
    explain: Option<Explain>,
    pictures: Pictures,
    /// A file being written on a worker, with the notice for its end.
    export: Option<Job<Notice>>,
    scripted: Option<ScriptedPicture>,
    /// A command that goes to a place which a worker looks for.
    going_to: Option<AppCommand>,
    started: bool,
    leave: Leave,
    /// Copies of unsaved work; `None` where none are kept.
    autosave: Option<Autosave>,
}

impl GlioscopeApp {
    /// A window for a workstation.
    ///
    /// # Errors
    /// [`RenderError`] if the device can't run the closeup's passes.
    pub fn new(
        mut work: Workstation,
        graphics: Option<Graphics>,
        recent: Recent,
    ) -> Result<Self, RenderError> {
        let preferences = Preferences::in_folder(recent.folder());
        work.picture_size = preferences.get().pictures;
        work.usual = preferences.usual();
        work.answers = Answers::in_folder(recent.folder());
        let panes = graphics.as_ref().map_or_else(|| Ok(Panes::default()), Panes::on)?;
        Ok(Self {
            results_of: work.installed,
            written_to: None,
            opening: None,
            work,
            panes,
            cohort: CohortView::default(),
            results: Results::new(graphics.as_ref().map(|graphics| graphics.gpu.clone())),
            graphics,
            is_picture: false,
            ask: Ask::default(),
            open: OpenParts::default(),
            palette: CommandPalette::default(),
            thumbnails: Thumbnails::default(),
            in_use: Vec::new(),
            recent,
            preferences,
            chooser: dialogs::desktop_chooser(),
            dialog: None,
            started: false,
            going_to: None,
            title: String::new(),
            pane_rects: HashMap::new(),
            explain: None,
            pictures: Pictures::default(),
            export: None,
            scripted: None,
            leave: Leave::default(),
            autosave: None,
        })
    }

    /// Takes a screenshot once the case is loaded and drawn in final quality, then quits.
    #[must_use]
    pub fn picture_and_quit(mut self, path: PathBuf) -> Self {
        self.scripted = Some(ScriptedPicture { path, requested: false, was_ready: false, outcome: None });
        self
    }

    /// Keeps copies of unsaved work, and offers those of windows that ended without asking.
    #[must_use]
    pub fn autosaved(self, autosave: Option<Autosave>) -> Self {
        Self { autosave, ..self }
    }

    /// For picture files and tests: waits for results, and draws 3D views in final quality without a draft.
    #[must_use]
    pub fn refined(mut self) -> Self {
        self.ask.wait = true;
        self
    }

    /// Rectangle of a pane in the last frame; `None` if it wasn't drawn.
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

    /// Draws everything and carries out the user's commands.
    pub fn draw(&mut self, ui: &mut Ui) {
        let ctx = ui.ctx().clone();
        self.ask.wake = Waker::of(&ctx);
        self.hold_window(&ctx);
        self.receive(&ctx);
        self.go_to_pending();
        if !std::mem::replace(&mut self.started, true) {
            theme::install(&ctx);
            pointer::install(&ctx);
            if let Some(dark) = self.preferences.get().dark.filter(|_| self.scripted.is_none()) {
                ctx.set_theme(if dark { egui::Theme::Dark } else { egui::Theme::Light });
            }
        }
        self.remember_size(&ctx);
        let mut out = Commands::default();
        if !self.dialog_is_open(&ctx) && self.explain.is_none() {
            shortcuts(&ctx, self.work.cohort_in_front().is_some(), &mut out);
        }
        let passed_over = drop::dropped(&ctx, self.work.doc.is_some(), &mut out);
        // Only what can be chosen from a menu or the palette is looked for.
        let places = if self.palette.is_open() || egui::Popup::is_any_open(&ctx) {
            self.look_for_places();
            go_to::choices(&self.work, &self.results)
        } else {
            Vec::new()
        };
        if self.work.doc.is_none() {
            self.end_explaining();
        }
        self.name_window(&ctx);
        let fill = egui::Frame::NONE.fill(ui.visuals().panel_fill);
        if self.explain.is_some() {
            CentralPanel::default().frame(fill).show(ui, |ui| self.explaining(ui, &mut out));
        } else {
            Panel::top("menu")
                .show(ui, |ui| menu::bar(ui, &self.work, &self.recent, &self.preferences, &places, &mut out));
            warnings::strip(ui, self.work.world.checks(), &mut self.open.warnings);
            Panel::bottom("status").show(ui, |ui| warnings::status(ui, &mut self.work, &mut out));
            if let Some(open) = &self.work.cohort {
                reading::bar(ui, open, self.work.read_case(), &mut out);
            }
            CentralPanel::default().frame(fill).show(ui, |ui| self.panes(ui, &mut out));
        }
        self.palette.show(ui, &places, &mut out);
        self.ask(ui);
        let covered = self.open.path.is_some();
        // Before what it may cover, so that it has the keyboard.
        typed_path::show(ui, &mut self.open.path, &mut out);
        let asks_else = self.open.masks || self.open.make_mask.is_some() || self.open.pacs.is_some();
        if !covered && !asks_else && !self.open.about && !self.palette.is_open() {
            order_dates::show(ui, &mut self.work, &mut out);
        }
        if self.work.guess.is_none() {
            self.thumbnails.clear();
        }
        case_files::show(ui, &mut self.work, &mut self.thumbnails, covered, &mut out);
        masks::show(ui, &mut self.open.masks, &self.work, &mut out);
        make_mask::show(ui, &mut self.open.make_mask, &self.work, &mut out);
        let evaluated = self.results.response.last().map(|evaluated| &**evaluated);
        let lesions = self.results.lesions.last().map(|lesions| &**lesions);
        report::show(ui, &mut self.open.report, &self.work, (evaluated, lesions), &mut out);
        let words = (&mut self.results.page, &self.ask);
        take_home::show(ui, &mut self.open.page, &self.work, words, &mut out);
        align::show(ui, &mut self.open.align, &self.work, &mut out);
        pacs::show(ui, &mut self.open.pacs, &mut self.in_use, &mut self.work, &mut out);
        let gpu = self.graphics.as_ref().map(|graphics| &graphics.gpu);
        about::show(ui, &mut self.open.about, gpu);
        let now = Instant::now();
        // All edits from press to release of the pointer are one undo step.
        let pressed = ctx.input(|i| i.pointer.any_down());
        if pressed {
            self.work.history.hold(true);
        }
        let commands = out.into_vec();
        let changes_views = commands.iter().any(|c| matches!(c, Command::Edit(_) | Command::Look(_)));
        for command in commands {
            self.perform(&ctx, &command, now);
        }
        if changes_views && self.graphics.as_ref().is_some_and(|graphics| graphics.pictures.is_some()) {
            // Painted on the CPU, the frame before the change would delay the one that shows it.
            ctx.request_discard("a command changed what is shown");
        }
        if !pressed {
            self.work.history.hold(false);
        }
        if passed_over > 0 {
            let files = if passed_over == 1 { "file was" } else { "files were" };
            let told = format!(
                "A manifest or a session was dropped and is opened alone; {passed_over} other {files} passed over."
            );
            self.work.notice = Some(told.into());
        }
        self.keep_work(&ctx, now);
        if self.dialog.is_none() && self.open.path.is_none() {
            // Cancelled: what waited for a name to save to doesn't happen.
            self.after_save(&ctx, false);
        }
        self.picture_once_ready(&ctx);
    }

    /// Copies unsaved work from time to time.
    fn keep_work(&mut self, ctx: &Context, now: Instant) {
        let Some(autosave) = &mut self.autosave else { return };
        if let Some(wait) = autosave.keep(&self.work, now) {
            ctx.request_repaint_after(wait);
        }
        if let Some(failure) = autosave.take_failure() {
            self.work.error = Some(AppError::Unkept(failure));
        }
    }

    /// Remembers the window's size when it closes.
    fn remember_size(&mut self, ctx: &Context) {
        let closes = ctx.input(|i| i.viewport().close_requested());
        if !closes || self.scripted.is_some() {
            return;
        }
        let maximized = ctx.input(|i| i.viewport().maximized).unwrap_or(false);
        let remembered = self.preferences.change();
        remembered.maximized = maximized;
        if !maximized {
            let size = ctx.content_rect().size();
            remembered.size_points = Some([size.x, size.y]);
        }
        self.preferences.save();
    }

    /// Which case is open stands in the window's title; not while something is explained to a patient.
    fn name_window(&mut self, ctx: &Context) {
        let case = self.work.world.case().filter(|_| self.work.doc.is_some() && self.explain.is_none());
        let name = match (self.work.cohort_in_front(), case) {
            (Some(cohort), _) => Some(format!("Cohort {}", cohort.name())),
            (None, case) => case.map(|case| case.name.clone()),
        };
        let title = name.map_or_else(|| "Glioscope".to_owned(), |name| format!("{name} – Glioscope"));
        if title != self.title {
            ctx.send_viewport_cmd(egui::ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    /// Remembers the folder of a file that was chosen.
    fn remember_folder(&mut self, command: &AppCommand) {
        let (AppCommand::Open(CaseRef::Path(path))
        | AppCommand::OpenSession(path)
        | AppCommand::SaveSessionTo(path)
        | AppCommand::SaveManifestTo(path)
        | AppCommand::OpenTransferFrom(path)
        | AppCommand::SaveTransferTo(path)
        | AppCommand::ExportMeasurementsTo(path)
        | AppCommand::ExportMasksTo(_, path)
        | AppCommand::ExportRulersTo(path)
        | AppCommand::OpenCohortAt(path)
        | AppCommand::ExportCohortTo(path)
        | AppCommand::ExportVerdictsTo(path)
        | AppCommand::WriteReportTo(_, path)
        | AppCommand::WritePageTo(path)
        | AppCommand::ScreenshotTo(_, path)) = command
        else {
            return;
        };
        let folder = std::path::absolute(path).ok().and_then(|path| path.parent().map(Path::to_owned));
        let opens =
            matches!(command, AppCommand::Open(_) | AppCommand::OpenSession(_) | AppCommand::OpenCohortAt(_));
        self.written_to = folder.clone().filter(|_| !opens).map(|folder| (self.work.installed, folder));
        self.preferences.change().folder = folder;
        self.preferences.save();
    }

    /// Whether a dialog or the palette holds the keyboard.
    fn dialog_is_open(&self, ctx: &Context) -> bool {
        let asks = self.work.guess.is_some() && !self.work.accept_guesses;
        asks || self.work.order_question.is_some()
            || self.is_asking()
            || self.open.about
            || self.open.masks
            || self.open.make_mask.is_some()
            || self.open.pacs.is_some()
            || self.open.path.is_some()
            || self.palette.is_open()
            || modal::is_open(ctx)
    }

    /// Takes how the scripted screenshot ended: written, or why it failed.
    pub fn scripted_outcome(&mut self) -> Option<Result<(), AppError>> {
        self.scripted.as_mut()?.outcome.take()
    }

    fn picture_once_ready(&mut self, ctx: &Context) {
        let Some(scripted) = &mut self.scripted else { return };
        if let Some(error) = self.work.error.take() {
            scripted.outcome = Some(Err(error));
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            return;
        }
        if scripted.requested {
            return;
        }
        let ready = self.work.job.is_none()
            && (self.work.doc.is_some() || self.work.cohort_in_front().is_some())
            && !self.results.working()
            && self.cohort.ready()
            && self.pane_rects.keys().all(|pane| self.panes.ready(*pane));
        let was_ready = std::mem::replace(&mut scripted.was_ready, ready);
        if ready && was_ready {
            scripted.requested = true;
            self.pictures.request(ctx, None, &scripted.path, self.work.inputs());
        } else if ready {
            ctx.request_repaint();
        } else {
            ctx.request_repaint_after(Duration::from_millis(50));
        }
    }

    fn panes(&mut self, ui: &mut Ui, out: &mut Commands) {
        if let Some(open) = self.work.cohort_in_front() {
            self.pane_rects.clear();
            let of = (&mut self.results.cohort, &self.ask);
            self.cohort.show(ui, open, self.work.doc.is_some(), of, out);
            return;
        }
        if self.work.doc.is_none() || self.work.world.case().is_none() {
            menu::welcome(ui, self.work.job.is_some(), &self.recent, out);
            return;
        }
        self.with_panes(ui, None, out, panes::show);
    }

    /// Draws the mode for explaining in place of menu, panes and status line.
    fn explaining(&mut self, ui: &mut Ui, out: &mut Commands) {
        let Some(mut explain) = self.explain.take() else { return };
        let mut ends = false;
        self.explain = Some(explain.clone());
        self.with_panes(ui, None, out, |ui, area| ends = explain::show(ui, &mut explain, area));
        self.explain = Some(explain);
        if ends {
            self.end_explaining();
        }
    }

    /// Back to the workstation; how large a millimetre is on this screen is remembered.
    fn end_explaining(&mut self) {
        if let Some(explain) = self.explain.take() {
            self.preferences.change().points_per_mm = Some(explain.points_per_mm());
            self.preferences.change().explain_language = explain.language();
            self.preferences.save();
        }
    }

    /// Draws one pane alone into all of `ui`, for picture files; nothing if no case is open.
    pub fn one_pane(&mut self, ui: &mut Ui, pane: PaneId) {
        self.with_panes(ui, Some(pane), &mut Commands::default(), |ui, area| area.pane(ui, pane));
    }

    /// `alone`: the pane that is drawn in place of the layout.
    fn with_panes(
        &mut self,
        ui: &mut Ui,
        alone: Option<PaneId>,
        out: &mut Commands,
        show: impl FnOnce(&mut Ui, &mut PaneArea<'_>),
    ) {
        let Workstation { doc: Some(doc), world, session_path, .. } = &self.work else { return };
        let (Some(case), Some(time_point)) = (world.case(), world.time_point(doc)) else { return };
        let plain;
        let doc = if self.explain.is_some() {
            // What the lens cuts away would have to be explained.
            plain = Document { edit: Edit { lens_on: false, ..doc.edit.clone() }, ..doc.clone() };
            &plain
        } else {
            doc
        };
        let (colors, selection) = (world.colors(doc), world.selection(doc));
        let setting = &doc.edit.change;
        let dates = case.time_points.len();
        let is_shown = |pane| match alone.or(doc.edit.maximized) {
            Some(maximized) => {
                maximized == pane || (alone.is_none() && panes::beside(maximized, dates) == Some(pane))
            }
            None => layout::contains(&doc.edit.layout, pane),
        };
        if setting.on_slices || (is_shown(PaneId::SideBySide) && case.time_points.len() > 1) {
            // The change view requests it too, but may not be open.
            self.results.comparison.get(case, setting, &self.ask);
        }
        let compared = self.results.comparison.cached(case, setting).cloned();
        let dates: Vec<DateInput<'_>> = if is_shown(PaneId::SideBySide) {
            let all = case.time_points.iter().enumerate();
            all.map(|(time, time_point)| DateInput {
                time_point,
                selection: doc.edit.selection.at(&time_point.regions),
                colors: colors_of(doc, time_point),
                images: world.images(time),
            })
            .collect()
        } else {
            Vec::new()
        };
        let input = Input {
            doc,
            case,
            dates: &dates,
            time: doc.nav.time,
            matched_to: None,
            fit_grid: None,
            time_point,
            selection: &selection,
            tumor: world.tumor(doc),
            colors: &colors,
            context: world.context(doc),
            second: world.second(doc),
            only_mask: None,
            is_plain: self.explain.is_some(),
            is_picture: self.is_picture,
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
        if let Some((pane, _)) = doc.nav.preview.filter(|(pane, _)| !area.rects.contains_key(pane)) {
            area.out.push(LookCommand::PreviewCursor(pane, None));
        }
        self.pane_rects = area.rects;
    }

    /// Receives results of other threads since the last frame.
    fn receive(&mut self, ctx: &Context) {
        if let Some(path) = self.work.poll(Waker::of(ctx)) {
            self.recent.add(&path);
        }
        if self.results_of != self.work.installed {
            self.results_of = self.work.installed;
            self.results.forget_case(self.gpu().cloned());
        }
        if let Some((path, job)) = &self.opening
            && let Some(result) = job.poll()
        {
            if result.is_err() {
                let expected = "a program for files of its kind; the file is there";
                self.work.error =
                    Some(AppError::file(path, "no program of this desktop that opens it", expected));
            }
            self.opening = None;
        }
        self.work.follow_alignments(Waker::of(ctx));
        self.work.hide_names();
        if let Some(choice) = self.dialog.as_ref().and_then(Dialog::poll)
            && let Some(Dialog { purpose, .. }) = self.dialog.take()
        {
            match choice {
                Choice::Cancelled => self.after_save(ctx, false),
                Choice::Path(path) => {
                    let whole = purpose.complete(path.clone());
                    if whole != path && whole.exists() {
                        self.open.path = Some(TypedPath::about_existing(purpose, &whole));
                    } else {
                        self.perform(ctx, &purpose.command(path), Instant::now());
                    }
                }
                Choice::Unavailable(why) => {
                    let why = format!("This desktop has no file chooser ({why}), so type the path.");
                    let folder = self.folder_for(&purpose).unwrap_or_default();
                    self.open.path = Some(TypedPath::new(purpose, &folder, why));
                }
            }
        }
        for written in self.pictures.write() {
            match written {
                Ok(path) => {
                    let text = format!("Picture written to {}", path.display());
                    self.work.succeeded(Notice::wrote(text, &path));
                }
                Err(error) => self.work.error = Some(error),
            }
            if let (Some(scripted), None) = (&mut self.scripted, &self.work.error) {
                scripted.outcome = Some(Ok(()));
                ctx.send_viewport_cmd(egui::ViewportCommand::Close);
            }
        }
        if let Some(written) = self.export.as_ref().and_then(Job::poll) {
            self.export = None;
            match written {
                Ok(notice) => self.work.succeeded(notice),
                Err(error) => self.work.error = Some(error),
            }
        }
    }

    /// The purpose of saving the session: beside a folder that is a case it is named after that, so that no two cases have one name.
    fn save_session(&self) -> Purpose {
        let name = match self.work.doc.as_ref().map(|doc| &doc.case) {
            Some(CaseRef::Path(path)) if path.is_dir() => std::path::absolute(path).ok(),
            _ => None,
        };
        let name = name.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        Purpose::SaveSession { stem: name.unwrap_or_else(|| "case".into()) }
    }

    /// The folder in which a file dialog begins. Of what is written of a case: that of what was written of it last, else the case's
    /// own, so that nothing of one patient is proposed beside another's; `None` where it has none. Else that of the file chosen last. A
    /// manifest belongs beside the files it describes. Where that can't be written, as on a disc or a study's share, the user's documents.
    fn folder_for(&self, purpose: &Purpose) -> Option<PathBuf> {
        if let (Purpose::Manifest, Some(guess)) = (purpose, &self.work.guess) {
            return std::path::absolute(&guess.proposal.folder).ok();
        }
        let is_usable = |folder: &PathBuf| match purpose.file_name() {
            Some(_) => is_writable_folder(folder),
            None => folder.is_dir(),
        };
        let last = self.preferences.get().folder.clone().filter(is_usable);
        let is_read_again = !matches!(
            purpose,
            Purpose::Report(_)
                | Purpose::Page
                | Purpose::Measurements(_)
                | Purpose::Rulers(_)
                | Purpose::Picture(_)
        );
        let case = self.work.doc.as_ref().and_then(|doc| match &doc.case {
            // Masks beside a folder's own would be read with it the next time, and a session is of all of it.
            CaseRef::Path(path) if !is_read_again && path.is_dir() => Some(path.clone()),
            CaseRef::Path(path) => path.parent().map(Path::to_owned),
            CaseRef::Files { folder, .. } => Some(folder.clone()),
            CaseRef::Sample | CaseRef::Arguments { .. } => None,
        });
        let is_of_case = !is_read_again || matches!(purpose, Purpose::SaveSession { .. } | Purpose::Masks(_));
        let written = self.written_to.as_ref().filter(|(of, _)| is_of_case && *of == self.work.installed);
        let written = written.map(|(_, folder)| folder.clone()).filter(is_usable);
        let own = case.clone().filter(|folder| is_of_case && is_usable(folder));
        // A session belongs to its case, wherever else a file was written.
        let own =
            if matches!(purpose, Purpose::SaveSession { .. }) { own.or(written) } else { written.or(own) };
        let last = last.filter(|_| !is_of_case);
        let current = || std::env::current_dir().ok().filter(|folder| !is_of_case && is_usable(folder));
        let documents = || {
            let folders = directories::UserDirs::new().filter(|_| case.is_some())?;
            let folder = folders.document_dir().unwrap_or_else(|| folders.home_dir());
            Some(folder.to_owned()).filter(is_usable)
        };
        let folder =
            own.or(last).or_else(|| case.clone().filter(is_usable)).or_else(current).or_else(documents)?;
        std::path::absolute(folder).ok()
    }

    /// Saves the session, and slowly computed results beside it; returns whether the session was saved.
    fn save_to(&mut self, session: &Path) -> bool {
        let saved = self.work.save(session.to_owned());
        if saved && let (Some(doc), Some(case)) = (&self.work.doc, self.work.world.case()) {
            self.results.ellipsoids.write_cache(session, case, doc.nav.time, doc.edit.ellipsoids.neighbors);
        }
        saved
    }

    /// Carries out one command.
    pub fn perform(&mut self, ctx: &Context, command: &Command, now: Instant) {
        let is_navigation = matches!(
            command,
            Command::Look(
                LookCommand::SetCursor(_) | LookCommand::PreviewCursor(..) | LookCommand::SetCamera(_)
            ) | Command::Edit(EditCommand::SetLayout(_))
                | Command::App(AppCommand::OpenWritten(_))
        );
        if !is_navigation {
            self.work.notice = None;
        }
        match command {
            Command::App(command) => {
                self.remember_folder(command);
                self.perform_app(ctx, command);
            }
            Command::Edit(EditCommand::SetResponse(new)) => {
                let by_reader = self.stated_by_reader(new).map(Command::Edit);
                self.work.apply(by_reader.as_ref().unwrap_or(command), now);
                self.preferences.remember_reader(&new.author);
                self.work.usual = self.preferences.usual();
            }
            Command::Edit(_) | Command::Look(_) => self.work.apply(command, now),
        }
    }

    /// The response of a case for which nothing was stated is begun by who stated one last.
    fn stated_by_reader(&self, new: &ResponseSetting) -> Option<EditCommand> {
        let old = &self.work.doc.as_ref()?.edit.response;
        let reader = &self.work.usual.reader;
        let begins = old.history.is_none() && new.history.is_some() && new.author.is_empty();
        (begins && !reader.is_empty()).then(|| {
            EditCommand::SetResponse(Box::new(ResponseSetting { author: reader.clone(), ..new.clone() }))
        })
    }
}

/// Pushes the commands whose shortcuts were pressed.
fn shortcuts(ctx: &Context, is_cohort: bool, out: &mut Commands) {
    if ctx.egui_wants_keyboard_input() {
        return;
    }
    // Most modifiers first: otherwise Ctrl+Shift+Z would match Ctrl+Z.
    let mut with_shortcut: Vec<_> =
        listed().iter().filter_map(|listed| Some((listed.keys?, &listed.command))).collect();
    // What isn't seen isn't changed by a key.
    with_shortcut
        .retain(|(_, command)| !is_cohort || matches!(command, Command::App(app) if app.is_of_cohort()));
    with_shortcut.sort_by_key(|(keys, _)| {
        std::cmp::Reverse(u8::from(keys.modifiers.shift) + u8::from(keys.modifiers.command))
    });
    // Every key of the frame in its order: two presses of one key are two commands.
    ctx.input_mut(|input| {
        input.events.retain(|event| {
            let Event::Key { key, modifiers, pressed: true, .. } = event else { return true };
            let mut all = with_shortcut.iter();
            let found =
                all.find(|(keys, _)| keys.logical_key == *key && modifiers.matches_logically(keys.modifiers));
            found.inspect(|(_, command)| out.push((*command).clone())).is_none()
        });
    });
}

impl eframe::App for GlioscopeApp {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.draw(ui);
    }
}
