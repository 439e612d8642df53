//! The second image on slices: which one, and how it is shown.

use egui::{ComboBox, DragValue, Slider, Ui};
use glioscope_render::{ColorMap, flat::Mixing};
use strum::VariantArray;

use super::label::label_for_screen_readers;
use crate::{
    command::{Commands, EditCommand, Workstation},
    model::{
        Document, Fusion, SecondImage,
        fusion::{image_name, is_pet},
    },
};

/// The part of the toolbar; nothing where the case has one image.
pub(super) fn bar(ui: &mut Ui, work: &Workstation, doc: &Document, out: &mut Commands) {
    let Some(case) = work.world.case() else { return };
    let images: usize = case.time_points.iter().map(|t| t.contexts.len()).sum();
    let Some(first) = doc.nav.context.as_ref().filter(|_| images > 1) else { return };
    let fusion = &doc.edit.fusion;
    let mut changed = fusion.clone();
    let second = work.world.second(doc);
    let shown = second.map_or_else(|| "one image".to_owned(), |second| image_name(second.id, second.time));
    let combo = ComboBox::from_id_salt("second image").selected_text(shown).width(80.0).truncate();
    let response = combo.show_ui(ui, |ui| {
        let mut choose = |ui: &mut Ui, is_chosen: bool, text: String, image: Option<SecondImage>| {
            if ui.selectable_label(is_chosen, text).clicked() {
                let is_same_kind = image.as_ref().is_some_and(|image| image.id == *first);
                changed = fusion.showing(image, is_same_kind);
            }
        };
        choose(ui, second.is_none(), "one image".into(), None);
        for (n, time_point) in case.time_points.iter().enumerate() {
            for image in &time_point.contexts {
                // The image shown is no second one; one of the date shown follows it to other dates.
                let is_here = n == doc.nav.time;
                if is_here && image.id == *first {
                    continue;
                }
                let time = (!is_here).then(|| time_point.label.clone());
                let chosen = SecondImage { id: image.id.clone(), time };
                let is_chosen = second.is_some_and(|s| (s.id, s.time) == (&image.id, &time_point.label));
                choose(ui, is_chosen, image_name(&image.id, &time_point.label), Some(chosen));
            }
        }
    });
    label_for_screen_readers(&response.response, "Second image on the slices");
    response.response.on_hover_text("A second image on the slices: another sequence, or another date");
    if let Some(second) = second {
        let threshold = changed.threshold_in(second.window);
        controls(ui, &mut changed, threshold);
        let text =
            "In the context view, too: the largest value along each ray, over everything, turning with it";
        ui.checkbox(&mut changed.in_context, "in 3D").on_hover_text(text);
    }
    if let Some(second) = second.filter(|second| second.id != first) {
        ui.menu_button("Its window", |ui| {
            for preset in second.image.presets(is_pet(second.id)) {
                if ui.button(preset.name).clicked() {
                    out.push(EditCommand::SetWindow(second.id.to_owned(), preset.window));
                    ui.close();
                }
            }
        });
    }
    if changed != *fusion {
        out.push(EditCommand::SetFusion(Box::new(changed)));
    }
}

fn controls(ui: &mut Ui, fusion: &mut Fusion, threshold: f64) {
    let mixing = |mixing: Mixing| match mixing {
        Mixing::Over => "over the first",
        Mixing::Checkerboard => "checkerboard",
        Mixing::Swipe => "swipe",
        Mixing::Edges => "edges",
        Mixing::Blink => "blink",
    };
    let combo = ComboBox::from_id_salt("mixing").selected_text(mixing(fusion.mixing)).width(80.0);
    let response = combo.show_ui(ui, |ui| {
        for &choice in Mixing::VARIANTS {
            ui.selectable_value(&mut fusion.mixing, choice, mixing(choice));
        }
    });
    label_for_screen_readers(&response.response, "How both images are shown");
    let combo = ComboBox::from_id_salt("color map").selected_text(fusion.map.name()).width(60.0);
    let response = combo.show_ui(ui, |ui| {
        for &choice in ColorMap::VARIANTS {
            ui.selectable_value(&mut fusion.map, choice, choice.name());
        }
    });
    label_for_screen_readers(&response.response, "Colours of the second image");
    let slider = |ui: &mut Ui, value: &mut f32, name: &'static str| {
        ui.spacing_mut().slider_width = 60.0;
        let response = ui.add(Slider::new(value, 0.0..=1.0).fixed_decimals(2));
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Slider, true, name));
        response.on_hover_text(name);
    };
    match fusion.mixing {
        Mixing::Over => {
            slider(ui, &mut fusion.opacity, "Opacity of the second image");
            let mut has_threshold = fusion.threshold.is_some();
            let text = "Values at or below it are transparent; without one, those below 40 % of its window";
            if ui.checkbox(&mut has_threshold, "own threshold").on_hover_text(text).changed() {
                fusion.threshold = has_threshold.then_some(threshold);
            }
            if let Some(threshold) = &mut fusion.threshold {
                let response = ui.add(DragValue::new(threshold).speed(0.1).max_decimals(2));
                response.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::SpinButton, true, "Threshold of the second image")
                });
            }
        }
        Mixing::Swipe => slider(ui, &mut fusion.share, "Where the line between both images is"),
        Mixing::Checkerboard | Mixing::Edges | Mixing::Blink => {}
    }
}
