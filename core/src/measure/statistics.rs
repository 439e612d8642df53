//! Values of an image inside a mask.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use crate::{Cancelled, Grid, Mask, Progress, Volume, case::Case, histogram::Bins, resample};

/// Radius of a ball of 1 ml: within it the mean of a peak is taken (PERCIST, Wahl 2009).
const PEAK_RADIUS_MM: f64 = 6.203_504_908_994;

/// Values of an image at the voxels of its own grid whose centres lie in a mask.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Statistics {
    /// Id of the mask.
    pub mask: String,
    /// Id of the image.
    pub image: String,
    /// Finite values.
    pub voxels: u64,
    /// Values that are NaN or infinite, and don't count.
    pub not_finite: u64,
    /// Mean; `None` without a finite value, like all that follow.
    pub mean: Option<f64>,
    /// Standard deviation of the values (of a sample, n - 1); `None` of one value.
    pub sd: Option<f64>,
    /// Smallest value.
    pub min: Option<f64>,
    /// 5th percentile, linear between values.
    pub p05: Option<f64>,
    /// Median.
    pub p50: Option<f64>,
    /// 95th percentile.
    pub p95: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// The highest mean in a ball of 1 ml about a voxel of the mask; voxels of the ball outside the mask count, too (SUVpeak of SUV). `None` where no such
    /// ball lies inside the image.
    pub peak: Option<f64>,
    /// Mean times the volume of these voxels: total lesion glycolysis, where the values are SUV.
    pub mean_times_ml: Option<f64>,
    /// How often which values occur; `None` where all are the same.
    pub histogram: Option<ValueHistogram>,
}

/// Counts of values in bins of equal width: 1, 2 or 5 times a power of ten, of which zero is an edge.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ValueHistogram {
    /// Lower edge of the first bin; a bin includes its lower edge.
    pub first: f64,
    /// Width of a bin.
    pub bin: f64,
    /// Number of values per bin, from the first to the last non-empty one.
    pub counts: Vec<u64>,
}

impl ValueHistogram {
    /// Of values in ascending order.
    fn of(sorted: &[f64]) -> Option<Self> {
        let bins = Bins::of(sorted.iter().copied(), sorted.last()? - sorted.first()?)?;
        Some(Self { first: bins.first, bin: bins.width, counts: bins.counts })
    }
}

/// The statistics of every mask in every image of its date, date by date.
///
/// # Errors
/// [`Cancelled`].
pub fn statistics(case: &Case, progress: &Progress) -> Result<Vec<Vec<Statistics>>, Cancelled> {
    let of_date = |time: &crate::case::TimePoint| {
        let pairs = time.masks.iter().flat_map(|m| time.contexts.iter().map(move |c| (m, c)));
        pairs
            .map(|(m, c)| {
                progress.check()?;
                Ok(of(&m.mask, (&c.id, &c.volume)))
            })
            .collect::<Result<Vec<_>, Cancelled>>()
    };
    case.time_points.iter().map(of_date).collect()
}

/// The statistics of one mask in one image. A mask that covers no voxel centre of a coarser image has none.
pub fn of(mask: &Mask, (image, volume): (&str, &Volume)) -> Statistics {
    with_peak(&voxels_inside(mask, volume), mask.id(), (image, volume))
}

/// The statistics of an image in a circle, named `name`: of the voxels whose centres lie within the radius about the centre and within half a
/// slice of its plane, or of the one voxel that a smaller circle lies in. `normal`: unit vector across the plane. The ball of a peak
/// reaches beyond the slice.
pub fn in_circle(
    name: &str,
    (image, volume): (&str, &Volume),
    (center_mm, normal, radius_mm): (DVec3, DVec3, f64),
) -> Statistics {
    with_peak(&voxels_in_circle(volume.grid(), center_mm, normal, radius_mm), name, (image, volume))
}

/// The statistics of an image in a ball, named `name`: of the voxels whose centres lie within the radius about the centre.
pub fn in_ball(
    name: &str,
    (image, volume): (&str, &Volume),
    (center_mm, radius_mm): (DVec3, f64),
) -> Statistics {
    with_peak(&voxels_in_ball(volume.grid(), center_mm, radius_mm), name, (image, volume))
}

fn with_peak(inside: &[usize], name: &str, (image, volume): (&str, &Volume)) -> Statistics {
    Statistics { peak: peak(volume, inside), ..at(inside, name, (image, volume)) }
}

fn at(inside: &[usize], name: &str, (image, volume): (&str, &Volume)) -> Statistics {
    let (mut values, mut not_finite) = (Vec::with_capacity(inside.len()), 0);
    for &linear in inside {
        let value = volume.value(linear);
        if value.is_finite() { values.push(value) } else { not_finite += 1 }
    }
    values.sort_by(f64::total_cmp);
    let count = values.len();
    let mean = (count > 0).then(|| values.iter().sum::<f64>() / count as f64);
    let squares = |mean: f64| values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    let percentile = |share: f64| {
        let at = share * count.checked_sub(1)? as f64;
        let (low, high) = (values.get(at.floor() as usize)?, values.get(at.ceil() as usize)?);
        Some(low + (high - low) * at.fract())
    };
    let ml = volume.grid().volume_ml(count as u64);
    Statistics {
        mask: name.to_owned(),
        image: image.to_owned(),
        voxels: count as u64,
        not_finite,
        mean,
        sd: mean.filter(|_| count > 1).map(|mean| (squares(mean) / (count - 1) as f64).sqrt()),
        min: values.first().copied(),
        p05: percentile(0.05),
        p50: percentile(0.5),
        p95: percentile(0.95),
        max: values.last().copied(),
        peak: None,
        mean_times_ml: mean.map(|mean| mean * ml),
        histogram: ValueHistogram::of(&values),
    }
}

/// Voxels whose centres lie in a circle, as [`in_circle`] takes them.
fn voxels_in_circle(grid: &Grid, center_mm: DVec3, normal: DVec3, radius_mm: f64) -> Vec<usize> {
    let mm = grid.world_from_voxel().matrix3;
    // The distance of slices: of the axis that leads out of the plane the most.
    let half_mm = mm.transpose().mul_vec3(normal).abs().max_element() / 2.0;
    let inverse = mm.inverse();
    let center = grid.voxel_from_world().transform_point3(center_mm);
    let bounds = [0, 1, 2].map(|axis| {
        let row = inverse.row(axis);
        let out = row.dot(normal);
        let reach = radius_mm * (row.length_squared() - out * out).max(0.0).sqrt() + half_mm * out.abs();
        let last = grid.dims()[axis] as f64 - 1.0;
        let [low, high] = [center[axis] - reach, center[axis] + reach].map(|at| at.clamp(-1.0, last + 1.0));
        (low.ceil().max(0.0) as usize, high.floor().min(last) as i64)
    });
    let range = |axis: usize| bounds[axis].0..(bounds[axis].1 + 1).max(0) as usize;
    let mut found = Vec::new();
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let out = grid.center_of_voxel_mm([x, y, z]) - center_mm;
                let depth = out.dot(normal);
                // A plane halfway between two slices is of one of them.
                let is_in_slice = depth >= -half_mm && depth < half_mm;
                if is_in_slice && (out - normal * depth).length() <= radius_mm {
                    found.push(grid.linear([x, y, z]));
                }
            }
        }
    }
    if found.is_empty() {
        found.extend(grid.voxel_at(center_mm).map(|voxel| grid.linear(voxel)));
    }
    found
}

/// Voxels whose centres lie in a ball.
fn voxels_in_ball(grid: &Grid, center_mm: DVec3, radius_mm: f64) -> Vec<usize> {
    let inverse = grid.world_from_voxel().matrix3.inverse();
    let center = grid.voxel_from_world().transform_point3(center_mm);
    let range = |axis: usize| {
        let reach = inverse.row(axis).length() * radius_mm;
        let last = grid.dims()[axis] as f64 - 1.0;
        let [low, high] = [center[axis] - reach, center[axis] + reach].map(|at| at.clamp(-1.0, last + 1.0));
        low.ceil().max(0.0) as usize..(high.floor().min(last) + 1.0).max(0.0) as usize
    };
    let rows = range(2).flat_map(|z| range(1).map(move |y| [y, z]));
    let voxels = rows.flat_map(|[y, z]| range(0).map(move |x| [x, y, z]));
    let is_in = |voxel: &[usize; 3]| grid.center_of_voxel_mm(*voxel).distance(center_mm) <= radius_mm;
    voxels.filter(is_in).map(|voxel| grid.linear(voxel)).collect()
}

/// Voxels of an image whose centres lie in active voxels of a mask.
fn voxels_inside(mask: &Mask, volume: &Volume) -> Vec<usize> {
    let (own, grid) = (mask.grid(), volume.grid());
    let Some((start, dims)) = mask.bits().bounds() else { return Vec::new() };
    let (low, high) = resample::box_on(own, grid, start, dims);
    let last = DVec3::from_array(grid.dims().map(|n| n as f64 - 1.0));
    let (low, high) = ((low - 0.5).floor().max(DVec3::ZERO), (high + 0.5).ceil().min(last));
    if !(low.cmple(high)).all() {
        return Vec::new();
    }
    let [low, high] = [low, high].map(|v| v.to_array().map(|x| x as usize));
    let slices: Vec<Vec<usize>> = (low[2]..=high[2])
        .into_par_iter()
        .map(|z| {
            let rows = (low[1]..=high[1]).flat_map(|y| (low[0]..=high[0]).map(move |x| [x, y, z]));
            let is_in = |voxel: &[usize; 3]| {
                own.voxel_at(grid.center_of_voxel_mm(*voxel)).is_some_and(|at| mask.bits().get(at))
            };
            rows.filter(is_in).map(|voxel| grid.linear(voxel)).collect()
        })
        .collect();
    slices.concat()
}

fn peak(volume: &Volume, inside: &[usize]) -> Option<f64> {
    let grid = volume.grid();
    let mm = grid.world_from_voxel().matrix3;
    let dims = grid.dims().map(|n| n as i64);
    // How far the ball reaches along each axis of the grid: by the rows of the inverse, on oblique and sheared grids, too.
    let inverse = mm.inverse();
    let reach = [0, 1, 2].map(|axis| (inverse.row(axis).length() * PEAK_RADIUS_MM).floor() as i64);
    if reach.iter().zip(dims).any(|(reach, dim)| 2 * reach >= dim) {
        return None;
    }
    let ball: Vec<[i64; 3]> = (-reach[2]..=reach[2])
        .flat_map(|z| {
            (-reach[1]..=reach[1]).flat_map(move |y| (-reach[0]..=reach[0]).map(move |x| [x, y, z]))
        })
        .filter(|at| (mm * DVec3::from_array(at.map(|n| n as f64))).length() <= PEAK_RADIUS_MM)
        .collect();
    let mean = |linear: usize| {
        let at = grid.ijk(linear).map(|n| n as i64);
        let mut sum = 0.0;
        for step in &ball {
            let voxel = [0, 1, 2].map(|axis| at[axis] + step[axis]);
            if voxel.iter().zip(dims).any(|(n, dim)| !(0..dim).contains(n)) {
                return None;
            }
            sum += volume.value(grid.linear(voxel.map(|n| n as usize)));
        }
        Some(sum / ball.len() as f64).filter(|mean| mean.is_finite())
    };
    let means = inside.par_iter().filter_map(|&linear| mean(linear));
    means.reduce_with(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MaskBits, Samples, Scaling};

    fn mask(grid: &Grid, inside: impl Fn(DVec3) -> bool) -> Mask {
        let active = |linear: usize| inside(grid.center_of_voxel_mm(grid.ijk(linear)));
        Mask::new("m", grid.clone(), MaskBits::from_fn(grid.dims(), active)).unwrap()
    }

    fn image(grid: &Grid, value: impl Fn(DVec3) -> f32) -> Volume {
        let values = (0..grid.voxel_count()).map(|linear| value(grid.center_of_voxel_mm(grid.ijk(linear))));
        Volume::new(grid.clone(), Samples::F32(values.collect()), Scaling { slope: 2.0, intercept: 1.0 })
            .unwrap()
    }

    #[test]
    fn circles_have_the_voxels_of_their_slice() {
        // Against brute force over the whole grid, on an oblique and sheared one, too.
        let plain =
            Grid::axis_aligned([20, 24, 9], DVec3::new(0.8, 1.0, 3.0), DVec3::new(5.0, -3.0, 700.0)).unwrap();
        let turn = glam::DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).try_normalize().unwrap(), 0.4);
        let mut to_world = turn * plain.world_from_voxel();
        to_world.matrix3.x_axis += to_world.matrix3.y_axis * 0.2;
        let oblique = Grid::new([20, 24, 9], to_world, crate::Sides::Known).unwrap();
        for grid in [&plain, &oblique] {
            let columns = grid.world_from_voxel().matrix3;
            let across = columns.x_axis.cross(columns.y_axis).try_normalize().unwrap();
            let thickness = columns.z_axis.dot(across).abs();
            let center_mm = grid.center_of_voxel_mm([9, 11, 4]) + columns.x_axis * 0.3;
            for radius_mm in [0.01, 3.3, 7.0, 500.0] {
                let mut expected: Vec<usize> = (0..grid.voxel_count())
                    .filter(|linear| {
                        let voxel = grid.ijk(*linear);
                        let out = grid.center_of_voxel_mm(voxel) - center_mm;
                        voxel[2] == 4 && (out - across * out.dot(across)).length() <= radius_mm
                    })
                    .collect();
                if expected.is_empty() {
                    expected.push(grid.linear([9, 11, 4]));
                }
                // A little off the middle of the slice it is still that slice.
                for off in [0.0, 0.49, -0.49] {
                    let moved = center_mm + across * (off * thickness);
                    assert_eq!(
                        voxels_in_circle(grid, moved, across, radius_mm),
                        expected,
                        "{radius_mm} {off}"
                    );
                }
            }
        }
        for grid in [&plain, &oblique] {
            let center_mm = grid.center_of_voxel_mm([2, 20, 3]) + DVec3::splat(0.2);
            for radius_mm in [0.01, 4.4, 11.0, 500.0] {
                let expected: Vec<usize> = (0..grid.voxel_count())
                    .filter(|l| grid.center_of_voxel_mm(grid.ijk(*l)).distance(center_mm) <= radius_mm)
                    .collect();
                assert_eq!(voxels_in_ball(grid, center_mm, radius_mm), expected, "{radius_mm}");
            }
        }
        let image = image(&plain, |p| p.x as f32);
        let beyond = in_ball("lens", ("T1", &image), (DVec3::splat(-1e6), 5.0));
        assert_eq!((beyond.voxels, beyond.histogram), (0, None));
        let outside = in_circle("c", ("T1", &image), (DVec3::splat(1e6), DVec3::Z, 5.0));
        assert_eq!((outside.voxels, outside.mean), (0, None));
    }

    #[test]
    fn numbers_are_those_of_the_values_in_a_box() {
        let grid = Grid::axis_aligned([10, 4, 3], DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO).unwrap();
        // Stored 0 to 4 along x, so 1, 3, 5, 7, 9, in one row.
        let row = mask(&grid, |p| p.x < 4.5 && p.y < 1.0 && p.z < 1.0);
        let found = of(&row, ("T1", &image(&grid, |p| p.x as f32)));
        assert_eq!((found.voxels, found.mean, found.min, found.max), (5, Some(5.0), Some(1.0), Some(9.0)));
        assert_eq!((found.p50, found.p05, found.p95), (Some(5.0), Some(1.4), Some(8.6)));
        assert!((found.sd.unwrap() - 10_f64.sqrt()).abs() < 1e-12);
        assert!((found.mean_times_ml.unwrap() - 5.0 * 5.0 * 6e-3).abs() < 1e-12);
        assert_eq!(found.peak, None, "no ball of 1 ml in 4 by 3 voxels");
        // A fortieth of 8 is 0.2; the bins from 1 to 9.
        let histogram = found.histogram.unwrap();
        assert_eq!((histogram.first, histogram.bin, histogram.counts.len()), (1.0, 0.2, 41));
        assert_eq!([0, 10, 20, 30, 40].map(|at: usize| histogram.counts[at]), [1; 5]);
        let odd = of(&row, ("T1", &image(&grid, |p| if p.x < 0.5 { f32::NAN } else { p.x as f32 })));
        assert_eq!((odd.voxels, odd.not_finite, odd.min), (4, 1, Some(3.0)));
        let nothing = of(&mask(&grid, |_| false), ("T1", &image(&grid, |_| 1.0)));
        assert_eq!((nothing.voxels, nothing.mean, nothing.sd, nothing.max), (0, None, None, None));
    }

    #[test]
    fn an_image_on_another_grid_counts_its_own_voxels() {
        let fine = Grid::axis_aligned([40; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let coarse = Grid::axis_aligned([10; 3], DVec3::splat(4.0), DVec3::splat(1.5)).unwrap();
        let ball = mask(&fine, |p| p.distance(DVec3::splat(20.0)) < 9.0);
        let found = of(&ball, ("PET", &image(&coarse, |p| p.x as f32)));
        let expected = (0..coarse.voxel_count()).filter(|&linear| {
            let at = coarse.center_of_voxel_mm(coarse.ijk(linear));
            fine.voxel_at(at).is_some_and(|voxel| ball.bits().get(voxel))
        });
        assert_eq!(found.voxels, expected.count() as u64);
        assert!(found.voxels > 30);
    }

    #[test]
    fn the_peak_of_a_hot_ball_is_its_value_and_of_a_hot_voxel_its_share() {
        let grid = Grid::axis_aligned([41; 3], DVec3::ONE, DVec3::splat(-20.0)).unwrap();
        let all = mask(&grid, |p| p.length() < 14.0);
        let hot = image(&grid, |p| if p.length() < 10.0 { 3.5 } else { 0.0 });
        assert_eq!(of(&all, ("PET", &hot)).peak, Some(8.0));
        let one = of(&all, ("PET", &image(&grid, |p| if p == DVec3::ZERO { 500.0 } else { 0.0 })));
        let in_ball = (0..grid.voxel_count())
            .filter(|&linear| grid.center_of_voxel_mm(grid.ijk(linear)).length() <= PEAK_RADIUS_MM)
            .count() as f64;
        assert!((one.peak.unwrap() - (1.0 + 1000.0 / in_ball)).abs() < 1e-9);
        assert_eq!(one.max, Some(1001.0));
    }
}
