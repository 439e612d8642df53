//! Outlines of all masks of a slice at once.
//!
//! A mask's outline runs inside its edge. Where edges of several masks coincide, the outlines are
//! stacked inwards in the order of the masks, each at full width, so that every mask is visible. Where
//! there is no room to stack them (a part thinner than the stack) they alternate as dashes.
//!
//! With patterns, outlines are solid, dashed and dotted in turn ([`OutlinePattern`]), so that masks can be told apart
//! without colour.
//!
//! All masks are eroded together, layer by layer: one `u32` of mask bits per pixel.

use rayon::prelude::*;
use strum::{EnumCount, FromRepr, IntoStaticStr};

/// Most outlines stacked inwards; further ones start at the edge again.
const MOST_STACKED: usize = 8;
/// Length of the dashes where outlines can't be stacked, in outline widths.
const DASH_WIDTHS: usize = 3;

/// How a mask's outline is drawn where masks are told apart by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, EnumCount, FromRepr, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
pub enum OutlinePattern {
    /// Without gaps.
    Solid,
    /// Dashes twice as long as the gaps.
    Dashed,
    /// Dots as long as the gaps.
    Dotted,
}

impl OutlinePattern {
    /// The pattern of mask `k`: one after the other.
    pub fn of_mask(k: usize) -> Self {
        Self::from_repr(k % Self::COUNT).unwrap_or(Self::Solid)
    }

    /// Lengths of a mark and of the gap behind it, in outline widths; no gap for a solid line.
    pub fn mark_and_gap_widths(self) -> [usize; 2] {
        match self {
            Self::Solid => [1, 0],
            Self::Dashed => [6, 3],
            Self::Dotted => [2, 2],
        }
    }
}

/// A rectangle of the slice, in pixels.
struct Area {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

/// The bounding box of all pixels with a bit, and the union of all bits.
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

/// An area's bits padded by one pixel on each side: empty, or at the slice's border (`open`: left, right,
/// top, bottom) the nearest pixel's, because a mask that the border cuts has no edge there.
struct Padded {
    bits: Vec<u32>,
    width: usize,
    height: usize,
    open: [bool; 4],
}

impl Padded {
    fn stride(&self) -> usize {
        self.width + 2
    }

    fn row(&self, y: usize) -> &[u32] {
        &self.bits[(y + 1) * self.stride() + 1..][..self.width]
    }

    fn refresh_border(&mut self) {
        let (stride, last) = (self.stride(), (self.height + 1) * self.stride());
        let padding = |open: bool, bits: u32| if open { bits } else { 0 };
        for row in self.bits.chunks_exact_mut(stride) {
            row[0] = padding(self.open[0], row[1]);
            row[stride - 1] = padding(self.open[1], row[stride - 2]);
        }
        for x in 0..stride {
            self.bits[x] = padding(self.open[2], self.bits[stride + x]);
            self.bits[last + x] = padding(self.open[3], self.bits[last - stride + x]);
        }
    }

    /// Every mask eroded by one layer: 4-connected, or 8-connected with `corners`. Alternating both makes layers
    /// about equally thick in all directions.
    fn eroded(&self, corners: bool) -> Self {
        let stride = self.stride();
        let mut bits = vec![0; self.bits.len()];
        let inner = &mut bits[stride..][..stride * self.height];
        inner.par_chunks_exact_mut(stride).with_min_len(32).enumerate().for_each(|(y, out)| {
            let above = &self.bits[y * stride..][..stride];
            let own = &self.bits[(y + 1) * stride..][..stride];
            let below = &self.bits[(y + 2) * stride..][..stride];
            let out = &mut out[1..=self.width];
            for (x, out) in out.iter_mut().enumerate() {
                *out = own[x + 1] & own[x] & own[x + 2] & above[x + 1] & below[x + 1];
            }
            if corners {
                for (x, out) in out.iter_mut().enumerate() {
                    *out &= above[x] & above[x + 2] & below[x] & below[x + 2];
                }
            }
        });
        let mut next = Self { bits, ..*self };
        next.refresh_border();
        next
    }
}

/// The mask whose outline covers each pixel of a slice `width` pixels wide, as its bit number plus
/// one; 0 where there is none. `bits` are the active masks of each pixel. With `patterns`, outlines have the gaps of
/// their mask's [`OutlinePattern`], except where they alternate already.
pub(super) fn outlines(bits: &[u32], width: usize, line_px: usize, patterns: bool) -> Vec<u8> {
    let mut owner = vec![0; bits.len()];
    let line_px = line_px.max(1);
    let Some((area, any)) = (if width > 0 { area_of(bits, width) } else { None }) else {
        return owner;
    };
    let height = bits.len() / width;
    let open = [area.x == 0, area.x + area.width == width, area.y == 0, area.y + area.height == height];
    let stride = area.width + 2;
    let mut rest =
        Padded { bits: vec![0; stride * (area.height + 2)], width: area.width, height: area.height, open };
    for y in 0..area.height {
        rest.bits[(y + 1) * stride + 1..][..area.width]
            .copy_from_slice(&bits[(area.y + y) * width + area.x..][..area.width]);
    }
    rest.refresh_border();

    let stacked = (any.count_ones() as usize).min(MOST_STACKED);
    let mut layers = vec![rest];
    for t in 0..stacked * line_px {
        let next = layers[t].eroded(t % 2 == 1);
        layers.push(next);
    }
    let erosion = Erosion { layers, area, line_px, stacked, patterns };

    let area = &erosion.area;
    let rows = owner[area.y * width..][..area.height * width].par_chunks_exact_mut(width);
    rows.with_min_len(16).enumerate().for_each(|(y, row)| {
        for (x, owner) in row[area.x..][..area.width].iter_mut().enumerate() {
            *owner = erosion.owner([x, y]);
        }
    });
    owner
}

/// All masks after 0, 1, 2 … erosions.
struct Erosion {
    layers: Vec<Padded>,
    area: Area,
    line_px: usize,
    stacked: usize,
    patterns: bool,
}

impl Erosion {
    fn owner(&self, [x, y]: [usize; 2]) -> u8 {
        let pixel = (y + 1) * (self.area.width + 2) + x + 1;
        let depths = self.layers.len() - 1;
        let bits_at = |t: usize| self.layers[t].bits[pixel];
        if bits_at(0) & !bits_at(depths) == 0 {
            return 0;
        }
        for t in 0..depths {
            let mut here = bits_at(t) & !bits_at(t + 1);
            while here != 0 {
                let mask = here.trailing_zeros();
                here &= here - 1;
                // Masks whose edge is about as far away as this one's: they share the stack.
                let near = [t.saturating_sub(self.line_px - 1), (t + self.line_px).min(depths)];
                let together = bits_at(near[0]) & !bits_at(near[1]);
                let slot = (together & ((1 << mask) - 1)).count_ones() as usize % self.stacked;
                if t / self.line_px == slot {
                    return self.alternated([x, y], together, mask);
                }
            }
        }
        0
    }

    /// `mask` where the stacked outlines of the masks `together` fit here, otherwise the mask whose dash covers the
    /// pixel.
    fn alternated(&self, [x, y]: [usize; 2], together: u32, mask: u32) -> u8 {
        let count = together.count_ones() as usize;
        if count < 2 {
            return self.patterned([x, y], mask);
        }
        let area = &self.area;
        let needed = (count * self.line_px).min(self.layers.len() - 1);
        let deep = &self.layers[needed - 1];
        let columns = x.saturating_sub(needed)..(x + needed + 1).min(area.width);
        let has_room = (y.saturating_sub(needed)..(y + needed + 1).min(area.height))
            .any(|v| deep.row(v)[columns.clone()].iter().any(|bits| bits & together == together));
        if has_room {
            return self.patterned([x, y], mask);
        }
        // Dashes by pixel position, changing along both axes, so that neither a horizontal nor a vertical line
        // keeps one colour.
        let dash = self.line_px * DASH_WIDTHS;
        let turn = ((area.x + x) / dash + (area.y + y) / dash * (count - 1)) % count;
        let nth = (0..turn).fold(together, |rest, _| rest & (rest - 1));
        nth.trailing_zeros() as u8 + 1
    }

    /// `mask`, or none in a gap of its pattern. Gaps are counted along the axis of the slice that the edge follows more.
    fn patterned(&self, [x, y]: [usize; 2], mask: u32) -> u8 {
        let owner = mask as u8 + 1;
        let pattern = OutlinePattern::of_mask(mask as usize);
        if !self.patterns || pattern == OutlinePattern::Solid {
            return owner;
        }
        let [mark, gap] = pattern.mark_and_gap_widths().map(|widths| widths * self.line_px);
        let along = if self.is_upright([x, y], mask) { self.area.y + y } else { self.area.x + x };
        if along % (mark + gap) < mark { owner } else { 0 }
    }

    /// Whether the edge of `mask` near a pixel runs more along y than along x.
    fn is_upright(&self, [x, y]: [usize; 2], mask: u32) -> bool {
        let reach = self.stacked * self.line_px + 1;
        let own = &self.layers[0];
        // With the padding: the edge may be that of the area.
        let active = |x: usize, y: usize| i32::from(own.bits[y * own.stride() + x] >> mask & 1 == 1);
        let around =
            |at: usize, length: usize| [(at + 1).saturating_sub(reach), (at + 1 + reach).min(length + 1)];
        let [[left, right], [top, bottom]] = [around(x, own.width), around(y, own.height)];
        // Differences of counts on both sides: the slope of the mask's coverage.
        let across_x: i32 = (top..=bottom).map(|v| active(right, v) - active(left, v)).sum();
        let across_y: i32 = (left..=right).map(|u| active(u, bottom) - active(u, top)).sum();
        across_x.abs() > across_y.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 60;

    fn bits_of_boxes(boxes: &[[usize; 4]]) -> Vec<u32> {
        let mut bits = vec![0; WIDTH * 50];
        for (k, &[x0, y0, x1, y1]) in boxes.iter().enumerate() {
            for y in y0..y1 {
                bits[y * WIDTH + x0..y * WIDTH + x1].iter_mut().for_each(|b| *b |= 1 << k);
            }
        }
        bits
    }

    #[test]
    fn the_outline_of_a_box_is_its_inner_edge() {
        let [x0, y0, x1, y1] = [10, 5, 30, 25];
        let bits = bits_of_boxes(&[[x0, y0, x1, y1]]);
        for line_px in 1..=3 {
            let owner = outlines(&bits, WIDTH, line_px, false);
            for (pixel, &o) in owner.iter().enumerate() {
                let (x, y) = (pixel % WIDTH, pixel / WIDTH);
                let inside = (x0..x1).contains(&x) && (y0..y1).contains(&y);
                let deep = inside && (x - x0).min(x1 - 1 - x).min(y - y0).min(y1 - 1 - y) >= line_px;
                assert_eq!(o == 1, inside && !deep, "{line_px}: {x},{y}");
            }
        }
    }

    #[test]
    fn outlines_of_coinciding_masks_are_stacked_at_full_width() {
        let bits = bits_of_boxes(&[[10, 5, 40, 35]; 3]);
        let owner = outlines(&bits, WIDTH, 2, false);
        let across: Vec<u8> = owner[20 * WIDTH + 8..][..12].to_vec();
        assert_eq!(across, [0, 0, 1, 1, 2, 2, 3, 3, 0, 0, 0, 0]);
    }

    #[test]
    fn outlines_of_thin_masks_alternate_as_dashes() {
        for thin in [[10, 20, 50, 22], [20, 5, 22, 45]] {
            let bits = bits_of_boxes(&[thin; 3]);
            let owner = outlines(&bits, WIDTH, 1, false);
            for mask in 1..=3 {
                let pixels = owner.iter().filter(|&&o| o == mask).count();
                assert!(pixels >= 10, "mask {mask} has {pixels} of 80 pixels");
            }
        }
    }

    #[test]
    fn separate_edges_have_separate_outlines() {
        let bits = bits_of_boxes(&[[10, 5, 40, 35], [20, 10, 50, 40]]);
        let owner = outlines(&bits, WIDTH, 1, false);
        assert_eq!(owner[20 * WIDTH + 10], 1);
        assert_eq!(owner[20 * WIDTH + 20], 2);
        assert_eq!(owner[20 * WIDTH + 39], 1);
        assert_eq!(owner[20 * WIDTH + 49], 2);
        assert_eq!(owner[20 * WIDTH + 30], 0);
    }

    #[test]
    fn patterns_leave_gaps_and_every_side_keeps_marks() {
        // Apart, so that no outline is stacked.
        let bits = bits_of_boxes(&[[2, 2, 17, 45], [20, 2, 38, 45], [41, 2, 58, 45]]);
        let solid = outlines(&bits, WIDTH, 1, false);
        let owner = outlines(&bits, WIDTH, 1, true);
        let count = |of: &[u8], mask: u8| of.iter().filter(|o| **o == mask).count() as f64;
        for (mask, share) in [(1, 1.0), (2, 6.0 / 9.0), (3, 0.5)] {
            let marked = count(&owner, mask) / count(&solid, mask);
            assert!((marked - share).abs() < 0.06, "mask {mask}: {marked} of {share}");
        }
        // Each side of the dashed box has marks and gaps.
        let column = |x: usize| (5..42).map(|y| owner[y * WIDTH + x]).collect::<Vec<_>>();
        let row = |y: usize| owner[y * WIDTH + 23..y * WIDTH + 35].to_vec();
        for side in [column(20), column(37), row(2), row(44)] {
            assert!(side.contains(&2) && side.contains(&0), "{side:?}");
        }
    }

    #[test]
    fn dashes_of_a_diagonal_edge_are_told_apart() {
        let mut bits = vec![0; WIDTH * 50];
        for y in 0..50 {
            // Mask 1, dashed, below the falling diagonal.
            bits[y * WIDTH..y * WIDTH + y + 1].fill(0b10);
        }
        let owner = outlines(&bits, WIDTH, 1, true);
        let diagonal: Vec<u8> = (6..44).map(|y| owner[y * WIDTH + y]).collect();
        let marks = diagonal.iter().filter(|o| **o == 2).count();
        assert!((20..32).contains(&marks), "{diagonal:?}");
    }

    #[test]
    fn masks_cut_by_the_border_have_no_outline_there() {
        let bits = bits_of_boxes(&[[0, 0, WIDTH, 30]]);
        let owner = outlines(&bits, WIDTH, 1, false);
        for (pixel, &o) in owner.iter().enumerate() {
            assert_eq!(o == 1, pixel / WIDTH == 29, "{pixel}");
        }
        assert!(outlines(&[], 0, 1, false).is_empty());
    }
}
