//! How the 3D views find light: by screen-space ambient occlusion and a headlight, by slices
//! (directional occlusion and its combination with solid surfaces, Schott et al. 2009 and 2012), or by
//! cones traced through prefiltered extinction. All three fill the same buffers, so that the composing
//! passes don't know which it was.

mod cones;
mod grid;
#[cfg(test)]
mod grid_tests;
#[cfg(test)]
mod parts_tests;
mod reach;
#[cfg(test)]
mod reach_tests;
mod slices;
#[cfg(test)]
mod solid_stability_tests;
#[cfg(test)]
mod stability_tests;
#[cfg(test)]
mod tests;
pub(crate) mod uniforms;
mod vicinity;

use serde::{Deserialize, Serialize};

use std::sync::Arc;

use glioscope_core::{RegionVolume, Selection};

pub(crate) use self::reach::Seen;
pub(crate) use self::vicinity::{Solid, VicinityLight};
use self::{cones::ConeLight, slices::SliceLight};
use crate::{
    camera::Camera,
    compute::PassRunner,
    context::{ContextVolume, image::ImageBuffers},
    dos::{DosSettings, Variant},
    gpu::Gpu,
    plan::{PassName, Plan, no_occlusion},
    quality::Quality,
    renderer::RenderError,
    transfer::TransferFunction,
};

/// Which way light is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shading {
    /// Ambient occlusion from depths, and a headlight on the gradients of the image.
    #[default]
    ScreenSpace,
    /// Directional occlusion by slices; vicinity occlusion of what is solid.
    Slices,
    /// Cones traced through the image and the masks.
    Cones,
}

impl Shading {
    /// In the order of menus.
    pub const ALL: [Self; 3] = [Self::ScreenSpace, Self::Slices, Self::Cones];

    /// What the command line calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScreenSpace => "screen-space",
            Self::Slices => "slices",
            Self::Cones => "cones",
        }
    }

    /// What menus call it.
    pub fn title(self) -> &'static str {
        match self {
            Self::ScreenSpace => "Headlight and ambient occlusion",
            Self::Slices => "Directional occlusion (slices)",
            Self::Cones => "Directional occlusion (cones)",
        }
    }
}

/// Which of image and solid surfaces may darken which (Schott et al. 2012, figure 2). Of the slices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mutual {
    /// The image itself.
    pub image_on_image: bool,
    /// Solid surfaces the image.
    pub solid_on_image: bool,
    /// The image solid surfaces.
    pub image_on_solid: bool,
    /// Solid surfaces each other: vicinity occlusion.
    pub solid_on_solid: bool,
}

impl Mutual {
    /// Everything darkens everything.
    pub const ALL: Self =
        Self { image_on_image: true, solid_on_image: true, image_on_solid: true, solid_on_solid: true };
}

/// The knobs of light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lighting {
    /// Which way.
    pub shading: Shading,
    /// Half the opening of the cone that light comes from, about the way to the eye; degrees, 0 to 85.
    pub aperture_deg: f64,
    /// How the slices carry occlusion.
    pub variant: Variant,
    /// The slices' points along a side of the footprint, 1 to 13.
    pub slice_grid: u32,
    /// Distance of slices.
    pub slice_mm: f64,
    /// Distance of an occluder whose penumbra is the true cone's, of the mended slices.
    pub reference_mm: f64,
    /// Sub-cones, 1 to [`Lighting::MOST_SUB_CONES`].
    pub sub_cones: u32,
    /// Coarsest level of prefiltered extinction that cones read.
    pub coarsest_level: u32,
    /// Steps along a sub-cone, in cells of the level read.
    pub cone_step: f64,
    /// Side of the image's cells of light; those of one voxel are the finest.
    pub cell_mm: f64,
    /// Points of vicinity occlusion, 1 to [`Lighting::MOST_VICINITY`].
    pub vicinity_samples: u32,
    /// Its virtual slice distance: it reaches tan(aperture) times as far.
    pub vicinity_mm: f64,
    /// What darkens what.
    pub mutual: Mutual,
}

impl Lighting {
    /// The most sub-cones of a view.
    pub const MOST_SUB_CONES: u32 = 128;
    /// The most points of vicinity occlusion, as many as the paper takes.
    pub const MOST_VICINITY: u32 = 118;

    /// What presets start from.
    pub const DEFAULT: Self = Self {
        shading: Shading::ScreenSpace,
        aperture_deg: 60.0,
        variant: Variant::Mended,
        slice_grid: 2,
        slice_mm: 2.0,
        reference_mm: 2.5,
        sub_cones: 6,
        coarsest_level: 3,
        cone_step: 1.0,
        cell_mm: 4.0,
        vicinity_samples: 64,
        vicinity_mm: 3.0,
        mutual: Mutual::ALL,
    };

    /// What the slices are asked for.
    pub(crate) fn slice_settings(&self) -> DosSettings {
        DosSettings {
            variant: self.variant,
            aperture_deg: self.aperture_deg,
            grid: self.slice_grid,
            slice_mm: self.slice_mm,
            reference_mm: self.reference_mm,
        }
    }

    /// How far vicinity occlusion reaches.
    pub(crate) fn vicinity_radius_mm(&self) -> f64 {
        let (aperture, _) = crate::occlusion::cone::clamped_aperture(self.aperture_deg);
        let reach = self.vicinity_mm * aperture.to_radians().tan();
        if reach.is_finite() { reach.clamp(0.0, 1e6) } else { 0.0 }
    }
}

/// Those of `all` that belong to this way of finding light, or to every way. The passes of another way are
/// alternatives: they are neither run nor left out.
pub(crate) fn passes(all: &[PassName], shading: Shading) -> Vec<PassName> {
    use PassName::*;
    let belongs = |pass: &PassName| match pass {
        Occlusion | OcclusionBlur => shading == Shading::ScreenSpace,
        Slices | SlicesFinish | Vicinity => shading == Shading::Slices,
        LightGrid | SolidCones => shading == Shading::Cones,
        Context => shading != Shading::Slices,
        ArrowsMerge => shading != Shading::ScreenSpace,
        _ => true,
    };
    all.iter().copied().filter(belongs).collect()
}

/// Why one of the passes of light is left out, where `no_solid` and `no_image` say why there is nothing
/// solid or no image; `None` for those that run, and for all other passes.
pub(crate) fn left_out(
    pass: PassName,
    quality: &Quality,
    no_solid: Option<&'static str>,
    no_image: Option<&'static str>,
) -> Option<&'static str> {
    use PassName::*;
    let light = &quality.lighting;
    let dark = |x: f64| x.is_nan() || x <= 0.0;
    let no_strength = dark(quality.occlusion_strength).then_some("occlusion strength is 0");
    match pass {
        Occlusion | OcclusionBlur => no_solid.or_else(|| no_occlusion(quality)),
        SolidCones => no_solid.or(no_strength),
        Vicinity => {
            let lit = light.mutual.image_on_solid && no_image.is_none();
            let none = !light.mutual.solid_on_solid || dark(light.vicinity_radius_mm());
            no_solid.or(no_strength).or((none && !lit).then_some("nothing darkens what is solid"))
        }
        LightGrid | Slices | SlicesFinish | Context => no_image,
        _ => None,
    }
}

/// The image of a frame and how it looks.
#[derive(Clone, Copy)]
pub(crate) struct LitImage<'a> {
    pub buffers: &'a ImageBuffers,
    pub volume: &'a Arc<ContextVolume>,
    pub transfer: &'a Arc<TransferFunction>,
    /// Its uniform, `Context` of lib/image.wgsl.
    pub context: &'a wgpu::Buffer,
}

impl<'a> LitImage<'a> {
    /// Its buffers where lib/image.wgsl has them.
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
    /// How dark what no light reaches is, 0 to 1.
    pub strength: f32,
    pub view: &'a wgpu::Buffer,
    /// Of what is solid. With [`PassName::ArrowsMerge`] depths at which rays end stand behind them.
    pub depths: &'a wgpu::Buffer,
    pub surfaces: &'a wgpu::Buffer,
    pub marched: &'a wgpu::Buffer,
    pub blurred: &'a wgpu::Buffer,
    /// Bricks, words and regions of the masks.
    pub regions: [&'a wgpu::Buffer; 3],
}

/// What the passes of light of a frame have to do, to hold their times against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LightWork {
    /// Slices, those where nothing is among them; 0 with cones.
    pub slices: u32,
    /// Pixels of all slices, without those left out; or sub-cones of all cells of the image's light.
    pub samples: u64,
    /// Bytes that these must at least move. Slices: lights both ways, ray intervals and depths, but not what
    /// matter moves besides. Cones: image, prefiltered extinction and cells once.
    pub bytes: u64,
}

/// Numbers of the bindings of [`Lights::grid`].
pub(crate) const LIGHT_BINDINGS: [u32; 2] = [37, 38];

/// The passes of light that are none of screen space. Each part is made when a frame first needs it.
#[derive(Default)]
pub(crate) struct Lights {
    slices: Option<SliceLight>,
    cones: Option<ConeLight>,
    vicinity: Option<VicinityLight>,
}

impl Lights {
    /// Binds what `plan` has of [`PassName::LightGrid`], [`PassName::Slices`], [`PassName::SlicesFinish`],
    /// [`PassName::SolidCones`] and [`PassName::Vicinity`]: behind what finds depths, before what composes.
    /// Returns what is other than asked for, in words.
    ///
    /// # Errors
    /// [`RenderError`]: something doesn't fit on the card, or the driver refuses a shader.
    pub fn bind(
        &mut self,
        gpu: &Gpu,
        passes: &mut PassRunner,
        plan: &Plan,
        scene: &LitScene<'_>,
        lighting: &Lighting,
    ) -> Result<Vec<String>, RenderError> {
        let mut notes = Vec::new();
        if plan.has(PassName::LightGrid) || plan.has(PassName::SolidCones) {
            let vicinity = self.vicinity.get_or_insert_with(|| VicinityLight::new(gpu));
            vicinity.write(gpu, lighting, false);
            let cones = self.cones.get_or_insert_with(|| ConeLight::new(gpu));
            notes = cones.bind(gpu, passes, plan, scene, lighting, vicinity.uniform())?;
        } else {
            self.cones = None;
        }
        if let Some(image) = scene.image.filter(|_| plan.has(PassName::Slices)) {
            let slices = self.slices.get_or_insert_with(|| SliceLight::new(gpu));
            notes = slices.bind(gpu, passes, plan, scene, &image, lighting)?;
        } else {
            self.slices = None;
        }
        if plan.has(PassName::Vicinity) {
            let vicinity = self.vicinity.get_or_insert_with(|| VicinityLight::new(gpu));
            let through = self.slices.as_ref().and_then(SliceLight::notes);
            let LitScene { view, depths, blurred, size, .. } = *scene;
            vicinity.bind(gpu, passes, Solid { view, depths, blurred, size }, lighting, through)?;
        }
        Ok(notes)
    }

    /// The grid of light about the image and its uniform, for the march that is lit by it.
    pub fn grid(&self) -> Option<[&wgpu::Buffer; 2]> {
        self.cones.as_ref()?.grid()
    }

    /// What the last frame's image asked of the passes of light; `None` without an image lit by them.
    pub fn work(&self) -> Option<LightWork> {
        let slices = self.slices.as_ref().map(SliceLight::work);
        slices.or_else(|| self.cones.as_ref()?.work())
    }

    /// What the slices noted of each pixel, see slices_finish.wgsl.
    #[cfg(test)]
    pub fn notes(&self) -> Option<&wgpu::Buffer> {
        self.slices.as_ref()?.notes()
    }

    /// Lets the slices run every step for the whole picture.
    #[cfg(test)]
    pub fn everywhere(&mut self, gpu: &Gpu) {
        self.slices.get_or_insert_with(|| SliceLight::new(gpu)).everywhere();
    }

    /// Light that the slices carry.
    #[cfg(test)]
    pub fn carried(&self) -> Option<&wgpu::Buffer> {
        self.slices.as_ref()?.carried()
    }

    /// Radiance and transmittance of each pixel by slices, in linear light.
    #[cfg(test)]
    pub fn eye(&self) -> Option<&wgpu::Buffer> {
        self.slices.as_ref()?.eye()
    }
}

/// The reason that a view which has no image gives.
pub(crate) const NO_IMAGE: &str = "opaque foreground without context";
