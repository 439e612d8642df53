// The normal of a surface that light falls on. After lib/depth_normal.

@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Whether normals are stored already; else they are found from depths, and stored.
override stored_normals: bool = false;

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
