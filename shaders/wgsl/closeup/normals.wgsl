// Normal of the surface at each pixel, for shading and ambient occlusion: the gradient of the shown voxels smoothed by
// about a voxel, at the point that is hit. On the cut of the lens, the lens's own.
#include lib/view
#include lib/normal
#include lib/shown
#include lib/smoothed

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Visible surfaces face the eye at least by this cosine; a smoothed normal needn't.
const LEAST_FACING = 0.02;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        normals[at] = 0u;
        return;
    }
    let sight = sight_of(id.xy);
    let c = point_at(id.xy, depth);
    var n = -sight;
    if surfaces[at].y == 3u {
        // The ray began in the voxel: on the lens, or at the eye.
        let out = c - view.lens.xyz;
        let on_lens = (flags() & LENS_ON) != 0u && abs(length(out) - view.lens.w) < 1e-3 * view.lens.w;
        n = select(n, out / max(view.lens.w, 1e-6), on_lens);
    } else {
        let inwards = smoothed_at(view.corner + c.x * view.right + c.y * view.up + c.z * view.forward).inwards;
        let out = -vec3<f32>(dot(inwards, view.right), dot(inwards, view.up), dot(inwards, view.forward));
        let size = length(out);
        n = select(n, out / max(size, 1e-30), size > 1e-6);
    }
    n = normalize(n - sight * max(LEAST_FACING + dot(n, sight), 0.0));
    normals[at] = packed_normal(n);
}
