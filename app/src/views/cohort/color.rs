//! What a case's colour tells: a ramp of numbers, a ramp about zero, or a colour for each word; and its legend.

use std::sync::Arc;

use egui::{Color32, CornerRadius, Rect, Sense, Stroke, StrokeKind, Ui, vec2};
use glioscope_render::{MaskColors, Palette};

use crate::{
    theme::{self, Tokens},
    views::draw,
    world::cohort::{CaseValues, DrawnRange, number_text},
};

/// Size of a ramp in the legend, points.
const RAMP: [f32; 2] = [120.0, 10.0];

/// How colours follow from values.
#[derive(Clone, Debug, PartialEq)]
enum Scale {
    /// From the least to the greatest; whether there are numbers below and above.
    Numbers { range: [f64; 2], beyond: [bool; 2] },
    /// From shrinkage over nothing to growth: the farthest from zero.
    Signed { most: f64, beyond: [bool; 2] },
    /// A colour for each word.
    Words,
}

/// Colours of all cases.
#[derive(Clone, Debug)]
pub struct Colors {
    values: Arc<CaseValues>,
    scale: Scale,
    unit: &'static str,
}

impl Colors {
    /// The colours that these values have.
    ///
    /// `drawn`: the range in which they are drawn, if they are numbers.
    pub fn new(values: Arc<CaseValues>, drawn: DrawnRange, unit: &'static str) -> Self {
        let scale = match &*values {
            CaseValues::Words { .. } => Scale::Words,
            CaseValues::Numbers(numbers) => scale_of(numbers, drawn),
        };
        Self { values, scale, unit }
    }

    /// A case's colour as sRGB; `None` where it has no value.
    pub fn of(&self, case: usize, dark: bool) -> Option<Color32> {
        match &*self.values {
            CaseValues::Numbers(numbers) => {
                let number = *numbers.get(case)?;
                (!number.is_nan()).then(|| self.at(number, dark))
            }
            CaseValues::Words { of_case, words } => {
                let word = (*of_case.get(case)?)?;
                Some(word_color(words, word, dark))
            }
        }
    }

    fn at(&self, number: f64, dark: bool) -> Color32 {
        match self.scale {
            Scale::Numbers { range: [low, high], .. } => {
                let share = if high > low { (number - low) / (high - low) } else { 0.5 };
                theme::sequential(share.clamp(0.0, 1.0) as f32)
            }
            Scale::Signed { most, .. } => Tokens::of(dark).diverging((number / most).clamp(-1.0, 1.0) as f32),
            Scale::Words => Tokens::of(dark).second,
        }
    }

    /// A case's value in words.
    pub fn text(&self, case: usize) -> String {
        self.values.text(case, self.unit)
    }

    /// Ends of the ramp, and whether numbers are beyond them; `None` of words.
    fn ramp(&self) -> Option<DrawnRange> {
        match self.scale {
            Scale::Numbers { range, beyond } => Some((range, beyond)),
            Scale::Signed { most, beyond } => Some(([-most, most], beyond)),
            Scale::Words => None,
        }
    }

    /// The colour at a share of the ramp from its lower end.
    fn at_share(&self, [low, high]: [f64; 2], share: f64, dark: bool) -> Color32 {
        self.at(low + share * (high - low), dark)
    }

    /// Ends of the ramp as words.
    fn ends(&self) -> Option<[String; 2]> {
        let ([low, high], [below, above]) = self.ramp()?;
        let end = |number: f64, is_beyond: bool, sign: &str| {
            let sign = if is_beyond { sign } else { "" };
            format!("{sign}{}", number_text(number, self.unit))
        };
        Some([end(low, below, "≤ "), end(high, above, "≥ ")])
    }

    /// What the legend says: colours with their words, left to right. A ramp has eleven colours and words at its ends.
    pub fn legend(&self, dark: bool) -> Vec<(Color32, String)> {
        if let CaseValues::Words { words, .. } = &*self.values {
            let named = words.iter().enumerate();
            return named.map(|(n, word)| (word_color(words, n, dark), word.replace('_', " "))).collect();
        }
        let Some((([low, high], _), [first, last])) = self.ramp().zip(self.ends()) else { return Vec::new() };
        let text = |n: usize| match n {
            0 => first.clone(),
            10 => last.clone(),
            _ => String::new(),
        };
        (0..=10).map(|n| (self.at_share([low, high], n as f64 / 10.0, dark), text(n))).collect()
    }

    /// Draws the legend in one line.
    pub fn show_legend(&self, ui: &mut Ui) {
        let (dark, tokens) = (ui.visuals().dark_mode, Tokens::in_ui(ui));
        let edge = Stroke::new(1.0, tokens.second);
        if let Some(((range, _), [low, high])) = self.ramp().zip(self.ends()) {
            ui.label(low);
            let (rect, response) = ui.allocate_exact_size(RAMP.into(), Sense::hover());
            draw::name_widget(ui, &response, "Colours from the least to the greatest value");
            let steps = rect.width() as usize;
            for step in 0..steps {
                let share = (step as f64 + 0.5) / steps as f64;
                let left = rect.left() + rect.width() * step as f32 / steps as f32;
                let part = Rect::from_min_size(
                    egui::pos2(left, rect.top()),
                    vec2(rect.width() / steps as f32 + 0.5, rect.height()),
                );
                let color = self.at_share(range, share, dark);
                ui.painter().rect_filled(part.intersect(rect), CornerRadius::ZERO, color);
            }
            ui.painter().rect_stroke(rect, 0.0, edge, StrokeKind::Outside);
            ui.label(high);
        } else {
            for (color, word) in self.legend(dark) {
                let (rect, _) = ui.allocate_exact_size(vec2(11.0, 11.0), Sense::hover());
                ui.painter().rect(rect, 2.0, color, edge, StrokeKind::Outside);
                ui.label(word);
            }
        }
    }
}

/// The ramp of these numbers: about zero where some are on either side.
fn scale_of(numbers: &[f64], (range, beyond): DrawnRange) -> Scale {
    let has = |sign: f64| numbers.iter().any(|number| number.is_finite() && number * sign > 0.0);
    if has(-1.0) && has(1.0) {
        let most = range[0].abs().max(range[1].abs());
        let is_beyond = |sign: f64| numbers.iter().any(|number| number * sign > most);
        return Scale::Signed { most, beyond: [is_beyond(-1.0), is_beyond(1.0)] };
    }
    Scale::Numbers { range, beyond }
}

/// The colour of a word. Calls of response criteria have those of growth and shrinkage.
fn word_color(words: &[String], place: usize, dark: bool) -> Color32 {
    let tokens = Tokens::of(dark);
    let word = words.get(place).map_or("", |word| word.strip_prefix("unconfirmed_").unwrap_or(word));
    match word {
        "complete_response" => tokens.diverging(-1.0),
        "partial_response" => tokens.diverging(-0.7),
        "minor_response" => tokens.diverging(-0.4),
        "stable_disease" => tokens.diverging(0.0),
        "progression" => tokens.diverging(1.0),
        "preliminary_progression" => tokens.diverging(0.6),
        "baseline" | "before_baseline" | "cannot_say" => tokens.line,
        _ => {
            let none = vec![None; words.len()];
            theme::color(MaskColors::new(Palette::default(), &none).mask(place))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::cohort::drawn_range;

    fn scale(numbers: &[f64]) -> Scale {
        scale_of(numbers, drawn_range(numbers))
    }

    fn colors_of(numbers: Vec<f64>, unit: &'static str) -> Colors {
        let drawn = drawn_range(&numbers);
        Colors::new(Arc::new(CaseValues::Numbers(numbers)), drawn, unit)
    }

    #[test]
    fn a_ramp_leaves_out_what_would_take_all_of_it_and_says_so() {
        let mut numbers: Vec<f64> = (0..100).map(f64::from).collect();
        numbers[99] = 1e9;
        let Scale::Numbers { range, beyond } = scale(&numbers) else { panic!("signed") };
        assert_eq!((range, beyond), ([2.0, 97.0], [true, true]));
        let colors = colors_of(numbers, "mm");
        assert_eq!(colors.ends().unwrap(), ["≤ 2 mm", "≥ 97 mm"]);
        assert_eq!(colors.of(99, false), colors.of(97, false));
        assert_eq!(
            scale(&[1.0, 3.0, f64::INFINITY]),
            Scale::Numbers { range: [1.0, 3.0], beyond: [false, true] }
        );
        assert_eq!(scale(&[-1.0, 3.0]), Scale::Signed { most: 3.0, beyond: [false; 2] });
    }

    #[test]
    fn a_case_without_a_value_has_no_colour() {
        let colors = colors_of(vec![1.0, f64::NAN, 2.0], "");
        assert_eq!(colors.of(1, true), None);
        assert!(colors.of(0, true) != colors.of(2, true));
        let words = CaseValues::Words { of_case: vec![Some(0), None], words: vec!["progression".into()] };
        let colors = Colors::new(Arc::new(words), drawn_range(&[]), "");
        assert_eq!((colors.of(0, true), colors.of(1, true)), (Some(Tokens::of(true).diverging(1.0)), None));
    }
}
