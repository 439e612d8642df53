//! Dynamic ambient occlusion against brute force in `f64`, against Monte Carlo of the same light, by number of clusters; and what a
//! change of the transfer function costs.

use std::collections::BTreeMap;

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{
        Projection, Ray,
        medium::Medium,
        monte_carlo::{Phase, direction},
        random::Random,
    },
};
use rayon::prelude::*;

use super::neighborhoods::{Neighborhoods, histograms, light_of};
use crate::{
    ContextRenderer, ContextScene,
    image::{tables::Tables, volume::Field},
    light::{
        cones::grid::Cells,
        harmonics::basis::spread,
        suite::{SIZE, scene, shaped, transfer},
    },
    scene::{LightSettings, LightingMode, Quality},
    testing::GPU,
};

const RADIUS_MM: f64 = 8.0;

fn lit(cell_mm: f64, clusters: u32) -> Quality {
    let lighting =
        LightSettings { mode: LightingMode::DynamicAmbient, cell_mm, clusters, ..LightSettings::DEFAULT };
    Quality { lighting, occlusion_radius_mm: RADIUS_MM, ..Quality::FULL }
}

fn field_of(scene: &ContextScene) -> Field {
    Field::fitting(scene.volume.as_ref().unwrap(), u64::MAX).unwrap()
}

fn middle_mm(grid: &Grid, cells: &Cells, n: usize) -> DVec3 {
    let p = [n % cells.dims[0], n / cells.dims[0] % cells.dims[1], n / (cells.dims[0] * cells.dims[1])];
    let index: [f64; 3] = std::array::from_fn(|a| (p[a] as f64 + 0.5) * cells.voxels[a] as f64 - 0.5);
    grid.world_from_voxel().transform_point3(DVec3::from_array(index))
}

fn drawn(renderer: &mut ContextRenderer, scene: &ContextScene, quality: &Quality) -> Vec<f64> {
    renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let [light, _] = renderer.lights().probe().grid.unwrap();
    let found: Vec<[f32; 2]> =
        bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(light, 0, light.size())]).unwrap()[0]);
    assert!(found.iter().all(|l| l[0] == l[1]));
    found.iter().map(|l| f64::from(l[0])).collect()
}

/// For the suite. Every cell has a cluster of its own, so that its light is that of its own surroundings: tissue is classified as in
/// 64 values by 4 gradients, each kind by its mean, along ways found here with maps instead of tables, by the transfer function
/// itself.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = 0.0f64;
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for (two_d, by_shapes, with_tumor) in [(false, false, true), (true, false, false), (true, true, true)] {
        let mut scene = scene(two_d, with_tumor, Projection::Perspective);
        if by_shapes {
            scene.transfer = shaped();
        }
        let field = field_of(&scene);
        let grid = field.grid.clone();
        let cells = Cells::new(&grid, 6.0);
        let found = drawn(&mut renderer, &scene, &lit(6.0, 1024));
        assert_eq!((found.len(), cells.count()), (216, 216));
        let dims = grid.dims();
        let (low, width) = scene.volume.as_ref().unwrap().scale();
        let image = scene.volume.as_ref().unwrap().image();
        let voxel = |p: [i64; 3]| {
            let inside: [usize; 3] = std::array::from_fn(|a| p[a].clamp(0, dims[a] as i64 - 1) as usize);
            (image.value(grid.linear(inside)) - low) / width
        };
        // The grid is of 1 mm along the axes.
        let kind_of = |p: [i64; 3]| {
            let along = |a: usize| {
                let (mut before, mut after) = (p, p);
                before[a] -= 1;
                after[a] += 1;
                0.5 * (voxel(after) - voxel(before))
            };
            let steepness = DVec3::new(along(0), along(1), along(2)).length();
            let value = voxel(p);
            let kind = ((value * 64.0) as usize).min(63)
                + 64 * [0.01, 0.04, 0.12].iter().filter(|edge| steepness >= **edge).count();
            (kind, value, steepness)
        };
        let mut kinds: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
        for l in 0..grid.voxel_count() {
            let p = [l % dims[0], l / dims[0] % dims[1], l / (dims[0] * dims[1])].map(|c| c as i64);
            let (kind, value, steepness) = kind_of(p);
            let sum = kinds.entry(kind).or_default();
            *sum = (sum.0 + value, sum.1 + steepness, sum.2 + 1.0);
        }
        let extinction: BTreeMap<usize, f64> = kinds
            .iter()
            .map(|(kind, (value, steepness, n))| {
                let value = low + width * value / n;
                let steepness = width * steepness / n;
                let per_mm = scene.transfer.sample(value, steepness).1;
                (*kind, -(1.0 - per_mm).max(1e-30).ln())
            })
            .collect();
        let directions = spread(48, 180.0);
        let mut dark = 0;
        for (n, found) in found.iter().enumerate() {
            let middle = grid.voxel_from_world().transform_point3(middle_mm(&grid, &cells, n));
            let (mut thickness, mut hidden) = (0.0, 0.0);
            for direction in &directions {
                for mm in 0..8 {
                    let at = (middle + *direction * (f64::from(mm) + 0.5)).round();
                    if (0..3).all(|a| at[a] >= 0.0 && at[a] < dims[a] as f64) {
                        // Translucent below an optical thickness of 2 of the radius, opaque above 6.
                        let of_radius = 8.0 * extinction[&kind_of(at.to_array().map(|c| c as i64)).0];
                        let opaque = ((of_radius - 2.0) / 4.0).clamp(0.0, 1.0);
                        hidden += opaque / (48.0 * 8.0);
                        thickness += (1.0 - opaque) * of_radius.min(6.0) / (48.0 * 8.0);
                    }
                }
            }
            worst = worst.max((found - (1.0 - hidden) * (-thickness).exp()).abs());
            dark += usize::from(*found < 0.8);
        }
        println!("{two_d} {by_shapes} {with_tumor}: {worst:.2e}, {dark} dark");
        assert!(dark > 20, "{dark}");
    }
    worst
}

/// More clusters come nearer to every cell's own histogram; that, to Monte Carlo of light from all around within the radius. In
/// docs/studies.md.
#[test]
fn more_clusters_come_nearer_to_each_cells_own_histogram() {
    let scene = scene(false, false, Projection::Perspective);
    let field = field_of(&scene);
    let cells = Cells::new(&field.grid, 2.0);
    let tables = Tables::of(&scene.transfer, scene.volume.as_ref().unwrap().scale(), &field.ranges());
    let (own, bins) = histograms(&field, &cells, RADIUS_MM);
    let extinction: Vec<f64> = bins.iter().map(|bin| tables.extinction(bin.value, bin.steepness)).collect();
    let own: Vec<f64> = own.iter().map(|h| light_of(h, RADIUS_MM, &extinction)).collect();
    let rms = |of: &[f64]| (of.iter().map(|d| d * d).sum::<f64>() / of.len() as f64).sqrt();
    let errors = [1usize, 4, 16, 64, 256].map(|clusters| {
        let begin = std::time::Instant::now();
        let found = Neighborhoods::of(&field, &cells, RADIUS_MM, clusters);
        println!("{clusters} clusters: {:.0} ms", begin.elapsed().as_secs_f64() * 1e3);
        let light = found.light(RADIUS_MM, |bin| tables.extinction(bin.value, bin.steepness));
        let off = found.cluster_of.iter().zip(&own).map(|(c, own)| f64::from(light[*c as usize]) - own);
        rms(&off.collect::<Vec<f64>>())
    });
    let medium = scene.medium().unwrap();
    let (off, se): (Vec<f64>, Vec<f64>) = (0..cells.count())
        .step_by(29)
        .collect::<Vec<usize>>()
        .into_par_iter()
        .map(|n| {
            let mut random = Random::new(5, n as u64);
            let at_mm = middle_mm(&field.grid, &cells, n);
            let light: Vec<f64> = (0..200)
                .map(|_| {
                    let direction = direction(Phase::Isotropic, DVec3::Z, &mut random);
                    (-medium.thickness(&Ray { origin_mm: at_mm, direction }, RADIUS_MM)).exp()
                })
                .collect();
            let mean = light.iter().sum::<f64>() / 200.0;
            let spread = rms(&light.iter().map(|l| l - mean).collect::<Vec<f64>>());
            (own[n] - mean, spread / 200f64.sqrt())
        })
        .unzip();
    println!(
        "{} cells: 1, 4, 16, 64, 256 clusters differ by {errors:.4?} from own histograms, which do by {:.4} from Monte Carlo \
         (standard error {:.4})",
        cells.count(),
        rms(&off),
        rms(&se)
    );
    assert!(errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    assert!(errors[4] < errors[0] / 8.0 && rms(&off) < 0.05, "{errors:?} {}", rms(&off));
}

/// A change of the transfer function finds nothing again, and gives the frame of a renderer that began with it.
#[test]
fn a_transfer_function_finds_nothing_again() {
    let scene = scene(false, true, Projection::Perspective);
    let quality = lit(4.0, 64);
    let rgba = |renderer: &mut ContextRenderer, scene: &ContextScene| {
        renderer.render(&GPU, scene, &quality, SIZE).unwrap().read_rgba(&GPU).unwrap()
    };
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let first = rgba(&mut renderer, &scene);
    // Cells by directions: histograms were made.
    assert_eq!(renderer.light_work().unwrap().samples, 9 * 9 * 9 * 48);
    for changed in [transfer(false, 0.8), transfer(true, 0.5), shaped()] {
        let scene = ContextScene { transfer: changed, ..scene.clone() };
        let found = rgba(&mut renderer, &scene);
        assert_eq!(renderer.light_work().unwrap().samples, 0);
        assert!(found != first);
        assert!(found == rgba(&mut ContextRenderer::new(&GPU).unwrap(), &scene));
    }
    // A turned camera, too.
    let mut camera = scene.camera;
    camera.height_mm *= 0.8;
    rgba(&mut renderer, &ContextScene { camera, ..scene.clone() });
    assert_eq!(renderer.light_work().unwrap().samples, 0);
    renderer.render(&GPU, &scene, &lit(4.0, 32), SIZE).unwrap();
    assert!(renderer.light_work().unwrap().samples > 0);
}

/// Closed forms: a flat surface of opaque tissue has half of its light, whatever the extinction; a thin haze the light through
/// its mean thickness; the middle of opaque tissue none.
#[test]
fn opaque_tissue_hides_the_share_of_the_surroundings_that_it_fills() {
    let half = vec![(0u16, 4.0f32), (1, 4.0)];
    for opaque_per_mm in [1.0, 70.0, f64::INFINITY] {
        let light = light_of(&half, 8.0, &[0.0, opaque_per_mm]);
        assert!((light - 0.5).abs() < 1e-6, "{opaque_per_mm}: {light}");
    }
    assert!((light_of(&half, 8.0, &[0.0, 0.1]) - (-0.4f64).exp()).abs() < 1e-6);
    assert_eq!(light_of(&vec![(1, 8.0)], 8.0, &[0.0, f64::INFINITY]), 0.0);
    assert_eq!(light_of(&Vec::new(), 8.0, &[]), 1.0);
}
