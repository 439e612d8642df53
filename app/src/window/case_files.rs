//! The dialog of a case's files: what each is, its id, date, labels, name and colour.

use egui::{
    Align, Button, Checkbox, ComboBox, Id, Label, Layout, Role as Kind, ScrollArea, TextEdit, Ui, WidgetInfo,
    vec2,
};
use glioscope_core::case::{Problem, Proposal, ProposedFile, ProposedMask, Role, Scheme};
use glioscope_render::{MaskColors, Palette};

use super::{
    case_dates,
    modal::{self, Reply},
    thumbnails::Thumbnails,
};
use crate::{
    command::{AppCommand, Command, Commands, Workstation, workstation::Guess},
    views::draw,
};

/// Widths of the columns, points: role, file, id, date, labels, name, colour, and the last with its button.
const COLUMNS: [f32; 8] = [92.0, 220.0, 140.0, 96.0, 96.0, 190.0, 48.0, 150.0];
const TITLES: [&str; 8] = ["role", "file", "id", "date", "labels", "name", "colour", ""];
/// Height left for the rest of the window and of the dialog.
const MARGIN_POINTS: f32 = 230.0;

/// Sides of a series' picture in its row and in its tip, points.
const ROW_PICTURE_POINTS: f32 = 30.0;
const TIP_PICTURE_POINTS: f32 = 160.0;

/// The most colours that a palette is asked for.
const MAX_COLORS: usize = 32;

fn role_name(role: Role) -> &'static str {
    match role {
        Role::Image => "image",
        Role::Mask => "mask",
        Role::Tracts => "fibre tracts",
        Role::LeftOut => "left out",
    }
}

/// Draws the dialog while a case waits for it; `covered`: another dialog is in front of it and has the keyboard.
pub fn show(ui: &Ui, work: &mut Workstation, thumbnails: &mut Thumbnails, covered: bool, out: &mut Commands) {
    let palette = work.doc.as_ref().map_or_else(Palette::default, |doc| doc.edit.palette);
    let accepts = work.accept_guesses;
    let Some(guess) = &mut work.guess else { return };
    if accepts {
        out.push(AppCommand::AcceptGuess(true));
        return;
    }
    let problems = guess.proposal.problems();
    // Asked about once the files are shown, they stay shown: a change may make them plain again.
    let (shown, key) = (Id::unique("files shown of"), guess.proposal.key.clone());
    let is_whole = guess.request.edits
        || ui.data(|data| data.get_temp::<String>(shown)).is_some_and(|of| of == key)
        || !case_dates::suffices(&guess.proposal);
    if is_whole {
        ui.data_mut(|data| data.insert_temp(shown, key.clone()));
    }
    let mut entered = false;
    let reply = modal::show(ui.ctx(), "The case's files", |ui| {
        if !is_whole {
            let folder = &guess.proposal.folder;
            let name = folder.file_name().unwrap_or(folder.as_os_str());
            ui.label(format!("{}, by the names of its files. Is this right?", name.to_string_lossy()))
                .on_hover_text(folder.display().to_string());
            ui.add_space(6.0);
            case_dates::show(ui, &guess.proposal);
            ui.add_space(6.0);
            let (reply, changes) = dates_buttons(ui);
            if changes {
                ui.data_mut(|data| data.insert_temp(shown, key.clone()));
            }
            return reply;
        }
        ui.set_width(COLUMNS.iter().sum::<f32>() + 8.0 * ui.spacing().item_spacing.x);
        let is_study = guess.proposal.files.iter().any(|file| file.series.is_some());
        ui.label(if guess.request.edits {
            "What each file of the open case is. The files stay as they are; what you say is kept in the session."
        } else if is_study {
            "There is no manifest, so series were told apart by their DICOM headers. Is this right?"
        } else {
            "There is no manifest, so files were told apart by their names and contents. Is this right?"
        });
        if let Some(doubt) = &guess.proposal.doubt {
            ui.colored_label(
                ui.visuals().warn_fg_color,
                format!("Found {doubt}: two patients are never one case."),
            );
        }
        ui.add_space(6.0);
        let height = (ui.ctx().content_rect().height() - MARGIN_POINTS).max(120.0);
        ScrollArea::vertical().max_height(height).show(ui, |ui| {
            entered = table(ui, guess, &problems, palette, thumbnails);
            ui.add_space(6.0);
            for note in &guess.proposal.notes {
                ui.add(Label::new(&note.message).wrap());
            }
        });
        ui.add_space(6.0);
        if guess.proposal.frames_of_reference() > 1 {
            ui.checkbox(&mut guess.proposal.is_aligned, "They are aligned: show them over each other").on_hover_text(
                "Scans of different frames of reference lie where each scanner put them. Nothing in the files says that \
                 a place in one is the same place in another.",
            );
        }
        buttons(ui, guess, &problems, out)
    });
    match reply {
        _ if covered => {}
        Reply::Cancel => out.push(AppCommand::AcceptGuess(false)),
        Reply::None if !entered => {}
        Reply::Accept | Reply::None => {
            if problems.is_empty() {
                out.push(AppCommand::AcceptGuess(true));
            }
        }
    }
}

/// The buttons below the dates; with the reply, whether the files are to be shown.
fn dates_buttons(ui: &mut Ui) -> (Reply, bool) {
    let (mut reply, mut changes) = (Reply::None, false);
    ui.horizontal(|ui| {
        if ui.button(Command::from(AppCommand::AcceptGuess(true)).text()).clicked() {
            reply = Reply::Accept;
        }
        let tip = "Roles, ids, dates, labels, names and colours, file by file; and a manifest of them";
        if ui.button("Change…").on_hover_text(tip).clicked() {
            changes = true;
        }
        if ui.button("Cancel").clicked() {
            reply = Reply::Cancel;
        }
    });
    (reply, changes)
}

fn buttons(ui: &mut Ui, guess: &Guess, problems: &[Problem], out: &mut Commands) -> Reply {
    let mut reply = Reply::None;
    ui.horizontal(|ui| {
        let is_right = problems.is_empty();
        if ui
            .add_enabled(is_right, Button::new(Command::from(AppCommand::AcceptGuess(true)).text()))
            .clicked()
        {
            reply = Reply::Accept;
        }
        let save = Command::from(AppCommand::SaveManifest);
        // Files of an archive lie nowhere that stays.
        let has_place = guess.proposal.archive.is_none();
        let response = ui.add_enabled(is_right && has_place, Button::new(save.text()));
        let tip =
            "As a manifest: in the folder of the files, the folder is then opened by it without a question";
        if response.on_hover_text(tip).clicked() {
            out.push(save);
        }
        if ui.button("Cancel").clicked() {
            reply = Reply::Cancel;
        }
        match problems.first() {
            Some(first) => {
                let file = first.file.and_then(|file| guess.proposal.files.get(file));
                let of = file.map(|file| format!("{}: ", guess.proposal.shown(file))).unwrap_or_default();
                let more = problems.len() - 1;
                let more = if more == 0 { String::new() } else { format!(" (and {more} more)") };
                ui.colored_label(ui.visuals().error_fg_color, format!("{of}{}{more}", first.text));
            }
            None if !guess.proposal.files.iter().any(|file| file.role == Role::Mask) => {
                ui.label("There is no mask: only images are shown.");
            }
            None => {}
        }
    });
    reply
}

/// The table of files. Returns whether Enter was pressed in one of its fields.
fn table(
    ui: &mut Ui,
    guess: &mut Guess,
    problems: &[Problem],
    palette: Palette,
    thumbnails: &mut Thumbnails,
) -> bool {
    ui.horizontal(|ui| {
        for (width, title) in COLUMNS.into_iter().zip(TITLES) {
            cell(ui, width, |ui| ui.strong(title));
        }
    });
    let proposal = &mut guess.proposal;
    let masks = masks_in(proposal);
    let own: Vec<Option<[u8; 3]>> = masks.iter().map(|(_, color)| *color).collect();
    let colors = MaskColors::new(palette, &own);
    let color_of = |id: &str| {
        let rank = masks.iter().position(|(known, _)| known == id);
        colors.mask(rank.unwrap_or(0))
    };
    let names: Vec<String> = proposal.files.iter().map(|file| proposal.shown(file)).collect();
    let mut entered = false;
    let (mut chosen, mut above) = (None, (String::new(), String::new()));
    for (n, (file, name)) in proposal.files.iter_mut().zip(&names).enumerate() {
        if (&file.patient, &file.study) != (&above.0, &above.1) {
            if file.patient != above.0 && patient_heading(ui, &file.patient) {
                chosen = Some(file.patient.clone());
            }
            if !file.study.is_empty() {
                ui.weak(format!("Study {}", file.study));
            }
            above = (file.patient.clone(), file.study.clone());
        }
        let mut row = Row { file: name, entered: false, color_of: &color_of, thumbnails };
        ui.push_id(n, |ui| row.show(ui, file));
        entered |= row.entered;
        for problem in problems.iter().filter(|problem| problem.file == Some(n)) {
            let of = problem.mask.filter(|_| file.masks.len() > 1).and_then(|mask| file.masks.get(mask));
            let of = of.map(|mask| format!("{}: ", mask.id)).unwrap_or_default();
            ui.colored_label(ui.visuals().error_fg_color, format!("    {name}: {of}{}", problem.text));
        }
    }
    if let Some(patient) = chosen {
        proposal.choose_patient(&patient);
    }
    entered
}

/// The line above a patient's series. Returns whether the patient is chosen.
fn patient_heading(ui: &mut Ui, patient: &str) -> bool {
    ui.add_space(4.0);
    ui.horizontal(|ui| {
        ui.strong(format!("Patient {patient}"));
        ui.small_button("Only this patient").on_hover_text("Leave out the series of all others").clicked()
    })
    .inner
}

/// Ids and own colours of the masks that are in, in the order first listed.
fn masks_in(proposal: &Proposal) -> Vec<(String, Option<[u8; 3]>)> {
    let files = proposal.files.iter().filter(|file| file.role == Role::Mask);
    let mut all: Vec<(String, Option<[u8; 3]>)> = Vec::new();
    for mask in files.flat_map(|file| &file.masks).filter(|mask| mask.is_in) {
        let id = mask.id.trim();
        if all.len() < MAX_COLORS && !all.iter().any(|(known, _)| known == id) {
            all.push((id.to_owned(), mask.color));
        }
    }
    all
}

fn cell<R>(ui: &mut Ui, width: f32, content: impl FnOnce(&mut Ui) -> R) -> R {
    let size = vec2(width, ui.spacing().interact_size.y);
    ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
        ui.set_min_width(width);
        ui.set_max_width(width);
        content(ui)
    })
    .inner
}

/// The rows of one file.
struct Row<'a> {
    /// The file's name.
    file: &'a str,
    /// Whether Enter was pressed in one of its fields.
    entered: bool,
    /// Colour of a mask without one of its own.
    color_of: &'a dyn Fn(&str) -> [u8; 3],
    thumbnails: &'a mut Thumbnails,
}

impl Row<'_> {
    fn show(&mut self, ui: &mut Ui, file: &mut ProposedFile) {
        let has_many = file.role == Role::Mask && file.masks.len() > 1;
        ui.horizontal(|ui| {
            cell(ui, COLUMNS[0], |ui| self.role(ui, file));
            cell(ui, COLUMNS[1], |ui| {
                let tip = format!("{}\n{}", file.path.display(), file.reason);
                let source = file.shown_source().filter(|_| file.role != Role::Tracts);
                let named = ui.horizontal(|ui| {
                    // Names of series say little, and there are many of them.
                    if let (Some(source), true) = (&source, file.series.is_some()) {
                        self.thumbnails.show(ui, source, ROW_PICTURE_POINTS);
                    }
                    ui.add(Label::new(self.file).truncate().show_tooltip_when_elided(false));
                });
                named.response.on_hover_ui(|ui| {
                    ui.label(self.file);
                    ui.label(tip.trim());
                    if let Some(source) = &source {
                        self.thumbnails.show(ui, source, TIP_PICTURE_POINTS);
                    }
                });
            });
            if file.role == Role::LeftOut {
                ui.weak(&file.reason);
                return;
            }
            cell(ui, COLUMNS[2], |ui| match file.role {
                Role::Mask if has_many => drop(ui.label(format!("{} masks", file.masks.len()))),
                Role::Mask => {
                    for mask in &mut file.masks {
                        self.field(ui, COLUMNS[2], &mut mask.id, "Id");
                    }
                }
                _ => self.field(ui, COLUMNS[2], &mut file.id, "Id"),
            });
            cell(ui, COLUMNS[3], |ui| {
                if file.role != Role::Tracts {
                    self.field(ui, COLUMNS[3], &mut file.time, "Date");
                }
            });
            if file.role != Role::Mask {
                if file.series.is_some() {
                    ui.weak(&file.reason);
                }
                return;
            }
            match file.masks.as_mut_slice() {
                [mask] => self.look(ui, mask),
                _ => COLUMNS[4..7].iter().for_each(|width| cell(ui, *width, |_| ())),
            }
            cell(ui, COLUMNS[7], |ui| self.division(ui, file));
        });
        if has_many {
            for (n, mask) in file.masks.iter_mut().enumerate() {
                ui.push_id(("mask", n), |ui| ui.horizontal(|ui| self.mask(ui, mask)));
            }
        }
    }

    fn role(&self, ui: &mut Ui, file: &mut ProposedFile) {
        let is_tracts = glioscope_core::files::format::is_tracts(self.file)
            || glioscope_core::case::is_tract_scalars(self.file.as_ref());
        let roles: &[Role] = if is_tracts {
            &[Role::Tracts, Role::LeftOut]
        } else {
            &[Role::Image, Role::Mask, Role::LeftOut]
        };
        let combo =
            ComboBox::from_id_salt("role").selected_text(role_name(file.role)).width(COLUMNS[0] - 8.0);
        let response = combo.show_ui(ui, |ui| {
            for role in roles {
                ui.selectable_value(&mut file.role, *role, role_name(*role));
            }
        });
        let label = format!("What {} is", self.file);
        response.response.widget_info(|| WidgetInfo::labeled(Kind::ComboBox, true, &label));
    }

    /// Makes one mask of each label, or one of all, or those of a label scheme.
    fn division(&self, ui: &mut Ui, file: &mut ProposedFile) {
        // The file itself says what its masks are.
        if file.masks.iter().any(|mask| mask.segment.is_some()) {
            return;
        }
        if file.labels.len() > 1 {
            self.schemes(ui, file);
        }
        if file.masks.len() > 1 {
            let button =
                ui.small_button("One mask").on_hover_text("Every voxel above 0.5, whatever its label");
            if button.clicked() {
                file.merge();
            }
        } else if file.labels.len() > 1 {
            let labels: Vec<String> = file.labels.iter().map(i64::to_string).collect();
            let tip = format!("One mask for each of the labels {}", labels.join(", "));
            if ui.small_button("Each label").on_hover_text(tip).clicked() {
                file.split();
            }
        } else if ui
            .small_button("Another")
            .on_hover_text("Another mask of other labels of this file")
            .clicked()
            && let Some(first) = file.masks.first().cloned()
        {
            file.masks.push(ProposedMask { id: format!("{} 2", first.id), color: None, ..first });
        }
    }

    /// The menu of label schemes that know all labels of the file.
    fn schemes(&self, ui: &mut Ui, file: &mut ProposedFile) {
        let mut all = Scheme::built_in();
        if let Some(own) = file.scheme.clone().filter(|own| !all.contains(own)) {
            all.insert(0, own);
        }
        all.retain(|scheme| scheme.knows(&file.labels));
        if all.is_empty() {
            return;
        }
        let menu = ui.menu_button("Scheme", |ui| {
            for scheme in all {
                if !scheme.groups.is_empty() {
                    let names: Vec<&str> = scheme.groups.iter().map(|group| group.name).collect();
                    if ui.button(format!("{}: {}", scheme.name, names.join(", "))).clicked() {
                        file.scheme = Some(scheme.clone());
                        file.group();
                    }
                }
                if ui.button(format!("{}: each label", scheme.name)).clicked() {
                    file.scheme = Some(scheme);
                    file.split();
                }
            }
        });
        let label = format!("Label scheme of {}", self.file);
        menu.response.widget_info(|| WidgetInfo::labeled(Kind::Button, true, &label));
        menu.response.on_hover_text("What the labels mean, and which of them are one mask");
    }

    /// The row of one of several masks.
    fn mask(&mut self, ui: &mut Ui, mask: &mut ProposedMask) {
        let of = format!("{} of {}", mask.id, self.file);
        cell(ui, COLUMNS[0], |_| ());
        cell(ui, COLUMNS[1], |ui| {
            let response = ui.add(Checkbox::new(&mut mask.is_in, "in"));
            let is_in = mask.is_in;
            response.widget_info(|| WidgetInfo::selected(Kind::CheckBox, true, is_in, format!("Use {of}")));
        });
        cell(ui, COLUMNS[2], |ui| self.hinted(ui, COLUMNS[2], &mut mask.id, &format!("Id of {of}"), ""));
        cell(ui, COLUMNS[3], |_| ());
        self.look(ui, mask);
    }

    /// Labels, name and colour of a mask.
    fn look(&mut self, ui: &mut Ui, mask: &mut ProposedMask) {
        let of = mask.id.clone();
        cell(ui, COLUMNS[4], |ui| {
            let hint = mask.segment.map_or_else(|| "all".into(), |number| format!("segment {number}"));
            self.hinted(ui, COLUMNS[4], &mut mask.labels, &format!("Labels of {of}"), &hint);
        });
        cell(ui, COLUMNS[5], |ui| self.hinted(ui, COLUMNS[5], &mut mask.name, &format!("Name of {of}"), ""));
        cell(ui, COLUMNS[6], |ui| {
            let mut color = mask.color.unwrap_or_else(|| (self.color_of)(mask.id.trim()));
            let response = ui.color_edit_button_srgb(&mut color);
            response.widget_info(|| WidgetInfo::labeled(Kind::ColorWell, true, format!("Colour of {of}")));
            if response.changed() {
                mask.color = Some(color);
            }
        });
    }

    fn field(&mut self, ui: &mut Ui, width: f32, text: &mut String, what: &str) {
        let label = format!("{what} of {}", self.file);
        self.hinted(ui, width, text, &label, "");
    }

    fn hinted(&mut self, ui: &mut Ui, width: f32, text: &mut String, label: &str, hint: &str) {
        let response = ui.add(TextEdit::singleline(text).hint_text(hint).desired_width(width - 8.0));
        draw::name_widget(ui, &response, label);
        self.entered |= modal::entered(ui, &response);
    }
}
