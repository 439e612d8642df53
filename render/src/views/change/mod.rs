//! The change view (thesis 7.3.4): how the surface of a mask moved between two dates, as a height map
//! over the surface or as arrows, inside the anatomy.
//!
//! Both ends of every vector lie in the union of the two masks, so nothing of an arrow could be seen
//! around that. With arrows the solid surface is therefore what both dates share, and the rest of the
//! union is a veil; components without a counterpart stay solid in both styles.
//!
//! Lifetimes: the union's bricks and the table of lengths once per surface; arrows once per surface and threshold; the
//! image as in the context view; targets as all views, 48 bytes per pixel more, with arrows 48, with arrows that take
//! light 16.

mod arrows;
mod passes;
mod surface;
mod targets;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;
pub(crate) mod uniforms;

use std::sync::Arc;

use glioscope_core::{Selection, optics::Camera};
use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray, VariantNames};

use crate::{
    device::{PassName, RenderError},
    image::{ClipPlane, ContextVolume, TransferFunction},
    light::{self, lit::LitKind},
    scene::{MaskColors, Palette, Plan, Quality, Rgb, same},
    solid::{OUTSIDE, SURFACE},
    views::{
        context::{ContextScene, around_light, context_plan, no_image},
        view3d::COMPOSE,
    },
};

pub use passes::{Change, ChangePick};
pub use surface::ChangeSurface;

/// Lengths of surface change at each pixel's voxel.
pub(crate) const HEIGHTS: PassName = PassName::new("heights");
/// Their filter along rows.
pub(crate) const HEIGHT_FILTER_ACROSS: PassName = PassName::new("height_filter_across");
/// Their filter along columns.
pub(crate) const HEIGHT_FILTER_DOWN: PassName = PassName::new("height_filter_down");
/// Arrows of surface change.
pub(crate) const ARROWS: PassName = PassName::new("arrows");
/// Puts arrows among opaque geometry, for the passes of light.
pub(crate) const ARROWS_MERGE: PassName = PassName::new("arrows_merge");

/// How change is drawn.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    Serialize,
    Deserialize,
    EnumString,
    IntoStaticStr,
    VariantArray,
    VariantNames,
)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "kebab-case")]
pub enum ChangeStyle {
    /// As colours over the surface of the union.
    #[default]
    Height,
    /// As arrows around what both dates share.
    Arrows,
}

/// How much of what is drawn, and in which colours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeLook {
    /// Height map or arrows.
    pub style: ChangeStyle,
    /// Length from which on the height map is opaque, millimetres; above 0.
    pub full_mm: f64,
    /// Standard deviation of the height map's Gauss filter, millimetres in the picture plane. At least
    /// 0: then it is not filtered. It looks at 3 of them, and at 96 pixels at most.
    pub smooth_mm: f64,
    /// Shorter arrows are not built, millimetres; at least 0.
    pub threshold_mm: f64,
    /// Colour of growth.
    pub grow: Rgb,
    /// Colour of recession.
    pub shrink: Rgb,
}

impl ChangeLook {
    /// Growth and recession as the thesis has them: red and green.
    pub const THESIS: [Rgb; 2] = [[214, 30, 30], [20, 150, 40]];
    /// A pair that the colour-blind tell apart: vermilion and blue of Okabe and Ito (2008).
    pub const COLOR_BLIND_SAFE: [Rgb; 2] = [[213, 94, 0], [0, 114, 178]];
    /// Of the surface that did not change, on light and dark backgrounds.
    pub const BASE: Rgb = [222, 218, 208];

    /// Growth and recession in a palette.
    pub fn pair(palette: Palette) -> [Rgb; 2] {
        match palette {
            Palette::Thesis => Self::THESIS,
            Palette::ColorBlindSafe => Self::COLOR_BLIND_SAFE,
        }
    }
}

impl Default for ChangeLook {
    fn default() -> Self {
        let [grow, shrink] = Self::THESIS;
        Self { style: ChangeStyle::Height, full_mm: 6.0, smooth_mm: 1.5, threshold_mm: 1.5, grow, shrink }
    }
}

/// The anatomy around, as the context view shows it.
#[derive(Clone, Debug)]
pub struct ChangeContext {
    /// The image; `None` without one: then the surface stands alone.
    pub volume: Option<Arc<ContextVolume>>,
    /// How its values look.
    pub transfer: Arc<TransferFunction>,
    /// What of the image is cut away, at most [`crate::image::MOST_CLIP_PLANES`]; the surface stays
    /// whole.
    pub clip: Vec<ClipPlane>,
}

/// A change view to draw. Two are equal when they draw the same picture: volumes by identity, which
/// costs nothing a frame.
#[derive(Clone, Debug)]
pub struct ChangeScene {
    /// The two masks and their change; `None` when both are empty.
    pub surface: Option<Arc<ChangeSurface>>,
    /// How it is drawn.
    pub look: ChangeLook,
    /// Colour of what did not change.
    pub base: Rgb,
    /// The image around it.
    pub context: ChangeContext,
    /// Where it is seen from.
    pub camera: Camera,
    /// What is behind everything.
    pub background: Rgb,
    /// Colour of silhouettes.
    pub silhouette: Rgb,
}

impl PartialEq for ChangeScene {
    fn eq(&self, other: &Self) -> bool {
        same(self.surface.as_ref(), other.surface.as_ref())
            && self.look == other.look
            && self.base == other.base
            && self.context_scene() == other.context_scene()
    }
}

impl ChangeScene {
    /// What the passes that are the context view's take: the union as a tumour.
    pub(crate) fn context_scene(&self) -> ContextScene {
        let mut selection = Selection::all();
        if self.look.style == ChangeStyle::Arrows {
            selection.set(surface::BEFORE, false);
            selection.set(surface::AFTER, false);
        }
        ContextScene {
            volume: self.context.volume.clone(),
            transfer: Arc::clone(&self.context.transfer),
            clip: self.context.clip.clone(),
            tumor: self.surface.as_ref().map(|s| Arc::clone(s.volume())),
            selection,
            colors: MaskColors::new(Palette::Thesis, &[Some(self.base); 3]),
            lens: None,
            tubes: Vec::new(),
            camera: self.camera,
            background: self.background,
            silhouette: self.silhouette,
        }
    }

    /// Refuses what can't be drawn.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let ChangeLook { full_mm, smooth_mm, threshold_mm, .. } = self.look;
        let length = |mm: f64| mm.is_finite() && mm >= 0.0;
        if !(full_mm.is_finite() && full_mm > 0.0 && length(smooth_mm) && length(threshold_mm)) {
            return Err(RenderError::Scene(format!(
                "a change view with full colour at {full_mm} mm, a filter of {smooth_mm} mm and arrows from \
                 {threshold_mm} mm"
            )));
        }
        self.context_scene().check()
    }
}

/// The passes that `scene` needs at `quality`. Leaving the others out changes no pixel.
///
/// With directional occlusion arrows are opaque as the surface is: they darken image, surface and each other,
/// and are darkened. In screen space they are drawn over the finished light.
pub fn change_plan(scene: &ChangeScene, quality: &Quality) -> Plan {
    let context = scene.context_scene();
    let around = context_plan(&context, quality);
    let look = &scene.look;
    let surface = scene.surface.as_deref();
    let no_vectors = match surface {
        None => Some("no mask is active"),
        Some(s) if s.change().vectors.is_empty() && s.change().unpartnered.is_empty() => Some("no change"),
        Some(s) if s.change().vectors.is_empty() => Some("no surface voxel has a partner"),
        Some(_) => None,
    };
    let as_height = (look.style == ChangeStyle::Height).then_some("style is height map");
    let as_arrows = (look.style == ChangeStyle::Arrows).then_some("style is arrows");
    let no_heights = no_vectors.or(as_arrows);
    let no_filter = no_heights.or((look.smooth_mm <= 0.0).then_some("smoothing is 0"));
    let veil = |s: &ChangeSurface| {
        s.volume().bits_of_id().iter().any(|&bits| bits == surface::BEFORE || bits == surface::AFTER)
    };
    let no_outside = match surface {
        None => Some("no mask is active"),
        Some(_) if as_height.is_some() => as_height,
        Some(s) if !veil(s) => Some("nothing is in one date only"),
        Some(_) => None,
    };
    let no_arrows = as_height.or(no_vectors).or_else(|| {
        let drawn = surface.is_some_and(|s| s.arrows(look.threshold_mm).next().is_some());
        (!drawn).then_some("every arrow is shorter than the threshold")
    });
    let omitted = |pass| {
        // Of regions, only those of one date can be hidden here.
        let shown = |r| if r == "selection is empty" { "the dates share nothing" } else { r };
        around.reason(pass).map(shown)
    };
    let readers = (light::row(quality.lighting.mode).reads_arrows)(quality);
    // Where arrows are among opaque geometry there is some, be there a surface or not.
    let no_light = |pass| match no_arrows {
        None if !readers.is_empty() => light::left_out(pass, quality, None, no_image(&context)),
        _ => omitted(pass),
    };
    let no_merge = no_arrows
        .or((quality.strength() <= 0.0).then_some("occlusion strength is 0"))
        .or_else(|| no_light(*readers.first()?).filter(|_| readers.iter().all(|p| no_light(*p).is_some())));
    let merge = [ARROWS_MERGE].into_iter().filter(|_| !readers.is_empty());
    let before = [SURFACE, OUTSIDE, ARROWS].into_iter().chain(merge);
    let after = [HEIGHTS, HEIGHT_FILTER_ACROSS, HEIGHT_FILTER_DOWN, COMPOSE];
    let of_light = light::passes(quality.lighting.mode, LitKind::Image);
    Plan::of(around_light(quality, before, after), |pass| match pass {
        OUTSIDE => no_outside,
        HEIGHTS => no_heights,
        HEIGHT_FILTER_ACROSS | HEIGHT_FILTER_DOWN => no_filter,
        ARROWS => no_arrows,
        ARROWS_MERGE => no_merge,
        _ if of_light.contains(&pass) => no_light(pass),
        _ => omitted(pass),
    })
}
