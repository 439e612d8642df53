//! A second opinion on a NIfTI file: what the crate `nifti` reads, compared with our own reader.

use std::{
    panic::{UnwindSafe, catch_unwind},
    path::Path,
};

use glam::{DAffine3, DMat3, DQuat, DVec3};
use nifti::{IntoNdArray, NiftiHeader, NiftiObject, ReaderOptions};
use serde::Serialize;

use super::{FileError, FileInfo, HeaderInfo, ReadOptions, Source, nifti as ours, nifti_info_with};
use crate::{Check, Grid, Progress, Sides, Volume, decimal};

/// The other reader.
const READER: &str = "nifti 0.18";

/// Largest distance of corners at which two matrices agree, in voxels of the finest spacing: quaternions are
/// converted by two formulas.
const SAME_PLACE_VOXELS: f64 = 1e-6;

/// What the two readers found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BothReaders<T> {
    /// By our reader.
    pub ours: T,
    /// By the crate `nifti`.
    pub theirs: T,
}

/// Voxel-to-world matrices: rows, the last 0 0 0 1.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AffineCheck {
    /// Whether both put the grid's corners at the same place.
    pub agree: bool,
    /// The matrices. The crate's is that of the header fields it read, in their unit of length: sform where its
    /// code isn't 0, else qform, else the spacings alone.
    #[serde(flatten)]
    pub rows: BothReaders<[[f64; 4]; 4]>,
    /// Largest distance between the places of a corner of the grid; `None` where it isn't finite.
    pub largest_mm: Option<f64>,
}

/// Scaled values of one frame, voxel by voxel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ValueCheck {
    /// Number of voxels compared.
    pub compared: usize,
    /// Number of voxels whose values aren't equal. NaN equals NaN.
    pub different: usize,
    /// Largest difference of two finite values; 0 without one.
    pub largest_difference: f64,
}

/// Where two readers disagree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossCheck {
    /// Name and version of the other reader.
    pub reader: &'static str,
    /// Whether it read the file and agrees in everything.
    pub agrees: bool,
    /// Why it can't read the file; then nothing else is known of it.
    pub unreadable: Option<String>,
    /// Voxels along x, y and z, and frames.
    pub dims: Option<BothReaders<[u64; 4]>>,
    /// Position in the patient; `None` where the dimensions differ or the crate's matrix is singular.
    pub affine: Option<AffineCheck>,
    /// Values; `None` where the dimensions differ.
    pub values: Option<ValueCheck>,
}

/// Header information of a file, with the second opinion under the key `cross_check`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossChecked {
    /// By our reader.
    #[serde(flatten)]
    pub info: HeaderInfo,
    /// The second opinion.
    pub cross_check: CrossCheck,
}

impl FileInfo for CrossChecked {
    fn text(&self) -> String {
        let check = &self.cross_check;
        let mut lines = vec![self.info.text()];
        let mut line = |text: String| lines.push(format!("{:<12}{text}", "cross-check"));
        if let Some(why) = &check.unreadable {
            line(format!("the crate {READER} can't read it: {why}"));
        }
        if let Some(BothReaders { ours, theirs }) = check.dims.as_ref().filter(|d| d.ours != d.theirs) {
            line(format!("dimensions and frames are {ours:?}, by {READER} {theirs:?}"));
        }
        match &check.affine {
            Some(affine) if !affine.agree => {
                let mm = affine
                    .largest_mm
                    .map_or_else(|| "without bound".into(), |mm| format!("{} mm", decimal::text(mm, 3)));
                line(format!("a corner of the grid is elsewhere by {READER}: {mm}"));
            }
            None if check.values.is_some() => line(format!("the affine of {READER} is singular")),
            _ => {}
        }
        match check.values {
            Some(ValueCheck { compared, different, largest_difference }) if different > 0 => {
                line(format!(
                    "{different} of {compared} voxels differ by {READER}, by up to {largest_difference}"
                ));
            }
            Some(ValueCheck { compared, .. }) if check.agrees => {
                line(format!("{READER} agrees: dimensions, affine and the values of {compared} voxels"));
            }
            _ => {}
        }
        lines.join("\n")
    }

    fn checks(&self) -> &[Check] {
        &self.info.checks
    }

    fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }
}

/// Header information of the NIfTI file at `path`, which is read a second time by the crate `nifti`. Compared
/// are dimensions, affine, and the values of one frame. A disagreement is no error.
///
/// Memory: the crate reads all frames at once, and holds their values as `f64`. A file of which that takes more
/// than `options.max_bytes` counts as one that the crate can't read.
///
/// # Errors
/// [`FileError`] where our own reader refuses the file.
pub fn cross_check(
    path: &Path,
    options: &ReadOptions,
    progress: &Progress,
) -> Result<CrossChecked, FileError> {
    let source = Source::File(path.to_owned());
    let info = nifti_info_with(&source, progress)?;
    let loaded = ours::read(&source, options, progress)?;
    let header_path = ours::header_path(path)?;
    let bytes = (8 * loaded.volume.samples().len() as u64).saturating_mul(info.frames);
    let theirs = if info.components > 1 {
        Err("it takes colours for numbers".to_owned())
    } else if bytes > options.max_bytes {
        Err(format!("{bytes} bytes of values in all of its frames, above the limit of {}", options.max_bytes))
    } else {
        without_panic(move || read_with_crate(&header_path)).and_then(|read| read)
    };
    let cross_check = match theirs {
        Ok(theirs) => compare(&loaded.volume, options.frame, info.frames, &theirs),
        Err(why) => CrossCheck {
            reader: READER,
            agrees: false,
            unreadable: Some(why),
            dims: None,
            affine: None,
            values: None,
        },
    };
    Ok(CrossChecked { info, cross_check })
}

/// What the crate read.
struct Theirs {
    header: NiftiHeader,
    /// Voxels along x, y and z, and frames.
    dims: [u64; 4],
    /// Scaled values of all frames, x fastest.
    values: Vec<f64>,
}

fn read_with_crate(path: &Path) -> Result<Theirs, String> {
    let read = || {
        let object = ReaderOptions::new().read_file(path)?;
        let header = object.header().clone();
        let mut dims = [1; 4];
        for (axis, &size) in header.dim()?.iter().enumerate() {
            dims[axis.min(3)] *= u64::from(size);
        }
        let (values, _) = object.into_volume().into_ndarray::<f64>()?.into_raw_vec_and_offset();
        Ok::<_, nifti::NiftiError>(Theirs { header, dims, values })
    };
    read().map_err(|e| e.to_string())
}

/// The result of `call`, or the message of its panic.
fn without_panic<T>(call: impl FnOnce() -> T + UnwindSafe) -> Result<T, String> {
    catch_unwind(call).map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
        format!("it panics: {}", text.unwrap_or("without a message"))
    })
}

fn compare(volume: &Volume, frame: usize, frames: u64, theirs: &Theirs) -> CrossCheck {
    let [x, y, z] = volume.grid().dims().map(|n| n as u64);
    let dims = BothReaders { ours: [x, y, z, frames], theirs: theirs.dims };
    let same_dims = dims.ours == dims.theirs;
    let affine = same_dims.then(|| compare_affines(volume.grid(), &theirs.header)).flatten();
    let values = same_dims.then(|| compare_values(volume, frame, &theirs.values));
    let agrees = affine.as_ref().is_some_and(|a| a.agree) && values.is_some_and(|v| v.different == 0);
    CrossCheck { reader: READER, agrees, unreadable: None, dims: Some(dims), affine, values }
}

fn compare_affines(grid: &Grid, header: &NiftiHeader) -> Option<AffineCheck> {
    let theirs = Grid::new(grid.dims(), affine(header), Sides::Known).ok()?;
    let distances = grid.corners_mm().into_iter().zip(theirs.corners_mm()).map(|(a, b)| a.distance(b));
    let largest = distances.fold(0.0, f64::max);
    let rows = |g: &Grid| crate::grid::rows(g.world_from_voxel());
    Some(AffineCheck {
        agree: grid.same_place(&theirs, SAME_PLACE_VOXELS),
        rows: BothReaders { ours: rows(grid), theirs: rows(&theirs) },
        largest_mm: Some(largest).filter(|mm| mm.is_finite()),
    })
}

/// The matrix of the form in force, from the fields of the header alone: the crate's own would need `nalgebra`.
fn affine(header: &NiftiHeader) -> DAffine3 {
    let spacing = DVec3::from_array([1, 2, 3].map(|axis| f64::from(header.pixdim[axis]).abs()));
    if header.sform_code != 0 {
        let rows = [header.srow_x, header.srow_y, header.srow_z];
        let column = |c: usize| DVec3::from_array(rows.map(|row| f64::from(row[c])));
        let matrix3 = DMat3::from_cols(column(0), column(1), column(2));
        DAffine3 { matrix3, translation: column(3) }
    } else if header.qform_code != 0 {
        let v = [header.quatern_b, header.quatern_c, header.quatern_d].map(f64::from);
        let [x, y, z] = v;
        let w = (1.0 - v.iter().map(|q| q * q).sum::<f64>()).max(0.0).sqrt();
        let qfac = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        DAffine3 {
            matrix3: DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
                * DMat3::from_diagonal(spacing * DVec3::new(1.0, 1.0, qfac)),
            translation: DVec3::from_array(
                [header.quatern_x, header.quatern_y, header.quatern_z].map(f64::from),
            ),
        }
    } else {
        DAffine3 { matrix3: DMat3::from_diagonal(spacing), translation: DVec3::ZERO }
    }
}

/// Compares `volume`, one frame, with that of `theirs`.
fn compare_values(volume: &Volume, frame: usize, theirs: &[f64]) -> ValueCheck {
    let compared = volume.samples().len();
    let mut values = ValueCheck { compared, ..ValueCheck::default() };
    for (linear, &theirs) in theirs.iter().skip(frame * compared).take(compared).enumerate() {
        let ours = volume.value(linear);
        if ours != theirs && !(ours.is_nan() && theirs.is_nan()) {
            values.different += 1;
            let difference = (ours - theirs).abs();
            if difference.is_finite() {
                values.largest_difference = values.largest_difference.max(difference);
            }
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_reason_and_nothing_more() {
        let [text, formatted]: [fn(); 2] = [|| panic!("no quaternion"), || panic!("w² is {}", -1)];
        assert_eq!(without_panic(text), Err("it panics: no quaternion".into()));
        assert_eq!(without_panic(formatted), Err("it panics: w² is -1".into()));
        let other = without_panic(|| std::panic::resume_unwind(Box::new(7)));
        assert_eq!(other.map(|()| 0), Err("it panics: without a message".into()));
        assert_eq!(without_panic(|| 3), Ok(3));
    }
}
