//! Storing files on a server (STOW-RS, PS3.18 10.5), in batches; of each file it is said whether the server has it.

use std::cell::Cell;
use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;

use crate::client::{Cancel, Client};
use crate::error::Error;
use crate::identity::{Identity, identity};
use crate::retrieve::Progress;
use crate::session::Session;
use crate::store_answer::{self, Said};
use crate::uid::Uid;
use crate::upload::{Upload, random_boundary};

/// Most files of a request.
const BATCH_FILES: usize = 50;

/// Bytes at which a request ends; a larger file is one of its own.
const BATCH_BYTES: u64 = 64 << 20;

/// Longest answer that is read, in bytes.
const MAX_ANSWER_BYTES: u64 = 4 << 20;

/// A file that the server doesn't have, as far as is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unsent {
    /// The file.
    pub path: PathBuf,
    /// Its SOP instance UID, where it has one.
    pub instance: Option<Uid>,
    /// Why, in one line.
    pub reason: String,
}

/// What became of files: each is in one of the lists.
#[derive(Debug)]
pub struct Sent {
    /// SOP instance UIDs that the server has, in the order of the files. It may have had them before.
    pub stored: Vec<Uid>,
    /// What it doesn't have.
    pub failed: Vec<Unsent>,
    /// What ended the transfer before its end.
    pub stopped: Option<Error>,
}

/// A file of a batch.
struct Outgoing {
    path: PathBuf,
    bytes: u64,
    identity: Identity,
}

impl Outgoing {
    fn unsent(&self, reason: String) -> Unsent {
        Unsent { path: self.path.clone(), instance: Some(self.identity.instance.clone()), reason }
    }
}

impl Client {
    /// Stores `files`. Files that aren't DICOM aren't sent; others are sent as they are. [`Progress::bytes`] and
    /// [`Progress::of`] count what was sent and the files.
    pub fn send(&self, files: &[PathBuf], progress: &dyn Fn(Progress), cancel: Cancel<'_>) -> Sent {
        let mut sent = Sent { stored: Vec::new(), failed: Vec::new(), stopped: None };
        let mut outgoing = Vec::new();
        for path in files {
            let length = fs::metadata(path).map_err(|error| error.to_string()).map(|metadata| metadata.len());
            match length.and_then(|bytes| Ok((bytes, identity(path)?))) {
                Ok((bytes, identity)) => outgoing.push(Outgoing { path: path.clone(), bytes, identity }),
                Err(reason) => sent.failed.push(Unsent { path: path.clone(), instance: None, reason }),
            }
        }
        let mut batches = batches(&outgoing).into_iter();
        let counted = Cell::new(Progress {
            done: sent.failed.len() as u64,
            of: files.len() as u64,
            ..Progress::default()
        });
        let work = |session: &Session<'_>| {
            // Without this, refused credentials look like a connection that breaks while files are sent.
            session.greet()?;
            for batch in batches.by_ref() {
                let stopped = session.store(batch, &mut sent, progress, &counted);
                let done = counted.get().done + batch.len() as u64;
                counted.set(Progress { done, ..counted.get() });
                progress(counted.get());
                stopped?;
            }
            Ok(())
        };
        if !outgoing.is_empty()
            && let Err(error) = self.session(cancel, work)
        {
            let reason = format!("not sent: {error}");
            sent.failed.extend(batches.flatten().map(|file| file.unsent(reason.clone())));
            sent.stopped = Some(error);
        }
        sent
    }
}

/// Files in batches; no two of a batch have the same instance, of which a server's answer couldn't tell them apart.
fn batches(files: &[Outgoing]) -> Vec<&[Outgoing]> {
    let mut out = Vec::new();
    let (mut start, mut bytes, mut seen) = (0, 0, HashSet::new());
    for (at, file) in files.iter().enumerate() {
        let is_full = at - start == BATCH_FILES || bytes + file.bytes > BATCH_BYTES;
        if at > start && (is_full || seen.contains(&file.identity.instance)) {
            out.push(&files[start..at]);
            (start, bytes) = (at, 0);
            seen.clear();
        }
        bytes += file.bytes;
        seen.insert(&file.identity.instance);
    }
    if start < files.len() {
        out.push(&files[start..]);
    }
    out
}

impl Session<'_> {
    /// Sends a batch and says in `sent` what became of each of its files.
    ///
    /// # Errors
    /// What makes further batches pointless.
    fn store(
        &self,
        batch: &[Outgoing],
        sent: &mut Sent,
        progress: &dyn Fn(Progress),
        counted: &Cell<Progress>,
    ) -> Result<(), Error> {
        let files: Vec<(PathBuf, u64)> = batch.iter().map(|file| (file.path.clone(), file.bytes)).collect();
        let boundary = random_boundary();
        let read = |bytes| {
            counted.set(Progress { bytes: counted.get().bytes + bytes, ..counted.get() });
            progress(counted.get());
        };
        let (mut body, length) = Upload::new(&files, &boundary, &read, self.cancel);
        let content_type = format!("multipart/related; type=\"application/dicom\"; boundary={boundary}");
        let answer = self.post("studies", &content_type, length, &mut body);
        if let Some(path) = body.broken {
            let reason = format!("not sent: {} changed or can't be read", path.display());
            sent.failed.extend(batch.iter().map(|file| file.unsent(reason.clone())));
            return Ok(());
        }
        let (said, otherwise, stop) = match answer {
            Ok(answer) => {
                let status = answer.status().as_u16();
                let text = self.text(answer, MAX_ANSWER_BYTES);
                let said = store_answer::read(&text);
                let otherwise = match self.explanation(&text) {
                    None => format!("not in the server's answer (status {status})"),
                    Some(reason) => format!("status {status} ({reason})"),
                };
                (said, otherwise, None)
            }
            Err(error) => (Said::new(), error.to_string(), Some(error)),
        };
        let mut reachable = !matches!(
            stop,
            Some(
                Error::Cancelled
                    | Error::Unauthorized { .. }
                    | Error::Forbidden { .. }
                    | Error::Redirect { .. }
            )
        );
        for file in batch {
            let uid = &file.identity.instance;
            match said.get(uid) {
                Some(Ok(())) => sent.stored.push(uid.clone()),
                Some(Err(reason)) => sent.failed.push(file.unsent(reason.clone())),
                // A server may refuse a batch and still keep what was good of it.
                None => match self.is_stored(&file.identity, &mut reachable) {
                    Some(true) => sent.stored.push(uid.clone()),
                    Some(false) => sent.failed.push(file.unsent(otherwise.clone())),
                    None => {
                        let reason = format!("{otherwise}; unknown whether it was stored");
                        sent.failed.push(file.unsent(reason));
                    }
                },
            }
        }
        match stop {
            Some(error) => Err(error),
            None => self.check(),
        }
    }

    /// Whether the server has an instance; `None` where it can't be asked.
    fn is_stored(&self, identity: &Identity, reachable: &mut bool) -> Option<bool> {
        let (study, series) = identity.of.as_ref().filter(|_| *reachable)?;
        match self.instances(study, series, Some(&identity.instance)) {
            Ok(rows) => Some(rows.iter().any(|row| row.uid.as_ref() == Some(&identity.instance))),
            Err(Error::NotFound { .. }) => Some(false),
            Err(_) => {
                *reachable = false;
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_are_bounded_and_have_each_instance_once() {
        let file = |uid: usize, bytes| Outgoing {
            path: PathBuf::new(),
            bytes,
            identity: Identity { instance: Uid::read(&format!("1.{uid}")).unwrap(), of: None },
        };
        let sizes = |files: &[Outgoing]| batches(files).iter().map(|batch| batch.len()).collect::<Vec<_>>();
        let small: Vec<_> = (0..120).map(|uid| file(uid, 1)).collect();
        assert_eq!(sizes(&small), [50, 50, 20]);
        assert_eq!(sizes(&[file(1, BATCH_BYTES + 1), file(2, BATCH_BYTES), file(3, 1)]), [1, 1, 1]);
        assert_eq!(sizes(&[file(1, 1), file(2, 1), file(1, 1)]), [2, 1]);
        assert!(sizes(&[]).is_empty());
    }
}
