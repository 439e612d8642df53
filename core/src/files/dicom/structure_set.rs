//! RT structure sets (PS3.3 A.19): closed contours, filled by pixel centres with the even-odd rule on the slices of their
//! image.

use std::collections::BTreeMap;

use glam::DVec3;

use super::super::{FileError, Loaded, Origin, ReadOptions, Segment};
use super::data_set::{DataSet, Unusable};
use super::instance::Place;
use super::planes::{self, Planes};
use super::scan::{Header, in_file};
use super::segmentation::short;
use super::tags;
use crate::{Check, Samples, Scaling, Volume, decimal};

/// A contour this near to a slice, as a share of the step, lies on it: contours are rounded.
const ON_SLICE: f64 = 0.05;

/// A contour farther from every slice, as a share of the step, lies on none.
const OFF_SLICE: f64 = 0.49;

/// A point this near to the image's edge, in pixels, lies on it: contours are rounded.
const ON_EDGE: f64 = 1e-3;

/// Points of one contour may lie this far off its plane, as a share of the step.
const FLAT: f64 = 0.1;

/// Farthest point, in millimetres.
const FARTHEST_MM: f64 = 1e6;

/// Pixel spacing of the grid of a structure set without an image, in millimetres.
const OWN_SPACING_MM: f64 = 1.0;

/// Most pixels of a row or column of such a grid.
const MAX_OWN: usize = 2048;

/// Closed contours of a region of interest.
struct Roi {
    segment: Segment,
    frame_of_reference: String,
    contours: Vec<Vec<DVec3>>,
    /// Contours of fewer than three points.
    without_area: usize,
    /// Points and open contours.
    open: usize,
    /// Contours whose number of points isn't the stated one.
    miscounted: usize,
}

/// A structure set.
pub(super) struct StructureSet {
    rois: Vec<Roi>,
    checks: Vec<Check>,
    /// SOP Instance UIDs of images that contours name.
    referenced: Vec<String>,
    /// Series Instance UIDs of the images that it was drawn on.
    series: Vec<String>,
}

impl StructureSet {
    /// # Errors
    /// [`Unusable`] for coordinates that are no points, or farther than a kilometre.
    pub fn of(data: &DataSet, name: &str) -> Result<Self, Unusable> {
        let mut checks = Vec::new();
        let mut contours: BTreeMap<i64, &DataSet> = BTreeMap::new();
        for item in data.items(tags::ROI_CONTOUR_SEQUENCE) {
            if let Some(number) = item.integer(tags::REFERENCED_ROI_NUMBER)? {
                contours.insert(number, item);
            }
        }
        let (mut rois, mut referenced, mut unfilled) = (Vec::new(), Vec::new(), Vec::new());
        for item in data.items(tags::STRUCTURE_SET_ROI_SEQUENCE) {
            let Some(number) = item.integer(tags::ROI_NUMBER)? else { continue };
            let own = contours.remove(&number);
            let mut roi = Roi {
                segment: Segment {
                    number,
                    name: short(&item.text(tags::ROI_NAME).unwrap_or_default()),
                    color: own.and_then(color),
                    frame: rois.len(),
                    label: None,
                },
                frame_of_reference: item.text(tags::REFERENCED_FRAME_OF_REFERENCE_UID).unwrap_or_default(),
                contours: Vec::new(),
                without_area: 0,
                open: 0,
                miscounted: 0,
            };
            for contour in own.map(|own| own.items(tags::CONTOUR_SEQUENCE)).unwrap_or_default() {
                referenced.extend(
                    contour
                        .item(tags::CONTOUR_IMAGE_SEQUENCE)
                        .and_then(|i| i.text(tags::REFERENCED_SOP_INSTANCE_UID)),
                );
                roi.add(contour)?;
            }
            if roi.contours.is_empty() && roi.without_area == 0 {
                unfilled.push(roi.segment.name);
            } else {
                rois.push(roi);
            }
        }
        if !unfilled.is_empty() {
            let names = crate::check::listed(&unfilled, 5);
            checks.push(Check::note(
                "rtstruct-open",
                format!("{name}: {names}: no closed contours, so no masks"),
            ));
        }
        if !contours.is_empty() {
            let numbers: Vec<String> = contours.keys().map(i64::to_string).collect();
            checks.push(Check::warning(
                "rtstruct-orphans",
                format!(
                    "{name}: contours of regions {} that are not described, left out",
                    crate::check::listed(&numbers, 5)
                ),
            ));
        }
        referenced.sort();
        referenced.dedup();
        let studies = data
            .items(tags::REFERENCED_FRAME_OF_REFERENCE_SEQUENCE)
            .iter()
            .flat_map(|item| item.items(tags::RT_REFERENCED_STUDY_SEQUENCE));
        let series = studies
            .flat_map(|item| item.items(tags::RT_REFERENCED_SERIES_SEQUENCE))
            .filter_map(|item| item.text(tags::SERIES_INSTANCE_UID))
            .collect();
        Ok(Self { rois, checks, referenced, series })
    }

    /// Regions with closed contours.
    pub fn segments(&self) -> Vec<Segment> {
        self.rois.iter().map(|roi| roi.segment.clone()).collect()
    }

    /// The mask of region `options.frame` of the list, on the slices of the image in its frame of reference, else on a
    /// grid of its own.
    ///
    /// # Errors
    /// [`FileError::Wrong`] for images of another patient or frame of reference, and where no grid fits.
    pub fn read(
        &self,
        header: &Header,
        around: &[Header],
        options: &ReadOptions,
    ) -> Result<Loaded, FileError> {
        let wrong = |unusable: Unusable| in_file(&header.path, &unusable);
        let Some(roi) = self.rois.get(options.frame) else {
            let found = format!("{} region(s) with closed contours", self.rois.len());
            return Err(wrong(Unusable::new(found, format!("more than {}", options.frame))));
        };
        planes::refuse_strangers(header, &roi.frame_of_reference, &self.referenced, around)?;
        let mut checks = self.checks.clone();
        let name = if roi.segment.name.is_empty() {
            format!("region {}", roi.segment.number)
        } else {
            roi.segment.name.clone()
        };
        let images = planes::in_frame_of_reference(header, around, &roi.frame_of_reference);
        let planes = match best(&images, roi, &self.series) {
            Some(planes) => planes.clone(),
            None => {
                let own = own_planes(roi).map_err(wrong)?;
                checks.push(Check::warning(
                    "rtstruct-own-grid",
                    format!(
                        "{name}: no image in its frame of reference; filled on a grid of {OWN_SPACING_MM} mm"
                    ),
                ));
                own
            }
        };
        let grid = planes.grid().map_err(wrong)?;
        if grid.voxel_count() as u64 > options.max_bytes {
            let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
            return Err(wrong(Unusable::new(format!("{} bytes of voxels", grid.voxel_count()), expected)));
        }
        let filled = fill(roi, &planes);
        checks.extend(filled.checks(roi, &planes, &name));
        let volume = Volume::new(grid, Samples::U8(filled.voxels), Scaling::NONE);
        let volume = volume.ok_or_else(|| wrong(Unusable::new("other voxels", "those of its slices")))?;
        let frame_of_reference = roi.frame_of_reference.clone();
        let origin = Some(Origin { frame_of_reference, ..header.origin() });
        Ok(Loaded { volume, frames: self.rois.len(), checks, origin })
    }
}

impl Roi {
    fn add(&mut self, contour: &DataSet) -> Result<(), Unusable> {
        let kind = contour.text(tags::CONTOUR_GEOMETRIC_TYPE).unwrap_or_default();
        if !matches!(kind.as_str(), "CLOSED_PLANAR" | "CLOSEDPLANAR_XOR") {
            self.open += 1;
            return Ok(());
        }
        let numbers = contour.decimals(tags::CONTOUR_DATA)?.unwrap_or_default();
        if numbers.len() % 3 != 0 {
            let found = format!("{} numbers in a contour of {}", numbers.len(), self.segment.name);
            return Err(Unusable::new(found, "three a point"));
        }
        let points: Vec<DVec3> = numbers.as_chunks::<3>().0.iter().map(|&p| DVec3::from_array(p)).collect();
        if let Some(far) = points.iter().find(|p| p.abs().max_element() > FARTHEST_MM) {
            return Err(Unusable::new(format!("a contour point at {far} mm"), "points within a kilometre"));
        }
        let stated = contour.integer(tags::NUMBER_OF_CONTOUR_POINTS).ok().flatten();
        self.miscounted += usize::from(stated.is_some_and(|n| n != points.len() as i64));
        if points.len() < 3 {
            self.without_area += 1;
        } else {
            self.contours.push(points);
        }
        Ok(())
    }
}

fn color(own: &DataSet) -> Option<[u8; 3]> {
    let parts = own.decimals_of::<3>(tags::ROI_DISPLAY_COLOR).ok()??;
    let is_byte = parts.iter().all(|v| (0.0..=255.0).contains(v));
    is_byte.then(|| parts.map(|v| v.round() as u8))
}

/// The slices of the image that the file names; else those on which most contours lie, and nearest.
fn best<'a>(images: &'a [Planes], roi: &Roi, named: &[String]) -> Option<&'a Planes> {
    let fit = |planes: &Planes| {
        let off =
            roi.contours.iter().filter_map(|points| flat(points, planes)).map(|z| (z - z.round()).abs());
        let on: Vec<f64> = off.filter(|off| *off <= ON_SLICE).collect();
        let far: f64 = on.iter().sum();
        (named.contains(&planes.series), on.len(), -far)
    };
    let order =
        |a: (bool, usize, f64), b: (bool, usize, f64)| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2));
    // Of equals the first, which has the most slices.
    images.iter().rev().max_by(|a, b| order(fit(a), fit(b)))
}

/// The slice coordinate of a contour's plane; `None` where it isn't parallel to the slices.
fn flat(points: &[DVec3], planes: &Planes) -> Option<f64> {
    let along = points.iter().map(|&p| planes.voxel(p).z);
    let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    (high - low <= FLAT).then_some(0.5 * (low + high))
}

/// Slices for contours without an image: axial, by their own distances.
fn own_planes(roi: &Roi) -> Result<Planes, Unusable> {
    let points = || roi.contours.iter().flatten();
    let (low, high) =
        points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
    let mut heights: Vec<f64> = roi
        .contours
        .iter()
        .filter(|c| c.iter().all(|p| (p.z - c[0].z).abs() <= 0.01))
        .map(|c| c[0].z)
        .collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| (*a - *b).abs() <= 0.01);
    let (Some(&first), Some(&last)) = (heights.first(), heights.last()) else {
        return Err(Unusable::new(
            "no axial contours and no image in their frame of reference",
            "the image beside them",
        ));
    };
    let gap = heights.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let step = if gap.is_finite() { gap } else { 1.0 };
    let count = |extent: f64, spacing: f64| (extent / spacing).ceil() + 3.0;
    let dims = [
        count(high.x - low.x, OWN_SPACING_MM),
        count(high.y - low.y, OWN_SPACING_MM),
        ((last - first) / step).round() + 1.0,
    ];
    if dims.iter().any(|&n| n > MAX_OWN as f64) {
        let found =
            format!("contours {:.0} × {:.0} mm wide without an image", high.x - low.x, high.y - low.y);
        return Err(Unusable::new(found, "the image beside them"));
    }
    let first_place = Place {
        position_mm: DVec3::new(low.x.floor() - 1.0, low.y.floor() - 1.0, first),
        along_row: DVec3::X,
        along_column: DVec3::Y,
        pixel_spacing_mm: [OWN_SPACING_MM; 2],
        stated_step_mm: None,
        was_scaled: false,
    };
    let dims = dims.map(|n| n as usize);
    Ok(Planes { first: first_place, step_mm: DVec3::Z * step, dims, series: String::new() })
}

/// Polygons in pixel coordinates.
type Outlines = Vec<Vec<[f64; 2]>>;

/// A filled region, and what was left out of it.
#[derive(Default)]
struct Filled {
    voxels: Vec<u8>,
    /// Voxels that some contour holds, where contours overlap or lie in each other.
    union_voxels: u64,
    xor_voxels: u64,
    has_nested: bool,
    not_parallel: usize,
    outside_slices: usize,
    between_slices: usize,
    /// Farthest distance of a plane from the slice that it was filled on, in steps.
    farthest: f64,
    /// Slices between filled ones that have no contour.
    gaps: usize,
    is_clipped: bool,
}

fn fill(roi: &Roi, planes: &Planes) -> Filled {
    let [columns, rows, slices] = planes.dims;
    let mut filled = Filled { voxels: vec![0; columns * rows * slices], ..Filled::default() };
    // Contours of one plane by its slice coordinate, in thousandths.
    let mut by_plane: BTreeMap<i64, Outlines> = BTreeMap::new();
    for points in &roi.contours {
        let Some(z) = flat(points, planes) else {
            filled.not_parallel += 1;
            continue;
        };
        if !(-OFF_SLICE..slices as f64 - 1.0 + OFF_SLICE).contains(&z) {
            filled.outside_slices += 1;
            continue;
        }
        let flat_points: Vec<[f64; 2]> =
            points.iter().map(|&p| planes.voxel(p)).map(|v| [v.x, v.y]).collect();
        let is_outside = |p: &[f64; 2]| {
            let (least, most) = (-0.5 - ON_EDGE, ON_EDGE - 0.5);
            p[0] < least || p[1] < least || p[0] > columns as f64 + most || p[1] > rows as f64 + most
        };
        filled.is_clipped |= flat_points.iter().any(is_outside);
        by_plane.entry((z * 1000.0).round() as i64).or_default().push(flat_points);
    }
    // Each slice takes the nearest plane alone: contours of two planes must not cut each other out.
    let mut of_slice: BTreeMap<usize, (f64, &Outlines)> = BTreeMap::new();
    for (&plane, contours) in &by_plane {
        let z = plane as f64 / 1000.0;
        let slice = z.round().clamp(0.0, slices as f64 - 1.0);
        let off = (z - slice).abs();
        if off > OFF_SLICE {
            filled.between_slices += contours.len();
            continue;
        }
        match of_slice.get(&(slice as usize)) {
            Some((nearer, _)) if *nearer <= off => filled.between_slices += contours.len(),
            _ => {
                if let Some((_, replaced)) = of_slice.insert(slice as usize, (off, contours)) {
                    filled.between_slices += replaced.len();
                }
            }
        }
    }
    let pixels = columns * rows;
    for (&slice, &(off, contours)) in &of_slice {
        filled.farthest = filled.farthest.max(off);
        let out = &mut filled.voxels[slice * pixels..(slice + 1) * pixels];
        let mut union = vec![0_u8; pixels];
        for contour in contours {
            even_odd(contour, columns, rows, |at| {
                out[at] ^= 1;
                union[at] = 1;
            });
        }
        let count = |voxels: &[u8]| voxels.iter().filter(|&&v| v != 0).count() as u64;
        let (of_xor, of_union) = (count(out), count(&union));
        filled.xor_voxels += of_xor;
        filled.union_voxels += of_union;
        filled.has_nested |= of_xor != of_union;
    }
    let slices_with: Vec<usize> = of_slice.keys().copied().collect();
    if let (Some(first), Some(last)) = (slices_with.first(), slices_with.last()) {
        filled.gaps = last - first + 1 - slices_with.len();
    }
    filled
}

/// Passes the pixels whose centres lie in a polygon of pixel coordinates, by the even-odd rule. Half-open: of a pixel
/// centre on the outline, the lower and left edge belong to the polygon. Work is bounded by the image.
fn even_odd(polygon: &[[f64; 2]], columns: usize, rows: usize, mut inside: impl FnMut(usize)) {
    let low = polygon.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let high = polygon.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max);
    let first = low.ceil().max(0.0);
    let last = high.floor().min(rows as f64 - 1.0);
    if first > last {
        return;
    }
    let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); (last - first) as usize + 1];
    for (n, a) in polygon.iter().enumerate() {
        let b = &polygon[(n + 1) % polygon.len()];
        let (top, bottom) = (a[1].min(b[1]), a[1].max(b[1]));
        // Rows y with top <= y < bottom.
        let mut y = top.ceil().max(first);
        while y < bottom && y <= last {
            let x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
            crossings[(y - first) as usize].push(x);
            y += 1.0;
        }
    }
    for (n, row) in crossings.iter_mut().enumerate() {
        row.sort_by(f64::total_cmp);
        let y = first as usize + n;
        for pair in row.as_chunks::<2>().0 {
            // Columns x with left <= x < right.
            let from = pair[0].ceil().max(0.0);
            let to = pair[1].ceil().min(columns as f64);
            let mut x = from;
            while x < to {
                inside(y * columns + x as usize);
                x += 1.0;
            }
        }
    }
}

impl Filled {
    fn checks(&self, roi: &Roi, planes: &Planes, name: &str) -> Vec<Check> {
        let mut checks = Vec::new();
        let say = |text: String| format!("{name}: {text}");
        if self.not_parallel > 0 {
            checks.push(Check::warning(
                "rtstruct-not-parallel",
                say(format!("{} contours are not parallel to the slices, left out", self.not_parallel)),
            ));
        }
        if self.outside_slices > 0 {
            checks.push(Check::warning(
                "rtstruct-outside",
                say(format!("{} contours lie beyond the image's slices, left out", self.outside_slices)),
            ));
        }
        if self.is_clipped {
            checks.push(Check::warning(
                "rtstruct-clipped",
                say("contours reach beyond the image and are cut there".to_owned()),
            ));
        }
        if self.between_slices > 0 {
            checks.push(Check::warning(
                "rtstruct-between",
                say(format!(
                    "{} contours lie between slices that have nearer ones or none, left out",
                    self.between_slices
                )),
            ));
        }
        if self.farthest > ON_SLICE {
            let mm = decimal::text(self.farthest * planes.step_mm.length(), 2);
            checks.push(Check::warning(
                "rtstruct-off-slice",
                say(format!("contours lie up to {mm} mm off their slices; the nearest slice is filled")),
            ));
        }
        if self.gaps > 0 {
            checks.push(Check::warning(
                "rtstruct-gaps",
                say(format!("{} slices between contours have none and stay empty", self.gaps)),
            ));
        }
        if roi.miscounted > 0 {
            checks.push(Check::warning(
                "rtstruct-count",
                say(format!("{} contours have another number of points than stated", roi.miscounted)),
            ));
        }
        if roi.open > 0 || roi.without_area > 0 {
            let count = roi.open + roi.without_area;
            checks.push(Check::warning(
                "rtstruct-no-area",
                say(format!("{count} contours have no area (points, open or of two points), left out")),
            ));
        }
        if self.voxels.iter().all(|&v| v == 0) {
            checks.push(Check::warning(
                "rtstruct-empty",
                say("its contours hold no pixel centre; the mask is empty".to_owned()),
            ));
        }
        if self.has_nested {
            let (inner, all) = (self.xor_voxels, self.union_voxels);
            checks.push(Check::warning(
                "rtstruct-nested",
                say(format!("contours lie in each other: {inner} voxels with holes (shown), {all} without")),
            ));
        }
        checks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(polygon: &[[f64; 2]]) -> usize {
        let mut count = 0;
        even_odd(polygon, 20, 20, |_| count += 1);
        count
    }

    #[test]
    fn pixel_centres_count_once_whatever_polygons_share_them() {
        let square = |x: f64, y: f64| [[x, y], [x + 5.0, y], [x + 5.0, y + 5.0], [x, y + 5.0]];
        assert_eq!(area(&square(2.0, 3.0)), 25);
        // Four squares that touch at pixel centres cover what one of them twice as wide covers.
        let mut seen = vec![0; 400];
        for (x, y) in [(2.0, 2.0), (7.0, 2.0), (2.0, 7.0), (7.0, 7.0)] {
            even_odd(&square(x, y), 20, 20, |at| seen[at] += 1);
        }
        assert_eq!(seen.iter().sum::<i32>(), 100);
        assert!(seen.iter().all(|&n| n <= 1));
    }

    #[test]
    fn work_is_bounded_by_the_image() {
        assert_eq!(area(&[[-1e6, -1e6], [1e6, -1e6], [1e6, 1e6], [-1e6, 1e6]]), 400);
        assert_eq!(area(&[[30.0, 30.0], [40.0, 30.0], [40.0, 40.0]]), 0);
    }
}
