//! Smooth curves through the points of a polyline: centripetal Catmull-Rom splines, as chains of short segments.

use glam::DVec3;

/// The most segments that replace one of the file's: 2e5 mm of arc at a deviation of 0.025 mm.
const MOST_PARTS: f64 = 1024.0;

/// A point of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CurvePoint {
    pub place: DVec3,
    /// Unit tangent; zero where the line has no length.
    pub tangent: DVec3,
    /// Between which points of the polyline, and how much of the way from the first (0) to the second (1).
    pub from: usize,
    pub to: usize,
    pub share: f64,
}

/// A piece of the curve as a cubic: `place + t (first + t (second + t third))`, t from 0 to 1.
#[derive(Clone, Copy, Debug)]
struct Cubic {
    place: DVec3,
    first: DVec3,
    second: DVec3,
    third: DVec3,
}

impl Cubic {
    /// From `p` to `q`, between the points `before` and `after`; no two neighbours are equal. With centripetal knots, a
    /// piece has neither cusp nor loop (Yuksel et al. 2011, "Parameterization and applications of Catmull-Rom curves").
    fn through(before: DVec3, p: DVec3, q: DVec3, after: DVec3) -> Self {
        let knot = |a: DVec3, b: DVec3| a.distance(b).sqrt();
        let (d0, d1, d2) = (knot(before, p), knot(p, q), knot(q, after));
        let at_p = d1 * ((p - before) / d0 - (q - before) / (d0 + d1) + (q - p) / d1);
        let at_q = d1 * ((q - p) / d1 - (after - p) / (d1 + d2) + (after - q) / d2);
        let run = q - p;
        Self { place: p, first: at_p, second: 3.0 * run - 2.0 * at_p - at_q, third: at_p + at_q - 2.0 * run }
    }

    fn at(&self, t: f64) -> DVec3 {
        self.place + t * (self.first + t * (self.second + t * self.third))
    }

    fn tangent(&self, t: f64) -> DVec3 {
        (self.first + t * (2.0 * self.second + t * 3.0 * self.third)).try_normalize().unwrap_or_default()
    }

    /// How many chords of equal steps of t are nowhere further than `tolerance` from it: a chord over a step h is at most
    /// h²/8 of the greatest second derivative away, which is at an end, as that of a cubic is linear.
    fn parts(&self, tolerance: f64) -> usize {
        let bend = (2.0 * self.second).length().max((2.0 * self.second + 6.0 * self.third).length());
        (bend / (8.0 * tolerance)).sqrt().ceil().clamp(1.0, MOST_PARTS) as usize
    }
}

/// A chain through all points of `line` that is nowhere further than `tolerance` from the smooth curve through them. At
/// its ends, the curve leaves as if the line went on straight. Points that repeat the one before are left out.
pub(super) fn smoothed(line: &[DVec3], tolerance: f64) -> Vec<CurvePoint> {
    let mut apart: Vec<usize> = (0..line.len()).collect();
    apart.dedup_by(|a, b| line[*a].distance_squared(line[*b]) <= 1e-12);
    let place = |n: usize| line[apart[n]];
    let Some(&start) = apart.first() else { return Vec::new() };
    let mut out =
        vec![CurvePoint { place: line[start], tangent: DVec3::ZERO, from: start, to: start, share: 1.0 }];
    let last = apart.len() - 1;
    for n in 0..last {
        let (p, q) = (place(n), place(n + 1));
        let before = if n == 0 { 2.0 * p - q } else { place(n - 1) };
        let after = if n + 1 == last { 2.0 * q - p } else { place(n + 2) };
        let piece = Cubic::through(before, p, q, after);
        if n == 0 {
            out[0].tangent = piece.tangent(0.0);
        }
        let parts = piece.parts(tolerance);
        let (mut at, mut run_mm) = (p, 0.0);
        let first = out.len();
        for part in 1..=parts {
            let t = part as f64 / parts as f64;
            // The file's own points exactly.
            let place = if part == parts { q } else { piece.at(t) };
            run_mm += at.distance(place);
            at = place;
            let tangent = piece.tangent(t);
            out.push(CurvePoint { place, tangent, from: apart[n], to: apart[n + 1], share: run_mm });
        }
        // Values between two points change with the way, not with the spline's parameter, whose speed varies.
        out[first..].iter_mut().for_each(|point| point.share /= run_mm);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::tubes::simplify::off_segment;

    fn wild() -> Vec<DVec3> {
        let mut state = 5_u64;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        // Segments of very different lengths.
        let mut p = DVec3::ZERO;
        (0..60)
            .map(|n| {
                let step = if n % 7 == 0 { 12.0 } else { 0.8 };
                p += step * DVec3::new(random() - 0.3, random() - 0.5, random() - 0.5);
                p
            })
            .collect()
    }

    /// The spline by its definition, Barry and Goldman's pyramid of linear interpolations, at share `s` of the piece.
    fn pyramid(points: [DVec3; 4], s: f64) -> DVec3 {
        let mut knots = [0.0; 4];
        for n in 1..4 {
            knots[n] = knots[n - 1] + points[n].distance(points[n - 1]).sqrt();
        }
        let t = knots[1] + s * (knots[2] - knots[1]);
        let mix = |a: DVec3, b: DVec3, from: f64, to: f64| (a * (to - t) + b * (t - from)) / (to - from);
        let [k0, k1, k2, k3] = knots;
        let [p0, p1, p2, p3] = points;
        let (a1, a2, a3) = (mix(p0, p1, k0, k1), mix(p1, p2, k1, k2), mix(p2, p3, k2, k3));
        let (b1, b2) = (mix(a1, a2, k0, k2), mix(a2, a3, k1, k3));
        mix(b1, b2, k1, k2)
    }

    #[test]
    fn the_curve_is_the_centripetal_spline_and_the_chain_stays_within_the_tolerance() {
        let line = wild();
        let mut counts = Vec::new();
        for tolerance in [0.1, 0.025, 0.005] {
            let chain = smoothed(&line, tolerance);
            // All points of the file are kept.
            assert!(line.iter().all(|p| chain.iter().any(|c| c.place == *p)));
            let mut worst = 0.0_f64;
            for n in 0..line.len() - 1 {
                let before = if n == 0 { 2.0 * line[0] - line[1] } else { line[n - 1] };
                let after = line.get(n + 2).copied().unwrap_or_else(|| 2.0 * line[n + 1] - line[n]);
                let own: Vec<DVec3> = std::iter::once(line[n])
                    .chain(chain.iter().filter(|c| c.to == n + 1).map(|c| c.place))
                    .collect();
                for k in 0..=200 {
                    let p = pyramid([before, line[n], line[n + 1], after], f64::from(k) / 200.0);
                    let off = own.windows(2).map(|s| off_segment(p, s[0], s[1]));
                    worst = worst.max(off.fold(f64::INFINITY, f64::min));
                }
            }
            println!("{tolerance} mm: {} points of {}, {worst:.4} mm off", chain.len(), line.len());
            assert!(worst <= tolerance, "{worst} {tolerance}");
            // The bound isn't wasteful either.
            assert!(worst > 0.2 * tolerance, "{worst} {tolerance}");
            counts.push(chain.len());
        }
        assert!(counts.is_sorted() && counts[2] > counts[0], "{counts:?}");
    }

    #[test]
    fn a_circle_is_met_far_better_than_by_its_chords() {
        let radius = 20.0;
        let on = |n: usize| {
            let angle = n as f64 * 0.25;
            radius * DVec3::new(angle.cos(), angle.sin(), 0.0)
        };
        let line: Vec<DVec3> = (0..24).map(on).collect();
        let off = |p: DVec3| (p.length() - radius).abs();
        let chord = off((line[4] + line[5]) / 2.0);
        let inner = smoothed(&line, 1e-4);
        let inner = inner.iter().filter(|c| c.from > 1 && c.to < 22);
        let worst = inner.clone().map(|c| off(c.place)).fold(0.0, f64::max);
        println!("chords {chord:.4} mm, spline {worst:.5} mm off the circle");
        assert!(worst < 0.02 * chord, "{worst} {chord}");
        // Tangents are perpendicular to the radius; at the file's points those of a circle.
        for c in inner {
            let slant = c.tangent.dot(c.place / c.place.length()).abs();
            assert!((c.tangent.length() - 1.0).abs() < 1e-12 && slant < 0.01, "{slant}");
        }
    }

    #[test]
    fn lines_without_bends_and_without_length_are_kept() {
        let straight = [0.0, 1.0, 4.0, 4.5].map(|x| DVec3::X * x);
        let chain = smoothed(&straight, 0.01);
        assert!(straight.iter().all(|p| chain.iter().any(|c| c.place == *p)));
        assert!(chain.iter().all(|c| c.tangent.distance(DVec3::X) < 1e-12));
        // Uneven steps need more points, which are as far along as their shares say.
        for point in smoothed(&[0.0, 1.0, 9.0, 10.0].map(|x| DVec3::X * x), 0.01) {
            let ends = [0.0, 1.0, 9.0, 10.0];
            let expected = ends[point.from] + point.share * (ends[point.to] - ends[point.from]);
            assert!((point.place.x - expected).abs() < 1e-12);
        }
        let repeated = smoothed(&[DVec3::ZERO, DVec3::ZERO, DVec3::X, DVec3::X], 0.01);
        assert_eq!(repeated.iter().map(|c| c.place).collect::<Vec<_>>(), [DVec3::ZERO, DVec3::X]);
        assert_eq!((repeated[1].from, repeated[1].to), (0, 2));
        assert_eq!(smoothed(&[DVec3::ONE; 3], 0.01).len(), 1);
        assert_eq!(smoothed(&[], 0.01), []);
    }
}
