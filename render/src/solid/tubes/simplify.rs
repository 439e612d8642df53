//! Simplification of polylines.

use glam::DVec3;

/// Most points that one segment may replace: the cost grows with its square.
const MOST_SKIPPED: usize = 64;

/// Distance of `p` from the segment `a` to `b`.
pub(super) fn off_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    p.distance(a + share_along(p, a, b) * (b - a))
}

/// A place on a line: between two of its points, `share` of the way from the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kept {
    pub from: usize,
    pub to: usize,
    pub share: f64,
}

impl Kept {
    fn point(n: usize) -> Self {
        Self { from: n, to: n, share: 1.0 }
    }

    /// Where it is.
    pub fn place(self, line: &[DVec3]) -> DVec3 {
        let Self { from, to, share } = self;
        if share >= 1.0 { line[to] } else { line[from].lerp(line[to], share) }
    }
}

/// Share of the segment `a` to `b` at the place nearest to `p`.
pub(super) fn share_along(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let squared = along.length_squared();
    if squared > 0.0 { ((p - a).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 }
}

/// A subset of the points of `line` that includes its ends, such that every point that a segment replaces is within
/// `tolerance` of it, and `fits` is true of the segment's ends. Segments are at most `longest` long; longer ones of `line` are subdivided. The points within a
/// distance of a segment form a convex set, so the whole replaced part of the line is that close to the segment; and
/// as that part runs from one end to the other, all of the segment is that close to the line.
pub(super) fn simplified(
    line: &[DVec3],
    tolerance: f64,
    longest: f64,
    fits: impl Fn(usize, usize) -> bool,
) -> Vec<Kept> {
    if line.is_empty() {
        return Vec::new();
    }
    let mut out = vec![Kept::point(0)];
    let mut at = 0;
    while at + 1 < line.len() {
        let fits = |to: usize| {
            let (a, b) = (line[at], line[to]);
            a.distance(b) <= longest
                && line[at + 1..to].iter().all(|&p| off_segment(p, a, b) <= tolerance)
                && fits(at, to)
        };
        let mut to = at + 1;
        while to + 1 < line.len() && to - at < MOST_SKIPPED && fits(to + 1) {
            to += 1;
        }
        // A long segment of the file is subdivided: it may run from far to near.
        let (a, b) = (line[at], line[to]);
        let parts = (a.distance(b) / longest).ceil().clamp(1.0, 4096.0) as usize;
        out.extend((1..parts).map(|n| Kept { from: at, to, share: n as f64 / parts as f64 }));
        out.push(Kept::point(to));
        at = to;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simplified(line: &[DVec3], tolerance: f64, longest: f64) -> Vec<DVec3> {
        let kept = super::simplified(line, tolerance, longest, |_, _| true);
        kept.into_iter().map(|kept| kept.place(line)).collect()
    }

    /// Largest distance from the line `b` of points of `a`, in steps of a hundredth of a segment.
    fn one_sided(a: &[DVec3], b: &[DVec3]) -> f64 {
        let near = |p: DVec3| b.windows(2).map(|s| off_segment(p, s[0], s[1])).fold(f64::INFINITY, f64::min);
        a.windows(2)
            .flat_map(|s| (0..=100).map(move |n| s[0].lerp(s[1], f64::from(n) / 100.0)))
            .map(near)
            .fold(0.0, f64::max)
    }

    #[test]
    fn simplified_lines_are_within_tolerance_with_fewer_points() {
        let helix: Vec<DVec3> = (0..600)
            .map(|n| {
                let t = f64::from(n) * 0.02;
                DVec3::new(18.0 * t.cos(), 18.0 * t.sin(), 4.0 * t + 0.03 * (t * 90.0).sin())
            })
            .collect();
        for tolerance in [0.02, 0.1, 0.5] {
            let few = simplified(&helix, tolerance, 20.0);
            println!("{tolerance} mm: {} of {} points", few.len(), helix.len());
            assert!(one_sided(&helix, &few) <= tolerance + 1e-12);
            assert!(one_sided(&few, &helix) <= tolerance + 1e-12);
            assert!(few.len() * 3 < helix.len() || tolerance < 0.1);
            assert_eq!((few.first(), few.last()), (helix.first(), helix.last()));
            assert!(few.windows(2).all(|s| s[0].distance(s[1]) <= 20.0 + 1e-9));
        }
    }

    #[test]
    fn a_segment_that_does_not_fit_is_not_drawn() {
        let line: Vec<DVec3> = (0..20).map(|n| DVec3::X * f64::from(n)).collect();
        // A value that jumps at the tenth point.
        let kept =
            super::simplified(&line, 0.1, 100.0, |from, to| (from < 10) == (to < 10) || to == from + 1);
        let ends: Vec<usize> = kept.iter().map(|kept| kept.to).collect();
        assert_eq!(ends, [0, 9, 10, 19]);
    }

    #[test]
    fn reversals_are_kept_and_long_segments_subdivided() {
        // Out and back on itself: the far end must be kept.
        let back: Vec<DVec3> = [0.0, 1.0, 2.0, 3.0, 2.0, 1.0].map(|x| DVec3::X * x).to_vec();
        let few = simplified(&back, 0.1, 20.0);
        assert_eq!(few, [0.0, 3.0, 1.0].map(|x| DVec3::X * x));
        let long = simplified(&[DVec3::ZERO, DVec3::Z * 50.0], 0.1, 20.0);
        assert_eq!(long.len(), 4);
        assert!(long.windows(2).all(|s| s[0].distance(s[1]) < 20.0));
        // Points at one place, one point, none.
        assert_eq!(simplified(&[DVec3::ONE; 5], 0.1, 20.0), [DVec3::ONE; 2]);
        assert_eq!(simplified(&[DVec3::ONE], 0.1, 20.0), [DVec3::ONE]);
        assert_eq!(simplified(&[], 0.1, 20.0), []);
    }
}
