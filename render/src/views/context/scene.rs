//! The scene of a context view, and its plan.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{RegionVolume, Selection, optics::Camera};

use super::projection::{ImageProjection, PROJECTION};
use crate::{
    device::{PassName, RenderError},
    image::{CONTEXT, ClipPlane, ContextVolume, GRADIENT_OPACITY, MOST_CLIP_PLANES, TransferFunction},
    light::{
        self,
        frame_error::{FrameImage, FrameScene},
        layers::LAYERS,
        lit::LitKind,
        vicinity::TUBE_SHADOWS,
    },
    scene::{
        Lens, MaskColors, Plan, Quality, RegionScene, Rgb, lens::check_view, regions::nothing_shown, same,
    },
    solid::{
        SURFACE, corners_mm,
        tubes::{DrawnTubes, TUBES, TUBES_MERGE},
        view::reference_to,
    },
    views::view3d::COMPOSE,
};

/// A context view to draw. Two are equal if they draw the same frame; volumes are compared by identity,
/// which is cheap.
#[derive(Clone, Debug)]
pub struct ContextScene {
    /// The image; `None`: the tumour is drawn alone.
    pub volume: Option<Arc<ContextVolume>>,
    /// Its transfer function.
    pub transfer: Arc<TransferFunction>,
    /// A second image, projected over the picture; `None` for none.
    pub projection: Option<ImageProjection>,
    /// Clipping planes of the image, at most [`MOST_CLIP_PLANES`]; the tumour is not clipped.
    pub clip: Vec<ClipPlane>,
    /// The regions; `None` if no voxel is active. The image is omitted in and in front of its bounding
    /// box, whether or not any region is shown.
    pub tumor: Option<Arc<RegionVolume>>,
    /// Which regions are shown. The lens does not clip here.
    pub selection: Selection,
    /// Their colours.
    pub colors: MaskColors,
    /// The lens, whose ring is drawn; `None` when it is off.
    pub lens: Option<Lens>,
    /// Fibre tracts; like the tumour, they are not clipped.
    pub tubes: Vec<DrawnTubes>,
    /// The camera.
    pub camera: Camera,
    /// Background colour.
    pub background: Rgb,
    /// Colour of the tumour's silhouettes.
    pub silhouette: Rgb,
}

impl PartialEq for ContextScene {
    fn eq(&self, other: &Self) -> bool {
        let Self {
            volume,
            transfer,
            projection,
            clip,
            tumor,
            selection,
            colors,
            lens,
            tubes,
            camera,
            background,
            silhouette,
        } = self;
        same(volume.as_ref(), other.volume.as_ref())
            && (Arc::ptr_eq(transfer, &other.transfer) || *transfer == other.transfer)
            && *projection == other.projection
            && *clip == other.clip
            && same(tumor.as_ref(), other.tumor.as_ref())
            && *selection == other.selection
            && *colors == other.colors
            && *lens == other.lens
            && *tubes == other.tubes
            && *camera == other.camera
            && *background == other.background
            && *silhouette == other.silhouette
    }
}

impl ContextScene {
    /// The tumour's part, for the passes shared with the closeup.
    pub(crate) fn tumor_scene(&self) -> RegionScene {
        RegionScene {
            tumor: self.tumor.clone(),
            selection: self.selection.clone(),
            colors: self.colors.clone(),
            lens: self.lens,
            camera: self.camera,
            background: self.background,
            silhouette: self.silhouette,
            plane: None,
        }
    }

    /// View depth of the plane that depths are relative to: through the centre of the tumour, or of
    /// the image without one.
    pub(crate) fn reference_mm(&self) -> f64 {
        let grid = self.tumor.as_ref().map(|t| t.grid()).or(self.volume.as_ref().map(|v| v.grid()));
        reference_to(&self.camera, grid.map_or(self.camera.focus_mm, |g| g.center_mm()))
    }

    /// Corners of boxes around all opaque geometry.
    pub(crate) fn solid_corners_mm(&self) -> Vec<DVec3> {
        let tubes = self.tubes.iter().filter(|t| t.draws()).filter_map(DrawnTubes::bounds_mm);
        let masks = self.tumor.iter().flat_map(|t| t.grid().corners_mm());
        masks.chain(tubes.flat_map(corners_mm)).collect()
    }

    /// What a frame shows that its light's error depends on.
    pub(crate) fn frame_scene(&self) -> FrameScene {
        let image = no_image(self).is_none().then(|| Arc::new(self.clone()) as Arc<dyn FrameImage>);
        FrameScene {
            camera: self.camera,
            tumor: self.tumor.clone(),
            selection: self.selection.clone(),
            cut: None,
            is_smooth: false,
            tubes: self.tubes.clone(),
            image,
        }
    }

    /// Rejects a scene that can't be drawn.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        check_view(&self.camera, self.lens.as_ref())?;
        if self.clip.len() > MOST_CLIP_PLANES {
            let found = self.clip.len();
            return Err(RenderError::Scene(format!("{found} clipping planes (at most {MOST_CLIP_PLANES})")));
        }
        let is_plane = |c: &ClipPlane| {
            let length = c.normal.length();
            length.is_finite() && length > 0.0 && c.offset_mm.is_finite()
        };
        match self.clip.iter().find(|c| !is_plane(c)) {
            Some(plane) => Err(RenderError::Scene(format!("clipping plane {plane:?}"))),
            None => Ok(()),
        }
    }
}

/// Why the image isn't drawn; `None` if it is.
pub(crate) fn no_image(scene: &ContextScene) -> Option<&'static str> {
    if scene.volume.is_none() {
        Some("no context image")
    } else if scene.transfer.is_transparent() {
        Some("transfer function is transparent")
    } else {
        None
    }
}

/// The passes that `scene` needs at `quality`. Omitting the others changes no pixel.
pub fn context_plan(scene: &ContextScene, quality: &Quality) -> Plan {
    let no_surface = nothing_shown(scene.tumor.as_deref(), &scene.selection);
    let no_tubes = if scene.tubes.iter().any(DrawnTubes::draws) {
        None
    } else if scene.tubes.iter().any(|tubes| !tubes.shown) {
        Some("fibre tracts are hidden")
    } else {
        Some("no fibre tracts")
    };
    // Either kind of opaque geometry is enough.
    let no_opaque = no_surface.filter(|_| no_tubes.is_some());
    let no_image = no_image(scene);
    let is_1d = (!scene.transfer.uses_gradient()).then_some("transfer function is 1-D");
    let before = [SURFACE, TUBES, TUBES_MERGE];
    Plan::of(around_light(quality, before, [PROJECTION, COMPOSE]), |pass| match pass {
        SURFACE => no_surface,
        TUBES | TUBES_MERGE => no_tubes,
        CONTEXT => no_image,
        GRADIENT_OPACITY => no_image.or(is_1d),
        PROJECTION => ImageProjection::omitted(scene.projection.as_ref()),
        LAYERS | TUBE_SHADOWS if light::row(quality.lighting.mode).traces_masks => {
            no_tubes.or(light::omission_reason(pass, quality, no_opaque, no_image))
        }
        _ => light::omission_reason(pass, quality, no_opaque, no_image),
    })
}

/// Passes of a view with an image: `before`, the light passes, the ray march unless a light pass draws the image,
/// gradient opacity, and `after`.
pub(crate) fn around_light(
    quality: &Quality,
    before: impl IntoIterator<Item = PassName>,
    after: impl IntoIterator<Item = PassName>,
) -> Vec<PassName> {
    let mode = quality.lighting.mode;
    let march = [CONTEXT].into_iter().filter(|_| light::row(mode).image_pass.is_none());
    let light = light::passes(mode, LitKind::Image).iter().copied();
    before.into_iter().chain(light).chain(march).chain([GRADIENT_OPACITY]).chain(after).collect()
}
