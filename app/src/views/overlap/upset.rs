//! UpSet plot (Lex et al. 2014) for four or more masks. A column is a region, largest first: its bar shows its size,
//! its dots its masks. A row is a mask, with its whole size on the left.

use egui::{Align2, CornerRadius, Id, Pos2, Rect, ScrollArea, Sense, Shape, Stroke, StrokeKind};
use egui::{Ui, epaint::TextShape, pos2, vec2};
use glioscope_core::Region;

use super::{
    OverlapInput, Shown, Target,
    interact::{self, FocusArea, Interaction},
    paint::{Style, dim_text},
};
use crate::theme::{self, LABEL_POINTS};
use crate::{command::Commands, format, views::draw};

/// Smallest height of a mask's row with name and bar, points.
const ROW_PT: f32 = 19.0;
/// Smallest width of a region's column, points.
const COLUMN_PT: f32 = 21.0;
/// Space above the highest bar for its size in vertical text, points.
const NUMBER_PT: f32 = 52.0;
/// Space for the check boxes between bars and dots, points.
const CHECK_PT: f32 = 20.0;
/// Smallest height of the highest bar, points.
const BAR_PT: f32 = 34.0;
/// Space for the scroll bar below, points.
const SCROLL_PT: f32 = 9.0;

/// Smallest height that shows everything legibly, points.
pub fn min_height(masks: usize) -> f32 {
    NUMBER_PT + BAR_PT + CHECK_PT + SCROLL_PT + masks as f32 * ROW_PT
}

/// Positions and sizes of rows and columns, points.
struct PlotLayout {
    rect: Rect,
    /// Width of the masks' names and sizes on the left.
    masks_width: f32,
    /// y of the lower end of the bars.
    bars_bottom: f32,
    /// Height of the highest bar.
    max_bar_height: f32,
    /// y of the top of the first row.
    rows_top: f32,
    row_height: f32,
    column_width: f32,
}

impl PlotLayout {
    fn new(rect: Rect, masks: usize, regions: usize) -> Self {
        let masks_width = (rect.width() * 0.3).clamp(104.0, 190.0);
        let free = rect.height() - min_height(masks);
        let row_height = ROW_PT + (free * 0.4 / masks.max(1) as f32).clamp(0.0, 6.0);
        let rows_top = rect.bottom() - SCROLL_PT - row_height * masks as f32;
        let bars_bottom = rows_top - CHECK_PT;
        let column_width =
            ((rect.width() - masks_width - 8.0) / regions.max(1) as f32).clamp(COLUMN_PT, 38.0);
        let max_bar_height = (bars_bottom - rect.top() - NUMBER_PT).max(10.0);
        Self { rect, masks_width, bars_bottom, max_bar_height, rows_top, row_height, column_width }
    }

    fn row_rect(&self, mask: usize, left: f32, right: f32) -> Rect {
        let top = self.rows_top + mask as f32 * self.row_height;
        Rect::from_x_y_ranges(left..=right, top..=top + self.row_height)
    }
}

/// Draws the plot into `rect`; the columns scroll horizontally when they don't all fit. Returns the target under the
/// cursor.
pub fn show(
    ui: &mut Ui,
    id: Id,
    rect: Rect,
    input: &OverlapInput<'_>,
    marked: Option<Target>,
    out: &mut Commands,
) -> Option<Target> {
    let masks = input.regions.mask_ids().len();
    let mut regions: Vec<&Region> = input.regions.list().iter().collect();
    regions.sort_by_key(|r| std::cmp::Reverse(r.voxels));
    let layout = PlotLayout::new(rect, masks, regions.len());
    let style = Style::of(ui);
    for mask in (0..masks).step_by(2) {
        let stripe = layout.row_rect(mask, rect.left(), rect.right());
        ui.painter().rect_filled(stripe, 2.0, ui.visuals().faint_bg_color);
    }
    summary(ui, &layout, input);
    let in_masks = mask_rows(ui, id.with("masks"), &layout, input, &style, marked, out);
    let right = Rect::from_min_max(pos2(rect.left() + layout.masks_width + 8.0, rect.top()), rect.max);
    let mut child = ui.new_child(egui::UiBuilder::new().max_rect(right));
    let scrolled = ScrollArea::horizontal()
        .id_salt(id.with("regions"))
        .auto_shrink([false, false])
        .show(&mut child, |ui| columns(ui, id.with("columns"), &layout, &regions, input, &style, marked, out))
        .inner;
    scrolled.hovered.or(in_masks.hovered)
}

/// Union, number of regions and how to read the plot, in the free corner above the mask names.
fn summary(ui: &Ui, layout: &PlotLayout, input: &OverlapInput<'_>) {
    let regions = input.regions.list().len();
    let lines = [
        format!("Union {}", format::ml(input.regions.union_ml())),
        format!("{regions} regions of {} masks", input.regions.mask_ids().len()),
        "Bars: size of a region".to_owned(),
        "Dots: its masks".to_owned(),
    ];
    let font = theme::font(LABEL_POINTS);
    for (i, line) in lines.into_iter().enumerate() {
        let at = layout.rect.left_top() + vec2(0.0, 18.0 + i as f32 * 14.0);
        let color = if i == 0 { ui.visuals().text_color() } else { dim_text(ui) };
        if at.y + 14.0 < layout.rows_top {
            ui.painter().text(at, Align2::LEFT_TOP, line, font.clone(), color);
        }
    }
}

/// Names and whole sizes of the masks. A click toggles the whole mask.
fn mask_rows(
    ui: &Ui,
    id: Id,
    layout: &PlotLayout,
    input: &OverlapInput<'_>,
    style: &Style,
    marked: Option<Target>,
    out: &mut Commands,
) -> Interaction {
    let count = input.regions.mask_ids().len();
    let place = |k: usize| layout.row_rect(k, layout.rect.left(), layout.rect.left() + layout.masks_width);
    let focus_areas: Vec<FocusArea> =
        (0..count).map(|k| FocusArea { target: Target::Mask(k), rect: place(k) }).collect();
    let all_rows = focus_areas.iter().fold(Rect::NOTHING, |r, s| r.union(s.rect));
    let hit = |p: Pos2| focus_areas.iter().find(|s| s.rect.contains(p)).map(|s| s.target);
    let interaction = interact::clickable_pieces(ui, id, all_rows, &focus_areas, hit, input, out);
    let max_voxels = (0..count).map(|k| input.regions.mask_voxels(k)).max().unwrap_or(0).max(1) as f32;
    let font = theme::font(LABEL_POINTS);
    for area in &focus_areas {
        let Target::Mask(k) = area.target else { continue };
        let rect = area.rect.shrink2(vec2(4.0, 1.5));
        let shown = input.shown(area.target);
        let color = if shown == Shown::None { dim_text(ui) } else { ui.visuals().text_color() };
        let painter = ui.painter();
        let size = painter.text(
            rect.right_top(),
            Align2::RIGHT_TOP,
            format::ml(input.ml(area.target)),
            font.clone(),
            color,
        );
        let max_width = size.left() - rect.left() - 4.0;
        let name = draw::elided(ui, &input.name(area.target), &font, color, max_width);
        painter.galley(rect.min, name, color);
        let length = (rect.width() - 4.0) * input.voxels(area.target) as f32 / max_voxels;
        let bar_height = (layout.row_height - 16.5).clamp(2.5, 6.0);
        let corner = pos2(rect.left() + 2.0, rect.bottom() - bar_height - 0.5);
        let bar = Rect::from_min_size(corner, vec2(length, bar_height));
        painter.rect_filled(bar.expand(1.0), CornerRadius::ZERO, style.casing);
        painter.rect_filled(bar, CornerRadius::ZERO, style.fill(input.colors.mask(k), shown));
        if [interaction.hovered, interaction.focused, marked].contains(&Some(area.target)) {
            let line = Stroke::new(1.5, style.marked.color);
            painter.rect_stroke(area.rect, 3.0, line, StrokeKind::Inside);
        }
    }
    interaction
}

fn columns(
    ui: &mut Ui,
    id: Id,
    layout: &PlotLayout,
    regions: &[&Region],
    input: &OverlapInput<'_>,
    style: &Style,
    marked: Option<Target>,
    out: &mut Commands,
) -> Interaction {
    let size = vec2(layout.column_width * regions.len() as f32, layout.rect.height() - SCROLL_PT);
    let (area, _) = ui.allocate_exact_size(size, Sense::hover());
    let column = |i: usize| {
        let left = area.left() + i as f32 * layout.column_width;
        Rect::from_x_y_ranges(left..=left + layout.column_width, area.top()..=area.bottom())
    };
    let focus_areas: Vec<FocusArea> = regions
        .iter()
        .enumerate()
        .map(|(i, r)| {
            let middle = pos2(column(i).center().x, (layout.bars_bottom + layout.rows_top) / 2.0);
            let rect = Rect::from_center_size(middle, vec2(CHECK_PT - 4.0, CHECK_PT - 4.0));
            FocusArea { target: Target::Region(r.bits), rect }
        })
        .collect();
    let hit = |p: Pos2| {
        let i = ((p.x - area.left()) / layout.column_width).floor();
        (i >= 0.0 && area.contains(p))
            .then(|| regions.get(i as usize))
            .flatten()
            .map(|r| Target::Region(r.bits))
    };
    let interaction = interact::clickable_pieces(ui, id, area, &focus_areas, hit, input, out);
    let max_voxels = regions.first().map_or(1, |r| r.voxels).max(1) as f32;
    for (i, region) in regions.iter().enumerate() {
        let place = column(i);
        if !ui.is_rect_visible(place) {
            continue;
        }
        let target = Target::Region(region.bits);
        let is_marked = [interaction.hovered, interaction.focused, marked].contains(&Some(target));
        if is_marked {
            ui.painter().rect_filled(place, 3.0, style.marked.color.gamma_multiply(0.16));
        }
        let height = layout.max_bar_height * region.voxels as f32 / max_voxels;
        bar(ui, layout, place, height, region, input, style, is_marked);
        check(ui, focus_areas[i].rect, input.shown(target), is_marked, style);
        dots(ui, layout, place, region.bits, input, style);
    }
    interaction
}

/// A region's bar, and its size in vertical text above it.
fn bar(
    ui: &Ui,
    layout: &PlotLayout,
    place: Rect,
    height: f32,
    region: &Region,
    input: &OverlapInput<'_>,
    style: &Style,
    is_marked: bool,
) {
    let shown = input.shown(Target::Region(region.bits));
    let middle = place.center().x;
    let half = (layout.column_width * 0.5 - 4.0).min(9.0);
    let rect = Rect::from_x_y_ranges(
        middle - half..=middle + half,
        layout.bars_bottom - height..=layout.bars_bottom,
    );
    let painter = ui.painter();
    painter.rect_filled(rect.expand(2.6), CornerRadius::ZERO, style.casing);
    painter.rect_filled(rect, CornerRadius::ZERO, style.fill(input.colors.region(region.bits), shown));
    let border = if is_marked { Stroke::new(2.0, style.marked.color) } else { style.border(shown) };
    painter.rect_stroke(rect, CornerRadius::ZERO, border, StrokeKind::Outside);
    let color = if shown == Shown::None { dim_text(ui) } else { ui.visuals().text_color() };
    let galley = painter.layout_no_wrap(format::ml(region.volume_ml), theme::font(LABEL_POINTS), color);
    let at = pos2(middle - galley.size().y / 2.0, rect.top() - 5.0);
    painter.add(TextShape::new(at, galley, color).with_angle(-std::f32::consts::FRAC_PI_2));
}

/// A check box in the theme's style.
fn check(ui: &Ui, rect: Rect, shown: Shown, is_marked: bool, style: &Style) {
    let rect = Rect::from_center_size(rect.center(), vec2(13.0, 13.0));
    let visuals = &ui.visuals().widgets.inactive;
    ui.painter().rect_filled(rect, 3.0, visuals.bg_fill);
    let line = Stroke::new(1.0, if is_marked { style.marked.color } else { dim_text(ui) });
    ui.painter().rect_stroke(rect, 3.0, line, StrokeKind::Inside);
    if shown == Shown::All {
        let at = |x: f32, y: f32| rect.lerp_inside(vec2(x, y));
        let tick = vec![at(0.22, 0.52), at(0.43, 0.75), at(0.8, 0.27)];
        ui.painter().add(Shape::line(tick, Stroke::new(1.8, ui.visuals().strong_text_color())));
    }
}

/// The masks of a region as connected dots in their colours; faint dots for the other masks.
fn dots(ui: &Ui, layout: &PlotLayout, place: Rect, bits: u32, input: &OverlapInput<'_>, style: &Style) {
    let shown = input.shown(Target::Region(bits));
    let middle = |k: usize| layout.row_rect(k, place.left(), place.right()).center();
    let active = |k: &usize| bits >> k & 1 == 1;
    let masks = 0..input.regions.mask_ids().len();
    let radius = (layout.row_height * 0.3).min(6.5);
    let ink = if shown == Shown::None { dim_text(ui) } else { ui.visuals().strong_text_color() };
    if let (Some(first), Some(last)) = (masks.clone().find(active), masks.clone().rev().find(active)) {
        ui.painter().line_segment([middle(first), middle(last)], Stroke::new(2.0, ink));
    }
    for k in masks {
        if active(&k) {
            ui.painter().circle_filled(middle(k), radius + 1.2, ink);
            ui.painter().circle_filled(middle(k), radius, style.fill(input.colors.mask(k), shown));
        } else {
            ui.painter().circle_filled(middle(k), radius * 0.5, dim_text(ui).gamma_multiply(0.35));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_bars_fit_the_height() {
        for (masks, height) in [(4, 300.0), (9, 330.0), (9, 700.0), (32, min_height(32))] {
            let rect = Rect::from_min_size(pos2(5.0, 7.0), vec2(450.0, height));
            let l = PlotLayout::new(rect, masks, 31);
            assert!(
                l.row_height >= ROW_PT && l.column_width >= COLUMN_PT && l.max_bar_height >= BAR_PT - 1e-3
            );
            assert!(l.row_rect(masks - 1, 0.0, 1.0).bottom() <= rect.bottom() - SCROLL_PT + 1e-3);
            assert!(l.bars_bottom - l.max_bar_height - NUMBER_PT >= rect.top() - 1e-3);
        }
    }
}
