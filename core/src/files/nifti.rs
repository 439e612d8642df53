//! Reading NIfTI: one frame's voxels or the header information, from a single file or a pair.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::bounded_gzip::Stream;
use super::nifti_describe::Described;
use super::nifti_header::{ByteOrder, Fault, Header, MAX_EXTENSION_BYTES, SampleType, Version, recognise};
use super::nifti_space::{Form, length_unit};
use super::opened::base_name;
use super::voxels::{Layout, read_frame};
use super::{FileError, FileInfo, Loaded, Part, ReadOptions, Segment, Source, printable};
use crate::{Check, Progress, Samples, Sides, Volume, decimal};

/// Maximum number of header extensions in a file.
const MAX_EXTENSIONS: u64 = 1024;

/// Header information of a NIfTI file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeaderInfo {
    /// The file with the header.
    pub file: String,
    /// The file with the voxels, if it is another one.
    pub image_file: Option<String>,
    /// NIfTI-1 or NIfTI-2.
    pub format: Version,
    /// Byte order of numbers.
    pub byte_order: ByteOrder,
    /// Whether the file with the voxels is gzipped.
    pub gzip: bool,
    /// All of the file's dimensions.
    pub dims: Vec<u64>,
    /// Product of dimensions 4 to 7.
    pub frames: u64,
    /// Data type of the stored voxels.
    pub datatype: SampleType,
    /// Components of a voxel: 3 or 4 where it is a colour, which is read as a label; else 1.
    pub components: usize,
    /// Bytes of one frame's voxels.
    pub frame_bytes: u64,
    /// Distance between neighbouring voxel centres, from the form in force.
    pub spacing_mm: [f64; 3],
    /// Rows of the matrix from voxel centres to RAS+ millimetres, the last 0 0 0 1.
    pub world_from_voxel: [[f64; 4]; 4],
    /// Orientation code of the voxel axes; `None` where sides are unknown.
    pub axis_codes: Option<String>,
    /// The form in force: what the matrix was made from.
    pub form: Form,
    /// As stored in the header.
    pub sform_code: i32,
    /// As stored in the header.
    pub qform_code: i32,
    /// Unit of length in the header: `mm`, `µm`, `m`; `None` if unknown.
    pub unit: Option<&'static str>,
    /// Factor from stored numbers to values.
    pub slope: f64,
    /// Offset from stored numbers to values.
    pub intercept: f64,
    /// The farthest that a value may lie from a label and still mean it, see [`crate::Scaling::label`].
    pub label_tolerance: f64,
    /// Number of header extensions; their content is not shown (it may hold patient data).
    pub extensions: u64,
    /// Findings.
    pub checks: Vec<Check>,
}

impl FileInfo for HeaderInfo {
    fn text(&self) -> String {
        let list = |numbers: &[u64]| numbers.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
        let mut lines = vec![
            self.file.clone(),
            format!(
                "format      {}, {}-endian{}",
                match self.format {
                    Version::One => "NIfTI-1",
                    Version::Two => "NIfTI-2",
                },
                format!("{:?}", self.byte_order).to_lowercase(),
                if self.gzip { ", gzip" } else { "" }
            ),
            format!(
                "dimensions  {} ({} frame{})",
                list(&self.dims),
                self.frames,
                if self.frames == 1 { "" } else { "s" }
            ),
            match self.components {
                1 => format!("voxels      {:?}, {} bytes a frame", self.datatype, self.frame_bytes),
                n => format!(
                    "voxels      colours of {n} components, {} bytes a frame; each is a label",
                    self.frame_bytes
                ),
            },
            format!("spacing     {} mm", decimal::sizes(self.spacing_mm, 4)),
            format!("axes        {}", self.axis_codes.as_deref().unwrap_or("side unknown")),
            format!(
                "place from  {:?} (sform code {}, qform code {})",
                self.form, self.sform_code, self.qform_code
            ),
            format!("unit        {}", self.unit.unwrap_or("unknown, mm assumed")),
            format!(
                "values      {} × stored + {}; a label is at most {} from its value",
                self.slope,
                self.intercept,
                decimal::text(self.label_tolerance, 3)
            ),
            format!("extensions  {}", self.extensions),
        ];
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

/// Whether a file that begins with these bytes is NIfTI.
pub(super) fn sniff(begin: &[u8]) -> bool {
    begin.first_chunk::<4>().is_some_and(|first_four| recognise(*first_four).is_some())
}

/// As [`super::read`].
pub(super) fn read(source: &Source, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    read_opened(Opened::source(source, progress)?, options, progress)
}

/// As [`super::read`], from memory; messages call the file `name`. A pair's header is refused.
///
/// # Errors
/// As [`super::read`].
pub fn read_bytes(
    name: &str,
    bytes: &[u8],
    options: &ReadOptions,
    progress: &Progress,
) -> Result<Loaded, FileError> {
    read_opened(Opened::single(Stream::of_bytes(name, bytes, progress)?)?, options, progress)
}

/// Header information of a file. Reads the file to its end to detect damage and truncation, but keeps no voxels.
///
/// # Errors
/// As [`super::read`], without a limit on size.
pub fn nifti_info(source: &Source) -> Result<HeaderInfo, FileError> {
    nifti_info_with(source, &Progress::new())
}

/// As [`nifti_info`], with progress and cancellation.
///
/// # Errors
/// As [`nifti_info`].
pub fn nifti_info_with(source: &Source, progress: &Progress) -> Result<HeaderInfo, FileError> {
    let opened = Opened::source(source, progress)?;
    let (header, described, file) = (opened.header, opened.described, opened.file);
    let mut checks = described.checks.clone();
    let (image_file, gzip) = (opened.image_file, opened.voxels.is_gzip());
    skip_voxels(opened.voxels, &described, &opened.base_name, &mut checks)?;
    let grid = &described.grid;
    let world_from_voxel = grid.world_from_voxel();
    let known = grid.sides() == Sides::Known;
    Ok(HeaderInfo {
        file,
        image_file,
        format: header.version,
        byte_order: header.order,
        gzip,
        dims: header
            .dim
            .iter()
            .skip(1)
            .take(header.dim[0].max(0) as usize)
            .map(|&d| d.max(0) as u64)
            .collect(),
        frames: described.frames,
        datatype: described.sample_type,
        components: described.components,
        frame_bytes: described.frame_bytes,
        spacing_mm: grid.spacing_mm().to_array(),
        world_from_voxel: crate::grid::rows(world_from_voxel),
        axis_codes: known.then(|| grid.axis_codes().iter().collect()),
        form: described.form,
        sform_code: header.sform_code,
        qform_code: header.qform_code,
        unit: length_unit(header.xyzt_units).map(|(name, _)| name),
        slope: described.scaling.slope,
        intercept: described.scaling.intercept,
        label_tolerance: described.scaling.label_tolerance(described.sample_type.is_integer()),
        extensions: opened.extensions,
        checks,
    })
}

/// A checked header, and the stream of the file with the voxels.
struct Opened<'a> {
    /// Path of the header's file, for errors.
    file: String,
    /// Name of the header's file without its folder, for checks.
    base_name: String,
    image_file: Option<String>,
    header: Header,
    described: Described,
    extensions: u64,
    voxels: Stream<'a>,
}

impl<'a> Opened<'a> {
    fn source(source: &'a Source, progress: &'a Progress) -> Result<Self, FileError> {
        match source {
            Source::Embedded { name, bytes } => Self::single(Stream::of_bytes(name, bytes, progress)?),
            Source::File(path) | Source::Part(Part { path, .. }) => match Half::of(path) {
                None => Self::single(Stream::open(path, progress)?),
                Some(Half::Header) => Self::pair(path, None, progress),
                Some(Half::Image) => {
                    if !path.is_file() {
                        // Fails with the same error as for any other missing file.
                        Stream::open(path, progress)?;
                    }
                    Self::pair(&Half::Image.partner(path)?, Some(path), progress)
                }
            },
        }
    }

    fn single(mut stream: Stream<'a>) -> Result<Self, FileError> {
        let (header, described) = read_header(&mut stream)?;
        if header.paired {
            let fault = Fault::new(
                "magic-pair",
                "the header of a pair (magic ni1 or ni2)",
                "magic n+1 or n+2, or the name .hdr and an .img beside it",
            );
            return Err(fault.in_file(stream.file()));
        }
        stream.can_hold(described.data_offset)?;
        Self::single_after_header(header, described, stream)
    }

    fn single_after_header(
        header: Header,
        mut described: Described,
        mut stream: Stream<'a>,
    ) -> Result<Self, FileError> {
        let base_name = base_name(stream.file());
        let end = described.data_offset;
        let extensions = read_extensions(&mut stream, &header, Some(end), &base_name, &mut described.checks)?;
        stream.skip(end - stream.position(), "as many bytes before the voxels as vox_offset says")?;
        let file = stream.file().to_owned();
        Ok(Self { file, base_name, image_file: None, header, described, extensions, voxels: stream })
    }

    fn pair(header_path: &Path, image: Option<&Path>, progress: &'a Progress) -> Result<Self, FileError> {
        let mut stream = Stream::open(header_path, progress)?;
        let (header, mut described) = read_header(&mut stream)?;
        let (file, base_name) = (stream.file().to_owned(), base_name(stream.file()));
        if !header.paired {
            if image.is_some() {
                let fault = Fault::new(
                    "magic-pair",
                    "magic n+1 or n+2 (voxels in the same file)",
                    "ni1 or ni2 in the header of a pair",
                );
                return Err(fault.in_file(&file));
            }
            // The magic decides, not the name: a single file named .hdr.
            return Self::single_after_header(header, described, stream);
        }
        let extensions = read_extensions(&mut stream, &header, None, &base_name, &mut described.checks)?;
        stream.finish()?;
        let image = match image {
            Some(path) => path.to_owned(),
            None => Half::Header.partner(header_path)?,
        };
        let mut voxels = Stream::open(&image, progress)?;
        voxels.can_hold(described.data_offset)?;
        voxels.skip(described.data_offset, "as many bytes before the voxels as vox_offset says")?;
        let image_file = Some(voxels.file().to_owned());
        Ok(Self { file, base_name, image_file, header, described, extensions, voxels })
    }
}

fn read_header(stream: &mut Stream<'_>) -> Result<(Header, Described), FileError> {
    let mut bytes = [0; 540];
    let mut read_len = stream.fill(&mut bytes[..348])?;
    if read_len == 348
        && let Some(&first_four) = bytes.first_chunk()
        && let Some((version, _)) = recognise(first_four)
    {
        read_len += stream.fill(&mut bytes[348..version.header_bytes()])?;
    }
    let file = stream.file();
    let header = Header::parse(&bytes[..read_len]).map_err(|fault| fault.in_file(file))?;
    let described = header.describe(&base_name(file)).map_err(|fault| fault.in_file(file))?;
    Ok((header, described))
}

/// Skips the header extensions and returns their number; they end at offset `end`, or at the end of the file where
/// that is `None` (a pair's header).
fn read_extensions(
    stream: &mut Stream<'_>,
    header: &Header,
    end: Option<u64>,
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<u64, FileError> {
    let mut extender = [0; 4];
    let read_len = stream.fill(&mut extender)?;
    if read_len < 4 && end.is_some() {
        return Err(stream.ends_early("four more bytes, which say whether extensions follow"));
    }
    if read_len < 4 || extender[0] == 0 {
        return Ok(0);
    }
    let first = stream.position();
    let last = end.unwrap_or(first + MAX_EXTENSION_BYTES);
    let (mut count, mut odd) = (0, None);
    // Where the voxels begin is known from vox_offset alone, so that a size against the standard or zeros behind the
    // last extension mislead nobody. An extension that reaches into the voxels does.
    while stream.position() < last {
        let bad = |found: String, stream: &Stream<'_>| {
            let expected = "header extensions of 8 bytes or more each, in front of the voxels";
            Fault::new("extension", found, expected).in_file(stream.file())
        };
        let mut intro = [0; 8];
        let room = last - stream.position();
        let intro_len = stream.fill(&mut intro[..8.min(usize::try_from(room).unwrap_or(8))])?;
        if intro_len == 0 && end.is_none() {
            break;
        }
        let size = [intro[0], intro[1], intro[2], intro[3]];
        if size == [0; 4] {
            odd.get_or_insert_with(|| "zeros where an extension should begin".to_owned());
            break;
        }
        if intro_len < 8 {
            return Err(bad(format!("{intro_len} bytes where an extension should begin"), stream));
        }
        let size = match header.order {
            ByteOrder::Little => i32::from_le_bytes(size),
            ByteOrder::Big => i32::from_be_bytes(size),
        };
        let Some(size) = u64::try_from(size).ok().filter(|&n| n >= 8 && n <= room) else {
            return Err(bad(format!("an extension of {size} bytes where {room} are left"), stream));
        };
        if size % 16 != 0 {
            odd.get_or_insert_with(|| format!("a header extension of {size} bytes"));
        }
        count += 1;
        if count > MAX_EXTENSIONS {
            return Err(bad(format!("more than {MAX_EXTENSIONS} extensions"), stream));
        }
        stream.skip(size - 8, "the whole of a header extension")?;
    }
    if let Some(found) = odd {
        checks.push(Check::warning(
            "extension-odd",
            format!(
                "{name}: found {found}, expected extensions of multiples of 16 bytes up to the voxels; the voxels are \
                 read where vox_offset says"
            ),
        ));
    } else if count == 0 {
        checks.push(Check::note(
            "extension-missing",
            format!("{name}: the header announces extensions, but there is no room for any"),
        ));
    }
    Ok(count)
}

/// Skips all voxels.
fn skip_voxels(
    mut stream: Stream<'_>,
    described: &Described,
    name: &str,
    checks: &mut Vec<Check>,
) -> Result<(), FileError> {
    let all = described.frame_bytes.saturating_mul(described.frames);
    stream.can_hold(described.data_offset.saturating_add(all))?;
    stream.skip(all, &format!("{all} bytes of voxels"))?;
    finish(stream, name, checks)
}

fn finish(stream: Stream<'_>, name: &str, checks: &mut Vec<Check>) -> Result<(), FileError> {
    let trailing = stream.finish()?;
    if trailing > 0 {
        checks.push(Check::note(
            "trailing-bytes",
            format!("{name}: {trailing} bytes behind the voxels, not read"),
        ));
    }
    Ok(())
}

fn read_opened(opened: Opened<'_>, options: &ReadOptions, progress: &Progress) -> Result<Loaded, FileError> {
    let Opened { described, mut voxels, file, base_name, .. } = opened;
    let frame_bytes = described.frame_bytes;
    if frame_bytes > options.max_bytes {
        let found = format!("{frame_bytes} bytes of voxels a frame");
        let expected = format!("at most {} (the limit, which can be raised)", options.max_bytes);
        return Err(FileError::wrong(file, found, expected));
    }
    let frame = options.frame as u64;
    if frame >= described.frames {
        let found = format!("{} frame(s)", described.frames);
        return Err(FileError::wrong(
            file,
            found,
            format!("more than {frame}, as frame {frame} (from 0) is asked for"),
        ));
    }
    // describe() has checked that these don't overflow.
    let all = frame_bytes.saturating_mul(described.frames);
    voxels.can_hold(described.data_offset.saturating_add(all))?;
    let expected = format!("{all} bytes of voxels");
    let layout = Layout {
        sample_type: described.sample_type,
        order: opened.header.order,
        voxels: described.grid.voxel_count() * described.components,
        lead: 1,
        trail: described.frames,
    };
    let samples = read_frame(&mut voxels, &layout, frame, &expected)?;
    let mut checks = described.checks;
    finish(voxels, &base_name, &mut checks)?;
    progress.check()?;
    let samples = match &samples {
        Samples::U8(bytes) if described.components > 1 => {
            let labels = ColorLabels::of(bytes, described.components).ok_or_else(|| {
                let found = format!("a picture of more than {MOST_COLORS} colours");
                FileError::wrong(&file, found, "colours that are labels")
            })?;
            let text = format!(
                "{base_name}: found colours in place of numbers; each of {} is a label",
                labels.colors.len()
            );
            checks.push(Check::note("color-labels", text));
            Samples::U8(labels.voxels)
        }
        _ => samples,
    };
    let frames = usize::try_from(described.frames).unwrap_or(usize::MAX);
    let volume = Volume::new(described.grid, samples, described.scaling)
        .ok_or_else(|| FileError::wrong(file, "another number of voxels", expected))?;
    Ok(Loaded { volume, frames, checks, origin: None })
}

/// The colours of a file that has colours in place of numbers, each with its label; none of other files.
pub(super) fn segments(source: &Source, progress: &Progress) -> Result<Vec<Segment>, FileError> {
    let opened = Opened::source(source, progress)?;
    let components = opened.described.components;
    if components == 1 {
        return Ok(Vec::new());
    }
    let Opened { described, mut voxels, file, .. } = opened;
    if described.frame_bytes > ReadOptions::default().max_bytes {
        return Err(FileError::wrong(file, format!("{} bytes of colours", described.frame_bytes), "fewer"));
    }
    let layout = Layout {
        sample_type: described.sample_type,
        order: opened.header.order,
        voxels: described.grid.voxel_count() * components,
        lead: 1,
        trail: described.frames,
    };
    let samples = read_frame(&mut voxels, &layout, 0, &format!("{} bytes of voxels", described.frame_bytes))?;
    let Samples::U8(bytes) = samples else { return Ok(Vec::new()) };
    // More colours than labels are refused when the file is read.
    let colors = ColorLabels::of(&bytes, components).map(|labels| labels.colors).unwrap_or_default();
    Ok(colors
        .into_iter()
        .zip(1..)
        .map(|([r, g, b], number)| Segment {
            number,
            name: format!("#{r:02x}{g:02x}{b:02x}"),
            color: Some([r, g, b]),
            frame: 0,
            label: Some(number),
        })
        .collect())
}

/// The most colours of a label map.
const MOST_COLORS: usize = 255;

/// Colours as labels.
struct ColorLabels {
    /// The colours of the labels 1, 2, …: all that occur but black, sorted.
    colors: Vec<[u8; 3]>,
    /// The label of each voxel; 0 where it is black or transparent.
    voxels: Vec<u8>,
}

impl ColorLabels {
    /// Of voxels with 3 or 4 components each; `None` where there are more than [`MOST_COLORS`] colours.
    fn of(bytes: &[u8], components: usize) -> Option<Self> {
        // Some writers leave alpha 0 everywhere: then it says nothing.
        let has_alpha = components == 4 && bytes.chunks_exact(4).any(|voxel| voxel[3] != 0);
        let color = |voxel: &[u8]| match voxel {
            [_, _, _, 0] if has_alpha => [0; 3],
            [r, g, b, ..] => [*r, *g, *b],
            _ => [0; 3],
        };
        let mut colors = BTreeSet::new();
        let mut last = [0; 3];
        for voxel in bytes.chunks_exact(components).map(color) {
            if voxel != last && voxel != [0; 3] && colors.insert(voxel) && colors.len() > MOST_COLORS {
                return None;
            }
            last = voxel;
        }
        let colors: Vec<[u8; 3]> = colors.into_iter().collect();
        let label = |voxel: [u8; 3]| colors.binary_search(&voxel).map_or(0, |at| at as u8 + 1);
        let voxels = bytes.chunks_exact(components).map(|voxel| label(color(voxel))).collect();
        Some(Self { colors, voxels })
    }
}

/// The file with the header: `path`, or its partner where that is the second half of a pair.
///
/// # Errors
/// [`FileError::Wrong`] where there is no partner.
pub(super) fn header_path(path: &Path) -> Result<PathBuf, FileError> {
    if Half::of(path) == Some(Half::Image) { Half::Image.partner(path) } else { Ok(path.to_owned()) }
}

/// Which half of a pair a file is, by its name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    Header,
    Image,
}

impl Half {
    fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        match nifti_stem(name)?.1 {
            ".hdr" | ".hdr.gz" => Some(Self::Header),
            ".img" | ".img.gz" => Some(Self::Image),
            _ => None,
        }
    }

    /// The other half in the same folder: gzipped like `path` first, else the opposite; in lower or upper case.
    fn partner(self, path: &Path) -> Result<PathBuf, FileError> {
        let file = printable(&path.display().to_string());
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        let (stem, ending) = nifti_stem(name).unwrap_or((name, ""));
        let other = if self == Self::Header { ".img" } else { ".hdr" };
        let gzipped = format!("{other}.gz");
        let endings =
            if ending.ends_with(".gz") { [gzipped.as_str(), other] } else { [other, gzipped.as_str()] };
        let upper_case = name.ends_with(|c: char| c.is_ascii_uppercase());
        for ending in endings {
            let mut variants = [ending.to_owned(), ending.to_ascii_uppercase()];
            if upper_case {
                variants.reverse();
            }
            for variant in variants {
                let candidate = path.with_file_name(format!("{stem}{variant}"));
                // A broken link is the other half, too: opening it says what it is.
                if candidate.is_file() || candidate.is_symlink() {
                    return Ok(candidate);
                }
            }
        }
        let found = format!("no {} or {} beside it", endings[0], endings[1]);
        Err(FileError::wrong(file, found, "both halves of the pair"))
    }
}

/// The other file of a header and image pair, where `path` is one and the other exists.
pub(crate) fn other_half(path: &Path) -> Option<PathBuf> {
    Half::of(path)?.partner(path).ok()
}

/// Splits a file name into its stem and its NIfTI extension, ignoring case; `None` for other names.
fn nifti_stem(name: &str) -> Option<(&str, &'static str)> {
    const ENDINGS: [&str; 6] = [".nii.gz", ".hdr.gz", ".img.gz", ".nii", ".hdr", ".img"];
    ENDINGS.into_iter().find_map(|ending| {
        let at = name.len().checked_sub(ending.len())?;
        let (stem, tail) = (name.get(..at)?, name.get(at..)?);
        tail.eq_ignore_ascii_case(ending).then_some((stem, ending))
    })
}
