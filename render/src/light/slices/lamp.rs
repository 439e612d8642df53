//! The cone of light about the direction to a lamp, as slices perpendicular to the view axis see it: footprints are ellipses,
//! shifted towards the lamp (multidirectional occlusion, Šoltészová et al. 2010). Pure: no device is touched.

use glam::{DVec2, DVec3};
use glioscope_core::optics::{
    Sight,
    cone::{WIDEST_DEG, tilted_moments},
};

use crate::light::kernel::{Kernel, MOST_REACH_PX, disc_points};

/// Largest angle between the line of sight and the direction of light, before the scene or behind it: slices can't carry
/// light along themselves.
pub(crate) const MOST_TILT_DEG: f64 = 75.0;
/// Variance along an axis that interpolation between pixels adds, on average over its fraction, square pixels.
const INTERPOLATED_PX2: f64 = 1.0 / 6.0;

/// Light comes from so many pixels aside before what is behind an opaque surface hides it from the surface: as many as
/// interpolation between pixels reaches, and more where light is almost along the line of sight.
const LAG_PX: f64 = 2.0;
const MOST_LAG_PX: f64 = 16.0;

/// A tilted cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LampCone {
    /// Half the opening angle used, degrees.
    pub aperture_deg: f64,
    /// From the view axis, degrees.
    pub tilt_deg: f64,
    /// Whether light comes from behind the scene, and crosses slices from back to front.
    pub from_behind: bool,
    /// Millimetres right and down that the middle of the light lies, per millimetre nearer to the eye.
    pub slope: DVec2,
    /// Along the tilt and across it: standard deviations of these, or the semi-axes of the ellipse in which a plane cuts the
    /// cone.
    axes: [DVec2; 2],
}

impl LampCone {
    /// The cone about `towards` (unit length; right, up, away from the eye; one of [`cases`]): of directions uniform in solid
    /// angle, or as the ellipse cut out. Tilt, which is from the line of sight, and aperture are together at most
    /// [`WIDEST_DEG`]: beyond, the ellipse is a hyperbola. Notes name what was changed.
    pub fn new(towards: DVec3, aperture_deg: f64, as_ellipse: bool, notes: &mut Vec<String>) -> Self {
        let sideways = DVec2::new(towards.x, -towards.y);
        // A lamp right behind or before the scene has no side.
        let along = sideways.try_normalize().unwrap_or(DVec2::NEG_Y);
        let from_behind = towards.z > 0.0;
        let tilt_deg = sideways.length().atan2(towards.z.abs()).to_degrees().min(MOST_TILT_DEG);
        let used_deg = aperture_deg.min(WIDEST_DEG - tilt_deg);
        if used_deg < aperture_deg - 1e-6 {
            notes.push(format!(
                "aperture {aperture_deg} degrees: {used_deg:.0} is used, so far is the lamp aside"
            ));
        }
        let (slope, axes) = if as_ellipse {
            let (sin, cos) = tilt_deg.to_radians().sin_cos();
            let (sin_a, cos_a) = used_deg.to_radians().sin_cos();
            let within = cos_a * cos_a - sin * sin;
            (sin * cos / within, [sin_a * cos_a / within, sin_a / within.sqrt()])
        } else {
            let (slope, variances) = tilted_moments(used_deg, tilt_deg);
            (slope, variances.map(f64::sqrt))
        };
        let across = DVec2::new(-along.y, along.x);
        let axes = [along * axes[0], across * axes[1]];
        let slope = if from_behind { -slope } else { slope };
        Self { aperture_deg: used_deg, tilt_deg, from_behind, slope: along * slope, axes }
    }

    /// Where light at view depth `to_mm` was at `from_mm` on its way, spread as the ellipse there.
    pub fn ellipse(&self, sight: &Sight, [from_mm, to_mm]: [f64; 2], grid: u32) -> Kernel {
        let spread = (to_mm - from_mm).abs() / sight.pixel_mm(from_mm);
        self.kernel(sight, [from_mm, to_mm], grid, self.axes.map(|axis| axis * spread))
    }

    /// The same, spread as after `reference_mm` behind an occluder if slices are endlessly many.
    pub fn blurred(&self, sight: &Sight, [from_mm, to_mm]: [f64; 2], grid: u32, reference_mm: f64) -> Kernel {
        let spread = ((to_mm - from_mm).abs() * reference_mm).sqrt() / sight.pixel_mm(from_mm);
        // Variance of the points of a grid from -1 to 1.
        let of_points = (1.0 - 1.0 / f64::from(grid).powi(2)) / 3.0;
        let axes = self.axes.map(|axis| {
            let variance = (axis.length() * spread).powi(2) - INTERPOLATED_PX2;
            let half = if variance > 0.0 && of_points > 0.0 { (variance / of_points).sqrt() } else { 0.0 };
            axis.normalize_or_zero() * half
        });
        self.kernel(sight, [from_mm, to_mm], grid, axes)
    }

    /// Pixels along the line of sight behind an opaque surface from which on it hides light from surfaces.
    pub fn lag_px(&self) -> f64 {
        (LAG_PX / self.slope.length()).min(MOST_LAG_PX)
    }

    /// Largest variance along an axis, per square millimetre nearer to the eye.
    pub fn variance(&self) -> f64 {
        self.axes[0].length_squared().max(self.axes[1].length_squared())
    }

    /// Most pixels along an axis that light moves sideways between two depths.
    pub fn moved_px(&self, sight: &Sight, [from_mm, to_mm]: [f64; 2]) -> f64 {
        let half = DVec2::from_array(sight.size.map(f64::from)) / 2.0;
        let (scale, shift) = self.shift(sight, [from_mm, to_mm]);
        (half * scale + shift.abs()).max_element()
    }

    /// Growth of a pixel's offset from the frame's middle, and pixels to the right and downwards.
    fn shift(&self, sight: &Sight, [from_mm, to_mm]: [f64; 2]) -> (f64, DVec2) {
        let from_px = sight.pixel_mm(from_mm);
        (sight.pixel_mm(to_mm) / from_px - 1.0, self.slope * ((to_mm - from_mm) / from_px))
    }

    fn kernel(&self, sight: &Sight, depths_mm: [f64; 2], grid: u32, axes_px: [DVec2; 2]) -> Kernel {
        let (scale, shift) = self.shift(sight, depths_mm);
        let shortened = |axis: DVec2| axis.clamp_length_max(MOST_REACH_PX).to_array();
        Kernel::Ellipse {
            grid,
            scale,
            shift_px: shift.to_array(),
            axes_px: axes_px.map(shortened),
            pixel_mm: sight.pixel_mm(depths_mm[0]),
        }
    }

    /// A point of the frame, pixels from its middle to the right and downwards at one view depth, moved along the light to
    /// another.
    pub fn moved(&self, sight: &Sight, at_px: DVec2, [from_mm, to_mm]: [f64; 2]) -> DVec2 {
        (at_px * sight.pixel_mm(from_mm) + self.slope * (from_mm - to_mm)) / sight.pixel_mm(to_mm)
    }
}

/// The directions (unit length; right, up, away from the eye) whose light is shown for a lamp in `towards`, each with its share
/// of the frame, above 0. A lamp beside the scene, more than [`MOST_TILT_DEG`] from the line of sight, is a mixture of one before
/// the scene and one behind it, that far from the line of sight: shares change evenly while it turns, so that nothing jumps.
pub(crate) fn cases(towards: DVec3) -> Vec<(DVec3, f64)> {
    let sideways = towards.truncate();
    let behind = (from_sight_deg(towards) - MOST_TILT_DEG) / (180.0 - 2.0 * MOST_TILT_DEG);
    if !(0.0..1.0).contains(&behind) || behind == 0.0 {
        return vec![(towards, 1.0)];
    }
    let (sin, cos) = MOST_TILT_DEG.to_radians().sin_cos();
    let side = sideways.normalize_or_zero() * sin;
    vec![(side.extend(-cos), 1.0 - behind), (side.extend(cos), behind)]
}

/// What is said of a mixture.
pub(crate) fn mixture_note(towards: DVec3) -> Option<String> {
    let [(_, before), (_, behind)] = cases(towards)[..] else { return None };
    let (degrees, [before, behind]) = (from_sight_deg(towards), [before, behind].map(|share| 100.0 * share));
    Some(format!(
        "lamp {degrees:.0} degrees from the line of sight: light from {MOST_TILT_DEG} degrees before the scene ({before:.0} %) and \
         behind it ({behind:.0} %) is used"
    ))
}

/// Angle between the direction to the eye and that to the lamp.
fn from_sight_deg(towards: DVec3) -> f64 {
    towards.truncate().length().atan2(-towards.z).to_degrees()
}

/// Points of an ellipse's square, or of the disc in it.
pub(crate) fn ellipse_points(grid: u32, in_disc: bool) -> Vec<[f64; 2]> {
    if in_disc {
        return disc_points(grid);
    }
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(grid) * 2.0 - 1.0;
    (0..grid).flat_map(|y| (0..grid).map(move |x| [at(x), at(y)])).collect()
}
