//! TrackVis `.trk`, versions 1 to 3: a header of 1000 bytes, then for each fibre its number of
//! points, the points with their scalars, and its properties. From trackvis.org's "Track File
//! Format"; where that is ambiguous, as in nibabel 5.4 (`nibabel.streamlines.trk`).
//!
//! Points are in "voxelmm": voxel size times voxels, from the *corner* of the first voxel, along the axes that
//! `voxel_order` names. So a point p is at voxel `p / voxel_size - 1/2` (centres at whole numbers) in that order.
//! `vox_to_ras` maps voxels in an order of its own to RAS+: where the two orders differ, axes are permuted and flipped
//! first.
//!
//! The header names up to ten scalars of points and ten properties of fibres, 20 bytes each. nibabel writes data of
//! several columns under one name, followed by a zero and the number of columns.

use glam::{DAffine3, DMat3, DVec3};

use super::bounded_gzip::{CHUNK_BYTES, Stream};
use super::nifti_header::ByteOrder;
use super::tracts::{FiberBuilder, LoadedTracts, base_name, check_trailing, count_check, f32_at};
use super::{FileError, printable};
use crate::{Check, Grid, ScalarPer, Sides, TractScalar};

/// First bytes of a file.
pub(super) const MAGIC: &[u8; 5] = b"TRACK";

const HEADER_BYTES: usize = 1000;
/// Bytes of a name of a scalar or a property, and how many names a header has room for.
const NAME_BYTES: usize = 20;
const NAMES: usize = 10;
/// The most scalars and properties read; more are left out, with a finding.
const MOST_SCALARS: usize = 64;

struct Header {
    order: ByteOrder,
    /// Numbers of values of a point besides its place, and of a fibre.
    scalars: usize,
    properties: usize,
    /// The names of those that are read.
    scalar_names: Vec<String>,
    property_names: Vec<String>,
    /// Number of fibres; 0: not declared.
    count: u64,
    ras_from_voxelmm: DAffine3,
    sides: Sides,
    checks: Vec<Check>,
}

/// Reads the file from after [`MAGIC`].
pub(super) fn read(mut stream: Stream<'_>) -> Result<LoadedTracts, FileError> {
    let file = stream.file().to_owned();
    let mut bytes = [0; HEADER_BYTES];
    let (first, rest) = bytes.split_at_mut(MAGIC.len());
    first.copy_from_slice(MAGIC);
    stream.fill_all(rest, "the 1000 bytes of a .trk's header")?;
    let Header {
        order,
        scalars,
        properties,
        scalar_names,
        property_names,
        count,
        ras_from_voxelmm,
        sides,
        mut checks,
    } = header(&bytes, &file)?;

    let record = 4 * (3 + scalars);
    let mut builder = FiberBuilder::with_capacity(stream.remaining() / record as u64, &file)?;
    let mut point_values: Vec<Vec<f32>> = vec![Vec::new(); scalar_names.len()];
    let mut fiber_values: Vec<Vec<f32>> = vec![Vec::new(); property_names.len()];
    let mut buffer = vec![0; CHUNK_BYTES / record * record];
    let mut extra = vec![0; 4 * properties];
    while stream.remaining() > 0 && (count == 0 || (builder.fibers() as u64) < count) {
        let fiber = builder.fibers();
        let mut four = [0; 4];
        stream.fill_all(&mut four, "the number of points of a fibre")?;
        let points = i32_at(&four, 0, order);
        let needs =
            u64::try_from(points).ok().map(|n| (n * record as u64, n * record as u64 + extra.len() as u64));
        let Some((mut bytes, _)) = needs.filter(|&(_, all)| all <= stream.remaining()) else {
            let found = format!("{points} points in fibre {fiber}, with {} bytes left", stream.remaining());
            let expected = format!("points of {record} bytes and {} bytes of properties", extra.len());
            return Err(FileError::wrong(file, found, expected));
        };
        while bytes > 0 {
            let part = usize::try_from(bytes).map_or(buffer.len(), |b| b.min(buffer.len()));
            stream.fill_all(&mut buffer[..part], "the points of a fibre")?;
            for point in buffer[..part].chunks_exact(record) {
                let p = DVec3::from_array([0, 4, 8].map(|at| f32_at(point, at, order)));
                builder.push(ras_from_voxelmm.transform_point3(p).to_array(), &file)?;
                take_values(&mut point_values, &point[12..], order);
            }
            bytes -= part as u64;
        }
        stream.fill_all(&mut extra, "the properties of a fibre")?;
        take_values(&mut fiber_values, &extra, order);
        builder.end_fiber();
    }

    let name = base_name(&file);
    let fibers = builder.fibers() as u64;
    if count > fibers {
        checks.push(count_check(&name, count, fibers));
    }
    let of = |names: Vec<String>, per, values: Vec<Vec<f32>>| {
        names.into_iter().zip(values).map(move |(name, values)| TractScalar::new(name, per, values))
    };
    let scalars = of(scalar_names, ScalarPer::Point, point_values);
    let scalars = scalars.chain(of(property_names, ScalarPer::Fiber, fiber_values)).collect();
    let tracts = builder.finish(sides, &file)?.with_scalars(scalars);
    let tracts = tracts.ok_or_else(|| {
        FileError::wrong(&file, "scalars that don't fit their points", "one for each point")
    })?;
    check_trailing(stream, &name, &mut checks)?;
    Ok(LoadedTracts { tracts, timestamp: None, checks })
}

/// Adds the values of a point or a fibre, one to each list; further ones aren't read.
fn take_values(lists: &mut [Vec<f32>], bytes: &[u8], order: ByteOrder) {
    for (n, list) in lists.iter_mut().enumerate() {
        list.push(f32_at(bytes, 4 * n, order) as f32);
    }
}

/// Names of the first `count` values, at most [`MOST_SCALARS`], from a header's `fields`: `kind` with a number where a
/// field says none.
fn names(fields: &[u8], count: usize, kind: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let most = count.min(MOST_SCALARS);
    for field in fields.chunks_exact(NAME_BYTES).take(NAMES) {
        let mut parts = field.split(|&b| b == 0);
        let text = String::from_utf8_lossy(parts.next().unwrap_or_default());
        let name = printable(text.trim());
        if name.is_empty() {
            continue;
        }
        let columns = parts.next().and_then(|digits| std::str::from_utf8(digits).ok()?.parse().ok());
        let columns: usize = columns.unwrap_or(1).clamp(1, MOST_SCALARS);
        match columns {
            1 => names.push(name),
            _ => names.extend((1..=columns).map(|column| format!("{name} {column}"))),
        }
    }
    names.truncate(most);
    let named = names.len();
    names.extend((named..most).map(|n| format!("{kind} {}", n + 1)));
    names
}

fn i32_at(bytes: &[u8], at: usize, order: ByteOrder) -> i32 {
    let four = bytes.get(at..).and_then(|b| b.first_chunk()).copied().unwrap_or_default();
    match order {
        ByteOrder::Little => i32::from_le_bytes(four),
        ByteOrder::Big => i32::from_be_bytes(four),
    }
}

fn i16_at(bytes: &[u8], at: usize, order: ByteOrder) -> i16 {
    let two = bytes.get(at..).and_then(|b| b.first_chunk()).copied().unwrap_or_default();
    match order {
        ByteOrder::Little => i16::from_le_bytes(two),
        ByteOrder::Big => i16::from_be_bytes(two),
    }
}

fn header(bytes: &[u8; HEADER_BYTES], file: &str) -> Result<Header, FileError> {
    let wrong = |found: String, expected: &str| FileError::wrong(file, found, expected);
    let order = match (i32_at(bytes, 996, ByteOrder::Little), i32_at(bytes, 996, ByteOrder::Big)) {
        (1000, _) => ByteOrder::Little,
        (_, 1000) => ByteOrder::Big,
        (other, _) => {
            return Err(wrong(format!("header size {other}"), "1000, in either byte order"));
        }
    };
    let version = i32_at(bytes, 992, order);
    if !(1..=3).contains(&version) {
        return Err(wrong(format!("version {version} of .trk"), "version 1, 2 or 3"));
    }
    let count_at = |at: usize, what: &str| {
        let n = i16_at(bytes, at, order);
        usize::try_from(n).map_err(|_| wrong(format!("{n} {what}"), "0 or more"))
    };
    let (scalars, properties) = (count_at(36, "scalars a point")?, count_at(238, "properties a fibre")?);
    let scalar_names = names(&bytes[38..][..NAMES * NAME_BYTES], scalars, "scalar");
    let property_names = names(&bytes[240..][..NAMES * NAME_BYTES], properties, "property");
    let count = i32_at(bytes, 988, order);
    let count = u64::try_from(count).map_err(|_| wrong(format!("{count} fibres"), "0 or more"))?;
    let sizes = DVec3::from_array([12, 16, 20].map(|at| f32_at(bytes, at, order)));
    if !(sizes.is_finite() && sizes.min_element() > 0.0) {
        let found = format!("voxels of {} × {} × {} mm", sizes.x, sizes.y, sizes.z);
        return Err(wrong(found, "finite sizes above 0"));
    }
    let dims = [6, 8, 10].map(|at| i16_at(bytes, at, order));

    let name = base_name(file);
    let mut checks = Vec::new();
    for (found, kind) in [(scalars, "scalars a point"), (properties, "properties a fibre")] {
        if found > MOST_SCALARS {
            let text = format!(
                "{name}: found {found} {kind}, expected at most {MOST_SCALARS}; the others are not read"
            );
            checks.push(Check::warning("tracts-scalars-left-out", text));
        }
    }
    if version > 2 {
        checks.push(Check::warning(
            "tracts-version",
            format!(
                "{name}: found version {version} of .trk, expected 1 or 2, which are described; read as 2"
            ),
        ));
    }
    let file_order = voxel_order(&bytes[948..952], &name, &mut checks).ok_or_else(|| {
        let found = String::from_utf8_lossy(&bytes[948..952]).escape_debug().to_string();
        wrong(format!("voxel_order {found}"), "one of each of L or R, A or P, I or S")
    })?;
    let vox_to_ras = vox_to_ras(bytes, order, version, file)?;
    if vox_to_ras.is_none() {
        checks.push(Check::warning(
            "tracts-place-unknown",
            format!(
                "{name}: found no vox_to_ras (version {version}), expected a place in the patient; the points \
                 are millimetres from the first voxel, and no distance to a mask is reported"
            ),
        ));
    }
    let sides = if vox_to_ras.is_some() { Sides::Known } else { Sides::Unknown };
    let (ras_from_voxel, matrix_order) =
        vox_to_ras.unwrap_or_else(|| (DAffine3::from_scale(to_ras_axes(sizes, file_order)), RAS));
    if sides == Sides::Known && file_order != matrix_order {
        let letters = |o: [Axis; 3]| -> String { o.iter().map(|a| a.letter()).collect() };
        checks.push(Check::note(
            "tracts-order-differs",
            format!(
                "{name}: found voxel order {} beside a vox_to_ras of {}; axes are swapped and turned, as \
                 nibabel does",
                letters(file_order),
                letters(matrix_order)
            ),
        ));
    }
    let reordered = reorder(file_order, matrix_order, dims)
        .ok_or_else(|| wrong(format!("dimensions {dims:?}"), "sizes of at least 1, to turn an axis"))?;
    let voxel_from_voxelmm =
        DAffine3 { matrix3: DMat3::from_diagonal(sizes.recip()), translation: DVec3::splat(-0.5) };
    let ras_from_voxelmm = ras_from_voxel * reordered * voxel_from_voxelmm;
    Ok(Header {
        order,
        scalars,
        properties,
        scalar_names,
        property_names,
        count,
        ras_from_voxelmm,
        sides,
        checks,
    })
}

/// An anatomical axis (0 R–L, 1 A–P, 2 S–I) and whether it runs towards R, A or S.
#[derive(Clone, Copy, PartialEq)]
struct Axis {
    line: usize,
    forward: bool,
}

const RAS: [Axis; 3] =
    [Axis { line: 0, forward: true }, Axis { line: 1, forward: true }, Axis { line: 2, forward: true }];

impl Axis {
    fn of(letter: char) -> Option<Self> {
        "LPIRAS".find(letter).map(|at| Self { line: at % 3, forward: at >= 3 })
    }

    fn letter(self) -> char {
        [['L', 'R'], ['P', 'A'], ['I', 'S']][self.line][usize::from(self.forward)]
    }
}

/// The header's `voxel_order`; `None` when it is invalid. Empty means LPS, TrackVis' default.
fn voxel_order(field: &[u8], name: &str, checks: &mut Vec<Check>) -> Option<[Axis; 3]> {
    let letters: Vec<char> = field.iter().take_while(|&&b| b != 0).map(|&b| char::from(b)).collect();
    let text = letters.iter().collect::<String>().trim().to_ascii_uppercase();
    let text = if text.is_empty() {
        checks.push(Check::warning(
            "tracts-voxel-order",
            format!("{name}: found no voxel_order, expected one; taken as LPS, as TrackVis and nibabel do"),
        ));
        "LPS".into()
    } else {
        text
    };
    let axes: Vec<Axis> = text.chars().map(Axis::of).collect::<Option<_>>()?;
    let axes: [Axis; 3] = axes.try_into().ok()?;
    (0..3).all(|line| axes.iter().any(|a| a.line == line)).then_some(axes)
}

/// Sizes along R, A and S from `sizes` along the axes of `order`.
fn to_ras_axes(sizes: DVec3, order: [Axis; 3]) -> DVec3 {
    let mut out = DVec3::ONE;
    for (axis, size) in order.into_iter().zip(sizes.to_array()) {
        out[axis.line] = size;
    }
    out
}

/// `vox_to_ras` and its voxel order; `None` where the file has none: before version 2, or with 0 as the last entry.
fn vox_to_ras(
    bytes: &[u8],
    order: ByteOrder,
    version: i32,
    file: &str,
) -> Result<Option<(DAffine3, [Axis; 3])>, FileError> {
    let at = |row: usize, column: usize| f32_at(bytes, 440 + 4 * (4 * row + column), order);
    if version < 2 || at(3, 3) == 0.0 {
        return Ok(None);
    }
    let column = |c: usize| DVec3::new(at(0, c), at(1, c), at(2, c));
    let matrix =
        DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) };
    let wrong = |found: String| FileError::wrong(file, found, "a vox_to_ras that maps voxels to millimetres");
    if [at(3, 0), at(3, 1), at(3, 2), at(3, 3)] != [0.0, 0.0, 0.0, 1.0] {
        return Err(wrong("a vox_to_ras whose last row is not 0 0 0 1".into()));
    }
    let grid = Grid::new([1; 3], matrix, Sides::Known).map_err(|e| wrong(format!("vox_to_ras: {e}")))?;
    let axes = grid.axis_codes().map(|letter| Axis::of(letter).unwrap_or(RAS[0]));
    Ok(Some((matrix, axes)))
}

/// Maps voxel indices in the order `from` to the order `to`; `dims` are the image's dimensions in `from`. `None` when
/// an axis without voxels would have to be flipped.
fn reorder(from: [Axis; 3], to: [Axis; 3], dims: [i16; 3]) -> Option<DAffine3> {
    let (mut columns, mut translation) = ([DVec3::ZERO; 3], DVec3::ZERO);
    for (source, axis) in from.into_iter().enumerate() {
        let target = to.iter().position(|t| t.line == axis.line)?;
        if to[target].forward == axis.forward {
            columns[source][target] = 1.0;
        } else {
            if dims[source] < 1 {
                return None;
            }
            columns[source][target] = -1.0;
            translation[target] = f64::from(dims[source]) - 1.0;
        }
    }
    let [x, y, z] = columns;
    Some(DAffine3 { matrix3: DMat3::from_cols(x, y, z), translation })
}
