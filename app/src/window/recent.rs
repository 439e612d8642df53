//! The list of recently opened cases, in the user's configuration folder. Nothing else depends on it, so its errors are
//! ignored.

use std::path::{Path, PathBuf};

use glioscope_core::files::absolute;

use crate::model::kept;

/// Largest size of the list's file.
const MAX_BYTES: u64 = 1 << 20;
/// Largest number of paths in the list.
const MAX_PATHS: usize = 12;

/// Paths of cases and sessions, newest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recent {
    file: Option<PathBuf>,
    paths: Vec<PathBuf>,
}

impl Recent {
    /// The list in the user's configuration folder.
    pub fn of_user() -> Self {
        kept::config_folder().map_or_else(Self::default, |folder| Self::in_folder(&folder))
    }

    /// The folder that it is stored in; `None`: it is stored nowhere.
    pub fn folder(&self) -> Option<&Path> {
        self.file.as_ref()?.parent()
    }

    /// The list stored in `folder`; empty if there is none.
    pub fn in_folder(folder: &Path) -> Self {
        let file = folder.join("recent.json");
        let paths = kept::read(&file, MAX_BYTES, "a list of cases").unwrap_or_default();
        Self { file: Some(file), paths }
    }

    /// The paths, newest first.
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Moves or adds `path` to the front and saves the list.
    pub fn add(&mut self, path: &Path) {
        let path = absolute(path);
        self.paths.retain(|p| *p != path);
        self.paths.insert(0, path);
        self.paths.truncate(MAX_PATHS);
        self.save();
    }

    /// Empties the list and saves it.
    pub fn clear(&mut self) {
        self.paths.clear();
        self.save();
    }

    fn save(&self) {
        if let Some(file) = &self.file {
            kept::write(file, &self.paths);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_unique_newest_first_and_saved() {
        let folder = tempfile::tempdir().unwrap();
        let mut recent = Recent::in_folder(folder.path());
        for name in ["/a", "/b", "/a"] {
            recent.add(Path::new(name));
        }
        let expected = [PathBuf::from("/a"), PathBuf::from("/b")];
        assert_eq!(recent.paths(), expected);
        assert_eq!(Recent::in_folder(folder.path()).paths(), expected);
        assert_eq!(recent.folder(), Some(folder.path()));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = folder.path().join("recent.json").metadata().unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600, "paths may name a patient");
        }
    }
}
