//! Retrieving a study's instances into a cache (WADO-RS, PS3.18 10.4): only what isn't there yet, as the server stores it.

use std::collections::HashSet;
use std::io::{self, Write as _};
use std::path::PathBuf;

use ureq::Body;
use ureq::http::Response;
use ureq::http::header::{CONTENT_LENGTH, CONTENT_TYPE, TRANSFER_ENCODING};

use crate::cache::{Cache, InUse, StudyFolder};
use crate::client::{Cancel, Client};
use crate::error::Error;
use crate::identity::{Identity, identity};
use crate::multipart::{Fault, Multipart, boundary};
use crate::reader::Reader;
use crate::rows::Row;
use crate::session::Session;
use crate::uid::Uid;

/// Any transfer syntax: else servers decompress, and fail for what they can't.
const ACCEPT: &str = "multipart/related; type=\"application/dicom\"; transfer-syntax=*";

/// Requests for single instances of a series that may fail in a row before the others aren't requested any more.
const MAX_FAILURES: usize = 3;

/// Most parts of an answer that weren't asked for.
const MAX_STRAYS: usize = 100;

/// Most bytes of an instance: a larger one can't be opened.
const MAX_INSTANCE_BYTES: u64 = 8 << 30;

/// How far a retrieval is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Instances that are in the cache, or failed.
    pub done: u64,
    /// Instances that the server listed.
    pub of: u64,
    /// Bytes received.
    pub bytes: u64,
}

/// An instance that wasn't retrieved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failed {
    /// Which; `None` where the server named none that is valid.
    pub instance: Option<Uid>,
    /// Why, in one line.
    pub reason: String,
}

/// A study in the cache.
#[derive(Debug)]
pub struct Retrieved {
    /// The study's folder: series' folders with files, nothing else. It may have further series from earlier retrievals.
    pub folder: PathBuf,
    /// Files of the instances that were asked for, in the order of the server's list.
    pub files: Vec<PathBuf>,
    /// How many of them were in the cache before.
    pub from_cache: usize,
    /// What is missing.
    pub failed: Vec<Failed>,
    /// Keeps the study in the cache as long as it is shown.
    pub in_use: InUse,
}

impl Client {
    /// Retrieves a study, or some of its `series`, into `cache`. What is there already isn't transferred again.
    ///
    /// # Errors
    /// Those of the connection; a study that the server doesn't have; a cut answer; too little room. Instances that came
    /// whole stay in the cache, so that another call continues. An instance that the server alone can't give, or that is
    /// another than the requested one, is in [`Retrieved::failed`] instead.
    pub fn retrieve(
        &self,
        study: &Uid,
        series: Option<&[Uid]>,
        cache: &Cache,
        progress: &dyn Fn(Progress),
        cancel: Cancel<'_>,
    ) -> Result<Retrieved, Error> {
        self.session(cancel, |session| {
            let mut failed = Vec::new();
            let list = session.list(study, series, &mut failed)?;
            let of = list.iter().map(|(_, instances)| instances.len() as u64).sum();
            if of == 0 {
                let asked = format!("instances of study {study}");
                return Err(Error::NotFound { server: self.name.clone(), asked });
            }
            let folder = cache.study(&self.folder_name(), study)?;
            let counted = Progress { of, ..Progress::default() };
            let mut job = Job { session, study, folder, progress, counted, failed, from_cache: 0 };
            let mut files = Vec::new();
            for (series, instances) in &list {
                job.series(series, instances)?;
                let paths = instances.iter().map(|instance| job.folder.path(series, instance));
                files.extend(paths);
            }
            let lost: HashSet<_> = job.failed.iter().filter_map(|failed| failed.instance.as_ref()).collect();
            let is_lost = |path: &PathBuf| {
                let name = path.file_stem().and_then(|name| name.to_str()).and_then(Uid::read);
                name.is_some_and(|uid| lost.contains(&uid))
            };
            files.retain(|path| !is_lost(path));
            let (failed, from_cache, folder) = (job.failed, job.from_cache, job.folder.folder.clone());
            Ok(Retrieved { folder, files, from_cache, failed, in_use: job.folder.finish()? })
        })
    }
}

impl Session<'_> {
    /// Series of a study with their instances, each once.
    fn list(
        &self,
        study: &Uid,
        series: Option<&[Uid]>,
        failed: &mut Vec<Failed>,
    ) -> Result<Vec<(Uid, Vec<Uid>)>, Error> {
        let series = match series {
            Some(series) => series.to_vec(),
            None => valid(self.series(study)?, failed, "a series without a valid UID"),
        };
        let mut seen = HashSet::new();
        let mut list = Vec::new();
        for series in series {
            if seen.insert(series.clone()) {
                let rows = self.instances(study, &series, None)?;
                list.push((series, valid(rows, failed, "an instance without a valid UID")));
            }
        }
        Ok(list)
    }
}

/// UIDs of rows, each once; rows without one are failures.
fn valid<R: Row>(rows: Vec<R>, failed: &mut Vec<Failed>, reason: &str) -> Vec<Uid> {
    let (mut uids, mut seen) = (Vec::with_capacity(rows.len()), HashSet::new());
    for row in rows {
        match row.uid() {
            Some(uid) if seen.insert(uid.clone()) => uids.push(uid.clone()),
            Some(_) => {}
            None => failed.push(Failed { instance: None, reason: reason.to_owned() }),
        }
    }
    uids
}

/// A retrieval under way.
struct Job<'a> {
    session: &'a Session<'a>,
    study: &'a Uid,
    folder: StudyFolder,
    progress: &'a dyn Fn(Progress),
    counted: Progress,
    failed: Vec<Failed>,
    from_cache: usize,
}

impl Job<'_> {
    /// Whether an instance is in the cache. A file that a power failure damaged is not.
    fn has(&self, series: &Uid, instance: &Uid) -> bool {
        let found = identity(&self.folder.path(series, instance));
        found.is_ok_and(|found| found.instance == *instance)
    }

    /// Retrieves what is missing of a series: in one request where nothing is there, else each instance.
    fn series(&mut self, series: &Uid, instances: &[Uid]) -> Result<(), Error> {
        let mut missing = self.missing(series, instances.to_vec())?;
        let there = instances.len() - missing.len();
        self.from_cache += there;
        self.counted.done += there as u64;
        (self.progress)(self.counted);
        if there == 0 && missing.len() > 1 {
            let path = format!("studies/{}/series/{series}", self.study);
            match self.fetch(&path, &format!("series {series}"), series, None) {
                Err(error) if !error.is_about_one_request() => return Err(error),
                // The server may still give its instances.
                Err(_) => {}
                Ok(strays) => {
                    self.failed.extend(strays.into_iter().map(|reason| Failed { instance: None, reason }));
                }
            }
            missing = self.missing(series, missing)?;
        }
        let mut failures = 0;
        for (at, instance) in missing.iter().enumerate() {
            let path = format!("studies/{}/series/{series}/instances/{instance}", self.study);
            let reason = match self.fetch(&path, &format!("instance {instance}"), series, Some(instance)) {
                Err(error) if !error.is_about_one_request() => return Err(error),
                Err(error) => error.to_string(),
                Ok(_) if self.has(series, instance) => {
                    failures = 0;
                    continue;
                }
                Ok(mut strays) => strays.pop().unwrap_or_else(|| {
                    format!("{}: found an empty answer, expected the instance", self.session.client.name)
                }),
            };
            failures += 1;
            let rest = if failures == MAX_FAILURES { &missing[at..] } else { &missing[at..=at] };
            self.counted.done += rest.len() as u64;
            (self.progress)(self.counted);
            let fail = |uid: &Uid| Failed { instance: Some(uid.clone()), reason: reason.clone() };
            self.failed.extend(rest.iter().map(fail));
            if failures == MAX_FAILURES {
                break;
            }
        }
        Ok(())
    }

    fn missing(&self, series: &Uid, mut instances: Vec<Uid>) -> Result<Vec<Uid>, Error> {
        self.session.check()?;
        instances.retain(|instance| !self.has(series, instance));
        Ok(instances)
    }

    /// Keeps the instances of an answer that belong to `series`, and are the one of UID `only`; says why others aren't kept.
    fn fetch(
        &mut self,
        path: &str,
        asked: &str,
        series: &Uid,
        only: Option<&Uid>,
    ) -> Result<Vec<String>, Error> {
        let answer = self.session.get(path, ACCEPT, asked)?;
        let boundary = self.boundary(&answer)?;
        let headers = answer.headers();
        let is_framed = headers.contains_key(CONTENT_LENGTH) || headers.contains_key(TRANSFER_ENCODING);
        let reader = Reader::new(answer.into_body(), u64::MAX, self.session.cancel);
        let mut parts = Multipart::new(reader, &boundary);
        let mut strays = Vec::new();
        loop {
            match parts.next() {
                Ok(None) => {
                    // Where the end is known it is read, so that the connection serves the next request.
                    if is_framed {
                        parts.drain();
                    }
                    return Ok(strays);
                }
                Ok(Some(head)) => strays.extend(self.part(&mut parts, head.length, series, only)?),
                Err(fault) => return Err(self.error(fault, parts.reader())),
            }
            if strays.len() > MAX_STRAYS {
                let server = self.session.client.name.clone();
                let (found, most) = ("more parts that weren't asked for".to_owned(), MAX_STRAYS.to_string());
                return Err(Error::TooLarge { server, found, most });
            }
        }
    }

    fn boundary(&self, answer: &Response<Body>) -> Result<String, Error> {
        let stated = answer.headers().get(CONTENT_TYPE).and_then(|value| value.to_str().ok());
        stated.and_then(boundary).ok_or_else(|| {
            let found = match stated {
                Some(stated) => format!("an answer of type \"{}\"", self.session.client.said(stated)),
                None => "an answer without a type".to_owned(),
            };
            let expected = "DICOM files (multipart/related with a boundary)";
            Error::NotDicomWeb { server: self.session.client.name.clone(), found, expected }
        })
    }

    fn error(&self, fault: Fault, reader: &Reader<'_>) -> Error {
        match fault {
            Fault::Read(error) => reader.error(self.session.client, &error),
            Fault::Cut(reason) => {
                Error::Cut { server: self.session.client.name.clone(), reason: reason.to_owned() }
            }
        }
    }

    /// Receives a part; keeps it if it is whole and the right one, else says why not.
    fn part(
        &mut self,
        parts: &mut Multipart<Reader<'_>>,
        stated: Option<u64>,
        series: &Uid,
        only: Option<&Uid>,
    ) -> Result<Option<String>, Error> {
        let mut received = self.folder.receive()?;
        let mut own = None;
        let mut arrived = 0;
        let server = self.session.client.name.clone();
        let content = parts.content(&mut |bytes| {
            arrived += bytes.len() as u64;
            let mut write = || {
                if arrived > MAX_INSTANCE_BYTES {
                    let (found, most) = ("a larger instance".to_owned(), "8 GiB".to_owned());
                    return Err(Error::TooLarge { server: server.clone(), found, most });
                }
                self.folder.make_room(bytes.len() as u64)?;
                let path = received.path().to_owned();
                received.write_all(bytes).map_err(|error| Error::file(&path, &error, "room to write"))
            };
            // An error of this machine must not look like one of the connection.
            write().map_err(|error| {
                own = Some(error);
                io::Error::other("not written")
            })?;
            self.counted.bytes += bytes.len() as u64;
            (self.progress)(self.counted);
            Ok(())
        });
        let length = match (content, own) {
            (_, Some(error)) => return Err(error),
            (Err(fault), None) => return Err(self.error(fault, parts.reader())),
            (Ok(length), None) => length,
        };
        let checked = match stated {
            Some(stated) if stated != length => Err(format!("a part of {length} bytes that states {stated}")),
            _ => identity(received.path()).and_then(|found| self.belongs(found, series, only)),
        };
        // One that is there already was sent twice.
        let checked = checked.and_then(|instance| {
            if self.has(series, &instance) {
                Err(format!("the instance {instance} once more"))
            } else {
                Ok(instance)
            }
        });
        match checked {
            Ok(instance) => {
                self.folder.keep(received, series, &instance)?;
                self.counted.done = (self.counted.done + 1).min(self.counted.of);
                (self.progress)(self.counted);
                Ok(None)
            }
            Err(found) => {
                self.folder.gave_back(length);
                let server = &self.session.client.name;
                Ok(Some(format!("{server}: found {found}, expected an instance of series {series}")))
            }
        }
    }

    /// The UID of a received file, if it is one that was asked for.
    fn belongs(&self, found: Identity, series: &Uid, only: Option<&Uid>) -> Result<Uid, String> {
        if let Some((study, of)) = &found.of
            && (study != self.study || of != series)
        {
            return Err(format!("an instance of study {study}, series {of}"));
        }
        match only {
            Some(only) if *only != found.instance => Err(format!("the instance {}", found.instance)),
            _ => Ok(found.instance),
        }
    }
}
