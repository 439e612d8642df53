//! The table of file formats. Discovery, dialogs, filters, help and messages take their words from its rows.

use super::{
    FileError, Loaded, ReadOptions, Source, bounded_gzip::Stream, nifti, tracts::LoadedTracts, tracts_tck,
    tracts_trk,
};
use crate::Progress;

/// Most bytes that telling a format needs.
const SNIFFED_BYTES: usize = 512;

/// What a file says about itself, in the words of its format.
pub trait FileInfo {
    /// A line each, for people.
    fn text(&self) -> String;
    /// As JSON, indented; keys are stable.
    ///
    /// # Errors
    /// When a number is not finite.
    fn json(&self) -> serde_json::Result<String>;
}

/// A format of images and masks.
pub struct VolumeFormat {
    /// What people call it.
    pub name: &'static str,
    /// Endings of its files, lower case, without the dot.
    pub endings: &'static [&'static str],
    /// Those that stand for a whole image: not the second half of a pair.
    pub whole: &'static [&'static str],
    /// Whether a file that begins with these (unpacked) bytes is one.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads one frame: see [`super::read`].
    pub read: fn(&Source, &ReadOptions, &Progress) -> Result<Loaded, FileError>,
    /// What the file says about itself.
    pub info: fn(&Source, &Progress) -> Result<Box<dyn FileInfo>, FileError>,
}

/// A format of fibre tracts.
pub struct TractFormat {
    /// What people call it.
    pub name: &'static str,
    /// Endings of its files, lower case, without the dot.
    pub endings: &'static [&'static str],
    /// The bytes that its files begin with.
    pub magic: &'static [u8],
    /// Reads on behind `magic`.
    pub(super) read: fn(Stream<'_>) -> Result<LoadedTracts, FileError>,
}

/// Every format of images and masks; the first is taken for files that no row knows.
pub const VOLUME_FORMATS: &[VolumeFormat] = &[VolumeFormat {
    name: "NIfTI",
    endings: &["nii", "nii.gz", "hdr", "hdr.gz", "img", "img.gz"],
    whole: &["nii", "nii.gz", "hdr", "hdr.gz"],
    sniff: nifti::sniff,
    read: nifti::read,
    info: |source, progress| Ok(Box::new(nifti::nifti_info_with(source, progress)?)),
}];

/// Every format of fibre tracts.
pub const TRACT_FORMATS: &[TractFormat] = &[
    TractFormat { name: "MRtrix", endings: &["tck"], magic: tracts_tck::MAGIC, read: tracts_tck::read },
    TractFormat { name: "TrackVis", endings: &["trk"], magic: tracts_trk::MAGIC, read: tracts_trk::read },
];

/// `name` without the dot and `ending`, in any case; `None` where it has another, or is nothing else.
fn without_ending<'a>(name: &'a str, ending: &str) -> Option<&'a str> {
    let at = name.len().checked_sub(ending.len())?;
    let (stem, tail) = (name.get(..at)?, name.get(at..)?);
    stem.strip_suffix('.').filter(|stem| !stem.is_empty() && tail.eq_ignore_ascii_case(ending))
}

/// `name` without the longest of `endings` that it has.
fn stem<'a>(name: &'a str, endings: impl Iterator<Item = &'static str>) -> Option<&'a str> {
    endings.filter_map(|ending| without_ending(name, ending)).min_by_key(|stem| stem.len())
}

/// The name of a file that is an image by its ending, without it; `None` for other files and for the second half of
/// a pair.
pub fn volume_stem(name: &str) -> Option<&str> {
    stem(name, VOLUME_FORMATS.iter().flat_map(|format| format.whole).copied())
}

/// Whether a file has an ending of images, or of halves of them.
pub fn is_volume(name: &str) -> bool {
    stem(name, endings(VOLUME_FORMATS.iter().map(|format| format.endings))).is_some()
}

/// Whether a file has an ending of fibre tracts.
pub fn is_tracts(name: &str) -> bool {
    stem(name, tract_endings()).is_some()
}

fn endings(of: impl Iterator<Item = &'static [&'static str]>) -> impl Iterator<Item = &'static str> {
    of.flatten().copied()
}

/// Endings of fibre tracts, without the dot.
pub fn tract_endings() -> impl Iterator<Item = &'static str> {
    endings(TRACT_FORMATS.iter().map(|format| format.endings))
}

/// Last parts of the endings of images, without the dot: what a file dialog filters by.
pub fn volume_filter() -> Vec<&'static str> {
    let all = endings(VOLUME_FORMATS.iter().map(|format| format.endings));
    let mut last: Vec<&str> = all.filter_map(|ending| ending.rsplit('.').next()).collect();
    last.sort_unstable();
    last.dedup();
    last
}

/// The formats of images in words: `NIfTI`.
pub fn volume_names() -> String {
    VOLUME_FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(" or ")
}

/// The endings of whole images in words: `.nii, .nii.gz`.
pub fn volume_endings() -> String {
    let all = VOLUME_FORMATS.iter().flat_map(|format| format.whole);
    all.map(|ending| format!(".{ending}")).collect::<Vec<_>>().join(", ")
}

/// The format of a file: by its first bytes, else by its ending, else the first of the table, whose reader tells what
/// is wrong.
pub fn volume_format(source: &Source) -> &'static VolumeFormat {
    let progress = Progress::new();
    let stream = match source {
        Source::File(path) => Stream::open(path, &progress),
        Source::Embedded { name, bytes } => Stream::of_bytes(name, bytes, &progress),
    };
    let mut begin = [0; SNIFFED_BYTES];
    let have = stream.and_then(|mut stream| stream.fill(&mut begin)).unwrap_or(0);
    let name = source.name();
    let mut rows = VOLUME_FORMATS.iter();
    rows.find(|format| (format.sniff)(&begin[..have]))
        .or_else(|| {
            let named = |format: &&VolumeFormat| stem(&name, format.endings.iter().copied()).is_some();
            VOLUME_FORMATS.iter().find(named)
        })
        .unwrap_or(&VOLUME_FORMATS[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_their_endings() {
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
    }

    #[test]
    fn no_two_rows_share_an_ending_and_words_are_of_the_rows() {
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
    fn content_tells_the_format_before_the_name_does() {
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
