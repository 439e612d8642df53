//! `glioscope pacs`: studies of an archive by DICOMweb.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use glioscope_core::files::printable;
use glioscope_pacs::{Query, SeriesRow, StudyRow, Uid};
use serde_json::{Value, json};

use super::terminal;
use crate::{
    error::AppError,
    pacs::{self, KnownServer},
};

/// The tasks of `pacs`.
#[derive(Debug, Subcommand)]
pub enum PacsTask {
    /// List studies, the newest first; with --study, its series.
    List {
        /// The server.
        #[command(flatten)]
        server: ServerArguments,
        /// Which studies.
        #[command(flatten)]
        query: QueryArguments,
        /// As JSON: see docs/json.md.
        #[arg(long)]
        json: bool,
    },
    /// Retrieve a study into the cache and print its folder, which every command opens.
    Get {
        /// The server.
        #[command(flatten)]
        server: ServerArguments,
        /// Study Instance UID.
        study: Uid,
        /// Series Instance UID. Repeat for more; default: all series.
        #[arg(long, value_name = "UID")]
        series: Vec<Uid>,
    },
    /// Send DICOM files.
    Send {
        /// The server.
        #[command(flatten)]
        server: ServerArguments,
        /// The files.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Name a server, so that --pacs NAME means it; without arguments, list the servers.
    Servers {
        /// Its name.
        name: Option<String>,
        /// The address of its DICOMweb service: https://host/dicom-web. Without it, the name is forgotten.
        url: Option<String>,
        /// A PEM file of the authorities that are trusted for it, instead of the system's.
        #[arg(long, value_name = "FILE")]
        authorities: Option<PathBuf>,
        /// Allow plain http to another machine: everybody on the way reads patients' data and the password.
        #[arg(long)]
        insecure: bool,
    },
    /// Empty the cache of retrieved studies; those that are open elsewhere stay.
    Clear,
}

/// The server of a task.
#[derive(Debug, Args)]
pub struct ServerArguments {
    /// A server by its name, or the address of its DICOMweb service. Credentials come from the environment:
    /// GLIOSCOPE_PACS_USER and GLIOSCOPE_PACS_PASSWORD, or GLIOSCOPE_PACS_TOKEN.
    #[arg(long, value_name = "NAME|URL")]
    pub pacs: String,
}

/// Which studies are listed.
#[derive(Debug, Default, Args)]
pub struct QueryArguments {
    /// Patient's ID; * and ? are wildcards.
    #[arg(long, value_name = "ID")]
    pub patient: Option<String>,
    /// Patient's name: Doe^Jane, Doe*.
    #[arg(long)]
    pub name: Option<String>,
    /// Study Instance UID.
    #[arg(long, value_name = "UID")]
    pub study: Option<Uid>,
    /// A date, 2026-03-02, or a range, 2026-03-02..2026-04-01; either end may be left out.
    #[arg(long)]
    pub date: Option<String>,
    /// A modality: MR, PT, CT, SEG.
    #[arg(long)]
    pub modality: Option<String>,
    /// Accession number.
    #[arg(long)]
    pub accession: Option<String>,
    /// The most studies.
    #[arg(long, value_name = "N")]
    pub limit: Option<usize>,
}

impl QueryArguments {
    fn query(&self) -> Query {
        let (from, to) = pacs::date_range(self.date.as_deref().unwrap_or_default());
        Query {
            patient_id: self.patient.clone(),
            patient_name: self.name.clone(),
            from,
            to,
            modality: self.modality.clone(),
            accession: self.accession.clone(),
            study: self.study.clone(),
            limit: self.limit,
            offset: 0,
        }
    }
}

pub(super) fn run(task: PacsTask) -> Result<(), AppError> {
    match task {
        PacsTask::List { server, query, json } => list(&server.pacs, &query, json),
        PacsTask::Get { server, study, series } => get(&server.pacs, &study, &series),
        PacsTask::Send { server, files } => send(&server.pacs, &files),
        PacsTask::Servers { name: None, .. } => {
            let all = pacs::servers();
            let lines = all.iter().map(|server| format!("{}  {}\n", server.name, server.url));
            terminal::print(&lines.collect::<String>())
        }
        PacsTask::Servers { name: Some(name), url, authorities, insecure } => {
            let mut all = pacs::servers();
            let before = all.len();
            all.retain(|server| server.name != name);
            match url {
                Some(url) => {
                    let server = KnownServer { name, url, authorities, allow_insecure: insecure };
                    // Whether it can be used; nothing is sent.
                    server.connect()?;
                    all.push(server);
                }
                None if all.len() == before => {
                    return Err(AppError::wrong(
                        "servers",
                        format!("no {name}"),
                        "one of the list, or an address",
                    ));
                }
                None => {}
            }
            pacs::keep(&all)
        }
        PacsTask::Clear => {
            let left = pacs::cache()?.clear()?;
            let rest = if left > 0 { format!("; {left} bytes of open studies stay") } else { String::new() };
            terminal::print(&format!("the cache is empty{rest}"))
        }
    }
}

fn list(server: &str, query: &QueryArguments, json: bool) -> Result<(), AppError> {
    let client = pacs::server(server)?.connect()?;
    let studies = terminal::with_progress(|progress| pacs::studies(&client, &query.query(), progress))?;
    let series = match &query.study {
        Some(study) => terminal::with_progress(|progress| {
            Ok::<_, AppError>(client.series(study, &|| progress.check().is_err())?)
        })?,
        None => Vec::new(),
    };
    if json {
        let series: Vec<Value> = series.iter().map(series_json).collect();
        let studies: Vec<Value> = studies.iter().map(study_json).collect();
        return terminal::print_json(&json!({ "studies": studies, "series": series }));
    }
    let mut text = String::new();
    for study in &studies {
        text +=
            &format!("{}\n  {}\n", pacs::study_line(study), study.uid.as_ref().map_or("no UID", Uid::as_str));
    }
    for row in &series {
        let number = row.number.map_or_else(|| "–".into(), |number| number.to_string());
        let images = row.instances.map_or_else(|| "? images".into(), |n| format!("{n} images"));
        let words = [row.modality.as_deref(), row.description.as_deref()];
        let words: Vec<&str> = words.into_iter().flatten().collect();
        let uid = row.uid.as_ref().map_or("no UID", Uid::as_str);
        text += &format!("  series {number}  {}  {images}\n    {uid}\n", words.join("  "));
    }
    let count = studies.len();
    terminal::print(&format!("{text}{count} {}", if count == 1 { "study" } else { "studies" }))
}

fn study_json(row: &StudyRow) -> Value {
    json!({
        "study": row.uid.as_ref().map(Uid::as_str),
        "patient_id": row.patient_id,
        "patient_name": row.patient_name,
        "birth_date": row.birth_date,
        "date": row.date,
        "time": row.time,
        "accession": row.accession,
        "description": row.description,
        "modalities": row.modalities,
        "series": row.series,
        "instances": row.instances,
    })
}

fn series_json(row: &SeriesRow) -> Value {
    json!({
        "series": row.uid.as_ref().map(Uid::as_str),
        "modality": row.modality,
        "number": row.number,
        "description": row.description,
        "instances": row.instances,
    })
}

fn get(server: &str, study: &Uid, series: &[Uid]) -> Result<(), AppError> {
    let client = pacs::server(server)?.connect()?;
    let series = (!series.is_empty()).then_some(series);
    let found = terminal::with_progress(|progress| pacs::retrieve(&client, study, series, progress))?;
    for failed in &found.failed {
        let instance = failed.instance.as_ref().map_or("an image", Uid::as_str);
        terminal::warning("pacs-not-retrieved", &format!("{instance}: {}", printable(&failed.reason)));
    }
    if found.files.is_empty() {
        return Err(AppError::wrong("the study", "no image that could be retrieved", "one at least"));
    }
    terminal::assumed(&format!(
        "{} files, {} of them in the cache before",
        found.files.len(),
        found.from_cache
    ));
    terminal::print(&found.folder.display().to_string())
}

fn send(server: &str, files: &[PathBuf]) -> Result<(), AppError> {
    let client = pacs::server(server)?.connect()?;
    let sent = terminal::with_progress(|progress| Ok::<_, AppError>(pacs::send(&client, files, progress)))?;
    for failed in &sent.failed {
        let text = format!("{}: {}", failed.path.display(), failed.reason);
        terminal::warning("pacs-not-sent", &printable(&text));
    }
    if let Some(error) = sent.stopped {
        return Err(error.into());
    }
    if let Some(first) = sent.failed.first() {
        let found = format!(
            "{} of {} files that the server doesn't have ({})",
            sent.failed.len(),
            files.len(),
            printable(&first.reason)
        );
        return Err(AppError::wrong("the server", found, "all of them stored"));
    }
    terminal::print(&format!("{} files are on the server", sent.stored.len()))
}
