//! Ellipsoids in the shaders' layout, and the tiles of the frame that each may touch. Pure.

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};
use glioscope_core::optics::{FIELD_OF_VIEW_DEG, Projection};

use crate::{
    device::RenderError,
    solid::view::in_camera_space,
    views::ellipsoids::{DrawnEllipsoid, EllipsoidScene},
};

/// Pixels along a tile's side, `TILE` of lib/ellipsoid.wgsl.
pub(super) const TILE: u32 = 16;

/// `Ellipsoid` of lib/ellipsoid.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct GpuEllipsoid {
    pub center: [f32; 3],
    pub opacity: f32,
    pub unit_from_x: [f32; 3],
    pub color: u32,
    pub unit_from_y: [f32; 3],
    pub id: u32,
    pub unit_from_z: [f32; 3],
    pub unused: u32,
}

/// The ellipsoids that are drawn, in the order of their numbers: by id, then by all other fields, so that
/// the order of the scene's list doesn't affect the frame.
pub(super) fn in_order(scene: &EllipsoidScene) -> Vec<DrawnEllipsoid> {
    let key = |e: &DrawnEllipsoid| {
        let mut bits = [0; 16];
        let [x, y, z] = e.rotation.to_cols_array_2d();
        let numbers = [e.center_mm.to_array(), e.semi_axes_mm.to_array(), x, y, z]
            .into_iter()
            .flatten()
            .chain([e.opacity]);
        for (bit, number) in bits.iter_mut().zip(numbers) {
            *bit = number.to_bits();
        }
        (e.id, bits, e.color)
    };
    let mut drawn: Vec<DrawnEllipsoid> =
        scene.ellipsoids.iter().filter(|e| scene.opacity_of(e) > 0.0).copied().collect();
    drawn.sort_by_cached_key(key);
    drawn
}

/// Rotates world axes into camera space: right, up, away.
fn camera_from_world(scene: &EllipsoidScene) -> DMat3 {
    let [right, up, back] = scene.camera.axes();
    DMat3::from_cols(right, up, -back).transpose()
}

/// The ellipsoids in the shaders' layout.
///
/// # Errors
/// [`RenderError::Scene`] for an invalid ellipsoid.
pub(super) fn packed(
    scene: &EllipsoidScene,
    drawn: &[DrawnEllipsoid],
    reference_mm: f64,
) -> Result<Vec<GpuEllipsoid>, RenderError> {
    let world_from_camera = camera_from_world(scene).transpose();
    drawn
        .iter()
        .map(|e| {
            let square = e.rotation.transpose() * e.rotation;
            let off =
                (square - DMat3::IDENTITY).to_cols_array().into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            let unit_from_camera =
                DMat3::from_diagonal(e.semi_axes_mm.recip()) * e.rotation.transpose() * world_from_camera;
            let columns = [unit_from_camera.x_axis, unit_from_camera.y_axis, unit_from_camera.z_axis]
                .map(|c| c.as_vec3());
            let center = in_camera_space(&scene.camera, reference_mm, e.center_mm).as_vec3();
            let is_valid = off < 1e-3
                && e.semi_axes_mm.is_finite()
                && e.semi_axes_mm.min_element() > 0.0
                && center.is_finite()
                && columns.iter().all(|c| c.is_finite());
            if !is_valid {
                return Err(RenderError::Scene(format!("{e:?}")));
            }
            let [r, g, b] = e.color.map(u32::from);
            Ok(GpuEllipsoid {
                center: center.to_array(),
                opacity: scene.opacity_of(e) as f32,
                unit_from_x: columns[0].to_array(),
                color: r | g << 8 | b << 16,
                unit_from_y: columns[1].to_array(),
                id: e.id,
                unit_from_z: columns[2].to_array(),
                unused: 0,
            })
        })
        .collect()
}

/// Pixels from low up to, not including, high, in x and y.
pub(super) type PixelBox = [[u32; 2]; 2];

/// A box around the pixels whose centres may show the ellipsoid; `None` if there are none.
pub(super) fn pixel_box(scene: &EllipsoidScene, e: &DrawnEllipsoid, size: [u32; 2]) -> Option<PixelBox> {
    let camera = &scene.camera;
    let axes = camera_from_world(scene) * e.rotation * DMat3::from_diagonal(e.semi_axes_mm);
    // The support of the ellipsoid along n is sqrt(n . spread n).
    let spread = axes * axes.transpose();
    let center = in_camera_space(camera, 0.0, e.center_mm);
    let reach = spread.col(2)[2].sqrt();
    if center.z + reach <= 0.0 {
        return None;
    }
    let full = [[0, 0], size];
    let mut out = full;
    for axis in 0..2 {
        let (low, high, mm_per_pixel) = match camera.projection {
            Projection::Orthographic => {
                let half = spread.col(axis)[axis].sqrt();
                (center[axis] - half, center[axis] + half, camera.height_mm / f64::from(size[1]))
            }
            Projection::Perspective => {
                // Planes through the eye that touch it: (n . center)^2 = n . spread n, n = (1, -k).
                if center.z - reach <= 1e-9 * center.z.abs().max(reach) {
                    return Some(full);
                }
                let a = center.z * center.z - spread.col(2)[2];
                let b = center[axis] * center.z - spread.col(axis)[2];
                let c = center[axis] * center[axis] - spread.col(axis)[axis];
                let root = (b * b - a * c).max(0.0).sqrt();
                let tan = (FIELD_OF_VIEW_DEG / 2.0).to_radians().tan();
                ((b - root) / a, (b + root) / a, 2.0 * tan / f64::from(size[1]))
            }
        };
        let half = f64::from(size[axis]) / 2.0;
        // Rows are counted from the top. One more pixel on each side allows for rounding.
        let (from, to) = if axis == 0 {
            (half + low / mm_per_pixel, half + high / mm_per_pixel)
        } else {
            (half - high / mm_per_pixel, half - low / mm_per_pixel)
        };
        if from.is_nan() || to.is_nan() {
            return Some(full);
        }
        out[0][axis] = ((from - 1.5).floor().max(0.0) as u32).min(size[axis]);
        out[1][axis] = ((to + 1.5).ceil().max(0.0) as u32).min(size[axis]);
    }
    let [low, high] = out;
    (low[0] < high[0] && low[1] < high[1]).then_some(out)
}

/// The ellipsoids that each tile must test.
#[derive(Debug)]
pub(super) struct Bins {
    /// Start of each tile's numbers, end of the last tile's, then the numbers, ascending within a tile.
    pub tiles: Vec<u32>,
    /// Upper bound of the number of fragments.
    pub most_fragments: u64,
}

impl Bins {
    /// # Errors
    /// [`RenderError::Buffer`] when the lists alone need more than `limit` bytes.
    pub fn of(boxes: &[Option<PixelBox>], size: [u32; 2], limit: u64) -> Result<Self, RenderError> {
        let columns = size[0].div_ceil(TILE);
        let count = columns as usize * size[1].div_ceil(TILE) as usize;
        let touched = |[low, high]: PixelBox| {
            let columns_of = move || low[0] / TILE..high[0].div_ceil(TILE);
            (low[1] / TILE..high[1].div_ceil(TILE))
                .flat_map(move |y| columns_of().map(move |x| (y * columns + x) as usize))
        };
        let drawn = || boxes.iter().zip(0u32..).filter_map(|(b, number)| Some(((*b)?, number)));
        let mut sizes = vec![0u64; count];
        let mut most_fragments = 0;
        for (pixels, _) in drawn() {
            let [low, high] = pixels;
            most_fragments += 2 * u64::from(high[0] - low[0]) * u64::from(high[1] - low[1]);
            for tile in touched(pixels) {
                sizes[tile] += 1;
            }
        }
        let words = count as u64 + 1 + sizes.iter().sum::<u64>();
        if words * 4 > limit || words > u64::from(u32::MAX) {
            return Err(RenderError::Buffer {
                what: "the ellipsoids of every tile",
                found: words * 4,
                limit,
            });
        }
        let mut tiles = vec![0; words as usize];
        let mut at = count as u32 + 1;
        for (start, size) in tiles.iter_mut().zip(&sizes) {
            *start = at;
            at += *size as u32;
        }
        tiles[count] = at;
        let mut next: Vec<u32> = tiles[..count].to_vec();
        for (pixels, number) in drawn() {
            for tile in touched(pixels) {
                tiles[next[tile] as usize] = number;
                next[tile] += 1;
            }
        }
        Ok(Self { tiles, most_fragments })
    }
}

/// Whether a point lies in a lens's ball, its surface included.
pub(super) fn in_lens(scene: &EllipsoidScene, world_mm: DVec3) -> bool {
    scene.lens.is_none_or(|lens| world_mm.distance(lens.center_mm) <= lens.radius_mm)
}

/// For the test of layouts.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = &[
    crate::layouts::layout!(
        GpuEllipsoid, "Ellipsoid": center, opacity, unit_from_x, color, unit_from_y, id, unit_from_z, unused
    ),
    crate::layouts::Layout {
        name: "Counters",
        bytes: 16,
        fields: &[("nodes", 0), ("wraps", 4), ("last_nodes", 8), ("last_wraps", 12)],
    },
];
