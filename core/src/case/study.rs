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
    dates::dicom_date,
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
    progress: &Progress,
) -> Result<Proposal, CaseError> {
    progress.say("Reading headers");
    let mut studies = dicom::studies(folder, progress)?;
    if let Some(uid) = only {
        keep_series(&mut studies, uid);
    }
    of_studies(folder, name, &studies)
}

/// Removes all series but one.
fn keep_series(studies: &mut Studies, uid: &str) {
    for study in studies.patients.iter_mut().flat_map(|patient| &mut patient.studies) {
        study.series.retain(|series| series.uid == uid);
    }
    studies.patients.retain(|patient| patient.studies.iter().any(|study| !study.series.is_empty()));
}

fn of_studies(folder: &Path, name: String, studies: &Studies) -> Result<Proposal, CaseError> {
    let Some(chosen) = best(studies) else {
        let unreadable = studies.unreadable.first().map(ToString::to_string);
        let of_series = all_series(studies).find_map(|series| series.problem.clone());
        let found = unreadable.or(of_series).unwrap_or_else(|| "nothing that can be shown".into());
        return Err(CaseError::wrong(
            printable(&folder.display().to_string()),
            found,
            "an image or a mask in DICOM",
        ));
    };
    let mut notes = Vec::new();
    let mut doubt = None;
    // A report of nobody beside the images, which this program writes too, is no second patient.
    let patients: Vec<&PatientStudies> =
        studies.patients.iter().filter(|patient| !has_reports_alone(patient)).collect();
    let several = patients.len() > 1;
    if several {
        let names: Vec<String> = patients.iter().map(|p| p.patient.label()).collect();
        doubt = Some(format!("files of {} patients ({})", names.len(), listed(&names, 3)));
    } else if is_dummy(&chosen.patient.id) && is_dummy(&chosen.patient.name) {
        notes.push(Check::warning(
            "dicom-nobody",
            "patient: found no identifier in the files; that all are one patient's can't be told",
        ));
    }
    let dated = dates(chosen, &mut notes);
    let mut files: Vec<ProposedFile> = Vec::new();
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
    for other in patients.into_iter().filter(|other| other.patient != chosen.patient) {
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
    notes.extend(unreadable(studies));
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
    studies
        .patients
        .iter()
        .filter(|patient| content(patient) != (0, 0))
        .max_by_key(|patient| content(patient))
}

/// Whether all that a patient has are documents without a name: structured reports and encapsulated ones.
fn has_reports_alone(patient: &PatientStudies) -> bool {
    let mut series = patient.studies.iter().flat_map(|study| &study.series).peekable();
    let is_nobody = patient.patient.id.is_empty() && patient.patient.name.is_empty();
    is_nobody
        && series.peek().is_some()
        && series.all(|series| matches!(series.modality.as_str(), "SR" | "DOC"))
}

/// The masks of a patient, and the slices that can be shown.
fn content(patient: &PatientStudies) -> (usize, usize) {
    let series = || patient.studies.iter().flat_map(|study| &study.series);
    let masks: usize = series().map(|s| s.segments.len()).sum();
    let slices: usize =
        series().flat_map(|s| &s.volumes).filter(|v| v.problem.is_none()).map(|v| v.dims[2]).sum();
    (masks, slices)
}

/// The series of a patient with their dates: one for all series of a study, and none where there is one date.
fn dates<'a>(patient: &'a PatientStudies, notes: &mut Vec<Check>) -> Vec<Dated<'a>> {
    let mut all = Vec::new();
    let mut by_frame: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (n, study) in patient.studies.iter().enumerate() {
        let first =
            study.series.iter().map(|s| s.date.as_str()).filter(|d| !d.is_empty()).min().unwrap_or_default();
        let date = if study.date.is_empty() { first } else { &study.date };
        let time = dicom_date(date)
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
                let own = dicom_date(&series.date).unwrap_or_else(|| series.date.clone());
                notes.push(Check::warning(
                    "dicom-dates",
                    format!("{}: acquired on {own}, in a study of {time}", series.label()),
                ));
            }
            let description = printable(&study.description);
            let title =
                [dicom_date(&study.date).unwrap_or_default(), description].join(" ").trim().to_owned();
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
        file.frame_of_reference.clone_from(&series.frame_of_reference);
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
    let id = label.trim();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{
        Segment,
        dicom::{Patient, StudySummary},
    };

    fn volume(slices: usize, key: &str) -> VolumeSummary {
        VolumeSummary {
            dims: [4, 5, slices],
            spacing_mm: [1.0; 3],
            key: key.into(),
            is_localizer: false,
            problem: None,
        }
    }

    fn series(uid: &str, date: &str, volumes: Vec<VolumeSummary>) -> SeriesSummary {
        SeriesSummary {
            uid: uid.into(),
            number: String::new(),
            description: "T1".into(),
            modality: "MR".into(),
            date: date.into(),
            kind: Kind::Image,
            files: 1,
            bytes: 1,
            frame_of_reference: String::new(),
            folder: "/case/images".into(),
            first_file: "/case/images/1".into(),
            volumes,
            segments: Vec::new(),
            problem: None,
            checks: Vec::new(),
        }
    }

    fn masks(uid: &str, frame_of_reference: &str, names: &[&str]) -> SeriesSummary {
        let segment = |(number, name): (i64, &&str)| Segment {
            number,
            name: (*name).to_owned(),
            color: None,
            frame: 0,
            label: None,
        };
        SeriesSummary {
            kind: Kind::Segmentation,
            frame_of_reference: frame_of_reference.into(),
            segments: (1..).zip(names).map(segment).collect(),
            ..series(uid, "", Vec::new())
        }
    }

    fn patient(id: &str, studies: Vec<(&str, Vec<SeriesSummary>)>) -> PatientStudies {
        let of = |(date, series): (&str, Vec<SeriesSummary>)| StudySummary {
            uid: date.into(),
            description: String::new(),
            date: date.into(),
            series,
        };
        let patient = Patient { id: id.into(), ..Patient::default() };
        PatientStudies { patient, studies: studies.into_iter().map(of).collect() }
    }

    fn proposal(patients: Vec<PatientStudies>) -> Result<Proposal, CaseError> {
        of_studies(Path::new("/case"), "case".into(), &Studies { patients, ..Studies::default() })
    }

    fn codes(proposal: &Proposal) -> Vec<&str> {
        proposal.notes.iter().map(|note| note.code).collect()
    }

    /// Role, id and time of each file.
    fn roles(proposal: &Proposal) -> Vec<(Role, &str, &str)> {
        proposal.files.iter().map(|file| (file.role, file.id.as_str(), file.time.as_str())).collect()
    }

    #[test]
    fn the_patient_with_masks_is_proposed_then_the_one_with_most_slices() {
        let image = |slices| series("1", "", vec![volume(slices, "")]);
        let broken = VolumeSummary { problem: Some("torn".into()), ..volume(500, "") };
        let all = || {
            vec![
                patient("A", vec![("20240101", vec![image(200), image(20)])]),
                patient("B", vec![("20240101", vec![image(210), series("2", "", vec![broken.clone()])])]),
                patient("C", vec![("20240101", vec![image(3), masks("3", "", &["tumour"])])]),
            ]
        };
        let chosen = |patients: Vec<PatientStudies>| -> Vec<String> {
            let proposal = proposal(patients).unwrap();
            assert_eq!(proposal.doubt.as_deref(), Some("files of 3 patients (A, B, C)"));
            assert!(proposal.files.iter().all(|file| file.study == "2024-01-01"));
            assert_eq!(proposal.patients().len(), 3);
            let shown = proposal.files.iter().filter(|file| file.role != Role::LeftOut);
            shown.map(|file| file.patient.clone()).collect()
        };
        assert_eq!(chosen(all()), ["C", "C"]);
        let mut without_masks = all();
        without_masks[2].studies[0].series.pop();
        assert_eq!(chosen(without_masks), ["A", "A"]);
    }

    #[test]
    fn a_report_of_nobody_is_no_second_patient() {
        let image = patient("A", vec![("20240101", vec![series("1", "", vec![volume(9, "")])])]);
        let problem = Some("no pixels".to_owned());
        let of = |modality: &str| SeriesSummary {
            problem: problem.clone(),
            modality: modality.into(),
            ..series("2", "", Vec::new())
        };
        let beside = |name: &str, modality: &str| {
            proposal(vec![patient(name, vec![("", vec![of(modality)])]), image.clone()]).unwrap()
        };
        for modality in ["SR", "DOC"] {
            let found = beside("", modality);
            assert_eq!((found.doubt.as_deref(), found.patients().len()), (None, 0), "nobody else to choose");
        }
        // What is somebody's, and images that can't be shown, are another patient's.
        for (name, modality) in [("B", "SR"), ("", "CT"), ("B", "CT")] {
            assert!(beside(name, modality).doubt.is_some(), "{name} {modality}");
        }
    }

    #[test]
    fn what_can_not_be_shown_says_why() {
        let why = |patients| proposal(patients).unwrap_err().to_string();
        assert!(why(vec![patient("A", vec![])]).contains("found nothing that can be shown"));
        let problem = Some("no pixels".to_owned());
        let report = SeriesSummary { problem, ..series("1", "", Vec::new()) };
        assert!(why(vec![patient("A", vec![("", vec![report])])]).contains("found no pixels"));
        let mut two = Studies {
            patients: vec![
                patient("A", vec![("", vec![series("1", "", vec![]), series("2", "", vec![])])]),
                patient("B", vec![("", vec![series("3", "", vec![])])]),
            ],
            ..Studies::default()
        };
        keep_series(&mut two, "2");
        assert_eq!(all_series(&two).map(|s| s.uid.as_str()).collect::<Vec<_>>(), ["2"]);
        assert_eq!(two.patients.len(), 1);
    }

    #[test]
    fn times_are_the_dates_of_studies_and_masks_have_that_of_their_image() {
        let image = |date: &str, frame: &str| SeriesSummary {
            frame_of_reference: frame.into(),
            ..series("1", date, vec![volume(9, "")])
        };
        let one = proposal(vec![patient("A", vec![("20240101", vec![image("20240101", "f")])])]).unwrap();
        assert_eq!((roles(&one), codes(&one)), (vec![(Role::Image, "MR T1", "")], vec![]));
        assert_eq!(one.patients(), [""; 0], "there is nobody else to choose");
        let studies = vec![
            ("20240101", vec![image("20240101", "f")]),
            ("", vec![image("20240303", "g"), image("20240302", "g")]),
            ("", vec![image("", "h")]),
            ("2024030x", vec![masks("m", "f", &["a"]), masks("n", "g", &["a"]), masks("o", "?", &["a"])]),
        ];
        let all = proposal(vec![patient("A", studies)]).unwrap();
        let times: Vec<&str> = all.files.iter().map(|file| file.time.as_str()).collect();
        let second = "2024-03-02";
        assert_eq!(times, ["2024-01-01", second, second, "undated 3", "2024-01-01", second, "2024030x"]);
        assert_eq!(codes(&all), ["dicom-dates", "guessed-times"]);
        assert!(all.notes[0].message.ends_with("acquired on 2024-03-03, in a study of 2024-03-02"));
        // Two studies in one frame of reference: the masks' own study counts.
        let studies = vec![
            ("20240101", vec![image("", "f")]),
            ("20240202", vec![image("", "f")]),
            ("20240303", vec![masks("m", "f", &["a"])]),
        ];
        assert_eq!(proposal(vec![patient("A", studies)]).unwrap().files[2].time, "2024-03-03");
    }

    #[test]
    fn series_without_a_volume_to_show_are_left_out_with_the_reason() {
        let of = |series: SeriesSummary| -> Vec<(Role, LeftOutFor, String)> {
            let files = proposed(Path::new("/case"), &series, "");
            files.into_iter().map(|file| (file.role, file.left_out_for, file.reason)).collect()
        };
        let unneeded = |reason: &str| (Role::LeftOut, LeftOutFor::Unneeded, reason.to_owned());
        let fault = |reason: &str| (Role::LeftOut, LeftOutFor::Fault, reason.to_owned());
        let shown = |reason: &str| (Role::Image, LeftOutFor::Choice, reason.to_owned());
        let scout = |slices| VolumeSummary { is_localizer: true, ..volume(slices, "") };
        let torn = VolumeSummary { problem: Some("torn".into()), ..volume(9, "") };
        let images = |volumes| of(series("1", "", volumes));
        assert_eq!(images(vec![volume(3, "")]), [shown("DICOM image, 4 × 5 × 3")]);
        assert_eq!(images(vec![volume(1, "")]), [unneeded("one slice")]);
        assert_eq!(images(vec![volume(2, "")]), [unneeded("1 volumes of fewer than 3 slices")]);
        assert_eq!(
            images(vec![volume(1, ""), volume(2, "")]),
            [unneeded("2 volumes of fewer than 3 slices")]
        );
        assert_eq!(images(vec![scout(2)]), [unneeded("a localizer")]);
        assert_eq!(images(vec![scout(9), torn]), [unneeded("a localizer"), fault("torn")]);
        assert_eq!(
            images(vec![volume(9, "echo 1"), volume(9, "echo 2"), volume(9, ""), volume(2, "")]),
            [
                shown("DICOM image, 4 × 5 × 9"),
                unneeded("another of the series' volumes"),
                shown("DICOM image, 4 × 5 × 9"),
                unneeded("fewer than 3 slices"),
            ]
        );
        assert_eq!(of(masks("1", "", &[])), [unneeded("no segment with closed contours")]);
        for (kind, expected) in [
            (Kind::Image, fault("torn")),
            (Kind::StructureSet, fault("torn")),
            (Kind::Directory, unneeded("torn")),
            (Kind::Other, unneeded("torn")),
        ] {
            let problem = Some("torn".to_owned());
            assert_eq!(
                of(SeriesSummary { problem, kind, ..series("1", "", vec![volume(9, "")]) }),
                [expected]
            );
        }
    }

    #[test]
    fn volumes_of_a_series_are_its_frames_and_named_by_what_tells_them_apart() {
        let several = SeriesSummary {
            number: "7".into(),
            ..series("1.2", "", vec![volume(9, ""), volume(9, "echo 2")])
        };
        let files = proposed(Path::new("/case"), &several, "");
        let found: Vec<_> = files.iter().map(|f| (f.frame, f.id.as_str(), f.title.as_str())).collect();
        assert_eq!(found, [(None, "MR T1", "7: MR T1"), (Some(1), "MR T1 echo 2", "7: MR T1 (echo 2)")]);
        let nameless = SeriesSummary { modality: String::new(), description: " ".into(), ..several };
        assert_eq!(proposed(Path::new("/case"), &nameless, "")[0].id, "series 7");
    }

    #[test]
    fn ids_differ_within_a_date_and_kind() {
        let image = || series("1", "", vec![volume(9, "")]);
        let of_date = || vec![image(), image(), masks("m", "", &["MR T1"])];
        let all = patient("0", vec![("20240101", of_date()), ("20240202", of_date())]);
        let all = proposal(vec![all]).unwrap();
        let (first, second) = ("2024-01-01", "2024-02-02");
        let expected = [
            (Role::Image, "MR T1", first),
            (Role::Image, "MR T1 2", first),
            (Role::Mask, "MR T1", first),
            (Role::Image, "MR T1", second),
            (Role::Image, "MR T1 2", second),
            (Role::Mask, "MR T1", second),
        ];
        assert_eq!(roles(&all), expected);
        assert!(all.files.iter().all(|file| file.masks[0].id != "MR T1 2"));
        // Nobody is named, so that nothing says whose the files are.
        assert_eq!(codes(&all), ["dicom-nobody", "guessed-times"]);
    }
}
