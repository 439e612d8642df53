//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use glam::DVec3;
use glioscope_core::{
    case::{Case, CaseError, CaseGridChoice, LoadOptions},
    files::format::volume_names,
};
use glioscope_render::{
    ChangeStyle, ClipPlane, LightingMode, MutualOcclusion, Preset, SliceVariant, TransferPreset,
    flat::Overlay,
};

use super::{
    change::ChangeArguments,
    ellipsoids::Neighbors,
    parse::{self, LensArgument, View, word},
    terminal,
    tracts::TractArguments,
};
use crate::{error::AppError, model::CaseRef, world::load};

/// Compares tumour segmentations. Without a subcommand it opens the window.
#[derive(Debug, Parser)]
#[command(name = "glioscope", version, about, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// What to do without a window.
    #[command(subcommand)]
    pub task: Option<Task>,
    /// The case to open; the embedded sample without one.
    #[command(flatten)]
    pub case: CaseArguments,
    /// How the window opens.
    #[command(flatten)]
    pub window: WindowArguments,
}

/// How the window opens.
#[derive(Clone, Debug, Default, Args)]
pub struct WindowArguments {
    /// Use only the software graphics adapter.
    #[arg(long)]
    pub software: bool,
    /// Write a picture of the window to this file once the case is drawn, then quit.
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Task {
    /// Open the window.
    Open {
        /// The case.
        #[command(flatten)]
        case: CaseArguments,
        /// How the window opens.
        #[command(flatten)]
        window: WindowArguments,
    },
    /// Say what a file or a case is, without reading voxels where it can be helped.
    Info {
        /// An image, a manifest or a folder.
        target: Option<PathBuf>,
        /// The case, where it is given in parts.
        #[command(flatten)]
        case: MaskArguments,
        /// As JSON.
        #[arg(long)]
        json: bool,
    },
    /// Count masks, regions and their agreement.
    Measure {
        /// The case.
        #[command(flatten)]
        case: CaseArguments,
        /// As JSON: see docs/json.md.
        #[arg(long)]
        json: bool,
    },
    /// Enclose every connected component of every mask and region by an ellipsoid.
    Ellipsoids {
        /// The case.
        #[command(flatten)]
        case: CaseArguments,
        /// Neighbours of a voxel: 6, 18 or 26.
        #[arg(long, value_name = "6|18|26", value_enum, default_value = "26", hide_possible_values = true)]
        connectivity: Neighbors,
        /// The volume is at most 1 + E times the smallest possible. Below 1e-12 rounding decides.
        #[arg(long, value_name = "E", default_value_t = 1e-7, value_parser = parse::within(1e-12..=1e3),
              allow_hyphen_values = true)]
        tolerance: f64,
        /// As JSON: see docs/json.md.
        #[arg(long)]
        json: bool,
    },
    /// Say how near fibre tracts run to the masks.
    Tracts(TractArguments),
    /// Say how the surface of a mask moved between two dates.
    Change(Box<ChangeArguments>),
    /// Draw one view into a PNG.
    Render(Box<RenderArguments>),
    /// Write the pictures of every view and all numbers into a folder.
    Report {
        /// The case; the embedded sample without one.
        #[command(flatten)]
        case: CaseArguments,
        /// The folder.
        #[arg(long)]
        out: PathBuf,
        /// Use only the software graphics adapter.
        #[arg(long)]
        software: bool,
    },
    /// Write the embedded sample case as files.
    Sample {
        /// The folder.
        #[arg(long)]
        out: PathBuf,
    },
}

/// Masks and images given one by one.
#[derive(Clone, Debug, Default, Args)]
pub struct MaskArguments {
    /// A mask: ID=FILE[:1,4][@TIME]. Repeat for more.
    #[arg(long = "mask", value_name = "ID=FILE[:LABELS][@TIME]")]
    pub masks: Vec<String>,
    /// An image: ID=FILE[@TIME]. Repeat for more.
    #[arg(long = "context", value_name = "ID=FILE[@TIME]")]
    pub contexts: Vec<String>,
    /// Use the embedded sample.
    #[arg(long, conflicts_with_all = ["masks", "contexts"])]
    pub sample: bool,
    /// The mask or image whose grid the case gets; else the finest mask's.
    #[arg(long, value_name = "ID")]
    pub case_grid: Option<String>,
    /// Most bytes of voxels that a file may declare.
    #[arg(long, value_name = "BYTES", default_value_t = 4 << 30)]
    pub max_bytes: u64,
}

/// How a case is named.
#[derive(Clone, Debug, Default, Args)]
pub struct CaseArguments {
    /// How the case is named.
    #[arg(help = case_help())]
    pub path: Option<PathBuf>,
    /// The case in parts.
    #[command(flatten)]
    pub parts: MaskArguments,
    /// Fibre tracts beside those of the case: a .tck or .trk file. Repeat for more.
    #[arg(long = "tracts", value_name = "FILE")]
    pub tracts: Vec<PathBuf>,
}

impl CaseArguments {
    /// The case named; `None` when nothing is.
    ///
    /// # Errors
    /// When it is named twice.
    pub fn reference(&self) -> Result<Option<CaseRef>, AppError> {
        let parts = &self.parts;
        let in_parts = !parts.masks.is_empty() || !parts.contexts.is_empty();
        match (&self.path, in_parts, parts.sample) {
            (Some(path), false, false) => Ok(Some(CaseRef::Path(path.clone()))),
            (None, true, false) => {
                Ok(Some(CaseRef::Arguments { masks: parts.masks.clone(), contexts: parts.contexts.clone() }))
            }
            (None, false, true) => Ok(Some(CaseRef::Sample)),
            (None, false, false) => Ok(None),
            _ => {
                Err(AppError::arguments("a case named twice", "a path, or --mask and --context, or --sample"))
            }
        }
    }

    /// Limits and choices of loading.
    pub fn options(&self) -> LoadOptions {
        LoadOptions {
            max_bytes: self.parts.max_bytes,
            case_grid: self.parts.case_grid.clone().map_or(CaseGridChoice::FinestMask, CaseGridChoice::Of),
        }
    }

    /// Reads the case with a progress bar on the terminal; its reference beside it.
    ///
    /// # Errors
    /// [`AppError`]; also when no case is named and `or_sample` is false.
    pub fn load(&self, or_sample: bool) -> Result<(CaseRef, Case), AppError> {
        let reference = match self.reference()? {
            Some(reference) => reference,
            None if or_sample => CaseRef::Sample,
            None => {
                return Err(AppError::arguments("no case", "a path, --mask and --context, or --sample"));
            }
        };
        let options = self.options();
        let (spec, case) = terminal::with_progress(|progress| -> Result<_, CaseError> {
            let mut spec = load::spec_of(&reference, &options, progress)?;
            spec.add_tracts(&self.tracts);
            glioscope_core::case::load(&spec, &options, progress).map(|case| (spec, case))
        })?;
        terminal::guess(&spec);
        terminal::notes(&case.checks);
        Ok((reference, case))
    }
}

/// What a case can be named by.
fn case_help() -> String {
    format!("A manifest (case.toml), a folder, a {} file or a session file", volume_names())
}

/// How the 3D views are lit, and how well.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct LightArguments {
    /// The lighting mode.
    #[arg(long, value_name = "MODE", value_parser = word::<LightingMode>())]
    pub light: Option<LightingMode>,
    /// How well; reference without it.
    #[arg(long, value_name = "PRESET", value_parser = word::<Preset>())]
    pub quality: Option<Preset>,
    /// Half the opening angle of the cone that light comes from, in degrees: 0 to 85.
    #[arg(long, value_name = "DEG", value_parser = parse::within(0.0..=85.0), allow_hyphen_values = true)]
    pub aperture: Option<f64>,
    /// How slices carry occlusion; paper: with approximate distances.
    #[arg(long, value_name = "VARIANT", value_parser = word::<SliceVariant>())]
    pub slices: Option<SliceVariant>,
    /// Points along a side of the slices' footprint: 1 to 13.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=13))]
    pub footprint: Option<u32>,
    /// Distance of slices.
    #[arg(long, value_name = "MM", value_parser = parse::above_zero(100.0), allow_hyphen_values = true)]
    pub slice_mm: Option<f64>,
    /// What darkens what, of image-image, opaque-image, image-opaque and opaque-opaque, or none; slices only.
    #[arg(long, value_name = "A-B,...", value_parser = parse::darkens)]
    pub darkens: Option<MutualOcclusion>,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    /// The case; the embedded sample without one.
    #[command(flatten)]
    pub case: CaseArguments,
    /// What is drawn.
    #[arg(long, default_value = "closeup", value_parser = parse::view())]
    pub view: View,
    /// Pixels: WIDTHxHEIGHT.
    #[arg(long, default_value = "1024x1024", value_parser = parse::size)]
    pub size: [u32; 2],
    /// Regions to show, others hidden: T1,T1+PET. `all` and `none` are understood.
    #[arg(long, value_name = "REGION,...")]
    pub select: Option<String>,
    /// The lens in millimetres: X,Y,Z,RADIUS, or `off`.
    #[arg(long, value_name = "X,Y,Z,R", value_parser = parse::lens, allow_hyphen_values = true)]
    pub lens: Option<LensArgument>,
    /// The camera in degrees: AZIMUTH,ELEVATION. 0,0 looks at the face, 90,0 stands at the patient's left.
    #[arg(long, value_name = "AZ,EL", value_parser = parse::camera, allow_hyphen_values = true)]
    pub camera: Option<[f64; 2]>,
    /// Orthographic instead of perspective.
    #[arg(long)]
    pub orthographic: bool,
    /// The crosshair in millimetres.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::place, allow_hyphen_values = true)]
    pub cursor: Option<DVec3>,
    /// The image that slices show, by id; `none` for none.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// Its window: LOW,HIGH.
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse::low_high, allow_hyphen_values = true)]
    pub window: Option<[f64; 2]>,
    /// Patient's left on the left.
    #[arg(long)]
    pub neurological: bool,
    /// How masks lie on slices.
    #[arg(long, value_parser = word::<Overlay>())]
    pub overlay: Option<Overlay>,
    /// The date, by its label.
    #[arg(long, value_name = "LABEL")]
    pub time: Option<String>,
    /// Colours that common colour vision deficiencies tell apart.
    #[arg(long)]
    pub color_blind_safe: bool,
    /// Colours show how many masks are active, not which.
    #[arg(long)]
    pub agreement: bool,
    /// The diagram selects whole masks.
    #[arg(long)]
    pub whole_masks: bool,
    /// The context view's transfer function.
    #[arg(long, value_name = "PRESET", value_parser = word::<TransferPreset>())]
    pub transfer: Option<TransferPreset>,
    /// Cut the context image open: SIDE=MM with right, left, front, back, top or bottom; what lies
    /// beyond that coordinate on that side is taken away. Repeat for more.
    #[arg(long = "clip", value_name = "SIDE=MM", value_parser = parse::clip)]
    pub clips: Vec<ClipPlane>,
    /// Ellipsoids of the components' own volume instead of enclosing ones.
    #[arg(long)]
    pub moment: bool,
    /// Opacity of ellipsoids, 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub ellipsoid_opacity: Option<f64>,
    /// Components below this volume have no ellipsoid.
    #[arg(long, value_name = "ML", value_parser = parse::within(0.0..=1e6), allow_hyphen_values = true)]
    pub hide_below: Option<f64>,
    /// Change view: how change is drawn.
    #[arg(long, value_name = "STYLE", value_parser = word::<ChangeStyle>())]
    pub style: Option<ChangeStyle>,
    /// Change view and dates: the mask compared, by id; without it the first that both dates have.
    #[arg(long, value_name = "ID")]
    pub of: Option<String>,
    /// Change view and dates: the earlier date, by its label; without it the first.
    #[arg(long, value_name = "LABEL")]
    pub from: Option<String>,
    /// Change view and dates: the later date, by its label; without it the last.
    #[arg(long, value_name = "LABEL")]
    pub to: Option<String>,
    /// Change view: the shortest arrow.
    #[arg(long, value_name = "MM", value_parser = parse::within(0.0..=1000.0), allow_hyphen_values = true)]
    pub threshold: Option<f64>,
    /// Slices: outlines of both dates and what changed.
    #[arg(long)]
    pub changed_rim: bool,
    /// How the 3D views are lit.
    #[command(flatten)]
    pub light: LightArguments,
    /// Show the axial slice as a plane in closeup and ellipsoid diagram.
    #[arg(long)]
    pub slice_plane: bool,
    /// Magnification of the 3D view; 1 fits.
    #[arg(long, value_name = "FACTOR", value_parser = parse::within(0.05..=100.0), allow_hyphen_values = true)]
    pub zoom: Option<f64>,
    /// On a dark background.
    #[arg(long)]
    pub dark: bool,
    /// Pixels per logical point: 0.25 to 8.
    #[arg(long, default_value = "1", value_parser = parse::within(0.25..=8.0), allow_hyphen_values = true)]
    pub scale: f64,
    /// Only the renderer's picture: no legend, cube or scale bar (closeup).
    #[arg(long)]
    pub plain: bool,
    /// Use only the software graphics adapter.
    #[arg(long)]
    pub software: bool,
    /// Print the plan: what is drawn, what is left out and why.
    #[arg(long)]
    pub explain: bool,
    /// Print adapter, pass times and the expected error of the light as JSON.
    #[arg(long)]
    pub stats: bool,
    /// The picture.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}
