//! Shadow volume propagation against its twin in `f64`.

use glam::DVec3;
use glioscope_core::optics::{Projection, Sight, voxels::OpaqueVoxels};

use super::{plan::sweep, twin::cells_of};
use crate::{
    ClipPlane, ContextRenderer, ContextScene,
    light::{
        cones::grid::Cells,
        half_angle::{plan::turned, twin::LampTwin},
        suite::{SIZE, scene, shaped},
    },
    scene::{Lamp, LampFrame, LightSettings, LightingMode, Quality},
    testing::GPU,
};

pub(super) fn lamp(azimuth_deg: f64, elevation_deg: f64) -> Lamp {
    Lamp { frame: LampFrame::Viewer, azimuth_deg, elevation_deg }
}

pub(super) fn lit(lamp: Lamp, cell_mm: f64) -> Quality {
    let lighting =
        LightSettings { mode: LightingMode::ShadowVolume, lamp, cell_mm, ..LightSettings::DEFAULT };
    Quality { lighting, ..Quality::FULL }
}

/// Largest difference of a cell from the twin; shares of cells that weren't compared because rounding decides them, that the image
/// shades, and that the masks do.
fn twin_error(renderer: &mut ContextRenderer, scene: &ContextScene, quality: &Quality) -> [f64; 4] {
    renderer.render(&GPU, scene, quality, SIZE).unwrap();
    let [light, _] = renderer.lights().probe().grid.unwrap();
    let found: Vec<[f32; 2]> =
        bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(light, 0, light.size())]).unwrap()[0]);
    let grid = scene.volume.as_ref().unwrap().grid();
    let cells = Cells::new(grid, quality.lighting.cell_mm);
    assert_eq!(found.len(), cells.count());
    let sight = Sight::new(&scene.camera, SIZE);
    let light = -turned(&scene.camera, quality.lighting.lamp.direction(&scene.camera));
    let [here, moved] = [0.0, 2e-3].map(|shift_mm| {
        let voxels = scene.tumor.as_ref().map(|tumor| {
            OpaqueVoxels::new(tumor.grid().clone(), |l| {
                scene.selection.shows(tumor.bits_of_id()[tumor.id(l) as usize])
            })
        });
        // The second looks from beside it.
        let camera = glioscope_core::optics::Camera {
            focus_mm: scene.camera.focus_mm + DVec3::new(0.3, 0.8, 0.5) * shift_mm,
            ..scene.camera
        };
        let moved = Sight::new(&camera, SIZE);
        let reference_mm = scene.reference_mm();
        let sight = if shift_mm > 0.0 { &moved } else { &sight };
        let twin = LampTwin { scene, sight, reference_mm, light, voxels, shift_mm };
        cells_of(&twin, grid, &cells, &sweep(grid, &cells, twin.turned(light)))
    });
    let (mut worst, mut counts) = (0.0f64, [0.0; 3]);
    for ((found, here), moved) in found.iter().zip(&here).zip(&moved) {
        if (0..2).any(|c| (here[c] - moved[c]).abs() > 2e-4) {
            counts[0] += 1.0;
            continue;
        }
        worst = (0..2).map(|c| (f64::from(found[c]) - here[c]).abs()).fold(worst, f64::max);
        counts[1] += f64::from(u8::from(here[0] < 0.8));
        counts[2] += f64::from(u8::from(here[1] < here[0]));
    }
    let [excused, image, masks] = counts.map(|count| count / found.len() as f64);
    [worst, excused, image, masks]
}

/// For the suite: along each axis, and where two or all three tie; with and without tumour, gradients, shapes, clipping planes.
pub(super) fn max_twin_error() -> f64 {
    let mut worst = 0.0f64;
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    for (two_d, by_shapes, with_tumor, projection, lamp, cell_mm, cut) in [
        (false, false, false, Projection::Perspective, lamp(-45.0, 45.0), 3.0, false),
        (false, false, true, Projection::Perspective, lamp(-45.0, 45.0), 2.0, true),
        (true, false, true, Projection::Orthographic, lamp(140.0, 20.0), 4.0, false),
        (true, true, true, Projection::Perspective, lamp(60.0, -10.0), 2.6, false),
        (false, false, true, Projection::Perspective, lamp(13.7, 3.0), 1.0, false),
        (
            false,
            false,
            true,
            Projection::Orthographic,
            Lamp { frame: LampFrame::Patient, ..lamp(-45.0, 35.26) },
            5.0,
            true,
        ),
    ] {
        let mut scene = scene(two_d, with_tumor, projection);
        if by_shapes {
            scene.transfer = shaped();
        }
        if cut {
            scene.clip = vec![ClipPlane { normal: DVec3::new(0.3, -0.8, 0.5), offset_mm: 5.0 }];
        }
        let [off, excused, image, masks] = twin_error(&mut renderer, &scene, &lit(lamp, cell_mm));
        println!(
            "{two_d} {by_shapes} {with_tumor} {projection:?} {lamp:?} {cell_mm}: {off:.2e}, {:.1} % excused, {:.1} % shaded, {:.1} % by masks",
            100.0 * excused,
            100.0 * image,
            100.0 * masks
        );
        assert!(excused < 0.1 && image > 0.05, "{excused} {image}");
        assert_eq!(masks > 0.01, with_tumor, "{masks}");
        worst = worst.max(off);
    }
    worst
}
