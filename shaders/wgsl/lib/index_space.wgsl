// Vectors and places of camera space in index space, and the height of the steps between voxels.

fn in_index_space(v: vec3<f32>) -> vec3<f32> {
    return v.x * view.right + v.y * view.up + v.z * view.forward;
}

fn place_in_index_space(c: vec3<f32>) -> vec3<f32> {
    return view.corner + c.x * view.right + c.y * view.up + c.z * view.forward;
}

// Rays from a surface start this far above it, along the axis of voxels that the normal is closest to: above the steps between
// voxels, which would hide a part of every slanted plane from itself.
const LIFT = 1.0;

// From the surface to where its rays start.
fn lift_of(n: vec3<f32>) -> vec3<f32> {
    let steep = abs(in_index_space(n));
    return n * (LIFT / max(max(steep.x, steep.y), steep.z));
}
