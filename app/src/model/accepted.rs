//! What the user accepted of the files of folders without a manifest, so that nothing is asked twice: in the user's
//! configuration folder, for the user alone. Nothing else depends on it, so its errors are ignored.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::kept;

/// Largest size of the file.
const MAX_BYTES: u64 = 4 << 20;
/// The most answers kept.
const MAX_ANSWERS: usize = 200;
/// Largest manifest kept.
const MAX_MANIFEST_BYTES: usize = 16 << 10;
/// The most files left out in an answer that is kept.
const MAX_LEFT_OUT: usize = 100;

/// An answer.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// Names the files: [`glioscope_core::case::Proposal::key`].
    pub key: String,
    /// What they are, as a manifest with relative paths; `None`: as they were guessed.
    #[serde(default)]
    pub manifest: Option<String>,
    /// Files that were left out, relative to the folder.
    #[serde(default)]
    pub left_out: Vec<PathBuf>,
    /// The dates in time order, where that was asked.
    #[serde(default)]
    pub order: Vec<String>,
    /// Whether they lie in one space, whatever frames of reference they state.
    #[serde(default)]
    pub one_space: bool,
}

/// The answers, newest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Answers {
    file: Option<PathBuf>,
    list: Vec<Answer>,
}

impl Answers {
    /// The answers stored in `folder`; without one, none are kept from run to run.
    pub fn in_folder(folder: Option<&Path>) -> Self {
        let file = folder.map(|folder| folder.join("accepted.json"));
        let read = |file: &PathBuf| kept::read(file, MAX_BYTES, "a list of answers");
        let mut list: Vec<Answer> = file.as_ref().and_then(read).unwrap_or_default();
        list.truncate(MAX_ANSWERS);
        Self { file, list }
    }

    /// The answer for the files named by `key`.
    pub fn find(&self, key: &str) -> Option<&Answer> {
        self.list.iter().find(|answer| !key.is_empty() && answer.key == key)
    }

    /// Keeps an answer in place of the one for the same files.
    pub fn add(&mut self, answer: Answer) {
        let is_large = answer.left_out.len() > MAX_LEFT_OUT
            || answer.manifest.as_ref().is_some_and(|text| text.len() > MAX_MANIFEST_BYTES);
        if answer.key.is_empty() || self.list.first() == Some(&answer) {
            return;
        }
        self.list.retain(|other| other.key != answer.key);
        if !is_large {
            self.list.insert(0, answer);
        }
        self.list.truncate(MAX_ANSWERS);
        self.save();
    }

    /// Forgets the answer for the files named by `key`.
    pub fn forget(&mut self, key: &str) {
        self.list.retain(|answer| answer.key != key);
        self.save();
    }

    fn save(&self) {
        if let Some(file) = &self.file {
            kept::write(file, &self.list);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::files::write_whole;

    fn answer(key: &str, manifest: Option<&str>) -> Answer {
        Answer { key: key.into(), manifest: manifest.map(str::to_owned), ..Answer::default() }
    }

    #[test]
    fn answers_are_read_again_bounded_and_private() {
        let folder = tempfile::tempdir().unwrap();
        let open = || Answers::in_folder(Some(folder.path()));
        let mut answers = open();
        answers.add(answer("a", None));
        answers.add(answer("a", Some("glioscope = 1")));
        answers.add(answer("", None));
        answers.add(answer("large", Some(&"x".repeat(1 << 20))));
        assert_eq!(open().list, [answer("a", Some("glioscope = 1"))]);
        assert_eq!((open().find("a"), open().find("")), (answers.find("a"), None));
        for n in 0..300 {
            answers.add(answer(&n.to_string(), None));
        }
        assert_eq!((open().list.len(), open().find("a")), (MAX_ANSWERS, None));
        answers.forget("299");
        assert_eq!((open().find("299"), open().list.len()), (None, MAX_ANSWERS - 1));
        let file = folder.path().join("accepted.json");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o600, "names may tell who");
        }
        for other in [&b"{}"[..], &vec![b' '; 5 << 20]] {
            write_whole(&file, other).unwrap();
            assert_eq!(open().list, []);
        }
    }
}
