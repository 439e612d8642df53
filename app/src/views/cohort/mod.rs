//! A cohort: the overlap diagrams of its cases as a grid of glyphs (thesis 7.9), sorted, filtered and coloured by the cohort's tables.
//!
//! Drawing reads the tables and the setting and pushes commands; what is derived (values, order, glyphs) is kept only to be drawn again.

mod color;
mod controls;
mod figure;
mod glyph;
mod grid;
mod picker;
pub mod reading;
mod strip;

use std::sync::Arc;

use egui::{Panel, Ui};
use glioscope_cohort::{Collected, Date};

use crate::{
    command::Commands,
    model::cohort::{CohortSetting, OpenCohort},
    views::draw,
    world::{
        cohort::{Cohorts, Columns, shown},
        jobs::{Ask, Derived, Handle, Lookup, progress_text},
    },
};
use color::Colors;
pub use figure::Figure;
use glyph::Glyphs;

/// The cohort's view: what is derived from the tables.
#[derive(Default)]
pub struct CohortView {
    columns: Columns,
    glyphs: Derived<(Handle<Collected>, Vec<String>, Date), Glyphs>,
    /// The cases that pass the filters, in their order, and of which tables and setting.
    shown: Option<(Handle<Collected>, CohortSetting, Vec<usize>)>,
    /// The setting that suits these tables.
    suited: Option<(Handle<Collected>, CohortSetting)>,
}

impl CohortView {
    /// Draws the cohort into all of `ui`. `has_case`: a case is open behind it.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        open: &OpenCohort,
        has_case: bool,
        (cohorts, ask): (&mut Cohorts, &Ask),
        out: &mut Commands,
    ) {
        let collected = match cohorts.get(open, ask) {
            Lookup::Ready(collected) => collected.clone(),
            Lookup::Working(progress) => {
                let text = format!("Reading the cohort's tables: {}", progress_text(progress));
                let rect = ui.available_rect_before_wrap();
                draw::message(ui, rect, &text);
                return;
            }
            Lookup::Failed(why) => {
                let rect = ui.available_rect_before_wrap();
                draw::message(ui, rect, &why.to_string());
                return;
            }
        };
        if open.reading.as_ref().is_some_and(|reading| reading.verdicts.names_hidden) {
            // The tables name who made what.
            let rect = ui.available_rect_before_wrap();
            draw::message(ui, rect, "Names are hidden while you read. End reading to see the cohort.");
            return;
        }
        self.columns.turn_to(&collected);
        let setting = self.setting(open, &collected);
        let is_new = self.order(&collected, &setting);
        let glyphs = self.glyphs(&collected, &setting, ask);
        let colors = self.colors(&collected, &setting);
        let Self { columns, shown, .. } = self;
        let shown: &[usize] = shown.as_ref().map_or(&[], |(_, _, cases)| cases);
        Panel::top("cohort controls").show(ui, |ui| {
            let of = (&*collected, &*columns, shown.len());
            controls::show(ui, (open, has_case), &setting, of, (colors.as_ref(), glyphs.as_deref()), out);
        });
        Panel::bottom("cohort strip").show(ui, |ui| {
            strip::show(ui, &setting, (&collected, shown), columns, out);
        });
        draw::padded(ui, |ui| {
            if shown.is_empty() {
                ui.label("No case passes the filters.");
                return;
            }
            let input = grid::GridInput {
                collected: &collected,
                setting: &setting,
                shown,
                glyphs: glyphs.as_deref(),
                colors: colors.as_ref(),
                from_the_top: is_new,
            };
            grid::show(ui, &input, columns, out);
        });
    }

    fn colors(&mut self, collected: &Collected, setting: &CohortSetting) -> Option<Colors> {
        let quantity = setting.color.as_ref()?;
        let unit = self.columns.offer(quantity).map_or("", |offer| offer.unit);
        let values = self.columns.get(collected, quantity);
        Some(Colors::new(values, self.columns.drawn(quantity), unit))
    }

    /// How the cohort is shown: as chosen, else as suits its tables, which are all looked through for that.
    fn setting(&mut self, open: &OpenCohort, collected: &Arc<Collected>) -> CohortSetting {
        if let Some(chosen) = &open.setting {
            return chosen.clone();
        }
        let handle = Handle::of(collected);
        let held = self.suited.take().filter(|(of, _)| *of == handle);
        let suited = held.unwrap_or_else(|| (handle, CohortSetting::suited_to(collected)));
        self.suited.insert(suited).1.clone()
    }

    /// The grid as a figure, as it was last drawn; `None` before that.
    pub fn figure(&mut self, open: &OpenCohort, cohorts: &Cohorts) -> Option<Figure> {
        let collected = cohorts.last()?.clone();
        let setting = self.setting(open, &collected);
        let (shown, glyphs) = (self.shown.as_ref()?.2.clone(), self.glyphs.last()?.clone());
        let colors = self.colors(&collected, &setting);
        Some(Figure { name: open.name(), collected, setting, shown, glyphs, colors })
    }

    /// Whether nothing that is drawn is still computed.
    pub fn ready(&mut self) -> bool {
        !self.glyphs.working()
    }

    /// Sorts and filters where tables or setting are others than before; returns whether they are.
    fn order(&mut self, collected: &Arc<Collected>, setting: &CohortSetting) -> bool {
        let handle = Handle::of(collected);
        let matters = |setting: &CohortSetting| CohortSetting {
            masks: Vec::new(),
            date: Date::default(),
            cell_points: 0.0,
            color: None,
            ..setting.clone()
        };
        let wanted = matters(setting);
        if self.shown.as_ref().is_some_and(|(of, before, _)| *of == handle && *before == wanted) {
            return false;
        }
        let cases = shown(collected, setting, &mut self.columns);
        self.shown = Some((handle, wanted, cases));
        true
    }

    /// The glyphs of all cases, laid out on a worker; `None` until they are.
    fn glyphs(
        &mut self,
        collected: &Arc<Collected>,
        setting: &CohortSetting,
        ask: &Ask,
    ) -> Option<Arc<Glyphs>> {
        let key = (Handle::of(collected), setting.masks.clone(), setting.date);
        let (of, masks, date) = (collected.clone(), setting.masks.clone(), setting.date);
        let lookup =
            self.glyphs.get(key, ask, move |_| Ok(Glyphs::new(&of.overlaps(&masks, date), masks.len())));
        match lookup {
            Lookup::Ready(glyphs) => Some(glyphs.clone()),
            Lookup::Working(_) | Lookup::Failed(_) => None,
        }
    }
}
