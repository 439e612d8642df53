//! Fewer triangles for the same surface: edges are collapsed in the order of their quadric error (Garland and Heckbert,
//! Surface simplification using quadric error metrics, SIGGRAPH 1997).

use std::{cmp::Reverse, collections::BinaryHeap};

use glioscope_core::glam::{DMat3, DVec3};

/// A triangle may turn by at most the angle of this cosine.
const LEAST_COSINE: f64 = 0.4;
/// A triangle must keep this quality: four √3 times its area by the sum of its squared sides, 1 for equal sides.
const LEAST_QUALITY: f64 = 0.08;
/// Determinants below this share of the trace's cube are of a flat or straight place, where the best point isn't unique.
const SINGULAR: f64 = 1e-5;

/// Sum of squared distances to planes, weighted by area: pᵀAp + 2b·p + c.
#[derive(Clone, Copy)]
struct Quadric {
    a: DMat3,
    b: DVec3,
    c: f64,
    weight: f64,
}

impl Quadric {
    const ZERO: Self = Self { a: DMat3::ZERO, b: DVec3::ZERO, c: 0.0, weight: 0.0 };

    fn of_plane(normal: DVec3, through: DVec3, weight: f64) -> Self {
        let d = -normal.dot(through);
        let a = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z) * weight;
        Self { a, b: normal * d * weight, c: d * d * weight, weight }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            a: self.a + other.a,
            b: self.b + other.b,
            c: self.c + other.c,
            weight: self.weight + other.weight,
        }
    }

    /// Mean squared distance of `p` to the planes.
    fn error_mm2(&self, p: DVec3) -> f64 {
        let sum = p.dot(self.a * p) + 2.0 * self.b.dot(p) + self.c;
        if self.weight > 0.0 { (sum / self.weight).max(0.0) } else { 0.0 }
    }

    /// The point of least error where that is unique.
    fn best(&self) -> Option<DVec3> {
        let determinant = self.a.determinant();
        let trace = self.a.x_axis.x + self.a.y_axis.y + self.a.z_axis.z;
        (determinant.abs() > SINGULAR * trace.powi(3)).then(|| self.a.inverse() * -self.b)
    }
}

/// A positive number in the order of its bits.
#[derive(Clone, Copy, PartialEq)]
struct Error(f64);

impl Eq for Error {}

impl PartialOrd for Error {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Error {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// An edge by its error, and the versions of its ends when that was computed.
type Candidate = Reverse<(Error, [u32; 2], [u32; 2])>;

struct Collapser {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    is_removed: Vec<bool>,
    of_vertex: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    versions: Vec<u32>,
    heap: BinaryHeap<Candidate>,
    max_mm2: f64,
}

/// A closed surface with fewer triangles, each vertex at a root mean square distance of at most `error_mm` from the planes of
/// the triangles that it stands for. Its connectedness and number of handles stay as they are.
pub fn simplified(positions: &[DVec3], triangles: &[[u32; 3]], error_mm: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut of_vertex = vec![Vec::new(); positions.len()];
    let mut quadrics = vec![Quadric::ZERO; positions.len()];
    // Near zero, so that nothing cancels.
    let center = positions.first().copied().unwrap_or_default();
    let positions: Vec<DVec3> = positions.iter().map(|p| *p - center).collect();
    for (t, triangle) in (0..).zip(triangles) {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let cross = (b - a).cross(c - a);
        let plane = Quadric::of_plane(cross.normalize_or_zero(), a, cross.length() / 2.0);
        for v in triangle {
            of_vertex[*v as usize].push(t);
            quadrics[*v as usize] = quadrics[*v as usize].plus(plane);
        }
    }
    let versions = vec![0; positions.len()];
    let mut collapser = Collapser {
        is_removed: vec![false; triangles.len()],
        triangles: triangles.to_vec(),
        positions,
        of_vertex,
        quadrics,
        versions,
        heap: BinaryHeap::new(),
        max_mm2: error_mm * error_mm,
    };
    collapser.run();
    collapser.into_surface(center)
}

impl Collapser {
    fn run(&mut self) {
        for triangle in self.triangles.clone() {
            for (n, &a) in triangle.iter().enumerate() {
                let b = triangle[(n + 1) % 3];
                // Each edge is met twice.
                if a < b {
                    self.push([a, b]);
                }
            }
        }
        while let Some(Reverse((_, edge, versions))) = self.heap.pop() {
            if edge.map(|v| self.versions[v as usize]) == versions {
                self.collapse(edge);
            }
        }
    }

    fn quadric(&self, [a, b]: [u32; 2]) -> Quadric {
        self.quadrics[a as usize].plus(self.quadrics[b as usize])
    }

    /// Where an edge would collapse to.
    fn target(&self, edge: [u32; 2]) -> DVec3 {
        let quadric = self.quadric(edge);
        let [a, b] = edge.map(|v| self.positions[v as usize]);
        let middle = (a + b) / 2.0;
        // What is nearly flat has its best point anywhere: not far from the edge.
        let best = quadric.best().filter(|p| p.distance(middle) <= a.distance(b) * 2.0);
        best.unwrap_or_else(|| {
            let least = [middle, a, b]
                .into_iter()
                .min_by(|p, q| quadric.error_mm2(*p).total_cmp(&quadric.error_mm2(*q)));
            least.unwrap_or(middle)
        })
    }

    fn push(&mut self, edge: [u32; 2]) {
        let error = self.quadric(edge).error_mm2(self.target(edge));
        if error <= self.max_mm2 {
            let [a, b] = edge.map(|v| self.positions[v as usize]);
            // Where errors are equal, as in planes, short edges first: triangles stay well shaped.
            let shape = 1e-7 * a.distance_squared(b);
            let versions = edge.map(|v| self.versions[v as usize]);
            self.heap.push(Reverse((Error(error + shape), edge, versions)));
        }
    }

    fn neighbors(&self, v: u32) -> Vec<u32> {
        let triangles = self.of_vertex[v as usize].iter();
        let mut all: Vec<u32> =
            triangles.flat_map(|t| self.triangles[*t as usize]).filter(|other| *other != v).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    fn collapse(&mut self, [a, b]: [u32; 2]) {
        let target = self.target([a, b]);
        let (around_a, around_b) = (self.neighbors(a), self.neighbors(b));
        let shared = around_a.iter().filter(|v| around_b.binary_search(v).is_ok()).count();
        let both: Vec<u32> = {
            let of_b = &self.of_vertex[b as usize];
            self.of_vertex[a as usize].iter().filter(|t| of_b.contains(t)).copied().collect()
        };
        // Two triangles and their two tips alone: else the surface would change its kind. Four faces and edges remain.
        if shared != 2 || both.len() != 2 || around_a.len() + around_b.len() < 8 {
            return;
        }
        if [a, b].iter().any(|v| !self.keeps_shape(*v, &both, target)) {
            return;
        }
        for &t in &both {
            self.is_removed[t as usize] = true;
            for v in self.triangles[t as usize] {
                self.of_vertex[v as usize].retain(|other| *other != t);
            }
        }
        let moved = std::mem::take(&mut self.of_vertex[b as usize]);
        for &t in &moved {
            for v in &mut self.triangles[t as usize] {
                if *v == b {
                    *v = a;
                }
            }
        }
        self.of_vertex[a as usize].extend(moved);
        self.quadrics[a as usize] = self.quadric([a, b]);
        self.positions[a as usize] = target;
        self.versions[b as usize] += 1;
        self.versions[a as usize] += 1;
        for other in self.neighbors(a) {
            self.push([a.min(other), a.max(other)]);
        }
    }

    /// Whether the triangles at `v`, but for those that go, neither turn nor become slivers when it moves to `target`.
    fn keeps_shape(&self, v: u32, going: &[u32], target: DVec3) -> bool {
        self.of_vertex[v as usize].iter().filter(|t| !going.contains(t)).all(|t| {
            let corners = self.triangles[*t as usize];
            let old = corners.map(|c| self.positions[c as usize]);
            let new = corners.map(|c| if c == v { target } else { self.positions[c as usize] });
            let cross = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
            let [from, to] = [cross(old), cross(new)];
            let sides = new[0].distance_squared(new[1])
                + new[1].distance_squared(new[2])
                + new[2].distance_squared(new[0]);
            let quality = 2.0 * 3.0_f64.sqrt() * to.length() / sides;
            quality > LEAST_QUALITY && from.dot(to) > LEAST_COSINE * from.length() * to.length()
        })
    }

    fn into_surface(self, center: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut number = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for (triangle, _) in self.triangles.iter().zip(&self.is_removed).filter(|(_, removed)| !**removed) {
            triangles.push(triangle.map(|v| {
                let v = v as usize;
                if number[v] == u32::MAX {
                    number[v] = positions.len() as u32;
                    positions.push(self.positions[v] + center);
                }
                number[v]
            }));
        }
        (positions, triangles)
    }
}
