//! The course of a study: pages, keys, answers.

use std::path::PathBuf;

use egui::Key;
use glioscope_core::study::{Answer, Design, Record, Scene, Task, Trial, Truth};
use glioscope_render::{LightingMode, Preset};

use super::{
    answers::AnswerFile,
    page::{Page, Prepared},
};
use crate::{error::AppError, words::Language};

/// How long the cross is shown at least, seconds.
const CROSS_S: f64 = 0.6;
/// Where the marker of depth starts from, percent.
const MIDDLE: u8 = 50;

/// How a study is made.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Which trials, in which order; its lights are as many as `lights`.
    pub design: Design,
    /// The lights.
    pub lights: Vec<LightingMode>,
    /// Their quality.
    pub quality: Preset,
    /// Side of a picture in pixels.
    pub picture_px: u32,
    /// Language of what is said.
    pub language: Language,
    /// Dark instead of light.
    pub dark: bool,
    /// The file of answers.
    pub out: PathBuf,
}

impl Settings {
    /// The scene of a trial.
    ///
    /// # Errors
    /// [`AppError`] where the seed has none, which was found with no seed.
    pub fn scene(&self, trial: &Trial) -> Result<Scene, AppError> {
        Scene::of(trial, self.design.seed, self.lights.len()).ok_or_else(|| {
            let found = format!(
                "{}, for which scene {} of {} can't be arranged",
                self.design.seed, trial.scene, trial.task
            );
            AppError::wrong("--seed", found, "another seed")
        })
    }
}

/// A participant's way through a study. Times are seconds of one clock that never goes back.
pub struct Study {
    settings: Settings,
    trials: Vec<Trial>,
    /// The trial that is shown, or the next one.
    at: usize,
    /// Answers that were there.
    resumed: usize,
    page: Page,
    pauses: bool,
    prepared: Option<Prepared>,
    unwritten: Option<(Record, Truth)>,
    file: AnswerFile,
}

impl Study {
    /// The study from the first trial that has no answer in the file.
    ///
    /// # Errors
    /// [`AppError`]: the file is none of this participant's answers, or can't be written.
    pub fn new(settings: Settings) -> Result<Self, AppError> {
        let trials = settings.design.trials();
        let file = AnswerFile::open(&settings.out, |at, record| {
            let Some(trial) = trials.get(at) else { return false };
            is_of(record, trial, &settings)
        })?;
        let at = file.count();
        let page = if at < trials.len() { Page::Welcome } else { Page::Done };
        Ok(Self {
            trials,
            at,
            resumed: at,
            page,
            pauses: false,
            prepared: None,
            unwritten: None,
            file,
            settings,
        })
    }

    /// How it is made.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// All trials.
    pub fn trials(&self) -> &[Trial] {
        &self.trials
    }

    /// The page that is shown.
    pub fn page(&self) -> &Page {
        &self.page
    }

    /// The trial that is shown, or the next one; `None` at the end.
    pub fn trial(&self) -> Option<&Trial> {
        self.trials.get(self.at)
    }

    /// Which trial that is, counted from 0.
    pub fn index(&self) -> usize {
        self.at
    }

    /// Number of answers that were there at the start.
    pub fn resumed(&self) -> usize {
        self.resumed
    }

    /// Whether it pauses after this picture.
    pub fn pauses(&self) -> bool {
        self.pauses
    }

    /// What the trial shows.
    pub fn prepared(&self) -> Option<&Prepared> {
        self.prepared.as_ref()
    }

    /// Takes what trial [`Study::index`] shows.
    pub fn prepare(&mut self, prepared: Prepared) {
        self.prepared = Some(prepared);
    }

    /// Turns to the picture once it is prepared and the cross was shown long enough. Seconds until it can, at the earliest.
    pub fn tick(&mut self, now_s: f64) -> Option<f64> {
        let Page::Wait { since_s } = self.page else { return None };
        let left = since_s + CROSS_S - now_s;
        if left > 0.0 {
            return Some(left);
        }
        if self.prepared.is_some() {
            self.page = Page::Shown { since_s: None, percent: None };
        }
        None
    }

    /// The picture is on the screen: its time starts.
    pub fn drawn(&mut self, now_s: f64) {
        if let Page::Shown { since_s, .. } = &mut self.page {
            since_s.get_or_insert(now_s);
        }
    }

    /// A key was pressed, or repeats while it is held.
    pub fn press(&mut self, key: Key, repeats: bool, now_s: f64) {
        if key == Key::Escape && !repeats {
            self.page = if self.page == Page::Done { Page::Done } else { Page::Left };
            return;
        }
        let goes_on = key == Key::Space && !repeats;
        match self.page.clone() {
            Page::Welcome if goes_on => self.page = Page::Task,
            Page::Task | Page::Counts | Page::Paused if goes_on => self.page = Page::Wait { since_s: now_s },
            Page::Wait { .. } if goes_on => self.page = Page::Paused,
            Page::Feedback { .. } if goes_on => self.advance(now_s),
            Page::Failed(_) if goes_on => self.write(now_s),
            Page::Shown { since_s: Some(_), .. } if goes_on => self.pauses = !self.pauses,
            Page::Shown { since_s: Some(since_s), percent } => {
                self.answer(key, repeats, (since_s, percent), now_s);
            }
            _ => {}
        }
    }

    fn answer(&mut self, key: Key, repeats: bool, (since_s, percent): (f64, Option<u8>), now_s: f64) {
        let Some(trial) = self.trial().copied() else { return };
        let answer = if trial.task == Task::Depth {
            match (key, percent) {
                (Key::Enter, Some(percent)) if !repeats => Some(Answer::Percent(percent)),
                (key, percent) => {
                    if let Some(moved) = moved(key, percent) {
                        self.page = Page::Shown { since_s: Some(since_s), percent: Some(moved) };
                    }
                    None
                }
            }
        } else {
            // A key that is still held from the picture before is no answer.
            answer_of(trial.task, key).filter(|_| !repeats)
        };
        let (Some(answer), Some(prepared)) = (answer, &self.prepared) else { return };
        let truth = prepared.scene.truth;
        let name = |light: usize| self.settings.lights.get(light).map_or("", |mode| mode.name()).to_owned();
        let record = Record {
            participant: self.settings.design.participant,
            seed: self.settings.design.seed,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            task: trial.task,
            trial: trial.number,
            practice: trial.practice,
            light: name(trial.light),
            other_light: trial.other.map(name).unwrap_or_default(),
            scene: trial.scene,
            difference: prepared.scene.difference,
            truth: truth.text(),
            answer,
            score: truth.score(answer),
            time_s: (now_s - since_s).max(0.0),
        };
        self.unwritten = Some((record, truth));
        self.write(now_s);
    }

    /// Writes the answer, and goes on if that succeeds.
    fn write(&mut self, now_s: f64) {
        let Some((record, truth)) = &self.unwritten else { return };
        if let Err(error) = self.file.add(record.clone()) {
            self.page = Page::Failed(error.to_string());
            return;
        }
        let (answer, truth, practice) = (record.answer, *truth, record.practice);
        self.unwritten = None;
        self.prepared = None;
        if practice && truth != Truth::Taste {
            self.page = Page::Feedback { answer, truth };
        } else {
            self.advance(now_s);
        }
    }

    fn advance(&mut self, now_s: f64) {
        let before = self.trial().copied();
        self.at += 1;
        let pauses = std::mem::take(&mut self.pauses);
        self.page = match (before, self.trial()) {
            (_, None) => Page::Done,
            (Some(before), Some(next)) if before.task != next.task => Page::Task,
            (Some(before), Some(next)) if before.practice && !next.practice => Page::Counts,
            _ if pauses => Page::Paused,
            _ => Page::Wait { since_s: now_s },
        };
    }
}

/// Whether a record is the answer to a trial of this study.
fn is_of(record: &Record, trial: &Trial, settings: &Settings) -> bool {
    let name = |light: usize| settings.lights.get(light).map_or("", |mode| mode.name());
    record.participant == settings.design.participant
        && record.seed == settings.design.seed
        && record.program == env!("CARGO_PKG_VERSION")
        && record.task == trial.task
        && record.trial == trial.number
        && record.practice == trial.practice
        && record.scene == trial.scene
        && record.light == name(trial.light)
        && record.other_light == trial.other.map_or("", name)
}

/// The answer that a key gives at once; none for depth, which is chosen and then confirmed.
pub(super) fn answer_of(task: Task, key: Key) -> Option<Answer> {
    match (task, key) {
        (Task::Depth, _) => None,
        (Task::Shape, Key::ArrowUp | Key::Num1) => Some(Answer::Bulge),
        (Task::Shape, Key::ArrowDown | Key::Num2) => Some(Answer::Hollow),
        (Task::Shape, Key::ArrowLeft | Key::ArrowRight | Key::Num3) => Some(Answer::Saddle),
        (Task::Shape, _) => None,
        (_, Key::ArrowLeft | Key::Num1) => Some(Answer::Left),
        (_, Key::ArrowRight | Key::Num2) => Some(Answer::Right),
        _ => None,
    }
}

/// The depth after a key: arrows move by one and by ten, a digit chooses its tens.
fn moved(key: Key, percent: Option<u8>) -> Option<u8> {
    let from = i16::from(percent.unwrap_or(MIDDLE));
    let digits = [
        Key::Num0,
        Key::Num1,
        Key::Num2,
        Key::Num3,
        Key::Num4,
        Key::Num5,
        Key::Num6,
        Key::Num7,
        Key::Num8,
        Key::Num9,
    ];
    let to = match key {
        Key::ArrowLeft => from - 1,
        Key::ArrowRight => from + 1,
        Key::ArrowDown => from - 10,
        Key::ArrowUp => from + 10,
        _ => 10 * digits.iter().position(|digit| *digit == key)? as i16,
    };
    Some(to.clamp(0, 100) as u8)
}
