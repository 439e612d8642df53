//! A round sheet with hills and valleys: a sum of Gaussians over a plane, whose curvatures have closed forms.

use glam::{DMat3, DVec2, DVec3};

use crate::optics::Ray;

/// A hill, or a valley where its height is negative.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hill {
    /// Where it is in the plane.
    pub center: DVec2,
    /// Standard deviation.
    pub width_mm: f64,
    /// Height above the plane.
    pub height_mm: f64,
}

/// A sheet.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    /// The disc's centre in its plane.
    pub center: DVec3,
    /// Two axes of the plane, and the normal towards the side of the hills: orthonormal columns.
    pub axes: DMat3,
    /// The disc's radius.
    pub radius_mm: f64,
    /// Thickness along the normal.
    pub thickness_mm: f64,
    /// The hills.
    hills: Vec<Hill>,
    /// Between them it lies.
    levels: [f64; 2],
}

/// Least step along a ray in search of the surface, and the width to which it is then bisected.
const STEP_MM: f64 = 0.4;
const FOUND_MM: f64 = 1e-6;
/// Distance of the places by which the highest and lowest level are bounded.
const LATTICE_MM: f64 = 1.5;

impl Sheet {
    pub fn new(center: DVec3, axes: DMat3, [radius_mm, thickness_mm]: [f64; 2], hills: Vec<Hill>) -> Self {
        let mut sheet = Self { center, axes, radius_mm, thickness_mm, hills, levels: [0.0; 2] };
        let half = (radius_mm / LATTICE_MM).ceil() as i32 + 1;
        let heights =
            (-half..=half).flat_map(|y| (-half..=half).map(move |x| DVec2::new(f64::from(x), f64::from(y))));
        let heights = heights.map(|at| sheet.height(at * LATTICE_MM));
        let [low, high] =
            heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| [low.min(h), high.max(h)]);
        // What interpolation between the places is off by at most: a hill bends most at its top.
        let bent: f64 = sheet.hills.iter().map(|hill| hill.height_mm.abs() / hill.width_mm.powi(2)).sum();
        let off = LATTICE_MM * LATTICE_MM / 4.0 * bent;
        sheet.levels = [low - off - thickness_mm, high + off];
        sheet
    }

    pub fn ball(&self) -> (DVec3, f64) {
        let [low, high] = self.levels();
        (self.center, self.radius_mm.hypot(high.abs().max(low.abs())))
    }

    /// The lowest and the highest level above the plane that it can have.
    pub fn levels(&self) -> [f64; 2] {
        self.levels
    }

    /// A world point in the sheet's axes.
    pub fn local(&self, point: DVec3) -> DVec3 {
        self.axes.transpose() * (point - self.center)
    }

    /// The point of its surface above a place of the plane.
    pub fn surface(&self, at: DVec2) -> DVec3 {
        self.center + self.axes * at.extend(self.height(at))
    }

    fn height(&self, at: DVec2) -> f64 {
        let of = |hill: &Hill| {
            let over = (at - hill.center) / hill.width_mm;
            hill.height_mm * (-0.5 * over.length_squared()).exp()
        };
        self.hills.iter().map(of).sum()
    }

    pub fn contains(&self, point: DVec3) -> bool {
        self.contains_local(self.local(point))
    }

    fn contains_local(&self, p: DVec3) -> bool {
        let at = p.truncate();
        if at.length_squared() > self.radius_mm * self.radius_mm {
            return false;
        }
        let [low, high] = self.levels();
        if p.z < low || p.z > high {
            return false;
        }
        let above = p.z - self.height(at);
        above <= 0.0 && above >= -self.thickness_mm
    }

    /// The steepest that the sum of hills can be: each is steepest one width from its centre.
    fn steepest(&self) -> f64 {
        self.hills.iter().map(|hill| (hill.height_mm / hill.width_mm).abs() * (-0.5_f64).exp()).sum()
    }

    /// As of every solid, to [`FOUND_MM`], and before `limit` along the ray; what is thinner than [`STEP_MM`] along it may be missed.
    pub fn enter(&self, ray: &Ray, limit: f64) -> Option<f64> {
        let origin = self.local(ray.origin_mm);
        let direction = self.axes.transpose() * ray.direction;
        let [low, high] = self.levels();
        // Between the levels, and near enough to the centre.
        let mut ends = [(low - origin.z) / direction.z, (high - origin.z) / direction.z];
        ends.sort_by(f64::total_cmp);
        let (center, radius) = self.ball();
        let to = center - ray.origin_mm;
        let nearest = to.dot(ray.direction);
        let half2 = radius * radius - to.length_squared() + nearest * nearest;
        if half2.is_nan() || half2 < 0.0 {
            return None;
        }
        let between = |t: f64| t.clamp(nearest - half2.sqrt(), nearest + half2.sqrt());
        let (start, end) = (between(ends[0]), between(ends[1]).min(limit));
        let slant = self.steepest().hypot(1.0);
        let (mut outside, mut t) = (start, start);
        while t <= end + STEP_MM {
            let p = origin + direction * t;
            let above = p.z - self.height(p.truncate());
            if !self.contains_local(p) {
                outside = t;
                // The surface is at least this far from a point above it.
                t += (above / slant).max(STEP_MM);
                continue;
            }
            let mut entered = t;
            while entered - outside > FOUND_MM {
                let middle = (entered + outside) / 2.0;
                let is_in = self.contains_local(origin + direction * middle);
                *(if is_in { &mut entered } else { &mut outside }) = middle;
            }
            return Some(entered);
        }
        None
    }

    /// Principal curvatures of the surface above a place, 1/mm, the larger first; positive where it bulges towards the normal's side.
    pub fn curvatures(&self, at: DVec2) -> [f64; 2] {
        let (mut slope, mut xx, mut xy, mut yy) = (DVec2::ZERO, 0.0, 0.0, 0.0);
        for hill in &self.hills {
            let (d, s2) = (at - hill.center, hill.width_mm * hill.width_mm);
            let h = hill.height_mm * (-0.5 * d.length_squared() / s2).exp();
            slope -= d * (h / s2);
            xx += h * (d.x * d.x / s2 - 1.0) / s2;
            yy += h * (d.y * d.y / s2 - 1.0) / s2;
            xy += h * d.x * d.y / (s2 * s2);
        }
        // Of the graph of a function: shape operator from the first and second fundamental form.
        let (p, q) = (slope.x, slope.y);
        let w = (1.0 + p * p + q * q).sqrt();
        let mean = -((1.0 + q * q) * xx - 2.0 * p * q * xy + (1.0 + p * p) * yy) / (2.0 * w.powi(3));
        let gauss = (xx * yy - xy * xy) / w.powi(4);
        let apart = (mean * mean - gauss).max(0.0).sqrt();
        [mean + apart, mean - apart]
    }
}
