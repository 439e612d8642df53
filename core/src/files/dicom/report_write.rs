//! Writing reports: what they state of the patient and of the images that they are about, and a report's PDF as DICOM
//! (Encapsulated PDF, PS3.3 A.45.1).

use std::collections::{BTreeMap, HashSet};

use super::super::FileError;
use super::modules::{common, put_identity};
use super::segmentation::short;
use super::source_image::{SourceImage, SourceSlice};
use super::tags;
use super::write::{Elements, uid};
use crate::digest::Digest;

/// Encapsulated PDF Storage.
const SOP_CLASS: &str = "1.2.840.10008.5.1.4.1.1.104.1";

/// Stands for a date that isn't known where the standard asks for one.
pub(super) const UNKNOWN_DATE: &str = "19000101";

/// What a report's document is (PS3.16 CID 7021).
pub(super) const TITLE: [&str; 3] = ["126000", "DCM", "Imaging Measurement Report"];

/// Longest title of a document (ST) in characters.
const MAX_TITLE: usize = 1024;

/// Whose a report is.
#[derive(Clone, Copy, Debug)]
pub enum Whose<'a> {
    /// Of the patient and study of the first of these images, whose files it names, each series once. Without an image: of a
    /// new study, and of nobody, as nothing says whose it is.
    Images(&'a [SourceImage]),
    /// Of a new study; of the patient it has these initials alone.
    Initials(&'a str),
    /// Of a new study; what identifies the patient was removed.
    Removed,
}

/// How reports are written. The same values give the same bytes.
#[derive(Clone, Copy, Debug)]
pub struct ReportTo<'a> {
    /// Whose it is.
    pub whose: Whose<'a>,
    /// What UIDs are made from beside the report: reports of one case and identity are of one new study.
    pub seed: &'a str,
    /// Date of the newest scan, `YYYYMMDD`; `None` where it isn't known: that of the first image's study, or
    /// 1900-01-01, which stands for unknown.
    pub date: Option<&'a str>,
    /// Version of the program.
    pub version: &'a str,
}

/// A reference to a file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Reference {
    pub sop_class: String,
    pub sop_instance: String,
}

impl Reference {
    pub fn item(&self) -> Elements {
        let mut item = Elements::default();
        item.text(tags::REFERENCED_SOP_CLASS_UID, &self.sop_class);
        item.text(tags::REFERENCED_SOP_INSTANCE_UID, &self.sop_instance);
        item
    }
}

impl<'a> ReportTo<'a> {
    /// The images that it names.
    pub(super) fn images(&self) -> &'a [SourceImage] {
        match self.whose {
            Whose::Images(images) => images,
            Whose::Initials(_) | Whose::Removed => &[],
        }
    }

    /// A UID that reports of the case and identity share.
    pub(super) fn uid(&self, purpose: &str) -> String {
        let mut digest = Digest::new();
        for text in ["report", self.seed, purpose] {
            digest.bytes(text.as_bytes());
        }
        digest.add(match self.whose {
            Whose::Images(_) => 0,
            Whose::Initials(_) => 1,
            Whose::Removed => 2,
        });
        uid(&digest)
    }

    /// The UID of the program as what observes: one for each version.
    pub(super) fn device(&self) -> String {
        let mut digest = Digest::new();
        for text in ["Glioscope", self.version] {
            digest.bytes(text.as_bytes());
        }
        uid(&digest)
    }

    /// Its date: never empty.
    fn date(&self) -> &'a str {
        let is_date = |text: &&str| text.len() == 8 && text.bytes().all(|byte| byte.is_ascii_digit());
        let study = self.images().first().and_then(|image| {
            let found = image.identity.iter().find(|(tag, _)| *tag == tags::STUDY_DATE);
            found.map(|(_, text)| text.as_str())
        });
        self.date.or(study).filter(is_date).unwrap_or(UNKNOWN_DATE)
    }

    /// Patient, study, series, equipment and date.
    ///
    /// # Errors
    /// [`FileError::Wrong`] for a date that is none.
    pub(super) fn elements(
        &self,
        sop_class: &str,
        modality: &str,
        series_number: &str,
        what: &str,
    ) -> Result<Elements, FileError> {
        if let Some(date) = self.date.filter(|date| *date != self.date()) {
            return Err(FileError::wrong(what, format!("{:?}", short(date)), "a date as YYYYMMDD"));
        }
        let mut data = common(sop_class, modality, self.version);
        data.text(tags::SERIES_NUMBER, series_number);
        data.text(tags::INSTANCE_NUMBER, "1");
        data.text(tags::CONTENT_DATE, self.date());
        data.text(tags::CONTENT_TIME, "000000");
        match (self.whose, self.images().first()) {
            (_, Some(image)) => {
                put_identity(&mut data, image);
                data.text(tags::STUDY_INSTANCE_UID, &image.study);
            }
            (whose, None) => {
                data.text(tags::STUDY_INSTANCE_UID, &self.uid("study"));
                match whose {
                    Whose::Images(_) => {}
                    Whose::Initials(initials) => {
                        data.text(tags::PATIENT_NAME, initials);
                        data.text(tags::PATIENT_IDENTITY_REMOVED, "NO");
                    }
                    Whose::Removed => {
                        data.text(tags::PATIENT_IDENTITY_REMOVED, "YES");
                        data.text(
                            tags::DEIDENTIFICATION_METHOD,
                            "Glioscope: no patient, no UIDs; dates and names of masks kept",
                        );
                    }
                }
            }
        }
        Ok(data)
    }

    /// The file of an object of these elements, its own UIDs made from all that it states.
    pub(super) fn file(&self, mut data: Elements, sop_class: &str) -> Vec<u8> {
        let mut digest = Digest::new();
        digest.bytes(self.seed.as_bytes());
        digest.bytes(&data.encoded());
        let own = |purpose: &str| {
            let mut digest = digest.clone();
            digest.bytes(purpose.as_bytes());
            uid(&digest)
        };
        let (instance, series) = (own("instance"), own("series"));
        data.text(tags::SOP_INSTANCE_UID, &instance);
        data.text(tags::SERIES_INSTANCE_UID, &series);
        data.file(sop_class, &instance)
    }
}

/// Text without what misleads a reader.
pub(super) fn plain(text: &str) -> String {
    text.chars().filter(|c| !super::super::is_misleading(*c)).collect()
}

/// The files of an image, each once.
pub(super) fn files_of(image: &SourceImage) -> Vec<Reference> {
    let mut seen = HashSet::new();
    let slices = image.volumes.iter().flat_map(|volume| &volume.slices);
    slices
        .filter(|slice| seen.insert(slice.sop_instance.as_str()))
        .map(|SourceSlice { sop_class, sop_instance, .. }| Reference {
            sop_class: sop_class.clone(),
            sop_instance: sop_instance.clone(),
        })
        .collect()
}

/// The report's PDF as a DICOM object (Encapsulated PDF Storage, Explicit VR Little Endian). `title`: the document's.
/// `names_patient`: whether the pages name the patient.
///
/// # Errors
/// [`FileError::Wrong`] for what isn't a PDF, one of 4 GiB and more, and a malformed date.
pub fn encapsulated_pdf(
    pdf: &[u8],
    title: &str,
    names_patient: bool,
    to: &ReportTo<'_>,
) -> Result<Vec<u8>, FileError> {
    const WHAT: &str = "encapsulated PDF";
    if !pdf.starts_with(b"%PDF-") {
        return Err(FileError::wrong(WHAT, "other bytes", "those of a PDF"));
    }
    // The value is padded to an even length.
    let length = u32::try_from(pdf.len()).ok().filter(|length| *length < u32::MAX - 1);
    let length =
        length.ok_or_else(|| FileError::wrong(WHAT, format!("{} bytes", pdf.len()), "less than 4 GiB"))?;
    let mut data = to.elements(SOP_CLASS, "DOC", "902", WHAT)?;
    data.text(tags::CONVERSION_TYPE, "WSD");
    data.empty(tags::ACQUISITION_DATE_TIME);
    data.text(tags::BURNED_IN_ANNOTATION, if names_patient { "YES" } else { "NO" });
    data.text(tags::DOCUMENT_TITLE, &plain(title).chars().take(MAX_TITLE).collect::<String>());
    data.code(tags::CONCEPT_NAME_CODE_SEQUENCE, TITLE);
    let files: Vec<Elements> = to.images().iter().flat_map(files_of).map(|file| file.item()).collect();
    if !files.is_empty() {
        data.items(tags::SOURCE_INSTANCE_SEQUENCE, files);
    }
    data.text(tags::MIME_TYPE_OF_ENCAPSULATED_DOCUMENT, "application/pdf");
    data.u32s(tags::ENCAPSULATED_DOCUMENT_LENGTH, &[length]);
    data.bytes(tags::ENCAPSULATED_DOCUMENT, pdf.to_vec());
    Ok(to.file(data, SOP_CLASS))
}

/// Files by study and series (PS3.3 C.17.2.1), in the order of their UIDs.
pub(super) fn by_study(files: &[(&str, &str, Vec<Reference>)]) -> Vec<Elements> {
    let mut studies: BTreeMap<&str, BTreeMap<&str, Vec<Elements>>> = BTreeMap::new();
    for (study, series, files) in files {
        let of_series = studies.entry(study).or_default().entry(series).or_default();
        of_series.extend(files.iter().map(Reference::item));
    }
    let of_series = |(series, files): (&str, Vec<Elements>)| {
        let mut item = Elements::default();
        item.text(tags::SERIES_INSTANCE_UID, series);
        item.items(tags::REFERENCED_SOP_SEQUENCE, files);
        item
    };
    let of_study = |(study, series): (&str, BTreeMap<&str, Vec<Elements>>)| {
        let mut item = Elements::default();
        item.text(tags::STUDY_INSTANCE_UID, study);
        item.items(tags::REFERENCED_SERIES_SEQUENCE, series.into_iter().map(of_series));
        item
    };
    studies.into_iter().map(of_study).collect()
}
