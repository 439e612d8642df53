// Places of opaque surfaces that paths start from.
#include lib/view
#include lib/normal
#include lib/depth_normal
#include lib/path_state

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Whether normals are stored already; else they are found from depths, and stored.
override stored_normals: bool = false;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    var place = vec4<u32>(0u);
    if depth < FAR {
        if !stored_normals {
            normals[at] = packed_normal(normal_among(vec2<i32>(id.xy), point_at(id.xy, depth)));
        }
        place = vec4<u32>(bitcast<u32>(depth), normals[at], bitcast<u32>(1.0), 0u);
    }
    pixels[at] = Pixel(vec4<f32>(0.0), vec4<f32>(0.0), place);
}
