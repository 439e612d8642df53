//! docs/schemas against the types that are serialised: the same keys and words, null where a field is an `Option` and nowhere else,
//! whole numbers where they are. So what a schema says doesn't hang on what examples happen to hold.

use std::collections::{BTreeMap, BTreeSet};

use glioscope_core::measure::conventions::METRICS;
use glioscope_render::LightingMode;
use serde_json::Value;
use strum::VariantArray;
use syn::{Attribute, Fields, Item, Type};

use super::structure::{Outcome, Result, root};

/// A schema (file, place), the types whose fields it describes (source: several where they are flattened), and keys that others add.
type Row = (&'static str, &'static str, &'static str, &'static [&'static str], &'static [&'static str]);

#[rustfmt::skip]
const ROWS: &[Row] = &[
    ("common", "/$defs/checks/items", "core/src/check.rs", &["Check"], &[]),
    ("common", "/$defs/severity", "core/src/check.rs", &["Severity"], &[]),
    ("common", "/$defs/aligned/items", "core/src/case/alignment.rs", &["Aligned"], &[]),
    ("measure", "", "core/src/measure/mod.rs", &["MeasureReport"], &["two"]),
    ("measure", "/$defs/grid", "core/src/measure/mod.rs", &["GridReport"], &[]),
    ("measure", "/$defs/time_point", "core/src/measure/mod.rs", &["TimeReport"], &["raters"]),
    ("measure", "/$defs/mask", "core/src/measure/mod.rs", &["MaskReport"], &[]),
    ("measure", "/$defs/region", "core/src/measure/mod.rs", &["RegionReport"], &[]),
    ("measure", "/$defs/agreement", "core/src/measure/mod.rs", &["Agreement"], &[]),
    ("measure", "/$defs/statistics", "core/src/measure/statistics.rs", &["Statistics"], &[]),
    ("measure", "/$defs/statistics/properties/histogram", "core/src/measure/statistics.rs", &["ValueHistogram"], &[]),
    ("measure", "/$defs/raters", "core/src/measure/compared.rs", &["Raters"], &[]),
    ("measure", "/$defs/raters/properties/staple", "core/src/measure/conventions/raters.rs", &["Staple"], &[]),
    ("measure", "/$defs/compared_pair/properties/hausdorff", "core/src/measure/conventions/compare.rs", &["Hausdorff"], &[]),
    ("measure", "/$defs/compared_pair/properties/convention", "core/src/measure/conventions/convention.rs", &["Convention"], &[]),
    ("measure", "/$defs/lesions", "core/src/measure/conventions/lesions.rs", &["LesionReport"], &[]),
    ("ellipsoids", "", "core/src/ellipsoid/report.rs", &["EllipsoidsReport"], &[]),
    ("ellipsoids", "/$defs/components/items", "core/src/ellipsoid/report.rs", &["ComponentReport", "EllipsoidReport"], &[]),
    ("ellipsoids", "/$defs/components/items/properties/moment", "core/src/ellipsoid/report.rs", &["EllipsoidReport"], &[]),
    ("change", "", "core/src/change/report.rs", &["ChangeReport"], &["self_check"]),
    ("change", "/properties/call", "core/src/change/call.rs", &["Call"], &[]),
    ("self-check", "", "core/src/self_check/report.rs", &["SelfCheckReport"], &[]),
    ("self-check", "/properties/unchanged", "core/src/self_check/report.rs", &["Unchanged"], &[]),
    ("self-check", "/properties/surfaces/items", "core/src/self_check/report.rs", &["SurfaceCheck"], &[]),
    ("self-check", "/properties/lesions/items", "core/src/self_check/report.rs", &["LesionCheck"], &[]),
    ("self-check", "/properties/registration", "core/src/self_check/report.rs", &["RegistrationCheck"], &[]),
    ("self-check", "/$defs/recovered", "core/src/self_check/report.rs", &["Recovered"], &[]),
    ("self-check", "/$defs/where", "core/src/self_check/report.rs", &["Where"], &[]),
    ("self-check", "/$defs/comes", "core/src/self_check/report.rs", &["Comes"], &[]),
    ("change", "/properties/uncertainty_mm", "core/src/change/report.rs", &["UncertaintyReport"], &[]),
    ("change", "/properties/nearest", "core/src/change/report.rs", &["NearestReport"], &[]),
    ("change", "/properties/cavities", "core/src/change/report.rs", &["CavitiesReport"], &[]),
    ("change", "/properties/components/items", "core/src/change/report.rs", &["GroupReport"], &[]),
    (
        "change",
        "/properties/components/items/properties/displacement",
        "core/src/change/report.rs",
        &["DisplacementReport"],
        &[],
    ),
    ("change", "/properties/surroundings", "core/src/change/surroundings.rs", &["SurroundingsReport"], &[]),
    (
        "change",
        "/properties/components/items/properties/tissue",
        "core/src/change/surroundings.rs",
        &["TissueReport"],
        &[],
    ),
    ("change", "/$defs/tissue_counts", "core/src/change/surroundings.rs", &["TissueCounts"], &[]),
    ("change", "/$defs/not_said", "core/src/change/surroundings.rs", &["NotSaid"], &[]),
    ("change", "/$defs/explains", "core/src/change/displacement.rs", &["Explains"], &[]),
    ("change", "/properties/counters", "core/src/change/report.rs", &["Counters"], &[]),
    ("change", "/$defs/parts/items", "core/src/change/report.rs", &["PartReport"], &[]),
    ("change", "/properties/histogram", "core/src/change/stats.rs", &["Histogram"], &[]),
    ("change", "/$defs/lengths", "core/src/change/stats.rs", &["Lengths"], &[]),
    ("change", "/$defs/flag", "core/src/change/mod.rs", &["Flag"], &[]),
    ("change", "/$defs/surface_counters", "core/src/change/mod.rs", &["ChangeCounts"], &[]),
    ("change", "/$defs/fate", "core/src/change/groups.rs", &["Fate"], &[]),
    ("change", "/$defs/skeleton_counters", "core/src/skeleton/mod.rs", &["SkeletonCounts"], &[]),
    ("lesions", "", "core/src/lesions/report.rs", &["LesionsReport"], &[]),
    ("lesions", "/$defs/date", "core/src/lesions/report.rs", &["DateReport"], &[]),
    ("lesions", "/properties/pairs/items", "core/src/lesions/report.rs", &["PairReport"], &[]),
    ("lesions", "/properties/lesions/items", "core/src/lesions/report.rs", &["LesionReport"], &[]),
    ("lesions", "/$defs/lesion_date", "core/src/lesions/report.rs", &["LesionDate"], &[]),
    ("lesions", "/$defs/values", "core/src/lesions/values.rs", &["Values"], &[]),
    ("lesions", "/$defs/surface", "core/src/lesions/values.rs", &["SurfaceMove"], &[]),
    ("lesions", "/properties/events/items", "core/src/lesions/report.rs", &["EventReport"], &[]),
    ("lesions", "/$defs/link", "core/src/lesions/report.rs", &["LinkReport"], &[]),
    ("lesions", "/$defs/event", "core/src/lesions/event.rs", &["EventKind"], &[]),
    ("lesions", "/$defs/linked_by", "core/src/lesions/links.rs", &["LinkedBy"], &[]),
    ("lesions", "/$defs/state", "core/src/lesions/links.rs", &["LinkState"], &[]),
    ("lesions", "/$defs/anchor", "core/src/lesions/edits.rs", &["Anchor"], &[]),
    ("lesions", "/properties/edits_not_applied/items", "core/src/lesions/edits.rs", &["NotApplied"], &[]),
    ("lesions", "/$defs/series", "core/src/lesions/series.rs", &["Series"], &[]),
    ("lesions", "/$defs/series/properties/points/items", "core/src/lesions/series.rs", &["Point"], &[]),
    ("lesions", "/$defs/series/properties/growth", "core/src/lesions/series.rs", &["Growth"], &[]),
    ("lesions", "/$defs/series/properties/changes/items", "core/src/lesions/series.rs", &["ChangePointReport"], &[]),
    ("lesions", "/$defs/change_kind", "core/src/lesions/change_point.rs", &["ChangePointKind"], &[]),
    ("lesions", "/$defs/mode", "core/src/lesions/diameters/mod.rs", &["DiameterMode"], &[]),
    ("lesions", "/$defs/chord", "core/src/lesions/diameters/mod.rs", &["Chord"], &[]),
    ("response", "/properties/dates/items", "core/src/response/result.rs", &["DateResponse"], &[]),
    ("response", "/$defs/judgement", "core/src/response/result.rs", &["Judgement"], &[]),
    ("response", "/$defs/judgement/properties/confirmation", "core/src/response/result.rs", &["Confirmation"], &[]),
    ("response", "/$defs/judgement/properties/reasons/items", "core/src/response/result.rs", &["Reason"], &[]),
    ("response", "/$defs/judgement/properties/missing/items", "core/src/response/result.rs", &["Missing"], &[]),
    ("response", "/$defs/sum", "core/src/response/result.rs", &["SumReport"], &[]),
    ("response", "/$defs/sum/properties/lesions/items", "core/src/response/result.rs", &["TargetReport"], &[]),
    ("response", "/$defs/reference", "core/src/response/result.rs", &["Reference"], &[]),
    ("response", "/$defs/margin", "core/src/response/margin.rs", &["Margin"], &[]),
    ("response", "/$defs/call", "core/src/response/result.rs", &["Call"], &[]),
    ("response", "/$defs/confirmed", "core/src/response/result.rs", &["Confirmed"], &[]),
    ("response", "/$defs/quantity", "core/src/response/result.rs", &["Quantity"], &[]),
    ("response", "/$defs/category", "core/src/response/result.rs", &["Category"], &[]),
    ("response", "/$defs/input", "core/src/response/missing.rs", &["Input"], &[]),
    ("response", "/$defs/rule", "core/src/response/rules.rs", &["RuleId"], &[]),
    ("response", "/$defs/criterion", "core/src/response/rules.rs", &["Criterion"], &[]),
    ("response", "/$defs/assessment", "core/src/response/history.rs", &["Assessment"], &[]),
    ("response", "/$defs/compartment", "core/src/response/history.rs", &["Compartment"], &[]),
    ("response", "", "core/src/response/measured.rs", &["Evaluated"], &["case", "criterion", "assessment", "dates"]),
    ("tracts", "", "app/src/cli/tracts.rs", &["TractsReport"], &[]),
    ("tracts", "/properties/tracts/items", "app/src/cli/tracts.rs", &["TractReport"], &[]),
    ("info", "/$defs/studies", "core/src/files/dicom/info.rs", &["Tree"], &[]),
    ("info", "/$defs/studies/properties/patients/items", "core/src/files/dicom/info.rs", &["TreePatient"], &[]),
    ("info", "/$defs/studies/properties/patients/items/properties/studies/items", "core/src/files/dicom/info.rs", &["TreeStudy"], &[]),
    ("info", "/$defs/series", "core/src/files/dicom/info.rs", &["TreeSeries"], &[]),
    ("info", "/$defs/series/properties/volumes/items", "core/src/files/dicom/study.rs", &["VolumeSummary"], &[]),
    ("info", "/$defs/segments/items", "core/src/files/dicom/info.rs", &["NamedSegment"], &[]),
    ("info", "/$defs/dicom_file", "core/src/files/dicom/info.rs", &["Info"], &[]),
    ("info", "/$defs/dicom_file/properties/volumes/items", "core/src/files/dicom/info.rs", &["Volume"], &[]),
    ("info", "/$defs/nifti_file", "core/src/files/nifti.rs", &["HeaderInfo"], &["cross_check"]),
    ("info", "/$defs/nifti_version", "core/src/files/nifti_header.rs", &["Version"], &[]),
    ("info", "/$defs/byte_order", "core/src/files/nifti_header.rs", &["ByteOrder"], &[]),
    ("info", "/$defs/datatype", "core/src/files/nifti_header.rs", &["SampleType"], &[]),
    ("info", "/$defs/form", "core/src/files/nifti_space.rs", &["Form"], &[]),
    ("info", "/$defs/image_file", "core/src/files/image.rs", &["ImageInfo"], &[]),
    ("info", "/$defs/image_file/properties/segments/items", "core/src/files/mod.rs", &["Segment"], &[]),
    ("info", "/$defs/cross_check", "core/src/files/cross_check.rs", &["CrossCheck"], &[]),
    ("info", "/$defs/cross_check/properties/dims", "core/src/files/cross_check.rs", &["BothReaders"], &[]),
    ("info", "/$defs/cross_check/properties/affine", "core/src/files/cross_check.rs", &["AffineCheck", "BothReaders"], &[]),
    ("info", "/$defs/cross_check/properties/values", "core/src/files/cross_check.rs", &["ValueCheck"], &[]),
    ("cohort-status", "", "cohort/src/status.rs", &["CaseStatus"], &[]),
    ("cohort-status", "/properties/steps/items", "cohort/src/status.rs", &["StepStatus"], &[]),
    ("cohort-status", "/$defs/options", "cohort/src/options.rs", &["Options"], &[]),
    ("cohort-status", "/$defs/state", "cohort/src/status.rs", &["State"], &[]),
    ("cohort-status", "/$defs/step", "cohort/src/options.rs", &["Step"], &[]),
    ("cohort-status", "/$defs/files/items", "cohort/src/hashes.rs", &["HashedFile"], &[]),
    ("cohort-tables", "", "cohort/src/tables/mod.rs", &["Dictionary"], &[]),
    ("cohort-tables", "/properties/tables/items", "cohort/src/tables/kinds.rs", &["Kind"], &[]),
    ("cohort-tables", "/properties/tables/items/properties/columns/items", "cohort/src/tables/kinds.rs", &["Column"], &[]),
    ("cohort-tables", "/$defs/kind", "cohort/src/tables/kinds.rs", &["Type"], &[]),
    ("study", "", "cohort/src/study/mod.rs", &["StudyReport"], &[]),
    ("study", "/$defs/task", "cohort/src/study/mod.rs", &["TaskReport"], &[]),
    ("study", "/$defs/measured", "cohort/src/study/mod.rs", &["MeasureReport"], &[]),
    ("study", "/$defs/measure", "cohort/src/study/mod.rs", &["Measure"], &[]),
    ("study", "/$defs/mean", "cohort/src/study/mod.rs", &["LightMean"], &[]),
    ("study", "/$defs/anova", "cohort/src/study/anova.rs", &["Anova"], &[]),
    ("study", "/$defs/mauchly", "cohort/src/study/anova.rs", &["Mauchly"], &[]),
    ("study", "/$defs/comparison", "cohort/src/study/paired.rs", &["Comparison"], &[]),
    ("study", "/$defs/correlation", "cohort/src/study/paired.rs", &["Correlation"], &[]),
    ("transfer", "", "render/src/image/transfer/mod.rs", &["TransferFunction"], &["glioscope_transfer"]),
    ("transfer", "/properties/points/items", "render/src/image/transfer/mod.rs", &["ControlPoint"], &[]),
    ("transfer", "/properties/gradient/items", "render/src/image/transfer/mod.rs", &["GradientPoint"], &[]),
    ("transfer", "/properties/shapes/items", "render/src/image/transfer/shape.rs", &["Shape"], &[]),
    ("transfer", "/$defs/form", "render/src/image/transfer/shape.rs", &["Form"], &["box", "trapezoid", "blob"]),
    ("recipe", "", "app/src/report/recipe.rs", &["Recipe"], &[]),
    ("recipe", "/properties/inputs/items", "app/src/report/recipe.rs", &["Input"], &[]),
    ("recipe", "/properties/response", "app/src/report/recipe.rs", &["ResponseRecipe"], &[]),
    ("recipe", "/$defs/identity", "app/src/report/identity.rs", &["Identity"], &[]),
    ("recipe", "/$defs/language", "app/src/words.rs", &["Language"], &[]),
];

/// The schemas by name.
struct Schemas(BTreeMap<&'static str, Value>);

impl Schemas {
    fn read() -> Result<Self> {
        let folder = root()?.join("docs/schemas");
        let names: BTreeSet<&str> = ROWS.iter().map(|row| row.0).chain(["stats"]).collect();
        let read = |name: &'static str| -> Result<(&'static str, Value)> {
            let text = std::fs::read_to_string(folder.join(format!("{name}.schema.json")))?;
            Ok((name, serde_json::from_str(&text)?))
        };
        Ok(Self(names.into_iter().map(read).collect::<Result<_>>()?))
    }

    fn at(&self, name: &str, place: &str) -> Result<&Value> {
        self.0
            .get(name)
            .and_then(|schema| schema.pointer(place))
            .ok_or_else(|| format!("{name}{place}: absent").into())
    }

    /// The JSON types that a schema allows.
    fn types(&self, name: &str, schema: &Value) -> Result<BTreeSet<String>> {
        if let Some(reference) = schema["$ref"].as_str() {
            let (file, place) = reference.split_once('#').unwrap_or((reference, ""));
            let file = if file.is_empty() { name } else { file.trim_end_matches(".schema.json") };
            return self.types(file, self.at(file, place)?);
        }
        let list = |key: &str| schema[key].as_array().into_iter().flatten();
        let mut out: BTreeSet<String> =
            list("type").chain([&schema["type"]]).filter_map(Value::as_str).map(str::to_owned).collect();
        for one in list("anyOf").chain(list("oneOf")) {
            out.extend(self.types(name, one)?);
        }
        out.extend(list("enum").chain(schema.get("const")).map(|word| type_of(word).to_owned()));
        Ok(out)
    }
}

fn type_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(number) if number.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    }
}

/// What `#[serde(...)]` says: words with their values, empty for those without.
fn serde(attributes: &[Attribute]) -> Result<BTreeMap<String, String>> {
    let mut out = BTreeMap::new();
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("serde")) {
        attribute.parse_nested_meta(|meta| {
            let word = meta.path.get_ident().map(ToString::to_string).unwrap_or_default();
            let value = meta.value().and_then(|value| value.parse::<syn::LitStr>());
            out.insert(word, value.map(|text| text.value()).unwrap_or_default());
            Ok(())
        })?;
    }
    Ok(out)
}

/// The name of a variant as `rename_all` says.
fn renamed(variant: &str, rule: &str) -> Result<String> {
    let separated = |mark: &str| {
        let word = |(n, c): (usize, char)| {
            let mark = if n > 0 && c.is_uppercase() { mark } else { "" };
            format!("{mark}{}", c.to_lowercase())
        };
        variant.char_indices().map(word).collect::<String>()
    };
    match rule {
        "snake_case" => Ok(separated("_")),
        "kebab-case" => Ok(separated("-")),
        "lowercase" => Ok(variant.to_lowercase()),
        _ => Err(format!("{variant}: the rule {rule:?} isn't known here").into()),
    }
}

/// The JSON types of a field, without null; `None` where they depend on another type.
fn types_of(of: &Type) -> Option<BTreeSet<String>> {
    let one = |name: &str| Some(BTreeSet::from([name.to_owned()]));
    match of {
        Type::Reference(reference) => types_of(&reference.elem),
        Type::Array(_) | Type::Slice(_) | Type::Tuple(_) => one("array"),
        Type::Path(path) => match path.path.segments.last()?.ident.to_string().as_str() {
            "Vec" | "DVec3" | "DAffine3" => one("array"),
            "String" | "str" => one("string"),
            "bool" => one("boolean"),
            "f64" => one("number"),
            "u8" | "u32" | "u64" | "usize" | "i32" | "i64" => one("integer"),
            _ => None,
        },
        _ => None,
    }
}

/// What an `Option` holds.
fn inner(of: &Type) -> Option<&Type> {
    let Type::Path(path) = of else { return None };
    let last = path.path.segments.last().filter(|last| last.ident == "Option")?;
    let syn::PathArguments::AngleBracketed(arguments) = &last.arguments else { return None };
    arguments
        .args
        .iter()
        .find_map(|argument| if let syn::GenericArgument::Type(of) = argument { Some(of) } else { None })
}

/// What a schema and the types of a source disagree in.
fn faults(schemas: &Schemas, (name, place, _, types, more): &Row, source: &str) -> Result<Vec<String>> {
    let schema = schemas.at(name, place)?;
    let (mut found, parsed) = (Vec::new(), syn::parse_file(source)?);
    let mut keys: BTreeSet<String> = more.iter().map(|key| (*key).to_owned()).collect();
    let mut optional: BTreeSet<String> = BTreeSet::new();
    for of in *types {
        let item = parsed.items.iter().find(|item| match item {
            Item::Struct(item) => item.ident == of,
            Item::Enum(item) => item.ident == of,
            _ => false,
        });
        match item {
            Some(Item::Enum(item)) => {
                let rule = serde(&item.attrs)?.remove("rename_all").unwrap_or_default();
                let word = |variant: &syn::Variant| match serde(&variant.attrs)?.remove("rename") {
                    Some(name) => Ok(name),
                    None => renamed(&variant.ident.to_string(), &rule),
                };
                keys.extend(item.variants.iter().map(word).collect::<Result<Vec<_>>>()?);
            }
            Some(Item::Struct(item)) => {
                let Fields::Named(fields) = &item.fields else {
                    return Err(format!("{of}: no named fields").into());
                };
                for field in &fields.named {
                    let said = serde(&field.attrs)?;
                    if said.contains_key("flatten") || said.contains_key("skip") {
                        continue;
                    }
                    let key = field.ident.as_ref().map(ToString::to_string).unwrap_or_default();
                    let is_left_out = said.contains_key("skip_serializing_if");
                    let allowed = schemas.types(name, &schema["properties"][&key])?;
                    let null = BTreeSet::from(["null".to_owned()]);
                    let is_option = inner(&field.ty).is_some() && !is_left_out;
                    let expected = types_of(inner(&field.ty).unwrap_or(&field.ty))
                        .filter(|_| !said.contains_key("serialize_with"));
                    let is_exact = expected.is_none_or(|expected| allowed.difference(&null).eq(&expected));
                    if !is_exact || allowed.contains("null") != is_option {
                        found.push(format!("{name}{place}: {key} may be {allowed:?}, but not as {of} says"));
                    }
                    optional.extend(is_left_out.then(|| key.clone()));
                    keys.insert(key);
                }
            }
            _ => return Err(format!("{of}: no such type").into()),
        }
    }
    let list =
        |key: &str| schema[key].as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned);
    let described: BTreeSet<String> = match schema["properties"].as_object() {
        Some(properties) => properties.keys().cloned().collect(),
        None => list("enum").collect(),
    };
    if described != keys {
        found.push(format!(
            "{name}{place}: {:?} differ",
            described.symmetric_difference(&keys).collect::<Vec<_>>()
        ));
    }
    if schema["properties"].is_object() {
        let may_lack: Vec<String> = keys.difference(&list("required").collect()).cloned().collect();
        found.extend(
            may_lack
                .iter()
                .filter(|key| !optional.contains(*key) && !more.contains(&key.as_str()))
                .map(|key| format!("{name}{place}: {key} isn't required")),
        );
    }
    Ok(found)
}

#[test]
fn schemas_say_what_the_types_say() -> Outcome {
    let (root, schemas) = (root()?, Schemas::read()?);
    for row in ROWS {
        let source = std::fs::read_to_string(root.join(row.2))?;
        let faults = faults(&schemas, row, &source).map_err(|error| format!("{}: {error}", row.2))?;
        assert!(faults.is_empty(), "{faults:#?}");
    }
    // Of types whose keys are those of tables.
    let pair = schemas.at("measure", "/$defs/compared_pair/properties")?;
    let lacking: Vec<&str> = METRICS
        .iter()
        .map(|row| row.key)
        .filter(|key| *key != "hd95_mm" && pair.get(key).is_none())
        .collect();
    assert!(lacking.is_empty(), "{lacking:?}");
    let modes =
        LightingMode::VARIANTS.iter().map(serde_json::to_value).collect::<std::result::Result<Value, _>>()?;
    assert_eq!(schemas.at("stats", "/$defs/mode/enum")?, &modes);
    Ok(())
}

#[test]
fn what_a_schema_and_a_type_disagree_in_is_found() -> Outcome {
    let schemas = Schemas::read()?;
    let faults = |row: &Row, source: &str| faults(&schemas, row, source);
    let severity = ("common", "/$defs/severity", "", &["Severity"][..], &[][..]);
    let of = |variants: &str| format!("#[serde(rename_all = \"lowercase\")] enum Severity {{ {variants} }}");
    assert!(faults(&severity, &of("Note, Warning, Error"))?.is_empty());
    assert_eq!(faults(&severity, &of("Note, Warning, Error, Fatal"))?.len(), 1);
    assert_eq!(faults(&severity, &of("Note, Warning"))?.len(), 1);
    let lengths = ("change", "/$defs/lengths", "", &["Lengths"][..], &[][..]);
    let of = |count: &str, mm: &str, more: &str| {
        format!(
            "struct Lengths {{ count: {count}, mean_mm: {mm}, p50_mm: Option<f64>, p95_mm: Option<f64>, max_mm: Option<f64>{more} }}"
        )
    };
    assert!(faults(&lengths, &of("usize", "Option<f64>", ""))?.is_empty());
    for (count, mm, more) in [
        ("f64", "Option<f64>", ""),
        ("Option<usize>", "Option<f64>", ""),
        ("usize", "f64", ""),
        ("usize", "Option<String>", ""),
        ("usize", "Option<f64>", ", #[serde(skip)] other: u8, sd_mm: f64"),
    ] {
        assert!(!faults(&lengths, &of(count, mm, more))?.is_empty(), "{count} {mm} {more}");
    }
    Ok(())
}
