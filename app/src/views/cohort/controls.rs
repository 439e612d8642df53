//! Above the grid: which cases are shown and how, and what colours mean.

use egui::{Slider, Stroke, StrokeKind, TextEdit, Ui, vec2};
use glioscope_cohort::{Collected, Date, MOST_MASKS};
use strum::VariantArray;

use super::{color::Colors, glyph::Glyphs, grid, picker, reading};
use crate::{
    command::{AppCommand, Command, Commands},
    format,
    model::cohort::{CELL_POINTS, CohortSetting, GlyphScale, OpenCohort, Order},
    report::shortened,
    theme::{self, Tokens},
    views::draw,
    world::cohort::Columns,
};

/// Draws the controls and pushes a changed setting.
pub fn show(
    ui: &mut Ui,
    (open, has_case): (&OpenCohort, bool),
    setting: &CohortSetting,
    (collected, columns, shown): (&Collected, &Columns, usize),
    (colors, glyphs): (Option<&Colors>, Option<&Glyphs>),
    out: &mut Commands,
) {
    let mut new = setting.clone();
    ui.add_space(4.0);
    ui.horizontal_wrapped(|ui| {
        ui.add(egui::Label::new(egui::RichText::new(shortened(&open.name(), 24)).strong()))
            .on_hover_text(open.folder.display().to_string());
        let of = (format::count(shown as u64), format::count(collected.cases().len() as u64));
        ui.label(format!("{} of {} cases shown", of.0, of.1));
        let field = TextEdit::singleline(&mut new.search).desired_width(110.0).hint_text("Name contains");
        let response = ui.add(field);
        draw::name_widget(ui, &response, "Name contains");
        let of = (collected, columns.offered());
        if let Some(sort) = picker::show(ui, "Sort", setting.sort.as_ref(), Some("by name"), of) {
            new.sort = sort;
        }
        for (order, word) in Order::VARIANTS.iter().zip(["Outliers first", "Least first", "Greatest first"]) {
            if (setting.sort.is_some() || *order != Order::Outliers)
                && ui.selectable_label(setting.order == *order, word).on_hover_text(about(*order)).clicked()
            {
                new.order = *order;
            }
        }
        if let Some(color) = picker::show(ui, "Colour", setting.color.as_ref(), Some("none"), of) {
            new.color = color;
        }
        if open.reading.is_none() {
            reading::begin(ui, out);
        }
        if has_case
            && ui
                .button("Back to the case")
                .on_hover_text(Command::from(AppCommand::ShowCohort).tooltip())
                .clicked()
        {
            out.push(AppCommand::ShowCohort);
        }
    });
    ui.horizontal_wrapped(|ui| {
        masks(ui, collected, &mut new);
        for (date, word) in Date::VARIANTS.iter().zip(["First date", "Last date"]) {
            if ui
                .selectable_label(setting.date == *date, word)
                .on_hover_text("The date that is drawn")
                .clicked()
            {
                new.date = *date;
            }
        }
        for (scale, word) in GlyphScale::VARIANTS.iter().zip(["Own scale", "Same scale"]) {
            let about = match scale {
                GlyphScale::Own => "Each diagram fills its cell",
                GlyphScale::Same => "The same area for a millilitre in all diagrams",
            };
            if ui.selectable_label(setting.scale == *scale, word).on_hover_text(about).clicked() {
                new.scale = *scale;
            }
        }
        ui.spacing_mut().slider_width = 70.0;
        let slider = Slider::new(&mut new.cell_points, CELL_POINTS).show_value(false);
        let response = ui.add(slider).on_hover_text("Size of the diagrams");
        draw::name_widget(ui, &response, "Size of the diagrams");
        ui.separator();
        legend(ui, setting, colors, glyphs);
    });
    ui.add_space(4.0);
    if new != *setting {
        out.push(AppCommand::SetCohort(Box::new(new)));
    }
}

fn about(order: Order) -> &'static str {
    match order {
        Order::Outliers => {
            "The farthest from the median first, in median absolute deviations; of words, the rarest"
        }
        Order::Ascending => "The least first",
        Order::Descending => "The greatest first",
    }
}

/// Which masks are drawn.
fn masks(ui: &mut Ui, collected: &Collected, new: &mut CohortSetting) {
    let all = collected.masks();
    if all.len() < 2 {
        return;
    }
    let menu = egui::containers::menu::MenuConfig::new()
        .close_behavior(egui::PopupCloseBehavior::CloseOnClickOutside);
    let text = format!("Masks: {} of {}", new.masks.len(), all.len());
    egui::containers::menu::MenuButton::new(text).config(menu).ui(ui, |ui| {
        for mask in all {
            let mut is_drawn = new.masks.iter().any(|drawn| drawn == mask);
            let can = is_drawn && new.masks.len() > 1 || !is_drawn && new.masks.len() < MOST_MASKS;
            if ui.add_enabled(can, egui::Checkbox::new(&mut is_drawn, mask)).changed() {
                if is_drawn {
                    new.masks.push(mask.to_owned());
                } else {
                    new.masks.retain(|drawn| drawn != mask);
                }
            }
        }
        ui.weak(format!("Up to {MOST_MASKS} are drawn."));
    });
}

/// What the colours of masks and bars mean, and what the scale is.
fn legend(ui: &mut Ui, setting: &CohortSetting, colors: Option<&Colors>, glyphs: Option<&Glyphs>) {
    let tokens = Tokens::in_ui(ui);
    let of_masks = grid::mask_colors(setting);
    for (k, mask) in setting.masks.iter().enumerate() {
        let (rect, _) = ui.allocate_exact_size(vec2(11.0, 11.0), egui::Sense::hover());
        let edge = Stroke::new(1.0, tokens.second);
        ui.painter().rect(rect, 2.0, theme::color(of_masks.mask(k)), edge, StrokeKind::Outside);
        ui.label(mask);
    }
    if setting.scale == GlyphScale::Same
        && let Some(ml) =
            glyphs.and_then(|glyphs| glyphs.ml_per_square_point(f64::from(grid::radius(setting))))
    {
        // A square of a centimetre of a common screen or so.
        let side = 20.0_f32;
        ui.separator();
        let (rect, _) = ui.allocate_exact_size(vec2(side, side), egui::Sense::hover());
        ui.painter().rect_filled(rect, 0.0, tokens.second);
        ui.label(format!("{} of a mask", format::ml(ml * f64::from(side * side))));
    }
    if let (Some(color), Some(colors)) = (&setting.color, colors) {
        ui.separator();
        ui.label(picker::title(color));
        colors.show_legend(ui);
    }
}
