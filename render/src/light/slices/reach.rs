//! Which pixels each slice step must process: where light may already be lost and is still needed. Pure: no device is
//! touched.

use glam::{DAffine3, DVec2, DVec3};
use glioscope_core::optics::Sight;
use rayon::prelude::*;

use crate::{
    image::buffers::brick_span_voxels,
    light::slices::{
        lamp::LampCone,
        plan::{SlicePlan, Step},
        uniforms,
    },
};

/// Pixels from `low` up to, not including, `high`; empty if `low` isn't below `high` along both axes.
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

    pub fn union(self, other: Self) -> Self {
        let axis = |a: usize| (self.low[a].min(other.low[a]), self.high[a].max(other.high[a]));
        let [x, y] = [axis(0), axis(1)];
        Self { low: [x.0, y.0], high: [x.1, y.1] }
    }

    fn intersection(self, other: Self) -> Self {
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

    /// Clipped to a frame of `size`, then extended to whole workgroups.
    pub fn in_workgroups(self, size: [u32; 2]) -> Self {
        let inside = self.intersection(Self::whole(size));
        if inside.is_empty() {
            return Self::EMPTY;
        }
        Self {
            low: inside.low.map(|c| c / SIDE * SIDE),
            high: inside.high.map(|c| (c + SIDE - 1) / SIDE * SIDE),
        }
    }

    /// The four rectangles around `hole`, which lies in it.
    fn around(self, hole: Self) -> [Self; 4] {
        let ([x0, y0], [x1, y1]) = (self.low, self.high);
        let ([a0, b0], [a1, b1]) = (hole.low, hole.high);
        let of = |low: [i32; 2], high: [i32; 2]| Self { low, high };
        [of([x0, y0], [x1, b0]), of([x0, b0], [a0, b1]), of([a1, b0], [x1, b1]), of([x0, b1], [x1, y1])]
    }

    /// Workgroups across and down.
    pub fn workgroups(&self) -> [u32; 2] {
        if self.is_empty() { [0; 2] } else { [0, 1].map(|a| ((self.high[a] - self.low[a]) / SIDE) as u32) }
    }

    pub fn pixels(&self) -> u64 {
        if self.is_empty() {
            return 0;
        }
        (0..2).map(|a| (self.high[a] - self.low[a]) as u64).product()
    }
}

/// The most rectangles of a dispatch: those around a hole.
const MOST_AREAS: usize = 4;

/// `Area` of lib/slices for each of at most four disjoint rectangles of whole workgroups, in the order in which one dispatch
/// takes their workgroups, and that dispatch. Behind the last is one beyond any frame.
pub(crate) fn areas(rects: &[Rect]) -> ([uniforms::Area; MOST_AREAS + 1], [u32; 3]) {
    const BEYOND: uniforms::Area = uniforms::Area { origin: [1 << 24; 2], first: u32::MAX, per_row: 1.0 };
    debug_assert!(rects.len() <= MOST_AREAS, "{rects:?}");
    let mut areas = [BEYOND; MOST_AREAS + 1];
    let mut total = 0;
    for (rect, area) in rects.iter().zip(&mut areas) {
        let [across, down] = rect.workgroups();
        let origin = rect.low.map(|c| c.max(0) as u32);
        *area = uniforms::Area { origin, first: total, per_row: 1.0 / across.max(1) as f32 };
        total += across * down;
    }
    if let Some(end) = areas.get_mut(rects.len()) {
        end.first = total;
    }
    // A dispatch has at most 65535 workgroups along an axis.
    let rows = total.div_ceil(65535).max(1);
    (areas, [total.div_ceil(rows), rows, 1])
}

/// Pixels along a workgroup's side.
const SIDE: i32 = 8;

/// Bounds of an object on the screen: the pixels that it may project to, and its view depths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScreenBounds {
    pub rect: Rect,
    pub depths_mm: (f64, f64),
}

impl ScreenBounds {
    /// Bounds of a box with these corners; `None` behind the eye. One pixel is added on every side, for rounding.
    pub fn of(sight: &Sight, corners_mm: &[DVec3]) -> Option<Self> {
        Self::of_corners(sight, corners_mm.iter().map(|at| Offset::of(sight, *at - sight.eye_mm)))
    }

    fn of_corners(sight: &Sight, corners: impl Iterator<Item = Offset>) -> Option<Self> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let mut all_before = true;
        for Offset(at) in corners {
            let pixel_mm = sight.pixel_mm(at.z);
            // A box that reaches behind the eye may project to any pixel.
            all_before &= at.z > 0.0 && pixel_mm > 0.0;
            let per_mm = 1.0 / pixel_mm;
            let at_px = DVec3::new(at.x * per_mm, at.y * per_mm, at.z);
            low = low.min(at_px);
            high = high.max(at_px);
        }
        let depths_mm = (low.z.max(0.0), high.z);
        if !(high.z > 0.0 && high.z.is_finite()) {
            return None;
        }
        if !all_before {
            return Some(Self { rect: Rect::whole(sight.size), depths_mm });
        }
        let edge =
            |from_middle: f64, a: usize| (from_middle + 0.5 * f64::from(sight.size[a])).clamp(-1e6, 1e6);
        let axis = |a: usize| (edge(low[a], a).floor() as i32 - 1, edge(high[a], a).ceil() as i32 + 1);
        let (x, y) = (axis(0), axis(1));
        Some(Self { rect: Rect { low: [x.0, y.0], high: [x.1, y.1] }, depths_mm })
    }

    /// Bounds of these bricks of an image, in their order, without those behind the eye.
    pub fn of_bricks(sight: &Sight, world_from_voxel: &DAffine3, bricks: &[[usize; 3]]) -> Vec<Self> {
        Self::of_each_brick(sight, world_from_voxel, bricks).into_iter().flatten().collect()
    }

    /// Bounds of each of these bricks of an image; `None` for those behind the eye.
    pub fn of_each_brick(
        sight: &Sight,
        world_from_voxel: &DAffine3,
        bricks: &[[usize; 3]],
    ) -> Vec<Option<Self>> {
        // Up to the division by depth, a corner's place is a sum of one term per axis.
        let first = Offset::of(sight, world_from_voxel.translation - sight.eye_mm).0;
        let terms: [Vec<[DVec3; 2]>; 3] = std::array::from_fn(|a| {
            let per_voxel = Offset::of(sight, world_from_voxel.matrix3.col(a)).0;
            let count = bricks.iter().map(|brick| brick[a] + 1).max().unwrap_or(0);
            (0..count).map(|place| brick_span_voxels(place).map(|voxels| voxels * per_voxel)).collect()
        });
        let bounds = |[i, j, k]: &[usize; 3]| {
            let (x, y, z) = (terms[0][*i], terms[1][*j], terms[2][*k]);
            let corner = |n: usize| Offset(first + x[n & 1] + y[n >> 1 & 1] + z[n >> 2]);
            Self::of_corners(sight, (0..8).map(corner))
        };
        bricks.par_iter().with_min_len(512).map(bounds).collect()
    }
}

/// A vector along the frame's axes: right, down, away from the eye; millimetres.
#[derive(Clone, Copy)]
struct Offset(DVec3);

impl Offset {
    fn of(sight: &Sight, vector_mm: DVec3) -> Self {
        Self(DVec3::new(vector_mm.dot(sight.right), -vector_mm.dot(sight.up), vector_mm.dot(sight.forward)))
    }
}

/// Where opaque surfaces may be.
#[derive(Clone, Copy, Debug)]
pub(crate) enum OpaqueBounds {
    None,
    Within(ScreenBounds),
    Anywhere,
}

/// The pixels that a step must process: disjoint rectangles of whole workgroups.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct StepRects {
    /// Where opaque surfaces are, or where their light and that of the image may differ.
    pub with_opaque: Vec<Rect>,
    /// Elsewhere: both lights are equal.
    pub without_opaque: Vec<Rect>,
}

impl StepRects {
    pub fn everywhere(size: [u32; 2]) -> Self {
        Self { with_opaque: vec![Rect::whole(size).in_workgroups(size)], without_opaque: Vec::new() }
    }
}

/// Pixels outside the opaque geometry up to which a graphics card takes longer to begin their dispatch than to process
/// both lights in them: about 8 microseconds, in which it moves a megabyte.
const SMALL_PX: u64 = 1 << 17;

impl StepRects {
    /// Makes one rectangle of all where those without opaque geometry are small. Both lights are equal there, so that
    /// nothing changes but the number of dispatches.
    pub fn merge_small(&mut self) {
        let outside: u64 = self.without_opaque.iter().map(Rect::pixels).sum();
        if let [inside] = self.with_opaque[..]
            && outside <= SMALL_PX
        {
            self.with_opaque = vec![self.without_opaque.drain(..).fold(inside, Rect::union)];
        }
    }
}

/// The pixels that each step of the frame must process. `occluders`: whether opaque surfaces occlude the image, and
/// whether the image occludes itself.
pub(crate) fn step_rects(
    plan: &SlicePlan,
    sight: &Sight,
    image: &[ScreenBounds],
    opaque: OpaqueBounds,
    occluders: (bool, bool),
) -> Vec<StepRects> {
    step_rects_in_groups(plan, sight, image, opaque, occluders, MOST_GROUPS)
}

/// As [`step_rects`], where each step is compared with at most `most_groups` groups of steps.
pub(crate) fn step_rects_in_groups(
    plan: &SlicePlan,
    sight: &Sight,
    image: &[ScreenBounds],
    opaque: OpaqueBounds,
    (opaque_occludes, image_occludes): (bool, bool),
    most_groups: usize,
) -> Vec<StepRects> {
    let steps = &plan.steps;
    let size = sight.size;
    // Shaders compute in single precision.
    let margin_mm = 0.01 * plan.slice_mm + 1e-3;
    let front = |k: usize| steps[k].depth_mm - margin_mm;
    let back = |k: usize| steps[k].depth_mm + f64::from(steps[k].slices) * plan.slice_mm + margin_mm;
    let last = steps.len().saturating_sub(1);
    let from_behind = plan.is_lit_from_behind();
    // From front to back.
    let in_depth = |n: usize| if from_behind { last - n } else { n };
    let backs: Vec<f64> = (0..steps.len()).map(|n| back(in_depth(n))).collect();
    let mut visible = vec![Rect::EMPTY; steps.len()];
    for brick in image {
        let first = backs.partition_point(|back| *back < brick.depths_mm.0);
        for k in (first..steps.len()).map(in_depth).take_while(|k| front(*k) <= brick.depths_mm.1) {
            visible[k] = visible[k].union(brick.rect);
        }
    }
    let whole = Rect::whole(size);
    // Opaque surfaces: from the step on in which they begin, and up to the step in which they end. What is behind them hides a
    // lamp there, too.
    let (opaque_begun, opaque_ahead): (Vec<Rect>, Vec<Rect>) = (0..steps.len())
        .map(|k| match opaque {
            OpaqueBounds::None => (Rect::EMPTY, Rect::EMPTY),
            OpaqueBounds::Anywhere => (whole, whole),
            OpaqueBounds::Within(s) => {
                let when = |is: bool| if is { s.rect } else { Rect::EMPTY };
                if from_behind {
                    (s.rect, when(back(k) >= s.depths_mm.0))
                } else {
                    (when(back(k) >= s.depths_mm.0 || k == last), when(front(k) <= s.depths_mm.1))
                }
            }
        })
        .unzip();
    let spread = Spread::of(steps);
    let drift = Drift::of(plan, sight);
    // Each step is compared with all others, which are grouped if there are very many.
    let group_size = steps.len().div_ceil(most_groups.max(1)).max(1);
    let groups = |of: &dyn Fn(usize) -> Rect| -> Vec<Rect> {
        let numbers: Vec<usize> = (0..steps.len()).collect();
        numbers.chunks(group_size).map(|g| g.iter().fold(Rect::EMPTY, |all, j| all.union(of(*j)))).collect()
    };
    // Backwards: where light is needed, in this step or through a later footprint.
    let receivers = groups(&|j| visible[j].union(opaque_ahead[j]));
    let needed = |k: usize| {
        let later = receivers.iter().enumerate().skip(k / group_size).filter(|(_, rect)| !rect.is_empty());
        later.fold(Rect::EMPTY, |all, (g, rect)| {
            let ends = [(g * group_size).max(k), last.min((g + 1) * group_size - 1)];
            all.union(drift.needed(rect.grown(drift.spread(spread.between(k, ends[1]), k, ends[1])), ends, k))
        })
    };
    // Forwards: where light may have been lost, and where opaque surfaces may have made the two lights differ.
    let losses = groups(&|j| visible[j].union(if opaque_occludes { opaque_begun[j] } else { Rect::EMPTY }));
    let opaque_losses = groups(&|j| opaque_begun[j]);
    let spread_to = |of: &[Rect], k: usize| {
        let before = of.iter().enumerate().take(k / group_size + 1).filter(|(_, rect)| !rect.is_empty());
        let all = before.fold(Rect::EMPTY, |all, (g, rect)| {
            let ends = [(g * group_size).min(k), k.min((g + 1) * group_size - 1)];
            let by = drift.spread(spread.between(ends[0], k), ends[0], k);
            all.union(drift.lost(rect.grown(by), ends, k))
        });
        all.intersection(whole)
    };
    let of_step = |k: usize| {
        let active = spread_to(&losses, k).intersection(needed(k)).in_workgroups(size);
        let differ = spread_to(&opaque_losses, k);
        let differ = if image_occludes || matches!(opaque, OpaqueBounds::None) { differ } else { whole };
        let differ = differ.in_workgroups(size).intersection(active);
        if active.is_empty() {
            StepRects::default()
        } else if differ.is_empty() {
            StepRects { with_opaque: Vec::new(), without_opaque: vec![active] }
        } else {
            let without_opaque = active.around(differ).into_iter().filter(|r| !r.is_empty()).collect();
            StepRects { with_opaque: vec![differ], without_opaque }
        }
    };
    (0..steps.len()).into_par_iter().with_min_len(16).map(of_step).collect()
}

/// Maximum number of groups of steps that a step is compared with.
const MOST_GROUPS: usize = 128;

/// Share of the light that arrives from farther away than [`Spread::between`], over all steps of a frame: below single
/// precision.
const NEGLIGIBLE: f64 = 1e-8;

/// How far light spreads from step to step. Footprints are the steps of a random walk: its displacement is at most the
/// sum of their reaches, but almost never exceeds the bound that Bernstein's inequality gives for the sum of their
/// variances.
struct Spread {
    /// Summed reach of the footprints of the steps up to and including each.
    reach_px: Vec<u32>,
    /// Their summed variance along an axis.
    variance_px2: Vec<f64>,
    widest_px: f64,
    /// -ln of the probability of exceeding the bound.
    neg_log_p: f64,
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
        // Union bound over two directions of two axes, and over the steps.
        let neg_log_p = (4.0 * steps.len().max(1) as f64 / NEGLIGIBLE).ln();
        Self { reach_px, variance_px2, widest_px, neg_log_p }
    }

    /// Distance, in pixels, that the footprints of the steps after `first`, up to and including `last`, spread light.
    fn between(&self, first: usize, last: usize) -> u32 {
        let reach = self.reach_px[last] - self.reach_px[first];
        let variance = self.variance_px2[last] - self.variance_px2[first];
        let third = self.neg_log_p * self.widest_px / 3.0;
        let bound = third + (third * third + 2.0 * self.neg_log_p * variance.max(0.0)).sqrt();
        reach.min(bound.ceil() as u32)
    }
}

/// How the light of a lamp moves rectangles from step to step; without a lamp they stay.
struct Drift<'a> {
    lamp: Option<&'a LampCone>,
    sight: &'a Sight,
    /// The middle of each step, view depths.
    middles_mm: Vec<f64>,
}

/// Pixels beyond any frame.
const BEYOND_PX: i32 = 1 << 24;

impl<'a> Drift<'a> {
    fn of(plan: &'a SlicePlan, sight: &'a Sight) -> Self {
        let middle = |step: &Step| step.depth_mm + 0.5 * plan.slice_mm * f64::from(step.slices);
        Self { lamp: plan.lamp.as_ref(), sight, middles_mm: plan.steps.iter().map(middle).collect() }
    }

    /// Pixels of a spread between two steps at either: pixels are larger farther away.
    fn spread(&self, pixels: u32, first: usize, last: usize) -> u32 {
        let Some(_) = self.lamp else { return pixels };
        let [first, last] = [first, last].map(|step| self.sight.pixel_mm(self.middles_mm[step]));
        (f64::from(pixels) * (last / first).max(first / last)).min(f64::from(BEYOND_PX)).ceil() as u32 + 2
    }

    /// Where a rectangle, the same in the steps from `ends[0]` to `ends[1]`, is along the light in step `to`: between where it
    /// is from either end, as places are linear in depth.
    fn moved(&self, rect: Rect, ends: [usize; 2], to: usize) -> Rect {
        let Some(lamp) = self.lamp.filter(|_| !rect.is_empty()) else { return rect };
        let middle = DVec2::from_array(self.sight.size.map(f64::from)) / 2.0;
        let corner = |from: usize, at: [i32; 2]| {
            let off = DVec2::new(f64::from(at[0]), f64::from(at[1])) - middle;
            lamp.moved(self.sight, off, [from, to].map(|step| self.middles_mm[step])) + middle
        };
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for from in ends {
            for at in [rect.low, rect.high] {
                let at = corner(from, at).clamp(DVec2::splat(-1e6), DVec2::splat(1e6));
                (low, high) = (low.min(at), high.max(at));
            }
        }
        Rect {
            low: [low.x.floor() as i32, low.y.floor() as i32],
            high: [high.x.ceil() as i32, high.y.ceil() as i32],
        }
    }

    /// Where light is lost that was lost in a rectangle before: what is at the frame's edge extends beyond it.
    fn lost(&self, rect: Rect, ends: [usize; 2], to: usize) -> Rect {
        if self.lamp.is_none() || rect.is_empty() {
            return rect;
        }
        let mut edged = rect;
        for a in 0..2 {
            edged.low[a] = if rect.low[a] <= 0 { -BEYOND_PX } else { rect.low[a] };
            edged.high[a] = if rect.high[a] >= self.sight.size[a] as i32 { BEYOND_PX } else { rect.high[a] };
        }
        let moved = self.moved(edged, ends, to);
        let beyond = |a: usize| (edged.low[a] == -BEYOND_PX, edged.high[a] == BEYOND_PX);
        let [x, y] = [beyond(0), beyond(1)];
        let low = [if x.0 { 0 } else { moved.low[0] }, if y.0 { 0 } else { moved.low[1] }];
        let size = self.sight.size.map(|s| s as i32);
        let high = [if x.1 { size[0] } else { moved.high[0] }, if y.1 { size[1] } else { moved.high[1] }];
        Rect { low, high }
    }

    /// Where light is read that is needed in a rectangle later: beyond the frame at its edge.
    fn needed(&self, rect: Rect, ends: [usize; 2], to: usize) -> Rect {
        let moved = self.moved(rect, ends, to);
        if self.lamp.is_none() || moved.is_empty() {
            return moved;
        }
        let size = self.sight.size.map(|s| s as i32);
        Rect {
            low: [0, 1].map(|a| moved.low[a].clamp(0, size[a] - 1)),
            high: [0, 1].map(|a| moved.high[a].clamp(1, size[a])),
        }
    }
}
