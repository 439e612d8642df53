//! Dilation of masks, 64 voxels at once.

use crate::MaskBits;

/// `mask` with the voxels that share a face or an edge with it (18 neighbours), `times` over; what would lie beyond the
/// mask's size is left out.
pub(super) fn dilated(mask: &MaskBits, times: usize) -> MaskBits {
    let mut grown = mask.clone();
    for _ in 0..times {
        grown = dilated_once(&grown);
    }
    grown
}

fn dilated_once(mask: &MaskBits) -> MaskBits {
    let [nx, ny, nz] = mask.dims();
    let per_line = mask.words_per_line();
    let past_end = nx % 64;
    let mut grown = MaskBits::empty(mask.dims());
    for (line, out) in grown.words_mut().chunks_exact_mut(per_line).enumerate() {
        let [y, z] = [line % ny, line / ny];
        for [dy, dz] in [[1, 1], [0, 1], [2, 1], [1, 0], [1, 2], [0, 0], [0, 2], [2, 0], [2, 2]] {
            let (Some(y), Some(z)) = ((y + dy).checked_sub(1), (z + dz).checked_sub(1)) else { continue };
            if y >= ny || z >= nz {
                continue;
            }
            let at = (z * ny + y) * per_line;
            let Some(words) = mask.words().get(at..at + per_line) else { continue };
            // A line that differs in y and z touches along its voxels' edges only.
            let reach = dy == 1 || dz == 1;
            for (w, out) in out.iter_mut().enumerate() {
                let word = |w: Option<usize>| w.and_then(|w| words.get(w)).copied().unwrap_or(0);
                let here = word(Some(w));
                *out |= here;
                if reach {
                    *out |= here << 1 | word(w.checked_sub(1)) >> 63;
                    *out |= here >> 1 | word(Some(w + 1)) << 63;
                }
            }
        }
        if let (true, Some(last)) = (past_end > 0, out.last_mut()) {
            *last &= (1 << past_end) - 1;
        }
    }
    grown
}
