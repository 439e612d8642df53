//! Along which axes slices lie.

use glam::DMat3;
use serde::{Deserialize, Serialize};
use strum::VariantArray;

/// Whose axes slices lie along.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, VariantArray, Serialize, Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum AxesOf {
    /// Axial, coronal and sagittal.
    #[default]
    Patient,
    /// The planes in which the image was scanned, at the first date.
    Image,
    /// The principal axes of the masks shown.
    Tumor,
}

impl AxesOf {
    /// What menus call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Patient => "Slices along the patient's axes",
            Self::Image => "Slices as the image was scanned",
            Self::Tumor => "Slices along the tumour's own axes",
        }
    }
}

/// The axes of slices, as they were when they were chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SliceAxes {
    /// Whose.
    pub of: AxesOf,
    /// The rotation that takes the patient's axes R, A and S to them.
    pub turn: DMat3,
}

impl Default for SliceAxes {
    fn default() -> Self {
        Self { of: AxesOf::Patient, turn: DMat3::IDENTITY }
    }
}
