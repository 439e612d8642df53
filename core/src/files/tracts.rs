//! What the formats of fibre tracts share: fibres being read, and the checks of what was read.

use super::FileError;
use super::bounded_gzip::Stream;
use super::nifti_header::ByteOrder;
use crate::{Check, Sides, Tracts};

/// Coordinates beyond this (10 km, as for images) are damage, not anatomy.
const MAX_COORDINATE_MM: f64 = 1e7;

/// Limits on reading tracts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TractOptions {
    /// Maximum size of a file in bytes. Points and their scalars take at most as much memory as the file has bytes; the
    /// fibre offsets add a third for fibres of one point.
    pub max_bytes: u64,
}

impl Default for TractOptions {
    fn default() -> Self {
        Self { max_bytes: super::DEFAULT_MAX_BYTES }
    }
}

/// The content of a tract file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedTracts {
    /// Its fibres.
    pub tracts: Tracts,
    /// When the fibres were made, as a `.tck` states it.
    pub timestamp: Option<String>,
    /// Findings.
    pub checks: Vec<Check>,
}

/// Fibres read so far.
pub(super) struct FiberBuilder {
    points_mm: Vec<[f32; 3]>,
    offsets: Vec<u32>,
}

impl FiberBuilder {
    /// Capacity for `points` points: no more than the file's bytes can hold.
    pub(super) fn with_capacity(points: u64, file: &str) -> Result<Self, FileError> {
        let wrong = |found: String| FileError::wrong(file, found, "points that memory can hold");
        let mut points_mm = Vec::new();
        usize::try_from(points)
            .ok()
            .filter(|&n| n < u32::MAX as usize && points_mm.try_reserve_exact(n).is_ok())
            .ok_or_else(|| wrong(format!("room for {points} points")))?;
        Ok(Self { points_mm, offsets: vec![0] })
    }

    /// Number of complete fibres.
    pub(super) fn fibers(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether the last fibre is incomplete.
    pub(super) fn is_open(&self) -> bool {
        self.offsets.last().is_some_and(|&end| (end as usize) < self.points_mm.len())
    }

    /// Adds a point to the incomplete fibre.
    pub(super) fn push(&mut self, point_mm: [f64; 3], file: &str) -> Result<(), FileError> {
        // Also false for NaN.
        if !point_mm.iter().all(|v| v.abs() <= MAX_COORDINATE_MM) {
            let [x, y, z] = point_mm;
            let found = format!("a point at {x}, {y}, {z} mm in fibre {}", self.fibers());
            return Err(FileError::wrong(file, found, "finite coordinates within 10 km"));
        }
        self.points_mm.push(point_mm.map(|v| v as f32));
        Ok(())
    }

    /// Ends the incomplete fibre.
    pub(super) fn end_fiber(&mut self) {
        // Fewer than 2^32 points: see `with_capacity`, whose limit callers respect.
        self.offsets.push(u32::try_from(self.points_mm.len()).unwrap_or(u32::MAX));
    }

    /// All fibres, checked.
    pub(super) fn finish(self, sides: Sides, file: &str) -> Result<Tracts, FileError> {
        Tracts::new(self.points_mm, self.offsets, sides)
            .ok_or_else(|| FileError::wrong(file, "fibres that don't fit their points", "a whole table"))
    }
}

/// The 32-bit float at offset `at`; 0 beyond the end of `bytes`.
pub(super) fn f32_at(bytes: &[u8], at: usize, order: ByteOrder) -> f64 {
    let four = bytes.get(at..).and_then(|b| b.first_chunk()).copied().unwrap_or_default();
    f64::from(match order {
        ByteOrder::Little => f32::from_le_bytes(four),
        ByteOrder::Big => f32::from_be_bytes(four),
    })
}

/// The check for a fibre count that differs from the header's.
pub(super) fn count_check(name: &str, declared: u64, fibers: u64) -> Check {
    Check::warning("tracts-count", format!("{name}: found {fibers} fibres, expected the header's {declared}"))
}

/// Reports bytes after the last fibre, if any.
pub(super) fn check_trailing(
    stream: Stream<'_>,
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<(), FileError> {
    let remaining = stream.finish()?;
    if remaining > 0 {
        checks.push(Check::warning(
            "tracts-trailing-bytes",
            format!(
                "{name}: found {remaining} bytes behind the last fibre, expected the file's end; not read"
            ),
        ));
    }
    Ok(())
}

/// File name without its folder.
pub(super) fn base_name(file: &str) -> String {
    file.rsplit(['/', '\\']).next().unwrap_or(file).to_owned()
}
