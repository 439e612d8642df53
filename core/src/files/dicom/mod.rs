//! DICOM: images, segmentations and structure sets (PS3.3, PS3.5, PS3.10). Everything up to the pixels is read by a parser
//! of our own that checks each length against the file before it allocates; kept crates decompress pixels.

mod codec;
mod data_set;
mod info;
mod instance;
mod isolated;
mod jpeg_ls;
mod open;
mod parse;
mod pixels;
mod planes;
mod scan;
mod segmentation;
mod series;
mod stack;
mod structure_set;
mod study;
mod suv;
mod tags;
mod text;

pub(super) use info::info;
pub use instance::Patient;
pub use isolated::{DECODER_ARGUMENT, decode_frames_with, serve};
pub use open::inspect;
pub(super) use open::{files_of, read, segments};
pub(super) use parse::sniff;
pub use scan::Kind;
pub use study::{
    PatientStudies, SeriesSummary, Studies, StudySummary, VolumeSummary, is_dicom, series_of, studies,
};
