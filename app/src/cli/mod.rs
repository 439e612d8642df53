//! The command line: the same numbers and pictures without a window.
//!
//! Exit codes: 0 done, 1 the answer is "not so" where a command asks, 2 wrong input, with one line
//! on stderr.

mod accuracy;
mod arguments;
mod change;
mod ellipsoids;
mod info;
mod light;
mod measure;
mod render;
mod report;
mod sample;
mod terminal;
mod tracts;

use std::process::ExitCode;

use clap::Parser;
use glioscope_core::{case::CaseError, files::FileError};

pub use arguments::{CaseArguments, Cli, Task, WindowArguments};

use crate::run_window::{self, Start};

/// One line for stderr; the program ends with exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Failure(String);

impl From<String> for Failure {
    fn from(line: String) -> Self {
        Self(line)
    }
}

impl From<CaseError> for Failure {
    fn from(error: CaseError) -> Self {
        Self(error.to_string())
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Self(error.to_string())
    }
}

/// Runs the program with this process's arguments.
pub fn main() -> ExitCode {
    match run(Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(line)) => {
            terminal::error(&line);
            ExitCode::from(2)
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    match cli.task {
        None => open(&cli.case, cli.window),
        Some(Task::Open { case, window }) => open(&case, window),
        Some(Task::Info { target, json, case }) => info::run(target, &case, json),
        Some(Task::Measure { case, json }) => measure::run(&case, json),
        Some(Task::Ellipsoids { case, connectivity, tolerance, json }) => {
            ellipsoids::run(&case, connectivity, tolerance, json)
        }
        Some(Task::Tracts(arguments)) => tracts::run(&arguments),
        Some(Task::Change(arguments)) => change::run(&arguments),
        Some(Task::Accuracy(arguments)) => accuracy::run(&arguments),
        Some(Task::Render(arguments)) => render::run(&arguments),
        Some(Task::Report { case, out, software }) => report::run(&case, &out, software),
        Some(Task::Sample { out }) => sample::run(&out),
    }
}

fn open(case: &CaseArguments, window: WindowArguments) -> Result<(), Failure> {
    let WindowArguments { software, picture } = window;
    let start = Start {
        case: case.reference()?,
        tracts: case.tracts.clone(),
        options: case.options(),
        software,
        picture,
    };
    run_window::run(start).map_err(Failure)
}

/// One line on stderr, for what goes wrong while a window is scripted.
pub fn say_error(line: &str) {
    terminal::error(line);
}
