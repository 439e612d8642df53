//! Footprints in which slices and layers sample the light before them. Pure: no device is touched.

/// Maximum reach of a footprint, pixels.
pub(crate) const MOST_REACH_PX: f64 = 64.0;

/// The footprint in which a step samples the light of the step before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kernel {
    /// A grid of points in a disc around the pixel, bilinear, equally weighted.
    Disc {
        /// Points along a side of the square around the disc.
        grid: u32,
        /// Its radius in pixels.
        radius_px: f64,
        /// Its radius in millimetres.
        radius_mm: f64,
    },
    /// Whole pixels on a square lattice, so that nothing is interpolated and the variance is exact:
    /// weight `center` for the pixel itself, the rest shared equally by all points.
    Lattice {
        /// Points along a side.
        side: u32,
        /// Pixels between neighbouring points; even if `side` is even.
        stride_px: u32,
        /// Weight of the pixel itself, in addition to its share as a point.
        center: f64,
    },
    /// Points in an ellipse towards a lamp, bilinear, equally weighted.
    Ellipse {
        /// Points along a side of the square around the ellipse.
        grid: u32,
        /// By how much a pixel's offset from the frame's middle grows.
        scale: f64,
        /// Pixels to the right and downwards after that.
        shift_px: [f64; 2],
        /// The half axes of the square, pixels.
        axes_px: [[f64; 2]; 2],
        /// Millimetres per pixel there.
        pixel_mm: f64,
    },
}

impl Kernel {
    /// The lattice of at most `grid` points per side whose variance along an axis is `variance_px2`, or
    /// the widest within the maximum reach.
    pub fn lattice(grid: u32, variance_px2: f64) -> Self {
        if grid <= 1 || variance_px2.is_nan() || variance_px2 <= 0.0 {
            return Self::Lattice { side: 1, stride_px: 1, center: 0.0 };
        }
        let even = grid.is_multiple_of(2);
        let unit = if even { 2.0 } else { 1.0 };
        let spread = |side: u32| (f64::from(side).powi(2) - 1.0) / 12.0 * unit * unit;
        let least = if even { 2 } else { 3 };
        let side = (least..=grid).step_by(2).find(|n| spread(*n) >= variance_px2).unwrap_or(grid);
        let most = (2.0 * MOST_REACH_PX / (f64::from(side - 1) * unit)).floor().max(1.0);
        let stride = (variance_px2 / spread(side)).sqrt().ceil().clamp(1.0, most);
        let share = (variance_px2 / (spread(side) * stride * stride)).min(1.0);
        Self::Lattice { side, stride_px: (stride * unit) as u32, center: 1.0 - share }
    }

    /// Variance along an axis, square pixels.
    pub fn variance_px2(&self) -> f64 {
        match *self {
            Self::Lattice { side, stride_px, center } => {
                (1.0 - center) * (f64::from(side).powi(2) - 1.0) / 12.0 * f64::from(stride_px).powi(2)
            }
            Self::Disc { grid, radius_px, .. } => {
                let points = disc_points(grid);
                points.iter().map(|p| (p[0] * radius_px).powi(2)).sum::<f64>() / points.len() as f64
            }
            // About its middle, the larger one, with what interpolation adds at most.
            Self::Ellipse { axes_px: [a, b], .. } => {
                0.25 + (a[0] * a[0] + b[0] * b[0]).max(a[1] * a[1] + b[1] * b[1]) / 3.0
            }
        }
    }

    /// Maximum distance of a sample from the pixel along an axis, pixels.
    pub fn reach_px(&self) -> u32 {
        match *self {
            Self::Lattice { side, stride_px, .. } => (side - 1) * stride_px / 2,
            Self::Disc { radius_px, .. } => radius_px.ceil() as u32 + 1,
            // From its middle.
            Self::Ellipse { axes_px: [a, b], .. } => {
                (a[0].abs() + b[0].abs()).max(a[1].abs() + b[1].abs()).ceil() as u32 + 1
            }
        }
    }
}

/// Points of a uniform grid in the unit disc: centres of the cells of the surrounding square.
pub(crate) fn disc_points(grid: u32) -> Vec<[f64; 2]> {
    let at = |i: u32| (f64::from(i) + 0.5) / f64::from(grid) * 2.0 - 1.0;
    (0..grid)
        .flat_map(|y| (0..grid).map(move |x| [at(x), at(y)]))
        .filter(|p| p[0] * p[0] + p[1] * p[1] <= 1.0)
        .collect()
}
