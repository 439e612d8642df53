//! SHA-256 of the files that a case is read from and of those that were computed.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use glioscope_core::{
    Progress,
    case::{files_of_other_data_sets, has_manifest, read_manifest},
    files::{FileError, printable, sha256_of},
};
use serde::{Deserialize, Serialize};

use crate::{CohortCase, CohortError};

/// Maximum depth of folders in a case.
const MAX_DEPTH: usize = 16;
/// Maximum number of files in a case.
const MAX_FILES: usize = 1_000_000;

/// A file with its hash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HashedFile {
    /// Its path: relative to the data set or to the case's results where it lies beneath, else absolute.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// Its SHA-256 in lower-case hexadecimal digits.
    pub sha256: String,
}

/// Files named by a saved session: whoever reads sessions says which.
pub type SessionFiles<'a> = &'a (dyn Fn(&Path) -> Result<Vec<PathBuf>, CohortError> + Sync);

/// The files of a case with their hashes, sorted by path. Of a folder every file in it, of a manifest what it names; of a subject of BIDS
/// also what is read of other data sets, of the derived ones `derivatives`. Links are followed. `data_set`: paths are relative to it.
///
/// # Errors
/// [`CohortError`]: an unreadable file or manifest, nothing at the case's path, more than a million files.
pub fn of_case(
    case: &CohortCase,
    (data_set, derivatives): (&Path, &[PathBuf]),
    session_files: SessionFiles<'_>,
    progress: &Progress,
) -> Result<Vec<HashedFile>, CohortError> {
    let path = &case.path;
    let expected = "a folder, manifest, archive, image or session";
    let metadata = std::fs::metadata(path).map_err(|e| CohortError::io(path, &e, expected))?;
    let ends_in = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    let mut files = BTreeSet::new();
    if metadata.is_dir() {
        walk(path, 0, &mut BTreeSet::new(), &mut files)?;
        // What can't be chosen is an error of the case, said by its first step.
        if !has_manifest(path) {
            files.extend(files_of_other_data_sets(path, derivatives, progress).unwrap_or_default());
        }
        let manifests: Vec<PathBuf> = files
            .iter()
            .filter(|file| file.file_name().is_some_and(|name| name == "case.toml"))
            .cloned()
            .collect();
        // A manifest may name files elsewhere; one that can't be read is an error of the case, said by its first step.
        for manifest in manifests.iter().filter(|manifest| manifest.parent() == Some(path)) {
            if let Ok(spec) = read_manifest(manifest) {
                files.extend(spec.inputs().paths().iter().cloned());
            }
        }
    } else {
        files.insert(path.clone());
        if ends_in("toml") {
            files.extend(read_manifest(path)?.inputs().paths().iter().cloned());
        } else if ends_in("json") {
            files.extend(session_files(path)?);
        }
    }
    files.extend(case.history.clone());
    files.iter().map(|file| of_file(file, data_set, progress)).collect()
}

/// All files in a folder and those in it.
fn walk(
    folder: &Path,
    depth: usize,
    seen: &mut BTreeSet<PathBuf>,
    files: &mut BTreeSet<PathBuf>,
) -> Result<(), CohortError> {
    let unreadable = |e: std::io::Error| CohortError::io(folder, &e, "a folder that can be read");
    // A link may lead back.
    if !seen.insert(folder.canonicalize().map_err(unreadable)?) {
        return Ok(());
    }
    if depth > MAX_DEPTH || files.len() > MAX_FILES {
        let found = format!("more than {MAX_DEPTH} levels or {MAX_FILES} files");
        return Err(CohortError::at(folder, found, "the folder of one case"));
    }
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.is_dir() {
            walk(&path, depth + 1, seen, files)?;
        } else {
            files.insert(path);
        }
    }
    Ok(())
}

/// The hash of one file. A missing one has none: that it is missing belongs to what was read.
fn of_file(path: &Path, beneath: &Path, progress: &Progress) -> Result<HashedFile, CohortError> {
    let shown = path.strip_prefix(beneath).unwrap_or(path).to_string_lossy().into_owned();
    if !path.exists() {
        return Ok(HashedFile { path: printable(&shown), bytes: 0, sha256: String::new() });
    }
    let (bytes, sha256) = sha256_of(path, progress).map_err(|error| match error {
        FileError::Cancelled(cancelled) => cancelled.into(),
        error => CohortError::from(error),
    })?;
    Ok(HashedFile { path: printable(&shown), bytes, sha256 })
}

/// Every file in `folder`, with its hash; paths are relative to it.
///
/// # Errors
/// [`CohortError`] where one can't be read.
pub fn of_results(folder: &Path, progress: &Progress) -> Result<Vec<HashedFile>, CohortError> {
    let mut files = BTreeSet::new();
    walk(folder, 0, &mut BTreeSet::new(), &mut files)?;
    files.iter().map(|file| of_file(file, folder, progress)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::files::write_whole;

    #[test]
    fn a_folder_is_hashed_with_what_its_manifest_names_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("case/deep")).unwrap();
        write_whole(&at("case/deep/x"), b"abc").unwrap();
        write_whole(&at("m.nii"), b"").unwrap();
        let manifest = "glioscope = 1\n[[mask]]\nid = \"a\"\nfile = \"../m.nii\"\n[[mask]]\nid = \"b\"\nfile = \"gone.nii\"\n";
        write_whole(&at("case/case.toml"), manifest.as_bytes()).unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(at("case"), at("case/deep/back")).unwrap();
        let case = CohortCase { label: "case".into(), path: at("case"), history: None };
        let no_session = |_: &Path| -> Result<Vec<PathBuf>, CohortError> { Ok(Vec::new()) };
        let files = of_case(&case, (folder.path(), &[]), &no_session, &Progress::new()).unwrap();
        let of = |name: &str| files.iter().find(|file| file.path.ends_with(name)).unwrap();
        // Of the empty text and of "abc": FIPS 180-2.
        assert_eq!(of("m.nii").sha256, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
        assert_eq!(
            of("case/deep/x").sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
        assert_eq!((of("gone.nii").sha256.as_str(), of("case/deep/x").bytes), ("", 3));
        assert_eq!(files.len(), 4, "{files:?}");
        let gone = CohortCase { path: at("nothing"), ..case };
        let error =
            of_case(&gone, (folder.path(), &[]), &no_session, &Progress::new()).unwrap_err().to_string();
        assert!(error.contains("expected a folder, manifest"), "{error}");
    }
}
