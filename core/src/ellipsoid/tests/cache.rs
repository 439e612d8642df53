//! The cache file beside a session.

use std::path::Path;

use super::{all, blob, index_of, skewed_grid, unit_grid};
use crate::{
    Connectivity,
    ellipsoid::{
        Method, Options,
        cache::{self, Entries, Key},
    },
    files::write_whole,
};

#[test]
fn keys_depend_on_every_input() {
    let dims = [21, 10, 9];
    let bits = blob(dims, &mut 6, 2);
    let mut other = bits.clone();
    other.set([20, 9, 8]);
    let options = Options::default();
    let mut keys = Vec::new();
    for masks in [vec![bits.clone()], vec![other], vec![bits.clone(), bits.clone()], vec![bits.clone(); 9]] {
        keys.push(Key::of(&index_of(&unit_grid(dims), &masks), Connectivity::Six, &options));
    }
    let index = index_of(&unit_grid(dims), std::slice::from_ref(&bits));
    let rotated = index_of(&skewed_grid(dims, 0.0), &[bits]);
    keys.push(Key::of(&rotated, Connectivity::Six, &options));
    keys.push(Key::of(&index, Connectivity::TwentySix, &options));
    for changed in [
        Options { method: Method::AwaySteps, ..options },
        Options { tolerance: 1e-8, ..options },
        Options { max_iterations: 7, ..options },
    ] {
        keys.push(Key::of(&index, Connectivity::Six, &changed));
    }
    assert_eq!(Key::of(&index, Connectivity::Six, &options), keys[0]);
    let count = keys.len();
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), count);
}

#[test]
fn moving_one_voxel_changes_the_key() {
    let dims = [40, 3, 3];
    let mut keys = Vec::new();
    for x in 0..40 {
        for y in 0..3 {
            for z in 0..3 {
                let mut bits = crate::MaskBits::empty(dims);
                bits.set([x, y, z]);
                let index = index_of(&unit_grid(dims), &[bits]);
                keys.push(Key::of(&index, Connectivity::Six, &Options::default()));
            }
        }
    }
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), 360);
}

#[test]
fn saved_entries_load_bit_for_bit_and_damaged_ones_are_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.ellipsoids.json");
    assert!(cache::load(&path).is_empty());

    let dims = [30, 20, 15];
    let mut entries = Entries::new();
    for seed in 1..3 {
        let index = index_of(
            &skewed_grid(dims, 1e6),
            &[blob(dims, &mut { seed }, 2), blob(dims, &mut { seed + 9 }, 3)],
        );
        let key = Key::of(&index, Connectivity::default(), &Options::default());
        entries.insert(key, all(&index));
    }
    cache::save(&path, &entries).unwrap();
    assert_eq!(cache::load(&path), entries);

    let text = std::fs::read_to_string(&path).unwrap();
    assert!(!text.contains("m0"), "no names");
    // Whichever byte is changed, no wrong number is loaded: an entry is intact or absent.
    for at in (0..text.len()).step_by(7) {
        let mut bytes = text.clone().into_bytes();
        bytes[at] = if bytes[at] == b'1' { b'2' } else { b'1' };
        write_damaged(&path, &bytes);
        for (key, found) in cache::load(&path) {
            assert_eq!(entries.get(&key), Some(&found), "byte {at}");
        }
    }
    write_whole(&path, &text.as_bytes()[..text.len() / 2]).unwrap();
    assert!(cache::load(&path).is_empty());
    write_whole(&path, text.replace("\"glioscope_ellipsoids\":1", "\"glioscope_ellipsoids\":2").as_bytes())
        .unwrap();
    assert!(cache::load(&path).is_empty());
    assert!(cache::save(&folder.path().join("no/such/place"), &entries).is_err());
}

#[test]
fn a_file_of_another_kind_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("case.ellipsoids.json");
    let report = b"{\"case\": \"Head phantom\", \"components\": []}";
    write_whole(&path, report).unwrap();
    let error = cache::save(&path, &Entries::new()).unwrap_err().to_string();
    assert!(error.contains("a file of another kind"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), report);
    // Its own is, of whatever version.
    let own = folder.path().join("own.ellipsoids.json");
    for text in ["{\"glioscope_ellipsoids\":99}", "{\"glioscope_ellipsoids\":1,"] {
        write_whole(&own, text.as_bytes()).unwrap();
        cache::save(&own, &Entries::new()).unwrap();
        assert!(std::fs::read_to_string(&own).unwrap().contains("\"entries\":{}"));
    }
}

#[allow(clippy::disallowed_methods, reason = "hundreds of times, and the file is damaged on purpose")]
fn write_damaged(path: &Path, bytes: &[u8]) {
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn the_file_is_named_after_the_session() {
    let beside = |session: &str| cache::path_beside(Path::new(session)).display().to_string();
    assert_eq!(beside("a/visit.glioscope.json"), "a/visit.ellipsoids.json");
    assert_eq!(beside("visit.json"), "visit.ellipsoids.json");
    assert_eq!(beside("visit"), "visit.ellipsoids.json");
}
