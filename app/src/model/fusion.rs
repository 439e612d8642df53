//! A second image on the slices.

use glioscope_core::{Unit, case::TimePoint};
use glioscope_render::{
    ColorMap,
    flat::{Mixing, Window},
};
use serde::{Deserialize, Serialize};

/// An image of the case, of any of its dates.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SecondImage {
    /// Its id.
    pub id: String,
    /// Label of its date; `None`: the date shown.
    #[serde(default)]
    pub time: Option<String>,
}

/// Whether and how slices show a second image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Fusion {
    /// The image; `None`: slices show one image.
    pub second: Option<SecondImage>,
    /// How both share a slice.
    pub mixing: Mixing,
    /// Its colours.
    pub map: ColorMap,
    /// Opacity where it lies over the first one, 0 to 1.
    pub opacity: f32,
    /// Where the line of a swipe is, from 0 (left) to 1.
    pub share: f32,
    /// Values at or below it are transparent where it lies over the first one, in its own unit; `None`: 40 % of its window in
    /// colours, its low end in greys.
    pub threshold: Option<f64>,
    /// Whether the context view shows it, too: the largest value along each ray.
    pub in_context: bool,
}

impl Default for Fusion {
    fn default() -> Self {
        Self {
            second: None,
            mixing: Mixing::Over,
            map: ColorMap::Hot,
            opacity: 0.5,
            share: 0.5,
            threshold: None,
            in_context: false,
        }
    }
}

/// What an image of a date is called; `time` may be empty.
pub fn image_name(id: &str, time: &str) -> String {
    if time.is_empty() { id.to_owned() } else { format!("{id} \u{b7} {time}") }
}

/// What an image is called in a legend of its values: with their unit, where that is known.
pub fn name_with_unit(name: &str, unit: Unit) -> String {
    if unit == Unit::Unknown { name.to_owned() } else { format!("{name} ({})", unit.sign()) }
}

/// Whether an image is PET, by its id.
pub fn is_pet(id: &str) -> bool {
    id.to_lowercase().split(|c: char| !c.is_alphanumeric()).any(|word| word == "pet" || word == "pt")
}

/// The image that goes over `first` at a date: PET where there is one, by its name, else another one.
pub fn second_of(time_point: &TimePoint, first: Option<&str>) -> Option<SecondImage> {
    let others = || time_point.contexts.iter().map(|c| &c.id).filter(|id| Some(id.as_str()) != first);
    let id = others().find(|id| is_pet(id)).or_else(|| others().next())?.clone();
    Some(SecondImage { id, time: None })
}

/// Share of the window below which an image in colours is transparent, so that the anatomy shows where nothing is taken up.
const TRANSPARENT_SHARE: f64 = 0.4;

impl Fusion {
    /// The threshold in an image of this window.
    pub fn threshold_in(&self, window: Window) -> f64 {
        let share = match self.map {
            ColorMap::Grey | ColorMap::InvertedGrey => 0.0,
            ColorMap::Hot | ColorMap::Inferno | ColorMap::Viridis => TRANSPARENT_SHARE,
        };
        self.threshold.unwrap_or(window.low + share * window.width())
    }

    /// With this second image, looked at as such pairs usually are: an earlier or later scan of the same kind in greys
    /// behind a swipe line, another kind in colours over the first.
    #[must_use]
    pub fn showing(&self, second: Option<SecondImage>, is_same_kind: bool) -> Self {
        let before = self.clone();
        let is_same_image =
            |own: &SecondImage| before.second.as_ref().is_some_and(|second| second.id == own.id);
        match second {
            None => Self { second, ..before },
            // Another date of it.
            Some(ref own) if is_same_image(own) => Self { second, ..before },
            Some(_) if is_same_kind => {
                Self { second, mixing: Mixing::Swipe, map: ColorMap::Grey, threshold: None, ..before }
            }
            Some(_) => Self { second, mixing: Mixing::Over, map: ColorMap::Hot, threshold: None, ..before },
        }
    }
}
