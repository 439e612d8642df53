//! Reports that are written, read again by our parser.

use super::data_set::DataSet;
use super::parse::parse;
use super::report_write::UNKNOWN_DATE;
use super::source_image::{IDENTITY, SourceImage, source_image};
use super::tags::{self, Tag};
use super::write_tests::{contains, grid_of, image};
use super::{
    EvaluationGroup, Measured, MeasurementGroup, ReportTo, SumOf, Whose, encapsulated_pdf, measurement_report,
};
use crate::Progress;

const PDF: &[u8] = b"%PDF-1.7 odd";

fn to(whose: Whose<'_>) -> ReportTo<'_> {
    ReportTo { whose, seed: "seed", date: Some("20240615"), version: "1.2" }
}

fn group(name: &str, volume_ml: f64) -> MeasurementGroup {
    MeasurementGroup {
        measured: Measured::Mask,
        name: name.to_owned(),
        time: "2024-06-15".to_owned(),
        order: Some(2),
        volume_ml,
        diameters: None,
        segment: None,
    }
}

fn canary() -> SourceImage {
    let folder = tempfile::tempdir().unwrap();
    image(folder.path(), &grid_of(0, [5, 6, 3]), "ZZCANARY_");
    source_image(folder.path(), None, &Progress::new()).unwrap()
}

/// The text at a tag; its UTF-8 is found by `contains` where it lies deeper.
fn at(bytes: &[u8], tag: Tag) -> Option<String> {
    parse(bytes, bytes.len() as u64, false).unwrap().data.text(tag)
}

fn has(bytes: &[u8], tag: Tag) -> bool {
    parse(bytes, bytes.len() as u64, false).unwrap().data.has(tag)
}

/// All numbers of a content tree, in order, with their concepts' codes.
fn numbers(data: &DataSet, out: &mut Vec<(String, f64, String)>) {
    for item in data.items(tags::CONTENT_SEQUENCE) {
        for value in item.items(tags::MEASURED_VALUE_SEQUENCE) {
            let code = |data: &DataSet, tag| data.items(tag)[0].text(tags::CODE_VALUE).unwrap();
            let number = value.decimals(tags::NUMERIC_VALUE).unwrap().unwrap()[0];
            out.push((
                code(item, tags::CONCEPT_NAME_CODE_SEQUENCE),
                number,
                code(value, tags::MEASUREMENT_UNITS_CODE_SEQUENCE),
            ));
        }
        numbers(item, out);
    }
}

#[test]
fn numbers_are_written_with_their_units() {
    let lesion = MeasurementGroup {
        measured: Measured::Lesion,
        diameters: Some([21.5, 12.25, 263.375]),
        ..group("T1: lesion A", 3.25)
    };
    let groups = [group("T1", 4.5), lesion];
    let bytes = measurement_report(&groups, &[], &to(Whose::Removed)).unwrap();
    assert_eq!(bytes, measurement_report(&groups, &[], &to(Whose::Removed)).unwrap(), "the same bytes");
    let mut found = Vec::new();
    numbers(&parse(&bytes, bytes.len() as u64, false).unwrap().data, &mut found);
    let expected = [
        ("126073", 2.0, "1"),
        ("118565006", 4.5, "ml"),
        ("126073", 2.0, "1"),
        ("118565006", 3.25, "ml"),
        ("103339001", 21.5, "mm"),
        ("131189007", 12.25, "mm"),
        ("PERP_PRODUCT", 263.375, "mm2"),
    ];
    let expected = expected.map(|(code, value, unit)| (code.to_owned(), value, unit.to_owned()));
    assert_eq!(found, expected);
    assert_eq!(at(&bytes, tags::CONTENT_DATE).as_deref(), Some("20240615"));
    // A number of more than 16 characters stands there as it is, too.
    let third = measurement_report(&[group("T1", 1.0 / 3.0)], &[], &to(Whose::Removed)).unwrap();
    let exact = (1.0_f64 / 3.0).to_le_bytes();
    assert!(third.windows(8).any(|part| part == exact) && !bytes.windows(8).any(|part| part == exact));
}

#[test]
fn a_response_is_a_group_with_its_call_and_sums() {
    let evaluation = EvaluationGroup {
        criteria: "RANO 2.0, by diameters".into(),
        time: "2024-06-15".into(),
        order: Some(2),
        call: ["PD", "Progression"],
        sums: vec![(SumOf::Products, 263.375), (SumOf::Volumes, 3.25)],
    };
    let bytes =
        measurement_report(&[group("T1", 4.5)], std::slice::from_ref(&evaluation), &to(Whose::Removed))
            .unwrap();
    let mut found = Vec::new();
    let parsed = parse(&bytes, bytes.len() as u64, false).unwrap();
    numbers(&parsed.data, &mut found);
    let sums = [("126073", 2.0, "1"), ("SUM_PRODUCTS", 263.375, "mm2"), ("SUM_VOLUMES", 3.25, "ml")];
    let sums = sums.map(|(code, value, unit)| (code.to_owned(), value, unit.to_owned()));
    assert_eq!(found[2..], sums);
    let groups = parsed.data.items(tags::CONTENT_SEQUENCE).last().unwrap().items(tags::CONTENT_SEQUENCE);
    let codes: Vec<String> = groups[1]
        .items(tags::CONTENT_SEQUENCE)
        .iter()
        .flat_map(|item| item.items(tags::CONCEPT_CODE_SEQUENCE))
        .filter_map(|code| code.text(tags::CODE_VALUE))
        .collect();
    assert_eq!(codes, ["52988006", "C114879", "PD"]);
    let infinite = EvaluationGroup { sums: vec![(SumOf::Longest, f64::INFINITY)], ..evaluation };
    let refused = measurement_report(&[group("T1", 4.5)], &[infinite], &to(Whose::Removed));
    assert!(refused.unwrap_err().to_string().contains("finite"));
}

#[test]
fn one_thing_has_one_tracking_uid_and_each_report_its_own_uids() {
    let of = |groups: &[MeasurementGroup], whose| measurement_report(groups, &[], &to(whose)).unwrap();
    let uids = |bytes: &[u8]| {
        let parsed = parse(bytes, bytes.len() as u64, false).unwrap();
        let root = parsed.data.items(tags::CONTENT_SEQUENCE);
        let groups = root.last().unwrap().items(tags::CONTENT_SEQUENCE);
        let uid = |group: &DataSet| group.items(tags::CONTENT_SEQUENCE)[1].text(tags::UID).unwrap();
        groups.iter().map(uid).collect::<Vec<_>>()
    };
    let lesion = MeasurementGroup { measured: Measured::Lesion, ..group("A", 1.0) };
    let [a, again, b, lesion] =
        uids(&of(&[group("A", 1.0), group("A", 2.0), group("B", 1.0), lesion], Whose::Removed))
            .try_into()
            .unwrap();
    assert!(a == again && a != b && a != lesion && b != lesion);
    let (one, two) = (of(&[group("A", 1.0)], Whose::Removed), of(&[group("A", 2.0)], Whose::Removed));
    let pdf = encapsulated_pdf(PDF, "Title", false, &to(Whose::Removed)).unwrap();
    for tag in [tags::SOP_INSTANCE_UID, tags::SERIES_INSTANCE_UID] {
        assert!(at(&one, tag) != at(&two, tag) && at(&one, tag) != at(&pdf, tag));
    }
    assert_ne!(at(&one, tags::SOP_INSTANCE_UID), at(&one, tags::SERIES_INSTANCE_UID));
    // Reports of one case are of one study; with initials of another.
    let study = |bytes: &[u8]| at(bytes, tags::STUDY_INSTANCE_UID).unwrap();
    assert!(study(&one) == study(&two) && study(&one) == study(&pdf));
    assert_ne!(study(&one), study(&of(&[group("A", 1.0)], Whose::Initials("D. J."))));
}

#[test]
fn a_report_is_of_the_images_patient_and_study() {
    let images = [canary()];
    let other = SourceImage { study: "1.9.88.1".into(), series: "1.9.88.2".into(), ..canary() };
    let both = [images[0].clone(), other];
    let pdf = encapsulated_pdf(PDF, "Title", true, &to(Whose::Images(&images))).unwrap();
    let sr = measurement_report(&[group("A", 1.0)], &[], &to(Whose::Images(&both))).unwrap();
    for bytes in [&pdf, &sr] {
        for tag in IDENTITY {
            assert_eq!(at(bytes, tag), Some(format!("ZZCANARY_{:04X}{:04X}", tag.0, tag.1)));
        }
        assert_eq!(bytes.windows(8).filter(|part| part == b"ZZCANARY").count(), IDENTITY.len());
        assert_eq!(at(bytes, tags::STUDY_INSTANCE_UID).as_deref(), Some("1.9.77.1"));
        assert!(contains(bytes, "1.9.77.4.3") && !has(bytes, tags::PATIENT_IDENTITY_REMOVED));
    }
    let parsed = parse(&sr, sr.len() as u64, false).unwrap();
    let study = |tag| {
        let items = parsed.data.items(tag);
        assert_eq!(items.len(), 1);
        items[0].text(tags::STUDY_INSTANCE_UID).unwrap()
    };
    assert_eq!(study(tags::CURRENT_REQUESTED_PROCEDURE_EVIDENCE_SEQUENCE), "1.9.77.1");
    assert_eq!(study(tags::PERTINENT_OTHER_EVIDENCE_SEQUENCE), "1.9.88.1");
}

#[test]
fn nobody_is_named_unasked() {
    for (whose, name, removed) in
        [(Whose::Removed, None, "YES"), (Whose::Initials("D. J."), Some("D. J."), "NO")]
    {
        let sr = measurement_report(&[group("A\u{202e}\u{1b}B", 1.0)], &[], &to(whose)).unwrap();
        assert!(contains(&sr, "AB"), "what misleads a reader is left out");
        for bytes in [sr, encapsulated_pdf(PDF, "Title", false, &to(whose)).unwrap()] {
            assert_eq!(at(&bytes, tags::PATIENT_NAME).as_deref(), name);
            assert_eq!(at(&bytes, tags::PATIENT_IDENTITY_REMOVED).as_deref(), Some(removed));
            for tag in [tags::PATIENT_ID, tags::STUDY_DATE, tags::ACCESSION_NUMBER] {
                assert!(has(&bytes, tag) && at(&bytes, tag).is_none(), "{tag}");
            }
        }
    }
    let pdf = encapsulated_pdf(PDF, "Title", false, &ReportTo { date: None, ..to(Whose::Removed) });
    assert_eq!(at(&pdf.unwrap(), tags::CONTENT_DATE).as_deref(), Some(UNKNOWN_DATE));
}

#[test]
fn a_pdf_is_given_back_byte_for_byte() {
    for pdf in [PDF, &PDF[..PDF.len() - 1]] {
        let bytes = encapsulated_pdf(pdf, "Title", false, &to(Whose::Removed)).unwrap();
        let mut padded = pdf.to_vec();
        padded.extend(vec![0; pdf.len() % 2]);
        assert!(bytes.len().is_multiple_of(2) && bytes.windows(padded.len()).any(|part| part == padded));
        // Encapsulated Document Length (0042,0015), UL of four bytes.
        let length = [&[0x42, 0, 0x15, 0, b'U', b'L', 4, 0], &(pdf.len() as u32).to_le_bytes()[..]].concat();
        assert!(bytes.windows(length.len()).any(|part| part == length));
    }
}

#[test]
fn what_is_no_report_is_refused() {
    let to = to(Whose::Removed);
    let dated = ReportTo { date: Some("2024-06-15"), ..to };
    for (error, word) in [
        (encapsulated_pdf(b"<html>", "", false, &to), "a PDF"),
        (encapsulated_pdf(PDF, "", false, &dated), "YYYYMMDD"),
        (measurement_report(&[], &[], &to), "at least one"),
        (measurement_report(&[group("A", f64::NAN)], &[], &to), "finite"),
        (measurement_report(&[group("A", 1.0)], &[], &dated), "YYYYMMDD"),
    ] {
        let error = error.unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}
