//! Paths of light on the CPU in `f64` with the device's random numbers: in world space, with the transfer function itself,
//! with voxels found by sorting instead of stepping. Camera space here counts depths from the eye.

use glam::{DVec2, DVec3, UVec2};
use glioscope_core::{
    RegionVolume, Selection,
    optics::{Ray, Sight, srgb},
};

use super::uniforms::Step;
use crate::{
    image::volume::BRICK,
    scene::Lens,
    views::context::{
        ContextScene,
        reference::{box_interval, in_index_space, sample},
    },
};

/// A decision by less than this share, or this many millimetres, may be another one in single precision.
const AMBIGUOUS: f64 = 3e-4;

/// Transmittance at which ratio tracking ends.
const DARKNESS: f64 = 1e-4;

fn hashed(value: u32) -> u32 {
    let mut h = (value ^ value >> 16).wrapping_mul(0x7feb_352d);
    h = (h ^ h >> 15).wrapping_mul(0x846c_a68b);
    h ^ h >> 16
}

fn hash_of_pixel([x, y]: [u32; 2], salt: u32) -> u32 {
    let y = hashed(y.wrapping_mul(0xd816_3841).wrapping_add(hashed(salt)));
    hashed(x.wrapping_mul(0x8da6_b343).wrapping_add(y))
}

fn unit(bits: u32) -> f64 {
    f64::from(bits >> 8) / 16_777_216.0
}

fn first_point(pixel: [u32; 2], half: u32, k: u32) -> DVec2 {
    let part = |factor: u32, salt: u32| {
        unit(k.wrapping_mul(factor).wrapping_add(hash_of_pixel(pixel, 2 * half + salt)))
    };
    DVec2::new(part(3_242_174_889, 1), part(2_447_445_414, 5))
}

/// The stream of a path, and whether rounding may have decided anything on it.
struct Walk {
    state: u32,
    is_ambiguous: bool,
}

impl Walk {
    fn random(&mut self) -> f64 {
        self.state = self.state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((self.state >> ((self.state >> 28) + 4)) ^ self.state).wrapping_mul(277_803_737);
        unit(word >> 22 ^ word)
    }

    /// Whether `a < b`.
    fn is_less(&mut self, a: f64, b: f64) -> bool {
        self.is_ambiguous |= (a - b).abs() < AMBIGUOUS;
        a < b
    }
}

struct Travel {
    along: Option<f64>,
    left: f64,
    color: [f64; 3],
}

/// Where a ray meets a voxel: millimetres, region number, axis of the face (3: it started inside).
type Met = Option<(f64, u32, usize)>;

#[derive(Clone, Copy)]
struct Vertex {
    c: DVec3,
    on_surface: bool,
    axis: DVec3,
    throughput: DVec3,
}

/// A scene that paths go through.
pub struct PathTwin<'a> {
    pub scene: &'a ContextScene,
    pub sight: &'a Sight,
    /// Of the image's bricks.
    pub majorants: &'a [f32],
    pub brick_dims: [usize; 3],
    /// What paths meet.
    pub masks: Option<(&'a RegionVolume, &'a Selection)>,
    /// Encoded colours by region number.
    pub colors: &'a [[u8; 3]],
    /// What cuts the masks.
    pub lens: Option<Lens>,
    pub step: Step,
    pub strength: f64,
}

fn tangents(n: DVec3) -> [DVec3; 2] {
    let side = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    [DVec3::new(1.0 + side * n.x * n.x * a, side * b, -side * n.x), DVec3::new(b, side + n.y * n.y * a, -n.y)]
}

fn about(axis: DVec3, cosine: f64, turn: f64) -> DVec3 {
    let [u, v] = tangents(axis);
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
    sine * cos * u + sine * sin * v + cosine * axis
}

fn decoded(color: [f64; 3]) -> DVec3 {
    DVec3::from_array(color.map(srgb::decode))
}

impl PathTwin<'_> {
    fn turned(&self, v: DVec3) -> DVec3 {
        self.sight.right * v.x + self.sight.up * v.y + self.sight.forward * v.z
    }

    /// A ray of camera space.
    fn ray(&self, c: DVec3, w: DVec3) -> Ray {
        Ray { origin_mm: self.sight.eye_mm + self.turned(c), direction: self.turned(w) }
    }

    /// The interval of a ray in the image's box, behind the eye's plane, not clipped.
    fn span(&self, ray: &Ray) -> (f64, f64) {
        let Some(volume) = &self.scene.volume else { return (0.0, 0.0) };
        let (mut near, mut far) = box_interval(volume.grid(), ray);
        let eye = (-self.sight.forward, -self.sight.forward.dot(self.sight.eye_mm));
        for (normal, offset) in self.scene.clip.iter().map(|p| (p.normal, p.offset_mm)).chain([eye]) {
            let (room, rate) = (offset - normal.dot(ray.origin_mm), normal.dot(ray.direction));
            if rate > 0.0 {
                far = far.min(room / rate);
            } else if rate < 0.0 {
                near = near.max(room / rate);
            } else if room < 0.0 {
                far = near;
            }
        }
        (near.max(0.0), far)
    }

    /// Whether the image is drawn at a point: not in the masks' box, not in front of it.
    fn is_drawn(&self, at_mm: DVec3, walk: &mut Walk) -> bool {
        let Some(tumor) = &self.scene.tumor else { return true };
        let sight = match self.sight.growth() > 0.0 {
            true => at_mm - self.sight.eye_mm,
            false => self.sight.forward * self.sight.depth_mm(at_mm),
        };
        let far_mm = sight.length();
        let ray = Ray { origin_mm: at_mm - sight, direction: sight / far_mm };
        let (enter, leave) = box_interval(tumor.grid(), &ray);
        walk.is_ambiguous |= (enter.max(0.0) - leave).abs() < 0.01;
        enter.max(0.0) >= leave || !walk.is_less(far_mm, leave)
    }

    fn travel(
        &self,
        (c, w): (DVec3, DVec3),
        (begin, end): (f64, f64),
        by_ratio: bool,
        walk: &mut Walk,
    ) -> Travel {
        let mut out = Travel { along: None, left: 1.0, color: [0.0; 3] };
        let Some(volume) = self.scene.volume.as_ref().filter(|_| begin < end) else { return out };
        let (grid, ray) = (volume.grid(), self.ray(c, w));
        let (o, d) = in_index_space(grid, &ray);
        let start = o + begin * d;
        let mut brick: [usize; 3] = std::array::from_fn(|a| {
            let last = grid.dims()[a].saturating_sub(1);
            (start[a].clamp(0.0, last as f64) as usize).min(grid.dims()[a].max(2) - 2) / BRICK
        });
        let (mut t, mut thickness) = (begin, None);
        while t < end {
            let at = (brick[2] * self.brick_dims[1] + brick[1]) * self.brick_dims[0] + brick[0];
            let majorant = f64::from(self.majorants[at]);
            let (mut past, mut axis) = (f64::INFINITY, 0);
            for a in 0..3 {
                let outermost = if d[a] > 0.0 { brick[a] + 1 == self.brick_dims[a] } else { brick[a] == 0 };
                let bound = (BRICK * (brick[a] + usize::from(d[a] > 0.0))) as f64;
                if d[a] != 0.0 && !outermost && (bound - o[a]) / d[a] < past {
                    (past, axis) = ((bound - o[a]) / d[a], a);
                }
            }
            let is_end = past >= end;
            let past = past.min(end).max(t);
            if majorant > 0.0 {
                let wanted = thickness.unwrap_or_else(|| -(1.0 - walk.random()).ln());
                let there = t + wanted / majorant;
                if walk.is_less(there, past) {
                    (t, thickness) = (there, None);
                    let (color, per_mm) = sample(self.scene, o + t * d);
                    let extinction = -(1.0 - per_mm).max(1e-30).ln();
                    let shown = extinction <= 0.0 || self.is_drawn(ray.origin_mm + t * ray.direction, walk);
                    let share = if shown { (extinction / majorant).min(1.0) } else { 0.0 };
                    if by_ratio {
                        out.left *= 1.0 - share;
                        if out.left < DARKNESS {
                            return Travel { left: 0.0, ..out };
                        }
                    } else {
                        let chance = walk.random();
                        if walk.is_less(chance, share) {
                            return Travel { along: Some(t), color, ..out };
                        }
                    }
                    continue;
                }
                thickness = Some((wanted - (past - t) * majorant).max(0.0));
            }
            t = past;
            if is_end {
                break;
            }
            brick[axis] = if d[axis] > 0.0 { brick[axis] + 1 } else { brick[axis] - 1 };
        }
        out
    }

    /// The first shown voxel of a ray, at most `far_mm` long: all boundaries that it crosses are listed and sorted.
    fn met_on(&self, ray: &Ray, far_mm: f64) -> Met {
        let (masks, selection) = self.masks?;
        let grid = masks.grid();
        let (begin, end) = box_interval(grid, ray);
        let (begin, end) = (begin.max(0.0), end.min(far_mm));
        let (o, d) = in_index_space(grid, ray);
        let mut stops = vec![(begin, 3), (end, 3)];
        for axis in 0..3 {
            let bounds = (0..=grid.dims()[axis]).map(|b| ((b as f64 - 0.5 - o[axis]) / d[axis], axis));
            stops.extend(bounds.filter(|(t, _)| *t > begin && *t < end));
            // The face by which the ray comes into the box.
            let face = if d[axis] > 0.0 { -0.5 } else { grid.dims()[axis] as f64 - 0.5 };
            if begin > 0.0 && ((face - o[axis]) / d[axis] - begin).abs() < 1e-9 {
                stops[0].1 = axis;
            }
        }
        stops.sort_by(|a, b| a.0.total_cmp(&b.0));
        stops.windows(2).find_map(|pair| {
            let middle = (o + d * (0.5 * (pair[0].0 + pair[1].0)) + 0.5).floor();
            let inside = (0..3).all(|a| middle[a] >= 0.0 && middle[a] < grid.dims()[a] as f64);
            if pair[1].0 <= pair[0].0 || !inside {
                return None;
            }
            let number = masks.id(grid.linear(middle.to_array().map(|m| m as usize)));
            let is_shown = number != 0 && selection.shows(masks.bits_of_id()[number as usize]);
            is_shown.then_some((pair[0].0, number, pair[0].1))
        })
    }

    fn met(&self, c: DVec3, w: DVec3, walk: &mut Walk) -> Met {
        self.masks?;
        let ray = self.ray(c, w);
        let mut far_mm = if w.z < 0.0 { -c.z / w.z } else { f64::INFINITY };
        if let Some(lens) = &self.lens {
            let from = ray.origin_mm - lens.center_mm;
            let (b, inside) = (from.dot(ray.direction), lens.radius_mm.powi(2) - from.length_squared());
            far_mm = far_mm.min(if inside > 0.0 { (b * b + inside).sqrt() - b } else { 0.0 });
            walk.is_ambiguous |= inside.abs() < 0.01;
        }
        let found = self.met_on(&ray, far_mm);
        let same = |other: Met| match (found, other) {
            (Some((t, number, axis)), Some((s, other, face))) => {
                number == other && axis == face && (t - s).abs() < 0.01
            }
            (None, None) => true,
            _ => false,
        };
        let shifts = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
        let is_sure = shifts
            .map(|off| Ray { origin_mm: ray.origin_mm + 1e-4 * off, ..ray })
            .all(|moved| same(self.met_on(&moved, far_mm)))
            && [-1e-4, 1e-4].iter().all(|off| same(self.met_on(&ray, (far_mm + off).max(0.0))));
        walk.is_ambiguous |= !is_sure;
        found
    }

    fn scattered_from(&self, v: &Vertex, w: DVec3) -> f64 {
        let (cosine, g) = (v.axis.dot(w), f64::from(self.step.anisotropy));
        match v.on_surface {
            true => cosine.max(0.0),
            false => 0.25 * (1.0 - g * g) / (1.0 + g * g - 2.0 * g * cosine).powf(1.5),
        }
    }

    fn scattered_to(&self, v: &Vertex, u: DVec2) -> DVec3 {
        let g = f64::from(self.step.anisotropy);
        let cosine = if v.on_surface {
            (1.0 - u.x).sqrt()
        } else if g.abs() < 1e-3 {
            1.0 - 2.0 * u.x
        } else {
            (1.0 + g * g - ((1.0 - g * g) / (1.0 - g + 2.0 * g * u.x)).powi(2)) / (2.0 * g)
        };
        about(v.axis, cosine.clamp(-1.0, 1.0), u.y)
    }

    fn collected(&self, start: Vertex, first: DVec2, walk: &mut Walk) -> DVec3 {
        let (mut v, mut turn, mut sum) = (start, first, DVec3::ZERO);
        let step = &self.step;
        let lamp = DVec3::from_array(step.lamp.map(f64::from));
        for n in 1..=step.bounces {
            if step.lamp_light > 0.0 {
                let cosine = 1.0 - walk.random() * f64::from(step.lamp_cap);
                let l = about(lamp, cosine, walk.random());
                let share = self.scattered_from(&v, l);
                walk.is_ambiguous |= v.on_surface && share < 1e-5 && v.axis.dot(l) > -1e-5;
                if share > 0.0 && self.met(v.c, l, walk).is_none() {
                    let span = self.span(&self.ray(v.c, l));
                    let left = self.travel((v.c, l), span, true, walk).left;
                    sum += v.throughput * (f64::from(step.lamp_light) * share * left);
                }
            }
            let w = self.scattered_to(&v, turn);
            let met = self.met(v.c, w, walk);
            let (near, far) = self.span(&self.ray(v.c, w));
            let far = far.min(met.map_or(f64::INFINITY, |m| m.0));
            let flight = self.travel((v.c, w), (near, far), n == step.bounces, walk);
            v = match (flight.along, met) {
                (Some(along), _) => Vertex {
                    c: v.c + along * w,
                    on_surface: false,
                    axis: w,
                    throughput: v.throughput * decoded(flight.color),
                },
                (None, Some((along, number, axis))) => {
                    let normal = self.normal_of_face(axis, w);
                    let color = self.colors[number as usize].map(|c| f64::from(c) / 255.0);
                    Vertex {
                        c: v.c + along * w + 0.01 * self.voxel_along(normal) * normal,
                        on_surface: true,
                        axis: normal,
                        throughput: v.throughput * decoded(color),
                    }
                }
                (None, None) => return sum + v.throughput * (f64::from(step.sky) * flight.left),
            };
            turn = DVec2::new(walk.random(), walk.random());
        }
        sum
    }

    fn normal_of_face(&self, axis: usize, w: DVec3) -> DVec3 {
        let Some((masks, _)) = self.masks.filter(|_| axis < 3) else { return -w };
        let of_index = masks.grid().voxel_from_world().matrix3.row(axis);
        let s = self.sight;
        let n = DVec3::new(of_index.dot(s.right), of_index.dot(s.up), of_index.dot(s.forward));
        n.normalize_or_zero() * if n.dot(w) > 0.0 { -1.0 } else { 1.0 }
    }

    /// How far along a direction a voxel's side is crossed.
    fn voxel_along(&self, n: DVec3) -> f64 {
        let steep = self.masks.map(|(masks, _)| masks.grid().voxel_from_world().matrix3 * self.turned(n));
        1.0 / steep.map_or(1.0, |s| s.abs().max_element())
    }

    /// Both halves' sums of light and numbers of paths from the image in a pixel, before what is opaque at this view depth
    /// from the eye; `None` where rounding may decide.
    pub fn in_image(
        &self,
        pixel: [u32; 2],
        near_far_mm: (f64, f64),
        half_paths: u32,
    ) -> Option<[(DVec3, u32); 2]> {
        let slope = (self.sight.from_middle(pixel) * self.sight.growth()).extend(1.0);
        let (c, w) = (
            (self.sight.from_middle(pixel) * self.sight.pixel_mm(0.0)).extend(0.0),
            slope.normalize_or_zero(),
        );
        let mut out = [(DVec3::ZERO, 0); 2];
        for (half, (sum, count)) in (0u32..).zip(&mut out) {
            for first in 0..half_paths {
                let state = hash_of_pixel(pixel, 18 + 4 * first + half);
                let mut walk = Walk { state, is_ambiguous: false };
                let flight = (0..4).find_map(|_| {
                    let flight = self.travel((c, w), near_far_mm, false, &mut walk);
                    flight.along.map(|along| (along, flight.color))
                });
                if let Some((along, color)) = flight {
                    let throughput = decoded(color);
                    let start = Vertex { c: c + along * w, on_surface: false, axis: w, throughput };
                    let light = self.collected(start, first_point(pixel, half, *count), &mut walk);
                    *sum += throughput.lerp(light, self.strength);
                    *count += 1;
                }
                if walk.is_ambiguous {
                    return None;
                }
            }
        }
        Some(out)
    }

    /// Mean light on a surface of this depth from the eye and normal.
    pub fn on_surface(
        &self,
        pixel: [u32; 2],
        depth_mm: f64,
        normal: DVec3,
        half_paths: u32,
    ) -> Option<DVec3> {
        let c = (self.sight.from_middle(pixel) * self.sight.pixel_mm(depth_mm)).extend(depth_mm);
        let c = if self.masks.is_some() { c + self.voxel_along(normal) * normal } else { c };
        let start = Vertex { c, on_surface: true, axis: normal, throughput: DVec3::ONE };
        let mut sum = DVec3::ZERO;
        for (half, first) in (0..half_paths).flat_map(|first| [(0, first), (1, first)]) {
            let mut walk = Walk { state: hash_of_pixel(pixel, 16 + 4 * first + half), is_ambiguous: false };
            sum += self.collected(start, first_point(pixel, half, first), &mut walk);
            if walk.is_ambiguous {
                return None;
            }
        }
        Some(sum / f64::from(2 * half_paths))
    }
}

/// A pixel by its number in a frame.
pub fn pixel_of(number: usize, size: [u32; 2]) -> [u32; 2] {
    UVec2::new(number as u32 % size[0], number as u32 / size[0]).to_array()
}
