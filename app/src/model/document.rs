//! The document: which case is open, the user's settings, and the navigation state.
//!
//! Undo covers [`Edit`] but not [`Navigation`], so that undoing a selection doesn't also move the camera. Volumes, jobs
//! and device resources are in [`crate::world`].

use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
};

use egui_tiles::Tree;
use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid,
    case::{Alignment, Case, CaseGridChoice, LoadOptions, OrderBasis, TimePoint},
    optics::{Camera, Projection},
};
use glioscope_render::{
    ClipPlane, Coloring, Lens, Palette, TransferFunction,
    flat::{Convention, Overlay, Plane, PreparedContext, Window},
};
use serde::{Deserialize, Serialize};

use super::{
    agreement::AgreementSetting,
    change::ChangeSetting,
    ellipsoids::{EllipsoidLook, EllipsoidOpacity},
    fibers::FiberLook,
    fusion::{Fusion, second_of},
    hidden::HiddenRegions,
    layout::{self, Held, Task},
    lesions::LesionSetting,
    light::LightChoice,
    made::MadeMask,
    masks::MaskLooks,
    overlap::OverlapMode,
    pane::PaneId,
    reading::Reading,
    response::{ResponseSetting, Usual},
    rulers::Ruler,
    shape::Tool,
    slice_axes::SliceAxes,
    take_home::TakeHome,
};

/// The most views kept for a report.
pub const MOST_PICTURES: usize = 40;
/// The longest caption, characters.
pub const MOST_CAPTION: usize = 500;

/// The source from which the case is opened.
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
    /// Files of a folder, as the user said what they are.
    Files {
        /// The folder.
        folder: PathBuf,
        /// What they are: the text of a manifest, with paths relative to the folder.
        manifest: String,
        /// Files that were left out, relative to the folder.
        #[serde(default)]
        left_out: Vec<PathBuf>,
    },
}

/// A view kept for the report: what is seen is drawn again from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyPicture {
    /// The view.
    pub pane: PaneId,
    /// What the reader writes below it; empty: the report's own words.
    pub caption: String,
    /// Its size on the screen, points.
    pub size_points: [f32; 2],
    /// Where the views were.
    pub nav: Navigation,
    /// What was shown and how, without what holds for the whole case: see [`KeyPicture::document`].
    pub edit: Box<Edit>,
}

impl KeyPicture {
    /// The view as `doc` shows it now.
    fn of(doc: &Document, pane: PaneId, size_points: [f32; 2]) -> Self {
        let mut kept = Self {
            pane,
            caption: String::new(),
            size_points,
            nav: doc.nav.clone(),
            edit: Box::new(doc.edit.clone()),
        };
        // The crosshair where it is pinned: the pointer was brought to the view to press the key.
        kept.nav.preview = None;
        kept.without_the_case();
        kept
    }

    /// Drops what holds for the whole case, and isn't of the picture.
    pub(super) fn without_the_case(&mut self) {
        let edit = &mut *self.edit;
        (edit.pictures, edit.made, edit.alignments) = (Vec::new(), Vec::new(), Vec::new());
        (edit.reading, edit.take_home) = (Reading::default(), TakeHome::default());
        (edit.masks, edit.lesions, edit.response) =
            (MaskLooks::default(), LesionSetting::default(), ResponseSetting::default());
        (edit.layout, edit.maximized) = (layout::single(self.pane), None);
    }

    /// `doc` as it is to be drawn: with what the picture kept, and the case's transforms, masks, lesions and names as they are
    /// now.
    pub fn document(&self, doc: &Document) -> Document {
        let Edit { made, alignments, masks, lesions, response, .. } = doc.edit.clone();
        let edit = Edit { made, alignments, masks, lesions, response, ..(*self.edit).clone() };
        Document { edit, nav: self.nav.clone(), ..doc.clone() }
    }
}

/// The state that undo covers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edit {
    /// Which regions are hidden.
    pub selection: HiddenRegions,
    /// Whether the lens is on.
    pub lens_on: bool,
    /// The lens.
    pub lens: Lens,
    /// Windows changed by the user, by context id.
    pub windows: BTreeMap<String, Window>,
    /// How masks are drawn on slices.
    pub overlay: Overlay,
    /// Opacity of masks' fill on slices, 0 to 1.
    pub overlay_opacity: f32,
    /// Whether outlines on slices are solid, dashed and dotted in turn.
    #[serde(default)]
    pub outline_patterns: bool,
    /// Registration transforms in addition to the case's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alignments: Vec<Alignment>,
    /// A second image on slices.
    #[serde(default)]
    pub fusion: Fusion,
    /// Colour scheme.
    pub palette: Palette,
    /// Whether a region's colour shows which masks are active or how many.
    #[serde(default)]
    pub coloring: Coloring,
    /// Names and colours of masks.
    #[serde(default)]
    pub masks: MaskLooks,
    /// Masks made from those of the case.
    #[serde(default)]
    pub made: Vec<MadeMask>,
    /// Measured lines, in the order they were drawn.
    #[serde(default)]
    pub rulers: Vec<Ruler>,
    /// Whether the diagram selects regions or whole masks.
    pub overlap_mode: OverlapMode,
    /// Transfer functions changed by the user, by context id.
    #[serde(default)]
    pub transfers: BTreeMap<String, TransferFunction>,
    /// Clipping planes of the context image.
    #[serde(default)]
    pub clips: Vec<ClipPlane>,
    /// Ids of hidden fibre tracts.
    #[serde(default)]
    pub hidden_tracts: BTreeSet<String>,
    /// How fibre tracts look, by id; absent ones look as they do to begin with.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub tract_looks: BTreeMap<String, FiberLook>,
    /// How the ellipsoid diagram is drawn.
    #[serde(default)]
    pub ellipsoids: EllipsoidLook,
    /// Opacities of single ellipsoids.
    #[serde(default)]
    pub ellipsoid_opacities: Vec<EllipsoidOpacity>,
    /// How the 3D views are lit.
    #[serde(default)]
    pub light: LightChoice,
    /// Comparison of two time points.
    #[serde(default)]
    pub change: ChangeSetting,
    /// How masks are compared.
    #[serde(default)]
    pub agreement: AgreementSetting,
    /// Lesions over time, and what the user said about them.
    #[serde(default)]
    pub lesions: LesionSetting,
    /// Response by criteria, and what its reader states.
    #[serde(default)]
    pub response: ResponseSetting,
    /// What the reader concludes.
    #[serde(default)]
    pub reading: Reading,
    /// The page that the patient takes home.
    #[serde(default, skip_serializing_if = "TakeHome::is_default")]
    pub take_home: TakeHome,
    /// Views kept for the report, in its order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pictures: Vec<KeyPicture>,
    /// Layout of the panes; see [`Edit::arrange_as`].
    pub layout: Tree<PaneId>,
    /// The maximised pane, if any.
    pub maximized: Option<PaneId>,
}

impl Edit {
    /// How the fibre tracts of this id look.
    pub fn tract_look(&self, id: &str) -> FiberLook {
        self.tract_looks.get(id).cloned().unwrap_or_default()
    }

    /// Takes over the arrangement of panes. It is saved with the rest, but isn't a deed: undo leaves it alone.
    pub fn arrange_as(&mut self, other: &Self) {
        self.layout.clone_from(&other.layout);
        self.maximized = other.maximized;
    }

    /// Whether `other` has the same content: all but the arrangement of the panes and where the lens is, which are no work to
    /// lose: looking around isn't asked about.
    pub fn same_work(&self, other: &Self) -> bool {
        // Asked in every frame: most often nothing changed, and nothing is copied.
        if self == other {
            return true;
        }
        let mut arranged = other.clone();
        arranged.arrange_as(self);
        arranged.lens = self.lens;
        *self == arranged
    }
}

/// The navigation state, which undo doesn't cover.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Navigation {
    /// Index of the current time point.
    pub time: usize,
    /// The closeup's camera.
    pub camera: Camera,
    /// Where the crosshair is pinned, world millimetres. Views show [`Navigation::crosshair_mm`].
    pub cursor_mm: DVec3,
    /// Which context the slices show, by id; `None` for none.
    pub context: Option<String>,
    /// Which side the patient's left is drawn on.
    pub convention: Convention,
    /// Scale of the slices in millimetres per logical point; `None` fits the image.
    pub mm_per_point: Option<f64>,
    /// Offset of each slice view's centre from the image's centre, in-plane millimetres (right, down).
    pub pan_mm: [DVec2; 3],
    /// Along which axes slices lie.
    #[serde(default)]
    pub slice_axes: SliceAxes,
    /// The axes of planes whose slice alone lies along others.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub own_axes: BTreeMap<Plane, SliceAxes>,
    /// Whether hovering over a view shows the crosshair under the pointer.
    pub follow_pointer: bool,
    /// Magnification of each 3D view whose orientation follows the closeup's; absent entries are 1, which fits.
    #[serde(default)]
    pub zooms: BTreeMap<PaneId, f64>,
    /// Whether the axial slice is shown as a plane in closeup and ellipsoid diagram.
    #[serde(default)]
    pub show_plane: bool,
    /// Place that the crosshair is shown at while the pointer hovers there, and the pane that the pointer is over. Not
    /// saved: the crosshair returns to [`Navigation::cursor_mm`] when the pointer leaves.
    #[serde(skip)]
    pub preview: Option<(PaneId, DVec3)>,
    /// Whether dragging measures. A mouse mode, so not saved.
    #[serde(skip)]
    pub ruler_on: bool,
    /// What it measures in slices; likewise.
    #[serde(skip)]
    pub tool: Tool,
}

impl Navigation {
    /// Where the crosshair is shown: under a hovering pointer, else where it is pinned.
    pub fn crosshair_mm(&self) -> DVec3 {
        self.preview.map_or(self.cursor_mm, |(_, place_mm)| place_mm)
    }

    /// The rotation that takes the patient's axes to those of a plane's slice.
    pub fn turn_of(&self, plane: Plane) -> DMat3 {
        self.own_axes.get(&plane).unwrap_or(&self.slice_axes).turn
    }

    /// Pins the crosshair.
    pub fn pin_mm(&mut self, place_mm: DVec3) {
        self.cursor_mm = place_mm;
        self.preview = None;
    }

    /// Magnification of a linked 3D view; 1 fits.
    pub fn zoom(&self, pane: PaneId) -> f64 {
        self.zooms.get(&pane).copied().unwrap_or(1.0)
    }
}

/// The whole saved state of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Document {
    /// The case.
    pub case: CaseRef,
    /// Files of fibre tracts in addition to the case's.
    #[serde(default)]
    pub tracts: Vec<PathBuf>,
    /// Labels of the time points in time order, where the user states it; empty: as the case states.
    #[serde(default)]
    pub order: Vec<String>,
    /// Id of the mask or image whose grid is the case grid; `None`: the finest mask.
    #[serde(default)]
    pub case_grid: Option<String>,
    /// Whether the user said that all files lie in one space, whatever frames of reference they state.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub one_space: bool,
    /// The derived data sets of BIDS that the user named: see [`LoadOptions::derivatives`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub derivatives: Vec<PathBuf>,
    /// State that undo covers.
    pub edit: Edit,
    /// State that undo doesn't cover.
    pub nav: Navigation,
}

/// The initial lens at `time_point`: centred on the tumour's centroid, with the radius of a ball of 1.5 times the
/// union's volume (at least twice the largest voxel spacing), so that there is something inside and outside. Without
/// active voxels: the grid's centre and 20 mm.
pub fn default_lens(time_point: &TimePoint) -> Lens {
    let regions = &time_point.regions;
    let center_mm = regions.centroid_mm().unwrap_or_else(|| time_point.index.grid().center_mm());
    let radius_mm = ball_radius_mm(regions.union_ml(), time_point.index.grid());
    Lens { center_mm, radius_mm: if regions.union_voxels() == 0 { 20.0 } else { radius_mm } }
}

/// Radius of a lens for something of this volume: that of a ball of 1.5 times the volume, at least twice the largest
/// voxel spacing.
pub fn ball_radius_mm(volume_ml: f64, grid: &Grid) -> f64 {
    let ball_mm = (volume_ml * 1000.0 * 1.5 * 3.0 / (4.0 * std::f64::consts::PI)).cbrt();
    ball_mm.max(grid.spacing_mm().max_element() * 2.0)
}

/// Volume of the lens.
pub fn ball_ml(radius_mm: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius_mm.powi(3) / 1000.0
}

/// Radius that the camera must fit about the centroid: three quarters of half the diagonal of the active voxels' bounding
/// box, or of the grid where none is active, so that a ball fills two thirds of the view; more where a face of the box
/// lies farther away, as with a small lesion far from a large one.
pub fn tumor_radius_mm(time_point: &TimePoint) -> f64 {
    let grid = time_point.index.grid();
    let corners = time_point
        .regions
        .bounds()
        .and_then(|(start, dims)| grid.crop(start, dims).ok())
        .map_or_else(|| grid.corners_mm(), |part| part.corners_mm());
    let diagonals = corners.iter().flat_map(|a| corners.iter().map(move |b| a.distance(*b)));
    let half_diagonal_mm = diagonals.fold(0.0, f64::max) / 2.0;
    let center_mm = time_point.regions.centroid_mm().unwrap_or_else(|| grid.center_mm());
    // Some active voxel touches each face.
    let axes = (0..3).filter_map(|axis| grid.world_from_voxel().matrix3.col(axis).try_normalize());
    let face_mm = axes.flat_map(|axis| corners.map(|corner| (corner - center_mm).dot(axis).abs()));
    // The camera leaves a margin beyond the radius.
    face_mm.map(|mm| mm / 1.1).fold(0.75 * half_diagonal_mm, f64::max)
}

impl Document {
    /// Whether `other` is of the same case, read alike, with the same content.
    pub fn same_work(&self, other: &Self) -> bool {
        let Self { case, tracts, order, case_grid, one_space, derivatives, edit, nav: _ } = self;
        (case, tracts, order, case_grid) == (&other.case, &other.tracts, &other.order, &other.case_grid)
            && (*one_space, derivatives) == (other.one_space, &other.derivatives)
            && edit.same_work(&other.edit)
    }

    /// The initial document of a case with `time_point_count` time points: everything visible, the lens on the
    /// tumour where there are several masks, seen from the front, slightly from the left and above.
    pub fn new(case: CaseRef, time_point: &TimePoint, time_point_count: usize) -> Self {
        let lens = default_lens(time_point);
        let camera = Camera::fit(
            lens.center_mm,
            tumor_radius_mm(time_point),
            Camera::orientation(30.0, 20.0),
            Projection::Perspective,
        );
        let held = Held::at(time_point, time_point_count);
        Self {
            case,
            tracts: Vec::new(),
            order: Vec::new(),
            case_grid: None,
            one_space: false,
            derivatives: Vec::new(),
            edit: Edit {
                selection: HiddenRegions::none(),
                // Within one mask there is nothing to compare: the lens would only cut its form away.
                lens_on: time_point.masks.len() > 1 && time_point.regions.union_voxels() > 0,
                lens,
                windows: BTreeMap::new(),
                overlay: Overlay::Both,
                overlay_opacity: 0.2,
                outline_patterns: false,
                alignments: Vec::new(),
                fusion: Fusion::default(),
                palette: Palette::default(),
                coloring: Coloring::Masks,
                masks: MaskLooks::default(),
                made: Vec::new(),
                rulers: Vec::new(),
                overlap_mode: OverlapMode::Regions,
                transfers: BTreeMap::new(),
                clips: Vec::new(),
                hidden_tracts: BTreeSet::new(),
                tract_looks: BTreeMap::new(),
                ellipsoids: EllipsoidLook::default(),
                ellipsoid_opacities: Vec::new(),
                light: LightChoice::default(),
                change: ChangeSetting::default(),
                agreement: AgreementSetting::default(),
                lesions: LesionSetting::default(),
                response: ResponseSetting::default(),
                reading: Reading::default(),
                take_home: TakeHome::default(),
                pictures: Vec::new(),
                layout: layout::opening(held),
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
                slice_axes: SliceAxes::default(),
                own_axes: BTreeMap::new(),
                follow_pointer: true,
                zooms: BTreeMap::new(),
                show_plane: false,
                preview: None,
                ruler_on: false,
                tool: Tool::Line,
            },
        }
    }

    /// Shows the last date, if dates have an order and it has a mask: the camera and the lens are on the tumour there, from the side that was chosen.
    pub fn go_to_current(&mut self, case: &Case) {
        let Some((time, current)) = current_date(case) else { return };
        let Self { edit: Edit { lens, lens_on, .. }, nav, .. } =
            Self::new(self.case.clone(), current, case.time_points.len());
        (self.edit.lens, self.edit.lens_on) = (lens, lens_on);
        let own = &self.nav;
        let camera = Camera {
            world_from_camera: own.camera.world_from_camera,
            projection: own.camera.projection,
            ..nav.camera
        };
        self.nav = Navigation {
            time,
            camera,
            cursor_mm: nav.cursor_mm,
            preview: None,
            context: nav.context,
            mm_per_point: None,
            pan_mm: nav.pan_mm,
            ..own.clone()
        };
    }

    /// Makes an initial document one to be read: at the last date, if dates have an order; with PET over the first image, where
    /// the panes are for that; with `usual` criteria, where several dates are judged. `arranges`: with the panes for these. Returns whether it is judged.
    pub fn open_for_reading(&mut self, case: &Case, usual: &Usual, arranges: bool) -> bool {
        self.go_to_current(case);
        let is_judged = self.judge_by(case, usual);
        if !arranges {
            return is_judged;
        }
        let held = Held::of(case);
        if let ([only], Some(Task::Fusion)) = (&case.time_points[..], layout::opening_task(held)) {
            let second = second_of(only, self.nav.context.as_deref());
            self.edit.fusion = self.edit.fusion.showing(second, false);
        }
        if is_judged {
            self.edit.layout = Task::Response.layout(held);
        }
        is_judged
    }

    /// Chooses criteria where several dates with masks have an order; whether it does. Facts are then stated by the usual reader.
    fn judge_by(&mut self, case: &Case, usual: &Usual) -> bool {
        let with_masks = case.time_points.iter().filter(|time| !time.masks.is_empty()).count();
        let is_judged = with_masks > 1 && case.order != OrderBasis::Unknown;
        let Some(criterion) = usual.criterion.filter(|_| is_judged) else { return false };
        let mask = self.edit.lesions.mask(case, &self.edit.change);
        self.edit.response.judge_by(criterion, case, mask.as_deref());
        self.edit.response.author.clone_from(&usual.reader);
        true
    }

    /// Keeps a view for the report.
    pub fn keep_picture(&mut self, pane: PaneId, size_points: [f32; 2]) {
        if self.edit.pictures.len() < MOST_PICTURES {
            self.edit.pictures.push(KeyPicture::of(self, pane, size_points));
        }
    }

    /// Records how its case was read: from where, and with the order of dates, the case grid and the transforms of `options`.
    pub fn set_source(&mut self, case: CaseRef, tracts: Vec<PathBuf>, options: &LoadOptions) {
        self.case = case;
        self.tracts = tracts;
        self.edit.alignments.clone_from(&options.alignments);
        self.one_space = options.one_space;
        self.derivatives.clone_from(&options.derivatives);
        self.order.clone_from(&options.order);
        self.case_grid = match &options.case_grid {
            CaseGridChoice::FinestMask => None,
            CaseGridChoice::Of(id) => Some(id.clone()),
        };
    }

    /// The lines measured at the current time point, with their indices.
    pub fn rulers_shown(&self) -> impl Iterator<Item = (usize, &Ruler)> {
        self.rulers_at(self.nav.time)
    }

    /// The lines measured at a time point, with their indices.
    pub fn rulers_at(&self, time: usize) -> impl Iterator<Item = (usize, &Ruler)> {
        self.edit.rulers.iter().enumerate().filter(move |(_, ruler)| ruler.time == time)
    }

    /// An unused line name: `Line 3`.
    pub fn new_ruler_name(&self) -> String {
        let taken = |name: &str| self.edit.rulers.iter().any(|ruler| ruler.name == name);
        (self.edit.rulers.len() + 1..).map(|n| format!("Line {n}")).find(|n| !taken(n)).unwrap_or_default()
    }

    /// The window of an image: set by the user, or initial from its histogram.
    pub fn window_of(&self, id: &str, image: &PreparedContext) -> Window {
        self.edit.windows.get(id).copied().unwrap_or_else(|| image.histogram().initial_window())
    }

    /// The lens, if it is on.
    pub fn active_lens(&self) -> Option<Lens> {
        self.edit.lens_on.then_some(self.edit.lens)
    }
}

/// The last of several dates in order, if it has a mask: the one that a reader is asked about.
fn current_date(case: &Case) -> Option<(usize, &TimePoint)> {
    let (time, last) = case.time_points.iter().enumerate().next_back()?;
    let is_read = time > 0 && case.order != OrderBasis::Unknown && last.regions.union_voxels() > 0;
    is_read.then_some((time, last))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use glioscope_core::{Grid, Mask, MaskBits, Regions, TumorIndex};

    fn time_point(inside: impl Fn(DVec3) -> bool) -> TimePoint {
        let grid = Grid::axis_aligned([160, 40, 40], DVec3::ONE, DVec3::new(-130.0, -20.0, -20.0)).unwrap();
        let bits = MaskBits::from_fn(grid.dims(), |l| inside(grid.center_of_voxel_mm(grid.ijk(l))));
        let mask = Mask::new("T", grid.clone(), bits).unwrap();
        let index = TumorIndex::new(grid, &[&mask]).unwrap();
        let regions = Arc::new(Regions::of(&index));
        TimePoint {
            label: String::new(),
            contexts: Vec::new(),
            masks: Vec::new(),
            index: Arc::new(index),
            regions,
        }
    }

    #[test]
    fn the_camera_reaches_a_small_lesion_far_from_a_large_one() {
        let large = |p: DVec3| p.length() <= 15.0;
        let far = DVec3::new(-110.0, 0.0, 0.0);
        let both = time_point(|p| large(p) || p.distance(far) <= 4.0);
        let focus_mm = default_lens(&both).center_mm;
        let camera = Camera::fit(
            focus_mm,
            tumor_radius_mm(&both),
            Camera::orientation(0.0, 0.0),
            Projection::Perspective,
        );
        let outermost_mm = (far.x - 4.0 - focus_mm.x).abs();
        assert!(camera.height_mm / 2.0 >= outermost_mm, "{} {outermost_mm}", camera.height_mm);
        // One lesion alone: half the diagonal of its box of 31 voxels.
        let alone = time_point(large);
        let radius_mm = tumor_radius_mm(&alone);
        assert!((radius_mm - 0.75 * 31.0 * 3.0_f64.sqrt() / 2.0).abs() < 1e-9, "{radius_mm}");
        // Its 31 mm fill two thirds of the view.
        let height_mm = Document::new(CaseRef::Sample, &alone, 1).nav.camera.height_mm;
        assert!((31.0 / height_mm - 2.0 / 3.0).abs() < 0.02, "{height_mm}");
    }
}
