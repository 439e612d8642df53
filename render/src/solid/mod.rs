//! Opaque geometry on the device: region volumes as bricks, fibre tubes, a slice as a plane; the uniform and the render
//! targets of every 3D view.

pub(crate) mod bricks;
pub(crate) mod plane;
pub(crate) mod regions;
pub(crate) mod shown;
pub(crate) mod targets;
pub mod tubes;
#[cfg(test)]
pub(crate) mod twin;
pub(crate) mod view;

use glam::DVec3;

use crate::device::PassName;

/// First shown voxel along each ray: inside the lens, or anywhere when it is off.
pub(crate) const SURFACE: PassName = PassName::new("surface");
/// The same on the level set of the smoothed voxels, for the eye only.
pub(crate) const SMOOTH: PassName = PassName::new("smooth");
/// Its normals.
pub(crate) const NORMALS: PassName = PassName::new("normals");
/// What surrounds it: the closeup's faint outer level, the change view's veil.
pub(crate) const OUTSIDE: PassName = PassName::new("outside");

/// Corners of a box between its least and its greatest.
pub(crate) fn corners_mm((low, high): (DVec3, DVec3)) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { high[a] } else { low[a] }))
    })
}

/// For the layout test.
#[cfg(test)]
pub(crate) const LAYOUTS: &[crate::layouts::Layout] = {
    use crate::layouts::layout;
    use tubes::buffers::{Fiber, TubePoint, TubesUniform};
    let [view, outside] = view::LAYOUTS;
    &[
        view,
        outside,
        layout!(plane::PlaneUniform, "Plane": corner, opacity, to_u, width, to_v, height, normal, unused),
        layout!(TubesUniform, "Tubes": right, least_px, up, unused_a, away, unused_b, origin, unused_c),
        layout!(TubePoint, "TubePoint": place, what),
        layout!(Fiber, "Fiber": color, radius_mm),
    ]
};
