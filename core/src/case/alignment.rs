//! Registration transforms of a case: what they move, and where it lies then.

use std::path::{Path, PathBuf};

use glam::DAffine3;
use serde::{Deserialize, Serialize, Serializer};

use super::{CaseError, CaseSpec, names::at_time};
use crate::{
    Check, Grid, Progress,
    check::listed,
    decimal,
    files::{self, ReadOptions, Source, printable},
    grid::rows,
    transform::{self, Convention, Format, Given, ImageGeometry, Images, Transform},
};

/// By how much a transform may multiply volumes.
const SCALES: std::ops::RangeInclusive<f64> = 0.1..=10.0;
/// Change of volumes, as a share, above which it is a warning.
const SCALE_WARNING: f64 = 0.01;
/// The word of FLIRT's matrices beside those of [`Convention`].
const FLIRT: &str = "flirt";

/// A transform that moves an image or mask, or all of a date, into the case's space.
///
/// A transform with an id moves it into the space of its date, one without moves the date: where both are given they are
/// composed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alignment {
    /// The id of the image and of the mask that it moves; `None`: all of its date.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// The date; `None`: every date of the id, or the only one of the case.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Where it is from.
    pub by: AlignedBy,
    /// The day on which a reader saw that the anatomy meets; `None`: nobody said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accepted: Option<String>,
}

/// Where a transform is from. Its fixed image is the one whose space is kept, its moving image the one that is moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlignedBy {
    /// A file of another program, see [`transform::read`].
    File {
        /// The file.
        path: PathBuf,
        /// What a bare 4x4 matrix means: a word of [`Convention`], or `flirt`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        convention: Option<String>,
        /// The fixed and the moving image, which FLIRT's matrices and `register.dat` need.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        images: Option<[PathBuf; 2]>,
    },
    /// Numbers.
    Matrix {
        /// Maps RAS mm of the fixed image to RAS mm of the moving one: the first three rows of a 4x4 matrix.
        moving_from_fixed: [[f64; 4]; 3],
        /// How it was found, in words.
        how: String,
        /// How far repeated registrations differ at the tumour (95 %); `None` where it was not measured.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        consistency_mm: Option<f64>,
        /// How far points of the tumour end from where they began on their way around a loop of registrations (95 %); `None`
        /// where it was not measured.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        loop_mm: Option<f64>,
    },
}

impl AlignedBy {
    /// Numbers of a registration, and how it was found.
    pub fn matrix(moving_from_fixed: DAffine3, how: impl Into<String>) -> Self {
        let [x, y, z] = [moving_from_fixed.x_axis, moving_from_fixed.y_axis, moving_from_fixed.z_axis];
        let t = moving_from_fixed.translation;
        let row = |n: usize| [x[n], y[n], z[n], t[n]];
        let moving_from_fixed = [row(0), row(1), row(2)];
        Self::Matrix { moving_from_fixed, how: how.into(), consistency_mm: None, loop_mm: None }
    }

    /// The numbers of a matrix; `None` of a file.
    pub fn given(&self) -> Option<DAffine3> {
        let Self::Matrix { moving_from_fixed: [x, y, z], .. } = self else { return None };
        let column = |n: usize| glam::DVec3::new(x[n], y[n], z[n]);
        Some(DAffine3::from_cols(column(0), column(1), column(2), column(3)))
    }

    /// What it is called in messages.
    pub fn name(&self) -> String {
        match self {
            Self::File { path, .. } => {
                printable(&path.file_name().unwrap_or(path.as_os_str()).to_string_lossy())
            }
            Self::Matrix { how, .. } => how.clone(),
        }
    }

    /// The files that it is read from.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        match self {
            Self::File { path, images, .. } => {
                std::iter::once(path).chain(images.iter().flatten()).cloned().collect()
            }
            Self::Matrix { .. } => Vec::new(),
        }
    }

    fn read(&self) -> Result<Transform, CaseError> {
        match self {
            Self::File { path, convention, images } => {
                let seen = Format::of_file(path)?;
                let word = convention.as_deref().map(str::trim);
                let known = word.and_then(Convention::of_word);
                let is_flirt = word == Some(FLIRT);
                if let Some(word) = word.filter(|_| known.is_none() && !is_flirt) {
                    let words = Convention::ALL.map(Convention::word).join(", ");
                    let found = format!("the convention {word:?}");
                    return Err(CaseError::wrong(shown(path), found, format!("{words} or {FLIRT}")));
                }
                if word.is_some() && seen != Format::Matrix {
                    let found = format!("a convention of {}", seen.name());
                    return Err(CaseError::wrong(shown(path), found, Format::Matrix.name()));
                }
                let format = if is_flirt { Format::Flirt } else { seen };
                let images = match images {
                    Some([fixed, moving]) if format.needs_images() => {
                        Some(Images { fixed: geometry(fixed)?, moving: geometry(moving)? })
                    }
                    _ => None,
                };
                Ok(transform::read(path, &Given { format: Some(format), convention: known, images })?)
            }
            Self::Matrix { how, .. } => {
                let affine = self.given().unwrap_or(DAffine3::IDENTITY);
                Transform::new(affine)
                    .map_err(|refusal| CaseError::wrong(how, refusal.found, refusal.expected))
            }
        }
    }
}

fn shown(path: &Path) -> String {
    printable(&path.display().to_string())
}

/// The grid of an image file.
fn geometry(path: &Path) -> Result<ImageGeometry, CaseError> {
    let loaded = files::read(&Source::File(path.to_owned()), &ReadOptions::default(), &Progress::new())?;
    Ok(ImageGeometry::of(loaded.volume.grid()))
}

impl Alignment {
    /// The form of an argument that states one.
    pub const FORM: &str = "ID[@TIME]=FILE[:CONVENTION], or @TIME=FILE";

    /// One that nobody has accepted yet.
    pub fn of(id: Option<String>, time: Option<String>, by: AlignedBy) -> Self {
        Self { id, time, by, accepted: None }
    }

    fn moves(&self, id: &str, time: Option<&str>) -> bool {
        self.id.as_deref().is_none_or(|own| own == id)
            && self.time.as_deref().is_none_or(|own| Some(own) == time)
    }

    /// What it moves, in words.
    pub fn target(&self) -> String {
        match (&self.id, &self.time) {
            (Some(id), time) => at_time(id, time.as_deref().unwrap_or_default()),
            (None, Some(time)) => format!("all of {time}"),
            (None, None) => "everything".into(),
        }
    }

    /// Parses `ID[@TIME]=FILE[:CONVENTION]` or `@TIME=FILE[:CONVENTION]`. Whether an id contains the last `@` shows once
    /// the case is read.
    ///
    /// # Errors
    /// [`CaseError::Wrong`] for another form.
    pub fn from_argument(text: &str) -> Result<Self, CaseError> {
        let (target, file) = text
            .split_once('=')
            .filter(|(target, file)| !target.trim().is_empty() && !file.trim().is_empty())
            .ok_or_else(|| CaseError::wrong("--transform", format!("{text:?}"), Self::FORM))?;
        let target = target.trim();
        let known = |word: &str| word == FLIRT || Convention::of_word(word).is_some();
        let (file, convention) = match file.rsplit_once(':') {
            Some((path, word)) if known(word) && !Path::new(file).exists() => (path, Some(word.to_owned())),
            _ => (file, None),
        };
        let by = AlignedBy::File { path: file.into(), convention, images: None };
        let (id, time) = match target.rsplit_once('@') {
            Some((id, time)) => (id.trim(), Some(time.trim().to_owned())),
            None => (target, None),
        };
        Ok(Self::of((!id.is_empty()).then(|| id.to_owned()), time, by))
    }

    /// As it is meant for a case: an id may contain `@`. `None` where it moves nothing of it.
    fn meant(&self, spec: &CaseSpec) -> Option<Self> {
        let whole = match (&self.id, &self.time) {
            (Some(id), Some(time)) => {
                Some(Self { id: Some(format!("{id}@{time}")), time: None, ..self.clone() })
            }
            _ => None,
        };
        std::iter::once(self.clone()).chain(whole).find(|alignment| alignment.moves_any(spec))
    }

    /// The same with other files: `change` of each.
    #[must_use]
    pub fn with_files(&self, change: &dyn Fn(&Path) -> PathBuf) -> Self {
        let by = match &self.by {
            AlignedBy::File { path, convention, images } => AlignedBy::File {
                path: change(path),
                convention: convention.clone(),
                images: images.as_ref().map(|[fixed, moving]| [change(fixed), change(moving)]),
            },
            matrix @ AlignedBy::Matrix { .. } => matrix.clone(),
        };
        Self { by, ..self.clone() }
    }

    /// Whether it moves an image or mask of a case.
    pub fn moves_any(&self, spec: &CaseSpec) -> bool {
        spec.contexts.iter().any(|image| self.moves(&image.id, image.time.as_deref()))
            || spec.masks.iter().any(|mask| self.moves(&mask.id, mask.time.as_deref()))
    }
}

fn nothing_moved(target: &str, spec: &CaseSpec) -> CaseError {
    let mut known: Vec<String> = Vec::new();
    let images =
        spec.contexts.iter().map(|image| at_time(&image.id, image.time.as_deref().unwrap_or_default()));
    let masks = spec.masks.iter().map(|mask| at_time(&mask.id, mask.time.as_deref().unwrap_or_default()));
    for name in images.chain(masks) {
        if !known.contains(&name) {
            known.push(name);
        }
    }
    let known = listed(&known, 8);
    CaseError::wrong(
        &spec.name,
        format!("a transform of {target}, which the case lacks"),
        format!("one of {known}"),
    )
}

/// What was moved into the case's space.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Aligned {
    /// Its name in the case.
    pub id: String,
    /// Its time point's label; empty where the case has one without a name.
    pub time: String,
    /// Whether it is a mask; an image otherwise.
    pub is_mask: bool,
    /// How, in words: that of the item, then that of its date.
    pub by: Vec<String>,
    /// How far repeated registrations of it differ at the tumour (95 %); `None` where that was not measured.
    pub consistency_mm: Option<f64>,
    /// How far points of the tumour end from where they began on their way around loops of registrations (95 %); `None` where
    /// that was not measured.
    pub loop_mm: Option<f64>,
    /// The day on which a reader saw that the anatomy meets, the latest of its transforms'; `None`: nobody said so of each.
    pub accepted: Option<String>,
    /// Whether its date was moved, so that it lies in the space of the case; else only into that of its date.
    #[serde(skip)]
    pub with_date: bool,
    /// Maps RAS mm of its file to RAS mm of the case; as JSON four rows of four numbers.
    #[serde(serialize_with = "as_rows")]
    pub case_from_own: DAffine3,
}

impl Aligned {
    /// Whether a transform of its own moved it, not that of its date alone.
    pub fn has_own(&self) -> bool {
        !self.with_date || self.by.len() > 1
    }
}

fn as_rows<S: Serializer>(affine: &DAffine3, serializer: S) -> Result<S::Ok, S::Error> {
    rows(*affine).serialize(serializer)
}

/// The transforms of a case, read.
pub(super) struct Transforms {
    all: Vec<(Alignment, Transform)>,
}

/// The place of an image or mask in the case.
pub(super) struct Moved {
    pub grid: Grid,
    pub aligned: Aligned,
}

impl Transforms {
    /// Reads the transforms of a case.
    ///
    /// # Errors
    /// [`CaseError`] of a file, of a target that the case lacks, and of two transforms of one target.
    pub fn read(spec: &CaseSpec, more: &[Alignment]) -> Result<Self, CaseError> {
        let mut all = Vec::new();
        for alignment in spec.alignments.iter().chain(more) {
            if alignment.id.is_none() && alignment.time.is_none() {
                let found = "a transform without an id and a time";
                return Err(CaseError::wrong(&spec.name, found, "what it moves"));
            }
            let meant = alignment.meant(spec).ok_or_else(|| nothing_moved(&alignment.target(), spec))?;
            let transform = meant.by.read()?;
            all.push((meant, transform));
        }
        Ok(Self { all })
    }

    /// Where an image or mask lies; `None`: where its file says.
    ///
    /// # Errors
    /// [`CaseError::Wrong`] where two transforms move it alike, and for a grid that can't be used.
    pub fn moved(
        &self,
        case: &str,
        (id, time): (&str, Option<&str>),
        is_mask: bool,
        own: &Grid,
    ) -> Result<Option<Moved>, CaseError> {
        let of = |has_id: bool| -> Result<Option<&(Alignment, Transform)>, CaseError> {
            let mut all = self.all.iter().filter(|(a, _)| a.id.is_some() == has_id && a.moves(id, time));
            let first = all.next();
            if let (Some((first, _)), Some((second, _))) = (first, all.next()) {
                let item = at_time(id, time.unwrap_or_default());
                let found = format!("two transforms of {item}: {} and {}", first.by.name(), second.by.name());
                return Err(CaseError::wrong(case, found, "one"));
            }
            Ok(first)
        };
        let found: Vec<_> = [of(true)?, of(false)?].into_iter().flatten().collect();
        if found.is_empty() {
            return Ok(None);
        }
        let case_from_own =
            found.iter().fold(DAffine3::IDENTITY, |moved, (_, t)| t.fixed_from_moving() * moved);
        let volumes = case_from_own.matrix3.determinant();
        if !(SCALES.contains(&volumes)) {
            let found = format!(
                "a transform of {} that multiplies volumes by {volumes:.3e}",
                at_time(id, time.unwrap_or_default())
            );
            return Err(CaseError::wrong(case, found, "0.1 to 10: one patient's scans"));
        }
        let grid = Grid::new(own.dims(), case_from_own * own.world_from_voxel(), own.sides())
            .map_err(|e| CaseError::wrong(case, e.to_string(), "a transform to a usable grid"))?;
        let aligned = Aligned {
            id: id.to_owned(),
            time: time.unwrap_or_default().to_owned(),
            is_mask,
            by: found.iter().map(|(a, _)| a.by.name()).collect(),
            consistency_mm: consistency(found.iter().map(|(a, _)| &a.by)),
            loop_mm: around(found.iter().map(|(a, _)| &a.by)),
            accepted: found
                .iter()
                .map(|(a, _)| a.accepted.clone())
                .collect::<Option<Vec<_>>>()
                .and_then(|days| days.into_iter().max()),
            with_date: found.iter().any(|(a, _)| a.id.is_none()),
            case_from_own,
        };
        Ok(Some(Moved { grid, aligned }))
    }
}

/// That of transforms one after the other; unknown where that of any is.
fn consistency<'a>(all: impl Iterator<Item = &'a AlignedBy>) -> Option<f64> {
    let of = |by: &AlignedBy| match by {
        AlignedBy::Matrix { consistency_mm, .. } => *consistency_mm,
        AlignedBy::File { .. } => None,
    };
    all.map(of).try_fold(0.0_f64, |sum, mm| Some(sum.hypot(mm?)))
}

/// That of the loops of transforms one after the other; of those where it was measured.
fn around<'a>(all: impl Iterator<Item = &'a AlignedBy>) -> Option<f64> {
    let of = |by: &AlignedBy| match by {
        AlignedBy::Matrix { loop_mm, .. } => *loop_mm,
        AlignedBy::File { .. } => None,
    };
    all.filter_map(of).reduce(f64::hypot)
}

/// An image or mask, moved or not.
pub(super) struct Item<'a> {
    pub id: &'a str,
    pub time: &'a str,
    pub is_mask: bool,
    /// The grid of its file.
    pub own: &'a Grid,
    /// `None`: where its file says.
    pub aligned: Option<&'a Aligned>,
}

/// What was moved, and what was not though it lies on the grid of something that was.
pub(super) fn checks(items: &[Item<'_>]) -> Vec<Check> {
    let mut checks = Vec::new();
    for item in items {
        let name = at_time(item.id, item.time);
        let Some(aligned) = item.aligned else {
            let beside = items.iter().find(|other| {
                other.time == item.time
                    && other
                        .aligned
                        .is_some_and(|a| (a.is_mask, &a.id) != (item.is_mask, &item.id.to_owned()))
                    && other.own.same_place(item.own, 1e-3)
            });
            if let Some(other) = beside {
                checks.push(Check::warning(
                    "aligned-in-part",
                    format!(
                        "{name}: lies on the grid of {}, which a transform moves, and is not moved itself",
                        at_time(other.id, other.time)
                    ),
                ));
            }
            continue;
        };
        let center = item.own.center_mm();
        let by_mm = aligned.case_from_own.transform_point3(center).distance(center);
        // Its inverse turns as far.
        let turn_deg = Transform::new(aligned.case_from_own).map_or(0.0, |t| t.turn_deg());
        let volumes = aligned.case_from_own.matrix3.determinant();
        if item.is_mask && (volumes - 1.0).abs() > SCALE_WARNING {
            let text = format!(
                "{name}: moved by {}, which multiplies volumes by {}: volumes on the case grid, and their change, are of \
                 the mask as it is moved; native volumes are the file's",
                aligned.by.join(", then by "),
                decimal::text(volumes, 3)
            );
            checks.push(Check::warning("aligned-scales", text));
        }
        let around = aligned.loop_mm.map_or_else(String::new, |mm| {
            format!("; a loop of registrations is off by {} mm", decimal::text(mm, 2))
        });
        checks.push(Check::note(
            "aligned",
            format!(
                "{name}: moved by {}: its centre by {} mm, turned by {}°{around}",
                aligned.by.join(", then by "),
                decimal::text(by_mm, 2),
                decimal::text(turn_deg, 2)
            ),
        ));
    }
    checks
}
