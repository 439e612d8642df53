//! Fibre tracts as tubes: prepared once a file of tracts, drawn beside the tumour by the context view.
//!
//! A tube is a chain of capsules, one a segment, which share a ball at every joint: no bend has a gap,
//! and a ray meets each in closed form. Tubes narrower than a pixel and a half are drawn that wide, so
//! that none is lost from afar. Lit from the eye: the brightness of a place says how it faces the viewer.

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
/// Puts them among what is seen first along each ray.
pub(crate) const TUBES_MERGE: PassName = PassName::new("tubes_merge");

/// Colours of files of tracts, in the order a case names them: muted, where masks are vivid, so that
/// no tube is taken for a mask (a test measures how far apart they are).
const COLORS: [Rgb; 6] =
    [[226, 194, 130], [104, 152, 196], [172, 144, 206], [140, 164, 96], [196, 122, 104], [120, 178, 170]];

/// The colour of the `n`-th file of tracts of a case; they repeat after six.
pub fn tract_color(n: usize) -> Rgb {
    COLORS[n % COLORS.len()]
}

/// One file of fibre tracts, ready to be drawn. Two are the same when their `Arc` is.
#[derive(Clone, Debug)]
pub struct TubeSet {
    origin_mm: DVec3,
    /// From the origin.
    points: Vec<[f32; 3]>,
    /// Where each fibre's points begin, and their number at the end.
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
    /// Whether it leaves anything in the picture.
    pub(crate) fn draws(&self) -> bool {
        self.shown && !self.set.points.is_empty()
    }
}

impl TubeSet {
    /// How far a drawn fibre may be from the one in the file.
    pub const TOLERANCE_MM: f64 = 0.1;
    /// The longest segment drawn. A tube's least width on the screen is taken at a segment's middle.
    pub const LONGEST_MM: f64 = 20.0;
    /// The most points drawn of one file: 64 MB on the card.
    pub const MOST_POINTS: usize = 4 << 20;
    /// Half the width of a tube: about how far apart tracking leaves fibres.
    pub const RADIUS_MM: f64 = 0.5;

    /// Prepares `tracts`. Polylines lose the points that they don't need: what is drawn and what is in
    /// the file are nowhere further than [`TubeSet::TOLERANCE_MM`] from one another. Of more than
    /// [`TubeSet::MOST_POINTS`] only every second, third, … fibre is drawn: see [`TubeSet::left_out`].
    /// A fibre of one point is a ball, one without points nothing. `radius_mm` outside 0.01 to 100 is
    /// taken for the nearest of these.
    ///
    /// # Errors
    /// When `progress` says so.
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
        let wide = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
        // Any point among the others will do. The middle of their box won't: one stray point moves it far.
        let origin_mm = tracts.points_mm().get(tracts.points_mm().len() / 2).map(wide).unwrap_or_default();
        let fibers: Vec<Vec<DVec3>> = (0..tracts.fiber_count())
            .into_par_iter()
            .map(|n| {
                progress.check()?;
                let fiber: Vec<DVec3> = tracts.fiber(n).iter().map(|p| wide(p) - origin_mm).collect();
                Ok(simplify::simplified(&fiber, Self::TOLERANCE_MM, Self::LONGEST_MM))
            })
            .collect::<Result<_, Cancelled>>()?;
        let total: usize = fibers.iter().map(Vec::len).sum();
        let every = total.div_ceil(most_points.max(1)).max(1);
        let (mut points, mut offsets, mut left_out) = (Vec::new(), vec![0], 0);
        for (n, fiber) in fibers.iter().enumerate() {
            // Those that are kept may be the long ones.
            if n % every == 0 && points.len() + fiber.len() <= most_points {
                points.extend(fiber.iter().map(|p| p.as_vec3().to_array()));
            } else if !fiber.is_empty() {
                left_out += 1;
            }
            offsets.push(points.len() as u32);
        }
        let radius_mm = if radius_mm.is_nan() { Self::RADIUS_MM } else { radius_mm.clamp(0.01, 100.0) };
        Ok(Self { origin_mm, points, offsets, color, radius_mm, left_out })
    }

    /// Number of fibres in the file, those without a point included.
    pub fn fiber_count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of points that are drawn.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Fibres that have points and are not drawn, as the file has too many.
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

    /// The drawn points of fibre `n` from [`TubeSet::origin_mm`].
    pub(crate) fn fiber(&self, n: usize) -> &[[f32; 3]] {
        match (self.offsets.get(n), self.offsets.get(n + 1)) {
            (Some(&from), Some(&to)) => self.points.get(from as usize..to as usize).unwrap_or_default(),
            _ => &[],
        }
    }

    /// What its points are counted from, world millimetres: a place among them.
    pub(crate) fn origin_mm(&self) -> DVec3 {
        self.origin_mm
    }
}

/// Where in a list of drawn sets fibre number `number` of a picture is: which set, and which of its
/// fibres.
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
