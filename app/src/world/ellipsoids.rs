//! Ellipsoids of all connected components of a time point, cached in a file next to the session file.

use std::{path::Path, sync::Arc};

use glioscope_core::{
    Connectivity, Progress,
    case::{Case, TimePoint},
    ellipsoid::{self, ComponentEllipsoid, cache},
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::error::AppError;

#[derive(PartialEq)]
struct Key {
    case: Handle<Case>,
    time: usize,
    neighbors: u32,
}

/// The ellipsoids last requested.
#[derive(Default)]
pub struct Ellipsoids {
    result: Derived<Key, Vec<ComponentEllipsoid>>,
}

impl Ellipsoids {
    /// The ellipsoids of the time point with index `time`, for components of connectivity `neighbors` (6, 18 or 26).
    /// Read from the cache file of `session` where that has them.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        time: usize,
        neighbors: u32,
        session: Option<&Path>,
        ask: &Ask,
    ) -> Lookup<'_, Vec<ComponentEllipsoid>> {
        let key = Key { case: Handle::of(case), time, neighbors };
        let (case, cache_file) = (case.clone(), session.map(cache::path_beside));
        self.result
            .get(key, ask, move |progress| compute(&case, time, neighbors, cache_file.as_deref(), progress))
    }

    /// The ellipsoids last computed; `None` before the first.
    pub fn last(&self) -> Option<&Arc<Vec<ComponentEllipsoid>>> {
        self.result.last()
    }

    /// Whether a worker is computing them.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }

    /// Writes the ellipsoids of the time point with index `time`, where computed, to the cache file of a session that
    /// was just saved.
    pub fn write_cache(&self, session: &Path, case: &Arc<Case>, time: usize, neighbors: u32) {
        let key = Key { case: Handle::of(case), time, neighbors };
        if let (Some(found), Some(time_point)) = (self.result.cached(&key), case.time_points.get(time)) {
            save(&cache::path_beside(session), &cache_key(time_point, neighbors), found);
        }
    }
}

fn compute(
    case: &Case,
    time: usize,
    neighbors: u32,
    cache_file: Option<&Path>,
    progress: &Progress,
) -> Result<Vec<ComponentEllipsoid>, AppError> {
    let time_point = case.time_points.get(time).ok_or(AppError::Unavailable("no such date"))?;
    let key = cache_key(time_point, neighbors);
    if let Some(cached) = cache_file.and_then(|path| cache::load(path).remove(&key)) {
        return Ok(cached);
    }
    let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
    let options = ellipsoid::Options::default();
    progress.say("enclosing components in ellipsoids");
    let found = ellipsoid::ellipsoids_of(&time_point.index, connectivity, &options, progress)?;
    if let Some(path) = cache_file {
        save(path, &key, &found);
    }
    Ok(found)
}

fn cache_key(time_point: &TimePoint, neighbors: u32) -> cache::Key {
    let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
    cache::Key::of(&time_point.index, connectivity, &ellipsoid::Options::default())
}

/// Adds an entry to the cache file. Failure to write it is ignored: the ellipsoids are then computed again next time.
fn save(path: &Path, key: &cache::Key, found: &[ComponentEllipsoid]) {
    let mut entries = cache::load(path);
    entries.insert(*key, found.to_vec());
    let _ = cache::save(path, &entries);
}
