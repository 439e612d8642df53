//! Rows of tables from the answers of the command line.

use serde_json::{Map, Value};

use super::{
    Field,
    kinds::{CHANGES, LESIONS, MASKS, PAIRS, REGIONS, RESPONSES},
};
use crate::Step;

/// Keys of a pair that are no metric.
const NO_METRICS: [&str; 7] =
    ["a", "b", "convention", "percentile", "tolerance_mm", "hausdorff", "no_distances"];
/// The key of a pair under which the metrics of its lesions are.
const OF_LESIONS: &str = "lesions";
/// How JSON says that a number is infinite.
const INFINITE: &str = "infinity";

/// The rows of an answer: position of the table in [`KINDS`](super::KINDS), and the row.
pub(crate) fn rows_of(step: Step, case: &str, answer: &Value) -> Vec<(usize, Vec<Field>)> {
    match step {
        Step::Measure | Step::Metrics => measured(case, answer),
        Step::Lesions => lesions(case, answer),
        Step::Change => vec![(CHANGES, change(case, answer))],
        Step::Response => responses(case, answer),
        Step::Report | Step::Pictures => Vec::new(),
    }
}

fn list<'a>(value: &'a Value, key: &str) -> impl Iterator<Item = &'a Value> + use<'a> {
    value[key].as_array().into_iter().flatten()
}

fn text(value: &Value) -> Field {
    Field::text(value.as_str())
}

fn whole(value: &Value) -> Field {
    value.as_i64().map_or(Field::Null, Field::Whole)
}

/// A number; JSON says infinity in words.
fn number_of(value: &Value) -> Option<f64> {
    if value.as_str() == Some(INFINITE) { Some(f64::INFINITY) } else { value.as_f64() }
}

fn number(value: &Value) -> Field {
    Field::number(number_of(value))
}

fn bool(value: &Value) -> Field {
    value.as_bool().map_or(Field::Null, Field::Bool)
}

/// Words joined by +; no words are an empty text.
fn joined<'a>(words: impl Iterator<Item = &'a Value>) -> Field {
    Field::Text(words.filter_map(Value::as_str).collect::<Vec<_>>().join("+"))
}

fn measured(case: &str, answer: &Value) -> Vec<(usize, Vec<Field>)> {
    let name = || Field::Text(case.to_owned());
    let mut rows = Vec::new();
    for time in list(answer, "time_points") {
        for mask in list(time, "masks") {
            let row = vec![
                name(),
                text(&time["time"]),
                text(&mask["id"]),
                whole(&mask["voxels"]),
                number(&mask["volume_ml"]),
                whole(&mask["native_voxels"]),
                number(&mask["native_volume_ml"]),
                number(&mask["expected_volume_ml"]),
                number(&mask["share"]),
            ];
            rows.push((MASKS, row));
        }
        for region in list(time, "regions") {
            let row = vec![
                name(),
                text(&time["time"]),
                joined(list(region, "masks")),
                Field::Whole(list(region, "masks").count() as i64),
                whole(&region["voxels"]),
                number(&region["volume_ml"]),
                number(&region["share"]),
            ];
            rows.push((REGIONS, row));
        }
        for pair in list(time, "pairs") {
            for (metric, value) in metrics(pair) {
                let row = vec![
                    name(),
                    text(&time["time"]),
                    text(&pair["a"]),
                    text(&pair["b"]),
                    text(&pair["convention"]),
                    number(&pair["percentile"]),
                    number(&pair["tolerance_mm"]),
                    Field::Text(metric),
                    Field::number(value),
                ];
                rows.push((PAIRS, row));
            }
        }
    }
    rows
}

/// The metrics of a pair by their keys, in alphabetical order.
fn metrics(pair: &Value) -> Vec<(String, Option<f64>)> {
    let is_value = |value: &Value| value.is_null() || number_of(value).is_some();
    let empty = Map::new();
    let own = pair.as_object().unwrap_or(&empty).iter();
    let own = own.filter(|(key, _)| !NO_METRICS.contains(&key.as_str()) && *key != OF_LESIONS);
    let of_lesions = pair[OF_LESIONS].as_object().unwrap_or(&empty).iter();
    let of_lesions = of_lesions.map(|(key, value)| (format!("{OF_LESIONS}_{key}"), value));
    let all = own.map(|(key, value)| (key.clone(), value)).chain(of_lesions);
    let mut all: Vec<_> =
        all.filter(|(_, value)| is_value(value)).map(|(key, value)| (key, number_of(value))).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

/// A value of a pair that has a mask and a reference.
#[derive(Debug, PartialEq)]
pub(crate) struct PairValue {
    pub date: String,
    pub mask: String,
    pub metric: String,
    pub value: Option<f64>,
    /// Whether the reference is the first of the pair, with which the other was compared.
    pub is_reference_first: bool,
}

/// The values of `metrics` between `reference` and every other mask, from the answer of the first step.
pub(crate) fn pair_values(answer: &Value, reference: &str, wanted: &[String]) -> Vec<PairValue> {
    let mut found = Vec::new();
    for time in list(answer, "time_points") {
        for pair in list(time, "pairs") {
            let (mask, is_reference_first) =
                match [&pair["a"], &pair["b"]].map(|id| id.as_str().unwrap_or_default()) {
                    [a, b] if a == reference => (b, true),
                    [a, b] if b == reference => (a, false),
                    _ => continue,
                };
            let date = time["time"].as_str().unwrap_or_default();
            for (metric, value) in metrics(pair).into_iter().filter(|(metric, _)| wanted.contains(metric)) {
                let (date, mask) = (date.to_owned(), mask.to_owned());
                found.push(PairValue { date, mask, metric, value, is_reference_first });
            }
        }
    }
    found
}

fn lesions(case: &str, answer: &Value) -> Vec<(usize, Vec<Field>)> {
    let mut rows = Vec::new();
    for lesion in list(answer, "lesions") {
        for date in list(lesion, "dates") {
            let components = if date["volume_ml"].is_null() {
                Field::Null
            } else {
                Field::Whole(list(date, "parts").count() as i64)
            };
            let row = vec![
                Field::Text(case.to_owned()),
                text(&answer["of"]),
                text(&lesion["id"]),
                text(&lesion["name"]),
                text(&date["time"]),
                number(&date["days"]),
                number(&date["volume_ml"]),
                components,
                number(&date["d1_mm"]),
                number(&date["d2_mm"]),
                number(&date["product_mm2"]),
                bool(&date["measurable"]),
                bool(&lesion["small"]),
                joined(list(date, "events")),
                text(&date["state"]),
            ];
            rows.push((LESIONS, row));
        }
    }
    rows
}

fn change(case: &str, answer: &Value) -> Vec<Field> {
    let mut row =
        vec![Field::Text(case.to_owned()), text(&answer["mask"]), text(&answer["from"]), text(&answer["to"])];
    row.extend(["from_ml", "to_ml", "kept_ml", "gone_ml", "new_ml"].map(|key| number(&answer[key])));
    row.extend(["vectors", "within_uncertainty"].map(|key| whole(&answer[key])));
    for way in ["growth", "recession"] {
        row.extend(["mean_mm", "p50_mm", "p95_mm", "max_mm"].map(|key| number(&answer[way][key])));
    }
    row.push(number(&answer["uncertainty_mm"]["registration_mm"]));
    row.push(joined(list(answer, "flags")));
    row
}

fn responses(case: &str, answer: &Value) -> Vec<(usize, Vec<Field>)> {
    let mut rows = Vec::new();
    for date in list(answer, "dates") {
        for by in ["diameters", "volume"] {
            let judgement = &date[format!("by_{by}")];
            let row = vec![
                Field::Text(case.to_owned()),
                text(&answer["criterion"]),
                text(&answer["assessment"]),
                text(&date["date"]),
                whole(&date["days_from_baseline"]),
                Field::Text(by.to_owned()),
                text(&judgement["call"]),
                joined(list(judgement, "possible")),
                text(&judgement["confirmation"]["state"]),
                bool(&judgement["imaging_only"]),
                joined(list(judgement, "reasons").map(|reason| &reason["rule"])),
                joined(list(judgement, "missing").map(|missing| &missing["input"])),
            ];
            rows.push((RESPONSES, row));
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::KINDS;
    use serde_json::json;

    #[test]
    fn pairs_are_long_with_infinite_and_undefined_values_and_those_of_lesions() {
        let pair = json!({
            "a": "ref", "b": "x", "convention": "brats", "percentile": 95.0, "tolerance_mm": 1.0, "dice": 0.0, "hd95_mm": "infinity",
            "nsd": null, "hausdorff": {"distance_mm": 1.0}, "no_distances": null, "lesions": {"found": 2, "f1": null},
        });
        let answer = json!({"time_points": [{"time": "t", "pairs": [pair]}]});
        let rows = rows_of(Step::Metrics, "c", &answer);
        let values: Vec<(Field, Field)> =
            rows.iter().map(|(_, row)| (row[7].clone(), row[8].clone())).collect();
        let of = |key: &str, value: Field| (Field::Text(key.into()), value);
        assert_eq!(
            values,
            [
                of("dice", Field::Number(0.0)),
                of("hd95_mm", Field::Number(f64::INFINITY)),
                of("lesions_f1", Field::Null),
                of("lesions_found", Field::Number(2.0)),
                of("nsd", Field::Null),
            ]
        );
        let wanted = ["dice".to_owned()];
        for reference in ["ref", "x"] {
            let other = if reference == "x" { "ref" } else { "x" };
            let [date, mask, metric] = ["t", other, "dice"].map(str::to_owned);
            let is_reference_first = reference == "ref";
            let expected = PairValue { date, mask, metric, value: Some(0.0), is_reference_first };
            assert_eq!(pair_values(&answer, reference, &wanted), [expected]);
        }
        assert!(pair_values(&answer, "y", &wanted).is_empty());
    }

    #[test]
    fn every_row_has_a_field_of_its_columns_type() {
        let judgement = json!({"call": "sd", "possible": ["sd", "pd"], "confirmation": {"state": "yes"}, "imaging_only": true,
            "reasons": [{"rule": "r"}], "missing": [{"input": "steroids"}]});
        let lengths = json!({"mean_mm": 1.0, "p50_mm": 1.0, "p95_mm": 2.0, "max_mm": 3.0});
        let answers = [
            (
                Step::Measure,
                json!({"time_points": [{"time": "t",
                "masks": [{"id": "m", "voxels": 1, "volume_ml": 1.0, "native_voxels": 1, "native_volume_ml": 1.0,
                    "expected_volume_ml": 1.0, "share": 1.0}],
                "regions": [{"masks": ["m", "n"], "voxels": 1, "volume_ml": 1.0, "share": 1.0}],
                "pairs": [{"a": "m", "b": "n", "convention": "x", "percentile": 1.0, "tolerance_mm": 1.0, "dice": 1.0}]}]}),
            ),
            (
                Step::Lesions,
                json!({"of": "m", "lesions": [{"id": "A", "name": "n", "small": false, "dates": [{"time": "t",
                "days": 0.0, "volume_ml": 1.0, "d1_mm": 1.0, "d2_mm": 1.0, "product_mm2": 1.0, "measurable": true,
                "events": ["born"], "state": "proposed", "parts": [{}]}]}]}),
            ),
            (
                Step::Change,
                json!({"mask": "m", "from": "a", "to": "b", "from_ml": 1.0, "to_ml": 1.0, "kept_ml": 1.0,
                "gone_ml": 1.0, "new_ml": 1.0, "vectors": 1, "within_uncertainty": 1, "growth": lengths, "recession": lengths,
                "uncertainty_mm": {"registration_mm": 0.5}, "flags": ["appeared"]}),
            ),
            (
                Step::Response,
                json!({"criterion": "c", "assessment": "a", "dates": [{"date": "t", "days_from_baseline": 3,
                "by_diameters": judgement, "by_volume": judgement}]}),
            ),
        ];
        let mut tables = std::collections::BTreeSet::new();
        for (step, answer) in &answers {
            for (table, row) in rows_of(*step, "c", answer) {
                tables.insert(table);
                let types: Vec<Option<crate::Type>> = row
                    .iter()
                    .map(|field| match field {
                        Field::Null => None,
                        Field::Text(_) => Some(crate::Type::Text),
                        Field::Whole(_) => Some(crate::Type::Whole),
                        Field::Number(_) => Some(crate::Type::Number),
                        Field::Bool(_) => Some(crate::Type::Bool),
                    })
                    .collect();
                let expected: Vec<Option<crate::Type>> =
                    KINDS[table].columns.iter().map(|column| Some(column.kind)).collect();
                assert_eq!(types, expected, "{}", KINDS[table].name);
            }
        }
        assert_eq!(
            tables.into_iter().collect::<Vec<_>>(),
            [MASKS, REGIONS, PAIRS, LESIONS, CHANGES, RESPONSES]
        );
    }
}
