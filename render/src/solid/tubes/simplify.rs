//! Simplification of polylines.

use glam::DVec3;

/// Most points that one segment may replace: the cost grows with its square.
const MOST_SKIPPED: usize = 64;

/// Distance of `p` from the segment `a` to `b`.
pub(super) fn off_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let squared = along.length_squared();
    let t = if squared > 0.0 { ((p - a).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    p.distance(a + t * along)
}

/// A subset of the points of `line` that includes its ends, such that every point that a segment replaces is within
/// `tolerance` of it. Segments are at most `longest` long; longer ones of `line` are subdivided. The points within a
/// distance of a segment form a convex set, so the whole replaced part of the line is that close to the segment; and
/// as that part runs from one end to the other, all of the segment is that close to the line.
pub(super) fn simplified(line: &[DVec3], tolerance: f64, longest: f64) -> Vec<DVec3> {
    let Some(&first) = line.first() else { return Vec::new() };
    let mut out = vec![first];
    let mut at = 0;
    while at + 1 < line.len() {
        let fits = |to: usize| {
            let (a, b) = (line[at], line[to]);
            a.distance(b) <= longest && line[at + 1..to].iter().all(|&p| off_segment(p, a, b) <= tolerance)
        };
        let mut to = at + 1;
        while to + 1 < line.len() && to - at < MOST_SKIPPED && fits(to + 1) {
            to += 1;
        }
        // A long segment of the file is subdivided: it may run from far to near.
        let (a, b) = (line[at], line[to]);
        let parts = (a.distance(b) / longest).ceil().clamp(1.0, 4096.0) as usize;
        out.extend((1..parts).map(|n| a.lerp(b, n as f64 / parts as f64)));
        out.push(b);
        at = to;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

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
