//! DICOM: images, segmentations and structure sets (PS3.3, PS3.5, PS3.10). Everything up to the pixels is read by a parser
//! of our own that checks each length against the file before it allocates; kept crates decompress pixels. Masks are written as
//! segmentations and structure sets, reports as encapsulated PDF and structured reports.

mod codec;
mod data_set;
mod decoders;
mod info;
mod instance;
mod isolated;
mod jpeg_ls;
mod measurement_report;
mod modules;
mod open;
mod outline;
mod parse;
mod pixels;
mod planes;
#[cfg(test)]
mod report_tests;
mod report_write;
mod representation;
mod scan;
mod segmentation;
mod segmentation_write;
mod series;
mod slices_to_write;
mod source_image;
mod source_segment;
mod stack;
mod structure_set;
mod structure_set_write;
mod study;
mod suv;
mod tags;
mod text;
mod write;
#[cfg(test)]
mod write_tests;

pub(super) use info::info;
pub use instance::Patient;
pub use isolated::{DECODER_ARGUMENT, decode_frames_with, serve};
pub use measurement_report::{EvaluationGroup, Measured, MeasurementGroup, SumOf, measurement_report};
pub use modules::{SegmentToWrite, WriteTo, Written};
pub use open::inspect;
pub(super) use open::{files_of, read, segments};
pub(super) use parse::sniff;
pub use report_write::{ReportTo, Whose, encapsulated_pdf};
pub use scan::Kind;
pub use segmentation_write::segmentation;
pub use source_image::{SourceImage, source_image};
pub use source_segment::{SourceSegment, source_segment};
pub use structure_set_write::structure_set;
pub use study::{
    PatientStudies, SeriesSummary, Studies, StudySummary, VolumeSummary, is_dicom, series_of, studies,
};
