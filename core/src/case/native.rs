//! Masks as read, on their native grids.

use crate::Mask;

/// One mask on its native grid.
pub(super) struct NativeMask {
    pub spec: usize,
    pub time: usize,
    pub mask: Mask,
    pub missing_labels: Vec<i64>,
    pub invalid: u64,
}

/// An id and its time as written in messages: `T1 (2024-01-15)`.
pub(super) fn at_time(id: &str, time: &str) -> String {
    if time.is_empty() { id.to_owned() } else { format!("{id} ({time})") }
}
