//! The dialog that makes a mask of what is shown.

use egui::{Button, DragValue, Grid, TextEdit, Ui};

use super::modal::{self, Reply};
use crate::{
    command::{Commands, EditCommand, Workstation},
    model::{Document, made::LONGEST_ID},
    world::make_mask::{MadeOf, make, raters},
};

const WIDTH_POINTS: f32 = 420.0;
const FIELD_POINTS: f32 = 220.0;

/// What the dialog holds.
pub struct MakeMask {
    id: String,
    author: String,
    of: MadeOf,
    /// For [`MadeOf::Agreement`].
    least: u32,
    /// Why the last try made none.
    problem: Option<String>,
}

impl MakeMask {
    /// The dialog as it opens: with a free name, and the author of the last mask or the user's name in the system.
    pub fn new(work: &Workstation) -> Self {
        let last =
            work.doc.as_ref().and_then(|doc| doc.edit.made.last()).and_then(|made| made.author.clone());
        let user = || ["USER", "USERNAME"].iter().find_map(|name| std::env::var(name).ok());
        let masks =
            work.doc.as_ref().and_then(|doc| Some(raters(doc, work.world.time_point(doc)?).count_ones()));
        let numbered = (2..).map(|n| format!("consensus {n}"));
        let mut names = std::iter::once("consensus".to_owned()).chain(numbered);
        Self {
            id: names.find(|name| !is_taken(work, name)).unwrap_or_default(),
            author: last.or_else(user).unwrap_or_default(),
            of: MadeOf::Selection,
            least: masks.unwrap_or_default() / 2 + 1,
            problem: None,
        }
    }
}

/// Whether the date shown has a mask of this id.
fn is_taken(work: &Workstation, id: &str) -> bool {
    let time_point = work.doc.as_ref().and_then(|doc| work.world.time_point(doc));
    time_point.is_some_and(|time_point| time_point.masks.iter().any(|mask| mask.mask.id() == id))
}

/// Draws the dialog while it is open.
pub fn show(ui: &Ui, open: &mut Option<MakeMask>, work: &Workstation, out: &mut Commands) {
    let (Some(dialog), Some(doc)) = (open.as_mut(), work.doc.as_ref()) else { return };
    let problem = fault(dialog, work);
    let mut entered = false;
    let reply = modal::show(ui.ctx(), "Make a mask of the selection", |ui| {
        ui.set_width(WIDTH_POINTS);
        ui.label(
            "A mask of the date shown, beside those of the case, which stay as they are. It is saved in the session, and \
             exported like the others.",
        );
        ui.add_space(6.0);
        choices(ui, dialog, doc, work);
        ui.add_space(6.0);
        Grid::new("new mask").num_columns(2).show(ui, |ui| {
            for (label, text) in [("Name", &mut dialog.id), ("Made by", &mut dialog.author)] {
                let name = ui.label(label).id;
                let field = [FIELD_POINTS, ui.spacing().interact_size.y];
                let response = ui.add_sized(field, TextEdit::singleline(text)).labelled_by(name);
                entered |= modal::entered(ui, &response);
                ui.end_row();
            }
        });
        if let Some(problem) = problem.as_ref().or(dialog.problem.as_ref()) {
            ui.colored_label(ui.visuals().error_fg_color, problem);
        }
        ui.add_space(6.0);
        let mut reply = Reply::None;
        ui.horizontal(|ui| {
            if ui.add_enabled(problem.is_none(), Button::new("Make it")).clicked() {
                reply = Reply::Accept;
            }
            if ui.button("Cancel").clicked() {
                reply = Reply::Cancel;
            }
        });
        reply
    });
    match if entered { Reply::Accept } else { reply } {
        Reply::None => {}
        Reply::Cancel => *open = None,
        Reply::Accept if problem.is_some() => {}
        Reply::Accept => {
            let author = Some(dialog.author.trim().to_owned()).filter(|author| !author.is_empty());
            match make(&work.world, doc, dialog.of, dialog.id.trim(), author) {
                Ok(made) => {
                    out.push(EditCommand::MakeMask(Box::new(made)));
                    *open = None;
                }
                Err(why) => dialog.problem = Some(why),
            }
        }
    }
}

/// Why the mask can't be made, as far as that is known before.
fn fault(dialog: &MakeMask, work: &Workstation) -> Option<String> {
    let id = dialog.id.trim();
    match () {
        () if id.is_empty() => Some("The mask needs a name.".into()),
        () if id.chars().count() > LONGEST_ID => {
            Some(format!("The name is longer than {LONGEST_ID} characters."))
        }
        () if id.contains(['=', '+', ',', '/', '\\']) || id.chars().any(char::is_control) => {
            Some("The name has one of = + , / \\, which stand for something else on the command line.".into())
        }
        () if is_taken(work, id) => Some(format!("This date has a mask {id}.")),
        () => None,
    }
}

fn choices(ui: &mut Ui, dialog: &mut MakeMask, doc: &Document, work: &Workstation) {
    let Some(time_point) = work.world.time_point(doc) else { return };
    let selection = work.world.selection(doc);
    let regions = &time_point.regions;
    let shown = regions.list().iter().filter(|region| selection.shows(region.bits));
    let shown_ml: f64 = shown.map(|region| region.volume_ml).sum();
    let raters = raters(doc, time_point);
    let masks = raters.count_ones();
    let agreed = regions.list().iter().filter(|region| (region.bits & raters).count_ones() >= dialog.least);
    let agreed_ml: f64 = agreed.map(|region| region.volume_ml).sum();
    let before = dialog.of;
    let selection = format!("What is selected: {}", crate::format::ml(shown_ml));
    ui.radio_value(&mut dialog.of, MadeOf::Selection, selection);
    let in_lens = egui::RadioButton::new(dialog.of == MadeOf::InLens, "Of that, what is inside the lens");
    if ui.add_enabled(doc.edit.lens_on, in_lens).clicked() {
        dialog.of = MadeOf::InLens;
    }
    ui.radio_value(&mut dialog.of, MadeOf::Piece, "Of that, the piece at the crosshair");
    ui.horizontal(|ui| {
        let is_agreement = matches!(dialog.of, MadeOf::Agreement(_));
        let mut is_chosen = ui.radio(is_agreement, "Where at least").clicked();
        let drag = ui.add(DragValue::new(&mut dialog.least).range(1..=masks.max(1)).speed(0.05));
        drag.widget_info(|| {
            egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Least number of masks that agree")
        });
        is_chosen |= drag.changed();
        ui.label(format!("of {masks} masks agree: {}", crate::format::ml(agreed_ml)));
        if is_chosen || is_agreement {
            dialog.of = MadeOf::Agreement(dialog.least);
        }
    });
    if dialog.of != before {
        dialog.problem = None;
    }
}
