//! The interface of a lighting mode: the trait that its passes implement, its row in the table, and its inputs.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{RegionVolume, Selection, optics::Camera};

use crate::{
    device::{Gpu, PassName, RenderError, runner::PassRunner},
    image::{ClipPlane, ContextVolume, TransferFunction, buffers::ImageBuffers},
    scene::{Knob, LightingMode, Plan, Quality},
};

/// The kind of scene that is lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LitKind {
    /// Masks alone, as bricks.
    Masks,
    /// An image, with masks and other opaque geometry in it.
    Image,
    /// Opaque geometry known by its depths alone.
    Depths,
}

/// Where opaque geometry may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Opaque {
    Nowhere,
    /// Within the bounding box of the masks, if any.
    InMasks,
    Anywhere,
}

/// The image of a frame and its transfer function.
#[derive(Clone, Copy)]
pub(crate) struct LitImage<'a> {
    pub buffers: &'a ImageBuffers,
    pub volume: &'a Arc<ContextVolume>,
    pub transfer: &'a Arc<TransferFunction>,
    pub clip: &'a [ClipPlane],
    /// Its uniform, `Context` of lib/image.
    pub context: &'a wgpu::Buffer,
}

impl<'a> LitImage<'a> {
    /// Its buffers at the binding numbers of lib/image.
    pub fn entries(&self) -> [(u32, wgpu::BindingResource<'a>); 5] {
        [
            (11, self.context.as_entire_binding()),
            (12, self.buffers.values().as_entire_binding()),
            (13, self.buffers.visible().as_entire_binding()),
            (14, self.buffers.table().as_entire_binding()),
            (15, self.buffers.factors().as_entire_binding()),
        ]
    }
}

/// What the light passes read and write in a frame.
pub(crate) struct LitScene<'a> {
    /// The image, if the plan shows it.
    pub image: Option<LitImage<'a>>,
    pub tumor: Option<&'a Arc<RegionVolume>>,
    pub selection: &'a Selection,
    pub camera: &'a Camera,
    pub reference_mm: f64,
    pub size: [u32; 2],
    pub quality: &'a Quality,
    pub opaque: Opaque,
    /// Corners of boxes around all opaque geometry; may be a little too small.
    pub solid_corners_mm: Vec<DVec3>,
    /// Whether `depths` holds, after the opaque depths of all pixels, the depths at which rays through the image end.
    pub ends_apart: bool,
    pub view: &'a wgpu::Buffer,
    /// Depths of opaque geometry.
    pub depths: &'a wgpu::Buffer,
    pub surfaces: &'a wgpu::Buffer,
    /// Normals of opaque geometry, as lib/normal has them; written by the view if `has_normals`, else by passes that
    /// find them from depths.
    pub normals: &'a wgpu::Buffer,
    pub has_normals: bool,
    pub marched: &'a wgpu::Buffer,
    pub occlusion: &'a wgpu::Buffer,
    /// Darkness of opaque geometry and the colour that bleeds onto it; read by the composing pass.
    pub blurred: &'a wgpu::Buffer,
    /// Brick table and brick words; `None` where no masks are stored as bricks.
    pub bricks: Option<[&'a wgpu::Buffer; 2]>,
    /// Bits of the shown voxels, where masks alone are opaque.
    pub shown: Option<&'a wgpu::Buffer>,
    /// Colours by surface number.
    pub colors: &'a wgpu::Buffer,
}

/// Work of a frame's light passes, to compare their times with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightWork {
    /// Slices, empty ones included; 0 with cones.
    pub slices: u32,
    /// Slices: pixels processed over all slices, with half-angle slicing texels of light, too. Cones: sub-cones over all
    /// cells of the image's light grid. Paths: at most so many, as tiles with enough have fewer.
    pub samples: u64,
    /// Lower bound of the bytes moved. Slices: lights read and written, ray intervals and depths, without the image,
    /// the eye buffer and the notes. Cones: image, prefiltered extinction and cells once. Paths: what they found.
    pub bytes: u64,
}

/// Standard error of a frame's light, measured in the frame itself: root mean square over pixels, of linear light from 0 to
/// 1. `None` where nothing is lit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StandardError {
    /// Of the light on opaque surfaces, as much of it as is shown.
    pub surfaces: Option<f64>,
    /// Of the image's radiance.
    pub tissue: Option<f64>,
}

/// The ray march through the image, lit by this mode.
pub(crate) struct LitMarch<'a> {
    pub shader: &'static str,
    /// Bindings in addition to those of every march.
    pub entries: Vec<(u32, wgpu::BindingResource<'a>)>,
}

/// The passes of one lighting mode on the device. Created when a frame first needs them, dropped when a frame uses
/// another mode.
pub(crate) trait Light: Send {
    /// Binds those of its passes that are in `plan`: after the passes that write depths, before the composing pass.
    /// Returns notes on settings that were changed.
    ///
    /// # Errors
    /// [`RenderError`]: something doesn't fit on the device, or the driver rejects a shader.
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError>;

    /// The ray march lit by this mode; `None`: lit by the headlight.
    fn lit_march(&self) -> Option<LitMarch<'_>> {
        None
    }

    /// Work for the last frame's image; `None` without an image lit by this mode.
    fn work(&self) -> Option<LightWork> {
        None
    }

    /// The error of the last frame's light, measured in it; `None` where the mode measures none. Waits for the frame.
    ///
    /// # Errors
    /// [`RenderError::Device`] with the driver's message.
    fn measured_error(&self, _gpu: &Gpu) -> Result<Option<StandardError>, RenderError> {
        Ok(None)
    }

    /// Buffers that tests read.
    #[cfg(test)]
    fn probe(&self) -> Probe<'_> {
        Probe::default()
    }

    /// Processes every pixel in every step.
    #[cfg(test)]
    fn run_everywhere(&mut self) {}
}

/// Buffers of a lighting mode that tests compare with its twin.
#[cfg(test)]
#[derive(Default)]
pub(crate) struct Probe<'a> {
    /// Per pixel: light on opaque geometry, and the depth where half is hidden; see slices/finish.
    pub notes: Option<&'a wgpu::Buffer>,
    /// Light carried from slice to slice.
    pub carried_light: Option<&'a wgpu::Buffer>,
    /// Radiance and transmittance per pixel from the slices, in linear light.
    pub eye: Option<&'a wgpu::Buffer>,
    /// The light grid of the image, and its uniform.
    pub grid: Option<[&'a wgpu::Buffer; 2]>,
    /// Coloured light of the grid's cells, see lib/light_tints.
    pub tints: Option<&'a wgpu::Buffer>,
    /// What the paths of each pixel found, see lib/path_state.
    pub pixels: Option<&'a wgpu::Buffer>,
}

#[cfg(test)]
impl Probe<'_> {
    /// The coloured light of each cell; none where light has no colour.
    pub fn read_tints(&self) -> Vec<DVec3> {
        let Some(tints) = self.tints else { return Vec::new() };
        let read = crate::testing::GPU.read_buffers(&[(tints, 0, tints.size())]).unwrap();
        let found: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&read[0]);
        found
            .iter()
            .map(|[r, g, b, _]| DVec3::new(f64::from(*r), f64::from(*g), f64::from(*b)) / 65535.0)
            .collect()
    }
}

/// What the test suite needs from a lighting mode.
#[cfg(test)]
#[derive(Clone, Copy)]
pub(crate) struct Suite {
    /// Structs of its shaders.
    pub layouts: &'static [crate::layouts::Layout],
    /// Variants to test in every scene, with [`crate::scene::LightSettings::DEFAULT`] otherwise.
    pub variants: &'static [crate::scene::SliceVariant],
    /// Largest difference between the results of its passes and of their `f64` twin, over scenes of its own.
    pub max_twin_error: fn() -> f64,
    /// Largest share of pixels in which rounding may decide a path of light otherwise; 0 where nothing is random.
    pub decided_by_rounding: f64,
}

/// Costs as for [`LightRow::at_cost`], each with its errors on opaque surfaces and in tissue: root mean square of
/// linear radiance against Monte Carlo.
pub(crate) type Measured = &'static [(f64, [f64; 2])];

/// A lighting mode: its title, its passes and its measured accuracy.
pub struct LightRow {
    /// Its name in sessions and on the command line.
    pub mode: LightingMode,
    /// Title in menus.
    pub title: &'static str,
    /// One-line description, for tooltips.
    pub summary: &'static str,
    /// What the thesis' study (chapter 6) recommends it for, or found.
    pub advice: &'static str,
    /// Whether a frame of a scene at rest may take long; the window then draws it in parts.
    pub takes_long: bool,
    /// Whether [`crate::scene::LightSettings::aperture_deg`] has an effect.
    pub has_aperture: bool,
    /// Whether [`crate::scene::LightSettings::lamp`] has an effect.
    pub has_lamp: bool,
    /// Settings that menus show for it.
    pub knobs: &'static [Knob],
    /// Whether the closeup's smooth surface can be lit: a mode that reads the voxels would show them on it.
    pub lights_smooth: bool,
    /// Whether light past masks is traced through them, so that layers of light count tubes and arrows alone.
    pub(crate) traces_masks: bool,
    /// Cost of [`Preset::Reference`](crate::scene::Preset::Reference), relative to balanced.
    pub most_cost: f64,
    /// Initial cost of the automatic mode: fast enough on two cores with a software adapter.
    pub first_cost: f64,
    pub(crate) passes: fn(LitKind) -> &'static [PassName],
    /// Why one of `passes` is omitted, given the reasons why there is no opaque geometry or no image.
    pub(crate) omission_reason: fn(
        PassName,
        &Quality,
        no_opaque: Option<&'static str>,
        no_image: Option<&'static str>,
    ) -> Option<&'static str>,
    /// Flags of the view's uniform that each pass sets.
    pub(crate) flags: &'static [(PassName, u32)],
    /// The pass that draws the image, if not the ray march.
    pub(crate) image_pass: Option<PassName>,
    /// Its passes that need arrows merged into the opaque geometry; the first one shades the arrows. Empty: arrows are
    /// drawn over the shaded frame.
    pub(crate) reads_arrows: fn(&Quality) -> &'static [PassName],
    /// The quality that takes about `cost` times as long as balanced; `cost` is above 0, at most `most_cost`.
    pub(crate) at_cost: fn(cost: f64) -> Quality,
    pub(crate) measured: Measured,
    #[cfg(test)]
    pub(crate) suite: Suite,
    pub(crate) start: fn(&Gpu) -> Box<dyn Light>,
}

impl LightRow {
    /// Whether [`crate::scene::LightSettings::towards_lamp`] has an effect: the cone of light may point to the lamp, or gradients
    /// be shaded by it.
    pub fn turns_to_lamp(&self) -> bool {
        self.is_headlight() || matches!(self.mode, LightingMode::Slices | LightingMode::Cones)
    }

    /// Whether tissue is shaded by its gradients alone.
    pub fn is_headlight(&self) -> bool {
        self.knobs.contains(&Knob::TissueShading)
    }
}

/// Advice on directional occlusion.
pub(crate) const DEPTH_ORDER_AND_SIZE: &str =
    "Recommended for depth order and size, with all kinds of images";

/// Why light passes are omitted at occlusion strength 0.
pub(crate) fn no_strength(quality: &Quality) -> Option<&'static str> {
    is_off(quality.occlusion_strength).then_some("occlusion strength is 0")
}

/// Why ambient occlusion is omitted at its strength or radius 0.
pub(crate) fn no_occlusion(quality: &Quality) -> Option<&'static str> {
    no_strength(quality).or_else(|| is_off(quality.occlusion_radius_mm).then_some("occlusion radius is 0"))
}

/// Whether a setting is off: 0, negative or NaN.
pub(crate) fn is_off(x: f64) -> bool {
    x.is_nan() || x <= 0.0
}
