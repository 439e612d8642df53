//! Transfer functions of the context view: colour and opacity of each value (thesis 7.3.2).
//!
//! 1-D: points over values, whose opacity a factor may scale by gradient magnitude. 2-D: shapes over values and gradient
//! magnitudes. Uses no device and no window. Values are in the image's own units, gradients in these per
//! millimetre, opacities per millimetre of material.

mod histogram;
mod preset;
mod shape;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub use histogram::{GradientHistogram, ValueHistogram};
pub use preset::TransferPreset;
pub use shape::{Form, Shape};

use crate::scene::Rgb;

/// Colour and opacity of one value; linear between neighbours, constant beyond the first and the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControlPoint {
    /// Image value. Finite.
    pub value: f64,
    /// Colour there.
    pub color: Rgb,
    /// Opacity of 1 mm of this material, 0 to 1.
    pub opacity: f64,
}

/// Factor of the opacity at a gradient magnitude; linear between neighbours, constant beyond the first
/// and the last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GradientPoint {
    /// Image units per millimetre. Finite, at least 0.
    pub gradient: f64,
    /// Factor of the opacity, 0 to 1.
    pub factor: f64,
}

/// An invalid transfer function.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransferError {
    /// Too few control points.
    #[error("transfer function: found {found} {what}, expected at least 2")]
    Few {
        /// What there are too few of.
        what: &'static str,
        /// How many there are.
        found: usize,
    },
    /// NaN, infinity, or out of its range.
    #[error("transfer function: found {found} as {what} of point {number}, expected {expected}")]
    Number {
        /// Which number.
        what: &'static str,
        /// Index of the point, from 0.
        number: usize,
        /// The invalid number.
        found: f64,
        /// The valid range.
        expected: &'static str,
    },
    /// A number of a shape is NaN, infinite, or out of its range.
    #[error("transfer function: found {found} as {what} of shape {number}, expected {expected}")]
    Shape {
        /// Which number.
        what: &'static str,
        /// Index of the shape, from 0.
        number: usize,
        /// The invalid number.
        found: f64,
        /// The valid range.
        expected: &'static str,
    },
    /// Too many shapes.
    #[error("transfer function: found {found} shapes, expected at most {}", TransferFunction::MOST_SHAPES)]
    Many {
        /// How many there are.
        found: usize,
    },
    /// A point is below its predecessor.
    #[error(
        "transfer function: found {found} as {what} of point {number} after {before}, expected rising ones"
    )]
    Order {
        /// Which number.
        what: &'static str,
        /// Index of the point, from 0.
        number: usize,
        /// Its number.
        found: f64,
        /// The number of the point before.
        before: f64,
    },
}

/// Colour and opacity of values, piecewise linear; or with shapes, of values and gradient magnitudes, the points then
/// being kept without effect. Valid by construction: at least two control points, in ascending order (equal values make a
/// step), every number finite and in its range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct TransferFunction {
    points: Vec<ControlPoint>,
    gradient: Option<Vec<GradientPoint>>,
    shapes: Option<Vec<Shape>>,
}

/// As deserialized, not yet checked.
#[derive(Deserialize)]
struct Stored {
    /// May be absent where there are shapes.
    #[serde(default)]
    points: Vec<ControlPoint>,
    #[serde(default)]
    gradient: Option<Vec<GradientPoint>>,
    #[serde(default)]
    shapes: Option<Vec<Shape>>,
}

impl TryFrom<Stored> for TransferFunction {
    type Error = TransferError;

    fn try_from(stored: Stored) -> Result<Self, TransferError> {
        let absent = stored.points.is_empty() && stored.shapes.is_some();
        let points = if absent { Self::transparent().points } else { stored.points };
        let mut transfer = Self::new(points, stored.gradient)?;
        transfer.set_shapes(stored.shapes)?;
        Ok(transfer)
    }
}

/// Position of `x` among ascending `at(0..n)`: the two neighbours and the weight of the upper one.
fn place(n: usize, at: impl Fn(usize) -> f64, x: f64) -> (usize, usize, f64) {
    let (mut low, mut high) = (0, n);
    // The first that is above x.
    while low < high {
        let middle = usize::midpoint(low, high);
        if at(middle) <= x {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    match low {
        0 => (0, 0, 0.0),
        _ if low == n => (n - 1, n - 1, 0.0),
        // Halved, so that the difference doesn't overflow f64.
        _ => {
            let (a, b) = (at(low - 1), at(low));
            (low - 1, low, (x / 2.0 - a / 2.0) / (b / 2.0 - a / 2.0))
        }
    }
}

fn check_ascending(what: &'static str, values: impl Iterator<Item = f64>) -> Result<(), TransferError> {
    let mut before = f64::NEG_INFINITY;
    for (number, found) in values.enumerate() {
        if !found.is_finite() {
            return Err(TransferError::Number { what, number, found, expected: "a finite number" });
        }
        if found < before {
            return Err(TransferError::Order { what, number, found, before });
        }
        before = found;
    }
    Ok(())
}

fn check_fractions(what: &'static str, values: impl Iterator<Item = f64>) -> Result<(), TransferError> {
    for (number, found) in values.enumerate() {
        if !(0.0..=1.0).contains(&found) {
            return Err(TransferError::Number { what, number, found, expected: "0 to 1" });
        }
    }
    Ok(())
}

impl TransferFunction {
    /// The most shapes of a function.
    pub const MOST_SHAPES: usize = 64;

    /// A function through `points`, without shapes; `gradient` scales the opacity by gradient magnitude, with `None` it
    /// doesn't depend on that (and it isn't computed).
    ///
    /// # Errors
    /// [`TransferError`] for fewer than two points, descending values, and numbers not finite or out of
    /// their range.
    pub fn new(
        points: Vec<ControlPoint>,
        gradient: Option<Vec<GradientPoint>>,
    ) -> Result<Self, TransferError> {
        if points.len() < 2 {
            return Err(TransferError::Few { what: "control points", found: points.len() });
        }
        check_ascending("value", points.iter().map(|p| p.value))?;
        check_fractions("opacity", points.iter().map(|p| p.opacity))?;
        check_gradient(gradient.as_deref())?;
        Ok(Self { points, gradient, shapes: None })
    }

    /// The transparent function, of a scene without an image.
    pub fn transparent() -> Self {
        let point = |value| ControlPoint { value, color: [0; 3], opacity: 0.0 };
        Self { points: vec![point(0.0), point(1.0)], gradient: None, shapes: None }
    }

    /// The control points, in ascending order; at least two.
    pub fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    /// The points over gradient magnitude; `None` where these have no effect on the points' opacity.
    pub fn gradient(&self) -> Option<&[GradientPoint]> {
        self.gradient.as_deref()
    }

    /// The shapes over values and gradient magnitudes; `None` where the points count. Without a single shape everything
    /// is transparent.
    pub fn shapes(&self) -> Option<&[Shape]> {
        self.shapes.as_deref()
    }

    /// Replaces the shapes; with `None` the points count. Unchanged after an error.
    ///
    /// # Errors
    /// [`TransferError`] for more than [`TransferFunction::MOST_SHAPES`], and numbers not finite or out of their range.
    pub fn set_shapes(&mut self, shapes: Option<Vec<Shape>>) -> Result<(), TransferError> {
        let list = shapes.as_deref().unwrap_or_default();
        if list.len() > Self::MOST_SHAPES {
            return Err(TransferError::Many { found: list.len() });
        }
        list.iter().enumerate().try_for_each(|(number, shape)| shape.check(number))?;
        self.shapes = shapes;
        Ok(())
    }

    /// Whether anything depends on gradient magnitudes: by shapes or by a factor.
    pub fn uses_gradient(&self) -> bool {
        self.shapes.is_some() || self.gradient.is_some()
    }

    /// Sets the factor over gradient magnitude of the points' opacity, none with `None`. Unchanged after an error.
    ///
    /// # Errors
    /// As [`TransferFunction::new`].
    pub fn set_gradient(&mut self, gradient: Option<Vec<GradientPoint>>) -> Result<(), TransferError> {
        check_gradient(gradient.as_deref())?;
        self.gradient = gradient;
        Ok(())
    }

    /// Changes point `number`: its value is clamped to its neighbours', its opacity to 0 to 1; NaN leaves a
    /// number unchanged. Does nothing past the last point.
    pub fn set_point(&mut self, number: usize, to: ControlPoint) {
        let low = number.checked_sub(1).and_then(|n| self.points.get(n)).map_or(f64::MIN, |p| p.value);
        let high = self.points.get(number + 1).map_or(f64::MAX, |p| p.value);
        if let Some(point) = self.points.get_mut(number) {
            point.color = to.color;
            if !to.value.is_nan() {
                point.value = to.value.clamp(low, high);
            }
            if !to.opacity.is_nan() {
                point.opacity = to.opacity.clamp(0.0, 1.0);
            }
        }
    }

    /// Inserts a point at `value` with the function's colour and opacity there, which changes the function only by
    /// rounding; returns its index. `None` for a value that isn't finite.
    pub fn add_point(&mut self, value: f64) -> Option<usize> {
        if !value.is_finite() {
            return None;
        }
        let (color, opacity) = self.opacity_at(value);
        let number = self.points.partition_point(|p| p.value <= value);
        let color = color.map(|c| (c * 255.0).round() as u8);
        self.points.insert(number, ControlPoint { value, color, opacity });
        Some(number)
    }

    /// Removes point `number` and returns whether it did. Two points always remain.
    pub fn remove_point(&mut self, number: usize) -> bool {
        let removes = self.points.len() > 2 && number < self.points.len();
        if removes {
            self.points.remove(number);
        }
        removes
    }

    /// Whether the opacity is 0 everywhere.
    pub fn is_transparent(&self) -> bool {
        if let Some(shapes) = &self.shapes {
            return shapes.iter().all(|shape| shape.opacity == 0.0);
        }
        self.points.iter().all(|p| p.opacity == 0.0)
            || self.gradient.as_ref().is_some_and(|g| g.iter().all(|p| p.factor == 0.0))
    }

    /// Colour (0 to 1, gamma-encoded sRGB) and opacity of 1 mm that the points have at a value, whatever the gradient.
    pub(crate) fn opacity_at(&self, value: f64) -> ([f64; 3], f64) {
        let (a, b, w) = place(self.points.len(), |i| self.points[i].value, value);
        let (a, b) = (&self.points[a], &self.points[b]);
        let mix = |x: f64, y: f64| x * (1.0 - w) + y * w;
        let color = std::array::from_fn(|i| mix(f64::from(a.color[i]), f64::from(b.color[i])) / 255.0);
        (color, mix(a.opacity, b.opacity))
    }

    /// Factor of the points' opacity at a gradient magnitude; 1 without any.
    pub fn gradient_factor(&self, gradient: f64) -> f64 {
        let Some(points) = &self.gradient else { return 1.0 };
        if gradient.is_nan() {
            return 0.0;
        }
        let (a, b, w) = place(points.len(), |i| points[i].gradient, gradient);
        points[a].factor * (1.0 - w) + points[b].factor * w
    }

    /// Colour (0 to 1, gamma-encoded sRGB) and opacity of 1 mm of material with this value and
    /// gradient magnitude. A value that is NaN or infinite is transparent.
    pub fn sample(&self, value: f64, gradient: f64) -> ([f64; 3], f64) {
        if !value.is_finite() {
            return ([0.0; 3], 0.0);
        }
        if let Some(shapes) = &self.shapes {
            return shape::sample(shapes, value, gradient);
        }
        let (color, opacity) = self.opacity_at(value);
        (color, opacity * self.gradient_factor(gradient))
    }

    /// The largest opacity of the points (before the gradient's factor) of any value in `low..=high`: the maximum over
    /// the ends and the control points between, exact as the function is linear between these. 0 for
    /// an empty range.
    pub fn max_opacity(&self, low: f64, high: f64) -> f64 {
        if low.is_nan() || high.is_nan() || low > high {
            return 0.0;
        }
        let first = self.points.partition_point(|p| p.value < low);
        self.points[first..]
            .iter()
            .take_while(|p| p.value <= high)
            .map(|p| p.opacity)
            .fold(self.opacity_at(low).1.max(self.opacity_at(high).1), f64::max)
    }

    /// Opacity of `length_mm` of a material of which 1 mm has opacity `per_mm`:
    /// 1 − (1 − `per_mm`)^length. A material opaque at 1 mm is so at any length above 0.
    pub fn opacity_over(per_mm: f64, length_mm: f64) -> f64 {
        if length_mm <= 0.0 {
            0.0
        } else if per_mm >= 1.0 {
            1.0
        } else {
            -(length_mm * (-per_mm).ln_1p()).exp_m1()
        }
    }
}

fn check_gradient(gradient: Option<&[GradientPoint]>) -> Result<(), TransferError> {
    let Some(points) = gradient else { return Ok(()) };
    if points.len() < 2 {
        return Err(TransferError::Few { what: "gradient points", found: points.len() });
    }
    check_ascending("gradient", points.iter().map(|p| p.gradient))?;
    if let Some(p) = points.first().filter(|p| p.gradient < 0.0) {
        return Err(TransferError::Number {
            what: "gradient",
            number: 0,
            found: p.gradient,
            expected: "at least 0",
        });
    }
    check_fractions("factor", points.iter().map(|p| p.factor))
}
