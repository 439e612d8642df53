//! A disc of points folded onto whole texels: the points' bilinear weights are those of every pixel, so
//! they are added up once a slice, and each texel is read once. The sum is the same, also at the
//! picture's edge, where the texels are those of the nearest pixels.
//!
//! A wide disc has too many texels for that. Where all its points weigh the same, as they do where nothing is, it
//! is read in two passes: along the rows, a sum for each length that a row has, and then across them.

use super::plan::disc_points;

/// How far a folded disc reaches at most, pixels.
pub(crate) const FARTHEST_PX: usize = 3;
/// For `reach` in the shaders: the points one by one.
pub(crate) const DIRECT: u32 = 4;
/// For `reach` in the shaders: along rows, then across them.
pub(crate) const ROWS: u32 = 5;
/// Vectors of four in the uniform.
pub(crate) const VECTORS: usize = 69;
/// Texels up to the farthest, without those that mirroring brings onto others.
const CLASSES: usize = (FARTHEST_PX + 1) * (FARTHEST_PX + 2) / 2;
/// Weights less than this are rounding.
const LEAST: f64 = 1e-9;

/// A folded disc as lib/dos.wgsl reads it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Folded {
    /// Pixels, 0 to [`FARTHEST_PX`].
    pub reach: u32,
    /// Rings of points at one distance, each with weights of its own.
    pub rings: u32,
    /// Of each ring its distance in millimetres and the weights of its texels; behind them one at distance 0
    /// with the weights of all.
    pub vectors: [[f32; 4]; VECTORS],
}

/// Where a texel (`x`, `y`) from the pixel stands among those that mirroring brings onto each other.
fn class_of(x: i64, y: i64) -> usize {
    let (a, b) = (x.unsigned_abs() as usize, y.unsigned_abs() as usize);
    let (most, least) = (a.max(b), a.min(b));
    most * (most + 1) / 2 + least
}

/// `None` where the points read one by one cost less: the disc reaches too far for its grid.
/// `exact` attenuates each point over its own distance (Algorithm 2), else all over the slice's.
pub(crate) fn fold(grid: u32, radius_px: f64, radius_mm: f64, slice_mm: f64, exact: bool) -> Option<Folded> {
    let points = disc_points(grid);
    let share = 1.0 / points.len() as f64;
    // Squared distances are whole in units of half a cell.
    let key = |p: &[f64; 2]| ((p[0] * p[0] + p[1] * p[1]) * f64::from(grid * grid)).round() as u32;
    let mut rings: Vec<(u32, [f64; CLASSES])> = Vec::new();
    for p in &points {
        let key = if exact { key(p) } else { 0 };
        let number = rings.iter().position(|(k, _)| *k == key).unwrap_or_else(|| {
            rings.push((key, [0.0; CLASSES]));
            rings.len() - 1
        });
        let (x, y) = (p[0] * radius_px, p[1] * radius_px);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        for (i, wx) in [(0, 1.0 - fx), (1, fx)] {
            for (j, wy) in [(0, 1.0 - fy), (1, fy)] {
                let weight = wx * wy * share;
                if weight > LEAST {
                    let class = class_of(x.floor() as i64 + i, y.floor() as i64 + j);
                    *rings.get_mut(number)?.1.get_mut(class)? += weight;
                }
            }
        }
    }
    let reach = (0..=FARTHEST_PX)
        .rev()
        .find(|a| (0..=*a).any(|b| rings.iter().any(|(_, w)| w[a * (a + 1) / 2 + b] > LEAST)))?;
    // A point one by one reads four texels, and each costs twice one of a folded disc (measured).
    if (2 * reach + 1).pow(2) > 2 * 4 * points.len() {
        return None;
    }
    let size = reach.max(1);
    let mut vectors = [[0.0; 4]; VECTORS];
    let mut all = [0.0; CLASSES];
    for (_, weights) in &rings {
        all.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight);
    }
    let distances: Vec<f64> = rings
        .iter()
        .map(|(key, _)| {
            let off_mm2 = f64::from(*key) / f64::from(grid * grid) * radius_mm * radius_mm;
            if exact { (slice_mm * slice_mm + off_mm2).sqrt() } else { slice_mm }
        })
        .chain([0.0])
        .collect();
    let weights = rings.iter().map(|(_, weights)| weights).chain([&all]);
    for (number, (distance_mm, weights)) in distances.iter().zip(weights).enumerate() {
        let mut flat = [0.0f32; 4 * FARTHEST_PX];
        flat[0] = *distance_mm as f32;
        for a in 0..=reach {
            for b in 0..=a {
                let class = a * (a + 1) / 2 + b;
                let texels = [4.0, 8.0][usize::from(b > 0 && b < a)];
                let texels = if a == 0 { 1.0 } else { texels };
                flat[1 + class] = (weights[class] / texels) as f32;
            }
        }
        for (i, vector) in flat.chunks_exact(4).take(size).enumerate() {
            vectors.get_mut(number * size + i)?.copy_from_slice(vector);
        }
    }
    Some(Folded { reach: reach as u32, rings: rings.len() as u32, vectors })
}

/// The distances of a disc's columns from its middle, outwards, which are those of its rows: whole pixels, the
/// rest up to one, how many of them a row at this distance has, and what a pair of points at it weighs.
/// Empty where rows gain nothing.
pub(crate) fn rows(grid: u32, radius_px: f64) -> Vec<[f32; 4]> {
    let halves = grid.div_ceil(2);
    let n = f64::from(grid);
    let away = |h: u32| f64::from(2 * h + 1 - grid % 2) / n;
    // Both passes read four texels a distance; see `fold` for what a point reads.
    if 8 * halves as usize >= 4 * disc_points(grid).len() {
        return Vec::new();
    }
    (0..halves)
        .map(|h| {
            let x = away(h) * radius_px;
            let length = (0..halves).filter(|i| away(*i).powi(2) + away(h).powi(2) <= 1.0).count();
            let pair = if away(h) > 0.0 { 1.0 } else { 0.5 };
            [x.floor() as f32, (x - x.floor()) as f32, length as f32, pair]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing is regular about it.
    fn field(x: i64, y: i64) -> f64 {
        ((x * 7919 + y * 104_729).rem_euclid(1009)) as f64 / 1009.0
    }

    /// The field read bilinearly.
    fn between(x: f64, y: f64) -> f64 {
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let (i, j) = (x.floor() as i64, y.floor() as i64);
        let line = |j| field(i, j) * (1.0 - fx) + field(i + 1, j) * fx;
        line(j) * (1.0 - fy) + line(j + 1) * fy
    }

    /// Along the rows and then across them, against the points read one by one on an irregular field.
    #[test]
    fn rows_hold_every_point_once() {
        for grid in 1..=13 {
            for radius_px in [2.0, 5.3, 7.0, 12.34] {
                let rows = rows(grid, radius_px);
                if rows.is_empty() {
                    assert!(grid <= 3, "{grid}");
                    continue;
                }
                let expected: f64 =
                    disc_points(grid).iter().map(|p| between(p[0] * radius_px, p[1] * radius_px)).sum();
                let pair = |row: &[f32; 4], at: &dyn Fn(i64) -> f64| {
                    let (o, f) = (row[0] as i64, f64::from(row[1]));
                    f64::from(row[3]) * ((1.0 - f) * (at(o) + at(-o)) + f * (at(o + 1) + at(-o - 1)))
                };
                let along = |length: usize, y: i64| -> f64 {
                    rows.iter().take(length).map(|row| pair(row, &|x| field(x, y))).sum()
                };
                let found: f64 = rows.iter().map(|row| pair(row, &|y| along(row[2] as usize, y))).sum();
                assert!((found - expected).abs() < 1e-5 * expected, "{grid} {radius_px}: {found} {expected}");
            }
        }
    }

    /// Against the points themselves, read bilinearly on a field that has nothing regular about it.
    #[test]
    fn a_folded_disc_is_the_sum_of_its_points() {
        let mut folds = [0; FARTHEST_PX + 1];
        for grid in 1..=13 {
            for radius_px in [0.0, 0.2, 0.5, 0.7, 1.0, 1.3, 1.5, 2.0, 2.4, 3.0, 3.2, 7.0] {
                for (exact, extinction) in [(false, 0.3), (true, 0.3), (true, 2.0)] {
                    let (d, radius_mm) = (0.7, 1.9);
                    let Some(f) = fold(grid, radius_px, radius_mm, d, exact) else {
                        assert!(radius_px > 2.0, "{grid} {radius_px}");
                        continue;
                    };
                    folds[f.reach as usize] += 1;
                    let points = disc_points(grid);
                    let mut expected = 0.0;
                    for p in &points {
                        let off2 = (p[0] * p[0] + p[1] * p[1]) * radius_mm * radius_mm;
                        let length = if exact { (d * d + off2).sqrt() } else { d };
                        expected +=
                            between(p[0] * radius_px, p[1] * radius_px) * (-extinction * length).exp();
                    }
                    expected /= points.len() as f64;
                    let reach = i64::from(f.reach);
                    let size = f.reach.max(1) as usize;
                    let mut found = 0.0;
                    let mut of_all = 0.0;
                    for ring in 0..=f.rings as usize {
                        let flat: Vec<f64> = f.vectors[ring * size..(ring + 1) * size]
                            .iter()
                            .flatten()
                            .map(|v| f64::from(*v))
                            .collect();
                        let mut light = 0.0;
                        for y in -reach..=reach {
                            for x in -reach..=reach {
                                light += flat[1 + class_of(x, y)] * field(x, y);
                            }
                        }
                        if ring == f.rings as usize {
                            of_all = light - of_all;
                        } else {
                            of_all += light;
                            found += light * (-extinction * flat[0]).exp();
                        }
                    }
                    assert!(of_all.abs() < 1e-6, "the last ring holds the weights of all: {of_all}");
                    assert!(
                        (found - expected).abs() < 1e-6,
                        "{grid} {radius_px} {exact}: {found} {expected}"
                    );
                }
            }
        }
        assert!(folds.iter().all(|n| *n > 3), "every reach was met: {folds:?}");
    }

    /// The most rings of the grids up to 13 fit.
    #[test]
    fn every_grid_fits() {
        let most = (1..=13).filter_map(|grid| fold(grid, 3.0, 1.0, 1.0, true)).map(|f| f.rings).max();
        assert_eq!(most, Some(22));
        assert_eq!(most.map(|n| (n as usize + 1) * FARTHEST_PX), Some(VECTORS));
    }
}
