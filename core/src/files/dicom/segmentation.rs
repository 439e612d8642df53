//! DICOM segmentations (SEG, PS3.3 A.51): binary, fractional and label maps, each frame placed by its own functional groups.

use std::collections::BTreeMap;

use glam::DVec3;

use super::super::{FileError, Loaded, ReadOptions, Segment};
use super::data_set::{DataSet, Unusable};
use super::instance::{Measures, PixelFormat, Place, measures_of, place};
use super::parse::Parsed;
use super::pixels::{Compression, Layout, inflate, plain_bits, stored};
use super::planes::{self, Planes};
use super::scan::{Header, in_file};
use super::tags;
use crate::{Check, Samples, Scaling, Volume};

/// How far a frame may lie off a slice, as a share of the distance of slices.
const OFF_SLICE: f64 = 0.01;

/// How far a frame may lie off within its plane, in pixels.
const OFF_PIXELS: f64 = 0.01;

/// Most slices that a segmentation may span.
const MAX_SLICES: usize = 16_384;

/// Longest name that is kept.
pub(super) const MAX_NAME: usize = 200;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    Binary,
    /// Stored values up to this one; probabilities or occupancies.
    Fractional(f64),
    LabelMap,
}

/// A segmentation's header and the place of its frames.
pub(super) struct Segmentation {
    kind: Type,
    format: PixelFormat,
    segments: Vec<Segment>,
    /// Segment number (0 in a label map) and slice of each frame.
    frames: Vec<(u16, usize)>,
    planes: Planes,
    checks: Vec<Check>,
    /// The label of label maps where nothing was stored.
    background: u16,
}

/// The segments of a segmentation.
///
/// # Errors
/// [`Unusable`] for an unknown type or a segment without a number.
pub(super) fn segments(data: &DataSet) -> Result<Vec<Segment>, Unusable> {
    let kind = kind(data)?;
    let background = (kind == Type::LabelMap).then(|| data.u16(tags::PIXEL_PADDING_VALUE)).flatten();
    let mut segments: Vec<Segment> = Vec::new();
    for (at, item) in data.items(tags::SEGMENT_SEQUENCE).iter().enumerate() {
        let number = item
            .u16(tags::SEGMENT_NUMBER)
            .ok_or_else(|| Unusable::new("a segment without a number", "Segment Number (0062,0004)"))?;
        if Some(number) == background {
            continue;
        }
        if segments.iter().any(|s| s.number == i64::from(number)) {
            return Err(Unusable::new(format!("segment {number} twice"), "each number once"));
        }
        let is_map = kind == Type::LabelMap;
        segments.push(Segment {
            number: i64::from(number),
            name: short(&item.text(tags::SEGMENT_LABEL).unwrap_or_default()),
            color: color(&item.u16s(tags::RECOMMENDED_DISPLAY_CIELAB_VALUE)),
            // Of a label map, frame 0 has 0 as its background, frame 1 the labels as they are stored.
            frame: if is_map { 1 } else { at },
            label: is_map.then_some(i64::from(number)),
        });
    }
    Ok(segments)
}

/// A name of bearable length.
pub(super) fn short(name: &str) -> String {
    if name.chars().count() <= MAX_NAME {
        return name.to_owned();
    }
    name.chars().take(MAX_NAME - 1).chain(['…']).collect()
}

fn kind(data: &DataSet) -> Result<Type, Unusable> {
    match data.text(tags::SEGMENTATION_TYPE).as_deref() {
        Some("BINARY") => Ok(Type::Binary),
        Some("FRACTIONAL") => {
            Ok(Type::Fractional(f64::from(data.u16(tags::MAXIMUM_FRACTIONAL_VALUE).unwrap_or(255).max(1))))
        }
        Some("LABELMAP") => Ok(Type::LabelMap),
        other => {
            let found = format!("Segmentation Type {:?}", other.unwrap_or_default());
            Err(Unusable::new(found, "BINARY, FRACTIONAL or LABELMAP"))
        }
    }
}

impl Segmentation {
    /// # Errors
    /// [`FileError::Wrong`] for frames without a place or a segment, and for images of another patient or place.
    pub fn of(header: &Header, parsed: &Parsed<'_>, around: &[Header]) -> Result<Self, FileError> {
        let data = &parsed.data;
        let wrong = |unusable: Unusable| in_file(&header.path, &unusable);
        let kind = kind(data).map_err(wrong)?;
        let segments = segments(data).map_err(wrong)?;
        let format = PixelFormat::of(data).map_err(wrong)?;
        if (kind == Type::Binary) != (format.bits_allocated == 1) || format.bits_allocated > 16 {
            let found = format!("{} bits a pixel in a segmentation of type {kind:?}", format.bits_allocated);
            return Err(wrong(Unusable::new(found, "1 in BINARY, 8 or 16 in the others")));
        }
        let per_frame = data.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
        if per_frame.len() != format.frames {
            let found = format!("{} items of functional groups", per_frame.len());
            return Err(wrong(Unusable::new(found, format!("{}, one per frame", format.frames))));
        }
        let mut referenced: Vec<String> = per_frame.iter().filter_map(source_image).collect();
        referenced.sort();
        referenced.dedup();
        let uid = &header.identity.frame_of_reference;
        planes::refuse_strangers(header, uid, &referenced, around)?;
        let mut checks = Vec::new();
        let places = places(data, per_frame, around, &header.name(), &mut checks).map_err(wrong)?;
        let numbers = segment_numbers(data, per_frame, kind, &segments).map_err(wrong)?;
        let images = planes::in_frame_of_reference(header, around, uid);
        let planes = planes_of(&places, &format, &images).map_err(wrong)?;
        let frames: Vec<(u16, usize)> = numbers
            .iter()
            .zip(&places)
            .map(|(&number, place)| (number, planes.voxel(place.position_mm).z.round().max(0.0) as usize))
            .collect();
        let mut seen = std::collections::HashSet::new();
        if let Some((number, slice)) = frames.iter().find(|frame| !seen.insert(**frame)) {
            let found = format!("two frames of segment {number} at slice {}", slice + 1);
            return Err(wrong(Unusable::new(found, "one frame a slice")));
        }
        if let Type::Fractional(most) = kind {
            let what = match data.text(tags::SEGMENTATION_FRACTIONAL_TYPE).as_deref() {
                Some("PROBABILITY") => "probabilities of belonging to it",
                Some("OCCUPANCY") => "shares of each voxel",
                _ => "fractions of unstated meaning",
            };
            let name = super::series::base_name(&header.path);
            checks.push(Check::note(
                "seg-fractional",
                format!("{name}: segments hold {what}, stored as 0 to {most}"),
            ));
        }
        let background = data.u16(tags::PIXEL_PADDING_VALUE).unwrap_or(0);
        Ok(Self { kind, format, segments, frames, planes, checks, background })
    }

    /// Reads segment number `options.frame` (from 0) of the list, or the whole label map.
    ///
    /// # Errors
    /// [`FileError::Wrong`] for pixels that are cut, padded or can't be decompressed.
    pub fn read(
        &self,
        header: &Header,
        parsed: &Parsed<'_>,
        options: &ReadOptions,
    ) -> Result<Loaded, FileError> {
        let wrong = |unusable: Unusable| in_file(&header.path, &unusable);
        let is_map = self.kind == Type::LabelMap;
        let count = if is_map { 1 } else { self.segments.len() };
        let segment = self.segments.get(options.frame).filter(|_| !is_map);
        if options.frame > usize::from(is_map) && is_map || (segment.is_none() && !is_map) {
            let found = format!("{count} segment(s)");
            return Err(wrong(Unusable::new(found, format!("more than {}", options.frame))));
        }
        let grid = self.planes.grid().map_err(wrong)?;
        let bytes_each = if self.format.bits_allocated == 16 { 2 } else { 1 };
        let bytes = grid.voxel_count() as u64 * bytes_each;
        if bytes > options.max_bytes {
            let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
            return Err(wrong(Unusable::new(format!("{bytes} bytes of voxels"), expected)));
        }
        let wanted: Vec<(usize, usize)> = self
            .frames
            .iter()
            .enumerate()
            .filter(|(_, (number, _))| is_map || segment.is_some_and(|s| s.number == i64::from(*number)))
            .map(|(frame, (_, slice))| (frame, *slice))
            .collect();
        let pixels = self.format.pixels();
        let samples = if bytes_each == 2 {
            let mut voxels = vec![self.background; grid.voxel_count()];
            self.fill(parsed, &wanted, |slice, at, value| voxels[slice * pixels + at] = value as u16)
                .map_err(wrong)?;
            Samples::U16(voxels)
        } else {
            let empty = if is_map { self.background as u8 } else { 0 };
            let mut voxels = vec![empty; grid.voxel_count()];
            self.fill(parsed, &wanted, |slice, at, value| voxels[slice * pixels + at] = value as u8)
                .map_err(wrong)?;
            Samples::U8(voxels)
        };
        let samples = if is_map && options.frame == 0 { self.with_background_0(samples) } else { samples };
        let scaling = match self.kind {
            Type::Fractional(most) => Scaling { slope: 1.0 / most, intercept: 0.0 },
            _ => Scaling::NONE,
        };
        let volume = Volume::new(grid, samples, scaling);
        let volume = volume.ok_or_else(|| wrong(Unusable::new("other voxels", "those of its frames")))?;
        Ok(Loaded { volume, frames: count, checks: self.checks.clone(), origin: Some(header.origin()) })
    }

    /// A label map in which the background is 0, as in other formats.
    fn with_background_0(&self, samples: Samples) -> Samples {
        match samples {
            Samples::U8(mut labels) => {
                labels.iter_mut().filter(|l| u16::from(**l) == self.background).for_each(|l| *l = 0);
                Samples::U8(labels)
            }
            Samples::U16(mut labels) => {
                labels.iter_mut().filter(|l| **l == self.background).for_each(|l| *l = 0);
                Samples::U16(labels)
            }
            other => other,
        }
    }

    /// Passes each pixel of the wanted frames with its slice.
    fn fill(
        &self,
        parsed: &Parsed<'_>,
        wanted: &[(usize, usize)],
        mut set: impl FnMut(usize, usize, f64),
    ) -> Result<(), Unusable> {
        let format = &self.format;
        if self.kind != Type::Binary {
            let layout = Layout::of(parsed, format)?;
            for &(frame, slice) in wanted {
                stored(parsed, &layout, format, frame)?.for_each(|at, value| set(slice, at, value));
            }
            return Ok(());
        }
        let pixels = format.pixels();
        let mut set_bits = |bytes: &[u8], first: usize, slice: usize| {
            for at in 0..pixels {
                let bit = first + at;
                set(slice, at, f64::from(bytes[bit / 8] >> (bit % 8) & 1));
            }
        };
        if let Some(bits) = plain_bits(parsed) {
            // One string of bits: frames begin within bytes.
            let needed = format.bytes();
            if (bits.len() as u64) < needed || bits.len() as u64 > needed + 1 {
                let found = format!("{} bytes of pixels", bits.len());
                let expected = format!("{needed}: one bit a pixel, frames without padding");
                return Err(Unusable::new(found, expected));
            }
            for &(frame, slice) in wanted {
                set_bits(bits, frame * pixels, slice);
            }
            return Ok(());
        }
        let Layout::Encapsulated(all, frames, Compression::Deflate) = Layout::of(parsed, format)? else {
            return Err(Unusable::new("compressed bits", "uncompressed or deflated frames of 1 bit"));
        };
        for &(frame, slice) in wanted {
            let parts = &all.fragments[frames[frame].clone()];
            let compressed: Vec<u8> = parts
                .iter()
                .flat_map(|part| parsed.bytes.get(part.clone()).unwrap_or_default())
                .copied()
                .collect();
            set_bits(&inflate(&compressed, pixels.div_ceil(8))?, 0, slice);
        }
        Ok(())
    }
}

fn source_image(frame: &DataSet) -> Option<String> {
    frame
        .item(tags::DERIVATION_IMAGE_SEQUENCE)?
        .item(tags::SOURCE_IMAGE_SEQUENCE)?
        .text(tags::REFERENCED_SOP_INSTANCE_UID)
}

/// The place of each frame; where it isn't stated, that of the image it was made from.
fn places(
    data: &DataSet,
    per_frame: &[DataSet],
    around: &[Header],
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<Vec<Place>, Unusable> {
    let shared = data.item(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE);
    let by_instance: BTreeMap<&str, &Header> =
        around.iter().map(|header| (header.identity.sop_instance.as_str(), header)).collect();
    let mut from_images = 0;
    let mut all = Vec::with_capacity(per_frame.len());
    for (n, own) in per_frame.iter().enumerate() {
        let group = |tag| own.item(tag).or_else(|| shared.and_then(|shared| shared.item(tag)));
        let (orientation, measures) =
            (group(tags::PLANE_ORIENTATION_SEQUENCE), group(tags::PIXEL_MEASURES_SEQUENCE));
        let position = group(tags::PLANE_POSITION_SEQUENCE);
        if position.is_some_and(|p| p.has(tags::IMAGE_POSITION_PATIENT)) {
            all.push(place(position, orientation, measures)?);
            continue;
        }
        let image = source_image(own).and_then(|uid| by_instance.get(uid.as_str()).copied());
        let Some(Ok((_, frames))) = image.map(|image| &image.image) else {
            let found = format!("frame {} without a position", n + 1);
            return Err(Unusable::new(found, "a position, or its source image beside it"));
        };
        let Some(frame) = frames.first() else { continue };
        let Measures { along_row, along_column, pixel_spacing_mm, stated_step_mm, was_scaled } =
            measures_of(orientation, measures).unwrap_or(Measures {
                along_row: frame.place.along_row,
                along_column: frame.place.along_column,
                pixel_spacing_mm: frame.place.pixel_spacing_mm,
                stated_step_mm: frame.place.stated_step_mm,
                was_scaled: false,
            });
        let position_mm = frame.place.position_mm;
        all.push(Place {
            position_mm,
            along_row,
            along_column,
            pixel_spacing_mm,
            stated_step_mm,
            was_scaled,
        });
        from_images += 1;
    }
    if from_images > 0 {
        checks.push(Check::warning(
            "seg-place",
            format!("{name}: {from_images} frames without a position lie where their source images are"),
        ));
    }
    Ok(all)
}

fn segment_numbers(
    data: &DataSet,
    per_frame: &[DataSet],
    kind: Type,
    segments: &[Segment],
) -> Result<Vec<u16>, Unusable> {
    if kind == Type::LabelMap {
        return Ok(vec![0; per_frame.len()]);
    }
    let shared = data.item(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE);
    per_frame
        .iter()
        .enumerate()
        .map(|(n, own)| {
            let identification = own
                .item(tags::SEGMENT_IDENTIFICATION_SEQUENCE)
                .or_else(|| shared.and_then(|s| s.item(tags::SEGMENT_IDENTIFICATION_SEQUENCE)));
            let number = identification.and_then(|item| item.u16(tags::REFERENCED_SEGMENT_NUMBER));
            let number =
                number.ok_or_else(|| Unusable::new(format!("frame {} of no segment", n + 1), "a segment"))?;
            if !segments.iter().any(|s| s.number == i64::from(number)) {
                let found = format!("frame {} of segment {number}", n + 1);
                return Err(Unusable::new(found, format!("one of the {} described", segments.len())));
            }
            Ok(number)
        })
        .collect()
}

/// The slices on which frames lie: those of an image where they coincide, else their own.
fn planes_of(places: &[Place], format: &PixelFormat, images: &[Planes]) -> Result<Planes, Unusable> {
    let Some(first) = places.first() else {
        return Err(Unusable::new("no frames", "at least 1"));
    };
    let is_same = |a: DVec3, b: DVec3| a.abs_diff_eq(b, 1e-4);
    let odd = places.iter().find(|p| {
        !is_same(p.along_row, first.along_row)
            || !is_same(p.along_column, first.along_column)
            || p.pixel_spacing_mm != first.pixel_spacing_mm
    });
    if odd.is_some() {
        return Err(Unusable::new("frames of several orientations or spacings", "one"));
    }
    let lies_on = |planes: &&Planes| {
        let spacing = |n: usize| {
            let (a, b) = (planes.first.pixel_spacing_mm[n], first.pixel_spacing_mm[n]);
            (a - b).abs() <= 1e-4 * a
        };
        planes.dims[..2] == [format.columns, format.rows]
            && spacing(0)
            && spacing(1)
            && is_same(planes.first.along_row, first.along_row)
            && is_same(planes.first.along_column, first.along_column)
            && places.iter().all(|place| {
                let v = planes.voxel(place.position_mm);
                v.x.abs() <= OFF_PIXELS
                    && v.y.abs() <= OFF_PIXELS
                    && (v.z - v.z.round()).abs() <= OFF_SLICE
                    && (-0.5..planes.dims[2] as f64 - 0.5).contains(&v.z)
            })
    };
    if let Some(planes) = images.iter().find(lies_on) {
        return Ok(planes.clone());
    }
    own_planes(places, format)
}

fn own_planes(places: &[Place], format: &PixelFormat) -> Result<Planes, Unusable> {
    let normal = places[0].normal();
    let along = |p: &Place| p.position_mm.dot(normal);
    let mut sorted: Vec<&Place> = places.iter().collect();
    sorted.sort_by(|a, b| along(a).total_cmp(&along(b)));
    let first = *sorted[0];
    let last = sorted[sorted.len() - 1];
    let gaps = sorted.windows(2).map(|pair| along(pair[1]) - along(pair[0])).filter(|gap| *gap > 1e-3);
    let smallest = gaps.fold(f64::INFINITY, f64::min);
    let extent = along(last) - along(&first);
    let fits = |step: f64| {
        sorted.iter().all(|p| {
            let at = (along(p) - along(&first)) / step;
            (at - at.round()).abs() <= OFF_SLICE
        })
    };
    // The stated distance counts where frames are sparse; a wrong one shows by frames that lie off it.
    let stated = first.stated_step_mm.filter(|step| fits(*step));
    let step = match (stated, smallest.is_finite()) {
        (Some(step), _) => step,
        (None, true) if fits(smallest) => smallest,
        (None, true) => {
            return Err(Unusable::new(
                "frames at distances that are no multiples of one step",
                "equally spaced slices",
            ));
        }
        (None, false) => first.stated_step_mm.unwrap_or(1.0),
    };
    let steps = (extent / step).round();
    if steps >= MAX_SLICES as f64 {
        let found = format!("frames {extent:.0} mm apart in steps of {step} mm");
        return Err(Unusable::new(found, format!("at most {MAX_SLICES} slices")));
    }
    // Along the line through first and last frame, which may be sheared.
    let step_mm = if steps > 0.0 { (last.position_mm - first.position_mm) / steps } else { normal * step };
    let planes = Planes {
        first,
        step_mm,
        dims: [format.columns, format.rows, steps as usize + 1],
        series: String::new(),
    };
    let off = |place: &&Place| {
        let v = planes.voxel(place.position_mm);
        v.x.abs() > OFF_PIXELS || v.y.abs() > OFF_PIXELS || (v.z - v.z.round()).abs() > OFF_SLICE
    };
    match sorted.into_iter().find(off) {
        Some(place) => {
            let found = format!("a frame at {} mm, off the line of the others", place.position_mm);
            Err(Unusable::new(found, "frames in a line"))
        }
        None => Ok(planes),
    }
}

/// sRGB of a colour in the PCS encoding of CIELab under D50 (PS3.3 C.10.7.1.1).
fn color(encoded: &[u16]) -> Option<[u8; 3]> {
    let &[l, a, b] = encoded else { return None };
    let (l, a, b) = (
        f64::from(l) * 100.0 / 65535.0,
        f64::from(a) * 255.0 / 65535.0 - 128.0,
        f64::from(b) * 255.0 / 65535.0 - 128.0,
    );
    let fy = (l + 16.0) / 116.0;
    let inverse =
        |t: f64| if t > 6.0 / 29.0 { t * t * t } else { 3.0 * (6.0_f64 / 29.0).powi(2) * (t - 4.0 / 29.0) };
    let [x, y, z] = [0.9642 * inverse(fy + a / 500.0), inverse(fy), 0.8249 * inverse(fy - b / 200.0)];
    // Bradford-adapted matrix from XYZ under D50 to linear sRGB (IEC 61966-2-1).
    let linear = [
        3.133_856 * x - 1.616_867 * y - 0.490_615 * z,
        -0.978_768 * x + 1.916_142 * y + 0.033_454 * z,
        0.071_945 * x - 0.228_991 * y + 1.405_243 * z,
    ];
    Some(linear.map(|v| {
        let v = v.clamp(0.0, 1.0);
        let encoded = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (encoded * 255.0).round() as u8
    }))
}

/// The inverse of [`color`].
pub(super) fn encoded_color(srgb: [u8; 3]) -> [u16; 3] {
    let [red, green, blue] = srgb.map(|part| {
        let v = f64::from(part) / 255.0;
        if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    });
    // Bradford-adapted matrix from linear sRGB to XYZ under D50.
    let [x, y, z] = [
        0.436_074_7 * red + 0.385_064_9 * green + 0.143_080_4 * blue,
        0.222_504_5 * red + 0.716_878_6 * green + 0.060_616_9 * blue,
        0.013_932_2 * red + 0.097_104_5 * green + 0.714_173_3 * blue,
    ];
    let root = |t: f64| {
        let knee = 6.0_f64 / 29.0;
        if t > knee.powi(3) { t.cbrt() } else { t / (3.0 * knee * knee) + 4.0 / 29.0 }
    };
    let (fx, fy, fz) = (root(x / 0.9642), root(y), root(z / 0.8249));
    let (l, a, b) = (116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz));
    [l / 100.0, (a + 128.0) / 255.0, (b + 128.0) / 255.0]
        .map(|v| (v * 65535.0).round().clamp(0.0, 65535.0) as u16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_colour_comes_back_from_cielab() {
        for n in 0..256_u32 {
            for step in [1, 7, 85] {
                let rgb = [n as u8, (n * step % 256) as u8, (n * 31 / step % 256) as u8];
                let back = color(&encoded_color(rgb)).unwrap();
                assert!(back.iter().zip(rgb).all(|(a, b)| a.abs_diff(b) <= 1), "{rgb:?} {back:?}");
            }
        }
        // Pure sRGB red (Lindbloom), as below.
        let [l, a, b] = encoded_color([255, 0, 0]).map(f64::from);
        assert!((l * 100.0 / 65535.0 - 54.29).abs() < 0.01, "{l}");
        assert!((a * 255.0 / 65535.0 - 128.0 - 80.81).abs() < 0.02, "{a}");
        assert!((b * 255.0 / 65535.0 - 128.0 - 69.89).abs() < 0.02, "{b}");
    }

    #[test]
    fn cielab_colours_become_srgb() {
        // White, black and mid grey of CIELab; pure sRGB red is L 54.29, a 80.81, b 69.89 under D50 (Lindbloom).
        let encode = |l: f64, a: f64, b: f64| {
            [l / 100.0 * 65535.0, (a + 128.0) / 255.0 * 65535.0, (b + 128.0) / 255.0 * 65535.0]
                .map(|v| v.round() as u16)
        };
        assert_eq!(color(&encode(100.0, 0.0, 0.0)), Some([255, 255, 255]));
        assert_eq!(color(&encode(0.0, 0.0, 0.0)), Some([0, 0, 0]));
        assert_eq!(color(&encode(53.585, 0.0, 0.0)), Some([128, 128, 128]));
        let red = color(&encode(54.29, 80.81, 69.89)).unwrap();
        assert!(red[0] >= 254 && red[1] <= 2 && red[2] <= 2, "{red:?}");
        assert_eq!(color(&[1, 2]), None);
    }
}
