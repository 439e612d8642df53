//! Scenes of known make: the head phantom, and soft and labelled balls.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use glioscope_core::{Grid, Volume, case::TimePoint, phantom};

use super::AccuracyError;
use crate::{
    camera::{Camera, Projection},
    occlusion::{Filter, OpticalVolume, Table},
};

/// The phantom's first date, made once: four families look at it.
pub(super) fn phantom() -> Result<&'static TimePoint, AccuracyError> {
    static FIRST: OnceLock<Result<TimePoint, String>> = OnceLock::new();
    let first = FIRST.get_or_init(|| {
        let case = phantom::phantom_case().map_err(|e| e.to_string())?;
        let first = case.time_points.into_iter().next();
        first.ok_or_else(|| "a phantom without a date".to_owned())
    });
    first.as_ref().map_err(|e| AccuracyError::Scene(e.clone()))
}

/// An image of it.
pub(super) fn image(of: &TimePoint, id: &str) -> Result<Arc<Volume>, AccuracyError> {
    let context = of.contexts.iter().find(|c| c.id == id);
    context
        .map(|c| Arc::clone(&c.volume))
        .ok_or_else(|| AccuracyError::Scene(format!("a phantom without an image {id}")))
}

/// A camera a little from above and aside that sees a ball.
pub(super) fn camera(focus_mm: DVec3, radius_mm: f64) -> Camera {
    Camera::fit(focus_mm, radius_mm, Camera::orientation(31.3, 19.7), Projection::Perspective)
}

fn cubic(n: usize) -> Result<Grid, AccuracyError> {
    Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::splat(-(n as f64 - 1.0) / 2.0))
        .map_err(|e| AccuracyError::of(&e))
}

/// Values of `n`³ voxels of 1 mm about the origin, from places in -1/2 to 1/2.
fn values(n: usize, value: impl Fn(DVec3) -> f64) -> Vec<f32> {
    (0..n * n * n)
        .map(|l| {
            let at = [l % n, l / n % n, l / n / n].map(|v| v as f64);
            value(DVec3::from_array(at) / (n as f64 - 1.0) - 0.5) as f32
        })
        .collect()
}

fn medium(
    n: usize,
    values: Vec<f32>,
    table: Option<Table>,
    filter: Filter,
) -> Result<Arc<OpticalVolume>, AccuracyError> {
    table
        .and_then(|table| OpticalVolume::new(cubic(n).ok()?, values, table, filter, None))
        .map(Arc::new)
        .ok_or_else(|| AccuracyError::Scene("a table or a volume that is refused".to_owned()))
}

/// Soft overlapping balls as intensities: translucent outside, dense inside.
pub(super) fn soft(n: usize) -> Result<Arc<OpticalVolume>, AccuracyError> {
    let ball = |at: DVec3, c: DVec3, r: f64| (1.0 - (at - c).length() / r).max(0.0);
    let values = values(n, |at| {
        ball(at, DVec3::new(-0.15, 0.05, 0.1), 0.32)
            + ball(at, DVec3::new(0.2, -0.1, 0.25), 0.2)
            + ball(at, DVec3::new(0.05, 0.1, -0.25), 0.4)
    });
    // Extinctions of 48 voxels' balls, so that a coarser grid looks alike.
    let per_mm = |e: f64| (e * 48.0 / n as f64) as f32;
    let table = Table::new(
        0.0,
        0.8,
        &[
            [0.9, 0.5, 0.3, 0.0],
            [0.9, 0.5, 0.3, 0.0],
            [0.9, 0.6, 0.3, per_mm(0.12)],
            [0.3, 0.7, 0.9, per_mm(0.35)],
            [0.3, 0.7, 0.9, per_mm(0.6)],
        ],
    );
    medium(n, values, table, Filter::Linear)
}

/// Two balls of labels, one in front of the other, as a tumour's masks: the nearer dense, the other
/// half as much.
pub(super) fn labels(n: usize) -> Result<Arc<OpticalVolume>, AccuracyError> {
    let values = values(n, |at| {
        if at.distance(DVec3::new(0.1, 0.05, 0.2)) < 0.18 {
            2.0
        } else if at.distance(DVec3::new(-0.05, 0.0, -0.15)) < 0.3 {
            1.0
        } else {
            0.0
        }
    });
    let extinction = (0.3 * 48.0 / n as f64) as f32;
    let table = Table::of_labels(&[[0.0; 4], [0.8, 0.3, 0.2, extinction], [0.2, 0.7, 0.4, 0.5 * extinction]]);
    medium(n, values, table, Filter::Nearest)
}
