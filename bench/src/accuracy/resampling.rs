//! Trilinear resampling of an analytic image, by the spacing at which it was sampled.

use std::time::Duration;

use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::{Grid, Progress, Samples, Scaling, Sides, Volume, resample::image_onto};

use super::{Axis, Bench, Curve, Defaults, Family, Point, errors::Errors, sweep::Sweep};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "resampling",
    title: "Resampling of images",
    about: "There is nothing to tune: images are resampled onto another grid by trilinear interpolation. The plot shows \
            the error against the spacing of the image, in which it is of second order. Structures smaller than \
            four voxels are lost in any case. Masks are resampled by nearest neighbour, which is accurate to half \
            a voxel and isn't plotted here.",
    defaults: Defaults::One,
    curves,
};

/// The analytic image: waves of 12 and 21 mm and a Gaussian ball of 30 mm, with a range of about 1.
fn value(p: DVec3) -> f64 {
    let wave = |length: f64, along: DVec3| (std::f64::consts::TAU * p.dot(along) / length).sin();
    let ball = (-p.length_squared() / (30.0 * 30.0)).exp();
    0.5 * ball
        + 0.15 * wave(12.0, DVec3::new(0.8, 0.6, 0.0))
        + 0.15 * wave(12.0, DVec3::new(0.0, 0.6, -0.8))
        + 0.2 * wave(21.0, DVec3::new(0.36, -0.48, 0.8))
}

fn voxels(grid: &Grid) -> Vec<f64> {
    (0..grid.voxel_count()).map(|l| value(grid.center_of_voxel_mm(grid.ijk(l)))).collect()
}

fn grid_around_origin(dims: [usize; 3], matrix3: DMat3) -> Outcome<Grid> {
    let middle = DVec3::from_array(dims.map(|n| (n - 1) as f64 / 2.0));
    Ok(Grid::new(dims, DAffine3 { matrix3, translation: -(matrix3 * middle) }, Sides::Known)?)
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let spacings: &[f64] =
        bench.effort.of(&[3.0, 1.0], &[4.0, 2.0, 1.0, 0.5], &[6.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.75, 0.5]);
    let n = bench.effort.of(20, 64, 96);
    let rotation = DMat3::from_rotation_x(0.21) * DMat3::from_rotation_z(0.37);
    let target = grid_around_origin([n; 3], rotation)?;
    let truth = voxels(&target);
    let sweep = Sweep {
        label: "resampling: spacing",
        rounds: bench.effort.of(1, 5, 15),
        time_budget: Duration::from_millis(2000),
        on_device: false,
    };
    let image = |&spacing: &f64| -> Outcome<(String, (f64, Volume))> {
        // Covers the target's corners and one more cell.
        let side = (1.75 * n as f64 / spacing).ceil() as usize + 2;
        let source = grid_around_origin([side; 3], DMat3::from_diagonal(DVec3::splat(spacing)))?;
        let values = voxels(&source).into_iter().map(|v| v as f32).collect();
        let volume = Volume::new(source, Samples::F32(values), Scaling::NONE)
            .ok_or("values that don't fit their grid")?;
        Ok((format!("{spacing} mm"), (spacing, volume)))
    };
    let images = spacings.iter().map(image).collect::<Outcome<Vec<_>>>()?;
    let mut found = Vec::new();
    let run = |found: &mut Vec<f32>, (_, volume): &(f64, Volume)| {
        *found = image_onto(volume, &target, &Progress::new())?.values;
        Ok(())
    };
    let evaluate = |found: &mut Vec<f32>, (spacing, _): &(f64, Volume)| {
        let errors = Errors::of(found.iter().zip(&truth).map(|(f, t)| f64::from(*f) - t));
        Ok(Point::new(*spacing, &errors))
    };
    Ok(vec![Curve {
        family: FAMILY.name,
        kernel: "trilinear".to_owned(),
        scene: format!("waves of 12 and 21 mm and a soft ball, onto {n}³ rotated voxels of 1 mm"),
        knob: "spacing of the image, mm",
        truth: "the analytic image at the target's voxel centres".to_owned(),
        truth_error: None,
        unit: "fraction of the image's range",
        axis: Axis::Knob,
        points: bench.sweep(&sweep, &mut found, &images, run, evaluate)?,
    }])
}
