//! The NIfTI-1 and NIfTI-2 header: its fields.
//!
//! Layout from `nifti1.h` (Cox et al., 2003) and `nifti2.h` (2011). Every finding is a [`Check`];
//! a finding that makes the file unusable is a [`Fault`].

use serde::Serialize;

use super::FileError;
use crate::Check;

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

    /// Whether voxels are integers.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::Float32 | Self::Float64)
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

    pub(super) fn from_code(code: i16) -> Result<Self, Fault> {
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
            1536 => "float128".into(),
            1792 => "complex128".into(),
            2048 => "complex256".into(),
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

/// Maximum size of the header extensions in bytes, in a single file and in a pair's header.
pub const MAX_EXTENSION_BYTES: u64 = 64 << 20;

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
