//! A family's curves on a scene as lines, dots and words: error against time, both logarithmic. One
//! description for SVG and for egui.

use egui::{Align2, Color32, FontId, Pos2, Stroke, pos2, vec2};
use glioscope_render::accuracy::{Axis, Curve, Point};

/// Pixels.
pub(super) const SIZE: [u32; 2] = [900, 520];

const LEFT: f32 = 66.0;
const RIGHT: f32 = 878.0;
const TOP: f32 = 78.0;
const BOTTOM: f32 = 462.0;
const INK: [u8; 3] = [40, 40, 40];
const FAINT: [u8; 3] = [222, 222, 222];
const GREY: [u8; 3] = [130, 130, 130];
/// Told apart with common colour vision deficiencies (Okabe and Ito 2008).
const COLORS: [[u8; 3]; 5] = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [86, 180, 233]];

const TRUTH: &str = "the truth itself is off by this";

/// Which end of a text is at its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Something drawn; places in pixels from the top left.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Mark {
    Line {
        from: [f32; 2],
        to: [f32; 2],
        color: [u8; 3],
        width: f32,
        dashed: bool,
    },
    /// Filled, or a ring.
    Dot {
        at: [f32; 2],
        radius: f32,
        color: [u8; 3],
        filled: bool,
    },
    /// Its middle line is at the place's height.
    Text {
        at: [f32; 2],
        anchor: Anchor,
        size: f32,
        color: [u8; 3],
        text: String,
    },
}

/// A picture to be.
#[derive(Clone, Debug)]
pub(super) struct Plot {
    /// File name without ending.
    pub name: String,
    /// The scene it shows.
    pub scene: String,
    /// Numbers of the curves in it.
    pub curves: Vec<usize>,
    pub marks: Vec<Mark>,
}

/// A plot for each family and scene, in the order of the curves.
pub(super) fn plots(curves: &[Curve]) -> Vec<Plot> {
    let mut out: Vec<Plot> = Vec::new();
    let mut last = None;
    for (number, curve) in curves.iter().enumerate() {
        let key = (curve.family, curve.scene.clone());
        match out.last_mut() {
            Some(plot) if last.as_ref() == Some(&key) => plot.curves.push(number),
            _ => {
                let count = curves[..number].iter().filter(|c| c.family == curve.family);
                let mut scenes: Vec<&str> = count.map(|c| c.scene.as_str()).collect();
                scenes.dedup();
                let name = match scenes.len() {
                    0 => format!("accuracy-{}", curve.family.name()),
                    n => format!("accuracy-{}-{}", curve.family.name(), n + 1),
                };
                let scene = curve.scene.clone();
                out.push(Plot { name, scene, curves: vec![number], marks: Vec::new() });
            }
        }
        last = Some(key);
    }
    for plot in &mut out {
        let own: Vec<&Curve> = plot.curves.iter().filter_map(|n| curves.get(*n)).collect();
        plot.marks = marks(&own);
    }
    out
}

/// A logarithmic scale from values to pixels.
struct Scale {
    low: f64,
    high: f64,
    from: f32,
    to: f32,
}

impl Scale {
    fn of(values: impl Iterator<Item = f64>, from: f32, to: f32) -> Self {
        let positive = values.filter(|v| *v > 0.0 && v.is_finite());
        let (low, high) = positive.fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
        if low > high {
            return Self { low: 0.1, high: 10.0, from, to };
        }
        Self { low: low / 1.5, high: high * 1.5, from, to }
    }

    /// What is not positive lies on the lower edge.
    fn at(&self, value: f64) -> f32 {
        let share = (value.max(self.low) / self.low).ln() / (self.high / self.low).ln();
        self.from + (self.to - self.from) * share.clamp(0.0, 1.0) as f32
    }

    /// Round values in it: powers of ten, with 2 and 5 between where there are few.
    fn ticks(&self) -> Vec<f64> {
        let decades = (self.high / self.low).log10();
        let steps: &[f64] = match decades {
            d if d > 2.5 => &[1.0],
            d if d > 0.7 => &[1.0, 2.0, 5.0],
            _ => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
        };
        let apart = (decades / 9.0).ceil().max(1.0) as usize;
        let first = self.low.log10().floor() as i32;
        (first..=self.high.log10().ceil() as i32)
            .step_by(apart)
            .flat_map(|e| steps.iter().map(move |s| s * 10f64.powi(e)))
            .filter(|v| *v >= self.low && *v <= self.high)
            .collect()
    }
}

fn tick_name(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        format!("{}", (value * 1e6).round() / 1e6)
    } else {
        format!("{value:e}")
    }
}

fn line(from: [f32; 2], to: [f32; 2], color: [u8; 3], width: f32, dashed: bool) -> Mark {
    Mark::Line { from, to, color, width, dashed }
}

fn text(at: [f32; 2], anchor: Anchor, size: f32, color: [u8; 3], text: impl Into<String>) -> Mark {
    Mark::Text { at, anchor, size, color, text: text.into() }
}

fn marks(curves: &[&Curve]) -> Vec<Mark> {
    let Some(first) = curves.first() else { return Vec::new() };
    let along = |p: &Point| match first.axis {
        Axis::Time => p.cost().map(|t| t.median_ms),
        Axis::Knob => Some(p.value),
    };
    let points = || curves.iter().flat_map(|c| &c.points);
    let x = Scale::of(points().filter_map(along), LEFT, RIGHT);
    let truth_errors = || curves.iter().filter_map(|c| c.truth_error);
    // Room for the legend: no point lies under it.
    let top = TOP + 17.0 * (curves.len() + 1) as f32;
    let y = Scale::of(points().map(|p| p.error_rms).chain(truth_errors()), BOTTOM, top);
    let mut out = Vec::new();
    out.push(text([12.0, 18.0], Anchor::Start, 16.0, INK, first.family.title()));
    out.push(text([12.0, 38.0], Anchor::Start, 12.0, GREY, first.scene.clone()));
    out.push(text([12.0, 62.0], Anchor::Start, 12.0, INK, format!("error (RMS), {}", first.unit)));
    let horizontal = match first.axis {
        Axis::Time if points().any(|p| p.cpu.is_some()) => {
            "median processor time of all threads, ms; bars from first to third quartile".to_owned()
        }
        Axis::Time => "median time, ms; bars from first to third quartile".to_owned(),
        Axis::Knob => first.knob.to_owned(),
    };
    out.push(text([(LEFT + RIGHT) / 2.0, 506.0], Anchor::Middle, 12.0, INK, horizontal));
    for value in x.ticks() {
        let at = x.at(value);
        out.push(line([at, TOP], [at, BOTTOM], FAINT, 1.0, false));
        out.push(text([at, BOTTOM + 14.0], Anchor::Middle, 11.0, INK, tick_name(value)));
    }
    for value in y.ticks() {
        let at = y.at(value);
        out.push(line([LEFT, at], [RIGHT, at], FAINT, 1.0, false));
        out.push(text([LEFT - 6.0, at], Anchor::End, 11.0, INK, tick_name(value)));
    }
    out.push(line([LEFT, TOP], [LEFT, BOTTOM], INK, 1.0, false));
    out.push(line([LEFT, BOTTOM], [RIGHT, BOTTOM], INK, 1.0, false));
    if let Some(error) = truth_errors().reduce(f64::max) {
        let at = y.at(error);
        out.push(line([LEFT, at], [RIGHT, at], GREY, 1.0, true));
    }
    let place = |p: &Point| along(p).map(|v| [x.at(v), y.at(p.error_rms)]);
    let mut front: Vec<[f32; 2]> = points().filter(|p| p.is_pareto).filter_map(place).collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    out.extend(front.windows(2).map(|w| line(w[0], w[1], GREY, 2.0, false)));
    for (curve, color) in curves.iter().zip(COLORS.into_iter().cycle()) {
        for run in sweeps(&curve.points) {
            let places: Vec<[f32; 2]> = run.iter().filter_map(place).collect();
            out.extend(places.windows(2).map(|w| line(w[0], w[1], color, 1.0, false)));
        }
        for (point, at) in curve.points.iter().filter_map(|p| Some((p, place(p)?))) {
            if let Some(t) = point.cost().filter(|_| first.axis == Axis::Time) {
                out.push(line([x.at(t.q1_ms), at[1]], [x.at(t.q3_ms), at[1]], color, 1.0, false));
            }
            let filled = point.is_pareto || first.axis == Axis::Knob;
            out.push(Mark::Dot { at, radius: if filled { 4.5 } else { 3.5 }, color, filled });
            if point.is_default {
                out.push(Mark::Dot { at, radius: 9.0, color: INK, filled: false });
            }
        }
    }
    let legend = legend(curves);
    let around = |[x, y]: [f32; 2]| Area { left: x - 5.0, right: x + 5.0, top: y - 5.0, bottom: y + 5.0 };
    let mut labels = Labels { taken: points().filter_map(place).map(around).collect() };
    labels.taken.push(Area {
        left: 0.6 * RIGHT,
        right: RIGHT,
        top: 0.0,
        bottom: TOP + 17.0 * legend.len() as f32 / 2.0,
    });
    if let Some(error) = truth_errors().reduce(f64::max) {
        let at = y.at(error);
        out.push(labels.always([LEFT - 5.0, at], TRUTH, GREY));
        labels.taken.push(Area { left: LEFT, right: RIGHT, top: at - 2.0, bottom: at + 2.0 });
    }
    // What is the default first, then the front, then the ends of what is swept in one go.
    let colored = || curves.iter().zip(COLORS.into_iter().cycle());
    let word = first.family.default_word();
    for (point, color) in colored().flat_map(|(c, color)| c.points.iter().map(move |p| (p, color))) {
        if let Some(at) = place(point).filter(|_| point.is_default) {
            out.push(labels.always(at, &format!("{word}: {}", point.setting), mixed(color)));
        }
    }
    for (curve, color) in colored() {
        let whole = sweeps(&curve.points).next().is_some_and(|run| run.len() == curve.points.len());
        let last = curve.points.len().saturating_sub(1);
        for (number, point) in curve.points.iter().enumerate().filter(|(_, p)| !p.is_default) {
            let wanted = point.is_pareto || (whole && (number == 0 || number == last));
            if let Some(at) = place(point).filter(|_| wanted) {
                out.extend(labels.if_free(at, &point.setting, mixed(color)));
            }
        }
    }
    out.extend(legend);
    out
}

/// Neighbours whose knob rises, or falls, all along: three at least, or all that there are.
fn sweeps(points: &[Point]) -> impl Iterator<Item = &[Point]> {
    let least = points.len().clamp(2, 3);
    let way = |w: &[Point]| w.first().zip(w.last()).and_then(|(a, b)| a.value.partial_cmp(&b.value));
    let mut start = 0;
    let mut runs = Vec::new();
    for end in 1..=points.len() {
        let own = points.get(start..(start + 2).min(points.len())).and_then(way);
        let next = points.get(end.saturating_sub(1)..=end).and_then(way);
        let goes_on = next.is_some() && next == own && next != Some(std::cmp::Ordering::Equal);
        if !goes_on {
            runs.extend(points.get(start..end).filter(|run| run.len() >= least));
            start = end;
        }
    }
    runs.into_iter()
}

/// Darker, so that small words of it can be read.
fn mixed(color: [u8; 3]) -> [u8; 3] {
    color.map(|c| (f32::from(c) * 0.7) as u8)
}

#[derive(Clone, Copy, Debug)]
struct Area {
    left: f32,
    right: f32,
    top: f32,
    bottom: f32,
}

impl Area {
    fn meets(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }
}

/// Words beside points, where they hide neither a point nor each other.
struct Labels {
    taken: Vec<Area>,
}

impl Labels {
    const SIZE: f32 = 11.5;

    /// The sides of a point that words fit at.
    fn sides([x, y]: [f32; 2], words: &str) -> Vec<([f32; 2], Anchor, Area)> {
        // No letter of the plots' is wider on average.
        let width = 0.54 * Self::SIZE * words.chars().count() as f32;
        let mut out = Vec::new();
        for dy in [-12.0, 13.0, -24.0, 25.0] {
            for (at, anchor, left) in [
                ([x + 10.0, y + dy], Anchor::Start, x + 10.0),
                ([x - 10.0, y + dy], Anchor::End, x - 10.0 - width),
            ] {
                let half = 0.55 * Self::SIZE;
                let own = Area { left, right: left + width, top: at[1] - half, bottom: at[1] + half };
                if own.left > LEFT && own.right < SIZE[0] as f32 && own.top > TOP && own.bottom < BOTTOM {
                    out.push((at, anchor, own));
                }
            }
        }
        out
    }

    fn if_free(&mut self, at: [f32; 2], words: &str, color: [u8; 3]) -> Option<Mark> {
        let free = |own: &Area| !self.taken.iter().any(|t| t.meets(own));
        let (at, anchor, own) = Self::sides(at, words).into_iter().find(|(_, _, own)| free(own))?;
        self.taken.push(own);
        Some(text(at, anchor, Self::SIZE, color, words))
    }

    /// At the first side where nothing else has room.
    fn always(&mut self, at: [f32; 2], words: &str, color: [u8; 3]) -> Mark {
        self.if_free(at, words, color).unwrap_or_else(|| {
            let anchor = if at[0] > 0.6 * RIGHT { Anchor::End } else { Anchor::Start };
            let off = if anchor == Anchor::End { -10.0 } else { 10.0 };
            text([at[0] + off, at[1] - 12.0], anchor, Self::SIZE, color, words)
        })
    }
}

/// Names of the curves in their colours, at the upper right, where time is spent and error is large.
fn legend(curves: &[&Curve]) -> Vec<Mark> {
    let mut out = Vec::new();
    let mut y = TOP + 12.0;
    for (curve, color) in curves.iter().zip(COLORS.into_iter().cycle()) {
        out.push(Mark::Dot { at: [RIGHT - 8.0, y], radius: 4.0, color, filled: true });
        out.push(text([RIGHT - 18.0, y], Anchor::End, 12.0, color, curve.kernel.clone()));
        y += 17.0;
    }
    if curves.iter().any(|c| c.axis == Axis::Time) {
        let words = "filled: on the front; ringed: default";
        out.push(text([RIGHT - 18.0, y], Anchor::End, 11.0, GREY, words));
    }
    out
}

fn color_of([r, g, b]: [u8; 3]) -> Color32 {
    Color32::from_rgb(r, g, b)
}

/// The marks on a white ground.
pub(super) fn paint(ui: &egui::Ui, marks: &[Mark]) {
    let painter = ui.painter();
    let place = |[x, y]: [f32; 2]| -> Pos2 { pos2(x, y) };
    let all = egui::Rect::from_min_size(Pos2::ZERO, vec2(SIZE[0] as f32, SIZE[1] as f32));
    painter.rect_filled(all, 0.0, Color32::WHITE);
    for mark in marks {
        match mark {
            Mark::Line { from, to, color, width, dashed } => {
                let stroke = Stroke::new(*width, color_of(*color));
                if *dashed {
                    painter.extend(egui::Shape::dashed_line(&[place(*from), place(*to)], stroke, 6.0, 4.0));
                } else {
                    painter.line_segment([place(*from), place(*to)], stroke);
                }
            }
            Mark::Dot { at, radius, color, filled: true } => {
                painter.circle_filled(place(*at), *radius, color_of(*color));
            }
            Mark::Dot { at, radius, color, filled: false } => {
                painter.circle_stroke(place(*at), *radius, Stroke::new(1.3, color_of(*color)));
            }
            Mark::Text { at, anchor, size, color, text } => {
                let align = match anchor {
                    Anchor::Start => Align2::LEFT_CENTER,
                    Anchor::Middle => Align2::CENTER_CENTER,
                    Anchor::End => Align2::RIGHT_CENTER,
                };
                painter.text(place(*at), align, text, FontId::proportional(*size), color_of(*color));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glioscope_render::accuracy::{Errors, Family, Timing};

    use super::*;

    fn curve(values: &[f64]) -> Curve {
        let point = |(number, value): (usize, &f64)| {
            let ms = 10.0 + number as f64;
            let mut errors = Errors::default();
            errors.add(1.0 / ms);
            Point {
                setting: format!("a setting in several words, number {number}"),
                time: Some(Timing { median_ms: ms, q1_ms: ms, q3_ms: ms, runs: 1 }),
                is_default: number == 2,
                is_pareto: true,
                ..Point::new(*value, &errors)
            }
        };
        Curve {
            family: Family::Occlusion,
            kernel: "kernel".to_owned(),
            scene: String::new(),
            knob: "",
            truth: String::new(),
            truth_error: Some(0.01),
            unit: "",
            axis: Axis::Time,
            points: values.iter().enumerate().map(point).collect(),
        }
    }

    #[test]
    fn only_what_is_swept_is_joined() {
        let runs =
            |values: &[f64]| -> Vec<usize> { sweeps(&curve(values).points).map(<[Point]>::len).collect() };
        assert_eq!(runs(&[4.0, 2.0, 1.0, 4.0, 2.0, 1.0, 0.5]), [3, 4]);
        assert_eq!(runs(&[1.0, 2.0]), [2]);
        assert_eq!(runs(&[1.0, 1.0, 1.0]), [0; 0]);
        assert_eq!(runs(&[2.0, 1.0, 3.0, 3.0]), [0; 0]);
        assert_eq!(runs(&[1.0, 2.0, 3.0, 3.0, 3.0]), [3]);
        assert_eq!(runs(&[]), [0; 0]);
    }

    /// Points so close that not all can be named: the default is, and no words lie on others or past the edge.
    #[test]
    fn words_keep_clear_of_each_other() {
        let crowd = curve(&[0.0; 60]);
        let marks = marks(&[&crowd]);
        let areas: Vec<(Area, &str)> = marks
            .iter()
            .filter_map(|m| match m {
                Mark::Text { at, anchor, size, text, .. } if *size == Labels::SIZE => {
                    let width = 5.0 * text.chars().count() as f32;
                    let left = if *anchor == Anchor::End { at[0] - width } else { at[0] };
                    Some((Area { left, right: left + width, top: at[1] - 5.0, bottom: at[1] + 5.0 }, &**text))
                }
                _ => None,
            })
            .collect();
        assert!(areas.iter().any(|a| a.1.starts_with("default: ")));
        assert!(areas.len() > 4 && areas.len() < 60, "{}", areas.len());
        for (n, (a, words)) in areas.iter().enumerate() {
            assert!(a.left > LEFT - 1.0 && a.right < SIZE[0] as f32, "{words}");
            assert!(areas[..n].iter().all(|b| !b.0.meets(a)), "{words}");
        }
    }
}
