//! What a DICOM file or folder holds, for `glioscope info`.

use serde::Serialize;

use super::super::{FileError, FileInfo, Source};
use super::instance::Patient;
use super::open::{Found, segments_of};
use super::scan::Kind;
use super::study::{SeriesSummary, Studies, VolumeSummary};
use crate::{Check, Progress, decimal};

#[derive(Serialize)]
struct Info {
    file: String,
    format: &'static str,
    kind: &'static str,
    modality: String,
    transfer_syntax: String,
    frame_of_reference: String,
    date: String,
    files: usize,
    volumes: Vec<Volume>,
    segments: Vec<NamedSegment>,
    checks: Vec<Check>,
}

#[derive(Serialize)]
struct Volume {
    dims: [usize; 3],
    spacing_mm: Option<[f64; 3]>,
    world_from_voxel: Option<[[f64; 4]; 4]>,
    axis_codes: Option<String>,
    key: String,
    problem: Option<String>,
}

#[derive(Serialize)]
struct NamedSegment {
    number: i64,
    name: String,
}

impl Kind {
    /// Its name: `image`, `segmentation`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::Segmentation => "segmentation",
            Self::StructureSet => "structure set",
            Self::Directory => "directory",
            Self::Other => "other",
        }
    }
}

/// As [`super::super::info()`].
pub(in super::super) fn info(source: &Source, progress: &Progress) -> Result<Box<dyn FileInfo>, FileError> {
    let found = Found::of(source, progress)?;
    let first = &found.own[0];
    let mut info = Info {
        file: found.name.clone(),
        format: "DICOM",
        kind: found.kind.name(),
        modality: first.identity.modality.clone(),
        transfer_syntax: first.transfer_syntax.clone(),
        frame_of_reference: first.identity.frame_of_reference.clone(),
        date: first.identity.date.clone(),
        files: found.own.len(),
        volumes: Vec::new(),
        segments: Vec::new(),
        checks: Vec::new(),
    };
    if found.kind == Kind::Image {
        let series = found.image()?;
        info.checks.clone_from(&series.checks);
        for stack in &series.stacks {
            let grid = stack.grid();
            info.checks.extend(stack.step.iter().flat_map(|step| step.checks.clone()));
            let grid_of = grid.as_ref().ok();
            info.volumes.push(Volume {
                dims: stack.dims,
                spacing_mm: grid_of.map(|grid| grid.spacing_mm().to_array()),
                world_from_voxel: grid_of.map(|grid| crate::grid::rows(grid.world_from_voxel())),
                axis_codes: grid_of.map(|grid| grid.axis_codes().iter().collect()),
                key: stack.key_text(),
                problem: grid.err().map(|unusable| unusable.to_string()),
            });
        }
        if let Some(uptake) = &series.uptake {
            let how = match uptake.factor {
                Some(factor) => format!("SUVbw, {factor} times the stored unit: {}", uptake.how),
                None => format!("no SUVbw, because {}", uptake.how),
            };
            info.checks.push(Check::note("pet-suv", how));
        }
    } else {
        let segments = segments_of(first)?;
        info.segments =
            segments.into_iter().map(|s| NamedSegment { number: s.number, name: s.name }).collect();
    }
    Ok(Box::new(info))
}

impl FileInfo for Info {
    fn text(&self) -> String {
        let mut lines = vec![
            self.file.clone(),
            format!("format      DICOM {} ({})", self.kind, self.modality),
            format!("files       {}", self.files),
            format!("encoding    {}", self.transfer_syntax),
            format!("date        {}", if self.date.is_empty() { "unknown" } else { &self.date }),
        ];
        for (n, volume) in self.volumes.iter().enumerate() {
            let [columns, rows, slices] = volume.dims;
            let spacing =
                volume.spacing_mm.map_or_else(String::new, |mm| format!(", {} mm", decimal::sizes(mm, 4)));
            let axes =
                volume.axis_codes.as_deref().map_or_else(String::new, |codes| format!(", axes {codes}"));
            let key = if volume.key.is_empty() { String::new() } else { format!("  ({})", volume.key) };
            lines.push(format!("volume {n:<4} {columns} × {rows} × {slices}{spacing}{axes}{key}"));
            lines.extend(volume.problem.iter().map(|problem| format!("            {problem}")));
        }
        for segment in &self.segments {
            lines.push(format!("segment {:<3} {}", segment.number, super::super::printable(&segment.name)));
        }
        lines.extend(
            self.checks
                .iter()
                .map(|c| format!("{:?} [{}]: {}", c.severity, c.code, c.message).to_lowercase()),
        );
        lines.join("\n")
    }

    fn checks(&self) -> &[Check] {
        &self.checks
    }

    fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }
}

#[derive(Serialize)]
struct TreeSeries<'a> {
    series_instance_uid: &'a str,
    number: &'a str,
    description: &'a str,
    modality: &'a str,
    kind: &'static str,
    date: &'a str,
    files: usize,
    bytes: u64,
    frame_of_reference_uid: &'a str,
    folder: String,
    volumes: &'a [VolumeSummary],
    segments: Vec<NamedSegment>,
    problem: Option<&'a str>,
    checks: &'a [Check],
}

fn tree_series(series: &SeriesSummary) -> TreeSeries<'_> {
    let segments = series.segments.iter().map(|s| NamedSegment { number: s.number, name: s.name.clone() });
    TreeSeries {
        series_instance_uid: &series.uid,
        number: &series.number,
        description: &series.description,
        modality: &series.modality,
        kind: series.kind.name(),
        date: &series.date,
        files: series.files,
        bytes: series.bytes,
        frame_of_reference_uid: &series.frame_of_reference,
        folder: series.folder.display().to_string(),
        volumes: &series.volumes,
        segments: segments.collect(),
        problem: series.problem.as_deref(),
        checks: &series.checks,
    }
}

fn series_line(series: &SeriesSummary) -> String {
    let what = if let Some(problem) = &series.problem {
        format!("not shown: {problem}")
    } else if series.segments.is_empty() {
        let volumes: Vec<String> = series
            .volumes
            .iter()
            .map(|volume| {
                let [columns, rows, slices] = volume.dims;
                let key = if volume.key.is_empty() { String::new() } else { format!(" ({})", volume.key) };
                let kind = if volume.is_localizer { " localizer" } else { "" };
                let problem = volume.problem.as_ref().map(|p| format!(" not shown: {p}")).unwrap_or_default();
                format!("{columns} × {rows} × {slices}{key}{kind}{problem}")
            })
            .collect();
        crate::check::listed(&volumes, 6)
    } else {
        let names: Vec<String> = series.segments.iter().map(|s| super::super::printable(&s.name)).collect();
        format!("{}: {}", counted(names.len(), "segment"), crate::check::listed(&names, 6))
    };
    format!("    {:>5} {} [{}] {what}", series.number, series.label(), counted(series.files, "file"))
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[derive(Serialize)]
struct TreeStudy<'a> {
    study_instance_uid: &'a str,
    description: &'a str,
    date: &'a str,
    series: Vec<TreeSeries<'a>>,
}

#[derive(Serialize)]
struct TreePatient<'a> {
    id: &'a str,
    name: &'a str,
    birth_date: &'a str,
    sex: &'a str,
    studies: Vec<TreeStudy<'a>>,
}

#[derive(Serialize)]
struct Tree<'a> {
    patients: Vec<TreePatient<'a>>,
    unreadable: Vec<String>,
    other_files: usize,
}

impl Patient {
    /// The name in its first representation, its parts separated by spaces, family name first.
    pub fn words(&self) -> String {
        let name = self.name.split('=').next().unwrap_or_default();
        name.split('^').filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
    }

    /// Name and identifier on one line; `unknown` where neither is stated.
    pub fn label(&self) -> String {
        let parts = [self.words(), self.id.clone()];
        let parts: Vec<String> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        if parts.is_empty() { "unknown".into() } else { super::super::printable(&parts.join(", ")) }
    }
}

impl SeriesSummary {
    /// Number, modality and description on one line.
    pub fn label(&self) -> String {
        let parts = [self.modality.as_str(), self.description.as_str()];
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        super::super::printable(&parts.join(" "))
    }
}

impl Studies {
    /// The tree as text: patients, studies, series.
    pub fn text(&self) -> String {
        let mut lines = Vec::new();
        for patient in &self.patients {
            lines.push(format!("patient {}", patient.patient.label()));
            for study in &patient.studies {
                let date = if study.date.is_empty() { "date unknown" } else { &study.date };
                lines.push(
                    format!("  study {date} {}", super::super::printable(&study.description))
                        .trim_end()
                        .to_owned(),
                );
                lines.extend(study.series.iter().map(series_line));
            }
        }
        lines.extend(self.unreadable.iter().map(|error| format!("unreadable  {error}")));
        if self.others > 0 {
            lines.push(format!("{} of other kinds", counted(self.others, "file")));
        }
        lines.join("\n")
    }

    /// The tree as indented JSON.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn json(&self) -> serde_json::Result<String> {
        let patients = self.patients.iter().map(|p| TreePatient {
            id: &p.patient.id,
            name: &p.patient.name,
            birth_date: &p.patient.birth_date,
            sex: &p.patient.sex,
            studies: p
                .studies
                .iter()
                .map(|study| TreeStudy {
                    study_instance_uid: &study.uid,
                    description: &study.description,
                    date: &study.date,
                    series: study.series.iter().map(tree_series).collect(),
                })
                .collect(),
        });
        serde_json::to_string_pretty(&Tree {
            patients: patients.collect(),
            unreadable: self.unreadable.iter().map(ToString::to_string).collect(),
            other_files: self.others,
        })
    }
}
