//! `glioscope report` into a folder: a file for each picture, and all numbers.

use std::path::{Path, PathBuf};

use glioscope_core::{
    files::{read_small, replace_files, temporary_folder},
    measure,
};

use strum::VariantArray;

use super::{case::CaseArguments, offscreen::gpu, terminal};
use crate::{
    error::AppError,
    model::{ExportFormat, PaneId},
    output,
    report::{self, Anonymous, Identity, Options},
    window::{
        numbers::{Shown, as_file},
        report_file::{painter, shown},
    },
    world::load::ReadCase,
};

/// Size of the window's picture.
const WINDOW_PX: [u32; 2] = [1600, 1000];

/// Name of the file of numbers, which says whose report it is.
const NUMBERS: &str = "measure.json";
/// Maximum size of the numbers of a report that is replaced.
const MAX_BYTES: u64 = 1 << 30;

/// `identity`: how much the files say of the patient; the names in the case where it isn't given.
pub(super) fn run(
    arguments: &CaseArguments,
    out: &Path,
    identity: Option<Identity>,
    force: bool,
    software: bool,
) -> Result<(), AppError> {
    let read = arguments.read(true)?;
    let options = Options { identity: identity.unwrap_or(Identity::Full), ..Options::default() };
    let is_named = options.identity == Identity::Full;
    let inputs = read.case.inputs.clone();
    names().try_for_each(|name| inputs.refuse_as_output(&out.join(name)))?;
    let removed = report::words(options.language).get("removed");
    let replaced = earlier_report(out, if is_named { &read.case.name } else { &removed })?;
    // Cases of --mask all go by one name, and those that aren't named: that doesn't tell patients apart.
    let is_told = is_named && (arguments.path.is_some() || arguments.parts.sample);
    if !is_told && !force && !replaced.is_empty() {
        return Err(AppError::file(out, "a report, maybe of another case", "another folder, or --force"));
    }
    let _made = NewFolder::make(out)?;
    // Everything is written here first: a report is put in place whole, and never beside pictures of another one.
    let new = temporary_folder(out)?;
    let names = write(read, new.path(), options, software)?;
    let outdated: Vec<String> = replaced.into_iter().filter(|name| !names.contains(name)).collect();
    replace_files(&new, out, &names, &outdated)?;
    terminal::print(&format!("pictures and numbers written to {}", out.display()))
}

/// A folder made for a report: if it is still empty when this is dropped, it is removed, with the parents made for it.
struct NewFolder(Vec<PathBuf>);

impl NewFolder {
    fn make(folder: &Path) -> Result<Self, AppError> {
        let is_missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let made = folder.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        let made = Self(made);
        std::fs::create_dir_all(folder)
            .map_err(|e| AppError::file(folder, e.to_string(), "a folder that can be made"))?;
        Ok(made)
    }
}

impl Drop for NewFolder {
    fn drop(&mut self) {
        // Fails where something is in it.
        self.0.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
}

/// Names of every file that a report may have; the one that says whose it is last.
fn names() -> impl Iterator<Item = String> {
    let tables = ExportFormat::VARIANTS.iter().map(|format| all_numbers(*format));
    let panes = PaneId::all().filter_map(|pane| pane.row().report_px.and(pane.row().cli));
    std::iter::once("window")
        .chain(panes)
        .map(|name| format!("{name}.png"))
        .chain(tables)
        .chain([NUMBERS.to_owned()])
}

/// The file of all numbers, those of every pane.
fn all_numbers(format: ExportFormat) -> String {
    format!("numbers.{}", format.extension())
}

/// Names of the files of an earlier report in `out`, which the new one replaces.
///
/// # Errors
/// [`AppError`] where they are of another case, or of none that is known.
fn earlier_report(out: &Path, case: &str) -> Result<Vec<String>, AppError> {
    let there: Vec<String> = names().filter(|name| out.join(name).symlink_metadata().is_ok()).collect();
    let Some(first) = there.first() else { return Ok(there) };
    let expected = format!("another folder, or a report of \"{case}\" to replace");
    let numbers = out.join(NUMBERS);
    if numbers.symlink_metadata().is_err() {
        return Err(AppError::file(out, format!("{first} without {NUMBERS}"), expected));
    }
    let bytes = read_small(&numbers, MAX_BYTES, "a report")?;
    let report: Option<serde_json::Value> = serde_json::from_slice(&bytes).ok();
    match report.as_ref().and_then(|report| report.get("case")?.as_str()) {
        Some(name) if name == case => Ok(there),
        Some(name) => Err(AppError::file(&numbers, format!("the report of \"{name}\""), expected)),
        None => Err(AppError::file(&numbers, "a file of another kind", expected)),
    }
}

/// Writes the report into an empty folder and returns the names of its files.
fn write(read: ReadCase, folder: &Path, options: Options, software: bool) -> Result<Vec<String>, AppError> {
    let inputs = read.case.inputs.clone();
    let Anonymous { case, doc, .. } = shown(read, options)?;
    let mut names = Vec::new();
    let mut write = |name: String, bytes: &[u8]| {
        output::write(&folder.join(&name), &inputs, bytes)?;
        names.push(name);
        Ok::<_, AppError>(())
    };
    let numbers = report::without_identity(&case, options, output::value(&measure::report(&case))?);
    write(NUMBERS.to_owned(), &output::json(&numbers)?)?;
    let all = Shown::of(&case, &doc, None);
    let numbers = terminal::with_progress(|progress| all.json(progress))?;
    let numbers = report::without_identity(&case, options, numbers);
    for format in ExportFormat::VARIANTS {
        write(all_numbers(*format), &as_file(&numbers, *format)?)?;
    }
    let mut app = painter(&case, &doc, &gpu(software)?)?;
    // A single time point has nothing to compare with.
    let panes = PaneId::all()
        .map(|pane| (pane, pane.row()))
        .filter(|(_, row)| case.time_points.len() > 1 || !row.needs_dates);
    let pictures = panes.filter_map(|(pane, row)| Some((row.cli?, Some(pane), row.report_px?)));
    for (name, pane, size) in std::iter::once(("window", None, WINDOW_PX)).chain(pictures) {
        let rgba = app.capture(pane, size, 1.0)?;
        write(format!("{name}.png"), &output::png(name, size, &rgba)?)?;
    }
    terminal::notes(&app.comparison_warnings());
    Ok(names)
}
