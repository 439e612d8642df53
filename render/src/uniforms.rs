//! What the shaders read, laid out as they read it. A test compares every offset with naga's.

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, DVec4};
use glioscope_core::Grid;

use crate::{
    camera::{Camera, FIELD_OF_VIEW_DEG, Projection},
    plan::{PassName, Plan},
    quality::Quality,
    scene::{Lens, Scene},
};

pub(crate) const LENS_ON: u32 = 1;
pub(crate) const HAS_SURFACE: u32 = 2;
pub(crate) const HAS_OUTSIDE: u32 = 4;
pub(crate) const HAS_OCCLUSION: u32 = 8;
pub(crate) const NO_SKIPPING: u32 = 16;
pub(crate) const MANY_REGIONS: u32 = 32;
pub(crate) const LENS_ONLY_DRAWN: u32 = 64;
pub(crate) const HAS_CONTEXT: u32 = 128;
pub(crate) const HAS_TUBES: u32 = 512;
pub(crate) const LINEAR_LIGHT: u32 = 1024;

/// `View` of lib/view.wgsl; see there.
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
}

/// `Outside` of closeup_outside.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct OutsideHit {
    pub depth: f32,
    pub number: u32,
    pub face: u32,
    pub color: u32,
}

/// Depth from which a pixel is empty, `FAR` of lib/view.wgsl.
pub(crate) const FAR: f32 = 1e30;

pub(crate) fn rgba(rgb: [u8; 3]) -> [f32; 4] {
    let [r, g, b] = rgb.map(|c| f32::from(c) / 255.0);
    [r, g, b, 1.0]
}

fn single(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}

/// View depth of the plane that depths are counted from: the middle of what is drawn, never behind
/// the eye.
pub(crate) fn reference_to(camera: &Camera, middle_mm: DVec3) -> f64 {
    (camera.eye_mm() - middle_mm).dot(camera.axes()[2]).max(0.0)
}

/// As [`reference_to`] the middle of the tumour's box.
pub(crate) fn reference_mm(scene: &Scene) -> f64 {
    let middle_mm = scene.tumor.as_ref().map_or(scene.camera.focus_mm, |t| t.grid().center_mm());
    reference_to(&scene.camera, middle_mm)
}

/// A point in camera space: right, up, depth from the reference plane.
pub(crate) fn in_camera_space(camera: &Camera, reference_mm: f64, world_mm: DVec3) -> DVec3 {
    let [right, up, back] = camera.axes();
    let to = world_mm - camera.eye_mm();
    DVec3::new(to.dot(right), to.dot(up), -to.dot(back) - reference_mm)
}

/// What the uniform of every 3D view holds, whatever is drawn; `size` in pixels drawn.
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
        line_scale: (size[1] as f32 / 512.0).clamp(0.6, 4.0),
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

/// Index space of a volume on `grid` as seen by `camera`: corner, right, up, forward.
pub(crate) fn index_axes(camera: &Camera, reference_mm: f64, grid: &Grid) -> [[f32; 3]; 4] {
    let [right, up, back] = camera.axes();
    // Differences to the grid's own origin first: an offset of 1e6 mm costs no digit then.
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

/// The uniform of a scene; `size` in pixels drawn.
pub(crate) fn view(scene: &Scene, quality: &Quality, plan: &Plan, size: [u32; 2]) -> View {
    view_from(scene, reference_mm(scene), quality, plan, size)
}

/// As [`view`], with depths counted from a plane of the caller's.
pub(crate) fn view_from(
    scene: &Scene,
    reference_mm: f64,
    quality: &Quality,
    plan: &Plan,
    size: [u32; 2],
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
    for (pass, flag) in [
        (PassName::Surface, HAS_SURFACE),
        (PassName::Outside, HAS_OUTSIDE),
        (PassName::OcclusionBlur, HAS_OCCLUSION),
        (PassName::SolidCones, HAS_OCCLUSION),
        (PassName::Vicinity, HAS_OCCLUSION),
        (PassName::Context, HAS_CONTEXT),
        (PassName::Slices, HAS_CONTEXT | LINEAR_LIGHT),
        (PassName::LightGrid, LINEAR_LIGHT),
        (PassName::TubesMerge, HAS_TUBES),
        (PassName::ArrowsMerge, HAS_TUBES),
    ] {
        if plan.has(pass) {
            out.flags |= flag;
        }
    }
    if let Some(tumor) = &scene.tumor {
        let grid = tumor.grid();
        [out.corner, out.right, out.up, out.forward] = index_axes(camera, reference_mm, grid);
        out.depth_span_mm = (0.5 * grid.corners_mm()[0].distance(grid.corners_mm()[7])) as f32;
        out.voxel_mm = grid.spacing_mm().min_element() as f32;
    }
    out
}

/// One point of each pair that ambient occlusion tests: a spiral over the half ball, denser near
/// the middle.
pub(crate) fn occlusion_kernel(samples: u32) -> [[f32; 4]; 32] {
    let n = samples.clamp(1, Quality::MOST_SAMPLES);
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    std::array::from_fn(|i| {
        // The spiral's height orders the points; their radii must not follow it.
        let shuffled = (i * 7 + 3) as u32 % n;
        let z = 1.0 - (i as f64 + 0.5) / f64::from(n);
        let ring = (1.0 - z * z).max(0.0).sqrt();
        let radius = 0.2 + 0.8 * ((f64::from(shuffled) + 0.5) / f64::from(n)).powf(0.75);
        let (sin, cos) = (golden * i as f64).sin_cos();
        DVec4::new(radius * ring * cos, radius * ring * sin, radius * z, 0.0).as_vec4().to_array()
    })
}
