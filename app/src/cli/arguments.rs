//! Arguments of the command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use glam::DVec3;
use glioscope_render::{
    ChangeStyle, ClipPlane, ColorMap, LampFrame, LightSettings, LightingMode, MutualOcclusion, Palette,
    PathSettings, Preset, SliceVariant,
    flat::{Mixing, Overlay},
};

use super::{
    animation::AnimationArguments,
    case::{CaseArguments, MaskArguments},
    change::ChangeArguments,
    cohort::CohortArguments,
    ellipsoids::Neighbors,
    export::ExportArguments,
    lesions::LesionArguments,
    measure::MeasureArguments,
    pacs::PacsTask,
    page::PageArguments,
    parse::{self, LensArgument, TransferArgument, View, keyword},
    register::RegisterArguments,
    response::{ResponseArguments, ResponseOptions},
    self_check::SelfCheckArguments,
    study::StudyArguments,
    tracts::TractArguments,
    transform::TransformArguments,
};
use crate::{
    model::{
        CHANGE_SCALE_MM,
        fibers::{FIBER_DEVIATION, FIBER_RADIUS_MM},
        slice_axes::AxesOf,
    },
    report::Identity,
    words::Language,
};

/// Compares tumour segmentations. Without a subcommand it opens the window.
#[derive(Debug, Parser)]
#[command(name = "glioscope", version, about, args_conflicts_with_subcommands = true)]
pub struct Cli {
    /// The subcommand; without one the window opens.
    #[command(subcommand)]
    pub task: Option<Task>,
    /// The case to open; default: the embedded sample.
    #[command(flatten)]
    pub case: CaseArguments,
    /// Options of the window.
    #[command(flatten)]
    pub window: WindowArguments,
}

/// Options of the window.
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
        /// Options of the window.
        #[command(flatten)]
        window: WindowArguments,
    },
    /// Describe a file or a case, without reading voxels where possible.
    Info {
        /// An image, a manifest, a folder or a session file.
        target: Option<PathBuf>,
        /// The case, given as masks and images.
        #[command(flatten)]
        case: MaskArguments,
        /// As JSON.
        #[arg(long)]
        json: bool,
        /// Read an image a second time, with another reader, and report where the two disagree.
        #[arg(long)]
        cross_check: bool,
    },
    /// Measure masks, regions and their agreement.
    Measure(Box<MeasureArguments>),
    /// List the lesions of a mask at all dates: volume, diameters, and what became of each.
    Lesions(Box<LesionArguments>),
    /// Evaluate response by criteria of brain tumours at all dates: RANO and its kin, each call with its reasons.
    Response(Box<ResponseArguments>),
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
    /// Report the distances of fibre tracts to the masks.
    Tracts(TractArguments),
    /// Describe a registration transform of another program, or convert it.
    Transform(TransformArguments),
    /// Find the transform between two images.
    Register(RegisterArguments),
    /// Report how the surface of a mask moved between two dates.
    Change(Box<ChangeArguments>),
    /// Put known changes into a case's earlier date, and report what share of them is measured.
    SelfCheck(Box<SelfCheckArguments>),
    /// Compute many cases, each in processes of its own, and write tables of all of them.
    Cohort(Box<CohortArguments>),
    /// Write masks or regions as files of other programs.
    Export(Box<ExportArguments>),
    /// List, retrieve and send studies of an archive (PACS) by DICOMweb.
    Pacs {
        /// What is done.
        #[command(subcommand)]
        task: PacsTask,
    },
    /// Draw one view into a PNG, or as an animation into a GIF or MP4.
    Render(Box<RenderArguments>),
    /// Write a report: one HTML or PDF file with pictures and numbers, Markdown, or a folder with a file of each.
    Report(Box<ReportArguments>),
    /// Write the page that a patient takes home: one HTML file that turns in a phone's browser.
    Page(Box<PageArguments>),
    /// Make a report again from what it was made with, and say what differs.
    Replay(Box<ReplayArguments>),
    /// Measure how well people see depth, size and shape in the program's lights, and analyse what they answered.
    Study(Box<StudyArguments>),
    /// Write the embedded sample case as files.
    Sample {
        /// The folder.
        #[arg(long)]
        out: PathBuf,
    },
}

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArguments {
    /// The case; default: the embedded sample.
    #[command(flatten)]
    pub case: CaseArguments,
    /// The file (.html, .pdf, .md; its numbers: .json, .csv; as DICOM: .dcm holds the PDF, .sr.dcm measurements and response) or the folder.
    #[arg(long, value_name = "FILE|FOLDER")]
    pub out: PathBuf,
    /// How much of the patient's identity it has. Default: a file none; a folder, whose files are for other programs, all.
    #[arg(long, value_enum)]
    pub identity: Option<Identity>,
    /// Name the reader of a session in a report that doesn't identify the patient in full.
    #[arg(long)]
    pub name_reader: bool,
    /// The language of a file.
    #[arg(long, value_enum)]
    pub language: Option<Language>,
    /// The response by criteria that it has; none without --criteria or --history.
    #[command(flatten)]
    pub response: ResponseOptions,
    /// Also check the change on this case, with known changes put in: up to a minute more.
    #[arg(long)]
    pub self_check: bool,
    /// Write over a file that exists.
    #[arg(long)]
    pub force: bool,
    /// Use only the software graphics adapter.
    #[arg(long)]
    pub software: bool,
}

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The report: .html, .pdf, .md, or the PDF in DICOM.
    pub report: PathBuf,
    /// The case, where the report doesn't say where its files are.
    #[command(flatten)]
    pub case: MaskArguments,
    /// The case as a path: a manifest, a folder or a file.
    #[arg(long, value_name = "PATH")]
    pub of: Option<PathBuf>,
    /// The history of its response, where the report doesn't have it.
    #[arg(long, value_name = "FILE")]
    pub history: Option<PathBuf>,
    /// Use only the software graphics adapter.
    #[arg(long)]
    pub software: bool,
}

/// Lighting of the 3D views.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct LightArguments {
    /// The lighting mode. Soft shadows of slices or cones show depth order and size best, the hard ones of a lamp (half-angle,
    /// shadow-volume) absolute depth in CT; a headlight (the others) is liked best in pictures for patients. Path-traced is for
    /// explaining.
    #[arg(long, value_name = "MODE", value_parser = keyword::<LightingMode>())]
    pub light: Option<LightingMode>,
    /// Quality preset; default: reference.
    #[arg(long, value_name = "PRESET", value_parser = keyword::<Preset>())]
    pub quality: Option<Preset>,
    /// Half the opening angle of the cone that light comes from, about the eye or (spherical harmonics) the lamp, in degrees: 0 to 85.
    #[arg(long, value_name = "DEG", value_parser = parse::within(0.0..=85.0), allow_hyphen_values = true)]
    pub aperture: Option<f64>,
    /// Half-angle, shadow volume, spherical harmonics, path-traced; slices, cones and headlights, whose light then comes from there instead of
    /// from the eye: where the lamp stands, in degrees: AZIMUTH,ELEVATION. To the viewer's right and upwards; 0,0 is at the eye.
    /// Slices: beside the scene light from before and behind it is mixed. Modes with a headlight: tissue is shaded as lit from there.
    #[arg(long, value_name = "AZ,EL", value_parser = parse::lamp, allow_hyphen_values = true)]
    pub lamp: Option<[f64; 2]>,
    /// Modes with a lamp: what it stands still to. For the patient its angles are those of `--camera`.
    #[arg(long, value_name = "FRAME", value_parser = keyword::<LampFrame>())]
    pub lamp_frame: Option<LampFrame>,
    /// Path-traced: share of the lamp in the light, 0 to 1; the rest is a white sky.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub lamp_share: Option<f64>,
    /// Path-traced: angular radius of the lamp, in degrees: 0 (hard shadows) to 60.
    #[arg(long, value_name = "DEG", value_parser = parse::within(0.0..=60.0), allow_hyphen_values = true)]
    pub lamp_radius: Option<f64>,
    /// Path-traced: the most paths of a pixel, 2 to 4096; fewer where the standard error is below 0.01.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=i64::from(PathSettings::MOST)))]
    pub paths: Option<u32>,
    /// Path-traced: the most scatterings of a path, 1 to 64.
    #[arg(long, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(PathSettings::MOST_BOUNCES)))]
    pub bounces: Option<u32>,
    /// Path-traced: where the image scatters light to: -0.95 (back) to 0.95 (forwards), 0 everywhere.
    #[arg(long, value_name = "COS", value_parser = parse::within(-0.95..=0.95), allow_hyphen_values = true)]
    pub anisotropy: Option<f64>,
    /// Slices: how occlusion is propagated; paper: with approximate distances.
    #[arg(long, value_name = "VARIANT", value_parser = keyword::<SliceVariant>())]
    pub slices: Option<SliceVariant>,
    /// Slices: samples along a side of the footprint, 1 to 13.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=13))]
    pub footprint: Option<u32>,
    /// Slices, half-angle: distance between slices.
    #[arg(long, value_name = "MM", value_parser = parse::above_zero(100.0), allow_hyphen_values = true)]
    pub slice_mm: Option<f64>,
    /// Cones, shadow volume, spherical harmonics, dynamic ambient: side of the cells of the image in which light is kept.
    #[arg(long, value_name = "MM", value_parser = parse::above_zero(100.0), allow_hyphen_values = true)]
    pub cell_mm: Option<f64>,
    /// Cones: parts into which the cone of light is divided, 1 to 128.
    #[arg(long, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(LightSettings::MOST_SUB_CONES)))]
    pub sub_cones: Option<u32>,
    /// Spherical harmonics: order of the functions, 0 to 5.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=5))]
    pub sky_order: Option<u32>,
    /// Spherical harmonics: directions in which light is looked for, 1 to 128.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=128))]
    pub sky_directions: Option<u32>,
    /// Spherical harmonics: share of the light that comes from everywhere, 0 to 1; the rest comes from around the lamp.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub sky_share: Option<f64>,
    /// Dynamic ambient: clusters of surroundings, 1 to 1024.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub clusters: Option<u32>,
    /// Dynamic ambient, spherical harmonics: how much of its colour tissue gives to the tissue that it darkens, 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub tissue_bleeding: Option<f64>,
    /// Modes with a headlight: how much tissue is shaded by its gradients, 0 (not at all) to 1.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub tissue_shading: Option<f64>,
    /// Slices: pairs A-B where A darkens B, of image-image, opaque-image, image-opaque and opaque-opaque; or none.
    #[arg(long, value_name = "A-B,...", value_parser = parse::darkens)]
    pub darkens: Option<MutualOcclusion>,
    /// Distance within which surfaces darken each other, in the modes with ambient occlusion.
    #[arg(long, value_name = "MM", value_parser = parse::within(0.0..=1000.0), allow_hyphen_values = true)]
    pub occlusion_mm: Option<f64>,
    /// Share of the light that hidden places receive, too: 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub ambient: Option<f64>,
    /// Light at the eye in the closeup: 0 (flat colours) to 1 (rims darkest).
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub relief: Option<f64>,
    /// Closeup: a smooth surface instead of voxels, for the eye only.
    #[arg(long)]
    pub smooth: bool,
    /// Slices: distance up to which opaque surfaces darken their vicinity, and from which on they cast soft shadows.
    #[arg(long, value_name = "MM", value_parser = parse::above_zero(1000.0), allow_hyphen_values = true)]
    pub vicinity_mm: Option<f64>,
    /// Slices: samples of vicinity occlusion, 1 to 118.
    #[arg(long, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(LightSettings::MOST_VICINITY)))]
    pub vicinity_samples: Option<u32>,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    /// The case; default: the embedded sample.
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
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    pub cursor: Option<DVec3>,
    /// The image that slices show, by id; `none` for none.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// Its window: LOW,HIGH.
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse::low_high, allow_hyphen_values = true)]
    pub window: Option<[f64; 2]>,
    /// A second image on slices: ID[@DATE].
    #[arg(long, value_name = "ID[@DATE]")]
    pub second: Option<String>,
    /// How both images share a slice.
    #[arg(long, value_parser = keyword::<Mixing>(), requires = "second")]
    pub mixing: Option<Mixing>,
    /// Colours of the second image.
    #[arg(long, value_parser = keyword::<ColorMap>(), requires = "second")]
    pub color_map: Option<ColorMap>,
    /// Opacity of the second image over the first, or where the line of a swipe is, 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), requires = "second", allow_hyphen_values = true)]
    pub mixing_share: Option<f64>,
    /// The second image in the context view: the largest value along each ray, over everything.
    #[arg(long, requires = "second")]
    pub second_in_context: bool,
    /// Patient's left on the left.
    #[arg(long)]
    pub neurological: bool,
    /// Along whose axes slices lie: the patient's, those of the image's scan, or the principal axes of the masks shown.
    #[arg(long, value_enum, value_name = "AXES")]
    pub slice_axes: Option<AxesOf>,
    /// How masks are drawn on slices.
    #[arg(long, value_parser = keyword::<Overlay>())]
    pub overlay: Option<Overlay>,
    /// Outlines on slices are solid, dashed and dotted in turn.
    #[arg(long)]
    pub outline_patterns: bool,
    /// The date, by its label.
    #[arg(long, value_name = "LABEL")]
    pub time: Option<String>,
    /// Colours of masks and of change; the default is distinguishable with common colour vision deficiencies.
    #[arg(long, value_name = "PALETTE", value_parser = keyword::<Palette>())]
    pub palette: Option<Palette>,
    /// Colours show how many masks are active, not which.
    #[arg(long)]
    pub agreement: bool,
    /// The diagram selects whole masks.
    #[arg(long)]
    pub whole_masks: bool,
    /// The context view's transfer function: a preset or a file.
    #[arg(long, value_name = "PRESET|FILE", value_parser = parse::transfer, help = parse::transfer_help())]
    pub transfer: Option<TransferArgument>,
    /// Clip the context image: SIDE=MM with right, left, front, back, top or bottom removes what lies beyond that
    /// coordinate on that side. Repeat for more.
    #[arg(long = "clip", value_name = "SIDE=MM", value_parser = parse::clip)]
    pub clips: Vec<ClipPlane>,
    /// Colour of fibre tracts: `plain` (one per file), `direction` or the name of a scalar of theirs.
    #[arg(long = "fibre-colour", alias = "fibre-color", value_name = "plain|direction|SCALAR")]
    pub fibre_colour: Option<String>,
    /// Values of the scalar at the ends of its colours; without it its least and greatest.
    #[arg(long, value_name = "LOW,HIGH", value_parser = parse::low_high, requires = "fibre_colour", allow_hyphen_values = true)]
    pub fibre_range: Option<[f64; 2]>,
    /// Colours of the scalar; default: viridis.
    #[arg(long, value_parser = keyword::<ColorMap>(), requires = "fibre_colour")]
    pub fibre_map: Option<ColorMap>,
    /// Half the width of fibre tracts: 0.1 to 3.
    #[arg(long, value_name = "MM", value_parser = parse::within(FIBER_RADIUS_MM), allow_hyphen_values = true)]
    pub fibre_radius: Option<f64>,
    /// Fibre tracts as smooth curves; the largest distance from them as a share of the radius, 0.005 to 0.5: 0.05 if left
    /// out.
    #[arg(long, value_name = "SHARE", num_args = 0..=1, require_equals = true, default_missing_value = "0.05",
          value_parser = parse::within(FIBER_DEVIATION))]
    pub fibre_smooth: Option<f64>,
    /// Ellipsoids of the components' volume instead of enclosing ones.
    #[arg(long)]
    pub moment: bool,
    /// Opacity of ellipsoids, 0 to 1.
    #[arg(long, value_name = "SHARE", value_parser = parse::within(0.0..=1.0), allow_hyphen_values = true)]
    pub ellipsoid_opacity: Option<f64>,
    /// Components below this volume have no ellipsoid.
    #[arg(long, value_name = "ML", value_parser = parse::within(0.0..=1e6), allow_hyphen_values = true)]
    pub hide_below: Option<f64>,
    /// Change view: how change is drawn.
    #[arg(long, value_name = "STYLE", value_parser = keyword::<ChangeStyle>())]
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
    /// Change view: minimum length of arrows.
    #[arg(long, value_name = "MM", value_parser = parse::within(0.0..=1000.0), allow_hyphen_values = true)]
    pub threshold: Option<f64>,
    /// Change view: the end of the colour scale; without it the comparison's own.
    #[arg(long, value_name = "MM", value_parser = parse::within(CHANGE_SCALE_MM), allow_hyphen_values = true)]
    pub scale_mm: Option<f64>,
    /// Change view: the outline of the earlier date over everything.
    #[arg(long)]
    pub earlier_outline: bool,
    /// Slices: the outlines of both dates, and the change.
    #[arg(long)]
    pub changed_rim: bool,
    /// Lighting of the 3D views.
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
    /// Print the render plan: passes that run, passes left out and why.
    #[arg(long)]
    pub explain: bool,
    /// Print adapter, pass times and the expected error of the light as JSON.
    #[arg(long)]
    pub stats: bool,
    /// Also measure the error of the light in this picture of the closeup or context view, by rays in double precision at some
    /// thousand pixels.
    #[arg(long, requires = "stats")]
    pub light_error: bool,
    /// An animation in place of a picture.
    #[command(flatten)]
    pub animation: AnimationArguments,
    /// The file to write: .png, of an animation .gif, or .mp4 where ffmpeg is installed.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}
