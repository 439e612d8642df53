//! First-order methods: Khachiyan's, and with away steps Wolfe and Atwood's (Todd, Yıldırım 2007).

use super::state::{N, State, StopCriteria, dot, times};

/// Steps between two fresh factorisations.
const REFRESH: usize = 50;

/// Steps until a stop criterion is met. `None` when the weighted points become coplanar.
pub(super) fn run(state: &mut State, stop: &mut StopCriteria, away: bool) -> Option<()> {
    loop {
        let s = state.refresh()?;
        if s <= stop.squared_scale || stop.iterations_left == 0 {
            return Some(());
        }
        state.delete(s);
        // M is the identity in the frame of the last refresh.
        let mut inverse = [[0.0; 4]; 4];
        for (i, row) in inverse.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        for _ in 0..REFRESH {
            if stop.iterations_left == 0 || !step(state, &mut inverse, stop, away) {
                break;
            }
        }
    }
}

/// One step; `false` when none is needed.
fn step(state: &mut State, inverse: &mut [[f64; 4]; 4], stop: &mut StopCriteria, away: bool) -> bool {
    let points = &mut state.points;
    let (mut farthest, mut nearest) = (0, None::<usize>);
    for (i, p) in points.iter().enumerate() {
        if p.g > points[farthest].g {
            farthest = i;
        }
        if p.weight > 0.0 && nearest.is_none_or(|l| p.g < points[l].g) {
            nearest = Some(i);
        }
    }
    let over = points[farthest].g - N;
    if over <= (stop.squared_scale - 1.0) * 3.0 {
        return false;
    }
    stop.iterations_left -= 1;
    let chosen = match nearest {
        Some(l) if away && N - points[l].g > over => l,
        _ => farthest,
    };
    let g = points[chosen].g;
    let wanted = (g - N) / ((N - 1.0) * g);
    // At most all of the point's weight can be removed.
    let drop = wanted <= -points[chosen].weight;
    let step = if drop { -points[chosen].weight } else { wanted };
    let x = points[chosen].lifted();
    let w = times(inverse, &x);
    let part = step / (1.0 + step * g);
    for p in points.iter_mut() {
        let product = dot(&w, &p.lifted());
        p.g = (1.0 + step) * (p.g - part * product * product);
        p.weight /= 1.0 + step;
    }
    points[chosen].weight = if drop { 0.0 } else { points[chosen].weight + step / (1.0 + step) };
    for r in 0..4 {
        for c in 0..4 {
            inverse[r][c] = (1.0 + step) * (inverse[r][c] - part * w[r] * w[c]);
        }
    }
    true
}
