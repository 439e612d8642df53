//! Options of `render` that make an animation of a view.

use std::path::Path;

use clap::Args;
use glioscope_core::case::Case;

use super::parse::View;
use crate::{animation::Form, error::AppError, output, window::film};

/// An animation in place of a picture.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct AnimationArguments {
    /// Turn the camera once about the patient's axis, in so many frames at 20 a second: 1 to 720, default 60. For 3D views.
    #[arg(long, value_name = "FRAMES", num_args = 0..=1, default_missing_value = "60",
          value_parser = frames,
          conflicts_with_all = ["plain", "explain", "stats"])]
    pub turntable: Option<u32>,
    /// Show the dates one after the other, a second each; with --turntable, a turn of each.
    #[arg(long, conflicts_with_all = ["time", "plain", "explain", "stats"])]
    pub play: bool,
    /// Animations: write over a file that exists.
    #[arg(long)]
    pub force: bool,
}

/// The number of frames.
fn frames(text: &str) -> Result<u32, String> {
    text.parse().ok().filter(|frames| (1..=720).contains(frames)).ok_or_else(|| "1 to 720 frames".to_owned())
}

impl AnimationArguments {
    /// Whether an animation is asked for.
    pub(super) fn is_asked(&self) -> bool {
        self.turntable.is_some() || self.play
    }

    /// Refuses, before minutes of drawing, what can't be animated, and files that aren't to be written.
    pub(super) fn refuse(&self, view: View, path: &Path, case: &Case) -> Result<(), AppError> {
        let found = || view.pane().map_or("the window", |pane| pane.title());
        if self.turntable.is_some() && !view.pane().is_some_and(film::turns) {
            return Err(AppError::wrong("--turntable", found(), "closeup, context, ellipsoids or change"));
        }
        if self.play && !view.pane().is_some_and(film::plays) {
            let expected =
                "closeup, context, ellipsoids, overlap, axial, coronal or sagittal, which show one date";
            return Err(AppError::wrong("--play", found(), expected));
        }
        if self.play && case.time_points.len() < 2 {
            return Err(AppError::wrong("--play", "a case with one date", "several"));
        }
        if Form::of(path).is_none() {
            return Err(AppError::file(path, "another ending", "an animation's name, .gif or .mp4"));
        }
        output::refuse(path, &case.inputs, self.force)
    }

    /// Refuses `--force` without an animation: pictures are written over in any case.
    pub(super) fn refuse_force(&self) -> Result<(), AppError> {
        if self.force {
            return Err(AppError::wrong(
                "--force",
                "a picture",
                "--turntable or --play: a PNG is written over",
            ));
        }
        Ok(())
    }
}
