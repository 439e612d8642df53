//! The distributions of columns beside each other, over all cases and over those shown; what is brushed in them filters the grid.

use std::collections::BTreeMap;

use egui::{Color32, DragValue, Rect, ScrollArea, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};
use glioscope_cohort::Collected;

use super::picker;
use crate::{
    command::{AppCommand, Commands},
    format,
    model::cohort::{Axis, CohortSetting},
    theme::Tokens,
    views::draw,
    world::cohort::{CaseValues, Columns, DrawnRange},
};

/// Width of an axis, points.
const WIDTH: f32 = 190.0;
/// Height of a histogram, points.
const HEIGHT: f32 = 54.0;
/// Height of a list of words, points.
const WORDS_HEIGHT: f32 = 78.0;
/// Bins of a histogram.
const BINS: usize = 38;

/// What is done with an axis.
enum Done {
    Changed(Axis),
    Removed,
}

/// Draws the strip and pushes a changed setting.
pub fn show(
    ui: &mut Ui,
    setting: &CohortSetting,
    (collected, shown): (&Collected, &[usize]),
    columns: &mut Columns,
    out: &mut Commands,
) {
    let mut new = setting.clone();
    ui.add_space(4.0);
    ScrollArea::horizontal().id_salt("cohort strip").auto_shrink([false, true]).show(ui, |ui| {
        ui.horizontal_top(|ui| {
            for (n, axis) in setting.axes.iter().enumerate() {
                let values = columns.get(collected, &axis.quantity);
                let done = ui.push_id(n, |ui| one(ui, axis, &values, (collected, shown), columns)).inner;
                match done {
                    Some(Done::Changed(axis)) => new.axes[n] = axis,
                    Some(Done::Removed) => drop(new.axes.remove(n)),
                    None => {}
                }
            }
            ui.vertical(|ui| {
                let of = (collected, columns.offered());
                if let Some(Some(quantity)) = picker::show(ui, "Add", None, Some("a column"), of) {
                    new.axes.push(Axis::new(quantity));
                }
                let filters = setting.axes.iter().any(Axis::filters);
                if ui.add_enabled(filters, egui::Button::new("Clear all filters")).clicked() {
                    new.axes.iter_mut().for_each(|axis| *axis = Axis::new(axis.quantity.clone()));
                }
            });
        });
    });
    ui.add_space(2.0);
    if new != *setting {
        out.push(AppCommand::SetCohort(Box::new(new)));
    }
}

fn one(
    ui: &mut Ui,
    axis: &Axis,
    values: &CaseValues,
    (collected, shown): (&Collected, &[usize]),
    columns: &Columns,
) -> Option<Done> {
    let mut done = None;
    let title = picker::title(&axis.quantity);
    ui.allocate_ui(vec2(WIDTH, HEIGHT + 50.0), |ui| {
        ui.vertical(|ui| {
            ui.set_width(WIDTH);
            ui.horizontal(|ui| {
                let remove = ui.small_button("×").on_hover_text("Take this column away");
                draw::name_widget(ui, &remove, &format!("Take away {title}"));
                if remove.clicked() {
                    done = Some(Done::Removed);
                }
                if axis.filters() {
                    let clear = ui.small_button("Clear");
                    draw::name_widget(ui, &clear, &format!("Clear the filter of {title}"));
                    if clear.clicked() {
                        done = Some(Done::Changed(Axis::new(axis.quantity.clone())));
                    }
                }
                let of = (collected, columns.offered());
                if let Some(Some(quantity)) = picker::title_button(ui, &axis.quantity, of) {
                    done = Some(Done::Changed(Axis::new(quantity)));
                }
            });
            let unit = columns.offer(&axis.quantity).map_or("", |offer| offer.unit);
            let changed = match values {
                CaseValues::Numbers(all) => {
                    numbers(ui, axis, (all, columns.drawn(&axis.quantity)), shown, (&title, unit))
                }
                CaseValues::Words { of_case, words } => self::words(ui, axis, of_case, words, shown),
            };
            done = done.take().or(changed.map(Done::Changed));
        });
    });
    ui.add_space(6.0);
    done
}

/// The bin of a number; `None` of no number. What lies outside of the range is in the bins at its ends.
fn bin(number: f64, [low, high]: [f64; 2]) -> Option<usize> {
    if number.is_nan() {
        return None;
    }
    let share = if high > low {
        (number - low) / (high - low)
    } else if number < low {
        -1.0
    } else {
        0.5
    };
    Some(((share * BINS as f64).max(0.0) as usize).min(BINS - 1))
}

fn histogram(numbers: impl Iterator<Item = f64>, range: [f64; 2]) -> [usize; BINS] {
    let mut counts = [0; BINS];
    numbers.filter_map(|number| bin(number, range)).for_each(|bin| counts[bin] += 1);
    counts
}

/// The range that is brushed between two places of the axis, 0 to 1: at its ends it takes what lies beyond, too.
fn brushed([from, to]: [f64; 2], [low, high]: [f64; 2]) -> [f64; 2] {
    let (from, to) = (from.min(to), from.max(to));
    let at = |share: f64| low + share * (high - low);
    [if from <= 0.0 { f64::NEG_INFINITY } else { at(from) }, if to >= 1.0 { f64::INFINITY } else { at(to) }]
}

fn numbers(
    ui: &mut Ui,
    axis: &Axis,
    (all, (range, beyond)): (&[f64], DrawnRange),
    shown: &[usize],
    (title, unit): (&str, &str),
) -> Option<Axis> {
    let tokens = Tokens::in_ui(ui);
    let (rect, response) = ui.allocate_exact_size(vec2(WIDTH, HEIGHT), Sense::click_and_drag());
    let of_all = histogram(all.iter().copied(), range);
    let of_shown = histogram(shown.iter().filter_map(|case| all.get(*case).copied()), range);
    let known = all.iter().filter(|number| !number.is_nan()).count();
    response.widget_info(|| {
        WidgetInfo::labeled(egui::Role::Image, true, format!("Distribution of {title} over {known} cases"))
    });
    let painter = ui.painter();
    painter.rect_filled(rect, 2.0, tokens.viewport);
    let share_of = |number: f64| {
        let share = if range[1] > range[0] { (number - range[0]) / (range[1] - range[0]) } else { 0.5 };
        share.clamp(0.0, 1.0)
    };
    let x = |share: f64| rect.left() + rect.width() * share as f32;
    if let Some([low, high]) = axis.range {
        let brush = Rect::from_x_y_ranges(x(share_of(low))..=x(share_of(high)), rect.y_range());
        painter.rect(brush, 0.0, tokens.chosen, Stroke::new(1.5, tokens.interaction), StrokeKind::Inside);
    }
    let most = of_all.iter().max().copied().unwrap_or_default().max(1) as f32;
    let step = rect.width() / BINS as f32;
    for (n, (all, shown)) in of_all.iter().zip(&of_shown).enumerate() {
        let bar = |count: usize, color: Color32| {
            if count > 0 {
                // A single case is seen, too.
                let height = ((rect.height() - 3.0) * count as f32 / most).max(1.5);
                let left = rect.left() + n as f32 * step;
                let place = Rect::from_min_max(
                    pos2(left + 0.5, rect.bottom() - height),
                    pos2(left + step - 0.5, rect.bottom()),
                );
                painter.rect_filled(place, 0.0, color);
            }
        };
        bar(*all, tokens.second.gamma_multiply(0.4));
        bar(*shown, tokens.text);
    }
    painter.rect_stroke(rect, 2.0, Stroke::new(1.0, tokens.line), StrokeKind::Inside);
    let mut new = axis.clone();
    let share = |x: f32| f64::from((x - rect.left()) / rect.width());
    let origin = ui.input(|input| input.pointer.press_origin());
    if response.dragged()
        && let (Some(origin), Some(now)) = (origin, response.interact_pointer_pos())
    {
        // A press at the very edge is meant to begin there.
        let snapped = |x: f32| match share(x) {
            s if s < 0.02 => 0.0,
            s if s > 0.98 => 1.0,
            s => s,
        };
        new.range = Some(brushed([snapped(origin.x), snapped(now.x)], range));
    } else if response.clicked() {
        new.range = None;
    }
    let undefined = all.len() - known;
    response.on_hover_ui(|ui| {
        ui.strong(title);
        ui.label(format!(
            "{} cases have a value, {} have none.",
            format::count(known as u64),
            format::count(undefined as u64)
        ));
        if beyond.contains(&true) {
            ui.label("What lies beyond the axis is in its outermost bars.");
        }
        ui.weak("Drag: only cases in this range. Click: all.");
    });
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        let [mut low, mut high] = new.range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let speed = ((range[1] - range[0]) / 200.0).max(1e-6);
        for (value, name, free) in [(&mut low, "Least", range[0]), (&mut high, "Greatest", range[1])] {
            // The ends of the axis stand for no limit.
            let mut number = if value.is_finite() { *value } else { free };
            let field = DragValue::new(&mut number).speed(speed).max_decimals(4);
            let response = ui.add(field);
            draw::name_widget(ui, &response, &format!("{name} {title}"));
            if response.changed() {
                *value = number;
            }
            if name == "Least" {
                ui.weak("to");
            }
        }
        ui.weak(unit);
        if low.is_finite() || high.is_finite() {
            new.range = Some([low, high]);
        }
    });
    (new != *axis).then_some(new)
}

fn words(
    ui: &mut Ui,
    axis: &Axis,
    of_case: &[Option<usize>],
    words: &[String],
    shown: &[usize],
) -> Option<Axis> {
    let mut counts: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
    of_case.iter().flatten().for_each(|word| counts.entry(*word).or_default()[1] += 1);
    let of_shown = shown.iter().filter_map(|case| of_case.get(*case).copied().flatten());
    of_shown.for_each(|word| counts.entry(word).or_default()[0] += 1);
    let mut new = axis.clone();
    ScrollArea::vertical().id_salt("words").max_height(WORDS_HEIGHT).show(ui, |ui| {
        ui.set_width(WIDTH - 8.0);
        for (word, [shown, all]) in counts {
            let Some(word) = words.get(word) else { continue };
            let is_chosen = axis.words.contains(word);
            let text = format!("{} ({shown} of {all})", word.replace('_', " "));
            if ui.add(egui::Button::selectable(is_chosen, text).truncate()).clicked() {
                if is_chosen {
                    new.words.remove(word);
                } else {
                    new.words.insert(word.clone());
                }
            }
        }
    });
    (new != *axis).then_some(new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_in_one_bin_and_the_ends_take_what_lies_beyond() {
        let numbers = [0.0, 0.01, 0.5, 1.0, 2.0, -3.0, f64::INFINITY, f64::NAN];
        let counts = histogram(numbers.into_iter(), [0.0, 1.0]);
        assert_eq!(counts.iter().sum::<usize>(), 7);
        assert_eq!((counts[0], counts[BINS / 2], counts[BINS - 1]), (3, 1, 3));
        assert_eq!(histogram([5.0, 5.0].into_iter(), [5.0, 5.0])[BINS / 2], 2);
    }

    #[test]
    fn a_brush_to_the_end_of_the_axis_has_no_limit_there() {
        assert_eq!(brushed([0.75, 0.25], [10.0, 20.0]), [12.5, 17.5]);
        assert_eq!(brushed([0.0, 0.5], [10.0, 20.0]), [f64::NEG_INFINITY, 15.0]);
        assert_eq!(brushed([0.5, 1.0], [10.0, 20.0]), [15.0, f64::INFINITY]);
    }
}
