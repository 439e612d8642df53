//! A case from DICOM: which series of a folder are images, which hold masks, and which study is which date.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::{
    CaseError, Proposal, ProposedFile, Role, names,
    proposal::{LeftOutFor, drop_alike_colors, tell_files_apart},
};
use crate::{
    Check, Progress,
    check::listed,
    files::{
        dicom::{self, Kind, PatientStudies, SeriesSummary, Studies, VolumeSummary},
        printable,
    },
};

/// Fewest slices of a series that is proposed as an image: localizers and scouts have fewer.
const MIN_SLICES: usize = 3;

/// Names and identifiers that tell nobody apart.
const DUMMIES: [&str; 8] = ["", "0", "ANON", "ANONYM", "ANONYMOUS", "ANONYMIZED", "UNKNOWN", "NONE"];

/// A series with the label of its date.
struct Dated<'a> {
    series: &'a SeriesSummary,
    /// Date and description of its study.
    study: String,
    time: String,
}

/// Whether a folder's images are DICOM: it has such files and no other images.
pub fn is_study(folder: &Path, progress: &Progress) -> bool {
    super::folder::list(folder, progress)
        .is_ok_and(|listing| listing.volumes.is_empty() && !listing.dicom.is_empty())
}

/// A case from the DICOM files below `folder`; `only`: the series of this UID alone.
///
/// # Errors
/// [`CaseError`] where nothing of it can be shown.
pub(super) fn propose(
    folder: &Path,
    name: String,
    only: Option<&str>,
    left_out: Vec<Check>,
    progress: &Progress,
) -> Result<Proposal, CaseError> {
    progress.say("Reading headers");
    let mut studies = dicom::studies(folder, progress)?;
    if let Some(uid) = only {
        for study in studies.patients.iter_mut().flat_map(|patient| &mut patient.studies) {
            study.series.retain(|series| series.uid == uid);
        }
        studies.patients.retain(|patient| patient.studies.iter().any(|study| !study.series.is_empty()));
    }
    let Some(chosen) = best(&studies) else {
        let unreadable = studies.unreadable.first().map(ToString::to_string);
        let of_series = all_series(&studies).find_map(|series| series.problem.clone());
        let found = unreadable.or(of_series).unwrap_or_else(|| "nothing that can be shown".into());
        return Err(CaseError::wrong(
            printable(&folder.display().to_string()),
            found,
            "an image or a mask in DICOM",
        ));
    };
    let mut notes = left_out;
    let mut doubt = None;
    if studies.patients.len() > 1 {
        let names: Vec<String> = studies.patients.iter().map(|p| p.patient.label()).collect();
        doubt = Some(format!("files of {} patients ({})", names.len(), listed(&names, 3)));
    } else if is_dummy(&chosen.patient.id) && is_dummy(&chosen.patient.name) {
        notes.push(Check::warning(
            "dicom-nobody",
            "patient: found no identifier in the files; that all are one patient's can't be told",
        ));
    }
    let dated = dates(chosen, &mut notes);
    let mut files: Vec<ProposedFile> = Vec::new();
    let several = studies.patients.len() > 1;
    let label = |patient: &PatientStudies| if several { patient.patient.label() } else { String::new() };
    for Dated { series, study, time } in &dated {
        for mut file in proposed(folder, series, time) {
            file.patient = label(chosen);
            file.study.clone_from(study);
            files.push(file);
        }
    }
    tell_files_apart(&mut files);
    unique_ids(&mut files);
    for other in studies.patients.iter().filter(|other| other.patient != chosen.patient) {
        let mut own: Vec<ProposedFile> = Vec::new();
        for Dated { series, study, time } in dates(other, &mut Vec::new()) {
            own.extend(proposed(folder, series, &time).into_iter().map(|file| ProposedFile {
                patient: label(other),
                study: study.clone(),
                ..file
            }));
        }
        unique_ids(&mut own);
        files.extend(own);
    }
    drop_alike_colors(&mut files);
    for file in &mut files {
        file.suggested = file.role;
    }
    notes.extend(unreadable(&studies));
    let mut proposal = Proposal::new(name, folder, files, notes, doubt);
    if several {
        proposal.choose_patient(&chosen.patient.label());
    }
    Ok(proposal)
}

fn all_series(studies: &Studies) -> impl Iterator<Item = &SeriesSummary> {
    studies.patients.iter().flat_map(|patient| &patient.studies).flat_map(|study| &study.series)
}

fn is_dummy(text: &str) -> bool {
    DUMMIES.contains(&text.to_uppercase().as_str())
}

/// The patient with masks, else with the most images that can be shown.
fn best(studies: &Studies) -> Option<&PatientStudies> {
    let score = |patient: &PatientStudies| {
        let series = || patient.studies.iter().flat_map(|study| &study.series);
        let masks: usize = series().map(|s| s.segments.len()).sum();
        let slices: usize =
            series().flat_map(|s| &s.volumes).filter(|v| v.problem.is_none()).map(|v| v.dims[2]).sum();
        (masks, slices)
    };
    studies.patients.iter().filter(|patient| score(patient) != (0, 0)).max_by_key(|patient| score(patient))
}

/// The series of a patient with their dates: one for all series of a study, and none where there is one date.
fn dates<'a>(patient: &'a PatientStudies, notes: &mut Vec<Check>) -> Vec<Dated<'a>> {
    let mut all = Vec::new();
    let mut by_frame: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (n, study) in patient.studies.iter().enumerate() {
        let first =
            study.series.iter().map(|s| s.date.as_str()).filter(|d| !d.is_empty()).min().unwrap_or_default();
        let date = if study.date.is_empty() { first } else { &study.date };
        let time = readable(date)
            .unwrap_or_else(|| if date.is_empty() { format!("undated {}", n + 1) } else { date.to_owned() });
        for series in &study.series {
            if !series.frame_of_reference.is_empty() && !series.volumes.is_empty() {
                by_frame.entry(&series.frame_of_reference).or_default().insert(time.clone());
            }
            if !series.date.is_empty()
                && !date.is_empty()
                && series.date != date
                && series.kind == Kind::Image
            {
                let own = readable(&series.date).unwrap_or_else(|| series.date.clone());
                notes.push(Check::warning(
                    "dicom-dates",
                    format!("{}: acquired on {own}, in a study of {time}", series.label()),
                ));
            }
            let description = printable(&study.description);
            let title = [readable(&study.date).unwrap_or_default(), description].join(" ").trim().to_owned();
            all.push(Dated { series, study: title, time: time.clone() });
        }
    }
    // Masks may have been drawn in a later study than that of their image.
    for dated in all.iter_mut().filter(|dated| !dated.series.segments.is_empty()) {
        if let Some(times) = by_frame.get(dated.series.frame_of_reference.as_str())
            && times.len() == 1
            && let Some(time) = times.first()
        {
            dated.time.clone_from(time);
        }
    }
    let times: BTreeSet<&String> = all.iter().map(|dated| &dated.time).collect();
    if times.len() < 2 {
        all.iter_mut().for_each(|dated| dated.time.clear());
    } else {
        let labels: Vec<String> = times.into_iter().cloned().collect();
        notes.push(Check::note(
            "guessed-times",
            format!("times: from the studies' dates: {}", labels.join(", ")),
        ));
    }
    all
}

/// `2024-03-02` of `20240302`.
fn readable(date: &str) -> Option<String> {
    let is_date = date.len() == 8 && date.bytes().all(|b| b.is_ascii_digit());
    is_date.then(|| format!("{}-{}-{}", &date[..4], &date[4..6], &date[6..]))
}

/// What a series is in the case: an image for each of its volumes, or a file with its masks.
fn proposed(folder: &Path, series: &SeriesSummary, time: &str) -> Vec<ProposedFile> {
    let title = |key: &str| {
        let number = if series.number.is_empty() { String::new() } else { format!("{}: ", series.number) };
        let key = if key.is_empty() { String::new() } else { format!(" ({key})") };
        format!("{number}{}{key}", series.label())
    };
    let file = |path: PathBuf, role: Role, id: String, key: &str| {
        let mut file = ProposedFile::new(path, role, id, time.to_owned());
        file.series = Some(series.uid.clone());
        file.title = title(key);
        file
    };
    let left_out = |file: ProposedFile, left_out_for: LeftOutFor, reason: &str| ProposedFile {
        role: Role::LeftOut,
        left_out_for,
        reason: reason.to_owned(),
        ..file
    };
    let unneeded = |file, reason: &str| left_out(file, LeftOutFor::Unneeded, reason);
    let faulty = |file, problem: &str| left_out(file, LeftOutFor::Fault, problem);
    match (&series.problem, series.kind) {
        (Some(problem), kind) => {
            let file = file(series.folder.clone(), Role::LeftOut, id_of(series), "");
            let is_image_or_mask = !matches!(kind, Kind::Other | Kind::Directory);
            vec![if is_image_or_mask { faulty(file, problem) } else { unneeded(file, problem) }]
        }
        (None, Kind::Segmentation | Kind::StructureSet) => {
            // Its image lies somewhere below the folder.
            let mut file = file(folder.to_owned(), Role::Mask, id_of(series), "");
            file.reason = format!("DICOM {}", series.kind.name());
            file.set_segments(&series.segments);
            if file.masks.is_empty() {
                return vec![unneeded(file, "no segment with closed contours")];
            }
            vec![file]
        }
        _ => {
            let several = series.volumes.len() > 1;
            let is_thin = |volume: &&VolumeSummary| volume.dims[2] < MIN_SLICES;
            let thin = series.volumes.iter().filter(is_thin).count();
            if thin == series.volumes.len() {
                let file = file(series.folder.clone(), Role::Image, id_of(series), "");
                let reason = match (thin, series.volumes.first()) {
                    (_, Some(first)) if first.is_localizer => "a localizer".to_owned(),
                    (1, Some(first)) if first.dims[2] == 1 => "one slice".to_owned(),
                    _ => format!("{thin} volumes of fewer than {MIN_SLICES} slices"),
                };
                return vec![unneeded(file, &reason)];
            }
            let each = series.volumes.iter().enumerate().map(|(frame, volume)| {
                let id = if volume.key.is_empty() {
                    id_of(series)
                } else {
                    format!("{} {}", id_of(series), volume.key)
                };
                let mut file = file(series.folder.clone(), Role::Image, id, &volume.key);
                file.frame = (several && frame > 0).then_some(frame);
                let [columns, rows, slices] = volume.dims;
                file.reason = format!("DICOM image, {columns} × {rows} × {slices}");
                match &volume.problem {
                    Some(problem) => faulty(file, problem),
                    None if volume.is_localizer => unneeded(file, "a localizer"),
                    None if slices < MIN_SLICES => unneeded(file, "fewer than 3 slices"),
                    // Of many time points or echoes the first is proposed.
                    None if frame > 0 && !volume.key.is_empty() => {
                        unneeded(file, "another of the series' volumes")
                    }
                    None => file,
                }
            });
            each.collect()
        }
    }
}

/// `MR T1 post`: modality and description.
fn id_of(series: &SeriesSummary) -> String {
    let label = series.label();
    let id: String = label.chars().filter(|c| !c.is_control()).collect();
    let id = id.trim();
    if id.is_empty() { format!("series {}", series.number) } else { id.to_owned() }
}

/// Makes the ids of images, and of masks, differ within each date.
fn unique_ids(files: &mut [ProposedFile]) {
    let mut seen: BTreeSet<(bool, String, String)> = BTreeSet::new();
    let mut unique = |is_mask: bool, time: &str, id: &mut String| {
        let key = |id: &str| (is_mask, time.to_owned(), id.to_owned());
        *id = names::unique(id, |id| seen.contains(&key(id)));
        seen.insert(key(id));
    };
    for file in files.iter_mut().filter(|file| file.role != Role::LeftOut) {
        let time = file.time.clone();
        match file.role {
            Role::Mask => file.masks.iter_mut().for_each(|mask| unique(true, &time, &mut mask.id)),
            _ => unique(false, &time, &mut file.id),
        }
    }
}

/// Files that can't be read.
fn unreadable(studies: &Studies) -> Vec<Check> {
    let mut checks = Vec::new();
    if !studies.unreadable.is_empty() {
        let errors: Vec<String> = studies.unreadable.iter().map(ToString::to_string).collect();
        checks.push(Check::warning("left-out", format!("{}; left out", listed(&errors, 3))));
    }
    checks
}
