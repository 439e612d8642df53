//! Slices of several dates and images side by side: one plane, one place, one magnification. Columns are dates, rows are
//! images; of one date the images are the columns.

use std::collections::BTreeMap;

use egui::{ComboBox, Rect, Ui, UiBuilder, pos2, vec2};
use glioscope_core::case::TimePoint;
use glioscope_render::flat::Plane;

use super::{
    pane::{DateInput, Input, Pane, Stage},
    slices::SlicePane,
};
use crate::{
    command::Commands,
    model::PaneId,
    theme::{self, LABEL_POINTS},
    world::Second,
};

/// Space between cells, points.
const GAP_POINTS: f32 = 2.0;
/// Height of the names of dates above the columns, points.
const HEADING_POINTS: f32 = 18.0;
/// Smallest side of a cell; more dates or images than fit are left out, and said.
const LEAST_CELL_POINTS: f32 = 90.0;
/// Seconds that a date is shown while dates follow each other in one place.
const CINE_SECONDS: f64 = 0.7;

/// What is side by side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Arrangement {
    /// Every date beside the others.
    #[default]
    Dates,
    /// Dates one after the other in one place.
    Cine,
}

/// The pane. Its arrangement isn't saved.
pub struct SideBySidePane {
    plane: Plane,
    arrangement: Arrangement,
    /// Whether all images of a date are shown, not only the chosen one.
    all_images: bool,
    /// Whether the latest date is on the left.
    is_reversed: bool,
    cells: BTreeMap<(usize, String), SlicePane>,
}

impl Default for SideBySidePane {
    fn default() -> Self {
        Self {
            plane: Plane::Axial,
            arrangement: Arrangement::default(),
            all_images: false,
            is_reversed: false,
            cells: BTreeMap::new(),
        }
    }
}

/// A cell: the number of its date, and its image's id; `None` where the date lacks it.
type Cell = (usize, Option<String>);

impl SideBySidePane {
    fn header(&mut self, ui: &mut Ui, dates: usize, most_images: usize) {
        ui.horizontal_wrapped(|ui| {
            let combo = ComboBox::from_id_salt("plane").selected_text(self.plane.name()).width(70.0);
            let response = combo.show_ui(ui, |ui| {
                for plane in Plane::ALL {
                    ui.selectable_value(&mut self.plane, plane, plane.name());
                }
            });
            response.response.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::ComboBox, true, "Plane of the slices side by side")
            });
            if most_images > 1 && dates > 1 {
                ui.checkbox(&mut self.all_images, "All images")
                    .on_hover_text("A row for each image of the case");
            }
            if dates > 1 {
                let mut is_cine = self.arrangement == Arrangement::Cine;
                let text = "The dates one after the other in one place: what changes, moves";
                if ui.checkbox(&mut is_cine, "In one place").on_hover_text(text).changed() {
                    self.arrangement = if is_cine { Arrangement::Cine } else { Arrangement::Dates };
                }
                if !is_cine && ui.button("Swap").on_hover_text("The latest date left or right").clicked() {
                    self.is_reversed = !self.is_reversed;
                }
            }
        });
    }

    /// Rows of cells.
    fn rows(&self, input: &Input<'_>, now: f64) -> Vec<Vec<Cell>> {
        let dates = input.dates;
        let mut columns: Vec<usize> = (0..dates.len()).collect();
        if self.arrangement == Arrangement::Cine && dates.len() > 1 {
            columns = vec![(now / CINE_SECONDS) as usize % dates.len()];
        } else if self.is_reversed {
            columns.reverse();
        }
        let mut ids: Vec<&str> = Vec::new();
        for id in dates.iter().flat_map(|date| &date.time_point.contexts).map(|c| c.id.as_str()) {
            if !ids.contains(&id) {
                ids.push(id);
            }
        }
        let chosen = input.doc.nav.context.as_deref();
        if dates.len() > 1 && !self.all_images {
            ids.retain(|id| Some(*id) == chosen);
        }
        let cell = |time: usize, id: &str| {
            let has = dates[time].time_point.contexts.iter().any(|c| c.id == id);
            (time, has.then(|| id.to_owned()))
        };
        if ids.is_empty() {
            return vec![columns.into_iter().map(|time| (time, None)).collect()];
        }
        if dates.len() == 1 {
            return vec![ids.iter().map(|id| cell(0, id)).collect()];
        }
        ids.iter().map(|id| columns.iter().map(|&time| cell(time, id)).collect()).collect()
    }

    fn cell(&mut self, ui: &mut Ui, input: &Input<'_>, cell: &Cell, rect: Rect, out: &mut Commands) {
        let (time, id) = cell;
        let Some(date) = input.dates.get(*time) else { return };
        let image = id.as_deref().and_then(|id| image_of(date, id));
        let of_date_shown = id.as_deref().and_then(|id| image_of(input.dates.get(input.time)?, id));
        let own = Input {
            time: *time,
            time_point: date.time_point,
            selection: &date.selection,
            tumor: None,
            colors: &date.colors,
            context: image,
            matched_to: of_date_shown.map(|(_, image)| image).filter(|_| *time != input.time),
            // Cells of one size and one magnification.
            fit_grid: Some(input.context.map_or(&input.case.grid, |(_, image)| image.volume().grid())),
            second: second_of(input, date, id.as_deref()),
            compared: None,
            ..*input
        };
        // Dates in one place are one widget: the pointer stays over it.
        let is_cine = self.arrangement == Arrangement::Cine;
        let key = (if is_cine { usize::MAX } else { *time }, id.clone().unwrap_or_default());
        let plane = self.plane;
        let pane =
            self.cells.entry(key.clone()).or_insert_with(|| SlicePane::in_pane(PaneId::SideBySide, plane));
        if pane.plane() != plane {
            *pane = SlicePane::in_pane(PaneId::SideBySide, plane);
        }
        ui.scope_builder(UiBuilder::new().max_rect(rect).id_salt(key), |ui| {
            ui.set_clip_rect(rect.intersect(ui.clip_rect()));
            pane.draw(ui, &own, out);
        });
    }
}

/// An image of a date, by its id.
fn image_of<'a>(
    date: &DateInput<'a>,
    id: &str,
) -> Option<(&'a str, &'a std::sync::Arc<glioscope_render::flat::PreparedContext>)> {
    let index = date.time_point.contexts.iter().position(|c| c.id == id)?;
    Some((date.time_point.contexts[index].id.as_str(), date.images.get(index)?))
}

/// The second image over a slice of a date: that date's own, with the window of the date shown, matched. Nothing over itself, and
/// where the second image is another date's: that compares dates, which stand side by side here.
fn second_of<'a>(input: &Input<'a>, date: &DateInput<'a>, first: Option<&str>) -> Option<Second<'a>> {
    let shown = input.second?;
    let has_own_date = input.doc.edit.fusion.second.as_ref().is_some_and(|second| second.time.is_some());
    if has_own_date || first == Some(shown.id) {
        return None;
    }
    let (id, image) = image_of(date, shown.id)?;
    let window = if std::sync::Arc::ptr_eq(image, shown.image) {
        shown.window
    } else {
        shown.window.matched(shown.image.histogram(), image.histogram())
    };
    Some(Second { id, time: &date.time_point.label, image, window })
}

/// What a date is called above its column: the last two are the prior and the current one.
fn heading(time_point: &TimePoint, time: usize, dates: usize) -> String {
    let word = match dates - time {
        _ if dates < 2 => "",
        1 => "current",
        2 => "prior",
        _ => "earlier",
    };
    let parts = [word, time_point.label.as_str()];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" · ")
}

impl Pane for SideBySidePane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        let input = &stage.input;
        let most_images =
            input.dates.iter().map(|date| date.time_point.contexts.len()).max().unwrap_or_default();
        if !input.is_picture {
            self.header(ui, input.dates.len(), most_images);
        }
        if let Some(compared) = input.compared.filter(|compared| compared.report.has_volumes_only()) {
            let why = compared.report.own_warnings(input.case).first().map(|check| check.message.clone());
            let text = "Not aligned: these slices show different places (Tools, Align dates and images)";
            let response = ui.colored_label(ui.visuals().warn_fg_color, text);
            response.on_hover_text(why.unwrap_or_default());
        }
        let is_cine = self.arrangement == Arrangement::Cine && input.dates.len() > 1;
        let now = if is_cine { ui.input(|i| i.time) } else { 0.0 };
        if is_cine {
            let left = CINE_SECONDS - now % CINE_SECONDS;
            ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64(left.max(0.01)));
        }
        let mut rows = self.rows(input, now);
        let area = ui.available_rect_before_wrap();
        let most = |points: f32| {
            ((points + GAP_POINTS) / (LEAST_CELL_POINTS + GAP_POINTS)).floor().max(1.0) as usize
        };
        let has_headings = input.dates.len() > 1;
        let top = area.top() + if has_headings { HEADING_POINTS } else { 0.0 };
        let (most_columns, most_rows) = (most(area.width()), most(area.bottom() - top));
        let all = rows.iter().map(Vec::len).sum::<usize>();
        // The latest dates are kept.
        for row in &mut rows {
            let surplus = row.len().saturating_sub(most_columns);
            if self.is_reversed { row.truncate(most_columns) } else { drop(row.drain(..surplus)) }
        }
        rows.truncate(most_rows);
        let shown = rows.iter().map(Vec::len).sum::<usize>();
        let columns = rows.iter().map(Vec::len).max().unwrap_or(1).max(1);
        let size = vec2(
            (area.width() - GAP_POINTS * (columns - 1) as f32) / columns as f32,
            (area.bottom() - top - GAP_POINTS * (rows.len().max(1) - 1) as f32) / rows.len().max(1) as f32,
        );
        let ink = ui.visuals().text_color();
        for (y, row) in rows.iter().enumerate() {
            for (x, cell) in row.iter().enumerate() {
                let corner = pos2(
                    area.left() + x as f32 * (size.x + GAP_POINTS),
                    top + y as f32 * (size.y + GAP_POINTS),
                );
                if y == 0 && has_headings {
                    let text = heading(input.dates[cell.0].time_point, cell.0, input.dates.len());
                    let at = pos2(corner.x + size.x / 2.0, area.top() + HEADING_POINTS / 2.0);
                    let painter = ui.painter().with_clip_rect(Rect::from_min_size(
                        pos2(corner.x, area.top()),
                        vec2(size.x, HEADING_POINTS),
                    ));
                    painter.text(at, egui::Align2::CENTER_CENTER, text, theme::font(LABEL_POINTS), ink);
                }
                self.cell(ui, input, cell, Rect::from_min_size(corner, size), out);
            }
        }
        if shown < all {
            let text = format!("{} of {all} slices: the pane is too small for more", shown);
            let at = area.left_bottom() + vec2(6.0, -6.0);
            ui.painter().text(
                at,
                egui::Align2::LEFT_BOTTOM,
                text,
                theme::font(LABEL_POINTS),
                theme::WARNING_ON_IMAGE,
            );
        }
        let kept: Vec<(usize, String)> =
            rows.into_iter().flatten().map(|(time, id)| (time, id.unwrap_or_default())).collect();
        if !is_cine {
            self.cells.retain(|key, _| kept.contains(key));
        }
    }
}
