//! `glioscope study`: the study of perception in a window, and the statistics of its answers.

use std::{fmt::Write, path::PathBuf};

use clap::{Args, Subcommand};
use glioscope_cohort::{Measure, MeasureReport, StudyReport, analyse_study, read_answers};
use glioscope_core::study::{Design, MAX_LIGHTS, Task};
use glioscope_render::{LightingMode, Preset, light::LIGHTS};
use strum::VariantArray;

use super::{parse::keyword, terminal};
use crate::{
    error::AppError,
    study::{Settings, Study, pictures::default_lights, robot},
    window::study,
    words::Language,
};

/// Arguments of `study`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct StudyArguments {
    /// What is done instead of the study.
    #[command(subcommand)]
    pub task: Option<StudyTask>,
    /// Number of the participant: which trials, in which order. No names.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=999_999))]
    pub participant: Option<u32>,
    /// File of the answers (.csv): a new one, or the participant's own, which goes on where it stops.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Fixes the scenes: the same for all participants of a study.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// The lights that are compared; default: all that shade smooth surfaces.
    #[arg(long, value_name = "MODE,...", value_delimiter = ',', value_parser = keyword::<LightingMode>())]
    pub lights: Vec<LightingMode>,
    /// The tasks in their order; default: all.
    #[arg(long, value_name = "TASK,...", value_delimiter = ',', value_parser = keyword::<Task>())]
    pub tasks: Vec<Task>,
    /// How often each light is seen in each task.
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=60))]
    pub repeats: u32,
    /// Pictures for practice before each task.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=20))]
    pub practice: u32,
    /// Quality preset of the lights.
    #[arg(long, value_name = "PRESET", default_value = "balanced", value_parser = keyword::<Preset>())]
    pub quality: Preset,
    /// Side of the pictures in pixels: 128 to 4096.
    #[arg(long, value_name = "N", default_value_t = 768, value_parser = clap::value_parser!(u32).range(128..=4096))]
    pub picture_px: u32,
    /// Language of the pages.
    #[arg(long, value_enum, default_value = "en")]
    pub language: Language,
    /// On a dark background.
    #[arg(long)]
    pub dark: bool,
    /// Use only the software graphics adapter.
    #[arg(long)]
    pub software: bool,
    /// Let a robot answer, without a window and without pictures: for tests.
    #[arg(long, value_name = "SEED")]
    pub robot: Option<u64>,
}

/// What else there is.
#[derive(Debug, Subcommand)]
pub enum StudyTask {
    /// Means of the lights, whether they differ (analysis of variance with repeated measures), and every two compared.
    Analyse {
        /// Files of answers of one study.
        #[arg(value_name = "FILE", required = true)]
        files: Vec<PathBuf>,
        /// As JSON: see docs/study.md.
        #[arg(long)]
        json: bool,
    },
}

/// What stands twice in a list.
fn repeated<T: Copy + PartialEq>(list: &[T]) -> Option<T> {
    list.iter().enumerate().find(|(n, one)| list[..*n].contains(one)).map(|(_, one)| *one)
}

impl StudyArguments {
    fn settings(&self) -> Result<Settings, AppError> {
        let Some(participant) = self.participant else {
            return Err(AppError::arguments("no --participant N", "the participant's number"));
        };
        let Some(out) = &self.out else {
            return Err(AppError::arguments("no --out FILE", "where the answers are written"));
        };
        if !out.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
            return Err(AppError::file(out, "another ending", "a table's name, .csv"));
        }
        let lights: Vec<LightingMode> =
            if self.lights.is_empty() { default_lights(self.quality) } else { self.lights.clone() };
        if let Some(light) = repeated(&lights) {
            return Err(AppError::option("lights", light.name(), "each light once"));
        }
        if !(2..=MAX_LIGHTS).contains(&lights.len()) {
            return Err(AppError::option("lights", lights[0].name(), "two lights or more"));
        }
        let tasks = if self.tasks.is_empty() { Task::VARIANTS.to_vec() } else { self.tasks.clone() };
        if let Some(task) = repeated(&tasks) {
            return Err(AppError::option("tasks", task.into(), "each task once"));
        }
        let design = Design {
            seed: self.seed,
            participant,
            tasks,
            lights: lights.len(),
            repeats: self.repeats,
            practice: self.practice,
        };
        Ok(Settings {
            design,
            lights,
            quality: self.quality,
            picture_px: self.picture_px,
            language: self.language,
            dark: self.dark,
            out: out.clone(),
        })
    }
}

pub(super) fn run(arguments: &StudyArguments) -> Result<(), AppError> {
    if let Some(StudyTask::Analyse { files, json }) = &arguments.task {
        let order: Vec<&str> = LIGHTS.iter().map(|row| row.mode.name()).collect();
        let report = analyse_study(&read_answers(files)?, &order);
        return if *json { terminal::print_json(&report) } else { terminal::print(&text(&report)) };
    }
    let mut study = Study::new(arguments.settings()?)?;
    let (resumed, all) = (study.resumed(), study.trials().len());
    match arguments.robot {
        Some(seed) => {
            robot::go_through(&mut study, seed)?;
            terminal::print(&format!("{} of {all} trials answered, {resumed} of them before", study.index()))
        }
        None => study::run(study, arguments.software),
    }
}

/// A probability, to three decimals.
fn p(p: f64) -> String {
    if p < 0.001 { "p < 0.001".into() } else { format!("p = {p:.3}") }
}

/// A number of a measure.
fn value(measure: Measure, value: f64) -> String {
    match measure {
        Measure::CorrectShare | Measure::PreferredShare => format!("{:.1} %", 100.0 * value),
        Measure::ErrorPercent => format!("{value:.1} %"),
        Measure::TimeS => format!("{value:.2} s"),
    }
}

/// The report as text. Writing into a string can't fail.
fn text(report: &StudyReport) -> String {
    let StudyReport { seed, participants, lights, tasks } = report;
    let mut out = format!(
        "Study of seed {seed}: {} participants, {} lights ({})",
        participants.len(),
        lights.len(),
        lights.join(", ")
    );
    for task in tasks {
        let _ = write!(out, "\n\n{}", task.task);
        if !task.practice_failed.is_empty() {
            let _ = write!(out, "\n  practice not passed by {}", numbers(&task.practice_failed));
        }
        task.measures.iter().for_each(|measure| measure_text(measure, &mut out));
        if let Some(found) = &task.score_with_time {
            let of = format!("r = {:.3}, {} ({} trials)", found.r, p(found.p), found.trials);
            let _ = write!(out, "\n  score with time: {of}");
        }
    }
    out
}

fn numbers(participants: &[u32]) -> String {
    let names: Vec<String> = participants.iter().map(ToString::to_string).collect();
    format!("participant{} {}", if names.len() == 1 { "" } else { "s" }, names.join(", "))
}

fn measure_text(report: &MeasureReport, out: &mut String) {
    let measure = report.measure;
    let name = match measure {
        Measure::CorrectShare => "correct answers",
        Measure::ErrorPercent => "error of depth",
        Measure::PreferredShare => "preferred",
        Measure::TimeS => "time",
    };
    let _ = write!(out, "\n  {name}");
    if !report.left_out.is_empty() {
        let _ = write!(out, " (without {}: no answer to some light)", numbers(&report.left_out));
    }
    for light in &report.lights {
        let mean = light.mean.map_or("unknown".into(), |mean| value(measure, mean));
        let error =
            light.standard_error.map_or(String::new(), |error| format!(" ± {}", value(measure, error)));
        let _ = write!(out, "\n    {:<14} {mean}{error}  ({} trials)", light.light, light.trials);
    }
    if let Some(why) = report.without_anova {
        let _ = write!(out, "\n    no analysis of variance: {why}");
    }
    if let Some(anova) = &report.anova {
        let _ = write!(
            out,
            "\n    F({:.0}, {:.0}) = {:.3}, {}; corrected for sphericity (epsilon {:.3}): {}; partial eta² {:.3}",
            anova.df_lights,
            anova.df_error,
            anova.f,
            p(anova.p),
            anova.epsilon,
            p(anova.p_corrected),
            anova.partial_eta_squared
        );
        if let Some(mauchly) = &anova.mauchly {
            let _ = write!(
                out,
                "\n    sphericity (Mauchly): W = {:.4}, χ²({:.0}) = {:.3}, {}",
                mauchly.w,
                mauchly.df,
                mauchly.chi_squared,
                p(mauchly.p)
            );
        }
    }
    for pair in &report.comparisons {
        let (Some(t), Some(corrected)) = (pair.t, pair.p_bonferroni) else { continue };
        let _ = write!(
            out,
            "\n    {} − {}: {}, t({:.0}) = {t:.3}, {} (Bonferroni)",
            pair.a,
            pair.b,
            value(measure, pair.difference),
            pair.df,
            p(corrected)
        );
    }
}
