//! File formats of transforms, and which one a file has by its content.

use std::path::Path;

use super::{
    EXPECTED, HEAD_BYTES, Refusal, content, itk_hdf, itk_mat, lta, matrix, name_of, quoted, register_dat,
};
use crate::files::FileError;

/// The first line of ITK's text, whatever its version.
const ITK_TEXT: &str = "#Insight Transform File";

/// File formats of transforms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text of ITK, as of ANTs, 3D Slicer and SimpleITK: `.tfm`, `.txt`.
    ItkText,
    /// MATLAB 4 of ITK, as `0GenericAffine.mat` of ANTs.
    ItkMat,
    /// HDF5 of ITK, as of 3D Slicer and composites of ANTs: `.h5`, `.hdf5`.
    ItkHdf,
    /// Matrix of FLIRT: a bare 4x4 matrix to look at.
    Flirt,
    /// Linear transform array of FreeSurfer.
    Lta,
    /// Registration file of FreeSurfer's tkregister.
    RegisterDat,
    /// A bare 4x4 matrix.
    Matrix,
}

impl Format {
    /// The format of a file by its content. A bare matrix is [`Format::Matrix`], also one of FLIRT.
    ///
    /// # Errors
    /// [`FileError`] of a file that can't be read or is none, and of transforms that are not linear, by their names.
    pub fn of_file(path: &Path) -> Result<Self, FileError> {
        format_of(&content(path)?).map_err(|refusal| refusal.in_file(&name_of(path)))
    }

    /// The format that a file with this ending is written as; `None` of other endings, and of `.mat`, which may be ITK's,
    /// FLIRT's or a bare matrix.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_string_lossy().to_lowercase();
        match ending.as_str() {
            "tfm" | "txt" => Some(Self::ItkText),
            "h5" | "hdf5" => Some(Self::ItkHdf),
            "lta" => Some(Self::Lta),
            "dat" => Some(Self::RegisterDat),
            _ => None,
        }
    }

    /// Whether both images are needed to write it.
    pub fn needs_images_to_write(self) -> bool {
        self.needs_images() || self == Self::Lta
    }

    /// Whether both images are needed to read it.
    pub fn needs_images(self) -> bool {
        matches!(self, Self::Flirt | Self::RegisterDat)
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::ItkText => "ITK text",
            Self::ItkMat => "ITK .mat",
            Self::ItkHdf => "ITK HDF5",
            Self::Flirt => "FLIRT .mat",
            Self::Lta => ".lta of FreeSurfer",
            Self::RegisterDat => "register.dat of FreeSurfer",
            Self::Matrix => "a bare 4x4 matrix",
        }
    }
}

/// The format of a file with these bytes.
pub(super) fn format_of(bytes: &[u8]) -> Result<Format, Refusal> {
    let head = &bytes[..bytes.len().min(HEAD_BYTES as usize)];
    if let Some(refusal) = not_linear(head) {
        return Err(refusal);
    }
    if bytes.starts_with(itk_hdf::MAGIC) {
        return Ok(Format::ItkHdf);
    }
    if itk_mat::is_one(bytes) {
        return Ok(Format::ItkMat);
    }
    let text = text(bytes)?;
    if text.trim_start().starts_with(ITK_TEXT) {
        Ok(Format::ItkText)
    } else if lta::is_one(text) {
        Ok(Format::Lta)
    } else if register_dat::is_one(text) {
        Ok(Format::RegisterDat)
    } else if matrix::is_one(text) {
        Ok(Format::Matrix)
    } else {
        let first = text.lines().map(str::trim).find(|line| !line.is_empty());
        let found = first
            .map_or_else(|| "an empty file".into(), |line| format!("a text that begins {}", quoted(line)));
        Err(Refusal::new(found, EXPECTED))
    }
}

/// Why a file that begins with `head` is no linear transform that is read, where that shows.
pub(super) fn not_linear(head: &[u8]) -> Option<Refusal> {
    let refusal = |found: &str, expected: &str| Some(Refusal::new(found, expected));
    if head.starts_with(b"MATLAB 5.0 MAT-file") {
        return refusal("a MATLAB 5 file", "a MATLAB 4 file, as ITK and ANTs write it");
    }
    if head.starts_with(b"\x1f\x8b") {
        return refusal("a compressed file, as of a displacement field", EXPECTED);
    }
    if head.get(344..348).is_some_and(|magic| magic == b"n+1\0" || magic == b"ni1\0") {
        return refusal("an image, as of a displacement field", EXPECTED);
    }
    let is_text = head.starts_with(ITK_TEXT.as_bytes());
    let is_class = |class: &&str| {
        let is_named = itk_mat::name_begins(head, class);
        is_named || is_text && contains(head, format!("Transform: {class}").as_bytes())
    };
    let class = ["DisplacementField", "BSpline", "VelocityField", "GaussianExponential"]
        .iter()
        .find(|class| is_class(class));
    let found = format!("a transform that is not linear ({})", class?);
    refusal(&found, "a rigid or affine transform")
}

fn contains(bytes: &[u8], word: &[u8]) -> bool {
    bytes.windows(word.len()).any(|window| window == word)
}

/// The bytes as text, without a byte order mark.
pub(super) fn text(bytes: &[u8]) -> Result<&str, Refusal> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).ok().filter(|text| !text.contains('\0'));
    text.ok_or_else(|| Refusal::new("bytes that are no text", EXPECTED))
}
