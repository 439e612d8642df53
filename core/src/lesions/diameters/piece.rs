//! A connected piece of one slice of a component: pixels in the plane's index space, and the chords inside them.
//!
//! Corner `[i, j]` is the lower corner of pixel `[i, j]`. The piece is the closed union of its pixels: a chord may run
//! along an edge of a pixel, and through the corner where two pixels touch.

/// Positions this close to a corner, in pixels, count as on it: rounding must not decide what a chord touches.
const SAME_CORNER: f64 = 1e-9;

/// Lengths in millimetres of differences of indices within a plane: the products of the plane's two columns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Metric {
    pub uu: f64,
    pub uv: f64,
    pub vv: f64,
}

impl Metric {
    pub fn length_mm(&self, [a, b]: [f64; 2]) -> f64 {
        (self.uu * a * a + 2.0 * self.uv * a * b + self.vv * b * b).max(0.0).sqrt()
    }

    /// A direction at right angles in millimetres.
    pub fn perpendicular(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let w = [-(self.uv * a + self.vv * b), self.uu * a + self.uv * b];
        // The larger part is 1: parts of any size in, parts near 1 out.
        let scale = w[0].abs().max(w[1].abs());
        if scale > 0.0 { w.map(|part| part / scale) } else { w }
    }
}

/// A corner of the piece's boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// One pixel meets here, on these sides of the corner.
    Convex([i32; 2]),
    /// All pixels but one meet here; that one would lie on these sides.
    Reflex([i32; 2]),
    /// Two pixels touch here.
    Touching,
}

impl Shape {
    /// Whether a longest chord can pass or end here and go on in direction `d`: at a reflex corner it touches, without
    /// entering the missing pixel on either side.
    fn allows(self, d: [i32; 2]) -> bool {
        match self {
            Self::Convex(side) => d[0] * side[0] >= 0 && d[1] * side[1] >= 0,
            Self::Reflex(side) => d[0].signum() * d[1].signum() * side[0] * side[1] <= 0,
            Self::Touching => true,
        }
    }
}

/// A chord in the plane's indices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaneChord {
    pub from: [f64; 2],
    pub to: [f64; 2],
    pub length_mm: f64,
}

impl PlaneChord {
    pub fn direction(&self) -> [f64; 2] {
        [self.to[0] - self.from[0], self.to[1] - self.from[1]]
    }

    /// Whether it has a point in common with another.
    pub fn crosses(&self, other: &Self) -> bool {
        let side = |line: &Self, p: [f64; 2]| {
            let [a, b] = line.direction();
            let distance = a * (p[1] - line.from[1]) - b * (p[0] - line.from[0]);
            if distance.abs() <= SAME_CORNER * a.hypot(b) { 0.0 } else { distance.signum() }
        };
        let apart = |line: &Self, of: &Self| side(line, of.from) * side(line, of.to) > 0.0;
        !apart(self, other) && !apart(other, self)
    }
}

/// One piece of a slice.
#[derive(Debug)]
pub(super) struct Piece {
    /// Pixels of its box and a margin of one, `u` fastest.
    cells: Vec<bool>,
    width: i32,
    height: i32,
    /// Index of the box's first pixel, margin included.
    origin: [i32; 2],
    /// Corners of the boundary, with their places in the ellipse.
    corners: Vec<([i32; 2], Shape, [f64; 2])>,
    /// Corners of the convex hull, in order around it.
    hull: Vec<[i32; 2]>,
    ellipse: Ellipse,
}

impl Piece {
    /// The piece of these pixels; at least one.
    pub fn new(pixels: &[[i32; 2]]) -> Self {
        let (lo, hi) = pixels.iter().fold(([i32::MAX; 2], [i32::MIN; 2]), |(lo, hi), p| {
            ([lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])])
        });
        let origin = [lo[0] - 1, lo[1] - 1];
        let (width, height) = (hi[0] - lo[0] + 3, hi[1] - lo[1] + 3);
        let mut cells = vec![false; width as usize * height as usize];
        for p in pixels {
            cells[(p[1] - origin[1]) as usize * width as usize + (p[0] - origin[0]) as usize] = true;
        }
        let (corners, hull, ellipse) = (Vec::new(), Vec::new(), Ellipse::default());
        let mut piece = Self { cells, width, height, origin, corners, hull, ellipse };
        let corners = piece.find_corners();
        let convex = corners.iter().filter(|(_, shape)| !matches!(shape, Shape::Reflex(_)));
        piece.hull = convex_hull(convex.map(|(at, _)| *at).collect());
        piece.ellipse = Ellipse::around(&piece.hull);
        let placed = |(at, shape): ([i32; 2], Shape)| (at, shape, piece.ellipse.place(at.map(f64::from)));
        piece.corners = corners.into_iter().map(placed).collect();
        piece
    }

    /// Whether the box has this pixel and it is one of the piece.
    #[inline]
    fn has(&self, u: i32, v: i32) -> bool {
        let (u, v) = (u - self.origin[0], v - self.origin[1]);
        (0..self.width).contains(&u) && (0..self.height).contains(&v) && {
            self.cells.get(v as usize * self.width as usize + u as usize).copied().unwrap_or(false)
        }
    }

    fn find_corners(&self) -> Vec<([i32; 2], Shape)> {
        let mut corners = Vec::new();
        for v in self.origin[1] + 1..self.origin[1] + self.height {
            for u in self.origin[0] + 1..self.origin[0] + self.width {
                let around = [[-1, -1], [0, -1], [-1, 0], [0, 0]];
                let set = around.map(|[a, b]| self.has(u + a, v + b));
                let side = |at: usize| around[at].map(|part| 2 * part + 1);
                let shape = match set.iter().filter(|has| **has).count() {
                    1 => set.iter().position(|has| *has).map(|at| Shape::Convex(side(at))),
                    3 => set.iter().position(|has| !*has).map(|at| Shape::Reflex(side(at))),
                    2 if set[0] == set[3] => Some(Shape::Touching),
                    _ => None,
                };
                corners.extend(shape.map(|shape| ([u, v], shape)));
            }
        }
        corners
    }

    /// How far a chord from the corner `from` stays in the piece in direction `d`, in multiples of `d`.
    ///
    /// In steps of one pixel, a column, along the larger part of `d`; a step touches one pixel of it or two. Columns and
    /// rows are counted from the corner in the direction of the chord.
    fn reach(&self, from: [i32; 2], d: [f64; 2]) -> f64 {
        let main = usize::from(d[1].abs() > d[0].abs());
        let (along, across) = (d[main], d[1 - main]);
        if along == 0.0 {
            return 0.0;
        }
        let (step, slope) = (along.abs(), across.abs() / along.abs());
        let strides = [1, self.width as isize];
        // Index of the pixel in column 0 and row 0, and what a column or row more adds.
        let place =
            |axis: usize, part: f64| (from[axis] - self.origin[axis] - i32::from(part < 0.0)) as isize;
        let toward = |axis: usize, part: f64| if part < 0.0 { -strides[axis] } else { strides[axis] };
        let first = place(main, along) * strides[main] + place(1 - main, across) * strides[1 - main];
        let (per_column, per_row) = (toward(main, along), toward(1 - main, across));
        // A chord ends at the margin of the cells, if not before.
        let has = |column: i32, row: i32| {
            let at = first + column as isize * per_column + row as isize * per_row;
            self.cells.get(at as usize).copied().unwrap_or(false)
        };
        let (mut row, mut is_on_line) = (0, true);
        for column in 0..self.width.max(self.height) {
            let after = slope * f64::from(column + 1);
            let whole = (after + 0.5) as i32;
            let ends_on_line = (after - f64::from(whole)).abs() < SAME_CORNER;
            let next = if ends_on_line { whole } else { after as i32 };
            if is_on_line && ends_on_line && next == row {
                if !has(column, row - 1) && !has(column, row) {
                    return f64::from(column) / step;
                }
                continue;
            }
            if !has(column, row) {
                return f64::from(column) / step;
            }
            let last = next - i32::from(ends_on_line);
            if last != row && !has(column, last) {
                return f64::from(last) / slope / step;
            }
            (row, is_on_line) = (next, ends_on_line);
        }
        0.0
    }

    /// Diameter of the convex hull: no chord is longer.
    pub fn hull_diameter_mm(&self, metric: &Metric) -> f64 {
        self.hull_pairs().map(|(p, q)| metric.length_mm(difference(p, q))).fold(0.0, f64::max)
    }

    fn hull_pairs(&self) -> impl Iterator<Item = ([i32; 2], [i32; 2])> {
        self.hull.iter().enumerate().flat_map(|(n, p)| self.hull[..n].iter().map(move |q| (*p, *q)))
    }

    /// Area of the convex hull in pixels.
    pub fn hull_area(&self) -> f64 {
        let next = self.hull.iter().cycle().skip(1);
        let twice = self
            .hull
            .iter()
            .zip(next)
            .map(|(p, q)| i64::from(p[0]) * i64::from(q[1]) - i64::from(q[0]) * i64::from(p[1]));
        twice.sum::<i64>().abs() as f64 / 2.0
    }

    /// Calls `found` with every chord at least `least_mm` long that may be the longest; `found` returns the least length from
    /// there on.
    ///
    /// A longest chord passes two corners: while it passes one only, its length as a function of its direction is a sum
    /// of reciprocal cosines, which has no maximum between the directions at which it meets the next corner.
    pub fn critical_chords(
        &self,
        metric: &Metric,
        mut least_mm: f64,
        mut found: impl FnMut(PlaneChord) -> f64,
    ) {
        // Corners that allow rising and those that allow falling directions.
        for sign in [1, -1] {
            let corners = self.corners.iter().filter(|(_, shape, _)| match shape {
                Shape::Convex([a, b]) => a * b == sign,
                Shape::Reflex([a, b]) => a * b == -sign,
                Shape::Touching => true,
            });
            let corners: Vec<_> = corners.collect();
            for (n, (p, shape, place)) in corners.iter().enumerate() {
                for (q, other, other_place) in &corners[..n] {
                    let d = [q[0] - p[0], q[1] - p[1]];
                    let is_own = d[0].signum() * d[1].signum() * sign >= 0;
                    if !is_own || !shape.allows(d) || !other.allows([-d[0], -d[1]]) {
                        continue;
                    }
                    let direction = d.map(f64::from);
                    let turned = [other_place[0] - place[0], other_place[1] - place[1]];
                    let [most_back, most] = exits(*place, turned);
                    let mm = metric.length_mm(direction);
                    if mm * (most_back + most) < least_mm || !self.has_half([p[0] + q[0], p[1] + q[1]]) {
                        continue;
                    }
                    // What lies beyond both corners is short, so that it is looked at first.
                    let back = self.reach(*p, [-direction[0], -direction[1]]);
                    if mm * (back + most) < least_mm {
                        continue;
                    }
                    let beyond = self.reach(*q, direction);
                    if mm * (back + 1.0 + beyond) >= least_mm
                        && self.reach(*p, direction) >= 1.0 - SAME_CORNER
                    {
                        least_mm = found(chord(*p, direction, [-back, 1.0 + beyond], metric));
                    }
                }
            }
        }
    }

    /// Whether half of `twice` lies in the piece.
    fn has_half(&self, twice: [i32; 2]) -> bool {
        let [u, v] = twice.map(|n| n >> 1);
        // On a line between pixels, both belong to it.
        let [left, below] = twice.map(|n| 1 - (n & 1));
        (v - below..=v).any(|v| (u - left..=u).any(|u| self.has(u, v)))
    }

    /// The longest chords: all whose lengths are equal but for rounding; none where all are shorter than `least_mm`.
    pub fn longest(&self, metric: &Metric, least_mm: f64) -> Vec<PlaneChord> {
        let mut longest = Longest { mm: least_mm, chords: Vec::new() };
        let hull_mm = self.hull_diameter_mm(metric);
        for (p, q) in self.hull_pairs() {
            let d = difference(p, q);
            if metric.length_mm(d) >= longest.mm && self.reach(p, d) >= 1.0 - SAME_CORNER {
                longest.add(chord(p, d, [0.0, 1.0], metric));
            }
        }
        // Else one that bends around what is missing of the hull may be longer.
        if longest.mm < hull_mm * (1.0 - SAME_LENGTH) {
            self.critical_chords(metric, longest.least_mm(), |chord| longest.add(chord));
        }
        longest.chords
    }

    /// The longest chord at right angles to direction `d`; `None` where all are shorter than `least_mm`.
    ///
    /// Its length is linear between the places at which it passes a corner, so that the longest passes one.
    pub fn longest_across(&self, d: [f64; 2], metric: &Metric, least_mm: f64) -> Option<PlaneChord> {
        let across = metric.perpendicular(d);
        let mm = metric.length_mm(across);
        let turned = self.ellipse.turned(across);
        let (mut least_mm, mut best) = (least_mm, None);
        for (at, _, place) in &self.corners {
            let [most_back, most] = exits(*place, turned);
            if mm * (most_back + most) >= least_mm {
                let back = self.reach(*at, [-across[0], -across[1]]);
                if mm * (back + most) < least_mm {
                    continue;
                }
                let found = chord(*at, across, [-back, self.reach(*at, across)], metric);
                if found.length_mm > least_mm {
                    least_mm = found.length_mm * (1.0 + SAME_LENGTH);
                    best = Some(found);
                }
            }
        }
        best
    }

    /// Extent of the piece at right angles to direction `d`: no chord across is longer.
    pub fn extent_across_mm(&self, d: [f64; 2], metric: &Metric) -> f64 {
        let across = metric.perpendicular(d);
        let length_mm = metric.length_mm(across);
        if length_mm == 0.0 {
            return 0.0;
        }
        let along = |p: &[i32; 2]| {
            let [a, b] = p.map(f64::from);
            let [c, e] = across;
            (metric.uu * a * c + metric.uv * (a * e + b * c) + metric.vv * b * e) / length_mm
        };
        let all = self.hull.iter().map(along);
        let (lo, hi) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), at| (lo.min(at), hi.max(at)));
        hi - lo
    }
}

/// Lengths whose ratio differs from 1 by less count as equal.
pub(super) const SAME_LENGTH: f64 = 1e-9;

/// The longest of the chords added so far, with all as long.
struct Longest {
    mm: f64,
    chords: Vec<PlaneChord>,
}

impl Longest {
    fn least_mm(&self) -> f64 {
        self.mm * (1.0 - SAME_LENGTH)
    }

    fn add(&mut self, chord: PlaneChord) -> f64 {
        if chord.length_mm > self.mm * (1.0 + SAME_LENGTH) {
            self.mm = chord.length_mm;
            self.chords.clear();
        }
        if chord.length_mm >= self.least_mm() {
            self.chords.push(chord);
        }
        self.least_mm()
    }
}

/// An ellipse around a piece. Places in it: it is the unit circle about the origin.
#[derive(Debug, Default)]
struct Ellipse {
    center: [f64; 2],
    rows: [[f64; 2]; 2],
}

impl Ellipse {
    /// With the axes of the points' second moments.
    fn around(points: &[[i32; 2]]) -> Self {
        let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();
        let count = points.len().max(1) as f64;
        let mean = |axis: usize| points.iter().map(|p| p[axis]).sum::<f64>() / count;
        let center = [mean(0), mean(1)];
        let moment = |a: usize, b: usize| {
            points.iter().map(|p| (p[a] - center[a]) * (p[b] - center[b])).sum::<f64>() / count
        };
        // Inverse of the moments' Cholesky factor. A pixel is no line: both pivots are positive.
        let (xx, xy, yy) = (moment(0, 0), moment(0, 1), moment(1, 1));
        let below = xy / xx;
        let rows = [[1.0 / xx.sqrt(), 0.0], [0.0, 1.0]];
        let pivot = 1.0 / (yy - below * xy).sqrt();
        let mut ellipse = Self { center, rows: [rows[0], [-below * pivot, pivot]] };
        let farthest = points.iter().map(|p| {
            let [a, b] = ellipse.place(*p);
            a.hypot(b)
        });
        let scale = 1.0 / farthest.fold(0.0, f64::max);
        ellipse.rows = ellipse.rows.map(|row| row.map(|part| part * scale));
        ellipse
    }

    fn place(&self, at: [f64; 2]) -> [f64; 2] {
        self.turned([at[0] - self.center[0], at[1] - self.center[1]])
    }

    fn turned(&self, d: [f64; 2]) -> [f64; 2] {
        self.rows.map(|row| row[0] * d[0] + row[1] * d[1])
    }
}

/// Where the line from place `p` in direction `d` leaves the unit circle, backward and forward, in multiples of `d`, and a
/// little more: rounding must not leave out a chord.
#[inline]
fn exits(p: [f64; 2], d: [f64; 2]) -> [f64; 2] {
    const MORE: f64 = 1.0 + 1e-6;
    let squared = d[0] * d[0] + d[1] * d[1];
    let half = p[0] * d[0] + p[1] * d[1];
    let root = (half * half - squared * (p[0] * p[0] + p[1] * p[1] - MORE)).max(0.0).sqrt();
    [(half + root) / squared, (root - half) / squared]
}

/// The chord from `at + d * ends[0]` to `at + d * ends[1]`.
fn chord(at: [i32; 2], d: [f64; 2], ends: [f64; 2], metric: &Metric) -> PlaneChord {
    let [from, to] = ends.map(|t| [f64::from(at[0]) + d[0] * t, f64::from(at[1]) + d[1] * t]);
    PlaneChord { from, to, length_mm: metric.length_mm(d) * (ends[1] - ends[0]) }
}

fn difference(p: [i32; 2], q: [i32; 2]) -> [f64; 2] {
    [f64::from(q[0] - p[0]), f64::from(q[1] - p[1])]
}

/// Convex hull of points in any order, without points on its edges (Andrew's monotone chain 1979).
fn convex_hull(mut points: Vec<[i32; 2]>) -> Vec<[i32; 2]> {
    points.sort_unstable();
    points.dedup();
    let turn = |a: [i32; 2], b: [i32; 2], c: [i32; 2]| {
        let (ab, ac) = ([b[0] - a[0], b[1] - a[1]].map(i64::from), [c[0] - a[0], c[1] - a[1]].map(i64::from));
        ab[0] * ac[1] - ab[1] * ac[0]
    };
    let chain = |points: &mut dyn Iterator<Item = [i32; 2]>| {
        let mut chain: Vec<[i32; 2]> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if turn(a, b, p) > 0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut out = chain(&mut points.iter().copied());
    out.extend(chain(&mut points.iter().rev().copied()));
    out
}
