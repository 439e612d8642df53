//! Outlines of all masks of a slice at once.
//!
//! A mask's outline runs inside its edge. Where edges of several masks coincide, the outlines are
//! stacked inwards in the order of the masks, each of full width, so that every mask is seen. Where
//! there is no room to stack them (a part thinner than the stack) they alternate as dashes.
//!
//! All masks are peeled together: one `u32` of bits a pixel, eroded layer by layer.

use rayon::prelude::*;

/// Most outlines stacked inwards; further ones start at the edge again.
const MOST_STACKED: usize = 8;
/// Length of the dashes where outlines can't be stacked, in outline widths.
const DASH_WIDTHS: usize = 3;

/// A part of the picture: `bits` of its pixels, row by row.
struct Area {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// The smallest area that holds every pixel with a bit, and the union of all bits.
fn area_of(bits: &[u32], width: usize) -> Option<(Area, u32)> {
    let mut x = (usize::MAX, 0);
    let mut y = (usize::MAX, 0);
    let mut any = 0;
    for (row, line) in bits.chunks_exact(width).enumerate() {
        let Some(first) = line.iter().position(|&b| b != 0) else { continue };
        let last = line.iter().rposition(|&b| b != 0).unwrap_or(first);
        x = (x.0.min(first), x.1.max(last));
        y = (y.0.min(row), row);
        any |= line[first..=last].iter().fold(0, |a, b| a | b);
    }
    (any != 0).then(|| (Area { x: x.0, y: y.0, width: x.1 - x.0 + 1, height: y.1 - y.0 + 1 }, any))
}

/// One layer off every mask. Odd layers keep corners and even ones round them, which makes the
/// layers about equally thick in all directions. Beyond the area is outside, unless that is beyond
/// the picture (`open`: left, right, top, bottom), where what is cut off has no edge.
fn eroded(bits: &[u32], width: usize, open: [bool; 4], corners: bool) -> Vec<u32> {
    let height = bits.len() / width;
    let at = |x: isize, y: isize| -> u32 {
        let beyond = (x < 0 && !open[0])
            || (x >= width as isize && !open[1])
            || (y < 0 && !open[2])
            || (y >= height as isize && !open[3]);
        if beyond {
            return 0;
        }
        let (x, y) = (x.clamp(0, width as isize - 1) as usize, y.clamp(0, height as isize - 1) as usize);
        bits[y * width + x]
    };
    let mut out = vec![0; bits.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(y, line)| {
        let y = y as isize;
        for (x, out) in line.iter_mut().enumerate() {
            let own = bits[y as usize * width + x];
            if own == 0 {
                continue;
            }
            let x = x as isize;
            let mut kept = own & at(x - 1, y) & at(x + 1, y) & at(x, y - 1) & at(x, y + 1);
            if corners {
                kept &= at(x - 1, y - 1) & at(x + 1, y - 1) & at(x - 1, y + 1) & at(x + 1, y + 1);
            }
            *out = kept;
        }
    });
    out
}

/// The mask whose outline covers each pixel of a picture `width` pixels wide, as its bit number plus
/// one; 0 where there is none. `bits` says which masks are active in each pixel.
pub(super) fn outlines(bits: &[u32], width: usize, line_px: usize) -> Vec<u8> {
    let mut owner = vec![0; bits.len()];
    let line_px = line_px.max(1);
    let Some((area, any)) = (if width > 0 { area_of(bits, width) } else { None }) else {
        return owner;
    };
    let height = bits.len() / width;
    let crop: Vec<u32> = (0..area.height)
        .flat_map(|y| &bits[(area.y + y) * width + area.x..][..area.width])
        .copied()
        .collect();
    let open = [area.x == 0, area.x + area.width == width, area.y == 0, area.y + area.height == height];

    // depth_bits[t]: masks that lose the pixel to the t-th peel.
    let stacked = (any.count_ones() as usize).min(MOST_STACKED);
    let depths = stacked * line_px;
    let mut layers = Vec::with_capacity(depths);
    let mut rest = crop.clone();
    for t in 0..depths {
        let next = eroded(&rest, area.width, open, t % 2 == 1);
        layers.push(rest.iter().zip(&next).map(|(a, b)| a & !b).collect::<Vec<u32>>());
        rest = next;
    }

    let rows: Vec<Vec<u8>> = (0..area.height)
        .into_par_iter()
        .map(|y| (0..area.width).map(|x| owner_of(&layers, &rest, &area, [x, y], line_px, stacked)).collect())
        .collect();
    for (y, row) in rows.iter().enumerate() {
        owner[(area.y + y) * width + area.x..][..area.width].copy_from_slice(row);
    }
    owner
}

fn owner_of(
    layers: &[Vec<u32>],
    core: &[u32],
    area: &Area,
    [x, y]: [usize; 2],
    line_px: usize,
    stacked: usize,
) -> u8 {
    let pixel = y * area.width + x;
    for (t, layer) in layers.iter().enumerate() {
        let mut here = layer[pixel];
        while here != 0 {
            let mask = here.trailing_zeros();
            here &= here - 1;
            // Masks whose edge is as far away as this one's, or nearly: they share the stack.
            let near = t.saturating_sub(line_px - 1)..(t + line_px).min(layers.len());
            let together = near.fold(0, |all, t| all | layers[t][pixel]);
            let slot = (together & ((1 << mask) - 1)).count_ones() as usize % stacked;
            if t / line_px == slot {
                return alternated(layers, core, area, [x, y], line_px, together, mask);
            }
        }
    }
    0
}

/// `mask` where the stack of outlines of the masks `together` has room here, or else the one whose
/// dash it is.
fn alternated(
    layers: &[Vec<u32>],
    core: &[u32],
    area: &Area,
    [x, y]: [usize; 2],
    line_px: usize,
    together: u32,
    mask: u32,
) -> u8 {
    let count = together.count_ones() as usize;
    if count < 2 {
        return mask as u8 + 1;
    }
    let needed = (count * line_px).min(layers.len());
    let deepest = &layers[needed - 1..];
    let reach = needed;
    let has_room = (y.saturating_sub(reach)..(y + reach + 1).min(area.height)).any(|v| {
        (x.saturating_sub(reach)..(x + reach + 1).min(area.width)).any(|u| {
            let pixel = v * area.width + u;
            let deep = deepest.iter().fold(core[pixel], |all, layer| all | layer[pixel]);
            deep & together == together
        })
    });
    if has_room {
        return mask as u8 + 1;
    }
    // Dashes by place in the picture: two numbers without a common direction, so that no straight
    // line stays within one colour.
    let dash = line_px * DASH_WIDTHS;
    let turn = ((area.x + x) / dash + (area.y + y) / dash * (count - 1).max(1)) % count;
    let nth = (0..turn).fold(together, |rest, _| rest & (rest - 1));
    nth.trailing_zeros() as u8 + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 60;

    fn picture(boxes: &[[usize; 4]]) -> Vec<u32> {
        let mut bits = vec![0; WIDTH * 50];
        for (k, &[x0, y0, x1, y1]) in boxes.iter().enumerate() {
            for y in y0..y1 {
                bits[y * WIDTH + x0..y * WIDTH + x1].iter_mut().for_each(|b| *b |= 1 << k);
            }
        }
        bits
    }

    #[test]
    fn one_box_has_its_inner_edge_and_nothing_else() {
        let [x0, y0, x1, y1] = [10, 5, 30, 25];
        let bits = picture(&[[x0, y0, x1, y1]]);
        for line_px in 1..=3 {
            let owner = outlines(&bits, WIDTH, line_px);
            for (pixel, &o) in owner.iter().enumerate() {
                let (x, y) = (pixel % WIDTH, pixel / WIDTH);
                let inside = (x0..x1).contains(&x) && (y0..y1).contains(&y);
                let deep = inside && (x - x0).min(x1 - 1 - x).min(y - y0).min(y1 - 1 - y) >= line_px;
                assert_eq!(o == 1, inside && !deep, "{line_px}: {x},{y}");
            }
        }
    }

    #[test]
    fn masks_that_coincide_are_stacked_each_in_full_width() {
        let bits = picture(&[[10, 5, 40, 35]; 3]);
        let owner = outlines(&bits, WIDTH, 2);
        let across: Vec<u8> = owner[20 * WIDTH + 8..][..12].to_vec();
        assert_eq!(across, [0, 0, 1, 1, 2, 2, 3, 3, 0, 0, 0, 0]);
    }

    #[test]
    fn masks_too_thin_to_stack_take_turns() {
        for thin in [[10, 20, 50, 22], [20, 5, 22, 45]] {
            let bits = picture(&[thin; 3]);
            let owner = outlines(&bits, WIDTH, 1);
            for mask in 1..=3 {
                let pixels = owner.iter().filter(|&&o| o == mask).count();
                assert!(pixels >= 10, "mask {mask} has {pixels} of 80 pixels");
            }
        }
    }

    #[test]
    fn edges_apart_each_have_their_own_line() {
        let bits = picture(&[[10, 5, 40, 35], [20, 10, 50, 40]]);
        let owner = outlines(&bits, WIDTH, 1);
        assert_eq!(owner[20 * WIDTH + 10], 1);
        assert_eq!(owner[20 * WIDTH + 20], 2);
        assert_eq!(owner[20 * WIDTH + 39], 1);
        assert_eq!(owner[20 * WIDTH + 49], 2);
        assert_eq!(owner[20 * WIDTH + 30], 0);
    }

    #[test]
    fn what_the_picture_cuts_off_has_no_edge_there() {
        let bits = picture(&[[0, 0, WIDTH, 30]]);
        let owner = outlines(&bits, WIDTH, 1);
        for (pixel, &o) in owner.iter().enumerate() {
            assert_eq!(o == 1, pixel / WIDTH == 29, "{pixel}");
        }
        assert!(outlines(&[], 0, 1).is_empty());
    }
}
