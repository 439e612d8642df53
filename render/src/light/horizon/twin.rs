//! The frame that passes of ambient occlusion read, and the twin of their filter, in `f64`.

use glam::{DVec2, DVec3};
use glioscope_core::optics::{Camera, Sight, srgb};

use crate::{
    solid::view::FAR,
    testing::GPU,
    views::{Frame, View3d},
};

/// lib/normal's `unpacked_normal`.
pub(crate) fn unpacked(packed: u32) -> DVec3 {
    let part = |shift: u32| (f64::from((packed >> shift) as u16 as i16) / 32767.0).max(-1.0);
    let p = DVec2::new(part(0), part(16));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = |a: f64, b: f64| (1.0 - b.abs()) * if a >= 0.0 { 1.0 } else { -1.0 };
    let q = if z < 0.0 { DVec2::new(fold(p.x, p.y), fold(p.y, p.x)) } else { p };
    q.extend(z).normalize_or_zero()
}

/// Depths and normals of a drawn frame. Camera space: right, up, view depth from the eye plane.
pub(crate) struct Surface {
    pub size: [usize; 2],
    pub sight: Sight,
    pub camera: Camera,
    /// Millimetres from the eye plane; infinite on the background.
    pub depths_mm: Vec<f64>,
    pub normals: Vec<DVec3>,
}

impl Surface {
    pub fn of<V: View3d>(frame: &Frame<V>) -> Self {
        let from_eye = |d: &f32| if *d < FAR { frame.reference_mm + f64::from(*d) } else { f64::INFINITY };
        Self {
            size: frame.size_px.map(|s| s as usize),
            sight: Sight::new(&frame.camera, frame.size_px),
            camera: frame.camera,
            depths_mm: frame.read_depths(&GPU).iter().map(from_eye).collect(),
            normals: frame.read_normals(&GPU).into_iter().map(unpacked).collect(),
        }
    }

    pub fn pixel(&self, number: usize) -> [usize; 2] {
        [number % self.size[0], number / self.size[0]]
    }

    /// The point of a pixel, camera space; far away on the background.
    pub fn point(&self, [x, y]: [usize; 2]) -> DVec3 {
        let depth = self.depths_mm[y * self.size[0] + x].min(1e30);
        (self.sight.from_middle([x as u32, y as u32]) * self.sight.pixel_mm(depth)).extend(depth)
    }

    /// Direction of a pixel's ray, camera space.
    pub fn direction(&self, [x, y]: [usize; 2]) -> DVec3 {
        let p = self.sight.from_middle([x as u32, y as u32]) * self.sight.growth();
        p.extend(1.0).normalize_or_zero()
    }

    /// A direction of camera space in the world.
    pub fn in_world(&self, v: DVec3) -> DVec3 {
        let [right, up, back] = self.camera.axes();
        right * v.x + up * v.y - back * v.z
    }
}

/// horizon/along_surface: from darkness of 8 bits, the darkness that it stores, 0 to 255 and not rounded; `None` on the
/// background, and where single precision decides whether a pixel is on the same surface.
/// `rays`: of each pixel's darkness, 0 where it isn't by rays.
pub(crate) fn filtered(surface: &Surface, occlusion: &[u32], radius_mm: f64, rays: u32) -> Vec<Option<f64>> {
    let share = |at: usize| f64::from(occlusion[at] >> 24) / 255.0;
    let most = |share: f64| {
        let n = f64::from(rays);
        let p = (share * n + 1.0) / (n + 2.0);
        if rays < 32 { 2.0 } else { 4.0 * (p * (1.0 - p) / n).sqrt() }
    };
    let last = surface.size.map(|s| s as i64 - 1);
    let of_pixel = |i: usize| {
        let depth = surface.depths_mm[i];
        if !depth.is_finite() {
            return None;
        }
        let [x, y] = surface.pixel(i);
        let (n, c) = (surface.normals[i], surface.point([x, y]));
        let reach = (0.06 * radius_mm).max(2.0 * surface.sight.pixel_mm(depth));
        let (mut sum, mut weight, mut ambiguous) = (0.0, 0.0, false);
        for (dx, dy) in (-2..2).flat_map(|dy: i64| (-2..2).map(move |dx: i64| (dx, dy))) {
            let to =
                [(x as i64 + dx).clamp(0, last[0]), (y as i64 + dy).clamp(0, last[1])].map(|v| v as usize);
            let there = to[1] * surface.size[0] + to[0];
            if !surface.depths_mm[there].is_finite() {
                continue;
            }
            let off = (surface.point(to) - c).dot(n).abs();
            let cosine = surface.normals[there].dot(n);
            let apart = (share(there) - share(i)).abs() - most(share(i));
            ambiguous |= (off - reach).abs() < 1e-3 || (cosine - 0.85).abs() < 1e-4 || apart.abs() < 1e-5;
            if off < reach && cosine > 0.85 && apart < 0.0 {
                sum += share(there);
                weight += 1.0;
            }
        }
        (!ambiguous).then(|| 255.0 * (1.0 - srgb::encode(1.0 - sum / f64::max(weight, 1.0))))
    };
    (0..surface.depths_mm.len()).map(of_pixel).collect()
}

/// Largest difference of stored bytes from unrounded values, beyond the rounding and a tie in it, as a share; and how many
/// pixels of some darkness were compared.
pub(crate) fn worst_byte(found: &[u32], expected: &[Option<f64>]) -> (f64, usize) {
    let pairs = found.iter().zip(expected).filter_map(|(found, e)| e.map(|e| (f64::from(found >> 24), e)));
    pairs.fold((0.0f64, 0), |(worst, count), (found, expected)| {
        let off = ((found - expected).abs() - 0.51).max(0.0) / 255.0;
        (worst.max(off), count + usize::from(expected > 1.0))
    })
}
