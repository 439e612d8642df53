//! Where results go: folders that are put in place whole, each made under a lock by one run at a time.
//!
//! | in the output | |
//! |---|---|
//! | `cases/LABEL/` | the results of a case |
//! | `tables/` | the tables of the cohort |
//! | `dataset_description.json` | what made them, in the form of BIDS |
//! | `.parts/NAME/` | what the holder of the lock `NAME` is making; whoever gets the lock removes what a killed run left |
//! | `.locks/NAME` | empty files, locked as long as a run works on `NAME`; the system frees them when a run is killed |

use std::{
    fs::{File, OpenOptions, TryLockError},
    path::{Path, PathBuf},
};

use glioscope_core::{
    digest::Digest,
    files::{absolute, write_whole},
};

use crate::{CohortError, cases::DESCRIPTION};

const WRITABLE: &str = "a place that can be written";
/// Where a BIDS data set keeps what was computed from it.
const DERIVATIVES: &str = "derivatives";
/// The version of BIDS whose form of derived data is kept to.
const BIDS_VERSION: &str = "1.10.0";

/// The folder of a cohort's results.
#[derive(Clone, Debug)]
pub struct Place(PathBuf);

impl Place {
    /// The results in `out`, which is made where it isn't there.
    ///
    /// # Errors
    /// [`CohortError`] where it can't be made, and where it lies among the cases of `input`: it would be taken for one.
    pub fn open(out: &Path, input: &Path) -> Result<Self, CohortError> {
        let (out, input) = (absolute(out), absolute(input));
        let expected = "a folder outside the input, or derivatives/NAME in it";
        refuse_within(&out, &input, expected)?;
        for folder in [out.join("cases"), out.join(".parts"), out.join(".locks")] {
            std::fs::create_dir_all(&folder).map_err(|e| CohortError::io(&folder, &e, WRITABLE))?;
        }
        Ok(Self(out))
    }

    /// The folder itself.
    pub fn folder(&self) -> &Path {
        &self.0
    }

    /// Writes what BIDS requires of derived data, unless a description is there already.
    ///
    /// # Errors
    /// [`CohortError`] where it can't be written.
    pub(crate) fn describe(&self, version: &str) -> Result<(), CohortError> {
        let path = self.0.join(DESCRIPTION);
        if path.exists() {
            return Ok(());
        }
        let described = serde_json::json!({
            "Name": "Results of glioscope cohort",
            "BIDSVersion": BIDS_VERSION,
            "DatasetType": "derivative",
            "GeneratedBy": [{ "Name": "Glioscope", "Version": version }],
        });
        Ok(write_whole(&path, format!("{described:#}\n").as_bytes())?)
    }

    /// Where the results of a case lie once they are whole.
    pub fn case(&self, label: &str) -> PathBuf {
        self.0.join("cases").join(label)
    }

    /// Where the tables lie once they are whole.
    pub fn tables(&self) -> PathBuf {
        self.0.join("tables")
    }

    /// The lock of a case's results; `None` while another run has it.
    ///
    /// # Errors
    /// [`CohortError`] where the file system has no locks.
    pub(crate) fn lock_case(&self, label: &str) -> Result<Option<Lock>, CohortError> {
        self.lock(&format!("case-{label}"), self.case(label))
    }

    /// The lock of the tables.
    ///
    /// # Errors
    /// As [`Place::lock_case`].
    pub(crate) fn lock_tables(&self) -> Result<Option<Lock>, CohortError> {
        self.lock("tables", self.tables())
    }

    fn lock(&self, name: &str, target: PathBuf) -> Result<Option<Lock>, CohortError> {
        let path = self.0.join(".locks").join(name);
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
        let file = file.map_err(|e| CohortError::io(&path, &e, WRITABLE))?;
        match file.try_lock() {
            Ok(()) => Ok(Some(Lock { _file: file, parts: self.0.join(".parts").join(name), target })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Error(e)) => Err(CohortError::io(&path, &e, "a file system with locks")),
        }
    }
}

/// Refuses results among the cases.
fn refuse_within(out: &Path, input: &Path, expected: &str) -> Result<(), CohortError> {
    // Where a folder isn't there yet, its parents say where it will be.
    let real = |path: &Path| -> PathBuf {
        let there = path.ancestors().find_map(|part| Some((part, part.canonicalize().ok()?)));
        there.map_or_else(
            || path.to_owned(),
            |(part, real)| match path.strip_prefix(part) {
                Ok(rest) if !rest.as_os_str().is_empty() => real.join(rest),
                _ => real,
            },
        )
    };
    let (out_real, input_real) = (real(out), real(input));
    let Ok(rest) = out_real.strip_prefix(&input_real) else { return Ok(()) };
    let is_derived = rest.components().next().is_some_and(|part| part.as_os_str() == DERIVATIVES)
        && rest.components().count() > 1;
    if is_derived { Ok(()) } else { Err(CohortError::at(out, "a folder among the cases", expected)) }
}

/// The right to make one folder of results.
#[derive(Debug)]
pub(crate) struct Lock {
    _file: File,
    parts: PathBuf,
    target: PathBuf,
}

impl Lock {
    /// The folder that this lock is of.
    pub(crate) fn target(&self) -> &Path {
        &self.target
    }

    /// An empty folder to make results in: in `work` where given, else beside their place. What a killed run left is removed.
    ///
    /// # Errors
    /// [`CohortError`] where it can't be made.
    pub(crate) fn part(&self, work: Option<&Path>) -> Result<Part<'_>, CohortError> {
        let beside = self.parts.join("new");
        let folder = match work {
            None => beside,
            Some(work) => {
                let mut digest = Digest::new();
                digest.bytes(self.target.as_os_str().as_encoded_bytes());
                let [a, b] = digest.finish();
                absolute(work).join(format!("glioscope-{a:016x}{b:016x}"))
            }
        };
        remove(&self.parts)?;
        remove(&folder)?;
        std::fs::create_dir_all(&folder).map_err(|e| CohortError::io(&folder, &e, WRITABLE))?;
        Ok(Part { lock: self, folder })
    }
}

/// Results that are being made; removed when dropped before they are put in place.
#[derive(Debug)]
pub(crate) struct Part<'a> {
    lock: &'a Lock,
    folder: PathBuf,
}

impl Part<'_> {
    /// Where to write.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Flushes everything to disk and puts it in place, whole, instead of what was there. If the process is killed meanwhile, there
    /// are the old results, the new ones, or none.
    ///
    /// # Errors
    /// [`CohortError`] with the system's reason.
    pub(crate) fn put(self) -> Result<(), CohortError> {
        let target = &self.lock.target;
        let parts = &self.lock.parts;
        std::fs::create_dir_all(parts).map_err(|e| CohortError::io(parts, &e, WRITABLE))?;
        let new = parts.join("new");
        if self.folder != new {
            copy(&self.folder, &new)?;
        }
        sync(&new)?;
        let failed = |e: std::io::Error| CohortError::io(target, &e, WRITABLE);
        let old = parts.join("old");
        if target.symlink_metadata().is_ok() {
            std::fs::rename(target, &old).map_err(failed)?;
        }
        if let Err(e) = std::fs::rename(&new, target) {
            // Where there was nothing before, this fails, too.
            let _ = std::fs::rename(&old, target);
            return Err(failed(e));
        }
        if let Some(parent) = target.parent() {
            sync_folder(parent)?;
        }
        Ok(())
    }
}

impl Drop for Part<'_> {
    fn drop(&mut self) {
        // What can't be removed now, the next run removes.
        let _ = remove(&self.folder);
        let _ = remove(&self.lock.parts);
    }
}

/// Removes a folder, if it is there.
fn remove(folder: &Path) -> Result<(), CohortError> {
    // A process that is just being ended may still write.
    let mut tries = 0;
    loop {
        match std::fs::remove_dir_all(folder) {
            Ok(()) => return Ok(()),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(()),
            Err(e) if tries == 20 => {
                return Err(CohortError::io(folder, &e, "a folder of an earlier run that can be removed"));
            }
            Err(_) => {
                tries += 1;
                std::thread::sleep(std::time::Duration::from_millis(50));
            }
        }
    }
}

fn copy(from: &Path, to: &Path) -> Result<(), CohortError> {
    std::fs::create_dir_all(to).map_err(|e| CohortError::io(to, &e, WRITABLE))?;
    for entry in
        std::fs::read_dir(from).map_err(|e| CohortError::io(from, &e, "a folder that can be read"))?.flatten()
    {
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            copy(&source, &target)?;
        } else {
            std::fs::copy(&source, &target).map_err(|e| CohortError::io(&target, &e, WRITABLE))?;
        }
    }
    Ok(())
}

/// Flushes a folder and everything in it to disk.
fn sync(folder: &Path) -> Result<(), CohortError> {
    for entry in std::fs::read_dir(folder).map_err(|e| CohortError::io(folder, &e, WRITABLE))?.flatten() {
        let path = entry.path();
        if path.is_dir() {
            sync(&path)?;
        } else {
            let synced = File::open(&path).and_then(|file| file.sync_all());
            synced.map_err(|e| CohortError::io(&path, &e, WRITABLE))?;
        }
    }
    sync_folder(folder)
}

/// Flushes the entries of a folder; only Unix knows that.
fn sync_folder(folder: &Path) -> Result<(), CohortError> {
    #[cfg(unix)]
    File::open(folder).and_then(|file| file.sync_all()).map_err(|e| CohortError::io(folder, &e, WRITABLE))?;
    #[cfg(not(unix))]
    let _ = folder;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::files::write_whole;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn results_are_put_whole_instead_of_older_ones_and_dropped_ones_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        for work in [None, Some(folder.path().join("work"))] {
            let place = Place::open(&folder.path().join("out"), &folder.path().join("in")).unwrap();
            let lock = place.lock_case("a").unwrap().unwrap();
            for name in ["first", "second"] {
                let part = lock.part(work.as_deref()).unwrap();
                std::fs::create_dir(part.folder().join("deep")).unwrap();
                write_whole(&part.folder().join("deep").join(name), b"x").unwrap();
                part.put().unwrap();
                assert_eq!(names(&place.case("a").join("deep")), [name]);
            }
            let part = lock.part(work.as_deref()).unwrap();
            write_whole(&part.folder().join("third"), b"x").unwrap();
            drop(part);
            assert_eq!(names(&place.case("a")), ["deep"]);
            assert!(names(&place.folder().join(".parts")).is_empty());
            assert!(work.is_none_or(|work| names(&work).is_empty()));
        }
    }

    #[test]
    fn one_run_has_a_case_at_a_time_and_removes_what_a_killed_one_left() {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::open(&folder.path().join("out"), &folder.path().join("in")).unwrap();
        let left = place.folder().join(".parts/case-a/new");
        std::fs::create_dir_all(&left).unwrap();
        write_whole(&left.join("half"), b"x").unwrap();
        let lock = place.lock_case("a").unwrap().unwrap();
        assert!(place.lock_case("a").unwrap().is_none() && place.lock_case("b").unwrap().is_some());
        assert!(names(lock.part(None).unwrap().folder()).is_empty());
        drop(lock);
        assert!(place.lock_case("a").unwrap().is_some());
    }

    #[test]
    fn results_among_the_cases_are_refused_but_derivatives_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("in");
        std::fs::create_dir(&input).unwrap();
        for name in ["", "out", "sub-01/out", "derivatives"] {
            let error = Place::open(&input.join(name), &input).unwrap_err().to_string();
            assert!(error.contains("expected a folder outside the input"), "{error}");
        }
        assert!(names(&input).is_empty());
        assert!(Place::open(&input.join("derivatives/glioscope"), &input).is_ok());
        assert!(Place::open(&folder.path().join("in-results"), &input).is_ok());
    }
}
