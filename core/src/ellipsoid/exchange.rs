//! REX: exchange of weight between pairs of points (Harman, Filová, Richtárik 2020), here in a fixed
//! order instead of a random one, so that results are reproducible.

use super::{
    newton,
    state::{Matrix, N, State, StopCriteria, dot, times},
};

/// Points with the largest g that may gain weight in one sweep: 4 n.
const LEADING: usize = 16;

/// Sweeps between two Newton steps.
const NEWTON_EVERY: usize = 10;

const IDENTITY: Matrix =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Sweeps until a stop criterion is met. `None` when the weighted points become coplanar, which exact
/// arithmetic rules out.
pub(super) fn run(state: &mut State, stop: &mut StopCriteria) -> Option<()> {
    let (mut seed, mut sweeps) = (1, 0);
    loop {
        let s = state.refresh()?;
        if s <= stop.squared_scale || stop.iterations_left == 0 {
            return Some(());
        }
        stop.iterations_left -= 1;
        state.delete(s);
        sweep(state, &mut seed);
        sweeps += 1;
        // Where neighbouring points share weight, pairwise exchange zigzags for thousands of sweeps.
        if sweeps % NEWTON_EVERY == 0 {
            newton::step(state)?;
        }
    }
}

/// Exchanges between every leading point and every point that carries weight.
fn sweep(state: &mut State, seed: &mut u64) {
    let points = &mut state.points;
    let mut leading: Vec<usize> = Vec::with_capacity(LEADING + 1);
    for i in 0..points.len() {
        let full = leading.len() == LEADING;
        if full && leading.last().is_some_and(|&last| points[last].g >= points[i].g) {
            continue;
        }
        let rank = leading.partition_point(|&j| points[j].g >= points[i].g);
        leading.insert(rank, i);
        leading.truncate(LEADING);
    }
    let mut support: Vec<usize> = (0..points.len()).filter(|&i| points[i].weight > 0.0).collect();
    shuffle(&mut leading, seed);
    shuffle(&mut support, seed);

    let mut inverse = IDENTITY;
    for &j in &leading {
        let x = points[j].lifted();
        let mut a = times(&inverse, &x);
        for &k in &support {
            if j == k || points[k].weight <= 0.0 && points[j].weight <= 0.0 {
                continue;
            }
            let y = points[k].lifted();
            let b = times(&inverse, &y);
            let (gj, gk, gjk) = (dot(&x, &a), dot(&y, &b), dot(&x, &b));
            let curvature = gj * gk - gjk * gjk;
            // Equal or nearly equal points: nothing to gain.
            if curvature <= 1e-14 * gj * gk {
                continue;
            }
            let best = (gj - gk) / (2.0 * curvature);
            let moved = best.clamp(-points[j].weight, points[k].weight);
            if moved == 0.0 {
                continue;
            }
            let growth = (1.0 + moved * gj) * (1.0 - moved * gk) + moved * moved * gjk * gjk;
            if growth <= 0.5 / N {
                continue;
            }
            // Exact zero where all weight is moved: the point leaves the support.
            points[j].weight = if moved == -points[j].weight { 0.0 } else { points[j].weight + moved };
            points[k].weight = if moved == points[k].weight { 0.0 } else { points[k].weight - moved };
            let square = moved * moved;
            let (aa, ab, bb) =
                ((square * gk - moved) / growth, -square * gjk / growth, (square * gj + moved) / growth);
            for r in 0..4 {
                for c in 0..4 {
                    inverse[r][c] += aa * a[r] * a[c] + ab * (a[r] * b[c] + b[r] * a[c]) + bb * b[r] * b[c];
                }
            }
            a = times(&inverse, &x);
        }
    }
}

/// Shuffles `list` into an order determined by `seed` alone (Fisher, Yates).
fn shuffle(list: &mut [usize], seed: &mut u64) {
    for i in (1..list.len()).rev() {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        list.swap(i, (*seed >> 33) as usize % (i + 1));
    }
}
