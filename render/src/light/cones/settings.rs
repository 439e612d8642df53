//! The settings of cone-traced occlusion.

use glam::DVec3;
use glioscope_core::optics::cone::clamped_aperture;

use crate::light::half_angle::plan::across_light;

/// Settings of cone-traced occlusion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ConeSettings {
    /// Half the cone's opening, degrees; clamped to 0 to 85.
    pub aperture_deg: f64,
    /// Sub-cones, at least 1.
    pub sub_cones: u32,
    /// Coarsest level that is sampled; 0 samples the volume itself.
    pub coarsest_level: u32,
    /// Step along a sub-cone, in cells of the level sampled; 1/16 to 4.
    pub cone_step: f64,
}

/// [`ConeSettings`] within their ranges.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ClampedSettings {
    pub settings: ConeSettings,
    /// One for each setting that was changed.
    pub notes: Vec<String>,
}

impl ConeSettings {
    /// Within range, with at most this many sub-cones.
    pub fn clamped(&self, most_sub_cones: u32) -> ClampedSettings {
        let mut notes = Vec::new();
        let (aperture_deg, is_clamped) = clamped_aperture(self.aperture_deg);
        if is_clamped {
            notes.push(format!("aperture {} degrees: {aperture_deg} is used", self.aperture_deg));
        }
        let sub_cones = self.sub_cones.clamp(1, most_sub_cones);
        if sub_cones != self.sub_cones {
            notes.push(format!("{} sub-cones: {sub_cones} are used", self.sub_cones));
        }
        let cone_step = if self.cone_step.is_nan() { 1.0 } else { self.cone_step.clamp(1.0 / 16.0, 4.0) };
        if cone_step != self.cone_step {
            notes.push(format!("cone step {}: {cone_step} is used", self.cone_step));
        }
        ClampedSettings { settings: Self { aperture_deg, sub_cones, cone_step, ..*self }, notes }
    }

    /// Maximum number of samples along a sub-cone of this length.
    pub fn samples(&self, length_mm: f64, voxel_mm: f64, coarsest: u32) -> u32 {
        let widest = voxel_mm * f64::from(coarsest).exp2();
        let (mut t, mut n) = (0.0, 0);
        while t < length_mm && n < 1_000_000 {
            t += self.cone_step * (2.0 * t * self.sub_tangent()).clamp(voxel_mm, widest);
            n += 1;
        }
        n.max(1)
    }

    /// Tangent of a sub-cone's half opening: sub-cones have equal shares of the solid angle.
    pub fn sub_tangent(&self) -> f64 {
        let cos = 1.0 - (1.0 - self.aperture_deg.to_radians().cos()) / f64::from(self.sub_cones);
        ((1.0 - cos) * (1.0 + cos)).sqrt() / cos
    }
}

/// [`sub_cones`] about a direction towards the light in camera space (right, up, away from the eye), unit length, in camera
/// space. They turn with it, without a jump unless the light stands behind the scene.
pub(crate) fn sub_cones_about(towards: DVec3, settings: &ConeSettings) -> Vec<DVec3> {
    let [u, _] = across_light(-towards);
    let v = towards.cross(u);
    sub_cones(settings).iter().map(|a| u * a[0] + v * a[1] + towards * a[2]).collect()
}

/// Axes of the sub-cones about z (towards the eye), unit vectors: a spiral of even solid angle.
pub(crate) fn sub_cones(settings: &ConeSettings) -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let drop = 1.0 - settings.aperture_deg.to_radians().cos();
    let n = settings.sub_cones;
    (0..n)
        .map(|i| {
            // A single sub-cone points along the axis.
            let share = if n == 1 { 0.0 } else { (f64::from(i) + 0.5) / f64::from(n) };
            let cos = 1.0 - drop * share;
            let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
            let (s, c) = (golden * f64::from(i)).sin_cos();
            [sin * c, sin * s, cos]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sub_cones_share_the_cone_evenly() {
        let s = ConeSettings { aperture_deg: 80.0, sub_cones: 200, coarsest_level: 1, cone_step: 1.0 };
        let axes = sub_cones(&s);
        let mean_z = axes.iter().map(|a| a[2]).sum::<f64>() / 200.0;
        assert!((mean_z - 0.5 * (1.0 + 80f64.to_radians().cos())).abs() < 1e-3);
        assert!(axes.iter().map(|a| a[0]).sum::<f64>().abs() / 200.0 < 0.02);
        assert!(axes.iter().all(|a| (a[0].powi(2) + a[1].powi(2) + a[2].powi(2) - 1.0).abs() < 1e-12));
    }

    #[test]
    fn out_of_range_settings_are_clamped_with_notes() {
        let requested =
            ConeSettings { aperture_deg: 99.0, sub_cones: 0, coarsest_level: 1, cone_step: f64::NAN };
        let clamped = requested.clamped(128);
        let ConeSettings { aperture_deg, sub_cones, cone_step, .. } = clamped.settings;
        assert_eq!((aperture_deg, sub_cones, cone_step), (85.0, 1, 1.0));
        assert_eq!(clamped.notes.len(), 3, "{:?}", clamped.notes);
    }
}
