//! The change view (thesis 7.3.4): how the surface of a mask moved between two dates, as a height map
//! over the surface or as arrows, inside the anatomy.
//!
//! Both ends of every vector lie in the union of the two masks, so nothing of an arrow could be seen
//! around that. With arrows the solid surface is therefore what both dates share, and the rest of the
//! union is a veil; components without a counterpart stay solid in both styles.

mod arrows;
mod frame;
mod renderer;
mod surface;
mod targets;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;
pub(crate) mod uniforms;

use std::sync::Arc;

use glioscope_core::Selection;
use serde::{Deserialize, Serialize};

use crate::{
    camera::Camera,
    context::{ClipPlane, ContextScene, ContextVolume, context_plan},
    lighting::{Shading, left_out, passes},
    palette::{MaskColors, Palette, Rgb},
    plan::{PassName, Plan},
    quality::Quality,
    renderer::RenderError,
    transfer::TransferFunction,
};

pub use frame::{ChangeFrame, ChangePick};
pub use renderer::ChangeRenderer;
pub use surface::ChangeSurface;
#[cfg(test)]
pub(crate) use {arrows::GpuArrow, surface::Length};

/// How change is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
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
    /// What of the image is cut away, at most [`crate::context::MOST_CLIP_PLANES`]; the surface stays
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
        let same_surface = match (&self.surface, &other.surface) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        };
        same_surface
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
/// With directional occlusion arrows are solid as the surface is: they darken image, surface and each other,
/// and are darkened. In screen space they are drawn over the finished light.
pub fn change_plan(scene: &ChangeScene, quality: &Quality) -> Plan {
    let around = context_plan(&scene.context_scene(), quality);
    let look = &scene.look;
    let surface = scene.surface.as_deref();
    let shares_nothing = "the dates share nothing";
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
        let reason = around.omitted.iter().find(|(name, _)| *name == pass).map(|(_, reason)| *reason);
        // Of regions, only those of one date can be hidden here.
        reason.map(|r| if r == "selection is empty" { shares_nothing } else { r })
    };
    let shading = quality.lighting.shading;
    // Arrows are solid for all light but that of screen space.
    let no_image = omitted(PassName::Context).or(omitted(PassName::Slices));
    let no_light_on_solid = |pass| match no_arrows {
        Some(_) => omitted(pass),
        None => left_out(pass, quality, None, no_image),
    };
    let no_shadow = |pass| {
        let none = pass == PassName::Slices && !quality.lighting.mutual.solid_on_image;
        omitted(pass).or(none.then_some("what is solid darkens nothing"))
    };
    let no_merge =
        no_arrows.or((quality.strength() <= 0.0).then_some("occlusion strength is 0")).or_else(|| {
            let [on_solid, by_solid] = match shading {
                Shading::Cones => [PassName::SolidCones, PassName::LightGrid],
                _ => [PassName::Vicinity, PassName::Slices],
            };
            no_shadow(by_solid).and(no_light_on_solid(on_solid))
        });
    Plan::of(&passes(&PassName::CHANGE, shading), |pass| match pass {
        PassName::Outside => no_outside,
        PassName::Heights => no_heights,
        PassName::HeightFilterAcross | PassName::HeightFilterDown => no_filter,
        PassName::Arrows => no_arrows,
        PassName::ArrowsMerge => no_merge,
        PassName::SolidCones | PassName::Vicinity => no_light_on_solid(pass),
        _ => omitted(pass),
    })
}
