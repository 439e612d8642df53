//! One way of clicking for the ring, the bar and the UpSet plot: what is drawn as one picture is one
//! surface for the mouse, and a row of check boxes for the keyboard and the screen reader.

use egui::{Id, PointerButton, Popup, Pos2, Rect, Response, Role, Sense, Ui, WidgetInfo};

use super::{OverlapInput, Shown, Target, target::shown_word};
use crate::{
    command::{Commands, EditCommand},
    format,
};

/// A clickable piece and where its middle is.
pub struct Spot {
    /// What it stands for.
    pub target: Target,
    /// A part of the piece around its middle. It is where keyboard and screen reader find it; the
    /// mouse goes by `hit`.
    pub rect: Rect,
}

/// What the user does with a picture in this frame.
pub struct Touched {
    /// Piece under the cursor.
    pub hovered: Option<Target>,
    /// Piece with keyboard focus.
    pub focused: Option<Target>,
}

fn toggle(target: Target) -> EditCommand {
    match target {
        Target::Region(bits) => EditCommand::ToggleRegion(bits),
        Target::Mask(k) => EditCommand::ToggleMask(k),
    }
}

fn only(target: Target) -> EditCommand {
    match target {
        Target::Region(bits) => EditCommand::OnlyRegion(bits),
        Target::Mask(k) => EditCommand::OnlyMask(k),
    }
}

/// Makes `rect` clickable: click toggles the piece under the cursor, double-click (or with shift)
/// shows only it, the right button opens a menu; space and enter do the same for the piece with
/// focus. A double-click sends the toggle of its first click and then `Only…`, which says the whole
/// selection, so the end is the same whatever the toggle did.
pub fn picture(
    ui: &Ui,
    id: Id,
    rect: Rect,
    spots: &[Spot],
    hit: impl Fn(Pos2) -> Option<Target>,
    input: &OverlapInput<'_>,
    out: &mut Commands,
) -> Touched {
    let mut all = ui.interact(rect, id, Sense::CLICK);
    let mut focused = None;
    for spot in spots {
        let shown = input.shown(spot.target);
        let response = ui.interact(spot.rect, id.with(spot.target), Sense::click());
        response.widget_info(|| {
            WidgetInfo::selected(
                Role::CheckBox,
                ui.is_enabled(),
                shown == Shown::All,
                input.spoken(spot.target),
            )
        });
        if response.gained_focus() {
            response.scroll_to_me(None);
        }
        if response.has_focus() {
            focused = Some(spot.target);
        }
        // Keyboard and screen reader: a click without a mouse button.
        if response.clicked() && !response.clicked_by(PointerButton::Primary) {
            let alone = ui.input(|i| i.modifiers.shift);
            out.push(if alone { only(spot.target) } else { toggle(spot.target) });
        }
        all = all.union(response);
    }
    let hovered = all.hover_pos().filter(|_| all.hovered()).and_then(&hit);
    if let Some(target) = all.interact_pointer_pos().and_then(&hit)
        && all.clicked_by(PointerButton::Primary)
        && !all.triple_clicked()
    {
        let alone = all.double_clicked() || ui.input(|i| i.modifiers.shift);
        out.push(if alone { only(target) } else { toggle(target) });
    }
    let all = menu(ui, id, all, &hit, input, out);
    if let Some(target) = hovered {
        let response = all.on_hover_cursor(egui::CursorIcon::PointingHand);
        if !Popup::is_any_open(ui.ctx()) {
            response.on_hover_ui_at_pointer(|ui| tooltip(ui, input, target));
        }
    }
    Touched { hovered, focused }
}

fn menu(
    ui: &Ui,
    id: Id,
    all: Response,
    hit: &impl Fn(Pos2) -> Option<Target>,
    input: &OverlapInput<'_>,
    out: &mut Commands,
) -> Response {
    let about = id.with("menu");
    if all.secondary_clicked() {
        let target = all.interact_pointer_pos().and_then(hit);
        ui.data_mut(|d| d.insert_temp(about, target));
    }
    all.context_menu(|ui| {
        if let Some(target) = ui.data(|d| d.get_temp::<Option<Target>>(about)).flatten() {
            let name = input.name(target);
            let word = if input.shown(target) == Shown::All { "Hide" } else { "Show" };
            if ui.button(format!("{word} {name}")).clicked() {
                out.push(toggle(target));
            }
            if ui.button(format!("Show only {name}")).clicked() {
                out.push(only(target));
            }
            ui.separator();
        }
        if ui.button("Show all").clicked() {
            out.push(EditCommand::ShowAllRegions);
        }
    });
    all
}

/// Name, size and share of a region or mask.
pub fn tooltip(ui: &mut Ui, input: &OverlapInput<'_>, target: Target) {
    let title = match target {
        Target::Region(_) => input.title(target),
        Target::Mask(_) => format!("Mask {}", input.name(target)),
    };
    ui.strong(title);
    ui.label(format!("{} · {} of union", format::ml(input.ml(target)), format::percent(input.share(target))));
    ui.label(format!("{} voxels", format::count(input.voxels(target))));
    let shown = input.shown(target);
    let how = capital(shown_word(shown));
    let why = if shown == Shown::Some { ": not all of its regions are" } else { "" };
    ui.weak(format!("{how}{why}. Click: on or off. Double-click: only this."));
}

fn capital(word: &str) -> String {
    let mut chars = word.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}
