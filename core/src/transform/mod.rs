//! Linear registration transforms of other programs: rigid and affine, read into one convention and written.
//!
//! | format | frame and direction in the file | what it needs |
//! |---|---|---|
//! | ITK text, ITK `.mat`, ITK HDF5 | LPS mm, fixed to moving | nothing |
//! | `.lta` | voxels or RAS mm, moving (source) to fixed (destination); written in RAS mm | nothing; written both images |
//! | `register.dat` | tkregister's RAS mm, fixed (target) to moving | both images |
//! | FLIRT `.mat` | scaled voxels, x against RAS, moving (input) to fixed (reference) | both images |
//! | a bare 4x4 matrix | says nothing: see [`Convention`] | its convention |

use std::path::Path;

use glam::{DAffine3, DMat3, DQuat};

use crate::files::{FileError, printable, read_head, read_small, write_whole};

mod flirt;
mod format;
mod geometry;
mod itk;
mod itk_class;
mod itk_hdf;
mod itk_mat;
mod lta;
mod matrix;
mod register_dat;
#[cfg(test)]
mod tests;

pub use format::Format;
pub use geometry::{ImageGeometry, Images};
pub use matrix::Convention;

/// Maximum size of a file in bytes; a composite of a hundred transforms has a tenth of it.
const MAX_BYTES: u64 = 1 << 20;
/// Bytes in which a file's kind shows.
const HEAD_BYTES: u64 = 4096;
/// Characters of a file's text in a message.
const QUOTED: usize = 60;
/// Condition number above which a transform is refused: no registration stretches one direction a thousand times as
/// much as another.
pub const MAX_CONDITION: f64 = 1e3;
/// Largest number of a matrix, in mm for its translation.
const LARGEST: f64 = 1e6;
/// What every file is expected to be.
const EXPECTED: &str = "a linear transform of ITK, ANTs, 3D Slicer, FSL, FreeSurfer, NiftyReg or greedy";

/// Why something is no linear transform.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found {found}, expected {expected}")]
pub struct Refusal {
    /// What was found.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl Refusal {
    fn new(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { found: found.into(), expected: expected.into() }
    }

    /// As an error about `file`.
    fn in_file(self, file: &str) -> FileError {
        FileError::wrong(file, self.found, self.expected)
    }
}

/// A linear transform between the spaces of two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    moving_from_fixed: DAffine3,
}

impl Transform {
    /// A transform; `moving_from_fixed` maps RAS mm of the fixed image to RAS mm of the moving one.
    ///
    /// # Errors
    /// [`Refusal`] of numbers that are not finite or far too large, of a reflection, and of a matrix that is singular
    /// or has a condition above [`MAX_CONDITION`].
    pub fn new(moving_from_fixed: DAffine3) -> Result<Self, Refusal> {
        if !moving_from_fixed.is_finite() {
            return Err(Refusal::new("a matrix with numbers that are not finite", "finite numbers"));
        }
        if moving_from_fixed.to_cols_array().iter().any(|number| number.abs() > LARGEST) {
            return Err(Refusal::new(
                format!("a matrix with numbers above {LARGEST:e}"),
                "a transform between two images of one patient, in mm",
            ));
        }
        let condition = condition(moving_from_fixed.matrix3);
        if condition.is_nan() || condition > MAX_CONDITION {
            let found = format!("a matrix of condition {condition:.3e}");
            return Err(Refusal::new(found, format!("at most {MAX_CONDITION:.0e}")));
        }
        if moving_from_fixed.matrix3.determinant() <= 0.0 {
            return Err(Refusal::new(
                "a reflection, which swaps left and right",
                "a transform that keeps left and right (was it read in its own convention?)",
            ));
        }
        Ok(Self { moving_from_fixed })
    }

    /// Where a point of the fixed (reference) image lies in the moving one, both in RAS mm: what resamples the moving
    /// image on the fixed one's grid.
    pub fn moving_from_fixed(&self) -> DAffine3 {
        self.moving_from_fixed
    }

    /// Where a point of the moving image lies in the fixed (reference) one, both in RAS mm.
    pub fn fixed_from_moving(&self) -> DAffine3 {
        inverse(self.moving_from_fixed)
    }
}

impl Transform {
    /// The angle by which it turns, in degrees from 0 to 180: that of the rotation nearest to its matrix.
    pub fn turn_deg(&self) -> f64 {
        let mut nearest = self.moving_from_fixed.matrix3;
        // Newton's iteration for the polar decomposition (Higham 1986); the condition is bounded.
        for _ in 0..60 {
            nearest = (nearest + nearest.inverse().transpose()) * 0.5;
        }
        let (_, angle) = DQuat::from_mat3(&nearest).to_axis_angle();
        let degrees = angle.to_degrees();
        degrees.min(360.0 - degrees)
    }

    /// By how much volumes grow from the fixed to the moving image; 1 where it is rigid.
    pub fn volume_ratio(&self) -> f64 {
        self.moving_from_fixed.matrix3.determinant()
    }
}

/// What the user says about a file that it doesn't say itself; of a file that is written, what it shall be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Given {
    /// Its format; `None`: by its content, and of a file that is written by its ending ([`Format::of_ending`]). Must be
    /// given for FLIRT.
    pub format: Option<Format>,
    /// What a bare matrix means; must be given for [`Format::Matrix`].
    pub convention: Option<Convention>,
    /// The images that were registered, see [`Format::needs_images`] and [`Format::needs_images_to_write`].
    pub images: Option<Images>,
}

impl Given {
    /// The fixed and the moving image, which `format` needs.
    fn images_of(&self, format: Format) -> Result<(&ImageGeometry, &ImageGeometry), Refusal> {
        let expected = "the two images that were registered";
        let images = self.images.as_ref();
        let images =
            images.ok_or_else(|| Refusal::new(format!("{}, without its images", format.name()), expected))?;
        Ok((images.fixed.checked("fixed")?, images.moving.checked("moving")?))
    }
}

/// Reads a transform.
///
/// # Errors
/// [`FileError`] of a file that can't be read, is no linear transform, or needs something that is not `given`.
pub fn read(path: &Path, given: &Given) -> Result<Transform, FileError> {
    read_bytes(&name_of(path), &content(path)?, given)
}

/// As [`read`], from the bytes of the file `name`.
///
/// # Errors
/// As [`read`].
pub fn read_bytes(name: &str, bytes: &[u8], given: &Given) -> Result<Transform, FileError> {
    parse(bytes, given).map_err(|refusal| refusal.in_file(name))
}

fn parse(bytes: &[u8], given: &Given) -> Result<Transform, Refusal> {
    let seen = format::format_of(bytes)?;
    let kind = match given.format {
        Some(kind) if kind == seen || (kind, seen) == (Format::Flirt, Format::Matrix) => kind,
        Some(kind) => return Err(Refusal::new(seen.name(), kind.name())),
        None => seen,
    };
    let images = || given.images_of(kind);
    let moving_from_fixed = match kind {
        Format::ItkMat => itk_mat::read(bytes)?,
        Format::ItkHdf => itk_hdf::read(bytes)?,
        Format::ItkText => itk::read(format::text(bytes)?)?,
        Format::Lta => lta::read(format::text(bytes)?)?,
        Format::Flirt => {
            let (fixed, moving) = images()?;
            flirt::read(format::text(bytes)?, fixed, moving)?
        }
        Format::RegisterDat => {
            let (fixed, moving) = images()?;
            register_dat::read(format::text(bytes)?, fixed, moving)?
        }
        Format::Matrix => matrix::read(format::text(bytes)?, given.convention)?,
    };
    Transform::new(moving_from_fixed)
}

/// Writes a transform, whole or not at all; all formats hold it in double precision.
///
/// # Errors
/// [`FileError`] of an ending that says no format where none is `given`, of something that the format needs and that is not
/// `given`, and with the system's reason.
pub fn write(path: &Path, transform: &Transform, given: &Given) -> Result<(), FileError> {
    let bytes = bytes(path, transform, given).map_err(|refusal| refusal.in_file(&name_of(path)))?;
    write_whole(path, &bytes)
}

fn bytes(path: &Path, transform: &Transform, given: &Given) -> Result<Vec<u8>, Refusal> {
    let format = given.format.or_else(|| Format::of_ending(path));
    let format = format.ok_or_else(|| {
        Refusal::new("an ending of no one format", ".tfm, .txt, .h5, .hdf5, .lta or .dat, or a format")
    })?;
    let moving_from_fixed = transform.moving_from_fixed;
    let with_images = |text: fn(DAffine3, &ImageGeometry, &ImageGeometry) -> String| {
        let (fixed, moving) = given.images_of(format)?;
        Ok(text(moving_from_fixed, fixed, moving).into_bytes())
    };
    match format {
        Format::ItkText => Ok(itk::text(moving_from_fixed).into_bytes()),
        Format::ItkMat => Ok(itk_mat::bytes(moving_from_fixed)),
        Format::ItkHdf => itk_hdf::bytes(moving_from_fixed),
        Format::Flirt => with_images(flirt::text),
        Format::Lta => with_images(lta::text),
        Format::RegisterDat => with_images(register_dat::text),
        Format::Matrix => {
            let convention = given.convention.ok_or_else(matrix::without_convention)?;
            Ok(matrix::text(moving_from_fixed, convention).into_bytes())
        }
    }
}

fn content(path: &Path) -> Result<Vec<u8>, FileError> {
    // Those that are not linear may be larger than any linear one: they are named first.
    if let Some(refusal) = read_head(path, HEAD_BYTES).and_then(|head| format::not_linear(&head)) {
        return Err(refusal.in_file(&name_of(path)));
    }
    read_small(path, MAX_BYTES, EXPECTED)
}

fn name_of(path: &Path) -> String {
    printable(&path.display().to_string())
}

/// A file's text for a message: one short line.
fn quoted(text: &str) -> String {
    let short: String = text.chars().take(QUOTED).collect();
    let more = if text.chars().nth(QUOTED).is_some() { "…" } else { "" };
    format!("\"{}{more}\"", printable(&short))
}

/// Inverts about the translation: a large offset must not leak into the matrix.
fn inverse(affine: DAffine3) -> DAffine3 {
    let matrix3 = affine.matrix3.inverse();
    DAffine3 { matrix3, translation: -(matrix3 * affine.translation) }
}

/// Between a third of the ratio of the largest to the smallest singular value and that ratio; infinite or NaN for a
/// singular matrix.
fn condition(m: DMat3) -> f64 {
    let frobenius = |m: DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    if m.determinant() == 0.0 { f64::INFINITY } else { frobenius(m) * frobenius(m.inverse()) / 3.0 }
}
