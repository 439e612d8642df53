//! The file of answers: a CSV table with a row for each.

use csv::ReaderBuilder;

use super::answer::{Answer, Score, Task};

/// Its columns.
pub const COLUMNS: [&str; 15] = [
    "participant",
    "seed",
    "program",
    "task",
    "trial",
    "practice",
    "light",
    "other_light",
    "scene",
    "difference",
    "truth",
    "answer",
    "correct",
    "error_percent",
    "time_s",
];

/// An answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The participant's number.
    pub participant: u32,
    /// Fixes the scenes.
    pub seed: u64,
    /// Version of the program.
    pub program: String,
    /// The task.
    pub task: Task,
    /// Number of the trial within its task, from 1.
    pub trial: u32,
    /// Whether it was for practice.
    pub practice: bool,
    /// Name of the light, of the left picture where there were two.
    pub light: String,
    /// Name of the right picture's light; empty where there was one picture.
    pub other_light: String,
    /// Number of the scene.
    pub scene: u32,
    /// How easy the scene is: see [`super::Scene::difference`].
    pub difference: f64,
    /// The truth, see [`super::Truth::text`].
    pub truth: String,
    /// The answer.
    pub answer: Answer,
    /// What it is worth.
    pub score: Score,
    /// From the picture to the key that answered, seconds.
    pub time_s: f64,
}

impl Record {
    /// The fields in the order of [`COLUMNS`].
    pub fn fields(&self) -> [String; COLUMNS.len()] {
        let (correct, error) = match self.score {
            Score::Correct(is) => (u8::from(is).to_string(), String::new()),
            Score::Error(percent) => (String::new(), format!("{percent:.1}")),
            Score::Taste => (String::new(), String::new()),
        };
        [
            self.participant.to_string(),
            self.seed.to_string(),
            self.program.clone(),
            self.task.to_string(),
            self.trial.to_string(),
            u8::from(self.practice).to_string(),
            self.light.clone(),
            self.other_light.clone(),
            self.scene.to_string(),
            format!("{:.4}", self.difference),
            self.truth.clone(),
            self.answer.text(),
            correct,
            error,
            format!("{:.3}", self.time_s),
        ]
    }

    /// From fields in the order of [`COLUMNS`]; the name of the first column that is wrong.
    fn of_fields(fields: &csv::StringRecord) -> Result<Self, &'static str> {
        let field = |at: usize| fields.get(at).ok_or(COLUMNS[at]);
        fn parsed<T: std::str::FromStr>(text: &str, at: usize) -> Result<T, &'static str> {
            text.parse().map_err(|_| COLUMNS[at])
        }
        fn number(text: &str, at: usize) -> Result<f64, &'static str> {
            parsed(text, at)
                .and_then(|n: f64| if n.is_finite() && n >= 0.0 { Ok(n) } else { Err(COLUMNS[at]) })
        }
        let flag = |at: usize| match field(at)? {
            "0" => Ok(false),
            "1" => Ok(true),
            _ => Err(COLUMNS[at]),
        };
        let task: Task = parsed(field(3)?, 3)?;
        let answer = Answer::of_text(field(11)?).filter(|answer| answer.is_for(task)).ok_or(COLUMNS[11])?;
        let score = match task {
            Task::Nearer | Task::Larger | Task::Shape => Score::Correct(flag(12)?),
            Task::Depth => Score::Error(number(field(13)?, 13)?),
            Task::Preference => Score::Taste,
        };
        let (light, other_light) = (field(6)?.to_owned(), field(7)?.to_owned());
        if light.is_empty() {
            return Err(COLUMNS[6]);
        }
        if other_light.is_empty() == (task == Task::Preference) || light == other_light {
            return Err(COLUMNS[7]);
        }
        Ok(Self {
            participant: parsed(field(0)?, 0)?,
            seed: parsed(field(1)?, 1)?,
            program: field(2)?.to_owned(),
            task,
            trial: parsed(field(4)?, 4)?,
            practice: flag(5)?,
            light,
            other_light,
            scene: parsed(field(8)?, 8)?,
            difference: number(field(9)?, 9)?,
            truth: field(10)?.to_owned(),
            answer,
            score,
            time_s: number(field(14)?, 14)?,
        })
    }
}

/// The answers in the text of a file.
///
/// # Errors
/// What was found, and what was expected.
pub fn records(text: &str) -> Result<Vec<Record>, (String, String)> {
    let mut reader =
        ReaderBuilder::new().flexible(true).from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let head = reader.headers().map(|head| head.iter().map(str::to_owned).collect::<Vec<_>>());
    if head.ok().is_none_or(|head| head != COLUMNS) {
        return Err(("another first line".into(), COLUMNS.join(",")));
    }
    let mut all = Vec::new();
    // csv counts the lines of a file with CRLF from the line end before; no field of ours has one.
    for (line, row) in (2..).zip(reader.records()) {
        let row = row.map_err(|e| (format!("rows that can't be read ({e})"), "CSV".to_owned()))?;
        let record = Record::of_fields(&row).map_err(|column| {
            let at = COLUMNS.iter().position(|name| *name == column).unwrap_or(0);
            let shown: String = row.get(at).unwrap_or_default().chars().take(40).collect();
            (
                format!("\"{}\" as {column} in line {line}", shown.escape_debug()),
                "what Glioscope writes there".to_owned(),
            )
        })?;
        all.push(record);
    }
    Ok(all)
}
