//! The statistics of a study of perception (`glioscope study analyse`), as in chapter 6 of the thesis: means of each participant for each
//! light, an analysis of variance over them, and paired comparisons. The answers are core's [`Record`]s.

mod anova;
mod paired;
#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use glioscope_core::{
    files::read_small_text,
    study::{Record, Score, Task, records},
};
use serde::Serialize;
use strum::VariantArray;

pub use anova::{Anova, Mauchly};
pub use paired::{Comparison, Correlation};

use crate::CohortError;

/// Maximum size of a file of answers.
const MAX_BYTES: u64 = 64 << 20;

/// The statistics of a study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StudyReport {
    /// Fixes the scenes.
    pub seed: u64,
    /// Numbers of the participants.
    pub participants: Vec<u32>,
    /// Names of the lights.
    pub lights: Vec<String>,
    /// Each task that has answers.
    pub tasks: Vec<TaskReport>,
}

/// The statistics of a task.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TaskReport {
    /// The task.
    pub task: &'static str,
    /// Participants with a wrong answer in its practice; of depth with one that is off by 25 percent or more.
    pub practice_failed: Vec<u32>,
    /// What was measured.
    pub measures: Vec<MeasureReport>,
    /// Of a trial's score (1 for a correct answer, or the error) with its time; null without a right answer, or where one never varies.
    pub score_with_time: Option<Correlation>,
}

/// The statistics of a measure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeasureReport {
    /// What is measured.
    pub measure: Measure,
    /// Participants that lack an answer to a light: left out of everything here.
    pub left_out: Vec<u32>,
    /// Means of each light.
    pub lights: Vec<LightMean>,
    /// Whether lights differ; null where it can't be said.
    pub anova: Option<Anova>,
    /// Why there is none.
    pub without_anova: Option<&'static str>,
    /// Every two lights.
    pub comparisons: Vec<Comparison>,
}

/// A measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, strum::Display)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Measure {
    /// Share of correct answers.
    CorrectShare,
    /// Error of the depth, percent of the depth seen.
    ErrorPercent,
    /// Share of the pairs in which the light was preferred.
    PreferredShare,
    /// Time of an answer, seconds.
    TimeS,
}

/// The mean of a light over participants.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightMean {
    /// The light.
    pub light: String,
    /// Trials behind it.
    pub trials: usize,
    /// Mean of the participants' means; null without a participant.
    pub mean: Option<f64>,
    /// Its standard error over participants; null with fewer than two.
    pub standard_error: Option<f64>,
}

/// The answers of some files.
///
/// # Errors
/// [`CohortError`]: a file that can't be read or is no file of answers, two answers to one trial, answers to several studies.
pub fn read_answers(files: &[impl AsRef<Path>]) -> Result<Vec<Record>, CohortError> {
    let expected = "answers as glioscope study writes them";
    let (mut all, mut seen) = (Vec::<Record>::new(), BTreeSet::new());
    for path in files {
        let path = path.as_ref();
        let text = read_small_text(path, MAX_BYTES, expected)?;
        let own = records(&text).map_err(|(found, expected)| CohortError::at(path, found, expected))?;
        for record in own {
            if let Some(first) = all.first().filter(|first| first.seed != record.seed) {
                let found = format!(
                    "answers to the study of seed {}, after those of seed {}",
                    record.seed, first.seed
                );
                return Err(CohortError::at(path, found, "answers to one study"));
            }
            if !seen.insert((record.participant, record.task, record.practice, record.trial)) {
                let Record { participant, task, trial, .. } = record;
                let found =
                    format!("trial {trial} of {task} answered by participant {participant} a second time");
                return Err(CohortError::at(path, found, "each trial once"));
            }
            all.push(record);
        }
    }
    Ok(all)
}

/// A number of one participant and light.
struct Number<'a> {
    participant: u32,
    light: &'a str,
    value: f64,
}

/// The numbers of a measure in the counted trials of a task.
fn numbers<'a>(of: &[&'a Record], measure: Measure) -> Vec<Number<'a>> {
    let number = |record: &'a Record, light, value| Number { participant: record.participant, light, value };
    let of_record = |record: &&'a Record| -> Vec<Number<'a>> {
        let (light, other) = (record.light.as_str(), record.other_light.as_str());
        match (measure, record.score) {
            (Measure::CorrectShare, Score::Correct(is)) => {
                vec![number(record, light, f64::from(u8::from(is)))]
            }
            (Measure::ErrorPercent, Score::Error(percent)) => vec![number(record, light, percent)],
            (Measure::PreferredShare, Score::Taste) => {
                let left = f64::from(u8::from(record.answer == glioscope_core::study::Answer::Left));
                vec![number(record, light, left), number(record, other, 1.0 - left)]
            }
            // A pair of pictures has no light of its own.
            (Measure::TimeS, Score::Correct(_) | Score::Error(_)) => {
                vec![number(record, light, record.time_s)]
            }
            _ => Vec::new(),
        }
    };
    of.iter().flat_map(of_record).collect()
}

fn measured(of: &[&Record], measure: Measure, lights: &[String]) -> MeasureReport {
    let mut cells = BTreeMap::<(u32, &str), (f64, usize)>::new();
    for Number { participant, light, value } in numbers(of, measure) {
        let (sum, count) = cells.entry((participant, light)).or_default();
        (*sum, *count) = (*sum + value, *count + 1);
    }
    let participants: BTreeSet<u32> = of.iter().map(|record| record.participant).collect();
    let row = |participant: &u32| -> Option<Vec<(f64, usize)>> {
        lights.iter().map(|light| cells.get(&(*participant, light.as_str())).copied()).collect()
    };
    let left_out = participants.iter().copied().filter(|participant| row(participant).is_none()).collect();
    let complete: Vec<Vec<(f64, usize)>> = participants.iter().filter_map(row).collect();
    let rows: Vec<Vec<f64>> =
        complete.iter().map(|row| row.iter().map(|(sum, count)| sum / *count as f64).collect()).collect();
    let of_light = |(at, light): (usize, &String)| {
        let n = rows.len() as f64;
        let mean = rows.iter().map(|row| row[at]).sum::<f64>() / n;
        let squares = rows.iter().map(|row| (row[at] - mean).powi(2)).sum::<f64>();
        LightMean {
            light: light.clone(),
            trials: complete.iter().map(|row| row[at].1).sum(),
            mean: Some(mean).filter(|_| !rows.is_empty()),
            standard_error: (rows.len() > 1).then(|| (squares / (n - 1.0) / n).sqrt()),
        }
    };
    let found = anova::anova(&rows);
    MeasureReport {
        measure,
        left_out,
        lights: lights.iter().enumerate().map(of_light).collect(),
        without_anova: found.as_ref().err().copied(),
        anova: found.ok(),
        comparisons: paired::comparisons(&rows, lights),
    }
}

/// The statistics of `answers`. Lights stand in the order of `order`, others behind them.
pub fn analyse_study(answers: &[Record], order: &[&str]) -> StudyReport {
    let rank =
        |light: &str| (order.iter().position(|name| *name == light).unwrap_or(order.len()), light.to_owned());
    let of_task = |task: &Task| {
        let of: Vec<&Record> = answers.iter().filter(|record| record.task == *task).collect();
        let (practice, counted): (Vec<&Record>, Vec<&Record>) =
            of.into_iter().partition(|record| record.practice);
        if counted.is_empty() {
            return None;
        }
        let names: BTreeSet<(usize, String)> = counted
            .iter()
            .flat_map(|record| [&record.light, &record.other_light])
            .filter(|light| !light.is_empty())
            .map(|light| rank(light))
            .collect();
        let lights: Vec<String> = names.into_iter().map(|(_, name)| name).collect();
        let measures: &[Measure] = match task {
            Task::Nearer | Task::Larger | Task::Shape => &[Measure::CorrectShare, Measure::TimeS],
            Task::Depth => &[Measure::ErrorPercent, Measure::TimeS],
            Task::Preference => &[Measure::PreferredShare],
        };
        let failed = |record: &&&Record| match record.score {
            Score::Correct(is) => !is,
            Score::Error(percent) => percent >= 25.0,
            Score::Taste => false,
        };
        let scored: Vec<[f64; 2]> = counted
            .iter()
            .filter_map(|record| match record.score {
                Score::Correct(is) => Some([f64::from(u8::from(is)), record.time_s]),
                Score::Error(percent) => Some([percent, record.time_s]),
                Score::Taste => None,
            })
            .collect();
        let practice_failed: BTreeSet<u32> =
            practice.iter().filter(failed).map(|record| record.participant).collect();
        Some(TaskReport {
            task: (*task).into(),
            practice_failed: practice_failed.into_iter().collect(),
            measures: measures.iter().map(|measure| measured(&counted, *measure, &lights)).collect(),
            score_with_time: paired::correlation(&scored),
        })
    };
    let participants: BTreeSet<u32> = answers.iter().map(|record| record.participant).collect();
    let lights: BTreeSet<(usize, String)> = answers
        .iter()
        .flat_map(|record| [&record.light, &record.other_light])
        .filter(|light| !light.is_empty())
        .map(|light| rank(light))
        .collect();
    StudyReport {
        seed: answers.first().map_or(0, |record| record.seed),
        participants: participants.into_iter().collect(),
        lights: lights.into_iter().map(|(_, name)| name).collect(),
        tasks: Task::VARIANTS.iter().filter_map(of_task).collect(),
    }
}
