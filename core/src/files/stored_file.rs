//! A stored file: on disk, or in memory.

use std::path::PathBuf;

use super::{
    FileError, Part, Source,
    bounded_gzip::{Packing, Stream},
    open_regular, printable,
};
use crate::Progress;

/// Where bytes are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Place<'a> {
    /// In a file.
    File(PathBuf),
    /// In memory, with the name of the file they come from.
    Bytes(&'a str, &'a [u8]),
}

impl<'a> From<&'a Source> for Place<'a> {
    fn from(source: &'a Source) -> Self {
        match source {
            Source::File(path) | Source::Part(Part { path, .. }) => Self::File(path.clone()),
            Source::Embedded { name, bytes } => Self::Bytes(name, bytes),
        }
    }
}

impl Place<'_> {
    /// The name in messages.
    pub(super) fn name(&self) -> String {
        match self {
            Self::File(path) => printable(&path.display().to_string()),
            Self::Bytes(name, _) => printable(name),
        }
    }

    /// Size of the file.
    pub(super) fn stored_bytes(&self) -> Result<u64, FileError> {
        match self {
            Self::File(path) => Ok(open_regular(path)?.1),
            Self::Bytes(_, bytes) => Ok(bytes.len() as u64),
        }
    }

    /// The bytes from offset `start` on.
    pub(super) fn stream<'p>(
        &'p self,
        start: u64,
        packing: Packing,
        progress: &'p Progress,
    ) -> Result<Stream<'p>, FileError> {
        match self {
            Self::File(path) => Stream::open_at(path, start, packing, progress),
            Self::Bytes(name, bytes) => Stream::of_bytes_at(name, bytes, start, packing, progress),
        }
    }
}
