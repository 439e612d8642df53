//! Animations of a view as files: the camera turned once about the patient's axis, the dates one after the other.

mod gif;
mod mp4;
mod palette;

use std::path::Path;

use glioscope_core::Progress;

use crate::error::AppError;

/// Hundredths of a second for which a frame of a turn is shown: 20 frames a second.
const TURN_CS: u16 = 5;
/// Hundredths of a second for which a date that doesn't turn is shown.
const DATE_CS: u16 = 100;

/// What kind of file an animation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// GIF: 256 colours for the whole of it; repeated for ever.
    Gif,
    /// MP4 (H.264), encoded by the program ffmpeg.
    Mp4,
}

impl Form {
    /// The form that a file's ending means; `None` for other endings.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_string_lossy().to_lowercase();
        match ending.as_str() {
            "gif" => Some(Self::Gif),
            "mp4" => Some(Self::Mp4),
            _ => None,
        }
    }
}

/// One frame: what differs from the view as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Number of the date; `None`: the one shown.
    pub time: Option<usize>,
    /// How far the camera has turned: 0 to below 1.
    pub turn: f64,
    /// For how long it is shown, hundredths of a second.
    pub shown_cs: u16,
}

/// The frames of an animation: a turn of so many frames, the first so many dates one after the other, or a turn for each date. Where
/// neither is given, one frame.
pub fn frames(turn: Option<u32>, dates: Option<usize>) -> Vec<Frame> {
    let times: Vec<Option<usize>> = dates.map_or_else(|| vec![None], |dates| (0..dates).map(Some).collect());
    let shown_cs = if turn.is_some() { TURN_CS } else { DATE_CS };
    let steps = turn.unwrap_or(1);
    let turned = |time: Option<usize>| {
        (0..steps).map(move |step| Frame { time, turn: f64::from(step) / f64::from(steps), shown_cs })
    };
    times.into_iter().flat_map(turned).collect()
}

/// Draws a frame: RGBA, 8 bits, row by row.
pub type Draw<'a> = dyn FnMut(&Frame) -> Result<Vec<u8>, AppError> + 'a;

/// An animation to be written.
pub struct Animation<'a> {
    /// The file.
    pub path: &'a Path,
    /// What kind of file it is.
    pub form: Form,
    /// Pixels: width, height.
    pub size: [u32; 2],
    /// What is drawn.
    pub frames: &'a [Frame],
}

impl Animation<'_> {
    /// Draws and writes it, whole or not at all. No more than a few frames are in memory.
    ///
    /// # Errors
    /// [`AppError`] of drawing and of writing, where cancelled; of MP4 also without ffmpeg, where it fails, and for odd sizes.
    pub fn write(&self, draw: &mut Draw<'_>, progress: &Progress) -> Result<(), AppError> {
        progress.say("Drawing");
        match self.form {
            Form::Gif => gif::write(self, draw, progress),
            Form::Mp4 => mp4::write(self, draw, progress),
        }
    }

    /// What to say where writing failed.
    fn failed(&self, why: &dyn std::fmt::Display) -> AppError {
        AppError::file(self.path, format!("writing failed: {why}"), "a place that can be written")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_closed_and_of_each_date() {
        let turn = frames(Some(4), None);
        assert_eq!(turn.iter().map(|frame| frame.turn).collect::<Vec<_>>(), [0.0, 0.25, 0.5, 0.75]);
        assert!(turn.iter().all(|frame| frame.time.is_none() && frame.shown_cs == 5));
        let play = frames(None, Some(3));
        assert_eq!(play.iter().map(|frame| frame.time).collect::<Vec<_>>(), [Some(0), Some(1), Some(2)]);
        assert!(play.iter().all(|frame| frame.turn == 0.0 && frame.shown_cs == 100));
        let both: Vec<_> = frames(Some(2), Some(2)).iter().map(|f| (f.time, f.turn, f.shown_cs)).collect();
        assert_eq!(both, [(Some(0), 0.0, 5), (Some(0), 0.5, 5), (Some(1), 0.0, 5), (Some(1), 0.5, 5)]);
    }

    #[test]
    fn endings_are_forms() {
        assert_eq!(Form::of(Path::new("a.GIF")), Some(Form::Gif));
        assert_eq!(Form::of(Path::new("a.b.mp4")), Some(Form::Mp4));
        for other in ["a.png", "a", "gif", ".gif"] {
            assert_eq!(Form::of(Path::new(other)), None, "{other}");
        }
    }
}
