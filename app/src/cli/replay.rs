//! `glioscope replay`: makes a report again, and says what differs.

use std::{io::Read, path::Path};

use glioscope_core::files::open_regular;

use super::{arguments::ReplayArguments, case::CaseArguments, report, terminal};
use crate::{
    error::AppError,
    model::{CaseRef, session},
    report::{Form, Identity, Options, Recipe, recipe_in, write},
    world::load::{self, Request},
};

/// Maximum size of a report.
const MAX_BYTES: u64 = 256 << 20;
/// Differences that are named; the others are counted.
const MOST_NAMED: usize = 8;

pub(super) fn run(arguments: ReplayArguments) -> Result<(), AppError> {
    let ReplayArguments { report: path, case, of, software } = arguments;
    let bytes = read(&path)?;
    let recipe = recipe(&path, &bytes)?;
    let given = CaseArguments { path: of, parts: case, tracts: Vec::new() };
    let request = request(&path, &recipe, &given)?;
    let read = terminal::with_progress(|progress| load::read_at_once(request, progress))?;
    let options = Options { identity: recipe.identity, language: recipe.language };
    let again = report::make(read, options, software)?;
    let differences = differences(&recipe, &again.recipe);
    let same_bytes = write(&again, Form::Html, options.language) == bytes;
    if same_bytes {
        return terminal::print(&format!("{}: the same bytes again", path.display()));
    }
    let mut found = differences;
    found.extend(different_parts(&bytes, &write(&again, Form::Html, options.language)));
    let more = found.len().saturating_sub(MOST_NAMED);
    found.truncate(MOST_NAMED);
    let more = if more == 0 { String::new() } else { format!(" and {more} more") };
    Err(AppError::file(
        &path,
        format!("a report that differs: {}{more}", found.join("; ")),
        "the same bytes again",
    ))
}

/// The whole file: a report is a page, which isn't refused here as an answer of some server.
fn read(path: &Path) -> Result<Vec<u8>, AppError> {
    let (file, size) = open_regular(path)?;
    if size > MAX_BYTES {
        return Err(AppError::file(
            path,
            format!("{size} bytes"),
            format!("a report of at most {MAX_BYTES}"),
        ));
    }
    let mut bytes = Vec::new();
    let read = file.take(MAX_BYTES).read_to_end(&mut bytes);
    read.map_err(|e| AppError::file(path, e.to_string(), "a file that can be read"))?;
    Ok(bytes)
}

fn recipe(path: &Path, bytes: &[u8]) -> Result<Recipe, AppError> {
    let expected = "a report that glioscope report wrote as HTML";
    let page = std::str::from_utf8(bytes).map_err(|_| AppError::file(path, "no text", expected))?;
    let json = recipe_in(page).ok_or_else(|| AppError::file(path, "no recipe", expected))?;
    serde_json::from_str(json)
        .map_err(|e| AppError::file(path, format!("a recipe that can't be read ({e})"), expected))
}

/// What the report was made of: its own case, or the one given.
fn request(path: &Path, recipe: &Recipe, given: &CaseArguments) -> Result<Request, AppError> {
    let text = recipe.session.to_string();
    let mut session = session::parse(path, text.as_bytes())?;
    // It belongs to the report, not to a file that is saved.
    session.origin = None;
    let mut request = Request::of_session(session, &[], &given.options());
    match (given.reference()?, recipe.identity) {
        (Some(CaseRef::Path(path)), _) if session::is_session(&path) => {
            return Err(AppError::file(&path, "a session", "the case that the report was made of"));
        }
        (Some(case), _) => request.case = case,
        // Nothing was read: the embedded sample.
        (None, _) if recipe.inputs.is_empty() => request.case = CaseRef::Sample,
        (None, Identity::Full) => {}
        (None, _) => {
            return Err(AppError::file(
                path,
                "a report without the paths of its files",
                "the case: --of PATH",
            ));
        }
    }
    Ok(request)
}

/// What the two were made with differently.
fn differences(before: &Recipe, now: &Recipe) -> Vec<String> {
    let mut out = Vec::new();
    if before.program != now.program {
        out.push(format!("made by {}, this is {}", before.program, now.program));
    }
    if before.adapter != now.adapter {
        out.push(format!("pictures by {}, now by {}", before.adapter, now.adapter));
    }
    let gone =
        before.inputs.iter().filter(|input| !now.inputs.iter().any(|n| n.sha256 == input.sha256)).count();
    let new =
        now.inputs.iter().filter(|input| !before.inputs.iter().any(|b| b.sha256 == input.sha256)).count();
    if gone + new > 0 {
        out.push(format!("{gone} input files of the report are not among those read, and {new} others are"));
    }
    out
}

/// Sections whose text differs, by their headings.
fn different_parts(before: &[u8], now: &[u8]) -> Vec<String> {
    let [before, now] = [before, now].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let parts = |page: &str| -> Vec<(String, String)> {
        let name = |part: &str| {
            part.split_once('>')
                .and_then(|(_, rest)| rest.split_once("</h2>"))
                .map(|(name, _)| name.to_owned())
        };
        page.split("<h2")
            .map(|part| (name(part).unwrap_or_else(|| "title".into()), part.to_owned()))
            .collect()
    };
    let (before, now) = (parts(&before), parts(&now));
    let mut out: Vec<String> = Vec::new();
    for (name, part) in &before {
        match now.iter().find(|(other, _)| other == name) {
            None => out.push(format!("section \"{name}\" is gone")),
            Some((_, other)) if other != part => out.push(format!("section \"{name}\"")),
            Some(_) => {}
        }
    }
    out.extend(
        now.iter()
            .filter(|(name, _)| !before.iter().any(|(other, _)| other == name))
            .map(|(name, _)| format!("section \"{name}\" is new")),
    );
    out
}
