//! Tests of every lighting mode: against its twin in `f64`, omitted passes, the stability table. A row of [`LIGHTS`]
//! inherits all of them.

mod image;
mod masks;
pub(crate) mod sheet;

use std::sync::Arc;

use glam::DVec3;
use glioscope_core::{
    Grid, Samples, Scaling, Selection, Volume,
    grid::ijk,
    optics::{Camera, Projection, Sight},
};

use super::{LIGHTS, lit::LitKind, slices};
use crate::{
    ContextRenderer, ContextScene,
    image::{
        ContextVolume, ControlPoint, Form, GRADIENT_OPACITY, GradientPoint, Shape, TransferFunction,
        buffers::ImageBuffers,
    },
    scene::{LightSettings, LightingMode, MaskColors, Palette, Quality},
    solid::SURFACE,
    testing::{GPU, noise, volume},
    views::context::context_plan,
};

pub(crate) const SIZE: [u32; 2] = [44, 36];

pub(crate) fn lit(mode: LightingMode) -> Quality {
    Quality { lighting: LightSettings { mode, ..LightSettings::DEFAULT }, ..Quality::FULL }
}

/// Soft lumps inside a ball, 0 at the image's faces.
pub(crate) fn lumps(grid: &Grid) -> Arc<ContextVolume> {
    let dims = grid.dims();
    let values = (0..grid.voxel_count())
        .map(|l| {
            let p = ijk(dims, l);
            let x = DVec3::from_array(std::array::from_fn(|a| (p[a] as f64 + 0.5) / dims[a] as f64 - 0.5));
            let wave = (x.x * 17.0).sin() + (x.y * 13.0 + 1.0).sin() + (x.z * 11.0 + 2.0).sin();
            (55.0 + 12.0 * wave + 4.0 * noise(p, 5)) * ((0.45 - x.length()) * 6.0).clamp(0.0, 1.0)
        })
        .collect();
    image_of(grid, values)
}

pub(crate) fn image_of(grid: &Grid, values: Vec<f64>) -> Arc<ContextVolume> {
    let image = Volume::new(grid.clone(), Samples::F64(values), Scaling::NONE).unwrap();
    Arc::new(ContextVolume::new(Arc::new(image)))
}

pub(crate) fn transfer(two_d: bool, opacity: f64) -> Arc<TransferFunction> {
    let rows =
        [(15.0, [90, 60, 40], 0.0), (50.0, [220, 160, 120], 0.5 * opacity), (90.0, [255, 250, 230], opacity)];
    let points = rows.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect();
    let gradient = two_d.then(|| {
        [(1.0, 0.2), (6.0, 0.6), (12.0, 1.0)]
            .map(|(gradient, factor)| GradientPoint { gradient, factor })
            .to_vec()
    });
    Arc::new(TransferFunction::new(points, gradient).unwrap())
}

/// A 2-D function of shapes whose edges are soft: hard ones lie within a cell of the device's table.
pub(crate) fn shaped() -> Arc<TransferFunction> {
    let forms = [
        Form::Box { values: [15.0, 95.0], gradients_per_mm: [0.0, 20.0], soft: 0.9 },
        Form::Blob {
            value: 50.0,
            gradient_per_mm: 5.0,
            value_deviation: 12.0,
            gradient_deviation_per_mm: 3.0,
        },
    ];
    let rest = [([90, 60, 200], 0.3), ([255, 250, 130], 0.6)];
    let shapes = forms.into_iter().zip(rest).map(|(form, (color, opacity))| Shape { form, color, opacity });
    let mut transfer = TransferFunction::transparent();
    transfer.set_shapes(Some(shapes.collect())).unwrap();
    Arc::new(transfer)
}

pub(crate) fn cubic(n: usize, spacing_mm: DVec3) -> Grid {
    Grid::axis_aligned([n; 3], spacing_mm, -spacing_mm * (n as f64 - 1.0) / 2.0).unwrap()
}

/// An image with a ragged ball as tumour in its middle.
pub(crate) fn scene(two_d: bool, with_tumor: bool, projection: Projection) -> ContextScene {
    let grid = cubic(36, DVec3::ONE);
    let tumor_grid = Grid::axis_aligned([11; 3], DVec3::splat(0.9), DVec3::new(-5.0, -3.0, -4.5)).unwrap();
    let tumor = with_tumor.then(|| {
        volume(&tumor_grid, 1, |_, p| {
            p.iter().map(|&c| (c as f64 - 5.0).powi(2)).sum::<f64>().sqrt() + 1.5 * noise(p, 4) < 5.0
        })
    });
    ContextScene {
        projection: None,
        camera: Camera::fit(DVec3::ZERO, 22.0, Camera::orientation(31.3, 19.7), projection),
        volume: Some(lumps(&grid)),
        transfer: transfer(two_d, if two_d { 0.9 } else { 0.35 }),
        clip: Vec::new(),
        tumor: tumor.flatten(),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 1]),
        lens: None,
        tubes: Vec::new(),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

/// Ranges of view depth in which the scene's image is visible, merged.
pub(crate) fn visible_depths_mm(scene: &ContextScene, sight: &Sight) -> Vec<(f64, f64)> {
    let mut cached = None;
    let volume = scene.volume.as_ref().unwrap();
    let buffers = ImageBuffers::reuse(&mut cached, &GPU, volume, &scene.transfer).unwrap();
    slices::occupied_depths_mm(&slices::visible_bounds(sight, buffers))
}

/// Pixels of a scene, drawn after `whole` has filled every buffer.
fn rgba_after(whole: &ContextScene, scene: &ContextScene, quality: &Quality) -> Vec<u8> {
    let mut renderer = ContextRenderer::new(&GPU).unwrap();
    renderer.render(&GPU, whole, quality, SIZE).unwrap();
    renderer.render(&GPU, scene, quality, SIZE).unwrap().read_rgba(&GPU).unwrap()
}

#[test]
fn every_lighting_mode_matches_its_twin() {
    for row in &LIGHTS {
        let off = (row.suite.max_twin_error)();
        println!("{:?}: largest difference from the twin {off:.2e}", row.mode);
        assert!(off <= 1e-3, "{:?}: {off}", row.mode);
    }
}

/// The passes that every lighting mode omits, the reasons, and that it changes no pixel.
#[test]
fn omitted_light_passes_change_no_pixel() {
    let whole = scene(true, true, Projection::Perspective);
    for row in &LIGHTS {
        let (mode, quality) = (row.mode, lit(row.mode));
        let reasons = |scene: &ContextScene| {
            let plan = context_plan(scene, &quality);
            let light_passes = (row.passes)(LitKind::Image).iter();
            light_passes.map(|pass| plan.reason(*pass)).collect::<Vec<_>>()
        };
        // But for those past fibres where there are none.
        let needs_all =
            |reasons: &[Option<&str>]| reasons.iter().all(|r| r.is_none_or(|r| r == "no fibre tracts"));
        assert!(needs_all(&reasons(&whole)), "{mode:?}: a whole scene needs every pass");
        // Opaque geometry without an image looks as with an image that the transfer function makes so
        // transparent that no light is lost.
        let alone = ContextScene { volume: None, ..whole.clone() };
        let points = [(1e6, [0; 3], 0.0), (2e6, [255; 3], 1e-9)]
            .map(|(value, color, opacity)| ControlPoint { value, color, opacity });
        let far = Arc::new(TransferFunction::new(points.to_vec(), None).unwrap());
        let unseen = ContextScene { transfer: far, ..whole.clone() };
        assert_eq!(
            context_plan(&unseen, &quality).passes,
            context_plan(&whole, &quality).passes[..]
                .to_vec()
                .into_iter()
                .filter(|p| *p != GRADIENT_OPACITY)
                .collect::<Vec<_>>(),
            "{mode:?}"
        );
        let (a, b) = (rgba_after(&whole, &alone, &quality), rgba_after(&whole, &unseen, &quality));
        let differing: Vec<_> = (0..a.len()).filter(|&i| a[i] != b[i]).map(|i| (i / 4, a[i], b[i])).collect();
        assert!(differing.is_empty(), "{mode:?}: {} {:?}", differing.len(), differing.first());
        let lights_opaque = reasons(&alone).iter().any(Option::is_none);
        // Nothing needs light: every light pass is omitted, with the reason.
        let nothing = ContextScene { tumor: None, ..alone };
        let known = ["no context image", "no mask is active", "no fibre tracts"];
        assert!(reasons(&nothing).iter().all(|r| r.is_some_and(|r| known.contains(&r))), "{mode:?}");
        // No opaque geometry: only the image's passes remain, as with an empty selection.
        let no_masks = ContextScene { tumor: None, ..whole.clone() };
        let mut hidden = whole.clone();
        hidden.selection.set(1, false);
        let omitted = |scene: &ContextScene| reasons(scene).iter().map(Option::is_some).collect::<Vec<_>>();
        assert_eq!(omitted(&no_masks).contains(&true), lights_opaque, "{mode:?}: passes on opaque geometry");
        assert_eq!(omitted(&no_masks), omitted(&hidden), "{mode:?}");
        // A 1-D transfer function needs no gradients, and looks as a 2-D one whose factor is 1 everywhere.
        let flat: Vec<GradientPoint> =
            [0.0, 1e6].map(|gradient| GradientPoint { gradient, factor: 1.0 }).to_vec();
        let points = whole.transfer.points().to_vec();
        let one_d = Arc::new(TransferFunction::new(points.clone(), None).unwrap());
        let two_d = Arc::new(TransferFunction::new(points, Some(flat)).unwrap());
        let plain = ContextScene { transfer: one_d, ..whole.clone() };
        let with = ContextScene { transfer: two_d, ..whole.clone() };
        let reason = context_plan(&plain, &quality).reason(GRADIENT_OPACITY);
        assert_eq!(reason, Some("transfer function is 1-D"));
        assert!(context_plan(&with, &quality).has(GRADIENT_OPACITY));
        assert!(rgba_after(&whole, &plain, &quality) == rgba_after(&whole, &with, &quality), "{mode:?}");
    }
}

/// Opaque geometry that hides nothing changes no pixel of the image, although other light passes then run.
#[test]
fn opaque_geometry_behind_the_camera_does_not_change_the_image() {
    let alone = scene(false, false, Projection::Perspective);
    // A tumour behind the camera.
    let mut behind = alone.clone();
    let eye = alone.camera.eye_mm() + alone.camera.axes()[2] * 60.0;
    let grid = Grid::axis_aligned([3; 3], DVec3::ONE, eye).unwrap();
    behind.tumor = volume(&grid, 1, |_, _| true);
    for row in &LIGHTS {
        let quality = lit(row.mode);
        assert!(context_plan(&behind, &quality).has(SURFACE));
        let (image, with) = (rgba_after(&alone, &alone, &quality), rgba_after(&alone, &behind, &quality));
        // Depths are then relative to another plane, so the last digit may differ.
        let off = image
            .chunks(4)
            .zip(with.chunks(4))
            .filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 1));
        let share = off.count() as f64 / f64::from(SIZE[0] * SIZE[1]);
        assert!(share <= row.suite.decided_by_rounding, "{:?}: {share}", row.mode);
    }
}
