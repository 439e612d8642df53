// Where rays of light from a surface start: its normal, and a point above it. After lib/depth_normal.

@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Whether normals are stored already; else they are found from depths, and stored.
override stored_normals: bool = false;

// Rays start this far above the surface, along the axis of voxels that the normal is closest to: above the steps between
// voxels, which would hide a part of every slanted plane from itself.
const LIFT = 1.0;

fn normal_of(id: vec2<u32>, surface: vec3<f32>) -> vec3<f32> {
    var n = vec3<f32>(0.0);
    if stored_normals {
        n = unpacked_normal(normals[linear_index(id)]);
    } else {
        n = normal_among(vec2<i32>(id), surface);
        normals[linear_index(id)] = packed_normal(n);
    }
    return n;
}

fn lifted(surface: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    let steep = n.x * view.right + n.y * view.up + n.z * view.forward;
    return surface + n * (LIFT / max(max(abs(steep.x), abs(steep.y)), abs(steep.z)));
}
