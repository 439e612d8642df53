//! The panes of the window: which view is drawn where.

use std::{collections::HashMap, path::Path};

use egui::{Rect, Ui, WidgetText, vec2};
use egui_tiles::{Behavior, SimplificationOptions, TileId, Tiles, UiResponse};
use glioscope_render::Scene;

use crate::{
    commands::Command,
    comparing::Comparisons,
    document::Pane,
    viewport::Viewport,
    views::{
        ViewContext, change, closeup, context, dates, diagnostics,
        ellipsoids::{self, Stage},
        lens_table, measurements,
        overlap::{self, OverlapInput},
        plane, slices, transfer,
    },
};

/// What the panes besides the closeup remember between frames; never saved.
#[derive(Default)]
pub struct PaneStates {
    /// The image of the context view and of its editor.
    pub volume: context::VolumeJob,
    /// The context view.
    pub context: context::ContextState,
    /// The ellipsoid diagram.
    pub ellipsoids: ellipsoids::EllipsoidState,
    /// The change view.
    pub change: change::ChangeState,
    /// The comparison of two dates.
    pub comparisons: Comparisons,
    /// The dates pane.
    pub dates: dates::DatesState,
    /// The transfer-function editor.
    pub transfer: transfer::TransferState,
    /// The axial slice in 3D.
    pub plane: plane::PlaneState,
}

/// What drawing the panes needs, and what it leaves behind.
pub struct PaneArea<'a> {
    /// What views read.
    pub view: ViewContext<'a>,
    /// The closeup's scene.
    pub scene: &'a Scene,
    /// The session file, beside which results are kept.
    pub session: Option<&'a Path>,
    /// The 3D renderer.
    pub viewport: Option<&'a mut Viewport>,
    /// What the closeup remembers.
    pub closeup: &'a mut closeup::CloseupState,
    /// What the other panes remember.
    pub states: &'a mut PaneStates,
    /// Whether drafts are skipped.
    pub refine_at_once: bool,
    /// Where each pane was drawn.
    pub rects: HashMap<Pane, Rect>,
    /// What the user did.
    pub out: &'a mut Vec<Command>,
}

/// Draws the layout, or the maximised pane alone.
pub fn show(ui: &mut Ui, area: &mut PaneArea<'_>) {
    let edit = &area.view.doc.edit;
    if let Some(pane) = edit.maximized {
        egui::Panel::top("maximized").show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.strong(pane.tab());
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    pane_buttons(ui, pane, true, area.out);
                });
            });
        });
        egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| area.pane(ui, pane));
        return;
    }
    let mut layout = edit.layout.clone();
    layout.ui(area, ui);
    // The first draw simplifies the tree; that is no deed of the user's, but it must be kept all the
    // same, or every frame would do it again.
    if layout != edit.layout {
        area.out.push(Command::SetLayout(Box::new(layout)));
    }
}

impl PaneArea<'_> {
    /// Draws one view into all of `ui`.
    pub fn pane(&mut self, ui: &mut Ui, pane: Pane) {
        self.rects.insert(pane, ui.available_rect_before_wrap());
        let Self { view, scene, session, viewport, closeup, states, refine_at_once, out, .. } = self;
        let PaneStates { volume, context, ellipsoids, change, comparisons, dates, transfer, plane } =
            &mut **states;
        let stage = Stage {
            viewport: viewport.as_deref_mut(),
            refine_at_once: *refine_at_once,
            session: *session,
            plane,
        };
        match pane {
            Pane::Closeup => {
                closeup::show(ui, view, scene, stage.viewport, closeup, *refine_at_once, out);
            }
            Pane::Context => context::show(ui, view, scene.tumor.as_ref(), stage, (context, volume), out),
            Pane::Ellipsoids => ellipsoids::show(ui, view, stage, ellipsoids, out),
            Pane::Change => change::show(ui, view, stage, (change, comparisons, volume), out),
            Pane::Dates => padded(ui, |ui| {
                dates::show(ui, view, (dates, comparisons), *refine_at_once, out);
            }),
            Pane::Transfer => transfer::show(ui, view, (transfer, volume), *refine_at_once, out),
            Pane::Overlap => {
                let input = overlap_input(view);
                padded(ui, |ui| {
                    overlap::show(ui, &input, out);
                });
            }
            Pane::Lens => padded(ui, |ui| lens_table::show(ui, view, scene.tumor.as_ref(), out)),
            Pane::Measurements => padded(ui, |ui| measurements::show(ui, view, out)),
            Pane::Slice(plane) => slices::show(ui, view, plane, out),
            Pane::Diagnostics => diagnostics::show(ui, stage.viewport, comparisons),
        }
    }
}

fn padded(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    egui::Frame::new().inner_margin(6).show(ui, show);
}

fn overlap_input<'a>(view: &ViewContext<'a>) -> OverlapInput<'a> {
    OverlapInput {
        regions: &view.time_point.regions,
        selection: &view.doc.edit.selection,
        colors: view.colors,
        mode: view.doc.edit.overlap_mode,
    }
}

fn pane_buttons(ui: &mut Ui, pane: Pane, maximized: bool, out: &mut Vec<Command>) {
    let (icon, words) = if maximized { (Icon::Restore, "Restore") } else { (Icon::Maximise, "Maximise") };
    for (icon, label, command) in [
        (icon, format!("{words} {}", pane.title()), Command::MaximizePane(pane)),
        (Icon::Camera, format!("Picture of {}", pane.title()), Command::ScreenshotPane(pane)),
    ] {
        if icon_button(ui, icon, &label).clicked() {
            out.push(command);
        }
    }
}

/// Signs drawn by hand: the default fonts have none for these.
#[derive(Clone, Copy)]
enum Icon {
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
    let box_of = |size| Rect::from_center_size(rect.center(), size);
    let outline = |rect, rounding| painter.rect_stroke(rect, rounding, stroke, egui::StrokeKind::Middle);
    match icon {
        Icon::Maximise => {
            let frame = box_of(vec2(11.0, 9.0));
            outline(frame, 1.0);
            painter.hline(frame.x_range(), frame.top() + 2.0, stroke);
        }
        Icon::Restore => {
            outline(box_of(vec2(8.0, 6.0)).translate(vec2(-1.5, 1.5)), 1.0);
            outline(box_of(vec2(8.0, 6.0)).translate(vec2(1.5, -1.5)), 1.0);
        }
        Icon::Camera => {
            outline(box_of(vec2(12.0, 8.0)).translate(vec2(0.0, 0.8)), 1.5);
            painter.circle_stroke(rect.center() + vec2(0.0, 0.8), 2.2, stroke);
            painter.hline(rect.center().x - 2.0..=rect.center().x + 2.0, rect.center().y - 4.4, stroke);
        }
    }
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, label));
    response.on_hover_text(label)
}

impl Behavior<Pane> for PaneArea<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, pane: &mut Pane) -> UiResponse {
        let fill = ui.visuals().panel_fill;
        ui.painter().rect_filled(ui.max_rect(), 0.0, fill);
        self.pane(ui, *pane);
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, pane: &Pane) -> WidgetText {
        pane.tab().into()
    }

    fn top_bar_right_ui(
        &mut self,
        tiles: &Tiles<Pane>,
        ui: &mut Ui,
        _tile: TileId,
        tabs: &egui_tiles::Tabs,
        _scroll_offset: &mut f32,
    ) {
        if let Some(pane) = tabs.active.and_then(|tile| tiles.get_pane(&tile)) {
            ui.add_space(4.0);
            pane_buttons(ui, *pane, false, self.out);
        }
    }

    fn tab_bar_height(&self, _style: &egui::Style) -> f32 {
        22.0
    }

    fn gap_width(&self, _style: &egui::Style) -> f32 {
        3.0
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: true, ..SimplificationOptions::default() }
    }
}
