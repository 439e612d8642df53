//! Tags (PS3.6): group and element in one number.

pub(crate) const SOP_CLASS_UID: u32 = 0x0008_0016;
pub(crate) const SOP_INSTANCE_UID: u32 = 0x0008_0018;
pub(crate) const STUDY_DATE: u32 = 0x0008_0020;
pub(crate) const STUDY_TIME: u32 = 0x0008_0030;
pub(crate) const ACCESSION_NUMBER: u32 = 0x0008_0050;
pub(crate) const MODALITY: u32 = 0x0008_0060;
pub(crate) const MODALITIES_IN_STUDY: u32 = 0x0008_0061;
pub(crate) const STUDY_DESCRIPTION: u32 = 0x0008_1030;
pub(crate) const SERIES_DESCRIPTION: u32 = 0x0008_103e;
pub(crate) const PATIENT_NAME: u32 = 0x0010_0010;
pub(crate) const PATIENT_ID: u32 = 0x0010_0020;
pub(crate) const PATIENT_BIRTH_DATE: u32 = 0x0010_0030;
pub(crate) const STUDY_INSTANCE_UID: u32 = 0x0020_000d;
pub(crate) const SERIES_INSTANCE_UID: u32 = 0x0020_000e;
pub(crate) const SERIES_NUMBER: u32 = 0x0020_0011;
pub(crate) const INSTANCE_NUMBER: u32 = 0x0020_0013;
pub(crate) const STUDY_SERIES: u32 = 0x0020_1206;
pub(crate) const STUDY_INSTANCES: u32 = 0x0020_1208;
pub(crate) const SERIES_INSTANCES: u32 = 0x0020_1209;
pub(crate) const NUMBER_OF_FRAMES: u32 = 0x0028_0008;

/// Elements of search results that rows show; others aren't kept.
pub(crate) const SHOWN: [u32; 20] = [
    SOP_CLASS_UID,
    SOP_INSTANCE_UID,
    STUDY_DATE,
    STUDY_TIME,
    ACCESSION_NUMBER,
    MODALITY,
    MODALITIES_IN_STUDY,
    STUDY_DESCRIPTION,
    SERIES_DESCRIPTION,
    PATIENT_NAME,
    PATIENT_ID,
    PATIENT_BIRTH_DATE,
    STUDY_INSTANCE_UID,
    SERIES_INSTANCE_UID,
    SERIES_NUMBER,
    INSTANCE_NUMBER,
    STUDY_SERIES,
    STUDY_INSTANCES,
    SERIES_INSTANCES,
    NUMBER_OF_FRAMES,
];
