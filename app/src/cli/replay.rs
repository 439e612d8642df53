//! `glioscope replay`: makes a report again, and says what differs.

use std::{io::Read, path::Path, sync::Arc};

use glioscope_core::files::{open_regular, read_small_text};

use super::{
    arguments::ReplayArguments,
    case::CaseArguments,
    report::{self, Asked, How},
    terminal,
};
use crate::{
    error::AppError,
    model::{
        CaseRef, Session,
        lesions::{SMALLEST_ML, WITHIN_MM},
        made, session,
    },
    report::{
        FileKind, Form, Identity, Options, RECIPE_VERSION, Recipe, ResponseRecipe, anonymous_case, recipe_in,
    },
    window::report_file::ReportFile,
    world::load::{self, ReadCase, Request},
};

/// Maximum size of a report.
const MAX_BYTES: u64 = 256 << 20;
/// Differences that are named; the others are counted.
const MOST_NAMED: usize = 8;

pub(super) fn run(arguments: ReplayArguments) -> Result<(), AppError> {
    let ReplayArguments { report: path, case, of, history, software } = arguments;
    let bytes = read(&path)?;
    let (recipe, kind) = (recipe(&path, &bytes)?, kind_of(&bytes));
    let given = CaseArguments { path: of, parts: case, tracts: Vec::new() };
    let Recipe { identity, language, names_reader, .. } = recipe;
    let options = Options { identity, language, names_reader };
    let session = session(&path, &recipe)?;
    let asked =
        recipe.response.as_ref().map(|response| asked(&path, response, history.as_deref())).transpose()?;
    let how = How { kind, options, self_check: false, software };
    let again = match (recipe.identity, given.reference()?) {
        (Identity::Full, None) => report::file(read_case(session, &given, None)?, &how, asked)?,
        // Nothing was read: the embedded sample.
        (_, None) if recipe.inputs.is_empty() => {
            of_given(&session, &given, CaseRef::Sample, &how, asked.as_ref())?
        }
        (_, Some(case)) => of_given(&session, &given, case, &how, asked.as_ref())?,
        (_, None) => {
            return Err(AppError::file(
                &path,
                "a report without the paths of its files",
                "the case: --of PATH",
            ));
        }
    };
    let ReportFile { bytes: now, recipe: made_with, .. } = again;
    if now == bytes {
        return terminal::print(&format!("{}: the same bytes again", path.display()));
    }
    let mut found = made_with.map(|made_with| differences(&recipe, &made_with)).unwrap_or_default();
    found.extend(match kind {
        FileKind::Pages(Form::Html) => different_parts(&bytes, &now, &HTML),
        FileKind::Pages(Form::Markdown) => different_parts(&bytes, &now, &MARKDOWN),
        _ => vec!["the pages".to_owned()],
    });
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
    let expected = "a report that glioscope report wrote as .html, .pdf, .md or .dcm";
    let unreadable =
        |e: serde_json::Error| AppError::file(path, format!("a recipe that can't be read ({e})"), expected);
    let recipe = recipe_in(bytes).map_err(unreadable)?;
    let recipe = recipe.ok_or_else(|| AppError::file(path, "no recipe", expected))?;
    let recipe: Recipe = serde_json::from_value(recipe).map_err(unreadable)?;
    if recipe.glioscope_report != RECIPE_VERSION {
        let found = format!("version {} of the recipe", recipe.glioscope_report);
        return Err(AppError::file(path, found, format!("version {RECIPE_VERSION}")));
    }
    Ok(recipe)
}

/// The kind of a report's file, by what it holds: it may have been renamed.
fn kind_of(bytes: &[u8]) -> FileKind {
    // A DICOM file begins with 128 bytes of anything.
    match (bytes.get(..5), bytes.get(128..132)) {
        (Some(b"%PDF-"), _) => FileKind::Pages(Form::Pdf),
        (_, Some(b"DICM")) => FileKind::EncapsulatedPdf,
        (Some(start), _) if start.starts_with(b"# ") => FileKind::Pages(Form::Markdown),
        _ => FileKind::Pages(Form::Html),
    }
}

/// The response that the report has. Its history stands in it only with the full identity.
fn asked(path: &Path, response: &ResponseRecipe, history: Option<&Path>) -> Result<Asked, AppError> {
    let settings =
        [("smallest_ml", response.smallest_ml, SMALLEST_ML), ("within_mm", response.within_mm, WITHIN_MM)];
    for (key, value, range) in settings {
        if !range.contains(&value) {
            let expected = format!("{} to {}", range.start(), range.end());
            return Err(AppError::file(path, format!("{key} = {value:e} in its recipe"), expected));
        }
    }
    let is_elsewhere = response.history.is_none() && response.history_sha256.is_some();
    let text = match history {
        None if is_elsewhere => {
            return Err(AppError::file(
                path,
                "a response whose history isn't in the report",
                "--history FILE",
            ));
        }
        None => None,
        Some(history) => Some(read_small_text(history, MAX_BYTES, "a history")?),
    };
    Ok(Asked::of_recipe(response, text))
}

/// The session in a report. It belongs to the report, not to a file that is saved.
fn session(path: &Path, recipe: &Recipe) -> Result<Session, AppError> {
    let mut session = session::parse(path, recipe.session.to_string().as_bytes())?;
    session.origin = None;
    Ok(session)
}

/// The case of a session, or the one given in its place, whose document isn't restored.
fn read_case(session: Session, given: &CaseArguments, case: Option<CaseRef>) -> Result<ReadCase, AppError> {
    let mut request = Request::of_session(session, &[], &given.options());
    if let Some(case) = case {
        if let CaseRef::Path(path) = &case
            && session::is_session(path)
        {
            return Err(AppError::file(path, "a session", "the case that the report was made of"));
        }
        (request.case, request.session) = (case, None);
    }
    terminal::with_progress(|progress| load::read_at_once(request, progress))
}

/// The report of a case that is given: the session has the names that the report shows.
fn of_given(
    session: &Session,
    given: &CaseArguments,
    case: CaseRef,
    how: &How,
    asked: Option<&Asked>,
) -> Result<ReportFile, AppError> {
    let read = read_case(session.clone(), given, Some(case))?;
    let made = made::with_made(&read.case, &session.document.edit.made);
    let shown = anonymous_case(&made, how.options);
    let (document, findings) = session.restore(&shown)?;
    terminal::notes(&findings);
    report::file_of_anonymous((&read.case, &read.spec), (&Arc::new(shown), &document), how, asked)
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
    let history =
        |recipe: &Recipe| recipe.response.as_ref().and_then(|response| response.history_sha256.clone());
    if history(before) != history(now) {
        out.push("another history".to_owned());
    }
    if gone + new > 0 {
        out.push(format!("{gone} input files of the report are not among those read, and {new} others are"));
    }
    out
}

/// How a section begins, and what its name ends with.
type Marks = [&'static str; 3];
const HTML: Marks = ["<h2", ">", "</h2>"];
const MARKDOWN: Marks = ["\n## ", "", "\n"];

/// Sections whose text differs, by their headings.
fn different_parts(before: &[u8], now: &[u8], [start, open, end]: &Marks) -> Vec<String> {
    let [before, now] = [before, now].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let parts = |page: &str| -> Vec<(String, String)> {
        let name = |part: &str| {
            let (_, rest) = part.split_once(open)?;
            rest.split_once(end).map(|(name, _)| name.to_owned())
        };
        let mut parts = page.split(start);
        let first = parts.next().map(|part| ("title".to_owned(), part.to_owned()));
        let rest = parts.map(|part| (name(part).unwrap_or_else(|| "title".into()), part.to_owned()));
        first.into_iter().chain(rest).collect()
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
