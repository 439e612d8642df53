//! The scenes that views draw, and at which quality: regions, lens, colours, a slice, quality settings, and the plan of
//! passes. Uses no graphics device.

pub mod color_map;
pub(crate) mod keywords;
pub mod knobs;
pub mod lens;
pub mod palette;
pub mod plan;
pub mod plane;
pub mod quality;
pub mod regions;

use std::sync::Arc;

pub use color_map::ColorMap;
pub use knobs::{Knob, KnobRow, Knobs};
pub use lens::Lens;
pub use palette::{Coloring, MaskColors, Palette, Rgb, agreement_color};
pub use plan::Plan;
pub use plane::SlicePlane;
pub use quality::{
    Lamp, LampFrame, LightSettings, LightingMode, MutualOcclusion, PathSettings, Preset, Quality,
    SliceVariant,
};
pub use regions::RegionScene;

/// Whether both are the same object or both absent: a comparison of scenes without cost.
pub(crate) fn same<T>(a: Option<&Arc<T>>, b: Option<&Arc<T>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    }
}
