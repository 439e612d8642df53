//! An image as its header describes it, whatever the format: one frame's voxels, or the header information.

use serde::Serialize;

use super::{
    FileError, FileInfo, Loaded, ReadOptions, Segment,
    nifti_header::{ByteOrder, SampleType},
    opened::base_name,
    printable, segment_labels,
    stored_file::Place,
    stored_voxels::{Parts, StoredVoxels},
    voxels::{Layout, MAX_LEAD, read_frame},
};
use crate::{Check, Grid, Progress, Scaling, Sides, Volume, decimal};

/// The checked content of a header, sufficient to read the voxels.
#[derive(Clone, Debug)]
pub(super) struct Image<'a> {
    /// Path of the header's file, for errors.
    pub(super) file: String,
    /// The format and its version.
    pub(super) format: String,
    /// How voxels are encoded.
    pub(super) encoding: &'static str,
    /// Sizes of the file's axes, first the fastest.
    pub(super) dims: Vec<u64>,
    /// The voxel grid.
    pub(super) grid: Grid,
    /// What `grid` was made from.
    pub(super) place_from: &'static str,
    /// Unit of length in the header.
    pub(super) unit: Option<String>,
    /// How the voxels follow each other.
    pub(super) layout: Layout,
    /// Where they are.
    pub(super) parts: Parts<'a>,
    /// The segmentations that the header names.
    pub(super) segments: Vec<Segment>,
    /// Findings.
    pub(super) checks: Vec<Check>,
}

/// Header information of an NRRD, MetaImage or MGH file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageInfo {
    /// The file with the header.
    pub file: String,
    /// The files with the voxels, if they are others.
    pub data_files: Vec<String>,
    /// The format and its version.
    pub format: String,
    /// How the voxels are encoded: `raw`, `gzip`, `zlib`, `bzip2`, `text`, `hex`.
    pub encoding: &'static str,
    /// Byte order of numbers; `None` where it has no meaning.
    pub byte_order: Option<ByteOrder>,
    /// Sizes of the file's axes, first the fastest.
    pub dims: Vec<u64>,
    /// Product of the sizes of all axes that are not in space.
    pub frames: u64,
    /// Data type of the stored voxels.
    pub datatype: SampleType,
    /// Bytes of one frame's voxels.
    pub frame_bytes: u64,
    /// Distance between neighbouring voxel centres.
    pub spacing_mm: [f64; 3],
    /// Rows of the matrix from voxel centres to RAS+ millimetres, the last 0 0 0 1.
    pub world_from_voxel: [[f64; 4]; 4],
    /// Orientation code of the voxel axes; `None` where sides are unknown.
    pub axis_codes: Option<String>,
    /// What the matrix was made from, in the format's words.
    pub place_from: &'static str,
    /// Unit of length in the header; `None` if it states none.
    pub unit: Option<String>,
    /// The segmentations that the header names.
    pub segments: Vec<Segment>,
    /// Findings.
    pub checks: Vec<Check>,
}

impl FileInfo for ImageInfo {
    fn text(&self) -> String {
        let list = |numbers: &[u64]| numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
        let order = self.byte_order.map(|order| format!(", {order:?}-endian").to_lowercase());
        let mut lines = vec![
            self.file.clone(),
            format!("format      {}, {}{}", self.format, self.encoding, order.unwrap_or_default()),
            format!(
                "dimensions  {} ({} frame{})",
                list(&self.dims),
                self.frames,
                if self.frames == 1 { "" } else { "s" }
            ),
            format!("voxels      {:?}, {} bytes a frame", self.datatype, self.frame_bytes),
            format!("spacing     {} mm", decimal::sizes(self.spacing_mm, 4)),
            format!("axes        {}", self.axis_codes.as_deref().unwrap_or("side unknown")),
            format!("place from  {}", self.place_from),
            format!("unit        {}", self.unit.as_deref().unwrap_or("none stated, mm")),
        ];
        match self.data_files.as_slice() {
            [] => {}
            [one] => lines.push(format!("data file   {one}")),
            [first, .., last] => {
                lines.push(format!("data files  {}: {first} to {last}", self.data_files.len()));
            }
        }
        for segment in &self.segments {
            let label =
                segment.label.map_or_else(|| "every voxel above 0.5".into(), |l| format!("label {l}"));
            let name = printable(&segment.name);
            lines.push(format!("segment {:<3} {name}: {label}, frame {}", segment.number, segment.frame));
        }
        let check = |c: &Check| format!("{:?} [{}]: {}", c.severity, c.code, c.message).to_lowercase();
        lines.extend(self.checks.iter().map(check));
        lines.join("\n")
    }

    fn checks(&self) -> &[Check] {
        &self.checks
    }

    fn json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }
}

impl Image<'_> {
    /// Bytes of all voxels.
    fn all_bytes(&self) -> Result<u64, FileError> {
        self.layout.all_bytes().filter(|_| self.layout.lead <= MAX_LEAD).ok_or_else(|| {
            let found = format!("{} frames of {} voxels", self.layout.frames(), self.layout.voxels);
            let expected = format!("fewer than 2^63 bytes, and at most {MAX_LEAD} frames voxel by voxel");
            FileError::wrong(&self.file, found, expected)
        })
    }

    /// As [`super::read()`].
    pub(super) fn read(mut self, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
        let all = self.all_bytes()?;
        let frame_bytes = self.layout.frame_bytes();
        if frame_bytes > options.max_bytes {
            let found = format!("{frame_bytes} bytes of voxels a frame");
            let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
            return Err(FileError::wrong(self.file, found, expected));
        }
        let (frame, frames) = (options.frame as u64, self.layout.frames());
        if frame >= frames {
            let expected = format!("more than {frame}, as frame {frame} (from 0) is asked for");
            return Err(FileError::wrong(self.file, format!("{frames} frame(s)"), expected));
        }
        let expected = format!("{all} bytes of voxels");
        let mut bytes = StoredVoxels::open(&self.parts, progress)?;
        let samples = read_frame(&mut bytes, &self.layout, frame, &expected)?;
        let trailing = bytes.finish()?;
        report_trailing(trailing, &self.file, &mut self.checks);
        progress.check()?;
        let frames = usize::try_from(frames).unwrap_or(usize::MAX);
        let volume = Volume::new(self.grid, samples, Scaling::NONE)
            .ok_or_else(|| FileError::wrong(&self.file, "another number of voxels", expected))?;
        let name = base_name(&self.file);
        self.checks.extend(segment_labels::undeclared(&volume, &self.segments, options.frame, &name));
        Ok(Loaded { volume, frames, checks: self.checks, origin: None })
    }

    /// As [`super::info()`].
    pub(super) fn info(mut self, progress: &Progress) -> Result<ImageInfo, FileError> {
        use super::voxels::VoxelBytes as _;
        let all = self.all_bytes()?;
        let mut bytes = StoredVoxels::open(&self.parts, progress)?;
        bytes.skip(all, &format!("{all} bytes of voxels"))?;
        let trailing = bytes.finish()?;
        report_trailing(trailing, &self.file, &mut self.checks);
        let known = self.grid.sides() == Sides::Known;
        let has_order = self.layout.sample_type.bytes() > 1 && self.encoding != "text";
        let names = self.parts.files.iter().map(Place::name).filter(|name| *name != self.file);
        Ok(ImageInfo {
            data_files: names.collect(),
            file: self.file,
            format: self.format,
            encoding: self.encoding,
            byte_order: has_order.then_some(self.layout.order),
            dims: self.dims,
            frames: self.layout.frames(),
            datatype: self.layout.sample_type,
            frame_bytes: self.layout.frame_bytes(),
            spacing_mm: self.grid.spacing_mm().to_array(),
            world_from_voxel: crate::grid::rows(self.grid.world_from_voxel()),
            axis_codes: known.then(|| self.grid.axis_codes().iter().collect()),
            place_from: self.place_from,
            unit: self.unit,
            segments: self.segments,
            checks: self.checks,
        })
    }
}

fn report_trailing(trailing: u64, file: &str, checks: &mut Vec<Check>) {
    if trailing > 0 {
        let name = base_name(file);
        checks.push(Check::warning(
            "trailing-bytes",
            format!("{name}: {trailing} bytes behind the voxels, not read; the sizes may be wrong"),
        ));
    }
}
