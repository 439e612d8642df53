//! Slices as pictures: the image as PNG, outlines as paths.

use glioscope_core::{
    Grid, Mask, Volume,
    case::TimePoint,
    glam::{DMat3, DVec2, DVec3},
};
use glioscope_render::flat::{Convention, Histogram, Plane, SliceView, Window};
use image::{
    ExtendedColorType, ImageEncoder,
    codecs::png::{CompressionType, FilterType, PngEncoder},
};

use super::{
    PageError, Slice,
    contour::{Field, path},
};

/// Side of a picture's pixels: finer than the slices of most scans, and enough for a phone.
const PIXEL_MM: f64 = 0.8;
/// Distance of the slices among which the largest is searched.
const SEARCH_MM: f64 = 1.0;
/// Room around the masks in the outline of true size.
const TRUE_SIZE_MARGIN_MM: f64 = 1.0;

/// A box, world millimetres.
pub type Box3 = (DVec3, DVec3);

/// Directions to the right and down in the picture, world axes: the patient's left is at the right.
fn axes(plane: Plane) -> [DVec3; 2] {
    let view = SliceView {
        turn: DMat3::IDENTITY,
        plane,
        center_mm: DVec3::ZERO,
        mm_per_pixel: 1.0,
        size_px: [1; 2],
        convention: Convention::Radiological,
    };
    [view.right(), view.down()]
}

/// Interpolates `value` at a place in voxels (centres at whole numbers); `outside` beyond the grid.
pub fn trilinear(dims: [usize; 3], at: DVec3, outside: f64, value: &dyn Fn([usize; 3]) -> f64) -> f64 {
    let floor = at.floor();
    let part = (at - floor).to_array();
    let floor = floor.to_array();
    let mut sum = 0.0;
    for corner in 0..8 {
        let up = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
        let weight: f64 =
            (0..3).map(|axis| if up[axis] == 1 { part[axis] } else { 1.0 - part[axis] }).product();
        if weight == 0.0 {
            continue;
        }
        let place = [0, 1, 2].map(|axis| floor[axis] + f64::from(up[axis]));
        let is_inside = (0..3).all(|axis| place[axis] >= 0.0 && place[axis] < dims[axis] as f64);
        sum += weight * if is_inside { value(place.map(|v| v as usize)) } else { outside };
    }
    sum
}

/// Where a picture lies: its upper left corner, directions and size.
struct Sheet {
    corner_mm: DVec3,
    axes: [DVec3; 2],
    pixels: [usize; 2],
    pixel_mm: f64,
}

impl Sheet {
    /// The part of the plane through `center_mm` that covers `around`.
    fn new(plane: Plane, center_mm: DVec3, (lo, hi): Box3, pixel_mm: f64) -> Self {
        let axes = axes(plane);
        let range = axes.map(|axis| {
            let [a, b] = [lo.dot(axis), hi.dot(axis)];
            [a.min(b), a.max(b)]
        });
        let normal = axes[0].cross(axes[1]);
        let corner_mm = axes[0] * range[0][0] + axes[1] * range[1][0] + normal * center_mm.dot(normal);
        let pixels = range.map(|[a, b]| ((b - a) / pixel_mm).ceil().max(1.0) as usize);
        Self { corner_mm, axes, pixels, pixel_mm }
    }

    /// The part with the points of `loops` and a margin, on the same pixels; `None` without points.
    fn cropped(&self, loops: &[Vec<[f64; 2]>], margin_mm: f64) -> Option<Self> {
        let points = || loops.iter().flatten().map(|p| DVec2::from_array(*p));
        let first = points().next()?;
        let (lo, hi) = points().fold((first, first), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let start = ((lo - margin_mm) / self.pixel_mm).floor() * self.pixel_mm;
        let pixels = ((hi + margin_mm - start) / self.pixel_mm).ceil();
        let corner_mm = self.corner_mm + self.axes[0] * start.x + self.axes[1] * start.y;
        Some(Self { corner_mm, pixels: pixels.to_array().map(|n| n as usize), ..*self })
    }

    fn size_mm(&self) -> [f64; 2] {
        self.pixels.map(|n| n as f64 * self.pixel_mm)
    }

    fn sample(&self, mut at: impl FnMut(DVec3) -> f64) -> Field {
        let [width, height] = self.pixels;
        let values = (0..width * height).map(|n| {
            let shift = DVec2::new((n % width) as f64 + 0.5, (n / width) as f64 + 0.5) * self.pixel_mm;
            at(self.corner_mm + self.axes[0] * shift.x + self.axes[1] * shift.y)
        });
        Field { values: values.collect(), size: self.pixels, pixel_mm: self.pixel_mm }
    }

    /// What `is_in` says of the voxels of a grid.
    fn part(&self, grid: &Grid, is_in: impl Fn([usize; 3]) -> bool) -> Field {
        let to_voxel = grid.voxel_from_world();
        let value = |ijk: [usize; 3]| f64::from(u8::from(is_in(ijk)));
        self.sample(|mm| trilinear(grid.dims(), to_voxel.transform_point3(mm), 0.0, &value))
    }

    fn mask(&self, mask: &Mask) -> Field {
        self.part(mask.grid(), |ijk| mask.bits().get(ijk))
    }

    fn level(&self, time: &TimePoint, count: usize) -> Field {
        let index = &time.index;
        self.part(index.grid(), |ijk| index.get(index.grid().linear(ijk)).count_ones() as usize >= count)
    }

    fn picture(&self, image: &Volume, window: [f64; 2]) -> Result<Vec<u8>, PageError> {
        let to_voxel = image.grid().voxel_from_world();
        let value = |ijk: [usize; 3]| image.value(image.grid().linear(ijk));
        let field = self
            .sample(|mm| trilinear(image.grid().dims(), to_voxel.transform_point3(mm), window[0], &value));
        let [black, white] = window;
        let gray = |v: &f64| ((v - black) / (white - black).max(f64::MIN_POSITIVE) * 255.0).round() as u8;
        let bytes: Vec<u8> = field.values.iter().map(gray).collect();
        let [width, height] = self.pixels.map(|n| n as u32);
        let mut png = Vec::new();
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive)
            .write_image(&bytes, width, height, ExtendedColorType::L8)
            .map_err(|why| PageError::Picture(why.to_string()))?;
        Ok(png)
    }
}

/// The value of which `percent` (0 to 100) of `values` are below, which it reorders; `None` where there are none.
pub fn percentile(values: &mut [f32], percent: usize) -> Option<f64> {
    let at = values.len().checked_sub(1)? * percent.min(100) / 100;
    Some(f64::from(*values.select_nth_unstable_by(at, f32::total_cmp).1))
}

/// What black and white mean: as the window of slices opens. `None` for an even image.
fn window(image: &Volume) -> Option<[f64; 2]> {
    let histogram = Histogram::of(image);
    histogram.range().filter(|(least, most)| most > least)?;
    let Window { low, high } = histogram.initial_window();
    Some([low, high])
}

/// Paths of all masks and levels in a sheet, by their place in the page.
fn paths(sheet: &Sheet, time: &TimePoint, ids: &[&str], levels: usize) -> [Vec<String>; 2] {
    let masks = ids.iter().map(|id| {
        let mask = time.masks.iter().find(|m| m.mask.id() == *id);
        mask.map(|m| path(&sheet.mask(&m.mask).loops_mm())).unwrap_or_default()
    });
    let levels = (1..=levels).map(|count| path(&sheet.level(time, count).loops_mm()));
    [masks.collect(), levels.collect()]
}

/// The three slices through `center_mm` that cover `around`.
pub fn slices(
    (time, image): (&TimePoint, Option<&Volume>),
    (ids, levels): (&[&str], usize),
    center_mm: DVec3,
    around: Box3,
) -> Result<Vec<Slice>, PageError> {
    let shown = image.and_then(|image| Some((image, window(image)?)));
    let one = |plane: Plane| {
        let sheet = Sheet::new(plane, center_mm, around, PIXEL_MM);
        let png = shown.map(|(image, window)| sheet.picture(image, window)).transpose()?;
        let [masks, levels] = paths(&sheet, time, ids, levels);
        Ok(Slice { plane, size_mm: sheet.size_mm(), png, masks, levels })
    };
    Plane::ALL.into_iter().map(one).collect()
}

/// The axial slice in which what any mask holds has the largest area; `None` where nothing is active.
pub fn largest(time: &TimePoint, (ids, levels): (&[&str], usize), (lo, hi): Box3) -> Option<Slice> {
    let around = (lo - TRUE_SIZE_MARGIN_MM, hi + TRUE_SIZE_MARGIN_MM);
    let count = ((hi.z - lo.z) / SEARCH_MM).floor().max(0.0) as usize;
    let at = |n: usize| DVec3::new(lo.x, lo.y, lo.z + (n as f64 + 0.5) * SEARCH_MM);
    let area = |n: usize| {
        let sheet = Sheet::new(Plane::Axial, at(n), around, 2.0 * SEARCH_MM);
        let active = sheet.sample(|mm| f64::from(u8::from(time.index.at_mm(mm) != 0)));
        active.values.iter().sum::<f64>()
    };
    // `max_by` takes the last of equals: from behind, the first.
    let best = (0..=count).rev().map(|n| (n, area(n))).max_by(|a, b| a.1.total_cmp(&b.1));
    let (n, _) = best.filter(|(_, area)| *area > 0.0)?;
    let sheet = Sheet::new(Plane::Axial, at(n), around, PIXEL_MM / 2.0);
    let sheet = sheet.cropped(&sheet.level(time, 1).loops_mm(), TRUE_SIZE_MARGIN_MM)?;
    let [masks, levels] = paths(&sheet, time, ids, levels);
    Some(Slice { plane: Plane::Axial, size_mm: sheet.size_mm(), png: None, masks, levels })
}
