//! Quality settings of a frame, and named presets of them. [`crate::light`] defines the settings of each preset.

use glam::DVec3;
use glioscope_core::optics::Camera;
use serde::{Deserialize, Serialize};

use super::keywords::keywords;

keywords! {
    /// Points on the measured Pareto front of error and time (docs/accuracy.md).
    pub enum Preset {
        /// For slow machines and while the camera moves.
        Draft,
        /// Where more time improves little.
        Balanced,
        /// For figures.
        Reference,
    }
}

impl Preset {
    /// Its name on the command line and in menus.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

keywords! {
    /// How light is computed. Each mode has a row in [`crate::light::LIGHTS`].
    #[derive(Default)]
    pub enum LightingMode {
        /// Ambient occlusion by point pairs in the depths, and a headlight on the gradients of the image.
        ScreenSpace,
        /// The same with ambient occlusion by horizons of depths and normals.
        Horizon,
        /// The same with ambient occlusion by rays through the masks, where a view shows masks alone.
        #[default]
        Traced,
        /// Directional occlusion by slices; vicinity occlusion of opaque geometry.
        Slices,
        /// Cones traced through the image and the masks.
        Cones,
        /// Hard shadows of one placed lamp, by half-angle slicing.
        HalfAngle,
        /// Shadows of one placed lamp, carried through cells of the image.
        ShadowVolume,
        /// Light of a sky about a placed lamp, by spherical harmonics.
        SphericalHarmonics,
        /// Ambient occlusion of tissue by histograms of what is around, known before any transfer function.
        DynamicAmbient,
        /// Paths of light by Monte Carlo: a sky, a lamp, many scatterings. For explaining, not for reading.
        PathTraced,
        /// The headlight, and darkness behind the mean depth of the surroundings.
        DepthDarkening,
        /// The headlight, and darkness behind the mean depths of squares of several sizes.
        VicinityMap,
    }
}

impl LightingMode {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

keywords! {
    /// How occlusion is propagated from slice to slice.
    pub enum SliceVariant {
        /// Footprint tan θ·√(d·d_ref) with the variance of solid-angle-uniform directions, exact on any
        /// stack of layers. For soft media: at short distances its footprint is wider than the cone, so that a
        /// tilted opaque surface darkens itself, the more the finer the slices (measured; use cones for opaque
        /// labels).
        #[strum(serialize = "mended")]
        Mended,
        /// The paper's Algorithm 3: footprint d·tan θ, samples attenuated over the slice distance.
        #[strum(serialize = "paper")]
        PaperApproximate,
        /// The paper's Algorithm 2: footprint d·tan θ, each sample attenuated over its own distance.
        #[strum(serialize = "paper-exact")]
        PaperExact,
    }
}

keywords! {
    /// What a placed lamp stands still to.
    #[derive(Default)]
    pub enum LampFrame {
        /// The viewer: the lamp goes with the camera.
        #[default]
        Viewer,
        /// The patient: shadows stay where they are when the camera turns.
        Patient,
    }
}

/// Where a lamp far away stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// What it stands still to.
    pub frame: LampFrame,
    /// To the viewer's right, degrees: 0 is at the eye, 90 at the right, 180 behind the scene. In the patient's frame 0 is in
    /// front of the face, 90 at the patient's left.
    pub azimuth_deg: f64,
    /// Upwards, degrees: -90 to 90. In the patient's frame 90 is above the head.
    pub elevation_deg: f64,
}

impl Lamp {
    /// At the upper left, where medical illustrators place it.
    pub const DEFAULT: Self = Self { frame: LampFrame::Viewer, azimuth_deg: -45.0, elevation_deg: 45.0 };

    /// Direction towards it, unit length, world. Angles that aren't finite count as 0.
    pub fn direction(&self, camera: &Camera) -> DVec3 {
        let finite = |deg: f64| if deg.is_finite() { deg } else { 0.0 };
        let (azimuth, elevation) = (finite(self.azimuth_deg), finite(self.elevation_deg).clamp(-90.0, 90.0));
        // As seen by a viewer in front of the lamp's azimuth 0.
        let from_above = Camera::orientation(azimuth, elevation) * DVec3::Z;
        match self.frame {
            LampFrame::Patient => from_above,
            LampFrame::Viewer => {
                let [right, up, back] = camera.axes();
                // A viewer in front of the face has the patient's left at the right.
                back * from_above.y - right * from_above.x + up * from_above.z
            }
        }
    }
}

impl Default for Lamp {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of paths of light. Values out of their range are replaced by the nearest one within, NaN by the least.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PathSettings {
    /// The most paths of a pixel, 2 to [`PathSettings::MOST`], in two halves: an odd number is one more. Tiles of pixels with
    /// a standard error below 0.01 have fewer.
    pub most: u32,
    /// The most scatterings of a path, 1 to [`PathSettings::MOST_BOUNCES`]; 1 is single scattering.
    pub bounces: u32,
    /// Mean cosine of the angle by which the image scatters light (Henyey and Greenstein 1941): 0 equally everywhere, 0.9
    /// forwards; -0.95 to 0.95.
    pub anisotropy: f64,
    /// Share of the lamp in the light on a white surface that faces it, 0 to 1; the rest is a white sky all around.
    pub lamp_share: f64,
    /// Angular radius of the lamp, degrees: 0 (hard shadows) to 60.
    pub lamp_radius_deg: f64,
}

impl PathSettings {
    /// The most paths of a pixel.
    pub const MOST: u32 = 4096;
    /// The most scatterings of a path.
    pub const MOST_BOUNCES: u32 = 64;

    /// The settings that presets start from.
    pub const DEFAULT: Self =
        Self { most: 32, bounces: 16, anisotropy: 0.0, lamp_share: 0.4, lamp_radius_deg: 10.0 };
}

impl Default for PathSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Which of image and opaque geometry occlude each other (Schott et al. 2012, figure 2). For the slices mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MutualOcclusion {
    /// The image occludes itself.
    pub image_on_image: bool,
    /// Opaque geometry occludes the image.
    pub opaque_on_image: bool,
    /// The image occludes opaque geometry.
    pub image_on_opaque: bool,
    /// Opaque surfaces occlude each other: vicinity occlusion.
    pub opaque_on_opaque: bool,
}

impl MutualOcclusion {
    /// All of them.
    pub const ALL: Self =
        Self { image_on_image: true, opaque_on_image: true, image_on_opaque: true, opaque_on_opaque: true };
    /// None of them.
    pub const NONE: Self = Self {
        image_on_image: false,
        opaque_on_image: false,
        image_on_opaque: false,
        opaque_on_opaque: false,
    };
}

/// Settings of the lighting.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightSettings {
    /// Lighting mode.
    pub mode: LightingMode,
    /// Half the opening angle of the cone that light arrives through, around the direction to the eye or to the lamp;
    /// degrees, 0 to 85.
    pub aperture_deg: f64,
    /// How occlusion is propagated from slice to slice.
    pub variant: SliceVariant,
    /// Slices: samples along a side of the footprint, 1 to 13.
    pub slice_grid: u32,
    /// Slices, and half-angle slicing: distance between slices.
    pub slice_mm: f64,
    /// Mended slices: distance of an occluder whose penumbra is exactly the cone's.
    pub reference_mm: f64,
    /// Cones: sub-cones, 1 to [`LightSettings::MOST_SUB_CONES`].
    pub sub_cones: u32,
    /// Cones: coarsest level of prefiltered extinction that is read.
    pub coarsest_level: u32,
    /// Cones: step along a sub-cone, in cells of the level read.
    pub cone_step: f64,
    /// Cones and modes after half-angle slicing: side of the image's light cells; cells of one voxel are the finest.
    pub cell_mm: f64,
    /// Vicinity occlusion: samples, 1 to [`LightSettings::MOST_VICINITY`].
    pub vicinity_samples: u32,
    /// Vicinity occlusion: virtual slice distance; its radius is tan(aperture) times this.
    pub vicinity_mm: f64,
    /// Layers of light among opaque surfaces: side of a cell relative to the finest, at which cells are as wide as a
    /// footprint's samples are apart; 1 to 4.
    #[serde(default = "default_layer_cell")]
    pub layer_cell: f64,
    /// Half-angle slicing, shadow volume, spherical harmonics, paths, and where `towards_lamp` is set: where the light stands.
    #[serde(default)]
    pub lamp: Lamp,
    /// Slices and cones: whether the cone of light is around the direction to the lamp instead of that to the eye. Modes with a
    /// headlight: whether tissue is shaded by the lamp instead.
    #[serde(default)]
    pub towards_lamp: bool,
    /// Half-angle slicing: side of a texel of the light's buffer; above 0.
    #[serde(default = "default_lamp_texel_mm")]
    pub lamp_texel_mm: f64,
    /// Spherical harmonics: order, 0 to [`LightSettings::MOST_SKY_ORDER`]; (order + 1)² functions.
    #[serde(default = "default_sky_order")]
    pub sky_order: u32,
    /// Spherical harmonics: directions in which each cell looks, and about as many for surfaces; 1 to
    /// [`LightSettings::MOST_SUB_CONES`].
    #[serde(default = "default_sky_directions")]
    pub sky_directions: u32,
    /// Spherical harmonics: share of the light that comes evenly from everywhere, 0 to 1.
    #[serde(default = "default_sky_share")]
    pub sky_share: f64,
    /// Dynamic ambient occlusion: clusters of surroundings, 1 to [`LightSettings::MOST_CLUSTERS`].
    #[serde(default = "default_clusters")]
    pub clusters: u32,
    /// Dynamic ambient occlusion and spherical harmonics: how much of its colour tissue gives to what it darkens, 0 (none) to 1.
    #[serde(default)]
    pub tissue_bleeding: f64,
    /// Paths of light.
    #[serde(default)]
    pub paths: PathSettings,
    /// Modes with a headlight: how much tissue is shaded by its gradients, 0 (not) to 1.
    #[serde(default = "default_tissue_shading")]
    pub tissue_shading: f64,
    /// What occludes what.
    pub mutual: MutualOcclusion,
}

/// Of sessions from before the setting was there.
fn default_layer_cell() -> f64 {
    LightSettings::DEFAULT.layer_cell
}

fn default_lamp_texel_mm() -> f64 {
    LightSettings::DEFAULT.lamp_texel_mm
}

fn default_sky_order() -> u32 {
    LightSettings::DEFAULT.sky_order
}

fn default_sky_directions() -> u32 {
    LightSettings::DEFAULT.sky_directions
}

fn default_clusters() -> u32 {
    LightSettings::DEFAULT.clusters
}

fn default_tissue_shading() -> f64 {
    LightSettings::DEFAULT.tissue_shading
}

fn default_sky_share() -> f64 {
    LightSettings::DEFAULT.sky_share
}

impl LightSettings {
    /// The highest order of spherical harmonics.
    pub const MOST_SKY_ORDER: u32 = 5;
    /// The most clusters of surroundings.
    pub const MOST_CLUSTERS: u32 = 1024;
    /// The most sub-cones of a view.
    pub const MOST_SUB_CONES: u32 = 128;
    /// The most samples of vicinity occlusion, as many as in the paper.
    pub const MOST_VICINITY: u32 = 118;

    /// The settings that presets start from.
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
        layer_cell: 1.5,
        lamp: Lamp::DEFAULT,
        towards_lamp: false,
        lamp_texel_mm: 1.0,
        sky_order: 3,
        sky_directions: 64,
        sky_share: 0.25,
        clusters: 128,
        tissue_bleeding: 0.0,
        paths: PathSettings::DEFAULT,
        tissue_shading: 1.0,
        mutual: MutualOcclusion::ALL,
    };
}

/// Quality settings of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Sample pairs of ambient occlusion per pixel, 1 to [`Quality::MOST_SAMPLES`].
    pub occlusion_samples: u32,
    /// Radius of ambient occlusion, of tissue too.
    pub occlusion_radius_mm: f64,
    /// 0 (none) to 1 (hidden places black).
    pub occlusion_strength: f64,
    /// Colour bleeding from occluders to occluded places, 0 to 1.
    pub color_bleeding: f64,
    /// Rays of traced ambient occlusion per pixel, 1 to [`Quality::MOST_RAYS`].
    pub occlusion_rays: u32,
    /// Soft light at the eye in the closeup: from 0 (none, flat colours) to 1 (rims darkest).
    pub relief: f64,
    /// Whether the closeup shows a level set of the smoothed voxels instead of the voxels' faces: for the eye only. What
    /// has no level set near it, such as single voxels, stays as it is.
    pub smooth: bool,
    /// Distance between samples of the context image along a ray, millimetres; multiplied by the image's finest
    /// spacing in millimetres where that is above 1. Above 0; other values, and steps that would need more than
    /// [`Quality::MOST_CONTEXT_STEPS`] for the image's diagonal, are replaced by the finest step.
    pub context_step_mm: f64,
    /// Ratio of drawn to requested pixels along each side; above 0, at most 1.
    pub resolution_scale: f64,
    /// Lighting mode and its settings.
    pub lighting: LightSettings,
    /// Position on the path of [`crate::light::at_cost`]; `None` off that path, and for screen-space light.
    pub cost: Option<f64>,
}

impl Quality {
    /// The most sample pairs of ambient occlusion.
    pub const MOST_SAMPLES: u32 = 32;
    /// The most rays of traced ambient occlusion.
    pub const MOST_RAYS: u32 = 256;
    /// The most samples of the context image along a ray.
    pub const MOST_CONTEXT_STEPS: u32 = 8192;

    /// At rest, and for files: screen-space light.
    pub const FULL: Self = Self {
        occlusion_samples: 12,
        occlusion_radius_mm: 6.0,
        occlusion_strength: 0.75,
        color_bleeding: 0.35,
        occlusion_rays: 64,
        relief: 1.0,
        smooth: false,
        context_step_mm: 0.5,
        resolution_scale: 1.0,
        lighting: LightSettings::DEFAULT,
        cost: None,
    };

    /// While dragging: half the resolution, fewer samples.
    pub const DRAFT: Self =
        Self { occlusion_samples: 6, context_step_mm: 1.0, resolution_scale: 0.5, ..Self::FULL };

    /// Darkness of unlit places, 0 to 1.
    pub(crate) fn strength(&self) -> f32 {
        self.occlusion_strength.clamp(0.0, 1.0) as f32
    }

    /// Frame size to draw for a requested size; 0 stays 0.
    pub(crate) fn drawn_px(&self, requested_px: [u32; 2]) -> [u32; 2] {
        let scale = if self.resolution_scale > 0.0 { self.resolution_scale.min(1.0) } else { 1.0 };
        requested_px.map(|p| if p == 0 { 0 } else { ((f64::from(p) * scale).ceil() as u32).max(1) })
    }
}

impl Default for Quality {
    fn default() -> Self {
        Self::FULL
    }
}

#[cfg(test)]
mod tests {
    use glioscope_core::optics::{AnatomicalView, Projection};
    use strum::VariantArray;

    use super::*;

    #[test]
    fn lamps_stand_where_their_angles_say() {
        let right = AnatomicalView::Right.azimuth_elevation_deg();
        let camera =
            Camera::fit(DVec3::ZERO, 10.0, Camera::orientation(right.0, right.1), Projection::Perspective);
        // A viewer at the patient's right looks along -x and has the patient's front at the right.
        for (azimuth_deg, elevation_deg, of_viewer, of_patient) in [
            (0.0, 0.0, DVec3::X, DVec3::Y),
            (90.0, 0.0, DVec3::Y, -DVec3::X),
            (-90.0, 0.0, -DVec3::Y, DVec3::X),
            (180.0, 0.0, -DVec3::X, -DVec3::Y),
            (33.0, 90.0, DVec3::Z, DVec3::Z),
            (f64::NAN, f64::NAN, DVec3::X, DVec3::Y),
            (0.0, 1e9, DVec3::Z, DVec3::Z),
        ] {
            for (frame, expected) in LampFrame::VARIANTS.iter().zip([of_viewer, of_patient]) {
                let found = Lamp { frame: *frame, azimuth_deg, elevation_deg }.direction(&camera);
                assert!(found.distance(expected) < 1e-9, "{frame:?} {azimuth_deg} {elevation_deg}: {found}");
            }
        }
    }
}
