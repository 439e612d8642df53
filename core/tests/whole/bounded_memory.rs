//! Files that declare gigabytes, or inflate to them, give an error within 2 s and 100 MB. Each is
//! read in its own process, which reports its peak resident memory (Linux only).

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use glioscope_core::Progress;
use glioscope_core::files::{Source, TractOptions, read_tracts};

use crate::common::{NiftiBuilder, files_below, gzip, real_data, tracts};

/// Not a test of its own: [`is_rejected_within_bounds`] runs it in a child process.
#[test]
#[ignore = "run in a child process by the tests of this file"]
fn child_reads_one_file() {
    let path = PathBuf::from(std::env::var_os("GLIOSCOPE_CHILD_FILE").expect("started by the parent"));
    let tracts = path.extension().is_some_and(|e| e == "tck" || e == "trk");
    let read = || match tracts {
        true => {
            read_tracts(&Source::File(path.clone()), &TractOptions::default(), &Progress::new()).map(drop)
        }
        false => crate::common::read(&path).map(drop),
    };
    let outcome = read().map(|()| "loaded".to_owned()).unwrap_or_else(|e| e.to_string());
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let peak = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
    println!("\nOUTCOME {outcome}\nPEAK {}", peak.split_whitespace().nth(1).unwrap());
}

/// Outcome, peak in KiB, time.
fn read_in_child(path: &Path) -> (String, u64, Duration) {
    let start = Instant::now();
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "bounded_memory::child_reads_one_file", "--nocapture"])
        .env("GLIOSCOPE_CHILD_FILE", path)
        .output()
        .unwrap();
    let elapsed = start.elapsed();
    let text = String::from_utf8(output.stdout).unwrap();
    let line = |key: &str| text.lines().find_map(|l| l.strip_prefix(key)).unwrap_or_else(|| panic!("{text}"));
    (line("OUTCOME ").to_owned(), line("PEAK ").parse().unwrap(), elapsed)
}

fn is_rejected_within_bounds(path: &Path) {
    let (outcome, peak_kib, elapsed) = read_in_child(path);
    assert_ne!(outcome, "loaded", "{}", path.display());
    assert!(peak_kib < 100_000, "{}: {peak_kib} KiB", path.display());
    assert!(elapsed < Duration::from_secs(2), "{}: {elapsed:?}", path.display());
}

fn linux() -> bool {
    if !cfg!(target_os = "linux") {
        let _ = writeln!(std::io::stderr(), "SKIPPED: peak memory is read from /proc, which only Linux has");
    }
    cfg!(target_os = "linux")
}

#[test]
fn decompression_bombs_are_rejected_within_bounds() {
    if !linux() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        glioscope_core::files::write_whole(&path, bytes).unwrap();
        is_rejected_within_bounds(&path);
    };
    // Inflates to 300 MB behind a header that declares 48 bytes.
    let mut bomb = NiftiBuilder::new().bytes;
    bomb.resize(300 << 20, 0);
    put("bomb.nii.gz", &gzip(&bomb));
    // Declares 1 GiB that the file can't contain, then 1 GiB that its gzip could but doesn't contain.
    let mut claim = NiftiBuilder::new();
    claim.i16s(40, &[3, 1024, 1024, 1024]).i16s(70, &[2, 8]);
    put("claim.nii", &claim.bytes);
    put("claim.nii.gz", &gzip(&claim.bytes));
    let mut state = 1u64;
    claim.bytes.extend((0..2_000_000).map(|_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 56) as u8
    }));
    put("half-held.nii.gz", &gzip(&claim.bytes));
    // A data offset, and with it an extension chain, of 60 MB.
    let mut offset = NiftiBuilder::new();
    offset.f32s(108, &[60e6]);
    put("offset.nii", &offset.bytes);
    put("offset.nii.gz", &gzip(&offset.bytes));
}

#[test]
fn tracts_with_huge_declared_sizes_are_rejected_within_bounds() {
    if !linux() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // Sparse files of gigabytes behind a header: declared data that is missing, and endless zeros.
    let put = |name: &str, head: &[u8], length: u64| {
        let path = folder.path().join(name);
        glioscope_core::files::write_whole(&path, head).unwrap();
        let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        file.set_len(length.max(head.len() as u64)).unwrap();
        is_rejected_within_bounds(&path);
    };
    let head = b"mrtrix tracks\ncount: 4000000000\ndatatype: Float32LE\nfile: . 68\nEND\n";
    let nan = [f32::NAN, 1.0, 1.0].map(f32::to_le_bytes).concat();
    put("claims.tck", head, 0);
    put("damaged.tck", &[&head[..], b" ", &nan].concat(), 2 << 30);
    put("too-large.tck", head, 5 << 30);
    put("no-end.tck", b"mrtrix tracks\n", 2 << 30);
    let mut trk = tracts::Trk { count: i32::MAX, ..tracts::Trk::new() }.bytes();
    trk[1000..1004].copy_from_slice(&i32::MAX.to_le_bytes());
    put("claims.trk", &trk, 0);
    put("claims-more.trk", &trk, 2 << 30);
    trk[1000..1016]
        .copy_from_slice(&[1_000_000_i32.to_le_bytes(), f32::NAN.to_le_bytes(), [0; 4], [0; 4]].concat());
    put("damaged.trk", &trk, 2 << 30);
    // Scalars of the most columns, of which the reader has lists.
    let mut trk =
        tracts::Trk { count: i32::MAX, scalars: i16::MAX, properties: i16::MAX, ..tracts::Trk::new() }
            .bytes();
    trk.truncate(1000);
    trk.extend(i32::MAX.to_le_bytes());
    put("scalars.trk", &trk, 2 << 30);
}

#[test]
fn every_malformed_file_is_rejected_within_bounds() {
    let Some(folder) = real_data("nifti-malformed") else { return };
    if !linux() {
        return;
    }
    for path in files_below(&folder) {
        is_rejected_within_bounds(&path);
    }
}

/// Some of them load: each has at most 34 kB of voxels.
#[test]
fn every_malformed_nrrd_and_metaimage_is_read_within_bounds() {
    let Some(folder) = real_data("nrrd-mha-malformed") else { return };
    if !linux() {
        return;
    }
    for path in files_below(&folder).into_iter().filter(|path| path.extension().is_some_and(|e| e != "json"))
    {
        let (_, peak_kib, elapsed) = read_in_child(&path);
        assert!(peak_kib < 100_000, "{}: {peak_kib} KiB", path.display());
        assert!(elapsed < Duration::from_secs(2), "{}: {elapsed:?}", path.display());
    }
}

/// A valid volume needs little more memory than its own voxels: one pass, no second copy.
#[test]
fn a_large_valid_volume_needs_little_more_than_its_voxels() {
    if !linux() {
        return;
    }
    let mut volume = NiftiBuilder::new();
    volume.i16s(40, &[3, 256, 256, 512]);
    volume.bytes.resize(352 + 2 * 256 * 256 * 512, 0);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("honest.nii.gz");
    glioscope_core::files::write_whole(&path, &gzip(&volume.bytes)).unwrap();
    let (outcome, peak_kib, _) = read_in_child(&path);
    assert_eq!(outcome, "loaded");
    assert!((65_536..90_000).contains(&peak_kib), "{peak_kib} KiB for 65536 KiB of voxels");
}
