//! Names in session files. In memory a date is its index in the case, and so was a mask in sessions before version 3: in
//! files both are names, so that a date added in front moves nothing to another date.

use std::collections::BTreeSet;

use glioscope_core::case::{Case, TimePoint};
use serde_json::{Value, json};

use super::{document::Document, hidden::ids_of};

/// The document as JSON, with labels of dates instead of their indices.
pub(super) fn named(document: &Document, case: &Case) -> serde_json::Result<Value> {
    let mut value = serde_json::to_value(document)?;
    convert_times(&mut value, &mut |time| {
        let index = usize::try_from(time.as_u64()?).ok()?;
        case.time_points.get(index).map(|time_point| json!(time_point.label))
    });
    Ok(value)
}

/// `named` with placeholders for names that only a case can resolve, to check everything else before it is read.
pub(super) fn blank(named: &Value) -> Value {
    let mut value = named.clone();
    convert_times(&mut value, &mut |time| {
        Some(if time.is_string() || time.is_u64() { json!(0) } else { time.clone() })
    });
    if let Some(hidden) = hidden_regions(&mut value) {
        hidden.retain(|region| !region.is_u64());
    }
    value
}

/// `named` with the indices of the dates of `case`, and what it lacks, in words: that is left out. Numbers of old sessions
/// are taken as they are.
pub(super) fn numbered(named: &Value, case: &Case) -> (Value, Vec<String>) {
    let mut value = named.clone();
    let mut dropped = convert_times(&mut value, &mut |time| match time {
        Value::String(label) => case.time_at(label).map(|index| json!(index)),
        number => {
            number.as_u64().filter(|index| (*index as usize) < case.time_points.len()).map(|n| json!(n))
        }
    });
    let shown = value.pointer("/nav/time").and_then(Value::as_u64).unwrap_or_default() as usize;
    let Some(shown) = case.time_points.get(shown) else { return (value, dropped) };
    dropped.extend(regions_by_mask(&mut value, shown, case));
    dropped.extend(known_ids(&mut value, shown, case));
    (value, dropped)
}

/// Replaces every date of the document by what `change` returns for it. Where that is `None`, what it belongs to is left
/// out; returns that in words.
fn convert_times(document: &mut Value, change: &mut dyn FnMut(&Value) -> Option<Value>) -> Vec<String> {
    let mut dropped = Vec::new();
    if let Some(pictures) = document.pointer_mut("/edit/pictures").and_then(Value::as_array_mut) {
        // A picture of a date that isn't there shows nothing; what else it lacks is left out of it.
        pictures.retain_mut(|picture| {
            let is_known = picture.pointer("/nav/time").is_none_or(|time| change(time).is_some());
            if is_known {
                let lost = convert_times(picture, change);
                dropped.extend(lost.into_iter().map(|what| format!("of a picture for the report {what}")));
            } else {
                dropped.push("a picture for the report".to_owned());
            }
            is_known
        });
    }
    if let Some(time) = document.pointer_mut("/nav/time") {
        *time = change(time).unwrap_or_else(|| {
            dropped.push(format!("the date shown, {time}"));
            json!(0)
        });
    }
    for (pointer, what) in
        [("/edit/rulers", "line"), ("/edit/ellipsoid_opacities", "opacity of an ellipsoid")]
    {
        let Some(list) = document.pointer_mut(pointer).and_then(Value::as_array_mut) else { continue };
        list.retain_mut(|item| {
            let Some(time) = item.get_mut("time") else { return true };
            match change(time) {
                Some(new) => *time = new,
                None => {
                    let time = time.to_string();
                    let name = item.get("name").and_then(Value::as_str).filter(|name| !name.is_empty());
                    let name = name.map(|name| format!(" {name}")).unwrap_or_default();
                    dropped.push(format!("{what}{name} of {time}"));
                    return false;
                }
            }
            true
        });
    }
    if let Some(dates) = document.pointer_mut("/edit/change/dates")
        && let Some(pair) = dates.as_array()
    {
        *dates = match pair.iter().map(change).collect::<Option<Vec<Value>>>() {
            Some(new) => new.into(),
            None => {
                dropped.push(format!("the comparison of {dates}"));
                Value::Null
            }
        };
    }
    dropped
}

fn hidden_regions(document: &mut Value) -> Option<&mut Vec<Value>> {
    document.pointer_mut("/edit/selection/hidden")?.as_array_mut()
}

fn mask_ids(time_point: &TimePoint) -> &[String] {
    time_point.regions.mask_ids()
}

/// Hidden regions by their masks, where an old session has the bits of the date shown; those of masks that the case lacks
/// are left out and returned in words.
fn regions_by_mask(document: &mut Value, shown: &TimePoint, case: &Case) -> Vec<String> {
    let Some(hidden) = hidden_regions(document) else { return Vec::new() };
    let mut dropped = Vec::new();
    hidden.retain_mut(|region| {
        if let Some(bits) = region.as_u64() {
            match u32::try_from(bits).ok().and_then(|bits| ids_of(mask_ids(shown), bits)) {
                Some(ids) => *region = json!(ids),
                None => {
                    dropped.push(format!("hidden region number {bits}"));
                    return false;
                }
            }
        }
        let ids: Vec<&str> = region.as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        let lacks = ids.iter().any(|id| !case.has_mask(id));
        if lacks {
            dropped.push(format!("hidden region {}", ids.join("+")));
        }
        !lacks
    });
    // Bits of two masks that a date lists in another order are one region.
    let mut known = BTreeSet::new();
    hidden.retain(|region| known.insert(region.to_string()));
    dropped
}

/// Leaves out the mask compared, opacities of single ellipsoids and the image shown where the case has none of that name;
/// returns them in words.
fn known_ids(document: &mut Value, shown: &TimePoint, case: &Case) -> Vec<String> {
    let mut dropped = Vec::new();
    if let Some(of) = document.pointer_mut("/edit/change/of")
        && let Some(id) = of.as_str().filter(|id| !case.has_mask(id))
    {
        dropped.push(format!("the comparison of mask {id}"));
        *of = Value::Null;
    }
    for (pointer, what) in
        [("/edit/lesions/of", "lesions of mask"), ("/edit/response/non_enhancing", "response of mask")]
    {
        if let Some(of) = document.pointer_mut(pointer)
            && let Some(id) = of.as_str().filter(|id| !case.has_mask(id))
        {
            dropped.push(format!("the {what} {id}"));
            *of = Value::Null;
        }
    }
    if let Some(two) = document.pointer_mut("/edit/agreement/two")
        && let Some(operands) = two.as_array()
    {
        let lacks = |operand: &Value| {
            let time = operand.get("time").and_then(Value::as_str).unwrap_or_default();
            let ids = operand.get("masks").and_then(Value::as_array).into_iter().flatten();
            case.time_at(time).is_none() || ids.filter_map(Value::as_str).any(|id| !case.has_mask(id))
        };
        if operands.iter().any(lacks) {
            dropped.push("the two masks that were compared".to_owned());
            *two = Value::Null;
        }
    }
    if let Some(edits) = document.pointer_mut("/edit/lesions/edits").and_then(Value::as_array_mut) {
        let before = edits.len();
        edits.retain(|edit| {
            let of = edit.pointer("/at/of").or_else(|| edit.pointer("/from/of")).and_then(Value::as_str);
            of.is_none_or(|id| case.has_mask(id))
        });
        let lost = before - edits.len();
        if lost > 0 {
            dropped.push(format!("{lost} edits of lesions of masks that it lacks"));
        }
    }
    if let Some(pictures) = document.pointer_mut("/edit/pictures").and_then(Value::as_array_mut) {
        for picture in pictures {
            let lost = [regions_by_mask(picture, shown, case), known_ids(picture, shown, case)].concat();
            dropped.extend(lost.into_iter().map(|what| format!("of a picture for the report {what}")));
        }
    }
    if let Some(list) = document.pointer_mut("/edit/ellipsoid_opacities").and_then(Value::as_array_mut) {
        list.retain(|own| {
            let (mask, region) =
                (own.pointer("/of/mask"), own.pointer("/of/region").and_then(Value::as_array));
            let mut ids = mask.into_iter().chain(region.into_iter().flatten()).filter_map(Value::as_str);
            let missing = ids.find(|id| !case.has_mask(id));
            dropped.extend(missing.map(|id| format!("opacity of an ellipsoid of mask {id}")));
            missing.is_none()
        });
    }
    if let Some(image) = document.pointer_mut("/edit/lesions/image")
        && let Some(id) = image.as_str().filter(|id| !case.has_image(id))
    {
        dropped.push(format!("the values of image {id} in lesions"));
        *image = Value::Null;
    }
    if let Some(context) = document.pointer_mut("/nav/context")
        && let Some(id) = context.as_str().filter(|id| !case.has_image(id))
    {
        dropped.push(format!("the image shown, {id}"));
        *context = json!(shown.contexts.first().map(|c| &c.id));
    }
    dropped
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use glioscope_core::{
        Grid, Mask, MaskBits, Regions, Samples, Scaling, TumorIndex, Volume,
        case::{CaseMask, Context, OrderBasis},
        files::Inputs,
    };

    use super::*;
    use crate::model::{CaseRef, PaneId, Ruler, Shape};

    /// One voxel at two dates: jan with masks A and B and the image T1, feb with masks B and C and the image FLAIR.
    pub fn case() -> Case {
        let grid = Grid::axis_aligned([1; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let time_point = |label: &str, ids: [&str; 2], image: &str| {
            let masks = ids.map(|id| Mask::new(id, grid.clone(), MaskBits::full([1; 3])).unwrap());
            let index = TumorIndex::new(grid.clone(), &masks.iter().collect::<Vec<_>>()).unwrap();
            let of_case = |mask: Mask| CaseMask {
                native_voxels: mask.voxels(),
                native_volume_ml: mask.volume_ml(),
                native_grid: mask.grid().clone(),
                mask,
                frame_of_reference: String::new(),
                expected_volume_ml: None,
                color: None,
                name: None,
            };
            let volume = Volume::new(grid.clone(), Samples::U8(vec![7]), Scaling::NONE).unwrap();
            TimePoint {
                label: label.into(),
                contexts: vec![Context { id: image.into(), volume: Arc::new(volume) }],
                masks: masks.map(of_case).into(),
                regions: Arc::new(Regions::of(&index)),
                index: Arc::new(index),
            }
        };
        Case {
            name: "A".into(),
            patient: glioscope_core::case::Patient::default(),
            grid: grid.clone(),
            time_points: vec![time_point("jan", ["A", "B"], "T1"), time_point("feb", ["B", "C"], "FLAIR")],
            order: OrderBasis::Stated,
            tracts: Vec::new(),
            one_space: false,
            aligned: Vec::new(),
            checks: Vec::new(),
            inputs: Inputs::default(),
        }
    }

    #[test]
    fn indices_become_labels_in_a_file_and_indices_again() {
        let case = case();
        let mut document = Document::new(CaseRef::Sample, &case.time_points[0], 2);
        let ruler = |time| {
            let (name, view) = ("Line".to_owned(), PaneId::Axial);
            Ruler { name, from_mm: DVec3::ZERO, to_mm: DVec3::X, shape: Shape::Line, view, time }
        };
        document.edit.rulers = vec![ruler(1), ruler(0)];
        document.edit.change.dates = Some([1, 0]);
        document.nav.time = 1;
        let named = named(&document, &case).unwrap();
        for (pointer, label) in [
            ("/nav/time", "feb"),
            ("/edit/rulers/0/time", "feb"),
            ("/edit/rulers/1/time", "jan"),
            ("/edit/change/dates/0", "feb"),
            ("/edit/change/dates/1", "jan"),
        ] {
            assert_eq!(named.pointer(pointer), Some(&json!(label)), "{pointer}");
        }
        assert_eq!(numbered(&named, &case), (serde_json::to_value(&document).unwrap(), Vec::new()));
    }

    /// Sessions of before version 3 have indices of dates, and bits of regions at the date shown.
    #[test]
    fn what_the_case_has_is_kept_by_name_or_by_old_number() {
        let found = json!({
            "nav": {"time": 1, "context": "T1"},
            "edit": {
                "rulers": [{"name": "a", "time": "feb"}, {"name": "b", "time": 0}, {"name": "c"}],
                "ellipsoid_opacities": [
                    {"time": 1, "of": {"mask": "C"}},
                    {"time": "jan", "of": {"region": ["A", "B"]}},
                    {"time": 0},
                ],
                "change": {"dates": ["feb", 0], "of": "C"},
                "selection": {"hidden": [["A"], 3, ["B", "C"], 2]},
            },
        });
        let expected = json!({
            "nav": {"time": 1, "context": "T1"},
            "edit": {
                "rulers": [{"name": "a", "time": 1}, {"name": "b", "time": 0}, {"name": "c"}],
                "ellipsoid_opacities": [
                    {"time": 1, "of": {"mask": "C"}},
                    {"time": 0, "of": {"region": ["A", "B"]}},
                    {"time": 0},
                ],
                "change": {"dates": [1, 0], "of": "C"},
                // Once, though feb's number 3 is the same region as a name.
                "selection": {"hidden": [["A"], ["B", "C"], ["C"]]},
            },
        });
        assert_eq!(numbered(&found, &case()), (expected, Vec::new()));
        let none =
            json!({"nav": {"time": "jan", "context": null}, "edit": {"change": {"dates": null, "of": null}}});
        let expected =
            json!({"nav": {"time": 0, "context": null}, "edit": {"change": {"dates": null, "of": null}}});
        assert_eq!(numbered(&none, &case()), (expected, Vec::new()));
    }

    #[test]
    fn what_the_case_lacks_is_left_out_and_said() {
        let found = json!({
            "nav": {"time": "mar", "context": "PD"},
            "edit": {
                "rulers": [{"name": "a", "time": "mar"}, {"name": "b", "time": 2}, {"name": "c", "time": "feb"}],
                "ellipsoid_opacities": [
                    {"time": "mar", "of": {"mask": "A"}},
                    {"time": "jan", "of": {"mask": "X"}},
                    {"time": "jan", "of": {"region": ["A", "Y"]}},
                    {"time": "jan", "of": {"mask": "A"}},
                ],
                "change": {"dates": ["jan", "mar"], "of": "X"},
                "selection": {"hidden": [["A", "X"], 4, 4_294_967_297_u64, 1]},
            },
        });
        let expected = json!({
            "nav": {"time": 0, "context": "T1"},
            "edit": {
                "rulers": [{"name": "c", "time": 1}],
                "ellipsoid_opacities": [{"time": 0, "of": {"mask": "A"}}],
                "change": {"dates": null, "of": null},
                "selection": {"hidden": [["A"]]},
            },
        });
        let said = [
            "the date shown, \"mar\"",
            "line a of \"mar\"",
            "line b of 2",
            "opacity of an ellipsoid of \"mar\"",
            "the comparison of [\"jan\",\"mar\"]",
            "hidden region A+X",
            "hidden region number 4",
            "hidden region number 4294967297",
            "the comparison of mask X",
            "opacity of an ellipsoid of mask X",
            "opacity of an ellipsoid of mask Y",
            "the image shown, PD",
        ];
        assert_eq!(numbered(&found, &case()), (expected, said.map(str::to_owned).to_vec()));
    }

    #[test]
    fn only_names_have_placeholders_before_the_case_is_read() {
        let of = |times: [Value; 3], hidden: Value| {
            let rulers: Vec<Value> = times.iter().map(|time| json!({"time": time})).collect();
            let edit = json!({"rulers": rulers, "change": {"dates": times}, "selection": {"hidden": hidden}});
            json!({"nav": {"time": times[0], "context": "X"}, "edit": edit})
        };
        let named = of([json!("mar"), json!(7), json!(true)], json!([3, ["X"], "wrong"]));
        let expected = of([json!(0), json!(0), json!(true)], json!([["X"], "wrong"]));
        assert_eq!(blank(&named), expected);
    }
}
