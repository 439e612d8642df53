//! `glioscope render`: one view into a PNG, and what it took.

use std::collections::BTreeMap;

use glam::DVec3;
use glioscope_core::{Regions, Selection};
use glioscope_render::{
    AdapterPreference, Camera, ChangeStyle, ClipPlane, Coloring, Gpu, Palette, Plan, Preset, Projection,
    Quality, Renderer, SceneRenderer, TransferPreset,
    slices::{Convention, Overlay, Plane, Window},
};
use serde_json::json;

use super::{Failure, arguments::RenderArguments, light, terminal};
use crate::{
    comparing::{self, ChangeSetting},
    document::{Document, Pane},
    files,
    offscreen::Offscreen,
    recent::Recent,
    viewport::{PassTimes, Screen, Viewport},
    views::{ellipsoids::EllipsoidKind, overlap::OverlapMode, transfer},
    window::GlioscopeApp,
    workstation::Workstation,
    world::{Loaded, World},
};

/// What `--view` names.
#[derive(Clone, Copy, Debug, PartialEq)]
enum View {
    Pane(Pane),
    Window,
}

pub(super) fn wrong(option: &str, found: &str, expected: &str) -> Failure {
    Failure(format!("--{option}: found \"{found}\", expected {expected}"))
}

fn view(name: &str) -> Result<View, Failure> {
    Ok(match name {
        "closeup" => View::Pane(Pane::Closeup),
        "axial" => View::Pane(Pane::Slice(Plane::Axial)),
        "coronal" => View::Pane(Pane::Slice(Plane::Coronal)),
        "sagittal" => View::Pane(Pane::Slice(Plane::Sagittal)),
        "overlap" => View::Pane(Pane::Overlap),
        "context" => View::Pane(Pane::Context),
        "ellipsoids" => View::Pane(Pane::Ellipsoids),
        "change" => View::Pane(Pane::Change),
        "dates" => View::Pane(Pane::Dates),
        "transfer" => View::Pane(Pane::Transfer),
        "lens" => View::Pane(Pane::Lens),
        "measurements" => View::Pane(Pane::Measurements),
        "window" => View::Window,
        other => {
            let expected = "closeup, context, ellipsoids, change, dates, axial, coronal, sagittal, overlap, lens, \
                            measurements, transfer or window";
            return Err(wrong("view", other, expected));
        }
    })
}

/// `WIDTHxHEIGHT`, each from 16 to 8192.
pub(super) fn size(text: &str) -> Result<[u32; 2], Failure> {
    let expected = "WIDTHxHEIGHT, each from 16 to 8192";
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(|| wrong("size", text, expected))?;
    let side = |s: &str| s.trim().parse::<u32>().ok().filter(|n| (16..=8192).contains(n));
    match (side(width), side(height)) {
        (Some(width), Some(height)) => Ok([width, height]),
        _ => Err(wrong("size", text, expected)),
    }
}

fn numbers<const N: usize>(option: &str, text: &str, expected: &str) -> Result<[f64; N], Failure> {
    let parsed: Vec<f64> =
        text.split(',').filter_map(|s| s.trim().parse().ok()).filter(|n: &f64| n.is_finite()).collect();
    let count = text.split(',').count();
    match <[f64; N]>::try_from(parsed) {
        Ok(values) if count == N => Ok(values),
        _ => Err(wrong(option, text, expected)),
    }
}

/// The selection that `--select` names.
pub(super) fn selection(text: &str, regions: &Regions) -> Result<Selection, Failure> {
    match text {
        "all" => return Ok(Selection::all()),
        "none" => return Ok(Selection::only(regions, &[])),
        _ => {}
    }
    let ids = regions.mask_ids();
    let mut shown = Vec::new();
    for name in text.split(',') {
        let mut bits = 0_u32;
        for id in name.split('+') {
            let k = ids.iter().position(|known| known == id.trim());
            let k =
                k.ok_or_else(|| wrong("select", id, &format!("masks of the case: {}", ids.join(", "))))?;
            bits |= 1 << k;
        }
        shown.push(bits);
    }
    Ok(Selection::only(regions, &shown))
}

/// Puts what was typed into the document.
fn apply(arguments: &RenderArguments, work: &mut Workstation) -> Result<(), Failure> {
    let Workstation { doc: Some(doc), world, .. } = work else { return Ok(()) };
    if let Some(label) = &arguments.time {
        let labels: Vec<&str> = world
            .case()
            .map(|c| c.time_points.iter().map(|t| t.label.as_str()).collect())
            .unwrap_or_default();
        let time = labels.iter().position(|l| l == label);
        doc.nav.time = time.ok_or_else(|| wrong("time", label, &format!("one of {}", labels.join(", "))))?;
    }
    let Some(time_point) = world.time_point(doc) else { return Ok(()) };
    let Document { edit, nav, .. } = doc;
    if let Some(text) = &arguments.lens {
        if text == "off" {
            edit.lens_on = false;
        } else {
            let [x, y, z, radius_mm] = numbers("lens", text, "X,Y,Z,RADIUS in millimetres, or off")?;
            if radius_mm <= 0.0 {
                return Err(wrong("lens", text, "a radius above 0"));
            }
            edit.lens.center_mm = DVec3::new(x, y, z);
            edit.lens.radius_mm = radius_mm;
            nav.camera.focus_mm = edit.lens.center_mm;
        }
    }
    if let Some(text) = &arguments.select {
        edit.selection = selection(text, &time_point.regions)?;
    }
    if let Some(text) = &arguments.camera {
        let [azimuth, elevation] = numbers("camera", text, "AZIMUTH,ELEVATION in degrees")?;
        nav.camera.world_from_camera = Camera::orientation(azimuth, elevation);
    }
    if arguments.orthographic {
        nav.camera.projection = Projection::Orthographic;
    }
    if let Some(text) = &arguments.cursor {
        nav.cursor_mm = numbers("cursor", text, "X,Y,Z in millimetres")?.into();
    }
    if let Some(id) = &arguments.image {
        let ids: Vec<&str> = time_point.contexts.iter().map(|c| c.id.as_str()).collect();
        if id != "none" && !ids.contains(&id.as_str()) {
            return Err(wrong("image", id, &format!("none or one of {}", ids.join(", "))));
        }
        nav.context = (id != "none").then(|| id.clone());
    }
    if let (Some(text), Some(id)) = (&arguments.window, &nav.context) {
        let [low, high] = numbers("window", text, "LOW,HIGH")?;
        edit.windows = BTreeMap::from([(id.clone(), Window { low, high })]);
    }
    if arguments.neurological {
        nav.convention = Convention::Neurological;
    }
    edit.overlay = match arguments.overlay.as_deref() {
        None => edit.overlay,
        Some("fill") => Overlay::Fill,
        Some("outline") => Overlay::Outline,
        Some("both") => Overlay::Both,
        Some(other) => return Err(wrong("overlay", other, "fill, outline or both")),
    };
    if arguments.color_blind_safe {
        edit.palette = Palette::ColorBlindSafe;
    }
    if arguments.agreement {
        edit.coloring = Coloring::Agreement;
    }
    if arguments.whole_masks {
        edit.overlap_mode = OverlapMode::WholeMasks;
    }
    apply_3d(arguments, doc, world)
}

/// What was typed about the context view and the ellipsoid diagram.
fn apply_3d(arguments: &RenderArguments, doc: &mut Document, world: &World) -> Result<(), Failure> {
    if let Some(name) = &arguments.transfer {
        // As sessions write it, with hyphens.
        let spoken = |preset: &TransferPreset| {
            let written = serde_json::to_value(preset).ok();
            written.as_ref().and_then(|v| v.as_str()).unwrap_or_default().replace('_', "-")
        };
        let names: Vec<String> = TransferPreset::ALL.iter().map(spoken).collect();
        let preset = TransferPreset::ALL.into_iter().find(|preset| spoken(preset) == *name);
        let preset =
            preset.ok_or_else(|| wrong("transfer", name, &format!("one of {}", names.join(", "))))?;
        if let Some((id, image)) = world.context(doc) {
            let (id, transfer) = (id.to_owned(), preset.transfer(image.histogram()));
            doc.edit.transfers.insert(id, transfer);
        }
    }
    let Document { edit, nav, .. } = doc;
    for text in &arguments.clips {
        let expected = "SIDE=MM with right, left, front, back, top or bottom, at most 6";
        let (side, mm) = text.split_once('=').ok_or_else(|| wrong("clip", text, expected))?;
        let (_, normal) = transfer::SIDES
            .into_iter()
            .find(|(name, _)| *name == side)
            .filter(|_| edit.clips.len() < transfer::MOST_CLIPS)
            .ok_or_else(|| wrong("clip", text, expected))?;
        let [mm] = numbers("clip", mm, expected)?;
        edit.clips.push(ClipPlane { normal, offset_mm: mm * normal.element_sum() });
    }
    let range = |name, value: Option<f64>, (low, high): (f64, f64)| match value {
        Some(v) if !(low..=high).contains(&v) => {
            Err(wrong(name, &v.to_string(), &format!("{low} to {high}")))
        }
        found => Ok(found),
    };
    edit.light = light::light(&arguments.light)?;
    let look = &mut edit.ellipsoids;
    if arguments.moment {
        look.kind = EllipsoidKind::Moment;
    }
    look.opacity =
        range("ellipsoid-opacity", arguments.ellipsoid_opacity, (0.0, 1.0))?.unwrap_or(look.opacity);
    look.smallest_ml = range("hide-below", arguments.hide_below, (0.0, 1e6))?.unwrap_or(look.smallest_ml);
    nav.show_plane = arguments.slice_plane;
    apply_change(arguments, &mut edit.change, world)?;
    if let Some(zoom) = range("zoom", arguments.zoom, (0.05, 100.0))? {
        (nav.context_zoom, nav.ellipsoid_zoom, nav.change_zoom) = (zoom, zoom, zoom);
        nav.camera.height_mm /= zoom;
    }
    Ok(())
}

/// What was typed about two dates.
fn apply_change(
    arguments: &RenderArguments,
    setting: &mut ChangeSetting,
    world: &World,
) -> Result<(), Failure> {
    setting.style = match arguments.style.as_deref() {
        None => setting.style,
        Some("height") => ChangeStyle::Height,
        Some("arrows") => ChangeStyle::Arrows,
        Some(other) => return Err(wrong("style", other, "height or arrows")),
    };
    if let Some(mm) = arguments.threshold {
        if !(0.0..=1000.0).contains(&mm) {
            return Err(wrong("threshold", &mm.to_string(), "0 to 1000"));
        }
        setting.threshold_mm = mm;
    }
    setting.on_slices = arguments.changed_rim;
    let Some(case) = world.case() else { return Ok(()) };
    let labels: Vec<&str> = case.time_points.iter().map(|t| t.label.as_str()).collect();
    let at = |option: &str, label: &Option<String>, other: usize| match label {
        None => Ok(other),
        Some(label) => labels
            .iter()
            .position(|l| l == label)
            .ok_or_else(|| wrong(option, label, &format!("one of {}", labels.join(", ")))),
    };
    if arguments.from.is_some() || arguments.to.is_some() {
        let dates =
            [at("from", &arguments.from, 0)?, at("to", &arguments.to, labels.len().saturating_sub(1))?];
        if dates[0] >= dates[1] {
            let found = format!("{} to {}", labels[dates[0]], labels[dates[1]]);
            return Err(wrong("from", &found, "an earlier and a later date"));
        }
        setting.dates = Some(dates);
    }
    if let Some(id) = &arguments.of {
        let dates = setting.dates.unwrap_or([0, labels.len().saturating_sub(1)]);
        let ids = comparing::ids_at(case, dates);
        if !ids.contains(&id.as_str()) {
            return Err(wrong("of", id, &format!("a mask of both dates: {}", ids.join(", "))));
        }
        setting.of = Some(id.clone());
    }
    Ok(())
}

/// The adapter that pictures are drawn on.
pub(super) fn gpu(software: bool) -> Result<Gpu, Failure> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Gpu::headless(preference).map_err(|e| Failure(e.to_string()))
}

/// The quality of files, as the light asks for it.
fn quality(work: &Workstation) -> Quality {
    let light = work.doc.as_ref().map(|doc| doc.edit.light).unwrap_or_default();
    light.at(Quality::preset(light.shading, light.preset.unwrap_or(Preset::Reference)))
}

pub(super) fn run(arguments: &RenderArguments) -> Result<(), Failure> {
    let view = view(&arguments.view)?;
    let size = size(&arguments.size)?;
    if !(0.25..=8.0).contains(&arguments.scale) {
        return Err(wrong("scale", &arguments.scale.to_string(), "0.25 to 8"));
    }
    let (reference, case) = arguments.case.load(true)?;
    let mut work = Workstation::with_case(reference, Loaded::new(case));
    apply(arguments, &mut work)?;
    let scene = work.doc.as_ref().map(|doc| work.world.closeup(doc, arguments.dark));
    let is_closeup = view == View::Pane(Pane::Closeup);
    let draws = arguments.out.is_some() || arguments.stats;
    if !draws && !arguments.explain {
        return Err(Failure("arguments: found no --out FILE, expected where to write the picture".into()));
    }
    let mut drawn = Drawn { plan: None, times: None };
    if let Some(scene) = scene.as_ref().filter(|_| is_closeup) {
        // The closeup's plan needs no device.
        drawn.plan = Some(glioscope_render::plan(scene, &quality(&work)));
    }
    // The other 3D views' scenes hold results: they are planned when they are drawn.
    let draws = draws || matches!(view, View::Pane(Pane::Context | Pane::Ellipsoids | Pane::Change));
    let mut adapter = String::new();
    if draws {
        let gpu = gpu(arguments.software)?;
        adapter = gpu.describe();
        let rgba = if let (true, Some(scene), true) = (arguments.plain, &scene, is_closeup) {
            let mut renderer = Renderer::new(&gpu).map_err(|e| Failure(e.to_string()))?;
            let quality = quality(&work);
            // The first frame compiles and uploads; the second is the one whose passes are timed.
            for _ in 0..if arguments.stats { 2 } else { 1 } {
                renderer.render(&gpu, scene, &quality, size).map_err(|e| Failure(e.to_string()))?;
            }
            let passes = renderer.pass_times(&gpu).map_err(|e| Failure(e.to_string()))?;
            drawn.times = Some(PassTimes { passes, source: renderer.time_source().describe() });
            renderer
                .frame()
                .map(|f| f.read_rgba(&gpu))
                .transpose()
                .map_err(|e| Failure(e.to_string()))?
                .unwrap_or_default()
        } else {
            let mut studio = Studio::new(work, &gpu, arguments.dark)?;
            let rgba = studio.picture(view, size, arguments.scale)?;
            if let View::Pane(pane) = view {
                studio.say_drawn(pane, arguments.stats, &mut drawn);
            }
            rgba
        };
        if let Some(path) = &arguments.out {
            files::write_png(path, size, &rgba)?;
        }
    }
    let Drawn { plan, times } = drawn;
    if let Some(plan) = plan.as_ref().filter(|_| arguments.explain) {
        terminal::print(&explained(plan))?;
    }
    if arguments.stats {
        let passes: Vec<_> = times
            .iter()
            .flat_map(|t| &t.passes)
            .map(|(pass, ms)| json!({"name": pass.name(), "ms": ms}))
            .collect();
        let omitted: Vec<_> = plan
            .iter()
            .flat_map(|p| &p.omitted)
            .map(|(pass, reason)| json!({"name": pass.name(), "reason": reason}))
            .collect();
        terminal::print_json(&json!({
            "adapter": adapter,
            "size": size,
            "timed_by": times.as_ref().map(|t| t.source),
            "passes": passes,
            "omitted": omitted,
        }))?;
    }
    Ok(())
}

/// What drawing a 3D view took.
struct Drawn {
    plan: Option<Plan>,
    times: Option<PassTimes>,
}

/// A plan in words: a line a pass.
fn explained(plan: &Plan) -> String {
    let runs = plan.passes.iter().map(|pass| format!("runs     {}", pass.name()));
    let omitted = plan.omitted.iter().map(|(pass, reason)| format!("left out {}: {reason}", pass.name()));
    runs.chain(omitted).collect::<Vec<_>>().join("\n")
}

/// Draws views of one workstation without a window.
pub(super) struct Studio {
    offscreen: Offscreen,
    app: GlioscopeApp,
}

impl Studio {
    pub(super) fn new(work: Workstation, gpu: &Gpu, dark: bool) -> Result<Self, Failure> {
        let offscreen = Offscreen::new(gpu, dark);
        let viewport = Viewport::new(gpu.clone(), offscreen.renderer()).map_err(Failure)?;
        let app = GlioscopeApp::new(work, Some(viewport), Recent::default()).refined();
        Ok(Self { offscreen, app })
    }

    /// Plan and pass times of the 3D view that `pane` drew; nothing of other panes.
    fn say_drawn(&mut self, pane: Pane, timed: bool, drawn: &mut Drawn) {
        let Some(viewport) = self.app.viewport.as_mut() else { return };
        let Viewport { gpu, closeup, context, ellipsoids, change } = viewport;
        match pane {
            Pane::Closeup => say_screen(closeup, gpu, timed, drawn),
            Pane::Context => say_screen(context, gpu, timed, drawn),
            Pane::Ellipsoids => say_screen(ellipsoids, gpu, timed, drawn),
            Pane::Change => say_screen(change, gpu, timed, drawn),
            _ => {}
        }
    }

    fn picture(&mut self, view: View, size: [u32; 2], scale: f32) -> Result<Vec<u8>, Failure> {
        let Self { offscreen, app } = self;
        let rgba = offscreen.picture(size, scale, |ui| match view {
            View::Window => app.draw(ui),
            View::Pane(pane) => draw_pane(ui, app, pane),
        });
        rgba.map_err(Failure)
    }

    /// One pane, or the whole window.
    pub(super) fn pane(
        &mut self,
        pane: Option<Pane>,
        size: [u32; 2],
        scale: f32,
    ) -> Result<Vec<u8>, Failure> {
        self.picture(pane.map_or(View::Window, View::Pane), size, scale)
    }
}

fn draw_pane(ui: &mut egui::Ui, app: &mut GlioscopeApp, pane: Pane) {
    egui::CentralPanel::default()
        .frame(egui::Frame::new().fill(ui.visuals().panel_fill))
        .show(ui, |ui| app.one_pane(ui, pane));
}

fn say_screen<R: SceneRenderer>(screen: &mut Screen<R>, gpu: &Gpu, timed: bool, drawn: &mut Drawn) {
    drawn.plan = screen.plan().map(|(plan, _)| plan.clone());
    if timed {
        // A device that fails has said so when it drew.
        drawn.times = screen.pass_times(gpu).ok().cloned();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_numbers_are_checked() {
        assert_eq!(size("512x256").unwrap(), [512, 256]);
        for bad in ["512", "0x5", "512x", "9999x512", "axb"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert_eq!(numbers::<2>("camera", "-30, 20", "").unwrap(), [-30.0, 20.0]);
        for bad in ["1", "1,2,3", "1,x", "1,nan", "1,,2"] {
            assert!(numbers::<2>("camera", bad, "").is_err(), "{bad}");
        }
    }
}
