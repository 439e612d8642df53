//! Outlines of pixels along their edges.

use crate::MaskBits;

/// Steps along an outline in the order of right turns, seen with rows downwards: right, down, left, up.
const STEPS: [[isize; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// The outlines of a slice's active pixels: closed, without a repeated point, through corners of pixels (corner `[x, y]` is
/// the upper left one of pixel `[x, y]`), with pixels on the right-hand side. Outlines of holes are of their own. Outlines
/// may touch themselves and each other where pixels share nothing but a corner, and never cross: the even-odd rule gives the
/// pixels.
pub(super) fn outlines(mask: &MaskBits, slice: usize) -> Vec<Vec<[usize; 2]>> {
    let [columns, rows, _] = mask.dims();
    let at = |x: usize, y: usize| y * (columns + 1) + x;
    // Bit d: an edge leaves this corner in direction d.
    let mut leaving = vec![0_u8; (columns + 1) * (rows + 1)];
    for y in 0..rows {
        for x in 0..columns {
            if !mask.get([x, y, slice]) {
                continue;
            }
            let is_free = |dx: isize, dy: isize| {
                let (x, y) = (x.checked_add_signed(dx), y.checked_add_signed(dy));
                let inside = x.zip(y).filter(|&(x, y)| x < columns && y < rows);
                !inside.is_some_and(|(x, y)| mask.get([x, y, slice]))
            };
            leaving[at(x, y)] |= u8::from(is_free(0, -1));
            leaving[at(x + 1, y)] |= u8::from(is_free(1, 0)) << 1;
            leaving[at(x + 1, y + 1)] |= u8::from(is_free(0, 1)) << 2;
            leaving[at(x, y + 1)] |= u8::from(is_free(-1, 0)) << 3;
        }
    }
    let mut outlines = Vec::new();
    for y in 0..=rows {
        for x in 0..=columns {
            // The first corner in reading order is left rightwards, and reached upwards: it is a corner of the outline.
            while leaving[at(x, y)] & 1 == 1 {
                outlines.push(follow(&mut leaving, columns + 1, [x, y]));
            }
        }
    }
    outlines
}

/// The outline that leaves corner `first` rightwards; its edges are taken out of `leaving`.
fn follow(leaving: &mut [u8], width: usize, first: [usize; 2]) -> Vec<[usize; 2]> {
    let (mut corners, mut here, mut direction) = (vec![first], first, 0);
    loop {
        here = [0, 1].map(|axis| here[axis].saturating_add_signed(STEPS[direction][axis]));
        let ways = &mut leaving[here[1] * width + here[0]];
        // Where two outlines meet, the right turn stays with the pixel.
        let next = [1, 0, 3].map(|turn| (direction + turn) % 4).into_iter().find(|d| *ways >> d & 1 == 1);
        // There always is a way on, as outlines are closed.
        let Some(next) = next else { return corners };
        *ways &= !(1 << next);
        if here == first && next == 0 {
            return corners;
        }
        if next != direction {
            corners.push(here);
        }
        direction = next;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Whether a pixel's centre lies in an odd number of outlines, by the edges above it.
    fn is_inside(outlines: &[Vec<[usize; 2]>], x: usize, y: usize) -> bool {
        let edges = outlines.iter().flat_map(|o| (0..o.len()).map(|n| [o[n], o[(n + 1) % o.len()]]));
        let is_above = |[a, b]: [[usize; 2]; 2]| {
            a[1] == b[1] && a[1] <= y && (a[0].min(b[0])..a[0].max(b[0])).contains(&x)
        };
        edges.filter(|edge| is_above(*edge)).count() % 2 == 1
    }

    #[test]
    fn shapes_have_their_outlines() {
        let of = |dims: [usize; 2], active: &[usize]| {
            outlines(&MaskBits::from_fn([dims[0], dims[1], 1], |at| active.contains(&at)), 0)
        };
        assert_eq!(of([3, 3], &[]), Vec::<Vec<[usize; 2]>>::new());
        assert_eq!(of([3, 3], &[4]), [[[1, 1], [2, 1], [2, 2], [1, 2]]]);
        assert_eq!(of([2, 2], &[0, 1, 2, 3]), [[[0, 0], [2, 0], [2, 2], [0, 2]]]);
        // A ring: its hole is left-handed.
        let ring = of([3, 3], &[0, 1, 2, 3, 5, 6, 7, 8]);
        assert_eq!(ring, [[[0, 0], [3, 0], [3, 3], [0, 3]], [[1, 2], [2, 2], [2, 1], [1, 1]]]);
        // Pixels at a corner stay apart, whichever diagonal.
        assert_eq!(of([2, 2], &[0, 3]).len(), 2);
        assert_eq!(of([2, 2], &[1, 2]).len(), 2);
    }

    proptest! {
        #[test]
        fn the_even_odd_rule_gives_the_pixels(
            dims in (1_usize..9, 1_usize..9), bits in prop::collection::vec(any::<bool>(), 64)
        ) {
            let mask = MaskBits::from_fn([dims.0, dims.1, 1], |at| bits[at]);
            let outlines = outlines(&mask, 0);
            for y in 0..dims.1 {
                for x in 0..dims.0 {
                    prop_assert_eq!(is_inside(&outlines, x, y), mask.get([x, y, 0]));
                }
            }
            for outline in &outlines {
                prop_assert!(outline.len() >= 4 && outline.len() % 2 == 0);
                for n in 0..outline.len() {
                    let (a, b) = (outline[n], outline[(n + 1) % outline.len()]);
                    prop_assert!((a[0] == b[0]) != (a[1] == b[1]));
                    let c = outline[(n + 2) % outline.len()];
                    prop_assert!((a[0] == b[0]) != (b[0] == c[0]), "a corner that is none");
                }
            }
        }
    }
}
