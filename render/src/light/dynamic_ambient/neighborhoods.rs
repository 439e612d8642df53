//! What surrounds each cell of an image: how long a straight way from it is in each kind of tissue, in the mean over all directions,
//! condensed into clusters (Ropinski et al. 2008). No transfer function is known here. Pure: no device is touched.

use glam::DVec3;
use glioscope_core::{Grid, grid::ijk, optics::random::Random};
use rayon::prelude::*;

use crate::{
    image::{
        ClipPlane,
        volume::{Field, NOT_FINITE},
    },
    light::{cones::grid::Cells, harmonics::basis::spread},
};

/// Kinds of tissue: by stored value, and by gradient magnitude (usual widths of values per mm) from these edges on.
const VALUES: usize = 64;
const STEEPER: [f64; 3] = [0.01, 0.04, 0.12];
/// Kinds of values beyond the usual ones, on a side that has any: one outlier must not leave all tissue to a single kind.
const UNUSUAL: usize = 8;
pub(crate) const BINS: usize = VALUES * (STEEPER.len() + 1);
/// Of voxels whose value or gradient isn't known.
const NO_BIN: u16 = u16::MAX;
/// Directions in which a cell looks, and most samples in each.
pub(crate) const DIRECTIONS: u32 = 48;
const MOST_SAMPLES: f64 = 32.0;
/// Cells that clusters are found from; all are assigned to them.
const LEARNT_FROM: usize = 4096;
/// Rounds of refinement (Lloyd 1982).
const ROUNDS: usize = 8;
const SEED: u64 = 1;

/// Millimetres in bins, by rising bin, none of them 0.
pub(crate) type Histogram = Vec<(u16, f32)>;

/// Mean stored value and gradient magnitude (stored values per mm) of a bin's voxels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Bin {
    pub value: f64,
    pub steepness: f64,
}

/// How a kind of tissue looks.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Look {
    /// Per millimetre, at least 0.
    pub extinction: f64,
    /// In linear light.
    pub color: DVec3,
}

/// The surroundings of an image's cells.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Neighborhoods {
    /// Number of the cluster of each cell.
    pub cluster_of: Vec<u32>,
    /// Histograms of the clusters, at least one.
    pub clusters: Vec<Histogram>,
    /// What stands for each bin.
    pub bins: Vec<Bin>,
    kinds: Kinds,
}

/// The kind of each voxel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Kinds {
    grid: Grid,
    bin_of_voxel: Vec<u16>,
}

/// A clipping plane in voxel space: what has a larger product is cut away.
type Cut = (DVec3, f64);

fn in_voxels(clip: &[ClipPlane], grid: &Grid) -> Vec<Cut> {
    let world = grid.world_from_voxel();
    let plane = |plane: &ClipPlane| {
        let normal = world.matrix3.transpose() * plane.normal;
        (normal, plane.offset_mm - plane.normal.dot(world.translation))
    };
    clip.iter().map(plane).collect()
}

/// How values are divided into kinds: the usual ones evenly, those beyond by ever wider steps.
#[derive(Clone, Copy, Debug)]
struct Division {
    usual: [f64; 2],
    /// Kinds below and above the usual values.
    beyond: [usize; 2],
}

impl Division {
    fn of([low, high]: [f64; 2]) -> Self {
        let beyond = [low > 0.0, high < 1.0].map(|has_any| if has_any { UNUSUAL } else { 0 });
        Self { usual: [low, high], beyond }
    }

    /// The kind of a stored value, below [`VALUES`].
    fn along(&self, value: f64) -> usize {
        let ([low, high], [below, above]) = (self.usual, self.beyond);
        let width = high - low;
        // How many steps away of so many; all that there is lies within 0 to 1.
        let steps = |away: f64, farthest: f64, most: usize| {
            let share = (away / width).max(0.0).ln_1p() / (farthest / width).ln_1p();
            ((share * most as f64) as usize).min(most.saturating_sub(1))
        };
        if value < low && below > 0 {
            return below - 1 - steps(low - value, low, below);
        }
        if value >= high && above > 0 {
            return VALUES - above + steps(value - high, 1.0 - high, above);
        }
        let within = VALUES - below - above;
        below + (((value - low) / width * within as f64) as usize).min(within - 1)
    }

    /// The bin of a voxel.
    fn bin(&self, value: f32, steepness: f64) -> u16 {
        // Beside a value that isn't finite no gradient is known.
        if value <= NOT_FINITE || steepness >= 1e9 {
            return NO_BIN;
        }
        let per_mm = steepness / (self.usual[1] - self.usual[0]);
        let steps = STEEPER.iter().filter(|edge| per_mm >= **edge).count();
        (steps * VALUES + self.along(f64::from(value))) as u16
    }
}

/// The kinds of all voxels, and what stands for each.
pub(super) fn kinds_of(field: &Field) -> (Kinds, Vec<Bin>) {
    let dims = field.grid.dims();
    let steepness: Vec<f32> = (0..field.values.len())
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|l| field.steepness(ijk(dims, l)) as f32)
        .collect();
    let division = Division::of(field.usual);
    let bin_of_voxel: Vec<u16> =
        field.values.iter().zip(&steepness).map(|(v, s)| division.bin(*v, f64::from(*s))).collect();
    let mut sums = vec![(0.0, 0.0, 0.0); BINS];
    for ((bin, value), steepness) in bin_of_voxel.iter().zip(&field.values).zip(&steepness) {
        if let Some(sum) = sums.get_mut(usize::from(*bin)) {
            *sum = (sum.0 + f64::from(*value), sum.1 + f64::from(*steepness), sum.2 + 1.0);
        }
    }
    let mean = |(value, steepness, n): &(f64, f64, f64)| Bin {
        value: value / n.max(1.0),
        steepness: steepness / n.max(1.0),
    };
    (Kinds { grid: field.grid.clone(), bin_of_voxel }, sums.iter().map(mean).collect())
}

/// The histogram about a cell of the image, for directions of the world that share the sphere. What is cut away isn't there.
fn histogram(
    Kinds { grid, bin_of_voxel }: &Kinds,
    middle: DVec3,
    cuts: &[Cut],
    (directions, radius_mm): (&[DVec3], f64),
) -> Histogram {
    let samples = samples(grid, radius_mm);
    let step_mm = radius_mm / f64::from(samples);
    let share = step_mm / directions.len() as f64;
    let from_mm = grid.voxel_from_world().matrix3;
    let dims = grid.dims();
    let mut dense = [0.0f64; BINS];
    for direction in directions {
        let along = from_mm * *direction;
        for n in 0..samples {
            let exact = middle + along * ((f64::from(n) + 0.5) * step_mm);
            let at = exact.round();
            let inside = (0..3).all(|a| at[a] >= 0.0 && at[a] < dims[a] as f64);
            if inside && cuts.iter().all(|(normal, offset)| normal.dot(exact) <= *offset) {
                let voxel = grid.linear(at.to_array().map(|c| c as usize));
                let bin = bin_of_voxel.get(voxel).copied().unwrap_or(NO_BIN);
                if let Some(mm) = dense.get_mut(usize::from(bin)) {
                    *mm += share;
                }
            }
        }
    }
    (0u16..).zip(dense).filter(|(_, mm)| *mm > 0.0).map(|(bin, mm)| (bin, mm as f32)).collect()
}

/// Samples in each direction: about one for each voxel.
fn samples(grid: &Grid, radius_mm: f64) -> u32 {
    (radius_mm / grid.spacing_mm().min_element()).ceil().clamp(1.0, MOST_SAMPLES) as u32
}

fn squared(of: &Histogram) -> f64 {
    of.iter().map(|(_, mm)| f64::from(*mm).powi(2)).sum()
}

/// A cluster's mean histogram, and its square.
struct Center {
    mean: Vec<f64>,
    squared: f64,
}

impl Center {
    fn of(histogram: &Histogram) -> Self {
        let mut mean = vec![0.0; BINS];
        for (bin, mm) in histogram {
            if let Some(place) = mean.get_mut(usize::from(*bin)) {
                *place = f64::from(*mm);
            }
        }
        Self { squared: squared(histogram), mean }
    }

    fn distance(&self, histogram: &Histogram, its_square: f64) -> f64 {
        let product: f64 = histogram
            .iter()
            .map(|(bin, mm)| f64::from(*mm) * self.mean.get(usize::from(*bin)).copied().unwrap_or(0.0))
            .sum();
        (self.squared + its_square - 2.0 * product).max(0.0)
    }
}

/// The nearest centre, of equal ones the first, and its squared distance.
fn nearest(centers: &[Center], histogram: &Histogram) -> (usize, f64) {
    let its_square = squared(histogram);
    let distances = centers.iter().map(|center| center.distance(histogram, its_square)).enumerate();
    distances.fold((0, f64::INFINITY), |best, (n, d)| if d < best.1 { (n, d) } else { best })
}

/// Clusters of histograms: seeds far from each other (Arthur and Vassilvitskii 2007), then Lloyd's rounds.
fn centers_of(histograms: &[&Histogram], count: usize) -> Vec<Center> {
    let mut random = Random::new(SEED, 0);
    let mut centers: Vec<Center> = histograms.first().map(|h| Center::of(h)).into_iter().collect();
    let mut far: Vec<f64> = vec![f64::INFINITY; histograms.len()];
    while centers.len() < count {
        let Some(last) = centers.last() else { break };
        far.par_iter_mut().zip(histograms).for_each(|(far, h)| *far = far.min(last.distance(h, squared(h))));
        let all: f64 = far.iter().sum();
        // All the rest are seeds already.
        if all <= 1e-9 {
            break;
        }
        let mut left = random.unit() * all;
        let chosen = far.iter().position(|far| {
            left -= far;
            left < 0.0 && *far > 0.0
        });
        let farthest = || far.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map(|(n, _)| n);
        let Some(next) = chosen.or_else(farthest).and_then(|n| histograms.get(n)) else { break };
        centers.push(Center::of(next));
    }
    for _ in 0..ROUNDS {
        let own: Vec<usize> = histograms.par_iter().map(|h| nearest(&centers, h).0).collect();
        let mut sums = vec![(vec![0.0; BINS], 0.0); centers.len()];
        for (n, histogram) in own.into_iter().zip(histograms) {
            let Some((sum, members)) = sums.get_mut(n) else { continue };
            *members += 1.0;
            for (bin, mm) in histogram.iter() {
                if let Some(place) = sum.get_mut(usize::from(*bin)) {
                    *place += f64::from(*mm);
                }
            }
        }
        // A cluster that lost its members stays where it is.
        for (center, (sum, members)) in centers.iter_mut().zip(sums).filter(|(_, (_, n))| *n > 0.0) {
            let mean: Vec<f64> = sum.into_iter().map(|mm| mm / members).collect();
            *center = Center { squared: mean.iter().map(|mm| mm * mm).sum(), mean };
        }
    }
    centers
}

impl Neighborhoods {
    /// Of an image's cells, within a radius (finite, above 0), with at most this many clusters (at least 1).
    pub fn of(field: &Field, cells: &Cells, radius_mm: f64, clusters: usize) -> Self {
        let (kinds, bins) = kinds_of(field);
        let histograms = histograms(&kinds, cells, radius_mm);
        let learnt: Vec<&Histogram> = if histograms.len() > LEARNT_FROM {
            // Most of an image is air, and one of its cells is as good as all.
            let plain = histograms.iter().find(|h| h.len() <= 1);
            let varied: Vec<&Histogram> = histograms.iter().filter(|h| h.len() > 1).collect();
            let every = |count: usize| count.div_ceil(LEARNT_FROM).max(1);
            if varied.len() < clusters {
                // Of one kind of tissue, or nearly: cells differ by how much of it there is around them.
                histograms.iter().step_by(every(histograms.len())).collect()
            } else {
                let every = every(varied.len());
                plain.into_iter().chain(varied.into_iter().step_by(every)).collect()
            }
        } else {
            histograms.iter().collect()
        };
        let mut centers = centers_of(&learnt, clusters.max(1));
        if centers.is_empty() {
            centers.push(Center::of(&Vec::new()));
        }
        let cluster_of = histograms.par_iter().map(|h| nearest(&centers, h).0 as u32).collect();
        let sparse = |center: Center| {
            let all = (0u16..).zip(center.mean).filter(|(_, mm)| *mm > 0.0);
            all.map(|(bin, mm)| (bin, mm as f32)).collect()
        };
        Self { cluster_of, clusters: centers.into_iter().map(sparse).collect(), bins, kinds }
    }

    /// The cells whose surroundings clipping planes change, and what is left of them: those up to a radius before a plane, and
    /// those behind it that light is interpolated with.
    pub fn cut(&self, cells: &Cells, radius_mm: f64, clip: &[ClipPlane]) -> Vec<(usize, Histogram)> {
        let grid = &self.kinds.grid;
        let world = grid.world_from_voxel();
        let side_mm = |a: usize| world.matrix3.col(a).length() * cells.voxels[a];
        let beyond_mm = side_mm(0) + side_mm(1) + side_mm(2);
        let is_cut = |n: &usize| {
            let at_mm = world.transform_point3(cells.place(grid, *n));
            let past = |plane: &ClipPlane| plane.normal.dot(at_mm) - plane.offset_mm;
            clip.iter().any(|plane| past(plane) > -radius_mm) && clip.iter().all(|p| past(p) < beyond_mm)
        };
        let cuts = in_voxels(clip, grid);
        let directions = spread(DIRECTIONS, 180.0);
        let of_cell =
            |n: usize| (n, histogram(&self.kinds, cells.place(grid, n), &cuts, (&directions, radius_mm)));
        (0..cells.count()).into_par_iter().filter(is_cut).map(of_cell).collect()
    }

    /// Mean light from all around at each cluster, and then at these cells, by the look of what stands for a bin: colours, and
    /// last the share of it that nothing hides. The rest has `bleeding` (0 to 1) of the mean colour of what hides it.
    pub fn light(
        &self,
        radius_mm: f64,
        cut: &[(usize, Histogram)],
        look: impl Fn(&Bin) -> Look,
        bleeding: f64,
    ) -> Vec<[f32; 4]> {
        let of_bin: Vec<Look> = self.bins.iter().map(look).collect();
        let light = |of: &&Histogram| {
            let (open, color) = light_of(of, radius_mm, &of_bin);
            (color * (bleeding * (1.0 - open)) + open).extend(open).as_vec4().to_array()
        };
        let all: Vec<&Histogram> = self.clusters.iter().chain(cut.iter().map(|(_, of)| of)).collect();
        all.par_iter().map(light).collect()
    }
}

/// A way of the radius is taken for so many stretches of tissue that know nothing of each other. With one, directions differ as much as
/// they can; with many, every way is the mean way, and a place with much around it on one side alone is black. A flat surface of opaque
/// tissue shows (1 - ln 2) / 2 of the light from all around, in the mean over the depths that are seen; half of its surroundings
/// is tissue, so that 2.7 stretches are right there. Measured: docs/studies.md.
const STRETCHES: i32 = 3;

/// Mean light through ways on which tissues are mixed as in the histogram, and the mean colour of what hides the rest.
pub(super) fn light_of(histogram: &Histogram, radius_mm: f64, looks: &[Look]) -> (f64, DVec3) {
    let stretch_mm = radius_mm / f64::from(STRETCHES);
    let (mut hidden, mut color) = (0.0, DVec3::ZERO);
    for (bin, mm) in histogram {
        let look = looks.get(usize::from(*bin)).copied().unwrap_or_default();
        let share = -(-stretch_mm * look.extinction).exp_m1() * f64::from(*mm) / radius_mm;
        hidden += share;
        color += look.color * share;
    }
    ((1.0 - hidden).max(0.0).powi(STRETCHES), color / hidden.max(1e-30))
}

/// The histogram of every cell.
pub(super) fn histograms(kinds: &Kinds, cells: &Cells, radius_mm: f64) -> Vec<Histogram> {
    let directions = spread(DIRECTIONS, 180.0);
    let of_cell = |n: usize| histogram(kinds, cells.place(&kinds.grid, n), &[], (&directions, radius_mm));
    (0..cells.count()).into_par_iter().map(of_cell).collect()
}
