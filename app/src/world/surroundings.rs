//! Whether the tissue around what moved was displaced with it, for the change view: looked at on a worker once a comparison is shown.

use std::sync::Arc;

use glioscope_core::{
    case::Case,
    change::{self, ChangeReport, NotSaid, SurfaceChange, Surroundings, Tissue},
    register::DeformOptions,
};

use glioscope_render::ChangeSurface;

use super::{
    comparison::Comparison,
    jobs::{Ask, Derived, Handle, Lookup},
    self_check::CheckLine,
};
use crate::format;

/// What the tissue around a comparison's lesions says.
pub struct Looked {
    /// Of each vector.
    pub found: Surroundings,
    /// The comparison's report with it.
    pub report: ChangeReport,
    /// The comparison's surface with marks where the tissue moved too; `None` where it didn't.
    pub surface: Option<Arc<ChangeSurface>>,
}

impl Looked {
    /// What is said of one of the comparison's vectors.
    pub fn tissue(&self, compared: &Comparison, vector: &SurfaceChange) -> Option<Tissue> {
        let key = |v: &SurfaceChange| [v.voxel[2], v.voxel[1], v.voxel[0]];
        let at = compared.change.vectors.binary_search_by_key(&key(vector), key).ok()?;
        self.found.tissue.get(at).copied()
    }
}

/// The look last asked for.
#[derive(Default)]
pub struct Looks {
    result: Derived<Handle<Comparison>, Looked>,
}

impl Looks {
    /// The tissue around what `compared` found, looked at now if necessary.
    pub fn get(&mut self, case: &Arc<Case>, compared: &Arc<Comparison>, ask: &Ask) -> Lookup<'_, Looked> {
        let (case, of) = (case.clone(), compared.clone());
        let work = move |progress: &_| {
            let options = DeformOptions::default();
            let found = change::surroundings(&case, &of.choice, &of.change, &options, progress)?;
            let report = of.report.clone().with_surroundings(&found);
            let displaced: Vec<bool> = found.tissue.iter().map(|tissue| *tissue == Tissue::Moved).collect();
            let surface = of.surface.as_ref().filter(|_| displaced.contains(&true));
            let surface = surface.map(|surface| Arc::new(surface.with_displaced(displaced)));
            Ok(Looked { found, report, surface })
        };
        self.result.get(Handle::of(compared), ask, work)
    }

    /// That of `compared`, if it is available: starts no job.
    pub fn cached(&self, compared: &Arc<Comparison>) -> Option<&Arc<Looked>> {
        self.result.cached(&Handle::of(compared))
    }
}

/// What is said of the tissue as a whole: why nothing can be, where that is so.
pub fn line(report: &ChangeReport) -> Option<CheckLine> {
    let around = report.surroundings.as_ref()?;
    match around.not_said {
        None | Some(NotSaid::NothingMoved) => None,
        Some(_) => Some(CheckLine { text: format::tissue_not_said(around), marked: false }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{model::ChangeSetting, world::comparison::Comparisons};
    use glioscope_core::{Progress, case::LoadOptions, sample};

    #[test]
    fn the_samples_tissue_stayed_and_a_date_without_images_is_said() {
        let mut spec = sample::sample_spec();
        let ask = Ask { wait: true, ..Ask::default() };
        let look = |spec: &glioscope_core::case::CaseSpec| {
            let case = Arc::new(
                glioscope_core::case::load(spec, &LoadOptions::default(), &Progress::new()).unwrap(),
            );
            let (setting, mut comparisons, mut looks) =
                (ChangeSetting::default(), Comparisons::default(), Looks::default());
            let Some(Lookup::Ready(compared)) = comparisons.get(&case, &setting, &ask) else {
                panic!("not compared")
            };
            assert!(looks.cached(compared).is_none(), "a lookup starts no job");
            let Lookup::Ready(looked) = looks.get(&case, compared, &ask) else { panic!("not looked at") };
            let marked =
                compared.change.vectors.iter().filter(|v| looked.tissue(compared, v) == Some(Tissue::Moved));
            let marked = marked.count();
            let surface = looked.surface.as_ref();
            assert_eq!(surface.is_some_and(|surface| surface.has_displaced()), marked > 0);
            (looked.report.clone(), marked, line(&looked.report))
        };
        let (report, marked, said) = look(&spec);
        assert_eq!(said, None);
        assert!(report.components[0].tissue.is_some() && 50 * marked <= report.vectors);
        spec.contexts.retain(|image| image.time.as_deref() == Some("2024-01-15"));
        let (report, marked, said) = look(&spec);
        assert_eq!((report.components[0].tissue, marked), (None, 0));
        assert_eq!(
            said.unwrap().text,
            "displaced or grown can't be told by the tissue around: 2024-04-15 has no image"
        );
    }
}
