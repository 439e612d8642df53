//! What the user does with the selected components and links.

use egui::{Key, TextEdit, Ui};
use glioscope_core::lesions::{Anchor, Edit, LesionsReport, LinkState};

use super::{
    selected::{Selected, ends, link_between, part_of, verify_all},
    timeline::{go_to, title},
};
use crate::{
    command::{Commands, EditCommand, LookCommand},
    format,
    model::{LesionSetting, PaneId, Ruler, Shape, Tool, lesions::MOST_LESION_NAME},
    views::{draw, pane::Input},
};

/// A name being typed for a lesion.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Naming {
    at: Anchor,
    name: String,
}

/// A component that is to be split at its neck.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Splitting {
    pub at: Anchor,
    /// Why it has no neck; `None` while that is looked for.
    pub why_not: Option<String>,
}

/// What is chosen in the pane.
pub(super) struct Chosen<'a> {
    pub selected: &'a mut Selected,
    pub naming: &'a mut Option<Naming>,
    pub splitting: &'a mut Option<Splitting>,
}

/// Keys that act while the pointer is over the pane.
pub(in crate::views) const VERIFY: Key = Key::V;
const UNLINK: Key = Key::U;
const JOIN: Key = Key::J;
pub(in crate::views) const NEXT: Key = Key::N;

/// What can be done, as buttons and keys.
pub(super) fn show(
    ui: &mut Ui,
    input: &Input<'_>,
    report: &LesionsReport,
    Chosen { selected, naming, splitting }: Chosen<'_>,
    out: &mut Commands,
) {
    let mut edits = Vec::new();
    ui.horizontal_wrapped(|ui| {
        let proposed = report.proposed().count();
        // Where there are links, the buttons stay when the last one is verified: what is below doesn't move.
        if !report.links.is_empty() {
            ui.add_enabled_ui(proposed > 0, |ui| {
                if is_asked(ui, "Next proposed", "The next link that nobody verified", Some(NEXT)) {
                    next(input, report, selected, out);
                }
                let text =
                    if proposed > 0 { format!("Verify all {proposed}") } else { "All verified".to_owned() };
                if is_asked(ui, &text, "Every link that is shown is right", None) {
                    edits = verify_all(report);
                }
            });
            ui.separator();
        }
        match selected.clone() {
            Selected::Nothing => {
                ui.weak("Select a component or a link");
            }
            Selected::Link(from, to) => of_link(ui, report, [&from, &to], &mut edits),
            Selected::Two(one, two) => of_two(ui, report, [&one, &two], &mut edits),
            Selected::One(at) => {
                measure(ui, input, report, &at, out);
                of_one(ui, report, &at, (naming, splitting), &mut edits);
            }
        }
    });
    if naming.as_ref().is_some_and(|naming| *selected != Selected::One(naming.at.clone())) {
        *naming = None;
    }
    if !edits.is_empty() {
        out.push(EditCommand::EditLesions(edits));
    }
    list(ui, input, report, out);
}

/// A button that a key presses too, while the pointer is over the pane and nothing is typed.
fn is_asked(ui: &mut Ui, text: &str, tip: &str, key: Option<Key>) -> bool {
    let tip = key.map_or_else(|| tip.to_owned(), |key| format!("{tip} ({})", key.name()));
    let is_clicked = ui.button(text).on_hover_text(tip).clicked();
    is_clicked || key.is_some_and(|key| is_pressed(ui, key))
}

/// Whether `key` is pressed while the pointer is over the pane and nothing is typed.
pub(in crate::views) fn is_pressed(ui: &Ui, key: Key) -> bool {
    let is_here = ui.rect_contains_pointer(ui.clip_rect()) && !ui.ctx().egui_wants_keyboard_input();
    is_here && ui.input(|i| i.modifiers.is_none() && i.key_pressed(key))
}

/// Verifies the selected link; `None` where none is selected, or a reader has done so.
pub(in crate::views) fn verify(report: &LesionsReport, selected: &Selected) -> Option<Edit> {
    matches!(selected, Selected::Link(..)).then(|| verify_meant(report, selected))?
}

/// As [`verify`], without a selected link that of the selected component, or of all, where only one is proposed: what a button can mean, and
/// a key that was pressed by mistake shouldn't.
pub(in crate::views) fn verify_meant(report: &LesionsReport, selected: &Selected) -> Option<Edit> {
    let only = |has: &dyn Fn([&Anchor; 2]) -> bool| {
        let mut meant = report.proposed().filter_map(ends).filter(|link| has(*link));
        meant.next().filter(|_| meant.next().is_none())
    };
    let [from, to] = match selected {
        Selected::Link(from, to) => only(&|link| selected.is_link(link) || link == [to, from])?,
        Selected::One(at) => only(&|link| link.contains(&at))?,
        Selected::Nothing => only(&|_| true)?,
        Selected::Two(one, two) => only(&|link| link == [one, two] || link == [two, one])?,
    };
    Some(Edit::Verify { from: from.clone(), to: to.clone() })
}

/// The first proposed link after the selected one, the largest lesions first.
pub(in crate::views) fn next(
    input: &Input<'_>,
    report: &LesionsReport,
    selected: &mut Selected,
    out: &mut Commands,
) {
    let mut all: Vec<[&Anchor; 2]> = report.proposed().filter_map(ends).collect();
    let volume_ml = |anchor: &Anchor| part_of(report, anchor).map_or(0.0, |(_, part)| part.volume_ml);
    all.sort_by(|[_, a], [_, b]| volume_ml(b).total_cmp(&volume_ml(a)));
    let current = all.iter().position(|link| selected.is_link(*link));
    let at = current.map_or(0, |at| (at + 1) % all.len().max(1));
    if let Some([from, to]) = all.get(at) {
        *selected = Selected::Link((*from).clone(), (*to).clone());
        let volume_ml = part_of(report, to).map_or(1.0, |(_, part)| part.volume_ml);
        go_to(input, to, volume_ml, out);
    }
}

fn of_link(ui: &mut Ui, report: &LesionsReport, [from, to]: [&Anchor; 2], edits: &mut Vec<Edit>) {
    let Some(link) = link_between(report, [from, to]) else { return };
    let ends = || (from.clone(), to.clone());
    if link.state == LinkState::Verified {
        ui.label("Verified");
    } else if is_asked(ui, "Verify the link", "Both are one lesion", Some(VERIFY)) {
        let (from, to) = ends();
        edits.push(Edit::Verify { from, to });
    }
    if is_asked(ui, "Unlink", "They are two lesions", Some(UNLINK)) {
        let (from, to) = ends();
        edits.push(Edit::Unlink { from, to });
    }
}

fn of_two(ui: &mut Ui, report: &LesionsReport, [one, two]: [&Anchor; 2], edits: &mut Vec<Edit>) {
    if link_between(report, [one, two]).is_some() {
        return of_link(ui, report, [one, two], edits);
    }
    let (from, to) = (one.clone(), two.clone());
    if one.time == two.time {
        if is_asked(ui, "Merge", "Both pieces are one lesion", Some(JOIN)) {
            edits.push(Edit::Merge { from, to });
        }
    } else if is_asked(ui, "Link", "Both are one lesion at two dates", Some(JOIN)) {
        edits.push(Edit::Link { from, to });
    }
}

/// A button that takes the diameters of a component over as a measurement, whose ends can be dragged.
fn measure(ui: &mut Ui, input: &Input<'_>, report: &LesionsReport, at: &Anchor, out: &mut Commands) {
    let Some((lesion, part)) = part_of(report, at) else { return };
    let Some(time) = input.case.time_points.iter().position(|time| time.label == at.time) else { return };
    let tip = "Its diameters become a measurement: drag the ends in the slice while the ruler is on";
    if !is_asked(ui, "Measure", tip, None) {
        return;
    }
    let (d1, d2) = (part.diameters.d1, part.diameters.d2);
    let ruler = Ruler {
        name: format!("Lesion {}, {}", title(lesion), at.time),
        from_mm: d1.from_mm,
        to_mm: d1.to_mm,
        shape: Shape::Diameters { across_mm: [d2.from_mm, d2.to_mm] },
        view: PaneId::Axial,
        time,
    };
    out.push(EditCommand::AddRuler(Box::new(ruler)));
    out.push(LookCommand::SetTime(time));
    out.push(LookCommand::SetCursor(d1.from_mm.midpoint(d1.to_mm)));
    out.push(LookCommand::SetTool(Tool::Diameters));
}

fn of_one(
    ui: &mut Ui,
    report: &LesionsReport,
    at: &Anchor,
    (naming, splitting): (&mut Option<Naming>, &mut Option<Splitting>),
    edits: &mut Vec<Edit>,
) {
    let Some((lesion, part)) = part_of(report, at) else { return };
    ui.label(format!("Lesion {}, {}", title(lesion), format::ml(part.volume_ml)));
    match naming {
        None => {
            if is_asked(ui, "Name…", "What the lesion is called at all dates", None) {
                *naming = Some(Naming { at: at.clone(), name: lesion.name.clone().unwrap_or_default() });
            }
        }
        Some(typed) => {
            let field =
                TextEdit::singleline(&mut typed.name).desired_width(140.0).char_limit(MOST_LESION_NAME);
            let response = ui.add(field.hint_text("Name of the lesion"));
            draw::name_widget(ui, &response, "Name of the lesion");
            if !response.lost_focus() && !response.has_focus() {
                response.request_focus();
            }
            let is_done = response.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
            let is_left = response.lost_focus() && !is_done;
            if ui.button("Set").clicked() || is_done {
                let name = typed.name.trim().to_owned();
                edits.push(Edit::Name { at: at.clone(), name });
                *naming = None;
            } else if is_left && ui.input(|i| i.key_pressed(Key::Escape)) {
                *naming = None;
            }
        }
    }
    let own = splitting.as_ref().filter(|splitting| splitting.at == *at);
    match own {
        None => {
            let tip = "At the narrowest place of its skeleton: two lesions that touch";
            if is_asked(ui, "Split at its neck", tip, None) {
                *splitting = Some(Splitting { at: at.clone(), why_not: None });
            }
        }
        Some(Splitting { why_not: None, .. }) => {
            ui.weak("looking for its neck");
        }
        Some(Splitting { why_not: Some(why), .. }) => {
            ui.colored_label(ui.visuals().warn_fg_color, format!("not split: {why}"));
        }
    }
    if is_asked(ui, "Ignore", "It is no lesion and doesn't count", None) {
        edits.push(Edit::Ignore { at: at.clone() });
    }
}

/// The user's edits, each of which can be taken back.
fn list(ui: &mut Ui, input: &Input<'_>, report: &LesionsReport, out: &mut Commands) {
    let setting = &input.doc.edit.lesions;
    let own: Vec<(usize, &Edit)> = setting
        .edits
        .iter()
        .enumerate()
        .filter(|(_, edit)| edit.anchor().is_none_or(|anchor| anchor.of == report.of))
        .collect();
    if own.is_empty() {
        return;
    }
    let title = if own.len() == 1 { "Your edit".to_owned() } else { format!("Your {} edits", own.len()) };
    egui::CollapsingHeader::new(title).id_salt("edits of lesions").show(ui, |ui| {
        let mut taken = None;
        for (number, edit) in &own {
            ui.horizontal(|ui| {
                let text = text(edit);
                let button = ui.small_button("Take back");
                button.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::Button, true, format!("Take back: {text}"))
                });
                if button.clicked() {
                    taken = Some(*number);
                }
                ui.label(text);
            });
        }
        if let Some(number) = taken {
            let mut edits = setting.edits.clone();
            edits.remove(number);
            out.push(EditCommand::SetLesions(Box::new(LesionSetting { edits, ..setting.clone() })));
        }
    });
}

fn text(edit: &Edit) -> String {
    let at = |anchor: &Anchor| {
        let [r, a, s] = anchor.at_mm.to_array();
        let time = if anchor.time.is_empty() { "" } else { &format!("{} ", anchor.time) };
        format!("{time}({r:.0}, {a:.0}, {s:.0})")
    };
    match edit {
        Edit::Link { from, to } => format!("{} and {} linked", at(from), at(to)),
        Edit::Unlink { from, to } => format!("{} and {} unlinked", at(from), at(to)),
        Edit::Merge { from, to } => format!("{} and {} merged", at(from), at(to)),
        Edit::Verify { from, to } => format!("link from {} to {} verified", at(from), at(to)),
        Edit::VerifyAll => "all links verified".to_owned(),
        Edit::Split { at: whole, .. } => format!("{} split", at(whole)),
        Edit::Ignore { at: one } => format!("{} ignored", at(one)),
        Edit::Name { at: one, name } => format!("{} named {name}", at(one)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::listed;

    /// A shortcut is heard before the pane: its key would do something else there.
    #[test]
    fn no_shortcut_has_a_key_of_the_pane() {
        for key in [VERIFY, UNLINK, JOIN, NEXT] {
            let taken = listed().iter().find(|listed| {
                listed.keys.is_some_and(|keys| keys.logical_key == key && keys.modifiers.is_none())
            });
            assert!(taken.is_none(), "{key:?} is {:?}", taken.map(|listed| &listed.command));
        }
    }
}
