//! How much work a picture may be: the knobs, and the names of points on them. Which knobs a preset stands for says
//! [`crate::light`].

use serde::{Deserialize, Serialize};
use strum::{EnumString, IntoStaticStr, VariantArray, VariantNames};

/// Points on the measured front of error against time (docs/accuracy.md).
#[derive(
    Clone,
    Copy,
    Debug,
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
pub enum Preset {
    /// For slow machines and moving pictures.
    Draft,
    /// Where more time gains little.
    Balanced,
    /// For figures.
    Reference,
}

impl Preset {
    /// What the command line and menus call it.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// How light is found. Each mode has a row in [`crate::light::LIGHTS`].
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
pub enum LightingMode {
    /// Ambient occlusion from depths, and a headlight on the gradients of the image.
    #[default]
    ScreenSpace,
    /// Directional occlusion by slices; vicinity occlusion of opaque geometry.
    Slices,
    /// Cones traced through the image and the masks.
    Cones,
}

impl LightingMode {
    /// What the command line calls it.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// How slices carry occlusion from one to the next.
#[derive(
    Clone,
    Copy,
    Debug,
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
pub enum SliceVariant {
    /// Footprint tan θ·√(d·d_ref) with the variance of solid-angle-uniform directions, exact on any
    /// stack of layers. For soft media: its footprint is wider than the cone near by, so that a tilted
    /// opaque surface darkens itself, the more the finer the slices (measured; opaque labels are for the
    /// cones).
    #[strum(serialize = "mended")]
    Mended,
    /// The paper's Algorithm 3: footprint d·tan θ, samples attenuated over the slice distance.
    #[strum(serialize = "paper")]
    PaperApproximate,
    /// The paper's Algorithm 2: footprint d·tan θ, each sample attenuated over its own distance.
    #[strum(serialize = "paper-exact")]
    PaperExact,
}

/// Which of image and opaque geometry may darken which (Schott et al. 2012, figure 2). Of the slices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MutualOcclusion {
    /// The image itself.
    pub image_on_image: bool,
    /// Opaque geometry the image.
    pub opaque_on_image: bool,
    /// The image opaque geometry.
    pub image_on_opaque: bool,
    /// Opaque surfaces each other: vicinity occlusion.
    pub opaque_on_opaque: bool,
}

impl MutualOcclusion {
    /// Everything darkens everything.
    pub const ALL: Self =
        Self { image_on_image: true, opaque_on_image: true, image_on_opaque: true, opaque_on_opaque: true };
    /// Nothing darkens anything.
    pub const NONE: Self = Self {
        image_on_image: false,
        opaque_on_image: false,
        image_on_opaque: false,
        opaque_on_opaque: false,
    };
}

/// The knobs of light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightSettings {
    /// How light is found.
    pub mode: LightingMode,
    /// Half the opening of the cone that light comes from, about the way to the eye; degrees, 0 to 85.
    pub aperture_deg: f64,
    /// How the slices carry occlusion.
    pub variant: SliceVariant,
    /// The slices' points along a side of the footprint, 1 to 13.
    pub slice_grid: u32,
    /// Distance of slices.
    pub slice_mm: f64,
    /// Distance of an occluder whose penumbra is the true cone's, of the mended slices.
    pub reference_mm: f64,
    /// Sub-cones, 1 to [`LightSettings::MOST_SUB_CONES`].
    pub sub_cones: u32,
    /// Coarsest level of prefiltered extinction that cones read.
    pub coarsest_level: u32,
    /// Steps along a sub-cone, in cells of the level read.
    pub cone_step: f64,
    /// Side of the image's cells of light; those of one voxel are the finest.
    pub cell_mm: f64,
    /// Points of vicinity occlusion, 1 to [`LightSettings::MOST_VICINITY`].
    pub vicinity_samples: u32,
    /// Its virtual slice distance: it reaches tan(aperture) times as far.
    pub vicinity_mm: f64,
    /// What darkens what.
    pub mutual: MutualOcclusion,
}

impl LightSettings {
    /// The most sub-cones of a view.
    pub const MOST_SUB_CONES: u32 = 128;
    /// The most points of vicinity occlusion, as many as the paper takes.
    pub const MOST_VICINITY: u32 = 118;

    /// What presets start from.
    pub const DEFAULT: Self = Self {
        mode: LightingMode::ScreenSpace,
        aperture_deg: 60.0,
        variant: SliceVariant::Mended,
        slice_grid: 2,
        slice_mm: 2.0,
        reference_mm: 2.5,
        sub_cones: 6,
        coarsest_level: 3,
        cone_step: 1.0,
        cell_mm: 4.0,
        vicinity_samples: 64,
        vicinity_mm: 3.0,
        mutual: MutualOcclusion::ALL,
    };
}

/// How much work a frame may be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Point pairs that ambient occlusion tests at each pixel, 1 to [`Quality::MOST_SAMPLES`].
    pub occlusion_samples: u32,
    /// How far it reaches.
    pub occlusion_radius_mm: f64,
    /// 0 (none) to 1 (hidden places black).
    pub occlusion_strength: f64,
    /// How much hidden places take on the colour of what hides them, 0 to 1.
    pub color_bleeding: f64,
    /// Distance between samples of the context image along a ray, millimetres; where its finest
    /// spacing is above 1 mm, that many times as much. Above 0; anything else
    /// is taken for the finest step there is, as are steps that would need more than
    /// [`Quality::MOST_CONTEXT_STEPS`] for the image's diagonal.
    pub context_step_mm: f64,
    /// Pixels drawn to pixels asked for, along each side; above 0, at most 1.
    pub resolution_scale: f64,
    /// How light is found, and how well.
    pub lighting: LightSettings,
    /// Where on the path of [`crate::light::at_cost`] this is; `None` beside it, and for screen-space light.
    pub cost: Option<f64>,
}

impl Quality {
    /// The most point pairs of ambient occlusion.
    pub const MOST_SAMPLES: u32 = 32;
    /// The most samples of the context image along a ray.
    pub const MOST_CONTEXT_STEPS: u32 = 8192;

    /// At rest, and for files: screen-space light.
    pub const FULL: Self = Self {
        occlusion_samples: 12,
        occlusion_radius_mm: 6.0,
        occlusion_strength: 0.75,
        color_bleeding: 0.35,
        context_step_mm: 0.5,
        resolution_scale: 1.0,
        lighting: LightSettings::DEFAULT,
        cost: None,
    };

    /// While dragging: half the resolution, fewer samples.
    pub const DRAFT: Self =
        Self { occlusion_samples: 6, context_step_mm: 1.0, resolution_scale: 0.5, ..Self::FULL };

    /// How dark what no light reaches is, 0 to 1.
    pub(crate) fn strength(&self) -> f32 {
        self.occlusion_strength.clamp(0.0, 1.0) as f32
    }

    /// Pixels to draw for a place of `asked_px`; 0 stays 0.
    pub(crate) fn drawn_px(&self, asked_px: [u32; 2]) -> [u32; 2] {
        let scale = if self.resolution_scale > 0.0 { self.resolution_scale.min(1.0) } else { 1.0 };
        asked_px.map(|p| if p == 0 { 0 } else { ((f64::from(p) * scale).ceil() as u32).max(1) })
    }
}

impl Default for Quality {
    fn default() -> Self {
        Self::FULL
    }
}
