//! The editor of 2-D transfer functions: boxes, trapezoids and blobs on the joint histogram of value and gradient
//! magnitude.

use std::sync::Arc;

use egui::{Pos2, Rect, Response, Role, Sense, Stroke, Ui, WidgetInfo, pos2, vec2};
use glioscope_render::{GradientHistogram, TransferForm, TransferFunction, TransferShape};

use super::{GRAB_POINTS, JointTexture, joint_texture};
use crate::{format, theme, views::draw::name_widget};

/// Height of the joint histogram, points.
const HEIGHT_POINTS: f32 = 230.0;

/// A shape being dragged.
#[derive(Clone, Copy)]
struct Drag {
    shape: usize,
    /// Number of the handle; `None` moves the whole shape.
    handle: Option<usize>,
    /// The form at the press.
    form: TransferForm,
    /// Value and gradient magnitude at the press.
    from: [f64; 2],
}

/// The editor's state.
#[derive(Default)]
pub(super) struct ShapeEditor {
    /// Index of the chosen shape.
    chosen: Option<usize>,
    drag: Option<Drag>,
}

/// From values and gradient magnitudes to points of the window. Upwards by the square root, as the histogram: most voxels
/// have small gradients.
struct Axes {
    rect: Rect,
    range: (f64, f64),
    highest: f64,
}

impl Axes {
    fn position(&self, [value, gradient]: [f64; 2]) -> Pos2 {
        let share = |x: f64| x.clamp(-2.0, 3.0) as f32;
        let across = share((value - self.range.0) / (self.range.1 - self.range.0));
        let up = share((gradient.max(0.0) / self.highest).sqrt());
        pos2(self.rect.left() + across * self.rect.width(), self.rect.bottom() - up * self.rect.height())
    }

    fn at(&self, position: Pos2) -> [f64; 2] {
        let across = f64::from((position.x - self.rect.left()) / self.rect.width());
        let up = f64::from((self.rect.bottom() - position.y) / self.rect.height());
        [self.range.0 + across * (self.range.1 - self.range.0), up.max(0.0).powi(2) * self.highest]
    }
}

/// Name of a form in the window.
fn name(form: &TransferForm) -> &'static str {
    match form {
        TransferForm::Box { .. } => "box",
        TransferForm::Trapezoid { .. } => "trapezoid",
        TransferForm::Blob { .. } => "blob",
    }
}

/// Edits the shapes over the joint histogram.
pub(super) fn editor(
    ui: &mut Ui,
    joint: &Arc<GradientHistogram>,
    new: &mut TransferFunction,
    texture: &mut JointTexture,
    state: &mut ShapeEditor,
) {
    let mut shapes = new.shapes().unwrap_or_default().to_vec();
    state.chosen = state.chosen.filter(|&n| n < shapes.len());
    add_buttons(ui, joint, &mut shapes, state);
    plane(ui, joint, new, &mut shapes, texture, state);
    list(ui, &shapes, state);
    chosen_shape(ui, &mut shapes, state);
    // Whatever the widgets gave, an invalid list leaves the function as it was.
    let _ = new.set_shapes(Some(shapes));
}

/// New shapes appear in the middle of the plane, a quarter of it wide.
fn add_buttons(
    ui: &mut Ui,
    joint: &GradientHistogram,
    shapes: &mut Vec<TransferShape>,
    state: &mut ShapeEditor,
) {
    let (low, high) = joint.range();
    let at = |share: f64| low + share * (high - low);
    let up = |share: f64| share * share * joint.highest_gradient();
    let forms = [
        (
            "Add a box",
            TransferForm::Box {
                values: [at(0.4), at(0.65)],
                gradients_per_mm: [up(0.3), up(0.55)],
                soft: 0.2,
            },
        ),
        (
            "Add a trapezoid",
            TransferForm::Trapezoid {
                gradients_per_mm: [up(0.05), up(0.6)],
                lower_values: [at(0.48), at(0.52)],
                upper_values: [at(0.3), at(0.7)],
                soft: 0.2,
            },
        ),
        (
            "Add a blob",
            TransferForm::Blob {
                value: at(0.5),
                gradient_per_mm: up(0.4),
                value_deviation: 0.08 * (high - low),
                gradient_deviation_per_mm: up(0.15),
            },
        ),
    ];
    ui.horizontal_wrapped(|ui| {
        let room = shapes.len() < TransferFunction::MOST_SHAPES;
        for (text, form) in forms {
            if ui.add_enabled(room, egui::Button::new(text)).clicked() {
                // Hues by the golden angle: neighbours differ.
                let hue = (0.08 + 0.381_966 * shapes.len() as f32) % 1.0;
                let color = egui::ecolor::Hsva::new(hue, 0.75, 1.0, 1.0).to_srgb();
                shapes.push(TransferShape { form, color, opacity: 0.3 });
                state.chosen = Some(shapes.len() - 1);
            }
        }
    });
}

/// The topmost shape at a place.
fn shape_at(shapes: &[TransferShape], [value, gradient]: [f64; 2]) -> Option<usize> {
    shapes.iter().rposition(|shape| shape.form.weight(value, gradient.max(0.0)) > 0.0)
}

/// The joint histogram with the shapes: a press on a handle of the chosen shape reshapes it, one on a shape chooses and
/// moves it.
fn plane(
    ui: &mut Ui,
    joint: &Arc<GradientHistogram>,
    transfer: &TransferFunction,
    shapes: &mut Vec<TransferShape>,
    texture: &mut JointTexture,
    state: &mut ShapeEditor,
) {
    let id = joint_texture(ui, joint, transfer, texture);
    let (rect, response) =
        ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT_POINTS), Sense::click_and_drag());
    response
        .widget_info(|| WidgetInfo::labeled(Role::Canvas, true, "Shapes on values and gradient magnitudes"));
    let painter = ui.painter().with_clip_rect(rect);
    painter.image(id, rect, Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0)), theme::ON_IMAGE);
    let axes = Axes { rect, range: joint.range(), highest: joint.highest_gradient() };
    drag(ui, &response, &axes, shapes, state);
    if response.clicked()
        && let Some(position) = response.interact_pointer_pos()
    {
        state.chosen = shape_at(shapes, axes.at(position));
        response.request_focus();
    }
    let deletes =
        |i: &egui::InputState| i.key_pressed(egui::Key::Delete) || i.key_pressed(egui::Key::Backspace);
    if response.has_focus() && ui.input(deletes) {
        delete_chosen(shapes, state);
    }
    for (number, shape) in shapes.iter().enumerate() {
        let is_chosen = state.chosen == Some(number);
        let outline: Vec<Pos2> = outline(&shape.form).into_iter().map(|at| axes.position(at)).collect();
        let width = if is_chosen { 2.5 } else { 1.5 };
        painter.add(egui::Shape::closed_line(outline.clone(), Stroke::new(width + 1.5, theme::EDGE)));
        painter.add(egui::Shape::closed_line(outline, Stroke::new(width, theme::color(shape.color))));
        for handle in shape.form.handles().into_iter().filter(|_| is_chosen) {
            let dot = Stroke::new(1.5, theme::DARK_INK);
            painter.circle(axes.position(handle), 4.5, theme::ON_IMAGE, dot);
        }
    }
    ui.horizontal(|ui| {
        ui.weak(format!("value {} to {}", format::plain(axes.range.0), format::plain(axes.range.1)));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.weak(format!("up: gradient to {} per mm (by root)", format::plain(axes.highest)));
        });
    });
}

fn drag(ui: &Ui, response: &Response, axes: &Axes, shapes: &mut [TransferShape], state: &mut ShapeEditor) {
    if response.drag_started() {
        // The pointer has moved on since the press.
        state.drag = ui.input(|i| i.pointer.press_origin()).and_then(|at| {
            let from = axes.at(at);
            let of_chosen = state.chosen.and_then(|number| {
                let shape = shapes.get(number)?;
                let distances =
                    shape.form.handles().into_iter().map(|handle| axes.position(handle).distance(at));
                let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
                let (handle, _) = nearest.filter(|(_, distance)| *distance <= GRAB_POINTS)?;
                Some(Drag { shape: number, handle: Some(handle), form: shape.form, from })
            });
            of_chosen.or_else(|| {
                let number = shape_at(shapes, from)?;
                Some(Drag { shape: number, handle: None, form: shapes.get(number)?.form, from })
            })
        });
        state.chosen = state.drag.map(|drag| drag.shape).or(state.chosen);
    }
    if let (Some(drag), Some(at)) = (state.drag, response.interact_pointer_pos())
        && (response.dragged() || response.drag_stopped())
        && let Some(shape) = shapes.get_mut(drag.shape)
    {
        let to = axes.at(at);
        shape.form = match drag.handle {
            Some(handle) => drag.form.reshaped(handle, to),
            None => drag.form.moved(to[0] - drag.from[0], to[1] - drag.from[1]),
        };
    }
    if response.drag_stopped() {
        state.drag = None;
    }
}

/// A form's outline, in order; a blob's ellipse of two standard deviations, where an eighth of its weight is left.
fn outline(form: &TransferForm) -> Vec<[f64; 2]> {
    match *form {
        TransferForm::Blob { value, gradient_per_mm, value_deviation, gradient_deviation_per_mm } => (0..48)
            .map(|i| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 48.0).sin_cos();
                [value + 2.0 * value_deviation * cos, gradient_per_mm + 2.0 * gradient_deviation_per_mm * sin]
            })
            .collect(),
        _ => {
            // Straight edges are curves on the axis of square roots.
            let handles = form.handles();
            let corners: Vec<[f64; 2]> =
                [0, 1, 3, 2].into_iter().filter_map(|i| handles.get(i).copied()).collect();
            let next = corners.iter().cycle().skip(1);
            let steps = 16;
            let between = |(from, to): (&[f64; 2], &[f64; 2])| {
                let (from, to) = (*from, *to);
                (0..steps).map(move |i| {
                    let share = f64::from(i) / f64::from(steps);
                    [0, 1].map(|a| from[a] * (1.0 - share) + to[a] * share)
                })
            };
            corners.iter().zip(next).flat_map(between).collect()
        }
    }
}

/// The shapes as a list, so that each can be chosen without the pointer and beneath others.
fn list(ui: &mut Ui, shapes: &[TransferShape], state: &mut ShapeEditor) {
    if shapes.is_empty() {
        ui.weak("No shape: everything is transparent");
        return;
    }
    ui.horizontal_wrapped(|ui| {
        for (number, shape) in shapes.iter().enumerate() {
            let is_chosen = state.chosen == Some(number);
            let text = format!("{} {}", number + 1, name(&shape.form));
            let (rect, _) = ui.allocate_exact_size(vec2(12.0, 12.0), Sense::hover());
            ui.painter().rect_filled(rect, 2.0, theme::color(shape.color));
            if ui.selectable_label(is_chosen, text).clicked() {
                state.chosen = if is_chosen { None } else { Some(number) };
            }
        }
    });
}

fn delete_chosen(shapes: &mut Vec<TransferShape>, state: &mut ShapeEditor) {
    if let Some(number) = state.chosen.take().filter(|&n| n < shapes.len()) {
        shapes.remove(number);
        state.drag = None;
    }
}

/// A field of a number.
fn field(ui: &mut Ui, name: &str, number: &mut f64, speed: f64, range: std::ops::RangeInclusive<f64>) {
    let response = ui.add(egui::DragValue::new(number).speed(speed).range(range).max_decimals(3));
    name_widget(ui, &response, name);
}

/// A pair of limits, the second not below the first.
fn limits(ui: &mut Ui, name: &str, limits: &mut [f64; 2], speed: f64, least: f64) {
    ui.label(name);
    let [low, high] = *limits;
    field(ui, &format!("Lowest {name}"), &mut limits[0], speed, least..=high);
    ui.label("to");
    field(ui, &format!("Highest {name}"), &mut limits[1], speed, low..=f64::MAX);
}

/// Edits colour, opacity and place of the chosen shape in numbers.
fn chosen_shape(ui: &mut Ui, shapes: &mut Vec<TransferShape>, state: &mut ShapeEditor) {
    let Some(shape) = state.chosen.and_then(|n| shapes.get_mut(n)) else {
        ui.weak("No shape is chosen: click one to change it");
        return;
    };
    let mut delete = false;
    ui.horizontal_wrapped(|ui| {
        let response = ui.color_edit_button_srgb(&mut shape.color);
        name_widget(ui, &response, "Colour of the shape");
        ui.label("opacity of 1 mm");
        field(ui, "Opacity of the shape", &mut shape.opacity, 0.005, 0.0..=1.0);
        if let TransferForm::Box { soft, .. } | TransferForm::Trapezoid { soft, .. } = &mut shape.form {
            ui.label("soft edges");
            field(ui, "Softness of the shape's edges", soft, 0.005, 0.0..=1.0);
        }
        delete = ui.button("Delete").clicked();
    });
    let (values, gradients) = shape.form.bounds();
    let speed = |[low, high]: [f64; 2]| (0.005 * (high - low)).max(1e-6);
    let (by_value, by_gradient) = (speed(values), speed(gradients));
    match &mut shape.form {
        TransferForm::Box { values, gradients_per_mm, .. } => {
            ui.horizontal_wrapped(|ui| limits(ui, "value", values, by_value, f64::MIN));
            ui.horizontal_wrapped(|ui| limits(ui, "gradient", gradients_per_mm, by_gradient, 0.0));
        }
        TransferForm::Trapezoid { gradients_per_mm, lower_values, upper_values, .. } => {
            ui.horizontal_wrapped(|ui| limits(ui, "value at the top", upper_values, by_value, f64::MIN));
            ui.horizontal_wrapped(|ui| limits(ui, "value at the bottom", lower_values, by_value, f64::MIN));
            ui.horizontal_wrapped(|ui| limits(ui, "gradient", gradients_per_mm, by_gradient, 0.0));
        }
        TransferForm::Blob { value, gradient_per_mm, value_deviation, gradient_deviation_per_mm } => {
            let mut around = |name: &str, middle: &mut f64, deviation: &mut f64, speed: f64, least: f64| {
                ui.horizontal_wrapped(|ui| {
                    ui.label(name);
                    field(ui, &format!("Middle {name}"), middle, speed, least..=f64::MAX);
                    ui.label("±");
                    field(ui, &format!("Standard deviation of {name}"), deviation, speed, 1e-9..=f64::MAX);
                });
            };
            around("value", value, value_deviation, by_value, f64::MIN);
            around("gradient", gradient_per_mm, gradient_deviation_per_mm, by_gradient, 0.0);
        }
    }
    if delete {
        delete_chosen(shapes, state);
    }
}
