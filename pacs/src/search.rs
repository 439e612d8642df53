//! Searching (QIDO-RS, PS3.18 10.6): queries, pages of rows, limits.

use std::collections::HashSet;
use std::fmt;
use std::io::BufReader;

use serde::Deserializer as _;
use serde::de::{Error as _, SeqAccess, Visitor};

use crate::client::{Cancel, Client};
use crate::error::Error;
use crate::json::DataSet;
use crate::reader::Reader;
use crate::rows::{InstanceRow, Row, SeriesRow, StudyRow};
use crate::session::{Session, content_type};
use crate::text::{clean, encoded};
use crate::uid::Uid;

/// Most rows that are kept of one search.
const MAX_ROWS: usize = 100_000;

/// Rows requested at once.
const PAGE_ROWS: usize = 1000;

/// Largest answer, in bytes: 100,000 rows of 1.2 kB from a server that knows no pages.
const MAX_JSON_BYTES: u64 = 160 << 20;

/// Which studies are searched for; what is `None` is not restricted. `*` and `?` are wildcards in names and numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Query {
    /// Patient's ID.
    pub patient_id: Option<String>,
    /// Patient's name, components between `^`.
    pub patient_name: Option<String>,
    /// First date, as `YYYYMMDD`.
    pub from: Option<String>,
    /// Last date, as `YYYYMMDD`.
    pub to: Option<String>,
    /// Modality of a series of the study.
    pub modality: Option<String>,
    /// Accession number.
    pub accession: Option<String>,
    /// Study instance UID.
    pub study: Option<Uid>,
    /// Most rows; all, up to 100,000, where `None`.
    pub limit: Option<usize>,
    /// Rows that are skipped.
    pub offset: usize,
}

impl Query {
    /// The address's query.
    ///
    /// # Errors
    /// A date in another form.
    fn parameters(&self) -> Result<Vec<String>, Error> {
        let mut out = Vec::new();
        for (key, value) in [
            ("PatientID", self.patient_id.as_deref()),
            ("PatientName", self.patient_name.as_deref()),
            ("StudyDate", self.dates()?.as_deref()),
            ("ModalitiesInStudy", self.modality.as_deref()),
            ("AccessionNumber", self.accession.as_deref()),
            ("StudyInstanceUID", self.study.as_ref().map(Uid::as_str)),
        ] {
            if let Some(value) = value.map(str::trim).filter(|value| !value.is_empty()) {
                out.push(format!("{key}={}", encoded(value)));
            }
        }
        Ok(out)
    }

    fn dates(&self) -> Result<Option<String>, Error> {
        for (field, date) in [("first date", &self.from), ("last date", &self.to)] {
            let Some(date) = date else { continue };
            if date.len() != 8 || !date.bytes().all(|b| b.is_ascii_digit()) {
                return Err(Error::Value { field, found: clean(date, 40), expected: "YYYYMMDD" });
            }
        }
        Ok(match (self.from.as_deref(), self.to.as_deref()) {
            (None, None) => None,
            (from, to) => Some(format!("{}-{}", from.unwrap_or_default(), to.unwrap_or_default())),
        })
    }
}

impl Client {
    /// Studies that match `query`, in the server's order.
    ///
    /// # Errors
    /// A value that can't be searched for; those of the connection; an answer that isn't DICOM JSON; too many rows.
    pub fn studies(&self, query: &Query, cancel: Cancel<'_>) -> Result<Vec<StudyRow>, Error> {
        let parameters = query.parameters()?;
        let pages = Pages { path: "studies", parameters, limit: query.limit, offset: query.offset };
        self.session(cancel, |session| session.rows(&pages, "a list of studies"))
    }

    /// The series of a study.
    ///
    /// # Errors
    /// As [`Client::studies`].
    pub fn series(&self, study: &Uid, cancel: Cancel<'_>) -> Result<Vec<SeriesRow>, Error> {
        self.session(cancel, |session| session.series(study))
    }

    /// The instances of a series.
    ///
    /// # Errors
    /// As [`Client::studies`].
    pub fn instances(
        &self,
        study: &Uid,
        series: &Uid,
        cancel: Cancel<'_>,
    ) -> Result<Vec<InstanceRow>, Error> {
        self.session(cancel, |session| session.instances(study, series, None))
    }
}

/// What is asked for in pages.
struct Pages<'a> {
    path: &'a str,
    parameters: Vec<String>,
    limit: Option<usize>,
    offset: usize,
}

impl Session<'_> {
    /// The series of a study.
    ///
    /// # Errors
    /// As [`Client::studies`].
    pub fn series(&self, study: &Uid) -> Result<Vec<SeriesRow>, Error> {
        let path = format!("studies/{study}/series");
        let pages = Pages { path: &path, parameters: Vec::new(), limit: None, offset: 0 };
        self.rows(&pages, &format!("study {study}"))
    }

    /// The instances of a series, or the one of UID `only`.
    ///
    /// # Errors
    /// As [`Client::studies`].
    pub fn instances(
        &self,
        study: &Uid,
        series: &Uid,
        only: Option<&Uid>,
    ) -> Result<Vec<InstanceRow>, Error> {
        let path = format!("studies/{study}/series/{series}/instances");
        let parameters = only.map(|uid| format!("SOPInstanceUID={uid}")).into_iter().collect();
        let pages = Pages { path: &path, parameters, limit: None, offset: 0 };
        self.rows(&pages, &format!("series {series}"))
    }

    /// Whether the server answers and accepts the credentials, by a search for one study; it may refuse that as too broad.
    ///
    /// # Errors
    /// As [`Client::studies`].
    pub fn greet(&self) -> Result<(), Error> {
        let pages = Pages { path: "studies", parameters: Vec::new(), limit: Some(1), offset: 0 };
        match self.rows::<StudyRow>(&pages, "a list of studies") {
            Err(error) if !error.is_about_one_request() => Err(error),
            _ => Ok(()),
        }
    }

    /// All pages. Servers cap pages without saying so: the last one is the one that brings nothing new.
    fn rows<R: Row>(&self, pages: &Pages<'_>, asked: &str) -> Result<Vec<R>, Error> {
        let limit = pages.limit.unwrap_or(usize::MAX);
        let (mut rows, mut seen, mut received) = (Vec::<R>::new(), HashSet::new(), 0);
        while rows.len() < limit {
            let page = self.page::<R>(pages, (limit - rows.len()).min(PAGE_ROWS), received, asked)?;
            received += page.len();
            // By the whole row: one study may be there under two patients.
            let before = rows.len();
            rows.extend(page.into_iter().filter(|row| seen.insert(row.clone())));
            if rows.len() > MAX_ROWS {
                return Err(self.too_many());
            }
            if rows.len() == before {
                break;
            }
        }
        rows.truncate(limit);
        Ok(rows)
    }

    fn too_many(&self) -> Error {
        let most = format!("{MAX_ROWS}; a narrower search has fewer");
        Error::TooLarge { server: self.client.name.clone(), found: "more rows".to_owned(), most }
    }

    fn page<R: Row>(
        &self,
        pages: &Pages<'_>,
        limit: usize,
        skipped: usize,
        asked: &str,
    ) -> Result<Vec<R>, Error> {
        let mut parameters = pages.parameters.clone();
        parameters.extend(R::EXTRA.iter().map(|tag| format!("includefield={tag:08X}")));
        parameters.push(format!("limit={limit}"));
        match pages.offset.saturating_add(skipped) {
            0 => {}
            offset => parameters.push(format!("offset={offset}")),
        }
        let path = format!("{}?{}", pages.path, parameters.join("&"));
        let answer = self.get(&path, "application/dicom+json", asked)?;
        let server = self.client.name.clone();
        let expected = "DICOM JSON (application/dicom+json)";
        // No content: no rows.
        if answer.status().as_u16() == 204 {
            return Ok(Vec::new());
        }
        if let Some(stated) = content_type(&answer).filter(|stated| !stated.contains("json")) {
            let found = format!("an answer of type \"{}\"", self.client.said(&stated));
            return Err(Error::NotDicomWeb { server, found, expected });
        }
        let mut rows = Vec::new();
        let mut reader = Reader::new(answer.into_body(), MAX_JSON_BYTES, self.cancel);
        let mut is_too_many = false;
        let visitor = EachRow(|data: &DataSet| {
            rows.push(R::read(data));
            is_too_many = rows.len() > MAX_ROWS;
            !is_too_many
        });
        let mut json = serde_json::Deserializer::from_reader(BufReader::with_capacity(64 << 10, &mut reader));
        let read = json.deserialize_seq(visitor).and_then(|()| json.end());
        drop(json);
        match read {
            Ok(()) => Ok(rows),
            Err(_) if is_too_many => Err(self.too_many()),
            Err(error) if error.is_io() => Err(reader.error(self.client, &error.into())),
            Err(error) => {
                let found = format!("other text ({})", self.client.said(&error.to_string()));
                Err(Error::NotDicomWeb { server, found, expected })
            }
        }
    }
}

/// Gives each data set of a list to a function, which says whether it wants more: a list is never in memory as a whole.
struct EachRow<F>(F);

impl<'de, F: FnMut(&DataSet) -> bool> Visitor<'de> for EachRow<F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of data sets")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<(), A::Error> {
        while let Some(data) = list.next_element::<DataSet>()? {
            if !(self.0)(&data) {
                return Err(A::Error::custom("too many rows"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_become_parameters() {
        let query = Query {
            patient_name: Some("Müller*".to_owned()),
            patient_id: Some(" ".to_owned()),
            from: Some("20200101".to_owned()),
            ..Query::default()
        };
        assert_eq!(query.parameters().unwrap(), ["PatientName=M%C3%BCller*", "StudyDate=20200101-"]);
        let query = Query { to: Some("2020-1-1".to_owned()), ..Query::default() };
        let error = query.parameters().unwrap_err().to_string();
        assert_eq!(error, "last date: found \"2020-1-1\", expected YYYYMMDD");
    }
}
