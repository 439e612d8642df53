//! The change view (thesis 7.3.4): how the surface of a mask moved between two time points, as a height
//! map over the surface or as arrows, inside the anatomy.
//!
//! Both ends of every vector lie in the union of the two masks, so an opaque union would hide all arrows.
//! With arrows the opaque surface is therefore the intersection of both time points, and the rest of the
//! union is a translucent hull; components without a counterpart stay opaque in both styles.
//!
//! Lifetimes: the union's bricks and the table of lengths once per surface; arrows once per surface and threshold; the
//! image as in the context view; targets as all views, plus 48 bytes per pixel, with arrows another 48, with shaded
//! arrows another 16.

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

use crate::{
    device::{PassName, RenderError},
    image::{ClipPlane, ContextVolume, TransferFunction},
    light::{self, layers::LAYERS, lit::LitKind, vicinity::TUBE_SHADOWS},
    scene::{MaskColors, Palette, Plan, Quality, Rgb, keywords::keywords, same},
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
/// First hits of the earlier date alone, for its outline.
pub(crate) const EARLIER: PassName = PassName::new("earlier");
/// That outline.
pub(crate) const EARLIER_OUTLINE: PassName = PassName::new("earlier_outline");
/// Arrows of surface change.
pub(crate) const ARROWS: PassName = PassName::new("arrows");
/// Merges arrows into the opaque geometry, for the light passes.
pub(crate) const ARROWS_MERGE: PassName = PassName::new("arrows_merge");

keywords! {
    /// How change is drawn.
    #[derive(Default)]
    pub enum ChangeStyle {
        /// As colours over the surface of the union.
        #[default]
        Height,
        /// As arrows around the intersection of both time points.
        Arrows,
    }
}

/// The style of change, its lengths and its colours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeLook {
    /// Height map or arrows.
    pub style: ChangeStyle,
    /// Length at which the height map becomes opaque, millimetres; above 0.
    pub full_mm: f64,
    /// Standard deviation of the height map's Gaussian filter, millimetres in the image plane; at least
    /// 0, which disables it. The filter extends over 3 standard deviations, and at most 96 pixels.
    pub smooth_mm: f64,
    /// Minimum length of arrows, millimetres; at least 0.
    pub threshold_mm: f64,
    /// Colour of growth.
    pub grow: Rgb,
    /// Colour of recession.
    pub shrink: Rgb,
    /// Whether the outline of the earlier date's mask is drawn over everything.
    #[serde(default)]
    pub outlines_earlier: bool,
}

impl ChangeLook {
    /// Growth and recession as in the thesis: red and green.
    pub const THESIS: [Rgb; 2] = [[214, 30, 30], [20, 150, 40]];
    /// Orange and a dark green, which differ in lightness too (L* 61 and 48): for colour-blind readers and in print.
    pub const COLOR_BLIND_SAFE: [Rgb; 2] = [[242, 107, 58], [18, 128, 109]];
    /// Colour of the unchanged surface, for light and dark backgrounds.
    pub const BASE: Rgb = [222, 218, 208];

    /// Colour of the earlier date's outline, for light and dark backgrounds.
    pub const OUTLINE: Rgb = [58, 134, 255];

    /// Colour of a surface that moved with the tissue around it, in place of that of growth or recession.
    pub const DISPLACED: Rgb = [150, 90, 220];

    /// Opacity of the colour of a length within its uncertainty.
    pub const FAINT: f32 = surface::FAINT;

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
        let [grow, shrink] = Self::pair(Palette::default());
        Self {
            style: ChangeStyle::Height,
            full_mm: 6.0,
            smooth_mm: 1.5,
            threshold_mm: 1.5,
            grow,
            shrink,
            outlines_earlier: false,
        }
    }
}

/// The surrounding anatomy, drawn as in the context view.
#[derive(Clone, Debug)]
pub struct ChangeContext {
    /// The image; `None`: the surface is drawn alone.
    pub volume: Option<Arc<ContextVolume>>,
    /// Its transfer function.
    pub transfer: Arc<TransferFunction>,
    /// Clipping planes of the image, at most [`crate::image::MOST_CLIP_PLANES`]; the surface is not
    /// clipped.
    pub clip: Vec<ClipPlane>,
}

/// A change view to draw. Two are equal if they draw the same frame; volumes are compared by identity,
/// which is cheap.
#[derive(Clone, Debug)]
pub struct ChangeScene {
    /// The two masks and their change; `None` if both are empty.
    pub surface: Option<Arc<ChangeSurface>>,
    /// How it is drawn.
    pub look: ChangeLook,
    /// Colour of the unchanged surface.
    pub base: Rgb,
    /// The image around it.
    pub context: ChangeContext,
    /// The camera.
    pub camera: Camera,
    /// Background colour.
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
    /// The scene for the passes shared with the context view: the union as tumour.
    pub(crate) fn context_scene(&self) -> ContextScene {
        let mut selection = Selection::all();
        if self.look.style == ChangeStyle::Arrows {
            selection.set(surface::BEFORE, false);
            selection.set(surface::AFTER, false);
        }
        ContextScene {
            projection: None,
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

    /// Rejects a scene that can't be drawn.
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

/// The passes that `scene` needs at `quality`. Omitting the others changes no pixel.
///
/// With directional occlusion arrows are opaque geometry like the surface: they occlude the image, the surface
/// and each other, and are occluded. With screen-space light they are drawn over the shaded frame.
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
    let has_hull = |s: &ChangeSurface| {
        s.volume().bits_of_id().iter().any(|&bits| bits == surface::BEFORE || bits == surface::AFTER)
    };
    let no_outside = match surface {
        None => Some("no mask is active"),
        Some(_) if as_height.is_some() => as_height,
        Some(s) if !has_hull(s) => Some("nothing is in one date only"),
        Some(_) => None,
    };
    let no_earlier = match surface {
        None => Some("no mask is active"),
        Some(_) if !look.outlines_earlier => Some("the outline of the earlier date is off"),
        Some(s) if !s.volume().bits_of_id().iter().any(|bits| bits & surface::BEFORE != 0) => {
            Some("the earlier mask is empty")
        }
        Some(_) => None,
    };
    let no_arrows = as_height.or(no_vectors).or_else(|| {
        let drawn = surface.is_some_and(|s| s.arrows(look.threshold_mm).next().is_some());
        (!drawn).then_some("every arrow is shorter than the threshold")
    });
    let omitted = |pass| {
        // Only the regions of one time point can be hidden here.
        let reworded = |r| if r == "selection is empty" { "the dates share nothing" } else { r };
        around.reason(pass).map(reworded)
    };
    let readers = (light::row(quality.lighting.mode).reads_arrows)(quality);
    // Merged arrows are opaque geometry, with or without a surface.
    let no_light = |pass| match no_arrows {
        None if !readers.is_empty() => light::omission_reason(pass, quality, None, no_image(&context)),
        _ => omitted(pass),
    };
    let no_merge = no_arrows
        .or((quality.strength() <= 0.0).then_some("occlusion strength is 0"))
        .or_else(|| no_light(*readers.first()?).filter(|_| readers.iter().all(|p| no_light(*p).is_some())));
    let merge = [ARROWS_MERGE].into_iter().filter(|_| !readers.is_empty());
    let before = [SURFACE, OUTSIDE, EARLIER, ARROWS].into_iter().chain(merge);
    let after = [HEIGHTS, HEIGHT_FILTER_ACROSS, HEIGHT_FILTER_DOWN, EARLIER_OUTLINE, COMPOSE];
    let light_passes = light::passes(quality.lighting.mode, LitKind::Image);
    Plan::of(around_light(quality, before, after), |pass| match pass {
        OUTSIDE => no_outside,
        EARLIER | EARLIER_OUTLINE => no_earlier,
        HEIGHTS => no_heights,
        HEIGHT_FILTER_ACROSS | HEIGHT_FILTER_DOWN => no_filter,
        ARROWS => no_arrows,
        ARROWS_MERGE => no_merge,
        LAYERS | TUBE_SHADOWS if light::row(quality.lighting.mode).traces_masks => {
            no_arrows.or(no_light(pass))
        }
        _ if light_passes.contains(&pass) => no_light(pass),
        _ => omitted(pass),
    })
}
