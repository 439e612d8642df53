//! The menu bar with the toolbar, and the welcome page.

use egui::{
    Button, ComboBox, DragValue, PopupCloseBehavior, Slider, SliderClamping, Ui,
    containers::menu::{MenuConfig, SubMenuButton},
};
use glioscope_core::{files::format::volume_names, optics::Projection};
use glioscope_render::{KnobRow, Lamp, LampFrame, LightSettings, Quality, light};

use super::{
    about,
    dialogs::open_command,
    fusion,
    label::label_for_screen_readers,
    modal,
    preferences::{MOST_LAYOUT_NAME, Preferences},
    recent::Recent,
};
use crate::{
    command::{
        AppCommand, Command, Commands, EditCommand, LookCommand, Menu, Workstation, listed, menu::Entry,
    },
    model::{Document, LightChoice, PictureSize, Shading, fusion::is_pet, picture::MAX_WIDTH_PX},
    views::{context::tract_look, draw},
};

/// Width proposed for pictures: a text column of 8.5 cm in print at 600 dots per inch.
const DEFAULT_WIDTH_PX: u32 = 2008;
/// Above and below the entries of a menu that is as high as the window, together, points: its frame and a gap.
const MENU_MARGIN: f32 = 28.0;

/// Input of the menus.
struct Bar<'a> {
    work: &'a Workstation,
    recent: &'a Recent,
    preferences: &'a Preferences,
    /// Commands that go to regions and components.
    places: &'a [(String, Command)],
}

/// Draws the menu bar.
pub fn bar(
    ui: &mut Ui,
    work: &Workstation,
    recent: &Recent,
    preferences: &Preferences,
    places: &[(String, Command)],
    out: &mut Commands,
) {
    let bar = Bar { work, recent, preferences, places };
    egui::MenuBar::new().ui(ui, |ui| {
        // In a narrow window the toolbar goes on in another line.
        ui.horizontal_wrapped(|ui| {
            for menu in Menu::BAR {
                ui.menu_button(menu.title(), |ui| bar.menu(ui, menu, out));
            }
            ui.separator();
            if let Some(doc) = work.doc.as_ref().filter(|_| work.cohort_in_front().is_none()) {
                toolbar(ui, work, doc, out);
            }
        });
    });
}

impl Bar<'_> {
    /// The commands and menus within `menu`, group by group.
    fn menu(&self, ui: &mut Ui, menu: Menu, out: &mut Commands) {
        let needs_case = [Menu::Tools, Menu::Light].contains(&menu);
        if needs_case && self.work.doc.is_none() {
            ui.weak("Open a case first");
            return;
        }
        if menu == Menu::Recent {
            self.recent_cases(ui, out);
        }
        let groups = menu.groups();
        for (index, group) in groups.iter().enumerate() {
            if index > 0 {
                ui.separator();
            }
            for inner in menu.inner(*group).filter(|inner| self.shows(*inner)) {
                // A field in a menu is clicked to type in it; entries close the menu themselves.
                let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
                SubMenuButton::new(inner.title()).config(config).ui(ui, |ui| {
                    if inner == Menu::Light {
                        scrolling(ui, |ui| self.menu(ui, inner, out));
                    } else {
                        self.menu(ui, inner, out);
                    }
                });
            }
            let commands = listed().iter().filter(|listed| listed.menu == Some((menu, *group)));
            for listed in commands.filter(|listed| menu != Menu::View || self.shows_in_view(&listed.command))
            {
                entry(ui, self.work, &listed.command, out);
            }
        }
        match menu {
            Menu::Tracts => self.tracts(ui, out),
            Menu::GoTo => self.places(ui, out),
            Menu::Layouts => self.own_layouts(ui, out),
            Menu::Light => self.light(ui, out),
            Menu::Pictures => self.picture_width(ui, out),
            _ => {}
        }
    }

    /// Whether a menu has anything to offer.
    fn shows(&self, menu: Menu) -> bool {
        match menu {
            Menu::Recent | Menu::Pictures => true,
            Menu::Tracts => self.work.world.case().is_some_and(|case| !case.tracts.is_empty()),
            _ => self.work.doc.is_some(),
        }
    }

    /// Without a case, the View menu has only the commands of the program itself.
    fn shows_in_view(&self, command: &Command) -> bool {
        self.work.doc.is_some() || matches!(command, Command::App(_))
    }

    fn recent_cases(&self, ui: &mut Ui, out: &mut Commands) {
        if self.recent.paths().is_empty() {
            ui.weak("None yet");
        }
        for path in self.recent.paths() {
            if ui.button(path.display().to_string()).clicked() {
                out.push(open_command(path.clone()));
                ui.close();
            }
        }
        ui.separator();
    }

    /// The user's own layouts, and a field that keeps the one shown.
    fn own_layouts(&self, ui: &mut Ui, out: &mut Commands) {
        ui.separator();
        for (name, layout) in self.preferences.layouts() {
            ui.horizontal(|ui| {
                if ui.button(name).on_hover_text("Your own layout").clicked() {
                    out.push(EditCommand::UseLayout(name.to_owned(), Box::new(layout)));
                    ui.close();
                }
                let forget = ui.small_button("×").on_hover_text("Forget this layout");
                draw::name_widget(ui, &forget, &format!("Forget the layout {name}"));
                if forget.clicked() {
                    out.push(AppCommand::ForgetLayout(name.to_owned()));
                }
            });
        }
        let id = ui.scope_id().with("name of a layout");
        let mut name: String = ui.data(|data| data.get_temp(id)).unwrap_or_default();
        ui.horizontal(|ui| {
            let field =
                egui::TextEdit::singleline(&mut name).desired_width(150.0).char_limit(MOST_LAYOUT_NAME);
            let response = ui.add(field.hint_text("Name"));
            draw::name_widget(ui, &response, "Name of this layout");
            let entered = modal::entered(ui, &response);
            let can_save = !name.trim().is_empty();
            let save = ui.add_enabled(can_save, Button::new("Keep this layout"));
            if can_save && (save.clicked() || entered) {
                out.push(AppCommand::SaveLayout(std::mem::take(&mut name)));
                ui.close();
            }
        });
        ui.data_mut(|data| data.insert_temp(id, name));
    }

    fn places(&self, ui: &mut Ui, out: &mut Commands) {
        ui.separator();
        egui::ScrollArea::vertical().max_height(420.0).show(ui, |ui| {
            for (text, command) in self.places {
                if ui.button(text).on_hover_text(command.tooltip()).clicked() {
                    out.push(command.clone());
                    ui.close();
                }
            }
        });
    }

    fn tracts(&self, ui: &mut Ui, out: &mut Commands) {
        for tracts in self.work.world.case().iter().flat_map(|case| &case.tracts) {
            entry(ui, self.work, &EditCommand::ToggleTracts(tracts.id.clone()).into(), out);
        }
        entry(ui, self.work, &EditCommand::ToggleAllTracts.into(), out);
        ui.separator();
        if let (Some(doc), Some(case)) = (&self.work.doc, self.work.world.case()) {
            let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            SubMenuButton::new("Look of all fibre tracts").config(config).ui(ui, |ui| {
                tract_look::controls(ui, &doc.edit, &case.tracts.iter().collect::<Vec<_>>(), out);
            });
        }
    }

    /// The width of pictures in pixels, for a print of a given size.
    fn picture_width(&self, ui: &mut Ui, out: &mut Commands) {
        let current = match self.work.picture_size {
            PictureSize::WidthPx(pixels) => Some(pixels),
            PictureSize::Times(_) => None,
        };
        ui.horizontal(|ui| {
            let mut pixels = current.unwrap_or(DEFAULT_WIDTH_PX);
            let radio = ui.radio(current.is_some(), "This wide:");
            let drag =
                ui.add(DragValue::new(&mut pixels).range(100..=MAX_WIDTH_PX).speed(5).suffix(" pixels"));
            drag.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Width of pictures in pixels")
            });
            if radio.clicked() || drag.changed() {
                out.push(AppCommand::SetPictureSize(PictureSize::WidthPx(pixels)));
            }
        });
    }

    fn light(&self, ui: &mut Ui, out: &mut Commands) {
        let Some(doc) = &self.work.doc else { return };
        let choice = &doc.edit.light;
        ui.separator();
        let row = light::row(choice.mode);
        ui.add(egui::Label::new(egui::RichText::new(row.advice).small()).wrap())
            .on_hover_text("What the study in the thesis found (chapter 6)");
        let mut degrees = choice.aperture_deg;
        let slider = Slider::new(&mut degrees, 0.0..=85.0).suffix("°").fixed_decimals(0).text("Aperture");
        let response = ui.add_enabled(row.has_aperture, slider);
        if response.on_hover_text("Wide: soft, subtle shadows. Narrow: hard ones").changed() {
            out.push(EditCommand::SetAperture(degrees));
        }
        let mut towards = choice.towards_lamp;
        let from_lamp = egui::Checkbox::new(&mut towards, "Light from the lamp");
        let response = ui.add_enabled(row.turns_to_lamp(), from_lamp);
        let tip = if row.is_headlight() {
            "Tissue is shaded as lit from there, without shadows; otherwise the light is at the eye"
        } else {
            "Soft shadows of a wide light beside or behind the scene; otherwise it is at the eye"
        };
        if response.on_hover_text(tip).changed() {
            out.push(EditCommand::SetTowardsLamp(towards));
        }
        if let Some(lamp) = lamp(ui, choice.has_lamp(), choice.lamp) {
            out.push(EditCommand::SetLamp(lamp));
        }
        if let Some(shading) = shading(ui, choice) {
            out.push(EditCommand::SetShading(Box::new(shading)));
        }
    }
}

/// A menu that may be higher than the window: then it scrolls. It takes all of the height first, moved up from where it opens.
fn scrolling(ui: &mut Ui, add: impl FnOnce(&mut Ui)) {
    let most = ui.ctx().content_rect().height() - MENU_MARGIN;
    egui::ScrollArea::vertical().max_height(most).min_scrolled_height(most).show(ui, add);
}

/// Where the lamp stands. Returns it if it was changed.
fn lamp(ui: &mut Ui, enabled: bool, lamp: Lamp) -> Option<Lamp> {
    let mut new = lamp;
    let azimuth = Slider::new(&mut new.azimuth_deg, -180.0..=180.0).suffix("°").fixed_decimals(0);
    let tip = "0° is at the eye, 180° behind the scene. In the 3D views the right button turns the lamp, too";
    slider(ui, enabled, azimuth.text("Lamp to the right"), tip);
    let elevation = Slider::new(&mut new.elevation_deg, -90.0..=90.0).suffix("°").fixed_decimals(0);
    slider(ui, enabled, elevation.text("Lamp upwards"), "90° is above");
    let mut stays = new.frame == LampFrame::Patient;
    ui.add_enabled(enabled, egui::Checkbox::new(&mut stays, "Lamp stays with the patient")).on_hover_text(
        "Shadows stay where they are when the camera turns; angles count from in front of the face to the patient's left. \
         Otherwise the lamp goes with the viewer",
    );
    new.frame = if stays { LampFrame::Patient } else { LampFrame::Viewer };
    (new != lamp).then_some(new)
}

/// Sliders of the shading that every preset of a lighting mode has. Returns it if it was changed.
fn shading(ui: &mut Ui, choice: &LightChoice) -> Option<Shading> {
    let (row, at_rest) = (light::row(choice.mode), choice.at_rest());
    let mut new = choice.shading;
    let mut radius_mm = at_rest.occlusion_radius_mm;
    let tip = "How far surfaces darken each other";
    let radius = Slider::new(&mut radius_mm, 1.0..=30.0).suffix(" mm").fixed_decimals(1);
    let radius = radius.clamping(SliderClamping::Edits).text("Occlusion within");
    if choice.has_ambient_occlusion() && slider(ui, true, radius, tip) {
        new.occlusion_radius_mm = Some(radius_mm);
    }
    let mut percent = 100.0 * (1.0 - at_rest.occlusion_strength);
    let tip = "Light that hidden places receive, too; at 0 % they are black";
    let ambient = Slider::new(&mut percent, 0.0..=100.0).suffix(" %").fixed_decimals(0);
    if slider(ui, true, ambient.text("Ambient light"), tip) {
        new.ambient_share = Some(percent / 100.0);
    }
    let mut percent = 100.0 * at_rest.relief;
    let tip = "Closeup: light at the eye, so that rims are darker than what faces it";
    let relief = Slider::new(&mut percent, 0.0..=100.0).suffix(" %").fixed_decimals(0);
    if slider(ui, true, relief.text("Relief"), tip) {
        new.relief = Some(percent / 100.0);
    }
    let tip = "Closeup: a smooth surface instead of voxels, for the eye only: no number changes. Not with cones of light, which \
               read the voxels";
    ui.add_enabled(row.lights_smooth, egui::Checkbox::new(&mut new.smooth, "Smooth surface"))
        .on_hover_text(tip);
    for knob in row.knobs {
        let KnobRow { label, tip, unit, range, decimals, .. } = knob.row();
        let mut value = knob.of(&at_rest.lighting);
        let knob_slider = Slider::new(&mut value, range).suffix(unit).fixed_decimals(decimals);
        let knob_slider = knob_slider.step_by(if decimals == 0 { 1.0 } else { 0.0 });
        if slider(ui, true, knob_slider.clamping(SliderClamping::Edits).text(label), tip) {
            new.knobs.set(*knob, value);
        }
    }
    if choice.has_vicinity() {
        vicinity(ui, &at_rest, &mut new);
    }
    let is_own = choice.shading != Shading::default();
    if ui.add_enabled(is_own, Button::new("Shading as the lighting mode has it")).clicked() {
        new = Shading::default();
    }
    (new != choice.shading).then_some(new)
}

/// Sliders of the vicinity occlusion of opaque surfaces.
fn vicinity(ui: &mut Ui, at_rest: &Quality, new: &mut Shading) {
    let mut distance_mm = at_rest.lighting.vicinity_mm;
    let tip = "Slices: distance up to which opaque surfaces darken their vicinity, and from which on they cast soft shadows";
    let vicinity = Slider::new(&mut distance_mm, 0.5..=20.0).suffix(" mm").fixed_decimals(1);
    if slider(ui, true, vicinity.clamping(SliderClamping::Edits).text("Vicinity"), tip) {
        new.vicinity_mm = Some(distance_mm);
    }
    let mut samples = at_rest.lighting.vicinity_samples;
    let tip = "Slices: points at which a surface looks for others in its vicinity";
    let samples_slider = Slider::new(&mut samples, 1..=LightSettings::MOST_VICINITY);
    if slider(ui, true, samples_slider.text("Vicinity samples"), tip) {
        new.vicinity_samples = Some(samples);
    }
}

fn slider(ui: &mut Ui, enabled: bool, slider: Slider<'_>, tip: &str) -> bool {
    ui.add_enabled(enabled, slider).on_hover_text(tip).changed()
}

/// One menu entry, of the kind given by the command.
fn entry(ui: &mut Ui, work: &Workstation, command: &Command, out: &mut Commands) {
    let (text, enabled) = (command.text(), command.enabled(work));
    let clicked = match command.entry(work) {
        Entry::Plain => {
            let button = Button::new(text).shortcut_text(command.shortcut_text().unwrap_or_default());
            ui.add_enabled(enabled, button)
        }
        Entry::Switch(on) => {
            let mut checked = on;
            ui.add_enabled(enabled, egui::Checkbox::new(&mut checked, text))
        }
        Entry::Choice(chosen) => ui.add_enabled(enabled, egui::RadioButton::new(chosen, text)),
    };
    if clicked.on_hover_text(command.tooltip()).clicked() {
        out.push(command.clone());
        ui.close();
    }
}

fn toolbar(ui: &mut Ui, work: &Workstation, doc: &Document, out: &mut Commands) {
    let Some(time_point) = work.world.time_point(doc) else { return };
    for command in [EditCommand::Undo, EditCommand::Redo].map(Command::from) {
        let (text, enabled) = (command.text(), command.enabled(work));
        let response = ui.add_enabled(enabled, Button::new(&text)).on_hover_text(command.tooltip());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, &text));
        if response.clicked() {
            out.push(command);
        }
    }
    if work.world.time_point_count() > 1 {
        let labels = work.world.case().map(|case| case.time_labels()).unwrap_or_default();
        let combo = ComboBox::from_id_salt("time").selected_text(time_point.label.as_str()).width(96.0);
        let response = combo.show_ui(ui, |ui| {
            for (index, label) in labels.iter().enumerate() {
                if ui.selectable_label(index == doc.nav.time, *label).clicked() {
                    out.push(LookCommand::SetTime(index));
                }
            }
        });
        label_for_screen_readers(&response.response, "Date");
    }
    let context = doc.nav.context.as_deref().unwrap_or("no image");
    let combo = ComboBox::from_id_salt("context").selected_text(context).width(80.0);
    let response = combo.show_ui(ui, |ui| {
        for c in &time_point.contexts {
            if ui.selectable_label(doc.nav.context.as_ref() == Some(&c.id), &c.id).clicked() {
                out.push(LookCommand::SetContext(Some(c.id.clone())));
            }
        }
        if ui.selectable_label(doc.nav.context.is_none(), "no image").clicked() {
            out.push(LookCommand::SetContext(None));
        }
    });
    label_for_screen_readers(&response.response, "Image on the slices");
    if let Some((id, prepared)) = work.world.context(doc) {
        ui.menu_button("Window", |ui| {
            for preset in prepared.presets(is_pet(id)) {
                if ui.button(preset.name).clicked() {
                    out.push(EditCommand::SetWindow(id.to_owned(), preset.window));
                    ui.close();
                }
            }
        });
    }
    fusion::bar(ui, work, doc, out);
    ui.separator();
    lens_and_ruler(ui, doc, out);
    ui.separator();
    let mut opacity = doc.edit.overlay_opacity;
    ui.label("Masks on slices");
    ui.spacing_mut().slider_width = 60.0;
    let response = ui.add(Slider::new(&mut opacity, 0.0..=1.0).fixed_decimals(2));
    response
        .widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, "Opacity of masks on slices"));
    if response.on_hover_text("Opacity of masks on slices").changed() {
        out.push(EditCommand::SetOverlayOpacity(opacity));
    }
}

fn lens_and_ruler(ui: &mut Ui, doc: &Document, out: &mut Commands) {
    let toggle = Command::from(EditCommand::ToggleLens);
    let mut lens_on = doc.edit.lens_on;
    if ui.checkbox(&mut lens_on, "Lens").on_hover_text(toggle.tooltip()).changed() {
        out.push(toggle);
    }
    let mut radius_mm = doc.edit.lens.radius_mm;
    // Fixed decimals or clamping would change the radius without user input.
    let slider = Slider::new(&mut radius_mm, 1.0..=150.0)
        .logarithmic(true)
        .suffix(" mm")
        .clamping(SliderClamping::Edits)
        .custom_formatter(|mm, _| format!("{mm:.1}"));
    let response = ui.add_enabled(lens_on, slider);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, lens_on, "Lens radius"));
    if response.on_hover_text("Lens radius (drag the ring, or Alt and scroll over the closeup)").changed() {
        out.push(EditCommand::SetLensRadius(radius_mm));
    }
    let ruler = Command::from(LookCommand::ToggleRuler);
    let response = ui.selectable_label(doc.nav.ruler_on, "Ruler");
    if response.on_hover_text(ruler.tooltip()).clicked() {
        out.push(ruler);
    }
    let projection = Command::from(LookCommand::ToggleProjection);
    let text = match doc.nav.camera.projection {
        Projection::Perspective => "Perspective",
        Projection::Orthographic => "Orthographic",
    };
    if ui.button(text).on_hover_text(projection.tooltip()).clicked() {
        out.push(projection);
    }
}

/// The page shown while no case is open.
pub fn welcome(ui: &mut Ui, loading: bool, recent: &Recent, out: &mut Commands) {
    ui.vertical_centered(|ui| {
        ui.add_space(ui.available_height() * 0.22);
        ui.heading("Glioscope");
        if loading {
            ui.label("Loading; the status line shows the progress.");
            return;
        }
        ui.label(format!("Drop a folder, a manifest or a {} file here, or", volume_names()));
        ui.add_space(8.0);
        for command in [AppCommand::OpenDialog, AppCommand::OpenSample].map(Command::from) {
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
        ui.weak(about::NOTICE);
    });
}
