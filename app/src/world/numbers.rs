//! Numbers in tables, computed on a worker: agreement of masks, and voxel counts inside the lens.

use std::sync::Arc;

use glioscope_core::{
    Mask, RegionVolume, TumorIndex,
    case::TimePoint,
    inside_lens::voxels_inside,
    measure::{self, Agreement, Pair, Statistics},
};
use glioscope_render::{Lens, flat::PreparedContext};

use super::{
    image::NamedImage,
    jobs::{Ask, Derived, Handle, Lookup},
};

/// Agreement of the masks of a time point.
#[derive(Clone, Debug, PartialEq)]
pub struct AgreementNumbers {
    /// Every pair of masks with all metrics.
    pub pairs: Vec<Pair>,
    /// Voxel counts by number of active masks.
    pub levels: Vec<Agreement>,
}

/// Region bits and their voxel counts.
pub type RegionVoxels = Vec<(u32, u64)>;

#[derive(Clone, PartialEq)]
struct LensKey {
    tumor: Handle<RegionVolume>,
    lens: Lens,
}

/// The numbers last requested.
#[derive(Default)]
pub struct Numbers {
    agreement: Derived<Handle<TumorIndex>, AgreementNumbers>,
    lens: Derived<LensKey, RegionVoxels>,
    lens_jobs: u64,
    statistics: Derived<(Handle<TumorIndex>, Handle<PreparedContext>), Vec<Statistics>>,
    lens_values: Derived<(Lens, Handle<PreparedContext>), Statistics>,
}

impl Numbers {
    /// Values of an image in the masks of `time_point`.
    pub fn statistics(
        &mut self,
        time_point: &TimePoint,
        (id, image): NamedImage<'_>,
        ask: &Ask,
    ) -> Lookup<'_, Vec<Statistics>> {
        let key = (Handle::of(&time_point.index), Handle::of(image));
        let masks: Vec<Mask> = time_point.masks.iter().map(|m| m.mask.clone()).collect();
        let (id, volume) = (id.to_owned(), image.volume().clone());
        self.statistics.get(key, ask, move |progress| {
            let of = |mask: &Mask| {
                progress.check()?;
                Ok(measure::statistics_of(mask, (&id, &volume)))
            };
            masks.iter().map(of).collect()
        })
    }

    /// Values of an image in a lens.
    pub fn lens_values(
        &mut self,
        lens: Lens,
        (id, image): NamedImage<'_>,
        ask: &Ask,
    ) -> Lookup<'_, Statistics> {
        let (id, volume) = (id.to_owned(), image.volume().clone());
        self.lens_values.get((lens, Handle::of(image)), ask, move |_| {
            Ok(measure::in_ball("lens", (&id, &volume), (lens.center_mm, lens.radius_mm)))
        })
    }

    /// Agreement of the masks of `time_point`.
    pub fn agreement(&mut self, time_point: &TimePoint, ask: &Ask) -> Lookup<'_, AgreementNumbers> {
        let (index, regions) = (time_point.index.clone(), time_point.regions.clone());
        self.agreement.get(Handle::of(&time_point.index), ask, move |_| {
            Ok(AgreementNumbers {
                pairs: measure::pairs(&index, &regions),
                levels: measure::agreement(&regions),
            })
        })
    }

    /// Voxel counts of the regions of `tumor` inside `lens`, and whether they are current: while a moved lens is being
    /// counted, the previous counts are returned with `false`. `None` until the first are available.
    pub fn in_lens(
        &mut self,
        tumor: &Arc<RegionVolume>,
        lens: Lens,
        ask: &Ask,
    ) -> Option<(Arc<RegionVoxels>, bool)> {
        let key = LensKey { tumor: Handle::of(tumor), lens };
        if self.lens.cached(&key).is_none() && !self.lens.working() {
            self.lens_jobs += 1;
        }
        let volume = tumor.clone();
        let work = move |_: &_| Ok(voxels_inside(&volume, lens.center_mm, lens.radius_mm));
        let current = match self.lens.get(key, ask, work) {
            Lookup::Ready(counts) => Some(counts.clone()),
            Lookup::Working(_) | Lookup::Failed(_) => None,
        };
        match (current, self.lens.last()) {
            (Some(counts), _) => Some((counts, true)),
            (None, Some(previous)) => Some((previous.clone(), false)),
            (None, None) => None,
        }
    }

    /// Number of lens counts started so far: for the test that an idle view starts none.
    pub fn lens_jobs(&self) -> u64 {
        self.lens_jobs
    }

    /// Whether a worker is computing any.
    pub fn working(&mut self) -> bool {
        // Each takes what is finished.
        self.agreement.working()
            | self.lens.working()
            | self.statistics.working()
            | self.lens_values.working()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glioscope_core::{Grid, Mask, MaskBits, Regions};

    #[test]
    fn an_unchanged_lens_is_counted_once() {
        let grid = Grid::axis_aligned([8, 8, 8], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = Mask::new("a", grid.clone(), MaskBits::from_fn([8, 8, 8], |_| true)).unwrap();
        let index = TumorIndex::new(grid, &[&mask]).unwrap();
        let volume = || Arc::new(RegionVolume::of(&index, &Regions::of(&index)).unwrap());
        let (tumor, other) = (volume(), volume());
        let small = Lens { center_mm: DVec3::splat(3.0), radius_mm: 1.0 };
        let large = Lens { radius_mm: 1.5, ..small };
        let mut numbers = Numbers::default();
        let ask = Ask { wait: true, ..Ask::default() };
        let steps =
            [(&tumor, small, 7, 1), (&tumor, small, 7, 1), (&tumor, large, 19, 2), (&other, large, 19, 3)];
        for (tumor, lens, voxels, jobs) in steps {
            let (found, current) = numbers.in_lens(tumor, lens, &ask).unwrap();
            assert_eq!((found.as_slice(), current), ([(1, voxels)].as_slice(), true));
            assert_eq!(numbers.lens_jobs(), jobs);
        }
    }

    #[test]
    fn agreement_is_computed_on_a_worker() {
        let grid = Grid::axis_aligned([4, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = |id: &str, from: usize| {
            Mask::new(id, grid.clone(), MaskBits::from_fn([4, 1, 1], |l| l >= from)).unwrap()
        };
        let index = Arc::new(TumorIndex::new(grid.clone(), &[&mask("a", 1), &mask("b", 2)]).unwrap());
        let regions = Arc::new(Regions::of(&index));
        let time_point =
            TimePoint { label: String::new(), contexts: Vec::new(), masks: Vec::new(), index, regions };
        let mut numbers = Numbers::default();
        let ask = Ask::default();
        assert!(matches!(numbers.agreement(&time_point, &ask), Lookup::Working(_)), "computed while drawing");
        let found = loop {
            if let Lookup::Ready(found) = numbers.agreement(&time_point, &ask) {
                break found.clone();
            }
        };
        assert_eq!(found.pairs[0].value("dice"), Some(0.8));
        assert_eq!(found.levels.iter().map(|level| level.voxels).collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn a_moved_lens_keeps_the_previous_counts_until_a_worker_is_done() {
        let grid = Grid::axis_aligned([8, 8, 8], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = Mask::new("a", grid.clone(), MaskBits::from_fn([8, 8, 8], |_| true)).unwrap();
        let index = TumorIndex::new(grid, &[&mask]).unwrap();
        let tumor = Arc::new(RegionVolume::of(&index, &Regions::of(&index)).unwrap());
        let small = Lens { center_mm: DVec3::splat(3.0), radius_mm: 1.0 };
        let mut numbers = Numbers::default();
        let (blocking, on_worker) = (Ask { wait: true, ..Ask::default() }, Ask::default());
        assert!(numbers.in_lens(&tumor, small, &on_worker).is_none(), "counted while drawing");
        numbers = Numbers::default();
        numbers.in_lens(&tumor, small, &blocking);
        let large = Lens { radius_mm: 1.5, ..small };
        let (found, current) = numbers.in_lens(&tumor, large, &on_worker).unwrap();
        assert_eq!((found.as_slice(), current), ([(1, 7)].as_slice(), false));
        while numbers.working() {
            numbers.in_lens(&tumor, large, &on_worker);
        }
        assert_eq!(*numbers.in_lens(&tumor, large, &on_worker).unwrap().0, [(1, 19)]);
    }
}
