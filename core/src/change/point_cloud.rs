//! Nearest neighbours among points with ids.

use glam::DVec3;

use super::ChangeError;
use crate::distance::KdTree;

/// Number of points up to which brute force is faster than a tree.
const BRUTE_FORCE_MAX: usize = 48;

/// Points with an id each, and a k-d tree over them.
pub(super) struct PointCloud {
    tree: Option<KdTree>,
    points: Vec<DVec3>,
    ids: Vec<u32>,
}

impl PointCloud {
    pub fn new(points: Vec<DVec3>, ids: Vec<u32>) -> Result<Self, ChangeError> {
        let tree = if points.len() > BRUTE_FORCE_MAX { KdTree::new(&points)? } else { None };
        Ok(Self { tree, points, ids })
    }

    /// Ids of the points at most `reach` from `p`, in their order.
    pub fn within(&self, p: DVec3, reach: f64) -> impl Iterator<Item = u32> + '_ {
        let near = move |(q, _): &(&DVec3, &u32)| q.distance_squared(p) <= reach * reach;
        self.points.iter().zip(&self.ids).filter(near).map(|(_, id)| *id)
    }

    /// Id of the nearest point and its distance; the first on ties.
    pub fn nearest(&self, p: DVec3) -> Option<(u32, f64)> {
        if let Some(tree) = &self.tree {
            return tree.nearest(p).map(|(i, d)| (self.ids[i], d));
        }
        let mut best: Option<(f64, usize)> = None;
        for (i, q) in self.points.iter().enumerate() {
            let d = q.distance_squared(p);
            if best.is_none_or(|(least, _)| d < least) {
                best = Some((d, i));
            }
        }
        best.map(|(d, i)| (self.ids[i], d.sqrt()))
    }
}
