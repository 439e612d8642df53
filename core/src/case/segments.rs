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

#[cfg(test)]
mod tests {
    use super::super::MaskSpec;
    use super::*;

    /// What a mask of a file with these segments, in `layers` layers, is read from: the number of its segment, `None` for
    /// the whole file.
    fn resolved(layers: usize, segments: &str, labels: Option<&[i64]>) -> Result<Option<i64>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.seg.nrrd");
        let text = format!(
            "NRRD0004\ntype: uchar\ndimension: 4\nspace: left-posterior-superior\nsizes: {layers} 2 2 2\n\
             kinds: list domain domain domain\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n\
             encoding: raw\n{segments}\n\n"
        );
        let bytes = [text.into_bytes(), vec![1; 8 * layers]].concat();
        files::write_whole(&path, &bytes).unwrap();
        let mask = MaskSpec {
            id: "A".into(),
            source: Source::File(path),
            labels: labels.map(<[i64]>::to_vec),
            above: None,
            time: None,
            color: None,
            name: None,
        };
        let spec = CaseSpec { masks: vec![mask.clone()], ..CaseSpec::default() };
        let found = resolve(&spec, &Progress::new()).map_err(|e| e.to_string())?.masks.remove(0);
        match &found.source {
            Source::Part(Part { which: Which::Segment(number), .. }) => {
                assert_eq!(found.labels, None);
                Ok(Some(*number))
            }
            _ => {
                assert_eq!(found, mask);
                Ok(None)
            }
        }
    }

    #[test]
    fn the_segment_that_is_named_is_meant_the_only_one_or_all_labels_of_a_map() {
        let (none, one) = ("note:=none", "Segment4_ID:=a\nSegment4_Layer:=0");
        let map = "Segment0_ID:=a\nSegment0_LabelValue:=3\nSegment1_ID:=b\nSegment1_LabelValue:=5";
        let layers = "Segment0_ID:=a\nSegment1_ID:=b";
        let labels_of_layers =
            "Segment0_LabelValue:=3\nSegment0_Layer:=0\nSegment1_LabelValue:=3\nSegment1_Layer:=1";
        assert_eq!((resolved(1, none, None), resolved(1, none, Some(&[1, 4]))), (Ok(None), Ok(None)));
        assert_eq!((resolved(1, one, None), resolved(1, one, Some(&[4]))), (Ok(Some(4)), Ok(Some(4))));
        assert_eq!((resolved(1, map, None), resolved(1, map, Some(&[1]))), (Ok(None), Ok(Some(1))));
        for (count, text, labels) in [
            (1, map, Some(&[0, 1][..])),
            (2, layers, None),
            (2, layers, Some(&[0, 1])),
            (2, labels_of_layers, None),
        ] {
            let error = resolved(count, text, labels).unwrap_err();
            assert!(error.contains("found 2 segments (0, 1), expected one of them"), "{text}: {error}");
        }
    }
}
