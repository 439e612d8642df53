//! `glioscope export`: masks and regions as files of other programs.

use std::path::PathBuf;

use clap::Args;
use glioscope_core::case::TimePoint;
use glioscope_render::{MaskColors, Palette};

use super::{case::CaseArguments, resolve, terminal};
use crate::{
    error::AppError,
    export::{self, Export, Format, Item, What},
    world::load::ReadCase,
};

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// What is exported.
    #[arg(long, value_enum, default_value = "masks")]
    pub what: What,
    /// Masks by their ids, or regions: T1,T1+PET. Without it, all.
    #[arg(long, value_name = "NAME,...", default_value = "all")]
    pub select: String,
    /// The format.
    #[arg(long, value_enum)]
    pub format: Format,
    /// The file, or a folder that gets a file for each.
    #[arg(long, value_name = "PATH")]
    pub out: PathBuf,
    /// The date of the masks, by its label; may be left out where there is one.
    #[arg(long, value_name = "LABEL")]
    pub time: Option<String>,
    /// Surfaces smoothed by about a voxel, of the same volume, instead of the voxels' faces.
    #[arg(long)]
    pub smooth: bool,
    /// State whose the masks are: the patient and study of the DICOM image, or the names of the case's files. Without it,
    /// DICOM gets fixed words and UIDs of its own, and other files only hashes.
    #[arg(long)]
    pub identified: bool,
    /// Write over files that exist.
    #[arg(long)]
    pub force: bool,
    /// DICOM: the image that the masks belong to, by its id; default: the one on whose slices they lie.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// DICOM: what the UIDs of exports without identity are made from, so that those of one project fit together. Without it,
    /// they are random.
    #[arg(long, value_name = "SECRET")]
    pub salt: Option<String>,
}

pub(super) fn run(arguments: &ExportArguments) -> Result<(), AppError> {
    let format = arguments.format;
    if arguments.smooth && !format.is_surface() {
        return Err(AppError::wrong("--smooth", "a format of voxels", "stl, obj or gltf"));
    }
    if !format.is_dicom() && (arguments.image.is_some() || arguments.salt.is_some()) {
        return Err(AppError::wrong("--image and --salt", "another format", "dicom-seg or rtstruct"));
    }
    let ReadCase { case, spec, .. } = arguments.case.read(false)?;
    let time_point = resolve::time_point(&case, arguments.time.as_deref())?;
    let export = Export {
        items: items(arguments, time_point)?,
        inputs: case.inputs.clone(),
        what: format!("{}: {}", arguments.what.word(), arguments.select),
        format,
        is_smooth: arguments.smooth,
        is_identified: arguments.identified,
        overwrites: arguments.force,
        image: arguments.image.clone(),
        salt: arguments.salt.clone(),
        case: &case,
        spec: &spec,
        time_point,
    };
    let written = terminal::with_progress(|progress| {
        progress.say("Writing");
        export.write(&arguments.out, progress)
    })?;
    written.notes.iter().for_each(|note| terminal::assumed(note));
    terminal::notes(&written.checks);
    terminal::print(&written.files.join("\n"))
}

/// The masks to be written, in the order of the case.
fn items(arguments: &ExportArguments, time_point: &TimePoint) -> Result<Vec<Item>, AppError> {
    let regions = &time_point.regions;
    let own: Vec<Option<[u8; 3]>> = time_point.masks.iter().map(|m| m.color).collect();
    let colors = MaskColors::new(Palette::default(), &own);
    let items = match arguments.what {
        What::Masks => {
            let ids: Vec<&str> = time_point.masks.iter().map(|m| m.mask.id()).collect();
            let wanted: Vec<&str> = match arguments.select.as_str() {
                "all" => ids.clone(),
                text => text.split(',').map(str::trim).collect(),
            };
            if let Some(unknown) = wanted.iter().find(|id| !ids.contains(id)) {
                let expected = format!("masks of the case: {}", ids.join(", "));
                return Err(AppError::option("select", unknown, expected));
            }
            let name_of = |id: &str| time_point.masks.iter().find(|m| m.mask.id() == id)?.name.clone();
            export::masks(time_point, &colors, &name_of, &|id| wanted.contains(&id))
        }
        What::Regions => {
            let selection = resolve::selection_with_voxels(&arguments.select, regions)?;
            export::regions(time_point, &colors, &|bits| selection.shows(bits))
        }
        What::Selection => {
            let selection = resolve::selection_with_voxels(&arguments.select, regions)?;
            export::selection(time_point, &colors, &|bits| selection.shows(bits))
        }
    };
    if items.is_empty() {
        return Err(AppError::option("select", &arguments.select, "something of the case"));
    }
    Ok(items)
}
