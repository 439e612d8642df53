//! Which pixels each slice step must process: where light may already be lost and is still needed. Pure: no device is
//! touched.

use glioscope_core::optics::Sight;

use crate::light::slices::plan::{SlicePlan, Step};

/// Pixels from `low` up to `high`, which is none of them; empty where one isn't below the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rect {
    pub low: [i32; 2],
    pub high: [i32; 2],
}

impl Rect {
    pub const EMPTY: Self = Self { low: [i32::MAX / 2; 2], high: [i32::MIN / 2; 2] };

    pub fn whole(size: [u32; 2]) -> Self {
        Self { low: [0; 2], high: size.map(|s| s as i32) }
    }

    pub fn is_empty(&self) -> bool {
        (0..2).any(|a| self.low[a] >= self.high[a])
    }

    fn with(self, other: Self) -> Self {
        let axis = |a: usize| (self.low[a].min(other.low[a]), self.high[a].max(other.high[a]));
        let [x, y] = [axis(0), axis(1)];
        Self { low: [x.0, y.0], high: [x.1, y.1] }
    }

    fn within(self, other: Self) -> Self {
        let axis = |a: usize| (self.low[a].max(other.low[a]), self.high[a].min(other.high[a]));
        let [x, y] = [axis(0), axis(1)];
        Self { low: [x.0, y.0], high: [x.1, y.1] }
    }

    fn grown(self, pixels: u32) -> Self {
        let by = pixels as i32;
        if self.is_empty() {
            return Self::EMPTY;
        }
        Self { low: self.low.map(|c| c - by), high: self.high.map(|c| c + by) }
    }

    /// To whole workgroups, within a picture of `size`.
    pub fn in_workgroups(self, size: [u32; 2]) -> Self {
        let inside = self.within(Self::whole(size));
        if inside.is_empty() {
            return Self::EMPTY;
        }
        Self {
            low: inside.low.map(|c| c / SIDE * SIDE),
            high: inside.high.map(|c| (c + SIDE - 1) / SIDE * SIDE),
        }
    }

    /// What of it is not in `hole`, a part of it.
    fn around(self, hole: Self) -> [Self; 4] {
        let ([x0, y0], [x1, y1]) = (self.low, self.high);
        let ([a0, b0], [a1, b1]) = (hole.low, hole.high);
        let of = |low: [i32; 2], high: [i32; 2]| Self { low, high };
        [of([x0, y0], [x1, b0]), of([x0, b0], [a0, b1]), of([a1, b0], [x1, b1]), of([x0, b1], [x1, y1])]
    }

    /// The first pixel, and workgroups across and down.
    pub fn dispatch(&self) -> ([u32; 2], [u32; 3]) {
        let groups = [0, 1].map(|a| ((self.high[a] - self.low[a]) / SIDE) as u32);
        (self.low.map(|c| c as u32), [groups[0], groups[1], 1])
    }

    pub fn pixels(&self) -> u64 {
        if self.is_empty() {
            return 0;
        }
        (0..2).map(|a| (self.high[a] - self.low[a]) as u64).product()
    }
}

/// Of a workgroup.
const SIDE: i32 = 8;

/// Something in the picture: the pixels that may see it, and its view depths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenBounds {
    pub rect: Rect,
    pub depths_mm: (f64, f64),
}

impl ScreenBounds {
    /// What has these corners; `None` behind the eye. One pixel more on every side, for rounding.
    pub fn of(sight: &Sight, corners_mm: &[glam::DVec3]) -> Option<Self> {
        let depths_mm = sight.depths_mm(corners_mm)?;
        let mut rect = Rect::EMPTY;
        for at in corners_mm {
            let depth = sight.depth_mm(*at);
            let pixel_mm = sight.pixel_mm(depth);
            // What reaches behind the eye may be anywhere.
            if depth <= 0.0 || pixel_mm.is_nan() || pixel_mm <= 0.0 {
                return Some(Self { rect: Rect::whole(sight.size), depths_mm });
            }
            let off = *at - sight.eye_mm;
            let from_middle = [off.dot(sight.right) / pixel_mm, -off.dot(sight.up) / pixel_mm];
            let edge = |a: usize| (from_middle[a] + 0.5 * f64::from(sight.size[a])).clamp(-1e6, 1e6);
            let (x, y) = (edge(0), edge(1));
            let low = [x, y].map(|c| c.floor() as i32 - 1);
            let high = [x, y].map(|c| c.ceil() as i32 + 1);
            rect = rect.with(Rect { low, high });
        }
        Some(Self { rect, depths_mm })
    }
}

/// What solid surfaces there may be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SolidParts {
    None,
    Within(ScreenBounds),
    Anywhere,
}

/// Rectangles of whole workgroups, which do not overlap, for a step.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct StepReach {
    /// Where solid surfaces are, or the lights before and behind them may differ.
    pub among_solid: Vec<Rect>,
    /// Elsewhere: both lights are one.
    pub alike: Vec<Rect>,
}

impl StepReach {
    pub fn everywhere(size: [u32; 2]) -> Self {
        Self { among_solid: vec![Rect::whole(size).in_workgroups(size)], alike: Vec::new() }
    }
}

/// What the picture's steps must be taken for. `casts`: solid surfaces take the image's light; `shades`: the image
/// does.
pub(crate) fn reach(
    plan: &SlicePlan,
    sight: &Sight,
    image: &[ScreenBounds],
    solid: SolidParts,
    ways: (bool, bool),
) -> Vec<StepReach> {
    reach_in_groups(plan, sight, image, solid, ways, MOST_LOOKED_AT)
}

/// As [`reach`], with so many groups of steps that each step looks at.
pub(crate) fn reach_in_groups(
    plan: &SlicePlan,
    sight: &Sight,
    image: &[ScreenBounds],
    solid: SolidParts,
    (casts, shades): (bool, bool),
    most_groups: usize,
) -> Vec<StepReach> {
    let steps = &plan.steps;
    let size = sight.size;
    // Shaders count in single precision.
    let room = 0.01 * plan.slice_mm + 1e-3;
    let front = |k: usize| steps[k].depth_mm - room;
    let back = |k: usize| steps[k].depth_mm + f64::from(steps[k].slices) * plan.slice_mm + room;
    let numbers: Vec<usize> = (0..steps.len()).collect();
    let mut matter = vec![Rect::EMPTY; steps.len()];
    for seen in image {
        let first = numbers.partition_point(|k| back(*k) < seen.depths_mm.0);
        for k in (first..steps.len()).take_while(|k| front(*k) <= seen.depths_mm.1) {
            matter[k] = matter[k].with(seen.rect);
        }
    }
    let last = steps.len().saturating_sub(1);
    let whole = Rect::whole(size);
    // Solid surfaces from the step on in which they begin, and up to where they end.
    let (begun, awaited): (Vec<Rect>, Vec<Rect>) = (0..steps.len())
        .map(|k| match solid {
            SolidParts::None => (Rect::EMPTY, Rect::EMPTY),
            SolidParts::Anywhere => (whole, whole),
            SolidParts::Within(s) => {
                let when = |is: bool| if is { s.rect } else { Rect::EMPTY };
                (when(back(k) >= s.depths_mm.0 || k == last), when(front(k) <= s.depths_mm.1))
            }
        })
        .unzip();
    let spread = Spread::of(steps);
    // Each step looks at all others: of very many, at some together.
    let together = steps.len().div_ceil(most_groups.max(1)).max(1);
    let groups = |of: &dyn Fn(usize) -> Rect| -> Vec<Rect> {
        let numbers: Vec<usize> = (0..steps.len()).collect();
        numbers.chunks(together).map(|g| g.iter().fold(Rect::EMPTY, |all, j| all.with(of(*j)))).collect()
    };
    // Backwards: whose light is asked for, then or through a later footprint.
    let wanted = groups(&|j| matter[j].with(awaited[j]));
    let asked = |k: usize| {
        let later = wanted.iter().enumerate().skip(k / together).filter(|(_, rect)| !rect.is_empty());
        later.fold(Rect::EMPTY, |all, (g, wanted)| {
            all.with(wanted.grown(spread.between(k, last.min((g + 1) * together - 1))))
        })
    };
    // Forwards: where light may have been lost, and where by something solid.
    let casting = groups(&|j| matter[j].with(if casts { begun[j] } else { Rect::EMPTY }));
    let begun = groups(&|j| begun[j]);
    let carried = |of: &[Rect], k: usize| {
        let before = of.iter().enumerate().take(k / together + 1).filter(|(_, rect)| !rect.is_empty());
        let all = before.fold(Rect::EMPTY, |all, (g, rect)| {
            all.with(rect.grown(spread.between((g * together).min(k), k)))
        });
        all.within(whole)
    };
    let mut out = Vec::with_capacity(steps.len());
    for k in 0..steps.len() {
        let here = carried(&casting, k).within(asked(k)).in_workgroups(size);
        let apart = carried(&begun, k);
        let among = if shades || matches!(solid, SolidParts::None) { apart } else { whole };
        let among = among.in_workgroups(size).within(here);
        out.push(if here.is_empty() {
            StepReach::default()
        } else if among.is_empty() {
            StepReach { among_solid: Vec::new(), alike: vec![here] }
        } else {
            let alike = here.around(among).into_iter().filter(|r| !r.is_empty()).collect();
            StepReach { among_solid: vec![among], alike }
        });
    }
    out
}

/// Groups of steps that a step looks at.
const MOST_LOOKED_AT: usize = 128;

/// What light a step takes from pixels farther away than [`Spread::between`] says, over all of a picture's steps: less
/// than single precision tells apart.
const NEGLIGIBLE: f64 = 1e-8;

/// How far light is carried from step to step. Footprints are the steps of a random walk: it strays as far as all of them
/// reach together, but almost never farther than Bernstein's inequality says for the sum of their variances.
struct Spread {
    /// Of the footprints of the steps up to each, itself among them: pixels, and square pixels along an axis.
    reach_px: Vec<u32>,
    variance_px2: Vec<f64>,
    widest_px: f64,
    /// Logarithm of one by the odds to stray farther.
    odds: f64,
}

impl Spread {
    fn of(steps: &[Step]) -> Self {
        let (mut reach, mut variance) = (0, 0.0);
        let sums = steps.iter().map(|step| {
            reach += step.kernel.reach_px();
            variance += step.kernel.variance_px2();
            (reach, variance)
        });
        let (reach_px, variance_px2) = sums.unzip();
        let widest_px = steps.iter().map(|step| f64::from(step.kernel.reach_px())).fold(0.0, f64::max);
        // Two directions of two axes, and at whichever step it strays first.
        let odds = (4.0 * steps.len().max(1) as f64 / NEGLIGIBLE).ln();
        Self { reach_px, variance_px2, widest_px, odds }
    }

    /// Pixels that the footprints of the steps behind `first`, up to `last` and with it, carry light.
    fn between(&self, first: usize, last: usize) -> u32 {
        let reach = self.reach_px[last] - self.reach_px[first];
        let variance = self.variance_px2[last] - self.variance_px2[first];
        let third = self.odds * self.widest_px / 3.0;
        let strays = third + (third * third + 2.0 * self.odds * variance.max(0.0)).sqrt();
        reach.min(strays.ceil() as u32)
    }
}
