//! Two levels compared in the space half way between them, and the points at which they are.

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::{
    level::{Level, Probe},
    pose::HalfWay,
    pyramid::Pyramid,
};

/// Fewest points at which images are compared.
const MIN_POINTS: usize = 200;

/// Both levels seen from the half-way space of one pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<'a> {
    fixed: &'a Level,
    moving: &'a Level,
    fixed_from_half: DAffine3,
    moving_from_half: DAffine3,
    fixed_transposed: DMat3,
    moving_transposed: DMat3,
}

/// Values and gradients, the latter per half-way mm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub fixed: Probe,
    pub moving: Probe,
}

impl<'a> Pair<'a> {
    pub fn new(fixed: &'a Level, moving: &'a Level, half: &HalfWay) -> Self {
        let fixed_from_half = fixed.voxel_from_centred * half.fixed_from_half;
        let moving_from_half = moving.voxel_from_centred * half.moving_from_half;
        Self {
            fixed,
            moving,
            fixed_from_half,
            moving_from_half,
            fixed_transposed: fixed_from_half.matrix3.transpose(),
            moving_transposed: moving_from_half.matrix3.transpose(),
        }
    }

    /// The two images at a half-way point; `None` where either doesn't count.
    #[inline]
    pub fn at(&self, x: DVec3) -> Option<Sample> {
        let fixed = self.fixed.probe(self.fixed_from_half.transform_point3(x))?;
        let moving = self.moving.probe(self.moving_from_half.transform_point3(x))?;
        Some(Sample {
            fixed: Probe { gradient: self.fixed_transposed * fixed.gradient, ..fixed },
            moving: Probe { gradient: self.moving_transposed * moving.gradient, ..moving },
        })
    }

    /// As [`Self::at`], each by itself.
    pub fn each(&self, x: DVec3) -> (Option<f64>, Option<f64>) {
        let fixed = self.fixed.probe(self.fixed_from_half.transform_point3(x));
        let moving = self.moving.probe(self.moving_from_half.transform_point3(x));
        (fixed.map(|p| p.value), moving.map(|p| p.value))
    }
}

/// The half-way box that holds both images' foregrounds, grown by `margin_mm`.
fn common_box(fixed: &Pyramid, moving: &Pyramid, half: &HalfWay, margin_mm: f64) -> (DVec3, DVec3) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for (pyramid, from_half) in [(fixed, half.fixed_from_half), (moving, half.moving_from_half)] {
        let half_from = from_half.inverse();
        for corner in 0..8 {
            let side = |a: usize| if corner >> a & 1 == 1 { pyramid.high_mm[a] } else { pyramid.low_mm[a] };
            let p = half_from.transform_point3(DVec3::new(side(0), side(1), side(2)));
            low = low.min(p);
            high = high.max(p);
        }
    }
    (low - DVec3::splat(margin_mm), high + DVec3::splat(margin_mm))
}

/// Which points of the box are used.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Keep {
    /// All of them: for searches over many poses.
    All,
    /// Those near the foreground of either image in this pose.
    Foreground,
}

/// Points of a jittered lattice over both foregrounds in the half-way space, at least `spacing_mm` apart on average and
/// at most about `most` of them. One point per cell, anywhere in it, so that no lattice of voxels is preferred.
#[allow(clippy::too_many_arguments, reason = "all are needed at the few places that call it")]
pub(crate) fn points(
    fixed: &Pyramid,
    moving: &Pyramid,
    half: &HalfWay,
    spacing_mm: f64,
    most: usize,
    keep: Keep,
    margin_mm: f64,
    seed: u64,
) -> Vec<DVec3> {
    let (Some(fixed_level), Some(moving_level)) = (fixed.levels.first(), moving.levels.first()) else {
        return Vec::new();
    };
    let pair = Pair::new(fixed_level, moving_level, half);
    let near = |x: DVec3| match keep {
        Keep::All => true,
        Keep::Foreground => {
            // The coarsest level is blurred, so half the threshold is some millimetres outside of the foreground.
            let (f, m) = pair.each(x);
            f.is_some_and(|v| v > 0.3 * fixed.foreground) || m.is_some_and(|v| v > 0.3 * moving.foreground)
        }
    };
    let (low, high) = common_box(fixed, moving, half, margin_mm);
    let all = |spacing: f64| -> Vec<DVec3> {
        let first = (low / spacing).floor();
        let count = ((high / spacing).ceil() - first).max(DVec3::ONE);
        let [nx, ny, nz] = count.to_array().map(|n| n.min(4096.0) as usize);
        let slices: Vec<Vec<DVec3>> = (0..nz)
            .into_par_iter()
            .map(|k| {
                let cells =
                    (0..nx * ny).map(|at| DVec3::new((at % nx) as f64, (at / nx) as f64, k as f64) + first);
                cells.map(|cell| (cell + jitter(cell, seed)) * spacing).filter(|x| near(*x)).collect()
            })
            .collect();
        slices.concat()
    };
    // Counted on a coarse lattice first, so that the cap is met without a list of all points.
    let volume = (high - low).max(DVec3::ONE).element_product();
    let probe_spacing = (volume / 20_000.0).cbrt().max(spacing_mm);
    let probed = all(probe_spacing);
    let expected = probed.len() as f64 * (probe_spacing / spacing_mm).powi(3);
    if expected <= most as f64 && probe_spacing == spacing_mm {
        return probed;
    }
    all(spacing_mm * (expected / most as f64).cbrt().max(1.0))
}

/// Uniform in the unit cube, by a hash of the cell and the seed.
fn jitter(cell: DVec3, seed: u64) -> DVec3 {
    let mix = |mut z: u64| {
        z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    };
    let mut state = mix(seed);
    for c in cell.to_array() {
        state = mix(state ^ (c as i64).cast_unsigned());
    }
    let unit = |salt: u64| (mix(state.wrapping_add(salt)) >> 11) as f64 * (1.0 / (1_u64 << 53) as f64);
    DVec3::new(unit(1), unit(2), unit(3))
}

/// Share of the foreground of the image that the other one's field covers better, 0 to 1.
pub(crate) fn overlap_share(fixed: &Pyramid, moving: &Pyramid, half: &HalfWay) -> f64 {
    let (Some(fixed_level), Some(moving_level)) = (fixed.levels.first(), moving.levels.first()) else {
        return 0.0;
    };
    let pair = Pair::new(fixed_level, moving_level, half);
    let (mut fixed_all, mut fixed_both, mut moving_all, mut moving_both) = (0.0, 0.0, 0.0, 0.0);
    for x in points(fixed, moving, half, 4.0, 50_000, Keep::All, 0.0, 0) {
        let (f, m) = pair.each(x);
        if f.is_some_and(|v| v > fixed.foreground) {
            fixed_all += 1.0;
            fixed_both += f64::from(u8::from(m.is_some()));
        }
        if m.is_some_and(|v| v > moving.foreground) {
            moving_all += 1.0;
            moving_both += f64::from(u8::from(f.is_some()));
        }
    }
    let share = |both: f64, all: f64| if all > 0.0 { both / all } else { 0.0 };
    share(fixed_both, fixed_all).max(share(moving_both, moving_all))
}

/// Whether enough points are left to compare.
pub(crate) fn enough(count: usize) -> bool {
    count >= MIN_POINTS
}
