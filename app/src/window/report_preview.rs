//! What a report's first page says, beside the dialog that writes it.

use std::sync::Arc;

use egui::{Grid, Label, RichText, ScrollArea, Ui};
use glioscope_core::case::Case;

use crate::{
    error::AppError,
    model::{Document, Reading},
    report::{self, Block, Found, Front, Options, Table},
    world::jobs::{Job, Waker, progress_text},
};

/// What the page depends on while the dialog is open.
type Key = (Options, Reading);

/// What was found of the case as a report with that much of the identity shows it, and the page.
type Shown = (Arc<Found>, Front);

/// The first page of the report of one case that would be written now: computed on a worker, the one before shown meanwhile.
#[derive(Default)]
pub struct Preview {
    shown: Option<(Key, Result<Shown, AppError>)>,
    job: Option<(Key, Job<Shown>)>,
}

impl Preview {
    /// Draws it, `width` and `height` points large.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        case: &Arc<Case>,
        doc: &Document,
        (options, width, height): (Options, f32, f32),
    ) {
        self.update(ui, case, doc, (options, doc.edit.reading.clone()));
        ui.vertical(|ui| {
            ui.set_width(width);
            ui.strong("What its first page says");
            // As high with little as with much: nothing beside it moves when the page is there.
            let area =
                ScrollArea::vertical().id_salt("first page").max_height(height).min_scrolled_height(height);
            area.auto_shrink([false, false]).show(ui, |ui| match (&self.shown, &self.job) {
                (Some((_, Ok((_, front)))), _) => page(ui, front),
                (Some((_, Err(error))), _) => {
                    ui.colored_label(ui.visuals().error_fg_color, error.to_string());
                }
                (None, Some((_, job))) => {
                    ui.weak(progress_text(&job.progress));
                }
                (None, None) => {}
            });
        });
    }

    /// Takes what has been computed, and starts what hasn't.
    fn update(&mut self, ui: &Ui, case: &Arc<Case>, doc: &Document, key: Key) {
        if let Some((of, job)) = self.job.take() {
            match job.poll() {
                Some(result) => self.shown = Some((of, result)),
                None => self.job = Some((of, job)),
            }
        }
        if self.job.is_some() || self.shown.as_ref().is_some_and(|(of, _)| *of == key) {
            return;
        }
        let options = key.0;
        let known = match &self.shown {
            Some(((of, _), Ok((found, _)))) if of.identity == options.identity => Some(found.clone()),
            _ => None,
        };
        let (case, doc) = (case.clone(), doc.clone());
        let job = Job::start(Waker::of(ui.ctx()), move |progress| {
            let shown = report::anonymous(&case, doc, options)?;
            let found = match known {
                Some(found) => found,
                None => Arc::new(Found::of(&shown.case, &shown.doc, None, true, progress)?),
            };
            let front = found.preview(&shown.case, &shown.doc, options);
            Ok((found, front))
        });
        self.job = Some((key, job));
    }
}

fn page(ui: &mut Ui, front: &Front) {
    ui.label(RichText::new(&front.title).heading());
    for (n, block) in front.blocks.iter().enumerate() {
        match block {
            Block::Heading(text) => {
                ui.add_space(6.0);
                ui.strong(text);
            }
            Block::Text(text) => {
                ui.label(text);
            }
            Block::Findings(all) => {
                for finding in all {
                    let warn = ui.visuals().warn_fg_color;
                    let color = if finding.is_warning { warn } else { ui.visuals().text_color() };
                    ui.colored_label(color, &finding.text);
                }
            }
            Block::Facts(all) => {
                for (name, value) in all {
                    ui.horizontal_wrapped(|ui| {
                        ui.weak(name);
                        ui.label(value);
                    });
                }
            }
            Block::Table(one) => table(ui, n, one),
            // None stands before the pictures.
            Block::Picture(_) | Block::Plot(_) => {}
        }
    }
}

fn table(ui: &mut Ui, n: usize, one: &Table) {
    let columns = one.head.len().max(1);
    let spacing = 10.0;
    let width = ((ui.available_width() - spacing * columns as f32) / columns as f32).max(40.0);
    Grid::new(("table", n)).striped(true).spacing([spacing, 2.0]).show(ui, |ui| {
        let cell = |ui: &mut Ui, text: RichText| {
            ui.scope(|ui| {
                ui.set_max_width(width);
                ui.add(Label::new(text).wrap());
            });
        };
        for head in &one.head {
            cell(ui, RichText::new(head).weak());
        }
        ui.end_row();
        for row in &one.rows {
            for text in row {
                cell(ui, RichText::new(text));
            }
            ui.end_row();
        }
    });
    if let Some(note) = &one.note {
        ui.weak(note);
    }
}
