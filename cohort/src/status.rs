//! What is kept beside a case's results: how they were made, and whether all went well.

use std::path::Path;

use glioscope_core::files::read_small;
use serde::{Deserialize, Serialize};

use crate::{
    hashes::HashedFile,
    options::{Options, Step},
};

/// Name of the file.
pub const NAME: &str = "status.json";
/// Maximum size of the file in bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Whether something was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// It was.
    Done,
    /// It failed.
    Failed,
    /// The case has nothing to compute it from: one date has no change.
    NotApplicable,
}

/// One step of a case: one process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepStatus {
    /// What it computes.
    pub step: Step,
    /// The file or folder that it writes, within the case's results; null where it wrote none.
    pub output: Option<String>,
    /// Whether it did.
    pub state: State,
    /// How long it took.
    pub seconds: f64,
    /// Most memory that its process had in MiB, sampled; null where the system doesn't tell.
    pub peak_mb: Option<f64>,
    /// Its exit code; null where it was ended by a signal or didn't start.
    pub exit_code: Option<i64>,
    /// Why it failed, in one line.
    pub error: Option<String>,
}

/// How a case's results were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseStatus {
    /// Version of the program.
    pub glioscope: String,
    /// The case's name within the cohort.
    pub case: String,
    /// What was opened: a folder, manifest, archive, image or session; absolute. Empty in results that don't say it.
    #[serde(default)]
    pub path: String,
    /// `failed` where any step failed; the results of the others are there.
    pub state: State,
    /// What was computed, and how.
    pub options: Options,
    /// The files it was computed from, sorted by path.
    pub inputs: Vec<HashedFile>,
    /// The steps in their order.
    pub steps: Vec<StepStatus>,
    /// The files that were written, without this one and the log, sorted by path.
    pub results: Vec<HashedFile>,
}

impl CaseStatus {
    /// The status of the results in `folder`; `None` where there is none that can be read.
    pub fn read(folder: &Path) -> Option<Self> {
        let bytes = read_small(&folder.join(NAME), MAX_BYTES, "a status").ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Whether the results in `folder` are complete and were made by this version, with these options, from these inputs.
    pub fn is_current(&self, folder: &Path, version: &str, options: &Options, inputs: &[HashedFile]) -> bool {
        let is_whole = |file: &HashedFile| {
            std::fs::metadata(folder.join(&file.path)).is_ok_and(|found| found.len() == file.bytes)
        };
        self.state == State::Done
            && self.glioscope == version
            && self.options == *options
            && self.inputs == inputs
            && self.results.iter().all(is_whole)
    }

    /// The first step that failed.
    pub fn failure(&self) -> Option<&StepStatus> {
        self.steps.iter().find(|step| step.state == State::Failed)
    }
}
