//! Geometry of the tumour overlap diagram (thesis 7.5), independent of drawing.
//!
//! Every voxel of every mask has the same painted area `k`. The ring segment of a region with `n` voxels has one layer
//! per mask of the region, each of area `k n`. A layer has the same radii all around the ring, so the opening angle is
//! proportional to `n` too. The region of all three masks is a circle of area `3 k n` with three equal sectors. The
//! lines between segments lie in gaps and cover no fill: all gaps have the same angle, and the fills share the rest of
//! the full circle.
//!
//! Angles run clockwise from twelve o'clock, in radians. Lengths are points.

use std::f64::consts::{PI, TAU};

use super::Target;

/// Width of a gap, in points: between layers, and between segments where the ring is narrowest.
pub const GAP_PT: f64 = 3.4;
/// Radius of the hole in the ring, as a share of the diagram's radius.
const HOLE_SHARE: f64 = 0.36;
/// Largest sum of all gap angles, radians.
const MAX_GAPS_RAD: f64 = 0.8;

/// A region or mask to be laid out as a ring segment or as the circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// The region or mask that it represents.
    pub target: Target,
    /// Its masks, one per layer, innermost first. A piece of three or more masks is the circle.
    pub masks: Vec<usize>,
    /// Its number of voxels. Pieces without voxels are left out.
    pub voxels: u64,
}

/// One ring segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The piece, with its layers.
    pub piece: Piece,
    /// Start angle of the fill.
    pub from_rad: f64,
    /// End angle of the fill, clockwise from `from_rad`.
    pub to_rad: f64,
}

/// The circle in the middle: one sector for each mask, all equal.
#[derive(Clone, Debug, PartialEq)]
pub struct Disc {
    /// The piece.
    pub piece: Piece,
    /// Its radius.
    pub radius: f64,
}

/// Layout of the ring and circle around the centre (0, 0).
#[derive(Clone, Debug, PartialEq)]
pub struct RingLayout {
    /// Painted area per voxel of one mask, square points.
    pub area_per_voxel: f64,
    /// Ring segments, clockwise from twelve o'clock.
    pub segments: Vec<Segment>,
    /// The circle; `None` where no voxel is in all three masks.
    pub disc: Option<Disc>,
    /// Gap angle between two segments; 0 with fewer than two.
    pub gap_rad: f64,
    /// Inner and outer radius of each layer, inner layer first: 1 or 2 entries; empty without segments.
    pub layers: Vec<(f64, f64)>,
}

/// Radii at a given `k`.
struct Radii {
    disc: f64,
    gap_rad: f64,
    layers: Vec<(f64, f64)>,
}

impl Radii {
    fn outer(&self) -> f64 {
        self.layers.last().map_or(self.disc, |l| l.1)
    }
}

fn radii(
    k: f64,
    radius: f64,
    ring_voxels: f64,
    segments: usize,
    depth: usize,
    disc: Option<&Piece>,
) -> Radii {
    let disc = disc.map_or(0.0, |d| (d.masks.len() as f64 * k * d.voxels as f64 / PI).sqrt());
    if segments == 0 {
        return Radii { disc, gap_rad: 0.0, layers: Vec::new() };
    }
    let hole = (HOLE_SHARE * radius).max(if disc > 0.0 { disc + 2.0 * GAP_PT } else { 0.0 });
    let gap_rad = if segments > 1 { (GAP_PT / hole).min(MAX_GAPS_RAD / segments as f64) } else { 0.0 };
    let layer = 2.0 * k * ring_voxels / (TAU - gap_rad * segments as f64);
    let mut from = hole;
    let layers = (0..depth)
        .map(|_| {
            let to = (from * from + layer).sqrt();
            let out = (from, to);
            from = to + GAP_PT;
            out
        })
        .collect();
    Radii { disc, gap_rad, layers }
}

impl RingLayout {
    /// Lays `pieces` out clockwise in their order, as large as fits into `radius` points. The circle is the piece of
    /// three or more masks; of several, the last. Without voxels, or with a radius of 0 or less: no segments, no disc
    /// and an `area_per_voxel` of 0.
    pub fn new(pieces: &[Piece], radius: f64) -> Self {
        let (discs, ring): (Vec<&Piece>, Vec<&Piece>) =
            pieces.iter().filter(|p| p.voxels > 0 && !p.masks.is_empty()).partition(|p| p.masks.len() > 2);
        let disc = discs.last().copied();
        let ring_voxels = ring.iter().map(|p| p.voxels).sum::<u64>() as f64;
        let depth = ring.iter().map(|p| p.masks.len()).max().unwrap_or(0);
        let painted: f64 =
            ring.iter().copied().chain(disc).map(|p| p.voxels as f64 * p.masks.len() as f64).sum();
        if painted == 0.0 || radius <= 0.0 {
            return Self {
                area_per_voxel: 0.0,
                segments: Vec::new(),
                disc: None,
                gap_rad: 0.0,
                layers: Vec::new(),
            };
        }
        // The outer radius increases with k, and the total area bounds k: bisect.
        let (mut lo, mut hi) = (0.0, PI * radius * radius / painted);
        for _ in 0..100 {
            let k = 0.5 * (lo + hi);
            if radii(k, radius, ring_voxels, ring.len(), depth, disc).outer() > radius {
                hi = k;
            } else {
                lo = k;
            }
        }
        let r = radii(lo, radius, ring_voxels, ring.len(), depth, disc);
        let filled_rad = TAU - r.gap_rad * ring.len() as f64;
        let mut from = r.gap_rad / 2.0;
        let segments = ring
            .into_iter()
            .map(|p| {
                let to = from + filled_rad * p.voxels as f64 / ring_voxels;
                let segment = Segment { piece: p.clone(), from_rad: from, to_rad: to };
                from = to + r.gap_rad;
                segment
            })
            .collect();
        let disc = disc.map(|p| Disc { piece: p.clone(), radius: r.disc });
        Self { area_per_voxel: lo, segments, disc, gap_rad: r.gap_rad, layers: r.layers }
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty() && self.disc.is_none()
    }

    /// Outer radius of a segment, points.
    pub fn outer_radius(&self, segment: &Segment) -> f64 {
        self.layers.get(segment.piece.masks.len() - 1).map_or(0.0, |l| l.1)
    }

    /// The piece at `x` points right and `y` points *down* of the centre. Half of each gap belongs to the adjacent
    /// segment, so that thin segments are easier to hit.
    pub fn hit(&self, x: f64, y: f64) -> Option<Target> {
        let r = x.hypot(y);
        if let Some(disc) = &self.disc
            && r <= disc.radius + GAP_PT
        {
            return Some(disc.piece.target);
        }
        let angle = x.atan2(-y).rem_euclid(TAU);
        let inner = self.layers.first()?.0;
        self.segments
            .iter()
            .find(|s| angle <= s.to_rad + self.gap_rad / 2.0)
            .filter(|s| r >= inner - GAP_PT && r <= self.outer_radius(s) + GAP_PT)
            .map(|s| s.piece.target)
    }
}

/// The point at an angle and a radius: [right, down] of the centre.
pub fn point(angle_rad: f64, radius: f64) -> [f64; 2] {
    [radius * angle_rad.sin(), -radius * angle_rad.cos()]
}

/// Number of equal steps of an arc's polygon with an error of at most 0.02 points, 1 to 512.
pub fn arc_steps(from_rad: f64, to_rad: f64, radius: f64) -> usize {
    let step = (8.0 * 0.02 / radius.max(1.0)).sqrt();
    (((to_rad - from_rad) / step).ceil() as usize).clamp(1, 512)
}

/// Regions of up to three masks in the ring's order A, AB, B, BC, C, CA, then ABC, so that the pieces of one mask are
/// adjacent. A pair's inner layer is the mask of the preceding segment; where a segment is missing, layers are swapped
/// if that makes more pieces of one mask adjacent.
///
/// `voxels(bits)` is the size of the region with these bits; regions of size 0 are left out.
pub fn pieces_of_regions(masks: usize, voxels: impl Fn(u32) -> u64) -> Vec<Piece> {
    const ORDER: [&[usize]; 7] = [&[0], &[0, 1], &[1], &[1, 2], &[2], &[2, 0], &[0, 1, 2]];
    let pieces: Vec<Piece> = ORDER
        .iter()
        .filter(|m| m.iter().all(|&k| k < masks))
        .map(|m| {
            let bits = m.iter().fold(0, |b, &k| b | 1 << k);
            Piece { target: Target::Region(bits), masks: m.to_vec(), voxels: voxels(bits) }
        })
        .filter(|p| p.voxels > 0)
        .collect();
    let pairs: Vec<usize> = (0..pieces.len()).filter(|&i| pieces[i].masks.len() == 2).collect();
    let swapped = |swaps: usize| {
        let mut out = pieces.clone();
        for (bit, &i) in pairs.iter().enumerate() {
            if swaps >> bit & 1 == 1 {
                out[i].masks.reverse();
            }
        }
        out
    };
    // A later candidate replaces the best one only if it scores higher, so that layers aren't swapped needlessly.
    let mut best = (swapped(0), adjacent_layers(&swapped(0)));
    for swaps in 1..1 << pairs.len() {
        let candidate = swapped(swaps);
        let score = adjacent_layers(&candidate);
        if score > best.1 {
            best = (candidate, score);
        }
    }
    best.0
}

/// Number of layers that continue with the same mask in the next segment, once around the ring.
fn adjacent_layers(pieces: &[Piece]) -> usize {
    let ring: Vec<&Piece> = pieces.iter().filter(|p| p.masks.len() <= 2).collect();
    if ring.len() < 2 {
        return 0;
    }
    (0..ring.len())
        .map(|i| ring[i].masks.iter().zip(&ring[(i + 1) % ring.len()].masks).filter(|(a, b)| a == b).count())
        .sum()
}

/// One piece per mask with voxels, of the whole mask's size: the diagram without overlaps.
pub fn pieces_of_masks(masks: usize, voxels: impl Fn(usize) -> u64) -> Vec<Piece> {
    (0..masks)
        .map(|k| Piece { target: Target::Mask(k), masks: vec![k], voxels: voxels(k) })
        .filter(|p| p.voxels > 0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area of a polygon by the shoelace formula.
    fn shoelace(points: &[[f64; 2]]) -> f64 {
        let n = points.len();
        let twice: f64 = (0..n)
            .map(|i| {
                let ([x0, y0], [x1, y1]) = (points[i], points[(i + 1) % n]);
                x0 * y1 - x1 * y0
            })
            .sum();
        twice.abs() / 2.0
    }

    fn outline(from: f64, to: f64, inner: f64, outer: f64) -> Vec<[f64; 2]> {
        let at = |i: usize, r: f64| point(from + (to - from) * i as f64 / 4000.0, r);
        (0..=4000).map(|i| at(i, outer)).chain((0..=4000).rev().map(|i| at(i, inner))).collect()
    }

    fn layout(counts: [u64; 7], radius: f64) -> RingLayout {
        RingLayout::new(&pieces_of_regions(3, |bits| counts[bits as usize - 1]), radius)
    }

    /// Painted area of each mask, from the outlines.
    fn painted(l: &RingLayout) -> [f64; 3] {
        let mut areas = [0.0; 3];
        for s in &l.segments {
            for (&mask, &(inner, outer)) in s.piece.masks.iter().zip(&l.layers) {
                areas[mask] += shoelace(&outline(s.from_rad, s.to_rad, inner, outer));
            }
        }
        if let Some(d) = &l.disc {
            for &mask in &d.piece.masks {
                areas[mask] += shoelace(&outline(0.0, TAU, 0.0, d.radius)) / 3.0;
            }
        }
        areas
    }

    fn mask_voxels(counts: [u64; 7]) -> [f64; 3] {
        std::array::from_fn(|k| {
            (1..8).filter(|bits| bits >> k & 1 == 1).map(|bits: usize| counts[bits - 1]).sum::<u64>() as f64
        })
    }

    const CASES: [[u64; 7]; 9] = [
        // a, b, ab, c, ac, bc, abc
        [1200, 5300, 800, 300, 150, 420, 900],
        [1, 1, 1, 1, 1, 1, 1],
        [0, 0, 0, 0, 0, 0, 17],
        [10_000_000, 3, 0, 5, 0, 0, 1],
        [5, 0, 0, 0, 0, 0, 0],
        [0, 0, 7, 0, 9, 11, 0],
        [100, 200, 50, 0, 0, 0, 0],
        [1, 0, 0, 0, 0, 0, 1_000_000],
        [0, 0, 40, 0, 0, 0, 0],
    ];

    #[test]
    fn painted_area_is_proportional_to_mask_size() {
        for counts in CASES {
            for radius in [40.0, 170.0] {
                let l = layout(counts, radius);
                for (area, voxels) in painted(&l).into_iter().zip(mask_voxels(counts)) {
                    let expected = l.area_per_voxel * voxels;
                    let tolerance = 1e-5 * expected.max(1e-9);
                    assert!((area - expected).abs() <= tolerance, "{counts:?}: {area}, expected {expected}");
                }
            }
        }
    }

    #[test]
    fn the_layout_fills_the_radius_exactly() {
        for counts in CASES {
            let l = layout(counts, 120.0);
            let outer = l
                .layers
                .last()
                .map(|x| x.1)
                .into_iter()
                .chain(l.disc.iter().map(|d| d.radius))
                .fold(0.0, f64::max);
            assert!((outer - 120.0).abs() < 1e-6, "{counts:?}: {outer}");
            if let (Some(d), Some(first)) = (&l.disc, l.layers.first()) {
                assert!(d.radius + 2.0 * GAP_PT <= first.0 + 1e-9);
            }
        }
    }

    #[test]
    fn angles_are_proportional_and_fill_the_circle() {
        for counts in CASES {
            let l = layout(counts, 120.0);
            let ring: u64 = l.segments.iter().map(|s| s.piece.voxels).sum();
            let filled_rad: f64 = l.segments.iter().map(|s| s.to_rad - s.from_rad).sum();
            if !l.segments.is_empty() {
                assert!((filled_rad + l.gap_rad * l.segments.len() as f64 - TAU).abs() < 1e-9);
            }
            for s in &l.segments {
                let expected = filled_rad * s.piece.voxels as f64 / ring as f64;
                assert!((s.to_rad - s.from_rad - expected).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn no_voxels_or_no_radius_give_an_empty_layout() {
        assert!(layout([0; 7], 100.0).is_empty());
        assert!(RingLayout::new(&[], 100.0).is_empty());
        assert!(layout([1; 7], 0.0).is_empty());
        assert_eq!(layout([0; 7], 100.0).hit(1.0, 1.0), None);
    }

    #[test]
    fn pieces_of_one_mask_are_adjacent() {
        let all = pieces_of_regions(3, |_| 1);
        let names: Vec<&[usize]> = all.iter().map(|p| p.masks.as_slice()).collect();
        assert_eq!(names, [&[0][..], &[0, 1], &[1], &[1, 2], &[2], &[2, 0], &[0, 1, 2]]);
        assert_eq!(adjacent_layers(&all), 3);
        // Without A and AB, CA is next to B. C precedes CA, so C stays its inner layer.
        let some = pieces_of_regions(3, |bits| u64::from(bits != 0b011 && bits != 0b001));
        assert_eq!(some.iter().find(|p| p.masks.len() == 2 && p.masks.contains(&0)).unwrap().masks, [2, 0]);
        // With only BC and C, C must be BC's inner layer.
        let c_and_bc = pieces_of_regions(3, |bits| u64::from(bits == 0b100 || bits == 0b110));
        assert_eq!(adjacent_layers(&c_and_bc), 2);
        assert_eq!(pieces_of_regions(2, |_| 1).len(), 3);
        assert_eq!(pieces_of_regions(1, |_| 1).len(), 1);
        assert_eq!(pieces_of_regions(0, |_| 1).len(), 0);
    }

    #[test]
    fn hits_match_the_drawn_segments() {
        let l = layout(CASES[0], 150.0);
        for s in &l.segments {
            for &(inner, outer) in &l.layers[..s.piece.masks.len()] {
                for (t, u) in [(0.01, 0.01), (0.5, 0.5), (0.99, 0.99)] {
                    let [x, y] = point(s.from_rad + t * (s.to_rad - s.from_rad), inner + u * (outer - inner));
                    assert_eq!(l.hit(x, y), Some(s.piece.target));
                }
            }
            let [x, y] = point((s.from_rad + s.to_rad) / 2.0, l.outer_radius(s) + GAP_PT + 0.5);
            assert_eq!(l.hit(x, y), None);
        }
        assert_eq!(l.hit(0.0, 0.0), Some(Target::Region(7)));
        assert_eq!(l.hit(200.0, 0.0), None);
    }

    #[test]
    fn arc_polygons_are_within_0_02_points() {
        for radius in [5.0, 100.0, 400.0_f64] {
            let steps = arc_steps(0.0, 1.0, radius) as f64;
            assert!(radius * (1.0 - (0.5 / steps).cos()) <= 0.0201);
        }
    }
}
