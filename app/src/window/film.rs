//! Animations of a pane, drawn without a window: the camera turned once, the dates one after the other.

use std::{collections::BTreeSet, path::Path};

use glam::{DQuat, DVec3};
use glioscope_core::{Check, Progress, optics::Camera};
use glioscope_render::Gpu;

use super::offscreen_app::OffscreenApp;
use crate::{
    animation::{Animation, Form, Frame, frames},
    command::Workstation,
    error::AppError,
    model::{Document, PaneId},
    world::World,
};

/// Part of a unit vector along the patient's axis from which on a camera counts as rolled.
const ROLL: f64 = 1e-6;

/// What is drawn, and how.
pub struct Film {
    /// The view.
    pub pane: PaneId,
    /// Pixels: width, height.
    pub size: [u32; 2],
    /// Pixels per point.
    pub scale: f32,
    /// The theme.
    pub dark: bool,
    /// Frames of a turn of the camera; `None`: it stands.
    pub turn: Option<u32>,
    /// Whether all dates are shown, one after the other.
    pub plays: bool,
    /// The user's choices.
    pub doc: Document,
    /// The case.
    pub world: World,
}

/// What there is to say about the pictures drawn.
#[derive(Default)]
pub struct Notes {
    /// Findings of the comparison drawn.
    pub comparison: Vec<Check>,
    /// What pictures don't show, each once.
    pub pictures: BTreeSet<String>,
}

/// Whether a view has a camera.
pub fn turns(pane: PaneId) -> bool {
    matches!(pane, PaneId::Closeup | PaneId::Context | PaneId::Ellipsoids | PaneId::Change)
}

/// Whether a view shows one date, as a picture of it.
pub fn plays(pane: PaneId) -> bool {
    use PaneId::{Axial, Closeup, Context, Coronal, Ellipsoids, Overlap, Sagittal};
    matches!(pane, Closeup | Context | Ellipsoids | Overlap | Axial | Coronal | Sagittal)
}

/// The orientation of a camera with the patient's axis vertical on the screen: `of` itself where it has it so. It looks from where `of`
/// does.
fn upright(of: DQuat) -> DQuat {
    let [right, up, back] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| of * axis);
    if right.z.abs() <= ROLL && up.z >= -ROLL {
        return of;
    }
    // From above or below, what is up on the screen says where the camera stands.
    let level = if back.z.abs() < 1.0 - ROLL { back } else { -up * back.z.signum() };
    let azimuth = f64::atan2(-level.x, level.y).to_degrees();
    Camera::orientation(azimuth, back.z.clamp(-1.0, 1.0).asin().to_degrees())
}

impl Film {
    /// Draws the animation and writes it to `path`, whole or not at all.
    ///
    /// # Errors
    /// [`AppError`], as [`Animation::write`]; also for another ending.
    pub fn write(self, gpu: &Gpu, path: &Path, progress: &Progress) -> Result<Notes, AppError> {
        let Self { pane, size, scale, dark, turn, plays, mut doc, world } = self;
        let form = Form::of(path)
            .ok_or_else(|| AppError::file(path, "another ending", "an animation's name, .gif or .mp4"))?;
        if turn.is_some() {
            doc.nav.camera.world_from_camera = upright(doc.nav.camera.world_from_camera);
        }
        let start = doc.nav.camera.world_from_camera;
        let labels: Vec<String> = world.case().map_or_else(Vec::new, |case| captions(&case.time_labels()));
        let frames = frames(turn, plays.then_some(labels.len()));
        let work = Workstation { doc: Some(doc), world, ..Workstation::default() };
        let mut app = OffscreenApp::new(work, gpu, dark)?;
        let mut notes = Notes::default();
        let mut draw = |frame: &Frame| -> Result<Vec<u8>, AppError> {
            if let Some(doc) = &mut app.app.work.doc {
                let turned = DQuat::from_rotation_z(std::f64::consts::TAU * frame.turn);
                doc.nav.camera.world_from_camera = turned * start;
                doc.nav.time = frame.time.unwrap_or(doc.nav.time);
            }
            let rgba = match frame.time.and_then(|time| labels.get(time)) {
                Some(label) => app.capture_above(label, pane, size, scale)?,
                None => app.capture(Some(pane), size, scale)?,
            };
            if let Some(screen) = app.app.panes.screen(pane) {
                notes.pictures.extend(screen.warnings().iter().cloned());
            }
            Ok(rgba)
        };
        Animation { path, form, size, frames: &frames }.write(&mut draw, progress)?;
        notes.comparison = app.comparison_warnings();
        Ok(notes)
    }
}

/// What stands below each date: its label, and which of how many it is.
fn captions(labels: &[&str]) -> Vec<String> {
    let caption = |(n, label): (usize, &&str)| {
        let label = if label.is_empty() { "no date" } else { label };
        format!("{label} · {} of {}", n + 1, labels.len())
    };
    labels.iter().enumerate().map(caption).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rolled_camera_is_set_upright_where_it_stands() {
        for (azimuth, elevation) in [(0.0, 0.0), (30.0, 20.0), (-130.0, -70.0), (75.0, 90.0), (75.0, -90.0)] {
            let of = Camera::orientation(azimuth, elevation);
            assert_eq!(upright(of), of, "{azimuth}, {elevation}");
            if elevation.abs() < 90.0 {
                for roll in [0.3_f64, -2.0, 3.1] {
                    let set = upright(of * DQuat::from_rotation_z(roll));
                    assert!(set.angle_between(of) < 1e-6, "{azimuth}, {elevation}, {roll}: {set}");
                }
            }
        }
    }

    #[test]
    fn captions_count_the_dates() {
        assert_eq!(captions(&["2024-01-15", ""]), ["2024-01-15 · 1 of 2", "no date · 2 of 2"]);
    }
}
