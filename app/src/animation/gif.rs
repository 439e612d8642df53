//! GIF: one palette for all frames, so that no colour jumps; of each frame only the part that differs from the one before.

use std::io::{BufWriter, Write as _};

use ::gif::{DisposalMethod, Encoder, EncodingError, Frame as Part, Repeat};
use glioscope_core::{Progress, files::write_whole_by};

use super::{
    Animation, Draw,
    palette::{Histogram, Palette},
};
use crate::error::AppError;

/// Frames that the palette is made from, at most: those between have the same colours, nearly.
const MOST_SAMPLED: usize = 16;

pub(super) fn write(
    animation: &Animation<'_>,
    draw: &mut Draw<'_>,
    progress: &Progress,
) -> Result<(), AppError> {
    let too_large = || {
        let [width, height] = animation.size;
        let found = format!("a picture of {width} × {height} pixels");
        AppError::file(animation.path, found, format!("at most {} along each side", u16::MAX))
    };
    let [width, height] = animation.size.map(u16::try_from);
    let (width, height) = (width.map_err(|_| too_large())?, height.map_err(|_| too_large())?);
    let frames = animation.frames;
    let step = frames.len().div_ceil(MOST_SAMPLED).max(1);
    progress.expect((frames.len() + frames.len().div_ceil(step)) as u64);
    write_whole_by(animation.path, |file| {
        let mut histogram = Histogram::new();
        for frame in frames.iter().step_by(step) {
            histogram.add(&draw(frame)?);
            progress.advance(1)?;
        }
        let mut palette = Palette::of(&histogram);
        drop(histogram);
        let failed = |e: EncodingError| animation.failed(&e);
        let mut out = BufWriter::new(file);
        {
            let mut encoder = Encoder::new(&mut out, width, height, &palette.bytes()).map_err(failed)?;
            encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
            let mut before = Vec::new();
            for frame in frames {
                let now = palette.indices(&draw(frame)?);
                let mut part = changed(&before, now.clone(), [width, height]);
                part.delay = frame.shown_cs;
                encoder.write_frame(&part).map_err(failed)?;
                before = now;
                progress.advance(1)?;
            }
            // Writes the end, whose failure `drop` wouldn't tell.
            encoder.into_inner().map_err(failed)?;
        }
        out.flush().map_err(|e| animation.failed(&e))
    })
}

/// The smallest rectangle of `now` outside of which it equals `before`; all of it where there was nothing before. A frame has at least
/// a pixel.
fn changed(before: &[u8], now: Vec<u8>, [width, height]: [u16; 2]) -> Part<'static> {
    let mut part = Part { width, height, dispose: DisposalMethod::Keep, ..Part::default() };
    let row = usize::from(width).max(1);
    if before.len() != now.len() {
        part.buffer = now.into();
        return part;
    }
    let (mut left, mut right, mut top, mut bottom) = (width, 0, height, 0);
    for ((old, new), y) in before.chunks(row).zip(now.chunks(row)).zip(0_u16..) {
        for ((old, new), x) in old.iter().zip(new).zip(0_u16..) {
            if old != new {
                (left, right) = (left.min(x), right.max(x));
                (top, bottom) = (top.min(y), bottom.max(y));
            }
        }
    }
    if left > right {
        (left, right, top, bottom) = (0, 0, 0, 0);
    }
    let lines = now.chunks(row).skip(usize::from(top)).take(usize::from(bottom - top) + 1);
    let columns = |line: &[u8]| -> Vec<u8> {
        line.iter().skip(usize::from(left)).take(usize::from(right - left) + 1).copied().collect()
    };
    part.buffer = lines.flat_map(columns).collect::<Vec<u8>>().into();
    (part.left, part.top) = (left, top);
    (part.width, part.height) = (right - left + 1, bottom - top + 1);
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_changed_is_written() {
        let place = |part: &Part<'_>| [part.left, part.top, part.width, part.height];
        let before: Vec<u8> = vec![0; 12];
        let first = changed(&[], before.clone(), [4, 3]);
        assert_eq!((place(&first), first.buffer.len()), ([0, 0, 4, 3], 12));
        let mut now = before.clone();
        (now[5], now[10]) = (7, 9);
        let part = changed(&before, now, [4, 3]);
        assert_eq!((place(&part), part.buffer.to_vec()), ([1, 1, 2, 2], vec![7, 0, 0, 9]));
        let same = changed(&before, before.clone(), [4, 3]);
        assert_eq!((place(&same), same.buffer.to_vec()), ([0, 0, 1, 1], vec![0]));
    }
}
