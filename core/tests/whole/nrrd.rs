//! NRRD headers of every kind, made here: spaces, axes, units, and damage.

use crate::common::{codes, gzip, numbers};
use glam::DVec3;
use glioscope_core::files::{self, FileError, Inputs, Loaded, ReadOptions, Source};
use glioscope_core::{Progress, Sides};

fn read_frame(bytes: &[u8], frame: usize) -> Result<Loaded, FileError> {
    files::read_nrrd_bytes(
        "made.nrrd",
        bytes,
        &ReadOptions { frame, ..ReadOptions::default() },
        &Progress::new(),
    )
}

fn read(bytes: &[u8]) -> Result<Loaded, FileError> {
    read_frame(bytes, 0)
}

/// 2 x 3 x 4 voxels of int8 with these fields beside sizes and type; values 0 to 23.
fn with(fields: &str) -> Vec<u8> {
    made("sizes: 2 3 4", fields, 24)
}

fn made(sizes: &str, fields: &str, count: u8) -> Vec<u8> {
    let dimension = sizes.split_whitespace().count() - 1;
    let header =
        format!("NRRD0005\ntype: signed char\ndimension: {dimension}\n{sizes}\nencoding: raw\n{fields}");
    let header = format!("{}\n\n", header.trim_end());
    [header.as_bytes(), &(0..count).collect::<Vec<_>>()].concat()
}

const PLACED: &str = "space directions: (2,0,0) (0,3,0) (0,0,4)\nspace origin: (10,20,30)\n";

#[test]
fn spaces_decide_the_sides() {
    for (space, origin, sides) in [
        ("right-anterior-superior", [10.0, 20.0, 30.0], Sides::Known),
        ("LAS", [-10.0, 20.0, 30.0], Sides::Known),
        ("Left-Posterior-Superior", [-10.0, -20.0, 30.0], Sides::Known),
        ("scanner-xyz", [10.0, 20.0, 30.0], Sides::Unknown),
        ("3D-left-handed", [10.0, 20.0, 30.0], Sides::Unknown),
    ] {
        let loaded = read(&with(&format!("space: {space}\n{PLACED}"))).unwrap();
        let grid = loaded.volume.grid();
        assert_eq!((grid.center_of_voxel_mm([0; 3]).to_array(), grid.sides()), (origin, sides), "{space}");
        assert_eq!(grid.spacing_mm(), DVec3::new(2.0, 3.0, 4.0));
        assert_eq!(codes(&loaded).contains(&"side-unknown"), sides == Sides::Unknown, "{space}");
    }
    let by_dimension = read(&with(&format!("space dimension: 3\n{PLACED}"))).unwrap();
    assert_eq!(by_dimension.volume.grid().sides(), Sides::Unknown);
    let no_origin = read(&with("space: RAS\nspace directions: (2,0,0) (0,3,0) (0,0,4)")).unwrap();
    assert_eq!(codes(&no_origin), ["origin-missing", "side-unknown"]);
}

/// A fourth component is time: its axis counts frames.
#[test]
fn a_space_with_time_has_frames() {
    let fields = "space: left-posterior-superior-time\n\
                  space directions: (0,0,0,1.5) (2,0,0,0) (0,3,0,0) (0,0,4,0)\nspace origin: (1,2,3,0)";
    let bytes = made("sizes: 2 2 3 2", fields, 24);
    let second = read_frame(&bytes, 1).unwrap();
    assert_eq!((second.frames, second.volume.grid().dims()), (2, [2, 3, 2]));
    assert_eq!(numbers(second.volume.samples()), (0..12).map(|n| f64::from(2 * n + 1)).collect::<Vec<_>>());
    let mixed = fields.replace("(2,0,0,0)", "(2,0,0,1)");
    assert!(read(&made("sizes: 2 2 3 2", &mixed, 24)).unwrap_err().to_string().contains("not in both"));
}

#[test]
fn frames_may_be_in_front_of_the_axes_in_space_and_behind_them() {
    let fields = "space: RAS\nspace directions: none (1,0,0) (0,1,0) (0,0,1) none\nspace origin: (0,0,0)\n\
                  kinds: list domain domain domain time";
    let bytes = made("sizes: 3 2 2 2 2", fields, 48);
    let frame = |frame| read_frame(&bytes, frame).unwrap();
    assert_eq!(frame(0).frames, 6);
    for (at, first) in [(0, 0), (2, 2), (3, 24), (5, 26)] {
        let expected: Vec<f64> = (0..8).map(|n| f64::from(first + 3 * n)).collect();
        assert_eq!(numbers(frame(at).volume.samples()), expected, "frame {at}");
    }
    assert!(read_frame(&bytes, 6).is_err());
    let between = fields.replace("none (1,0,0) (0,1,0)", "(1,0,0) none (0,1,0)");
    let error =
        read(&made("sizes: 2 3 2 2 2", &between.replace("list domain", "domain list"), 48)).unwrap_err();
    assert!(error.to_string().contains("one after another"), "{error}");
}

#[test]
fn axes_without_directions_go_by_their_kinds() {
    let list =
        read(&made("sizes: 2 2 3 2", "kinds: list space space space\nspacings: nan 2 3 4", 24)).unwrap();
    assert_eq!((list.frames, list.volume.grid().dims()), (2, [2, 3, 2]));
    assert_eq!(list.volume.grid().spacing_mm(), DVec3::new(2.0, 3.0, 4.0));
    let plain = read(&made("sizes: 2 2 3 2", "", 24)).unwrap();
    assert_eq!((plain.frames, plain.volume.grid().dims()), (2, [2, 2, 3]));
    assert_eq!(codes(&plain), ["spacing-missing", "side-unknown"]);
    let cells =
        "spacings: 2 3 4\naxis mins: 10 20 nan\ncenterings: cell node cell\nunits: \"mm\" \"mm\" \"mm\"";
    let cells = read(&with(cells)).unwrap();
    assert_eq!(cells.volume.grid().center_of_voxel_mm([0; 3]).to_array(), [11.0, 20.0, 0.0]);
    for kind in ["RGB-color", "vector", "3D-symmetric-matrix", "complex", "quaternion"] {
        let error =
            read(&made("sizes: 2 2 3 2", &format!("kinds: {kind} domain domain domain"), 24)).unwrap_err();
        assert!(error.to_string().contains(&format!("axis 0 of kind \"{kind}\", of 2 numbers")), "{error}");
    }
}

#[test]
fn two_axes_in_space_get_a_third() {
    let flat = read(&made(
        "sizes: 4 6",
        "space: LPS\nspace directions: (0,2,0) (0,0,-3)\nspace origin: (1,2,3)",
        24,
    ));
    let flat = flat.unwrap();
    let grid = flat.volume.grid();
    assert_eq!((grid.dims(), grid.spacing_mm()), ([4, 6, 1], DVec3::new(2.0, 3.0, 1.0)));
    assert_eq!(codes(&flat), ["thickness-unknown"]);
    assert!(read(&made("sizes: 4 6", "space: LPS\nspace directions: (0,2,0) (0,3,0)", 24)).is_err());
    assert!(read(&made("sizes: 24", "", 24)).unwrap_err().to_string().contains("axes [0] in space"));
}

#[test]
fn units_are_converted_or_mm_is_assumed() {
    for (units, spacing, code) in [
        ("\"mm\" \"mm\" \"mm\"", 2.0, None),
        ("mm mm mm", 2.0, None),
        ("\"cm\" \"cm\" \"cm\"", 20.0, Some("units-converted")),
        ("\"microns\" \"µm\" \"um\"", 2e-3, Some("units-converted")),
        ("\"inch es\" \"inch es\" \"inch es\"", 2.0, Some("units-unknown")),
        ("\"\" \"\" \"\"", 2.0, None),
    ] {
        let loaded = read(&with(&format!("space: LPS\n{PLACED}space units: {units}"))).unwrap();
        assert!((loaded.volume.grid().spacing_mm().x - spacing).abs() < 1e-12, "{units}");
        assert_eq!(codes(&loaded).first().copied(), code, "{units}");
    }
    let mixed = with(&format!("space: LPS\n{PLACED}space units: \"mm\" \"mm\" \"cm\""));
    assert!(read(&mixed).unwrap_err().to_string().contains("the same unit"));
}

#[test]
fn voxels_are_read_wherever_they_begin() {
    let plain = with(&format!("space: LPS\n{PLACED}"));
    let header_len = plain.len() - 24;
    let packed = |field: &str, data: &[u8]| {
        let header = String::from_utf8(plain[..header_len - 1].to_vec()).unwrap();
        let header = header.replace("encoding: raw", "encoding: gzip");
        [format!("{header}{field}\n\n").as_bytes(), data].concat()
    };
    // Lines are skipped in front of the gzip, bytes inside it.
    let skipped = [&b"x\ny\n"[..], &gzip(&[&[9; 5], &plain[header_len..]].concat())].concat();
    assert!(read(&plain).unwrap().checks.is_empty());
    let loaded = read(&packed("line skip: 2\nbyte skip: 5", &skipped)).unwrap();
    assert_eq!(numbers(loaded.volume.samples())[..3], [0.0, 1.0, 2.0]);
    // Voxels that begin like a gzip are none, and an unknown field is named.
    let mut magic = with(&format!("space: LPS\n{PLACED}dream: x"));
    let at = magic.len() - 24;
    magic[at..at + 2].copy_from_slice(&[0x1f, 0x8b]);
    let loaded = read(&magic).unwrap();
    assert_eq!(numbers(loaded.volume.samples())[..3], [31.0, -117.0, 2.0]);
    assert_eq!(codes(&loaded), ["header-field-unknown"]);
    let error = read(&gzip(&plain)).unwrap_err().to_string();
    assert!(error.contains("found a gzip, expected a NRRD file"), "{error}");
    let detached = with(&format!("space: LPS\n{PLACED}data file: a.raw"));
    assert!(read(&detached).unwrap_err().to_string().contains("voxels in another file"));
}

/// Data files are read, and no output may overwrite them.
#[test]
fn a_detached_header_has_its_data_files() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for nth in 0..4_u8 {
        files::write_whole(&at(&format!("s{nth}.raw")), &[nth; 6]).unwrap();
    }
    for (fields, count) in
        [("data file: s%d.raw 0 3 1", 5), ("data file: LIST\ns0.raw\ns1.raw\ns2.raw\ns3.raw", 5)]
    {
        let bytes = made("sizes: 2 3 4", &format!("space: LPS\n{PLACED}{fields}"), 0);
        files::write_whole(&at("a.nhdr"), &bytes).unwrap();
        let source = Source::File(at("a.nhdr"));
        let loaded = files::read(&source, &ReadOptions::default(), &Progress::new()).unwrap();
        assert_eq!(numbers(loaded.volume.samples())[4..8], [0.0, 0.0, 1.0, 1.0]);
        assert!(files::info(&source, &Progress::new()).unwrap().text().contains("data files  4"));
        let inputs = Inputs::new([at("a.nhdr")]);
        assert_eq!(inputs.paths().len(), count);
        assert!(inputs.refuse_as_output(&at("s2.raw")).is_err());
        assert!(inputs.refuse_as_output(&at("s9.raw")).is_ok());
    }
    files::write_whole(&at("s2.raw"), &[2; 5]).unwrap();
    let short = files::read(&Source::File(at("a.nhdr")), &ReadOptions::default(), &Progress::new());
    let error = short.unwrap_err().to_string();
    assert!(error.contains("s2.raw: found 5 bytes, expected the 6 bytes"), "{error}");
}

/// Cut at every length, and with every bit of the header flipped.
#[test]
fn damage_never_panics() {
    let fine = with(&format!(
        "space: LPS\n{PLACED}Segment0_LabelValue:=1\nSegment0_Layer:=0\nkinds: domain domain domain"
    ));
    assert!(read(&fine).is_ok());
    for cut in 0..fine.len() {
        assert!(read(&fine[..cut]).is_err(), "cut at {cut}");
    }
    for bit in 0..8 * (fine.len() - 24) {
        let mut bytes = fine.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        match read(&bytes) {
            Ok(loaded) => assert_eq!(loaded.volume.samples().len(), loaded.volume.grid().voxel_count()),
            Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
        }
    }
}

#[test]
fn information_has_stable_keys_and_no_remarks() {
    let bytes = with(&format!(
        "space: LPS\n{PLACED}content: SECRET\nnote:=SECRET\nSegment0_Name:=Core\nSegment0_LabelValue:=3\nSegment0_Color:=1 0 0"
    ));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seg.nrrd");
    files::write_whole(&path, &bytes).unwrap();
    let source = Source::File(path);
    let info = files::info(&source, &Progress::new()).unwrap();
    let json: serde_json::Value = serde_json::from_str(&info.json().unwrap()).unwrap();
    let mut keys: Vec<&str> = json.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    assert_eq!(
        keys,
        [
            "axis_codes",
            "byte_order",
            "checks",
            "data_files",
            "datatype",
            "dims",
            "encoding",
            "file",
            "format",
            "frame_bytes",
            "frames",
            "place_from",
            "segments",
            "spacing_mm",
            "unit",
            "world_from_voxel"
        ]
    );
    assert_eq!((json["axis_codes"].as_str(), json["datatype"].as_str()), (Some("LPS"), Some("int8")));
    assert_eq!(json["segments"][0]["color"], serde_json::json!([255, 0, 0]));
    assert!(info.text().contains("segment 0   Core: label 3, frame 0"), "{}", info.text());
    assert!(!info.text().contains("SECRET") && !json.to_string().contains("SECRET"));
    let segments = files::segments(&source, &Progress::new()).unwrap();
    assert_eq!((segments[0].name.as_str(), segments[0].label), ("Core", Some(3)));
}
