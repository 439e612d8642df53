//! Findings about the files of a case: those that say the same of several files are one.

use super::names::at_time;
use crate::{Check, check::listed, files::Source};

/// Ids listed in one finding at most; the others are counted.
const MAX_LISTED: usize = 12;

/// A finding about one file.
pub(super) struct Finding {
    /// Id of the first image, mask or tracts made from the file.
    pub id: String,
    /// Its time; empty where the case has one without a name.
    pub time: String,
    /// Its message doesn't begin with the id.
    pub check: Check,
    /// The file's name, with which the message may begin.
    pub file: String,
}

impl Finding {
    pub(super) fn new(id: &str, time: Option<&str>, source: &Source, check: Check) -> Self {
        let name = source.name();
        let file = name.rsplit(['/', '\\']).next().unwrap_or(&name).to_owned();
        Self { id: id.to_owned(), time: time.unwrap_or_default().to_owned(), check, file }
    }

    /// The message without the file's name.
    fn text(&self) -> &str {
        let message = self.check.message.as_str();
        message.strip_prefix(&self.file).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(message)
    }

    fn is_like(&self, other: &Self) -> bool {
        self.check.code == other.check.code
            && self.check.severity == other.check.severity
            && self.text() == other.text()
    }
}

/// The findings as checks, in the order of the first of each kind: `T1: t1.nii: no unit of length` about one file,
/// `T1, T2, PET (3 files): no unit of length` about several.
pub(super) fn together(findings: Vec<Finding>) -> Vec<Check> {
    let mut kinds: Vec<Vec<Finding>> = Vec::new();
    for finding in findings {
        match kinds.iter_mut().find(|kind| kind[0].is_like(&finding)) {
            Some(kind) => kind.push(finding),
            None => kinds.push(vec![finding]),
        }
    }
    let check = |kind: Vec<Finding>| {
        let first = &kind[0];
        let message = if kind.len() == 1 {
            format!("{}: {}", first.id, first.check.message)
        } else {
            let names: Vec<String> = kind.iter().map(|f| at_time(&f.id, &f.time)).collect();
            format!("{} ({} files): {}", listed(&names, MAX_LISTED), kind.len(), first.text())
        };
        Check { code: first.check.code, severity: first.check.severity, message }
    };
    kinds.into_iter().map(check).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Severity;

    fn finding(n: usize, text: &str) -> Finding {
        let (id, file) = (format!("m{n}"), format!("{n}.nii"));
        let check = Check::warning("first-frame-only", format!("{file}: {text}"));
        Finding::new(&id, None, &Source::File(format!("/in/{file}").into()), check)
    }

    #[test]
    fn what_is_said_of_several_files_is_said_once() {
        let messages = |findings: Vec<Finding>| -> Vec<String> {
            together(findings).into_iter().map(|check| check.message).collect()
        };
        assert_eq!(messages(vec![finding(0, "no unit")]), ["m0: 0.nii: no unit"]);
        let alike = [0, 1, 2].map(|n| finding(n, "no unit"));
        let found = messages(alike.into_iter().chain([finding(3, "unit code 5")]).collect());
        assert_eq!(found, ["m0, m1, m2 (3 files): no unit", "m3: 3.nii: unit code 5"]);
        for (code, severity) in [("first-frame-only", Severity::Note), ("units-unknown", Severity::Warning)] {
            let mut other = finding(1, "no unit");
            (other.check.code, other.check.severity) = (code, severity);
            assert_eq!(messages(vec![finding(0, "no unit"), other]).len(), 2, "{code} {severity:?}");
        }
        let many = messages((0..20).map(|n| finding(n, "no unit")).collect());
        assert_eq!(many.len(), 1);
        assert!(many[0].ends_with(", m11 and 8 more (20 files): no unit"), "{many:?}");
    }
}
