//! One mask at two dates: what the change view, the dates pane and the slices show of it.

use std::sync::Arc;

use glioscope_core::{
    Mask, Progress, Regions, TumorIndex,
    case::Case,
    change::{self, Change, ChangeError, ChangeOptions, ChangeReport, Choice},
    skeleton::ForceSource,
};
use glioscope_render::{ChangeSurface, ForceField, Gpu};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::{error::AppError, model::ChangeSetting};

/// The result of a comparison.
pub struct Compared {
    /// What was compared.
    pub choice: Choice,
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
struct Key {
    case: Handle<Case>,
    choice: Choice,
    registration_mm: f64,
}

/// Comparisons, the one last asked for.
#[derive(Default)]
pub struct Comparisons {
    kept: Derived<Key, Compared>,
    gpu: Option<Gpu>,
}

impl Comparisons {
    /// None yet. `gpu` may sum the skeleton's force; without one the tree does.
    pub fn new(gpu: Option<Gpu>) -> Self {
        Self { kept: Derived::default(), gpu }
    }

    /// The comparison that `setting` asks for, begun now if need be; `None` where nothing can be compared.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        setting: &ChangeSetting,
        ask: &Ask,
    ) -> Option<Lookup<'_, Compared>> {
        let key = key(case, setting)?;
        let (case, choice, registration_mm) = (case.clone(), key.choice.clone(), key.registration_mm);
        let gpu = self.gpu.clone();
        let work = move |progress: &Progress| {
            let source = force_source(gpu.as_ref());
            let source = source.as_ref().map(|s| s as &dyn ForceSource);
            compute(&case, choice, registration_mm, source, progress)
        };
        Some(self.kept.get(key, ask, work))
    }

    /// The comparison that `setting` asks for, if it is here: nothing is begun.
    pub fn kept(&self, case: &Arc<Case>, setting: &ChangeSetting) -> Option<&Arc<Compared>> {
        self.kept.kept(&key(case, setting)?)
    }

    /// The comparison last computed, whether or not it is current.
    pub fn last(&self) -> Option<&Arc<Compared>> {
        self.kept.last()
    }

    /// Whether a worker is at it.
    pub fn working(&self) -> bool {
        self.kept.working()
    }

    /// What sums the skeleton's force, and why, for the diagnostics.
    pub fn force_text(&self) -> String {
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
    let choice = setting.chosen(case).ok()?;
    Some(Key { case: Handle::of(case), choice, registration_mm: setting.registration_mm })
}

fn compute(
    case: &Case,
    choice: Choice,
    registration_mm: f64,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<Compared, AppError> {
    progress.say("comparing the dates");
    let options = ChangeOptions { registration_mm, ..ChangeOptions::default() };
    let (report, found) = change::between(case, &choice, &options, source, progress)?;
    let labels = [report.from.clone(), report.to.clone()];
    let pair: Vec<Mask> = choice
        .dates
        .iter()
        .zip(&labels)
        .filter_map(|(at, label)| {
            let time = case.time_points.get(*at)?;
            let found = time.masks.iter().find(|m| m.mask.id() == choice.id)?;
            Mask::new(label, case.grid.clone(), found.mask.bits().clone())
        })
        .collect();
    let [before, after] = pair.as_slice() else {
        return Err(ChangeError::NoCommonMask(case.name.clone()).into());
    };
    let index = TumorIndex::new(case.grid.clone(), &[before, after])?;
    let change = Arc::new(found);
    let surface = ChangeSurface::new(before.bits(), after.bits(), &case.grid, change.clone()).map(Arc::new);
    let regions = Regions::of(&index);
    Ok(Compared { choice, labels, change, report, surface, index: Arc::new(index), regions })
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
    fn the_sample_s_change_is_that_of_the_kernel() {
        let case = case();
        let (setting, ask) = (ChangeSetting::default(), Ask { wait: true, ..Ask::default() });
        let mut comparisons = Comparisons::default();
        assert!(comparisons.kept(&case, &setting).is_none(), "nothing is begun by looking");
        let Some(Lookup::Ready(found)) = comparisons.get(&case, &setting, &ask) else {
            panic!("not compared")
        };
        let (gone, new) =
            (found.regions.get(1).map_or(0, |r| r.voxels), found.regions.get(2).map_or(0, |r| r.voxels));
        assert_eq!((gone, new), (found.change.gone_voxels, found.change.new_voxels));
        assert_eq!(found.report.counters.force, "tree, θ 0.25");
        assert!(comparisons.kept(&case, &setting).is_some());
        assert!(comparisons.force_text().ends_with("no graphics adapter. Last: tree, θ 0.25."));
    }

    #[test]
    fn a_software_adapter_leaves_the_force_to_the_tree_and_the_diagnostics_tell_it() {
        let gpu = Gpu::headless(AdapterPreference::SoftwareOnly).unwrap();
        assert!(force_source(Some(&gpu)).is_none());
        let mut comparisons = Comparisons::new(Some(gpu));
        assert!(comparisons.force_text().contains("software adapter"), "{}", comparisons.force_text());
        let ask = Ask { wait: true, ..Ask::default() };
        let (case, setting) = (case(), ChangeSetting::default());
        let Some(Lookup::Ready(found)) = comparisons.get(&case, &setting, &ask) else {
            panic!("not compared")
        };
        assert_eq!(found.report.counters.force, "tree, θ 0.25");
    }
}
