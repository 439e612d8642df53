//! First-order steps: Khachiyan's, and with away steps those of Wolfe and Atwood (Todd, Yıldırım 2007).

use super::{
    exchange::{dot, times},
    solve::{Allowance, N, State},
};

/// Steps between two fresh factorisations.
const REFRESH: usize = 50;

/// Steps until the allowance is reached. `None` when the weights lose a dimension.
pub(super) fn run(state: &mut State, allowed: &mut Allowance, away: bool) -> Option<()> {
    loop {
        let s = state.refresh()?;
        if s <= allowed.target || allowed.left == 0 {
            return Some(());
        }
        state.delete(s);
        // M is the identity in the frame that was just made.
        let mut inverse = [[0.0; 4]; 4];
        for (i, row) in inverse.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        for _ in 0..REFRESH {
            if allowed.left == 0 || !step(state, &mut inverse, allowed, away) {
                break;
            }
        }
    }
}

/// One step; `false` when none is needed.
fn step(state: &mut State, inverse: &mut [[f64; 4]; 4], allowed: &mut Allowance, away: bool) -> bool {
    let points = &mut state.points;
    let (mut most, mut least) = (0, None::<usize>);
    for (i, p) in points.iter().enumerate() {
        if p.g > points[most].g {
            most = i;
        }
        if p.weight > 0.0 && least.is_none_or(|l| p.g < points[l].g) {
            least = Some(i);
        }
    }
    let over = points[most].g - N;
    if over <= (allowed.target - 1.0) * 3.0 {
        return false;
    }
    allowed.left -= 1;
    let at = match least {
        Some(l) if away && N - points[l].g > over => l,
        _ => most,
    };
    let g = points[at].g;
    let wanted = (g - N) / ((N - 1.0) * g);
    // All its weight, where more would be taken.
    let drop = wanted <= -points[at].weight;
    let step = if drop { -points[at].weight } else { wanted };
    let x = points[at].lifted();
    let w = times(inverse, &x);
    let part = step / (1.0 + step * g);
    for p in points.iter_mut() {
        let product = dot(&w, &p.lifted());
        p.g = (1.0 + step) * (p.g - part * product * product);
        p.weight /= 1.0 + step;
    }
    points[at].weight = if drop { 0.0 } else { points[at].weight + step / (1.0 + step) };
    for r in 0..4 {
        for c in 0..4 {
            inverse[r][c] = (1.0 + step) * (inverse[r][c] - part * w[r] * w[c]);
        }
    }
    true
}
