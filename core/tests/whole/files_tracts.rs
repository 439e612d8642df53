//! Reading tracts: agreement with nibabel, and one-line errors for defective files.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::tracts::{Order, Trk, fibers, nibabel_files, tck, tck_with_header, tsf};
use glioscope_core::files::{
    FileError, LoadedTracts, Source, TractOptions, read_tract_bytes, read_tract_scalar, read_tracts,
    write_whole,
};
use glioscope_core::{Check, Progress, Sides, TractScalar, Tracts};

fn read(bytes: &[u8]) -> Result<LoadedTracts, FileError> {
    read_tract_bytes("made", bytes, &TractOptions::default(), &Progress::new())
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::new(6));
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

fn codes(loaded: &LoadedTracts) -> Vec<&'static str> {
    loaded.checks.iter().map(|c| c.code).collect()
}

fn assert_refused(bytes: &[u8], parts: &[&str]) {
    let line = read(bytes).expect_err(&parts.join(" ")).to_string();
    assert!(
        line.starts_with("made: found ") && line.contains(", expected ") && !line.contains('\n'),
        "{line}"
    );
    for part in parts {
        assert!(line.contains(part), "{line}\n  expected {part}");
    }
}

fn fibers_of(tracts: &Tracts) -> Vec<Vec<[f32; 3]>> {
    (0..tracts.fiber_count()).map(|n| tracts.fiber(n).to_vec()).collect()
}

/// Not a test: writes the files that `tracts_nibabel.py` reads with nibabel.
#[test]
#[ignore = "writes files for tracts_nibabel.py; needs GLIOSCOPE_TRACTS_OUT"]
fn write_files_for_nibabel() {
    let out = std::env::var_os("GLIOSCOPE_TRACTS_OUT").expect("the folder to write to");
    for (name, bytes) in nibabel_files() {
        write_whole(&Path::new(&out).join(name), &bytes).unwrap();
    }
}

#[test]
fn points_match_nibabel() {
    let text = include_str!("tracts_nibabel.json");
    let nibabel_fibers: BTreeMap<String, Vec<Vec<[f64; 3]>>> = serde_json::from_str(text).unwrap();
    let nibabel_files = nibabel_files();
    assert_eq!(nibabel_fibers.len(), nibabel_files.len());
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in nibabel_files {
        let path = folder.path().join(name);
        write_whole(&path, &bytes).unwrap();
        let loaded = read_tracts(&Source::File(path), &TractOptions::default(), &Progress::new()).unwrap();
        let (ours, theirs) = (fibers_of(&loaded.tracts), &nibabel_fibers[name]);
        assert_eq!(
            ours.iter().map(Vec::len).collect::<Vec<_>>(),
            theirs.iter().map(Vec::len).collect::<Vec<_>>()
        );
        for (a, b) in ours.iter().flatten().zip(theirs.iter().flatten()) {
            // nibabel rounds its matrix and points to f32: two units in the last place at 100 mm.
            let far = (0..3).any(|axis| (f64::from(a[axis]) - b[axis]).abs() > 2e-5);
            assert!(!far, "{name}: {a:?}, nibabel {b:?}");
        }
    }
}

/// TrackVis' definition worked out by hand: the origin is the corner of the first voxel.
#[test]
fn a_voxel_center_in_voxelmm_maps_to_its_world_center() {
    // Voxel (3, 4, 5) in the order P, S, L of an image of 32 × 24 × 16; the matrix runs R, A, S.
    let matrix = [[2.0, 0.0, 0.0, 100.0], [0.0, 3.0, 0.0, -7.0], [0.0, 0.0, 4.0, 50.0], [0.0, 0.0, 0.0, 1.0]];
    let trk = Trk {
        voxel_order: "PSL",
        sizes: [3.0, 4.0, 2.0],
        vox_to_ras: matrix,
        fibers: vec![vec![[3.5 * 3.0, 4.5 * 4.0, 5.5 * 2.0]]],
        count: 1,
        ..Trk::new()
    };
    let loaded = read(&trk.bytes()).unwrap();
    // Along R voxel 16 - 1 - 5 = 10, along A 32 - 1 - 3 = 28, along S 4.
    assert_eq!(loaded.tracts.fiber(0), [[100.0 + 2.0 * 10.0, -7.0 + 3.0 * 28.0, 50.0 + 4.0 * 4.0]]);
    assert_eq!(codes(&loaded), ["tracts-order-differs"]);
}

/// Values that nibabel reads: of each fibre rows of columns, of points and of fibres.
#[derive(serde::Deserialize)]
struct NibabelScalars {
    points: BTreeMap<String, Vec<Vec<Vec<f32>>>>,
    fibers: BTreeMap<String, Vec<Vec<f32>>>,
}

#[test]
fn scalars_match_nibabel() {
    let text = include_str!("tracts_nibabel_scalars.json");
    let theirs: BTreeMap<String, NibabelScalars> = serde_json::from_str(text).unwrap();
    let mut compared = 0;
    for (name, bytes) in nibabel_files() {
        let Some(theirs) = theirs.get(name) else { continue };
        let tracts = read(&bytes).unwrap().tracts;
        let mut ours: Vec<&str> = tracts.scalars().iter().map(TractScalar::name).collect();
        let mut check = |scalar: &str, column: Option<usize>, expected: Vec<Vec<f32>>| {
            let named = column.map_or_else(|| scalar.to_owned(), |n| format!("{scalar} {}", n + 1));
            ours.retain(|own| *own != named);
            let own = tracts.scalar(&named).unwrap_or_else(|| panic!("{name}: no {named}"));
            for (n, expected) in expected.iter().enumerate() {
                assert_eq!(tracts.values_along(own, n), *expected, "{name} {named}");
                compared += expected.len();
            }
        };
        // nibabel calls what has no name `scalars` and `properties`, all in one; those here have one column, or a name.
        let own_name = |theirs: &str| match theirs {
            "scalars" => "scalar".to_owned(),
            "properties" => "property".to_owned(),
            other => other.to_owned(),
        };
        let is_numbered =
            |theirs: &str, columns: usize| columns > 1 || theirs == "scalars" || theirs == "properties";
        for (scalar, fibers) in &theirs.points {
            let columns = fibers[0][0].len();
            for column in 0..columns {
                let values = fibers.iter().map(|rows| rows.iter().map(|row| row[column]).collect()).collect();
                check(&own_name(scalar), is_numbered(scalar, columns).then_some(column), values);
            }
        }
        for (scalar, fibers) in &theirs.fibers {
            let columns = fibers[0].len();
            for column in 0..columns {
                let along = |(n, row): (usize, &Vec<f32>)| vec![row[column]; tracts.fiber(n).len()];
                let values = fibers.iter().enumerate().map(along).collect();
                check(&own_name(scalar), is_numbered(scalar, columns).then_some(column), values);
            }
        }
        assert_eq!(ours, [""; 0], "{name}");
    }
    assert!(compared > 100, "{compared}");
}

/// Written by nibabel: `tracts_nibabel.py --write` says what it holds.
#[test]
fn scalars_that_nibabel_writes_are_read() {
    let tracts = read(include_bytes!("nibabel_scalars.trk")).unwrap().tracts;
    let names: Vec<&str> = tracts.scalars().iter().map(TractScalar::name).collect();
    assert_eq!(names, ["FA", "normal 1", "normal 2", "normal 3", "length"]);
    let along = |name: &str, n| tracts.values_along(tracts.scalar(name).unwrap(), n);
    let near = |found: Vec<f32>, expected: &[f32]| {
        let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-5;
        assert!(found.len() == expected.len() && found.iter().zip(expected).all(is_near), "{found:?}");
    };
    near(along("FA", 0), &[0.0, 0.1, 0.2]);
    near(along("FA", 1), &[0.3, 0.4]);
    near(along("length", 1), &[20.0, 20.0]);
    for (axis, name) in ["normal 1", "normal 2", "normal 3"].into_iter().enumerate() {
        for n in 0..2 {
            near(along(name, n), &tracts.fiber(n).iter().map(|p| p[axis]).collect::<Vec<_>>());
        }
    }
}

#[test]
fn scalars_beyond_the_names_are_numbered_and_too_many_left_out() {
    let trk =
        Trk { scalars: 70, scalar_names: &["FA"], fibers: vec![fibers()[0].clone()], count: 1, ..Trk::new() };
    let loaded = read(&trk.bytes()).unwrap();
    let names: Vec<&str> = loaded.tracts.scalars().iter().map(TractScalar::name).collect();
    assert_eq!((names.len(), names[0], names[1], names[63]), (64, "FA", "scalar 2", "scalar 64"));
    assert_eq!(codes(&loaded), ["tracts-scalars-left-out"]);
    // A claim of more columns than there are values, two equal names, a name of bytes that are no text.
    let trk = Trk {
        scalars: 3,
        scalar_names: &["a\x0099", "b"],
        properties: 2,
        property_names: &["a 1", "\u{7}"],
        ..Trk::new()
    };
    let names = read(&trk.bytes()).unwrap().tracts;
    let names: Vec<&str> = names.scalars().iter().map(TractScalar::name).collect();
    assert_eq!(names, ["a 1", "a 2", "a 3", "a 1 2", "\\u{7}"]);
}

fn read_scalar(of: &LoadedTracts, bytes: &[u8]) -> Result<(TractScalar, Vec<Check>), FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("FA.tsf");
    write_whole(&path, bytes).unwrap();
    read_tract_scalar(&Source::File(path), "FA", of, &TractOptions::default(), &Progress::new())
}

/// A value for each point of [`fibers`]: a tenth of its number in the file.
fn values() -> Vec<Vec<f32>> {
    let mut next = 0;
    let tenth = |_: &[f32; 3]| {
        next += 1;
        next as f32 / 10.0
    };
    let mut tenth = tenth;
    fibers().iter().map(|fiber| fiber.iter().map(&mut tenth).collect()).collect()
}

#[test]
fn a_tsf_has_a_value_for_each_point_of_its_tck() {
    let of = read(&tck(&fibers(), Order::Little, false, "count: 3\ntimestamp: 17.25\n")).unwrap();
    for (order, double) in
        [(Order::Little, false), (Order::Big, false), (Order::Little, true), (Order::Big, true)]
    {
        let bytes = tsf(&values(), order, double, "count: 3\ntimestamp: 17.25\n");
        for bytes in [gzip(&bytes), bytes] {
            let (scalar, checks) = read_scalar(&of, &bytes).unwrap();
            assert_eq!(checks, []);
            let tracts = of.tracts.clone().with_scalars(vec![scalar]).unwrap();
            let found: Vec<Vec<f32>> =
                (0..3).map(|n| tracts.values_along(tracts.scalar("FA").unwrap(), n)).collect();
            assert_eq!(found, values());
        }
    }
    let codes = |lines: &str| -> Vec<&'static str> {
        let (_, checks) = read_scalar(&of, &tsf(&values(), Order::Little, false, lines)).unwrap();
        checks.iter().map(|check| check.code).collect()
    };
    assert_eq!(codes("timestamp: 18\n"), ["tracts-scalars-timestamp"]);
    assert_eq!(codes("count: 4\n"), ["tracts-count"]);
    let trailing = [tsf(&values(), Order::Little, false, ""), vec![1, 2, 3]].concat();
    assert_eq!(read_scalar(&of, &trailing).unwrap().1[0].code, "tracts-trailing-bytes");
}

#[test]
fn a_tsf_that_does_not_fit_or_is_damaged_is_refused_in_one_line() {
    let of = read(&tck(&fibers(), Order::Little, false, "count: 3\n")).unwrap();
    let with = |change: &dyn Fn(&mut Vec<Vec<f32>>)| {
        let mut all = values();
        change(&mut all);
        tsf(&all, Order::Little, false, "")
    };
    let good = with(&|_| {});
    let cut = good[..good.len() - 8].to_vec();
    let text = |text: &str| [text.as_bytes(), &[0; 64]].concat();
    for (bytes, found, expected) in [
        (with(&|all| all.truncate(2)), "scalars of 2 fibres", "those of 3, as its tracts have"),
        (with(&|all| all.push(vec![1.0])), "scalars of more than 3 fibres", "those of 3"),
        (with(&|all| all[2].push(1.0)), "more than 7 scalars in fibre 2", "7, one for each of its points"),
        (with(&|all| all[0].truncate(3)), "3 scalars in fibre 0", "4, one for each of its points"),
        (with(&|all| all.swap(0, 2)), "more than 4 scalars in fibre 0", "4, one"),
        (cut, "the end of the file after", "an infinity, which ends a .tsf"),
        (Vec::new(), "an empty file", "track scalars"),
        (tck(&fibers(), Order::Little, false, ""), "other content", "mrtrix track scalars"),
        (text("mrtrix track scalars\nfile: . 10\nEND\n"), "no datatype", "Float32LE"),
        (text("mrtrix track scalars\ndatatype: Int8\nfile: . 60\nEND\n"), "datatype Int8", "Float32LE"),
        (
            text("mrtrix track scalars\ndatatype: Float32LE\nfile: a.dat 0\nEND\n"),
            "file: a.dat 0",
            ". OFFSET",
        ),
        (
            text("mrtrix track scalars\ndatatype: Float32LE\nfile: . 9999\nEND\n"),
            "the end of the file",
            "scalars where",
        ),
        (text("mrtrix track scalars\ndatatype: Float32LE\n"), "the end of the file", "END"),
    ] {
        let line = read_scalar(&of, &bytes).expect_err(found).to_string();
        assert!(line.contains("FA.tsf: found ") && !line.contains('\n'), "{line}");
        let (left, right) = line.split_once(", expected ").unwrap();
        assert!(left.contains(found) && right.contains(expected), "{line}\n  {found}, {expected}");
    }
    // An infinity within a fibre; endless zeros; every prefix.
    let mut inside = good.clone();
    let first = good.windows(5).position(|w| w == b"\nEND\n").unwrap() + 5;
    inside[first + 4..first + 8].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let line = read_scalar(&of, &inside).unwrap_err().to_string();
    assert!(line.contains("found the end marker inside fibre 0"), "{line}");
    let zeros = [&good[..first], &vec![0; 1 << 20]].concat();
    assert!(read_scalar(&of, &zeros).unwrap_err().to_string().contains("more than 4 scalars in fibre 0"));
    // What MRtrix itself writes ends after the last fibre.
    let without_end = good.len() - 4;
    for length in 0..good.len() {
        assert_eq!(read_scalar(&of, &good[..length]).is_ok(), length == without_end, "{length}");
    }
    // Given as tracts, it is named for what it is.
    assert_refused(&good, &["scalars of fibres (.tsf)", "--tracts"]);
}

#[test]
fn every_tck_datatype_gives_the_same_points() {
    for order in [Order::Little, Order::Big] {
        for double in [false, true] {
            let loaded = read(&tck(&fibers(), order, double, "")).unwrap();
            assert_eq!(fibers_of(&loaded.tracts), fibers());
            assert_eq!((loaded.tracts.sides(), loaded.checks), (Sides::Known, vec![]));
        }
    }
}

#[test]
fn fibers_longer_than_a_chunk_and_empty_fibers_are_read_completely() {
    let long: Vec<[f32; 3]> = (0..60_000).map(|i| [i as f32 * 0.01, -(i as f32) * 0.02, 3.0]).collect();
    let all = vec![vec![], long.clone(), vec![[1.0; 3]], vec![], long];
    let loaded = read(&tck(&all, Order::Big, false, "count: 5\n")).unwrap();
    assert_eq!((fibers_of(&loaded.tracts), codes(&loaded)), (all.clone(), vec![]));
    // Writers that don't count empty fibres declare three.
    assert!(read(&tck(&all, Order::Big, false, "count: 3\n")).unwrap().checks.is_empty());
    let identity = std::array::from_fn(|r| std::array::from_fn(|c| f32::from(u8::from(r == c))));
    let trk = Trk {
        sizes: [1.0; 3],
        vox_to_ras: identity,
        scalars: 7,
        fibers: all.clone(),
        count: 5,
        ..Trk::new()
    };
    let loaded = read(&trk.bytes()).unwrap();
    let shifted: Vec<Vec<_>> =
        all.iter().map(|f| f.iter().map(|p| p.map(|v| (f64::from(v) - 0.5) as f32)).collect()).collect();
    assert_eq!((fibers_of(&loaded.tracts), codes(&loaded)), (shifted, vec![]));
}

#[test]
fn gzipped_tracts_are_read_like_plain_ones() {
    let trk = Trk { scalars: 2, properties: 1, ..Trk::new() }.bytes();
    for bytes in [tck(&fibers(), Order::Big, false, "count: 3\n"), trk] {
        let packed = gzip(&bytes);
        let (half, rest) = bytes.split_at(bytes.len() / 2);
        let members = [gzip(half), gzip(rest)].concat();
        assert_eq!(read(&packed).unwrap(), read(&bytes).unwrap());
        assert_eq!(read(&members).unwrap(), read(&bytes).unwrap());
        for end in 3..packed.len() {
            assert_refused(&packed[..end], &[]);
        }
        let mut damaged = packed;
        let at = damaged.len() - 6;
        damaged[at] ^= 1;
        assert_refused(&damaged, &["damaged gzip"]);
    }
}

/// Tools append their count to a copied header, or copy a line twice: the fibres in the file decide.
#[test]
fn lines_repeated_in_a_header_and_an_unknown_version_are_warnings() {
    let little = Order::Little;
    for (lines, expected) in [
        ("count: 7\ncount: 3\n", &["tracts-header-repeated"][..]),
        ("count: 3\ncount: 7\n", &["tracts-header-repeated"]),
        ("count: 7\ncount: 8\n", &["tracts-header-repeated", "tracts-count"]),
        ("datatype: Float32LE\n", &["tracts-header-repeated"]),
        ("command_history: a\ncommand_history: b\n", &[]),
    ] {
        let loaded = read(&tck(&fibers(), little, false, lines)).unwrap();
        assert_eq!((codes(&loaded), fibers_of(&loaded.tracts)), (expected.to_vec(), fibers()), "{lines}");
    }
    let (second, third) = (Trk::new(), Trk { version: 3, ..Trk::new() });
    let (second, third) = (read(&second.bytes()).unwrap(), read(&third.bytes()).unwrap());
    assert_eq!(second.tracts, third.tracts);
    assert_eq!(codes(&third), [&["tracts-version"], codes(&second).as_slice()].concat());
}

#[test]
fn irregular_files_get_checks() {
    let little = Order::Little;
    let codes_of = |bytes: &[u8]| codes(&read(bytes).unwrap());
    assert_eq!(codes_of(&tck(&fibers(), little, false, "count: 4\n")), ["tracts-count"]);
    let mut longer = tck(&fibers(), little, false, "");
    longer.extend([0; 30]);
    assert_eq!(codes_of(&longer), ["tracts-trailing-bytes"]);
    let message = &read(&longer).unwrap().checks[0].message;
    assert!(message.contains("found 30 bytes"), "{message}");
    let base = Trk::new();
    assert_eq!(codes_of(&Trk { count: 9, ..base.clone() }.bytes()), ["tracts-count"]);
    assert_eq!(codes_of(&Trk { count: 2, ..base.clone() }.bytes()), ["tracts-trailing-bytes"]);
    assert_eq!(
        codes_of(&Trk { voxel_order: "", ..base.clone() }.bytes()),
        ["tracts-voxel-order", "tracts-order-differs"]
    );
    for unplaced in [Trk { version: 1, ..base.clone() }, Trk { vox_to_ras: [[0.0; 4]; 4], ..base.clone() }] {
        let loaded = read(&unplaced.bytes()).unwrap();
        assert_eq!((codes(&loaded), loaded.tracts.sides()), (vec!["tracts-place-unknown"], Sides::Unknown));
        // Millimetres from the first voxel's centre.
        let [x, y, z] = fibers()[0][0];
        assert_eq!(loaded.tracts.fiber(0)[0], [x - 0.5, y - 1.0, z - 1.5]);
    }
    let none = Trk { fibers: vec![], count: 0, ..base };
    assert_eq!(read(&none.bytes()).unwrap().tracts.fiber_count(), 0);
}

#[test]
fn each_error_is_one_line_that_names_the_cause() {
    let (little, all) = (Order::Little, fibers());
    assert_refused(b"", &["found an empty file"]);
    assert_refused(b"TRAC", &["found other content", "mrtrix tracks"]);
    assert_refused(b"<!DOCTYPE html> some page", &["found an HTML page"]);
    assert_refused(b"/annex/objects/MD5E-s9--0.tck", &["found a git-annex pointer"]);
    assert_refused(&[0x1f, 0x8b, 8, 0, 0, 0, 0, 0], &["found a gzip that is cut off"]);
    assert_refused(&gzip(&gzip(&tck(&all, little, false, ""))), &["a gzip within a gzip"]);
    assert_refused(b"mrtrix tracks\ndatatype: Float32LE\n", &["end of the file", "a line END"]);
    assert_refused(
        &[b"mrtrix tracks\n".to_vec(), vec![b'x'; 2 << 20]].concat(),
        &["no line END within 1048576"],
    );
    assert_refused(&tck_with_header(&all, little, false, ""), &["found no datatype", "Float64BE"]);
    assert_refused(&tck_with_header(&all, little, false, "datatype: Int16\n"), &["found datatype Int16"]);
    assert_refused(&tck(&all, little, false, "datatype: Float32BE\n"), &["found datatype twice"]);
    assert_refused(&tck(&all, little, false, "file: . 99\n"), &["found file twice"]);
    assert_refused(&tck(&all, little, false, "count: many\n"), &["found count: many"]);
    assert_refused(b"mrtrix tracks\ndatatype: Float32LE\nEND\n", &["found no file"]);
    for bad in ["other.dat 0", ". 5", ". -1", ".", ". 99999999999999999999"] {
        let text = format!("mrtrix tracks\ndatatype: Float32LE\nfile: {bad}\nEND\n");
        assert_refused(text.as_bytes(), &[&format!("found file: {bad}")]);
    }
    assert_refused(b"mrtrix tracks\ndatatype: Float32LE\nfile: . 999\nEND\n", &["end of the file"]);
    let broken = |point: [f32; 3]| tck(&[vec![[0.0; 3], point]], little, false, "");
    assert_refused(&broken([1.0, f32::NAN, 2.0]), &["found a point at 1, NaN, 2 mm in fibre 0"]);
    assert_refused(&broken([f32::NAN, f32::NAN, f32::INFINITY]), &["NaN, NaN, inf"]);
    assert_refused(&broken([f32::INFINITY; 3]), &["found the end marker inside fibre 0"]);
    assert_refused(&broken([2e7, 0.0, 0.0]), &["expected finite coordinates within 10 km"]);

    let base = Trk::new();
    let trk = |trk: Trk, parts: &[&str]| assert_refused(&trk.bytes(), parts);
    assert_refused(&base.bytes()[..999], &["found the end of the file after 999 bytes"]);
    let mut size = base.bytes();
    size[996..].iter_mut().take(4).for_each(|b| *b = 7);
    assert_refused(&size, &["found header size"]);
    trk(Trk { version: 4, ..base.clone() }, &["found version 4"]);
    trk(Trk { version: 0, ..base.clone() }, &["found version 0"]);
    trk(Trk { scalars: -1, ..base.clone() }, &["found -1 scalars"]);
    trk(Trk { properties: -2, ..base.clone() }, &["found -2 properties"]);
    trk(Trk { count: -3, ..base.clone() }, &["found -3 fibres"]);
    trk(Trk { sizes: [1.0, 0.0, 1.0], ..base.clone() }, &["found voxels of 1 × 0 × 1 mm"]);
    trk(Trk { sizes: [1.0, f32::NAN, 1.0], ..base.clone() }, &["found voxels of 1 × NaN"]);
    trk(Trk { voxel_order: "RLS", ..base.clone() }, &["found voxel_order RLS"]);
    trk(Trk { voxel_order: "RA", ..base.clone() }, &["found voxel_order RA"]);
    trk(Trk { voxel_order: "LAS", dims: [0, 1, 1], ..base.clone() }, &["found dimensions [0, 1, 1]"]);
    let mut flat = base.vox_to_ras;
    flat[2] = flat[1];
    trk(Trk { vox_to_ras: flat, ..base.clone() }, &["found vox_to_ras: ", "condition"]);
    let mut projective = base.vox_to_ras;
    projective[3][0] = 0.5;
    trk(Trk { vox_to_ras: projective, ..base.clone() }, &["last row"]);
    let mut false_count = base.bytes();
    false_count[1000..1004].copy_from_slice(&i32::MAX.to_le_bytes());
    assert_refused(&false_count, &["found 2147483647 points in fibre 0"]);
    false_count[1000..1004].copy_from_slice(&(-1_i32).to_le_bytes());
    assert_refused(&false_count, &["found -1 points in fibre 0"]);
    trk(Trk { fibers: vec![vec![[f32::NAN; 3]]], ..base }, &["found a point at NaN"]);

    let options = TractOptions { max_bytes: 1000 };
    let line = read_tract_bytes("made", &base.bytes(), &options, &Progress::new()).unwrap_err().to_string();
    assert!(line.contains("at most 1000"), "{line}");
    let packed = gzip(&base.bytes());
    let line = read_tract_bytes("made", &packed, &options, &Progress::new()).unwrap_err().to_string();
    assert!(line.contains("found a gzip that inflates to more than 1000 bytes"), "{line}");
    let stopped = Progress::new();
    stopped.cancel();
    let result = read_tract_bytes("made", &base.bytes(), &TractOptions::default(), &stopped);
    assert!(matches!(result, Err(FileError::Cancelled(_))));
}

/// Truncated at any byte: an error, or (a `.trk` cut between two fibres) fewer fibres and a check.
#[test]
fn every_truncation_is_detected() {
    let whole = tck(&fibers(), Order::Big, false, "count: 3\n");
    for end in 0..whole.len() {
        assert_refused(&whole[..end], &[]);
    }
    for scalars in [0, 2] {
        let whole = Trk { scalars, properties: 1, ..Trk::new() }.bytes();
        let mut short_reads = 0;
        for end in 0..whole.len() {
            match read(&whole[..end]) {
                Ok(loaded) => {
                    short_reads += 1;
                    assert_eq!(codes(&loaded), ["tracts-count"], "{end}");
                }
                Err(_) => assert_refused(&whole[..end], &[]),
            }
        }
        assert_eq!(short_reads, 3, "before each of the three fibres");
    }
}

/// Damage anywhere: a one-line error, or consistent tracts.
#[test]
fn damaged_bytes_give_an_error_or_consistent_tracts() {
    let files = [
        tck(&fibers(), Order::Little, false, "count: 3\n"),
        tck(&fibers(), Order::Big, true, ""),
        Trk::new().bytes(),
        Trk { order: Order::Big, scalars: 2, properties: 2, count: 0, voxel_order: "LPS", ..Trk::new() }
            .bytes(),
    ];
    let mut state = 7_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    let (mut good, mut bad) = (0, 0);
    let mut check_outcome = |bytes: &[u8]| match read(bytes) {
        Ok(loaded) => {
            good += 1;
            let t = loaded.tracts;
            assert!(Tracts::new(t.points_mm().to_vec(), t.offsets().to_vec(), t.sides()).is_some());
            assert!(t.points_mm().len() * 12 <= bytes.len());
        }
        Err(error) => {
            bad += 1;
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    };
    for file in &files {
        // Every bit once, then several bytes at a time.
        for bit in 0..8 * file.len() {
            let mut damaged = file.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            check_outcome(&damaged);
        }
        for _ in 0..5_000 {
            let mut damaged = file.clone();
            for _ in 0..1 + random() % 8 {
                let at = random() % damaged.len();
                damaged[at] = random() as u8;
            }
            damaged.truncate(damaged.len() - random() % 40);
            check_outcome(&damaged);
        }
    }
    assert!(good > 1_000 && bad > 1_000, "{good} read, {bad} refused");
}
