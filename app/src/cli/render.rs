//! `glioscope render`: draws one view into a PNG or an animation, and reports its plan and pass times.

use std::{collections::BTreeMap, path::Path};

use glioscope_core::{
    Progress,
    case::CaseTracts,
    check,
    files::Inputs,
    optics::{Camera, Projection},
};
use glioscope_render::{
    CloseupRenderer, Coloring, Gpu, Plan, Quality, RegionScene, View3d, closeup_plan,
    flat::{Convention, Window},
    image::MOST_CLIP_PLANES,
    light::{FrameError, expected_error},
    views::closeup::Closeup,
};
use serde_json::json;

use super::{
    arguments::RenderArguments,
    light,
    offscreen::{DrawReport, draw_report, gpu},
    parse::{LensArgument, TransferArgument, View},
    resolve, terminal, unused,
};
use crate::{
    command::Workstation,
    error::AppError,
    model::{
        ChangeSetting, Document, Edit, EllipsoidKind, FiberColor, FiberLook, OverlapMode, PaneId,
        transfer_file,
    },
    output,
    views::{closeup, view3d::screen::PassTimes},
    window::{film::Film, offscreen_app::OffscreenApp},
    world::World,
};

/// Refuses a name that isn't a picture's: a typing error must not replace a patient's image.
fn refuse_other_endings(path: &Path) -> Result<(), AppError> {
    match path.extension() {
        Some(ending) if !ending.eq_ignore_ascii_case("png") => Err(AppError::file(
            path,
            "another ending",
            "a picture's name, .png; .gif and .mp4 with --turntable or --play",
        )),
        _ => Ok(()),
    }
}

/// Applies the arguments to the document.
fn apply(arguments: &RenderArguments, work: &mut Workstation) -> Result<(), AppError> {
    let Workstation { doc: Some(doc), world, .. } = work else { return Ok(()) };
    if let (Some(label), Some(case)) = (&arguments.time, world.case()) {
        doc.nav.time = resolve::time_point_index(case, label)?;
    }
    let Some(time_point) = world.time_point(doc) else { return Ok(()) };
    let Document { edit, nav, .. } = doc;
    match arguments.lens {
        None => {}
        Some(LensArgument::Off) => edit.lens_on = false,
        Some(LensArgument::At(lens)) => {
            edit.lens = lens;
            nav.camera.focus_mm = lens.center_mm;
        }
    }
    if let Some(text) = &arguments.select {
        edit.selection.set(&time_point.regions, &resolve::selection(text, &time_point.regions)?);
    }
    if let Some([azimuth, elevation]) = arguments.camera {
        nav.camera.world_from_camera = Camera::orientation(azimuth, elevation);
    }
    if arguments.orthographic {
        nav.camera.projection = Projection::Orthographic;
    }
    nav.cursor_mm = arguments.cursor.unwrap_or(nav.cursor_mm);
    if let Some(id) = &arguments.image {
        nav.context = resolve::image(time_point, id)?;
    }
    if let (Some([low, high]), Some(id)) = (arguments.window, &nav.context) {
        edit.windows = BTreeMap::from([(id.clone(), Window { low, high })]);
    }
    if let Some(text) = &arguments.second {
        let (second, is_same_kind) = resolve::second(text, doc, world)?;
        let mut fusion = doc.edit.fusion.showing(Some(second), is_same_kind);
        fusion.mixing = arguments.mixing.unwrap_or(fusion.mixing);
        fusion.map = arguments.color_map.unwrap_or(fusion.map);
        if let Some(share) = arguments.mixing_share {
            (fusion.opacity, fusion.share) = (share as f32, share as f32);
        }
        fusion.in_context = arguments.second_in_context;
        doc.edit.fusion = fusion;
    }
    if let Some(of) = arguments.slice_axes {
        let found = || AppError::wrong("--slice-axes", "no axes", "an image, or a mask that is shown");
        doc.nav.slice_axes = world.slice_axes(doc, of).ok_or_else(found)?;
    }
    let Document { edit, nav, .. } = doc;
    if arguments.neurological {
        nav.convention = Convention::Neurological;
    }
    edit.overlay = arguments.overlay.unwrap_or(edit.overlay);
    edit.outline_patterns |= arguments.outline_patterns;
    edit.palette = arguments.palette.unwrap_or(edit.palette);
    if arguments.agreement {
        edit.coloring = Coloring::Agreement;
    }
    if arguments.whole_masks {
        edit.overlap_mode = OverlapMode::WholeMasks;
    }
    apply_3d(arguments, doc, world)
}

/// Applies the arguments of the 3D views: transfer function, clipping, ellipsoids, lighting, change and zoom.
fn apply_3d(arguments: &RenderArguments, doc: &mut Document, world: &World) -> Result<(), AppError> {
    if let (Some(wanted), Some((id, image))) = (&arguments.transfer, world.context(doc)) {
        let transfer = match wanted {
            TransferArgument::Preset(preset) => preset.transfer(image.histogram()),
            TransferArgument::File(path) => transfer_file::load(path)?,
        };
        let id = id.to_owned();
        doc.edit.transfers.insert(id, transfer);
    }
    let Document { edit, nav, .. } = doc;
    if arguments.clips.len() > MOST_CLIP_PLANES {
        let found = format!("{} planes", arguments.clips.len());
        return Err(AppError::wrong("--clip", found, format!("at most {MOST_CLIP_PLANES}")));
    }
    edit.clips.extend_from_slice(&arguments.clips);
    edit.light = light::light(&arguments.light, &edit.light);
    apply_fibers(arguments, edit, world)?;
    let look = &mut edit.ellipsoids;
    if arguments.moment {
        look.kind = EllipsoidKind::Moment;
    }
    look.opacity = arguments.ellipsoid_opacity.unwrap_or(look.opacity);
    look.smallest_ml = arguments.hide_below.unwrap_or(look.smallest_ml);
    nav.show_plane |= arguments.slice_plane;
    apply_change(arguments, &mut edit.change, world)?;
    if let Some(zoom) = arguments.zoom {
        nav.zooms = PaneId::all().map(|pane| (pane, zoom)).collect();
        nav.camera.height_mm /= zoom;
    }
    Ok(())
}

/// Applies the arguments of fibre tracts to all files.
fn apply_fibers(arguments: &RenderArguments, edit: &mut Edit, world: &World) -> Result<(), AppError> {
    let all = || world.case().into_iter().flat_map(|case| &case.tracts);
    let color = match arguments.fibre_colour.as_deref() {
        None => None,
        Some("plain") => Some(FiberColor::Plain),
        Some("direction") => Some(FiberColor::Direction),
        Some(name) if all().any(|tracts| tracts.tracts.scalar(name).is_some()) => {
            Some(FiberColor::Scalar(name.to_owned()))
        }
        Some(name) => {
            let own = all().flat_map(|tracts| tracts.tracts.scalars()).map(|scalar| scalar.name().to_owned());
            let mut names: Vec<String> =
                ["plain", "direction"].map(str::to_owned).into_iter().chain(own).collect();
            names.dedup();
            let expected = format!("one of {}", check::listed(&names, 20));
            return Err(AppError::wrong("--fibre-colour", name, expected));
        }
    };
    for CaseTracts { id, tracts } in all() {
        let mut look = edit.tract_look(id);
        if let Some(color) = &color {
            look = look.colored_by(color.clone());
        }
        if look.scalar(tracts).is_some() {
            look.range = arguments.fibre_range.or(look.range);
            look.map = arguments.fibre_map.unwrap_or(look.map);
        }
        look.radius_mm = arguments.fibre_radius.unwrap_or(look.radius_mm);
        look.smooth = arguments.fibre_smooth.or(look.smooth);
        edit.tract_looks.insert(id.clone(), look);
    }
    edit.tract_looks.retain(|_, look| *look != FiberLook::default());
    Ok(())
}

/// Applies the arguments of the comparison of two time points.
fn apply_change(
    arguments: &RenderArguments,
    setting: &mut ChangeSetting,
    world: &World,
) -> Result<(), AppError> {
    setting.style = arguments.style.unwrap_or(setting.style);
    setting.threshold_mm = arguments.threshold.unwrap_or(setting.threshold_mm);
    setting.full_mm = arguments.scale_mm.or(setting.full_mm);
    setting.outlines_earlier |= arguments.earlier_outline;
    setting.on_slices |= arguments.changed_rim;
    let Some(case) = world.case() else { return Ok(()) };
    let (of, from, to) = (arguments.of.as_deref(), arguments.from.as_deref(), arguments.to.as_deref());
    let compares = matches!(arguments.view, View::Pane(pane) if pane.row().needs_dates)
        || arguments.changed_rim
        || [of, from, to].iter().any(Option::is_some);
    let chosen_in_session = setting.dates.is_some() || setting.of.is_some();
    if chosen_in_session && [of, from, to].iter().all(Option::is_none) {
        return Ok(());
    }
    // A case with one time point is drawn without a comparison.
    if compares && case.time_points.len() > 1 {
        let choice = resolve::change(case, of, from, to)?;
        (setting.of, setting.dates) = (Some(choice.id), Some(choice.dates));
    }
    Ok(())
}

pub(super) fn run(arguments: &RenderArguments) -> Result<(), AppError> {
    let view = arguments.view;
    let needs_frame = arguments.out.is_some() || arguments.stats;
    if !needs_frame && !arguments.explain {
        return Err(AppError::arguments("no --out FILE", "where to write the picture"));
    }
    if let (Some(TransferArgument::File(transfer)), Some(out)) = (&arguments.transfer, &arguments.out) {
        Inputs::new([transfer.clone()]).refuse_as_output(out)?;
    }
    let read = arguments.case.read(true)?;
    let inputs = read.case.inputs.clone();
    // Before minutes of drawing.
    arguments.out.iter().try_for_each(|path| inputs.refuse_as_output(path))?;
    if arguments.animation.is_asked() {
        arguments
            .out
            .iter()
            .try_for_each(|path| arguments.animation.refuse(arguments.view, path, &read.case))?;
    } else {
        arguments.out.iter().try_for_each(|path| refuse_other_endings(path))?;
        arguments.animation.refuse_force()?;
    }
    let mut work = Workstation::with_opened(read.into());
    apply(arguments, &mut work)?;
    for option in unused::without_effect(arguments) {
        terminal::warning("option-unused", &format!("{option} changes nothing in this view."));
    }
    if let Some(choice) = work.doc.as_ref().map(|doc| doc.edit.light) {
        for option in unused::without_effect_on_light(&arguments.light, &choice) {
            let mode = choice.mode.name();
            terminal::warning("option-unused", &format!("{option} changes nothing with the light {mode}."));
        }
    }
    if let (Some(path), true) = (&arguments.out, arguments.animation.is_asked()) {
        return animate(arguments, work, path);
    }
    let is_closeup = view == View::Pane(PaneId::Closeup);
    let scene = closeup::scene_of(&work, arguments.dark).filter(|_| is_closeup);
    let quality = work.doc.as_ref().map(|doc| doc.edit.light.at_rest()).unwrap_or_default();
    // The closeup can be planned without a device; the scenes of the other 3D views need results, so they are planned
    // when drawn.
    let mut report = DrawReport {
        plan: scene.as_ref().map(|scene| closeup_plan(scene, &quality)),
        ..DrawReport::default()
    };
    let mut adapter = String::new();
    if needs_frame || !is_closeup {
        let gpu = gpu(arguments.software)?;
        adapter = gpu.describe();
        let rgba = match scene.filter(|_| arguments.plain) {
            Some(scene) => plain_closeup(&gpu, &scene, &quality, arguments, &mut report)?,
            None => {
                let mut app = OffscreenApp::new(work, &gpu, arguments.dark)?;
                let rgba = app.capture(view.pane(), arguments.size, arguments.scale as f32)?;
                if let Some(pane) = view.pane() {
                    report = draw_report(&mut app, pane, (arguments.stats, arguments.light_error))?;
                }
                terminal::notes(&app.comparison_warnings());
                rgba
            }
        };
        for warning in &report.warnings {
            terminal::warning("picture-coarser", warning);
        }
        if let Some(path) = &arguments.out {
            output::write_png(path, &inputs, arguments.size, &rgba)?;
        }
    }
    if let Some(plan) = report.plan.as_ref().filter(|_| arguments.explain) {
        terminal::print(&plan_text(plan))?;
    }
    if arguments.stats {
        print_stats(&adapter, arguments.size, &report)?;
    }
    Ok(())
}

/// Draws an animation of the view.
fn animate(arguments: &RenderArguments, work: Workstation, path: &Path) -> Result<(), AppError> {
    let (Some(doc), Some(pane)) = (work.doc, arguments.view.pane()) else { return Ok(()) };
    let film = Film {
        pane,
        size: arguments.size,
        scale: arguments.scale as f32,
        dark: arguments.dark,
        turn: arguments.animation.turntable,
        plays: arguments.animation.play,
        doc,
        world: work.world,
    };
    let software = arguments.software;
    let notes = terminal::with_progress(|progress| film.write(&gpu(software)?, path, progress))?;
    terminal::notes(&notes.comparison);
    for warning in &notes.pictures {
        terminal::warning("picture-coarser", warning);
    }
    Ok(())
}

/// Renders the closeup without legend, cube and scale bar.
fn plain_closeup(
    gpu: &Gpu,
    scene: &RegionScene,
    quality: &Quality,
    arguments: &RenderArguments,
    report: &mut DrawReport,
) -> Result<Vec<u8>, AppError> {
    let mut renderer = CloseupRenderer::new(gpu)?;
    // The first frame includes compilation and upload; the passes of the second are timed.
    for _ in 0..usize::from(arguments.stats) {
        renderer.render(gpu, scene, quality, arguments.size)?;
    }
    let frame = renderer.render(gpu, scene, quality, arguments.size)?;
    let rgba = frame.read_rgba(gpu)?;
    if arguments.light_error
        && let Some(sample) = Closeup::light_sample(frame, gpu, scene, quality)?
    {
        report.measured = Some(sample.measure(&Progress::new())?);
    }
    (report.warnings, report.notes) = (frame.warnings.clone(), frame.notes.clone());
    report.quality = Some(*quality);
    if arguments.stats {
        let passes = renderer.pass_times(gpu)?;
        report.times = Some(PassTimes { passes, source: renderer.time_source().describe() });
    }
    Ok(rgba)
}

/// A plan as text: one line per pass.
fn plan_text(plan: &Plan) -> String {
    let runs = plan.passes.iter().map(|pass| format!("runs     {}", pass.name()));
    let omitted = plan.omitted.iter().map(|(pass, reason)| format!("left out {}: {reason}", pass.name()));
    runs.chain(omitted).collect::<Vec<_>>().join("\n")
}

fn print_stats(adapter: &str, size: [u32; 2], report: &DrawReport) -> Result<(), AppError> {
    let passes: Vec<_> = report
        .times
        .iter()
        .flat_map(|t| &t.passes)
        .map(|(pass, ms)| json!({"name": pass.name(), "ms": ms}))
        .collect();
    let omitted: Vec<_> = report
        .plan
        .iter()
        .flat_map(|p| &p.omitted)
        .map(|(pass, reason)| json!({"name": pass.name(), "reason": reason}))
        .collect();
    let light = report.quality.map(|quality| {
        let error = expected_error(&quality)
            .map(|[surfaces, tissue]| json!({"surfaces": surfaces, "tissue": tissue}));
        let one = |found: FrameError| json!({"rms": found.rms, "uncertainty": found.rms_uncertainty, "pixels": found.pixels});
        let measured = report.measured.map(
            |found| json!({"surfaces": found.surfaces.map(one), "tissue": found.tissue.map(one)}),
        );
        let noise =
            report.standard_error.map(|error| json!({"surfaces": error.surfaces, "tissue": error.tissue}));
        json!({
            "mode": quality.lighting.mode,
            "expected_error": error,
            "measured_error": measured,
            "standard_error": noise,
            "notes": report.notes,
        })
    });
    terminal::print_json(&json!({
        "adapter": adapter,
        "size": size,
        "timed_by": report.times.as_ref().map(|t| t.source),
        "passes": passes,
        "omitted": omitted,
        "light": light,
        "warnings": report.warnings,
    }))
}
