//! Written volumes read back the same: every data type, every kind of affine, plain and gzipped.

use std::{io::Read, path::Path};

use crate::common::read_bytes;
use glam::{DAffine3, DMat3, DVec3};
use glioscope_core::files::nifti_header::{Header, Version};
use glioscope_core::files::{
    WriteOptions, is_writable_folder, nifti_bytes, nifti_info, replace_files, temporary_folder, write_nifti,
    write_whole,
};
use glioscope_core::{Grid, Samples, Scaling, Sides, Volume, files::Source};
use proptest::prelude::*;

fn samples(kind: usize, bits: &[u64]) -> Samples {
    match kind {
        0 => Samples::U8(bits.iter().map(|&b| b as u8).collect()),
        1 => Samples::I8(bits.iter().map(|&b| b as i8).collect()),
        2 => Samples::U16(bits.iter().map(|&b| b as u16).collect()),
        3 => Samples::I16(bits.iter().map(|&b| b as i16).collect()),
        4 => Samples::U32(bits.iter().map(|&b| b as u32).collect()),
        5 => Samples::I32(bits.iter().map(|&b| b as i32).collect()),
        6 => Samples::U64(bits.to_vec()),
        7 => Samples::I64(bits.iter().map(|&b| b as i64).collect()),
        8 => Samples::F32(bits.iter().map(|&b| b as i32 as f32 / 128.0).collect()),
        _ => Samples::F64(bits.iter().map(|&b| b as i64 as f64 / 1024.0).collect()),
    }
}

fn round_trip(volume: &Volume, gzip: bool) -> Result<Volume, TestCaseError> {
    let bytes = nifti_bytes(volume, gzip);
    let loaded = read_bytes(&bytes).map_err(|e| TestCaseError::fail(e.to_string()))?;
    prop_assert_eq!(loaded.volume.samples(), volume.samples());
    prop_assert!(
        !loaded.checks.iter().any(|c| c.code == "sform-qform-disagree" || c.code == "trailing-bytes")
    );
    Ok(loaded.volume)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn volumes_survive_a_round_trip(
        dims in prop::array::uniform3(1usize..7),
        kind in 0usize..10,
        seed in any::<u64>(),
        angles in prop::array::uniform3(-3.2f64..3.2),
        spacing in prop::array::uniform3(0.05f64..12.0),
        shear in prop_oneof![Just(0.0), -0.4f64..0.4],
        mirror in any::<bool>(),
        offset in prop::array::uniform3(-2000.0f64..2000.0),
        scaling in prop_oneof![Just((1.0, 0.0)), (0.001f64..9.0, -100.0f64..100.0)],
        gzip in any::<bool>(),
    ) {
        let rotation = DMat3::from_rotation_z(angles[0])
            * DMat3::from_rotation_y(angles[1])
            * DMat3::from_rotation_x(angles[2]);
        let mut m = rotation * DMat3::from_diagonal(DVec3::from_array(spacing));
        m.y_axis += m.x_axis * shear;
        if mirror {
            m.z_axis = -m.z_axis;
        }
        let matrix = DAffine3 { matrix3: m, translation: DVec3::from_array(offset) };
        let grid = Grid::new(dims, matrix, Sides::Known).unwrap();
        let bits: Vec<u64> = (0..grid.voxel_count() as u64)
            .map(|i| (i ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(17))
            .collect();
        let scaling = Scaling { slope: scaling.0, intercept: scaling.1 };
        let volume = Volume::new(grid, samples(kind, &bits), scaling).unwrap();
        let read_back = round_trip(&volume, gzip)?;
        // 32-bit floats in the header: the writer guarantees a thousandth of a voxel.
        prop_assert!(volume.grid().same_place(read_back.grid(), 1e-3));
        prop_assert_eq!(read_back.grid().sides(), Sides::Known);
        prop_assert!((read_back.scaling().slope - scaling.slope).abs() <= 1e-6 * scaling.slope.abs());
        prop_assert!((read_back.scaling().intercept - scaling.intercept).abs() <= 1e-6 * scaling.intercept.abs());
    }
}

/// `write_nifti` lets the crate `nifti` write what it can; only a gzip's blocks may show it.
fn assert_same_bytes(folder: &Path, volume: &Volume) {
    let [plain, packed] = ["a.b.nii", "a.b.nii.GZ"].map(|name| {
        let path = folder.join(name);
        let write = || {
            write_nifti(&path, volume, &WriteOptions::default()).unwrap();
            std::fs::read(&path).unwrap()
        };
        let bytes = write();
        assert!(bytes == write(), "the same volume gives the same file");
        assert_eq!(std::fs::read_dir(folder).unwrap().count(), 1, "no temporary file is left");
        std::fs::remove_file(&path).unwrap();
        bytes
    });
    assert!(plain == nifti_bytes(volume, false), "{:?}", volume.grid());
    // RFC 1952: magic, deflate, no flags, no time.
    assert_eq!(packed[..8], [0x1f, 0x8b, 8, 0, 0, 0, 0, 0]);
    let mut unpacked = Vec::new();
    flate2::read::GzDecoder::new(packed.as_slice()).read_to_end(&mut unpacked).unwrap();
    assert!(unpacked == plain, "{:?}", volume.grid());
}

#[test]
fn written_files_have_the_bytes_of_the_encoder_in_memory() {
    let folder = tempfile::tempdir().unwrap();
    let tilted = DAffine3 { matrix3: DMat3::from_rotation_x(0.4), translation: DVec3::splat(-31.7) };
    let far = DAffine3 { translation: DVec3::splat(1e6 + 0.1), ..tilted };
    let bits: Vec<u64> = (0..840u64).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15)).collect();
    let shapes = [[3, 4, 70], [1, 12, 70], [840, 1, 1], [1, 840, 1], [1, 1, 840], [12, 70, 1]];
    for (kind, (shape, scaled)) in
        (0..10).flat_map(|kind| shapes.map(|shape| (kind, (shape, kind == 3 && shape[0] == 3))))
    {
        for (matrix, sides) in [(tilted, Sides::Known), (far, Sides::Known), (tilted, Sides::Unknown)] {
            let grid = Grid::new(shape, matrix, sides).unwrap();
            let scaling = if scaled { Scaling { slope: 0.1, intercept: -3.0 } } else { Scaling::NONE };
            let volume = Volume::new(grid, samples(kind, &bits), scaling).unwrap();
            assert_same_bytes(folder.path(), &volume);
        }
    }
    let nan = Samples::F32([f32::NAN, -0.0, f32::INFINITY, f32::from_bits(0xffc1_2345)].repeat(2));
    let grid = Grid::new([2, 2, 2], tilted, Sides::Known).unwrap();
    assert_same_bytes(folder.path(), &Volume::new(grid, nan, Scaling::NONE).unwrap());
}

/// Images of several of deflate's blocks, masks, and with a scaling.
#[test]
fn files_of_the_sample_have_the_bytes_of_the_encoder_in_memory() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = 0;
    for (_, bytes) in glioscope_core::sample::sample_files().filter(|(name, _)| name.ends_with(".gz")) {
        assert_same_bytes(folder.path(), &read_bytes(bytes).unwrap().volume);
        files += 1;
    }
    assert_eq!(files, 12);
}

fn plain(dims: [usize; 3], matrix: DAffine3, sides: Sides) -> Volume {
    let grid = Grid::new(dims, matrix, sides).unwrap();
    let n = grid.voxel_count();
    Volume::new(grid, Samples::U8(vec![3; n]), Scaling::NONE).unwrap()
}

fn version_of(volume: &Volume) -> Version {
    Header::parse(&nifti_bytes(volume, false)).unwrap().version
}

#[test]
fn nifti_2_is_written_where_nifti_1_lacks_range_or_precision() {
    let at = |x: f64| DAffine3 { matrix3: DMat3::IDENTITY, translation: DVec3::new(x, 0.0, 0.0) };
    assert_eq!(version_of(&plain([32767, 1, 1], at(0.0), Sides::Known)), Version::One);
    let long = plain([32768, 1, 1], at(0.0), Sides::Known);
    assert_eq!(version_of(&long), Version::Two);
    assert_eq!(round_trip(&long, true).unwrap(), long);
    // 32-bit floats hold 1e6 + 0.1 to 0.06 only.
    let far = plain([2, 2, 2], at(1e6 + 0.1), Sides::Known);
    assert_eq!(version_of(&far), Version::Two);
    assert_eq!(round_trip(&far, false).unwrap(), far);
}

#[test]
fn sform_and_qform_are_written_unless_sheared_and_neither_with_unknown_sides() {
    let folder = tempfile::tempdir().unwrap();
    let codes = |volume: &Volume| {
        let path = folder.path().join("x.nii");
        write_nifti(&path, volume, &WriteOptions { description: "näme".into() }).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(&bytes[148..154], b"n??me\0");
        let info = nifti_info(&Source::File(path)).unwrap();
        (info.sform_code, info.qform_code)
    };
    let upright = DAffine3 { matrix3: DMat3::from_rotation_x(0.4), translation: DVec3::ONE };
    assert_eq!(codes(&plain([2, 2, 2], upright, Sides::Known)), (1, 1));
    assert_eq!(codes(&plain([2, 2, 2], upright, Sides::Unknown)), (0, 0));
    let mut sheared = upright;
    sheared.matrix3.y_axis += sheared.matrix3.x_axis * 0.1;
    assert_eq!(codes(&plain([2, 2, 2], sheared, Sides::Known)), (1, 0));
    let unknown = plain([2, 3, 4], DAffine3::IDENTITY, Sides::Unknown);
    assert_eq!(round_trip(&unknown, true).unwrap(), unknown);
}

#[test]
fn unused_header_fields_are_zero_and_gzip_has_no_time_stamp() {
    let volume = plain([2, 2, 2], DAffine3::IDENTITY, Sides::Known);
    let bytes = nifti_bytes(&volume, false);
    assert_eq!(bytes.len(), 352 + 8);
    // data_type to dim_info, intent, slice fields, aux_file, intent_name.
    for unused in [4..40, 56..70, 74..76, 120..123, 124..148, 157..252, 328..344, 348..352] {
        assert!(bytes[unused.clone()].iter().all(|&b| b == 0), "{unused:?}");
    }
    let packed = nifti_bytes(&volume, true);
    assert_eq!(packed, nifti_bytes(&volume, true));
    // RFC 1952: flags, then four bytes of time.
    assert_eq!(packed[3..8], [0; 5]);
}

/// Renaming over a socket or folder would replace it.
#[cfg(unix)]
#[test]
fn only_regular_files_are_overwritten_and_symlinks_are_kept() {
    use std::os::unix::{fs::FileTypeExt, fs::symlink, net::UnixListener};
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("a.socket");
    let _listener = UnixListener::bind(&socket).unwrap();
    let error = write_whole(&socket, b"x").unwrap_err().to_string();
    assert!(error.contains("a.socket: found something that is no ordinary file"), "{error}");
    assert!(socket.metadata().unwrap().file_type().is_socket());
    assert!(write_whole(folder.path(), b"x").is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");

    let (file, link) = (folder.path().join("file"), folder.path().join("link"));
    write_whole(&file, b"before").unwrap();
    symlink(&file, &link).unwrap();
    write_whole(&link, b"after").unwrap();
    assert!(link.is_symlink());
    assert_eq!(std::fs::read(&file).unwrap(), b"after");
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_permissions_and_a_protected_one_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("numbers.csv");
    write_whole(&path, b"1").unwrap();
    for mode in [0o600, 0o664, 0o640] {
        std::fs::set_permissions(&path, PermissionsExt::from_mode(mode)).unwrap();
        write_whole(&path, b"2").unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, mode);
    }
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o444)).unwrap();
    let error = write_whole(&path, b"3").unwrap_err().to_string();
    assert!(error.contains("write-protected"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), b"2");
}

/// Names the file that [`writer_to_be_killed`] writes, over and over.
const KILLED_FILE: &str = "GLIOSCOPE_TEST_KILLED_FILE";

/// Contents of 3 MiB that differ in every byte.
fn content(version: usize) -> Vec<u8> {
    vec![b'A' + (version % 2) as u8; 3 << 20]
}

/// Child process of [`a_killed_writer_leaves_the_old_or_the_new_file_whole`].
#[test]
#[ignore = "a child process of another test"]
fn writer_to_be_killed() {
    let Some(path) = std::env::var_os(KILLED_FILE) else { return };
    let found = std::fs::read(&path).unwrap();
    for version in usize::from(found == content(0)).. {
        write_whole(Path::new(&path), &content(version)).unwrap();
    }
}

#[test]
fn a_killed_writer_leaves_the_old_or_the_new_file_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.json");
    write_whole(&path, &content(1)).unwrap();
    let valid = [content(0), content(1)];
    let (mut seen, mut leftovers, mut state) = ([0; 2], 0, 7_u64);
    for kill in 0..200 {
        let mut child = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "files_write::writer_to_be_killed", "--ignored"])
            .env(KILLED_FILE, &path)
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        std::thread::sleep(std::time::Duration::from_micros((state >> 33) % 25_000));
        child.kill().unwrap();
        child.wait().unwrap();
        let found = std::fs::read(&path).unwrap();
        let version = valid.iter().position(|content| *content == found);
        seen[version.unwrap_or_else(|| panic!("kill {kill}: {} bytes, neither file", found.len()))] += 1;
        for entry in std::fs::read_dir(folder.path()).unwrap() {
            let entry = entry.unwrap();
            if entry.path() != path {
                // As if it had been killed yesterday.
                let yesterday = std::time::SystemTime::now() - std::time::Duration::from_secs(86_400);
                std::fs::File::options()
                    .write(true)
                    .open(entry.path())
                    .unwrap()
                    .set_modified(yesterday)
                    .unwrap();
                leftovers += 1;
            }
        }
    }
    println!("200 kills: {seen:?} versions, {leftovers} leftovers");
    assert!(seen.iter().all(|count| *count > 20), "{seen:?}");
    // The next write removes what is old, and only that.
    let (mine, recent) = (folder.path().join("mine.glioscope"), folder.path().join(".glioscope-running"));
    write_whole(&mine, b"x").unwrap();
    write_whole(&recent, b"x").unwrap();
    write_whole(&path, b"done").unwrap();
    let mut left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
    left.sort();
    assert_eq!(left, [recent, mine, path]);
    assert!(leftovers > 0);
}

/// Names and content of the files in `folder`.
#[cfg(unix)]
fn files_in(folder: &Path) -> Vec<(String, String)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let mut all: Vec<_> = entries
        .filter(|entry| entry.path().is_file())
        .map(|e| (e.file_name().into_string().unwrap(), std::fs::read_to_string(e.path()).unwrap()))
        .collect();
    all.sort();
    all
}

/// The last of the new files meets a folder of its name, which can't be replaced.
#[cfg(unix)]
#[test]
fn files_are_replaced_together_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let names = ["a", "b", "c"].map(str::to_owned);
    let outdated = ["old".to_owned(), "absent".to_owned()];
    for (name, content) in [("a", "old a"), ("old", "old"), ("mine", "mine")] {
        write_whole(&at(name), content.as_bytes()).unwrap();
    }
    let replace = |names: &[String], outdated: &[String]| {
        let new = temporary_folder(folder.path()).unwrap();
        for name in names {
            write_whole(&new.path().join(name), format!("new {name}").as_bytes()).unwrap();
        }
        replace_files(&new, folder.path(), names, outdated)
    };
    let before = files_in(folder.path());
    std::fs::create_dir(at("c")).unwrap();
    let error = replace(&names, &outdated).unwrap_err().to_string();
    assert!(error.contains("writing failed") && !error.contains("put back"), "{error}");
    assert_eq!(files_in(folder.path()), before);
    // One that fails in the middle of moving: a file that is named twice is gone the second time.
    let twice = [names[0].clone(), names[1].clone(), names[0].clone()];
    std::fs::remove_dir(at("c")).unwrap();
    assert!(replace(&twice, &[]).is_err());
    assert_eq!(files_in(folder.path()), before);

    replace(&names, &outdated).unwrap();
    let after: Vec<String> =
        files_in(folder.path()).into_iter().map(|(name, text)| format!("{name}: {text}")).collect();
    assert_eq!(after, ["a: new a", "b: new b", "c: new c", "mine: mine"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4, "no temporary folder is left");
}

#[cfg(unix)]
#[test]
fn folders_that_killed_runs_left_are_removed_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let yesterday = std::time::SystemTime::now() - std::time::Duration::from_secs(86_400);
    let names = [
        ".glioscope-aB3dE9",
        ".glioscope-mine",
        ".glioscope-a.3dE9",
        "glioscope-aB3dE9",
        ".glioscope-zB3dE9",
    ];
    for name in names {
        std::fs::create_dir(folder.path().join(name)).unwrap();
        write_whole(&folder.path().join(name).join("file"), b"x").unwrap();
        if name != ".glioscope-zB3dE9" {
            std::fs::File::open(folder.path().join(name)).unwrap().set_modified(yesterday).unwrap();
        }
    }
    write_whole(&folder.path().join("file"), b"x").unwrap();
    let left: Vec<bool> = names.iter().map(|name| folder.path().join(name).exists()).collect();
    assert_eq!(left, [false, true, true, true, true]);
}

/// Beside what the system says when a file is created there: also of a user to whom every folder is open.
#[test]
fn a_folder_is_writable_where_a_file_can_be_created() {
    let folder = tempfile::tempdir().unwrap();
    let (own, file, missing) =
        (folder.path().join("own"), folder.path().join("file"), folder.path().join("missing"));
    std::fs::create_dir(&own).unwrap();
    write_whole(&file, b"").unwrap();
    assert!(is_writable_folder(&own) && !is_writable_folder(&file) && !is_writable_folder(&missing));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(&own, std::fs::Permissions::from_mode(0o555)).unwrap();
        assert_eq!(is_writable_folder(&own), write_whole(&own.join("probe"), b"").is_ok());
        std::fs::set_permissions(&own, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
}
