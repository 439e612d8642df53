//! One mask at two dates: what the change view, the dates pane and the slices show of it.

use std::sync::Arc;

use glioscope_core::{
    Mask, Progress, Regions, TumorIndex,
    case::{Case, TimePoint},
    change::{self, Change, ChangeOptions, ChangeReport},
    skeleton::ForceSource,
};
use glioscope_render::{ChangeStyle, ChangeSurface, ForceField, Gpu};
use serde::{Deserialize, Serialize};

use crate::{
    jobs::{Derived, Lookup},
    views::Handle,
};

/// What is compared, and how it is drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeSetting {
    /// The mask, by id; `None`: the first that both dates have.
    pub of: Option<String>,
    /// The two dates, as positions in the case; `None`: the first and the last.
    pub dates: Option<[usize; 2]>,
    /// Height map or arrows.
    pub style: ChangeStyle,
    /// Change that is drawn opaque; `None`: the 95th percentile of what changed.
    pub full_mm: Option<f64>,
    /// Width of the Gauss filter over the height map.
    pub smooth_mm: f64,
    /// Shorter arrows are left out.
    pub threshold_mm: f64,
    /// How far off the dates may lie from one another.
    pub registration_mm: f64,
    /// Whether slices show both outlines and what changed instead of the masks.
    pub on_slices: bool,
}

impl Default for ChangeSetting {
    fn default() -> Self {
        Self {
            of: None,
            dates: None,
            style: ChangeStyle::Height,
            full_mm: None,
            smooth_mm: 1.0,
            threshold_mm: 1.0,
            registration_mm: change::DEFAULT_REGISTRATION_MM,
            on_slices: false,
        }
    }
}

/// What is compared in a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The mask's id.
    pub id: String,
    /// Positions of the earlier and the later date.
    pub dates: [usize; 2],
}

fn has(time_point: &TimePoint, id: &str) -> bool {
    time_point.masks.iter().any(|m| m.mask.id() == id)
}

/// Ids of the masks that both dates have, in the order of the earlier one.
pub fn ids_at(case: &Case, dates: [usize; 2]) -> Vec<&str> {
    let [Some(from), Some(to)] = dates.map(|d| case.time_points.get(d)) else { return Vec::new() };
    from.masks.iter().map(|m| m.mask.id()).filter(|id| has(to, id)).collect()
}

impl ChangeSetting {
    /// What is compared; the reason where nothing can be.
    ///
    /// # Errors
    /// One line in words.
    pub fn chosen(&self, case: &Case) -> Result<Chosen, String> {
        let last = case.time_points.len().saturating_sub(1);
        if last == 0 {
            return Err("One date: nothing to compare with.".into());
        }
        let dates = self.dates.filter(|d| d[0] < d[1] && d[1] <= last).unwrap_or([0, last]);
        let ids = ids_at(case, dates);
        let id = match &self.of {
            Some(id) if ids.contains(&id.as_str()) => Some(id.as_str()),
            _ => ids.first().copied(),
        };
        let id = id.ok_or("The two dates have no mask of the same name.")?.to_owned();
        Ok(Chosen { id, dates })
    }

    /// The dates after one was chosen as the earlier or the later end; the other end moves on where it
    /// has to. `None` where the case has no such pair.
    pub fn with_date(&self, case: &Case, date: usize, as_earlier: bool) -> Option<[usize; 2]> {
        let [from, to] = self.chosen(case).ok()?.dates;
        let last = case.time_points.len().checked_sub(1)?;
        let new = if as_earlier {
            [date, if to > date { to } else { date + 1 }]
        } else {
            [if from < date { from } else { date.checked_sub(1)? }, date]
        };
        (new[1] <= last).then_some(new)
    }
}

/// The result of a comparison.
pub struct Compared {
    /// What was compared.
    pub chosen: Chosen,
    /// Labels of the two dates.
    pub labels: [String; 2],
    /// Vectors and components.
    pub change: Arc<Change>,
    /// Its numbers.
    pub report: ChangeReport,
    /// For the change view; `None` where the mask is empty at both dates.
    pub surface: Option<Arc<ChangeSurface>>,
    /// Bit 0: at the earlier date, bit 1: at the later.
    pub index: Arc<TumorIndex>,
    /// Gone (1), new (2) and kept (3).
    pub regions: Regions,
}

/// What a comparison depends on.
#[derive(PartialEq)]
pub struct Key {
    case: Handle<Case>,
    chosen: Chosen,
    registration_mm: f64,
}

/// Comparisons, the one last asked for.
#[derive(Default)]
pub struct Comparisons {
    kept: Derived<Key, Compared>,
    /// May sum the skeleton's force; `None`: the tree does.
    pub gpu: Option<Gpu>,
}

impl Comparisons {
    /// The comparison last computed, whether or not it is current.
    pub fn last(&self) -> Option<&Arc<Compared>> {
        self.kept.last()
    }

    /// Whether a worker is at it.
    pub fn working(&self) -> bool {
        self.kept.working()
    }

    /// What sums the skeleton's force, and why, for the diagnostics.
    pub fn force(&self) -> String {
        let choice = match &self.gpu {
            None => "Skeleton's force: tree, as there is no graphics adapter.",
            Some(gpu) if gpu.is_software() => {
                "Skeleton's force: tree, as it is faster than an exact sum on a software adapter."
            }
            Some(_) => "Skeleton's force: exact sum on the graphics device, where it fits.",
        };
        match self.last() {
            Some(last) => format!("{choice} Last: {}.", last.report.counters.force),
            None => choice.to_owned(),
        }
    }
}

/// The exact sum on a real graphics device; on a software one the tree is faster.
fn force_source(gpu: Option<&Gpu>) -> Option<ForceField> {
    // Without its shader the tree does it.
    gpu.filter(|gpu| !gpu.is_software()).and_then(|gpu| ForceField::new(gpu).ok())
}

fn key(case: &Arc<Case>, setting: &ChangeSetting) -> Option<Key> {
    let chosen = setting.chosen(case).ok()?;
    Some(Key { case: Handle::of(case), chosen, registration_mm: setting.registration_mm })
}

/// The comparison that `setting` asks for, begun now if need be; `None` where nothing can be
/// compared.
pub fn get<'a>(
    comparisons: &'a mut Comparisons,
    case: &Arc<Case>,
    setting: &ChangeSetting,
    wait: bool,
    wake: impl FnOnce() + Send + 'static,
) -> Option<Lookup<'a, Compared>> {
    let key = key(case, setting)?;
    let (case, chosen, registration_mm) = (case.clone(), key.chosen.clone(), key.registration_mm);
    let gpu = comparisons.gpu.clone();
    let work = move |progress: &Progress| {
        let source = force_source(gpu.as_ref());
        let source = source.as_ref().map(|s| s as &dyn ForceSource);
        compute(&case, chosen, registration_mm, source, progress)
    };
    Some(comparisons.kept.get(key, wait, wake, work))
}

/// The comparison that `setting` asks for, if it is here: nothing is begun.
pub fn here<'a>(
    comparisons: &'a Comparisons,
    case: &Arc<Case>,
    setting: &ChangeSetting,
) -> Option<&'a Arc<Compared>> {
    comparisons.kept.kept(&key(case, setting)?)
}

fn compute(
    case: &Case,
    chosen: Chosen,
    registration_mm: f64,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<Compared, String> {
    progress.say("comparing the dates");
    let [from, to] = chosen.dates;
    let time = |at: usize| case.time_points.get(at).ok_or("no such date");
    let (earlier, later) = (time(from)?, time(to)?);
    let labels = [earlier.label.clone(), later.label.clone()];
    let options = ChangeOptions { registration_mm, ..ChangeOptions::default() };
    let what = (Some(chosen.id.as_str()), Some(labels[0].as_str()), Some(labels[1].as_str()));
    let (report, found) =
        change::between_with(case, what, &options, source, progress).map_err(|e| e.to_string())?;
    let mask = |time: &TimePoint, label: &str| {
        let found = time.masks.iter().find(|m| m.mask.id() == chosen.id);
        found.and_then(|m| Mask::new(label, case.grid.clone(), m.mask.bits().clone()))
    };
    let pair = (mask(earlier, &labels[0]), mask(later, &labels[1]));
    let (Some(before), Some(after)) = pair else { return Err("no such mask".into()) };
    let index = TumorIndex::new(case.grid.clone(), &[&before, &after]).map_err(|e| e.to_string())?;
    let change = Arc::new(found);
    let surface = ChangeSurface::new(before.bits(), after.bits(), &case.grid, change.clone()).map(Arc::new);
    let regions = Regions::of(&index);
    Ok(Compared { chosen, labels, change, report, surface, index: Arc::new(index), regions })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glioscope_core::{case::LoadOptions, sample};
    use glioscope_render::AdapterPreference;

    fn case() -> Arc<Case> {
        let spec = sample::sample_spec();
        Arc::new(glioscope_core::case::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap())
    }

    #[test]
    fn the_first_mask_at_first_and_last_date_is_compared_until_something_else_is_chosen() {
        let case = case();
        let mut setting = ChangeSetting::default();
        let chosen = setting.chosen(&case).unwrap();
        assert_eq!((chosen.id.as_str(), chosen.dates), ("T1", [0, 1]));
        setting.of = Some("PET".into());
        assert_eq!(setting.chosen(&case).unwrap().id, "PET");
        setting.of = Some("nothing of the kind".into());
        assert_eq!(setting.chosen(&case).unwrap().id, "T1");
        setting.dates = Some([1, 7]);
        assert_eq!(setting.chosen(&case).unwrap().dates, [0, 1], "dates that aren't there");
        assert_eq!(setting.with_date(&case, 1, false), Some([0, 1]));
        assert_eq!(setting.with_date(&case, 0, false), None, "nothing is earlier than the first");
        assert_eq!(setting.with_date(&case, 1, true), None, "nothing is later than the last");
    }

    #[test]
    fn the_sample_s_change_is_that_of_the_kernel() {
        let case = case();
        let setting = ChangeSetting::default();
        let mut comparisons = Comparisons::default();
        assert!(here(&comparisons, &case, &setting).is_none(), "nothing is begun by looking");
        let Some(Lookup::Ready(found)) = get(&mut comparisons, &case, &setting, true, || {}) else {
            panic!("not compared")
        };
        let (gone, new) =
            (found.regions.get(1).map_or(0, |r| r.voxels), found.regions.get(2).map_or(0, |r| r.voxels));
        assert_eq!((gone, new), (found.change.gone_voxels, found.change.new_voxels));
        assert_eq!(found.report.counters.force, "tree, θ 0.25");
        assert!(here(&comparisons, &case, &setting).is_some());
        assert!(comparisons.force().ends_with("no graphics adapter. Last: tree, θ 0.25."));
    }

    #[test]
    fn a_software_adapter_leaves_the_force_to_the_tree_and_the_diagnostics_say_so() {
        let gpu = Gpu::headless(AdapterPreference::SoftwareOnly).unwrap();
        assert!(force_source(Some(&gpu)).is_none());
        let mut comparisons = Comparisons { gpu: Some(gpu), ..Comparisons::default() };
        assert!(comparisons.force().contains("software adapter"), "{}", comparisons.force());
        let (case, setting) = (case(), ChangeSetting::default());
        let Some(Lookup::Ready(found)) = get(&mut comparisons, &case, &setting, true, || {}) else {
            panic!("not compared")
        };
        assert_eq!(found.report.counters.force, "tree, θ 0.25");
    }
}
