//! Settings of the lesions over time, and what the user said about them.

use std::ops::RangeInclusive;

use glioscope_core::{
    Progress,
    case::Case,
    lesions::{
        self, DEFAULT_SMALLEST_ML, DEFAULT_WITHIN_MM, Edit, LesionsError, LesionsReport, Of, Options,
        default_mask,
    },
};
use serde::{Deserialize, Serialize};

use super::change::ChangeSetting;

/// The most edits of a case.
pub const MOST_LESION_EDITS: usize = 2000;
/// The longest name of a lesion, characters.
pub const MOST_LESION_NAME: usize = 100;
/// Sizes below which components are small, millilitres.
pub const SMALLEST_ML: RangeInclusive<f64> = 0.0..=1000.0;
/// Distances up to which components are linked, millimetres.
pub const WITHIN_MM: RangeInclusive<f64> = 0.0..=1000.0;

/// Which components are lesions, and what the user said about them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LesionSetting {
    /// The mask, by id; `None`: the one that is compared between dates, else the first.
    pub of: Option<String>,
    /// Smaller components are small.
    pub smallest_ml: f64,
    /// Components without a common voxel are linked up to this distance.
    pub within_mm: f64,
    /// Image whose values in lesions are reported, by id.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Whether the movement of their surfaces since the date before is reported.
    #[serde(default, skip_serializing_if = "is_false")]
    pub surface: bool,
    /// The user's edits, in their order.
    #[serde(default)]
    pub edits: Vec<Edit>,
}

impl Default for LesionSetting {
    fn default() -> Self {
        Self {
            of: None,
            smallest_ml: DEFAULT_SMALLEST_ML,
            within_mm: DEFAULT_WITHIN_MM,
            image: None,
            surface: false,
            edits: Vec::new(),
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_false(value: &bool) -> bool {
    !value
}

impl LesionSetting {
    /// The mask whose lesions are meant in `case`: the chosen one, else the one that `change` compares, else the first. `None`
    /// without any mask.
    pub fn mask(&self, case: &Case, change: &ChangeSetting) -> Option<String> {
        let compared = || change.chosen(case).ok().map(|choice| choice.id);
        self.of.clone().filter(|id| case.has_mask(id)).or_else(compared).or_else(|| default_mask(case))
    }

    /// The options with which the lesions of `case` are found; `None` without any mask.
    pub fn options(&self, case: &Case, change: &ChangeSetting) -> Option<Options> {
        Some(Options {
            smallest_ml: self.smallest_ml,
            within_mm: self.within_mm,
            asks_images: !case.one_space,
            image: self.image.clone().filter(|id| case.has_image(id)),
            surface: self.surface && case.time_points.len() > 1,
            ..Options::new(Of::Mask(self.mask(case, change)?))
        })
    }

    /// The lesions of `case` with the edits; `None` without any mask.
    ///
    /// # Errors
    /// As [`lesions::report`].
    pub fn report(
        &self,
        case: &Case,
        change: &ChangeSetting,
        progress: &Progress,
    ) -> Result<Option<LesionsReport>, LesionsError> {
        let Some(options) = self.options(case, change) else { return Ok(None) };
        let edits = self.edits_of(&options.of.name());
        lesions::report(case, &options, &edits, progress).map(Some)
    }

    /// Those of the edits that are about the mask of `options`, by its name.
    pub fn edits_of(&self, of: &str) -> Vec<Edit> {
        self.edits.iter().filter(|edit| edit.anchor().is_none_or(|anchor| anchor.of == of)).cloned().collect()
    }
}
