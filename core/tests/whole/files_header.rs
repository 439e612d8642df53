//! Truncated, damaged and impossible headers and files: an error or the same voxels, never a panic.

use crate::common::{NiftiBuilder, codes, gzip, numbers, read, read_bytes};
use glioscope_core::files::{self, FileError, ReadOptions, Source, WriteOptions, write_nifti};
use glioscope_core::{Cancelled, Progress, Samples};

/// 40 x 30 x 20 voxels of int16 that hardly compress.
fn larger() -> Vec<u8> {
    let mut nifti = NiftiBuilder::new();
    nifti.i16s(40, &[3, 40, 30, 20]);
    nifti.bytes.truncate(352);
    let noise = (0..24_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 16) as i16);
    nifti.bytes.extend(noise.flat_map(i16::to_le_bytes));
    nifti.bytes
}

fn nifti_2(paired: bool) -> Vec<u8> {
    let mut bytes = vec![0; 544];
    bytes[..4].copy_from_slice(&540i32.to_le_bytes());
    bytes[4..12].copy_from_slice(if paired { b"ni2\0\r\n\x1a\n" } else { b"n+2\0\r\n\x1a\n" });
    bytes[12..16].copy_from_slice(&[2, 0, 8, 0]);
    for (i, d) in [3i64, 2, 3, 4, 0, 0, 0, 0].into_iter().enumerate() {
        bytes[16 + 8 * i..24 + 8 * i].copy_from_slice(&d.to_le_bytes());
        bytes[104 + 8 * i..112 + 8 * i].copy_from_slice(&1.0f64.to_le_bytes());
    }
    bytes[168..176].copy_from_slice(&if paired { 0i64 } else { 544 }.to_le_bytes());
    bytes.extend(0..24u8);
    bytes
}

#[test]
fn every_truncated_file_is_an_error() {
    let small = NiftiBuilder::new().bytes;
    assert!(read_bytes(&small).is_ok());
    for cut in 0..small.len() {
        assert!(read_bytes(&small[..cut]).is_err(), "cut at {cut}");
    }
    let large = larger();
    let packed = gzip(&large);
    assert!(read_bytes(&large).is_ok() && read_bytes(&packed).is_ok());
    for i in 0..1000 {
        let cut = (i * 48_271 + 11) % large.len();
        assert!(read_bytes(&large[..cut]).is_err(), "cut at {cut}");
        let cut = (i * 48_271 + 11) % packed.len();
        assert!(read_bytes(&packed[..cut]).is_err(), "gzip cut at {cut}");
    }
    let nifti_2 = nifti_2(false);
    assert!(read_bytes(&nifti_2).is_ok());
    for cut in 0..nifti_2.len() {
        assert!(read_bytes(&nifti_2[..cut]).is_err(), "NIfTI-2 cut at {cut}");
    }
}

#[test]
fn every_flipped_header_bit_is_an_error_or_loads_completely() {
    let mut good = NiftiBuilder::new();
    good.sform(1, [[1.5, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]]);
    let intact = good.read().unwrap();
    // Fields that are not read: data_type to dim_info, intent, slice and calibration, texts.
    let unread = [4..40, 56..70, 74..76, 120..123, 124..252, 328..344, 349..352];
    // Size field, data type, bits, offset, magic: any flipped bit makes the file invalid.
    let vital = [0..4, 41..42, 70..74, 108..112, 344..348];
    let (mut loaded, mut refused) = (0, 0);
    for bit in 0..352 * 8 {
        let mut bytes = good.bytes.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let result = read_bytes(&bytes);
        let within = |fields: &[std::ops::Range<usize>]| fields.iter().any(|f| f.contains(&(bit / 8)));
        match result {
            Ok(other) => {
                loaded += 1;
                assert!(!within(&vital), "bit {bit} of a vital field was not detected");
                assert_eq!(other.volume.samples().len(), other.volume.grid().voxel_count());
                if within(&unread) {
                    assert_eq!(other.volume, intact.volume, "bit {bit}");
                }
            }
            Err(e) => {
                refused += 1;
                assert!(!within(&unread), "bit {bit}: {e}");
            }
        }
    }
    assert!(loaded > 1500 && refused > 100, "{loaded} loaded, {refused} refused");
    let nifti_2 = nifti_2(false);
    for bit in 0..544 * 8 {
        let mut bytes = nifti_2.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        if let Ok(other) = read_bytes(&bytes) {
            assert_eq!(other.volume.samples().len(), other.volume.grid().voxel_count());
        }
    }
}

#[test]
fn random_damage_is_an_error_or_loads_completely() {
    let seeds =
        [NiftiBuilder::new().bytes, nifti_2(false), gzip(&NiftiBuilder::new().bytes), gzip(&nifti_2(false))];
    let mut state = 20_261_122_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let options = ReadOptions { max_bytes: 1 << 20, frame: 0 };
    let mut loaded = 0;
    for i in 0..20_000 {
        let mut bytes = seeds[i % seeds.len()].clone();
        for _ in 0..=random(4) {
            let (at, odd) = (random(bytes.len()), [0, 1, 0x7f, 0x80, 0xff][random(5)]);
            let run = [1, 2, 4, 8][random(4)].min(bytes.len() - at);
            bytes[at..at + run].fill(odd);
        }
        if random(8) == 0 {
            bytes.truncate(random(bytes.len()));
        }
        if let Ok(other) = files::read_bytes("made", &bytes, &options, &Progress::new()) {
            loaded += 1;
            assert_eq!(other.volume.samples().len(), other.volume.grid().voxel_count());
            assert!(other.volume.grid().voxel_volume_mm3() > 0.0);
        }
    }
    assert!((1000..15_000).contains(&loaded), "{loaded} loaded");
}

#[test]
fn impossible_headers_are_refused_naming_the_field() {
    let refuse = |nifti: &NiftiBuilder, why: &str| {
        let error = nifti.read().unwrap_err().to_string();
        assert!(error.starts_with("made.nii: found ") && error.contains(why), "{error}, expected {why}");
        assert_eq!(error.lines().count(), 1);
    };
    for rank in [0, 8, -1] {
        refuse(NiftiBuilder::new().i16s(40, &[rank]), "dim[0]");
    }
    refuse(NiftiBuilder::new().i16s(42, &[0]), "dim[1] = 0");
    refuse(NiftiBuilder::new().i16s(46, &[-4]), "dim[3] = -4");
    refuse(NiftiBuilder::new().i16s(42, &[32767, 32767, 32767]), "dimensions [32767, 32767, 32767]");
    refuse(
        NiftiBuilder::new().i16s(40, &[7, 2, 3, 4, 32767, 32767, 32767, 32767]),
        "32767, 32767], expected fewer",
    );
    refuse(NiftiBuilder::new().i16s(40, &[5, 2, 3, 4, 32767, 32767]), "400 bytes, expected the 515364622");
    refuse(NiftiBuilder::new().i16s(72, &[8]), "bitpix 8 with datatype int16");
    for (code, bits, name) in [
        (1, 1, "binary"),
        (32, 64, "complex64"),
        (1536, 128, "float128"),
        (1792, 128, "complex128"),
        (2048, 256, "complex256"),
        (0, 0, "code 0"),
        (999, 8, "code 999"),
    ] {
        refuse(NiftiBuilder::new().i16s(70, &[code, bits]), name);
    }
    refuse(NiftiBuilder::new().i16s(70, &[128, 32]), "bitpix 32 with datatype RGB24");
    for offset in [0.0, 348.0, 351.0, 352.5, -352.0, 1e9, f32::NAN, f32::INFINITY] {
        refuse(NiftiBuilder::new().f32s(108, &[offset]), "vox_offset");
    }
    refuse(NiftiBuilder::new().f32s(108, &[368.0]), "400 bytes, expected the 416 bytes");
    refuse(NiftiBuilder::new().put(344, b"ni1\0"), "header of a pair");
    refuse(NiftiBuilder::new().put(344, b"\0\0\0\0"), "ANALYZE");
    refuse(NiftiBuilder::new().put(344, b"n+3\0"), "n+3");
    let mut odd = nifti_2(false);
    odd[8] = b'\n';
    assert!(read_bytes(&odd).unwrap_err().to_string().contains("magic"));
}

#[test]
fn voxels_are_read_at_vox_offset() {
    for offset in [352usize, 368, 1024] {
        let mut nifti = NiftiBuilder::new();
        let voxels = nifti.bytes.split_off(352);
        nifti.f32s(108, &[offset as f32]);
        nifti.bytes.resize(offset, 0xee);
        nifti.bytes[348] = 0;
        nifti.bytes.extend(voxels);
        for bytes in [nifti.bytes.clone(), gzip(&nifti.bytes)] {
            let loaded = read_bytes(&bytes).unwrap();
            assert_eq!(numbers(loaded.volume.samples()), (0..24).map(f64::from).collect::<Vec<_>>());
        }
    }
}

#[test]
fn extensions_are_skipped_within_bounds() {
    let with = |sizes: &[i32], room: usize| {
        let mut nifti = NiftiBuilder::new();
        let voxels = nifti.bytes.split_off(352);
        nifti.put(348, &[1]).f32s(108, &[(352 + room) as f32]);
        for &size in sizes {
            nifti.bytes.extend(size.to_le_bytes());
            nifti.bytes.resize(nifti.bytes.len() + usize::try_from(size - 4).unwrap_or(12), 6);
        }
        nifti.bytes.resize(352 + room, 0);
        nifti.bytes.extend(voxels);
        nifti
    };
    let fine = with(&[16, 32, 160], 208);
    let path = tempfile::NamedTempFile::new().unwrap();
    std::io::Write::write_all(&mut path.as_file(), &fine.bytes).unwrap();
    assert_eq!(files::nifti_info(&Source::File(path.path().into())).unwrap().extensions, 3);
    assert_eq!(numbers(fine.read().unwrap().volume.samples())[23], 23.0);
    assert_eq!(numbers(read_bytes(&gzip(&fine.bytes)).unwrap().volume.samples())[23], 23.0);
    let all = vec![16; 1024];
    assert!(with(&all, 16 * 1024).read().is_ok());
    let many = vec![16; 1025];
    assert!(with(&many, 16 * 1025).read().unwrap_err().to_string().contains("more than 1024 extensions"));
    for (sizes, room) in [(&[-16][..], 32), (&[64], 32), (&[16, 33], 48), (&[7], 32), (&[24, 16], 36)] {
        let error = with(sizes, room).read().unwrap_err().to_string();
        assert!(error.contains("extension"), "{sizes:?} in {room}: {error}");
    }
    // Of odd sizes, or with zeros behind the last: where the voxels begin is known from vox_offset.
    for (sizes, room) in [
        (&[0][..], 32),
        (&[8], 32),
        (&[24], 32),
        (&[165], 165),
        (&[165], 176),
        (&[16], 36),
        (&[16], 20),
        (&[16], 19),
        (&[17, 16, 15], 48),
    ] {
        for bytes in [with(sizes, room).bytes.clone(), gzip(&with(sizes, room).bytes)] {
            let loaded = read_bytes(&bytes).unwrap();
            assert_eq!(numbers(loaded.volume.samples())[23], 23.0, "{sizes:?} in {room}");
            let odd: Vec<_> = loaded.checks.iter().filter(|c| c.code == "extension-odd").collect();
            assert_eq!(odd.len(), 1, "{sizes:?} in {room}: {:?}", loaded.checks);
            assert_eq!(odd[0].severity, glioscope_core::Severity::Warning);
        }
    }
    assert!(!codes(&fine.read().unwrap()).contains(&"extension-odd"));
    assert!(codes(&with(&[], 0).read().unwrap()).contains(&"extension-missing"));
}

#[test]
fn invalid_scaling_is_ignored_and_reported() {
    let scaled = |slope: f32, intercept: f32| {
        let loaded = NiftiBuilder::new().f32s(112, &[slope, intercept]).read().unwrap();
        let code = loaded.checks.iter().find(|c| c.code == "scaling-ignored").map(|c| c.severity);
        (loaded.volume.value(3), code)
    };
    use glioscope_core::Severity::{Note, Warning};
    assert_eq!(scaled(0.5, -1.0), (0.5, None));
    assert_eq!(scaled(-2.0, 0.25), (-5.75, None));
    assert_eq!(scaled(0.0, 0.0), (3.0, None));
    assert_eq!(scaled(0.0, 7.0), (3.0, Some(Note)));
    assert_eq!(scaled(f32::NAN, 0.0), (3.0, Some(Note)));
    assert_eq!(scaled(f32::INFINITY, 0.0), (3.0, Some(Note)));
    assert_eq!(scaled(1.0, f32::NAN), (3.0, Some(Warning)));
    assert_eq!(scaled(2.0, f32::NEG_INFINITY), (3.0, Some(Warning)));
}

/// Writers that store a fourth dimension without frames mean the one volume that the file has.
#[test]
fn a_size_of_0_above_the_third_dimension_means_one_frame() {
    for (dims, warnings) in
        [([4, 2, 3, 4, 0, 1, 1, 1], 1), ([5, 2, 3, 4, 0, 0, 1, 1], 2), ([3, 2, 3, 4, 0, 0, 0, 0], 0)]
    {
        let loaded = NiftiBuilder::new().i16s(40, &dims).read().unwrap();
        assert_eq!((loaded.frames, loaded.volume.grid().dims()), (1, [2, 3, 4]), "{dims:?}");
        assert_eq!(numbers(loaded.volume.samples()), (0..24).map(f64::from).collect::<Vec<_>>());
        assert_eq!(codes(&loaded).iter().filter(|code| **code == "dim-zero").count(), warnings, "{dims:?}");
    }
    assert!(NiftiBuilder::new().i16s(40, &[4, 2, 3, 4, -1]).read().is_err());
    assert!(NiftiBuilder::new().i16s(40, &[3, 2, 3, 0]).read().is_err(), "which axis is missing is unknown");
}

#[test]
fn spacings_that_no_scanner_has_are_reported() {
    let unusual = |spacing: f32| {
        let mut nifti = NiftiBuilder::new();
        nifti.sform(1, [[spacing, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        nifti.f32s(76, &[1.0, spacing, 1.0, 1.0]);
        let found = nifti.read().unwrap().checks;
        found.into_iter().find(|c| c.code == "spacing-unusual").map(|c| c.message)
    };
    assert_eq!([0.0011, 0.3, 1.0, 100.0].map(unusual), [const { None }; 4]);
    let tiny = unusual(1e-6).unwrap();
    assert!(tiny.contains("found voxels of 1.0e-6 × 1.0000 × 1.0000 mm, expected 0.001 to 100 mm"), "{tiny}");
    assert!(unusual(3e-4).unwrap().contains("0.0003 × "));
    assert!(unusual(1e6).is_some());
}

/// The sform is in force, so that volumes follow it; programs that take pixdim find others.
#[test]
fn a_pixdim_that_contradicts_the_sform_is_a_warning() {
    let mut nifti = NiftiBuilder::new();
    nifti.sform(1, [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    nifti.f32s(76, &[1.0, 2.0, 2.0, 2.0]);
    let loaded = nifti.read().unwrap();
    assert_eq!(loaded.volume.grid().voxel_volume_mm3(), 1.0);
    let check = loaded.checks.iter().find(|c| c.code == "pixdim-sform-disagree").unwrap();
    assert_eq!(check.severity, glioscope_core::Severity::Warning);
    assert!(check.message.contains("pixdim says 2.0000 × 2.0000 × 2.0000 mm, the sform 1.0000"), "{check:?}");
}

#[test]
fn frames_are_counted_through_all_dimensions_above_3() {
    let mut nifti = NiftiBuilder::new();
    nifti.i16s(40, &[5, 2, 3, 1, 2, 2]);
    for bytes in [nifti.bytes.clone(), gzip(&nifti.bytes)] {
        for frame in 0..4 {
            let options = ReadOptions { frame, ..ReadOptions::default() };
            let loaded = files::read_bytes("made", &bytes, &options, &Progress::new()).unwrap();
            let first = frame as i16 * 6;
            assert_eq!(loaded.volume.samples(), &Samples::I16((first..first + 6).collect()));
            assert_eq!(loaded.frames, 4);
        }
        let options = ReadOptions { frame: 4, ..ReadOptions::default() };
        let error = files::read_bytes("made", &bytes, &options, &Progress::new()).unwrap_err().to_string();
        assert_eq!(error, "made: found 4 frame(s), expected more than 4, as frame 4 (from 0) is asked for");
    }
}

#[test]
fn size_limit_trailing_bytes_and_cancelling() {
    let mut nifti = NiftiBuilder::new();
    let options = ReadOptions { max_bytes: 47, frame: 0 };
    let error = files::read_bytes("made", &nifti.bytes, &options, &Progress::new()).unwrap_err();
    assert!(error.to_string().contains("48 bytes of voxels a frame, expected at most 47"), "{error}");
    nifti.bytes.extend([1; 9]);
    assert!(codes(&nifti.read().unwrap()).contains(&"trailing-bytes"));
    assert!(codes(&read_bytes(&gzip(&nifti.bytes)).unwrap()).contains(&"trailing-bytes"));
    let progress = Progress::new();
    progress.cancel();
    let cancelled = files::read_bytes("made", &nifti.bytes, &ReadOptions::default(), &progress);
    assert_eq!(cancelled, Err(FileError::Cancelled(Cancelled)));
}

#[test]
fn pairs_load_from_either_half_with_any_mix_of_compression() {
    let mut header = NiftiBuilder::new();
    header.put(344, b"ni1\0").f32s(108, &[0.0]);
    let voxels = header.bytes.split_off(352);
    for header_bytes in [header.bytes[..348].to_vec(), header.bytes.clone()] {
        for (h, i) in [
            (".hdr", ".img"),
            (".hdr.gz", ".img.gz"),
            (".hdr", ".img.gz"),
            (".hdr.gz", ".img"),
            (".HDR", ".IMG"),
            (".HDR", ".img.gz"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = |ending: &str| folder.path().join(format!("a.b{ending}"));
            let pack = |bytes: &[u8], e: &str| if e.ends_with("gz") { gzip(bytes) } else { bytes.to_vec() };
            files::write_whole(&path(h), &pack(&header_bytes, h)).unwrap();
            let without_partner = read(&path(h)).unwrap_err().to_string();
            assert!(without_partner.contains("beside it"), "{without_partner}");
            files::write_whole(&path(i), &pack(&voxels, i)).unwrap();
            for half in [h, i] {
                let loaded = read(&path(half)).unwrap();
                assert_eq!(numbers(loaded.volume.samples())[23], 23.0, "{h} {i} from {half}");
            }
            let info = files::nifti_info(&Source::File(path(h))).unwrap();
            assert_eq!(info.image_file, Some(path(i).display().to_string()));
            std::fs::remove_file(path(h)).unwrap();
            assert!(read(&path(i)).unwrap_err().to_string().contains("beside it"));
            std::fs::remove_file(path(i)).unwrap();
            assert!(read(&path(i)).unwrap_err().to_string().contains("no such file"));
        }
    }
    // The magic decides, not the name: a single file named .hdr.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.hdr");
    files::write_whole(&path, &NiftiBuilder::new().bytes).unwrap();
    assert!(read(&path).is_ok());
    // A NIfTI-2 pair with an offset into the image file.
    let mut nifti_2 = nifti_2(true);
    let voxels = nifti_2.split_off(544);
    nifti_2[168..176].copy_from_slice(&100i64.to_le_bytes());
    files::write_whole(&folder.path().join("two.hdr"), &nifti_2).unwrap();
    files::write_whole(&folder.path().join("two.img"), &[vec![9; 100], voxels].concat()).unwrap();
    assert_eq!(numbers(read(&folder.path().join("two.hdr")).unwrap().volume.samples())[5], 5.0);
}

#[test]
fn info_reports_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.nii");
    let mut nifti = NiftiBuilder::new();
    nifti.sform(1, [[-1.5, 0.0, 0.0, 90.0], [0.0, 0.0, 3.0, -126.0], [0.0, 2.0, 0.0, -72.0]]);
    nifti.i16s(40, &[4, 2, 3, 2, 2]).f32s(112, &[0.5, -4.0]);
    files::write_whole(&path, &gzip(&nifti.bytes)).unwrap();
    let info = serde_json::to_value(files::nifti_info(&Source::File(path.clone())).unwrap()).unwrap();
    let expected = serde_json::json!({
        "file": path.display().to_string(), "image_file": null, "format": "NIfTI-1", "byte_order": "little",
        "gzip": true, "dims": [2, 3, 2, 2], "frames": 2, "datatype": "int16", "components": 1, "frame_bytes": 24,
        "spacing_mm": [1.5, 2.0, 3.0],
        "world_from_voxel": [[-1.5, 0.0, 0.0, 90.0], [0.0, 0.0, 3.0, -126.0], [0.0, 2.0, 0.0, -72.0], [0.0, 0.0, 0.0, 1.0]],
        "axis_codes": "LSA", "form": "sform", "sform_code": 1, "qform_code": 0, "unit": "mm",
        "slope": 0.5, "intercept": -4.0, "label_tolerance": 0.25, "extensions": 0, "checks": [],
    });
    assert_eq!(info, expected);
    // info reads to the end: damage after the header is detected.
    let mut packed = gzip(&nifti.bytes);
    *packed.last_mut().unwrap() ^= 1;
    files::write_whole(&path, &packed).unwrap();
    assert!(files::nifti_info(&Source::File(path)).unwrap_err().to_string().contains("damaged gzip"));
}

#[test]
fn non_nifti_paths_and_contents_give_one_line_errors() {
    let folder = tempfile::tempdir().unwrap();
    // A folder may hold slices.
    let error = read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("found no DICOM image"), "{error}");
    let odd = folder.path().join("line\nbreak\u{202e}.nii");
    let error = read(&odd).unwrap_err().to_string();
    assert!(
        error.lines().count() == 1 && !error.contains('\u{202e}') && error.contains("no such file"),
        "{error}"
    );
    for (bytes, what) in [
        (&b"  <!DOCTYPE html>"[..], "an HTML page"),
        (b"<?xml version", "web page or XML"),
        (b"/annex/objects/MD5E-s9--0.nii.gz", "a git-annex pointer, expected its content (fetch"),
        (b"version https://git-lfs.github.com/spec/v1", "a git-LFS pointer"),
        (b"NRRD0004\n", "NRRD"),
        (b"", "empty"),
        (b"abc", "3 bytes"),
    ] {
        let error = read_bytes(bytes).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
}

/// Also where a pair's second half is the link.
#[cfg(unix)]
#[test]
fn broken_links_are_named_as_what_they_are() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    symlink("away.nii.gz", at("a.nii.gz")).unwrap();
    symlink(".git/annex/objects/x/y/SHA256E-s9--0.img", at("b.img")).unwrap();
    let mut header = NiftiBuilder::new();
    header.put(344, b"ni1\0").f32s(108, &[0.0]);
    files::write_whole(&at("b.hdr"), &header.bytes[..348]).unwrap();
    let error = |name: &str| read(&at(name)).unwrap_err().to_string();
    assert!(error("a.nii.gz").contains("found a link whose target away.nii.gz does not exist"));
    for name in ["b.hdr", "b.img"] {
        assert!(error(name).contains("b.img: found a link of git-annex whose content is not here"), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_pipe_is_refused_without_blocking() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pipe.nii");
    let nifti = std::process::Command::new("mkfifo").arg(&path).status().unwrap();
    assert!(nifti.success());
    assert!(read(&path).unwrap_err().to_string().contains("pipe or device"));
}

#[test]
fn a_failed_write_leaves_the_existing_file() {
    let folder = tempfile::tempdir().unwrap();
    let volume = NiftiBuilder::new().read().unwrap().volume;
    let path = folder.path().join("x.nii.gz");
    write_nifti(&path, &volume, &WriteOptions::default()).unwrap();
    let before = std::fs::read(&path).unwrap();
    assert_eq!(before[..2], [0x1f, 0x8b]);
    let absent = folder.path().join("none/x.nii");
    let error = write_nifti(&absent, &volume, &WriteOptions::default()).unwrap_err().to_string();
    assert!(error.contains("none/x.nii: found writing failed: "), "{error}");
    assert!(!error.contains(".glioscope-"), "the temporary file's name tells nothing: {error}");
    assert!(write_nifti(folder.path(), &volume, &WriteOptions::default()).is_err());
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
}
