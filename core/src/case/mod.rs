//! A case: one patient's images and masks, over one or more time points.

mod alignment;
mod arguments;
mod bids;
mod case_grid;
mod check;
mod discover;
mod findings;
mod folder;
mod load;
mod loops;
mod made;
mod manifest;
mod names;
mod native;
mod order;
mod origin;
mod proposal;
mod registration;
mod renamed;
mod scheme;
mod segments;
mod select;
mod sessions;
mod study;
mod subject;
mod tracts;
mod values;

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    Cancelled, Check, Grid, Mask, Progress, Regions, Tracts, TumorIndex, Volume,
    files::{self, FileError, Inputs, Part, ReadOptions, Source},
};

pub use alignment::{Aligned, AlignedBy, Alignment};
pub use arguments::argument_with_file;
pub use bids::{derived_data_set, files_of_other_data_sets};
pub use discover::{Description, describe, describe_files, folder_of_dicomdir, has_manifest, open_spec};
pub use load::load_with;
pub use loops::{close_loops, has_loops};
pub use made::MadeMask;
pub use manifest::{VERSION as MANIFEST_VERSION, parse_manifest, read_manifest, write_manifest};
pub use order::{OrderBasis, unordered_times};
pub use proposal::{Problem, Proposal, ProposedFile, ProposedMask, Role};
pub(crate) use registration::in_two_spaces;
pub use registration::{
    Around, CaseRegistration, NOT_ALIGNED_MM, P95_OF_UNIT_ERRORS, RegisterCase, Registered, apart_mm,
    register_dates, register_images,
};
pub use scheme::{Scheme, SchemeGroup, SchemeLabel};
pub use study::is_study;
pub use tracts::{TractScalarSpec, TractsSpec, is_tract_scalars};

/// Maximum number of images, masks and tracts in a case: twenty raters over a hundred dates are half of it.
const MAX_FILES: usize = 4096;

/// An image listed in a case, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub struct ContextSpec {
    /// Its name in the case.
    pub id: String,
    /// Its file.
    pub source: Source,
    /// Its time point's label; `None` where the case has one time point.
    pub time: Option<String>,
}

/// A mask listed in a case, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskSpec {
    /// Its name in the case; the same id at several time points is one mask over time.
    pub id: String,
    /// Its file.
    pub source: Source,
    /// Labels that count as active; `None` for every voxel above 0.5, or above 50 in a soft mask in per cent.
    pub labels: Option<Vec<i64>>,
    /// Without labels: values above it are active, in the file's unit; `None`: half of a soft mask, else 0.5.
    pub above: Option<f64>,
    /// Its time point's label.
    pub time: Option<String>,
    /// Colour set by the case, sRGB.
    pub color: Option<[u8; 3]>,
    /// What it is called beside its id: the tissue that its label means.
    pub name: Option<String>,
}

/// The description of a case, its files not yet read: from a manifest, a folder's file names, or the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CaseSpec {
    /// The case's name.
    pub name: String,
    /// Images.
    pub contexts: Vec<ContextSpec>,
    /// Masks.
    pub masks: Vec<MaskSpec>,
    /// Fibre tracts.
    pub tracts: Vec<TractsSpec>,
    /// Labels of the time points in time order, where that is stated; empty: as the labels themselves state.
    pub order: Vec<String>,
    /// Registration transforms.
    pub alignments: Vec<Alignment>,
    /// Whether the user has said that all files are one patient's, whatever they say themselves.
    pub one_patient: bool,
    /// Whether the user has said that all files lie in one space, whatever frames of reference they state.
    pub one_space: bool,
    /// Files that the description comes from: the manifest, the table of sessions.
    pub described_by: Vec<PathBuf>,
    /// Guesses and findings made while the description was put together.
    pub notes: Vec<Check>,
}

impl CaseSpec {
    /// The case at `path`: a manifest, a folder, or a single image file; as [`open_spec`] with default limits.
    ///
    /// # Errors
    /// As [`open_spec`].
    pub fn from_path(path: &Path) -> Result<Self, CaseError> {
        open_spec(path, &LoadOptions::default(), &Progress::new())
    }

    /// A case from the values of repeated `--mask ID=FILE[:1,4][@TIME]` and
    /// `--context ID=FILE[@TIME]`, in the order given. Files are relative to the current folder.
    ///
    /// File names may contain `=`, `@` and `:` (a Windows drive): of all interpretations whose file exists, that with
    /// the longest file name is used. Where none exists, the last `@` not followed by a path separator starts the
    /// time, and a colon followed only by integers starts the labels.
    ///
    /// # Errors
    /// [`CaseError::Wrong`] for a malformed value. Missing files are reported when they are read.
    pub fn from_arguments(masks: &[String], contexts: &[String]) -> Result<Self, CaseError> {
        arguments::parse_all(masks, contexts)
    }

    /// The files that the case is read from.
    pub fn inputs(&self) -> Inputs {
        let sources = self.contexts.iter().map(|c| &c.source).chain(self.masks.iter().map(|m| &m.source));
        let sources = sources.chain(self.tracts.iter().map(|t| &t.source));
        let scalars = self.tracts.iter().flat_map(|t| &t.scalars).map(|scalar| scalar.path.clone());
        let files = sources.flat_map(files::files_of).chain(scalars);
        let transforms = self.alignments.iter().flat_map(|alignment| alignment.by.files());
        Inputs::new(files.chain(transforms).chain(self.described_by.iter().cloned()))
    }

    /// The distinct labels of time points, in the order first listed.
    pub fn times(&self) -> Vec<String> {
        let all =
            self.contexts.iter().map(|image| &image.time).chain(self.masks.iter().map(|mask| &mask.time));
        let mut times: Vec<String> = Vec::new();
        for time in all.flatten() {
            if !times.contains(time) {
                times.push(time.clone());
            }
        }
        times
    }

    /// Whether `order` names each of its time points once.
    pub fn is_ordered_by(&self, order: &[String]) -> bool {
        order::names_each_once(order, &self.times())
    }

    /// Whether it has an image or a mask of this id.
    pub fn has_grid_of(&self, id: &str) -> bool {
        self.contexts.iter().any(|image| image.id == id) || self.masks.iter().any(|mask| mask.id == id)
    }

    /// Makes the paths of its files absolute.
    pub fn make_absolute(&mut self) {
        let images = self.contexts.iter_mut().map(|image| &mut image.source);
        let sources = images.chain(self.masks.iter_mut().map(|mask| &mut mask.source));
        for source in sources.chain(self.tracts.iter_mut().map(|tracts| &mut tracts.source)) {
            if let Source::File(path) | Source::Part(Part { path, .. }) = source {
                *path = files::absolute(path);
            }
        }
        for scalar in self.tracts.iter_mut().flat_map(|tracts| &mut tracts.scalars) {
            scalar.path = files::absolute(&scalar.path);
        }
        for alignment in &mut self.alignments {
            *alignment = alignment.with_files(&files::absolute);
        }
    }

    /// Adds the values of repeated `--tracts FILE`. Each is named after its file without extension, with a number
    /// appended where that name is taken. A file of scalars belongs to the tracts before it.
    pub fn add_tracts(&mut self, files: &[PathBuf]) {
        for file in files {
            let id = names::unique(&tracts_id(file), |id| self.tracts.iter().any(|t| t.id == id));
            self.push_tracts(id, Source::File(file.clone()));
        }
    }

    /// Adds a file of tracts, or one of scalars to the tracts before it. Without any, it is refused when it is read.
    fn push_tracts(&mut self, id: String, source: Source) {
        match (source.path().filter(|path| is_tract_scalars(path)), self.tracts.last_mut()) {
            (Some(path), Some(tracts)) => tracts.add_scalars(path.to_owned()),
            (None, _) | (_, None) => self.tracts.push(TractsSpec::new(id, source)),
        }
    }
}

/// The id of fibre tracts that have none: their file's name without extension.
fn tracts_id(file: &Path) -> String {
    let name = file.file_name().map_or_else(|| "tracts".into(), |name| name.to_string_lossy());
    files::format::tract_stem(&name).unwrap_or(&name).to_owned()
}

/// The grid of the tumour index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CaseGridChoice {
    /// That of the finest mask: smallest largest spacing, then smallest voxel volume, then the most voxels; that of the
    /// first image where there is no mask.
    #[default]
    FinestMask,
    /// That of the mask or image with this id.
    Of(String),
}

/// Options of loading a case.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Maximum bytes of voxels that a file may declare, and maximum size of a tract file in bytes.
    pub max_bytes: u64,
    /// The case grid.
    pub case_grid: CaseGridChoice,
    /// Labels of the time points in time order; empty: as the case or its labels state.
    pub order: Vec<String>,
    /// Registration transforms besides those of the case.
    pub alignments: Vec<Alignment>,
    /// Whether the user says that all files lie in one space.
    pub one_space: bool,
    /// The derived data sets of BIDS whose masks a subject's images have: names in `derivatives/`, absolute paths, or `none`.
    /// Empty: the only one that has any of the subject, where the subject has no masks itself.
    pub derivatives: Vec<PathBuf>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            max_bytes: files::DEFAULT_MAX_BYTES,
            case_grid: CaseGridChoice::default(),
            order: Vec::new(),
            alignments: Vec::new(),
            one_space: false,
            derivatives: Vec::new(),
        }
    }
}

/// An image of a time point, on its native grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Context {
    /// Its name in the case.
    pub id: String,
    /// Its voxels.
    pub volume: Arc<Volume>,
}

/// A mask of a time point.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseMask {
    /// On the case grid; bit k of the tumour index for the k-th mask.
    pub mask: Mask,
    /// Frame of Reference UID that its place is stated in; empty where nothing is stated, where a transform moved it, and
    /// where the user says that all lie in one space.
    pub frame_of_reference: String,
    /// The grid on which it was drawn, at its place in the case.
    pub native_grid: Grid,
    /// Active voxels on its native grid.
    pub native_voxels: u64,
    /// Volume on its native grid in millilitres, before resampling.
    pub native_volume_ml: f64,
    /// Of a soft mask (probabilities, of which the mask holds those above one half): their sum as a volume on the native
    /// grid in millilitres.
    pub expected_volume_ml: Option<f64>,
    /// Colour set by the case, sRGB.
    pub color: Option<[u8; 3]>,
    /// What the case calls it beside its id.
    pub name: Option<String>,
}

/// Fibre tracts of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseTracts {
    /// Its name in the case.
    pub id: String,
    /// Its fibres.
    pub tracts: Arc<Tracts>,
}

/// The images and masks of one time point.
#[derive(Clone, Debug, PartialEq)]
pub struct TimePoint {
    /// An ISO date or any label; empty where the case has one time point without a name.
    pub label: String,
    /// Images, in the order of the case.
    pub contexts: Vec<Context>,
    /// Masks, in the order of the tumour index's bits: that in which the case first lists their ids.
    pub masks: Vec<CaseMask>,
    /// Which masks are active where.
    pub index: Arc<TumorIndex>,
    /// Its regions.
    pub regions: Arc<Regions>,
}

/// Whose files they are, as far as they say; empty where none does.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Patient {
    /// Name, its parts separated by spaces, family name first.
    pub name: String,
    /// Identifier.
    pub id: String,
    /// Date of birth, `YYYYMMDD`.
    pub birth_date: String,
    /// Sex: `M`, `F` or `O`.
    pub sex: String,
    /// The studies that the files say they are of, in their order.
    pub studies: Vec<Study>,
}

/// A study as files name it; each text is empty where they don't.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Study {
    /// Label of its date.
    pub time: String,
    /// Its description.
    pub description: String,
    /// Its accession number.
    pub accession_number: String,
}

/// A loaded, checked case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The case's name.
    pub name: String,
    /// Whose files they are.
    pub patient: Patient,
    /// The grid of every tumour index.
    pub grid: Grid,
    /// Time points, in time order; in the order first listed where [`Case::order`] is unknown.
    pub time_points: Vec<TimePoint>,
    /// How the order of the time points is known.
    pub order: OrderBasis,
    /// Fibre tracts, in the order of the case.
    pub tracts: Vec<CaseTracts>,
    /// Whether the user says that all files lie in one space.
    pub one_space: bool,
    /// The images and masks that registration transforms moved.
    pub aligned: Vec<Aligned>,
    /// All findings, most severe first.
    pub checks: Vec<Check>,
    /// The files that it was read from.
    pub inputs: Inputs,
}

impl Case {
    /// Labels of the time points, in their order.
    pub fn time_labels(&self) -> Vec<&str> {
        self.time_points.iter().map(|t| t.label.as_str()).collect()
    }

    /// Position of the time point with this label.
    pub fn time_at(&self, label: &str) -> Option<usize> {
        self.time_points.iter().position(|t| t.label == label)
    }

    /// Whether any date has a mask of this id.
    pub fn has_mask(&self, id: &str) -> bool {
        self.time_points.iter().flat_map(|time| &time.masks).any(|m| m.mask.id() == id)
    }

    /// Whether any date has an image of this id.
    pub fn has_image(&self, id: &str) -> bool {
        self.time_points.iter().flat_map(|time| &time.contexts).any(|context| context.id == id)
    }

    /// Ids of the masks of all dates, each once, in alphabetical order.
    pub fn mask_ids(&self) -> Vec<&str> {
        let masks = self.time_points.iter().flat_map(|time| &time.masks);
        masks.map(|m| m.mask.id()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Ids of the images of all dates, likewise.
    pub fn image_ids(&self) -> Vec<&str> {
        let images = self.time_points.iter().flat_map(|time| &time.contexts);
        images.map(|context| context.id.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
    }
}

/// Why a case can't be opened, in one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// One of its files can't be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The case itself is invalid.
    #[error("{case}: found {found}, expected {expected}")]
    Wrong {
        /// The manifest, folder or argument.
        case: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The user cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl CaseError {
    pub(crate) fn wrong(
        case: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Wrong { case: case.into(), found: found.into(), expected: expected.into() }
    }
}

/// Reads every file of `spec`, resamples the masks onto the case grid, and checks the case.
///
/// # Errors
/// [`CaseError`].
pub fn load(spec: &CaseSpec, options: &LoadOptions, progress: &Progress) -> Result<Case, CaseError> {
    let read_options = ReadOptions { max_bytes: options.max_bytes, ..ReadOptions::default() };
    let spec = segments::resolve(spec, progress)?;
    load_with(&spec, options, progress, &|source| files::read(source, &read_options, progress))
}

#[cfg(test)]
mod alignment_tests;
#[cfg(test)]
mod proposal_tests;
#[cfg(test)]
mod tests;
