//! Files that name their segments, given as `FILE` or `FILE:2`: which segment is meant.

use super::{CaseError, CaseSpec};
use crate::{
    Progress,
    check::listed,
    files::{self, Part, Source, Which},
};

/// The case with segments in place of labels, where a mask's file names its segments.
///
/// # Errors
/// [`CaseError`] where a file has several segments and none is named, or several are.
pub(super) fn resolve(spec: &CaseSpec, progress: &Progress) -> Result<CaseSpec, CaseError> {
    let mut spec = spec.clone();
    for mask in &mut spec.masks {
        let Source::File(path) = &mask.source else { continue };
        // What can't be read says so when it is read.
        let Ok(segments) = files::segments(&mask.source, progress) else { continue };
        if segments.is_empty() {
            continue;
        }
        let numbers: Vec<String> = segments.iter().map(|s| s.number.to_string()).collect();
        let one = match mask.labels.as_deref() {
            Some([number]) => Some(*number),
            Some(_) => None,
            // All labels of one map together are a mask.
            None if segments.iter().all(|s| s.label.is_some() && s.frame == segments[0].frame) => continue,
            None => (segments.len() == 1).then(|| segments[0].number),
        };
        let Some(number) = one else {
            let found = format!("{} segments ({})", segments.len(), listed(&numbers, 8));
            return Err(CaseError::wrong(mask.source.name(), found, "one of them (FILE:NUMBER)"));
        };
        mask.labels = None;
        mask.source = Source::Part(Part { path: path.clone(), series: None, which: Which::Segment(number) });
    }
    Ok(spec)
}
