//! The nearest of many points to any position.

use glam::DVec3;

use super::DistanceError;

/// Points in a leaf: up to this many, a linear scan is cheaper than splitting.
const LEAF: usize = 16;

/// A k-d tree over points in millimetres (Bentley 1975; split at the median of the widest axis,
/// as Friedman, Bentley and Finkel 1977). Results are exact: equal to those of a linear scan.
#[derive(Clone, Debug)]
pub struct KdTree {
    nodes: Vec<Node>,
    /// Points in leaf order.
    points: Vec<DVec3>,
    /// Index of each point in the caller's list.
    index: Vec<u32>,
}

/// A range of points and its bounding box.
#[derive(Clone, Debug)]
struct Node {
    lo: DVec3,
    hi: DVec3,
    start: usize,
    end: usize,
    /// The right child; the left one follows its parent. `None` in a leaf.
    right: Option<usize>,
}

impl KdTree {
    /// A tree over `points_mm`, duplicates allowed. `O(n log n)`, 32 bytes per point.
    /// `None` when there is no point.
    ///
    /// # Errors
    /// [`DistanceError::NotFinite`] when a coordinate is NaN or infinite,
    /// [`DistanceError::TooLarge`] for 2³² − 1 points or more.
    pub fn new(points_mm: &[DVec3]) -> Result<Option<Self>, DistanceError> {
        if points_mm.len() >= u32::MAX as usize {
            return Err(DistanceError::TooLarge(points_mm.len()));
        }
        if let Some(bad) = points_mm.iter().position(|p| !p.is_finite()) {
            return Err(DistanceError::NotFinite(bad));
        }
        if points_mm.is_empty() {
            return Ok(None);
        }
        let mut index: Vec<u32> = (0..points_mm.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * points_mm.len().div_ceil(LEAF / 2));
        split(points_mm, &mut index, 0, &mut nodes);
        let points = index.iter().map(|&i| points_mm[i as usize]).collect();
        Ok(Some(Self { nodes, points, index }))
    }

    /// Number of points, at least 1.
    #[expect(clippy::len_without_is_empty, reason = "a tree is never empty")]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Index, in the list given to [`KdTree::new`], of the point nearest to `p_mm`, and its
    /// distance `√((Δx² + Δy²) + Δz²)` in `f64`, bit for bit the minimum over all points. Ties in
    /// the (rounded) squared distance go to the point first in the list. `None` when `p_mm` isn't
    /// finite. A distance whose square overflows is infinite.
    pub fn nearest(&self, p_mm: DVec3) -> Option<(usize, f64)> {
        if !p_mm.is_finite() {
            return None;
        }
        let mut best = (f64::INFINITY, u32::MAX);
        self.search(0, p_mm, &mut best);
        Some((best.1 as usize, best.0.sqrt()))
    }

    fn search(&self, node: usize, p: DVec3, best: &mut (f64, u32)) {
        let Node { start, end, right, .. } = self.nodes[node];
        let Some(right) = right else {
            for (point, &index) in self.points[start..end].iter().zip(&self.index[start..end]) {
                let candidate = (squared(*point - p), index);
                if candidate < *best {
                    *best = candidate;
                }
            }
            return;
        };
        let left = node + 1;
        let (d_left, d_right) = (self.nodes[left].bound(p), self.nodes[right].bound(p));
        let order = if d_left <= d_right {
            [(d_left, left), (d_right, right)]
        } else {
            [(d_right, right), (d_left, left)]
        };
        for (bound, child) in order {
            // A box at exactly the best distance may contain a tied point with a smaller index.
            if bound <= best.0 {
                self.search(child, p, best);
            }
        }
    }
}

impl Node {
    /// Squared distance to the box. Rounding is monotone and the operations are those of
    /// [`squared`], so it never exceeds the rounded squared distance to any point inside.
    fn bound(&self, p: DVec3) -> f64 {
        squared((self.lo - p).max(p - self.hi).max(DVec3::ZERO))
    }
}

fn squared(d: DVec3) -> f64 {
    (d.x * d.x + d.y * d.y) + d.z * d.z
}

/// Appends the node of `index`, whose first entry is number `start` of all, and its descendants.
fn split(points: &[DVec3], index: &mut [u32], start: usize, nodes: &mut Vec<Node>) {
    let (lo, hi) = index
        .iter()
        .map(|&i| points[i as usize])
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let node = nodes.len();
    nodes.push(Node { lo, hi, start, end: start + index.len(), right: None });
    if index.len() <= LEAF {
        return;
    }
    let size = hi - lo;
    let axis = (1..3).fold(0, |widest, a| if size[a] > size[widest] { a } else { widest });
    let median = index.len() / 2;
    index.select_nth_unstable_by(median, |&a, &b| {
        points[a as usize][axis].total_cmp(&points[b as usize][axis]).then(a.cmp(&b))
    });
    let (left, right) = index.split_at_mut(median);
    split(points, left, start, nodes);
    nodes[node].right = Some(nodes.len());
    split(points, right, start + median, nodes);
}
