//! Whose the files of a case are, and whether they claim one space, as far as the files say so.

use std::collections::BTreeMap;

use super::{CaseError, Patient, Study, names::at_time};
use crate::{Check, check::listed, files::Origin};

/// An image or mask with what its file says.
pub(super) struct Stated {
    pub id: String,
    pub time: String,
    pub origin: Origin,
}

/// The patient that the files state, each fact from the first file that has it.
pub(super) fn patient(all: &[Stated]) -> Patient {
    let first = |fact: fn(&Origin) -> &String| {
        all.iter().map(|s| fact(&s.origin)).find(|text| !text.is_empty()).cloned().unwrap_or_default()
    };
    Patient {
        name: first(|o| &o.patient_name),
        id: first(|o| &o.patient_id),
        birth_date: first(|o| &o.birth_date),
        sex: first(|o| &o.sex),
        studies: studies(all),
    }
}

/// Each study once, with what its files say of it.
fn studies(all: &[Stated]) -> Vec<Study> {
    let mut found: Vec<Study> = Vec::new();
    for Stated { time, origin, .. } in all {
        let study = Study {
            time: time.clone(),
            description: origin.study_description.clone(),
            accession_number: origin.accession_number.clone(),
        };
        let is_named = !study.description.is_empty() || !study.accession_number.is_empty();
        if is_named && !found.contains(&study) {
            found.push(study);
        }
    }
    found
}

/// Refuses files of several patients, and says which of them don't claim one space. `is_one_patient`: the user has said so.
/// `is_one_space`: and that they lie in one space.
pub(super) fn check(
    case: &str,
    all: &[Stated],
    is_one_patient: bool,
    is_one_space: bool,
) -> Result<Vec<Check>, CaseError> {
    let name = |s: &Stated| at_time(&s.id, &s.time);
    // Every pair: a file that names nobody agrees with all others.
    let strangers = all.iter().enumerate().find_map(|(n, one)| {
        let other = all[n + 1..].iter().find(|other| one.origin.is_other_patient(&other.origin))?;
        Some((one, other))
    });
    if let Some((one, other)) = strangers.filter(|_| !is_one_patient) {
        let (a, b) = (&one.origin.patient, &other.origin.patient);
        let found = format!("files of two patients: {} ({a}) and {} ({b})", name(one), name(other));
        return Err(CaseError::wrong(case, found, "one patient (or one_patient = true in a manifest)"));
    }
    let mut frames: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for stated in all.iter().filter(|s| !s.origin.frame_of_reference.is_empty()) {
        frames.entry(&stated.origin.frame_of_reference).or_default().push(name(stated));
    }
    if frames.len() < 2 {
        return Ok(Vec::new());
    }
    let groups: Vec<String> = frames.values().map(|names| listed(names, 3)).collect();
    let found = format!("found {} frames of reference ({})", frames.len(), groups.join("; "));
    Ok(vec![if is_one_space {
        Check::note("frames-of-reference", format!("{found}: compared as they lie, as the case says"))
    } else {
        let text = format!("{found}: nothing says that they are aligned, and they are compared as they lie");
        Check::warning("frames-of-reference", text)
    }])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Severity;

    fn stated(id: &str, patient_id: &str, frame_of_reference: &str) -> Stated {
        let origin = Origin {
            patient_id: patient_id.into(),
            frame_of_reference: frame_of_reference.into(),
            ..Origin::default()
        };
        Stated { id: id.into(), time: String::new(), origin }
    }

    #[test]
    fn each_study_is_named_once_and_a_file_that_names_none_adds_none() {
        let of = |time: &str, accession_number: &str| {
            let origin = Origin {
                accession_number: accession_number.into(),
                study_description: if accession_number.is_empty() { String::new() } else { "MR head".into() },
                sex: "F".into(),
                ..Origin::default()
            };
            Stated { id: "a".into(), time: time.into(), origin }
        };
        let found = patient(&[
            of("2024-01-01", ""),
            of("2024-01-01", "1"),
            of("2024-01-01", "1"),
            of("2024-03-01", "2"),
        ]);
        let named: Vec<_> =
            found.studies.iter().map(|s| (s.time.as_str(), s.accession_number.as_str())).collect();
        assert_eq!(named, [("2024-01-01", "1"), ("2024-03-01", "2")]);
        assert_eq!(found.sex, "F");
    }

    #[test]
    fn a_file_of_nobody_hides_no_two_patients() {
        let all = [stated("a", "", ""), stated("b", "1", ""), stated("c", "2", "")];
        let error = check("case", &all, false, false).unwrap_err().to_string();
        assert!(error.contains("two patients: b () and c ()"), "{error}");
        assert_eq!(check("case", &all, true, false), Ok(Vec::new()));
        assert_eq!(check("case", &all[..2], false, false), Ok(Vec::new()));
    }

    #[test]
    fn frames_of_reference_that_differ_are_said() {
        let all = [stated("a", "1", "x"), stated("b", "1", "x"), stated("c", "1", "")];
        assert_eq!(check("case", &all, false, false), Ok(Vec::new()));
        let all = [stated("a", "1", "x"), stated("b", "1", "y")];
        assert_eq!(check("case", &all, false, false).unwrap()[0].code, "frames-of-reference");
        let stated = check("case", &all, false, true).unwrap();
        assert_eq!((stated[0].code, stated[0].severity), ("frames-of-reference", Severity::Note));
    }
}
