//! A made cohort of boxes: volumes and overlaps are known from how they are made.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glioscope_tests::write_cube;
use tempfile::TempDir;

/// Side of the grid, and of the reference's box, in voxels of 1 mm.
const SIDE: usize = 24;
pub const BOX: usize = 10;

/// How far a case's mask is moved, in voxels, by the number of the case.
type Moved = fn(usize) -> usize;

/// Masks beside the reference: how far case `n` has the box of each moved along x, in voxels.
pub const MASKS: [(&str, Moved); 3] = [("a", |n| n % 3), ("b", |n| 1 + n % 4), ("c", |n| 5 + n % 2)];
/// The dates; the box of the later one is longer.
pub const DATES: [(&str, usize); 2] = [("2024-01-01", BOX), ("2024-03-01", BOX + 2)];

/// A cohort of folders `case-000` … in `in`.
pub fn cohort(cases: usize) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in");
    for n in 0..cases {
        case(&input.join(format!("case-{n:03}")), n);
    }
    (folder, input)
}

/// The case `n` in a folder.
pub fn case(folder: &Path, n: usize) {
    let mut manifest = String::from("glioscope = 1\n");
    let masks = std::iter::once(("ref", 0)).chain(MASKS.map(|(id, moved)| (id, moved(n))));
    for (id, moved) in masks {
        for (date, length) in DATES {
            let is_in = |[i, j, k]: [usize; 3]| {
                (3 + moved..3 + moved + length).contains(&i)
                    && (5..5 + BOX).contains(&j)
                    && (5..5 + BOX).contains(&k)
            };
            let file = format!("{id}-{date}.nii");
            write_cube(&folder.join(&file), SIDE, 1.0, |at| u8::from(is_in(at)));
            manifest += &format!("[[mask]]\nid = \"{id}\"\nfile = \"{file}\"\ntime = \"{date}\"\n");
        }
    }
    std::fs::write(folder.join("case.toml"), manifest).unwrap();
}

/// Dice of the reference and a box moved by `moved` voxels, both `length` long.
pub fn dice_of(moved: usize, length: usize) -> f64 {
    length.saturating_sub(moved) as f64 / length as f64
}

/// Every file under a folder with its content.
pub fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(tree(&path));
        } else {
            files.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    files
}

/// The results of all cases, but for what tells of the run: log and times.
pub fn results(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = tree(&out.join("cases"));
    files.retain(|path, _| !path.ends_with("log.txt") && !path.ends_with("status.json"));
    files
}
