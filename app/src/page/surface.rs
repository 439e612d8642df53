//! Surfaces as a page stores them: positions of 16 bits.

use glioscope_core::{
    Mask, Progress,
    export::{self, MeshError, SurfaceKind},
    glam::DVec3,
};

use super::simplify::simplified;

/// The largest stored coordinate.
const LARGEST: f64 = 65_535.0;

/// A closed surface of triangles.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// World millimetres of the stored position 0, 0, 0.
    pub origin_mm: [f64; 3],
    /// Length of a stored unit, the same along all axes, so that directions are those of the stored positions.
    pub step_mm: f64,
    /// The vertices.
    pub positions: Vec<[u16; 3]>,
    /// The vertices of each triangle, counterclockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// The smoothed surface of a mask, simplified by at most about `error_mm`; `None` where it is empty.
    pub(super) fn of_mask(
        mask: &Mask,
        error_mm: f64,
        progress: &Progress,
    ) -> Result<Option<Self>, MeshError> {
        let mesh = match export::mesh(mask, SurfaceKind::Smoothed, progress) {
            Ok(mesh) => mesh,
            Err(MeshError::Empty) => return Ok(None),
            Err(why) => return Err(why),
        };
        let (positions_mm, triangles) = simplified(mesh.positions_mm(), mesh.triangles(), error_mm);
        progress.check()?;
        Ok(Some(Self::of_triangles(&positions_mm, triangles)))
    }

    /// The nearest stored positions.
    pub(super) fn of_triangles(positions_mm: &[DVec3], triangles: Vec<[u32; 3]>) -> Self {
        let (lo, hi) = bounds(positions_mm);
        let step_mm = ((hi - lo).max_element() / LARGEST).max(f64::MIN_POSITIVE);
        let stored = |mm: f64| (mm / step_mm).round().clamp(0.0, LARGEST) as u16;
        let positions = positions_mm.iter().map(|p| (*p - lo).to_array().map(stored)).collect();
        Self { origin_mm: lo.to_array(), step_mm, positions, triangles }
    }

    /// The vertices, world millimetres.
    pub fn positions_mm(&self) -> Vec<DVec3> {
        let origin_mm = DVec3::from_array(self.origin_mm);
        self.positions
            .iter()
            .map(|p| origin_mm + DVec3::from_array(p.map(f64::from)) * self.step_mm)
            .collect()
    }

    /// First and last corner of its box, world millimetres.
    pub(super) fn bounds_mm(&self) -> (DVec3, DVec3) {
        bounds(&self.positions_mm())
    }

    /// Positions as bytes, little-endian.
    pub(super) fn position_bytes(&self) -> Vec<u8> {
        self.positions.iter().flatten().flat_map(|v| v.to_le_bytes()).collect()
    }

    /// Indices as bytes, little-endian, 16 bits each where that suffices, and whether they are of 32 bits.
    pub(super) fn index_bytes(&self) -> (Vec<u8>, bool) {
        let all = || self.triangles.iter().flatten();
        if self.positions.len() <= 1 << 16 {
            (all().flat_map(|v| (*v as u16).to_le_bytes()).collect(), false)
        } else {
            (all().flat_map(|v| v.to_le_bytes()).collect(), true)
        }
    }
}

/// First and last corner of the points' box; zeros without points.
pub(super) fn bounds(points: &[DVec3]) -> (DVec3, DVec3) {
    let Some(first) = points.first() else { return Default::default() };
    points.iter().fold((*first, *first), |(lo, hi), p| (lo.min(*p), hi.max(*p)))
}
