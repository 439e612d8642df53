//! `glioscope register`: finds the transform between two images.

use std::{path::PathBuf, time::Instant};

use clap::{Args, ValueEnum};
use glam::DVec3;
use glioscope_core::{
    Mask, MaskBits, Progress, Volume, decimal,
    files::{self, ReadOptions, Source},
    grid::rows,
    register::{self, Consistency, Image, Measure, Model, Options, Outcome, Spread},
    surface,
    transform::{self, Given, ImageGeometry, Images, Transform},
};
use serde_json::{Value, json};

use super::{
    terminal,
    transform::{OutMeaning, written_as},
};
use crate::{error::AppError, output};

/// Arguments of `register`.
#[derive(Debug, Args)]
pub struct RegisterArguments {
    /// The image whose space is kept.
    #[arg(long, value_name = "IMAGE")]
    pub fixed: PathBuf,
    /// The image that is moved.
    #[arg(long, value_name = "IMAGE")]
    pub moving: PathBuf,
    /// A mask of what must not count, in the space of the fixed image: lesions and cavities; every voxel above 0. The
    /// consistency is that at its surface. Repeat for more.
    #[arg(long, value_name = "MASK")]
    pub lesions: Vec<PathBuf>,
    /// Likewise in the space of the moving image.
    #[arg(long, value_name = "MASK")]
    pub moving_lesions: Vec<PathBuf>,
    /// A third image of the patient: also how far points end from where they began on their way around the loop from the fixed
    /// image to this one, to the moving one and back. Two more registrations.
    #[arg(long, value_name = "IMAGE")]
    pub through: Option<PathBuf>,
    /// What the transform may do.
    #[arg(long, value_enum, default_value = "rigid")]
    pub model: ModelArgument,
    /// How the images are compared; without it as they turn out to be.
    #[arg(long, value_enum)]
    pub measure: Option<MeasureArgument>,
    /// Write the transform: as .tfm or .txt (ITK's text), .h5 or .hdf5 (ITK's HDF5) of ITK, ANTs and 3D Slicer, .lta or .dat
    /// (register.dat) of FreeSurfer, or as .mat, which needs --out-convention.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// What a .mat, or a bare 4x4 matrix of another ending, is written as.
    #[arg(long, value_enum, requires = "out")]
    pub out_convention: Option<OutMeaning>,
    /// Write over a file that exists.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Leave out the consistency, which takes two thirds of the time: nothing then says how well the images are aligned.
    #[arg(long)]
    pub no_consistency: bool,
    /// As JSON: see docs/json.md.
    #[arg(long)]
    pub json: bool,
}

/// What a transform may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ModelArgument {
    /// Turn and shift.
    Rigid,
    /// Also scale and shear.
    Affine,
}

impl From<ModelArgument> for Model {
    fn from(model: ModelArgument) -> Self {
        match model {
            ModelArgument::Rigid => Self::Rigid,
            ModelArgument::Affine => Self::Affine,
        }
    }
}

/// How images are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MeasureArgument {
    /// By their intensities: one sequence at two dates.
    Same,
    /// By mutual information: different sequences or modalities.
    Across,
}

pub(super) fn run(arguments: &RegisterArguments) -> Result<(), AppError> {
    let started = Instant::now();
    let out = arguments.out.as_ref();
    let written = out.map(|out| written_as(out, arguments.out_convention)).transpose()?;
    if let Some(out) = out {
        let inputs = [&arguments.fixed, &arguments.moving].into_iter();
        let inputs =
            inputs.chain(&arguments.through).chain(&arguments.lesions).chain(&arguments.moving_lesions);
        output::refuse(out, &files::Inputs::new(inputs.cloned()), arguments.force)?;
    }
    let found = terminal::with_progress(|progress| found(arguments, progress))?;
    let seconds = started.elapsed().as_secs_f64();
    let transform = Transform::new(found.outcome.moving_from_fixed)
        .map_err(|refusal| AppError::file(&arguments.moving, refusal.found, refusal.expected))?;
    if let (Some(out), Some(written)) = (out, written) {
        transform::write(out, &transform, &Given { images: Some(found.images), ..written })?;
    }
    if arguments.json {
        return terminal::print_json(&described(arguments, &found, seconds));
    }
    terminal::print(&text(&transform, &found, seconds))
}

struct Found {
    images: Images,
    options: Options,
    outcome: Outcome,
    /// `None` where it is left out.
    consistency: Option<Consistency>,
    /// `None` without a third image.
    around: Option<Spread>,
}

fn found(arguments: &RegisterArguments, progress: &Progress) -> Result<Found, AppError> {
    let image = |path: &PathBuf| -> Result<Volume, AppError> {
        let options = ReadOptions::default();
        Ok(files::read(&Source::File(path.clone()), &options, progress)?.volume)
    };
    let masks = |paths: &[PathBuf]| -> Result<Vec<Mask>, AppError> {
        let of = |path: &PathBuf| {
            let volume = image(path)?;
            let bits = MaskBits::from_fn(volume.grid().dims(), |linear| volume.value(linear) > 0.0);
            Mask::new("lesion", volume.grid().clone(), bits)
                .ok_or_else(|| AppError::file(path, "a mask of another size", "one of its own grid"))
        };
        paths.iter().map(of).collect()
    };
    let [fixed, moving] = [image(&arguments.fixed)?, image(&arguments.moving)?];
    let [of_fixed, of_moving] = [masks(&arguments.lesions)?, masks(&arguments.moving_lesions)?];
    let [of_fixed, of_moving]: [Vec<&Mask>; 2] = [of_fixed.iter().collect(), of_moving.iter().collect()];
    let images =
        [Image { volume: &fixed, excluded: &of_fixed }, Image { volume: &moving, excluded: &of_moving }];
    let measure = match arguments.measure {
        None => Measure::Auto,
        Some(MeasureArgument::Same) => Measure::SameModality,
        Some(MeasureArgument::Across) => Measure::AcrossModalities,
    };
    let options = Options { model: arguments.model.into(), measure, ..Options::default() };
    let refused = |path: &PathBuf, with: &str, error: register::RegisterError| match error {
        register::RegisterError::Cancelled(cancelled) => AppError::from(cancelled),
        // Its own text says what was expected of the images.
        error => AppError::file(
            path,
            format!("no alignment ({})", error.to_string().replace(", expected", ", needed")),
            format!("an image that can be aligned with the {with} one"),
        ),
    };
    let failed = |error| refused(&arguments.moving, "fixed", error);
    let outcome = register::register(&images[0], &images[1], &options, progress).map_err(failed)?;
    let points_mm = points_mm(&of_fixed, &fixed);
    let consistency =
        || register::consistency(&images[0], &images[1], &options, &outcome, &points_mm, progress);
    let consistency = (!arguments.no_consistency).then(consistency).transpose().map_err(failed)?;
    let mut around = None;
    if let Some(through) = &arguments.through {
        let volume = image(through)?;
        let third = Image::whole(&volume);
        let there = register::register(&images[0], &third, &options, progress);
        let there = there.map_err(|error| refused(through, "fixed", error))?;
        let on = register::register(&third, &images[1], &options, progress);
        let on = on.map_err(|error| refused(through, "moving", error))?;
        let legs = [there.moving_from_fixed, on.moving_from_fixed, outcome.moving_from_fixed.inverse()];
        around = register::around(&legs, &points_mm);
    }
    let [fixed, moving] = [&fixed, &moving].map(|volume| ImageGeometry::of(volume.grid()));
    Ok(Found { images: Images { fixed, moving }, options, outcome, consistency, around })
}

/// Where the consistency is told: at the lesions' surfaces, else at a lattice over the middle of the image.
fn points_mm(lesions: &[&Mask], fixed: &Volume) -> Vec<DVec3> {
    let points = surface::points_mm(lesions, 2000);
    if !points.is_empty() {
        return points;
    }
    let grid = fixed.grid();
    let last = DVec3::from_array(grid.dims().map(|n| n as f64 - 1.0));
    let steps = 0..5;
    let along = |step: usize| 0.25 + 0.125 * step as f64;
    let lattice = steps.clone().flat_map(|x| steps.clone().flat_map(move |y| (0..5).map(move |z| [x, y, z])));
    lattice
        .map(|n| grid.world_from_voxel().transform_point3(last * DVec3::from_array(n.map(along))))
        .collect()
}

fn described(arguments: &RegisterArguments, found: &Found, seconds: f64) -> Value {
    let Found { options, outcome, consistency, around, .. } = found;
    let how = if arguments.lesions.is_empty() {
        "over the middle of the fixed image"
    } else {
        "at the lesions' surface"
    };
    json!({
        "model": match options.model { Model::Rigid => "rigid", Model::Affine => "affine" },
        "measure": measure(outcome),
        "fixed": arguments.fixed.display().to_string(),
        "moving": arguments.moving.display().to_string(),
        "moving_from_fixed": rows(outcome.moving_from_fixed),
        "consistency_mm": consistency.as_ref().map(|consistency| json!({
            "median": consistency.all.map(|all| all.median_mm),
            "p95": consistency.all.map(|all| all.p95_mm),
            "max": consistency.all.map(|all| all.max_mm),
            "floor": consistency.floor_mm,
            "runs": consistency.runs,
            "failed": consistency.failed,
            "how": format!(
                "{how}: repeated from perturbed starts, with the images exchanged and, where lesions are left out, with them"
            ),
        })),
        "loop_mm": around.map(|around| json!({
            "median": around.median_mm,
            "p95": around.p95_mm,
            "max": around.max_mm,
            "through": arguments.through.as_ref().map(|path| path.display().to_string()),
        })),
        "converged": true,
        "similarity": outcome.similarity,
        "overlap": outcome.overlap_share,
        "outliers": outcome.outlier_share,
        "finest_mm": outcome.finest_mm,
        "seconds": seconds,
        "warnings": outcome.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

fn measure(outcome: &Outcome) -> &'static str {
    match outcome.measure {
        Measure::SameModality => "same modality, robust",
        Measure::AcrossModalities | Measure::Auto => "across modalities, mutual information",
    }
}

fn text(transform: &Transform, found: &Found, seconds: f64) -> String {
    let Found { outcome, consistency, around, .. } = found;
    let mm = |value: f64| decimal::text(value, 3);
    let spread = |all: Spread| {
        format!("median {} mm, 95 % {} mm, most {} mm", mm(all.median_mm), mm(all.p95_mm), mm(all.max_mm))
    };
    let consistency = match consistency {
        Some(consistency) => {
            let all = consistency.all.map_or_else(|| "unknown".to_owned(), spread);
            format!("{all} (not accuracy; half a voxel is {} mm)", mm(consistency.floor_mm))
        }
        None => "left out".to_owned(),
    };
    let mut lines = vec![
        format!("compared     {}", measure(outcome)),
        format!("turns by     {}°", mm(transform.turn_deg())),
        format!("consistency  {consistency}"),
        format!("overlap      {:.0} %", outcome.overlap_share * 100.0),
        format!("time         {} s", decimal::text(seconds, 1)),
        "moving from fixed, RAS mm:".to_owned(),
    ];
    let around = around.map(|around| format!("loop         {}", spread(around)));
    lines.splice(3..3, around);
    lines.extend(rows(outcome.moving_from_fixed).iter().map(|row| {
        let numbers: Vec<String> = row.iter().map(|number| format!("{number:14.9}")).collect();
        format!("  {}", numbers.join(" "))
    }));
    lines.extend(outcome.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.join("\n")
}
