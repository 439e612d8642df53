//! What is saved: which case, what the user chose, and where they look.
//!
//! [`Edit`] is what undo covers; [`Navigation`] is not, so that undoing a selection doesn't also
//! throw the camera back. Nothing here is alive: volumes, jobs and GPU things are in
//! [`crate::world`].

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use egui_tiles::Tree;
use glam::{DVec2, DVec3};
use glioscope_core::{Selection, case::TimePoint};
use glioscope_render::{
    Camera, ClipPlane, Coloring, Lens, Lighting, Palette, Preset, Projection, Quality, Shading,
    TransferFunction,
    slices::{Convention, Overlay, Plane, Window},
};
use serde::{Deserialize, Serialize};

use crate::{
    comparing::ChangeSetting,
    layout,
    views::{
        ellipsoids::{EllipsoidLook, OwnOpacity},
        overlap::OverlapMode,
    },
};

/// How to open the case again.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CaseRef {
    /// The embedded sample.
    #[default]
    Sample,
    /// A manifest, a folder, or one NIfTI file.
    Path(PathBuf),
    /// The `--mask` and `--context` arguments.
    Arguments {
        /// Each `ID=FILE[:1,4][@TIME]`.
        masks: Vec<String>,
        /// Each `ID=FILE[@TIME]`.
        contexts: Vec<String>,
    },
}

/// One pane of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pane {
    /// The tumour intersection closeup.
    Closeup,
    /// The tumour in its anatomy.
    Context,
    /// The ellipsoid diagram.
    Ellipsoids,
    /// The surface change between two dates.
    Change,
    /// All dates, and volumes over time.
    Dates,
    /// The transfer function of the context view.
    Transfer,
    /// The overlap diagram with its bar and the table of regions.
    Overlap,
    /// A slice view.
    Slice(Plane),
    /// The table of what is in the lens.
    Lens,
    /// The list of lines measured.
    Measurements,
    /// Plan, pass times and adapter.
    Diagnostics,
}

impl Pane {
    /// All but the slices, in the order of menus.
    pub const NOT_SLICES: [Self; 10] = [
        Self::Closeup,
        Self::Context,
        Self::Ellipsoids,
        Self::Change,
        Self::Dates,
        Self::Overlap,
        Self::Lens,
        Self::Measurements,
        Self::Transfer,
        Self::Diagnostics,
    ];

    /// What tabs, menus and file names call it.
    pub fn title(self) -> &'static str {
        match self {
            Self::Closeup => "the closeup",
            Self::Context => "the context view",
            Self::Ellipsoids => "the ellipsoid diagram",
            Self::Change => "the change view",
            Self::Dates => "the dates",
            Self::Transfer => "the transfer function",
            Self::Overlap => "the overlap diagram",
            Self::Slice(Plane::Axial) => "the axial slice",
            Self::Slice(Plane::Coronal) => "the coronal slice",
            Self::Slice(Plane::Sagittal) => "the sagittal slice",
            Self::Lens => "what is in the lens",
            Self::Measurements => "measurements",
            Self::Diagnostics => "diagnostics",
        }
    }

    /// What its tab says.
    pub fn tab(self) -> &'static str {
        match self {
            Self::Closeup => "Closeup",
            Self::Context => "Context",
            Self::Ellipsoids => "Ellipsoids",
            Self::Change => "Change",
            Self::Dates => "Dates",
            Self::Transfer => "Transfer",
            Self::Overlap => "Overlap",
            Self::Slice(Plane::Axial) => "Axial",
            Self::Slice(Plane::Coronal) => "Coronal",
            Self::Slice(Plane::Sagittal) => "Sagittal",
            Self::Lens => "In the lens",
            Self::Measurements => "Measurements",
            Self::Diagnostics => "Diagnostics",
        }
    }
}

/// Where a line was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RulerView {
    /// Between first-hit points of the closeup.
    Closeup,
    /// In a slice.
    Slice(Plane),
}

impl RulerView {
    /// What lists and exports call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Closeup => "closeup",
            Self::Slice(Plane::Axial) => "axial",
            Self::Slice(Plane::Coronal) => "coronal",
            Self::Slice(Plane::Sagittal) => "sagittal",
        }
    }
}

/// A straight line that was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ruler {
    /// What the user calls it.
    pub name: String,
    /// One end, world millimetres.
    pub from_mm: DVec3,
    /// The other end.
    pub to_mm: DVec3,
    /// Where it was drawn.
    pub view: RulerView,
    /// The time point it was drawn on: it is shown there only.
    pub time: usize,
}

impl Ruler {
    /// How long it is.
    pub fn length_mm(&self) -> f64 {
        self.from_mm.distance(self.to_mm)
    }

    /// Its middle.
    pub fn middle_mm(&self) -> DVec3 {
        self.from_mm.midpoint(self.to_mm)
    }
}

/// How the 3D views find light, and how well.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// Which way.
    pub shading: Shading,
    /// How well; `None` holds a budget of time while something moves, and comes to the reference when
    /// all is still.
    pub preset: Option<Preset>,
    /// Half the opening of the cone that light comes from, degrees.
    pub aperture_deg: f64,
    /// Knobs of one's own instead of the preset's.
    #[serde(default)]
    pub own: Option<Lighting>,
}

impl Default for Light {
    fn default() -> Self {
        let Lighting { shading, aperture_deg, .. } = Lighting::DEFAULT;
        Self { shading, preset: None, aperture_deg, own: None }
    }
}

impl Light {
    /// This light at a quality that was found for its way of shading.
    pub fn at(&self, quality: Quality) -> Quality {
        let lighting = self.own.unwrap_or(Lighting { aperture_deg: self.aperture_deg, ..quality.lighting });
        Quality { lighting, cost: quality.cost.filter(|_| self.own.is_none()), ..quality }
    }
}

/// What undo covers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edit {
    /// Regions shown.
    pub selection: Selection,
    /// Whether the lens is on.
    pub lens_on: bool,
    /// The lens.
    pub lens: Lens,
    /// Window of each context the user changed, by id.
    pub windows: BTreeMap<String, Window>,
    /// How masks are drawn on slices.
    pub overlay: Overlay,
    /// Opacity of masks' fill on slices, 0 to 1.
    pub overlay_opacity: f32,
    /// Colour scheme.
    pub palette: Palette,
    /// Whether a region's colour says which masks are active or how many.
    #[serde(default)]
    pub coloring: Coloring,
    /// Lines measured, in the order they were drawn.
    #[serde(default)]
    pub rulers: Vec<Ruler>,
    /// Whether the diagram selects regions or whole masks.
    pub overlap_mode: OverlapMode,
    /// Transfer function of each context the user changed, by id.
    #[serde(default)]
    pub transfers: BTreeMap<String, TransferFunction>,
    /// Planes that cut the context open.
    #[serde(default)]
    pub clips: Vec<ClipPlane>,
    /// Fibre tracts that are not drawn, by id.
    #[serde(default)]
    pub hidden_tracts: BTreeSet<String>,
    /// How the ellipsoid diagram is drawn.
    #[serde(default)]
    pub ellipsoids: EllipsoidLook,
    /// Ellipsoids with an opacity of their own.
    #[serde(default)]
    pub ellipsoid_opacities: Vec<OwnOpacity>,
    /// How the 3D views find light, and how well.
    #[serde(default)]
    pub light: Light,
    /// Which dates are compared, and how that is drawn.
    #[serde(default)]
    pub change: ChangeSetting,
    /// Where panes are.
    pub layout: Tree<Pane>,
    /// The pane that fills the window, if one does.
    pub maximized: Option<Pane>,
}

/// Where the user looks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Navigation {
    /// Which time point is current.
    pub time: usize,
    /// The closeup's camera.
    pub camera: Camera,
    /// The crosshair, world millimetres.
    pub cursor_mm: DVec3,
    /// Which context the slices show, by id; `None` for none.
    pub context: Option<String>,
    /// Which side left is drawn on.
    pub convention: Convention,
    /// Magnification of the slices: millimetres a logical point; `None` fits the image.
    pub mm_per_point: Option<f64>,
    /// In-plane shift of each slice's middle from the image's, in picture millimetres (right, down).
    pub pan_mm: [DVec2; 3],
    /// Whether the crosshair follows the pointer over every view.
    pub follow_pointer: bool,
    /// Magnification of the context view; 1 fits.
    #[serde(default = "one")]
    pub context_zoom: f64,
    /// Magnification of the ellipsoid diagram; 1 fits.
    #[serde(default = "one")]
    pub ellipsoid_zoom: f64,
    /// Magnification of the change view; 1 fits.
    #[serde(default = "one")]
    pub change_zoom: f64,
    /// Whether the axial slice is shown as a plane in closeup and ellipsoid diagram.
    #[serde(default)]
    pub show_plane: bool,
    /// Whether dragging measures. A way to use the mouse, not worth saving.
    #[serde(skip)]
    pub ruler_on: bool,
}

fn one() -> f64 {
    1.0
}

/// A case and how it is looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// The case.
    pub case: CaseRef,
    /// Files of fibre tracts beside those that the case names.
    #[serde(default)]
    pub tracts: Vec<PathBuf>,
    /// What undo covers.
    pub edit: Edit,
    /// What it doesn't.
    pub nav: Navigation,
}

/// A lens about the tumour of `time_point`: on its centroid, with the radius of a ball of half again the union's
/// volume, so that the start shows an inside and an outside.
pub fn default_lens(time_point: &TimePoint) -> Lens {
    let regions = &time_point.regions;
    let center_mm = regions.centroid_mm().unwrap_or_else(|| time_point.index.grid().center_mm());
    let volume_mm3 = regions.union_ml() * 1000.0 * 1.5;
    let ball_mm = (volume_mm3 * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
    let smallest_mm = time_point.index.grid().spacing_mm().max_element() * 2.0;
    Lens { center_mm, radius_mm: if regions.union_voxels() == 0 { 20.0 } else { ball_mm.max(smallest_mm) } }
}

/// Half the diagonal of the active voxels' box: what the camera has to hold.
pub fn tumor_radius_mm(time_point: &TimePoint) -> f64 {
    let grid = time_point.index.grid();
    let corners = time_point
        .regions
        .bounds()
        .and_then(|(start, dims)| grid.crop(start, dims).ok())
        .map_or_else(|| grid.corners_mm(), |part| part.corners_mm());
    corners.iter().flat_map(|a| corners.iter().map(move |b| a.distance(*b))).fold(0.0, f64::max) / 2.0
}

impl Document {
    /// How a freshly opened case looks: everything shown, the lens on the tumour, seen from the
    /// front, a little from the left and above.
    pub fn new(case: CaseRef, time_point: &TimePoint, dates: usize) -> Self {
        let lens = default_lens(time_point);
        let camera = Camera::fit(
            lens.center_mm,
            tumor_radius_mm(time_point),
            Camera::orientation(30.0, 20.0),
            Projection::Perspective,
        );
        Self {
            case,
            tracts: Vec::new(),
            edit: Edit {
                selection: Selection::all(),
                lens_on: time_point.regions.union_voxels() > 0,
                lens,
                windows: BTreeMap::new(),
                overlay: Overlay::Both,
                overlay_opacity: 0.35,
                palette: Palette::Thesis,
                coloring: Coloring::Masks,
                rulers: Vec::new(),
                overlap_mode: OverlapMode::Regions,
                transfers: BTreeMap::new(),
                clips: Vec::new(),
                hidden_tracts: BTreeSet::new(),
                ellipsoids: EllipsoidLook::default(),
                ellipsoid_opacities: Vec::new(),
                light: Light::default(),
                change: ChangeSetting::default(),
                layout: layout::default_layout(dates),
                maximized: None,
            },
            nav: Navigation {
                time: 0,
                camera,
                cursor_mm: lens.center_mm,
                context: time_point.contexts.first().map(|c| c.id.clone()),
                convention: Convention::Radiological,
                mm_per_point: None,
                pan_mm: [DVec2::ZERO; 3],
                follow_pointer: true,
                context_zoom: 1.0,
                ellipsoid_zoom: 1.0,
                change_zoom: 1.0,
                show_plane: false,
                ruler_on: false,
            },
        }
    }

    /// A camera for another 3D view: it looks the way the closeup does, at its own thing and from its
    /// own distance (thesis 7.3.3: orientation, not position, is linked). `radius_mm` is what it has to
    /// hold about `focus_mm`.
    pub fn linked_camera(&self, focus_mm: DVec3, radius_mm: f64) -> Camera {
        let closeup = &self.nav.camera;
        Camera::fit(focus_mm, radius_mm, closeup.world_from_camera, closeup.projection)
    }

    /// The lines measured on the time point shown, with their places in the list.
    pub fn rulers_shown(&self) -> impl Iterator<Item = (usize, &Ruler)> {
        self.edit.rulers.iter().enumerate().filter(|(_, ruler)| ruler.time == self.nav.time)
    }

    /// A name that no line has yet: `Line 3`.
    pub fn new_ruler_name(&self) -> String {
        let taken = |name: &str| self.edit.rulers.iter().any(|ruler| ruler.name == name);
        (self.edit.rulers.len() + 1..).map(|n| format!("Line {n}")).find(|n| !taken(n)).unwrap_or_default()
    }

    /// The lens where it is on.
    pub fn active_lens(&self) -> Option<Lens> {
        self.edit.lens_on.then_some(self.edit.lens)
    }
}
