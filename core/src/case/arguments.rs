//! `--mask ID=FILE[:1,4|:>0.3|:brats-2021][@TIME]` and `--context ID=FILE[@TIME]`: a case on the command line.

use std::path::{Path, PathBuf};

use super::{CaseError, CaseSpec, ContextSpec, MaskSpec, Scheme};
use crate::files::Source;

/// One interpretation of an argument.
#[derive(Debug, PartialEq)]
struct Interpretation<'a> {
    id: &'a str,
    file: &'a str,
    active: Option<Active>,
    /// The word of a label scheme.
    scheme: Option<&'a str>,
    time: Option<&'a str>,
}

/// Which voxels of a file are active.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Active {
    /// Those with these labels.
    Labels(Vec<i64>),
    /// Those above this value.
    Above(f64),
}

impl Active {
    /// As a mask's labels and its threshold.
    pub(super) fn parts(self) -> (Option<Vec<i64>>, Option<f64>) {
        match self {
            Self::Labels(labels) => (Some(labels), None),
            Self::Above(above) => (None, Some(above)),
        }
    }
}

/// Parses labels such as `1,4`, or a threshold such as `>0.3`; `None` for anything else.
pub(super) fn active(text: &str) -> Option<Active> {
    if let Some(above) = text.trim().strip_prefix('>') {
        return above.trim().parse().ok().filter(|above: &f64| above.is_finite()).map(Active::Above);
    }
    text.split(',').map(|n| n.trim().parse().ok()).collect::<Option<_>>().map(Active::Labels)
}

/// Splits `FILE:1,4` into file and labels, `FILE:brats-2021` into file and scheme; neither where none follow the last colon.
fn split_labels(text: &str) -> (&str, Option<Active>, Option<&str>) {
    match text.rsplit_once(':').filter(|(file, _)| !file.is_empty()) {
        Some((file, word)) if Scheme::of_word(word).is_some() => (file, None, Some(word)),
        Some((file, list)) => match active(list) {
            Some(active) => (file, Some(active), None),
            None => (text, None, None),
        },
        None => (text, None, None),
    }
}

/// Splits an argument, see [`CaseSpec::from_arguments`]. `exists` states whether a file exists.
fn interpret_argument<'a>(
    text: &'a str,
    with_labels: bool,
    exists: &dyn Fn(&str) -> bool,
) -> Option<Interpretation<'a>> {
    let (id, rest) = text.split_once('=').map(|(id, rest)| (id.trim(), rest))?;
    let interpret = |file: &'a str, time: Option<&'a str>| {
        let (file, active, scheme) = if with_labels { split_labels(file) } else { (file, None, None) };
        Interpretation { id, file, active, scheme, time }
    };
    let entire_rest = Interpretation { id, file: rest, active: None, scheme: None, time: None };
    let mut interpretations = vec![entire_rest, interpret(rest, None)];
    for (at, _) in rest.rmatch_indices('@') {
        let (before, time) = (&rest[..at], rest[at + 1..].trim());
        if !time.is_empty() {
            interpretations.push(Interpretation {
                id,
                file: before,
                active: None,
                scheme: None,
                time: Some(time),
            });
            interpretations.push(interpret(before, Some(time)));
        }
    }
    if let Some(found) = interpretations.iter().position(|r| exists(r.file)) {
        return Some(interpretations.swap_remove(found));
    }
    match rest.rsplit_once('@') {
        Some((before, time)) if !time.trim().is_empty() && !time.contains(['/', '\\']) => {
            Some(interpret(before, Some(time.trim())))
        }
        _ => Some(interpret(rest, None)),
    }
}

fn parse<'a>(
    flag: &str,
    form: &str,
    text: &'a str,
    with_labels: bool,
) -> Result<Interpretation<'a>, CaseError> {
    let parts = interpret_argument(text, with_labels, &|file| Path::new(file).exists());
    // Not a file of that name: labels that are no numbers.
    if let Some(parts) = parts.as_ref().filter(|parts| with_labels && !Path::new(parts.file).exists())
        && let Some((file, list)) = parts.file.rsplit_once(':')
        && Path::new(file).is_file()
    {
        return Err(CaseError::wrong(
            flag,
            format!("labels {list:?} of {file}"),
            format!(
                "whole numbers, such as 1,4, a threshold, such as >0.3, or a scheme ({})",
                Scheme::words()
            ),
        ));
    }
    match parts {
        Some(parts) if !parts.id.is_empty() && !parts.file.is_empty() => Ok(parts),
        _ => Err(CaseError::wrong(flag, format!("{text:?}"), form)),
    }
}

/// The value of `--mask` (`is_mask`) or `--context` with another file: `change` of the one that it names. Files are
/// relative to `folder`. `None` for a malformed value.
pub fn argument_with_file(
    text: &str,
    is_mask: bool,
    folder: &Path,
    change: &dyn Fn(&Path) -> PathBuf,
) -> Option<String> {
    let found = interpret_argument(text, is_mask, &|file| folder.join(file).exists())?;
    let (id, rest) = text.split_once('=')?;
    let end = rest.get(found.file.len()..)?;
    Some(format!("{id}={}{end}", change(Path::new(found.file)).to_str()?))
}

/// See [`CaseSpec::from_arguments`].
pub(super) fn parse_all(masks: &[String], contexts: &[String]) -> Result<CaseSpec, CaseError> {
    let mut spec = CaseSpec { name: "command line".into(), ..CaseSpec::default() };
    for text in contexts {
        let p = parse("--context", "ID=FILE[@TIME]", text, false)?;
        spec.contexts.push(ContextSpec {
            id: p.id.into(),
            source: Source::File(p.file.into()),
            time: p.time.map(str::to_owned),
        });
    }
    for text in masks {
        let p = parse("--mask", "ID=FILE[:LABEL,LABEL…|:>VALUE|:SCHEME][@TIME]", text, true)?;
        if let Some(scheme) = p.scheme {
            let scheme = Scheme::named(scheme, Path::new(""))?;
            spec.masks.extend(scheme.masks(p.id, &Source::File(p.file.into()), p.time));
            continue;
        }
        let (labels, above) = p.active.map(Active::parts).unwrap_or_default();
        spec.masks.push(MaskSpec {
            id: p.id.into(),
            source: Source::File(p.file.into()),
            labels,
            above,
            time: p.time.map(str::to_owned),
            color: None,
            name: None,
        });
    }
    Ok(spec)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts<'a>(
        id: &'a str,
        file: &'a str,
        labels: Option<&[i64]>,
        time: Option<&'a str>,
    ) -> Interpretation<'a> {
        Interpretation {
            id,
            file,
            active: labels.map(|labels| Active::Labels(labels.to_vec())),
            scheme: None,
            time,
        }
    }

    #[test]
    fn arguments_are_split_when_no_file_exists() {
        let none = |_: &str| false;
        let mask = |text| interpret_argument(text, true, &none).unwrap();
        assert_eq!(mask("T1=a.nii"), parts("T1", "a.nii", None, None));
        assert_eq!(mask("T1=a.nii:1,4"), parts("T1", "a.nii", Some(&[1, 4]), None));
        assert_eq!(mask("T1=a.nii:-1@2024-01-15"), parts("T1", "a.nii", Some(&[-1]), Some("2024-01-15")));
        assert_eq!(mask("T1=a.nii@week 3"), parts("T1", "a.nii", None, Some("week 3")));
        assert_eq!(mask(r"T1=C:\b\a.nii:2"), parts("T1", r"C:\b\a.nii", Some(&[2]), None));
        assert_eq!(mask(r"T1=C:\b\a.nii"), parts("T1", r"C:\b\a.nii", None, None));
        assert_eq!(mask("T1=me@home/a.nii"), parts("T1", "me@home/a.nii", None, None));
        assert_eq!(mask("T1=a=b.nii"), parts("T1", "a=b.nii", None, None));
        assert_eq!(mask("T1=a.nii:1,x"), parts("T1", "a.nii:1,x", None, None));
        assert_eq!(
            interpret_argument("CT=a.nii:1", false, &none).unwrap(),
            parts("CT", "a.nii:1", None, None)
        );
        assert_eq!(interpret_argument("a.nii", true, &none), None);
    }

    #[test]
    fn the_longest_existing_file_name_wins() {
        let with = |file: &'static str| move |f: &str| f == file;
        let text = "T1=a@b:1@2024";
        assert_eq!(
            interpret_argument(text, true, &with("a@b:1@2024")).unwrap(),
            parts("T1", "a@b:1@2024", None, None)
        );
        assert_eq!(
            interpret_argument(text, true, &with("a@b:1")).unwrap(),
            parts("T1", "a@b:1", None, Some("2024"))
        );
        assert_eq!(
            interpret_argument(text, true, &with("a@b")).unwrap(),
            parts("T1", "a@b", Some(&[1]), Some("2024"))
        );
        assert_eq!(
            interpret_argument(text, true, &with("a")).unwrap(),
            parts("T1", "a", None, Some("b:1@2024"))
        );
        assert_eq!(interpret_argument("T1=s:3", true, &with("s:3")).unwrap(), parts("T1", "s:3", None, None));
    }

    #[test]
    fn the_file_of_an_argument_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        crate::files::write_whole(&folder.path().join("a@b.nii"), b"").unwrap();
        let moved =
            |text: &str| argument_with_file(text, true, folder.path(), &|file| Path::new("/x").join(file));
        assert_eq!(moved("T1=a@b.nii:1,4@2024").as_deref(), Some("T1=/x/a@b.nii:1,4@2024"));
        assert_eq!(moved("T1=c.nii@2024").as_deref(), Some("T1=/x/c.nii@2024"));
        assert_eq!(moved("c.nii"), None);
    }

    #[test]
    fn errors_name_the_flag() {
        for bad in ["a.nii", "=a.nii", "T1="] {
            let error = parse_all(&[bad.into()], &[]).unwrap_err().to_string();
            assert!(error.starts_with("--mask: found ") && error.contains("expected ID=FILE"), "{error}");
        }
    }
}
