//! The ellipsoid diagram (thesis 7.6): an ellipsoid for every component of what is shown, a 3D Venn
//! diagram of sorts.

use std::sync::Arc;

use egui::{Align2, FontId, Rect, Role, Sense, Slider, Ui, WidgetInfo, vec2};
use glam::DVec3;
use glioscope_core::{
    Connectivity, Progress,
    case::{Case, TimePoint},
    ellipsoid::{self, ComponentEllipsoid, Ellipsoid, Of, cache},
};
use glioscope_render::{Camera, DrawnEllipsoid, EllipsoidFrame, EllipsoidPick, EllipsoidScene, Gpu};
use serde::{Deserialize, Serialize};

use super::{
    Handle, ViewContext, closeup,
    linked::{self, Drawing, Linked, LinkedView, Picked},
    overlap::{OverlapMode, Shown, mask_shown},
    plane::PlaneState,
};
use crate::{
    commands::Command,
    document::{self, Pane},
    format,
    jobs::{Derived, Lookup},
    viewport::Viewport,
    window::waker,
};

/// Which ellipsoid stands for a component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EllipsoidKind {
    /// The smallest that holds every voxel: exaggerates overlap.
    #[default]
    Enclosing,
    /// Same centroid, axes and volume as the component: doesn't hold every voxel.
    Moment,
}

/// How the diagram is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EllipsoidLook {
    /// Which ellipsoids.
    pub kind: EllipsoidKind,
    /// Opacity of all, 0 to 1.
    pub opacity: f64,
    /// Components below this volume are hidden.
    pub smallest_ml: f64,
    /// Which voxels are neighbours: 6, 18 or 26.
    pub neighbors: u32,
}

/// The opacity of one ellipsoid, where the user gave it one of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OwnOpacity {
    /// The date it is of.
    pub time: usize,
    /// The neighbourhood that made its component.
    pub neighbors: u32,
    /// Its number among the components of that date.
    pub id: u32,
    /// 0 to 1, before the opacity of all.
    pub opacity: f64,
}

impl Default for EllipsoidLook {
    fn default() -> Self {
        Self { kind: EllipsoidKind::Enclosing, opacity: 0.45, smallest_ml: 0.1, neighbors: 26 }
    }
}

#[derive(PartialEq)]
struct Key {
    case: Handle<Case>,
    time: usize,
    neighbors: u32,
}

/// What the view remembers between frames; never saved.
#[derive(Default)]
pub struct EllipsoidState {
    found: Derived<Key, Vec<ComponentEllipsoid>>,
    picture: LinkedView<EllipsoidScene, EllipsoidPick>,
    drawn: Option<(DrawnKey, Arc<Vec<DrawnEllipsoid>>)>,
    /// What the context menu is about.
    clicked: Option<EllipsoidPick>,
}

impl EllipsoidState {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.picture.refined() && !self.found.working()
    }

    /// The ellipsoids last computed: none while the view has never been open.
    pub fn found(&self) -> Option<&Arc<Vec<ComponentEllipsoid>>> {
        self.found.last()
    }

    /// Keeps what was computed of `time` beside a session that was just saved.
    pub fn keep(&self, session: &std::path::Path, case: &Arc<Case>, time: usize, neighbors: u32) {
        let key = Key { case: Handle::of(case), time, neighbors };
        if let (Some(found), Some(time_point)) = (self.found.kept(&key), case.time_points.get(time)) {
            save(&cache::path_beside(session), &cache_key(time_point, neighbors), found);
        }
    }

    /// What is under the pointer.
    pub fn hover(&self) -> Option<EllipsoidPick> {
        self.picture.hover().copied()
    }
}

/// What drawing a 3D view needs besides the document.
pub struct Stage<'a> {
    /// The renderers.
    pub viewport: Option<&'a mut Viewport>,
    /// For pictures: no draft, and jobs are waited for.
    pub refine_at_once: bool,
    /// The session file, beside which results are kept.
    pub session: Option<&'a std::path::Path>,
    /// The axial slice as a plane, made when it is shown.
    pub plane: &'a mut PlaneState,
}

/// The ellipsoid of a component that is drawn.
fn of_kind(component: &ComponentEllipsoid, kind: EllipsoidKind) -> &Ellipsoid {
    match kind {
        EllipsoidKind::Enclosing => &component.enclosing,
        EllipsoidKind::Moment => &component.moment,
    }
}

/// Whether a component belongs to what is selected: regions, or whole masks in that mode.
fn is_selected(view: &ViewContext<'_>, of: Of) -> bool {
    let edit = &view.doc.edit;
    match (of, edit.overlap_mode) {
        (Of::Region(bits), OverlapMode::Regions) => edit.selection.shows(bits),
        (Of::Mask(k), OverlapMode::WholeMasks) => {
            mask_shown(&view.time_point.regions, &edit.selection, k) == Shown::All
        }
        _ => false,
    }
}

/// What is drawn of `found`, and how many selected components are too small.
pub fn drawn(view: &ViewContext<'_>, found: &[ComponentEllipsoid]) -> (Vec<DrawnEllipsoid>, usize) {
    let look = &view.doc.edit.ellipsoids;
    let mut small = 0;
    let mut list = Vec::new();
    let (time, neighbors) = (view.doc.nav.time, look.neighbors);
    let own = |id| {
        let of_this = |o: &&OwnOpacity| o.time == time && o.neighbors == neighbors && o.id == id;
        view.doc.edit.ellipsoid_opacities.iter().find(of_this).map_or(1.0, |o| o.opacity)
    };
    for (component, id) in found.iter().zip(0_u32..) {
        if !is_selected(view, component.of) {
            continue;
        }
        if component.volume_ml < look.smallest_ml {
            small += 1;
            continue;
        }
        let ellipsoid = of_kind(component, look.kind);
        let color = match component.of {
            Of::Mask(k) => view.colors.mask(k),
            Of::Region(bits) => view.colors.region(bits),
        };
        list.push(DrawnEllipsoid {
            id,
            center_mm: ellipsoid.center_mm,
            semi_axes_mm: ellipsoid.semi_axes_mm,
            rotation: ellipsoid.rotation,
            color,
            opacity: own(id),
        });
    }
    (list, small)
}

/// A camera that holds every ellipsoid (whose box has corners that none reaches), shown or not, so that a click on the diagram moves nothing.
fn camera(view: &ViewContext<'_>, found: &[ComponentEllipsoid]) -> Camera {
    let look = &view.doc.edit.ellipsoids;
    let nav = &view.doc.nav;
    let large = || found.iter().filter(|c| c.volume_ml >= look.smallest_ml).map(|c| of_kind(c, look.kind));
    let (low, high) = large().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), e| {
        // Half the box's side along each world axis.
        let reach = DVec3::from_array(std::array::from_fn(|a| {
            (0..3).map(|i| (e.rotation.col(i)[a] * e.semi_axes_mm[i]).powi(2)).sum::<f64>().sqrt()
        }));
        (low.min(e.center_mm - reach), high.max(e.center_mm + reach))
    });
    let (focus_mm, radius_mm) = if low.is_finite() && high.is_finite() {
        ((low + high) / 2.0, (high - low).length() / 2.0)
    } else {
        (view.doc.edit.lens.center_mm, document::tumor_radius_mm(view.time_point))
    };
    linked::camera(&nav.camera, focus_mm, radius_mm * 0.72, nav.ellipsoid_zoom)
}

/// Everything the list of drawn ellipsoids depends on besides what was found.
#[derive(PartialEq)]
struct DrawnKey {
    look: EllipsoidLook,
    mode: OverlapMode,
    selection: glioscope_core::Selection,
    colors: glioscope_render::MaskColors,
    opacities: Vec<OwnOpacity>,
    time: usize,
    found: usize,
}

fn compute(
    case: &Case,
    time: usize,
    neighbors: u32,
    kept_at: Option<&std::path::Path>,
    progress: &Progress,
) -> Result<Vec<ComponentEllipsoid>, String> {
    let time_point = case.time_points.get(time).ok_or("no such date")?;
    let key = cache_key(time_point, neighbors);
    if let Some(kept) = kept_at.and_then(|path| cache::load(path).remove(&key)) {
        return Ok(kept);
    }
    let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
    let options = ellipsoid::Options::default();
    progress.say("enclosing components in ellipsoids");
    let found = ellipsoid::ellipsoids_of(&time_point.index, connectivity, &options, progress)
        .map_err(|e| e.to_string())?;
    if let Some(path) = kept_at {
        save(path, &key, &found);
    }
    Ok(found)
}

fn cache_key(time_point: &TimePoint, neighbors: u32) -> cache::Key {
    let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
    cache::Key::of(&time_point.index, connectivity, &ellipsoid::Options::default())
}

/// Adds to the file beside the session. Without it they are computed again next time: nothing is lost,
/// so a folder that can't be written is no error.
fn save(path: &std::path::Path, key: &cache::Key, found: &[ComponentEllipsoid]) {
    let mut entries = cache::load(path);
    entries.insert(*key, found.to_vec());
    let _ = cache::save(path, &entries);
}

/// Draws the diagram into all of `ui` and writes what the user did to `out`.
pub fn show(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    stage: Stage<'_>,
    state: &mut EllipsoidState,
    out: &mut Vec<Command>,
) {
    ui.horizontal(|ui| controls(ui, view, out));
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let Some(viewport) = stage.viewport else {
        closeup::message(ui, rect, "No graphics adapter: the ellipsoid diagram can't be drawn.");
        return;
    };
    let (case, time) = (view.case.clone(), view.doc.nav.time);
    let neighbors = view.doc.edit.ellipsoids.neighbors;
    let kept_at = stage.session.map(cache::path_beside);
    let key = Key { case: Handle::of(&case), time, neighbors };
    let work = move |progress: &Progress| compute(&case, time, neighbors, kept_at.as_deref(), progress);
    let found = match state.found.get(key, stage.refine_at_once, waker(ui.ctx()), work) {
        Lookup::Ready(found) => found.clone(),
        Lookup::Working(progress) => {
            let text = crate::world::progress_text(progress);
            closeup::message(ui, rect, &text);
            ui.request_repaint_after(std::time::Duration::from_millis(100));
            return;
        }
        Lookup::Failed(why) => {
            closeup::message(ui, rect, why);
            return;
        }
    };
    let edit = &view.doc.edit;
    let drawn_key = DrawnKey {
        look: edit.ellipsoids,
        mode: edit.overlap_mode,
        selection: edit.selection.clone(),
        colors: view.colors.clone(),
        opacities: edit.ellipsoid_opacities.clone(),
        time,
        found: Arc::as_ptr(&found) as usize,
    };
    let (list, small) = drawn(view, &found);
    let list = match state.drawn.take() {
        Some((key, list)) if key == drawn_key => list,
        _ => Arc::new(list),
    };
    state.drawn = Some((drawn_key, list.clone()));
    let scene = EllipsoidScene {
        ellipsoids: list,
        opacity: edit.ellipsoids.opacity,
        lens: view.doc.active_lens(),
        camera: camera(view, &found),
        background: closeup::background(ui.visuals().dark_mode),
        silhouette: [0, 0, 0],
        plane: view.doc.nav.show_plane.then(|| stage.plane.get(view)).flatten(),
    };
    let linked =
        Linked { pane: Pane::Ellipsoids, camera: scene.camera, zoom: view.doc.nav.ellipsoid_zoom, rect };
    let drawing = Drawing {
        gpu: &viewport.gpu,
        screen: &mut viewport.ellipsoids,
        scene: &scene,
        refine_at_once: stage.refine_at_once,
        pick: |frame: &EllipsoidFrame, gpu: &Gpu, [x, y]: [u32; 2]| frame.pick(gpu, x, y),
    };
    let Some(outcome) = state.picture.draw(ui, view, &linked, &response, drawing, out) else { return };
    let spoken = state.hover().and_then(|pick| pick_text(view, &found, &pick));
    own_opacity(&response, view, state, &found, out);
    linked.say(ui, view, &response, &outcome, spoken.as_deref());
    notes(ui, view, rect, scene.ellipsoids.len(), small, &scene.camera);
    response.widget_info(|| {
        let under = spoken.clone().unwrap_or_else(|| "nothing under the pointer".into());
        let count = scene.ellipsoids.len();
        WidgetInfo::labeled(Role::Canvas, true, format!("Ellipsoid diagram, {count} ellipsoids: {under}"))
    });
}

/// The opacity of the ellipsoid under a right click, and all of them as they were.
fn own_opacity(
    response: &egui::Response,
    view: &ViewContext<'_>,
    state: &mut EllipsoidState,
    found: &[ComponentEllipsoid],
    out: &mut Vec<Command>,
) {
    if response.secondary_clicked() {
        state.clicked = state.hover();
    }
    let all = &view.doc.edit.ellipsoid_opacities;
    response.context_menu(|ui| {
        let mut new = all.clone();
        if let Some((pick, component)) = state.clicked.and_then(|p| Some((p, found.get(p.id as usize)?))) {
            let (time, neighbors) = (view.doc.nav.time, view.doc.edit.ellipsoids.neighbors);
            let is_this = |o: &OwnOpacity| o.time == time && o.neighbors == neighbors && o.id == pick.id;
            let before = all.iter().find(|o| is_this(o)).map_or(1.0, |o| o.opacity);
            let mut opacity = before;
            ui.label(format!("{} {}", name_of(view, component.of), format::ml(component.volume_ml)));
            let response = ui.add(Slider::new(&mut opacity, 0.0..=1.0).fixed_decimals(2).text("opacity"));
            response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Opacity of this ellipsoid"));
            if opacity != before {
                new.retain(|o| !is_this(o));
                new.push(OwnOpacity { time, neighbors, id: pick.id, opacity });
            }
        } else {
            ui.weak("No ellipsoid here");
        }
        if ui.add_enabled(!all.is_empty(), egui::Button::new("All as they were")).clicked() {
            new.clear();
            ui.close();
        }
        if new != *all {
            out.push(Command::SetEllipsoidOpacities(new));
        }
    });
}

/// What a component is of.
fn name_of(view: &ViewContext<'_>, of: Of) -> String {
    let regions = &view.time_point.regions;
    match of {
        Of::Mask(k) => regions.mask_ids().get(k).cloned().unwrap_or_default(),
        Of::Region(bits) => regions.name(bits),
    }
}

impl Picked for EllipsoidPick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

/// What the pointer says: whose component, its size, and by how much the ellipsoid exaggerates it.
fn pick_text(view: &ViewContext<'_>, found: &[ComponentEllipsoid], pick: &EllipsoidPick) -> Option<String> {
    let component = found.get(pick.id as usize)?;
    let name = name_of(view, component.of);
    let look = &view.doc.edit.ellipsoids;
    let axes = of_kind(component, look.kind).semi_axes_mm * 2.0;
    let ratio = match look.kind {
        EllipsoidKind::Enclosing => format!("ellipsoid {:.2} × the component", component.exaggeration),
        EllipsoidKind::Moment => "ellipsoid of the same volume".to_owned(),
    };
    let outside = if pick.inside_lens { "" } else { ", outside the lens" };
    Some(format!(
        "{name} {}{outside}\n{ratio}\naxes {:.1} × {:.1} × {:.1} mm",
        format::ml(component.volume_ml),
        axes.x,
        axes.y,
        axes.z
    ))
}

fn controls(ui: &mut Ui, view: &ViewContext<'_>, out: &mut Vec<Command>) {
    let look = view.doc.edit.ellipsoids;
    let mut new = look;
    ui.add_space(4.0);
    for (kind, text, tip) in [
        (
            EllipsoidKind::Enclosing,
            "Enclosing",
            "The smallest ellipsoid that holds every voxel; exaggerates overlap",
        ),
        (
            EllipsoidKind::Moment,
            "Equal volume",
            "Centroid, axes and volume of the component; not every voxel is inside",
        ),
    ] {
        if ui.selectable_label(look.kind == kind, text).on_hover_text(tip).clicked() {
            new.kind = kind;
        }
    }
    ui.spacing_mut().slider_width = 56.0;
    let response = ui.add(Slider::new(&mut new.opacity, 0.05..=1.0).fixed_decimals(2));
    response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Opacity of ellipsoids"));
    response.on_hover_text("Opacity of all ellipsoids");
    let drag = egui::DragValue::new(&mut new.smallest_ml).range(0.0..=1000.0).speed(0.01).suffix(" ml");
    let response = ui.add(drag.prefix("hide below "));
    response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Hide components below, in ml"));
    response.on_hover_text("Components smaller than this are not drawn");
    let menu =
        egui::ComboBox::from_id_salt("neighbours").selected_text(look.neighbors.to_string()).width(36.0);
    let response = menu.show_ui(ui, |ui| {
        for (neighbors, text) in [(26, "26: face, edge or corner"), (18, "18: face or edge"), (6, "6: face")]
        {
            ui.selectable_value(&mut new.neighbors, neighbors, text);
        }
    });
    response.response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Neighbours of a voxel"));
    response.response.on_hover_text("Which voxels hang together in one component");
    if new != look {
        out.push(Command::SetEllipsoidLook(new));
    }
}

/// How many are shown and hidden, the cube, the scale bar.
fn notes(ui: &Ui, view: &ViewContext<'_>, rect: Rect, count: usize, small: usize, camera: &Camera) {
    let ink = closeup::ink(ui.visuals().dark_mode);
    let painter = ui.painter().with_clip_rect(rect);
    let mut text = format!("{count} component{}", if count == 1 { "" } else { "s" });
    if small > 0 {
        let limit = format::plain(view.doc.edit.ellipsoids.smallest_ml);
        text += &format!(", {small} below {limit} ml hidden");
    }
    if count == 0 && small == 0 {
        text = "Nothing is selected".into();
    }
    painter.text(rect.left_top() + vec2(10.0, 8.0), Align2::LEFT_TOP, text, FontId::proportional(12.0), ink);
    closeup::corner_marks(ui, view, rect, (camera, "at the middle"), false);
}
