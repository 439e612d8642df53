//! What a folder, a CD or an export of a PACS holds: patients, studies and series, from headers alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::{FileError, Segment, read_head};
use super::instance::Patient;
use super::open::segments_of;
use super::parse;
use super::scan::{Header, Kind, header, scan};
use super::series::Series;
use crate::{Check, Progress};

/// Patients of a folder.
#[derive(Clone, Debug, Default)]
pub struct Studies {
    /// In the order of their identifiers.
    pub patients: Vec<PatientStudies>,
    /// DICOM files that can't be read, and why.
    pub unreadable: Vec<FileError>,
    /// Files of other kinds.
    pub others: usize,
}

/// A patient's studies.
#[derive(Clone, Debug)]
pub struct PatientStudies {
    /// Who it is, as the files state.
    pub patient: Patient,
    /// In the order of their dates.
    pub studies: Vec<StudySummary>,
}

/// A study.
#[derive(Clone, Debug)]
pub struct StudySummary {
    /// Study Instance UID.
    pub uid: String,
    /// Its description; may be empty.
    pub description: String,
    /// `YYYYMMDD`; may be empty.
    pub date: String,
    /// In the order of their numbers.
    pub series: Vec<SeriesSummary>,
}

/// A series.
#[derive(Clone, Debug)]
pub struct SeriesSummary {
    /// Series Instance UID.
    pub uid: String,
    /// Its number in the study; may be empty.
    pub number: String,
    /// Its description; may be empty.
    pub description: String,
    /// `CT`, `MR`, `PT`, `SEG`, `RTSTRUCT`, ...
    pub modality: String,
    /// `YYYYMMDD` of the acquisition, else of the series, else of the study; may be empty.
    pub date: String,
    /// What its files are.
    pub kind: Kind,
    /// Number of files.
    pub files: usize,
    /// Their size.
    pub bytes: u64,
    /// Frame of Reference UID; may be empty.
    pub frame_of_reference: String,
    /// The folder with all its files.
    pub folder: PathBuf,
    /// The first file.
    pub first_file: PathBuf,
    /// Volumes of an image.
    pub volumes: Vec<VolumeSummary>,
    /// Masks of a segmentation or structure set.
    pub segments: Vec<Segment>,
    /// Why it can't be opened.
    pub problem: Option<String>,
    /// Findings.
    pub checks: Vec<Check>,
}

/// A volume of a series.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VolumeSummary {
    /// Columns, rows and slices.
    pub dims: [usize; 3],
    /// Distances of voxels; of slices 0 where they aren't equally spaced.
    pub spacing_mm: [f64; 3],
    /// What tells it from the series' others: `EchoTime 90`; may be empty.
    pub key: String,
    /// Whether it is a localizer.
    pub is_localizer: bool,
    /// Why it can't be opened.
    pub problem: Option<String>,
}

/// Whether a file begins as DICOM does.
pub fn is_dicom(path: &Path) -> bool {
    read_head(path, 256).is_some_and(|head| parse::sniff(&head))
}

/// The Series Instance UID of a file.
///
/// # Errors
/// [`FileError::Wrong`] where it can't be read.
pub fn series_of(path: &Path) -> Result<String, FileError> {
    Ok(header(path)?.identity.series)
}

/// Patients, studies and series below `folder`: headers are read, in parallel, and no pixels.
///
/// # Errors
/// [`FileError`] where the folder can't be listed or holds more than 200,000 files; cancelled.
pub fn studies(folder: &Path, progress: &Progress) -> Result<Studies, FileError> {
    let scanned = scan(folder, progress)?;
    let mut tree: BTreeMap<Patient, BTreeMap<String, BTreeMap<String, Vec<Header>>>> = BTreeMap::new();
    let mut patients_seen = BTreeMap::new();
    for header in scanned.headers.into_iter().filter(|header| header.kind != Kind::Directory) {
        let identity = &header.identity;
        let patient = patients_seen.entry(identity.patient.key()).or_insert_with(|| identity.patient.clone());
        let studies = tree.entry(patient.clone()).or_default();
        let series = studies.entry(identity.study.clone()).or_default();
        series.entry(identity.series.clone()).or_default().push(header);
    }
    let mut patients = Vec::new();
    for (patient, by_study) in tree {
        let mut studies = Vec::new();
        for (uid, by_series) in by_study {
            let first =
                by_series.values().flatten().next().map(|header| header.identity.clone()).unwrap_or_default();
            let mut series = Vec::new();
            for files in by_series.values() {
                progress.check()?;
                series.extend(summary(files));
            }
            let number = |s: &SeriesSummary| s.number.parse::<i64>().unwrap_or(i64::MAX);
            series.sort_by(|a, b| (&a.date, number(a), &a.uid).cmp(&(&b.date, number(b), &b.uid)));
            studies.push(StudySummary {
                uid,
                description: first.study_description,
                date: first.study_date,
                series,
            });
        }
        studies.sort_by(|a, b| (&a.date, &a.uid).cmp(&(&b.date, &b.uid)));
        patients.push(PatientStudies { patient, studies });
    }
    Ok(Studies {
        patients,
        unreadable: scanned.unreadable.into_iter().chain(scanned.left_out).collect(),
        others: scanned.others,
    })
}

fn summary(files: &[Header]) -> Option<SeriesSummary> {
    let first = files.first()?;
    let identity = &first.identity;
    let mut summary = SeriesSummary {
        uid: identity.series.clone(),
        number: identity.series_number.clone(),
        description: identity.series_description.clone(),
        modality: identity.modality.clone(),
        date: files
            .iter()
            .map(|f| &f.identity.date)
            .filter(|d| !d.is_empty())
            .min()
            .cloned()
            .unwrap_or_default(),
        kind: first.kind,
        files: files.len(),
        bytes: files.iter().map(|file| file.file_bytes).sum(),
        frame_of_reference: identity.frame_of_reference.clone(),
        folder: common_folder(files),
        first_file: first.path.clone(),
        volumes: Vec::new(),
        segments: Vec::new(),
        problem: None,
        checks: Vec::new(),
    };
    match first.kind {
        Kind::Image => match Series::of(files.iter().collect(), "series") {
            Ok(series) => {
                summary.checks.clone_from(&series.checks);
                summary.volumes = series.stacks.iter().map(volume).collect();
                for step in series.stacks.iter().filter_map(|stack| stack.step.as_ref().ok()) {
                    summary.checks.extend(step.checks.iter().cloned());
                }
            }
            Err(error) => summary.problem = Some(without_file(&error)),
        },
        Kind::Segmentation | Kind::StructureSet => match segments_of(first) {
            Ok(segments) => summary.segments = segments,
            Err(error) => summary.problem = Some(without_file(&error)),
        },
        Kind::Directory | Kind::Other => summary.problem = Some("holds no image and no mask".into()),
    }
    Some(summary)
}

fn volume(stack: &super::stack::Stack) -> VolumeSummary {
    let grid = stack.grid();
    let [rows_mm, columns_mm] = stack.first.pixel_spacing_mm;
    let step_mm = stack.step.as_ref().map_or(0.0, |step| step.step_mm.length());
    VolumeSummary {
        dims: stack.dims,
        spacing_mm: [columns_mm, rows_mm, step_mm],
        key: stack.key_text(),
        is_localizer: stack.is_localizer,
        problem: grid.err().map(|unusable| unusable.to_string()),
    }
}

fn without_file(error: &FileError) -> String {
    match error {
        FileError::Wrong { found, expected, .. } => format!("found {found}, expected {expected}"),
        FileError::Cancelled(cancelled) => cancelled.to_string(),
    }
}

fn common_folder(files: &[Header]) -> PathBuf {
    let parent = |header: &Header| header.path.parent().map(Path::to_owned).unwrap_or_default();
    let mut folder = files.first().map(parent).unwrap_or_default();
    while !files.iter().all(|file| file.path.starts_with(&folder)) && folder.pop() {}
    folder
}
