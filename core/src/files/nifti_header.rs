//! The NIfTI-1 and NIfTI-2 header: parsing and validation of its fields.
//!
//! Layout from `nifti1.h` (Cox et al., 2003) and `nifti2.h` (2011). Every finding is a [`Check`];
//! a finding that makes the file unusable is a [`Fault`].

use serde::Serialize;

use super::FileError;
use super::nifti_space::{self, Form};
use crate::{Check, Grid, Scaling};

/// Header layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Version {
    /// 348 bytes, 2003.
    #[serde(rename = "NIfTI-1")]
    One,
    /// 540 bytes, 2011.
    #[serde(rename = "NIfTI-2")]
    Two,
}

impl Version {
    /// Bytes of the header, without the four that state whether extensions follow.
    pub fn header_bytes(self) -> usize {
        match self {
            Self::One => 348,
            Self::Two => 540,
        }
    }
}

/// Byte order of numbers in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// Data type of the stored voxels; only types that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "each variant is its type")]
pub enum SampleType {
    UInt8,
    Int8,
    UInt16,
    Int16,
    UInt32,
    Int32,
    UInt64,
    Int64,
    Float32,
    Float64,
}

impl SampleType {
    /// Bytes of one voxel.
    pub fn bytes(self) -> usize {
        match self {
            Self::UInt8 | Self::Int8 => 1,
            Self::UInt16 | Self::Int16 => 2,
            Self::UInt32 | Self::Int32 | Self::Float32 => 4,
            Self::UInt64 | Self::Int64 | Self::Float64 => 8,
        }
    }

    /// The NIfTI and NumPy name.
    pub fn name(self) -> &'static str {
        match self {
            Self::UInt8 => "uint8",
            Self::Int8 => "int8",
            Self::UInt16 => "uint16",
            Self::Int16 => "int16",
            Self::UInt32 => "uint32",
            Self::Int32 => "int32",
            Self::UInt64 => "uint64",
            Self::Int64 => "int64",
            Self::Float32 => "float32",
            Self::Float64 => "float64",
        }
    }

    /// NIfTI's `datatype` code.
    pub fn code(self) -> i16 {
        match self {
            Self::UInt8 => 2,
            Self::Int16 => 4,
            Self::Int32 => 8,
            Self::Float32 => 16,
            Self::Float64 => 64,
            Self::Int8 => 256,
            Self::UInt16 => 512,
            Self::UInt32 => 768,
            Self::Int64 => 1024,
            Self::UInt64 => 1280,
        }
    }

    fn from_code(code: i16) -> Result<Self, Fault> {
        const ALL: [SampleType; 10] = [
            SampleType::UInt8,
            SampleType::Int8,
            SampleType::UInt16,
            SampleType::Int16,
            SampleType::UInt32,
            SampleType::Int32,
            SampleType::UInt64,
            SampleType::Int64,
            SampleType::Float32,
            SampleType::Float64,
        ];
        if let Some(found) = ALL.into_iter().find(|t| t.code() == code) {
            return Ok(found);
        }
        let name = match code {
            1 => "binary (1 bit)".into(),
            32 => "complex64".into(),
            128 => "RGB24".into(),
            1536 => "float128".into(),
            1792 => "complex128".into(),
            2048 => "complex256".into(),
            2304 => "RGBA32".into(),
            other => format!("unknown (code {other})"),
        };
        let found = format!("voxels of type {name}");
        Err(Fault::new(
            "datatype-unsupported",
            found,
            "one of the integer types of 8 to 64 bits, float32 or float64",
        ))
    }
}

/// A finding that makes the file unusable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// As [`Check::code`].
    pub code: &'static str,
    /// What was found.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl Fault {
    pub(crate) fn new(code: &'static str, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { code, found: found.into(), expected: expected.into() }
    }

    /// As an error about `file`.
    pub(crate) fn in_file(self, file: &str) -> FileError {
        FileError::Wrong { file: file.into(), found: self.found, expected: self.expected }
    }

    /// As a check of severity error about `file`.
    pub fn check(&self, file: &str) -> Check {
        Check::error(self.code, format!("{file}: found {}, expected {}", self.found, self.expected))
    }
}

/// The relevant fields as stored in the file, without repairs.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the names are those of nifti1.h")]
pub struct Header {
    pub version: Version,
    pub order: ByteOrder,
    /// Whether the voxels are in an `.img` beside this header (magic `ni1`, `ni2`).
    pub paired: bool,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub bitpix: i16,
    pub pixdim: [f64; 8],
    pub vox_offset: f64,
    pub scl_slope: f64,
    pub scl_inter: f64,
    pub xyzt_units: i32,
    pub qform_code: i32,
    pub sform_code: i32,
    pub quatern: [f64; 3],
    pub qoffset: [f64; 3],
    pub srow: [[f64; 4]; 3],
}

/// The checked content of a header, sufficient to read the voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Described {
    /// The voxel grid.
    pub grid: Grid,
    /// What `grid` was made from.
    pub form: Form,
    /// Product of dimensions 4 to 7.
    pub frames: u64,
    /// Data type of the stored voxels.
    pub sample_type: SampleType,
    /// Bytes of one frame.
    pub frame_bytes: u64,
    /// Byte offset of the first frame in the file with the voxels.
    pub data_offset: u64,
    /// Maps stored numbers to values.
    pub scaling: Scaling,
    /// Notes and warnings.
    pub checks: Vec<Check>,
}

/// Maximum size of the header extensions in bytes, in a single file and in a pair's header.
pub const MAX_EXTENSION_BYTES: u64 = 64 << 20;

/// Exclusive limit on the voxels of a frame, as in [`Grid::new`].
const MAX_VOXELS: u64 = 1 << 40;

struct Fields<'a> {
    bytes: &'a [u8],
    order: ByteOrder,
}

impl Fields<'_> {
    fn bytes_at<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut out = [0; N];
        if let Some(part) = self.bytes.get(at..at + N) {
            out.copy_from_slice(part);
        }
        if self.order == ByteOrder::Big {
            out.reverse();
        }
        out
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.bytes_at(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.bytes_at(at))
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.bytes_at(at))
    }

    fn f32(&self, at: usize) -> f64 {
        f32::from_le_bytes(self.bytes_at(at)).into()
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes_at(at))
    }
}

/// Version and byte order of the header that begins with `first_four`; `None` if it is no NIfTI header.
pub fn recognise(first_four: [u8; 4]) -> Option<(Version, ByteOrder)> {
    let little = i32::from_le_bytes(first_four);
    for (size, order) in [(little, ByteOrder::Little), (little.swap_bytes(), ByteOrder::Big)] {
        match size {
            348 => return Some((Version::One, order)),
            540 => return Some((Version::Two, order)),
            _ => {}
        }
    }
    None
}

impl Header {
    /// Parses the header's bytes ([`Version::header_bytes`] of them; more may follow).
    ///
    /// # Errors
    /// [`Fault`] when the bytes are too few or no NIfTI header.
    pub fn parse(bytes: &[u8]) -> Result<Self, Fault> {
        const SHORT: &str = "at least 348 bytes of a NIfTI header";
        let Some(&first_four) = bytes.first_chunk::<4>() else {
            let found =
                if bytes.is_empty() { "an empty file".into() } else { format!("{} bytes", bytes.len()) };
            return Err(Fault::new("header-short", found, SHORT));
        };
        let Some((version, order)) = recognise(first_four) else {
            return Err(Fault::new(
                "not-nifti",
                guess_format(bytes),
                "a NIfTI header (size field 348 or 540)",
            ));
        };
        if bytes.len() < version.header_bytes() {
            let expected = format!("{} bytes of a NIfTI header", version.header_bytes());
            return Err(Fault::new("header-short", format!("{} bytes", bytes.len()), expected));
        }
        let fields = Fields { bytes, order };
        match version {
            Version::One => Self::parse_one(&fields),
            Version::Two => Self::parse_two(&fields),
        }
    }

    fn parse_one(f: &Fields<'_>) -> Result<Self, Fault> {
        let paired = match &f.bytes[344..348] {
            b"n+1\0" => false,
            b"ni1\0" => true,
            [0, 0, 0, 0] => {
                let found = "an ANALYZE 7.5 header, which does not say left from right";
                return Err(Fault::new("analyze", found, "NIfTI (magic n+1 or ni1)"));
            }
            other => return Err(Fault::new("magic", quoted_magic(other), "magic n+1 or ni1")),
        };
        Ok(Self {
            version: Version::One,
            order: f.order,
            paired,
            dim: std::array::from_fn(|i| f.i16(40 + 2 * i).into()),
            datatype: f.i16(70),
            bitpix: f.i16(72),
            pixdim: std::array::from_fn(|i| f.f32(76 + 4 * i)),
            vox_offset: f.f32(108),
            scl_slope: f.f32(112),
            scl_inter: f.f32(116),
            xyzt_units: f.bytes[123].into(),
            qform_code: f.i16(252).into(),
            sform_code: f.i16(254).into(),
            quatern: std::array::from_fn(|i| f.f32(256 + 4 * i)),
            qoffset: std::array::from_fn(|i| f.f32(268 + 4 * i)),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f32(280 + 16 * r + 4 * c))),
        })
    }

    fn parse_two(f: &Fields<'_>) -> Result<Self, Fault> {
        let paired = match &f.bytes[4..12] {
            b"n+2\0\r\n\x1a\n" => false,
            b"ni2\0\r\n\x1a\n" => true,
            other => {
                return Err(Fault::new("magic", quoted_magic(other), "magic n+2 or ni2 and \\r\\n\\x1a\\n"));
            }
        };
        let offset = f.i64(168);
        // f64 represents offsets up to 2^53 exactly; larger ones are refused anyway.
        let vox_offset = offset as f64;
        Ok(Self {
            version: Version::Two,
            order: f.order,
            paired,
            dim: std::array::from_fn(|i| f.i64(16 + 8 * i)),
            datatype: f.i16(12),
            bitpix: f.i16(14),
            pixdim: std::array::from_fn(|i| f.f64(104 + 8 * i)),
            vox_offset,
            scl_slope: f.f64(176),
            scl_inter: f.f64(184),
            xyzt_units: f.i32(500),
            qform_code: f.i32(344),
            sform_code: f.i32(348),
            quatern: std::array::from_fn(|i| f.f64(352 + 8 * i)),
            qoffset: std::array::from_fn(|i| f.f64(376 + 8 * i)),
            srow: std::array::from_fn(|r| std::array::from_fn(|c| f.f64(400 + 32 * r + 8 * c))),
        })
    }

    /// Checks all relevant fields. Each check's message starts with `name`. Memory use doesn't depend on the
    /// sizes that the header claims.
    ///
    /// # Errors
    /// [`Fault`]: the first finding that makes the file unusable.
    pub fn describe(&self, name: &str) -> Result<Described, Fault> {
        let (dims, frames) = self.shape()?;
        let sample_type = SampleType::from_code(self.datatype)?;
        let bits = sample_type.bytes() * 8;
        if usize::try_from(self.bitpix) != Ok(bits) {
            let found = format!("bitpix {} with datatype {}", self.bitpix, sample_type.name());
            return Err(Fault::new("bitpix-datatype", found, format!("bitpix {bits}")));
        }
        let too_large = || {
            let found = format!("dimensions {:?}", &self.dim[1..=self.dim[0].clamp(1, 7) as usize]);
            Fault::new("dim-overflow", found, "fewer than 2^40 voxels a frame and 2^63 bytes in all")
        };
        let voxels = dims.iter().try_fold(1u64, |product, &d| product.checked_mul(d as u64));
        let voxels = voxels.filter(|&n| n < MAX_VOXELS).ok_or_else(too_large)?;
        let frame_bytes = voxels * sample_type.bytes() as u64;
        let data_offset = self.data_offset()?;
        frame_bytes
            .checked_mul(frames)
            .and_then(|all| all.checked_add(data_offset))
            .filter(|&end| i64::try_from(end).is_ok())
            .ok_or_else(too_large)?;
        let mut checks = Vec::new();
        let (grid, form) = nifti_space::grid_from_header(self, dims, name, &mut checks)?;
        let scaling = self.scaling(name, &mut checks);
        Ok(Described { grid, form, frames, sample_type, frame_bytes, data_offset, scaling, checks })
    }

    /// All findings about the header alone, errors included.
    pub fn checks(&self, name: &str) -> Vec<Check> {
        self.describe(name).map_or_else(|fault| vec![fault.check(name)], |d| d.checks)
    }

    fn shape(&self) -> Result<([usize; 3], u64), Fault> {
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
            let drops_slope = slope.is_finite() && slope != 0.0 && slope != 1.0;
            checks.push(if drops_slope {
                Check::warning("scaling-ignored", text)
            } else {
                Check::note("scaling-ignored", text)
            });
        }
        Scaling::NONE
    }
}

/// The magic bytes, escaped and quoted.
fn quoted_magic(bytes: &[u8]) -> String {
    format!("magic \"{}\"", bytes.escape_ascii())
}

/// What a file that is not NIfTI might be, for the message only.
fn guess_format(bytes: &[u8]) -> String {
    let text = bytes.trim_ascii_start();
    if text.starts_with(b"<") {
        "a web page or XML".into()
    } else if text.starts_with(b"NRRD000") {
        "an NRRD file".into()
    } else if bytes.get(128..132) == Some(b"DICM") {
        "a DICOM file".into()
    } else {
        let first = bytes.first_chunk().copied().unwrap_or_default();
        format!("size field {}", i32::from_le_bytes(first))
    }
}
