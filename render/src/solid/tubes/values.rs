//! What tubes are coloured by: one word per drawn point.

use glam::DVec3;

use super::{
    TubeValues,
    simplify::{Kept, share_along},
};

/// Largest deviation of a simplified fibre's colours: of a component of the direction's colour (1 is full), and of a scalar
/// as a share of its whole range.
pub(crate) const TOLERANCES: [f64; 2] = [0.02, 0.01];

/// A scalar that a point lacks, as in tubes/merge: beyond every other.
pub(crate) const MISSING: f32 = 3e38;
/// Scalars are clamped to this size.
const LARGEST: f32 = 1e37;

/// What the words of a set are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueKind {
    Nothing,
    /// Red, green, blue; the highest byte is 0 where there is no direction.
    Direction,
    /// A scalar as a 32-bit float.
    Scalar,
}

impl ValueKind {
    pub fn of(values: TubeValues<'_>) -> Self {
        match values {
            TubeValues::Nothing => Self::Nothing,
            TubeValues::Direction => Self::Direction,
            TubeValues::Scalar(_) => Self::Scalar,
        }
    }
}

/// Values along a fibre.
pub(super) struct Along {
    kind: ValueKind,
    /// Of each point: the direction's colour, or the scalar in its first component; `None` where there is none.
    values: Vec<Option<DVec3>>,
    tolerance: f64,
}

impl Along {
    /// `scalars` and what `tangents` returns: one for each point, where they are needed.
    pub fn new(values: TubeValues<'_>, scalars: &[f32], tangents: impl FnOnce() -> Vec<DVec3>) -> Self {
        let kind = ValueKind::of(values);
        let [of_direction, of_range] = TOLERANCES;
        let (values, tolerance) = match values {
            TubeValues::Nothing => (Vec::new(), 0.0),
            TubeValues::Direction => {
                let color = |d: DVec3| (d != DVec3::ZERO).then(|| d.abs());
                (tangents().into_iter().map(color).collect(), of_direction)
            }
            TubeValues::Scalar(scalar) => {
                let width = scalar.range().map_or(0.0, |[low, high]| f64::from(high) - f64::from(low));
                let value = |v: &f32| v.is_finite().then(|| DVec3::X * f64::from(v.clamp(-LARGEST, LARGEST)));
                (scalars.iter().map(value).collect(), of_range * width)
            }
        };
        Self { kind, values, tolerance }
    }

    /// Whether a straight segment between two points has the values of those between, to within the tolerance.
    pub fn fits(&self, line: &[DVec3], from: usize, to: usize) -> bool {
        if self.kind == ValueKind::Nothing {
            return true;
        }
        let (a, b) = (self.values[from], self.values[to]);
        self.values[from + 1..to].iter().zip(&line[from + 1..to]).all(|(value, &place)| match (a, b, value) {
            (Some(a), Some(b), Some(value)) => {
                let own = a.lerp(b, share_along(place, line[from], line[to]));
                (own - *value).abs().max_element() <= self.tolerance
            }
            (None, None, None) => true,
            _ => false,
        })
    }

    /// The word of a drawn point; `None` where points have none.
    pub fn packed(&self, kept: &Kept) -> Option<u32> {
        let Kept { from, to, share } = *kept;
        let of = |n: usize| self.values.get(n).copied().flatten();
        let value = match (of(from), of(to)) {
            (Some(a), Some(b)) => Some(a.lerp(b, share)),
            _ => None,
        };
        match self.kind {
            ValueKind::Nothing => None,
            ValueKind::Direction => Some(value.map_or(0, |color| {
                let [r, g, b] = color.to_array().map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u32);
                r | g << 8 | b << 16 | 0xff00_0000
            })),
            ValueKind::Scalar => Some(value.map_or(MISSING, |v| v.x as f32).to_bits()),
        }
    }
}
