//! The layout of panes in the window.

use std::collections::HashMap;

use egui::{Color32, Rect, Ui, WidgetText, vec2};
use egui_tiles::{Behavior, SimplificationOptions, TabState, TileId, Tiles, UiResponse};

use crate::{
    command::{AppCommand, Command, Commands, EditCommand},
    model::PaneId,
    theme::Tokens,
    views::{Panes, Shared},
};

/// Inputs and outputs of drawing the panes.
pub struct PaneArea<'a> {
    /// The panes.
    pub panes: &'a mut Panes,
    /// State that they are drawn with.
    pub shared: Shared<'a>,
    /// Rectangles of the panes drawn.
    pub rects: HashMap<PaneId, Rect>,
    /// The user's commands.
    pub out: &'a mut Commands,
}

/// Draws the layout, or the maximised pane alone.
pub fn show(ui: &mut Ui, area: &mut PaneArea<'_>) {
    let edit = &area.shared.input.doc.edit;
    if let Some(pane) = edit.maximized {
        egui::Panel::top("maximized").show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.strong(pane.tab());
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    pane_buttons(ui, pane, true, false, area.out);
                });
            });
        });
        if let Some(beside) = beside(pane, area.shared.input.case.time_points.len()) {
            let width = ui.available_width();
            let panel = egui::Panel::right("beside maximized").frame(egui::Frame::NONE);
            panel.resizable(true).default_size(0.42 * width).show(ui, |ui| area.pane(ui, beside));
        }
        egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| area.pane(ui, pane));
        return;
    }
    let mut layout = edit.layout.clone();
    layout.ui(area, ui);
    // The first draw simplifies the tree; this is stored too, or it would be repeated every frame.
    if layout != edit.layout {
        area.out.push(EditCommand::SetLayout(Box::new(layout)));
    }
}

/// What stays beside a maximised pane: the images of several dates, while calls are made of them.
pub fn beside(maximized: PaneId, dates: usize) -> Option<PaneId> {
    (maximized == PaneId::Response && dates > 1).then_some(PaneId::SideBySide)
}

impl PaneArea<'_> {
    /// Draws one pane into all of `ui`.
    pub fn pane(&mut self, ui: &mut Ui, pane: PaneId) {
        self.rects.insert(pane, ui.available_rect_before_wrap());
        self.panes.show(ui, pane, &mut self.shared, self.out);
    }
}

/// `closable`: whether another pane would be left.
fn pane_buttons(ui: &mut Ui, pane: PaneId, maximized: bool, closable: bool, out: &mut Commands) {
    let (icon, verb) = if maximized { (Icon::Restore, "Restore") } else { (Icon::Maximise, "Maximise") };
    // Right to left.
    let close = (Icon::Close, "Close", Command::from(EditCommand::TogglePane(pane)));
    let buttons = [
        (icon, verb, Command::from(EditCommand::MaximizePane(pane))),
        (Icon::Camera, "Picture of", Command::from(AppCommand::ScreenshotPane(pane))),
    ];
    for (icon, verb, command) in closable.then_some(close).into_iter().chain(buttons) {
        let label = format!("{verb} {}", pane.title());
        let response = icon_button(ui, icon, &label);
        let response = match icon {
            Icon::Camera => response.on_hover_text("As a file now. K over the view keeps it for the report."),
            _ => response,
        };
        if response.clicked() {
            out.push(command);
        }
    }
}

/// Icons drawn as shapes, because egui's default fonts lack them.
#[derive(Clone, Copy)]
enum Icon {
    Close,
    Maximise,
    Restore,
    Camera,
}

fn icon_button(ui: &mut Ui, icon: Icon, label: &str) -> egui::Response {
    let (rect, response) = ui.allocate_exact_size(vec2(20.0, 18.0), egui::Sense::click());
    let visuals = ui.style().interact(&response);
    let stroke = egui::Stroke::new(1.2, visuals.fg_stroke.color);
    let painter = ui.painter();
    if response.hovered() || response.has_focus() {
        painter.rect_filled(rect, 3.0, visuals.weak_bg_fill);
    }
    let centered = |size| Rect::from_center_size(rect.center(), size);
    let outline = |rect, rounding| painter.rect_stroke(rect, rounding, stroke, egui::StrokeKind::Middle);
    match icon {
        Icon::Close => {
            let square = centered(vec2(8.0, 8.0));
            painter.line_segment([square.left_top(), square.right_bottom()], stroke);
            painter.line_segment([square.right_top(), square.left_bottom()], stroke);
        }
        Icon::Maximise => {
            let frame = centered(vec2(11.0, 9.0));
            outline(frame, 1.0);
            painter.hline(frame.x_range(), frame.top() + 2.0, stroke);
        }
        Icon::Restore => {
            outline(centered(vec2(8.0, 6.0)).translate(vec2(-1.5, 1.5)), 1.0);
            outline(centered(vec2(8.0, 6.0)).translate(vec2(1.5, -1.5)), 1.0);
        }
        Icon::Camera => {
            outline(centered(vec2(12.0, 8.0)).translate(vec2(0.0, 0.8)), 1.5);
            painter.circle_stroke(rect.center() + vec2(0.0, 0.8), 2.2, stroke);
            painter.hline(rect.center().x - 2.0..=rect.center().x + 2.0, rect.center().y - 4.4, stroke);
        }
    }
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, label));
    response.on_hover_text(label)
}

impl Behavior<PaneId> for PaneArea<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, pane: &mut PaneId) -> UiResponse {
        let fill = ui.visuals().panel_fill;
        ui.painter().rect_filled(ui.max_rect(), 0.0, fill);
        self.pane(ui, *pane);
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &PaneId) -> WidgetText {
        pane.tab().into()
    }

    fn top_bar_right_ui(
        &mut self,
        tiles: &Tiles<PaneId>,
        ui: &mut Ui,
        _tile: TileId,
        tabs: &egui_tiles::Tabs,
        _scroll_offset: &mut f32,
    ) {
        if let Some(pane) = tabs.active.and_then(|tile| tiles.get_pane(&tile)) {
            ui.add_space(4.0);
            let closable = tiles.iter().filter(|(_, tile)| tile.is_pane()).count() > 1;
            pane_buttons(ui, *pane, false, closable, self.out);
        }
    }

    fn tab_bar_height(&self, _style: &egui::Style) -> f32 {
        24.0
    }

    fn tab_bar_color(&self, visuals: &egui::Visuals) -> Color32 {
        Tokens::of(visuals.dark_mode).raised
    }

    fn tab_outline_stroke(
        &self,
        visuals: &egui::Visuals,
        _: &Tiles<PaneId>,
        _: TileId,
        state: &TabState,
    ) -> egui::Stroke {
        let tokens = Tokens::of(visuals.dark_mode);
        if state.active { egui::Stroke::new(1.0, tokens.line) } else { egui::Stroke::NONE }
    }

    fn tab_text_color(
        &self,
        visuals: &egui::Visuals,
        _: &Tiles<PaneId>,
        _: TileId,
        state: &TabState,
    ) -> Color32 {
        let tokens = Tokens::of(visuals.dark_mode);
        if state.active { tokens.text } else { tokens.second }
    }

    fn gap_width(&self, _style: &egui::Style) -> f32 {
        3.0
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: true, ..SimplificationOptions::default() }
    }
}
