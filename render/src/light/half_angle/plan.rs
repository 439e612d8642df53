//! The slabs of half-angle slicing, the light's buffer, and what each slab must process. Pure: no device is touched.

use glam::{DAffine3, DVec2, DVec3};
use glioscope_core::optics::{Camera, Sight};

use crate::{
    image::buffers::brick_span_voxels,
    light::slices::{
        plan::MOST_SLICES,
        reach::{Rect, ScreenBounds},
    },
    solid::view::in_camera_space,
};

/// Most texels of the light's buffer along a side.
const MOST_TEXELS: u32 = 2048;
/// Slabs and texels for each of the image's voxels, at most: finer ones find nothing more, and an image of large voxels would need
/// thousands of them.
const MOST_PER_VOXEL: f64 = 8.0;
/// Half the range of angles about 90 degrees between light and sight in which both cases are drawn and mixed, with slabs of
/// 1 mm: their difference grows with the square of the slabs, and so does the range.
const MIXED_DEG: f64 = 5.0;
const MOST_MIXED_DEG: f64 = 25.0;
/// The slabs' normal leans towards the line of sight where a frame is so wide that its outer rays would not cross them.
const LEAST_CROSSING: f64 = 0.3;
/// Wider frames have the least range: light crosses slabs that lean far to the sight in few directions.
const WIDEST_MIXED: f64 = 1.1;
const MOST_LEAN: f64 = 10.0;

/// What the slabs are made for. Camera space: right, up, away from the eye, from the reference plane.
pub(crate) struct Requested {
    /// Direction that light travels in, unit length, camera space.
    pub light: DVec3,
    /// The slabs are at fixed distances from this point, so that they turn about it.
    pub center: DVec3,
    pub slab_mm: f64,
    pub texel_mm: f64,
    /// Shortest distance between voxels.
    pub voxel_mm: f64,
}

/// One of the two half vectors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Case {
    /// Of the slabs, unit length, camera space; less than 90 degrees from the light's direction.
    pub normal: DVec3,
    /// Whether sight crosses the slabs in the light's order.
    pub ahead: bool,
    /// Its share of the frame, above 0.
    pub weight: f64,
    /// In the light's order.
    pub slabs: Vec<Slab>,
}

/// A slab, and what it must process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Slab {
    /// Scalar product of the normal with its front.
    pub front: f64,
    /// Pixels that may see the image in it.
    pub eye: Rect,
    /// Texels whose light may meet the image in it.
    pub light: Rect,
}

/// The slabs of one frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HalfAnglePlan {
    /// One, or two whose weights add up to 1.
    pub cases: Vec<Case>,
    pub slab_mm: f64,
    /// Axes of the light's buffer, unit length, perpendicular to the light.
    pub across: DVec3,
    pub down: DVec3,
    /// Texels per millimetre.
    pub per_mm: f64,
    /// Corner of the buffer, texels.
    pub origin: DVec2,
    /// Texels along its sides, at least 1.
    pub texels: [u32; 2],
    /// Settings that were changed.
    pub notes: Vec<String>,
}

/// A direction of the world in camera space.
pub(crate) fn turned(camera: &Camera, world: DVec3) -> DVec3 {
    let [right, up, back] = camera.axes();
    DVec3::new(world.dot(right), world.dot(up), -world.dot(back))
}

/// Half the range of angles in which both cases are mixed, as its sine. `widest_tangent` is that of the frame's outermost ray.
pub(crate) fn mixed(slab_mm: f64, widest_tangent: f64) -> f64 {
    let most = if widest_tangent > WIDEST_MIXED { MIXED_DEG } else { MOST_MIXED_DEG };
    let thick = if slab_mm.is_finite() { slab_mm.clamp(1.0, 1e3) } else { 1.0 };
    (MIXED_DEG * thick * thick).min(most).to_radians().sin()
}

/// Both half vectors where the angle between light and sight is near 90 degrees, else one: case, normal, weight.
fn cases(light: DVec3, slab_mm: f64, widest_tangent: f64) -> impl Iterator<Item = (bool, DVec3, f64)> {
    let mixed = mixed(slab_mm, widest_tangent);
    let ahead = (0.5 + light.z / (2.0 * mixed)).clamp(0.0, 1.0);
    let lean = (widest_tangent + mixed + LEAST_CROSSING).clamp(1.0, MOST_LEAN);
    [(true, ahead), (false, 1.0 - ahead)].into_iter().filter(|(_, weight)| *weight > 0.0).map(
        move |(is_ahead, weight)| {
            let sight = if is_ahead { lean } else { -lean };
            let normal = (light + DVec3::Z * sight).try_normalize().unwrap_or(light);
            (is_ahead, normal, weight)
        },
    )
}

/// A box of the image in camera space: its corner of least indices, and its edges.
struct Bricks {
    origin: DVec3,
    axes: [DVec3; 3],
}

impl Bricks {
    /// Least and greatest scalar product of `vector` with a brick's points.
    fn span(&self, brick: &[usize; 3], vector: DVec3) -> (f64, f64) {
        let start = self.origin.dot(vector);
        (0..3).fold((start, start), |(low, high), a| {
            let ends = brick_span_voxels(brick[a]).map(|voxels| voxels * self.axes[a].dot(vector));
            (low + ends[0].min(ends[1]), high + ends[0].max(ends[1]))
        })
    }
}

impl HalfAnglePlan {
    /// Slabs through the visible bricks of an image that aren't behind the eye; no case if there are none.
    pub fn new(
        requested: &Requested,
        (camera, reference_mm, size): (&Camera, f64, [u32; 2]),
        world_from_voxel: &DAffine3,
        bricks: &[[usize; 3]],
    ) -> Self {
        let sight = Sight::new(camera, size);
        let [across, down] = across_light(requested.light);
        let mut plan = Self {
            cases: Vec::new(),
            slab_mm: requested.slab_mm,
            across,
            down,
            per_mm: 1.0,
            origin: DVec2::ZERO,
            texels: [1; 2],
            notes: Vec::new(),
        };
        let bounds = ScreenBounds::of_each_brick(&sight, world_from_voxel, bricks);
        let shown: Vec<([usize; 3], Rect)> =
            bricks.iter().zip(bounds).filter_map(|(brick, b)| b.map(|b| (*brick, b.rect))).collect();
        if shown.is_empty() {
            return plan;
        }
        let place = Bricks {
            origin: in_camera_space(camera, reference_mm, world_from_voxel.translation),
            axes: [0, 1, 2].map(|a| turned(camera, world_from_voxel.matrix3.col(a))),
        };
        let along =
            |axis: DVec3| -> Vec<(f64, f64)> { shown.iter().map(|(b, _)| place.span(b, axis)).collect() };
        let (x, y) = (along(across), along(down));
        plan.set_buffer(requested, whole(&x), whole(&y));
        let texel = |at_mm: f64, axis: usize| at_mm * plan.per_mm - plan.origin[axis];
        let rects: Vec<(Rect, Rect)> = (shown.iter().zip(x.iter().zip(&y)))
            .map(|((_, eye), (x, y))| {
                // Light is interpolated between texels.
                let low = [texel(x.0, 0), texel(y.0, 1)].map(|v| v.floor() as i32 - 1);
                let high = [texel(x.1, 0), texel(y.1, 1)].map(|v| v.ceil() as i32 + 1);
                (*eye, Rect { low, high })
            })
            .collect();
        let widest = sight.growth() * DVec2::new(f64::from(size[0]), f64::from(size[1])).length() / 2.0;
        let found: Vec<_> = cases(requested.light, requested.slab_mm, widest).collect();
        let spans: Vec<_> = found.iter().map(|(_, normal, _)| along(*normal)).collect();
        let longest_mm = spans.iter().map(|s| whole(s)).map(|(low, high)| high - low).fold(0.0, f64::max);
        plan.set_slab(requested.voxel_mm, longest_mm);
        for ((ahead, normal, weight), spans) in found.into_iter().zip(spans) {
            let (first, slabs) = (requested.center.dot(normal), plan.slab_mm);
            let number = |at_mm: f64| ((at_mm - first) / slabs).floor();
            let (low, high) = whole(&spans);
            let before = number(low);
            let count = (number(high) - before) as usize + 1;
            let nothing = (Rect::EMPTY, Rect::EMPTY);
            let mut needs = vec![nothing; count];
            for (span, (eye, light)) in spans.iter().zip(&rects) {
                let range = [span.0, span.1].map(|at_mm| (number(at_mm) - before) as usize);
                for need in needs.iter_mut().take(range[1] + 1).skip(range[0]) {
                    *need = (need.0.union(*eye), need.1.union(*light));
                }
            }
            let slabs = (needs.into_iter().enumerate())
                .map(|(n, (eye, light))| Slab {
                    front: first + (before + n as f64) * slabs,
                    eye: eye.in_workgroups(size),
                    light: light.in_workgroups(plan.texels),
                })
                .filter(|slab| !slab.light.is_empty())
                .collect();
            plan.cases.push(Case { normal, ahead, weight, slabs });
        }
        plan
    }

    /// The buffer over these ranges along its axes. Texels lie at fixed distances from the centre.
    fn set_buffer(&mut self, requested: &Requested, x: (f64, f64), y: (f64, f64)) {
        let texel_mm = requested.texel_mm;
        let longest = (x.1 - x.0).max(y.1 - y.0);
        // Three are around the image, and one is cut.
        let least =
            (longest / f64::from(MOST_TEXELS - 4)).max((requested.voxel_mm / MOST_PER_VOXEL).min(longest));
        let used = if texel_mm.is_finite() && texel_mm > 0.0 {
            texel_mm.clamp(least, longest)
        } else {
            longest / 256.0
        };
        if used != texel_mm {
            self.notes.push(format!("texels of light of {texel_mm} mm: {used} mm is used"));
        }
        self.per_mm = 1.0 / used;
        for (a, (axis, (low, high))) in [(self.across, x), (self.down, y)].into_iter().enumerate() {
            let middle = requested.center.dot(axis) / used;
            let before = (middle - low / used).ceil() + 1.0;
            self.origin[a] = middle - before;
            self.texels[a] = ((high / used - self.origin[a]).ceil() as u32 + 1).clamp(1, MOST_TEXELS);
        }
    }

    /// Slabs through an image of this length.
    fn set_slab(&mut self, voxel_mm: f64, longest_mm: f64) {
        let requested = self.slab_mm;
        self.slab_mm = if requested.is_finite() && requested > 0.0 {
            // A slab's corners take one more.
            let least = (longest_mm / f64::from(MOST_SLICES - 1)).max(voxel_mm / MOST_PER_VOXEL);
            requested.clamp(least.min(longest_mm), longest_mm)
        } else {
            longest_mm / 256.0
        };
        if self.slab_mm != requested {
            self.notes.push(format!("slice distance {requested} mm: {} mm is used", self.slab_mm));
        }
    }

    /// Every slab processes everything.
    #[cfg(test)]
    pub fn widen(&mut self, size: [u32; 2]) {
        for slab in self.cases.iter_mut().flat_map(|case| &mut case.slabs) {
            slab.eye = Rect::whole(size).in_workgroups(size);
            slab.light = Rect::whole(self.texels).in_workgroups(self.texels);
        }
    }
}

/// Least and greatest of all.
fn whole(spans: &[(f64, f64)]) -> (f64, f64) {
    spans.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (low, high)| (a.min(*low), b.max(*high)))
}

/// Two axes perpendicular to a light (Frisvad 2012). They turn with it, without a jump unless it shines at the eye.
pub(crate) fn across_light(light: DVec3) -> [DVec3; 2] {
    if light.z < -0.999_999 {
        return [DVec3::X, -DVec3::Y];
    }
    let a = 1.0 / (1.0 + light.z);
    let b = -light.x * light.y * a;
    [
        DVec3::new(1.0 - light.x * light.x * a, b, -light.x),
        DVec3::new(b, 1.0 - light.y * light.y * a, -light.y),
    ]
}
