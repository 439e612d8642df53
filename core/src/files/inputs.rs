//! The files that a case was read from: outputs never overwrite them.

use std::path::{Path, PathBuf};

use super::{FileError, printable, read::other_files};

/// Files that a case was read from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inputs(Vec<PathBuf>);

impl Inputs {
    /// From the files' paths; the second file of a header and image pair and a header's data files are found.
    pub fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let mut all: Vec<PathBuf> = Vec::new();
        for file in files {
            all.extend(other_files(&file));
            all.push(file);
        }
        all.sort();
        all.dedup();
        Self(all)
    }

    /// These and another file.
    #[must_use]
    pub fn with(self, file: PathBuf) -> Self {
        Self::new(self.0.into_iter().chain([file]))
    }

    /// Their paths, sorted.
    pub fn paths(&self) -> &[PathBuf] {
        &self.0
    }

    /// Checks that `output` is none of them, under whatever name: through links, other spellings and hard links.
    ///
    /// # Errors
    /// [`FileError::Wrong`] where it is.
    pub fn refuse_as_output(&self, output: &Path) -> Result<(), FileError> {
        if !self.0.iter().any(|input| is_same_file(input, output)) {
            return Ok(());
        }
        let file = printable(&output.display().to_string());
        Err(FileError::wrong(file, "a file that the case was read from", "another name for the output"))
    }
}

/// Checks that `output` is no link to another file: where inputs are many, or not all known.
///
/// # Errors
/// [`FileError::Wrong`] where it is.
pub fn refuse_link(output: &Path) -> Result<(), FileError> {
    if !output.is_symlink() {
        return Ok(());
    }
    let file = printable(&output.display().to_string());
    Err(FileError::wrong(file, "a link to another file", "another name for the output"))
}

/// Whether both paths lead to one file. A path that doesn't exist leads to none.
fn is_same_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let identity = |path: &Path| path.metadata().ok().map(|m| (m.dev(), m.ino()));
        identity(a).is_some_and(|id| Some(id) == identity(b))
    }
    #[cfg(not(unix))]
    {
        a.canonicalize().ok().is_some_and(|path| Some(path) == b.canonicalize().ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;

    #[test]
    fn inputs_are_recognised_under_every_name() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["mask.nii.gz", "other.nii.gz", "pair.hdr", "pair.img"] {
            write_whole(&at(name), b"x").unwrap();
        }
        let inputs = Inputs::new([at("mask.nii.gz"), at("pair.hdr"), at("gone.nii")]);
        for name in ["mask.nii.gz", "pair.hdr", "pair.img"] {
            let error = inputs.refuse_as_output(&at(name)).unwrap_err().to_string();
            assert!(error.ends_with("expected another name for the output"), "{error}");
        }
        assert!(inputs.refuse_as_output(&folder.path().join(".").join("mask.nii.gz")).is_err());
        for name in ["other.nii.gz", "new.png", "gone.nii"] {
            assert!(inputs.refuse_as_output(&at(name)).is_ok(), "{name}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("mask.nii.gz"), at("link.csv")).unwrap();
            std::fs::hard_link(at("mask.nii.gz"), at("hard.csv")).unwrap();
            assert!(inputs.refuse_as_output(&at("link.csv")).is_err());
            assert!(inputs.refuse_as_output(&at("hard.csv")).is_err());
        }
    }
}
