//! A second image over the first: blended in a colour map, or beside it to judge how well both lie on each other.

use glioscope_core::with_samples;
use rayon::prelude::*;

use crate::{
    flat::{
        context::PreparedContext,
        sampler::{rows_of, value_at},
        view::SliceView,
        window::Window,
    },
    scene::{ColorMap, Rgb, keywords::keywords},
};

/// Side of the checkerboard's squares in millimetres.
const SQUARE_MM: f64 = 16.0;
/// Share of the pixels inside that are edges, before thinning.
const EDGE_SHARE: f64 = 0.12;
/// Of a pixel outside the image, or without a finite value.
const NOTHING: u16 = 256;

keywords! {
    /// How two images share a slice.
    #[derive(Default)]
    pub enum Mixing {
        /// The second one over the first, translucent.
        #[default]
        Over,
        /// Squares of both in turn.
        Checkerboard,
        /// The first one left, the second one right of a line.
        Swipe,
        /// The edges of the second one over the first.
        Edges,
        /// The second one in place of the first: whoever draws shows both in turn.
        Blink,
    }
}

/// The second image of a slice.
#[derive(Clone, Copy, Debug)]
pub struct SecondLayer<'a> {
    /// The image.
    pub image: &'a PreparedContext,
    /// Its window.
    pub window: Window,
    /// Its colours.
    pub map: ColorMap,
    /// How it shares the slice with the first image.
    pub mixing: Mixing,
    /// [`Mixing::Over`]: opacity, 0 to 1.
    pub opacity: f32,
    /// [`Mixing::Over`]: values at or below it are transparent, in the image's unit.
    pub threshold: f64,
    /// [`Mixing::Swipe`]: where the line is, from 0 (left) to 1.
    pub share: f32,
}

/// Draws the second image over `rgba`, the first one's pixels. `outside`: the colour of pixels that neither has.
pub(super) fn draw_second(view: &SliceView, layer: &SecondLayer<'_>, outside: Rgb, rgba: &mut [u8]) {
    let width = view.size_px[0] as usize;
    let volume = layer.image.volume();
    let scaling = volume.scaling();
    let values = with_samples!(volume.samples(), stored => {
        #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
        let at = |linear: usize| stored[linear] as f64;
        let mut values = vec![NOTHING; rgba.len() / 4];
        values.par_chunks_exact_mut(width).enumerate().for_each(|(y, line)| {
            let row = layer.image.sampler.row(view, y as u32);
            for x in row.span.clone() {
                if let Some(value) = value_at(&layer.image.sampler, row.place(x), &at) {
                    let value = scaling.apply(value);
                    let is_shown = layer.mixing != Mixing::Over || value > layer.threshold;
                    line[x] = if is_shown { u16::from(layer.window.grey(value)) } else { NOTHING };
                }
            }
        });
        values
    });
    let table = layer.map.table();
    let opaque = |value: u16| table.get(usize::from(value)).copied().unwrap_or(outside);
    let draw = |pick: &dyn Fn(usize) -> bool, line: &mut [u8], values: &[u16]| {
        for (x, (pixel, &value)) in line.chunks_exact_mut(4).zip(values).enumerate() {
            if pick(x) {
                pixel[..3].copy_from_slice(&opaque(value));
            }
        }
    };
    let rows = rows_of(rgba, view).map(|(_, line)| line).zip(values.par_chunks_exact(width)).enumerate();
    match layer.mixing {
        Mixing::Over => {
            let opacity = f64::from(layer.opacity.clamp(0.0, 1.0));
            rows.for_each(|(_, (line, values))| {
                for (pixel, &value) in line.chunks_exact_mut(4).zip(values).filter(|(_, v)| **v != NOTHING) {
                    for (channel, over) in pixel.iter_mut().zip(table[usize::from(value)]) {
                        let under = f64::from(*channel);
                        *channel = (under + (f64::from(over) - under) * opacity + 0.5) as u8;
                    }
                }
            });
        }
        Mixing::Checkerboard => {
            // In the patient, so that squares stay where they are when the slice is moved.
            let square = |pixel: usize, along: glam::DVec3| {
                let middle = view.center_mm.dot(along) / view.mm_per_pixel;
                let size = f64::from(if along == view.right() { view.size_px[0] } else { view.size_px[1] });
                ((pixel as f64 + 0.5 - size / 2.0 + middle) * view.mm_per_pixel / SQUARE_MM).floor() as i64
            };
            let (right, down) = (view.right(), view.down());
            rows.for_each(|(y, (line, values))| {
                let row = square(y, down);
                draw(&|x| (square(x, right) + row).rem_euclid(2) == 1, line, values);
            });
        }
        Mixing::Swipe => {
            let first = f64::from(layer.share.clamp(0.0, 1.0)) * width as f64;
            rows.for_each(|(_, (line, values))| draw(&|x| x as f64 + 0.5 > first, line, values));
        }
        Mixing::Blink => rows.for_each(|(_, (line, values))| draw(&|_| true, line, values)),
        Mixing::Edges => {
            let color = layer.map.color(0.75);
            let edges = edges(&values, width);
            rows.for_each(|(y, (line, _))| {
                for (pixel, _) in
                    line.chunks_exact_mut(4).zip(&edges[y * width..]).filter(|(_, is_edge)| **is_edge)
                {
                    pixel[..3].copy_from_slice(&color);
                }
            });
        }
    }
}

/// Thin edges of an image: the steepest pixels that are steeper than both neighbours along their gradient (Canny 1986,
/// without following lines).
fn edges(values: &[u16], width: usize) -> Vec<bool> {
    let height = values.len() / width;
    let mut edges = vec![false; values.len()];
    if width < 5 || height < 5 {
        return edges;
    }
    let at = |x: usize, y: usize| values[y * width + x];
    // A pixel beside nothing has no gradient: the border of the image is no edge in it.
    let gradient = |x: usize, y: usize| -> Option<[f32; 2]> {
        let around = |dx: usize, dy: usize| {
            let value = at(x + dx - 1, y + dy - 1);
            (value != NOTHING).then(|| f32::from(value))
        };
        let [a, b, c] = [around(0, 0)?, around(1, 0)?, around(2, 0)?];
        let [d, f] = [around(0, 1)?, around(2, 1)?];
        let [g, h, i] = [around(0, 2)?, around(1, 2)?, around(2, 2)?];
        Some([c + 2.0 * f + i - a - 2.0 * d - g, g + 2.0 * h + i - a - 2.0 * b - c])
    };
    let mut steep = vec![0.0_f32; values.len()];
    let mut slopes = vec![[0.0_f32; 2]; values.len()];
    let inner = || (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y)));
    for (x, y) in inner() {
        if let Some(slope) = gradient(x, y) {
            slopes[y * width + x] = slope;
            steep[y * width + x] = slope[0].hypot(slope[1]);
        }
    }
    let mut sorted: Vec<f32> = steep.iter().copied().filter(|s| *s > 0.0).collect();
    if sorted.is_empty() {
        return edges;
    }
    let least = ((sorted.len() as f64) * (1.0 - EDGE_SHARE)) as usize;
    let least = least.min(sorted.len() - 1);
    let (_, &mut threshold, _) = sorted.select_nth_unstable_by(least, f32::total_cmp);
    for (x, y) in inner() {
        let here = y * width + x;
        let [dx, dy] = slopes[here];
        if steep[here] < threshold.max(1.0) {
            continue;
        }
        let (step_x, step_y): (isize, isize) = match dy.abs() / dx.abs().max(f32::MIN_POSITIVE) {
            t if t < 0.414 => (1, 0),
            t if t > 2.414 => (0, 1),
            _ if (dx > 0.0) == (dy > 0.0) => (1, 1),
            _ => (-1, 1),
        };
        let beside = |sign: isize| {
            let at = here as isize + sign * (step_y * width as isize + step_x);
            usize::try_from(at).ok().and_then(|at| steep.get(at)).copied().unwrap_or(0.0)
        };
        edges[here] = steep[here] >= beside(-1) && steep[here] > beside(1);
    }
    edges
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use glioscope_core::{Grid, Samples, Scaling, Volume};

    use super::*;
    use crate::flat::{ContextLayer, Convention, Plane, SliceLayers, SliceStyle, render_slice};

    const N: usize = 40;

    fn image(value: impl Fn([usize; 3]) -> f32) -> PreparedContext {
        let grid = Grid::axis_aligned([N, N, 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let values = (0..grid.voxel_count()).map(|linear| value(grid.ijk(linear))).collect();
        PreparedContext::new(Arc::new(Volume::new(grid, Samples::F32(values), Scaling::NONE).unwrap()))
    }

    /// A pixel a voxel, x to the right and y upwards.
    fn view() -> SliceView {
        let bounds = (DVec3::splat(-0.5), DVec3::new(N as f64 - 0.5, N as f64 - 0.5, 2.5));
        let mut view =
            SliceView::fit(Plane::Axial, Convention::Neurological, bounds, DVec3::ONE, [N as u32; 2]);
        view.mm_per_pixel = 1.0;
        view.center_mm = DVec3::new(19.5, 19.5, 1.0);
        view
    }

    fn drawn(second: &PreparedContext, change: impl Fn(&mut SecondLayer<'_>)) -> Vec<[u8; 3]> {
        let first = image(|_| 0.0);
        let window = Window { low: 0.0, high: 100.0 };
        let (map, mixing) = (ColorMap::Grey, Mixing::Over);
        let mut layer =
            SecondLayer { image: second, window, map, mixing, opacity: 1.0, threshold: 0.0, share: 0.5 };
        change(&mut layer);
        let layers = SliceLayers {
            context: Some(ContextLayer { image: &first, window }),
            second: Some(layer),
            masks: None,
            style: SliceStyle::DARK,
        };
        render_slice(&view(), &layers).rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect()
    }

    #[test]
    fn colour_maps_have_their_known_ends_and_middles() {
        let at = |map: ColorMap| [0.0, 0.5, 1.0].map(|share| map.color(share));
        assert_eq!(at(ColorMap::Hot), [[0, 0, 0], [255, 85, 0], [255, 255, 255]]);
        assert_eq!(at(ColorMap::Grey), [[0; 3], [128; 3], [255; 3]]);
        assert_eq!(at(ColorMap::InvertedGrey), [[255; 3], [128; 3], [0; 3]]);
        // Of matplotlib's tables, between the 128th and the 129th of 256 colours.
        for (map, expected) in [
            (ColorMap::Viridis, [[68, 1, 84], [33, 145, 140], [253, 231, 37]]),
            (ColorMap::Inferno, [[0, 0, 4], [188, 55, 84], [252, 255, 164]]),
        ] {
            let pairs = at(map).into_iter().flatten().zip(expected.into_iter().flatten());
            assert!(pairs.clone().all(|(a, b): (u8, u8)| a.abs_diff(b) <= 1), "{:?}", at(map));
        }
    }

    #[test]
    fn over_blends_above_the_threshold_only() {
        let second = image(|[x, ..]| if x < 20 { 40.0 } else { 80.0 });
        let pixels = drawn(&second, |layer| (layer.opacity, layer.threshold) = (0.5, 40.0));
        let row = &pixels[20 * N..21 * N];
        assert!(row[..20].iter().all(|p| *p == [0; 3]), "at the threshold: {row:?}");
        assert!(row[20..].iter().all(|p| *p == [102; 3]), "half of 80 %: {row:?}");
    }

    #[test]
    fn the_swipe_line_and_the_squares_divide_the_slice() {
        let second = image(|_| 100.0);
        let pixels = drawn(&second, |layer| (layer.mixing, layer.share) = (Mixing::Swipe, 0.25));
        for (at, pixel) in pixels.iter().enumerate() {
            assert_eq!(*pixel, [if at % N < 10 { 0 } else { 255 }; 3], "{at}");
        }
        let pixels = drawn(&second, |layer| layer.mixing = Mixing::Checkerboard);
        let white = |x: usize, y: usize| pixels[y * N + x] == [255; 3];
        // Squares of 16 mm from the patient's origin; rows run down, from y = 39 to y = 0.
        for (x, y) in [(3, 39), (20, 39), (3, 20), (20, 20), (35, 39)] {
            let (mm_x, mm_y) = (x as f64, 39.0 - y as f64);
            let odd = ((mm_x / 16.0).floor() + ((-mm_y) / 16.0).floor()) as i64 % 2 != 0;
            assert_eq!(white(x, y), odd, "{x} {y}");
        }
    }

    #[test]
    fn edges_are_thin_lines_at_the_step() {
        let second =
            image(|[x, y, _]| if (10..30).contains(&x) && (10..30).contains(&y) { 90.0 } else { 10.0 });
        let pixels = drawn(&second, |layer| layer.mixing = Mixing::Edges);
        let color = ColorMap::Grey.color(0.75);
        let in_row: Vec<usize> = (0..N).filter(|x| pixels[20 * N + x] == color).collect();
        assert_eq!(in_row.len(), 2, "one pixel at each side: {in_row:?}");
        assert!((9..=10).contains(&in_row[0]) && (29..=30).contains(&in_row[1]), "{in_row:?}");
        assert!(drawn(&image(|_| 50.0), |layer| layer.mixing = Mixing::Edges).iter().all(|p| *p == [0; 3]));
    }

    #[test]
    fn what_the_second_image_lacks_is_the_first_ones_or_outside() {
        let second = image(|[x, ..]| if x < 20 { f32::NAN } else { 100.0 });
        let over = drawn(&second, |_| {});
        assert_eq!((over[20 * N + 5], over[20 * N + 30]), ([0; 3], [255; 3]));
        let swiped = drawn(&second, |layer| (layer.mixing, layer.share) = (Mixing::Swipe, 0.0));
        assert_eq!((swiped[20 * N + 5], swiped[20 * N + 30]), (SliceStyle::DARK.outside, [255; 3]));
    }
}
