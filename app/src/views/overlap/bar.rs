//! The bar of whole masks, side by side, under the diagram (thesis 7.7): lengths are proportional to the masks' sizes,
//! regardless of overlaps.

use std::sync::Arc;

use egui::{CornerRadius, Galley, Id, Pos2, Rect, StrokeKind, Ui, pos2, vec2};

use super::{
    OverlapInput, Shown, Target,
    interact::{self, FocusArea, Interaction},
    paint::{Style, dim_text},
};
use crate::theme::{self, LABEL_POINTS};
use crate::{command::Commands, format};

/// Height of the bar with its labels, points.
pub const HEIGHT_PT: f32 = 50.0;
/// Thickness of the bar, points.
const BAR_PT: f32 = 16.0;
/// Gap between pieces, points.
const GAP_PT: f32 = 3.4;

/// Draws the bar into `rect`, which should be [`HEIGHT_PT`] high. A click toggles the whole mask. Empty masks have no
/// piece, but a label with `0 ml`.
pub fn show(
    ui: &Ui,
    id: Id,
    rect: Rect,
    input: &OverlapInput<'_>,
    marked: Option<Target>,
    out: &mut Commands,
) -> Interaction {
    let masks: Vec<Target> = (0..input.regions.mask_ids().len()).map(Target::Mask).collect();
    let rects = pieces(&masks.iter().map(|&m| input.voxels(m)).collect::<Vec<_>>(), rect);
    let style = Style::of(ui);
    let labels = labels(ui, rect, input, &masks, &rects);
    let focus_areas: Vec<FocusArea> = masks
        .iter()
        .zip(&rects)
        .zip(&labels)
        .map(|((&target, piece), (_, label))| FocusArea { target, rect: piece.unwrap_or(*label) })
        .collect();
    let hit = |p: Pos2| {
        let on_bar = rects.iter().position(|r| r.is_some_and(|r| r.expand(GAP_PT / 2.0).contains(p)));
        let on_label = || labels.iter().position(|(_, r)| r.contains(p));
        on_bar.or_else(on_label).map(|k| masks[k])
    };
    let interaction = interact::clickable_pieces(ui, id, rect, &focus_areas, hit, input, out);
    let painter = ui.painter();
    for piece in rects.iter().flatten() {
        painter.rect_filled(piece.expand(GAP_PT / 2.0 + 0.8), CornerRadius::ZERO, style.casing);
    }
    for (&mask, piece) in masks.iter().zip(&rects) {
        let (Some(piece), Target::Mask(k)) = (piece, mask) else { continue };
        let shown = input.drawn_visibility(mask);
        painter.rect_filled(*piece, CornerRadius::ZERO, style.fill(input.colors.mask(k), shown));
        let is_marked = [interaction.hovered, interaction.focused, marked].contains(&Some(mask));
        let border = if is_marked { style.marked } else { style.border(shown) };
        painter.rect_stroke(*piece, CornerRadius::ZERO, border, StrokeKind::Outside);
    }
    for (&mask, (galley, label)) in masks.iter().zip(&labels) {
        let hidden = input.drawn_visibility(mask) == Shown::None;
        let color = if hidden { dim_text(ui) } else { ui.visuals().text_color() };
        if !galley.is_empty() {
            painter.galley_with_override_text_color(label.min, Arc::clone(galley), color);
        }
    }
    interaction
}

/// Rectangle of each mask's piece; `None` for empty masks. Gaps are left out of the proportional length.
fn pieces(voxels: &[u64], rect: Rect) -> Vec<Option<Rect>> {
    let filled = voxels.iter().filter(|&&v| v > 0).count();
    let total = voxels.iter().sum::<u64>() as f64;
    let length = f64::from(rect.width() - GAP_PT * filled as f32).max(1.0);
    let mut x = rect.left() + GAP_PT / 2.0;
    voxels
        .iter()
        .map(|&v| {
            let width = (v > 0).then(|| (length * v as f64 / total) as f32)?;
            let piece = Rect::from_min_size(pos2(x, rect.top() + GAP_PT), vec2(width, BAR_PT));
            x += width + GAP_PT;
            Some(piece)
        })
        .collect()
}

/// Each mask's name and size under its piece, shifted where pieces are short. Labels that don't fit even so are left
/// out (the tooltip has them).
fn labels(
    ui: &Ui,
    rect: Rect,
    input: &OverlapInput<'_>,
    masks: &[Target],
    pieces: &[Option<Rect>],
) -> Vec<(Arc<Galley>, Rect)> {
    let font = theme::font(LABEL_POINTS);
    let galleys: Vec<Arc<Galley>> = masks
        .iter()
        .map(|&m| {
            let text = format!("{}\n{}", input.name(m), format::ml(input.ml(m)));
            ui.painter().layout_no_wrap(text, font.clone(), ui.visuals().text_color())
        })
        .collect();
    let top = rect.top() + BAR_PT + 2.0 * GAP_PT;
    let spacing_pt = 8.0;
    let mut out: Vec<(Arc<Galley>, Rect)> = Vec::new();
    let mut min_left = rect.left();
    for (galley, piece) in galleys.into_iter().zip(pieces) {
        let x = piece.map_or(min_left, |p| p.left() - 1.0).max(min_left);
        let place = Rect::from_min_size(pos2(x, top), galley.size());
        min_left = place.right() + spacing_pt;
        out.push((galley, place));
    }
    // Shift labels beyond the right edge back to the left.
    let mut max_right = rect.right();
    for (_, place) in out.iter_mut().rev() {
        let overhang = (place.right() - max_right).max(0.0);
        *place = place.translate(vec2(-overhang, 0.0));
        max_right = place.left() - spacing_pt;
    }
    let empty = ui.painter().layout_no_wrap(String::new(), font, ui.visuals().text_color());
    let mut min_left = rect.left() - 1.0;
    for (galley, place) in &mut out {
        if place.left() < min_left - 0.01 {
            *galley = Arc::clone(&empty);
            *place = Rect::from_min_size(place.min, vec2(1.0, 1.0));
        } else {
            min_left = place.right();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_proportional_to_voxels() {
        let rect = Rect::from_min_size(pos2(10.0, 10.0), vec2(300.0, HEIGHT_PT));
        let p = pieces(&[300, 0, 100], rect);
        assert_eq!(p[1], None);
        let (a, c) = (p[0].unwrap(), p[2].unwrap());
        assert!((a.width() / c.width() - 3.0).abs() < 1e-4);
        assert!((a.width() + c.width() - (300.0 - 2.0 * GAP_PT)).abs() < 1e-3);
        assert!(rect.contains_rect(a) && rect.contains_rect(c) && a.right() + GAP_PT <= c.left() + 1e-3);
        assert_eq!(pieces(&[0, 0], rect), [None, None]);
        assert_eq!(pieces(&[], rect), []);
    }
}
