//! Session files of versions 1 and 2.

use serde_json::Value;

/// JSON pointers to values that version 1 wrote in PascalCase instead of snake_case.
const PASCAL_CASE: [&str; 6] = [
    "/edit/overlay",
    "/edit/palette",
    "/edit/coloring",
    "/edit/overlap_mode",
    "/nav/convention",
    "/nav/camera/projection",
];

/// Fields renamed since version 1: JSON pointer to their object, old name, new name.
const RENAMED: [(&str, &str, &str); 5] = [
    ("/edit/light", "shading", "mode"),
    ("/edit/light/own", "shading", "mode"),
    ("/edit/light/own/mutual", "solid_on_image", "opaque_on_image"),
    ("/edit/light/own/mutual", "image_on_solid", "image_on_opaque"),
    ("/edit/light/own/mutual", "solid_on_solid", "opaque_on_opaque"),
];

/// Fields of single panes' magnifications in version 1, now in `zooms`: field, pane.
const ZOOMS: [(&str, &str); 3] =
    [("context_zoom", "context"), ("ellipsoid_zoom", "ellipsoids"), ("change_zoom", "change")];

/// Upgrades the document of a file of version 2 to version 3, but for numbers of dates and masks, which only the case can
/// name.
pub(super) fn upgrade_version_2(document: &mut Value) {
    let opacities = document.pointer_mut("/edit/ellipsoid_opacities").and_then(Value::as_array_mut);
    for own in opacities.into_iter().flatten().filter_map(Value::as_object_mut) {
        if let Some(number) = own.remove("id") {
            own.insert("number".into(), number);
        }
    }
}

/// Upgrades the document of a file of version 1 to version 2. Anything unexpected is left unchanged; deserialising then
/// reports it.
pub(super) fn upgrade_version_1(document: &mut Value) {
    for pointer in PASCAL_CASE {
        if let Some(Value::String(word)) = document.pointer_mut(pointer) {
            *word = snake_case(word);
        }
    }
    for (pointer, old, new) in RENAMED {
        if let Some(object) = document.pointer_mut(pointer).and_then(Value::as_object_mut)
            && let Some(value) = object.remove(old)
        {
            object.insert(new.into(), value);
        }
    }
    if let Some(nav) = document.pointer_mut("/nav").and_then(Value::as_object_mut) {
        let zooms = ZOOMS.iter().filter_map(|(field, pane)| Some(((*pane).to_owned(), nav.remove(*field)?)));
        let zooms: serde_json::Map<String, Value> = zooms.collect();
        nav.insert("zooms".into(), zooms.into());
    }
    for pointer in ["/edit/layout", "/edit/maximized", "/edit/rulers"] {
        if let Some(part) = document.pointer_mut(pointer) {
            flatten_slice_panes(part);
        }
    }
}

/// Replaces `{"slice": "Axial"}`, version 1's name of a slice pane, with `"axial"` throughout `value`.
fn flatten_slice_panes(value: &mut Value) {
    match value {
        Value::Object(object) if object.len() == 1 && object.contains_key("slice") => {
            if let Some(Value::String(plane)) = object.remove("slice") {
                *value = snake_case(&plane).into();
            }
        }
        Value::Object(object) => object.values_mut().for_each(flatten_slice_panes),
        Value::Array(list) => list.iter_mut().for_each(flatten_slice_panes),
        _ => {}
    }
}

fn snake_case(word: &str) -> String {
    let mut out = String::with_capacity(word.len() + 2);
    for (i, letter) in word.char_indices() {
        if letter.is_ascii_uppercase() && i > 0 {
            out.push('_');
        }
        out.push(letter.to_ascii_lowercase());
    }
    out
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn version_1_has_its_names_of_today_and_anything_unexpected_as_it_was() {
        let mut document = json!({
            "edit": {
                "overlay": "Outline",
                "palette": "ColorBlindSafe",
                "coloring": 3,
                "light": {
                    "shading": "slices",
                    "own": {"shading": "cones", "mutual": {"solid_on_image": true, "other": false}},
                },
                "layout": {
                    "tiles": {
                        "1": {"Pane": {"slice": "Axial"}},
                        "2": {"slice": "Coronal", "share": 1.0},
                        "3": {"name": "Axial"},
                    },
                },
                "rulers": [{"view": {"slice": "Sagittal"}}, {"view": "closeup"}],
                "ellipsoid_opacities": [{"id": 4}],
            },
            "nav": {"camera": {"projection": "Orthographic"}, "context_zoom": 1.5, "change_zoom": 3.0},
        });
        upgrade_version_1(&mut document);
        let expected = json!({
            "edit": {
                "overlay": "outline",
                "palette": "color_blind_safe",
                "coloring": 3,
                "light": {
                    "mode": "slices",
                    "own": {"mode": "cones", "mutual": {"opaque_on_image": true, "other": false}},
                },
                "layout": {
                    "tiles": {
                        "1": {"Pane": "axial"},
                        "2": {"slice": "Coronal", "share": 1.0},
                        "3": {"name": "Axial"},
                    },
                },
                "rulers": [{"view": "sagittal"}, {"view": "closeup"}],
                "ellipsoid_opacities": [{"id": 4}],
            },
            "nav": {"camera": {"projection": "orthographic"}, "zooms": {"context": 1.5, "change": 3.0}},
        });
        assert_eq!(document, expected);
        let mut wrong = json!([{"slice": "Axial"}]);
        upgrade_version_1(&mut wrong);
        assert_eq!(wrong, json!([{"slice": "Axial"}]), "no document");
    }

    #[test]
    fn version_2_numbered_ellipsoids_by_id() {
        let mut document = json!({"edit": {"ellipsoid_opacities": [{"id": 4, "time": 1}, {"number": 5}, 6]}});
        upgrade_version_2(&mut document);
        let expected = json!({"edit": {"ellipsoid_opacities": [{"number": 4, "time": 1}, {"number": 5}, 6]}});
        assert_eq!(document, expected);
    }
}
