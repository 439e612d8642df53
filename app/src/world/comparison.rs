//! Comparison of a mask at two time points, for the change view, the dates pane and the slices.

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

/// A mask compared at two time points.
pub struct Comparison {
    /// The mask and the time points.
    pub choice: Choice,
    /// Labels of the two time points.
    pub labels: [String; 2],
    /// Change vectors and component groups.
    pub change: Arc<Change>,
    /// Summary of the change.
    pub report: ChangeReport,
    /// Surface for the change view; `None` where the mask is empty at both time points.
    pub surface: Option<Arc<ChangeSurface>>,
    /// Bit 0: active at the earlier time point, bit 1: at the later.
    pub index: Arc<TumorIndex>,
    /// Regions of `index`: gone (1), new (2) and kept (3).
    pub regions: Regions,
}

/// Inputs of a comparison.
#[derive(PartialEq)]
struct Key {
    case: Handle<Case>,
    choice: Choice,
    options: ChangeOptions,
}

/// The comparison last requested.
#[derive(Default)]
pub struct Comparisons {
    result: Derived<Key, Comparison>,
    gpu: Option<Gpu>,
}

impl Comparisons {
    /// No comparison yet. A hardware `gpu` computes the skeleton's force as an exact sum where that fits; otherwise the
    /// tree does.
    pub fn new(gpu: Option<Gpu>) -> Self {
        Self { result: Derived::default(), gpu }
    }

    /// The comparison given by `setting`, started now if necessary; `None` where nothing can be compared.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        setting: &ChangeSetting,
        ask: &Ask,
    ) -> Option<Lookup<'_, Comparison>> {
        let key = key(case, setting)?;
        let (case, choice, options) = (case.clone(), key.choice.clone(), key.options);
        let gpu = self.gpu.clone();
        let work = move |progress: &Progress| {
            let source = force_source(gpu.as_ref());
            let source = source.as_ref().map(|s| s as &dyn ForceSource);
            compute(&case, choice, &options, source, progress)
        };
        Some(self.result.get(key, ask, work))
    }

    /// The comparison given by `setting`, if it is available: starts no job.
    pub fn cached(&self, case: &Arc<Case>, setting: &ChangeSetting) -> Option<&Arc<Comparison>> {
        self.result.cached(&key(case, setting)?)
    }

    /// The comparison last computed, which may be for older settings.
    pub fn last(&self) -> Option<&Arc<Comparison>> {
        self.result.last()
    }

    /// Whether a worker is computing it.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }

    /// What computes the skeleton's force, and why, for the diagnostics pane.
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

/// The exact sum on a hardware graphics device; on a software one the tree is faster.
fn force_source(gpu: Option<&Gpu>) -> Option<ForceField> {
    // Where the shader can't be compiled, the tree is used.
    gpu.filter(|gpu| !gpu.is_software()).and_then(|gpu| ForceField::new(gpu).ok())
}

fn key(case: &Arc<Case>, setting: &ChangeSetting) -> Option<Key> {
    let choice = setting.chosen(case).ok()?;
    Some(Key { case: Handle::of(case), choice, options: setting.options() })
}

fn compute(
    case: &Case,
    choice: Choice,
    options: &ChangeOptions,
    source: Option<&dyn ForceSource>,
    progress: &Progress,
) -> Result<Comparison, AppError> {
    progress.say("comparing the dates");
    let (report, change) = change::between(case, &choice, options, source, progress)?;
    let labels = [report.from.clone(), report.to.clone()];
    let pair: Vec<Mask> = choice
        .dates
        .iter()
        .zip(&labels)
        .filter_map(|(index, label)| {
            let time_point = case.time_points.get(*index)?;
            let case_mask = time_point.masks.iter().find(|m| m.mask.id() == choice.id)?;
            Mask::new(label, case.grid.clone(), case_mask.mask.bits().clone())
        })
        .collect();
    let [before, after] = pair.as_slice() else {
        return Err(ChangeError::no_common_mask(case, choice.dates).into());
    };
    let index = TumorIndex::new(case.grid.clone(), &[before, after])?;
    let change = Arc::new(change);
    let surface = ChangeSurface::new(before.bits(), after.bits(), &case.grid, change.clone()).map(Arc::new);
    let regions = Regions::of(&index);
    Ok(Comparison { choice, labels, change, report, surface, index: Arc::new(index), regions })
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
    fn change_of_the_sample_matches_its_regions_and_uses_the_tree() {
        let case = case();
        let (setting, ask) = (ChangeSetting::default(), Ask { wait: true, ..Ask::default() });
        let mut comparisons = Comparisons::default();
        assert!(comparisons.cached(&case, &setting).is_none(), "a lookup starts no job");
        let Some(Lookup::Ready(found)) = comparisons.get(&case, &setting, &ask) else {
            panic!("not compared")
        };
        let (gone, new) =
            (found.regions.get(1).map_or(0, |r| r.voxels), found.regions.get(2).map_or(0, |r| r.voxels));
        assert_eq!((gone, new), (found.change.gone_voxels, found.change.new_voxels));
        assert_eq!(found.report.counters.force, "tree, θ 0.25");
        assert!(comparisons.cached(&case, &setting).is_some());
        assert!(comparisons.force_text().ends_with("no graphics adapter. Last: tree, θ 0.25."));
    }

    #[test]
    fn on_a_software_adapter_the_tree_computes_the_force_and_diagnostics_report_it() {
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
