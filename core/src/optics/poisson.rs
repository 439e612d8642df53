//! Poisson-disc samples of the unit disc: the sample points of vicinity occlusion.

use super::random::Random;

/// Maximum number of points of one set (that of Schott et al. 2012, section 3.1.5).
pub const MOST_POINTS: u32 = 118;
/// Candidate points per seed.
const DARTS: usize = 6000;
/// Seeds tried until a set has exactly the requested count; if none does, a larger set is truncated.
const SEEDS: u64 = 64;

/// `count` points of the unit disc (clamped to [`MOST_POINTS`]; none for 0, its centre for 1), the
/// same on every machine. No two are nearer than a minimum distance, chosen so that exactly `count`
/// points fit and no further one does (up to the density of the candidate points). In an order of which
/// every prefix covers the disc well: each next point is the one that minimises the mean squared
/// distance from positions in the disc to their nearest point. Takes some hundredths of a second: cache
/// the result.
pub fn poisson_disc(count: u32) -> Vec<[f64; 2]> {
    let count = count.min(MOST_POINTS) as usize;
    if count < 2 {
        return vec![[0.0; 2]; count];
    }
    let mut best = Vec::new();
    for seed in 0..SEEDS {
        let darts = darts(seed);
        // No two points of the disc are farther apart than 2.
        let (mut near, mut far) = (0.0, 2.0);
        for _ in 0..40 {
            let midpoint = 0.5 * (near + far);
            let set = accepted(&darts, midpoint, count + 1);
            if set.len() == count {
                return spread_first(set);
            }
            if set.len() > count {
                (near, best) = (midpoint, set);
            } else {
                far = midpoint;
            }
        }
    }
    // One point more than requested: never observed, but the count must be exact.
    let mut set = spread_first(best);
    set.truncate(count);
    set
}

/// Random points of the unit disc, uniform in area.
fn darts(seed: u64) -> Vec<[f64; 2]> {
    let mut random = Random::new(seed, 118);
    (0..DARTS)
        .map(|_| {
            let radius = random.unit().sqrt();
            let (sin, cos) = (std::f64::consts::TAU * random.unit()).sin_cos();
            [radius * cos, radius * sin]
        })
        .collect()
}

fn squared(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
}

/// Dart throwing: accepts darts in order, none nearer than `distance` to an accepted one, at most
/// `max_count`.
fn accepted(darts: &[[f64; 2]], distance: f64, max_count: usize) -> Vec<[f64; 2]> {
    let mut set: Vec<[f64; 2]> = Vec::new();
    for dart in darts {
        if set.iter().all(|p| squared(*p, *dart) >= distance * distance) {
            set.push(*dart);
            if set.len() == max_count {
                break;
            }
        }
    }
    set
}

/// Orders the points so that every prefix covers the disc well, greedily; see [`poisson_disc`].
fn spread_first(mut rest: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let probes: Vec<[f64; 2]> = darts(SEEDS).into_iter().take(1500).collect();
    let mut nearest = vec![f64::INFINITY; probes.len()];
    let mut out = Vec::with_capacity(rest.len());
    while !rest.is_empty() {
        let remaining = |p: &[f64; 2]| -> f64 {
            probes.iter().zip(&nearest).map(|(probe, old)| squared(*probe, *p).min(*old)).sum()
        };
        let sums: Vec<f64> = rest.iter().map(remaining).collect();
        let least = (0..sums.len()).min_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(0);
        let next = rest.swap_remove(least);
        for (probe, squared_distance) in probes.iter().zip(&mut nearest) {
            *squared_distance = squared_distance.min(squared(*probe, next));
        }
        out.push(next);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn least_distance(set: &[[f64; 2]]) -> f64 {
        let pairs = set.iter().enumerate().flat_map(|(i, a)| set[..i].iter().map(|b| squared(*a, *b)));
        pairs.fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Points of a fine grid, independent of those that the sets are made from.
    fn grid() -> Vec<[f64; 2]> {
        let at = |i: u32| f64::from(i) / 40.0 - 1.0;
        let all = (0..=80).flat_map(|y| (0..=80).map(move |x| [at(x), at(y)]));
        all.filter(|p| p[0].hypot(p[1]) <= 1.0).collect()
    }

    fn to_nearest(position: [f64; 2], set: &[[f64; 2]]) -> f64 {
        set.iter().map(|p| squared(*p, position)).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// As many as requested, in the disc, at a minimum distance, and with no room for one more. The distance
    /// itself is compared with the densest packing: a maximal set's is at least half of it.
    #[test]
    fn sets_are_complete_separated_and_maximal() {
        assert!(poisson_disc(0).is_empty());
        assert_eq!(poisson_disc(1), [[0.0; 2]]);
        let grid = grid();
        for count in [2, 3, 7, 16, 32, 64, 117, 118] {
            let set = poisson_disc(count);
            assert_eq!(set.len(), count as usize);
            assert!(set.iter().all(|p| p[0].hypot(p[1]) <= 1.0));
            let distance = least_distance(&set);
            let room = grid.iter().map(|p| to_nearest(*p, &set)).fold(0.0, f64::max);
            println!("{count}: distance {distance:.3}, covering radius {room:.3}");
            assert!(room <= distance + 0.06, "{count}: {room} {distance}");
            // Circles of half the distance about the points lie in a disc of 1 + distance/2 and cover
            // at most π/√12 of it; circles of the covering radius `room` cover the unit disc.
            let n = f64::from(count);
            assert!(n * (0.5 * distance).powi(2) <= 0.9069 * (1.0 + 0.5 * distance).powi(2));
            assert!(n * room * room >= 1.0);
        }
        assert_eq!(poisson_disc(5000).len(), 118);
        assert_eq!(poisson_disc(64), poisson_disc(64), "deterministic");
    }

    /// Uniform in area: as many points in the inner half and in each quarter as their areas imply; and so are
    /// prefixes.
    #[test]
    fn points_and_prefixes_are_uniform() {
        let set = poisson_disc(118);
        let grid = grid();
        for n in [12, 24, 48, 118] {
            let part = &set[..n];
            let share = |of: &dyn Fn(&[f64; 2]) -> bool| {
                part.iter().filter(|p| of(p)).count() as f64 / part.len() as f64
            };
            let inner = share(&|p| p[0].hypot(p[1]) < 0.5f64.sqrt());
            assert!((inner - 0.5).abs() < 0.12, "{n}: inner half {inner}");
            for (sx, sy) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let quarter = share(&|p| p[0] * sx > 0.0 && p[1] * sy > 0.0);
                assert!((quarter - 0.25).abs() < 0.1, "{n}: quarter {sx} {sy} {quarter}");
            }
            // The optimum, hexagons of equal area, has a mean squared distance of 0.1604 times the area of one.
            let mean = grid.iter().map(|p| to_nearest(*p, part).powi(2)).sum::<f64>() / grid.len() as f64;
            let best = 0.1604 * std::f64::consts::PI / n as f64;
            println!("{n}: {mean:.4} of {best:.4}");
            assert!(mean < 1.7 * best, "{n}: {mean} {best}");
        }
    }
}
