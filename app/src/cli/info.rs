//! `glioscope info`: describes a file or a case.

use std::path::{Path, PathBuf};

use glioscope_core::{
    Progress, case,
    files::{self, FileInfo, ReadOptions, Source, archive, dicom},
};
use serde_json::json;

use super::{
    case::{CaseArguments, MaskArguments},
    terminal,
};
use crate::{error::AppError, model::session, world::load};

pub(super) fn run(
    target: Option<PathBuf>,
    parts: &MaskArguments,
    as_json: bool,
    cross_check: bool,
) -> Result<(), AppError> {
    let archive = target.as_ref().filter(|path| archive::is_zip(path));
    let unpacked = match archive {
        Some(path) => {
            Some(terminal::with_progress(|progress| archive::unpacked(path, parts.max_bytes, progress))?)
        }
        None => None,
    };
    let is_archive = archive.is_some();
    let target = target.map(|path| case::folder_of_dicomdir(&path).map(Path::to_owned).unwrap_or(path));
    if let Some(path) = &target
        && path.is_file()
        && !is_archive
        && !is_manifest(path)
        && !session::is_session(path)
    {
        let info: Box<dyn FileInfo> = if cross_check {
            let options = ReadOptions { max_bytes: parts.max_bytes, ..ReadOptions::default() };
            Box::new(files::cross_check(path, &options, &Progress::new())?)
        } else {
            files::info(&Source::File(path.clone()), &Progress::new())?
        };
        terminal::notes(info.checks());
        let json = || info.json().map_err(|e| AppError::file(path, e.to_string(), "finite numbers"));
        return if as_json { terminal::print_json_text(&json()?) } else { terminal::print(&info.text()) };
    }
    if let Some(path) = unpacked.as_ref().or(target.as_ref())
        && path.is_dir()
        && !case::has_manifest(path)
        && case::is_study(path, &Progress::new())
    {
        let studies = terminal::with_progress(|progress| dicom::studies(path, progress))?;
        let json = || studies.json().map_err(|e| AppError::file(path, e.to_string(), "finite numbers"));
        return if as_json { terminal::print_json_text(&json()?) } else { terminal::print(&studies.text()) };
    }
    let case = CaseArguments { path: target, parts: parts.clone(), tracts: Vec::new() };
    let spec = load::describe(case.request(true)?, &Progress::new())?;
    if cross_check {
        return Err(AppError::wrong("--cross-check", "a case", "one image"));
    }
    terminal::notes(&spec.notes);
    if as_json {
        let masks: Vec<_> = spec
            .masks
            .iter()
            .map(|m| {
                json!({"id": m.id, "name": m.name, "file": m.source.name(), "labels": m.labels, "time": m.time})
            })
            .collect();
        let contexts: Vec<_> = spec
            .contexts
            .iter()
            .map(|c| json!({"id": c.id, "file": c.source.name(), "time": c.time}))
            .collect();
        let tracts: Vec<_> =
            spec.tracts.iter().map(|t| json!({"id": t.id, "file": t.source.name()})).collect();
        return terminal::print_json(
            &json!({"case": spec.name, "masks": masks, "contexts": contexts, "tracts": tracts, "notes": spec.notes}),
        );
    }
    let mut lines = vec![spec.name.clone()];
    let time = |t: &Option<String>| t.as_ref().map(|t| format!("  at {t}")).unwrap_or_default();
    for c in &spec.contexts {
        lines.push(format!("image {:16} {}{}", c.id, c.source.name(), time(&c.time)));
    }
    for m in &spec.masks {
        let labels = m.labels.as_ref().map(|l| format!("  labels {l:?}")).unwrap_or_default();
        let name = m.name.as_ref().map(|name| format!("  {name}")).unwrap_or_default();
        lines.push(format!("mask  {:16} {}{labels}{}{name}", m.id, m.source.name(), time(&m.time)));
    }
    for t in &spec.tracts {
        lines.push(format!("tracts {:15} {}", t.id, t.source.name()));
    }
    lines.extend(spec.notes.iter().map(|n| format!("{}: {}", n.code, n.message)));
    terminal::print(&lines.join("\n"))
}

fn is_manifest(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}
