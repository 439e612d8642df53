//! What at least 1, 2, … masks hold.

use glioscope_core::{Mask, MaskBits, Progress, TumorIndex, case::TimePoint};

use super::{Level, Options, PageError, Surface};

/// The levels of a date, that of all masks last; none where there are fewer than two masks.
pub fn levels(
    time: &TimePoint,
    options: &Options<'_>,
    error_mm: f64,
    progress: &Progress,
) -> Result<Vec<Level>, PageError> {
    let of = time.masks.len();
    if of < 2 {
        return Ok(Vec::new());
    }
    let index = &*time.index;
    let of_count = |count: usize| {
        let mask = at_least(index, count);
        Ok(Level {
            count,
            volume_ml: mask.as_ref().map_or(0.0, Mask::volume_ml),
            color: (options.agreement_color)(count as u32, of),
            surface: mask.map(|mask| Surface::of_mask(&mask, error_mm, progress)).transpose()?.flatten(),
        })
    };
    (1..=of).map(of_count).collect()
}

/// The voxels that at least `count` masks hold.
fn at_least(index: &TumorIndex, count: usize) -> Option<Mask> {
    let bits =
        MaskBits::from_fn(index.grid().dims(), |linear| index.get(linear).count_ones() as usize >= count);
    Mask::new("", index.grid().clone(), bits)
}
