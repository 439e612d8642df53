//! The table of file formats: discovery, file dialogs, help and messages are derived from its rows.

use std::path::{Path, PathBuf};

use super::{
    FileError, FileInfo, Loaded, Part, ReadOptions, Segment, Source, bounded_gzip::Stream, dicom, metaimage,
    mgh, nifti, nrrd, tracts::LoadedTracts, tracts_tck, tracts_trk,
};
use crate::Progress;

/// Bytes from the start of a file that format recognition needs at most.
const SNIFFED_BYTES: usize = 512;

/// Reads a file's header information.
pub type ReadInfo = fn(&Source, &Progress) -> Result<Box<dyn FileInfo>, FileError>;

/// Reads the names of the segmentations in a file.
pub type ReadSegments = fn(&Source, &Progress) -> Result<Vec<Segment>, FileError>;

/// A file format of images and masks.
pub struct VolumeFormat {
    /// Display name.
    pub name: &'static str,
    /// Its file extensions, lower case, without the leading dot.
    pub endings: &'static [&'static str],
    /// The extensions that name a whole image: not the second half of a pair.
    pub whole: &'static [&'static str],
    /// Whether a folder may be an image: its files are slices.
    pub has_folders: bool,
    /// Whether a file whose (uncompressed) content begins with these bytes has this format.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads one frame, see [`super::read()`].
    pub read: fn(&Source, &ReadOptions, &Progress) -> Result<Loaded, FileError>,
    /// Reads the header information, see [`super::info()`].
    pub info: ReadInfo,
    /// Reads the names of the segmentations that it holds, see [`super::segments()`].
    pub segments: ReadSegments,
    /// The other files that the image of a file consists of.
    pub(super) other_files: fn(&Path) -> Vec<PathBuf>,
}

/// A file format of fibre tracts.
pub struct TractFormat {
    /// Display name.
    pub name: &'static str,
    /// Its file extensions, lower case, without the leading dot.
    pub endings: &'static [&'static str],
    /// The bytes its files begin with.
    pub magic: &'static [u8],
    /// Reads the rest of the file, after `magic`.
    pub(super) read: fn(Stream<'_>) -> Result<LoadedTracts, FileError>,
}

/// All formats of images and masks; the first is the fallback for unrecognised files.
pub const VOLUME_FORMATS: &[VolumeFormat] = &[
    VolumeFormat {
        name: "NIfTI",
        endings: &["nii", "nii.gz", "hdr", "hdr.gz", "img", "img.gz"],
        whole: &["nii", "nii.gz", "hdr", "hdr.gz"],
        has_folders: false,
        sniff: nifti::sniff,
        read: nifti::read,
        info: |source, progress| Ok(Box::new(nifti::nifti_info_with(source, progress)?)),
        segments: nifti::segments,
        other_files: |path| nifti::other_half(path).into_iter().collect(),
    },
    VolumeFormat {
        name: "NRRD",
        endings: &["nrrd", "nhdr"],
        whole: &["nrrd", "nhdr"],
        has_folders: false,
        sniff: nrrd::sniff,
        read: nrrd::read,
        info: |source, progress| Ok(Box::new(nrrd::info(source, progress)?)),
        segments: nrrd::segments,
        other_files: nrrd::other_files,
    },
    VolumeFormat {
        name: "MetaImage",
        endings: &["mha", "mhd"],
        whole: &["mha", "mhd"],
        has_folders: false,
        sniff: metaimage::sniff,
        read: metaimage::read,
        info: |source, progress| Ok(Box::new(metaimage::info(source, progress)?)),
        segments: |_, _| Ok(Vec::new()),
        other_files: metaimage::other_files,
    },
    VolumeFormat {
        name: "MGH",
        endings: &["mgz", "mgh", "mgh.gz"],
        whole: &["mgz", "mgh", "mgh.gz"],
        has_folders: false,
        sniff: mgh::sniff,
        read: mgh::read,
        info: |source, progress| Ok(Box::new(mgh::info(source, progress)?)),
        segments: |_, _| Ok(Vec::new()),
        other_files: |_| Vec::new(),
    },
    VolumeFormat {
        name: "DICOM",
        endings: &["dcm", "ima"],
        // A file is a slice of its series, or holds masks.
        whole: &[],
        has_folders: true,
        sniff: dicom::sniff,
        read: dicom::read,
        info: dicom::info,
        segments: dicom::segments,
        other_files: |_| Vec::new(),
    },
];

/// All formats of fibre tracts.
pub const TRACT_FORMATS: &[TractFormat] = &[
    TractFormat {
        name: "MRtrix",
        endings: &["tck", "tck.gz"],
        magic: tracts_tck::MAGIC,
        read: tracts_tck::read,
    },
    TractFormat {
        name: "TrackVis",
        endings: &["trk", "trk.gz"],
        magic: tracts_trk::MAGIC,
        read: tracts_trk::read,
    },
];

/// `name` without the dot and `ending`, ignoring case; `None` for another extension or an empty stem.
fn without_ending<'a>(name: &'a str, ending: &str) -> Option<&'a str> {
    let at = name.len().checked_sub(ending.len())?;
    let (stem, tail) = (name.get(..at)?, name.get(at..)?);
    stem.strip_suffix('.').filter(|stem| !stem.is_empty() && tail.eq_ignore_ascii_case(ending))
}

/// `name` without the longest matching extension of `endings`.
fn stem(name: &str, endings: impl Iterator<Item = &'static str>) -> Option<&str> {
    endings.filter_map(|ending| without_ending(name, ending)).min_by_key(|stem| stem.len())
}

/// File name without its image extension; `None` for other files and for the second half of a pair.
pub fn volume_stem(name: &str) -> Option<&str> {
    stem(name, VOLUME_FORMATS.iter().flat_map(|format| format.whole).copied())
}

/// Whether a file has an image extension, second halves of pairs included.
pub fn is_volume(name: &str) -> bool {
    stem(name, endings(VOLUME_FORMATS.iter().map(|format| format.endings))).is_some()
}

/// File name without its fibre tract extension; `None` for other files.
pub fn tract_stem(name: &str) -> Option<&str> {
    stem(name, tract_endings())
}

/// Whether a file's name is that of fibre tracts of DSI Studio, which are named instead of read: the layout of `.tt.gz` is
/// that program's own.
pub fn is_dsi_studio(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.ends_with(".tt.gz") || name.ends_with(".tt")
}

/// Whether a file has a fibre tract extension.
pub fn is_tracts(name: &str) -> bool {
    tract_stem(name).is_some()
}

/// Extensions of scalars of MRtrix's tracts, without the dot.
const SCALAR_ENDINGS: &[&str] = &["tsf", "tsf.gz"];

/// File name without its extension of scalars of tracts; `None` for other files.
pub fn tract_scalar_stem(name: &str) -> Option<&str> {
    stem(name, SCALAR_ENDINGS.iter().copied())
}

fn endings(of: impl Iterator<Item = &'static [&'static str]>) -> impl Iterator<Item = &'static str> {
    of.flatten().copied()
}

/// Extensions of fibre tracts, without the dot.
pub fn tract_endings() -> impl Iterator<Item = &'static str> {
    endings(TRACT_FORMATS.iter().map(|format| format.endings))
}

/// Last components of the image extensions, without the dot, for the filter of a file dialog.
pub fn volume_filter() -> Vec<&'static str> {
    let all = endings(VOLUME_FORMATS.iter().map(|format| format.endings));
    let mut last: Vec<&str> = all.filter_map(|ending| ending.rsplit('.').next()).collect();
    last.sort_unstable();
    last.dedup();
    last
}

/// Names of the image formats for messages: `NIfTI, NRRD or MGH`.
pub fn volume_names() -> String {
    let names: Vec<&str> = VOLUME_FORMATS.iter().map(|format| format.name).collect();
    match names.split_last() {
        Some((last, [])) => (*last).to_owned(),
        Some((last, others)) => format!("{} or {last}", others.join(", ")),
        None => String::new(),
    }
}

/// Extensions of whole images for messages: `.nii, .nii.gz`.
pub fn volume_endings() -> String {
    let all = VOLUME_FORMATS.iter().flat_map(|format| format.whole);
    all.map(|ending| format!(".{ending}")).collect::<Vec<_>>().join(", ")
}

/// The format of a file: by its first bytes, else by its extension, else the first of the table, whose reader reports
/// what is wrong.
pub fn volume_format(source: &Source) -> &'static VolumeFormat {
    let progress = Progress::new();
    if source.path().is_some_and(Path::is_dir)
        && let Some(format) = VOLUME_FORMATS.iter().find(|format| format.has_folders)
    {
        return format;
    }
    let stream = match source {
        Source::File(path) | Source::Part(Part { path, .. }) => Stream::open(path, &progress),
        Source::Embedded { name, bytes } => Stream::of_bytes(name, bytes, &progress),
    };
    let mut head = [0; SNIFFED_BYTES];
    let read_len = stream.and_then(|mut stream| stream.fill(&mut head)).unwrap_or(0);
    let name = source.path().map_or_else(|| source.name(), |path| path.display().to_string());
    let mut rows = VOLUME_FORMATS.iter();
    rows.find(|format| (format.sniff)(&head[..read_len]))
        .or_else(|| {
            let has_extension =
                |format: &&VolumeFormat| stem(&name, format.endings.iter().copied()).is_some();
            VOLUME_FORMATS.iter().find(has_extension)
        })
        .unwrap_or(&VOLUME_FORMATS[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_are_stripped_ignoring_case() {
        for (name, stem) in [
            ("A.NII.GZ", "A"),
            ("SCAN.v2.NII.Gz", "SCAN.v2"),
            ("x.Hdr", "x"),
            ("x.hdr.gz", "x"),
            ("é.nii", "é"),
        ] {
            assert_eq!(volume_stem(name), Some(stem), "{name}");
        }
        for other in ["a.img", "a.img.gz", "a.txt", ".nii", ".nii.gz", "nii", "LICENSE", "a.nii.bz2", "é"] {
            assert_eq!(volume_stem(other), None, "{other}");
        }
        assert!(is_volume("a.IMG.gz") && !is_volume("a.tck") && is_tracts("a.TRK") && !is_tracts("a.nii"));
        assert!(is_tracts("a.trk.GZ") && !is_tracts("a.gz") && !is_tracts("a.nii.gz"));
        assert_eq!((tract_stem("a.b.tck.gz"), tract_stem("a.trk")), (Some("a.b"), Some("a")));
    }

    #[test]
    fn extensions_are_unique_and_message_texts_follow_the_table() {
        let mut all: Vec<&str> =
            endings(VOLUME_FORMATS.iter().map(|f| f.endings)).chain(tract_endings()).collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
        for format in VOLUME_FORMATS {
            assert!(volume_names().contains(format.name));
            assert!(format.whole.iter().all(|w| format.endings.contains(w)), "{}", format.name);
            assert!(format.endings.iter().all(|e| is_volume(&format!("a.{e}"))));
        }
    }

    #[test]
    fn each_format_is_recognised_by_content_and_by_name() {
        let of =
            |name: &'static str, bytes: &'static [u8]| volume_format(&Source::Embedded { name, bytes }).name;
        assert_eq!(of("a.bin", b"NRRD0004\ntype: int\n"), "NRRD");
        assert_eq!(of("a.nii", b"ObjectType = Image\n"), "MetaImage");
        assert_eq!(of("a.bin", b"NDims=3\r\n"), "MetaImage");
        assert_eq!(of("case.toml", b"name = \"x\"\n"), "NIfTI");
        let mut header = vec![0; 284];
        for (at, number) in [1_i32, 2, 3, 4, 1, 3].into_iter().enumerate() {
            header[4 * at..][..4].copy_from_slice(&number.to_be_bytes());
        }
        assert_eq!(of("a.bin", header.leak()), "MGH");
        for (name, format) in [
            ("a.seg.nrrd", "NRRD"),
            ("a.NHDR", "NRRD"),
            ("a.mha", "MetaImage"),
            ("a.mhd", "MetaImage"),
            ("a.mgh.gz", "MGH"),
            ("a.mgz", "MGH"),
            ("a.raw", "NIfTI"),
        ] {
            assert_eq!(of(name, b""), format, "{name}");
        }
        assert_eq!((volume_stem("a.seg.nrrd"), volume_stem("a.raw")), (Some("a.seg"), None));
        assert_eq!(volume_names(), "NIfTI, NRRD, MetaImage, MGH or DICOM");
    }

    #[test]
    fn content_takes_precedence_over_the_file_name() {
        let mut header = vec![0; 352];
        header[..4].copy_from_slice(&348_i32.to_le_bytes());
        let bytes: &'static [u8] = header.leak();
        for name in ["a.nii", "a.bin"] {
            let format = volume_format(&Source::Embedded { name, bytes });
            assert_eq!(format.name, "NIfTI");
        }
        assert!(!nifti::sniff(b"NRRD0004") && !nifti::sniff(b""));
    }
}
