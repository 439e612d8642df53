//! What is computed of every case, and how.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use strum::{Display, IntoStaticStr, VariantArray};

/// Something that is computed of every case.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    Display,
    IntoStaticStr,
    VariantArray,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Step {
    /// Volumes and overlap of masks and regions; computed always.
    Measure,
    /// With it, distances and more by a convention.
    Metrics,
    /// The lesions over the dates.
    Lesions,
    /// How surfaces moved from each date to the next.
    Change,
    /// Response by criteria.
    Response,
    /// The report as HTML, without the patient's identity.
    Report,
    /// Every view as a picture.
    Pictures,
}

/// What is computed of every case, and how: whatever changes results. Fields are as on the command line.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Options {
    /// What is computed.
    pub compute: Vec<Step>,
    /// The masks whose lesions, change and response are computed; empty: each command's own choice.
    pub of: Vec<String>,
    /// The criteria of response.
    pub criteria: Option<String>,
    /// Whose definitions the metrics follow.
    pub convention: Option<String>,
    /// Tolerance of the surface Dice.
    pub tau_mm: Option<f64>,
    /// Percentile of the robust Hausdorff distance.
    pub percentile: Option<f64>,
    /// The masks with which all others are compared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<String>,
    /// Which lesions the convention of BraTS joins and leaves out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tumor: Option<String>,
    /// What criteria of more than one compartment assess.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assessment: Option<String>,
    /// The masks of non-enhancing disease.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub non_enhancing: Vec<String>,
    /// The image whose values in lesions are reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Whether the movement of lesions' surfaces is reported.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub surface: bool,
    /// The derived data sets of BIDS whose masks the images have.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub derivatives: Vec<PathBuf>,
    /// Further arguments by which every command reads the case.
    pub case_arguments: Vec<String>,
    /// Pictures are drawn without a graphics card.
    pub software: bool,
}
