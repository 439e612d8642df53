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
                    let name = item.get("name").and_then(Value::as_str).unwrap_or_default();
                    dropped.push(format!("{what} {name} of {time}"));
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

fn has_mask(case: &Case, id: &str) -> bool {
    case.time_points.iter().any(|time_point| mask_ids(time_point).iter().any(|known| known == id))
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
        let lacks = ids.iter().any(|id| !has_mask(case, id));
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
        && let Some(id) = of.as_str().filter(|id| !has_mask(case, id))
    {
        dropped.push(format!("the comparison of mask {id}"));
        *of = Value::Null;
    }
    if let Some(list) = document.pointer_mut("/edit/ellipsoid_opacities").and_then(Value::as_array_mut) {
        list.retain(|own| {
            let (mask, region) =
                (own.pointer("/of/mask"), own.pointer("/of/region").and_then(Value::as_array));
            let mut ids = mask.into_iter().chain(region.into_iter().flatten()).filter_map(Value::as_str);
            let missing = ids.find(|id| !has_mask(case, id));
            dropped.extend(missing.map(|id| format!("opacity of an ellipsoid of mask {id}")));
            missing.is_none()
        });
    }
    let has_image = |id: &str| case.time_points.iter().any(|t| t.contexts.iter().any(|c| c.id == id));
    if let Some(context) = document.pointer_mut("/nav/context")
        && let Some(id) = context.as_str().filter(|id| !has_image(id))
    {
        dropped.push(format!("the image shown, {id}"));
        *context = json!(shown.contexts.first().map(|c| &c.id));
    }
    dropped
}
