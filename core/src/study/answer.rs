//! Tasks, answers, and what an answer is worth.

use strum::{Display, EnumString, IntoStaticStr, VariantArray};

/// A task of the study.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Display, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "kebab-case")]
pub enum Task {
    /// Which of two marked points is nearer to the eye.
    Nearer,
    /// How deep a marked point lies between the nearest and the farthest point seen.
    Depth,
    /// Which of two structures has the larger volume.
    Larger,
    /// Whether a marked place bulges, is hollow or a saddle.
    Shape,
    /// Which of two pictures of one scene, in different light, is liked better.
    Preference,
}

/// What a participant answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// The left mark, structure or picture.
    Left,
    /// The right one.
    Right,
    /// A depth: 0 for the nearest, 100 for the farthest point seen.
    Percent(u8),
    /// The surface bulges towards the eye in every direction.
    Bulge,
    /// It is hollow in every direction.
    Hollow,
    /// It bulges in one direction and is hollow in another.
    Saddle,
}

impl Answer {
    const WORDS: [(&str, Self); 5] = [
        ("left", Self::Left),
        ("right", Self::Right),
        ("bulge", Self::Bulge),
        ("hollow", Self::Hollow),
        ("saddle", Self::Saddle),
    ];

    /// As in the file of answers.
    pub fn text(self) -> String {
        match self {
            Self::Percent(percent) => percent.to_string(),
            word => Self::WORDS.iter().find(|row| row.1 == word).map_or("", |row| row.0).to_owned(),
        }
    }

    /// The reverse of [`Answer::text`]; `None` for anything else.
    pub fn of_text(text: &str) -> Option<Self> {
        let word = Self::WORDS.iter().find(|row| row.0 == text).map(|row| row.1);
        word.or_else(|| text.parse().ok().filter(|percent| *percent <= 100).map(Self::Percent))
    }

    /// Whether it is an answer to `task`.
    pub fn is_for(self, task: Task) -> bool {
        match task {
            Task::Nearer | Task::Larger | Task::Preference => matches!(self, Self::Left | Self::Right),
            Task::Depth => matches!(self, Self::Percent(_)),
            Task::Shape => matches!(self, Self::Bulge | Self::Hollow | Self::Saddle),
        }
    }
}

/// What is true of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truth {
    /// One answer is right.
    Is(Answer),
    /// The depth in percent, 0 to 100.
    Percent(f64),
    /// A matter of taste.
    Taste,
}

/// What an answer is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Score {
    /// Whether it is right.
    Correct(bool),
    /// How far it is off, percent of the depth seen; at least 0.
    Error(f64),
    /// There is no right answer.
    Taste,
}

impl Truth {
    /// As in the file of answers: depths with one decimal; empty for a matter of taste.
    pub fn text(self) -> String {
        match self {
            Self::Is(answer) => answer.text(),
            Self::Percent(percent) => format!("{percent:.1}"),
            Self::Taste => String::new(),
        }
    }

    /// What `answer` is worth. An answer to another task is wrong, by all of the depth where that was asked for.
    pub fn score(self, answer: Answer) -> Score {
        match (self, answer) {
            (Self::Is(truth), answer) => Score::Correct(truth == answer),
            (Self::Percent(truth), Answer::Percent(percent)) => {
                Score::Error((truth - f64::from(percent)).abs())
            }
            (Self::Percent(_), _) => Score::Error(100.0),
            (Self::Taste, _) => Score::Taste,
        }
    }
}
