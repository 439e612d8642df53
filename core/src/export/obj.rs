//! Wavefront OBJ with its materials.

use std::{
    collections::HashSet,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use super::{NamedMesh, Provenance, Stop, common_sides, frame, nothing_to_write, refused, write_each};
use crate::{
    Progress,
    files::{FileError, is_misleading, replace_files, temporary_folder, write_failed, write_whole_with},
};

/// The file beside an OBJ file that holds its materials, and is written over with it.
pub fn material_file(path: &Path) -> PathBuf {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(material_name(&stem))
}

fn material_name(stem: &str) -> String {
    format!("{}.mtl", identifier(stem))
}

/// Writes `meshes` as objects of one OBJ file, and beside it their colours: a file of the same name that ends
/// in `.mtl`. Both are put in place together. A comment states the provenance and the frame
/// (`SPACE=RAS;UNIT=mm`, which 3D Slicer reads).
///
/// Coordinates are RAS millimetres with the digits that restore their 64-bit floats. Names of objects and
/// materials are the meshes', with `_` for white space, `#`, `\` and misleading characters; a name that
/// occurred before gets a number. Colours (`Kd`) are sRGB from 0 to 1. Takes no memory of the meshes' size.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason, without meshes, or where the file's name ends in `.mtl` or is
/// not Unicode; [`FileError::Cancelled`].
pub fn write_obj(
    path: &Path,
    meshes: &[NamedMesh<'_>],
    provenance: &Provenance,
    progress: &Progress,
) -> Result<(), FileError> {
    if meshes.is_empty() {
        return Err(nothing_to_write(path));
    }
    let (Some(name), Some(stem)) =
        (path.file_name().and_then(|n| n.to_str()), path.file_stem().and_then(|n| n.to_str()))
    else {
        return Err(write_failed(path, &"a name that is not Unicode"));
    };
    let materials = material_name(stem);
    if name.eq_ignore_ascii_case(&materials) {
        return Err(refused(path, "a name that ends in .mtl", "another, as that is the materials' file"));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    for target in [path, &folder.join(&materials)] {
        // They are renamed over what is there.
        if target.metadata().is_ok_and(|m| !m.is_file() || m.permissions().readonly()) {
            return Err(write_failed(target, &"something that is no ordinary file, or write-protected"));
        }
    }
    let names = identifiers(meshes);
    let together = temporary_folder(folder)?;
    let write = |name: &str, encode: &dyn Fn(&mut dyn Write) -> Result<(), Stop>| {
        write_whole_with(&together.path().join(name), "", |file| {
            let mut out = BufWriter::with_capacity(1 << 20, file.as_file_mut());
            encode(&mut out).map_err(|stop| stop.at(path))?;
            out.flush().map_err(|why| write_failed(path, &why))
        })
    };
    write(&materials, &|out| encode_materials(meshes, &names, out))?;
    write(name, &|out| encode(meshes, &names, &materials, provenance, out, progress))?;
    replace_files(&together, folder, &[materials, name.to_owned()], &[])
}

fn encode_materials(meshes: &[NamedMesh<'_>], names: &[String], out: &mut dyn Write) -> Result<(), Stop> {
    for (named, name) in meshes.iter().zip(names) {
        let [r, g, b] = named.color.map(|c| f64::from(c) / 255.0);
        writeln!(out, "newmtl {name}\nKd {r:.4} {g:.4} {b:.4}\nd 1\nillum 1")?;
    }
    Ok(())
}

fn encode(
    meshes: &[NamedMesh<'_>],
    names: &[String],
    materials: &str,
    provenance: &Provenance,
    out: &mut dyn Write,
    progress: &Progress,
) -> Result<(), Stop> {
    writeln!(out, "# {}", frame(common_sides(meshes)))?;
    for (key, value) in provenance.lines() {
        // A backslash at the end would continue the comment on the next line.
        writeln!(out, "# {key}: {}", value.replace('\\', "/"))?;
    }
    writeln!(out, "mtllib {materials}")?;
    // Vertices are numbered from 1, through all objects.
    let mut first = 1;
    for (named, name) in meshes.iter().zip(names) {
        writeln!(out, "o {name}\nusemtl {name}")?;
        write_each(named.mesh.positions_mm(), progress, |p| writeln!(out, "v {} {} {}", p.x, p.y, p.z))?;
        write_each(named.mesh.triangles(), progress, |triangle| {
            let [a, b, c] = triangle.map(|vertex| u64::from(vertex) + first);
            writeln!(out, "f {a} {b} {c}")
        })?;
        first += named.mesh.positions_mm().len() as u64;
    }
    Ok(())
}

/// A name as one word.
fn identifier(name: &str) -> String {
    let is_unsafe = |c: char| c.is_whitespace() || is_misleading(c) || matches!(c, '#' | '\\');
    let word: String = name.chars().map(|c| if is_unsafe(c) { '_' } else { c }).collect();
    if word.is_empty() { "unnamed".into() } else { word }
}

/// The names as different words.
fn identifiers(meshes: &[NamedMesh<'_>]) -> Vec<String> {
    let mut taken = HashSet::new();
    let unique = |named: &NamedMesh<'_>| {
        let word = identifier(named.name);
        let numbered = (2_usize..).map(|n| format!("{word}_{n}"));
        std::iter::once(word.clone())
            .chain(numbered)
            .find(|w| taken.insert(w.clone()))
            .unwrap_or(word.clone())
    };
    meshes.iter().map(unique).collect()
}
