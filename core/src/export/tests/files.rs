use std::path::Path;

use serde_json::Value;

use super::super::{NamedMesh, Provenance, write_glb, write_obj, write_stl};
use super::*;

fn provenance() -> Provenance {
    Provenance { inputs: vec!["T1.nii.gz 0123abcd\nsolid".into()], selection: "T1+T2\\".into() }
}

/// The bytes of what `write` writes.
fn written(write: impl Fn(&Path)) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out");
    write(&path);
    let bytes = std::fs::read(&path).unwrap();
    write(&path);
    assert!(std::fs::read(&path).unwrap() == bytes, "different bytes for the same input");
    bytes
}

fn stl(mesh: &Mesh) -> Vec<u8> {
    written(|path| write_stl(path, mesh, &Progress::new()).unwrap())
}

fn float(bytes: &[u8], at: usize) -> f64 {
    f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()).into()
}

fn vector(bytes: &[u8], at: usize) -> DVec3 {
    DVec3::new(float(bytes, at), float(bytes, at + 4), float(bytes, at + 8))
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Two meshes, the second 1 km away.
fn two() -> [Mesh; 2] {
    let near = &grids([5, 4, 3])[3];
    let far = DVec3::new(1e6 + 0.125, -1e6, 1e6);
    let far = Grid::axis_aligned([5, 4, 3], DVec3::new(0.7, 0.9, 3.1), far).unwrap();
    [
        surface(&mask_of(near, random([5, 4, 3], 50, 1)), SurfaceKind::VoxelFaces),
        surface(&mask_of(&far, random([5, 4, 3], 50, 2)), SurfaceKind::Smoothed),
    ]
}

fn named(meshes: &[Mesh; 2]) -> [NamedMesh<'_>; 2] {
    let [a, b] = meshes;
    [
        NamedMesh { name: "my # mask\\", color: [255, 0, 51], mesh: a },
        NamedMesh { name: "my\n_ mask_", color: [0, 128, 255], mesh: b },
    ]
}

#[test]
fn stl_has_each_triangle_with_its_normal() {
    for mesh in two() {
        let bytes = stl(&mesh);
        assert!(bytes.starts_with(b"Glioscope ") && !bytes.starts_with(b"solid"));
        assert!(String::from_utf8_lossy(&bytes[..80]).contains("SPACE=RAS;UNIT=mm"));
        assert_eq!(word(&bytes, 80), mesh.triangles().len());
        assert_eq!(bytes.len(), 84 + 50 * mesh.triangles().len());
        for (triangle, record) in mesh.triangles().iter().zip(bytes[84..].chunks_exact(50)) {
            let corners = triangle.map(|v| mesh.positions_mm()[v as usize]);
            for (i, corner) in corners.iter().enumerate() {
                // Rounded to 24 bits: 0.03 mm at 1 km.
                let error = (vector(record, 12 + 12 * i) - *corner).abs();
                assert!(error.cmple(corner.abs() * 2f64.powi(-24)).all(), "{error}");
            }
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            assert!((vector(record, 0) - normal).length() < 1e-6);
            assert_eq!(record[48..], [0, 0]);
        }
    }
}

#[test]
fn unknown_sides_are_not_called_ras() {
    let grid = Grid::new([1; 3], DAffine3::IDENTITY, Sides::Unknown).unwrap();
    let mesh = surface(&at_voxels(&grid, &[[0; 3]]), SurfaceKind::VoxelFaces);
    let header = String::from_utf8_lossy(&stl(&mesh)[..80]).into_owned();
    assert!(!header.contains("RAS") && header.contains("left and right unknown"), "{header}");
}

#[test]
fn obj_restores_every_coordinate_and_has_different_words_as_names() {
    let meshes = two();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two masks.obj");
    for _ in 0..2 {
        write_obj(&path, &named(&meshes), &provenance(), &Progress::new()).unwrap();
    }
    let text = std::fs::read_to_string(&path).unwrap();
    let mut names: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["two masks.obj", "two_masks.mtl"]);
    let materials = std::fs::read_to_string(folder.path().join("two_masks.mtl")).unwrap();
    assert!(materials.starts_with("newmtl my___mask_\nKd 1.0000 0.0000 0.2000\n"), "{materials}");
    assert!(materials.contains("\nnewmtl my___mask__2\nKd 0.0000 0.5020 1.0000\n"), "{materials}");

    assert!(text.starts_with("# SPACE=RAS;UNIT=mm\n# Program: Glioscope "), "{text}");
    assert!(
        text.contains("\n# Selection: T1+T2/\n# Input0: T1.nii.gz 0123abcd/nsolid\nmtllib two_masks.mtl\n")
    );
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut used = Vec::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "v" => positions.push([1, 2, 3].map(|i| words[i].parse::<f64>().unwrap())),
            "f" => triangles.push([1, 2, 3].map(|i| words[i].parse::<usize>().unwrap() - 1)),
            "o" | "usemtl" => used.push(words[1..].join(" ")),
            _ => {}
        }
    }
    assert_eq!(used, ["my___mask_", "my___mask_", "my___mask__2", "my___mask__2"]);
    let expected: Vec<DVec3> = meshes.iter().flat_map(|m| m.positions_mm()).copied().collect();
    assert_eq!(positions, expected.iter().map(|p| p.to_array()).collect::<Vec<_>>());
    let first = meshes[0].positions_mm().len();
    let shifted = |(mesh, first): (&Mesh, usize)| {
        mesh.triangles().iter().map(|t| t.map(|v| v as usize + first)).collect::<Vec<_>>()
    };
    assert_eq!(triangles, [(&meshes[0], 0), (&meshes[1], first)].map(shifted).concat());
}

/// The JSON and the binary chunk.
fn chunks(bytes: &[u8]) -> (Value, &[u8]) {
    assert_eq!((&bytes[..4], word(bytes, 4), word(bytes, 8)), (b"glTF".as_slice(), 2, bytes.len()));
    let end = 20 + word(bytes, 12);
    assert_eq!((&bytes[16..20], &bytes[end + 4..end + 8]), (b"JSON".as_slice(), b"BIN\0".as_slice()));
    assert!(end.is_multiple_of(4) && word(bytes, end) == bytes.len() - end - 8);
    (serde_json::from_slice(&bytes[20..end]).unwrap(), &bytes[end + 8..])
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn glb_restores_coordinates_however_far_away() {
    let meshes = two();
    let bytes = written(|path| write_glb(path, &named(&meshes), &provenance(), &Progress::new()).unwrap());
    let (json, binary) = chunks(&bytes);
    assert_eq!(json["buffers"][0]["byteLength"], binary.len());
    let extras = &json["asset"]["extras"];
    assert_eq!((&extras["space"], &extras["unit"]), (&Value::from("RAS"), &Value::from("mm")));
    assert_eq!(extras["selection"], "T1+T2\\");
    assert_eq!(extras["input0"], "T1.nii.gz 0123abcd\\nsolid");
    // Metres; left is x, superior y, anterior z.
    let matrix = numbers(&json["nodes"][0]["matrix"]);
    let column = |c: usize| DVec3::new(matrix[4 * c], matrix[4 * c + 1], matrix[4 * c + 2]);
    assert_eq!([0, 1, 2].map(column), [DVec3::NEG_X, DVec3::Z, DVec3::Y].map(|v| v * 0.001));

    let view = |accessor: &Value| {
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let at = view["byteOffset"].as_u64().unwrap() as usize;
        &binary[at..at + view["byteLength"].as_u64().unwrap() as usize]
    };
    for (i, mesh) in meshes.iter().enumerate() {
        let node = &json["nodes"][i + 1];
        assert_eq!(node["name"], ["my # mask\\", "my\\n_ mask_"][i]);
        let origin = DVec3::from_slice(&numbers(&node["translation"]));
        let part = &json["meshes"][i]["primitives"][0];
        let accessor = |key: &Value| &json["accessors"][key.as_u64().unwrap() as usize];
        let positions = accessor(&part["attributes"]["POSITION"]);
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (read, expected) in view(positions).chunks_exact(12).zip(mesh.positions_mm()) {
            let local = vector(read, 0);
            (lo, hi) = (lo.min(local), hi.max(local));
            assert!((local + origin).distance(*expected) < 1e-6, "{local} {origin} {expected}");
        }
        assert_eq!(positions["count"], mesh.positions_mm().len());
        assert_eq!(
            (numbers(&positions["min"]), numbers(&positions["max"])),
            (lo.to_array().into(), hi.to_array().into())
        );
        let indices = accessor(&part["indices"]);
        assert_eq!(indices["count"], 3 * mesh.triangles().len());
        let read = view(indices).chunks_exact(4).map(|b| word(b, 0) as u32);
        assert!(read.eq(mesh.triangles().as_flattened().iter().copied()));
        // Only what is smooth has normals.
        let normals = &part["attributes"]["NORMAL"];
        assert_eq!(normals.is_null(), i == 0);
        if i == 1 {
            assert!(
                view(accessor(normals)).chunks_exact(12).all(|n| (vector(n, 0).length() - 1.0).abs() < 1e-6)
            );
        }
    }
    // 128 of sRGB is 0.2159 of linear light.
    let color = numbers(&json["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"]);
    assert_eq!(color, [0.0, 0.215861, 1.0, 1.0]);
}

#[test]
fn what_cant_be_written_leaves_the_folder_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.obj");
    crate::files::write_whole(&path, b"before").unwrap();
    let meshes = two();
    let meshes = named(&meshes);
    let cancelled = Progress::new();
    cancelled.cancel();
    let (none, new) = (Provenance::default(), Progress::new());
    for error in [
        write_obj(&path, &[], &none, &new).unwrap_err(),
        write_glb(&path, &[], &none, &new).unwrap_err(),
        write_obj(&path, &meshes, &none, &cancelled).unwrap_err(),
        write_glb(&path, &meshes, &none, &cancelled).unwrap_err(),
        write_stl(&path, meshes[0].mesh, &cancelled).unwrap_err(),
        write_stl(&folder.path().join("none/out.stl"), meshes[0].mesh, &new).unwrap_err(),
        write_obj(folder.path(), &meshes, &none, &new).unwrap_err(),
        write_obj(&folder.path().join("out.mtl"), &meshes, &none, &new).unwrap_err(),
    ] {
        let error = error.to_string();
        assert!(error == "cancelled" || error.contains(folder.path().to_str().unwrap()), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), b"before");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
