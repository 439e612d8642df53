//! The grid of glyphs: only those in sight are drawn.

use egui::{
    CursorIcon, Rect, Response, ScrollArea, Sense, Shape, Stroke, StrokeKind, Ui, WidgetInfo, epaint::Mesh,
    pos2, vec2,
};
use glioscope_cohort::Collected;
use glioscope_render::{MaskColors, Palette};

use super::{
    color::Colors,
    glyph::{self, Glyphs},
    picker,
};
use crate::{
    command::{AppCommand, Commands},
    model::cohort::CohortSetting,
    theme::{self, LABEL_POINTS, Tokens},
    views::draw,
    world::cohort::Columns,
};

/// Space between cells, points.
const SPACE: f32 = 6.0;
/// Height of a line of words in a cell, points.
const LINE: f32 = 15.0;
/// Height of the bar that has a case's colour, points.
const BAR: f32 = 6.0;
/// From this width on a cell has words.
const WORDS_FROM: f32 = 60.0;

/// What a grid is drawn with.
pub struct GridInput<'a> {
    /// The tables.
    pub collected: &'a Collected,
    /// How they are shown.
    pub setting: &'a CohortSetting,
    /// The cases in their order.
    pub shown: &'a [usize],
    /// All glyphs; `None` while they are laid out.
    pub glyphs: Option<&'a Glyphs>,
    /// What the cases' colours tell; `None`: nothing.
    pub colors: Option<&'a Colors>,
    /// Begin at the first case again.
    pub from_the_top: bool,
}

/// Colours of the masks drawn: those that a case with as many masks has.
pub fn mask_colors(setting: &CohortSetting) -> MaskColors {
    MaskColors::new(Palette::default(), &vec![None; setting.masks.len()])
}

/// Size of a cell, points.
pub fn cell_size(setting: &CohortSetting) -> [f32; 2] {
    let width = setting.cell_points;
    let words = if width >= WORDS_FROM { 2.0 * LINE } else { 0.0 };
    [width, width + words + BAR + 4.0]
}

/// The largest radius of a glyph, points.
pub fn radius(setting: &CohortSetting) -> f32 {
    let cell = Rect::from_min_size(pos2(0.0, 0.0), cell_size(setting).into());
    glyph_rect(cell).width() / 2.0
}

/// Draws the grid into the rest of `ui`.
pub fn show(ui: &mut Ui, input: &GridInput<'_>, columns: &mut Columns, out: &mut Commands) {
    let size = vec2(cell_size(input.setting)[0], cell_size(input.setting)[1]);
    let step = size + vec2(SPACE, SPACE);
    let room = ui.available_width() - ui.spacing().scroll.bar_width - 8.0;
    let across = ((room + SPACE) / step.x).floor().max(1.0) as usize;
    let rows = input.shown.len().div_ceil(across);
    let mut area = ScrollArea::vertical().id_salt("cohort grid").auto_shrink(false);
    if input.from_the_top {
        area = area.vertical_scroll_offset(0.0);
    }
    area.show_viewport(ui, |ui, viewport| {
        ui.set_min_size(vec2(across as f32 * step.x, rows as f32 * step.y));
        let corner = ui.max_rect().min;
        let first = (viewport.top() / step.y).floor().max(0.0) as usize;
        let last = ((viewport.bottom() / step.y).ceil().max(0.0) as usize).min(rows);
        let mut mesh = Mesh::default();
        let cells = (first..last).flat_map(|row| (0..across).map(move |column| [row, column]));
        for [row, column] in cells {
            let Some(&case) = input.shown.get(row * across + column) else { break };
            let at = corner + vec2(column as f32 * step.x, row as f32 * step.y);
            cell(ui, Rect::from_min_size(at, size), case, input, columns, &mut mesh, out);
        }
        ui.painter().add(Shape::mesh(mesh));
    });
}

/// The rectangle in which a cell's glyph lies.
fn glyph_rect(cell: Rect) -> Rect {
    Rect::from_min_size(cell.min, vec2(cell.width(), cell.width())).shrink(3.0)
}

fn cell(
    ui: &mut Ui,
    rect: Rect,
    case: usize,
    input: &GridInput<'_>,
    columns: &mut Columns,
    mesh: &mut Mesh,
    out: &mut Commands,
) {
    let GridInput { collected, setting, glyphs, colors, .. } = input;
    let Some(name) = collected.cases().get(case) else { return };
    let tokens = Tokens::in_ui(ui);
    let response = ui.interact(rect, ui.scope_id().with(("case", case)), Sense::click());
    let value = colors.map_or_else(String::new, |colors| colors.text(case));
    response.widget_info(|| {
        let color = setting.color.as_ref().map(|color| format!(", {}: {value}", picker::title(color)));
        WidgetInfo::labeled(egui::Role::Button, true, format!("{name}{}", color.unwrap_or_default()))
    });
    if response.gained_focus() {
        response.scroll_to_me(None);
    }
    let painter = ui.painter();
    if response.hovered() || response.has_focus() {
        painter.rect(
            rect.expand(2.0),
            4.0,
            tokens.raised,
            Stroke::new(1.5, tokens.interaction),
            StrokeKind::Outside,
        );
    }
    let place = glyph_rect(rect);
    let radius = place.width() / 2.0;
    if let Some(glyphs) = glyphs
        && let Some(found) = glyphs.get(case)
    {
        if found.is_empty() {
            glyph::empty(ui, place.center(), radius, tokens.line);
        } else {
            let shrunk = glyphs.shrunk(found, setting.scale, f64::from(radius));
            let pixel = 1.0 / ui.ctx().pixels_per_point();
            glyph::add(mesh, found, place.center(), shrunk, &mask_colors(setting), pixel);
        }
    }
    if columns.failures().contains_key(&case) {
        let font = theme::font(theme::TEXT_POINTS);
        painter.text(rect.right_top(), egui::Align2::RIGHT_TOP, "⚠", font, tokens.warning);
    }
    let mut y = rect.top() + rect.width();
    if rect.width() >= WORDS_FROM {
        let font = theme::font(LABEL_POINTS);
        for (text, ink) in [(name.as_str(), tokens.text), (value.as_str(), tokens.second)] {
            let galley = draw::elided(ui, text, &font, ink, rect.width());
            painter.galley(pos2(rect.center().x - galley.size().x / 2.0, y), galley, ink);
            y += LINE;
        }
    }
    if let Some(colors) = colors {
        let bar = Rect::from_min_size(pos2(rect.left(), y + 1.0), vec2(rect.width(), BAR));
        let edge = Stroke::new(1.0, tokens.second.gamma_multiply(0.7));
        match colors.of(case, ui.visuals().dark_mode) {
            Some(color) => painter.rect(bar, 2.0, color, edge, StrokeKind::Inside),
            None => painter.rect_stroke(bar, 2.0, edge, StrokeKind::Inside),
        };
    }
    if response.clicked() {
        out.push(AppCommand::OpenCohortCase(name.clone()));
    }
    tell(response, case, input, columns);
}

/// What a case's tooltip says: its numbers.
fn tell(response: Response, case: usize, input: &GridInput<'_>, columns: &mut Columns) {
    let GridInput { collected, setting, .. } = input;
    response.on_hover_cursor(CursorIcon::PointingHand).on_hover_ui_at_pointer(|ui| {
        ui.strong(collected.cases().get(case).map_or("", String::as_str));
        let chosen = setting.color.iter().chain(&setting.sort);
        let mut told = Vec::new();
        for quantity in chosen.chain(setting.axes.iter().map(|axis| &axis.quantity)) {
            if told.contains(quantity) {
                continue;
            }
            told.push(quantity.clone());
            let unit = columns.offer(quantity).map_or("", |offer| offer.unit);
            let text = columns.get(collected, quantity).text(case, unit);
            ui.label(format!("{}: {text}", picker::title(quantity)));
        }
        if let Some(why) = columns.failures().get(&case) {
            ui.colored_label(ui.visuals().warn_fg_color, why);
        }
        ui.weak("Click: opens the case.");
    });
}
