//! A cohort: the cases of a data set, each measured by processes of its own, and tables of what all of them answered.
//!
//! [`find`] lists the cases of a folder or table. [`run()`] computes each: every step is the program's own subcommand in a child
//! process, and a case's folder is put in place whole. [`group()`] reads these folders and writes tables, with [`rank`] between
//! algorithms where a reference is named.
//!
//! [`analyse_study`] has the statistics of a study of perception, which needs the same crate of distributions.

mod cases;
#[cfg(test)]
mod cases_tests;
mod collected;
#[cfg(test)]
mod collected_tests;
mod error;
mod group;
mod hashes;
mod options;
mod place;
mod process;
pub mod rank;
mod run;
#[cfg(target_os = "linux")]
#[cfg(test)]
mod run_tests;
mod status;
mod steps;
mod study;
mod tables;
mod verdicts;

pub use cases::{CohortCase, find};
pub use collected::{Collected, Date, MOST_MASKS, Offered, Overlaps, Quantity, Reduce};
pub use error::CohortError;
pub use group::{Grouped, Ranking, group};
pub use options::{Options, Step};
pub use place::Place;
pub use process::{end_with_parent, is_of_cohort};
pub use run::{Outcome, Resources, Said, Summary, run};
pub use status::{CaseStatus, State, StepStatus};
pub use study::{
    Anova, Comparison, Correlation, LightMean, Mauchly, Measure, MeasureReport, StudyReport, TaskReport,
    analyse_study, read_answers,
};
pub use tables::{Column, Dictionary, KINDS, Kind, Type};
pub use verdicts::{Agreement, Judgement, Verdict, Verdicts, agreement, hidden_order};
