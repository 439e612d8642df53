//! A case whose masks and images go by other names.

use std::sync::Arc;

use super::{Aligned, Case, CaseMask, Context, TimePoint};

impl Case {
    /// This case with the ids of its masks and images as `name` gives them; voxels, findings and the case's name stay. Ids
    /// that are distinct must stay so.
    #[must_use]
    pub fn renamed(&self, name: &dyn Fn(&str) -> String) -> Self {
        let time_points = self.time_points.iter().map(|time| renamed_date(time, name)).collect();
        let aligned = self.aligned.iter().map(|a| Aligned { id: name(&a.id), ..a.clone() }).collect();
        Self { time_points, aligned, ..self.clone() }
    }
}

fn renamed_date(time: &TimePoint, name: &dyn Fn(&str) -> String) -> TimePoint {
    let contexts = time
        .contexts
        .iter()
        .map(|image| Context { id: name(&image.id), volume: Arc::clone(&image.volume) })
        .collect();
    if time.masks.iter().all(|m| name(m.mask.id()) == m.mask.id()) {
        return TimePoint { contexts, ..time.clone() };
    }
    let masks = time
        .masks
        .iter()
        .map(|m| CaseMask { mask: m.mask.with_id(name(m.mask.id())), ..m.clone() })
        .collect();
    let ids: Vec<String> = time.index.mask_ids().iter().map(|id| name(id)).collect();
    TimePoint {
        contexts,
        masks,
        regions: Arc::new(time.regions.with_mask_ids(ids.clone())),
        index: Arc::new(time.index.with_mask_ids(ids)),
        ..time.clone()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Progress, case::LoadOptions, sample};

    #[test]
    fn a_renamed_case_differs_in_its_ids_alone() {
        let spec = sample::sample_spec();
        let case = super::super::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
        let other = case.renamed(&|id| format!("{id}'"));
        for (time, before) in other.time_points.iter().zip(&case.time_points) {
            let with_prime: Vec<String> = before.index.mask_ids().iter().map(|id| format!("{id}'")).collect();
            assert_eq!(time.index.mask_ids(), with_prime);
            assert_eq!(time.regions.mask_ids(), with_prime);
            assert_eq!(time.contexts[0].id, format!("{}'", before.contexts[0].id));
            assert_eq!(time.regions.list(), before.regions.list());
        }
        assert_eq!(other.renamed(&|id| id.trim_end_matches('\'').to_owned()), case);
    }
}
