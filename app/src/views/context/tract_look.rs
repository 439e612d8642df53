//! Controls of how fibre tracts look: in the menu of a line of the list, and for all in the menu View.

use std::collections::BTreeMap;

use egui::{Checkbox, DragValue, Role, ScrollArea, Slider, SliderClamping, Ui, WidgetInfo};
use glioscope_core::case::CaseTracts;
use glioscope_render::ColorMap;
use strum::VariantArray;

use crate::{
    command::{Commands, EditCommand},
    model::{
        Edit, FiberColor, FiberLook,
        fibers::{DEFAULT_DEVIATION, FIBER_DEVIATION, FIBER_RADIUS_MM},
    },
    views::draw,
};

/// Height of a list of scalars, points: longer ones scroll.
const LIST_POINTS: f32 = 130.0;

/// Controls of the look of `tracts` together; they show that of the first. Nothing without any.
pub fn controls(ui: &mut Ui, edit: &Edit, tracts: &[&CaseTracts], out: &mut Commands) {
    let Some(first) = tracts.first() else { return };
    let look = edit.tract_look(&first.id);
    let mut new = look.clone();
    // Numbers change by dragging, which must not move what is dragged.
    ui.set_max_width(250.0);
    ui.label(if tracts.len() == 1 { first.id.as_str() } else { "All fibre tracts" });
    colors(ui, &mut new, tracts);
    if let Some(scalar) = new.scalar(&first.tracts) {
        scale(ui, &mut new, scalar.range().unwrap_or_default().map(f64::from));
    }
    ui.separator();
    let radius = Slider::new(&mut new.radius_mm, FIBER_RADIUS_MM)
        .logarithmic(true)
        .clamping(SliderClamping::Always)
        .fixed_decimals(2)
        .suffix(" mm")
        .text("radius");
    let response = ui.add(radius);
    response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Radius of the fibres in millimetres"));
    let mut is_smooth = new.smooth.is_some();
    let text =
        "Curves through the file's points instead of straight segments. Distances are those of the file";
    if ui.add(Checkbox::new(&mut is_smooth, "smooth curves")).on_hover_text(text).changed() {
        new.smooth = is_smooth.then_some(DEFAULT_DEVIATION);
    }
    if let Some(share) = &mut new.smooth {
        let slider = Slider::new(share, FIBER_DEVIATION)
            .logarithmic(true)
            .clamping(SliderClamping::Always)
            .custom_formatter(|share, _| format!("{:.1} %", share * 100.0))
            .custom_parser(|text| {
                text.trim().trim_end_matches('%').trim().parse().ok().map(|percent: f64| percent / 100.0)
            })
            .text("off the curve");
        let response = ui.add(slider);
        response.widget_info(|| {
            WidgetInfo::labeled(
                Role::Slider,
                true,
                "Largest distance from the curve as a share of the radius",
            )
        });
        response.on_hover_text("The largest distance between a curve and what is drawn of it, of the radius");
    }
    if ui.add_enabled(new != FiberLook::default(), egui::Button::new("As to begin with")).clicked() {
        new = FiberLook::default();
    }
    if new != look {
        out.push(EditCommand::SetTractLooks(looks(edit, tracts, &look, &new)));
    }
}

/// The looks of `tracts` after that shown changed from `old` to `new`: each takes over what changed, and a scalar only
/// where it has one of that name.
fn looks(
    edit: &Edit,
    tracts: &[&CaseTracts],
    old: &FiberLook,
    new: &FiberLook,
) -> BTreeMap<String, FiberLook> {
    let changed = |CaseTracts { id, tracts }: &&CaseTracts| {
        let mut own = edit.tract_look(id);
        let fits = new.scalar(tracts).is_some() || !matches!(new.color, FiberColor::Scalar(_));
        if new.color != old.color && fits {
            own = own.colored_by(new.color.clone());
        }
        own.map = if new.map == old.map { own.map } else { new.map };
        if new.range != old.range && own.color == new.color {
            own.range = new.range;
        }
        own.radius_mm = if new.radius_mm == old.radius_mm { own.radius_mm } else { new.radius_mm };
        own.smooth = if new.smooth == old.smooth { own.smooth } else { new.smooth };
        (id.clone(), own)
    };
    tracts.iter().map(changed).collect()
}

fn colors(ui: &mut Ui, look: &mut FiberLook, tracts: &[&CaseTracts]) {
    let mut choose = |ui: &mut Ui, text: &str, color: FiberColor, detail: &str| {
        let response = ui.radio(look.color == color, text);
        draw::name_widget(ui, &response, &format!("Colour of the fibres: {text}"));
        if response.on_hover_text(detail).clicked() {
            *look = look.colored_by(color);
        }
    };
    choose(ui, "one colour", FiberColor::Plain, "A colour per file");
    let detail = "Red left-right, green anterior-posterior, blue superior-inferior";
    choose(ui, "direction", FiberColor::Direction, detail);
    let mut names: Vec<&str> = Vec::new();
    for scalar in tracts.iter().flat_map(|tracts| tracts.tracts.scalars()) {
        if scalar.range().is_some() && !names.contains(&scalar.name()) {
            names.push(scalar.name());
        }
    }
    ScrollArea::vertical().id_salt("scalars").max_height(LIST_POINTS).show(ui, |ui| {
        for name in names {
            choose(ui, name, FiberColor::Scalar(name.to_owned()), "A scalar of the file");
        }
    });
}

/// Colour map and range of a scalar whose values are from `least` to `most`.
fn scale(ui: &mut Ui, look: &mut FiberLook, [least, most]: [f64; 2]) {
    ui.horizontal_wrapped(|ui| {
        for &map in ColorMap::VARIANTS {
            let response = ui.selectable_label(look.map == map, map.name());
            draw::name_widget(ui, &response, &format!("Colours of the scalar: {}", map.name()));
            if response.clicked() {
                look.map = map;
            }
        }
    });
    let [mut low, mut high] = look.range.unwrap_or([least, most]);
    let speed = ((most - least) / 200.0).max(f64::EPSILON);
    let before = [low, high];
    ui.horizontal(|ui| {
        for (value, range, name) in [
            (&mut low, -1e37..=before[1], "Scalar of the first colour"),
            (&mut high, before[0]..=1e37, "Scalar of the last colour"),
        ] {
            let response = ui.add(DragValue::new(value).speed(speed).range(range).max_decimals(4));
            response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, name));
            response.on_hover_text(name);
        }
        if ui.add_enabled(look.range.is_some(), egui::Button::new("whole range")).clicked() {
            look.range = None;
        } else if [low, high] != before {
            look.range = Some([low, high]);
        }
    });
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glioscope_core::{ScalarPer, Sides, TractScalar, Tracts};

    use super::*;
    use crate::model::{CaseRef, Document, session_names};

    #[test]
    fn all_tracts_take_over_what_changed_and_keep_the_rest() {
        let tracts = |id: &str, name: &str| {
            let tracts = Tracts::new(vec![[0.0; 3]], vec![0, 1], Sides::Known).unwrap();
            let scalar = TractScalar::new(name.into(), ScalarPer::Fiber, vec![1.0]);
            CaseTracts { id: id.into(), tracts: Arc::new(tracts.with_scalars(vec![scalar]).unwrap()) }
        };
        let (a, b) = (tracts("a", "FA"), tracts("b", "MD"));
        let case = session_names::tests::case();
        let mut edit = Document::new(CaseRef::Sample, &case.time_points[0], 1).edit;
        let own = FiberLook { radius_mm: 1.5, ..FiberLook::default() };
        edit.tract_looks.insert("b".into(), own.clone());
        let old = FiberLook::default();
        let fa = old.colored_by(FiberColor::Scalar("FA".into()));
        let found = looks(&edit, &[&a, &b], &old, &fa);
        assert_eq!((&found["a"], &found["b"]), (&fa, &own));
        let smooth = FiberLook { smooth: Some(0.1), ..old.clone() };
        let found = looks(&edit, &[&a, &b], &old, &smooth);
        assert_eq!((&found["a"], &found["b"]), (&smooth, &FiberLook { smooth: Some(0.1), ..own }));
    }
}
