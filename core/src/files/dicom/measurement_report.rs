//! Writing measurements as a structured report (PS3.16 TID 1500, Measurement Report).
//!
//! Enhanced SR Storage: nothing in it is a coordinate. Comprehensive 3D SR exists for coordinates in the patient and for
//! content by reference, and a program that reads it reads Enhanced SR, not the other way round. A mask that was read from a
//! segmentation is a group by TID 1411, which requires the segment; any other is one by TID 1501, which requires no region.

use super::super::FileError;
use super::report_write::{Reference, ReportTo, TITLE, by_study, files_of, plain};
use super::source_image::SourceImage;
use super::source_segment::SourceSegment;
use super::tags;
use super::write::{Elements, decimal};

/// Enhanced SR Storage.
const SOP_CLASS: &str = "1.2.840.10008.5.1.4.1.1.88.22";

/// What messages call it.
const WHAT: &str = "structured report";

/// Code value, coding scheme and meaning.
type Code = [&'static str; 3];

const LANGUAGE: Code = ["121049", "DCM", "Language of Content Item and Descendants"];
const ENGLISH: Code = ["en", "RFC5646", "English"];
const OBSERVER_TYPE: Code = ["121005", "DCM", "Observer Type"];
const DEVICE: Code = ["121007", "DCM", "Device"];
const DEVICE_UID: Code = ["121012", "DCM", "Device Observer UID"];
const DEVICE_NAME: Code = ["121013", "DCM", "Device Observer Name"];
const DEVICE_MANUFACTURER: Code = ["121014", "DCM", "Device Observer Manufacturer"];
const DEVICE_MODEL: Code = ["121015", "DCM", "Device Observer Model Name"];
const PROCEDURE: Code = ["121058", "DCM", "Procedure reported"];
const IMAGING: Code = ["363679005", "SCT", "Imaging procedure"];
const IMAGE_LIBRARY: Code = ["111028", "DCM", "Image Library"];
const IMAGE_GROUP: Code = ["126200", "DCM", "Image Library Group"];
const MODALITY: Code = ["121139", "DCM", "Modality"];
const FRAME_OF_REFERENCE: Code = ["112227", "DCM", "Frame of Reference UID"];
const MEASUREMENTS: Code = ["126010", "DCM", "Imaging Measurements"];
const GROUP: Code = ["125007", "DCM", "Measurement Group"];
const TRACKING: Code = ["112039", "DCM", "Tracking Identifier"];
const TRACKING_UID: Code = ["112040", "DCM", "Tracking Unique Identifier"];
const FINDING: Code = ["121071", "DCM", "Finding"];
// What a mask is of isn't known, as in segmentations that are written.
const TISSUE: Code = ["85756007", "SCT", "Tissue"];
const LESION: Code = ["52988006", "SCT", "Lesion"];
const TIME_POINT: Code = ["C2348792", "UMLS", "Time Point"];
const TIME_POINT_ORDER: Code = ["126073", "DCM", "Time Point Order"];
const SEGMENT: Code = ["121191", "DCM", "Referenced Segment"];
const SEGMENTED_SERIES: Code = ["121232", "DCM", "Source series for segmentation"];
const VOLUME: Code = ["118565006", "SCT", "Volume"];
const LONG_AXIS: Code = ["103339001", "SCT", "Long axis"];
const PERPENDICULAR_AXIS: Code = ["131189007", "SCT", "Perpendicular Axis"];
// The standard has no code for it.
const PRODUCT: Code = ["PERP_PRODUCT", PRIVATE, "Product of perpendicular diameters"];
const EVALUATION: Code = ["112020", "DCM", "Response Evaluation"];
const EVALUATION_METHOD: Code = ["112021", "DCM", "Response Evaluation Method"];
const RANO: Code = ["C114879", "NCIt", "RANO"];
const CRITERIA: Code = ["CRITERIA", PRIVATE, "Response criteria and measure"];
/// The scheme of codes that the standard has none for.
const PRIVATE: &str = "99GLIOSCOPE";
const ML: Code = ["ml", "UCUM", "ml"];
const MM: Code = ["mm", "UCUM", "mm"];
const MM2: Code = ["mm2", "UCUM", "square millimeter"];
const NO_UNITS: Code = ["1", "UCUM", "no units"];

/// What images are by the start of their SOP class, and the procedure that took them (PS3.16 CID 29, CID 100).
const MODALITIES: [(&[&str], Code, Code); 3] = [
    (
        &["1.2.840.10008.5.1.4.1.1.4", "1.2.840.10008.5.1.4.1.1.4.1", "1.2.840.10008.5.1.4.1.1.4.4"],
        ["MR", "DCM", "Magnetic Resonance"],
        ["25056-3", "LN", "MRI unspecified body region"],
    ),
    (
        &["1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.2.1", "1.2.840.10008.5.1.4.1.1.2.2"],
        ["CT", "DCM", "Computed Tomography"],
        ["25045-6", "LN", "CT unspecified body region"],
    ),
    (
        &["1.2.840.10008.5.1.4.1.1.128", "1.2.840.10008.5.1.4.1.1.128.1", "1.2.840.10008.5.1.4.1.1.130"],
        ["PT", "DCM", "Positron emission tomography"],
        ["44136-0", "LN", "PET unspecified body region"],
    ),
];

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// A mask.
    Mask,
    /// A lesion: components of a mask.
    Lesion,
}

/// What was measured of a mask or a lesion at a date.
#[derive(Clone, Debug)]
pub struct MeasurementGroup {
    /// What is measured.
    pub measured: Measured,
    /// What it is called. Groups of one name and kind are of one thing at several dates.
    pub name: String,
    /// The date's label; empty: none.
    pub time: String,
    /// The date's number from 1; `None` where there is one, or their order isn't known.
    pub order: Option<usize>,
    /// Volume; 0 where there is nothing.
    pub volume_ml: f64,
    /// The longer diameter and that at right angles to it, millimetres, and the product, square millimetres.
    pub diameters: Option<[f64; 3]>,
    /// The segment that it was read from; only written where files are named.
    pub segment: Option<SourceSegment>,
}

/// What the sum of the targets is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SumOf {
    /// Products of diameters, square millimetres.
    Products,
    /// Longest diameters, millimetres.
    Longest,
    /// Volumes, millilitres.
    Volumes,
}

impl SumOf {
    fn codes(self) -> (Code, Code) {
        match self {
            Self::Products => (["SUM_PRODUCTS", PRIVATE, "Sum of products of diameters"], MM2),
            Self::Longest => (["SUM_LONGEST", PRIVATE, "Sum of longest diameters"], MM),
            Self::Volumes => (["SUM_VOLUMES", PRIVATE, "Sum of volumes"], ML),
        }
    }
}

/// The response of the whole disease at a date, by one measure.
#[derive(Clone, Debug)]
pub struct EvaluationGroup {
    /// The criteria, and what they measure: `RANO 2.0, by diameters`. Groups of one name are of one disease at several dates.
    pub criteria: String,
    /// The date's label; empty: none.
    pub time: String,
    /// The date's number from 1; `None` where there is one, or their order isn't known.
    pub order: Option<usize>,
    /// The call: a code of at most 16 characters, and its meaning.
    pub call: [&'static str; 2],
    /// The sums of the targets, of each compartment; empty where unknown.
    pub sums: Vec<(SumOf, f64)>,
}

/// Measurements as a DICOM structured report (Enhanced SR Storage, TID 1500, Explicit VR Little Endian), in English.
///
/// # Errors
/// [`FileError::Wrong`] for a malformed date, numbers that aren't finite, and without groups.
pub fn measurement_report(
    groups: &[MeasurementGroup],
    evaluations: &[EvaluationGroup],
    to: &ReportTo<'_>,
) -> Result<Vec<u8>, FileError> {
    if groups.is_empty() {
        return Err(FileError::wrong(WHAT, "no measurements", "at least one"));
    }
    let numbers = |group: &MeasurementGroup| {
        group.diameters.unwrap_or_default().into_iter().chain([group.volume_ml]).collect::<Vec<_>>()
    };
    let sums = evaluations.iter().flat_map(|of| of.sums.iter().map(|(_, sum)| *sum));
    if groups.iter().flat_map(numbers).chain(sums).any(|number| !number.is_finite()) {
        return Err(FileError::wrong(WHAT, "an infinite number", "finite ones"));
    }
    let mut data = to.elements(SOP_CLASS, "SR", "903", WHAT)?;
    data.empty(tags::REFERENCED_PERFORMED_PROCEDURE_STEP_SEQUENCE);
    data.empty(tags::PERFORMED_PROCEDURE_CODE_SEQUENCE);
    data.text(tags::COMPLETION_FLAG, "COMPLETE");
    data.text(tags::VERIFICATION_FLAG, "UNVERIFIED");
    put_evidence(&mut data, groups, to);

    let mut content = vec![code("HAS CONCEPT MOD", LANGUAGE, ENGLISH)];
    content.extend(observer(to));
    content.extend(procedures(to.images()).into_iter().map(|one| code("HAS CONCEPT MOD", PROCEDURE, one)));
    if !to.images().is_empty() {
        let library = to.images().iter().map(library_group).collect();
        content.push(container(Some("CONTAINS"), IMAGE_LIBRARY, None, library));
    }
    let measured = groups.iter().map(|group| measured(group, to));
    let measurements = measured.chain(evaluations.iter().map(|of| evaluated(of, to))).collect();
    content.push(container(Some("CONTAINS"), MEASUREMENTS, None, measurements));
    data.merge(container(None, TITLE, Some("1500"), content));
    Ok(to.file(data, SOP_CLASS))
}

/// The files that it refers to: of its study, and of others.
fn put_evidence(data: &mut Elements, groups: &[MeasurementGroup], to: &ReportTo<'_>) {
    let images = to.images();
    let Some(first) = images.first() else { return };
    let mut files: Vec<(&str, &str, Vec<Reference>)> =
        images.iter().map(|image| (image.study.as_str(), image.series.as_str(), files_of(image))).collect();
    for segment in groups.iter().filter_map(|group| group.segment.as_ref()) {
        let file = (segment.study.as_str(), segment.series.as_str(), vec![segment.file.clone()]);
        if !files.contains(&file) {
            files.push(file);
        }
    }
    let (same, other): (Vec<_>, Vec<_>) = files.into_iter().partition(|(study, ..)| *study == first.study);
    data.items(tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE, by_study(&same));
    if !other.is_empty() {
        data.items(tags::PERTINENT_OTHER_EVIDENCE_SEQUENCE, by_study(&other));
    }
}

/// TID 1001, 1002 and 1004: the program observed.
fn observer(to: &ReportTo<'_>) -> [Elements; 5] {
    let context = "HAS OBS CONTEXT";
    [
        code(context, OBSERVER_TYPE, DEVICE),
        uid_of(context, DEVICE_UID, &to.device()),
        text(context, DEVICE_NAME, "Glioscope"),
        text(context, DEVICE_MANUFACTURER, "Glioscope"),
        text(context, DEVICE_MODEL, &format!("Glioscope {}", to.version)),
    ]
}

fn modality_of(image: &SourceImage) -> Option<(Code, Code)> {
    let class = image.volumes.first()?.slices.first()?.sop_class.as_str();
    let row = MODALITIES.iter().find(|(classes, ..)| classes.contains(&class));
    row.map(|(_, modality, procedure)| (*modality, *procedure))
}

fn procedures(images: &[SourceImage]) -> Vec<Code> {
    let mut all: Vec<Code> = images.iter().filter_map(modality_of).map(|(_, procedure)| procedure).collect();
    all.sort_unstable();
    all.dedup();
    if all.is_empty() { vec![IMAGING] } else { all }
}

/// TID 1600: a group for each series.
fn library_group(image: &SourceImage) -> Elements {
    let context = "HAS ACQ CONTEXT";
    let mut content = Vec::new();
    if let Some((modality, _)) = modality_of(image) {
        content.push(code(context, MODALITY, modality));
    }
    content.push(uid_of(context, FRAME_OF_REFERENCE, &image.frame_of_reference));
    content.extend(files_of(image).iter().map(|file| {
        let mut entry = item(Some("CONTAINS"), "IMAGE", None);
        entry.item(tags::REFERENCED_SOP_SEQUENCE, file.item());
        entry
    }));
    container(Some("CONTAINS"), IMAGE_GROUP, None, content)
}

/// TID 1411 with a segment, else TID 1501.
fn measured(group: &MeasurementGroup, to: &ReportTo<'_>) -> Elements {
    let (finding, kind) = match group.measured {
        Measured::Mask => (TISSUE, "mask"),
        Measured::Lesion => (LESION, "lesion"),
    };
    let mut content = tracked((kind, &group.name), finding, (&group.time, group.order), to);
    let segment = group.segment.as_ref().filter(|_| !to.images().is_empty());
    if let Some(segment) = segment {
        let mut file = segment.file.item();
        file.u16s(tags::REFERENCED_SEGMENT_NUMBER, &[u16::try_from(segment.number).unwrap_or_default()]);
        let mut reference = item(Some("CONTAINS"), "IMAGE", Some(SEGMENT));
        reference.item(tags::REFERENCED_SOP_SEQUENCE, file);
        content.push(reference);
        content.push(uid_of("CONTAINS", SEGMENTED_SERIES, &segment.image_series));
    }
    content.push(number("CONTAINS", VOLUME, group.volume_ml, ML));
    if let Some([long_mm, perpendicular_mm, product_mm2]) = group.diameters {
        content.push(number("CONTAINS", LONG_AXIS, long_mm, MM));
        content.push(number("CONTAINS", PERPENDICULAR_AXIS, perpendicular_mm, MM));
        content.push(number("CONTAINS", PRODUCT, product_mm2, MM2));
    }
    container(Some("CONTAINS"), GROUP, Some(if segment.is_some() { "1411" } else { "1501" }), content)
}

/// What a group is of and found at which date; groups of one kind and name are of one thing.
fn tracked(
    (kind, name): (&str, &str),
    finding: Code,
    (time, order): (&str, Option<usize>),
    to: &ReportTo<'_>,
) -> Vec<Elements> {
    let context = "HAS OBS CONTEXT";
    let mut content = vec![
        text(context, TRACKING, name),
        uid_of(context, TRACKING_UID, &to.uid(&format!("{kind} {name}"))),
        code("CONTAINS", FINDING, finding),
    ];
    if !time.is_empty() {
        content.push(text(context, TIME_POINT, time));
        content.extend(order.map(|order| number(context, TIME_POINT_ORDER, order as f64, NO_UNITS)));
    }
    content
}

/// TID 1501 of the whole disease: the call as a qualitative evaluation, and the sums that it rests on.
fn evaluated(of: &EvaluationGroup, to: &ReportTo<'_>) -> Elements {
    let mut content = tracked(("response", &of.criteria), LESION, (&of.time, of.order), to);
    content.extend(of.sums.iter().map(|(sum, value)| {
        let (name, unit) = sum.codes();
        number("CONTAINS", name, *value, unit)
    }));
    let [value, meaning] = of.call;
    content.push(code("CONTAINS", EVALUATION_METHOD, RANO));
    content.push(text("CONTAINS", CRITERIA, &of.criteria));
    content.push(code("CONTAINS", EVALUATION, [value, PRIVATE, meaning]));
    container(Some("CONTAINS"), GROUP, Some("1501"), content)
}

/// A content item without its value.
fn item(relationship: Option<&str>, value_type: &str, name: Option<Code>) -> Elements {
    let mut item = Elements::default();
    if let Some(relationship) = relationship {
        item.text(tags::RELATIONSHIP_TYPE, relationship);
    }
    item.text(tags::VALUE_TYPE, value_type);
    if let Some(name) = name {
        item.code(tags::CONCEPT_NAME_CODE_SEQUENCE, name);
    }
    item
}

fn container(
    relationship: Option<&str>,
    name: Code,
    template: Option<&str>,
    content: Vec<Elements>,
) -> Elements {
    let mut container = item(relationship, "CONTAINER", Some(name));
    container.text(tags::CONTINUITY_OF_CONTENT, "SEPARATE");
    if let Some(template) = template {
        let mut item = Elements::default();
        item.text(tags::MAPPING_RESOURCE, "DCMR");
        item.text(tags::TEMPLATE_IDENTIFIER, template);
        container.item(tags::CONTENT_TEMPLATE_SEQUENCE, item);
    }
    container.items(tags::CONTENT_SEQUENCE, content);
    container
}

fn code(relationship: &str, name: Code, value: Code) -> Elements {
    let mut item = item(Some(relationship), "CODE", Some(name));
    item.code(tags::CONCEPT_CODE_SEQUENCE, value);
    item
}

fn text(relationship: &str, name: Code, value: &str) -> Elements {
    let mut item = item(Some(relationship), "TEXT", Some(name));
    item.text(tags::TEXT_VALUE, &plain(value));
    item
}

fn uid_of(relationship: &str, name: Code, value: &str) -> Elements {
    let mut item = item(Some(relationship), "UIDREF", Some(name));
    item.text(tags::UID, value);
    item
}

fn number(relationship: &str, name: Code, value: f64, unit: Code) -> Elements {
    let mut measured = Elements::default();
    measured.decimals(tags::NUMERIC_VALUE, &[value]);
    // A decimal string has 16 characters, fewer than some numbers.
    if decimal(value).parse() != Ok(value) {
        measured.double(tags::FLOATING_POINT_VALUE, value);
    }
    measured.code(tags::MEASUREMENT_UNITS_CODE_SEQUENCE, unit);
    let mut item = item(Some(relationship), "NUM", Some(name));
    item.item(tags::MEASURED_VALUE_SEQUENCE, measured);
    item
}
