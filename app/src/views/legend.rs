//! Legend of a 3D view: what its colours and marks mean, at the top left on plates.

use egui::{Painter, Rect, Stroke, StrokeKind, Ui, pos2, vec2};

use super::{draw, pane::Input};
use crate::{
    model::overlap::{Shown, mask_shown},
    theme::{self, LABEL_POINTS, Tokens},
};

/// What a row explains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// An sRGB colour.
    Color([u8; 3]),
    /// The hatching of the lens' cut.
    Hatched,
    /// Nothing: a note.
    None,
    /// Nothing: a warning.
    Warning,
}

/// A mark and its meaning.
pub type Row = (Mark, String);

/// Side of a swatch, points.
const SWATCH: f32 = 11.0;
/// Distance from a swatch's left edge to its text, points.
const INSET: f32 = 17.0;
/// Height of a row, points.
const ROW: f32 = 16.0;
/// Share of a view's width that a row may take, but at least [`LEAST_WIDTH`] points.
const WIDEST: f32 = 0.42;
const LEAST_WIDTH: f32 = 160.0;
/// Room left at the lower edge of a view for the scale bar and the cube.
const BELOW: f32 = 90.0;

/// Most overlaps that are named; the rest is counted.
const MAX_OVERLAPS: usize = 8;

/// Draws the rows that fit; where some don't, the last place says how many are left out.
pub fn show(ui: &Ui, rect: Rect, rows: &[Row]) {
    let painter = ui.painter().with_clip_rect(rect);
    let dark = ui.visuals().dark_mode;
    let font = theme::font(LABEL_POINTS);
    let width = (rect.width() * WIDEST).max(LEAST_WIDTH);
    let laid_out = |(mark, text): &Row| {
        let inset = if matches!(mark, Mark::Color(_) | Mark::Hatched) { INSET } else { 0.0 };
        let ink = if *mark == Mark::Warning { Tokens::of(dark).warning } else { Tokens::of(dark).text };
        // Notes and warnings whole, over several lines; names cut.
        let galley = match mark {
            Mark::None | Mark::Warning => painter.layout(text.clone(), font.clone(), ink, width),
            Mark::Color(_) | Mark::Hatched => draw::elided(ui, text, &font, ink, width - inset),
        };
        (*mark, inset, ink, galley)
    };
    let mut all: Vec<_> = rows.iter().map(laid_out).collect();
    let room = (rect.height() - BELOW).max(ROW);
    if all.iter().map(|(.., galley)| galley.size().y.max(ROW)).sum::<f32>() > room {
        // Rather names are left out than what is said of the picture.
        all.sort_by_key(|(mark, ..)| matches!(mark, Mark::Color(_) | Mark::Hatched));
    }
    let fits = rows_that_fit(all.iter().map(|(.., galley)| galley.size().y.max(ROW)), room);
    if fits < rows.len() {
        all.truncate(fits);
        all.push(laid_out(&(Mark::None, format!("and {} more", rows.len() - fits))));
    }
    let mut at = rect.left_top() + vec2(10.0, 8.0);
    for (mark, inset, ink, galley) in all {
        let height = galley.size().y;
        // Legible over a magnified tumour, too.
        draw::plate(&painter, Rect::from_min_size(at, galley.size() + vec2(inset, 0.0)), dark);
        swatch(&painter, Rect::from_min_size(at + vec2(0.0, 2.0), vec2(SWATCH, SWATCH)), mark, dark);
        painter.galley(at + vec2(inset, 0.0), galley, ink);
        at.y += height.max(ROW);
    }
}

/// How many rows of these heights fit into `room`, points: all, or so many that one more row says how many are left out.
fn rows_that_fit(heights: impl Iterator<Item = f32>, room: f32) -> usize {
    let (mut used, mut with_note, mut count) = (0.0, 0, 0);
    for height in heights {
        used += height;
        count += 1;
        if used + ROW <= room {
            with_note = count;
        }
    }
    if used <= room { count } else { with_note }
}

fn swatch(painter: &Painter, rect: Rect, mark: Mark, dark: bool) {
    let ink = Tokens::of(dark).text;
    let edge = Stroke::new(1.0, ink.gamma_multiply(0.6));
    match mark {
        Mark::Color(color) => {
            painter.rect(rect, 2.0, theme::color(color), edge, StrokeKind::Outside);
        }
        Mark::Hatched => {
            painter.rect_stroke(rect, 2.0, edge, StrokeKind::Outside);
            for step in 1..6 {
                // From the lower left, as in the picture.
                let along = rect.width() * step as f32 / 3.0;
                let [low, high] = [(along - rect.width()).max(0.0), along.min(rect.width())];
                let point = |x: f32| pos2(rect.left() + x, rect.top() + along - x);
                painter.line_segment([point(low), point(high)], Stroke::new(1.0, ink));
            }
        }
        Mark::None | Mark::Warning => {}
    }
}

/// The masks of which something is shown, and their overlaps, the largest first.
pub fn mask_rows(input: &Input<'_>) -> Vec<Row> {
    let (regions, masks) = (&input.time_point.regions, &input.doc.edit.masks);
    let ids = regions.mask_ids();
    let of_masks = ids.iter().enumerate();
    let of_masks = of_masks.filter(|(k, _)| mask_shown(regions, input.selection, *k) != Shown::None);
    let mut rows: Vec<Row> =
        of_masks.map(|(k, id)| (Mark::Color(input.colors.mask(k)), masks.name(id))).collect();
    let mut overlaps: Vec<_> = regions.list().iter().collect();
    overlaps.retain(|region| region.bits.count_ones() > 1 && input.selection.shows(region.bits));
    overlaps.sort_by_key(|region| std::cmp::Reverse(region.voxels));
    let rest = overlaps.split_off(overlaps.len().min(MAX_OVERLAPS));
    rows.extend(
        overlaps.iter().map(|r| (Mark::Color(input.colors.region(r.bits)), masks.region(ids, r.bits))),
    );
    if !rest.is_empty() {
        rows.push((Mark::None, format!("and {} smaller overlaps", rest.len())));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_do_not_fit_leave_room_for_the_note() {
        let fits = |heights: &[f32], room| rows_that_fit(heights.iter().copied(), room);
        assert_eq!(fits(&[16.0; 4], 64.0), 4);
        assert_eq!(fits(&[16.0; 5], 64.0), 3, "and the note");
        assert_eq!(fits(&[16.0, 32.0, 16.0], 64.0), 3, "a row over two lines");
        assert_eq!(fits(&[16.0, 32.0, 32.0], 64.0), 2);
        assert_eq!(fits(&[32.0, 32.0], 16.0), 0, "the note alone");
        assert_eq!(fits(&[], 16.0), 0);
    }
}
