//! Numbers that tables show: how far masks agree, and what is in the lens. Counted on a worker.

use std::sync::Arc;

use glioscope_core::{
    RegionVolume, TumorIndex,
    case::TimePoint,
    inside_lens::voxels_inside,
    measure::{self, Agreement, Pair},
};
use glioscope_render::Lens;

use super::jobs::{Ask, Derived, Handle, Lookup};

/// How far the masks of a date agree.
#[derive(Clone, Debug, PartialEq)]
pub struct AgreementNumbers {
    /// Every pair of masks, with every metric.
    pub pairs: Vec<Pair>,
    /// Voxels by how many masks are active.
    pub levels: Vec<Agreement>,
}

/// Voxels of each region, by its bits.
pub type RegionVoxels = Vec<(u32, u64)>;

#[derive(Clone, PartialEq)]
struct LensKey {
    tumor: Handle<RegionVolume>,
    lens: Lens,
}

/// Numbers, those last asked for.
#[derive(Default)]
pub struct Numbers {
    agreement: Derived<Handle<TumorIndex>, AgreementNumbers>,
    lens: Derived<LensKey, RegionVoxels>,
    lens_counts: u64,
}

impl Numbers {
    /// How far the masks of `time_point` agree.
    pub fn agreement(&mut self, time_point: &TimePoint, ask: &Ask) -> Lookup<'_, AgreementNumbers> {
        let (index, regions) = (time_point.index.clone(), time_point.regions.clone());
        self.agreement.get(Handle::of(&time_point.index), ask, move |_| {
            Ok(AgreementNumbers {
                pairs: measure::pairs(&index, &regions),
                levels: measure::agreement(&regions),
            })
        })
    }

    /// Voxels of each region of `tumor` inside `lens`. While a moved lens is counted, the numbers are those of
    /// before: whether they are current stands beside them. `None` before the first are there.
    pub fn in_lens(
        &mut self,
        tumor: &Arc<RegionVolume>,
        lens: Lens,
        ask: &Ask,
    ) -> Option<(Arc<RegionVoxels>, bool)> {
        let key = LensKey { tumor: Handle::of(tumor), lens };
        if self.lens.kept(&key).is_none() && !self.lens.working() {
            self.lens_counts += 1;
        }
        let of = tumor.clone();
        let work = move |_: &_| Ok(voxels_inside(&of, lens.center_mm, lens.radius_mm));
        let current = match self.lens.get(key, ask, work) {
            Lookup::Ready(found) => Some(found.clone()),
            Lookup::Working(_) | Lookup::Failed(_) => None,
        };
        match (current, self.lens.last()) {
            (Some(found), _) => Some((found, true)),
            (None, Some(before)) => Some((before.clone(), false)),
            (None, None) => None,
        }
    }

    /// How often a lens was counted: a test that an idle view counts nothing reads it.
    pub fn lens_counts(&self) -> u64 {
        self.lens_counts
    }

    /// Whether a worker is at one.
    pub fn working(&self) -> bool {
        self.agreement.working() || self.lens.working()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use glioscope_core::{Grid, Mask, MaskBits, Regions};

    #[test]
    fn a_lens_that_rests_is_counted_once() {
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
        for (tumor, lens, voxels, counts) in steps {
            let (found, current) = numbers.in_lens(tumor, lens, &ask).unwrap();
            assert_eq!((found.as_slice(), current), ([(1, voxels)].as_slice(), true));
            assert_eq!(numbers.lens_counts(), counts);
        }
    }

    #[test]
    fn agreement_is_counted_on_a_worker() {
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
        assert!(matches!(numbers.agreement(&time_point, &ask), Lookup::Working(_)), "not while drawing");
        let found = loop {
            if let Lookup::Ready(found) = numbers.agreement(&time_point, &ask) {
                break found.clone();
            }
        };
        assert_eq!(found.pairs[0].value("dice"), Some(0.8));
        assert_eq!(found.levels.iter().map(|level| level.voxels).collect::<Vec<_>>(), [1, 2]);
    }

    #[test]
    fn a_moved_lens_keeps_the_numbers_of_before_until_a_worker_has_counted() {
        let grid = Grid::axis_aligned([8, 8, 8], DVec3::ONE, DVec3::ZERO).unwrap();
        let mask = Mask::new("a", grid.clone(), MaskBits::from_fn([8, 8, 8], |_| true)).unwrap();
        let index = TumorIndex::new(grid, &[&mask]).unwrap();
        let tumor = Arc::new(RegionVolume::of(&index, &Regions::of(&index)).unwrap());
        let small = Lens { center_mm: DVec3::splat(3.0), radius_mm: 1.0 };
        let mut numbers = Numbers::default();
        let (waiting, working) = (Ask { wait: true, ..Ask::default() }, Ask::default());
        assert!(numbers.in_lens(&tumor, small, &working).is_none(), "nothing is counted while drawing");
        numbers = Numbers::default();
        numbers.in_lens(&tumor, small, &waiting);
        let large = Lens { radius_mm: 1.5, ..small };
        let (found, current) = numbers.in_lens(&tumor, large, &working).unwrap();
        assert_eq!((found.as_slice(), current), ([(1, 7)].as_slice(), false));
        while numbers.working() {
            numbers.in_lens(&tumor, large, &working);
        }
        assert_eq!(*numbers.in_lens(&tumor, large, &working).unwrap().0, [(1, 19)]);
    }
}
