//! Commands of the cohort: opening its cases, reading them, writing what is shown of it.

use std::{path::Path, time::Instant};

use egui::Context;
use glioscope_cohort::{Verdict, Verdicts, agreement};
use glioscope_core::{
    csv,
    files::{refuse_link, write_whole},
};

use super::{
    GlioscopeApp,
    dialogs::{Purpose, open_command},
};
use crate::{
    command::{AppCommand, Notice},
    error::AppError,
    model::cohort::{CohortReading, OpenCohort},
    world::jobs::{Job, Waker},
};

impl GlioscopeApp {
    /// Opens a case of the cohort from the files that its results name. While a list is read it is the case that is read.
    pub(super) fn open_cohort_case(&mut self, ctx: &Context, case: &str) {
        let Some(collected) = self.results.cohort.last() else { return };
        match collected.source(case) {
            Ok((path, derivatives)) => {
                if let Some(reading) = self.work.cohort.as_mut().and_then(|open| open.reading.as_mut()) {
                    reading.current = Some((case.to_owned(), path.clone()));
                }
                let command = match derivatives.is_empty() {
                    true => open_command(path),
                    false => AppCommand::OpenSubject { folder: path, derivatives }.into(),
                };
                self.perform(ctx, &command, Instant::now());
            }
            Err(error) => self.work.error = Some(error.into()),
        }
    }

    /// Writes the cohort's diagrams on a worker.
    pub(super) fn export_cohort(&mut self, ctx: &Context, path: &Path) {
        let figure =
            self.work.cohort.as_ref().and_then(|open| self.cohort.figure(open, &self.results.cohort));
        let Some(figure) = figure else {
            self.work.error = Some(AppError::file(path, "no cohort that is shown", "one, to draw it"));
            return;
        };
        let path = path.to_owned();
        self.export = Some(Job::start(Waker::of(ctx), move |progress| {
            // Its inputs are the whole cohort's: a link may lead to any of them.
            refuse_link(&path)?;
            figure
                .write(&path, progress)
                .map(|()| Notice::wrote(format!("Diagrams written to {}", path.display()), &path))
        }));
    }

    /// Carries out a command of reading.
    pub(super) fn perform_reading(&mut self, ctx: &Context, command: &AppCommand) {
        match command {
            AppCommand::BeginReading { reader, seed, names_hidden } => {
                self.begin_reading(ctx, reader, *seed, *names_hidden);
            }
            AppCommand::NextCase => self.next_case(ctx),
            AppCommand::GiveVerdict(verdict) => self.give_verdict(verdict),
            AppCommand::EndReading => {
                if let Some(open) = &mut self.work.cohort {
                    open.reading = None;
                    open.is_shown = true;
                }
            }
            AppCommand::ExportVerdicts => self.open_file_dialog(ctx, Purpose::Verdicts),
            AppCommand::ExportVerdictsTo(path) => self.export_verdicts(path),
            _ => {}
        }
    }

    fn begin_reading(&mut self, ctx: &Context, reader: &str, seed: u64, names_hidden: bool) {
        let (Some(collected), Some(open)) = (self.results.cohort.last(), &mut self.work.cohort) else {
            return;
        };
        match Verdicts::begin(&open.folder, reader, seed, names_hidden, collected.cases()) {
            Ok(verdicts) => {
                open.reading = Some(CohortReading { verdicts, current: None, agreement: Vec::new() });
                self.work.error = agreed(open).err();
                self.next_case(ctx);
            }
            Err(error) => self.work.error = Some(error.into()),
        }
    }

    fn next_case(&mut self, ctx: &Context) {
        let Some(reading) = self.work.reading() else { return };
        let current = reading.current.as_ref().map(|(case, _)| case.as_str());
        match reading.verdicts.next(current).map(str::to_owned) {
            Some(case) => self.open_cohort_case(ctx, &case),
            None => self.work.notice = Some("Every other case of your list has a verdict.".into()),
        }
    }

    fn give_verdict(&mut self, verdict: &Verdict) {
        let Some(case) = self.work.read_case().map(str::to_owned) else { return };
        let Some(open) = &mut self.work.cohort else { return };
        let folder = open.folder.clone();
        let Some(reading) = &mut open.reading else { return };
        let given = reading.verdicts.give(&folder, &case, verdict.clone()).map_err(AppError::from);
        self.work.error = given.and_then(|()| agreed(open)).err();
    }

    fn export_verdicts(&mut self, path: &Path) {
        let Some(open) = &self.work.cohort else { return };
        match export(&open.folder, path) {
            Ok(()) => self.work.notice = Some(format!("Verdicts written to {}", path.display()).into()),
            Err(error) => self.work.error = Some(error),
        }
    }
}

/// Computes the agreement of all readers anew.
fn agreed(open: &mut OpenCohort) -> Result<(), AppError> {
    let lists = Verdicts::all(&open.folder)?;
    if let Some(reading) = &mut open.reading {
        reading.agreement = agreement(&lists);
    }
    Ok(())
}

/// Writes the verdicts of all readers, and how far they agree beside it: `verdicts.csv`, `verdicts-agreement.csv`.
fn export(folder: &Path, path: &Path) -> Result<(), AppError> {
    let lists = Verdicts::all(folder)?;
    if lists.is_empty() {
        return Err(AppError::file(&folder.join("verdicts"), "no reader's verdicts", "some, to export them"));
    }
    let name = path.file_stem().map_or_else(|| "verdicts".into(), |name| name.to_string_lossy().into_owned());
    let beside = path.with_file_name(format!("{name}-agreement.csv"));
    refuse_link(path)?;
    refuse_link(&beside)?;
    write_whole(path, &Verdicts::exported(&lists)?)?;
    let mut table = csv::Table::new(["coefficient", "readers", "cases", "value"]);
    for one in agreement(&lists) {
        let value = one.value.map(|value| value.to_string()).unwrap_or_default();
        table.row([one.name.to_owned(), csv::text(&one.readers.join("; ")), one.cases.to_string(), value]);
    }
    Ok(write_whole(&beside, &table.into_bytes())?)
}
