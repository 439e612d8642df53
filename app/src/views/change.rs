//! The change view (thesis 7.3.4): where the surface of one mask grew, shrank or stayed between two
//! dates, as a height map or as arrows, in its anatomy.

use std::sync::Arc;

use egui::{Color32, ComboBox, FontId, Rect, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec3;
use glioscope_core::change::Flag;
use glioscope_render::{
    ChangeContext, ChangeFrame, ChangeLook, ChangePick, ChangeScene, ChangeStyle, Gpu, MaskColors, Palette,
    TransferFunction,
};

use super::{
    ViewContext, closeup,
    context::{self, VolumeJob, transfer_of},
    ellipsoids::Stage,
    linked::{self, Drawing, Linked, LinkedView, Picked},
    ruler,
};
use crate::{
    commands::Command,
    comparing::{self, ChangeSetting, Compared, Comparisons},
    document::{self, Pane},
    jobs::Lookup,
    window::waker,
};

/// From line to line of the legend.
const LINE_POINTS: f32 = 16.0;

/// What the view remembers between frames; never saved.
#[derive(Default)]
pub struct ChangeState {
    picture: LinkedView<ChangeScene, ChangePick>,
    transfer: Option<Arc<TransferFunction>>,
}

impl ChangeState {
    /// Whether the picture last drawn was in full quality.
    pub fn refined(&self) -> bool {
        self.picture.refined()
    }

    /// What is under the pointer.
    pub fn hover(&self) -> Option<&ChangePick> {
        self.picture.hover()
    }
}

/// Colours of recession and growth.
pub fn colors_of(palette: Palette) -> ([u8; 3], [u8; 3]) {
    let [grow, shrink] = ChangeLook::pair(palette);
    (shrink, grow)
}

/// Colours of the two dates as two masks: what is at the earlier date alone is gone, at the later
/// alone new.
pub fn pair_colors(palette: Palette) -> MaskColors {
    let (shrink, grow) = colors_of(palette);
    MaskColors::new(palette, &[Some(shrink), Some(grow)])
}

/// The change drawn opaque where the user chose none.
fn full_mm(setting: &ChangeSetting, compared: &Compared) -> f64 {
    let most = |l: &glioscope_core::change::Lengths| l.p95_mm.unwrap_or(0.0);
    let report = &compared.report;
    setting.full_mm.unwrap_or_else(|| most(&report.growth).max(most(&report.recession)).max(1.0))
}

fn look(view: &ViewContext<'_>, compared: &Compared) -> ChangeLook {
    let setting = &view.doc.edit.change;
    let (shrink, grow) = colors_of(view.doc.edit.palette);
    ChangeLook {
        style: setting.style,
        full_mm: full_mm(setting, compared),
        smooth_mm: setting.smooth_mm,
        threshold_mm: setting.threshold_mm,
        grow,
        shrink,
    }
}

/// Draws the view into all of `ui` and writes what the user did to `out`.
pub fn show(
    ui: &mut Ui,
    view: &ViewContext<'_>,
    stage: Stage<'_>,
    (state, comparisons, job): (&mut ChangeState, &mut Comparisons, &mut VolumeJob),
    out: &mut Vec<Command>,
) {
    let chosen = view.doc.edit.change.chosen(view.case);
    if let Ok(chosen) = &chosen {
        ui.horizontal_wrapped(|ui| controls(ui, view, chosen, out));
    }
    let rect = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    if let Err(why) = chosen {
        closeup::message(ui, rect, &why);
        return;
    }
    let Some(viewport) = stage.viewport else {
        closeup::message(ui, rect, "No graphics adapter: the change view can't be drawn.");
        return;
    };
    let setting = &view.doc.edit.change;
    let compared =
        match comparing::get(comparisons, view.case, setting, stage.refine_at_once, waker(ui.ctx())) {
            Some(Lookup::Ready(compared)) => compared.clone(),
            Some(Lookup::Working(progress)) => {
                let text = crate::world::progress_text(progress);
                closeup::message(ui, rect, &text);
                ui.request_repaint_after(std::time::Duration::from_millis(100));
                return;
            }
            Some(Lookup::Failed(why)) => {
                closeup::message(ui, rect, why);
                return;
            }
            None => return,
        };
    let volume = match context::volume(ui, view, stage.refine_at_once, job) {
        Some(Lookup::Ready(volume)) => Some(volume.clone()),
        Some(Lookup::Working(_)) => {
            ui.request_repaint_after(std::time::Duration::from_millis(100));
            None
        }
        _ => None,
    };
    let transfer = match view.context {
        Some((id, image)) => transfer_of(view, id, image),
        None => TransferFunction::transparent(),
    };
    let transfer = match &state.transfer {
        Some(have) if **have == transfer => have.clone(),
        _ => state.transfer.insert(Arc::new(transfer)).clone(),
    };
    let nav = &view.doc.nav;
    let radius_mm = document::tumor_radius_mm(view.time_point);
    let camera = linked::camera(&nav.camera, view.doc.edit.lens.center_mm, radius_mm, nav.change_zoom);
    let scene = ChangeScene {
        surface: compared.surface.clone(),
        look: look(view, &compared),
        base: ChangeLook::BASE,
        context: ChangeContext { volume, transfer, clip: view.doc.edit.clips.clone() },
        camera,
        background: closeup::background(ui.visuals().dark_mode),
        silhouette: [0, 0, 0],
    };
    let linked = Linked { pane: Pane::Change, camera, zoom: nav.change_zoom, rect };
    let drawing = Drawing {
        gpu: &viewport.gpu,
        screen: &mut viewport.change,
        scene: &scene,
        refine_at_once: stage.refine_at_once,
        pick: |frame: &ChangeFrame, gpu: &Gpu, [x, y]: [u32; 2]| frame.pick(gpu, x, y),
    };
    let Some(outcome) = state.picture.draw(ui, view, &linked, &response, drawing, out) else { return };
    let spoken = state.hover().map(|pick| pick_text(&compared, pick));
    partner(ui, rect, &linked, state.hover());
    linked.say(ui, view, &response, &outcome, spoken.as_deref());
    legend(ui, view, rect, &compared, &scene.look);
    closeup::corner_marks(ui, view, rect, (&camera, "at the middle"), true);
    response.widget_info(|| {
        let under = spoken.clone().unwrap_or_else(|| "nothing under the pointer".into());
        let [from, to] = &compared.labels;
        let words = format!("Change of {} from {from} to {to}: {under}", compared.report.mask);
        WidgetInfo::labeled(Role::Canvas, true, words)
    });
}

impl Picked for ChangePick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

/// The unfiltered value under the pointer, and what is special about it.
pub fn pick_text(compared: &Compared, pick: &ChangePick) -> String {
    let [from, to] = &compared.labels;
    match (&pick.vector, pick.unpartnered) {
        (Some(v), _) => {
            let what = if v.signed_mm > 0.0 { "grew" } else { "shrank" };
            let sure = if v.flags.within_uncertainty { ", within uncertainty" } else { "" };
            let fallback = if v.flags.no_set { "\npartner: nearest surface" } else { "" };
            format!(
                "{what} {:.1} mm{sure} (± {:.1} mm)\nnearest surface {:.1} mm{fallback}",
                v.signed_mm.abs(),
                v.uncertainty_mm,
                v.nearest_mm
            )
        }
        (None, Some(true)) => format!("new component at {to}: no counterpart"),
        (None, Some(false)) => format!("component of {from} that is gone: no counterpart"),
        (None, None) => "no change here".into(),
    }
}

/// The line from a point to its partner.
fn partner(ui: &Ui, rect: Rect, linked: &Linked, hover: Option<&ChangePick>) {
    let Some(v) = hover.and_then(|pick| pick.vector.as_ref()) else { return };
    let ends = [v.from_mm, v.to_mm].map(|mm| super::ring::pos_of(&linked.camera, rect, mm));
    if let [Some(from), Some(to)] = ends {
        let painter = ui.painter().with_clip_rect(rect);
        ruler::line(&painter, [from, to], ruler::Look::Solid, "");
    }
}

fn controls(ui: &mut Ui, view: &ViewContext<'_>, chosen: &comparing::Chosen, out: &mut Vec<Command>) {
    let setting = &view.doc.edit.change;
    let mut new = setting.clone();
    ui.add_space(4.0);
    let ids = comparing::ids_at(view.case, chosen.dates);
    let combo = ComboBox::from_id_salt("compared mask").selected_text(&chosen.id).width(70.0);
    let response = combo.show_ui(ui, |ui| {
        for id in ids {
            if ui.selectable_label(chosen.id == id, id).clicked() {
                new.of = Some(id.to_owned());
            }
        }
    });
    response.response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Mask to compare"));
    let [from, to] = chosen.dates.map(|d| view.case.time_points[d].label.as_str());
    ui.label(format!("{from} to {to}"));
    for (style, text, tip) in [
        (ChangeStyle::Height, "Height map", "Colour where the surface moved, smoothed over the picture"),
        (ChangeStyle::Arrows, "Arrows", "An arrow from where the surface was to where it is"),
    ] {
        if ui.selectable_label(setting.style == style, text).on_hover_text(tip).clicked() {
            new.style = style;
        }
    }
    let (value, prefix, name, tip, most) = match setting.style {
        ChangeStyle::Height => (
            &mut new.smooth_mm,
            "smooth ",
            "Smoothing of the height map",
            "Width of the Gauss filter; the pointer always tells the unfiltered value",
            5.0,
        ),
        ChangeStyle::Arrows => {
            (&mut new.threshold_mm, "from ", "Shortest arrow", "Shorter arrows are left out", 50.0)
        }
    };
    let drag = egui::DragValue::new(value).range(0.0..=most).speed(0.05).fixed_decimals(1).suffix(" mm");
    let response = ui.add(drag.prefix(prefix));
    response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, name));
    response.on_hover_text(tip);
    let drag = egui::DragValue::new(&mut new.registration_mm).range(0.0..=20.0).speed(0.02).suffix(" mm");
    let response = ui.add(drag.prefix("registration ± "));
    response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Registration error"));
    response.on_hover_text("How far off the two dates may lie from one another (standard deviation)");
    ui.checkbox(&mut new.on_slices, "on slices").on_hover_text("Slices show both outlines and what changed");
    if new != *setting {
        out.push(Command::SetChange(Box::new(new)));
    }
}

/// Colours with their numbers, and what was counted.
fn legend(ui: &Ui, view: &ViewContext<'_>, rect: Rect, compared: &Compared, look: &ChangeLook) {
    let dark = ui.visuals().dark_mode;
    let ink = closeup::ink(dark);
    let painter = ui.painter().with_clip_rect(rect);
    let report = &compared.report;
    let mm = |v: Option<f64>| v.map_or_else(|| "–".into(), |v| format!("{v:.1}"));
    let both = [("grew", look.grow, &report.growth), ("shrank", look.shrink, &report.recession)];
    let mut lines: Vec<(Option<[u8; 3]>, String)> = both
        .into_iter()
        .map(|(words, color, lengths)| {
            let text = format!(
                "{words} 0 to {:.1} mm: {} voxels, median {}, 95 % {}, most {} mm",
                look.full_mm,
                lengths.count,
                mm(lengths.p50_mm),
                mm(lengths.p95_mm),
                mm(lengths.max_mm)
            );
            (Some(color), text)
        })
        .collect();
    let sure =
        format!("{} of {} within uncertainty (drawn faint)", report.within_uncertainty, report.vectors);
    lines.push((None, sure));
    lines.extend(report.flags.iter().filter_map(|flag| Some((None, flag_text(*flag)?.to_owned()))));
    if view.doc.edit.change.style == ChangeStyle::Arrows {
        lines.push((None, format!("arrows of {:.1} mm and more", look.threshold_mm)));
    }
    let font = FontId::proportional(12.0);
    let galleys: Vec<_> = lines
        .into_iter()
        .map(|(color, text)| (color, painter.layout_no_wrap(text, font.clone(), ink)))
        .collect();
    let inset = |color: Option<[u8; 3]>| if color.is_some() { 52.0 } else { 0.0 };
    let width = galleys.iter().map(|(color, g)| g.size().x + inset(*color)).fold(0.0, f32::max);
    let corner = rect.left_top() + vec2(10.0, 8.0);
    let height = galleys.len() as f32 * LINE_POINTS;
    closeup::plate(&painter, Rect::from_min_size(corner, vec2(width, height)), dark);
    for (row, (color, galley)) in galleys.into_iter().enumerate() {
        let at = corner + vec2(0.0, row as f32 * LINE_POINTS);
        if let Some(color) = color {
            ramp(&painter, at + vec2(0.0, 2.0), color);
        }
        painter.galley(at + vec2(inset(color), 0.0), galley, ink);
    }
}

/// From the unchanged surface's colour to the full one.
fn ramp(painter: &egui::Painter, at: egui::Pos2, [r, g, b]: [u8; 3]) {
    let [from_r, from_g, from_b] = ChangeLook::BASE.map(f32::from);
    for step in 0..23_u8 {
        let share = f32::from(step) / 22.0;
        let mix = |from: f32, to: u8| (from + (f32::from(to) - from) * share) as u8;
        let piece = Rect::from_min_size(at + vec2(f32::from(step) * 2.0, 0.0), vec2(2.0, 11.0));
        painter.rect_filled(piece, 0.0, Color32::from_rgb(mix(from_r, r), mix(from_g, g), mix(from_b, b)));
    }
}

/// A flag in words; `None` for one that the numbers already tell.
fn flag_text(flag: Flag) -> Option<&'static str> {
    Some(match flag {
        Flag::NoChange => "no change: the masks are identical",
        Flag::InsideOnly => "they differ inside only: no outer surface moved",
        Flag::FromEmpty => "nothing at the earlier date",
        Flag::ToEmpty => "nothing at the later date",
        Flag::NoOverlap => "the two dates share no voxel: no arrows",
        Flag::Vanished => "a component vanished: it has no arrows",
        Flag::Appeared => "a component appeared: it has no arrows",
        Flag::Split => "a component split",
        Flag::Merged => "components merged",
        Flag::Regrouped => "components regrouped",
        Flag::TouchesBorder => "a mask touches the image's border",
        Flag::NoSet => return None,
    })
}
