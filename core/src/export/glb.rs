//! Binary glTF 2.0.

use std::{io::Write, path::Path};

use glam::DVec3;
use serde_json::{Value, json};

use super::{
    NamedMesh, PROGRAM, Provenance, common_sides, nothing_to_write, refused, write_each, write_file,
};
use crate::{
    Progress, Sides,
    files::{FileError, printable},
};

/// glTF from RAS millimetres, columns R, A, S and translation: metres, x left, y superior, z anterior, so that
/// the patient stands upright and faces the viewer.
const GLTF_FROM_MM: [f64; 16] =
    [-0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.001, 0.0, 0.0, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// Writes `meshes` as nodes of one binary glTF file (`.glb`), each with its name and colour.
///
/// glTF has metres and y upwards: the root node's matrix leads there from RAS millimetres. Each mesh's node
/// below it has a translation in millimetres, and coordinates relative to it as 32-bit floats (error at most
/// 2⁻²⁴ of half the mesh's extent): their sum is the place in RAS millimetres, however far from the origin.
/// `asset.extras` states this and the provenance. Smoothed surfaces have normals, voxel faces are flat. Names
/// stay, but for misleading characters, which are escaped. Takes the memory of one mesh's normals.
///
/// # Errors
/// [`FileError::Wrong`] with the system's reason, without meshes, or with 4 GiB or more, which the format can't
/// have; [`FileError::Cancelled`].
pub fn write_glb(
    path: &Path,
    meshes: &[NamedMesh<'_>],
    provenance: &Provenance,
    progress: &Progress,
) -> Result<(), FileError> {
    if meshes.is_empty() {
        return Err(nothing_to_write(path));
    }
    let mut content = Content::default();
    meshes.iter().for_each(|named| content.add(named));
    let mut json = content.json(meshes, provenance).to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    // Header, two chunks with their sizes and types.
    let lengths = [28 + json.len() + content.bytes, json.len(), content.bytes].map(u32::try_from);
    let [Ok(total), Ok(json_bytes), Ok(binary_bytes)] = lengths else {
        let found = format!("{} bytes of triangles", content.bytes);
        return Err(refused(path, found, "less than 4 GiB for glTF"));
    };
    let encode = |out: &mut dyn Write| {
        let head = [*b"glTF", 2u32.to_le_bytes(), total.to_le_bytes(), json_bytes.to_le_bytes(), *b"JSON"];
        out.write_all(head.as_flattened())?;
        out.write_all(&json)?;
        out.write_all([binary_bytes.to_le_bytes(), *b"BIN\0"].as_flattened())?;
        for (named, origin_mm) in meshes.iter().zip(&content.origins_mm) {
            let vector =
                |out: &mut dyn Write, v: DVec3| out.write_all(floats(v).map(f32::to_le_bytes).as_flattened());
            write_each(named.mesh.positions_mm(), progress, |&p| vector(out, p - *origin_mm))?;
            if let Some(normals) = named.mesh.normals() {
                write_each(&normals, progress, |&n| vector(out, n.try_normalize().unwrap_or(DVec3::Z)))?;
            }
            write_each(named.mesh.triangles(), progress, |triangle| {
                out.write_all(triangle.map(u32::to_le_bytes).as_flattened())
            })?;
        }
        Ok(())
    };
    write_file(path, ".glb", encode, |_| Ok(()))
}

fn floats(vector: DVec3) -> [f32; 3] {
    vector.as_vec3().to_array()
}

/// What the binary chunk holds.
#[derive(Default)]
struct Content {
    bytes: usize,
    views: Vec<Value>,
    accessors: Vec<Value>,
    primitives: Vec<Value>,
    origins_mm: Vec<DVec3>,
}

impl Content {
    /// Adds a view of `count` elements of three numbers and its accessor; the accessor's index.
    fn add_view(&mut self, count: usize, target: u32, mut accessor: Value) -> usize {
        let bytes = 12 * count;
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.bytes, "byteLength": bytes, "target": target,
        }));
        self.accessors.push(accessor);
        self.bytes += bytes;
        self.accessors.len() - 1
    }

    fn add(&mut self, named: &NamedMesh<'_>) {
        const ARRAY_BUFFER: u32 = 34962;
        const ELEMENT_ARRAY_BUFFER: u32 = 34963;
        const FLOAT: u32 = 5126;
        const UNSIGNED_INT: u32 = 5125;
        let (positions, triangles) = (named.mesh.positions_mm(), named.mesh.triangles());
        let bounds = |origin: DVec3| {
            let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            positions.iter().fold(none, |(lo, hi), &p| (lo.min(p - origin), hi.max(p - origin)))
        };
        let (lo, hi) = bounds(DVec3::ZERO);
        // Whole millimetres: their digits are few, and the differences exact where positions are.
        let origin = ((lo + hi) * 0.5).round();
        self.origins_mm.push(origin);
        let (lo, hi) = bounds(origin);
        let vertices = positions.len();
        let stated = json!({
            "componentType": FLOAT, "count": vertices, "type": "VEC3", "min": floats(lo), "max": floats(hi),
        });
        let mut attributes = json!({"POSITION": self.add_view(vertices, ARRAY_BUFFER, stated)});
        if named.mesh.is_smooth() {
            let stated = json!({"componentType": FLOAT, "count": vertices, "type": "VEC3"});
            attributes["NORMAL"] = json!(self.add_view(vertices, ARRAY_BUFFER, stated));
        }
        let stated = json!({"componentType": UNSIGNED_INT, "count": 3 * triangles.len(), "type": "SCALAR"});
        let indices = self.add_view(triangles.len(), ELEMENT_ARRAY_BUFFER, stated);
        let material = self.primitives.len();
        self.primitives.push(json!({"attributes": attributes, "indices": indices, "material": material}));
    }

    fn json(&self, meshes: &[NamedMesh<'_>], provenance: &Provenance) -> Value {
        let names: Vec<String> = meshes.iter().map(|named| printable(named.name)).collect();
        let (space, frame) = match common_sides(meshes) {
            Sides::Known => ("RAS", "RAS millimetres"),
            Sides::Unknown => ("unknown", "millimetres, left and right unknown"),
        };
        let mut extras = json!({
            "space": space,
            "unit": "mm",
            "coordinates": format!(
                "{frame}: a vertex plus its node's translation; the root node's matrix maps them to glTF's \
                 metres (x left, y superior, z anterior)"
            ),
        });
        for (key, value) in provenance.lines() {
            extras[key.to_lowercase()] = json!(value);
        }
        let root = json!({
            "name": frame, "matrix": GLTF_FROM_MM, "children": Vec::from_iter(1..=meshes.len()),
        });
        let nodes =
            names.iter().zip(&self.origins_mm).enumerate().map(
                |(i, (name, origin))| json!({"name": name, "mesh": i, "translation": origin.to_array()}),
            );
        let materials = names.iter().zip(meshes).map(|(name, named)| {
            let [r, g, b] = named.color.map(linear);
            json!({
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8,
                },
            })
        });
        let parts = names.iter().zip(&self.primitives);
        json!({
            "asset": {"version": "2.0", "generator": PROGRAM, "extras": extras},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": Vec::from_iter(std::iter::once(root).chain(nodes)),
            "meshes": Vec::from_iter(parts.map(|(name, part)| json!({"name": name, "primitives": [part]}))),
            "materials": Vec::from_iter(materials),
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes}],
        })
    }
}

/// Linear light of an sRGB value (IEC 61966-2-1), rounded to six digits.
fn linear(value: u8) -> f64 {
    let encoded = f64::from(value) / 255.0;
    let light = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
    (light * 1e6).round() / 1e6
}
