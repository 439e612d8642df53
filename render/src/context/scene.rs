//! What a context view shows, and which passes that takes.

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{RegionVolume, Selection};
use serde::{Deserialize, Serialize};

use super::volume::ContextVolume;
use crate::{
    camera::Camera,
    lighting::{left_out, passes},
    palette::{MaskColors, Rgb},
    plan::{PassName, Plan},
    quality::Quality,
    renderer::{RenderError, check_view},
    scene::{Lens, Scene},
    transfer::TransferFunction,
    tubes::DrawnTubes,
    uniforms::reference_to,
};

/// The most clipping planes of a scene.
pub const MOST_CLIP_PLANES: usize = 6;

/// Keeps the half of space where `normal · p <= offset_mm`. `normal` need not be of unit length, but
/// then `offset_mm` is in its lengths too; it must be finite and not zero.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipPlane {
    /// Points to what is cut away, world axes.
    pub normal: DVec3,
    /// Where the plane is along it.
    pub offset_mm: f64,
}

/// A context view to draw. Two are equal when they draw the same picture: volumes by identity, which
/// costs nothing a frame.
#[derive(Clone, Debug)]
pub struct ContextScene {
    /// The image; `None` without one: then the tumour stands alone.
    pub volume: Option<Arc<ContextVolume>>,
    /// How its values look.
    pub transfer: Arc<TransferFunction>,
    /// What of the image is cut away, at most [`MOST_CLIP_PLANES`]; the tumour stays whole.
    pub clip: Vec<ClipPlane>,
    /// The regions; `None` where no voxel is active. Its box is opened in the image whether or not
    /// anything in it is shown.
    pub tumor: Option<Arc<RegionVolume>>,
    /// Which regions are shown. The lens does not cut here.
    pub selection: Selection,
    /// Their colours.
    pub colors: MaskColors,
    /// The lens, whose ring is drawn; `None` when it is off.
    pub lens: Option<Lens>,
    /// Fibre tracts beside it. They are cut no more than the tumour is.
    pub tubes: Vec<DrawnTubes>,
    /// Where it is seen from.
    pub camera: Camera,
    /// What is behind everything.
    pub background: Rgb,
    /// Colour of the tumour's silhouettes.
    pub silhouette: Rgb,
}

fn same<T>(a: Option<&Arc<T>>, b: Option<&Arc<T>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    }
}

impl PartialEq for ContextScene {
    fn eq(&self, other: &Self) -> bool {
        let Self {
            volume,
            transfer,
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
    /// The tumour's part, as the passes that it shares with the closeup take it.
    pub(crate) fn tumor_scene(&self) -> Scene {
        Scene {
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

    /// View depth of the plane that depths are counted from: through the middle of the tumour, or of
    /// the image without one.
    pub(crate) fn reference_mm(&self) -> f64 {
        let grid = self.tumor.as_ref().map(|t| t.grid()).or(self.volume.as_ref().map(|v| v.grid()));
        reference_to(&self.camera, grid.map_or(self.camera.focus_mm, |g| g.center_mm()))
    }

    /// Refuses what can't be drawn.
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

/// The passes that `scene` needs at `quality`. Leaving the others out changes no pixel.
pub fn context_plan(scene: &ContextScene, quality: &Quality) -> Plan {
    let no_surface = match &scene.tumor {
        None => Some("no mask is active"),
        Some(t) if !t.bits_of_id().iter().any(|&bits| scene.selection.shows(bits)) => {
            Some("selection is empty")
        }
        Some(_) => None,
    };
    let no_tubes = if scene.tubes.iter().any(DrawnTubes::draws) {
        None
    } else if scene.tubes.iter().any(|tubes| !tubes.shown) {
        Some("fibre tracts are hidden")
    } else {
        Some("no fibre tracts")
    };
    // Anything solid will do.
    let no_solid = no_surface.filter(|_| no_tubes.is_some());
    let no_context = if scene.volume.is_none() {
        Some("no context image")
    } else if scene.transfer.is_transparent() {
        Some("transfer function is transparent")
    } else {
        None
    };
    let is_1d = scene.transfer.gradient().is_none().then_some("transfer function is 1-D");
    Plan::of(&passes(&PassName::CONTEXT, quality.lighting.shading), |pass| match pass {
        PassName::Surface => no_surface,
        PassName::Tubes | PassName::TubesMerge => no_tubes,
        PassName::GradientOpacity => no_context.or(is_1d),
        _ => left_out(pass, quality, no_solid, no_context),
    })
}
