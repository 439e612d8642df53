//! Voxels from a stream of bytes: one frame's numbers, of frames one after another or interleaved voxel by voxel.

use super::{
    FileError,
    bounded_gzip::{CHUNK_BYTES, Stream},
    nifti_header::{ByteOrder, SampleType},
};
use crate::Samples;

/// Most interleaved frames: a group of one voxel of each is held in memory.
pub(super) const MAX_LEAD: u64 = 1 << 16;

/// A source of a file's voxel bytes.
pub(super) trait VoxelBytes {
    /// Fills all of `buf`; a truncated file is an error that states `expected`.
    fn fill_all(&mut self, buf: &mut [u8], expected: &str) -> Result<(), FileError>;
    /// Skips `bytes`; a truncated file is an error that states `expected`.
    fn skip(&mut self, bytes: u64, expected: &str) -> Result<(), FileError>;
    /// The file's name in messages.
    fn file(&self) -> &str;
}

impl VoxelBytes for Stream<'_> {
    fn fill_all(&mut self, buf: &mut [u8], expected: &str) -> Result<(), FileError> {
        Stream::fill_all(self, buf, expected)
    }

    fn skip(&mut self, bytes: u64, expected: &str) -> Result<(), FileError> {
        Stream::skip(self, bytes, expected)
    }

    fn file(&self) -> &str {
        Stream::file(self)
    }
}

/// How a file's voxels follow each other: `lead` frames interleaved voxel by voxel, `trail` such blocks one after
/// another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Data type of the stored voxels.
    pub(super) sample_type: SampleType,
    /// Byte order of numbers.
    pub(super) order: ByteOrder,
    /// Voxels of a frame.
    pub(super) voxels: usize,
    /// Frames whose voxels alternate.
    pub(super) lead: u64,
    /// Blocks of `lead` frames.
    pub(super) trail: u64,
}

impl Layout {
    /// Number of frames.
    pub(super) fn frames(&self) -> u64 {
        self.lead.saturating_mul(self.trail)
    }

    /// Bytes of one frame.
    pub(super) fn frame_bytes(&self) -> u64 {
        (self.voxels as u64).saturating_mul(self.sample_type.bytes() as u64)
    }

    /// Bytes of all frames; `None` where they are too many to count in a file.
    pub(super) fn all_bytes(&self) -> Option<u64> {
        let voxels = (self.voxels as u64).checked_mul(self.lead)?.checked_mul(self.trail)?;
        let all = voxels.checked_mul(self.sample_type.bytes() as u64)?;
        i64::try_from(all).is_ok().then_some(all)
    }
}

/// The numbers of one frame; `bytes` begins with the first frame and is read to the end of the last.
pub(super) fn read_frame(
    bytes: &mut impl VoxelBytes,
    layout: &Layout,
    frame: u64,
    expected: &str,
) -> Result<Samples, FileError> {
    let (lead, trail) = (layout.lead.max(1), layout.trail.max(1));
    let block = layout.frame_bytes().saturating_mul(lead);
    let (first, behind) = (frame / lead, (trail - 1).saturating_sub(frame / lead));
    bytes.skip(block.saturating_mul(first), expected)?;
    let samples = read_samples(bytes, layout, frame % lead, expected)?;
    bytes.skip(block.saturating_mul(behind), expected)?;
    Ok(samples)
}

fn read_samples(
    bytes: &mut impl VoxelBytes,
    layout: &Layout,
    nth: u64,
    expected: &str,
) -> Result<Samples, FileError> {
    let of = Picked {
        count: layout.voxels,
        lead: usize::try_from(layout.lead).unwrap_or(usize::MAX),
        nth: usize::try_from(nth).unwrap_or(usize::MAX),
    };
    macro_rules! typed {
        ($variant:ident, $t:ty) => {
            Samples::$variant(match layout.order {
                ByteOrder::Little => read_numbers(bytes, of, <$t>::from_le_bytes, expected)?,
                ByteOrder::Big => read_numbers(bytes, of, <$t>::from_be_bytes, expected)?,
            })
        };
    }
    Ok(match layout.sample_type {
        SampleType::UInt8 => typed!(U8, u8),
        SampleType::Int8 => typed!(I8, i8),
        SampleType::UInt16 => typed!(U16, u16),
        SampleType::Int16 => typed!(I16, i16),
        SampleType::UInt32 => typed!(U32, u32),
        SampleType::Int32 => typed!(I32, i32),
        SampleType::UInt64 => typed!(U64, u64),
        SampleType::Int64 => typed!(I64, i64),
        SampleType::Float32 => typed!(F32, f32),
        SampleType::Float64 => typed!(F64, f64),
    })
}

/// `count` numbers, the `nth` of each group of `lead`.
#[derive(Clone, Copy)]
struct Picked {
    count: usize,
    lead: usize,
    nth: usize,
}

/// Reads numbers directly into a vector of their type, in cache-sized chunks.
fn read_numbers<T, const N: usize>(
    bytes: &mut impl VoxelBytes,
    of: Picked,
    decode: impl Fn([u8; N]) -> T + Copy,
    expected: &str,
) -> Result<Vec<T>, FileError> {
    let mut numbers = Vec::new();
    // Pages are committed as they are filled, so a false claim costs address space only.
    numbers.try_reserve_exact(of.count).map_err(|_| {
        let found = format!("{} voxels of {N} bytes", of.count);
        FileError::wrong(bytes.file(), found, "no more than fit in memory")
    })?;
    let group = N.saturating_mul(of.lead).max(N);
    let groups = (CHUNK_BYTES / group).clamp(1, of.count.max(1));
    let mut chunk = vec![0; groups.saturating_mul(group)];
    while numbers.len() < of.count {
        let part = &mut chunk[..group * groups.min(of.count - numbers.len())];
        bytes.fill_all(part, expected)?;
        let stored = part.as_chunks::<N>().0;
        if of.lead <= 1 {
            numbers.extend(stored.iter().map(|&number| decode(number)));
        } else {
            numbers.extend(stored.iter().skip(of.nth).step_by(of.lead).map(|&number| decode(number)));
        }
    }
    Ok(numbers)
}
