//! Nearest points of a segment and a box.

use glam::{DMat4, DVec3, DVec4};

use super::{CellBox, Metric, Nearest};

/// Nearest points of the segment from `a` to `b` and `cells`, all in voxel indices.
pub(super) fn to_box(a: DVec3, b: DVec3, cells: &CellBox, metric: &Metric) -> Nearest {
    if metric.perpendicular { along_axes(a, b, cells, metric) } else { any_axes(a, b, cells, metric) }
}

/// On perpendicular axes the squared distance is, along the segment, a sum over the axes of squares of
/// piecewise linear functions: convex, and a parabola between the at most six points where the
/// segment crosses a face's plane. The minimum is where the slope changes sign.
pub(super) fn along_axes(a: DVec3, b: DVec3, cells: &CellBox, metric: &Metric) -> Nearest {
    let mm = DVec3::new(metric.mm.x_axis.x, metric.mm.y_axis.y, metric.mm.z_axis.z);
    let d = b - a;
    let gap = |t: f64| {
        let p = a + d * t;
        (p - p.clamp(cells.lo, cells.hi)) * mm
    };
    let result = |t: f64| {
        let p = a + d * t;
        Nearest { squared_mm2: gap(t).length_squared(), along: t, voxel: p.clamp(cells.lo, cells.hi) }
    };
    let slope = |t: f64| gap(t).dot(d * mm);
    if d == DVec3::ZERO || slope(0.0) >= 0.0 {
        return result(0.0);
    }
    if slope(1.0) <= 0.0 {
        return result(1.0);
    }
    // The slope is continuous, non-decreasing, and linear between crossings: bracket, then solve.
    let (mut low, mut high) = ((0.0, slope(0.0)), (1.0, slope(1.0)));
    for axis in 0..3 {
        for face in [cells.lo[axis], cells.hi[axis]] {
            let t = (face - a[axis]) / d[axis];
            if t > low.0 && t < high.0 {
                let s = slope(t);
                if s == 0.0 {
                    return result(t);
                }
                if s < 0.0 {
                    low = (t, s);
                } else {
                    high = (t, s);
                }
            }
        }
    }
    let t = low.0 + (high.0 - low.0) * (low.1 / (low.1 - high.1));
    [t, low.0, high.0]
        .map(result)
        .into_iter()
        .fold(result(t), |best, r| if r.squared_mm2 < best.squared_mm2 { r } else { best })
}

/// On any axes: the minimum of a convex quadratic in four variables (along the segment and the
/// box's three), each between two bounds. There the gradient in some of the variables vanishes and
/// the others are at a bound: all 81 combinations are tried.
pub(super) fn any_axes(a: DVec3, b: DVec3, cells: &CellBox, metric: &Metric) -> Nearest {
    let size = cells.hi - cells.lo;
    // Difference in millimetres: base + columns · (t, u, v, w), all 0 to 1.
    let base = metric.mm * (a - cells.lo);
    let columns = [
        metric.mm * (b - a),
        metric.mm.x_axis * -size.x,
        metric.mm.y_axis * -size.y,
        metric.mm.z_axis * -size.z,
    ];
    let value = |x: [f64; 4]| (0..4).fold(base, |sum, k| sum + columns[k] * x[k]).length_squared();
    let mut best = ([0.0; 4], value([0.0; 4]));
    for combination in 0..81_usize {
        // 0: at 0; 1: at 1; 2: free.
        let state: [usize; 4] = [combination % 3, combination / 3 % 3, combination / 9 % 3, combination / 27];
        let fixed = (0..4).fold(base, |sum, k| if state[k] == 1 { sum + columns[k] } else { sum });
        // Normal equations of the free variables, identity rows for the others.
        let (mut rows, mut rhs) = ([[0.0; 4]; 4], [0.0; 4]);
        for i in 0..4 {
            if state[i] < 2 {
                rows[i][i] = 1.0;
                rhs[i] = state[i] as f64;
                continue;
            }
            rhs[i] = -columns[i].dot(fixed);
            for j in (0..4).filter(|&j| state[j] == 2) {
                rows[i][j] = columns[i].dot(columns[j]);
            }
        }
        let matrix = DMat4::from_cols_array_2d(&rows);
        // A singular combination has its minimum on one of its bounds too.
        if matrix.determinant().abs() <= 0.0 {
            continue;
        }
        let x = (matrix.transpose().inverse() * DVec4::from_array(rhs)).to_array();
        if x.iter().all(|v| (-1e-12..=1.0 + 1e-12).contains(v)) {
            let x = x.map(|v| v.clamp(0.0, 1.0));
            let v = value(x);
            if v < best.1 {
                best = (x, v);
            }
        }
    }
    let ([t, u, v, w], squared_mm2) = best;
    // Points that agree up to rounding coincide: a fibre inside a cell is at distance 0.
    let scale = columns.iter().fold(base.length_squared(), |s, c| s + c.length_squared());
    let squared_mm2 = if squared_mm2 <= 1e-26 * scale { 0.0 } else { squared_mm2 };
    Nearest { squared_mm2, along: t, voxel: cells.lo + size * DVec3::new(u, v, w) }
}
