//! Fibre tracts as tubes: prepared once per file of tracts, drawn with the tumour by the context view.
//!
//! A tube is a chain of capsules, one per segment, which share a ball at every joint: no bend has a gap,
//! and rays are intersected in closed form. Tubes narrower than a pixel and a half are drawn that wide, so
//! that none disappears at a distance. Lit by a headlight: brightness depends on how a place faces the viewer.

pub(crate) mod buffers;
mod simplify;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{Cancelled, Progress, Tracts};
use rayon::prelude::*;

use crate::{device::PassName, scene::Rgb};

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
    color: Rgb,
    radius_mm: f64,
    left_out: usize,
}

/// A set, and whether it is shown.
#[derive(Clone, Debug)]
pub struct DrawnTubes {
    /// The fibres.
    pub set: Arc<TubeSet>,
    /// Whether they are drawn.
    pub shown: bool,
}

impl PartialEq for DrawnTubes {
    fn eq(&self, other: &Self) -> bool {
        let Self { set, shown } = self;
        Arc::ptr_eq(set, &other.set) && *shown == other.shown
    }
}

impl DrawnTubes {
    /// Whether it draws anything.
    pub(crate) fn draws(&self) -> bool {
        self.shown && !self.set.points.is_empty()
    }
}

impl TubeSet {
    /// Largest distance between a drawn fibre and the one in the file.
    pub const TOLERANCE_MM: f64 = 0.1;
    /// The longest segment drawn. A tube's minimum width on the screen is evaluated at a segment's middle.
    pub const LONGEST_MM: f64 = 20.0;
    /// The most points drawn of one file: 64 MB on the device.
    pub const MOST_POINTS: usize = 4 << 20;
    /// Half the width of a tube: about the distance between tracked fibres.
    pub const RADIUS_MM: f64 = 0.5;

    /// Prepares `tracts`. Polylines are simplified: the drawn line and the file's are nowhere further than
    /// [`TubeSet::TOLERANCE_MM`] apart. Past [`TubeSet::MOST_POINTS`] only every second, third, … fibre is
    /// drawn: see [`TubeSet::left_out`]. A fibre of one point is a ball, one without points nothing.
    /// `radius_mm` is clamped to 0.01 to 100; NaN gives [`TubeSet::RADIUS_MM`].
    ///
    /// # Errors
    /// [`Cancelled`] when `progress` is cancelled.
    pub fn new(tracts: &Tracts, color: Rgb, radius_mm: f64, progress: &Progress) -> Result<Self, Cancelled> {
        Self::with_most(tracts, color, radius_mm, Self::MOST_POINTS, progress)
    }

    fn with_most(
        tracts: &Tracts,
        color: Rgb,
        radius_mm: f64,
        most_points: usize,
        progress: &Progress,
    ) -> Result<Self, Cancelled> {
        let to_f64 = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        // Any point among the others is suitable. The centre of their box isn't: one outlier moves it far.
        let origin_mm = tracts.points_mm().get(tracts.points_mm().len() / 2).map(to_f64).unwrap_or_default();
        let fibers: Vec<Vec<DVec3>> = (0..tracts.fiber_count())
            .into_par_iter()
            .map(|n| {
                progress.check()?;
                let fiber: Vec<DVec3> = tracts.fiber(n).iter().map(|p| to_f64(p) - origin_mm).collect();
                Ok(simplify::simplified(&fiber, Self::TOLERANCE_MM, Self::LONGEST_MM))
            })
            .collect::<Result<_, Cancelled>>()?;
        let total: usize = fibers.iter().map(Vec::len).sum();
        let every = total.div_ceil(most_points.max(1)).max(1);
        let (mut points, mut offsets, mut left_out) = (Vec::new(), vec![0], 0);
        for (n, fiber) in fibers.iter().enumerate() {
            // Every n-th fibre may still have too many points.
            if n % every == 0 && points.len() + fiber.len() <= most_points {
                points.extend(fiber.iter().map(|p| p.as_vec3().to_array()));
            } else if !fiber.is_empty() {
                left_out += 1;
            }
            offsets.push(points.len() as u32);
        }
        let radius_mm = if radius_mm.is_nan() { Self::RADIUS_MM } else { radius_mm.clamp(0.01, 100.0) };
        let bounds = points.iter().map(to_f64).fold(None, |bounds: Option<(DVec3, DVec3)>, p| {
            Some(bounds.map_or((p, p), |(low, high)| (low.min(p), high.max(p))))
        });
        Ok(Self { origin_mm, bounds, points, offsets, color, radius_mm, left_out })
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

    /// Its colour.
    pub fn color(&self) -> Rgb {
        self.color
    }

    /// Half the width of its tubes.
    pub fn radius_mm(&self) -> f64 {
        self.radius_mm
    }

    /// The drawn points of fibre `n`, relative to [`TubeSet::origin_mm`].
    pub(crate) fn fiber(&self, n: usize) -> &[[f32; 3]] {
        match (self.offsets.get(n), self.offsets.get(n + 1)) {
            (Some(&from), Some(&to)) => self.points.get(from as usize..to as usize).unwrap_or_default(),
            _ => &[],
        }
    }

    /// Box around its tubes, world millimetres; `None` without points.
    pub(crate) fn bounds_mm(&self) -> Option<(DVec3, DVec3)> {
        let (low, high) = self.bounds?;
        Some((low + self.origin_mm - self.radius_mm, high + self.origin_mm + self.radius_mm))
    }

    /// Origin of its points, world millimetres: one of the points.
    pub(crate) fn origin_mm(&self) -> DVec3 {
        self.origin_mm
    }
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
