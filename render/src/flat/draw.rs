//! Draws slices: image and masks on a plane.

use glioscope_core::{IndexData, Scaling, Selection, TumorIndex, with_samples};
use rayon::prelude::*;

use crate::{
    flat::{
        context::PreparedContext,
        fusion::{SecondLayer, draw_second},
        outline::outlines,
        sampler::{Sampler, rows_of, value_at},
        view::SliceView,
        window::Window,
    },
    scene::{MaskColors, Rgb, keywords::keywords},
};

keywords! {
    /// How masks are drawn over the image.
    #[derive(Default)]
    pub enum Overlay {
        /// Regions in their colours, translucent.
        Fill,
        /// Each mask's edge in its colour, opaque.
        Outline,
        /// Both.
        #[default]
        Both,
    }
}

/// The image of a slice.
#[derive(Clone, Copy, Debug)]
pub struct ContextLayer<'a> {
    /// The image.
    pub image: &'a PreparedContext,
    /// Grey window.
    pub window: Window,
}

/// The masks of a slice.
#[derive(Clone, Copy, Debug)]
pub struct MaskLayer<'a> {
    /// Which masks are active where.
    pub index: &'a TumorIndex,
    /// Their colours.
    pub colors: &'a MaskColors,
    /// Regions shown; the others count as empty, also for outlines.
    pub selection: &'a Selection,
    /// Fill, outline or both.
    pub overlay: Overlay,
    /// Opacity of the fill, 0 to 1.
    pub opacity: f32,
    /// Width of outlines; 0 counts as 1.
    pub outline_px: u32,
    /// Whether outlines have the gaps of their mask's [`crate::flat::OutlinePattern`].
    pub outline_patterns: bool,
    /// Bits of a region that is shown but not filled: the one shared by two time points, so that the anatomy stays
    /// visible where nothing changed.
    pub unfilled: Option<u32>,
    /// Bits of the masks that count; the others are drawn as if they weren't there, in all regions.
    pub counted: u32,
}

/// Colours of pixels without an image value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SliceStyle {
    /// Outside the image. Not a grey, so that it can't be mistaken for a value.
    pub outside: Rgb,
    /// Voxels that are NaN or infinite.
    pub not_finite: Rgb,
}

impl SliceStyle {
    /// For dark themes.
    pub const DARK: Self = Self { outside: [24, 27, 34], not_finite: [176, 0, 92] };
}

/// The layers of a slice.
#[derive(Clone, Copy, Debug)]
pub struct SliceLayers<'a> {
    /// The image; without one, masks are drawn on the empty background.
    pub context: Option<ContextLayer<'a>>,
    /// A second image over it.
    pub second: Option<SecondLayer<'a>>,
    /// The masks.
    pub masks: Option<MaskLayer<'a>>,
    /// Colours of pixels without an image value.
    pub style: SliceStyle,
}

/// A finished slice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SliceImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// sRGB with alpha 255, row by row from the top left.
    pub rgba: Vec<u8>,
    /// Pixels whose nearest voxel is NaN or infinite.
    pub not_finite_pixels: u64,
}

/// Draws one slice, on all cores. A view of no pixels gives an empty slice.
pub fn render_slice(view: &SliceView, layers: &SliceLayers<'_>) -> SliceImage {
    let [width, height] = view.size_px.map(|s| s as usize);
    let mut rgba = vec![255; width * height * 4];
    if rgba.is_empty() {
        return SliceImage { size: view.size_px, rgba, not_finite_pixels: 0 };
    }
    let not_finite_pixels = match &layers.context {
        Some(context) => {
            let volume = context.image.volume();
            let scaling = volume.scaling();
            with_samples!(volume.samples(), stored => {
                #[allow(clippy::cast_lossless, clippy::unnecessary_cast, reason = "one macro arm for all ten types")]
                let at = |linear: usize| stored[linear] as f64;
                draw_image(view, &context.image.sampler, &at, scaling, context.window, layers.style, &mut rgba)
            })
        }
        None => {
            let [r, g, b] = layers.style.outside;
            rgba.par_chunks_exact_mut(4)
                .with_min_len(1 << 14)
                .for_each(|p| p.copy_from_slice(&[r, g, b, 255]));
            0
        }
    };
    if let Some(second) = &layers.second {
        draw_second(view, second, layers.style.outside, &mut rgba);
    }
    if let Some(masks) = &layers.masks {
        draw_masks(view, masks, &mut rgba);
    }
    SliceImage { size: view.size_px, rgba, not_finite_pixels }
}

fn draw_image(
    view: &SliceView,
    sampler: &Sampler,
    at: &(impl Fn(usize) -> f64 + Sync),
    scaling: Scaling,
    window: Window,
    style: SliceStyle,
    rgba: &mut [u8],
) -> u64 {
    let (scale, offset) = window.scale_offset();
    let (scale, offset) = (scaling.slope * scale, scaling.intercept * scale + offset);
    let opaque = |[r, g, b]: Rgb| [r, g, b, 255];
    let [outside, unknown] = [style.outside, style.not_finite].map(opaque);
    let draw_row = |y: u32, line: &mut [u8]| -> u64 {
        let row = sampler.row(view, y);
        let mut not_finite = 0;
        let (before, rest) = line.split_at_mut(row.span.start * 4);
        let (inside, after) = rest.split_at_mut(row.span.len() * 4);
        before.chunks_exact_mut(4).chain(after.chunks_exact_mut(4)).for_each(|p| p.copy_from_slice(&outside));
        for (x, pixel) in row.span.clone().zip(inside.chunks_exact_mut(4)) {
            let color = match value_at(sampler, row.place(x), at) {
                Some(stored) => {
                    // The cast clamps to 0 to 255.
                    let grey = (stored * scale + offset) as u8;
                    [grey, grey, grey, 255]
                }
                None => {
                    not_finite += 1;
                    unknown
                }
            };
            pixel.copy_from_slice(&color);
        }
        not_finite
    };
    rows_of(rgba, view).map(|(y, line)| draw_row(y, line)).sum()
}

fn draw_masks(view: &SliceView, masks: &MaskLayer<'_>, rgba: &mut [u8]) {
    let width = view.size_px[0] as usize;
    let sampler = Sampler::new(masks.index.grid());
    let mut bits = match masks.index.data() {
        IndexData::U8(v) => nearest_bits(view, &sampler, v),
        IndexData::U16(v) => nearest_bits(view, &sampler, v),
        IndexData::U32(v) => nearest_bits(view, &sampler, v),
    };
    if masks.counted != u32::MAX {
        bits.iter_mut().for_each(|bits| *bits &= masks.counted);
    }
    let fills = shown_fills(&mut bits, masks);
    if masks.overlay != Overlay::Outline {
        let opacity = f64::from(masks.opacity.clamp(0.0, 1.0));
        rows_of(rgba, view).zip(bits.par_chunks_exact(width)).for_each(|((_, line), bits)| {
            for (pixel, &bits) in
                line.chunks_exact_mut(4).zip(bits).filter(|(_, b)| **b != 0 && Some(**b) != masks.unfilled)
            {
                let color = fills.iter().find(|f| f.0 == bits).map_or([0; 3], |f| f.1);
                for (channel, fill) in pixel.iter_mut().zip(color) {
                    let under = f64::from(*channel);
                    *channel = (under + (f64::from(fill) - under) * opacity + 0.5) as u8;
                }
            }
        });
    }
    if masks.overlay != Overlay::Fill {
        let owners = outlines(&bits, width, masks.outline_px.max(1) as usize, masks.outline_patterns);
        let colors: Vec<Rgb> = (0..32).map(|k| masks.colors.mask(k)).collect();
        rows_of(rgba, view).zip(owners.par_chunks_exact(width)).for_each(|((_, line), owners)| {
            for (pixel, &owner) in line.chunks_exact_mut(4).zip(owners).filter(|(_, o)| **o != 0) {
                pixel[..3].copy_from_slice(&colors[usize::from(owner) - 1]);
            }
        });
    }
}

/// Mask bits of the nearest voxel at each pixel.
fn nearest_bits<T: Copy + Sync + Into<u32>>(view: &SliceView, sampler: &Sampler, index: &[T]) -> Vec<u32> {
    let width = view.size_px[0] as usize;
    let mut bits = vec![0; width * view.size_px[1] as usize];
    (0..view.size_px[1]).into_par_iter().zip(bits.par_chunks_exact_mut(width)).for_each(|(y, line)| {
        let row = sampler.row(view, y);
        for x in row.span.clone() {
            line[x] = index[sampler.nearest(row.place(x))].into();
        }
    });
    bits
}

/// Clears the bits of hidden regions, and returns the fill colour of each remaining region.
fn shown_fills(bits: &mut [u32], masks: &MaskLayer<'_>) -> Vec<(u32, Rgb)> {
    let mut fills: Vec<(u32, Option<Rgb>)> = Vec::new();
    let mut last = (0, 0);
    for b in bits.iter_mut().filter(|b| **b != 0) {
        if *b != last.0 {
            let fill = match fills.iter().find(|f| f.0 == *b) {
                Some(f) => f.1,
                None => {
                    let fill = masks.selection.shows(*b).then(|| masks.colors.region(*b));
                    fills.push((*b, fill));
                    fill
                }
            };
            last = (*b, if fill.is_some() { *b } else { 0 });
        }
        *b = last.1;
    }
    fills.into_iter().filter_map(|(bits, fill)| Some((bits, fill?))).collect()
}
