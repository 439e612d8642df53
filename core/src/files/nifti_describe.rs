//! Validation of a NIfTI header: what its fields, taken together, say of the voxels.

use super::{
    nifti_header::{Fault, Header, MAX_EXTENSION_BYTES, SampleType},
    nifti_space::{self, Form},
};
use crate::{Check, Grid, Scaling};

/// The checked content of a header, sufficient to read the voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// The voxel grid.
    pub grid: Grid,
    /// What `grid` was made from.
    pub form: Form,
    /// Product of dimensions 4 to 7.
    pub frames: u64,
    /// Data type of the stored voxels, or of each component of a colour.
    pub sample_type: SampleType,
    /// Components of a voxel: 3 or 4 of a colour, else 1.
    pub components: usize,
    /// Bytes of one frame.
    pub frame_bytes: u64,
    /// Byte offset of the first frame in the file with the voxels.
    pub data_offset: u64,
    /// Maps stored numbers to values.
    pub scaling: Scaling,
    /// Notes and warnings.
    pub checks: Vec<Check>,
}

/// Exclusive limit on the voxels of a frame, as in [`Grid::new`].
const MAX_VOXELS: u64 = 1 << 40;

/// NIfTI's codes of colours.
const RGB24: i16 = 128;
const RGBA32: i16 = 2304;

impl Header {
    /// Checks all relevant fields. Each check's message starts with `name`. Memory use doesn't depend on the
    /// sizes that the header claims.
    ///
    /// # Errors
    /// [`Fault`]: the first finding that makes the file unusable.
    pub fn describe(&self, name: &str) -> Result<Described, Fault> {
        let mut checks = Vec::new();
        let (dims, frames) = self.shape(name, &mut checks)?;
        let (sample_type, components, name_of_type) = match self.datatype {
            RGB24 => (SampleType::UInt8, 3, "RGB24"),
            RGBA32 => (SampleType::UInt8, 4, "RGBA32"),
            code => SampleType::from_code(code).map(|sample_type| (sample_type, 1, sample_type.name()))?,
        };
        let bits = sample_type.bytes() * 8 * components;
        if usize::try_from(self.bitpix) != Ok(bits) {
            let found = format!("bitpix {} with datatype {name_of_type}", self.bitpix);
            return Err(Fault::new("bitpix-datatype", found, format!("bitpix {bits}")));
        }
        let too_large = || {
            let found = format!("dimensions {:?}", &self.dim[1..=self.dim[0].clamp(1, 7) as usize]);
            Fault::new("dim-overflow", found, "fewer than 2^40 voxels a frame and 2^63 bytes in all")
        };
        let voxels = dims.iter().try_fold(1u64, |product, &d| product.checked_mul(d as u64));
        let voxels = voxels.filter(|&n| n < MAX_VOXELS).ok_or_else(too_large)?;
        let frame_bytes = voxels * (sample_type.bytes() * components) as u64;
        let data_offset = self.data_offset()?;
        frame_bytes
            .checked_mul(frames)
            .and_then(|all| all.checked_add(data_offset))
            .filter(|&end| i64::try_from(end).is_ok())
            .ok_or_else(too_large)?;
        let (grid, form) = nifti_space::grid_from_header(self, dims, name, &mut checks)?;
        // Colours are not scaled (nifti1.h, scl_slope).
        let scaling = if components > 1 { Scaling::NONE } else { self.scaling(name, &mut checks) };
        Ok(Described {
            grid,
            form,
            frames,
            sample_type,
            components,
            frame_bytes,
            data_offset,
            scaling,
            checks,
        })
    }

    /// All findings about the header alone, errors included.
    pub fn checks(&self, name: &str) -> Vec<Check> {
        self.describe(name).map_or_else(|fault| vec![fault.check(name)], |d| d.checks)
    }

    /// Voxels along x, y and z, and the number of frames. A size of 0 above the third dimension means 1: writers that
    /// store a fourth dimension without frames mean the one volume that the file has.
    fn shape(&self, name: &str, checks: &mut Vec<Check>) -> Result<([usize; 3], u64), Fault> {
        let rank = match usize::try_from(self.dim[0]) {
            Ok(rank @ 1..=7) => rank,
            _ => {
                return Err(Fault::new("dim-rank", format!("dim[0] = {}", self.dim[0]), "1 to 7 dimensions"));
            }
        };
        let mut dims = [1; 3];
        let mut frames = 1u64;
        for axis in 1..=rank {
            let size = self.dim[axis];
            if axis > 3 && size == 0 {
                checks.push(Check::warning(
                    "dim-zero",
                    format!("{name}: found dim[{axis}] = 0, expected at least 1; taken as 1"),
                ));
                continue;
            }
            let positive = usize::try_from(size).ok().filter(|&n| n > 0);
            let Some(n) = positive else {
                return Err(Fault::new("dim-size", format!("dim[{axis}] = {size}"), "at least 1"));
            };
            if axis <= 3 {
                dims[axis - 1] = n;
            } else {
                frames = frames.checked_mul(n as u64).ok_or_else(|| {
                    Fault::new(
                        "dim-overflow",
                        format!("dimensions {:?}", &self.dim[1..=rank]),
                        "fewer frames",
                    )
                })?;
            }
        }
        Ok((dims, frames))
    }

    fn data_offset(&self) -> Result<u64, Fault> {
        let first = if self.paired { 0 } else { self.version.header_bytes() as u64 + 4 };
        let last = if self.paired { 1 << 53 } else { first + MAX_EXTENSION_BYTES };
        let offset = self.vox_offset;
        if offset.fract() == 0.0 && offset >= first as f64 && offset <= last as f64 {
            return Ok(offset as u64);
        }
        let found = format!("vox_offset {offset}");
        Err(Fault::new("vox-offset", found, format!("a whole number of bytes from {first} to {last}")))
    }

    /// "If the scl_slope field is nonzero, then each voxel value should be scaled" (`nifti1.h`).
    fn scaling(&self, name: &str, checks: &mut Vec<Check>) -> Scaling {
        let (slope, intercept) = (self.scl_slope, self.scl_inter);
        if slope.is_finite() && slope != 0.0 && intercept.is_finite() {
            return Scaling { slope, intercept };
        }
        if !(slope == 0.0 && intercept == 0.0) {
            let text = format!(
                "{name}: scl_slope {slope} and scl_inter {intercept} mean no scaling; stored values are used"
            );
            // A valid slope with an invalid intercept: programs differ here.
            let is_slope_valid = slope.is_finite() && slope != 0.0;
            checks.push(if is_slope_valid {
                Check::warning("scaling-ignored", text)
            } else {
                Check::note("scaling-ignored", text)
            });
        }
        Scaling::NONE
    }
}
