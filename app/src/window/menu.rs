//! The menu bar with the choices used most, and the welcome page.

use egui::{Button, ComboBox, Slider, Ui};
use glioscope_render::{
    AnatomicalView, Coloring, Palette, Preset, Projection, Shading,
    slices::{Convention, Overlay, Plane},
};

use crate::{
    commands::Command,
    document::{Light, Pane},
    layout,
    recent::Recent,
    rulers::RulerFormat,
    views::overlap::OverlapMode,
    window::open_command,
    workstation::Workstation,
};

/// One menu row for a command.
fn item(ui: &mut Ui, command: Command, enabled: bool, out: &mut Vec<Command>) {
    let keys = command.shortcut().map(|s| s.format(&egui::ModifierNames::NAMES, false)).unwrap_or_default();
    let button = Button::new(command.text()).shortcut_text(keys);
    let tooltip = command.tooltip();
    if ui.add_enabled(enabled, button).on_hover_text(tooltip).clicked() {
        out.push(command);
        ui.close();
    }
}

/// One menu row that is a choice among several.
fn choice(ui: &mut Ui, chosen: bool, command: Command, out: &mut Vec<Command>) {
    if ui.radio(chosen, command.text()).on_hover_text(command.tooltip()).clicked() {
        out.push(command);
        ui.close();
    }
}

/// One menu row that is on or off.
fn switch(ui: &mut Ui, on: bool, command: Command, out: &mut Vec<Command>) {
    let mut now = on;
    let text = command.text();
    if ui.checkbox(&mut now, text).on_hover_text(command.tooltip()).changed() {
        out.push(command);
        ui.close();
    }
}

/// Draws the menu bar.
pub fn bar(ui: &mut Ui, work: &Workstation, recent: &Recent, out: &mut Vec<Command>) {
    egui::MenuBar::new().ui(ui, |ui| {
        let open = work.doc.is_some();
        ui.menu_button("File", |ui| {
            item(ui, Command::OpenDialog, true, out);
            item(ui, Command::OpenSample, true, out);
            ui.menu_button("Recent cases", |ui| recent_list(ui, recent, out));
            ui.separator();
            item(ui, Command::SaveSession, open, out);
            item(ui, Command::SaveSessionAs, open, out);
            ui.separator();
            item(ui, Command::ExportMeasurements, open, out);
            item(ui, Command::ScreenshotWindow, true, out);
            ui.separator();
            item(ui, Command::Quit, true, out);
        });
        ui.menu_button("Edit", |ui| {
            item(ui, Command::Undo, work.history.can_undo(), out);
            item(ui, Command::Redo, work.history.can_redo(), out);
            ui.separator();
            item(ui, Command::ShowAllRegions, open, out);
            ui.separator();
            item(ui, Command::ShowPalette, true, out);
        });
        ui.menu_button("View", |ui| view_menu(ui, work, out));
        ui.menu_button("Tools", |ui| tools_menu(ui, work, out));
        ui.menu_button("Help", |ui| item(ui, Command::ShowAbout, true, out));
        ui.separator();
        if let Some(doc) = &work.doc {
            toolbar(ui, work, doc, out);
        }
    });
}

fn recent_list(ui: &mut Ui, recent: &Recent, out: &mut Vec<Command>) {
    if recent.paths().is_empty() {
        ui.weak("None yet");
        return;
    }
    for path in recent.paths() {
        if ui.button(path.display().to_string()).clicked() {
            out.push(open_command(path.clone()));
            ui.close();
        }
    }
    ui.separator();
    item(ui, Command::ClearRecent, true, out);
}

fn view_menu(ui: &mut Ui, work: &Workstation, out: &mut Vec<Command>) {
    item(ui, Command::ToggleDark, true, out);
    let Some(doc) = &work.doc else { return };
    ui.separator();
    let planes = Plane::ALL.map(Pane::Slice);
    for pane in Pane::NOT_SLICES.into_iter().chain(planes) {
        switch(ui, layout::contains(&doc.edit.layout, pane), Command::TogglePane(pane), out);
    }
    item(ui, Command::ResetLayout, true, out);
    ui.separator();
    ui.menu_button("Colours", |ui| {
        for palette in [Palette::Thesis, Palette::ColorBlindSafe] {
            choice(ui, doc.edit.palette == palette, Command::SetPalette(palette), out);
        }
        ui.separator();
        for coloring in [Coloring::Masks, Coloring::Agreement] {
            choice(ui, doc.edit.coloring == coloring, Command::SetColoring(coloring), out);
        }
    });
    ui.menu_button("Light and quality", |ui| light_menu(ui, &doc.edit.light, out));
    ui.menu_button("Slices", |ui| {
        for convention in [Convention::Radiological, Convention::Neurological] {
            choice(ui, doc.nav.convention == convention, Command::SetConvention(convention), out);
        }
        ui.separator();
        for overlay in [Overlay::Fill, Overlay::Outline, Overlay::Both] {
            choice(ui, doc.edit.overlay == overlay, Command::SetOverlay(overlay), out);
        }
        ui.separator();
        item(ui, Command::ResetSlices, true, out);
    });
    for mode in [OverlapMode::Regions, OverlapMode::WholeMasks] {
        choice(ui, doc.edit.overlap_mode == mode, Command::SetOverlapMode(mode), out);
    }
    switch(ui, doc.nav.follow_pointer, Command::ToggleFollowPointer, out);
    switch(ui, doc.nav.show_plane, Command::TogglePlane, out);
    if let Some(case) = work.world.case().filter(|case| !case.tracts.is_empty()) {
        ui.menu_button("Fibre tracts", |ui| {
            for tracts in &case.tracts {
                let shown = !doc.edit.hidden_tracts.contains(&tracts.id);
                switch(ui, shown, Command::ToggleTracts(tracts.id.clone()), out);
            }
            item(ui, Command::ToggleAllTracts, true, out);
        });
    }
    ui.separator();
    ui.menu_button("Look from", |ui| {
        for view in AnatomicalView::ALL {
            item(ui, Command::Look(view), true, out);
        }
    });
    item(ui, Command::ToggleProjection, true, out);
    item(ui, Command::FitTumor, true, out);
    item(ui, Command::FitLens, true, out);
}

/// How the 3D views find light, and how well.
fn light_menu(ui: &mut Ui, light: &Light, out: &mut Vec<Command>) {
    for shading in Shading::ALL {
        choice(ui, light.shading == shading, Command::SetShading(shading), out);
    }
    ui.separator();
    choice(ui, light.preset.is_none(), Command::SetPreset(None), out);
    for preset in Preset::ALL {
        choice(ui, light.preset == Some(preset), Command::SetPreset(Some(preset)), out);
    }
    ui.separator();
    let mut degrees = light.aperture_deg;
    let slider = Slider::new(&mut degrees, 0.0..=85.0).suffix("°").fixed_decimals(0).text("Aperture");
    let enabled = light.shading != Shading::ScreenSpace;
    if ui
        .add_enabled(enabled, slider)
        .on_hover_text("Wide: soft, subtle shadows. Narrow: hard ones")
        .changed()
    {
        out.push(Command::SetAperture(degrees));
    }
}

/// The lens and the ruler.
fn tools_menu(ui: &mut Ui, work: &Workstation, out: &mut Vec<Command>) {
    let Some(doc) = &work.doc else {
        ui.weak("Open a case first");
        return;
    };
    switch(ui, doc.edit.lens_on, Command::ToggleLens, out);
    item(ui, Command::LensToCursor, true, out);
    ui.separator();
    switch(ui, doc.nav.ruler_on, Command::ToggleRuler, out);
    for format in [RulerFormat::Csv, RulerFormat::Json] {
        item(ui, Command::ExportRulers(format), !doc.edit.rulers.is_empty(), out);
    }
}

fn toolbar(ui: &mut Ui, work: &Workstation, doc: &crate::document::Document, out: &mut Vec<Command>) {
    let Some(time_point) = work.world.time_point(doc) else { return };
    for (sign, command, enabled) in
        [("Undo", Command::Undo, work.history.can_undo()), ("Redo", Command::Redo, work.history.can_redo())]
    {
        let response = ui.add_enabled(enabled, Button::new(sign)).on_hover_text(command.tooltip());
        let text = command.text();
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, &text));
        if response.clicked() {
            out.push(command);
        }
    }
    if work.world.time_point_count() > 1 {
        let labels: Vec<&str> = work
            .world
            .case()
            .map(|c| c.time_points.iter().map(|t| t.label.as_str()).collect())
            .unwrap_or_default();
        let combo = ComboBox::from_id_salt("time").selected_text(time_point.label.as_str()).width(96.0);
        let response = combo.show_ui(ui, |ui| {
            for (at, label) in labels.iter().enumerate() {
                if ui.selectable_label(at == doc.nav.time, *label).clicked() {
                    out.push(Command::SetTime(at));
                }
            }
        });
        named(&response.response, "Date");
    }
    let context = doc.nav.context.as_deref().unwrap_or("no image");
    let combo = ComboBox::from_id_salt("context").selected_text(context).width(80.0);
    let response = combo.show_ui(ui, |ui| {
        for c in &time_point.contexts {
            if ui.selectable_label(doc.nav.context.as_ref() == Some(&c.id), &c.id).clicked() {
                out.push(Command::SetContext(Some(c.id.clone())));
            }
        }
        if ui.selectable_label(doc.nav.context.is_none(), "no image").clicked() {
            out.push(Command::SetContext(None));
        }
    });
    named(&response.response, "Image on the slices");
    if let Some((id, prepared)) = work.world.context(doc) {
        ui.menu_button("Window", |ui| {
            for preset in prepared.histogram().presets() {
                if ui.button(preset.name).clicked() {
                    out.push(Command::SetWindow(id.to_owned(), preset.window));
                    ui.close();
                }
            }
        });
    }
    ui.separator();
    let mut lens_on = doc.edit.lens_on;
    if ui.checkbox(&mut lens_on, "Lens").on_hover_text(Command::ToggleLens.tooltip()).changed() {
        out.push(Command::ToggleLens);
    }
    let mut radius_mm = doc.edit.lens.radius_mm;
    // Fixed decimals or a clamp would change a radius that only is shown.
    let slider = Slider::new(&mut radius_mm, 1.0..=150.0)
        .logarithmic(true)
        .suffix(" mm")
        .clamping(egui::SliderClamping::Edits)
        .custom_formatter(|mm, _| format!("{mm:.1}"));
    let response = ui.add_enabled(lens_on, slider);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, lens_on, "Lens radius"));
    if response.on_hover_text("Lens radius (drag the ring, or Alt and scroll over the closeup)").changed() {
        out.push(Command::SetLensRadius(radius_mm));
    }
    let ruler = ui.selectable_label(doc.nav.ruler_on, "Ruler");
    if ruler.on_hover_text(Command::ToggleRuler.tooltip()).clicked() {
        out.push(Command::ToggleRuler);
    }
    let perspective = doc.nav.camera.projection == Projection::Perspective;
    let text = if perspective { "Perspective" } else { "Orthographic" };
    if ui.button(text).on_hover_text(Command::ToggleProjection.tooltip()).clicked() {
        out.push(Command::ToggleProjection);
    }
    ui.separator();
    let mut opacity = doc.edit.overlay_opacity;
    ui.label("Masks on slices");
    ui.spacing_mut().slider_width = 60.0;
    let response = ui.add(Slider::new(&mut opacity, 0.0..=1.0).fixed_decimals(2));
    response
        .widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "Opacity of masks on slices"));
    if response.on_hover_text("Opacity of masks on slices").changed() {
        out.push(Command::SetOverlayOpacity(opacity));
    }
}

/// Names a choice for screen readers, who don't see what stands around it.
fn named(combo: &egui::Response, name: &str) {
    combo.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}

/// What is shown while no case is open.
pub fn welcome(ui: &mut Ui, loading: bool, recent: &Recent, out: &mut Vec<Command>) {
    ui.vertical_centered(|ui| {
        ui.add_space(ui.available_height() * 0.22);
        ui.heading("Glioscope");
        if loading {
            ui.label("Loading; the status line says how far.");
            return;
        }
        ui.label("Drop a folder, a manifest or a NIfTI file here, or");
        ui.add_space(8.0);
        for command in [Command::OpenDialog, Command::OpenSample] {
            if ui.button(command.text()).clicked() {
                out.push(command);
            }
        }
        if !recent.paths().is_empty() {
            ui.add_space(16.0);
            ui.label("Opened before:");
            for path in recent.paths() {
                if ui.link(path.display().to_string()).clicked() {
                    out.push(open_command(path.clone()));
                }
            }
        }
        ui.add_space(24.0);
        ui.weak(crate::about::NOTICE);
    });
}
