//! A bounding volume hierarchy of boxes of voxels.

use glam::DVec3;

use super::{CellBox, Metric, Nearest, segment};
use crate::{MaskBits, grid::ijk};

/// Maximum number of boxes in a leaf.
const LEAF: usize = 4;

/// Each run of active voxels along x as one box.
pub(super) fn runs(mask: &MaskBits) -> Vec<CellBox> {
    let dims = mask.dims();
    let mut boxes: Vec<CellBox> = Vec::new();
    let mut last = None;
    mask.for_each(|linear| {
        let [x, y, z] = ijk(dims, linear).map(|v| v as f64);
        let continues = x > 0.0 && last == Some(linear.wrapping_sub(1));
        last = Some(linear);
        match boxes.last_mut().filter(|_| continues) {
            Some(run) => run.hi.x = x + 0.5,
            None => boxes.push(CellBox { lo: DVec3::new(x, y, z) - 0.5, hi: DVec3::new(x, y, z) + 0.5 }),
        }
    });
    boxes
}

/// A range of boxes and its bounding box, in millimetres along the metric's axes.
#[derive(Clone, Debug)]
struct Node {
    lo_mm: DVec3,
    hi_mm: DVec3,
    start: usize,
    end: usize,
    /// The right child; the left one follows its parent. `None` in a leaf.
    right: Option<usize>,
}

#[derive(Clone, Debug)]
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    boxes: Vec<CellBox>,
}

/// Smallest and largest coordinates of a box's corners in millimetres.
fn extent_mm(cells: &CellBox, metric: &Metric) -> (DVec3, DVec3) {
    (0..8).fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 1 { cells.hi[axis] } else { cells.lo[axis] };
        let p = metric.mm * DVec3::new(pick(0), pick(1), pick(2));
        (lo.min(p), hi.max(p))
    })
}

fn split(boxes: &mut [CellBox], start: usize, metric: &Metric, nodes: &mut Vec<Node>) {
    let (lo_mm, hi_mm) = boxes
        .iter()
        .map(|b| extent_mm(b, metric))
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), (l, h)| (lo.min(l), hi.max(h)));
    let node = nodes.len();
    nodes.push(Node { lo_mm, hi_mm, start, end: start + boxes.len(), right: None });
    if boxes.len() <= LEAF {
        return;
    }
    let size = hi_mm - lo_mm;
    let axis = (1..3).fold(0, |widest, a| if size[a] > size[widest] { a } else { widest });
    let median = boxes.len() / 2;
    boxes.select_nth_unstable_by(median, |a, b| (a.lo + a.hi)[axis].total_cmp(&(b.lo + b.hi)[axis]));
    let (left, right) = boxes.split_at_mut(median);
    split(left, start, metric, nodes);
    nodes[node].right = Some(nodes.len());
    split(right, start + median, metric, nodes);
}

/// State of a search: the segment and the best result so far.
struct Query<'a> {
    a: DVec3,
    b: DVec3,
    lo_mm: DVec3,
    hi_mm: DVec3,
    metric: &'a Metric,
    limit_mm2: f64,
    best: Option<Nearest>,
}

impl BoxTree {
    pub(super) fn new(mut boxes: Vec<CellBox>, metric: &Metric) -> Option<Self> {
        if boxes.is_empty() {
            return None;
        }
        let mut nodes = Vec::new();
        split(&mut boxes, 0, metric, &mut nodes);
        Some(Self { nodes, boxes })
    }

    /// The point of the segment `a` to `b` (voxel indices) nearest to any box, if it is nearer than
    /// the square root of `limit_mm2`.
    pub(super) fn nearest(&self, a: DVec3, b: DVec3, limit_mm2: f64, metric: &Metric) -> Option<Nearest> {
        let (a_mm, b_mm) = (metric.mm * a, metric.mm * b);
        let (lo_mm, hi_mm) = (a_mm.min(b_mm), a_mm.max(b_mm));
        let mut query = Query { a, b, lo_mm, hi_mm, metric, limit_mm2, best: None };
        self.search(0, &mut query);
        query.best
    }

    fn search(&self, at: usize, query: &mut Query<'_>) {
        let node = &self.nodes[at];
        if query.bound(node) >= query.limit_mm2 {
            return;
        }
        let Some(right) = node.right else {
            for cells in &self.boxes[node.start..node.end] {
                let found = segment::to_box(query.a, query.b, cells, query.metric);
                if found.squared_mm2 < query.limit_mm2 {
                    query.limit_mm2 = found.squared_mm2;
                    query.best = Some(found);
                }
            }
            return;
        };
        let (left, right) = (at + 1, right);
        let (d_left, d_right) = (query.bound(&self.nodes[left]), query.bound(&self.nodes[right]));
        let order = if d_right < d_left { [right, left] } else { [left, right] };
        order.into_iter().for_each(|child| self.search(child, query));
    }
}

impl Query<'_> {
    /// Squared distance between the bounding boxes of the segment and of the node, reduced slightly
    /// for rounding: never more than the exact one between their contents.
    fn bound(&self, node: &Node) -> f64 {
        let gap = (node.lo_mm - self.hi_mm).max(self.lo_mm - node.hi_mm).max(DVec3::ZERO);
        gap.length_squared() * (1.0 - 1e-12)
    }
}
