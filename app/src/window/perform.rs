//! Carries out commands that affect more than the document.

use std::{path::Path, time::Instant};

use super::{
    GlioscopeApp, align,
    dialogs::{Dialog, Purpose},
    enlarged::Enlarged,
    explain::Explain,
    make_mask::MakeMask,
    numbers::Shown,
    pacs::PacsDialog,
    preferences::{MOST_LAYOUT_NAME, MOST_LAYOUTS},
    report, take_home,
    typed_path::TypedPath,
};
use crate::{
    command::{AppCommand, EditCommand, Notice},
    error::AppError,
    export::{self, Export, Format, What},
    model::{
        PaneId,
        session::{self, EXTENSION},
        transfer_file,
    },
    output,
    world::{
        image::transfer_of,
        jobs::{Job, Waker},
        load,
    },
};
use egui::Context;
use glam::DAffine3;
use glioscope_core::{
    case::{CaseSpec, LoadOptions},
    files::{absolute, write_whole},
};

impl GlioscopeApp {
    /// Keeps the view under the pointer for the report, else the maximised one.
    fn keep_picture(&mut self, ctx: &Context) {
        let can_be_kept = |pane: &PaneId| pane.row().cli.is_some();
        let at = ctx.pointer_latest_pos();
        let under = self.pane_rects.iter().find(|(_, rect)| at.is_some_and(|at| rect.contains(at)));
        let maximized = self.work.doc.as_ref().and_then(|doc| doc.edit.maximized);
        let pane = under.map(|(pane, _)| *pane).or(maximized).filter(can_be_kept);
        let Some(pane) = pane else {
            let found = "no view under the pointer";
            self.work.error =
                Some(AppError::wrong("a picture for the report", found, "the pointer over one"));
            return;
        };
        let size = self.pane_rect(pane).map_or(egui::vec2(700.0, 700.0), |rect| rect.size());
        let count =
            |work: &crate::command::Workstation| work.doc.as_ref().map_or(0, |doc| doc.edit.pictures.len());
        let before = count(&self.work);
        self.work.apply(&EditCommand::KeepPicture(pane, size.into()).into(), Instant::now());
        let now = count(&self.work);
        if now == before {
            let found = format!("{now} of them");
            self.work.error =
                Some(AppError::wrong("pictures for the report", found, "fewer, to keep another"));
            return;
        }
        let pictures = if now == 1 { "1 picture".to_owned() } else { format!("{now} pictures") };
        self.work.notice = Some(format!("Kept for the report: {} ({pictures})", pane.title()).into());
    }

    pub(super) fn open_file_dialog(&mut self, ctx: &Context, purpose: Purpose) {
        let folder = self.folder_for(&purpose);
        self.dialog = Some(Dialog::open(purpose, folder, &self.chooser, Waker::of(ctx)));
    }

    /// Carries out one command.
    pub(super) fn perform_app(&mut self, ctx: &Context, command: &AppCommand) {
        let wake = || Waker::of(ctx);
        match command {
            AppCommand::OpenDialog => self.open.path = Some(TypedPath::to_open()),
            AppCommand::BrowseFiles => self.open_file_dialog(ctx, Purpose::OpenFile),
            AppCommand::BrowseFolders => self.open_file_dialog(ctx, Purpose::OpenFolder),
            AppCommand::BeginReading { .. }
            | AppCommand::NextCase
            | AppCommand::GiveVerdict(_)
            | AppCommand::EndReading
            | AppCommand::ExportVerdicts
            | AppCommand::ExportVerdictsTo(_) => self.perform_reading(ctx, command),
            AppCommand::OpenCohort => self.open.path = Some(TypedPath::to_open_cohort()),
            AppCommand::BrowseCohorts => self.open_file_dialog(ctx, Purpose::OpenCohort),
            AppCommand::OpenCohortAt(folder) => {
                self.work.open_cohort(&absolute(folder));
                self.recent.add(folder);
            }
            AppCommand::OpenCohortCase(case) => self.open_cohort_case(ctx, case),
            AppCommand::ExportCohort => self.open_file_dialog(ctx, Purpose::CohortFigure),
            AppCommand::ExportCohortTo(path) => self.export_cohort(ctx, path),
            AppCommand::ShowCohort => {
                let has_case = self.work.doc.is_some();
                if let Some(cohort) = &mut self.work.cohort {
                    cohort.is_shown = !cohort.is_shown || !has_case;
                }
            }
            AppCommand::SetCohort(setting) => {
                if let Some(cohort) = &mut self.work.cohort {
                    cohort.setting = Some((**setting).clone());
                }
            }
            AppCommand::Open(_)
            | AppCommand::OpenFiles(_)
            | AppCommand::OpenSubject { .. }
            | AppCommand::OpenSample
            | AppCommand::OpenSession(_) => {
                if !self.asks_before(command) {
                    self.open_now(ctx, command);
                }
            }
            AppCommand::AddTracts(files) => self.work.add_tracts(files, wake()),
            AppCommand::ClearRecent => self.recent.clear(),
            AppCommand::SaveSession => match self.work.session_path.clone() {
                Some(path) => drop(self.save_to(&path)),
                None => self.open_file_dialog(ctx, self.save_session()),
            },
            AppCommand::SaveSessionAs => self.open_file_dialog(ctx, self.save_session()),
            AppCommand::SaveSessionTo(path) => {
                let saved = self.save_as(path);
                self.after_save(ctx, saved);
            }
            AppCommand::AcceptGuess(true) => self.work.accept_guess(wake()),
            AppCommand::AcceptGuess(false) | AppCommand::OrderDates(None) => self.work.drop_questions(),
            AppCommand::OrderDates(Some(order)) => self.work.order_dates(order.clone(), wake()),
            AppCommand::ShowCaseFiles => self.work.edit_case_files(wake()),
            AppCommand::OpenTransfer => self.open_file_dialog(ctx, Purpose::OpenTransfer),
            AppCommand::OpenTransferFrom(path) => self.open_transfer(path),
            AppCommand::SaveTransfer => self.open_file_dialog(ctx, Purpose::SaveTransfer),
            AppCommand::SaveTransferTo(path) => self.save_transfer(path),
            AppCommand::SaveManifest => self.open_file_dialog(ctx, Purpose::Manifest),
            AppCommand::SaveManifestTo(path) => self.save_manifest(path),
            AppCommand::CancelLoading => {
                if let Some(load) = &self.work.job {
                    load.job.progress.cancel();
                }
            }
            AppCommand::ScreenshotWindow => self.open_file_dialog(ctx, Purpose::Picture(None)),
            AppCommand::ScreenshotPane(pane) => self.open_file_dialog(ctx, Purpose::Picture(Some(*pane))),
            AppCommand::ScreenshotTo(pane, path) => self.take_picture(ctx, *pane, path),
            AppCommand::ExportMeasurements(format) => {
                self.open_file_dialog(ctx, Purpose::Measurements(*format));
            }
            AppCommand::ExportMeasurementsTo(path) => self.export_measurements(ctx, path),
            AppCommand::ExportMasks(what) => self.open_file_dialog(ctx, Purpose::Masks(*what)),
            AppCommand::ExportMasksTo(what, path) => self.export_masks(ctx, *what, path),
            AppCommand::ExportRulers(format) => self.open_file_dialog(ctx, Purpose::Rulers(*format)),
            AppCommand::ExportRulersTo(path) => self.export_rulers(path),
            AppCommand::GoToGrowth
            | AppCommand::GoToDisagreement
            | AppCommand::GoToRegion(_)
            | AppCommand::GoToComponent(..) => {
                self.going_to = Some(command.clone());
                self.go_to_pending();
            }
            AppCommand::ShowReport => {
                let remembered = self.preferences.get();
                let (language, is_pdf) = (remembered.report_language, remembered.report_pdf);
                let folder = self.folder_for(&Purpose::Report(report::Options::default()));
                let case = self.work.world.case();
                self.open.report = case.map(|case| report::ReportDialog::new(case, language, is_pdf, folder));
            }
            AppCommand::KeepPicture => self.keep_picture(ctx),
            AppCommand::WriteReport(options) => self.open_file_dialog(ctx, Purpose::Report(*options)),
            AppCommand::WriteReportTo(options, path) => {
                let remembered = self.preferences.change();
                remembered.report_language = options.language;
                match report::FileKind::of(path) {
                    Some(report::FileKind::Pages(report::Form::Pdf)) => remembered.report_pdf = true,
                    Some(report::FileKind::Pages(report::Form::Html)) => remembered.report_pdf = false,
                    _ => {}
                }
                let edit = self.work.doc.as_ref().map(|doc| &doc.edit);
                // A report without several dates says nothing about criteria.
                if self.work.world.time_point_count() > 1 {
                    let history = edit.and_then(|edit| edit.response.history.as_ref());
                    remembered.criterion = history.map(|history| history.criterion);
                }
                let reader = edit.map(|edit| edit.reading.reader.clone());
                self.preferences.remember_reader(&reader.unwrap_or_default());
                self.work.usual = self.preferences.usual();
                self.preferences.save();
                self.write_report(ctx, *options, path);
            }
            AppCommand::ShowPage => self.open.page = true,
            AppCommand::WritePage => self.open_file_dialog(ctx, Purpose::Page),
            AppCommand::WritePageTo(path) => self.write_page(ctx, path),
            AppCommand::OpenWritten(path) => {
                let file = path.clone();
                // The desktop's opener says whether it found a program.
                let job = Job::start(Waker::of(ctx), move |_| {
                    open::that(&file)
                        .map_err(|error| AppError::file(&file, error.to_string(), "a program that opens it"))
                });
                self.opening = Some((path.clone(), job));
            }
            AppCommand::ShowPalette => self.palette.open(),
            AppCommand::ShowMasks => self.open.masks = true,
            AppCommand::ShowPacs => self.open.pacs = Some(PacsDialog::new()),
            AppCommand::ShowMakeMask => self.open.make_mask = Some(MakeMask::new(&self.work)),
            AppCommand::ShowAlign => {
                self.open.align.get_or_insert_default();
            }
            AppCommand::ChooseTransform(time) => self.open_file_dialog(ctx, Purpose::Transform(time.clone())),
            AppCommand::ShiftDate(time, shift_mm) => {
                if let Some(doc) = self.work.doc.as_ref().filter(|_| shift_mm.is_finite()) {
                    let moves = DAffine3::from_translation(*shift_mm);
                    let alignments = align::moved_by_hand(&self.work, doc, time, moves);
                    self.work.apply(&EditCommand::SetAlignments(alignments).into(), Instant::now());
                }
            }
            AppCommand::AlignByFile(time, path) => {
                let align = self.open.align.get_or_insert_default();
                let alignment = align.by_file(time.clone(), absolute(path));
                if let Some(doc) = &self.work.doc {
                    let alignments = align::with_date(doc, time, Some(alignment));
                    self.work.apply(&EditCommand::SetAlignments(alignments).into(), Instant::now());
                }
            }
            AppCommand::Explain => {
                let kept = self.preferences.get();
                self.explain = Some(Explain::new(kept.points_per_mm, kept.explain_language));
            }
            AppCommand::ShowAbout => self.open.about = true,
            AppCommand::SaveLayout(name) => {
                let kept = self
                    .work
                    .doc
                    .as_ref()
                    .is_some_and(|doc| self.preferences.keep_layout(name, &doc.edit.layout));
                if !kept {
                    let why = format!(
                        "Layout not kept: a name of 1 to {MOST_LAYOUT_NAME} characters, and at most {MOST_LAYOUTS} layouts"
                    );
                    self.work.notice = Some(why.into());
                }
            }
            AppCommand::ForgetLayout(name) => self.preferences.forget_layout(name),
            AppCommand::ToggleDark => {
                let is_dark = ctx.global_style().visuals.dark_mode;
                ctx.set_theme(if is_dark { egui::Theme::Light } else { egui::Theme::Dark });
                self.preferences.change().dark = Some(!is_dark);
                self.preferences.save();
            }
            AppCommand::SetPictureSize(size) => {
                self.work.picture_size = *size;
                self.preferences.change().pictures = *size;
                self.preferences.save();
            }
            AppCommand::Quit => self.quit(ctx),
        }
    }

    /// Saves the session to `path`, with the ending of sessions; returns whether it was saved.
    fn save_as(&mut self, path: &Path) -> bool {
        let whole = session::with_ending(path.to_owned());
        // The dialog asked before it overwrites what was chosen, not this.
        if whole != path && whole.exists() {
            let expected = format!("a new name, or one with .{EXTENSION} to overwrite it");
            self.work.error = Some(AppError::file(&whole, "a file that exists", expected));
            return false;
        }
        // Who chooses a file to overwrite was asked.
        self.work.session_stamp = None;
        let saved = self.save_to(&whole);
        if saved {
            self.recent.add(&whole);
        }
        saved
    }

    fn take_picture(&mut self, ctx: &Context, pane: Option<PaneId>, path: &Path) {
        let crop = pane.and_then(|pane| self.pane_rect(pane));
        match pane {
            Some(pane) if crop.is_none() => {
                self.work.error =
                    Some(AppError::wrong(pane.title(), "a pane that isn't open", "an open one"));
            }
            _ if self.work.picture_size.is_of_screen() => {
                self.pictures.request(ctx, crop, path, self.work.inputs());
            }
            _ => self.take_enlarged(ctx, pane, path),
        }
    }

    /// Draws a picture with more pixels than the screen has, on a worker.
    fn take_enlarged(&mut self, ctx: &Context, pane: Option<PaneId>, path: &Path) {
        let (Some(doc), Some(gpu)) = (self.work.doc.clone(), self.gpu().cloned()) else {
            self.pictures.request(ctx, None, path, self.work.inputs());
            return;
        };
        let crop = pane.and_then(|pane| self.pane_rect(pane));
        let size_points = crop.unwrap_or_else(|| ctx.content_rect()).size();
        let size = self.work.picture_size;
        let picture = Enlarged {
            pane,
            size_points,
            pixels_per_point: size.pixels_per_point(size_points.x, ctx.pixels_per_point()),
            dark: ctx.global_style().visuals.dark_mode,
            doc,
            world: self.work.world.clone(),
            inputs: self.work.inputs(),
        };
        let path = path.to_owned();
        self.export = Some(Job::start(Waker::of(ctx), move |_| {
            picture
                .write(&gpu, &path)
                .map(|()| Notice::wrote(format!("Picture written to {}", path.display()), &path))
        }));
    }

    /// Runs on a worker: measuring a large case takes a while.
    fn export_measurements(&mut self, ctx: &Context, path: &Path) {
        let (Some(case), Some(doc)) = (self.work.world.case().cloned(), self.work.doc.clone()) else {
            return;
        };
        let compared = self.results.comparison.cached(&case, &doc.edit.change);
        let shown = Shown {
            compared: compared.map(|compared| match self.results.surroundings.cached(compared) {
                Some(looked) => looked.report.clone(),
                None => compared.report.clone(),
            }),
            tumor: self.work.world.tumor(&doc).cloned(),
            inputs: self.work.inputs(),
            response: None,
            case,
            doc,
        };
        let path = path.to_owned();
        self.export = Some(Job::start(Waker::of(ctx), move |progress| {
            shown
                .write(&path, progress)
                .map(|()| Notice::wrote(format!("Numbers written to {}", path.display()), &path))
        }));
    }

    /// Writes the masks of the date shown, or its selection, without what identifies the patient.
    fn export_masks(&mut self, ctx: &Context, what: What, path: &Path) {
        let (Some(case), Some(doc)) = (self.work.world.case().cloned(), self.work.doc.clone()) else {
            return;
        };
        let (colors, inputs, path) = (self.work.world.colors(&doc), self.work.inputs(), path.to_owned());
        self.export = Some(Job::start(Waker::of(ctx), move |progress| {
            let Some(time_point) = case.time_points.get(doc.nav.time) else {
                return Err(AppError::file(&path, "no date", "one that is shown"));
            };
            let Some(format) = Format::of(&path) else {
                let expected = ".seg.nrrd, .dcm, .nii.gz, .stl, .obj or .glb";
                return Err(AppError::file(&path, "another ending", expected));
            };
            let name_of = |id: &str| doc.edit.masks.get(id).name;
            let selection = doc.edit.selection.at(&time_point.regions);
            let shows = |bits: u32| selection.shows(bits);
            let items = match what {
                What::Selection => export::selection(time_point, &colors, &shows),
                What::Regions => export::regions(time_point, &colors, &shows),
                What::Masks => export::masks(time_point, &colors, &name_of, &|_| true),
            };
            // Files are read again for it, and only DICOM names its image.
            let spec = if format.is_dicom() {
                load::spec_of(&doc.case, &LoadOptions::default(), progress)?
            } else {
                CaseSpec::default()
            };
            let export = Export {
                case: &case,
                spec: &spec,
                inputs,
                time_point,
                items,
                what: what.word().to_owned(),
                format,
                is_smooth: false,
                is_identified: false,
                // The dialog asked.
                overwrites: true,
                image: None,
                salt: None,
            };
            let written = export.write(&path, progress)?;
            let notes =
                written.notes.into_iter().chain(written.checks.into_iter().map(|check| check.message));
            let notes: Vec<String> = notes.collect();
            let text = format!("Masks written to {}", path.display());
            Ok(if notes.is_empty() { text } else { format!("{text} ({})", notes.join("; ")) }.into())
        }));
    }

    /// Writes a report of what is shown, on a worker.
    fn write_report(&mut self, ctx: &Context, options: report::Options, path: &Path) {
        let (Some(doc), Some(gpu)) = (self.work.doc.clone(), self.gpu().cloned()) else {
            self.work.error =
                Some(AppError::file(path, "no graphics adapter", "one, which draws the report's pictures"));
            return;
        };
        let (world, inputs, path) = (self.work.world.clone(), self.work.inputs(), path.to_owned());
        self.work.notice = Some("Writing the report…".into());
        self.export = Some(Job::start(Waker::of(ctx), move |progress| {
            report::write(doc, &world, options, (&gpu, &inputs), &path, progress)
        }));
    }

    fn write_page(&mut self, ctx: &Context, path: &Path) {
        let Some(doc) = self.work.doc.clone() else { return };
        let (world, inputs, path) = (self.work.world.clone(), self.work.inputs(), path.to_owned());
        self.work.notice = Some("Writing the page…".into());
        self.export = Some(Job::start(Waker::of(ctx), move |progress| {
            take_home::write(&doc, &world, &inputs, &path, progress)
        }));
    }

    fn save_manifest(&mut self, path: &Path) {
        let written = self.work.manifest_for(path).and_then(|text| Ok(write_whole(path, text.as_bytes())?));
        match written {
            Ok(()) => self.work.notice = Some(format!("Manifest written to {}", path.display()).into()),
            Err(error) => self.work.error = Some(error),
        }
    }

    fn open_transfer(&mut self, path: &Path) {
        let context = self.work.doc.as_ref().and_then(|doc| self.work.world.context(doc));
        let Some(id) = context.map(|(id, _)| id.to_owned()) else { return };
        match transfer_file::load(path) {
            Ok(transfer) => {
                self.work.apply(&EditCommand::SetTransfer(id, Some(transfer)).into(), Instant::now());
            }
            Err(error) => self.work.error = Some(error.into()),
        }
    }

    fn save_transfer(&mut self, path: &Path) {
        let Some(doc) = &self.work.doc else { return };
        let Some((id, image)) = self.work.world.context(doc) else { return };
        let inputs = self.work.inputs();
        let save = || transfer_file::save(path, &transfer_of(doc, id, image));
        match inputs.refuse_as_output(path).and_then(|()| save()) {
            Ok(()) => self.work.notice = Some("Transfer function written.".into()),
            Err(error) => self.work.error = Some(error.into()),
        }
    }

    fn export_rulers(&mut self, path: &Path) {
        let (Some(case), Some(doc)) = (self.work.world.case(), &self.work.doc) else { return };
        match output::write_rulers(path, &self.work.inputs(), case, &doc.edit.rulers) {
            Ok(()) => self.work.notice = Some("Lines written.".into()),
            Err(error) => self.work.error = Some(error),
        }
    }
}
