//! Shapes on the plane of value and gradient magnitude: what a 2-D transfer function is made of.

use serde::{Deserialize, Serialize};

use super::TransferError;
use crate::scene::Rgb;

/// Standard deviations at which a blob's weight is 0.
const BLOB_REACH: f64 = 3.0;
/// Weight of a Gaussian there, which is subtracted so that the blob ends without a step.
const BLOB_REST: f64 = 0.011_108_996_538_242_306;

/// Where on the plane a shape lies. Values in image units, gradient magnitudes in image units per millimetre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// An upright rectangle.
    Box {
        /// Lowest and highest value.
        values: [f64; 2],
        /// Lowest and highest gradient magnitude, at least 0.
        gradients_per_mm: [f64; 2],
        /// Share of half the width and of half the height over which the weight rises from the border, 0 to 1; 0 makes a
        /// hard edge. The edge at gradient 0 is always hard: nothing lies beyond it.
        soft: f64,
    },
    /// Two edges across, between which the limits of the values are linear: a triangle where one of them is a point.
    Trapezoid {
        /// Gradient magnitudes of the lower and the upper edge, at least 0.
        gradients_per_mm: [f64; 2],
        /// Lowest and highest value at the lower edge.
        lower_values: [f64; 2],
        /// Lowest and highest value at the upper edge.
        upper_values: [f64; 2],
        /// As of a box.
        soft: f64,
    },
    /// A Gaussian, lowered by its weight at three standard deviations, where it ends.
    Blob {
        /// Value of the middle.
        value: f64,
        /// Gradient magnitude of the middle, at least 0.
        gradient_per_mm: f64,
        /// Standard deviation of values, above 0.
        value_deviation: f64,
        /// Standard deviation of gradient magnitudes, above 0.
        gradient_deviation_per_mm: f64,
    },
}

/// Colour and opacity of the values and gradient magnitudes within a form.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Where it lies, and how its weight falls.
    pub form: Form,
    /// Its colour.
    pub color: Rgb,
    /// Opacity of 1 mm of material whose weight is 1; 0 to 1.
    pub opacity: f64,
}

/// 1 within `low..=high`, 0 outside; within `share` of half the width from an edge it rises from 0, on sides that are
/// soft.
fn ramp(x: f64, [low, high]: [f64; 2], share: f64, soft_low: bool) -> f64 {
    if !(low <= x && x <= high) {
        return 0.0;
    }
    let across = share * 0.5 * (high - low);
    let rises = |distance: f64| if distance < across { distance / across } else { 1.0 };
    let from_low = if soft_low { rises(x - low) } else { 1.0 };
    from_low.min(rises(high - x))
}

impl Form {
    /// 0 to 1; 0 outside and where a number is NaN.
    pub fn weight(&self, value: f64, gradient_per_mm: f64) -> f64 {
        match *self {
            Self::Box { values, gradients_per_mm, soft } => {
                ramp(value, values, soft, true)
                    * ramp(gradient_per_mm, gradients_per_mm, soft, gradients_per_mm[0] > 0.0)
            }
            Self::Trapezoid { gradients_per_mm: [low, high], lower_values, upper_values, soft } => {
                let share =
                    if high > low { ((gradient_per_mm - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
                let limit = |i: usize| lower_values[i] * (1.0 - share) + upper_values[i] * share;
                ramp(value, [limit(0), limit(1)], soft, true)
                    * ramp(gradient_per_mm, [low, high], soft, low > 0.0)
            }
            Self::Blob {
                value: middle,
                gradient_per_mm: height,
                value_deviation,
                gradient_deviation_per_mm,
            } => {
                let across = (value - middle) / value_deviation;
                let up = (gradient_per_mm - height) / gradient_deviation_per_mm;
                let squared = across * across + up * up;
                if squared < BLOB_REACH * BLOB_REACH {
                    ((-0.5 * squared).exp() - BLOB_REST) / (1.0 - BLOB_REST)
                } else {
                    0.0
                }
            }
        }
    }

    /// Lowest and highest value of the form, and lowest and highest gradient magnitude (at least 0).
    pub fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        match *self {
            Self::Box { values, gradients_per_mm, .. } => (values, gradients_per_mm),
            Self::Trapezoid { gradients_per_mm, lower_values: [a, b], upper_values: [c, d], .. } => {
                ([a.min(c), b.max(d)], gradients_per_mm)
            }
            Self::Blob { value, gradient_per_mm, value_deviation, gradient_deviation_per_mm } => {
                let (across, up) = (BLOB_REACH * value_deviation, BLOB_REACH * gradient_deviation_per_mm);
                ([value - across, value + across], [(gradient_per_mm - up).max(0.0), gradient_per_mm + up])
            }
        }
    }

    /// The form moved as a whole; gradient magnitudes stay at least 0, sizes stay.
    #[must_use]
    pub fn moved(&self, by_value: f64, by_gradient_per_mm: f64) -> Self {
        let both = |[low, high]: [f64; 2], by: f64| [low + by, high + by];
        match *self {
            Self::Box { values, gradients_per_mm, soft } => {
                let up = by_gradient_per_mm.max(-gradients_per_mm[0]);
                let gradients_per_mm = both(gradients_per_mm, up);
                Self::Box { values: both(values, by_value), gradients_per_mm, soft }
            }
            Self::Trapezoid { gradients_per_mm, lower_values, upper_values, soft } => Self::Trapezoid {
                gradients_per_mm: both(gradients_per_mm, by_gradient_per_mm.max(-gradients_per_mm[0])),
                lower_values: both(lower_values, by_value),
                upper_values: both(upper_values, by_value),
                soft,
            },
            Self::Blob { value, gradient_per_mm, value_deviation, gradient_deviation_per_mm } => Self::Blob {
                value: value + by_value,
                gradient_per_mm: (gradient_per_mm + by_gradient_per_mm).max(0.0),
                value_deviation,
                gradient_deviation_per_mm,
            },
        }
    }

    /// Points by which the form is reshaped, as value and gradient magnitude: the corners of a box and of a trapezoid
    /// (lower left, lower right, upper left, upper right), a blob's ends of one standard deviation to the right and up.
    pub fn handles(&self) -> Vec<[f64; 2]> {
        match *self {
            Self::Box { values: [left, right], gradients_per_mm: [low, high], .. } => {
                vec![[left, low], [right, low], [left, high], [right, high]]
            }
            Self::Trapezoid { gradients_per_mm: [low, high], lower_values, upper_values, .. } => {
                let [[a, b], [c, d]] = [lower_values, upper_values];
                vec![[a, low], [b, low], [c, high], [d, high]]
            }
            Self::Blob { value, gradient_per_mm, value_deviation, gradient_deviation_per_mm } => vec![
                [value + value_deviation, gradient_per_mm],
                [value, gradient_per_mm + gradient_deviation_per_mm],
            ],
        }
    }

    /// The form with handle `number` of [`Form::handles`] at `to`, as far as the form allows: edges don't cross,
    /// gradient magnitudes stay at least 0, a blob keeps a thousandth of its width. Unchanged for a number past the
    /// last, and where `to` is not finite.
    #[must_use]
    pub fn reshaped(&self, number: usize, to: [f64; 2]) -> Self {
        if !to.iter().all(|x| x.is_finite()) {
            return *self;
        }
        let [value, gradient] = [to[0], to[1].max(0.0)];
        let (right, upper) = (number % 2 == 1, number >= 2);
        let pair = |mut pair: [f64; 2], second: bool, to: f64| {
            pair[usize::from(second)] = if second { to.max(pair[0]) } else { to.min(pair[1]) };
            pair
        };
        match *self {
            Self::Box { values, gradients_per_mm, soft } if number < 4 => Self::Box {
                values: pair(values, right, value),
                gradients_per_mm: pair(gradients_per_mm, upper, gradient),
                soft,
            },
            Self::Trapezoid { gradients_per_mm, lower_values, upper_values, soft } if number < 4 => {
                let edge = |values: [f64; 2], is_upper: bool| {
                    if upper == is_upper { pair(values, right, value) } else { values }
                };
                Self::Trapezoid {
                    gradients_per_mm: pair(gradients_per_mm, upper, gradient),
                    lower_values: edge(lower_values, false),
                    upper_values: edge(upper_values, true),
                    soft,
                }
            }
            Self::Blob { value: middle, gradient_per_mm, value_deviation, gradient_deviation_per_mm }
                if number < 2 =>
            {
                let wide = (value - middle).max(1e-3 * value_deviation);
                let high = (gradient - gradient_per_mm).max(1e-3 * gradient_deviation_per_mm);
                Self::Blob {
                    value: middle,
                    gradient_per_mm,
                    value_deviation: if number == 0 { wide } else { value_deviation },
                    gradient_deviation_per_mm: if number == 1 { high } else { gradient_deviation_per_mm },
                }
            }
            other => other,
        }
    }
}

impl Shape {
    /// Checks that every number is finite and in its range; `number` is the shape's, from 0, for the error.
    pub(super) fn check(&self, number: usize) -> Result<(), TransferError> {
        let wrong = |what, found, expected| Err(TransferError::Shape { what, number, found, expected });
        let rising = |what, [low, high]: [f64; 2]| match (low.is_finite(), high.is_finite()) {
            (false, _) => wrong(what, low, "a finite number"),
            (_, false) => wrong(what, high, "a finite number"),
            _ if high < low => wrong(what, high, "rising ones"),
            _ => Ok(()),
        };
        let gradients = |gradients: [f64; 2]| {
            rising("gradients_per_mm", gradients)?;
            if gradients[0] < 0.0 { wrong("gradients_per_mm", gradients[0], "at least 0") } else { Ok(()) }
        };
        let share = |what, found: f64| {
            if (0.0..=1.0).contains(&found) { Ok(()) } else { wrong(what, found, "0 to 1") }
        };
        match self.form {
            Form::Box { values, gradients_per_mm, soft } => {
                rising("values", values)?;
                gradients(gradients_per_mm)?;
                share("soft", soft)?;
            }
            Form::Trapezoid { gradients_per_mm, lower_values, upper_values, soft } => {
                gradients(gradients_per_mm)?;
                rising("lower_values", lower_values)?;
                rising("upper_values", upper_values)?;
                share("soft", soft)?;
            }
            Form::Blob { value, gradient_per_mm, value_deviation, gradient_deviation_per_mm } => {
                if !value.is_finite() {
                    return wrong("value", value, "a finite number");
                }
                if !(gradient_per_mm.is_finite() && gradient_per_mm >= 0.0) {
                    return wrong("gradient_per_mm", gradient_per_mm, "a finite number of at least 0");
                }
                for (what, found) in [
                    ("value_deviation", value_deviation),
                    ("gradient_deviation_per_mm", gradient_deviation_per_mm),
                ] {
                    if !(found.is_finite() && found > 0.0) {
                        return wrong(what, found, "a finite number above 0");
                    }
                }
            }
        }
        share("opacity", self.opacity)
    }
}

/// Colour (0 to 1, gamma-encoded sRGB) and opacity of 1 mm where shapes lie over each other: as of materials that fill
/// the same space, extinctions add and the colour is the mean by opacity. Their order is without effect.
pub(super) fn sample(shapes: &[Shape], value: f64, gradient_per_mm: f64) -> ([f64; 3], f64) {
    let (mut color, mut weights, mut transparency) = ([0.0; 3], 0.0, 1.0);
    for shape in shapes {
        let opacity = shape.opacity * shape.form.weight(value, gradient_per_mm);
        for (sum, channel) in color.iter_mut().zip(shape.color) {
            *sum += opacity * f64::from(channel) / 255.0;
        }
        weights += opacity;
        transparency *= 1.0 - opacity;
    }
    if weights > 0.0 { (color.map(|c| c / weights), 1.0 - transparency) } else { ([0.0; 3], 0.0) }
}
