//! The light grid against its twin in `f64`, and the effect of coarse levels at a clipping plane.

use glam::DVec3;
use glioscope_core::optics::{Projection, Sight};
use rayon::prelude::*;

use super::{cell_dispatches, grid::Cells, twin::ConeTwin};
use crate::{
    ClipPlane, ContextRenderer, ContextScene,
    image::{buffers::ImageBuffers, volume::BRICK},
    light::suite::{image_of, lit, scene, shaped, transfer},
    scene::{Lamp, LampFrame, LightSettings, LightingMode, Quality},
    solid::{SURFACE, view::FAR},
    testing::GPU,
};

const SIZE: [u32; 2] = [44, 36];

/// For the suite: largest difference of the light grid from its twin.
pub(super) fn max_twin_error() -> f64 {
    let mut largest = 0.0f64;
    let clip = ClipPlane { normal: DVec3::new(0.6, -1.6, 1.0), offset_mm: 10.0 };
    let mut differing = (0, 0);
    for (two_d, by_shapes, with_tumor, projection, cut) in [
        (false, false, false, Projection::Perspective, false),
        (false, false, true, Projection::Perspective, true),
        (true, false, true, Projection::Orthographic, false),
        (true, false, false, Projection::Orthographic, true),
        (true, true, true, Projection::Perspective, false),
    ] {
        let mut scene = scene(two_d, with_tumor, projection);
        if by_shapes {
            scene.transfer = shaped();
        }
        scene.clip = if cut { vec![clip] } else { Vec::new() };
        for (aperture_deg, sub_cones, coarsest_level, cone_step, cell_mm, to_lamp) in [
            (60.0, 8, 3, 1.0, 4.0, None),
            (80.0, 16, 1, 0.5, 3.0, None),
            (25.0, 5, 0, 1.0, 5.0, None),
            (60.0, 4, 0, 0.0625, 6.0, None),
            (40.0, 7, 2, 1.0, 5.0, Some((LampFrame::Viewer, -45.0, 45.0))),
            (20.0, 3, 0, 1.0, 6.0, Some((LampFrame::Patient, 140.0, -20.0))),
        ] {
            let lighting = LightSettings {
                mode: LightingMode::Cones,
                aperture_deg,
                sub_cones,
                coarsest_level,
                cone_step,
                cell_mm,
                towards_lamp: to_lamp.is_some(),
                lamp: to_lamp.map_or(Lamp::DEFAULT, |(frame, azimuth_deg, elevation_deg)| Lamp {
                    frame,
                    azimuth_deg,
                    elevation_deg,
                }),
                ..LightSettings::DEFAULT
            };
            let (worst, ambiguous, cells) = twin_error(&scene, &lighting);
            println!(
                "2-D {two_d}, shapes {by_shapes}, tumour {with_tumor}, {projection:?}, cut {cut}, {sub_cones} sub-cones to level \
                 {coarsest_level}, lamp {to_lamp:?}: {worst:.2e} in {cells} cells, {ambiguous} ambiguous"
            );
            largest = largest.max(worst);
            differing = (differing.0 + ambiguous, differing.1 + cells);
        }
    }
    println!("{differing:?} cells differ by rounding");
    assert!(differing.0 * 100 < differing.1, "{differing:?}");
    largest
}

/// Largest difference of a cell from the twin, number of cells that differ where the twin is ambiguous, and number of
/// cells.
fn twin_error(scene: &ContextScene, lighting: &LightSettings) -> (f64, usize, usize) {
    let quality = Quality { lighting: *lighting, ..Quality::FULL };
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    let frame = renderer.render(&GPU, scene, &quality, SIZE).unwrap();
    assert!(frame.notes.is_empty(), "{:?}", frame.notes);
    let reference_mm = scene.reference_mm();
    let opaque_mm: Vec<f64> = if frame.plan.has(SURFACE) {
        let depths = frame.read_depths(&GPU);
        depths.iter().map(|d| if *d < FAR { f64::from(*d) + reference_mm } else { f64::INFINITY }).collect()
    } else {
        Vec::new()
    };
    let [light, _] = renderer.lights().probe().grid.unwrap();
    let found: Vec<[f32; 2]> =
        bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(light, 0, light.size())]).unwrap()[0]);
    let volume = scene.volume.as_ref().unwrap();
    let grid = volume.grid();
    let cells = Cells::new(grid, lighting.cell_mm);
    let image =
        ImageBuffers::reuse(&mut None, &GPU, volume, &scene.transfer).unwrap().visible_bits().to_vec();
    let bricks = grid.dims().map(|d| (d - 1).div_ceil(BRICK));
    let needed = cells.needed(grid, BRICK, bricks, &image, scene.tumor.as_deref());
    assert_eq!(found.len(), cells.count());
    let sight = Sight::new(&scene.camera, SIZE);
    let twin = ConeTwin::new(scene, &sight, &opaque_mm, lighting).unwrap();
    let offs: Vec<(f64, bool, [f64; 2])> = needed
        .par_iter()
        .map(|&n| {
            let n = n as usize;
            let world = grid.world_from_voxel();
            let at_mm = world.transform_point3(cells.middle(n));
            let lit = twin.at(at_mm, |w| world.transform_point3(cells.middle_for(grid, n, w)));
            let off = [lit.image_only - f64::from(found[n][0]), lit.with_opaque - f64::from(found[n][1])];
            (off[0].abs().max(off[1].abs()), lit.is_ambiguous, [lit.image_only, lit.with_opaque])
        })
        .collect();
    // Some cells are dark, and some are darkened by opaque geometry.
    let dark = offs.iter().filter(|(.., l)| l[0] < 0.7).count();
    let hidden = offs.iter().filter(|(.., l)| l[1] < 0.9 * l[0]).count();
    assert!(dark * 20 > offs.len(), "{dark} of {}", offs.len());
    assert!((hidden > 10) == scene.tumor.is_some(), "{hidden}");
    let excused = offs.iter().filter(|(off, ambiguous, _)| *off > 1e-3 && *ambiguous).count();
    let compared = offs.iter().filter(|(off, ambiguous, _)| *off <= 1e-3 || !*ambiguous);
    let worst = compared.fold(0.0f64, |a, o| a.max(o.0));
    (worst, excused, offs.len())
}

/// Light from a lamp at the eye is that of the eye where lines of sight are parallel; where the lamp stands has no effect
/// on light from the eye.
#[test]
fn a_lamp_at_the_eye_is_the_eyes_light() {
    let scene = scene(false, true, Projection::Orthographic);
    let eye = lit(LightingMode::Cones);
    let elsewhere = Lamp { azimuth_deg: 100.0, elevation_deg: 10.0, ..Lamp::DEFAULT };
    let at_eye = Lamp { azimuth_deg: 0.0, elevation_deg: 0.0, ..Lamp::DEFAULT };
    let draw = |lamp: Lamp, towards_lamp: bool| {
        let lighting = LightSettings { lamp, towards_lamp, ..eye.lighting };
        let mut renderer = ContextRenderer::new(&GPU).unwrap();
        renderer.render(&GPU, &scene, &Quality { lighting, ..eye }, SIZE).unwrap().read_rgba(&GPU).unwrap()
    };
    let plain = draw(Lamp::DEFAULT, false);
    assert!(draw(elsewhere, false) == plain);
    let worst = |a: &[u8]| a.iter().zip(&plain).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    let (same, other) = (worst(&draw(at_eye, true)), worst(&draw(elsewhere, true)));
    assert!(same <= 1 && other > 20, "{same} {other}");
}

/// A clipped image compared with one that really ends there, the cut towards the viewer. Voxels, light
/// cells and coarse cells on the plane are averaged with what is clipped. Measured in linear light: soft
/// 0.020 at most at level 0 (RMS 0.005) and 0.016 up to level 3 (RMS 0.003); dense 0.043 at every level
/// (RMS 0.014), so that there coarse levels add nothing to the error of interpolation.
#[test]
fn a_clipped_image_resembles_a_cropped_one() {
    let base = scene(false, false, Projection::Perspective);
    let whole = base.volume.as_ref().unwrap();
    let dims = whole.grid().dims();
    // Between voxels 16 and 17, where no level has a face; the cut faces the viewer.
    let cropped = whole.grid().crop([17, 0, 0], [19, dims[1], dims[2]]).unwrap();
    let values: Vec<f64> = (0..cropped.voxel_count())
        .map(|l| {
            let p = [17 + l % 19, l / 19 % dims[1], l / 19 / dims[1]];
            whole.image().value(whole.grid().linear(p))
        })
        .collect();
    let offset_mm = -cropped.bounds_mm().0.x;
    let clip = vec![ClipPlane { normal: -DVec3::X, offset_mm }];
    for (name, opacity, most) in [("soft", 0.35, 0.02), ("dense", 1.0, 0.1)] {
        let mut at_voxels = None;
        let cut = ContextScene { transfer: transfer(false, opacity), clip: clip.clone(), ..base.clone() };
        let ends = ContextScene {
            volume: Some(image_of(&cropped, values.clone())),
            clip: Vec::new(),
            ..cut.clone()
        };
        for coarsest_level in [0, 1, 2, 3] {
            let mut quality = lit(LightingMode::Cones);
            quality.lighting = LightSettings { coarsest_level, cell_mm: 1.0, ..quality.lighting };
            let draw = |scene: &ContextScene| {
                let mut renderer = ContextRenderer::new(&GPU).unwrap();
                let frame = renderer.render(&GPU, scene, &quality, SIZE).unwrap();
                frame.read_marched(&GPU).iter().map(|m| m.rgba()).collect::<Vec<_>>()
            };
            let (a, b) = (draw(&cut), draw(&ends));
            let (mut worst, mut sum, mut n) = (0.0f64, 0.0, 0.0);
            for (a, b) in a.iter().zip(&b).filter(|(a, b)| a[3].max(b[3]) > 0.01) {
                for c in 0..3 {
                    worst = worst.max((a[c] - b[c]).abs());
                    sum += (a[c] - b[c]).powi(2);
                    n += 1.0;
                }
            }
            println!("{name}, to level {coarsest_level}: at most {worst:.4}, RMS {:.4}", f64::sqrt(sum / n));
            assert!(worst < most && n > 500.0, "{name} {coarsest_level}: {worst}");
            let at_voxels = *at_voxels.get_or_insert(worst);
            assert!(worst < at_voxels + 0.006, "{name} {coarsest_level}: coarse cells add little");
        }
    }
}

/// Every cell is in one dispatch, no dispatch exceeds the device's limits, and a GPU takes all in one.
#[test]
fn every_cell_is_in_exactly_one_dispatch() {
    for cells in [0u32, 1, 63, 64, 1000, 1024, 1025, 300_000, 1 << 26] {
        for is_software in [false, true] {
            let (bytes, steps) = cell_dispatches(cells, is_software);
            let mut next = 0;
            for step in &steps {
                let at = step.offset as usize;
                let first = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
                assert!(at.is_multiple_of(256) && bytes.len() >= at + 256 && first == next, "{cells}");
                let [across, down, _] = step.workgroups;
                assert!(across.max(down) <= 65_535 && across * down > 0);
                next = first + 64 * across * down;
            }
            assert!(next >= cells && (is_software || steps.len() == 1) && steps.len() <= 4096, "{cells}");
        }
    }
}
