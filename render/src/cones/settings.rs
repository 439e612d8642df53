//! The knobs of cone-traced occlusion.

use crate::occlusion::{Filter, cone::clamped_aperture};

/// The most sub-cones.
pub(crate) const MOST_SUB_CONES: u32 = 512;

/// What cone-traced occlusion is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeSettings {
    /// Half the cone's opening, degrees; clamped to 0 to 85.
    pub aperture_deg: f64,
    /// Sub-cones, 1 to 512.
    pub sub_cones: u32,
    /// Coarsest level that is read; 0 reads the volume itself.
    pub coarsest_level: u32,
    /// Steps along the ray, in voxels (of the finest spacing); 1/16 to 4.
    pub ray_step: f64,
    /// Steps along a sub-cone, in cells of the level read; 1/16 to 4.
    pub cone_step: f64,
}

impl Default for ConeSettings {
    fn default() -> Self {
        Self::of(Filter::Linear)
    }
}

/// [`ConeSettings`] as used, and what is other than asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct ConesUsed {
    /// Within their ranges.
    pub settings: ConeSettings,
    /// In words.
    pub notes: Vec<String>,
}

impl ConeSettings {
    /// The default for a volume of this filter, on the measured front of error against time
    /// (docs/accuracy.md). Intensities are read at level 1 at most: coarser ones save a quarter of the
    /// time for one and a half to three times the error. Labels are read themselves, as their rays jump
    /// from face to face: exact, and faster than any level.
    pub fn of(filter: Filter) -> Self {
        let coarsest_level = match filter {
            Filter::Linear => 1,
            Filter::Nearest => 0,
        };
        Self { aperture_deg: 60.0, sub_cones: 8, coarsest_level, ray_step: 1.0, cone_step: 1.0 }
    }

    /// Within range.
    pub fn used(&self) -> ConesUsed {
        self.within(MOST_SUB_CONES)
    }

    /// Within range, with at most this many sub-cones.
    pub(crate) fn within(&self, most_sub_cones: u32) -> ConesUsed {
        let mut notes = Vec::new();
        let (aperture_deg, other) = clamped_aperture(self.aperture_deg);
        if other {
            notes.push(format!("aperture {} degrees: {aperture_deg} is used", self.aperture_deg));
        }
        let sub_cones = self.sub_cones.clamp(1, most_sub_cones);
        if sub_cones != self.sub_cones {
            notes.push(format!("{} sub-cones: {sub_cones} are used", self.sub_cones));
        }
        let mut step = |asked: f64, what: &str| {
            let used = if asked.is_nan() { 1.0 } else { asked.clamp(1.0 / 16.0, 4.0) };
            if used != asked {
                notes.push(format!("{what} step {asked}: {used} is used"));
            }
            used
        };
        let ray_step = step(self.ray_step, "ray");
        let cone_step = step(self.cone_step, "cone");
        let settings = Self { aperture_deg, sub_cones, ray_step, cone_step, ..*self };
        ConesUsed { settings, notes }
    }

    /// Samples along a sub-cone of this length, at most.
    pub(crate) fn samples(&self, length_mm: f64, voxel_mm: f64, coarsest: u32) -> u32 {
        let widest = voxel_mm * f64::from(coarsest).exp2();
        let (mut t, mut n) = (0.0, 0);
        while t < length_mm && n < 1_000_000 {
            t += self.cone_step * (2.0 * t * self.sub_tangent()).clamp(voxel_mm, widest);
            n += 1;
        }
        n.max(1)
    }

    /// Tangent of a sub-cone's own half opening: equal shares of the solid angle.
    pub(crate) fn sub_tangent(&self) -> f64 {
        let cos = 1.0 - (1.0 - self.aperture_deg.to_radians().cos()) / f64::from(self.sub_cones);
        ((1.0 - cos) * (1.0 + cos)).sqrt() / cos
    }
}

/// Axes of the sub-cones about z (towards the eye), unit vectors: a spiral of even solid angle.
pub fn sub_cones(settings: &ConeSettings) -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let drop = 1.0 - settings.aperture_deg.to_radians().cos();
    let n = settings.sub_cones;
    (0..n)
        .map(|i| {
            // The one and only sub-cone looks along the axis.
            let share = if n == 1 { 0.0 } else { (f64::from(i) + 0.5) / f64::from(n) };
            let cos = 1.0 - drop * share;
            let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
            let (s, c) = (golden * f64::from(i)).sin_cos();
            [sin * c, sin * s, cos]
        })
        .collect()
}
