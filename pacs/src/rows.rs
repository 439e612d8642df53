//! Rows of search results. Whatever a server doesn't say, or says in another form, is unknown.

use std::hash::Hash;

use crate::json::DataSet;
use crate::tags;
use crate::uid::Uid;

/// A kind of row: what is requested for it, and how it is read.
pub(crate) trait Row: Clone + Eq + Hash {
    /// Elements that servers needn't send unless they are requested.
    const EXTRA: &'static [u32];

    /// Reads a row.
    fn read(data: &DataSet) -> Self;

    /// What it is of.
    fn uid(&self) -> Option<&Uid>;
}

/// A study.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct StudyRow {
    /// Study instance UID, where it is valid: without one nothing can be retrieved.
    pub uid: Option<Uid>,
    /// Patient's name, components between `^`.
    pub patient_name: Option<String>,
    /// Patient's ID.
    pub patient_id: Option<String>,
    /// Patient's date of birth, as `YYYYMMDD`.
    pub birth_date: Option<String>,
    /// Date, as `YYYYMMDD`.
    pub date: Option<String>,
    /// Time, as `HHMMSS.FFFFFF` or its beginning.
    pub time: Option<String>,
    /// Accession number.
    pub accession: Option<String>,
    /// Description.
    pub description: Option<String>,
    /// Modalities of its series; empty where unknown.
    pub modalities: Vec<String>,
    /// Number of series.
    pub series: Option<u64>,
    /// Number of instances.
    pub instances: Option<u64>,
}

impl Row for StudyRow {
    const EXTRA: &'static [u32] = &[
        tags::STUDY_DESCRIPTION,
        tags::MODALITIES_IN_STUDY,
        tags::STUDY_SERIES,
        tags::STUDY_INSTANCES,
        tags::PATIENT_BIRTH_DATE,
    ];

    fn read(data: &DataSet) -> Self {
        Self {
            uid: data.uid(tags::STUDY_INSTANCE_UID),
            patient_name: data.text(tags::PATIENT_NAME),
            patient_id: data.text(tags::PATIENT_ID),
            birth_date: data.text(tags::PATIENT_BIRTH_DATE),
            date: data.text(tags::STUDY_DATE),
            time: data.text(tags::STUDY_TIME),
            accession: data.text(tags::ACCESSION_NUMBER),
            description: data.text(tags::STUDY_DESCRIPTION),
            modalities: data.texts(tags::MODALITIES_IN_STUDY),
            series: data.count(tags::STUDY_SERIES),
            instances: data.count(tags::STUDY_INSTANCES),
        }
    }

    fn uid(&self) -> Option<&Uid> {
        self.uid.as_ref()
    }
}

/// A series.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct SeriesRow {
    /// Series instance UID, where it is valid.
    pub uid: Option<Uid>,
    /// Modality.
    pub modality: Option<String>,
    /// Series number.
    pub number: Option<i64>,
    /// Description.
    pub description: Option<String>,
    /// Number of instances.
    pub instances: Option<u64>,
}

impl Row for SeriesRow {
    const EXTRA: &'static [u32] = &[tags::SERIES_DESCRIPTION, tags::SERIES_INSTANCES];

    fn read(data: &DataSet) -> Self {
        Self {
            uid: data.uid(tags::SERIES_INSTANCE_UID),
            modality: data.text(tags::MODALITY),
            number: data.integer(tags::SERIES_NUMBER),
            description: data.text(tags::SERIES_DESCRIPTION),
            instances: data.count(tags::SERIES_INSTANCES),
        }
    }

    fn uid(&self) -> Option<&Uid> {
        self.uid.as_ref()
    }
}

/// An instance: one file.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct InstanceRow {
    /// SOP instance UID, where it is valid.
    pub uid: Option<Uid>,
    /// SOP class UID: what kind of object it is.
    pub class: Option<Uid>,
    /// Instance number.
    pub number: Option<i64>,
    /// Number of frames.
    pub frames: Option<u64>,
}

impl Row for InstanceRow {
    const EXTRA: &'static [u32] = &[];

    fn read(data: &DataSet) -> Self {
        Self {
            uid: data.uid(tags::SOP_INSTANCE_UID),
            class: data.uid(tags::SOP_CLASS_UID),
            number: data.integer(tags::INSTANCE_NUMBER),
            frames: data.count(tags::NUMBER_OF_FRAMES),
        }
    }

    fn uid(&self) -> Option<&Uid> {
        self.uid.as_ref()
    }
}
