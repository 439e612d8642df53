//! Synthetic scenes: the head phantom and soft balls.

use std::sync::{Arc, LazyLock};

use glam::DVec3;
use glioscope_core::{
    Grid, Mask, MaskBits, RegionVolume, Regions, Samples, Scaling, Selection, TumorIndex, Volume,
    case::TimePoint,
    optics::{Camera, Projection},
    phantom,
};
use glioscope_render::{
    ContextScene, ContextVolume, ControlPoint, MaskColors, Palette, RegionScene, TransferFunction,
    TransferPreset,
};

use crate::Outcome;

/// The phantom's first time point, built once for all families.
pub(super) fn phantom() -> Outcome<&'static TimePoint> {
    static FIRST: LazyLock<Result<TimePoint, String>> = LazyLock::new(|| {
        let case = phantom::phantom_case().map_err(|e| e.to_string())?;
        case.time_points.into_iter().next().ok_or_else(|| "the phantom has no date".to_owned())
    });
    Ok(FIRST.as_ref().map_err(Clone::clone)?)
}

/// The phantom's post-contrast image.
pub(super) fn phantom_image() -> Outcome<Arc<ContextVolume>> {
    let context = phantom()?.contexts.iter().find(|c| c.id == "T1c").ok_or("the phantom has no T1c image")?;
    Ok(Arc::new(ContextVolume::new(Arc::clone(&context.volume))))
}

/// The phantom's masks in the closeup, with all regions selected and without the lens.
pub(super) fn phantom_closeup() -> Outcome<RegionScene> {
    let time = phantom()?;
    let tumor = Arc::new(RegionVolume::of(&time.index, &time.regions).ok_or("the phantom has no tumour")?);
    let center_mm = tumor.grid().center_mm();
    let radius_mm = 0.75 * tumor.grid().corners_mm()[0].distance(center_mm);
    Ok(RegionScene {
        tumor: Some(tumor),
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &vec![None; time.masks.len()]),
        lens: None,
        camera: camera(center_mm, radius_mm),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
        plane: None,
    })
}

/// The value of a shape of deep folds at a place in millimetres, positive inside: a gyroid in a ball of 22 mm.
fn folds_at(p: DVec3) -> f64 {
    let q = p / 3.6;
    let sheet = q.x.sin() * q.y.cos() + q.y.sin() * q.z.cos() + q.z.sin() * q.x.cos();
    (sheet + 0.15).min(0.15 * (22.0 - p.length()))
}

/// A mask of deep folds in the closeup, 1 mm voxels.
pub(super) fn folds_closeup() -> Outcome<RegionScene> {
    let grid = Grid::axis_aligned([48; 3], DVec3::ONE, DVec3::splat(-23.5))?;
    let inside = |l: usize| folds_at(grid.center_of_voxel_mm(grid.ijk(l))) > 0.0;
    let bits = MaskBits::from_fn(grid.dims(), inside);
    let mask = Mask::new("folds".to_owned(), grid.clone(), bits).ok_or("a mask that doesn't fit its grid")?;
    let index = TumorIndex::new(grid, &[&mask])?;
    let tumor = RegionVolume::of(&index, &Regions::of(&index)).ok_or("folds without a voxel")?;
    Ok(RegionScene {
        tumor: Some(Arc::new(tumor)),
        colors: MaskColors::new(Palette::Thesis, &[None]),
        camera: camera(DVec3::ZERO, 24.0),
        ..phantom_closeup()?
    })
}

/// A perspective camera, slightly from above and the side, that frames a sphere.
fn camera(focus_mm: DVec3, radius_mm: f64) -> Camera {
    Camera::fit(focus_mm, radius_mm, Camera::orientation(31.3, 19.7), Projection::Perspective)
}

/// A scene of an image alone; the camera frames a sphere of `zoom` times the image's half diagonal.
fn image_scene(volume: Arc<ContextVolume>, transfer: TransferFunction, zoom: f64) -> ContextScene {
    let grid = volume.grid();
    let center_mm = grid.center_mm();
    let radius_mm = zoom * grid.corners_mm()[0].distance(center_mm);
    ContextScene {
        projection: None,
        transfer: Arc::new(transfer),
        volume: Some(volume),
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[]),
        lens: None,
        tubes: Vec::new(),
        camera: camera(center_mm + DVec3::Z, radius_mm),
        background: [255, 255, 255],
        silhouette: [0, 0, 0],
    }
}

/// A scene of the phantom's image with a preset transfer function.
pub(super) fn head(volume: &Arc<ContextVolume>, preset: TransferPreset) -> ContextScene {
    let transfer = preset.transfer(volume.statistics());
    image_scene(Arc::clone(volume), transfer, 0.62)
}

/// Three soft overlapping balls in `n`³ voxels of 1 mm: translucent outside, dense inside.
pub(super) fn soft_balls(n: usize) -> Outcome<ContextScene> {
    let grid = Grid::axis_aligned([n; 3], DVec3::ONE, DVec3::splat(-(n as f64 - 1.0) / 2.0))?;
    let ball = |at: DVec3, c: DVec3, r: f64| (1.0 - (at - c).length() / r).max(0.0);
    let value = |linear: usize| {
        // From -1/2 to 1/2 over the grid.
        let at = grid.center_of_voxel_mm(grid.ijk(linear)) / (n as f64 - 1.0);
        let sum = ball(at, DVec3::new(-0.15, 0.05, 0.1), 0.32)
            + ball(at, DVec3::new(0.2, -0.1, 0.25), 0.2)
            + ball(at, DVec3::new(0.05, 0.1, -0.25), 0.4);
        sum as f32
    };
    let values = (0..grid.voxel_count()).map(value).collect();
    let volume =
        Volume::new(grid, Samples::F32(values), Scaling::NONE).ok_or("values that don't fit their grid")?;
    let point = |value, color, opacity| ControlPoint { value, color, opacity };
    let points = vec![
        point(0.2, [242, 188, 148], 0.0),
        point(0.4, [242, 203, 148], 0.11),
        point(0.6, [148, 218, 242], 0.3),
        point(0.8, [148, 218, 242], 0.45),
    ];
    let volume = Arc::new(ContextVolume::new(Arc::new(volume)));
    Ok(image_scene(volume, TransferFunction::new(points, None)?, 0.62))
}
