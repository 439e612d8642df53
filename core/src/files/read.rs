//! Reading a file in whatever format it has: that of the table's row that recognises it.

use std::path::{Path, PathBuf};

use super::{
    FileError, FileInfo, Loaded, LoadedTracts, Part, ReadOptions, Segment, Source, TractOptions, Which,
    bounded_gzip::Stream,
    dicom,
    format::{TRACT_FORMATS, TractFormat, is_dsi_studio, volume_format},
    tracts_tck, tracts_tsf,
};
use crate::{Check, Progress, Samples, Scaling, TractScalar, Volume, check::listed, with_samples};

/// Reads one frame of an image or mask in any of [`super::format::VOLUME_FORMATS`]. NIfTI: `.nii`, `.nii.gz` and
/// `.hdr`/`.img` pairs, each file gzipped or not, named by either half. gzip is recognised by content, not by name.
/// NRRD and MetaImage: data files are read only where they are in the header's folder or below.
///
/// # Errors
/// [`FileError::Wrong`] for any defect of the file; nothing is allocated for voxels before the header
/// has been checked against the file's length and `options.max_bytes`.
/// [`FileError::Cancelled`] when `progress` is cancelled.
pub fn read(source: &Source, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    let Source::Part(part) = source else {
        return (volume_format(source).read)(source, options, progress);
    };
    let whole = part.whole();
    let format = volume_format(&whole);
    let (frame, label) = match part.which {
        Which::Frame(frame) => (frame, None),
        Which::Segment(number) => {
            let all = (format.segments)(&whole, progress)?;
            let numbers: Vec<String> = all.iter().map(|segment| segment.number.to_string()).collect();
            let segment = all.into_iter().find(|segment| segment.number == number).ok_or_else(|| {
                let expected = match numbers.is_empty() {
                    true => "a file with named segments".to_owned(),
                    false => format!("one of its segments ({})", listed(&numbers, 8)),
                };
                FileError::wrong(whole.name(), format!("no segment {number}"), expected)
            })?;
            (segment.frame, segment.label)
        }
    };
    let mut loaded = (format.read)(&whole, &ReadOptions { frame, ..*options }, progress)?;
    loaded.frames = 1;
    if let Some(label) = label {
        loaded.volume = with_label(&loaded.volume, label);
    }
    Ok(loaded)
}

/// 1 where a label map has `label`, else 0.
fn with_label(map: &Volume, label: i64) -> Volume {
    let scaling = map.scaling();
    let is_integer = map.samples().is_integer();
    #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
    let voxels = with_samples!(map.samples(), v => v
        .iter()
        .map(|&stored| u8::from(scaling.label(stored as f64, is_integer) == Some(label as f64)))
        .collect());
    // The number of voxels is the map's.
    Volume::new(map.grid().clone(), Samples::U8(voxels), Scaling::NONE).unwrap_or_else(|| map.clone())
}

/// Header information of an image or mask. Reads the file to its end to detect damage and truncation, but keeps no
/// voxels.
///
/// # Errors
/// As [`read`], without a limit on size.
pub fn info(source: &Source, progress: &Progress) -> Result<Box<dyn FileInfo>, FileError> {
    (volume_format(source).info)(source, progress)
}

/// The files that a source is read from: one, or those of a DICOM series; none where the series isn't there.
pub fn files_of(source: &Source) -> Vec<PathBuf> {
    match source {
        Source::Embedded { .. } => Vec::new(),
        Source::File(path) | Source::Part(Part { path, .. }) if path.is_dir() => dicom::files_of(source),
        Source::File(path) | Source::Part(Part { path, .. }) => vec![path.clone()],
    }
}

/// The segmentations that a file names, each with its own name and maybe colour, in the file's order; none in an image,
/// or in a label map without names.
///
/// # Errors
/// As [`read`].
pub fn segments(source: &Source, progress: &Progress) -> Result<Vec<Segment>, FileError> {
    (volume_format(source).segments)(source, progress)
}

/// The other files that an image consists of, by its name or header: an image's second half, a header's data files.
pub(crate) fn other_files(path: &Path) -> Vec<PathBuf> {
    (volume_format(&Source::File(path.to_owned())).other_files)(path)
}

/// Reads a `.tck` or `.trk` file.
///
/// A gzip is inflated in memory first, up to `options.max_bytes`: neither format declares its size.
///
/// # Errors
/// [`FileError::Wrong`] for any defect of the file; memory is bounded by its (inflated) length, which is compared with
/// `options.max_bytes` before points are stored. [`FileError::Cancelled`] when `progress` is cancelled.
pub fn read_tracts(
    source: &Source,
    options: &TractOptions,
    progress: &Progress,
) -> Result<LoadedTracts, FileError> {
    match source {
        Source::File(path) | Source::Part(Part { path, .. }) => {
            read_stream(Stream::open(path, progress)?, options)
        }
        Source::Embedded { name, bytes } => read_tract_bytes(name, bytes, options, progress),
    }
}

/// As [`read_tracts`], from memory; messages call the file `name`.
///
/// # Errors
/// As [`read_tracts`].
pub fn read_tract_bytes(
    name: &str,
    bytes: &[u8],
    options: &TractOptions,
    progress: &Progress,
) -> Result<LoadedTracts, FileError> {
    read_stream(Stream::of_bytes(name, bytes, progress)?, options)
}

fn read_stream(stream: Stream<'_>, options: &TractOptions) -> Result<LoadedTracts, FileError> {
    if stream.is_gzip() {
        let (file, progress) = (stream.file().to_owned(), stream.progress());
        let bytes = stream.inflate(options.max_bytes)?;
        return read_plain(Stream::of_bytes(&file, &bytes, progress)?, options);
    }
    read_plain(stream, options)
}

/// Reads a `.tsf` file, gzipped or not: a scalar of the points of `of`, which were read from a `.tck`. It is called
/// `name`.
///
/// # Errors
/// [`FileError::Wrong`] for any defect of the file, and where it hasn't a value for each point of each fibre; memory is
/// bounded as for [`read_tracts`]. [`FileError::Cancelled`] when `progress` is cancelled.
pub fn read_tract_scalar(
    source: &Source,
    name: &str,
    of: &LoadedTracts,
    options: &TractOptions,
    progress: &Progress,
) -> Result<(TractScalar, Vec<Check>), FileError> {
    let stream = match source {
        Source::File(path) | Source::Part(Part { path, .. }) => Stream::open(path, progress)?,
        Source::Embedded { name, bytes } => Stream::of_bytes(name, bytes, progress)?,
    };
    if stream.is_gzip() {
        let file = stream.file().to_owned();
        let bytes = stream.inflate(options.max_bytes)?;
        return tracts_tsf::read(Stream::of_bytes(&file, &bytes, progress)?, name.to_owned(), of, options);
    }
    tracts_tsf::read(stream, name.to_owned(), of, options)
}

fn read_plain(mut stream: Stream<'_>, options: &TractOptions) -> Result<LoadedTracts, FileError> {
    let each = TRACT_FORMATS.iter().map(|format| {
        let magic = String::from_utf8_lossy(format.magic);
        format!("a .{} that begins with \"{magic}\"", format.endings.join(" or ."))
    });
    let expected = format!("tracts: {}", each.collect::<Vec<_>>().join(" or "));
    let wrong =
        |stream: &Stream<'_>, found: &str, expected: &str| FileError::wrong(stream.file(), found, expected);
    if is_dsi_studio(stream.file()) {
        return Err(wrong(&stream, "fibre tracts of DSI Studio (.tt.gz)", &expected));
    }
    if stream.is_gzip() {
        return Err(wrong(&stream, "a gzip within a gzip", &expected));
    }
    if stream.remaining() > options.max_bytes {
        let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
        return Err(wrong(&stream, &format!("{} bytes of tracts", stream.remaining()), &expected));
    }
    // Shortest magic first, so that no bytes beyond the matching one are consumed.
    let mut rows: Vec<&TractFormat> = TRACT_FORMATS.iter().collect();
    rows.sort_by_key(|format| format.magic.len());
    let mut head = Vec::new();
    for format in rows {
        let read_len = head.len();
        head.resize(format.magic.len(), 0);
        let added_len = stream.fill(&mut head[read_len..])?;
        head.truncate(read_len + added_len);
        if head == format.magic {
            return (format.read)(stream);
        }
    }
    if tracts_tsf::MAGIC.starts_with(&head) && head.len() == tracts_tck::MAGIC.len() {
        let expected = "tracts; --tracts FILE.tck before it says whose scalars these are";
        return Err(wrong(&stream, "scalars of fibres (.tsf)", expected));
    }
    if head.is_empty() {
        return Err(stream.ends_early(&expected));
    }
    Err(wrong(&stream, "other content", &expected))
}
