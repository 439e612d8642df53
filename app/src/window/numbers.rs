//! Every number that the window shows, as one JSON document or one CSV table.

use std::{path::Path, sync::Arc};

use glioscope_core::{
    Connectivity, Progress, RegionVolume,
    case::{Case, Context},
    change::{self, ChangeReport},
    csv, ellipsoid,
    files::Inputs,
    inside_lens::voxels_inside,
    measure,
    response::{BtRads, bt_rads},
};
use serde_json::{Map, Value, json};

use crate::{
    error::AppError,
    model::{Document, ExportFormat, document::ball_ml, rulers},
    output,
    world::{
        agreement::{compare_two, with_metrics},
        response::{Answered, answered_of},
    },
};

/// What is exported, as the window showed it.
pub struct Shown {
    /// The case.
    pub case: Arc<Case>,
    /// Files that aren't written over.
    pub inputs: Inputs,
    /// The user's choices.
    pub doc: Document,
    /// The regions of the date shown; `None` if no mask is active.
    pub tumor: Option<Arc<RegionVolume>>,
    /// The comparison of dates, where it is computed already.
    pub compared: Option<ChangeReport>,
    /// The response, and its lesions, in place of what the document states.
    pub response: Option<Answered>,
}

impl Shown {
    /// That of a case and document that no window shows: nothing is computed yet, and nothing of it may be written over.
    pub fn of(case: &Arc<Case>, doc: &Document, response: Option<Answered>) -> Self {
        let time = case.time_points.get(doc.nav.time);
        let tumor = time.and_then(|time| RegionVolume::of(&time.index, &time.regions)).map(Arc::new);
        let inputs = case.inputs.clone();
        Self { case: case.clone(), inputs, doc: doc.clone(), tumor, compared: None, response }
    }

    /// Writes all numbers to `path`, in the format of its ending.
    ///
    /// # Errors
    /// [`AppError`] naming the file, or if loading is cancelled.
    pub fn write(&self, path: &Path, progress: &Progress) -> Result<(), AppError> {
        let format = ExportFormat::of(path).unwrap_or(ExportFormat::Json);
        output::write(path, &self.inputs, &as_file(&self.json(progress)?, format)?)
    }

    /// All numbers: those of `measure --metrics --json`, and under further keys those of the other panes.
    ///
    /// # Errors
    /// [`AppError`] where a computation fails.
    pub fn json(&self, progress: &Progress) -> Result<Value, AppError> {
        let Self { case, doc, .. } = self;
        let agreement = &doc.edit.agreement;
        let settings = agreement.settings();
        let compared = measure::compared(case, &[], &settings, progress)?;
        // What can't be compared is said in its pane.
        let two = agreement.two.iter().filter_map(|two| compare_two(case, two, &settings, progress).ok());
        let two: Vec<_> = two.collect();
        progress.check()?;
        let mut numbers = with_metrics(&measure::report(case), &compared, &two)?;
        let neighbors = doc.edit.ellipsoids.neighbors;
        let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
        let ellipsoids = ellipsoid::report(case, connectivity, &ellipsoid::Options::default(), progress)?;
        let (lesions, own) = answered_of(case, doc, self.response.as_ref(), progress)?;
        for (key, value) in [
            ("hidden_regions", self.hidden()),
            ("lens", self.lens()),
            ("change", self.change(progress)?),
            (
                "ellipsoids",
                json!({"connectivity": neighbors, "components": output::value(&ellipsoids.components)?}),
            ),
            ("lesions", output::value(&lesions)?),
            ("response", self.response(own.as_ref())?),
            ("bt_rads", self.bt_rads()),
            ("lines", rulers::as_json(case, &doc.edit.rulers)["lines"].take()),
        ] {
            if let Some(object) = numbers.as_object_mut() {
                object.insert(key.to_owned(), value);
            }
        }
        Ok(numbers)
    }

    fn names(&self, bits: u32) -> Vec<&str> {
        let Some(time_point) = self.case.time_points.get(self.doc.nav.time) else { return Vec::new() };
        let ids = time_point.regions.mask_ids().iter().enumerate();
        ids.filter(|(k, _)| bits >> k & 1 == 1).map(|(_, id)| id.as_str()).collect()
    }

    fn hidden(&self) -> Value {
        let time_point = self.case.time_points.get(self.doc.nav.time);
        let Some(regions) = time_point.map(|time_point| &time_point.regions) else { return Value::Null };
        let shown = self.doc.edit.selection.at(regions);
        let hidden = regions.list().iter().filter(|region| !shown.shows(region.bits));
        hidden.map(|region| self.names(region.bits)).collect()
    }

    /// The table of what is in the lens; null while it is off.
    fn lens(&self) -> Value {
        let (Some(lens), Some(tumor)) = (self.doc.active_lens(), &self.tumor) else { return Value::Null };
        let Some(time_point) = self.case.time_points.get(self.doc.nav.time) else { return Value::Null };
        let counts = voxels_inside(tumor, lens.center_mm, lens.radius_mm);
        let all: u64 = counts.iter().map(|(_, voxels)| voxels).sum();
        let share = |part: u64, whole: u64| if whole == 0 { 0.0 } else { part as f64 / whole as f64 };
        let row = |&(bits, voxels): &(u32, u64)| {
            let whole = time_point.regions.get(bits).map_or(0, |region| region.voxels);
            json!({
                "masks": self.names(bits),
                "voxels": voxels,
                "volume_ml": tumor.grid().volume_ml(voxels),
                "share_of_lens": share(voxels, all),
                "share_of_region": share(voxels, whole),
            })
        };
        let ball = (lens.center_mm, lens.radius_mm);
        let of_image = |image: &Context| measure::in_ball("lens", (&image.id, &image.volume), ball);
        json!({
            "time": time_point.label,
            "center_mm": lens.center_mm.to_array(),
            "radius_mm": lens.radius_mm,
            "ball_ml": ball_ml(lens.radius_mm),
            "voxels": all,
            "volume_ml": tumor.grid().volume_ml(all),
            "share_of_union": share(all, time_point.regions.union_voxels()),
            "regions": counts.iter().map(row).collect::<Vec<_>>(),
            "values": time_point.contexts.iter().map(of_image).collect::<Vec<_>>(),
        })
    }

    /// The response as `response --json` has it; null without criteria.
    fn response(&self, own: Option<&Answered>) -> Result<Value, AppError> {
        let Some(answered) = self.response.as_ref().or(own) else { return Ok(Value::Null) };
        let mut value = output::value(&answered.evaluated)?;
        if let Some(object) = value.as_object_mut() {
            object.insert("case".to_owned(), self.case.name.clone().into());
        }
        Ok(value)
    }

    /// The answers to BT-RADS, and the category where they are complete.
    fn bt_rads(&self) -> Value {
        let answered = self.doc.edit.response.bt_rads.iter();
        let of_date = answered.map(|(time, answers)| {
            let category = match bt_rads(answers) {
                Ok(BtRads::Result { category, .. }) => Some(category.id),
                _ => None,
            };
            json!({"time": time, "category": category, "answers": answers})
        });
        of_date.collect()
    }

    /// The comparison of dates as `change --json` has it; null where nothing can be compared.
    fn change(&self, progress: &Progress) -> Result<Value, AppError> {
        if let Some(report) = self.compared.as_ref().filter(|report| report.surroundings.is_some()) {
            return output::value(report);
        }
        let setting = &self.doc.edit.change;
        let Ok(choice) = setting.chosen(&self.case) else { return Ok(Value::Null) };
        let options = setting.options();
        let (report, ..) = change::between_with_surroundings(&self.case, &choice, &options, None, progress)?;
        output::value(&report)
    }
}

/// All numbers as a file.
///
/// # Errors
/// [`AppError`] where JSON can't hold them.
pub fn as_file(numbers: &Value, format: ExportFormat) -> Result<Vec<u8>, AppError> {
    match format {
        ExportFormat::Json => output::json(numbers),
        ExportFormat::Csv => Ok(as_csv(numbers)),
    }
}

/// The document as a table, one row per value: date, what it is of, which quantity (the keys of the document, with
/// units), value. Lists of things with names have no numbers in the quantity unless a name occurs twice.
pub fn as_csv(numbers: &Value) -> Vec<u8> {
    let mut table = csv::Table::new(["time", "of", "quantity", "value"]);
    rows(numbers, &["", ""].map(str::to_owned), "", &mut table);
    table.into_bytes()
}

fn rows(value: &Value, [time, of]: &[String; 2], quantity: &str, table: &mut csv::Table) {
    let text = match value {
        Value::Object(object) => {
            let time = object.get("time").and_then(Value::as_str).map_or_else(|| time.clone(), str::to_owned);
            let of = name_of(object).unwrap_or_else(|| of.clone());
            for (key, inner) in object {
                let quantity = if quantity.is_empty() { key.clone() } else { format!("{quantity}.{key}") };
                rows(inner, &[time.clone(), of.clone()], &quantity, table);
            }
            return;
        }
        Value::Array(list) => {
            let names: Vec<Option<(String, String)>> = list.iter().map(full_name).collect();
            for (index, inner) in list.iter().enumerate() {
                let is_alone =
                    names[index].is_some() && names.iter().filter(|n| **n == names[index]).count() == 1;
                let quantity = if is_alone { quantity.to_owned() } else { format!("{quantity}[{index}]") };
                rows(inner, &[time.clone(), of.clone()], &quantity, table);
            }
            return;
        }
        Value::Null => String::new(),
        Value::String(text) => csv::text(text),
        Value::Bool(_) | Value::Number(_) => value.to_string(),
    };
    table.row([csv::text(time), csv::text(of), quantity.to_owned(), text]);
}

fn full_name(value: &Value) -> Option<(String, String)> {
    let object = value.as_object()?;
    let time = object.get("time").and_then(Value::as_str).map(str::to_owned);
    let name = name_of(object);
    (time.is_some() || name.is_some()).then(|| (time.unwrap_or_default(), name.unwrap_or_default()))
}

/// What an object's numbers are of: a mask, a region, a pair, a level of agreement, a line.
fn name_of(object: &Map<String, Value>) -> Option<String> {
    let text = |key: &str| object.get(key).and_then(Value::as_str).map(str::to_owned);
    let joined = |value: &Value| {
        let ids: Vec<&str> = value.as_array()?.iter().filter_map(Value::as_str).collect();
        Some(ids.join("+"))
    };
    let masks = || joined(object.get("masks")?);
    let region = || joined(object.get("of")?.get("region")?);
    let level = || Some(format!("{} active", object.get("masks")?.as_u64()?));
    let pair = || Some(format!("{} and {}", text("a")?, text("b")?));
    let mask = || text("mask").or_else(|| Some(object.get("of")?.get("mask")?.as_str()?.to_owned()));
    text("id")
        .or_else(mask)
        .or_else(masks)
        .or_else(region)
        .or_else(level)
        .or_else(pair)
        .or_else(|| text("name"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(value: &Value) -> usize {
        match value {
            Value::Object(object) => object.values().map(leaves).sum(),
            Value::Array(list) => list.iter().map(leaves).sum(),
            _ => 1,
        }
    }

    #[test]
    fn the_table_has_a_row_of_its_own_for_every_value() {
        let numbers = json!({
            "case": "x",
            "time_points": [
                {"time": "a", "masks": [{"id": "T1", "volume_ml": 1.5}, {"id": "=T2", "volume_ml": 2}]},
                {"time": "b", "masks": [{"id": "T1", "volume_ml": null}], "pairs": [{"a": "T1", "b": "T2", "dice": 0.5}]},
            ],
            "ellipsoids": {"components": [
                {"of": {"region": ["T1", "T2"]}, "time": "a", "voxels": 3},
                {"of": {"region": ["T1", "T2"]}, "time": "a", "voxels": 4},
            ]},
        });
        let text = String::from_utf8(as_csv(&numbers)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), leaves(&numbers) + 1);
        for expected in [
            "time,of,quantity,value",
            "a,T1,time_points.masks.volume_ml,1.5",
            "a,'=T2,time_points.masks.volume_ml,2",
            "b,T1,time_points.masks.volume_ml,",
            "b,T1 and T2,time_points.pairs.dice,0.5",
            "a,T1+T2,ellipsoids.components[0].voxels,3",
            "a,T1+T2,ellipsoids.components[1].voxels,4",
        ] {
            assert!(lines.contains(&expected), "{expected} in\n{text}");
        }
        let mut keys: Vec<&str> = lines.iter().filter_map(|line| Some(line.rsplit_once(',')?.0)).collect();
        keys.sort_unstable();
        let all = keys.len();
        keys.dedup();
        assert_eq!(keys.len(), all, "no key twice");
    }
}
