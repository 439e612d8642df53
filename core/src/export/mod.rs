//! Masks for other programs: closed surfaces as STL, OBJ and binary glTF, and segmentations as `.seg.nrrd`.
//!
//! Every file is written whole or not at all and has the same bytes for the same input. Names are on one line.
//! Which inputs, selection and version of the program a file comes from is stated where its format has room.
//!
//! ```
//! use glioscope_core::{Grid, Mask, MaskBits, Progress, export, glam::DVec3};
//!
//! let grid = Grid::axis_aligned([4, 4, 4], DVec3::new(1.0, 1.0, 5.0), DVec3::ZERO)?;
//! let mask = Mask::new("T1", grid, MaskBits::full([4, 4, 4])).ok_or("other dimensions")?;
//! let progress = Progress::new();
//! let surface = export::mesh(&mask, export::SurfaceKind::VoxelFaces, &progress)?;
//! assert!((surface.volume_mm3() - 4.0 * 4.0 * 20.0).abs() < 1e-9);
//!
//! let folder = tempfile::tempdir()?;
//! export::write_stl(&folder.path().join("T1.stl"), &surface, &progress)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::{
    io::{BufWriter, Write},
    path::Path,
};

use crate::{
    Cancelled, Mask, Progress, Sides,
    files::{FileError, printable, write_failed, write_whole_with},
};

mod faces;
mod glb;
mod mesh;
mod obj;
mod seg_nrrd;
mod smooth;
mod stl;

pub use faces::MeshError;
pub use glb::write_glb;
pub use mesh::{Mesh, SurfaceKind, mesh};
pub use obj::{material_file, write_obj};
pub use seg_nrrd::write_seg_nrrd;
pub use stl::write_stl;

/// A surface with what a file states of it.
#[derive(Clone, Copy, Debug)]
pub struct NamedMesh<'a> {
    /// Its name; misleading characters are escaped.
    pub name: &'a str,
    /// Its colour, sRGB.
    pub color: [u8; 3],
    /// Its triangles.
    pub mesh: &'a Mesh,
}

/// A mask with what a file states of it.
#[derive(Clone, Copy, Debug)]
pub struct NamedMask<'a> {
    /// Its name; misleading characters are escaped.
    pub name: &'a str,
    /// Its colour, sRGB.
    pub color: [u8; 3],
    /// Its voxels.
    pub mask: &'a Mask,
}

/// What a file comes from. No patient data but what the caller puts here.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// One line for each input: its name and hash.
    pub inputs: Vec<String>,
    /// What was selected of them, in one line; empty: everything.
    pub selection: String,
}

/// Name and version of the program.
const PROGRAM: &str = concat!("Glioscope ", env!("CARGO_PKG_VERSION"));

impl Provenance {
    /// The program, the selection where there is one, and the inputs, each as a key and a value on one line.
    fn lines(&self) -> Vec<(String, String)> {
        let selection = (!self.selection.is_empty()).then_some(("Selection".into(), &self.selection));
        let inputs = self.inputs.iter().enumerate().map(|(i, input)| (format!("Input{i}"), input));
        let stated = selection.into_iter().chain(inputs).map(|(key, value)| (key, printable(value)));
        std::iter::once(("Program".into(), PROGRAM.into())).chain(stated).collect()
    }
}

/// The frame of a surface's coordinates, as 3D Slicer states it in the headers of STL and OBJ files, without
/// which it assumes LPS.
fn frame(sides: Sides) -> &'static str {
    match sides {
        Sides::Known => "SPACE=RAS;UNIT=mm",
        Sides::Unknown => "UNIT=mm, left and right unknown",
    }
}

/// Known where they are known of every surface.
fn common_sides(meshes: &[NamedMesh<'_>]) -> Sides {
    let known = meshes.iter().all(|named| named.mesh.sides() == Sides::Known);
    if known { Sides::Known } else { Sides::Unknown }
}

/// Why encoding stopped.
#[derive(Debug, thiserror::Error)]
enum Stop {
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl Stop {
    fn at(self, path: &Path) -> FileError {
        match self {
            Self::Io(why) => write_failed(path, &why),
            Self::Cancelled(cancelled) => cancelled.into(),
        }
    }
}

/// Triangles or vertices written between two looks at whether the user cancelled.
const BATCH: usize = 1 << 14;

/// Writes `items` one by one, and advances by their number.
fn write_each<T>(
    items: &[T],
    progress: &Progress,
    mut write: impl FnMut(&T) -> std::io::Result<()>,
) -> Result<(), Stop> {
    progress.expect(items.len() as u64);
    for batch in items.chunks(BATCH) {
        batch.iter().try_for_each(&mut write)?;
        progress.advance(batch.len() as u64)?;
    }
    Ok(())
}

/// Writes a file whole or not at all: what `encode` writes, put in place when `verify` accepts it.
fn write_file(
    path: &Path,
    suffix: &'static str,
    encode: impl FnOnce(&mut dyn Write) -> Result<(), Stop>,
    verify: impl FnOnce(&Path) -> Result<(), String>,
) -> Result<(), FileError> {
    write_whole_with(path, suffix, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file.as_file_mut());
        encode(&mut out).map_err(|stop| stop.at(path))?;
        out.flush().map_err(|why| write_failed(path, &why))?;
        drop(out);
        verify(file.path())
            .map_err(|why| refused(path, format!("{why} when read back"), "the masks that were written"))
    })
}

/// The error of content that `path` can't have.
fn refused(path: &Path, found: impl Into<String>, expected: &str) -> FileError {
    let file = printable(&path.display().to_string());
    FileError::Wrong { file, found: found.into(), expected: expected.into() }
}

/// The error of a file without content.
fn nothing_to_write(path: &Path) -> FileError {
    refused(path, "nothing to write", "at least one mask")
}

#[cfg(test)]
mod tests;
