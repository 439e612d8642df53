//! Lesions over time: a timeline of their components, which the user links, parts and names, and the numbers of each.

mod actions;
mod numbers;
mod selected;
mod timeline;

use egui::{ComboBox, DragValue, ScrollArea, Ui};
use glioscope_core::lesions::{Edit, LesionsReport};

use super::{
    draw,
    pane::{Input, Pane, Stage},
};
use crate::{
    command::{Commands, EditCommand},
    model::{CaseRef, LesionSetting, lesions::SMALLEST_ML},
    world::jobs::{Lookup, progress_text},
};

pub(super) use actions::{NEXT, VERIFY, is_pressed, next, verify, verify_meant};
pub(super) use selected::Selected;
pub(super) use timeline::go_to;

/// The pane of lesions.
#[derive(Default)]
pub struct LesionsPane {
    /// The case that the rest is of: another one's dates may have the same labels.
    of: Option<CaseRef>,
    /// Whether small lesions are shown too.
    small: bool,
    /// The name being typed, and the lesion's component.
    naming: Option<actions::Naming>,
    /// The component that is to be split, while its neck is looked for; then why it has none.
    splitting: Option<actions::Splitting>,
}

impl Pane for LesionsPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        draw::padded(ui, |ui| {
            ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| self.content(ui, stage, out));
        });
    }
}

fn selected_id() -> egui::Id {
    egui::Id::unique("selected of lesions")
}

/// What is selected among the lesions of the case: one for all panes that show them.
pub(super) fn selected(ui: &Ui, input: &Input<'_>) -> Selected {
    let stored = ui.data(|data| data.get_temp::<(CaseRef, Selected)>(selected_id()));
    stored.filter(|(of, _)| *of == input.doc.case).map(|(_, selected)| selected).unwrap_or_default()
}

/// Selects among the lesions of the case.
pub(super) fn select(ui: &Ui, input: &Input<'_>, selected: &Selected) {
    ui.data_mut(|data| data.insert_temp(selected_id(), (input.doc.case.clone(), selected.clone())));
}

impl LesionsPane {
    fn content(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        let input = stage.input;
        if self.of.as_ref() != Some(&input.doc.case) {
            *self = Self { of: Some(input.doc.case.clone()), small: self.small, ..Self::default() };
        }
        let setting = &input.doc.edit.lesions;
        let Some(mask) = setting.mask(input.case, &input.doc.edit.change) else {
            ui.weak("The case has no mask");
            return;
        };
        self.head(ui, &input, &mask, out);
        let report = match stage.results.lesions.get(input.case, (setting, &input.doc.edit.change), stage.ask)
        {
            Some(Lookup::Ready(report)) => report.clone(),
            Some(Lookup::Failed(error)) => {
                ui.colored_label(ui.visuals().error_fg_color, error.to_string());
                return;
            }
            Some(Lookup::Working(progress)) => {
                ui.weak(progress_text(progress));
                match stage.results.lesions.last().filter(|last| last.of == mask) {
                    Some(last) => last.clone(),
                    None => return,
                }
            }
            None => return,
        };
        warnings(ui, &report);
        let mut selected = selected(ui, &input);
        selected.keep_in(&report);
        let all = report.lesions.iter().filter(|lesion| self.small || !lesion.small);
        let shown: Vec<_> = all.take(timeline::MOST_LESIONS).collect();
        timeline::show(ui, &input, &report, &shown, &mut selected, out);
        self.split(stage, &selected, out);
        let chosen = actions::Chosen {
            selected: &mut selected,
            naming: &mut self.naming,
            splitting: &mut self.splitting,
        };
        actions::show(ui, &input, &report, chosen, out);
        select(ui, &input, &selected);
        ui.add_space(6.0);
        numbers::show(ui, &report, &shown);
    }

    /// Splits the component that is to be, once its neck is known.
    fn split(&mut self, stage: &mut Stage<'_>, selected: &Selected, out: &mut Commands) {
        let Some(splitting) = self.splitting.as_mut().filter(|splitting| splitting.why_not.is_none()) else {
            return;
        };
        if *selected != Selected::One(splitting.at.clone()) {
            self.splitting = None;
            return;
        }
        let setting = &stage.input.doc.edit.lesions;
        match stage.results.lesions.neck(setting, &splitting.at, stage.ask) {
            Some(Lookup::Ready(neck)) => match neck.as_ref() {
                Ok(neck) => {
                    let at = splitting.at.clone();
                    out.push(EditCommand::EditLesions(vec![Edit::Split { at, seeds_mm: neck.seeds_mm }]));
                    self.splitting = None;
                }
                Err(why) => splitting.why_not = Some(why.clone()),
            },
            Some(Lookup::Failed(error)) => splitting.why_not = Some(error.to_string()),
            Some(Lookup::Working(_)) => {}
            None => self.splitting = None,
        }
    }

    fn head(&mut self, ui: &mut Ui, input: &Input<'_>, mask: &str, out: &mut Commands) {
        let setting = &input.doc.edit.lesions;
        let mut new = setting.clone();
        ui.horizontal_wrapped(|ui| {
            let label = ui.label("Lesions of");
            let name = |id: &str| input.doc.edit.masks.name(id);
            let combo = ComboBox::from_id_salt("mask of lesions").selected_text(name(mask));
            let shown = combo.show_ui(ui, |ui| {
                for id in input.case.mask_ids() {
                    if ui.selectable_label(id == mask, name(id)).clicked() {
                        new.of = Some(id.to_owned());
                    }
                }
            });
            shown.response.labelled_by(label.id);
            let label = ui.label("small below").on_hover_text(
                "Smaller components are neither new, gone nor pieces of a split: most are flecks of a segmentation's edge",
            );
            ui.add(DragValue::new(&mut new.smallest_ml).range(SMALLEST_ML).speed(0.01).suffix(" ml"))
                .labelled_by(label.id);
            ui.checkbox(&mut self.small, "show small ones");
            beside(ui, input, &mut new);
        });
        if new != *setting {
            out.push(EditCommand::SetLesions(Box::new(LesionSetting {
                edits: setting.edits.clone(),
                ..new
            })));
        }
    }
}

/// What is reported beside sizes: values of an image, and how surfaces moved.
fn beside(ui: &mut Ui, input: &Input<'_>, new: &mut LesionSetting) {
    let ids = input.case.image_ids();
    if !ids.is_empty() {
        let label = ui
            .label("values of")
            .on_hover_text("Mean, most, and the highest mean in a ball of 1 ml, of each lesion");
        let chosen = new.image.clone().filter(|image| ids.contains(&image.as_str()));
        let combo = ComboBox::from_id_salt("image of lesions");
        let shown = combo.selected_text(chosen.as_deref().unwrap_or("no image")).show_ui(ui, |ui| {
            ui.selectable_value(&mut new.image, None, "no image");
            for id in ids {
                ui.selectable_value(&mut new.image, Some(id.to_owned()), id);
            }
        });
        shown.response.labelled_by(label.id);
    }
    if input.case.time_points.len() > 1 {
        ui.checkbox(&mut new.surface, "surface change")
            .on_hover_text("How far each lesion's surface moved since the date before");
    }
}

/// What is uncertain, and what has no effect.
fn warnings(ui: &mut Ui, report: &LesionsReport) {
    let not_linked = report.pairs.iter().filter_map(|pair| {
        let why = pair.not_linked.as_ref()?;
        Some(format!("{} to {}: {why}; lesions are not linked", pair.from, pair.to))
    });
    let lost = report
        .edits_not_applied
        .iter()
        .map(|lost| format!("Your edit {} has no effect: {}", lost.number + 1, lost.reason));
    let proposed = report.proposed().count();
    let proposed_text = match proposed {
        0 => "Every link is verified".to_owned(),
        1 => "1 link is proposed by the program and not verified".to_owned(),
        several => format!("{several} links are proposed by the program and not verified"),
    };
    if !report.ignored.is_empty() {
        let text = match report.ignored.len() {
            1 => "1 component is ignored: Your edits, Take back".to_owned(),
            several => format!("{several} components are ignored: Your edits, Take back"),
        };
        ui.weak(text);
    }
    for text in report.warnings.iter().cloned().chain(not_linked).chain(lost) {
        ui.colored_label(ui.visuals().warn_fg_color, text);
    }
    // Where there are links, a line always: what is below, such as *Ignore*, doesn't move under the pointer when the last is verified.
    if !report.links.is_empty() {
        let (warn, weak) = (ui.visuals().warn_fg_color, ui.visuals().weak_text_color());
        ui.colored_label(if proposed > 0 { warn } else { weak }, proposed_text);
    }
}
