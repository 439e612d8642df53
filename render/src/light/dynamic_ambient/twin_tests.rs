//! Dynamic ambient occlusion against brute force in `f64`, against Monte Carlo of the same light, by number of clusters; and what a
//! change of the transfer function costs.

use std::{collections::BTreeMap, sync::Arc};

use glam::DVec3;
use glioscope_core::{
    Grid,
    optics::{
        Projection, Ray,
        medium::Medium,
        monte_carlo::{self, Phase, direction},
        random::Random,
        srgb,
    },
};
use rayon::prelude::*;

use super::{
    cells_of,
    neighborhoods::{Look, Neighborhoods, histograms, kinds_of, light_of},
};
use crate::{
    ClipPlane, ContextRenderer, ContextScene,
    image::{tables::Tables, volume::Field},
    light::{
        cones::grid::Cells,
        harmonics::basis::spread,
        suite::{SIZE, image_of, scene, shaped, transfer},
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

/// Where a cell's surroundings are found: in its middle, on the image's face where it is the outermost.
fn place_mm(grid: &Grid, cells: &Cells, n: usize) -> DVec3 {
    let p = [n % cells.dims[0], n / cells.dims[0] % cells.dims[1], n / (cells.dims[0] * cells.dims[1])];
    let index: [f64; 3] = std::array::from_fn(|a| {
        let edges = [p[a], p[a] + 1].map(|edge| edge as f64 * cells.voxels[a] - 0.5);
        if p[a] == 0 {
            edges[0]
        } else if p[a] + 1 == cells.dims[a] {
            grid.dims()[a] as f64 - 0.5
        } else {
            (edges[0] + edges[1]) / 2.0
        }
    });
    grid.world_from_voxel().transform_point3(DVec3::from_array(index))
}

fn looks(extinctions: &[f64]) -> Vec<Look> {
    extinctions.iter().map(|per_mm| Look { extinction: *per_mm, color: DVec3::new(0.8, 0.2, 0.0) }).collect()
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
/// itself. Clipping planes take away what they cut, from cells on which light is seen. Colours of what hides light are those of
/// kinds, too, in the mean by how much each hides.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = 0.0f64;
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let cut = [
        ClipPlane { normal: DVec3::new(0.3, -0.8, 0.5).normalize_or(DVec3::X), offset_mm: 5.0 },
        ClipPlane { normal: DVec3::X, offset_mm: 9.5 },
    ];
    let whole: &[ClipPlane] = &[];
    for (two_d, by_shapes, with_tumor, clip) in
        [(false, false, true, whole), (true, false, false, &cut[..1]), (true, true, true, &cut)]
    {
        let mut scene =
            ContextScene { clip: clip.to_vec(), ..scene(two_d, with_tumor, Projection::Perspective) };
        if by_shapes {
            scene.transfer = shaped();
        }
        let field = field_of(&scene);
        let grid = field.grid.clone();
        let cells = Cells::of_whole_voxels(&grid, 6.0, usize::MAX);
        let tissue_bleeding = if with_tumor { 0.7 } else { 0.0 };
        let quality = lit(6.0, 1024);
        let lighting = LightSettings { tissue_bleeding, ..quality.lighting };
        let found = drawn(&mut renderer, &scene, &Quality { lighting, ..quality });
        let tints = renderer.lights().probe().read_tints();
        assert_eq!(tints.len(), if with_tumor { found.len() } else { 0 });
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
        let looks: BTreeMap<usize, (f64, DVec3)> = kinds
            .iter()
            .map(|(kind, (value, steepness, n))| {
                let value = low + width * value / n;
                let steepness = width * steepness / n;
                let (color, per_mm) = scene.transfer.sample(value, steepness);
                let color = DVec3::from_array(color.map(srgb::decode));
                (*kind, (-(1.0 - per_mm).max(1e-30).ln(), color))
            })
            .collect();
        let directions = spread(48, 180.0);
        let mut dark = 0;
        for (n, found) in found.iter().enumerate() {
            let past = |plane: &ClipPlane, at_mm: DVec3| plane.normal.dot(at_mm) - plane.offset_mm;
            // Light is interpolated across a cell at most.
            if clip.iter().any(|plane| past(plane, place_mm(&grid, &cells, n)) > 6.0 * 3f64.sqrt()) {
                continue;
            }
            let middle = grid.voxel_from_world().transform_point3(place_mm(&grid, &cells, n));
            let (mut hidden, mut color) = (0.0, DVec3::ZERO);
            for direction in &directions {
                for mm in 0..8 {
                    let exact = middle + *direction * (f64::from(mm) + 0.5);
                    let at = exact.round();
                    let at_mm = grid.world_from_voxel().transform_point3(exact);
                    let is_kept = clip.iter().all(|plane| past(plane, at_mm) <= 0.0);
                    if is_kept && (0..3).all(|a| at[a] >= 0.0 && at[a] < dims[a] as f64) {
                        // Of a third of the radius.
                        let (extinction, own) = looks[&kind_of(at.to_array().map(|c| c as i64)).0];
                        let hides = (1.0 - (-8.0 / 3.0 * extinction).exp()) / (48.0 * 8.0);
                        hidden += hides;
                        color += own * hides;
                    }
                }
            }
            let open = (1.0 - hidden).powi(3);
            worst = worst.max((found - open).abs());
            if let Some(tint) = tints.get(n).filter(|_| hidden > 0.0) {
                let light = color / hidden * (tissue_bleeding * (1.0 - open)) + open;
                worst = worst.max((*tint - light).abs().max_element());
            }
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
    let cells = Cells::of_whole_voxels(&field.grid, 2.0, usize::MAX);
    let tables = Tables::of(&scene.transfer, scene.volume.as_ref().unwrap().scale(), &field.ranges());
    let (kinds, bins) = kinds_of(&field);
    let own = histograms(&kinds, &cells, RADIUS_MM);
    let extinction: Vec<f64> = bins.iter().map(|bin| tables.extinction(bin.value, bin.steepness)).collect();
    let own: Vec<f64> = own.iter().map(|h| light_of(h, RADIUS_MM, &looks(&extinction)).0).collect();
    let rms = |of: &[f64]| (of.iter().map(|d| d * d).sum::<f64>() / of.len() as f64).sqrt();
    let errors = [1usize, 4, 16, 64, 256].map(|clusters| {
        let begin = std::time::Instant::now();
        let found = Neighborhoods::of(&field, &cells, RADIUS_MM, clusters);
        println!("{clusters} clusters: {:.0} ms", begin.elapsed().as_secs_f64() * 1e3);
        let look = |extinction| Look { extinction, color: DVec3::ONE };
        let light = found
            .light(RADIUS_MM, &[], |bin| look(tables.extinction(bin.value, bin.steepness)), 0.0)
            .into_iter()
            .map(|light| f64::from(light[3]));
        let light: Vec<f64> = light.collect();
        let off = found.cluster_of.iter().zip(&own).map(|(c, own)| light[*c as usize] - own);
        rms(&off.collect::<Vec<f64>>())
    });
    let medium = scene.medium().unwrap();
    let (off, se): (Vec<f64>, Vec<f64>) = (0..cells.count())
        .step_by(29)
        .collect::<Vec<usize>>()
        .into_par_iter()
        .map(|n| {
            let mut random = Random::new(5, n as u64);
            let at_mm = place_mm(&field.grid, &cells, n);
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
    // A clipping plane changes the cells near it alone: not one in ten of these.
    let cut = ContextScene { clip: vec![ClipPlane { normal: DVec3::Z, offset_mm: 17.0 }], ..scene.clone() };
    let found = rgba(&mut renderer, &cut);
    let again = renderer.light_work().unwrap().samples;
    assert!(again > 0 && again <= 9 * 9 * 4 * 48, "{again}");
    assert!(found == rgba(&mut ContextRenderer::new(&GPU).unwrap(), &cut));
    rgba(&mut renderer, &ContextScene { transfer: transfer(false, 0.8), ..cut });
    assert_eq!(renderer.light_work().unwrap().samples, 0);
    // A turned camera, too.
    let mut camera = scene.camera;
    camera.height_mm *= 0.8;
    rgba(&mut renderer, &scene);
    rgba(&mut renderer, &ContextScene { camera, ..scene.clone() });
    assert_eq!(renderer.light_work().unwrap().samples, 0);
    renderer.render(&GPU, &scene, &lit(4.0, 32), SIZE).unwrap();
    assert!(renderer.light_work().unwrap().samples > 0);
}

/// Pictures against Monte Carlo of light from within the radius, in docs/studies.md: tissue that is translucent or opaque over it.
#[test]
fn pictures_are_near_monte_carlo() {
    let with = |transfer| ContextScene { transfer, ..scene(false, false, Projection::Perspective) };
    let size = [24, 22];
    for (name, scene, most) in [
        ("translucent", with(transfer(false, 0.1)), [0.01, 0.02]),
        ("soft", with(transfer(false, 0.35)), [0.02, 0.02]),
        ("opaque", with(transfer(false, 0.99)), [0.03, 0.03]),
    ] {
        let medium = scene.medium().unwrap();
        let near = Phase::Near { radius_mm: RADIUS_MM };
        let truth = monte_carlo::picture(&medium, &scene.camera, size, near, DVec3::ZERO, 400, 7);
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        for (cell_mm, most) in [2.0, 4.0].into_iter().zip(most) {
            let quality = Quality { occlusion_strength: 1.0, context_step_mm: 0.25, ..lit(cell_mm, 128) };
            let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
            let found = frame.read_marched(&GPU);
            let shown = found.iter().zip(&truth).filter(|(found, _)| found.rgba()[3] > 0.01);
            let (mut squares, mut sum, mut light, mut n) = (0.0, 0.0, 0.0, 0.0);
            for (found, truth) in shown {
                let [r, g, b, _] = found.rgba();
                let off = DVec3::new(r, g, b) - truth.mean;
                squares += off.length_squared() - truth.standard_error.length_squared();
                sum += off.element_sum();
                light += truth.mean.element_sum();
                n += 3.0;
            }
            let rms = f64::sqrt(f64::max(squares / n, 0.0));
            println!("{name}, {cell_mm} mm: {rms:.4}, mean {:.4} of {:.4}", sum / n, light / n);
            assert!(n > 300.0 && rms < most, "{name}, {cell_mm} mm: {rms}");
        }
    }
}

/// One voxel far beyond all others, such as metal in CT, leaves the light of the rest: its tissues are still told apart.
#[test]
fn an_outlier_leaves_the_light_of_all_else() {
    let scene = scene(false, false, Projection::Perspective);
    let image = Arc::clone(scene.volume.as_ref().unwrap().image());
    let grid = image.grid().clone();
    let (cells, spoilt) = (Cells::of_whole_voxels(&grid, 6.0, usize::MAX), [4, 4, 4]);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let quality = lit(6.0, 1024);
    let plain = drawn(&mut renderer, &scene, &quality);
    let spoilt_mm = grid.world_from_voxel().transform_point3(DVec3::splat(4.0));
    for outlier in [1e4, 1e38, -1e5, -3.4e38] {
        let mut values: Vec<f64> = (0..grid.voxel_count()).map(|l| image.value(l)).collect();
        values[grid.linear(spoilt)] = outlier;
        let found = drawn(
            &mut renderer,
            &ContextScene { volume: Some(image_of(&grid, values)), ..scene.clone() },
            &quality,
        );
        let far =
            (0..cells.count()).filter(|n| place_mm(&grid, &cells, *n).distance(spoilt_mm) > RADIUS_MM + 1.0);
        let off: Vec<f64> = far.map(|n| (found[n] - plain[n]).abs()).collect();
        let worst = off.iter().copied().fold(0.0, f64::max);
        println!("{outlier}: {} cells, off by {worst:.4}", off.len());
        assert!(off.len() > 180 && worst < 0.03, "{outlier}: {} cells, {worst}", off.len());
    }
}

/// Cells whose surroundings would take minutes are larger, and that is said; others are as asked for.
#[test]
fn cells_that_would_be_too_many_are_larger() {
    let grid = |dims| Grid::axis_aligned(dims, DVec3::ONE, DVec3::ZERO).unwrap();
    let (cells, note) = cells_of(&grid([256; 3]), 1.0);
    assert_eq!(
        (cells.voxels, note.as_deref()),
        (DVec3::splat(2.0), Some("cells of 1 mm: 2 mm is used, for at most 2097152 cells"))
    );
    for (dims, side_mm) in [([256; 3], 2.0), ([240, 240, 155], 4.0), ([100; 3], 0.01), ([8; 3], f64::NAN)] {
        let (cells, note) = cells_of(&grid(dims), side_mm);
        assert_eq!((cells, note), (Cells::of_whole_voxels(&grid(dims), side_mm, usize::MAX), None));
    }
}

/// A cut through opaque tissue is lit: a cell behind it by the share of its ways that are open, to the power of three stretches.
#[test]
fn a_cut_through_opaque_tissue_is_lit() {
    let mut scene = scene(false, false, Projection::Orthographic);
    let grid = scene.volume.as_ref().unwrap().grid().clone();
    scene.volume = Some(image_of(&grid, vec![90.0; grid.voxel_count()]));
    scene.transfer = transfer(false, 0.9);
    let cells = Cells::of_whole_voxels(&grid, 3.0, usize::MAX);
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    // A cell in the middle of the cut has its middle 1.5 mm behind it.
    let of_cut = |light: &[f64]| light[(5 * cells.dims[1] + 5) * cells.dims[0] + 5];
    let closed = of_cut(&drawn(&mut renderer, &scene, &lit(3.0, 64)));
    scene.clip = vec![ClipPlane { normal: DVec3::Z, offset_mm: 0.0 }];
    let open = of_cut(&drawn(&mut renderer, &scene, &lit(3.0, 64)));
    // Opaque: all but a ball's cap, whose ways are 1/2·(1 − d/r + d/r·ln(d/r)) of the whole at a depth d of radius r.
    let depth = 1.5 / RADIUS_MM;
    let truth = 0.5 * (1.0 - depth + depth * depth.ln());
    println!("{closed} {open} {truth}");
    assert!(closed < 1e-4 && (open.cbrt() - truth).abs() < 0.03, "{closed} {open} {truth}");
}

/// Tissue that the image ends in is lit on its faces, as the same tissue would be with air about it.
#[test]
fn tissue_that_the_image_ends_in_is_lit() {
    let mut scene = scene(false, false, Projection::Orthographic);
    let grid = scene.volume.as_ref().unwrap().grid().clone();
    scene.volume = Some(image_of(&grid, vec![90.0; grid.voxel_count()]));
    scene.transfer = transfer(false, 0.9);
    let medium = scene.medium().unwrap();
    let (size, near) = ([24, 22], Phase::Near { radius_mm: RADIUS_MM });
    let truth = monte_carlo::picture(&medium, &scene.camera, size, near, DVec3::ZERO, 200, 7);
    let truth = truth.iter().map(|e| e.mean.element_sum()).sum::<f64>();
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    // The light of edges reaches over a cell.
    for (cell_mm, most) in [(2.0, 1.25), (4.0, 1.25), (6.0, 1.5)] {
        let quality = Quality { occlusion_strength: 1.0, context_step_mm: 0.25, ..lit(cell_mm, 128) };
        let frame = renderer.render(&GPU, &scene, &quality, size).unwrap();
        let found: f64 = frame.read_marched(&GPU).iter().map(|f| f.rgba()[..3].iter().sum::<f64>()).sum();
        println!("cells of {cell_mm} mm: {:.3} of the light", found / truth);
        assert!((0.75..most).contains(&(found / truth)), "cells of {cell_mm} mm: {found} {truth}");
    }
}

/// Closed forms: where all directions are alike, the light through their way; in the middle of opaque tissue, none. A flat surface of
/// opaque tissue shows the light of its outermost layers, (1 - ln 2) / 2: exponential integral E2 over depths seen.
#[test]
fn light_has_its_closed_forms() {
    let of = |histogram: Vec<(u16, f32)>, extinctions: &[f64]| light_of(&histogram, 8.0, &looks(extinctions));
    for per_mm in [1e-6, 0.1, 2.0] {
        let (light, color) = of(vec![(0, 8.0)], &[per_mm]);
        assert!((light - (-8.0 * per_mm).exp()).abs() < 1e-6, "{per_mm}: {light}");
        assert!(color.distance(DVec3::new(0.8, 0.2, 0.0)) < 1e-6, "{color}");
    }
    for opaque_per_mm in [70.0, f64::INFINITY] {
        let (light, color) = of(vec![(0, 4.0), (1, 4.0)], &[0.0, opaque_per_mm]);
        let truth = 0.5 * (1.0 - 2f64.ln());
        assert!((light - truth).abs() < 0.03, "{opaque_per_mm}: {light} {truth}");
        assert!(color.distance(DVec3::new(0.8, 0.2, 0.0)) < 1e-6, "{color}");
    }
    assert_eq!(of(vec![(1, 8.0)], &[0.0, f64::INFINITY]).0, 0.0);
    assert_eq!(of(Vec::new(), &[]).0, 1.0);
}
