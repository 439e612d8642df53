//! Arguments that name a case.

use std::path::PathBuf;

use clap::Args;
use glioscope_core::{
    Check,
    case::{
        Alignment, CaseGridChoice, CaseRegistration, LoadOptions, RegisterCase, close_loops, has_loops,
        register_dates, register_images,
    },
    files::{DEFAULT_MAX_BYTES, format::volume_names},
};

use super::{parse, register::ModelArgument, terminal};
use crate::{
    error::AppError,
    model::{CaseRef, session},
    world::load::{self, ReadCase, Request},
};

/// A case given as masks and images.
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
    /// The mask or image whose grid becomes the case grid; default: the finest mask.
    #[arg(long, value_name = "ID")]
    pub case_grid: Option<String>,
    /// The dates in time order, by their labels; default: as the case or the labels state.
    #[arg(long, value_name = "LABEL,...", value_delimiter = ',')]
    pub order: Vec<String>,
    /// A registration transform that moves an image and mask, or all of a date, into the case's space: ITK, ANTs, 3D Slicer,
    /// FreeSurfer's .lta, or a bare matrix with its convention (FILE:niftyreg). Its fixed image is the one whose space is
    /// kept. Repeat for more.
    #[arg(long = "transform", value_name = "ID[@TIME]=FILE", value_parser = transform)]
    pub transforms: Vec<Alignment>,
    /// Register each later date to the first one, by its images, without the masks grown by 5 mm: --register=affine also
    /// scales and shears. What can't be registered is said and stays where its files say.
    #[arg(long, value_enum, value_name = "MODEL", num_args = 0..=1, require_equals = true, default_missing_value = "rigid")]
    pub register: Option<ModelArgument>,
    /// Register the other images of each date to its first one, by mutual information, each with the masks that were drawn on its
    /// grid; before --register.
    #[arg(long, value_enum, value_name = "MODEL", num_args = 0..=1, require_equals = true, default_missing_value = "rigid")]
    pub register_images: Option<ModelArgument>,
    /// With --register and --register-images: also how far points of the tumour end from where they began on their way around a
    /// loop of registrations: the first date, two later ones and back; there by one image and back by another one; or the same
    /// of three images of a date. One more registration for each loop.
    #[arg(long)]
    pub loops: bool,
    /// All files lie in one space, though they state several frames of reference.
    #[arg(long)]
    pub one_space: bool,
    /// Of a subject's folder of BIDS: the derived data set whose masks belong to its images, by its name in derivatives/ or a path
    /// with a /. Repeat for more, or none. Default: the only one that has any of the subject, where that has no masks itself.
    #[arg(long, value_name = "NAME", value_parser = parse::derived)]
    pub derivatives: Vec<PathBuf>,
    /// Maximum bytes of voxels that a file may declare, and maximum size of a tract file in bytes.
    #[arg(long, value_name = "BYTES", default_value_t = DEFAULT_MAX_BYTES)]
    pub max_bytes: u64,
}

/// The case to read.
#[derive(Clone, Debug, Default, Args)]
pub struct CaseArguments {
    /// The case as a path.
    #[arg(help = case_help())]
    pub path: Option<PathBuf>,
    /// The case as masks and images.
    #[command(flatten)]
    pub parts: MaskArguments,
    /// Fibre tracts in addition to the case's: a .tck or .trk file, gzipped or not. Repeat for more. A .tsf has scalars of
    /// the tracts before it; those beside a .tck with its name are read, too.
    #[arg(long = "tracts", value_name = "FILE")]
    pub tracts: Vec<PathBuf>,
}

impl CaseArguments {
    /// The case given; `None` without one.
    ///
    /// # Errors
    /// [`AppError::Wrong`] where it is given in more than one form.
    pub fn reference(&self) -> Result<Option<CaseRef>, AppError> {
        let parts = &self.parts;
        let has_parts = !parts.masks.is_empty() || !parts.contexts.is_empty();
        match (&self.path, has_parts, parts.sample) {
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

    /// Options of loading.
    pub fn options(&self) -> LoadOptions {
        LoadOptions {
            max_bytes: self.parts.max_bytes,
            case_grid: self.parts.case_grid.clone().map_or(CaseGridChoice::FinestMask, CaseGridChoice::Of),
            order: self.parts.order.clone(),
            alignments: self.parts.transforms.clone(),
            one_space: self.parts.one_space,
            derivatives: self.parts.derivatives.clone(),
        }
    }

    /// What to open: the case given, or the session with what isn't given here.
    ///
    /// # Errors
    /// [`AppError`] where none is given and `or_sample` is false, and for a session that can't be read.
    pub fn request(&self, or_sample: bool) -> Result<Request, AppError> {
        let request = self.plain_request(or_sample)?;
        let (register, of_images, loops) =
            (self.parts.register, self.parts.register_images, self.parts.loops);
        if loops && register.is_none() && of_images.is_none() {
            return Err(AppError::arguments("--loops alone", "--register or --register-images beside it"));
        }
        let request = match of_images {
            Some(model) => registered(request, "--register-images", (model, loops), register_images)?,
            None => request,
        };
        match register {
            Some(model) => registered(request, "--register", (model, loops), register_dates),
            None => Ok(request),
        }
    }

    fn plain_request(&self, or_sample: bool) -> Result<Request, AppError> {
        let options = self.options();
        match self.reference()? {
            Some(CaseRef::Path(path)) if session::is_session(&path) => {
                Ok(Request::of_session(session::load(&path)?, &self.tracts, &options))
            }
            None if !or_sample => {
                Err(AppError::arguments("no case", "a path, --mask and --context, or --sample"))
            }
            reference => {
                let (case, tracts) = (reference.unwrap_or_default(), self.tracts.clone());
                Ok(Request { case, tracts, options, ..Request::default() })
            }
        }
    }

    /// Reads the case, with a progress bar on the terminal, and prints its guesses and warnings to stderr.
    ///
    /// # Errors
    /// [`AppError`] where it can't be read, or where none is given and `or_sample` is false.
    pub fn read(&self, or_sample: bool) -> Result<ReadCase, AppError> {
        let request = self.request(or_sample)?;
        let read = terminal::with_progress(|progress| load::read_at_once(request, progress))?;
        terminal::guess(&read.spec);
        terminal::notes(&read.case.checks);
        Ok(read)
    }
}

/// The request with its dates or images registered, as `option` asks.
fn registered(
    mut request: Request,
    option: &str,
    (model, loops): (ModelArgument, bool),
    register: RegisterCase,
) -> Result<Request, AppError> {
    let read = terminal::with_progress(|progress| load::read_at_once(request.clone(), progress))?;
    if loops && !has_loops(&read.case) {
        let expected = "three dates, two dates with two images in common, or a date with three images";
        return Err(AppError::wrong("--loops", "no loop", expected));
    }
    let model = model.into();
    let mut found = terminal::with_progress(|progress| register(&read.case, None, model, progress))?;
    if found.is_empty() {
        let expected = "a case with several dates or images, some of them not moved yet";
        return Err(AppError::wrong(option, "nothing to move", expected));
    }
    if loops {
        terminal::with_progress(|progress| close_loops(&read.case, &mut found, model, progress))?;
    }
    for CaseRegistration { time, images, result, .. } in found {
        let images = images.map(|[fixed, own]| format!("{own} on {fixed}: ")).unwrap_or_default();
        let time = if time.is_empty() { String::new() } else { format!("{time}: ") };
        match result {
            Ok(registered) => {
                let warning = |text: &String| Check::warning("registered", format!("{time}{images}{text}"));
                request.findings.extend(registered.warnings.iter().map(warning));
                request.options.alignments.extend(registered.alignments);
            }
            Err(why) => request.findings.push(Check::warning(
                "registration-failed",
                format!("{time}{images}{why}; it lies where its files say"),
            )),
        }
    }
    Ok(request)
}

fn transform(text: &str) -> Result<Alignment, String> {
    Alignment::from_argument(text).map_err(|_| Alignment::FORM.to_owned())
}

/// Help text of the case's path.
fn case_help() -> String {
    format!("A manifest (case.toml), a folder or zip archive, a {} file or a session file", volume_names())
}
