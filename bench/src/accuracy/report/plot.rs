//! Plots of a family's curves on one scene: error against cost or knob, both axes logarithmic.

use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use crate::{
    Outcome,
    accuracy::{Axis, Curve, Defaults, Family, MeasuredFamily, Point},
};

/// Width and height of a plot, pixels.
const SIZE: (u32, u32) = (900, 520);
const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(222, 222, 222);
const GREY: RGBColor = RGBColor(130, 130, 130);
/// Distinguishable with common colour vision deficiencies (Okabe and Ito 2008).
const COLORS: [RGBColor; 5] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
];
const TRUTH_LABEL: &str = "RMS error of the truth itself";
/// Font size of point labels, pixels.
const LABEL_SIZE: f64 = 11.5;

/// A plot of the curves on one scene.
pub(super) struct Plot<'a> {
    pub family: &'static Family,
    /// The curves on one scene.
    pub curves: Vec<&'a Curve>,
    /// Number of the scene in its family, from 1.
    scene_number: usize,
}

/// A plot for each scene, in the order of the curves.
pub(super) fn of_family(measured: &MeasuredFamily) -> Vec<Plot<'_>> {
    let mut out: Vec<Plot<'_>> = Vec::new();
    for curve in &measured.curves {
        let same = |plot: &&mut Plot<'_>| plot.curves.iter().any(|c| c.scene == curve.scene);
        match out.iter_mut().find(same) {
            Some(plot) => plot.curves.push(curve),
            None => {
                let scene_number = out.len() + 1;
                out.push(Plot { family: measured.family, curves: vec![curve], scene_number });
            }
        }
    }
    out
}

impl Plot<'_> {
    /// File name in the folder `images`.
    pub fn file_name(&self) -> String {
        match self.scene_number {
            1 => format!("accuracy-{}.svg", self.family.name),
            n => format!("accuracy-{}-{n}.svg", self.family.name),
        }
    }

    /// Draws the plot.
    ///
    /// # Errors
    /// When the drawing backend fails.
    pub fn svg(&self) -> Outcome<String> {
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            draw(self, &root).map_err(|e| e.to_string())?;
            root.present().map_err(|e| e.to_string())?;
        }
        Ok(svg)
    }

    fn colored(&self) -> impl Iterator<Item = (&Curve, RGBColor)> {
        self.curves.iter().copied().zip(COLORS.into_iter().cycle())
    }

    fn points(&self) -> impl Iterator<Item = (&Point, RGBColor)> {
        self.colored().flat_map(|(curve, color)| curve.points.iter().map(move |p| (p, color)))
    }

    fn axis(&self) -> Axis {
        self.curves.first().map_or(Axis::Time, |c| c.axis)
    }

    /// Coordinates of a point in the plot: cost or knob, and RMS error; `None` without a cost.
    fn position(&self, point: &Point) -> Option<(f64, f64)> {
        let x = match self.axis() {
            Axis::Time => point.cost()?.median_ms,
            Axis::Knob => point.value,
        };
        Some((x, point.error_rms))
    }

    fn truth_error(&self) -> Option<f64> {
        self.curves.iter().filter_map(|c| c.truth_error).reduce(f64::max)
    }
}

/// Range of a logarithmic axis, with a margin around the positive values; others are ignored.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let positive = values.filter(|v| *v > 0.0 && v.is_finite());
    let (low, high) = positive.fold((f64::INFINITY, 0.0), |(l, h): (f64, f64), v| (l.min(v), h.max(v)));
    if low > high { (0.1, 10.0) } else { (low / 1.5, high * 1.5) }
}

fn tick(value: &f64) -> String {
    if (1e-3..1e5).contains(value) {
        format!("{}", (value * 1e6).round() / 1e6)
    } else {
        format!("{value:.0e}")
    }
}

fn text(size: f64, color: RGBColor, anchor: HPos) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&color).pos(Pos::new(anchor, VPos::Center))
}

fn draw<'p, DB: DrawingBackend>(
    plot: &'p Plot<'p>,
    root: &DrawingArea<DB, Shift>,
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let Some(first) = plot.curves.first() else { return Ok(()) };
    root.fill(&WHITE)?;
    root.draw(&Text::new(plot.family.title, (12, 18), text(16.0, INK, HPos::Left)))?;
    root.draw(&Text::new(first.scene.as_str(), (12, 38), text(12.0, GREY, HPos::Left)))?;
    root.draw(&Text::new(format!("error (RMS), {}", first.unit), (12, 60), text(12.0, INK, HPos::Left)))?;
    if plot.axis() == Axis::Time {
        let legend =
            format!("filled: on the measured Pareto front; ringed: {}", plot.family.defaults.label());
        root.draw(&Text::new(legend, (878, 60), text(12.0, GREY, HPos::Right)))?;
    }
    let x_description = match plot.axis() {
        Axis::Time if plot.points().any(|(p, _)| p.cpu.is_some()) => {
            "median CPU time of all threads, ms; bars from the first to the third quartile"
        }
        Axis::Time => "median time, ms; bars from the first to the third quartile",
        Axis::Knob => first.knob,
    };
    let positions = || plot.points().filter_map(|(p, _)| plot.position(p));
    let (left, right) = range(positions().map(|p| p.0));
    let (low, high) = range(positions().map(|p| p.1).chain(plot.truth_error()));
    let mut chart = ChartBuilder::on(root)
        .margin_top(72)
        .margin_right(22)
        .x_label_area_size(46)
        .y_label_area_size(66)
        // Headroom for the legend, which must not cover points.
        .build_cartesian_2d((left..right).log_scale(), (low..high * 4.0).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(INK)
        .x_labels(10)
        .y_labels(8)
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .x_desc(x_description)
        .label_style(text(11.0, INK, HPos::Center))
        .axis_desc_style(text(12.0, INK, HPos::Center))
        .draw()?;
    if let Some(error) = plot.truth_error() {
        chart.draw_series(DashedLineSeries::new(
            [(left, error), (right, error)],
            6,
            4,
            GREY.stroke_width(1),
        ))?;
    }
    let mut front: Vec<(f64, f64)> =
        plot.points().filter(|(p, _)| p.is_pareto).filter_map(|(p, _)| plot.position(p)).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    chart.draw_series(LineSeries::new(front, GREY.stroke_width(2)))?;
    for (curve, color) in plot.colored() {
        for run in monotonic_runs(&curve.points) {
            let positions = run.iter().filter_map(|p| plot.position(p));
            chart.draw_series(LineSeries::new(positions, color.stroke_width(1)))?;
        }
        let series = chart.draw_series(curve.points.iter().filter_map(|p| {
            let position = plot.position(p)?;
            let (radius, filled) =
                if p.is_pareto || curve.axis == Axis::Knob { (4, true) } else { (3, false) };
            Some(Circle::new(position, radius, ShapeStyle { color: color.into(), filled, stroke_width: 1 }))
        }))?;
        series.label(curve.kernel.clone()).legend(move |(x, y)| Circle::new((x + 8, y), 4, color.filled()));
        if plot.axis() == Axis::Time {
            chart.draw_series(curve.points.iter().filter_map(|p| {
                let (cost, error) = (p.cost()?, p.error_rms);
                Some(PathElement::new([(cost.q1_ms, error), (cost.q3_ms, error)], color.stroke_width(1)))
            }))?;
        }
    }
    let rings = plot.points().filter(|(p, _)| p.is_default).filter_map(|(p, _)| plot.position(p));
    chart.draw_series(rings.map(|position| Circle::new(position, 8, INK.stroke_width(1))))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .margin(4)
        .label_font(text(12.0, INK, HPos::Left))
        .draw()?;
    let position = |p: &Point| plot.position(p).map(|position| chart.backend_coord(&position));
    for label in labels(plot, position, plot.truth_error().map(|error| chart.backend_coord(&(left, error)).1))
    {
        let anchor = if label.is_right_aligned { HPos::Right } else { HPos::Left };
        root.draw(&Text::new(label.text, label.at, text(LABEL_SIZE, label.color, anchor)))?;
    }
    Ok(())
}

/// Runs of consecutive points whose knob rises, or falls, monotonically: at least three points, or all if fewer.
fn monotonic_runs(points: &[Point]) -> impl Iterator<Item = &[Point]> {
    let min_points = points.len().clamp(2, 3);
    let direction = |w: &[Point]| w.first().zip(w.last()).and_then(|(a, b)| a.value.partial_cmp(&b.value));
    let mut start = 0;
    let mut runs = Vec::new();
    for end in 1..=points.len() {
        let own = points.get(start..(start + 2).min(points.len())).and_then(direction);
        let next = points.get(end.saturating_sub(1)..=end).and_then(direction);
        let continues = next.is_some() && next == own && next != Some(std::cmp::Ordering::Equal);
        if !continues {
            runs.extend(points.get(start..end).filter(|run| run.len() >= min_points));
            start = end;
        }
    }
    runs.into_iter()
}

/// Text beside a point.
#[derive(Clone, Debug)]
struct Label {
    text: String,
    /// Pixel at half height of the left end, or of the right end if `is_right_aligned`.
    at: (i32, i32),
    is_right_aligned: bool,
    color: RGBColor,
}

/// Pixels: left, top, right, bottom.
type Area = [i32; 4];

impl Label {
    fn area(&self) -> Area {
        // At least the average width of letters in usual fonts.
        let width = (0.54 * LABEL_SIZE * self.text.chars().count() as f64) as i32;
        let left = if self.is_right_aligned { self.at.0 - width } else { self.at.0 };
        [left, self.at.1 - 6, left + width, self.at.1 + 6]
    }
}

fn do_overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Labels of points, placed where they cover neither a point nor each other: the defaults first, then the front and the
/// ends of curves that are one monotonic run. `position` gives a point's pixel; `truth_row` is the pixel row of the
/// truth's own error.
fn labels(
    plot: &Plot<'_>,
    position: impl Fn(&Point) -> Option<(i32, i32)>,
    truth_row: Option<i32>,
) -> Vec<Label> {
    let around = |(x, y): (i32, i32)| [x - 5, y - 5, x + 5, y + 5];
    let mut occupied: Vec<Area> = plot.points().filter_map(|(p, _)| position(p)).map(around).collect();
    // The legend.
    occupied.push([600, 0, SIZE.0 as i32, 84 + 18 * plot.curves.len() as i32]);
    let mut out = Vec::new();
    let mut add_label =
        |occupied: &mut Vec<Area>, (x, y): (i32, i32), text: &str, color: RGBColor, always: bool| {
            let sides = [-12, 13, -24, 25].into_iter().flat_map(|dy| [(10, dy), (-10, dy)]);
            let mut candidates = sides.map(|(dx, dy)| Label {
                text: text.to_owned(),
                at: (x + dx, y + dy),
                is_right_aligned: dx < 0,
                color,
            });
            let is_free = |label: &Label| {
                let area = label.area();
                let is_inside = area[0] > 70 && area[2] < SIZE.0 as i32 && area[1] > 74 && area[3] < 470;
                is_inside && !occupied.iter().any(|t| do_overlap(t, &area))
            };
            let label = candidates.clone().find(is_free).or(candidates.next().filter(|_| always));
            occupied.extend(label.iter().map(Label::area));
            out.extend(label);
        };
    if let Some(y) = truth_row {
        add_label(&mut occupied, (66, y), TRUTH_LABEL, GREY, true);
        occupied.push([66, y - 2, SIZE.0 as i32, y + 2]);
    }
    let dark = |c: RGBColor| RGBColor(c.0 / 10 * 7, c.1 / 10 * 7, c.2 / 10 * 7);
    let kind = plot.family.defaults.label();
    for (point, color) in plot.points().filter(|(p, _)| p.is_default) {
        let text = match plot.family.defaults {
            Defaults::One => format!("{kind}: {}", point.setting),
            Defaults::Presets => point.setting.clone(),
        };
        if let Some(at) = position(point) {
            add_label(&mut occupied, at, &text, dark(color), true);
        }
    }
    for (curve, color) in plot.colored() {
        let is_one_run =
            monotonic_runs(&curve.points).next().is_some_and(|run| run.len() == curve.points.len());
        let last = curve.points.len().saturating_sub(1);
        for (number, point) in curve.points.iter().enumerate().filter(|(_, p)| !p.is_default) {
            let is_labelled = point.is_pareto || (is_one_run && (number == 0 || number == last));
            if let Some(at) = position(point).filter(|_| is_labelled) {
                add_label(&mut occupied, at, &point.setting, dark(color), false);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        accuracy::{FAMILIES, errors::Errors},
        clock::Timing,
    };

    fn curve(values: &[f64]) -> Curve {
        let point = |(number, value): (usize, &f64)| {
            let ms = 10.0 + number as f64;
            Point {
                setting: format!("a setting in several words, number {number}"),
                time: Timing::of(&[ms]),
                is_default: number == 2,
                is_pareto: true,
                ..Point::new(*value, &Errors::of([1.0 / ms]))
            }
        };
        Curve {
            family: "context",
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
    fn only_monotonic_runs_are_joined() {
        let runs = |values: &[f64]| -> Vec<usize> {
            monotonic_runs(&curve(values).points).map(<[Point]>::len).collect()
        };
        assert_eq!(runs(&[4.0, 2.0, 1.0, 4.0, 2.0, 1.0, 0.5]), [3, 4]);
        assert_eq!(runs(&[1.0, 2.0]), [2]);
        assert_eq!(runs(&[1.0, 1.0, 1.0]), [0; 0]);
        assert_eq!(runs(&[2.0, 1.0, 3.0, 3.0]), [0; 0]);
        assert_eq!(runs(&[1.0, 2.0, 3.0, 3.0, 3.0]), [3]);
        assert_eq!(runs(&[]), [0; 0]);
    }

    /// Points so close that not all can be labelled: the default is, and no label overlaps another or crosses the edge.
    #[test]
    fn labels_do_not_overlap() {
        let crowd = curve(&[0.0; 60]);
        let plot = Plot { family: FAMILIES[0], curves: vec![&crowd], scene_number: 1 };
        let position =
            |p: &Point| plot.position(p).map(|(x, y)| ((40.0 * x - 300.0) as i32, (4000.0 * y) as i32));
        let labels = labels(&plot, position, Some(440));
        assert!(labels.iter().any(|l| l.text.starts_with("default: ")));
        assert!(labels.len() > 4 && labels.len() < 60, "{}", labels.len());
        for (n, label) in labels.iter().enumerate() {
            let area = label.area();
            assert!(area[0] > 65 && area[2] < SIZE.0 as i32, "{label:?}");
            assert!(labels[..n].iter().all(|other| !do_overlap(&other.area(), &area)), "{label:?}");
        }
        assert!(plot.svg().unwrap().contains("number 2"));
    }
}
