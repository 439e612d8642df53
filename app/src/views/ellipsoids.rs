//! The ellipsoid diagram (thesis 7.6), similar to a 3D Venn diagram: an ellipsoid for every connected component of the
//! selected regions or masks.

use std::{collections::BTreeMap, sync::Arc};

use egui::{Role, Sense, Slider, Ui, WidgetInfo};
use glam::DVec3;
use glioscope_core::{
    Selection,
    ellipsoid::{ComponentEllipsoid, Ellipsoid, Of},
    optics::Camera,
};
use glioscope_render::{
    DrawnEllipsoid, EllipsoidPick, EllipsoidScene, MaskColors, views::ellipsoids::Ellipsoids,
};

use super::{
    draw,
    legend::{self, Mark},
    pane::{Input, Pane, Stage},
    ruler,
    view3d::{Canvas, Picked, ScreenReport, View, linked_camera, marks},
};
use crate::{
    command::{Commands, EditCommand},
    format,
    model::{
        EllipsoidKind, EllipsoidLook, EllipsoidOpacity, OverlapMode, PaneId,
        document::tumor_radius_mm,
        overlap::{Shown, mask_shown},
    },
    theme::Tokens,
    world::jobs::{Handle, Lookup, progress_text},
};

/// The pane of the ellipsoid diagram.
#[derive(Default)]
pub struct EllipsoidPane {
    /// Its 3D view.
    pub canvas: Canvas<Ellipsoids>,
    drawn: Option<(DrawnKey, Arc<Vec<DrawnEllipsoid>>)>,
    /// The ellipsoid of the context menu.
    clicked: Option<EllipsoidPick>,
}

/// Whether a component is of a shown region or, in whole-mask mode, of a fully shown mask.
fn is_selected(input: &Input<'_>, of: Of) -> bool {
    match (of, input.doc.edit.overlap_mode) {
        (Of::Region(bits), OverlapMode::Regions) => input.selection.shows(bits),
        (Of::Mask(k), OverlapMode::WholeMasks) => {
            mask_shown(&input.time_point.regions, input.selection, k) == Shown::All
        }
        _ => false,
    }
}

/// The ellipsoids to draw, and the number of selected components that are too small.
pub fn drawn(input: &Input<'_>, components: &[ComponentEllipsoid]) -> (Vec<DrawnEllipsoid>, usize) {
    let look = &input.doc.edit.ellipsoids;
    let mut too_small = 0;
    let mut list = Vec::new();
    let own = own_opacities(input, components);
    let opacity_of = |id: u32| own.get(&id).copied().unwrap_or(1.0);
    for (component, id) in components.iter().zip(0_u32..) {
        if !is_selected(input, component.of) {
            continue;
        }
        if component.volume_ml < look.smallest_ml {
            too_small += 1;
            continue;
        }
        let ellipsoid = look.kind.of(component);
        let color = match component.of {
            Of::Mask(k) => input.colors.mask(k),
            Of::Region(bits) => input.colors.region(bits),
        };
        list.push(DrawnEllipsoid {
            id,
            center_mm: ellipsoid.center_mm,
            semi_axes_mm: ellipsoid.semi_axes_mm,
            rotation: ellipsoid.rotation,
            color,
            opacity: opacity_of(id),
        });
    }
    (list, too_small)
}

/// Opacities set for single ellipsoids of the time point shown, by index of the component.
fn own_opacities(input: &Input<'_>, components: &[ComponentEllipsoid]) -> BTreeMap<u32, f64> {
    let (time, neighbors) = (input.doc.nav.time, input.doc.edit.ellipsoids.neighbors);
    let all = input.doc.edit.ellipsoid_opacities.iter();
    let here = all.filter(|own| own.time == time && own.neighbors == neighbors);
    here.filter_map(|own| Some((own.component(&input.time_point.regions, components)?, own.opacity)))
        .collect()
}

/// A camera that fits all ellipsoids that are large enough, selected or not, so that a change of the selection doesn't
/// move it. Their bounding box has empty corners, so less than its diagonal is fitted, but never less than reaches all.
fn camera(input: &Input<'_>, components: &[ComponentEllipsoid]) -> Camera {
    let look = &input.doc.edit.ellipsoids;
    let nav = &input.doc.nav;
    let large = || components.iter().filter(|c| c.volume_ml >= look.smallest_ml).map(|c| look.kind.of(c));
    let (low, high) = large().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), e| {
        // Half the sides of the ellipsoid's bounding box along the world axes.
        let half_mm = DVec3::from_array(std::array::from_fn(|a| {
            (0..3).map(|i| (e.rotation.col(i)[a] * e.semi_axes_mm[i]).powi(2)).sum::<f64>().sqrt()
        }));
        (low.min(e.center_mm - half_mm), high.max(e.center_mm + half_mm))
    });
    let (focus_mm, radius_mm) = if low.is_finite() && high.is_finite() {
        let middle_mm = (low + high) / 2.0;
        // The ends of the axes; the camera leaves a margin beyond the radius.
        let ends = |e: &Ellipsoid| -> [DVec3; 6] {
            let half = [0, 1, 2].map(|i| e.rotation.col(i) * e.semi_axes_mm[i]);
            std::array::from_fn(|i| e.center_mm + half[i % 3] * if i < 3 { 1.0 } else { -1.0 })
        };
        let farthest_mm = large().flat_map(ends).map(|end| end.distance(middle_mm) / 1.1).fold(0.0, f64::max);
        (middle_mm, ((high - low).length() / 2.0 * 0.72).max(farthest_mm))
    } else {
        (input.doc.edit.lens.center_mm, tumor_radius_mm(input.time_point))
    };
    linked_camera(&nav.camera, focus_mm, radius_mm, nav.zoom(PaneId::Ellipsoids))
}

/// Everything that the list of drawn ellipsoids depends on.
#[derive(PartialEq)]
struct DrawnKey {
    look: EllipsoidLook,
    mode: OverlapMode,
    selection: Selection,
    colors: MaskColors,
    opacities: Vec<EllipsoidOpacity>,
    time: usize,
    components: Handle<Vec<ComponentEllipsoid>>,
}

impl Pane for EllipsoidPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        self.canvas.begin();
        let (input, ask) = (stage.input, stage.ask);
        if !input.is_plain && !input.is_picture {
            ui.horizontal_wrapped(|ui| controls(ui, &input, out));
        }
        // What controls that are too wide stick out by is not the pane's.
        let rect = ui.available_rect_before_wrap().intersect(ui.clip_rect());
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let Some(graphics) = stage.graphics else {
            draw::message(ui, rect, "No graphics adapter: the ellipsoid diagram can't be drawn.");
            return;
        };
        let edit = &input.doc.edit;
        let (time, neighbors) = (input.doc.nav.time, edit.ellipsoids.neighbors);
        let components = match stage.results.ellipsoids.get(input.case, time, neighbors, stage.session, ask) {
            Lookup::Ready(components) => components.clone(),
            Lookup::Working(progress) => {
                draw::message(ui, rect, &progress_text(progress));
                ui.request_repaint_after(std::time::Duration::from_millis(100));
                return;
            }
            Lookup::Failed(error) => {
                draw::message(ui, rect, &error.to_string());
                return;
            }
        };
        let (list, too_small) = self.list(&input, &components);
        let plane = input.doc.nav.show_plane.then(|| stage.results.plane.get(input.doc, input.context));
        let mut scene = EllipsoidScene {
            ellipsoids: list,
            opacity: edit.ellipsoids.opacity,
            lens: input.doc.active_lens(),
            camera: camera(&input, &components),
            background: Tokens::in_ui(ui).viewport_rgb(),
            silhouette: [0, 0, 0],
            plane: plane.flatten(),
        };
        if input.is_plain && rect.width() < rect.height() {
            // The camera fits heights.
            scene.camera.height_mm *= f64::from(rect.height() / rect.width().max(1.0));
        }
        let mut view = View { doc: input.doc, pane: PaneId::Ellipsoids, camera: scene.camera, rect };
        let outcome = self.canvas.handle_mouse(ui, graphics, &mut view, &response, out);
        scene.camera = view.camera;
        if !self.canvas.draw(ui, (graphics, &view, &response), &scene, ask.wait, out) {
            return;
        }
        if !input.is_plain {
            ruler::draw_3d(&ui.painter().with_clip_rect(rect), input.doc, &view.camera, rect, None);
        }
        let hover = self.canvas.hover().filter(|_| !input.is_plain);
        let hover_text = hover.and_then(|pick| pick_text(&input, &components, pick));
        self.opacity_menu(&response, &input, &components, out);
        let rows = legend_rows(&input, &components, &scene.ellipsoids, too_small);
        if !input.is_plain {
            legend::show(ui, rect, &rows);
        }
        let scale_position = if input.is_plain { "" } else { "at the middle" };
        marks::corners(ui, rect, input.sides_known(), (&scene.camera, scale_position), false);
        self.canvas.draw_overlays(ui, &view, &response, &outcome, hover_text.as_deref());
        response.widget_info(|| {
            let mut what = format!("Ellipsoid diagram, {} ellipsoids", scene.ellipsoids.len());
            for (_, warning) in rows.iter().filter(|(mark, _)| *mark == Mark::Warning) {
                what += &format!("\n{warning}");
            }
            WidgetInfo::labeled(Role::Canvas, true, self.canvas.accessible_text(&what, hover_text.as_deref()))
        });
    }

    fn ready(&self) -> bool {
        self.canvas.refined()
    }

    fn screen(&mut self) -> Option<&mut dyn ScreenReport> {
        Some(&mut self.canvas.screen)
    }
}

impl EllipsoidPane {
    /// The ellipsoids to draw, as the same shared list while its inputs are unchanged; and the number of selected
    /// components that are too small.
    fn list(
        &mut self,
        input: &Input<'_>,
        components: &Arc<Vec<ComponentEllipsoid>>,
    ) -> (Arc<Vec<DrawnEllipsoid>>, usize) {
        let edit = &input.doc.edit;
        let key = DrawnKey {
            look: edit.ellipsoids,
            mode: edit.overlap_mode,
            selection: input.selection.clone(),
            colors: input.colors.clone(),
            opacities: edit.ellipsoid_opacities.clone(),
            time: input.doc.nav.time,
            components: Handle::of(components),
        };
        let (list, too_small) = drawn(input, components);
        let list = match self.drawn.take() {
            Some((drawn_key, list)) if drawn_key == key => list,
            _ => Arc::new(list),
        };
        self.drawn = Some((key, list.clone()));
        (list, too_small)
    }

    /// Context menu: opacity of the clicked ellipsoid, and reset of all individual opacities.
    fn opacity_menu(
        &mut self,
        response: &egui::Response,
        input: &Input<'_>,
        components: &[ComponentEllipsoid],
        out: &mut Commands,
    ) {
        if response.secondary_clicked() {
            self.clicked = self.canvas.hover().copied();
        }
        let all = &input.doc.edit.ellipsoid_opacities;
        response.context_menu(|ui| {
            let mut new = all.clone();
            if let Some((pick, component)) =
                self.clicked.and_then(|p| Some((p, components.get(p.id as usize)?)))
            {
                let (time, neighbors) = (input.doc.nav.time, input.doc.edit.ellipsoids.neighbors);
                let regions = &input.time_point.regions;
                let current = own_opacities(input, components).get(&pick.id).copied().unwrap_or(1.0);
                let mut opacity = current;
                ui.label(format!("{} {}", name_of(input, component.of), format::ml(component.volume_ml)));
                let response = ui.add(Slider::new(&mut opacity, 0.0..=1.0).fixed_decimals(2).text("opacity"));
                response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Opacity of this ellipsoid"));
                if opacity != current {
                    new.retain(|own| {
                        (own.time, own.neighbors) != (time, neighbors)
                            || own.component(regions, components) != Some(pick.id)
                    });
                    new.extend(EllipsoidOpacity::new(
                        time,
                        neighbors,
                        (regions, components),
                        pick.id,
                        opacity,
                    ));
                }
            } else {
                ui.weak("No ellipsoid here");
            }
            if ui.add_enabled(!all.is_empty(), egui::Button::new("All as they were")).clicked() {
                new.clear();
                ui.close();
            }
            if new != *all {
                out.push(EditCommand::SetEllipsoidOpacities(new));
            }
        });
    }
}

/// Name of a component's mask or region.
fn name_of(input: &Input<'_>, of: Of) -> String {
    let (ids, masks) = (input.time_point.regions.mask_ids(), &input.doc.edit.masks);
    match of {
        Of::Mask(k) => ids.get(k).map(|id| masks.name(id)).unwrap_or_default(),
        Of::Region(bits) => masks.region(ids, bits),
    }
}

impl Picked for EllipsoidPick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

/// The component under the pointer as text: its region or mask, volume, and the ellipsoid's volume ratio and axes.
fn pick_text(input: &Input<'_>, components: &[ComponentEllipsoid], pick: &EllipsoidPick) -> Option<String> {
    let component = components.get(pick.id as usize)?;
    let name = name_of(input, component.of);
    let look = &input.doc.edit.ellipsoids;
    let axes = look.kind.of(component).semi_axes_mm * 2.0;
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

fn controls(ui: &mut Ui, input: &Input<'_>, out: &mut Commands) {
    let look = input.doc.edit.ellipsoids;
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
    let slider = Slider::new(&mut new.opacity, 0.05..=1.0).fixed_decimals(2);
    // A slider isn't wrapped: in a narrow pane its word would stick out.
    let is_narrow = ui.max_rect().width() < OPACITY_WORD_POINTS;
    let response = ui.add(if is_narrow { slider } else { slider.text("opacity") });
    response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Opacity of ellipsoids"));
    response.on_hover_text("Opacity of all ellipsoids");
    let drag = egui::DragValue::new(&mut new.smallest_ml).range(0.0..=1000.0).speed(0.01).suffix(" ml");
    let response = ui.add(drag.prefix("hide below "));
    response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Hide components below, in ml"));
    response.on_hover_text("Components smaller than this are not drawn");
    let menu = egui::ComboBox::from_id_salt("neighbours")
        .selected_text(format!("{} neighbours", look.neighbors))
        .width(96.0);
    let response = menu.show_ui(ui, |ui| {
        for (neighbors, text) in [(26, "26: face, edge or corner"), (18, "18: face or edge"), (6, "6: face")]
        {
            ui.selectable_value(&mut new.neighbors, neighbors, text);
        }
    });
    response.response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Neighbours of a voxel"));
    response.response.on_hover_text("Which neighbouring voxels belong to one component");
    if new != look {
        out.push(EditCommand::SetEllipsoidLook(new));
    }
}

/// Width of the pane from which on the slider of opacity has its word, points.
const OPACITY_WORD_POINTS: f32 = 385.0;
/// Ratio of an enclosing ellipsoid's volume to its component's from which the picture says so; of any box it is 2.7.
const MUCH_LARGER: f64 = 5.0;
/// Most ellipsoids named as much larger than their components.
const MAX_NAMED: usize = 3;

/// The number of components, the colours of those shown, and the ellipsoids that are much larger than their components.
fn legend_rows(
    input: &Input<'_>,
    components: &[ComponentEllipsoid],
    drawn: &[DrawnEllipsoid],
    too_small: usize,
) -> Vec<legend::Row> {
    let count = drawn.len();
    let mut text = format!("{count} component{}", if count == 1 { "" } else { "s" });
    if too_small > 0 {
        let limit = format::plain(input.doc.edit.ellipsoids.smallest_ml);
        text += &format!(", {too_small} below {limit} ml hidden");
    }
    if count == 0 && too_small == 0 {
        text = "Nothing is selected".into();
    }
    let shown = || drawn.iter().filter_map(|one| Some((one, components.get(one.id as usize)?)));
    let mut rows = vec![(Mark::None, text)];
    let mut named = Vec::new();
    for (one, component) in shown() {
        if !named.contains(&component.of) {
            named.push(component.of);
            rows.push((Mark::Color(one.color), name_of(input, component.of)));
        }
    }
    if input.doc.edit.ellipsoids.kind == EllipsoidKind::Enclosing {
        rows.extend(much_larger(input, shown().map(|(_, component)| component)));
    }
    rows
}

/// Warnings of enclosing ellipsoids that are mostly empty, the worst first.
fn much_larger<'a>(
    input: &Input<'_>,
    shown: impl Iterator<Item = &'a ComponentEllipsoid>,
) -> Vec<legend::Row> {
    let mut large: Vec<_> = shown.filter(|component| component.exaggeration >= MUCH_LARGER).collect();
    large.sort_by(|a, b| b.exaggeration.total_cmp(&a.exaggeration));
    let rest = large.split_off(large.len().min(MAX_NAMED)).len();
    let text = |component: &&ComponentEllipsoid| {
        let (name, ml) = (name_of(input, component.of), format::ml(component.volume_ml));
        (Mark::Warning, format!("ellipsoid {:.0} × its component: {name} {ml}", component.exaggeration))
    };
    let mut rows: Vec<legend::Row> = large.iter().map(text).collect();
    if rest > 0 {
        rows.push((Mark::Warning, format!("and {rest} more at least {MUCH_LARGER:.0} ×")));
    }
    rows
}
