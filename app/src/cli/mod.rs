//! The command line: the window's numbers and pictures without a window.
//!
//! Exit codes: 0 success; 1 some cases of a cohort failed; 2 failure. Failures have one line on stderr.

mod animation;
mod arguments;
mod case;
mod change;
mod cohort;
mod ellipsoids;
mod export;
mod info;
mod lesions;
mod light;
mod measure;
mod offscreen;
mod pacs;
mod page;
mod parse;
mod register;
mod render;
mod replay;
mod report;
mod report_folder;
mod resolve;
mod response;
mod sample;
mod self_check;
mod study;
mod terminal;
mod tracts;
mod transform;
mod unused;

use std::{error::Error, process::ExitCode};

use clap::{
    Parser,
    error::{ContextKind, ContextValue, ErrorKind},
};

use glioscope_core::{
    files::{archive, dicom},
    workers,
};

pub use arguments::{Cli, Task, WindowArguments};
pub use case::CaseArguments;

use crate::{
    error::AppError,
    window::run::{self, Start},
};

/// Runs the program with this process's arguments.
pub fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|argument| argument == dicom::DECODER_ARGUMENT) {
        // Started by another process of this program, see core's `files::dicom`.
        return if dicom::serve().is_ok() { ExitCode::SUCCESS } else { ExitCode::from(2) };
    }
    if let Ok(program) = std::env::current_exe() {
        dicom::decode_frames_with(program);
    }
    glioscope_cohort::end_with_parent();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return print_clap_error(&error),
    };
    let started = workers::start().map_err(|why| {
        AppError::wrong(
            "the program",
            format!("no threads to work with ({why})"),
            "a system that allows them",
        )
    });
    let ended = started.and_then(|()| execute(cli));
    archive::remove_unpacked();
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            terminal::error(&error.to_string());
            ExitCode::from(error.exit_code())
        }
    }
}

fn execute(cli: Cli) -> Result<(), AppError> {
    match cli.task {
        None => open(&cli.case, cli.window),
        Some(Task::Open { case, window }) => open(&case, window),
        Some(Task::Info { target, json, case, cross_check }) => info::run(target, &case, json, cross_check),
        Some(Task::Measure(arguments)) => measure::run(&arguments),
        Some(Task::Lesions(arguments)) => lesions::run(&arguments),
        Some(Task::Response(arguments)) => response::run(&arguments),
        Some(Task::Ellipsoids { case, connectivity, tolerance, json }) => {
            ellipsoids::run(&case, connectivity, tolerance, json)
        }
        Some(Task::Tracts(arguments)) => tracts::run(&arguments),
        Some(Task::Change(arguments)) => change::run(&arguments),
        Some(Task::SelfCheck(arguments)) => self_check::run(&arguments),
        Some(Task::Cohort(arguments)) => cohort::run(&arguments),
        Some(Task::Export(arguments)) => export::run(&arguments),
        Some(Task::Render(arguments)) => render::run(&arguments),
        Some(Task::Report(arguments)) => report::run(&arguments),
        Some(Task::Page(arguments)) => page::run(&arguments),
        Some(Task::Replay(arguments)) => replay::run(*arguments),
        Some(Task::Transform(arguments)) => transform::run(&arguments),
        Some(Task::Register(arguments)) => register::run(&arguments),
        Some(Task::Pacs { task }) => pacs::run(task),
        Some(Task::Study(arguments)) => study::run(&arguments),
        Some(Task::Sample { out }) => sample::run(&out),
    }
}

fn open(case: &CaseArguments, window: WindowArguments) -> Result<(), AppError> {
    let WindowArguments { software, picture } = window;
    if case.parts.register.is_some() {
        return Err(AppError::wrong(
            "--register",
            "the window",
            "a command, or Tools, Align dates and images in the window",
        ));
    }
    run::run(Start {
        case: case.reference()?,
        tracts: case.tracts.clone(),
        options: case.options(),
        software,
        picture,
    })
}

/// Prints help and version unchanged, and errors as one line.
fn print_clap_error(error: &clap::Error) -> ExitCode {
    if !error.use_stderr() {
        return match terminal::print(&error.render().to_string()) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                terminal::error(&error.to_string());
                ExitCode::from(2)
            }
        };
    }
    terminal::error(&one_line(error));
    ExitCode::from(2)
}

/// What clap says of a whole number out of its range, as the range: "1 is not in 2..=4096" is 2 to 4096. Other reasons as they are.
fn range_of(reason: &str) -> String {
    match reason.split_once(" is not in ").and_then(|(_, range)| range.split_once("..=")) {
        Some((least, most)) if !least.is_empty() && !most.is_empty() => format!("{least} to {most}"),
        _ => reason.to_owned(),
    }
}

/// A clap error as one line: `--view: found "x", expected closeup, window`; other errors in clap's own words.
fn one_line(error: &clap::Error) -> String {
    let text = |kind: ContextKind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    let expected = match (error.kind(), error.get(ContextKind::ValidValue)) {
        (ErrorKind::InvalidValue, Some(ContextValue::Strings(values))) if values.is_empty() => {
            Some("a value that isn't empty".to_owned())
        }
        (ErrorKind::InvalidValue, Some(ContextValue::Strings(values))) => Some(values.join(", ")),
        (ErrorKind::ValueValidation, _) => error.source().map(|reason| range_of(&reason.to_string())),
        _ => None,
    };
    let option = text(ContextKind::InvalidArg);
    if let (Some(option), Some(found), Some(expected)) = (option, text(ContextKind::InvalidValue), expected) {
        let option = option.split_whitespace().next().unwrap_or_default();
        return format!("{option}: found \"{found}\", expected {expected}");
    }
    let rendered = error.render().to_string();
    let lines: Vec<&str> =
        rendered.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:")).collect();
    let line = lines.into_iter().filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ");
    line.strip_prefix("error: ").unwrap_or(&line).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error_line(arguments: &[&str]) -> String {
        let args = std::iter::once("glioscope").chain(arguments.iter().copied());
        let line = one_line(&Cli::try_parse_from(args).unwrap_err());
        assert!(!line.contains('\n'), "{line}");
        line
    }

    #[test]
    fn argument_errors_are_one_line() {
        let line = error_line(&["render", "--view", "nosuch"]);
        assert!(line.starts_with("--view: found \"nosuch\", expected closeup, context"), "{line}");
        let line = error_line(&["render", "--size", "0x0"]);
        assert_eq!(line, "--size: found \"0x0\", expected WIDTHxHEIGHT, each from 16 to 8192");
        let line = error_line(&["render", "--out", ""]);
        assert_eq!(line, "--out: found \"\", expected a value that isn't empty");
        let line = error_line(&["render", "--paths", "1"]);
        assert_eq!(line, "--paths: found \"1\", expected 2 to 4096");
        let line = error_line(&["measure", "--nonsense"]);
        assert!(line.contains("--nonsense"), "{line}");
        assert!(error_line(&["sample"]).contains("--out"));
    }
}
