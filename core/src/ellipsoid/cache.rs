//! A cache file of ellipsoids beside a session file, so that reopening the session computes nothing.
//!
//! The file stores results under keys hashed from their inputs: no names, no ids, no paths. It is
//! never needed: a file that is absent, damaged, of another format or for other masks yields no
//! entries, and missing ones are recomputed.

use std::{
    collections::BTreeMap,
    fmt,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{ComponentEllipsoid, Options};
use crate::{
    components::Connectivity,
    digest::Digest,
    files::{FileError, read_head, read_small, write_whole},
    tumor_index::{IndexData, TumorIndex},
};

/// Format version, raised whenever the numbers or their layout change: older files are then ignored.
const FORMAT: u32 = 1;
/// How the file begins.
const BEGINNING: &str = "{\"glioscope_ellipsoids\":";
/// Maximum size of the file in bytes: some kilobytes per component.
const MAX_BYTES: u64 = 256 << 20;
const EXPECTED: &str = "a cache of ellipsoids";

/// A 128-bit hash of everything the ellipsoids depend on: index, grid, connectivity, options and the
/// file format. Not cryptographic: it doesn't withstand a deliberate search for collisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key([u64; 2]);

impl Key {
    /// The key of the result of [`super::ellipsoids_of`] for these arguments.
    pub fn of(index: &TumorIndex, connectivity: Connectivity, options: &Options) -> Self {
        let mut digest = Digest::new();
        digest.add(u64::from(FORMAT));
        digest.add(u64::from(connectivity.neighbors()));
        digest.bytes(options.method.name().as_bytes());
        digest.add(options.tolerance.to_bits());
        digest.add(options.max_iterations as u64);
        digest.add(index.mask_ids().len() as u64);
        let dims = index.grid().dims();
        dims.iter().for_each(|&d| digest.add(d as u64));
        index.grid().world_from_voxel().to_cols_array().iter().for_each(|v| digest.add(v.to_bits()));
        let slice = dims[0] * dims[1];
        let slices: Vec<Self> = match index.data() {
            IndexData::U8(v) => v.par_chunks(slice).map(slice_key).collect(),
            IndexData::U16(v) => v.par_chunks(slice).map(slice_key).collect(),
            IndexData::U32(v) => v.par_chunks(slice).map(slice_key).collect(),
        };
        for Self([a, b]) in slices {
            digest.add(a);
            digest.add(b);
        }
        Key(digest.finish())
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}{:016x}", self.0[0], self.0[1])
    }
}

/// Hash of one slice's active voxels and their positions; empty stretches cost almost nothing.
fn slice_key<T: Copy + Into<u32>>(values: &[T]) -> Key {
    let mut digest = Digest::new();
    for (position, group) in values.chunks(16).enumerate() {
        if group.iter().fold(0, |any, &v| any | v.into()) == 0 {
            continue;
        }
        digest.add(position as u64);
        for pair in group.chunks(2) {
            digest.add(pair.iter().fold(1, |word, &v| word << 32 | u64::from(v.into())));
        }
    }
    Key(digest.finish())
}

/// Cached ellipsoids by key: one entry per time point.
pub type Entries = BTreeMap<Key, Vec<ComponentEllipsoid>>;

#[derive(Serialize, Deserialize)]
struct CacheFile {
    glioscope_ellipsoids: u32,
    entries: BTreeMap<String, Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    /// Digest of the key and of the list as JSON: detects a changed digit.
    check: String,
    components: Vec<ComponentEllipsoid>,
}

/// Path of a session's cache file: `visit.ellipsoids.json` for `visit.glioscope.json`.
pub fn path_beside(session: &Path) -> PathBuf {
    let name = session.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = name.strip_suffix(".json").unwrap_or(&name);
    session.with_file_name(format!("{}.ellipsoids.json", stem.strip_suffix(".glioscope").unwrap_or(stem)))
}

/// The valid entries of the file at `path`: damaged ones are dropped, and a file that is absent,
/// unreadable or of another format has none.
pub fn load(path: &Path) -> Entries {
    let read = || serde_json::from_slice::<CacheFile>(&read_small(path, MAX_BYTES, EXPECTED).ok()?).ok();
    let Some(file) = read().filter(|f| f.glioscope_ellipsoids == FORMAT) else {
        return Entries::new();
    };
    let valid = |(name, entry): (String, Entry)| {
        let key = parse_key(&name)?;
        let check = checksum(&name, &entry.components)?;
        (check == entry.check).then_some((key, entry.components))
    };
    file.entries.into_iter().filter_map(valid).collect()
}

/// Writes `entries` to `path`, or leaves an existing file untouched.
///
/// # Errors
/// [`FileError::Wrong`] where it can't be written, or where a file of another kind has that name: `FILE.ellipsoids.json`
/// may be a report. The caller may continue without a cache.
pub fn save(path: &Path, entries: &Entries) -> Result<(), FileError> {
    if path.symlink_metadata().is_ok() && !is_cache(path) {
        return Err(FileError::wrong(path.display().to_string(), "a file of another kind", EXPECTED));
    }
    let not_finite =
        || FileError::wrong(path.display().to_string(), "numbers JSON can't hold", "finite ones");
    let mut file = CacheFile { glioscope_ellipsoids: FORMAT, entries: BTreeMap::new() };
    for (key, components) in entries {
        let check = checksum(&key.to_string(), components).ok_or_else(not_finite)?;
        file.entries.insert(key.to_string(), Entry { check, components: components.clone() });
    }
    let bytes = serde_json::to_vec(&file).map_err(|_| not_finite())?;
    write_whole(path, &bytes)
}

/// Whether the file at `path` begins as [`save`] writes it, in any format version.
fn is_cache(path: &Path) -> bool {
    read_head(path, BEGINNING.len() as u64).is_some_and(|head| head == BEGINNING.as_bytes())
}

fn parse_key(name: &str) -> Option<Key> {
    let half = |range| u64::from_str_radix(name.get(range)?, 16).ok();
    let key = Key([half(0..16)?, half(16..32)?]);
    (key.to_string() == name).then_some(key)
}

fn checksum(name: &str, components: &[ComponentEllipsoid]) -> Option<String> {
    let mut digest = Digest::new();
    digest.bytes(name.as_bytes());
    digest.bytes(&serde_json::to_vec(components).ok()?);
    Some(Key(digest.finish()).to_string())
}
