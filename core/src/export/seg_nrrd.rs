//! Segmentations as 3D Slicer stores them: NRRD whose header names the segments.

use std::{io::Write, path::Path};

use flate2::{Compression, GzBuilder};
use glam::DVec3;

use super::{NamedMask, Provenance, Stop, nothing_to_write, refused, write_file};
use crate::{
    Grid, Progress, Sides,
    files::{FileError, printable},
};

/// Compression level of gzip.
const GZIP_LEVEL: u32 = 6;
/// Labels of one layer: voxels are bytes, 0 is the background.
const MAX_LABELS: usize = 255;
/// Largest distance of two grids' corners that counts as none, in voxels.
const SAME_PLACE: f64 = 1e-3;

/// Writes `masks` as one `.seg.nrrd` file. Masks that don't overlap share a layer, each in the first layer
/// where it fits; within a layer labels count from 1. Masks without a voxel are segments too.
///
/// Voxels are bytes, gzipped; more than one layer makes the first axis of four. The place is given in LPS as
/// the format's custom is, with the digits that restore 64-bit floats. Where left and right are unknown, the
/// header has `space dimension` instead of `space`. Identifiers are `Segment_1`, `Segment_2` …. Provenance is
/// in keys that begin with `Glioscope_`. Takes the memory of one mask for each layer.
///
/// `verify` reads the written file back: it is put in place only when that accepts it.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason or that of `verify`, without masks, or naming two masks on
/// different grids; [`FileError::Cancelled`].
pub fn write_seg_nrrd(
    path: &Path,
    masks: &[NamedMask<'_>],
    provenance: &Provenance,
    progress: &Progress,
    verify: impl FnOnce(&Path) -> Result<(), String>,
) -> Result<(), FileError> {
    let first = masks.first().ok_or_else(|| nothing_to_write(path))?;
    let grid = first.mask.grid();
    let elsewhere = |named: &&NamedMask<'_>| {
        let other = named.mask.grid();
        !grid.same_place(other, SAME_PLACE) || grid.sides() != other.sides()
    };
    if let Some(other) = masks.iter().find(elsewhere) {
        let [a, b] = [first.name, other.name].map(printable);
        let found = format!("masks \"{a}\" and \"{b}\" on different grids");
        return Err(refused(path, found, "masks on one grid"));
    }
    let (places, layers) = layers_of(masks);
    let header = header(grid, masks, &places, layers, provenance);
    let encode = |out: &mut dyn Write| {
        out.write_all(header.as_bytes())?;
        let mut packed = GzBuilder::new().mtime(0).write(out, Compression::new(GZIP_LEVEL));
        write_voxels(masks, &places, layers, &mut packed, progress)?;
        packed.finish()?;
        Ok(())
    };
    write_file(path, ".seg.nrrd", encode, verify)
}

/// Where a mask is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    layer: usize,
    label: u8,
}

/// The place of each mask, and the number of layers.
fn layers_of(masks: &[NamedMask<'_>]) -> (Vec<Place>, usize) {
    // The words of all masks of a layer together, and their number.
    let mut layers: Vec<(Vec<u64>, usize)> = Vec::new();
    let place = |named: &NamedMask<'_>| {
        let words = named.mask.bits().words();
        let fits = |(taken, labels): &(Vec<u64>, usize)| {
            *labels < MAX_LABELS && taken.iter().zip(words).all(|(a, b)| a & b == 0)
        };
        let layer = layers.iter().position(fits).unwrap_or(layers.len());
        if layer == layers.len() {
            layers.push((vec![0; words.len()], 0));
        }
        let (taken, labels) = &mut layers[layer];
        taken.iter_mut().zip(words).for_each(|(a, b)| *a |= b);
        *labels += 1;
        Place { layer, label: u8::try_from(*labels).unwrap_or(u8::MAX) }
    };
    let places = masks.iter().map(place).collect();
    (places, layers.len())
}

fn header(
    grid: &Grid,
    masks: &[NamedMask<'_>],
    places: &[Place],
    layers: usize,
    provenance: &Provenance,
) -> String {
    let [nx, ny, nz] = grid.dims();
    // Adding 0 makes 0 of -0.
    let sign = if grid.sides() == Sides::Known { DVec3::new(-1.0, -1.0, 1.0) } else { DVec3::ONE };
    let vector = |v: DVec3| {
        let [x, y, z] = (v * sign + 0.0).to_array();
        format!("({x},{y},{z})")
    };
    let m = grid.world_from_voxel();
    let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(vector);
    let space = match grid.sides() {
        Sides::Known => "space: left-posterior-superior",
        Sides::Unknown => "space dimension: 3",
    };
    let (dimension, size, none, list) =
        if layers > 1 { (4, format!("{layers} "), "none ", "list ") } else { (3, String::new(), "", "") };
    let mut lines = vec![
        "NRRD0004".to_owned(),
        "type: uchar".into(),
        format!("dimension: {dimension}"),
        space.into(),
        format!("sizes: {size}{nx} {ny} {nz}"),
        format!("space directions: {none}{x} {y} {z}"),
        format!("kinds: {list}domain domain domain"),
        "endian: little".into(),
        "encoding: gzip".into(),
        format!("space origin: {}", vector(m.translation)),
    ];
    for (k, (named, place)) in masks.iter().zip(places).enumerate() {
        let [r, g, b] = named.color.map(|c| f64::from(c) / 255.0);
        let extent = match named.mask.bits().bounds() {
            Some((lo, size)) => [0, 1, 2].map(|a| format!("{} {}", lo[a], lo[a] + size[a] - 1)).join(" "),
            None => "0 -1 0 -1 0 -1".into(),
        };
        let mut add = |key: &str, value: &str| lines.push(format!("Segment{k}_{key}:={}", escaped(value)));
        add("Color", &format!("{r:.6} {g:.6} {b:.6}"));
        add("ColorAutoGenerated", "0");
        add("Extent", &extent);
        add("ID", &format!("Segment_{}", k + 1));
        add("LabelValue", &place.label.to_string());
        add("Layer", &place.layer.to_string());
        add("Name", &printable(named.name));
        add("NameAutoGenerated", "0");
        add("Tags", "|");
    }
    lines.push("Segmentation_ContainedRepresentationNames:=Binary labelmap|".into());
    lines.push("Segmentation_MasterRepresentation:=Binary labelmap".into());
    lines.push("Segmentation_ReferenceImageExtentOffset:=0 0 0".into());
    for (key, value) in provenance.lines() {
        lines.push(format!("Glioscope_{key}:={}", escaped(&value)));
    }
    lines.join("\n") + "\n\n"
}

/// A value of one line as the format escapes it.
fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\")
}

fn write_voxels(
    masks: &[NamedMask<'_>],
    places: &[Place],
    layers: usize,
    out: &mut dyn Write,
    progress: &Progress,
) -> Result<(), Stop> {
    let Some([nx, ny, nz]) = masks.first().map(|named| named.mask.grid().dims()) else { return Ok(()) };
    let mut slice = vec![0; layers * nx * ny];
    progress.expect(nz as u64);
    for z in 0..nz {
        slice.fill(0);
        for (named, place) in masks.iter().zip(places) {
            let bits = named.mask.bits();
            let words = bits.words().chunks_exact(bits.words_per_line()).skip(z * ny).take(ny);
            for (line, to) in words.zip(slice.chunks_exact_mut(layers * nx)) {
                for (w, &word) in line.iter().enumerate() {
                    let mut remaining = word;
                    while remaining != 0 {
                        let x = w * 64 + remaining.trailing_zeros() as usize;
                        to[layers * x + place.layer] = place.label;
                        remaining &= remaining - 1;
                    }
                }
            }
        }
        out.write_all(&slice)?;
        progress.advance(1)?;
    }
    Ok(())
}
