//! The uniform of every 3D view, with the shaders' layout. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid,
    optics::{Camera, FIELD_OF_VIEW_DEG, Projection},
};

use crate::scene::{Lens, Quality, RegionScene};

pub(crate) const LENS_ON: u32 = 1;
pub(crate) const HAS_SURFACE: u32 = 2;
pub(crate) const HAS_OUTSIDE: u32 = 4;
pub(crate) const HAS_OCCLUSION: u32 = 8;
pub(crate) const NO_SKIPPING: u32 = 16;
pub(crate) const MANY_REGIONS: u32 = 32;
pub(crate) const LENS_ONLY_DRAWN: u32 = 64;
pub(crate) const HAS_CONTEXT: u32 = 128;
pub(crate) const HAS_TUBES: u32 = 512;
pub(crate) const HAS_PROJECTION: u32 = 4096;
pub(crate) const LINEAR_LIGHT: u32 = 1024;
pub(crate) const SMOOTH_SURFACE: u32 = 2048;
pub(crate) const TINTED: u32 = 8192;

/// `View` of lib/view; see there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct View {
    pub corner: [f32; 3],
    pub mm_per_pixel: f32,
    pub right: [f32; 3],
    pub mm_per_pixel_per_mm: f32,
    pub up: [f32; 3],
    pub nearest_mm: f32,
    pub forward: [f32; 3],
    pub voxel_mm: f32,
    pub dims: [u32; 3],
    pub log2_ids_per_word: u32,
    pub bricks: [u32; 3],
    pub selected: u32,
    pub lens: [f32; 4],
    pub background: [f32; 4],
    pub silhouette: [f32; 4],
    pub size: [u32; 2],
    pub flags: u32,
    pub occlusion_samples: u32,
    pub occlusion_radius_mm: f32,
    pub occlusion_strength: f32,
    pub color_bleeding: f32,
    pub line_scale: f32,
    pub depth_span_mm: f32,
    pub outside_opacity: f32,
    pub inner_line_strength: f32,
    pub outer_line_strength: f32,
    pub relief: f32,
    /// At most, of each pixel's stored occlusion; 0 where it isn't by rays.
    pub occlusion_rays: f32,
    pub unused_b: f32,
    pub unused_c: f32,
}

/// `Outside` of closeup/outside.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct OutsideHit {
    pub depth: f32,
    pub number: u32,
    pub face: u32,
    pub color: u32,
}

/// Depth of an empty pixel, `FAR` of lib/view.
pub(crate) const FAR: f32 = 1e30;

pub(crate) fn rgba(rgb: [u8; 3]) -> [f32; 4] {
    let [r, g, b] = rgb.map(|c| f32::from(c) / 255.0);
    [r, g, b, 1.0]
}

fn single(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// View depth of the reference plane, from which depths are measured: through the centre of what is drawn,
/// never behind the eye.
pub(crate) fn reference_to(camera: &Camera, middle_mm: DVec3) -> f64 {
    (camera.eye_mm() - middle_mm).dot(camera.axes()[2]).max(0.0)
}

/// As [`reference_to`] for the centre of the tumour's box, or the focus without a tumour.
pub(crate) fn reference_mm(scene: &RegionScene) -> f64 {
    let middle_mm = scene.tumor.as_ref().map_or(scene.camera.focus_mm, |t| t.grid().center_mm());
    reference_to(&scene.camera, middle_mm)
}

/// A point in camera space: right, up, depth from the reference plane.
pub(crate) fn in_camera_space(camera: &Camera, reference_mm: f64, world_mm: DVec3) -> DVec3 {
    let [right, up, back] = camera.axes();
    let to = world_mm - camera.eye_mm();
    DVec3::new(to.dot(right), to.dot(up), -to.dot(back) - reference_mm)
}

/// The part of the uniform that every 3D view has, whatever it draws; `size` in drawn pixels.
pub(crate) fn camera_view(
    camera: &Camera,
    reference_mm: f64,
    lens: Option<&Lens>,
    quality: &Quality,
    size: [u32; 2],
) -> View {
    let at_focus = camera.height_mm / f64::from(size[1]);
    let (mm_per_pixel, growth) = match camera.projection {
        Projection::Orthographic => (at_focus, 0.0),
        Projection::Perspective => {
            let growth = 2.0 * (FIELD_OF_VIEW_DEG / 2.0).to_radians().tan() / f64::from(size[1]);
            (growth * reference_mm, growth)
        }
    };
    let mut out = View {
        mm_per_pixel: mm_per_pixel as f32,
        mm_per_pixel_per_mm: growth as f32,
        nearest_mm: -reference_mm as f32,
        voxel_mm: 1.0,
        size,
        occlusion_samples: quality.occlusion_samples.clamp(1, Quality::MOST_SAMPLES),
        occlusion_radius_mm: quality.occlusion_radius_mm.clamp(0.0, 1e6) as f32,
        occlusion_strength: quality.occlusion_strength.clamp(0.0, 1.0) as f32,
        color_bleeding: quality.color_bleeding.clamp(0.0, 1.0) as f32,
        relief: quality.relief.clamp(0.0, 1.0) as f32,
        line_scale: line_scale(size),
        depth_span_mm: 1.0,
        ..View::default()
    };
    if let Some(lens) = lens {
        let center = in_camera_space(camera, reference_mm, lens.center_mm);
        out.lens = center.extend(lens.radius_mm).as_vec4().to_array();
        out.flags |= LENS_ON;
    }
    out
}

/// Camera axes in the index space of a volume on `grid`: corner, right, up, forward.
pub(crate) fn index_axes(camera: &Camera, reference_mm: f64, grid: &Grid) -> [[f32; 3]; 4] {
    let [right, up, back] = camera.axes();
    // Relative to the grid's own origin first: an offset of 1e6 mm then costs no precision.
    let world_from_voxel = grid.world_from_voxel();
    let voxel_from_mm: DMat3 = world_from_voxel.matrix3.inverse();
    let corner_mm = camera.eye_mm() - world_from_voxel.translation - back * reference_mm;
    [
        single(voxel_from_mm * corner_mm + DVec3::splat(0.5)),
        single(voxel_from_mm * right),
        single(voxel_from_mm * up),
        single(voxel_from_mm * -back),
    ]
}

/// Widths of lines, 1 for a frame 512 pixels high.
pub(crate) fn line_scale(size: [u32; 2]) -> f32 {
    (size[1] as f32 / 512.0).clamp(0.6, 4.0)
}

/// The uniform of a scene with depths measured from `reference_mm`; `size` in drawn pixels, `flags` as the plan and
/// the lighting mode require.
pub(crate) fn region_view(
    scene: &RegionScene,
    reference_mm: f64,
    quality: &Quality,
    size: [u32; 2],
    flags: u32,
) -> View {
    let camera = &scene.camera;
    let mut out = View {
        background: rgba(scene.background),
        silhouette: rgba(scene.silhouette),
        outside_opacity: 0.13,
        inner_line_strength: 0.7,
        outer_line_strength: 0.4,
        ..camera_view(camera, reference_mm, scene.lens.as_ref(), quality, size)
    };
    out.flags |= flags;
    if let Some(tumor) = &scene.tumor {
        let grid = tumor.grid();
        [out.corner, out.right, out.up, out.forward] = index_axes(camera, reference_mm, grid);
        out.depth_span_mm = (0.5 * grid.corners_mm()[0].distance(grid.corners_mm()[7])) as f32;
        out.voxel_mm = grid.spacing_mm().min_element() as f32;
    }
    out
}

/// The drawn pixel at the centre of a requested one, which is inside `requested_px`.
pub(crate) fn drawn_pixel(pixel: [u32; 2], requested_px: [u32; 2], drawn_px: [u32; 2]) -> [u32; 2] {
    std::array::from_fn(|a| {
        let at = (f64::from(pixel[a]) + 0.5) * f64::from(drawn_px[a]) / f64::from(requested_px[a]);
        (at as u32).min(drawn_px[a] - 1)
    })
}

/// The point at `depth` (from the reference plane) under a drawn pixel, in f64 throughout.
pub(crate) fn world_at(
    camera: &Camera,
    reference_mm: f64,
    size_px: [u32; 2],
    pixel: [u32; 2],
    depth: f32,
) -> DVec3 {
    let size = DVec2::new(f64::from(size_px[0]), f64::from(size_px[1]));
    let center = DVec2::new(f64::from(pixel[0]) + 0.5, f64::from(pixel[1]) + 0.5);
    let ray = camera.ray(center, size);
    let along = ray.direction.dot(-camera.axes()[2]);
    ray.origin_mm + ray.direction * ((reference_mm + f64::from(depth)) / along)
}

/// For the layout test.
#[cfg(test)]
pub(crate) const LAYOUTS: [crate::layouts::Layout; 2] = [
    crate::layouts::layout!(
        View, "View": corner, mm_per_pixel, right, mm_per_pixel_per_mm, up, nearest_mm, forward, voxel_mm, dims,
        log2_ids_per_word, bricks, selected, lens, background, silhouette, size, flags, occlusion_samples,
        occlusion_radius_mm, occlusion_strength, color_bleeding, line_scale, depth_span_mm, outside_opacity,
        inner_line_strength, outer_line_strength, relief, occlusion_rays, unused_b, unused_c
    ),
    crate::layouts::layout!(OutsideHit, "Outside": depth, number, face, color),
];
