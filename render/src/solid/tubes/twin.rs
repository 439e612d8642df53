//! Intersections of rays with tubes in `f64`, by brute force: the nearest of all balls and cylinders.

use glam::{DVec2, DVec3};
use glioscope_core::optics::{Camera, Projection, Ray};

use crate::solid::tubes::{DrawnTubes, buffers::LEAST_PX};

/// A ray's first hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TwinHit {
    /// View depth, from the eye.
    pub depth_mm: f64,
    /// Fibre number among all drawn sets.
    pub number: u32,
    /// Cosine between the ray and the surface's normal.
    pub facing: f64,
    /// Where it is, world millimetres.
    pub place_mm: DVec3,
}

fn ball(ray: &Ray, center: DVec3, radius: f64) -> Option<(f64, DVec3)> {
    let o = ray.origin_mm - center;
    let b = o.dot(ray.direction);
    let root2 = b * b - o.length_squared() + radius * radius;
    let t = -b - root2.sqrt();
    (root2 >= 0.0).then(|| (t, (o + t * ray.direction) / radius))
}

/// The side of a cylinder without its ends.
fn side(ray: &Ray, a: DVec3, b: DVec3, radius: f64) -> Option<(f64, DVec3)> {
    let axis = (b - a).try_normalize()?;
    let across = |v: DVec3| v - axis * v.dot(axis);
    let (o, d) = (across(ray.origin_mm - a), across(ray.direction));
    let (p, q) = (d.length_squared(), o.dot(d));
    let root2 = q * q - p * (o.length_squared() - radius * radius);
    if p < 1e-14 || root2 < 0.0 {
        return None;
    }
    let t = (-q - root2.sqrt()) / p;
    let along = (ray.origin_mm + t * ray.direction - a).dot(axis);
    (0.0..=a.distance(b)).contains(&along).then(|| (t, (o + t * d) / radius))
}

/// First hit of `tubes` at each pixel of a frame, row after row.
pub(super) fn tubes_seen(tubes: &[DrawnTubes], camera: &Camera, size: [u32; 2]) -> Vec<Option<TwinHit>> {
    let away = -camera.axes()[2];
    let eye = camera.eye_mm();
    let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let line_scale = (size_px.y / 512.0).clamp(0.6, 4.0);
    // Footprint of a pixel in millimetres at a depth from the eye.
    let footprint = |depth: f64| match camera.projection {
        Projection::Orthographic => camera.height_mm / size_px.y,
        Projection::Perspective => camera.height_mm / size_px.y * depth / camera.distance_mm(),
    };
    let mut capsules = Vec::new();
    let mut number = 0;
    for drawn in tubes.iter().filter(|t| t.draws()) {
        let set = &drawn.set;
        for n in 0..set.fiber_count() {
            let points: Vec<DVec3> =
                set.fiber(n).iter().map(|p| set.origin_mm() + DVec3::from_array(p.map(f64::from))).collect();
            let segments = points.windows(2).map(|s| (s[0], s[1]));
            let alone = (points.len() == 1).then(|| (points[0], points[0]));
            for (a, b) in segments.chain(alone) {
                let middle = ((a + b) / 2.0 - eye).dot(away);
                let radius = drawn.radius_mm().max(LEAST_PX * line_scale * footprint(middle));
                capsules.push((a, b, radius, number));
            }
            number += 1;
        }
    }
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| DVec2::new(f64::from(x), f64::from(y))));
    pixels
        .map(|pixel| {
            let ray = camera.ray(pixel + 0.5, size_px);
            let slant = ray.direction.dot(away);
            let mut best: Option<TwinHit> = None;
            for &(a, b, radius, number) in &capsules {
                // A capsule is entered at the first of its three parts; one that contains the eye is
                // invisible.
                let parts = [ball(&ray, a, radius), ball(&ray, b, radius), side(&ray, a, b, radius)];
                let Some((t, normal)) =
                    parts.into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0)).filter(|hit| hit.0 > 0.0)
                else {
                    continue;
                };
                let depth_mm = t * slant;
                if best.is_none_or(|b| depth_mm < b.depth_mm) {
                    let place_mm = ray.origin_mm + t * ray.direction;
                    best = Some(TwinHit { depth_mm, number, facing: -normal.dot(ray.direction), place_mm });
                }
            }
            best
        })
        .collect()
}
