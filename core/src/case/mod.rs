//! A case: one patient's images and masks, over one or more time points.

mod arguments;
mod check;
mod discover;
mod load;
mod manifest;
mod names;
mod select;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    Cancelled, Check, Grid, Mask, Progress, Regions, Tracts, TumorIndex, Volume,
    files::{self, FileError, ReadOptions, Source},
};

pub use discover::open_spec;
pub use load::load_with;
pub use manifest::{VERSION as MANIFEST_VERSION, parse_manifest, read_manifest, write_manifest};

/// One image or mask that a case names, before it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct ContextSpec {
    /// Its name in the case.
    pub id: String,
    /// Its file.
    pub source: Source,
    /// Its time point's label; `None` where the case has one time point.
    pub time: Option<String>,
}

/// One mask that a case names, before it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskSpec {
    /// Its name in the case; the same id at several times is one mask over time.
    pub id: String,
    /// Its file.
    pub source: Source,
    /// Labels that count as active; `None` for every voxel above 0.5.
    pub labels: Option<Vec<i64>>,
    /// Its time point's label.
    pub time: Option<String>,
    /// Colour the case asks for, sRGB.
    pub color: Option<[u8; 3]>,
}

/// One file of fibre tracts that a case names, before it is read. Tracts belong to the case, not to
/// a time point.
#[derive(Clone, Debug, PartialEq)]
pub struct TractsSpec {
    /// Its name in the case.
    pub id: String,
    /// Its file.
    pub source: Source,
}

/// A case before it is read: from a manifest, a folder's names, or the command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CaseSpec {
    /// What the case is called.
    pub name: String,
    /// Images.
    pub contexts: Vec<ContextSpec>,
    /// Masks.
    pub masks: Vec<MaskSpec>,
    /// Fibre tracts.
    pub tracts: Vec<TractsSpec>,
    /// What was guessed or noticed while it was put together.
    pub notes: Vec<Check>,
}

impl CaseSpec {
    /// The case at `path`: a manifest, a folder, or one NIfTI file, as [`open_spec`] with default
    /// limits.
    ///
    /// # Errors
    /// As [`open_spec`].
    pub fn from_path(path: &Path) -> Result<Self, CaseError> {
        open_spec(path, &LoadOptions::default(), &Progress::new())
    }

    /// A case from the values of repeated `--mask ID=FILE[:1,4][@TIME]` and
    /// `--context ID=FILE[@TIME]`, in the order given. Files are relative to the current folder.
    ///
    /// File names may hold `=`, `@` and `:` (a Windows drive): the longest reading whose file
    /// exists is taken. Where none exists, the last `@` that no path separator follows starts the
    /// time, and a colon followed by whole numbers alone starts the labels.
    ///
    /// # Errors
    /// [`CaseError::Wrong`] for a value of another form. Whether the files exist shows when they
    /// are read.
    pub fn from_arguments(masks: &[String], contexts: &[String]) -> Result<Self, CaseError> {
        arguments::parse_all(masks, contexts)
    }

    /// Adds the values of repeated `--tracts FILE`, each named by its file without its ending, and by
    /// a number behind it where that name is taken.
    pub fn add_tracts(&mut self, files: &[PathBuf]) {
        for file in files {
            let stem = file.file_stem().map_or_else(|| "tracts".into(), |s| s.to_string_lossy());
            let taken = |id: &str| self.tracts.iter().any(|t| t.id == id);
            let mut id = stem.to_string();
            for number in 2.. {
                if !taken(&id) {
                    break;
                }
                id = format!("{stem} {number}");
            }
            self.tracts.push(TractsSpec { id, source: Source::File(file.clone()) });
        }
    }
}

/// Which grid the tumour index is on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CaseGridChoice {
    /// The finest mask's: smallest voxel volume, first named on ties; the first image's where
    /// there is no mask.
    #[default]
    FinestMask,
    /// That of the mask or image with this id.
    Of(String),
}

/// Limits and choices of loading.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// Most bytes of voxels a file may declare, and most bytes of a file of tracts.
    pub max_bytes: u64,
    /// The case grid.
    pub case_grid: CaseGridChoice,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { max_bytes: 4 << 30, case_grid: CaseGridChoice::default() }
    }
}

/// An image of a time point, on its own grid.
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
    /// Voxels on its own grid.
    pub native_voxels: u64,
    /// Millilitres on its own grid, before resampling.
    pub native_volume_ml: f64,
    /// Colour the case asks for, sRGB.
    pub color: Option<[u8; 3]>,
}

/// Fibre tracts of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct CaseTracts {
    /// Its name in the case.
    pub id: String,
    /// Its fibres.
    pub tracts: Arc<Tracts>,
}

/// The images and masks of one date.
#[derive(Clone, Debug, PartialEq)]
pub struct TimePoint {
    /// An ISO date or any label; empty where the case has one time point without a name.
    pub label: String,
    /// Images, in the order the case names them.
    pub contexts: Vec<Context>,
    /// Masks, in the order the case names them.
    pub masks: Vec<CaseMask>,
    /// Which masks are active where.
    pub index: Arc<TumorIndex>,
    /// Its regions.
    pub regions: Arc<Regions>,
}

/// A loaded, checked case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What it is called.
    pub name: String,
    /// The grid of every tumour index.
    pub grid: Grid,
    /// In the order first met.
    pub time_points: Vec<TimePoint>,
    /// Fibre tracts, in the order the case names them.
    pub tracts: Vec<CaseTracts>,
    /// Everything noticed on the way, most severe first.
    pub checks: Vec<Check>,
}

impl Case {
    /// Labels of the dates, in their order.
    pub fn time_labels(&self) -> Vec<&str> {
        self.time_points.iter().map(|t| t.label.as_str()).collect()
    }

    /// Position of the date with this label.
    pub fn time_at(&self, label: &str) -> Option<usize> {
        self.time_points.iter().position(|t| t.label == label)
    }
}

/// Why a case can't be opened: one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// A file of it.
    #[error(transparent)]
    File(#[from] FileError),
    /// The case itself.
    #[error("{case}: found {found}, expected {expected}")]
    Wrong {
        /// The manifest, folder or argument.
        case: String,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Reads every file of `spec`, brings the masks onto the case grid, and checks all of it.
///
/// # Errors
/// [`CaseError`].
pub fn load(spec: &CaseSpec, options: &LoadOptions, progress: &Progress) -> Result<Case, CaseError> {
    let read_options = ReadOptions { max_bytes: options.max_bytes, ..ReadOptions::default() };
    load_with(spec, options, progress, &|source| files::read(source, &read_options, progress))
}

#[cfg(test)]
mod tests;
