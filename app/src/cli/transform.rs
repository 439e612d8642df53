//! `glioscope transform`: reads a registration transform of another program, and writes it as another one's.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use glioscope_core::{
    Progress,
    files::{self, ReadOptions, Source},
    transform::{self, Convention, Format, Given, ImageGeometry, Images, Transform},
};
use serde_json::{Value, json};

use super::terminal;
use crate::error::AppError;

/// Arguments of `transform`.
#[derive(Debug, Args)]
pub struct TransformArguments {
    /// The transform: ITK, ANTs or 3D Slicer (.tfm, .txt, .mat), FreeSurfer (.lta, register.dat), FLIRT (.mat), or a bare 4x4
    /// matrix of NiftyReg, greedy or others.
    pub file: PathBuf,
    /// What a bare 4x4 matrix means.
    #[arg(long, value_enum)]
    pub convention: Option<Meaning>,
    /// The fixed (reference, target) image, which FLIRT's matrices and register.dat need.
    #[arg(long, value_name = "IMAGE", requires = "moving")]
    pub fixed: Option<PathBuf>,
    /// The moving (input, source) image, likewise.
    #[arg(long, value_name = "IMAGE", requires = "fixed")]
    pub moving: Option<PathBuf>,
    /// Write it: as .tfm or .txt of ITK, as another file as a bare 4x4 matrix, RAS mm of the fixed image to RAS mm of the
    /// moving one.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
}

/// What a bare matrix means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Meaning {
    /// RAS mm of the fixed image to RAS mm of the moving one.
    RasMovingFromFixed,
    /// RAS mm of the moving image to RAS mm of the fixed one.
    RasFixedFromMoving,
    /// greedy and Convert3D.
    Greedy,
    /// NiftyReg.
    Niftyreg,
    /// FLIRT: with --fixed and --moving.
    Flirt,
}

impl Meaning {
    fn convention(self) -> Option<Convention> {
        match self {
            Self::RasMovingFromFixed => Some(Convention::RasMovingFromFixed),
            Self::RasFixedFromMoving => Some(Convention::RasFixedFromMoving),
            Self::Greedy => Some(Convention::Greedy),
            Self::Niftyreg => Some(Convention::NiftyReg),
            Self::Flirt => None,
        }
    }
}

pub(super) fn run(arguments: &TransformArguments) -> Result<(), AppError> {
    let TransformArguments { file, convention, fixed, moving, out, json } = arguments;
    let images = match (fixed, moving) {
        (Some(fixed), Some(moving)) => Some(Images { fixed: geometry(fixed)?, moving: geometry(moving)? }),
        _ => None,
    };
    let seen = Format::of_file(file)?;
    if convention.is_some() && seen != Format::Matrix {
        return Err(AppError::wrong("--convention", seen.name(), Format::Matrix.name()));
    }
    let format = if *convention == Some(Meaning::Flirt) { Format::Flirt } else { seen };
    let given = Given {
        format: Some(format),
        convention: convention.and_then(Meaning::convention),
        images: images.filter(|_| format.needs_images()),
    };
    let read = transform::read(file, &given)?;
    if let Some(out) = out {
        write(out, file, &read)?;
    }
    if *json {
        terminal::print_json(&described(format, &read))
    } else {
        terminal::print(&text(format, &read))
    }
}

fn geometry(path: &Path) -> Result<ImageGeometry, AppError> {
    let loaded = files::read(&Source::File(path.to_owned()), &ReadOptions::default(), &Progress::new())?;
    let grid = loaded.volume.grid();
    Ok(ImageGeometry {
        dims: grid.dims(),
        spacing_mm: grid.spacing_mm(),
        world_from_voxel: grid.world_from_voxel(),
    })
}

fn write(out: &Path, input: &Path, transform: &Transform) -> Result<(), AppError> {
    if files::absolute(out) == files::absolute(input) {
        return Err(AppError::file(out, "the transform that is read", "another file"));
    }
    let ending = out.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("tfm" | "txt") => transform::write_itk(out, transform)?,
        _ => transform::write_matrix(out, transform, Convention::RasMovingFromFixed)?,
    }
    Ok(())
}

fn rows(affine: DAffine3) -> [[f64; 4]; 4] {
    DMat4::from(affine).transpose().to_cols_array_2d()
}

/// How far it turns, and by how much it scales: the rotation nearest to its matrix, and the change of volumes.
fn turn_and_scale(transform: &Transform) -> (f64, f64) {
    let mut nearest = transform.moving_from_fixed().matrix3;
    let volume = nearest.determinant();
    // Newton's iteration for the polar decomposition (Higham 1986); the condition is bounded.
    for _ in 0..60 {
        nearest = (nearest + nearest.inverse().transpose()) * 0.5;
    }
    let (_, angle) = DQuat::from_mat3(&nearest).to_axis_angle();
    let degrees = angle.to_degrees();
    (degrees.min(360.0 - degrees), volume)
}

fn described(format: Format, transform: &Transform) -> Value {
    let (turn_deg, volume_ratio) = turn_and_scale(transform);
    json!({
        "format": format.name(),
        "moving_from_fixed": rows(transform.moving_from_fixed()),
        "fixed_from_moving": rows(transform.fixed_from_moving()),
        "turn_deg": turn_deg,
        "volume_ratio": volume_ratio,
    })
}

fn text(format: Format, transform: &Transform) -> String {
    let (turn_deg, volume_ratio) = turn_and_scale(transform);
    let shift: DVec3 = transform.moving_from_fixed().translation;
    let mut lines = vec![
        format!("format       {}", format.name()),
        format!("turns by     {turn_deg:.3}°"),
        format!("origin moves {:.3} mm", shift.length()),
        format!("volumes      × {volume_ratio:.6}"),
        "moving from fixed, RAS mm:".to_owned(),
    ];
    lines.extend(rows(transform.moving_from_fixed()).iter().map(|row| {
        let numbers: Vec<String> = row.iter().map(|number| format!("{number:14.9}")).collect();
        format!("  {}", numbers.join(" "))
    }));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    #[test]
    fn turns_and_scales_are_those_of_the_parts() {
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.3);
        let of = |matrix: DMat3| {
            let affine = DAffine3::from_mat3_translation(matrix, DVec3::new(1.0, 2.0, 3.0));
            turn_and_scale(&Transform::new(affine).unwrap())
        };
        let (degrees, volume) = of(turn);
        assert!((degrees - 0.3_f64.to_degrees()).abs() < 1e-9 && (volume - 1.0).abs() < 1e-12);
        // Scaling along axes doesn't turn.
        let (degrees, volume) = of(turn * DMat3::from_diagonal(DVec3::new(2.0, 1.0, 0.5)));
        assert!((degrees - 0.3_f64.to_degrees()).abs() < 1e-9 && (volume - 1.0).abs() < 1e-12);
        assert!(of(DMat3::IDENTITY).0.abs() < 1e-9);
        assert_eq!(rows(DAffine3::from_translation(DVec3::X * 5.0))[0], [1.0, 0.0, 0.0, 5.0]);
    }
}
