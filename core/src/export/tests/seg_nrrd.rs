use std::{collections::HashMap, io::Read, path::Path};

use super::super::{NamedMask, Provenance, write_seg_nrrd};
use super::*;
use crate::files::FileError;

/// A file's fields and keys, and its voxels.
struct Written {
    fields: HashMap<String, String>,
    text: String,
    voxels: Vec<u8>,
}

fn parsed(bytes: &[u8]) -> Written {
    let end = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap();
    let text = String::from_utf8(bytes[..end].to_vec()).unwrap();
    assert!(text.starts_with("NRRD0004\n"));
    let pair = |line: &str| {
        let (key, value) = line.split_once(":=").or_else(|| line.split_once(": ")).unwrap();
        (key.to_owned(), value.replace("\\\\", "\\"))
    };
    let fields = text.lines().skip(1).map(pair).collect();
    let mut voxels = Vec::new();
    flate2::read::GzDecoder::new(&bytes[end + 2..]).read_to_end(&mut voxels).unwrap();
    Written { fields, text, voxels }
}

impl Written {
    fn get(&self, key: &str) -> &str {
        &self.fields[key]
    }

    /// The voxels of segment `k`.
    fn bits(&self, k: usize, dims: [usize; 3]) -> MaskBits {
        let number = |key: &str| self.get(&format!("Segment{k}_{key}")).parse::<usize>().unwrap();
        let (layer, label) = (number("Layer"), number("LabelValue"));
        let layers = self.voxels.len() / dims.iter().product::<usize>();
        MaskBits::from_fn(dims, |linear| usize::from(self.voxels[layers * linear + layer]) == label)
    }
}

fn write(path: &Path, masks: &[NamedMask<'_>]) -> Result<(), FileError> {
    let provenance = Provenance { inputs: vec!["T1 01ab".into()], selection: "all".into() };
    write_seg_nrrd(path, masks, &provenance, &Progress::new(), |_| Ok(()))
}

fn written(masks: &[NamedMask<'_>]) -> Written {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.seg.nrrd");
    write(&path, masks).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    write(&path, masks).unwrap();
    assert!(std::fs::read(&path).unwrap() == bytes, "different bytes for the same input");
    parsed(&bytes)
}

fn named<'a>(name: &'a str, mask: &'a Mask) -> NamedMask<'a> {
    NamedMask { name, color: [255, 51, 0], mask }
}

#[test]
fn overlapping_masks_are_in_layers_and_each_comes_back() {
    let dims = [70, 5, 4];
    let grid = &grids(dims)[3];
    let half = |lower: bool| MaskBits::from_fn(dims, |linear| (linear < 700) == lower);
    let masks = [half(true), half(false), random(dims, 40, 3), MaskBits::empty(dims), MaskBits::full(dims)];
    let masks = masks.map(|bits| mask_of(grid, bits));
    let names = ["lower", "a\\b\nc", "", "none", "all"];
    let list: Vec<_> = masks.iter().zip(names).map(|(mask, name)| named(name, mask)).collect();
    let read = written(&list);
    assert_eq!((read.get("dimension"), read.get("sizes")), ("4", "3 70 5 4"));
    assert_eq!(read.get("kinds"), "list domain domain domain");
    assert_eq!(read.get("space"), "left-posterior-superior");
    // The columns (1, 0.1, 0), (0.3, 0.9, 0.2), (0, -0.4, 2.5) and the offset (-20.5, 13.25, 7) of RAS.
    assert_eq!(read.get("space directions"), "none (-1,-0.1,0) (-0.3,-0.9,0.2) (0,0.4,2.5)");
    assert_eq!(read.get("space origin"), "(20.5,-13.25,7)");
    for (k, mask) in masks.iter().enumerate() {
        assert!(&read.bits(k, dims) == mask.bits(), "{k}");
        assert_eq!(read.get(&format!("Segment{k}_ID")), format!("Segment_{}", k + 1));
    }
    let all = |key: &str| [0, 1, 2, 3, 4].map(|k| read.get(&format!("Segment{k}_{key}")).to_owned());
    assert_eq!(all("Layer"), ["0", "0", "1", "0", "2"]);
    assert_eq!(all("LabelValue"), ["1", "2", "1", "3", "1"]);
    assert_eq!(all("Name"), ["lower", "a\\b\\nc", "", "none", "all"]);
    assert_eq!(all("Extent")[0], "0 69 0 4 0 1");
    assert_eq!(all("Extent")[3], "0 -1 0 -1 0 -1");
    assert_eq!(all("Color")[0], "1.000000 0.200000 0.000000");
    assert_eq!((read.get("Glioscope_Input0"), read.get("Glioscope_Selection")), ("T1 01ab", "all"));
    assert!(read.get("Glioscope_Program").starts_with("Glioscope "));
}

#[test]
fn one_layer_has_three_axes() {
    let dims = [3, 2, 2];
    let grid = Grid::axis_aligned(dims, DVec3::new(1.0, 1.0, 12.0), DVec3::new(0.0, 1e6, 0.1)).unwrap();
    let mask = at_voxels(&grid, &[[2, 1, 1]]);
    let read = written(&[named("T1", &mask)]);
    assert_eq!((read.get("dimension"), read.get("sizes")), ("3", "3 2 2"));
    assert_eq!(read.get("space directions"), "(-1,0,0) (0,-1,0) (0,0,12)");
    assert_eq!(read.get("space origin"), "(0,-1000000,0.1)");
    assert_eq!(read.voxels, [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1]);
}

#[test]
fn a_layer_has_at_most_255_labels() {
    let dims = [300, 1, 1];
    let grid = Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
    let masks: Vec<Mask> = (0..300).map(|x| at_voxels(&grid, &[[x, 0, 0]])).collect();
    let list: Vec<_> = masks.iter().map(|mask| named("m", mask)).collect();
    let read = written(&list);
    assert_eq!(read.get("sizes"), "2 300 1 1");
    assert_eq!((read.get("Segment254_LabelValue"), read.get("Segment255_Layer")), ("255", "1"));
    assert!(masks.iter().enumerate().all(|(k, mask)| &read.bits(k, dims) == mask.bits()));
}

#[test]
fn unknown_sides_are_not_called_lps() {
    let grid = Grid::new([1; 3], DAffine3::from_scale(DVec3::splat(2.0)), Sides::Unknown).unwrap();
    let mask = at_voxels(&grid, &[[0; 3]]);
    let read = written(&[named("T1", &mask)]);
    assert_eq!(read.get("space dimension"), "3");
    assert_eq!(read.get("space directions"), "(2,0,0) (0,2,0) (0,0,2)");
    assert!(!read.text.contains("left-posterior"));
}

#[test]
fn other_grids_refusal_and_cancelling_leave_nothing() {
    let grids = grids([3, 2, 2]);
    let [a, b] = [0, 1].map(|i| at_voxels(&grids[i], &[[0; 3]]));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.seg.nrrd");
    let error = write(&path, &[named("T1", &a), named("PET\n", &b)]).unwrap_err().to_string();
    let expected = "found masks \"T1\" and \"PET\\n\" on different grids, expected masks on one grid";
    assert!(error.ends_with(expected), "{error}");
    assert!(write(&path, &[]).unwrap_err().to_string().contains("nothing to write"));

    let list = [named("T1", &a)];
    let none = Provenance::default();
    let refuse = |file: &Path| {
        let bytes = std::fs::read(file).unwrap();
        assert!(
            file.to_str().unwrap().ends_with(".seg.nrrd") && &parsed(&bytes).bits(0, [3, 2, 2]) == a.bits()
        );
        Err("voxel 7".into())
    };
    let error = write_seg_nrrd(&path, &list, &none, &Progress::new(), refuse).unwrap_err().to_string();
    assert!(error.ends_with("found voxel 7 when read back, expected the masks that were written"), "{error}");
    let cancelled = Progress::new();
    cancelled.cancel();
    let error = write_seg_nrrd(&path, &list, &none, &cancelled, |_| Ok(())).unwrap_err();
    assert_eq!(error, FileError::Cancelled(crate::Cancelled));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
