//! Whose the files of a case are, and whether they claim one space, as far as the files say so.

use std::collections::BTreeMap;

use super::{CaseError, native::at_time};
use crate::{Check, check::listed, files::Origin};

/// An image or mask with what its file says.
pub(super) struct Stated {
    pub id: String,
    pub time: String,
    pub origin: Origin,
}

/// Refuses files of several patients, and says which of them don't claim one space. `is_one_patient`: the user has said so.
pub(super) fn check(case: &str, all: &[Stated], is_one_patient: bool) -> Result<Vec<Check>, CaseError> {
    let differs = |a: &str, b: &str| !a.is_empty() && !b.is_empty() && a != b;
    let name = |s: &Stated| at_time(&s.id, &s.time);
    if let Some(first) = all.first().filter(|_| !is_one_patient) {
        let (of, birth) = (&first.origin.patient_id, &first.origin.birth_date);
        let is_other =
            |s: &&Stated| differs(&s.origin.patient_id, of) || differs(&s.origin.birth_date, birth);
        if let Some(other) = all.iter().find(is_other) {
            let found = format!(
                "files of two patients: {} ({}) and {} ({})",
                name(first),
                first.origin.patient,
                name(other),
                other.origin.patient
            );
            return Err(CaseError::wrong(case, found, "one patient (or one_patient = true in a manifest)"));
        }
    }
    let mut frames: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for stated in all.iter().filter(|s| !s.origin.frame_of_reference.is_empty()) {
        frames.entry(&stated.origin.frame_of_reference).or_default().push(name(stated));
    }
    if frames.len() < 2 {
        return Ok(Vec::new());
    }
    let groups: Vec<String> = frames.values().map(|names| listed(names, 3)).collect();
    Ok(vec![Check::warning(
        "frames-of-reference",
        format!(
            "found {} frames of reference ({}): nothing says that they are aligned, and they are compared as they lie",
            frames.len(),
            groups.join("; ")
        ),
    )])
}
