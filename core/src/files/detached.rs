//! Data files that a header names: one, a list, or a numbered pattern, all of them in the header's folder or below.

use std::path::{Component, Path, PathBuf};

use super::{FileError, opened, stored_file::Place, stored_voxels::MAX_FILES, text_header::quoted};

/// Widest number in a pattern.
const MAX_WIDTH: usize = 20;

/// What a header says of its data files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum DataFiles {
    /// The voxels follow the header.
    Attached,
    /// One file.
    One(String),
    /// A file for each number.
    Pattern(Pattern),
    /// The names.
    List(Vec<String>),
}

/// Numbered file names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pattern {
    prefix: String,
    suffix: String,
    width: usize,
    has_zeros: bool,
    first: i64,
    step: i64,
    count: u64,
}

impl Pattern {
    fn name(&self, nth: u64) -> String {
        let number = self.first.saturating_add(self.step.saturating_mul(nth as i64));
        let (prefix, suffix, width) = (&self.prefix, &self.suffix, self.width);
        if self.has_zeros {
            format!("{prefix}{number:0width$}{suffix}")
        } else {
            format!("{prefix}{number:width$}{suffix}")
        }
    }
}

/// What is expected of a pattern, for messages.
const PATTERN: &str =
    "a data file, or a pattern such as slice%03d.raw with its first and last number and the step";

/// Reads a header's words on its data files: `NAME`, `PATTERN FIRST LAST STEP [AXES]` or `LIST [AXES]`, where AXES is the
/// number of axes in each file. A list is returned empty: its names follow.
pub(super) fn described(words: &str) -> Result<(DataFiles, Option<u64>), (String, &'static str)> {
    let wrong = || (format!("data file {}", quoted(words)), PATTERN);
    let all: Vec<&str> = words.split_whitespace().collect();
    let axes = |word: Option<&&str>| match word {
        None => Ok(None),
        Some(word) => word.trim_end_matches(['D', 'd']).parse().map(Some).map_err(|_| wrong()),
    };
    match all.as_slice() {
        [] => Err(wrong()),
        ["LIST"] | ["LIST", _] => Ok((DataFiles::List(Vec::new()), axes(all.get(1))?)),
        [format, first, last, step] | [format, first, last, step, _] if format.contains('%') => {
            let number = |word: &str| word.parse::<i64>().map_err(|_| wrong());
            let (first, last, step) = (number(first)?, number(last)?, number(step)?);
            let steps = i128::from(last) - i128::from(first);
            let steps = steps.checked_div(i128::from(step)).filter(|&steps| steps >= 0).ok_or_else(wrong)?;
            let count = u64::try_from(steps).ok().and_then(|n| n.checked_add(1)).ok_or_else(wrong)?;
            let (prefix, suffix, width, has_zeros) = number_in(format).ok_or_else(wrong)?;
            let pattern = Pattern { prefix, suffix, width, has_zeros, first, step, count };
            Ok((DataFiles::Pattern(pattern), axes(all.get(4))?))
        }
        _ => Ok((DataFiles::One(words.trim().to_owned()), None)),
    }
}

/// Splits `prefix%03dsuffix` about its one number: prefix, suffix, width and whether zeros fill it.
fn number_in(format: &str) -> Option<(String, String, usize, bool)> {
    let (prefix, rest) = format.split_once('%')?;
    let (digits, suffix) = rest.split_once(['d', 'i', 'u'])?;
    if suffix.contains('%') || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let width = if digits.is_empty() { 0 } else { digits.parse().ok().filter(|&w| w <= MAX_WIDTH)? };
    Some((prefix.to_owned(), suffix.to_owned(), width, digits.starts_with('0')))
}

impl DataFiles {
    /// Number of files.
    pub(super) fn count(&self) -> u64 {
        match self {
            Self::Attached | Self::One(_) => 1,
            Self::Pattern(pattern) => pattern.count,
            Self::List(names) => names.len() as u64,
        }
    }

    /// The files, for voxels whose axes have `sizes`: as many as slices of `axes` dimensions, by default of one
    /// dimension less than the image.
    pub(super) fn places<'a>(
        &self,
        header: &Place<'a>,
        sizes: &[u64],
        axes: Option<u64>,
    ) -> Result<Vec<Place<'a>>, FileError> {
        let names = match self {
            Self::Attached => return Ok(vec![header.clone()]),
            Self::One(name) => vec![name.clone()],
            Self::Pattern(_) | Self::List(_) => {
                self.check_count(&header.name(), sizes, axes)?;
                match self {
                    Self::Pattern(pattern) => (0..pattern.count).map(|nth| pattern.name(nth)).collect(),
                    Self::List(names) => names.clone(),
                    Self::Attached | Self::One(_) => Vec::new(),
                }
            }
        };
        let Place::File(header) = header else {
            return Err(FileError::wrong(
                header.name(),
                "voxels in another file",
                "voxels behind the header",
            ));
        };
        names.iter().map(|name| Ok(Place::File(inside(header, name)?))).collect()
    }

    fn check_count(&self, file: &str, sizes: &[u64], axes: Option<u64>) -> Result<(), FileError> {
        let dimension = sizes.len() as u64;
        let axes = axes.unwrap_or(dimension.saturating_sub(1));
        let rest = sizes.get(usize::try_from(axes).unwrap_or(usize::MAX)..);
        let count = self.count();
        let fits = match rest {
            // Each file has the same number of the last axis' slices.
            Some([]) => count > 0 && sizes.last().is_some_and(|last| last % count == 0),
            Some(rest) if axes > 0 => {
                rest.iter().try_fold(1, |all: u64, &size| all.checked_mul(size)) == Some(count)
            }
            _ => false,
        };
        if fits && count <= MAX_FILES {
            return Ok(());
        }
        let sizes = sizes.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
        let expected = format!("a file for each slice of {axes} axes of {sizes}, at most {MAX_FILES}");
        Err(FileError::wrong(file, format!("{count} data files"), expected))
    }
}

/// The file `name` beside or below `header`, links followed.
fn inside(header: &Path, name: &str) -> Result<PathBuf, FileError> {
    let file = super::printable(&header.display().to_string());
    let expected = "another file in the header's folder or below";
    let wrong = |what: &str| FileError::wrong(&file, format!("data file {}{what}", quoted(name)), expected);
    let is_plain = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if name.is_empty() || !Path::new(name).components().all(is_plain) {
        return Err(wrong(""));
    }
    let folder = header.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let path = folder.join(name);
    let real = path.canonicalize().map_err(|e| opened::missing(&path, &e, "the header's data file"))?;
    let real_folder = folder.canonicalize().map_err(|e| opened::missing(folder, &e, "a folder"))?;
    if !real.starts_with(&real_folder) {
        return Err(wrong(", a link that leads elsewhere"));
    }
    if header.canonicalize().is_ok_and(|header| header == real) {
        return Err(wrong(", the header itself"));
    }
    Ok(path)
}

/// The files of `places` other than `header`.
pub(super) fn others(places: Vec<Place<'_>>, header: &Path) -> Vec<PathBuf> {
    let path = |place| if let Place::File(path) = place { Some(path) } else { None };
    places.into_iter().filter_map(path).filter(|path| path != header).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;

    #[test]
    fn patterns_are_counted_before_they_are_expanded() {
        let (files, axes) = described("parts/p%02d.raw 8 12 2 2").unwrap();
        assert_eq!((files.count(), axes), (3, Some(2)));
        let DataFiles::Pattern(pattern) = &files else { unreachable!() };
        assert_eq!([0, 2].map(|nth| pattern.name(nth)), ["parts/p08.raw", "parts/p12.raw"]);
        assert_eq!(described("p%d.raw 3 1 -1").unwrap().0.count(), 3);
        assert_eq!(described("p%09d.raw 0 999999999 1").unwrap().0.count(), 1_000_000_000);
        let all = described("p%d -9223372036854775808 9223372036854775807 1");
        assert!(all.is_err(), "{all:?}");
        for bad in
            ["%s.raw 0 1 1", "%n%d 0 1 1", "%999d 0 1 1", "p%d 0 1 0", "p%d 2 1 1", "p%d a 1 1", "", "LIST x"]
        {
            assert!(described(bad).is_err(), "{bad}");
        }
        assert_eq!(described("LIST 2D").unwrap(), (DataFiles::List(Vec::new()), Some(2)));
        assert_eq!(described(" a b.raw ").unwrap().0, DataFiles::One("a b.raw".into()));
    }

    #[test]
    fn as_many_files_as_slices() {
        let list = |n: usize| DataFiles::List(vec!["x".into(); n]);
        let fits = |n, sizes: &[u64], axes| list(n).check_count("t", sizes, axes).is_ok();
        assert!(fits(5, &[3, 4, 5], None) && fits(5, &[3, 4, 5], Some(2)) && fits(20, &[3, 4, 5], Some(1)));
        assert!(
            fits(5, &[3, 4, 5], Some(3)) && fits(1, &[3, 4, 5], Some(3)) && !fits(2, &[3, 4, 5], Some(3))
        );
        assert!(
            !fits(4, &[3, 4, 5], None) && !fits(60, &[3, 4, 5], Some(0)) && !fits(1, &[3, 4, 5], Some(9))
        );
        assert!(!fits(0, &[3, 4, 5], None));
    }

    #[test]
    fn only_files_in_the_headers_folder_count() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("case/parts")).unwrap();
        for name in ["outside.raw", "case/a.nhdr", "case/a.raw", "case/parts/b.raw"] {
            write_whole(&at(name), b"x").unwrap();
        }
        let header = at("case/a.nhdr");
        for name in ["a.raw", "./a.raw", "parts/b.raw"] {
            assert!(inside(&header, name).is_ok(), "{name}");
        }
        let outside = at("outside.raw").display().to_string();
        for name in
            ["../outside.raw", "parts/../../outside.raw", &outside, "gone.raw", "a.nhdr", "", "http://a/b"]
        {
            let error = inside(&header, name).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("outside.raw"), at("case/link.raw")).unwrap();
            let error = inside(&header, "link.raw").unwrap_err().to_string();
            assert!(error.contains("a link that leads elsewhere"), "{error}");
            std::os::unix::fs::symlink("a.raw", at("case/near.raw")).unwrap();
            assert!(inside(&header, "near.raw").is_ok());
        }
    }
}
