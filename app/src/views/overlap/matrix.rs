//! The matrix of agreement: one metric of every two masks, as numbers on a ramp from dark (0) to light (1).

use egui::{Align2, Color32, CornerRadius, Id, Rect, ScrollArea, Sense, Ui, Vec2, pos2, vec2};
use glioscope_core::measure::{PAIR_METRICS, Pair, PairMetric};
use glioscope_render::agreement_color;

use super::{OverlapInput, Target};
use crate::{
    theme::{self, LABEL_POINTS, Tokens},
    views::draw,
};

/// Width of the masks' names, points.
const NAMES_PT: f32 = 70.0;
/// A cell, points.
const CELL_PT: Vec2 = vec2(38.0, 18.0);
/// Height of the line above the cells, points.
const HEAD_PT: f32 = 24.0;
/// Steps of the ramp.
const STEPS: usize = 101;

/// What the matrix shows; kept while the window is open.
#[derive(Clone, Copy, Default)]
struct Choice {
    /// Index into [`PAIR_METRICS`].
    metric: usize,
    /// Whether the masks that agree most with the others come first.
    sorted: bool,
}

/// The values of one metric between masks by their number; `None` where it is undefined, and of a mask with itself.
fn values(ids: &[String], pairs: &[Pair], metric: &PairMetric) -> Vec<Vec<Option<f64>>> {
    let mut values = vec![vec![None; ids.len()]; ids.len()];
    let number = |id: &str| ids.iter().position(|other| other == id);
    for pair in pairs {
        if let (Some(a), Some(b)) = (number(&pair.a), number(&pair.b)) {
            let value = pair.value(metric.key);
            values[a][b] = value;
            values[b][a] = value;
        }
    }
    values
}

/// Numbers of the masks as listed, or by their mean value with the others, highest first; masks without a value last.
fn order(values: &[Vec<Option<f64>>], sorted: bool) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    if sorted {
        let mean = |k: &usize| {
            let known: Vec<f64> = values[*k].iter().flatten().copied().collect();
            if known.is_empty() { f64::NEG_INFINITY } else { known.iter().sum::<f64>() / known.len() as f64 }
        };
        order.sort_by(|a, b| mean(b).total_cmp(&mean(a)));
    }
    order
}

/// The size that the matrix needs, points; `None` for fewer than two masks or before the agreement is known.
pub fn size(input: &OverlapInput<'_>, pairs: &[Pair]) -> Option<Vec2> {
    let masks = input.regions.mask_ids().len();
    let cells = CELL_PT * masks as f32;
    (masks >= 2 && !pairs.is_empty()).then(|| vec2(NAMES_PT + cells.x, HEAD_PT + cells.y))
}

/// Ground and ink of a cell.
fn colors(value: f64) -> (Color32, Color32) {
    let level = 1 + (value.clamp(0.0, 1.0) * (STEPS - 1) as f64).round() as u32;
    let ground = agreement_color(level, STEPS);
    let ground = theme::color(ground);
    (ground, theme::ink_on(ground))
}

/// Draws the matrix and the choice of its metric and order.
pub fn show(ui: &mut Ui, input: &OverlapInput<'_>, pairs: &[Pair]) {
    let choice_id = Id::unique("agreement matrix");
    let mut choice: Choice = ui.data(|d| d.get_temp(choice_id)).unwrap_or_default();
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        if let Some(metric) = PAIR_METRICS.get(choice.metric).filter(|_| input.is_picture) {
            ui.strong(metric.name);
            return;
        }
        for (index, metric) in PAIR_METRICS.iter().enumerate() {
            let response = ui.selectable_label(choice.metric == index, metric.name);
            if response.on_hover_text(metric.definition).clicked() {
                choice.metric = index;
            }
        }
        if input.regions.mask_ids().len() > 2 {
            let response = ui.selectable_label(choice.sorted, "Sorted");
            if response.on_hover_text("Masks that agree most with the others first").clicked() {
                choice.sorted = !choice.sorted;
            }
        }
    });
    ui.data_mut(|d| d.insert_temp(choice_id, choice));
    let Some(metric) = PAIR_METRICS.get(choice.metric) else { return };
    let values = values(input.regions.mask_ids(), pairs, metric);
    let order = order(&values, choice.sorted);
    ScrollArea::horizontal().id_salt("matrix").auto_shrink([false, true]).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        for &mask in &order {
            row(ui, input, metric, (&values, &order), mask);
        }
    });
}

fn row(
    ui: &mut Ui,
    input: &OverlapInput<'_>,
    metric: &PairMetric,
    (values, order): (&[Vec<Option<f64>>], &[usize]),
    mask: usize,
) {
    let width = NAMES_PT + CELL_PT.x * order.len() as f32;
    let (rect, response) = ui.allocate_exact_size(vec2(width, CELL_PT.y), Sense::hover());
    let tokens = Tokens::in_ui(ui);
    let font = theme::font(LABEL_POINTS);
    let name = input.name(Target::Mask(mask));
    let label = draw::elided(ui, &name, &font, tokens.text, NAMES_PT - 6.0);
    let at = pos2(rect.left(), rect.center().y - label.size().y / 2.0);
    ui.painter().galley(at, label, tokens.text);
    let mut said = vec![];
    let mut pointed = None;
    for (column, &other) in order.iter().enumerate() {
        let corner = pos2(rect.left() + NAMES_PT + CELL_PT.x * column as f32, rect.top());
        let cell = Rect::from_min_size(corner, CELL_PT).shrink(1.0);
        if other == mask {
            // The mask's own colour names its column.
            ui.painter().rect_filled(cell, CornerRadius::same(2), theme::color(input.colors.mask(mask)));
            continue;
        }
        let text = values[mask][other].map_or_else(|| "–".to_owned(), |value| metric.print(Some(value), 0));
        let (ground, ink) = values[mask][other].map_or((tokens.panel, tokens.second), colors);
        ui.painter().rect_filled(cell, CornerRadius::same(2), ground);
        ui.painter().text(cell.center(), Align2::CENTER_CENTER, &text, font.clone(), ink);
        let line = format!("{name} – {}: {} {text}", input.name(Target::Mask(other)), metric.name);
        if response.hover_pos().is_some_and(|pos| cell.contains(pos)) {
            pointed = Some(line.clone());
        }
        said.push(line);
    }
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Label, true, said.join("; ")));
    if let Some(line) = pointed {
        response.on_hover_text_at_pointer(line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(values: &[(&str, &str, Option<f64>)]) -> Vec<Pair> {
        let pair = |&(a, b, dice): &(&str, &str, Option<f64>)| Pair {
            a: a.into(),
            b: b.into(),
            values: vec![dice, dice.map(|d| d / (2.0 - d))],
        };
        values.iter().map(pair).collect()
    }

    #[test]
    fn masks_are_sorted_by_their_mean_agreement_and_the_undefined_come_last() {
        let ids = ["a", "b", "c", "d"].map(String::from);
        let all = pairs(&[
            ("a", "b", Some(0.2)),
            ("a", "c", Some(0.3)),
            ("b", "c", Some(0.9)),
            ("a", "d", None),
            ("b", "d", None),
            ("c", "d", None),
        ]);
        let found = values(&ids, &all, &PAIR_METRICS[0]);
        assert_eq!((found[0][2], found[2][0], found[1][1], found[3][0]), (Some(0.3), Some(0.3), None, None));
        // Means: a 0.25, b 0.55, c 0.6.
        assert_eq!(order(&found, true), [2, 1, 0, 3]);
        assert_eq!(order(&found, false), [0, 1, 2, 3]);
        let jaccard = values(&ids, &all, &PAIR_METRICS[1]);
        assert!((jaccard[1][2].unwrap() - 0.9 / 1.1).abs() < 1e-12);
    }

    #[test]
    fn numbers_are_legible_on_every_colour_of_the_ramp() {
        for step in 0..=100 {
            let (ground, ink) = colors(f64::from(step) / 100.0);
            let found = theme::contrast(ground, ink);
            assert!(found >= 4.5, "{step}: {found:.2}");
        }
    }
}
