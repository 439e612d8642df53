//! The transfer-function editor of the context view: presets, histogram and control points with a factor by gradient
//! magnitude, or shapes over both, and clip planes.

mod shapes;

use std::sync::Arc;

use egui::{
    Color32, ColorImage, Pos2, Rect, Role, Sense, Stroke, TextureHandle, TextureOptions, Ui, WidgetInfo,
    pos2, vec2,
};
use glam::DVec3;
use glioscope_render::{
    ClipPlane, ContextVolume, ControlPoint, GradientHistogram, GradientPoint, TransferFunction,
    TransferPreset, ValueHistogram, flat::PreparedContext, image::MOST_CLIP_PLANES,
};
use strum::VariantArray;

use self::shapes::ShapeEditor;
use super::pane::{Input, Pane, Stage};
use crate::{
    command::{AppCommand, Commands, EditCommand},
    format, theme,
    world::{image::transfer_of, jobs::Lookup},
};

/// Largest distance at which a control point is grabbed, points.
const GRAB_POINTS: f32 = 9.0;

/// Texture of the joint histogram, with its inputs.
type JointTexture = Option<(Arc<GradientHistogram>, TransferFunction, TextureHandle)>;

/// The pane of the transfer-function editor.
#[derive(Default)]
pub struct TransferPane {
    joint_texture: JointTexture,
    shapes: ShapeEditor,
    /// Index of the chosen control point.
    chosen: Option<usize>,
    /// Index of the control point being dragged.
    dragged: Option<usize>,
    /// Index of the gradient point being dragged.
    dragged_gradient: Option<usize>,
}

/// Height in the curve, 0 to 1, of an opacity: the square root spreads small opacities, which tissue has.
fn height(opacity: f64) -> f32 {
    opacity.clamp(0.0, 1.0).sqrt() as f32
}

fn opacity(height: f32) -> f64 {
    f64::from(height.clamp(0.0, 1.0)).powi(2)
}

impl Pane for TransferPane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            egui::Frame::new().inner_margin(6).show(ui, |ui| editor(ui, self, stage, out));
        });
    }
}

fn editor(ui: &mut Ui, state: &mut TransferPane, stage: &mut Stage<'_>, out: &mut Commands) {
    let (input, ask) = (stage.input, stage.ask);
    let Some((id, image)) = input.context else {
        ui.label("No image is chosen, so there is nothing to transfer.");
        return;
    };
    let current = transfer_of(input.doc, id, image);
    let mut new = current.clone();
    presets(ui, id, image, &mut new, state, out);
    let volume = match stage.results.image.volume(input.context, ask) {
        Some(Lookup::Ready(volume)) => volume.clone(),
        Some(Lookup::Failed(error)) => {
            ui.label(error.to_string());
            return;
        }
        _ => {
            ui.spinner();
            return;
        }
    };
    let joint = of_what(ui, id, (image, &volume), &mut new, stage);
    if new.shapes().is_some() {
        if let Some(joint) = joint {
            shapes::editor(ui, &joint, &mut new, &mut state.joint_texture, &mut state.shapes);
        }
    } else {
        curve(ui, volume.histogram(), &mut new, state);
        chosen_point(ui, &mut new, state);
        second_dimension(ui, (image, &volume), &mut new, state, stage);
    }
    if new != current {
        out.push(EditCommand::SetTransfer(id.to_owned(), Some(new)));
    }
    ui.separator();
    clips(ui, &input, image, out);
}

fn presets(
    ui: &mut Ui,
    id: &str,
    image: &PreparedContext,
    new: &mut TransferFunction,
    state: &mut TransferPane,
    out: &mut Commands,
) {
    ui.horizontal_wrapped(|ui| {
        ui.strong(id);
        ui.menu_button("Presets", |ui| {
            for preset in TransferPreset::VARIANTS {
                if *preset == TransferPreset::T1cShapes {
                    ui.separator();
                }
                if ui.button(preset.name()).clicked() {
                    *new = preset.transfer(image.histogram());
                    state.chosen = None;
                    state.shapes = ShapeEditor::default();
                    ui.close();
                }
            }
        });
        for (text, tip, command) in [
            ("Open…", "A transfer function from a file", AppCommand::OpenTransfer),
            ("Save…", "The transfer function as a file", AppCommand::SaveTransfer),
        ] {
            if ui.button(text).on_hover_text(tip).clicked() {
                out.push(command);
            }
        }
        let how = if new.shapes().is_some() {
            "Drag a shape or its handles, Delete removes it"
        } else {
            "Click adds a point, drag moves it, Delete removes it"
        };
        ui.weak(how);
    });
}

/// Chooses between points over values and shapes over values and gradient magnitudes. The joint histogram where shapes
/// are chosen and it is counted.
fn of_what(
    ui: &mut Ui,
    id: &str,
    (image, volume): (&Arc<PreparedContext>, &Arc<ContextVolume>),
    new: &mut TransferFunction,
    stage: &mut Stage<'_>,
) -> Option<Arc<GradientHistogram>> {
    let mut by_shapes = new.shapes().is_some();
    ui.horizontal_wrapped(|ui| {
        ui.label("Opacity and colour by");
        ui.radio_value(&mut by_shapes, false, "value").on_hover_text("Points over the histogram of values");
        ui.radio_value(&mut by_shapes, true, "value and gradient (2-D)").on_hover_text(
            "Boxes, trapezoids and blobs over values and gradient magnitudes: how steeply the value changes there, per \
             millimetre. Materials of one value are told apart by their borders. Every lighting mode draws them.",
        );
    });
    if by_shapes != new.shapes().is_some() {
        // The points are kept meanwhile, so that going back finds them.
        let preset = TransferPreset::first_shapes_for(image.histogram(), id);
        let shapes = by_shapes.then(|| preset.transfer(image.histogram()).shapes().map(<[_]>::to_vec));
        // A preset's shapes are valid.
        let _ = new.set_shapes(shapes.flatten());
    }
    if !by_shapes {
        return None;
    }
    match stage.results.image.gradients(image, volume, stage.ask) {
        Lookup::Ready(joint) => Some(joint.clone()),
        Lookup::Working(_) => {
            ui.spinner();
            None
        }
        Lookup::Failed(error) => {
            ui.label(error.to_string());
            None
        }
    }
}

/// Edits opacity against value, over the histogram.
fn curve(ui: &mut Ui, histogram: &ValueHistogram, new: &mut TransferFunction, state: &mut TransferPane) {
    let size = vec2(ui.available_width(), 150.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, "Opacity of each value"));
    let painter = ui.painter().with_clip_rect(rect.expand(6.0));
    let visuals = ui.visuals();
    painter.rect_filled(rect, 2.0, visuals.extreme_bg_color);
    let (low, high) = histogram.range();
    let x_of =
        |value: f64| rect.left() + ((value - low) / (high - low)).clamp(0.0, 1.0) as f32 * rect.width();
    let value_at =
        |x: f32| low + f64::from(((x - rect.left()) / rect.width()).clamp(0.0, 1.0)) * (high - low);
    let y_of = |opacity: f64| rect.bottom() - height(opacity) * rect.height();
    let bars = histogram.log_heights();
    let bar = rect.width() / bars.len().max(1) as f32;
    let ink = visuals.weak_text_color().gamma_multiply(0.35);
    for (i, bar_height) in bars.iter().enumerate() {
        let left = rect.left() + i as f32 * bar;
        let top = rect.bottom() - *bar_height as f32 * rect.height();
        painter.rect_filled(
            Rect::from_min_max(pos2(left, top), pos2(left + bar + 0.5, rect.bottom())),
            0.0,
            ink,
        );
    }
    let steps = 160;
    let strip = rect.width() / steps as f32;
    let samples: Vec<(Pos2, Color32)> = (0..=steps)
        .map(|i| {
            let x = rect.left() + i as f32 * strip;
            let (color, per_mm) = new.sample(value_at(x), f64::INFINITY);
            let [r, g, b] = color.map(|c| (c * 255.0) as u8);
            (pos2(x, y_of(per_mm)), theme::color([r, g, b]))
        })
        .collect();
    for pair in samples.windows(2) {
        let under = Rect::from_min_max(
            pos2(pair[0].0.x, pair[0].0.y.min(pair[1].0.y)),
            pos2(pair[1].0.x, rect.bottom()),
        );
        painter.rect_filled(under, 0.0, pair[0].1.gamma_multiply(0.45));
    }
    // Drawn through the control points, so that steps are vertical.
    let corners: Vec<Pos2> = std::iter::once(pos2(rect.left(), y_of(new.sample(low, f64::INFINITY).1)))
        .chain(new.points().iter().map(|p| pos2(x_of(p.value), y_of(p.opacity))))
        .chain([pos2(rect.right(), y_of(new.sample(high, f64::INFINITY).1))])
        .collect();
    painter.add(egui::Shape::line(corners, Stroke::new(1.5, visuals.text_color())));
    let positions: Vec<Pos2> = new.points().iter().map(|p| pos2(x_of(p.value), y_of(p.opacity))).collect();
    let grabbed_at = |at: Pos2| {
        let closest =
            positions.iter().enumerate().min_by(|a, b| a.1.distance(at).total_cmp(&b.1.distance(at)));
        closest.filter(|(_, p)| p.distance(at) <= GRAB_POINTS).map(|(i, _)| i)
    };
    if response.drag_started() {
        // The pointer has moved on since the press.
        state.dragged = ui.input(|i| i.pointer.press_origin()).and_then(grabbed_at);
        state.chosen = state.dragged.or(state.chosen);
    }
    if response.drag_stopped() {
        state.dragged = None;
    }
    if let (Some(index), Some(at)) =
        (state.dragged, response.interact_pointer_pos().filter(|_| response.dragged()))
        && let Some(point) = new.points().get(index).copied()
    {
        let per_mm = opacity((rect.bottom() - at.y) / rect.height());
        new.set_point(index, ControlPoint { value: value_at(at.x), opacity: per_mm, ..point });
    }
    if response.clicked()
        && let Some(at) = response.interact_pointer_pos()
    {
        state.chosen = grabbed_at(at).or_else(|| {
            let index = new.add_point(value_at(at.x))?;
            let point = *new.points().get(index)?;
            new.set_point(
                index,
                ControlPoint { opacity: opacity((rect.bottom() - at.y) / rect.height()), ..point },
            );
            Some(index)
        });
        response.request_focus();
    }
    let deletes =
        |i: &egui::InputState| i.key_pressed(egui::Key::Delete) || i.key_pressed(egui::Key::Backspace);
    if response.has_focus() && ui.input(deletes) {
        remove_chosen(new, state);
    }
    for (index, (at, point)) in positions.iter().zip(new.points()).enumerate() {
        let [r, g, b] = point.color;
        let radius = if state.chosen == Some(index) { 6.0 } else { 4.5 };
        painter.circle(*at, radius, theme::color([r, g, b]), Stroke::new(1.5, visuals.text_color()));
    }
    ui.horizontal(|ui| {
        ui.weak(format::plain(low));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.weak(format::plain(high)));
    });
}

fn remove_chosen(new: &mut TransferFunction, state: &mut TransferPane) {
    if let Some(index) = state.chosen
        && new.remove_point(index)
    {
        state.chosen = None;
        state.dragged = None;
    }
}

/// Edits value, opacity and colour of the chosen point.
fn chosen_point(ui: &mut Ui, new: &mut TransferFunction, state: &mut TransferPane) {
    let Some((index, point)) = state.chosen.and_then(|n| new.points().get(n).map(|p| (n, *p))) else {
        ui.weak("No point is chosen");
        return;
    };
    let mut edited = point;
    let mut remove = false;
    ui.horizontal_wrapped(|ui| {
        let response = ui.color_edit_button_srgb(&mut edited.color);
        response.widget_info(|| WidgetInfo::labeled(Role::ColorWell, true, "Colour of the point"));
        ui.label("value");
        let speed = (point.value.abs() * 0.005).max(0.01);
        let response = ui.add(egui::DragValue::new(&mut edited.value).speed(speed).max_decimals(3));
        response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Value of the point"));
        ui.label("opacity of 1 mm");
        let response =
            ui.add(egui::DragValue::new(&mut edited.opacity).speed(0.005).range(0.0..=1.0).max_decimals(3));
        response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Opacity of the point"));
        remove = ui.button("Remove").clicked();
    });
    if edited != point {
        new.set_point(index, edited);
    }
    if remove {
        remove_chosen(new, state);
    }
}

/// Edits the factor of opacity against gradient magnitude, below the joint histogram.
fn second_dimension(
    ui: &mut Ui,
    (image, volume): (&Arc<PreparedContext>, &Arc<ContextVolume>),
    new: &mut TransferFunction,
    state: &mut TransferPane,
    stage: &mut Stage<'_>,
) {
    let mut on = new.gradient().is_some();
    let text = "Factor by gradient magnitude";
    let tip = "Opacity also depends on how steeply the value changes: borders stand out, flat tissue fades";
    let toggled = ui.checkbox(&mut on, text).on_hover_text(tip).changed();
    if !on {
        if toggled {
            // A valid function stays valid without the gradient.
            let _ = new.set_gradient(None);
        }
        return;
    }
    let joint = match stage.results.image.gradients(image, volume, stage.ask) {
        Lookup::Ready(joint) => joint.clone(),
        Lookup::Working(_) => {
            ui.spinner();
            return;
        }
        Lookup::Failed(error) => {
            ui.label(error.to_string());
            return;
        }
    };
    let highest = joint.highest_gradient();
    if toggled {
        let points = [(0.0, 0.0), (0.05, 0.1), (0.2, 1.0), (1.0, 1.0)];
        let ramp = points.map(|(share, factor)| GradientPoint { gradient: share * highest, factor });
        // The ramp is valid: gradients ascend and factors are within 0 to 1.
        let _ = new.set_gradient(Some(ramp.to_vec()));
    }
    joint_histogram_image(ui, &joint, new, &mut state.joint_texture);
    let Some(points) = new.gradient() else { return };
    let mut points = points.to_vec();
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 70.0), Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::labeled(Role::Canvas, true, "Factor of each gradient magnitude"));
    let painter = ui.painter().with_clip_rect(rect.expand(6.0));
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let position = |p: &GradientPoint| {
        let x = (p.gradient / highest).clamp(0.0, 1.0) as f32;
        pos2(rect.left() + x * rect.width(), rect.bottom() - p.factor as f32 * rect.height())
    };
    if response.drag_started()
        && let Some(at) = ui.input(|i| i.pointer.press_origin())
    {
        let by_distance = |a: &GradientPoint, b: &GradientPoint| {
            position(a).distance(at).total_cmp(&position(b).distance(at))
        };
        state.dragged_gradient = (0..points.len()).min_by(|&a, &b| by_distance(&points[a], &points[b]));
    }
    if let (Some(index), Some(at)) = (state.dragged_gradient, response.interact_pointer_pos())
        && response.dragged()
    {
        let below = index.checked_sub(1).and_then(|n| points.get(n)).map_or(0.0, |p| p.gradient);
        let above = points.get(index + 1).map_or(highest.max(below), |p| p.gradient);
        if let Some(point) = points.get_mut(index) {
            let share = f64::from(((at.x - rect.left()) / rect.width()).clamp(0.0, 1.0));
            point.gradient = (share * highest).clamp(below, above);
            point.factor = f64::from(((rect.bottom() - at.y) / rect.height()).clamp(0.0, 1.0));
        }
        // Clamped between its neighbours, the point keeps the function valid.
        let _ = new.set_gradient(Some(points.clone()));
    }
    let line: Vec<Pos2> = points.iter().map(position).collect();
    painter.add(egui::Shape::line(line.clone(), Stroke::new(1.5, ui.visuals().text_color())));
    for at in line {
        painter.circle_filled(at, 4.5, ui.visuals().text_color());
    }
    ui.weak(format!("gradient magnitude, 0 to {} per mm", format::plain(highest)));
}

/// The texture of the joint histogram of value and gradient magnitude, tinted with the transfer function's colours.
fn joint_texture(
    ui: &Ui,
    joint: &Arc<GradientHistogram>,
    transfer: &TransferFunction,
    held: &mut JointTexture,
) -> egui::TextureId {
    if let Some((of, with, texture)) = held
        && Arc::ptr_eq(of, joint)
        && with == transfer
    {
        return texture.id();
    }
    let bins = GradientHistogram::BINS;
    let (low, high) = joint.range();
    let share = |i: usize| (i as f64 + 0.5) / bins as f64;
    let mut pixels = vec![Color32::BLACK; bins * bins];
    for (i, log_height) in joint.log_heights().iter().enumerate() {
        let (row, column) = (i / bins, i % bins);
        let value = low + share(column) * (high - low);
        let (color, per_mm) = transfer.sample(value, share(row).powi(2) * joint.highest_gradient());
        let tint = per_mm.sqrt();
        // Bins with few voxels are visible too.
        let brightness = if *log_height > 0.0 { 0.25 + 0.75 * log_height } else { 0.0 };
        let mixed = color.map(|c| (255.0 * brightness * (0.7 * (1.0 - tint) + c * tint)) as u8);
        // Larger gradients are further up.
        pixels[(bins - 1 - row) * bins + column] = theme::color(mixed);
    }
    let image = ColorImage::new([bins, bins], pixels);
    let texture = ui.ctx().load_texture("joint histogram", image, TextureOptions::NEAREST);
    let id = texture.id();
    *held = Some((joint.clone(), transfer.clone(), texture));
    id
}

/// Draws the joint histogram.
fn joint_histogram_image(
    ui: &mut Ui,
    joint: &Arc<GradientHistogram>,
    transfer: &TransferFunction,
    held: &mut JointTexture,
) {
    let texture = joint_texture(ui, joint, transfer, held);
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), 110.0), Sense::hover());
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    ui.painter().image(texture, rect, whole, Color32::WHITE);
    response
        .on_hover_text("Voxels by value (across) and gradient magnitude (up), tinted where they are seen");
}

/// Sides of the patient that a clip plane can cut off: name, outward normal.
pub const SIDES: [(&str, DVec3); 6] = [
    ("right", DVec3::X),
    ("left", DVec3::NEG_X),
    ("front", DVec3::Y),
    ("back", DVec3::NEG_Y),
    ("top", DVec3::Z),
    ("bottom", DVec3::NEG_Z),
];

/// Name of the side that a clip plane cuts off.
fn side_name(normal: DVec3) -> &'static str {
    SIDES.iter().find(|(_, n)| n.distance(normal) < 1e-9).map_or("slanted", |(name, _)| name)
}

fn clips(ui: &mut Ui, input: &Input<'_>, image: &PreparedContext, out: &mut Commands) {
    let current = &input.doc.edit.clips;
    let mut new = current.clone();
    let corners = image.volume().grid().corners_mm();
    let range = |normal: DVec3| {
        let along = corners.map(|c| c.dot(normal));
        (
            along.iter().copied().fold(f64::INFINITY, f64::min),
            along.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        )
    };
    ui.horizontal_wrapped(|ui| {
        ui.strong("Cut the image open");
        ui.add_enabled_ui(current.len() < MOST_CLIP_PLANES, |ui| {
            ui.menu_button("Add a plane", |ui| {
                let facing = input.doc.nav.camera.axes()[2];
                for (text, normal) in SIDES
                    .iter()
                    .map(|(name, normal)| (format!("from the {name}"), *normal))
                    .chain([("facing me".to_owned(), facing)])
                {
                    if ui.button(text).clicked() {
                        new.push(ClipPlane { normal, offset_mm: input.doc.nav.crosshair_mm().dot(normal) });
                        ui.close();
                    }
                }
            });
        });
    });
    let mut removed = None;
    for (index, plane) in new.iter_mut().enumerate() {
        ui.horizontal(|ui| {
            let name = side_name(plane.normal);
            ui.label(name);
            let (low, high) = range(plane.normal);
            ui.spacing_mut().slider_width = (ui.available_width() - 170.0).max(60.0);
            let slider = egui::Slider::new(&mut plane.offset_mm, low..=high).suffix(" mm").fixed_decimals(1);
            let response = ui.add(slider);
            response.widget_info(|| {
                WidgetInfo::labeled(Role::Slider, true, format!("Place of plane {} ({name})", index + 1))
            });
            if ui.button("Remove").clicked() {
                removed = Some(index);
            }
        });
    }
    if let Some(index) = removed {
        new.remove(index);
    }
    if new != *current {
        out.push(EditCommand::SetClips(new));
    }
}
