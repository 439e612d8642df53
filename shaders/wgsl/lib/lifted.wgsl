// Where rays of light from a surface start: its normal, and a point above it.

@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Whether normals are stored already; else they are found from depths, and stored.
override stored_normals: bool = false;

// Rays start this far above the surface, along the axis of voxels that the normal is closest to: above the steps between
// voxels, which would hide a part of every slanted plane from itself.
const LIFT = 1.0;

// From depths; of voxels the mean of nine, as far apart as voxels are, or the faces between them would be lit instead of
// the surface.
fn normal_among(here: vec2<i32>, c: vec3<f32>) -> vec3<f32> {
    var sum = normal_from_depths(here, c, sight_of(vec2<u32>(here)));
    if stepped {
        let apart = clamp(i32(round(view.voxel_mm / footprint_mm(c.z))), 1, 8);
        for (var k = 0; k < 9; k++) {
            let there = here + apart * vec2<i32>(k % 3 - 1, k / 3 - 1);
            let inside = all(there >= vec2<i32>(0)) && all(there < vec2<i32>(view.size));
            let q = point_of(there);
            if inside && k != 4 && abs(q.z - c.z) < 3.0 * view.voxel_mm {
                sum += normal_from_depths(there, q, sight_of(vec2<u32>(there)));
            }
        }
    }
    return sum / max(length(sum), 1e-12);
}

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
