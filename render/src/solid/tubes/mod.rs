//! Fibre tracts as tubes: prepared once per file of tracts, drawn with the tumour by the context view.
//!
//! A tube is a chain of capsules, one per segment, which share a ball at every joint: no bend has a gap,
//! and rays are intersected in closed form. Tubes narrower than a pixel and a half are drawn that wide, so
//! that none disappears at a distance. Lit by a headlight: brightness depends on how a place faces the viewer.
//!
//! Colours by values have a value per point, interpolated along the segment where a pixel meets it. Pipelines for them
//! are compiled only where a shown set has values.

pub(crate) mod buffers;
#[cfg(test)]
mod color_tests;
mod simplify;
mod smooth;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;
mod values;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Cancelled, Progress, TractScalar, Tracts,
    optics::{Sight, solids::Capsule},
};
use rayon::prelude::*;

use self::{
    smooth::CurvePoint,
    values::{Along, ValueKind},
};
use crate::{
    device::PassName,
    scene::{ColorMap, Rgb},
    solid::view::line_scale,
};

/// Fibre tracts as tubes.
pub(crate) const TUBES: PassName = PassName::new("tubes");
/// Merges them into the first hits of the rays.
pub(crate) const TUBES_MERGE: PassName = PassName::new("tubes_merge");

/// Colours of files of tracts, in the order of the case: muted, where masks are vivid, so that no tube is mistaken
/// for a mask (a test measures their distance).
const COLORS: [Rgb; 6] =
    [[226, 194, 130], [104, 152, 196], [172, 144, 206], [140, 164, 96], [196, 122, 104], [120, 178, 170]];

/// The colour of the `n`-th file of tracts of a case; they repeat after six.
pub fn tract_color(n: usize) -> Rgb {
    COLORS[n % COLORS.len()]
}

/// One file of fibre tracts, prepared for drawing. Compared by the identity of their `Arc`.
#[derive(Clone, Debug)]
pub struct TubeSet {
    origin_mm: DVec3,
    /// Box around the drawn points, relative to the origin; `None` without points.
    bounds: Option<(DVec3, DVec3)>,
    /// Relative to the origin.
    points: Vec<[f32; 3]>,
    /// Start of each fibre's points; the number of points at the end.
    offsets: Vec<u32>,
    /// What each point is coloured by; empty where the set has one colour.
    values: Vec<u32>,
    kind: ValueKind,
    left_out: usize,
}

/// What tubes are coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum TubeValues<'a> {
    /// Nothing: a set has one colour.
    #[default]
    Nothing,
    /// Their direction: red from left to right, green from posterior to anterior, blue from inferior to superior, each by
    /// the size of the unit tangent's component.
    Direction,
    /// A scalar of the tracts, in the colours of [`TubeLook::map`].
    Scalar(&'a TractScalar),
}

/// How a set is prepared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TubeShape<'a> {
    /// What it is coloured by.
    pub values: TubeValues<'a>,
    /// Smooth curves through the file's points instead of straight segments: the drawn line is at most this far from the
    /// curve, in millimetres; clamped to 0.001 to 10. `None`: straight segments.
    pub smooth_mm: Option<f64>,
}

/// How a set looks. Changing it costs no preparation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TubeLook {
    /// Its colour, unless its fibres are coloured by values.
    pub color: Rgb,
    /// Half the width of its tubes. Clamped to 0.01 to 100; NaN is [`TubeSet::RADIUS_MM`].
    pub radius_mm: f64,
    /// Colours of a scalar.
    pub map: ColorMap,
    /// The scalar's values at the ends of `map`, in its unit.
    pub range: [f32; 2],
}

impl TubeLook {
    /// The look of a file of this colour.
    pub fn of(color: Rgb) -> Self {
        Self { color, radius_mm: TubeSet::RADIUS_MM, map: ColorMap::Viridis, range: [0.0, 1.0] }
    }
}

/// A set, how it looks, and whether it is shown.
#[derive(Clone, Debug)]
pub struct DrawnTubes {
    /// The fibres.
    pub set: Arc<TubeSet>,
    /// Their colours and width.
    pub look: TubeLook,
    /// Whether they are drawn.
    pub shown: bool,
}

impl PartialEq for DrawnTubes {
    fn eq(&self, other: &Self) -> bool {
        let Self { set, look, shown } = self;
        Arc::ptr_eq(set, &other.set) && *look == other.look && *shown == other.shown
    }
}

impl DrawnTubes {
    /// Whether it draws anything.
    pub(crate) fn draws(&self) -> bool {
        self.shown && !self.set.points.is_empty()
    }

    /// Half the width of its tubes.
    pub(crate) fn radius_mm(&self) -> f64 {
        let radius_mm = self.look.radius_mm;
        if radius_mm.is_nan() { TubeSet::RADIUS_MM } else { radius_mm.clamp(0.01, 100.0) }
    }

    /// Its tubes, world millimetres.
    pub(crate) fn capsules(&self) -> impl Iterator<Item = Capsule> + '_ {
        let radius_mm = self.radius_mm();
        let place = |p: &[f32; 3]| self.set.origin_mm + DVec3::from_array(p.map(f64::from));
        (0..self.set.fiber_count()).flat_map(move |n| {
            let fiber = self.set.fiber(n);
            // A fibre of one point is a ball.
            let ends =
                fiber.iter().zip(fiber.iter().skip(1).chain(fiber.first().filter(|_| fiber.len() == 1)));
            ends.map(move |(a, b)| Capsule { a_mm: place(a), b_mm: place(b), radius_mm })
        })
    }

    /// Half the least width that tubes are drawn with at a place.
    pub(crate) fn least_radius_mm(sight: &Sight, at_mm: DVec3) -> f64 {
        buffers::LEAST_PX * f64::from(line_scale(sight.size)) * sight.pixel_mm(sight.depth_mm(at_mm))
    }

    /// Box around its tubes, world millimetres; `None` without points.
    pub(crate) fn bounds_mm(&self) -> Option<(DVec3, DVec3)> {
        let (low, high) = self.set.bounds?;
        let radius_mm = self.radius_mm();
        Some((low + self.set.origin_mm - radius_mm, high + self.set.origin_mm + radius_mm))
    }
}

impl TubeSet {
    /// Largest distance between a drawn fibre and the one in the file, with straight segments.
    pub const TOLERANCE_MM: f64 = 0.1;
    /// The longest segment drawn. A tube's minimum width on the screen is evaluated at a segment's middle.
    pub const LONGEST_MM: f64 = 20.0;
    /// The most points drawn of one file: 64 MB on the device, 80 with values.
    pub const MOST_POINTS: usize = 4 << 20;
    /// Half the width of a tube to begin with: about the distance between tracked fibres.
    pub const RADIUS_MM: f64 = 0.5;

    /// Prepares `tracts`. Polylines are simplified: the drawn line and the file's (or the smooth curve) are nowhere
    /// further than [`TubeSet::TOLERANCE_MM`] (or `shape.smooth_mm`) apart, and colours by values nowhere further than
    /// 2 % of full (of a direction) or 1 % of the whole range (of a scalar). Past [`TubeSet::MOST_POINTS`] only every second, third, … fibre is drawn: see
    /// [`TubeSet::left_out`]. A fibre of one point is a ball, one without points nothing.
    ///
    /// # Errors
    /// [`Cancelled`] when `progress` is cancelled.
    pub fn new(tracts: &Tracts, shape: &TubeShape<'_>, progress: &Progress) -> Result<Self, Cancelled> {
        Self::with_most(tracts, shape, Self::MOST_POINTS, progress)
    }

    fn with_most(
        tracts: &Tracts,
        shape: &TubeShape<'_>,
        most_points: usize,
        progress: &Progress,
    ) -> Result<Self, Cancelled> {
        let to_f64 = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        // Any point among the others is suitable. The centre of their box isn't: one outlier moves it far.
        let origin_mm = tracts.points_mm().get(tracts.points_mm().len() / 2).map(to_f64).unwrap_or_default();
        let fibers: Vec<PreparedFiber> = (0..tracts.fiber_count())
            .into_par_iter()
            .map(|n| {
                progress.check()?;
                let fiber: Vec<DVec3> = tracts.fiber(n).iter().map(|p| to_f64(p) - origin_mm).collect();
                let scalars = match shape.values {
                    TubeValues::Scalar(scalar) => tracts.values_along(scalar, n),
                    TubeValues::Nothing | TubeValues::Direction => Vec::new(),
                };
                Ok(prepared(&fiber, &scalars, shape))
            })
            .collect::<Result<_, Cancelled>>()?;
        let total: usize = fibers.iter().map(|fiber| fiber.places.len()).sum();
        let every = total.div_ceil(most_points.max(1)).max(1);
        let (mut points, mut offsets, mut left_out) = (Vec::new(), vec![0], 0);
        let mut values = Vec::new();
        for (n, PreparedFiber { places, values: own }) in fibers.iter().enumerate() {
            // Every n-th fibre may still have too many points.
            if n % every == 0 && points.len() + places.len() <= most_points {
                points.extend(places.iter().map(|p| p.as_vec3().to_array()));
                values.extend_from_slice(own);
            } else if !places.is_empty() {
                left_out += 1;
            }
            offsets.push(points.len() as u32);
        }
        let bounds = points.iter().map(to_f64).fold(None, |bounds: Option<(DVec3, DVec3)>, p| {
            Some(bounds.map_or((p, p), |(low, high)| (low.min(p), high.max(p))))
        });
        let kind = ValueKind::of(shape.values);
        Ok(Self { origin_mm, bounds, points, offsets, values, kind, left_out })
    }

    /// Number of fibres in the file, those without a point included.
    pub fn fiber_count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of drawn points.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Number of fibres with points that are not drawn, as the file has too many.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// The drawn points of fibre `n`, relative to [`TubeSet::origin_mm`].
    pub(crate) fn fiber(&self, n: usize) -> &[[f32; 3]] {
        match (self.offsets.get(n), self.offsets.get(n + 1)) {
            (Some(&from), Some(&to)) => self.points.get(from as usize..to as usize).unwrap_or_default(),
            _ => &[],
        }
    }

    /// Origin of its points, world millimetres: one of the points.
    pub(crate) fn origin_mm(&self) -> DVec3 {
        self.origin_mm
    }
}

/// The drawn points of a fibre, and what each is coloured by: as many, or none.
struct PreparedFiber {
    places: Vec<DVec3>,
    values: Vec<u32>,
}

/// Prepares a fibre with its scalars, one for each point, or none.
fn prepared(fiber: &[DVec3], scalars: &[f32], shape: &TubeShape<'_>) -> PreparedFiber {
    let Some(smooth_mm) = shape.smooth_mm else {
        let along = Along::new(shape.values, scalars, || tangents(fiber));
        return simplified_with(fiber, &along, TubeSet::TOLERANCE_MM);
    };
    // Half for the chain, half for its simplification.
    let half_mm = smooth_mm.clamp(0.001, 10.0) / 2.0;
    let curve = smooth::smoothed(fiber, half_mm);
    let places: Vec<DVec3> = curve.iter().map(|point| point.place).collect();
    let scalar = |point: &CurvePoint| {
        let of = |n: usize| scalars.get(n).copied().unwrap_or(f32::NAN);
        match (of(point.from), of(point.to)) {
            (_, b) if point.share >= 1.0 => b,
            (a, b) => a + (b - a) * point.share as f32,
        }
    };
    let scalars: Vec<f32> = if scalars.is_empty() { Vec::new() } else { curve.iter().map(scalar).collect() };
    let along = Along::new(shape.values, &scalars, || curve.iter().map(|point| point.tangent).collect());
    simplified_with(&places, &along, half_mm)
}

fn simplified_with(line: &[DVec3], along: &Along, tolerance_mm: f64) -> PreparedFiber {
    let fits = |from: usize, to: usize| along.fits(line, from, to);
    let kept = simplify::simplified(line, tolerance_mm, TubeSet::LONGEST_MM, fits);
    let values = kept.iter().filter_map(|kept| along.packed(kept)).collect();
    PreparedFiber { places: kept.into_iter().map(|kept| kept.place(line)).collect(), values }
}

/// Unit tangents of a polyline: of the line between a point's neighbours; zero where it has no length.
fn tangents(line: &[DVec3]) -> Vec<DVec3> {
    let along = |a: usize, b: usize| (line[b] - line[a]).try_normalize();
    let last = line.len().saturating_sub(1);
    let at = |n: usize| {
        let (before, after) = (n.saturating_sub(1), (n + 1).min(last));
        // Where the line turns back on itself, that of the segment that begins here.
        along(before, after).or_else(|| along(n, after)).or_else(|| along(before, n)).unwrap_or_default()
    };
    (0..line.len()).map(at).collect()
}

/// Position of a frame's fibre `number` in a list of drawn sets: index of the set, and of the fibre in it.
pub(crate) fn fiber_of(tubes: &[DrawnTubes], number: u32) -> Option<(usize, usize)> {
    let mut left = number as usize;
    for (at, drawn) in tubes.iter().enumerate().filter(|(_, drawn)| drawn.draws()) {
        let count = drawn.set.fiber_count();
        if left < count {
            return Some((at, left));
        }
        left -= count;
    }
    None
}
