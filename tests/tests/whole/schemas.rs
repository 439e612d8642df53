//! What the program writes as JSON against docs/schemas: every output fits, has no key that its schema lacks, and fits no longer
//! once a key is missing or of another type.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use glioscope_tests::real_data;
use jsonschema::{Registry, Resource, Validator};
use serde_json::{Value, json};

use crate::schema_outputs::{ANSWERS, Made, Outputs, WRITTEN, answer, of_real_data};

/// Where the schemas lie for each other: they refer to each other by file names.
const BASE: &str = "https://glioscope.invalid/";
/// The schema of parts, which is of no output.
const COMMON: &str = "common";
/// Keys that an output may lack: schema, key.
const OPTIONAL: [(&str, &str); 7] = [
    ("measure", "statistics"),
    ("measure", "raters"),
    ("measure", "two"),
    ("numbers", "raters"),
    ("change", "self_check"),
    ("info", "cross_check"),
    ("recipe", "response"),
];
/// What is described as no more than an object: schema, place.
const OPEN: (&str, &str) = ("recipe", "/session");

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// The schemas by name.
fn schemas() -> BTreeMap<String, Value> {
    let files = std::fs::read_dir(docs().join("schemas")).unwrap();
    let read = |path: PathBuf| {
        let name =
            path.file_name().unwrap().to_str().unwrap().strip_suffix(".schema.json").unwrap().to_owned();
        (name, serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap())
    };
    files.map(|file| read(file.unwrap().path())).collect()
}

/// Calls `deed` for a schema and all within it.
fn for_each(schema: &mut Value, deed: &mut impl FnMut(&mut serde_json::Map<String, Value>)) {
    match schema {
        Value::Array(list) => list.iter_mut().for_each(|one| for_each(one, deed)),
        Value::Object(object) => {
            deed(object);
            object.values_mut().for_each(|one| for_each(one, deed));
        }
        _ => {}
    }
}

fn is_object(schema: &serde_json::Map<String, Value>) -> bool {
    let is_one = match schema.get("type") {
        Some(Value::Array(types)) => types.contains(&json!("object")),
        Some(name) => *name == "object",
        None => false,
    };
    is_one && schema.contains_key("properties")
}

/// Refuses keys that aren't described.
fn close(schema: &mut Value) {
    for_each(schema, &mut |schema| {
        if is_object(schema) {
            schema.insert("additionalProperties".into(), false.into());
        }
    });
}

/// The validators of all schemas by name.
struct Schemas {
    /// As they are published.
    published: BTreeMap<String, Validator>,
    /// Which refuse keys that aren't described.
    strict: BTreeMap<String, Validator>,
}

impl Schemas {
    fn new() -> Self {
        let published = schemas();
        let mut strict = published.clone();
        strict.values_mut().for_each(close);
        Self { published: validators(&published), strict: validators(&strict) }
    }

    /// What an output has against its schema.
    fn faults(&self, name: &str, output: &Value) -> Vec<String> {
        let both = [&self.published[name], &self.strict[name]];
        let faults = both.iter().flat_map(|one| one.iter_errors(output));
        faults.map(|fault| format!("{}: {fault}", fault.instance_path())).collect()
    }
}

fn validators(schemas: &BTreeMap<String, Value>) -> BTreeMap<String, Validator> {
    let address = |name: &str| format!("{BASE}{name}.schema.json");
    let all = schemas.iter().map(|(name, schema)| (address(name), Resource::from_contents(schema.clone())));
    let registry = Registry::new().extend(all).unwrap().prepare().unwrap();
    let validator = |name: &String| {
        let schema = json!({ "$ref": address(name) });
        (name.clone(), jsonschema::options().with_registry(&registry).build(&schema).unwrap())
    };
    schemas.keys().map(validator).collect()
}

/// Places in a value, as JSON pointers, one for each sequence of keys, whatever the position in lists.
fn places(value: &Value, at: &str, keys: &str, out: &mut BTreeMap<String, String>) {
    out.entry(keys.to_owned()).or_insert_with(|| at.to_owned());
    match value {
        Value::Object(object) => {
            for (key, inner) in object {
                let escaped = key.replace('~', "~0").replace('/', "~1");
                places(inner, &format!("{at}/{escaped}"), &format!("{keys}/{escaped}"), out);
            }
        }
        Value::Array(list) => {
            list.iter()
                .enumerate()
                .for_each(|(n, inner)| places(inner, &format!("{at}/{n}"), &format!("{keys}/*"), out));
        }
        _ => {}
    }
}

/// A value of a type that stands nowhere in place of this one's.
fn of_another_type(value: &Value) -> Value {
    match value {
        Value::Null => json!({}),
        Value::Number(number) if number.is_f64() => json!("1"),
        Value::Number(_) => json!(0.25),
        Value::String(_) => json!(1),
        Value::Bool(_) | Value::Array(_) | Value::Object(_) => json!("true"),
    }
}

/// What a schema overlooks in an output: changes at each place after which the output still fits. Optional keys are collected.
fn overlooked<'a>(
    schemas: &Schemas,
    name: &'a str,
    output: &Value,
    optional: &mut BTreeSet<(&'a str, String)>,
) -> Vec<String> {
    let [published, strict] = [&schemas.published[name], &schemas.strict[name]];
    let (mut found, mut all) = (Vec::new(), BTreeMap::new());
    places(output, "", "", &mut all);
    for (keys, at) in &all {
        if name == OPEN.0 && keys.starts_with(OPEN.1) {
            continue;
        }
        let changed = |deed: &dyn Fn(&mut Value)| {
            let mut changed = output.clone();
            deed(changed.pointer_mut(at).unwrap());
            changed
        };
        if published.is_valid(&changed(&|value| *value = of_another_type(value))) {
            found.push(format!("{name}: another type at {at}"));
        }
        let Some(object) = output.pointer(at).and_then(Value::as_object) else { continue };
        let more = changed(&|value| value["unforeseen"] = 1.into());
        if strict.is_valid(&more) || !published.is_valid(&more) {
            found.push(format!("{name}: a further key at {at}"));
        }
        for key in object.keys() {
            let less = changed(&|value| drop(value.as_object_mut().and_then(|object| object.remove(key))));
            if published.is_valid(&less) {
                optional.insert((name, key.clone()));
            }
        }
    }
    found
}

/// Outputs fit their schemas, and nothing else does.
fn hold(all: &[(&'static str, Outputs)]) {
    let (schemas, made) = (Schemas::new(), Made::new());
    let mut optional = BTreeSet::new();
    for (name, outputs) in all {
        for (number, output) in outputs(&made).iter().enumerate() {
            let faults = schemas.faults(name, output);
            assert!(faults.is_empty(), "{name}, output {number}: {faults:#?}");
            let overlooked = overlooked(&schemas, name, output, &mut optional);
            assert!(overlooked.is_empty(), "output {number}: {overlooked:#?}");
        }
    }
    let of_these = OPTIONAL.iter().filter(|(name, _)| all.iter().any(|(of, _)| of == name));
    let expected = of_these.map(|(name, key)| (*name, (*key).to_owned())).collect();
    assert_eq!(optional, expected, "keys that an output may lack");
}

#[test]
fn every_answer_fits_its_schema_and_nothing_else_does() {
    hold(&ANSWERS);
}

#[test]
fn every_file_written_fits_its_schema_and_nothing_else_does() {
    hold(&WRITTEN);
}

#[test]
fn values_out_of_range_and_unknown_words_are_refused() {
    let schemas = Schemas::new();
    let (report, _) = answer(&["measure", "--sample", "--metrics", "--json"]);
    let pair = "/time_points/0/pairs/0";
    for (place, values, good) in [
        ("/dice", &[json!(-0.1), json!(1.1), json!("infinity")][..], json!(null)),
        ("/hd_mm", &[json!(-1), json!("inf")], json!("infinity")),
        ("/masd_mm", &[json!("infinity")], json!(null)),
        ("/convention", &[json!("own"), json!(null)], json!("medpy")),
        ("/hausdorff/on_reference_mm", &[json!([1, 2]), json!([1, 2, null])], json!([1, 2, 3])),
    ] {
        let with = |value: &Value| {
            let mut changed = report.clone();
            *changed.pointer_mut(&format!("{pair}{place}")).unwrap() = value.clone();
            schemas.faults("measure", &changed)
        };
        assert!(with(&good).is_empty(), "{place}: {good}");
        values.iter().for_each(|value| assert!(!with(value).is_empty(), "{place}: {value}"));
    }
}

#[test]
fn every_schema_is_named_described_and_used() {
    let text = std::fs::read_to_string(docs().join("json.md")).unwrap();
    let mut all = schemas();
    let names: BTreeSet<&str> = all.keys().map(String::as_str).collect();
    let used = ANSWERS.iter().chain(&WRITTEN).map(|(name, _)| *name).chain([COMMON]).collect();
    assert_eq!(names, used);
    for (name, schema) in &mut all {
        assert!(text.contains(&format!("(schemas/{name}.schema.json)")), "{name}");
        if let Err(error) = jsonschema::meta::validate(schema) {
            panic!("{name}: {error}");
        }
        for_each(schema, &mut |schema| {
            if !is_object(schema) {
                return;
            }
            for (key, property) in schema["properties"].as_object().unwrap() {
                let words = property["description"].as_str().unwrap_or_default();
                assert!(!words.is_empty() && !words.contains('\n'), "{name}: {key} isn't described");
                let is_told = ["_mm", "_ml", "_mm2"].iter().all(|end| {
                    let unit = end.trim_start_matches('_').replace('2', "²");
                    !key.ends_with(end) || words.contains(&unit)
                });
                let is_of_numbers = property["type"].to_string().contains("number");
                assert!(is_told || !is_of_numbers, "{name}: {key} without its unit: {words}");
            }
            for key in schema["required"].as_array().unwrap() {
                let is_described = schema["properties"].get(key.as_str().unwrap()).is_some();
                assert!(is_described, "{name}: {key} is required and not described");
            }
        });
    }
}

#[test]
fn outputs_of_real_cases_fit_their_schemas() {
    let schemas = Schemas::new();
    for folder in [
        "glioma-5-algorithms",
        "sarcoma-ct-mr-pet",
        "masks-degenerate",
        "dicom-multimodal",
        "dicom-series",
        "nrrd-mha",
        "nifti-types",
    ] {
        let Some(folder) = real_data(folder) else { continue };
        let all = of_real_data(&folder);
        assert!(!all.is_empty(), "{}", folder.display());
        for (name, arguments) in all {
            let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
            let faults = schemas.faults(name, &answer(&arguments).0);
            assert!(faults.is_empty(), "{arguments:?}: {faults:#?}");
        }
    }
}
