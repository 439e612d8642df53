//! Whether a change as a whole is told from none: of many places a few exceed their uncertainty by chance.

use serde::Serialize;

use super::{Change, Flag, SurfaceChange};

/// Share of a surface beyond its uncertainty above which it counts as moved: the uncertainty covers 95 %, so that 2.5 % lie beyond
/// it on either side by chance.
pub const MOVED_SHARE: f64 = 0.025;

/// What is called of a change. Shares are `None` without a surface to compare.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Call {
    /// Share of the later outer surface that lies outside the earlier one by more than its uncertainty, 0 to 1.
    pub grew_share: Option<f64>,
    /// Share of the earlier outer surface that lies outside the later one by more than its uncertainty, 0 to 1.
    pub shrank_share: Option<f64>,
    /// Whether the surface grew: its share exceeds [`MOVED_SHARE`].
    pub grew: bool,
    /// Whether it shrank.
    pub shrank: bool,
    /// Whether components that count appeared.
    pub appeared: bool,
    /// Whether components that count vanished.
    pub vanished: bool,
    /// Whether components that count split, merged or regrouped: a bridge of one voxel decides, so that it is no change by itself.
    pub pieces: bool,
}

impl Call {
    /// Of a change. Of one that compares volumes only, nothing is called.
    pub fn of(change: &Change) -> Self {
        let counts = &change.counts;
        let share = |grows: bool, surface: u64| {
            let beyond = change
                .vectors
                .iter()
                .filter(|v| (v.signed_mm > 0.0) == grows && !v.flags.within_uncertainty)
                .count();
            (surface > 0).then(|| beyond as f64 / surface as f64)
        };
        let grew_share = share(true, counts.surface_to.saturating_sub(counts.appeared_voxels));
        let shrank_share = share(false, counts.surface_from.saturating_sub(counts.vanished_voxels));
        let has = |flags: &[Flag]| change.flags.iter().any(|flag| flags.contains(flag));
        Self {
            grew_share,
            shrank_share,
            grew: grew_share.is_some_and(|share| share > MOVED_SHARE),
            shrank: shrank_share.is_some_and(|share| share > MOVED_SHARE),
            appeared: has(&[Flag::Appeared]),
            vanished: has(&[Flag::Vanished]),
            pieces: has(&[Flag::Split, Flag::Merged, Flag::Regrouped]),
        }
    }

    /// Whether a change is called: of the surface, or a component that came or went.
    pub fn is_change(&self) -> bool {
        self.grew || self.shrank || self.appeared || self.vanished
    }
}

/// Mean movement of the surface in millimetres, growth positive: where it moved by less than a voxel that counts, too; components that
/// appeared or vanished don't count. `length_mm` is a vector's length, without its sign. Over the voxels of the later outer surface where the sum
/// is positive, else of the earlier one. `None` without a surface at both dates.
pub fn mean_move_mm(change: &Change, length_mm: impl Fn(&SurfaceChange) -> f64) -> Option<f64> {
    let counts = &change.counts;
    let of_vectors_mm: f64 = change.vectors.iter().map(|v| length_mm(v).copysign(v.signed_mm)).sum();
    let sum_mm = of_vectors_mm + change.moved_within_voxels_mm;
    let kept = [
        counts.surface_from.saturating_sub(counts.vanished_voxels),
        counts.surface_to.saturating_sub(counts.appeared_voxels),
    ];
    let voxels = kept[usize::from(sum_mm > 0.0)];
    (kept.iter().all(|voxels| *voxels > 0)).then(|| sum_mm / voxels as f64)
}
