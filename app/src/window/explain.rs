//! The mode for explaining: big words, two views, the size in true size, and the dates one after the other. Nothing in it names
//! the patient: neither menu, status line, nor names and dates of the case.

use std::{rc::Rc, time::Duration};

use egui::{Align, Button, Color32, Key, Layout, Rect, RichText, Sense, Slider, Stroke, Ui, pos2, vec2};

use super::panes::PaneArea;
use crate::{
    command::{Commands, LookCommand},
    model::PaneId,
    page::{Spoken, words},
    theme::{self, Tokens},
    views::Shared,
    words::{Language, Words},
};

/// Size of what is said, points.
const SAID: f32 = 21.0;
/// Size of text on buttons and beside sizes, points.
const LARGE: f32 = 17.0;
/// Seconds that each date is shown.
const SECONDS_PER_DATE: f64 = 2.0;
/// Points per millimetre where the screen's size isn't known: 96 dots per inch.
const POINTS_PER_MM: f32 = 96.0 / 25.4;
/// The long side of a bank card (ISO/IEC 7810 ID-1).
const CARD_MM: f32 = 85.6;

/// The state of the mode.
#[derive(Clone)]
pub struct Explain {
    language: Language,
    /// The sentences of that language.
    words: Rc<Words>,
    /// Time of the last step in seconds of egui's clock, during playback.
    playing_since: Option<f64>,
    points_per_mm: f32,
    fits: bool,
}

impl Explain {
    /// The mode in a language, on a screen with so many points per millimetre; `None`: not known.
    pub fn new(points_per_mm: Option<f32>, language: Language) -> Self {
        let points_per_mm = points_per_mm.filter(|p| (1.0..=20.0).contains(p)).unwrap_or(POINTS_PER_MM);
        Self { language, words: Rc::new(words(language)), playing_since: None, points_per_mm, fits: false }
    }

    /// The language, as the user chose it.
    pub fn language(&self) -> Language {
        self.language
    }

    /// Points per millimetre, as the user fitted them.
    pub fn points_per_mm(&self) -> f32 {
        self.points_per_mm
    }
}

/// Draws the mode into all of `ui`; returns whether it ends.
pub fn show(ui: &mut Ui, explain: &mut Explain, area: &mut PaneArea<'_>) -> bool {
    let input = area.shared.input;
    let dates = input.case.time_points.len();
    play(ui, explain, dates, input.time, area.out);
    let mut ends = ui.input(|i| i.key_pressed(Key::Escape));
    egui::Panel::top("explain").show(ui, |ui| {
        ui.add_space(6.0);
        ui.horizontal_wrapped(|ui| {
            let big = |text: &str| RichText::new(text).size(LARGE);
            if dates > 1 {
                for time in 0..dates {
                    let text = explain.words.with("scan", &[("number", (time + 1).to_string())]);
                    if ui.add(Button::selectable(input.time == time, big(&text))).clicked() {
                        area.out.push(LookCommand::SetTime(time));
                        explain.playing_since = None;
                    }
                }
                let text = explain.words.get(if explain.playing_since.is_some() { "stop" } else { "play" });
                if ui.add(Button::new(big(&text))).clicked() {
                    explain.playing_since = match explain.playing_since {
                        Some(_) => None,
                        None => Some(ui.input(|i| i.time)),
                    };
                }
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let end = explain.words.get("explain-end");
                if ui.add(Button::new(big(&end))).on_hover_text("Back to the workstation (Esc)").clicked() {
                    ends = true;
                }
                let (other, name) = match explain.language {
                    Language::En => (Language::De, "Deutsch"),
                    Language::De => (Language::En, "English"),
                };
                if ui.add(Button::new(big(name))).clicked() {
                    (explain.language, explain.words) = (other, Rc::new(words(other)));
                }
            });
        });
        ui.add_space(6.0);
    });
    let Shared { results, ask, .. } = &mut area.shared;
    let said = results.spoken.get(input.case, input.time, explain.language, ask);
    egui::Panel::left("said").resizable(false).exact_size(said_width(ui)).show(ui, |ui| {
        egui::ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            ui.add_space(10.0);
            let Some(said) = &said else { return };
            for (mask, sentence) in &said.sentences {
                ui.horizontal_wrapped(|ui| {
                    if let Some(mask) = mask {
                        let (dot, _) = ui.allocate_exact_size(vec2(SAID, SAID), Sense::hover());
                        let color = theme::color(input.colors.mask(*mask));
                        ui.painter().circle_filled(dot.center(), SAID * 0.36, color);
                    }
                    ui.label(RichText::new(sentence).size(SAID));
                });
                ui.add_space(10.0);
            }
            true_size(ui, explain, said, theme::color(input.colors.mask(said.largest)));
        });
    });
    egui::CentralPanel::default().frame(egui::Frame::NONE).show(ui, |ui| views(ui, area));
    ends
}

fn said_width(ui: &Ui) -> f32 {
    (ui.available_width() * 0.36).clamp(260.0, 560.0)
}

/// The ellipsoids, beside or above the anatomy where there is an image.
fn views(ui: &mut Ui, area: &mut PaneArea<'_>) {
    let rect = ui.available_rect_before_wrap();
    let has_image = area.shared.input.context.is_some();
    let panes: &[PaneId] =
        if has_image { &[PaneId::Context, PaneId::Ellipsoids] } else { &[PaneId::Ellipsoids] };
    let is_wide = rect.width() > rect.height();
    let parts = panes.len() as f32;
    for (n, pane) in panes.iter().enumerate() {
        let n = n as f32;
        let part = if is_wide {
            let width = rect.width() / parts;
            Rect::from_min_size(rect.min + vec2(width * n, 0.0), vec2(width - 2.0, rect.height()))
        } else {
            let height = rect.height() / parts;
            Rect::from_min_size(rect.min + vec2(0.0, height * n), vec2(rect.width(), height - 2.0))
        };
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(part));
        area.pane(&mut ui, *pane);
    }
}

/// Goes on to the next date.
fn play(ui: &Ui, explain: &mut Explain, dates: usize, time: usize, out: &mut Commands) {
    let Some(since) = explain.playing_since else { return };
    let now = ui.input(|i| i.time);
    if now - since >= SECONDS_PER_DATE {
        explain.playing_since = Some(now);
        out.push(LookCommand::SetTime((time + 1) % dates.max(1)));
    }
    ui.request_repaint_after(Duration::from_millis(100));
}

/// A disc as large as the area would be as a ball, beside the everyday object, in true size.
fn true_size(ui: &mut Ui, explain: &mut Explain, said: &Spoken, color: Color32) {
    let tokens = *Tokens::in_ui(ui);
    let Some(ball_mm) = said.ball_mm else { return };
    let points = |mm: f64| mm as f32 * explain.points_per_mm;
    let object_mm = said.object.as_ref().map_or(0.0, |(_, mm)| *mm);
    let [ball, object] = [ball_mm, object_mm].map(points);
    let title = explain.words.get("true-size-heading");
    ui.label(RichText::new(&title).size(LARGE).strong());
    let width = ball + object + 24.0;
    let height = ball.max(object) + 8.0;
    let (rect, response) = ui.allocate_exact_size(vec2(width, height), Sense::hover());
    let painter = ui.painter();
    let at = |left: f32, diameter: f32| pos2(rect.left() + left + diameter / 2.0, rect.center().y);
    painter.circle_filled(at(0.0, ball), ball / 2.0, color);
    if object > 0.0 {
        let center = at(ball + 20.0, object);
        // The line lies within the size.
        painter.circle(center, object / 2.0 - 1.0, Color32::TRANSPARENT, Stroke::new(2.0, tokens.second));
    }
    let name = said.object.as_ref().map(|(name, _)| name.clone()).unwrap_or_default();
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, format!("{title}: {name}")));
    if !name.is_empty() {
        let text = explain.words.with("explain-ball", &[("object", name)]);
        ui.label(RichText::new(text).size(LARGE));
    }
    let text = explain.words.get("explain-fit");
    ui.checkbox(&mut explain.fits, text);
    if !explain.fits {
        return;
    }
    let text = explain.words.get("explain-fit-text");
    ui.label(text);
    let length = CARD_MM * explain.points_per_mm;
    let (rect, _) = ui.allocate_exact_size(vec2(length.max(ui.available_width()), 16.0), Sense::hover());
    let painter = ui.painter();
    let (y, stroke) = (rect.center().y, Stroke::new(2.0, tokens.text));
    painter.hline(rect.left()..=rect.left() + length, y, stroke);
    for x in [rect.left(), rect.left() + length] {
        painter.vline(x, y - 7.0..=y + 7.0, stroke);
    }
    ui.spacing_mut().slider_width = 200.0;
    let slider = ui.add(Slider::new(&mut explain.points_per_mm, 1.0..=12.0).show_value(false));
    slider.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "Length of the line"));
}
