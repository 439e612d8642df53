//! `glioscope transform`: reads a registration transform of another program, and writes it as another one's.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use glam::DVec3;
use glioscope_core::{
    Progress,
    files::{self, Inputs, ReadOptions, Source},
    grid::rows,
    transform::{self, Convention, Format, Given, ImageGeometry, Images, Transform},
};
use serde_json::{Value, json};

use super::terminal;
use crate::{error::AppError, output};

/// Arguments of `transform`.
#[derive(Debug, Args)]
pub struct TransformArguments {
    /// The transform: ITK, ANTs or 3D Slicer (.tfm, .txt, .mat, .h5), FreeSurfer (.lta, register.dat), FLIRT (.mat), or a bare 4x4
    /// matrix of NiftyReg, greedy or others.
    pub file: PathBuf,
    /// What a bare 4x4 matrix means.
    #[arg(long, value_enum)]
    pub convention: Option<Meaning>,
    /// The fixed (reference, target) image, which FLIRT's matrices and register.dat need, and .lta where it is written.
    #[arg(long, value_name = "IMAGE", requires = "moving")]
    pub fixed: Option<PathBuf>,
    /// The moving (input, source) image, likewise.
    #[arg(long, value_name = "IMAGE", requires = "fixed")]
    pub moving: Option<PathBuf>,
    /// Write it: as .tfm or .txt (ITK's text), .h5 or .hdf5 (ITK's HDF5) of ITK, ANTs and 3D Slicer, .lta or .dat (register.dat)
    /// of FreeSurfer, or as .mat, which needs --out-convention. .lta, .dat and FLIRT's .mat need --fixed and --moving.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// What a .mat, or a bare 4x4 matrix of another ending, is written as.
    #[arg(long, value_enum, requires = "out")]
    pub out_convention: Option<OutMeaning>,
    /// Write over a file that exists.
    #[arg(long, requires = "out")]
    pub force: bool,
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

/// What a `.mat`, or a bare 4x4 matrix, is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum OutMeaning {
    /// ITK's and ANTs' binary .mat (MATLAB 4), as 0GenericAffine.mat: LPS mm, fixed to moving.
    Itk,
    /// FLIRT's matrix, moving to fixed in FSL's own mm: needs both images.
    Flirt,
    /// A bare 4x4 matrix, RAS mm of the fixed image to RAS mm of the moving one.
    RasMovingFromFixed,
    /// A bare 4x4 matrix, RAS mm of the moving image to RAS mm of the fixed one.
    RasFixedFromMoving,
    /// greedy and Convert3D: RAS mm, fixed to moving.
    Greedy,
    /// NiftyReg: RAS mm, reference to floating.
    Niftyreg,
}

impl OutMeaning {
    fn given(self) -> (Format, Option<Convention>) {
        match self {
            Self::Itk => (Format::ItkMat, None),
            Self::Flirt => (Format::Flirt, None),
            Self::RasMovingFromFixed => (Format::Matrix, Some(Convention::RasMovingFromFixed)),
            Self::RasFixedFromMoving => (Format::Matrix, Some(Convention::RasFixedFromMoving)),
            Self::Greedy => (Format::Matrix, Some(Convention::Greedy)),
            Self::Niftyreg => (Format::Matrix, Some(Convention::NiftyReg)),
        }
    }
}

/// What `out` is written as, by its ending and what it is said to be; without images.
pub(super) fn written_as(out: &Path, meaning: Option<OutMeaning>) -> Result<Given, AppError> {
    let ending = out.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let is_mat = ending.as_deref() == Some("mat");
    let is_txt = ending.as_deref() == Some("txt");
    let (format, convention) = match (Format::of_ending(out), meaning.map(OutMeaning::given)) {
        (Some(format), None) => (format, None),
        // ITK's .mat is known by its ending, a bare matrix has any but those of other formats.
        (None, Some((Format::ItkMat, _))) if !is_mat => {
            return Err(AppError::file(out, "another ending of ITK's .mat", ".mat"));
        }
        (None, Some(given)) => given,
        (Some(_), Some((format, convention))) if is_txt && format != Format::ItkMat => (format, convention),
        (Some(format), Some(_)) => {
            return Err(AppError::wrong("--out-convention", format.name(), ".mat or a bare 4x4 matrix"));
        }
        (None, None) if is_mat => {
            let expected = "--out-convention: itk (also ANTs), flirt, ras-moving-from-fixed, ras-fixed-from-moving, \
                            greedy or niftyreg";
            return Err(AppError::file(out, ".mat, which may be several formats", expected));
        }
        (None, None) => {
            let expected =
                ".tfm, .txt, .h5, .hdf5, .lta or .dat, or .mat or a bare 4x4 matrix with --out-convention";
            return Err(AppError::file(out, "another ending", expected));
        }
    };
    Ok(Given { format: Some(format), convention, images: None })
}

pub(super) fn run(arguments: &TransformArguments) -> Result<(), AppError> {
    let TransformArguments { file, convention, fixed, moving, out, out_convention, force, json } = arguments;
    let written = out.as_ref().map(|out| written_as(out, *out_convention)).transpose()?;
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
    if let (Some(out), Some(written)) = (out, written) {
        let inputs = std::iter::once(file).chain(fixed).chain(moving).cloned();
        output::refuse(out, &Inputs::new(inputs), *force)?;
        transform::write(out, &read, &Given { images, ..written })?;
    }
    if *json {
        terminal::print_json(&described(format, &read))
    } else {
        terminal::print(&text(format, &read))
    }
}

fn geometry(path: &Path) -> Result<ImageGeometry, AppError> {
    let loaded = files::read(&Source::File(path.to_owned()), &ReadOptions::default(), &Progress::new())?;
    Ok(ImageGeometry::of(loaded.volume.grid()))
}

fn described(format: Format, transform: &Transform) -> Value {
    let (turn_deg, volume_ratio) = (transform.turn_deg(), transform.volume_ratio());
    json!({
        "format": format.name(),
        "moving_from_fixed": rows(transform.moving_from_fixed()),
        "fixed_from_moving": rows(transform.fixed_from_moving()),
        "turn_deg": turn_deg,
        "volume_ratio": volume_ratio,
    })
}

fn text(format: Format, transform: &Transform) -> String {
    let (turn_deg, volume_ratio) = (transform.turn_deg(), transform.volume_ratio());
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
