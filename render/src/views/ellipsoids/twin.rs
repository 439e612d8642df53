//! The diagram on the CPU in `f64`, by another method than the shaders': quadratics in world space, no
//! tiles, no reference plane; distances to outlines from neighbouring rays.

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::optics::{Projection, Ray};

use crate::{
    scene::SlicePlane,
    views::ellipsoids::{DrawnEllipsoid, EllipsoidScene},
};

/// One surface that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    pub depth_mm: f64,
    pub id: u32,
    pub back: bool,
    pub world_mm: DVec3,
    pub alpha: f64,
    color: DVec3,
}

#[derive(Clone, Debug, Default)]
pub struct Pixel {
    /// Sorted by depth, then id, then front before back.
    pub fragments: Vec<Fragment>,
    pub color: DVec3,
    /// On the lens's ring with its edges, which the twin doesn't draw.
    pub on_ring: bool,
    /// A ray that grazes an ellipsoid, or meets two distinct surfaces within 1e-3 mm: `f32` may count or
    /// order them differently.
    pub delicate: bool,
}

/// f(t) = a t^2 + 2 b t + c is less than 0 inside, t counted from near the centre.
fn quadratic(ray: Ray, e: &DrawnEllipsoid) -> (f64, f64, f64, f64) {
    let inverse = DMat3::from_diagonal((e.semi_axes_mm * e.semi_axes_mm).recip());
    let form = e.rotation * inverse * e.rotation.transpose();
    let from = (e.center_mm - ray.origin_mm).dot(ray.direction);
    let o = ray.origin_mm - e.center_mm + ray.direction * from;
    let a = ray.direction.dot(form * ray.direction);
    (a, ray.direction.dot(form * o), o.dot(form * o) - 1.0, from)
}

/// Square of a ray's minimum distance from the centre, the surface being at 1.
fn min_distance2(ray: Ray, e: &DrawnEllipsoid) -> f64 {
    let (a, b, c, _) = quadratic(ray, e);
    (c + 1.0 - b * b / a).max(0.0)
}

pub fn cast(scene: &EllipsoidScene, size: [u32; 2]) -> Vec<Pixel> {
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y]));
    pixels.map(|pixel| cast_one(scene, size, pixel)).collect()
}

fn cast_one(scene: &EllipsoidScene, size: [u32; 2], pixel: [u32; 2]) -> Pixel {
    let drawn = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let middle = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let ray_at = |at: DVec2| scene.camera.ray(at, drawn);
    let ray = ray_at(middle);
    let along = ray.direction.dot(-scene.camera.axes()[2]);
    let line_scale = (drawn.y / 512.0).clamp(0.6, 4.0);
    let mut out = Pixel::default();
    let mut greyed = 0.0;
    if let Some(lens) = scene.lens {
        let to = lens.center_mm - ray.origin_mm;
        let t = to.dot(ray.direction);
        let mm_per_pixel = match scene.camera.projection {
            Projection::Orthographic => scene.camera.height_mm / drawn.y,
            Projection::Perspective => {
                scene.camera.height_mm / drawn.y * t * along / scene.camera.distance_mm()
            }
        };
        let off_mm = (to - ray.direction * t).length() - lens.radius_mm;
        out.on_ring = off_mm.abs() < (2.2 * line_scale + 1.0) * mm_per_pixel;
        greyed = if t > 0.0 { (0.5 + off_mm / mm_per_pixel).clamp(0.0, 1.0) } else { 1.0 };
    }
    for e in scene.ellipsoids.iter() {
        let opacity = (e.opacity * scene.opacity).clamp(0.0, 1.0);
        let r = min_distance2(ray, e).sqrt();
        out.delicate |= opacity > 0.0 && (r - 1.0).abs() < 1e-4;
        if opacity == 0.0 || r >= 1.0 {
            continue;
        }
        let h = 1e-3;
        // The square has no kink on the axis, and its slope is 2 r times that of r.
        let slope = |d: DVec2| {
            let square = |sign: f64| min_distance2(ray_at(middle + d * (sign * h)), e);
            (square(1.0) - square(-1.0)) / (2.0 * h) / (2.0 * r).max(1e-12)
        };
        let inset_px = (1.0 - r) / DVec2::new(slope(DVec2::X), slope(DVec2::Y)).length().max(1e-12);
        let (a, b, c, from) = quadratic(ray, e);
        let root = (b * b - a * c).sqrt();
        for (back, t) in [(false, (-b - root) / a), (true, (-b + root) / a)] {
            let t = from + t;
            out.delicate |= t.abs() < 1e-4;
            if t <= 0.0 {
                continue;
            }
            let world_mm = ray.origin_mm + ray.direction * t;
            let off = e.rotation.transpose() * (world_mm - e.center_mm);
            let normal = e.rotation * (off / (e.semi_axes_mm * e.semi_axes_mm));
            let facing = normal.dot(ray.direction).abs() / normal.length();
            let mut color = DVec3::from_array(e.color.map(|c| f64::from(c) / 255.0));
            let grey = 0.38 + 0.4 * color.dot(DVec3::new(0.299, 0.587, 0.114));
            color = color.lerp(DVec3::splat(grey), greyed);
            color *= 0.42 + 0.58 * facing;
            if !back {
                color += 0.28 * (2.0 * facing * facing - 1.0).max(0.0).powf(24.0);
            }
            color = color.min(DVec3::ONE);
            let line = (1.3 * line_scale + 1.0 - inset_px).clamp(0.0, 1.0);
            color = color.lerp(DVec3::from_array(scene.silhouette.map(|c| f64::from(c) / 255.0)), line);
            let shell = 1.0 - (1.0 - opacity).powf((1.0 / facing.max(1e-3)).min(2.5));
            let alpha = (shell * (1.0 - line) + (3.0 * opacity).min(1.0) * line) * inset_px.clamp(0.0, 1.0);
            out.fragments.push(Fragment { depth_mm: t * along, id: e.id, back, world_mm, alpha, color });
        }
    }
    out.fragments.sort_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm).then((a.id, a.back).cmp(&(b.id, b.back))));
    for pair in out.fragments.windows(2) {
        let gap = pair[1].depth_mm - pair[0].depth_mm;
        out.delicate |= gap > 0.0 && gap < 1e-3;
    }
    let mut through = 1.0;
    let mut layers: Vec<(f64, f64, DVec3)> =
        out.fragments.iter().map(|f| (f.depth_mm, f.alpha, f.color * f.alpha)).collect();
    if let Some((depth, alpha, color)) = scene.plane.as_ref().and_then(|p| plane_at(p, ray, along)) {
        out.delicate |= layers.iter().any(|l| (l.0 - depth).abs() < 1e-3);
        let at = layers.iter().position(|l| l.0 >= depth).unwrap_or(layers.len());
        layers.insert(at, (depth, alpha, color));
    }
    for (_, alpha, color) in layers {
        out.color += color * through;
        through *= 1.0 - alpha;
    }
    out.color += DVec3::from_array(scene.background.map(|c| f64::from(c) / 255.0)) * through;
    out
}

/// Depth, alpha and premultiplied colour of a slice where a ray meets it.
pub fn plane_at(plane: &SlicePlane, ray: Ray, along: f64) -> Option<(f64, f64, DVec3)> {
    // corner + u right + v down = origin + t direction
    let m = DMat3::from_cols(plane.right_mm, plane.down_mm, -ray.direction);
    let uvt = m.inverse() * (ray.origin_mm - plane.corner_mm);
    if !uvt.is_finite() || uvt.z <= 0.0 || uvt.x < 0.0 || uvt.x > 1.0 || uvt.y < 0.0 || uvt.y > 1.0 {
        return None;
    }
    let texel = |x: i64, y: i64| {
        let x = x.clamp(0, i64::from(plane.size_px[0]) - 1) as usize;
        let y = y.clamp(0, i64::from(plane.size_px[1]) - 1) as usize;
        let at = 4 * (y * plane.size_px[0] as usize + x);
        let [r, g, b, a] = [0, 1, 2, 3].map(|k| f64::from(plane.rgba[at + k]) / 255.0);
        (a, DVec3::new(r, g, b) * a)
    };
    let at = DVec2::new(uvt.x * f64::from(plane.size_px[0]), uvt.y * f64::from(plane.size_px[1])) - 0.5;
    let (mut alpha, mut color) = (0.0, DVec3::ZERO);
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let low = at.floor();
        let part = at - low;
        let w = (if dx == 1 { part.x } else { 1.0 - part.x }) * (if dy == 1 { part.y } else { 1.0 - part.y });
        let (a, c) = texel(low.x as i64 + dx, low.y as i64 + dy);
        alpha += w * a;
        color += c * w;
    }
    Some((uvt.z * along, alpha * plane.opacity, color * plane.opacity))
}
