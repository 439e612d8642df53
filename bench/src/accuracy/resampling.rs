//! Trilinear resampling of an analytic image, by the spacing that it was sampled at.

use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{Grid, Progress, Samples, Scaling, Sides, Volume, resample::image_onto};

use super::{AccuracyError, Axis, Bench, Curve, Family, Point, measure::Errors, sweep::Sweep};

/// Waves of 12 and 21 mm under a soft ball of 30 mm: of range 1, about.
fn value(p: DVec3) -> f64 {
    let wave = |length: f64, along: DVec3| (std::f64::consts::TAU * p.dot(along) / length).sin();
    let ball = (-p.length_squared() / (30.0 * 30.0)).exp();
    0.5 * ball
        + 0.15 * wave(12.0, DVec3::new(0.8, 0.6, 0.0))
        + 0.15 * wave(12.0, DVec3::new(0.0, 0.6, -0.8))
        + 0.2 * wave(21.0, DVec3::new(0.36, -0.48, 0.8))
}

fn voxels(grid: &Grid) -> Vec<f64> {
    let [nx, ny, _] = grid.dims();
    (0..grid.voxel_count())
        .map(|l| value(grid.center_of_voxel_mm([l % nx, l / nx % ny, l / nx / ny])))
        .collect()
}

fn about_origin(dims: [usize; 3], matrix3: DMat3) -> Result<Grid, AccuracyError> {
    let middle = DVec3::from_array(dims.map(|n| (n - 1) as f64 / 2.0));
    Grid::new(dims, DAffine3 { matrix3, translation: -(matrix3 * middle) }, Sides::Known)
        .map_err(|e| AccuracyError::of(&e))
}

pub(super) fn curves(bench: &Bench<'_>) -> Result<Vec<Curve>, AccuracyError> {
    let spacings: &[f64] =
        bench.effort.of(&[3.0, 1.0], &[4.0, 2.0, 1.0, 0.5], &[6.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.75, 0.5]);
    let n = bench.effort.of(20, 64, 96);
    let turned = DMat3::from_rotation_x(0.21) * DMat3::from_rotation_z(0.37);
    let target = about_origin([n; 3], turned)?;
    let truth = voxels(&target);
    let sweep = Sweep {
        what: "resampling: spacing",
        rounds: bench.effort.of(1, 5, 15),
        patience: Duration::from_millis(2000),
        on_device: false,
    };
    let image = |&spacing: &f64| -> Result<(String, (f64, Volume)), AccuracyError> {
        // Wide enough for the target's corners and a cell more.
        let side = (1.75 * n as f64 / spacing).ceil() as usize + 2;
        let source = about_origin([side; 3], DMat3::from_diagonal(DVec3::splat(spacing)))?;
        let values = voxels(&source).into_iter().map(|v| v as f32).collect();
        let volume = Volume::new(source, Samples::F32(values), Scaling::NONE)
            .ok_or_else(|| AccuracyError::Scene("values that don't fit their grid".to_owned()))?;
        Ok((format!("{spacing} mm"), (spacing, volume)))
    };
    let images = spacings.iter().map(image).collect::<Result<Vec<_>, _>>()?;
    let mut found = None;
    let points = bench.sweep(
        &sweep,
        &mut found,
        &images,
        |found, (_, volume)| {
            *found = Some(image_onto(volume, &target, &Progress::new())?);
            Ok(())
        },
        |found, (spacing, _)| {
            let mut errors = Errors::default();
            for (f, t) in found.iter().flat_map(|f| &f.values).zip(&truth) {
                errors.add(f64::from(*f) - t);
            }
            Ok(Point::new(*spacing, &errors))
        },
    )?;
    Ok(vec![Curve {
        family: Family::Resampling,
        kernel: "trilinear".to_owned(),
        scene: format!("waves of 12 and 21 mm and a soft ball, onto {n}³ turned voxels of 1 mm"),
        knob: "spacing of the image, mm",
        truth: "the analytic image at the target's voxel centres".to_owned(),
        truth_error: None,
        unit: "share of the image's range",
        axis: Axis::Knob,
        points,
    }])
}
