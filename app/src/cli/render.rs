//! `glioscope render`: one view into a PNG, and what it took.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use glioscope_core::{Regions, Selection};
use glioscope_render::{
    AdapterPreference, Camera, Coloring, Gpu, Palette, Plan, Projection, Quality, Renderer,
    slices::{Convention, Overlay, Plane, Window},
};
use serde_json::json;

use super::{Failure, arguments::RenderArguments, terminal};
use crate::{
    document::{Document, Pane},
    files,
    offscreen::Offscreen,
    panes::PaneArea,
    recent::Recent,
    viewport::{PassTimes, Viewport},
    views::{ViewContext, closeup::CloseupState, overlap::OverlapMode},
    window::GlioscopeApp,
    workstation::Workstation,
    world::Loaded,
};

/// What `--view` names.
#[derive(Clone, Copy, Debug, PartialEq)]
enum View {
    Pane(Pane),
    Window,
}

fn wrong(option: &str, found: &str, expected: &str) -> Failure {
    Failure(format!("--{option}: found \"{found}\", expected {expected}"))
}

fn view(name: &str) -> Result<View, Failure> {
    Ok(match name {
        "closeup" => View::Pane(Pane::Closeup),
        "axial" => View::Pane(Pane::Slice(Plane::Axial)),
        "coronal" => View::Pane(Pane::Slice(Plane::Coronal)),
        "sagittal" => View::Pane(Pane::Slice(Plane::Sagittal)),
        "overlap" => View::Pane(Pane::Overlap),
        "lens" => View::Pane(Pane::Lens),
        "measurements" => View::Pane(Pane::Measurements),
        "window" => View::Window,
        other => {
            let expected = "closeup, axial, coronal, sagittal, overlap, lens, measurements or window";
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
fn selection(text: &str, regions: &Regions) -> Result<Selection, Failure> {
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
    Ok(())
}

/// The adapter that pictures are drawn on.
pub(super) fn gpu(software: bool) -> Result<Gpu, Failure> {
    let preference = if software { AdapterPreference::SoftwareOnly } else { AdapterPreference::RealFirst };
    Gpu::headless(preference).map_err(|e| Failure(e.to_string()))
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
    if let Some(scene) = scene.as_ref().filter(|_| arguments.explain && is_closeup) {
        terminal::print(&explained(&glioscope_render::plan(scene, &Quality::FULL)))?;
    }
    if arguments.out.is_none() && !arguments.stats {
        return if arguments.explain {
            Ok(())
        } else {
            Err(Failure("arguments: found no --out FILE, expected where to write the picture".into()))
        };
    }
    let gpu = gpu(arguments.software)?;
    let mut stats = None;
    let rgba = if let (true, Some(scene), true) = (arguments.plain, &scene, is_closeup) {
        let mut renderer = Renderer::new(&gpu).map_err(|e| Failure(e.to_string()))?;
        // The first frame compiles and uploads; the second is the one whose passes are timed.
        for _ in 0..if arguments.stats { 2 } else { 1 } {
            renderer.render(&gpu, scene, &Quality::FULL, size).map_err(|e| Failure(e.to_string()))?;
        }
        let passes = renderer.pass_times(&gpu).map_err(|e| Failure(e.to_string()))?;
        stats = Some(PassTimes { passes, source: renderer.time_source().describe() });
        renderer
            .frame()
            .map(|f| f.read_rgba(&gpu))
            .transpose()
            .map_err(|e| Failure(e.to_string()))?
            .unwrap_or_default()
    } else {
        let mut studio = Studio::new(work, &gpu, arguments.dark)?;
        let rgba = studio.picture(view, size, arguments.scale)?;
        if is_closeup {
            stats = studio.pass_times();
        }
        rgba
    };
    if let Some(path) = &arguments.out {
        files::write_png(path, size, &rgba)?;
    }
    if arguments.stats {
        let plan = scene.as_ref().filter(|_| is_closeup).map(|s| glioscope_render::plan(s, &Quality::FULL));
        let passes: Vec<_> = stats
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
            "adapter": gpu.describe(),
            "size": size,
            "timed_by": stats.as_ref().map(|t| t.source),
            "passes": passes,
            "omitted": omitted,
        }))?;
    }
    Ok(())
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
    dark: bool,
}

impl Studio {
    pub(super) fn new(work: Workstation, gpu: &Gpu, dark: bool) -> Result<Self, Failure> {
        let offscreen = Offscreen::new(gpu, dark);
        let viewport = Viewport::new(gpu.clone(), offscreen.renderer()).map_err(Failure)?;
        let app = GlioscopeApp::new(work, Some(viewport), Recent::default()).refined();
        Ok(Self { offscreen, app, dark })
    }

    fn pass_times(&mut self) -> Option<PassTimes> {
        self.app.viewport.as_mut()?.pass_times().ok().cloned()
    }

    fn picture(&mut self, view: View, size: [u32; 2], scale: f32) -> Result<Vec<u8>, Failure> {
        let Self { offscreen, app, dark } = self;
        let rgba = offscreen.picture(size, scale, |ui| match view {
            View::Window => app.draw(ui),
            View::Pane(pane) => draw_pane(ui, app, pane, *dark),
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

fn draw_pane(ui: &mut egui::Ui, app: &mut GlioscopeApp, pane: Pane, dark: bool) {
    let Workstation { doc: Some(doc), world, .. } = &app.work else { return };
    let (Some(case), Some(time_point)) = (world.case(), world.time_point(doc)) else { return };
    let colors = world.colors(doc);
    let scene = world.closeup(doc, dark);
    let mut out = Vec::new();
    let mut closeup = CloseupState::default();
    let mut area = PaneArea {
        view: ViewContext { doc, case, time_point, colors: &colors, context: world.context(doc) },
        scene: &scene,
        viewport: app.viewport.as_mut(),
        closeup: &mut closeup,
        refine_at_once: true,
        rects: HashMap::new(),
        out: &mut out,
    };
    egui::CentralPanel::default()
        .frame(egui::Frame::new().fill(ui.visuals().panel_fill))
        .show(ui, |ui| area.pane(ui, pane));
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
