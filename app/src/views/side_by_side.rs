//! Slices side by side: one place, one magnification. Columns are dates and rows are images, in one plane; of one date the images
//! are the columns. Or columns are the masks of the date shown, each alone, and rows are the three planes.

use std::collections::BTreeMap;

use egui::{ComboBox, Rect, Ui, UiBuilder, pos2, vec2};
use glioscope_core::case::TimePoint;
use glioscope_render::flat::Plane;

use super::{
    draw,
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
    /// The masks of the date shown, each alone, in all planes.
    Masks,
}

/// The pane. Its arrangement isn't saved.
pub struct SideBySidePane {
    plane: Plane,
    arrangement: Arrangement,
    /// Whether all images of a date are shown, not only the chosen one.
    all_images: bool,
    /// Whether the latest date is on the left.
    is_reversed: bool,
    cells: BTreeMap<Key, SlicePane>,
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

/// Of a cell: the number of its date, its image, its plane, its mask.
type Key = (usize, String, usize, Option<usize>);

/// A cell.
#[derive(Clone)]
struct Cell {
    /// Number of its date.
    time: usize,
    /// Its image's id; `None` where the date lacks it.
    image: Option<String>,
    plane: Plane,
    /// The mask that it shows alone, by its number.
    mask: Option<usize>,
}

impl Cell {
    fn key(&self, arrangement: Arrangement) -> Key {
        // Dates in one place are one widget: the pointer stays over it.
        let time = if arrangement == Arrangement::Cine { usize::MAX } else { self.time };
        (time, self.image.clone().unwrap_or_default(), self.plane as usize, self.mask)
    }
}

impl SideBySidePane {
    fn header(&mut self, ui: &mut Ui, input: &Input<'_>, most_images: usize) {
        let (dates, masks) = (input.dates.len(), input.time_point.masks.len());
        ui.horizontal_wrapped(|ui| {
            if self.arrangement != Arrangement::Masks {
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
            }
            let mut choose = |ui: &mut Ui, arrangement: Arrangement, name: &str, text: &str| {
                let mut is_chosen = self.arrangement == arrangement;
                if ui.checkbox(&mut is_chosen, name).on_hover_text(text).changed() {
                    self.arrangement = if is_chosen { arrangement } else { Arrangement::Dates };
                }
            };
            if dates > 1 {
                let text = "The dates one after the other in one place: what changes, moves";
                choose(ui, Arrangement::Cine, "In one place", text);
            }
            if masks > 1 {
                let text = "A column for each mask of the date shown, alone, and a row for each plane";
                choose(ui, Arrangement::Masks, "Masks by planes", text);
            }
            if dates > 1
                && self.arrangement == Arrangement::Dates
                && ui.button("Swap").on_hover_text("The latest date left or right").clicked()
            {
                self.is_reversed = !self.is_reversed;
            }
        });
    }

    /// Rows of cells.
    fn rows(&self, input: &Input<'_>, now: f64) -> Vec<Vec<Cell>> {
        let dates = input.dates;
        let chosen = input.doc.nav.context.as_deref();
        if self.arrangement == Arrangement::Masks {
            let image = input.context.map(|(id, _)| id.to_owned());
            let row = |plane| {
                let cell = |mask| Cell { time: input.time, image: image.clone(), plane, mask: Some(mask) };
                (0..input.time_point.masks.len()).map(cell).collect()
            };
            return Plane::ALL.into_iter().map(row).collect();
        }
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
        if dates.len() > 1 && !self.all_images {
            ids.retain(|id| Some(*id) == chosen);
        }
        let cell = |time: usize, id: &str| {
            let has = dates[time].time_point.contexts.iter().any(|c| c.id == id);
            Cell { time, image: has.then(|| id.to_owned()), plane: self.plane, mask: None }
        };
        if ids.is_empty() {
            let empty = |time| Cell { time, image: None, plane: self.plane, mask: None };
            return vec![columns.into_iter().map(empty).collect()];
        }
        if dates.len() == 1 {
            return vec![ids.iter().map(|id| cell(0, id)).collect()];
        }
        ids.iter().map(|id| columns.iter().map(|&time| cell(time, id)).collect()).collect()
    }

    fn cell(&mut self, ui: &mut Ui, input: &Input<'_>, cell: &Cell, rect: Rect, out: &mut Commands) {
        let Cell { time, image: id, plane, mask } = cell;
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
            only_mask: *mask,
            compared: None,
            ..*input
        };
        let (key, plane) = (cell.key(self.arrangement), *plane);
        let new = || SlicePane::in_pane(PaneId::SideBySide, plane);
        let pane = self.cells.entry(key.clone()).or_insert_with(new);
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
fn heading(time_point: &TimePoint, time: usize, dates: usize) -> [String; 2] {
    let word = match dates - time {
        _ if dates < 2 => "",
        1 => "current",
        2 => "prior",
        _ => "earlier",
    };
    let without_mask = if time_point.masks.is_empty() { " · no mask" } else { "" };
    [word.to_owned(), format!("{}{without_mask}", time_point.label)]
}

/// Both on one line.
fn on_one_line(parts: &[String; 2]) -> String {
    parts.iter().filter(|part| !part.is_empty()).map(String::as_str).collect::<Vec<_>>().join(" · ")
}

impl Pane for SideBySidePane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        let input = &stage.input;
        let most_images =
            input.dates.iter().map(|date| date.time_point.contexts.len()).max().unwrap_or_default();
        if !input.is_picture {
            self.header(ui, input, most_images);
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
        if self.arrangement == Arrangement::Masks && input.time_point.masks.len() < 2 {
            self.arrangement = Arrangement::Dates;
        }
        let mut rows = self.rows(input, now);
        let area = ui.available_rect_before_wrap();
        let most = |points: f32| {
            ((points + GAP_POINTS) / (LEAST_CELL_POINTS + GAP_POINTS)).floor().max(1.0) as usize
        };
        let headings = |cell: &Cell| match cell.mask {
            Some(mask) => {
                let ids = input.time_point.index.mask_ids();
                [input.doc.edit.masks.name(ids.get(mask).map_or("", String::as_str)), String::new()]
            }
            None => heading(input.dates[cell.time].time_point, cell.time, input.dates.len()),
        };
        let most_columns = most(area.width());
        let all = rows.iter().map(Vec::len).sum::<usize>();
        // The latest dates are kept.
        let keeps_first = self.is_reversed || self.arrangement == Arrangement::Masks;
        for row in &mut rows {
            let surplus = row.len().saturating_sub(most_columns);
            if keeps_first { row.truncate(most_columns) } else { drop(row.drain(..surplus)) }
        }
        let columns = rows.iter().map(Vec::len).max().unwrap_or(1).max(1);
        let width = (area.width() - GAP_POINTS * (columns - 1) as f32) / columns as f32;
        let has_headings = input.dates.len() > 1 || self.arrangement == Arrangement::Masks;
        let font = theme::font(LABEL_POINTS);
        let ink = ui.visuals().text_color();
        let top_row: Vec<[String; 2]> = if has_headings {
            rows.first().iter().flat_map(|row| row.iter().map(headings)).collect()
        } else {
            Vec::new()
        };
        let fits = |text: String| {
            ui.painter().layout_no_wrap(text, font.clone(), ink).size().x <= width - 2.0 * GAP_POINTS
        };
        // Below each other where they don't fit beside each other.
        let is_stacked = !top_row.iter().all(|parts| fits(on_one_line(parts)));
        let has_two = is_stacked && top_row.iter().any(|[_, second]| !second.is_empty());
        let heading_points = match (has_headings, has_two) {
            (false, _) => 0.0,
            (true, false) => HEADING_POINTS,
            (true, true) => 2.0 * HEADING_POINTS - 4.0,
        };
        let top = area.top() + heading_points;
        rows.truncate(most(area.bottom() - top));
        let shown = rows.iter().map(Vec::len).sum::<usize>();
        let size = vec2(
            width,
            (area.bottom() - top - GAP_POINTS * (rows.len().max(1) - 1) as f32) / rows.len().max(1) as f32,
        );
        for (x, parts) in top_row.iter().enumerate() {
            let left = area.left() + x as f32 * (size.x + GAP_POINTS);
            let above = Rect::from_min_size(pos2(left, area.top()), vec2(size.x, heading_points));
            let lines = if is_stacked {
                parts.iter().filter(|p| !p.is_empty()).cloned().collect()
            } else {
                vec![on_one_line(parts)]
            };
            let step = heading_points / lines.len().max(1) as f32;
            for (n, line) in lines.iter().enumerate() {
                let galley = draw::elided(ui, line, &font, ink, width - 2.0 * GAP_POINTS);
                let middle = pos2(above.center().x, above.top() + (n as f32 + 0.5) * step);
                ui.painter().galley(
                    egui::Align2::CENTER_CENTER.anchor_size(middle, galley.size()).min,
                    galley,
                    ink,
                );
            }
        }
        for (y, row) in rows.iter().enumerate() {
            for (x, cell) in row.iter().enumerate() {
                let corner = pos2(
                    area.left() + x as f32 * (size.x + GAP_POINTS),
                    top + y as f32 * (size.y + GAP_POINTS),
                );
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
        let kept: Vec<Key> = rows.iter().flatten().map(|cell| cell.key(self.arrangement)).collect();
        if !is_cine {
            self.cells.retain(|key, _| kept.contains(key));
        }
    }
}
