//! Archives of images (PACS, by DICOMweb): the user's servers, the cache, and what the command line and the window ask of
//! them. Credentials come from the environment, and are kept nowhere.

use std::{
    cell::Cell,
    path::{Path, PathBuf},
};

use glioscope_core::{Progress, dates, files::printable};
use glioscope_pacs::{Cache, Client, Credentials, Query, Retrieved, Sent, Server, StudyRow, Uid};
use serde::{Deserialize, Serialize};

use crate::{error::AppError, model::kept};

/// The most bytes of the cache.
const CACHE_BYTES: u64 = 20 << 30;
/// Maximum size of the list of servers.
const MAX_BYTES: u64 = 1 << 20;
/// Where the cache lies, in place of the user's cache folder.
const CACHE_FOLDER: &str = "GLIOSCOPE_CACHE";

/// A server that the user named.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KnownServer {
    /// Its name.
    pub name: String,
    /// The root of its service: `https://host/dicom-web`.
    pub url: String,
    /// A PEM file of the authorities that are trusted for it, instead of the system's.
    #[serde(default)]
    pub authorities: Option<PathBuf>,
    /// Whether plain http to another machine is allowed.
    #[serde(default)]
    pub allow_insecure: bool,
}

fn list_file(folder: &Path) -> PathBuf {
    folder.join("servers.json")
}

/// The user's servers, in the configuration folder.
pub fn servers() -> Vec<KnownServer> {
    let file = kept::config_folder().map(|folder| list_file(&folder));
    file.and_then(|file| kept::read(&file, MAX_BYTES, "a list of servers")).unwrap_or_default()
}

/// Replaces the user's list of servers.
///
/// # Errors
/// [`AppError`] where it can't be written.
pub fn keep(servers: &[KnownServer]) -> Result<(), AppError> {
    let folder = kept::config_folder();
    let written = folder.as_ref().is_some_and(|folder| kept::write(&list_file(folder), &servers));
    let place =
        folder.map_or_else(|| "the configuration folder".into(), |folder| folder.display().to_string());
    written
        .then_some(())
        .ok_or_else(|| AppError::wrong(place, "no place for servers.json", "one that can be written"))
}

/// The server with this name in the user's list, or at this address.
///
/// # Errors
/// [`AppError`] for another name that is no address.
pub fn server(text: &str) -> Result<KnownServer, AppError> {
    let text = text.trim();
    let known = servers();
    if let Some(server) = known.iter().find(|server| server.name == text) {
        return Ok(server.clone());
    }
    if !text.contains("://") {
        let names: Vec<&str> = known.iter().map(|server| server.name.as_str()).collect();
        let expected = match names.as_slice() {
            [] => "the address of a DICOMweb service: https://…".to_owned(),
            names => format!("{}, or an address: https://…", names.join(", ")),
        };
        return Err(AppError::wrong("server", format!("\"{}\"", printable(text)), expected));
    }
    let (name, url) = (String::new(), text.to_owned());
    Ok(KnownServer { name, url, authorities: None, allow_insecure: false })
}

impl KnownServer {
    /// A client with the credentials of the environment. Nothing is sent yet.
    ///
    /// # Errors
    /// [`AppError`] for an address or credentials that can't be used.
    pub fn connect(&self) -> Result<Client, AppError> {
        let mut server = Server::new(&self.url)?;
        server.name = Some(self.name.clone()).filter(|name| !name.is_empty());
        server.credentials = Credentials::from_environment()?;
        server.authorities.clone_from(&self.authorities);
        server.allow_insecure = self.allow_insecure;
        Ok(server.connect()?)
    }
}

/// The folder of the cache.
fn cache_folder() -> Option<PathBuf> {
    std::env::var_os(CACHE_FOLDER).map(PathBuf::from).or_else(|| {
        directories::ProjectDirs::from("", "", "glioscope").map(|folders| folders.cache_dir().join("pacs"))
    })
}

/// The cache of retrieved studies.
///
/// # Errors
/// [`AppError`] where there is no place for it.
pub fn cache() -> Result<Cache, AppError> {
    let folder = cache_folder().ok_or_else(|| {
        AppError::wrong("the cache", "no folder of this user", format!("one, or {CACHE_FOLDER}"))
    })?;
    Ok(Cache::open(&folder, CACHE_BYTES)?)
}

/// Studies that match `query`, the newest first.
///
/// # Errors
/// [`AppError`] of the connection, or of a value that can't be searched for.
pub fn studies(client: &Client, query: &Query, progress: &Progress) -> Result<Vec<StudyRow>, AppError> {
    progress.say("searching");
    let mut rows = client.studies(query, &|| progress.check().is_err())?;
    rows.sort_by(|a, b| (&b.date, &b.time).cmp(&(&a.date, &a.time)));
    Ok(rows)
}

/// Retrieves a study, or some of its series, into the cache.
///
/// # Errors
/// [`AppError`] of the connection or the cache. What came whole stays there, so that another call continues.
pub fn retrieve(
    client: &Client,
    study: &Uid,
    series: Option<&[Uid]>,
    progress: &Progress,
) -> Result<Retrieved, AppError> {
    progress.say("retrieving");
    let last = Cell::new(glioscope_pacs::Progress::default());
    let tell = |now: glioscope_pacs::Progress| {
        let before = last.replace(now);
        if now.of != before.of {
            progress.expect(now.of);
        }
        // Whether it was cancelled is asked below.
        let _ = progress.advance(now.done.saturating_sub(before.done));
    };
    Ok(client.retrieve(study, series, &cache()?, &tell, &|| progress.check().is_err())?)
}

/// Sends files; of each it is known afterwards whether the server has it.
pub fn send(client: &Client, files: &[PathBuf], progress: &Progress) -> Sent {
    progress.say("sending");
    client.send(files, &|_| {}, &|| progress.check().is_err())
}

/// The first and the last day of a date, `2026-03-02`, or of a range, `2026-03-02..2026-04-01`, as DICOM writes days. An
/// end that is left out is open.
pub fn date_range(text: &str) -> (Option<String>, Option<String>) {
    let day = |text: &str| {
        let digits: String = text.trim().chars().filter(|c| *c != '-').collect();
        (!digits.is_empty()).then_some(digits)
    };
    match text.split_once("..") {
        Some((from, to)) => (day(from), day(to)),
        None => (day(text), day(text)),
    }
}

/// A study in one line: date, patient, modalities, what it is called, and its size.
pub fn study_line(row: &StudyRow) -> String {
    let day = |date: &str| dates::dicom_date(date).unwrap_or_else(|| date.to_owned());
    let date = row.date.as_deref().map_or_else(|| "no date".to_owned(), day);
    let patient = match (&row.patient_name, &row.patient_id) {
        (Some(name), Some(id)) => format!("{} ({id})", name.replace('^', " ")),
        (Some(name), None) => name.replace('^', " "),
        (None, Some(id)) => id.clone(),
        (None, None) => "no patient".into(),
    };
    let modalities = row.modalities.join("/");
    let images = row.instances.map(|n| format!("{n} images"));
    let parts = [Some(date), Some(patient), Some(modalities), row.description.clone(), images];
    let parts: Vec<String> = parts.into_iter().flatten().filter(|part| !part.is_empty()).collect();
    printable(&parts.join("  "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_read_and_written() {
        let some = |text: &str| Some(text.to_owned());
        assert_eq!(date_range("2026-03-02"), (some("20260302"), some("20260302")));
        assert_eq!(date_range("2026-03-02..20260401"), (some("20260302"), some("20260401")));
        assert_eq!(date_range("..2026-04-01"), (None, some("20260401")));
        assert_eq!(date_range("2026-04-01.."), (some("20260401"), None));
        assert_eq!(date_range(""), (None, None));
        let line = |date: &str| {
            study_line(&StudyRow {
                uid: None,
                patient_name: None,
                patient_id: None,
                birth_date: None,
                date: some(date),
                time: None,
                accession: None,
                description: None,
                modalities: Vec::new(),
                series: None,
                instances: None,
            })
        };
        assert_eq!(line("20260302"), "2026-03-02  no patient");
        assert_eq!(line("2026"), "2026  no patient");
    }
}
