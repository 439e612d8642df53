//! The pages of a study, and what a trial shows.

use egui::ColorImage;
use glioscope_core::study::{Answer, Scene, Truth};

/// What is shown.
#[derive(Clone, Debug, PartialEq)]
pub enum Page {
    /// What the study is.
    Welcome,
    /// What the task asks.
    Task,
    /// Practice is over.
    Counts,
    /// A cross, until the picture is there and for a moment at least. Seconds of the course's clock.
    Wait {
        /// Since when.
        since_s: f64,
    },
    /// The picture.
    Shown {
        /// Since when it is on the screen; `None` until it is drawn.
        since_s: Option<f64>,
        /// The depth chosen so far.
        percent: Option<u8>,
    },
    /// What would have been right, in practice.
    Feedback {
        /// What was answered.
        answer: Answer,
        /// What is true.
        truth: Truth,
    },
    /// Until a key.
    Paused,
    /// The answer couldn't be written; why.
    Failed(String),
    /// Everything is answered.
    Done,
    /// The participant has left.
    Left,
}

/// A trial's scene and its pictures: one, or two of preference. None for a robot.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The scene.
    pub scene: Scene,
    /// From left to right.
    pub pictures: Vec<ColorImage>,
}
