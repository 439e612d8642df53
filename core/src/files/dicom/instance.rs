//! What a file says of itself: whose it is, what it belongs to, how its pixels are stored, and where each frame lies.

use glam::DVec3;

use super::data_set::{DataSet, Unusable};
use super::tags::{self, Tag};

/// Largest number of frames of a file.
const MAX_FRAMES: usize = 1 << 20;

/// Identity of a patient as a file states it; empty where it doesn't.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Patient {
    /// Patient ID with its issuer.
    pub id: String,
    /// Name as stored: components separated by `^`, representations by `=`.
    pub name: String,
    /// `YYYYMMDD`.
    pub birth_date: String,
    /// `M`, `F` or `O`.
    pub sex: String,
}

impl Patient {
    /// What tells patients apart: identifier, name whatever its case and spaces, date of birth.
    pub(super) fn key(&self) -> (String, String, String) {
        let words = self.name.split(['^', ' ']).filter(|part| !part.is_empty());
        let name = words.map(str::to_lowercase).collect::<Vec<_>>().join(" ");
        (self.id.clone(), name, self.birth_date.clone())
    }
}

/// What a file belongs to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Identity {
    pub patient: Patient,
    pub study: String,
    pub study_description: String,
    pub accession_number: String,
    pub study_date: String,
    pub series: String,
    pub series_number: String,
    pub series_description: String,
    pub modality: String,
    /// `YYYYMMDD` of the acquisition, else of the series, else of the study; empty where unknown.
    pub date: String,
    pub frame_of_reference: String,
    pub sop_class: String,
    pub sop_instance: String,
}

impl Identity {
    pub fn of(data: &DataSet) -> Self {
        let text = |tag: Tag| data.text(tag).unwrap_or_default();
        let id = [text(tags::PATIENT_ID), text(tags::ISSUER_OF_PATIENT_ID)];
        let dates = [
            text(tags::ACQUISITION_DATE),
            text(tags::ACQUISITION_DATE_TIME).chars().take(8).collect(),
            text(tags::SERIES_DATE),
            text(tags::STUDY_DATE),
        ];
        Self {
            patient: Patient {
                id: id.iter().filter(|part| !part.is_empty()).cloned().collect::<Vec<_>>().join("@"),
                // Empty component groups at the end say nothing.
                name: text(tags::PATIENT_NAME).trim_end_matches(['=', '^']).to_owned(),
                birth_date: text(tags::PATIENT_BIRTH_DATE),
                sex: text(tags::PATIENT_SEX),
            },
            study: text(tags::STUDY_INSTANCE_UID),
            study_description: text(tags::STUDY_DESCRIPTION),
            accession_number: text(tags::ACCESSION_NUMBER),
            study_date: text(tags::STUDY_DATE),
            series: text(tags::SERIES_INSTANCE_UID),
            series_number: text(tags::SERIES_NUMBER),
            series_description: text(tags::SERIES_DESCRIPTION),
            modality: text(tags::MODALITY),
            date: dates.into_iter().find(|date| !date.is_empty()).unwrap_or_default(),
            frame_of_reference: text(tags::FRAME_OF_REFERENCE_UID),
            sop_class: text(tags::SOP_CLASS_UID),
            sop_instance: text(tags::SOP_INSTANCE_UID),
        }
    }
}

/// How pixels are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PixelFormat {
    pub rows: usize,
    pub columns: usize,
    /// 1, 8, 16, 32 or (doubles) 64.
    pub bits_allocated: u16,
    pub bits_stored: u16,
    /// Bits below the value in its allocated bits.
    pub low_bit: u16,
    pub is_signed: bool,
    pub is_float: bool,
    pub frames: usize,
}

impl PixelFormat {
    /// # Errors
    /// [`Unusable`] for absent, contradictory or unsupported attributes.
    pub fn of(data: &DataSet) -> Result<Self, Unusable> {
        let number = |tag: Tag, name: &str| {
            data.u16(tag).ok_or_else(|| Unusable::new(format!("no {name}"), format!("{name} {tag}")))
        };
        let (rows, columns) = (number(tags::ROWS, "Rows")?, number(tags::COLUMNS, "Columns")?);
        if rows == 0 || columns == 0 {
            return Err(Unusable::new(format!("{rows} rows and {columns} columns"), "at least 1 of each"));
        }
        let samples = data.u16(tags::SAMPLES_PER_PIXEL).unwrap_or(1);
        let photometric = data.text(tags::PHOTOMETRIC_INTERPRETATION).unwrap_or_default();
        if samples != 1
            || !(photometric.is_empty()
                || photometric.starts_with("MONOCHROME")
                || photometric == "PALETTE COLOR")
        {
            let found = format!("{samples} samples a pixel ({photometric})");
            return Err(Unusable::new(found, "one sample a pixel, MONOCHROME1 or 2"));
        }
        let bits_allocated = number(tags::BITS_ALLOCATED, "Bits Allocated")?;
        let is_float = data.has(tags::FLOAT_PIXEL_DATA) || data.has(tags::DOUBLE_FLOAT_PIXEL_DATA);
        let (bits_stored, high_bit, is_signed) = if is_float {
            (bits_allocated, bits_allocated.saturating_sub(1), true)
        } else {
            let stored = number(tags::BITS_STORED, "Bits Stored")?;
            let high = data.u16(tags::HIGH_BIT).unwrap_or(stored.saturating_sub(1));
            let sign = number(tags::PIXEL_REPRESENTATION, "Pixel Representation")?;
            if sign > 1 {
                return Err(Unusable::new(
                    format!("Pixel Representation {sign}"),
                    "0 (unsigned) or 1 (signed)",
                ));
            }
            (stored, high, sign == 1)
        };
        let allowed: &[u16] = if is_float { &[32, 64] } else { &[1, 8, 16, 32] };
        if !allowed.contains(&bits_allocated) {
            let found = format!("{bits_allocated} bits allocated a pixel");
            return Err(Unusable::new(found, if is_float { "32 or 64" } else { "1, 8, 16 or 32" }));
        }
        if bits_stored == 0
            || bits_stored > bits_allocated
            || high_bit >= bits_allocated
            || high_bit + 1 < bits_stored
        {
            let found = format!("{bits_stored} bits stored up to bit {high_bit} of {bits_allocated}");
            return Err(Unusable::new(found, "bits within those allocated"));
        }
        let frames = data.integer(tags::NUMBER_OF_FRAMES)?.unwrap_or(1);
        let count = usize::try_from(frames).ok().filter(|n| (1..=MAX_FRAMES).contains(n));
        let Some(frames) = count else {
            return Err(Unusable::new(format!("{frames} frames"), format!("1 to {MAX_FRAMES}")));
        };
        let low_bit = high_bit + 1 - bits_stored;
        let (rows, columns) = (usize::from(rows), usize::from(columns));
        Ok(Self { rows, columns, bits_allocated, bits_stored, low_bit, is_signed, is_float, frames })
    }

    /// Pixels of a frame.
    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// Bytes of all frames without compression. At most 2^20 frames of 2^32 pixels of 8 bytes.
    pub fn bytes(&self) -> u64 {
        let bits = self.pixels() as u64 * u64::from(self.bits_allocated);
        (u128::from(bits) * self.frames as u128).div_ceil(8).try_into().unwrap_or(u64::MAX)
    }
}

/// Where a frame lies: LPS millimetres, as stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Centre of the first pixel.
    pub position_mm: DVec3,
    /// Direction in which columns follow each other, along a row; of length 1.
    pub along_row: DVec3,
    /// Direction in which rows follow each other, along a column; of length 1.
    pub along_column: DVec3,
    /// Distance of neighbouring rows, and of neighbouring columns.
    pub pixel_spacing_mm: [f64; 2],
    /// Distance of slices by the tags, which count where there is one slice only.
    pub stated_step_mm: Option<f64>,
    /// Whether the direction cosines as stored were not of length 1.
    pub was_scaled: bool,
}

impl Place {
    /// Unit normal of the slice: along row × along column.
    pub fn normal(&self) -> DVec3 {
        self.along_row.cross(self.along_column)
    }
}

/// Spacings that a scanner may have, in millimetres.
const SPACINGS_MM: std::ops::RangeInclusive<f64> = 1e-4..=1e3;

/// Farthest position in millimetres.
const FARTHEST_MM: f64 = 1e6;

/// A place from the data sets that state position, orientation and measures, each its own in enhanced images.
///
/// # Errors
/// [`Unusable`] for what is absent or impossible.
pub(super) fn place(
    position: Option<&DataSet>,
    orientation: Option<&DataSet>,
    measures: Option<&DataSet>,
) -> Result<Place, Unusable> {
    let position: [f64; 3] = position
        .map(|data| data.decimals_of(tags::IMAGE_POSITION_PATIENT))
        .transpose()?
        .flatten()
        .ok_or_else(|| {
            Unusable::new("no Image Position (Patient)", "the position of each slice (0020,0032)")
        })?;
    let Measures { along_row, along_column, pixel_spacing_mm, stated_step_mm, was_scaled } =
        measures_of(orientation, measures)?;
    let position_mm = DVec3::from_array(position);
    if position_mm.abs().max_element() > FARTHEST_MM {
        return Err(Unusable::new(format!("a slice at {position_mm} mm"), "a position within a kilometre"));
    }
    Ok(Place { position_mm, along_row, along_column, pixel_spacing_mm, stated_step_mm, was_scaled })
}

/// A slice's directions and spacings.
pub(super) struct Measures {
    pub along_row: DVec3,
    pub along_column: DVec3,
    pub pixel_spacing_mm: [f64; 2],
    pub stated_step_mm: Option<f64>,
    pub was_scaled: bool,
}

/// As [`place`], without a position.
pub(super) fn measures_of(
    orientation: Option<&DataSet>,
    measures: Option<&DataSet>,
) -> Result<Measures, Unusable> {
    let cosines: [f64; 6] = orientation
        .map(|data| data.decimals_of(tags::IMAGE_ORIENTATION_PATIENT))
        .transpose()?
        .flatten()
        .ok_or_else(|| {
            Unusable::new("no Image Orientation (Patient)", "the directions of rows and columns (0020,0037)")
        })?;
    let spacing: [f64; 2] =
        measures.map(|data| data.decimals_of(tags::PIXEL_SPACING)).transpose()?.flatten().ok_or_else(
            || Unusable::new("no Pixel Spacing", "the distances of rows and columns (0028,0030)"),
        )?;
    if !spacing.iter().all(|mm| SPACINGS_MM.contains(mm)) {
        let found = format!("Pixel Spacing {} and {} mm", spacing[0], spacing[1]);
        return Err(Unusable::new(found, "between 0.0001 and 1000 mm"));
    }
    let row = DVec3::new(cosines[0], cosines[1], cosines[2]);
    let column = DVec3::new(cosines[3], cosines[4], cosines[5]);
    let (row_length, column_length) = (row.length(), column.length());
    let is_usable = |length: f64| (1e-3..1e3).contains(&length);
    let angle = row.dot(column) / (row_length * column_length);
    let is_orthogonal = is_usable(row_length) && is_usable(column_length) && angle.abs() <= 1e-4;
    if !is_orthogonal {
        let found = format!("directions of rows and columns {row} and {column}");
        return Err(Unusable::new(found, "two that are orthogonal"));
    }
    let mut stated_step_mm = None;
    for tag in [tags::SPACING_BETWEEN_SLICES, tags::SLICE_THICKNESS] {
        // Stated wrong so often that a nonsensical one is as good as none.
        let step = measures.and_then(|data| data.decimal(tag).ok().flatten()).map(f64::abs);
        stated_step_mm = stated_step_mm.or(step.filter(|mm| SPACINGS_MM.contains(mm)));
    }
    let was_scaled = (row_length - 1.0).abs() > 1e-3 || (column_length - 1.0).abs() > 1e-3;
    Ok(Measures {
        along_row: row / row_length,
        along_column: column / column_length,
        pixel_spacing_mm: spacing,
        stated_step_mm,
        was_scaled,
    })
}

/// A frame: a slice of an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame {
    /// Its number in the file, from 0.
    pub number: usize,
    pub place: Place,
    pub slope: f64,
    pub intercept: f64,
    /// The stack that it belongs to, where the file names stacks; else empty.
    pub stack: String,
    /// What tells frames at one position apart: names and values, in the order in which they are tried.
    pub keys: Vec<(&'static str, String)>,
    /// Whether the rescale slope was 0, and 1 is used.
    pub had_slope_0: bool,
}

/// The frames of an image.
///
/// # Errors
/// [`Unusable`] where a frame has no place, or values can't be told.
pub(super) fn frames(data: &DataSet, format: &PixelFormat) -> Result<Vec<Frame>, Unusable> {
    let is_mosaic = data.texts(tags::IMAGE_TYPE).iter().any(|part| part == "MOSAIC");
    if is_mosaic || data.has(tags::SIEMENS_MOSAIC_COUNT) {
        return Err(Unusable::new(
            "a mosaic of slices in one image",
            "an image per slice (convert it: dcm2niix)",
        ));
    }
    if data.has(tags::MODALITY_LUT_SEQUENCE) {
        return Err(Unusable::new("a Modality LUT Sequence", "Rescale Slope and Intercept"));
    }
    let per_frame = data.items(tags::PER_FRAME_FUNCTIONAL_GROUPS_SEQUENCE);
    let shared = data.item(tags::SHARED_FUNCTIONAL_GROUPS_SEQUENCE);
    if per_frame.is_empty() && shared.is_none() {
        if format.frames > 1 {
            let found = format!("{} frames without functional groups", format.frames);
            return Err(Unusable::new(found, "the position of each frame"));
        }
        return Ok(vec![classic_frame(data)?]);
    }
    if per_frame.len() != format.frames {
        let found = format!("{} items of functional groups", per_frame.len());
        return Err(Unusable::new(found, format!("{}, one per frame", format.frames)));
    }
    (0..format.frames).map(|number| enhanced_frame(data, shared, &per_frame[number], number)).collect()
}

fn classic_frame(data: &DataSet) -> Result<Frame, Unusable> {
    let mut keys: Vec<(&'static str, String)> = Vec::new();
    let mut key = |name: &'static str, value: Option<String>| keys.extend(value.map(|value| (name, value)));
    key("EchoTime", data.text(tags::ECHO_TIME));
    key("DiffusionBValue", data.double(tags::DIFFUSION_B_VALUE).map(|b| b.to_string()));
    key("TemporalPositionIdentifier", data.text(tags::TEMPORAL_POSITION_IDENTIFIER));
    key("TriggerTime", data.text(tags::TRIGGER_TIME));
    key("AcquisitionNumber", data.text(tags::ACQUISITION_NUMBER));
    let image_type = data.texts(tags::IMAGE_TYPE);
    key("ImageType", Some(image_type.get(2..).unwrap_or_default().join("\\")).filter(|t| !t.is_empty()));
    let Rescale { slope, intercept, had_slope_0 } = rescale(Some(data))?;
    let place = place(Some(data), Some(data), Some(data))?;
    let is_localizer = image_type.iter().any(|part| part == "LOCALIZER");
    let stack = if is_localizer { "localizer" } else { "" };
    Ok(Frame { number: 0, place, slope, intercept, stack: stack.into(), keys, had_slope_0 })
}

fn enhanced_frame(
    data: &DataSet,
    shared: Option<&DataSet>,
    own: &DataSet,
    number: usize,
) -> Result<Frame, Unusable> {
    let group = |tag: Tag| own.item(tag).or_else(|| shared.and_then(|shared| shared.item(tag)));
    let place = place(
        group(tags::PLANE_POSITION_SEQUENCE),
        group(tags::PLANE_ORIENTATION_SEQUENCE),
        group(tags::PIXEL_MEASURES_SEQUENCE),
    )
    .map_err(|wrong| Unusable::new(format!("{} for frame {}", wrong.found, number + 1), wrong.expected))?;
    let content = group(tags::FRAME_CONTENT_SEQUENCE);
    let mut keys: Vec<(&'static str, String)> = Vec::new();
    let mut key = |name: &'static str, value: Option<String>| keys.extend(value.map(|value| (name, value)));
    let echo = group(tags::MR_ECHO_SEQUENCE).and_then(|item| item.double(tags::EFFECTIVE_ECHO_TIME));
    key("EchoTime", echo.map(|ms| ms.to_string()));
    let diffusion = group(tags::MR_DIFFUSION_SEQUENCE);
    let b_value = diffusion.and_then(|item| item.double(tags::DIFFUSION_B_VALUE));
    key("DiffusionBValue", b_value.map(|b| b.to_string()));
    let time = content.and_then(|item| item.u32s(tags::TEMPORAL_POSITION_INDEX).first().copied());
    key("TemporalPositionIndex", time.map(|n| n.to_string()));
    let of_type =
        group(tags::MR_IMAGE_FRAME_TYPE_SEQUENCE).or_else(|| group(tags::CT_IMAGE_FRAME_TYPE_SEQUENCE));
    let frame_type = of_type.map(|item| item.texts(tags::FRAME_TYPE)).unwrap_or_default();
    key("FrameType", Some(frame_type.get(2..).unwrap_or_default().join("\\")).filter(|t| !t.is_empty()));
    const DIMENSIONS: [&str; 8] = [
        "dimension 1",
        "dimension 2",
        "dimension 3",
        "dimension 4",
        "dimension 5",
        "dimension 6",
        "dimension 7",
        "dimension 8",
    ];
    let indices = content.map(|item| item.u32s(tags::DIMENSION_INDEX_VALUES)).unwrap_or_default();
    for (name, index) in DIMENSIONS.into_iter().zip(indices) {
        key(name, Some(index.to_string()));
    }
    key("instance", data.text(tags::SOP_INSTANCE_UID));
    let transformation = group(tags::PIXEL_VALUE_TRANSFORMATION_SEQUENCE);
    let Rescale { slope, intercept, had_slope_0 } = rescale(transformation.or(Some(data)))?;
    let stack = content.and_then(|item| item.text(tags::STACK_ID)).unwrap_or_default();
    Ok(Frame { number, place, slope, intercept, stack, keys, had_slope_0 })
}

struct Rescale {
    slope: f64,
    intercept: f64,
    had_slope_0: bool,
}

fn rescale(data: Option<&DataSet>) -> Result<Rescale, Unusable> {
    let number = |tag: Tag| Ok(data.map(|data| data.decimal(tag)).transpose()?.flatten());
    let slope = number(tags::RESCALE_SLOPE)?.unwrap_or(1.0);
    let intercept = number(tags::RESCALE_INTERCEPT)?.unwrap_or(0.0);
    // Values are shown as f32.
    let largest = slope.abs() * f64::from(u32::MAX) + intercept.abs();
    if largest > f64::from(f32::MAX) {
        return Err(Unusable::new(format!("Rescale Slope {slope}"), "values that are finite"));
    }
    let had_slope_0 = slope == 0.0;
    Ok(Rescale { slope: if had_slope_0 { 1.0 } else { slope }, intercept, had_slope_0 })
}
