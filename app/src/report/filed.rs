//! Reports as DICOM objects, which an archive files with the images: the pages as an encapsulated PDF, the measurements as
//! a structured report.

use std::{collections::HashMap, path::Path};

use glioscope_core::{
    Progress,
    case::{Case, CaseSpec, OrderBasis},
    dates::leading_date,
    files::dicom::{
        self, EvaluationGroup, Measured, MeasurementGroup, ReportTo, SourceImage, SourceSegment, SumOf,
        Whose, encapsulated_pdf, measurement_report,
    },
    lesions::{LesionDate, LesionsReport},
    response::{Call, DateResponse, Judgement, Quantity, Response},
};

use super::{
    Form,
    identity::{Identity, initials},
    recipe::Input,
};
use crate::{
    error::AppError,
    export,
    model::{Document, ExportFormat},
    words::Language,
    world::response::Answered,
};

/// What a file's ending asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// The pages.
    Pages(Form),
    /// The pages as PDF in a DICOM object: `.dcm`.
    EncapsulatedPdf,
    /// The measurements as a DICOM structured report: `.sr.dcm`.
    Structured,
    /// All numbers, as JSON or CSV.
    Numbers(ExportFormat),
}

impl FileKind {
    /// The endings, for messages.
    pub const ENDINGS: &str = ".html, .pdf, .md, .json, .csv, .dcm, .sr.dcm";

    /// That of a file.
    pub fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        if name.ends_with(".sr.dcm") {
            return Some(Self::Structured);
        }
        let is_dicom = name.ends_with(".dcm") && name != ".dcm";
        if is_dicom {
            return Some(Self::EncapsulatedPdf);
        }
        Form::of(path).map(Self::Pages).or_else(|| ExportFormat::of(path).map(Self::Numbers))
    }

    /// # Errors
    /// [`AppError`] for a language that it can't have.
    pub fn check_language(self, language: Language) -> Result<(), AppError> {
        if matches!(self, Self::Structured | Self::Numbers(_)) && language != Language::En {
            let expected = "English (en), as its codes and keys are";
            return Err(AppError::wrong(
                "the language of a structured report or of numbers",
                "another",
                expected,
            ));
        }
        Ok(())
    }
}

/// What DICOM objects state of a case beside the report.
pub struct Filing {
    identity: Identity,
    initials: String,
    /// The images of the case, newest date first; none where the report doesn't name the patient.
    images: Vec<SourceImage>,
    /// The segments that masks were read from, by date and id; likewise.
    segments: HashMap<(String, String), SourceSegment>,
    /// `YYYYMMDD` of the newest date.
    date: Option<String>,
    seed: String,
    /// What was assumed, for the user.
    pub notes: Vec<String>,
}

impl Filing {
    /// That of a case as it was read, before anything is renamed.
    ///
    /// # Errors
    /// [`AppError`] for a file that can't be read, and where a DICOM image lacks UIDs; cancelled.
    pub fn of(
        case: &Case,
        spec: &CaseSpec,
        identity: Identity,
        progress: &Progress,
    ) -> Result<Self, AppError> {
        let (mut images, mut segments): (Vec<SourceImage>, _) = (Vec::new(), HashMap::new());
        if identity == Identity::Full {
            for time in case.time_points.iter().rev() {
                let is_of_time = |of: &Option<String>| of.as_deref().unwrap_or_default() == time.label;
                for context in spec.contexts.iter().filter(|context| is_of_time(&context.time)) {
                    let found = export::dicom_image(&context.source, progress)?;
                    let is_new = |image: &SourceImage| images.iter().all(|i| i.series() != image.series());
                    images.extend(found.filter(is_new));
                }
                let whole =
                    |mask: &&glioscope_core::case::MaskSpec| mask.labels.is_none() && mask.above.is_none();
                for mask in spec.masks.iter().filter(|mask| is_of_time(&mask.time)).filter(whole) {
                    if let Some(segment) = dicom::source_segment(&mask.source, progress)? {
                        segments.insert((time.label.clone(), mask.id.clone()), segment);
                    }
                }
            }
        }
        let dates = case.time_points.iter().filter_map(|time| leading_date(&time.label));
        let date = dates.max().map(|date| date.strftime("%Y%m%d").to_string());
        let mut notes = Vec::new();
        if images.is_empty() && identity == Identity::Full {
            notes.push("no DICOM image of the case: the report is of a new study of nobody".to_owned());
        }
        if images.is_empty() && date.is_none() {
            notes.push(
                "no date of the case: the report states 1900-01-01, which stands for unknown".to_owned(),
            );
        }
        let inputs = case.inputs.paths().iter().map(|path| Input::of(path, false, progress));
        let inputs = inputs.collect::<Result<Vec<_>, _>>()?;
        let seed = inputs.into_iter().map(|input| input.sha256).collect::<Vec<_>>().join(" ");
        let initials = initials(&case.patient.name);
        Ok(Self { identity, initials, images, segments, date, seed, notes })
    }

    fn to(&self) -> ReportTo<'_> {
        ReportTo {
            whose: match self.identity {
                Identity::None => Whose::Removed,
                Identity::Initials => Whose::Initials(&self.initials),
                Identity::Full => Whose::Images(&self.images),
            },
            seed: &self.seed,
            date: self.date.as_deref(),
            version: env!("CARGO_PKG_VERSION"),
        }
    }

    /// A report's PDF as a DICOM object; `title`: the report's.
    ///
    /// # Errors
    /// [`AppError`] where it is too large.
    pub fn encapsulated(&self, pdf: &[u8], title: &str) -> Result<Vec<u8>, AppError> {
        Ok(encapsulated_pdf(pdf, title, self.identity != Identity::None, &self.to())?)
    }

    /// The measurements of a case as its report may show it: masks on the grids of their files, and lesions but small ones.
    ///
    /// # Errors
    /// [`AppError`] for a case without masks.
    pub(super) fn structured(
        &self,
        case: &Case,
        doc: &Document,
        lesions: Option<&LesionsReport>,
        answered: Option<&Answered>,
    ) -> Result<Vec<u8>, AppError> {
        let is_ordered = case.order != OrderBasis::Unknown && case.time_points.len() > 1;
        let order = |at: usize| is_ordered.then_some(at + 1);
        let mut groups = Vec::new();
        for (at, time) in case.time_points.iter().enumerate() {
            groups.extend(time.masks.iter().map(|mask| MeasurementGroup {
                measured: Measured::Mask,
                name: doc.edit.masks.name(mask.mask.id()),
                time: time.label.clone(),
                order: order(at),
                volume_ml: mask.native_volume_ml,
                diameters: None,
                segment: self.segments.get(&(time.label.clone(), mask.mask.id().to_owned())).cloned(),
            }));
        }
        if let Some(report) = lesions {
            let mask = report.of.split('+').map(|id| doc.edit.masks.name(id)).collect::<Vec<_>>().join("+");
            for lesion in report.lesions.iter().filter(|lesion| !lesion.small) {
                let name = format!("{mask}: lesion {}", lesion.id);
                let group = |(at, date): (usize, &LesionDate)| {
                    Some(MeasurementGroup {
                        measured: Measured::Lesion,
                        name: name.clone(),
                        time: date.time.clone(),
                        order: order(at),
                        volume_ml: date.volume_ml?,
                        diameters: date
                            .d1_mm
                            .zip(date.d2_mm)
                            .zip(date.product_mm2)
                            .map(|((a, b), c)| [a, b, c]),
                        segment: None,
                    })
                };
                groups.extend(lesion.dates.iter().enumerate().filter_map(group));
            }
        }
        let order_of = |label: &str| case.time_at(label).and_then(order);
        let evaluations =
            answered.map(|answered| evaluations(&answered.evaluated.response, &order_of)).unwrap_or_default();
        Ok(measurement_report(&groups, &evaluations, &self.to())?)
    }
}

/// The calls of every scan, by diameters and by volume; `order`: a scan's number by its label.
fn evaluations(response: &Response, order: &dyn Fn(&str) -> Option<usize>) -> Vec<EvaluationGroup> {
    let criterion = response.criterion.name();
    let group = |date: &DateResponse, judgement: &Judgement, by: &str| EvaluationGroup {
        criteria: format!("{criterion}, by {by}"),
        time: date.date.clone(),
        order: order(&date.date),
        call: code_of(judgement.call),
        sums: judgement.sums.iter().filter_map(|sum| Some((sum_of(sum.quantity), sum.sum?))).collect(),
    };
    let of_date = |date: &DateResponse| {
        [group(date, &date.by_diameters, "diameters"), group(date, &date.by_volume, "volume")]
    };
    response.dates.iter().flat_map(of_date).collect()
}

fn sum_of(quantity: Quantity) -> SumOf {
    match quantity {
        Quantity::ProductMm2 => SumOf::Products,
        Quantity::LongestMm => SumOf::Longest,
        Quantity::VolumeMl => SumOf::Volumes,
    }
}

/// A call as a code and its meaning.
fn code_of(call: Call) -> [&'static str; 2] {
    match call {
        Call::Baseline => ["BASELINE", "Baseline"],
        Call::BeforeBaseline => ["BEFORE_BASELINE", "Before baseline"],
        Call::CompleteResponse => ["CR", "Complete response"],
        Call::UnconfirmedCompleteResponse => ["CR_UNCONFIRMED", "Complete response, unconfirmed"],
        Call::PartialResponse => ["PR", "Partial response"],
        Call::UnconfirmedPartialResponse => ["PR_UNCONFIRMED", "Partial response, unconfirmed"],
        Call::MinorResponse => ["MR", "Minor response"],
        Call::UnconfirmedMinorResponse => ["MR_UNCONFIRMED", "Minor response, unconfirmed"],
        Call::StableDisease => ["SD", "Stable disease"],
        Call::Progression => ["PD", "Progressive disease"],
        Call::PreliminaryProgression => ["PD_PRELIMINARY", "Progressive disease, preliminary"],
        Call::Observe => ["OBSERVE", "Neither stable nor progressive disease: observe"],
        Call::CannotSay => ["CANNOT_SAY", "Cannot be said"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_what_its_ending_says() {
        for (name, kind) in [
            ("a.html", Some(FileKind::Pages(Form::Html))),
            ("a.PDF", Some(FileKind::Pages(Form::Pdf))),
            ("a.dcm", Some(FileKind::EncapsulatedPdf)),
            ("a.sr.DCM", Some(FileKind::Structured)),
            ("sr.dcm", Some(FileKind::EncapsulatedPdf)),
            (".dcm", None),
            ("dcm", None),
        ] {
            assert_eq!(FileKind::of(Path::new(name)), kind, "{name}");
        }
    }
}
