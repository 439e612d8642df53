//! What a light is: the trait that its passes implement, its row in the table, and what a view hands it.

use std::sync::Arc;

use glioscope_core::{RegionVolume, Selection, optics::Camera};

use crate::{
    device::{Gpu, PassName, RenderError, runner::PassRunner},
    image::{ContextVolume, TransferFunction, buffers::ImageBuffers},
    scene::{LightingMode, Plan, Quality},
};

/// The kind of scene that is lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LitKind {
    /// Masks alone, as bricks.
    Masks,
    /// An image, with masks and other opaque geometry in it.
    Image,
    /// Opaque geometry of which depths are all there is.
    Depths,
}

/// Where opaque geometry may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Opaque {
    Nowhere,
    /// Within the box of the masks, where there are any.
    InMasks,
    Anywhere,
}

/// The image of a frame and how it looks.
#[derive(Clone, Copy)]
pub(crate) struct LitImage<'a> {
    pub buffers: &'a ImageBuffers,
    pub volume: &'a Arc<ContextVolume>,
    pub transfer: &'a Arc<TransferFunction>,
    /// Its uniform, `Context` of lib/image.
    pub context: &'a wgpu::Buffer,
}

impl<'a> LitImage<'a> {
    /// Its buffers where lib/image has them.
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

/// What of a frame the passes of light read and write.
pub(crate) struct LitScene<'a> {
    /// Where the plan shows one.
    pub image: Option<LitImage<'a>>,
    pub tumor: Option<&'a Arc<RegionVolume>>,
    pub selection: &'a Selection,
    pub camera: &'a Camera,
    pub reference_mm: f64,
    pub size: [u32; 2],
    pub quality: &'a Quality,
    pub opaque: Opaque,
    /// Whether depths at which rays through the image end stand behind those of opaque geometry in `depths`.
    pub ends_apart: bool,
    pub view: &'a wgpu::Buffer,
    /// Of opaque geometry.
    pub depths: &'a wgpu::Buffer,
    pub surfaces: &'a wgpu::Buffer,
    pub marched: &'a wgpu::Buffer,
    pub occlusion: &'a wgpu::Buffer,
    /// How dark opaque geometry is, and the colour that bleeds onto it: what composing reads.
    pub blurred: &'a wgpu::Buffer,
    /// Table of bricks and their words; `None` without masks as bricks.
    pub bricks: Option<[&'a wgpu::Buffer; 2]>,
    /// Colours by the number of a surface.
    pub colors: &'a wgpu::Buffer,
}

/// What the passes of light of a frame have to do, to compare their times with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightWork {
    /// Slices, empty ones included; 0 with cones.
    pub slices: u32,
    /// Pixels of all slices, without those left out; or sub-cones of all cells of the image's light.
    pub samples: u64,
    /// Bytes that these must at least move. Slices: lights both ways, ray intervals and depths, but not what
    /// matter moves besides. Cones: image, prefiltered extinction and cells once.
    pub bytes: u64,
}

/// The march through the image, lit by this light.
pub(crate) struct LitMarch<'a> {
    pub shader: &'static str,
    /// Besides what every march is bound to.
    pub entries: Vec<(u32, wgpu::BindingResource<'a>)>,
}

/// The passes of one lighting mode on the device. Made when a frame first needs it, dropped when another mode does.
pub(crate) trait Light: Send {
    /// Binds what `plan` has of its passes: behind what finds depths, before what composes. Returns what is other
    /// than asked for, in words.
    ///
    /// # Errors
    /// [`RenderError`]: something doesn't fit on the device, or the driver refuses a shader.
    fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
    ) -> Result<Vec<String>, RenderError>;

    /// How the march through the image is lit by it; `None`: by the headlight.
    fn lit_march(&self) -> Option<LitMarch<'_>> {
        None
    }

    /// What the last frame's image asked of it; `None` without an image lit by it.
    fn work(&self) -> Option<LightWork> {
        None
    }

    /// Buffers that tests read.
    #[cfg(test)]
    fn probe(&self) -> Probe<'_> {
        Probe::default()
    }

    /// Leaves no pixel out of any step.
    #[cfg(test)]
    fn run_everywhere(&mut self) {}
}

/// What a light holds that tests compare with its twin.
#[cfg(test)]
#[derive(Default)]
pub(crate) struct Probe<'a> {
    /// What the slices noted of each pixel, see slices/finish.
    pub notes: Option<&'a wgpu::Buffer>,
    /// Light that the slices carry.
    pub carried: Option<&'a wgpu::Buffer>,
    /// Radiance and transmittance of each pixel by slices, in linear light.
    pub eye: Option<&'a wgpu::Buffer>,
    /// The grid of light about the image, and its uniform.
    pub grid: Option<[&'a wgpu::Buffer; 2]>,
}

/// What the suite needs to know of a light to test it.
#[cfg(test)]
#[derive(Clone, Copy)]
pub(crate) struct Suite {
    /// Structs of its shaders.
    pub layouts: &'static [crate::layouts::Layout],
    /// Settings that each must stand every scene; those of [`crate::scene::LightSettings::DEFAULT`] but for these.
    pub variants: &'static [crate::scene::SliceVariant],
    /// Largest difference between what its passes leave and their twin in `f64`, over scenes of its own.
    pub off_twin: fn() -> f64,
}

/// Errors on opaque surfaces and in tissue, root mean square of linear radiance against Monte Carlo, at points of
/// [`LightRow::at_cost`].
pub(crate) type Measured = &'static [(f64, [f64; 2])];

/// A lighting mode: what menus call it, which passes it has, how good it is.
pub struct LightRow {
    /// Its name in sessions and on the command line.
    pub mode: LightingMode,
    /// What menus call it.
    pub title: &'static str,
    /// One line more, for tooltips.
    pub summary: &'static str,
    /// Whether a picture at rest may take long: the window then draws it in parts.
    pub takes_long: bool,
    /// Whether [`crate::scene::LightSettings::aperture_deg`] counts.
    pub has_aperture: bool,
    /// Cost, of balanced's, at which the reference is.
    pub most_cost: f64,
    /// Cost that the automatic mode begins with: in time on two cores with a software adapter.
    pub first_cost: f64,
    pub(crate) passes: fn(LitKind) -> &'static [PassName],
    /// Why one of `passes` is left out, where there is no opaque geometry or no image for these reasons.
    pub(crate) left_out: fn(
        PassName,
        &Quality,
        no_opaque: Option<&'static str>,
        no_image: Option<&'static str>,
    ) -> Option<&'static str>,
    /// Flags of the view's uniform that the passes stand for.
    pub(crate) flags: &'static [(PassName, u32)],
    /// The pass that draws the image, where it isn't the march.
    pub(crate) image_pass: Option<PassName>,
    /// Those of its passes that arrows must be merged for among opaque geometry, the first the one that darkens them;
    /// empty: arrows are drawn over the finished light.
    pub(crate) reads_arrows: fn(&Quality) -> &'static [PassName],
    /// The knobs that take about `cost` times as long as balanced; `cost` is above 0, at most `most_cost`.
    pub(crate) at_cost: fn(cost: f64) -> Quality,
    pub(crate) measured: Measured,
    #[cfg(test)]
    pub(crate) suite: Suite,
    pub(crate) start: fn(&Gpu) -> Box<dyn Light>,
}

/// Why there is no light where occlusion has no strength.
pub(crate) fn no_strength(quality: &Quality) -> Option<&'static str> {
    is_none(quality.occlusion_strength).then_some("occlusion strength is 0")
}

/// Whether a knob asks for nothing; not a number is nothing.
pub(crate) fn is_none(x: f64) -> bool {
    x.is_nan() || x <= 0.0
}
