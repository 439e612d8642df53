//! What every object that is written states: patient, study, equipment and its UIDs, with or without what identifies the
//! patient (PS3.15 E.1, as far as these objects have its attributes).

use super::super::FileError;
use super::segmentation::short;
use super::slices_to_write::Slices;
use super::source_image::{IDENTITY, SourceImage, SourceSlice};
use super::tags;
use super::write::{Elements, uid};
use crate::digest::Digest;
use crate::{Check, Grid, MaskBits};

/// Longest name of a mask in characters (LO).
const MAX_NAME: usize = 64;

/// UIDs of the standard identify nobody, and keep their meaning.
const STANDARD_ROOT: &str = "1.2.840.10008.";

/// A mask to write.
#[derive(Clone, Copy, Debug)]
pub struct SegmentToWrite<'a> {
    /// Its name; control characters and what is over 64 characters are left out.
    pub name: &'a str,
    /// Its display colour, sRGB.
    pub color: Option<[u8; 3]>,
    /// Its voxels, of the dimensions of the grid.
    pub mask: &'a MaskBits,
}

/// How masks are written. The same values give the same bytes.
#[derive(Clone, Copy, Debug)]
pub struct WriteTo<'a> {
    /// The grid of the masks, RAS+ millimetres. Its first two axes must be orthogonal, unless its voxels are the image's.
    pub grid: &'a Grid,
    /// The image that the masks belong to. `None`: of a new study of nobody.
    pub source: Option<&'a SourceImage>,
    /// Whether the patient's and study's attributes and UIDs are the image's. Otherwise the patient gets fixed words, and
    /// every UID of the image becomes another one, the same for the same `salt`.
    pub identified: bool,
    /// Whether names of masks are written; otherwise they are numbered.
    pub keeps_names: bool,
    /// What UIDs are made from, beside what is written. Secret, and one for all objects of a project: whoever knows it can
    /// tell which UID became which. The digest isn't cryptographic: it hides UIDs from readers, not from a search.
    pub salt: &'a str,
    /// Date of the object, `YYYYMMDD`: the only one where it isn't identified.
    pub date: &'a str,
    /// Its time, `HHMMSS`; midnight where it isn't identified.
    pub time: &'a str,
    /// Version of the program.
    pub version: &'a str,
}

/// A file's bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file.
    pub bytes: Vec<u8>,
    /// Findings.
    pub checks: Vec<Check>,
}

/// UIDs of an object.
pub(super) struct Object<'a> {
    pub to: &'a WriteTo<'a>,
    pub sop_class: &'static str,
    pub sop_instance: String,
    pub series: String,
    pub study: String,
    pub frame_of_reference: String,
    /// What else needs UIDs makes them from this.
    pub digest: Digest,
}

/// A mask with the name that is written.
pub(super) type Named<'a> = (String, SegmentToWrite<'a>);

/// Masks that have voxels, by the names that are written, and what was left out.
pub(super) fn not_empty<'a>(
    segments: &[SegmentToWrite<'a>],
    to: &WriteTo<'_>,
    what: &str,
) -> Result<(Vec<Named<'a>>, Vec<Check>), FileError> {
    let (mut kept, mut empty) = (Vec::new(), Vec::new());
    for (n, segment) in segments.iter().enumerate() {
        let plain: String = segment.name.chars().filter(|c| !super::super::is_misleading(*c)).collect();
        // A backslash would separate two values.
        let plain = plain.trim().replace('\\', "/");
        let plain: String = plain.chars().take(MAX_NAME).collect();
        let name =
            if plain.trim().is_empty() || !to.keeps_names { format!("Segment {}", n + 1) } else { plain };
        if segment.mask.bounds().is_some() {
            kept.push((name, *segment));
        } else {
            empty.push(name);
        }
    }
    if kept.is_empty() {
        return Err(FileError::wrong(what, "no mask with voxels", "at least 1"));
    }
    if kept.len() > usize::from(u16::MAX) {
        return Err(FileError::wrong(what, format!("{} masks", kept.len()), "at most 65535"));
    }
    let mut checks = Vec::new();
    if !empty.is_empty() {
        let names = crate::check::listed(&empty, 5);
        checks
            .push(Check::warning("dicom-write-empty", format!("{what}: {names}: without voxels, left out")));
    }
    Ok((kept, checks))
}

impl<'a> Object<'a> {
    /// # Errors
    /// [`FileError::Wrong`] for a date or time that is none.
    pub fn of(
        sop_class: &'static str,
        segments: &[Named<'_>],
        to: &'a WriteTo<'a>,
        what: &str,
    ) -> Result<Self, FileError> {
        for (text, length, expected) in [(to.date, 8, "a date as YYYYMMDD"), (to.time, 6, "a time as HHMMSS")]
        {
            if text.len() != length || !text.bytes().all(|byte| byte.is_ascii_digit()) {
                return Err(FileError::wrong(what, format!("{:?}", short(text)), expected));
            }
        }
        let mut digest = Digest::new();
        for text in [to.salt, to.date, to.time, to.version] {
            digest.bytes(text.as_bytes());
        }
        digest.add(u64::from(to.identified) << 1 | u64::from(to.keeps_names));
        digest.bytes(format!("{:?}", to.grid.dims()).as_bytes());
        for number in to.grid.world_from_voxel().to_cols_array() {
            digest.add(number.to_bits());
        }
        for (name, segment) in segments {
            digest.bytes(name.as_bytes());
            digest.bytes(&segment.color.map(Vec::from).unwrap_or_default());
            digest.add(segment.mask.words().len() as u64);
            segment.mask.words().iter().for_each(|&word| digest.add(word));
        }
        if let Some(source) = to.source {
            for uid in [&source.study, &source.series, &source.frame_of_reference] {
                digest.bytes(uid.as_bytes());
            }
        }
        let new = |purpose: &str| {
            let mut digest = digest.clone();
            digest.bytes(purpose.as_bytes());
            uid(&digest)
        };
        let (study, frame_of_reference) = match to.source {
            Some(source) => (of_source(&source.study, to), of_source(&source.frame_of_reference, to)),
            None => (new("study"), new("frame of reference")),
        };
        let own = |purpose: &str| new(&format!("{purpose} {sop_class}"));
        let (sop_instance, series) = (own("instance"), own("series"));
        Ok(Self { to, sop_class, sop_instance, series, study, frame_of_reference, digest })
    }

    /// Another UID of the object.
    pub fn uid(&self, purpose: &str) -> String {
        let mut digest = self.digest.clone();
        digest.bytes(purpose.as_bytes());
        uid(&digest)
    }

    /// Time of the object.
    pub fn time(&self) -> &str {
        if self.to.identified { self.to.time } else { "000000" }
    }

    /// Patient, General Study, General Series, Frame of Reference, General Equipment and SOP Common (PS3.3 C.7, C.12.1).
    pub fn elements(&self, modality: &str) -> Elements {
        let mut data = common(self.sop_class, modality, self.to.version);
        data.text(tags::SOP_INSTANCE_UID, &self.sop_instance);
        data.text(tags::STUDY_INSTANCE_UID, &self.study);
        data.text(tags::SERIES_INSTANCE_UID, &self.series);
        data.text(tags::FRAME_OF_REFERENCE_UID, &self.frame_of_reference);
        data.empty(tags::POSITION_REFERENCE_INDICATOR);
        match self.to.source {
            Some(source) if self.to.identified => put_identity(&mut data, source),
            Some(_) => {
                data.text(tags::PATIENT_NAME, "Anonymous^Patient");
                data.text(tags::PATIENT_ID, "ANONYMOUS");
            }
            None => {}
        }
        if !self.to.identified {
            data.text(tags::PATIENT_IDENTITY_REMOVED, "YES");
            let names = if self.to.keeps_names { "; names of masks kept" } else { "" };
            data.text(tags::DEIDENTIFICATION_METHOD, &format!("Glioscope: DICOM PS3.15 E.1{names}"));
            data.code(
                tags::DEIDENTIFICATION_METHOD_CODE_SEQUENCE,
                ["113100", "DCM", "Basic Application Confidentiality Profile"],
            );
            data.text(tags::LONGITUDINAL_TEMPORAL_INFORMATION_MODIFIED, "REMOVED");
        }
        data
    }

    /// The UID that stands for one of the image's.
    pub fn of_source(&self, uid: &str) -> String {
        of_source(uid, self.to)
    }

    /// A reference to the file (and frame) of a slice.
    pub fn reference(&self, slice: &SourceSlice) -> Elements {
        let mut item = Elements::default();
        item.text(tags::REFERENCED_SOP_CLASS_UID, &self.of_source(&slice.sop_class));
        item.text(tags::REFERENCED_SOP_INSTANCE_UID, &self.of_source(&slice.sop_instance));
        if let Some(frame) = slice.frame {
            item.text(tags::REFERENCED_FRAME_NUMBER, &frame.to_string());
        }
        item
    }

    /// The image's files on whose slices masks lie, each once; without frames.
    pub fn files_of(&self, slices: &Slices<'_>) -> Vec<Elements> {
        let mut seen = std::collections::HashSet::new();
        let all = slices.images.unwrap_or_default().iter();
        let files = all.filter(|slice| seen.insert(slice.sop_instance.as_str()));
        files.map(|slice| self.reference(&SourceSlice { frame: None, ..slice.clone() })).collect()
    }
}

/// What all objects state: the program, and nobody's patient and study. UIDs are the object's own.
pub(super) fn common(sop_class: &str, modality: &str, version: &str) -> Elements {
    let mut data = Elements::default();
    data.text(tags::SPECIFIC_CHARACTER_SET, "ISO_IR 192");
    data.text(tags::SOP_CLASS_UID, sop_class);
    data.text(tags::MODALITY, modality);
    data.text(tags::MANUFACTURER, "Glioscope");
    data.text(tags::MANUFACTURER_MODEL_NAME, "Glioscope");
    data.text(tags::SOFTWARE_VERSIONS, version);
    data.text(tags::DEVICE_SERIAL_NUMBER, "0");
    for tag in IDENTITY.into_iter().filter(|tag| *tag != tags::ISSUER_OF_PATIENT_ID) {
        data.empty(tag);
    }
    data
}

/// The patient and study of an image.
pub(super) fn put_identity(data: &mut Elements, source: &SourceImage) {
    for (tag, text) in source.identity.iter().filter(|(_, text)| !text.is_empty()) {
        data.text(*tag, text);
    }
}

fn of_source(of_image: &str, to: &WriteTo<'_>) -> String {
    if to.identified || of_image.starts_with(STANDARD_ROOT) {
        return of_image.to_owned();
    }
    let mut digest = Digest::new();
    for text in ["uid", to.salt, of_image] {
        digest.bytes(text.as_bytes());
    }
    uid(&digest)
}
