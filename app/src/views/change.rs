//! The change view (thesis 7.3.4): where the surface of one mask grew, shrank or stayed between two time points, as a
//! height map or as arrows, within the image.

use egui::{Color32, ComboBox, Rect, Role, Sense, Ui, WidgetInfo, vec2};
use glam::DVec3;
use glioscope_core::change::{ChangeError, ChangeReport, Choice, Flag, GroupReport, Lengths, Tissue, ids_at};
use glioscope_render::{
    ChangeContext, ChangeLook, ChangePick, ChangeScene, ChangeStyle, MaskColors, Palette,
    views::change::Change,
};

use super::{
    draw,
    pane::{Input, Pane, Stage},
    ruler,
    view3d::{Canvas, Picked, ScreenReport, View, linked_camera, marks, ring},
};
use crate::{
    command::{Commands, EditCommand},
    format,
    model::{
        CHANGE_SCALE_MM, ChangeSetting, PaneId, REGISTRATION_MM, document::tumor_radius_mm,
        lesions::SMALLEST_ML,
    },
    theme::{self, LABEL_POINTS, Tokens},
    world::{
        comparison::Comparison,
        jobs::{Lookup, progress_text},
        self_check::{self, CheckLine},
        surroundings::{self, Looked},
    },
};

/// The pane of the change view.
#[derive(Default)]
pub struct ChangePane {
    /// Its 3D view.
    pub canvas: Canvas<Change>,
    /// Whether a worker looks at the tissue around what moved.
    is_looking: bool,
}

/// Colours of recession and growth.
pub fn colors_of(palette: Palette) -> ([u8; 3], [u8; 3]) {
    let [grow, shrink] = ChangeLook::pair(palette);
    (shrink, grow)
}

/// Colours of one mask at the two time points: only at the earlier one is recession, only at the later one growth.
pub fn pair_colors(palette: Palette) -> MaskColors {
    let (shrink, grow) = colors_of(palette);
    MaskColors::new(palette, &[Some(shrink), Some(grow)])
}

/// Most of a mask's name in the controls, points.
const NAME_WIDTH: f32 = 130.0;
/// Room for all controls in lines of the pane, points; with less some are in a menu.
const ONE_LINE: f32 = 700.0;
/// The end of a fixed colour scale before a comparison is known, millimetres.
const DEFAULT_SCALE_MM: f64 = 5.0;

/// The change in mm that is drawn in full colour: the user's choice, or the larger 95th percentile of growth and
/// recession, at least 1 mm.
fn full_change_mm(setting: &ChangeSetting, compared: &Comparison) -> f64 {
    let p95_mm = |l: &Lengths| l.p95_mm.unwrap_or(0.0);
    let report = &compared.report;
    setting.full_mm.unwrap_or_else(|| p95_mm(&report.growth).max(p95_mm(&report.recession)).max(1.0))
}

fn change_look(input: &Input<'_>, compared: &Comparison) -> ChangeLook {
    let setting = &input.doc.edit.change;
    let (shrink, grow) = colors_of(input.doc.edit.palette);
    ChangeLook {
        style: setting.style,
        full_mm: full_change_mm(setting, compared),
        smooth_mm: setting.smooth_mm,
        threshold_mm: setting.threshold_mm,
        grow,
        shrink,
        outlines_earlier: setting.outlines_earlier,
    }
}

/// Why there is no comparison, as the pane's message.
pub fn no_comparison_text(error: &ChangeError) -> String {
    match error {
        ChangeError::OneDate { .. } => "One date: nothing to compare with.".into(),
        ChangeError::NoCommonMask { .. } => "The two dates have no mask of the same name.".into(),
        ChangeError::UnknownOrder { .. } => {
            "The order of the dates isn't stated: choose the earlier and the later one in the dates pane."
                .into()
        }
        other => other.to_string(),
    }
}

impl Pane for ChangePane {
    fn show(&mut self, ui: &mut Ui, stage: &mut Stage<'_>, out: &mut Commands) {
        self.canvas.begin();
        let (input, ask) = (stage.input, stage.ask);
        let chosen = input.doc.edit.change.chosen(input.case);
        if let Some(chosen) = chosen.as_ref().ok().filter(|_| !input.is_picture) {
            let setting = &input.doc.edit.change;
            let known = stage.results.comparison.cached(input.case, setting);
            let scale_mm = known.map(|compared| full_change_mm(setting, compared));
            let checked = self_checked(ui, stage);
            ui.horizontal_wrapped(|ui| {
                controls(ui, &input, chosen, scale_mm, out);
                check_button(ui, &input, &checked, out);
            });
        }
        let setting = &input.doc.edit.change;
        let checked = stage.results.self_check.cached(input.case, setting).filter(|_| setting.self_check);
        let checked = checked.map(|report| self_check::lines(report)).unwrap_or_default();
        let rect = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        if let Err(error) = chosen {
            draw::message(ui, rect, &no_comparison_text(&error));
            return;
        }
        let Some(graphics) = stage.graphics else {
            draw::message(ui, rect, "No graphics adapter: the change view can't be drawn.");
            return;
        };
        let poll_interval = std::time::Duration::from_millis(100);
        let compared = match stage.results.comparison.get(input.case, &input.doc.edit.change, ask) {
            Some(Lookup::Ready(compared)) => compared.clone(),
            Some(Lookup::Working(progress)) => {
                draw::message(ui, rect, &progress_text(progress));
                ui.request_repaint_after(poll_interval);
                return;
            }
            Some(Lookup::Failed(error)) => {
                draw::message(ui, rect, &error.to_string());
                return;
            }
            None => return,
        };
        let (looked, tissue_line) = match stage.results.surroundings.get(input.case, &compared, ask) {
            Lookup::Ready(looked) => (Some(looked.clone()), surroundings::line(&looked.report)),
            Lookup::Working(progress) => {
                ui.request_repaint_after(poll_interval);
                (None, Some(CheckLine { text: progress_text(progress), marked: false }))
            }
            Lookup::Failed(error) => (None, Some(CheckLine { text: error.to_string(), marked: true })),
        };
        self.is_looking = looked.is_none() && tissue_line.as_ref().is_some_and(|line| !line.marked);
        let report = looked.as_ref().map_or(&compared.report, |looked| &looked.report);
        let lines: Vec<CheckLine> =
            displaced_lines(report).into_iter().chain(tissue_line).chain(checked).collect();
        let volume = match stage.results.image.volume(input.context, ask) {
            Some(Lookup::Ready(volume)) => Some(volume.clone()),
            Some(Lookup::Working(_)) => {
                ui.request_repaint_after(poll_interval);
                None
            }
            _ => None,
        };
        let nav = &input.doc.nav;
        let (focus_mm, radius_mm) = (input.doc.edit.lens.center_mm, tumor_radius_mm(input.time_point));
        let camera = linked_camera(&nav.camera, focus_mm, radius_mm, nav.zoom(PaneId::Change));
        let mut scene = ChangeScene {
            surface: looked.as_ref().and_then(|looked| looked.surface.clone()).or(compared.surface.clone()),
            look: change_look(&input, &compared),
            base: ChangeLook::BASE,
            context: ChangeContext {
                volume,
                transfer: stage.results.image.transfer(input.doc, input.context),
                clip: input.doc.edit.clips.clone(),
            },
            camera,
            background: Tokens::in_ui(ui).viewport_rgb(),
            silhouette: [0, 0, 0],
        };
        let mut view = View { doc: input.doc, pane: PaneId::Change, camera, rect };
        let outcome = self.canvas.handle_mouse(ui, graphics, &mut view, &response, out);
        scene.camera = view.camera;
        if !self.canvas.draw(ui, (graphics, &view, &response), &scene, ask.wait, out) {
            return;
        }
        let hover_text = self.canvas.hover().map(|pick| pick_text(&compared, looked.as_deref(), pick));
        partner_line(ui, &view, self.canvas.hover());
        ruler::draw_3d(&ui.painter().with_clip_rect(rect), input.doc, &view.camera, rect, None);
        let has_displaced = scene.surface.as_ref().is_some_and(|surface| surface.has_displaced());
        legend(ui, &input, rect, (&compared, &lines, has_displaced), &scene.look);
        marks::corners(ui, rect, input.sides_known(), (&view.camera, "at the middle"), true);
        self.canvas.draw_overlays(ui, &view, &response, &outcome, hover_text.as_deref());
        response.widget_info(|| {
            let [from, to] = &compared.labels;
            let mask = input.doc.edit.masks.name(&compared.report.mask);
            let lines: String = lines.iter().map(|line| format!("; {}", line.text)).collect();
            let what = format!("Change of {mask} from {from} to {to}{lines}");
            WidgetInfo::labeled(Role::Canvas, true, self.canvas.accessible_text(&what, hover_text.as_deref()))
        });
    }

    fn ready(&self) -> bool {
        self.canvas.refined() && !self.is_looking
    }

    fn screen(&mut self) -> Option<&mut dyn ScreenReport> {
        Some(&mut self.canvas.screen)
    }
}

impl Picked for ChangePick {
    fn world_mm(&self) -> DVec3 {
        self.world_mm
    }
}

/// The unfiltered change under the pointer, with its uncertainty and flags.
pub fn pick_text(compared: &Comparison, looked: Option<&Looked>, pick: &ChangePick) -> String {
    let [from, to] = &compared.labels;
    match (&pick.vector, pick.unpartnered) {
        (Some(v), _) => {
            let verb = if v.signed_mm > 0.0 { "grew" } else { "shrank" };
            let uncertain = if v.flags.within_uncertainty { ", within uncertainty" } else { "" };
            let fallback = if v.flags.no_set { "\npartner: nearest surface" } else { "" };
            let tissue = match looked.and_then(|looked| looked.tissue(compared, v)) {
                Some(Tissue::Moved) if v.signed_mm > 0.0 => "\ndisplaced, not grown? The tissue moved too",
                Some(Tissue::Moved) => "\ndisplaced, not shrunk? The tissue moved too",
                Some(Tissue::Unknown) => "\ndisplaced or not can't be told: no texture here",
                Some(Tissue::Stayed | Tissue::Within) | None => "",
            };
            format!(
                "{verb} {:.1} mm{uncertain} (± {:.1} mm)\nnearest surface {:.1} mm{fallback}{tissue}",
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

/// The line from the surface point under the pointer to its partner.
fn partner_line(ui: &Ui, view: &View<'_>, hover: Option<&ChangePick>) {
    let Some(v) = hover.and_then(|pick| pick.vector.as_ref()) else { return };
    let ends = [v.from_mm, v.to_mm].map(|mm| ring::pos_of(&view.camera, view.rect, mm));
    if let [Some(from), Some(to)] = ends {
        let painter = ui.painter().with_clip_rect(view.rect);
        ruler::line(&painter, [from, to], ruler::Look::Solid, "");
    }
}

/// How far the check on this case is.
enum Checked {
    /// Not asked for.
    No,
    /// A worker is at it: how far.
    Working(String),
    /// Done.
    Done,
    /// Why it can't be done.
    Failed(String),
}

/// Starts the check on this case where it is asked for, and ends one that isn't any more.
fn self_checked(ui: &Ui, stage: &mut Stage<'_>) -> Checked {
    let setting = &stage.input.doc.edit.change;
    if !setting.self_check {
        stage.results.self_check.stop();
        return Checked::No;
    }
    match stage.results.self_check.get(stage.input.case, setting, stage.ask) {
        Some(Lookup::Ready(_)) => Checked::Done,
        Some(Lookup::Working(progress)) => {
            ui.request_repaint_after(std::time::Duration::from_millis(250));
            Checked::Working(progress_text(progress))
        }
        Some(Lookup::Failed(error)) => Checked::Failed(error.to_string()),
        None => Checked::No,
    }
}

/// The button that starts the check on this case, stops it, or hides what it found.
fn check_button(ui: &mut Ui, input: &Input<'_>, checked: &Checked, out: &mut Commands) {
    let (text, tip) = match checked {
        Checked::No => (
            "Check on this case",
            "Puts known changes into the earlier date and tells what share of them is measured: up to a minute",
        ),
        Checked::Working(_) => ("Stop the check", "Ends the check on this case"),
        Checked::Done | Checked::Failed(_) => {
            ("Hide the check", "Takes what the check found out of this view")
        }
    };
    if ui.button(text).on_hover_text(tip).clicked() {
        let setting = input.doc.edit.change.clone();
        let self_check = matches!(checked, Checked::No);
        out.push(EditCommand::SetChange(Box::new(ChangeSetting { self_check, ..setting })));
    }
    match checked {
        Checked::Working(text) | Checked::Failed(text) => {
            ui.label(text);
        }
        Checked::No | Checked::Done => {}
    }
}

/// `scale_mm`: the end of the colour scale as drawn, if it is known.
fn controls(ui: &mut Ui, input: &Input<'_>, chosen: &Choice, scale_mm: Option<f64>, out: &mut Commands) {
    let setting = &input.doc.edit.change;
    let mut new = setting.clone();
    ui.add_space(4.0);
    let (ids, masks) = (ids_at(input.case, chosen.dates), &input.doc.edit.masks);
    let combo = ComboBox::from_id_salt("compared mask").selected_text(masks.name(&chosen.id)).width(70.0);
    // A long name doesn't push the rest to other lines.
    let response = ui.allocate_ui(vec2(NAME_WIDTH, ui.spacing().interact_size.y), |ui| {
        combo.truncate().show_ui(ui, |ui| {
            for id in ids {
                if ui.selectable_label(chosen.id == id, masks.name(id)).clicked() {
                    new.of = Some(id.to_owned());
                }
            }
        })
    });
    let response = response.inner.response.on_hover_text(masks.name(&chosen.id));
    response.widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, "Mask to compare"));
    let [from, to] = chosen.dates.map(|d| input.case.time_points[d].label.as_str());
    ui.label(format!("{from} to {to}"));
    for (style, text, tip) in [
        (ChangeStyle::Height, "Height map", "Colour where the surface moved, smoothed over the picture"),
        (ChangeStyle::Arrows, "Arrows", "An arrow from where the surface was to where it is"),
    ] {
        if ui.selectable_label(setting.style == style, text).on_hover_text(tip).clicked() {
            new.style = style;
        }
    }
    if ui.max_rect().width() >= ONE_LINE {
        measures(ui, input, &mut new, scale_mm);
    } else {
        let menu = egui::containers::menu::MenuButton::new("Measures").config(stays_open());
        let (button, _) = menu.ui(ui, |ui| {
            ui.set_max_width(180.0);
            measures(ui, input, &mut new, scale_mm);
        });
        button.on_hover_text("Smoothing, scale, uncertainty of the registration, small components");
    }
    ui.checkbox(&mut new.outlines_earlier, "earlier outline")
        .on_hover_text("A blue line around what the earlier date shows, drawn over everything");
    ui.checkbox(&mut new.on_slices, "on slices").on_hover_text("Slices show both outlines and what changed");
    if new != *setting {
        out.push(EditCommand::SetChange(Box::new(new)));
    }
}

/// A menu that a click into it leaves open.
fn stays_open() -> egui::containers::menu::MenuConfig {
    egui::containers::menu::MenuConfig::new().close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside)
}

/// How change is measured and coloured.
fn measures(ui: &mut Ui, input: &Input<'_>, new: &mut ChangeSetting, scale_mm: Option<f64>) {
    let (value, prefix, name, tip, max_mm) = match new.style {
        ChangeStyle::Height => (
            &mut new.smooth_mm,
            "smooth ",
            "Smoothing of the height map",
            "Width of the Gauss filter; the readout at the pointer stays unfiltered",
            5.0,
        ),
        ChangeStyle::Arrows => {
            (&mut new.threshold_mm, "from ", "Shortest arrow", "Shorter arrows are left out", 50.0)
        }
    };
    let drag = egui::DragValue::new(value).range(0.0..=max_mm).speed(0.05).fixed_decimals(1).suffix(" mm");
    let response = ui.add(drag.prefix(prefix));
    response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, name));
    response.on_hover_text(tip);
    let mut is_fixed = new.full_mm.is_some();
    let tip =
        "The same colours for the same change in every comparison; otherwise they end at its 95th percentile";
    if ui.checkbox(&mut is_fixed, "fixed scale").on_hover_text(tip).changed() {
        new.full_mm = is_fixed.then(|| scale_mm.map_or(DEFAULT_SCALE_MM, |mm| (10.0 * mm).round() / 10.0));
    }
    if let Some(mm) = &mut new.full_mm {
        let drag = egui::DragValue::new(mm).range(CHANGE_SCALE_MM).speed(0.1).fixed_decimals(1).suffix(" mm");
        let response = ui.add(drag.prefix("± "));
        response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "End of the colour scale"));
    }
    let measured = input.compared.map(|compared| compared.report.uncertainty_mm);
    if let Some(measured) = measured.filter(|measured| measured.registration_from == "consistency") {
        let text = format!("registration ± {:.2} mm", measured.registration_mm);
        ui.label(text)
            .on_hover_text("From the consistency of the registration that was run (standard deviation)");
    } else {
        let drag =
            egui::DragValue::new(&mut new.registration_mm).range(REGISTRATION_MM).speed(0.02).suffix(" mm");
        let response = ui.add(drag.prefix("registration ± "));
        response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Registration error"));
        response.on_hover_text("How far off the two dates may lie from one another (standard deviation)");
    }
    let drag = egui::DragValue::new(&mut new.smallest_ml).range(SMALLEST_ML).speed(0.01).suffix(" ml");
    let response = ui.add(drag.prefix("small below "));
    response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Small components"));
    response.on_hover_text("Smaller components make neither appeared, vanished, split nor merged");
}

/// Colour ramps with their range and statistics, the flags, and more lines: what was displaced, what the check on this case found.
fn legend(
    ui: &Ui,
    input: &Input<'_>,
    rect: Rect,
    (compared, more, has_displaced): (&Comparison, &[CheckLine], bool),
    look: &ChangeLook,
) {
    let dark = ui.visuals().dark_mode;
    let ink = Tokens::of(dark).text;
    let painter = ui.painter().with_clip_rect(rect);
    let report = &compared.report;
    let axes_mm = report.uncertainty_mm.axes_mm;
    let [least_mm, most_mm] =
        [axes_mm.into_iter().fold(f64::INFINITY, f64::min), axes_mm.into_iter().fold(0.0, f64::max)];
    let mm = |v: Option<f64>| v.map_or_else(|| "–".into(), |v| format!("{v:.1}"));
    let directions = [("grew", look.grow, &report.growth), ("shrank", look.shrink, &report.recession)];
    let mut lines: Vec<(Option<[u8; 3]>, String)> = directions
        .into_iter()
        .map(|(verb, color, lengths)| {
            if lengths.count == 0 {
                return (Some(color), format!("{verb}: nowhere"));
            }
            let text = format!(
                "{verb}: median {}, 95 % {}, most {} mm, at {} voxels",
                mm(lengths.p50_mm),
                mm(lengths.p95_mm),
                mm(lengths.max_mm),
                format::count(lengths.count as u64),
            );
            (Some(color), text)
        })
        .collect();
    let uncertain = format!(
        "faint: less than can be told, ± {} mm: {} of {} voxels",
        if most_mm - least_mm < 0.05 {
            format!("{least_mm:.1}")
        } else {
            format!("{least_mm:.1} to {most_mm:.1}")
        },
        format::count(report.within_uncertainty as u64),
        format::count(report.vectors as u64)
    );
    lines.push((None, uncertain));
    if has_displaced {
        lines.push((Some(ChangeLook::DISPLACED), "the tissue around moved too: displaced?".into()));
    }
    if report.has_volumes_only() {
        let [from, to] = [report.from_ml, report.to_ml].map(format::ml);
        lines = vec![(None, format!("{from} at {}, {to} at {}", report.from, report.to))];
    }
    let cavities = &report.cavities;
    if cavities.from_ml > 0.0 || cavities.to_ml > 0.0 {
        let [from, to] = [cavities.from_ml, cavities.to_ml].map(format::ml);
        let walls = [("widened", cavities.widened), ("narrowed", cavities.narrowed)];
        let walls = walls.into_iter().filter(|(_, lengths)| lengths.count > 0);
        let walls: String =
            walls.map(|(verb, l)| format!(", {verb} by {} mm (median)", mm(l.p50_mm))).collect();
        lines.push((None, format!("cavities {from} to {to}{walls}: not among the vectors")));
    }
    lines.extend(report.flags.iter().filter_map(|flag| Some((None, flag_text(*flag)?.to_owned()))));
    if input.doc.edit.change.style == ChangeStyle::Arrows {
        lines.push((None, format!("arrows of {:.1} mm and more", look.threshold_mm)));
    }
    if look.outlines_earlier {
        lines.push((Some(ChangeLook::OUTLINE), format!("outline of {}", compared.labels[0])));
    }
    if input.is_picture {
        // What the controls say elsewhere.
        let [from, to] = &compared.labels;
        lines.insert(0, (None, format!("{}: {from} to {to}", input.doc.edit.masks.name(&report.mask))));
    }
    let font = theme::font(LABEL_POINTS);
    let amber = Tokens::of(dark).warning;
    let of_more = more.iter().map(|line| (None, line.text.clone(), if line.marked { amber } else { ink }));
    let lines: Vec<_> = lines.into_iter().map(|(color, text)| (color, text, ink)).chain(of_more).collect();
    let laid_out = |lines: Vec<LegendLine>| -> Vec<_> {
        let galley = |text, ink| painter.layout(text, font.clone(), ink, (rect.width() - 40.0).max(80.0));
        lines.into_iter().map(|(color, text, ink)| (color, galley(text, ink))).collect()
    };
    let inset = |color: Option<[u8; 3]>| if color.is_some() { 17.0 } else { 0.0 };
    let has_ramp = !report.has_volumes_only();
    let ramp_height = if has_ramp { 28.0 } else { 0.0 };
    let mut corner = rect.left_top() + vec2(10.0, 8.0);
    let plate_of = |galleys: &[(Option<[u8; 3]>, std::sync::Arc<egui::Galley>)]| {
        let width = galleys.iter().map(|(color, g)| g.size().x + inset(*color)).fold(0.0, f32::max);
        let height = galleys.iter().map(|(_, galley)| galley.size().y + 2.0).sum::<f32>();
        Rect::from_min_size(corner, vec2(width, height + ramp_height))
    };
    let short = shortened(&lines, (ink, amber));
    let mut galleys = laid_out(lines);
    // Below it would be what it is about: only what has a colour, until the pointer is there.
    if !input.is_picture && plate_of(&galleys).height() > MOST_LEGEND * rect.height() {
        let of_short = laid_out(short);
        if !ui.rect_contains_pointer(plate_of(&of_short)) {
            galleys = of_short;
        }
    }
    draw::plate(&painter, plate_of(&galleys), dark);
    if has_ramp {
        let most_mm = [report.recession.max_mm, report.growth.max_mm].map(|mm| mm.unwrap_or(0.0));
        corner.y += ramp(&painter, corner, look, (least_mm, most_mm), ink);
    }
    for (color, galley) in galleys {
        if let Some(color) = color {
            let swatch = Rect::from_min_size(corner + vec2(0.0, 2.0), vec2(11.0, 11.0));
            painter.rect_filled(swatch, 2.0, theme::color(color));
        }
        let line = galley.size().y + 2.0;
        painter.galley(corner + vec2(inset(color), 0.0), galley, ink);
        corner.y += line;
    }
}

/// The share of a pane's height above which its legend is shortened.
const MOST_LEGEND: f32 = 0.35;

/// A line of the legend: the colour of its swatch, its text and its ink.
type LegendLine = (Option<[u8; 3]>, String, Color32);

/// A legend's lines that have a colour; one, amber if any of the others is, says how many more there are.
fn shortened(lines: &[LegendLine], (ink, amber): (Color32, Color32)) -> Vec<LegendLine> {
    let (mut kept, others): (Vec<_>, Vec<_>) = lines.iter().cloned().partition(|(color, ..)| color.is_some());
    if !others.is_empty() {
        let is_marked = others.iter().any(|(_, _, ink)| *ink == amber);
        let text = format!("{} more: point here", others.len());
        kept.push((None, text, if is_marked { amber } else { ink }));
    }
    kept
}

/// Components named by the legend as displaced at most: the table of `change` has all.
const MOST_DISPLACED: usize = 4;

/// What is said of components that moved rather than grew: by their volumes where there are several. In amber, as it may take growth
/// back.
fn displaced_lines(report: &ChangeReport) -> Vec<CheckLine> {
    let counted = report.components.iter().filter(|group| !group.small).count();
    let of = |group: &GroupReport| {
        let volume_ml: f64 = group.to.iter().map(|part| part.volume_ml).sum();
        let named = move |text| {
            if counted > 1 { format!("{} component: {text}", format::ml(volume_ml)) } else { text }
        };
        format::displaced(group).into_iter().map(named)
    };
    let mut lines: Vec<String> = report.components.iter().flat_map(of).collect();
    if lines.len() > MOST_DISPLACED {
        let more = lines.split_off(MOST_DISPLACED).len();
        lines.push(format!("{more} more lines on displaced components: glioscope change lists them"));
    }
    lines.into_iter().map(|text| CheckLine { text, marked: true }).collect()
}

/// The ramp of change: shrinkage on the left, growth on the right, zero in the middle; the band within `uncertainty_mm`,
/// that of the most certain direction, is faint, as in the view. Below it the ends in millimetres; an end that `most_mm`
/// of shrinkage or growth exceeds says so. Returns its height.
fn ramp(
    painter: &egui::Painter,
    at: egui::Pos2,
    look: &ChangeLook,
    (uncertainty_mm, most_mm): (f64, [f64; 2]),
    ink: Color32,
) -> f32 {
    const HALF_STEPS: i32 = 60;
    let middle_x = at.x + HALF_STEPS as f32;
    let band = (uncertainty_mm / look.full_mm).clamp(0.0, 1.0);
    for step in -HALF_STEPS..=HALF_STEPS {
        let share = f64::from(step.abs()) / f64::from(HALF_STEPS);
        let opacity = if share <= band { share * f64::from(ChangeLook::FAINT) } else { share };
        let full = if step < 0 { look.shrink } else { look.grow };
        let color: [u8; 3] = std::array::from_fn(|i| {
            let (from, to) = (f64::from(ChangeLook::BASE[i]), f64::from(full[i]));
            (from + (to - from) * opacity) as u8
        });
        let left = middle_x + step as f32 - 0.5;
        painter.rect_filled(
            Rect::from_min_size(egui::pos2(left, at.y), vec2(1.5, 10.0)),
            0.0,
            theme::color(color),
        );
    }
    painter.vline(middle_x, at.y..=at.y + 13.0, egui::Stroke::new(1.0, ink));
    let text = |x: f32, anchor: egui::Align2, text: String| {
        painter.text(egui::pos2(x, at.y + 12.0), anchor, text, theme::font(LABEL_POINTS), ink)
    };
    let half = HALF_STEPS as f32;
    let exceeded = |mm: f64, sign: &'static str| if mm > look.full_mm { sign } else { "" };
    let (less, more) = (exceeded(most_mm[0], "≤ "), exceeded(most_mm[1], "≥ "));
    text(middle_x - half, egui::Align2::LEFT_TOP, format!("{less}−{:.1}", look.full_mm));
    text(middle_x, egui::Align2::CENTER_TOP, "0".into());
    text(middle_x + half, egui::Align2::RIGHT_TOP, format!("{more}{:.1} mm", look.full_mm));
    28.0
}

/// A flag as text; `None` where the statistics already show it.
fn flag_text(flag: Flag) -> Option<&'static str> {
    Some(match flag {
        Flag::NoChange => "no change: the masks are identical",
        Flag::InsideOnly => "they differ inside only: no outer surface moved",
        Flag::FromEmpty => "nothing at the earlier date",
        Flag::ToEmpty => "nothing at the later date",
        Flag::NoOverlap => "no overlap: not aligned? Only volumes are compared",
        Flag::NotAligned => "not aligned (Tools, Align dates and images): only volumes are compared",
        Flag::Vanished => "components vanished: no counterpart",
        Flag::Appeared => "components appeared: no counterpart",
        Flag::Split => "components split",
        Flag::Merged => "components merged",
        Flag::Regrouped => "components regrouped",
        Flag::TouchesBorder => "a mask touches the image's border",
        Flag::NoSet => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_legend_keeps_colours_and_says_that_a_warning_is_left_out() {
        let (ink, amber) = (Color32::WHITE, Color32::GOLD);
        let line = |color: Option<[u8; 3]>, text: &str, ink| (color, text.to_owned(), ink);
        let grew = line(Some([1, 2, 3]), "grew", ink);
        let plain = [grew.clone(), line(None, "faint", ink)];
        assert_eq!(shortened(&plain, (ink, amber)), [grew.clone(), line(None, "1 more: point here", ink)]);
        let marked =
            [plain.to_vec(), vec![line(None, "displaced?", amber), line(None, "checked", ink)]].concat();
        assert_eq!(shortened(&marked, (ink, amber)), [grew.clone(), line(None, "3 more: point here", amber)]);
        assert_eq!(shortened(std::slice::from_ref(&grew), (ink, amber)), [grew]);
    }
}
