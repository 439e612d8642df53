//! The window that brings dates into one space: by registration, by a transform of another program, or by hand.

use egui::{ComboBox, Key, Modifiers, ProgressBar, Ui};
use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{
    case::{AlignedBy, Alignment, DateRegistration, register_dates},
    register::Model,
    transform::Convention,
};
use glioscope_render::flat::{ColorMap, Mixing};

use super::label::label_for_screen_readers;
use crate::{
    command::{AppCommand, Commands, EditCommand, LookCommand, Workstation},
    format,
    model::{Document, SecondImage},
    world::jobs::{Job, Waker},
};

const WIDTH_POINTS: f32 = 470.0;
/// What a date that was moved by hand was moved by.
const BY_HAND: &str = "hand";
/// Steps by hand, in millimetres and degrees.
const STEPS: [f64; 4] = [0.2, 0.5, 1.0, 5.0];

/// What the window holds.
pub struct Align {
    model: Model,
    /// The date that is moved by hand.
    by_hand: Option<String>,
    step: f64,
    /// What a bare matrix means.
    convention: Option<Convention>,
    job: Option<Job<Vec<DateRegistration>>>,
    /// What the last registration found, by date.
    found: Vec<DateRegistration>,
}

impl Default for Align {
    fn default() -> Self {
        Self { model: Model::Rigid, by_hand: None, step: 1.0, convention: None, job: None, found: Vec::new() }
    }
}

impl Align {
    /// The alignment of a date by a file, as the window's choices say.
    pub fn by_file(&self, time: String, path: std::path::PathBuf) -> Alignment {
        let convention = self.convention.map(|convention| convention.word().to_owned());
        Alignment { id: None, time: Some(time), by: AlignedBy::File { path, convention, images: None } }
    }
}

/// The alignments of a document with that of a date replaced, or removed.
pub fn with_date(doc: &Document, time: &str, new: Option<Alignment>) -> Vec<Alignment> {
    let is_other = |a: &&Alignment| a.id.is_some() || a.time.as_deref() != Some(time);
    doc.edit.alignments.iter().filter(is_other).cloned().chain(new).collect()
}

/// Draws the window while it is open.
pub fn show(ui: &Ui, open: &mut Option<Align>, work: &Workstation, out: &mut Commands) {
    let Some(align) = open else { return };
    let (Some(doc), Some(case)) = (&work.doc, work.world.case()) else {
        *open = None;
        return;
    };
    take_result(align, doc, out);
    let mut is_open = true;
    let window = egui::Window::new("Align dates").open(&mut is_open).resizable(false).collapsible(false);
    window.default_pos([24.0, 64.0]).default_width(WIDTH_POINTS).show(ui.ctx(), |ui| {
        ui.set_width(WIDTH_POINTS);
        let Some((first, others)) = case.time_points.split_first().filter(|(_, others)| !others.is_empty()) else {
            ui.label("The case has one date: there is nothing to align.");
            return;
        };
        ui.label(format!(
            "The space of the case is that of {}. Each other date lies where its files say, until a registration, a \
             transform or you move it. Volumes stay those of the files.",
            first.label
        ));
        ui.add_space(6.0);
        for date in others {
            row(ui, align, work, doc, (&first.label, &date.label), out);
        }
        ui.separator();
        register(ui, align, work);
        ui.separator();
        bare_matrix(ui, align);
        let labels: Vec<&str> = others.iter().map(|date| date.label.as_str()).collect();
        by_hand(ui, align, work, doc, &labels, out);
    });
    if !is_open {
        if let Some(job) = &align.job {
            job.progress.cancel();
        }
        *open = None;
    }
}

fn take_result(align: &mut Align, doc: &Document, out: &mut Commands) {
    let Some(result) = align.job.as_ref().and_then(Job::poll) else { return };
    align.job = None;
    let Ok(found) = result else { return };
    let mut alignments = doc.edit.alignments.clone();
    for registration in &found {
        if let Ok(registered) = &registration.result {
            let time = Some(registration.time.as_str());
            alignments.retain(|a| a.id.is_some() || a.time.as_deref() != time);
            alignments.push(registered.alignment.clone());
        }
    }
    align.found = found;
    if alignments != doc.edit.alignments {
        out.push(EditCommand::SetAlignments(alignments));
    }
}

/// A date: how it is moved, and what can be done with it.
fn row(
    ui: &mut Ui,
    align: &Align,
    work: &Workstation,
    doc: &Document,
    (first, date): (&str, &str),
    out: &mut Commands,
) {
    let own = doc.edit.alignments.iter().find(|a| a.id.is_none() && a.time.as_deref() == Some(date));
    let of_case = work.world.case().is_some_and(|case| case.aligned.iter().any(|a| a.time == date));
    ui.horizontal_wrapped(|ui| {
        ui.strong(date);
        match (own, of_case) {
            (Some(own), _) => ui.label(format!("moved by {}", own.by.name())),
            (None, true) => ui.label("moved by a transform of the case"),
            (None, false) => ui.label("as its files lie"),
        };
    });
    if let Some(found) = align.found.iter().find(|found| found.time == date) {
        let images =
            found.images.as_ref().map(|[a, b]| if a == b { a.clone() } else { format!("{b} on {a}") });
        let images = images.map(|images| format!("{images}: ")).unwrap_or_default();
        match &found.result {
            Err(why) => {
                ui.colored_label(ui.visuals().warn_fg_color, format!("{images}not registered: {why}"));
            }
            Ok(registered) => {
                let mm = registered.consistency.p95_with_floor_mm();
                let mm = mm.map_or_else(|| "unknown".into(), format::length_mm);
                let text = format!("{images}consistency at the tumour {mm} (95 %), {:.1} s", found.seconds);
                ui.label(text).on_hover_text(
                    "How far repeated registrations differ there: from other starts, with the images exchanged, with and \
                     without the masks. It is no accuracy: what misleads all of them alike doesn't show.",
                );
                for warning in &registered.warnings {
                    ui.colored_label(ui.visuals().warn_fg_color, warning);
                }
            }
        }
    }
    ui.horizontal_wrapped(|ui| {
        if ui
            .button("Look")
            .on_hover_text("Both dates on the slices, divided by a line: does the anatomy meet?")
            .clicked()
        {
            look(doc, work, first, date, out);
        }
        if ui.button("From a file…").on_hover_text("A transform of another program").clicked() {
            out.push(AppCommand::ChooseTransform(date.to_owned()));
        }
        if own.is_some() && ui.button("As its files lie").clicked() {
            out.push(EditCommand::SetAlignments(with_date(doc, date, None)));
        }
    });
    ui.add_space(4.0);
}

/// Shows the first date's image with the other date's behind a swipe line.
fn look(doc: &Document, work: &Workstation, first: &str, date: &str, out: &mut Commands) {
    let Some(case) = work.world.case() else { return };
    let Some(first) = case.time_at(first) else { return };
    let ids = |time: usize| case.time_points.get(time).map(|t| t.contexts.iter().map(|c| c.id.as_str()));
    let Some(other) = case.time_at(date) else { return };
    let common =
        ids(first).into_iter().flatten().find(|id| ids(other).is_some_and(|mut ids| ids.any(|o| o == *id)));
    let shown =
        doc.nav.context.as_deref().filter(|id| ids(other).is_some_and(|mut ids| ids.any(|o| o == *id)));
    let Some(id) = shown.or(common) else { return };
    out.push(LookCommand::SetTime(first));
    out.push(LookCommand::SetContext(Some(id.to_owned())));
    let second = Some(SecondImage { id: id.to_owned(), time: Some(date.to_owned()) });
    let (mixing, map) = (Mixing::Swipe, ColorMap::Grey);
    let fusion = crate::model::Fusion { second, mixing, map, ..doc.edit.fusion.clone() };
    out.push(EditCommand::SetFusion(Box::new(fusion)));
}

fn register(ui: &mut Ui, align: &mut Align, work: &Workstation) {
    ui.horizontal_wrapped(|ui| {
        if let Some(job) = &align.job {
            let fraction = job.progress.fraction().unwrap_or(0.0);
            let bar = ProgressBar::new(fraction as f32).desired_width(220.0).text(job.progress.label());
            ui.add(bar);
            if ui.button("Cancel").clicked() {
                job.progress.cancel();
            }
            return;
        }
        let text = "Each date that isn't moved yet, to the first one. The masks of both dates, grown by 5 mm, don't count";
        if ui.button("Register").on_hover_text(text).clicked()
            && let Some(case) = work.world.case()
        {
            let (case, model) = (case.clone(), align.model);
            let image = work.doc.as_ref().and_then(|doc| doc.nav.context.clone());
            align.found.clear();
            align.job = Some(Job::start(Waker::of(ui.ctx()), move |progress| {
                Ok(register_dates(&case, image.as_deref(), model, progress)?)
            }));
        }
        ui.radio_value(&mut align.model, Model::Rigid, "turn and shift");
        ui.radio_value(&mut align.model, Model::Affine, "also scale and shear");
    });
}

fn bare_matrix(ui: &mut Ui, align: &mut Align) {
    ui.horizontal_wrapped(|ui| {
        ui.label("A bare 4x4 matrix in a file means");
        let shown = align.convention.map_or("nothing known", Convention::word);
        let combo = ComboBox::from_id_salt("convention").selected_text(shown).width(170.0);
        let response = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut align.convention, None, "nothing known");
            for convention in Convention::ALL {
                ui.selectable_value(&mut align.convention, Some(convention), convention.word());
            }
        });
        label_for_screen_readers(&response.response, "Meaning of a bare matrix");
    });
}

/// Moves a date by steps: buttons, or Alt with the arrow and page keys.
fn by_hand(
    ui: &mut Ui,
    align: &mut Align,
    work: &Workstation,
    doc: &Document,
    dates: &[&str],
    out: &mut Commands,
) {
    ui.horizontal_wrapped(|ui| {
        ui.label("By hand:");
        let shown = align.by_hand.clone().filter(|date| dates.contains(&date.as_str()));
        let shown = shown.unwrap_or_else(|| dates.first().copied().unwrap_or_default().to_owned());
        let combo = ComboBox::from_id_salt("date by hand").selected_text(&shown).width(100.0);
        let response = combo.show_ui(ui, |ui| {
            for date in dates {
                if ui.selectable_label(*date == shown, *date).clicked() {
                    align.by_hand = Some((*date).to_owned());
                }
            }
        });
        label_for_screen_readers(&response.response, "Date that is moved by hand");
        let combo =
            ComboBox::from_id_salt("step").selected_text(format!("{} mm or °", align.step)).width(80.0);
        let response = combo.show_ui(ui, |ui| {
            for step in STEPS {
                ui.selectable_value(&mut align.step, step, format!("{step} mm or °"));
            }
        });
        label_for_screen_readers(&response.response, "Step");
        let moves = [
            ("To the right", DVec3::X, DVec3::ZERO),
            ("To the left", DVec3::NEG_X, DVec3::ZERO),
            ("Forward", DVec3::Y, DVec3::ZERO),
            ("Back", DVec3::NEG_Y, DVec3::ZERO),
            ("Up", DVec3::Z, DVec3::ZERO),
            ("Down", DVec3::NEG_Z, DVec3::ZERO),
            ("Nod down", DVec3::ZERO, DVec3::NEG_X),
            ("Nod up", DVec3::ZERO, DVec3::X),
            ("Tilt right", DVec3::ZERO, DVec3::Y),
            ("Tilt left", DVec3::ZERO, DVec3::NEG_Y),
            ("Turn right", DVec3::ZERO, DVec3::NEG_Z),
            ("Turn left", DVec3::ZERO, DVec3::Z),
        ];
        let alt = |key: Key| ui.input_mut(|input| input.consume_key(Modifiers::ALT, key));
        // On axial slices in radiological convention the patient's left is right.
        let is_radiological = doc.nav.convention == glioscope_render::flat::Convention::Radiological;
        let [to_the_right, to_the_left] = if is_radiological { [1, 0] } else { [0, 1] };
        let keys = [
            (Key::ArrowRight, to_the_right),
            (Key::ArrowLeft, to_the_left),
            (Key::ArrowUp, 2),
            (Key::ArrowDown, 3),
            (Key::PageUp, 4),
            (Key::PageDown, 5),
        ];
        let mut chosen = keys.into_iter().find(|(key, _)| alt(*key)).map(|(_, at)| at);
        for (at, (name, ..)) in moves.iter().enumerate() {
            if ui.small_button(*name).clicked() {
                chosen = Some(at);
            }
        }
        if let Some((_, shift, axis)) = chosen.and_then(|at| moves.get(at)) {
            let center_mm = doc.edit.lens.center_mm;
            let turn = if *axis == DVec3::ZERO {
                DMat3::IDENTITY
            } else {
                DMat3::from_axis_angle(*axis, align.step.to_radians())
            };
            let translation = center_mm - turn * center_mm + *shift * align.step;
            let moved = DAffine3 { matrix3: turn, translation } * case_from_date(work, doc, &shown);
            let by = AlignedBy::matrix(moved.inverse(), BY_HAND);
            let alignment = Alignment { id: None, time: Some(shown.clone()), by };
            out.push(EditCommand::SetAlignments(with_date(doc, &shown, Some(alignment))));
        }
    });
    ui.label("Right and left are the patient's. Alt with the arrow keys moves it as seen on the axial slice, with Page Up and Down up and down. Turns \
         are about the lens.");
}

/// Where a date's transform puts its space.
fn case_from_date(work: &Workstation, doc: &Document, date: &str) -> DAffine3 {
    let own = doc.edit.alignments.iter().find(|a| a.id.is_none() && a.time.as_deref() == Some(date));
    let Some(own) = own else { return DAffine3::IDENTITY };
    if let Some(matrix) = own.by.given() {
        return matrix.inverse();
    }
    // Of a file: what it did to something that it alone moved.
    let case = work.world.case();
    let aligned = case.and_then(|case| case.aligned.iter().find(|a| a.time == date && a.by.len() == 1));
    aligned.map_or(DAffine3::IDENTITY, |aligned| aligned.case_from_own)
}
