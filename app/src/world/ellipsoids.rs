//! Ellipsoids of all components of a date, kept beside the session file that shows them.

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

/// Ellipsoids, those last asked for.
#[derive(Default)]
pub struct Ellipsoids {
    kept: Derived<Key, Vec<ComponentEllipsoid>>,
}

impl Ellipsoids {
    /// The ellipsoids of the date at `time`, for components of so many neighbours: read from beside `session`
    /// where they are kept there.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        time: usize,
        neighbors: u32,
        session: Option<&Path>,
        ask: &Ask,
    ) -> Lookup<'_, Vec<ComponentEllipsoid>> {
        let key = Key { case: Handle::of(case), time, neighbors };
        let (case, kept_at) = (case.clone(), session.map(cache::path_beside));
        self.kept.get(key, ask, move |progress| compute(&case, time, neighbors, kept_at.as_deref(), progress))
    }

    /// The ellipsoids last computed: none while no view has shown any.
    pub fn last(&self) -> Option<&Arc<Vec<ComponentEllipsoid>>> {
        self.kept.last()
    }

    /// Whether a worker is at them.
    pub fn working(&self) -> bool {
        self.kept.working()
    }

    /// Keeps what was computed of the date at `time` beside a session that was just saved.
    pub fn keep(&self, session: &Path, case: &Arc<Case>, time: usize, neighbors: u32) {
        let key = Key { case: Handle::of(case), time, neighbors };
        if let (Some(found), Some(time_point)) = (self.kept.kept(&key), case.time_points.get(time)) {
            save(&cache::path_beside(session), &cache_key(time_point, neighbors), found);
        }
    }
}

fn compute(
    case: &Case,
    time: usize,
    neighbors: u32,
    kept_at: Option<&Path>,
    progress: &Progress,
) -> Result<Vec<ComponentEllipsoid>, AppError> {
    let time_point = case.time_points.get(time).ok_or(AppError::Nothing("no such date"))?;
    let key = cache_key(time_point, neighbors);
    if let Some(kept) = kept_at.and_then(|path| cache::load(path).remove(&key)) {
        return Ok(kept);
    }
    let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
    let options = ellipsoid::Options::default();
    progress.say("enclosing components in ellipsoids");
    let found = ellipsoid::ellipsoids_of(&time_point.index, connectivity, &options, progress)?;
    if let Some(path) = kept_at {
        save(path, &key, &found);
    }
    Ok(found)
}

fn cache_key(time_point: &TimePoint, neighbors: u32) -> cache::Key {
    let connectivity = Connectivity::of_neighbors(neighbors).unwrap_or_default();
    cache::Key::of(&time_point.index, connectivity, &ellipsoid::Options::default())
}

/// Adds to the file beside the session. Without it they are computed again next time: nothing is lost,
/// so a folder that can't be written is no error.
fn save(path: &Path, key: &cache::Key, found: &[ComponentEllipsoid]) {
    let mut entries = cache::load(path);
    entries.insert(*key, found.to_vec());
    let _ = cache::save(path, &entries);
}
