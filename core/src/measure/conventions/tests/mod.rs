mod forms;
mod raters;
mod stored;
mod twins;

use crate::{Grid, MaskBits};
use glam::DVec3;

use super::{Comparison, Convention, Settings, compare};

/// Random voxels by the generator that made the stored values: about `percent` of them active.
fn noise(seed: u64, dims: [usize; 3], percent: u64) -> MaskBits {
    let mut state = seed;
    MaskBits::from_fn(dims, |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % 100 < percent
    })
}

/// Boxes by first voxel and size.
fn boxes(dims: [usize; 3], boxes: &[([usize; 3], [usize; 3])]) -> MaskBits {
    let inside = |v: [usize; 3]| {
        boxes.iter().any(|(lo, size)| (0..3).all(|a| (lo[a]..lo[a] + size[a]).contains(&v[a])))
    };
    MaskBits::from_fn(dims, |linear| inside(crate::grid::ijk(dims, linear)))
}

fn grid(dims: [usize; 3], spacing_mm: [f64; 3]) -> Grid {
    Grid::axis_aligned(dims, DVec3::from_array(spacing_mm), DVec3::new(-7.0, 40.0, 3.0)).unwrap()
}

fn by(convention: Convention) -> Settings {
    Settings { convention, ..Settings::default() }
}

fn compared(a: &MaskBits, b: &MaskBits, spacing_mm: [f64; 3], settings: &Settings) -> Comparison {
    compare(a, b, &grid(a.dims(), spacing_mm), settings).unwrap()
}

#[track_caller]
fn assert_near(found: Option<f64>, expected: Option<f64>, what: &str) {
    match (found, expected) {
        (Some(found), Some(expected)) if found != expected => {
            assert!(
                (found - expected).abs() <= 1e-6 * expected.abs(),
                "{what}: found {found}, expected {expected}"
            );
        }
        _ => assert_eq!(found, expected, "{what}"),
    }
}
