//! The window that brings dates, and the images of a date, into one space: by registration, by a transform of another program, or by
//! hand; and in which a reader says that the anatomy meets.

use egui::{ComboBox, Key, Modifiers, ProgressBar, Ui};
use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{
    case::{
        Aligned, AlignedBy, Alignment, CaseRegistration, RegisterCase, TimePoint, close_loops, has_loops,
        register_dates, register_images,
    },
    register::Model,
    transform::Convention,
};
use glioscope_render::{ColorMap, flat::Mixing};
use jiff::Timestamp;

use super::label::label_for_screen_readers;
use crate::{
    command::{AppCommand, Commands, EditCommand, LookCommand, Workstation},
    format,
    model::{Document, Fusion, SecondImage},
    world::jobs::{Job, Waker},
};

const WIDTH_POINTS: f32 = 470.0;
/// Most height of the list of dates and images, points.
const LIST_POINTS: f32 = 260.0;
/// What a date that was moved by hand was moved by.
const BY_HAND: &str = "hand";
/// Steps by hand, in millimetres and degrees.
const STEPS: [f64; 4] = [0.2, 0.5, 1.0, 5.0];

/// What the window holds.
pub struct Align {
    model: Model,
    /// Whether loops of registrations are closed, too.
    loops: bool,
    /// The date that is moved by hand.
    by_hand: Option<String>,
    step: f64,
    /// What a bare matrix means.
    convention: Option<Convention>,
    job: Option<Job<Vec<CaseRegistration>>>,
    /// What the last registration found.
    found: Vec<CaseRegistration>,
}

impl Default for Align {
    fn default() -> Self {
        Self {
            model: Model::Rigid,
            loops: false,
            by_hand: None,
            step: 1.0,
            convention: None,
            job: None,
            found: Vec::new(),
        }
    }
}

impl Align {
    fn found_of(&self, target: Target<'_>) -> Option<&CaseRegistration> {
        self.found.iter().find(|found| found.time == target.time && found.id.as_deref() == target.id)
    }

    /// The alignment of a date by a file, as the window's choices say.
    pub fn by_file(&self, time: String, path: std::path::PathBuf) -> Alignment {
        let convention = self.convention.map(|convention| convention.word().to_owned());
        Alignment::of(None, Some(time), AlignedBy::File { path, convention, images: None })
    }
}

/// What is moved: a date, or an image within its date.
#[derive(Clone, Copy, PartialEq)]
struct Target<'a> {
    time: &'a str,
    id: Option<&'a str>,
}

impl Target<'_> {
    fn is_of(&self, alignment: &Alignment) -> bool {
        alignment.id.as_deref() == self.id && alignment.time.as_deref().unwrap_or_default() == self.time
    }

    fn own<'d>(&self, doc: &'d Document) -> Option<&'d Alignment> {
        doc.edit.alignments.iter().find(|alignment| self.is_of(alignment))
    }

    /// Whether `other` moves with `own`, which is this one's: the masks of an image do.
    fn moves_with(&self, own: &Alignment, other: &Alignment) -> bool {
        self.is_of(other) || (self.id.is_some() && other.time == own.time && other.by == own.by)
    }
}

/// The alignments of a document with that of a date replaced, or removed.
pub fn with_date(doc: &Document, time: &str, new: Option<Alignment>) -> Vec<Alignment> {
    let target = Target { time, id: None };
    let others = doc.edit.alignments.iter().filter(|other| !target.is_of(other));
    others.cloned().chain(new).collect()
}

/// The alignments of a document without one of them, and without what moves with it.
fn without(doc: &Document, target: Target<'_>, own: &Alignment) -> Vec<Alignment> {
    doc.edit.alignments.iter().filter(|other| !target.moves_with(own, other)).cloned().collect()
}

/// The alignments of a document with one of them accepted today, and what moves with it.
fn accepted(doc: &Document, target: Target<'_>, own: &Alignment) -> Vec<Alignment> {
    let today = Timestamp::now().strftime("%Y-%m-%d").to_string();
    let mut all = doc.edit.alignments.clone();
    all.iter_mut()
        .filter(|other| target.moves_with(own, other))
        .for_each(|a| a.accepted = Some(today.clone()));
    all
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
    let window =
        egui::Window::new("Align dates and images").open(&mut is_open).resizable(false).collapsible(false);
    window.default_pos([24.0, 64.0]).default_width(WIDTH_POINTS).show(ui.ctx(), |ui| {
        ui.set_width(WIDTH_POINTS);
        let Some((first, others)) = case.time_points.split_first() else { return };
        let has_images = case.time_points.iter().any(|time| time.contexts.len() > 1);
        if !others.is_empty() {
            ui.label(format!(
                "The space of the case is that of {}. Each other date lies where its files say, until a registration, a \
                 transform or you move it. Volumes stay those of the files.",
                first.label
            ));
            ui.add_space(6.0);
        }
        // As high as there is room for, however many dates and images.
        let list = egui::ScrollArea::vertical().max_height(LIST_POINTS).auto_shrink([false, true]);
        list.show(ui, |ui| {
            for date in others {
                row(ui, align, work, doc, (Target { time: &date.label, id: None }, &first.label), out);
            }
            for time in case.time_points.iter().filter(|time| time.contexts.len() > 1) {
                images(ui, align, work, doc, time, out);
            }
        });
        ui.separator();
        register(ui, align, work, (!others.is_empty(), has_images));
        if others.is_empty() {
            return;
        }
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

/// The image of a date that the others are registered to: the one shown, else the first.
fn fixed_image<'a>(doc: &Document, time: &'a TimePoint) -> Option<&'a str> {
    let shown = time.contexts.iter().find(|c| Some(&c.id) == doc.nav.context.as_ref());
    shown.or(time.contexts.first()).map(|c| c.id.as_str())
}

/// The images of a date that are moved, or were to be, within it.
fn images(
    ui: &mut Ui,
    align: &Align,
    work: &Workstation,
    doc: &Document,
    time: &TimePoint,
    out: &mut Commands,
) {
    let Some(fixed) = fixed_image(doc, time) else { return };
    for image in &time.contexts {
        let target = Target { time: &time.label, id: Some(&image.id) };
        if target.own(doc).is_some() || align.found_of(target).is_some() {
            row(ui, align, work, doc, (target, fixed), out);
        }
    }
}

fn take_result(align: &mut Align, doc: &Document, out: &mut Commands) {
    let Some(result) = align.job.as_ref().and_then(Job::poll) else { return };
    align.job = None;
    let Ok(found) = result else { return };
    let mut alignments = doc.edit.alignments.clone();
    for registration in &found {
        if let Ok(registered) = &registration.result {
            for new in &registered.alignments {
                alignments.retain(|old| (&old.id, &old.time) != (&new.id, &new.time));
                alignments.push(new.clone());
            }
        }
    }
    align.found = found;
    if alignments != doc.edit.alignments {
        out.push(EditCommand::SetAlignments(alignments));
    }
}

/// A date or image: how it is moved, and what can be done with it. `to`: the date or image whose space is kept.
fn row(
    ui: &mut Ui,
    align: &Align,
    work: &Workstation,
    doc: &Document,
    (target, to): (Target<'_>, &str),
    out: &mut Commands,
) {
    let Target { time, id } = target;
    let own = target.own(doc);
    let is_of = |a: &Aligned| a.time == time && id.map_or(a.with_date, |id| a.id == id && a.has_own());
    let of_case = work.world.case().is_some_and(|case| case.aligned.iter().any(is_of));
    ui.horizontal_wrapped(|ui| {
        let name = id.map_or_else(
            || time.to_owned(),
            |id| {
                let of = if time.is_empty() { String::new() } else { format!(" of {time}") };
                format!("{id}{of}")
            },
        );
        ui.strong(name);
        match (own, of_case) {
            (Some(own), _) => ui.label(format!("moved by {}", own.by.name())),
            (None, true) => ui.label("moved by a transform of the case"),
            (None, false) => ui.label("as its files lie"),
        };
    });
    if let Some(found) = align.found_of(target) {
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
                let around = registered.around.as_ref().map_or_else(String::new, |around| {
                    let (mm, through) = (format::length_mm(around.worst.p95_mm), around.through.join("; "));
                    format!("; around a loop {mm} (through {through})")
                });
                let text =
                    format!("{images}consistency at the tumour {mm} (95 %){around}, {:.1} s", found.seconds);
                ui.label(text).on_hover_text(
                    "How far repeated registrations differ there: from other starts, with the images exchanged, with and \
                     without the masks; around a loop: how far points end from where they began, through other dates and \
                     images and back. It is no accuracy: what misleads all of them alike doesn't show.",
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
            .on_hover_text("Both images on the slices, divided by a line: does the anatomy meet?")
            .clicked()
        {
            match id {
                None => look(doc, work, to, time, out),
                Some(id) => look_within(work, (time, to), id, out),
            }
        }
        if id.is_none() && ui.button("From a file…").on_hover_text("A transform of another program").clicked()
        {
            out.push(AppCommand::ChooseTransform(time.to_owned()));
        }
        let Some(own) = own else { return };
        match &own.accepted {
            Some(day) => {
                ui.label(format!("accepted {day}"));
            }
            None => {
                let tip =
                    "You looked, and the anatomy meets: said in the status line, in numbers and reports";
                if ui.button("Accept").on_hover_text(tip).clicked() {
                    out.push(EditCommand::SetAlignments(accepted(doc, target, own)));
                }
            }
        }
        let is_registered = matches!(own.by, AlignedBy::Matrix { consistency_mm: Some(_), .. });
        let text = if is_registered && own.accepted.is_none() { "Reject" } else { "Take back" };
        if ui.button(text).on_hover_text("It lies as its files say again").clicked() {
            out.push(EditCommand::SetAlignments(without(doc, target, own)));
        }
    });
    ui.add_space(4.0);
}

/// Shows an image of a date with another one's of the same date behind a swipe line.
fn look_within(work: &Workstation, (time, first): (&str, &str), second: &str, out: &mut Commands) {
    let at = work.world.case().and_then(|case| case.time_at(time));
    let Some((at, doc)) = at.zip(work.doc.as_ref()) else { return };
    out.push(LookCommand::SetTime(at));
    out.push(LookCommand::SetContext(Some(first.to_owned())));
    let second = Some(SecondImage { id: second.to_owned(), time: None });
    let fusion = Fusion { second, mixing: Mixing::Swipe, ..doc.edit.fusion.clone() };
    out.push(EditCommand::SetFusion(Box::new(fusion)));
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
    let fusion = Fusion { second, mixing, map, ..doc.edit.fusion.clone() };
    out.push(EditCommand::SetFusion(Box::new(fusion)));
}

fn register(ui: &mut Ui, align: &mut Align, work: &Workstation, (has_dates, has_images): (bool, bool)) {
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
        let Some(case) = work.world.case() else { return };
        let mut chosen: Option<RegisterCase> = None;
        let text = "Each date that isn't moved yet, to the first one. The masks of both dates, grown by 5 mm, don't count";
        if has_dates && ui.button("Register").on_hover_text(text).clicked() {
            chosen = Some(register_dates);
        }
        let text = "The other images of each date to the one that is shown, by mutual information. With an image move the masks that were \
                    drawn on its grid";
        if has_images && ui.button("Register images").on_hover_text(text).clicked() {
            chosen = Some(register_images);
        }
        if let Some(register) = chosen {
            let (case, model, loops) = (case.clone(), align.model, align.loops);
            let image = work.doc.as_ref().and_then(|doc| doc.nav.context.clone());
            align.found.clear();
            align.job = Some(Job::start(Waker::of(ui.ctx()), move |progress| {
                let mut found = register(&case, image.as_deref(), model, progress)?;
                if loops {
                    close_loops(&case, &mut found, model, progress)?;
                }
                Ok(found)
            }));
        }
        ui.radio_value(&mut align.model, Model::Rigid, "turn and shift");
        ui.radio_value(&mut align.model, Model::Affine, "also scale and shear");
        if has_loops(case) {
            let text = "Also how far points of the tumour end from where they began on their way around a loop: the first date, two \
                        later ones and back; there by one image and back by another; three images of a date. One more \
                        registration for each loop";
            ui.checkbox(&mut align.loops, "loops").on_hover_text(text);
        }
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
            let moves = DAffine3 { matrix3: turn, translation };
            out.push(EditCommand::SetAlignments(moved_by_hand(work, doc, &shown, moves)));
        }
    });
    ui.label("Right and left are the patient's. Alt with the arrow keys moves it as seen on the axial slice, with Page Up and Down up and down; Alt and \
         drag on a slice moves the date that it shows, or that of its second image. Turns are about the lens.");
}

/// The alignments of a document in which a date is moved on, from where it lies, by `moves` in the case's space.
pub fn moved_by_hand(work: &Workstation, doc: &Document, date: &str, moves: DAffine3) -> Vec<Alignment> {
    let moved = moves * case_from_date(work, doc, date);
    let by = AlignedBy::matrix(moved.inverse(), BY_HAND);
    with_date(doc, date, Some(Alignment::of(None, Some(date.to_owned()), by)))
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
