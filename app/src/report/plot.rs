//! Diagrams of values over time as lines and words, drawn alike in HTML and PDF.

use std::fmt::Write as _;

use crate::format::hex;

/// Size of a plot.
const SIZE_PT: [f64; 2] = [520.0, 230.0];
/// Room left for the axes' numbers: left, top, right, bottom.
const MARGINS_PT: [f64; 4] = [52.0, 12.0, 110.0, 28.0];
/// Height of words.
pub const TEXT_PT: f64 = 9.0;
/// Ticks of the vertical axis, about.
const TICKS: f64 = 5.0;

/// A line through values at dates.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// Its colour, sRGB.
    pub color: [u8; 3],
    /// Its value at each date; `None`: unknown.
    pub values: Vec<Option<f64>>,
}

/// How a word lies at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A part of a plot; positions in points from the upper left corner.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line.
    Line {
        /// Its points.
        points: Vec<[f64; 2]>,
        /// Its colour, sRGB.
        color: [u8; 3],
        /// Its width.
        width_pt: f64,
    },
    /// A filled polygon.
    Area {
        /// Its corners.
        points: Vec<[f64; 2]>,
        /// Its colour, sRGB.
        color: [u8; 3],
    },
    /// A filled circle.
    Dot {
        /// Its centre.
        at: [f64; 2],
        /// Its colour, sRGB.
        color: [u8; 3],
    },
    /// A word on its base line.
    Word {
        /// Where it is.
        at: [f64; 2],
        /// How it lies there.
        anchor: Anchor,
        /// The word.
        text: String,
        /// Its colour, sRGB.
        color: [u8; 3],
    },
}

/// Radius of dots.
pub const DOT_PT: f64 = 2.6;
const INK: [u8; 3] = [60, 64, 67];
const GRID: [u8; 3] = [224, 226, 229];

/// A diagram.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// What it shows, for those who can't see it.
    pub caption: String,
    /// Width and height.
    pub size_pt: [f64; 2],
    /// Its parts, from back to front.
    pub shapes: Vec<Shape>,
}

impl Plot {
    /// Values over dates. `at`: the place of each date on the axis, increasing; `labels`: their names. `number` formats the
    /// numbers of the vertical axis, which begins at zero. `None` without a known value.
    pub fn over_time(
        caption: String,
        at: &[f64],
        labels: &[String],
        series: &[Series],
        number: &dyn Fn(f64) -> String,
    ) -> Option<Self> {
        let values = series.iter().flat_map(|s| s.values.iter().flatten().copied());
        let most = values.filter(|v| v.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        let (first, last) = (*at.first()?, *at.last()?);
        if !most.is_finite() {
            return None;
        }
        let step = tick_step(most.max(1e-9));
        let top = (most / step).ceil().max(1.0) * step;
        let [left, above, right, below] = MARGINS_PT;
        let (width, height) = (SIZE_PT[0] - left - right, SIZE_PT[1] - above - below);
        let x = |t: f64| left + if last > first { (t - first) / (last - first) * width } else { width / 2.0 };
        let y = |v: f64| above + (1.0 - v / top) * height;
        let mut shapes = Vec::new();
        for n in 0..=((top / step).round() as usize) {
            let value = n as f64 * step;
            let points = vec![[left, y(value)], [left + width, y(value)]];
            let color = if n == 0 { INK } else { GRID };
            shapes.push(Shape::Line { points, color, width_pt: 0.7 });
            shapes.push(Shape::Word {
                at: [left - 6.0, y(value) + TEXT_PT * 0.35],
                anchor: Anchor::End,
                text: number(value),
                color: INK,
            });
        }
        shapes.extend(date_words(&at.iter().map(|t| x(*t)).collect::<Vec<_>>(), labels, SIZE_PT[1] - 10.0));
        for one in series {
            let known = at.iter().zip(&one.values).filter_map(|(t, v)| v.map(|v| [x(*t), y(v)]));
            let points: Vec<[f64; 2]> = known.collect();
            shapes.push(Shape::Line { points: points.clone(), color: one.color, width_pt: 1.8 });
            shapes.extend(points.into_iter().map(|at| Shape::Dot { at, color: one.color }));
        }
        shapes.extend(names(series, left + width + 8.0, &y, [above, above + height]));
        Some(Self { caption, size_pt: SIZE_PT, shapes })
    }

    /// The plot as SVG.
    pub fn svg(&self) -> String {
        let [width, height] = self.size_pt;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">",
            escaped(&self.caption)
        );
        for shape in &self.shapes {
            // Writing into a string can't fail.
            let _ = match shape {
                Shape::Area { points, color } => {
                    let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
                    write!(out, "<polygon points=\"{}\" fill=\"{}\"/>", points.join(" "), hex(*color))
                }
                Shape::Line { points, color, width_pt } => {
                    let points: Vec<String> = points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect();
                    write!(
                        out,
                        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width_pt}\" stroke-linejoin=\"round\"/>",
                        points.join(" "),
                        hex(*color)
                    )
                }
                Shape::Dot { at: [x, y], color } => {
                    write!(
                        out,
                        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{DOT_PT}\" fill=\"{}\"/>",
                        hex(*color)
                    )
                }
                Shape::Word { at: [x, y], anchor, text, color } => {
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    write!(
                        out,
                        "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{TEXT_PT}\" text-anchor=\"{anchor}\" fill=\"{}\">{}</text>",
                        hex(*color),
                        escaped(text)
                    )
                }
            };
        }
        out + "</svg>"
    }
}

/// The dates below the axis, those left out that would touch the one before.
fn date_words(x: &[f64], labels: &[String], y: f64) -> Vec<Shape> {
    let mut free_from = f64::NEG_INFINITY;
    let mut out = Vec::new();
    for (x, label) in x.iter().zip(labels) {
        // About half a height per letter.
        let half = label.chars().count() as f64 * TEXT_PT * 0.28;
        if x - half < free_from {
            continue;
        }
        free_from = x + half + 6.0;
        out.push(Shape::Word { at: [*x, y], anchor: Anchor::Middle, text: label.clone(), color: INK });
    }
    out
}

/// Names of the lines beside their ends, moved apart where they would touch.
fn names(series: &[Series], x: f64, y: &dyn Fn(f64) -> f64, [top, bottom]: [f64; 2]) -> Vec<Shape> {
    let mut ends: Vec<(f64, &Series)> = series
        .iter()
        .filter_map(|s| Some((y(s.values.iter().rev().flatten().next().copied()?), s)))
        .collect();
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let gap = TEXT_PT * 1.25;
    let lowest = bottom - gap * ends.len().saturating_sub(1) as f64;
    let mut next = top.min(lowest);
    ends.into_iter()
        .enumerate()
        .map(|(n, (at, one))| {
            let place = at.max(next).min(lowest + gap * n as f64);
            next = place + gap;
            let text = shortened(&one.name, 20);
            Shape::Word {
                at: [x, place + TEXT_PT * 0.35],
                anchor: Anchor::Start,
                text,
                color: dark(one.color),
            }
        })
        .collect()
}

/// A colour that can be read as text on white: the same hue, no lighter than a luminance of 0.3.
fn dark(color: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = color.map(f64::from);
    let light = (0.299 * r + 0.587 * g + 0.114 * b) / 255.0;
    let share = (0.42 / light.max(1e-3)).min(1.0);
    [r, g, b].map(|c| (c * share).round() as u8)
}

/// A text of at most so many letters, at least 1.
pub fn shortened(text: &str, letters: usize) -> String {
    if text.chars().count() <= letters {
        return text.to_owned();
    }
    format!("{}…", text.chars().take(letters - 1).collect::<String>())
}

/// Distance of ticks: 1, 2 or 5 times a power of ten.
fn tick_step(most: f64) -> f64 {
    let raw = most / TICKS;
    let decade = 10_f64.powf(raw.log10().floor());
    [1.0, 2.0, 5.0].map(|f| f * decade).into_iter().find(|step| *step >= raw * 0.999).unwrap_or(10.0 * decade)
}

/// Text for XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(values: &[Option<f64>]) -> Option<Plot> {
        let at: Vec<f64> = (0..values.len()).map(|n| n as f64).collect();
        let labels: Vec<String> = at.iter().map(|n| format!("day {n}")).collect();
        let series = [Series { name: "a < b".into(), color: [255, 255, 0], values: values.to_vec() }];
        Plot::over_time("volumes".into(), &at, &labels, &series, &|v| format!("{v}"))
    }

    #[test]
    fn values_lie_where_they_should() {
        let plot = plot(&[Some(0.0), Some(10.0), Some(5.0)]).unwrap();
        let line = plot.shapes.iter().find_map(|shape| match shape {
            Shape::Line { points, width_pt, .. } if *width_pt > 1.0 => Some(points.clone()),
            _ => None,
        });
        let points = line.unwrap();
        assert_eq!(points.len(), 3);
        assert!((points[1][0] - (points[0][0] + points[2][0]) / 2.0).abs() < 1e-9, "dates are evenly spaced");
        assert!((points[2][1] - (points[0][1] + points[1][1]) / 2.0).abs() < 1e-9, "5 is between 0 and 10");
        assert!(points[1][1] < points[0][1], "up is more");
        let svg = plot.svg();
        assert!(svg.contains("a &lt; b") && !svg.contains("a < b"), "{svg}");
    }

    #[test]
    fn unknown_values_are_left_out() {
        assert_eq!(plot(&[None, None]), None);
        let plot = plot(&[Some(1.0), None, Some(f64::MIN_POSITIVE)]).unwrap();
        assert_eq!(plot.shapes.iter().filter(|s| matches!(s, Shape::Dot { .. })).count(), 2);
    }

    #[test]
    fn names_do_not_touch() {
        let series: Vec<Series> = (0..9)
            .map(|n| Series {
                name: format!("mask {n}"),
                color: [0, 0, 0],
                values: vec![Some(1.0), Some(1.0)],
            })
            .collect();
        let labels = ["a".to_owned(), "b".to_owned()];
        let plot = Plot::over_time(String::new(), &[0.0, 1.0], &labels, &series, &|v| v.to_string()).unwrap();
        let mut ends: Vec<f64> = plot
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Word { at, anchor: Anchor::Start, .. } => Some(at[1]),
                _ => None,
            })
            .collect();
        ends.sort_by(f64::total_cmp);
        assert!(ends.windows(2).all(|pair| pair[1] - pair[0] > TEXT_PT), "{ends:?}");
        assert!(ends.iter().all(|y| (0.0..SIZE_PT[1]).contains(y)), "{ends:?}");
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!([10.0, 47.0, 0.3, 1234.0].map(tick_step), [2.0, 10.0, 0.1, 500.0]);
    }
}
