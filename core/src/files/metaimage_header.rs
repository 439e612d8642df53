//! The MetaImage header: its keys, and what they say of the grid and the stored numbers.
//!
//! From the MetaIO documentation (itk.org/Wiki/MetaIO) and library, which ITK and 3D Slicer use.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3};

use super::{
    FileError,
    detached::{self, DataFiles},
    nifti_header::{ByteOrder, Fault, SampleType},
    placed::{grid_in_mm, is_sheared, mm_per_unit, report_unusual_spacing, without_sides},
    stored_file::Place,
    stored_voxels::{Coding, MAX_FILES, Skip},
    text_header::{Lines, numbers, quoted, sizes},
};
use crate::{Check, Grid, Progress};

/// Most dimensions (MetaIO's limit).
const MAX_DIMENSIONS: u64 = 10;

/// The key that ends the header.
const LAST: &str = "ElementDataFile";

/// Keys that a header may begin with and that no other kind of file does.
const FIRST: &[&str] =
    &["ObjectType", "ObjectSubType", "NDims", "BinaryData", "CompressedData", "DimSize", "ElementType"];

/// Whether text that begins with these bytes is a MetaImage header.
pub(super) fn sniff(begin: &[u8]) -> bool {
    let line = begin.trim_ascii_start().split(|&b| b == b'\n').next().unwrap_or_default();
    let key = line.split(|&b| b == b'=').next().unwrap_or_default();
    key.len() < line.len()
        && FIRST.iter().any(|first| key.trim_ascii().eq_ignore_ascii_case(first.as_bytes()))
}

/// A header's keys.
#[derive(Debug)]
pub(super) struct Keys {
    keys: BTreeMap<String, String>,
    /// Where the voxels are.
    pub(super) data_files: DataFiles,
    /// Number of axes in each data file, where the header states it.
    pub(super) data_file_axes: Option<u64>,
    /// Bytes of the header.
    pub(super) header_bytes: u64,
}

impl Keys {
    /// Reads the header up to [`LAST`], and the names of a list behind it.
    pub(super) fn read(place: &Place<'_>, progress: &Progress) -> Result<Self, FileError> {
        let mut lines = Lines::open(place, "MetaImage", progress)?;
        let file = lines.file().to_owned();
        let mut keys: BTreeMap<String, String> = BTreeMap::new();
        loop {
            let Some(line) = lines.next()? else {
                let found = if keys.is_empty() {
                    "no line KEY = VALUE"
                } else {
                    "the end of the file inside the header"
                };
                return Err(FileError::wrong(file, found, format!("a MetaImage header that ends in {LAST}")));
            };
            if line.trim().is_empty() {
                continue;
            }
            let Some((key, value)) = line.split_once('=') else {
                let found = format!("the header line {}", quoted(&line));
                return Err(FileError::wrong(file, found, "KEY = VALUE of a MetaImage header"));
            };
            let (key, value) = (key.trim(), value.trim().to_owned());
            let is_last = key.eq_ignore_ascii_case(LAST);
            if !is_last {
                if keys.insert(key.to_lowercase(), value).is_some() && !key.eq_ignore_ascii_case("Comment") {
                    return Err(FileError::wrong(file, format!("the key {} twice", quoted(key)), "once"));
                }
                continue;
            }
            let (mut data_files, data_file_axes) = if value.eq_ignore_ascii_case("LOCAL") {
                (DataFiles::Attached, None)
            } else {
                detached::described(&value)
                    .map_err(|(found, expected)| FileError::wrong(&file, found, expected))?
            };
            let header_bytes = lines.position();
            if let DataFiles::List(names) = &mut data_files {
                while let Some(name) = lines.next()? {
                    if !name.trim().is_empty() {
                        names.push(name.trim().to_owned());
                    }
                    if names.len() as u64 > MAX_FILES {
                        return Err(FileError::wrong(
                            file,
                            format!("more than {MAX_FILES} data files"),
                            "no more",
                        ));
                    }
                }
            }
            return Ok(Self { keys, data_files, data_file_axes, header_bytes });
        }
    }

    /// The first of these keys that there is, with its name.
    fn get(&self, names: &[&'static str]) -> Option<(&'static str, &str)> {
        names.iter().find_map(|name| Some((*name, self.keys.get(&name.to_lowercase())?.as_str())))
    }

    fn text(&self, name: &'static str) -> Option<&str> {
        self.get(&[name]).map(|(_, text)| text)
    }

    fn is_true(&self, names: &[&'static str]) -> Option<bool> {
        let (_, text) = self.get(names)?;
        Some(text.starts_with(['T', 't', '1']))
    }

    /// Sizes of the axes, first the fastest.
    pub(super) fn sizes(&self) -> Result<Vec<u64>, Fault> {
        let text = self.text("NDims").unwrap_or_default();
        let count =
            text.parse::<u64>().ok().filter(|n| (2..=MAX_DIMENSIONS).contains(n)).ok_or_else(|| {
                let found = format!("NDims {}", quoted(text));
                Fault::new("metaimage-ndims", found, format!("2 to {MAX_DIMENSIONS} dimensions"))
            })?;
        let text = self.text("DimSize").unwrap_or_default();
        sizes(text).filter(|sizes| sizes.len() as u64 == count).ok_or_else(|| {
            let expected = format!("{count} whole numbers of at least 1");
            Fault::new("metaimage-sizes", format!("DimSize {}", quoted(text)), expected)
        })
    }

    /// Data type of the stored numbers.
    pub(super) fn sample_type(&self) -> Result<SampleType, Fault> {
        let channels = self.text("ElementNumberOfChannels").unwrap_or("1");
        if channels != "1" {
            let found = format!("{} channels a voxel (ElementNumberOfChannels)", quoted(channels));
            return Err(Fault::new("metaimage-channels", found, "one number a voxel"));
        }
        let name = self.text("ElementType").unwrap_or_default();
        Ok(match name.to_uppercase().as_str() {
            "MET_CHAR" | "MET_ASCII_CHAR" => SampleType::Int8,
            "MET_UCHAR" => SampleType::UInt8,
            "MET_SHORT" => SampleType::Int16,
            "MET_USHORT" => SampleType::UInt16,
            // MetaIO's long has 4 bytes on every machine.
            "MET_INT" | "MET_LONG" => SampleType::Int32,
            "MET_UINT" | "MET_ULONG" => SampleType::UInt32,
            "MET_LONG_LONG" => SampleType::Int64,
            "MET_ULONG_LONG" => SampleType::UInt64,
            "MET_FLOAT" => SampleType::Float32,
            "MET_DOUBLE" => SampleType::Float64,
            _ => {
                let expected = "ElementType MET_UCHAR, MET_SHORT, MET_FLOAT or another number";
                return Err(Fault::new("metaimage-type", format!("ElementType {}", quoted(name)), expected));
            }
        })
    }

    /// Name and kind of the encoding.
    pub(super) fn coding(&self) -> (&'static str, Coding) {
        if self.is_true(&["CompressedData"]) == Some(true) {
            ("zlib", Coding::Deflated)
        } else if self.is_true(&["BinaryData"]) == Some(false) {
            ("text", Coding::Text)
        } else {
            ("raw", Coding::Bytes(super::bounded_gzip::Packing::Plain))
        }
    }

    /// Byte order of numbers.
    pub(super) fn order(
        &self,
        sample_type: SampleType,
        coding: Coding,
        name: &str,
        checks: &mut Vec<Check>,
    ) -> ByteOrder {
        match self.is_true(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"]) {
            _ if coding == Coding::Text || sample_type.bytes() == 1 => ByteOrder::Little,
            Some(true) => ByteOrder::Big,
            Some(false) => ByteOrder::Little,
            None => {
                let text = format!(
                    "{name}: no BinaryDataByteOrderMSB; the least significant byte is taken as first"
                );
                checks.push(Check::warning("byte-order-missing", text));
                ByteOrder::Little
            }
        }
    }

    /// Size of the compressed voxels.
    pub(super) fn compressed_bytes(&self) -> Result<Option<u64>, Fault> {
        let Some(text) = self.text("CompressedDataSize") else { return Ok(None) };
        text.parse().map(Some).map_err(|_| {
            Fault::new(
                "metaimage-compressed-size",
                format!("CompressedDataSize {}", quoted(text)),
                "a number of bytes",
            )
        })
    }

    /// First byte of the voxels in their file that `HeaderSize` allows, and the bytes to skip from there.
    pub(super) fn start(&self, coding: Coding) -> Result<(u64, Skip), Fault> {
        let is_attached = self.data_files == DataFiles::Attached;
        let least = if is_attached { self.header_bytes } else { 0 };
        let wrong = |text: &str, expected: String| {
            Fault::new("metaimage-header-size", format!("HeaderSize {}", quoted(text)), expected)
        };
        match self.text("HeaderSize") {
            None | Some("0") => Ok((least, Skip::Bytes(0))),
            Some("-1") if matches!(coding, Coding::Bytes(_)) => Ok((least, Skip::AllButVoxels)),
            Some(text) => {
                let bytes = text.parse().ok().filter(|&bytes| bytes >= least);
                let expected = format!("at least {least} bytes, or -1 with voxels that are not compressed");
                Ok((bytes.ok_or_else(|| wrong(text, expected))?, Skip::Bytes(0)))
            }
        }
    }

    /// The grid of the first three axes, what it was made from, and the unit.
    pub(super) fn place(
        &self,
        sizes: &[u64],
        name: &str,
        checks: &mut Vec<Check>,
    ) -> Result<(Grid, &'static str, Option<String>), Fault> {
        let count = sizes.len();
        let list = |names: &[&'static str], most: usize| -> Result<Option<Vec<f64>>, Fault> {
            let Some((key, text)) = self.get(names) else { return Ok(None) };
            let all = numbers(text).filter(|all| all.len() == most && all.iter().all(|n| n.is_finite()));
            let wrong = || {
                Fault::new(
                    "metaimage-numbers",
                    format!("{key} {}", quoted(text)),
                    format!("{most} finite numbers"),
                )
            };
            all.map(Some).ok_or_else(wrong)
        };
        let mut dims = [1; 3];
        for (dim, &size) in dims.iter_mut().zip(sizes) {
            *dim = usize::try_from(size).unwrap_or(usize::MAX);
        }
        if dims.iter().try_fold(1_usize, |all, &n| all.checked_mul(n)).is_none_or(|all| all >= 1 << 40) {
            return Err(Fault::new(
                "metaimage-sizes",
                format!("DimSize {sizes:?}"),
                "fewer than 2^40 voxels a frame",
            ));
        }
        let spacing = list(&["ElementSpacing", "ElementSize"], count)?;
        if spacing.is_none() {
            checks.push(Check::warning(
                "spacing-missing",
                format!("{name}: no ElementSpacing; one unit assumed"),
            ));
        }
        let spacing = spacing.unwrap_or_else(|| vec![1.0; count]);
        if let Some(bad) = spacing.iter().find(|spacing| **spacing <= 0.0) {
            return Err(Fault::new("metaimage-spacing", format!("ElementSpacing {bad}"), "spacings above 0"));
        }
        let matrix = list(&["TransformMatrix", "Rotation", "Orientation"], count * count)?;
        let offset = list(&["Offset", "Position", "Origin"], count)?;
        let is_known = matrix.is_some() && offset.is_some();
        // Row i of the text is the direction of axis i, in LPS.
        let at = |axis: usize, along: usize| match &matrix {
            Some(all) if axis < count && along < count => all[axis * count + along],
            _ => f64::from(u8::from(axis == along)),
        };
        let spatial = count.min(3);
        let mixes =
            (0..spatial).any(|axis| (3..count).any(|time| at(axis, time) != 0.0 || at(time, axis) != 0.0));
        if mixes {
            let found = "a TransformMatrix that mixes the first three axes with others";
            return Err(Fault::new("metaimage-matrix", found, "axes in space, then others"));
        }
        let lps = |axis: usize| DVec3::from_array(std::array::from_fn(|along| at(axis, along)));
        let columns = [0, 1, 2].map(|axis| lps(axis) * spacing.get(axis).copied().unwrap_or(1.0));
        let to_ras = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
        let offset = offset.unwrap_or_default();
        let origin = DVec3::from_array(std::array::from_fn(|axis| offset.get(axis).copied().unwrap_or(0.0)));
        let world = DAffine3 {
            matrix3: to_ras * DMat3::from_cols(columns[0], columns[1], columns[2]),
            translation: to_ras * origin,
        };
        let (mm, unit) = self.unit(name, checks);
        let unusable = |why: String| {
            Fault::new("metaimage-place", format!("a place that can't be used ({why})"), "one that can")
        };
        let mut grid = grid_in_mm(world, dims, mm).map_err(unusable)?;
        if !is_known {
            grid = without_sides(&grid).map_err(unusable)?;
            checks.push(Check::warning(
                "side-unknown",
                format!("{name}: no TransformMatrix or Offset: left and right are unknown"),
            ));
        }
        if count < 3 {
            checks.push(Check::warning(
                "thickness-unknown",
                format!("{name}: {count} dimensions; one unit assumed along the third"),
            ));
        }
        report_unusual_spacing(&grid, name, checks);
        if is_sheared(&grid) {
            checks.push(Check::warning(
                "sheared",
                format!("{name}: the voxels are sheared (axes not at right angles); programs that use ITK refuse them or turn the axes"),
            ));
        }
        let place_from = if matrix.is_some() { "TransformMatrix" } else { "ElementSpacing" };
        Ok((grid, place_from, unit))
    }

    fn unit(&self, name: &str, checks: &mut Vec<Check>) -> (f64, Option<String>) {
        let Some(text) = self.text("DistanceUnits").filter(|text| !matches!(*text, "" | "?")) else {
            return (1.0, None);
        };
        let unit = super::printable(text);
        let mm = mm_per_unit(text);
        match mm {
            Some(1.0) => {}
            Some(_) => {
                let text = format!(
                    "{name}: lengths are in {unit}; converted to mm (programs that ignore the unit differ)"
                );
                checks.push(Check::warning("units-converted", text));
            }
            None => {
                checks.push(Check::warning(
                    "units-unknown",
                    format!("{name}: unit {} is unknown; mm assumed", quoted(text)),
                ));
            }
        }
        (mm.unwrap_or(1.0), Some(unit))
    }

    /// Reports a function of the stored numbers, which ITK doesn't apply either.
    pub(super) fn report_scaling(&self, name: &str, checks: &mut Vec<Check>) {
        let is_other = |key, plain: f64| self.text(key).is_some_and(|text| text.parse() != Ok(plain));
        if is_other("ElementToIntensityFunctionSlope", 1.0)
            || is_other("ElementToIntensityFunctionOffset", 0.0)
        {
            let text = format!(
                "{name}: ElementToIntensityFunction is not applied, as in ITK; stored values are used"
            );
            checks.push(Check::warning("scaling-ignored", text));
        }
    }
}
