//! A participant for tests: it presses the keys of a person and keeps to a clock of its own, so that its answers and times are the same
//! on every machine. It needs no pictures.

use egui::Key;
use glioscope_core::{
    optics::random::Random,
    study::{Answer, Task, Trial, Truth},
};

use super::{
    course::{Study, answer_of},
    page::{Page, Prepared},
};
use crate::error::AppError;

/// Frames of its screen.
const FRAME_S: f64 = 1.0 / 60.0;
/// Stream of its random numbers, apart from those of designs and scenes.
const STREAM: u64 = 0x526f_626f_7400_0000;

/// Goes through the whole study.
///
/// # Errors
/// [`AppError`]: no scene, or an answer that can't be written.
pub fn go_through(study: &mut Study, seed: u64) -> Result<(), AppError> {
    let participant = study.settings().design.participant;
    let mut random = Random::new(seed, STREAM | u64::from(participant));
    // How good and how fast this participant is.
    let (skill, pace) = (random.unit() * 0.2 - 0.1, 0.7 + 0.8 * random.unit());
    // Answers that were there are gone through without being given.
    let mut now_s = 0.0;
    loop {
        now_s += FRAME_S;
        match study.page().clone() {
            Page::Done | Page::Left => return Ok(()),
            Page::Failed(why) => {
                return Err(AppError::wrong("the study", why, "answers that can be written"));
            }
            Page::Wait { .. } => {
                let (Some(trial), None) = (study.trial(), study.prepared()) else {
                    study.tick(now_s);
                    continue;
                };
                let scene = study.settings().scene(trial)?;
                study.prepare(Prepared { scene, pictures: Vec::new() });
            }
            Page::Shown { .. } => {
                study.drawn(now_s);
                let (Some(trial), Some(prepared)) = (study.trial().copied(), study.prepared()) else {
                    return Ok(());
                };
                let truth = prepared.scene.truth;
                let answer = answered(&trial, truth, skill, &mut random);
                now_s += pace * (1.0 + 0.15 * trial.light as f64) * (1.0 + 2.0 * random.unit());
                for key in keys(trial.task, answer) {
                    study.press(key, false, now_s);
                }
            }
            _ => study.press(Key::Space, false, now_s),
        }
    }
}

/// What it answers: later lights are better ones to it.
fn answered(trial: &Trial, truth: Truth, skill: f64, random: &mut Random) -> Answer {
    let chance = (0.55 + skill + 0.07 * trial.light as f64).clamp(0.0, 1.0);
    let (is_right, other) = (random.unit() < chance, random.unit());
    match truth {
        Truth::Is(answer) if is_right => answer,
        Truth::Is(answer) => {
            let all = match trial.task {
                Task::Shape => &[Answer::Bulge, Answer::Hollow, Answer::Saddle][..],
                _ => &[Answer::Left, Answer::Right],
            };
            let wrong: Vec<Answer> = all.iter().copied().filter(|one| *one != answer).collect();
            wrong[((wrong.len() as f64 * other) as usize).min(wrong.len() - 1)]
        }
        Truth::Percent(percent) => {
            let off = (other - 0.5) * 80.0 * (1.2 - chance);
            Answer::Percent((percent + off).round().clamp(0.0, 100.0) as u8)
        }
        Truth::Taste => {
            let liked = trial.other.is_some_and(|other| trial.light > other);
            if liked == (is_right || other < 0.3) { Answer::Left } else { Answer::Right }
        }
    }
}

/// The keys that give an answer.
fn keys(task: Task, answer: Answer) -> Vec<Key> {
    let digits =
        [Key::Num0, Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8];
    if let Answer::Percent(percent) = answer {
        let tens = usize::from(percent / 10).min(digits.len() - 1);
        let rest = usize::from(percent) - 10 * tens;
        return std::iter::once(digits[tens])
            .chain(std::iter::repeat_n(Key::ArrowRight, rest))
            .chain([Key::Enter])
            .collect();
    }
    let arrows = [Key::ArrowLeft, Key::ArrowRight, Key::ArrowUp, Key::ArrowDown];
    arrows.into_iter().find(|key| answer_of(task, *key) == Some(answer)).into_iter().collect()
}
