//! Interaction shared by the ring, the bar and the UpSet plot: each diagram is one widget for the mouse, and a row of
//! check boxes for the keyboard and screen readers.

use egui::{Id, PointerButton, Popup, Pos2, Rect, Response, Role, Sense, Ui, WidgetInfo};

use super::{OverlapInput, Shown, Target, target::shown_word};
use crate::{
    command::{Commands, EditCommand},
    format,
    views::pointer,
};

/// The area of a piece for the keyboard and screen readers.
pub struct FocusArea {
    /// The piece's region or mask.
    pub target: Target,
    /// A part of the piece around its centre. The mouse uses `hit` instead.
    pub rect: Rect,
}

/// The user's interaction with a diagram in this frame.
pub struct Interaction {
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

/// A click on a table's row toggles its region or mask; a double-click or Shift-click shows only it.
pub fn click_row(response: &Response, target: Target, out: &mut Commands) {
    if response.clicked() && !response.triple_clicked() {
        let show_only = response.double_clicked() || pointer::press_modifiers(&response.ctx).shift;
        out.push(if show_only { only(target) } else { toggle(target) });
    }
}

/// Makes the pieces in `rect` clickable: a click toggles the piece under the cursor, a double-click or Shift-click
/// shows only it, a right click opens a menu; space and enter act as a click on the focused piece. A double-click sends
/// the toggle of its first click and then `Only…`, which sets the whole selection, so the toggle has no effect on the
/// result.
pub fn clickable_pieces(
    ui: &Ui,
    id: Id,
    rect: Rect,
    focus_areas: &[FocusArea],
    hit: impl Fn(Pos2) -> Option<Target>,
    input: &OverlapInput<'_>,
    out: &mut Commands,
) -> Interaction {
    let mut diagram = ui.interact(rect, id, Sense::CLICK);
    let mut focused = None;
    for area in focus_areas {
        let shown = input.shown(area.target);
        let response = ui.interact(area.rect, id.with(area.target), Sense::click());
        response.widget_info(|| {
            WidgetInfo::selected(
                Role::CheckBox,
                ui.is_enabled(),
                shown == Shown::All,
                input.accessible_text(area.target),
            )
        });
        if response.gained_focus() {
            response.scroll_to_me(None);
        }
        if response.has_focus() {
            focused = Some(area.target);
        }
        // Keyboard and screen readers click without a mouse button.
        if response.clicked() && !response.clicked_by(PointerButton::Primary) {
            let show_only = ui.input(|i| i.modifiers.shift);
            out.push(if show_only { only(area.target) } else { toggle(area.target) });
        }
        diagram = diagram.union(response);
    }
    let hovered = diagram.hover_pos().filter(|_| diagram.hovered()).and_then(&hit);
    if let Some(target) = diagram.interact_pointer_pos().and_then(&hit)
        && diagram.clicked_by(PointerButton::Primary)
        && !diagram.triple_clicked()
    {
        let show_only = diagram.double_clicked() || pointer::press_modifiers(ui.ctx()).shift;
        out.push(if show_only { only(target) } else { toggle(target) });
    }
    let diagram = menu(ui, id, diagram, &hit, input, out);
    if let Some(target) = hovered {
        let response = diagram.on_hover_cursor(egui::CursorIcon::PointingHand);
        if !Popup::is_any_open(ui.ctx()) {
            response.on_hover_ui_at_pointer(|ui| tooltip(ui, input, target));
        }
    }
    Interaction { hovered, focused }
}

fn menu(
    ui: &Ui,
    id: Id,
    diagram: Response,
    hit: &impl Fn(Pos2) -> Option<Target>,
    input: &OverlapInput<'_>,
    out: &mut Commands,
) -> Response {
    let target_id = id.with("menu");
    if diagram.secondary_clicked() {
        let target = diagram.interact_pointer_pos().and_then(hit);
        ui.data_mut(|d| d.insert_temp(target_id, target));
    }
    diagram.context_menu(|ui| {
        if let Some(target) = ui.data(|d| d.get_temp::<Option<Target>>(target_id)).flatten() {
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
    diagram
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
    let visibility = capitalized(shown_word(shown));
    let detail = if shown == Shown::Some { ": not all of its regions are" } else { "" };
    ui.weak(format!("{visibility}{detail}. Click: on or off. Double-click: only this."));
}

fn capitalized(word: &str) -> String {
    let mut chars = word.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}
