//! The pages of a study on the screen. Everything is done by keys; what is shown has a name for programs that read it aloud.

use egui::{
    Align, Align2, Color32, Key, Layout, Painter, Pos2, Rect, Response, Role, Sense, Shape, Stroke,
    StrokeKind, TextureHandle, TextureOptions, Ui, WidgetInfo, pos2, vec2,
};
use glioscope_core::study::{Answer, Mark, Side, Task, Truth};

use super::{course::Study, page::Page, sentences};
use crate::{
    theme::{self, CROSSHAIR, EDGE, ON_IMAGE, Tokens},
    views::draw,
    words::Words,
};

/// Sizes of type: questions and text are read at arm's length.
const TITLE_POINTS: f32 = 24.0;
const BODY_POINTS: f32 = 17.0;
const KEYS_POINTS: f32 = 15.0;
/// Widest column of text.
const COLUMN: f32 = 640.0;
/// Above the picture the question; below it the keys, and of depth the scale.
const HEAD: f32 = 68.0;
const FOOT: f32 = 96.0;
/// Between two pictures.
const GAP: f32 = 16.0;
/// Radius of a mark's circle in shares of the picture's side: what lies in it is clear of edges.
const CIRCLE: f32 = 0.024;

/// The pages, with the pictures that are on the screen.
pub struct StudyView {
    words: Words,
    shown: Option<(usize, Vec<TextureHandle>)>,
}

impl StudyView {
    /// The pages of a study.
    pub fn new(study: &Study) -> Self {
        Self { words: sentences::words(study.settings().language), shown: None }
    }

    /// Draws the page. Returns whether the picture is on the screen.
    pub fn show(&mut self, ui: &mut Ui, study: &Study) -> bool {
        let rect = ui.available_rect_before_wrap();
        match study.page() {
            Page::Wait { .. } => self.wait(ui, rect, study),
            Page::Shown { percent, .. } => return self.trial(ui, rect, study, *percent),
            page => self.text(ui, rect, study, page),
        }
        false
    }

    fn get(&self, key: &str) -> String {
        self.words.get(key)
    }

    fn task(&self, task: Task, what: &str) -> String {
        self.get(&format!("{task}-{what}"))
    }

    fn percent(&self, percent: f64) -> String {
        format!("{percent:.0} %")
    }

    /// A page of text: a title, paragraphs, and which key leads on.
    fn text(&self, ui: &mut Ui, rect: Rect, study: &Study, page: &Page) {
        let trial = study.trial();
        let task = trial.map(|trial| trial.task);
        let count = |practice: bool| {
            let is_of = |other: &&glioscope_core::study::Trial| {
                Some(other.task) == task && other.practice == practice
            };
            study.trials().iter().filter(is_of).count()
        };
        let counted = |key: &str, count: usize| self.words.with(key, &[("count", count.to_string())]);
        let mut keys = None;
        let mut leads_on = "space-goes-on";
        let (title, mut paragraphs) = match page {
            Page::Welcome => {
                let mut all =
                    vec![self.get("welcome-lead"), self.get("welcome-speed"), self.get("welcome-keys")];
                if study.resumed() > 0 {
                    let numbers =
                        [("done", study.resumed().to_string()), ("all", study.trials().len().to_string())];
                    all.push(self.words.with("welcome-resumed", &numbers));
                }
                (self.get("welcome-title"), all)
            }
            Page::Task => {
                let task = task.unwrap_or(Task::Nearer);
                keys = Some(self.task(task, "keys"));
                let follows = match trial {
                    Some(trial) if trial.practice => counted("practice-first", count(true)),
                    _ => counted("counts", count(false)),
                };
                (self.task(task, "title"), vec![self.task(task, "what"), follows])
            }
            Page::Counts => {
                keys = task.map(|task| self.task(task, "keys"));
                (self.get("practice-over"), vec![counted("counts", count(false))])
            }
            Page::Feedback { answer, truth } => self.feedback(*answer, *truth),
            Page::Paused => (self.get("paused"), Vec::new()),
            Page::Failed(why) => {
                leads_on = "space-again";
                (self.get("failed"), vec![why.clone()])
            }
            Page::Done | Page::Left => {
                leads_on = "";
                (self.get("done-title"), vec![self.get("done-what")])
            }
            Page::Wait { .. } | Page::Shown { .. } => return,
        };
        paragraphs.extend(keys);
        let tokens = Tokens::in_ui(ui);
        let width = COLUMN.min(rect.width() - 48.0);
        let column = Rect::from_center_size(rect.center(), vec2(width, rect.height()));
        ui.scope_builder(
            egui::UiBuilder::new().max_rect(column).layout(Layout::top_down(Align::Center)),
            |ui| {
                ui.add_space((rect.height() * 0.22).min(200.0));
                let label = |ui: &mut Ui, text: &str, points: f32, color: Color32| {
                    ui.add(egui::Label::new(egui::RichText::new(text).size(points).color(color)).wrap());
                };
                label(ui, &title, TITLE_POINTS, tokens.text);
                for paragraph in &paragraphs {
                    ui.add_space(16.0);
                    label(ui, paragraph, BODY_POINTS, tokens.text);
                }
                if !leads_on.is_empty() {
                    ui.add_space(32.0);
                    label(ui, &self.get(leads_on), KEYS_POINTS, tokens.second);
                }
            },
        );
    }

    fn feedback(&self, answer: Answer, truth: Truth) -> (String, Vec<String>) {
        match truth {
            Truth::Is(is) => {
                let title = self.get(if is == answer { "feedback-right" } else { "feedback-wrong" });
                let what = match is {
                    Answer::Left => "feedback-left",
                    Answer::Right => "feedback-right-one",
                    Answer::Bulge => "feedback-bulge",
                    Answer::Hollow => "feedback-hollow",
                    Answer::Saddle | Answer::Percent(_) => "feedback-saddle",
                };
                (title, vec![self.get(what)])
            }
            Truth::Percent(is) => {
                let said = match answer {
                    Answer::Percent(percent) => f64::from(percent),
                    _ => 0.0,
                };
                let numbers = [("truth", self.percent(is)), ("answer", self.percent(said))];
                (self.words.with("feedback-depth", &numbers), Vec::new())
            }
            Truth::Taste => (String::new(), Vec::new()),
        }
    }

    /// A cross where the picture will be; from the second on words, where drawing takes long.
    fn wait(&mut self, ui: &mut Ui, rect: Rect, study: &Study) {
        let tokens = Tokens::in_ui(ui);
        let squares = squares(rect, 1);
        let center = squares[0].center();
        let response = ui.allocate_rect(rect, Sense::hover());
        let text = self.get("wait");
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &text));
        let stroke = Stroke::new(2.0, tokens.second);
        for arm in [vec2(14.0, 0.0), vec2(0.0, 14.0)] {
            ui.painter().line_segment([center - arm, center + arm], stroke);
        }
        if study.prepared().is_none() {
            let at = center + vec2(0.0, 44.0);
            ui.painter().text(at, Align2::CENTER_TOP, text, theme::font(KEYS_POINTS), tokens.second);
        }
    }

    /// The question, the pictures with their marks, and the keys.
    fn trial(&mut self, ui: &mut Ui, rect: Rect, study: &Study, percent: Option<u8>) -> bool {
        let (Some(trial), Some(prepared)) = (study.trial(), study.prepared()) else { return false };
        let textures: Vec<TextureHandle> = match &self.shown {
            Some((at, textures)) if *at == study.index() => textures.clone(),
            _ => {
                let load = |picture: &egui::ColorImage| {
                    ui.ctx().load_texture("study", picture.clone(), TextureOptions::LINEAR)
                };
                let textures: Vec<TextureHandle> = prepared.pictures.iter().map(load).collect();
                self.shown = Some((study.index(), textures.clone()));
                textures
            }
        };
        let tokens = Tokens::in_ui(ui);
        let question = self.task(trial.task, "title");
        let top = pos2(rect.center().x, rect.top() + 12.0);
        self.caption(ui, top, &question, TITLE_POINTS, tokens.text);
        let is_alike = |other: &&glioscope_core::study::Trial| {
            other.task == trial.task && other.practice == trial.practice
        };
        let count = study.trials().iter().filter(is_alike).count();
        let key = if trial.practice { "trial-practice" } else { "trial-counted" };
        let numbers = [("number", trial.number.to_string()), ("count", count.to_string())];
        let mut progress = self.words.with(key, &numbers);
        if study.pauses() {
            progress = format!("{progress}  ·  {}", self.get("pauses"));
        }
        self.caption(ui, top + vec2(0.0, 32.0), &progress, KEYS_POINTS, tokens.second);
        let squares = squares(rect, textures.len());
        for (n, (square, texture)) in squares.iter().zip(&textures).enumerate() {
            let response = ui.allocate_rect(*square, Sense::hover());
            ui.painter().image(
                texture.id(),
                *square,
                Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0)),
                Color32::WHITE,
            );
            ui.painter().rect_stroke(*square, 0.0, Stroke::new(1.0, tokens.line), StrokeKind::Outside);
            let name = match (textures.len(), n) {
                (1, _) => self.words.with("picture-name", &[("question", question.clone())]),
                (_, 0) => self.get("left-picture"),
                _ => self.get("right-picture"),
            };
            response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &name));
            if n == 0 {
                prepared.scene.marks.iter().for_each(|mark| draw_mark(ui.painter(), *square, mark));
            }
        }
        let bottom = squares.first().map_or(rect.bottom() - FOOT, |square| square.bottom());
        let mut keys_at = pos2(rect.center().x, bottom + 14.0);
        if trial.task == Task::Depth {
            let scale = Rect::from_center_size(
                pos2(rect.center().x, bottom + 26.0),
                vec2(squares[0].width() * 0.8, 10.0),
            );
            self.scale(ui, scale, percent);
            keys_at.y = bottom + 66.0;
        }
        self.caption(ui, keys_at, &self.task(trial.task, "keys"), KEYS_POINTS, tokens.second);
        true
    }

    /// Text about the middle of a line, with a name of its own.
    fn caption(&self, ui: &mut Ui, at: Pos2, text: &str, points: f32, color: Color32) -> Response {
        let galley = ui.painter().layout_no_wrap(text.to_owned(), theme::font(points), color);
        let rect = Align2::CENTER_TOP.anchor_size(at, galley.size());
        let response = ui.allocate_rect(rect, Sense::hover());
        ui.painter().galley(rect.min, galley, color);
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, text));
        response
    }

    /// The scale of depth, with the depth chosen.
    fn scale(&self, ui: &mut Ui, rect: Rect, percent: Option<u8>) {
        let tokens = Tokens::in_ui(ui);
        let response = ui.allocate_rect(rect, Sense::hover());
        let painter = ui.painter();
        painter.rect_filled(rect, 4.0, tokens.line);
        for tenth in 0..=10_u8 {
            let x = egui::lerp(rect.left()..=rect.right(), f32::from(tenth) / 10.0);
            let stroke = Stroke::new(1.0, tokens.second);
            painter.line_segment([pos2(x, rect.bottom()), pos2(x, rect.bottom() + 5.0)], stroke);
        }
        let label = |at: Pos2, anchor: Align2, text: String| {
            painter.text(at, anchor, text, theme::font(KEYS_POINTS), tokens.second);
        };
        let under = rect.bottom() + 8.0;
        label(pos2(rect.left(), under), Align2::LEFT_TOP, format!("0 %  {}", self.get("depth-near")));
        label(pos2(rect.right(), under), Align2::RIGHT_TOP, format!("{}  100 %", self.get("depth-far")));
        let name = match percent {
            None => self.get("depth-none"),
            Some(percent) => {
                let at =
                    pos2(egui::lerp(rect.left()..=rect.right(), f32::from(percent) / 100.0), rect.center().y);
                painter.circle(at, 9.0, tokens.interaction, Stroke::new(1.5, tokens.panel));
                let text = self.percent(f64::from(percent));
                let under = pos2(rect.center().x, under);
                painter.text(under, Align2::CENTER_TOP, &text, theme::font(KEYS_POINTS), tokens.text);
                self.words.with("depth-chosen", &[("percent", text)])
            }
        };
        response.widget_info(|| WidgetInfo::labeled(Role::Meter, true, &name));
        draw::name_widget(ui, &response, &name);
    }
}

/// The squares of one or two pictures side by side, as large as they fit between the question and the keys.
fn squares(rect: Rect, count: usize) -> Vec<Rect> {
    let count = count.max(1) as f32;
    let width = (rect.width() - 32.0 - GAP * (count - 1.0)) / count;
    let side = width.min(rect.height() - HEAD - FOOT).max(64.0);
    let left = rect.center().x - (side * count + GAP * (count - 1.0)) / 2.0;
    let top = rect.top() + HEAD;
    (0..count as usize)
        .map(|n| Rect::from_min_size(pos2(left + n as f32 * (side + GAP), top), vec2(side, side)))
        .collect()
}

/// A circle about a marked point, white with a dark edge; of two a triangle points to the key.
fn draw_mark(painter: &Painter, square: Rect, mark: &Mark) {
    let at = square.min + vec2(mark.at.x as f32, mark.at.y as f32) * square.width();
    let radius = square.width() * CIRCLE;
    painter.circle_stroke(at, radius, Stroke::new(5.0, EDGE));
    painter.circle_stroke(at, radius, Stroke::new(2.0, ON_IMAGE));
    let side = match mark.side {
        Side::Only => return,
        Side::Left => -1.0,
        Side::Right => 1.0,
    };
    let (from, size) = (at + vec2(side * (radius + 6.0), 0.0), radius * 0.8);
    let tip = from + vec2(side * size, 0.0);
    let corners = vec![tip, from + vec2(0.0, size * 0.8), from - vec2(0.0, size * 0.8)];
    painter.add(Shape::convex_polygon(corners.clone(), ON_IMAGE, Stroke::new(1.5, EDGE)));
    painter.add(Shape::closed_line(corners, Stroke::new(1.0, CROSSHAIR)));
}

/// The keys pressed in a frame, in order, and whether each repeats while it is held.
pub fn pressed(ui: &Ui) -> Vec<(Key, bool)> {
    ui.input(|input| {
        let key = |event: &egui::Event| match event {
            egui::Event::Key { key, pressed: true, repeat, modifiers, .. }
                if !modifiers.command && !modifiers.alt =>
            {
                Some((*key, *repeat))
            }
            _ => None,
        };
        input.events.iter().filter_map(key).collect()
    })
}
